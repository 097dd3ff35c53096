"""A free body of a user's model: pose, mixer, motion against an integration without MuJoCo, scores,
comparisons.
"""

import dataclasses
import math
import re

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import smc_mujoco as smc
from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.analysis.tuning.evaluator import Evaluator
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.common.errors import ScenarioError, ScenarioWarning
from smc_mujoco.common.files import shipped
from smc_mujoco.control.attitude import of_thrust
from smc_mujoco.draw.film import arrows
from smc_mujoco.mechanisms import rotation
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.simulation.conditions import applicable, find_condition
from smc_mujoco.simulation.python_controller import Controller

TEXT = (shipped("models").parent / "examples" / "quadrotor.xml").read_text(encoding="utf-8")
MASS = 0.0319
LEVER = 0.03253
YAW = 0.00705
LAG = 0.0625
MOST = 0.12
G = 9.81
J = np.diag([16.8e-6, 16.8e-6, 29.8e-6])


@pytest.fixture(scope="module")
def drone():
    return smc.plant_from(TEXT, channels=["body"], name="drone", keyframe="hover")


@smc.law_function(
    joint=True, plants=("a free body",), gains={"time": smc.control.units.Gain(0.0, shared=True)}
)
def flip(y, gains, memory):
    """A wrench of time alone: a roll, a pitch and a yaw while the thrust changes."""
    u = np.zeros(6)
    thrust = 0.3 + 0.05 * math.sin(9.0 * y.t)
    q = rotation.quaternion(y.x[3], y.x[4], y.x[5])
    u[0], u[1], u[2] = rotation.turned(q, 0.0, 0.0, thrust)
    u[3] = 6e-4 * math.sin(5.0 * y.t)
    u[4] = 3e-4 * math.cos(7.0 * y.t)
    u[5] = 2e-4 * math.sin(3.0 * y.t + 1.0)
    return u, np.zeros(6)


@smc.law_function(joint=True, plants=("a free body",))
def nothing(y, gains, memory):
    return np.zeros(6), np.zeros(6)


def newton_euler(duration, period):
    """Return position, rotation matrix, velocities at the end of `flip`, by DOP853 between samples:
    no MuJoCo.
    """
    state = np.concatenate([[0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0], np.zeros(6), np.full(4, 0.0782)])
    for k in range(round(duration / period)):
        t = k * period
        F = 0.3 + 0.05 * math.sin(9.0 * t)
        Mx = 6e-4 * math.sin(5.0 * t)
        My = 3e-4 * math.cos(7.0 * t)
        Mz = 2e-4 * math.sin(3.0 * t + 1.0)
        signs = np.array(
            [(-1, -1, -1), (-1, 1, 1), (1, 1, -1), (1, -1, 1)]
        )  # as in the firmware's power distribution
        asked = F / 4 + signs @ np.array([Mx / LEVER, My / LEVER, Mz / YAW]) / 4
        asked = np.clip(asked - max(0.0, asked.max() - MOST), 0.0, MOST)

        def rates(t, y, asked=asked):
            q = y[3:7] / np.linalg.norm(y[3:7])
            v = y[7:10]
            w = y[10:13]
            f = y[13:]
            turn = Rotation.from_quat(q, scalar_first=True)
            places = LEVER * np.array([(1, -1), (-1, -1), (-1, 1), (1, 1)])
            torque = np.array(
                [f @ places[:, 1], -f @ places[:, 0], YAW * (-f[0] + f[1] - f[2] + f[3])]
            )
            dq = 0.5 * np.array([-q[1:] @ w, *(q[0] * w + np.cross(q[1:], w))])
            acceleration = turn.apply([0.0, 0.0, f.sum() / MASS]) - [0.0, 0.0, G]
            return np.concatenate(
                [
                    v,
                    dq,
                    acceleration,
                    np.linalg.solve(J, torque - np.cross(w, J @ w)),
                    (asked - f) / LAG,
                ]
            )

        state = solve_ivp(rates, (0.0, period), state, "DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    return (
        state[:3],
        Rotation.from_quat(state[3:7], scalar_first=True).as_matrix(),
        state[7:10],
        state[10:13],
    )


