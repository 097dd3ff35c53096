"""gymnasium environments, single and in batches: the physics of smc.run, its own checkers pass, ids are found."""

import subprocess
import sys

import numpy as np
import pytest
from episodes import EVERY, LAW, SHORT, columns, driven_by_gym, run_of, start

import smc_mujoco as smc
from smc_mujoco import gl, registration

gymnasium = pytest.importorskip("gymnasium", reason="gymnasium is not installed: pip install 'smc-mujoco[rl]'")

from smc_mujoco.gym import PlantEnv  # noqa: E402
from smc_mujoco.vector import BatchEnv  # noqa: E402

# the physics are the benchmark's


@pytest.mark.parametrize(("plant", "task"), EVERY)
def test_a_law_as_an_agent_gives_the_trace_of_its_run(plant, task):
    law = smc.law("hierarchical") if "hierarchical" in smc.laws(plant) else LAW
    single = PlantEnv(plant, task, {"duration": 0.2, "x0": start(plant, task)})
    trace = smc.run(run_of(single.setting, law))
    assert np.abs(driven_by_gym(single, smc.agent(law, single)) - columns(trace)).max() < 1e-9


@pytest.mark.parametrize(("plant", "task"), EVERY)
def test_a_copy_in_a_batch_moves_as_the_single_environment_does(plant, task):
    many, random = BatchEnv(plant, 3, task, SHORT), np.random.default_rng(0)
    singles = [PlantEnv(plant, task, SHORT) for _ in range(3)]
    observations, _ = many.reset(seed=5)
    assert np.array_equal(observations, [e.reset(seed=5 + i)[0] for i, e in enumerate(singles)])
    truncated = np.zeros(3, bool)
    for _ in range(50):
        u = random.uniform(-1.5, 1.5, many.action_space.shape)
        o, r, terminated, truncated, _ = many.step(u)
        expected = [e.step(one) for e, one in zip(singles, u, strict=True)]
        assert np.abs(o - [e[0] for e in expected]).max() < 1e-12
        assert np.abs(r - [e[1] for e in expected]).max() < 1e-12
        assert [*zip(terminated, truncated, strict=True)] == [e[2:4] for e in expected]
    assert truncated.all()


def test_friction_and_motors_hold_in_a_batch_too():
    changes = {"friction": smc.Coulomb(0.1), "actuator": (smc.DCMotor(), smc.Backlash(0.01)), "duration": 0.1}
    many, single = BatchEnv("inverted_pendulum", 2, changes=changes), PlantEnv("inverted_pendulum", changes=changes)
    many.reset(seed=0)
    single.reset(seed=0)
    for _ in range(100):
        o, *_ = many.step([[1.0], [0.0]])
        assert np.abs(o[0] - single.step([1.0])[0]).max() < 1e-12


def test_a_copy_that_is_over_starts_anew_and_the_others_go_on():
    many = BatchEnv("duffing", 3, changes={"duration": 0.02})
    many.reset(seed=0)
    for _ in range(5):
        many.step(np.zeros((3, 1)))
    many.begin(np.array([False, True, False]))
    for _ in range(14):
        many.step(np.zeros((3, 1)))
    _, rewards_, terminated, truncated, _ = many.step(np.zeros((3, 1)))
    assert truncated.tolist() == [True, False, True]
    assert (rewards_ > 0.0).all()
    o, rewards_, terminated, truncated, _ = many.step(np.ones((3, 1)))
    assert many.samples.tolist() == [0, 16, 0]
    assert rewards_[0] == rewards_[2] == 0.0 < rewards_[1]  # the step that starts anew gives none
    assert (o[[0, 2], 1] == 0.0).all()  # nor does it move
    assert not (terminated | truncated).any()


def test_an_episode_ends_where_the_finite_world_does():
    single = PlantEnv("inverted_pendulum", changes={"x0": 9e5, "v0": 9e5})
    single.reset()
    observation, reward, terminated, *_ = single.step([0.0])
    assert terminated
    assert reward == 0.0
    assert single.observation_space.contains(observation)
    many = BatchEnv("inverted_pendulum", 2)
    many.reset(seed=0, options={"x0": 9e5, "v0": 9e5})
    observations, found, terminated, *_ = many.step(np.zeros((2, 1)))
    assert terminated.all()
    assert (found == 0.0).all()
    assert many.observation_space.contains(observations)


def test_seeds_reproduce_starts_and_different_seeds_differ():
    many = BatchEnv("duffing", 4)
    first, again = many.reset(seed=1)[0], many.reset(seed=1)[0]
    assert np.array_equal(first, again)
    assert np.array_equal(many.reset(seed=2)[0][:3], first[1:])  # copy i has seed + i
    assert np.array_equal(many.reset(seed=[4, 3, 2, 1])[0], first[::-1])
    assert not np.array_equal(many.reset()[0], many.reset()[0])


