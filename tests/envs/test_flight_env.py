"""A free body as a gymnasium environment: it moves as in smc.run, and gymnasium's own checker
passes.
"""

import copy
import pickle

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import smc_mujoco as smc

gymnasium = pytest.importorskip(
    "gymnasium", reason="gymnasium is not installed: pip install 'smc-mujoco[rl]'"
)

from gymnasium.utils.env_checker import check_env  # noqa: E402

from smc_mujoco.envs.flight_env import FlightEnv  # noqa: E402
from smc_mujoco.envs.gymnasium_env import PlantEnv  # noqa: E402
from smc_mujoco.envs.vector_env import BatchEnv  # noqa: E402

START = {
    "x0": (0.1, 0.2, 0.9, 0.3, -0.2, 0.4),
    "v0": (0.5, -0.3, 0.2, 1.0, -2.0, 3.0),
}


@pytest.mark.filterwarnings("ignore")
def test_gymnasiums_own_checker_passes():
    for task in ("regulate", "track"):
        environment = gymnasium.make("smc_mujoco:smc/Quadrotor-v0", task=task)
        check_env(environment.unwrapped, skip_render_check=True)
        assert environment.action_space.shape == (4,)


def test_thrusts_of_a_run_as_actions_give_its_motion():
    path = [smc.Sine(0.5, 1.0), *[smc.Constant(value) for value in (0.0, 1.0, 0.0, 0.0, 0.3)]]
    common = {
        "duration": 1.0,
        "control_period": 2e-3,
        "reference": path,
        "mismatch": {"Dx": 2.0},
    } | START
    trace = smc.run(smc.Scenario(plant="quadrotor", law="geometric", **common))
    environment = FlightEnv("quadrotor", "track", common)
    observation, info, reward = *environment.reset(options=START), 0.0
    for k, thrusts in enumerate(trace.applied[:-1, :4]):
        np.testing.assert_allclose(observation[:12], [*trace.x[k], *trace.v[k]], atol=1e-9)
        np.testing.assert_allclose(info["error"], trace.e[k], atol=1e-9)
        assert info["time"] == pytest.approx(trace.t[k])
        observation, reward, terminated, truncated, info = environment.step(thrusts / 0.06 - 1.0)
        assert (terminated, truncated) == (False, k == len(trace.t) - 2)
    assert np.abs(trace.e[:, :3]).max() > 0.1
    counted = [0, 1, 2, 5]
    e = info["error"][counted]
    w = observation[6:12] - observation[18:24]
    attitude = Rotation.from_rotvec(observation[15:18]) * Rotation.identity()
    w[3:] = observation[9:12] - (Rotation.from_rotvec(observation[3:6]).inv() * attitude).apply(
        observation[21:24]
    )
    rms = lambda values: np.sqrt(np.mean(values**2))  # noqa: E731
    expected = 10 ** -(rms(e) ** 2) * (4 + 10 ** -((rms(w[counted]) / 5) ** 2)) / 5
    assert reward == pytest.approx(expected, rel=1e-6)


@pytest.mark.quick
def test_episodes_begin_where_they_are_told_or_about_rest_and_end_with_a_state_that_is_lost():
    environment = FlightEnv("quadrotor", changes={"duration": 0.05})
    first, _ = environment.reset(seed=3)
    again, _ = environment.reset(seed=3)
    np.testing.assert_array_equal(first, again)
    assert np.all(np.abs(first[:6] - [0, 0, 1, 0, 0, 0]) <= [0.2, 0.2, 0.2, 0.0, 0.0, 0.4])
    environment.reset(options={"x0": (1e6 - 1.0, 0, 0, 0, 0, 0), "v0": (400.0, 0, 0, 0, 0, 0)})
    ends = [environment.step(np.ones(4)) for _ in range(5)]
    assert [end[2] for end in ends] == [False, False, True, True, True]
    observation, reward, _, _, info = ends[-1]
    assert np.isfinite(observation).all()
    assert reward == 0.0
    assert np.isnan(info["error"]).all()
    with pytest.raises(smc.ScenarioError, match="finite numbers, of shape"):
        environment.step(np.full(4, np.nan))


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
@pytest.mark.parametrize("steps", [0, 3])
def test_a_copy_flies_on_from_where_its_original_is(steps, copied):
    original = FlightEnv("quadrotor", "track", {"duration": 0.1})
    original.reset(seed=1)
    thrusts = np.random.default_rng(0).uniform(-1.0, 1.0, (steps + 3, 4))
    for action in thrusts[:steps]:
        original.step(action)
    copy_of_it = copied(original)
    for action in thrusts[steps:]:
        expected = original.step(action)
        np.testing.assert_array_equal(copy_of_it.step(action)[0], expected[0])
    np.testing.assert_array_equal(copy_of_it.reset()[0], original.reset()[0])


def test_what_is_no_free_body_or_wants_copies_is_told_where_to_go():
    with pytest.raises(smc.ScenarioError, match="duffing is no free body"):
        FlightEnv("duffing")
    for environment in (PlantEnv, BatchEnv):
        with pytest.raises(smc.ScenarioError, match=r"free body: .*gymnasium\.make"):
            environment("quadrotor")
    with pytest.raises(smc.ScenarioError, match=r"environment is .*: give one of"):
        smc.envs.agent("geometric", FlightEnv("quadrotor"))
    with pytest.raises(smc.ScenarioError, match="task 'swing_up' is not for quadrotor"):
        FlightEnv("quadrotor", "swing_up")
