"""What breaks a law: how much of a score's spread each uncertainty explains, and where runs fail.

    found = smc.sensitivity(scenario, within=smc.Uncertainty(delay=(0.0, 0.02), mass=(0.7, 1.3)))

The uncertainties vary together, each uniformly within its bounds. An axis's first-order index is
the share of the score's variance that the axis alone explains. Its total index also counts what it
does together with others, so it is 0 only for an axis that changes nothing. First-order indices add
up to at most 1, total ones to at least 1, and so do their estimates
(`robustness.sobol.estimates`, `possible`; design by A. Saltelli et al., Computer Physics
Communications 181:259, 2010). The variance is that of the score's logarithm if all scores are
positive, because scores are compared by their ratio. What chance decides, such as the realisation
of noise, is an axis, too, so that it is not taken for the work of another. Intervals are bootstraps
over the sampled points.

A region where runs fail has a bound on one or two axes, or two on one axis. Half of the runs choose
it, and the other half, which are independent, give its rate. The axis to narrow is chosen, and its
median found, in the same way.
"""

import dataclasses
import math
import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np

from smc_mujoco.analysis.bootstrap import Interval, share_interval
from smc_mujoco.analysis.engine import Device
from smc_mujoco.analysis.engine.scored_runs import ScoredRuns, worth_compiling
from smc_mujoco.answers.answer import Answer
from smc_mujoco.answers.answers import lines_of
from smc_mujoco.answers.command import again
from smc_mujoco.answers.facts import Fact, NextStep, Screen, Settles, Span
from smc_mujoco.common.aliases import Array, ArrayPair, Fields
from smc_mujoco.common.constraints import Progress, Seed, Whole, constrained
from smc_mujoco.common.data import attributes
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.progress import bar
from smc_mujoco.common.tabular import Cell, Tabular
from smc_mujoco.common.text import joined
from smc_mujoco.draw import shared_axes
from smc_mujoco.metrics.catalogue import CATALOGUE, metric_of
from smc_mujoco.metrics.conventions import Metric, by_group
from smc_mujoco.robustness.margin_kinds import REST_SHARE, TOLERATED_ERROR
from smc_mujoco.robustness.sobol import (
    CHANCE,
    Axis,
    Cut,
    Improvement,
    SobolResult,
    Space,
    designs,
    improvement,
    in_words,
    indices,
    regions,
)
from smc_mujoco.robustness.uncertainty import Uncertainty, strength
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure

