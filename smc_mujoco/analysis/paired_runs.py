"""Paired runs: the runs of a table in groups, and in each the cells (plant, condition, seed) in
which every law ran.
"""

import contextlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from smc_mujoco.analysis.ranking import TREND_POWER, first_of_kind
from smc_mujoco.common.aliases import Array
from smc_mujoco.common.errors import ScenarioError, has, items_of, one_line, shown
from smc_mujoco.common.files import from_json
from smc_mujoco.common.text import joined
from smc_mujoco.control.source import Source, restored_source
from smc_mujoco.mechanisms.plant import plant_catalogue
from smc_mujoco.metrics.catalogue import CATALOGUE, metrics
from smc_mujoco.metrics.conventions import groups as channel_groups
from smc_mujoco.metrics.conventions import (
    late_metrics_judged,
    late_time,
    resolution,
    settles_in_time,
)
from smc_mujoco.simulation.scenario import Scenario

MIN_COMMAND_SHARE = 1e-3  # of the bound on u: smaller values of u matter on no machine; chosen
EPS = 1e-4  # of the start: smaller errors are not told apart, as gains have four digits; chosen
ROUNDING = 1e-9  # in SI units: smaller metrics count as 0 where results are compared
# a name used like a metric's: whether a run settles before its last part, see `settles_in_time`
SETTLES = "settles"
SETTLED = "settled runs (%)"  # what tables and figures call it
OBJECTIVE = "objective"  # a name used like a metric's: J on instances that no search has seen
OF_J = "groups of runs"  # what J is of, one run in each condition
UNITS = {metric.name: metric.unit for metric in metrics()}  # of what boards compare
UNITS |= {SETTLES: "", OBJECTIVE: "s^2"}
GROUPS = ("plant", "condition")
# of a scenario's description: what has gains, and what else may differ within a cell
GAIN_ENTRIES = ("law", "surface", "velocity")
OTHER_ENTRIES = ("model", "versions")


class RunColumns(Protocol):
    """A table with a row per run and columns plant, law, condition, seed, duration, failure,
    diverged_at, arrived, touched, and every metric.
    """

    def column(self, name: str) -> Array:
        """Return the values of a column, with None or NaN for missing ones."""
        ...

    def scenario(self, i: int) -> Scenario:
        """Return the scenario of row i. Raise ScenarioError if it cannot be restored."""
        ...


class ByRow(NamedTuple):
    """A metric of the rows of a table, each (rows,)."""

    values: Array  # see `values`
    # y', the same at half the physics step: inf for a run that then failed, NaN for none
    halves: Array
    trends: Array  # rho, see `metrics.catalogue.trends`; NaN for none
    arrived: Array  # 1.0 for a run that has arrived, else 0.0


def check_table(table: object) -> None:
    """Raise ScenarioError for what has no columns."""
    if not has(table, "column"):
        raise ScenarioError(f"table is {shown(table)}: give a study's, as smc.Table.read(path)")


def values(table: RunColumns, metric: str) -> Array:
    """Return a metric by row: inf for a failed run, and for one that has not arrived unless the
    metric is an error; NaN where it does not apply.

    "settles" is 0.0 for a run that settles in time, else 1.0. A metric does not apply to a plant if
    no successful run has it. A limit cycle that a run does not have counts as one of amplitude 0,
    see `Metric.absent`.
    """
    name = _column(metric)
    scores = np.array(table.column(name), float)
    scores[np.isnan(scores)] = CATALOGUE[name].absent
    plants = np.asarray(table.column("plant"), str)
    lost = failed(table)
    missing = np.isnan(scores) & ~lost
    scored = set(plants[~missing & ~lost])
    lacking = set(plants[missing]) - scored
    if not CATALOGUE[name].error:
        lost = lost | ~has_arrived(table)
    scores[lost] = np.inf
    scores[np.isin(plants, list(lacking))] = np.nan
    return _missed(scores, table) if metric == SETTLES else scores


def _column(metric: str) -> str:
    """Return the column that a metric is made of."""
    return {SETTLES: "settling_time"}.get(metric, metric)


