"""Scores of many scenarios: a table without traces, by the fast engine and by MuJoCo."""

import dataclasses
import math

import pytest
from helpers.runs import at_defaults

import smc_mujoco as smc
from smc_mujoco.analysis.engine import scored_runs
from smc_mujoco.common.text import number
from smc_mujoco.metrics.catalogue import itae, settling_time
from smc_mujoco.studies import score as module


@pytest.fixture(autouse=True, scope="module")
def engine_for_short_runs():
    """So short runs are MuJoCo's elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scored_runs, "MIN_WORK", 0)
        yield


@smc.law_function(gains={"when": 1.0})
def failing(y, gains, memory):
    return math.nan if y.t >= gains.when else -y.e, y.e


def cases():
    stops = smc.Stops({"slide": (-3.0, 3.0)})  # which MuJoCo runs
    laws = ("pid", failing(when=0.2), "pid", failing(when=9.0))
    for law, contact in zip(laws, ((), (), stops, ()), strict=True):
        yield smc.Scenario(plant="duffing", law=at_defaults(law), duration=0.5, contact=contact)


def test_a_table_has_the_scores_of_every_run_in_order(monkeypatch):
    """Runs of the engine and of MuJoCo, over several chunks; a failed run leaves the others."""
    monkeypatch.setattr(module, "CHUNK", 3)
    table = smc.score(cases(), metrics=("settling_time", "itae"))
    traces = smc.run(list(cases()))
    assert table.column("law").tolist() == [trace.scenario.law.name for trace in traces]
    for row, trace in zip(table.rows(), traces, strict=True):
        assert row["diverged_at"] == pytest.approx(trace.diverged_at)
        if trace.diverged_at is not None:
            assert row["itae"] is None
            continue
        assert row["itae"] == pytest.approx(itae(trace), rel=1e-9)
        assert row["settling_time"] == settling_time(trace)
    assert "MuJoCo repeated 3 runs of another engine: 0 failed in one of the two only" in repr(
        table
    )
    with pytest.raises(smc.ScenarioError, match="scores alone"):
        table.scenario(0)
    assert "1 of 2 have none" in str(table)


def two(law):
    """Two runs, which MuJoCo makes: the fast engine would compile for 5 s."""
    base = smc.Scenario(plant="duffing", law=law, duration=0.5, integrator="implicitfast")
    return [dataclasses.replace(base, x0=x0) for x0 in (0.1, 0.3)]


@pytest.mark.quick
def test_times_of_runs_that_all_never_settle_have_no_range():
    text = str(smc.score(two("none"), metrics=("settling_time",)))
    assert " never\n" in text
    assert "–" not in text


def test_the_median_of_two_runs_is_their_mean():
    runs = two(at_defaults("pid"))
    table = smc.score(runs, metrics=("itae",))
    values = table.column("itae")
    assert f" {sum(values) / 2.0:.3g}\n" in str(table)
    assert f"{number(min(values))}–{number(max(values))}" in str(table)
    assert "below each the least" in str(table)
    assert "least" not in str(smc.score(runs[:1], metrics=("itae",)))


def test_what_cannot_be_scored_is_refused():
    with pytest.raises(smc.ScenarioError, match="give one Trace, or scenarios"):
        smc.score([1.0])
    with pytest.raises(smc.ScenarioError, match="metric"):
        smc.score(cases(), metrics=("nonsense",))
    assert len(smc.score([])) == 0
