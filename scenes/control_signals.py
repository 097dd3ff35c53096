"""What does the control signal of each law look like at rest, under noise and under a disturbance?

The paper's figures 8 to 10 show u of the observer-free law on the Van der Pol oscillator, and no
rival's. It reports u continuous within its bound, with small fluctuations under noise and gradual
adaptation to 0.2 sin(5t).

Look for: a tanh of a noisy argument is as noisy as its argument times lam; smooth in s is not
smooth in time.
"""

import smc_mujoco as smc


def answer(runs):
    paper = runs.only("observer_free")
    settled = runs.select()
    return (
        "of those that settle, u varies least at the end under "
        f"{settled.least('tv_rate')}, and most under "
        f"{settled.most('tv_rate')}; variation of u from nominal to noise: "
        f"{paper.changes('tv_rate', 'nominal', 'noise')}"
    )


scene = smc.Scene(
    title="Control signals, Van der Pol oscillator",
    conditions={
        name: smc.paper.comparison("van_der_pol", name) for name in ("nominal", "noise", "sine")
    },
    film="noise",
    figure="signals",
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
