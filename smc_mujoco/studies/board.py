"""A board: laws compared in one metric, its verdict in words, and boards as tables, with medians
and intervals.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from smc_mujoco.analysis.bootstrap import LEVEL, MIN_INTERVAL_SAMPLES, Interval
from smc_mujoco.analysis.paired_runs import (
    MIN_COMMAND_SHARE,
    OBJECTIVE,
    SETTLED,
    SETTLES,
    without_floor,
)
from smc_mujoco.analysis.ranking import (
    BEST_ERROR,
    LEVEL_SHARE,
    RIVALS,
    Effect,
    Rank,
    needed_to_rank,
    needed_to_win,
)
from smc_mujoco.analysis.step_halving import APART, UNTRIED
from smc_mujoco.common.aliases import Names, Numbers, Pair
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.tabular import Cell, Tables, Tabular
from smc_mujoco.common.text import (
    LEAST_PRINTED,
    capital,
    counted,
    ends,
    every,
    in_one_notation,
    joined,
    number,
)
from smc_mujoco.control.source import Source, kinds
from smc_mujoco.draw import style
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.metrics.conventions import Metric

LABELS = {SETTLES: "share of settled runs", OBJECTIVE: "J on unseen runs"}
MIN_TIMES = 1.03  # least lead of a law below the floor that is printed; chosen
MAX_LEAD = 0.995  # that may be said to show; chosen
MAX_NAMED = 8  # conditions that a verdict names; chosen
ALONE = "is not shown to beat every rival, and none is shown to beat it"
LEVEL_WORDS = f"are level within {100 * LEVEL_SHARE:g} %"
CHARGED = "is taken off a lead for changes late in the runs or at half the physics step"
# as far as these runs go: a share's interval is wider than 10 %
SAME_RUNS = "settle in the same runs"
FEW = (
    f"With fewer than {MIN_INTERVAL_SAMPLES} samples an interval is their range, with a coverage "
    f"below {100 * LEVEL:g} %."
)
MEDIANS = f"A cell has a median and its {100 * LEVEL:g} % interval."
FLOOR = (
    "'floor': the median is below the number after this word. Values below a floor count as equal."
)
WHEN_SETTLED = "A run counts as settled if it settles before its last fifth."
TESTED = (
    f"a paired test at {100 * BEST_ERROR:g} %, corrected for multiple comparisons: for {RIVALS} "
    "rivals even if there are fewer, for all if there are more"
)
# A word in tables -> its meaning, which their key says, and LaTeX below the table.
MEANINGS = {
    "J (": "Tuning minimises J, summed over conditions: ITAE divided by the initial error, "
    "plus 0.001 s^3 times the variation of u divided by u_max and by the duration. J in tables is "
    "from separate runs, which tuning has not seen.",
    "shipped": "Shipped gains come with smc_mujoco.",
    "tuned here": "Gains tuned here were found by searches with smc_mujoco.",
    "settled runs": f"Settled runs are given as a share, not as a median. {WHEN_SETTLED}",
    "settling time": "Settling time is when the error enters its band to stay: 2 % of its initial "
    "value, or of the reference's range if that is larger.",
    "ultimate bound": "The ultimate bound is the largest absolute error of any channel in the last "
    "fifth of a run.",
    "ITAE": "ITAE is the integral of time times absolute error.",
    "TV rate": "TV rate is the total variation of u per second, in the last fifth of a run.",
}
# A word in tables -> what their key says about it.
MARKS = MEANINGS | {
    "strong=True": "A star or bold type marks the winner. If no law wins, it marks each law that "
    f"meets four requirements: no other law is shown to be better ({TESTED}), all its own runs "
    "have arrived (see below), it has enough samples, and its interval is not too wide. An "
    "interval is too wide if its upper end is more than 4 times the lower end and more than 4 "
    "times the floor, below which values count as equal.",
    "": "A run has arrived if, in its last fifth, the error stays below 10 % of its initial value "
    "or below 5 times the sensor's resolution.",
    "floor ": f"{FLOOR} If a law below the floor may be the best, no law above the floor is "
    "marked. For an error, the floor is 1e-4 of its initial value. For errors late in the run, it "
    "is also at least half an encoder count and at least the noise. For u and its "
    f"variation per second, it is {100 * MIN_COMMAND_SHARE:g} % of u_max.",
    "may exceed ": "'may exceed': the median is below the floor, but it rises at the end of runs, "
    "or with half the physics step, so that it need not stay there.",
    "at half": "'some runs': at least one in four runs were repeated with half the physics step. "
    f"Their medians before and after are printed if they differ by more than {APART}; the true "
    "value may lie outside the cell's interval.",
}
LAST = "never", "fails", "not arrived"  # words in place of a value

# A word in headings and cells -> what LaTeX prints about it below the last table.
UNDER = {
    "": f"Below each median is its {100 * LEVEL:g} % interval.",
    **MEANINGS,
    "default": "Default gains are those of the law's own file.",
    "given": "Gains marked given are the authors' own choice.",
    "strong=True": f"Bold: may be the best: no other law is shown to be better ({TESTED}). A law "
    "without bold is not always shown to be worse. A law wins if it is shown to be better than "
    "every other.",
    "floor ": "Floor: the median is below this floor (of noise, resolution, or a small share of "
    "the start or of u_max). Values below it count as equal; where one is bold, no value above the "
    "floor is.",
    "may exceed ": "May exceed a floor: the median is below it, but need not stay there.",
    "at half": "At half the step: the median of the runs that were repeated with half the physics "
    "step, before and after.",
}


@keyword_dataclass
class BoardEntry:
    """A law's line in a board."""

    law: str
    interval: Interval  # of its median, or of the share of its runs that settle, over its samples
    vague: bool  # whether the interval is too wide for the median to say enough
    rank: Rank
    failed: int  # number of its runs that failed, or have no value, such as those that never settle
    runs: int  # number of its runs, equal ones counted once
    sources: tuple[Source, ...] = ()  # of its gains


