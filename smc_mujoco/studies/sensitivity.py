"""What breaks a law: how much of a score's spread each uncertainty explains, and where runs fail.

    found = smc.sensitivity(scenario, over=smc.Uncertainty(delay=(0.0, 0.02), mass=(0.7, 1.3)))

The uncertainties vary together, each uniformly within its bounds. An axis's first-order index is the share of the
score's variance that the axis alone explains. Its total index also counts what it does together with others, so it is
0 only for an axis that changes nothing (A. Saltelli et al., Computer Physics Communications 181:259, 2010;
scipy.stats.sobol_indices). The variance is that of the score's logarithm if all scores are positive, because scores are
compared by their ratio. What chance decides, such as the realisation of noise, is an axis, too, so that it is not taken
for the work of another. Intervals are bootstraps over the sampled points.

A region where runs fail has bounds on at most two axes. Half of the runs choose it, and the other half, which are
independent, give its rate. The axis to improve is chosen and told in the same way.
"""

import dataclasses
import itertools
import math
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np

from smc_mujoco.analysis.bootstrap import LEVEL, Interval, share_interval
from smc_mujoco.analysis.margins import tolerates
from smc_mujoco.analysis.worst_case.uncertainty import Constant, Member, Members, Uncertainty, strength
from smc_mujoco.common.constraints import MAX_SEED, Seed, Whole, constrained
from smc_mujoco.common.errors import ScenarioError, find, shown
from smc_mujoco.common.progress import bar
from smc_mujoco.common.tabular import Cell, Tables, Tabular
from smc_mujoco.common.text import joined
from smc_mujoco.draw import style
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.metrics.conventions import by_group
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace, warn_of_broken

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure

METRIC = "rms_error"
DEFAULT_STEPS = 3_600_000  # physics steps by default, for a plant of one channel: up to 20 s of a core
MIN_POINTS, MAX_POINTS = 16, 4096  # of the default, powers of 2
RESAMPLES = 499  # of a bootstrap: chosen
CHANCE = "chance"  # the axis of what is drawn in a run
MASS, PERIOD, BOUND = (0.7, 1.3), (1.0, 4.0), (0.5, 1.0)  # factors of the default class: chosen
DELAY_PERIODS, NOISE, COUNTS = 20.0, 1e-3, (2.0**11, 2.0**15)  # of the default class: control periods, rad or m; chosen
FRICTION_SHARE = 1 / 20  # of the force of the weakest drive: of the default class, chosen
CUTS = tuple(i / 8 for i in range(1, 8))  # shares of an axis at which a region may end: chosen
MIN_REGION_RUNS = 8  # in a region: fewer tell no rate; chosen
MAX_REGIONS = 3
BETTER_SHARE = 0.5  # of an axis, to which it may be narrowed: chosen
HEADINGS = "axis", "from", "to", "alone", "with others", "more is"
WORDS = {"bound": "u_max", "period": "control period"}


class Axis(NamedTuple):
    """One uncertainty, and how much of the score's variance it explains."""

    name: str
    low: float
    high: float
    unit: str  # of low and high; "" for a factor or a number
    first: Interval  # first-order index, the axis alone, with its 95 % interval
    total: Interval  # total index, with others
    direction: float  # Spearman's rank correlation of the score with the axis; NaN for chance


class Cut(NamedTuple):
    """A bound on one axis."""

    axis: int  # index
    above: bool  # whether values above the bound are within, or those below it
    share: float  # of the axis's range at which it lies


class Region(NamedTuple):
    """Where runs fail: within cuts, and how often there and outside, in runs that did not choose the cuts."""

    cuts: tuple[Cut, ...]
    words: str  # such as "delay > 9 ms and mass < 0.8"
    rate: Interval  # of failures within, Wilson's interval, with the number of runs
    outside: Interval  # of failures outside of all regions so far


