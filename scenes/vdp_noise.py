"""Does Gaussian noise on both sensors matter to the observer-free law?

The paper's figure 6. Standard deviations 0.01 m and 0.05 m/s. The paper reports that the system
remains stable with small fluctuations. The rivals run beside it under the same conditions.

Look for: the fluctuation of x is small; that of u is lam times the noise in s, and no small one.
"""

import smc_mujoco as smc


def answer(runs):
    paper = runs.only("observer_free")
    change = {}
    for name in ("settling_time", "ultimate_bound", "tv_rate"):
        change[name] = paper.changes(name, "nominal", "noise")
    return (
        f"from nominal to noise, settling time: {change['settling_time']}; "
        f"final error: {change['ultimate_bound']}; "
        f"variation of u: {change['tv_rate']}, with noise the least: "
        f"{runs['noise'].select().least('tv_rate')}"
    )


scene = smc.Scene(
    title="Van der Pol oscillator",
    conditions={name: smc.paper.comparison("van_der_pol", name) for name in ("nominal", "noise")},
    film="noise",
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
