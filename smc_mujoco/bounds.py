"""Where gains are searched: one rule for every law, by dimensional analysis of the plant.

The plant gives four scales, and they give every gain its own:

    X = max |x0|        position, rad or m
    F = u_max           force, N m or N; F = u_max / M where the law has the nominal model and speaks in accelerations
    M = 1 / g(0)        inertia, kg m^2 or kg
    T = sqrt(M X / u_max)   time in which the actuator moves the plant by X (by X / 2, from rest)

A gain with the unit of F^a X^b T^c is searched in log space over its scale times 10^-1.5 .. 10^1.5. A gain that is a
force by itself, such as lambda of -lambda tanh(s), is searched up to F: what the actuator cannot give is not a gain.
`SCALES` states a, b, c for each gain of a law, or that the gain is held at the value the law came with: initial values,
exponents, table sizes and the filters of a sensor are no gains. Enter the gains of a law of your own before tuning it:

    smc_mujoco.bounds.SCALES["my_law"] = {"lam": FORCE, "k1": RATE}
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from smc_mujoco.component import Component
from smc_mujoco.errors import ScenarioError
from smc_mujoco.plant import Plant

DECADES = 1.5  # chosen: to either side of a scale; a factor 1000 in all
NEAR = 0.02  # of a bound's range in log space: as near counts as being at the bound
WIDENING = 1.0  # decades

Box = Mapping[str, tuple[float, float]]  # gain -> lowest, highest


class Unit(NamedTuple):
    """A gain's unit, F^force X^position T^time."""

    force: float = 0.0
    position: float = 0.0
    time: float = 0.0

    def of(self, scales: Mapping[str, float]) -> float:
        """Its scale, of the plant's scales F, X and T."""
        return scales["F"] ** self.force * scales["X"] ** self.position * scales["T"] ** self.time


HELD = None
FORCE = Unit(force=1)
RATE = Unit(time=-1)  # slope of a linear surface, leak, bandwidth
RATE2 = Unit(time=-2)
TIME = Unit(time=1)
SPEED = Unit(position=1, time=-1)  # of s = de + c e, its layers and dead zones
FORCE_RATE = Unit(force=1, time=-1)
FORCE_PER_POSITION = Unit(force=1, position=-1)  # also a gain that grows by |s|: F/T per X/T
FORCE_PER_SPEED = Unit(force=1, position=-1, time=1)
FORCE_PER_ROOT = Unit(force=1, position=-0.5, time=0.5)  # of [s]^(1/2)
SWITCHED = {"k": FORCE, "c": RATE}
TWISTED = {"k1": FORCE_PER_ROOT, "k2": FORCE_RATE, "c": RATE}
FREE = {"lam": FORCE, "k1": RATE}

SCALES: dict[str, Mapping[str, Unit | None]] = {  # law -> gain -> its unit
    "classical": SWITCHED,
    "implicit_first_order": SWITCHED,
    "discrete_time": SWITCHED,
    "boundary_layer": SWITCHED | {"phi": SPEED},
    "exponential_reaching": SWITCHED | {"q": FORCE_PER_SPEED},
    "dynamic": {"k": FORCE_RATE, "q": RATE, "c": RATE},
    "adaptive": {"gamma": FORCE_PER_POSITION, "c": RATE, "k0": HELD},
    "adaptive_leak": {"gamma": FORCE_PER_POSITION, "c": RATE, "leak": RATE, "deadzone": SPEED, "k0": HELD},
    "super_twisting": TWISTED,
    "conditioned_super_twisting": TWISTED,
    "implicit_super_twisting": TWISTED,
    "proper_super_twisting": TWISTED,
    "twisting": {"r1": FORCE, "r2": FORCE},
    "observer_free": FREE,
    "observer_free_single": FREE,
    "observer_free_table": FREE | {"size": HELD},
    "observer_free_taylor": FREE | {"terms": HELD},
    "observer_free_integral": FREE | {"ki": RATE2},
    "observer_free_adaptive": FREE | {"gamma": FORCE_PER_POSITION, "leak": RATE, "deadzone": SPEED, "w_max": HELD},
    "pid": {
        "kp": FORCE_PER_POSITION,
        "ki": Unit(force=1, position=-1, time=-1),
        "kd": FORCE_PER_SPEED,
        "tau": HELD,
        "tt": TIME,
    },
    "computed_torque": {"kp": FORCE_PER_POSITION, "kd": FORCE_PER_SPEED},
}


def scales(plant: Plant, u_max: float, modelled: bool) -> dict[str, float]:
    """The plant's X, F, M and T in SI units; F is an acceleration for a law that has the model.

    Raises:
      ScenarioError: a plant without a start or an inertia, with channels of two units, or a joint without an actuator.
    """
    if plant.underactuated or plant.mixed:
        raise ScenarioError(f"{plant.name} has free joints, or channels of two units: tune on a plant that has neither")
    at_rest = np.zeros(plant.n)
    g = min(abs(plant.nominal(at_rest, at_rest, i, plant.values({}))[1]) for i in range(plant.n))
    X = max(abs(x) for x in plant.x0)
    if not (X > 0.0 and math.isfinite(g) and g > 0.0):
        raise ScenarioError(f"{plant.name} has x0 = {plant.x0} and g(0) = {g:g}: tuning needs both other than 0")
    return {"X": X, "F": u_max * g if modelled else u_max, "M": 1.0 / g, "T": math.sqrt(X / (g * u_max))}


def box(law: Component, plant_scales: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """The bounds between which each gain of a law is searched; gains that are held are not in it.

    Raises:
      ScenarioError: a law or gain whose unit is not known, or nothing to tune.
    """
    known, found = SCALES.get(law.name, {}), {}
    for gain in law.gains:
        if gain not in known:
            cure = f'enter it in smc_mujoco.bounds.SCALES["{law.name}"]'
            raise ScenarioError(f"tuning knows no unit of {law.name}'s gain {gain!r}: {cure}")
        if (unit := known[gain]) is not None:
            scale = unit.of(plant_scales)
            found[gain] = (scale * 10**-DECADES, scale if unit == FORCE else scale * 10**DECADES)
    if not found:
        raise ScenarioError(f"law {law.name!r} has no gain to tune: choose another")
    return found


def at_bound(gains: Mapping[str, float], bounds: Box) -> dict[str, str]:
    """The gains within 2 % of a bound, on the scale of logarithms: gain -> "lower" or "upper"."""
    found = {}
    for name, (low, high) in bounds.items():
        place = math.log(gains[name] / low) / math.log(high / low)
        if min(place, 1.0 - place) <= NEAR:
            found[name] = "lower" if place < 0.5 else "upper"
    return found


def movable(law: Component, sides: Mapping[str, str]) -> dict[str, str]:
    """What `at_bound` found, less the gains that are at the actuator's own bound, which is not moved."""
    return {gain: side for gain, side in sides.items() if side == "lower" or SCALES[law.name][gain] != FORCE}


def widened(bounds: Box, sides: Mapping[str, str]) -> dict[str, tuple[float, float]]:
    """The bounds with those that `movable` found moved outwards by a decade."""
    by = 10**WIDENING
    moved = {"lower": lambda low, high: (low / by, high), "upper": lambda low, high: (low, high * by)}
    return {name: moved[sides[name]](*ends) if name in sides else ends for name, ends in bounds.items()}
