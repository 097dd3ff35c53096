"""Where the arrows at a machine's joints lie in space.

Arrows lie along a pendulum's arc, beyond the bob; or along the rail, above the cart in the picture,
or before it where carts share one. At a hinge of a user's model, whose links may have any shape,
they bend around its axis. A body of a user's model that is pushed has one that ends before it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.draw.film.arrows import MAX_BLOW, Arrow
from smc_mujoco.mechanisms.plant import Plant, plant_catalogue

# Numbers of presentation here are chosen. An arrow's length is stated for the longest one.
HINGE_LENGTH = 0.425  # of the pendulum's length
SLIDE_LENGTH = 0.08  # of the rail's
RADIUS_SHARE = 0.16  # of the bob's radius, in the thickness of an arrow
LENGTH_SHARE = 0.024  # of the pendulum's length, which is added
LONG_PENDULUM = 0.5  # m: longer pendulums have arrows as thick as one of this length
ARC_DISTANCE = 1.6  # thicknesses between a bob and its nearest arrow
RAIL_DISTANCE = 2.2  # the same above a cart
LAYER_DISTANCE = 2.6  # thicknesses between two arrows
SLIDE_THICKNESS = 0.035  # m
MAX_RAIL_SHARE = 0.008  # of the rail, of an arrow's thickness
USER_LENGTH = 0.25  # at slides of a user's model, of its extent
USER_THICKNESS = 0.012
USER_RADIUS = 0.2  # of a bent arrow at a hinge of a user's model, of its extent
BENT_SIZE = 0.25  # largest radius of a bent arrow, of the size of what moves
MAX_BENT_SHARE = 0.2  # the same, of the picture's height
MAX_SWEEP = 2.0  # rad, of the longest bent arrow
BENT_WIDTH = 0.2  # of a bent arrow, in radii
BENT_DISTANCE = 0.35  # to the next one
BENT_RAISE = 0.5  # by which the middle of a bent arrow is higher than the direction to the camera
CHAIN_FACTOR = 1.6  # arrows of several pendulums are longer: they are seen from the side
MIN_LEVER = 1e-6  # m: a body centred on its hinge has no arc for an arrow
FLIGHT_LENGTH = 3.0  # at a free body, in radii of its largest part
FLIGHT_THICKNESS = 0.14
FLIGHT_DISTANCE = 0.4  # of the longest arrow, from the middle of a free body to the arrow over it
BLOW_DISTANCE = 1.1  # of an arrow, from the foot of that of a blow to the middle of its body


class Mount(NamedTuple):
    """Place and size of the arrows at a joint of the film's scene."""

    joint: int
    unit: float  # longest arrow at a slide, m; at a hinge, a factor on HINGE_LENGTH
    thick: float  # at a slide, m
    front: Array | None  # to the camera, (3,), for a slide that carries something
    ahead: bool = False  # at a slide, in line with what slides, from the side to which it points
    radius: float = 0.0  # of bent arrows, m; 0 for straight ones


def mounts(
    plant: Plant,
    model: mujoco.MjModel,
    joints: Sequence[int],
    slides: Sequence[bool],
    rail: float,
    front: Array,
) -> list[Mount]:
    """Return the Mount of each joint of a machine's model on a `rail` of that length in m; `front`
    points to the camera.
    """
    if plant.pose:
        reach = float(model.geom_rbound[model.geom_bodyid > 0].max(initial=0.0))
        slide = Mount(0, FLIGHT_LENGTH * reach, FLIGHT_THICKNESS * reach, None)
        hinge = slide
    elif not plant.on_stage:
        extent = float(model.stat.extent)
        slide = Mount(0, USER_LENGTH * extent, USER_THICKNESS * extent, front)
        hinge = slide._replace(unit=1.0, radius=USER_RADIUS * extent)
    else:
        thick = min(SLIDE_THICKNESS, MAX_RAIL_SHARE * rail)
        slide = Mount(0, SLIDE_LENGTH * rail, thick, front)
        turning = CHAIN_FACTOR if plant.n > 1 else 1.0
        usual = plant_catalogue().get(plant.name)
        if plant.n == 1 and "l" in plant.parameters and usual:  # as large on any rod
            turning = usual.parameters["l"] / plant.parameters["l"]
        hinge = slide._replace(unit=turning)
    joint_mounts = []
    for joint, slides_here in zip(joints, slides, strict=True):
        joint_mounts.append((slide if slides_here else hinge)._replace(joint=joint))
    return joint_mounts


