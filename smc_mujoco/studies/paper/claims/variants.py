"""Variants of laws: other gains, a reversed command, or an input gain that varies with x.

A channel's input gain g(x) multiplies what its actuator gives. A law whose command, within the actuator's bound, is
multiplied by g at each sample is therefore the law on that plant, exactly so but for g's change within a control
period, during which the command is held, where |g| <= 1. So are runs made on plants that the library does not have.
"""

import dataclasses
import functools
from collections.abc import Callable

from numba import njit

from smc_mujoco.control.component import Component


def with_gains(law: Component, **gains: float) -> Component:
    """Return the law with some of its gains changed."""
    return dataclasses.replace(law, gains=dict(law.gains) | gains)


def reversed_gain(law: Component) -> Component:
    """Return the law as on a plant of the opposite input gain: u becomes -u."""
    return through(law, minus, "reversed")


def zero_gain(law: Component) -> Component:
    """Return the law with no effect: u becomes 0."""
    return through(law, nothing, "zero")


def squeezed(law: Component) -> Component:
    """Return the law as on a plant whose input gain is its own times 1 / (1 + x^2), x in rad or m."""
    return through(law, bell, "squeezed")


def through(law: Component, gain: Callable[[float], float], name: str) -> Component:
    """Return the law whose command, bounded as by the actuator, is multiplied by gain(x), x as measured."""
    return dataclasses.replace(law, name=f"{law.name}_{name}", function=_multiplied(law.function, gain))


def minus(x: float) -> float:
    """g = -1."""
    return -1.0


def nothing(x: float) -> float:
    """g = 0."""
    return 0.0


def bell(x: float) -> float:
    """g = 1 / (1 + x^2)."""
    return 1.0 / (1.0 + x * x)


@functools.cache
def _multiplied(function: Callable, gain: Callable[[float], float]) -> Callable:
    """Return the function times the gain; compiled once for each pair."""
    body, factor = njit(function), njit(gain)

    def multiplied(y, gains, memory):
        u, s = body(y, gains, memory)
        return factor(y.x) * min(max(u, -y.limit), y.limit), s

    return multiplied
