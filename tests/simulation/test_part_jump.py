"""A jump of numbers of parts against equations that are solved by hand, and against MuJoCo alone."""

import dataclasses
import math

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.engine import group
from smc_mujoco.simulation import model as models

BLOCK = """<mujoco><worldbody><body><joint name="j" type="slide" axis="1 0 0"/>
<geom type="box" size=".1 .1 .1" mass="2" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor joint="j"/></actuator></mujoco>"""
AT = 0.4  # s


def block(factors, **fields):
    """A run of a block of 2 kg under a constant u, with a jump at AT."""
    plant = smc.plant_from(BLOCK, ["j"], name="block")
    common = {"plant": plant, "law": "none", "u_max": 50.0, "duration": 0.8}
    return smc.Scenario(**common, jump=smc.Jump(AT, factors), **fields)


def relaxed(t, v0, limit, rate):
    """Speed and way at t of v' = rate (limit - v), from v0."""
    decay = np.exp(-rate * t)
    return limit + (v0 - limit) * decay, limit * t + (v0 - limit) * (1.0 - decay) / rate


def in_two_parts(t, first, second):
    """Position of a block that relaxes to `first`, (limit, rate), and from AT on to `second`."""
    v1, x1 = relaxed(AT, 0.0, *first)
    before = relaxed(t, 0.0, *first)[1]
    return np.where(t < AT, before, x1 + relaxed(t - AT, v1, *second)[1])


@pytest.mark.quick
def test_dry_and_viscous_friction_of_a_sliding_block():
    frictions = smc.Coulomb(1.0), smc.Viscous(2.0)
    factors = {"friction.level": 2.5, "friction.b": 0.5}
    trace = smc.run(block(factors, friction=frictions, feedforward=smc.Constant(6.0)))
    exact = in_two_parts(trace.t, (5.0 / 2.0, 1.0), (3.5 / 1.0, 0.5))
    np.testing.assert_allclose(trace.x[:, 0], exact, atol=1e-9)
    # the trace's friction, too: dry friction and damping
    later = int(0.6 / trace.scenario.control_period)
    speed = np.diff(trace.x[later - 1 : later + 1, 0]) / trace.scenario.control_period
    assert trace.reaction[later, 0] == pytest.approx(-2.5 - 1.0 * speed[0], abs=1e-6)


def test_a_jump_that_takes_all_damping_away():
    fields = {"friction": smc.Viscous(2.0), "feedforward": smc.Constant(6.0)}
    trace = smc.run(block({"friction.b": 0.0}, **fields))
    jump = trace.scenario.jump_sample
    assert trace.damping is not None
    assert trace.damping[jump, 0] < 0.0
    assert not trace.damping[jump + 1 :].any()


def test_the_resistance_of_a_motor():
    """m v' = k (V - k v) / R, with k = 4 N/A."""
    motor = smc.DCMotor(2.0, 0.0, 0.4, 10.0, 0.0, current=math.inf, command="voltage")
    fields = {"actuator": motor, "feedforward": smc.Constant(5.0)}
    trace = smc.run(block({"actuator.resistance": 2.0}, **fields))
    exact = in_two_parts(trace.t, (5.0 / 4.0, 16.0 / 4.0), (5.0 / 4.0, 16.0 / 8.0))
    np.testing.assert_allclose(trace.x[:, 0], exact, atol=1e-9)


def test_a_friction_that_grows_with_the_torque_of_such_a_motor():
    """m v' = (1 - km) k (V - k v) / R - kc."""
    motor = smc.DCMotor(2.0, 0.0, 0.4, 10.0, 0.0, current=math.inf, command="voltage")
    friction = smc.hardware.ServoFriction(kc=1.0, km=0.2, ke=0.2)
    fields = {"actuator": motor, "friction": friction, "feedforward": smc.Constant(5.0)}
    trace = smc.run(block({"actuator.resistance": 2.0}, **fields))
    assert trace.scenario.exact_friction

    def motion(R):
        return 5.0 / 4.0 - R / (0.8 * 16.0), 0.8 * 16.0 / R / 2.0

    exact = in_two_parts(trace.t, motion(2.0), motion(4.0))
    np.testing.assert_allclose(trace.x[:, 0], exact, atol=1e-6)


def test_the_time_constant_of_a_lag_and_the_zero_of_an_encoder():
    fields = {"actuator": smc.Lag(0.1), "feedforward": smc.Constant(4.0)}
    trace = smc.run(block({"actuator.tau": 3.0}, **fields))
    # acceleration 2 (1 - exp(-t/tau)): its force goes on from what it was
    force = 4.0 * (1.0 - math.exp(-AT / 0.1))
    missing = (4.0 - force) * np.exp(-(trace.t - AT) / 0.3)
    expected = np.where(trace.t < AT, 4.0 * (1.0 - np.exp(-trace.t / 0.1)), 4.0 - missing)
    middle = 0.5 * (expected[1:] + expected[:-1])
    np.testing.assert_allclose(trace.force[1:, 0], middle, atol=1e-3)
    law = smc.law("pid", kp=10.0, ki=0.0, kd=0.0)
    encoder = smc.Encoder(math.inf, bias=0.01)
    s = dataclasses.replace(block({"sensor.bias": 5.0}, sensor=encoder), law=law)
    trace = smc.run(s)
    sample = s.jump_sample
    read = -trace.u[:, 0] / 10.0 - trace.x[:, 0]  # r is 0
    np.testing.assert_allclose(read[:sample], 0.01, atol=1e-9)
    np.testing.assert_allclose(read[sample:], 0.05, atol=1e-9)


