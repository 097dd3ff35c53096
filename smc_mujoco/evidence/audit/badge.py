"""A badge of an audit: an SVG file with the number of the paper's own sentences by verdict, as READMEs show."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

from smc_mujoco.common.files import replacing, with_ending
from smc_mujoco.draw import style
from smc_mujoco.evidence.audit.verdict import ANSWERS, PARTLY, REFUTED, SUPPORTED, VERDICTS, Claim, totals

COLOURS: dict[str, str] = dict.fromkeys(VERDICTS, "#6a6a6a")  # white on each: 5:1
COLOURS |= {SUPPORTED: "#2b7a3d", PARTLY: "#8a6100", REFUTED: "#b3322b"}
COLOURS |= dict.fromkeys(ANSWERS.values(), "#3d5a80")  # of a question
LABEL_COLOUR = "#444"
HEIGHT, FONT_SIZE, MARGIN = 20, 11, 6  # px
FONT = "Verdana,Geneva,DejaVu Sans,sans-serif"


def save(name: str, claims: Sequence[Claim], path: str | Path) -> Path:
    """Write the badge of a paper to an .svg file, and return its path."""
    path = with_ending(path, ".svg")
    with replacing(path) as file:
        file.write_text(svg(name, claims), encoding="utf-8")
    return path


def svg(name: str, claims: Sequence[Claim]) -> str:
    """Return the badge: the paper's name, and a field for each verdict that some sentence of the paper has."""
    fields = [(f"claims of {name}", LABEL_COLOUR)]
    for verdict, count in totals(claims).items():
        fields.append((f"{count} {verdict.removesuffix(' supported')}", COLOURS[verdict]))
    about = escape(f"{fields[0][0]}: {', '.join(text for text, _ in fields[1:])}")
    parts, x = [], 0
    for text, colour in fields:
        length = style.width(text, FONT_SIZE)  # DejaVu Sans is as wide as Verdana
        width = round(length + 2 * MARGIN)
        place = f'x="{x + width / 2:g}" y="14" textLength="{length:.0f}" lengthAdjust="spacingAndGlyphs"'
        parts.append(f'<rect x="{x}" width="{width}" height="{HEIGHT}" fill="{colour}"/>')
        parts.append(f"<text {place}>{escape(text)}</text>")
        x += width
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{x}" height="{HEIGHT}" role="img" aria-label="{about}">'
        f'<title>{about}</title><g fill="#fff" text-anchor="middle" font-family="{FONT}" font-size="{FONT_SIZE}">'
        f"{''.join(parts)}</g></svg>\n"
    )
