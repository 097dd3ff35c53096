"""Do five coupled pendulums come to rest together when each has only its own controller?

The paper's fourth comparison (figure 4, the mean angle): five hanging pendulums on one shaft,
torsion springs between neighbours, the same law in each with nothing but its own angle and rate. It
reports rapid synchronisation under the observer-free law and coupling-induced distortion under the
classical one. The inverted network is the harder twin that the paper does not try.

Look for: the spread between the largest and the smallest angle beside the mean.
"""

import smc_mujoco as smc


def answer(runs):
    return (
        f"{runs.count('bring all five to rest')}; first: {runs.least('settling_time')}; last: "
        f"{runs.most('settling_time')}; the angles come together "
        f"first under {runs.least('spread_settling_time')}"
    )


scene = smc.Scene(
    title="Five coupled pendulums",
    conditions={
        "hanging": smc.paper.comparison("pendulum_network", duration=4.0),
        "inverted": smc.paper.comparison("inverted_pendulum_network", duration=4.0),
    },
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
