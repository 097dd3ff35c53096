"""What a scene prints is the same at half the physics step and from a nudged start, or it is
marked.
"""

import dataclasses
import math

import arms
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.differ import differ
from smc_mujoco.analysis.step_halving import MARK, halved, nudged
from smc_mujoco.cli import run_scene as show
from smc_mujoco.cli import tables
from smc_mujoco.cli.console import Terminal

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    ("values", "least", "marked"),
    [
        ([1.0, 1.03, 0.99], 0.0, False),
        ([1.0, 1.06], 0.0, True),
        ([1.0, 0.9], 0.0, True),
        ([1e-9, 1e-7], 1e-6, False),  # below what the problem can show
        ([1.0, math.inf], 0.0, True),
        ([math.inf, math.inf], 0.0, False),
        ([math.nan, 1.0], 0.0, True),  # a limit cycle that only one of the runs has
        ([math.nan, math.nan], 0.0, False),
        ([1.0, -1.0, 1.0], 0.0, True),
        ([-1.0, -1.04], 0.0, False),
        ([-0.5, 0.5], 1.0, False),
        ([0.0, 0.0], 0.0, False),
    ],
)
def test_scores_are_apart_by_more_than_five_percent_of_what_matters(values, least, marked):
    assert differ(values, least) is marked


def test_a_run_at_half_the_step_and_from_a_nudged_start_is_the_same_otherwise():
    scenario = smc.Scenario(
        plant="duffing",
        law=smc.law("classical"),
        noise=smc.Noise(position=0.01),
        x0=1.0,
    )
    half = halved(scenario)
    moved = nudged(scenario)
    assert half == dataclasses.replace(scenario, physics_step=5e-4)
    assert moved.x0 == (1.0 + 1e-9,)
    assert dataclasses.replace(moved, x0=1.0) == scenario


def test_what_starts_at_its_goal_is_not_nudged_off_it():
    rest = smc.plant("quadrotor").rest
    flight = smc.Scenario(plant="quadrotor", law="geometric", x0=(rest[0] + 1.0, *rest[1:]))
    start = nudged(flight).x0
    assert start is not None
    assert start[1:] == rest[1:]


def test_a_score_that_changes_is_marked_with_its_range_and_others_are_not():
    stuck = smc.Scenario(plant="inverted_pendulum", law=smc.law("adaptive"), duration=1.0)
    trace = smc.run(stuck)
    larger = dataclasses.replace(trace, x=1.5 * trace.x)
    (table,) = tables.scores(
        "t", {"a": trace, "b": trace}, {"a": [trace, larger], "b": [trace, trace]}
    )
    lines = cells(table)
    assert MARK in lines[0]
    assert MARK not in lines[1]
    bound = smc.score(trace)["ultimate_bound"]
    assert f"(..{tables.number(1.5 * bound)}" in lines[0]
    assert "half the physics step" in " ".join(table.notes)


@pytest.mark.parametrize("integrator", ["RK4", "implicitfast"])
def test_a_score_that_changes_by_less_is_marked_without_rk4_alone(integrator):
    trace = smc.run(
        smc.Scenario(
            plant="duffing",
            law=smc.law("adaptive"),
            integrator=integrator,
            duration=1.0,
        )
    )
    larger = dataclasses.replace(trace, x=1.03 * trace.x)
    (table,) = tables.scores("t", {"a": trace}, {"a": [larger, trace]})
    assert any(MARK in cell for cell in cells(table)) == (integrator != "RK4")
    (table,) = tables.scores("t", {"a": trace}, {"a": [trace, larger]})  # a nudged start
    for cell in cells(table):
        assert MARK not in cell


def cells(table) -> list[str]:
    """The rows of a table as text."""
    return [" ".join(getattr(cell, "text", cell) for cell in row) for row in table.rows]


def test_a_run_that_fails_at_half_the_step_or_only_there_does_not_is_marked():
    fine = smc.run(smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.1))
    lost = dataclasses.replace(fine, diverged_at=0.05)
    runs = {"a": fine, "b": lost, "c": lost}
    again = {
        "a": [fine, lost],
        "b": [fine, fine],
        "c": [lost, lost],
    }
    (table,) = tables.scores("t", runs, again)
    rate = tables.number(smc.score(fine)["tv_rate"])
    for said in (
        cells(table),
        cells(*tables.answers(["tv_rate"], {"nominal": runs}, {"nominal": again})),
    ):
        assert [f"{rate}{MARK} (..failed)" in row for row in said] == [True, True, False]
        assert "failed" in said[2]


def arm(duration: float) -> smc.Scenario:
    return dataclasses.replace(
        arms.scenario("sway", arms.gained("passivity_based")), duration=duration
    )


def test_every_number_of_a_scene_is_compared_with_its_runs_again(monkeypatch, tmp_path):
    """Whatever tables print, a scene hands them the runs at half the step: scores, tips and
    answers.
    """
    runs = {"wall": {"a": arm(0.01)}}
    scene = smc.Scene(
        title="t",
        conditions=runs,
        answers=("tv_rate",),
        answer=lambda outcome: "said",
    )
    step_lists = []
    for name in ("scores", "tips"):
        monkeypatch.setattr(tables, name, lambda title, runs, again: step_lists.append(again) or [])
    monkeypatch.setattr(
        tables, "answers", lambda names, runs, again: step_lists.append(again["wall"]) or []
    )
    monkeypatch.setattr(show, "figures", lambda *_: [])
    show.perform(scene, tmp_path, False, 1, Terminal(), (), "")
    steps = [[trace.scenario.resolved.physics_step for trace in again["a"]] for again in step_lists]
    step = runs["wall"]["a"].resolved.physics_step
    assert steps == [[step / 2, step]] * 3
