"""A golden of every paper's quick verdicts: a change of a claim's code that changes its meaning shows here.

    python tests/evidence/papers/test_quick_verdicts.py levant_1993

This writes the verdicts of a paper again, and of all without a name. Gaber's are in test_quick_verdicts_of_gaber.py.
"""

import contextlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import pytest

from smc_mujoco.evidence.audit import runs, search
from smc_mujoco.evidence.audit.audit import audit
from smc_mujoco.evidence.audit.paper import paper, shipped
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.studies.run_key import key

GOLDEN = Path(__file__).parent / "quick_verdicts.json"
GAINS = {"gaber": "study"}  # its other sets are tuned again and again
TIMINGS = {("gaber", "14")}  # their verdict is the machine's
VARIANTS = ("_reversed", "_squeezed", "_zero", "_relay", "_forgetful")


def golden(name: str) -> dict[str, dict[str, str]]:
    """Return claim -> whose it is and its verdict, of a paper."""
    return json.loads(GOLDEN.read_text())[name]


def quick_verdicts(name: str, only: list[str] | None = None) -> dict[str, dict[str, str]]:
    """Return claim -> whose it is and its verdict in a quick audit, without timings; check whose runs it used."""
    with mock.patch.object(search, "QUICK_SPREAD", 1):  # the verdicts are those of two, in less time
        found = audit(name, only, GAINS.get(name), quick=True)
    for id, sets in found.used.items():
        check_runs(name, id, [one.scenario for used in sets.values() for one in used.values()])
    return {one.id: {one.whose: one.verdict} for one in found.claims if (name, one.id) not in TIMINGS}


def check_runs(name: str, id: str, scenarios: list[Scenario]) -> None:
    """Runs are of the plants and laws that the claim names."""
    about, entry = paper(name), paper(name).claims[id]
    plants = {about.plant(one).name for one in entry.plants}
    laws = {*entry.laws, *(law + variant for law in entry.laws for variant in VARIANTS)}
    assert {scenario.plant.name for scenario in scenarios} <= plants, id
    assert {scenario.law.name for scenario in scenarios} <= laws, id


@contextlib.contextmanager
def runs_made_once() -> Iterator[None]:
    """Simulate each run once. Without this, a third of all steps would be repeated, for claims that share runs."""
    made, stream = {}, runs.stream

    def kept(scenarios, threads):
        keys = [key(scenario.named(None)) for scenario in scenarios]
        new = {name: scenario for name, scenario in zip(keys, scenarios, strict=True) if name not in made}
        made.update((list(new)[i], trace) for i, trace in stream(list(new.values()), threads))
        return ((i, made[name]) for i, name in enumerate(keys))

    runs.stream = kept
    try:
        yield
    finally:
        runs.stream = stream


def test_the_golden_has_every_claim_of_every_paper():
    claims = {name: [id for id in paper(name).claims if (name, id) not in TIMINGS] for name in shipped()}
    assert {name: list(golden(name)) for name in shipped()} == claims


@pytest.mark.parametrize("name", [name for name in shipped() if name != "gaber"])
def test_quick_verdicts_are_those_of_the_golden(name):
    with runs_made_once():
        assert quick_verdicts(name) == golden(name)


def test_a_wrong_divisor_in_a_claim_s_code_does_not_pass_the_golden(monkeypatch):
    """`/ k` in place of `/ (2 k)` in the largest step of u of an ordinary sliding mode."""
    from smc_mujoco.evidence.papers.levant_1993 import claims

    step = claims.late_step
    monkeypatch.setattr(claims, "late_step", lambda signal: 2.0 * step(signal))
    assert quick_verdicts("levant_1993", ["5"])["5"] != golden("levant_1993")["5"]


if __name__ == "__main__":
    known = json.loads(GOLDEN.read_text()) if GOLDEN.exists() else {}
    known |= {name: quick_verdicts(name) for name in sys.argv[1:] or shipped()}
    GOLDEN.write_text(json.dumps({name: known[name] for name in shipped() if name in known}, indent=1) + "\n")
