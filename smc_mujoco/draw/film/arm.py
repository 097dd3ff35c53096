"""What a film shows of an arm: paths of its tip, torques against their limits, the force of a
contact, and blows.

All are drawn over the rendered picture, so they cost little and no link hides them.
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

PATH_WIDTH, WANTED_PATH_WIDTH = 3.0, 1.6  # px
WANTED_OPACITY = 0.5  # of the wanted path
OUTSIDE = 100  # px beyond the picture up to which a path is followed
BAR_WIDTH, BAR_GAP, BAR_HEIGHT = (
    15,
    6,
    26,
)  # px, of a bar, between bars, and from one limit to the other
BAR_LETTERS, NUMBER_SIZE = 18, 18  # px
LABEL_GAP = 3  # px, from a label to its bars
BARS_HEIGHT = LABEL_GAP + BAR_HEIGHT + 1.25 * BAR_LETTERS  # px, of bars with their numbers
# m: only a tip farther off its path has a ghost at its reference; a nearer one hides it; chosen
MAX_TIP_ERROR = 0.015
FORCE_ARROW = 0.6  # m, length of the arrow for the largest force
BLOW_ARROW = 0.4  # m, length of the arrow of a blow
SHAFT_WIDTH = 4.0  # px
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
        words.append(
            f"bars: torque of joints 1 to {traces[0].scenario.plant.n}, share of their limits"
        )
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
        self.corner = np.floor(points.min(axis=0) - width).astype(int)
        size = np.ceil(points.max(axis=0) + width).astype(int) - self.corner
        self.fine = Image.new("L", tuple((arrows.SUPERSAMPLING * size).tolist()))  # opacities
        self.mask = self.fine.reduce(arrows.SUPERSAMPLING)
        self.points = arrows.SUPERSAMPLING * (points - self.corner)
        self.times = times
        self.reached = 0
        self.colour = style.rgb(colour)
        self.width = arrows.SUPERSAMPLING * width
        self.opacity = round(255 * opacity)

    def draw(self, image: Image.Image, time: float) -> None:
        """Draw the path until a time, s, which is not before that of the last picture."""
        stop = int(np.searchsorted(self.times, time, side="right"))
        if stop > self.reached:
            new = self.points[max(self.reached - 2, 0) : stop]  # it joins what is there
            pen = ImageDraw.Draw(self.fine)
            pen.line(
                [tuple(point) for point in new.tolist()],
                self.opacity,
                round(self.width),
                joint="curve",
            )
            self.mask, self.reached = self.fine.reduce(arrows.SUPERSAMPLING), stop
        image.paste(self.colour, tuple(self.corner.tolist()), self.mask)


class Paths:
    """Paths that the machines on a stage take, and the wanted ones, drawn over its pictures.

    These are the paths of the tips of arms, and of the places of free bodies.
    """

    def __init__(self, traces: Sequence[Trace], colours: Sequence[str], stage: Stage):
        self.trails = []
        self.wanted = []
        s = stage.scale
        for trace, colour, place in zip(traces, colours, stage.where, strict=True):
            free = trace.scenario.plant.pose
            if free:
                lines = (trace.x[:, :3], trace.r[:, :3])
            else:
                lines = tip.tip_paths(trace)
            above = [np.maximum(points + place, (-np.inf, -np.inf, 0.0)) for points in lines]
            path, wanted = (
                stage.project(points).clip(-OUTSIDE, np.add(stage.size, OUTSIDE))
                for points in above
            )
            self.trails.append(Trail(path, trace.t, colour, PATH_WIDTH * s))
            self.wanted.append(
                Trail(wanted, trace.t, style.INK, WANTED_PATH_WIDTH * s, WANTED_OPACITY)
            )

    def draw(self, image: Image.Image, time: float) -> None:
        """Draw the wanted paths, and the actual ones until a time, s."""
        for trail, wanted in zip(self.trails, self.wanted, strict=True):
            wanted.draw(image, np.inf)
            trail.draw(image, time)

    def over(self, picture: np.ndarray, time: float) -> np.ndarray:
        """Return a picture with the paths until a time, s."""
        image = Image.fromarray(picture)
        self.draw(image, time)
        return np.asarray(image)


class Overlay:
    """What is drawn over pictures of the arms on a stage, between `edges`, (frames + 1,) s.

    `room` has what is shown below each label, (machines, 4) px.
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
        self.paths = Paths(traces, colours, stage)
        self.scale = stage.scale
        self.shares = (
            None  # torques as shares of their limits, (frames, joints), -1 .. 1: means over a frame
        )
        if all(map(has_bars, traces)):
            torques = [windows(trace.t, trace.applied, edges).mean for trace in traces]
            limits = [np.array(trace.scenario.limits) for trace in traces]
            self.shares = [
                np.clip(u / most, -1.0, 1.0) for u, most in zip(torques, limits, strict=True)
            ]
        self.errors = [
            windows(trace.t, tip.tip_error(trace)[:, None], edges).mean[:, 0] for trace in traces
        ]
        self.forces = [
            windows(trace.t, tip.contacts(trace).push, edges).mean
            if tip.knows_contacts(trace.scenario)
            else None
            for trace in traces
        ]
        sizes = [np.linalg.norm(force, axis=1).max() for force in self.forces if force is not None]
        # m
        if max(sizes, default=0.0):
            self.newton = FORCE_ARROW / max(sizes, default=1.0)
        else:
            self.newton = 0.0
        self.blows = [(k, push) for k, trace in enumerate(traces) for push in style.pushes([trace])]

    def over(self, picture: np.ndarray, frame: int) -> np.ndarray:
        """Return the picture of a frame with all this, as the machines stand on the stage."""
        time = float(self.edges[frame + 1])
        image = Image.fromarray(picture)
        self.paths.draw(image, time)
        draw = ImageDraw.Draw(image)
        for k, force in enumerate(self.forces):
            if force is not None and (size := float(np.linalg.norm(force[frame]))) > 0.5:
                at = self.stage.find(k, self.traces[k].scenario.plant.tip)
                self.arrow(image, np.array([at, at - self.newton * force[frame]]), size, after=True)
        for k, blow in self.blows:
            if self.edges[frame] <= blow.time + blow.width + BLOW_TIME and time >= blow.time:
                peak = np.array([blow.x, blow.y, blow.z])
                way = peak / np.linalg.norm(peak)
                end = self.stage.find(k, blow.body) - BLOW_DISTANCE * way
                self.arrow(
                    image,
                    np.array([end - BLOW_ARROW * way, end]),
                    float(np.linalg.norm(peak)),
                    after=False,
                )
        for k in range(len(self.traces)):
            self.gauges(draw, k, frame)
        return np.asarray(image)

    def arrow(self, image: Image.Image, ends: np.ndarray, force: float, after: bool) -> None:
        """Draw an arrow with smooth edges between two points, (2, 3) m, and its force, N, beyond it
        or before it.
        """
        s, (start, end) = self.scale, self.stage.project(ends)
        if np.linalg.norm(end - start) > 1.0:
            line = np.linspace(start, end, 40)
            rgb = np.array(style.rgb(style.REACTION)) / 255
            arrows.paint(image, arrows.outline(line, SHAFT_WIDTH * s), (*rgb, 1.0))
        draw = ImageDraw.Draw(image)
        font = style.font(NUMBER_SIZE * s, bold=True)
        place = end if after else start
        gap = 6 * s * np.sign((end - start)[0] or 1.0) * (1 if after else -1)
        anchor = "lm" if gap > 0 else "rm"
        at = (float(place[0] + gap), float(place[1]))
        look = {"anchor": anchor, "stroke_width": round(2 * s), "stroke_fill": style.PAPER}
        draw.text(at, f"{force:.0f} N", style.REACTION, font, **look)

    def gauges(self, draw: ImageDraw.ImageDraw, k: int, frame: int) -> None:
        """Draw the bars of a machine, and how far its tip is off its path."""
        s, (left, top, right, bottom), font = (
            self.scale,
            self.room[k].tolist(),
            style.font(BAR_LETTERS * self.scale),
        )
        off, letters = 1e3 * self.errors[k][frame], style.font(NUMBER_SIZE * s, bold=True)  # mm
        words = f"tip {off:.{1 if off < 9.95 else 0}f} mm"
        if self.shares is None:
            draw.text(
                ((left + right) / 2, (top + bottom) / 2), words, style.INK, letters, anchor="mm"
            )
            return
        zero = top + (LABEL_GAP + BAR_HEIGHT / 2) * s
        half = BAR_HEIGHT * s / 2
        share = self.shares[k][frame]
        for i, value in enumerate(share):
            x = left + (BAR_GAP + i * (BAR_WIDTH + BAR_GAP)) * s
            draw.rectangle(
                (x, zero - half, x + BAR_WIDTH * s, zero + half), style.PAPER, style.RULE
            )
            low, high = sorted((zero, zero - value * half))
            full = abs(value) > 0.999
            draw.rectangle(
                (x + 1, low, x + BAR_WIDTH * s - 1, high), style.FAILED if full else self.colours[k]
            )
            draw.text(
                (x + BAR_WIDTH * s / 2, zero + half + 2 * s),
                str(i + 1),
                style.MUTED,
                font,
                anchor="ma",
            )
        wide = bars_width(len(share)) * s
        draw.line((left, zero, left + wide, zero), style.INK, max(1, round(s)))
        if right - left > wide + 1:
            draw.text(
                (left + wide + 6 * s, zero),
                "tip",
                style.MUTED,
                style.font(NUMBER_SIZE * s),
                anchor="lb",
            )
            draw.text(
                (left + wide + 6 * s, zero + 2 * s),
                words.removeprefix("tip "),
                style.INK,
                letters,
                anchor="lt",
            )


def bars_width(joints: int) -> float:
    """Return the width of the bars of a machine, px of a full-size film."""
    return joints * (BAR_WIDTH + BAR_GAP) + BAR_GAP


def room(traces: Sequence[Trace], slot: float) -> tuple[float, float]:
    """Return width and height of what is shown below each label, px of a full-size film; `slot` is
    a machine's width.

    The tip's distance stands beside the bars where the slot has room for it.
    """
    number = style.width("000 mm", NUMBER_SIZE, bold=True) + 8
    if not all(map(has_bars, traces)):
        return number + style.width("tip ", NUMBER_SIZE, bold=True), 1.6 * NUMBER_SIZE
    bars = bars_width(traces[0].scenario.plant.n)
    return bars + number * (bars + number < slot), BARS_HEIGHT
