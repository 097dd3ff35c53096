"""How far does wind blow a drone off its place, and which law brings it back?

A Crazyflie hovers at 1 m. A steady wind of 3 m/s sets in, then a gust of 6 m/s that lasts 1 s, and
last turbulence as the Dryden model has it in a moderate wind, on a mean of 3 m/s. No law knows its
drag.

Look for: the lean into the wind, and the place where a law without an integral stays in a steady
wind: the wind's force over what the law gives for an error.
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
WIND = {
    "steady": smc.signals.Wind(3.0, time=1.0),
    "gust": smc.signals.Wind(6.0, time=1.0, width=1.0),
    "turbulence": (smc.signals.Wind(3.0), smc.signals.Dryden(w20=15.0, speed=3.0)),
}


def off(trace):
    return 1e3 * (trace.e[:, :3] ** 2).sum(axis=1).max() ** 0.5


def answer(runs):
    said = [f"{name}: from {runs[name].least(off)} to {runs[name].most(off)}" for name in WIND]
    return f"largest distance from the place, in mm; {'; '.join(said)}"


scene = smc.Scene(
    title="A drone in wind",
    conditions={
        name: {
            law: smc.Scenario(
                plant=DRONE, law=law, model="nominal", x0=DRONE.rest, disturbance=wind, duration=6.0
            )
            for law in LAWS
        }
        for name, wind in WIND.items()
    },
    film="gust",
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
