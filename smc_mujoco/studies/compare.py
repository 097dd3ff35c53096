"""Comparison of laws on plants in conditions, in one call: gains, runs, tables, verdicts, figures."""

import dataclasses
import functools
import itertools
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from smc_mujoco.analysis import paired_runs
from smc_mujoco.analysis.law_time import LawTime, law_time
from smc_mujoco.analysis.ranking import RELEVANT, Relevant
from smc_mujoco.analysis.tuning.objective import BUDGET, SEARCHES, Budget, Searches
from smc_mujoco.common.constraints import FilePath, Positive, Whole, constrained
from smc_mujoco.common.errors import MAX_ITEMS, ScenarioError, find, items_of, shown
from smc_mujoco.common.extras import package
from smc_mujoco.common.files import replacing
from smc_mujoco.common.tabular import Tables, Tabular
from smc_mujoco.common.text import joined
from smc_mujoco.control import gain_sets, source
from smc_mujoco.control.component import Template, gain_text
from smc_mujoco.control.law import Law, catalogue, suits
from smc_mujoco.control.properties import suitable
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation.conditions import Condition, applicable, find_condition
from smc_mujoco.simulation.grid import Starts, case, check_moving, check_names, listed, listed_laws
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies import executors
from smc_mujoco.studies.board import Boards
from smc_mujoco.studies.fair_gains import Candidate, Trial, law_or_template
from smc_mujoco.studies.leaderboard import METRICS, leaderboard, objective_boards
from smc_mujoco.studies.study import FULL, QUICK, Extent, Traces
from smc_mujoco.studies.table import Table

if TYPE_CHECKING:
    import pandas  # pyright: ignore[reportMissingImports]
    from matplotlib.figure import Figure, SubFigure

    from smc_mujoco.analysis.worst_case.uncertainty import Uncertainty
    from smc_mujoco.studies.worst_case import WorstCase