class Improvement(NamedTuple):
    """The axis whose narrowing to one half improves the score most, in runs that did not choose it."""

    words: str  # such as "delay below 10 ms"
    median: float  # of the score within that half
    before: float  # median of the score over the whole range


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Sensitivity(Tables):
    """What explains a law's score over a class of uncertainty, and where its runs fail."""

    scenario: Scenario
    over: Uncertainty
    metric: str  # its name
    unit: str  # of the score
    axes: tuple[Axis, ...]  # the largest total index first
    space: "Space"  # what the columns of `shares` mean
    shares: np.ndarray  # (N, axes), where in each axis's range an independent run lies
    values: np.ndarray  # (N,), its score; a run without one has the worst of the others
    failed: np.ndarray  # (N,) bool, whether it fails or ends beyond 5 % of its scale
    regions: tuple[Region, ...]
    improvement: Improvement | None  # None if no half of an axis is better
    runs: int  # number of all runs

    def __repr__(self) -> str:
        return f"Sensitivity({self})"

    def __str__(self) -> str:
        return f"{self.scenario.law.name} on {self.scenario.plant.name}: {' '.join(self.sentences)}"

    @property
    def sentences(self) -> list[str]:
        """The result in words: what explains the spread, where runs fail, and what to improve."""
        told = [self._culprit, *self._failures, *([self._improvement] if self.improvement else [])]
        return [sentence[0].upper() + sentence[1:] for sentence in told]

    @property
    def label(self) -> str:
        """The metric's name in texts."""
        return CATALOGUE[self.metric].label

    def text(self, value: float) -> str:
        """Return a score with its unit."""
        return f"{CATALOGUE[self.metric].text(value)} {self.unit}".strip()

    @property
    def _culprit(self) -> str:
        low, high = np.quantile(self.values, [0.05, 0.95])
        spread = f"the spread of {self.label} ({self.text(low)} to {self.text(high)} in 90 % of the runs)"
        if not self.axes or not np.ptp(self.values):
            return f"Nothing here changes {self.label}, {self.text(float(self.values[0]))}."
        first, *others = self.axes
        ends = f"{100 * max(0.0, first.total.low):.0f} to {100 * min(1.0, first.total.high):.0f} %"
        rivals = [axis for axis in others if axis.total.high > first.total.low]
        if not rivals:
            share = f"{100 * min(first.total.median, 1.0):.0f} %"
            return f"{in_words(first.name)} explains {share} of {spread}, 95 % interval {ends}."
        named = joined(in_words(axis.name) for axis in (first, *rivals))
        return f"The largest share of {spread} is that of {named}: their intervals overlap, so more points must tell."

    @property
    def _failures(self) -> list[str]:
        count, n = int(self.failed.sum()), len(self.failed)
        if not count:
            return [f"None of {n} runs fails (at most {100 * share_interval(0.0, n).high:.2g} %)."]
        told = [
            f"It fails where {region.words}: {round(region.rate.median * region.rate.n)} of {region.rate.n} runs "
            f"({100 * region.rate.low:.0f} to {100 * region.rate.high:.0f} %)"
            for region in self.regions
        ]
        if not told:
            return [f"{count} of {n} runs fail, in no region that two bounds could tell."]
        rest = self.regions[-1].outside
        return [f"{'; '.join(told)}; elsewhere {round(rest.median * rest.n)} of {rest.n}."]

    @property
    def _improvement(self) -> str:
        its = self.improvement
        assert its is not None
        now, before = self.text(its.median), self.text(its.before)
        return f"Narrow {its.words} first: the median {self.label} is then {now}, not {before}."

    @property
    def tables(self) -> list[Tabular]:
        """One table: the range of each axis, its indices in percent, and whether more of it is better or worse."""
        rows = []
        for axis in self.axes:
            chance = axis.name == CHANCE
            ends = ["–", "–"] if chance else [_valued(axis, end) for end in (axis.low, axis.high)]
            trend = "–" if chance or abs(axis.direction) < 0.1 else ("worse" if axis.direction > 0.0 else "better")
            rows.append([in_words(axis.name), *ends, _percent(axis.first), _percent(axis.total), trend])
        title = f"{self.scenario.law.name} on {self.scenario.plant.name}: shares of the variance of {self.label}, %"
        key = (
            "Alone: first-order index. With others: total index, 0 if the axis changes nothing. Below: 95 % intervals."
        )
        return [Tabular(headings=HEADINGS, rows=rows, title=title, notes=[*self.sentences, key])]

    def about(self) -> dict[str, Any]:
        """Return the result as JSON data."""
        fields = "metric", "unit", "runs"
        data: dict[str, Any] = {name: getattr(self, name) for name in fields}
        data |= {"over": dataclasses.asdict(self.over), "says": self.sentences}
        indices = [{"first": axis.first._asdict(), "total": axis.total._asdict()} for axis in self.axes]
        data["axes"] = [axis._asdict() | its for axis, its in zip(self.axes, indices, strict=True)]
        samples = {name: self.space.column(i, self.shares).tolist() for i, name in enumerate(self.space.names)}
        return data | {"samples": samples, "values": self.values.tolist(), "failed": self.failed.tolist()}

    def figure(self, path: str | os.PathLike | None = None, **options: Any) -> "Figure | SubFigure":
        """Draw the indices, and the runs over the two axes that tell most; arguments as in `smc.figure`."""
        from smc_mujoco.draw.sensitivity import draw

        return draw(self, path, **options)

    plot = figure