class LeastLead(NamedTuple):
    """The law in front in a block, the rival over which its lead is least (by the upper end of the
    interval), and how they compare.
    """

    law: str
    rival: str
    effect: Effect
    floor: str = ""  # in words, if the law is below it and the rival is not, else ""
    unit: str = "runs"  # what values are of
    lacking: str = ""  # how many runs of the rival have no value, such as "5 of 24"

    @property
    def words(self) -> str:
        """What is said of the law's value, such as "0.88 times pid's (0.84 to 0.92), and it is
        ahead of pid in 24 of 24 runs"; "below the floor of 0.01 rad, and it is ahead of pid in 20
        of 24 runs; pid's median is at least 1.3 times the floor".
        """
        share = f"{self.effect.ahead} of {self.effect.samples}"
        units = "sets of gains" if self.effect.sets else self.unit
        among = "with" if self.effect.sets else "in"
        ahead = f"and it is ahead of {self.rival} {among} {share} {units}"
        if self.lacking:
            return f"defined in every run, while {self.rival} has none in {self.lacking}, {ahead}"
        if self.floor:
            least = 1.0 / self.effect.high
            if least < MIN_TIMES:
                return f"below the floor of {self.floor}, unlike {self.rival}'s"
            text = f"below the floor of {self.floor}, {ahead}; {self.rival}'s median is at least"
            return f"{text} {number(least)} times the floor"
        ratio, low, high = map(number, self.effect[:3])
        text = f"{ratio} times {self.rival}'s ({low} to {high})"
        if not self.effect.ahead:
            none = f"in none of {self.effect.samples} {units}"
            least = f"the {100 * self.effect.relevant:g} % that counts"
            return f"{text}, but {none} lower by more than {least}"
        return f"{text}, {ahead}"


