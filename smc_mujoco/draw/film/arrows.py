"""Arrows in the scene: what the control, the disturbance, and friction and contact do to each moving body.

The arrow is the mean over the time of a frame; a bar behind the control's is its range, so that a control which
switches faster than the film still shows how far it swings. Arrows lie along a pendulum's arc, beyond the bob, and
along the rail, above the cart, and before it where it carries something. Driven joints alone have arrows.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.draw import panels, style
from smc_mujoco.draw.decimate import Envelope, windows
from smc_mujoco.metrics.channel_groups import Group, groups
from smc_mujoco.simulation import model as assembly
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

HINGE, SLIDE = 0.425, 0.08  # length of the longest: of the pendulum's, of the rail's
RAIL = 0.035  # m, thickness of the rail's
OWN, THIN = 0.25, 0.012  # length and thickness of those along an own model's slides, of its extent
CHAIN = 1.6  # times as long for the pendulums of a network: they swing past each other, and are seen from the side
LEAST = 0.05  # of the longest: shorter ones are not drawn
SLENDER = 0.2  # thickest shaft of a short one, of its length
LEVER = 1e-6  # m: a body centred on its hinge has no arc to lay an arrow along
DRAWN = 0.5  # of the length that it is given, MuJoCo draws an arrow (not a capsule): measured, 3.17.0
BAR = 0.1  # of the longest: the least range that gets a bar


class Arrow(NamedTuple):
    """An arrow at a joint, from `low` to `high` of the longest (-1 .. 1)."""

    low: float
    high: float
    rgba: tuple[float, ...]  # red, green, blue, opacity, 0 .. 1
    layer: int = 0  # further from the body
    size: float = 1.0
    head: bool = True


class Grip(NamedTuple):
    """Where and how large arrows are drawn at a joint.

    Attributes:
      joint: of the film's scene.
      unit: at a slide the length of the longest, m; at a hinge how much longer than HINGE of the pendulum it is.
      thick: their thickness at a slide, m.
      front: the direction to the camera, (3,), where they lie before what slides: it carries what would hide them.
    """

    joint: int
    unit: float
    thick: float
    front: np.ndarray | None


def grips(
    scenario: Scenario, joints: Sequence[int], slides: Sequence[bool], rail: float, front: np.ndarray
) -> list[Grip]:
    """A Grip for each joint of a machine on a `rail`, m, inf without one; under a camera in front of it."""
    plant = scenario.plant
    extent = float(assembly.model([scenario]).stat.extent) if plant.direct else 0.0
    length, thick = (OWN * extent, THIN * extent) if plant.direct else (SLIDE * rail, RAIL)
    turning = CHAIN if plant.n > 1 and not plant.direct else 1.0
    before = front if plant.direct or plant.free else None
    return [Grip(j, length if slide else turning, thick, before) for j, slide in zip(joints, slides, strict=True)]


class Acts(NamedTuple):
    """What acts on one machine, frame by frame: as it is commanded, as the world does, and as what it touches does."""

    control: Envelope
    disturbance: Envelope
    reaction: Envelope


def acts(trace: Trace, times: np.ndarray, gap: float) -> Acts:
    """Ranges and means over the `gap` seconds before each time."""
    edges = np.concatenate([[times[0] - gap], times])
    return Acts(*(windows(trace.t, y, edges) for y in (trace.applied, trace.d, trace.reaction)))


class Longest(NamedTuple):
    """What the longest arrows stand for, N or N m: the largest control and disturbance of the runs that lasted.

    A blow is far larger than what drives the machine: the reaction's arrow is as long for all that exceeds the control.
    """

    control: float
    disturbance: float
    reaction: float = 0.0
    blows: bool = False  # whether a reaction is larger than its longest arrow


def longest(traces: Sequence[Trace]) -> dict[Group, Longest]:
    """The scale of the arrows of these traces, for each group of driven channels."""
    return {group: _longest(parts) for group, parts in style.split(traces).items() if group.driven}


def _longest(traces: Sequence[Trace]) -> Longest:
    control, disturbance, reaction = (max(map(abs, panels.span(traces, y))) for y in ("applied", "d", "reaction"))
    shown = min(reaction, control) if control else reaction
    return Longest(control, disturbance, shown, reaction > 1.01 * shown)


def scales(trace: Trace, longest: Mapping[Group, Longest]) -> list[Longest]:
    """The scale of the arrows of each of a trace's driven channels."""
    driven = [group for group in groups(trace.scenario.plant) if group.driven]
    found = {i: each for group, each in zip(driven, longest.values(), strict=True) for i in group.channels}
    return [found[i] for i in sorted(found)]


