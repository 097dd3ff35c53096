"""Sliding surfaces: pure functions (y, gains, memory) -> (s, v_eq).

A surface gives a first-order law its sliding variable s, of relative degree `relative_degree`, and
v_eq, the acceleration of the error that keeps s constant: s' = 0 for e'' = v_eq. Notation as in
laws.
"""

import functools
from collections.abc import Callable
from typing import Any, Unpack, overload

from smc_mujoco.common.errors import find
from smc_mujoco.common.registry import Catalogue, catalogue_of
from smc_mujoco.control.component import Component, Options, Template, decorated

Surface = Component


@overload
def surface_function(function: Callable[..., Any], /) -> Template: ...
@overload
def surface_function(**options: Unpack[Options]) -> Callable[[Callable[..., Any]], Template]: ...
def surface_function(
    function: Callable[..., Any] | None = None, /, **options: Unpack[Options]
) -> Callable[[Callable[..., Any]], Template] | Template:
    """Turn a function (y, gains, memory) -> (s, v_eq) into a surface.

        @smc.design.surface_function(gains={"c": 2.5})
        def cubic(y, gains, memory):
            return y.de + gains.c * (y.e + y.e**3), -gains.c * y.de * (1.0 + 3.0 * y.e**2)

    Arguments as of `law_function`: gains, memory, positive, nonnegative, relative_degree,
    conditions and label.

    Returns:
      A decorator. The decorated function, called with gains, returns the Surface of a Scenario.
    """
    return decorated("surface", function, options)


@functools.cache
def surface_catalogue() -> Catalogue[Template]:
    """Return every surface of smc_mujoco.control.surfaces and of other packages, by name."""
    return catalogue_of(
        "smc_mujoco.control.surfaces",
        Template,
        "smc_mujoco.surfaces",
        lambda one: one.kind == "surface",
    )


def surface(name: str, /, **gains: float) -> Surface:
    """Return the surface `name` with these gains. An unknown name or a gain out of range is a
    ScenarioError.

        line = smc.surface("linear", c=3.0)
        smc.Scenario(plant="duffing", law=smc.law("super_twisting"), surface=line)

    Returns:
      A Surface, for `surface` of a Scenario.
    """
    return find("surface", name, surface_catalogue()).bind(gains, warn=True)
