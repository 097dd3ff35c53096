"""End stops, walls and falling balls that any machine can meet: your own, the library's, a body
that flies.

    contact=smc.Stops({"elbow": (-1.0, 0.2)})
    contact=(smc.Wall("hand", direction=(0, 0, -1), gap=0.15), smc.Ball("hand", mass=0.2))

They find their place in the start pose of the plant, its own x0, so that they stand there in all
runs, wherever these start. They touch what they name and nothing else: a wall and a ball the geoms
of one body that collide, or all of its geoms if none does. Their blows are those of
`hardware.contact`, without friction.
"""

# pyright: reportIncompatibleVariableOverride=false
# (a constant of the base class is a property here)
import dataclasses
import functools
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array, Pair
from smc_mujoco.common.constraints import Number, Range
from smc_mujoco.common.data import frozen_data
from smc_mujoco.common.errors import ScenarioError, find, items_of, number, shown
from smc_mujoco.common.frozen import frozen
from smc_mujoco.mechanisms.hardware import contact
from smc_mujoco.mechanisms.hardware.contact import FIRM_IMPEDANCE, Obstacle, solref
from smc_mujoco.mechanisms.hardware.part import Positive
from smc_mujoco.mechanisms.layout import OWN, loaded, posed
from smc_mujoco.mechanisms.plant import Field, Plant

Restitution = Annotated[float, Number(low=0.0, high=contact.MAX_RESTITUTION)]
# An obstacle on a plant: the model of both, its place, (3,) m, the geoms that it hits, its own geom
Placed = tuple[mujoco.MjModel, np.ndarray, list[int], int]

# m per m/s (rad per rad/s) of a blow: chosen, so that 2 m/s goes 4 mm deep and leaves again within
# 15 ms, in which the machine hardly moves, and in which MuJoCo's steps of 0.25 ms meet e within 5 %
BLOW_DEPTH = 0.002
DEPTH_SHARE = 0.25  # of the depth for a speed, a time: the longest step that resolves it; chosen
INK = (0.16, 0.17, 0.20, 1.0)
STEEL = (0.70, 0.72, 0.75, 1.0)
RED = (0.85, 0.30, 0.20, 1.0)
# m, chosen: of the slab that shows a wall, and of the ball that shows a stop
THICKNESS = 0.03
POST_RADIUS = 0.02
CLOSE = 1e-7  # m: shapes that are so near touch
MAX_MARCH = 1000  # steps of its way
FAR = 10.0  # sizes of the machine, from where a shape approaches it
SHAPES = mujoco.mjtGeom
UNTOUCHED = {"contype": 0, "conaffinity": 0}  # by other geoms
HIDDEN = UNTOUCHED | {"group": 5, "rgba": (0.0, 0.0, 0.0, 0.0)}


