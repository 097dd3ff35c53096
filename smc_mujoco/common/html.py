"""Texts, pictures and films as HTML for notebooks, in the colour of the page, and whole pages.

All text but `Html` is escaped.
"""

import base64
import html
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path

from smc_mujoco.common.files import scratch

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
  table {{ font-size: 14px; }} }}
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
