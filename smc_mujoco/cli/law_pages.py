"""Laws, surfaces and velocity estimators in the terminal: a line for each, or a page about one.

Everything comes from the templates and their docstrings, see `smc_mujoco.control.docstring`.
"""

import inspect
import itertools
import re
from collections.abc import Iterable, Sequence

from rich.console import Console
from rich.padding import Padding
from rich.table import Column
from rich.text import Text

from smc_mujoco.cli.tables import catalogue, listed, plain
from smc_mujoco.common.errors import unknown
from smc_mujoco.control import from_text
from smc_mujoco.control.component import Template
from smc_mujoco.control.docstring import entry
from smc_mujoco.control.estimator import catalogue as estimators
from smc_mujoco.control.law import Law, Measurement
from smc_mujoco.control.law import catalogue as laws
from smc_mujoco.control.law import joint_catalogue as joint_laws
from smc_mujoco.control.properties import PROPERTIES, reads, suitable
from smc_mujoco.control.surface import catalogue as surfaces
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.plant import catalogue as plants

CATALOGUES = {
    "Laws": laws,
    "Laws of many joints": joint_laws,
    "Surfaces": surfaces,
    "Velocity estimators": estimators,
}
# Relative degree -> what a law acts on.
DEGREES = {1: "s, with u in s'", 2: "e, with u in e''", 3: "e, with u in e'''"}
ARRIVALS = {
    "s": "s = 0 after a finite time",
    "e": "e = 0 after a finite time",
}  # of `Template.finite_time`
LINES = re.compile(r"(?<=\S)\n(?=(?!Sources?:)\S)")  # ends of lines within a paragraph
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
    known = [templates() for templates in CATALOGUES.values()]
    pages = [(templates[name], templates.package(name)) for templates in known if name in templates]
    if not pages and "." in name:
        pages = []
        for law in from_text.laws(name):
            if isinstance(law, Law) and law.template:
                pages.append((law.template, ""))
    if not pages:
        raise unknown(
            "law, surface or velocity estimator", name, dict.fromkeys(itertools.chain(*known))
        )
    for template, package in pages:
        print_page(template, console, package, name)
    return None


def print_plant(plant: Plant, console: Console) -> None:
    """Print what the file of a plant says, its parameters, and other sets of them."""
    console.print(Text.assemble((plant.name, "bold cyan"), ("  plant", "dim")))
    said = LINES.sub(" ", inspect.getdoc(inspect.getmodule(plant.build)) or "")
    console.print(Padding(Text(said), (1, 0, 1, 2)))
    table = plain(Column(style="dim", no_wrap=True), "", padding=(0, 2, 1, 0))
    table.add_row(
        "parameters", Text(", ".join(f"{key}={value:g}" for key, value in plant.parameters.items()))
    )
    for name, values in plant.sets.items():
        changed = {key: value for key, value in values.items() if value != plant.parameters[key]}
        table.add_row(
            f"set {name}",
            Text(", ".join(f"{k}={v:g}" for k, v in changed.items()) or "the default"),
        )
    table.add_row(
        "use",
        Text(f'smc.plant("{plant.name}")' + ', or smc.plant(..., set="NAME")' * bool(plant.sets)),
    )
    console.print(table)


def lists() -> dict[str, list[tuple[str, str]]]:
    """Return heading -> name and formula of each law, surface and estimator, as the first line of
    its docstring.
    """
    return {
        heading: listed(templates(), lambda template: template.doc)
        for heading, templates in CATALOGUES.items()
    }


def print_suitable(needs: Sequence[str], plant: str | None, console: Console) -> None:
    """Print a line about each law that has all these PROPERTIES and suits a plant."""
    names = [law.name for law in suitable(needs, plant)]
    filters = " and ".join(PROPERTIES[need].words for need in needs)
    title = f"{len(names)} of {len(laws())} laws" + f" that {filters}" * bool(filters)
    title += f" for {plant}" * (plant is not None)
    if "no-velocity" in needs:
        text = 'Every law runs without a velocity sensor if the scenario estimates the velocity: velocity="levant".'
        console.print(text, highlight=False)
    if names:
        console.print(catalogue(title, [row for row in lists()["Laws"] if row[0] in names]))
    else:
        console.print(f"{title}: leave out a need, or --plant", highlight=False)


def print_page(template: Template, console: Console, package: str, text: str) -> None:
    """Print everything about a law, surface or estimator of a package, "" for this one; `text` is
    its name or file.
    """
    parts = entry(template)
    is_law = template.kind == "law"
    console.print(
        Text.assemble(
            (template.name, "bold cyan"), f"  {parts.title}", (f"  {template.kind}", "dim")
        )
    )
    console.print(Padding(Text(parts.formula, style="bold"), (0, 0, 1, 2)))
    call = ", ".join([f'"{text}"', *(f"{k}={v:g}" for k, v in list(template.defaults.items())[:2])])
    rows = {
        "gains": "\n".join([*_gains(template), *filter(None, [parts.gains])]),
        "conditions": "\n".join(template.conditions) or "none on the gains alone",
        "degree": _degree(template),
        "family": template.family,
        "promises": _promises(template),
        "reads": ", ".join(f for f in Measurement._fields if f in reads(template)) * is_law,
        "plants": (", ".join(template.plants) or "all with an actuator at each joint") * is_law,
        "discretisation": parts.discretisation,
        "known": parts.known,
        "source": parts.source,
        "package": package,
        "use": CALL_TEMPLATES[template.kind].format(call),
    }
    table = plain(Column(style="dim", no_wrap=True), "", padding=(0, 2, 1, 0))
    for label, words in rows.items():
        if words:
            table.add_row(label, Text(words))
    console.print(table)


def _gains(template: Template) -> Iterable[str]:
    """Yield a line for each gain: its default and its range."""
    width = max(map(len, template.gains), default=0)
    for name, gain in template.gains.items():
        if gain.positive:
            allowed = "  > 0"
        else:
            allowed = "  >= 0" if gain.nonnegative else ""
        yield f"{name:{width}} = {gain.default:<8g}{allowed}".rstrip()
    if not template.gains:
        yield "none"


def _promises(template: Template) -> str:
    """Return what theory says about a law's u and its convergence, in words; "" for surfaces and
    estimators.
    """
    if template.kind != "law":
        return ""
    u = "a continuous u" * template.continuous
    orders = []
    for name in template.accuracy:
        orders.append(f"|{name}| of order {template.order(name, template.defaults):.3g}")
    if orders:
        accuracy = f"{' and '.join(orders)} in the control period"
    else:
        accuracy = ""
    return ", ".join(filter(None, [u, ARRIVALS.get(template.finite_time), accuracy]))


def _degree(template: Template) -> str:
    """Return the relative degree in words: of a law's sliding variable, or of a surface; "" for an
    estimator.
    """
    degree = template.relative_degree
    if template.kind == "law":
        if degree in DEGREES:
            return f"{degree}: acts on {DEGREES[degree]}"
        return str(degree)
    if template.kind == "surface":
        return f"{degree}: for the laws of that degree"
    return ""
