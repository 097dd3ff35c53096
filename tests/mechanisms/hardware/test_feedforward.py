"""Friction compensation beside a law: what it adds, and what it is worth."""

import math

import numpy as np
import pytest
from helpers import arms

import smc_mujoco as smc
from smc_mujoco.analysis.engine.group import why_not
from smc_mujoco.common import jit
from smc_mujoco.hardware import LuGre, ServoFriction, Sigmoid
from smc_mujoco.mechanisms.hardware.moments import JointState

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


@pytest.mark.quick
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


LOADED = smc.hardware.Stribeck(0.2, 0.3, 0.1, viscous=0.05, offset=0.02, km=0.15)


@pytest.mark.parametrize("carried", [-6.0, -0.11, 0.0, 0.4, 6.0])
@pytest.mark.parametrize("speed", [-0.3, 0.02, 1.0])
def test_a_loss_that_grows_with_the_load_is_that_of_a_steady_motion(carried, speed):
    """With it the motor of a joint that moves at a steady speed against -carried N m gives what
    the part then takes: by `Stribeck.value`, which the run has, and not by the compensation's.
    """
    p = jit.named(LOADED.names)(*LOADED.parameters(0))
    y = JointState(*np.zeros(len(JointState._fields)))._replace(v=speed, u=carried)
    added = LOADED.steady(y, p, np.zeros(1))
    taken = LOADED.value(speed, carried + added, -carried, p)[0]
    assert added == pytest.approx(taken, rel=1e-12)


LIFT = JOINT.replace('gravity="0 0 0"', 'gravity="0 0 -9.81"').replace("-10 10", "-20 20")


def test_compensation_of_the_load_takes_a_lifting_arm_to_its_reference():
    arm = smc.plant_from(LIFT, ["j"], name="arm")
    loss = smc.Coulomb(0.1, km=0.2)
    law = smc.law("computed_torque", kp=100.0, kd=20.0)
    fields = {"plant": arm, "law": law, "model": "nominal", "friction": loss, "x0": 1.0}
    errors = []
    for compensated in (None, smc.Coulomb(0.1), loss):
        ahead = smc.Feedforward(compensated) if compensated else None
        moved = smc.Constant(1.0) + SINE
        scenario = smc.Scenario(**fields, reference=moved, feedforward=ahead, duration=4.0)
        errors.append(rms(smc.run(scenario)))
    assert scenario.friction == (smc.hardware.Stribeck(0.1, km=0.2),)
    assert errors[2] < errors[1] / 10.0 < errors[0] / 10.0


# a position servo without gravity, before a play
SERVO = """<mujoco><worldbody><body><joint name="j" axis="0 1 0" damping="0.1"/>
<geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02" mass="0.3"/></body></worldbody>
<actuator><position joint="j" kp="17.8" kv="0.3" forcerange="-3 3" ctrlrange="-2 2"/></actuator>
</mujoco>"""


@smc.law_function(gains={"share": 1.0})
def follow(y, gains, memory):
    return gains.share * y.r, y.e


def test_the_inverse_of_a_play_before_a_servo_gives_the_motion_without_play():
    arm = smc.plant_from(SERVO, {"j": smc.Channel(servo=True)}, name="servo")

    def error(gap, ahead):
        play = smc.Backlash(gap, rotor_inertia=2e-3)
        slow = smc.Sine(0.3, 1.5)
        fields = {"friction": smc.Coulomb(0.1), "reference": slow, "x0": 0.0, "duration": 6.0}
        scenario = smc.Scenario(plant=arm, law=follow(), actuator=play, feedforward=ahead, **fields)
        return rms(smc.run(scenario))

    inverse = smc.Feedforward(smc.Backlash(0.06))
    rigid = error(0.0, None)
    assert error(0.06, None) > 3.0 * rigid
    assert error(0.06, inverse) == pytest.approx(rigid, rel=0.01)


GEARED = {
    "actuator": smc.Backlash(0.05, rotor_inertia=5e-3, rotor_damping=0.01),
    "sensor": smc.Encoder(math.inf, side="motor"),
    "friction": smc.Coulomb(0.3),
    "law": smc.law("pid", kp=60.0, ki=0.0, kd=2.0),
    "reference": SINE,
    "duration": 5.0,
    "x0": 0.0,
}


def test_the_inverse_of_a_play_moves_the_reference_of_a_law_that_sees_the_motor(joint):
    """With friction's compensation the error falls to a fifth; r of the trace is the reference."""

    def error(*parts, wrong=0.0):
        ahead = smc.Feedforward(parts, eps=0.05, error=wrong) if parts else None
        trace = smc.run(smc.Scenario(plant=joint, feedforward=ahead, **GEARED))
        np.testing.assert_array_equal(trace.r[:, 0], 0.3 * np.sin(3.0 * trace.t))
        return rms(trace)

    rubs, play = GEARED["friction"], smc.Backlash(0.05)
    right = error(rubs, play)
    assert right < error(rubs, play, wrong=-0.3) < error(rubs) < error()
    assert right < error() / 5.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sensor": None}, "measures joint 'j' itself"),
        ({"feedforward": smc.Feedforward(smc.Backlash(0.1), on="error")}, "leave on out"),
        (
            {"feedforward": smc.Feedforward(smc.Coulomb(0.1, km=1.0))},
            "as much as it carries: give a km below 1",
        ),
    ],
)
def test_a_play_or_a_loss_that_has_no_inverse_is_refused(joint, changes, words):
    fields = GEARED | {"feedforward": smc.Feedforward(smc.Backlash(0.05))} | changes
    with pytest.raises(smc.ScenarioError, match=words):
        smc.run(smc.Scenario(plant=joint, **fields))


def test_the_load_of_a_set_point_is_not_known():
    arm = smc.plant_from(SERVO, {"j": smc.Channel(servo=True)}, name="servo")
    ahead = smc.Feedforward(smc.Coulomb(0.1, km=0.1))
    with pytest.raises(smc.ScenarioError, match="is a set-point, which does not tell the load"):
        smc.run(smc.Scenario(plant=arm, law="none", feedforward=ahead))


def test_the_fast_engine_leaves_a_play_to_mujoco():
    scenario = smc.Scenario(
        plant="duffing", feedforward=smc.Feedforward(smc.Backlash(0.05)), **GEARED
    )
    assert "leads through a play" in why_not(scenario)


@smc.law_function(gains={"share": 1.0}, joint=True)
def follow_all(y, gains, memory):
    return gains.share * y.r, y.e


@pytest.mark.parametrize("law", [follow(), follow_all()], ids=["one joint", "many joints"])
def test_the_reference_that_a_law_sees_leads_by_half_the_play(law):
    ahead = smc.Feedforward({"lift": smc.Backlash(0.04)}, eps=0.1, error=-0.25)
    moved = smc.Sine(0.2, 5.0)
    scenario = smc.Scenario(
        plant=arms.arm(),
        law=law,
        reference=moved,
        feedforward=ahead,
        actuator={"lift": smc.Backlash(0.04), "turn": smc.Backlash(0.02)},
        sensor=smc.Encoder(side="motor"),
        duration=0.05,
    )
    trace = smc.run(scenario)
    r, dr = 0.2 * np.sin(5.0 * trace.t), np.cos(5.0 * trace.t)
    led = r + 0.75 * 0.02 * np.tanh(dr / 0.1)
    for i, name in enumerate(("reach", "turn", "lift")):
        expected = led if name == "lift" else r
        np.testing.assert_allclose(trace.u[:, i], expected, rtol=1e-9)
