"""Which law brings the inverted pendulum upright, how fast, and at what price in control?

The paper's first comparison (figure 1): m l^2 x'' = m g l sin x - b x' + u from x = 0.5 rad, |u| <=
6 N m. It reports the observer-free law level with the adaptive one and almost without overshoot,
the classical law slower with a slight ripple, and the higher-order law with the larger undershoot.

Look for: the settling times beside each other, and the total variation of u, which is what
chattering costs.
"""

import smc_mujoco as smc


def answer(runs):
    settled = runs.select()
    return (
        f"{runs.count('settle')}; first: {runs.least('settling_time')}; "
        f"last: {runs.most('settling_time')}; "
        f"of those that settle, u varies least under {settled.least('tv_rate')}, "
        f"most under {settled.most('tv_rate')}"
    )


scene = smc.Scene(
    title="Inverted pendulum",
    conditions={"nominal": smc.paper.comparison("inverted_pendulum", duration=3.0)},
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
