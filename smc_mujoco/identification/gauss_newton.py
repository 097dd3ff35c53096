"""The search of identification: starts over decades, and damped Gauss-Newton steps from the best.

Quantities that cannot be negative, such as masses and frictions, differ between machines by powers
of ten. So further starts are drawn evenly in their logarithms, and no step changes such a quantity
by more than a factor of ten.
"""

import dataclasses
import itertools
import operator
from collections.abc import Sequence

import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.identification.least_squares import least_squares
from smc_mujoco.identification.paths import DELAY
from smc_mujoco.identification.replays import PARTS, Point, Replays, Slopes, cost
from smc_mujoco.identification.standard_errors import jackknife

START_DECADES = 2.0  # by which a quantity of a further start may differ from the rig's own; chosen
CANDIDATES = 8  # further starts that are drawn for each one that is refined; chosen
DAMPINGS = 0.0, 1e-2, 1.0, 1e3  # of steps that are tried in turn, relative to the curvature; chosen
# of its linear move by which the starting state of a piece is moved that misses its promise;
# chosen. 0 keeps a state that dry friction holds, which any move might spoil
SHARES = 0.0, 0.3
# scales of a state at the start, by which it may differ from the measured one; chosen
MAX_STATE = 100.0
# scales of velocity by which starts differ from which a piece's own is fitted; chosen
KICKS = -4.0, 4.0
# percent: fit of a piece beyond which it is not fitted from there; chosen
GOOD_PIECE = 99.5
MAX_FACTOR = 10.0  # by which a step may change a quantity that cannot be negative; chosen
NEGLIGIBLE_VALUE = 1e-4  # of its scale: below it such a quantity may become 0; chosen
# relative changes of the cost at which a search ends, if what it reaches is the solution, if more
# steps follow, and with extrapolated replays, which cost six times as much; chosen
COST_TOLERANCE, SMALL_CHANGE, LAST_CHANGE = 1e-5, 0.01, 0.1
KEPT_PROMISE = 0.5  # of the decrease that derivatives promise: less calls for damping; chosen
TRUE_PROMISE = 0.9  # of that decrease: derivatives that keep it serve a further step; chosen
# s, by which other delays differ that are tried; chosen: with a command that jumps at each sample
# derivatives by the delay hold for about a sample
DELAY_MOVES = -8e-3, -4e-3, -2e-3, -1e-3, 1e-3, 2e-3, 4e-3, 8e-3
# of a stiffness, that are tried; chosen
SPRING_FACTORS = 0.1, 0.2, 0.35, 0.6, 0.8, 1.25, 1.7, 3.0, 5.0, 10.0
# s, of a spring's damping over its stiffness, that are tried with these; None: the present damping
SPRING_DAMPINGS = None, 3e-4, 1e-3, 3e-3  # chosen
FLANK_STEPS = 8  # of the states at the starts, from a flank of a play; chosen
LEAST_DELAY_MOVE = 2.5e-4  # s, at the solution; chosen
BETTER = 3.0  # deviations of noise, by which another delay must fit better there; chosen
MOST_DELAYS = 3  # other delays, at most, from which a search starts again; chosen
MOST_SLOPES = 3  # how often slopes are taken near the solution, at most; chosen
LEAST_COST = 1e-300  # in place of the cost 0
ROUGH_STEPS = 8  # steps from each start before the best is chosen; chosen
CORRECTED_STEPS = 3  # steps after the first halving of the physics step; chosen
MAX_HALVINGS = 5  # of the physics step in corrected replays; chosen
NEGLIGIBLE_MOVE = 0.5  # of a standard error, by which a halving may move a quantity; chosen
# of what halved steps change in an extrapolation: what is then left. Where errors of steps h, h/2
# and h/4 are random, in proportion to the step, 2 x(h/4) - x(h/2) errs by sqrt(1/2) of those of h,
# and its change from 2 x(h/2) - x(h) is sqrt(7/2) of them; where they are smooth, 1/3 is left
LEFT_BY_STEPS = 7.0**-0.5
GOOD_FIT = 97.0  # percent: fit of the pieces beyond which a start needs no rival; chosen