def test_two_seconds_of_a_flip_are_those_of_an_integration_without_mujoco(drone):
    """MuJoCo's step is of order two, as it turns the body by one rotation."""
    place, turn, v, w = newton_euler(2.0, 4e-3)
    misses = []
    for step in (2e-3, 1e-3):
        common = {"control_period": 4e-3, "physics_step": step, "duration": 2.0}
        trace = smc.run(smc.Scenario(plant=drone, law=flip, **common))
        attitude = Rotation.from_rotvec(trace.x[-1, 3:].copy()).as_matrix()
        off = trace.x[-1, :3] - place, attitude - turn, trace.v[-1] - [*v, *w]
        misses.append([np.abs(values).max() for values in off])
    assert np.abs(trace.v[:, 3:]).max() > 10.0  # rad/s: it does turn over
    assert max(misses[1][:2]) < 1e-4
    assert np.all(np.array(misses[0]) > 3.6 * np.array(misses[1]))


def test_a_tumbling_body_keeps_its_angular_momentum_and_energy_and_falls_on_a_parabola(drone):
    start = {"x0": (0.0, 0.0, 3.0, 0.3, -0.2, 0.1), "v0": (1.0, -2.0, 3.0, 5.0, 20.0, 3.0)}
    text = TEXT.replace('"16.8e-6 16.8e-6', '"16.8e-6 20e-6').replace(
        'act="0.0782 0.0782 0.0782 0.0782"', ""
    )
    body = smc.plant_from(text, channels=["body"], name="body", keyframe="hover")
    trace = smc.run(
        smc.Scenario(
            plant=body, law=nothing, duration=5.0, integrator="RK4", physics_step=1e-3, **start
        )
    )
    inertia = np.diag([16.8e-6, 20e-6, 29.8e-6])
    w = trace.v[:, 3:]
    momentum = Rotation.from_rotvec(trace.x[:, 3:].copy()).apply(w @ inertia)
    size = np.linalg.norm(momentum, axis=1)
    energy = np.einsum("ki,ij,kj->k", w, inertia, w)
    assert np.ptp(size) < 1e-10 * size[0]
    assert np.ptp(energy) < 1e-10 * energy[0]
    assert np.abs(momentum - momentum[0]).max() < 1e-4 * size[0]
    t = trace.t[:, None]
    fallen = np.array([0.0, 0.0, 3.0]) + t * [1.0, -2.0, 3.0] - 0.5 * t**2 * [0.0, 0.0, G]
    np.testing.assert_allclose(trace.x[:, :3], fallen, atol=1e-9)


def test_rotors_that_saturate_keep_the_torques_and_give_up_thrust(drone):
    """The firmware takes the excess of the largest from all four, and then cuts at 0."""

    @smc.law_function(joint=True, plants=("a free body",))
    def much(y, gains, memory):
        return np.array([0.0, 0.0, 0.44, 2e-3, 0.0, 0.0]), np.zeros(6)

    trace = smc.run(smc.Scenario(plant=drone, law=much, duration=2e-3))
    part = 2e-3 / LEVER / 4
    np.testing.assert_allclose(
        trace.applied[0], [0.12 - 2 * part] * 2 + [0.12] * 2 + [0.0] * 2, rtol=1e-12
    )
    assert trace.u[0, 2] == 0.44


def test_rotation_vectors_and_quaternions_are_those_of_scipy():
    random = np.random.default_rng(7)
    for turn in [
        *Rotation.random(20, random),
        Rotation.identity(),
        Rotation.from_rotvec([3.1, 0.5, 0.0]),
    ]:
        q = turn.as_quat(scalar_first=True)
        other = Rotation.random(rng=random)
        np.testing.assert_allclose(rotation.rotation_vector(*q), turn.as_rotvec(), atol=1e-14)
        assert rotation.rotation_vector(*-q) == pytest.approx(
            rotation.rotation_vector(*q), abs=1e-14
        )
        error = rotation.relative(tuple(q), tuple(other.as_quat(scalar_first=True)))
        np.testing.assert_allclose(
            rotation.rotation_vector(*error), (turn.inv() * other).as_rotvec(), atol=1e-13
        )
        np.testing.assert_allclose(
            rotation.turned(tuple(q), 1.0, 2.0, 3.0), turn.apply([1.0, 2.0, 3.0]), atol=1e-14
        )
        r = turn.as_rotvec()
        dr = random.normal(size=3)
        h = 1e-6
        ends = [Rotation.from_rotvec(r + sign * h * dr) for sign in (-0.5, 0.5)]
        np.testing.assert_allclose(
            rotation.rate(*r, *dr), (ends[0].inv() * ends[1]).as_rotvec() / h, atol=1e-8
        )


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-5, 9e-5, 2e-4, 5e-3, 2e-2], ids=str)
def test_the_rate_of_a_small_rotation_vector_is_its_series(size):
    r = size * np.array([0.6, -0.8, 0.0])
    dr = np.array([0.3, 0.7, -1.1])
    expected = dr - np.cross(r, dr) / 2 + np.cross(r, np.cross(r, dr)) / 6
    np.testing.assert_allclose(rotation.rate(*r, *dr), expected, atol=1e-13 + size**3 / 12)