@keyword_dataclass
class Block:
    """Laws compared on one plant in one condition. A law's name is the key of the mappings."""

    plant: str
    condition: str
    # medians over the seeds; for "settles" the share of runs that do not settle
    medians: Numbers
    lacking: Mapping[str, int]  # number of runs that failed or have no value
    best: Names  # laws that may be the best, see `ranking`
    worse: Names  # laws that another is better than
    below: Names  # laws below the floor, which are not ranked among themselves
    floor: str  # in words, such as "0.01 rad"; "" where it is not known
    away: Names  # laws with runs that failed or have not arrived, which do not win
    ahead: str | None  # the law that is better than every other, laws with default gains included
    # None for one law, for "settles", or if the law in front has runs without a value
    lead: LeastLead | None
    seeds: int  # in which every law ran
    # distinct runs in these seeds; in the others every law repeats the result of an earlier one
    runs: int
    level: bool  # whether the `best` laws are all level with each other
    # the least lead with which one of the `best` would have won, a share; NaN without a test
    resolves: float
    charged: float  # what half the step and trends take from that lead, a share
    # medians at the step and at half of it, where they differ much
    by_step: Mapping[str, Pair]
    samples: int  # largest number of any two laws, see `ranking`; for one law, of its runs
    sets: int  # smallest number of sets of gains of a law that has several; 1 if none has
    given: bool  # whether a law has one set of gains
    few: Mapping[str, int]  # laws that are not ranked, as they have so few sets of gains or runs
    rising: Names = ()  # laws whose median is below the floor, but need not stay there
    # the laws with default gains, over which no other law is named the winner
    untuned: Names = ()

    @property
    def winner(self) -> str | None:
        """The law that is better than every other, among several, unless `barred`."""
        return None if self.barred else self.ahead

    @property
    def barred(self) -> Names:
        """The laws with default gains that are worse than the law ahead, which is then not named
        the winner.
        """
        if self.ahead:
            return tuple(law for law in self.untuned if law != self.ahead)
        return ()

    @property
    def lowest(self) -> str:
        """That several of the best laws, or all laws, are below the floor; "" if they are not."""
        low = [law for law in self.best if law in self.below]
        if len(self.below) == len(self.medians) and not self.away:
            low = list(self.medians)
        if len(low) < 2:
            return ""
        names = joined(low)
        if len(low) == len(self.medians) == 2:
            names = "both"
        return f"medians of {names} are below the floor of {self.floor} and count as equal"

    @property
    def all_settle_or_none(self) -> bool:
        """Whether every run of every law settles, or none, for the share of runs that do not."""
        shares = set(self.medians.values())
        return shares in ({0.0}, {1.0})

    @property
    def sample(self) -> str:
        """The size of the sample, such as "20 seeds, 1 distinct run, 3 sets of gains"."""
        parts = [counted(self.seeds, "seed")]
        if self.runs < self.seeds:
            parts.append(counted(self.runs, "distinct run"))
        if self.sets > 1:
            least = "at least " if self.samples > self.sets else ""
            one = " (one for some laws)" if self.given else ""
            parts.append(f"{least}{self.sets} sets of gains{one}")
        return ", ".join(parts)


