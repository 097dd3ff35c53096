"""Scores of arms: the tip's path and force, and every metric of each joint by itself."""

import mujoco
import numpy as np
import pytest
from helpers import arms

import smc_mujoco as smc
from smc_mujoco.draw.joints import mark_losses
from smc_mujoco.metrics import tip
from smc_mujoco.studies import arms as tasks


@pytest.fixture(scope="module")
def trace():
    law = smc.law("computed_torque_sliding", c=8.0)
    return smc.run(smc.Scenario(plant=arms.arm(), law=law, reference=smc.Sine(0.3, 4.0), x0=0.2, duration=0.5))


@pytest.fixture(scope="module")
def pressed():
    """The panda presses on a slippery wall with 20 N, without friction in its joints."""
    law, path = smc.law("hybrid_sliding", force=20.0, c=15.0, k=40.0, width=0.2), tasks.wall_path()
    start = tuple(signal.values[0] for signal in path)
    wall = smc.Contact("wall", friction=0.0)
    return smc.run(smc.Scenario(plant="panda", law=law, reference=path, x0=start, contact=wall, duration=0.9))


def test_tip_scores_are_of_the_distance_in_space(trace):
    model = arms.arm().load()
    data = mujoco.MjData(model)

    def places(positions):
        found = []
        for x in positions:
            data.qpos[[2, 0, 1]] = x
            mujoco.mj_forward(model, data)
            found.append(data.site("tip").xpos.copy())
        return np.array(found)

    away = np.linalg.norm(places(trace.x) - places(trace.r), axis=1)
    found = smc.tip_scores(trace)
    expected = {"max_error": away.max(), "rms_error": np.sqrt(np.mean(away**2)), "last_error": away[-1]}
    assert found == pytest.approx(expected, rel=1e-12)
    assert away.max() > 0.05


def test_joint_scores_are_each_joints_own(trace):
    found = smc.joint_scores(trace)
    assert list(found) == ["reach", "turn", "lift"]
    for i, scores in enumerate(found.values()):
        power = np.abs(trace.force[:, i] * trace.v[:, i])
        assert scores["max_u"] == np.abs(trace.u[:, i]).max()
        assert scores["ultimate_bound"] <= smc.scores(trace)["driven m" if i == 0 else "driven rad"]["ultimate_bound"]
        assert scores["peak_power"] == power.max()
        assert scores["work"] == pytest.approx(np.sum((power[1:] + power[:-1]) / 2 * np.diff(trace.t)))
    assert tip.worst_joint(trace, "max_u") == max(
        ((name, scores["max_u"]) for name, scores in found.items()), key=lambda pair: pair[1]
    )


def test_contact_forces_are_those_that_the_joints_feel(pressed):
    """Without friction the reactions of the joints are -A' f, with A the tip's Jacobian along the wall's normal."""
    found, plant = tip.contacts(pressed), pressed.scenario.plant
    for k in (400, 600, 900):
        A = plant.nominal.jacobian(pressed.x[k], plant.values({}), plant.tip)[0]
        felt = -(A @ pressed.reaction[k]) / (A @ A)
        np.testing.assert_allclose(pressed.reaction[k], -A * felt, atol=0.05)
        assert found.force[k] == pytest.approx(felt, rel=5e-3)


def test_hybrid_law_presses_with_its_force_while_the_tip_slides(pressed):
    scores = smc.tip_scores(pressed)
    assert abs(scores["force_error"]) < 1.0
    assert scores["mean_force"] == pytest.approx(20.0 * (1.0 + scores["force_error"] / 100.0))
    assert scores["touching"] == 100.0
    assert 0.0 < scores["depth"] < 1e-3
    assert scores["max_error"] < 2e-3
    assert np.ptp(tip.tip_path(pressed.scenario.plant, pressed.x)[:, 1]) > 0.02
    assert smc.tip_scores(pressed, force=10.0)["force_error"] == pytest.approx(100.0, abs=2.0)


def test_rubbing_on_the_wall_does_not_change_the_force():
    """Its torque is in the directions of sliding, where the sliding mode answers it, and presses no more for it."""
    path = tasks.wall_path()
    law, start = smc.law("hybrid_sliding", force=20.0, c=15.0, k=40.0, width=0.2), tuple(one.values[0] for one in path)
    rough = smc.Scenario(plant="panda", law=law, reference=path, x0=start, contact="wall", duration=1.4)
    late = tip.contacts(smc.run(rough)).force[-400:]
    assert late.mean() == pytest.approx(20.0, rel=0.02)


def test_a_lost_contact_is_marked():
    class Axes:
        def fill_between(self, t, low, high, where, **_):
            self.marked = where

        def get_xaxis_transform(self):
            return None

    axes = Axes()
    mark_losses(axes, np.arange(6.0), np.array([0.0, 3.0, 0.0, 0.0, 2.0, 0.0]), "k", 0)  # pyright: ignore
    assert axes.marked == [False, False, True, True, False, True]


def test_bad_input_is_one_sentence(trace):
    plain = smc.run(smc.Scenario(plant="duffing", law="classical", duration=0.01))
    with pytest.raises(smc.ScenarioError, match=r"duffing has no tip: make it with smc\.plant_from"):
        smc.tip_scores(plain)
    with pytest.raises(smc.ScenarioError, match="has no contact: give contact="):
        tip.contacts(trace)
    with pytest.raises(smc.ScenarioError, match=r"unknown site of arm\.xml 'tp': did you mean 'tip'"):
        smc.plant_from(arms.ARM, channels=["reach"], tip="tp")
