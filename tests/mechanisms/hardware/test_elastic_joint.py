"""ElasticJoint against its equations, integrated without MuJoCo's springs, and what reads its rotor."""

import math

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import smc_mujoco as smc
from smc_mujoco.hardware import ElasticJoint
from smc_mujoco.simulation.conditions import NAMED
from smc_mujoco.simulation.model import compile_model

INERTIA, DRAG, START = 0.125, 0.05, 0.3
AXIS = smc.plant("servo_axis", M=INERTIA, b=DRAG, cf=0.0, offset=0.0)
SHAKEN = smc.Sine(6.0, 40.0) + smc.Sine(3.0, 3.0)
PERFECT = {"counts": math.inf}

ARM = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>
  <body><joint name="shoulder" axis="0 1 0" damping=".1"/>
    <geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1"/>
    <body pos="0 0 -.4"><joint name="elbow" axis="0 1 0" damping=".05"/>
      <geom type="capsule" fromto="0 0 0 0 0 -.3" size=".02" mass=".5"/></body></body></worldbody>
  <actuator><motor joint="shoulder"/><motor joint="elbow"/></actuator></mujoco>"""


@smc.law_function
def watch(y, gains, memory):
    """Does nothing, and shows the position it reads."""
    return 0.0, y.x


def two_masses(part, commands, period):
    """Position and speed of joint and rotor at each sample, (K + 1, 4), exact for held commands."""
    A = np.zeros((5, 5))
    A[0, 1] = A[2, 3] = 1.0
    k, d = part.stiffness, part.damping
    A[1, :4] = np.array([-k, -d - DRAG, k, d]) / INERTIA
    A[3] = np.array([k, d, -k, -d - part.rotor_damping, 1.0]) / part.rotor_inertia
    step = expm(period * A)
    z = np.array([START, 0.0, START, 0.0, 0.0])
    states = [z[:4]]
    for u in commands:
        z = step @ [*z[:4], u]
        states.append(z[:4])
    return np.array(states)


@pytest.mark.parametrize("stiffness", [10.0, 1e3, 1e5])
@pytest.mark.parametrize("other", [(0.0, 1e-3, 0.0), (0.3, 0.1, 0.02)], ids=str)
def test_joint_and_rotor_are_two_masses_and_a_spring(stiffness, other):
    part = ElasticJoint(stiffness, *other)
    fields = {"plant": AXIS, "x0": START, "feedforward": SHAKEN, "duration": 1.0}
    behind, beside = smc.run(
        [
            smc.Scenario(
                law=watch(), actuator=part, sensor=smc.Encoder(**PERFECT, side=side), **fields
            )
            for side in ("link", "motor")
        ]
    )
    assert behind.scenario.resolved.integrator == "RK4"
    expected = two_masses(part, behind.applied[:-1, 0], behind.scenario.control_period)
    assert np.abs(expected[:, 2] - expected[:, 0]).max() > 1.0 / stiffness  # it is bent
    np.testing.assert_allclose(behind.x[:, 0], expected[:, 0], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(beside.s[:, 0], expected[:, 2], rtol=0.0, atol=1e-6)
    np.testing.assert_array_equal(behind.s, behind.x)


def test_a_joint_of_an_arm_bends_where_the_others_move_it():
    """Its rigid model gives M and all other forces; the rotor's equation is written out here."""
    plant = smc.plant_from(ARM, ["shoulder", "elbow"], name="arm")
    part = ElasticJoint(200.0, 0.2, 0.01)
    start = np.array([0.5, -0.4])
    scenario = smc.Scenario(
        plant=plant,
        law="none",
        x0=start,
        feedforward=smc.Constant(1.5),
        u_max=2.0,
        actuator={"elbow": part},
        duration=1.0,
    )
    model = plant.load()
    data = mujoco.MjData(model)

    def rates(t, z):
        q, v, (y, w) = z[:2], z[2:4], z[4:]
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        spring = part.stiffness * (y - q[1]) + part.damping * (w - v[1])
        M = np.zeros((2, 2))
        mujoco.mj_fullM(model, data, M)
        a = np.linalg.solve(M, data.qfrc_passive - data.qfrc_bias + [1.5, spring])
        return [*v, *a, w, (1.5 - spring) / part.rotor_inertia]

    trace = smc.run(scenario)
    z0 = [*start, 0.0, 0.0, start[1], 0.0]
    times = (0.0, trace.t[-1])
    integrated = solve_ivp(rates, times, z0, "DOP853", trace.t, rtol=1e-11, atol=1e-12).y[:2].T
    assert np.abs(integrated - trace.x).max() < 1e-6