QUICK_SEARCHES = 6  # the fewest from which a verdict can follow, if it is the only one asked for
# plants times conditions that have a table each; if there are more, each plant has one table
MAX_BLOCKS = 12


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Compared(Tables):
    """Laws compared on plants in conditions. `print` and notebooks show its tables and verdicts."""

    table: Table  # a row for each run, with all its scores, as `smc.study` returns it
    # Plant -> the laws with all sets of gains that their runs used, and remarks on them
    candidates: Mapping[str, Sequence[Candidate]]
    # A board for each metric on each plant in each condition; on each plant, if that makes more
    # than 12 blocks
    leaderboard: Boards
    worst: Mapping[
        str, Mapping[str, "WorstCase"]
    ]  # plant -> law -> its `worst_case`; empty if it was not searched
    times: Mapping[
        str, Mapping[str, LawTime]
    ]  # plant -> law -> time of its compiled code a sample, on this machine

    @property
    def gains(self) -> dict[str, dict[str, Law]]:
        """Plant -> law -> the law with its best gains; `gains["duffing"]["classical"].source` says
        their source.
        """
        return {plant: {c.law.name: c.law for c in laws} for plant, laws in self.candidates.items()}

    @functools.cached_property
    def traces(self) -> list[Trace]:
        """The traces of the first seed: of each plant, in each condition, of each law; computed
        when first used.
        """
        first = min(self.table.column("seed").tolist())
        rows = [i for i, seed in enumerate(self.table.column("seed").tolist()) if seed == first]
        return run([self.table.scenario(i) for i in rows])

    @property
    def verdicts(self) -> list[str]:
        """A sentence for each metric on each plant in each condition: the winner, or why there is
        none.
        """
        return [board.verdict for board in self.leaderboard]

    @property
    def remarks(self) -> list[str]:
        """Remarks on the gains: which laws have their defaults, and why."""
        plants_of: dict[str, list[str]] = {}
        for plant, candidates in self.candidates.items():
            for candidate in candidates:
                default = "default gains" * (candidate.law.source.kind == source.DEFAULT)
                if words := "; ".join(filter(None, (default, candidate.remark))):
                    plants_of.setdefault(f"{candidate.law.name}: {words}", []).append(plant)
        return [f"{words} (on {joined(plants)})" for words, plants in plants_of.items()]

    @property
    def tables(self) -> list[Tabular]:
        """The tables of the `leaderboard`, then one of the gains with their sources."""
        rows = []
        for plant, candidates in self.candidates.items():
            for law, sets, _ in candidates:
                # inf: no bound, or a number of the plant
                told = {name: value for name, value in law.gains.items() if value != math.inf}
                best = ", ".join(f"{name}={gain_text(value)}" for name, value in told.items())
                rows.append((plant, law.name, law.source.kind, f"{len(sets)}", best))
        heads = ["plant", "law", "gains", "sets", "best set"]
        gains = Tabular(
            headings=heads, rows=rows, title="Gains", notes=self.remarks, left=len(heads)
        )
        return [*self.leaderboard.tables, *self._worst_tables, gains]

    @property
    def _worst_tables(self) -> list[Tabular]:
        if not self.worst:
            return []
        from smc_mujoco.studies.worst_case import WorstCases

        return [
            table
            for worst_cases in self.worst.values()
            for table in WorstCases(worst_cases.values()).tables
        ]

    def to_latex(self, path: str | os.PathLike[str] | None = None) -> str:
        """Return a LaTeX tabular for each plant in each condition, below comments with the
        verdicts; needs booktabs.

        Args:
          path: of a file to which it is written too.
        """
        text = "\n".join(
            table.to_latex() for table in [*self.leaderboard.tables, *self._worst_tables]
        )
        if path is not None:
            with replacing(Path(path)) as file:
                file.write_text(text, encoding="utf-8")
        return text

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a pandas DataFrame with a row for each law, plant, condition and metric.

        Its columns are plant, condition, law, gains (their source), metric, unit, median, low and
        high (the interval), failed (runs without a value), runs, best (whether no law is better),
        winner, worst_found: the rms error of the worst run that an adversary found on the plant,
        NaN without a search, and time, s, and time_ratio, see `times`. All runs are in
        `table.data.to_pandas()`.

        Raises:
          MissingPackageError: pandas is not installed.
        """
        with package("pandas", "Compared.to_pandas"):
            import pandas  # pyright: ignore[reportMissingImports]

        return pandas.DataFrame(list(self._rows()))

    def _rows(self) -> Iterator[dict[str, Any]]:
        """Yield the rows of `to_pandas`."""
        for board in self.leaderboard:
            plant = board.group.get("plant", "")
            worst = self.worst.get(plant, {})
            times = self.times.get(plant, {})
            for entry in board.entries:
                yield {
                    **{"plant": "", "condition": ""} | dict(board.group),
                    "law": entry.law,
                    "gains": ", ".join(dict.fromkeys(origin.kind for origin in entry.sources)),
                    "metric": board.metric,
                    "unit": board.unit,
                    "median": entry.interval.median,
                    "low": entry.interval.low,
                    "high": entry.interval.high,
                    "failed": entry.failed,
                    "runs": entry.runs,
                    "best": entry.rank.best,
                    "winner": board.winner == entry.law,
                    "worst_found": worst[entry.law].value if worst else math.nan,
                    "time": times[entry.law].median if entry.law in times else math.nan,
                    "time_ratio": times[entry.law].ratio if entry.law in times else math.nan,
                }

    def plot(
        self,
        path: str | os.PathLike[str] | None = None,
        metrics: Sequence[str] = (),
        **options: Any,
    ) -> "Figure | SubFigure":
        """Draw the medians with their intervals by condition, as `smc.plot` does with a table.

        Args:
          path, options: path, title, size, format and fig of `smc.figure`.
          metrics: names of metrics. Default: settling time, ultimate bound and variation of u.
        """
        from smc_mujoco.draw import dot_plot

        return dot_plot.plot(self.table, path, metrics or dot_plot.METRICS, **options)


@constrained
def compare(
    laws: str | Law | Template | Sequence[str | Law | Template] | None = None,
    plants: str | Plant | Sequence[str | Plant] | None = None,
    conditions: str | Condition | Sequence[str | Condition] | None = None,
    seeds: Annotated[int, Whole(low=1, high=MAX_ITEMS)] = SEARCHES,
    tune: bool = True,
    worst: "bool | Uncertainty" = False,
    executor: "executors.Workers | None" = None,
    *,
    out: Annotated[str | os.PathLike[str], FilePath()] = "compared",
    metrics: Sequence[str] = METRICS,
    duration: Positive | None = None,
    starts: Starts | None = None,
    gains: gain_sets.NameOfSet = "tuned",
    searches: Searches | None = None,
    budget: Budget = BUDGET,
    quick: bool = False,
    defaults: bool = False,
    relevant: Relevant = RELEVANT,
    traces: Traces = "none",
    threads: int | None = None,
    progress: bool = True,
) -> Compared:
    """Compare laws on plants in conditions, with gains by one rule for all, and say which is better
    and how sure it is.

    A law whose gains you gave keeps them. Any other law has those that come with the package for
    the plant, or is tuned by one rule, yours too: run i has the gains that search i found, so
    twelve searches are twelve answers to "what do I get if I tune it?". The folder keeps each
    search and each run: after a kill, the same call goes on from there.

    Args:
      laws: names, or your own laws. Default: those of the report's first page, of these the ones
        that come with gains for the plant, if any do; or else all that suit the plant.
      plants: names, or Plants, such as one from your own MJCF. Default: the paper's five.
      conditions: names, such as "noise + coulomb", texts, or your own, see `condition`. Default:
        one of each kind.
      seeds: runs of a law on each plant in each condition; each has another start and other noise,
        the same for every law, and the gains of the next search. With more seeds than searches,
        runs take these in turn.
      tune: whether to tune laws without gains for a plant; otherwise they run with their defaults.
      worst: whether to search the worst case of each law on each plant too; or the class in which
        to search it.
      executor, traces: as in `study`. Default: this machine, no traces.
      out: folder for gains and runs.
      metrics, defaults, relevant: as in `leaderboard`.
      duration: of a run, s. Default: 10, or 3 if quick; 8 under an adversary.
      starts: where runs begin, see `starts`. Default: within 20 % of the plant's own x0.
      gains: the set of gains of the package: "tuned", "tracking", "study" or "default".
      searches: searches of a tuning, which share nothing. Default: 12, or 6 if quick, which few
        verdicts follow from.
      budget: largest number of sets of gains that a search tries, for each gain.
      quick: shorter runs and fewer searches; by default three plants and three conditions.
      threads, progress: as in `run`.

    Raises:
      ScenarioError: an unknown name, or arguments that `grid`, `study` or `leaderboard` refuse.
    """
    workers = executors.as_executor("local" if executor is None else executor)
    for name in items_of("metrics", metrics):
        find("metric", name, dict.fromkeys((paired_runs.SETTLES, *CATALOGUE)))
    _check_worst(worst)
    trial = _trial(
        QUICK if quick else FULL, plants, conditions, duration, starts, Path(out), threads, progress
    )
    if searches is None:
        number = QUICK_SEARCHES if quick else SEARCHES
    else:
        number = searches
    options = {
        "tune": tune and gains == "tuned",
        "gains": gains,
        "searches": number,
        "budget": budget,
    }
    candidates = trial.gains(_checked(trial, laws), defaults, **options)
    table = trial.run(candidates, seeds, executor=workers, traces=traces)
    if worst:
        found = _worst_cases(trial, candidates, None if worst is True else worst, duration)
    else:
        found = {}
    if len(trial.plants) * len(trial.conditions) <= MAX_BLOCKS:
        by = paired_runs.GROUPS
    else:
        by = ("plant",)
    boards = leaderboard(table, metrics, by, defaults, relevant, found)
    unseen = trial.unseen(candidates, seeds)
    sources = {p: {c.law.name: (c.law.source,) for c in candidates[p]} for p in unseen}
    boards[:0] = objective_boards(unseen, sources, defaults, relevant)
    boards.times = times = _times(trial, candidates)
    return Compared(
        table=table, candidates=candidates, leaderboard=boards, worst=found, times=times
    )


def _trial(
    extent: Extent,
    plants: str | Plant | Sequence[str | Plant] | None,
    conditions: str | Condition | Sequence[str | Condition] | None,
    duration: float | None,
    starts: Starts | None,
    out: Path,
    threads: int | None,
    progress: bool,
) -> Trial:
    """Return the plants and conditions to compare laws on. The extent has the defaults."""
    if duration is None:
        length = extent.duration
    else:
        length = duration
    machines = []
    for plant in extent.plants if plants is None else listed("plants", plants):
        machines.append(as_plant(plant))
    if conditions is None:
        given = applicable(extent.conditions, machines, length)
    else:
        given = listed("conditions", conditions)
    return Trial(
        machines, [find_condition(name) for name in given], length, starts, out, threads, progress
    )


def _check_worst(worst: object) -> None:
    """Refuse what is neither a flag nor a class of disturbances."""
    if isinstance(worst, bool):
        return
    from smc_mujoco.analysis.worst_case.uncertainty import Uncertainty

    if not isinstance(worst, Uncertainty):
        raise ScenarioError(
            f"worst is {shown(worst)}: give True or a class, such as smc.Uncertainty(disturbance=1.0)"
        )


def _worst_cases(
    trial: Trial,
    candidates: Mapping[str, Sequence[Candidate]],
    within: "Uncertainty | None",
    duration: float | None,
) -> "dict[str, dict[str, WorstCase]]":
    """Return `Compared.worst`: the worst case of each law with its best gains on each plant."""
    from smc_mujoco.studies.worst_case import DURATION

    def attacked(plant: Plant, law: Law) -> "WorstCase":
        scenario = case(
            plant, law, "nominal", DURATION if duration is None else duration, starts=trial.starts
        )
        return trial.attack(f"{plant.name}-{law.name}", scenario, within)

    return {
        p.name: {c.law.name: attacked(p, c.law) for c in candidates[p.name]} for p in trial.plants
    }


def _times(
    trial: Trial, candidates: Mapping[str, Sequence[Candidate]]
) -> dict[str, dict[str, LawTime]]:
    """Return `Compared.times`, of the laws with their best gains, without those that do not
    compile.
    """

    def timed(plant: Plant) -> Iterator[tuple[str, LawTime]]:
        for candidate in candidates[plant.name]:
            if found := law_time(
                case(plant, candidate.law, trial.conditions[0], trial.duration, starts=trial.starts)
            ):
                yield candidate.law.name, found

    return {plant.name: dict(timed(plant)) for plant in trial.plants}


def _checked(trial: Trial, laws: Any) -> dict[str, list[Law | Template]]:
    """Return plant -> laws to compare on it.

    What cannot run is refused here, before gains are searched.
    """
    # a file is read once
    if laws is None:
        given = None
    else:
        given = [law_or_template(law) for law in listed_laws(laws)]
    compared = {
        plant.name: given or [law_or_template(law) for law in _usual(plant)]
        for plant in trial.plants
    }
    every = {id(law): law for its in compared.values() for law in its}.values()
    check_names(trial.plants, [coerce.law(law) for law in every], trial.conditions)
    for plant, condition in itertools.product(trial.plants, trial.conditions):
        check_moving([case(plant, "none", condition, trial.duration, starts=trial.starts)])
    return compared


def _usual(plant: Plant) -> list[Any]:
    """Return the laws to compare on a plant if none are given."""
    known = [name for name in gain_sets.COMPARED if suits(catalogue()[name], plant)]
    known = [name for name in known if gain_sets.in_set(plant, name, "tuned")] or known
    left_out = {"none", *gain_sets.ALIASES}  # aliases have the gains of laws that are there already
    return known or [law for law in suitable(plant=plant) if law.name not in left_out]
