"""What the evaluator of J promises: the same J as the runs of `smc.run`, on the instances that are asked for."""

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.tuning.evaluator import objectives
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.metrics.catalogue import itae, tv
from smc_mujoco.simulation.grid import GRID_SEEDS

BRIEF = Objective(conditions=("nominal", "noise"), duration=0.5)


def objective_of(traces):
    """J by the metrics of `smc.run`'s traces, of runs under |u| <= 6 for 0.5 s."""
    return sum(itae(t) / np.abs(t.x[0]).sum() + 1e-3 * tv(t) / (6.0 * 0.5) for t in traces)


def test_objectives_are_those_of_each_law_on_its_own_unseen_instance():
    laws = [smc.law("classical", k=k) for k in (2.0, 4.0, 2.0)]
    found = objectives("duffing", laws, BRIEF)
    expected = [objective_of(smc.run(BRIEF.unseen("duffing", law, i))) for i, law in enumerate(laws)]
    assert found == pytest.approx(expected, rel=1e-12)
    assert found[0] != found[2]
    assert objectives("duffing", laws[:1], BRIEF, instances=[2]) == pytest.approx(found[2:], rel=1e-12)


def test_instances_of_objectives_belong_to_no_search_and_no_study():
    law = smc.law("classical")
    unseen = {case.seed for i in range(50) for case in BRIEF.unseen("duffing", law, i)}
    assert len(unseen) == 100
    assert min(unseen) >= GRID_SEEDS
    seen = {case.seed for seed in (0, 1, 10**9) for case in BRIEF.scenarios("duffing", law, seed)}
    assert not seen & unseen


def test_an_instance_for_each_law_is_asked_for(refused):
    refused(lambda: objectives("duffing", [smc.law("classical")], BRIEF, instances=[1, 2]))
