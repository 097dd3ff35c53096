"""Margins: the largest delay, disturbance, friction, mass ratio, blow, noise, jitter and lost gain
that a law tolerates on a plant.

A run tolerates a level if it does not fail and its final error after 10 s is at most 5 % of its
scale (`conventions`). As a run starts at the scale, its envelope has then shrunk, which the paper's
claim on delay requires. The search tries up to nine levels from small to large. Then it halves the
interval below the FIRST level that is not tolerated, until the margin is known to one control
period (delay), an eighth of one (jitter) or 2 % (others). There may be tolerated levels above one
that is not, and levels that are not between two that were tried. Noise is one realisation, seed 0,
the same for every law. A disturbance acts on every channel, and both of its signs are tried.

Linear theory gives the delay above which rest is unstable. A smooth law then oscillates with an
amplitude that grows from 0, so it tolerates a little more. Theory also gives the constant force, or
dry friction, that holds the plant at 5 % of its scale; with friction it may stop closer to the
reference.

All searches advance together, a batch of runs per round. The fast engine runs what it can, but
in quick searches. MuJoCo then runs both ends of what it found, and searches again where it does not
agree.

A law of the package has the gains of its first search, and shipped ones have several. The others
run at both ends of the interval that was found; those that tolerate less, or more, are searched
further together for the least and the largest margin of all sets, as if each tolerated all levels
below its margin.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

from smc_mujoco.analysis.engine import Device
from smc_mujoco.analysis.engine.scored_runs import ScoredRuns, worth_compiling
from smc_mujoco.answers.answer import Answer
from smc_mujoco.answers.command import again, instead
from smc_mujoco.answers.facts import Fact, NextStep, Screen
from smc_mujoco.common.aliases import AnyPath
from smc_mujoco.common.constraints import Boolean, Called, constrained
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.progress import Report
from smc_mujoco.common.tabular import Cell, Tabular
from smc_mujoco.common.text import capital, number
from smc_mujoco.control import gain_sets as sets
from smc_mujoco.control import source
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.law import Law
from smc_mujoco.control.source import in_words
from smc_mujoco.draw import colouring
from smc_mujoco.mechanisms.plant import EFFORT, Plant
from smc_mujoco.robustness.level_search import COARSE, FINE, find_boundaries
from smc_mujoco.robustness.margin_cells import Cells, OverSets
from smc_mujoco.robustness.margin_kinds import KINDS, MARGIN_KINDS, REST_SHARE
from smc_mujoco.simulation.conditions import DURATION, Condition
from smc_mujoco.simulation.doubts import constant_goal
from smc_mujoco.simulation.grid import START_CURE, Starts, case, listed, listed_laws
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import warn_of_broken

if TYPE_CHECKING:
    from matplotlib.figure import Figure

QUICK_DURATION = 5.0  # s, of a quick search's runs


@keyword_dataclass
class Margin:
    """The largest level of one kind that one law tolerates on one plant."""

    plant: str  # its name
    law: str  # its name
    kind: str  # one of MARGIN_KINDS
    # largest tolerated level below the first one tried that is not; NaN if not even the unchanged
    # run is
    value: float
    unit: str  # of value, resolution, searched and theory
    resolution: float  # a level that is not tolerated is at most this much larger
    searched: (
        float  # largest level of the search; if it is the value, all that were tried are tolerated
    )
    theory: float | None  # the margin by linear theory
    sets: int = 1  # shipped sets of gains of the law; the value is of the first
    # the least and the largest margin over these sets; NaN for one set, and where the unchanged run
    # of the first is not tolerated. low is NaN where that of another is not
    low: float = math.nan
    high: float = math.nan

    @property
    def over_sets(self) -> str:
        """The range over all sets, as "0.179 to 0.221" or "fails to 0.2"; "" for one set."""
        if math.isnan(self.high):
            return ""
        least = "fails" if math.isnan(self.low) else number(self.low)
        most = f"{'≥ ' if self.high == self.searched else ''}{number(self.high)}"
        return least if least == most else f"{least} to {most}"

    @property
    def open(self) -> bool:
        """Whether every level that was tried is tolerated."""
        return self.value == self.searched

    @property
    def text(self) -> str:
        """The value, as "0.02", "≥ 0.5", or "fails at 0" where not even the unchanged run is
        tolerated.
        """
        if math.isnan(self.value):
            return f"fails at {MARGIN_KINDS[self.kind].none:g}"
        return f"{'≥ ' if self.open else ''}{number(self.value)}"


class Margins(Answer, list[Margin]):
    """Margins of laws on plants: `print` shows who tolerates the most, `full` all tables, and they
    can be drawn.
    """

    duration: float = DURATION  # of a run, s
    gains: str = ""  # where the laws' gains are from, in words
    coarse: bool = False

    @property
    def screen(self) -> Screen:
        """The answer: a table for each plant, and the law that tolerates the most of each kind."""
        tables = []
        places_of: dict[str, list[Fact]] = {}
        undecided: list[str] = []  # kinds of which no law tolerates the most on some plant
        kinds = dict.fromkeys(margin.kind for margin in self)
        for plant in dict.fromkeys(margin.plant for margin in self):
            cells: dict[str, list[Cell | str]] = {}
            headings = [""]
            won: dict[str, list[str]] = {}
            for kind in kinds:
                place = plant, kind
                of_kind = [margin for margin in self if (margin.plant, margin.kind) == place]
                unit = "of nominal" if kind == "mass" else of_kind[0].unit.replace("1", "share")
                headings.append(f"{kind} ({unit})")
                most = _most(of_kind)
                won.setdefault(most, []).append(kind)
                for margin in of_kind:
                    cell = Cell(margin.over_sets or margin.text, strong=margin.law == most)
                    cells.setdefault(margin.law, [margin.law]).append(cell)
            tables.append(Tabular(headings=headings, rows=list(cells.values()), title=plant))
            undecided += won.pop("", [])
            for law, of_law in won.items():
                places_of.setdefault(law, []).append(Fact("on plant", kinds=of_law, plant=plant))
        failing = dict.fromkeys(margin.law for margin in self if math.isnan(margin.value))
        step = NextStep(
            instead("worst", {}, ("--law", "--gains", "--condition")),
            "searches the worst of many disturbances at once",
        )
        if self.coarse:
            step = NextStep(again({}, without=("--quick",)), "finds them more exactly")
        notes = [Fact("most")] * bool(places_of) + [Fact("gains are", gains=capital(self.gains))]
        facts = [Fact("tolerates", law=law, places=places) for law, places in places_of.items()]
        of_several = undecided if len({margin.law for margin in self}) > 1 else []
        facts.append(Fact("no most", kinds=list(dict.fromkeys(of_several))))
        facts.append(Fact("fails", laws=list(failing)))
        ranges = any(margin.over_sets for margin in self)
        return Screen(
            heading=Fact("tolerated", duration=self.duration, ranges=ranges),
            tables=tables,
            notes=notes,
            facts=facts,
            next=step,
            word="margin",
        )

    @property
    def tables(self) -> list[Tabular]:
        """A table for each kind, with a line for each plant and law."""
        tables = []
        for kind in dict.fromkeys(margin.kind for margin in self):
            of_kind = [margin for margin in self if margin.kind == kind]
            over_sets = any(margin.over_sets for margin in of_kind)
            in_theory = any(margin.theory is not None for margin in of_kind)
            rows = []
            for margin in of_kind:
                of_theory = "" if margin.theory is None else number(margin.theory)
                of_theory = "any" if margin.theory == math.inf else of_theory
                within = number(margin.resolution) if margin.resolution else ""
                extra = *[margin.over_sets] * over_sets, *[of_theory] * in_theory
                law = Cell(margin.law, colour=colouring.law_colour(margin.law))
                rows.append((margin.plant, law, margin.text, within, *extra, margin.unit))
            extra = *["all sets"] * over_sets, *["theory"] * in_theory
            heads = "plant", "law", "margin", "to within", *extra, "unit"
            title = f"largest {kind} tolerated, in runs of {self.duration:g} s"
            tables.append(Tabular(headings=heads, rows=rows, title=title, name_columns=2))
        if tables and self.gains:
            tables[-1] = dataclasses.replace(tables[-1], notes=[self.gains])
        return tables

    def figure(self, path: AnyPath | None = None, **options: Any) -> "Figure":
        """Draw them as bars, in a panel for each plant and kind, and return the figure; arguments
        `path`, `title`, `size`, `format` and `fig` as in `smc.figure`.

            smc.margins("duffing", "pid", kinds="delay", quick=True).figure("margins.svg")
        """
        from smc_mujoco.robustness import margins_figure

        bars = []
        for margin in self:
            kind = MARGIN_KINDS[margin.kind]
            about = margin.plant, margin.law, kind.label, margin.unit, kind.none
            limit = math.nan
            if margin.theory is not None and not math.isnan(margin.value):
                limit = margin.theory if margin.theory < math.inf else math.nan
            bars.append(margins_figure.MarginBar(*about, margin.value, margin.resolution, limit))
        return margins_figure.draw_margins(bars, path, **options)


@constrained
def margins(
    plants: str | Plant | Sequence[str | Plant] = tuple(sets.STUDY),
    laws: str | Law | Template | Sequence[str | Law | Template] = sets.LAWS,
    kinds: str | Sequence[str] = KINDS,
    gains: str = "tuned",
    quick: Boolean = False,
    threads: int | None = None,
    report: Annotated[Report, Called()] = lambda done, whole: None,
    condition: str | Condition = "nominal",
    starts: Starts | None = None,
    device: Device = "cpu",
) -> Margins:
    """Return the largest level of each kind that laws tolerate, plant by plant, law by law, kind by
    kind. A run of 10 s tolerates a level if it does not fail and its error ends below 5 % of its
    initial value.

        for margin in smc.margins("duffing", "classical", kinds="delay", quick=True):
            print(margin.kind, margin.text, margin.unit)

    Args:
      plants, laws: names, or your own plants and laws, one or several.
      kinds: one or several of "delay", "disturbance" (a constant force on every driven joint, with
        either sign), "friction" (dry), "mass", "noise" (of positions and speeds); and of "blow",
        halfway through the run, "jitter" and "missed", of the controller's clock, and "loss", the
        fraction of its gain that an actuator has lost from the start on, which are left out by
        default. All actuators lose it, or the one that the condition's fault is on. Shares, and the
        factor on the mass, have the unit "1".
      gains: set of gains, one of `gain_sets.SETS`, or "default".
      quick: whether to make runs of 5 s and search to within 5 control periods or 10 %, for a first
        look.
      threads: as in `run`.
      report: called with the work done and the whole work, in simulated steps; the whole is an
        estimate until the end.
      condition: condition of the runs, such as "coulomb". A level of delay, mass, noise, jitter,
        missed samples or lost gain includes the condition's own; disturbances, friction and blows
        are on top of its own.
      starts: initial states, see `smc.starts`. Default: the plant's own x0.
      device: on which the fast engine searches, "cpu" or "cuda"; a quick search on the processor is
        MuJoCo's.

    Returns:
      `Margins`, a list of `Margin`: `value` in `unit`, nan where even the unchanged run fails;
      `text` is the value as printed, "0.035", or "≥ 0.5" if the largest level that was tried is
      tolerated. Of a law with several shipped sets of gains it is that of the first, and `low` to
      `high` is the range over all `sets`. Its `figure("margins.svg")` draws them.

    Raises:
      ScenarioError: an unknown plant, law, kind, set or condition, or runs that start at their
        goal: the one run of a margin begins in the middle of the starts, without their `by`.
    """
    if isinstance(plants, Scenario):
        raise ScenarioError("margins are of plants and laws, not of a scenario: give their names")
    duration = QUICK_DURATION if quick else DURATION
    bases = []
    siblings = []
    for plant in listed("plants", plants):
        for law in listed_laws(laws):
            base = case(plant, law, condition, duration, gains, starts=starts)
            bases.append(base)
            siblings.append(_other_sets(base, law, gains))
    for base in bases:
        if base.resolved.x0 == constant_goal(base):
            raise ScenarioError(
                f"{base.plant.name} starts at its goal, and margins need an initial error: "
                f"{START_CURE}"
            )
    resolution = COARSE if quick else FINE
    names = listed("kinds", kinds)
    return margins_of(bases, names, resolution, threads, report, device, siblings)


def _other_sets(base: Scenario, law: object, gains: str) -> list[Scenario]:
    """Return a run with each other set of gains that is shipped for its law; none of a law that was
    given with gains.
    """
    if gains not in sets.OBJECTIVES or base.law.source.kind != source.SHIPPED:
        return []
    if isinstance(law, Component) and law.source.kind != source.DEFAULT:
        return []
    count = len(sets.tuned(base.plant, base.law.name, gains).sets)
    scenarios = []
    for seed in range(1, count):
        of_set = sets.law_with_gains(base.plant, base.law.name, gains, seed)
        scenarios.append(dataclasses.replace(base, law=of_set).named(base.condition))
    return scenarios


def margins_of(
    bases: Sequence[Scenario],
    kinds: Sequence[str] = KINDS,
    resolution: float = FINE,
    threads: int | None = None,
    report: Report = lambda done, whole: None,
    device: str = "cpu",
    siblings: Sequence[Sequence[Scenario]] = (),
) -> Margins:
    """Return the margins of any scenarios, as `margins` does; the resolution is FINE or COARSE.
    `siblings` are the runs of each with other sets of gains.
    """
    cells = Cells(bases, kinds, resolution, report)
    # a coarse search by MuJoCo takes less time than compiling its law for the fast engine
    worth = resolution != COARSE and worth_compiling(cells.left)
    runs = ScoredRuns({REST_SHARE.name: REST_SHARE.of}, device, threads, worth)
    unchanged = [(i, None) for i in range(0, len(cells.pairs), len(kinds))]
    held = cells.tolerated(unchanged, runs.by_mujoco)
    going = {}
    for i, of_cell in enumerate(cells.searches):
        if held[i // len(kinds)]:
            going[i] = of_cell
    find_boundaries(going, lambda tried: cells.tolerated(tried, runs.scored))
    again = {}  # MuJoCo has the last word on the ends
    ends = cells.ends_by(going, runs.covers)
    for (i, level), good in zip(ends, cells.tolerated(ends, runs.by_mujoco), strict=True):
        if good != (level == going[i].low):
            again[i] = cells.begin(i)
    find_boundaries(again, lambda tried: cells.tolerated(tried, runs.by_mujoco))
    ranges = {}
    if any(siblings):
        ranges = OverSets(cells, siblings, len(kinds), runs.scored).ranges(going)
    warn_of_broken(runs.broken)
    margins = Margins()
    margins.duration = bases[0].duration
    margins.gains = in_words({base.law.name: [base.law.source] for base in bases})
    margins.coarse = resolution == COARSE
    for i, ((base, kind), search) in enumerate(zip(cells.pairs, cells.searches, strict=True)):
        margin = Margin(
            plant=base.plant.name,
            law=base.law.name,
            kind=kinds[i % len(kinds)],
            value=search.low if i in going else math.nan,
            unit=kind.unit.format(x=base.plant.unit, u=EFFORT[base.plant.unit]),
            resolution=search.high - search.low if search.high < math.inf else 0.0,
            searched=search.levels[-1],
            theory=kind.expected(base),
            sets=1 + len(siblings[i // len(kinds)]) if siblings else 1,
        )
        if i in ranges:
            margin = dataclasses.replace(margin, low=ranges[i][0], high=ranges[i][1])
        margins.append(margin)
    return margins


def _most(margins: Sequence[Margin]) -> str:
    """Return the law that tolerates more than any other, with each of its sets of gains and by more
    than the search resolves; "" if there is none.
    """
    for margin in margins:
        ends = []
        for rival in margins:
            most = rival.value if math.isnan(rival.high) else rival.high
            if rival is not margin and not math.isnan(rival.value):
                ends.append(math.inf if most == rival.searched else most + rival.resolution)
        least = margin.low if margin.over_sets else margin.value
        if len(margins) > 1 and least >= max(ends, default=-math.inf):
            return margin.law
    return ""
