"""Linear theory of laws that are linear at rest: smallest lambda, critical delay, steady error,
tolerated force.

    plant = smc.plant("inverted_pendulum")
    smallest_lam(plant, k1=9.7)                                     # 0.253
    critical_delay(plant, lam=4.4, k1=9.7, control_period=1e-3)     # s, sampled and held
    steady_error(plant, lam=4.4, k1=9.7, d=0.2)                     # rad

At rest the plant is M x'' = -K x - D x' + u + d, x (n,), with M = 1/g, K = -(df/dx)/g (n, n) and D
= -(df/dv)/g of its nominal f and g. M and D are the same on every channel and K is symmetric. So
its eigenvectors divide the plant into n modes that differ only in their stiffness K_j. u = -lam
tanh(x' + k1 x) is -lam (x' + k1 x) there, so that

    M x'' + (D + lam) x' + (K + lam k1) x = d.                                          (1)

Each result below is that of the worst mode. A law with a boundary layer has the same form near s =
0, with lam = k/phi and k1 = c (`linear_gains`). Laws that switch have no linear part, and no theory
here. Source: Routh-Hurwitz for (1), the paper's stability claim is "any lambda > 0"; the crossings
of a delay after K. L. Cooke & Z. Grossman, J. Math. Anal. Appl. 86:592, 1982; sampling after Astrom
& Wittenmark, Computer-Controlled Systems, 1997, chapter 2; the rest derived here.
"""

import dataclasses
import functools
import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

from smc_mujoco.common.aliases import Array, ArrayPair, Pair
from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.constraints import Finite, Natural, Positive, constrained
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control.law import Law
from smc_mujoco.control.nominal_gains import DIFFERENCE_STEP
from smc_mujoco.mechanisms.plant import Plant

EQUALITY_TOLERANCE = 1e-6  # relative: smaller differences count as none
MAX_DISPLACEMENT = 10.0  # rad or m, chosen: beyond the first maximum of every restoring force here
# rad or m, of `restoring_force`: steps of 0.5 %
DISPLACEMENTS = np.geomspace(1e-7, MAX_DISPLACEMENT, 4000)


# linearisation


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Linear:
    """A plant at rest: inertia M and damping D of every channel, stiffness K (n, n); SI units."""

    inertia: float
    damping: float
    stiffness: Array

    @cached_property
    def modes(self) -> Array:
        """The stiffnesses of the modes, (n,), smallest first; a negative one is unstable by
        itself.
        """
        return np.linalg.eigvalsh(self.stiffness)


@functools.lru_cache(maxsize=64)
def linear(plant: Plant) -> Linear:
    """Linearise the nominal plant at x = x' = 0.

    Raise ScenarioError if (1) does not hold for it.
    """
    if plant.unmodelled:
        raise ScenarioError(f"{plant.name} has no nominal model: {plant.unmodelled}")
    n = plant.n
    p = SimpleNamespace(**plant.parameters)
    rest = np.zeros(n)
    g = np.array([plant.nominal(rest, rest, i, p)[1] for i in range(n)])
    if plant.free or plant.mixed or g.min() <= 0.0 or np.ptp(g) > EQUALITY_TOLERANCE * g.max():
        raise ScenarioError(
            f"{plant.name} has no linear theory: give a plant with equal joints and an actuator on "
            "each"
        )

    def slopes(at: Callable[[Array, int], float]) -> Array:
        """Return -d f_i / d z_j / g, (n, n), by central differences."""
        jacobian = np.empty((n, n))
        for j, z in enumerate(DIFFERENCE_STEP * np.eye(n)):
            for i in range(n):
                difference = at(-z, i) - at(z, i)
                jacobian[i, j] = difference / (2.0 * DIFFERENCE_STEP * g[i])
        return jacobian

    stiffness = slopes(lambda x, i: plant.nominal(x, rest, i, p)[0])
    damping = slopes(lambda v, i: plant.nominal(rest, v, i, p)[0])
    d = damping[0, 0]
    small = EQUALITY_TOLERANCE * (1.0 + np.abs(stiffness).max())
    if (
        np.abs(damping - d * np.eye(n)).max() > small
        or np.abs(stiffness - stiffness.T).max() > small
    ):
        raise ScenarioError(
            f"{plant.name} has no linear theory: give a plant whose joints are coupled only by "
            "springs"
        )
    symmetric = (stiffness + stiffness.T) / 2.0
    inertia = float(1.0 / g[0])
    return Linear(inertia=inertia, damping=float(d), stiffness=symmetric)


