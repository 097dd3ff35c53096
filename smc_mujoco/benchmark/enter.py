"""Enter a law in a suite: check its folder, run it, and write what it did.

    results/smc-30@1/soft relay/runs.parquet    # a row a run
    results/smc-30@1/soft relay/result.json     # the entry, hashes, versions, machine, time a sample, marks

The law runs in a process of its own. A first run of one instance says whether it ends at all, and
how long all take. A law that is not checked (see `Law.checked`) runs twice, in two processes and
opposite orders, on fewer instances. If its answers differ, it keeps something between runs.
"""

import contextlib
import hashlib
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from smc_mujoco.benchmark import entrant, runs, suite
from smc_mujoco.benchmark import entry as entries
from smc_mujoco.benchmark.problem import problem, rules
from smc_mujoco.common.constraints import FilePath, constrained
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.files import read_json, reading, replacing, scratch, slug, write_json
from smc_mujoco.common.progress import bar
from smc_mujoco.common.version import versions

TRIAL_TIME = 120.0  # s, for the first run, compilation included; chosen
LEAST_TIME, SLACK = (
    120.0,
    20.0,
)  # s for all runs, and how much longer than in the trial a run may take; chosen
UNCHECKED_INSTANCES = (
    5  # of each problem, for laws that are not checked: a run of theirs takes half a second
)
APART, CHANCE = (
    0.1,
    1e-3,
)  # by how much ITAE is larger, and with which probability by chance; chosen
TABLE, RESULT = "runs.parquet", "result.json"  # of visible instances
HIDDEN = {TABLE: "hidden.parquet", RESULT: "hidden.json"}


@constrained
def enter(
    folder: str | os.PathLike[str],
    name: str = "smc-30@1",
    number: str = "",
    out: Annotated[str | os.PathLike[str], FilePath()] = "results",
    instances: int | None = None,
    verify: bool = False,
    progress: bool = False,
) -> Path:
    """Run an entry on a suite. Return the folder of its result.

    Args:
      folder: of the entry, see `entry`.
      name: of the suite.
      number: "" for the visible instances, or the 64 hex digits from which hidden ones are drawn.
      out: folder of the results.
      instances: of each problem; None: as many as the rules say, 5 for a law that is not checked.
      verify: whether to write nothing, but compare the runs with those of the result that is there.
      progress: whether to show a progress bar.

    Raises:
      ScenarioError: a folder that is no entry, a law that crashes, never ends, or takes too much
        memory; or a result that is not what the entry gives.
    """
    entry = entries.read(folder)
    problems = suite.suite(name)
    target = Path(out) / name / slug(entry.name)
    if (other := _entered(target)) not in ("", entry.name):
        raise ScenarioError(
            f"{target} is the result of {shown(other)}: give the entry another name"
        )
    table, result = (target / (HIDDEN[file] if number else file) for file in (TABLE, RESULT))
    with scratch() as temporary:
        made = temporary / TABLE
        first, count = _first_run(folder, problems, number, made, instances, progress)
        order = _order(folder, problems, range(count), number, made)
        report, marks = _all_runs(entry.name, order, first, progress)
        content = made.read_bytes()
        if verify:
            with reading(table, "table of runs", "enter the law first, without verify") as file:
                same = file.read_bytes() == content
            if not same:
                raise ScenarioError(
                    f"{table} is not what {folder} gives here: enter it again, with the same versions"
                )
            return target
        target.mkdir(parents=True, exist_ok=True)
        with replacing(table) as file:
            file.write_bytes(content)
    if number and (target / TABLE).exists():
        marks += _better_on_visible(runs.Runs(target / TABLE), runs.Runs(table))
    about = {
        "suite": name,
        "hidden": hashlib.sha256(number.encode()).hexdigest() if number else None,
        "instances": count,
        "entry": entry.about,
        "checked": not first["why_unchecked"],
        "marks": marks,
        "sample": first["sample"],
        "run": report["seconds"],
        "hashes": {"table": hashlib.sha256(content).hexdigest()} | made_under(problems),
        "versions": versions(),
        "machine": f"{platform.machine()}, {platform.system()}, {os.cpu_count()} cores",
    }
    write_json(result, about)
    return target