METRIC = "rms_error"
# physics steps by default, for a plant of one channel: up to 20 s of a core
DEFAULT_STEPS = 3_600_000
STEPS_BESIDE = 600  # that take as long as to make a run and to score it
MIN_POINTS = 8  # of the default, a power of 2
AT_ONCE = 4096  # scenarios in memory at once; chosen
# with fewer, intervals of indices may cover less than 90 %, see docs/worst_case.md
ROUGH_POINTS = 32
MASS, PERIOD, BOUND = (0.7, 1.3), (1.0, 4.0), (0.5, 1.0)  # factors of the default class: chosen
# of the default class: control periods, rad or m; chosen
DELAY_PERIODS = 20.0
NOISE = 1e-3
COUNTS = (2.0**11, 2.0**15)
FRICTION_SHARE = 1 / 20  # of the force of the weakest drive: of the default class, chosen
KEY = (
    "Alone: first-order index. With others: total index, 0 if the axis changes nothing. Below: 95 "
    "% intervals."
)
HEADINGS = "axis", "from", "to", "alone", "with others", "more is"


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Sensitivity(Answer, SobolResult):
    """What explains a law's score over a class of uncertainty, and where its runs fail."""

    within: Uncertainty
    improvement: Improvement | None  # None if no half of an axis is better
    runs: int  # number of all runs

    @property
    def screen(self) -> Screen:
        """The answer: what explains the score, where runs fail, and what to narrow first."""
        rows = []
        for axis in self.axes:
            rows.append((in_words(axis.name), _percent(axis.total).text, _trend(axis)))
        headings = "", "explains, with others (%)", "more of it is"
        first = self.leading
        finer = NextStep(again({"--points": f"{2 * len(self.values)}"}), "narrows the intervals")
        about = {"law": self.scenario.law.name, "plant": self.scenario.plant.name}
        if first:
            about |= {"axis": in_words(first.name), "share": _ends(first.total)}
        return Screen(
            heading=Fact("explains", **about, metric=self.label),
            tables=[Tabular(headings=headings, rows=rows)],
            facts=self._facts,
            next=finer,
            word="sensitivity",
        )

    @property
    def leading(self) -> Axis | None:
        """The axis that explains most; None if the intervals do not tell."""
        if not self._differs:
            return None
        first, *further = self.axes
        apart = all(axis.total.high <= first.total.low for axis in further)
        return first if apart else None

    @property
    def label(self) -> str:
        """The metric's name in texts."""
        return CATALOGUE[self.metric].label

    def text(self, value: float) -> str:
        """Return a score with its unit."""
        return f"{CATALOGUE[self.metric].text(value)} {self.unit}".strip()

    @property
    def _facts(self) -> list[Fact]:
        """The spread of the score, how many runs fail, and what to narrow first."""
        low, high = np.quantile(self.values, [0.05, 0.95])
        runs = len(self.failed)
        ends = {"low": self.text(low), "high": self.text(high), "unscored": self.unscored or None}
        rate = _rate(share_interval(float(self.failed.mean()), runs))
        facts = [Fact("spread", metric=self.label, runs=runs, **ends), Fact("fail", **rate)]
        if half := self.improvement:
            narrow = Fact(
                "narrow",
                half=_words(self.space, [half.half]),
                median=self.text(half.median),
                before=self.text(half.before),
                fail=half.failed if half.failed_before else None,
                failed=half.failed_before,
            )
            facts.append(narrow)
        return facts

    @property
    def sentences(self) -> list[str]:
        """The evidence: the spread, what explains it, where runs fail, and what to narrow."""
        leading = self.leading
        about = {"open": self._differs}
        if leading:
            of_axis = {"median": leading.total.median, "share": _ends(leading.total)}
            about = {"axis": in_words(leading.name), **of_axis}
        facts = [Fact("first", **about), *self._facts]
        for region in self.regions:
            where = _words(self.space, region.cuts)
            outside = Fact("fail", **_rate(region.outside))
            facts.append(Fact("fail where", where=where, outside=outside, **_rate(region.rate)))
        facts.append(Fact("fail anywhere", fails=bool(self.failed.any()) and not self.regions))
        facts.append(Fact("sentence", label="", text=self.checked))
        return [": ".join(filter(None, line)) for line in lines_of(facts)]

    @property
    def _differs(self) -> bool:
        """Whether there are scores that an axis may explain."""
        return bool(self.axes and np.ptp(self.values) and 2 * self.unscored <= len(self.values))

    @property
    def tables(self) -> list[Tabular]:
        """One table: the range of each axis, its indices in percent, and whether more of it is
        better or worse.
        """
        rows = []
        for axis in self.axes:
            ends = ["–", "–"]
            if axis.name != CHANCE:
                ends = [_with_unit(axis.low, axis.unit), _with_unit(axis.high, axis.unit)]
            shares = _percent(axis.first), _percent(axis.total)
            rows.append([in_words(axis.name), *ends, *shares, _trend(axis)])
        where = f"{self.scenario.law.name} on {self.scenario.plant.name}"
        title = f"{where}: shares of the variance of {self.label}, %"
        runs = f"{self.runs} runs, {len(self.values)} of them independent"
        notes = [*self.sentences, KEY, f"{runs}, gains: {self.scenario.law.source}"]
        if len(self.values) < 2 * ROUGH_POINTS:
            notes.insert(0, f"Fewer than {ROUGH_POINTS} points: intervals are rough, give more.")
        return [Tabular(headings=HEADINGS, rows=rows, title=title, notes=notes)]

    def about(self) -> dict[str, Any]:
        """Return the result as JSON data."""
        axes = []
        for axis in self.axes:
            indices = {"first": axis.first._asdict(), "total": axis.total._asdict()}
            axes.append(axis._asdict() | indices)
        samples = {}
        for i, name in enumerate(self.space.names):
            samples[name] = self.space.column(i, self.shares).tolist()
        return attributes(self, ("metric", "unit", "runs")) | {
            "within": dataclasses.asdict(self.within),
            "says": self.sentences,
            "axes": axes,
            "samples": samples,
            "values": self.values.tolist(),
            "failed": self.failed.tolist(),
        }

    def figure(self, path: str | os.PathLike | None = None, **options: Any) -> "Figure":
        """Draw the indices, and the runs over the two axes that tell most; arguments as in
        `smc.figure`.
        """
        from smc_mujoco.robustness.sensitivity_figure import draw_sensitivity

        return draw_sensitivity(self, path, **options)

    plot = figure


