"""How much input delay does each law tolerate on the inverted pendulum?

The paper's table I calls the observer-free and the higher-order law delay-tolerant and the
classical and adaptive ones not; it shows no run. Here every command arrives 10, 20 or 50 ms late.

Look for: the delay at which each law stops settling, and what its final error has grown to by
then.
"""

import smc_mujoco as smc


def answer(runs):
    last = list(runs.traces)[-1]
    return (
        "the longest delay of those tried up to which each settles: "
        f"{runs.up_to()}; with {last} the final error is "
        f"least under {runs[last].least('ultimate_bound')}"
    )


scene = smc.Scene(
    title="Inverted pendulum with input delay",
    conditions={
        f"{ms} ms": smc.paper.comparison("inverted_pendulum", f"delay_{ms}ms", duration=4.0)
        for ms in (10, 20, 50)
    },
    film="20 ms",
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
