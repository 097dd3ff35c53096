"""The search of identification: starts over decades, and damped Gauss-Newton steps from the best.

Quantities that cannot be negative, such as masses and frictions, differ between machines by powers
of ten. So further starts are drawn evenly in their logarithms, and no step changes such a quantity
by more than a factor of ten.
"""

import dataclasses
import itertools

import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.identification.least_squares import least_squares
from smc_mujoco.identification.replays import Point, Replays, Slopes, cost
from smc_mujoco.identification.standard_errors import jackknife

START_DECADES = 2.0  # by which a quantity of a further start may differ from the rig's own; chosen
CANDIDATES = 8  # further starts that are drawn for each one that is refined; chosen
DAMPINGS = 0.0, 1e-2, 1.0, 1e3  # of steps that are tried at once, relative to the curvature; chosen
# of its linear move by which a piece's starting state is moved in trials; chosen
SHARES = 0.3, 1.0
TRIALS = len(DAMPINGS) * (len(SHARES) + 1)  # points that a step tries
# scales of a state at the start, by which it may differ from the measured one; chosen
MAX_STATE = 100.0
# scales of velocity by which starts differ from which a piece's own is fitted; chosen
KICKS = 0.0, -4.0, 4.0
MAX_FACTOR = 10.0  # by which a step may change a quantity that cannot be negative; chosen
NEGLIGIBLE_VALUE = 1e-4  # of its scale: below it such a quantity may become 0; chosen
COST_TOLERANCE = 1e-5  # relative change of the cost at which the search ends; chosen
ROUGH_STEPS = 8  # steps from each start before the best is chosen; chosen
CORRECTED_STEPS = 3  # steps after the first halving of the physics step; chosen
MAX_HALVINGS = 5  # of the physics step in corrected replays; chosen
NEGLIGIBLE_MOVE = 0.5  # of a standard error, by which a halving may move a quantity; chosen
GOOD_FIT = 97.0  # percent: fit of the pieces beyond which a start needs no rival; chosen


def search(replays: Replays, starts: int, seed: int, most: int) -> Slopes:
    """Return the slopes at the least squares near the best of several starts, the rig's own values
    first.

    Further starts, of which the random ones have a `seed`, are only tried while none fits well.
    `most`: largest number of steps from the best start.
    """
    reached = [refine(replays, replays.start, min(most, ROUGH_STEPS))]
    if reached[-1].fit < GOOD_FIT and starts > 1:
        for point in _random(replays, starts - 1, seed):
            reached.append(refine(replays, point, min(most, ROUGH_STEPS)))
            if reached[-1].fit > GOOD_FIT:
                break
    return refine(replays, min(reached, key=lambda slopes: slopes.cost).point, most)


def _random(replays: Replays, count: int, seed: int) -> list[Point]:
    """Return the best `count` of many random points, best first."""
    rng = np.random.default_rng(seed)
    start = replays.start
    magnitudes = np.maximum(np.abs(start.values), 1.0)
    drawn = []
    for _ in range(CANDIDATES * count):
        factors = 10.0 ** rng.uniform(-START_DECADES, START_DECADES, len(magnitudes))
        either = rng.choice((-1.0, 1.0), len(magnitudes))
        signs = np.where(replays.low < 0.0, either, 1.0)
        drawn.append(
            Point(np.clip(signs * factors * magnitudes, replays.low, replays.high), start.states)
        )
    costs = replays.costs(drawn).sum(axis=1)
    return [drawn[i] for i in np.argsort(costs, kind="stable")[:count]]


def better(replays: Replays, *points: Point) -> Point:
    """Return the point of least cost, the first one if several are equal."""
    return points[replays.costs(points).sum(axis=1).argmin()]


def extrapolated(replays: Replays, slopes: Slopes) -> tuple[Slopes, list[Array]]:
    """Return the solution near slopes for replays whose steps are extrapolated to 0, and about how
    far that is off in the residuals of each piece, (N,).

    Errors by steps h are of first order, so 2 x(h/2) - x(h) has none of them; what it changes from
    h to h/2 is what it may be off. If the replays with steps h fit better, as they fit a log of a
    simulation with such steps, their solution is returned, and what shorter steps would change.
    """
    if not replays.free.size:  # records of simulated runs have the same steps
        return slopes, [np.zeros(len(r)) for r in slopes.residuals]
    plain = replays.rig(slopes.point).repeated(replays._part(0))
    steps = replays.steps
    rows = [slopes.residuals]
    for parts in (2.0, 4.0):
        replays.steps = {"physics_step": plain.resolved.physics_step / parts}
        rows += replays.residuals([slopes.point])
    replays.steps = steps
    residuals, by_half, by_quarter = [], [], []
    for full, half, quarter in zip(*rows, strict=True):
        residuals.append(2.0 * quarter - half)
        by_half.append(2.0 * (half - full))
        by_quarter.append(2.0 * (quarter - half) - (half - full))
    before = _solved(replays, slopes)
    after = _solved(replays, dataclasses.replace(slopes, residuals=residuals))
    if before.cost < after.cost:
        return before, by_half
    return after, by_quarter


def _solved(replays: Replays, slopes: Slopes) -> Slopes:
    """Return the slopes after a step to the least squares."""
    return slopes.stepped(_moved(replays, slopes, 0.0) - slopes.point.values)


