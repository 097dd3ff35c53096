"""A component as JSON data and back."""

import dataclasses
from collections.abc import Iterable

from smc_mujoco.common import annexes
from smc_mujoco.common.aliases import Data, Fields
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.registry import Catalogue
from smc_mujoco.control import source as sources
from smc_mujoco.control.component import Component, Template, by_channel
from smc_mujoco.control.law import all_laws

ANNEXES = ("evidence", "problems")  # with laws that are not in the catalogue, as those of rigs


def describe(c: Component) -> Fields:
    """Return a component as plain data that JSON represents without loss."""
    if c.channel_laws:
        return {"name": c.name, "each": list(map(describe, c.channel_laws))}
    return {
        "name": c.name,
        "gains": dict(c.gains),
        "memory": c.memory,
        "degree": c.relative_degree,
        "module": getattr(c.function, "__module__", ""),
    }


def restored_law(data: Data, source: Data | None) -> Component:
    """Return the law that `describe` wrote, with the source of its gains: the user, if none is
    given.
    """
    if "each" in data:
        component = by_channel([restored_law(item, source) for item in data["each"]])
    else:
        component = restored_component(data, "law", all_laws() | _laws_of_annex(data["module"]))
    if source is None:
        return component.sourced(sources.GIVEN)
    restored = dataclasses.replace(sources.restored_source(source), gains=component.gains)
    return dataclasses.replace(component, source=restored)


def restored_component(data: Data, kind: str, known: Catalogue[Template]) -> Component:
    """Return the component that `describe` wrote, without its function if that is not among the
    known ones.

    Raises:
      ScenarioError: it lacks a gain of the known one, or has another.
    """
    module = data["module"]
    if data["name"] in known:
        candidates = [known[data["name"]]]
    else:
        candidates = []  # a law may have another name, see `named`
        for template in known.own.values():
            if template.gains.keys() == data["gains"].keys():
                candidates.append(template)
    for template in candidates:
        if template.function.__module__ == module:
            check_gains(data["name"], data["gains"], template.gains)
            component = template.bind(data["gains"])
            if component.name == data["name"]:
                return component
            return component.named(data["name"])
    stored = {name: data[name] for name in ("name", "gains", "memory")}
    return Component(kind=kind, relative_degree=data["degree"], function=None, **stored)


def check_gains(name: str, given: Iterable[str], own: Iterable[str]) -> None:
    """Raise ScenarioError unless the gains of a file are those of its law."""
    for which, names in (("lacks", {*own} - {*given}), ("has", {*given} - {*own})):
        if names:
            raise ScenarioError(
                f"the file {which} {', '.join(sorted(names))}, and {name!r} has the gains "
                f"{', '.join(own)}: make the file again"
            )


def _laws_of_annex(module: str) -> dict[str, Template]:
    """Return the laws of a module of an annex, by name; none of another module."""
    package, _, rest = module.partition(".")
    annex = rest.partition(".")[0]
    if package != "smc_mujoco" or annex not in ANNEXES or not annexes.installed(annex):
        return {}
    values = vars(annexes.module(module, "a law")).values()
    return {value.name: value for value in values if isinstance(value, Template)}
