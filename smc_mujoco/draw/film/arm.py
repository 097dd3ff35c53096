"""What a film draws over its pictures of arms and free bodies: paths of tips and places, torques
against their limits, the force of a contact, and blows.

It costs little, and no link hides it.
"""

import math
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw

from smc_mujoco.draw import style
from smc_mujoco.draw.decimate import windows
from smc_mujoco.draw.film import arrows
from smc_mujoco.draw.film.stage import Stage
from smc_mujoco.metrics import tip
from smc_mujoco.simulation.trace import Trace

# Sizes are px of a film of full size, and chosen.
PATH_WIDTH = 3.0
WANTED_PATH_WIDTH = 1.6
WANTED_OPACITY = 0.5
OUTSIDE = 100  # px beyond the picture up to which a path is followed
BAR_WIDTH = 15
BAR_GAP = 6
BAR_HEIGHT = 26  # from one limit to the other
LETTERS = 18
LABEL_GAP = 3  # from a label to its bars
BARS_HEIGHT = LABEL_GAP + BAR_HEIGHT + 1.25 * LETTERS  # of bars with their numbers
MAX_TIP_ERROR = 0.015  # m: only a tip farther off has a ghost; a nearer one would hide it
FORCE_ARROW = 0.6  # m, length of the arrow for the largest force
BLOW_ARROW = 0.4  # m, length of the arrow of a blow
SHAFT_WIDTH = 4.0
BLOW_DISTANCE = 0.09  # m, from the middle of a body to the arrow of its blow
BLOW_TIME = 0.12  # s for which a blow is shown after its end


def has_bars(trace: Trace) -> bool:
    """Return whether u is a torque with a limit in every joint of an arm."""
    scenario = trace.scenario
    return bool(scenario.plant.tip) and scenario.force_command and max(scenario.limits) < math.inf


def key(traces: Sequence[Trace]) -> list[str]:
    """Return what the film of arms shows, in words."""
    words = ["line: path of the tip; dark: the wanted path"]
    if all(map(has_bars, traces)):
        joints = traces[0].scenario.plant.n
        words.append(f"bars: torque of joints 1 to {joints}, share of their limits")
    if any(tip.knows_contacts(trace.scenario) for trace in traces):
        words.append("violet arrow: force on what the tip touches")
    if style.pushes(traces):
        words.append("violet arrow: the blow")
    if any(tip.tip_error(trace).max() > MAX_TIP_ERROR for trace in traces):
        words.append("translucent: reference")
    return words


class Trail:
    """A path in the picture, (m, 2) px, at times (m,) s, that grows from frame to frame."""

    def __init__(
        self, points: np.ndarray, times: np.ndarray, colour: str, width: float, opacity: float = 1.0
    ):
        fine = arrows.SUPERSAMPLING
        self.corner = np.floor(points.min(axis=0) - width).astype(int)
        size = np.ceil(points.max(axis=0) + width).astype(int) - self.corner
        self.fine = Image.new("L", tuple((fine * size).tolist()))  # opacities
        self.points = fine * (points - self.corner)
        self.times = times
        self.reached = 0
        self.colour = style.rgb(colour)
        self.width = round(fine * width)
        self.opacity = round(255 * opacity)

    def draw(self, image: Image.Image, time: float) -> None:
        """Draw the path until a time, s, which is not before that of the last picture."""
        stop = int(np.searchsorted(self.times, time, side="right"))
        if stop > self.reached:
            new = self.points[max(self.reached - 2, 0) : stop]  # it joins what is there
            line = list(map(tuple, new.tolist()))
            ImageDraw.Draw(self.fine).line(line, self.opacity, self.width, joint="curve")
            self.reached = stop
            self.mask = self.fine.reduce(arrows.SUPERSAMPLING)
        image.paste(self.colour, tuple(self.corner.tolist()), self.mask)


