"""Sobol indices of a score over a class of uncertainty, the regions where runs fail, and the axis
to improve.

An index is estimated from Saltelli's design: points A and B, which are independent, and for each
axis A with one column of B. Regions and the axis to improve are chosen by the runs at A; their
numbers are those of the runs at B. `smc.sensitivity` describes the whole.
"""

import dataclasses
import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from smc_mujoco.analysis.bootstrap import LEVEL, Interval, share_interval
from smc_mujoco.common.aliases import Array, ArrayPair, Pair
from smc_mujoco.common.constraints import MAX_SEED
from smc_mujoco.robustness.uncertainty import Member, Members, RunConstant, Uncertainty
from smc_mujoco.simulation.scenario import Scenario

RESAMPLES = 499  # of a bootstrap: chosen
CHANCE = "chance"  # the axis of what is drawn in a run
CUTS = tuple(i / 16 for i in range(1, 16))  # shares of an axis at which a region may end: chosen
MIN_REGION_RUNS = 3  # in a region, and outside; chosen
MAX_REGIONS = 3
REGION_ERROR = 0.01  # probability with which runs that fail by chance have a region; chosen
WORDS = {"bound": "u_max", "period": "control period"}


class Axis(NamedTuple):
    """One uncertainty, and how much of the score's variance it explains."""

    name: str
    low: float
    high: float
    unit: str  # of low and high, as that of a `RunConstant`
    first: Interval  # first-order index, the axis alone, with its 95 % interval
    total: Interval  # total index, with others
    direction: float  # Spearman's rank correlation of the score with the axis; NaN for chance


class Cut(NamedTuple):
    """Bounds on one axis, as shares of its range: a lower one, an upper one, or both."""

    axis: int  # index
    low: float = 0.0
    high: float = 1.0
    outside: bool = False  # whether values beyond the bounds are within, or those between them


class Region(NamedTuple):
    """Where runs fail: within cuts, and how often there and outside, in runs that did not choose
    the cuts.
    """

    cuts: tuple[Cut, ...]
    rate: Interval  # of failures within, Wilson's interval, with the number of runs
    outside: Interval  # of failures outside of all regions so far


class Improvement(NamedTuple):
    """The axis whose narrowing to one half, lower, upper or middle, leaves the fewest failures, and
    of these the best median, in runs that did not choose it.
    """

    half: Cut
    median: float  # of the score within that half
    before: float  # median of the score over the whole range
    failed: float  # share of the runs within that half
    failed_before: float  # share over the whole range


