"""Figures on a dark page: neutral colours are turned, and laws' colours become as light as their
contrast to the page needs.
"""

from collections.abc import Iterable, Mapping

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import Collection
from matplotlib.colors import to_hex, to_rgba
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text

from smc_mujoco.draw import style

CONTRAST = 4.5  # of a line to its page, at least: lines are as thin as letters (WCAG 2.2)
STEPS = 20  # from a colour to the page's ink


def suit_page(artists: Iterable[Artist]) -> None:
    """Turn the colours of artists if the page of matplotlib's settings is dark."""
    neutral = style.neutral_on_dark()
    if not neutral:
        return

    def turned(colour) -> tuple[float, float, float, float]:
        red, green, blue, opacity = to_rgba(colour)
        name = to_hex((red, green, blue)).upper()
        return to_rgba(on_dark(name, neutral), opacity)

    coloured = list(artists)
    coloured += [words.get_bbox_patch() for words in coloured if isinstance(words, Text)]
    for artist in coloured:
        if isinstance(artist, Text):
            if to_hex(artist.get_color()).upper() != style.PAPER:  # else it is on a colour
                artist.set_color(turned(artist.get_color()))
        elif isinstance(artist, Line2D):
            line = turned(artist.get_color())
            face = turned(artist.get_markerfacecolor())
            edge = turned(artist.get_markeredgecolor())
            artist.set(color=line, markerfacecolor=face, markeredgecolor=edge)
        elif isinstance(artist, Patch):
            face = turned(artist.get_facecolor())
            edge = turned(artist.get_edgecolor())
            artist.set(facecolor=face, edgecolor=edge)
        elif isinstance(artist, Collection):
            faces = list(map(turned, artist.get_facecolor()))
            edges = list(map(turned, artist.get_edgecolor()))
            artist.set(facecolor=faces, edgecolor=edges)


def on_dark(colour: str, neutral: Mapping[str, str]) -> str:
    """Return a colour, "#RRGGBB", as it is on a dark page; `neutral` as of
    `style.neutral_on_dark`.
    """
    if colour in neutral:
        return neutral[colour]
    if colour in neutral.values():
        return colour
    on = style.luminance(neutral[style.PAPER]) + 0.05
    lighter = colour
    for share in np.linspace(0.0, 1.0, STEPS):
        lighter = style.mixed(colour, neutral[style.INK], float(share))
        if (style.luminance(lighter) + 0.05) / on >= CONTRAST:
            break
    return lighter
