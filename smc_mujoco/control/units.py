"""Gains and their units.

    @law_function(gains={"lam": Gain(6.0, FORCE, positive=True), "k1": Gain(2.5, RATE)})

The units are FORCE, POSITION, TIME, RATE, RATE2, SPEED, ACCELERATION, INERTIA, FORCE_RATE,
FORCE_PER_POSITION, FORCE_PER_SPEED, FORCE_PER_ROOT, SPEED_PER_ROOT and INPUT_GAIN; a plain number
has Unit(). The slope c of a surface has the unit RATE. SLOPE, ASSUMED_B and AHEAD_B are whole
gains, {"c": SLOPE}, and other names in capitals are sets of gains of the library's laws.

A unit is a product of powers of force F, position X and time T. Tuning derives the bounds of each
gain from its unit and from F, X and T of the plant (`smc_mujoco.analysis.tuning.search_space`).
Tests use the units to check that a law behaves the same in every system of units.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from smc_mujoco.common.constraints import Each, Number


class Unit(NamedTuple):
    """A unit, F^force X^position T^time."""

    force: float = 0.0
    position: float = 0.0
    time: float = 0.0

    def of(self, scales: Mapping[str, float]) -> float:
        """Return the size of the unit for these sizes of F, X and T."""
        return scales["F"] ** self.force * scales["X"] ** self.position * scales["T"] ** self.time

    @property
    def rates(self) -> float:
        """The power of 1 / T that it has with an inertia in place of a force, F = M X / T^2."""
        return 2.0 * self.force - self.time

    def text(self, force: str, position: str) -> str:
        """Return the unit in words, such as "N m s/rad" for a force "N m" and a position "rad".

        A number without a unit is "1". `force` is the unit of u.
        """
        powers: dict[str, float] = {}
        for name, power in ((force, self.force), (position, self.position), ("s", self.time)):
            powers[name] = powers.get(name, 0.0) + power  # a set-point is in the unit of a position
        above: list[str] = []
        below: list[str] = []
        for name, power in powers.items():
            if power > 0.0:
                above.append(_raised(name, power))
            elif power < 0.0:
                below.append(_raised(name, -power))
        numerator = " ".join(above) or "1"
        denominator = " ".join(below)
        if len(below) > 1:
            denominator = f"({denominator})"
        return f"{numerator}/{denominator}" if below else numerator


def _raised(name: str, power: float) -> str:
    """Return a unit raised to a power."""
    if power == 1.0:
        return name
    return f"({name})^{power:g}" if " " in name else f"{name}^{power:g}"


FORCE = Unit(force=1)
POSITION = Unit(position=1)
TIME = Unit(time=1)
RATE = Unit(time=-1)  # slope of a linear surface, leak, bandwidth
RATE2 = Unit(time=-2)
SPEED = Unit(position=1, time=-1)  # of s = de + c e, its layers and dead zones
ACCELERATION = Unit(position=1, time=-2)
INERTIA = Unit(force=1, position=-1, time=2)
FORCE_RATE = Unit(force=1, time=-1)
FORCE_PER_POSITION = Unit(force=1, position=-1)  # also of a gain that grows by |s|: F/T per X/T
FORCE_PER_SPEED = Unit(force=1, position=-1, time=1)
FORCE_PER_ROOT = Unit(force=1, position=-0.5, time=0.5)  # of k in k [s]^(1/2)
SPEED_PER_ROOT = Unit(position=0.5, time=-1)  # of b in de = -b [e]^(1/2)
INPUT_GAIN = Unit(force=-1, position=1, time=-2)  # of b in e'' = b u

Formula = Callable[[SimpleNamespace], Unit]


@dataclasses.dataclass(frozen=True)
class Gain:
    """A gain of a law, a surface or an estimator.

    Its unit is a function of all gains, read by attribute, if an exponent among them decides it.
    None: a number without a unit, or an unknown unit; tuning searches it about its default.
    """

    default: float  # a law of many joints in C may have a tuple, with one for each joint
    unit: Unit | Formula | None = None
    positive: bool = False  # whether it must be greater than 0
    nonnegative: bool = False  # whether it must be at least 0
    # whether tuning leaves it at its default: an initial value, an exponent or the size of a table
    held: bool = False
    # the gain that the law divides it by, b in the force k / b: tuning bounds k / b as a force
    over: str | None = None
    # "a1", "a2" or "b" of x'' = a1 x + a2 x' + b u near the plant's origin, which a scenario puts
    # in place of inf
    plant: str = ""
    # whether it is one number for all joints in a law of many joints, instead of a vector
    shared: bool = False
    # whether it is of the attitude, in a law of free bodies, and not of the position
    turns: bool = False

    @property
    def constraint(self) -> Each:
        """What it may be: one number, or one for each channel."""
        infinite = bool(np.isinf(self.default).any())
        above = 0.0 if self.positive else -math.inf
        low = 0.0 if self.nonnegative else -math.inf
        return Each(item=Number(above=above, low=low, infinite=infinite))

    def unit_at(self, gains: Mapping[str, float]) -> Unit | None:
        """Return the unit at these values of all gains."""
        if callable(self.unit):
            return self.unit(SimpleNamespace(**gains))
        return self.unit


def shared(gains: Mapping[str, Gain]) -> dict[str, Gain]:
    """Return the gains, each as one number for all joints of a law of many joints."""
    return {name: dataclasses.replace(gain, shared=True) for name, gain in gains.items()}


SLOPE = Gain(2.5, RATE, nonnegative=True)  # c of the surface s = de + c e
ASSUMED_B = Gain(3.0, INPUT_GAIN, positive=True)  # of e'' = b u + d, for an observer
# of s' = b u + d, for a law that solves for s one period ahead
AHEAD_B = Gain(1.0, INPUT_GAIN, positive=True, held=True)
# of e'' = a1 e + a2 de + b u; a scenario puts in the values of its plant
LINEAR_PLANT = {
    "a1": Gain(math.inf, RATE2, held=True, plant="a1"),
    "a2": Gain(math.inf, RATE, held=True, plant="a2"),
    "b": Gain(math.inf, INPUT_GAIN, positive=True, held=True, plant="b"),
}
# weights of e and de
WEIGHTS = {
    "q1": Gain(100.0, Unit(force=2, position=-2), positive=True),
    "q2": Gain(16.0, Unit(force=2, position=-2, time=2), nonnegative=True),
}
OBSERVER_FREE = {"lam": Gain(6.0, FORCE, positive=True), "k1": Gain(2.5, RATE)}
SUPER_TWISTING = {
    "k1": Gain(3.0, FORCE_PER_ROOT, positive=True),
    "k2": Gain(4.4, FORCE_RATE, positive=True),
    "c": SLOPE,
}
# on which super-twisting reaches s = 0
REACHED = {"k1 > sqrt(k2), for k1 > sqrt(k2 + L)": lambda g: g.k1**2 > g.k2}


def force_per(exponent: str) -> Formula:
    """Return the unit of k in the force k [s]^exponent; the exponent is a gain of that name."""
    return lambda g: Unit(force=1, position=-getattr(g, exponent), time=getattr(g, exponent))
