"""Limit cycles of sampled laws on linear plants behind linear drives, integrated exactly, without
the suite's code.

A plant M x'' = -alpha x - delta x' + f is behind lags, or behind a motor whose current has
back-EMF, under a command that is sampled, delayed and held. From one sample to the next its state
moves by matrix exponentials.
"""

import dataclasses
import itertools
import math

import numpy as np
from numba import njit
from scipy.linalg import expm

NAMES = ("classical", "twisting", "super_twisting", "quasi_continuous", "suboptimal", "power_rate")
GAINS = (
    ("k", "c"),
    ("r1", "r2"),
    ("k1", "k2", "c"),
    ("a", "b"),
    ("r1", "r2"),
    ("k", "c", "a"),
)
USUAL = (
    (4.0, 2.5),
    (3.7, 2.3),
    (3.0, 4.4, 2.5),
    (6.0, 1.0),
    (4.0, 1.5),
    (4.0, 2.5, 0.5),
)
PERIODS = (1e-4, 2e-4, 2.5e-4, 5e-4, 1e-3)  # s
LATE = 0.4  # share of a run in which the cycle is measured
STEADY = 0.02  # relative difference of both halves of that share, above which there is no cycle
CENTRED = 0.2  # of the amplitude: a cycle about a mean farther from 0 is not one about rest


@dataclasses.dataclass(frozen=True)
class Motor:
    """A motor on a voltage amplifier: ohm, H, N m/A at the joint, kg m^2 at the joint."""

    resistance: float
    inductance: float
    constant: float
    inertia: float


@dataclasses.dataclass(frozen=True)
class ExactLoop:
    """A loop: law and gains, plant, drive, period and delay. SI units.

    Attributes:
      kind: index of the law in NAMES; gains in the order of GAINS.
      lags: time constants, s; motor: a Motor in place of them, or None.
      periods_late: control periods by which the command is delayed.
    """

    kind: int
    gains: tuple[float, ...]
    period: float
    lags: tuple[float, ...] = ()
    periods_late: int = 0
    motor: Motor | None = None
    M: float = 1.0
    alpha: float = 0.0
    delta: float = 0.0
    x0: float = 0.01

    def matrices(self) -> tuple[np.ndarray, np.ndarray]:
        """Return A (n, n) and B (n,) of the state (x, v, ...) under u."""
        M = self.M
        motor = self.motor
        if motor is not None:
            M += motor.inertia
            R = motor.resistance
            L = motor.inductance
            K = motor.constant
            A = [[0.0, 1.0, 0.0], [-self.alpha / M, -self.delta / M, K / M], [0.0, -K / L, -R / L]]
            return np.array(A), np.array([0.0, 0.0, R / K / L])
        n = 2 + len(self.lags)
        A = np.zeros((n, n))
        B = np.zeros(n)
        A[0, 1], A[1, 0], A[1, 1] = 1.0, -self.alpha / M, -self.delta / M
        for i, lag in enumerate(self.lags, 2):
            A[i, i] = -1.0 / lag
            if i > 2:
                A[i, i - 1] = 1.0 / lag
        if self.lags:
            A[1, n - 1], B[2] = 1.0 / M, 1.0 / self.lags[0]
        else:
            B[1] = 1.0 / M
        return A, B

    def run(self, duration: float) -> tuple[np.ndarray, np.ndarray]:
        """Return times and sliding variable at samples, (K,)."""
        A, B = self.matrices()
        n = len(A)
        block = np.zeros((n + 1, n + 1))
        block[:n, :n], block[:n, n] = A * self.period, B * self.period
        moved = expm(block)
        start = np.zeros(n)
        start[0] = self.x0
        samples = round(duration / self.period)
        Phi = np.ascontiguousarray(moved[:n, :n])
        Gamma = np.ascontiguousarray(moved[:n, n])
        s = _run(
            self.kind,
            np.array(self.gains),
            samples,
            self.period,
            self.periods_late,
            Phi,
            Gamma,
            start,
        )
        return self.period * np.arange(samples), s

    def cycle(self, duration: float = 12.0) -> tuple[float, float]:
        """Return amplitude of s and frequency, Hz, of the limit cycle about rest; NaN, NaN where
        none is steady.
        """
        t, s = self.run(duration)
        first = int(len(t) * (1.0 - LATE))
        middle = (first + len(t)) // 2
        parts = []
        for part in (slice(first, None), slice(first, middle), slice(middle, None)):
            parts.append(measured(t[part], s[part]))
        cycle_of_all, early, late = parts
        steady = all(abs(b / a - 1.0) < STEADY for a, b in zip(early, late, strict=True))
        centred = abs(s[first:].max() + s[first:].min()) < 2.0 * CENTRED * cycle_of_all[0]
        if steady and centred:
            return cycle_of_all
        return (math.nan, math.nan)


