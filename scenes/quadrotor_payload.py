"""How far does a drone sag under a payload that its law does not know, and how soon is it back
without it?

A Crazyflie of 32 g takes off from 0.8 m with a steel ball of 6 g under it, and drops it at 3 s.

Look for: the height at which each law stays under the payload, where the weight is what the law
gives for the error; and the way back from 3 s on, where the integral of the firmware's PID has to
unlearn the weight.
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


def height(trace):
    return trace.x[trace.t < 3.0, 2][-1]


def back(trace):
    return trace.t[abs(trace.e[:, 2]) > 0.02][-1] - 3.0


def answer(runs):
    returned = runs.count("return within 20 mm", lambda trace: back(trace) < 3.0)
    low = runs.least(height, unit="m")
    high = runs.most(height, unit="m")
    first = runs.least(back, unit="s")
    return (
        f"before the drop it is at {low} to {high}, not 1 m; "
        f"3 s after it, {returned}; first {first}"
    )


scene = smc.Scene(
    title="A drone drops its payload",
    conditions={
        "drop": {
            law: smc.Scenario(
                plant=DRONE,
                law=law,
                model="nominal",
                x0=(0.0, 0.0, 0.8, 0.0, 0.0, 0.0),
                duration=6.0,
                mismatch={"payload": 0.006},
                jump=smc.Jump(time=3.0, factors={"payload": -0.006}),
            )
            for law in LAWS
        }
    },
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
