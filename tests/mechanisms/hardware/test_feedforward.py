"""Friction compensation beside a law: what it adds, and what it is worth."""

import math

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.engine.group import why_not
from smc_mujoco.hardware import LuGre, ServoFriction, Sigmoid

# a joint that only friction resists
JOINT = """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="j" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1"/></body></worldbody>
<actuator><motor joint="j" ctrlrange="-10 10"/></actuator></mujoco>"""
SINE = smc.Sine(0.3, 3.0)
RUBS = smc.Coulomb(0.6), smc.Viscous(0.3)
PD = smc.law("pid", kp=40.0, ki=0.0, kd=4.0)


@pytest.fixture(scope="module")
def joint():
    return smc.plant_from(JOINT, ["j"], name="joint")


def run(plant, feedforward, **changes):
    fields = {"reference": SINE, "friction": RUBS, "duration": 5.0, "x0": 0.0} | changes
    return smc.run(smc.Scenario(plant=plant, law=PD, feedforward=feedforward, **fields))


def rms(trace):
    return math.sqrt(np.mean(trace.e[trace.t > 2.5] ** 2))


# friction, and what moves a joint against it at a steady speed v > 0
STEADY = [
    (smc.Coulomb(0.2), lambda v: 0.2),
    (smc.Viscous(0.3), lambda v: 0.3 * v),
    (LuGre(0.1, 0.3, stribeck=0.5), lambda v: 0.1 + 0.2 * math.exp(-((v / 0.5) ** 2))),
    (
        ServoFriction(kc=0.1, kcs=0.2, vs=0.5, alpha=1.5, kv=0.4),
        lambda v: 0.1 + 0.2 * math.exp(-((v / 0.5) ** 1.5)) + 0.4 * v,
    ),
    (Sigmoid(0.4, 5.0), lambda v: 0.4 / (1.0 + math.exp(-5.0 * v)) - 0.2),
]


def test_on_the_error_it_is_what_breaks_a_joint_away_towards_the_reference(joint):
    """A joint of stiction 0.3 N m stands still under a P law of 0.1 N m, and moves with it."""
    friction = smc.hardware.Stribeck(0.2, 0.3, 0.05)
    fields = {"reference": None, "friction": friction, "x0": 0.1, "duration": 3.0}
    weak = smc.law("pid", kp=1.0, ki=0.0, kd=0.2)

    def end(feedforward):
        return smc.run(smc.Scenario(plant=joint, law=weak, feedforward=feedforward, **fields))

    assert end(None).x[-1, 0] == pytest.approx(0.1, abs=1e-3)
    assert end(smc.Feedforward(friction, on="speed")).x[-1, 0] == pytest.approx(0.1, abs=1e-3)
    eps = 0.01
    trace = end(smc.Feedforward(friction, on="error", eps=eps))
    expected = np.copysign(0.3 * np.tanh(np.abs(trace.e) / eps), -trace.e)
    np.testing.assert_allclose(trace.compensation[:-1], expected[:-1], rtol=1e-9)  # pyright: ignore[reportOptionalSubscript]
    assert abs(trace.x[-1, 0]) < 0.02


def test_a_drive_gets_the_u_that_gives_the_force(joint):
    motor = smc.DCMotor()
    feedforward = smc.Feedforward(smc.Coulomb(0.02))
    trace = run(joint, feedforward, actuator=motor, friction=None, duration=0.02)
    gain = trace.scenario.drive_train.nominal[0].gain
    assert np.ravel(trace.compensation)[1] == pytest.approx(0.02 / gain, rel=1e-6)


def test_right_it_takes_the_error_of_pd_down_and_wrong_it_lies_between(joint):
    none = rms(run(joint, None))
    right = rms(run(joint, smc.Feedforward(RUBS)))
    assert right < none / 4.0
    for error in (-0.3, 0.3):
        assert right < rms(run(joint, smc.Feedforward(RUBS, error=error))) < none
    assert rms(run(joint, smc.Feedforward(RUBS, on="speed"))) < none / 2.0