def measured(t: np.ndarray, s: np.ndarray) -> tuple[float, float]:
    """Return half the median range of s between its upward crossings of the mean, and their
    frequency, Hz.
    """
    z = s - s.mean()
    up = np.flatnonzero((z[:-1] < 0.0) & (z[1:] >= 0.0))
    if len(up) < 5 or not np.isfinite(s).all():
        return math.nan, math.nan
    crossings = t[up] - z[up] * (t[up + 1] - t[up]) / (z[up + 1] - z[up])
    ranges = []
    for a, b in itertools.pairwise(up):
        ranges.append(np.ptp(s[a : b + 1]))
    return float(np.median(ranges)) / 2.0, float(
        (len(crossings) - 1) / (crossings[-1] - crossings[0])
    )


def random_loop(rng: np.random.Generator) -> ExactLoop:
    """Return a random loop: one of six laws, five periods, one or two lags, a motor or a delay, and
    a plant.
    """
    kind = int(rng.integers(len(NAMES)))
    scaled = []
    for gain in USUAL[kind]:
        scaled.append(gain * 2.0 ** rng.uniform(-1.0, 1.0))
    if kind == 5:
        scaled[2] = rng.uniform(0.3, 0.7)  # an exponent
    if kind in (1, 4):
        scaled[1] = scaled[0] * rng.uniform(0.2, 0.8)
    period = float(rng.choice(PERIODS))
    drive = rng.choice(["lag", "two lags", "motor", "delay", "lag and delay"])
    if "delay" in drive:
        late = int(rng.integers(2, 31))
    else:
        late = 0
    lags = tuple(
        float(10.0 ** rng.uniform(-3.0, -1.5))
        for _ in range({"two lags": 2}.get(drive, int("lag" in drive)))
    )
    motor = None
    if drive == "motor":
        resistance = float(10.0 ** rng.uniform(-1.0, 1.0))
        lag = float(10.0 ** rng.uniform(-3.0, -1.5))
        constant = float(10.0 ** rng.uniform(-1.5, 0.0))
        motor = Motor(resistance, lag * resistance, constant, 0.0)
    return ExactLoop(
        kind=kind,
        gains=tuple(scaled),
        period=period,
        lags=lags,
        periods_late=late,
        motor=motor,
        M=2.0 ** rng.uniform(-1.0, 2.0),
        alpha=float(rng.choice([0.0, 1.0])) * rng.uniform(0.0, 20.0),
        delta=float(rng.choice([0.0, 1.0])) * rng.uniform(0.0, 2.0),
        x0=float(10.0 ** rng.uniform(-3.0, -1.0)),
    )


@njit(cache=True)
def _sign(a):
    if a > 0.0:
        return 1.0
    return -1.0 if a < 0.0 else 0.0


@njit(cache=True)
def _law(kind, g, m, h, x, v):
    """Return u and s of a law with memory m."""
    if kind == 0:
        return -g[0] * _sign(v + g[1] * x), v + g[1] * x
    if kind == 1:
        return -g[0] * _sign(x) - g[1] * _sign(v), x
    if kind == 2:
        s = v + g[2] * x
        u = m[0] - g[0] * math.sqrt(abs(s)) * _sign(s)
        m[0] -= h * g[1] * _sign(s)
        return u, s
    if kind == 3:
        speed = g[1] * math.sqrt(abs(x))
        return (
            -g[0] * (v + speed * _sign(x)) / (abs(v) + speed) if abs(v) + speed > 0.0 else 0.0
        ), x
    if kind == 4:
        if v * m[1] < 0.0 or v == 0.0:
            m[0] = x if abs(x) > abs(m[2]) or v == 0.0 else m[2]
        m[1], m[2] = v, x
        return -g[0] * _sign(x - 0.5 * m[0]) + g[1] * _sign(m[0]), x
    s = v + g[1] * x
    return -g[0] * abs(s) ** g[2] * _sign(s), s


@njit(cache=True)
def _run(kind, gains, samples, h, late, Phi, Gamma, start):
    z = start.copy()
    memory = np.zeros(3)
    us = np.zeros(samples)
    s = np.empty(samples)
    for k in range(samples):
        us[k], s[k] = _law(
            kind,
            gains,
            memory,
            h,
            z[0],
            z[1],
        )
        z = Phi @ z + Gamma * (us[k - late] if k >= late else 0.0)
    return s