def by_row(table: RunColumns, metric: str) -> ByRow:
    """Return a metric of the rows of a table, with what is charged to it."""
    name = _column(metric)
    scores = values(table, metric)
    halves = _from_json(table, "half_step", name, CATALOGUE[name].absent)
    if not CATALOGUE[name].error:
        halves[_from_json(table, "half_step", "arrived", 1.0) == 0.0] = np.inf
    halves[np.isnan(scores)] = np.nan
    trends = _from_json(table, "trends", name, np.nan)
    if metric == SETTLES:
        halves = _missed(halves, table)
        trends[:] = np.nan
    return ByRow(scores, halves, trends, has_arrived(table).astype(float))


def _missed(times: Array, table: RunColumns) -> Array:
    """Return by row 0.0 for a run that settles in time, else 1.0; NaN for no settling time."""
    durations = np.asarray(table.column("duration"), float)
    return np.where(np.isnan(times), np.nan, ~settles_in_time(times, durations))


def _from_json(table: RunColumns, column: str, name: str, absent: float) -> Array:
    """Return a number by row from a column of JSON objects, NaN where there is none; {} is a run
    that failed.
    """
    numbers_by_row = []
    for text in table.column(column).tolist():
        numbers = from_json(text) if text else {name: np.nan}
        numbers_by_row.append(numbers.get(name, absent) if numbers else np.inf)
    return np.array(numbers_by_row, float)


def has_arrived(table: RunColumns) -> Array:
    """Return which rows are runs that have arrived."""
    return table.column("arrived") == np.array(True)


def failed(table: RunColumns) -> Array:
    """Return which rows are runs that failed."""
    lost = np.array([failure is not None for failure in table.column("failure")], bool)
    times = np.array(table.column("diverged_at"), float)
    return lost | ~np.isnan(times)


def failures(table: RunColumns) -> list[str]:
    """Return a sentence for each law with failed runs: how many, and how the first one failed."""
    laws = np.asarray(table.column("law"), str)
    lost = failed(table)
    sentences = []
    for law in dict.fromkeys(laws[lost].tolist()):
        how = table.column("failure")[lost & (laws == law)]
        first = one_line(how[0] or "it diverged")
        sentences.append(f"{law} failed in {len(how)} of {sum(laws == law)} runs, first: {first}.")
    return sentences


def untouched(table: RunColumns) -> list[str]:
    """Return a sentence for each plant and condition with a contact that no run of some law, or of
    any law, touches.
    """
    names = ("plant", "condition", "law")
    runs = zip(*(table.column(name).tolist() for name in (*names, "touched")), strict=True)
    free: dict[tuple[str, str], dict[str, bool]] = {}  # block -> law -> whether no run touches
    for plant, condition, law, touched in runs:
        laws = free.setdefault((plant, condition), {})
        laws[law] = laws.get(law, True) and touched is False
    sentences = []
    for (plant, condition), laws in free.items():
        clear = []
        for law, alone in laws.items():
            if alone:
                clear.append(law)
        of_laws = "" if len(clear) == len(laws) else f" of {joined(clear)}"
        if clear:
            where = f"on {plant} under {condition}"
            sentences.append(
                f"No run{of_laws} touches a stop or an obstacle {where}, at any sample."
            )
    return sentences


class Scores(NamedTuple):
    """The scores of a group's laws in the blocks in which a metric applies, law -> (blocks, seeds);
    empty for none.
    """

    blocks: list[int]  # the numbers of these blocks in the group
    # NaN where not all laws ran, or every law did the same as with an earlier seed
    values: dict[str, Array]
    outcomes: dict[str, Array]  # as `RunGroup.outcome`
    sets: dict[str, Array]  # as `RunGroup.sets`
    halves: dict[str, Array]  # as `ByRow.halves`
    trends: dict[str, Array]  # as `ByRow.trends`
    arrived: dict[str, Array]  # as `ByRow.arrived`


