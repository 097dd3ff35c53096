"""Published rigs make scenarios, repeat records, and refuse what is no record of theirs in one sentence."""

import dataclasses
import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import reference
from helpers.runs import assert_same
from typer.testing import CliRunner

import smc_mujoco as smc
from smc_mujoco.cli.main import app
from smc_mujoco.evidence.rigs.controllers import state_feedback
from smc_mujoco.simulation import python_functions

QUBE = smc.rig("qube_servo")


def recorded(trace, **changes):
    """The record that a QUBE-Servo would have written of a run."""
    t = trace.t
    bias = trace.scenario.sensor.bias
    zero = np.zeros(len(t))
    record = {
        "t": t,
        "theta": trace.x[:, 0] + bias,
        "alpha": trace.x[:, 1] + bias,
        "plant_input": trace.u[:, 0],
        "target_theta": trace.r[:, 0],
        "target_alpha": zero,
        "feedforward": zero,
    }
    return record | changes


@pytest.fixture(scope="module")
def record():
    """7 s of the twin itself, whose arm follows a sine, read without rounding."""
    sensor = dataclasses.replace(QUBE.scenario().sensor, counts=math.inf)
    moving = QUBE.scenario(
        duration=7.0,
        reference=smc.Sine(0.3, 1.5),
        sensor=sensor,
        x0=(0.02, 0.03),
    )
    return recorded(smc.run(moving))


@pytest.mark.quick
def test_every_number_has_a_source_and_its_licence():
    for name in smc.rigs():
        for quantity, number in smc.rig(name).quantities.items():
            assert len(number.source) > 5, (name, quantity)
            if not number.source.startswith(("identified here", "chosen", "part of")):
                assert re.search(r"\((MIT|BSD-3|no licence stated)\)", number.source), (
                    name,
                    quantity,
                )
            assert number.least <= number.value <= number.most, (name, quantity)


@pytest.mark.parametrize("name", smc.rigs())
def test_a_rig_makes_scenarios_of_its_machine(name):
    rig = smc.rig(name)
    scenario = rig.scenario("none", duration=0.02)
    trace = smc.run(scenario)
    assert trace.failure is None
    assert scenario.efforts[0] == trace.units()["u0" if scenario.plant.n > 1 else "u"]
    if rig.controller is not None:
        assert rig.scenario(duration=0.1).law == rig.controller


@pytest.mark.parametrize("samples", [500, 1020])
def test_a_record_too_short_to_read_the_brushes_is_repeated_with_an_even_torque(record, samples):
    brief = {}
    for name, column in record.items():
        brief[name] = column[:samples]
    assert QUBE.replay(brief, start=0.5).actuator[0].ripple == 0.0


@pytest.mark.parametrize(
    ("name", "stall", "brake"),  # N m or N per volt; V per rad/s or m/s
    [
        ("qube_servo_2", 5e-3, 0.042),
        ("qube_servo_3", 5.63e-3, 0.0422),
        ("srv02", 0.128, 0.538),
    ],
)
def test_a_quanser_motor_pushes_and_brakes_as_published(name, stall, brake):
    rig = smc.rig(name)
    (motor,) = (rig.set("quanser") if rig.published else rig).scenario("none").actuator
    lever = motor.gear * motor.torque_constant
    assert (lever / motor.resistance, lever) == pytest.approx((stall, brake), rel=5e-3)


def test_a_changed_quantity_changes_the_machine_and_its_source():
    shorter = smc.rig("qube_servo", arm_length=0.1)
    assert shorter.scenario("none").plant.parameters["L"] == 0.1
    assert shorter.quantities["arm_length"].source == "given"
    assert QUBE.scenario("none").plant.parameters["L"] != 0.1


def test_the_twin_repeats_its_own_record(record):
    """The start's velocities come from positions, and a count in them is forgotten after two
    seconds.
    """
    fit = QUBE.fit(record)
    assert list(fit) == ["theta", "alpha", "u"]
    assert min(fit.values()) > 99.0


@pytest.mark.slow
def test_a_record_of_another_machine_fits_less(record):
    fit = smc.rig("qube_servo", arm_length=0.1, arm_friction=0.0).fit(record)
    assert min(fit.values()) < 50.0