@pytest.mark.parametrize(
    "F", [(0.1, -0.2, 0.3), (0.0, 0.0, -1.0), (0.5, 0.1, -0.2), (1.0, 0.0, 0.0), (-0.3, 0.9, -2.0)]
)
def test_the_wanted_attitude_has_its_third_axis_along_the_thrust(F):
    turn = Rotation.from_quat(
        of_thrust(np.array(F), np.array([0.0, 0.0, 0.4])), scalar_first=True
    ).as_matrix()
    np.testing.assert_allclose(turn[:, 2], np.array(F) / np.linalg.norm(F), atol=1e-12)
    np.testing.assert_allclose(turn.T @ turn, np.eye(3), atol=1e-12)
    heading = np.array([math.cos(0.4), math.sin(0.4), 0.0])
    assert abs(turn[:, 1] @ heading) < 1e-12
    assert turn[:, 0] @ heading > 0.0


def test_the_error_of_an_attitude_is_the_rotation_from_its_reference(drone):
    yaw = smc.Sine(0.5, 2.0)
    scenario = smc.Scenario(
        plant=drone,
        law="geometric",
        x0=(0.1, 0.0, 1.0, 0.2, 0.1, 0.3),
        duration=0.5,
        reference=[
            smc.Constant(0.0),
            smc.Constant(0.0),
            smc.Constant(1.0),
            smc.Constant(0.0),
            smc.Constant(0.0),
            yaw,
        ],
    )
    trace = smc.run(scenario)
    expected = (
        Rotation.from_rotvec(trace.r[:, 3:].copy()).inv()
        * Rotation.from_rotvec(trace.x[:, 3:].copy())
    ).as_rotvec()
    np.testing.assert_allclose(
        trace.e, np.hstack([trace.x[:, :3] - trace.r[:, :3], expected]), atol=1e-13
    )
    seen = smc.scores(trace)
    assert list(seen) == ["driven m", "driven rad"]


@smc.law_function(joint=True, plants=("a free body",))
def watch(y, gains, memory):
    """No wrench; s is the error's rate, as laws see it."""
    return np.zeros(6), y.de.copy()


def test_the_rate_of_an_attitudes_error_is_that_of_the_rotation_from_a_moving_reference(drone):
    path = [smc.Constant(0.0)] * 3 + [smc.Sine(0.9, 2.0), smc.Sine(0.7, 3.0), smc.Sine(0.8, 4.0)]
    start = {"x0": (0.0, 0.0, 3.0, 0.3, -0.2, 0.1), "v0": (1.0, -2.0, 3.0, 3.0, 5.0, -2.0)}
    trace = smc.run(smc.Scenario(plant=drone, law=watch, reference=path, duration=0.5, **start))
    bodies, references = (
        Rotation.from_rotvec(values[:, 3:].copy()) for values in (trace.x, trace.r)
    )
    errors = references.inv() * bodies
    turned = (errors[:-2].inv() * errors[2:]).as_rotvec() / 2e-3  # by central differences of 1 ms
    np.testing.assert_allclose(trace.s[1:-2, 3:], turned[:-1], atol=1e-3)
    np.testing.assert_allclose(trace.s[:, :3], trace.v[:, :3], atol=1e-14)


CF2 = """<mujoco model="cf2"><option timestep="0.001" density="1.225" viscosity="1.8e-5"/><worldbody>
  <body name="cf2" pos="0 0 0.1"><freejoint name="flies"/>
  <inertial pos="0 0 0" mass="0.027" diaginertia="2.3951e-5 2.3951e-5 3.2347e-5"/>
  <geom type="box" size=".03 .03 .01" contype="0" conaffinity="0"/><site name="imu"/>
  <site name="actuation"/></body></worldbody>
  <actuator><motor ctrlrange="0 0.35" gear="0 0 1 0 0 0" site="actuation" name="body_thrust"/>
  <motor ctrlrange="-1 1" gear="0 0 0 -0.00001 0 0" site="actuation" name="x_moment"/>
  <motor ctrlrange="-1 1" gear="0 0 0 0 -0.00001 0" site="actuation" name="y_moment"/>
  <motor ctrlrange="-1 1" gear="0 0 0 0 0 -0.00001" site="actuation" name="z_moment"/></actuator>
  <sensor><gyro name="body_gyro" site="imu"/></sensor></mujoco>"""