class RunGroup:
    """The runs on a plant, or in one condition on it.

    Arrays are (laws, blocks, seeds), -1 where there is no run.
    """

    def __init__(self, name: Mapping[str, str], rows: Array, columns: Mapping[str, Array]):
        self.name = name  # the plant that they share, or plant and condition, as column -> value
        plants = columns["plant"].tolist()
        conditions = columns["condition"].tolist()
        keys = list(zip(plants, conditions, strict=True))
        self.blocks = tuple(dict.fromkeys(keys))  # (plant, condition)
        laws, law = np.unique(columns["law"], return_inverse=True)
        self.laws = tuple(laws.tolist())
        numbers, seed = np.unique(columns["seed"], return_inverse=True)
        blocks = [self.blocks.index(key) for key in keys]
        cells = law, blocks, seed
        shape = (3, len(laws), len(self.blocks), len(numbers))
        cubes = np.full(shape, -1)
        for cube, of_run in zip(cubes, (rows, columns["outcome"], columns["sets"]), strict=True):
            cube[cells] = of_run
        # the run's row in the table, a number equal for runs that differ by rounding alone, and one
        # equal for equal gains
        self.rows, self.outcome, self.sets = cubes
        for i in np.flatnonzero(self.rows[cells] != rows):
            raise ScenarioError(
                f"the table has several runs of {laws[law[i]]} on {', '.join(keys[i])}, seed "
                f"{numbers[seed[i]]}: give those of one set of gains and one duration"
            )

    @property
    def common(self) -> Array:
        """Whether every law ran, (blocks, seeds)."""
        return np.all(self.rows >= 0, axis=0)

    @property
    def seeds(self) -> tuple[int, ...]:
        """The number of seeds of each block in which every law ran."""
        return tuple(self.common.sum(axis=1).tolist())

    def scores(self, by_row: ByRow, judged: ArrayLike = True) -> Scores:
        """Return the scores of the laws in the blocks in which a metric applies, of those `judged`:
        all, or a value for each block.
        """
        ran = (self.rows >= 0) & np.atleast_1d(judged)[:, None]
        cubes = []
        for row in by_row:
            of_runs = np.where(ran, row[self.rows], np.nan)
            cubes.append(of_runs)
        cube = cubes[0]
        if np.isnan(cube).all():
            return Scores([], *[{}] * 6)
        common = ~np.isnan(cube).any(axis=0)
        if not common.any():
            where = ", ".join(self.name.values())
            raise ScenarioError(
                f"{', '.join(self.laws)} have no run of {where} in common: run them in the same "
                "conditions and seeds"
            )
        common &= first_of_kind(self.outcome, self.common)
        cube[:, ~common] = np.nan
        blocks = np.flatnonzero(common.any(axis=1))
        seeds = np.flatnonzero(common.any(axis=0))
        every_law = np.arange(len(self.laws))
        indices = np.ix_(every_law, blocks, seeds)
        parts = []
        for values in (cube, self.outcome, self.sets, *cubes[1:]):
            by_law = zip(self.laws, values[indices], strict=True)
            parts.append(dict(by_law))
        return Scores(blocks.tolist(), *parts)


def groups(table: RunColumns, by: Sequence[str]) -> list[RunGroup]:
    """Return the groups of a table, one for each plant, or for each plant and condition, in the
    order of its rows.
    """
    columns_shared = tuple(items_of("by", by))
    if columns_shared not in (GROUPS[:1], GROUPS):
        raise ScenarioError(f"by is {shown(by)}: give ('plant',) or ('plant', 'condition')")
    columns = {}
    for name in (*GROUPS, "law"):
        columns[name] = np.asarray(table.column(name), str)
    columns["seed"] = np.asarray(table.column("seed"), int)
    if not columns["seed"].size:
        raise ScenarioError("the table has no runs: run a study first")
    columns["outcome"] = _outcomes(table)
    columns["sets"] = _checked_sets(table, columns)
    rows_of: dict[tuple[str, ...], list[int]] = {}
    keys = zip(*(columns[name].tolist() for name in by), strict=True)
    for row, key in enumerate(keys):
        rows_of.setdefault(key, []).append(row)
    run_groups = []
    for key, rows in rows_of.items():
        of_group = {name: column[rows] for name, column in columns.items()}
        shared = dict(zip(by, key, strict=True))
        run_groups.append(RunGroup(shared, np.array(rows), of_group))
    return run_groups


