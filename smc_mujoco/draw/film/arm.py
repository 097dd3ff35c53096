"""What a film draws over its pictures of arms and free bodies: paths of tips and places, torques
against their limits, the force of a contact, and blows.

It costs little, and no link hides it.
"""

import math
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw

from smc_mujoco.common.aliases import Array
from smc_mujoco.draw import style
from smc_mujoco.draw.decimate import windows
from smc_mujoco.draw.film import arrows
from smc_mujoco.draw.film.caption import LETTERS
from smc_mujoco.draw.film.stage import Stage
from smc_mujoco.metrics import tip
from smc_mujoco.simulation.trace import Trace

# Sizes are px of a film of full size, and chosen.
PATH_WIDTH = 3.0
WANTED_PATH_WIDTH = 1.6
WANTED_OPACITY = 0.5
OUTSIDE = 100  # px beyond the picture up to which a path is followed
PATH_POINTS = 600  # of a path that is drawn, or a few more
BAR_WIDTH = 13
BAR_GAP = 5
BAR_HEIGHT = 32  # from one limit to the other
MAX_TIP_ERROR = 0.015  # m: only a tip farther off has a ghost; a nearer one would hide it
FORCE_ARROW = 0.6  # m, length of the arrow for the largest force or blow
SHAFT_WIDTH = 4.0
BLOW_DISTANCE = 0.09  # m, from the middle of a body to the arrow of its blow
RIM = 4  # of the picture, which arrows leave free
BLOW_TIME = 0.12  # s for which a blow is shown after its end


def has_bars(trace: Trace) -> bool:
    """Return whether u is a torque with a limit in every joint of an arm."""
    scenario = trace.scenario
    return bool(scenario.plant.tip) and scenario.force_command and max(scenario.limits) < math.inf