@constrained
def sensitivity(
    scenario: Scenario,
    over: Uncertainty | None = None,
    metric: str = METRIC,
    points: Annotated[int, Whole(low=2, high=2**16)] | None = None,
    seed: Seed = 0,
    threads: int | None = None,
    progress: bool = False,
) -> Sensitivity:
    """Find which uncertainties explain a law's score, and where its runs fail.

    Args:
      scenario: plant, law and conditions. The class adds to its disturbances, noise, delay and parameters.
      over: the class. Its disturbance and its errors of measurement are axes with a level from 0 to the bound, and
        random within it. Default: mass, friction, delay, noise, encoder, period and bound, see `default_over`.
      metric: name of any metric; more is worse. A run that fails counts as the worst that did not.
      points: number of points, a power of 2; with k axes there are (k + 2) times as many runs. Default: as many as
        take up to about 20 s of one core.
      seed: of the points.
      threads, progress: as in `run`. The result does not depend on threads.

    Raises:
      ScenarioError: a class that the plant cannot have, an unknown metric, points that are no power of 2, or no run
        with a score.
    """
    if not isinstance(scenario, Scenario):
        raise ScenarioError(f"sensitivity is of a Scenario, not {shown(scenario)}: give smc.Scenario(...)")
    over = default_over(scenario) if over is None else over
    if not isinstance(over, Uncertainty):
        raise ScenarioError(f"over is {shown(over)}: give a class, such as smc.Uncertainty(delay=(0.0, 0.02))")
    entry = find("metric", metric, CATALOGUE)
    if why := entry.refusal(scenario.plant):
        raise ScenarioError(why)
    space = Space(scenario, over)
    k = len(space.names)
    points = default_points(space.scenario_at(np.full(k, 0.5)), k) if points is None else points
    if points & (points - 1):
        raise ScenarioError(f"points is {points}: give a power of 2, such as {1 << points.bit_length() - 1}")
    designs = _designs(points, k, seed)
    scores, held = np.empty(len(designs)), np.empty(len(designs), bool)
    broken = ""
    words = f"sensitivity of {scenario.law.name} on {scenario.plant.name}"
    with bar(words, len(designs) * scenario.work, shown=progress) as drawn:
        for i, trace in stream((space.scenario_at(row) for row in designs), threads, drawn.advance):
            scores[i], held[i] = _score(trace, metric), tolerates(trace)
            broken = broken or (trace.broken if trace.failure is not None else "")
    if broken:
        warn_of_broken({scenario.law.name: broken})
    if not (finite := np.isfinite(scores)).any():
        raise ScenarioError(f"no run of {len(scores)} has a score: give a narrower class, or other gains")
    scores[~finite] = scores[finite].max()
    halves = slice(0, 2 * points)  # A, which chooses, then B, which tells
    shares, values, failed = designs[halves], scores[halves], ~held[halves]
    axes = _indices(space, scores, points, shares, values, seed)
    regions = tuple(_regions(space, shares, failed))
    return Sensitivity(
        scenario=scenario,
        over=over,
        metric=metric,
        unit=entry.unit_for(scenario.plant.units[0], scenario.efforts[0]),
        axes=tuple(sorted(axes, key=lambda axis: -axis.total.median)),
        space=space,
        shares=shares,
        values=values,
        failed=failed,
        regions=regions,
        improvement=_improvement(space, shares, values),
        runs=len(designs),
    )


