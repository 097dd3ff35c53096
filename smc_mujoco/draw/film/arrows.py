"""Arrows in the scene: control, disturbance, and friction with contact, at each driven joint; at
the others friction and contact alone. The constant weight of a slide counts as a disturbance.

An arrow is the mean over the time of a frame. A bar behind the control's is its range, which shows
how far a control swings that switches faster than the film. With a drive, arrow and bar show its
force, and a pale arrow the command. A free body has one arrow, of the disturbance's force. A
network has none, nor has a set-point.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.draw import quantities, shared_axes, style, timed_events, wording
from smc_mujoco.draw.decimate import Envelope, windows
from smc_mujoco.draw.film import world
from smc_mujoco.draw.panels import Panel, by_channel
from smc_mujoco.mechanisms.layout import channel_names, dof_ids
from smc_mujoco.mechanisms.plant import EFFORT, Plant
from smc_mujoco.metrics.conventions import ChannelGroup
from smc_mujoco.metrics.once_per_trace import once_per_trace
from smc_mujoco.metrics.touching import shapes
from smc_mujoco.simulation.trace import Trace

MIN_LENGTH = 0.05  # of the longest: shorter arrows are not drawn
MAX_BLOW = 3.0  # of the longest arrow: a stronger blow's is no longer
COMMAND_OPACITY = 0.45  # of a command's arrow beside that of the drive's force
CUT = 1.02  # of the longest arrow: a longer one is cut, and has its number
MIN_BAR = 0.1  # of the longest arrow: smaller ranges have no bar
WHITE = (1.0, 1.0, 1.0, 1.0)


class Arrow(NamedTuple):
    """An arrow at a joint, from `low` to `high` of the longest (-1 .. 1)."""

    low: float
    high: float
    rgba: tuple[float, ...]  # red, green, blue, opacity, 0 .. 1
    layer: int = 0  # distance from the body, in arrows
    size: float = 1.0  # of its shaft
    head: bool = True
    way: Array | None = None  # of a force on a body, (3,), in the axes of the world
    body: str = ""  # which a blow hits
    cut: bool = False  # it is longer than fits
    words: str = ""  # its value, where that is written beside it
    on_blow: bool = False  # whether the word on its hit or blow has its value
    hollow: bool = False  # whether only its edge is in its colour
    foot: bool = False  # whether there is a bar at its tail


class Drawn(NamedTuple):
    """The arrows of a machine at a time, s: each with its channel."""

    time: float
    arrows: Sequence[tuple[int, Arrow]]


def loads(trace: Trace, edges: Array) -> dict[str, Envelope]:
    """Return ranges and means of forces and torques on a machine between consecutive edges, s, by
    their names.
    """
    signals = {
        "control": trace.applied,
        "disturbance": trace.d + weights(trace),
        "reaction": trace.reaction,
        "force": trace.force,
    }
    envelopes = {}
    for name, y in signals.items():
        envelopes[name] = windows(trace.t, y, edges)
    return envelopes


@once_per_trace
def weights(trace: Trace) -> Array:
    """Return the constant force of gravity on each channel, (K + 1, n) N: on slides on a slope, or
    upright ones, that no hinge turns; 0 on others, whose weight depends on the pose.
    """
    weight_forces = np.zeros(trace.d.shape)
    for shape in shapes(trace.scenario, scenery=False):
        model = shape.model
        data = mujoco.MjData(model)
        world.forward(model, data)
        mujoco.mj_comPos(model, data)
        bias = np.zeros(model.nv)
        mujoco.mj_rne(model, data, 0, bias)
        for channel, dof in enumerate(dof_ids(model).tolist()):
            if slides_alone(model, dof):
                weight_forces[trace.t >= shape.time, channel] = -bias[dof]
    return weight_forces


def slides_alone(model: mujoco.MjModel, dof: int) -> bool:
    """Return whether a joint slides, and so do all that carry it, and its weight is not borne."""
    while dof >= 0:
        if model.jnt_type[model.dof_jntid[dof]] != mujoco.mjtJoint.mjJNT_SLIDE:
            return False
        dof = model.dof_parentid[dof]
    return model.ngravcomp == 0


class Scale(NamedTuple):
    """The largest values that arrows show, in the units of u and of a force, and those of the
    longest arrows: `longest` of forces, one in a picture, and `full` of the control.

    They are of the runs that lasted. Short peaks, such as that of an
    estimator at the start, do not set the longest arrow, nor do blows, which are far larger than
    what drives the machine.
    """

    control: float
    disturbance: float
    reaction: float = 0.0
    drive: bool = False  # whether a drive's force is shown, such as a motor's
    longest: float = 0.0
    full: float = 0.0
    units: tuple[str, str] = ("", "")  # of u, and of a force


def _of_one_unit(traces: Sequence[Trace]) -> dict[ChannelGroup, Sequence[Trace]]:
    """Return the traces of each group of channels, or of each channel where units of u differ."""
    traces_by_group = {}
    for group, parts in shared_axes.split(traces).items():
        if group.effort or traces[0].scenario.plant.pose:
            traces_by_group[group] = parts
            continue
        for panel in by_channel(Panel("u", group, parts)):
            traces_by_group[panel.group] = panel.traces
    return traces_by_group


def scales(traces: Sequence[Trace]) -> dict[ChannelGroup, Scale]:
    """Return the scale of the arrows for each group of channels."""
    traces = [dataclasses.replace(trace, d=trace.d + weights(trace)) for trace in traces]
    scale_by_group = {}
    lasting = [0.0]  # forces that drive and disturb
    brief = [0.0]
    for group, parts in _of_one_unit(traces).items():
        if traces[0].scenario.plant.pose:
            pushes = []
            for trace in traces:
                forces = np.linalg.norm(trace.d[:, :3], axis=1)
                pushes.append(forces.max())
            push = float(max(pushes)) if group.unit == "m" else 0.0
            scale_by_group[group] = Scale(0.0, push)
            lasting.append(push)
            continue
        reaction = max(map(abs, quantities.span(parts, "reaction")))
        if not group.driven and traces[0].scenario.plant.base >= 0:
            reaction = 0.0  # the floor's, which bears the machine
        brief.append(reaction)
        if not group.driven or group.is_set_point:
            scale_by_group[group] = Scale(0.0, 0.0, reaction)
            continue
        same = group.effort == EFFORT[group.unit]  # else the control is a voltage
        drive = same and any(map(_drives, traces))
        control = quantities.usual(parts, "applied")
        if drive:
            control = max(control, quantities.usual(parts, "force"))
        push = max(map(abs, quantities.span(parts, "d")))
        brief.append(push)
        if same:
            lasting += [control, quantities.usual(parts, "d")]
        scale_by_group[group] = Scale(control, push, reaction, drive, full=0.0 if same else control)
    longest = max(lasting) or max(brief)
    scaled = {}
    for group, scale in scale_by_group.items():
        units = shared_axes.units(group)
        full = scale.full or longest
        scaled[group] = scale._replace(
            longest=longest, full=full, units=(units["u"], units["force"])
        )
    return scaled


def _drives(trace: Trace) -> bool:
    """Return whether an actuator of a trace gives the force of a drive."""
    return any(part.drives for part in trace.scenario.actuator)


def flying(loads: Mapping[str, Envelope], frame: int, scale: Scale) -> list[tuple[int, Arrow]]:
    """Return the arrow of a free body in one frame with its channel: that of the disturbance."""
    push = loads["disturbance"].mean[frame, :3]
    size = float(np.linalg.norm(push))
    if size <= MIN_LENGTH * scale.longest:
        return []
    return [(0, along(push, scale, ""))]


def along(force: Array, scale: Scale, body: str) -> Arrow:
    """Return the arrow of a force in space, (3,) N, on a body; "" for a free body."""
    size = float(np.linalg.norm(force))
    length = size / scale.longest
    cut = length > MAX_BLOW
    words = f"{wording.short(size)} N" if cut else ""
    shade = rgba(style.DISTURBANCE)
    way = force / size
    return Arrow(0.0, length, shade, way=way, body=body, cut=cut, words=words, foot=True)


def rgba(colour: str, opacity: float = 1.0) -> tuple[float, ...]:
    """Return red, green, blue and opacity, 0 .. 1."""
    shade = np.array(style.rgb(colour)) / 255
    return (*shade.tolist(), opacity)


def scale_words(traces: Sequence[Trace], scales: Mapping[ChannelGroup, Scale]) -> list[str]:
    """Return what the longest arrow of a picture is, such as "→ u 6 N"; or how much of a network
    is shown, which has no arrows.

    Arms have none but those with their numbers beside them.
    """
    plant = traces[0].scenario.plant
    if plant.tip:
        return []
    words = []
    if is_network(plant):
        count = max(trace.scenario.plant.n for trace in traces)
        if count > world.MAX_CHANNELS:
            words.append(f"{world.MAX_CHANNELS} of {count} pendulums")
        return words
    drive = any(scale.drive for scale in scales.values())
    names = {"control": "drive" if drive else "u", "disturbance": "d", "reaction": "reaction"}
    for kind, name in names.items():
        sizes = []
        for scale in scales.values():
            if size := getattr(scale, kind):
                sizes.append(f"{wording.short(size)} {scale.units[kind != 'control']}")
        if sizes:
            words.append(f"→ {name} {', '.join(sizes)}")
            break
    return words


def scales_by_channel(scales: Mapping[ChannelGroup, Scale]) -> list[Scale]:
    """Return the scale of the arrows of each channel."""
    of_channel = {}
    for group, scale in scales.items():
        of_channel |= dict.fromkeys(group.channels, scale)
    return [of_channel[i] for i in sorted(of_channel)]


def arrows(
    loads: Mapping[str, Envelope], frame: int, channel: int, scale: Scale, colour: str
) -> list[Arrow]:
    """Return the arrows of one channel in one frame, the control's nearest to the body, with its
    range behind it.
    """
    layers = []
    if scale.drive:
        layers.append(("force", scale.longest, rgba(colour), 1.0))
        layers.append(("control", scale.longest, rgba(colour, COMMAND_OPACITY), 0.65))
    elif scale.control:
        layers.append(("control", scale.full, rgba(colour), 1.0))
    if scale.disturbance:
        layers.append(("disturbance", scale.longest, rgba(style.DISTURBANCE), 0.65))
    if scale.reaction:
        layers.append(("reaction", scale.longest, rgba(style.REACTION), 0.8))
    drawn = []
    for layer, (name, longest, shade, size) in enumerate(layers):
        low, mean, high = (float(part[frame, channel]) / longest for part in loads[name][1:])
        words = ""
        cut = abs(mean) > CUT
        if cut:
            unit = scale.units[name in ("disturbance", "reaction", "force")]
            words = f"{wording.short(abs(mean) * longest)} {unit}"
        kind = {"hollow": name == "reaction", "foot": name == "disturbance"}
        drawn.append(Arrow(0.0, mean, shade, layer, size, cut=cut, words=words, **kind))
        if layer == 0 and scale.control and high - low > MIN_BAR:
            drawn.append(Arrow(low, high, rgba(colour, 0.4), head=False))
    visible = []
    for arrow in drawn:
        if abs(arrow.high - arrow.low) > MIN_LENGTH:
            visible.append(arrow)
    return visible


def frames(
    trace: Trace, edges: Array, holds: Array, sizes: Sequence[Scale], colour: str
) -> list[Drawn]:
    """Return the arrows of a machine in each frame between `edges`, s, for what acts on its
    channels, of these scales. Blows are shown for `holds`, s, after their end.
    """
    acting = loads(trace, edges)
    plant = trace.scenario.plant
    drawn_frames = []
    for k, time in enumerate(edges[1:].tolist()):
        drawn = []
        if plant.pose and sizes:
            drawn = flying(acting, k, sizes[0])
        else:
            for i, size in enumerate(sizes):
                for arrow in arrows(acting, k, i, size, colour):
                    drawn.append((i, arrow))
            for body, peak in blows(trace, edges[k] - holds[k], time) if sizes else ():
                drawn.append((0, along(peak, sizes[0], body)))
        drawn_frames.append(Drawn(time, drawn))
    return drawn_frames


def held(drawn: Drawn, then: Drawn, shade: tuple[float, ...]) -> Drawn:
    """Return the arrows with those of a shade, whatever its opacity, as they were `then`, without
    their numbers: the words on a hit or a blow have them.
    """
    held_arrows = [
        channel_arrow for channel_arrow in drawn.arrows if channel_arrow[1].rgba[:3] != shade[:3]
    ]
    for channel, arrow in then.arrows:
        if arrow.rgba[:3] == shade[:3]:
            held_arrows.append((channel, arrow._replace(rgba=shade, words="", on_blow=True)))
    return drawn._replace(arrows=held_arrows)


def is_network(plant: Plant) -> bool:
    """Return whether a plant is made of many alike, such as pendulums, whose joints have the same
    name; a robot and a double pendulum are not.
    """
    if not plant.network or plant.direct:
        return False
    kinds = {name.rpartition("/")[2] for name in channel_names(plant)}
    return len(kinds) == 1


def blows(trace: Trace, start: float, stop: float) -> list[tuple[str, Array]]:
    """Return the bodies that blows hit between two times, s, with the peak of each, (3,) N."""
    forces = []
    for push in timed_events.pushes([trace]):
        if start <= push.time + push.width and stop >= push.time:
            force = np.array([push.x, push.y, push.z])
            forces.append((push.body, force))
    return forces
