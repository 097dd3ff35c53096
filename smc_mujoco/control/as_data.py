"""A component as JSON data and back."""

import importlib
import importlib.util
from collections.abc import Mapping
from typing import Any

from smc_mujoco.common.catalogue import Catalogue
from smc_mujoco.control import source as sources
from smc_mujoco.control.component import Component, Template, by_channel
from smc_mujoco.control.law import known_laws

ELSEWHERE = "smc_mujoco.evidence"  # it has laws that are not in the catalogue, such as those of rigs


def describe(c: Component) -> dict[str, Any]:
    """Return a component as plain data that JSON holds without loss."""
    if c.each:
        return {"name": c.name, "each": [describe(one) for one in c.each]}
    return {"name": c.name, "gains": dict(c.gains), "memory": c.memory} | {
        "degree": c.relative_degree,
        "module": getattr(c.function, "__module__", ""),
    }


def law(data: Mapping[str, Any], source: Mapping[str, Any] | None) -> Component:
    """Return the law that `describe` wrote, from there and from the data of its gains' source.

    Gains without a source, as in a file that somebody wrote, count as the user's.
    """
    origin = sources.Source(kind=sources.YOURS) if source is None else sources.restored(source)
    return _law(data).sourced(origin.kind, origin.search)


def _law(data: Mapping[str, Any]) -> Component:
    if "each" in data:
        return by_channel([_law(one) for one in data["each"]])
    return restore(data, "law", known_laws() | _laws_elsewhere(data["module"]))


def restore(data: Mapping[str, Any], kind: str, known: Catalogue[Template]) -> Component:
    """Return the component that `describe` wrote, without its function if that is not among the known ones."""
    module, template = data["module"], known.get(data["name"])
    named = known.own.values() if template is None else [template]  # one of the library may have been renamed
    there = (one for one in named if one.function.__module__ == module and {*data["gains"]} <= {*one.gains})
    if template := next(there, None):
        bound = template.bind(data["gains"])
        return bound if bound.name == data["name"] else bound.named(data["name"])
    return Component(
        kind=kind,
        name=data["name"],
        gains=dict(data["gains"]),
        memory=data["memory"],
        relative_degree=data.get("degree", 1),
        function=None,
    )


def _laws_elsewhere(module: str) -> dict[str, Template]:
    """Return the laws of a module of the evidence annex, by name; none of another module."""
    if not module.startswith(ELSEWHERE) or not importlib.util.find_spec(ELSEWHERE):
        return {}
    values = vars(importlib.import_module(module)).values()
    return {value.name: value for value in values if isinstance(value, Template)}
