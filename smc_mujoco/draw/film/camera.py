"""Geometry of cameras: the place from which one sees given points, where they are in its picture,
and the tiles of a film, one a machine.

A `turn` is a camera's frame as MuJoCo keeps it, (3, 3): its columns point right, up and backwards.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.common.errors import ScenarioError, items_of, number, shown

FOVY = 9.0  # degrees, chosen: a long lens
TILE_EDGE = 0.03  # of a tile's height, free around what is seen; chosen
HEAD_ROOM = 0.02  # of the picture's width: room above the machine in a tile, for arrowheads; chosen
TILE_GAP = 2  # px between tiles
MIN_HEIGHT = 0.25  # of a tile's, for a machine whose words have no room; chosen
MAX_MISSED = 2.0  # sizes of what is seen, from a machine to its reference in the picture; chosen
MAX_BESIDE = 0.3  # of a row's width, for a label beside its machine; chosen
Camera = str | Sequence[float]  # a name, or azimuth and elevation in degrees
# an allowed width -> widths and heights of labels, (n, 2), px, and how well they are read, 0 .. 1
Sizes = Callable[[float], tuple[Array, float]]


class Room(NamedTuple):
    """A part of a picture, px from the top left."""

    left_end: float
    top: float
    right: float
    bottom: float


class View(NamedTuple):
    """A camera's picture, px, its turn and its place, (3,) m, before a machine, which is in a room
    of the picture.
    """

    size: tuple[int, int]
    turn: Array
    place: Array
    inside: Room


def checked(chosen: Camera | None) -> Camera | None:
    """Return the chosen camera; a name of a camera is checked where the model is at hand."""
    if chosen is None or isinstance(chosen, str):
        return chosen
    parts = items_of("camera", chosen)
    if len(parts) != 2:
        raise ScenarioError(
            f"camera is {shown(chosen)}: "
            "give the name of a camera of the model, or (azimuth, elevation) in degrees"
        )
    azimuth, elevation = parts
    return (
        number("camera's azimuth", azimuth),
        number("camera's elevation", elevation, low=-90.0, high=90.0),
    )


def turn(azimuth: float, elevation: float) -> Array:
    """Return the turn of a camera that looks as MuJoCo's free camera does.

    The azimuth, degrees, is 0 along x and 90 along y; at an elevation, degrees, below 0 it looks
    down.
    """
    a, e = np.radians([azimuth, elevation])
    level = np.cos(e)
    ahead = np.array([level * np.cos(a), level * np.sin(a), np.sin(e)])
    right = np.array([np.sin(a), -np.cos(a), 0.0])
    return np.column_stack([right, np.cross(right, ahead), -ahead])


def fit(
    points: Array, turn: Array, size: tuple[int, int], room: Room, least: float = -np.inf
) -> Array:
    """Return the nearest place, (3,) m, from which points (m, 3) are all within the room of a
    picture of `size` px; it is `least` m or more towards the camera.

    With p and z a point's place across and along the view, a camera at c across and at distance D
    sees it between the tangents a and b if a (z + D) <= p - c <= b (z + D). So every point bounds c
    from both sides, for the picture's width and for its height; D is the least at which both leave
    room.
    """
    across = points @ turn[:, 0]
    up = points @ turn[:, 1]
    z = -points @ turn[:, 2]
    x = size[0] / 2
    y = size[1] / 2
    leftmost, right, low, high = np.array(
        [room.left_end - x, room.right - x, y - room.bottom, y - room.top]
    ) * pixel(size)
    sides = [(across, leftmost, right), (up, low, high)]
    distance = least
    for p, a, b in sides:
        span = np.max(p - b * z) - np.min(p - a * z)
        distance = max(distance, span / (b - a))
    centre = []
    for p, a, b in sides:
        nearest = np.max(p - b * z) - b * distance
        farthest = np.min(p - a * z) - a * distance
        centre.append((nearest + farthest) / 2)
    return turn @ np.array([*centre, distance])


def widened(view: View, points: Array, missed: Array) -> Array:
    """Return how far the cameras of machines go back and aside from a view of points (m, 3) m in
    each frame, (machines, frames, 3) m, to see them as well at distances `missed`, of that shape.

    All go back as far, so that machines are as large, and each goes aside for its own distance
    alone. Distances over MAX_MISSED count less, and soon not at all: one that flees would make the
    others small.
    """
    reach = np.ptp(points, axis=0).max()
    far = np.linalg.norm(missed, axis=2, keepdims=True)
    seen = missed * np.clip(1.0 + MAX_MISSED - far / reach, 0.0, 1.0)
    moves = []
    for ways in seen.swapaxes(0, 1):
        swept = [np.concatenate([points, points + way]) for way in ways]
        places = [fit(cloud, view.turn, view.size, view.inside) for cloud in swept]
        back = float(max(place @ view.turn[:, 2] for place in places))
        places = [fit(cloud, view.turn, view.size, view.inside, back) for cloud in swept]
        moves.append(np.array(places) - view.place)
    return np.array(moves).swapaxes(0, 1)


def project(points: Array, turn: Array, place: Array, size: tuple[int, int]) -> Array:
    """Return where points (m, 3) are in the picture of a camera at `place`: (m, 2) px from the top
    left.
    """
    seen = (points - place) @ turn
    scaled = seen[:, :2] / -seen[:, 2:] / pixel(size)
    return np.array(size) / 2 + scaled * (1, -1)


def pixel(size: tuple[int, int]) -> float:
    """Return the tangent of one px at the picture's middle."""
    half = np.tan(np.radians(FOVY) / 2)
    return float(half / (size[1] / 2))


