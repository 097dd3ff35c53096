"""The direction from which a film looks at a user's machine.

It looks across the planes in which the driven hinges turn, and across the lines of driven slides,
from a side on which other parts hide little of what moves, and other things little of the machine.
It depends on the model and on the pose in which runs begin by default, so all films of a machine
have it.
"""

import itertools

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.draw.film import camera, world

# Numbers of presentation here are chosen. Angles are degrees, as camera.turn has them.
FRONT = 90.0  # the azimuth that is taken where others show as much
AZIMUTHS = np.arange(0.0, 360.0, 15.0)
LOWEST = -12.0  # from a little above, so that the floor is seen
ELEVATIONS = (LOWEST, -30.0, -50.0, -70.0)
HIDDEN_WEIGHT = 0.5  # by which a view is worse that hides the whole machine but not what moves
ENOUGH = 0.5  # of the motion: a camera of the model that shows less is not taken
DRAWN = (np.arange(6) < world.DRAWN_GROUPS).astype(np.uint8)  # groups of geoms
INSIDE = 0.5  # of a geom's box, from its middle to the corners at which one looks
START = 10.0  # of the model's extent, from there to where a ray begins


def best_angles(
    model: mujoco.MjModel, data: mujoco.MjData, joints: Array, links: Array
) -> tuple[float, float]:
    """Return azimuth and elevation from which the motion of some joints is seen best, degrees.

    The first camera of the model that stands still is taken if it shows enough of the motion.

    Args:
      data: the machine where it begins.
      joints: of the channels.
      links: the geoms that these joints move.
    """
    own = models_camera(model)
    if own:
        motion = share_seen(data, joints, own)
        share = motion * visible(model, data, links, own)
        if share >= ENOUGH:
            return own
    roots = model.body_rootid[model.geom_bodyid]
    drawn = model.geom_group < world.DRAWN_GROUPS
    mechanism_geoms = np.flatnonzero(
        np.isin(roots, roots[links]) & drawn & (model.geom_type != world.PLANE)
    )
    rated = []
    for azimuth, elevation in itertools.product(AZIMUTHS.tolist(), ELEVATIONS):
        angles = azimuth, elevation
        motion = round(share_seen(data, joints, angles), 2)
        rated.append((-motion, abs(azimuth - FRONT), angles))
    best = FRONT, LOWEST
    most = -1.0
    for motion, _, angles in sorted(rated):
        if -motion <= most:  # no part that hides it can make it better
            break
        share = -motion * visible(model, data, links, angles)
        if share > most:  # else the rest of the machine cannot make it better
            hidden = 1.0 - visible(model, data, mechanism_geoms, angles)
            share *= 1.0 - HIDDEN_WEIGHT * hidden
        if share > most:
            most = share
            best = angles
    return best


def models_camera(model: mujoco.MjModel) -> tuple[float, float] | None:
    """Return azimuth and elevation of the first camera that stands still, degrees, from a little
    above at least; None without one.
    """
    still = model.cam_mode == mujoco.mjtCamLight.mjCAMLIGHT_FIXED.value
    fixed = (model.cam_bodyid == 0) & still
    if not fixed.any():
        return None
    right, _, back = model.cam_mat0[fixed][0].reshape(3, 3).T
    azimuth = np.degrees(np.arctan2(right[0], -right[1]))
    elevation = np.degrees(np.arcsin(np.clip(-back[2], -1.0, 1.0)))
    return float(azimuth), min(float(elevation), LOWEST)


def share_seen(data: mujoco.MjData, joints: Array, angles: tuple[float, float]) -> float:
    """Return how much of the motion of hinges and slides is across a view, 0 .. 1: their mean.

    A hinge that points at the camera counts 1, and so does a slide that moves across the view.
    """
    ahead = -camera.turn(*angles)[:, 2]
    parts = []
    for joint in joints.tolist():
        kind = data.model.jnt_type[joint]
        along = min(1.0, abs(float(data.xaxis[joint] @ ahead)))
        if kind == mujoco.mjtJoint.mjJNT_HINGE:
            parts.append(along)
        elif kind == mujoco.mjtJoint.mjJNT_SLIDE:
            parts.append((1.0 - along**2) ** 0.5)
    return float(np.mean(parts)) if parts else 1.0


def visible(
    model: mujoco.MjModel, data: mujoco.MjData, links: Array, angles: tuple[float, float]
) -> float:
    """Return the share of some geoms that nothing else hides in a view, 0 .. 1, by rays at points
    inside their boxes.
    """
    ahead = -camera.turn(*angles)[:, 2]
    starts = points_inside(model, data, links) - START * model.stat.extent * ahead
    seen = np.isin([first_hit(model, data, start, ahead) for start in starts], links)
    groups = model.geom_group.copy()  # a copy of the model would have its meshes, too
    model.geom_group[:] = world.HIDDEN_GROUP
    model.geom_group[links] = 0
    try:
        meets = np.array([first_hit(model, data, start, ahead) for start in starts]) >= 0
    finally:
        model.geom_group[:] = groups
    return float(seen[meets].mean()) if meets.any() else 1.0


def points_inside(model: mujoco.MjModel, data: mujoco.MjData, geoms: Array) -> Array:
    """Return points inside the boxes of some geoms, (points, 3) m."""
    clouds = []
    for geom in geoms.tolist():
        box = model.geom_aabb[geom]
        local = box[:3] + INSIDE * world.CORNERS * box[3:]
        turn = data.geom_xmat[geom].reshape(3, 3)
        clouds.append(data.geom_xpos[geom] + local @ turn.T)
    return np.concatenate(clouds) if clouds else np.zeros((0, 3))


def first_hit(model: mujoco.MjModel, data: mujoco.MjData, start: Array, way: Array) -> int:
    """Return the first geom in a direction that is drawn; -1 without one."""
    hit = np.zeros(1, np.int32)
    mujoco.mj_ray(model, data, start, way, DRAWN, 1, -1, hit)
    return int(hit[0])
