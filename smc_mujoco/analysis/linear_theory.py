"""Linear theory of the paper's law at rest: smallest lambda, critical delay, steady error.

    plant = smc.plant("inverted_pendulum")
    smallest_lam(plant, k1=9.7)                                # 0.253
    critical_delay(plant, lam=4.4, k1=9.7)                     # s, continuous control
    critical_delay(plant, lam=4.4, k1=9.7, control_period=1e-3)    # s, sampled and held, as in a run
    steady_error(plant, lam=4.4, k1=9.7, d=0.2)                # rad

At rest the plant is M x'' = -K x - D x' + u + d (`linear`) and u = -lam tanh(x' + k1 x) is -lam (x' + k1 x), so that

    M x'' + (D + lam) x' + (K + lam k1) x = d,                                                          (1)

in n modes that differ only in their stiffness K_j. Each result below is that of the worst mode. A law with a boundary
layer has the same form near s = 0, with lam = k/phi and k1 = c (`linearisation.linear_gains`). Laws that switch have no
linear part, and no theory here.
Source: Routh-Hurwitz for (1), the paper's stability claim is "any lambda > 0"; the crossings of a delay after
K. L. Cooke & Z. Grossman, J. Math. Anal. Appl. 86:592, 1982; sampling after Astrom & Wittenmark, Computer-Controlled
Systems, 1997, chapter 2; the rest derived here.
"""

import math
from collections.abc import Callable

import numpy as np

from smc_mujoco.analysis.linearisation import DISPLACEMENTS, Linear, linear, restoring_force, rising_part, sampled_mode
from smc_mujoco.common.errors import number
from smc_mujoco.control.law import Law
from smc_mujoco.mechanisms.plant import Plant

# stability


def smallest_lam(plant: Plant, k1: float) -> float:
    """Return the lam above which (1) is stable in continuous control, at least 0.

    By Routh-Hurwitz both coefficients of (1) must be positive: lam > -D and lam k1 > -K_j for every mode. A result of 0
    confirms the paper's claim; with inf no lam is enough.
    """
    k1, at = number("k1", k1, low=0.0), linear(plant)
    soft = -float(at.modes[0])
    stiff = soft / k1 if k1 > 0.0 else (math.inf if soft >= 0.0 else 0.0)
    return max(0.0, -at.damping, stiff)


def lam_range(plant: Plant, k1: float, control_period: float) -> tuple[float, float]:
    """Return the range of lam in which the sampled loop without delay is stable; (inf, inf) if there is none.

    Over a sample a mode moves exactly by z+ = z + E z + Gamma u, with z = (x, x') and u = -lam (k1, 1) z. Jury's
    conditions, with t and d the trace and determinant of the closed loop's E, are d > 0, t + d < 0 and 4 + 2 t + d > 0,
    all affine in lam.
    """
    k1, at = number("k1", k1, low=0.0), linear(plant)
    low, high = 0.0, math.inf
    for stiffness in at.modes:
        e, gamma = sampled_mode(at, stiffness, control_period)
        row = np.array([k1, 1.0])
        t, d = np.array([np.trace(e), -row @ gamma]), np.array([np.linalg.det(e), -row @ _adjugate(e) @ gamma])
        for a, b in (d, -t - d, np.array([4.0, 0.0]) + 2.0 * t + d):
            if b > 0.0:
                low = max(low, -a / b)
            elif b < 0.0:
                high = min(high, -a / b)
            elif a <= 0.0:
                return math.inf, math.inf
    return (float(low), float(high)) if low < high else (math.inf, math.inf)


def critical_delay(plant: Plant, lam: float, k1: float, control_period: float = 0.0) -> float:
    """Return the input delay in s up to which (1) is stable: 0 if it is unstable without delay, inf if it never is.

    A loop with a stiff spring, K_j > lam k1, may be stable again with a longer delay.

    Continuous (control_period 0): the roots of a mode, M s^2 + D s + K + lam (s + k1) exp(-s tau) = 0, cross to the
    right at s = j w where |K - M w^2 + j D w| = lam |j w + k1|. This is a quadratic in w^2 without tau; the phase at w
    then gives tau. Holding the input over h acts like an additional delay of h/2.

    Sampled (control_period h): with a delay of m periods the equation is 1 + z^-m N(w) / det(w - E) = 0, with w = z - 1
    and N = lam (k1, 1) adj(w - E) Gamma. |N| = |det| on the circle |z| = 1 is a quadratic in y = |w|^2 / 2. The phase
    gives an m that is not whole: the loop is stable for all whole numbers below it, and unstable at the next. A loop
    whose gain is above 1 at the highest frequency, z = -1, tolerates less than one period.
    """
    lam, k1 = number("lam", lam, low=0.0), number("k1", k1, low=0.0)
    at, h = linear(plant), number("control_period", control_period, low=0.0)
    if h:
        low, high = lam_range(plant, k1, h)
        return min(_sampled_crossing(at, k, lam, k1, h) for k in at.modes) if low < lam < high else 0.0
    return min(_crossing(at, k, lam, k1) for k in at.modes) if lam > smallest_lam(plant, k1) else 0.0


