"""The boards that are shipped: their pages, README's lines, and the results behind them."""

import functools
import math
import re

import numpy as np
import pytest
from helpers.pages import ROOT

from smc_mujoco.analysis.bootstrap import median_of
from smc_mujoco.common.files import slug
from smc_mujoco.problems import tracking_page
from smc_mujoco.problems.tracking import tracking_suite, tracking_suites
from smc_mujoco.problems.tracking_entry import tracking_entry
from smc_mujoco.problems.tracking_results import (
    SHIPPED,
    bounds,
    read_result,
    shipped_bounds,
    tracking_board,
)
from smc_mujoco.problems.tracking_search import SEARCHES, TAU, UNSEEN

SUITES = pytest.mark.parametrize("suite", tracking_suites())
BOARD = functools.cache(tracking_board)
WORDS = 300  # that a reader of a page has to read, but for its tables


@SUITES
def test_a_page_is_what_the_shipped_results_say(suite):
    board = BOARD(suite)
    path = ROOT / "docs" / tracking_page.page_name(board)
    text = tracking_page.page(board, path.with_suffix(".svg").name)
    assert path.read_text(encoding="utf-8") == text, "python -m smc_mujoco.problems.tracking_page"
    assert path.with_suffix(".svg").stat().st_size < 200_000
    before_problems = text.partition(f"## {board.suite.problems[0].name}")[0]
    typed = re.sub(r"^\|.*$", "", before_problems, flags=re.MULTILINE)
    assert len(re.findall(r"[A-Za-z]\w*", typed)) < WORDS


@SUITES
def test_readme_has_the_line_of_a_board(suite):
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert tracking_page.readme_line(BOARD(suite)) in lines


@pytest.mark.quick
@SUITES
def test_every_entry_has_every_search_of_every_problem(suite):
    board = BOARD(suite)
    names = [problem.name for problem in board.suite.problems]
    assert len(board.entries) >= 3
    for entry in board.entries.values():
        assert list(entry.searches) == names
        for searches in entry.searches.values():
            assert len(searches) == SEARCHES
            assert all(len(of_search.errors) == UNSEEN for of_search in searches)


@SUITES
def test_no_law_and_an_oracle_bound_the_first_entry_of_each_problem(suite):
    board = BOARD(suite)
    limits = shipped_bounds(suite)
    for result in board.problems:
        still, oracle = limits[result.problem]
        assert oracle < result.standings[0].better < still / 50.0


@SUITES
def test_an_entry_is_named_by_its_text(suite, monkeypatch):
    monkeypatch.chdir(ROOT)
    for path in (SHIPPED / suite).glob("*.json"):
        entry = read_result(path)
        assert entry.name == tracking_entry(entry.text).name
        assert path.stem == slug(entry.name)


@SUITES
def test_an_entry_has_a_tag_of_each_kind(suite, monkeypatch):
    monkeypatch.chdir(ROOT)
    for entry in BOARD(suite).entries.values():
        tags = tracking_page.tags_of(entry)
        assert "other" not in tags.values(), entry.law
        template = tracking_entry(entry.text).law.template
        is_told = any(gain.plant for gain in (template.gains if template else {}).values())
        assert is_told == (tags["told"] != "nothing"), entry.law


@pytest.mark.slow
@SUITES
def test_the_bounds_that_are_shipped_are_those_of_a_run(suite):
    problem = tracking_suite(suite).problems[5]
    assert shipped_bounds(suite)[problem.name] == pytest.approx(bounds(problem), rel=6e-3)


def independent_errors(gains, count, rng, steps=20):
    """Errors of a PID on the rail under dry friction of 1.8 N, by a loop of its own: runs with
    their own starts, phases, zeros of the encoder and noise.
    """
    dt, bound, swing, omega, unit = 1e-3, 6.0, 0.1, math.sqrt(0.6), 1.0 / 40960
    phase, zero = rng.uniform(0.0, math.tau, count), rng.uniform(-0.5, 0.5, count)
    x = swing * np.sin(phase) + 0.02 * rng.choice([-1.0, 1.0], count) * rng.uniform(0.8, 1.2, count)
    v, w, rate, slope, squares = np.zeros((5, count))
    held = [np.zeros(count), np.zeros(count)]
    reading = np.zeros(count)
    samples, window = 10_112, 8_112
    for k in range(samples + 1):
        angle = omega * k * dt + phase
        r, dr = swing * np.sin(angle), swing * omega * np.cos(angle)
        if k > samples - window:
            squares += (x - r) ** 2
        earlier = reading
        reading = unit * np.rint(x / unit + 0.3 * rng.normal(size=count) + zero)
        if k:
            rate += dt / (gains[TAU] + dt) * ((reading - earlier) / dt - rate)
        e, de = reading - r, rate - dr
        slope = de if k == 0 else (5e-3 * slope + dt * de) / (5e-3 + dt)
        u = w - gains["kp"] * e - gains["kd"] * slope
        share = min(1.0, 60.0 * gains["ki"] / gains["kp"])
        w += dt * (share * (np.clip(u, -bound, bound) - u) / gains["tt"] - gains["ki"] * e)
        held.append(np.clip(u, -bound, bound))
        force = held.pop(0)
        for _ in range(steps):
            free = v + dt / steps * force
            v = np.sign(free) * np.maximum(np.abs(free) - dt / steps * 1.8, 0.0)
            x += dt / steps * v
    return np.sqrt(squares / window) / unit


@pytest.mark.slow
def test_a_loop_that_shares_nothing_gives_a_printed_error_within_its_interval():
    for search in tracking_board("smc-friction@1").entries["pid"].searches["rail-30"]:
        errors = independent_errors(search.gains, 48, np.random.default_rng(1))
        printed, own = median_of(np.array([search.errors])), median_of(errors[None])
        assert own.low < printed.high
        assert printed.low < own.high
        assert own.median == pytest.approx(printed.median, rel=0.02)
