"""The QUBE-Servo 3's twin against two records of the machine: a step of 1 V, and falls of its
pendulum.
"""

from pathlib import Path

import numpy as np
import pytest

import smc_mujoco as smc
from benchmarks.programs import falls, moved

pytestmark = pytest.mark.quick

STEP = np.genfromtxt(Path(__file__).with_name("qube_servo_3_step.csv"), delimiter=",", names=True)
FREQUENCY, DAMPING = 2.432, 0.0261  # Hz and "", of ten falls, while the swings are 8 to 25 degrees


def step_error(rig):
    t, arm, _ = moved(rig, -1.0, 0.0, 0.8)
    ahead = STEP[STEP["t"] <= 0.8]
    return np.sqrt(np.mean((np.interp(ahead["t"], t, arm) - ahead["theta"]) ** 2))


def test_the_twin_turns_and_falls_as_the_machine_does():
    rig = smc.rig("qube_servo_3")
    assert step_error(rig) < 0.02
    frequency, damping = falls(rig)
    assert frequency == pytest.approx(FREQUENCY, rel=0.02)
    assert damping == pytest.approx(DAMPING, rel=0.06)


def test_the_published_numbers_do_not():
    published = smc.rig("qube_servo_3").set("quanser")
    assert step_error(published) > 0.08
    frequency, damping = falls(published)
    assert frequency < 0.9 * FREQUENCY
    assert damping > 2.0 * DAMPING


def test_the_cable_takes_energy_from_a_turn_and_hardly_any_from_a_fall():
    """Friction that slips at once would stop the falls, and none would leave the step without its
    loss.
    """
    rig = smc.rig("qube_servo_3")
    stiff = rig.with_values({"cable_stiffness": 10.0})
    none = rig.with_values({"cable_friction": 0.0})
    assert falls(stiff)[1] > 3.0 * DAMPING
    assert step_error(none) > 0.1


def test_the_ensemble_spreads_as_the_standard_errors_say():
    errors = {}
    for quantity in smc.rig("qube_servo_3").about.split(": ", 1)[1].split(". ")[0].split(", "):
        name, error = quantity.split()
        errors[name] = float(error)
    own = smc.rig("qube_servo_3")
    assert errors.keys() == set(own.free)
    away = []
    for values in own.ensemble:
        away.append([(values[name] - own.values[name]) / errors[name] for name in own.free])
    assert 0.7 < np.sqrt(np.mean(np.square(away))) < 1.4


def test_a_motor_that_brakes_damps_falls_more():
    rig = smc.rig("qube_servo_3")
    a = []
    for volts in (None, 0.0):
        a.append(np.abs(moved(rig, volts, np.radians(25.0), 0.6)[2]))
    late = [angles[200:].max() for angles in a]
    assert late[1] < 0.9 * late[0]


def test_each_quantity_that_was_found_is_needed():
    """Halved, each spoils the step or the falls."""
    rig = smc.rig("qube_servo_3")
    for name in rig.free:
        halved = rig.with_values({name: 0.5 * rig.values[name]})
        frequency, damping = falls(halved)
        apart = abs(frequency / FREQUENCY - 1.0), abs(damping / DAMPING - 1.0)
        assert step_error(halved) > 0.02 or apart[0] > 0.02 or apart[1] > 0.06, name
