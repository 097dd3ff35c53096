"""What `smc.view` promises without its page: the runs on screen are those of smc.run, and a saved
session repeats.
"""

import ast
import dataclasses

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.draw.session import Session, laws_of
from smc_mujoco.studies import scene

DUFFING = smc.Scenario(plant="duffing", law=smc.law("observer_free", lam=6.0, k1=3.0), duration=0.4)
HARD = smc.Scenario(
    plant="inverted_pendulum",
    law=smc.law("super_twisting"),
    duration=0.3,
    noise=smc.Noise(0.001, 0.01),
    input_delay=0.005,
    friction=smc.Coulomb(0.05),
    jump=smc.Jump(time=0.15, factors={"m": 1.5}),
    seed=3,
)
NETWORK = smc.Scenario(
    plant=smc.plant("pendulum_network", n=3), law=smc.law("classical"), duration=0.2
)
ARM = """<mujoco><worldbody><body name="arm"><joint name="shoulder" damping="0.1"/><geom
  size="0.05" pos="0 0 -0.5"/>
  </body></worldbody><actuator><motor joint="shoulder" ctrllimited="true"
    ctrlrange="-9 9"/></actuator>
  <keyframe><key name="up" qpos="3" qvel="0.5"/></keyframe></mujoco>"""


def watch(session):
    """Watch to the end in frames of uneven length."""
    while session.sample < session.samples:
        session.advance(0.0171)


def same(session, scenarios):
    """The session's samples are those of smc.run, to the bit."""
    for run, scenario in enumerate(scenarios):
        trace = smc.run(scenario)
        log = session.log(run)
        assert len(log) == scenario.samples
        for name in ("x", "v", "u", "s", "d"):
            assert np.array_equal(log[name], getattr(trace, name)[: len(log)]), name


@pytest.mark.quick
@pytest.mark.parametrize("scenario", [DUFFING, HARD, NETWORK], ids=lambda s: s.plant.name)
def test_a_session_is_the_run_of_its_scenario(scenario):
    session = Session([scenario, dataclasses.replace(scenario, seed=5)])
    watch(session)
    same(session, session.scenarios)


def test_a_saved_session_repeats_to_the_bit(tmp_path):
    session = Session([HARD])
    session.move(0, session.sliders[0]["k1"], 5.0)
    session.move(0, session.sliders[0]["mass, factor"], 1.2)
    session.advance(0.1)
    session.push("pendulum", np.array([2.0, 0.0, 0.0]))
    assert not session.message
    assert session.time == pytest.approx(0.1)
    watch(session)
    path = session.save(tmp_path / "view.py")
    (saved,) = scene.read_scene(path).conditions["view"].values()
    assert dict(saved.law.gains)["k1"] == 5.0
    same(session, [saved])


def test_a_push_acts_from_now_on():
    session = Session([DUFFING])
    session.advance(0.1)
    before = session.log(0)["x"].copy()
    session.push("cart", np.array([2.0, 0.0, 0.0]))
    assert np.array_equal(session.log(0)["x"], before)
    watch(session)
    assert not np.array_equal(session.log(0)["x"][:, 0], smc.run(DUFFING).x[:-1, 0])


def test_what_a_run_refuses_leaves_it_and_says_why():
    session = Session([DUFFING])
    session.take_law("geometric", 0)
    assert session.scenarios == (DUFFING,)
    assert "geometric" in session.message


def test_a_law_that_a_file_cannot_name_is_not_saved(tmp_path):
    @smc.law_function(gains={"k": 3.0})
    def mine(y, gains, memory):
        return -gains.k * y.e, y.e

    with pytest.raises(smc.ScenarioError, match="cannot be saved"):
        Session([dataclasses.replace(DUFFING, law=mine())]).save(tmp_path / "view.py")


@pytest.mark.parametrize("name", ['5" arm', "a\\", 'x"""+str(exit(3))+"""', "{runs}"])
def test_a_saved_file_holds_the_name_of_a_plant_as_text_and_replaces_no_other(name, tmp_path):
    """A quote in a name lost the session; the name of a file ran as code when it was opened."""
    plant = smc.plant_from(ARM, ["shoulder"], name=name)
    session = Session([smc.Scenario(plant=plant, law=smc.law("pid"), duration=0.1)])
    path = session.save(tmp_path / "view.py")
    text = path.read_text(encoding="utf-8")
    assert f"A view of {name}" in [
        node.value for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Constant)
    ]
    with pytest.raises(smc.ScenarioError, match=r"view.py exists"):
        session.save(path)
    assert path.read_text(encoding="utf-8") == text


def test_runs_of_other_lengths_are_refused():
    with pytest.raises(smc.ScenarioError, match="differ in control_period or duration"):
        Session([DUFFING, dataclasses.replace(DUFFING, duration=0.3)])


def test_an_arm_begins_with_a_law_of_many_joints_and_sliders_that_no_warning_meets(recwarn):
    plant = smc.plant("panda")
    run = smc.Scenario(plant=plant, law=laws_of(plant)[0], duration=0.1)
    session = Session([run])
    assert run.law.name in smc.laws(kind="joint")
    assert session.sliders[0]["friction, N or N m"].high == 0.5 * min(run.limits)
    assert not recwarn.list