@dataclasses.dataclass(frozen=True, kw_only=True, repr=False)
class Board(Tables):
    """Laws compared in one metric within one group of runs."""

    group: Mapping[str, str]  # what the runs have in common, such as {"plant": "duffing"}
    metric: str  # its name, or "settles"
    # of the medians, with {x} and {u} as in `Metric.unit`; "" for "settles", which is 0 to 1
    unit: str
    entries: tuple[BoardEntry, ...]  # lowest mean rank first
    blocks: tuple[Block, ...]  # the same laws in each condition
    family: int  # number of blocks of the table for which winners are corrected
    relevant: float  # share of a value that is relevant
    # whether halving the physics step may change its numbers, and no run was repeated with it
    by_step: bool
    x: str = ""  # the unit of positions, "rad" or "m"; "" where it is not known
    summed: Names = ()  # the conditions whose runs a number sums, as J does

    @property
    def best(self) -> Names:
        """The laws that no other is better than, in any block.

        With several blocks there may be none.
        """
        best = []
        for entry in self.entries:
            if entry.rank.best:
                best.append(entry.law)
        return tuple(best)

    @property
    def winner(self) -> str | None:
        """The law that wins in every block, if there is one."""
        winners = {block.winner for block in self.blocks}
        return winners.pop() if len(winners) == 1 else None

    @property
    def tables(self) -> list[Tabular]:
        """The board as a table."""
        return Boards([self]).tables

    @property
    def about(self) -> str:
        """What the runs have in common, such as "duffing, nominal"."""
        return ", ".join(self.group.values())

    def wins(self, law: str) -> list[str]:
        """Return the conditions in which a law wins."""
        won = []
        for block in self.blocks:
            if block.winner == law:
                won.append(block.condition)
        return won

    def losses(self, law: str) -> list[str]:
        """Return the conditions in which another law wins."""
        lost = []
        for block in self.blocks:
            if block.winner not in (law, None):
                lost.append(block.condition)
        return lost

    @property
    def label(self) -> str:
        """The metric in words, such as "ultimate bound"."""
        return LABELS.get(self.metric) or CATALOGUE[self.metric].label

    @property
    def setting(self) -> str:
        """The plant and the conditions in words, such as " on duffing under noise"."""
        if self.metric == OBJECTIVE:
            return f" of {self.group['plant']}"
        conditions = _conditions([block.condition for block in self.blocks])
        return f" on {self.group['plant']} under {conditions}"

    @property
    def verdict(self) -> str:
        """The metric, the plant, the conditions and the `result`."""
        return f"{self.label}{self.setting}: {self.result}"

    @property
    def result(self) -> str:
        """The winner and its least lead; else where laws win and lose; else why none wins. Then
        which laws are not ranked, and that no floor is known where it is not.
        """
        if self.winner or any(map(self.wins, self._laws)):
            text = self._won
        else:
            text = f"no winner; {self._why}"
        if self.few and not self.too_few:
            text += f"; {self._not_ranked}"
        return "; ".join(filter(None, (text, without_floor(self.metric))))

    @property
    def _laws(self) -> list[str]:
        return [entry.law for entry in self.entries]

    @property
    def _won(self) -> str:
        """The winner and its least lead, or where laws win and lose."""
        where = at_worst = given = ""
        if len(self.blocks) > 1:
            where = f" in {every(len(self.blocks))} conditions"
            at_worst = "at worst "
        if any(block.given for block in self.blocks):
            given = ", for these gains"
        if self.winner:
            leads = []
            for block in self.blocks:
                if block.lead:
                    leads.append(block.lead)
            if leads:
                least = max(leads, key=lambda lead: lead.effect.high)
                given += f"; {at_worst}its value is {least.words}"
            return f"{self.winner} wins{where}{given}"
        results = []
        for law in filter(self.wins, self._laws):
            lost = _conditions(self.losses(law)) or "none"
            won = _conditions(self.wins(law))
            results.append(f"{law} wins under {won} and loses under {lost}")
        return f"no law wins{where}; {'; '.join(results)}{given}"

    @property
    def _why(self) -> str:
        """Why no law wins in any block."""
        if len(self.entries) == 1:
            return "there is one law"
        if self.barred:
            return f"no law may win over the default gains of {joined(self.barred)}"
        if all(len(block.away) == len(block.medians) for block in self.blocks):
            return "every law has runs that fail or do not arrive"
        tied: dict[str, list[str]] = {}
        for block in self.blocks:
            tied.setdefault(self._tied(block), []).append(block.condition)
        untied = tied.pop("", None)
        reasons = []
        for reason, conditions in tied.items():
            alone = len(conditions) == len(self.blocks)
            reasons.append(reason if alone else f"{reason} under {_conditions(conditions)}")
        if untied:
            reasons.append(self.too_few)
        if reason := "; ".join(filter(None, reasons)) or self._too_few_to_rank:
            return reason
        if not self.best:
            return "every law is beaten in some condition"
        return self.tie

    def _tied(self, block: Block) -> str:
        """Return why no number of samples would tell the laws of a block apart; "" if one may."""
        if self.metric == SETTLES and block.all_settle_or_none:
            return f"{'both laws' if len(self.entries) == 2 else 'all laws'} {SAME_RUNS}"
        return block.lowest

    @property
    def tie(self) -> str:
        """That the best laws are level, or that none is shown to be better, and the largest of the
        least leads that would have been seen; which law is below the floor, where one is.
        """
        for block in self.blocks:
            if block.lead and block.lead.floor:
                none = f"no law is shown to be better than {joined(self.best, 'or')}"
                return f"{none}; the median of {block.lead.law} is {block.lead.words}"
        if len(self.best) == 1:
            return f"{self.best[0]} {ALONE}"
        alike = len(self.best) == len(self.entries)
        if self.level:
            names = joined(self.best)
            if alike:
                names = "both laws" if len(self.entries) == 2 else "all laws"
            return f"{names} {SAME_RUNS if self.metric == SETTLES else LEVEL_WORDS}"
        others = "another" if alike else joined(self.best, "or")
        level = f"{100 * BEST_ERROR:g} %, corrected for multiple comparisons"
        text = f"no law is shown to be better than {others} (at {level})"
        if math.isnan(self.resolves):
            return text
        # of the lead that is printed
        charged = max(block.charged for block in self.blocks if block.resolves == self.resolves)
        if charged > self.relevant:
            return f"{text}; {hidden(self.resolves)}, as {100 * charged:.2g} % {CHARGED}"
        return f"{text}; {hidden(self.resolves)}"

    @property
    def level(self) -> bool:
        """Whether the best laws are level in every block."""
        return all(block.level for block in self.blocks)

    @property
    def resolves(self) -> float:
        """The largest of the blocks' least leads that would have been seen, a share; NaN without a
        test.
        """
        seen = [block.resolves for block in self.blocks if not math.isnan(block.resolves)]
        return max(seen, default=math.nan)

    @property
    def barred(self) -> list[str]:
        """The laws with default gains over which no winner is named in any block, see
        `Block.barred`.
        """
        barred: dict[str, None] = {}
        for block in self.blocks:
            barred |= dict.fromkeys(block.barred)
        return list(barred)

    @property
    def few(self) -> dict[str, int]:
        """The laws that are not ranked in some block -> their number of sets of gains, or runs."""
        few: dict[str, int] = {}
        if len(self.entries) > 1:
            for block in self.blocks:
                few |= block.few
        return few

    @property
    def _samples(self) -> int:
        """The number of samples in the block with most of them."""
        return max(block.samples for block in self.blocks)

    @property
    def too_few(self) -> str:
        """That no block has enough samples for a winner, how many are enough, and the cure; "" if
        one has.
        """
        least = needed_to_win(self.family)
        enough = any(len(block.medians) - len(block.few) > 1 for block in self.blocks)
        if len(self.entries) < 2 or (enough and self._samples >= least):
            return ""
        few = self._counted(self._samples)
        least = max(least, self._samples + 1)
        return f"{few} cannot rank {len(self.entries)} laws here; {least} can ({self._cure(least)})"

    @property
    def _too_few_to_rank(self) -> str:
        """That a law may win, but no law can be told from the best, and the cure; "" if one can."""
        least = needed_to_rank(len(self.entries))
        if self._samples >= least:
            return ""
        few = self._counted(self._samples)
        cannot = f"no law beats all others, and {few} cannot rank them"
        return f"{cannot}; {least} can ({self._cure(least)})"

    def _cure(self, least: int) -> str:
        """How to have so many samples."""
        cures = []
        if max(block.runs for block in self.blocks) < least:
            cures.append(f"seeds={least}")
        if not cures or any(1 < block.sets < least for block in self.blocks):
            cures.append(f"searches={least} of compare")
        return joined(cures)

    def _counted(self, count: int) -> str:
        """Return a number of samples, such as "3 sets of gains"; runs are those of laws with one
        set.
        """
        if any(block.sets > 1 for block in self.blocks):
            runs = " or runs" if any(block.given for block in self.blocks) else ""
            return f"{counted(count, 'set')} of gains{runs}"
        return counted(count, "run")

    @property
    def _not_ranked(self) -> str:
        """Which laws are not ranked, and the cure."""
        words = []
        for law, count in self.few.items():
            words.append(f"{law} ({self._counted(count)})")
        least = min(needed_to_win(self.family), needed_to_rank(len(self.entries)))
        not_ranked = f"{joined(words)} {_is_or_are(words)} not ranked"
        return f"{not_ranked}, which needs {least} ({self._cure(least)})"

    def failures(self, entry: BoardEntry) -> str:
        """Return how many of a law's runs failed, have not arrived, or never reach a time, such as
        "2 of 24 failed"; "" if none did.
        """
        if not entry.failed:
            return ""
        how = "failed"
        if self.unit == "s":
            how = "never"
        elif self.metric in CATALOGUE and not CATALOGUE[self.metric].error:
            how = "not arrived"
        return f"{entry.failed} of {entry.runs} {how}"


