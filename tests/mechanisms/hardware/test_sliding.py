"""Frictions by a formula: exact while a joint slides, holding at rest, the same in both loops;
servos under load.
"""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import reference
from helpers.runs import assert_same, free_mass

import smc_mujoco as smc
from smc_mujoco.control.units import Gain
from smc_mujoco.control.written import state_feedback
from smc_mujoco.mechanisms.hardware.servos import SERVOS
from smc_mujoco.mechanisms.hardware.sliding import Sliding

# Gaz et al. 2019, table of the Panda's friction: N m, s/rad, rad/s
P1 = np.array([0.54615, 0.87224, 0.64068, 1.2794, 0.83904, 0.30301, 0.56489])
P2 = np.array([5.1181, 9.0657, 10.136, 5.5903, 8.3469, 17.133, 10.336])
P3 = np.array([0.0395, 0.0259, -0.0461, 0.0362, 0.0262, -0.0210, 0.0036])


def sigmoid(v, p1, p2, p3):
    """The published formula, by the identity 1/(1 + exp(-a)) = (1 + tanh(a/2))/2."""
    return p1 / 2 * (np.tanh(p2 * (v + p3) / 2) - np.tanh(p2 * p3 / 2))


def flywheel(mass, v0, **fields):
    """A run of a cart of that mass, without a spring, from the speed v0."""
    plant = free_mass(mass)
    return smc.run(
        smc.Scenario(
            **{
                "plant": plant,
                "law": "none",
                "x0": 0.0,
                "v0": v0,
                "duration": 0.05,
            }
            | fields
        )
    )


def weightless(**fields):
    """The Panda without gravity and law, from rest."""
    common = {
        "plant": smc.plant("panda", grav=0.0),
        "law": "none",
        "duration": 2.0,
        "control_period": 2e-3,
    }
    return smc.Scenario(**common | fields)


# a joint that slides


@pytest.mark.quick
@pytest.mark.parametrize("i", range(7))
def test_friction_at_constant_speed_is_the_published_sigmoid(i):
    """At 2 mrad/s to 10 rad/s, both ways: a flywheel of 1e12 kg keeps its speed to 1e-13."""
    for v in (*np.geomspace(2e-3, 10.0, 4), *-np.geomspace(2e-3, 10.0, 4)):
        trace = flywheel(1e12, v, friction=smc.hardware.Sigmoid(P1[i], P2[i], P3[i]))
        assert trace.v[-1, 0] == pytest.approx(v, rel=1e-11)
        np.testing.assert_allclose(
            trace.reaction[1:, 0], -sigmoid(v, P1[i], P2[i], P3[i]), rtol=0, atol=1e-9
        )


def test_the_pandas_friction_is_the_published_one_in_a_thousand_states():
    """Along five runs of 200 physics steps, at each of which the friction is logged; joints that
    turn do not stick.
    """
    rng = np.random.default_rng(3)
    friction = dataclasses.replace(smc.plant("panda").friction, hold=0.0)
    steps = {
        "control_period": 1e-3,
        "physics_step": 1e-3,
        "duration": 0.2,
        "friction": friction,
    }
    traces = smc.run([weightless(v0=rng.uniform(-1.5, 1.5, 7), **steps) for _ in range(5)])
    for trace in traces:
        np.testing.assert_allclose(
            trace.reaction[1:], -sigmoid(trace.v[:-1], P1, P2, P3), rtol=0, atol=1e-12
        )
    assert np.ptp([trace.v for trace in traces]) > 2.0


# a joint at rest


def grows(level):
    """A load that grows within 0.5 s, and stays."""
    return smc.signals.TimeSeries([0.0, 0.5, 10.0], [0.0, level, level])


def limits(i):
    """F(-inf) and F(inf) of joint i."""
    return sigmoid(-1e9, P1[i], P2[i], P3[i]), sigmoid(1e9, P1[i], P2[i], P3[i])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_joints_at_rest_hold_every_load_below_their_limits_and_no_other(sign):
    """On the arm without weight, under a load that grows to 90 % or 110 % of its joints' least
    limit, and stays.
    """
    least = min(abs(limits(i)[int(sign > 0.0)]) for i in range(7))
    stay, go = (
        weightless(
            friction=smc.plant("panda").friction,
            disturbance=grows(sign * share * least),
        )
        for share in (0.9, 1.1)
    )
    held, slid = smc.run([stay, go])
    assert np.abs(held.v[-1]).max() < 1e-6
    assert np.abs(held.x[-1] - held.x[-250]).max() < 1e-6
    np.testing.assert_allclose(held.reaction[-1], -sign * 0.9 * least, rtol=1e-6)
    assert np.abs(slid.v[-1]).max() > 0.1


