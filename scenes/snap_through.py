"""Does a double well built of two springs behave as Duffing's equation says?

Two preloaded springs pull the cart to either side of a hump: they snap through. Wells and their
stiffness are matched to alpha and beta; the shape between them is the springs' own.

Look for: how little the laws' scores change from the equation to the mechanism.
"""

import smc_mujoco as smc

PLANTS = ("duffing", "van_der_pol", "pendulum_network", "inverted_pendulum_network")
MISS = ", ".join(
    f"{plant} {100.0 * smc.fidelity.deviation(plant, 'springs'):.0f} %" for plant in PLANTS
)


def answer(runs):
    change = {}
    for name in ("settling_time", "ultimate_bound"):
        change[name] = runs.changes(name, "equation", "springs")
    return (
        "springs miss the equation by this share of the largest "
        f"force: {MISS}; from the equation to the springs, "
        f"settling time: {change['settling_time']}; ultimate bound: {change['ultimate_bound']}"
    )


scene = smc.Scene(
    title="Double well",
    conditions={
        name: smc.paper.comparison(
            "duffing",
            laws=("observer_free", "super_twisting"),
            duration=5.0,
            changes={"mechanism": name},
        )
        for name in ("equation", "springs")
    },
    film="springs",
    answers=("settling_time", "overshoot", "ultimate_bound"),
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
