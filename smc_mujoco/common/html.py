"""Tables, pictures and films as HTML for notebooks, in the colour of the page, and whole pages.

All text but `Html` is escaped.
"""

import base64
import html
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from smc_mujoco.common.files import scratch

MAX_ROWS = 12  # lines of a table: chosen, so that a cell's output stays short
_CELL = "padding:2px 10px;vertical-align:top;text-align:"
PHONE = 600  # px, chosen: narrower windows show a picture for a phone
# Tables scroll within the page, and what is said below them stays in sight. Pictures are drawn on
# white: on a dark page they are inverted, with their hues kept.
STYLE = f"""
:root {{ color-scheme: light dark; }}
body {{ margin: 0 auto; max-width: 1100px; padding: 16px; font: 16px/1.5 system-ui, sans-serif; }}
h1 {{ font-size: 1.6em; line-height: 1.2; overflow-wrap: anywhere; }}
section {{ margin: 32px 0; overflow-x: auto; }}
caption, td[colspan] div {{ position: sticky; left: 0; max-width: min(70ch, 100vw - 52px); }}
caption, th:first-child, td:first-child {{ padding-left: 0 !important; }}
img {{ display: block; width: 100%; height: auto; }}
@media (max-width: {PHONE}px) {{
  table {{ font-size: 14px; }}
  pre {{ white-space: pre-wrap;
    font-size: min(13px, (100vw - 34px) / var(--columns, 1) / 0.61); }} }}
@media (prefers-color-scheme: dark) {{
  img {{ filter: invert(0.9) hue-rotate(180deg); mix-blend-mode: lighten; }} }}
"""


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
    sides = []
    for i in range(width):
        if i in numbers:
            sides.append("right")
        else:
            sides.append("left")
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
    lines = []
    for row in rows[:max_rows]:
        lines.append(f"<tr>{_cells('td', row, sides, '')}</tr>")
    wide = f'<tr><td colspan="{width}" style="{_CELL}left;opacity:0.75">'
    if len(rows) > max_rows:
        lines.append(f"{wide}and {len(rows) - max_rows} more</td></tr>")
    if note:
        lines.append(f"{wide}<div>{text(note)}</div></td></tr>")
    return Html("".join([*parts, f"<tbody>{''.join(lines)}</tbody></table>"]))


def _cells(tag: str, values: Sequence[object], sides: Sequence[str], style: str) -> str:
    """Return the cells of a row; `sides` are their alignments."""
    cells = []
    for value, side in zip(values, sides, strict=True):
        cells.append(f'<{tag} style="{style}{_CELL}{side}">{text(value)}</{tag}>')
    return "".join(cells)


def fields(values: Mapping[str, object], caption: str) -> Html:
    """Return a table of names with their values."""
    rows = []
    for name, value in values.items():
        rows.append((Html(f"<i>{text(name)}</i>"), value))
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


def picture(draw: Callable[[Path, str | None], object], about: str) -> Html:
    """Return an SVG of a page's width, and one of a phone's, which a narrow window shows.

    Args:
      draw: writes the picture to a path, of a size of `smc.figure`.
      about: what it shows, for those who do not see it.
    """
    sources = []
    with scratch() as folder, warnings.catch_warnings():
        warnings.filterwarnings("ignore", "size=.* makes the figure")  # a phone's page scrolls
        warnings.filterwarnings("ignore", "plot leaves out")  # tables have the rest
        for size in ("ieee-column", None):
            draw(folder / "picture.svg", size)
            data = base64.b64encode((folder / "picture.svg").read_bytes()).decode()
            sources.append(f"data:image/svg+xml;base64,{data}")
    narrow = f'<source media="(max-width: {PHONE}px)" srcset="{sources[0]}">'
    return Html(f'<picture>{narrow}<img src="{sources[1]}" alt="{text(about)}"></picture>')


def page(title: str, parts: Iterable[str]) -> str:
    """Return a whole page of parts that are HTML.

    It needs no other file, and a policy in it forbids the browser to load one.
    """
    policy = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
    sections = "\n".join(f"<section>{part}</section>" for part in parts)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<title>{text(title)}</title>
<style>{STYLE}</style>
</head>
<body>
<h1>{text(title)}</h1>
{sections}
</body>
</html>
"""


def in_notebook() -> bool:
    """Return whether this process is the kernel of a notebook."""
    from rich.console import Console

    return Console().is_jupyter