@pytest.mark.parametrize("plant", ["inverted_pendulum", "cart_pole"])
def test_a_formula_is_that_of_a_friction_which_reads_the_time(plant):
    """At the stages of RK4 on one joint, and by MuJoCo's solver on joints that move together."""

    def level(y, p, memory):
        level = p.coulomb
        if y.t >= AT - 1e-9:
            level *= p.factor
        return level + (0.3 - level) * math.exp(-((y.v / 0.1) ** 2))

    own = smc.hardware.friction_function(numbers={"coulomb": 0.1, "factor": 1.0})(level)
    common = {"plant": plant, "law": "none", "feedforward": smc.Sine(2.0, 5.0), "duration": 0.8}
    jump = smc.Jump(AT, {"friction.coulomb": 2.0})
    jumps = smc.run(smc.Scenario(**common, friction=own(0.1), jump=jump))
    reads = smc.run(smc.Scenario(**common, friction=own(0.1, 2.0)))
    np.testing.assert_allclose(jumps.x, reads.x, atol=1e-12)
    stays = smc.run(smc.Scenario(**common, friction=own(0.1)))
    sample = jumps.scenario.jump_sample
    np.testing.assert_array_equal(jumps.x[: sample + 1], stays.x[: sample + 1])
    assert np.abs(jumps.x - stays.x).max() > 1e-3


def test_bristles_against_mujoco_alone():
    bristles = smc.hardware.LuGre(1.0, 1.5, 0.1, stiffness=500.0, damping=20.0)
    factors = {"friction.coulomb": 0.5, "friction.static": 0.4, "friction.stiffness": 2.0}
    s = block(factors, friction=bristles, feedforward=smc.Constant(1.3))
    trace = smc.run(s)
    model = models.compile_model(s)
    models.put_values(model, model, s, 0)
    data = mujoco.MjData(model)
    places = []
    for step in range(round(s.duration / model.opt.timestep)):
        if step == round(AT / model.opt.timestep):
            model.actuator_dynprm[1, 5] = 1000.0
            model.actuator_biasprm[1, 3:5] = 0.5, 0.6
        if step % s.steps == 0:
            places.append(data.qpos[0])
        data.ctrl[0] = 1.3
        mujoco.mj_step(model, data)
    np.testing.assert_allclose(trace.x[:-1, 0], places, atol=1e-12)
    # it holds up to the jump, and slides soon after it
    assert smc.score(trace, ["stick_time"])["stick_time"] == pytest.approx(AT, abs=0.1)


def test_the_fast_engine_leaves_it_to_mujoco():
    fields = {"friction": smc.Coulomb(0.2), "duration": 0.2, "control_period": 2e-3}
    s = smc.Scenario(plant="inverted_pendulum", law=smc.law("pid"), **fields)
    assert not group.why_not(s)
    jumps = dataclasses.replace(s, jump=smc.Jump(0.1, {"friction.level": 3.0}))
    assert "numbers of its parts jump" in group.why_not(jumps)


def test_what_cannot_jump_is_refused(refused):
    two = smc.Coulomb(0.1), smc.hardware.Stribeck(0.1)

    def pendulum(path, factor=2.0, **fields):
        jump = smc.Jump(0.1, {path: factor})
        return smc.Scenario(plant="duffing", law="pid", duration=0.2, jump=jump, **fields)

    refused(lambda: pendulum("friction.level"), "friction.level")
    refused(lambda: pendulum("friction.statik", friction=two), "friction.statik", "friction.static")
    refused(lambda: pendulum("friction.level", -1.0, friction=two), "Coulomb", "level", "-0.1")
    wave = smc.Sine(1.0, 2.0)
    refused(lambda: pendulum("disturbance.amplitude", disturbance=wave), "disturbance", "Held")
    refused(lambda: smc.run(pendulum("actuator.tau", 0.0, actuator=smc.Lag(0.1))), "tau", "1e-9")
    late = smc.Encoder(delay=0.01)
    refused(lambda: smc.run(pendulum("sensor.delay", sensor=late)), "sensor.delay")
    on_both_joints = {"plant": "double_pendulum", "law": "pid", "friction": smc.Coulomb(0.1)}
    jump = smc.Jump(0.1, {"friction.shoulder.level": 2.0})
    refused(lambda: smc.Scenario(**on_both_joints, jump=jump), "2 joints", "friction.level")