@pytest.mark.quick
@pytest.mark.parametrize(
    ("part", "fields"),
    [
        (ElasticJoint(1e9), {}),
        (ElasticJoint(1e3), {"physics_step": 1e-3}),
        (ElasticJoint(1e3, rotor_inertia=1e-9), {}),
        (ElasticJoint(1.0, damping=100.0), {"physics_step": 1e-3}),
    ],
    ids=str,
)
def test_what_a_step_does_not_resolve_is_refused_with_a_step_that_does(part, fields, refused):
    sentence = refused(lambda: smc.Scenario(plant=AXIS, law="none", actuator=part, **fields))
    assert f"stiffness {part.stiffness:g}" in sentence
    period, steps = map(float, sentence.partition("physics_step=")[2].split()[0].split("/"))
    smc.Scenario(plant=AXIS, law="none", actuator=part, physics_step=period / steps)


def test_one_rotor_is_the_same_for_a_spring_and_a_play():
    """A play without gap, and a spring that hardly bends, are a rotor rigid on the joint."""
    rotor = {"rotor_inertia": 0.05, "rotor_damping": 0.1}
    heavy = smc.plant("servo_axis", M=INERTIA + 0.05, b=DRAG + 0.1, cf=0.0, offset=0.0)
    fields = {"law": "none", "feedforward": SHAKEN, "duration": 0.5}
    stiff, play, rigid = smc.run(
        [
            smc.Scenario(plant=AXIS, actuator=ElasticJoint(1e6, 300.0, **rotor), **fields),
            smc.Scenario(plant=AXIS, actuator=smc.Backlash(0.0, **rotor), **fields),
            smc.Scenario(plant=heavy, **fields),
        ]
    )
    assert np.abs(stiff.x - rigid.x).max() < 2e-5
    assert np.abs(play.x - rigid.x).max() < 2e-3


@pytest.mark.parametrize("name", sorted({*smc.plants()} - {"quadrotor"}))
def test_a_rotor_on_a_plant_of_ours_has_no_limit_spring_or_friction_of_its_joints(name):
    soft = ElasticJoint(100.0)
    model = compile_model(smc.Scenario(plant=name, law="none", actuator=soft))
    rotors = soft.rotors(model)
    joints = model.dof_jntid[rotors]
    assert len(rotors) == model.nu
    assert not model.jnt_limited[joints].any()
    assert not model.jnt_actfrclimited[joints].any()
    assert not model.jnt_stiffness[joints].any()
    assert not model.dof_frictionloss[rotors].any()


