"""Comparison of laws on plants in conditions, in one call: gains, runs, tables and verdicts."""

import contextlib
import dataclasses
import itertools
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from smc_mujoco.analysis import paired_runs
from smc_mujoco.analysis.bootstrap import Interval
from smc_mujoco.analysis.engine import Device
from smc_mujoco.analysis.law_time import LawTime, law_time
from smc_mujoco.analysis.ranking import Relevant, needed_to_rank, needed_to_win
from smc_mujoco.analysis.relevant import RELEVANT
from smc_mujoco.analysis.tuning.effort import Search
from smc_mujoco.analysis.tuning.objective import BUDGET, SEARCHES, Budget, Searches
from smc_mujoco.answers.answer import Answer
from smc_mujoco.answers.command import again, typed
from smc_mujoco.answers.facts import Barred, Contest, Fact, NextStep, Open, Screen
from smc_mujoco.common import html
from smc_mujoco.common.aliases import AnyPath, Fields, Names
from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.constraints import (
    Boolean,
    FilePath,
    Positive,
    Progress,
    SeedOf,
    Whole,
    constrained,
)
from smc_mujoco.common.errors import MAX_ITEMS, ScenarioError, find, items_of, shown, warn_once
from smc_mujoco.common.extras import package
from smc_mujoco.common.files import write_text
from smc_mujoco.common.tabular import Tabular, commented, plain_text
from smc_mujoco.common.text import counted, joined, number, span
from smc_mujoco.control import gain_sets, source
from smc_mujoco.control.component import Template, bounded, gains_text
from smc_mujoco.control.law import Law, law_catalogue, suits
from smc_mujoco.control.properties import suitable
from smc_mujoco.draw import wording
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.robustness.uncertainty import Uncertainty
from smc_mujoco.robustness.worst_case import DURATION, WorstCase, WorstCases
from smc_mujoco.simulation.conditions import Condition
from smc_mujoco.simulation.force_bounds import bounds_in_words
from smc_mujoco.simulation.grid import Draws, Starts, case, listed, listed_conditions, listed_laws
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.simulation.workers import Workers
from smc_mujoco.studies.board_numbers import unit_of
from smc_mujoco.studies.board_tables import Boards
from smc_mujoco.studies.contests import contests
from smc_mujoco.studies.fair_gains import Candidate, GainChoice, Trial, law_or_template
from smc_mujoco.studies.leaderboard import METRICS, Holdout, leaderboard, objective_boards
from smc_mujoco.studies.race import STUCK
from smc_mujoco.studies.study import FULL, QUICK
from smc_mujoco.studies.table import Table

if TYPE_CHECKING:
    import pandas  # pyright: ignore[reportMissingImports]
    from matplotlib.figure import Figure

# plants times conditions that have a table each; if there are more, each plant has one table
MAX_BLOCKS = 12
MAX_SEED = 10**6
DrawSeed = Annotated[int, SeedOf(high=MAX_SEED)]
TIMES = "Computing time of each compiled law per sample, on this computer"
TIME_HEADINGS = "plant", "law", "relative time", "median (s)", "99 % quantile (s)"
RUNS = "plant", "|u| at most", "starts", "control period (ms)", "duration (s)"
SI = "Values in conditions are in N or N m, m or rad, and s."
COUNTS = "Counts of encoders are per revolution or per metre."
MOST_STARTS = 3  # channels whose starts have room in a table
GAINS = "plant", "law", "gains", "searches", "evaluations", "J spread", "best set"
BEST_SET = (
    "The best set has the smallest J. A search tries by default at most "
    f"{BUDGET} sets for each gain. Tables show medians over all sets, and traces are of the first. "
    "`smc-mujoco list LAW`, or list FILE.py, has the units of a law's gains."
)


