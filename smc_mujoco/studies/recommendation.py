"""A recommendation: which law to use on a plant, its gains, and how certain the choice is."""

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from smc_mujoco.analysis.bootstrap import LEVEL
from smc_mujoco.analysis.paired_runs import OF_J, SETTLES, values
from smc_mujoco.analysis.ranking import Comparison
from smc_mujoco.analysis.signed_rank import min_p
from smc_mujoco.analysis.step_halving import UNTRIED
from smc_mujoco.analysis.tuning.objective import FAILURE_COST
from smc_mujoco.analysis.tuning.result import Tuned
from smc_mujoco.analysis.tuning.search_space import edges_in_words
from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.tabular import Cell, Tables, Tabular
from smc_mujoco.common.text import capital, counted, joined, number, span
from smc_mujoco.control import gain_sets
from smc_mujoco.control.component import Component, gains_text
from smc_mujoco.metrics.conventions import leans
from smc_mujoco.robustness.margins import Margin
from smc_mujoco.simulation.force_bounds import bounds_in_words
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.answer_time import SHOWN
from smc_mujoco.studies.board import (
    ALONE,
    FLOOR,
    MARKS,
    MEDIANS,
    WHEN_SETTLED,
    Boards,
    LeastLead,
    heading,
    hidden,
    size,
)
from smc_mujoco.studies.race import FIRST, LOOKS, Race, needed
from smc_mujoco.studies.table import Table

LEANS = (
    "u stays at its bound in the worst run: it leans on something, or needs more force, so give "
    "another goal or start, or a larger u_max if the motor gives more"
)
TOLERATED = {  # kind of a margin -> what is tolerated, at a level
    "delay": "a delay of {}",
    "friction": "dry friction of {}",
    "disturbance": "a constant disturbance of {} in the worse of its two directions",
    "mass": "a mass of {} the nominal one",
    "blow": "a blow of {} (over 5 ms) halfway through the run, in the worse of its two directions",
}
RELIABLE = 0.9  # share of the runs of every condition in which a reliable law settles; chosen


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Recommendation(Tables):
    """Laws compared for a plant, best first, and which to use; `print` shows it."""

    table: Table  # the runs of all laws
    leaderboard: Boards  # of the laws that settle often enough, a board for each need
    laws: tuple[Component, ...]  # with their gains: those of the boards, best first
    settles: Mapping[str, float]  # law -> the least share of its runs that settle in a condition

    @property
    def law(self) -> Component:
        """The first law, with its gains."""
        return self.laws[0]

    @property
    def second(self) -> Component | None:
        """The second law, with its gains; None if there is no other."""
        return self.laws[1] if len(self.laws) > 1 else None

    @property
    def answer(self) -> list[str]:
        """Four lines: the law, its gains, the second, and the evidence."""
        first = self.law
        return [
            f"Use: {self._name}",
            f"Gains: {gains_text(first.gains) or 'none'}{self._unit}, {first.source}",
            f"Second: {self.second or 'none'}",
            f"Evidence: {self._sure}",
        ]

    @property
    def _unit(self) -> str:
        """The units of u in words where it is no force, beside the gains that make it; else ""."""
        scenario = self.table.scenario(0)
        if scenario.force_command:
            return ""
        return f" for u in {joined(dict.fromkeys(scenario.efforts[: scenario.plant.driven]))}"

    @property
    def _name(self) -> str:
        """The first law's name, or a sentence if it does not settle reliably."""
        if self.settles[self.law.name] < RELIABLE:
            return f"no law settles reliably; the nearest is {self.law.name}"
        return self.law.name

    @property
    def _sure(self) -> str:
        boards = self.leaderboard
        settles = self.settles[self.law.name]
        if settles < RELIABLE:
            share = f"{100 * settles:.0f} % of its runs in its worst condition"
            return f"no law is reliable here; this one settles in {share}"
        if len(self.laws) < 2:
            return "there is no second law"
        for board in boards:
            for barred in board.barred:
                if barred != self.law.name:
                    cure = f"--allow-defaults lets a law win over {barred}'s default gains"
                    return f"first so far; {cure}"
        if all(board.too_few for board in boards):
            return f"first so far; {boards[0].too_few}"
        name = self.law.name
        blocks = 0
        wins = 0
        losses = 0
        for board in boards:
            blocks += len(board.blocks)
            wins += len(board.wins(name))
            losses += len(board.losses(name))
        text = f"it wins {wins} of {blocks} comparisons, and another law wins {losses}"
        if wins:
            return text
        return f"first so far; {text}"

    @property
    def tables(self) -> list[Tabular]:
        """The tables of the `leaderboard`, with the answer below the last."""
        *others, last = self.leaderboard.tables
        notes = [*last.notes, ""]
        compared = {law.name for law in self.laws}
        rare = sorted(self.settles.keys() - compared)
        if rare:
            notes.append(
                "Not compared, as they settle in fewer than half as many runs as another law: "
                f"{', '.join(rare)}"
            )
        return [*others, dataclasses.replace(last, notes=notes + self.answer)]