@frozen_data
class Stops(Obstacle):
    """End stops of joints, in place of their own limits.

    A blow of 1 rad/s (m/s) goes 2 mrad (mm) deep by default.

    Attributes:
      limits: joint -> its lowest and highest position, rad or m. Any hinge or slide, also one
        without a channel.
      restitution: ratio of the speeds after and before a blow, 0 .. 0.98.
      depth: how deep a blow goes for its speed, rad per rad/s (m per m/s), greater than 0. Harder
        stops need shorter physics steps, which a scenario then takes by default.
    """

    solid = False

    limits: Mapping[str, Pair]
    restitution: Restitution = 0.3
    depth: Positive = BLOW_DEPTH

    def __post_init__(self) -> None:
        super().__post_init__()
        ends = {}
        for joint, pair in frozen(self.limits).items():
            ends[joint] = Range()(f"the place of the stops of joint {joint!r}", pair)
        object.__setattr__(self, "limits", frozen(ends))

    def check(self, plant: Plant) -> None:
        """Check that the plant has these joints."""
        model = loaded(plant)
        single = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE
        moving = np.isin(model.jnt_type, single)
        names = _names(map(model.joint, np.flatnonzero(moving)))
        for joint in self.limits:
            find(f"joint of {plant.name} in Stops", joint, names)

    @property
    def longest_step(self) -> float:
        return math.inf if self.depth >= BLOW_DEPTH else DEPTH_SHARE * self.depth

    def edit_on(self, plant: Plant, spec: mujoco.MjSpec) -> None:
        _enable(spec, "LIMIT")
        for name in self.limits:
            joint = spec.joint(name)
            joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
            joint.range = (-1.0, 1.0)  # `fields` has it in rad, whatever the file's unit
            joint.margin = 0.0
            joint.solref_limit = solref(self.restitution, FIRM_IMPEDANCE, self.depth, 1.0)
            joint.solimp_limit[:2] = FIRM_IMPEDANCE
        for name, place in _posts(self, plant):
            before = spec.joint(name).parent.parent
            _ball(before, "", POST_RADIUS, pos=place, rgba=INK, mass=0.0)

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        for name, ends in self.limits.items():
            yield Field("jnt_range", model.joint(name).id, ends)

    def meets(self, plant: Plant, x: Iterable[float]) -> str:
        model = loaded(plant)
        qpos = posed(model, x).qpos
        for name, (low, high) in self.limits.items():
            place = qpos[model.joint(name).qposadr[0]]
            if not low < place < high:
                stops = f"the Stops of contact are at {low:g} and {high:g}"
                return f"joint {name!r} at {place:g}, and {stops}"
        return ""


@frozen_data
class OfBody(Obstacle):
    """Base of what a body hits: something that is added to the world."""

    body: str
    restitution: Restitution = dataclasses.field(default=0.3, kw_only=True)

    def check(self, plant: Plant) -> None:
        """Check that the plant has the body, and that it is met."""
        model = loaded(plant)
        moving = (model.body_weldid > 0) & (model.body_geomnum > 0)
        names = _names(map(model.body, np.flatnonzero(moving)))
        find(f"body of {plant.name} in a {type(self).__name__}", self.body, names)
        _placed(self, plant)

    def edit_on(self, plant: Plant, spec: mujoco.MjSpec) -> None:
        model, place, geoms, _ = _placed(self, plant)
        _enable(spec, "CONTACT")
        _name_geoms(spec, self.body)
        shape = self.add(spec)
        shape.pos = place
        # an estimate of `solref` is exact for a ball lighter than what it hits
        directions = 1.0 if self.loose else 3.0
        normal = solref(self.restitution, FIRM_IMPEDANCE, BLOW_DEPTH, directions)
        for geom in geoms:
            names = model.geom(geom).name, shape.name
            contact.add_pair(spec, contact.HIT, names, normal, FIRM_IMPEDANCE, 0.0)

    def add(self, spec: mujoco.MjSpec) -> mujoco.MjsBody:
        """Add it to the world, as a body and a geom of the same name."""
        raise NotImplementedError

    def direction_and_distance(self, model: mujoco.MjModel) -> tuple[Array, float]:
        """Return the direction from the body to it, (3,), and how far it is at the start, m."""
        raise NotImplementedError


