"""Can an arm press on a wall with 20 N while its tip slides along it, without a force sensor?

Hybrid control: a sliding mode moves the joints in all directions but one, in which the tip presses
open-loop, by the torques J' F. One of these laws knows the identified friction of the joints, one
does not. The third law only follows the path, wanted 4 mm behind the wall's face: it presses with
what the joints' errors happen to give.

Look for: the force in the last panel, which a path behind the wall meets least; a loss of contact
as a bar below it; and how deep the tip is in the wall.
"""

import arms

import smc_mujoco as smc


def off(trace):
    return abs(smc.metrics.tip_scores(trace, force=arms.PRESS)["force_error"])


def varies(trace):
    return smc.metrics.tip_scores(trace)["force_ripple"]


def stays(trace):
    scores = smc.metrics.tip_scores(trace)
    return scores["touching"] == 100.0 and scores["depth"] <= 1e-3


def answer(runs):
    force = (
        f"mean force off 20 N: least with {runs.least(off, unit='%')}, "
        f"most with {runs.most(off, unit='%')}"
    )
    varying = (
        f"it varies least with {runs.least(varies, unit='N')}, "
        f"most with {runs.most(varies, unit='N')}"
    )
    return (
        f"{force}; {varying}; always on the wall and less "
        f"than 1 mm in it: {runs.select(stays).named}"
    )


scene = smc.Scene(
    title="Pressing on a wall with 20 N",
    conditions={
        "wall": {
            "hybrid": arms.scenario("wall", arms.hybrid()),
            "hybrid, friction known": arms.scenario("wall", arms.hybrid(friction=True)),
            "path behind the wall": arms.scenario("behind", arms.gained("computed_torque_sliding")),
        }
    },
    camera=(60.0, -18.0),  # from the side: the tip is in sight between arm and wall
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
