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
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import numpy as np

from smc_mujoco.analysis import linear_theory as theory
from smc_mujoco.analysis.engine import Device
from smc_mujoco.analysis.engine.scored_runs import ScoredRuns, worth_compiling
from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.answers.answer import Answer
from smc_mujoco.answers.command import again, instead
from smc_mujoco.answers.facts import Fact, NextStep, Screen
from smc_mujoco.common.aliases import AnyPath
from smc_mujoco.common.constraints import Boolean, Called, constrained
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, ScenarioWarning, find
from smc_mujoco.common.progress import Report, summed
from smc_mujoco.common.tabular import Cell, Tabular
from smc_mujoco.common.text import capital, number
from smc_mujoco.control import gain_sets as sets
from smc_mujoco.control import source
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.law import Law
from smc_mujoco.control.source import in_words
from smc_mujoco.draw import style
from smc_mujoco.mechanisms.plant import EFFORT, Plant
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.robustness.uncertainty import JITTER_SHARES, with_friction, with_jitter
from smc_mujoco.simulation.coerce import REST
from smc_mujoco.simulation.conditions import DURATION, Condition
from smc_mujoco.simulation.doubts import constant_goal
from smc_mujoco.simulation.force_bounds import default_u_max
from smc_mujoco.simulation.grid import START_CURE, Starts, case, listed, listed_laws
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Constant, Fault, Impulse, Noise
from smc_mujoco.simulation.trace import Trace, warn_of_broken

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TOLERATED_ERROR = 0.05  # of the scale: the audit's threshold for a final error
REST_SHARE = CATALOGUE["rest_share"]  # which must be below it
# 1/s, noise of the velocity over that of the position: that of the study's sensor
VELOCITY_NOISE_RATIO = 5.0
MAX_FORCE = 6.0  # N or N m: the study's u_max; no actuator there holds a larger force
MAX_MASS_RATIO, MAX_NOISE = 64.0, 2.048  # mass ratio; rad or m: chosen, far above tolerated levels
POWERS = 2.0 ** np.arange(-8, 1)
FORCES = tuple((MAX_FORCE * POWERS).tolist())
NOISES = tuple((MAX_NOISE * POWERS).tolist())
BLOWS = tuple((8.0 * POWERS).tolist())  # of F T of the plant's scales; chosen
MASS_RATIOS = tuple(np.geomspace(1.0, MAX_MASS_RATIO, 10)[1:].tolist())
JITTERS = tuple(i / JITTER_SHARES for i in range(1, JITTER_SHARES))  # of the control period
DELAYS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)  # s
FINE, COARSE = 0.02, 0.1  # resolution of a full and of a quick search, of the level
# the same in quanta, for levels that are multiples of one, such as control periods
QUANTA = {FINE: 1, COARSE: 5}
QUICK_DURATION = 5.0  # s, of a quick search's runs
EXPECTED_HALVINGS = 6  # of an interval between two levels, for the progress bar

Key = TypeVar("Key")


# the search


@dataclasses.dataclass(kw_only=True)
class LevelSearch:
    """The search for the largest tolerated level below the first one that is not tolerated."""

    # tried first, from small to large, up to the first that is not tolerated
    levels: Sequence[float]
    # largest tolerated level -> the interval at which the search ends
    resolution: Callable[[float], float]
    rounded: Callable[[float], float] = float  # level -> the nearest one that a run can have
    low: float = 0.0  # largest level known to be tolerated; at first the level without any effect
    high: float = math.inf  # smallest level known not to be tolerated; inf until there is one

    @property
    def next(self) -> float | None:
        """The level to try next; None when the search is done."""
        if self.high == math.inf:
            for level in self.levels:
                if level > self.low:
                    return level
            return None
        if self.high - self.low <= self.resolution(self.low) * (1.0 + 1e-9):
            return None
        return self.rounded((self.low + self.high) / 2.0)

    @property
    def left(self) -> int:
        """The number of levels still to try, estimated."""
        if self.high == math.inf:
            return sum(level > self.low for level in self.levels) + EXPECTED_HALVINGS
        halvings = math.log2((self.high - self.low) / self.resolution(self.low))
        return math.ceil(max(0.0, halvings))


def find_boundaries(
    searches: Mapping[Key, LevelSearch],
    tolerated: Callable[[list[tuple[Key, float]]], Iterable[bool]],
) -> None:
    """Advance searches together until all are done; `tolerated` judges a level of each search that
    continues.
    """
    while True:
        tried = []
        for key, search in searches.items():
            level = search.next
            if level is not None:
                tried.append((key, level))
        if not tried:
            return
        for (key, level), good in zip(tried, tolerated(tried), strict=True):
            setattr(searches[key], "low" if good else "high", level)


# the kinds of margins


