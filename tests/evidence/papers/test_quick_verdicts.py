"""A golden of every paper's quick audit: a change of a claim's code that changes a verdict or a
number shows here.

    python tests/evidence/papers/test_quick_verdicts.py levant_1993

This writes a paper's again, and those of all without a name. Gaber's are in
test_quick_verdicts_of_gaber.py. Some numbers change by a hundredth if a start moves by 1e-12, as
those of a run that chatters. Another processor may change them as well, so that the golden has a
range for each of them.
"""

import contextlib
import dataclasses
import json
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from smc_mujoco.evidence.audit import claim_runs, gain_search
from smc_mujoco.evidence.audit.audit import audit
from smc_mujoco.evidence.audit.paper import paper, shipped
from smc_mujoco.evidence.audit.verdict import Claim
from smc_mujoco.simulation.run_key import run_key
from smc_mujoco.simulation.scenario import Scenario

GOLDEN = Path(__file__).parent / "quick_verdicts.json"
GAINS = {"gaber": "study"}  # its other sets are tuned again and again
TIMINGS = {("gaber", "14")}  # their verdict is the machine's
VARIANTS = ("_reversed", "_squeezed", "_zero", "_relay", "_forgetful")


NUDGES = (0.0, 1e-12, -1e-11)  # of the starts, while a golden is written
SAME = 0.01  # share of a number by which it may differ
NOTHING = 1e-9  # difference that is none

# of a claim: whose it is, its verdict, and what was measured -> number, or [lowest, highest]
Record = dict[str, Any]


def golden(name: str) -> dict[str, Record]:
    """Return claim -> record, of a paper."""
    return json.loads(GOLDEN.read_text(encoding="utf-8"))[name]


def quick_verdicts(name: str, only: list[str] | None = None) -> dict[str, Record]:
    """Return claim -> record of a quick audit, without timings; check whose runs it used."""
    # the verdicts are those of two, in less time
    with mock.patch.object(gain_search, "QUICK_SPREAD_SETS", 1):
        report = audit(name, only, GAINS.get(name), quick=True)
    for id, sets in report.used.items():
        check_runs(name, id, [run.scenario for used in sets.values() for run in used.values()])
    untimed = []
    for claim in report.claims:
        if (name, claim.id) not in TIMINGS:
            untimed.append(claim)
    return {claim.id: record(claim, paper(name).claims[claim.id].late) for claim in untimed}


def record(claim: Claim, late: bool) -> Record:
    """Return what a golden has of a claim: its checks with their limits, and what stands beside
    them.

    What stands beside a late claim counts the runs of all others, which are not all here.
    """
    numbers = {}
    for gains in claim.verdicts:
        for check in claim.checks(gains):
            numbers |= {
                f"{gains}: {check.what}": check.value,
                f"{gains}: {check.what} {check.relation}": check.limit,
            }
        numbers |= {
            f"{gains}: {what}": value for what, value in claim.beside[gains].items() if not late
        }
    return {"whose": claim.whose, "verdict": claim.verdict, "numbers": numbers}


def agrees(value: float, known: float | list[float]) -> bool:
    """Return whether a number is that of a golden, or in its range."""
    if isinstance(known, list):
        return known[0] <= value <= known[1]
    return value == pytest.approx(known, rel=SAME, abs=NOTHING, nan_ok=True)


def check_golden(found: dict[str, Record], known: dict[str, Record]) -> None:
    """Fail unless claims, verdicts, what was measured and its numbers are those of a golden."""
    assert {
        id: claim_record | {"numbers": [*claim_record["numbers"]]}
        for id, claim_record in found.items()
    } == {
        id: claim_record | {"numbers": [*claim_record["numbers"]]}
        for id, claim_record in known.items()
    }
    differing = {}
    for id, claim_record in found.items():
        for what, value in claim_record["numbers"].items():
            if not agrees(value, known[id]["numbers"][what]):
                differing[(id, what)] = (value, known[id]["numbers"][what])
    assert differing == {}


