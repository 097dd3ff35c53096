"""How far does the tip of an arm sag when it picks up 2 kg that its law does not know of?

The arm moves down to the left, picks up a steel ball at 1 s, and places it at the right at 3 s.
From 1 s on gravity and inertia are other than the nominal model says. Friction is that identified
on a real Panda.

Look for: the jump of the bars of joints 2 and 4 at 1 s, and the sag that a boundary layer leaves
and an integral does not.
"""

import arms

import smc_mujoco as smc

LAWS = (
    "computed_torque_sliding",
    "super_twisting_computed_torque",
    "passivity_based",
    "time_delay_sliding",
)


def sag(trace):
    return 1e3 * smc.metrics.tip_scores(trace)["max_error"]


def left(trace):
    return 1e3 * smc.metrics.tip_scores(trace)["last_error"]


def answer(runs):
    return (
        f"the tip leaves its path least under {runs.least(sag, unit='mm')}, "
        f"most under {runs.most(sag, unit='mm')}; at "
        f"the end it is closest under {runs.least(left, unit='mm')}"
    )


scene = smc.Scene(
    title="A payload of 2 kg is picked up",
    conditions={
        "pick and place": {name: arms.scenario("payload", arms.gained(name)) for name in LAWS}
    },
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
