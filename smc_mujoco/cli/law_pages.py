"""Laws, surfaces and velocity estimators in the terminal: a line for each, or a page about one.

Everything is read from the templates and their docstrings. These have one form: `Name: formula` first, then what is
known, then `Source:`.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from smc_mujoco.cli.tables import plain, titled
from smc_mujoco.common.errors import find
from smc_mujoco.control.component import Template
from smc_mujoco.control.estimator import catalogue as estimators
from smc_mujoco.control.law import catalogue as laws
from smc_mujoco.control.surface import catalogue as surfaces

SOURCE = re.compile(r"(?<![\w.])Sources?: ")
SENTENCE = re.compile(r"(?<=\.)(?<!\b[A-Z]\.)\s+(?=[A-Z`|])")  # not after an author's initial
DISCRETE = re.compile(r"\b(explicit|implicit|discreti[sz]|Euler|bilinear|sampled)", re.I)
INITIALS = re.compile(r"\b[A-Z]\.(?:[- ]?[A-Z]\.)*\s*")
HEADINGS = {"Laws": laws, "Surfaces": surfaces, "Velocity estimators": estimators}
WAYS = {
    "law": "smc.law({call})",
    "surface": "smc.Scenario(surface=smc.surface({call}), ...)",
    "estimator": "smc.Scenario(velocity=smc.estimator({call}), ...)",
}


class Entry(NamedTuple):
    """A docstring taken apart: name in words, formula, sentences on discretisation, what else is known, source."""

    title: str
    formula: str
    discretisation: str
    known: str
    source: str


def catalogue() -> dict[str, list[Template]]:
    """Return name -> the law, the surface and the velocity estimator of that name."""
    found: dict[str, list[Template]] = {}
    for known in (laws(), surfaces(), estimators()):
        for name, template in known.items():
            found.setdefault(name, []).append(template)
    return found


def entry(template: Template) -> Entry:
    """Return the parts of a template's docstring."""
    said, *source = SOURCE.split(template.doc, maxsplit=1)
    first, *paragraphs = (" ".join(p.split()) for p in said.strip().split("\n\n"))
    head, *more = SENTENCE.split(first, maxsplit=1)
    if head.endswith(":") and paragraphs:
        head += " " + paragraphs.pop(0)
    title, colon, formula = head.removesuffix(".").partition(": ")
    sentences = [s for p in (*more, *paragraphs) for s in SENTENCE.split(p) if s]
    discrete = [s for s in sentences if DISCRETE.search(s)]
    return Entry(
        title=title if colon else "",
        formula=formula if colon else title,
        discretisation=" ".join(discrete),
        known=" ".join(s for s in sentences if s not in discrete),
        source=" ".join("".join(source).split()),
    )


def brief(source: str) -> str:
    """Return a source in short: its first author, or two, and its year."""
    first = INITIALS.sub("", source).partition(";")[0]
    authors, *others = re.split(r", | \(", first.partition('"')[0])
    if authors.startswith("the law of "):  # and what follows is of others
        return authors.removeprefix("the law of ")
    if "&" not in authors and any("&" in other for other in others[:4]):
        authors += " et al."
    years = re.findall(r"(?<![:\d-])(?:19|20)\d\d\b", re.split(r",? following ", first)[0])
    return " ".join([authors.removeprefix("after ").strip(), *years[-1:]])


def print_pages(name: str | None, console: Console) -> None:
    """Print a page about one law, surface or estimator; without a name a line about each.

    Raises:
      ScenarioError: nothing has that name.
    """
    if name is not None:
        for template in find("law, surface or velocity estimator", name, catalogue()):
            page(template, console)
        return
    for heading, known in HEADINGS.items():
        console.print(_overview(heading, known()), "")
    console.print("One in full: [cyan]smc-mujoco laws NAME[/]", highlight=False)


def _overview(heading: str, templates: Mapping[str, Template]) -> Table:
    graded = any(t.kind == "law" for t in templates.values())
    table = titled(f"{heading} ({len(templates)})", show_edge=False, padding=(0, 2, 0, 0), pad_edge=False)
    table.add_column("name", no_wrap=True, style="cyan")
    if graded:
        table.add_column("deg", justify="right", style="dim")
    table.add_column("formula")
    table.add_column("source", style="dim", max_width=17)
    for name, template in sorted(templates.items()):
        said = entry(template)
        degree = [str(template.relative_degree)] if graded else []
        table.add_row(name, *degree, Text(said.formula), Text(brief(said.source)))
    return table


def page(template: Template, console: Console) -> None:
    """Print everything about one law, surface or estimator."""
    said = entry(template)
    console.print(Text.assemble((template.name, "bold cyan"), f"  {said.title}", (f"  {template.kind}", "dim")))
    console.print(Padding(Text(said.formula, style="bold"), (0, 0, 1, 2)))
    rows: list[tuple[str, str | Sequence[str]]] = [("gains", [*_gains(template)])]
    rows.append(("conditions", [*template.conditions] or ["none on the gains alone"]))
    if template.kind != "estimator":
        rows.append(("degree", _degree(template)))
    if template.kind == "law":
        rows.append(("plants", ", ".join(template.plants) or "every one whose joints are all driven"))
    rows += [("discretisation", said.discretisation), ("known", said.known), ("source", said.source)]
    gains = [f"{key}={value:g}" for key, value in list(template.defaults.items())[:2]]
    rows.append(("use", WAYS[template.kind].format(call=", ".join([f'"{template.name}"', *gains]))))
    table = plain(padding=(0, 2, 1, 0))
    table.add_column(style="dim", no_wrap=True)
    table.add_column()
    for label, value in rows:
        text = value if isinstance(value, str) else "\n".join(value)
        if text:
            table.add_row(label, Text(text))
    console.print(table)


def _gains(template: Template) -> Iterable[str]:
    """Yield a line for each gain: its default and its range."""
    width = max((len(name) for name in template.defaults), default=0)
    for name, value in template.defaults.items():
        least = "  > 0" if name in template.positive else "  >= 0" if name in template.nonnegative else ""
        yield f"{name:{width}} = {value:<8g}{least}".rstrip()
    if not template.defaults:
        yield "none"


def _degree(template: Template) -> str:
    """Return the relative degree in words: what a law acts on, or what a surface gives."""
    what = {1: "s, with u in s'", 2: "e, with u in e''", 3: "e, with u in e'''"}.get(template.relative_degree, "")
    if template.kind == "surface":
        return f"{template.relative_degree}: for the laws of that degree"
    return f"{template.relative_degree}: acts on {what}" if what else str(template.relative_degree)
