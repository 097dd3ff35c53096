"""Which law carries the Duffing oscillator out of its well and holds it on the hump between the
two?

The paper's third comparison (figure 3): M x'' = -delta x' - alpha x - beta x^3 + u from x = 1.5 m.
It reports a fast observer-free law with minimal overshoot, similar adaptive and higher-order laws,
and a slower classical law with a larger deviation.

Look for: x = 0 is the unstable point between the wells at -1 m and +1 m; a cart that arrives too
slowly falls back.
"""

import smc_mujoco as smc


def answer(runs):
    return (
        f"{runs.count('reach the hump and stay')}; first: {runs.least('settling_time')}; "
        f"last: {runs.most('settling_time')}; largest overshoot: {runs.most('overshoot')}"
    )


scene = smc.Scene(
    title="Duffing oscillator",
    conditions={"nominal": smc.paper.comparison("duffing", duration=6.0)},
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
