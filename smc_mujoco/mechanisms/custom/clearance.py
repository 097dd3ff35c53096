"""Whether what the channels of a user's model move stands inside something else of the model."""

import functools
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array, Floats
from smc_mujoco.mechanisms.layout import joint_ids, loaded, posed
from smc_mujoco.mechanisms.plant import Plant

DEPTH = 5e-3  # m, chosen: soft feet stand less deep
RAISES = 4  # at most: another part may be the deepest once the first is out; chosen
TOUCH = 1e-3  # m, chosen: what touches overlaps by less, so a deeper start begins with a blow


class Overlap(NamedTuple):
    """The deepest overlap at a pose; of depth 0 and without names where nothing touches."""

    depth: float = 0.0  # m
    geoms: tuple[str, ...] = ()  # two names, of a geom or of the body that carries it
    bodies: tuple[str, ...] = ()  # of these two; "" for a body without a name in the file

    def __str__(self) -> str:
        first, second = map(repr, self.geoms)
        return f"{first} {1e3 * self.depth:.0f} mm inside {second}"


@functools.lru_cache(maxsize=1024)
def overlap(plant: Plant, x: Floats) -> Overlap:
    """Return the deepest overlap with the channels at x, (n,) rad or m, and all else at the
    start.
    """
    model, data = _at(plant, x)
    return deepest(plant, model, data)


@functools.lru_cache(maxsize=64)
def touches_at(plant: Plant, x: Floats) -> bool:
    """Return whether anything touches anything with the channels at x, (n,) rad or m, and all else
    at the start.
    """
    return bool(_at(plant, x)[1].ncon)


def _at(plant: Plant, x: Floats) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Return a plant's model, and its state with the channels at x, (n,) rad or m."""
    model = loaded(plant)
    data = posed(model, x)
    mujoco.mj_fwdPosition(model, data)
    return model, data


def raised(plant: Plant, x: Floats) -> Floats:
    """Return a start of a free body, raised by as much as it overlaps the ground below."""
    allowed = max(DEPTH, overlap(plant, plant.x0).depth)
    for _ in range(RAISES):
        depth = overlap(plant, x).depth
        if depth <= allowed:
            break
        x = (*x[:2], x[2] + depth, *x[3:])
    return x


def deepest(
    plant: Plant, model: mujoco.MjModel, data: mujoco.MjData, ground: bool = True
) -> Overlap:
    """Return the deepest overlap of what the channels move and what they do not, among the
    contacts of `data`; without `ground`, of those with nothing that is fixed to the world.
    """
    moved = _moved(plant, model)
    counts = np.full(model.nbody, True) if ground else model.body_weldid != 0
    overlap = Overlap()
    for contact in data.contact:
        geoms = contact.geom.tolist()
        bodies = model.geom_bodyid[geoms]
        if min(geoms) < 0 or not counts[bodies].all():
            continue
        meets = moved[bodies[0]] != moved[bodies[1]]
        if meets and -contact.dist > overlap.depth:
            names = tuple(map(model.body, bodies.tolist()))
            named = []
            for i, body in zip(geoms, names, strict=True):
                named.append(model.geom(i).name or body.name or f"geom {i}")
            owners = tuple(body.name for body in names)
            overlap = Overlap(-contact.dist, tuple(named), owners)
    return overlap


def _moved(plant: Plant, model: mujoco.MjModel) -> Array:
    """Return which bodies the channels move, those that are only measured aside, (nbody,)."""
    joints = joint_ids(model)[: plant.n - plant.measured]
    moved = np.zeros(model.nbody, bool)
    moved[model.jnt_bodyid[joints]] = True
    for i in range(1, model.nbody):
        moved[i] |= moved[model.body_parentid[i]]
    return moved
