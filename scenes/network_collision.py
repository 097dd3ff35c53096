"""Five pendulums hang so close that their bobs collide: which law settles without a clash?

They hang in one row like a Newton's cradle, 3 cm apart, and start swung out to both sides. To stop
at rest is not enough: a bob that arrives with speed passes it on to its neighbours.

Look for: the hardest collision (peak reaction), and whether it costs settling time.
"""

import smc_mujoco as smc


def gentle(trace):
    score = smc.score(trace)
    return score["settling_time"] < trace.t[-1] and score["peak_reaction"] == 0.0


def answer(runs):
    return (
        f"{runs.count('settle without a clash', gentle)}; first of those: "
        f"{runs.select(gentle).least('settling_time')}; hardest blow: {runs.most('peak_reaction')}"
    )


scene = smc.Scene(
    title="Pendulums that collide",
    conditions={
        name: smc.paper.comparison(
            "pendulum_network",
            duration=4.0,
            changes={
                "contact": smc.hardware.Contact("bobs", restitution=e),
                "x0": (-0.8, -0.6, 0.0, 0.5, 0.7),
            },
        )
        for name, e in {"rubber": 0.3, "steel": 0.95}.items()
    },
    film="steel",
    answers=("settling_time", "peak_reaction"),
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