def test_u_with_it_stays_within_the_bound_and_the_trace_is_read_back(joint, tmp_path):
    trace = run(joint, smc.Feedforward(smc.Coulomb(8.0)), u_max=2.0, duration=0.5)
    assert abs(trace.u).max() == 2.0
    assert abs(trace.compensation).max() == pytest.approx(8.0)
    back = smc.load(trace.save(tmp_path / "run"))
    assert back.scenario == trace.scenario
    assert (back.compensation == trace.compensation).all()
    assert run(joint, None, duration=0.1).compensation is None


def test_a_grid_draws_its_error_by_seed(joint):
    feedforward = smc.Feedforward(RUBS, error=0.3)
    condition = smc.condition("compensated", friction=RUBS, feedforward=feedforward, reference=SINE)
    runs = smc.grid(joint, [PD, smc.law("adrc")], condition, seeds=40)
    errors = np.array([getattr(scenario.feedforward, "error", None) for scenario in runs]).reshape(
        2, 40
    )
    assert (errors[0] == errors[1]).all()  # the same for every law
    assert len(set(errors[0].tolist())) == 40
    assert abs(errors).max() <= 0.3
    assert errors.min() < -0.2
    assert errors.max() > 0.2
    tuned = smc.tune(joint, PD, budget=1, searches=1, conditions=condition)
    assert tuned.definition.conditions == (condition,)


@smc.hardware.friction_function(numbers={"level": 0.3, "drop": 0.2})
def own(y, p, memory):
    return p.level + p.drop * math.exp(-abs(y.v) / 0.1)


STEADY.append((own(level=0.4), lambda v: 0.4 + 0.2 * math.exp(-v / 0.1)))


@pytest.mark.parametrize(("friction", "steady"), STEADY, ids=lambda it: type(it).__name__)
def test_it_adds_the_force_of_a_steady_speed(joint, friction, steady):
    trace = run(joint, smc.Feedforward(friction, eps=0.1, error=-0.2), friction=None, duration=0.3)
    v = 0.9 * np.cos(3.0 * trace.t)
    expected = [0.8 * math.tanh(speed / 0.1) * steady(speed) for speed in v.tolist()]
    np.testing.assert_allclose(np.ravel(trace.compensation), expected, rtol=1e-9)


@smc.hardware.friction_function(numbers={"level": 0.3})
def warming(y, p, memory):
    return p.level * (1.0 + y.t + y.x**2)


def test_it_knows_the_time_and_the_place_of_the_joint(joint):
    """Beside a part of the plant, which leaves a state of its own joint and time."""
    trace = run(joint, smc.Feedforward(warming()), duration=0.3, x0=0.2)
    v = 0.9 * np.cos(3.0 * trace.t)
    level = 0.3 * (1.0 + trace.t + np.ravel(trace.x) ** 2)
    expected = level * np.tanh(np.abs(v) / 0.005) * np.sign(v)
    np.testing.assert_allclose(np.ravel(trace.compensation), expected, rtol=1e-9)


def test_the_fast_engine_asks_what_compensated_and_dry_frictions_index(joint):
    scenario = smc.Scenario(
        plant="duffing", law=PD, friction=RUBS, feedforward=smc.Feedforward(RUBS)
    )
    assert why_not(scenario, device="cuda") == ""


@smc.hardware.friction_function(numbers={"level": 0.3}, memory=1)
def remembering(y, p, memory):
    memory[0] += y.h
    return -p.level * math.tanh(y.v / 0.1)


@pytest.mark.parametrize(
    ("feedforward", "words"),
    [
        (lambda: smc.Feedforward(remembering()), "cannot compensate remembering"),
        (lambda: smc.Feedforward({"knee": smc.Coulomb(0.1)}), "joint .*'knee'"),
        (lambda: smc.Feedforward(()), "has no friction"),
        (lambda: smc.Feedforward(smc.Coulomb(0.1), on="position"), "on"),
        (lambda: smc.Feedforward(smc.Coulomb(0.1), eps=0.0), "eps is 0"),
        (lambda: 0.3, "feedforward is 0.3: give smc.Feedforward"),
    ],
)
def test_what_it_cannot_compensate_is_refused(joint, feedforward, words):
    with pytest.raises(smc.ScenarioError, match=words):
        run(joint, feedforward())
