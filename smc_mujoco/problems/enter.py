"""Enter a law in a suite: check its folder, run it, and write what it did.

    results/smc-30@1/soft relay/runs.parquet  # a row a run
    results/smc-30@1/soft relay/result.json   # the entry, failed runs, time a sample, versions

Until both are there, a folder of parts keeps the runs of each problem that is done.

The law runs in this process, which it may crash: read it before you run it.
"""

import functools
import hashlib
import os
import platform
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

from smc_mujoco.analysis.law_time import law_time
from smc_mujoco.common.aliases import AnyPath, Fields
from smc_mujoco.common.cache import cached
from smc_mujoco.common.constraints import FilePath, constrained
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.files import read_json, reading, replacing, scratch, slug, write_json
from smc_mujoco.common.version import versions
from smc_mujoco.problems import entry as entries
from smc_mujoco.problems import entry_runs, suite
from smc_mujoco.problems.problem import Problem, problem

FAILURES = 3  # that a result shows
TABLE = "runs.parquet"
RESULT = "result.json"
PARTS = "parts"


@constrained
def enter(
    folder: AnyPath,
    name: str = "smc-30@1",
    seed: int = 0,
    out: Annotated[AnyPath, FilePath()] = "results",
    instances: int | None = None,
    verify: bool = False,
) -> Path:
    """Run an entry on a suite. Return the folder of its result.

    Args:
      folder: of the entry, see `entry`.
      name: of the suite.
      seed: of the instances; 0: the visible ones. A seed that is drawn when no entry can be changed
        any more gives instances that nobody could know.
      out: folder of the results.
      instances: of each problem; None: as many as the rules say.
      verify: whether to write nothing, but compare the runs with those of the result that is there.

    Raises:
      ScenarioError: a folder that is no entry; or, to verify, a result that is not what the entry
        gives.
    """
    entry = entries.read_entry(folder)
    problems = suite.suite(name)
    count = instances or problem(problems[0]).visible
    target = Path(out) / suite.folder(name, seed) / slug(entry.name)
    if not verify:
        _check_same_entry(target, entry.digest)
    with scratch() as temporary:
        table = temporary / TABLE
        parts = temporary if verify else target / PARTS
        report = run(folder, problems, count, seed, table, parts)
        content = table.read_bytes()
    if verify:
        _check_same_runs(target, folder, content)
        return target
    with replacing(target / TABLE) as file:
        file.write_bytes(content)
    about = {
        "suite": name,
        "seed": seed,
        "instances": count,
        "entry": entry.about,
        "hashes": {"table": hashlib.sha256(content).hexdigest()} | rules_digests(problems),
        "versions": versions(),
        "machine": f"{platform.machine()}, {platform.system()}, {os.cpu_count()} cores",
    }
    write_json(target / RESULT, about | report)
    shutil.rmtree(target / PARTS)
    return target


def _check_same_entry(target: Path, digest: str) -> None:
    """Raise ScenarioError if a folder has the result of another entry."""
    if not (target / RESULT).exists():
        return
    earlier = read_json(target / RESULT)["entry"]
    if earlier["digest"] != digest:
        raise ScenarioError(
            f"{target} is the result of another entry, {shown(earlier['name'])}: "
            "give this one another name, or remove that folder"
        )


def _check_same_runs(target: Path, folder: AnyPath, content: bytes) -> None:
    """Raise ScenarioError if the table of a result is not `content`, which its entry gives here."""
    with reading(target / TABLE, "table of runs", "enter the law first") as file:
        same = file.read_bytes() == content
    if not same:
        raise ScenarioError(
            f"{target / TABLE} is not what {folder} gives here: enter it again, with the same "
            "versions"
        )


def rules_digests(problems: Sequence[str]) -> dict[str, str]:
    """Return the hashes of the rules and of the list of a suite's problems."""
    texts = {"rules": problem(problems[0]).rules, "suite": "\n".join(problems)}
    digests = {}
    for name, text in texts.items():
        digests[name] = hashlib.sha256(text.encode()).hexdigest()
    return digests


def run(
    folder: AnyPath,
    problems: Sequence[str],
    count: int,
    seed: int,
    table: Path,
    parts: Path,
) -> Fields:
    """Run an entry, keep the runs of each problem in `parts`, and write the table at the end.

    Return how runs failed, and the law's time a sample, see `law_time`.
    """
    entry = entries.read_entry(folder)
    files = sorted(filter(Path.is_file, Path(folder).glob("*")))
    beside = []
    for path in files:
        beside.append(hashlib.sha256(path.read_bytes()).hexdigest())  # it may import them
    instances = range(count)
    failures = list[str]()

    def made(one: Problem) -> tuple[list[entry_runs.Row], list[str]]:
        return entry_runs.instance_rows(
            one, one.scenarios(entry.law(one.plant), instances, seed), instances
        )

    def groups() -> Iterator[list[entry_runs.Row]]:
        for name in problems:
            rows, failed = cached(
                parts / f"{slug(name)}.json",
                [name, entry.digest, beside, count, seed],
                functools.partial(made, problem(name)),
                lambda part, path: write_json(path, part),
                read_json,
            )
            failures.extend(failed)
            yield rows

    entry_runs.write_rows(table, groups())
    first = problem(problems[0])
    (scenario,) = first.scenarios(entry.law(first.plant), [0])
    time = law_time(scenario)
    return {
        "failed": len(failures),
        "failures": failures[:FAILURES],
        "sample": None if time is None else list(time),
    }
