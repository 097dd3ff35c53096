"""How much dry friction in the pole's hinge does the law tolerate that keeps it upright on a cart?

One force, two joints: the cart is driven, the pole only measured. The law (W. Wang et al. 2004)
brings S = 0, a mixture of a surface for the cart and one for the pole; it knows the plant's
equation, in which nothing rubs.

Look for: the cart runs 0.9 m after the falling pole, then back. Friction at the hinge, unlike the
same force on the rail, is not matched: where the pole sticks, a little off the vertical, the cart
walks on until it comes loose, though S is 0. More than 0.016 N m is beyond the gain k, and S leaves
0 as well.
"""

import smc_mujoco as smc


def run(level):
    friction = {"hinge": smc.Coulomb(level)} if level else None
    return smc.Scenario(
        plant="cart_pole", law="hierarchical", model="nominal", friction=friction, duration=15.0
    )


def upright(trace):
    return smc.scores(trace)["free"]["settling_time"] < trace.t[-1]


def answer(runs):
    return (
        f"pole and cart come to rest with {runs.select().named}; the pole comes to rest with "
        f"{runs.select(upright).named}; the cart ends farthest "
        f"from 0 with {runs.most('ultimate_bound')}"
    )


scene = smc.Scene(
    title="Cart-pole with dry friction in the hinge",
    conditions={
        "friction": {
            "no friction": run(0.0),
            "friction 0.005": run(0.005),
            "friction 0.02": run(0.02),
        },
    },
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
