"""J as a function of gains is what `tune` minimises, in the same runs."""

import json
import math
from pathlib import Path

import numpy as np
import optimisers
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.control.units import FORCE, FORCE_PER_ROOT, RATE, Unit

SHORT = Objective(duration=0.5)


@pytest.fixture(scope="module")
def objective():
    return smc.design.objective("duffing", "super_twisting", objective=SHORT, search=1)


def test_it_gives_the_gains_of_each_search_the_j_that_the_search_has_on_record():
    # of one form with the tunings of test_search.py
    objective = smc.design.objective("duffing", "observer_free", objective=SHORT, search=1)
    tuned = smc.tune("duffing", "observer_free", budget=16, objective=SHORT, searches=2)
    first, second = tuned.sets
    assert objective(second.gains) == pytest.approx(second.objective, rel=1e-12)
    assert objective(first.gains) != pytest.approx(first.objective, rel=1e-6)  # of other runs
    assert objective.bounds == dict(tuned.bounds)


@pytest.mark.quick
def test_gains_outside_the_theorem_cost_inf_and_are_not_run():
    objective = smc.design.objective("duffing", "twisting", objective=SHORT)
    assert objective([2.0, 3.0, *[1.0] * (len(objective.bounds) - 2)]) == math.inf  # r1 < r2
    assert objective.evaluations == 0
    free = smc.design.objective("duffing", "twisting", objective=SHORT, outside_theorem=True)
    assert free([2.0, 3.0, *[1.0] * (len(free.bounds) - 2)]) < 100.0


def test_it_says_which_gains_are_missing_and_makes_the_law_of_a_set(objective):
    assert objective.law(np.array([3.0, 4.4, 2.5])).gains["k2"] == 4.4
    with pytest.raises(smc.ScenarioError, match="gains has 2 numbers: give 3, for k1, k2"):
        objective([3.0, 4.4])
    with pytest.raises(smc.ScenarioError, match="gains is -1"):
        objective([3.0, 4.4, -1.0])


def test_gains_have_the_units_of_the_plant_s_joints(objective):
    assert objective.units == {"k1": "N s^0.5/m^0.5", "k2": "N/s", "c": "1/s"}
    turning = smc.design.objective("inverted_pendulum", "observer_free", objective=SHORT)
    assert turning.units == {"lam": "N m", "k1": "1/s"}


@pytest.mark.parametrize(
    ("unit", "text"),
    [
        (FORCE, "N m"),
        (RATE, "1/s"),
        (FORCE_PER_ROOT, "N m s^0.5/rad^0.5"),
        (Unit(force=2, position=-2, time=2), "(N m)^2 s^2/rad^2"),
        (Unit(position=-1, time=-2), "1/(rad s^2)"),
        (Unit(), "1"),
    ],
)
def test_a_unit_in_words(unit, text):
    assert unit.text("N m", "rad") == text


def test_the_page_s_table_of_optimisers_is_that_of_the_benchmark():
    measured = json.loads(optimisers.MEASURED.read_text(encoding="utf-8"))
    page = Path(optimisers.__file__).parents[1] / "docs" / "recipes.md"
    assert optimisers.table(measured) in page.read_text(encoding="utf-8")
    assert {len(costs) for row in measured.values() for costs in row.values()} == {6}
    medians = np.array([[np.median(costs) for costs in row.values()] for row in measured.values()])
    assert (medians.max(axis=1) / medians.min(axis=1)).max() < 1.08
