"""Films without what a test does not look at."""

from unittest import mock

import numpy as np

from smc_mujoco.draw.film import film


class Blank:
    """In the place of charts: drawing them takes half of a picture's time."""

    def __init__(self, traces, names, colours, size, scale):
        self.image = np.full((size[1], size[0], 3), 255, np.uint8)

    def at(self, time):
        return self.image


without_charts = mock.patch.object(film, "Charts", Blank)