def linear_gains(law: Law) -> Pair | None:
    """Return lam and k1 of u = -lam (e' + k1 e), the law near s = 0; None if it is not linear
    there.
    """
    rest = law.template and law.template.linear_part
    if rest:
        return rest.linear(SimpleNamespace(**law.gains))
    return None


@functools.lru_cache(maxsize=1024)
def sampled_mode(at: Linear, stiffness: float, h: float) -> ArrayPair:
    """Return E (2, 2) and Gamma (2,) of a mode sampled with period h: z+ = z + E z + Gamma u, z =
    (x, x').

    E is the change over a sample, not the usual Phi = 1 + E, in which rounding would hide the
    change over a short h.
    """
    from scipy.linalg import expm

    drag = -at.damping / at.inertia
    rates = np.array([[0.0, 1.0], [-stiffness / at.inertia, drag]])
    block = np.zeros((4, 4))
    block[:2, :2] = rates * h
    block[:2, 2:] = np.eye(2) * h
    integral = expm(block)[:2, 2:]  # of exp(rates t) over h
    return rates @ integral, integral[:, 1] / at.inertia


# stability


@constrained
def smallest_lam(plant: Plant, k1: Natural) -> float:
    """Return the lam above which (1) is stable in continuous control, at least 0.

    By Routh-Hurwitz both coefficients of (1) must be positive: lam > -D and lam k1 > -K_j for every
    mode. A result of 0 confirms the paper's claim; with inf no lam is enough.
    """
    linearised = linear(plant)
    soft = -float(linearised.modes[0])
    if k1 > 0.0:
        stiff = soft / k1
    else:
        stiff = math.inf if soft >= 0.0 else 0.0
    return max(0.0, -linearised.damping, stiff)


@constrained
def critical_delay(plant: Plant, lam: Natural, k1: Natural, control_period: Positive) -> float:
    """Return the input delay in s up to which (1) is stable: 0 if it is unstable without one, inf
    if any is allowed.

    With a delay of m periods h the equation of a mode is 1 + z^-m N(w) / det(w - E) = 0, with w = z
    - 1 and N = lam (k1, 1) adj(w - E) Gamma. |N| = |det| on the circle |z| = 1 is a quadratic in y
    = |w|^2 / 2. The phase gives an m that is not whole: the loop is stable for all whole numbers
    below it, and unstable at the next. A loop whose gain is above 1 at the highest frequency, z =
    -1, tolerates less than one period. A loop with a stiff spring, K_j > lam k1, may be stable
    again with a longer delay.
    """
    linearised = linear(plant)
    if lam:
        return min(
            _crossing(linearised, stiffness, lam, k1, control_period)
            for stiffness in linearised.modes
        )
    return 0.0