class Overlay:
    """What is drawn over pictures of a machine on its stage.

    These are the path of an arm's tip, or of the place of a free body. Arms have their forces too,
    with arrows `newton` m long a newton; `room` has what is shown below the label, left, top,
    right, bottom px.
    """

    def __init__(self, stage: Stage, room: Array, newton: float):
        self.stage = stage
        self.trace = trace = stage.track.trace
        self.edges = edges = stage.track.edges
        self.room = room
        self.newton = newton
        self.scale = stage.scale
        self.errors = None  # of the tip, (frames,) m
        self.shares = None  # torques as shares of their limits, (frames, joints), -1 .. 1: means
        self.forces = None  # of a contact, (frames, 3) N
        path = trace.x[:, :3]
        wanted = trace.r[:, :3]
        if trace.scenario.plant.tip:
            path, wanted = tip.tip_paths(trace)
            error = tip.tip_error(trace)[:, None]
            self.errors = windows(trace.t, error, edges).mean[:, 0]
        some = slice(None, None, 1 + len(trace.t) // PATH_POINTS)
        self.times = trace.t[some]
        floor = np.array([-np.inf, -np.inf, 0.0])
        above = np.array([0.0, 0.0, stage.puppet.height])
        self.path = np.maximum(path[some] + above, floor)
        self.wanted = np.maximum(wanted[some] + above, floor)
        if has_bars(trace):
            share = windows(trace.t, trace.applied, edges).mean / trace.scenario.limits
            self.shares = np.clip(share, -1.0, 1.0)
        if tip.knows_contacts(trace.scenario):
            self.forces = windows(trace.t, tip.contacts(trace).push, edges).mean

    def lost(self, frame: int) -> bool:
        """Return whether the machine is so far off its path that a ghost shows where it should
        be.
        """
        return self.errors is None or bool(self.errors[frame] > MAX_TIP_ERROR)

    def over(self, picture: Array, frame: int) -> Array:
        """Return the picture of a frame with all this, as the machine stands on the stage."""
        time = float(self.edges[frame + 1])
        image = Image.fromarray(picture)
        self.trail(image, self.wanted, style.INK, WANTED_PATH_WIDTH, WANTED_OPACITY)
        until = self.path[self.times <= time]
        self.trail(image, until, self.stage.track.colour, PATH_WIDTH)
        if self.forces is not None:
            size = float(np.linalg.norm(self.forces[frame]))
            if size > 0.5:
                at = self.stage.find(self.trace.scenario.plant.tip)
                self.arrow(image, at, at - self.newton * self.forces[frame], size, style.REACTION)
        for blow in style.pushes([self.trace]):
            end = blow.time + blow.width + BLOW_TIME
            if self.edges[frame] <= end and time >= blow.time:
                peak = np.array([blow.x, blow.y, blow.z])
                size = float(np.linalg.norm(peak))
                place = self.stage.find(blow.body) - BLOW_DISTANCE * peak / size
                self.arrow(image, place - self.newton * peak, place, size, style.DISTURBANCE)
        return np.asarray(image)

    def trail(
        self,
        image: Image.Image,
        points: Array,
        colour: str,
        width: float,
        opacity: float = 1.0,
    ) -> None:
        """Draw a path, (m, 3) m, with smooth edges."""
        if len(points) < 2:
            return
        fine = arrows.SUPERSAMPLING
        sides = np.array(image.size)
        line = self.stage.project(points).clip(-OUTSIDE, sides + OUTSIDE) * fine
        mask = Image.new("L", tuple((fine * sides).tolist()))
        places = list(map(tuple, line.tolist()))
        thick = round(fine * width * self.scale)
        ImageDraw.Draw(mask).line(places, round(255 * opacity), thick, joint="curve")
        image.paste(style.rgb(colour), (0, 0), mask.reduce(fine))

    def arrow(self, image: Image.Image, tail: Array, tip: Array, force: float, colour: str) -> None:
        """Draw an arrow with smooth edges between two points, (3,) m, and its force, N, beyond it
        or, for a blow, before it, within the picture, at whose edge a longer one ends.
        """
        s = self.scale
        after = colour == style.REACTION
        start, end = self.stage.project(np.array([tail, tip]))
        near, far = (start, end) if after else (end, start)
        way = far - near
        edge = np.where(way > 0.0, np.array(image.size) - RIM * s, RIM * s)
        shares = np.divide(edge - near, way, out=np.ones(2), where=way != 0.0)
        far += way * (shares.clip(0.0, 1.0).min() - 1.0)
        if np.linalg.norm(end - start) > 1.0:
            outline = arrows.outline(np.linspace(start, end, 40), SHAFT_WIDTH * s)
            arrows.paint(image, outline, arrows.rgba(colour))
        words = f"{force:.0f} N"
        wide = style.width(words, LETTERS * s, bold=True)
        x, y = (end if after else start).tolist()
        x += 6 * s if (end[0] >= start[0]) == after else -6 * s - wide
        x = min(max(x, 2 * s), image.width - wide - 2 * s)
        y = min(max(y, LETTERS * s), image.height - LETTERS * s)
        letters = style.font(LETTERS * s, bold=True)
        rim = {"stroke_width": round(2 * s), "stroke_fill": style.PAPER}
        ImageDraw.Draw(image).text((x, y), words, colour, letters, anchor="lm", **rim)

    def beside(self, picture: Array, frame: int) -> Array:
        """Return the whole picture with the arm's bars, and how far its tip is off its path, below
        its label.
        """
        if self.errors is None:
            return picture
        image = Image.fromarray(picture)
        self.gauges(ImageDraw.Draw(image), frame)
        return np.asarray(image)

    def gauges(self, draw: ImageDraw.ImageDraw, frame: int) -> None:
        """Draw the bars of a machine, and how far its tip is off its path."""
        s = self.scale
        left, top, right, bottom = self.room.tolist()
        assert self.errors is not None
        off = 1e3 * self.errors[frame]  # mm
        words = f"{off:.1f} mm" if off < 9.95 else f"{off:.0f} mm"
        bold = style.font(LETTERS * s, bold=True)
        half = BAR_HEIGHT * s / 2
        zero = (top + bottom) / 2
        x = left
        for value in () if self.shares is None else self.shares[frame]:
            end = x + BAR_WIDTH * s
            draw.rectangle((x, zero - half, end, zero + half), style.PAPER, style.RULE)
            low, high = sorted((zero, zero - value * half))
            colour = style.FAILED if abs(value) > 0.999 else self.stage.track.colour
            draw.rectangle((x + 1, low, end - 1, high), colour)
            x = end + BAR_GAP * s
        if x > left:
            draw.line((left, zero, x, zero), style.INK, max(1, round(s)))
        draw.text(((x + right) / 2, zero), words, style.INK, bold, anchor="mm")


def room(traces: Sequence[Trace]) -> tuple[float, float]:
    """Return width and height of what is shown below each label, px of a full-size film: the bars,
    and beside them the tip's distance.
    """
    wide = style.width("000 mm", LETTERS, bold=True) + BAR_GAP
    if all(map(has_bars, traces)):
        wide += traces[0].scenario.plant.n * (BAR_WIDTH + BAR_GAP)
    return wide, BAR_HEIGHT


def overlays(stages: Sequence[Stage], rooms: Array) -> list[Overlay]:
    """Return what is drawn over each stage; arrows of forces have one scale."""
    largest = 0.0
    for stage in stages:
        trace = stage.track.trace
        if tip.knows_contacts(trace.scenario):
            push = windows(trace.t, tip.contacts(trace).push, stage.track.edges).mean
            largest = max(largest, float(np.linalg.norm(push, axis=1).max()))
        for blow in style.pushes([trace]):
            largest = max(largest, float(np.linalg.norm([blow.x, blow.y, blow.z])))
    newton = FORCE_ARROW / largest if largest else 0.0
    return [Overlay(stage, room, newton) for stage, room in zip(stages, rooms, strict=True)]