def magnification(view: View, points: Array) -> float:
    """Return how large a view shows points (m, 3) m, px a metre."""
    distance = float((view.place - points.mean(axis=0)) @ view.turn[:, 2])
    return 1.0 / (pixel(view.size) * distance)


def layout(
    count: int,
    room: Room,
    sizes: Sizes,
    points: Array,
    turn: Array,
    may_be_beside: bool = True,
    words: float = 0.0,
) -> tuple[Array, Array, View]:
    """Return the tiles of so many machines in a room of the film and those of their labels, (count,
    4) px each, and the view of points (m, 3) m in each tile.

    They are in as many rows, with labels below or beside them, as make the machines largest that
    have labels which are read well. `may_be_beside` allows labels beside machines. The top of each
    tile has room for words of that height, px, which lie over no machine.
    """
    layouts = []
    sides = (False, True) if may_be_beside else (False,)
    for rows, beside in itertools.product(range(1, count + 1), sides):
        columns = -(-count // rows)
        if columns * (rows - 1) >= count:  # a row would be empty
            continue
        pitch = np.array([(room.right - room.left_end) / columns, (room.bottom - room.top) / rows])
        wide, tall = (pitch - TILE_GAP).astype(int).tolist()
        labels, read = sizes(MAX_BESIDE * wide if beside else wide)
        across, down = labels.max(axis=0).tolist()
        fits = down <= tall if beside else across <= wide
        if beside:
            fits &= across <= MAX_BESIDE * wide
            beside_width, foot = math.ceil(min(across, MAX_BESIDE * wide)), 0
        else:
            beside_width, foot = 0, math.ceil(min(down, (1.0 - MIN_HEIGHT) * tall))
        size = (wide - beside_width, tall - foot)
        edge = TILE_EDGE * size[1]
        head = HEAD_ROOM * (room.right - room.left_end)
        top = min(max(edge, head, words), 0.5 * size[1])
        inside = Room(edge, top, size[0] - edge, size[1] - edge)
        place = fit(points, turn, size, inside)
        view = View(size, turn, place, inside)
        merit = fits, read * magnification(view, points)
        layouts.append((merit, columns, pitch, view))
    _, columns, pitch, view = max(layouts, key=lambda one: one[0])
    wide, tall = view.size
    beside_width, foot = (pitch - TILE_GAP - view.size).astype(int).tolist()
    corner = np.array([room.left_end, room.top])
    tiles = []
    labels = []
    for k in range(count):
        x, y = (corner + pitch * (k % columns, k // columns)).round().tolist()
        tiles.append((x + beside_width, y, x + beside_width + wide, y + tall))
        if beside_width > foot:
            labels.append((x, y, x + beside_width, y + tall))
        else:
            labels.append((x, y + tall, x + wide, y + tall + foot))
    return np.array(tiles, int), np.array(labels), view
