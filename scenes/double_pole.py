"""How much of its motor may a cart lose that balances two poles, one on the other?

Both poles are only measured. The regulator of all six states comes from finite differences of
MuJoCo's step, and knows nothing of the fault: 2 s after the start the motor gives a share of what
it is told.

Look for: the cart runs under the poles within 3 s. With half of the motor the poles hardly notice;
with two fifths they rock without end.
"""

from pathlib import Path

import smc_mujoco as smc

PLANT = smc.plant_from(
    Path(__file__).parents[1] / "models" / "double_pole.xml",
    ["slide"],
    measured=["low", "high"],
)
LAW = smc.design.lqr(PLANT)


def run(share):
    fault = smc.Fault(at=2.0, gain=share) if share < 1.0 else None
    return smc.Scenario(plant=PLANT, law=LAW, x0=(0.2, 0.1, -0.05), fault=fault, duration=8.0)


def answer(runs):
    stands = runs.select(lambda trace: abs(trace.x[-1, 1:]).max() < 0.01)
    return f"the poles stand after 8 s with {stands.named}; the cart runs farthest with " + str(
        runs.most("peak")
    )


scene = smc.Scene(
    title="Double pole on a cart",
    conditions={
        "fault": {"whole motor": run(1.0), "half of it": run(0.5), "two fifths": run(0.4)},
    },
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
