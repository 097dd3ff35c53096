"""A machine as a film moves it: from the positions of its channels to the pose of its whole
mechanism.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.draw.film import arrow_lines, arrows, camera, viewpoint, world
from smc_mujoco.draw.film.camera import Camera
from smc_mujoco.draw.film.track import MachineTrack
from smc_mujoco.mechanisms import layout
from smc_mujoco.mechanisms.layout import OWN, ROTOR, joint_ids
from smc_mujoco.metrics.touching import Shape, shapes
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.scenario import Scenario

POSES = 192  # of a trace, at which what must be in the picture is found
# Chosen, in sizes of what moves: larger fixed things of a user's model may leave the picture, and
# fixed things must be in it so far beside what moves; loose parts that move less count as fixed.
MAX_FIXED_SIZE = 4.0
NEAR_SHARE = 0.1
CALM_SHARE = 0.1
MOST_HEIGHT = 1.7  # of its height in the picture, of all that must be in it, a stand first; chosen
MIN_UPRIGHT = 0.1  # of a vertical line, its length in the picture, for a camera that looks down
# of the size of what moves, so much of a library's stand is seen: its picture is of the bob's arc
OWN_STAND_SHARE = 0.15
# a machine whose foot is higher hangs from it; a floor of the model that is so near is its floor
FLOOR_SHARE = 0.3
NO_FLOOR = 20.0  # sizes over a floor that is not seen
FOLLOWED_TRAVEL = 1.0  # sizes of a machine: one that goes farther is followed; chosen
FOLLOW_TIME = 0.25  # s, over which the followed place is a mean; chosen


def moved_bodies(model: mujoco.MjModel, joints: Sequence[int] | Array) -> list[int]:
    """Return the bodies that joints move, in order: their own and all that hang on these."""
    ids = np.asarray(joints, int)
    moved = set(model.jnt_bodyid[ids].tolist())
    for body in range(1, model.nbody):
        if model.body_parentid[body] in moved:
            moved.add(body)
    return sorted(moved)


def close(boxes: Array, low: Array, high: Array, far: float) -> Array:
    """Return the boxes, (boxes, 8, 3) m, that are within `far`, m, of the box between two corners,
    (3,) m, and are smaller than that.
    """
    below = boxes < high + far
    above = boxes > low - far
    inside = (below & above).all(axis=(1, 2))
    extent = np.ptp(boxes, axis=1).max(axis=1)
    return boxes[inside & (extent < far)]


def clipped_boxes(boxes: Array, low: Array, high: Array) -> Array:
    """Return the parts of boxes, (boxes, 8, 3) m, that are in the box between two corners, (3,)
    m.
    """
    overlaps = (boxes.min(axis=1) <= high) & (boxes.max(axis=1) >= low)
    return boxes[overlaps.all(axis=1)].clip(low, high)


class Course(NamedTuple):
    """Where a trace takes a machine, its reference and what else moves: the corners of their boxes,
    m, at some times. `rest` are the links of a robot that falls or drives, besides those that its
    channels move, such as all but the forearm of a humanoid whose elbow is driven.
    """

    times: list[float]  # s
    places: list[Array]
    goals: list[Array]
    loose_boxes: list[Array]
    rest: list[Array]  # of a machine that its driven joints do not carry

    @property
    def reached(self) -> Array:
        """All places of the machine and its reference, (m, 3) m."""
        return np.concatenate([*self.places, *self.goals])

    @property
    def middle(self) -> Array:
        """The middle of the machine at all times, (times, 3) m."""
        return np.array([points.mean(axis=0) for points in self.places])

    def followed(self, times: Array) -> Array:
        """Return the places to which the camera follows the machine, (times, 3) m, at times in
        s.
        """
        times = np.clip(times, self.times[0], self.times[-1])
        half = np.minimum(times - self.times[0], self.times[-1] - times)
        clipped = half.clip(0.0, 0.5 * FOLLOW_TIME)
        half = clipped[:, None]
        shares = np.linspace(-1.0, 1.0, 9)
        sample_times = times[:, None] + half * shares
        means = [np.interp(sample_times, self.times, part).mean(axis=1) for part in self.middle.T]
        return np.stack(means, axis=1)


@dataclasses.dataclass(frozen=True, eq=False)
class Puppet:
    """The machine of one scenario, with the channels that a film shows."""

    scenario: Scenario
    shapes: Sequence[Shape]  # at the start of the run, and after its jump
    data: Sequence[mujoco.MjData]  # of the shapes
    ids: Array  # of the channels' joints
    slides: Array  # which of these are slides
    rail: float  # m, length along x of a cart's rail, on which it stays; inf without a cart
    start: Array  # the pose of joints without a channel, (nq,)
    rotors: Sequence[tuple[int, int]]  # channel, and place in the pose
    mounts: Sequence[arrow_lines.Mount] = ()  # of a machine that is placed
    height: float = 0.0  # m, of the machine over the film's floor

    @classmethod
    def of(cls, scenario: Scenario) -> "Puppet":
        """Return the machine of a scenario."""
        scenario = world.first_channels(scenario)
        plant = scenario.plant
        machine_shapes = shapes(scenario)
        model = machine_shapes[0].model
        ids = joint_ids(model)
        slides = model.jnt_type[ids] == mujoco.mjtJoint.mjJNT_SLIDE
        rail = np.inf
        start = model.qpos0
        if plant.on_stage:
            for shape in machine_shapes:
                world.restyle(shape.model)
            if plant.unit != "rad" and not plant.pose:
                halves = world.fixed_boxes(model)[..., 0]
                widths = np.abs(halves)
                rail = float(2 * widths.max())
        else:
            start = models.initial_state(model, scenario)[0]
        rotors = []
        for k, joint in enumerate(ids):
            name = ROTOR + model.joint(joint).name
            rotor = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
            if rotor >= 0:
                rotors.append((k, model.jnt_qposadr[rotor]))
        return cls(
            scenario,
            machine_shapes,
            [mujoco.MjData(shape.model) for shape in machine_shapes],
            ids,
            slides,
            rail,
            start,
            rotors,
        )

    @property
    def model(self) -> mujoco.MjModel:
        """The machine's model at the start."""
        return self.shapes[0].model

    def turn(self, chosen: Camera | None) -> Array:
        """Return the frame of the camera, (3, 3), as camera.py has it: the chosen one, else the
        plant's own `look`, or of a user's model the view that shows its motion.
        """
        plant = self.scenario.plant
        if chosen is None and plant.on_stage:
            chosen = "look"
        if isinstance(chosen, str):
            return world.named_turn(self.model, self.start, chosen, plant.name)
        if chosen is None:
            begun = layout.posed(self.model, plant.x0)
            links = np.flatnonzero(self.moved & (self.model.geom_group < world.DRAWN_GROUPS))
            chosen = viewpoint.best_angles(self.model, begun, self.ids, links)
        return camera.turn(*chosen)

    @property
    def floats(self) -> bool:
        """Whether the machine may leave its place: its first joint is not a hinge."""
        model = self.model
        body = model.jnt_bodyid[self.ids[0]]
        while model.body_weldid[model.body_parentid[body]] != 0:
            body = model.body_parentid[body]
        return bool(model.jnt_type[model.body_jntadr[body]] != world.HINGE)

    @property
    def moved(self) -> Array:
        """Which geoms the channels move, without planes, (geoms,)."""
        model = self.model
        of_moved = np.isin(model.geom_bodyid, moved_bodies(model, self.ids))
        return of_moved & (model.geom_type != world.PLANE)

    @property
    def on_bars(self) -> Array:
        """Which channels slide on a rail, or turn on the shaft of a network, (n,)."""
        return self.slides | arrows.is_network(self.scenario.plant)

    @property
    def shown(self) -> int:
        """The number of channels."""
        return self.scenario.plant.n

    def qpos(self, x: Array, ahead: Array | float = 0.0, rest: Array | None = None) -> Array:
        """Return the pose, (nq,), with the channels at x, (shown,) rad or m; a cart stays on its
        rail.

        `ahead` is the lead of the rotors over their joints, (shown,) rad or m. Joints without a
        channel are taken from the pose `rest`, (nq,), by default that of the start.
        """
        model = self.model
        on_rail = np.clip(x, -self.rail / 2, self.rail / 2)
        x = np.where(self.slides, on_rail, x)
        if self.scenario.plant.pose or self.scenario.plant.base >= 0:
            state = models.state_with(model, self.ids, x, 0.0)
            pose = state[0]
        else:
            pose = (self.start if rest is None else rest).copy()
            pose[model.jnt_qposadr[self.ids]] = x
        leads = x + ahead
        for k, place in self.rotors:
            pose[place] = leads[k]
        free = model.jnt_qposadr[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]
        pose[free + 2] += self.height
        return pose

    def posed(
        self, track: MachineTrack, x: Array, time: float
    ) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Return the shape of the machine at a time, s, and its data with the channels at x."""
        now = self.shape(time)
        model = self.shapes[now].model
        data = self.data[now]
        data.qpos[:] = self.qpos(x, rest=track.rest(time))
        world.forward(model, data)
        return model, data

    def corners(self, track: MachineTrack, x: Array, time: float) -> Array:
        """Return the corners of the boxes of all geoms with the channels at x, (geoms, 8, 3) m."""
        return world.boxes(*self.posed(track, x, time))

    def course(self, track: MachineTrack) -> Course:
        """Return where a trace takes the machine, at POSES times."""
        trace = track.trace
        model = self.model
        plane = model.geom_type == world.PLANE
        links = self.moved
        if not links.any():
            raise ScenarioError(
                f"nothing that moves on {trace.scenario.plant.name} has a shape to be filmed: "
                "give its bodies geoms, or its links <visual>"
            )
        falling_parts = []
        for i in model.geom_bodyid:
            falling_parts.append(model.body(i).name.startswith(OWN))
        falling = np.array(falling_parts)
        loose = ~links & ~plane & ~world.still(model) & ~falling
        roots = model.body_rootid[model.geom_bodyid]
        rest = loose & np.isin(roots, roots[links]) & self.floats
        body = links
        if self.carried(self.corners(track, trace.x[0, : self.shown], 0.0), links, rest):
            body = links | rest
            rest = np.zeros_like(rest)
        loose &= ~rest
        course = Course([], [], [], [], [])
        for share in np.linspace(0.0, 1.0, POSES) ** 2:  # most of the motion is early
            last = len(trace.t) - 1
            sample = round(share * last)
            time = float(trace.t[sample])
            goal = trace.r[sample, : self.shown]
            if np.isfinite(goal).all():
                corners = self.corners(track, goal, time)
                goal_corners = corners[links].reshape(-1, 3)
                course.goals.append(goal_corners)
            x = trace.x[sample, : self.shown]
            corners = self.corners(track, x, time)
            course.times.append(time)
            body_corners = corners[body].reshape(-1, 3)
            course.places.append(body_corners)
            course.loose_boxes.append(corners[loose])
            course.rest.append(corners[rest])
        return course

    def carried(self, corners: Array, links: Array, rest: Array) -> bool:
        """Return whether the geoms `links`, (geoms,), carry the `rest` of a machine, as wheels and
        legs do: they are at its foot. `corners` are of all geoms at the start, (geoms, 8, 3) m.
        """
        low = corners[links | rest, :, 2].min()
        high = corners[links | rest, :, 2].max()
        return bool(corners[links, :, 2].min() <= low + FLOOR_SHARE * (high - low))

    def travels(self, course: Course) -> bool:
        """Return whether a machine that nothing holds in place goes so far that the camera follows
        it.
        """
        plant = self.scenario.plant
        if not self.floats or (plant.on_stage and not plant.pose):
            return False
        sizes = []
        for points in course.places:
            sides = np.ptp(points, axis=0)
            sizes.append(float(sides.max()))
        own = max(sizes)
        span = np.ptp(course.middle, axis=0)
        way = float(span.max())
        return way > FOLLOWED_TRAVEL * own

    def placed(
        self, track: MachineTrack, course: Course, followed: bool, front: Array
    ) -> tuple[Array, "Puppet"]:
        """Return what moves and must be in the picture, (points, 3) m, and the machine with bent
        arrows that suit the size of what moves; one that the camera follows at its height over the
        film's floor.

        These are the corners of the boxes of all that the channels move, over the poses of its
        trace and its reference, and its arrows, before a camera whose picture's normal is `front`,
        (3,). Of a machine that the camera follows, the machine
        alone counts.
        """
        machine_places = np.concatenate(course.places)
        sides = np.ptp(machine_places, axis=0)
        widest = sides.max(initial=0.0)
        radius = arrow_lines.BENT_SIZE * float(widest)
        ids = self.ids.tolist()
        slides = self.slides.tolist()
        plant = self.scenario.plant
        joint_mounts = arrow_lines.mounts(plant, self.model, ids, slides, self.rail, front)
        mounts = []
        for mount in joint_mounts:
            smaller = min(mount.radius, radius)
            mounts.append(mount._replace(radius=smaller))
        lines = self.lines(track, mounts)
        line_times = []
        curves = []
        for time, curve in lines:
            line_times.append(time)
            curves.append(curve)
        if followed:
            every_time = np.array([*course.times, *line_times])
            places = course.followed(every_time)
            relative = []
            for part, origin in zip([*course.places, *curves], places, strict=True):
                relative.append(part - origin)
            points = np.concatenate(relative)
            around = (0.5 * MOST_HEIGHT - 0.5) * np.ptp(points, axis=0).max()
            ends = points.min(axis=0) - around, points.max(axis=0) + around
            moved = zip(course.rest, places, strict=False)
            rest = np.concatenate([boxes - origin for boxes, origin in moved])
            points = np.concatenate([points, clipped_boxes(rest, *ends).reshape(-1, 3)])
            every_place = np.concatenate(course.places)
            lowest = float(every_place[:, 2].min())
            height = max(0.0, -lowest)
        else:
            points = np.concatenate([course.reached, *curves])
            height = 0.0
        return points, dataclasses.replace(self, mounts=mounts, height=height)

    def surrounded(
        self, points: Array, courses: Sequence[Course], turn: Array
    ) -> tuple[Array, "Puppet"]:
        """Return points that move on all machines, (m, 3) m, and those around them that must be in
        the picture of a camera's turn too, over the film's floor, and the machine at its height
        over it.

        Of other things, those that move loosely and what stands still, only the part close to these
        counts, such as the upper half of a stand; rails and columns end there.
        """
        lowest = min(course.reached[:, 2].min() for course in courses)
        model = self.model
        on_stage = self.scenario.plant.on_stage
        axes = self.data[0].xaxis[self.ids[self.on_bars]]
        machines = [shape.model for shape in self.shapes]
        world.cut(machines, points, axes, on_stage)
        world.forward(model, self.data[0])
        standing_geoms = world.still(model) & (model.geom_group < world.HIDDEN_GROUP)
        standing = world.boxes(model, self.data[0])[standing_geoms]
        low = points.min(axis=0)
        high = points.max(axis=0)
        size = (high - low).max()
        around, calm = self.loose(courses, 0.0 if on_stage else CALM_SHARE * size)
        if not on_stage:
            far = MAX_FIXED_SIZE * size
            around = close(around, low, high, far)
            standing = close(np.concatenate([standing, calm]), low, high, far)
        foot = float(standing[..., 2].min(initial=np.inf))
        near = np.full(3, NEAR_SHARE * size)
        stand = OWN_STAND_SHARE * size
        if not on_stage:  # what moves fills half of the picture
            reached = np.concatenate([course.reached for course in courses])
            tall, whole_height = (np.ptp(cloud @ turn[:, 1]) for cloud in (reached, points))
            room = max(0.0, MOST_HEIGHT * tall - whole_height) / max(turn[2, 1], MIN_UPRIGHT)
            near[2] = np.inf
            standing = clipped_boxes(standing, low - near, high + near)
            stand = min(room, low[2] - standing[..., 2].min(initial=low[2]))
            near[2] = room - stand
        if self.scenario.plant.tip or not on_stage:
            standing = clipped_boxes(standing, low - (*near[:2], stand), high + near)
        if on_stage and self.slides.all():  # of a cart the rail, not its feet nor what is behind it
            stand = world.CUT_MARGIN * size
            least = low[1:] - (0.0, stand)
            standing[..., 1:] = standing[..., 1:].clip(least, high[1:])
        if on_stage:
            standing[..., 2] = standing[..., 2].clip(low[2] - stand, high[2] + stand)
        points = np.concatenate([points, around.reshape(-1, 3), standing.reshape(-1, 3)])
        height = -foot if standing_geoms.any() else 0.0
        if not on_stage:  # it stands on the floor, or hangs close above it
            height = -min(lowest, foot, float(around[..., 2].min(initial=np.inf)))
            hangs = foot > low[2] + FLOOR_SHARE * (high[2] - low[2])
            if lowest < foot and not hangs:  # a floor below the links would not be below its foot
                height += NO_FLOOR * size
            floors = model.geom_pos[(model.geom_type == world.PLANE) & (model.geom_bodyid == 0), 2]
            floors = floors[np.abs(floors - lowest) < FLOOR_SHARE * size]
            if floors.size:  # that of the model
                height = -floors.max()
        points = points + np.array([0.0, 0.0, height])
        points[:, 2] = points[:, 2].clip(0.0)
        return points, dataclasses.replace(self, height=height)

    def loose(self, courses: Sequence[Course], little: float) -> tuple[Array, Array]:
        """Return the boxes of what moves loosely on all machines, over its course, and of what
        moves less than `little`, m, where it begins, with the `rest` of machines, over its course:
        (boxes, 8, 3) m each.
        """
        moving = []
        calm = []
        for course in courses:
            places = np.stack(course.loose_boxes)
            way = np.ptp(places, axis=0).max(axis=(1, 2))
            moving.append(places[:, way >= little].reshape(-1, 8, 3))
            calm += [places[0, way < little], *course.rest]
        return np.concatenate(moving), np.concatenate(calm)

    def lines(
        self, track: MachineTrack, mounts: Sequence[arrow_lines.Mount]
    ) -> list[tuple[float, Array]]:
        """Return the lines of arrows on a machine, (m, 3) m each, with their times, s, without
        those of blows, whose tails may leave the picture.
        """
        lines = []
        for drawn in track.framing:
            t = track.trace.t
            place = np.searchsorted(t, drawn.time - 1e-9)
            sample = min(int(place), len(t) - 1)
            x = track.trace.x[sample, : self.shown]
            pose = self.posed(track, x, drawn.time)
            for i, arrow in drawn.arrows:
                path = arrow_lines.path(*pose, mounts[i], arrow)
                if path and not arrow.body:
                    lines.append((drawn.time, path[0]))
        return lines

    def shape(self, time: float) -> int:
        """Return the index of the shape at a time, s."""
        return sum(time >= shape.time for shape in self.shapes) - 1
