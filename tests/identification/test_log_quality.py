"""What is said of logs whose columns make every number doubtful, before anything is replayed."""

import re

import numpy as np
import pytest
from helpers.machine_logs import chain, servo_log

import smc_mujoco as smc
from smc_mujoco.identification import log_quality, records, servo_columns
from smc_mujoco.identification.own_rig import own_rig

T = np.arange(0.0, 4.0, 2e-3)
X = 0.4 * np.sin(5.0 * T)
COUNT = 2.0 * np.pi / 4096


@pytest.fixture(scope="module")
def rig():
    """An arm of one joint."""
    return own_rig(smc.plant_from(chain([0.4], [1.0]), ["j1"]), ["j1.damping"])


def rounded(x):
    return COUNT * np.round(x / COUNT)


def said(rig, x):
    return log_quality.doubts(rig, [{"t": T, "x": x, "u": np.sin(5.0 * T)}])


@pytest.mark.quick
def test_a_good_log_leaves_no_doubt_with_noise_or_counts_or_neither(rig):
    noise = 2e-4 * np.random.default_rng(0).standard_normal(len(T))
    for x in (X, X + noise, rounded(X + noise)):
        assert not said(rig, x)


def test_spikes_are_counted_and_placed(rig):
    x = rounded(X)
    spikes = [200, 900, 901, 1500]  # the two in a row are wide, and no spike
    x[spikes] += 0.1
    (sentence,) = said(rig, x)
    assert sentence.startswith("2 of 2000 samples of x stick out")
    assert "the first at 0.4 s" in sentence


@pytest.mark.parametrize("rate", [40.0, 60.0, 100.0])
def test_the_turns_of_a_fast_chirp_are_no_spikes(rig, rate):
    t = np.arange(0.0, 20.0, 1.0 / rate)
    chirp = 0.4 * np.sin(2.0 * np.pi * (0.2 * t + 0.5 * (2.8 / 20.0) * t**2))  # 0.2 to 3 Hz
    loop = smc.Scenario(plant=rig.plant, law="none", control_period=1.0 / rate)
    slow_rig = own_rig(loop, ["j1.damping"])
    for x in (chirp, rounded(chirp)):
        assert not log_quality.doubts(slow_rig, [{"t": t, "x": x, "u": np.sin(5.0 * t)}])


def test_a_motion_of_few_counts_is_told(rig):
    (sentence,) = said(rig, rounded(10.0 * COUNT * X / 0.4))
    assert "only 20 times the noise or the step of its sensor" in sentence


def test_a_stuck_joint_is_refused_for_its_rest_and_not_for_the_unit_of_its_command(rig):
    """Its encoder shows two counts, one after the other."""
    stuck = {"t": T, "x": np.where(T < 2.0, 0.0, COUNT), "u": 50.0 * np.sin(5.0 * T)}
    with pytest.raises(smc.ScenarioError, match="no joint of chain moves in the record"):
        smc.identify(rig.plant, stuck, ["j1.damping"])


def test_a_log_that_may_lack_commands_is_told_unless_its_loop_is_known_to_be_as_slow(rig):
    slow = {"t": T[::5], "x": X[::5], "u": np.sin(5.0 * T[::5])}
    (sentence,) = log_quality.doubts(own_rig(rig.plant, ["input_delay"]), [slow])
    assert "input_delay may be 5 ms off" in sentence
    (sentence,) = log_quality.doubts(rig, [slow])  # without a delay to find, too
    assert 'say so by --condition "loop: control_period=0.01"' in sentence
    slow_loop = smc.Scenario(plant=rig.plant, law="none", control_period=0.01)
    assert not log_quality.doubts(own_rig(slow_loop, ["input_delay"]), [slow])


@pytest.fixture(scope="module")
def servo():
    """An arm on a position servo, and a log of it by MuJoCo alone."""
    part = '<position joint="j1" kp="60" kv="3" ctrlrange="-1.5 1.5"/>'
    xml = chain([0.5], [0.8]).replace('<motor joint="j1"/>', part)
    truth = {"j1.damping": 0.4, "j1.frictionloss": 0.3, "j1.armature": 0.03}
    log = servo_log(xml, truth, T, 0.1 * np.sin(5.0 * T) + 0.02 * np.sin(40.0 * T))
    return own_rig(smc.plant_from(xml, {"j1": smc.Channel(servo=True)}), ["j1.damping"]), log


