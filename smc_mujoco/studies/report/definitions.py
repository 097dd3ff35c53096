"""The definitions that a report's numbers link to: those of definitions.md, and the metrics' docstrings."""

import inspect
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from smc_mujoco.analysis.differences import OF_SCALE, OF_VALUE
from smc_mujoco.analysis.ranking import SEEDS
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.studies.report import words

FILE = Path(__file__).parent / "templates" / "definitions.md"


class Term(NamedTuple):
    """A definition: its anchor in the page, what it is called, and its paragraphs."""

    id: str
    name: str
    parts: tuple[str, ...]


def terms(kinds: Sequence[str]) -> list[Term]:
    """Return the definitions of definitions.md; of the kinds of margin only these."""
    text = FILE.read_text(encoding="utf-8")
    text = text.format(of_value=100 * OF_VALUE, of_scale=100 * OF_SCALE, seeds=SEEDS)
    found = []
    for entry in text.removeprefix("## ").split("\n## "):
        head, _, body = entry.partition("\n")
        id, _, name = head.partition(": ")
        found.append(Term(id, name, _paragraphs(body)))
    by_id = {term.id: term for term in found}
    return [
        *(term for term in found if not term.id.startswith("margin-")),
        *(by_id[f"margin-{kind}"] for kind in kinds),
    ]


def metric_terms() -> list[Term]:
    """Return the definition of every metric, its docstring with signs as people write them."""
    docs = {metric.name: inspect.getdoc(metric.formula) or "" for metric in metrics()}
    return [Term(f"metric-{name}", name, tuple(map(words.pretty, _paragraphs(doc)))) for name, doc in docs.items()]


def _paragraphs(text: str) -> tuple[str, ...]:
    return tuple(" ".join(part.split()) for part in text.strip().split("\n\n"))
