"""Geometry of a camera: the place from which it sees given points, and where they are in its picture.

A `turn` is a camera's frame as MuJoCo keeps it, (3, 3): its columns point right, up and backwards.
"""

from typing import NamedTuple

import numpy as np

FOVY = 9.0  # degrees, chosen: a long lens, so that no machine looks larger than its neighbours


class Room(NamedTuple):
    """A part of a picture, px from the top left."""

    left: float
    top: float
    right: float
    bottom: float


def fit(points: np.ndarray, turn: np.ndarray, size: tuple[int, int], room: Room) -> np.ndarray:
    """Return the nearest place, (3,) m, from which points (m, 3) are all within the room of a picture of `size` px.

    With p and z a point's place across and along the view, a camera at c across and at distance D sees it between
    the tangents a and b if a (z + D) <= p - c <= b (z + D). So every point bounds c from both sides, for the picture's
    width and for its height; D is the least at which both leave room.
    """
    across, up, z = points @ turn[:, 0], points @ turn[:, 1], -points @ turn[:, 2]
    x, y = size[0] / 2, size[1] / 2
    left, right, low, high = np.array([room.left - x, room.right - x, y - room.bottom, y - room.top]) * _pixel(size)
    sides = [(across, left, right), (up, low, high)]
    bounds = [(np.max(p - b * z), np.min(p - a * z), a, b) for p, a, b in sides]
    distance = max((least - most) / (b - a) for least, most, a, b in bounds)
    centre = [(least - b * distance + most - a * distance) / 2 for least, most, a, b in bounds]
    return turn @ np.array([*centre, distance])


def project(points: np.ndarray, turn: np.ndarray, place: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Return where points (m, 3) are in the picture of a camera at `place`: (m, 2) px from the top left."""
    seen = (points - place) @ turn
    return np.array(size) / 2 + seen[:, :2] / -seen[:, 2:] / _pixel(size) * (1, -1)


def _pixel(size: tuple[int, int]) -> float:
    """Return the tangent of one px at the picture's middle."""
    return float(np.tan(np.radians(FOVY) / 2) / (size[1] / 2))
