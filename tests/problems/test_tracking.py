"""Suites of tracking problems: what is searched, run and compared is what a board prints."""

import dataclasses
import json
import math
import shutil
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.answers.answers import screen_lines
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.problems import (
    commands,
    tracking_page,
    tracking_picture,
    tracking_results,
    tracking_search,
)
from smc_mujoco.problems.tracking import TrackingProblem, tracking_suite, tracking_suites
from smc_mujoco.problems.tracking_entry import tracking_entry
from smc_mujoco.problems.tracking_results import TrackingBoard, enter_tracking, read_result
from smc_mujoco.problems.tracking_search import TAU, GainTrials, scenario_of
from smc_mujoco.simulation.signals import Sine

SUITES = pytest.mark.parametrize("name", tracking_suites())
GAINS = {"kp": 40.0, "ki": 60.0, "kd": 12.0, "tt": 0.5, TAU: 0.01}


def problem(suite, name) -> TrackingProblem:
    (chosen,) = [
        candidate for candidate in tracking_suite(suite).problems if candidate.name == name
    ]
    return chosen


def rms(trace, problem):
    error = (trace.x - trace.r)[-problem.late :, 0]
    return float(np.sqrt(np.mean(error**2)) / problem.count)


@pytest.mark.quick
@SUITES
def test_a_window_is_whole_periods_of_what_is_periodic_and_of_control(name):
    for task in tracking_suite(name).problems:
        assert task.window / task.period == pytest.approx(task.late, abs=1e-6)
        omegas = [task.omega] if task.swing else []
        for signal in np.atleast_1d(np.array(task.fields.get("disturbance", ()), object)):
            if isinstance(signal, Sine):
                omegas.append(signal.omega)
        for omega in omegas:
            periods = task.window * omega / math.tau
            assert periods == pytest.approx(round(periods), abs=2e-3)
            assert periods > 0.99


@SUITES
def test_without_the_load_only_its_forces_differ(name):
    entry = tracking_entry("pid")
    for task in tracking_suite(name).problems:
        loaded, free = (scenario_of(task, entry, GAINS, 3, loaded) for loaded in (True, False))
        changed = set()
        for field in dataclasses.fields(loaded):
            if getattr(loaded, field.name) != getattr(free, field.name):
                changed.add(field.name)
        assert changed == {"friction" if task.friction else "disturbance"}


@pytest.mark.parametrize("text", ["pid + Feedforward(0.7)", "pid + Dither(1)"])
def test_without_the_friction_nothing_is_added_to_a_law(text):
    task = problem("smc-friction@1", "rail-10")
    alone, beside = (
        smc.run(scenario_of(task, tracking_entry(entry), GAINS, 3, loaded=False)).u
        for entry in ("pid", text)
    )
    assert np.array_equal(alone, beside)


@pytest.mark.parametrize(
    ("suite", "name", "text"),
    [
        ("smc-load@1", "duffing-wind", "pid"),
        ("smc-friction@1", "link-10", "pid + Feedforward(0.7)"),
    ],
)
def test_mujoco_gives_the_error_and_the_rate_that_the_search_sees(suite, name, text):
    task = problem(suite, name)
    entry = tracking_entry(text)
    trials = GainTrials(task, entry, 1)
    values = np.array([list(GAINS.values())])
    error, rate = trials.run(trials.group([(0, True)]), values, np.array([0]))[0]
    trace = smc.run(scenario_of(task, entry, GAINS, 0))
    changes = np.abs(np.diff(trace.u[-task.late - 1 :, 0])).sum()
    assert rms(trace, task) == pytest.approx(error, rel=1e-9)
    assert changes / task.window / task.bound == pytest.approx(rate, rel=1e-9)


def test_a_search_keeps_the_limit_and_the_theorem_and_is_the_same_again(monkeypatch):
    for name, value in (("SETS", 48), ("DRAWN", 24)):
        monkeypatch.setattr(tracking_search, name, value)
    task = problem("smc-load@1", "pendulum-middle")
    trials = GainTrials(task, tracking_entry("classical"), 1)
    steps = []
    gains = trials.searched(0, steps.append)
    assert sum(steps) == 48
    assert gains == trials.searched(0, steps.append)
    assert gains != trials.searched(1, steps.append)
    logs = np.log([list(gains.values())])
    _, allowed = trials.judged(logs)
    worst = in_all_runs(trials, logs)
    assert bool(allowed[0]) == (worst[0, 1] <= tracking_search.MARGIN * task.limit)


def in_all_runs(trials, logs):
    """The largest error and rate of sets of gains, each in all runs by which a search judges."""
    count = len(trials.choosing.rows)
    gains = np.repeat(np.exp(logs), count, axis=0)
    runs = np.tile(np.arange(count), len(logs))
    return trials.run(trials.choosing, gains, runs).reshape(len(logs), count, 2).max(axis=1)


