"""A recommendation: which law to use on a plant, its gains, and how certain the choice is."""

import dataclasses
import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from smc_mujoco.analysis.paired_runs import SETTLES, values
from smc_mujoco.analysis.ranking import Comparison
from smc_mujoco.analysis.tuning.objective import FAILURE_COST
from smc_mujoco.analysis.tuning.result import Tuned
from smc_mujoco.analysis.tuning.run_limits import CALM, LIMIT_COST, OVERSHOOT, RunLimit
from smc_mujoco.answers.answer import Answer
from smc_mujoco.answers.command import PROGRAM, again, instead, typed
from smc_mujoco.answers.facts import Fact, Lead, NextStep, Screen, Settles, Span
from smc_mujoco.answers.templates import as_text
from smc_mujoco.common import html
from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.tabular import Cell, Tabular
from smc_mujoco.common.text import counted, joined, number, span
from smc_mujoco.control.component import Component, bounded, gains_text
from smc_mujoco.control.source import in_words
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.metrics.conventions import leans
from smc_mujoco.robustness.margins import Margin
from smc_mujoco.simulation.force_bounds import bounds_in_words
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.block import nearest
from smc_mujoco.studies.board_tables import Boards
from smc_mujoco.studies.race import LOOKS, WITHOUT, Race, needed
from smc_mujoco.studies.table import Table

RELIABLE = 0.9  # share of the runs of every condition in which a reliable law settles; chosen
FAR_OVER = 20.0  # %, an overshoot beyond which the answer says so; chosen
NO_ROOM = 1.5  # times the delay of a condition: a margin within that leaves no room; chosen
LEAST_DELAY = 5e-3  # s, of a usual loop with a bus and a filter; a margin below is told; chosen
MOST_NAMED = 5  # laws that a line names
MORE_MINUTES = 30  # of a next step, where the time that is needed is not known
HARDER = ("sine", "step", "pulse")  # conditions in which more is asked of a law
LATER = 1.2  # times an estimate: a time that it is likely to keep
LEVELS = {"disturbance": "force"}  # a kind of margin -> as the answer says it
NOWHERE = Span(math.nan, math.nan)
Settled = dict[str, dict[str, Settles]]  # law -> condition -> its runs


class AtRest(NamedTuple):
    """How a law ends runs without noise and without disturbances that vary: in the condition in
    which u swings most, and where it overshoots most before any event.
    """

    size: float  # of the swing of u, peak to peak, in its unit
    frequency: float  # Hz
    share: float  # of the bound on u
    unit: str
    condition: str
    overshoot: float  # %, NaN where no run tells
    overshoots_in: str  # condition

    @property
    def shakes(self) -> bool:
        """Whether u swings by more than "calm" allows."""
        return self.share > CALM


class AddedNoise(NamedTuple):
    """The noise of a condition, standard deviations in `units` and units/s."""

    condition: str
    position: float
    velocity: float
    units: str
    added: bool  # whether the condition was not asked for


