"""How much dry friction does the hierarchical law bear that keeps a pole upright on a cart?

One force, two joints: the cart is driven, the pole only measured. The law (W. Wang et al. 2004) brings S = 0, a mixture
of a surface for the cart and one for the pole; it knows the plant's equation, in which nothing rubs.

Look for: the cart runs 0.9 m after the falling pole, then home. Friction at the hinge is not matched: where the pole
sticks, a little off the vertical, the cart walks on until it comes loose, though S is 0. More than 0.016 N m is beyond
the gain k, and S leaves 0 as well.
"""

import smc_mujoco as smc


def run(level):
    friction = smc.Coulomb(level) if level else None
    return smc.Scenario(plant="cart_pole", law="hierarchical", model="nominal", friction=friction, duration=15.0)


scene = smc.Scene(
    title="Cart-pole",
    conditions={
        "friction": {"no friction": run(0.0), "0.005 N, N m": run(0.005), "0.02 N, N m": run(0.02)},
    },
)

if __name__ == "__main__":
    smc.play(__file__)
