"""Does the arctangent hold the cart against a push as well as a relay does, without the relay's
chattering?

Compare u: under the relay it jumps at every sample, under the arctangent it does not. Compare x at
the end: under the arctangent the cart rests a little off 0.
"""

import smc_mujoco as smc

PUSH = smc.Step(amplitude=2.0, time=2.0)

scene = smc.Scene(
    title="Pushed cart",
    conditions={
        "push": {
            name: smc.Scenario(
                plant="sprung_cart", law=smc.law(name, k=6.0, c=3.0), disturbance=PUSH, duration=4.0
            )
            for name in ("arctan_switching", "classical")
        }
    },
    answers=("ultimate_bound", "tv_rate"),
)

if __name__ == "__main__":
    smc.play(__file__)
