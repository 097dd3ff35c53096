"""Policies as laws: what they see and give, and what they are asked for; of torch and onnxruntime,
stand-ins.

The libraries themselves are no dependency: where they are installed, the last tests here ask them.
"""

import contextlib
import math
import sys
import types
from pathlib import Path

import numpy as np
import pytest
from helpers.episodes import columns, dm_control_suite, driven_by_dm, flat, run_of

import smc_mujoco as smc
from smc_mujoco.simulation import run_key

pytestmark = [
    pytest.mark.quick,
    pytest.mark.filterwarnings("ignore::smc_mujoco.simulation.run.PlainLoopWarning"),
]


def proportional(observation):
    return -0.7 * observation[:1] - 0.5 * observation[1:2]


def briefly(law, **fields):
    """A run of three samples, and the start of it in parts of u_max, at x = 0.5, v = 0."""
    return smc.run(
        smc.Scenario(
            plant="duffing",
            law=law,
            duration=0.002,
            x0=0.5,
            u_max=6.0,
            **fields,
        )
    )


# callables


def test_a_policy_as_a_law_gives_the_episode_that_it_has_as_an_agent():
    environment = dm_control_suite().load("duffing", changes={"duration": 0.2, "x0": 0.7})
    states = driven_by_dm(environment, lambda timestep: proportional(flat(timestep)))
    trace = smc.run(run_of(environment.task.setting, smc.policy(proportional)))
    assert np.abs(states - columns(trace)).max() < 1e-9


def test_a_policy_of_a_joint_and_one_that_moves_with_it_sees_both():
    environment = dm_control_suite().load(
        "cart_pole", "track", changes={"duration": 0.1, "x0": [0.1, 0.2]}
    )

    def act(observation):
        return np.array([observation @ np.arange(0.1, 0.8, 0.1)])

    states = driven_by_dm(environment, lambda timestep: np.clip(act(flat(timestep)), -1.0, 1.0))
    trace = smc.run(run_of(environment.task.setting, smc.policy(act, reference=True)))
    assert np.abs(states - columns(trace)).max() < 1e-9


class Adaptive:
    """An action in proportion to x, whose gain grows with every call."""

    def __init__(self):
        self.gain = 0.0

    def __call__(self, observation):
        self.gain += 0.1
        return [-self.gain * observation[0]]


class Predicting:
    """The same, called by `predict`."""

    def __init__(self):
        self.adaptive = Adaptive()

    def predict(self, observation, deterministic):
        return self.adaptive(observation), None


@pytest.mark.parametrize(
    "given", [Adaptive(), Adaptive().__call__, Predicting()], ids=["called", "method", "predict"]
)
def test_every_channel_of_every_run_starts_from_the_object_as_it_was_given(given):
    scenario = smc.Scenario(
        plant="pendulum_network",
        law=smc.policy(given),
        duration=0.002,
        x0=[0.1, 0.2, 0.1, 0.1, 0.1],
        u_max=6.0,
    )
    first, second = (smc.run(scenario) for _ in range(2))
    np.testing.assert_array_equal(first.u, second.u)
    # the first call of each channel
    np.testing.assert_allclose(first.u[0], -0.6 * np.array(first.scenario.x0))


class Locked(Adaptive):
    """An object that cannot be copied."""

    def __deepcopy__(self, memo):
        raise TypeError("it holds a lock")


def test_an_object_that_cannot_be_copied_is_shared_and_says_so():
    with pytest.warns(
        UserWarning,
        match=r"policy 'Locked' cannot be copied \(it holds a lock\), .*: give an object",
    ):
        briefly(smc.policy(Locked()))


def test_a_policy_may_look_ahead_in_environments_of_its_own():
    gymnasium = pytest.importorskip(
        "gymnasium", reason="gymnasium is not installed: pip install 'smc-mujoco[rl]'"
    )

    def act(observation):
        many = gymnasium.make_vec("smc_mujoco:Duffing-v0", num_envs=2)
        many.reset(seed=0, options={"x0": observation[0], "v0": observation[1]})
        x = many.step([[-1.0], [1.0]])[0][:, 0]
        return [-1.0 if abs(x[0]) < abs(x[1]) else 1.0]

    trace = briefly(smc.policy(act))
    assert trace.failure is None
    assert np.all(trace.u[:-1] == -6.0)


# files and modules, with stand-ins for their libraries


def onnx(monkeypatch, kind="tensor(float)", shape=("batch", 2), more=()):
    """A stand-in for onnxruntime, whose networks give -x/2; what it was asked."""
    seen = []

    class Session:
        def __init__(self, path, options, providers):
            assert options.intra_op_num_threads == 1
            if Path(path).read_bytes() == b"bad":
                raise RuntimeError("protobuf\n parsing failed")

        def get_inputs(self):
            return [types.SimpleNamespace(name="obs", type=kind, shape=list(shape)), *more]

        def run(self, names, inputs):
            seen.append(inputs["obs"])
            return [-0.5 * inputs["obs"][:, :1]]

    library = types.SimpleNamespace(InferenceSession=Session, SessionOptions=types.SimpleNamespace)
    monkeypatch.setitem(sys.modules, "onnxruntime", library)
    return seen


@pytest.mark.parametrize(
    ("kind", "dtype"),
    [
        ("float", np.float32),
        ("double", np.float64),
        ("float16", np.float16),
    ],
)
def test_a_file_of_onnx_is_asked_for_a_batch_of_one_in_its_own_type(
    kind, dtype, tmp_path, monkeypatch
):
    seen = onnx(monkeypatch, f"tensor({kind})")
    (tmp_path / f"{kind}.onnx").write_bytes(kind.encode())
    trace = briefly(smc.policy(tmp_path / f"{kind}.onnx"))
    assert trace.u[0, 0] == pytest.approx(-1.5, rel=1e-3)
    assert seen[0].shape == (1, 2)
    assert seen[0].dtype == dtype