class Space:
    """The axes of a class around a scenario: its constants, levels of what is drawn, and chance."""

    def __init__(self, scenario: Scenario, within: Uncertainty):
        self.members = members = Members([scenario], within)
        unit = scenario.plant.units[0]
        self.names: list[str] = []
        self.columns: list[RunConstant | None] = []
        self.ends: list[tuple[float, float, str]] = []

        def add(name: str, low: float, high: float, unit: str, constant: RunConstant | None = None):
            self.names.append(name)
            self.columns.append(constant)
            self.ends.append((low, high, unit))

        for constant in members.constants:
            add(constant.name, *constant.bounds, constant.unit, constant)
        if members.forced:
            forces = dict.fromkeys(scenario.plant.efforts[: scenario.plant.driven])
            add("disturbance", 0.0, within.disturbance, " or ".join(forces))
        if within.position_noise:
            add("noise", 0.0, within.position_noise, unit)
        elif within.velocity_noise:
            add("noise", 0.0, within.velocity_noise, f"{unit}/s")
        levels = len(self.names) > len(members.constants)
        if levels or within.jitter > 0.0 or _random(scenario):
            add(CHANCE, math.nan, math.nan, "")

    def scenario_at(self, shares: Array) -> Scenario:
        """Return the scenario at a share of each axis."""
        share_by_name = dict(zip(self.names, shares.tolist(), strict=True))
        m = len(self.members.constants)
        chance = round(share_by_name.get(CHANCE, 0.0) * MAX_SEED)
        drawn = self.members.random(np.random.default_rng(chance))
        member = Member(
            shares[:m],
            share_by_name.get("disturbance", 0.0) * drawn.force,
            share_by_name.get("noise", 0.0) * drawn.noise,
        )
        scenario = self.members.scenario_of(member)
        if CHANCE in share_by_name:
            return dataclasses.replace(scenario, seed=chance)
        return scenario

    def value(self, axis: int, share: float) -> float:
        """Return the value of an axis at a share of its range."""
        low, high, _ = self.ends[axis]
        constant = self.columns[axis]
        if constant is None:
            return low + share * (high - low)
        return constant.value(share)

    def column(self, axis: int, shares: Array) -> Array:
        """Return the values of an axis at points, (N,); for chance the shares."""
        if self.names[axis] == CHANCE:
            return shares[:, axis]
        values = []
        for share in shares[:, axis].tolist():
            values.append(self.value(axis, share))
        return np.array(values)


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class SobolResult:
    """A score over a class: independent runs, the indices of its axes, and where runs fail."""

    scenario: Scenario
    metric: str  # its name
    unit: str  # of the score
    axes: tuple[Axis, ...]  # the largest total index first
    space: Space  # what the columns of `shares` mean
    shares: Array  # (N, axes), where in each axis's range a run lies
    values: Array  # (N,), its score; a run without one has the worst of the others
    failed: Array  # (N,) bool, whether it fails or ends beyond 5 % of its scale
    unscored: int  # how many of them have no score
    regions: tuple[Region, ...]
    checked: str  # how far the fast engine's scores are from MuJoCo's; "" if MuJoCo made all runs


def _intervals(ends: Array, points: int) -> list[Interval]:
    """Return the interval of each axis from its value, low and high end, (3, axes)."""
    intervals = []
    for estimate, low, high in ends.T.tolist():
        intervals.append(Interval(estimate, low, high, points))
    return intervals


def _random(scenario: Scenario) -> bool:
    """Return whether a run depends on the scenario's seed."""
    noise = scenario.noise
    disturbed = any(signal.random for signal in scenario.disturbance)
    measured = noise.position or noise.velocity or any(s.dropout for s in scenario.sensors)
    return bool(measured or disturbed or not scenario.clock.regular)


def designs(points: int, k: int, seed: int) -> Array:
    """Return Saltelli's design, ((k + 2) points, k):

    A, B, then A with one column of B, for each column.
    """
    from scipy.stats import qmc

    drawn = qmc.Sobol(2 * k, rng=np.random.default_rng(seed)).random(points)
    a = drawn[:, :k]
    b = drawn[:, k:]
    mixed = np.repeat(a[None], k, axis=0)
    for i in range(k):
        mixed[i, :, i] = b[:, i]
    return np.concatenate([a, b, *mixed])