class NoLaw(NamedTuple):
    """How a plant does without a law, u = 0, on unseen runs of all conditions."""

    times: float  # its J over that of the first law, median over instances; NaN where runs fail
    runs: int  # in each condition
    duration: float  # of a run, s
    settled: Mapping[str, int]  # condition -> the number of its runs that settle
    settled_by_law: Mapping[str, int]  # the same under the first law
    holds: bool  # whether u = 0 is the goal of a servo, which then holds it

    @property
    def words(self) -> str:
        """How it does, and in which conditions the experiment shows no need of a law."""
        held = "u = 0, at which the servo holds the goal" if self.holds else "u = 0"
        every = self.runs * len(self.settled)
        each = (
            f" ({self.runs} in each of {len(self.settled)} conditions)"
            if len(self.settled) > 1
            else ""
        )
        without = _some(sum(self.settled.values()), every)
        of_law = self.settled_by_law
        late = [name for name, count in of_law.items() if count < self.runs]
        where = f", not all under {joined(late)}" if 0 < len(late) < len(of_law) else ""
        text = f"with {held}, {without} of {counted(every, 'separate run')} of {self.duration:g} s"
        text += f"{each} settle; with the law, {_some(sum(of_law.values()), every)} do{where}. "
        if math.isnan(self.times):
            text += "Some runs fail, so J is not compared"
        else:
            text += f"Without the law, J is {number(self.times)} times as high"
        needless = [name for name, count in self.settled.items() if count == self.runs]
        if needless:
            text += f". With u = 0 all runs settle under {joined(needless)}"
        return text


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class RaceRecommendation(Recommendation):
    """What a race within minutes found: its laws, the best first, and which of them to use."""

    race: Race
    # of those of `laws` that may be the best, or else the first two, with these gains, by J of the
    # same unseen runs; None for one law, or without time
    fixed: Comparison | None
    # law -> condition -> the numbers of its runs that settle, and of all
    settled: Mapping[str, Mapping[str, tuple[int, int]]]
    # in how many runs the first law settles under all conditions asked for at once, and how many
    # there are; None for one condition, or for some that exclude each other
    together: tuple[int, int] | None
    weighs: Mapping[str, float]  # condition -> its share of J of the first law
    no_law: NoLaw  # beside the first law
    assumed: str  # how often u changes, and each noise, in words
    margins: Sequence[Margin]  # of the first law with its gains
    beside: str  # name of the condition beside which they are; "nominal" for none
    untried: Sequence[str]  # kinds of margins for which there was no time
    # the joints that their load pushes from the start of these runs to the goal
    helped: Sequence[str]
    # of friction, in runs that start on the other side of these; None if there are none
    opposed: Margin | None
    seeds: int  # from which each law was to run in each condition, if the time allowed it
    worst_run: Scenario  # of the first law in the condition where it fares worst
    tuned: Tuned | None  # the searches for the gains of the first law; None if they were known
    left_out: Mapping[str, str]  # law -> why it could not be tuned
    untried_laws: Sequence[str]  # the package's laws that suit, too, and were not tried
    judged: str  # what J is of, in words

    @cached_property
    def worst_trace(self) -> Trace:
        """The trace of `worst_run`, computed when first used."""
        return run(self.worst_run)

    @property
    def answer(self) -> list[str]:
        """The law, its gains, the second, and the evidence, a line each."""
        lines = [f"Use: {self._name}"]
        searched = any(one.task or one.count > 1 for one in self.race.entrants.values())
        if searched and self.race.comparison:
            lines.append(f"Over all sets judged: {self._over_sets}")
        if self.fixed:
            lines.append(f"With the gains below: {self._with_these}")
        elif len(self.laws) > 1:
            lines.append("With the gains below: not tried, as the time was over")
        if len(self.weighs) > 1:
            lines.append(f"J of {self.law.name}: {self._weighs}")
        lines.append(f"Scores of {self.law.name}{self._needs}")
        if self.law.name != "none":
            lines.append(f"Without a law: {self.no_law.words}")
        lines.append(f"Assumed: {self.assumed}")
        lines.append(f"Settles: {self._where}")
        if self.together:
            cure = "if your machine has them all, give them as one condition"
            lines.append(
                f"Together: {self._at_once(self.together)} settle. Neither searches for gains nor "
                f"the comparison combined them: {cure}"
            )
        lines.append(f"Tolerates: {self._margins}")
        for name, share in self.race.dropped.items():
            least = f"its best J was {number(share)} times the leader's worst J"
            lines.append(f"Dropped after {FIRST} sets of gains, without a test: {name}; {least}")
        if self.race.unsearched:
            late = f"{joined(self.race.unsearched)}, as the time was over"
            lines.append(f"Not searched: {late}; the same call goes on with them")
        for name, why in self.left_out.items():
            lines.append(f"Left out: {name}, {why}")
        if self.untried_laws:
            others = f"{counted(len(self.untried_laws), 'other law')} of the package"
            usual = sum(law in gain_sets.COMPARED for law in self.untried_laws)
            cure = "; name some by laws= (--law)"
            if not self.table.scenario(0).plant.is_user_model:
                cure = "; without the option --law (laws= in Python) they are tried, too"
            elif usual:
                others += f", {usual} of them usual ones"
                cure = "; without the option --law (laws= in Python) all usual ones are tried"
            lines.append(f"Not tried here: {others}{cure}")
        lines.append(f"Second: {self.second or 'none'}")
        lines.append(self._gains)
        return lines

    @property
    def _name(self) -> str:
        done, of = self._settled_runs([self.law.name])
        if not done:
            done, of = self._settled_runs(self.settled)  # its own come first
            searched = " that was searched" if self.race.unsearched else ""
            return f"none: no law{searched} settled in any of {of} runs"
        words = [self.law.name]
        if len(self.laws) > 1 and not self.fixed and not self.race.winner:
            words.append("the first so far, not tested against the others")
        if self.race.unsearched:
            words.append("of the laws that were searched")
        if self.race.sets < LOOKS[0] and len(self.race.running) > 1 and not self.race.winner:
            words.append(f"after {counted(self.race.sets, 'set')} of gains, so more may change it")
        if others := self._not_beaten:
            words.append(f"not shown to be better than {joined(others, 'or')}")
        if self.settles[self.law.name] < RELIABLE:
            words.append(f"which settled in {done} of {of} runs")
        text = ", ".join(words)
        if self.together and self.together[0] < RELIABLE * self.together[1]:
            text += f". But {self._at_once(self.together)} settled"
        ahead = self._lowest
        if ahead and ahead != self.law.name:
            name, done, of = self._least_settled(ahead)
            lower = "lower J" if ahead in self._winners else "lower median J"
            text += (
                f". {ahead} has the {lower}, but under {name} only {done} of its {of} runs settled "
                "before the last fifth of the run"
            )
        return text

    @property
    def _gains(self) -> str:
        """The first law's gains, where they come from, and which are at an end of their search."""
        entrant = self.race.entrants[self.law.name]
        of = min(entrant.count, len(entrant.values))
        parts = [f"Gains: {self.law}{self._unit}, {self.law.source}"]
        if of > 1:
            parts.append(f"the best of the {of} sets judged")
        if self.tuned:
            parts += edges_in_words(self.tuned.gains, self.tuned.at_bound)
        return "; ".join(parts)

    def _at_once(self, together: tuple[int, int]) -> str:
        """How many runs, and of how many, with all the conditions asked for."""
        some = _some(*together)
        return f"with all the conditions asked for at once, {some} of {together[1]} further runs"

    @property
    def _not_beaten(self) -> list[str]:
        """The other laws of the comparison with these gains, where no test names a law."""
        tried = self._tried
        if self._winners or self.law.name not in tried:
            return []
        return [law for law in tried if law != self.law.name]

    @property
    def _tried(self) -> list[str]:
        """The laws of the comparison with these gains, the one to use first."""
        laws = self.fixed.laws if self.fixed else ()
        return [law.name for law in self.laws if law.name in laws]

    @property
    def _lowest(self) -> str | None:
        """The law that wins by J, over sets of gains or else with these; if none does, that of the
        lowest median J over sets, where it settles too seldom; else None.
        """
        for winner in self._winners:
            return winner
        first = self.race.running[0]
        seldom = self.settles.get(first, 1.0) < RELIABLE <= self.settles[self.law.name]
        return first if seldom else None

    @property
    def _winners(self) -> list[str]:
        """The laws that win by J, over sets of gains and then with these."""
        with_these = self.fixed.winners[0] if self.fixed else None
        return [*filter(None, (self.race.winner, with_these))]

    @property
    def worst_words(self) -> str:
        """Which run the worst one is, and why."""
        last = "settles last" if self.settles[self.law.name] == 1.0 else "settles last or never"
        return (
            f"a run of {self.law.name} under {self.worst_run.condition}{self._worst_condition}. Of "
            f"its runs there, this one {last}{self._not_shown}"
        )

    @property
    def _not_shown(self) -> str:
        """That runs with all conditions at once are not among those of which one is shown, where
        some of them do not settle.
        """
        done, of = self.together or (0, 0)
        return ". Of the runs with all conditions at once none is shown" if done < of else ""

    @property
    def _worst_condition(self) -> str:
        """Why the worst run is under its condition, as `recommend` chooses it; "" if there is no
        other.
        """
        found = self.settled[self.law.name]
        if len(found) == 1:
            return ""
        shares = [done / of for done, of in found.values()]
        if shares.count(min(shares)) == 1:
            return ", the condition in which the fewest of its runs settle"
        if min(shares) == max(shares):
            return ", the condition in which its runs settle latest"
        return (
            ". Of the conditions in which the fewest of its runs settle, they settle latest there"
        )

    def _least_settled(self, law: str) -> tuple[str, int, int]:
        """Return the condition in which a law settles in the smallest share of its runs, in how
        many of them, and how many there are.
        """
        found = self.settled[law]
        name = min(found, key=lambda name: found[name][0] / found[name][1])
        return name, *found[name]

    def _settled_runs(self, laws: Iterable[str]) -> tuple[int, int]:
        """Return in how many runs these laws settle, and how many they have, in all conditions."""
        settled = 0
        runs = 0
        for law in laws:
            for done, of in self.settled[law].values():
                settled += done
                runs += of
        return settled, runs

    @property
    def _over_sets(self) -> str:
        """What the sets of gains say of the laws."""
        race, comparison = self.race, self.race.comparison
        assert comparison is not None
        if race.sets < LOOKS[0] and not race.winner:
            more = "more minutes"
            if race.seconds:
                minutes = math.ceil((LOOKS[0] - race.sets) * race.seconds / 60.0)
                more = f"more minutes: the missing sets take about {minutes} min at this speed"
            short = ""
            if race.sets < FIRST:
                short = f", not even the first {FIRST}"
            return (
                f"open between {joined(race.running)}; there was time for "
                f"{counted(race.sets, 'set')} of gains of each law{short}, and {LOOKS[0]} can name "
                f"a winner; the same call goes on from there if it is given {more}"
            )
        text = _verdict(comparison, race.running)
        ranked = _ranked(comparison, race.running)
        few = [law for law in race.running if law not in ranked]
        if few:
            text += f"; {joined(few)} cannot be told from others, with fewer than {LOOKS[0]} sets"
        if race.winner or len(ranked) < 2:
            return text
        return f"{text}; {self._takes}"

    @property
    def _with_these(self) -> str:
        """What runs say of the laws with the gains printed, which may not be all that raced."""
        names = self._tried
        text = _verdict(self.fixed, names)  # pyright: ignore[reportArgumentType]
        of_some = f" of {joined(names)}" if len(names) < len(self.race.entrants) else ""
        return f"on separate runs{of_some}, {text}"

    @property
    def _takes(self) -> str:
        """What it would take to name a winner of sets of gains."""
        race, comparison = self.race, self.race.comparison
        assert comparison is not None
        first, *others = _ranked(comparison, race.running)
        sets = needed(comparison)
        seen = max(comparison.visible(0, first, other) for other in others)
        text = f"with {race.looked} sets {hidden(seen)}"
        if math.isinf(sets):
            return f"{text}, and the laws are too close for more sets to tell them apart"
        if sets > race.looked:
            text += f"; if the lead stays as it is, about {sets:.0f} sets of each law would decide"
        else:
            text += f"; such a lead usually shows with {race.looked} sets, but did not here"
        if race.looked < LOOKS[-1] < sets < math.inf:
            text += f", and at most {LOOKS[-1]} are made"
        if race.stopped and sets <= LOOKS[-1]:
            text += f"; the same call goes on to {LOOKS[-1]} sets"
        return text

    @property
    def _where(self) -> str:
        """In how many runs of which conditions the first law settles."""
        found = self.settled[self.law.name]
        rare = []
        for name, (done, of) in found.items():
            if done < RELIABLE * of:
                rare.append(f"{done} of {of} runs under {name}")
        if rare:
            text = f"not reliably before the last fifth of a run: in {joined(rare)}"
            return f"{text}; {LEANS}" if leans(self.worst_trace) else text
        runs = next(iter(found.values()))[1]
        least = runs
        for done, _ in found.values():
            least = min(least, done)
        few = f"{least} of" if len(found) == 1 else f"at least {least} of"
        share = "all" if least == runs else few
        each = f"each of the {len(found)} conditions" if len(found) > 1 else "its condition"
        return f"in {share} {runs} runs of the tables under {each}, before the last fifth of a run"

    @property
    def _weighs(self) -> str:
        """Which share of J of the first law each condition has, the largest first."""
        order = sorted(self.weighs, key=lambda name: -self.weighs[name])
        parts = []
        for name in order:
            parts.append(f"{100.0 * self.weighs[name]:.0f} % from {name}")
        return joined(parts)

    @property
    def _needs(self) -> str:
        """The first law's medians in each metric, and in overshoot, which no default need has, from
        its best condition to its worst.
        """
        found: dict[str, list[float]] = {}
        headings = {}
        for board in self.leaderboard:
            if board.metric == SETTLES:  # of which a line of its own tells
                continue
            headings[board.metric] = heading(board)
            for entry in board.entries:
                if entry.law == self.law.name and not math.isnan(entry.interval.median):
                    found.setdefault(board.metric, []).append(entry.interval.median)
        found.setdefault("overshoot", self._medians("overshoot"))
        headings.setdefault("overshoot", "overshoot (%)")
        parts = []
        count = len(self.settled[self.law.name])
        for metric, medians in found.items():
            low, high = size(min(medians), metric), size(max(medians), metric)
            few = f" in {len(medians)} of {count} conditions" if len(medians) < count else ""
            parts.append(f"{headings[metric]} {span(low, high) or low}{few}")
        over = ", from the lowest to the highest median over the conditions asked for"
        return f"{over if count > 1 else ''}: {joined(parts)}"

    def _medians(self, metric: str) -> list[float]:
        """Return the medians of the first law's runs in a metric, one for each condition."""
        own = self.table.column("law") == self.law.name
        conditions = self.table.column("condition")
        numbers = values(self.table, metric)
        medians = []
        for condition in dict.fromkeys(conditions[own].tolist()):
            medians.append(float(np.median(numbers[own & (conditions == condition)])))
        return medians

    @property
    def _margins(self) -> str:
        late = ""
        if self.untried:
            late = f"{joined(self.untried)} not tried, as the time was over"
        if not self.margins:
            return late or "not tried, as runs start at the goal"
        parts = []
        for margin in self.margins:
            if math.isnan(margin.value):
                return (
                    "nothing more: without changes the error does not end below 5 % of its "
                    "initial value"
                )
            level = _level(margin)
            if self.helped and margin.kind == "friction":
                level += f" from the start and {self._from_other_side}"
            unit = self.worst_run.efforts[0]
            if margin.unit == unit:
                level += f" (the bound on |u| is {bounds_in_words(self.worst_run, unit)})"
            parts.append(TOLERATED[margin.kind].format(level))
        where = f"under {self.beside}"
        if self.beside == "nominal":
            several = len(self.settled[self.law.name]) > 1
            where = f"to the nominal plant{', without the conditions' if several else ''}"
        plant = self.worst_run.plant
        joints = "; forces act at every driven joint"
        every = joints if plant.driven > 1 and not plant.pose else ""
        text = (
            f"{joined(parts)}. Each is applied alone, {where}{every}. At these levels the largest "
        )
        text += f"error in the last fifth of a run of {self.worst_run.duration:g} s is still below "
        text += "5 % of the initial error"
        if not all(margin.open for margin in self.margins):
            text += ", and at those after 'but not' it is above"
        text += ". A run at a tolerated level need not settle, and may first swing far"
        if self.beside != "nominal":
            text += ". Delay and mass include those of the condition; friction and blows are added"
        if self.helped:
            names = joined(self.helped)
            text += (
                f". Gravity or a spring pushes {names} to the goal from the start, and away from "
                "it on the other side"
            )
        return f"{text}; {late}" if late else text

    @property
    def _from_other_side(self) -> str:
        """How much friction is tolerated where the load pushes away from the goal."""
        if self.opposed is None:
            return "not tried from the other side"
        if math.isnan(self.opposed.value):
            return "none from the other side"
        return f"{_level(self.opposed)} from the other side"

    @property
    def tables(self) -> list[Tabular]:
        """J of the laws' sets of gains; the needs by condition, of the gains in the answer."""
        shown = [self._objectives]
        runs = next(iter(self.settled[self.law.name].values()))[1]
        groups = dict.fromkeys(" under ".join(board.group.values()) for board in self.leaderboard)
        for about, table in zip(groups, self.leaderboard.tables, strict=True):
            rows = [list(map(_unmarked, row)) for row in table.rows]
            title = f"{about}: {counted(runs, 'seed')}"
            shown.append(dataclasses.replace(table, rows=rows, notes=(), title=title))
        notes = self.leaderboard.remarks
        if runs < self.seeds:
            notes.append(
                f"{runs} runs of a law in each condition, as the time left was too short for "
                f"{self.seeds}."
            )
        missing = [law for law in self.race.running if law not in self.settled]
        if missing:
            notes.append(
                f"The tables by condition leave out {joined(missing)}: they show at most {SHOWN} "
                "laws."
            )
        share = "settled runs"
        has_shares = any(share in heading for table in shown for heading in table.headings)
        settled = MARKS[share] if has_shares else WHEN_SETTLED
        notes.append(
            f"{MEDIANS} {settled} In the tables by condition each law has one set of gains; those "
            "of the law to use and of the second are printed below. The scores in these tables are "
            "not tested for significance; only J is, below. "
            f"{capital(UNTRIED)}."
        )
        cells = repr([table.rows for table in shown])
        arrived = (
            f"{MARKS['']} In metrics of u, such as TV rate, a run that has not arrived counts as "
            "worse than any value."
        )
        words = {"floor ": FLOOR, "may exceed ": MARKS["may exceed "], "not arrived": arrived}
        for word, meaning in words.items():
            if word in cells:
                notes.append(meaning)
        last = shown.pop()
        return [*shown, dataclasses.replace(last, notes=[*notes, "", *self.answer])]

    @property
    def _objectives(self) -> Tabular:
        """The table of J of each law's sets of gains."""
        entrants = self.race.entrants
        rows = []
        for names in (self.race.running, self.race.dropped):
            medians = {name: float(np.median(entrants[name].values)) for name in names}
            for name in sorted(names, key=medians.__getitem__):
                values = entrants[name].values
                cell = Cell(_cost(medians[name]), span(_cost(min(values)), _cost(max(values))))
                rows.append([name, cell, f"{len(values)}"])
        last = "; laws that were dropped come last" if self.race.dropped else ""
        return Tabular(
            headings=["law", "J (s^2)", "groups of runs"],
            rows=rows,
            title=f"J {self.judged}",
            notes=[
                f"Median and range over groups of runs that tuning has not seen{last}. A group has "
                "one run in each condition, all with one set of gains: the first group with the "
                "law's first set, the second with the second, and so on; after the last set the "
                "first comes again. J is the time-weighted relative "
                "error plus the weighted variation of u, added up over the conditions. Verdicts on "
                f"J, below, have ratios with {100 * LEVEL:g} % intervals."
            ],
        )


