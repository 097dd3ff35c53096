"""How much of a rotor's thrust may a drone lose before it falls?

At 1 s the front right rotor of a hovering Crazyflie loses 10, 20, 30 or 40 % of its thrust. Its
largest is 0.12 N, and hovering takes 0.078 N of each, so that up to 35 % the others need not
change: the rotor has only to turn faster.

Look for: how far aside and below the drone stays, as no law knows of the loss, and only the
firmware's PID has an integral of the position's loop. Super-twisting falls at 30 %, all at 40 %:
four rotors without reserve cannot hold attitude and height.
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


def flies(trace):
    return trace.x[:, 2].min() > 0.0


def sag(trace):
    return 1e3 * (1.0 - trace.x[-1, 2])


def answer(runs):
    return (
        "the largest loss in % of those tried up to which the drone "
        f"stays above the floor: {runs.up_to(flies)}; at 30 "
        f"% it sags by {runs['30'].least(sag)} to {runs['30'].most(sag)} mm"
    )


scene = smc.Scene(
    title="A drone with a fading rotor",
    conditions={
        str(percent): {
            law: smc.Scenario(
                plant=DRONE,
                law=law,
                model="nominal",
                x0=DRONE.rest,
                duration=5.0,
                jump=smc.Jump(time=1.0, factors={"fade": percent / 100}),
            )
            for law in LAWS
        }
        for percent in (10, 20, 30, 40)
    },
    film="30",
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
