"""The figure of an audit: how far every check is from its threshold, a row for each claim.

    audit("levant_1993").figure("checks.pdf")

A check is a dot at value / limit, or at limit / value if the value must be larger. Left of 1 the
check holds, and its dot is filled. Where the ratio tells nothing, as with a limit of 0, the dot is
at the edge.
"""

import math
import os
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.draw import page as pages
from smc_mujoco.draw import style
from smc_mujoco.draw.page import Size
from smc_mujoco.evidence.audit.verdict import ANSWERS, MARKS, VERDICTS, Check, Claim

COLOURS = dict(zip(VERDICTS, ("#2b7a3d", "#8a6100", "#b3322b", "#6a6a6a", "#6a6a6a"), strict=True))
COLOURS |= dict.fromkeys(ANSWERS.values(), "#3d5a80")  # answers to questions
ROW_HEIGHT = 26.0  # points on a full page, height of a claim's row
MAX_DECADES = 3.0  # on each side of 1
TICKS = (-MAX_DECADES, -1.0, 0.0, 1.0, MAX_DECADES)
SETS_SHARE = 0.5  # share of a row's height over which its sets of gains are spread
TEXT_SHARE = 0.36  # share of the page's width for the claims' texts


def figure(
    claims: Sequence[Claim],
    title: str,
    path: str | os.PathLike[str] | None = None,
    size: Size = None,
    format: str | None = None,
    fig: Figure | SubFigure | None = None,
) -> Figure | SubFigure:
    """Draw the checks of claims as multiples of their thresholds; options as of `smc.figure`."""
    if not claims:
        raise ScenarioError("no claims to draw: give at least one")
    paths = pages.files(path, format)
    width, height = pages.measure(size, fig)
    with style.page(width):
        handles = []
        for kind, colour in COLOURS.items():
            if any(claim.verdict == kind for claim in claims):
                handles.append(Line2D([], [], color=colour, marker="o", ls="", label=kind))
        rows = style.points(ROW_HEIGHT * (len(claims) + 2.5)) / 72
        page = pages.blank(width, height or pages.head_height(width, handles) + rows, fig)
        ax = page.subplots()
        letters = style.points(9.5)
        room = TEXT_SHARE * 72 * width
        names = []
        for row, claim in enumerate(claims):
            draw(ax, row, claim)
            name = f"{MARKS[claim.verdict]} {claim.id}  {claim.text}"
            names.append(style.cropped(name, room, letters))
        ax.axvline(0.0, color=style.INK, lw=style.points(1.2))
        ax.set(xlim=(-1.08 * MAX_DECADES, 1.08 * MAX_DECADES), ylim=(len(claims) - 0.5, -0.5))
        words = f"measured / asked: left of 1 it holds; gains {', '.join(claims[0].verdicts)}"
        ax.set_xlabel(style.wrapped(words, 2 * room, letters, lines=2), fontsize=letters)
        ax.set_xticks(TICKS, ["≤ 0.001", "0.1", "1", "10", "≥ 1000"])
        ax.set_yticks(range(len(claims)), names, fontsize=letters)
        for label, claim in zip(ax.get_yticklabels(), claims, strict=True):
            label.set_color(COLOURS[claim.verdict])
            label.set_parse_math(False)
        ax.tick_params(axis="y", length=0)
        pages.set_head(page, width, title, handles)
        pages.write(page, paths)
    return page


def draw(ax: Axes, row: int, claim: Claim) -> None:
    """Draw the checks of a claim: a line of dots for each set of gains."""
    colour = COLOURS[claim.verdict]
    sets = list(claim.verdicts)
    dot = {
        "marker": "o",
        "ls": "",
        "ms": style.points(5.5),
        "mec": colour,
        "mew": style.points(1.1),
        "clip_on": False,
    }
    for k, name in enumerate(sets):
        y = row + SETS_SHARE * ((k + 0.5) / len(sets) - 0.5)
        for check in claim.checks(name):
            ax.plot(place(check), y, mfc=colour if check.holds else "none", **dot)


def place(check: Check) -> float:
    """Return where a check's dot is: log10 of value / limit or limit / value, at most MAX_DECADES
    from 0.
    """
    if check.relation in ("<", "<="):
        over = check.value
        under = check.limit
    else:
        over = check.limit
        under = check.value
    edge = -MAX_DECADES if check.holds else MAX_DECADES
    if not (0.0 < over < math.inf and 0.0 < under < math.inf):
        return edge
    return min(max(math.log10(over / under), -MAX_DECADES), MAX_DECADES)
