"""Search for a function W whose levels the loop cannot leave: worst-case times to a set around
rest, on a grid.

The loop is M x'' = phi(x) - D(x) x' - sigma(s) + d with |d| <= d0 and s = x' + c x, in the
coordinates x and s, which separate its fast from its slow motion. W = 1 - exp(-T), where T is the
time until a target around rest is reached while d delays it as long as it can: the value of a game
of pursuit and evasion. It is computed by a semi-Lagrangian scheme and swept in four orders until it
settles. W is bilinear between the nodes. The search proves nothing: the checker does.

Source: M. Bardi and I. Capuzzo-Dolcetta, Optimal Control and Viscosity Solutions of
Hamilton-Jacobi-Bellman Equations, Birkhauser 1997 (the game, and 1 - exp(-T)); P. Giesl and S.
Hafstein, "Review on computational methods for Lyapunov functions", Discrete Contin. Dyn. Syst. B
20(8):2291, 2015 (functions on grids that a computer verifies).
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.linalg import solve_continuous_lyapunov
from scipy.optimize import brentq

from smc_mujoco.common.aliases import Array, ArrayPair, Pair
from smc_mujoco.evidence.certificates.loops import Loop
from smc_mujoco.simulation.cfunctions import cached

# Says of a cell (x0, x1, s0, s1), and of W at its corners 00, 10, 01, 11, whether W surely falls
# there.
Proven = Callable[[tuple[float, ...], tuple[float, ...]], bool]
# Says of P whether z' P z surely falls where it is at most 1.
Attracts = Callable[[np.ndarray], bool]
CELLS = 110  # on each side of 0, in x and in s: chosen
TARGET_CELLS = 8.0  # in half a target: chosen
SWEEPS = 500  # of a solution, at most
SWEEP_TOLERANCE = 1e-9
SMOOTHING_COUNTS = (2, 8, 24)  # how often W is smoothed, which blunts its edges: chosen
# 1/s, largest velocity of the grid over its largest position: chosen, as of a map of `basin`
SPEED_RATIO = 3.0
SIZE_HALVINGS = 40  # of a set's size, in search of the largest
MIN_FALL_SHARE = 0.01  # least fall in a cell, as a share of the range of W' in it: chosen
MIN_RANGE = 0.02  # range of levels that is worth a certificate: chosen
RAMP_SHARE = 0.5  # of the target's size, over which the cost of time rises from 0 to 1: chosen
CELL_SAMPLES = 5  # of a cell, in both directions
TARGET_SCALES = 1.0, 1.05, 1.1, 1.2, 1.35  # of the linear loop's worst case: chosen


def rest(loop: Loop, reach: float) -> float:
    """Return where the loop rests under d = d0, the first such |x|; NaN if there is none up to
    `reach`.
    """
    x = np.linspace(0.0, reach, 4001)[1:]

    def left(z: Any) -> Any:
        return loop.sigma(loop.c * np.asarray(z)) - loop.phi(np.asarray(z)) - loop.d0

    holds = left(x) > 0.0
    if not holds.any():
        return float("nan")
    i = int(np.argmax(holds))
    low = 0.0 if i == 0 else x[i - 1]
    if left(low) >= 0.0:
        return float(low)
    root: Any = brentq(left, low, x[i])
    return float(root)


def form(loop: Loop, reach: float, attracts: Attracts) -> Array | None:
    """Return P of a set z' P z <= 1, z = (x, s), around all worst cases of the loop that is linear
    between its rests.

    None if there are none. Without a disturbance it is a set where the form falls.
    """
    if loop.switches:
        return None
    if not loop.d0:
        return _attracted(loop, reach, attracts)
    at = rest(loop, reach)
    if not 0.0 < at < reach:
        return None
    K = loop.d0 / at
    gain = float(loop.sigma(np.array(loop.c * at))) / (loop.c * at)
    damping = gain + float(loop.D(np.zeros(())))  # of the loop
    A = np.array(
        [
            [-loop.c, 1.0],
            [loop.c * damping / loop.M - K / loop.M - loop.c**2, loop.c - damping / loop.M],
        ]
    )
    slow = -max(np.linalg.eigvals(A).real)
    best = None
    push = np.array([0.0, loop.d0 / loop.M])
    for rate in np.linspace(0.02, 1.98, 99) * slow if slow > 0.0 else ():
        Q = solve_continuous_lyapunov(A + rate / 2.0 * np.eye(2), -np.outer(push, push) / rate)
        if np.linalg.eigvalsh(Q).min() > 0.0 and (best is None or Q[0, 0] < best[0, 0]):
            best = Q
    return None if best is None else np.linalg.inv(best)


def _attracted(loop: Loop, reach: float, attracts: Attracts) -> Array | None:
    """Return P of the largest set z' P z <= 1 on which the form of the loop's linearisation surely
    falls; or None.
    """
    h = 1e-6 * reach
    push = float(loop.phi(np.array(h))) / h
    D0 = float(loop.D(np.zeros(())))
    A = np.array([[-loop.c, 1.0], [0.0, loop.c - (D0 + loop.steep) / loop.M]])
    A[1, 0] = (push + D0 * loop.c) / loop.M - loop.c**2
    if max(np.linalg.eigvals(A).real) >= 0.0:
        return None
    P = solve_continuous_lyapunov(A.T, -np.diag([1.0, 1.0 / max(1.0, loop.c) ** 2]))
    most = 2.0 * np.log10(0.9 * reach)
    size = 0.9 * 10.0 ** largest(lambda q: attracts(P / 10.0**q), -9.0, most)
    if attracts(P / size):
        return P / size
    return None


def largest(accepted: Callable[[float], bool], low: float, high: float) -> float:
    """Return the largest size up to `high` that is accepted, by bisection; `low` if none is."""
    for _ in range(SIZE_HALVINGS):
        middle = 0.5 * (low + high)
        if accepted(middle):
            low = middle
        else:
            high = middle
    return low


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Levels:
    """A bilinear W on nodes (x, s), x >= 0:

    W(-x, -s) = W(x, s). It falls between its levels inner and outer.
    """

    x: Array  # (n,)
    s: Array  # (2 n - 1,)
    W: Array  # (n, 2 n - 1)
    inner: float  # level
    outer: float  # level
    bound: float  # the largest |x| in cells that the inner level reaches
    # of z' P z = P0 x^2 + 2 P1 x s + P2 s^2 on the inner set without disturbance
    P: tuple[float, float, float] | None


def levels(
    loop: Loop,
    reach: float,
    start: Pair,
    proven: Proven,
    attracts: Attracts,
    target: Pair | None = None,
) -> Levels | None:
    """Return the levels with the smallest bound, or the largest region without disturbance; None if
    the search fails.

    Levels that contain the start are preferred. `target`: half-widths in x and s of a box to reach,
    for a law that switches.
    """
    P = form(loop, reach, attracts)
    if P is None and (target is None or not min(target)):
        return None
    if P is None:
        small = np.array(target)
    else:
        small = np.sqrt(np.diag(np.linalg.inv(P)))
    x = axis(reach, small[0] / TARGET_CELLS)
    s = axis((loop.c + SPEED_RATIO) * reach, small[1] / TARGET_CELLS)
    X, S = np.meshgrid(x, s, indexing="ij")
    size = np.maximum(np.abs(X) / small[0], np.abs(S) / small[1])
    if P is not None:
        size = np.sqrt(P[0, 0] * X * X + 2.0 * P[0, 1] * X * S + P[1, 1] * S * S)
    tried = []
    for scale in TARGET_SCALES if loop.d0 and P is not None else (0.5,):
        W = times(loop, x, s, np.clip((size / scale - 1.0) / RAMP_SHARE, 0.0, 1.0))
        for count in SMOOTHING_COUNTS:
            smooth = np.round(_smooth(W, count, loop.switches), 7)
            grid = _Grid(loop, x, s, smooth, size if P is None or not loop.d0 else None)
            tried.append((grid, grid.window()))
    numbers = None
    if P is not None and not loop.d0:
        numbers = float(P[0, 0]), float(P[0, 1]), float(P[1, 1])
    for grid, widest in sorted(tried, key=lambda pair: pair[0].worth(pair[1], start)):
        if not widest or not grid.bound(widest):
            continue
        window = grid.surely(widest, proven)
        if window:
            outer = float(f"{window[1] - 2e-6:.6f}")
            bound = grid.bound(window)
            inner = _inner(window)
            return Levels(x=grid.x, s=s, W=grid.W, inner=inner, outer=outer, bound=bound, P=numbers)
    return None


def _inner(window: Pair) -> float:
    """Return the inner level of a range of levels."""
    return float(f"{window[0] + 2e-6:.6f}")


class _Grid:
    """W on the nodes with x >= 0, and the cells where it does not fall."""

    def __init__(self, loop: Loop, x: Array, s: Array, W: Array, size: Array | None):
        n = x.size // 2
        self.loop = loop
        self.x = x[n:]
        self.s = s
        self.W = W[n:]
        self.W[0] = np.maximum(self.W[0], self.W[0, ::-1])
        self.corners = np.stack(
            [self.W[:-1, :-1], self.W[1:, :-1], self.W[:-1, 1:], self.W[1:, 1:]]
        )
        self.low, self.high = self.corners.min(0), self.corners.max(0)
        lowest, highest = falls(loop, self.x, s, self.corners)
        self.bad = highest >= -MIN_FALL_SHARE * (highest - lowest) - 1e-7
        if loop.switches:  # where s stays 0, x decays, and W must fall with it
            self.bad[:, n - 1 : n + 1] |= (np.diff(self.W[:, n]) <= 0.0)[:, None]
        self.sure = np.zeros_like(self.bad)
        self.border = min(self.W[-1].min(), self.W[:, 0].min(), self.W[:, -1].min())
        self.limit = 1.0
        if size is not None:  # the inner set must lie where the form falls
            beyond = size[n:] > 0.99
            hit = beyond[:-1, :-1] | beyond[1:, :-1] | beyond[:-1, 1:] | beyond[1:, 1:]
            self.limit = float(self.low[hit].min())

    def window(self) -> Pair | None:
        """Return the widest range of levels that no cell spoils, or None."""
        spans = sorted(
            [*zip(self.low[self.bad], self.high[self.bad], strict=True), (self.border, 2.0)]
        )
        covered = 0.0
        widest = (0.0, MIN_RANGE)
        for low, high in spans:
            if covered < self.limit - 1e-5 and low - covered > widest[1] - widest[0]:
                widest = covered, low
            covered = max(covered, high)
        if widest[0] > 0.0 or widest[1] > MIN_RANGE:
            return widest
        return None

    def bound(self, window: Pair | None) -> float:
        """Return the largest |x| of the cells that reach the inner level."""
        if window is None:
            return np.inf
        ends = np.broadcast_to(self.x[1:, None], self.low.shape)
        return float(ends[self.low <= _inner(window)].max(initial=0.0))

    def worth(self, window: Pair | None, start: Pair) -> tuple[bool, float]:
        """Return a key that is smaller for better levels."""
        if window is None or not self.bound(window):
            return True, np.inf
        side = 1.0 if start[0] >= 0.0 else -1.0
        i = np.searchsorted(self.x, side * start[0], side="right") - 1
        j = np.searchsorted(self.s, side * start[1], side="right") - 1
        rows, columns = self.high.shape
        within = i < rows and 0 <= j < columns and self.high[i, j] < window[1]
        if self.loop.d0:
            return not within, self.bound(window)
        areas = np.diff(self.x)[:, None] * np.diff(self.s)
        return not within, -float(areas[self.high < window[1]].sum())

    def surely(self, window: Pair, proven: Proven) -> Pair | None:
        """Return a range of levels between which W surely falls in each cell, or None."""
        interval: Pair | None = window
        while interval is not None:
            inside = (self.high >= interval[0]) & (self.low <= interval[1]) & ~self.sure & ~self.bad
            for i, j in zip(*np.nonzero(inside), strict=True):
                box = (self.x[i], self.x[i + 1], self.s[j], self.s[j + 1])
                ok = proven(tuple(map(float, box)), tuple(map(float, self.corners[:, i, j])))
                self.sure[i, j], self.bad[i, j] = ok, not ok
            if not (self.bad & inside).any():
                return interval
            interval = self.window()
        return None


def axis(reach: float, step: float) -> Array:
    """Return 2 CELLS + 1 nodes from -reach to reach, `step` apart at 0 and ever wider outwards."""
    step = min(step, reach / CELLS * 0.999)
    wide: Any = brentq(lambda a: reach / np.sinh(a) * np.sinh(a / CELLS) - step, 1e-6, 60.0)
    half = reach / np.sinh(wide) * np.sinh(wide * np.arange(CELLS + 1) / CELLS)
    half = np.array([float(f"{value:.6g}") for value in half])
    return np.concatenate([-half[:0:-1], half])


def times(loop: Loop, x: Array, s: Array, cost: Array) -> Array:
    """Return 1 - exp(-T) on the nodes, T the largest integral of the cost under |d| <= d0; 1 where
    the grid is left.
    """
    X, S = np.meshgrid(x, s, indexing="ij")
    hx = np.gradient(x)[:, None]
    hs = np.gradient(s)[None, :]
    cells = []
    shares = []
    ends = (-loop.d0, loop.d0)
    fastest = [
        np.maximum(np.abs(S - loop.c * X) / hx, np.abs(loop.fall(X, S, d)) / hs) for d in ends
    ]
    step = 1.0 / (0.1 + np.maximum.reduce(fastest))
    for d in ends:  # midpoint rule
        mx = X + 0.5 * step * (S - loop.c * X)
        ms = S + 0.5 * step * loop.fall(X, S, d)
        px = X + step * (ms - loop.c * mx)
        ps = S + step * loop.fall(mx, ms, d)
        if loop.switches:  # along s = 0
            px = np.where(S == 0.0, X - step * loop.c * X, px)
            ps = np.where(S == 0.0, S + step * loop.fall(X, S, d), ps)
        i = np.clip(np.searchsorted(x, px) - 1, 0, x.size - 2)
        j = np.clip(np.searchsorted(s, ps) - 1, 0, s.size - 2)
        out = (np.abs(px) > x[-1]) | (np.abs(ps) > s[-1])
        cells.append((np.where(out, -1, i), j))
        shares.append(((px - x[i]) / (x[i + 1] - x[i]), (ps - s[j]) / (s[j + 1] - s[j])))
    W = np.where(cost > 0.0, 1.0, 0.0)
    decay = np.exp(-step * cost)
    for _ in range(SWEEPS):
        if _sweep(W, cost > 0.0, np.array(cells), np.array(shares), decay) < SWEEP_TOLERANCE:
            break
    return W


def _smooth(W: Array, count: int, switches: bool) -> Array:
    """Return W averaged over neighbours; W' at a node is convex in the gradient of W, so it falls
    nearly as before.
    """
    for _ in range(count):
        padded = np.pad(W, 1, mode="edge")
        W = (padded[:-2] + 2.0 * padded[1:-1] + padded[2:]) / 4.0
        if switches:
            W = W[:, 1:-1]
        else:
            W = (W[:, :-2] + 2.0 * W[:, 1:-1] + W[:, 2:]) / 4.0
    return W


@cached
def _sweep(W, open_, cells, shares, decay):
    """Update W in four orders of its nodes, and return its largest change."""
    nx, ns = W.shape
    change = 0.0
    for order in range(4):
        for a in range(nx):
            i = a if order % 2 == 0 else nx - 1 - a
            for b in range(ns):
                j = b if order < 2 else ns - 1 - b
                if not open_[i, j]:
                    continue
                worst = 0.0
                for k in range(cells.shape[0]):
                    p = cells[k, 0, i, j]
                    q = cells[k, 1, i, j]
                    value = 1.0
                    if p >= 0:
                        f = shares[k, 0, i, j]
                        g = shares[k, 1, i, j]
                        low = (1.0 - g) * W[p, q] + g * W[p, q + 1]
                        value = (1.0 - f) * low + f * (
                            (1.0 - g) * W[p + 1, q] + g * W[p + 1, q + 1]
                        )
                    worst = max(worst, value)
                new = 1.0 - decay[i, j] * (1.0 - worst)
                change = max(change, abs(new - W[i, j]))
                W[i, j] = new
    return change


def falls(loop: Loop, x: Array, s: Array, corners: Array) -> ArrayPair:
    """Return the least and the largest W' at samples of each cell under the worst d, two arrays of
    (n, 2 n).
    """
    hx = np.diff(x)[:, None]
    hs = np.diff(s)[None, :]
    values = []
    w00, w10, w01, w11 = corners
    for a in np.linspace(0.0, 1.0, CELL_SAMPLES):
        for b in np.linspace(0.0, 1.0, CELL_SAMPLES):
            X = x[:-1, None] + a * hx
            S = s[None, :-1] + b * hs
            Wx = ((1.0 - b) * (w10 - w00) + b * (w11 - w01)) / hx
            Ws = ((1.0 - a) * (w01 - w00) + a * (w11 - w10)) / hs
            v = S - loop.c * X
            law = loop.sigma(s[None, :-1] + 0.5 * hs if loop.switches else S)
            force = loop.phi(X) - loop.D(X) * v - law
            values.append(Wx * v + (Ws * force + loop.d0 * np.abs(Ws)) / loop.M + Ws * loop.c * v)
    return np.min(values, axis=0), np.max(values, axis=0)
