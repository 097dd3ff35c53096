"""What the evaluator of J promises: the same J as the runs of `smc.run`, on the instances that are
asked for.
"""

import dataclasses

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.tuning import search
from smc_mujoco.analysis.tuning.evaluator import EQUATION, MUJOCO, PYTHON, Evaluator
from smc_mujoco.analysis.tuning.objective import Objective, objectives
from smc_mujoco.control import gain_sets
from smc_mujoco.metrics.catalogue import itae, tv

BRIEF = Objective(conditions=("nominal", "noise"), duration=0.5)


def objective_of(traces):
    """J by the metrics of `smc.run`'s traces, of runs under |u| <= 6 for 0.5 s."""
    return sum(itae(t) / np.abs(t.x[0]).sum() + 1e-3 * tv(t) / (6.0 * 0.5) for t in traces)


@pytest.mark.quick
def test_objectives_are_those_of_each_law_on_its_own_unseen_instance():
    laws = []
    for k in (2.0, 4.0, 2.0):
        laws.append(smc.law("classical", k=k))
    objective_by_law, objective_there = objectives("duffing", laws, BRIEF)
    assert objective_there.tolist() == [False] * 3  # in half a second
    expected = []
    for i, law in enumerate(laws):
        expected.append(objective_of(smc.run(BRIEF.holdout("duffing", law, i))))
    assert objective_by_law == pytest.approx(expected, rel=1e-12)
    assert objective_by_law[0] != objective_by_law[2]
    again, _ = objectives(
        "duffing",
        laws[:1],
        BRIEF,
        instances=[2],
    )
    assert again == pytest.approx(objective_by_law[2:], rel=1e-12)


# both engines against smc.run

SECOND = Objective(duration=1.0)  # under all seven conditions
FACTORS = (1.0, 0.6, 1.7)  # of a law's shipped gains


def mine(y, gains, memory):
    memory[0] += y.dt * y.e
    return -gains.k * (y.de + gains.c * y.e) - gains.k * memory[0], y.de + gains.c * y.e


MINE = smc.law_function(gains={"k": 3.0, "c": 2.0}, memory=1)(mine)()


@smc.law_function(gains={"k": 3.0})
def raises(y, gains, memory):
    if y.t > 0.2 and gains.k > 5.0:
        raise ValueError("k")
    return -gains.k * (y.de + 2.0 * y.e), y.e


@smc.law_function(gains={"k": 1.0})
def pumps(y, gains, memory):
    return gains.k * y.v, y.e


@smc.law_function(gains={"k": 3.0, "c": 2.0})
def uncompiled(y, gains, memory):
    return -gains.k * (y.de + gains.c * sum(map(float, [str(y.e)]))), y.e


def cases_of(plant, law, goal=SECOND):
    if isinstance(law, str):
        gains = gain_sets.law_with_gains(plant, law)
    else:
        gains = law
    return goal.scenarios(plant, gains, 3)


def by_runs(cases, names, gains, goal=SECOND):
    """J of gains by the public way, in the same runs."""
    law = dataclasses.replace(
        cases[0].law, gains={**cases[0].law.gains, **dict(zip(names, gains, strict=True))}
    )
    return goal.evaluation(
        cases[0], smc.run([dataclasses.replace(case, law=law) for case in cases])
    ).objective


CASES = [
    ("duffing", "observer_free", 1e-9),
    ("pendulum_network", "extended_state", 1e-9),
    ("duffing", "twisting", 1e-2),
    ("inverted_pendulum", "classical", 1e-2),
    ("van_der_pol", "super_twisting", 1e-2),
    ("inverted_pendulum", "pid", 1e-9),
    ("van_der_pol", MINE, 1e-9),
    ("inverted_pendulum_network", "boundary_layer", 1e-9),
]
# each law and plant of the equation is compiled for itself, in seconds
BY_ENGINE = [(False, *CASES[0]), (False, *CASES[2]), (True, *CASES[1])]
BY_ENGINE += [pytest.param(True, *case, marks=pytest.mark.slow) for case in CASES]


@pytest.mark.parametrize(("by_equation", "plant", "law", "tolerance"), BY_ENGINE)
def test_either_engine_has_the_objective_of_the_runs(by_equation, plant, law, tolerance):
    cases = cases_of(plant, law)
    names = tuple(search.task_of(plant, cases[0].law, SECOND, 64, 0, 1).box)
    candidates = []
    for factor in FACTORS:
        candidates.append(tuple(factor * cases[0].law.gains[name] for name in names))
    evaluate = Evaluator(SECOND, cases, names, threads=2, by_equation=by_equation, slots=2)
    assert evaluate.engine == (EQUATION if by_equation else MUJOCO)
    objectives_of_runs = [score.objective for score in evaluate(candidates)]
    assert objectives_of_runs == pytest.approx(
        [by_runs(cases, names, gains) for gains in candidates], rel=tolerance
    )