def _level(margin: Margin) -> str:
    """Return the level of a margin with its unit, such as "at least 8.75 N m", or "8 N m but not 9
    N m" with the least level that is not tolerated.
    """
    unit = " times" if margin.unit == "1" else f" {margin.unit}".rstrip()
    text = f"{margin.text}{unit}".replace("≥", "at least")
    if margin.open or not margin.resolution:
        return text
    return f"{text} but not {number(margin.value + margin.resolution)}{unit}"


def _cost(J: float) -> str:
    """Return J as text; "fails" where a run of it fails."""
    return number(J) if J < FAILURE_COST else "fails"


def _some(count: int, every: int) -> str:
    """Return a number of things in words: "all", "none", or the number."""
    return {every: "all", 0: "none"}.get(count, f"{count}")


def _unmarked(cell: Cell | str) -> Cell | str:
    return cell if isinstance(cell, str) else cell._replace(strong=False)


def _ranked(comparison: Comparison, order: Sequence[str]) -> list[str]:
    """Return the laws with sets or runs enough to be told from others, in an order of laws."""
    enough = dict(zip(comparison.laws, comparison.ranked[:, 0], strict=True))
    return [law for law in order if enough.get(law)]


def _lead(comparison: Comparison, first: str, rival: str) -> str:
    """Return how J of a law compares with a rival's; where runs fail, without a ratio."""
    effect = comparison.effect(0, first, rival)
    lost = dict(zip(comparison.laws, comparison.away[:, 0].sum(axis=1).tolist(), strict=True))
    if not lost[first] and not lost[rival]:
        return LeastLead(first, rival, effect, unit=OF_J).words
    what = "sets of gains" if effect.sets else OF_J
    return (
        f"lower than {rival}'s in {effect.ahead} of {effect.samples} {what}, of which "
        f"{lost[first]} of {first} and {lost[rival]} of {rival} fail"
    )


