"""MuJoCo Warp's worlds against MuJoCo: on its processor device, and what it is asked to run."""

import dataclasses
import importlib.util
import sys
import types

import numpy as np
import pytest
from analysis.test_engine_worlds import CONDITIONS, PLANTS
from helpers import mujoco_worlds
from helpers.machines import PENDULUM

import smc_mujoco as smc
from smc_mujoco.analysis import engine
from smc_mujoco.analysis.engine import choice, worlds
from smc_mujoco.analysis.engine.form import FAILURE, SCORES
from smc_mujoco.analysis.engine.group import FormGroup
from smc_mujoco.analysis.engine.scored_runs import ScoredRuns
from smc_mujoco.identification import ensemble
from smc_mujoco.metrics import catalogue
from smc_mujoco.robustness.worst_case_search import BATCH_MEMBERS
from smc_mujoco.simulation import state

with_warp = pytest.mark.skipif(
    importlib.util.find_spec("mujoco_warp") is None,
    reason="mujoco-warp is missing: pip install 'smc-mujoco[gpu]'",
)
AGREES = 1e-5  # relative: MuJoCo Warp computes in single precision
METRICS = ("itae", "tv", "max_u", "rms_error", "ultimate_bound")
HINGE = """
<mujoco model="hinge">
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <body pos="0 0 1"><joint name="hinge" axis="0 1 0"/><geom type="capsule" size=".02" fromto="0 0 0 0 0 -.5" mass="1"/></body>
  </worldbody>
  <actuator><motor joint="hinge" ctrlrange="-20 20"/></actuator>
</mujoco>
"""
FLOOR = """
<mujoco model="floor">
  <worldbody>
    <geom type="plane" size="1 1 .1"/>
    <body pos="0 0 .1">
      <joint name="slide" type="slide" axis="0 0 1" range="-1 1"/>
      <geom type="box" size=".1 .1 .1" mass="1"/>
    </body>
  </worldbody>
  <actuator><motor joint="slide" ctrlrange="-20 20"/></actuator>
</mujoco>
"""


def hinge():
    return smc.plant_from(HINGE, {"hinge": smc.Channel(x0=0.4)})


def cases_of(plant, law, conditions, duration, seeds=2):
    cases = []
    for seed in range(seeds):
        x0 = tuple(x + 0.05 - 0.01 * seed for x in plant.x0)
        fields = {"mismatch": {"m": 1.0 + 0.1 * seed}, "seed": seed, "x0": x0}
        for name in conditions:
            fields |= CONDITIONS[name]
        cases.append(smc.Scenario(plant=plant, law=smc.law(law), duration=duration, **fields))
    return cases


def check(cases):
    """Compare scores of worlds on MuJoCo Warp's processor device with those of runs."""
    from smc_mujoco.analysis.engine import warp

    assert warp.why_not(cases[0]) == ""
    world_group = worlds.WorldGroup(cases, METRICS)
    scores_found = warp.run_rows(world_group.runs, world_group.rows, "cpu")
    assert (scores_found[:, FAILURE] == state.FINE).all()
    for scores, trace in zip(scores_found, smc.run(cases), strict=True):
        expected = [getattr(catalogue, name)(trace) for name in METRICS]
        np.testing.assert_allclose(scores[SCORES:], expected, rtol=AGREES)


MACHINES = {
    "hinge": (hinge, "super_twisting", ("noise", "sine", "lag"), 0.1),
    "wall": (PLANTS["wall"], "pid", ("noise", "delay", "encoder", "friction"), 0.1),
    "panda": (PLANTS["panda"], "pid", ("noise", "missed"), 0.05),
}


@with_warp
@pytest.mark.slow
@pytest.mark.parametrize("machine", MACHINES)
def test_worlds_of_mujoco_warp_have_other_masses_and_the_scores_of_runs(machine):
    plant, law, conditions, duration = MACHINES[machine]
    check(cases_of(plant(), law, conditions, duration))


@with_warp
@pytest.mark.slow
def test_contacts_that_do_not_fit_are_run_again_with_more_room(monkeypatch, refused):
    """A box stands on its four corners, and there is room for one contact."""
    from smc_mujoco.analysis.engine import warp

    plant = smc.plant_from(FLOOR, ["slide"])
    world_group = worlds.WorldGroup([smc.Scenario(plant=plant, law="pid", duration=0.02)], METRICS)
    expected = warp.run_rows(world_group.runs, world_group.rows, "cpu")
    monkeypatch.setattr(warp, "CONTACTS", 1)
    np.testing.assert_array_equal(
        warp.run_rows(world_group.runs, world_group.rows, "cpu"), expected
    )
    monkeypatch.setattr(warp, "MOST_CONTACTS", 2)
    refused(
        lambda: warp.run_rows(world_group.runs, world_group.rows, "cpu"),
        "floor",
        "2 a world",
        "'cpu'",
    )


@with_warp
def test_a_model_that_mujoco_warp_cannot_run_is_told():
    from smc_mujoco.analysis.engine import warp

    text = HINGE.replace("<default>", '<option solver="PGS"/><default>')
    plant = smc.plant_from(text, ["hinge"])
    assert "PGS" in warp.why_not(smc.Scenario(plant=plant, law="pid", duration=0.1))