def _trend(axis: Axis) -> str:
    """Return whether more of an axis makes a score worse or better; "–" if neither."""
    if axis.name == CHANCE or abs(axis.direction) < 0.1:
        return "–"
    return "worse" if axis.direction > 0.0 else "better"


@constrained
def sensitivity(
    scenario: Scenario,
    within: Uncertainty | None = None,
    metric: str = METRIC,
    points: Annotated[int, Whole(low=8, high=2**16)] | None = None,
    seed: Seed = 0,
    threads: int | None = None,
    progress: Progress = False,
    device: Device = "cpu",
) -> Sensitivity:
    """Find which uncertainties explain a law's score, and where its runs fail.

        scenario = smc.Scenario(plant="duffing", law="pid", duration=1.0)
        within = smc.Uncertainty(mass=(0.8, 1.2), delay=(0.0, 2e-3))
        print(smc.sensitivity(scenario, within, points=8))

    MuJoCo makes the runs, or the fast engine if there are very many. MuJoCo then repeats 20.

    Args:
      scenario: plant, law and conditions. The class adds to its disturbances, noise, delay and
        parameters.
      within: the class. Its disturbance and its errors of measurement are axes with a level from 0
        to the bound, and random within it. Default: mass, friction, delay, noise, encoder, period
        and bound, see `default_class`.
      metric: name of any metric; more is worse. A run without a score counts as the worst.
      points: number of points, a power of 2; with k axes there are (k + 2) times as many runs.
        Default: as many as take up to about 20 s of one core, but at least 8, with which the Panda
        takes 25 s. A result of fewer than 32 says so.
      seed: of the points.
      threads, progress: as in `run`. The result does not depend on threads.
      device: of the fast engine, "cpu", or "cuda" for any number of runs.

    Returns:
      A `Sensitivity`: indices by axis, the share of failures, and where they are. It prints as
      sentences; `tables` has the indices.

    Raises:
      ScenarioError: a class that the plant cannot have, an unknown metric, points that are no power
        of 2, or no run with a score.
    """
    if not isinstance(scenario, Scenario):
        raise ScenarioError(
            f"sensitivity is of a Scenario, not {shown(scenario)}: give smc.Scenario(...)"
        )
    within = _checked_class(within, scenario)
    entry = metric_of(scenario, metric)
    space = Space(scenario, within)
    points = _checked_points(points, space)
    design = designs(points, len(space.names), seed)
    work = len(design) * scenario.work
    formulas = {metric: lambda trace: _score(trace, metric), REST_SHARE.name: REST_SHARE.of}
    fast = ScoredRuns(formulas, device, threads, worth_compiling(work), by_group=True, worlds=True)
    words = f"sensitivity of {scenario.law.name} on {scenario.plant.name}"
    with bar(words, work, shown=progress) as drawn:
        scores, held = _run(space, design, fast, drawn.advance)
    runs = _of_design(design, scores, held, metric, fast.broken.get(scenario.law.name, ""))
    return _explained(entry, space, runs, points, seed, fast.checked())