def test_a_sensor_on_the_motor_side_reads_the_rotor_late_and_by_name():
    """The elbow's rotor is read a skew later than the shoulder, which has no rotor."""
    plant = smc.plant_from(ARM, ["shoulder", "elbow"], name="arm")
    soft = ElasticJoint(5.0, 0.1, 0.01)
    fields = {"plant": plant, "law": watch(), "x0": (0.3, 0.2), "physics_step": 5e-4}
    fields |= {"feedforward": smc.Sine(1.0, 9.0), "duration": 0.4, "u_max": 2.0}
    sensors = [
        smc.Encoder(**PERFECT, side="motor"),
        smc.Encoder(**PERFECT, side="motor", skew=2e-3),
        {"shoulder": smc.Encoder(**PERFECT, side="motor")},
        {"elbow": smc.Encoder(**PERFECT, side="motor", delay=2e-3)},
    ]
    at_once, skewed, by_shoulder, by_elbow = smc.run(
        [smc.Scenario(actuator={"elbow": soft}, sensor=sensor, **fields) for sensor in sensors]
    )
    np.testing.assert_array_equal(at_once.s[:, 0], at_once.x[:, 0])
    assert np.abs(at_once.s[:, 1] - at_once.x[:, 1]).max() > 0.05
    np.testing.assert_array_equal(by_shoulder.s, by_shoulder.x)
    for late in (skewed, by_elbow):
        np.testing.assert_array_equal(late.s[:, 0], late.x[:, 0])
        np.testing.assert_array_equal(late.s[2:, 1], at_once.s[:-2, 1])


def test_friction_on_the_motor_side_is_on_the_rotor():
    fields = {"plant": AXIS, "x0": START, "feedforward": SHAKEN, "duration": 0.5}
    fields |= {"law": watch(), "sensor": smc.Encoder(**PERFECT, side="motor")}
    fields |= {"integrator": "implicitfast", "physics_step": 2e-4}
    soft = {"stiffness": 50.0, "rotor_inertia": 0.02}
    part, built_in, held = smc.run(
        [
            smc.Scenario(
                actuator=ElasticJoint(**soft), friction=smc.Viscous(0.4, side="motor"), **fields
            ),
            smc.Scenario(actuator=ElasticJoint(**soft, rotor_damping=0.4), **fields),
            smc.Scenario(
                actuator={"slide": ElasticJoint(**soft)},
                friction={"slide": smc.Coulomb(30.0, side="motor")},
                **fields | {"v0": 0.5, "feedforward": smc.Constant(3.0)},
            ),
        ]
    )
    np.testing.assert_array_equal(part.x, built_in.x)
    np.testing.assert_array_equal(part.s, built_in.s)
    assert not part.reaction.any()
    # the rotor sticks, and the joint swings on its spring; the first sample is before it stopped
    assert np.ptp(held.s[1:]) < 1e-5
    crossings = np.flatnonzero(np.diff(np.sign(held.v[:, 0]))) * held.scenario.control_period
    period = 2.0 * np.diff(crossings).mean()
    assert period == pytest.approx(math.tau * math.sqrt(INERTIA / 50.0), rel=0.01)


@smc.hardware.friction_function(numbers={"share": 0.1})
def of_load(y, p, memory):
    return p.share * y.load


def test_the_load_of_a_friction_is_what_neither_drive_nor_spring_exerts():
    trace = smc.run(
        smc.Scenario(
            plant=AXIS,
            law="none",
            x0=START,
            feedforward=SHAKEN,
            disturbance=smc.Constant(2.0),
            actuator=ElasticJoint(300.0),
            friction=of_load(),
            duration=0.3,
        )
    )
    np.testing.assert_allclose(trace.reaction[1:], -0.2, rtol=1e-9)  # it resists


@pytest.mark.parametrize(
    ("friction", "actuator"),
    [
        (smc.Coulomb(0.1, side="motor"), None),
        (smc.Coulomb(0.1, side="motor"), smc.Lag(0.01)),
        ({"hinge": smc.Viscous(0.1, side="motor")}, ElasticJoint(500.0)),
    ],
    ids=str,
)
def test_the_motor_side_of_a_rigid_joint_takes_no_friction(friction, actuator, refused):
    refused(
        lambda: smc.Scenario(plant="cart_pole", law="none", friction=friction, actuator=actuator),
        "side 'motor'",
    )


def test_a_formula_is_on_the_joint(refused):
    refused(lambda: smc.hardware.Sigmoid(0.4, 50.0, side="motor"), "Sigmoid", "'motor'")


