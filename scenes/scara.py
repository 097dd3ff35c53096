"""Which law holds the speed of an arm's shoulder when its motors lose half of their torque?

A SCARA arm behind gears turns its shoulder at 0.8 rad/s, while the elbow swings and the quill
stands. What counts is the speed, not the angle. At 2 s every motor gives half of what it is told.

Look for: the gears' rotors hide most of the coupling. After the fault the PID falls behind until
its integral has doubled; super-twisting needs a tenth of a second.
"""

from pathlib import Path

import smc_mujoco as smc

PLANT = smc.plant_from(
    Path(__file__).parents[1] / "models" / "scara.xml", ["shoulder", "elbow", "lift"]
)
REFERENCE = [smc.signals.Ramp(0.8), smc.Sine(0.4, 3.0), smc.Constant(0.0)]
LAWS = {
    "PID": smc.law("pid", kp=[120.0, 60.0, 400.0], ki=[200.0, 100.0, 900.0], kd=[15.0, 8.0, 80.0]),
    "super-twisting": smc.law("super_twisting", k1=[9.0, 5.0, 30.0], k2=[40.0, 20.0, 200.0], c=6.0),
}


def run(law, fault):
    return smc.Scenario(
        plant=PLANT, law=law, reference=REFERENCE, fault=fault, tracks="speed", duration=5.0
    )


def slowest(trace):
    late = trace.t > 2.0
    return abs(trace.v[late, 0] - 0.8).max()


def answer(runs):
    return (
        f"the shoulder's speed is off by most under {runs['half lost'].most(slowest)}, in rad/s, "
        f"and by least under {runs['half lost'].least(slowest)}"
    )


scene = smc.Scene(
    title="Speed of a SCARA arm",
    conditions={
        "whole motors": {label: run(law, None) for label, law in LAWS.items()},
        "half lost": {label: run(law, smc.Fault(at=2.0, gain=0.5)) for label, law in LAWS.items()},
    },
    film="half lost",
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