def test_a_file_that_changed_is_another_law_to_a_study(tmp_path, monkeypatch):
    onnx(monkeypatch)
    file = tmp_path / "net.onnx"
    file.write_bytes(b"x")
    first, again = (
        run_key.run_key(smc.Scenario(plant="duffing", law=smc.policy(file))) for _ in range(2)
    )
    file.write_bytes(b"y")
    assert first == again != run_key.run_key(smc.Scenario(plant="duffing", law=smc.policy(file)))


@pytest.mark.parametrize(
    "taken",
    [
        {"shape": (2,)},
        {"shape": (5, 2)},
        {"kind": "tensor(int64)"},
        {"more": [types.SimpleNamespace(name="h", type="tensor(float)", shape=[1, 1])]},
    ],
    ids=str,
)
def test_a_network_that_takes_more_or_less_than_an_observation_is_refused_before_the_run(
    taken, tmp_path, monkeypatch
):
    onnx(monkeypatch, **taken)
    (tmp_path / "net.onnx").write_bytes(str(taken).encode())
    with pytest.raises(
        smc.ScenarioError, match=r"'net.onnx' takes obs tensor.*export it for one input of floats"
    ):
        smc.policy(tmp_path / "net.onnx")


class Module:
    """A stand-in for a torch module, which gives -x/2 in evaluation and nonsense in training."""

    def __init__(self, dtype=np.float32):
        self.training = True
        self.gain = -0.5
        self.dtype = dtype

    def eval(self):
        self.training = False
        return self

    def to(self, device):
        assert device == "cpu"
        return self

    def parameters(self):
        return [types.SimpleNamespace(dtype=self.dtype, is_floating_point=lambda: True)]

    def __call__(self, batch):
        assert batch.shape == (1, 2)
        assert batch.dtype == self.dtype
        if self.training:
            return np.inf * batch
        return self.gain * batch[:, :1]


class Tensor(np.ndarray):
    def double(self):
        return self.astype(float)

    def numpy(self):
        return np.asarray(self)


@pytest.fixture
def torch(monkeypatch):
    library = types.SimpleNamespace(
        nn=types.SimpleNamespace(Module=Module),
        no_grad=contextlib.nullcontext,
        as_tensor=lambda array, dtype: array.astype(dtype).view(Tensor),
        float32=np.float32,
    )
    monkeypatch.setitem(sys.modules, "torch", library)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_torch_module_is_asked_in_evaluation_and_in_its_own_type(dtype, torch):
    module = Module(dtype)
    law = smc.policy(module)
    assert module.training  # its owner's is as it was
    module.gain = 7.0  # training goes on
    assert briefly(law).u[0, 0] == pytest.approx(-1.5, rel=1e-6)


# what predicts, as stable-baselines3 has it


class Predicts:
    """A stand-in for a model that gives its action, and what it remembers, when asked for the
    deterministic one.
    """

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        assert observation.shape == (2,)
        return np.array([-0.5 * observation[0] if deterministic else 1.0], np.float32), state


class Alone:
    """One that gives its action alone."""

    def predict(self, observation, deterministic=False):
        return Predicts().predict(observation, deterministic=deterministic)[0]


@pytest.mark.parametrize("kind", [Predicts, Alone])
def test_an_object_that_predicts_gives_its_deterministic_action(kind):
    law = smc.policy(kind())
    assert law.name == kind.__name__
    assert briefly(law).u[0, 0] == -1.5


class Head(Module):
    """A stand-in for the policy of a model of stable-baselines3: a torch module that predicts."""

    def predict(self, observation, deterministic=False):
        assert deterministic
        assert not self.training
        return self.gain * observation[:1], None


def test_the_policy_of_a_model_is_taken_as_it_is_now(torch):
    model = types.SimpleNamespace(
        predict=lambda *_, **__: pytest.fail("the model is trained on"), policy=Head()
    )
    law = smc.policy(model)
    model.policy.gain = 7.0
    assert briefly(law).u[0, 0] == pytest.approx(-1.5, rel=1e-6)
    assert briefly(smc.policy(model.policy)).u[0, 0] == 6.0  # itself, as it is now


# errors


def test_what_is_no_policy_is_one_sentence(refused):
    for act in (3, "net.h5", "net.onnx"):
        refused(lambda act=act: smc.policy(act), act)


class Pair(Module):
    """A stand-in for a network with two outputs."""

    def __call__(self, observation):
        return observation, observation


def test_what_is_no_action_ends_the_run_with_a_sentence(torch):
    wrong = {
        "two": lambda o: [1.0, 2.0],
        "none": lambda o: [np.nan],
        "pair": Pair(np.float64),
    }
    ends = {name: briefly(smc.policy(act)).failure for name, act in wrong.items()}
    free = smc.Scenario(
        plant="duffing",
        law=smc.policy(lambda o: o[:1]),
        duration=0.002,
        u_max=math.inf,
    )
    ends["no bound"] = smc.run(free).failure
    for name, said in {
        "two": "2 numbers",
        "none": "nan",
        "pair": "Pair",
        "no bound": "u_max is inf",
    }.items():
        assert said in str(ends[name])
        assert "t = 0 s" in str(ends[name])


def test_a_file_that_is_no_network_is_one_sentence(tmp_path, monkeypatch):
    onnx(monkeypatch)
    (tmp_path / "bad.onnx").write_bytes(b"bad")
    with pytest.raises(
        smc.ScenarioError, match=r"'bad.onnx' cannot be read \(protobuf parsing failed\): give what"
    ):
        smc.policy(tmp_path / "bad.onnx")


# the libraries themselves