def search(
    replays: Replays, first: Slopes, starts: int, seed: int, most: int, tolerance: float
) -> Slopes:
    """Return the slopes at the least squares near the best of several starts, that of the `first`
    slopes before others. A delay starts where it leaves least.

    Further starts, of which the random ones have a `seed`, are only tried while none fits well.
    `most`: largest number of steps from the best start. `tolerance`: as of `refine`.
    """
    if (delayed := _other_delay(replays, first, LAST_CHANGE)) is not None:
        first = replays.slopes(delayed, central=False)
    if starts == 1:
        reached = [_searched(replays, first, most, tolerance)]
        if (begun := _other_flanks(replays, first)) is not None:
            slopes = replays.slopes(begun, central=False)
            reached.append(_searched(replays, slopes, most, tolerance))
        return min(reached, key=lambda slopes: slopes.cost)
    steps = min(most, ROUGH_STEPS)
    reached = [refine(replays, first, steps, tolerance, rough=True)]
    if reached[-1].fit < GOOD_FIT:
        for point in _random(replays, starts - 1, seed):
            slopes = replays.slopes(point, central=False)
            reached.append(refine(replays, slopes, steps, tolerance, rough=True))
            if reached[-1].fit > GOOD_FIT:
                break
    best = min(reached, key=lambda slopes: slopes.cost)
    return refine(replays, best, most, tolerance, rough=True)


def _searched(replays: Replays, first: Slopes, most: int, tolerance: float) -> Slopes:
    """Return the slopes at the least squares near others, also beyond the valleys of the cost that
    springs, plays and delays make.
    """
    best = refine(replays, first, most, tolerance, rough=True)
    for _ in range(MOST_DELAYS):
        point = (
            _other_spring(replays, best)
            or _other_flanks(replays, best)
            or _other_delay(replays, best, SMALL_CHANGE)
        )
        if point is None:
            break
        slopes = replays.slopes(point, central=False)
        tried = refine(replays, slopes, most, tolerance, rough=True)
        if tried.cost >= best.cost:
            break
        best = tried
    return best


def _other_spring(replays: Replays, slopes: Slopes) -> Point | None:
    """Return the point with the stiffness of a spring that leaves least of what no quantity can
    cause, by the slopes; None if that is the present one. The cost has a valley for each frequency
    of a resonance.
    """
    best, least = slopes.point, (1.0 - LAST_CHANGE) * _left(slopes, slopes.residuals)
    for k, name in enumerate(replays.names):
        if name not in replays.twin.springs:
            continue
        damping = name.removesuffix("stiffness") + "damping"
        times = SPRING_DAMPINGS if damping in replays.names else SPRING_DAMPINGS[:1]
        points = []
        for factor, time in itertools.product((1.0, *SPRING_FACTORS), times):
            values = slopes.point.values.copy()
            values[k] = np.clip(factor * values[k], replays.low[k], replays.high[k])
            if time is not None:  # an undamped resonance rings, wherever it is
                d = replays.names.index(damping)
                damped = time * values[k] * replays.scales[k] / replays.scales[d]
                values[d] = np.clip(damped, replays.low[d], replays.high[d])
            points.append(Point(values, slopes.point.states))
        costs = [_left(slopes, rows) for rows in replays.residuals(points)]
        if min(costs) < least:
            least = min(costs)
            best = points[costs.index(least)]
    return None if best is slopes.point else best


def _other_flanks(replays: Replays, slopes: Slopes) -> Point | None:
    """Return the point with the rotor of each play where it fits each piece best at the start: as
    it is, or near either flank; None if that is the present one. The cost has a valley for each.
    """
    if not replays.plays.any():
        return None
    starts = Replays(
        replays.rig(slopes.point),
        [],
        replays.data,
        replays.closed,
        replays.report,
        replays.whole,
        replays.kept,
    )
    indices = range(len(starts.pieces))
    begun = _fitted_from(starts, slopes, flanks(starts), FLANK_STEPS, indices)
    return None if begun.cost >= (1.0 - LAST_CHANGE) * slopes.cost else begun.point


def flanks(replays: Replays) -> list[Point]:
    """Return points with the rotor of each play at both flanks of it, and in its middle."""
    return [replays.at_flanks(replays.start, side) for side in (-1.0, 0.0, 1.0)]


def _left(slopes: Slopes, rows: list[Array]) -> float:
    """Return the sum of squares of residuals without what quantities can cause, by the slopes."""
    freed = np.concatenate(slopes.freed(rows))
    return cost([freed - slopes.basis @ (slopes.basis.T @ freed)])