def test_the_replay_is_the_controllers_own_command(record):
    """On measured positions the law, with what is added to it, gives the recorded command from the
    first sample on.
    """
    start = 1.0
    target = 0.01 * np.sign(np.sin(3.0 * record["t"]))
    rng = np.random.default_rng(3)
    theta, alpha, feedforward = rng.normal(0.0, 0.01, (3, len(target)))
    e = np.column_stack([theta - record["target_theta"], alpha - target])
    d = np.zeros(2)
    u = np.zeros(len(target))
    for k in range(len(target)):
        if k:
            d = (50.0 * (e[k] - e[k - 1]) + d) / (1.0 + 50.0 * 2e-3)
        u[k] = 6.0 * e[k, 0] + 1.8 * d[0] + 30.0 * e[k, 1] + 2.5 * d[1] + feedforward[k]
    changed = record | {
        "theta": theta,
        "alpha": alpha,
        "target_alpha": target,
        "feedforward": feedforward,
    }
    scenario = QUBE.replay(changed, start=start)
    memory = np.zeros(5)
    first = round(start / 2e-3)
    gains = python_functions.Values(**scenario.law.gains)
    for k in range(400):
        r = python_functions.evaluate(scenario.reference, k * 2e-3)[0]
        x = theta[first + k]
        y = SimpleNamespace(dt=2e-3, e=x - r, q=alpha[first + k])
        added = python_functions.evaluate(scenario.feedforward, k * 2e-3)[0]
        command = state_feedback.function(y, gains, memory)[0] + added
        assert command == pytest.approx(u[first + k], abs=1e-9)


def test_a_replay_is_an_ordinary_scenario(record, tmp_path):
    """The oracle runs it alike, and a file brings it back with its controller."""
    scenario = QUBE.replay(record, duration=0.2)
    trace = smc.run(scenario)
    assert_same(trace, reference.run(scenario))
    again = smc.load(trace.save(tmp_path / "a"))
    assert again.scenario == scenario
    assert again.scenario.law.function is state_feedback.function


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (
            lambda r: {k: v for k, v in r.items() if k != "theta"},
            "the record of qube_servo has no column theta (it has t, alpha",
        ),
        (lambda r: r | {"t": r["t"] * 0.5}, "is sampled every 0.001 s and the rig's controller"),
        (lambda r: {k: v[:800] for k, v in r.items()}, "too short to repeat it: give at least 2.1"),
        (lambda r: {k: v[:1500] for k, v in r.items()}, "too short to score it: give at least 4.1"),
        (lambda r: "record.csv", "record is 'record.csv': give a mapping of columns"),
    ],
)
def test_what_cannot_be_repeated_is_one_sentence(bad, words, record):
    with pytest.raises(smc.ScenarioError) as error:
        QUBE.fit(bad(record))
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_columns_have_the_units_of_the_machine():
    assert QUBE.units == {"theta": "rad", "alpha": "rad", "plant_input": "V"}
    assert smc.rig("realaigym_acrobot").units == {"tau_meas1": "N m", "tau_meas2": "N m"}


def test_the_delay_is_a_whole_number_of_steps():
    late = smc.rig("qube_servo", delay=1.1e-3).scenario("none")
    assert late.delay_steps * late.resolved.physics_step == pytest.approx(1e-3)


def test_a_record_is_a_trace_of_what_was_measured(record):
    """Shifted by the encoder's offset, so that a film shows the machine where its twin counts."""
    trace = QUBE.measured(record, start=3.0, duration=1.0)
    part = slice(1500, 2001)
    bias = QUBE.values["encoder_offset"]
    np.testing.assert_allclose(trace.t, record["t"][part] - 3.0, atol=1e-12)
    np.testing.assert_allclose(trace.x[:, 1], record["alpha"][part] - bias, atol=1e-12)
    np.testing.assert_array_equal(trace.u[:, 0], record["plant_input"][part])
    np.testing.assert_array_equal(trace.r[:, 0], record["target_theta"][part])
    np.testing.assert_allclose(trace.v[:, 0], np.gradient(record["theta"], 2e-3)[part], atol=0.02)
    assert trace.scenario == QUBE.replay(record, 3.0, 1.0)


def test_records_of_torques_are_not_repeated():
    rig = smc.rig("realaigym_acrobot")
    with pytest.raises(smc.ScenarioError, match="are not replayed, as their torques are"):
        rig.replay(dict.fromkeys(rig.needed, np.arange(600.0)))


@pytest.mark.slow
def test_the_command_repeats_a_record(record, tmp_path):
    np.savez(tmp_path / "run.npz", **record)
    words = ["rig", "qube_servo", str(tmp_path / "run.npz"), "--sets", "driver"]
    done = CliRunner().invoke(app, [*words, "--figure", str(tmp_path / "run")])
    assert done.exit_code == 0, done.output
    assert re.search(r"twin +(99|100)\.\d +(99|100)\.\d +(99|100)\.\d", done.output)
    assert re.search(r"driver +-?\d", done.output)
    assert (tmp_path / "run.svg").stat().st_size > 1000
