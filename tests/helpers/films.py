"""Films without what a test does not look at."""

from unittest import mock

import numpy as np

from smc_mujoco.draw.figure import DrawnRuns
from smc_mujoco.draw.film import film
from smc_mujoco.draw.film.camera import Room
from smc_mujoco.draw.film.pace import FilmClock
from smc_mujoco.draw.film.sheet import Moment, Sheet
from smc_mujoco.draw.film.track import MachineTrack


class Blank:
    """In the place of a film's page: drawing its panels takes half of a picture's time."""

    def __init__(self, runs, size, tiles, labels, title=None, key=(), start=0.0, lines=2, order=""):
        self.tiles = tiles
        self.image = np.full((size[1], size[0], 3), 255, np.uint8)

    def picture(self, moment, machines):
        for (left, top, right, bottom), machine in zip(self.tiles, machines, strict=True):
            self.image[top:bottom, left:right] = machine
        return self.image.copy()


without_charts = mock.patch.object(film, "Sheet", Blank)


def tracks(traces, colours):
    """Return what runs do in a film without arrows, at 0 and .1 s."""
    clock = FilmClock(np.array([0.0, 0.1]), np.ones(2))
    tracks_of_runs = []
    for trace, colour in zip(traces, colours, strict=False):
        tracks_of_runs.append(MachineTrack(trace, colour, clock, clock.times, {}))
    return tracks_of_runs


def staged(trace, size, colour="#0072B2", chosen=None, strip=0.0):
    """Return the stage of a machine that has a picture of this size, px, to itself, but for a strip
    at its foot.
    """
    tracks_shown = tracks([trace], [colour])
    undivided = mock.patch.object(film, "room_of", lambda size, lines: Room(0.0, 0.0, *size))
    words = mock.patch.object(
        film, "label_sizes", lambda names, size, room: (np.array([[room, strip]]), 1.0)
    )
    with undivided, words:
        placed = film.placement(tracks_shown, chosen, ["one"], size)
    return next(film.staged(tracks_shown, placed, np.zeros(1)))


def sheet(traces, names=None, size=(1280, 720)):
    """Return the page of a film of runs, whose tiles are empty."""
    runs = DrawnRuns.of(traces, names)
    labels = [(300 * k, 100, 300 * k + 300, 160) for k in range(len(runs.names))]
    return Sheet(runs, size, np.zeros((len(labels), 4), int), np.array(labels))


def picture(sheet, time, speed=1.0):
    """Return the picture of such a page at a time, s."""
    count = len(sheet.runs.names)
    empty = [np.zeros((0, 0, 3), np.uint8)] * count
    return sheet.picture(Moment(time, speed, [None] * count), empty)