class Boards(Tables, list[Board]):
    """Boards: a list that terminals, notebooks and `print` show as tables, with a verdict on each
    board.
    """

    # sentences below the last table: what u is where it is a set-point, for each law with failed
    # runs, and where no run touches
    commands: Sequence[str] = ()
    failures: Sequence[str] = ()
    untouched: Sequence[str] = ()
    # why metrics have no board, shown if none has
    absent: Sequence[str] = ()
    labels: Mapping[str, str] = {}  # law -> what LaTeX calls it
    plants: Mapping[str, Plant] = {}  # by name

    @property
    def remarks(self) -> list[str]:
        """These sentences."""
        return [*self.commands, *self.failures, *self.untouched]

    @property
    def winners(self) -> list[tuple[str, str, str, str]]:
        """The metric, plant, condition and law of each win."""
        won = []
        for board in self:
            for block in board.blocks:
                if block.winner:
                    won.append((board.metric, block.plant, block.condition, block.winner))
        return won

    @property
    def order(self) -> list[str]:
        """All laws, by the number of their runs without a value, then by mean rank over all
        blocks.
        """
        standing: dict[str, tuple[int, float]] = {}
        for board in self:
            for entry in board.entries:
                failed, rank = standing.get(entry.law, (0, 0.0))
                rank += entry.rank.mean * len(board.blocks)
                standing[entry.law] = failed + entry.failed, round(rank, 9)
        return sorted(standing, key=lambda law: (standing[law], law))

    @property
    def tables(self) -> list[Tabular]:
        """A table for each group of runs, with what each metric's board says below, and a key below
        the last.

        It has a line for each law and a column for each metric. A cell has a median with its
        interval. The median is marked if the law may be the best in every block.
        """
        groups: dict[str, list[Board]] = {}
        for board in self:
            groups.setdefault(board.about, []).append(board)
        if not groups:
            return [Tabular(headings=["no boards: no metric applies"], rows=[], notes=self.absent)]
        tabulars = [_table(boards, self.labels, self.plants) for boards in groups.values()]
        words = str([(table.headings, table.rows) for table in tabulars])
        last = tabulars[-1]
        notes = *last.notes, *self.remarks, *key(self, words)
        under = *last.under, _short_key(self, words)
        return [*tabulars[:-1], dataclasses.replace(last, notes=notes, under=under)]


