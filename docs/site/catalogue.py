"""The pages of laws, plants, surfaces and estimators, each written from its own file when the site
is built.

A page of a law has its formula, its figure, its properties and gains, what is known of it, its
source and its C form; a page of a plant its equation, picture, figure, parameters, obstacles,
builds and MJCF.
"""

import contextlib
import dataclasses
import inspect
import itertools
import re
import sys
from collections.abc import Iterator, Mapping

import figures
import notation
from docstring import SOURCE, entry

from smc_mujoco.cli.law_pages import DEGREES
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.text import capital
from smc_mujoco.control import gain_sets
from smc_mujoco.control.component import Template
from smc_mujoco.control.estimator import estimator_catalogue as estimators
from smc_mujoco.control.law import Measurement, library_law
from smc_mujoco.control.law import law_catalogue as laws
from smc_mujoco.control.properties import PROPERTIES, reads, searched_gains
from smc_mujoco.control.surface import surface_catalogue as surfaces
from smc_mujoco.draw import wording
from smc_mujoco.exchange.c.export_c import law_to_c
from smc_mujoco.mechanisms.plant import Plant, model_path
from smc_mujoco.mechanisms.plant import plant_catalogue as plants

GAINS = re.compile(r"(?:^|(?<=\. ))Gains?: ", re.MULTILINE)
POWER = re.compile(r"\^(-?[\w./]+|\([^)]*\))")
UNIT = re.compile(r"\s*\[([^\]]*)\]")
HEADER_END = "#endif\n\n"  # of smc_law.h, before the law
KEY = "".join(
    f'<span style="--key: {colour}">{words}</span>'
    for words, colour in zip(
        ("undisturbed", "with measurement noise and d = 0.2 sin 5t"),
        figures.CONDITIONS.values(),
        strict=True,
    )
)


@dataclasses.dataclass(frozen=True)
class Page:
    """A page of the site: its path without ending, its title in the contents, and its Markdown."""

    path: str
    title: str
    text: str


def families() -> dict[str, list[str]]:
    """Return family -> the names of its laws; those that name no family are "other"."""
    members: dict[str, list[str]] = {}
    for name, template in laws().items():
        members.setdefault(template.family or "other", []).append(name)
    return dict(sorted(members.items()))


def pages() -> dict[str, dict[str, list[Page]]]:
    """Return the pages by section and group; those of laws by family."""
    drawings = []
    for name, t in laws().items():
        for plant in figures.shown_on(t):
            drawings.append((figures.law_figure, (name, plant)))
    drawings += [
        (draw, (name,)) for draw in (figures.plant_figure, figures.still) for name in plants()
    ]
    drawn = figures.figures(drawings)
    grouped = {}
    for family, names in families().items():
        grouped[wording.in_words(family)] = [_law_page(laws()[name], drawn) for name in names]
    return {
        "Plants": {"": [_plant_page(plant, drawn) for plant in plants().values()]},
        "Laws": grouped,
        "Surfaces and estimators": {
            "": [
                Page("surfaces", "Surfaces", _listing("Surfaces", SURFACES, surfaces())),
                Page(
                    "estimators",
                    "Velocity estimators",
                    _listing("Velocity estimators", ESTIMATORS, estimators()),
                ),
            ]
        },
    }


SURFACES = """`smc.Scenario(surface=smc.surface("terminal"), ...)` replaces the sliding variable
$e' + c e$ of a law of relative degree 1."""
ESTIMATORS = """`smc.Scenario(velocity=smc.estimator("levant"), ...)` replaces the velocity
sensor by an estimate from the position $x$."""


