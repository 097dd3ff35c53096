"""Short tables, curves, pictures and films as HTML for notebooks, in the colour of the page; all text is escaped."""

import base64
import html
from collections.abc import Mapping, Sequence

import numpy as np

MAX_ROWS = 12  # lines of a table: chosen, so that a cell's output stays short
PIECES = 150  # of a long curve, each drawn by its lowest and its highest value: chosen, one for every 2 px of a panel
WIDTH, HEIGHT = 300, 96  # px of a panel
_CELL = "padding:2px 10px;vertical-align:top;text-align:"
_MARGINS = 58, 6, 16, 18  # px at the left, right, top and bottom of a panel


class Html(str):
    """Text that is HTML already."""


def text(value: object) -> Html:
    """Return a value as HTML."""
    return value if isinstance(value, Html) else Html(html.escape(str(value)))


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
    width = len(headings or rows[0]) if headings or rows else 1
    sides = ["right" if i in numbers else "left" for i in range(width)]
    parts = [
        '<table style="border-collapse:collapse;font-variant-numeric:tabular-nums;color:inherit">',
        f'<caption style="caption-side:top;text-align:left;color:inherit;padding:2px 10px">{strong(caption)}</caption>'
        if caption
        else "",
    ]
    if headings:
        cells = _cells("th", headings, sides, "font-weight:normal;border-bottom:1px solid currentColor;")
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
        f'<{tag} style="{style}{_CELL}{side}">{text(value)}</{tag}>' for value, side in zip(values, sides, strict=True)
    )


def fields(values: Mapping[str, object], caption: object = "", note: object = "") -> Html:
    """Return a table of names with their values."""
    rows = [(Html(f"<i>{text(name)}</i>"), value) for name, value in values.items()]
    return table((), rows, caption, note, max_rows=99)


def panel(t: np.ndarray, curves: Sequence[np.ndarray], heading: str, reference: np.ndarray | None = None) -> Html:
    """Return curves and a dashed reference, (K,) each, over times t, s, as SVG, with their range at the axes."""
    drawn = [curve for curve in (*curves, *([] if reference is None else [reference])) if np.isfinite(curve).any()]
    if not drawn or len(t) < 2:
        return Html("")
    low, high = min(float(np.nanmin(c)) for c in drawn), max(float(np.nanmax(c)) for c in drawn)
    span = (high - low) or abs(high) or 1.0
    left, right, top, bottom = _MARGINS
    x = left + (t - t[0]) / (t[-1] - t[0]) * (WIDTH - left - right)
    lines = []
    for curve in curves:
        lines += _lines(x, top + (high - curve) / span * (HEIGHT - top - bottom), 'stroke-width="1.2"')
    if reference is not None:
        y = top + (high - reference) / span * (HEIGHT - top - bottom)
        lines += _lines(x, y, 'stroke-width="1" stroke-dasharray="4 3" opacity="0.6"')
    end = HEIGHT - bottom
    letters = 'fill="currentColor" font-size="10" font-family="sans-serif"'
    labels = [
        f'<text x="{left}" y="11" {letters} font-weight="bold">{text(heading)}</text>',
        f'<text x="{left - 4}" y="{top + 8}" {letters} text-anchor="end">{high:.3g}</text>',
        f'<text x="{left - 4}" y="{end}" {letters} text-anchor="end">{low:.3g}</text>'
        if f"{low:.3g}" != f"{high:.3g}"
        else "",
        f'<text x="{left}" y="{HEIGHT - 5}" {letters}>{t[0]:.3g}</text>',
        f'<text x="{WIDTH - right}" y="{HEIGHT - 5}" {letters} text-anchor="end">{t[-1]:.3g} s</text>',
    ]
    axes = f'<path d="M{left} {top}V{end}H{WIDTH - right}" fill="none" stroke="currentColor" opacity="0.4"/>'
    return Html(
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" '
        f'role="img"><title>{text(heading)}</title>{axes}{"".join(lines)}{"".join(labels)}</svg>'
    )


def _lines(x: np.ndarray, y: np.ndarray, style: str) -> list[str]:
    """Return a curve as a polyline, through the lowest and highest value of each of PIECES; [] if none is finite."""
    known = np.isfinite(y)
    x, y = x[known], y[known]
    if len(x) > 2 * PIECES:
        pieces = np.array_split(np.arange(len(x)), PIECES)
        ends = [sorted({int(p[0] + np.argmin(y[p])), int(p[0] + np.argmax(y[p]))}) for p in pieces]
        kept = np.array(sorted({0, len(x) - 1, *(k for pair in ends for k in pair)}))
        x, y = x[kept], y[kept]
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x.tolist(), y.tolist(), strict=True))
    return [f'<polyline points="{points}" fill="none" stroke="currentColor" {style}/>'] if len(x) else []


def embedded(content: bytes, kind: str, width: float | None = None) -> Html:
    """Return a picture or a film, kept in the page itself and no wider than the page."""
    source = f'src="data:{kind};base64,{base64.b64encode(content).decode()}" style="max-width:100%;height:auto"'
    source += "" if width is None else f' width="{width:.0f}"'
    if kind.startswith("video/"):
        return Html(f"<video {source} controls autoplay muted loop playsinline></video>")
    return Html(f"<img {source}>")


def in_notebook() -> bool:
    """Return whether this process is the kernel of a notebook."""
    from rich.console import Console

    return Console().is_jupyter