class Tolerance(NamedTuple):
    """What the first law withstands with its gains."""

    margins: Sequence[Margin]
    beside: str  # name of the condition beside which they are; "nominal" for none
    untried: Sequence[str]  # kinds of margins for which there was no time
    # the joints that their load pushes from the start of these runs to the goal
    helped: Sequence[str]
    # of friction, in runs that start on the other side of these; None if there are none
    opposed: Margin | None


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Recommendation(Answer):
    """Laws that raced for a plant, the best first, and which of them to use; `print` shows it."""

    table: Table  # the runs of the laws, each with one set of gains
    leaderboard: Boards  # of these, a board for each need
    laws: tuple[Component, ...]  # with their gains: those of the boards, best first
    race: Race
    # of those of `laws` that may be the best, or else the first two, and none, with these gains, by
    # J of the same unseen runs; None without time
    fixed: Comparison | None
    settled: Settled
    # in how many runs the first law settles under all conditions asked for at once, and how many
    # there are; None for one condition, or for some that exclude each other
    together: Settles | None
    weighs: Mapping[str, float]  # condition -> its share of J of the first law
    # condition -> how many unseen runs settle under u = 0; None beside none
    no_law: Mapping[str, Settles] | None
    rests: Mapping[str, AtRest | None]  # of each of the laws
    limits: Sequence[RunLimit]  # that searches kept
    noises: Sequence[AddedNoise]
    tolerance: Tolerance
    seeds: int  # from which each law was to run in each condition, if the time allowed it
    worst_run: Scenario  # of the first law in the condition where it fares worst
    tuned: Tuned | None  # the searches for the gains of the first law; None if they were known
    left_out: Mapping[str, str]  # law -> why it could not be tuned
    untried_laws: Sequence[str]  # the package's laws that suit, too, and were not tried
    judged: Mapping[str, bool]  # the conditions that J is of, and whether each was asked for
    folder: Path  # where the files are
    pictured: bool = True  # whether there is time to run `worst_run` again, for the report

    @property
    def law(self) -> Component:
        """The law to use, with its gains."""
        return self.laws[0]

    @property
    def margins(self) -> Sequence[Margin]:
        """What the law withstands with these gains."""
        return self.tolerance.margins

    @cached_property
    def worst_trace(self) -> Trace:
        """The trace of `worst_run`, computed when first used."""
        return run(self.worst_run)

    # facts

    @property
    def form(self) -> str:
        """The form of the answer: "law", "undecided", "unneeded", "unsettled", "unkept" or
        "untried".
        """
        if not self.race.laws:
            return "untried"
        if len(self._vetoing) == len(self.settled[self.law.name]):
            return "unsettled"
        of_law = self.race.entrants[self.law.name].values if self.limits else []
        if of_law and min(of_law) >= LIMIT_COST:  # and those of the other laws, which come after it
            return "unkept"
        if self.law.name == WITHOUT:
            return "unsettled" if self._vetoing else "unneeded"
        alone = len(self.race.laws) == 1 and WITHOUT in self.race.dropped
        decided = alone or (self.lead and {*self.race.first} <= {*self.rivals, self.law.name})
        if not decided or self.race.unsearched:
            return "undecided"
        return "unsettled" if self._vetoing else "law"

    @property
    def over_sets(self) -> bool:
        """Whether sets of gains name the law, and not only runs with the gains printed."""
        return self.race.winner == self.law.name

    @property
    def lead(self) -> Lead | None:
        """By how much J of the law is below that of the rival over which its lead is least: over
        sets of gains if these name it, else with these gains; None if neither does.
        """
        for comparison in (self.race.comparison, self.fixed):
            if comparison and comparison.winners[0] == self.law.name:
                return _lead(comparison, self.law.name)
        return None

    @property
    def rivals(self) -> list[str]:
        """The laws that `lead` is over."""
        comparison = self.race.comparison if self.over_sets else self.fixed
        laws = comparison.laws if comparison else ()
        return [law for law in laws if law != self.law.name]

    @property
    def undecided(self) -> list[str]:
        """The laws that may have the lowest J, the one to use first."""
        rest = [law for law in self.race.first if law != self.law.name]
        return [self.law.name, *rest]

    @property
    def sets_needed(self) -> int:
        """About how many sets of each law decide; 0 if more do not help."""
        race = self.race
        if race.sets < LOOKS[0] or race.comparison is None:
            return LOOKS[0]
        sets = needed(race.comparison)
        return 0 if math.isinf(sets) else math.ceil(sets)

    @property
    def minutes_needed(self) -> int | None:
        """How many minutes the missing sets are likely to take here; None where that is not
        known.
        """
        missing = self.sets_needed - self.race.sets
        if missing <= 0 or not self.race.seconds:
            return None
        return max(1, math.ceil(LATER * missing * self.race.seconds / 60.0))

    @property
    def runs(self) -> Settles:
        """In how many of its runs the law settles."""
        return _summed(self.settled[self.law.name].values())

    @property
    def settling_times(self) -> Span:
        """From when to when the law settles in its runs, s; NaN where it never does."""
        own = self.table.column("law") == self.law.name
        settling = values(self.table, "settling_time")[own]
        settling = settling[values(self.table, SETTLES)[own] == 0.0]
        times = settling[np.isfinite(settling)]
        return Span(float(times.min()), float(times.max())) if len(times) else NOWHERE

    @property
    def never_settled(self) -> list[str]:
        """The conditions in which no law settles in any run."""
        never = []
        for name in self.settled[self.law.name]:
            if not any(of_law[name].count for of_law in self.settled.values()):
                never.append(name)
        return never

    @property
    def _vetoing(self) -> list[str]:
        """Those of these conditions that were asked for, so that no law is the answer."""
        never = self.never_settled
        if len(never) == len(self.settled[self.law.name]):
            return never
        return [name for name in never if self.judged.get(name)]

    @property
    def unsettled_in(self) -> dict[str, Settles]:
        """Condition -> how many runs of the law settle, where it does not do so reliably."""
        of_law = self.settled[self.law.name].items()
        return {name: runs for name, runs in of_law if runs.count < RELIABLE * runs.total}

    @property
    def screen(self) -> Screen:
        """What the answer states."""
        return Screen(
            facts=[self._first_line, *self._of_law, *self.cautions],
            next=self.next_step,
            report=f"{self.folder}/report.html",
            word="J",
        )

    @property
    def _first_line(self) -> Fact:
        """What to do."""
        race, form = self.race, self.form
        if form == "untried":
            return Fact(form, minutes=self.minutes_needed)
        if form == "law":
            return self._gains(form)
        if form == "unneeded" and self.runs.count < self.runs.total:
            form = "unbeaten"
        named = len(race.laws) + len(race.unsearched) + len(self.left_out)
        return Fact(
            form,
            law=self.law.name,
            runs=self.runs,
            lead=self.lead,
            never=self._vetoing,
            limits=list(map(str, self.limits)),
            raced=len(race.laws) if len(race.laws) < named else None,
            named=named,
            **{"shorter" if race.shorter else "sets": race.sets},
            least=LOOKS[0] if race.sets < LOOKS[0] else None,
            needed=self.sets_needed if self.sets_needed > race.sets else None,
            minutes=self.minutes_needed,
            close=not self.sets_needed,
            laws=self.undecided if 1 < len(self.undecided) <= MOST_NAMED else (),
        )

    def _gains(self, kind: str) -> Fact:
        """Return the gains of the law, and the file that has them."""
        gains = gains_text(bounded(self.law.gains))
        return Fact(kind, law=self.law.name, gains=gains, unit=self.unit, file=self._file)

    @property
    def _file(self) -> str:
        """The file with the gains; "" if they were given."""
        return str(self.folder / "recommended.json") if self.tuned else ""

    @property
    def _of_law(self) -> list[Fact]:
        """What the runs say of the law."""
        form, none = self.form, self.no_law
        if form == "untried":
            return []
        facts = [] if form in ("law", "unneeded") else [self._gains("gains")]
        if form in ("law", "unsettled"):
            searched = any(entrant.count > 1 for entrant in self.race.entrants.values())
            laws = 1 + len([law for law in self.rivals if law != WITHOUT])
            searches = self.race.sets if searched and self.over_sets else None
            facts.append(Fact("best", laws=laws, lead=self.lead, searches=searches))
        times = self.settling_times
        facts.append(Fact("settles", runs=self.runs, times=times, together=self.together))
        margins = [margin for margin in self.margins if not math.isnan(margin.value)]
        levels = list(map(_level, margins))
        facts += [Fact("added", condition=noise.condition) for noise in self.noises if noise.added]
        if levels or self.tolerance.untried:
            facts.append(Fact("withstands", levels=levels, untried=self.tolerance.untried))
        if none and form != "unneeded":
            over = NOWHERE
            if self.law.name != WITHOUT and self.fixed and self.law.name in self.fixed.laws:
                over = _lead(self.fixed, self.law.name, WITHOUT).share
            facts.append(
                Fact("without", runs=_summed(none.values()), below=over if over.low > 0.0 else None)
            )
        return facts

    @property
    def cautions(self) -> list[Fact]:
        """What to know before the law is used. Those whose values are not known are not said."""
        never, laws = self.never_settled, self.race.unsearched
        in_first_line = self._vetoing if self.form == "unsettled" else []
        rare = {name: runs for name, runs in self.unsettled_in.items() if name not in never}
        leaning = self.pictured and self.unsettled_in and leans(self.worst_trace)
        apart = "+".join(self.settled[self.law.name]) if self.apart else ""
        lost = lost_runs(self.fixed).get(self.law.name)
        broken = Settles(lost, len(self.fixed.cells[0, 0])) if lost and self.fixed else None
        without = []
        if self.no_law and self.form != "unneeded":
            without = [name for name, runs in self.no_law.items() if runs.count == runs.total]
        if self.form == "untried":
            laws = ()
        elif len(laws) > MOST_NAMED:
            laws = counted(len(laws), "law")
        return [
            *(Fact("rare", where=name, runs=runs) for name, runs in rare.items()),
            Fact("never", where=[name for name in never if name not in in_first_line]),
            Fact("leans", where=str(self.worst_run.condition) if leaning else ""),
            Fact("together", where=apart, runs=self.together),
            Fact("unreliable", law=self._lower_J),
            *self._of_rest,
            *self._of_margins,
            Fact("limit", limits=list(map(str, self.limits)), runs=broken),
            Fact("at end", gains=list(self.tuned.at_bound) if self.tuned else []),
            Fact("needless", where=without),
            Fact("no time", laws=laws),
            *(Fact("left out", law=name, reason=why) for name, why in self.left_out.items()),
        ]

    @property
    def apart(self) -> bool:
        """Whether the law settles too seldom under all conditions at once, though no condition
        alone keeps all laws from it.
        """
        if self.together is None or self.never_settled:
            return False
        return self.together.count < RELIABLE * self.together.total

    @property
    def _lower_J(self) -> str:
        """The law that wins by J but comes after this one, as it settles too seldom; else ""."""
        with_these = self.fixed.winners[0] if self.fixed else None
        for winner in filter(None, (self.race.winner, with_these)):
            if winner != self.law.name:
                return winner
        return ""

    @property
    def _of_rest(self) -> list[Fact]:
        """What the law does at rest, and beyond its goal."""
        rest = self.rests.get(self.law.name)
        if not rest:
            return []
        limit = min((limit.most for limit in self.limits if limit.what == OVERSHOOT), default=None)
        far = rest.overshoot > (limit or FAR_OVER)
        return [
            Fact(
                "shakes",
                size=rest.size if rest.shakes else None,
                unit=rest.unit,
                share=rest.share,
                frequency=rest.frequency,
                where=rest.condition,
            ),
            Fact(
                "overshoots",
                percent=rest.overshoot if far else None,
                where=rest.overshoots_in,
                limit=limit,
            ),
        ]

    @property
    def _of_margins(self) -> list[Fact]:
        """Where the law has no room."""
        own = [case.input_delay for case in self._cases if case.law.name == self.law.name]
        delay = max(own, default=0.0)
        facts = [Fact("no margin")] * any(math.isnan(margin.value) for margin in self.margins)
        for margin in self.margins:
            fails = margin.value + margin.resolution
            if margin.kind == "delay" and not margin.open:
                if delay and fails <= NO_ROOM * delay:
                    facts.append(Fact("no room", delay=delay, fails=fails))
                elif fails < LEAST_DELAY:
                    facts.append(Fact("late", delay=margin.value))
        opposed = self.tolerance.opposed
        against = {"value": opposed.value, "unit": opposed.unit} if opposed else {}
        of_friction = any(margin.kind == "friction" for margin in self.margins)
        helped = self.tolerance.helped if of_friction else ()
        return [*facts, Fact("helped", joints=helped, **against)]

    @cached_property
    def _cases(self) -> list[Scenario]:
        """The first run of each law in each condition."""
        rows: dict[tuple[str, str], int] = {}
        columns = self.table.column("law").tolist(), self.table.column("condition").tolist()
        for row, pair in enumerate(zip(*columns, strict=True)):
            rows.setdefault(pair, row)
        return list(map(self.table.scenario, rows.values()))

    @property
    def next_step(self) -> NextStep:
        """The one thing to do next: more sets of gains, the conditions all at once, the laws that
        were not tried, or the law's code; where none is needed, a harder condition.
        """
        minutes = str(self.minutes_needed or MORE_MINUTES)
        if self.form in ("undecided", "untried") or self.race.unsearched or self.left_out:
            if self.sets_needed:
                command = again({"--minutes": minutes}, ("--quick",))
                return NextStep(command, "goes on from the sets that there are")
            laws = ",".join(self.undecided[:MOST_NAMED])
            command = instead("compare", {"--law": laws}, ("--condition", "--x0"))
            return NextStep(command, "shows where the laws differ")
        if self.apart:
            names = "+".join(self.settled[self.law.name])
            combined = again({"--condition": names, "--out": f"{self.folder}-at-once"})
            return NextStep(combined, "searches gains for all conditions at once")
        if self.form == "unneeded" and self.runs.count == self.runs.total:
            conditions = "+".join(self.settled[self.law.name]).split("+")
            harder = next((name for name in HARDER if name not in conditions), HARDER[-1])
            command = again({"--condition": harder, "--out": f"{self.folder}-{harder}"})
            return NextStep(command, "asks for more, so that a law may be needed")
        if self.untried_laws:
            options = {"--law": None, "--minutes": str(MORE_MINUTES)}
            wide = again(options | {"--out": f"{self.folder}-all-laws"}, ("--quick",))
            count = len(self.untried_laws)
            return NextStep(wide, f"tries the usual ones of {count} other laws, too")
        return self._export

    @property
    def _export(self) -> NextStep:
        """The law's code: as C where the loop is the user's, else for ros2_control."""
        gains = self._file or gains_text(self.law.gains).replace(" ", "")
        law = self._file or f"{self.law.name}({gains})"
        for word in typed("--law").split(","):
            if Path(word).suffix == ".py" and Path(word).stem == self.law.name:
                law = f"{word}({gains})"
        if self.law.requires_model or not self._file:
            command = shlex.join([PROGRAM, "export", law, "controller.c"])
            return NextStep(command, "writes it as C")
        command = shlex.join([PROGRAM, "export", law, "controller", "--ros2"])
        return NextStep(command, "writes it for ros2_control; --plain writes a loop in C")

    @property
    def unit(self) -> str:
        """The units of u, where it is no force; else ""."""
        scenario = self.worst_run
        if scenario.force_command:
            return ""
        return joined(dict.fromkeys(scenario.efforts[: scenario.plant.driven]))

    # evidence

    @property
    def tables(self) -> list[Tabular]:
        """The laws with J and gains, the verdicts on J, the needs by condition, the conditions, and
        what the law withstands.
        """
        tables = [self._table_of_laws, self._table_of_verdicts]
        runs = next(iter(self.settled[self.law.name].values())).total
        groups = dict.fromkeys(" under ".join(board.group.values()) for board in self.leaderboard)
        for about, table in zip(groups, self.leaderboard.tables, strict=False):
            rows = [list(map(_unmarked, row)) for row in table.rows]
            title = f"{about}: {runs} of {self.seeds} seeds"
            tables.append(dataclasses.replace(table, rows=rows, notes=(), title=title))
        tables.append(self._table_of_conditions)
        return [*tables, self._table_of_margins] if self.margins else tables

    @property
    def _table_of_laws(self) -> Tabular:
        """J of each law's sets of gains, those that were dropped last, its gains, and how it rests
        and overshoots.
        """
        laws = {law.name: law for law in self.laws}
        rows = []
        for names in (self.race.running, self.race.dropped):
            medians = {name: float(np.median(self.race.entrants[name].values)) for name in names}
            for name in sorted(names, key=medians.__getitem__):
                J = self.race.entrants[name].values
                far = self.race.dropped.get(name)
                remark = f"dropped: best J {number(far)} times the leader's worst" if far else ""
                law = laws.get(name)
                gains = gains_text(bounded(law.gains)) if law else ""
                cell = Cell(_cost(medians[name]), span(_cost(min(J)), _cost(max(J))))
                rows.append(
                    (name, cell, f"{len(J)}", gains, *_of_rest(self.rests.get(name)), remark)
                )
        notes = [in_words({law.name: [law.source] for law in self.laws})]
        notes += [f"{name}: not searched, no time" for name in self.race.unsearched]
        notes += [f"{name}: {why}" for name, why in self.left_out.items()]
        if self.untried_laws:
            notes.append(f"not tried: {joined(self.untried_laws)}")
        headings = "law", "J (s²)", "sets judged", "gains"
        headings += "swing of u", "of its bound", "Hz", "overshoot", "remark"
        title = f"Laws: J over {joined([*self.judged])}, on unseen runs; at rest without noise"
        return Tabular(headings=headings, rows=rows, title=title, notes=notes)

    @property
    def _table_of_verdicts(self) -> Tabular:
        """The law ahead over sets of gains, and with the gains printed."""
        rows = []
        titles = ("over sets of gains", self.race.comparison), ("with these gains", self.fixed)
        for about, comparison in titles:
            if comparison is None:
                continue
            order = dict.fromkeys([*comparison.winners, *self.race.running, *comparison.laws])
            first, *rivals = [law for law in order if law in comparison.laws]
            for rival in rivals:
                effect = comparison.effect(0, first, rival)
                places = comparison.laws.index(first), comparison.laws.index(rival)
                p = number(float(comparison.p[0][places]), 2)
                ratio = Cell(number(effect.value), span(number(effect.low), number(effect.high)))
                ahead = f"{effect.ahead} of {effect.samples}"
                wins = "yes" if comparison.winners[0] else "no"
                rows.append((about, first, rival, ratio, ahead, p, wins))
        headings = "sets of gains", "law", "rival", "J over the rival's", "ahead", "p", "wins"
        return Tabular(headings=headings, rows=rows, title="Verdicts on J", name_columns=3)

    @property
    def _table_of_conditions(self) -> Tabular:
        """The runs of each law that settle, the shares of J of the first law, and what was
        assumed, by condition.
        """
        cases = {str(run.condition): run for run in self._cases if run.law.name == self.law.name}
        noises = {noise.condition: noise for noise in self.noises}
        rows = []
        for name in dict.fromkeys([*self.settled[self.law.name], *self.weighs]):
            settled = [_counted(self.settled[law.name].get(name)) for law in self.laws]
            share = f"{100 * self.weighs[name]:.0f} %" if name in self.weighs else ""
            without = _counted((self.no_law or {}).get(name))
            period = velocity = size = added = ""
            if case := cases.get(name):
                period, velocity = f"{1e3 * case.control_period:g}", str(case.resolved.velocity)
            if noise := noises.get(name):
                size = f"{noise.position:g} {noise.units}, {noise.velocity:g} {noise.units}/s"
                added = " (added: no condition had noise)" if noise.added else ""
            rows.append((f"{name}{added}", *settled, share, without, period, velocity, size))
        if self.together:
            blank = [""] * (len(self.laws) + 4)
            rows.append(("all at once", _counted(self.together), *blank))
        headings = ["condition", *(f"settles ({law.name})" for law in self.laws)]
        headings += ["share of J", "without a law", "u changes every (ms)", "velocity"]
        headings.append("noise (standard deviations)")
        return Tabular(headings=headings, rows=rows, title="Conditions")

    @property
    def _table_of_margins(self) -> Tabular:
        """What the first law withstands."""
        rows = []
        margins = {margin.kind: margin for margin in self.margins}
        if self.tolerance.opposed:
            side = f"{joined(self.tolerance.helped)} from the other side"
            margins[f"friction, {side}"] = self.tolerance.opposed
        for label, margin in margins.items():
            not_held = ""
            if not margin.open and margin.resolution:
                not_held = number(margin.value + margin.resolution)
            rows.append((label, margin.text, not_held, margin.unit, self.tolerance.beside))
        for kind in self.tolerance.untried:
            rows.append((kind, "no time", "", "", self.tolerance.beside))
        headings = "margin", "withstood", "not", "unit", "beside"
        bounds = bounds_in_words(self.worst_run)
        title = f"What {self.law.name} withstands, each alone; |u| at most {bounds}"
        return Tabular(headings=headings, rows=rows, title=title, name_columns=1)

    def save(self) -> list[Path]:
        """Write the report and the gains to the folder, and return their files."""
        files = []
        if self.tuned:
            files.append(self.tuned.save(self.folder / "recommended.json"))
        return [*files, self.to_html(self.folder / "report.html")]

    @property
    def pictures(self) -> list[html.Html]:
        """The worst run of the law."""
        if not self.pictured:
            return []
        from smc_mujoco.draw import figure

        def draw(file: Path, size: str | None) -> object:
            return figure.figure([self.worst_trace], file, size=size, format="svg")

        about = f"{self.law.name} under {self.worst_run.condition}"
        label = CATALOGUE["settling_time"].label
        return [html.picture(draw, f"Worst run: {about}: its run of the latest {label}")]

    @property
    def title(self) -> str:
        """The title of the page."""
        return f"Which law for {self.worst_run.plant.name}"


