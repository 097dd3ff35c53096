"""The QUBE-Servo 3's twin against two records of the machine: a step of 1 V, and falls of its pendulum."""

from pathlib import Path

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.evidence.rigs.machines.quanser import fall_frequency, moved

pytestmark = pytest.mark.quick

STEP = np.genfromtxt(Path(__file__).with_name("qube_servo_3_step.csv"), delimiter=",", names=True)
FREQUENCY = 2.432  # Hz, of ten falls, while the swings are 8 to 25 degrees


def step_error(rig):
    t, arm, _ = moved(rig, -1.0, 0.0, 0.8)
    ahead = STEP[STEP["t"] <= 0.8]
    return np.sqrt(np.mean((np.interp(ahead["t"], t, arm) - ahead["theta"]) ** 2))


def test_the_twin_turns_and_falls_as_the_machine_does():
    rig = smc.rig("qube_servo_3")
    assert step_error(rig) < 0.02
    assert fall_frequency(rig) == pytest.approx(FREQUENCY, rel=0.02)


def test_the_published_numbers_do_not():
    published = smc.rig("qube_servo_3").set("quanser")
    assert step_error(published) > 0.08
    assert fall_frequency(published) < 0.9 * FREQUENCY


def test_each_quantity_that_was_found_is_needed():
    """Halved, each spoils the step or the fall."""
    rig = smc.rig("qube_servo_3")
    for name in rig.free:
        other = rig.with_values({name: 0.5 * rig.values[name]})
        assert step_error(other) > 0.02 or abs(fall_frequency(other) / FREQUENCY - 1.0) > 0.02, name