def test_a_servo_s_right_log_leaves_no_doubt_also_of_a_joint_that_friction_holds(servo):
    rig, log = servo
    held = -5e-3 * np.sin(5.0 * T)
    for x in (log["x"], held):
        assert not servo_columns.doubts(rig, [log | {"x": x}])


@pytest.mark.parametrize(
    ("turned", "words"),
    [
        ({"x": -1.0}, "x moves against its set-point u: turn the sign"),
        ({"u": -1.0}, "x moves against its set-point u: turn the sign"),
        ({"u": 300.0}, r"; if u is the motor's force and no set-point, ask for j1\(motor\)$"),
        ({"x": 57.3}, "if x is in degrees"),
        ({"u": 57.3}, "if u is in degrees"),
        ({"x": 180.0, "u": 180.0}, "x and u reach 2.*if that is in degrees"),
    ],
)
def test_a_servo_s_column_with_another_sign_or_unit_is_named(servo, turned, words):
    rig, log = servo
    for name, factor in turned.items():
        log = log | {name: factor * log[name]}
    (sentence,) = servo_columns.doubts(rig, [log])
    assert re.search(words, sentence), sentence


SPINNING = """<mujoco><worldbody><body><joint name="j" axis="0 0 1"/><geom type="capsule"
fromto="0 0 0 .4 0 0" size=".02" mass="1" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor joint="j" ctrlrange="-10 10"/></actuator></mujoco>"""


def test_an_encoder_that_wraps_is_read_on(recwarn):
    """A joint of two turns, from -pi to pi and from 0 to a turn, with counts and noise."""
    arm = smc.plant_from(SPINNING, ["j"], name="arm")
    run = smc.run(
        smc.Scenario(
            plant=arm,
            law=smc.law("pid", kp=20.0, ki=0.0, kd=3.0),
            mismatch={"j.damping": 0.3},
            reference=smc.signals.Ramp(4.0) + smc.Sine(0.3, 5.0),
            sensor=smc.Encoder(4096),
            noise=smc.Noise(1e-4),
            duration=3.0,
            control_period=2e-3,
        )
    )
    x = smc.measured(run).x[:, 0]
    assert np.ptp(x) > 11.0
    recwarn.clear()
    values = []
    for low in (None, -np.pi, 0.0):
        column = x if low is None else (x - low) % (2.0 * np.pi) + low
        identified = smc.identify(arm, {"t": run.t, "x": column, "u": run.u[:, 0]}, ["j.damping"])
        values.append(identified.values["j.damping"])
        assert not [note for note in identified.notes if "degrees" in note]
        assert bool(recwarn) == (low is not None)
        if low is not None:
            said = str(recwarn.pop(smc.errors.ScenarioWarning).message)
            assert said.startswith("column x of arm jumps by a turn at ")
            assert said.endswith("its encoder wraps, and the jumps are taken out")
        recwarn.clear()
    assert values == pytest.approx([0.3] * 3, rel=5e-3)


def test_jumps_of_other_sizes_are_no_turns():
    t = np.arange(500) * 0.01
    x = np.sin(t)
    assert list(records.wraps(np.where(t > 2.0, x - 2.0 * np.pi, x))) == [np.argmax(t > 2.0)]
    for jump in (3.5, 5.0, 8.0, 360.0):
        assert not len(records.wraps(np.where(t > 2.0, x - jump, x)))


def test_a_column_of_counts_is_told_from_one_in_degrees(rig, refused):
    u = 0.3 * np.gradient(X, T) + 0.2 * 9.81 * np.sin(X) - 1.3 * X
    for column, cure in (
        (np.round(X / COUNT), "counts the steps of an encoder"),
        (np.degrees(X), "in degrees"),
    ):
        refused(lambda x=column: rig.guessed([{"t": T, "x": x, "u": u}]), "column x", cure)
