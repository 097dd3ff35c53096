"""gymnasium environments, single and in batches: the physics of smc.run, its own checkers pass, ids
are found.
"""

import copy
import dataclasses
import pickle
import re
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.commands import python
from helpers.episodes import LAW, SHORT, columns, driven_by_gym, one_of_each, run_of, start
from helpers.own_parts import dahl, worn

import smc_mujoco as smc
from smc_mujoco.common import gl
from smc_mujoco.envs import law_agent, registration, tasks

gymnasium = pytest.importorskip(
    "gymnasium", reason="gymnasium is not installed: pip install 'smc-mujoco[rl]'"
)

from mujoco.batch import Batch, SimulationError  # noqa: E402

from smc_mujoco.envs.episode import FIELDS  # noqa: E402
from smc_mujoco.envs.gymnasium_env import PlantEnv  # noqa: E402
from smc_mujoco.envs.vector_env import BatchEnv  # noqa: E402

PENDULUM = dataclasses.replace(smc.plant("inverted_pendulum"), x0=(0.2,))


@pytest.mark.quick
def test_the_docstring_of_an_environment_lists_its_fields():
    for name in FIELDS:
        assert re.search(rf"\b{name}\b", PlantEnv.__init__.__doc__), name


def test_films_of_an_environment_run_at_the_rate_of_its_controller():
    slow = PlantEnv("duffing", changes={"control_period": 0.02})
    assert slow.metadata["render_fps"] == 50


@pytest.mark.quick
@pytest.mark.parametrize(("reach", "applies"), [(1.0, False), (4.0, True)])
def test_a_swing_up_needs_every_toppling_joint_to_hang(reach, applies, monkeypatch):
    plant = smc.plant("inverted_pendulum")
    ranges = np.array([-4.0, -reach]), np.array([4.0, reach])
    monkeypatch.setattr(tasks, "toppling", lambda plant: np.array([True, True]))
    monkeypatch.setattr(tasks, "_ranges", lambda plant: ranges)
    assert tasks.SwingUp().applies_to(plant) == applies


@pytest.mark.quick
def test_the_torque_of_a_swing_up_is_measured_by_the_heaviest_pendulum(monkeypatch):
    monkeypatch.setattr(tasks, "toppling", lambda plant: np.array([True, True]))
    pulls = [(3.0, 1.0), (-8.0, 2.0)]  # f and g
    two = SimpleNamespace(free=(), parameters={}, nominal=lambda x, v, i, p: pulls[i])
    torque = tasks.SwingUp().fields(two)["u_max"]
    assert torque == pytest.approx(4.0 * tasks.SWING_UP_TORQUE)


@pytest.mark.quick
def test_an_observation_that_is_too_short_is_refused(refused):
    read = law_agent._positions_and_velocities
    refused(lambda: read(np.zeros(3), 2), "give what the environment returned")
    x, v = read(np.array([1.0, 2.0, 3.0, 4.0]), 2)
    assert (x.tolist(), v.tolist()) == ([1.0, 2.0], [3.0, 4.0])


# the physics are the benchmark's


@pytest.mark.parametrize(("plant", "task"), one_of_each(0))
def test_a_law_as_an_agent_gives_the_trace_of_its_run(plant, task):
    if "hierarchical" in smc.laws(plant):
        law = smc.law("hierarchical")
    else:
        law = LAW
    single = PlantEnv(plant, task, {"duration": 0.2, "x0": start(plant, task)})
    trace = smc.run(run_of(single.setting, law))
    assert np.abs(driven_by_gym(single, smc.envs.agent(law, single)) - columns(trace)).max() < 1e-9


@pytest.mark.parametrize(("plant", "task"), one_of_each(1))
def test_a_copy_in_a_batch_moves_as_the_single_environment_does(plant, task):
    many = BatchEnv(plant, 3, task, SHORT)
    random = np.random.default_rng(0)
    singles = [PlantEnv(plant, task, SHORT) for _ in range(3)]
    observations, _ = many.reset(seed=5)
    assert np.array_equal(observations, [e.reset(seed=5 + i)[0] for i, e in enumerate(singles)])
    truncated = np.zeros(3, bool)
    for _ in range(50):
        u = random.uniform(-1.5, 1.5, many.action_space.shape)
        o, r, terminated, truncated, _ = many.step(u)
        expected = []
        for e, action in zip(singles, u, strict=True):
            expected.append(e.step(action))
        assert np.abs(o - [e[0] for e in expected]).max() < 1e-12
        assert np.abs(r - [e[1] for e in expected]).max() < 1e-12
        assert [*zip(terminated, truncated, strict=True)] == [e[2:4] for e in expected]
    assert truncated.all()


