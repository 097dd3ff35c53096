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
SHORT_WORDS = {PARTLY: "partly"}
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
    counts = totals(claims)
    fields = [(f"claims of {name}", LABEL_COLOUR)]
    fields += [(f"{count} {SHORT_WORDS.get(verdict, verdict)}", COLOURS[verdict]) for verdict, count in counts.items()]
    about = f"{fields[0][0]}: {', '.join(text for text, _ in fields[1:])}"
    boxes, texts, x = [], [], 0.0
    for text, colour in fields:
        length = style.width(text, FONT_SIZE)  # DejaVu Sans is as wide as Verdana
        field_width = round(length + 2 * MARGIN)
        boxes.append(f'<rect x="{x:g}" width="{field_width}" height="{HEIGHT}" fill="{colour}"/>')
        shown, middle = escape(text), x + field_width / 2
        place = f'textLength="{length:.0f}" lengthAdjust="spacingAndGlyphs"'
        texts.append(
            f'<text x="{middle:g}" y="15" fill="#010101" fill-opacity=".3" aria-hidden="true" {place}>{shown}</text>'
        )
        texts.append(f'<text x="{middle:g}" y="14" {place}>{shown}</text>')
        x += field_width
    size, about = f'width="{x:g}" height="{HEIGHT}"', escape(about)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img" aria-label="{about}"><title>{about}</title>'
        '<linearGradient id="s" x2="0" y2="100%"><stop offset="0" stop-color="#bbb" stop-opacity=".1"/>'
        '<stop offset="1" stop-opacity=".1"/></linearGradient>'
        f'<clipPath id="r"><rect {size} rx="3" fill="#fff"/></clipPath>'
        f'<g clip-path="url(#r)">{"".join(boxes)}<rect {size} fill="url(#s)"/></g>'
        f'<g fill="#fff" text-anchor="middle" font-family="{FONT}" font-size="{FONT_SIZE}">{"".join(texts)}</g></svg>\n'
    )