class DesignRuns(NamedTuple):
    """The runs of Saltelli's design, A and B before the others."""

    design: Array  # (N, axes), shares of the axes
    scores: Array  # (N,), of a run without one the worst of the others
    unscored: Array  # (N,) bool
    failed: Array  # (N,) bool, whether it fails or ends beyond 5 % of its scale


def _checked_class(within: object, scenario: Scenario) -> Uncertainty:
    """Return the class, by default `default_class`."""
    if within is None:
        return default_class(scenario)
    if not isinstance(within, Uncertainty):
        raise ScenarioError(
            f"within is {shown(within)}: give a class, such as smc.Uncertainty(delay=(0.0, 0.02))"
        )
    return within


def _checked_points(points: int | None, space: Space) -> int:
    """Return the number of points, by default `default_points`. Raise ScenarioError if it is no
    power of 2.
    """
    if points is None:
        axes = len(space.names)
        points = default_points(space.scenario_at(np.full(axes, 0.5)), axes)
    if points & (points - 1):
        raise ScenarioError(
            f"points is {points}: give a power of 2, such as {1 << points.bit_length() - 1}"
        )
    return points


def _run(
    space: Space, design: Array, fast: ScoredRuns, advance: Callable[[int], None]
) -> ArrayPair:
    """Return the score of each run of a design, inf of one that failed, and whether it ends within
    5 % of its scale, (N,) each.
    """
    scores = np.empty(len(design))
    held = np.empty(len(design), bool)
    for first in range(0, len(design), AT_ONCE):
        cases = list(map(space.scenario_at, design[first : first + AT_ONCE]))
        for i, (of_run, failed) in enumerate(fast.scored(cases, advance), first):
            scores[i] = math.inf if failed is not None else of_run[0]
            held[i] = failed is None and of_run[-1] <= TOLERATED_ERROR
    return scores, held


def _of_design(design: Array, scores: Array, held: Array, metric: str, broken: str) -> DesignRuns:
    """Return the runs of a design. Raise ScenarioError if none has a score; `broken` says how the
    law failed, or is "".
    """
    unscored = ~np.isfinite(scores)
    if unscored.all():
        cure = "give longer runs, another metric or a narrower class"
        if broken:
            cure = f"{broken}: correct the law"
        raise ScenarioError(f"no run of {len(scores)} has a {metric}: {cure}")
    ranked = np.where(unscored, scores[~unscored].max(), scores)
    return DesignRuns(design, ranked, unscored, ~held)


def _explained(
    entry: Metric, space: Space, runs: DesignRuns, points: int, seed: int, checked: str
) -> Sensitivity:
    """Return what explains the scores of runs, and where they fail."""
    scenario = space.members.scenario
    halves = slice(0, 2 * points)  # A, which chooses, then B, which tells
    shares = runs.design[halves]
    values = runs.scores[halves]
    failed = runs.failed[halves]
    axes = indices(space, runs.scores, points, shares, values, seed)
    return Sensitivity(
        scenario=scenario,
        within=space.members.within,
        metric=entry.name,
        unit=entry.unit_for(scenario.plant.units[0], scenario.efforts[0]),
        axes=tuple(sorted(axes, key=lambda axis: -axis.total.median)),
        space=space,
        shares=shares,
        values=values,
        failed=failed,
        unscored=int(runs.unscored[halves].sum()),
        regions=tuple(regions(space, shares, failed)),
        improvement=improvement(space, shares, values, failed),
        runs=len(runs.design),
        checked=checked,
    )