@pytest.mark.parametrize(
    "parts",
    [
        {"friction": smc.Coulomb(0.1), "actuator": (smc.DCMotor(), smc.Backlash(0.01))},
        {"friction": smc.Coulomb(0.1), "actuator": (smc.Lag(0.01), smc.Lag(0.02))},
        {"friction": dahl(level=0.1), "actuator": worn()},
        {"actuator": smc.hardware.Stepper(torque=9.0)},
        {"actuator": (smc.Lag(0.01), smc.hardware.ElasticJoint(500.0, 0.1, 0.02))},
        {"actuator": (smc.hardware.CommandDelay(0.02), smc.hardware.PositionServo(9.0, ki=2.0))},
    ],
    ids=["motor", "two lags", "own", "stepper", "elastic joint", "late servo"],
)
def test_friction_and_drives_hold_in_a_batch_too(parts):
    changes = {"duration": 0.1} | parts
    many = BatchEnv("inverted_pendulum", 2, changes=changes)
    single = PlantEnv("inverted_pendulum", changes=changes)
    for _ in range(2):  # nothing is left of the episode before
        many.reset(seed=0)
        single.reset(seed=0)
        for k in range(100):
            if k == 50:  # a copy goes on where its original is
                single = copy.deepcopy(single)
            o, *_ = many.step([[1.0], [0.0]])
            assert np.abs(o[0] - single.step([1.0])[0]).max() < 1e-12


def test_a_part_that_fails_in_an_episode_is_named():
    changes = {"actuator": worn(after=0.005)}
    for environment, action in (
        (PlantEnv("duffing", changes=changes), [1.0]),
        (BatchEnv("duffing", 2, changes=changes), [[1.0], [0.0]]),
    ):
        environment.reset(seed=0)
        with pytest.raises(smc.ScenarioError, match="worn raised an exception"):
            [environment.step(action) for _ in range(20)]


OBSTACLES = {
    "stops": smc.Stops({"hinge": (-0.3, 0.3)}),
    "ball": smc.Ball(
        "pendulum",
        mass=0.3,
        height=0.001,
        radius=0.3,
    ),
}


@pytest.mark.parametrize("kind", OBSTACLES)
def test_episodes_begin_clear_of_obstacles_and_meet_them_as_runs_do(kind):
    part = OBSTACLES[kind]
    changes = {"contact": part, "duration": 0.3}
    many = BatchEnv(PENDULUM, 2, changes=changes)
    single = PlantEnv(PENDULUM, changes=changes)
    for seed in range(2):
        many.reset(seed=seed)
        o, _ = single.reset(seed=seed)
        assert not part.meets(PENDULUM, o[:1])
    for _ in range(299):
        copies, *_ = many.step([[1.0], [1.0]])
        o, *_ = single.step([1.0])
        assert np.abs(copies[0] - o).max() < 1e-12
    placed = PlantEnv(PENDULUM, changes=changes | {"x0": 0.2, "v0": 3.0})
    trace = smc.run(run_of(placed.setting, LAW))
    assert np.abs(trace.reaction).max() > 1.0
    assert np.abs(driven_by_gym(placed, smc.envs.agent(LAW, placed)) - columns(trace)).max() < 1e-9
    with pytest.raises(smc.ScenarioError, match="x0"):
        single.reset(options={"x0": 2.0} if kind != "ball" else {"x0": 0.1})


class Giving(Batch):
    """A Batch in which MuJoCo raises at the third call in the last simulation, which `stepped_ids` shows
    to be left alone.
    """

    stepped_ids = ()

    def step(self, ids=None, nstep=1):  # pyright: ignore[reportIncompatibleMethodOverride]
        self.stepped_ids = (*self.stepped_ids, list(range(self.nsim)) if ids is None else list(ids))
        super().step(ids, nstep=nstep)
        if len(self.stepped_ids) == 1:
            raise SimulationError(np.array([self.nsim - 1]), "gave up")