def _other_delay(
    replays: Replays,
    slopes: Slopes,
    share: float,
    moves: Sequence[float] | Array = DELAY_MOVES,
) -> Point | None:
    """Return the point with the delay that leaves least of what no number can cause, by the slopes;
    None if no other leaves less by that share of it. `moves`: between delays, s.
    """
    if DELAY not in replays.names:
        return None
    k = replays.names.index(DELAY)
    best, least = slopes.point, (1.0 - share) * _left(slopes, slopes.residuals)
    while True:
        points = []
        for move in moves:
            values = best.values.copy()
            values[k] = np.clip(
                values[k] + move / replays.scales[k], replays.low[k], replays.high[k]
            )
            points.append(Point(values, best.states))
        lefts = [_left(slopes, rows) for rows in replays.delayed(slopes, points)]
        if min(lefts) >= least:
            return None if best is slopes.point else best
        least = min(lefts)
        best = points[lefts.index(least)]


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


def extrapolated(replays: Replays, slopes: Slopes, most: int = 0) -> tuple[Slopes, Array]:
    """Return the solution near slopes for replays whose steps are extrapolated to 0, and about how
    far it is off by them, (p,).

    Errors by steps h are of first order, so 2 x(h/2) - x(h) has none of them. It may be off by the
    share LEFT_BY_STEPS of what it changes from h to h/2: the most of that at the slopes and at the
    solution. If the replays with steps h fit better, as they fit a log of a simulation with such
    steps, their solution is returned, and what shorter steps would change. Else at most `most`
    steps use the derivatives of the slopes. If these promise much more than the replays keep, new
    derivatives are computed. The last step is not replayed.
    """
    if not replays.free.size:  # records of simulated runs have the same steps
        return refine(replays, slopes, most), np.zeros(len(slopes.point.values))
    ends, by_half, by_quarter = _without_steps(replays, slopes, slopes.residuals)
    if _solved(replays, slopes).cost < _solved(replays, ends).cost:
        return _solved(replays, refine(replays, slopes, most)), _moves(slopes, by_half)
    moved = _left_by_steps(replays, slopes, by_half, by_quarter)
    if not most:
        return _solved(replays, ends), moved
    # these hardly depend on the numbers
    replays.step_errors = list(map(operator.sub, ends.residuals, slopes.residuals))
    for _ in range(MOST_SLOPES):
        ends = _settled(replays, ends, most)
        if _share_of_numbers(replays, ends) < LAST_CHANGE:
            break
        ends = replays.slopes(ends.point)  # longer steps err by too much
    share = BETTER**2 / sum(map(len, ends.residuals))
    fine = LEAST_DELAY_MOVE * np.array([-2.0, -1.0, 1.0, 2.0])
    delayed = _other_delay(replays, ends, share, fine)
    full = list(map(operator.sub, ends.residuals, replays.step_errors))
    replays.step_errors = None
    if delayed is not None:  # then derivatives by the delay do not hold over such a move
        (full,) = replays.residuals([delayed])
        ends = dataclasses.replace(ends, point=delayed)
        k = replays.names.index(DELAY)
        moved[k] = max(moved[k], LEAST_DELAY_MOVE / replays.scales[k])
    ends, *changes = _without_steps(replays, ends, full)
    return _solved(replays, ends), np.maximum(moved, _left_by_steps(replays, slopes, *changes))


def _left_by_steps(
    replays: Replays, slopes: Slopes, by_half: list[Array], by_quarter: list[Array]
) -> Array:
    """Return about how far a solution that is extrapolated to steps of 0 is off, (p,).

    Real flanks of a play give way, as those of replays do with steps h, and hardly with steps of 0.
    So of a play all that the steps change counts.
    """
    if replays.plays.any():
        return _moves(slopes, by_half)
    return LEFT_BY_STEPS * _moves(slopes, by_quarter)


def _settled(replays: Replays, slopes: Slopes, most: int) -> Slopes:
    """Return what at most `most` steps with the derivatives of slopes reach, until one gains
    little, or the numbers promise little.
    """
    for _ in range(most):
        after = _best_step(replays, slopes, rough=True)
        enough = after.cost >= (1.0 - LAST_CHANGE) * slopes.cost
        slopes = min(after, slopes, key=lambda slopes: slopes.cost)
        if enough or _share_of_numbers(replays, slopes) < LAST_CHANGE:
            break
    return slopes


def _without_steps(
    replays: Replays, slopes: Slopes, full: list[Array]
) -> tuple[Slopes, list[Array], list[Array]]:
    """Return slopes with residuals that are extrapolated to steps of 0, and about what that changes
    in the residuals of each piece, (N,), from half steps and from quarters. `full`: those of whole
    steps.
    """
    (half,), (quarter,) = replays.by_steps([slopes.point], PARTS)
    residuals, by_half, by_quarter = [], [], []
    for full_step, halved, quartered in zip(full, half, quarter, strict=True):
        residuals.append(2.0 * quartered - halved)
        by_half.append(2.0 * (halved - full_step))
        by_quarter.append(2.0 * (quartered - halved) - (halved - full_step))
    return dataclasses.replace(slopes, residuals=residuals), by_half, by_quarter


