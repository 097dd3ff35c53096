"""How far is an arm thrown off its path by a blow on the forearm, and how soon is it back?

While the arm sways, the forearm is hit from the side at 1 s: a half sine of 400 N in 20 ms, an
impulse of 5 N s. Friction is that identified on a real Panda; no law sees the blow coming.

Look for: the arrow at 1 s, which is the blow; and how far the tip is thrown, and how it comes back.
"""

import arms

import smc_mujoco as smc

LAWS = ("computed_torque_sliding", "unit_vector", "passivity_based", "observer_free_joint")


def thrown(trace):
    return 1e3 * arms.off_path(trace, after=arms.BLOW).max()


def back(trace):
    return arms.back_within(trace, 2e-3, after=arms.BLOW)


def answer(runs):
    return (
        "after the blow the tip is off its path least with "
        f"{runs.least(thrown, unit='mm')}, most with "
        f"{runs.most(thrown, unit='mm')}; first within 2 mm for good: {runs.least(back, unit='s')}"
    )


scene = smc.Scene(
    title="A blow on the forearm",
    conditions={"blow": {name: arms.scenario("blow", arms.gained(name)) for name in LAWS}},
    answer=answer,
    camera=(150.0, -18.0),  # the blow comes from the side: from there its arrow is seen
)

if __name__ == "__main__":
    smc.play(__file__)
