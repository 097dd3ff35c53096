"""What a control law is: a pure function of one channel's measurement, its gains and its memory.

    @law_function(gains={"lam": 6.0, "k1": 3.0})
    def my_law(y, gains, memory):
        s = y.de + gains.k1 * y.e
        return -gains.lam * math.tanh(s), s        # commanded control before saturation, sliding variable

The law runs once per control sample; its u is clipped to +-u_max and held. It never sees the simulator: what it knows
of the plant is the nominal f and g in its measurement.
"""

import functools
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple, overload

from smc_mujoco.component import Component, Template, discover, template
from smc_mujoco.errors import find

Law = Component


class Measurement(NamedTuple):
    """What a law sees of its channel at a sample, SI units."""

    t: float  # time of the sample
    dt: float  # control period
    x: float  # measured position
    v: float  # measured or estimated velocity
    e: float  # x - r
    de: float  # v - r'
    r: float  # reference
    dr: float
    ddr: float
    f: float  # nominal f(x, v) of x'' = f + g u, at the measured x and v
    g: float


@overload
def law_function(function: Callable, /) -> Template: ...
@overload
def law_function(
    *,
    gains: Mapping[str, float] | None = None,
    memory: int = 8,
    positive: Iterable[str] = (),
    nonnegative: Iterable[str] = (),
) -> Callable[[Callable], Template]: ...
def law_function(
    function: Callable | None = None,
    /,
    *,
    gains: Mapping[str, float] | None = None,
    memory: int = 8,
    positive: Iterable[str] = (),
    nonnegative: Iterable[str] = (),
) -> Callable[[Callable], Template] | Template:
    """Make a law of a function (y, gains, memory) -> (u, s).

    Args:
      gains: name -> default value.
      memory: floats of state per channel.
      positive, nonnegative: gains that must be greater than 0, or at least 0.

    The function must be pure: what it is to remember goes into memory, what is to vary into gains. Compiled, it keeps
    the globals and closed-over values that it was compiled with, and random numbers in it would come from a shared
    generator. A function made anew for each value is compiled anew, and kept.

    Returns:
      A decorator; the decorated function called with gains, `my_law(lam=5.0)`, gives the Law of a Scenario.
    """
    decorate = template("law", gains, memory, positive, nonnegative)
    return decorate if function is None else decorate(function)


@functools.cache
def catalogue() -> dict[str, Template]:
    """Every law found in smc_mujoco.laws, by name."""
    return discover("smc_mujoco.laws")


def law(name: str, **gains: float) -> Law:
    """The law `name` of the library, with some of its gains changed.

    Raises:
      ScenarioError: unknown law or gain, or a gain out of its range.
    """
    return find("law", name, catalogue())(**gains)


def laws() -> list[str]:
    """Names that `law` knows."""
    return list(catalogue())
