"""Targets are quantiles of the catalogue's medians, which the oracle reaches and u = 0 does not;
and suites.
"""

import collections
import math

import controls
import numpy as np
import problems as script
import pytest

import smc_mujoco as smc
from smc_mujoco.problems import problem, suite

CELL = "duffing/noise@1"
FRESH = 5  # a seed from which nothing was frozen


def runs(accuracy: list[float], settling: float = 1.0, calm: float = 1.0) -> np.ndarray:
    """The measures of some runs, which differ in accuracy."""
    return np.array([[0.0, final_error, 1.0, settling, calm] for final_error in accuracy])


def frozen(unit: float, oracle: list[float], zero: list[float], seen: float = 1e-9) -> dict | None:
    """The targets for laws whose medians are 1, 2, ... 21 times a unit, and for accuracies of the
    controls.
    """
    laws = {}
    for i in range(1, 22):
        laws[f"{i}"] = runs([1e-9, unit * i, 1e9], settling=0.1 * i, calm=float(i))
    of_controls = {"zero": runs(zero, math.inf, 0.0), "oracle 16 0.5": runs(oracle, 0.01, 0.01)}
    return script.targets(CELL, laws, of_controls, {"oracle 16 0.5": runs([seen], 0.01, 0.01)})


@pytest.mark.quick
def test_levels_are_the_quantiles_of_the_medians():
    """Of 1, 2, ... 21 the quantiles at 10, 25, 50, 75 and 90 % are 3, 6, 11, 16 and 19."""
    levels = frozen(0.001, [1e-6], [1.0])
    assert levels is not None
    for measure, unit in (
        ("accuracy", 0.001),
        ("settling", 0.1),
        ("calm", 1.0),
    ):
        assert levels[measure] == pytest.approx([unit * i for i in (3, 6, 11, 16, 19)])
    assert levels["oracle"] == [16.0, 0.5]


@pytest.mark.quick
@pytest.mark.parametrize(
    ("oracle", "zero", "levels"),
    [
        # 0.04 x 1.25, and a tenth of the start
        ([0.01, 0.04], [0.9, 0.8], [0.05, 0.06, 0.1, 0.1, 0.1]),
        ([1e-6], [0.9, 0.12], [0.03, 0.06, 0.06, 0.06, 0.06]),  # 0.12 / 2
        ([0.06], [0.9, 0.12], None),
        ([1e-6], [0.9, 0.09], None),
        ([math.inf], [0.9], None),
    ],
)
def test_a_level_is_no_harder_than_the_oracles_worst_and_no_easier_than_the_best_of_nothing(
    oracle, zero, levels
):
    frozen_levels = frozen(0.01, oracle, zero)
    assert (frozen_levels and frozen_levels["accuracy"]) == (levels and pytest.approx(levels))


@pytest.mark.quick
@pytest.mark.parametrize(
    ("seen", "hardest"),
    [
        (0.049, 0.05),
        (0.052, 0.05252),
    ],
)
def test_a_level_is_no_harder_than_the_oracles_worst_on_visible_instances(seen, hardest):
    """There it has no margin: of drawn ones the worst, 0.04, has one of 1.25."""
    levels = frozen(0.01, [0.04], [0.9], seen)
    assert levels
    assert levels["accuracy"][0] == pytest.approx(hardest)


@pytest.mark.quick
def test_a_suite_takes_each_plant_and_condition_equally_often_and_no_law_has_a_say():
    thirty = suite.suite("smc-30@1")
    fifty = suite.suite("smc-50@1")
    rules = problem.rules(1)
    chosen = []
    for j, plant in enumerate(rules["plants"]):
        for i, condition in enumerate(rules["conditions"]):
            if (i + 2 * j + 1) % 5 < 3 and f"{plant}/{condition}" not in rules["frozen"][
                "left_out"
            ]:
                chosen.append(f"{plant}/{condition}@1")
    assert list(thirty) == chosen
    assert set(thirty) < set(fifty)
    plants, conditions = (
        collections.Counter(p)
        for p in zip(*(i.split("@")[0].split("/") for i in thirty), strict=True)
    )
    assert set(plants.values()) | set(conditions.values()) <= {5, 6, 3, 2}


@pytest.mark.quick
def test_every_problem_of_every_suite_has_five_ordered_levels_and_informs_a_board():
    for name in {name for suite_name in suite.suites() for name in suite.suite(suite_name)}:
        targets = smc.problem(name).targets
        assert set(targets) == set(problem.MEASURES), name
        for levels in targets.values():
            assert len(levels) == 5, name
            assert list(levels) == sorted(levels), name
        assert {"speed", "calm"} <= set(suite.boards(name))
    assert suite.boards("duffing/sine@1") == ("forces", "speed", "calm")
    assert suite.boards("duffing/encoder@1") == ("sensors", "speed", "calm")
    with pytest.raises(smc.ScenarioError, match="smc-31"):
        suite.suite("smc-31@1")


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", sorted({name for suite_name in suite.suites() for name in suite.suite(suite_name)})
)
def test_both_controls_on_instances_that_nobody_saw(name):
    problem = smc.problem(name)
    instances = range(1) if "/worst" in name else range(4)
    for control, law in controls.frozen(problem).items():
        reached = control == "oracle"
        for trace in smc.run(controls.scenarios(problem, law, instances, FRESH)):
            times = {}
            for key, time in problem.measures(trace).items():
                if key.rpartition("_")[2].isdigit():
                    times[key] = time
            assert len(times) == 15
            assert {key for key, time in times.items() if math.isnan(time) == reached} == set(), (
                control
            )