def _crossing(at: Linear, stiffness: float, lam: float, k1: float, h: float) -> float:
    """Return the delay at which a sampled mode first becomes unstable, s."""
    e, gamma = sampled_mode(at, stiffness, h)
    t = np.trace(e)
    d = np.linalg.det(e)
    row = lam * np.array([k1, 1.0])
    adjugate = np.array([[e[1, 1], -e[0, 1]], [-e[1, 0], e[0, 0]]])
    n1, n0 = row @ gamma, -row @ adjugate @ gamma  # adj(w - E) = w - adj(E)
    # of the change of the loop without delay over a sample: Jury's conditions
    trace = t - n1
    determinant = d + n0
    if min(determinant, -trace - determinant, 4.0 + 2.0 * trace + determinant) <= 0.0:
        return 0.0
    if n0 - 2.0 * n1 >= 4.0 + 2.0 * t + d:
        periods = [1.0]
    else:
        periods = [math.inf]
    # |w^2 - t w + d|^2 = |n1 w + n0|^2 where |w|^2 = 2 y and w + conj(w) = -2 y
    equation = (
        4.0 * (1.0 + t + d),
        2.0 * (t * t + t * d - 2.0 * d - n1 * n1 + n1 * n0),
        d * d - n0 * n0,
    )
    for root in np.roots(equation):
        if abs(root.imag) <= 1e-9 * abs(root) and 0.0 < (y := float(root.real)) <= 2.0:
            imaginary = math.sqrt(y * (2.0 - y))
            w = complex(-y, imaginary)
            numerator = n1 * w + n0
            denominator = w * w - t * w + d
            turned = np.angle(-numerator / denominator) % math.tau
            angle = 2.0 * math.asin(math.sqrt(y / 2.0))
            periods.append(turned / angle)
    return float(h * min(periods))


# at rest


@constrained
def steady_error(plant: Plant, lam: Natural, k1: Natural, d: Finite) -> float:
    """Return |x| at rest of (1) under a constant d on every channel, worst channel, rad or m: |d| /
    (lam k1 + K).
    """
    sliding = lam * k1 * np.eye(plant.n)
    loop = linear(plant).stiffness + sliding
    x = np.linalg.solve(loop, np.full(plant.n, d))
    return float(np.abs(x).max())


def restoring_force(
    plant: Plant, law: Law, u_max: float = math.inf
) -> Callable[[Array], Array] | None:
    """Return the force, N or N m, that pulls all channels back from the same x > 0, (k,), or None
    without theory.
    """
    rest = law.template and law.template.linear_part
    gains = SimpleNamespace(**law.gains)
    if not rest:
        return None
    linear(plant)  # raises for a plant without linear theory
    p = SimpleNamespace(**plant.parameters)
    v = np.zeros(plant.n)
    ratios = []
    for i in range(plant.n):
        ones = np.full(plant.n, 1.0)
        f, g = plant.nominal(ones, v, i, p)
        ratios.append(f / g)
    scale = 1.0 + abs(ratios[0])
    if np.ptp(ratios) > EQUALITY_TOLERANCE * scale:
        raise ScenarioError(
            f"{plant.name} has no linear theory at rest: give a plant with equal joints"
        )

    def force(x: Array) -> Array:
        at_rest = []
        for position in x:
            places = np.full(plant.n, position)
            f, g = plant.nominal(places, v, 0, p)
            at_rest.append(f / g)
        forces = rest.force(gains, x)
        return np.minimum(forces, u_max) - np.array(at_rest)

    return force


@constrained
def tolerated_force(
    plant: Plant, law: Law, max_error: Positive, u_max: float = math.inf
) -> float | None:
    """Return the largest constant d, or dry friction, with which the plant comes to rest within |x|
    <= max_error.

    None for a law that is not linear near s = 0. Dry friction up to this level may also stop the
    plant closer to 0.
    """
    from scipy.optimize import minimize_scalar

    force = restoring_force(plant, law, u_max)
    if force is None:
        return None
    forces = np.r_[0.0, force(DISPLACEMENTS)]
    falls = np.flatnonzero(np.diff(forces) < 0.0)
    # of the DISPLACEMENTS up to the force's first maximum
    if falls.size:
        size = falls[0]
    else:
        size = DISPLACEMENTS.size
    ends = DISPLACEMENTS[max(size - 2, 0)], DISPLACEMENTS[min(size, DISPLACEMENTS.size - 1)]
    peak: Any = minimize_scalar(
        lambda x: -float(force(np.array([x]))[0]),
        bounds=ends,
        method="bounded",
        options={"xatol": 1e-9 * ends[1]},
    )
    return max(
        -float(peak.fun) if max_error >= peak.x else float(force(np.array([max_error]))[0]), 0.0
    )
