"""A quick search: coarse evaluations, a wide draw in the first run, and the best three decided."""

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.tuning import quick_search, search
from smc_mujoco.analysis.tuning.evaluator import Evaluator
from smc_mujoco.analysis.tuning.objective import Objective

MASS = """<mujoco model="mass"><worldbody><body><joint name="slide" type="slide" axis="1 0 0"/>
<geom size=".1" mass="2" contype="0" conaffinity="0"/></body></worldbody><actuator>
<motor joint="slide" ctrlrange="-9 9"/></actuator></mujoco>"""
GOAL = Objective(conditions=("nominal", "coulomb"), duration=0.4)


@pytest.fixture(scope="module")
def task():
    plant = smc.plant_from(MASS, ["slide"])
    return search.task_of(plant, smc.law("pid"), GOAL, 16, 0, 1)._replace(quick=True)


def test_all_but_the_last_three_evaluations_take_one_step_a_period(task, monkeypatch):
    ran = []
    evaluate = Evaluator.__call__

    def seen(self, candidates):
        how = {(case.resolved.integrator, case.resolved.physics_step) for case in self.cases}
        ran.append((len(self.cases), how, len(candidates)))
        return evaluate(self, candidates)

    monkeypatch.setattr(Evaluator, "__call__", seen)
    search_result = task.search(0, "", lambda count: None)
    wide, narrow, *later, decided = ran
    usual = task.size // 8
    assert wide[::2] == (1, quick_search.WIDER * usual), "the hypercube in the first run alone"
    assert narrow[::2] == (2, 3)
    assert decided[0] == 2
    coarse = set().union(*(how for _, how, _ in (wide, narrow, *later)))
    assert {step for _, step in coarse} == {1e-3}
    assert {integrator for integrator, _ in coarse} <= {"Euler", "implicitfast"}
    assert {case.resolved.integrator for case in task.cases(0)} == {"RK4"}
    assert not coarse & decided[1]
    assert decided[2] == quick_search.DECIDED == len(search_result.history)
    steps = sum(size for runs, _, size in ran if runs == 2) + quick_search.WIDER * usual // 2
    assert search_result.evaluations == steps <= task.size + quick_search.DECIDED


def test_its_j_is_that_of_the_runs_of_a_scenario(task):
    search_result = task.search(0, "", lambda count: None)
    law = search.with_gains(task.law, tuple(task.box), search_result.best.gains)
    cases = task.goal.scenarios(task.plant, law, 0, 0)
    again = task.goal.evaluation(cases[0], smc.run(cases)).objective
    assert search_result.best.objective == pytest.approx(again, rel=1e-9)
    assert search_result.best.objective == min(tried.objective for tried in search_result.history)


ARM = """<mujoco><worldbody><geom type="plane" size="1 1 .1"/><body pos="0 0 .6">
<joint name="j" axis="0 1 0" frictionloss=".05"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass=".4"/></body></worldbody>
<actuator><motor joint="j" ctrlrange="-4 4"/></actuator></mujoco>"""


def test_the_last_three_have_twice_the_step_of_a_scenario_under_rk4(monkeypatch):
    arm = smc.plant_from(ARM, ["j"], name="arm")
    task = search.task_of(arm, smc.law("pid"), GOAL, 16, 0, 1)._replace(quick=True)
    steps = []
    evaluate = Evaluator.__call__

    def seen(self, candidates):
        steps.append([case.resolved.physics_step for case in self.cases])
        return evaluate(self, candidates)

    monkeypatch.setattr(Evaluator, "__call__", seen)
    task.search(0, "", lambda count: None)
    usual = [case.resolved.physics_step for case in task.cases(0)]
    assert max(usual) < GOAL.control_period
    assert steps[-1] == [2.0 * step for step in usual]
    assert {step for cases in steps[:-1] for step in cases} == {GOAL.control_period}


def test_another_draw_is_another_search_on_the_same_runs(task, tmp_path):
    first, again = (task.search(1, "", lambda count: None, draw) for draw in (0, 1))
    assert first == task.search(1, "", lambda count: None)
    assert not {tried.gains for tried in first.history} & {tried.gains for tried in again.history}
    stems = {task.file(1, tmp_path, draw).stem for draw in (0, 1)}
    assert len(stems) == 2
    assert np.isfinite(again.best.objective)


@pytest.mark.quick
@pytest.mark.parametrize("last", [0, 3, 6])
def test_a_search_whose_time_is_over_ends_with_the_best_set_so_far(last):
    """After so many reports; before the first evaluation it has none."""
    task = search.task_of("duffing", smc.law("pid"), GOAL, 16, 0, 1)._replace(quick=True)
    reports = []

    def report(count):
        reports.append(count)
        if len(reports) > last:
            raise quick_search.OutOfTime

    result = task.search(0, "", report)
    unlimited = task.search(0, "", lambda count: None)
    assert result.evaluations <= unlimited.evaluations
    assert len(result.history) == 1
    assert result.best.objective >= 0.5 * unlimited.best.objective