def default_over(scenario: Scenario) -> Uncertainty:
    """Return the default class: what the plant declares as `uncertain`, or its mass, and what machines differ in.

    Mass x .7 to 1.3, dry friction up to a twentieth of the force of the weakest drive, delay up to 20 control periods,
    noise up to 1 mrad or mm at each sample, encoders of 2^11 to 2^15 counts, u_max x .5 to 1, control period x 1 to 4.
    """
    plant, u = scenario.plant, strength(scenario)
    return Uncertainty(
        mass=MASS if plant.mass and not plant.uncertain else (1.0, 1.0),
        parameters=plant.uncertain,
        friction=(0.0, FRICTION_SHARE * u) if math.isfinite(u) else (0.0, 0.0),
        delay=(0.0, DELAY_PERIODS * scenario.control_period),
        position_noise=NOISE * (not any(scenario.noise.errors)),
        hold=scenario.control_period,
        encoder=COUNTS,
        bound=BOUND if math.isfinite(u) else (1.0, 1.0),
        period=PERIOD,
    )


def default_points(scenario: Scenario, axes: int) -> int:
    """Return the number of points, a power of 2, for which runs like this one take about 20 s of one core."""
    dry = 1 + bool(scenario.friction and not scenario.exact_friction)
    a_run = scenario.samples * scenario.steps * (1 + scenario.plant.n) / 2 * dry
    most = DEFAULT_STEPS / (a_run * (axes + 2))
    return min(max(MIN_POINTS, 2 ** math.floor(math.log2(max(most, 1.0)))), MAX_POINTS)


class Space:
    """The axes of a class around a scenario: its constants, levels of what is drawn, and chance."""

    def __init__(self, scenario: Scenario, over: Uncertainty):
        self.members = members = Members([scenario], over)
        unit = scenario.plant.units[0]
        errors = (over.position_noise, unit) if over.position_noise else (over.velocity_noise, f"{unit}/s")
        levels = [("disturbance", (over.disturbance, scenario.plant.efforts[0]))] * members.forced
        levels += [("noise", errors)] * (members.times > 0)
        self.levels = {name: level for name, (level, _) in levels}
        drawn = bool(levels) or over.jitter > 0.0 or _random(scenario)
        self.columns: tuple[Constant | None, ...] = (*members.constants, *(None for _ in levels), *([None] * drawn))
        self.names = (*(one.name for one in members.constants), *self.levels, *([CHANCE] * drawn))
        ends = [(*one.bounds, one.unit) for one in members.constants] + [(0.0, *level) for _, level in levels]
        self.ends = [*ends, *([(math.nan, math.nan, "")] * drawn)]

    def scenario_at(self, shares: np.ndarray) -> Scenario:
        """Return the scenario at a share of each axis."""
        known = dict(zip(self.names, shares.tolist(), strict=True))
        m, chance = len(self.members.constants), round(known.get(CHANCE, 0.0) * MAX_SEED)
        drawn = self.members.random(np.random.default_rng(chance))
        member = Member(shares[:m], known.get("disturbance", 0.0) * drawn.force, known.get("noise", 0.0) * drawn.noise)
        scenario = self.members.scenario_of(member)
        return dataclasses.replace(scenario, seed=chance) if CHANCE in known else scenario

    def value(self, axis: int, share: float) -> float:
        """Return the value of an axis at a share of its range."""
        low, high, _ = self.ends[axis]
        constant = self.columns[axis]
        return low + share * (high - low) if constant is None else constant.value(share)

    def column(self, axis: int, shares: np.ndarray) -> np.ndarray:
        """Return the values of an axis at points, (N,); for chance the shares."""
        if self.names[axis] == CHANCE:
            return shares[:, axis]
        return np.array([self.value(axis, share) for share in shares[:, axis].tolist()])

    def words(self, cuts: Sequence[Cut]) -> str:
        """Return cuts as words, such as "delay > 9 ms and mass < 0.8"."""
        sides = "<", ">"
        return joined(
            f"{in_words(self.names[cut.axis])} {sides[cut.above]} "
            f"{_with_unit(self.value(cut.axis, cut.share), self.ends[cut.axis][2])}"
            for cut in cuts
        )