def test_a_model_with_thrust_and_moments_of_either_sign_holds_a_pose():
    """The form of MuJoCo Menagerie's Crazyflie, with its bounds, which it calls arbitrary: a slow
    law holds it.
    """
    plant = smc.plant_from(CF2, channels=["flies"], name="cf2")
    law = smc.law("geometric", kx=0.2, kv=0.9, kR=6.0, kW=5.0)
    trace = smc.run(
        smc.Scenario(plant=plant, law=law, x0=(0.02, 0.0, 0.2, 0.0, 0.0, 0.1), duration=25.0)
    )
    assert trace.failure is None
    assert np.abs(trace.e[-1]).max() < 1e-3
    assert trace.applied[:, 4:].max() == 0.0


@pytest.mark.parametrize("text", [TEXT, TEXT.replace('<freejoint name="body"/>', "<freejoint/>")])
def test_a_text_names_a_keyframe_and_a_free_joint_without_a_name_has_its_bodys(text, tmp_path):
    text = text.replace('qpos="0 0 1 1 0 0 0"', 'qpos="0 0 2 1 0 0 0"')
    (tmp_path / "mine.xml").write_text(text)
    joint = "body" if 'name="body"' in text else "drone"
    written = f"{tmp_path}/mine.xml:{joint}@hover"
    plant = as_plant(written)
    assert plant.x0 == (0.0, 0.0, 2.0, 0.0, 0.0, 0.0)
    assert as_plant(plant.argument).x0 == plant.x0
    assert as_plant(written.removesuffix("@hover")).x0[2] == 1.0
    with pytest.raises(ScenarioError, match=r"keyframe of mine.xml 'hver'"):
        as_plant(written.replace("hover", "hver"))


def test_rotors_that_turn_a_body_about_two_axes_only_together_are_told():
    """The signs of MuJoCo Menagerie's Skydio X2: rotors on one side turn alike."""
    swapped = re.sub(r'(gear="0 0 1 0 0 )-?([.0-9]+)"', r'\1\2"', TEXT)
    assert swapped != TEXT
    with pytest.warns(ScenarioWarning, match="3 independent .* gears of other signs"):
        smc.plant_from(swapped, channels=["body"], name="alike")


THRUSTERS = """<mujoco><option gravity="0 0 0"/><worldbody><body name="b"><freejoint name="floats"/>
  <geom type="box" size=".2 .15 .1" mass="12"/><site name="c"/></body></worldbody><actuator>{}</actuator></mujoco>"""
SIX = "".join(
    f'<motor name="{i}" site="c" gear="{" ".join("1" if i == j else "0" for j in range(6))}" ctrlrange="-20 20"/>'
    for i in range(6)
)


def test_a_floating_base_goes_to_a_pose_under_a_law_of_arms():
    """Six thrusters give every force and torque, so that the laws of many joints need no law of
    flight.
    """
    plant = smc.plant_from(THRUSTERS.format(SIX), channels=["floats"], name="base")
    goal = [smc.Constant(value) for value in (0.3, -0.2, 0.1, 0.4, -0.3, 0.8)]
    trace = smc.run(
        smc.Scenario(
            plant=plant, law="super_twisting_computed_torque", reference=goal, duration=8.0
        )
    )
    assert trace.failure is None
    assert np.abs(trace.e[-1]).max() < 2e-3


def refusals():
    yield "law of one channel", {"law": "pid"}, "of many joints"
    yield (
        "disturbance",
        {"law": "geometric", "disturbance": smc.signals.Relay(0.1, s=1.0)},
        "sees the loop",
    )
    yield "friction", {"law": "geometric", "friction": smc.Coulomb(0.1)}, "friction"
    yield "estimator", {"law": "geometric", "velocity": "levant"}, "velocity"
    yield "clock", {"law": "geometric", "clock": smc.Clock(missed=0.1)}, "clock"


