"""How much play in the gear does each law tolerate before it hammers?

Between motor and joint lies a gap. To reverse, the rotor must cross it, and arrives with speed:
every switching of the command becomes a blow on the other flank.

Look for: the limit cycle (ripple) of each law, and the blows of the flanks (peak reaction), far
above max |u|.
"""

import smc_mujoco as smc


def quiet(trace):
    late = trace.t >= 0.8 * trace.t[-1]
    return abs(trace.reaction[late]).max() <= abs(trace.u).max()


def answer(runs):
    return (
        "the widest gap of those tried up to which no blow in the last "
        "fifth of the run exceeds the law's own max |u|: "
        f"{runs.up_to(quiet)}; the hardest blow of all: {runs.most('peak_reaction')}"
    )


scene = smc.Scene(
    title="Inverted pendulum with backlash",
    conditions={
        f"gap {gap:g} rad": smc.paper.comparison(
            "inverted_pendulum", duration=3.0, changes={"actuator": smc.Backlash(gap)}
        )
        for gap in (0.002, 0.01, 0.05)
    },
    film="gap 0.05 rad",
    answers=("ripple", "tv_rate", "peak_reaction"),
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
