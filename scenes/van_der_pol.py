"""Does any law stop the Van der Pol oscillator better than the others?

The paper's second comparison (figure 2): M x'' = mu (1 - x^2) x' - k x + u from x = 2 m. It reports
a moderate undershoot of the observer-free law, the largest oscillation under the higher-order law,
a higher overshoot of the adaptive law, and a slow classical law without overshoot.

Look for: inside |x| < 1 (the rail's coloured band) the plant feeds energy in, and a bounded u must
overcome that.
"""

import smc_mujoco as smc


def answer(runs):
    settled = runs.select()
    metrics = ("settling_time", "itae", "tv_rate")
    time, error, effort = (settled.least(name) for name in metrics)
    leads = runs.only(*settled.leaders(*metrics)).named
    return (
        f"best in all three: {leads}; first to settle: {time}; least "
        f"ITAE: {error}; least variation of u: {effort}"
    )


scene = smc.Scene(
    title="Van der Pol oscillator",
    conditions={"nominal": smc.paper.comparison("van_der_pol")},
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