def hidden(lead: float) -> str:
    """Return a sentence: the least lead that samples show, a share, and that less may be unseen."""
    if lead < MAX_LEAD:
        return f"a lead below {100 * lead:.2g} % might go undetected"
    return "even the largest lead might go undetected"


def _conditions(names: Sequence[str]) -> str:
    """Return conditions in words; the number of many, as those of an ensemble."""
    return joined(names) if len(names) <= MAX_NAMED else f"{len(names)} conditions"


def _is_or_are(things: Sequence[str]) -> str:
    return "is" if len(things) == 1 else "are"


def size(value: float, metric: str) -> str:
    """Return a median as text: "" for NaN, a share in percent."""
    if math.isnan(value):
        return ""
    if metric == OBJECTIVE:
        return number(value)
    if metric == SETTLES:
        return f"{100 * value:.0f}"
    return CATALOGUE[metric].text(value)


def sizes(values: Sequence[float], metric: str) -> list[str]:
    """Return numbers of one cell as text, each as `size` does, in one notation."""
    texts = []
    for value, text in zip(values, in_one_notation(values), strict=True):
        other = metric == SETTLES or not math.isfinite(value)
        texts.append(size(value, metric) if other else text)
    return texts


def spread(interval: Interval, low: str, high: str) -> str:
    """Return the ends of an interval, from their texts; "" if they are not known, both infinite, or
    both below 1e-9, which the median says.
    """
    if math.isnan(interval.low) or math.isinf(interval.low):
        return ""
    if 0.0 < interval.high < LEAST_PRINTED:
        return ""
    return ends(low, high)