def test_sets_that_stop_early_cost_more_than_those_that_run_through(monkeypatch):
    task = problem("smc-friction@1", "rail-5ms")
    trials = GainTrials(task, tracking_entry("pid"), 1)
    logs = np.random.default_rng(5).uniform(trials.box[:, 0], trials.box[:, 1], (24, 5))
    worst = in_all_runs(trials, logs)
    limit = tracking_search.MARGIN * task.limit
    full_costs = worst[:, 0] * np.maximum(worst[:, 1] / limit, 1.0) ** 4
    run_counts = []
    run = trials.run
    monkeypatch.setattr(
        trials, "run", lambda group, *rows: run_counts.append(len(rows[0])) or run(group, *rows)
    )
    costs, allowed = trials.judged(logs)
    best = np.argsort(full_costs)[: tracking_search.JUDGED]
    assert costs[best] == pytest.approx(full_costs[best], rel=1e-12)
    beaten = np.setdiff1d(np.arange(24), best)
    assert (costs[beaten] >= costs[best].max()).all()
    assert (costs <= full_costs * (1.0 + 1e-12)).all()
    assert allowed[best].tolist() == (worst[best, 1] <= limit).tolist()
    assert sum(run_counts) < 0.6 * 24 * len(trials.choosing.rows)


@pytest.mark.parametrize(
    ("text", "about"),
    [
        ("pid + Feedforward(1)", "has none"),
        ("pid + Feedback(1)", "Feedforward"),
        ("pidd", "pidd"),
    ],
)
def test_what_is_no_entry_is_refused_before_anything_is_searched(text, about, tmp_path):
    with pytest.raises(ScenarioError, match=about):
        enter_tracking(text, "smc-load@1", tmp_path)
    assert not list(tmp_path.rglob("*.json"))


@pytest.mark.parametrize(
    ("typed", "meant"), [("smc-fricton@1", "smc-friction@1"), ("x", "smc-load@1, ")]
)
def test_a_mistyped_suite_is_told_those_of_both_kinds(typed, meant):
    with pytest.raises(ScenarioError, match=meant):
        commands.enter("pid", suite=typed)


def result(name, levels, spread=0.02, seed=0, rate=5.0):
    """An entry whose medians in a problem are these, of two searches."""
    rng = np.random.default_rng(seed)
    searches = {}
    for problem_name, pair in levels.items():
        results = []
        for level in pair:
            errors = (level * np.exp(rng.normal(0.0, spread, 24))).tolist()
            results.append(tracking_search.Found({"k": 1.0}, errors, without=0.3, rate=rate))
        searches[problem_name] = tuple(results)
    return tracking_results.TrackingResult(
        name=name, text=name, law=name, date="2026-11-30", searches=searches
    )


def board_of(*results):
    suite = tracking_suite("smc-load@1")
    suite = dataclasses.replace(suite, problems=suite.problems[:2])
    return TrackingBoard(suite, results)


def test_an_entry_leads_only_if_it_is_better_in_every_pairing_of_the_searches():
    a, b = [task.name for task in tracking_suite("smc-load@1").problems[:2]]
    lucky = result("pid", {a: (1.0, 9.0), b: (1.0, 1.1)}, seed=1)
    steady = result("adrc", {a: (3.0, 3.1), b: (3.0, 3.1)}, seed=2)
    boards = board_of(lucky, steady).problems
    assert boards[0].leaders == ["adrc", "pid"]
    assert boards[0].told_apart == 0.0
    assert boards[1].leaders == ["pid"]
    assert boards[1].told_apart == 1.0
    errors = {standing.entry: (standing.better, standing.error) for standing in boards[0].standings}
    assert errors["pid"] == pytest.approx((1.0, 9.0), rel=0.05)
    assert board_of(lucky, steady).shares() == {"pid": 1.0, "adrc": 0.5}
    heading = screen_lines(board_of(lucky, steady).standing("pid"))[0]
    assert heading.endswith("not led by any of 1 other in 2 of 2 problems")
    worse = result("hodob", {a: (50.0, 51.0), b: (50.0, 51.0)}, seed=3)
    heading = screen_lines(board_of(lucky, steady, worse).standing("hodob"))[0]
    assert heading.endswith("led in each of 2 problems by some of 2 others")


def test_errors_below_the_floor_are_level_and_one_that_is_the_same_without_is_marked():
    a, b = [task.name for task in tracking_suite("smc-load@1").problems[:2]]
    fine = result("pid", {a: (0.1, 0.1), b: (0.31, 0.31)}, seed=3)
    finer = result("adrc", {a: (0.2, 0.2), b: (5.0, 5.0)}, seed=4)
    boards = board_of(fine, finer).problems
    assert {*boards[0].leaders} == {"pid", "adrc"}
    assert [(standing.entry, standing.of_load) for standing in boards[1].standings] == [
        ("pid", False),
        ("adrc", True),
    ]