def moves(slopes: Slopes, changes: list[Array]) -> Array:
    """Return how far changes of the residuals of each piece, (N,), move the solution, (p,)."""
    return np.abs(least_squares(slopes.freed_slopes, np.concatenate(slopes.freed(changes))))


def accurate(replays: Replays, slopes: Slopes) -> tuple[Slopes, Array]:
    """Return what a search reaches when its replays are corrected, and how far the last halving
    moved it, (p,).

    The step is halved until that move is far below the standard errors. Residuals are corrected at
    each point, because the moments at which dry friction changes its direction move. The
    derivatives stay those of the first step.
    """
    moved = np.zeros(len(replays.names))
    if not replays.correct(slopes.point, 1):
        return slopes, moved
    slopes = replays.sharpened(refine(replays, slopes.point, CORRECTED_STEPS))
    for halvings in range(2, MAX_HALVINGS + 1):
        before = slopes
        replays.correct(before.point, halvings)
        (residuals,) = replays.residuals([before.point])
        slopes = dataclasses.replace(before, residuals=residuals)
        slopes = slopes.stepped(_moved(replays, slopes, 0.0) - slopes.point.values)
        moved = np.abs(slopes.point.values - before.point.values)
        if np.all(moved <= NEGLIGIBLE_MOVE * np.sqrt(np.diag(jackknife(slopes)))):
            break
    return slopes, moved


def not_worse(replays: Replays, reached: Slopes) -> Slopes:
    """Return what a search reached, or what the rig's own values lead to if these fit better."""
    first = replays.slopes(replays.start)
    if reached.cost <= cost(first.freed(first.residuals)):
        return reached
    return min(reached, refine(replays, first.point, ROUGH_STEPS), key=lambda slopes: slopes.cost)


def refine(replays: Replays, point: Point, most: int) -> Slopes:
    """Return the slopes at the least squares near a point, after at most `most` steps that lower
    the cost.
    """
    best = replays.slopes(point)
    for _ in range(most):
        chosen, reached = _best_step(replays, best)
        if not reached < best.cost:
            break
        after = replays.slopes(chosen)
        gain = best.cost - after.cost
        best = after
        if gain < COST_TOLERANCE * best.cost:
            break
    return best


def fit_starts(replays: Replays, most: int) -> Slopes:
    """Return the slopes of replays without quantities, in which the states at the starts of pieces
    are fitted.

    A joint that dry friction holds at a start has no slope there. So each piece is fitted from
    several velocities, and keeps the best.
    """
    if not len(replays.free):
        return refine(replays, replays.start, most)
    n = len(replays.twin.columns.x)
    reached = []
    for velocity in KICKS:
        states = replays.start.states.copy()
        states[:, -n:] += velocity
        reached.append(refine(replays, Point(replays.start.values, states), most).point)
    best = replays.costs(reached).argmin(axis=0)
    states = []
    for k, i in enumerate(best):
        states.append(reached[i].states[k])
    return refine(replays, Point(replays.start.values, np.array(states)), most)


def _best_step(replays: Replays, slopes: Slopes) -> tuple[Point, float]:
    """Return the best of several damped steps, and its cost.

    Each piece chooses the best move of its own states.
    """
    groups = []
    dampings = DAMPINGS if len(slopes.point.values) else DAMPINGS[:1]
    for damping in dampings:
        groups.append(_variants(replays, slopes, _moved(replays, slopes, damping)))
    costs = replays.costs(list(itertools.chain(*groups)))
    reached = []
    for group, of_group in zip(groups, np.split(costs, len(groups)), strict=True):
        states = []
        for k, best in enumerate(of_group.argmin(axis=0)):
            states.append(group[best].states[k])
        total = float(of_group.min(axis=0).sum())
        reached.append((Point(group[0].values, np.array(states)), total))
    return min(reached, key=lambda pair: pair[1])


def _variants(replays: Replays, slopes: Slopes, values: Array) -> list[Point]:
    """Return points with the same quantities, and states at the starts that a piece may choose
    from.

    Dry friction makes a kink in the cost at velocity 0, which no step crosses from another
    velocity. So rest is tried.
    """
    moves = slopes.moves(values - slopes.point.values)
    moved = []
    for share in SHARES:
        states = np.clip(slopes.point.states + share * moves, -MAX_STATE, MAX_STATE)
        moved.append(Point(values, states))
    if not len(replays.free):
        return moved[-1:]
    moved.append(replays.at_rest(moved[-1]))
    if not len(values):  # then pieces have nothing in common, and each may stay
        moved.append(slopes.point)
    return moved


def _moved(replays: Replays, slopes: Slopes, damping: float) -> Array:
    """Return the quantities after a damped Gauss-Newton step, within their ranges, (p,)."""
    J = slopes.freed_slopes
    r = slopes.freed_residuals
    values = slopes.point.values
    low = replays.low
    high = replays.high
    descent = -J.T @ r
    stopped_low = (values <= low) & (descent < 0.0)
    stopped_high = (values >= high) & (descent > 0.0)
    inside = ~(stopped_low | stopped_high)
    A = J.T @ J
    A[np.diag_indices_from(A)] *= 1.0 + damping
    step = np.zeros(len(values))
    step[inside] = least_squares(A[np.ix_(inside, inside)], descent[inside], 1e-14)
    moved = values + step
    positive = (low >= 0.0) & (values > NEGLIGIBLE_VALUE)
    moved = np.where(positive, np.clip(moved, values / MAX_FACTOR, values * MAX_FACTOR), moved)
    return np.clip(moved, low, high)
