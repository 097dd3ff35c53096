"""From lying on the floor to upright: who gets up with which torque, and who falls back when the
bob grows heavy?

Gravity asks for at most 2.5 N m. With 6 and with 3 N m the laws may get up. In the last condition
the bob's mass is multiplied by 25.9 at t = 3 s, beside a disturbance of 0.2 N m: 6 N m then hold it
only within 5 degrees of upright.

Look for: who never leaves the floor, who overshoots onto the other side, who still stands at the
end.
"""

import smc_mujoco as smc


def answer(runs):
    return (
        f"{runs.count('get up and stay up')}; first: {runs.least('settling_time')}; the farthest "
        f"from upright at the end with the heavy bob: {runs['heavy bob'].most('ultimate_bound')}"
    )


scene = smc.Scene(
    title="Inverted pendulum, from the floor and back",
    conditions={
        name: smc.paper.comparison(
            "inverted_pendulum", duration=8.0, changes={"contact": "floor", "x0": 2.43} | more
        )
        for name, more in {
            "6 N m": {"u_max": 6.0},
            "3 N m": {"u_max": 3.0},
            "heavy bob": {
                "disturbance": smc.paper.SINE,
                "jump": smc.Jump(3.0, smc.plant("inverted_pendulum").jumps["hard"]),
            },
        }.items()
    },
    film="heavy bob",
    answers=("settling_time", "overshoot", "peak_reaction"),
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
