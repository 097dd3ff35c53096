"""Sliding surfaces, one per file: (y, gains, memory) -> (s, eq); found by walking this package.

A surface gives a first-order law the sliding variable s, of relative degree `degree`, and eq, the acceleration of the
error that keeps s constant: s' = 0 for e'' = eq. Letters as in laws.
"""

import functools
from collections.abc import Callable, Iterable, Mapping
from types import SimpleNamespace
from typing import overload

from smc_mujoco.common.errors import find
from smc_mujoco.control.component import Component, Template, discover, template

Surface = Component


@overload
def surface_function(function: Callable, /) -> Template: ...
@overload
def surface_function(
    *,
    gains: Mapping[str, float] | None = None,
    memory: int = 8,
    positive: Iterable[str] = (),
    nonnegative: Iterable[str] = (),
    degree: int = 1,
    conditions: Mapping[str, Callable[[SimpleNamespace], bool]] | None = None,
) -> Callable[[Callable], Template]: ...
def surface_function(
    function: Callable | None = None,
    /,
    *,
    gains: Mapping[str, float] | None = None,
    memory: int = 8,
    positive: Iterable[str] = (),
    nonnegative: Iterable[str] = (),
    degree: int = 1,
    conditions: Mapping[str, Callable[[SimpleNamespace], bool]] | None = None,
) -> Callable[[Callable], Template] | Template:
    """Make a surface of a function (y, gains, memory) -> (s, eq). Arguments as for `law_function`."""
    decorate = template("surface", gains, memory, positive, nonnegative, degree, conditions)
    return decorate if function is None else decorate(function)


@functools.cache
def catalogue() -> dict[str, Template]:
    """Every surface of this package, by name."""
    return discover("smc_mujoco.control.surfaces")


def surface(name: str, **gains: float) -> Surface:
    """The surface `name`, with some of its gains changed.

    Raises:
      ScenarioError: unknown surface or gain, or a gain out of its range.
    """
    return find("surface", name, catalogue()).bind(gains, warn=True)


def surfaces() -> list[str]:
    """Names that `surface` knows."""
    return list(catalogue())