@smc.law_function(
    joint=True,
    gains={"torque": 0.0, "rise": Gain(1e-9, shared=True)},
)
def pulls(y, gains, memory):
    """Constant torques, after a rise."""
    return gains.torque * min(y.t / gains.rise, 1.0), y.e


@pytest.mark.parametrize("rise", [1e-9, 0.5])
def test_joints_that_move_together_hold_a_load_below_their_limits_however_sudden(rise):
    """The load is that mode of M w = L D w, with D the joints' own inertias, which has the largest
    L: bristles on each joint of its own give way to it by 1.4 times the load.
    """
    panda = smc.plant("panda", grav=0.0)
    M = panda.nominal.dynamics(np.array(panda.rest), np.zeros(7), panda.values({})).M
    roots = np.sqrt(panda.load().dof_M0[:7])
    load = roots * np.linalg.eigh(M / np.outer(roots, roots))[1][:, -1]
    holds = np.array([limits(i)[int(push > 0.0)] for i, push in enumerate(load)])
    load = load / (load / holds).max()  # one joint is at its limit
    runs = []
    for share in (0.97, 1.03):
        runs.append(
            weightless(
                law=pulls(torque=share * load, rise=rise),
                x0=panda.rest,
                friction=panda.friction,
                duration=1.0,
            )
        )
    held, torn = (np.abs(trace.v[-1]).max() for trace in smc.run(runs))
    assert held < 1e-6
    assert torn > 0.01


@pytest.mark.parametrize("hold", [None, 0.4])
def test_a_joint_breaks_away_at_the_holding_force(hold):
    """Under a load that grows by 0.2 N a second, in both directions."""
    if hold is None:
        low, high = limits(0)
    else:
        low = -hold
        high = hold
    for most, slope in (
        (high, 0.2),
        (low, -0.2),
    ):
        part = smc.hardware.Sigmoid(P1[0], P2[0], P3[0], hold=hold)
        load = smc.signals.Ramp(slope)
        trace = flywheel(
            0.1,
            0.0,
            friction=part,
            disturbance=load,
            duration=2.5,
        )
        start = np.argmax(np.abs(trace.v[:, 0]) > 0.01)
        assert abs(trace.d[start, 0]) == pytest.approx(abs(most), rel=0.02)
        assert np.abs(trace.reaction[:start]).max() <= abs(most) * (1 + 1e-9)


def test_a_joint_at_rest_stays_and_one_torn_loose_slides():
    """A push of 0.1 s, then rest under a load that the limits hold; then a push after which F
    balances the load.
    """
    push = (
        smc.signals.Pulse(2.0, time=0.0, width=0.1),
        smc.Constant(-0.15),
        smc.signals.Pulse(-2.0, time=1.5, width=0.05),
    )
    trace = flywheel(
        0.5, 0.0, friction=smc.hardware.Sigmoid(P1[0], P2[0], P3[0]), disturbance=push, duration=7.0
    )
    v = trace.v[:, 0]
    assert v[80] > 0.1
    assert np.abs(v[1200:1500]).max() < 1e-6
    assert v[1540] < -0.1
    assert sigmoid(v[-1], P1[0], P2[0], P3[0]) == pytest.approx(-0.15, rel=1e-3)


# load, kg, gains of the loop, and friction, N: the load swings near the limit that holds the trolley
@pytest.mark.parametrize(
    ("load", "kp", "kd", "level"),
    [(0.72, 22.0, 3.86, 0.95), (0.94, 31.7, 2.95, 0.55)],
)
def test_a_joint_that_moves_with_others_rests_where_mujocos_set_valued_friction_holds_it(
    load, kp, kd, level
):
    crane = smc.plant("overhead_crane", M=1.0, m=load)
    law = state_feedback(np.array([[kp, 0.0, kd, 0.0]]), "pd")
    runs = []
    for part in (Curious(level, 0.0, 0.0), smc.Coulomb(level)):
        on = {"slide": part}
        runs.append(smc.Scenario(plant=crane, law=law, friction=on, x0=(0.3, 0.0), duration=8.0))
    ours, theirs = smc.run(runs)
    # m; MuJoCo's creeps
    assert np.abs(ours.x - theirs.x)[4000:, 0].max() < 2e-6


