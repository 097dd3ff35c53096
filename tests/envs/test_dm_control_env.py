"""dm_env environments: their physics are those of smc.run, its own tests pass, laws act, policies
control.
"""

import dataclasses
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from dm_env import StepType, test_utils
from helpers.episodes import (
    LAW,
    columns,
    dm_control_suite,
    driven_by_dm,
    flat,
    one_of_each,
    run_of,
    start,
)
from helpers.own_parts import dahl, worn

import smc_mujoco as smc
from smc_mujoco.envs import tasks
from smc_mujoco.envs.episode import Setting

suite = dm_control_suite()

import dm_control.suite  # noqa: E402
from dm_control.utils import rewards  # noqa: E402

# the physics are the benchmark's


@pytest.mark.quick
@pytest.mark.parametrize(("plant", "task"), one_of_each(1))
def test_a_law_as_an_agent_gives_the_trace_of_its_run(plant, task):
    plant_named = smc.plant(plant)
    strong = smc.law(
        "observer_free", lam=6.0 if plant_named.rest else max((6.0, *plant_named.limits)), k1=3.076
    )
    if "hierarchical" in smc.laws(plant):
        law = smc.law("hierarchical")
    else:
        law = strong
    changes = {"duration": 0.3, "x0": start(plant, task)}
    environment = suite.load(plant, task, changes=changes)
    trace = smc.run(run_of(environment.task.setting, law))
    states = driven_by_dm(environment, smc.envs.agent(law, environment))
    assert np.abs(states - columns(trace)).max() < 1e-9
    assert np.abs(states[:, : trace.x.shape[1]] - start(plant, task)).max() > 1e-4  # it moved