def test_a_search_that_varies_beyond_the_limit_has_no_error():
    a, b = [task.name for task in tracking_suite("smc-load@1").problems[:2]]
    busy = result("pid", {a: (1.0, 1.0), b: (1.0, 1.0)}, rate=11.0)
    calm = result("adrc", {a: (5.0, 5.0), b: (5.0, 5.0)}, rate=10.0)
    (board, _) = board_of(busy, calm).problems
    assert board.leaders == ["adrc"]
    last = board.standings[-1]
    assert (last.entry, last.better, last.error) == ("pid", math.inf, math.inf)


def test_an_entry_changes_a_page_by_its_row_and_what_it_tops_alone():
    a, b = [task.name for task in tracking_suite("smc-load@1").problems[:2]]
    first = result("pid", {a: (1.0, 1.1), b: (1.0, 1.1)}, seed=1)
    last = result("hodob", {a: (7.0, 7.1), b: (7.0, 7.1)}, seed=2)
    before = tracking_page.page(board_of(first), "p.svg").splitlines()
    after = tracking_page.page(board_of(first, last), "p.svg").splitlines()
    added = [line for line in after if line not in before]
    assert sum("`hodob`" in line for line in added) == 2  # a row in each problem
    row = next(line for line in before if line.startswith("| `pid`<br>"))
    assert row in after


def test_a_page_has_the_row_of_the_entry_that_it_is_written_for_however_far_behind():
    names = [task.name for task in tracking_suite("smc-load@1").problems[:2]]
    laws = ("pid", "adrc", "indi", "odrive", "loop_shaping", "mpc", "hodob")
    entries = []
    for seed, law in enumerate(laws):
        level = 3.0 ** (1 + seed)
        entries.append(result(law, dict.fromkeys(names, (level, level)), seed=seed))
    board = board_of(*entries)
    assert "| `hodob`<br>" not in tracking_page.page(board, "p.svg")
    own = tracking_page.page(board, "p.svg", "hodob")
    assert own.count("| `hodob`<br>") == 2
    assert own.count("1 more entry.") == 2  # mpc
    assert "hodob" in tracking_picture.entries_drawn(board, "hodob")


def pairs_in_doubt(board):
    """The number of pairs that cannot be told apart in the last problem."""
    standing = board.problems[-1]
    count = len(standing.standings)
    return round((1.0 - standing.told_apart) * count * (count - 1) / 2)


def test_more_entries_change_no_lead_between_others():
    a, b = [task.name for task in tracking_suite("smc-load@1").problems[:2]]
    entries = [result("hodob", {a: (0.6, 0.6), b: (0.6, 0.6)}, seed=9)]
    for name, level, seed in (("pid", 1.0, 1), ("adrc", 1.17, 2)):  # nearly told apart
        levels = {a: (level, level), b: (level, level)}
        entries.append(result(name, levels, spread=0.08, seed=seed))
    before = pairs_in_doubt(board_of(*entries))
    for number in range(30):
        far = 50.0 * 1.3**number
        entries.append(result(f"law {number}", {a: (far, far), b: (far, far)}, seed=3 + number))
    assert pairs_in_doubt(board_of(*entries)) == before == 1


def interrupted(*call):
    raise KeyboardInterrupt


@pytest.mark.slow
def test_a_law_of_ones_own_enters_and_the_same_command_goes_on(tmp_path, monkeypatch):
    for name, value in (("SETS", 24), ("DRAWN", 12)):
        monkeypatch.setattr(tracking_search, name, value)
    law = tmp_path / "my_law.py"
    law.write_text(
        "import smc_mujoco as smc\n"
        "from smc_mujoco.control.units import FORCE_PER_POSITION, FORCE_PER_SPEED, Gain\n"
        "@smc.law_function(gains={'p': Gain(9.0, FORCE_PER_POSITION), "
        "'d': Gain(3.0, FORCE_PER_SPEED)})\n"
        "def mine(y, gains, memory):\n"
        "    return -gains.p * y.e - gains.d * y.de, y.e\n"
    )
    pending = []
    in_turn = tracking_results._results_in_turn

    def noted(calls, *rest):
        pending.append(len(calls))
        return in_turn(calls, *rest)

    monkeypatch.setattr(tracking_results, "_results_in_turn", noted)
    searches = iter([*[tracking_results.search] * 3, interrupted])

    def stopped(*call):
        return next(searches)(*call)

    with monkeypatch.context() as patch:
        patch.setattr(tracking_results, "search", stopped)
        with pytest.raises(KeyboardInterrupt):
            enter_tracking(str(law), "smc-load@1", tmp_path, 1)
    with ThreadPoolExecutor(1) as pool:
        file = enter_tracking(str(law), "smc-load@1", tmp_path, executor=pool)
    count = 2 * len(tracking_suite("smc-load@1").problems)
    assert pending == [count, count - 3]
    entered = read_result(file)
    assert entered.name == "mine"
    assert {*json.loads(file.read_text())["problems"]} == {
        task.name for task in tracking_suite("smc-load@1").problems
    }
    shutil.rmtree(tmp_path / "smc-load@1")
