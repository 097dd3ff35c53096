"""How closely does a drone follow a figure of eight, and how does its error grow as it flies
faster?

A Crazyflie flies a lemniscate of 2 m by 1 m, three laps of 6, 4 or 3 s each; in the fastest its
acceleration reaches 0.9 g. Drag and the lag of the rotors are in no law.

Look for: the distance between the dark path and the flown one on the outer arcs, where drag and lag
take most.
"""

import smc_mujoco as smc

DRONE = smc.plant("quadrotor")
LAWS = (
    "cascaded_pid",
    "geometric",
    "quaternion_sliding",
    "adaptive_quaternion_sliding",
    "super_twisting_attitude",
)


def lap(law, period):
    w = 6.2832 / period
    path = [smc.Sine(1.0, w), smc.Sine(0.5, 2.0 * w), smc.Constant(1.0), *[smc.Constant(0.0)] * 3]
    start = {"x0": DRONE.rest, "v0": (w, w, 0.0, 0.0, 0.0, 0.0)}
    return smc.Scenario(
        plant=DRONE, law=law, model="nominal", reference=path, duration=3.0 * period, **start
    )


def error(trace):
    late = trace.t > trace.t[-1] / 3.0  # after the first lap
    return 1e3 * (trace.e[late, :3] ** 2).sum(axis=1).mean() ** 0.5


def answer(runs):
    said = []
    for name in runs.traces:
        said.append(f"{name}: from {runs[name].least(error)} to {runs[name].most(error)}")
    return f"rms distance from the path after the first lap, in mm; {'; '.join(said)}"


scene = smc.Scene(
    title="A drone on a figure of eight",
    conditions={f"{period} s": {law: lap(law, period) for law in LAWS} for period in (6, 4, 3)},
    film="3 s",
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
