"""How much dry friction in its free shoulder does the acrobot's swing-up tolerate?

This package's entry on RealAIGym's board: an optimised trajectory from hanging to upright under a
Riccati law, with 6 N m at the elbow. The law knows nothing of the friction, and has no motor in the
joint where it acts.

Look for: 1.2 s to the top. A little friction holds the machine where it leans, a fold of the elbow
against the shoulder; more keeps it rocking about the top, which is not up by the board's rule.
"""

import realaigym

import smc_mujoco as smc


def run(level):
    return realaigym.entry("acrobot", plant=smc.plant("acrobot", cf1=level), duration=6.0)


def stands(trace):
    return realaigym.criteria(trace).success


def fold(trace):
    return 57.3 * abs(trace.x[-1, 0])


def answer(runs):
    return (
        f"swung up and held with {runs.those(stands).named}; the elbow ends farthest from "
        "straight, in degrees, with "
        f"{runs.most(fold)}"
    )


scene = smc.Scene(
    title="Acrobot with dry friction",
    conditions={
        "friction": {
            "no friction": run(0.0),
            "0.01 N m": run(0.01),
            "0.02 N m": run(0.02),
            "0.08 N m": run(0.08),
        },
    },
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
