"""Gains from a plant's nominal f and g, by textbook formulas."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np

from smc_mujoco.common.errors import ScenarioError, items_of, shown
from smc_mujoco.control.law import Law, library_law
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant

# rad or m, and per second, of central differences: about the cube root of the rounding error
DIFFERENCE_STEP = 1e-6


def linearised(plant: Plant, law: str) -> tuple[float, float, float]:
    """Return a1, a2, b of x'' = a1 x + a2 x' + b u at the origin, for the law of that name.

    For a network they are those of its least stable channel, with the neighbours at rest.
    """
    if plant.unmodelled:
        raise ScenarioError(
            f"{plant.name} has no nominal model to take {law}'s a1, a2 and b from: "
            f"{plant.unmodelled}, "
            f'or give the three, as in smc.law("{law}", a1=0.0, a2=0.0, b=1.0)'
        )
    if plant.free:
        raise ScenarioError(
            f"{plant.name}'s channel {plant.driven} has no actuator, and {law} does not see "
            "such a joint: take the law 'hierarchical', which does"
        )
    p = SimpleNamespace(**plant.parameters)
    rest = np.zeros(plant.n)
    rows = []
    for i, moved in enumerate(DIFFERENCE_STEP * np.eye(plant.n)):
        f = []
        for x in (moved, -moved):
            f.append(plant.nominal(x, rest, i, p)[0])
        f += [plant.nominal(rest, v, i, p)[0] for v in (moved, -moved)]
        slopes = (f[0] - f[1]) / (2.0 * DIFFERENCE_STEP), (f[2] - f[3]) / (2.0 * DIFFERENCE_STEP)
        rows.append((*slopes, plant.nominal(rest, rest, i, p)[1]))
    return max(rows)


def at_plant(law: Law, plant: Plant) -> Law:
    """Return a law with the values of `linearised` for those of its gains a1, a2 and b that were
    not given.
    """
    if law.channel_laws:
        return dataclasses.replace(
            law,
            channel_laws=tuple(at_plant(channel_law, plant) for channel_law in law.channel_laws),
        )
    declared = law.template.gains if law.template else {}
    missing = {}
    for name, value in law.gains.items():
        if name in declared and declared[name].plant and value == math.inf:
            missing[name] = declared[name].plant
    if not missing:
        return law
    values = linearised(plant, law.name)
    order = ("a1", "a2", "b")
    gains = dict(law.gains)
    for name, of_plant in missing.items():
        gains[name] = values[order.index(of_plant)]
    return dataclasses.replace(law, gains=gains).sourced(law.source.kind, law.source.search)


def lqr(plant: Plant | str, q: tuple[float, float] = (100.0, 16.0), r: float = 1.0) -> Law:
    """Return the law `lqr` for a plant at the origin, which minimises the integral of q[0] e^2 +
    q[1] de^2 + r u^2.

    Args:
      plant: a Plant or the name of one.
      q: weights of error and rate, the plant's units.
      r: weight of the control.

    Raises:
      ScenarioError: a weight out of range, or a joint without an actuator.
    """
    a1, a2, b = linearised(as_plant(plant), "lqr")
    if len(weights := items_of("q", q)) != 2:
        raise ScenarioError(f"q is {shown(q)}: give two weights, of error and rate")
    return library_law("lqr", q1=weights[0], q2=weights[1], r=r, a1=a1, a2=a2, b=b)