class Overlay:
    """What is drawn over pictures of the machines on a stage, between `edges`, (frames + 1,) s.

    These are the paths of the tips of arms, or of the places of free bodies. Arms have their forces
    too; `room` has what is shown below each label, (machines, 4) px.
    """

    def __init__(
        self,
        traces: Sequence[Trace],
        colours: Sequence[str],
        stage: Stage,
        edges: np.ndarray,
        room: np.ndarray,
    ):
        self.traces = traces
        self.colours = colours
        self.stage = stage
        self.edges = edges
        self.room = room
        self.scale = stage.scale
        self.trails = []  # the wanted path of each machine, and its own
        self.shares = []  # torques as shares of their limits, (frames, joints), -1 .. 1: means
        self.errors = []  # of tips, (frames,) m
        self.forces = {}  # of a contact, (frames, 3) N
        self.newton = 0.0  # m of an arrow
        barred = all(map(has_bars, traces))
        largest = 0.0
        for k, (trace, colour) in enumerate(zip(traces, colours, strict=True)):
            if trace.scenario.plant.tip:
                path, wanted = tip.tip_paths(trace)
                error = tip.tip_error(trace)[:, None]
                self.errors.append(windows(trace.t, error, edges).mean[:, 0])
            else:
                path = trace.x[:, :3]
                wanted = trace.r[:, :3]
            look = (style.INK, WANTED_PATH_WIDTH, WANTED_OPACITY)
            pair = (self.trail(k, wanted, *look), self.trail(k, path, colour, PATH_WIDTH))
            self.trails.append(pair)
            if barred:
                share = windows(trace.t, trace.applied, edges).mean / trace.scenario.limits
                self.shares.append(np.clip(share, -1.0, 1.0))
            if tip.knows_contacts(trace.scenario):
                self.forces[k] = windows(trace.t, tip.contacts(trace).push, edges).mean
                largest = max(largest, np.linalg.norm(self.forces[k], axis=1).max())
        if largest:
            self.newton = FORCE_ARROW / largest

    def trail(
        self, k: int, points: np.ndarray, colour: str, width: float, opacity: float = 1.0
    ) -> Trail:
        """Return a path of machine k in the picture, from points (m, 3) m."""
        above = np.maximum(points + self.stage.where[k], (-np.inf, -np.inf, 0.0))
        places = self.stage.project(above).clip(-OUTSIDE, np.add(self.stage.size, OUTSIDE))
        return Trail(places, self.traces[k].t, colour, width * self.scale, opacity)

    def lost(self, k: int, frame: int) -> bool:
        """Return whether a machine is so far off its path that a ghost shows where it should be."""
        return not self.errors or bool(self.errors[k][frame] > MAX_TIP_ERROR)

    def over(self, picture: np.ndarray, frame: int) -> np.ndarray:
        """Return the picture of a frame with all this, as the machines stand on the stage."""
        time = float(self.edges[frame + 1])
        image = Image.fromarray(picture)
        for wanted, own in self.trails:
            wanted.draw(image, np.inf)
            own.draw(image, time)
        for k, forces in self.forces.items():
            size = float(np.linalg.norm(forces[frame]))
            if size > 0.5:
                at = self.stage.find(k, self.traces[k].scenario.plant.tip)
                self.arrow(image, at, at - self.newton * forces[frame], size, after=True)
        for k, trace in enumerate(self.traces):
            for blow in style.pushes([trace]):
                end = blow.time + blow.width + BLOW_TIME
                if self.edges[frame] <= end and time >= blow.time:
                    peak = np.array([blow.x, blow.y, blow.z])
                    size = float(np.linalg.norm(peak))
                    place = self.stage.find(k, blow.body) - BLOW_DISTANCE * peak / size
                    start = place - BLOW_ARROW * peak / size
                    self.arrow(image, start, place, size, after=False)
            if self.errors:
                self.gauges(ImageDraw.Draw(image), k, frame)
        return np.asarray(image)

    def arrow(
        self, image: Image.Image, tail: np.ndarray, tip: np.ndarray, force: float, after: bool
    ) -> None:
        """Draw an arrow with smooth edges between two points, (3,) m, and its force, N, beyond it
        or before it.
        """
        s = self.scale
        start, end = self.stage.project(np.array([tail, tip]))
        if np.linalg.norm(end - start) > 1.0:
            outline = arrows.outline(np.linspace(start, end, 40), SHAFT_WIDTH * s)
            arrows.paint(image, outline, arrows.rgba(style.REACTION))
        words = f"{force:.0f} N"
        wide = style.width(words, LETTERS * s, bold=True)
        x, y = (end if after else start).tolist()
        x += 6 * s if (end[0] >= start[0]) == after else -6 * s - wide
        x = min(x, image.width - wide - 2 * s)
        letters = style.font(LETTERS * s, bold=True)
        rim = {"stroke_width": round(2 * s), "stroke_fill": style.PAPER}
        ImageDraw.Draw(image).text((x, y), words, style.REACTION, letters, anchor="lm", **rim)

    def gauges(self, draw: ImageDraw.ImageDraw, k: int, frame: int) -> None:
        """Draw the bars of a machine, and how far its tip is off its path."""
        s = self.scale
        left, top, right, bottom = self.room[k].tolist()
        off = 1e3 * self.errors[k][frame]  # mm
        words = f"{off:.1f} mm" if off < 9.95 else f"{off:.0f} mm"
        bold = style.font(LETTERS * s, bold=True)
        letters = style.font(LETTERS * s)
        if not self.shares:
            middle = ((left + right) / 2, (top + bottom) / 2)
            draw.text(middle, f"tip {words}", style.INK, bold, anchor="mm")
            return
        half = BAR_HEIGHT * s / 2
        zero = top + LABEL_GAP * s + half
        x = left + BAR_GAP * s
        for i, value in enumerate(self.shares[k][frame], 1):
            end = x + BAR_WIDTH * s
            draw.rectangle((x, zero - half, end, zero + half), style.PAPER, style.RULE)
            low, high = sorted((zero, zero - value * half))
            colour = style.FAILED if abs(value) > 0.999 else self.colours[k]
            draw.rectangle((x + 1, low, end - 1, high), colour)
            place = ((x + end) / 2, zero + half + 2 * s)
            draw.text(place, str(i), style.MUTED, letters, anchor="ma")
            x = end + BAR_GAP * s
        draw.line((left, zero, x, zero), style.INK, max(1, round(s)))
        if right - x > 1:
            draw.text((x + 6 * s, zero), "tip", style.MUTED, letters, anchor="lb")
            draw.text((x + 6 * s, zero + 2 * s), words, style.INK, bold, anchor="lt")


def room(traces: Sequence[Trace], slot: float) -> tuple[float, float]:
    """Return width and height of what is shown below each label, px of a full-size film; `slot` is
    a machine's width.

    The tip's distance stands beside the bars where the slot has room for it.
    """
    number = style.width("000 mm", LETTERS, bold=True) + 8
    if not all(map(has_bars, traces)):
        return number + style.width("tip ", LETTERS, bold=True), 1.6 * LETTERS
    bars = traces[0].scenario.plant.n * (BAR_WIDTH + BAR_GAP) + BAR_GAP
    if bars + number < slot:
        return bars + number, BARS_HEIGHT
    return bars, BARS_HEIGHT
