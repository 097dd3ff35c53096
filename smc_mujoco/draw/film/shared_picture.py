"""Carts of several runs on rails side by side, in one picture.

A rail is wide and low. In a tile for each run it would be small, and the distances between the runs
could not be seen. The first run is at the back, the last in front. What stands behind a rail is
drawn behind the first only, and what stands before it before the last. Springs are left out: MuJoCo
draws the skins of one model alone.
"""

import dataclasses
import itertools
from collections.abc import Sequence

import mujoco
import numpy as np
from PIL import Image

from smc_mujoco.common.aliases import Array
from smc_mujoco.draw.film import camera, flat_arrows, world
from smc_mujoco.draw.film.puppet import Puppet
from smc_mujoco.draw.film.stage import OUTLINE, Stage

PITCH = 0.8  # of the carts' depth with their pointers, from rail to rail; chosen
THIN = 0.75  # of arrows elsewhere, those between rails; chosen


def places(puppets: Sequence[Puppet], turn: Array) -> Array | None:
    """Return where each machine is, (machines, 3) m from its own place, before a camera of this
    turn; None where each has a tile.
    """
    first = puppets[0]
    plant = first.scenario.plant
    carts = plant.on_stage and plant.n == 1 and bool(first.slides.all()) and not plant.pose
    if len(puppets) < 2 or not carts:
        return None
    near = nearness(turn)
    depth = np.ptp(boxes(first)[moved(first)] @ near)
    return np.arange(len(puppets))[:, None] * PITCH * depth * near


def in_line(puppet: Puppet) -> Puppet:
    """Return a machine whose arrows lie before its cart: over it is the cart behind."""
    mounts = [
        mount._replace(front=None, ahead=True, thick=THIN * mount.thick) for mount in puppet.mounts
    ]
    return dataclasses.replace(puppet, mounts=mounts)


def nearness(turn: Array) -> Array:
    """Return the direction along the floor to the camera, (3,)."""
    near = turn[:, 2] * (1.0, 1.0, 0.0)
    return near / np.linalg.norm(near)


def boxes(puppet: Puppet) -> Array:
    """Return the corners of the boxes of a machine's geoms at the start, (geoms, 8, 3) m."""
    data = puppet.data[0]
    data.qpos[:] = puppet.start
    world.forward(puppet.model, data)
    return world.boxes(puppet.model, data)


def moved(puppet: Puppet) -> Array:
    """Return which geoms of a machine move, (geoms,)."""
    return puppet.model.body_weldid[puppet.model.geom_bodyid] > 0


def layout(
    count: int, room: camera.Room, sizes: camera.Sizes, points: Array, turn: Array, words: float
) -> tuple[Array, Array, camera.View]:
    """Return as `camera.layout` the tiles, which are the parts of one picture, and the labels below
    it.
    """

    def of_all(allowed: float) -> tuple[Array, float]:
        labels, read = sizes(allowed / count)
        return labels * (count, 1.0), read

    tiles, labels, view = camera.layout(
        1, room, of_all, points, turn, may_be_beside=False, words=words
    )
    return across(tiles[0], count), across(labels[0], count), view


def across(box: Array, count: int) -> Array:
    """Return so many parts of a box, side by side, (count, 4) px."""
    left_edge, top, right, bottom = box
    ends = np.linspace(left_edge, right, count + 1).round().astype(int)
    return np.array([(a, top, b, bottom) for a, b in itertools.pairwise(ends)])


def around(
    model: mujoco.MjModel, data: mujoco.MjData, links: Array, turn: Array
) -> tuple[Array, Array, Array]:
    """Return which geoms are before and behind what moves, its `links`, and which are floors,
    (geoms,) each.
    """
    depths = world.boxes(model, data) @ nearness(turn)
    carts = depths[links]
    planes = model.geom_type == world.PLANE
    before = (depths.min(axis=1) > carts.max()) & ~planes
    behind = (depths.max(axis=1) < carts.min()) & ~planes
    return before, behind, planes


def hide_between(stages: Sequence[Stage]) -> None:
    """Hide what of each machine would be between two rails, and the floors of all but the first."""
    first = stages[0]
    before, behind, planes = around(first.model, first.data, first.links, first.turn)
    for stage in stages:
        hidden = np.zeros(len(planes), bool)
        if stage is not first:
            hidden |= behind | planes
        if stage is not stages[-1]:
            hidden |= before
        stage.hide(np.flatnonzero(hidden))


def shots(stages: Sequence[Stage], frame: int, time: float) -> list[Array]:
    """Return the parts of the picture at a frame, whose time is given, s, as `layout` has them."""
    drawn = []
    for stage in stages:
        drawn.append(stage.pose(frame, time))
        stage.forward()
    first, *stages_beside = stages

    def add(shown) -> None:
        for stage_beside in stages_beside:
            stage_beside.add_beside(shown)

    def add_outlines(shown) -> None:
        for stage in stages:
            stage.add_outline(shown)

    picture = first.canvas.draw(add)
    picture = first.canvas.outlined(picture, add_outlines, OUTLINE * first.scale)
    image = Image.fromarray(picture)
    parts = across(np.array([0, 0, *image.size]), len(stages))
    taken = [
        box + part[:2] for stage, part in zip(stages, parts, strict=True) for box in stage.words
    ]
    stamped = [stage.stamped(image, own, taken) for stage, own in zip(stages, drawn, strict=True)]
    for own in stamped:
        taken += flat_arrows.boxes(own, first.scale)
    for own in stamped:
        flat_arrows.write_numbers(image, own, first.scale, taken, image.width / len(stages))
    picture = np.asarray(image)
    return [picture[:, left_edge:right] for left_edge, _, right, _ in parts.tolist()]
