"""Which curves of a panel coincide, and so hide each other, and the words that say so."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from smc_mujoco.common.aliases import Fields, Pair
from smc_mujoco.common.text import joined
from smc_mujoco.draw import lettering, style

MIN_WORDS = 4.0  # least height of a panel that has room for words, in heights of letters
# of a panel's height, below the width of a line: curves no farther apart agree
COINCIDENT_DISTANCE = 0.01
# of agreeing curves' samples, so that controls that switch a sample apart agree; chosen
COINCIDENT_SHARE = 0.99
# of the largest value of two curves: they do not agree if their peaks are farther apart
PEAK_DISTANCE = 0.02
MIN_PEAK = 0.1  # of the distance of curves that coincide: peaks closer than it are equal
PEAK_TIME = 0.01  # of a run: peaks are compared within so much time before and after; chosen
# of a run: nothing is said of curves that all agree for less; chosen
MIN_AGREEMENT = 0.15


Line = tuple[np.ndarray, np.ndarray]  # times and values
Agreement = tuple[list[int], float]  # of these lines, until a time, s; inf where they never part


def agreements(lines: Sequence[Line], limits: Pair, logarithmic: bool = False) -> list[Agreement]:
    """Return until when all lines agree in a panel of these limits, and which of them never
    part.
    """
    if len(lines) < 2:
        return []
    last = max(float(t[-1]) for t, _ in lines)
    until = []
    for line in lines:
        partings = []
        for rival in lines:
            partings.append(_parting(line, rival, limits, logarithmic))
        until.append(partings)
    shared = []
    ungrouped = list(range(len(lines)))
    if MIN_AGREEMENT * last <= min(until[0]) < last:
        shared.append((ungrouped, min(until[0])))
    while ungrouped:
        group = [i for i in ungrouped if until[ungrouped[0]][i] >= last]
        ungrouped = [i for i in ungrouped[1:] if i not in group]
        if len(group) > 1:
            shared.append((group, np.inf))
    return shared


def _parting(one: Line, other: Line, limits: Pair, logarithmic: bool) -> float:
    """Return until when, s, two lines coincide in a panel, but for a small share of their points,
    and have equal peaks, upwards and downwards.
    """
    from scipy.ndimage import maximum_filter1d

    common = one[0] <= other[0][-1] + 1e-9
    t = one[0][common]
    of_one = one[1][: len(t)]
    of_other = np.interp(t, *other)
    y = np.stack([of_one, of_other])
    drawn = y
    sides = limits
    if logarithmic:
        drawn = np.log10(y)
        sides = np.log10(limits)
    apart = COINCIDENT_DISTANCE * float(np.ptp(sides))
    highest = PEAK_DISTANCE * float(np.abs(y).max())
    if not logarithmic:
        highest = min(max(highest, MIN_PEAK * apart), apart)
    half = math.ceil(PEAK_TIME * len(one[0]))
    window = 2 * half + 1
    held = np.ones(len(t), bool)
    high = maximum_filter1d(y, window, mode="nearest")
    low = maximum_filter1d(-y, window, mode="nearest")
    for pair, room in ((drawn, apart), (high, highest), (low, highest)):
        gap = pair[0] - pair[1]
        near = np.abs(gap) <= room
        counts = np.arange(1, len(t) + 1)
        share = np.cumsum(near) / counts
        held &= near & (share >= COINCIDENT_SHARE)
    return float(t[held].max(initial=-np.inf))


def tell_agreements(
    ax: Axes, shared: Sequence[Agreement], names: Sequence[str], also: str = ""
) -> None:
    """Write which traces agree, and until when, and what else is to be said of them, above the
    curves, on up to two lines: the range of the axes grows by the height of the words.
    """
    size = style.points(9.0)
    height = 72 * ax.get_window_extent().height / ax.figure.dpi  # points
    room = 72 * ax.get_window_extent().width / ax.figure.dpi - size
    forever = [agreement for agreement in shared if agreement[1] == np.inf]
    for which in (shared, forever):
        said = "; ".join(filter(None, (agreement_words(which, names), also)))
        words = lettering.wrapped(said, room, size, 2)
        lines = 1 + words.count("\n")
        if words and "…" not in words and height >= MIN_WORDS * size * lines:
            break
    else:
        return
    free = 1.0 - (0.6 + 1.2 * lines) * size / height
    axis = ax.yaxis.get_transform()
    ends = np.array(ax.get_ylim())
    low, high = axis.transform(ends)
    top = axis.inverted().transform(np.array([low + (high - low) / free]))
    ax.set_ylim(top=float(top[0]))
    place = {"xytext": (-0.5 * size, -0.4 * size), "textcoords": "offset points"}
    look: Fields = {"ha": "right", "va": "top", "fontsize": size, "in_layout": False}
    look["bbox"] = {"fc": style.PAPER, "ec": "none", "pad": 0.1 * size}  # hides lines of times
    ax.annotate(words, (1.0, 1.0), xycoords="axes fraction", parse_math=False, **place, **look)


def agreement_words(shared: Sequence[Agreement], names: Sequence[str]) -> str:
    """Return which traces agree, by their names, and until when."""
    parts = []
    for who, stop in shared:
        words = joined([names[i] for i in who])
        if len(who) == len(names):
            words = "all" if len(who) > 2 else "both"
        words += " agree"
        if stop < np.inf:
            words += f" until {stop:.3g} s"
        parts.append(words)
    return "; ".join(parts)
