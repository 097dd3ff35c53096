"""A blow throws the pendulum against its stops: which law brings it back, and how hard does it hit?

At t = 1 s an impulse of 2 N m s sends it off at 16 rad/s. The padded stops at 1 rad return 20 or 80
% of the speed.

Look for: how often each law is thrown from stop to stop, and the integral action of super-twisting
that the blow winds up.
"""

import smc_mujoco as smc


def answer(runs):
    return (
        f"{runs.count('come back')}; first: {runs.least('settling_time')}; hardest blow: "
        f"{runs.most('peak_reaction')}; softest: {runs.least('peak_reaction')}"
    )


scene = smc.Scene(
    title="Inverted pendulum between stops",
    conditions={
        f"restitution {e:g}": smc.paper.comparison(
            "inverted_pendulum",
            duration=4.0,
            changes={
                "contact": smc.hardware.Contact("stops", restitution=e),
                "disturbance": smc.signals.Impulse(2.0, time=1.0, width=0.01),
            },
        )
        for e in (0.2, 0.8)
    },
    film="restitution 0.8",
    answers=("settling_time", "peak_reaction"),
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
