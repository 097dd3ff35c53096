"""Frictions are what they say: they hold below their level, let go above it, and dissipate what the
formulas say.
"""

import dataclasses
import math

import mujoco
import numpy as np
import pytest
from helpers.models import build

import smc_mujoco as smc
from smc_mujoco.mechanisms.hardware.friction import Coulomb, LuGre, Viscous
from smc_mujoco.mechanisms.plant import field_array, plant

IMPLICIT = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
RK4 = mujoco.mjtIntegrator.mjINT_RK4
INERTIA = {"inverted_pendulum": 0.125, "duffing": 1.0}  # kg m^2, kg
PLANTS = pytest.mark.parametrize("name", sorted(INERTIA))
STEPS = pytest.mark.parametrize(
    ("h", "integrator"),
    [
        (2.5e-4, IMPLICIT),
        (1e-3, RK4),
    ],
    ids=["implicitfast", "RK4"],
)
BRISTLES = pytest.mark.parametrize("h", [2.5e-4, 1e-3])
LUGRE = LuGre(
    coulomb=0.05,
    static=0.08,
    stribeck=0.01,
)


def bare(name, *parts, h=2.5e-4, integrator=IMPLICIT):
    """The plant's inertia with nothing on it but the parts: without the plant's weight, spring and
    damping.
    """
    model = build(
        plant(name),
        *parts,
        h=h,
        integrator=integrator,
    )
    model.dof_damping[:] -= build(plant(name)).dof_damping
    for field in ("opt.gravity", "jnt_stiffness", "jnt_stiffnesspoly"):
        field_array(model, field)[:] = 0.0
    return model


def held(model, level, ramp, seconds):
    """The state after a force that rises to `level` within `ramp` seconds and stays."""
    data = mujoco.MjData(model)
    while data.time < seconds:
        data.ctrl[:] = level * min(1.0, data.time / ramp)
        mujoco.mj_step(model, data)
    return data


def coasting(model, v0, seconds):
    """(position, speed) after every step from a start at v0, (k, 2)."""
    data = mujoco.MjData(model)
    data.qvel[0] = v0
    states = [(0.0, v0)]
    while data.time < seconds:
        mujoco.mj_step(model, data)
        states.append((data.qpos[0], data.qvel[0]))
    return np.array(states)


@pytest.mark.quick
@PLANTS
@STEPS
def test_a_joint_stuck_by_coulomb_friction_does_not_creep(name, h, integrator):
    level = 0.05 if integrator == RK4 else 1.0
    model = bare(
        name,
        Coulomb(level),
        h=h,
        integrator=integrator,
    )
    for share in (0.5, -0.9, 0.99):
        data = held(model, share * level, 1e-9, 0.5)
        creep = 1e-4 * h * abs(share) * level / INERTIA[name]
        assert abs(data.qvel[0]) == pytest.approx(creep, rel=0.02)
        assert abs(data.qvel[0]) < 1e-4  # of 1 rad/s or 1 m/s


@PLANTS
@STEPS
def test_coulomb_friction_lets_go_just_above_its_level(name, h, integrator):
    model = bare(
        name,
        Coulomb(1.0),
        h=h,
        integrator=integrator,
    )
    data = held(model, 1.01, 1e-9, 0.5)
    assert data.qvel[0] == pytest.approx(0.01 / INERTIA[name] * 0.5, rel=0.01)


@PLANTS
@STEPS
def test_a_block_slides_v0_squared_over_twice_its_deceleration(name, h, integrator):
    level = 0.05 if integrator == RK4 else 1.0
    deceleration = level / INERTIA[name]
    states = coasting(
        bare(
            name,
            Coulomb(level),
            h=h,
            integrator=integrator,
        ),
        1.0,
        1.1 / deceleration,
    )
    assert states[-1, 0] == pytest.approx(1.0 / (2 * deceleration), rel=0.01)
    sliding = states[: int(0.9 / deceleration / h), 1]
    assert -np.diff(sliding) == pytest.approx(deceleration * h, rel=0.01)


@PLANTS
def test_viscous_friction_decays_as_exp_minus_b_t_over_inertia(name):
    states = coasting(bare(name, Viscous(0.1)), 1.0, 1.0)
    assert states[-1, 1] == pytest.approx(math.exp(-0.1 / INERTIA[name]), rel=1e-3)


