"""The process in which an entry's law runs: with bounds on time and memory, see `common.guard`."""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from smc_mujoco.benchmark import entry as entries
from smc_mujoco.benchmark import runs
from smc_mujoco.benchmark.problem import problem
from smc_mujoco.common import guard
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import scratch
from smc_mujoco.simulation.scenario import Scenario

MODULE = "smc_mujoco.benchmark.entrant"
POLL = 0.2  # s, between two looks at how many runs are done
AT_ONCE = 256  # runs of a problem whose scenarios are in memory: chosen
MAX_FAILURES = 3  # that are told


def worker(job: Mapping[str, Any], report: Callable[..., None]) -> dict[str, Any]:
    """Run an entry in this process as a job says, write its rows, and return what is known of
    its law.
    """
    report("reading its folder")
    entry = entries.read(job["folder"])
    instances = job["instances"]
    failures = list[str]()
    about: dict[str, Any] = {}
    done = 0
    spent = 0.0

    def groups() -> Iterator[list[runs.Row]]:
        nonlocal done, spent
        for name in job["problems"]:
            one = problem(name)
            report(f"making its law for {one.plant}")
            law = entry.law(one.plant)
            found = list[runs.Row]()
            for i in range(0, len(instances), AT_ONCE):
                part = instances[i : i + AT_ONCE]
                scenarios = one.scenarios(law, part, job["number"])
                if not about:
                    about.update(_about(entry, scenarios[0], timed=job["timed"]))
                report(f"running {name}")
                start = time.process_time()
                found += runs.rows(one, scenarios, part, failures)
                spent, done = spent + time.process_time() - start, done + len(part)
                Path(job["count"]).write_text(str(done), encoding="utf-8")
            yield found

    runs.write(Path(job["rows"]), groups())
    return about | {
        "seconds": spent / done,
        "failed": len(failures),
        "failures": failures[:MAX_FAILURES],
    }


def _about(entry: entries.Entry, scenario: Scenario, timed: bool) -> dict[str, Any]:
    """Return why the code of a law is not checked, "" if it is, and its time a sample: s, and the
    ratio to pid's.
    """
    why = entry.why_unread
    found = None
    if timed and not why:
        from smc_mujoco.analysis.law_time import law_time

        found = law_time(scenario)
    return {"why_unchecked": why, "sample": found and [found.median, found.high, found.ratio]}


def run_isolated(
    order: Mapping[str, Any], limit: float, reached: Callable[[int], None] = lambda done: None
) -> dict[str, Any]:
    """Run an entry in another process, and return its report; `limit` in s; `reached` hears how
    many runs are done.

    Args:
      order: folder, problems, instances, number, timed, and rows, the path of the table that is
        written.

    Raises:
      ScenarioError: the entry crashes, hangs, fills the memory or cannot be run: one sentence with
        what and where.
    """
    with scratch() as folder:
        count = folder / "count"
        outcome: list[Any] = []

        def work() -> None:
            try:
                outcome.append(
                    guard.run_isolated(MODULE, dict(order) | {"count": str(count)}, limit)
                )
            except guard.Failed as failed:
                outcome.append(failed)

        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        while thread.is_alive():
            thread.join(POLL)
            with contextlib.suppress(OSError, ValueError):
                reached(int(count.read_text(encoding="utf-8")))
    if isinstance(failed := outcome[0], guard.Failed):
        if failed.fault or failed.code is not None:
            why = entries.read(order["folder"]).why_unread
            raise ScenarioError(
                f"the entry failed while {failed.stage}: {failed}{why and f' ({why})'}"
            ) from failed
        raise ScenarioError(
            f"the entry is not done with {failed.stage} within {limit:.0f} s: let its law end"
        ) from failed
    return failed


def same(first: Path, second: Path, problems: Sequence[str]) -> str:
    """Return the first run that two tables answer differently, as "duffing/noise@1#03"; "" if all
    are equal.
    """
    one = runs.Runs(first)
    two = runs.Runs(second)
    for name in problems:
        a = one.columns(name)
        b = two.columns(name)
        differ = np.any(
            [~np.isclose(a[column], b[column], 0.0, 0.0, equal_nan=True) for column in a], axis=0
        )
        if differ.any():
            return f"{name}#{a['instance'][differ.argmax()]:02d}"
    return ""