def _crossing(at: Linear, stiffness: float, lam: float, k1: float) -> float:
    """Return the delay at which a mode first becomes unstable, s."""
    m, d, k = at.inertia, at.damping, stiffness
    delays = [math.inf]
    for square in _roots(m * m, d * d - 2.0 * m * k - lam * lam, k * k - (lam * k1) ** 2):
        if square > 0.0:
            w = math.sqrt(square)
            turned = np.angle(-lam * (k1 + 1j * w) / (k - m * w * w + 1j * d * w))  # = w tau, modulo a turn
            delays.append(turned % math.tau / w)
    return float(min(delays))


def _sampled_crossing(at: Linear, stiffness: float, lam: float, k1: float, h: float) -> float:
    """Return the delay at which a sampled mode first becomes unstable, s."""
    e, gamma = sampled_mode(at, stiffness, h)
    t, d, row = np.trace(e), np.linalg.det(e), lam * np.array([k1, 1.0])
    n1, n0 = row @ gamma, -row @ _adjugate(e) @ gamma  # adj(w - E) = w - adj(E)
    periods = [1.0] if n0 - 2.0 * n1 >= 4.0 + 2.0 * t + d else [math.inf]
    # |w^2 - t w + d|^2 = |n1 w + n0|^2 where |w|^2 = 2 y and w + conj(w) = -2 y
    for y in _roots(4.0 * (1.0 + t + d), 2.0 * (t * t + t * d - 2.0 * d - n1 * n1 + n1 * n0), d * d - n0 * n0):
        if 0.0 < y <= 2.0:
            w = complex(-y, math.sqrt(y * (2.0 - y)))
            turned = np.angle(-(n1 * w + n0) / (w * w - t * w + d)) % math.tau
            periods.append(turned / (2.0 * math.asin(math.sqrt(y / 2.0))))
    return float(h * min(periods))


def _roots(a: float, b: float, c: float) -> list[float]:
    """Return the real roots of a z^2 + b z + c."""
    return [float(z.real) for z in np.roots([a, b, c]) if abs(z.imag) <= 1e-9 * abs(z)]


def _adjugate(m: np.ndarray) -> np.ndarray:
    return np.array([[m[1, 1], -m[0, 1]], [-m[1, 0], m[0, 0]]])


# at rest


def steady_error(plant: Plant, lam: float, k1: float, d: float) -> float:
    """Return |x| at rest of (1) under a constant d on every channel, worst channel, rad or m.

    For one joint it is |d| / (lam k1 + K).
    """
    lam, k1, d = number("lam", lam, low=0.0), number("k1", k1, low=0.0), number("d", d)
    at = linear(plant)
    loop = at.stiffness + lam * k1 * np.eye(plant.n)
    return float(np.abs(np.linalg.solve(loop, np.full(plant.n, d))).max())


def tolerated_force(plant: Plant, law: Law, max_error: float, u_max: float = math.inf) -> float | None:
    """Return the largest constant d, or dry friction, with which the plant comes to rest within |x| <= max_error.

    It is in N or N m, max_error in rad or m; None for a law without linear part. Dry friction up to this level cannot
    hold the plant further out, but it may stop it closer to 0.
    """
    force = restoring_force(plant, law, u_max)
    if force is None:
        return None
    max_error = number("max_error", max_error, above=0.0)
    place, highest = _peak(force, rising_part(force).size)
    return max(highest if max_error >= place else float(force(np.array([max_error]))[0]), 0.0)


def _peak(force: Callable[[np.ndarray], np.ndarray], size: int) -> tuple[float, float]:
    """Return the place and the size of the maximum of a force that rises over the first `size` of DISPLACEMENTS."""
    from scipy.optimize import minimize_scalar

    ends = DISPLACEMENTS[max(size - 2, 0)], DISPLACEMENTS[min(size, DISPLACEMENTS.size - 1)]
    peak = minimize_scalar(
        lambda x: -float(force(np.array([x]))[0]), bounds=ends, method="bounded", options={"xatol": 1e-9 * ends[1]}
    )
    return float(peak.x), -float(peak.fun)