def _checked_sets(table: RunColumns, columns: Mapping[str, Array]) -> Array:
    """Return a number for each row, equal for equal gains; refuse runs of a cell that differ in
    more than the law.
    """
    sets = []
    first: dict[tuple, tuple[str, dict[str, Any]]] = {}
    number_of: dict[str, int] = {}
    names = "plant", "condition", "seed", "law"
    runs = zip(*(columns[name].tolist() for name in names), table.column("scenario"), strict=True)
    for *cell, law, text in runs:
        about = json.loads(text)
        gains = json.dumps([about.pop(name, None) for name in GAIN_ENTRIES])
        sets.append(number_of.setdefault(gains, len(number_of)))
        for name in OTHER_ENTRIES:
            about.pop(name, None)
        about["plant"].get("mjcf", {}).pop("path", None)  # models are identified by their contents
        first_law, expected = first.setdefault(tuple(cell), (law, about))
        differing = []
        for name, value in expected.items():
            if value != about.get(name):
                differing.append(name)
        if differing:
            raise ScenarioError(
                f"runs of {cell[0]}, {cell[1]}, seed {cell[2]} are not alike: "
                f"{', '.join(differing)} of {first_law} and {law} differ: give runs that differ "
                "only in the law"
            )
    return np.array(sets, np.int64)


def _outcomes(table: RunColumns) -> Array:
    """Return a number for each row: equal for runs whose metrics are all equal up to rounding."""
    columns = []
    for name in (*CATALOGUE, "diverged_at"):
        columns.append(np.array(table.column(name), float))
    # to 20 binary digits, and below 1e-9 to 0
    share, exponent = np.frexp(np.stack(columns, axis=1))
    with np.errstate(over="ignore", invalid="ignore"):
        rounded = np.round(share * 2**20)
        numbers = np.ldexp(rounded, exponent - 20)
    numbers[np.abs(numbers) < ROUNDING] = 0.0
    numbers[np.isnan(numbers)] = -np.inf  # which no metric is; NaN would differ from itself
    distinct = np.unique(numbers, axis=0, return_inverse=True)
    return distinct[1].ravel()


def scenarios(table: RunColumns, group: RunGroup) -> list[Scenario | None]:
    """Return a scenario of each block of a group.

    It is None if its plant is a user's and cannot be loaded here.
    """
    scenarios: list[Scenario | None] = [None] * len(group.blocks)
    for k, rows in enumerate(group.rows.swapaxes(0, 1)):
        with contextlib.suppress(ScenarioError):
            first = int(rows[rows >= 0].min())
            scenarios[k] = table.scenario(first)
    return scenarios


def unit_of_x(plant: str, ran: Sequence[Scenario | None]) -> str:
    """Return the unit of positions on a plant, by its name or from runs on it; "" where it is not
    known.
    """
    library_plant = plant_catalogue().get(plant)
    if library_plant:
        return library_plant.unit
    for scenario in ran:
        if scenario:
            return scenario.plant.unit
    return ""


def unit_of_u(ran: Sequence[Scenario | None]) -> str:
    """Return the unit of u in runs where it is no force and the same in all, such as V; else ""."""
    efforts = set()
    for scenario in ran:
        if not scenario or scenario.force_command:
            efforts.add("")
        else:
            efforts.add(scenario.efforts[0])
    return efforts.pop() if len(efforts) == 1 else ""


def sources(table: RunColumns, rows: Array) -> dict[str, tuple[Source, ...]]:
    """Return law -> sources of its gains in some rows."""
    columns = [np.asarray(table.column(name))[rows] for name in ("law", "source", "search")]
    by_law: dict[str, tuple[Source, ...]] = {}
    of_laws = set(zip(*columns, strict=True))
    for law, kind, search in sorted(of_laws, key=str):
        about = {"kind": kind, "search": search and json.loads(search)}
        earlier = by_law.get(law, ())
        by_law[law] = (*earlier, restored_source(about))
    return by_law


class Least(NamedTuple):
    """The smallest values that matter in a problem, of what the units of metrics are made of."""

    share: float  # eps
    period: float  # of control, s
    duration: float  # s
    start: float  # X0, rad or m
    error: float  # rad or m, throughout a run
    seen: float  # rad or m, at one time of its last part, as the sensor gives it
    u: float


