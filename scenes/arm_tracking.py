"""Which law of many joints keeps a seven-joint arm's tip on its path, with friction and a payload
that no law knows of?

The arm swings every joint, with the friction identified on a real Panda, and carries 2 kg. The laws
know the nominal model of the links at most. Their gains come from equal searches at 1 kg, see
arms/__init__.py.

Look for: the bars, which show how much of each motor the swing takes; and who needs a rough torque
to be exact.
"""

import arms

import smc_mujoco as smc

LAWS = (
    "computed_torque_sliding",
    "super_twisting_computed_torque",
    "time_delay_sliding",
    "observer_free_joint",
)


def off(trace):
    return 1e3 * smc.metrics.tip_scores(trace)["rms_error"]


def answer(runs):
    least = runs.least(off, unit="mm")
    most = runs.most(off, unit="mm")
    return f"rms distance of the tip from its path: least with {least}, most with {most}"


scene = smc.Scene(
    title="A seven-joint arm with 2 kg unknown to the laws",
    conditions={
        "sway": {name: arms.scenario("sway", arms.gained(name), payload=2.0) for name in LAWS}
    },
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