@pytest.mark.parametrize(
    ("fields", "named"), [case[1:] for case in refusals()], ids=[case[0] for case in refusals()]
)
def test_what_a_free_body_does_not_take_is_refused(drone, fields, named):
    with pytest.raises(ScenarioError, match=named):
        smc.Scenario(plant=drone, **fields)


def test_other_uses_of_a_free_joint_are_refused(drone):
    with pytest.raises(ScenarioError, match="only for a free body, not for panda"):
        smc.Scenario(plant="panda", law="geometric")
    with pytest.raises(ScenarioError, match=r"'body'.* only channel"):
        smc.plant_from(TEXT, channels={"body": smc.Channel(x0=1.0)})
    with pytest.raises(ScenarioError, match="0 actuators"):
        smc.plant_from(THRUSTERS.format(""), channels=["floats"])
    with pytest.raises(ScenarioError, match=r"smc\.run"):
        Controller(smc.Scenario(plant=drone, law="geometric"))


@pytest.mark.parametrize("law", ["geometric", "pid"])
def test_analyses_of_joints_refuse_a_free_body_whatever_the_law(drone, law):
    for ask in (
        lambda: smc.design.basin(drone, law),
        lambda: smc.design.chattering(smc.Scenario(plant=drone, law="geometric")),
    ):
        with pytest.raises(
            ScenarioError, match=r"drone is a free body, .* is for joints: give another plant"
        ):
            ask()


POD = """<body name="pod" pos="0 0 0.01" euler="0 0 20">
  <inertial pos="0 0 0" mass="1e-9" diaginertia="1e-15 1e-15 1e-15"/>
  <site name="1" pos="0.03253 -0.03253 0"/></body>"""
PODDED = TEXT.replace(
    '<site name="1" pos="0.03253 -0.03253 0"/>', POD
)  # a rotor on a body of its own


@pytest.mark.parametrize("text", [TEXT, PODDED], ids=["on the body", "on a part"])
def test_a_film_has_an_arrow_for_each_actuator_and_one_for_the_disturbance(text):
    """At the rotors, along their thrust as the body leans; the disturbance's along the force."""
    drone = smc.plant_from(text, channels=["body"], name="drone", keyframe="hover")
    push = smc.signals.Gust(0.02, time=0.0, width=0.4)
    trace = smc.run(smc.Scenario(plant=drone, law="geometric", duration=0.2, disturbance=push))
    scale = next(iter(arrows.scales([trace]).values()))
    assert scale.control == pytest.approx(np.abs(trace.applied).max())
    assert scale.disturbance == pytest.approx(trace.d[:, 0].max())
    drawn = arrows.flying(arrows.loads(trace, np.array([0.19, 0.2])), 0, scale, "#000000")
    assert [i for i, _ in drawn] == [0, 1, 2, 3, 0]
    lengths = [arrow.high for _, arrow in drawn[:4]]
    np.testing.assert_allclose(
        lengths, trace.applied[190:201, :4].mean(axis=0) / scale.control, rtol=0.01
    )
    model = trace.scenario.plant.load()
    data = mujoco.MjData(model)
    turn = Rotation.from_rotvec([0.3, -0.2, 0.5])
    data.qpos[:] = [1.0, 2.0, 3.0, *turn.as_quat(scalar_first=True)]
    mujoco.mj_kinematics(model, data)
    mounts = arrows.mounts(trace.scenario, [0] * 6, [False] * 6, math.inf, np.zeros(3))
    for (i, arrow), site in zip(drawn[:4], range(4), strict=True):
        line, _ = arrows.path(model, data, mounts[i], arrow) or pytest.fail("no arrow")
        np.testing.assert_allclose(line[0], data.site(str(site + 1)).xpos, atol=1e-12)
        along = (line[-1] - line[0]) / np.linalg.norm(line[-1] - line[0])
        np.testing.assert_allclose(along, turn.apply([0.0, 0.0, 1.0]), atol=1e-12)
    line, _ = arrows.path(model, data, mounts[0], drawn[4][1]) or pytest.fail("no arrow")
    np.testing.assert_allclose(np.cross(line[-1] - line[0], [1.0, 0.0, 0.0]), 0.0, atol=1e-12)
    assert line[-1, 0] > line[0, 0] > 1.0


