"""How does the observer-free law stop the Van der Pol oscillator when nothing disturbs it?

The paper's figure 5, and the reference for vdp_noise and vdp_disturbance. The paper reports smooth
and fast convergence without chattering. The rivals run beside it.

Look for: a u without corners, and how much later x arrives than u leaves its bound.
"""

import smc_mujoco as smc


def answer(runs):
    paper = runs.only("observer_free")
    settled = runs.select()
    return (
        f"{paper.count('settle')} (settling time {paper.size('settling_time')}, variation of u at "
        f"the end {paper.size('tv_rate')}); first of all: {settled.least('settling_time')}; least "
        f"variation of u: {settled.least('tv_rate')}"
    )


scene = smc.Scene(
    title="Van der Pol oscillator, nominal",
    conditions={"nominal": smc.paper.comparison("van_der_pol", "nominal")},
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