def test_a_copy_that_mujoco_gives_up_leaves_its_neighbours_drives_alone(monkeypatch):
    changes = {
        "actuator": (smc.Lag(0.01), smc.Lag(0.02)),
        "duration": 0.1,
        "control_period": 0.05,
    }
    monkeypatch.setattr("smc_mujoco.envs.vector_env.Batch", Giving)
    many = BatchEnv("cart_pole", 2, changes=changes)
    single = PlantEnv("cart_pole", changes=changes)
    many.reset(seed=0)
    single.reset(seed=0)
    o, _, terminated, *_ = many.step([[0.5], [0.5]])
    assert terminated.tolist() == [False, True]
    assert np.abs(o[0] - single.step([0.5])[0]).max() < 1e-12
    o, *_ = many.step([[0.2], [0.2]])
    assert np.abs(o[0] - single.step([0.2])[0]).max() < 1e-12
    assert many.batch.stepped_ids == ([0, 1], [0])  # pyright: ignore[reportAttributeAccessIssue]


def test_an_agent_that_joins_an_episode_late_has_no_old_memory():
    environment = PlantEnv("duffing", changes={"x0": 0.5, "duration": 0.1})
    act = smc.envs.agent("adaptive", environment)
    episodes = []
    for _ in range(2):
        environment.reset(seed=0)
        observation = environment.step([0.0])[0]
        episodes.append([act(observation).tolist() for _ in range(3)])
    assert episodes[0] == episodes[1]
    assert episodes[0][0] != episodes[0][2]  # it has a memory


def test_a_start_from_options_is_the_start_that_the_scenario_sets():
    """The rotor behind a backlash starts with its joint."""
    loose = {"actuator": (smc.DCMotor(), smc.Backlash(0.01)), "duration": 0.1}
    at_rest, started = (
        PlantEnv("inverted_pendulum", changes=loose | x) for x in ({}, {"x0": 0.3, "v0": 0.4})
    )
    assert np.array_equal(
        at_rest.reset(seed=0, options={"x0": 0.3, "v0": 0.4})[0], started.reset(seed=0)[0]
    )
    assert np.array_equal(
        [at_rest.step([0.5])[0] for _ in range(100)], [started.step([0.5])[0] for _ in range(100)]
    )


@pytest.mark.parametrize(
    ("plant", "task", "middle", "most"),
    [
        ("duffing", "regulate", [0.0], [1.5]),
        ("cart_pole", "swing_up", [0.0, np.pi], [0.0, 0.1]),
        ("inverted_pendulum_network", "synchronise", [0.0] * 5, [0.8] * 5),
    ],
)
def test_episodes_start_all_over_the_task_s_own_range(plant, task, middle, most):
    starts = BatchEnv(plant, 200, task).reset(seed=0)[0][:, : len(most)]
    reach = np.abs(starts - middle).max(axis=0)
    assert np.all(reach <= most)
    assert np.all(reach >= 0.95 * np.array(most))


FLOOR = """
<mujoco><worldbody>
  <geom type="plane" size="5 5 .1"/>
  <body pos="0 0 .5"><joint name="a" axis="0 1 0" damping=".1"/>
    <geom type="capsule" fromto="0 0 0 .6 0 0" size=".03" mass="1"/>
    <body pos=".6 0 0"><geom size=".05" mass=".2"/></body>
  </body>
</worldbody><actuator><motor joint="a"/></actuator></mujoco>"""


def test_a_model_of_one_s_own_keeps_its_floor_in_a_batch(tmp_path):
    (tmp_path / "arm.xml").write_text(FLOOR)
    arm = smc.plant_from(tmp_path / "arm.xml", ["a"])
    changes = {"x0": 0.6, "u_max": 5.0}
    many = BatchEnv(arm, 2, changes=changes)
    single = PlantEnv(arm, changes=changes)
    many.reset(seed=0)
    single.reset(seed=0)
    for _ in range(500):
        assert np.abs(many.step(np.zeros((2, 1)))[0] - single.step([0.0])[0]).max() < 1e-12
    assert 0.8 < single.data.qpos[0] < 0.9  # it lies on the floor
    starts = BatchEnv(arm, 200, changes={"u_max": 5.0}).reset(seed=0)[0][:, 0]
    assert 0.28 < np.abs(starts).max() <= 0.3  # it begins beside its goal


def same(theirs, ours):
    """Whether two answers of a step or a reset agree, infos and all."""
    *values, infos = theirs
    *ours_values, reported = ours
    for a, b in zip(values, ours_values, strict=True):
        np.testing.assert_allclose(b, a, atol=1e-12)
        assert a.dtype == b.dtype
    np.testing.assert_equal(reported, infos)


