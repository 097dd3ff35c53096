"""What does a real encoder, without a velocity sensor, leave of each law?

Position comes in counts, late, seldom, or with readings lost; velocity is differentiated from it
and filtered.

Look for: chattering of the smooth law too, once a count is coarse, and the limit cycles of the
others.
"""

import smc_mujoco as smc


def answer(runs):
    return (
        f"{runs.count('settle')}; variation of u from the ideal sensor to 512 counts: "
        f"{runs.changes('tv_rate', 'ideal', '512 counts')}"
    )


scene = smc.Scene(
    title="Inverted pendulum read by an encoder",
    conditions={
        name: smc.paper.comparison("inverted_pendulum", duration=3.0, changes={"sensor": sensor})
        for name, sensor in {
            "ideal": None,
            "4096 counts": smc.Encoder(counts=4096),
            "512 counts": smc.Encoder(counts=512),
            "30 % lost": smc.Encoder(counts=4096, dropout=0.3),
            "5 ms late": smc.Encoder(counts=4096, delay=0.005),
            "every 10 ms": smc.Encoder(counts=4096, period=0.01),
        }.items()
    },
    film="512 counts",
    answers=("ultimate_bound", "ripple", "tv_rate"),
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