@pytest.mark.parametrize("by_equation", [True, False], ids=[EQUATION, MUJOCO])
@pytest.mark.parametrize(
    ("law", "failure"),
    [
        (raises(), "raised ValueError"),
        pytest.param(pumps(), "the plant diverged", marks=pytest.mark.slow),
        pytest.param(MINE, "", marks=pytest.mark.slow),
    ],
    ids=["raising", "diverging", "with memory"],
)
def test_an_objective_does_not_depend_on_the_candidates_before(law, failure, by_equation):
    """Not after those that raise or diverge, nor on their order, nor on how many run at once."""
    conditions = ("nominal", "noise", "delay_10ms", "jump_mild")
    goal = Objective(conditions=conditions, duration=3.0, u_max=1e9 if law.name == "pumps" else 6.0)
    cases = goal.scenarios("van_der_pol", law, 1)
    names = tuple(law.gains)
    candidates = []
    for k in (1.0, 1e9, 2.5, 0.01, 1.3):
        candidates.append(tuple(k * value for value in law.gains.values()))
    options = {"threads": 1, "by_equation": by_equation}
    evaluate = Evaluator(goal, cases, names, slots=3, **options)
    together = evaluate(candidates)
    assert [evaluate([candidate])[0] for candidate in reversed(candidates)] == together[::-1]
    alone = Evaluator(goal, cases, names, slots=1, **options)
    assert alone(candidates) == together
    expected = []
    for gains in candidates:
        expected.append(by_runs(cases, names, gains, goal))
    assert [candidate.objective for candidate in together] == pytest.approx(expected, rel=1e-9)
    assert [candidate.failed for candidate in together] == [
        failure != "" and gains[0] > 5.0 for gains in candidates
    ]
    for case in cases:
        trace = smc.run(dataclasses.replace(case, law=evaluate.law(candidates[1])))
        assert failure in (trace.failure or "")


DRY = smc.condition("dry", friction=smc.Coulomb(0.3), sensor=smc.Encoder(2048))


@pytest.mark.parametrize(
    ("plant", "law", "gain", "condition", "engine"),
    [
        ("duffing", "observer_free", "lam", DRY, EQUATION),
        ("cart_pole", "hierarchical", "c1", "noise", EQUATION),
        ("cart_pole", "hierarchical", "c1", "coulomb", MUJOCO),
        ("double_pendulum", "observer_free", "lam", "noise", MUJOCO),
    ],
)
def test_a_case_that_is_more_than_its_equation_is_run_by_mujoco(
    plant, law, gain, condition, engine
):
    """It alone: the others, under the nominal condition, stay with the engine."""
    conditions = (condition,) if engine == MUJOCO else ("nominal", condition)
    goal = Objective(conditions=conditions, duration=0.2)
    cases = goal.scenarios(plant, smc.law(law))
    evaluate = Evaluator(goal, cases, (gain,), by_equation=True)
    assert evaluate.engine == engine
    objectives_of_runs = [score.objective for score in evaluate([(5.0,), (4.0,)])]
    expected = [by_runs(cases, (gain,), (value,), goal) for value in (5.0, 4.0)]
    assert objectives_of_runs == pytest.approx(expected, rel=1e-9)


@pytest.mark.filterwarnings("ignore:.*does not compile")
def test_a_law_that_does_not_compile_has_the_objective_of_its_runs():
    goal = Objective(conditions=("nominal",), duration=0.2)
    cases = goal.scenarios("duffing", uncompiled())
    evaluate = Evaluator(
        goal,
        cases,
        ("k", "c"),
        by_equation=True,
    )
    assert evaluate.engine == PYTHON
    assert evaluate([(2.0, 3.0)])[0].objective == by_runs(cases, ("k", "c"), (2.0, 3.0), goal)


def test_without_constraints_no_limit_acts():
    """A pendulum that falls on a stop: with constraints it rests there."""
    goal = Objective(conditions=("contact",), duration=1.0)
    cases = goal.scenarios("inverted_pendulum", smc.law("observer_free", lam=0.001))
    with_stop, without = (
        Evaluator(
            goal,
            cases,
            ("lam",),
            off=off,
        )([(0.001,)])[0]
        for off in (0, mujoco.mjtDisableBit.mjDSBL_CONSTRAINT.value)
    )
    assert without.objective > 1.1 * with_stop.objective
