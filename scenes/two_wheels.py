"""Does a robot on two wheels need more than its tilt to come back to where it stood?

It stands on the floor by contact alone; its free base is measured and nothing drives it. One law
reads tilt, way and their rates with gains by hand, one has the regulator's K of all sixteen states,
one reads the tilt alone. A blow of 20 N comes at 1 s.

Look for: with the tilt alone the robot stays upright, but rolls away for ever. The other two lean
back against the blow and return.
"""

from pathlib import Path

import numpy as np

import smc_mujoco as smc

PLANT = smc.plant_from(
    Path(__file__).parents[1] / "models" / "two_wheels.xml",
    ["left", "right"],
    measured=["base"],
)
LEFT, RIGHT, TILT, RATES = 0, 1, 6, 8  # columns of K: channels, and where their rates begin


def by_hand(tilt, rate, way, speed):
    K = np.zeros((2, 16))
    K[:, TILT] = -tilt - way  # the wheels turn against the trunk
    K[:, RATES + TILT] = -rate - speed
    K[:, [LEFT, RIGHT]] = -way / 2.0
    K[:, [RATES + LEFT, RATES + RIGHT]] = -speed / 2.0
    return smc.law_from(K)


LAWS = {
    "tilt alone": by_hand(40.0, 6.0, 0.0, 0.0),
    "by hand": by_hand(40.0, 6.0, 1.0, 1.5),
    "regulator": smc.design.lqr(PLANT),
}
BLOW = smc.signals.Push("frame", x=20.0, time=1.0, width=0.1)


def run(law):
    x0 = list(PLANT.x0)
    x0[TILT] = 0.08
    return smc.Scenario(plant=PLANT, law=law, x0=x0, disturbance=BLOW, duration=6.0)


def answer(runs):
    stands = runs.select(lambda trace: abs(trace.x[-1, TILT]) < 0.02)
    back = runs.select(lambda trace: abs(trace.x[-1, LEFT]) < 0.3)
    return f"upright after 6 s: {stands.named}; back in their place: {back.named}"


scene = smc.Scene(
    title="Robot on two wheels",
    conditions={"blow": {label: run(law) for label, law in LAWS.items()}},
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
