"""What becomes of each law when the plant changes under it in mid-run?

The paper concedes that after an abrupt parameter jump its law may not converge, "although stability
is preserved". At half time the pendulum's mass is multiplied, by 2 (mild) and by 25.9 (hard), with
0.2 sin(5t) on the joint throughout.

Look for: after the hard jump gravity exceeds what |u| <= 6 N m holds beyond a few degrees; who
stays inside them?
"""

import smc_mujoco as smc


def answer(runs):
    return (
        f"{runs.count('settle and stay there')}; the farthest off after the hard jump: "
        f"{runs['hard'].most('ultimate_bound')}"
    )


scene = smc.Scene(
    title="Inverted pendulum, mass jump at half time",
    conditions={
        "mild": smc.paper.comparison("inverted_pendulum", "jump_mild"),
        "hard": smc.paper.comparison("inverted_pendulum", "jump_hard"),
    },
    film="hard",
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
