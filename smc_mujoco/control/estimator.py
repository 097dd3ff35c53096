"""Velocity estimators, one per file: (y, gains, memory) -> velocity; found by walking this package.

An estimator of higher order returns the pair (velocity, acceleration).
"""

import functools
from collections.abc import Callable, Iterable, Mapping
from types import SimpleNamespace
from typing import NamedTuple, overload

from smc_mujoco.common.errors import find
from smc_mujoco.control.component import Component, Template, discover, template

Estimator = Component


class Reading(NamedTuple):
    """What an estimator sees of its channel at a sample, SI units."""

    dt: float  # control period
    x: float  # measured position
    v: float  # reading of the velocity sensor


@overload
def estimator_function(function: Callable, /) -> Template: ...
@overload
def estimator_function(
    *,
    gains: Mapping[str, float] | None = None,
    memory: int = 8,
    positive: Iterable[str] = (),
    nonnegative: Iterable[str] = (),
    conditions: Mapping[str, Callable[[SimpleNamespace], bool]] | None = None,
) -> Callable[[Callable], Template]: ...
def estimator_function(
    function: Callable | None = None,
    /,
    *,
    gains: Mapping[str, float] | None = None,
    memory: int = 8,
    positive: Iterable[str] = (),
    nonnegative: Iterable[str] = (),
    conditions: Mapping[str, Callable[[SimpleNamespace], bool]] | None = None,
) -> Callable[[Callable], Template] | Template:
    """Make an estimator of a function (y, gains, memory) -> velocity. Arguments as for `law_function`."""
    decorate = template("estimator", gains, memory, positive, nonnegative, conditions=conditions)
    return decorate if function is None else decorate(function)


@functools.cache
def catalogue() -> dict[str, Template]:
    """Every estimator of this package, by name."""
    return discover("smc_mujoco.control.estimators")


def estimator(name: str, **gains: float) -> Estimator:
    """The estimator `name`, with some of its gains changed.

    Raises:
      ScenarioError: unknown estimator or gain, or a gain out of its range.
    """
    return find("velocity estimator", name, catalogue()).bind(gains, warn=True)


def estimators() -> list[str]:
    """Names that `estimator` knows."""
    return list(catalogue())