def test_a_batch_resets_as_gymnasium_s_own_vector_does():
    changes = {"duration": 0.01}
    theirs = gymnasium.vector.SyncVectorEnv([lambda: PlantEnv("duffing", "track", changes)] * 3)
    ours = BatchEnv("duffing", 3, "track", changes)
    assert ours.metadata["autoreset_mode"] is theirs.metadata["autoreset_mode"]
    same(theirs.reset(seed=[3, 4, 5]), ours.reset(seed=[3, 4, 5]))
    random = np.random.default_rng(0)
    ends = 0
    resets = {4: {"seed": 4, "options": {"x0": 0.25}}, 8: {}}
    for k in range(45):
        if k in resets:
            same(theirs.reset(**resets[k]), ours.reset(**resets[k]))
        u = random.uniform(-1.0, 1.0, (3, 1))
        answer = ours.step(u)
        same(theirs.step(u), answer)
        ends += (answer[2] | answer[3]).sum()
    assert ends >= 9


def test_an_episode_ends_where_a_run_diverges_with_an_observation_in_its_space():
    changes = {"x0": 9.9e5, "v0": 9e5, "control_period": 0.1}
    single = PlantEnv("inverted_pendulum", changes=changes)
    many = BatchEnv("inverted_pendulum", 2, changes=changes)
    single.reset(seed=0)
    # each number is below the limit of a run
    assert not single.setting.diverged(single.x, single.v)
    observation, reward, terminated, _, info = single.step([0.0])
    assert (terminated, reward) == (True, 0.0)
    assert np.isnan(info["error"]).all()
    assert single.observation_space.contains(observation)
    assert single.data.qpos[0] > 1e6
    many.reset(seed=0)
    observations, rewards, terminated, _, infos = many.step(np.zeros((2, 1)))
    assert terminated.all()
    assert np.isnan(infos["error"]).all()
    assert (rewards == 0.0).all()
    assert many.observation_space.contains(observations)


def test_what_mujoco_says_of_an_episode_that_diverges_is_not_printed(capfd):
    light = smc.plant("inverted_pendulum", m=0.01, l=0.1)
    env = PlantEnv(light, changes={"u_max": 1e9})
    env.reset(seed=0)
    assert env.step([1.0])[2]
    assert capfd.readouterr() == ("", "")


def test_an_environment_is_copied_and_sent_away_as_it_stands():
    original = PlantEnv("cart_pole", "swing_up", {"control_period": 0.01})
    original.reset(seed=0)
    original.step([0.5])
    for duplicate in (copy.deepcopy(original), pickle.loads(pickle.dumps(original))):
        assert np.array_equal(duplicate.step([1.0])[0], copy.deepcopy(original).step([1.0])[0])
        # the generator of starts, too
        assert np.array_equal(duplicate.reset()[0], copy.deepcopy(original).reset()[0])


def test_an_arm_tracks_a_reference_of_each_joint():
    """By default each swings about its pose at rest, within its range; or the user's own."""
    arm = smc.plant("panda")
    environment = PlantEnv(arm, "track", {"duration": 2.0})
    setting = environment.setting
    rest = np.array(arm.rest)
    observation, info = environment.reset(seed=0)
    assert observation.shape == setting.observe(rest, 0 * rest, 0).shape == (14 + 21,)
    np.testing.assert_array_equal(
        info["error"], (observation[:7] - rest) - (observation[14:21] - rest)
    )
    assert info["time"] == 0.0
    assert environment.step(np.zeros(7))[-1]["time"] == 1e-3
    r, dr, ddr = setting.reference(300).reshape(3, 7)
    swing = (r - rest) / np.sin(0.3)
    assert 0.05 < swing.min() < swing.max() <= 0.5 * (1 + 1e-12)
    np.testing.assert_allclose(dr, swing * np.cos(0.3))
    np.testing.assert_allclose(ddr, rest - r)
    low, high = np.array([bounds[1:] for bounds in arm.ranges]).T
    assert np.all((low < rest - swing) & (rest + swing < high))
    assert tasks.reward(*setting.errors(r, dr, 300)) == pytest.approx(1.0)
    assert tasks.reward(*setting.errors(r + np.eye(7)[6], dr, 300)) < 0.9
    assert tasks.reward(*setting.errors(r, dr + 5.0 * np.eye(7)[6], 300)) < 0.99
    sines = [smc.Sine(0.1 * i, 2.0, about="goal") for i in range(7)]
    own = PlantEnv(arm, "track", {"reference": sines, "duration": 0.5}).setting.reference(100)
    np.testing.assert_allclose(own[:7], rest + 0.1 * np.arange(7) * np.sin(0.2))


# what gymnasium has

# drawing takes most of the time
DRAWN = [
    ("duffing", "regulate"),
    ("cart_pole", "swing_up"),
]


