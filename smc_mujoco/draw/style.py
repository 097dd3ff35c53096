"""Style of figures and films: pages, neutral colours, lines and marks."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from smc_mujoco.simulation.trace import Trace

INK = "#1F2429"
MUTED = "#646C75"
GRID = "#E3E6E9"
PAPER = "#FFFFFF"
FAILED = "#A9AFB6"
DISTURBANCE = "#3A3F46"
BAND = "#DDE1E5"
RULE = "#B9BFC5"
# Friction and contact. Chosen from a grid as one of the farthest in CIELAB from the laws' colours,
# the disturbance's and paper, with any colour blindness (G. M. Machado et al., IEEE TVCG 15(6),
# 2009).
REACTION = "#9018F0"
DARK_PAGE = 0.2  # luminance of the darkest light page; chosen
LOG_RANGE = 5.0  # largest over smallest value above which an axis may be logarithmic; chosen
MARKS = "osD^vPXh>*dp"  # of laws, for readers who see no colours; after twelve they begin again
# of the runs in a picture, in widths of a line, for the same readers; chosen
DASHES = [
    "-",
    (0, (6, 1.4)),
    (0, (5, 1.3, 1.2, 1.3)),
    (0, (1.5, 1.2)),
    (0, (5, 1.3, 1.2, 1.3, 1.2, 1.3)),
    (0, (3, 1)),
]
# Inches. A full page is 845 px of SVG, so that its least letters have 11 px in 800 px, as in a
# README. Letters of narrower pages than a journal's have 8 points, those of slides 16.
FULL_WIDTH = 8.8
JOURNAL_WIDTH = 8.5
SLIDE_WIDTH = 13.3
RC = {
    "font.family": "DejaVu Sans",
    "font.size": 10.5,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.facecolor": PAPER,
    "axes.titlecolor": INK,
    "axes.edgecolor": "#9BA2A9",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.titlesize": 11,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.unicode_minus": True,
    "axes.formatter.useoffset": False,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelsize": 9.5,
    "ytick.labelsize": 9.5,
    "legend.frameon": False,
    "lines.linewidth": 1.5,
    "lines.markersize": 6.0,
    "lines.solid_capstyle": "round",
    "figure.facecolor": PAPER,
    "savefig.facecolor": PAPER,
    "svg.fonttype": "path",
    "pdf.fonttype": 42,  # TrueType, as journals ask for
    "svg.hashsalt": "smc_mujoco",  # the same traces give the same file
}


def page(width: float = FULL_WIDTH):
    """Return a context in which matplotlib draws in this style, on a page of this width in inches.

    A full page has the letters and lines of RC. On journal pages and columns they are smaller, with
    letters of 8 points, on slides larger, with letters of 16.
    """
    from matplotlib import rc_context

    if width < JOURNAL_WIDTH:
        letters = 8.0
    elif width >= SLIDE_WIDTH:
        letters = 16.0
    else:
        letters = RC["font.size"]
    scale = letters / RC["font.size"]
    keys = ("size", "linewidth", "markersize")
    on_dark = neutral_on_dark()
    scaled: Any = {}
    for key, value in RC.items():
        if key.endswith(keys):
            scaled[key] = value * scale
        else:
            scaled[key] = on_dark.get(value, value)
    return rc_context(scaled)


def neutral_on_dark() -> dict[Any, str]:
    """Return the neutral colours of this style -> those on the caller's page, if that is dark, as
    in `plt.style.context("dark_background")`; {} on a light page.
    """
    from matplotlib import rcParams
    from matplotlib.colors import to_hex

    if rcParams["axes.facecolor"] == "none":
        return {}
    paper = to_hex(rcParams["axes.facecolor"]).upper()
    if luminance(paper) > DARK_PAGE:
        return {}
    ink = to_hex(rcParams["text.color"]).upper()
    shares = {GRID: 0.16, BAND: 0.25, RULE: 0.4, FAILED: 0.55, MUTED: 0.7, DISTURBANCE: 0.85}
    mixtures = {}
    for colour, share in shares.items():
        mixtures[colour] = mixed(paper, ink, share)
    return {PAPER: paper, INK: ink, **mixtures}


def points(size: float) -> float:
    """Return a size in points on this page, given the size on a full page."""
    from matplotlib import rcParams

    return size * rcParams["font.size"] / RC["font.size"]


def looks(traces: Sequence[Trace]) -> list[dict[str, Any]]:
    """Return the look of the line of each trace in a picture, its dashes, which tell it from the
    others without colour.
    """
    return [{"ls": DASHES[i % len(DASHES)]} for i in range(len(traces))]


def _linear(colour: str) -> np.ndarray:
    """Return the linear red, green and blue of a colour of sRGB, 0 .. 1."""
    c = np.array(rgb(colour)) / 255
    curved = ((c + 0.055) / 1.055) ** 2.4
    return np.where(c <= 0.04045, c / 12.92, curved)


def rgb(colour: str) -> tuple[int, int, int]:
    """Return #RRGGBB as three numbers, 0 .. 255."""
    return tuple(bytes.fromhex(colour[1:]))  # pyright: ignore[reportReturnType]


def mixed(colour: str, other: str, share: float) -> str:
    """Return a colour mixed with this share of another."""
    pairs = zip(rgb(colour), rgb(other), strict=True)
    numbers = bytes(round(a + share * (b - a)) for a, b in pairs)
    return "#" + numbers.hex().upper()


def luminance(colour: str) -> float:
    """Return the relative luminance of WCAG 2.2, 0 for black and 1 for white."""
    shares = np.array([0.2126, 0.7152, 0.0722])
    return float(shares @ _linear(colour))