@keyword_dataclass
class MarginKind:
    """A kind of margin: something that a law tolerates up to some level."""

    label: str  # in tables and figures
    unit: str  # {x} stands for the unit of x, {u} for that of u
    levels: tuple[float, ...]  # tried first, from small to large
    put: Callable[[Scenario, float], Scenario]  # the scenario with a level
    none: float = 0.0  # the level without any effect
    # the level that the scenario itself has, where a level replaces it
    own: Callable[[Scenario], float] | None = None
    signed: bool = False  # whether a level is tolerated only if its negative is, too
    # by what the levels are multiplied for a scenario
    size: Callable[[Scenario], float] = lambda base: 1.0
    # of which a level is a multiple; 0: any level
    quantum: Callable[[Scenario], float] = lambda base: 0.0
    # largest level by linear theory, if there is any
    theory: Callable[[Scenario], float | None] = lambda base: None

    def scenarios(self, base: Scenario, level: float) -> list[Scenario]:
        """Return the scenarios that tell whether a level is tolerated."""
        levels = [level, -level] if self.signed else [level]
        scenarios = []
        with warnings.catch_warnings():  # a level is no slip of a unit
            warnings.filterwarnings("ignore", "the true .* times the nominal", ScenarioWarning)
            warnings.filterwarnings("ignore", ".* no command moves it", ScenarioWarning)
            for value in levels:
                scenarios.append(self.put(base, value))
        return scenarios

    def search(self, base: Scenario, resolution: float) -> LevelSearch:
        """Return the search for the margin of a scenario."""
        low = self.own(base) if self.own else self.none
        if quantum := self.quantum(base):

            def rounded(level: float) -> float:
                return max(1, round(level / quantum)) * quantum

            step = QUANTA[resolution] * quantum
            levels = list(map(rounded, self.levels))
            return LevelSearch(levels=levels, resolution=lambda low: step, rounded=rounded, low=low)
        size = self.size(base)
        levels = [size * level for level in self.levels]
        return LevelSearch(
            levels=levels, resolution=lambda low: resolution * max(low, levels[0]), low=low
        )

    def expected(self, base: Scenario) -> float | None:
        """Return the largest level by linear theory; None if there is none for the law, the plant
        or the condition.
        """
        changes = (
            base.disturbance,
            base.friction,
            base.mismatch,
            base.jump,
            base.fault,
            base.sensor,
            base.feedforward,
            not base.clock.regular,
            base.resolved.model != "none",
            base.resolved.reference != REST,
        )
        if any(changes):
            return None  # not in the theory
        try:
            return self.theory(base)
        except ScenarioError:
            return None


def tolerates(trace: Trace) -> bool:
    """Return whether a run did not fail and ended within 5 % of its scale, in every group of its
    channels.
    """
    return trace.failure is None and REST_SHARE.of(trace) <= TOLERATED_ERROR


def _critical_delay(base: Scenario) -> float | None:
    if base.actuator or base.resolved.velocity.name != "measured":
        return None  # not in the theory
    lam_k1 = theory.linear_gains(base.law)
    if lam_k1 is None:
        return None
    return theory.critical_delay(base.plant, *lam_k1, base.control_period)


def _tolerated_force(base: Scenario) -> float | None:
    if not base.force_command:
        return None  # not in the theory
    largest_error = TOLERATED_ERROR * (max(map(abs, base.resolved.x0)) or 1.0)
    return theory.tolerated_force(base.plant, base.law, largest_error, min(base.limits))


def _size_of_force(base: Scenario) -> float:
    """Return the bound on u of a user's own model over that of the study; 1 for other plants."""
    if base.plant.is_user_model:
        return default_u_max(base.plant) / MAX_FORCE
    return 1.0


def _size_of_blow(base: Scenario) -> float:
    """Return F T of the plant's scales: the momentum that the drives stop in the time T."""
    far = np.abs(np.subtract(base.resolved.x0, base.plant.origin)).max()
    scales = search_space.scales(base.plant, min(base.drive_train.forces), float(far))
    return scales["F"] * scales["T"]


def _with_blow(base: Scenario, level: float) -> Scenario:
    blow = Impulse(level, time=base.duration / 2)
    return dataclasses.replace(base, disturbance=(*base.disturbance, blow))


def _with_mass(base: Scenario, level: float) -> Scenario:
    """Return the scenario with `level` times the nominal mass."""
    return dataclasses.replace(base, mismatch=dict(base.mismatch) | {_name_of_mass(base): level})


def _own_mass(base: Scenario) -> float:
    return base.mismatch.get(_name_of_mass(base), 1.0)


def _name_of_mass(base: Scenario) -> str:
    """Return what the mismatch calls the mass: "mass", or by its own name."""
    return base.plant.mass if base.plant.mass in base.mismatch else "mass"


