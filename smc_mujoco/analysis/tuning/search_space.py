"""Where gains are searched: one rule for every law, by dimensional analysis of the plant.

The plant gives four scales, and they give every gain its own:

    X = max |x0|        position, rad or m
    F = u_max           force, N m or N; F = u_max / M where the law has the nominal model and speaks in accelerations
    M = 1 / g(0)        inertia, kg m^2 or kg
    T = sqrt(M X / u_max)   time in which the actuator moves the plant by X (by X / 2, from rest)

A gain with the unit of F^a X^b T^c is searched in log space over its scale times 10^-1.5 .. 10^1.5. A gain that is a
force by itself, such as lambda of -lambda tanh(s), is searched up to F: what the actuator cannot give is not a gain.
`SCALES` states a, b, c for each gain of a law, and which gains are held at the value the law came with: initial values,
exponents, table sizes, a plant's parameters, the filters and number formats of a processor. Where an exponent is a
gain, the unit of what stands before the power depends on it: a function of the law's gains gives it.

Units are those for which a law does the same in every system of units (tests/analysis/tuning/test_search_space.py).
Some laws have a number of their own that has a unit, such as the width 1 of tanh(s): their gains have the units that
leave this number as it is. A law without the model that takes g for 1 treats forces and accelerations alike.

Enter the gains of a law of your own before tuning it:


    smc_mujoco.analysis.tuning.search_space.SCALES["my_law"] = {"lam": FORCE, "k1": RATE}
"""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control.component import Component
from smc_mujoco.mechanisms.plant import Plant

DECADES = 1.5  # chosen: to either side of a scale; a factor 1000 in all
NEAR = 0.02  # of a bound's range in log space: as near counts as being at the bound
WIDENING = 1.0  # decades

Box = Mapping[str, tuple[float, float]]  # gain -> lowest, highest


class Unit(NamedTuple):
    """A gain's unit, F^force X^position T^time; a gain that is held is not searched."""

    force: float = 0.0
    position: float = 0.0
    time: float = 0.0
    held: bool = False

    def of(self, scales: Mapping[str, float]) -> float:
        """Its scale, of the plant's scales F, X and T."""
        return scales["F"] ** self.force * scales["X"] ** self.position * scales["T"] ** self.time


Gains = Mapping[str, float]
Units = Mapping[str, Unit | Callable[[Gains], Unit] | None]  # gain -> its unit; None: a number that is held

HELD = None
FORCE = Unit(force=1)
POSITION = Unit(position=1)
TIME = Unit(time=1)
RATE = Unit(time=-1)  # slope of a linear surface, leak, bandwidth
RATE2 = Unit(time=-2)
SPEED = Unit(position=1, time=-1)  # of s = de + c e, its layers and dead zones
ACCELERATION = Unit(position=1, time=-2)
INERTIA = Unit(force=1, position=-1, time=2)
FORCE_RATE = Unit(force=1, time=-1)
FORCE_PER_POSITION = Unit(force=1, position=-1)  # also a gain that grows by |s|: F/T per X/T
FORCE_PER_SPEED = Unit(force=1, position=-1, time=1)
FORCE_PER_ROOT = Unit(force=1, position=-0.5, time=0.5)  # of [s]^(1/2)
PARABOLA = Unit(position=0.5, time=-1)  # of b in de = -b [e]^(1/2)
INPUT_GAIN = Unit(force=-1, position=1, time=-2)  # of b in e'' = b u
SWITCHED = {"k": FORCE, "c": RATE}
TWISTED = {"k1": FORCE_PER_ROOT, "k2": FORCE_RATE, "c": RATE}
FREE = {"lam": FORCE, "k1": RATE}


def held(unit: Unit) -> Unit:
    """The unit of a gain that is not searched."""
    return unit._replace(held=True)


def force_per(exponent: str) -> Callable[[Gains], Unit]:
    """The unit of k in the force k [s]^exponent, where the exponent is a gain."""
    return lambda g: Unit(force=1, position=-g[exponent], time=g[exponent])


