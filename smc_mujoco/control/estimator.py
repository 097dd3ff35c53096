"""Velocity estimators: pure functions (y, gains, memory) -> velocity, or -> (velocity,
acceleration).
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple, Unpack, overload

from smc_mujoco.common.errors import find
from smc_mujoco.common.registry import Catalogue, catalogue_of
from smc_mujoco.control.component import Component, Options, Template, decorated

Estimator = Component


class Reading(NamedTuple):
    """The inputs of an estimator: its channel at a sample, in SI units."""

    dt: float  # control period
    x: float  # measured position
    v: float  # reading of the velocity sensor


@overload
def estimator_function(function: Callable[..., Any], /) -> Template: ...
@overload
def estimator_function(**options: Unpack[Options]) -> Callable[[Callable[..., Any]], Template]: ...
def estimator_function(
    function: Callable[..., Any] | None = None, /, **options: Unpack[Options]
) -> Callable[[Callable[..., Any]], Template] | Template:
    """Turn a function (y, gains, memory) -> velocity, or -> (velocity, acceleration), into an
    estimator.

        @smc.estimator_function(gains={"tau": 0.01}, memory=2)
        def filtered(y, gains, memory):
            memory[0] += (y.x - memory[0]) * y.dt / gains.tau
            return (y.x - memory[0]) / gains.tau

    `y` has x, the measured position, v, the measured velocity, and dt, the control period.
    Arguments as of `law_function`: gains, memory, positive, nonnegative, conditions and label.

    Returns:
      A decorator. The decorated function, called with gains, returns the Estimator of a Scenario.
    """
    return decorated("estimator", function, options)


@functools.cache
def estimator_catalogue() -> Catalogue[Template]:
    """Return every estimator of smc_mujoco.control.estimators and of other packages, by name."""
    return catalogue_of(
        "smc_mujoco.control.estimators",
        Template,
        "smc_mujoco.estimators",
        lambda one: one.kind == "estimator",
    )


def estimator(name: str, /, **gains: float) -> Estimator:
    """Return the estimator `name` with these gains. An unknown name or a gain out of range is a
    ScenarioError.

        smc.run(smc.Scenario(plant="duffing", law="pid", velocity=smc.estimator("levant")))

    `print(smc.estimator("levant").template.doc)` shows its equation, what its gains mean, their
    units, and how to choose them. The defaults are for the library's plants: on your own machine
    choose your own. `smc.laws(kind="estimator")` has the names.

    Returns:
      An Estimator, for `velocity` of a Scenario.
    """
    return find("velocity estimator", name, estimator_catalogue()).bind(gains, warn=True)
