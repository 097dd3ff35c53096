"""Numbers of a position servo by their paths, from an own integration of its joint."""

import math

import numpy as np
import pytest
from helpers.servo_integration import servo_log

import smc_mujoco as smc
from smc_mujoco.identification.own_rig import own_rig

MASS, LENGTH = 0.3, 0.2
XML = """<mujoco><worldbody><body><joint name="elbow" axis="{axis}"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.3" contype="0" conaffinity="0"/>
</body></worldbody><actuator><position joint="elbow" kp="10" kv="0.05" ctrlrange="-2 2"/></actuator>
</mujoco>"""
TRUE = {"kp": 17.8, "kv": 0.05, "damping": 0.3, "friction": 0.08, "dead_band": 0.03}
ARMATURE = 0.01


def arm_of(axis="0 1 0"):
    return smc.plant_from(XML.format(axis=axis), {"elbow": smc.Channel(servo=True)}, name="hobby")


def set_point(t):
    return 0.5 * math.sin(2.3 * t) + 0.2 * math.sin(6.1 * t + 0.4) + 0.1 * math.sin(13.0 * t)


def log_of(arm, duration, armature=ARMATURE, **numbers):
    inertia = float(arm.load().dof_M0[0]) + armature
    weight = MASS * 9.81 * 0.5 * LENGTH
    return servo_log(set_point, duration, inertia=inertia, weight=weight, **TRUE | numbers)


def noisy(log):
    random = np.random.default_rng(0)
    return log | {"x": log["x"] + 2e-4 * random.standard_normal(len(log["x"]))}


def test_a_servo_with_a_dead_band_moves_as_its_own_integration():
    arm = arm_of()
    log = log_of(arm, 1.5)
    names = ["elbow.kp", "elbow.dead_band", "elbow.damping", "elbow.frictionloss", "elbow.armature"]
    values = dict(zip(names, [17.8, 0.03, 0.3, 0.08, ARMATURE], strict=True))
    rig = own_rig(arm, names).with_values(values)
    part = rig.part(log, 0.0, 1.4)
    trace = smc.run(rig.repeated(part, state=np.zeros(2)))
    assert trace.scenario.actuator[0].kp == 17.8
    x = trace.x[:: part.stride, 0]
    np.testing.assert_allclose(x, log["x"][: len(x)], atol=2e-4)
    without = smc.run(
        rig.with_values(values | {"elbow.dead_band": 0.0}).repeated(part, state=np.zeros(2))
    )
    assert abs(without.x - trace.x).max() > 0.02


@pytest.mark.slow
def test_stiffness_and_dead_band_are_found_from_the_file_s_own_numbers():
    """Within two standard errors or 0.5 %, from kp 10 and no dead band, friction or armature."""
    arm = arm_of()
    true = {
        "elbow.kp": 17.8,
        "elbow.dead_band": 0.03,
        "elbow.damping": 0.3,
        "elbow.frictionloss": 0.08,
        "elbow.armature": ARMATURE,
    }
    identified = smc.identify(arm, noisy(log_of(arm, 6.0)), list(true))
    for name, value in true.items():
        off = abs(identified.values[name] - value)
        assert off <= max(2.0 * identified.errors[name], 5e-3 * value), name
    assert not identified.notes
    condition = identified.condition()
    (servo,) = smc.Scenario(plant=arm, law="none", **condition.on(arm, 1.0)).actuator
    assert servo.kp == pytest.approx(identified.values["elbow.kp"])
    assert identified.rig.quantities["elbow.kp"].unit == "N m/rad"


def test_a_log_that_does_not_show_the_stiffness_says_why():
    """Without weight a slow joint tells friction over kp alone."""
    arm = arm_of("0 0 1")
    slow = servo_log(
        lambda t: 0.4 * math.sin(0.5 * t),
        3.0,
        **TRUE | {"inertia": 0.01, "weight": 0.0, "dead_band": 0.0},
    )
    identified = smc.identify(arm, noisy(slow), ["elbow.kp", "elbow.damping"])
    (cause,) = [note for note in identified.notes if "elbow.kp" in note]
    assert cause.startswith(
        "the log does not show elbow.kp: its joint follows the set-point slowly"
    )
    inertia = float(arm.load().dof_M0[0])
    assert f"nearer to {math.sqrt(10.0 / inertia):.2g} rad/s" in cause


@pytest.mark.quick
def test_a_play_gets_a_rotor_where_the_scenario_has_none():
    arm = arm_of()
    rig = own_rig(arm, ["elbow.play"])
    assert rig.quantities["elbow.play"].unit == "rad"
    _, play = rig.with_values({"elbow.play": 0.02}).condition_fields()["actuator"]
    assert isinstance(play, smc.Backlash)
    assert play.gap == 0.02
    assert play.rotor_inertia == pytest.approx(0.01 * float(arm.load().dof_M0[0]))
    geared = smc.Scenario(plant=arm, law="none", actuator=smc.Backlash(0.05, rotor_inertia=0.02))
    (own,) = own_rig(geared, ["elbow.play"]).base.drive_train.chains[0][1:]
    assert own.rotor_inertia == 0.02


def test_a_dead_band_beside_a_filter_is_refused(refused):
    refused(
        lambda: smc.hardware.PositionServo(10.0, timeconst=0.02, dead_band=0.01),
        "dead_band 0.01",
        "give one of them",
    )
