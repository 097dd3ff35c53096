"""A few cases of each part of the long attack, `attack.py`, which `make attack` runs by the
thousand.
"""

import signal
from random import Random

import attack
import numpy as np
import pytest
import wild
from helpers.machines import AXIS

import smc_mujoco as smc
from smc_mujoco.common import gl


@pytest.mark.parametrize(
    ("part", "cases"),
    [
        ("scenarios", 100),
        ("batches", 10),
    ],
)
def test_wild_scenarios_are_refused_or_run_to_sound_traces(part, cases, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ended = [attack.case(part, 0, i) for i in range(cases)]
    assert [why for _, why in ended if why] == []
    assert sum(how != "refused" for how, _ in ended) > cases / 20


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers")
def test_what_was_kept_is_there_and_used_after_ctrl_c(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ended = [attack.case("interrupts", 0, i) for i in range(6)]
    assert [why for _, why in ended if why] == []
    assert "stopped" in {how for how, _ in ended}


def test_wild_files_end_well_or_in_a_sentence(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert [why for _, why in (attack.case("files", 0, i) for i in range(5)) if why] == []


@pytest.mark.quick
@pytest.mark.parametrize(("part", "cases"), [("calls", 60), ("commands", 8)])
def test_calls_with_odd_arguments_end_well_or_in_a_sentence(part, cases, tmp_path, monkeypatch):
    """The first cases have what was a foreign error once: arrays as flags, lists and tables."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    monkeypatch.setattr(
        gl, "missing_renderer", lambda: "not here"
    )  # else it is kept for later tests
    assert [why for _, why in (attack.case(part, 0, i) for i in range(cases)) if why] == []


def test_arrays_and_others_where_a_list_a_table_or_a_flag_belongs_are_refused():
    many = np.ones(3)
    for call in (
        lambda: smc.leaderboard(many),  # type: ignore[arg-type]
        lambda: smc.plot(many),  # type: ignore[arg-type]
        lambda: smc.which("duffing", needs=many),  # type: ignore[arg-type]
        lambda: smc.margins("duffing", "pid", quick=many),  # type: ignore[arg-type]
        lambda: smc.compare("pid", np.zeros(0)),  # type: ignore[arg-type]
        lambda: smc.identify(AXIS, {}, columns=many),  # type: ignore[arg-type]
    ):
        with pytest.raises(smc.ScenarioError, match=r": (give|choose)"):
            call()


# what the attack finds


def test_a_case_is_the_same_again():
    assert [wild.wide(Random("a")) for _ in range(2)] == [wild.wide(Random("a"))] * 2
    assert attack.case("scenarios", 3, 5) == attack.case("scenarios", 3, 5)


def test_a_trace_with_a_number_that_was_not_computed_is_found():
    trace = smc.run(smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.01))
    attack.sound(trace)
    for name in ("x", "applied", "reaction"):
        array = getattr(trace, name).copy()
        array[3] = float("nan")
        array.flags.writeable = False
        with pytest.raises(attack.Found, match=f"{name} is not finite"):
            attack.sound(smc.Trace(**{**vars(trace), name: array}))