def _with_noise(base: Scenario, level: float) -> Scenario:
    return dataclasses.replace(
        base, noise=Noise(position=level, velocity=VELOCITY_NOISE_RATIO * level)
    )


def _with_force(base: Scenario, level: float) -> Scenario:
    return dataclasses.replace(base, disturbance=(*base.disturbance, Constant(level)))


def _with_missed(base: Scenario, level: float) -> Scenario:
    return dataclasses.replace(base, clock=dataclasses.replace(base.clock, missed=level))


def _with_lost_gain(base: Scenario, level: float) -> Scenario:
    """Return the scenario with a share of gain lost from its start on, by the actuator of its fault
    or by all.
    """
    on = base.fault.on if base.fault else None
    return dataclasses.replace(base, fault=Fault(at=0.0, gain=1.0 - level, on=on))


MARGIN_KINDS: dict[str, MarginKind] = {
    "delay": MarginKind(
        label="input delay",
        unit="s",
        levels=DELAYS,
        put=lambda base, level: dataclasses.replace(base, input_delay=level),
        own=lambda base: base.input_delay,
        quantum=lambda base: base.control_period,
        theory=_critical_delay,
    ),
    "disturbance": MarginKind(
        label="constant disturbance",
        unit="{u}",
        levels=FORCES,
        put=_with_force,
        signed=True,
        size=_size_of_force,
        theory=_tolerated_force,
    ),
    "friction": MarginKind(
        label="dry friction",
        unit="{u}",
        levels=FORCES,
        put=with_friction,
        size=_size_of_force,
        theory=_tolerated_force,
    ),
    "mass": MarginKind(
        label="mass, of the nominal",
        unit="1",
        levels=MASS_RATIOS,
        put=_with_mass,
        none=1.0,
        own=_own_mass,
    ),
    "blow": MarginKind(
        label="blow halfway through the run, on every driven joint",
        unit="{u} s",
        levels=BLOWS,
        put=_with_blow,
        signed=True,
        size=_size_of_blow,
    ),
    "noise": MarginKind(
        label="position noise",
        unit="{x}",
        levels=NOISES,
        put=_with_noise,
        own=lambda base: base.noise.position,
    ),
    "jitter": MarginKind(
        label="largest delay of a sample, of the control period",
        unit="1",
        levels=JITTERS,
        put=with_jitter,
        own=lambda base: base.clock.jitter / base.control_period,
        quantum=lambda base: JITTERS[0],
    ),
    "missed": MarginKind(
        label="share of missed samples",
        unit="1",
        levels=tuple(i / 10 for i in range(1, 10)),
        put=_with_missed,
        own=lambda base: base.clock.missed,
    ),
    "loss": MarginKind(
        label="share of gain that an actuator loses",
        unit="1",
        levels=tuple(i / 10 for i in range(1, 10)),
        put=_with_lost_gain,
    ),
}
# the usual ones, and the default
KINDS = "delay", "disturbance", "friction", "mass", "noise"


# margins of laws on plants


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
            won.pop("", None)
            for law, of_law in won.items():
                places_of.setdefault(law, []).append(Fact("on plant", kinds=of_law, plant=plant))
        failing = dict.fromkeys(margin.law for margin in self if math.isnan(margin.value))
        step = NextStep(
            instead("worst", {}, ("--law", "--gains", "--condition")),
            "searches the worst of many disturbances at once",
        )
        if self.coarse:
            step = NextStep(again({}, without=("--quick",)), "finds them more exactly")
        notes = [Fact("most")] if places_of else []
        if self.gains:
            notes.append(Fact("sentence", label="", text=f"{capital(self.gains)}."))
        facts = [Fact("tolerates", law=law, places=places) for law, places in places_of.items()]
        if failing:
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
                law = Cell(margin.law, colour=style.law_colour(margin.law))
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
        return margins_figure.draw(bars, path, **options)


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
        of_set = sets.law(base.plant, base.law.name, gains, seed)
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


Tried = tuple[int, float | None]  # a cell and its level; None is the unchanged run