@pytest.mark.parametrize(
    "changes",
    [
        {"control_period": 0.01, "x0": 0.4, "v0": -0.2},
        {"friction": smc.Coulomb(0.1), "actuator": smc.Lag(0.02)},
        {"actuator": (smc.DCMotor(), smc.Backlash(0.01)), "x0": 0.3},
        {"actuator": smc.hardware.ElasticJoint(500.0, 0.1, 0.02), "x0": 0.3},
        {"actuator": smc.hardware.PositionServo(9.0, 1.0, goal=0.2, ki=2.0, slewmax=0.4)},
        {"actuator": smc.hardware.CommandDelay(0.02), "x0": 0.3},
        {"mismatch": {"mass": 1.3}, "u_max": 2.0},
        {"friction": dahl(level=0.1), "actuator": worn()},
        {"actuator": smc.DCMotor(inductance=0.0, ripple=0.1), "friction": smc.Coulomb(0.1)},
        {"control_period": 0.01, "actuator": (smc.Lag(0.02), smc.DCMotor(), smc.Backlash(0.01))},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_what_makes_a_mechanism_real_is_in_the_environment_too(changes):
    changes = {"duration": 0.3, "x0": 0.5} | changes
    environment = suite.load("inverted_pendulum", changes=changes)
    trace = smc.run(run_of(environment.task.setting, LAW))
    act = smc.envs.agent(LAW, environment)
    for _ in range(2):  # nothing is left of the episode before
        assert np.abs(driven_by_dm(environment, act) - columns(trace)).max() < 1e-9


@pytest.mark.parametrize(
    ("law", "fields"),
    [
        ("adaptive", {}),
        ("super_twisting", {"model": "nominal"}),
        ("classical", {"surface": "terminal"}),
        ("quasi_continuous", {"velocity": "levant"}),
    ],
)
def test_an_agent_has_the_memories_model_surface_and_estimator_of_its_law(law, fields):
    environment = suite.load("duffing", "track", changes={"duration": 0.2, "x0": 0.7})
    trace = smc.run(run_of(environment.task.setting, smc.law(law), fields))
    act = smc.envs.agent(smc.law(law), environment, **fields)
    first = driven_by_dm(environment, act)
    second = driven_by_dm(environment, act)
    assert np.abs(first - columns(trace)).max() < 1e-9
    assert np.array_equal(first, second)  # nothing is left of the episode before


def test_an_agent_with_a_model_of_coupled_channels_starts_afresh_too():
    """What the other channel was told last is part of the model, and must not come from the episode
    before.
    """
    links = {}
    for joint in ("shoulder", "elbow"):
        links[joint] = smc.Channel(motor=True)
    arm = smc.plant_from(Path(dm_control.suite.__file__).parent / "acrobot.xml", links)
    environment = suite.load(
        arm,
        changes={
            "x0": [1.0, 0.5],
            "duration": 0.05,
            "u_max": 500.0,
        },
    )
    act = smc.envs.agent(
        smc.law("computed_torque", kp=100.0, kd=20.0), environment, model="nominal"
    )
    first = driven_by_dm(environment, act)
    second = driven_by_dm(environment, act)
    assert np.array_equal(first, second)


def test_a_plant_of_one_s_own_starts_as_its_runs_do(tmp_path):
    path = tmp_path / "pair.xml"
    path.write_text("""
<mujoco><worldbody>
  <body name="a"><joint name="a" axis="0 1 0"/><geom size=".1" pos="0 0 -1" mass="1"/></body>
  <body name="b" pos="2 0 0"><joint name="b" axis="0 1 0"/>
    <geom size=".1" pos="0 0 -1" mass="1"/></body>
</worldbody><actuator><motor joint="a"/></actuator>
<keyframe><key name="up" qpos="0.2 3"/></keyframe></mujoco>""")
    environment = suite.load(smc.plant_from(path, ["a"], keyframe="up"), changes={"u_max": 1.0})
    environment.reset()
    # a joint without a channel, where the keyframe has it
    assert environment.physics.data.qpos[1] == 3.0


# rewards, observations, ends


def test_the_reward_is_dm_control_s_tolerance_in_closeness_and_calm():
    setting = Setting("duffing")
    random = np.random.default_rng(0)
    for x, v in random.normal(scale=(1.0, 5.0), size=(20, 2)):
        calm = rewards.tolerance(v, margin=5.0)
        expected = rewards.tolerance(x, margin=1.0) * (4.0 + calm) / 5.0
        assert tasks.reward(*setting.errors(np.array([x]), np.array([v]), 0)) == pytest.approx(
            expected, rel=1e-12
        )


@pytest.mark.parametrize(
    ("plant", "task", "goal", "miss"),
    [
        ("duffing", "regulate", [0.0], [1.0]),
        ("inverted_pendulum", "swing_up", [2.0 * np.pi], [np.pi]),
        ("cart_pole", "swing_up", [0.0, 0.0], [0.0, np.pi]),
        ("cart_pole", "swing_up", [0.0, 0.0], [1.5, 0.0]),
        ("pendulum_network", "synchronise", [0.7] * 5, [0.7, 0.7, 0.7, 0.7, -1.0]),
    ],
)
def test_the_reward_is_one_at_the_goal_and_small_far_from_it(plant, task, goal, miss):
    setting = Setting(plant, task)
    still = np.zeros(len(goal))
    assert tasks.reward(*setting.errors(np.array(goal), still, 0)) == pytest.approx(1.0)
    assert tasks.reward(*setting.errors(np.array(miss), still, 0)) < 0.35
    assert (
        tasks.reward(*setting.errors(np.array(goal), still + np.arange(len(goal)) + 50.0, 0))
        < 0.999
        or task == "synchronise"
    )


def test_tracking_is_rewarded_where_the_plant_follows():
    setting = Setting("cart_pole", "track", {"reference": smc.Sine(0.5, 2.0)})
    r, dr, _ = setting.reference(300)
    assert (r, dr) == pytest.approx((0.5 * np.sin(0.6), np.cos(0.6)))
    assert tasks.reward(
        *setting.errors(np.array([r, 0.0]), np.array([dr, 0.0]), 300)
    ) == pytest.approx(1.0)
    # the pole is to stand
    assert tasks.reward(*setting.errors(np.array([r, r]), np.array([dr, dr]), 300)) < 0.95
    assert setting.observe(np.zeros(2), np.zeros(2), 300).shape == (7,)


def test_tasks_are_for_the_plants_that_have_them():
    # its load hangs: nothing to swing up
    assert tasks.tasks("overhead_crane") == ["regulate", "track"]
    assert tasks.tasks("cart_pole") == ["regulate", "track", "swing_up"]
    assert "swing_up" not in tasks.tasks("pendulum_network")
    assert {"swing_up", "synchronise"} <= set(tasks.tasks("inverted_pendulum_network"))


def test_a_plant_that_diverges_within_a_step_ends_its_episode_and_the_next_one_begins():
    environment = suite.load(
        "duffing",
        changes={"u_max": 1e9, "control_period": 0.1, "x0": 1e5},
    )
    environment.reset()
    timestep = environment.step([1.0])
    assert timestep.step_type == StepType.LAST
    assert timestep.reward == 0.0
    assert timestep.discount == 0.0
    assert np.abs(flat(timestep)).max() <= 1e6  # numbers: 0 times NaN is no target
    assert environment.step([0.0]).first()


def test_writing_into_an_observation_changes_nothing():
    environment = suite.load("duffing", "track", random=0)
    for _ in range(2):
        environment.reset()
        timestep = environment.step([0.0])
        assert timestep.observation["reference"][1] == pytest.approx(0.5)
        for value in timestep.observation.values():
            value[:] = 99.0


# what dm_control and dm_env have


class Checked(test_utils.EnvironmentTestMixin):
    """dm_env's own tests; `make_action_sequence` goes beyond an episode's end."""

    plant = "duffing"
    task = "regulate"

    def make_object_under_test(self, **unused_kwargs):
        return suite.load(self.plant, self.task, random=0, changes={"duration": 0.015})


def checker(plant, task):
    from absl.testing import absltest

    case = type("Case", (Checked, absltest.TestCase), {"plant": plant, "task": task})
    return [case(name) for name in absltest.TestLoader().getTestCaseNames(case)]


@pytest.mark.parametrize(("plant", "task"), one_of_each(0))
def test_dm_env_s_own_tests_pass(plant, task):
    cases = checker(plant, task)
    assert len(cases) >= 4
    for case in cases:
        case.debug()  # raises what fails


def test_it_runs_in_the_runtime_of_dm_control_s_viewer():
    from dm_control.viewer import runtime

    environment = suite.load("duffing", random=0)
    viewed = runtime.Runtime(environment, smc.envs.agent(LAW, environment))
    faults = []
    viewed.on_error += faults.append
    for _ in range(3):
        viewed.tick(0.02, paused=False)
    assert not faults
    assert environment.physics.time() > 0.01


# errors


@dataclasses.dataclass(frozen=True)
class Lost(smc.Signal):
    """A reference that is NaN from some time on."""

    after: float

    @staticmethod
    def value(t, p):
        return (math.nan if t > p.after else 0.0), 0.0, 0.0


def test_bad_input_is_one_sentence(refused):
    for word, make in {
        "'swing_up'": lambda: suite.load("duffing", "swing_up"),
        "'noise'": lambda: suite.load("duffing", changes={"noise": smc.Noise(0.1)}),
        "u_max is inf": lambda: suite.load("duffing", changes={"u_max": np.inf}),
        "'track'": lambda: suite.load("duffing", changes={"reference": smc.Sine(0.1, 1.0)}),
        "t = 1.001 s": lambda: suite.load("duffing", "track", changes={"reference": Lost(1.0)}),
        "changes is 3": lambda: suite.load("duffing", changes=3),
        "environment is 3": lambda: smc.envs.agent("classical", 3),
    }.items():
        refused(make, word)


def test_an_agent_whose_law_fails_says_so():
    @smc.law_function
    def broken(y, gains, memory):
        return 1.0 / (y.t - 0.001), 0.0

    environment = suite.load("duffing")
    timestep = environment.reset()
    act = smc.envs.agent(broken, environment)
    timestep = environment.step(act(timestep))
    with pytest.raises(smc.ScenarioError, match=r"broken.* ZeroDivisionError .* t = 0\.001 s"):
        act(timestep)


@pytest.mark.slow
def test_an_environment_is_rendered_without_a_display():
    code = "from smc_mujoco.envs import suite; e = suite.load('duffing', 'regulate', random=0)"
    code += "; e.reset(); print(e.physics.render(24, 32).shape)"
    environment = dict(os.environ)
    for name in ("DISPLAY", "MUJOCO_GL"):
        environment.pop(name, None)
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    assert done.stdout == "(24, 32, 3)\n", done.stderr
