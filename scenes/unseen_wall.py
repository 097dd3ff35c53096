"""Which law leaves a wall first that nobody told it of?

A SCARA arm swings its shoulder to and fro. A wall stands within its path, an arm's width before the
tool. Each law strikes it, leans on it, and is to follow the reference when that turns back.

Look for: the blow, which throws the arm back under both laws; and how long each leans after the
reference has left. Integral action has summed the error meanwhile.
"""

from pathlib import Path

import smc_mujoco as smc

PLANT = smc.plant_from(
    Path(__file__).parents[1] / "models" / "scara.xml", ["shoulder", "elbow", "lift"]
)
WALL = smc.Wall("quill", direction=(0, 1, 0), gap=0.15, restitution=0.3)
REFERENCE = [smc.Sine(0.6, 1.5), smc.Constant(0.0), smc.Constant(0.0)]
LAWS = {
    "PID": smc.law("pid", kp=[120.0, 60.0, 400.0], ki=[200.0, 100.0, 900.0], kd=[15.0, 8.0, 80.0]),
    "super-twisting": smc.law("super_twisting", k1=[9.0, 5.0, 30.0], k2=[40.0, 20.0, 200.0], c=6.0),
}


def run(law, contact):
    return smc.Scenario(plant=PLANT, law=law, reference=REFERENCE, contact=contact, duration=4.0)


def blow(trace):
    return abs(trace.reaction[:, 0]).max()


def late(trace):
    """Return for how long the arm leans on the wall where the reference is before it, s."""
    leans = abs(trace.reaction[:, 0]) > 1.0
    at_wall = trace.x[leans, 0].mean() if leans.any() else 0.0
    return float((leans & (trace.r[:, 0] < at_wall)).sum()) * trace.scenario.control_period


def answer(runs):
    walls = runs["wall"]
    return (
        f"it leans on the wall longest after its reference has left under {walls.most(late)}, in "
        f"s, and shortest under {walls.least(late)}; the strongest blow, in N m at the shoulder, "
        f"is under {walls.most(blow)}"
    )


scene = smc.Scene(
    title="An arm and a wall that nobody told it of",
    conditions={
        "free": {label: run(law, None) for label, law in LAWS.items()},
        "wall": {label: run(law, WALL) for label, law in LAWS.items()},
    },
    film="wall",
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
