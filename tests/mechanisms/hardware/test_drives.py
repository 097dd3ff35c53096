"""Actuators deliver what their equations say: a DC motor does; and play is play.

Lags: see test_drive_step.
"""

import math

import mujoco
import numpy as np
import pytest
from helpers.models import build
from helpers.python_controller import Controller

import smc_mujoco as smc
from smc_mujoco.mechanisms.hardware.backlash import Backlash
from smc_mujoco.mechanisms.hardware.drives import DCMotor
from smc_mujoco.mechanisms.hardware.friction import LuGre
from smc_mujoco.mechanisms.layout import ROTOR, drive_ids
from smc_mujoco.mechanisms.plant import field_array, plant

H = 2.5e-4  # s
RK4 = mujoco.mjtIntegrator.mjINT_RK4
NAMES = pytest.mark.parametrize(
    "name", ["duffing", "inverted_pendulum", "pendulum_network", "panda"]
)
MOTOR = DCMotor()


def bare(*parts, name="duffing", h=H):
    """The plant's inertia, 1 kg or 0.125 kg m^2, with nothing on it but the parts."""
    model = build(plant(name), *parts, h=h)
    for field in ("opt.gravity", "jnt_stiffness", "jnt_stiffnesspoly", "dof_damping"):
        field_array(model, field)[:] = 0.0
    return model


def home(model):
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    return data


def driven(model, command, seconds, data=None):
    """Rows (t, position, speed, force, ...activations) at the ends of steps under ctrl =
    command(t).
    """
    data = mujoco.MjData(model) if data is None else data
    rows = []
    for _ in range(round(seconds / model.opt.timestep)):
        data.ctrl[:] = command(data.time)
        mujoco.mj_step(model, data)
        rows.append((data.time, data.qpos[0], data.qvel[0], data.actuator_force[0], *data.act))
    return np.array(rows)


def locked(part):
    model = bare(part)
    model.dof_armature[0] = 1e12
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def sine(t):
    return 2.0 * math.sin(5.0 * t)


@pytest.mark.quick
def test_a_locked_rotors_torque_comes_at_once_without_inductance():
    motor = DCMotor(inductance=0.0)
    assert driven(locked(motor), lambda t: 4.0 * motor.scale, 0.01)[:, 3] == pytest.approx(
        4.0, rel=1e-9
    )


def test_cogging_is_a_sine_of_the_rotors_angle():
    motor = DCMotor(cogging=5e-3, poles=14.0)
    model = locked(motor)
    data = mujoco.MjData(model)
    for x in np.linspace(-0.1, 0.1, 41):
        data.qpos[0] = x
        mujoco.mj_forward(model, data)
        expected = motor.gear * 5e-3 * math.sin(14.0 * motor.gear * x)
        assert data.actuator_force[0] == pytest.approx(expected, abs=1e-12)


@NAMES
def test_the_rotors_inertia_is_reflected_to_the_joint(name):
    with_motor = build(plant(name), MOTOR)
    own = build(plant(name))
    reflected = MOTOR.gear**2 * MOTOR.rotor_inertia
    assert with_motor.dof_armature == pytest.approx(own.dof_armature + reflected, rel=1e-12)
    # mj_setConst saw it
    assert with_motor.dof_M0 == pytest.approx(own.dof_M0 + reflected, rel=1e-9)


@NAMES
def test_the_joint_is_free_within_the_play_and_driven_beyond(name):
    model = build(plant(name), Backlash(0.02))
    data = home(model)
    own = home(build(plant(name)))
    n = own.qpos.size
    rotors = []
    for i in range(n):
        rotors.append(model.joint(ROTOR + model.joint(i).name).qposadr[0])
    assert data.qpos[rotors] == pytest.approx(own.qpos)  # the rotor starts in the middle
    idle = build(plant(name))
    while np.abs(data.qpos[rotors] - data.qpos[:n]).max() < 0.0099:
        data.ctrl[:] = 0.1
        mujoco.mj_step(model, data)
        mujoco.mj_step(idle, own)
        assert data.qpos[:n] == pytest.approx(own.qpos, abs=1e-9)
    for k in range(8000):
        data.ctrl[:] = 3.0 if k // 400 % 2 else -3.0
        mujoco.mj_step(model, data)
        speed = np.abs(data.qvel[rotors] - data.qvel[:n]).max()
        assert np.abs(data.qpos[rotors] - data.qpos[:n]).max() < 0.01 + 2e-5 + 2 * H * max(
            speed, 10.0
        )


