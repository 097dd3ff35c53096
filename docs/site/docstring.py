"""The docstring of a law, surface or velocity estimator, in parts.

It begins with `Name: formula`, continues with sentences on properties, and ends with `Source: ...`.
"""

import re
from typing import NamedTuple

from smc_mujoco.control.component import Template

SOURCE = re.compile(r"(?<![\w.])Sources?: ")
SENTENCE = re.compile(r"(?<=\.)(?<!\b[A-Z]\.)\s+(?=[A-Z`|])")  # not after an author's initial
DISCRETE = re.compile(r"\b(explicit|implicit|discreti[sz]|Euler|bilinear|sampled)", re.I)


class Entry(NamedTuple):
    """The parts of a docstring: name in words, formula, what the gains are, discretisation, other
    sentences, source.
    """

    title: str
    formula: str
    gains: str
    discretisation: str
    about: str
    source: str


def entry(template: Template) -> Entry:
    """Return the parts of a template's docstring."""
    text, *source = SOURCE.split(template.doc, maxsplit=1)
    first, *paragraphs = (" ".join(p.split()) for p in text.strip().split("\n\n"))
    head, *more = SENTENCE.split(first, maxsplit=1)
    if head.endswith(":") and paragraphs:
        head += " " + paragraphs.pop(0)
    title, colon, formula = head.removesuffix(".").partition(": ")
    sentences = []
    for p in (*more, *paragraphs):
        for s in SENTENCE.split(p):
            if s:
                sentences.append(s)
    gains = [s for s in sentences if s.startswith("Gains: ")]
    sentences = [s for s in sentences if s not in gains]
    discrete = [s for s in sentences if DISCRETE.search(s)]
    return Entry(
        title=title if colon else "",
        formula=formula if colon else title,
        gains=" ".join(gains).removeprefix("Gains: "),
        discretisation=" ".join(discrete),
        about=" ".join(s for s in sentences if s not in discrete),
        source=" ".join("".join(source).split()),
    )