def heading(board: Board) -> str:
    """Return a metric's label with its unit, if that is known."""
    if board.metric == SETTLES:
        return SETTLED
    if board.metric == OBJECTIVE:
        return "J (s^2)"
    return _in_unit(board).heading(board.x)


def unit_of(board: Board) -> str:
    """Return the unit of a board's medians; "" for a share, or where positions have none."""
    if board.metric not in CATALOGUE or not board.x:
        return "" if "{" in board.unit else board.unit
    return _in_unit(board).unit_for(board.x)


def _in_unit(board: Board) -> Metric:
    """Return the metric of a board, in the board's unit: in V for voltages."""
    return dataclasses.replace(CATALOGUE[board.metric], unit=board.unit)


def _table(
    boards: Sequence[Board], labels: Mapping[str, str], plants: Mapping[str, Plant]
) -> Tabular:
    """Return the table of one group of runs, with `Boards.labels` and `Boards.plants`.

    Laws stand by place in the first metric, those of one place by their median in it, then by the
    next ones.
    """
    sources_of = sources(boards)
    places: dict[str, list[Pair]] = {}
    cells: dict[str, list[Cell | str]] = {}
    for i, board in enumerate(boards):
        for entry in board.entries:
            standing = entry.rank.place, entry.interval.median
            places.setdefault(entry.law, []).append(standing)
            cells.setdefault(entry.law, [""] * len(boards))[i] = _cell(board, entry)
    rows = []
    for law in sorted(places, key=lambda law: (places[law], law)):
        name_cell = Cell(law, kinds(sources_of[law]), colour=style.law_colour(law))
        label = labels.get(law) or style.law_name(law)
        rows.append([name_cell._replace(label=label), *cells[law]])
    largest = max(boards, key=lambda board: len(board.blocks))
    plant = largest.group["plant"]
    headings = ["law", *map(heading, boards)]
    return Tabular(
        headings=headings,
        rows=rows,
        title=_title(largest, plant),
        label=_title(largest, style.plant_name(plants.get(plant, plant)), style.condition_name),
        notes=_verdicts(boards),
        under=_wins(boards, labels) if "strong=True" in str(rows) else (),
    )


def _title(board: Board, plant: str, named: Callable[[str], str] = str) -> str:
    """Return what the runs of a board have in common, and the samples; `named` has the name of a
    condition.
    """
    about = plant
    if len(board.blocks) == 1:
        about += f", {named(board.blocks[0].condition)}"
    if board.summed:
        about += f" under {joined(map(named, board.summed))}"
    samples = dict.fromkeys(block.sample for block in board.blocks)
    return f"{about}: {'; '.join(samples)}"


def _wins(boards: Sequence[Board], labels: Mapping[str, str]) -> list[str]:
    """Return a paragraph: which law wins in which metrics, and which leads may be unseen in the
    others.
    """
    won: dict[str, list[str]] = {}
    unseen = []
    level = []
    for board in boards:
        if board.winner:
            won.setdefault(board.winner, []).append(board.label)
        elif board.level and len(board.best) > 1 and board.metric != SETTLES:
            level.append(board.label)
        elif board.resolves < MAX_LEAD:
            unseen.append(f"{100 * board.resolves:.2g} % in {board.label}")
    sentences = []
    for law, metrics in won.items():
        sentences.append(f"{labels.get(law) or style.law_name(law)} wins: {joined(metrics)}.")
    if not won:
        sentences.append("No law wins.")
    if level:
        sentences.append(f"The best laws {LEVEL_WORDS}: {joined(level)}.")
    if unseen:
        sentences.append(f"Leads below {joined(unseen)} might go undetected.")
    return [" ".join(sentences)]


