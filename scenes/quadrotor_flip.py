"""How much height does a drone lose that is let go upside down and tumbling?

A Crazyflie is at rest 20 m above the ground, rolled by 170 degrees and turning by 10, 5 and 3 rad/s
about its axes, and has to stop there, upright. Its rotors push one way only, by up to 1.5 times its
weight: downwards until it has turned over. In one row it has the numbers of arXiv 2508.06568,
without drag, in the other those of the library.

Look for: the time until a drone is on its side: the longer, the further it falls. The geometric
law's error of the attitude is the sine of the angle, which is small near 180 degrees, so that it
turns last.
"""

import smc_mujoco as smc

PUBLISHED = {
    "m": 0.032,
    "Jx": 16.6e-6,
    "Jy": 16.6e-6,
    "Jz": 29.3e-6,
    "rise": 20.0,
    "fall": 20.0,
    "Jr": 0.0,
}
DRONES = {
    "no drag": smc.plant("quadrotor", **PUBLISHED, Dx=0.0, Dy=0.0, Dz=0.0),
    "drag": smc.plant("quadrotor"),
}
LAWS = (
    "cascaded_pid",
    "geometric",
    "quaternion_sliding",
    "adaptive_quaternion_sliding",
    "super_twisting_attitude",
)
HEIGHT = 20.0  # m


def lost(trace):
    return HEIGHT - trace.x[:, 2].min()


def answer(runs):
    said = [f"{name}: from {runs[name].least(lost)} to {runs[name].most(lost)}" for name in DRONES]
    return f"height lost in m; {'; '.join(said)}"


scene = smc.Scene(
    title="A drone upside down",
    conditions={
        name: {
            law: smc.Scenario(
                plant=drone,
                law=law,
                model="nominal",
                duration=6.0,
                reference=[smc.Constant(value) for value in (0.0, 0.0, HEIGHT, 0.0, 0.0, 0.0)],
                x0=(0.0, 0.0, HEIGHT, 2.967, 0.0, 0.0),
                v0=(0.0, 0.0, 0.0, 10.0, 5.0, 3.0),
            )
            for law in LAWS
        }
        for name, drone in DRONES.items()
    },
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