def test_a_free_body_that_fails_at_once_has_no_arrows():
    law = smc.law_function(joint=True, plants=("a free body",))(
        lambda y, gains, memory: (math.nan * y.h, y.e)
    )()
    trace = smc.run(smc.Scenario(plant="quadrotor", law=law, duration=0.2))
    assert trace.failure is not None
    scale = next(iter(arrows.scales([trace]).values()))
    assert not arrows.flying(arrows.loads(trace, np.array([0.1, 0.2])), 0, scale, "#000000")


def test_disturbances_are_forces_on_the_centre_of_mass_and_turn_nothing():
    text = TEXT.replace('act="0.0782 0.0782 0.0782 0.0782"', "")
    body = smc.plant_from(text, channels=["body"], name="body", keyframe="hover")
    fall = {
        "plant": body,
        "law": "none",
        "duration": 0.5,
        "integrator": "RK4",
        "x0": (0.0, 0.0, 3.0, 0.4, -0.3, 0.2),
    }
    trace = smc.run(smc.Scenario(**fall, disturbance=smc.Constant(0.02)))
    t = trace.t[:, None]
    a = 0.02 / MASS
    np.testing.assert_allclose(
        trace.e[:, :3] - [0.0, 0.0, 2.0], 0.5 * t**2 * [a, a, a - G], atol=1e-12
    )
    assert np.ptp(trace.x[:, 3:], axis=0).max() < 1e-12
    assert np.all(trace.d == [0.02] * 3 + [0.0] * 3)
    sideways = smc.run(
        smc.Scenario(**fall, disturbance=smc.signals.Gust(0.02, time=0.1, width=0.3))
    )
    assert np.abs(sideways.d[:, 0]).max() > 0.0199
    assert np.all(sideways.d[:, 1:] == 0.0)
    wind = smc.run(
        smc.Scenario(**fall, disturbance=smc.signals.OrnsteinUhlenbeck(0.02, tau=0.1), seed=3)
    ).d
    assert (
        np.abs(np.corrcoef(wind[:, :3].T)[np.triu_indices(3, 1)]).max() < 0.9
    )  # each axis has its own
    assert np.ptp(wind[:, 0]) > 0.01


def test_the_suites_conditions_have_the_size_of_the_body_or_are_refused(drone):
    force = 0.48 / 6.0  # N, of the four rotors, over the study's bound
    assert find_condition("constant").on(drone, 2.0)["disturbance"] == smc.Constant(0.2 * force)
    assert find_condition("process_noise").on(drone, 2.0)["disturbance"].sigma == pytest.approx(
        0.2 * force
    )
    with pytest.raises(ScenarioError, match="'lag_20ms' sets actuator, and drone is a free body"):
        find_condition("lag_20ms").on(drone, 2.0)
    assert {"nominal", "noise", "sine", "heavy"} == set(
        applicable(["nominal", "noise", "sine", "heavy", "encoder"], [drone], 1.0)
    )


def test_every_seed_starts_within_a_fifth_of_a_metre_and_of_a_radian(drone):
    starts = np.array(
        [one.resolved.x0 for one in smc.grid(drone, "geometric", seeds=40, gains="default")]
    )
    off = np.abs(starts - drone.rest)
    assert np.all((off.max(axis=0) > 0.15) & (off.max(axis=0) <= 0.2))
    wider = smc.grid(
        drone, "geometric", seeds=40, gains="default", starts=smc.starts(spread=0.0, by=0.5)
    )
    assert np.abs([one.resolved.x0 for one in wider] - np.array(drone.rest)).max() > 0.45


def test_laws_for_a_free_body_are_those_that_it_can_run(drone):
    laws = smc.laws(drone)
    assert {"none", "geometric", "quaternion_sliding"} <= set(laws)
    assert not {"pid", "computed_torque", "super_twisting_computed_torque"} & set(laws)
    for law in laws:
        smc.Scenario(plant=drone, law=law)
    floating = smc.plant_from(THRUSTERS.format(SIX), channels=["floats"])
    assert {"geometric", "super_twisting_computed_torque"} <= set(smc.laws(floating))