# A metric's unit -> its floor
FLOORS: dict[str, Callable[[Least], float]] = {
    "s": lambda q: q.period,
    "{x}": lambda q: q.seen,
    "%": lambda q: 100.0 * q.seen / q.start if q.start else 0.0,
    "{x} s": lambda q: q.error * q.duration,
    "{x} s^2": lambda q: q.error * q.duration**2 / 2,
    "({x})^2 s": lambda q: q.error**2 * q.duration,
    "{u}": lambda q: q.u,
    "{u}/s": lambda q: q.u,
    "({u})^2 s": lambda q: q.u**2 * q.duration,
    "{force}": lambda q: q.u,
    "": lambda q: q.share,
    "1/s": lambda q: 1 / q.duration,
    "Hz": lambda q: 1 / q.duration,
}


def without_floor(metric: str) -> str:
    """Return a sentence if no floor is known for a metric because of its unit; else ""."""
    entry = CATALOGUE.get(metric)
    if entry is None or entry.unit in FLOORS:
        return ""
    return f"no floor is known for a metric in {entry.unit!r}, so any difference counts"


def labels(table: RunColumns) -> dict[str, str]:
    """Return law -> its label, of the laws whose scenarios the table knows and that state one."""
    label_of = {}
    for scenario in getattr(table, "scenarios_by_key", {}).values():
        template = scenario.law.template
        if template and template.label:
            label_of[scenario.law.name] = template.label
    return label_of


def floor(scenario: Scenario | None, metric: str, eps: float = EPS) -> float:
    """Return q, the smallest value of a metric that matters in a problem, whatever the law; 0 where
    it is not known, see `without_floor`.

    With X0 the largest |x0| of a driven channel, of a free body from its rest, and T the duration
    it is, for

    - an error of the last part, and a share of the start: the largest of half a count of the
      encoder, the standard deviation of the noise and eps X0;
    - another error: eps X0; an integral of errors: that of an error that is eps X0 throughout, and
      so on;
    - a time: one control period; a rate: one event in the run; a ratio: eps;
    - u and its variation: MIN_COMMAND_SHARE of the bound on u, because u of a joint that friction
      holds varies by less.
    """
    if scenario is None or metric == SETTLES:
        return 0.0
    entry = CATALOGUE[metric]
    if entry.unit not in FLOORS:
        return 0.0
    away = np.subtract(scenario.resolved.x0, scenario.plant.origin)
    off = np.abs(away)
    start = 0.0
    counts = 0.0
    for group in channel_groups(scenario):
        if group.driven:
            of_group = off[list(group.channels)]
            start = max(start, float(of_group.max()))
            counts = max(counts, resolution(scenario, group))
    error = eps * start
    seen = max(error, counts)
    if entry.unit == "{x}" and not entry.late:
        seen = error
    least = Least(
        share=eps,
        period=scenario.control_period,
        duration=scenario.duration,
        start=start,
        error=error,
        seen=seen,
        u=MIN_COMMAND_SHARE * max(filter(math.isfinite, scenario.limits), default=0.0),
    )
    return FLOORS[entry.unit](least)


def is_judged(scenario: Scenario | None, metric: str) -> bool:
    """Return whether runs of this kind are long enough for a verdict on a metric, see
    `late_metrics_judged`.
    """
    entry = CATALOGUE.get(metric)
    if scenario is None or entry is None or not entry.late:
        return True
    return late_metrics_judged(scenario)


def trend_power(scenario: Scenario | None) -> float:
    """Return how many times the last part of a run fits into it."""
    late = late_time(scenario) if scenario else 0.0
    return scenario.duration / late if scenario and late else TREND_POWER


def floor_words(scenario: Scenario | None, metric: str) -> str:
    """Return q in words, such as "0.01 rad"; "" where it is not known."""
    if not (q := floor(scenario, metric)) or scenario is None:
        return ""
    return f"{q:.3g} {CATALOGUE[metric].unit_in(scenario)}".replace("e-0", "e-")