def estimates(f_A: Array, f_B: Array, f_AB: Array) -> ArrayPair:  # scipy's
    """Return the first-order and total indices of outputs, (s, k) each; (s, n) at A and at B, (k,
    s, n) mixed.

    A total index is M. J. W. Jansen's (Computer Physics Communications 117:35, 1999). A first-order
    index is the coefficient of B's outputs in the regression of mixed outputs on those at A and B,
    all of unit variance: a correlation without what the two samples have in common by chance (G.
    Glen & K. Isaacs, Environmental Modelling & Software 37:157, 2012).
    """
    a, b, mixed = map(_standardised, (f_A, f_B, f_AB))
    common = (a * b).mean(-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (mixed * b).mean(-1) - common * (mixed * a).mean(-1)
        alone = slope / (1.0 - common**2)
    gaps = ((f_A - f_AB) ** 2).mean(-1)
    variance = np.var([f_A, f_B], axis=(0, -1))
    total = gaps / (2.0 * variance)
    return np.where(common**2 < 1.0, alone, 0.0).T, total.T


def _standardised(f: Array) -> Array:
    """Return outputs of mean 0 and variance 1; 0 where they do not vary."""
    centred = f - f.mean(-1, keepdims=True)
    deviation = centred.std(-1, keepdims=True)
    return np.divide(centred, deviation, out=np.zeros_like(centred), where=deviation > 0.0)


def possible(first: Array, total: Array) -> Array:
    """Return estimates, (k,) each, moved to where indices can be, as (2, k): 0 <= first <= total <=
    1.

    They are scaled where the first add up to more than 1, or the totals to less.
    """
    total = np.clip(total, 0.0, 1.0)
    total = np.minimum(total / min(total.sum() or 1.0, 1.0), 1.0)
    first = np.clip(first, 0.0, total)
    return np.stack([first / max(first.sum(), 1.0), total])


def indices(
    space: Space, scores: Array, points: int, shares: Array, values: Array, seed: int
) -> list[Axis]:
    """Return each axis with its indices."""
    from scipy.stats import sobol_indices, spearmanr

    k = len(space.names)
    positive = scores.min() > 0.0
    parts = (np.log(scores) if positive else scores).reshape(-1, points)
    first = total = [Interval(0.0, 0.0, 0.0, points)] * k
    if np.ptp(parts[:2]):

        def of(draw: Array) -> Array:
            """Return both indices of each axis, (2, k), from some of the points."""
            # twice: scipy fails on one axis of one output, and centres in place
            drawn = np.stack([parts[:, draw]] * 2)
            f_AB = drawn[:, 2:].swapaxes(0, 1)
            outputs = {"f_A": drawn[:, 0], "f_B": drawn[:, 1], "f_AB": f_AB}
            result = sobol_indices(func=outputs, n=points, method=estimates)  # pyright: ignore[reportArgumentType]
            first_and_total = np.reshape([result.first_order, result.total_order], (2, 2, k))
            return possible(*first_and_total[:, 0])

        draws = np.random.default_rng(seed).integers(points, size=(RESAMPLES, points))
        samples = []
        for draw in draws:
            if np.ptp(parts[:2, draw]):
                samples.append(of(draw))
        resampled = np.array(samples)
        tails = [(1 - LEVEL) / 2, (1 + LEVEL) / 2]
        ends = np.quantile(resampled, tails, axis=0)
        pairs = np.array([of(np.arange(points)), *ends])  # (3, 2, k)
        first = _intervals(pairs[:, 0], points)
        total = _intervals(pairs[:, 1], points)
    axes = []
    for i, name in enumerate(space.names):
        ordered = name != CHANCE and np.ptp(values) > 0.0
        if ordered:
            rank = float(np.asarray(spearmanr(shares[:, i], values))[0])
        else:
            rank = math.nan
        axes.append(Axis(name, *space.ends[i], first[i], total[i], rank))
    return axes


def _within(cuts: Sequence[Cut], shares: Array) -> Array:
    """Return which points lie within all cuts, (N,)."""
    sides = []
    for cut in cuts:
        place = shares[:, cut.axis]
        between = (place > cut.low) & (place <= cut.high)
        sides.append(between != cut.outside)
    if sides:
        return np.logical_and.reduce(sides)
    return np.ones(len(shares), bool)


def regions(space: Space, shares: Array, failed: Array) -> list[Region]:
    """Return regions where runs fail, chosen by the first half of the points, with rates from the
    second.

    A region has a bound on one side of an axis, on two of them, or two bounds on one axis, between
    or beyond which it lies.
    """
    half = len(failed) // 2
    accepted = []
    outside = np.ones(len(failed), bool)  # not in a region yet
    axes = [i for i, name in enumerate(space.names) if name != CHANCE]
    single: list[tuple[Cut, ...]] = []
    double: list[tuple[Cut, ...]] = []
    for i in axes:
        for share in CUTS:
            single += [(Cut(i, low=share),), (Cut(i, high=share),)]
        for low, high in itertools.combinations(CUTS, 2):
            double.append((Cut(i, low, high),))
            double.append((Cut(i, low, high, outside=True),))
    coarse = single[2::4] + single[3::4]  # every other share
    for first, second in itertools.combinations(coarse, 2):
        if first[0].axis != second[0].axis:
            double.append(first + second)
    prices = dict.fromkeys(single, 1) | dict.fromkeys(double, 2)
    while len(accepted) < MAX_REGIONS and failed[:half].any():
        chooses = outside[:half]
        gains = {}
        for cuts, price in prices.items():
            inside = _within(cuts, shares[:half])[chooses]
            gains[cuts] = _gain(inside, failed[:half][chooses], price)
        cuts = max(gains, key=gains.__getitem__)
        tested = _within(cuts, shares) & outside
        tested[:half] = False
        if gains[cuts] <= 0.0 or not _more_fail(failed[half:], tested[half:], outside[half:]):
            break
        outside &= ~_within(cuts, shares)
        rest = outside.copy()
        rest[:half] = False
        accepted.append(Region(cuts, _rate(failed[tested]), _rate(failed[rest])))
    return accepted


def _more_fail(failed: Array, within: Array, left: Array) -> bool:
    """Return whether more runs fail within a region than elsewhere, by R. A. Fisher's exact
    test.
    """
    from scipy.stats import fisher_exact

    counts = []
    for side in (within, left & ~within):
        fail = int((failed & side).sum())
        succeed = int((~failed & side).sum())
        counts.append([fail, succeed])
    return float(np.asarray(fisher_exact(counts, "greater"))[1]) < REGION_ERROR


def _rate(failed: Array) -> Interval:
    return share_interval(
        float(failed.mean()) if len(failed) else 0.0, max(1, len(failed))
    )._replace(n=len(failed))


def _gain(within: Array, failed: Array, bounds: int) -> float:
    """Return how well a region where more fail explains failures: the gain in log likelihood less
    BIC's price.
    """
    n = len(failed)
    inside = int(within.sum())
    few = min(inside, n - inside) < MIN_REGION_RUNS
    if few or failed[within].mean() <= failed[~within].mean():
        return 0.0
    parts = [failed[within], failed[~within]]
    return sum(map(_log_likelihood, parts)) - _log_likelihood(failed) - bounds * math.log(n)


def _log_likelihood(failed: Array) -> float:
    n = len(failed)
    k = int(failed.sum())
    return sum(count * math.log(count / n) for count in (k, n - k) if count)


def improvement(space: Space, shares: Array, values: Array, failed: Array) -> Improvement | None:
    """Return the half of an axis with the fewest failures and then the best median, chosen by half
    of the points, with numbers from the others.

    None if the others do not show that more runs fail beyond it, or that the score is better within
    (H. B. Mann & D. R. Whitney's test).
    """
    from scipy.stats import mannwhitneyu

    half = len(values) // 2
    halves = []
    for i, name in enumerate(space.names):
        if name != CHANCE:
            halves_of_axis = (Cut(i, high=0.5), Cut(i, low=0.5), Cut(i, 0.25, 0.75))
            for cut in halves_of_axis:
                if _within([cut], shares[:half]).any():
                    halves.append(cut)

    def rank(cut: Cut) -> Pair:
        inside = _within([cut], shares[:half])
        share = float(failed[:half][inside].mean())
        median = float(np.median(values[:half][inside]))
        return share, median

    if not halves:
        return None
    best = min(halves, key=rank)
    scores = values[half:]
    fails = failed[half:]
    within = _within([best], shares[half:])
    if not 0 < within.sum() < len(scores):
        return None
    if not _more_fail(fails, ~within, np.ones(len(scores), bool)):
        better = mannwhitneyu(scores[within], scores[~within], alternative="less").pvalue
        if better > 1 - LEVEL or fails[within].mean() > fails.mean():
            return None
    return Improvement(
        best,
        float(np.median(scores[within])),
        float(np.median(scores)),
        float(fails[within].mean()),
        float(fails.mean()),
    )


def in_words(name: str) -> str:
    """Return the name of an axis as texts have it."""
    return WORDS.get(name, name.replace("_", " "))