@pytest.mark.parametrize(("plant", "task"), one_of_each(2))
def test_gymnasium_s_own_checker_passes(plant, task):
    from gymnasium.utils.env_checker import check_env

    if (plant, task) in DRAWN and not gl.missing_renderer():
        drawn = "rgb_array"
    else:
        drawn = None
    environment = gymnasium.make(
        f"smc_mujoco:smc/{registration.camel(plant)}-v0", task=task, render_mode=drawn
    )
    check_env(environment.unwrapped, skip_render_check=drawn is None)


def test_environments_step_in_processes_of_their_own():
    workers = gymnasium.make_vec(
        "smc_mujoco:Duffing-v0", num_envs=2, vectorization_mode="async", changes=SHORT
    )
    try:
        here = gymnasium.make_vec(
            "smc_mujoco:Duffing-v0", num_envs=2, vectorization_mode="sync", changes=SHORT
        )
        assert np.array_equal(workers.reset(seed=0)[0], here.reset(seed=0)[0])
        assert np.array_equal(workers.step([[1.0], [0.0]])[0], here.step([[1.0], [0.0]])[0])
    finally:
        workers.close()


@pytest.mark.skipif(bool(gl.missing_renderer()), reason=str(gl.missing_renderer()))
def test_it_is_seen():
    single = gymnasium.make("smc_mujoco:Duffing-v0", render_mode="rgb_array")
    single.reset(seed=0)
    assert single.render().std() > 5.0
    assert copy.deepcopy(single.unwrapped).render().std() > 5.0  # with its own renderer
    single.close()


# how gymnasium finds them


def fresh(code, **environment):
    return python("-c", code, **environment).stdout.split()


MADE = "gymnasium.make('smc_mujoco:Duffing-v0'), gymnasium.make('smc_mujoco:smc/Duffing-v0')"
RELOADED = """
import importlib.util, sys
import smc_mujoco
importlib.reload(smc_mujoco)
assert importlib.util.find_spec("gymnasium") is not None and "gymnasium" not in sys.modules
import gymnasium
assert "smc/CartPole-v0" in gymnasium.registry
"""


@pytest.mark.parametrize(
    "imports", ["import gymnasium", RELOADED], ids=["gymnasium first", "gymnasium last"]
)
def test_an_id_is_found_whichever_package_is_imported_first(imports):
    code = f"{imports}\nprint(*[environment.reset(seed=0)[0].shape[0] for environment in ({MADE})])"
    assert fresh(code) == ["2", "2"]


def test_every_plant_has_an_id_and_gymnasium_keeps_its_own():
    ids = set()
    for name, spec in gymnasium.registry.items():
        if "smc_mujoco" in str(spec.entry_point):
            ids.add(name)
    assert {f"smc/{registration.camel(plant)}-v0" for plant in smc.plants()} <= ids
    assert {"Duffing-v0", "VanDerPol-v0", "PendulumNetwork-v0", "OverheadCrane-v0"} <= ids
    assert not {"CartPole-v0", "InvertedPendulum-v0"} & ids
    assert "gymnasium" in gymnasium.spec("CartPole-v0").entry_point


def test_copies_end_after_max_episode_steps():
    many = gymnasium.make_vec("smc_mujoco:Duffing-v0", num_envs=2, max_episode_steps=7)
    many.reset(seed=0)
    action = many.action_space.sample().astype(np.float32)  # as learners have it
    assert next(k for k in range(1, 50) if np.any(many.step(action)[3])) == 7


# errors


def test_bad_input_is_one_sentence(refused):
    many = BatchEnv("duffing", 2)
    many.reset(seed=0)
    of_two_joints = smc.envs.agent("classical", PlantEnv("double_pendulum"))
    for word, make in {
        "'human'": lambda: PlantEnv("duffing", render_mode="human"),
        "'x1'": lambda: PlantEnv("duffing").reset(options={"x1": 0.0}),
        "shape (1,)": lambda: PlantEnv("duffing").step([0.0, 0.0]),
        "'left'": lambda: PlantEnv("duffing").step("left"),
        "shape (2, 1)": lambda: many.step([[1e300], [np.inf]]),
        "seed has 1": lambda: many.reset(seed=[1]),
        "'rgb_array'": lambda: BatchEnv("duffing", 2, render_mode="rgb_array"),
        "reset": lambda: BatchEnv("duffing", 2).step([[0.0], [0.0]]),
        "BatchEnv": lambda: smc.envs.agent("classical", many),
        "observation": lambda: of_two_joints(np.zeros(3)),
    }.items():
        refused(make, word)
