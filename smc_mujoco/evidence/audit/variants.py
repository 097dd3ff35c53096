"""Variants of laws: other gains, a reversed command, a relay, no memory, or an input gain that varies with x.

A channel's input gain g(x) multiplies what its actuator gives. A law whose command, within the actuator's bound, is
multiplied by g at each sample is therefore the law on a plant with that gain. This is exact if |g| <= 1, except that g
changes within a control period, during which the command is held. So runs are made on plants that the library lacks.
"""

import dataclasses
import functools
from collections.abc import Callable

from numba import njit

from smc_mujoco.control.component import Component

INPUT_GAINS: dict[str, Callable[[float], float]] = {  # of x in rad or m
    "reversed": lambda x: -1.0,
    "zero": lambda x: 0.0,
    "squeezed": lambda x: 1.0 / (1.0 + x * x),
}


def with_gains(law: Component, **gains: float) -> Component:
    """Return the law with some of its gains changed."""
    return dataclasses.replace(law, gains=dict(law.gains) | gains)


def reversed_gain(law: Component) -> Component:
    """Return the law on a plant of the opposite input gain: u becomes -u."""
    return _with_input_gain(law, "reversed")


def zero_gain(law: Component) -> Component:
    """Return the law with no effect: u becomes 0."""
    return _with_input_gain(law, "zero")


def squeezed(law: Component) -> Component:
    """Return the law on a plant whose input gain is multiplied by 1 / (1 + x^2)."""
    return _with_input_gain(law, "squeezed")


def relay(law: Component) -> Component:
    """Return the law as a relay: the actuator's bound with the sign of its command."""
    return dataclasses.replace(law, name=f"{law.name}_relay", function=_signed(law.function))


def forgetful(law: Component) -> Component:
    """Return the law without memory: it is 0 at every sample. A law that uses no memory stays as it is."""
    return dataclasses.replace(law, name=f"{law.name}_forgetful", function=_without_memory(law.function))


def _with_input_gain(law: Component, name: str) -> Component:
    """Return the law whose command, within the actuator's bound, is multiplied by a gain of INPUT_GAINS."""
    return dataclasses.replace(law, name=f"{law.name}_{name}", function=_multiplied(law.function, name))


@functools.cache
def _multiplied(function: Callable, name: str) -> Callable:
    """Return the function times the gain; compiled once for each pair."""
    body, factor = njit(function), njit(INPUT_GAINS[name])

    def multiplied(y, gains, memory):
        u, s = body(y, gains, memory)
        return factor(y.x) * min(max(u, -y.limit), y.limit), s

    return _named(multiplied, function, name)


@functools.cache
def _without_memory(function: Callable) -> Callable:
    """Return the function with a memory that is 0 whenever it is called; compiled once."""
    body = njit(function)

    def without_memory(y, gains, memory):
        memory[:] = 0.0
        return body(y, gains, memory)

    return _named(without_memory, function, "forgetful")


@functools.cache
def _signed(function: Callable) -> Callable:
    """Return the function with the bound, and the sign of what it returns; compiled once."""
    body = njit(function)

    def signed(y, gains, memory):
        u, s = body(y, gains, memory)
        return y.limit if u > 0.0 else -y.limit if u < 0.0 else 0.0, s

    return _named(signed, function, "relay")


def _named(variant: Callable, function: Callable, name: str) -> Callable:
    """Return the variant under a name that no other has, as its file in numba's cache is named so."""
    variant.__qualname__ = f"{function.__module__}.{function.__qualname__}.{name}"
    return variant