# both loops, threads, numbers of a simulation's own


@dataclasses.dataclass(frozen=True)
class Curious(Sliding):
    """A user's friction, which reads all that it may."""

    a: float | tuple[float, ...] = 0.3
    b: float | tuple[float, ...] = 0.05
    c: float | tuple[float, ...] = 0.1

    @staticmethod
    def value(v, motor, load, p):
        dry = p.a + p.b * abs(motor - 0.5 * load)
        return math.copysign(dry, v) + p.c * v, -dry, dry


def scenarios():
    common = {
        "duration": 0.1,
        "control_period": 2e-3,
        "disturbance": (smc.Sine(3.0, 40.0),),
    }
    frictions = [
        smc.plant("panda").friction,
        smc.hardware.servo("mx106", "m6").friction,
        Curious(a=tuple(0.1 * i for i in range(1, 8))),
    ]
    for friction in (*frictions, smc.hardware.Sigmoid(0.5, 9.0, hold=0.7)):
        yield smc.Scenario(
            plant="panda",
            law="computed_torque_sliding",
            friction=friction,
            **common,
        )
    yield smc.Scenario(
        plant="cart_pole",
        law="observer_free",
        friction=Curious(a=(0.5, 0.01)),
        **common,
    )
    # two formulas, each on joints of its own
    by_joint = {"joint2": Curious(), "joint5": frictions[1], "joint6": frictions[1]}
    yield smc.Scenario(plant="panda", law="computed_torque_sliding", friction=by_joint, **common)
    servo = smc.hardware.servo("mx64", "m5", command="voltage")
    by_joint = {"p0/hinge": Curious(), "p3/hinge": servo.friction}
    yield smc.Scenario(
        plant="pendulum_network", law=smc.law("classical"), friction=by_joint, **common
    )
    gust = {
        "disturbance": smc.signals.Gust(2.0, time=0.05, width=0.1),
        "duration": 0.2,
    }
    for start in (0.5, -1.5):
        yield smc.Scenario(
            plant="pendulum_network",
            law=smc.law("classical"),
            friction=servo.friction,
            actuator=servo.motor,
            x0=start,
            **gust,
        )
    # the elbow, which it then meets: the load has its force
    at_a_stop = (0.0, 0.0, 0.0, -0.0750, 0.0, 1.5, 0.0)
    yield smc.Scenario(
        plant="panda",
        law="none",
        friction=frictions[2],
        x0=at_a_stop,
        v0=0.5,
        **common,
    )


@pytest.mark.parametrize("friction", [smc.hardware.servo("mx64", "m4").friction, Curious(b=0.4)])
def test_a_rigid_play_puts_no_load_of_its_own_on_a_gearbox(friction):
    common = {
        "plant": "pendulum_network",
        "law": smc.law("pid"),
        "friction": friction,
        "physics_step": 1.25e-4,
        "integrator": "implicitfast",
        "duration": 1.0,
    }
    rigid = smc.Backlash(gap=0.0, rotor_inertia=1e-6)
    without, behind = smc.run([smc.Scenario(**common, actuator=part) for part in (None, rigid)])
    np.testing.assert_allclose(behind.x, without.x, atol=1e-4)


def test_callback_equals_reference_loop_with_a_friction_by_a_formula():
    scenarios_run = list(scenarios())
    for scenario, trace in zip(scenarios_run, smc.run(scenarios_run), strict=True):
        assert trace.failure is None
        assert_same(trace, reference.run(scenario))
        # a joint turned back, so it stuck
        assert np.abs(np.diff(np.sign(trace.v), axis=0)).sum() >= 2


# servos: the published code, in numpy