def straight(
    model: mujoco.MjModel, data: mujoco.MjData, body: str | int, force: Array, longest: float
) -> Array:
    """Return the line of a force's arrow, (40, 3) m, the longest one as given, m: over a free body,
    whose number is given; or, of a blow on a body of a name, to its middle.
    """
    along = np.linspace(0.0, 1.0, 40)[:, None] * force
    if isinstance(body, str):
        names = [model.body(i).name.removeprefix("m/") for i in range(model.nbody)]
        return data.xipos[names.index(body)] + along - BLOW_DISTANCE * force
    over = np.array([0.0, 0.0, FLIGHT_DISTANCE * longest + 0.5 * abs(force[2])])
    return data.xpos[body] + over + along - 0.5 * force


def bent(
    anchor: Array, axis: Array, mount: Mount, arrow: Arrow, along: Array
) -> tuple[Array, float] | None:
    """Return as `path` the line of an arrow around a hinge; `along`, (m, 1), is where its points
    are, of the longest.
    """
    front = mount.front + np.array([0.0, 0.0, BENT_RAISE])
    right = np.cross(axis, front)
    if not right.any():
        return None
    right /= np.linalg.norm(right)
    sideways = np.cross(right, axis)
    out = np.cos(MAX_SWEEP * along) * sideways + np.sin(MAX_SWEEP * along) * right
    radius = mount.radius * (1.0 + BENT_DISTANCE * arrow.layer)
    return anchor + radius * out, arrow.size * BENT_WIDTH * mount.radius


def path(
    model: mujoco.MjModel, data: mujoco.MjData, mount: Mount, arrow: Arrow
) -> tuple[Array, float] | None:
    """Return an arrow's line, (m, 3) m, and its shaft's width, m; None where it has no place."""
    axis = data.xaxis[mount.joint]
    anchor = data.xanchor[mount.joint]
    owner = model.jnt_bodyid[mount.joint]
    if arrow.way is not None:
        unit = MAX_SWEEP * mount.radius or mount.unit
        width = BENT_WIDTH * mount.radius or mount.thick
        force = min(arrow.high, MAX_BLOW) * arrow.way
        return straight(model, data, arrow.body or owner, unit * force, unit), width
    low, high = np.clip((arrow.low, arrow.high), -1.0, 1.0)
    along = np.linspace(low, high, 40)[:, None]  # of the longest
    if mount.radius:
        return bent(anchor, axis, mount, arrow, along)
    body = arrow_geom(model, owner)
    if body < 0:
        return None
    place = data.geom_xpos[body]
    sides = 0.0
    if model.jnt_type[mount.joint] == mujoco.mjtJoint.mjJNT_HINGE:
        radius = model.geom_rbound[body]
        arm = np.cross(axis, np.cross(place - anchor, axis))  # a link may be beside its hinge
        length = np.linalg.norm(arm)
        if length < MIN_LEVER:
            return None
        reach = mount.unit * HINGE_LENGTH * length
        out = arm / length
        width = RADIUS_SHARE * radius + LENGTH_SHARE * mount.unit * min(length, LONG_PENDULUM)
        start = radius + ARC_DISTANCE * width
        way = np.cross(axis, out)
    else:
        reach = mount.unit
        width = mount.thick
        way = axis
        out = np.array([0.0, 0.0, 1.0])
        if mount.front is not None:
            across = np.cross(mount.front, way)
            if np.linalg.norm(across) >= 0.1:  # else it slides to the camera
                out = across / np.linalg.norm(across) * (1.0 if across[2] >= 0.0 else -1.0)
        frame = data.geom_xmat[body].reshape(3, 3)
        box = model.geom_aabb[body]
        turned = out @ frame
        start = box[:3] @ turned
        if mount.ahead:
            half = box[3:] @ np.abs(way @ frame)
            sides = half * np.linspace(np.sign(low or high), np.sign(high or low), 40)[:, None]
        else:
            start += box[3:] @ np.abs(turned) + RAIL_DISTANCE * width
    start += LAYER_DISTANCE * width * arrow.layer
    return place + start * out + (reach * along + sides) * way, arrow.size * width


def arrow_geom(model: mujoco.MjModel, body: int) -> int:
    """Return the geom of a body that carries its arrows: the first in the accent's material, else
    the first, or -1.
    """
    first = model.body_geomadr[body]
    for geom in range(first, first + model.body_geomnum[body]):
        material = model.geom_matid[geom]
        if material >= 0 and model.mat(material).name.endswith("accent"):
            return geom
    return int(first)