def _cell(board: Board, entry: BoardEntry) -> Cell:
    """Return a law's median, strong if the law may be the best in every block."""
    interval = entry.interval
    changes = []
    for block in board.blocks:
        if entry.law in block.by_step:
            changes.append(block.by_step[entry.law])
    numbers = [interval.median, interval.low, interval.high, *itertools.chain(*changes[:1])]
    median, low, high, *step = sizes(numbers, board.metric)
    below = [spread(interval, low, high)]
    for block in board.blocks:
        if entry.law in block.below:
            below.append(f"floor {block.floor}")
            break
        if block.floor and entry.law in block.rising:
            below.append(f"may exceed {block.floor}")
            break
    alarms = [board.failures(entry)]
    if step:
        before, after = step
        alarms.append(f"some runs {before}, at half the step {after}")
    says = entry.law == board.winner or not entry.vague
    best = entry.rank.best and says and median != "" and not board.barred
    lines = "\n".join(filter(None, below))
    return Cell(median, lines, best, alarm="\n".join(filter(None, alarms)))


def _few(boards: Sequence[Board]) -> bool:
    """Return whether an interval is of fewer than MIN_INTERVAL_SAMPLES samples."""
    for board in boards:
        for entry in board.entries:
            if entry.interval.n < MIN_INTERVAL_SAMPLES:
                return True
    return False


def _short_key(boards: Sequence[Board], words: str) -> str:
    """Return what LaTeX prints about the words of tables."""
    sentences = [text for word, text in UNDER.items() if word in words]
    if _few(boards):
        sentences.insert(1, FEW)
    return " ".join(sentences)


def key(boards: Sequence[Board], tables: str) -> list[str]:
    """Return what the words of these tables mean, in paragraphs."""
    parts = [
        f"{MEDIANS} If a law has several sets of gains, runs with the same set count as one sample."
    ]
    if _few(boards):
        parts.append(FEW)
    for word, text in MARKS.items():
        if word in tables:
            parts.append(text)
    held = []
    for word in LAST:
        if word in tables:
            held.append(repr(word))
    if last := joined(held):
        parts.append(f"Every value ranks before {last}.")
    parts.append(
        "A winner is better than every other law in a paired test. For each metric, the "
        f"probability of any wrong winner is at most {100 * (1 - LEVEL):g} %, over all plants "
        "and conditions compared; over several metrics together it may be as large as the sum of "
        "these probabilities. A verdict gives the winner's least lead over its rivals: the ratio "
        f"in paired runs with a {100 * LEVEL:g} % interval. This ratio differs from the ratio of "
        "the medians in the table. Tests, intervals of leads and numbers after 'at least' are "
        "cautious: a lead is reduced by its change at half the physics step, and by its change "
        "between the last two fifths of a run, in case it goes on changing. Under a periodic load "
        "this reduction can be larger than needed. So a law may fail to win though the intervals "
        "of the table do not overlap. A law is ahead if it is better by more than "
        f"{100 * boards[0].relevant:g} % of the larger value."
    )
    if any(LEVEL_WORDS in board.verdict for board in boards):
        parts.append(
            f"Laws are level if the {100 * LEVEL:g} % interval of their ratio in paired runs lies "
            f"within {100 * LEVEL_SHARE:g} % of 1."
        )
    if any(board.by_step for board in boards):
        parts.append(f"{capital(UNTRIED)}.")
    return parts


def sources(boards: Iterable[Board]) -> dict[str, list[Source]]:
    """Return law -> the sources of its gains, for every law of some boards, by name."""
    by_law: dict[str, list[Source]] = {}
    for board in boards:
        for entry in board.entries:
            by_law.setdefault(entry.law, []).extend(entry.sources)
    return dict(sorted(by_law.items()))


def _verdicts(boards: Sequence[Board]) -> list[str]:
    """Return the verdicts of boards; metrics with the same result share a sentence."""
    labels: dict[str, list[str]] = {}
    for board in boards:
        labels.setdefault(f"{board.setting}: {board.result}.", []).append(board.label)
    sentences = []
    for result, names in labels.items():
        sentences.append(f"{joined(names)}{result}")
    return sentences
