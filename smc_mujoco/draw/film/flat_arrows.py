"""Arrows as they are painted over a picture, so that no link hides them, and the numbers beside
them, for which room is looked for.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageDraw

from smc_mujoco.common.aliases import Array
from smc_mujoco.draw import lettering, style
from smc_mujoco.draw.film.arrows import WHITE, Arrow
from smc_mujoco.draw.film.dilation import widened

RIM = 2.0  # px, of paper around an arrow that lies over a link, of a film of full size
MIN_PIXELS = 9.0  # px, of a film of full size: shorter arrows are not drawn
MIN_SHAFT = 8.0  # px, of a film of full size; of an arrow that is long enough
HEAD_WIDTH = 2.25  # half the width of a head, in shafts
HEAD_LENGTH = 2.2  # in half widths
FOOT_WIDTH, FOOT_LENGTH = 2.4, 0.6  # of the bar at the tail of a disturbance, in shafts
MAX_FOOT = 0.16  # longest such bar, of its arrow
EDGE_SHARE = 0.3  # widest edge of a hollow arrow, of its shaft
HEAD, LESS_HEAD = 0.7, 0.5  # longest head, of its arrow, and of one with a break mark or a bar
SUPERSAMPLING = 3  # pixels of a flat arrow for each of the picture, in both directions
MAX_THICKNESS = 0.25  # of the shaft of a short arrow, of its length
LETTERS = 36.0  # px of a film of full size, of the number at an arrow, as of all its letters
SMALL_LETTERS = 27.0  # px, of one that has no room else
GAP = 4.0  # px of a film of full size, around a number
NARROW = 500.0  # px of a film of full size: a tile that is less wide has one number at most
PLACES = 12  # in each direction, at which room for a number is looked for


class Stamped(NamedTuple):
    """An arrow on a picture: its line and its outline, (points, 2) px each."""

    arrow: Arrow
    line: Array
    edge: Array


def outline(
    line: Array, width: float, head: bool = True, longest: float = HEAD, foot: bool = False
) -> Array:
    """Return the outline, (points, 2) px, of an arrow along a line (m, 2) px whose shaft is `width`
    px wide, with a head of at most a share of its length, and with a bar at its tail or without.
    """
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    way = np.append(0.0, steps.cumsum())
    width = min(width, MAX_THICKNESS * way[-1])
    long = min(HEAD_LENGTH * HEAD_WIDTH * width, longest * way[-1]) * head
    stations = np.linspace(0.0, way[-1] - long, len(line))
    rows = []
    for part in line.T:
        rows.append(np.interp(stations, way, part))
    shaft = np.column_stack(rows)
    along = np.gradient(shaft, axis=0)
    sizes = np.linalg.norm(along, axis=1)[:, None]
    across = 0.5 * width * along[:, ::-1] * (-1, 1) / sizes
    if foot:
        barred = stations <= min(FOOT_LENGTH * width, MAX_FOOT * way[-1])
        across[barred] *= FOOT_WIDTH
    wing = long / HEAD_LENGTH / (0.5 * width) * across[-1]
    tip = [shaft[-1] + wing, line[-1], shaft[-1] - wing]
    back = (shaft - across)[::-1]
    return np.concatenate([shaft + across, tip, back])


def stamp(image: Image.Image, line: Array, width: float, arrow: Arrow, rim: int = 0) -> Stamped:
    """Draw an arrow along a line, (m, 2) px, with a break mark if it is cut."""
    longest = LESS_HEAD if arrow.cut or arrow.foot else HEAD
    edge = outline(line, width, arrow.head, longest, arrow.foot)
    inner = min(2.0 * rim, EDGE_SHARE * width) if arrow.hollow else 0.0
    paint(image, edge, arrow.rgba, rim, inner)
    if arrow.cut:
        k = len(line) // 2  # of the shaft, whose other side is the outline's end
        sides = edge[[k, -1 - k]]
        across = 0.9 * (sides[0] - sides[1])
        way = np.array([across[1], -across[0]]) / 3.0
        corners = [across + 2 * way, across, -across - 2 * way, -across]
        paint(image, sides.mean(axis=0) + np.array(corners), WHITE)
    return Stamped(arrow, line, edge)


def bytes_of(rgba: Sequence[float]) -> tuple[int, ...]:
    """Return red, green and blue as whole numbers of 0 to 255."""
    return tuple(round(255 * part) for part in rgba[:3])


def boxes(stamped: Sequence[Stamped], scale: float) -> list[Array]:
    """Return boxes, (2, 2) px each, that cover arrows on a picture, with a gap for numbers."""
    around = np.array([[-GAP], [GAP]]) * scale
    return [point + around for stamp in stamped for point in stamp.edge]


def write_numbers(
    image: Image.Image, stamped: Sequence[Stamped], scale: float, taken: list[Array], wide: float
) -> None:
    """Write the numbers of a machine's arrows, each once in a colour, in a film `scale` times as
    large as a full one; in a narrow tile that of the longest alone. None is written over the boxes
    `taken`, (2, 2) px each, which get those of the numbers.
    """
    said = set()
    numbered = [stamp for stamp in stamped if stamp.arrow.words]
    if numbered and wide < NARROW * scale:
        numbered = [max(numbered, key=lambda stamp: abs(stamp.arrow.high))]
    for arrow, line, _ in numbered:
        key = arrow.words, arrow.rgba
        if key not in said:
            said.add(key)
            write_number(image, arrow, line, scale, taken)


def write_number(
    image: Image.Image, arrow: Arrow, line: Array, scale: float, taken: list[Array]
) -> None:
    """Write the number of an arrow along a line, (m, 2) px, where there is room in the picture:
    beyond its free end, over the arrow or beside a steep one, or before its other end; else where
    room is nearest to it.
    """
    ends = (line[0], line[-1]) if arrow.body else (line[-1], line[0])
    for size in (LETTERS, SMALL_LETTERS):
        high = size * scale
        half = np.array([lettering.width(arrow.words, high, bold=True), high]) / 2 + GAP * scale
        most = np.array(image.size) - half
        places = number_places(ends, half, most, 6 * scale)
        if size == SMALL_LETTERS:
            places += nearest_places(ends, half, most)
        for place in places:
            inside = (place >= half).all() and (place <= most).all()
            box = np.array([place - half, place + half])
            if inside and is_apart(box, taken):
                taken.append(box)
                rim = {"stroke_width": round(2 * scale), "stroke_fill": style.PAPER}
                letters = lettering.font(high, True)
                centre = tuple(place.tolist())
                colour = bytes_of(arrow.rgba)
                ImageDraw.Draw(image).text(centre, arrow.words, colour, letters, anchor="mm", **rim)
                return


def covers(words: Sequence[Array], edge: Array) -> bool:
    """Return whether words, in boxes of (2, 2) px each, lie over an outline, (points, 2) px."""
    inside = [((box[0] < edge) & (edge < box[1])).all(axis=1).any() for box in words]
    return any(inside)


def is_apart(box: Array, taken: Sequence[Array]) -> bool:
    """Return whether a box, (2, 2) px, overlaps none of those that are taken."""
    if not taken:
        return True
    taken_boxes = np.array(taken)
    beyond = (box[1] <= taken_boxes[:, 0]) | (box[0] >= taken_boxes[:, 1])
    return bool(beyond.any(axis=1).all())


def nearest_places(ends: tuple[Array, Array], half: Array, most: Array) -> list[Array]:
    """Return places all over a picture, px, the nearest to the middle of an arrow first; `half` and
    `most` as of `number_places`.
    """
    across = np.linspace(half[0], most[0], PLACES)
    down = np.linspace(half[1], most[1], PLACES)
    places = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    away = np.linalg.norm(places - (ends[0] + ends[1]) / 2, axis=1)
    return list(places[away.argsort(kind="stable")])


def number_places(ends: tuple[Array, Array], half: Array, most: Array, gap: float) -> list[Array]:
    """Return the places of the middle of an arrow's number, px, the best first.

    `half` is half the size of the number, and `most` the farthest place that it may have.
    """
    free, foot = ends
    side = 1.0 if free[0] >= foot[0] else -1.0
    middle = (free + foot) / 2
    reach = np.array([side * (gap + half[0]), 0.0])
    apart = np.array([0.0, abs(free[1] - foot[1]) / 2 + 2 * half[1]])
    steep = abs(free[1] - foot[1]) > abs(free[0] - foot[0])
    beside = middle + reach if steep else middle - apart
    within = np.maximum(half, most)
    beside[0] = np.clip(beside[0], half[0], within[0])
    return [free + reach, beside, foot - reach]


def paint(
    image: Image.Image, edge: Array, rgba: Sequence[float], rim: int = 0, inner: float = 0.0
) -> None:
    """Fill an outline, (points, 2) px, with smooth edges, and a rim of paper around it, px; or only
    an `inner` edge of so many px, around paper.
    """
    corner = np.floor(edge.min(axis=0)).astype(int) - rim
    far = np.ceil(edge.max(axis=0)).astype(int) + 1 + rim
    place = tuple(corner.tolist())
    size = SUPERSAMPLING * (far - corner)
    mask = Image.new("L", tuple(size.tolist()))
    points = list(map(tuple, (SUPERSAMPLING * (edge - corner)).tolist()))
    opaque = round(255 * rgba[3])
    ImageDraw.Draw(mask).polygon(points, opaque)
    mask = mask.reduce(SUPERSAMPLING)
    if rim:
        wide = widened(np.asarray(mask), rim)
        image.paste(style.rgb(style.PAPER), place, Image.fromarray(wide))
    if inner:
        image.paste(style.rgb(style.PAPER), place, mask)
        mask = Image.new("L", tuple(size.tolist()))
        line = max(1, round(SUPERSAMPLING * inner))
        ImageDraw.Draw(mask).polygon(points, outline=opaque, width=line)
        mask = mask.reduce(SUPERSAMPLING)
    image.paste(bytes_of(rgba), place, mask)
