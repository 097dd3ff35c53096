"""dm_env environments: their physics are those of smc.run, its own tests pass, laws act, policies control."""

import contextlib
import sys
import types
import warnings

import numpy as np
import pytest
from dm_control.rl import control
from dm_control.utils import rewards
from dm_env import StepType, test_utils
from episodes import EVERY, LAW, columns, driven_by_dm, run_of, start

import smc_mujoco as smc
from smc_mujoco import fingerprint, gl, suite, tasks
from smc_mujoco.setting import setting

# the physics are the benchmark's


@pytest.mark.parametrize(("plant", "task"), EVERY)
def test_a_law_as_an_agent_gives_the_trace_of_its_run(plant, task):
    law = smc.law("hierarchical") if "hierarchical" in smc.laws(plant) else LAW
    changes = {"duration": 0.3, "x0": start(plant, task)}
    environment = suite.load(plant, task, changes=changes)
    trace = smc.run(run_of(environment.task.setting, law))
    states = driven_by_dm(environment, smc.agent(law, environment))
    assert np.abs(states - columns(trace)).max() < 1e-9
    assert np.abs(states[:, : trace.x.shape[1]] - start(plant, task)).max() > 1e-4  # it moved


@pytest.mark.parametrize(
    "changes",
    [
        {"control_period": 0.01, "x0": 0.4, "v0": -0.2},
        {"friction": smc.Coulomb(0.1), "actuator": smc.Lag(0.02)},
        {"actuator": (smc.DCMotor(), smc.Backlash(0.01)), "x0": 0.3},
        {"mismatch": {"mass": 1.3}, "u_max": 2.0},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_what_makes_a_mechanism_real_is_in_the_environment_too(changes):
    changes = {"duration": 0.3, "x0": 0.5} | changes
    environment = suite.load("inverted_pendulum", changes=changes)
    trace = smc.run(run_of(environment.task.setting, LAW))
    assert np.abs(driven_by_dm(environment, smc.agent(LAW, environment)) - columns(trace)).max() < 1e-9


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
    act = smc.agent(law, environment, **fields)
    first, second = driven_by_dm(environment, act), driven_by_dm(environment, act)
    assert np.abs(first - columns(trace)).max() < 1e-9
    assert np.array_equal(first, second)  # nothing is left of the episode before


# rewards, observations, ends


def test_the_reward_is_dm_control_s_tolerance_in_closeness_and_calm():
    found, random = setting("duffing"), np.random.default_rng(0)
    for x, v in random.normal(scale=(1.0, 5.0), size=(20, 2)):
        calm = rewards.tolerance(v, margin=5.0)
        expected = rewards.tolerance(x, margin=1.0) * (4.0 + calm) / 5.0
        assert found.reward(np.array([x]), np.array([v]), 0) == pytest.approx(expected, rel=1e-12)


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
    found = setting(plant, task)
    still = np.zeros(len(goal))
    assert found.reward(np.array(goal), still, 0) == pytest.approx(1.0)
    assert found.reward(np.array(miss), still, 0) < 0.35
    assert found.reward(np.array(goal), still + np.arange(len(goal)) + 50.0, 0) < 0.999 or task == "synchronise"


def test_tracking_is_rewarded_where_the_plant_follows():
    found = setting("cart_pole", "track", {"reference": smc.Sine(0.5, 2.0)})
    r, dr, _ = found.reference(300)
    assert (r, dr) == pytest.approx((0.5 * np.sin(0.6), np.cos(0.6)))
    assert found.reward(np.array([r, 0.0]), np.array([dr, 0.0]), 300) == pytest.approx(1.0)
    assert found.reward(np.array([r, r]), np.array([dr, dr]), 300) < 0.95  # the pole is to stand
    assert found.observe(np.zeros(2), np.zeros(2), 300).shape == (7,)


def test_tasks_are_for_the_plants_that_have_them():
    assert tasks.tasks("overhead_crane") == ["regulate", "track"]  # its load hangs: nothing to swing up
    assert tasks.tasks("cart_pole") == ["regulate", "track", "swing_up"]
    assert "swing_up" not in tasks.tasks("pendulum_network")
    assert {"swing_up", "synchronise"} <= set(tasks.tasks("inverted_pendulum_network"))


def test_a_swing_up_cannot_push_the_pendulum_up_and_energy_can():
    environment = suite.load("inverted_pendulum", "swing_up", random=0)
    last = driven_by_dm(environment, lambda timestep: np.array([1.5]))[:, 0]
    assert np.abs(last - np.pi).max() < 2.0
    act = smc.agent(smc.law("swing_up"), environment)
    assert np.cos(driven_by_dm(environment, act)[-1, 0]) > 0.999


def test_an_episode_ends_where_the_finite_world_does():
    environment = suite.load("inverted_pendulum", changes={"x0": 9e5, "v0": 9e5})
    environment.reset()
    timestep = environment.step(np.zeros(1))
    assert (timestep.step_type, timestep.reward, timestep.discount) == (StepType.LAST, 0.0, 0.0)


def test_seeds_reproduce_starts_and_different_seeds_differ():
    starts = [suite.load("cart_pole", "swing_up", random=seed).reset().observation["position"] for seed in (3, 3, 4)]
    assert np.array_equal(starts[0], starts[1])
    assert not np.array_equal(starts[0], starts[2])


# what dm_control and dm_env have


class Checked(test_utils.EnvironmentTestMixin):
    """dm_env's own tests; `make_action_sequence` goes beyond an episode's end."""

    plant, task = "duffing", "regulate"

    def make_object_under_test(self, **unused_kwargs):
        return suite.load(self.plant, self.task, random=0, changes={"duration": 0.015})


def checker(plant, task):
    from absl.testing import absltest

    made = type("Case", (Checked, absltest.TestCase), {"plant": plant, "task": task})
    return [made(name) for name in absltest.TestLoader().getTestCaseNames(made)]


@pytest.mark.parametrize(("plant", "task"), EVERY)
def test_dm_env_s_own_tests_pass(plant, task):
    cases = checker(plant, task)
    assert len(cases) >= 4
    for case in cases:
        case.debug()  # raises what fails


def test_it_runs_in_the_runtime_of_dm_control_s_viewer():
    from dm_control.viewer import runtime

    environment = suite.load("duffing", random=0)
    shown, faults = runtime.Runtime(environment, smc.agent(LAW, environment)), []
    shown.on_error += faults.append
    for _ in range(3):
        shown.tick(0.02, paused=False)
    assert not faults
    assert environment.physics.time() > 0.01


@pytest.mark.skipif(bool(gl.missing()), reason=str(gl.missing()))
def test_it_is_seen():
    environment = suite.load("duffing", random=0)
    environment.reset()
    assert environment.physics.render(48, 64, camera_id="look").std() > 5.0


def test_environments_are_dm_control_s_own():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        environment = suite.load("duffing", flat_observation=True, random=np.random.RandomState(0))
    assert type(environment) is control.Environment
    timestep = environment.reset()
    assert timestep.observation["observations"].shape == (2,)
    assert smc.agent("classical", environment)(timestep).shape == (1,)


# policies


def flat(timestep):
    """An observation as one array, as gymnasium has it."""
    return np.concatenate([*timestep.observation.values()])


def proportional(observation):
    return -0.7 * observation[:1] - 0.5 * observation[1:2]


def test_a_policy_as_a_law_gives_the_episode_that_it_has_as_an_agent():
    environment = suite.load("duffing", changes={"duration": 0.2, "x0": 0.7})
    states = driven_by_dm(environment, lambda timestep: proportional(flat(timestep)))
    with pytest.warns(smc.PlainLoopWarning, match="proportional"):
        trace = smc.run(run_of(environment.task.setting, smc.policy(proportional)))
    assert np.abs(states - columns(trace)).max() < 1e-9


def test_a_policy_of_a_joint_and_one_that_moves_with_it_sees_both():
    environment = suite.load("cart_pole", "track", changes={"duration": 0.1, "x0": [0.1, 0.2]})

    def act(observation):
        return np.array([observation @ np.arange(0.1, 0.8, 0.1)])

    states = driven_by_dm(environment, lambda timestep: np.clip(act(flat(timestep)), -1.0, 1.0))
    with pytest.warns(smc.PlainLoopWarning):
        trace = smc.run(run_of(environment.task.setting, smc.policy(act, reference=True)))
    assert np.abs(states - columns(trace)).max() < 1e-9


def test_a_policy_of_another_size_ends_the_run_in_words():
    with pytest.warns(smc.PlainLoopWarning):
        trace = smc.run(smc.Scenario(plant="duffing", law=smc.policy(lambda o: [1.0, 2.0]), duration=0.01))
    assert "2 numbers" in str(trace.failure)


def test_files_of_onnx_and_torch_are_asked_as_batches_of_one(tmp_path, monkeypatch):
    seen = []

    class Session:
        def __init__(self, path, providers):
            self.path = path

        def get_inputs(self):
            return [types.SimpleNamespace(name="obs", type="tensor(float)")]

        def run(self, names, inputs):
            seen.append(inputs["obs"])
            return [-2.0 / 6.0 * inputs["obs"][:, :1]]

    monkeypatch.setitem(sys.modules, "onnxruntime", types.SimpleNamespace(InferenceSession=Session))
    (tmp_path / "net.onnx").write_bytes(b"x")
    with pytest.warns(smc.PlainLoopWarning, match="net"):
        trace = smc.run(smc.Scenario(plant="duffing", law=smc.policy(tmp_path / "net.onnx"), duration=0.003))
    assert trace.u[0, 0] == pytest.approx(-3.0, rel=1e-6)
    assert (seen[0].shape, seen[0].dtype) == ((1, 2), np.float32)
    first = fingerprint.of(smc.policy(tmp_path / "net.onnx").function)
    (tmp_path / "net.onnx").write_bytes(b"y")
    assert fingerprint.of(smc.policy(tmp_path / "net.onnx").function) != first  # a study runs it again


def test_a_torch_module_is_asked_for_float32_without_gradients(monkeypatch):
    class Tensor(np.ndarray):
        def numpy(self):
            return np.asarray(self)

    class Module:
        def __call__(self, batch):
            assert (batch.shape, batch.dtype) == ((1, 2), np.float32)
            return -0.5 * batch[:, :1]

    torch = types.SimpleNamespace(
        nn=types.SimpleNamespace(Module=Module),
        no_grad=contextlib.nullcontext,
        as_tensor=lambda array, dtype: array.astype(dtype).view(Tensor),
        float32=np.float32,
    )
    monkeypatch.setitem(sys.modules, "torch", torch)
    with pytest.warns(smc.PlainLoopWarning, match="Module"):
        trace = smc.run(smc.Scenario(plant="duffing", law=smc.policy(Module()), duration=0.003, x0=0.5))
    assert trace.u[0, 0] == pytest.approx(-1.5, rel=1e-6)


# errors


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: suite.load("dufing"), "did you mean 'duffing'"),
        (lambda: suite.load("duffing", "swing_up"), "task 'swing_up' is not for duffing: choose from regulate, track"),
        (lambda: suite.load("duffing", "regulat"), "did you mean 'regulate'"),
        (lambda: suite.load(3), "give smc.plant"),
        (lambda: suite.load("duffing", random="a"), "random is 'a'"),
        (lambda: suite.load("duffing", changes={"noise": smc.Noise(0.1)}), "unknown field of an environment"),
        (lambda: suite.load("duffing", changes={"u_max": np.inf}), "u_max is inf"),
        (lambda: suite.load("duffing", changes={"reference": smc.Sine(0.1, 1.0)}), "take 'track'"),
        (lambda: suite.load("duffing", changes=3), "changes is 3"),
        (lambda: smc.policy(3), "policy is 3"),
        (lambda: smc.policy("net.h5"), "ends in .onnx"),
        (lambda: smc.policy("net.onnx"), "no policy 'net.onnx'"),
        (lambda: smc.agent("classical", 3), "environment is 3: give one of smc_mujoco.suite"),
        (lambda: smc.agent("clasical", suite.load("duffing")), "did you mean 'classical'"),
    ],
)
def test_bad_input_is_one_sentence(make, words):
    with pytest.raises(smc.ScenarioError, match=words) as raised:
        make()
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(("file", "library"), [("a.onnx", "onnxruntime"), ("a.pt", "torch")])
def test_a_library_that_is_missing_is_named(file, library, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    (tmp_path / file).write_bytes(b"x")
    with pytest.raises(smc.ScenarioError, match=f"pip install {library}"):
        smc.policy(tmp_path / file)


def test_a_file_that_is_no_network_is_one_sentence(tmp_path, monkeypatch):
    def refuse(path, providers):
        raise RuntimeError("protobuf\n parsing failed")

    monkeypatch.setitem(sys.modules, "onnxruntime", types.SimpleNamespace(InferenceSession=refuse))
    (tmp_path / "bad.onnx").write_bytes(b"z")
    with pytest.raises(smc.ScenarioError, match=r"'bad.onnx' cannot be read \(protobuf parsing failed\): export"):
        smc.policy(tmp_path / "bad.onnx")


def test_an_agent_whose_law_fails_says_so():
    @smc.law_function
    def broken(y, gains, memory):
        return 1.0 / (y.t - 0.001), 0.0

    environment = suite.load("duffing")
    timestep = environment.reset()
    act = smc.agent(broken, environment)
    timestep = environment.step(act(timestep))
    with pytest.raises(smc.ScenarioError, match=r"law 'broken' raised ZeroDivisionError .* at t = 0.001 s"):
        act(timestep)