def default_class(scenario: Scenario) -> Uncertainty:
    """Return the default class: what the plant declares as `uncertain`, or its mass, and what
    machines differ in.

    Mass x .7 to 1.3, dry friction up to a twentieth of the force of the weakest drive, delay up to
    20 control periods, noise up to 1 mrad or mm at each sample, encoders of 2^11 to 2^15 counts,
    u_max x .5 to 1, control period x 1 to 4. A free body has no friction and no encoder.
    """
    plant = scenario.plant
    u = strength(scenario)
    flies = bool(scenario.plant.pose)
    return Uncertainty(
        mass=MASS if plant.mass and not plant.uncertain else (1.0, 1.0),
        parameters=plant.uncertain,
        friction=(0.0, FRICTION_SHARE * u) if math.isfinite(u) and not flies else (0.0, 0.0),
        delay=(0.0, min(DELAY_PERIODS, scenario.samples // 10) * scenario.control_period),
        position_noise=NOISE * (not any(scenario.noise.errors)),
        hold=scenario.control_period,
        encoder=None if flies else COUNTS,
        bound=BOUND if math.isfinite(u) else (1.0, 1.0),
        period=(1.0, 1.0) if hasattr(scenario.law.function, "control_period") else PERIOD,
    )


def default_points(scenario: Scenario, axes: int) -> int:
    """Return the number of points, a power of 2, for which runs like this one take about 20 s of
    one core.
    """
    dry = 1 + bool(scenario.friction and not scenario.exact_friction)
    a_run = STEPS_BESIDE + scenario.samples * scenario.steps * (1 + scenario.plant.n) / 2 * dry
    most = DEFAULT_STEPS / (a_run * (axes + 2))
    return max(MIN_POINTS, 2 ** math.floor(math.log2(max(most, 1.0))))


def _score(trace: Trace, metric: str) -> float:
    """Return the score of a run that did not fail, the worst of its groups of channels; NaN or inf
    without one.
    """
    entry = CATALOGUE[metric]
    value = entry.worst(by_group(trace))
    return entry.absent if math.isnan(value) else value


def _rate(rate: Interval) -> Fields:
    """Return how many of some runs fail, and the interval of their share."""
    return {"runs": Settles(round(rate.median * rate.n), rate.n), "share": _ends(rate)}


def _ends(share: Interval) -> Span:
    """Return the ends of an interval."""
    return Span(share.low, share.high)


def _words(space: Space, cuts: Sequence[Cut]) -> str:
    """Return cuts as words, such as "delay > 9 ms and mass < 0.8 of nominal", "mass < 0.8 of
    nominal or > 1.2 of nominal".
    """
    words = []
    for cut in cuts:
        unit = space.ends[cut.axis][2]
        low = _with_unit(space.value(cut.axis, cut.low), unit)
        high = _with_unit(space.value(cut.axis, cut.high), unit)
        if cut.outside:
            bounds = f"< {low} or > {high}"
        elif cut.low == 0.0:
            bounds = f"< {high}"
        elif cut.high == 1.0:
            bounds = f"> {low}"
        else:
            bounds = f"{low} to {high}"
        words.append(f"{in_words(space.names[cut.axis])} {bounds}")
    return joined(words)


def _with_unit(value: float, unit: str) -> str:
    """Return a value of an axis as text, such as "9 ms" or "0.8 of nominal"."""
    if not unit:
        return f"{value:.3g} of nominal"
    if unit == "%":
        return f"{100 * value:+.3g} %"
    if unit == "added":
        return f"+{value:.3g}"
    if unit in ("counts", "periods"):
        return f"{value:.5g} {unit}"
    factor, prefixed = shared_axes.prefixed(value, unit)
    return f"{factor * value:.3g} {prefixed}"


def _percent(share: Interval) -> Cell:
    return Cell(f"{100 * share.median:.0f}", f"{100 * share.low:.0f}–{100 * share.high:.0f}")
