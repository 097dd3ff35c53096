"""Where does a block on a rough floor stop, and does it stick and slip on the way?

The Duffing mass slides on a bed under its own weight: friction is a real contact, mu M grav,
between block and lining. The springs push it off centre, the floor holds it where it stops.

Look for: the steady error of the smooth law, anywhere within what mu holds, beside the switching
laws, which crawl on.
"""

import smc_mujoco as smc


def restarts(trace):
    still = abs(trace.v) <= 1e-3 * abs(trace.v).max()
    return (still[:-1] & ~still[1:]).sum() > 1  # it starts from rest once


def answer(runs):
    return (
        f"farthest from the centre: {runs.most('steady_error')}; "
        f"nearest: {runs.least('steady_error')}; "
        f"{runs.count('stick and slip', restarts)}"
    )


scene = smc.Scene(
    title="Duffing block on a rough floor",
    conditions={
        f"mu {mu:g}": smc.paper.comparison(
            "duffing", duration=6.0, changes={"contact": smc.hardware.Contact("floor", friction=mu)}
        )
        for mu in (0.05, 0.1, 0.2)
    },
    film="mu 0.2",
    answers=("steady_error", "settling_time", "stick_time"),
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