@PLANTS
@BRISTLES
def test_a_joint_stuck_by_lugre_stands(name, h):
    data = held(bare(name, LUGRE, h=h), 0.9 * LUGRE.static, 1.0, 10.0)
    assert abs(data.qvel[0]) < 1e-6
    assert abs(data.qpos[0]) < 10 * LUGRE.static / LUGRE.stiffness


@pytest.mark.parametrize(
    ("h", "part"),
    [
        (2.5e-4, LUGRE),
        (1e-3, LuGre(0.5, 0.8, 0.05)),
        (1e-3, LuGre(0.05, 0.05, 0.01)),
    ],
)
def test_lugre_breaks_away_at_its_static_level(h, part):
    model = bare(min(INERTIA), part, h=h)
    data = mujoco.MjData(model)
    friction = model.actuator(f"passive:{model.joint(0).name}").id
    most = 0.0
    speed = 0.0
    while data.time < 21.0:  # a ramp of static / 20 a second
        data.ctrl[0] = part.static * data.time / 20.0
        mujoco.mj_step(model, data)
        most = max(most, -data.actuator_force[friction])
        speed = data.qvel[0]
    assert most == pytest.approx(part.static, rel=0.02)
    # it slides, far faster than bristles bend
    assert speed > 10 * part.static / 20.0 / part.stiffness


@PLANTS
@pytest.mark.parametrize("v0", [3.0, -3.0])
def test_lugre_slides_at_its_coulomb_level(name, v0):
    h = 2.5e-4
    v = np.abs(coasting(bare(name, LUGRE, h=h), v0, 0.3)[:, 1])
    deceleration = LUGRE.coulomb / INERTIA[name]
    assert (v[200] - v[-1]) / (h * (len(v) - 201)) == pytest.approx(deceleration, rel=0.01)


def test_lugre_is_the_formula_of_its_docstring():
    for v in (-2.0, -0.02, 0.003, 0.0, 0.01, 1.0):
        model = bare("duffing", LUGRE)
        data = mujoco.MjData(model)
        data.qvel[0] = v
        data.act[0] = 4e-5
        mujoco.mj_forward(model, data)
        g = LUGRE.coulomb + (LUGRE.static - LUGRE.coulomb) * math.exp(-((v / LUGRE.stribeck) ** 2))
        rate = v - LUGRE.stiffness * abs(v) / g * 4e-5
        damping = 0.2 * math.sqrt(LUGRE.stiffness * 1.0)  # of the cart of 1 kg
        assert data.qfrc_actuator[0] == pytest.approx(
            -(LUGRE.stiffness * 4e-5 + damping * rate), rel=1e-9
        )


SHAFT = """<mujoco model="shaft"><option gravity="0 0 0"/><worldbody><body><joint name="j" axis="0 0 1"
armature=".35"/><geom size=".01" mass="1e-6" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor joint="j" ctrlrange="-40 40"/></actuator></mujoco>"""


def test_a_joint_on_bristles_sticks_as_long_as_one_on_dry_friction_with_a_stribeck_drop():
    kp, kd, coulomb, static, stribeck, rate = 30.0, 0.8, 0.65, 2.8, 0.12, 0.05
    run = smc.Scenario(
        plant=smc.plant_from(SHAFT, ["j"]),
        law=smc.law("pid", kp=kp, ki=0.0, kd=kd),
        reference=smc.signals.Ramp(rate),
        friction=smc.hardware.LuGre(coulomb, static, stribeck),
        duration=9.0,
    )
    trace = smc.run(run)
    x, v, stuck, h = 0.0, 0.0, 0.0, 1e-4  # the same, event-driven and set-valued
    for k in range(round(run.duration / h)):
        u = kp * (rate * k * h - x) + kd * (rate - v)
        if v == 0.0 and abs(u) <= static:
            stuck += h
            continue
        rubs = coulomb + (static - coulomb) * math.exp(-((v / stribeck) ** 2))
        new = v + h * (u - math.copysign(rubs, v or u)) / 0.35
        v = 0.0 if new * v < 0.0 else new
        x += h * v
    assert 0.6 * run.duration < stuck < 0.95 * run.duration
    assert smc.score(trace)["stick_time"] == pytest.approx(stuck, rel=0.05)
    slides = dataclasses.replace(run, reference=smc.signals.Ramp(0.5), duration=2.0)
    assert smc.score(smc.run(slides))["stick_time"] < 0.3 * slides.duration
