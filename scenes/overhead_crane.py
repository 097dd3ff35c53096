"""What does it cost to keep a crane's load from swinging while its trolley goes to x = 0?

The hierarchical law (W. Wang et al. 2004) on S = a (x' + c1 x) + q' + c2 q with three weights a of
the trolley against the rope's angle q, from x = 1 m, at rest.

Look for: with a small a, the load hardly swings, and the trolley is late and goes too far. With a
large a, the trolley is fast, and the load keeps swinging. In between, both come to rest together,
in 3.4 s.
"""

import smc_mujoco as smc


def run(a):
    law = smc.law("hierarchical", a=a)
    return smc.Scenario(plant="overhead_crane", law=law, model="nominal", duration=10.0)


def swing(trace):
    return smc.scores(trace)["free"]["peak"]


def answer(runs):
    least = runs.least(swing, unit="rad")
    most = runs.most(swing, unit="rad")
    return (
        f"the load swings least with {least}, most with {most}; "
        "trolley and load are first at rest with "
        f"{runs.least('settling_time')}, last with {runs.most('settling_time')}"
    )


scene = smc.Scene(
    title="Overhead crane, three gains a of the law's surface",
    conditions={"weights": {"a = 0.3": run(0.3), "a = 0.67": run(0.67), "a = 4": run(4.0)}},
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
