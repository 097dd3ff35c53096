"""What pages show that the package knows, written into them when the site is built: a marker in a page -> its text."""

import inspect
import re
from collections.abc import Iterator

import smc_mujoco as smc
from smc_mujoco.evidence.audit.paper import paper
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.studies import scene

TASKS = re.compile(r"^    ([A-Z][a-z ,]+): ((?:.|\n {8})+)$", re.MULTILINE)  # of the package's docstring


def tasks() -> dict[str, list[str]]:
    """Return task -> the public names that `help(smc)` lists for it."""
    return {task: re.findall(r"\w+", names) for task, names in TASKS.findall(smc.__doc__ or "")}


def reference() -> Iterator[str]:
    """Yield the public names by task, as mkdocstrings reads them."""
    for task, names in tasks().items():
        origins = [f"::: {smc._ORIGINS[name]}.{name}" for name in names if name in smc._ORIGINS]
        yield "\n".join([f"## {task}\n", *origins, ""])


def definitions() -> Iterator[str]:
    """Yield a table of the metrics, as their docstrings define them."""
    yield "| metric | unit | definition |\n|---|---|---|"
    for metric in metrics():
        unit = re.sub(r"[(){}]", "", metric.unit).replace("^2", "²")
        yield _row(f"`{metric.name}`", unit, _plain(inspect.getdoc(metric.formula) or ""))


def instead() -> Iterator[str]:
    """Yield a table of what holds instead of each claim of Gaber's paper that does not hold everywhere."""
    yield "| claim | instead | shown by |\n|---|---|---|"
    for claim in paper("gaber").claims.values():
        if claim.instead:
            yield _row(f"{claim.id}: {_plain(claim.text)}", _plain(claim.instead), f"`{claim.shown_by}`")


def questions() -> Iterator[str]:
    """Yield a table of the scenes."""
    yield "| scene | question |\n|---|---|"
    for name, path in scene.scenes().items():
        yield _row(f"`{name}`", _plain(scene.question(path)))


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def _plain(text: str) -> str:
    """Return text in one line, in which no letter means anything to Markdown."""
    return re.sub(r"([|_*<\[\]`\\])", lambda found: f"&#{ord(found[1])};", " ".join(text.split()))


SHOWN = {
    "<!-- every public name -->": reference,
    "<!-- every metric -->": definitions,
    "<!-- what holds instead of each claim -->": instead,
    "<!-- every scene -->": questions,
}


def filled(markdown: str) -> str:
    """Return a page with what its markers stand for."""
    for marker, lines in SHOWN.items():
        if marker in markdown:
            markdown = markdown.replace(marker, "\n".join(lines()))
    return markdown
