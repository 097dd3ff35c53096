"""The audit of a paper: its claims, each a function of runs, and the verdicts on them.

    result = audit("gaber", only=["3"])            # one claim, under every set of gains
    result.claims[0].verdict
    result.save("evidence.json")                   # claim, runs, numbers, threshold, verdict

Thresholds are written into the paper's file before its first run; the file says what was changed
after it. `verdict` says how checks become verdicts.
"""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from smc_mujoco.analysis.paired_runs import check_table
from smc_mujoco.common.constraints import Called
from smc_mujoco.common.errors import ScenarioError, find, items_of, shown, unknown
from smc_mujoco.common.files import with_ending, write_json
from smc_mujoco.common.version import __version__
from smc_mujoco.evidence.audit import gain_search
from smc_mujoco.evidence.audit.claim_runs import ClaimRuns, RunResult, Used, of_table
from smc_mujoco.evidence.audit.paper import ClaimEntry, Paper, failed
from smc_mujoco.evidence.audit.paper import paper as find_paper
from smc_mujoco.evidence.audit.verdict import Beside, Check, Claim, Claims, Evidence, judged
from smc_mujoco.studies.table import Table

DEFAULT_PAPER = "gaber"  # the paper that the suite was built for
CURE = "return measure -> number, or measure -> {case: number}"


@dataclasses.dataclass(frozen=True)
class Audit:
    """An audit of a paper."""

    paper: Paper
    claims: Claims  # with their verdicts, in the order of the paper's file
    quick: bool  # whether less was measured, as each claim says
    used: Mapping[
        str, Mapping[str, Mapping[str, Used]]
    ]  # claim -> set of gains -> run's key -> run that it used
    sealable: bool  # whether all runs were made here, none taken from a table

    def save(self, path: str | Path) -> Path:
        """Write the evidence to a .json file: claim -> runs -> numbers -> threshold -> verdict,
        sealed by a hash.

        With the same package versions and the same arithmetic of the machine, a second audit in a
        clean process writes the same file, to the last bit. The file holds no times, no paths and
        nothing about the machine. It leaves out numbers that differ from audit to audit, such as
        timings, and says so.

        Raises:
          ScenarioError: the name does not end in .json, or runs were taken from a table.
        """
        from smc_mujoco.evidence.audit import evidence

        return write_json(with_ending(path, ".json"), evidence.document(self))

    def _repr_html_(self) -> str:
        return self.claims._repr_html_()


def audit(
    paper: str | Path | Paper = DEFAULT_PAPER,
    only: Iterable[str | int] | None = None,
    gains: str | Sequence[str] | None = None,
    quick: bool = False,
    threads: int | None = None,
    *,
    table: Table | None = None,
    report: Callable[[int, int], None] = lambda done, whole: None,
) -> Audit:
    """Audit a paper: measure each claim against its threshold, and keep what every verdict rests
    on.

        smc.audit("./my_paper").save("evidence.json")

    Args:
      paper: a name of `smc-mujoco claims --papers`, or a folder.
      only: ids of the claims to audit; None for all.
      gains: names of the paper's sets of gains; None for all of them, or for its quick sets if
        `quick`.
      quick: whether to measure less, as each claim says: coarser grids, shorter runs.
      threads: simulations at once; None for one per available core.
      table: a study's table, whose runs are not made again.
      report: called with how much is done and how much there is: each claim counts once for each
        of its plants and each set of gains.

    Returns:
      An `Audit`: its `claims` with their verdicts, and `save(path)`.

    Raises:
      ScenarioError: an unknown paper, id or set of gains, or something is wrong with a file of the
        paper.
    """
    Called()("report", report)
    if isinstance(paper, Paper):
        audited = paper
    else:
        audited = find_paper(paper)
    rows = {}
    if table is not None:
        check_table(table)
        rows = of_table(table)
    shared: dict[str, RunResult] = {}
    entries = select_claims(audited, only)
    names = sets(audited, gains, quick)
    evidence: dict[str, dict[str, Evidence]] = defaultdict(dict)
    used: dict[str, dict[str, dict[str, Used]]] = defaultdict(dict)
    late_last = sorted(entries, key=lambda entry: entry.late)
    needed = len(names) * sum(map(_plants, entries))
    done = 0
    for name in names:
        runs = ClaimRuns(audited, name, quick, {}, threads, rows, shared)
        for entry in late_last:
            its_runs = runs.of(entry)
            evidence[entry.id][name] = measure(entry, its_runs)
            used[entry.id][name] = its_runs.used
            done += _plants(entry)
            report(done, needed)
    verdicts = Claims()
    for entry in entries:
        claim = judged(entry, evidence[entry.id])
        if quick and entry.quick:
            said = f"{entry.measured}; here, quickly, {entry.quick}"
            claim = dataclasses.replace(claim, measured=said)
        verdicts.append(claim)
    return Audit(audited, verdicts, quick, dict(used), table is None)