def _random(scenario: Scenario) -> bool:
    """Return whether a run depends on the scenario's seed."""
    noise, sensor = scenario.noise, scenario.sensor
    disturbed = any(signal.random for signal in scenario.disturbance)
    return bool(
        noise.position or noise.velocity or (sensor and sensor.dropout) or disturbed or not scenario.clock.regular
    )


def _designs(points: int, k: int, seed: int) -> np.ndarray:
    """Return Saltelli's design, ((k + 2) points, k): A, B, then A with one column of B, for each column."""
    from scipy.stats import qmc

    drawn = qmc.Sobol(2 * k, rng=np.random.default_rng(seed)).random(points)
    a, b = drawn[:, :k], drawn[:, k:]
    mixed = np.repeat(a[None], k, axis=0)
    for i in range(k):
        mixed[i, :, i] = b[:, i]
    return np.concatenate([a, b, *mixed])


def _score(trace: Trace, metric: str) -> float:
    """Return the score of a run, the worst of its groups of channels; NaN or inf without one."""
    if trace.failure is not None:
        return math.inf
    entry = CATALOGUE[metric]
    value = entry.worst(by_group(trace))
    return entry.absent if math.isnan(value) else value


def _indices(
    space: Space, scores: np.ndarray, points: int, shares: np.ndarray, values: np.ndarray, seed: int
) -> list[Axis]:
    """Return each axis with its indices."""
    from scipy.stats import sobol_indices, spearmanr

    k, positive = len(space.names), scores.min() > 0.0
    parts = (np.log(scores) if positive else scores).reshape(-1, points)
    first = total = [Interval(0.0, 0.0, 0.0, points)] * k
    if np.ptp(scores):

        def indices(at: np.ndarray) -> np.ndarray:
            """Return both indices of each axis, (2, k), from some of the points."""
            some = np.stack(
                [parts[:, at]] * 2
            )  # twice, as scipy fails on one axis of one output; a copy, centred in place
            found = sobol_indices(
                func={"f_A": some[:, 0], "f_B": some[:, 1], "f_AB": some[:, 2:].swapaxes(0, 1)}, n=points
            )
            return np.reshape([found.first_order, found.total_order], (2, 2, k))[:, 0]

        draws = np.random.default_rng(seed).integers(points, size=(RESAMPLES, points))
        resampled = np.array([indices(at) for at in draws if np.ptp(parts[:2, at])])
        ends = np.quantile(resampled, [(1 - LEVEL) / 2, (1 + LEVEL) / 2], axis=0)
        whole = np.stack([indices(np.arange(points)), *ends])  # (3, 2, k)
        first, total = ([Interval(*its, points) for its in whole[:, kind].T.tolist()] for kind in (0, 1))
    axes = []
    for i, name in enumerate(space.names):
        ordered = name != CHANCE and np.ptp(values) > 0.0
        rank = float(spearmanr(shares[:, i], values).statistic) if ordered else math.nan
        axes.append(Axis(name, *space.ends[i], first[i], total[i], rank))
    return axes


def _within(cuts: Sequence[Cut], shares: np.ndarray) -> np.ndarray:
    """Return which points lie within all cuts, (N,)."""
    sides = [(shares[:, cut.axis] > cut.share) == cut.above for cut in cuts]
    return np.logical_and.reduce(sides) if sides else np.ones(len(shares), bool)