SCALES: dict[str, Units] = {  # law -> gain -> its unit
    "none": {},
    "classical": SWITCHED,
    "implicit_first_order": SWITCHED,
    "discrete_time": SWITCHED,
    "boundary_layer": SWITCHED | {"phi": SPEED},
    "exponential_reaching": SWITCHED | {"q": FORCE_PER_SPEED},
    "power_rate": {"k": force_per("a"), "a": HELD, "c": RATE},
    "fixed_time": SWITCHED | {"k1": force_per("a"), "k2": force_per("b"), "a": HELD, "b": HELD},
    "prescribed_time": SWITCHED | {"T": TIME, "m": INERTIA},  # m s / (T - t) is a force
    "discrete_reaching": {"eps": FORCE, "q": FORCE_PER_SPEED, "c": RATE},
    "integral": {"M": FORCE, "c": RATE, "q": RATE},
    "dynamic": {"k": FORCE_RATE, "q": RATE, "c": RATE},
    "fuzzy_gain": {"k_min": FORCE, "k_max": FORCE, "width": SPEED, "rate": ACCELERATION, "c": RATE},
    "adaptive": {"gamma": FORCE_PER_POSITION, "c": RATE, "k0": held(FORCE)},
    "adaptive_leak": {
        "gamma": FORCE_PER_POSITION,
        "c": RATE,
        "leak": RATE,
        "deadzone": SPEED,
        "k0": held(FORCE),
    },
    "barrier_adaptive": {"K0": FORCE_PER_POSITION, "eps": SPEED, "k_max": FORCE, "c": RATE},
    "super_twisting": TWISTED | {"w_max": held(FORCE)},
    "super_twisting_unclamped": TWISTED,
    "conditioned_super_twisting": TWISTED,
    "implicit_super_twisting": TWISTED,
    "proper_super_twisting": TWISTED,
    "adaptive_super_twisting": {
        "rate": Unit(force=1, position=-0.5, time=-0.5),  # of K, which is a force per root, per time
        "eps": Unit(position=0.5, time=-1.5),
        "mu": SPEED,
        "least": FORCE_PER_ROOT,
        "k0": held(FORCE_PER_ROOT),
        "c": RATE,
    },
    "twisting": {"r1": FORCE, "r2": FORCE},
    "suboptimal": {"r1": FORCE, "r2": FORCE},
    "prescribed_convergence": {"a": FORCE, "b": PARABOLA},
    "quasi_continuous": {"a": FORCE, "b": PARABOLA},
    "continuous_twisting": {
        "L": FORCE_RATE,
        "k1": Unit(force=1 / 3, position=-1 / 3, time=2 / 3),  # the cube root of an inertia
        "k2": Unit(force=1 / 2, position=-1 / 2, time=1),  # the square root of one
        "k3": HELD,  # L k3 and L k4 are the integrator's; L alone is searched
        "k4": HELD,
    },
    "nested_third_order": {"a": FORCE, "w": RATE},
    "terminal": {
        "k": FORCE,
        "b": lambda g: Unit(position=1 - g["p"], time=-1),
        "p": HELD,
        "bound": FORCE,
    },
    "nonsingular_terminal": {
        "k": FORCE,
        "B": lambda g: Unit(position=g["p"] - 1, time=-g["p"]),
        "p": HELD,
    },
    "nonsingular_fast_terminal": {
        "k": FORCE,
        "rate": FORCE_PER_POSITION,
        "a": lambda g: Unit(position=1 - g["q"]),
        "q": HELD,
        "b": lambda g: Unit(position=1 - g["p"], time=g["p"]),
        "p": HELD,
    },
    "disturbance_observer": {"k": ACCELERATION, "c": RATE, "l": RATE, "b": INPUT_GAIN},
    "extended_state": {"k": ACCELERATION, "c": RATE, "w": RATE, "b": INPUT_GAIN},
    "observer_free": FREE,
    "observer_free_single": FREE,
    "observer_free_table": FREE | {"size": HELD},
    "observer_free_taylor": FREE | {"terms": HELD},
    "observer_free_q15": FREE | {"e_range": held(POSITION), "de_range": held(SPEED), "u_range": held(FORCE)},
    "observer_free_integral": FREE | {"ki": RATE2},
    "observer_free_adaptive": FREE
    | {"gamma": FORCE_PER_POSITION, "leak": RATE, "deadzone": SPEED, "w_max": held(FORCE)},
    "observer_free_third": {"lam": FORCE, "k1": RATE2, "k2": RATE},
    "pid": {
        "kp": FORCE_PER_POSITION,
        "ki": Unit(force=1, position=-1, time=-1),
        "kd": FORCE_PER_SPEED,
        "tau": held(TIME),
        "tt": TIME,
    },
    "computed_torque": {"kp": FORCE_PER_POSITION, "kd": FORCE_PER_SPEED},
    "lqr": {
        "q1": Unit(force=2, position=-2),
        "q2": Unit(force=2, position=-2, time=2),
        "r": HELD,  # the weights count by their ratios alone
        "a1": held(RATE2),
        "a2": held(RATE),
        "b": held(INPUT_GAIN),
    },
    "swing_up": {
        "k": Unit(position=-1),  # of the force k E
        "q": FORCE_PER_SPEED,
        "J": held(INERTIA),
        "w": held(RATE),
        "part": HELD,
    },
}