def test_scores_are_of_the_position_the_heading_and_the_actuators(drone):
    """Rotors that push one way tilt the body wherever a force acts, so that its tilt is no error."""
    trace = smc.run(
        smc.Scenario(plant=drone, law="geometric", x0=(0.1, -0.2, 1.1, 0.0, 0.0, 0.3), duration=6.0)
    )
    found = smc.score(trace)
    e = trace.e
    t = trace.t
    assert found["itae"] == pytest.approx(np.trapezoid(t * np.abs(e[:, :3]).sum(axis=1), t))
    assert found["tv"] == pytest.approx(np.abs(np.diff(trace.applied, axis=0)).sum(axis=0).max())
    last = []
    for part, size in ((e[:, :3], 0.2), (e[:, 5:], 0.3)):
        last.append(t[np.flatnonzero(np.abs(part).max(axis=1) > 0.02 * size)[-1] + 1])
    assert found["settling_time"] == pytest.approx(max(last))
    pushed = smc.run(
        smc.Scenario(plant=drone, law="geometric", disturbance=smc.Constant(0.02), duration=8.0)
    )
    assert np.abs(pushed.e[-1, 3:5]).min() > 0.05  # rad: it leans into the force
    assert smc.scores(pushed)["driven rad"]["ultimate_bound"] < 0.01


def test_position_and_attitude_have_scales_of_their_own(drone):
    scales = search_space.scales(drone, 0.48, 0.5)
    assert (scales["X"], scales["F"], scales["M"]) == pytest.approx((0.5, 0.48, MASS))
    assert scales["T"] == pytest.approx(math.sqrt(0.5 * MASS / 0.48))
    torque = drone.limits[5]
    inertia = 29.8e-6
    assert scales["T of turns"] == pytest.approx(math.sqrt(inertia / torque))
    box = search_space.box(smc.law("geometric"), scales)
    assert math.sqrt(math.prod(box["kx"])) == pytest.approx(scales["T"] ** -2)
    assert math.sqrt(math.prod(box["kR"])) == pytest.approx(scales["T of turns"] ** -2)
    assert all(
        low < value < high
        for value, (low, high) in zip(
            smc.law("geometric").gains.values(), box.values(), strict=True
        )
    )


def test_the_objective_of_a_free_body_is_that_of_its_traces(drone):
    goal = Objective(conditions=("noise", "constant"), duration=0.4, u_max=0.48)
    cases = goal.scenarios(drone, smc.law("geometric"))
    (made,) = Evaluator(goal, cases, ("kx", "kR"))([(5.0, 300.0)])
    traces = smc.run(
        [dataclasses.replace(one, law=smc.law("geometric", kx=5.0, kR=300.0)) for one in cases]
    )
    tracking = variation = 0.0
    for trace in traces:
        for part in (trace.e[:, :3], trace.e[:, 5:]):
            tracking += (
                np.trapezoid(trace.t * np.abs(part).sum(axis=1), trace.t) / np.abs(part[0]).sum()
            )
        variation += np.max(np.abs(np.diff(trace.u, axis=0)).sum(axis=0) / drone.limits) / 0.4
    assert (made.tracking, made.variation) == (pytest.approx(tracking), pytest.approx(variation))
    assert made.objective == goal.evaluation(cases[0], traces).objective


def test_laws_of_a_free_body_are_compared_and_advised_as_any(drone, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    laws = ["geometric", "quaternion_sliding"]
    found = smc.compare(
        laws,
        drone,
        ["nominal", "constant"],
        seeds=7,
        tune=False,
        defaults=True,
        duration=3.0,
        progress=False,
    )
    assert {"itae", "tv_rate"} <= {board.metric for board in found.leaderboard}
    (itae,) = [
        b for b in found.leaderboard if b.metric == "itae" and b.group["condition"] == "nominal"
    ]
    assert itae.winner == "geometric"
    tuned = smc.compare(
        "geometric", drone, "nominal", seeds=1, searches=1, budget=1, duration=0.3, progress=False
    )
    assert tuned.gains["drone"]["geometric"].source.kind == "tuned here"


def test_a_log_that_is_not_finite_counts_as_a_failure_where_it_begins(drone):
    goal = Objective(conditions=("nominal",), duration=0.1, u_max=0.48)
    evaluate = Evaluator(goal, goal.scenarios(drone, smc.law("geometric")), ("kx",))
    log = np.zeros((101, 6), [(name, float) for name in ("x", "r", "u")])
    log["x"][:, 0] = 1.0
    assert evaluate._terms(0, None, log)[0] == pytest.approx(0.005, rel=0.02)  # 0.1^2 / 2
    log["x"][50:, 4] = np.nan
    assert evaluate._terms(0, None, log) == goal.terms_of_failure(0.05)