def _plants(entry: ClaimEntry) -> int:
    """Return how many plants a claim is about, at least 1."""
    return max(1, len(entry.plants))


def claims(
    table: Table | None = None,
    only: Iterable[str | int] | None = None,
    gains: str | Sequence[str] | None = None,
    quick: bool = False,
    threads: int | None = None,
    paper: str | Path | Paper = DEFAULT_PAPER,
) -> Claims:
    """Return the verdicts on a paper's claims, with the numbers behind them; arguments and errors
    as of `audit`.

        print(smc.claims(only=[1], quick=True))

    Returns:
      A `Claims`, a list of the claims with their verdicts.
    """
    return audit(paper, only, gains, quick, threads, table=table).claims


def select_claims(paper: Paper, only: Iterable[str | int] | None) -> list[ClaimEntry]:
    """Return the claims of some ids, or all for None, in the order of the file; refuse an unknown
    id.
    """
    claims = paper.claims
    if only is None:
        return list(claims.values())
    ids = set()
    for i in items_of("only", only):
        if isinstance(i, int | str):
            ids.add(str(i))
        else:
            ids.add(shown(i))
    for id in sorted(ids - set(claims)):
        raise unknown("claim", id, claims)
    return [entry for entry in claims.values() if entry.id in ids]


def sets(paper: Paper, gains: str | Sequence[str] | None, quick: bool) -> list[str]:
    """Return the sets of gains that `audit` takes for these arguments; refuse an unknown one."""
    if gains is None:
        return list(paper.quick_sets if quick else paper.sets)
    if isinstance(gains, str):
        names = [gains]
    else:
        names = items_of("gains", gains)
    for name in names:
        find("set of gains", name, paper.sets)
    if not names:
        raise ScenarioError(f"no set of gains is given: choose from {', '.join(paper.sets)}")
    return names


def document(claims: Sequence[Claim]) -> dict[str, Any]:
    """Return claims as JSON data: {"smc_mujoco": version, "claims": [...]}."""
    return {"smc_mujoco": __version__, "claims": list(map(dataclasses.asdict, claims))}


def measure(entry: ClaimEntry, runs: ClaimRuns) -> Evidence:
    """Return the checks of a claim under one set of gains, and the numbers beside them.

    A claim about all or some of the allowed gains is measured at the gains that decide it, unless
    other laws have the gains of another set in its search.
    """
    if entry.over and entry.rivals in ("", runs.gains):
        return gain_search.decisive(entry, runs, lambda at: _measured(entry, at))
    return _measured(entry, runs)


def _measured(entry: ClaimEntry, runs: ClaimRuns) -> list[Check | Beside]:
    """Return what a claim's function measures: checks, and numbers beside them."""
    try:
        returned = entry.evidence(runs)
    except (Exception, SystemExit) as error:  # whatever a user's function raises
        raise failed(runs.paper, entry, error) from error
    try:
        return list(_evidence(entry, returned))
    except ScenarioError as error:
        raise failed(runs.paper, entry, error) from None


def _evidence(entry: ClaimEntry, returned: Any) -> Iterator[Check | Beside]:
    """Yield checks and numbers from what a claim's function returned."""
    if not isinstance(returned, Mapping):
        if isinstance(returned, Sequence):
            items = returned
        else:
            items = [None]
        if not all(isinstance(item, Check | Beside) for item in items):
            raise ScenarioError(f"it returns {shown(returned)}: {CURE}")
        yield from returned
        return
    if not entry.thresholds:
        raise ScenarioError(
            "it returns numbers, and holds_if is a text: "
            'write a table, as { "exponent" = ">= 1.9" }'
        )
    values = {}
    for measure, item in returned.items():
        values[measure] = dict(_cases(measure, item))
    for threshold in entry.thresholds:
        if not values.get(threshold.measure):
            raise ScenarioError(
                f"it returns no {threshold.measure!r}, of which holds_if is: "
                f"its measures are {', '.join(map(str, values))}"
            )
        yield from threshold.evidence(values.pop(threshold.measure))
    for measure, cases in values.items():
        for case, value in cases.items():
            yield Beside(f"{case}: {measure}" if case else measure, value)


def _cases(measure: object, values: Any) -> Iterator[tuple[str, float]]:
    """Yield case -> number of a measure; the case is "" for a measure with one number."""
    for case, value in values.items() if isinstance(values, Mapping) else (("", values),):
        try:
            yield str(case), float(value)
        except (TypeError, ValueError):
            if case:
                where = f"{measure!r}, {case!r}"
            else:
                where = repr(measure)
            raise ScenarioError(f"it returns {shown(value)} for {where}: {CURE}") from None
