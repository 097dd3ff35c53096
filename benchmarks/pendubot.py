"""How hard may the pendubot's shoulder be struck while it balances?

This package's entry on RealAIGym's board swings the double pendulum up in 1.3 s, with 6 N m at the
shoulder, and holds it by a Riccati law. At 4 s the shoulder is struck for 50 ms. The blow acts
where the motor does.

Look for: the motor saturates at 0.3 N m s. The law forgives a blow as long as the motor can bring
the arm back; one that is a little too hard sends the machine round and round.
"""

import realaigym

import smc_mujoco as smc

UP = 3.14159265  # rad


def run(blow):
    disturbance = smc.signals.Impulse(blow, time=4.0, width=0.05)
    up = smc.Constant(UP)  # for the metrics: the law has its own reference
    return realaigym.entry("pendubot", disturbance=disturbance, reference=up, duration=5.0)


def stands(trace):
    return realaigym.criteria(trace).success


def lean(trace):
    return 57.3 * abs(trace.x[trace.t >= 2.0, 0] - UP).max()


def answer(runs):
    standing = runs.those(stands)
    if not standing.labels:
        return f"it stands after none of the blows, not even that of {runs.labels[0]}"
    return (
        f"it stands after {standing.named}; of these it leans farthest, in degrees, after "
        f"{standing.most(lean)}"
    )


scene = smc.Scene(
    title="A blow on the pendubot",
    conditions={"blow": {f"{blow:g} N m s": run(blow) for blow in (0.1, 0.3, 0.4, 0.5)}},
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