def _regions(space: Space, shares: np.ndarray, failed: np.ndarray) -> "list[Region]":
    """Return regions where runs fail, chosen by the first half of the points and told by the second."""
    half, regions = len(failed) // 2, []
    left = np.ones(len(failed), bool)  # not in a region yet
    axes = [i for i, name in enumerate(space.names) if name != CHANCE]
    single = [(Cut(i, above, share),) for i in axes for above in (False, True) for share in CUTS]
    pairs = [one + other for one, other in itertools.combinations(single, 2) if one[0].axis != other[0].axis]
    while len(regions) < MAX_REGIONS and failed[:half].any():
        chooses = left[:half]
        sides = {cuts: _within(cuts, shares[:half])[chooses] for cuts in (*single, *pairs)}
        gains = {cuts: _gain(inside, failed[:half][chooses], len(cuts)) for cuts, inside in sides.items()}
        cuts = max(gains, key=gains.__getitem__)
        told = _within(cuts, shares) & left
        told[:half] = False
        if gains[cuts] <= 0.0 or not told.any():
            break
        left &= ~_within(cuts, shares)
        rest = left.copy()
        rest[:half] = False
        regions.append(Region(cuts, space.words(cuts), _rate(failed[told]), _rate(failed[rest])))
    return regions


def _rate(failed: np.ndarray) -> Interval:
    return share_interval(float(failed.mean()) if len(failed) else 0.0, max(1, len(failed)))._replace(n=len(failed))


def _gain(within: np.ndarray, failed: np.ndarray, cuts: int) -> float:
    """Return by how much a region where more fail explains failures, as the gain in log likelihood less BIC's price."""
    n, inside = len(failed), int(within.sum())
    if min(inside, n - inside) < MIN_REGION_RUNS or failed[within].mean() <= failed[~within].mean():
        return 0.0
    parts = [failed[within], failed[~within]]
    return sum(map(_log_likelihood, parts)) - _log_likelihood(failed) - cuts * math.log(n)


def _log_likelihood(failed: np.ndarray) -> float:
    n, k = len(failed), int(failed.sum())
    return sum(count * math.log(count / n) for count in (k, n - k) if count)


def _improvement(space: Space, shares: np.ndarray, values: np.ndarray) -> Improvement | None:
    """Return the half of an axis with the best median, chosen by half of the points and told by the others.

    None if the others do not show that it is better (H. B. Mann & D. R. Whitney's test).
    """
    from scipy.stats import mannwhitneyu

    half = len(values) // 2
    axes = [i for i, name in enumerate(space.names) if name != CHANCE]
    halves = [Cut(i, above, BETTER_SHARE) for i in axes for above in (False, True)]
    if not halves:
        return None
    best = min(halves, key=lambda cut: float(np.median(values[:half][_within([cut], shares[:half])])))
    told, within = values[half:], _within([best], shares[half:])
    if not 0 < within.sum() < len(told):
        return None
    if mannwhitneyu(told[within], told[~within], alternative="less").pvalue > 1 - LEVEL:
        return None
    words = space.words([best]).replace("<", "to below").replace(">", "to above")
    return Improvement(words, float(np.median(told[within])), float(np.median(told)))


def in_words(name: str) -> str:
    """Return the name of an axis as texts have it."""
    return WORDS.get(name, name.replace("_", " "))


def _with_unit(value: float, unit: str) -> str:
    """Return a value of an axis as text, such as "9 ms" or "x 0.8"."""
    if not unit:
        return f"{value:.3g} of nominal"
    if unit == "counts":
        return f"{value:.0f} counts"
    factor, prefixed = style.prefixed(value, unit)
    return f"{factor * value:.3g} {prefixed}"


def _valued(axis: Axis, end: float) -> str:
    return _with_unit(end, axis.unit)


def _percent(its: Interval) -> Cell:
    share, low, high = (100 * min(max(end, 0.0), 1.0) for end in (its.median, its.low, its.high))
    return Cell(f"{share:.0f}", f"{low:.0f}–{high:.0f}")