OWN = """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="a" axis="0 1 0"/>
<geom size="0.01" pos="0.2 0 0" mass="{:g}"/></body></worldbody>
<actuator><motor joint="a" ctrllimited="true" ctrlrange="-{:g} {:g}"/></actuator></mujoco>"""


@pytest.mark.parametrize(("mass", "limit"), [(1.0, 2.0), (1.0, 8.0), (1e-4, 8e-4), (500.0, 40.0)])
def test_the_condition_has_a_resonance_beside_what_the_motor_can_do(mass, limit):
    plant = smc.plant_from(OWN.format(mass, limit, limit), ["a"], name="own")
    part = NAMED["elastic"].on(plant, 1.0)["actuator"]
    inertia = mass * (0.2**2 + 0.4 * 0.01**2)
    assert part.rotor_inertia == pytest.approx(0.5 * inertia, rel=0.01)
    resonance = math.sqrt(part.stiffness * (1.0 / inertia + 1.0 / part.rotor_inertia))
    assert resonance == pytest.approx(43.6 * math.sqrt(limit / inertia / 0.3), rel=0.01)
    decay = part.damping * (1.0 / inertia + 1.0 / part.rotor_inertia) / 2.0
    assert decay == pytest.approx(0.01 * resonance, rel=0.02)


def test_the_conditions_differ_in_what_the_controller_reads_alone():
    pendulum = smc.plant("inverted_pendulum")
    link, motor = (NAMED[name].on(pendulum, 1.0) for name in ("elastic", "motor_side"))
    assert motor.pop("sensor") == smc.Encoder(math.inf, side="motor")
    assert motor.pop("velocity").name == "measured"
    assert link == motor
    k, J, rotor = link["actuator"].stiffness, 0.125, link["actuator"].rotor_inertia
    assert math.sqrt(k * (1.0 / J + 1.0 / rotor)) / math.tau == pytest.approx(68.0, rel=0.01)


FREE_HINGE = """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="j" axis="0 0 1"/>
<geom type="box" size=".1 .1 .1" mass="3" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor joint="j" ctrlrange="-10 10"/></actuator></mujoco>"""
OF_BOTH = 3.0 * 2.0 * 0.2**2 / 12.0 + 0.01  # kg m^2, with the rotor


@smc.law_function(gains={"u": 1.0})
def pushed(y, gains, memory):
    return gains.u, y.e


@pytest.mark.parametrize(
    "part",
    [smc.hardware.ElasticJoint(500.0, 0.5, 0.01), smc.Backlash(0.01, rotor_inertia=0.01)],
    ids=["spring", "play"],
)
def test_friction_of_one_kind_acts_on_both_sides(part):
    """Closed forms of both bodies together; it was refused as one friction given twice."""
    fields = {
        "plant": smc.plant_from(FREE_HINGE, ["j"]),
        "actuator": part,
        "x0": 0.0,
        "duration": 2.0,
    }

    def end(u, *friction):
        return smc.run(smc.Scenario(law=pushed(u=u), friction=friction, **fields)).v[-1, 0]

    assert end(0.5, smc.Viscous(0.4), smc.Viscous(0.6, side="motor")) == pytest.approx(0.5)
    dry = smc.Coulomb(0.2, side="motor"), smc.Coulomb(0.1)
    assert end(0.5, *dry) == pytest.approx(0.2 / OF_BOTH * 2.0, rel=0.01)
    assert abs(end(0.29, *dry)) < 1e-6
    assert end(0.31, *dry) > 0.5


def test_two_frictions_of_one_kind_on_one_side_are_refused(refused):
    fields = {"plant": "inverted_pendulum", "law": "pid", "actuator": smc.Backlash(0.01)}
    twice = smc.Coulomb(0.1, side="motor"), smc.Coulomb(0.2, side="motor")
    refused(lambda: smc.Scenario(friction=twice, **fields), "give one of them")