def _solved(replays: Replays, slopes: Slopes) -> Slopes:
    """Return the slopes after a step to the least squares."""
    return slopes.stepped(_moved(replays, slopes, 0.0) - slopes.point.values)


def _moves(slopes: Slopes, changes: list[Array]) -> Array:
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
    slopes = replays.sharpened(refine(replays, replays.slopes(slopes.point), CORRECTED_STEPS))
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
    return min(reached, refine(replays, first, ROUGH_STEPS), key=lambda slopes: slopes.cost)


def refine(
    replays: Replays,
    slopes: Slopes,
    most: int,
    tolerance: float = COST_TOLERANCE,
    rough: bool = False,
) -> Slopes:
    """Return the slopes at the least squares near others, after at most `most` steps that lower the
    cost, until one lowers it by less than the share `tolerance`, or the numbers promise less.

    Derivatives of the last steps, which change little, are those of the step before. If `rough`,
    derivatives are differences to one side, and serve while they keep their promise; else all
    pieces try other starts in the first step.
    """
    for i in range(most):
        after = _best_step(replays, slopes, rough or i > 0)
        gain = slopes.cost - after.cost
        if not gain > 0.0:
            break
        change = gain / slopes.cost
        serves = change < SMALL_CHANGE or (
            rough and gain > TRUE_PROMISE * _promise(replays, slopes)
        )
        slopes = after if serves else replays.slopes(after.point, not rough, after.residuals)
        if change < tolerance or _share_of_numbers(replays, slopes) < tolerance:
            break
    return slopes


def fit_starts(replays: Replays, most: int) -> Slopes:
    """Return the slopes of replays without quantities, in which the states at the starts of pieces
    are fitted.

    A joint that dry friction holds at a start has no slope there. So a piece that does not fit well
    is also fitted from other velocities, and keeps the best. So it is with where a rotor is in its
    play.
    """
    reached = _own_starts(replays, replays.start, most)
    if replays.plays.any():
        reached = _fitted_from(replays, reached, flanks(replays), most, range(len(replays.pieces)))
    allowed = (1.0 - GOOD_PIECE / 100.0) ** 2 * reached.columns * reached.records
    samples = sum(map(len, reached.residuals))
    hard = []
    for k, r in enumerate(reached.residuals):
        if len(replays.free) and cost([r]) > allowed * len(r) / samples:
            hard.append(k)
    kicked = []
    for velocity in KICKS if hard else ():
        kicked.append(replays.start)
        kicked[-1].states[:, -len(replays.twin.columns.x) :] += velocity
    return _fitted_from(replays.only(hard), reached, kicked, most, hard)


def starting_states(repeats: Replays, starts: Sequence[Point]) -> list[Array | None]:
    """Return the state from which each record is best repeated as a whole in an open loop, (q +
    2n,): the best of some starts, or what a step from it gives.
    """
    tried = repeats.residuals(starts)
    costs = []
    for rows in tried:
        costs.append([cost([row]) for row in rows])
    best = np.argmin(costs, axis=0).tolist()
    before = []
    states = []
    for i, k in enumerate(best):
        before.append(tried[k][i])
        states.append(starts[k].states[i])
    begun = Point(starts[0].values, np.array(states))
    slopes = repeats.slopes(begun, False, before)
    moved = Point(begun.values, begun.states + slopes.moves(begun.values))
    reached = []
    for i, after in enumerate(repeats.costs([moved])[0].tolist()):
        reached.append(repeats.state(moved if after < cost([before[i]]) else begun, i))
    return reached


def _fitted_from(
    replays: Replays, reached: Slopes, points: Sequence[Point], most: int, indices: Sequence[int]
) -> Slopes:
    """Return slopes of which some pieces, those of the replays, have the best that they or fits of
    their states from other points reach.
    """
    residuals = list(reached.residuals)
    states = reached.point.states.copy()
    for point in points:
        tried = _own_starts(replays, Point(point.values, point.states[indices]), most)
        for i, k in enumerate(indices):
            if cost([tried.residuals[i]]) < cost([residuals[k]]):
                residuals[k] = tried.residuals[i]
                states[k] = tried.point.states[i]
    point = Point(reached.point.values, states)
    return dataclasses.replace(reached, point=point, residuals=residuals)