# what a machine has all at once: a condition and the field of a scenario that it sets
TOGETHER = {"friction": "friction", "encoder": "sensor", "delay_10ms": "input_delay"}
MOST_TOGETHER = 3  # conditions that were tried one by one; of more not all are of one machine
RIVALS = ("pid", "adrc", "super_twisting")  # to add to a single law
REPORT = "report.html"


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Compared(Answer):
    """Laws compared on plants in conditions. `print` and notebooks show the answer, `full` all
    tables.
    """

    table: Table  # a row for each run, with all its scores, as `smc.study` returns it
    # plant -> the laws with all sets of gains that their runs used, and remarks on them
    candidates: Mapping[str, Sequence[Candidate]]
    # a board for each metric on each plant in each condition; on each plant, if that makes more
    # than 12 blocks
    leaderboard: Boards
    # plant -> condition -> its fields there in words
    conditions: Mapping[str, Mapping[str, str]]
    # plant -> law -> its `worst_case`; empty if it was not searched
    worst: Mapping[str, Mapping[str, WorstCase]]
    # plant -> law -> time of its compiled code a sample, on this machine; in no file
    times: Mapping[str, Mapping[str, LawTime]]
    report: str = ""  # the page that was written; "" for none

    @property
    def screen(self) -> Screen:
        """The answer: a block for each plant and condition, and what to know and do."""
        if not self._contests:
            return self.leaderboard.screen
        return Screen(
            contests=self._contests,
            facts=[self._defaults, *self.leaderboard.bewares],
            next=self._next,
            report=self.report,
            word="lead",
        )

    @property
    def _defaults(self) -> Fact:
        """The laws that ran with the gains of their own files."""
        laws = {}
        for candidates in self.candidates.values():
            for law, *_ in candidates:
                if law.source.kind == source.DEFAULT and law.gains:
                    laws[law.name] = None
        return Fact("defaults", laws=list(laws))

    @cached_property
    def _contests(self) -> tuple[Contest, ...]:
        """What is said of each plant in each condition."""
        gains: dict[str, dict[str, str]] = {}
        own = {}
        for plant, candidates in self.candidates.items():
            of_plant = gains.setdefault(plant, {})
            for law, *_ in candidates:
                finite = bounded(law.gains).items()
                of_plant[law.name] = ", ".join(f"{name}={value:.3g}" for name, value in finite)
                if law.name not in law_catalogue():
                    own[law.name] = None
        return contests(self.leaderboard, gains, tuple(own))

    @property
    def _next(self) -> NextStep | None:
        """What to do next: the first step of these that applies."""
        facts = [fact for contest in self._contests for fact in contest.verdicts]
        needed = max((fact.needed for fact in facts if isinstance(fact, Open)), default=0)
        laws = dict.fromkeys(itertools.chain.from_iterable(self.gains.values()))
        seeds = max(contest.sample.values["seeds"] for contest in self._contests)
        of_runs = all(fact.unit == "runs" for fact in facts if isinstance(fact, Open))
        more_runs = {"--seeds": f"{needed}"} if of_runs else _sets(needed)
        barred = any(isinstance(fact, Barred) and fact.defaults for fact in facts)
        winning = {"--allow-defaults": ""}, "lets a law win over default gains"
        if typed("--gains") == "default":
            winning = {"--gains": None}, "searches gains, so that a law may win"
        undecided = any(
            contest.use and contest.use.values.get("rivals") for contest in self._contests
        )
        steps = [
            (not facts, {"--law": ",".join(laws | dict.fromkeys(RIVALS))}, "adds rivals"),
            (barred, *winning),
            (needed, more_runs, "makes enough runs to decide what is open"),
            (undecided, _sets(2 * max(SEARCHES, seeds)), "shows smaller leads"),
            (
                self._together,
                {"--condition": self._together},
                "tries what a machine has, all at once",
            ),
            (not self.worst, {"--worst": ""}, "searches the worst case of each law"),
        ]
        for applies, options, purpose in steps:
            if applies:
                return NextStep(again(options), purpose)
        return None

    @property
    def _together(self) -> str:
        """The conditions that were asked for and those that a machine has, as one; "" if one of
        them was all that, or some do not suit the plants.
        """
        names = dict.fromkeys(itertools.chain.from_iterable(self.conditions.values()))
        names.pop("nominal", None)
        first = next(iter(self._first_runs.values()))
        if len(names) > MOST_TOGETHER:
            return ""
        with contextlib.suppress(ScenarioError):
            fields: set[str] = set()
            for condition in listed_conditions(list(names)):
                fields |= condition.on(first.plant, first.duration).keys()
            names |= {name: None for name, field in TOGETHER.items() if field not in fields}
            for condition in listed_conditions("+".join(names)):
                for scenario in self._first_runs.values():
                    self._in(condition, scenario)
            if len(names) > 1:
                return "+".join(names)
        return ""

    @staticmethod
    def _in(condition: Condition, run: Scenario) -> Scenario:
        """Return a run's plant without a law in a condition, which may refuse it."""
        fields = condition.on(run.plant, run.duration)
        return Scenario.recorded(plant=run.plant, law="none", duration=run.duration, **fields)

    @property
    def gains(self) -> dict[str, dict[str, Law]]:
        """Plant -> law -> the law with its best gains; `gains["duffing"]["classical"].source` says
        their source.
        """
        by_plant: dict[str, dict[str, Law]] = {}
        for plant, candidates in self.candidates.items():
            by_plant[plant] = {}
            for law, *_ in candidates:
                by_plant[plant][law.name] = law
        return by_plant

    @cached_property
    def traces(self) -> list[Trace]:
        """The traces of the first seed: of each plant, in each condition, of each law; computed
        when first used. A law has the gains of its first search there, `trace.scenario.law.gains`,
        and not those of `gains`.

        A figure has one plant: `smc.figure([t for t in compared.traces if t.scenario.plant.name ==
        "duffing" and t.scenario.condition == "friction"])`.
        """
        seeds = self.table.column("seed")
        rows = (seeds == seeds.min()).nonzero()[0].tolist()
        return run(list(map(self.table.scenario, rows)))

    @property
    def verdicts(self) -> list[str]:
        """A line for each metric on each plant in each condition: who wins and by how much, or why
        nobody does.
        """
        return list(map(repr, self.leaderboard))

    @property
    def remarks(self) -> list[str]:
        """Remarks on the gains: which laws have their defaults, and why."""
        plants_of: dict[tuple[str, str], list[str]] = {}
        for plant, candidates in self.candidates.items():
            for candidate in candidates:
                words = [candidate.remark]
                if candidate.law.source.kind == source.DEFAULT:
                    words.insert(0, "default gains")
                search = candidate.law.source.search
                if search and search.spread > STUCK - 1.0:
                    apart = f"the final J values of its searches differ by up to {search.apart}"
                    words.append(f"{apart}, so where it trails, a search that was stuck may be why")
                if any(words):
                    key = candidate.law.name, "; ".join(filter(None, words))
                    plants_of.setdefault(key, []).append(plant)
        remarks = []
        for (law, words), on in plants_of.items():
            remarks.append(f"{law} on {joined(on)}: {words}.")
        return remarks

    @property
    def tables(self) -> list[Tabular]:
        """The tables of the `leaderboard`, of worst cases, of times, of runs and of gains."""
        tables = self._without_times
        times = []
        for plant, by_law in self.times.items():
            for law, time in by_law.items():
                # to two digits: those of repeated calls differ by tens of percent
                of_law = [number(value, 2) for value in (time.ratio, time.median, time.high)]
                times.append((plant, law, *of_law))
        if times:
            tables.append(Tabular(headings=TIME_HEADINGS, rows=times, title=TIMES, name_columns=2))
        return [*tables, self._table_of_runs, self._table_of_gains]

    @property
    def _table_of_runs(self) -> Tabular:
        """The table of the runs on each plant, with what differs by condition in one cell, and
        below it each condition.
        """
        rows = []
        for plant, first in self._first_runs.items():
            runs = self._runs(plant, first.law.name)
            bounds = joined(dict.fromkeys(map(bounds_in_words, runs)), "or")
            periods = dict.fromkeys(f"{1e3 * run.control_period:g}" for run in runs)
            starts = self._starts(runs)
            rows.append((plant, bounds, starts, joined(periods, "or"), f"{first.duration:g}"))
        plants_of: dict[tuple[str, str], list[str]] = {}
        for plant, of_plant in self.conditions.items():
            for pair in of_plant.items():
                plants_of.setdefault(pair, []).append(plant)
        notes = []
        for (name, words), on in plants_of.items():
            where = f" on {joined(on)}" if len(on) < len(self.conditions) else ""
            notes.append(f"{name}{where}: {words}")
        units = f"{SI} {COUNTS}" if "counts=" in "".join(notes) else SI
        failed = len(self.table) - self.table.data["failure"].null_count
        count = f"{counted(len(self.table), 'run')}, {failed} stopped early."
        return Tabular(
            headings=RUNS, rows=rows, title="Runs", notes=[*notes, units, count], name_columns=3
        )

    def _runs(self, plant: str, law: str) -> list[Scenario]:
        """Return the runs of a law on a plant; other laws have the same but for their own law."""
        own = (self.table.column("plant") == plant) & (self.table.column("law") == law)
        return list(map(self.table.scenario, np.flatnonzero(own).tolist()))

    @staticmethod
    def _starts(runs: Sequence[Scenario]) -> str:
        """Return the range of the starts of runs, of each channel; "" of many channels."""
        plant = runs[0].plant
        if plant.n > MOST_STARTS:
            return ""
        starts = np.array([run.resolved.x0 for run in runs])
        ranges = []
        for low, high, unit in zip(starts.min(0), starts.max(0), plant.units, strict=False):
            ranges.append(f"{span(number(low), number(high)) or number(low)} {unit}")
        return joined(ranges)

    @property
    def _table_of_gains(self) -> Tabular:
        """The table of gains: their sources, the best sets, and remarks."""
        gains = []
        notes = self.remarks
        for plant, candidates in self.candidates.items():
            for law, sets, _ in candidates:
                if len(sets) > 1 and BEST_SET not in notes:
                    notes = [BEST_SET, *notes]
                search = law.source.search
                tried, apart = (f"{search.evaluations}", search.apart) if search else ("", "")
                about = law.source.words, f"{len(sets)}", tried, apart
                gains.append((plant, law.name, *about, gains_text(bounded(law.gains))))
        return Tabular(headings=GAINS, rows=gains, title="Gains", notes=notes, name_columns=7)

    @property
    def _without_times(self) -> list[Tabular]:
        """The tables that are the same in every call: of the `leaderboard`, and of worst cases."""
        tables = self.leaderboard.tables
        if self.worst:
            for cases in self.worst.values():
                tables += WorstCases(cases.values()).tables
        return tables

    def to_latex(self, path: AnyPath | None = None) -> str:
        """Return a LaTeX tabular for each plant and condition, which its first line names: put each
        into a float of its own; needs booktabs.

        The last line of the comment over a tabular narrows it, where you copy it to just before the
        tabular: then, in a paper of 10 pt, two metrics are about 200 pt wide and three up to 252
        pt, which is a column. Five are about 400 pt without that line, and table* has 516. Only the
        last board says what intervals, metrics and bold type are. Comments have the verdicts, and
        at the top the bounds on u, each condition, the gains, and remarks on them.

        Args:
          path: of a file to which it is written too.
        """
        comments = []
        for table in (self._table_of_runs, self._table_of_gains):
            comments.append(f"{commented(plain_text(table))}\n")
        text = "\n".join([*comments, *(table.to_latex() for table in self._without_times)])
        if path is not None:
            write_text(Path(path), text)
        return text

    @property
    def title(self) -> str:
        """The title of the page: the laws and the plants."""
        laws = dict.fromkeys(itertools.chain.from_iterable(self.gains.values()))
        return f"{joined([*map(wording.law_name, laws)])} on {joined(self._plant_names)}"

    @property
    def words(self) -> Names:
        """The words that the page explains."""
        return self.leaderboard.words

    @property
    def pictures(self) -> list[html.Html]:
        """The figure of `plot`; none without a metric."""
        if not self._metrics:
            return []
        about = "Medians with their intervals by condition, as in the tables"
        return [
            html.picture(lambda file, size: self.plot(file, size=size, format="svg"), about),
        ]

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a pandas DataFrame with a row for each law, plant, condition and metric.

        Its columns are plant, condition, law, gains (their source), metric, unit, median, low and
        high (the interval), failed (runs without a value), runs, best (whether no law is better)
        and winner. The metric "objective" is J on unseen runs, over all conditions together; its
        condition is "". All runs are in `table.data.to_pandas()`.

        Raises:
          MissingPackageError: pandas is not installed.
        """
        with package("pandas", "Compared.to_pandas"):
            import pandas  # pyright: ignore[reportMissingImports]

        return pandas.DataFrame(list(self._rows()))

    def _rows(self) -> Iterator[Fields]:
        """Yield the rows of `to_pandas`."""
        for board in self.leaderboard:
            for entry in board.entries:
                yield {
                    "plant": board.group.get("plant", ""),
                    "condition": board.group.get("condition", ""),
                    "law": entry.law,
                    "gains": source.kinds(entry.sources),
                    "metric": board.metric,
                    "unit": unit_of(board),
                    "median": entry.interval.median,
                    "low": entry.interval.low,
                    "high": entry.interval.high,
                    "failed": entry.failed,
                    "runs": entry.runs,
                    "best": entry.rank.best,
                    "winner": board.winner == entry.law,
                }

    @property
    def _plant_names(self) -> list[str]:
        """The names of the plants in pictures."""
        return [wording.plant_name(scenario.plant) for scenario in self._first_runs.values()]

    @property
    def _first_runs(self) -> dict[str, Scenario]:
        """Plant -> its first run."""
        rows: dict[str, int] = {}
        for row, plant in enumerate(self.table.column("plant").tolist()):
            rows.setdefault(plant, row)
        return {plant: self.table.scenario(row) for plant, row in rows.items()}

    @property
    def _metrics(self) -> list[str]:
        """The metrics compared, without J."""
        compared = {}
        for board in self.leaderboard:
            if board.metric != paired_runs.OBJECTIVE:
                compared[board.metric] = None
        return [*compared]

    def plot(
        self,
        path: AnyPath | None = None,
        metrics: Sequence[str] = (),
        **options: Any,
    ) -> "Figure":
        """Draw the medians with their intervals by condition, as `smc.plot` does with a table, and
        a ring around each winner.

        Args:
          path, options: path, title, size, format and fig of `smc.figure`.
          metrics: names of metrics. Default: J, where each plant has one condition, and with it
            five of those compared, or on a page narrower than 6 in as many as fit, three at most;
            first those in which a law wins. The settled runs come last, and only where some do
            not. A ScenarioWarning names the others.
        """
        from smc_mujoco.draw import dot_plot, page

        names = list(metrics)
        objectives = {}
        if not names:
            objectives = self._objectives
            width, _ = page.measure(options.get("size"), options.get("fig"))
            counts = list(map(len, self.conditions.values()))
            laws = max(map(len, self.candidates.values()))
            most = dot_plot.room_for_metrics(width, laws, counts)
            if width < page.NARROW and objectives:
                most = max(1, most - 1)
            compared = self._metrics
            if not paired_runs.values(self.table, paired_runs.SETTLES).any():
                compared = [name for name in compared if name != paired_runs.SETTLES]
            won = {cell[0] for cell in self.leaderboard.winners}
            last = paired_runs.SETTLES
            first = sorted(compared, key=lambda name: (name not in won, name == last))[:most]
            names = [name for name in compared if name in first]
            if omitted := [name for name in compared if name not in first]:
                warn_once(
                    f"plot leaves out {joined(omitted)}: draw the rest with metrics={omitted}"
                )
        won = [*self.leaderboard.winners]
        for metric, plant, _, law in self.leaderboard.winners:
            won += [cell for cell in objectives if (*cell[:2], cell[3]) == (metric, plant, law)]
        drawn: dict[str, Any] = {"winners": won, "objectives": objectives}
        return dot_plot.plot(self.table, path, names, **drawn, **options)

    @property
    def _objectives(self) -> dict[tuple[str, str, str, str], Interval]:
        """J by metric, plant, condition and law, where each plant has one condition."""
        if any(len(conditions) > 1 for conditions in self.conditions.values()):
            return {}
        intervals = {}
        for board in self.leaderboard:
            if board.metric == paired_runs.OBJECTIVE:
                plant = board.blocks[0].plant
                (condition,) = self.conditions[plant]
                for entry in board.entries:
                    intervals[board.metric, plant, condition, entry.law] = entry.interval
        return intervals


def _sets(count: int) -> dict[str, str]:
    """Return the options for so many sets of gains and runs."""
    return {"--seeds": f"{count}", "--searches": f"{count}"}


@constrained
def compare(
    laws: str | Law | Template | Sequence[str | Law | Template] | None = None,
    plants: str | Plant | Sequence[str | Plant] | None = None,
    conditions: str | Condition | Sequence[str | Condition] | None = None,
    seeds: Annotated[int, Whole(low=1, high=MAX_ITEMS)] = SEARCHES,
    tune: Boolean = True,
    worst: bool | Uncertainty = False,
    *,
    out: Annotated[AnyPath, FilePath()] = "compared",
    metrics: Sequence[str] = METRICS,
    duration: Positive | None = None,
    starts: Starts | None = None,
    gains: gain_sets.NameOfSet = "tuned",
    searches: Searches | None = None,
    budget: Budget = BUDGET,
    quick: Boolean = False,
    defaults: Boolean = False,
    relevant: Relevant = RELEVANT,
    threads: int | None = None,
    progress: Progress = True,
    seed: DrawSeed = 0,
    device: Device = "cpu",
    executor: Workers | None = None,
) -> Compared:
    """Compare laws on plants in conditions, with gains by one rule for all, and say which is better
    and how certain the answer is.

        compared = smc.compare(["pid", "adrc"], "duffing", "friction", seeds=3, out="compared")
        print(compared)

    A law whose gains you gave keeps them. Otherwise a law of the package has the gains that are
    shipped for the plant. If there are none, or if the law is your own, it is tuned by
    one rule, the same for all. Run i has the gains that search i found, so twelve searches are
    twelve answers to "what do I get if I tune it?". The folder keeps each search and each run:
    after a kill, the same call resumes there.

    Args:
      laws: names, or your own laws. Default: the usual ones, of these the ones
        that come with gains for the plant, if any do; or else all that suit the plant.
      plants: names, or Plants, such as one from your own MJCF. Default: the paper's five.
      conditions: names, such as "noise + coulomb", texts, or your own, see `condition`. Default:
        one of each kind.
      seeds: runs of a law on each plant in each condition; each has another start and other noise,
        the same for every law, and the gains of the next search. With more seeds than searches,
        runs take these in turn.
      tune: whether to tune laws for which neither you nor the package gives gains; otherwise they
        run with their defaults.
      worst: whether to search the worst case of each law on each plant too; or the class in which
        to search it.
      out: folder for gains, of the last version of each law, and runs.
      metrics, defaults, relevant: as in `leaderboard`.
      duration: of a run, s. Default: 10, or 3 if quick; 8 under an adversary.
      starts: where runs begin, see `starts`. Default: within 20 % of the plant's own x0.
      gains: the set of gains of the package: "tuned", "tracking", "study" or "default".
      searches: independent searches of a tuning. Laws with fewer shipped sets of gains are tuned
        too; of laws with more, that many sets run. Default: 12; if quick as many as can rank
        laws, and name a winner, in each of these plants and conditions, 9 or more, and shipped
        sets as they are.
        With fewer than seven searches or seeds hardly any law can win; the answer says how many it
        takes.
      budget: largest number of sets of gains that a search tries, for each gain. With less than the
        default, or more, a remark says that a law may trail, or lead, because of its search.
      quick: runs of 3 s and fewer searches, unless you give other numbers; by default three plants
        and three conditions, which take some minutes of processor time. On a plant for which no law
        has shipped gains, the searches are those of `which` within minutes, under the conditions
        asked for.
      threads, progress: as in `run`.
      seed: another one draws other instances, starts and noise. The files are the same in every
        call, with any number of threads.
      device: on which the fast engine searches gains and worst cases, "cpu" or "cuda". All numbers
        of the tables are MuJoCo's.
      executor: where searches and runs are made side by side, in place of threads of this process,
        as in `study`. The numbers are the same.

    Returns:
      A `Compared`, which prints who is best, by how much and what to do next; `full` has all
      tables, as the folder's report.html. `table` has a row a run, `plot`, `to_latex` and
      `to_html` write files, `traces` are runs to draw and film.

    Raises:
      ScenarioError: an unknown name, or arguments that `grid`, `study` or `leaderboard` refuse.
    """
    for name in items_of("metrics", metrics):
        find("metric", name, dict.fromkeys((paired_runs.SETTLES, *CATALOGUE)))
    within = _class(worst)
    extent = QUICK if quick else FULL
    if plants is None:
        plants = extent.plants
    machines = list(map(as_plant, listed("plants", plants)))
    length = duration or extent.duration
    trial = Trial.of(
        machines,
        conditions,
        extent.conditions,
        length,
        out,
        draws=Draws(seeds, starts, seed),
        search=Search(searches or SEARCHES, budget, quick, device, executor),
        gains=GainChoice(gains, tune and gains == "tuned", defaults, searches is not None),
        threads=threads,
        progress=progress,
    )
    chosen: dict[str, list[Law | Template]] = {}
    if laws is None:
        of_all = None
    else:
        of_all = list(map(law_or_template, listed_laws(laws)))
    for plant in machines:
        chosen[plant.name] = of_all or list(map(law_or_template, _usual(plant)))
    if quick and searches is None:  # as many as can rank the laws in each block
        win = needed_to_win(len(machines) * len(trial.conditions))
        count = max(win, needed_to_rank(max(map(len, chosen.values()))))
        trial = trial._replace(search=trial.search._replace(searches=count))
    trial.check(chosen)
    candidates = trial.candidates(chosen, seeds)
    table = trial.run(candidates, seeds)
    worst_cases = {}
    if worst:
        worst_cases = _worst_cases(trial, candidates, within, duration)
    by = paired_runs.GROUPS
    if len(machines) * len(trial.conditions) > MAX_BLOCKS:
        by = ("plant",)
    boards = leaderboard(table, metrics, by, defaults, relevant)
    holdout = trial.holdout(candidates, seeds)
    _leave_out_failed(holdout, table)
    sources = {}
    for p in holdout:
        sources[p] = {law.name: (law.source,) for law, *_ in candidates[p]}
    boards[:0] = objective_boards(holdout, sources, defaults, relevant)
    compared = Compared(
        table=table,
        candidates=candidates,
        leaderboard=boards,
        conditions=_in_words(trial, length),
        worst=worst_cases,
        times=_times(trial, candidates),
        report=str(trial.folder / REPORT),
    )
    compared.to_html(compared.report)
    return compared


def _in_words(trial: Trial, duration: float) -> dict[str, dict[str, str]]:
    """Return `Compared.conditions`, of runs of a duration, s."""
    by_plant: dict[str, dict[str, str]] = {}
    for plant in trial.plants:
        of_plant = by_plant.setdefault(plant.name, {})
        for condition in trial.conditions:
            of_plant[condition.name] = condition.brief(plant, duration) or "the scenario's defaults"
    return by_plant


def _leave_out_failed(holdout: Mapping[str, Holdout], table: Table) -> None:
    """Let no law win J that failed in every run of the table.

    A failed run has no other metric either, but J has runs of its own, which may end before the law
    fails.
    """
    columns = map(table.column, ("plant", "law", "failure"))
    fine = set()
    for plant, law, failure in zip(*columns, strict=True):
        if failure is None:
            fine.add((plant, law))
    for plant, runs in holdout.items():
        for law, arrived in runs.arrived.items():
            arrived[:] = arrived & ((plant, law) in fine)


def _class(worst: object) -> Uncertainty | None:
    """Return the class in which worst cases are searched, None for the default one."""
    if isinstance(worst, bool):
        return None
    if not isinstance(worst, Uncertainty):
        raise ScenarioError(
            f"worst is {shown(worst)}: give True or a class, such as smc.Uncertainty(disturbance=1)"
        )
    return worst


def _worst_cases(
    trial: Trial,
    candidates: Mapping[str, Sequence[Candidate]],
    within: Uncertainty | None,
    duration: float | None,
) -> dict[str, dict[str, WorstCase]]:
    """Return `Compared.worst`: the worst case of each law with its best gains on each plant."""
    by_plant: dict[str, dict[str, WorstCase]] = {}
    for plant in trial.plants:
        by_plant[plant.name] = {}
        for law, *_ in candidates[plant.name]:
            run = case(plant, law, "nominal", duration or DURATION, starts=trial.draws.starts)
            by_plant[plant.name][law.name] = trial.attack(f"{plant.name}-{law.name}", run, within)
    return by_plant


def _times(
    trial: Trial, candidates: Mapping[str, Sequence[Candidate]]
) -> dict[str, dict[str, LawTime]]:
    """Return `Compared.times`, of the laws with their best gains, without those that do not
    compile.
    """
    by_plant: dict[str, dict[str, LawTime]] = {}
    for plant in trial.plants:
        by_plant[plant.name] = {}
        for law, *_ in candidates[plant.name]:
            if time := law_time(trial.case(plant, law, trial.conditions[0])):
                by_plant[plant.name][law.name] = time
    return by_plant


def _usual(plant: Plant) -> list[Any]:
    """Return the laws to compare on a plant if none are given."""
    suited = []
    tuned = []
    for name in gain_sets.COMPARED:
        if suits(law_catalogue()[name], plant):
            suited.append(name)
            if gain_sets.in_set(plant, name, "tuned"):
                tuned.append(name)
    if suited:
        return tuned or suited
    left_out = {"none", *gain_sets.ALIASES}  # aliases have the gains of laws that are there already
    return [law for law in suitable(plant=plant) if law.name not in left_out]