@NAMES
@pytest.mark.parametrize("order", [1, -1])
def test_play_comes_after_any_drive(name, order):
    for drive in (DCMotor(inductance=0.0), MOTOR):
        parts = (LuGre(0.05, 0.08, 0.01), *(drive, Backlash(0.02, 1e-3))[::order])
        model = build(plant(name), *parts, h=1.25e-4)
        n = len(drive_ids(model))
        assert [model.joint(model.actuator_trnid[i, 0]).name[:6] for i in drive_ids(model)] == [
            "rotor:"
        ] * n
        own = MOTOR.gear**2 * MOTOR.rotor_inertia
        assert model.dof_armature[n:] == pytest.approx(1e-3 + own)
        assert (model.dof_armature[:n] == 0.0).all()
        data = home(model)
        rows = driven(model, lambda t, drive=drive: drive.scale * sine(t), 0.5, data)
        assert np.isfinite(rows).all()
        assert not data.warning.number.any()
        rotors = []
        for i in range(n):
            rotors.append(model.joint(ROTOR + model.joint(i).name).qposadr[0])
        assert np.abs(data.qpos[rotors] - data.qpos[:n]).max() < 0.0105


@pytest.mark.parametrize("name", ["duffing", "furuta"])
def test_the_nominal_model_per_volt_is_what_the_joints_do(name):
    """x'' = f + g u for u in V, of the driven channel and of the one that it moves, without
    inductance.
    """
    kind = plant(name)
    motor = DCMotor(
        0.5,
        0.0,
        0.05,
        2.0,
        0.0,
        voltage=10.0,
        command="voltage",
    )
    assert motor.stall == pytest.approx(10.0 / 0.5 * 0.05 * 2.0)
    scenario = smc.Scenario(
        plant=kind,
        law="none",
        actuator=motor,
    )
    model = build(kind, motor)
    rng = np.random.default_rng(1)
    data = mujoco.MjData(model)
    for _ in range(20):
        x = rng.uniform(-1, 1, kind.n)
        v = rng.uniform(-3, 3, kind.n)
        u = rng.uniform(-9, 9)
        data.qpos[:] = x
        data.qvel[:] = v
        data.ctrl[:] = u
        mujoco.mj_forward(model, data)
        for i in range(kind.n):
            f, g = Controller(scenario).model_at(x, v, i, 0)
            assert data.qacc[i] == pytest.approx(f + g * u, rel=1e-9, abs=1e-9)


def test_a_motor_without_inductance_has_no_state_and_rk4_integrates_it():
    """A carriage on a constant voltage, in closed form: implicitfast leads by half a step times its
    speed.
    """
    motor = DCMotor(
        0.5,
        0.0,
        0.05,
        20.0,
        0.0,
        voltage=10.0,
        command="voltage",
    )
    mass = 2.0
    drag = motor.constant**2 / motor.resistance
    fields = {
        "actuator": motor,
        "feedforward": smc.Constant(5.0),
        "duration": 1.0,
        "control_period": 1e-3,
        "x0": 0.0,
    }
    axis = smc.plant(
        "servo_axis",
        M=mass,
        b=0.0,
        cf=0.0,
        offset=0.0,
    )
    trace = smc.run(
        smc.Scenario(
            plant=axis,
            law="none",
            integrator="RK4",
            physics_step=1e-3,
            sensor=None,
            **fields,
        )
    )
    speed = 5.0 * motor.constant / motor.resistance / drag
    lag = mass / drag
    exact = speed * (trace.t - lag * (1.0 - np.exp(-trace.t / lag)))
    np.testing.assert_allclose(trace.x[:, 0], exact, atol=1e-8)