@frozen_data
class Wall(OfBody):
    """A wall before a body, flat and without an end, which only this body hits.

    Attributes:
      body: its name.
      direction: from the body to the wall, in the axes of the world, (3,), of any length.
      gap: m, from the body to the wall at the plant's own x0, wherever runs start; greater than 0.
      size: m, side of the slab that shows it, greater than 0.
      restitution: ratio of the speeds after and before a blow, 0 .. 0.98.
    """

    direction: tuple[float, ...]
    gap: Positive
    size: Positive = 0.6

    def __post_init__(self) -> None:
        super().__post_init__()
        what = "Wall's direction"
        way = tuple(number(what, part) for part in items_of(what, self.direction))
        if len(way) != 3 or not any(way):
            raise ScenarioError(f"{what} is {way}: give three numbers, not all 0, as (0, 0, -1)")
        object.__setattr__(self, "direction", way)

    def direction_and_distance(self, model: mujoco.MjModel) -> tuple[Array, float]:
        """Return its direction and the gap."""
        size = np.linalg.norm(self.direction)
        return np.array(self.direction) / size, self.gap

    def add(self, spec: mujoco.MjSpec) -> mujoco.MjsBody:
        """Add a plane, which only pairs see, and the slab that is seen."""
        wall = _add_body(spec)
        turn = np.zeros(4)
        mujoco.mju_quatZ2Vec(turn, -np.array(self.direction))
        wall.quat = turn
        size = self.size / 2, self.size / 2, THICKNESS / 2
        wall.add_geom(name=wall.name, type=SHAPES.mjGEOM_PLANE, size=size, **HIDDEN)
        behind = {"pos": (0, 0, -THICKNESS / 2), "rgba": STEEL} | UNTOUCHED
        wall.add_geom(type=SHAPES.mjGEOM_BOX, size=size, **behind)
        return wall

    def meets(self, plant: Plant, x: Iterable[float]) -> str:
        model, place, geoms, shape = _placed(self, plant)
        data = posed(model, x)
        data.geom_xpos[shape] = place
        away = _distance(model, data, geoms, shape)
        if away > 0.0:
            return ""
        start = ", ".join(f"{place:g}" for place in plant.x0)
        return (
            f"body {self.body!r} {-1e3 * away:.3g} mm in its wall (the gap of "
            f"{1e3 * self.gap:.3g} mm is from the plant's own x0, {start})"
        )


@frozen_data
class Ball(OfBody):
    """A ball that falls from rest onto a body, and hits only this body.

    It starts above the centre of mass, and falls by `height` until it meets the body at the plant's
    start: after sqrt(2 height/g).

    Attributes:
      body: its name.
      mass: kg, greater than 0.
      height: m, of its fall, greater than 0.
      radius: m, greater than 0.
      restitution: ratio of the speeds after and before a blow, 0 .. 0.98.
    """

    loose = True

    mass: Positive = 0.1
    height: Positive = 0.5
    radius: Positive = 0.03

    def direction_and_distance(self, model: mujoco.MjModel) -> tuple[Array, float]:
        """Return the way up and the height."""
        if not model.opt.gravity.any():
            raise ScenarioError("a Ball does not fall without gravity: leave it out")
        size = np.linalg.norm(model.opt.gravity)
        return -model.opt.gravity / size, self.height

    def add(self, spec: mujoco.MjSpec) -> mujoco.MjsBody:
        """Add a ball that nothing holds."""
        ball = _add_body(spec)
        ball.add_freejoint(name=ball.name)
        _ball(ball, ball.name, self.radius, rgba=RED, mass=self.mass)
        return ball


@functools.lru_cache(maxsize=64)
def _placed(part: OfBody, plant: Plant) -> Placed:
    """Find the place of an obstacle: where it meets the body at the plant's start, and back."""
    spec = plant.spec()
    _name_geoms(spec, part.body)
    name = part.add(spec).name
    model = plant.load(spec=spec)
    away, room = part.direction_and_distance(model)
    body = model.body(part.body).id
    shape = model.geom(name).id
    at_start = posed(model, plant.x0)
    place = _meeting(model, at_start, body, shape, away)
    if place is None:
        raise ScenarioError(
            f"{shown(part)} does not meet its body on the way to the centre of mass: give another "
            f"body of {plant.name}, or a larger radius"
        )
    return model, place + room * away, _geoms(model, body), shape


