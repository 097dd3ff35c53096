"""Colours of laws and runs.

Laws state their colours in their own files. A law has one colour in nearly all pictures: the one
that its file states, of Okabe and Ito (Color Universal Design, 2008), which colour-blind readers
can tell apart; or else one of `palette`. Matplotlib's petroff10 has only ten colours, fewer than
there are laws; two of them are the grey of failed runs, and one is the violet of friction.
"""

import colorsys
import functools
import itertools
import json
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from smc_mujoco.control.component import Component
from smc_mujoco.draw.style import (
    DISTURBANCE,
    FAILED,
    INK,
    PAPER,
    REACTION,
    _linear,
    mixed,
    neutral_on_dark,
)
from smc_mujoco.draw.wording import _template
from smc_mujoco.simulation.trace import Trace

HUES = 36  # of the grid from which colours are chosen
NEUTRAL = (PAPER, INK, DISTURBANCE, REACTION, FAILED)  # colours that no law has
# of runs of one law, in their order: Okabe and Ito's, which are told apart on light and dark pages
RUN_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
MIN_DISTANCE = 15.0  # colours closer than this are mistaken for each other, see `distance`; chosen
LIGHTEST = 61.0  # lightness in CIELAB: up to it lines have a contrast of 3 : 1 to paper
LIGHTEST_RUN = 54.0  # of a law's runs: three are apart from each other and from failed ones
DARKEST = 21.0  # of a ramp
RAMP_ON_DARK = (90.0, 56.0)  # its ends on a dark page, to which all of it has a contrast of 4.5 : 1
# linear sRGB -> as it looks with all cones, no red, no green, no blue ones (Machado et al.)
SIGHTS = np.array([
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
])  # fmt: skip
XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.072175],
        [0.0193339, 0.119192, 0.9503041],
    ]
)


def law_colour(law: Component | str) -> str:
    """Return the colour of a law, "#RRGGBB": its own, or that of its place in the palette."""
    template, name = _template(law)
    if template and template.colour:
        return template.colour
    chosen = palette()["chosen"]
    colours = list(chosen.values())
    return chosen.get(name) or colours[zlib.crc32(name.encode()) % len(colours)]


def trace_colours(traces: Sequence[Trace]) -> list[str]:
    """Return one colour per trace, that of its law; of one law's several runs beside others shades
    of it, from light to dark; of runs that are all of one law a colour each, by their order.
    """
    count = len(traces)
    if count > 1 and len({_template(trace.scenario.law)[1] for trace in traces}) == 1:
        more = _farthest([*RUN_COLOURS, *NEUTRAL], max(0, count - len(RUN_COLOURS)))
        return [*RUN_COLOURS, *more][:count]
    colours = law_colours([trace.scenario.law for trace in traces])
    colour_by_trace = []
    for i, colour in enumerate(colours):
        shades = [colour]
        if colours.count(colour) > 1:
            shades = ramp(colour, colours.count(colour), LIGHTEST_RUN)
        colour_by_trace.append(shades[colours[:i].count(colour)])
    return colour_by_trace


def law_colours(laws: Sequence[Component | str]) -> list[str]:
    """Return one colour per law for one picture, all laws' different.

    The library's laws have their colours, in pictures of two and of many. Only one that would be
    mistaken for a law that is before it in the palette, wherever they stand, gets the colour
    farthest from all: any 12 laws are then 13.7 apart, 24 are 9.6. Laws that are not of the
    library, whose colours say nothing, come after them. A law that runs several times has one
    colour here.
    """
    names = [_template(law)[1] for law in laws]
    everyone = range(len(laws))
    places = dict.fromkeys(palette()["stated"], 0)
    for place, name in enumerate(palette()["chosen"], 1):
        places[name] = place
    library = []
    for i in everyone:
        if names[i] in places:
            library.append(i)
    library.sort(key=lambda i: (places[names[i]], names[i]))
    colours: dict[int, str] = {}
    changed = []
    for i in dict.fromkeys([*library, *everyone]):
        own_colour = law_colour(laws[i])
        if names.index(names[i]) < i:  # it has the colour of the first
            continue
        if any(distance(own_colour, taken) < MIN_DISTANCE for taken in colours.values()):
            changed.append(i)
        else:
            colours[i] = own_colour
    new_colours = _farthest([*colours.values(), *NEUTRAL], len(changed))
    colours |= zip(sorted(changed), new_colours, strict=True)
    return [colours[names.index(name)] for name in names]


