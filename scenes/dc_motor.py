"""What is left of each law's promise when a geared DC motor stands between command and joint?

The amplifier turns u into the voltage whose stall torque is u. Speed takes torque away (back-EMF),
the winding delays it, the supply and the current limit bound it, and cogging adds a ripple; a
first-order lag stands beside it.

Look for: settling times under the weak supply, and chattering that the motor passes on or smooths
away.
"""

import smc_mujoco as smc


def answer(runs):
    return (
        f"{runs.count('settle')}; settling time from the ideal drive to the 3 V supply: "
        f"{runs.changes('settling_time', 'ideal', '3 V supply')}; "
        "least variation of u of those that settle: "
        f"{runs.select().least('tv_rate')}"
    )


scene = smc.Scene(
    title="Inverted pendulum on a DC motor",
    conditions={
        name: smc.paper.comparison(
            "inverted_pendulum", duration=3.0, changes={"actuator": actuator}
        )
        for name, actuator in {
            "ideal": None,
            "24 V supply": smc.DCMotor(),
            "cogging": smc.DCMotor(cogging=0.01),
            "3 V supply": smc.DCMotor(voltage=3.0),
            "lag 10 ms": smc.Lag(0.01),
        }.items()
    },
    film="3 V supply",
    answers=("settling_time", "ultimate_bound", "tv_rate"),
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
