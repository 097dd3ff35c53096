"""A free body of a user's model: pose, mixer, motion against an integration without MuJoCo, scores,
comparisons.
"""

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import smc_mujoco as smc
from smc_mujoco.analysis.tuning.evaluator import Evaluator
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.common.files import shipped
from smc_mujoco.control.attitude import of_thrust
from smc_mujoco.mechanisms import rotation

TEXT = (shipped("models").parent / "examples" / "quadrotor.xml").read_text(encoding="utf-8")
MASS = 0.0319
LEVER = 0.03253
G = 9.81


@pytest.fixture(scope="module")
def drone():
    return smc.plant_from(
        TEXT,
        channels=["body"],
        name="drone",
        keyframe="hover",
    )


@smc.law_function(
    joint=True,
    plants=("a free body",),
)
def nothing(y, gains, memory):
    return np.zeros(6), np.zeros(6)


@pytest.mark.quick
def test_rotors_that_saturate_keep_the_torques_and_give_up_thrust(drone):
    """The firmware takes the excess of the largest from all four, and then cuts at 0."""

    @smc.law_function(
        joint=True,
        plants=("a free body",),
    )
    def much(y, gains, memory):
        return np.array([0.0, 0.0, 0.44, 2e-3, 0.0, 0.0]), np.zeros(6)

    trace = smc.run(
        smc.Scenario(
            plant=drone,
            law=much,
            duration=2e-3,
        )
    )
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
        second = Rotation.random(rng=random)
        np.testing.assert_allclose(rotation.rotation_vector(*q), turn.as_rotvec(), atol=1e-14)
        assert rotation.rotation_vector(*-q) == pytest.approx(
            rotation.rotation_vector(*q), abs=1e-14
        )
        error = rotation.relative(tuple(q), tuple(second.as_quat(scalar_first=True)))
        np.testing.assert_allclose(
            rotation.rotation_vector(*error), (turn.inv() * second).as_rotvec(), atol=1e-13
        )
        np.testing.assert_allclose(
            rotation.turned(tuple(q), 1.0, 2.0, 3.0), turn.apply([1.0, 2.0, 3.0]), atol=1e-14
        )
        r = turn.as_rotvec()
        dr = random.normal(size=3)
        h = 1e-6
        ends = []
        for sign in (-0.5, 0.5):
            ends.append(Rotation.from_rotvec(r + sign * h * dr))
        np.testing.assert_allclose(
            rotation.rate(*r, *dr), (ends[0].inv() * ends[1]).as_rotvec() / h, atol=1e-8
        )


