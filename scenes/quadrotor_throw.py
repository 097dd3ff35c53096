"""Which law catches a drone that is thrown up with its rotors at rest?

A Crazyflie leaves the hand at 1.5 m with 5 m/s upwards, upright, on its side or nearly upside down,
and tumbling. Its rotors start in the air. The floor is not there, so that a law that needs much
height is seen to need it.

Look for: the turn to the upright, which takes the shorter way, and the height that is lost until
then. An error of the attitude that vanishes at 180 degrees, as that of the geometric law, turns the
body last.
"""

import smc_mujoco as smc

DRONE = smc.plant("quadrotor", lift=0.0)
LAWS = (
    "cascaded_pid",
    "geometric",
    "quaternion_sliding",
    "adaptive_quaternion_sliding",
    "super_twisting_attitude",
)
TURNS = {"upright": (0.3, 0.3, 0.5), "on its side": (1.6, 0.3, 0.5), "upside down": (2.9, 0.3, 0.5)}


def lowest(trace):
    return trace.x[:, 2].min()


def answer(runs):
    said = []
    for name in TURNS:
        said.append(f"{name}: from {runs[name].least(lowest)} to {runs[name].most(lowest)}")
    return f"lowest height in m, of the 1 m wanted; {'; '.join(said)}"


scene = smc.Scene(
    title="A drone thrown into the air",
    conditions={
        name: {
            law: smc.Scenario(
                plant=DRONE,
                law=law,
                model="nominal",
                duration=4.0,
                x0=(0.0, 0.0, 1.5, *turn),
                v0=(1.0, 0.5, 5.0, 3.0, 2.0, 1.0),
            )
            for law in LAWS
        }
        for name, turn in TURNS.items()
    },
    film="on its side",
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