@functools.lru_cache(maxsize=64)
def _posts(stops: Stops, plant: Plant) -> list[tuple[str, Array]]:
    """Return joint and place, (3,) m in the axes of the body before it, of what shows each stop:
    a ball that the moved body touches there.
    """
    spec = plant.spec()
    name = _add_body(spec).name
    _ball(spec.body(name), name, POST_RADIUS)
    model = plant.load(spec=spec)
    posts = []
    for joint, ends in stops.limits.items():
        stopped = model.joint(joint)
        body = int(stopped.bodyid[0])
        before = model.body_parentid[body]
        for end, side in zip(ends, (-1.0, 1.0), strict=True):
            data = posed(model, plant.x0)
            data.qpos[stopped.qposadr[0]] = end
            mujoco.mj_kinematics(model, data)
            way = data.xaxis[stopped.id]
            if stopped.type[0] == mujoco.mjtJoint.mjJNT_HINGE:
                anchor = data.xanchor[stopped.id]
                way = np.cross(way, data.xipos[body] - anchor)
            size = np.linalg.norm(way)
            if size < CLOSE or not model.body_geomnum[body]:
                continue  # a wheel
            geom = model.geom(name).id
            met = _meeting(model, data, body, geom, side * way / size)
            if met is not None:
                frame = data.xmat[before].reshape(3, 3)
                away = met - data.xpos[before]
                posts.append((joint, away @ frame))
    return posts


def _meeting(
    model: mujoco.MjModel, data: mujoco.MjData, body: int, shape: int, away: Array
) -> Array | None:
    """Return where a geom meets a body, on its way from afar to the centre of mass, (3,) m; None if
    it passes.
    """
    geoms = _geoms(model, body)
    height = FAR * model.stat.extent
    for _ in range(MAX_MARCH):
        data.geom_xpos[shape] = data.xipos[body] + height * away
        gap = _distance(model, data, geoms, shape)
        if gap < CLOSE:
            return data.geom_xpos[shape] - gap * away
        height -= gap
    return None


def _geoms(model: mujoco.MjModel, body: int) -> list[int]:
    """Return the geoms of a body that collide; all if none does."""
    first = model.body_geomadr[body]
    geoms = list(range(first, first + model.body_geomnum[body]))
    masks = model.geom_contype | model.geom_conaffinity
    return [geom for geom in geoms if masks[geom]] or geoms


def _distance(model: mujoco.MjModel, data: mujoco.MjData, geoms: list[int], other: int) -> float:
    """Return the distance from the nearest of some geoms to another one, m."""
    return min(mujoco.mj_geomDistance(model, data, geom, other, 1e9, None) for geom in geoms)


def _names(things: Iterable) -> dict[str, None]:
    """Return the names of bodies or joints that have one."""
    return dict.fromkeys(element.name for element in things if element.name)


def _name_geoms(spec: mujoco.MjSpec, body: str) -> None:
    """Give each geom of a body a name, if it has none."""
    for k, geom in enumerate(spec.body(body).geoms):
        geom.name = geom.name or f"{OWN}{body}:{k}"


def _add_body(spec: mujoco.MjSpec) -> mujoco.MjsBody:
    """Add a body to the world, with a name of this package's own."""
    return spec.worldbody.add_body(name=f"{OWN}obstacle{len(spec.bodies)}")


def _ball(body: mujoco.MjsBody, name: str, radius: float, **look) -> None:
    """Give a body the shape of a ball, which touches nothing by itself."""
    body.add_geom(name=name, type=SHAPES.mjGEOM_SPHERE, size=(radius, 0, 0), **UNTOUCHED | look)


def _enable(spec: mujoco.MjSpec, what: str) -> None:
    """Let what is added act, a "LIMIT" or "CONTACT", and nothing else that the file disables."""
    flags = mujoco.mjtDisableBit
    option = spec.option
    if option.disableflags & flags.mjDSBL_CONSTRAINT.value:
        for name in ("EQUALITY", "FRICTIONLOSS", "LIMIT", "CONTACT"):
            option.disableflags |= getattr(flags, f"mjDSBL_{name}").value
        option.disableflags &= ~flags.mjDSBL_CONSTRAINT.value
    flag = getattr(flags, f"mjDSBL_{what}").value
    if not option.disableflags & flag:
        return
    option.disableflags &= ~flag
    if what == "LIMIT":
        for part in (*spec.joints, *spec.tendons):
            part.limited = mujoco.mjtLimited.mjLIMITED_FALSE
        return
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = 0
    for pair in spec.pairs:
        spec.delete(pair)