def arrows(acts: Acts, frame: int, channel: int, scale: Longest, colour: str) -> list[Arrow]:
    """The arrows of one channel in one frame."""
    law, grey, violet = (
        tuple(c / 255 for c in style.rgb(name)) for name in (colour, style.DISTURBANCE, style.REACTION)
    )
    drawn = []
    if scale.control:
        low, mean, high = (float(part[frame, channel]) / scale.control for part in acts.control[1:])
        drawn.append(Arrow(0.0, mean, (*law, 1.0)))
        if high - low > BAR:
            drawn.append(Arrow(low, high, (*law, 0.4), head=False))
    if scale.disturbance:
        mean = float(acts.disturbance.mean[frame, channel]) / scale.disturbance
        drawn.append(Arrow(0.0, mean, (*grey, 1.0), layer=1, size=0.65))
    if scale.reaction:
        mean = float(acts.reaction.mean[frame, channel]) / scale.reaction
        drawn.append(Arrow(0.0, mean, (*violet, 1.0), layer=2 if scale.disturbance else 1, size=0.8))
    return [arrow for arrow in drawn if abs(arrow.high - arrow.low) > LEAST]


def draw(scene: mujoco.MjvScene, model: mujoco.MjModel, data: mujoco.MjData, grip: Grip, arrow: Arrow) -> None:
    """Add an arrow to a scene that holds the machines already."""
    if scene.ngeom >= scene.maxgeom:
        return
    body = handle(model, model.jnt_bodyid[grip.joint])
    if body < 0:
        return
    place, radius = data.geom_xpos[body], model.geom_rbound[body]
    if model.jnt_type[grip.joint] == mujoco.mjtJoint.mjJNT_HINGE:
        arm = place - data.xanchor[grip.joint]
        length = np.linalg.norm(arm)
        if length < LEVER:
            return
        reach, width, out = grip.unit * HINGE * length, 0.16 * radius + 0.012 * grip.unit, arm / length
        along, start = np.cross(data.xaxis[grip.joint], out), radius + 1.6 * width
    else:
        reach, width, along, out = grip.unit, grip.thick, data.xaxis[grip.joint], np.array([0.0, 0.0, 1.0])
        if grip.front is not None:
            out = aside(along, grip.front)
            place = place + (half(model, data, body, grip.front) + width) * grip.front
        start = half(model, data, body, out) + 2.2 * width
    foot = place + (start + 2.6 * width * arrow.layer) * out
    low, high = (arrow.size * reach * np.clip(end, -1.0, 1.0) for end in (arrow.low, arrow.high))
    width = min(arrow.size * width, 0.006 + SLENDER * abs(high - low))

    kind = mujoco.mjtGeom.mjGEOM_ARROW if arrow.head else mujoco.mjtGeom.mjGEOM_CAPSULE
    geom, zero, end = scene.geoms[scene.ngeom], np.zeros(3), low + (high - low) / (DRAWN if arrow.head else 1.0)
    mujoco.mjv_initGeom(geom, kind, zero, zero, np.zeros(9), np.array(arrow.rgba, np.float32))
    mujoco.mjv_connector(geom, kind, width if arrow.head else 0.5 * width, foot + low * along, foot + end * along)
    geom.specular = 0.0
    scene.ngeom += 1


def aside(along: np.ndarray, front: np.ndarray) -> np.ndarray:
    """The direction across a slide in the picture, (3,): up, where it can be."""
    across = np.cross(front, along)
    if np.linalg.norm(across) < 0.1:  # it slides to the camera
        return np.array([0.0, 0.0, 1.0])
    return across / np.linalg.norm(across) * (1.0 if across[2] >= 0.0 else -1.0)


def half(model: mujoco.MjModel, data: mujoco.MjData, geom: int, direction: np.ndarray) -> float:
    """How far a geom's box reaches from its middle in a direction, m."""
    turned = direction @ data.geom_xmat[geom].reshape(3, 3)
    return float(model.geom_aabb[geom, :3] @ turned + model.geom_aabb[geom, 3:] @ np.abs(turned))


def handle(model: mujoco.MjModel, body: int) -> int:
    """The geom of a moving body that carries its arrows: the first in the accent's material, the first, or -1."""
    geoms = range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body])
    named = (g for g in geoms if model.geom_matid[g] >= 0)
    first = geoms[0] if geoms else -1
    return next((g for g in named if model.mat(model.geom_matid[g]).name.endswith("accent")), first)