# what gymnasium has


@pytest.mark.parametrize(("plant", "task"), EVERY)
def test_gymnasium_s_own_checker_passes(plant, task):
    from gymnasium.utils.env_checker import check_env

    environment = gymnasium.make(f"smc_mujoco:smc/{registration.camel(plant)}-v0", task=task)
    check_env(environment.unwrapped, skip_render_check=True)


def test_gymnasium_s_benchmarks_run():
    from gymnasium.utils import performance

    environment = gymnasium.make("smc_mujoco:Duffing-v0", changes=SHORT)
    assert performance.benchmark_step(environment, target_duration=0.05, seed=0) > 0.0
    assert performance.benchmark_init(lambda: PlantEnv("duffing"), target_duration=0.05, seed=0) > 0.0
    if hasattr(performance, "benchmark_vector_step"):
        many = gymnasium.make_vec("smc_mujoco:Duffing-v0", num_envs=3, changes=SHORT)
        assert performance.benchmark_vector_step(many, target_duration=0.05, seed=0) > 0.0


@pytest.mark.skipif(bool(gl.missing()), reason=str(gl.missing()))
def test_it_is_seen():
    single = gymnasium.make("smc_mujoco:Duffing-v0", render_mode="rgb_array")
    single.reset(seed=0)
    assert single.render().std() > 5.0
    single.close()


# how gymnasium finds them


def fresh(code):
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


@pytest.mark.parametrize("order", ["import gymnasium", "import smc_mujoco, gymnasium", "import gymnasium, smc_mujoco"])
def test_an_id_is_found_whichever_package_is_imported_first(order):
    code = f"{order}; print(gymnasium.make('smc_mujoco:Duffing-v0').reset(seed=0)[0].shape)"
    assert fresh(f"import gymnasium, importlib.util; {code}" if "smc" not in order else code) == ["(2,)"]


def test_asking_whether_gymnasium_is_there_neither_imports_it_nor_forgets_the_plants():
    code = """
import importlib.util, sys
import smc_mujoco
print(importlib.util.find_spec("gymnasium") is not None, "gymnasium" in sys.modules)
import gymnasium
print("smc/CartPole-v0" in gymnasium.registry, any("smc_mujoco" in type(f).__module__ for f in sys.meta_path))
"""
    assert fresh(code) == ["True", "False", "True", "False"]


def test_every_plant_has_an_id_and_gymnasium_keeps_its_own():
    ids = {name for name, spec in gymnasium.registry.items() if "smc_mujoco" in str(spec.entry_point)}
    assert {f"smc/{registration.camel(plant)}-v0" for plant in smc.plants()} <= ids
    assert {"Duffing-v0", "VanDerPol-v0", "PendulumNetwork-v0", "OverheadCrane-v0"} <= ids
    assert "CartPole-v0" not in ids
    assert "gymnasium" in gymnasium.spec("CartPole-v0").entry_point


# errors


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: PlantEnv("duffing", render_mode="human"), "render_mode is 'human'"),
        (lambda: PlantEnv("duffing").reset(options={"x1": 0.0}), "choose from v0, x0"),
        (lambda: PlantEnv("duffing").reset(options={"x0": [0.0, 1.0]}), "x0 has 2 values for 1 channels"),
        (lambda: PlantEnv("duffing").step([0.0, 0.0]), r"of shape \(1,\)"),
        (lambda: PlantEnv("duffing").step([np.nan]), "action is \\[nan\\]"),
        (lambda: BatchEnv("duffing", 0), "num_envs is 0"),
        (lambda: BatchEnv("duffing", 2).step([[0.0], [0.0]]), "call reset first"),
        (lambda: BatchEnv("duffing", 2).reset(seed=[1]), "seed has 1 values for 2 copies"),
        (lambda: BatchEnv("duffing", 2).reset(seed="a"), "seed is 'a'"),
        (lambda: smc.agent("classical", BatchEnv("duffing", 2)), "give one of smc_mujoco.suite"),
        (lambda: smc.agent("clasical", PlantEnv("duffing")), "did you mean 'classical'"),
        (lambda: smc.agent("classical", PlantEnv("duffing"))(np.zeros(1)), "what the environment returned"),
    ],
)
def test_bad_input_is_one_sentence(make, words):
    with pytest.raises(smc.ScenarioError, match=words) as raised:
        make()
    assert "\n" not in str(raised.value)
