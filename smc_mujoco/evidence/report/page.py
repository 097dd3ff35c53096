"""A report as one HTML file, which needs no network and no other file.

Text is escaped by jinja2. Pictures and films are data URIs. A content security policy in the file
forbids everything that is not in it.
"""

import base64
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from markupsafe import Markup

from smc_mujoco.common import html
from smc_mujoco.common.files import replacing, scratch
from smc_mujoco.common.tabular import Tabular
from smc_mujoco.common.text import number
from smc_mujoco.common.version import __version__
from smc_mujoco.draw.page import Size
from smc_mujoco.evidence.audit.verdict import MARKS, Claim, summary

PHONE = "ieee-column"  # size of a picture
TEMPLATES = Path(__file__).parent / "templates"


class Section(NamedTuple):
    """A part of a report with a heading."""

    id: str
    title: str
    parts: Sequence[Markup]


def write(
    path: Path, title: str, over: str, about: str, made_by: str, sections: Sequence[Section]
) -> Path:
    """Write a report as an HTML file; `over` and `about` stand above and below its title."""
    made = html.environment(TEMPLATES).get_template("page.jinja")
    page = made.render(
        css=Markup((TEMPLATES / "style.css").read_text(encoding="utf-8")),
        title=title,
        over=over,
        about=about,
        made_by=made_by,
        version=__version__,
        sections=sections,
    )
    with replacing(path) as part:
        part.write_text(page, encoding="utf-8")
    return path


def text(words: str, kind: str = "") -> Markup:
    """Return a paragraph of a class of the style sheet."""
    return Markup('<p class="{}">{}</p>').format(kind, words)


def heading(words: str) -> Markup:
    """Return a heading within a section."""
    return Markup("<h3>{}</h3>").format(words)


def tables(shown: Iterable[Tabular]) -> list[Markup]:
    """Return tables, each as a notebook shows it."""
    return [Markup(f'<div class="wide">{table._repr_html_()}</div>') for table in shown]


def folded(words: str, parts: Iterable[Markup]) -> Markup:
    """Return parts that a click on some words shows."""
    shown = Markup("\n").join(parts)
    return Markup("<details><summary>{}</summary>{}</details>").format(words, shown)


def picture(draw: Callable[[Path, Size], object], about: str) -> Markup:
    """Return what a function draws as SVG, of a page's width and of a phone's, with its meaning in
    words.
    """
    sources = []
    with scratch() as folder:
        path = folder / "picture.svg"
        for size in (PHONE, None):
            draw(path, size)
            sources.append(uri("image/svg+xml", path.read_bytes()))
    figure = (
        '<figure><picture><source media="(max-width: 600px)" srcset="{}"><img src="{}" alt="{}">'
        "</picture><figcaption>{}</figcaption></figure>"
    )
    return Markup(figure).format(*sources, about, about)


def film(content: bytes, about: str) -> Markup:
    """Return an MP4 film, with its meaning in words."""
    video = '<video controls autoplay loop muted playsinline src="{}" aria-label="{}"></video>'
    shown = Markup(video).format(uri("video/mp4", content), about)
    return Markup("<figure>{}<figcaption>{}</figcaption></figure>").format(shown, about)


def claims(judged: Sequence[Claim]) -> Markup:
    """Return claims with their verdicts, each of which opens to its numbers."""
    template = html.environment(TEMPLATES).get_template("claims.jinja")
    sets = dict.fromkeys(name for claim in judged for name in claim.verdicts)
    verdicts = dict.fromkeys(claim.verdict for claim in judged)
    return Markup(
        template.render(
            claims=judged,
            summary=summary(judged),
            sets=list(sets),
            verdicts=list(verdicts),
            marks=MARKS,
            number=number,
        )
    )


def uri(kind: str, data: bytes) -> str:
    """Return bytes as a data URI."""
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"
