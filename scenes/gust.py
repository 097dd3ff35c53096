"""How strong a gust on the bob does each law tolerate before the pendulum falls?

A gust pushes the bob sideways for 0.4 s. It is a force in space, so its torque F l cos x is less
the further the pendulum leans. Who loses it falls to the floor.

Look for: the gust that is one too many for each law, and how long the others need to settle; who is
thrown down may also bounce off the floor and get up again.
"""

import smc_mujoco as smc


def stands(trace):
    return not trace.reaction.any()  # of the floor


def answer(runs):
    last = list(runs.traces)[-1]
    return (
        "the strongest gust of those tried up to which the pendulum "
        f"stays off the floor: {runs.up_to(stands)}; "
        f"after {last} {runs[last].count('end upright')}"
    )


scene = smc.Scene(
    title="Inverted pendulum in a gust",
    conditions={
        f"{force} N": smc.paper.comparison(
            "inverted_pendulum",
            duration=4.0,
            changes={
                "contact": "floor",
                "disturbance": smc.signals.Gust(force, time=1.0, width=0.4),
            },
        )
        for force in (4, 8, 16, 32)
    },
    film="8 N",
    answers=("settling_time", "peak", "max_u"),
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
