"""What does each law do when something stands in its way: lean on it, or push ever harder?

The pendulum is blocked at 0.2 rad, the Duffing cart at 0.5 m. Nobody can reach the target: the
error stays, and what integrates or adapts grows.

Look for: who ends at the actuator's limit (max |u|) and who leans with no more than the error asks
for.
"""

import smc_mujoco as smc


def push(trace):
    return abs(trace.u[-1]).max() / max(trace.scenario.limits)


def answer(runs):
    pushes = runs.count("end at the actuator's limit", lambda run: push(run) >= 1.0)
    return (
        f"{pushes}; softest push at the end, as a share of the "
        f"limit: {runs.least(push)}; hardest blow: "
        f"{runs.most('peak_reaction')}"
    )


scene = smc.Scene(
    title="A peg in the way",
    conditions={
        "pendulum": smc.paper.comparison(
            "inverted_pendulum", duration=3.0, changes={"contact": "peg"}
        ),
        "cart": smc.paper.comparison("duffing", duration=3.0, changes={"contact": "peg"}),
    },
    film="pendulum",
    answers=("steady_error", "max_u", "energy", "peak_reaction"),
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
