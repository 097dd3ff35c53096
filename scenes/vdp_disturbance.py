"""Does the disturbance 0.2 sin(5t) matter to the observer-free law?

The paper's figure 7. The paper reports a trajectory nearly identical to the nominal one and strong
rejection. The rivals run beside it under the same conditions.

Look for: the residual oscillation of x beside those of the switching laws, which have the same
bound on u.
"""

import smc_mujoco as smc


def answer(runs):
    paper = runs.only("observer_free")
    change = {}
    for name in ("settling_time", "ultimate_bound"):
        change[name] = paper.changes(name, "nominal", "sine")
    return (
        f"from nominal to sine, settling time: {change['settling_time']}; "
        f"final error: {change['ultimate_bound']}; "
        f"with the sine the least bound: {runs['sine'].least('ultimate_bound')}"
    )


scene = smc.Scene(
    title="Van der Pol oscillator",
    conditions={name: smc.paper.comparison("van_der_pol", name) for name in ("nominal", "sine")},
    film="sine",
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