def _own_starts(replays: Replays, point: Point, most: int) -> Slopes:
    """Return the slopes at a point without quantities, with the residuals and the states that at
    most `most` steps of each piece reach, until one lowers its cost by less than SMALL_CHANGE.
    """
    first = slopes = replays.slopes(point, central=False)
    residuals = list(first.residuals)
    states = point.states.copy()
    falling = list(range(len(residuals)))
    for _ in range(most):
        after = _best_step(replays.only(falling), slopes, rough=True)
        promised = after.freed(after.residuals)
        still = []
        for i, k in enumerate(falling):
            before, reached = cost([residuals[k]]), cost([after.residuals[i]])
            if reached < before:
                residuals[k] = after.residuals[i]
                states[k] = after.point.states[i]
            falls = reached < (1.0 - SMALL_CHANGE) * before
            if falls and cost([promised[i]]) < (1.0 - SMALL_CHANGE) * reached:
                still.append(k)
        falling = still
        if not falling:
            break
        begun = Point(point.values, states[falling])
        of_falling = [residuals[k] for k in falling]
        slopes = replays.only(falling).slopes(begun, False, of_falling)
    return dataclasses.replace(first, point=Point(point.values, states), residuals=residuals)


def _best_step(replays: Replays, slopes: Slopes, rough: bool) -> Slopes:
    """Return what a damped step reaches, with the derivatives before it: the first of several that
    keeps its promise, or the best. `rough` as of `_chosen`.
    """
    reached = []
    for damping in DAMPINGS if len(slopes.point.values) else DAMPINGS[:1]:
        reached.append(_chosen(replays, slopes, _moved(replays, slopes, damping), rough))
        promise = _promise(replays, slopes, damping)
        if slopes.cost - reached[-1].cost > KEPT_PROMISE * promise:
            break
    return min(reached, key=lambda slopes: slopes.cost)


def _promise(replays: Replays, slopes: Slopes, damping: float = 0.0) -> float:
    """Return by how much a damped step lowers the cost, by the derivatives."""
    step = _moved(replays, slopes, damping) - slopes.point.values
    return slopes.cost - cost([slopes.freed_residuals + slopes.freed_slopes @ step])


def _share_of_numbers(replays: Replays, slopes: Slopes) -> float:
    """Return by which share of it the numbers promise to lower the cost that states cannot."""
    step = _moved(replays, slopes, 0.0) - slopes.point.values
    r = slopes.freed_residuals
    return 1.0 - cost([r + slopes.freed_slopes @ step]) / max(cost([r]), LEAST_COST)


def _chosen(replays: Replays, slopes: Slopes, values: Array, rough: bool) -> Slopes:
    """Return slopes at quantities, with the derivatives of others. Each piece has the best of
    several moves of its own states; if `rough`, the linear one where that keeps its promise.
    """
    full, *alternatives = _variants(replays, slopes, values)
    (residuals,) = replays.residuals([full])
    states = full.states.copy()
    step = values - slopes.point.values
    missed = []
    for k, (r, J, S) in enumerate(
        zip(slopes.residuals, slopes.by_values, slopes.by_states, strict=True)
    ):
        before, promised = (
            cost([r]),
            cost([r + J @ step + S @ (states[k] - slopes.point.states[k])]),
        )
        allowed = before - KEPT_PROMISE * (before - promised)
        if not rough or cost([residuals[k]]) > max(allowed, (1.0 + SMALL_CHANGE) * promised):
            missed.append(k)
    if missed and alternatives:
        points = [Point(values, point.states[missed]) for point in alternatives]
        for point, tried in zip(points, replays.only(missed).residuals(points), strict=True):
            for i, k in enumerate(missed):
                if cost([tried[i]]) < cost([residuals[k]]):
                    residuals[k] = tried[i]
                    states[k] = point.states[i]
    return dataclasses.replace(slopes, point=Point(values, states), residuals=residuals)


def _variants(replays: Replays, slopes: Slopes, values: Array) -> list[Point]:
    """Return points with the same quantities, and states at the starts that a piece may choose
    from: the linear move first.

    Dry friction makes a kink in the cost at velocity 0, which no step crosses from another
    velocity. So rest is tried.
    """
    moves = slopes.moves(values - slopes.point.values)
    variants = []
    for share in (1.0, *SHARES):
        states = np.clip(slopes.point.states + share * moves, -MAX_STATE, MAX_STATE)
        variants.append(Point(values, states))
    if not len(replays.free):
        return variants[:1]
    return [*variants, replays.at_rest(variants[0])]


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