def _verdict(comparison: Comparison, order: Sequence[str]) -> str:
    """Return which law has the lower J in a comparison of one block; `order` has laws by J."""
    winner = comparison.winners[0]
    names = _ranked(comparison, order)
    if not names:
        return "open, as no law has enough sets or runs"
    first = winner or names[0]
    effects = {}
    for law in names:
        if law != first:
            effects[law] = comparison.effect(0, first, law)
    rival = max(effects, key=lambda law: effects[law].high)
    at = comparison.laws.index(first), comparison.laws.index(rival)
    p = number(float(comparison.p[0][at]), 2)
    least = f"{100 * comparison.relevant:g} %"
    needs = "" if winner else f"; a winner needs at most {number(comparison.winning, 2)}"
    lead = f"{_lead(comparison, first, rival)} (p {p} for a lead above {least}{needs})"
    if winner:
        return f"{winner} wins; its J is {lead}"
    beaten = dict(zip(comparison.laws, comparison.worse[:, 0], strict=True))
    best = [law for law in names if not beaten[law]]
    if len(best) == 1:
        return f"open: {best[0]} {ALONE}; its J is {lead}"
    samples = effects[rival].samples
    if min_p(samples) > comparison.limit:
        units = "sets of gains" if effects[rival].sets else OF_J
        can = f"{samples} {units} can rule out none of {joined(best)}"
        return f"open, as {can}; J of {first} is {lead}"
    either = f"either {best[0]} or {best[1]}" if len(best) == 2 else f"any of {joined(best)}"
    return f"open, as {either} may have the lowest J; {first}'s is {lead}"