@functools.cache
def palette() -> dict[str, dict[str, str]]:
    """Return the colours of the library's laws: those that they state, and those chosen for the
    others, each the farthest from all before it.

    The usual laws are first, then baselines. A law without a colour here gets one by its name.
    """
    file = Path(__file__).with_name("law_colours.json")
    return json.loads(file.read_text(encoding="utf-8"))


def spread(count: int) -> list[str]:
    """Return colours, each the farthest from the neutral ones and from all before it."""
    return _farthest(NEUTRAL, count)


def _farthest(used: Sequence[str], count: int) -> list[str]:
    """Return so many colours of the grid, each the one whose least `distance` to the used ones and
    to those before it is largest.
    """
    seen = map(_as_each_sight, _grid())
    grid = np.array(list(seen))
    chosen = list(used)
    for _ in range(count):
        beside = np.array(list(map(_as_each_sight, chosen)))
        distances = np.linalg.norm(grid[:, None] - beside, axis=-1)
        apart = distances.min(axis=(1, 2))
        farthest = int(apart.argmax())
        chosen.append(_grid()[farthest])
    return chosen[len(used) :]


@functools.cache
def _grid() -> list[str]:
    """Return a grid of colours that are neither pale nor dull."""
    grid = []
    parts = itertools.product(range(HUES), (0.24, 0.33, 0.42, 0.51, 0.6), (0.45, 0.7, 0.95))
    for hue, lightness, saturation in parts:
        shade = colorsys.hls_to_rgb(hue / HUES, lightness, saturation)
        numbers = bytes(round(255 * part) for part in shade)
        colour = "#" + numbers.hex().upper()
        if _as_each_sight(colour)[0][0] < LIGHTEST:
            grid.append(colour)
    return grid


@functools.cache
def _as_each_sight(colour: str) -> np.ndarray:
    """Return a colour in CIELAB (D65) as each of SIGHTS sees it, (4, 3)."""
    seen = np.clip(SIGHTS @ _linear(colour), 0.0, 1.0)
    t = seen @ XYZ.T / XYZ.sum(axis=1)
    straight = t / (3 * (6 / 29) ** 2) + 4 / 29
    bright = t > (6 / 29) ** 3
    x, y, z = np.where(bright, np.cbrt(t), straight).T
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)]).T


def distance(one: str, other: str) -> float:
    """Return the least distance of two colours in CIELAB over normal sight and three kinds of
    colour blindness.
    """
    apart = _as_each_sight(one) - _as_each_sight(other)
    return float(np.linalg.norm(apart, axis=1).min())


def ramp(colour: str, count: int, lightest: float = LIGHTEST) -> list[str]:
    """Return shades of a colour from light to dark, in equal steps of lightness; all are light on a
    dark page.
    """
    ends = RAMP_ON_DARK if neutral_on_dark() else (lightest, DARKEST)
    shades = []
    for end_colour in (PAPER, "#000000"):
        for share in np.linspace(0.0, 0.95, 96):
            shades.append(mixed(colour, end_colour, share))
    values = [_as_each_sight(shade)[0][0] for shade in shades]
    lightness = np.array(values)
    target_lightness = np.linspace(*ends, count)
    misses = np.abs(lightness - target_lightness[:, None])
    nearest = misses.argmin(axis=1)
    return [shades[i] for i in nearest]
