"""The brushes of the QUBE-Servo's motor, read from runs of its twin."""

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.evidence.rigs.machines.qube_servo import zero
from smc_mujoco.identification.rig import Values

RIG = smc.rig("qube_servo")


@pytest.mark.parametrize(
    ("brush", "amplitude"),
    [
        (0.3, 0.5),
        (0.6, 0.8),
        (0.0, 0.5),
    ],
)
def test_a_brush_is_read_from_a_run_and_is_unknown_if_the_torque_is_even(brush, amplitude):
    machine = smc.rig("qube_servo", brush=brush)
    trace = smc.run(machine.scenario(duration=20.0, reference=smc.Sine(amplitude, 3.0)))
    measured = {
        "theta": trace.x[:, 0],
        "alpha": trace.x[:, 1],
        "plant_input": trace.u[:, 0],
    }
    offsets = zero(Values(**RIG.values), measured)
    assert offsets == ({"brush": pytest.approx(brush, abs=np.radians(1.0))} if brush else {})
