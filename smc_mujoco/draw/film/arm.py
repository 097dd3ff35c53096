"""What a film shows of an arm: the path of its tip, and a bar for the torque of each joint against its limit."""

import math
from collections.abc import Sequence

import mujoco
import numpy as np
from PIL import Image, ImageDraw

from smc_mujoco.draw import style
from smc_mujoco.draw.decimate import windows
from smc_mujoco.metrics.tip import tip_path
from smc_mujoco.simulation.trace import Trace

SEGMENTS = 90  # of a path: as many as look smooth
WIDTH = 0.004  # m, of the path
BAR, GAP, HEIGHT = 13, 5, 44  # px of a bar, between bars, and of the bar of both limits together
LETTERS = 10  # px
ROOM = HEIGHT + 3 * LETTERS  # px, of bars with their numbers and what they are
WANTED = (0.12, 0.14, 0.16, 0.35)  # ink, translucent


def has_bars(trace: Trace) -> bool:
    """Return whether torque has a limit in every joint of an arm."""
    return bool(trace.scenario.plant.tip) and all(limit < math.inf for limit in trace.scenario.limits)


class Path:
    """The path of a machine's tip, and the wanted one.

    Args:
      place: of the machine, (3,) m.
    """

    def __init__(self, trace: Trace, place: np.ndarray, colour: str):
        self.times = np.linspace(trace.t[0], trace.t[-1], SEGMENTS + 1)
        rows = np.searchsorted(trace.t, self.times).clip(0, len(trace.t) - 1)
        plant = trace.scenario.plant
        self.points, self.wanted = (place + tip_path(plant, values[rows]) for values in (trace.x, trace.r))
        self.rgba = np.array([*(value / 255 for value in style.rgb(colour)), 1.0], np.float32)

    def draw(self, shown: mujoco.MjvScene, time: float, now: np.ndarray) -> None:
        """Add the wanted path, and the part of the path until a time, s, at which the tip is at `now`, (3,) m."""
        for start, end in zip(self.wanted[:-1], self.wanted[1:], strict=True):
            segment(shown, start, end, 0.5 * WIDTH, np.array(WANTED, np.float32))
        past = self.points[self.times <= time]
        for start, end in zip(past, [*past[1:], now], strict=True):
            segment(shown, start, end, WIDTH, self.rgba)


def segment(shown: mujoco.MjvScene, start: np.ndarray, end: np.ndarray, width: float, rgba: np.ndarray) -> None:
    """Add a rod between two points, m."""
    if shown.ngeom >= shown.maxgeom or np.linalg.norm(end - start) < 1e-4:
        return
    rod = shown.geoms[shown.ngeom]
    mujoco.mjv_initGeom(rod, mujoco.mjtGeom.mjGEOM_CAPSULE, np.zeros(3), np.zeros(3), np.zeros(9), rgba)
    mujoco.mjv_connector(rod, mujoco.mjtGeom.mjGEOM_CAPSULE, width, start, end)
    rod.objtype = mujoco.mjtObj.mjOBJ_UNKNOWN
    shown.ngeom += 1


class Bars:
    """A bar for each joint of each machine: its applied torque, as a share of its limit, upwards if positive.

    Args:
      edges: of the frames' times, (frames + 1,) s.
      boxes: places of the machines, (machines, 4) px.
      top: px, of the bars.
    """

    def __init__(self, traces: Sequence[Trace], edges: np.ndarray, colours: Sequence[str], top: float, scale: float):
        self.shares = [
            np.clip(windows(trace.t, trace.applied, edges).mean / np.array(trace.scenario.limits), -1.0, 1.0)
            for trace in traces
        ]
        self.colours, self.top, self.scale = colours, top, scale
        self.lefts: list[float] = []

    @property
    def width(self) -> float:
        """Of the bars of one machine, px."""
        return self.scale * (max(share.shape[1] for share in self.shares) * (BAR + GAP) + GAP)

    def place(self, boxes: np.ndarray, wide: int) -> None:
        """Place the bars above their machines, whose places are (machines, 4) px, in a picture so wide."""
        middles = (boxes[:, 0] + boxes[:, 2]) / 2
        middles = middles.clip(self.width / 2 + 8, wide - self.width / 2 - 8)
        self.lefts = (middles - self.width / 2).tolist()

    def over(self, picture: np.ndarray, frame: int) -> np.ndarray:
        """Return the picture with the bars of a frame."""
        image, s = Image.fromarray(picture), self.scale
        draw, font = ImageDraw.Draw(image), style.font(LETTERS * s)
        zero, half = self.top + (1.4 * LETTERS + HEIGHT / 2) * s, HEIGHT * s / 2
        for share, left, colour in zip(self.shares, self.lefts, self.colours, strict=True):
            for i, value in enumerate(share[frame]):
                x = left + (GAP + i * (BAR + GAP)) * s
                draw.rectangle((x, zero - half, x + BAR * s, zero + half), style.PAPER, style.RULE)
                low, high = sorted((zero, zero - value * half))
                full = abs(value) > 0.999
                draw.rectangle((x + 1, low, x + BAR * s - 1, high), style.FAILED if full else colour)
                draw.text((x + BAR * s / 2, zero + half + 2 * s), str(i + 1), style.MUTED, font, anchor="ma")
            middle = left + self.width / 2
            draw.text((middle, self.top), "torque, of its limit", style.MUTED, font, anchor="ma")
            draw.line((left, zero, left + self.width, zero), style.INK, max(1, round(s)))
        return np.asarray(image)
