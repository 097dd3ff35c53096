"""Enter a law in a suite: check its folder, run it, and write what it did.

    results/smc-30@1/soft relay/runs.parquet  # a row a run
    results/smc-30@1/soft relay/result.json   # the entry, failed runs, time a sample, versions

Until both are there, a folder of parts keeps the runs of each problem that is done.

The law runs in another process, so that one that crashes, never ends or fills the memory ends in a
sentence. That process is no sandbox.
"""

import functools
import hashlib
import os
import platform
import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated

from smc_mujoco.analysis.law_time import law_time
from smc_mujoco.common import guard
from smc_mujoco.common.aliases import AnyPath, Data, Fields
from smc_mujoco.common.cache import cached
from smc_mujoco.common.constraints import FilePath, constrained
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.files import read_json, reading, replacing, scratch, slug, write_json
from smc_mujoco.common.version import versions
from smc_mujoco.problems import entry as entries
from smc_mujoco.problems import runs, suite
from smc_mujoco.problems.problem import Problem, problem

START_TIME = 120.0  # s, for imports and compilation; chosen
RUN_TIME = 1.0  # s a run, thirty times what a compiled law takes; chosen
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
      ScenarioError: a folder that is no entry; a law that crashes, never ends, or takes too much
        memory; or, to verify, a result that is not what the entry gives.
    """
    entry = entries.read(folder)
    problems = [problem(cell) for cell in suite.suite(name)]
    count = instances or problems[0].visible
    target = Path(out) / suite.folder(name, seed) / slug(entry.name)
    if (target / RESULT).exists() and not verify:
        other = read_json(target / RESULT)["entry"]
        if other["digest"] != entry.digest:
            raise ScenarioError(
                f"{target} is the result of another entry, {shown(other['name'])}: "
                "give this one another name, or remove that folder"
            )
    with scratch() as temporary:
        table = temporary / TABLE
        parts = temporary if verify else target / PARTS
        report = _isolated(folder, problems, count, seed, table, parts)
        content = table.read_bytes()
    if verify:
        with reading(target / TABLE, "table of runs", "enter the law first") as file:
            same = file.read_bytes() == content
        if not same:
            raise ScenarioError(
                f"{target / TABLE} is not what {folder} gives here: enter it again, with the same "
                "versions"
            )
        return target
    with replacing(target / TABLE) as file:
        file.write_bytes(content)
    about = {
        "suite": name,
        "seed": seed,
        "instances": count,
        "entry": entry.about,
        "hashes": {"table": hashlib.sha256(content).hexdigest()} | made_under(suite.suite(name)),
        "versions": versions(),
        "machine": f"{platform.machine()}, {platform.system()}, {os.cpu_count()} cores",
    }
    write_json(target / RESULT, about | report)
    shutil.rmtree(target / PARTS)
    return target


def made_under(problems: Sequence[str]) -> dict[str, str]:
    """Return the hashes of the rules and of the list of a suite's problems."""
    texts = {"rules": problem(problems[0]).rules, "suite": "\n".join(problems)}
    return {name: hashlib.sha256(text.encode()).hexdigest() for name, text in texts.items()}


def _isolated(
    folder: AnyPath,
    problems: Sequence[Problem],
    instances: int,
    seed: int,
    table: Path,
    parts: Path,
) -> Fields:
    """Run an entry in another process, which keeps the runs of each problem, and writes the table
    at the end; return its report.
    """
    job = {
        "folder": os.path.abspath(folder) if os.path.isdir(folder) else str(folder),
        "problems": [one.id for one in problems],
        "instances": instances,
        "seed": seed,
        "table": str(table),
        "parts": os.path.abspath(parts),
    }
    runs_in_all = instances * sum(one.budget for one in problems)
    limit = START_TIME + RUN_TIME * runs_in_all
    try:
        return guard.run_isolated(__name__, job, limit)
    except guard.Failed as failed:
        if failed.fault or failed.code is not None:
            raise ScenarioError(f"the entry failed while {failed.stage}: {failed}") from failed
        raise ScenarioError(
            f"the entry is not done with {failed.stage} within {limit:.0f} s: let its law end"
        ) from failed


def worker(job: Data, report: Callable[[str], None]) -> Fields:
    """Run an entry in this process as a job says, and write its rows.

    Return how runs failed, and the law's time a sample, see `law_time`.
    """
    report("reading its folder")
    entry = entries.read(job["folder"])
    files = sorted(filter(Path.is_file, Path(job["folder"]).glob("*")))
    beside = [hashlib.sha256(path.read_bytes()).hexdigest() for path in files]  # it may import them
    instances = range(job["instances"])
    failures = list[str]()

    def made(one: Problem) -> tuple[list[runs.Row], list[str]]:
        report(f"making its law for {one.plant}")
        law = entry.law(one.plant)
        report(f"running {one.id}")
        return runs.rows(one, one.scenarios(law, instances, job["seed"]), instances)

    def groups() -> Iterator[list[runs.Row]]:
        for name in job["problems"]:
            rows, failed = cached(
                Path(job["parts"], f"{slug(name)}.json"),
                [name, entry.digest, beside, job["instances"], job["seed"]],
                functools.partial(made, problem(name)),
                lambda part, path: write_json(path, part),
                read_json,
            )
            failures.extend(failed)
            yield rows

    runs.write(Path(job["table"]), groups())
    report("timing its law")
    first = problem(job["problems"][0])
    (scenario,) = first.scenarios(entry.law(first.plant), [0])
    time = law_time(scenario)
    return {
        "failed": len(failures),
        "failures": failures[:FAILURES],
        "sample": None if time is None else list(time),
    }