def unit(law: Component, gain: str) -> Unit | None:
    """The unit of a law's gain; None of a number that is held.

    Raises:
      ScenarioError: it is not known.
    """
    known = SCALES.get(law.name, {})
    if gain not in known:
        cure = f'enter it in smc_mujoco.analysis.tuning.search_space.SCALES["{law.name}"]'
        raise ScenarioError(f"tuning knows no unit of {law.name}'s gain {gain!r}: {cure}")
    found = known[gain]
    return found(law.gains) if callable(found) else found


def scales(plant: Plant, u_max: float, modelled: bool, reach: float | None = None) -> dict[str, float]:
    """The plant's X, F, M and T in SI units; F is an acceleration for a law that has the model.

    Args:
      reach: X, rad or m. Default: max |x0| of the plant.

    Raises:
      ScenarioError: a plant without a start or an inertia, with channels of two units, or a joint without an actuator.
    """
    if plant.unscaled:
        raise ScenarioError(f"cannot tune on {plant.name}: {plant.unscaled}")
    at_rest = np.zeros(plant.n)
    g = min(abs(plant.nominal(at_rest, at_rest, i, plant.values({}))[1]) for i in range(plant.n))
    X = max(abs(x) for x in plant.x0) if reach is None else reach
    if not X > 0.0:
        cure = "say where its runs begin, with starts=smc.starts(x0=0.5) or --x0 0.5"
        raise ScenarioError(f"{plant.name} starts at 0, where a law has nothing to do: {cure}")
    if not (math.isfinite(g) and g > 0.0):
        raise ScenarioError(f"{plant.name} has g(0) = {g:g}: tuning needs a joint that u moves; choose another plant")
    return {"X": X, "F": u_max * g if modelled else u_max, "M": 1.0 / g, "T": math.sqrt(X / (g * u_max))}


def box(law: Component, plant_scales: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """The bounds between which each gain of a law is searched; gains that are held are not in it.

    Raises:
      ScenarioError: a law or gain whose unit is not known, or nothing to tune.
    """
    found = {}
    for gain in law.gains:
        if (its := unit(law, gain)) is not None and not its.held:
            scale = its.of(plant_scales)
            found[gain] = (scale * 10**-DECADES, scale if its == FORCE else scale * 10**DECADES)
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
    return {gain: side for gain, side in sides.items() if side == "lower" or unit(law, gain) != FORCE}


def widened(bounds: Box, sides: Mapping[str, str]) -> dict[str, tuple[float, float]]:
    """The bounds with those that `movable` found moved outwards by a decade."""
    by = 10**WIDENING
    moved = {"lower": lambda low, high: (low / by, high), "upper": lambda low, high: (low, high * by)}
    return {name: moved[sides[name]](*ends) if name in sides else ends for name, ends in bounds.items()}