def _lead(comparison: Comparison, law: str, rival: str = "") -> Lead:
    """Return by how much J of a law is below that of a rival, or of the rival over which that is
    least.
    """
    rivals = [name for name in comparison.laws if name not in (law, WITHOUT)]
    rival, effect = nearest(comparison, 0, law, [rival] if rival else rivals or [WITHOUT])
    lost = lost_runs(comparison)[rival]
    return Lead(
        law=law,
        rival=rival,
        metric="J",
        low=math.nan if lost else 1.0 - effect.high,
        high=math.nan if lost else 1.0 - effect.low,
        gaps=f"{lost} of {effect.samples}" if lost else "",
    )


def lost_runs(comparison: Comparison | None) -> dict[str, int]:
    """Return law -> how many of its units in a comparison fail or break a limit."""
    if comparison is None:
        return {}
    return dict(zip(comparison.laws, comparison.away[:, 0].sum(axis=1).tolist(), strict=True))


def _level(margin: Margin) -> Fact:
    """Return a level that is withstood, such as "mass x 1.6"."""
    in_unit = {"1": "factor", "s": "time"}.get(margin.unit, "value")
    about = {"what": LEVELS.get(margin.kind, margin.kind), "unit": margin.unit}
    return Fact("level", **about, open=margin.open, **{in_unit: margin.value})


def _summed(runs: Iterable[Settles]) -> Settles:
    """Return the runs of all conditions."""
    of_all = [(of_one.count, of_one.total) for of_one in runs]
    return Settles(*np.sum(of_all, axis=0).tolist())


def _counted(runs: Settles | None) -> str:
    """Return a cell with a count of runs, such as "3 of 24"; "" where there are none."""
    return as_text(runs) if runs else ""


def _cost(J: float) -> str:
    """Return J as text; "fails" where a run of it fails."""
    return number(J) if J < FAILURE_COST else "fails"


def _of_rest(rest: AtRest | None) -> list[Cell | str]:
    """Return how a law rests, and how far it overshoots."""
    if rest is None:
        return [""] * 4
    over = "" if math.isnan(rest.overshoot) else f"{rest.overshoot:.3g} %"
    return [
        Cell(f"{number(rest.size)} {rest.unit}", f"under {rest.condition}"),
        f"{100 * rest.share:.2g} %",
        f"{rest.frequency:.3g}" if rest.shakes else "",
        Cell(over, f"under {rest.overshoots_in}" if over else ""),
    ]


def _unmarked(cell: Cell | str) -> Cell | str:
    return cell if isinstance(cell, str) else cell._replace(strong=False)
