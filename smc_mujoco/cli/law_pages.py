"""Laws, surfaces and velocity estimators in the terminal: a line for each, or a page about one.

Everything comes from the templates and their docstrings.
"""

import inspect
import re
from collections.abc import Iterable, Mapping, Sequence

from rich.console import Console
from rich.padding import Padding
from rich.text import Text

from smc_mujoco.cli.tables import listed
from smc_mujoco.common.errors import unknown
from smc_mujoco.common.tabular import of_fields
from smc_mujoco.control import from_text
from smc_mujoco.control.component import Template
from smc_mujoco.control.estimator import estimator_catalogue as estimators
from smc_mujoco.control.law import Law, Measurement
from smc_mujoco.control.law import joint_law_catalogue as joint_laws
from smc_mujoco.control.law import law_catalogue as laws
from smc_mujoco.control.properties import PROPERTIES, reads, suitable
from smc_mujoco.control.surface import surface_catalogue as surfaces
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.plant import plant_catalogue as plants

CATALOGUES = {
    "Laws": laws,
    "Laws of many joints": joint_laws,
    "Surfaces": surfaces,
    "Velocity estimators": estimators,
}
# Relative degree -> what a law acts on.
DEGREES = {1: "s, with u in s'", 2: "e, with u in e''", 3: "e, with u in e'''"}
# ends of lines within a paragraph, or an item of a list
LINES = re.compile(r"(?<=\S)\n(?:  )?(?=(?!Sources?:|- [A-Z])\S)")
CALL_TEMPLATES = {  # kind of component -> how a user makes one
    "law": "smc.law({})",
    "surface": "smc.Scenario(surface=smc.surface({}), ...)",
    "estimator": "smc.Scenario(velocity=smc.estimator({}), ...)",
}


def print_pages(name: str, console: Console) -> None:
    """Print a page about one law, surface, estimator or plant of this name, or about each law of a
    file.
    """
    if name in plants():
        return print_plant(plants()[name], console)
    pages = []
    titles: dict[str, None] = {}
    for catalogue_of in CATALOGUES.values():
        templates = catalogue_of()
        titles |= dict.fromkeys(templates)
        if name in templates:
            pages.append((templates[name], templates.package(name)))
    if not pages and "." in name:
        for law in from_text.laws_of_text(name):
            if isinstance(law, Law) and law.template:
                pages.append((law.template, ""))
    if not pages:
        raise unknown("law, surface, velocity estimator or plant", name, [*titles, *plants()])
    for template, package in pages:
        print_page(template, console, package, name)
    return None


def print_plant(plant: Plant, console: Console) -> None:
    """Print what the file of a plant says, its parameters, and other sets of them."""
    console.print(Text.assemble((plant.name, "bold cyan"), ("  plant", "dim")))
    _print_docstring(inspect.getdoc(inspect.getmodule(plant.build)) or "", console)
    rows = {"parameters": _values(plant.parameters)}
    for name, values in plant.sets.items():
        changed = {}
        for key, value in values.items():
            if value != plant.parameters[key]:
                changed[key] = value
        rows[f"set {name}"] = _values(changed) or "the default"
    rows["use"] = f'smc.plant("{plant.name}")'
    _print_rows(rows, console)


def _print_docstring(text: str, console: Console) -> None:
    console.print(Padding(Text(LINES.sub(" ", text)), (1, 0, 1, 2)))


def _values(values: Mapping[str, float]) -> str:
    """Return numbers by name as text."""
    return ", ".join(f"{name}={value:g}" for name, value in values.items())


def _print_rows(rows: Mapping[str, str], console: Console) -> None:
    """Print the rows of a page that have words."""
    console.print(of_fields("", {label: words for label, words in rows.items() if words}))


def lists() -> dict[str, dict[str, str]]:
    """Return heading -> name and formula of each law, surface and estimator, as the first line of
    its docstring.
    """
    rows = {}
    for heading, templates in CATALOGUES.items():
        rows[heading] = listed(templates(), lambda template: template.doc)
    return rows


def print_suitable(needs: Sequence[str], plant: str | None, console: Console) -> None:
    """Print a line about each law that has all these PROPERTIES and suits a plant."""
    names = [law.name for law in suitable(needs, plant)]
    title = f"{len(names)} of {len(laws())} laws"
    if needs:
        title += f" that {' and '.join(PROPERTIES[need].words for need in needs)}"
    if plant is not None:
        title += f" for {plant}"
    about = lists()["Laws"]
    console.print(of_fields(title, {name: about[name] for name in about if name in names}))


def print_page(template: Template, console: Console, package: str, text: str) -> None:
    """Print everything about a law, surface or estimator of a package, "" for this one; `text` is
    its name or file.
    """
    console.print(Text.assemble((template.name, "bold cyan"), (f"  {template.kind}", "dim")))
    _print_docstring(template.doc, console)
    examples = _values(dict(list(template.defaults.items())[:2]))
    call = f'"{text}", {examples}' if examples else f'"{text}"'
    conditions = [*template.conditions]
    for words in template.advice:
        conditions.append(f"{words} (advice)")
    rows = {
        "gains": "\n".join(_gains(template)),
        "conditions": "\n".join(conditions) or "none on the gains alone",
        "family": template.family,
        "package": package,
        "use": CALL_TEMPLATES[template.kind].format(call),
    }
    if template.kind == "law":
        degree = template.relative_degree
        rows["degree"] = f"{degree}: acts on {DEGREES.get(degree, 'joints')}"
        held = []
        for name, needed in PROPERTIES.items():
            if needed.holds(template):
                held.append(name)
        rows["properties"] = ", ".join(held)
        fields = []
        for name in Measurement._fields:
            if name in reads(template):
                fields.append(name)
        rows["reads"] = ", ".join(fields)
        rows["plants"] = ", ".join(template.plants) or "all with an actuator at each joint"
    _print_rows(rows, console)


def _gains(template: Template) -> Iterable[str]:
    """Yield a line for each gain: its default with its unit on a hinge, and its range."""
    width = max(map(len, template.gains), default=0)
    units = {}
    for name, gain in template.gains.items():
        if unit := gain.unit_at(template.defaults):
            units[name] = unit.text("N m", "rad")
    widest = max(map(len, units.values()), default=0)
    for name, gain in template.gains.items():
        allowed = "  >= 0" if gain.nonnegative else ""
        if gain.positive:
            allowed = "  > 0"
        unit = units.get(name, "")
        yield f"{name:{width}} = {gain.default:<8g} {unit:{widest}}{allowed}".rstrip()
    if any("N m" in unit or "rad" in unit for unit in units.values()):
        yield "on a slide N stands for N m, and m for rad"
    if not template.gains:
        yield "none"