@pytest.fixture
def on_card(monkeypatch):
    """Worlds are MuJoCo's, a few are worth a card, and there is a card."""
    card = types.SimpleNamespace(check_device=lambda: None)
    monkeypatch.setattr(engine, "gpu", card, raising=False)
    monkeypatch.setattr(choice, "_of_model", lambda scenario: "")
    monkeypatch.setattr(worlds.WorldGroup, "least", 3)

    def run(group, rows, threads=None, device="cuda"):
        assert device == "cuda"
        return mujoco_worlds.run_rows(group, rows)

    monkeypatch.setattr(worlds.WorldGroup, "run", run)


def test_own_machines_are_scored_in_worlds_and_the_rest_by_mujoco(on_card):
    alike = cases_of(hinge(), "pid", (), 0.1, seeds=3)
    jump = smc.Scenario(
        plant=hinge(), law=smc.law("pid"), duration=0.1, jump=smc.Jump(0.05, {"m": 2.0})
    )
    few = cases_of(PLANTS["cart"](), "pid", (), 0.1)
    runs = ScoredRuns({"itae": catalogue.itae}, "cuda", worlds=True)
    scenarios = [alike[0], jump, *alike[1:], *few]
    scored = runs.scored(scenarios)
    for (values, failed), trace in zip(scored, smc.run(scenarios), strict=True):
        assert failed is None
        assert values == [pytest.approx(catalogue.itae(trace), rel=1e-12)]
    sentence = runs.checked()
    assert "MuJoCo repeated 3 runs of another engine: 0 failed" in sentence
    assert "MuJoCo made 1 runs: its parameters jump" in sentence
    assert "MuJoCo made 2 runs: they are fewer than 3 of one model" in sentence


def test_a_map_of_an_own_machine_is_made_in_worlds(on_card, monkeypatch):
    from smc_mujoco.robustness.region_of_attraction import basin_of

    base = smc.Scenario(plant=hinge(), law=smc.law("pid"), duration=0.3)
    axes = (0.0, 0.3), (0.0, 1.0)
    on_device = basin_of(base, *axes, device="cuda")
    expected = basin_of(base, *axes)
    assert on_device.outcome.tolist() == expected.outcome.tolist()
    assert "MuJoCo repeated 4 states, 0" in on_device.checked
    assert expected.checked == ""


def test_random_members_of_a_worst_case_are_run_in_worlds(on_card, monkeypatch):
    monkeypatch.setattr(worlds.WorldGroup, "least", BATCH_MEMBERS + 1)
    base = smc.Scenario(plant=hinge(), law=smc.law("pid"), duration=0.1)
    # forces with a slope are signals of one kind, and their loop is compiled once
    within = smc.Uncertainty(disturbance=0.5, slope=50.0, parameters={"m": (0.7, 1.3)})
    on_device = smc.worst_case(base, within=within, budget=40, device="cuda")
    expected = smc.worst_case(base, within=within, budget=40)
    assert on_device.value == expected.value
    assert on_device.scenario == expected.scenario
    assert on_device.median == pytest.approx(expected.median, rel=1e-12)
    assert "MuJoCo repeated 20 runs of another engine: 0 failed" in on_device.checked


def test_parameter_sets_of_an_identified_machine_are_worlds_of_one_model(on_card):
    def machine(values):
        return {"plant": hinge(), "mismatch": {"m": values.inertia / 0.1635}}

    rig = dataclasses.replace(PENDULUM, machine=machine)
    cases = ensemble.runs(rig, ["pid"], seeds=2, duration=0.1, starts=smc.starts(0.3))
    table = smc.score(cases, metrics=("itae",), device="cuda")
    expected = smc.score(cases, metrics=("itae",))
    np.testing.assert_allclose(table.column("itae"), expected.column("itae"), rtol=1e-12)
    assert "MuJoCo made" not in str(table)


@pytest.mark.quick
def test_the_plant_decides_which_engine_runs_it(on_card):
    equation = smc.Scenario(plant="duffing", law="pid", duration=0.1)
    own = smc.Scenario(plant=hinge(), law="pid", duration=0.1)
    assert choice.chosen(equation, (), "cuda")[0] is FormGroup
    assert choice.chosen(own, (), "cuda")[0] is worlds.WorldGroup
    assert choice.chosen(own, (), "cuda", many=False)[0] is None
    assert choice.chosen(own, (), "cpu")[0] is None


def test_a_card_without_mujoco_warp_says_what_to_install(monkeypatch, refused):
    monkeypatch.setitem(sys.modules, "mujoco_warp", None)
    monkeypatch.delitem(sys.modules, "smc_mujoco.analysis.engine.warp", raising=False)
    monkeypatch.delattr(engine, "warp", raising=False)
    own = smc.Scenario(plant=hinge(), law="pid", duration=0.1)
    refused(lambda: choice.chosen(own, (), "cuda"), "pip install 'smc-mujoco[gpu]'")
