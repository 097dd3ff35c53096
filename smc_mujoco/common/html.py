"""Short tables, pictures and films as HTML for notebooks, in the colour of the page.

All text but `Html` is escaped.
"""

import base64
import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment

MAX_ROWS = 12  # lines of a table: chosen, so that a cell's output stays short
_CELL = "padding:2px 10px;vertical-align:top;text-align:"


class Html(str):
    """Text that is HTML already."""


def text(value: object) -> Html:
    """Return a value as HTML."""
    if isinstance(value, Html):
        return value
    return Html(html.escape(str(value)))


def strong(value: object) -> Html:
    """Return a value in bold letters."""
    return Html(f"<b>{text(value)}</b>")


def table(
    headings: Sequence[object],
    rows: Sequence[Sequence[object]],
    caption: object = "",
    note: object = "",
    numbers: range = range(0),
    max_rows: int = MAX_ROWS,
) -> Html:
    """Return a table: caption above, note below, the columns `numbers` aligned to the right."""
    width = 1
    if headings or rows:
        width = len(headings or rows[0])
    sides = ["right" if i in numbers else "left" for i in range(width)]
    parts = [
        '<table style="border-collapse:collapse;font-variant-numeric:tabular-nums;color:inherit">'
    ]
    if caption:
        style = "caption-side:top;text-align:left;color:inherit;padding:2px 10px"
        parts.append(f'<caption style="{style}">{strong(caption)}</caption>')
    if headings:
        cells = _cells(
            "th", headings, sides, "font-weight:normal;border-bottom:1px solid currentColor;"
        )
        parts.append(f"<thead><tr>{cells}</tr></thead>")
    lines = [f"<tr>{_cells('td', row, sides, '')}</tr>" for row in rows[:max_rows]]
    wide = f'<tr><td colspan="{width}" style="{_CELL}left;opacity:0.75">'
    if len(rows) > max_rows:
        lines.append(f"{wide}and {len(rows) - max_rows} more</td></tr>")
    if note:
        lines.append(f"{wide}{text(note)}</td></tr>")
    return Html("".join([*parts, f"<tbody>{''.join(lines)}</tbody></table>"]))


def _cells(tag: str, values: Sequence[object], sides: Sequence[str], style: str) -> str:
    """Return the cells of a row; `sides` are their alignments."""
    return "".join(
        f'<{tag} style="{style}{_CELL}{side}">{text(value)}</{tag}>'
        for value, side in zip(values, sides, strict=True)
    )


def fields(values: Mapping[str, object], caption: str) -> Html:
    """Return a table of names with their values."""
    rows = [(Html(f"<i>{text(name)}</i>"), value) for name, value in values.items()]
    return table((), rows, caption, max_rows=99)


def embedded(content: bytes, kind: str, width: float | None = None) -> Html:
    """Return a picture or a film, kept in the page itself and no wider than the page."""
    data = base64.b64encode(content).decode()
    source = f'src="data:{kind};base64,{data}" style="max-width:100%;height:auto"'
    if width is not None:
        source += f' width="{width:.0f}"'
    if kind.startswith("video/"):
        return Html(f"<video {source} controls autoplay muted loop playsinline></video>")
    return Html(f"<img {source}>")


def in_notebook() -> bool:
    """Return whether this process is the kernel of a notebook."""
    from rich.console import Console

    return Console().is_jupyter


def environment(templates: Path) -> "Environment":
    """Return the jinja2 environment of a folder of templates: what they insert is escaped, a
    missing name an error.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    options = {
        "autoescape": True,
        "undefined": StrictUndefined,
        "trim_blocks": True,
        "lstrip_blocks": True,
    }
    return Environment(loader=FileSystemLoader(templates), **options)