@pytest.mark.parametrize(
    "F",
    [
        (0.1, -0.2, 0.3),
        (0.0, 0.0, -1.0),
        (0.5, 0.1, -0.2),
        (1.0, 0.0, 0.0),
        (-0.3, 0.9, -2.0),
    ],
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


@smc.law_function(
    joint=True,
    plants=("a free body",),
)
def watch(y, gains, memory):
    """No wrench; s is the error's rate, as laws see it."""
    return np.zeros(6), y.de.copy()


def test_the_rate_of_an_attitudes_error_is_that_of_the_rotation_from_a_moving_reference(drone):
    path = [smc.Constant(0.0)] * 3 + [smc.Sine(0.9, 2.0), smc.Sine(0.7, 3.0), smc.Sine(0.8, 4.0)]
    start = {
        "x0": (0.0, 0.0, 3.0, 0.3, -0.2, 0.1),
        "v0": (1.0, -2.0, 3.0, 3.0, 5.0, -2.0),
    }
    trace = smc.run(
        smc.Scenario(
            plant=drone,
            law=watch,
            reference=path,
            duration=0.5,
            **start,
        )
    )
    bodies, references = (
        Rotation.from_rotvec(values[:, 3:].copy()) for values in (trace.x, trace.r)
    )
    errors = references.inv() * bodies
    turned = (errors[:-2].inv() * errors[2:]).as_rotvec() / 2e-3  # by central differences of 1 ms
    np.testing.assert_allclose(trace.s[1:-2, 3:], turned[:-1], atol=1e-3)
    np.testing.assert_allclose(trace.s[:, :3], trace.v[:, :3], atol=1e-14)


CF2 = """<mujoco model="cf2"><option timestep="0.001" density="1.225" viscosity="1.8e-5"/>
<worldbody>
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
    plant = smc.plant_from(
        CF2,
        channels=["flies"],
        name="cf2",
    )
    law = smc.law(
        "geometric",
        kx=0.2,
        kv=0.9,
        kR=6.0,
        kW=5.0,
    )
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law=law,
            x0=(0.02, 0.0, 0.2, 0.0, 0.0, 0.1),
            duration=25.0,
        )
    )
    assert trace.failure is None
    assert np.abs(trace.e[-1]).max() < 1e-3
    assert trace.applied[:, 4:].max() == 0.0


THRUSTERS = """<mujoco><option gravity="0 0 0"/><worldbody><body name="b"><freejoint name="floats"/>
  <geom type="box" size=".2 .15 .1" mass="12"/><site name="c"/></body></worldbody>
  <actuator>{}</actuator></mujoco>"""
SIX = "".join(
    f'<motor name="{i}" site="c" ctrlrange="-20 20" '
    f'gear="{" ".join("1" if i == j else "0" for j in range(6))}"/>'
    for i in range(6)
)


def test_a_floating_base_goes_to_a_pose_under_a_law_of_arms():
    """Six thrusters give every force and torque, so that the laws of many joints need no law of
    flight.
    """
    plant = smc.plant_from(
        THRUSTERS.format(SIX),
        channels=["floats"],
        name="base",
    )
    goal = []
    for value in (0.3, -0.2, 0.1, 0.4, -0.3, 0.8):
        goal.append(smc.Constant(value))
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law="super_twisting_computed_torque",
            reference=goal,
            duration=8.0,
        )
    )
    assert trace.failure is None
    assert np.abs(trace.e[-1]).max() < 2e-3


def test_disturbances_are_forces_on_the_centre_of_mass_and_turn_nothing():
    text = TEXT.replace('act="0.0782 0.0782 0.0782 0.0782"', "")
    body = smc.plant_from(
        text,
        channels=["body"],
        name="body",
        keyframe="hover",
    )
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
        smc.Scenario(
            **fall,
            disturbance=smc.signals.OrnsteinUhlenbeck(0.02, tau=0.1),
            seed=3,
        )
    ).d
    # each axis has its own
    assert np.abs(np.corrcoef(wind[:, :3].T)[np.triu_indices(3, 1)]).max() < 0.9
    assert np.ptp(wind[:, 0]) > 0.01


def test_scores_are_of_the_position_the_heading_and_the_actuators(drone):
    """Rotors that push one way tilt the body where a force acts, so that its tilt is no error."""
    trace = smc.run(
        smc.Scenario(
            plant=drone,
            law="geometric",
            x0=(0.1, -0.2, 1.1, 0.0, 0.0, 0.3),
            duration=6.0,
        )
    )
    scores = smc.score(trace)
    e = trace.e
    t = trace.t
    assert scores["itae"] == pytest.approx(np.trapezoid(t * np.abs(e[:, :3]).sum(axis=1), t))
    assert scores["tv"] == pytest.approx(np.abs(np.diff(trace.applied, axis=0)).sum(axis=0).max())
    last = []
    for part, size in (
        (e[:, :3], 0.2),
        (e[:, 5:], 0.3),
    ):
        last.append(t[np.flatnonzero(np.abs(part).max(axis=1) > 0.02 * size)[-1] + 1])
    assert scores["settling_time"] == pytest.approx(max(last))
    pushed = smc.run(
        smc.Scenario(
            plant=drone,
            law="geometric",
            disturbance=smc.Constant(0.02),
            duration=8.0,
        )
    )
    assert np.abs(pushed.e[-1, 3:5]).min() > 0.05  # rad: it leans into the force
    assert smc.scores(pushed)["driven rad"]["ultimate_bound"] < 0.01


def test_the_objective_of_a_free_body_is_that_of_its_traces(drone):
    goal = Objective(
        conditions=("noise", "constant"),
        duration=0.4,
        u_max=0.48,
    )
    cases = goal.scenarios(drone, smc.law("geometric"))
    (evaluation,) = Evaluator(goal, cases, ("kx", "kR"))([(5.0, 300.0)])
    traces = smc.run(
        [dataclasses.replace(case, law=smc.law("geometric", kx=5.0, kR=300.0)) for case in cases]
    )
    tracking = variation = 0.0
    for trace in traces:
        for part in (trace.e[:, :3], trace.e[:, 5:]):
            tracking += (
                np.trapezoid(trace.t * np.abs(part).sum(axis=1), trace.t) / np.abs(part[0]).sum()
            )
        variation += np.max(np.abs(np.diff(trace.u, axis=0)).sum(axis=0) / drone.limits) / 0.4
    assert evaluation.tracking == pytest.approx(tracking)
    assert evaluation.variation == pytest.approx(variation)
    assert evaluation.objective == goal.evaluation(cases[0], traces).objective


SLUNG = """<mujoco><worldbody><body name="body"><freejoint/><site name="a" pos=".1 .1 0"/>
  <geom size=".1" mass=".5" contype="0" conaffinity="0"/>{}</body></worldbody><actuator>
  <motor site="a" gear="0 0 1 0 0 0"/><motor site="a" gear="0 0 0 1 0 0"/>
  <motor site="a" gear="0 0 0 0 1 0"/><motor site="a" gear="0 0 0 0 0 1"/></actuator></mujoco>"""


@pytest.mark.parametrize("joint", ["ball", "hinge"])
def test_laws_of_a_body_with_a_load_are_those_that_run_on_it(joint):
    load = f"""<body pos="0 0 -.3"><joint type="{joint}" pos="0 0 .3"/>
      <geom size=".02" mass=".05" contype="0" conaffinity="0"/></body>"""
    plant = smc.plant_from(SLUNG.format(load), ["body"])
    assert smc.laws(plant) == ["none"]
    assert len(smc.laws(smc.plant_from(SLUNG.format(""), ["body"]))) > 1
    with pytest.raises(smc.ScenarioError, match=r"give model='none' and a law that reads no model"):
        smc.Scenario(plant=plant, law="geometric")
    assert smc.run(smc.Scenario(plant=plant, law="none", duration=0.01)).failure is None


def test_starts_in_the_floor_are_raised_and_others_stay():
    touches = 'contype="1" conaffinity="1" type='
    ground = f'<worldbody><geom name="ground" {touches}"plane" size="1 1 .1" pos="0 0 {{}}"/>'
    solid = TEXT.replace('type="box"', f'{touches}"box"')
    starts = []
    for height in (0.95, -9.0):  # it hovers at 1 m
        text = solid.replace("<worldbody>", ground.format(height), 1)
        machine = smc.plant_from(text, channels=["body"], name="drone", keyframe="hover")
        runs = smc.grid(machine, nothing, "nominal", seeds=8)
        starts.append(np.array([scenario.resolved.x0 for scenario in runs]))
    near, far = starts
    up = near[:, 2] - far[:, 2]
    assert (up >= 0.0).all()
    assert 0 < np.count_nonzero(up) < len(up)
    assert near[:, 2].min() > 0.95
    np.testing.assert_array_equal(np.delete(near, 2, axis=1), np.delete(far, 2, axis=1))
