"""What does dry friction in the joint do to each law: does it stop short, or does it hunt?

A smooth law pushes less the closer it gets, so friction F holds it where lambda tanh(k1 x) - m grav
l sin x <= F; a switching law never stops pushing, and shakes the joint loose. LuGre friction sticks
harder than it slides.

Look for: the steady error that grows with F, the limit cycle (ripple) where there is one, how long
the joint sticks.
"""

import smc_mujoco as smc


def answer(runs):
    worst = runs["0.4 N·m"]
    return (
        f"{runs.count('settle')}; largest steady error at 0.4 N "
        f"m: {worst.most('steady_error')}; widest "
        f"ripple: {worst.most('ripple')}"
    )


scene = smc.Scene(
    title="Inverted pendulum with joint friction",
    conditions={
        name: smc.paper.comparison(
            "inverted_pendulum", duration=5.0, changes={"friction": friction}
        )
        for name, friction in {
            "none": smc.Coulomb(0.0),
            "0.1 N m": smc.Coulomb(0.1),
            "0.4 N·m": smc.Coulomb(0.4),
            "LuGre": smc.hardware.LuGre(coulomb=0.2, static=0.4, stribeck=0.05),
        }.items()
    },
    film="0.4 N·m",
    answers=("steady_error", "ripple", "stick_time"),
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
