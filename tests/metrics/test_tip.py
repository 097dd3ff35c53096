"""Scores of arms: the tip's path and force, and every metric of each joint by itself."""

import dataclasses

import arms as tasks
import mujoco
import numpy as np
import pytest
from helpers import arms

import smc_mujoco as smc
from smc_mujoco.mechanisms.plant import Field
from smc_mujoco.metrics import tip


@pytest.fixture(scope="module")
def trace():
    law = smc.law("computed_torque_sliding", c=8.0)
    return smc.run(
        smc.Scenario(
            plant=arms.arm(),
            law=law,
            reference=smc.Sine(0.3, 4.0),
            x0=0.2,
            duration=0.5,
        )
    )


@pytest.fixture(scope="module")
def pressed():
    """The panda presses on a slippery wall with 20 N, without friction in its joints."""
    law = smc.law(
        "hybrid_sliding",
        force=20.0,
        c=15.0,
        k=40.0,
        width=0.2,
    )
    path = tasks.wall_path()
    start = tuple(signal.values[0] for signal in path)
    wall = smc.hardware.Contact("wall", friction=0.0)
    return smc.run(
        smc.Scenario(
            plant="panda",
            law=law,
            reference=path,
            x0=start,
            contact=wall,
            duration=0.9,
        )
    )


@pytest.mark.quick
def test_tip_scores_are_of_the_distance_in_space(trace):
    model = arms.arm().load()
    data = mujoco.MjData(model)

    def places(positions):
        scores = []
        for x in positions:
            data.qpos[[2, 0, 1]] = x
            mujoco.mj_forward(model, data)
            scores.append(data.site("tip").xpos.copy())
        return np.array(scores)

    away = np.linalg.norm(places(trace.x) - places(trace.r), axis=1)
    scores = smc.metrics.tip_scores(trace)
    expected = {
        "max_error": away.max(),
        "rms_error": np.sqrt(np.mean(away**2)),
        "last_error": away[-1],
    }
    assert scores == pytest.approx(expected, rel=1e-12)
    assert away.max() > 0.05


def test_the_actual_tip_is_that_of_the_true_plant(trace):
    """An arm whose last link's length is a parameter: a jump of it moves the actual tip, not the
    wanted one.
    """

    def fields(model, p):
        yield from trace.scenario.plant.fields(model, p)
        yield Field(
            "site_pos", model.site("tip").id, model.site_pos[model.site("tip").id] * p.share
        )

    plant = dataclasses.replace(
        trace.scenario.plant,
        fields=fields,
        parameters=dict(trace.scenario.plant.parameters) | {"share": 1.0},
    )
    longer = dataclasses.replace(trace.scenario, plant=plant, jump=smc.Jump(0.25, {"share": 1.1}))
    actual, reference = tip.tip_paths(dataclasses.replace(trace, scenario=longer))
    before, same = tip.tip_paths(trace)
    np.testing.assert_array_equal(reference, same)
    np.testing.assert_array_equal(actual[:250], before[:250])
    assert np.linalg.norm(actual - before, axis=1)[250:].min() > 0.01


def test_joint_scores_are_each_joints_own(trace):
    by_joint = smc.metrics.joint_scores(trace)
    assert list(by_joint) == ["reach", "turn", "lift"]
    for i, scores in enumerate(by_joint.values()):
        power = np.abs(trace.force[:, i] * trace.v[:, i])
        assert scores["max_u"] == np.abs(trace.u[:, i]).max()
        assert (
            scores["ultimate_bound"]
            <= smc.scores(trace)["driven m" if i == 0 else "driven rad"]["ultimate_bound"]
        )
        assert scores["peak_power"] == power.max()
        assert scores["work"] == pytest.approx(
            np.sum((power[1:] + power[:-1]) / 2 * np.diff(trace.t))
        )


def test_contact_forces_are_those_that_the_joints_feel(pressed):
    """Without friction the reactions of the joints are -A' f, with A the tip's Jacobian along the
    wall's normal.
    """
    contacts = tip.contacts(pressed)
    plant = pressed.scenario.plant
    for k in (400, 600, 900):
        A = plant.nominal.jacobian(pressed.x[k], plant.values({}), plant.tip)[0]
        felt = -(A @ pressed.reaction[k]) / (A @ A)
        np.testing.assert_allclose(pressed.reaction[k], -A * felt, atol=0.05)
        assert contacts.force[k] == pytest.approx(felt, rel=5e-3)
        # away from the wall
        np.testing.assert_allclose(contacts.push[k], [-contacts.force[k], 0.0, 0.0], atol=1e-6)


def test_contact_forces_are_those_under_the_runs_disturbance_and_motor():
    """A cart leans on a stop, whose reaction a trace has."""
    push = smc.signals.Push("cart", x=4.0, time=1.0, width=2.0)  # largest at 2 s; it is in d
    pushed = {"feedforward": smc.Constant(4.0), "disturbance": (smc.Constant(4.0), push)}
    motor = smc.DCMotor(inductance=0.0)
    cart = smc.Scenario(
        plant="duffing",
        law="none",
        contact="stops",
        x0=0.5,
        duration=2.0,
        actuator=motor,
        **pushed,
    )
    trace = smc.run(cart)
    assert tip.contacts(trace).force[-1] == pytest.approx(-trace.reaction[-1, 0], rel=0.01)
    assert trace.reaction[-1, 0] < -1.0


