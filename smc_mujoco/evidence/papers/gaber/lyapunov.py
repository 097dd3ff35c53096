"""The paper's Lyapunov function along its closed loop, exactly:

V = s^2 / 2, s = alpha - u / g, and its rate.

    x, v = plane(plant, k1)                                    # a grid of states
    rate = vdot(plant, lam, k1, x, v)        # V' at each; the paper says V' < 0 wherever s != 0

With alpha = v + k1 x and u = -lam tanh(alpha), on x'' = f(x, v) + g u,

    s       = alpha + (lam / g) tanh(alpha)
    alpha'  = f - lam g tanh(alpha) + k1 v                                                (1)
    s'      = (1 + (lam / g) / cosh(alpha)^2) alpha'      for a constant g, as all plants have
    V'      = s s'                                                                        (2)

So V rises beside alpha = 0 wherever f(x, -k1 x) is not k1^2 x, see docs/mathematics.md.

A network is synchronised: with equal angles and rates its springs are relaxed and each channel is
one pendulum. Such a state with V' > 0 is a state of the whole network. Source: J. Gaber,
"Observer-Free Sliding Mode Control via Structured Decomposition", stability analysis; (1) and (2)
derived here.
"""

from types import SimpleNamespace

import numpy as np

from smc_mujoco.common.aliases import Array, ArrayPair
from smc_mujoco.mechanisms.plant import Plant

GRID_POINTS = 201  # of a grid along each axis: odd, so that it has the origin
SURFACE_TOLERANCE = 1e-6  # |s| at and below which the claim on V' says nothing
GRID_REACH = (
    2.0  # times the largest |x0|, chosen: the states from which the study starts lie well within
)


def surface(plant: Plant, lam: float, k1: float, x: Array, v: Array) -> Array:
    """Return the paper's s = alpha - u / g in the states (x, v), arrays of one shape; in m/s or
    rad/s, as alpha.
    """
    alpha = v + k1 * x
    return alpha + lam / _model(plant, x, v)[1] * np.tanh(alpha)


def vdot(plant: Plant, lam: float, k1: float, x: Array, v: Array) -> Array:
    """Return V' by (2) in the states (x, v), in the squared unit of s per second; u is not
    saturated.
    """
    x, v = np.asarray(x, float), np.asarray(v, float)
    f, g = _model(plant, x, v)
    alpha = v + k1 * x
    bend = np.tanh(alpha)
    s = alpha + lam / g * bend
    return s * (1.0 + lam / g * (1.0 - bend**2)) * (f - lam * g * bend + k1 * v)


def plane(plant: Plant, k1: float, points: int = GRID_POINTS) -> ArrayPair:
    """Return a grid of states: x up to GRID_REACH |x0|, v up to k1 times that.

    On one diagonal alpha is 0.
    """
    reach = GRID_REACH * max(map(abs, plant.x0))
    x = np.linspace(-reach, reach, points)
    grid = np.meshgrid(x, k1 * x)
    return grid[0], grid[1]


def input_gain(plant: Plant) -> float:
    """Return g at rest, which on the study's plants is g everywhere; x'' = f + g u."""
    return float(_model(plant, np.zeros(1), np.zeros(1))[1][0])


def _model(plant: Plant, x: Array, v: Array) -> ArrayPair:
    """Return f and g of the first channel, with every channel in the same state."""
    p = SimpleNamespace(**plant.parameters)
    pairs = zip(np.ravel(x).tolist(), np.ravel(v).tolist(), strict=True)
    values = np.array(
        [plant.nominal(np.full(plant.n, a), np.full(plant.n, b), 0, p) for a, b in pairs]
    )
    return values[:, 0].reshape(np.shape(x)), values[:, 1].reshape(np.shape(x))
