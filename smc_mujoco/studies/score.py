"""Scores of one trace, or of many scenarios without their traces."""

import itertools
from collections.abc import Iterable, Sequence
from typing import Any, overload

from smc_mujoco.analysis.engine import Device
from smc_mujoco.analysis.engine.scored_runs import ScoredRuns, worth_compiling
from smc_mujoco.common.constraints import constrained
from smc_mujoco.common.data import attributes
from smc_mujoco.common.errors import ScenarioError, find, has, has_items, items_of, shown
from smc_mujoco.metrics import catalogue
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.table import Table

CHUNK = 20_000  # scenarios in memory at once
METRICS = ("settling_time", "itae")


@overload
def score(runs: Trace, metrics: Sequence[str] | None = None) -> dict[str, float]: ...
@overload
def score(
    runs: Iterable[Scenario],
    metrics: Sequence[str] | None = None,
    device: str = "cpu",
    threads: int | None = None,
) -> Table: ...
@constrained
def score(
    runs: Any,
    metrics: Sequence[str] | None = None,
    device: Device = "cpu",
    threads: int | None = None,
) -> dict[str, float] | Table:
    """Score one trace, or many scenarios without keeping their traces.

        print(smc.score(smc.grid("duffing", "pid", seeds=100, duration=1.0), ["itae"]))

    Of several channels, integrals of errors and of u are sums, and every other metric is of the
    worst one. `smc.metrics.joint_scores` has each joint by itself, and
    `help("smc_mujoco.metrics.conventions")` all conventions.

    Metrics that compare channels are for networks only. For a cart with a pole, times and
    percentages of the motion are the worse of the two; metrics with a unit of length are the
    cart's. Some of the metrics:

    - settling_time in s from t = 0, also if the reference steps later; rise_time in s, from 10 % to
      90 % of the way; overshoot in % of the scale, the larger of the first error and r's range;
    - in rad or m: peak (of x), rms_error (of e, from a quarter of the run on), ultimate_bound
      (largest |e| in the last part: the last fifth, or whole periods of a periodic load or
      reference) and steady_error (|mean of e| there, which an oscillation leaves small); iae, ise,
      itae (of the whole run). The largest |e| of a run has no name: it is
      `np.abs(trace.x - trace.r).max()`;
    - of the command u, in N m or N: max_u, tv (sum of |changes of u|), tv_rate (per second) and
      energy (integral of u^2, times s);
    - chattering_amplitude of s, and chattering_frequency in Hz.

    `smc.score(trace)` has all names, and `help("smc_mujoco.metrics.catalogue")` all definitions and
    units.

    Args:
      runs: a Trace; or any number of scenarios, also from a generator.
      metrics: their names; default: every one of a Trace, and settling_time and itae of scenarios.
      device: of those scenarios that the fast engine can run, "cpu" or "cuda". On "cuda" MuJoCo
        Warp runs those of your own machines, if 256 or more are of one model. MuJoCo runs the
        others.
      threads: as in `run`.

    Returns:
      Of a trace name -> value. Of scenarios a Table, a row a scenario: the metrics are null where a
      run failed, and `diverged_at` is its time, s. A time is inf for "never", such as a
      settling_time; a metric is nan where it has no value, such as chattering without a limit
      cycle. MuJoCo repeats 20 runs that it did not make itself; the Table says how far apart the
      scores are, and why a card could not run some.

    Raises:
      ScenarioError: the trace diverged, failed or holds NaN; not a scenario, an unknown metric, or
        no such device.
    """
    names = METRICS if metrics is None else tuple(items_of("metrics", metrics))
    for name in names:
        find("metric", name, catalogue.CATALOGUE)
    if has(runs, "scenario") or not has_items(runs):
        values = catalogue.score(runs)
        return values if metrics is None else {name: values[name] for name in names}
    import pyarrow as pa

    columns = {"plant": pa.string(), "law": pa.string(), "condition": pa.string()}
    columns |= {"seed": pa.int64()} | dict.fromkeys((*names, "diverged_at"), pa.float64())
    schema = pa.schema(list(columns.items()))
    scored = ScoredRuns(attributes(catalogue, names), device, threads, False, worlds=True)
    tables = []
    remaining = iter(runs)
    while chunk := list(itertools.islice(remaining, CHUNK)):
        for case in chunk:
            if not isinstance(case, Scenario):
                raise ScenarioError(
                    f"cannot score {shown(case)}: give one Trace, or scenarios; score a list of "
                    "traces one at a time"
                )
        if not tables:
            worth = worth_compiling(sum(case.work for case in chunk))
            scored.worth_compiling = device != "cpu" or worth
        rows = []
        for case, (values, failed) in zip(chunk, scored.scored(chunk), strict=True):
            numbers = values if failed is None else (None,) * len(values)
            about = case.plant.name, case.law.name, case.condition, case.seed
            rows.append(dict(zip(columns, (*about, *numbers, failed), strict=True)))
        tables.append(pa.Table.from_pylist(rows, schema))
    data = pa.concat_tables(tables) if tables else schema.empty_table()
    return Table(
        data=data.replace_schema_metadata({"checked": scored.checked() or "MuJoCo made all runs"})
    )
