"""Claims that are measured at once have the numbers, and the errors, of claims one after the other."""

import threading
from pathlib import Path

import pytest

from smc_mujoco.common import attended
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.evidence.audit import evidence
from smc_mujoco.evidence.audit.audit import audit

HEAD = """
title = "Small"
authors = "A. Nobody"
source = "nowhere, 2026"
read = "full text"
runs = "duration=0.1"
sets = ["study", "tuned"]
"""
CLAIM = """
[[claim]]
id = "{name}"
whose = "paper"
text = "it is so"
where = "p. 1"
function = "{name}"
plants = ["duffing"]
laws = ["classical"]
holds_if = {{ size = "> 0" }}
{more}
"""
# the first waits for the second, where both are measured at once
CODE = """
import signal, threading
second_ended = threading.Event()
ended = []
def measured(runs, k):
    law = runs.law("duffing", "classical", k=k)
    return {"size": runs.scores([runs.scenario("duffing", "classical", law=law)])[0]["itae"]}
def first(runs):
    assert runs.threads == 1 or second_ended.wait(60.0)
    return ended.append(1) or measured(runs, 3.0)
def second(runs):
    sizes = measured(runs, 4.0)
    second_ended.set()
    return ended.append(2) or sizes
def timing(runs):
    return {"size": len(ended)}
def all_of_them(runs):
    sizes = [run.scores["itae"] for run in runs.results()]
    return {"size": {str(i): size for i, size in enumerate(sizes)}}
def wrong(runs):
    assert second_ended.wait(60.0)
    raise ValueError("the first in the file")
def wrong_too(runs):
    second_ended.set()
    raise ValueError("the second in the file")
def interrupted(runs):
    signal.raise_signal(signal.SIGINT)
    runs.scores([runs.only(duration=100.0, control_period=0.1, physics_step=1e-6)])
"""


def written(folder: Path, **claims: str) -> Path:
    """Write a paper with these claims, name -> more lines, and return its folder."""
    text = [HEAD]
    for name, more in claims.items():
        text.append(CLAIM.format(name=name, more=more))
    (folder / "paper.toml").write_text("".join(text))
    (folder / "claims.py").write_text(CODE)
    return folder


def test_two_claims_at_once_have_the_evidence_of_one_after_the_other(tmp_path):
    folder = written(tmp_path, all_of_them="late = true", first="", second="")
    at_once, in_turn = (evidence.document(audit(folder, threads=threads)) for threads in (2, 1))
    assert at_once == in_turn
    assert len(in_turn["claims"][0]["numbers"]["study"]) == 2


def test_a_timing_is_measured_when_nothing_else_is(tmp_path):
    folder = written(tmp_path, timing='varies = "a timing"', first="", second="")
    timing = audit(folder, threads=2).claims[0]
    assert [checks["size"]["value"] for checks in timing.numbers.values()] == [4.0, 4.0]


def test_the_error_is_that_of_the_first_claim(tmp_path):
    folder = written(tmp_path, wrong="", wrong_too="")
    with pytest.raises(ScenarioError, match="the first in the file"):
        audit(folder, threads=2)


def test_ctrl_c_ends_the_runs_of_claims(tmp_path):
    before = set(threading.enumerate())
    with pytest.raises(KeyboardInterrupt):
        audit(written(tmp_path, interrupted=""), threads=2)
    for thread in set(threading.enumerate()) - before:
        thread.join(30.0)
    assert not attended._running
