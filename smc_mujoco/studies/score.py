"""Scores of one trace, or of many scenarios without their traces."""

import itertools
import math
import random
from collections.abc import Hashable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, overload

from smc_mujoco.analysis.engine import Device
from smc_mujoco.common.constraints import constrained
from smc_mujoco.common.errors import ScenarioError, find, has, items_of, shown
from smc_mujoco.metrics import catalogue
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

if TYPE_CHECKING:
    from smc_mujoco.studies.table import Table

CHUNK = 20_000  # scenarios in memory at once
CHECKED = 20  # of the fast engine's runs, which MuJoCo makes again; chosen
METRICS = ("settling_time", "itae")
Scored = tuple[list[float], float | None]  # metrics, and the time of a failure, s


@overload
def score(runs: Trace) -> dict[str, float]: ...
@overload
def score(
    runs: Iterable[Scenario],
    metrics: Sequence[str] = METRICS,
    device: str = "cpu",
    threads: int | None = None,
) -> "Table": ...
@constrained
def score(
    runs: Any,
    metrics: Sequence[str] = METRICS,
    device: Device = "cpu",
    threads: int | None = None,
) -> "dict[str, float] | Table":
    """Score one trace, or many scenarios without keeping their traces.

    Metrics that compare channels are for networks only. For a cart with a pole, times and
    percentages of the motion are the worse of the two; metrics with a unit of length are the
    cart's.

    Args:
      runs: a Trace, of which every metric is returned; or any number of scenarios, also from a
        generator.
      metrics: of scenarios, names of metrics.
      device: of those scenarios that the fast engine can run, "cpu" or "cuda". MuJoCo runs the
        others.
      threads: as in `run`.

    Returns:
      Of a trace name -> value. Of scenarios a Table, a row a scenario: the metrics are null where a
      run failed, and `diverged_at` is its time, s. MuJoCo repeats 20 of the fast engine's runs; the
      Table says how far apart their scores are.

    Raises:
      ScenarioError: the trace diverged, failed or holds NaN; not a scenario, an unknown metric, or
        no such device.
    """
    if has(runs, "scenario") or not isinstance(runs, Iterable):
        return catalogue.score(runs)
    names = tuple(items_of("metrics", metrics))
    for name in names:
        find("metric", name, catalogue.CATALOGUE)
    return _table(runs, names, device, threads)


def _table(
    runs: Iterable[Scenario], metrics: tuple[str, ...], device: str, threads: int | None
) -> "Table":
    import pyarrow as pa

    from smc_mujoco.studies.table import Table

    columns = {"plant": pa.string(), "law": pa.string(), "condition": pa.string()}
    columns |= {"seed": pa.int64()} | dict.fromkeys((*metrics, "diverged_at"), pa.float64())
    schema = pa.schema(list(columns.items()))
    sample = _Sample(metrics)
    tables = []
    left = iter(runs)
    while chunk := list(itertools.islice(left, CHUNK)):
        rows = []
        for case, (values, failed) in zip(
            chunk, _scored(chunk, metrics, device, threads, sample), strict=True
        ):
            numbers = [value if failed is None else None for value in values]
            about = case.plant.name, case.law.name, case.condition, case.seed
            rows.append(dict(zip(columns, (*about, *numbers, failed), strict=True)))
        tables.append(pa.Table.from_pylist(rows, schema))
    data = pa.concat_tables(tables) if tables else schema.empty_table()
    return Table(data=data.replace_schema_metadata({"checked": sample.verdict(threads)}))


def _scored(
    cases: Sequence[Scenario],
    metrics: tuple[str, ...],
    device: str,
    threads: int | None,
    sample: "_Sample",
) -> list[Scored]:
    """Return the scores of scenarios, in their order."""
    from smc_mujoco.analysis.engine import group
    from smc_mujoco.simulation import prepare

    found: list[Scored] = [([], None)] * len(cases)
    members: dict[Hashable, list[int]] = {}
    for i, case in enumerate(cases):
        if not isinstance(case, Scenario):
            raise ScenarioError(f"cannot score {shown(case)}: give one Trace, or scenarios")
        key = None
        if not group.why_not(case, metrics, device):
            key = group.key(case)
        members.setdefault(key, []).append(i)
    for key, indices in members.items():
        some = [cases[i] for i in indices]
        if key is None or prepare.why_not(some[0]):
            scored: Iterable[Scored] = _by_mujoco(some, metrics, threads)
        else:
            scored = group.Group(some, metrics).scored(device, threads)
            sample.take(some, scored)
        for i, scores in zip(indices, scored, strict=True):
            found[i] = scores
    return found


def _by_mujoco(
    cases: Sequence[Scenario], metrics: tuple[str, ...], threads: int | None
) -> list[Scored]:
    from smc_mujoco.simulation.run import stream

    found: list[Scored] = [([], None)] * len(cases)
    for i, trace in stream(cases, threads):
        values = [math.nan] * len(metrics)
        if trace.diverged_at is None:
            values = [getattr(catalogue, name)(trace) for name in metrics]
        found[i] = values, trace.diverged_at
    return found


class _Sample:
    """Some runs of the fast engine, drawn evenly from all of them, for MuJoCo to make again."""

    def __init__(self, metrics: tuple[str, ...]):
        self.metrics = metrics
        self.random = random.Random(0)
        self.count = 0
        self.drawn: list[tuple[Scenario, Scored]] = []

    def take(self, cases: Sequence[Scenario], scored: Iterable[Scored]) -> None:
        """Consider runs, see J. S. Vitter, ACM Trans. Math. Softw. 11:37, 1985, algorithm R."""
        for pair in zip(cases, scored, strict=True):
            self.count += 1
            if len(self.drawn) < CHECKED:
                self.drawn.append(pair)
            elif (place := self.random.randrange(self.count)) < CHECKED:
                self.drawn[place] = pair

    def verdict(self, threads: int | None) -> str:
        """Return in words how far the scores are from MuJoCo's."""
        if not self.drawn:
            return "MuJoCo made all runs"
        others = _by_mujoco([case for case, _ in self.drawn], self.metrics, threads)
        parts = []
        for i, name in enumerate(self.metrics):
            apart = 0.0
            for (_, (values, _)), (own, _) in zip(self.drawn, others, strict=True):
                if math.isnan(values[i]) != math.isnan(own[i]):
                    apart = math.inf  # one of the two failed
                elif values[i] != own[i] and not math.isnan(own[i]):
                    apart = max(apart, abs(values[i] - own[i]))
            parts.append(f"{name} {apart:.1g}")
        return f"MuJoCo repeated {len(self.drawn)} runs, apart by at most {', '.join(parts)}"