def published(model, fitted, motor, external, v):
    """The dry friction and the damping of Rhoban/bam's Model.compute_frictions, for arrays."""
    stribeck = model in ("m2", "m4", "m5", "m6")
    loaded = model not in ("m1", "m2")
    directional = model in ("m5", "m6")
    if stribeck:
        near = np.exp(-(np.abs(v / fitted["dtheta_stribeck"]) ** fitted["alpha"]))
    else:
        near = 0.0 * v
    loss = fitted["friction_base"] + 0.0 * v
    if stribeck:
        loss = loss + near * fitted["friction_stribeck"]
    if loaded and directional:
        loss = loss + np.abs(
            external * fitted["load_friction_external"] - motor * fitted["load_friction_motor"]
        )
        away = (
            external * fitted["load_friction_external_stribeck"]
            - motor * fitted["load_friction_motor_stribeck"]
        )
        loss = loss + near * np.abs(away)
    elif loaded:
        loss = loss + fitted["load_friction_base"] * np.abs(external - motor)
        if stribeck:
            loss = loss + near * fitted["load_friction_stribeck"] * np.abs(external - motor)
    if model == "m6":
        against = np.sign(external) != np.sign(motor)
        driven = (
            (np.abs(external) < np.abs(motor)) * fitted["load_friction_external_quad"] * external**2
        )
        driven_back = (
            (np.abs(external) > np.abs(motor)) * fitted["load_friction_motor_quad"] * motor**2
        )
        loss = loss + near * against * (driven + driven_back)
    return loss, fitted["friction_viscous"]


def test_servo_friction_is_the_published_code_on_a_grid_of_speed_and_load():
    for name, models in SERVOS.items():
        for model, fitted in models.items():
            assert (len(fitted) - 3) == {
                "m1": 2,
                "m2": 5,
                "m3": 3,
                "m4": 7,
                "m5": 9,
                "m6": 11,
            }[model]
            friction = smc.hardware.servo(name, model).friction
            numbers = SimpleNamespace(
                **dict(zip(friction.per_joint, friction.parameters(0), strict=True))
            )
            speeds = np.r_[-5.0, -0.7, -1e-3, 1e-3, 0.2, 3.0]
            torques = np.r_[-6.0, -1.0, 0.0, 0.4, 1.0, 5.0]
            for v in speeds:
                for motor in torques:
                    for load in torques:
                        loss, damping = published(model, fitted, motor, load, v)
                        held, _ = published(model, fitted, motor, load, 0.0 * v)
                        f, _, _ = friction.value(v, motor, load, numbers)
                        assert f == pytest.approx(
                            np.sign(v) * loss + damping * v,
                            rel=0,
                            abs=1e-12,
                        )
                        assert friction.value(0.0, motor, load, numbers)[1:] == pytest.approx(
                            [-held, held], rel=0, abs=1e-12
                        )


ARM = """<mujoco><option><flag {}/></option><worldbody>
<body><joint name="a" axis="0 1 0"/><geom size=".1" pos=".3 0 0" contype="0"/>
<body pos=".3 0 0"><joint name="b" axis="0 1 0"/><geom size=".1" pos=".3 0 0" contype="0"/>
</body></body></worldbody><actuator><motor joint="a"/><motor joint="b"/></actuator></mujoco>"""


@pytest.mark.parametrize("flag", ["constraint", "frictionloss", "refsafe"])
def test_flags_that_turn_dry_friction_off_are_refused_beside_a_formula(flag, refused):
    plant = smc.plant_from(ARM.format(f'{flag}="disable"'), ["a", "b"], name="arm")
    rough = smc.hardware.ServoFriction(kc=0.3)
    run = smc.Scenario(plant=plant, law="none", friction=rough, u_max=1.0, duration=0.01)
    refused(lambda: smc.run(run), flag)


def test_a_jump_that_ends_the_dry_friction_of_another_joint_is_refused(refused):
    rough = {"elbow": smc.hardware.ServoFriction(kc=0.15)}
    plant = smc.plant("double_pendulum", cf1=0.2, cf2=0.0)
    fields = {"plant": plant, "law": "none", "friction": rough, "duration": 0.3}
    refused(lambda: smc.run(smc.Scenario(**fields, jump=smc.Jump(0.2, {"cf1": 0.0}))), "1e-9")
    little = smc.run(smc.Scenario(**fields, x0=(1.0, 0.5), jump=smc.Jump(0.2, {"cf1": 1e-9})))
    assert np.abs(little.reaction[250:, 1]).max() > 0.1
