"""Linearisation at rest: the plant as M x'' = -K x - D x' + u + d, and the laws that are linear there.

    at = linear(smc.plant("pendulum_network"))
    at.inertia, at.damping, at.modes        # kg m^2, N m s/rad, (n,) N m/rad

x is (n,); M = 1/g, K = -(df/dx)/g (n, n) and D = -(df/dv)/g come from the plant's nominal f and g. M and D are the same
on every channel and K is symmetric. So its eigenvectors divide the plant into n modes that differ only in stiffness.
"""

import dataclasses
import functools
import math
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control.design import DIFFERENCE_STEP
from smc_mujoco.control.law import Law
from smc_mujoco.mechanisms.plant import Plant

EQUALITY_TOLERANCE = 1e-6  # relative: smaller differences count as none
MAX_DISPLACEMENT = 10.0  # rad or m, chosen: beyond the first maximum of every restoring force here
DISPLACEMENTS = np.geomspace(1e-7, MAX_DISPLACEMENT, 4000)  # rad or m, of `restoring_force`: steps of 0.5 %


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Linear:
    """A plant at rest: inertia M and damping D of every channel, stiffness K (n, n); SI units."""

    inertia: float
    damping: float
    stiffness: np.ndarray

    @functools.cached_property
    def modes(self) -> np.ndarray:
        """The stiffnesses of the modes, (n,), smallest first; a negative one is unstable by itself."""
        return np.linalg.eigvalsh(self.stiffness)


@functools.lru_cache(maxsize=64)
def linear(plant: Plant) -> Linear:
    """Linearise the nominal plant at x = x' = 0.

    Raises:
      ScenarioError: channels without an actuator, with different units, inertias or dampings, or with a coupling other
        than springs.
    """
    if plant.unmodelled:
        raise ScenarioError(f"{plant.name} has no nominal model: {plant.unmodelled}")
    n, p = plant.n, SimpleNamespace(**plant.parameters)
    rest = np.zeros(n)
    g = np.array([plant.nominal(rest, rest, i, p)[1] for i in range(n)])
    if plant.underactuated or plant.mixed or g.min() <= 0.0 or np.ptp(g) > EQUALITY_TOLERANCE * g.max():
        raise ScenarioError(f"{plant.name} has no theory here: give a plant with equal joints and an actuator on each")

    def slopes(at: Callable[[np.ndarray, int], float]) -> np.ndarray:
        """Return -d f_i / d z_j / g, (n, n), by central differences."""
        steps = DIFFERENCE_STEP * np.eye(n)
        return np.array([[(at(-z, i) - at(z, i)) / (2.0 * DIFFERENCE_STEP * g[i]) for z in steps] for i in range(n)])

    stiffness = slopes(lambda x, i: plant.nominal(x, rest, i, p)[0])
    damping = slopes(lambda v, i: plant.nominal(rest, v, i, p)[0])
    d, small = damping[0, 0], EQUALITY_TOLERANCE * (1.0 + np.abs(stiffness).max())
    if np.abs(damping - d * np.eye(n)).max() > small or np.abs(stiffness - stiffness.T).max() > small:
        raise ScenarioError(f"{plant.name} has no theory here: give a plant whose joints are coupled only by springs")
    return Linear(inertia=float(1.0 / g[0]), damping=float(d), stiffness=(stiffness + stiffness.T) / 2.0)


def linear_gains(law: Law) -> tuple[float, float] | None:
    """Return lam and k1 of u = -lam (e' + k1 e), the law near s = 0; None if it is not linear there."""
    rest = law.template and law.template.rest
    return rest.linear(SimpleNamespace(**law.gains)) if rest else None


@functools.lru_cache(maxsize=1024)
def sampled_mode(at: Linear, stiffness: float, h: float) -> tuple[np.ndarray, np.ndarray]:
    """Return E (2, 2) and Gamma (2,) of a mode sampled with period h: z+ = z + E z + Gamma u, z = (x, x').

    E is the change over a sample, not the usual Phi = 1 + E, in which rounding would hide the change over a short h.
    """
    from scipy.linalg import expm

    rates, block = np.array([[0.0, 1.0], [-stiffness / at.inertia, -at.damping / at.inertia]]), np.zeros((4, 4))
    block[:2, :2], block[:2, 2:] = rates * h, np.eye(2) * h
    integral = expm(block)[:2, 2:]  # of exp(rates t) over h
    return rates @ integral, integral[:, 1] / at.inertia


def restoring_force(plant: Plant, law: Law, u_max: float = math.inf) -> Callable[[np.ndarray], np.ndarray] | None:
    """Return the force of law and plant that pulls every channel back from the same x > 0, as a function of x, (k,).

    It is in N or N m; None for a law without linear part.
    """
    rest, gains = law.template and law.template.rest, SimpleNamespace(**law.gains)
    if not rest:
        return None
    linear(plant)  # raises for a plant without linear theory
    p, v = SimpleNamespace(**plant.parameters), np.zeros(plant.n)
    ratios = [plant.nominal(np.full(plant.n, 1.0), v, i, p) for i in range(plant.n)]
    if np.ptp([f / g for f, g in ratios]) > EQUALITY_TOLERANCE * (1.0 + abs(ratios[0][0] / ratios[0][1])):
        raise ScenarioError(f"{plant.name} has no theory at rest: give a plant with equal joints")

    def force(x: np.ndarray) -> np.ndarray:
        nominal = [plant.nominal(np.full(plant.n, each), v, 0, p) for each in x]
        return np.minimum(rest.force(gains, x), u_max) - np.array([f / g for f, g in nominal])

    return force


def rising_part(force: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return the force of `restoring_force` at DISPLACEMENTS, up to its first maximum."""
    values = force(DISPLACEMENTS)
    falls = np.flatnonzero(np.diff(np.r_[0.0, values]) < 0.0)
    return values[: falls[0]] if falls.size else values