def _entered(target: Path) -> str:
    """Return the name of the entry whose result is in a folder; "" if there is none that can be
    read.
    """
    for file in (RESULT, HIDDEN[RESULT]):
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError, ScenarioError):
            return str(read_json(target / file)["entry"]["name"])
    return ""


def made_under(problems: Sequence[str]) -> dict[str, str]:
    """Return the hashes of the rules and of the list of a suite's problems."""
    texts = {"rules": problem(problems[0]).rules, "suite": "\n".join(problems)}
    return {name: hashlib.sha256(text.encode()).hexdigest() for name, text in texts.items()}


def _order(
    folder: str | os.PathLike[str],
    problems: Sequence[str],
    instances: Iterable[int],
    number: str,
    table: Path,
) -> dict[str, Any]:
    """Return the order for the process of an entry, see `entrant.run_isolated`."""
    if os.path.isdir(folder):
        where = os.path.abspath(folder)
    else:
        where = str(folder)
    runs_of = {"problems": list(problems), "instances": list(instances), "number": number}
    return runs_of | {"folder": where, "rows": str(table), "timed": False}


def _first_run(
    folder: str | os.PathLike[str],
    problems: Sequence[str],
    number: str,
    made: Path,
    instances: int | None,
    progress: bool,
) -> tuple[dict[str, Any], int]:
    """Run one instance.

    Return what is known of the law then, and how many instances of each problem it runs.
    """
    with bar("first run", shown=progress):
        order = _order(folder, problems[:1], [0], number, made) | {"timed": True}
        first = entrant.run_isolated(order, TRIAL_TIME)
    as_usual = rules(problem(problems[0]).version)["visible"]
    return first, instances or (UNCHECKED_INSTANCES if first["why_unchecked"] else as_usual)


def _all_runs(
    name: str, order: Mapping[str, Any], first: Mapping[str, Any], progress: bool
) -> tuple[dict[str, Any], list[str]]:
    """Run all instances.

    Return the report, and the marks that stand beside the entry wherever it is ranked.
    """
    unchecked = first["why_unchecked"]
    whole = len(order["problems"]) * len(order["instances"])
    limit = LEAST_TIME + SLACK * whole * first["seconds"]
    with bar(name, whole * (2 if unchecked else 1), progress, counted=True) as shown:
        report = entrant.run_isolated(order, limit, lambda done: shown.reached(done, shown.whole))
        if unchecked:
            marks = [f"unchecked: {unchecked}"]
        else:
            marks = []
        if report["failed"]:
            marks.append(
                f"{report['failed']} of {whole} runs fail, as {'; '.join(report['failures'])}"
            )
        if unchecked:
            once = Path(order["rows"])
            again = once.with_name(f"again {once.name}")
            turned = {key: order[key][::-1] for key in ("problems", "instances")} | {
                "rows": str(again)
            }
            entrant.run_isolated(
                dict(order) | turned, limit, lambda done: shown.reached(whole + done, shown.whole)
            )
            if where := entrant.same(once, again, order["problems"]):
                marks.append(
                    f"it answers {where} otherwise after other runs: it keeps something between runs"
                )
    return report, marks


def _better_on_visible(visible: runs.Runs, hidden: runs.Runs) -> list[str]:
    """Return a mark if an entry is worse on hidden instances, on more problems than chance would
    make it.
    """
    from scipy.stats import binomtest

    shown = visible.medians()
    kept = hidden.medians()
    both = [name for name in shown if name in kept and shown[name]["itae"] != kept[name]["itae"]]
    worse = sum(kept[name]["itae"] > (1.0 + APART) * shown[name]["itae"] for name in both)
    if not both or binomtest(worse, len(both), 0.5, "greater").pvalue > CHANCE:
        return []
    return [
        f"its ITAE is larger on hidden instances in {worse} of {len(both)} problems: it may know the visible ones"
    ]