def files(drawn_stills: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return path -> content of the pictures that pages show."""
    return {f"plants/{name}.webp": picture for name, picture in drawn_stills.items() if picture}


def stills() -> dict[str, bytes]:
    """Return plant -> its picture, from the cache."""
    return {
        key[1]: picture
        for key, picture in figures.figures([(figures.still, (name,)) for name in plants()]).items()
    }


def _law_page(template: Template, drawn: Mapping[tuple[str, ...], bytes]) -> Page:
    parts = entry(template)
    name = template.name
    drawn_figures = "".join(
        _figure(drawn["law_figure", name, plant], f"{_link_up(plant)}")
        for plant in figures.shown_on(template)
    )
    text = [
        f"# {parts.title}",
        f"`{name}`" + f" · {template.family}",
        _display(parts.formula, template.gains),
        _symbols(parts.formula),
        f'<div class="figures">{drawn_figures}</div>\n<p class="key">{KEY}</p>',
        "With [tuned gains](../run_study.md#gains-by-the-same-rule), from the plant's own start. "
        "$u$ is held between "
        "samples of 1 ms; where it chatters, the line is its mean and the band its range.",
        f"## Use it\n\n```python\n{_call(template)}\n```",
        _gain_table(template),
        _tuned_gains(template),
        _properties(template),
        f"## What is known\n\n{body(template)}",
        f"## Source\n\n{_prose(parts.source, None)}" * bool(parts.source),
        _c_form(name),
    ]
    return Page(
        f"laws/{name}",
        wording.law_name(name),
        _front(name, parts.formula) + "\n\n".join(filter(None, text)) + "\n",
    )


def _symbols(formula: str) -> str:
    """Return where the symbols of a formula are explained, and what its brackets mean."""
    if re.search(r"\]\^", formula):
        brackets = r" $\lfloor s \rceil^p$ is $\left| s \right|^p \, \mathrm{sgn}(s)$."
    else:
        brackets = ""
    return (
        "$e$ is the error, $s$ the sliding variable: see [the "
        f"mathematics](../mathematics.md).{brackets}"
    )


def _front(name: str, description: str) -> str:
    """Return what the head of a law's page tells search engines, and its short name for the site's
    search.
    """
    words = f"description: {description!r}\n" * ("'" not in description)
    return f"---\ntags: [{wording.law_name(name)!r}]\n{words}---\n\n"


def _link_up(plant: str) -> str:
    return f'<a href="../plants/{plant}.html">{_label(plants()[plant])}</a>'


def _figure(svg: bytes, caption: str) -> str:
    return f"<figure data-search-exclude>{svg.decode()}<figcaption>{caption}</figcaption></figure>"


def _display(formula: str, names) -> str:
    """Return a formula as displayed equations, one a clause."""
    lines = "".join(
        f"<div markdown>$\\displaystyle {notation.formula(c, names)}$</div>"
        for c in notation.clauses(formula)
    )
    return f'<div class="formula" markdown>{lines}</div>'


def _call(template: Template) -> str:
    gains = "".join(f", {name}={gain.default:g}" for name, gain in list(template.gains.items())[:2])
    if template.plants:
        plant = template.plants[0]
    else:
        plant = "duffing"
    call = f'law = smc.law("{template.name}"{gains})'
    return (
        f'import smc_mujoco as smc\n\n{call}\ntrace = smc.run(smc.Scenario(plant="{plant}", '
        "law=law))"
    ).replace("=inf", '=float("inf")')


def _gain_table(template: Template) -> str:
    """Return a table of the gains: meaning, unit, default, range, and whether tuning changes it."""
    if not template.gains:
        return ""
    said = meanings(template)
    rows = []
    for name, gain in template.gains.items():
        meaning, unit = said[name]
        if gain.positive:
            allowed = "> 0"
        else:
            allowed = "≥ 0" if gain.nonnegative else "any"
        if gain.default == float("inf"):
            default = "∞"
        else:
            default = f"{gain.default:g}"
        tuned = "no" if gain.held else "yes"
        rows.append(
            f"| ${notation.symbol(name)}$ `{name}` | {meaning} | {_unit(unit)} | {default} | "
            f"{allowed} | {tuned} |"
        )
    head = "| gain | meaning | unit | default | range | tuned |\n|---|---|---|---|---|---|\n"
    unit = "Units are those of a joint that slides; for a hinge read N m for N and rad for m."
    return f"## Gains\n\n{head}" + "\n".join(rows) + f"\n\n{unit}"


def _tuned_gains(template: Template) -> str:
    """Return a table of the gains tuned for each plant, without those that no tuning changes."""
    names = [name for name, gain in template.gains.items() if not gain.held]
    rows = []
    for plant in plants():
        with contextlib.suppress(ScenarioError):  # no gains for this plant
            values = gain_sets.law_with_gains(plant, template.name).gains
            numbers = " | ".join(f"{values[name]:.4g}" for name in names)
            rows.append(f"| [`{plant}`](../plants/{plant}.md) | {numbers} |")
    if not (rows and names):
        return ""
    head = f"| plant | {' | '.join(f'`{name}`' for name in names)} |\n|---|{'---|' * len(names)}\n"
    note = "Found by [the same rule for every law](../run_study.md#gains-by-the-same-rule)."
    return f"### Tuned\n\n{head}" + "\n".join(rows) + f"\n\n{note}"


def meanings(template: Template) -> dict[str, tuple[str, str]]:
    """Return gain -> what it is, and its unit, from the docstring's `Gains: ...`."""
    parts = GAINS.split(SOURCE.split(template.doc)[0])
    meaning_by_gain: dict[str, tuple[str, str]] = dict.fromkeys(template.gains, ("", "1"))
    if len(parts) < 2:
        return meaning_by_gain
    for part in " ".join(parts[1].split()).rstrip(".").split("; "):
        names = _names(part, template.gains)
        rest = part
        units = {}
        for name in names:  # `a [unit] and b [unit], meaning`
            rest = rest[re.match(rf"(?:,? and |, )?{re.escape(name)}", rest).end() :]  # pyright: ignore
            if unit := UNIT.match(rest):
                units[name], rest = unit[1], rest[unit.end() :]
        common = UNIT.search(rest)
        meaning = UNIT.sub("", rest).lstrip(", ").strip()
        for name in names:
            unit = units.get(name) or (common[1] if common else units.get(names[-1], "1"))
            meaning_by_gain[name] = notation.sentence(meaning, template.gains), unit
    return meaning_by_gain


def _names(part: str, gains) -> list[str]:
    """Return the gains that a part of `Gains: ...` begins with."""
    names = []
    rest = part
    while word := re.match(r"(?:,? and |, )?(\w+)(?:\s*\[[^\]]*\])?", rest):
        if (
            word[1] not in gains
            or word[1] in names
            or (names and not word[0].startswith((",", " and")))
        ):
            break
        names.append(word[1])
        rest = rest[word.end() :]
    return names


def _unit(text: str) -> str:
    """Return a unit with raised powers."""
    return POWER.sub(lambda found: f"<sup>{found[1].strip('()')}</sup>", text)


def _properties(template: Template) -> str:
    arrives = {
        "s": "$s = 0$ after a finite time",
        "e": "$e = 0$ after a finite time",
        "": "not in finite time",
    }
    measured = ", ".join(
        f"`y.{field}`" for field in Measurement._fields if field in reads(template)
    )
    conditions = "; ".join(
        notation.sentence(words, template.gains) for words in template.conditions
    )
    degree = template.relative_degree
    rows = {
        "relative degree": f"{degree}: acts on {notation.sentence(DEGREES[degree])}",
        "command": "$u$ is continuous" if template.continuous else "$u$ jumps",
        "arrives": arrives[template.finite_time],
        "conditions on the gains": conditions or "none on the gains alone",
        "gains to choose": ", ".join(f"`{gain}`" for gain in searched_gains(template)) or "none",
        "measures": measured or "nothing",
        "nominal model": "needed"
        if template.requires_model
        else 'optional, with `model="nominal"`',
        "plants": ", ".join(f"`{plant}`" for plant in template.plants)
        or "all with an actuator at each joint",
        "found by": ", ".join(
            f"`--need {need}`" for need, prop in PROPERTIES.items() if prop.holds(template)
        )
        or "its name",
    }
    lines = "\n".join(f"| {what} | {words} |" for what, words in rows.items())
    return f"## Properties\n\n| | |\n|---|---|\n{lines}"


def body(template: Template) -> str:
    """Return what a docstring says between formula and gains, with its equations typeset."""
    text = GAINS.split(SOURCE.split(template.doc)[0])[0]
    formula = entry(template).formula
    return "\n\n".join(_paragraphs(text, template.gains, formula)) or "Nothing more."


def _paragraphs(text: str, names, formula: str) -> Iterator[str]:
    """Yield the paragraphs of a docstring as Markdown, without its formula."""
    first, *later = text.strip("\n").split("\n\n")
    rest = _without_head(" ".join(first.split()), formula)
    if rest:
        yield _prose(rest, names)
    for paragraph in later:
        if not paragraph.startswith("    "):
            yield _prose(" ".join(paragraph.split()), names)
        elif " ".join(paragraph.split()).rstrip(".") != formula:
            yield _block(paragraph, names)


def _without_head(text: str, formula: str) -> str:
    """Return a paragraph without `Name: formula.` at its beginning."""
    place = text.find(formula)
    if place >= 0 and formula:
        return text[place + len(formula) :].lstrip(". ")
    return "" if text.endswith(":") else text


def _block(paragraph: str, names) -> str:
    """Return indented lines: equations, or a table as it stands."""
    lines = inspect.cleandoc(paragraph).splitlines()
    if all("=" in line for line in lines):
        return _display("; ".join(line.strip().rstrip(",") for line in lines), names)
    return "```text\n" + "\n".join(lines) + "\n```"


def _prose(text: str, names) -> str:
    """Return sentences as Markdown; laws and plants that they name in backquotes are links."""
    if names is not None:
        text = notation.sentence(text, names)
    else:
        text = text.replace("+-", "±").replace("<", "&lt;")

    def linked(found: re.Match) -> str:
        name = found[1]
        if name in laws():
            folder = "laws"
        else:
            folder = "plants" if name in plants() else ""
        if folder:
            return f"[`{name}`](../{folder}/{name}.md)"
        return found[0]

    return re.sub(r"`(\w+)`", linked, text)


def _c_form(name: str) -> str:
    """Return the law in C99, without the header that all exported laws share."""
    code = law_to_c(library_law(name)).rpartition(HEADER_END)[2].strip()
    words = (
        f"`smc-mujoco export {name}.c` writes this law as one file, with [the "
        "header](../c.md) at its top."
    )
    return (
        f'## In C {{ data-search-exclude }}\n\n{words}\n\n??? note "The law in C99"\n\n'
        + _indented(f"```c\n{code}\n```")
    )


def _indented(text: str) -> str:
    return "\n".join(f"    {line}".rstrip() for line in text.splitlines())


def _listing(title: str, intro: str, templates: Mapping[str, Template]) -> str:
    """Return one page for all surfaces, or all estimators."""
    parts = [f"# {title}", intro]
    for name, template in templates.items():
        parsed = entry(template)
        words = re.search(r"[a-z]{4,}", parsed.formula) and "=" not in parsed.formula
        if words:
            formula = parsed.formula
        else:
            formula = _display(parsed.formula, template.gains)
        title = parsed.title or wording.in_words(name)
        short = re.split(" of |, | \\(", title)[0]
        parts += [f"## {short}", f"`{name}`" + f": {title}" * (title != short), formula]
        parts += [_gain_table(template).removeprefix("## Gains\n\n").partition("\n\n")[0]]
        parts += [
            body(template).replace("](../", "]("),
            _prose(parsed.source, None).replace("](../", "]("),
        ]
    return "\n\n".join(filter(None, parts)) + "\n"


def _plant_page(plant: Plant, drawn: Mapping[tuple[str, ...], bytes]) -> Page:
    name = plant.name
    doc, *source = SOURCE.split(described(plant), maxsplit=1)
    title, formula, about = equation(doc)
    if explained := explained_by(plant):
        formula = equation(SOURCE.split(described(explained))[0])[1]
        about = re.sub(r"\b(\w+)\.py\b", r"`\1`", about)
    laws_shown = figures.plant_laws(name)
    labels = figures.page_colours(laws_shown)
    key = "".join(
        f'<span style="--key: {colour}">{wording.law_name(law)}</span>'
        for law, colour in zip(laws_shown, labels, strict=True)
    )
    picture = f'![{title}]({name}.webp){{ loading=lazy width="1280" height="720" }}' * bool(
        drawn["still", name]
    )
    if source:
        numbers = f"## Numbers and source\n\n{_prose(' '.join(' '.join(source).split()), None)}"
    else:
        numbers = ""
    more = ""
    if "\n\n" in "".join(source):  # paragraphs after the source
        first, _, rest = "".join(source).partition("\n\n")
        numbers = f"## Numbers and source\n\n{_prose(' '.join(first.split()), None)}"
        more = "\n\n".join(
            _prose(" ".join(p.split()), plant.parameters) for p in rest.split("\n\n")
        )
    text = [
        f"# {title}",
        f"`{name}`",
        "\n\n".join(_equation(line, [*plant.parameters]) for line in formula),
        picture,
        "\n\n".join(
            _prose(_capital(" ".join(p.split()), plant), plant.parameters)
            for p in about.split("\n\n")
            if p.strip(" .\n")
        ),
        more,
        (
            f'<div class="figures">{_figure(drawn["plant_figure", name], "")}</div>\n<p '
            f'class="key">{key}</p>'
        ),
        "Without noise or disturbance, from the plant's own start.",
        "## Use it\n\n```python\nimport smc_mujoco as smc\n\nplant = "
        f'smc.plant("{name}"{_change(plant)})\n'
        f'trace = smc.run(smc.Scenario(plant=plant, law="{laws_shown[0]}"))\n```',
        _parameters(plant),
        _shape(plant),
        numbers,
        _mjcf(sys.modules[(explained or plant).build.__module__]),
    ]
    return Page(f"plants/{name}", _label(plant), "\n\n".join(filter(None, text)) + "\n")


def _label(plant: Plant) -> str:
    return plant.label or wording.in_words(plant.name)


def _change(plant: Plant) -> str:
    name, value = next(iter(plant.parameters.items()))
    return (f", n={2 * plant.n}" if plant.sizes[1] > 2 else "") + f", {name}={value:g}"


def described(plant: Plant) -> str:
    """Return the docstring of a plant's module."""
    return inspect.cleandoc(sys.modules[plant.build.__module__].__doc__ or "")


def explained_by(plant: Plant) -> Plant | None:
    """Return the plant whose module has the equation and parameters of this one, named as NAME.py,
    if there is one.
    """
    doc = described(plant)
    named = [name for name in re.findall(r"\b(\w+)\.py\b", doc) if name in plants()]
    if named and not equation(doc)[1]:
        return plants()[named[0]]
    return None


def equation(doc: str) -> tuple[str, list[str], str]:
    """Return a plant's title, its equations, and the rest of its docstring.

    The equations stand in the first sentence, as in `Title: M x'' = u + d. Sentences ...`, or below
    it as an indented block; there is none if another module has them.
    """
    first, _, body = doc.strip().partition("\n\n")
    title, _, rest = first.partition(": ")
    if body.startswith("    "):
        block, _, body = body.partition("\n\n")
        return title, _joined(block), f"{rest}\n\n{body}"
    if "=" not in rest:
        return title, [], f"{rest}\n\n{body}"
    words, rest = re.fullmatch(r"((?:[^=,]+, )*)(.*)", " ".join(rest.split())).groups()  # pyright: ignore
    end = re.search(r"\.\s|\.$|, |(?<=d)\s+\(", rest)
    if end:
        formula = rest[: end.start()]
        more = rest[end.end() :].rstrip(".").removesuffix(")")
    else:
        formula = rest
        more = ""
    return title, [formula], f"{words.rstrip(', ') or more}.\n\n{body}"


def _joined(block: str) -> list[str]:
    """Return the equations of an indented block; a line that is indented further continues the one
    before.
    """
    joined_lines: list[str] = []
    for line in block.splitlines():
        if line.startswith("     ") and joined_lines:
            joined_lines[-1] += "\n" * line.lstrip().startswith("[") + " " + line.strip()
        else:
            joined_lines.append(line.strip())
    return joined_lines


def _equation(text: str, names) -> str:
    """Return an equation as displayed LaTeX; `X = [a, b]` is a column, more rows are a matrix."""
    if "= [" not in text:
        return _display(text, names)
    left_side, _, right = text.partition(" = ")
    rows = [notation.clauses(row.strip()[1:-1].strip()) for row in right.split("\n")]
    if len(rows) == 1:
        rows = [[entry] for entry in rows[0]]
    latex = r" \\ ".join(
        " & ".join(notation.formula(entry.strip(), names) for entry in row) for row in rows
    )
    return (
        f'<div class="formula" markdown><div markdown>${notation.formula(left_side, names)} = '
        rf"\begin{{pmatrix}} {latex} \end{{pmatrix}}$</div></div>"
    )


def _capital(text: str, plant: Plant) -> str:
    """Return a text that begins with a capital letter, unless with a symbol."""
    first = text.split(" ", maxsplit=1)[0]
    if (len(first) == 1 and first != "a") or first in plant.parameters:
        return text
    return capital(text)


def units(plant: Plant) -> list[str]:
    """Return the unit of each parameter, from the comment beside, above or at the end of their
    dictionary in the module that has them.
    """
    named = explained_by(plant) or plant
    alike = [
        candidate for candidate in plants().values() if candidate.parameters == named.parameters
    ]
    has = re.compile(r"(?:^[A-Z\d_]+ = |^ +parameters=)\{").search
    for candidate in (named, *alike):  # one may have another's
        lines = inspect.getsource(sys.modules[candidate.build.__module__]).splitlines()
        for line_number, line in enumerate(lines):
            if has(line):
                above = itertools.takewhile(
                    lambda text: text.strip().startswith("#"), reversed(lines[:line_number])
                )
                end = next(text for text in lines[line_number:] if "}" in text)
                words = line.partition("#")[2] or end.partition("#")[2]
                if not words:
                    words = " ".join(text.partition("#")[2] for text in reversed([*above]))
                return [unit.strip() for unit in words.split(",") if unit.strip()]
    raise LookupError(f"no parameters of {plant.name}")


def _parameters(plant: Plant) -> str:
    rows = []
    for (name, value), unit in zip(plant.parameters.items(), units(plant), strict=True):
        rows.append(f"| `{name}` | ${notation.symbol(name)}$ | {value:g} | {_unit(unit)} |")
    return "## Parameters\n\n| name | symbol | value | unit |\n|---|---|---|---|\n" + "\n".join(
        rows
    )


def _shape(plant: Plant) -> str:
    """Return a table of channels, start, obstacles and builds."""
    start = ", ".join(f"{x:g} {unit}" for x, unit in zip(plant.x0, plant.units, strict=True))
    rows = {
        "joints": f"{plant.n}" + f", of which {plant.free} without an actuator" * bool(plant.free),
        "size": f"`n` from {plant.sizes[0]} to {plant.sizes[1]}"
        if plant.sizes[1] > plant.n
        else "",
        "start": start,
        "obstacles, `contact=`": ", ".join(f'`"{name}"`' for name in plant.contacts),
        "builds, `mechanism=`": ", ".join(f'`"{name}"`' for name in plant.mechanisms),
        "jumps": "; ".join(
            f"`jump_{size}`: {', '.join(f'{p} × {f:g}' for p, f in change.items())}"
            for size, change in plant.jumps.items()
        ),
        "a mismatch of `mass` scales": f"`{plant.mass}`",
    }
    return "## Joints, obstacles, builds\n\n| | |\n|---|---|\n" + "\n".join(
        f"| {what} | {words} |" for what, words in rows.items() if words
    )


def _mjcf(module) -> str:
    (name,) = set(re.findall(r'"(\w+\.xml)"', inspect.getsource(module)))
    if "compose(" in inspect.getsource(module):
        words = "One pendulum; the network composes `n` of them."
    else:
        words = ""
    code = model_path(name).read_text(encoding="utf-8").strip()
    return (
        f'## MJCF {{ data-search-exclude }}\n\n{words}\n\n??? note "models/{name}"\n\n'
        + _indented(f"```xml\n{code}\n```")
    )
