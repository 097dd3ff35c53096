"""Variants of laws: a reversed command, command 0, a relay, no memory, or an input gain that varies
with x.

    variant(law, "squeezed")

A channel's input gain g(x) multiplies the actuator's output. To run a law on a plant with that
gain, which the library lacks, clip its command to the actuator's bound and multiply it by g at each
sample. This is exact if |g| <= 1, except that g changes within a control period, during which the
command is held.
"""

import dataclasses
import functools
from collections.abc import Callable

from numba import njit

from smc_mujoco.control.component import Component


def _times(gain: Callable[[float], float]) -> Callable[[Callable], Callable]:
    """Return a wrapper that clips a law's command to the actuator's bound and multiplies it by
    gain(x), x rad or m.
    """
    factor = njit(gain)

    def multiply(body):
        def multiplied(y, gains, memory):
            u, s = body(y, gains, memory)
            return factor(y.x) * min(max(u, -y.limit), y.limit), s

        return multiplied

    return multiply


def _without_memory(body):
    def without_memory(y, gains, memory):
        memory[:] = 0.0
        return body(y, gains, memory)

    return without_memory


def _relay(body):
    def relay(y, gains, memory):
        u, s = body(y, gains, memory)
        return y.limit if u > 0.0 else -y.limit if u < 0.0 else 0.0, s

    return relay


VARIANTS: dict[str, Callable[[Callable], Callable]] = {
    "reversed": _times(lambda x: -1.0),
    "zero": _times(lambda x: 0.0),
    "squeezed": _times(lambda x: 1.0 / (1.0 + x * x)),
    # memory is 0 at every sample; a law that uses none stays as it is
    "forgetful": _without_memory,
    "relay": _relay,  # the actuator's bound with the sign of the command
}


def variant(law: Component, name: str) -> Component:
    """Return the variant of a law that VARIANTS has under a name."""
    return dataclasses.replace(law, name=f"{law.name}_{name}", function=_varied(law.function, name))


@functools.cache
def _varied(function: Callable, name: str) -> Callable:
    """Return the variant of a law's function; compiled once."""
    varied = VARIANTS[name](njit(function))
    varied.__qualname__ = (
        f"{function.__module__}.{function.__qualname__}.{name}"  # numba's cache names files so
    )
    return varied


def with_gains(law: Component, **gains: float) -> Component:
    """Return the law with some of its gains changed."""
    return dataclasses.replace(law, gains=dict(law.gains) | gains)