def check_runs(name: str, id: str, scenarios: list[Scenario]) -> None:
    """Runs are of the plants and laws that the claim names."""
    about = paper(name)
    entry = paper(name).claims[id]
    plants = {about.plant(plant_name).name for plant_name in entry.plants}
    laws = {*entry.laws, *(law + variant for law in entry.laws for variant in VARIANTS)}
    assert {scenario.plant.name for scenario in scenarios} <= plants, id
    assert {scenario.law.name for scenario in scenarios} <= laws, id


@contextlib.contextmanager
def runs_made_once(nudge: float = 0.0) -> Iterator[None]:
    """Simulate each run once, as claims share a third of all steps; move its start by a little."""
    trace_of_key = {}
    stream = claim_runs.stream

    def kept(scenarios, threads):
        keys = [run_key(scenario.named(None)) for scenario in scenarios]
        new = {
            name: scenario
            for name, scenario in zip(keys, scenarios, strict=True)
            if name not in trace_of_key
        }
        for i, trace in stream([moved(scenario, nudge) for scenario in new.values()], threads):
            name = list(new)[i]
            if nudge:
                trace_of_key[name] = dataclasses.replace(trace, scenario=new[name])
            else:
                trace_of_key[name] = trace
        return ((i, trace_of_key[name]) for i, name in enumerate(keys))

    claim_runs.stream = kept
    try:
        yield
    finally:
        claim_runs.stream = stream


def moved(scenario: Scenario, nudge: float) -> Scenario:
    """Return a scenario with another start; the same for none."""
    if not nudge:
        return scenario
    start = {}
    for name in ("x0", "v0"):
        start[name] = tuple(
            component * (1.0 + nudge) + nudge for component in getattr(scenario.resolved, name)
        )
    return dataclasses.replace(scenario, **start)


@pytest.mark.quick
def test_the_golden_has_every_claim_of_every_paper():
    claims = {}
    for name in shipped():
        claims[name] = [id for id in paper(name).claims if (name, id) not in TIMINGS]
    assert {name: list(golden(name)) for name in shipped()} == claims


QUICK = ["seeber_2020", "acary_2012"]  # the fewest steps
OTHERS = []
for name in shipped():
    if name not in ("gaber", *QUICK):
        OTHERS.append(pytest.param(name, marks=pytest.mark.slow))


@pytest.mark.parametrize("name", [*QUICK, *OTHERS])
def test_quick_verdicts_are_those_of_the_golden(name):
    with runs_made_once():
        check_golden(quick_verdicts(name), golden(name))


def spread(values: list[float]) -> float | list[float]:
    """Return a number to four digits, or seven times the range of what starts moved a little make
    of it.
    """
    first = values[0]
    low = min(values)
    high = max(values)
    if (
        math.isnan(first)
        or low == high
        or high - low <= max(0.5 * SAME * abs(first), 0.5 * NOTHING)
    ):
        return float(f"{first:.4g}")
    return [float(f"{low - 3.0 * (high - low):.3g}"), float(f"{high + 3.0 * (high - low):.3g}")]


def written(name: str) -> dict[str, Record]:
    """Return claim -> record for the golden of a paper."""
    audits = []
    for nudge in NUDGES:
        with runs_made_once(nudge):
            audits.append(quick_verdicts(name))
    first = audits[0]
    for id, claim_record in first.items():
        for what in claim_record["numbers"]:
            claim_record["numbers"][what] = spread(
                [audited[id]["numbers"][what] for audited in audits]
            )
    return first


if __name__ == "__main__":
    if GOLDEN.exists():
        verdicts_by_paper = json.loads(GOLDEN.read_text(encoding="utf-8"))
    else:
        verdicts_by_paper = {}
    verdicts_by_paper |= {name: written(name) for name in sys.argv[1:] or shipped()}
    reported = {
        name: ",\n".join(
            f"  {json.dumps(id)}: {json.dumps(claim_record)}"
            for id, claim_record in verdicts_by_paper[name].items()
        )
        for name in shipped()
        if name in verdicts_by_paper
    }
    lines = (f" {json.dumps(name)}: {{\n{claims}\n }}" for name, claims in reported.items())
    GOLDEN.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
