"""What a film draws over its pictures of arms and free bodies: paths of tips and places, the force
of a contact, and blows.

It costs little, and no link hides it.
"""

import math
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw

from smc_mujoco.common.aliases import Array
from smc_mujoco.draw import style, timed_events
from smc_mujoco.draw.decimate import windows
from smc_mujoco.draw.film import arrows, flat_arrows
from smc_mujoco.draw.film.stage import Stage
from smc_mujoco.metrics import tip

# Sizes are px of a film of full size, and chosen.
PATH_WIDTH = 3.0
WANTED_PATH_WIDTH = 1.6
WANTED_OPACITY = 0.5
OUTSIDE = 100  # px beyond the picture up to which a path is followed
PATH_POINTS = 600  # of a path that is drawn, or a few more
FORCE_ARROW = 0.3  # m, length of the arrow for a lasting contact's usual force, or for a blow
SHAFT_WIDTH = 4.0
BLOW_DISTANCE = 0.09  # m, from the middle of a body to the arrow of its blow
RIM = 4  # of the picture, which arrows leave free
TRAIL_TIME = 1.0  # s of its path behind what the camera follows


class Overlay:
    """What is drawn over pictures of a machine on its stage.

    These are the path of an arm's tip, or of the place of a free body. Arms have their forces too,
    with arrows `newton` m long a newton.
    """

    def __init__(self, stage: Stage, newton: float):
        self.stage = stage
        self.trace = trace = stage.track.trace
        self.edges = edges = stage.track.edges
        self.newton = newton
        self.scale = stage.scale
        self.forces = None  # of a contact, (frames, 3) N
        path = trace.x[:, :3]
        reference_path = trace.r[:, :3]
        if trace.scenario.plant.tip:
            path, reference_path = tip.tip_paths(trace)
        every_nth = slice(None, None, 1 + len(trace.t) // PATH_POINTS)
        self.times = trace.t[every_nth]
        floor = np.array([-np.inf, -np.inf, 0.0])
        above = np.array([0.0, 0.0, stage.puppet.height])
        self.path = np.maximum(path[every_nth] + above, floor)
        self.wanted = np.maximum(reference_path[every_nth] + above, floor)
        if tip.knows_contacts(trace.scenario):
            push = tip.contacts(trace).push
            self.forces = windows(trace.t, push, edges).mean

    def over(self, picture: Array, frame: int) -> Array:
        """Return the picture of a frame with all this, as the machine stands on the stage."""
        time = float(self.edges[frame + 1])
        image = Image.fromarray(picture)
        self.trail(image, self.wanted, style.INK, WANTED_PATH_WIDTH, WANTED_OPACITY)
        since = -np.inf if self.stage.followed is None else time - TRAIL_TIME
        lately = (self.times >= since) & (self.times <= time)
        until = self.path[lately]
        self.trail(image, until, self.stage.track.colour, PATH_WIDTH)
        stamped: list[flat_arrows.Stamped] = []
        if self.forces is not None:
            size = float(np.linalg.norm(self.forces[frame]))
            if size > 0.5:
                tip_place = self.stage.find(self.trace.scenario.plant.tip)
                behind = tip_place - self.newton * self.forces[frame]
                stamped += self.arrow(image, tip_place, behind, size, "")
        start = self.edges[frame] - self.stage.track.holds[frame]
        for body, peak in arrows.blows(self.trace, start, time):
            size = float(np.linalg.norm(peak))
            place = self.stage.find(body) - BLOW_DISTANCE * peak / size
            tail = place - self.newton * peak
            stamped += self.arrow(image, tail, place, size, body)
        taken = [*self.stage.words, *flat_arrows.boxes(stamped, self.scale)]
        flat_arrows.write_numbers(image, stamped, self.scale, taken, image.width)
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
        fine = flat_arrows.SUPERSAMPLING
        sides = np.array(image.size)
        pixels = self.stage.project(points)
        line = pixels.clip(-OUTSIDE, sides + OUTSIDE) * fine
        fine_size = (fine * sides).tolist()
        mask = Image.new("L", tuple(fine_size))
        places = list(map(tuple, line.tolist()))
        thick = round(fine * width * self.scale)
        opaque = round(255 * opacity)
        ImageDraw.Draw(mask).line(places, opaque, thick, joint="curve")
        shrunk = mask.reduce(fine)
        image.paste(style.rgb(colour), (0, 0), shrunk)

    def arrow(
        self, image: Image.Image, tail: Array, tip: Array, force: float, hits: str
    ) -> list[flat_arrows.Stamped]:
        """Draw the arrow of a force, N, between two points, (3,) m: of a contact, or of a blow that
        `hits` a body. It is cut at the edge of the picture. Returns it, or nothing if it points at
        the camera.
        """
        ends = np.array([tail, tip])
        line = self.stage.project(ends)
        free, fixed = (line[0], line[1]) if hits else (line[1], line[0])
        way = free - fixed
        rim = RIM * self.scale
        far = np.array(image.size) - rim
        edge = np.where(way > 0.0, far, rim)
        moves = way != 0.0
        shares = np.divide(edge - fixed, way, out=np.ones(2), where=moves)
        clipped = shares.clip(0.0, 1.0)
        share = float(clipped.min())
        free += (share - 1.0) * way  # in the line
        colour = style.DISTURBANCE if hits else style.REACTION
        words = f"{force:.0f} N"
        shade = arrows.rgba(colour)
        arrow = arrows.Arrow(0.0, share, shade, body=hits, cut=share < 1.0, words=words)
        if np.linalg.norm(way) <= 1.0:
            return []
        points = np.linspace(line[0], line[1], 40)
        width = SHAFT_WIDTH * self.scale
        return [flat_arrows.stamp(image, points, width, arrow, round(flat_arrows.RIM * self.scale))]


def overlays(stages: Sequence[Stage]) -> list[Overlay]:
    """Return what is drawn over each stage; arrows of forces have one scale."""
    sizes = []
    for stage in stages:
        trace = stage.track.trace
        for blow in timed_events.pushes([trace]):
            peak = math.hypot(blow.x, blow.y, blow.z)
            sizes.append(peak)
        if tip.knows_contacts(trace.scenario):
            force = tip.contacts(trace).force
            if force.any():
                usual = np.median(force[force > 0.0])
                sizes.append(float(usual))
    newton = FORCE_ARROW / max(sizes, default=1.0)
    return [Overlay(stage, newton) for stage in stages]