class Cells:
    """A search for the boundary of each kind of margin of each scenario."""

    def __init__(
        self, bases: Sequence[Scenario], kinds: Sequence[str], resolution: float, report: Report
    ):
        self.pairs = []  # scenario and kind, the kind varies faster
        for base in bases:
            for kind in kinds:
                self.pairs.append((base, find("kind of margin", kind, MARGIN_KINDS)))
        self.resolution = resolution
        self.report = report
        self.done = 0  # work
        self.searches = [kind.search(base, resolution) for base, kind in self.pairs]

    def begin(self, i: int) -> LevelSearch:
        """Begin the search of a cell again, and return it."""
        base, kind = self.pairs[i]
        self.searches[i] = kind.search(base, self.resolution)
        return self.searches[i]

    @property
    def left(self) -> int:
        """The work that the searches may still need."""
        work = 0
        for (base, kind), search in zip(self.pairs, self.searches, strict=True):
            signs = 2 if kind.signed else 1
            work += search.left * base.work * signs
        return work

    def tolerated(self, tried: Sequence[Tried], runner: Callable) -> list[bool]:
        """Return whether these levels are tolerated."""
        scenarios = []
        owners = []
        for k, (i, level) in enumerate(tried):
            base, kind = self.pairs[i]
            of_level = [base] if level is None else kind.scenarios(base, level)
            scenarios += of_level
            owners += [k] * len(of_level)
        now = sum(scenario.work for scenario in scenarios)
        expected = self.done + max(now, self.left)
        results = [True] * len(tried)
        scores = runner(scenarios, summed(self.report, self.done, expected))
        for k, ((share,), _) in zip(owners, scores, strict=True):
            results[k] &= share <= TOLERATED_ERROR
        self.done += now
        return results

    def ends_by(self, found: Mapping[int, LevelSearch], covers: Callable) -> list[Tried]:
        """Return the ends of the intervals whose runs something covers."""
        ends = []
        for i, search in found.items():
            base, kind = self.pairs[i]
            for level in (search.low, search.high):
                inside = kind.none < level < math.inf
                if inside and covers(kind.scenarios(base, level)[0]):
                    ends.append((i, level))
        return ends


class OverSets:
    """The least and the largest margin of each cell over several sets of gains.

    `cells` have been searched with the first set, `siblings` are the runs of each scenario with the
    others.
    """

    def __init__(
        self,
        cells: Cells,
        siblings: Sequence[Sequence[Scenario]],
        kinds: int,
        runner: Callable,
    ):
        self.cells = cells
        self.siblings = siblings
        self.kinds = kinds  # of each scenario
        self.runner = runner

    def ranges(self, cells: Iterable[int]) -> dict[int, tuple[float, float]]:
        """Return the range over all sets of each of these cells that has several."""
        with_sets = [i for i in cells if self.siblings[i // self.kinds]]
        ends: dict[tuple[int, str], float | None] = {}
        for i in with_sets:
            search = self.cells.searches[i]
            ends |= {(i, "none"): None, (i, "low"): search.low}
            if search.high < math.inf:
                ends[i, "high"] = search.high
        everyone = {key: range(len(self.siblings[key[0] // self.kinds])) for key in ends}
        holding = self.held(ends, everyone)
        ranges: dict[int, list[float]] = {}
        groups: dict[tuple[int, str], list[int]] = {}  # sets that hold less, or more
        for i in with_sets:
            value = self.cells.searches[i].low
            steady = bool(holding[i, "none"].all())
            ranges[i] = [value if steady else math.nan, value]
            if steady and not holding[i, "low"].all():
                groups[i, "less"] = np.flatnonzero(~holding[i, "low"]).tolist()
            if (i, "high") in holding and holding[i, "high"].any():
                groups[i, "more"] = np.flatnonzero(holding[i, "high"]).tolist()
        searches = {}
        for i, side in groups:
            own = self.cells.searches[i]
            base, kind = self.cells.pairs[i]
            begin = {"high": own.low} if side == "less" else {"low": own.high}
            fresh = kind.search(base, self.cells.resolution)
            searches[i, side] = dataclasses.replace(fresh, **begin)

        def tolerated(tried: list[tuple[tuple[int, str], float]]) -> list[bool]:
            held = self.held(dict(tried), groups)
            results = []
            for key, _ in tried:
                more = key[1] == "more"
                results.append(bool(held[key].any() if more else held[key].all()))
                # only those that hold least, or most, are searched further
                ahead = np.array(groups[key])[held[key] == more].tolist()
                groups[key] = ahead or groups[key]
            return results

        find_boundaries(searches, tolerated)
        for (i, side), search in searches.items():
            ranges[i][side == "more"] = search.low
        return {i: (low, high) for i, (low, high) in ranges.items()}

    def held(
        self,
        levels: Mapping[tuple[int, str], float | None],
        numbers: Mapping[tuple[int, str], Sequence[int]],
    ) -> dict[tuple[int, str], np.ndarray]:
        """Return (cell, word) -> whether the sets of these numbers tolerate its level."""
        scenarios = []
        owners = []
        results = {}
        for key, level in levels.items():
            _, kind = self.cells.pairs[key[0]]
            results[key] = np.ones(len(numbers[key]), bool)
            for place, k in enumerate(numbers[key]):
                base = self.siblings[key[0] // self.kinds][k]
                of_level = [base] if level is None else kind.scenarios(base, level)
                scenarios += of_level
                owners += [(key, place)] * len(of_level)
        scores = self.runner(scenarios, lambda work: None)
        for (key, place), ((share,), _) in zip(owners, scores, strict=True):
            results[key][place] &= share <= TOLERATED_ERROR
        return results
