"""Films without what a test does not look at."""

from types import SimpleNamespace
from unittest import mock

import numpy as np

from smc_mujoco.draw.film import film
from smc_mujoco.draw.film.track import MachineTrack


class Blank:
    """In the place of charts: drawing them takes half of a picture's time."""

    def __init__(self, traces, names, colours, size, scale):
        self.image = np.full((size[1], size[0], 3), 255, np.uint8)

    def at(self, time):
        return self.image


without_charts = mock.patch.object(film, "Charts", Blank)


def tracks(traces, colours):
    """Return what runs do in a film without arrows, at 0 and .1 s."""
    times = np.array([0.0, 0.1])
    found = []
    for trace, colour in zip(traces, colours, strict=False):
        found.append(MachineTrack(trace, colour, times, times, {}))
    return found


def staged(trace, size, colour="#0072B2", chosen=None, strip=0.0):
    """Return the stage of a machine that has a picture of this size, px, to itself, but for a strip
    at its foot.
    """
    caption = SimpleNamespace(size=size, top=0.0, strip=lambda width: strip, scale=1.0)
    caption.place = lambda tiles: None
    return next(film.staged(tracks([trace], [colour]), chosen, caption, np.zeros(1)))