def test_contact_forces_know_a_push(pressed):
    """The wall is soft: at an unchanged depth its force hardly grows, by 1 % of the push."""
    push = smc.signals.Push("link7", x=30.0, time=0.5, width=0.1)
    more = tip.contacts(changed(pressed, disturbance=push)).force - tip.contacts(pressed).force
    assert np.abs(np.delete(more, np.s_[500:601])).max() < 1e-9
    assert np.all(more[502:599] > 0.0)
    assert more.max() <= 0.01 * 30.0


def changed(trace, **fields):
    """The trace as if its scenario had other fields."""
    return dataclasses.replace(trace, scenario=dataclasses.replace(trace.scenario, **fields))


def test_contact_forces_know_a_jump_between_two_samples(pressed):
    """From the first sample at or after it."""
    heavy = {"payload": 2.0}
    before = tip.contacts(pressed)
    after = tip.contacts(changed(pressed, mismatch=heavy))
    assert pressed.scenario.steps > 1
    for time in (0.5004, 0.501):
        contacts = tip.contacts(changed(pressed, jump=smc.Jump(time, heavy)))
        assert contacts.force[:501].tolist() == before.force[:501].tolist()
        assert contacts.force[501:].tolist() == after.force[501:].tolist()
    assert np.all(before.force[501:] != after.force[501:])


def test_contact_forces_end_with_a_failure(pressed, tmp_path, monkeypatch):
    """MuJoCo gets no NaN, so it writes no warning to its log."""
    monkeypatch.chdir(tmp_path)
    x = pressed.x.copy()
    applied = pressed.applied.copy()
    x[800:] = applied[800:] = np.nan
    force = tip.contacts(dataclasses.replace(pressed, x=x, applied=applied)).force
    assert not list(tmp_path.iterdir())
    assert force[:800].tolist() == tip.contacts(pressed).force[:800].tolist()
    assert np.isnan(force[800:]).all()


def test_contact_forces_are_unknown_behind_parts_with_a_state(pressed, refused):
    for part in (smc.Lag(0.01), smc.Backlash(0.01)):
        refused(
            lambda part=part: tip.contacts(changed(pressed, actuator=part)), type(part).__name__
        )
        assert set(smc.metrics.tip_scores(changed(pressed, actuator=part))) == {
            "max_error",
            "rms_error",
            "last_error",
        }


LIFTED = """
<mujoco><worldbody><geom name="floor" type="plane" size="3 3 1"/>
  <body name="lift"><joint name="lift" type="slide" axis="0 0 1" damping="1e9"/><geom size="0.05"/>
    <body pos="0 0 0.3"><joint name="turn" axis="0 1 0" damping="5"/>
      <geom type="capsule" size="0.03" fromto="0 0 0 0.5 0 0" mass="1"/><site name="tip" pos="0.5 0 0"/></body>
  </body></worldbody>
  <actuator><motor joint="turn"/></actuator>
  <keyframe><key name="up" qpos="0.7 0"/></keyframe></mujoco>
"""


def test_joints_without_a_channel_are_where_they_start():
    """A lift holds the arm 0.7 m higher than the model's qpos0, also for inverse kinematics."""
    plant = smc.plant_from(
        LIFTED,
        channels=["turn"],
        keyframe="up",
        name="lifted",
        tip="tip",
    )
    np.testing.assert_allclose(tip.tip_path(plant, np.zeros((1, 1))), [[0.5, 0.0, 1.0]])
    (turn,) = smc.signals.cartesian_path(
        plant, (0, 1), [(0.4, 0.0, 1.3)] * 2, site="tip", x0=[-0.5]
    )
    np.testing.assert_allclose(
        tip.tip_path(plant, np.array([[turn.values[-1]]])), [[0.4, 0.0, 1.3]], atol=1e-6
    )


def test_hybrid_law_presses_with_its_force_while_the_tip_slides(pressed):
    scores = smc.metrics.tip_scores(pressed)
    assert abs(scores["force_error"]) < 1.0
    assert scores["mean_force"] == pytest.approx(20.0 * (1.0 + scores["force_error"] / 100.0))
    late = tip.contacts(pressed).force[180:]  # t[180] is 0.18 s, a rounding below 0.2 * 0.9
    assert scores["mean_force"] == pytest.approx(late.mean(), rel=1e-12)
    assert scores["touching"] == 100.0
    assert 0.0 < scores["depth"] < 1e-3
    assert scores["max_error"] < 2e-3
    assert np.ptp(tip.tip_path(pressed.scenario.plant, pressed.x)[:, 1]) > 0.02
    assert smc.metrics.tip_scores(pressed, force=10.0)["force_error"] == pytest.approx(
        100.0, abs=2.0
    )


def test_bad_input_is_one_sentence(trace, pressed, refused):
    plain = smc.run(smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.01))
    refused(lambda: smc.metrics.tip_scores(plain), "duffing", "tip")
    refused(lambda: tip.contacts(trace), "contact=")
    refused(lambda: smc.score([trace]), "score")
    refused(lambda: smc.plant_from(arms.ARM, channels=["reach"], tip="tp"), "site", "'tip'")
