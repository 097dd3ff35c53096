"""Arrows in the scene: control, disturbance, and friction with contact, at each driven joint; at
the others friction and contact alone. The constant weight of a slide counts as a disturbance.

An arrow is the mean over the time of a frame. A bar behind the control's is its range, which shows
how far a control swings that switches faster than the film. With a drive, arrow and bar show its
force, and a pale arrow the command. Arrows lie along a pendulum's arc, beyond the bob; or along the
rail, above the cart in the picture, or before it where carts share one. At a hinge of a user's
model, whose links may have any shape, they bend around its axis. A free body has one arrow, of the
disturbance's force; a body of a user's model that is pushed has one that ends before it. A network
has none, nor has a set-point. All are drawn over the picture, so that no link hides them.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from PIL import Image, ImageDraw

from smc_mujoco.common.aliases import Array
from smc_mujoco.draw import quantities, style
from smc_mujoco.draw.decimate import Envelope, windows
from smc_mujoco.draw.film import world
from smc_mujoco.draw.film.dilation import widened
from smc_mujoco.draw.panels import Panel, by_channel
from smc_mujoco.mechanisms.layout import channel_names, dof_ids
from smc_mujoco.mechanisms.plant import EFFORT, Plant, catalogue
from smc_mujoco.metrics.conventions import ChannelGroup
from smc_mujoco.metrics.once_per_trace import once_per_trace
from smc_mujoco.metrics.touching import shapes
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

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
RIM = 2.0  # px, of paper around an arrow that lies over a link, of a film of full size
MIN_PIXELS = 9.0  # px, of a film of full size: shorter arrows are not drawn
MIN_SHAFT = 8.0  # px, of a film of full size; of an arrow that is long enough
MAX_SWEEP = 2.0  # rad, of the longest bent arrow
BENT_WIDTH = 0.2  # of a bent arrow, in radii
BENT_DISTANCE = 0.35  # to the next one
BENT_RAISE = 0.5  # by which the middle of a bent arrow is higher than the direction to the camera
HEAD_WIDTH = 2.25  # half the width of a head, in shafts
HEAD_LENGTH = 2.2  # in half widths
FOOT_WIDTH, FOOT_LENGTH = 2.4, 0.6  # of the bar at the tail of a disturbance, in shafts
MAX_FOOT = 0.16  # longest such bar, of its arrow
EDGE_SHARE = 0.3  # widest edge of a hollow arrow, of its shaft
HEAD, LESS_HEAD = 0.7, 0.5  # longest head, of its arrow, and of one with a break mark or a bar
SUPERSAMPLING = 3  # pixels of a flat arrow for each of the picture, in both directions
CHAIN_FACTOR = 1.6  # arrows of several pendulums are longer: they are seen from the side
MIN_LENGTH = 0.05  # of the longest: shorter arrows are not drawn
MAX_THICKNESS = 0.25  # of the shaft of a short arrow, of its length
MIN_LEVER = 1e-6  # m: a body centred on its hinge has no arc for an arrow
FLIGHT_LENGTH = 3.0  # at a free body, in radii of its largest part
FLIGHT_THICKNESS = 0.14
FLIGHT_DISTANCE = 0.4  # of the longest arrow, from the middle of a free body to the arrow over it
BLOW_DISTANCE = 1.1  # of an arrow, from the foot of that of a blow to the middle of its body
MAX_BLOW = 3.0  # of the longest arrow: a stronger blow's is no longer
COMMAND_OPACITY = 0.45  # of a command's arrow beside that of the drive's force
CUT = 1.02  # of the longest arrow: a longer one is cut, and has its number
LETTERS = 36.0  # px of a film of full size, of the number at an arrow, as of all its letters
SMALL_LETTERS = 27.0  # px, of one that has no room else
GAP = 4.0  # px of a film of full size, around a number
NARROW = 500.0  # px of a film of full size: a tile that is less wide has one number at most
PLACES = 12  # in each direction, at which room for a number is looked for
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


class Stamped(NamedTuple):
    """An arrow on a picture: its line and its outline, (points, 2) px each."""

    arrow: Arrow
    line: Array
    edge: Array


class Drawn(NamedTuple):
    """The arrows of a machine at a time, s: each with its channel."""

    time: float
    arrows: Sequence[tuple[int, Arrow]]


class Mount(NamedTuple):
    """Place and size of the arrows at a joint of the film's scene."""

    joint: int
    unit: float  # longest arrow at a slide, m; at a hinge, a factor on HINGE_LENGTH
    thick: float  # at a slide, m
    front: Array | None  # to the camera, (3,), for a slide that carries something
    ahead: bool = False  # at a slide, in line with what slides, from the side to which it points
    radius: float = 0.0  # of bent arrows, m; 0 for straight ones


def mounts(
    scenario: Scenario,
    joints: Sequence[int],
    slides: Sequence[bool],
    rail: float,
    front: Array,
) -> list[Mount]:
    """Return the Mount of each joint of a machine on a `rail` of that length in m; `front` points
    to the camera.
    """
    plant = scenario.plant
    model = models.compile_model(scenario)
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
        usual = catalogue().get(plant.name)
        if plant.n == 1 and "l" in plant.parameters and usual:  # as large on any rod
            turning = usual.parameters["l"] / plant.parameters["l"]
        hinge = slide._replace(unit=turning)
    joint_mounts = []
    for joint, slides_here in zip(joints, slides, strict=True):
        joint_mounts.append((slide if slides_here else hinge)._replace(joint=joint))
    return joint_mounts


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
    for shape in shapes(trace.scenario):
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
    for group, parts in style.split(traces).items():
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
        units = style.units(group)
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
    words = f"{style.short(size)} N" if cut else ""
    shade = rgba(style.DISTURBANCE)
    way = force / size
    return Arrow(0.0, length, shade, way=way, body=body, cut=cut, words=words, foot=True)


def rgba(colour: str, opacity: float = 1.0) -> tuple[float, ...]:
    """Return red, green, blue and opacity, 0 .. 1."""
    shade = np.array(style.rgb(colour)) / 255
    return (*shade.tolist(), opacity)


def key(traces: Sequence[Trace], scales: Mapping[ChannelGroup, Scale]) -> list[str]:
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
                sizes.append(f"{style.short(size)} {scale.units[kind != 'control']}")
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
            words = f"{style.short(abs(mean) * longest)} {unit}"
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
    for push in style.pushes([trace]):
        if start <= push.time + push.width and stop >= push.time:
            force = np.array([push.x, push.y, push.z])
            forces.append((push.body, force))
    return forces


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


def outline(
    line: Array, width: float, head: bool = True, longest: float = HEAD, foot: bool = False
) -> Array:
    """Return the outline, (points, 2) px, of an arrow along a line (m, 2) px whose shaft is `width`
    px wide, with a head of at most a share of its length, and with a bar at its tail or without.
    """
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    way = np.append(0.0, steps.cumsum())
    width = min(width, MAX_THICKNESS * way[-1])
    long = min(HEAD_LENGTH * HEAD_WIDTH * width, longest * way[-1]) * head
    stations = np.linspace(0.0, way[-1] - long, len(line))
    rows = []
    for part in line.T:
        rows.append(np.interp(stations, way, part))
    shaft = np.column_stack(rows)
    along = np.gradient(shaft, axis=0)
    sizes = np.linalg.norm(along, axis=1)[:, None]
    across = 0.5 * width * along[:, ::-1] * (-1, 1) / sizes
    if foot:
        barred = stations <= min(FOOT_LENGTH * width, MAX_FOOT * way[-1])
        across[barred] *= FOOT_WIDTH
    wing = long / HEAD_LENGTH / (0.5 * width) * across[-1]
    tip = [shaft[-1] + wing, line[-1], shaft[-1] - wing]
    back = (shaft - across)[::-1]
    return np.concatenate([shaft + across, tip, back])


def stamp(image: Image.Image, line: Array, width: float, arrow: Arrow, rim: int = 0) -> Stamped:
    """Draw an arrow along a line, (m, 2) px, with a break mark if it is cut."""
    longest = LESS_HEAD if arrow.cut or arrow.foot else HEAD
    edge = outline(line, width, arrow.head, longest, arrow.foot)
    inner = min(2.0 * rim, EDGE_SHARE * width) if arrow.hollow else 0.0
    paint(image, edge, arrow.rgba, rim, inner)
    if arrow.cut:
        k = len(line) // 2  # of the shaft, whose other side is the outline's end
        sides = edge[[k, -1 - k]]
        across = 0.9 * (sides[0] - sides[1])
        way = np.array([across[1], -across[0]]) / 3.0
        corners = [across + 2 * way, across, -across - 2 * way, -across]
        paint(image, sides.mean(axis=0) + np.array(corners), WHITE)
    return Stamped(arrow, line, edge)


def bytes_of(rgba: Sequence[float]) -> tuple[int, ...]:
    """Return red, green and blue as whole numbers of 0 to 255."""
    return tuple(round(255 * part) for part in rgba[:3])


def boxes(stamped: Sequence[Stamped], scale: float) -> list[Array]:
    """Return boxes, (2, 2) px each, that cover arrows on a picture, with a gap for numbers."""
    around = np.array([[-GAP], [GAP]]) * scale
    return [point + around for stamp in stamped for point in stamp.edge]


def write_numbers(
    image: Image.Image, stamped: Sequence[Stamped], scale: float, taken: list[Array], wide: float
) -> None:
    """Write the numbers of a machine's arrows, each once in a colour, in a film `scale` times as
    large as a full one; in a narrow tile that of the longest alone. None is written over the boxes
    `taken`, (2, 2) px each, which get those of the numbers.
    """
    said = set()
    numbered = [stamp for stamp in stamped if stamp.arrow.words]
    if numbered and wide < NARROW * scale:
        numbered = [max(numbered, key=lambda stamp: abs(stamp.arrow.high))]
    for arrow, line, _ in numbered:
        key = arrow.words, arrow.rgba
        if key not in said:
            said.add(key)
            write(image, arrow, line, scale, taken)


def write(image: Image.Image, arrow: Arrow, line: Array, scale: float, taken: list[Array]) -> None:
    """Write the number of an arrow along a line, (m, 2) px, where there is room in the picture:
    beyond its free end, over the arrow or beside a steep one, or before its other end; else where
    room is nearest to it.
    """
    ends = (line[0], line[-1]) if arrow.body else (line[-1], line[0])
    for size in (LETTERS, SMALL_LETTERS):
        high = size * scale
        half = np.array([style.width(arrow.words, high, bold=True), high]) / 2 + GAP * scale
        most = np.array(image.size) - half
        places = number_places(ends, half, most, 6 * scale)
        if size == SMALL_LETTERS:
            places += nearest_places(ends, half, most)
        for place in places:
            inside = (place >= half).all() and (place <= most).all()
            box = np.array([place - half, place + half])
            if inside and is_apart(box, taken):
                taken.append(box)
                rim = {"stroke_width": round(2 * scale), "stroke_fill": style.PAPER}
                letters = style.font(high, True)
                centre = tuple(place.tolist())
                colour = bytes_of(arrow.rgba)
                ImageDraw.Draw(image).text(centre, arrow.words, colour, letters, anchor="mm", **rim)
                return


def covers(words: Sequence[Array], edge: Array) -> bool:
    """Return whether words, in boxes of (2, 2) px each, lie over an outline, (points, 2) px."""
    inside = [((box[0] < edge) & (edge < box[1])).all(axis=1).any() for box in words]
    return any(inside)


def is_apart(box: Array, taken: Sequence[Array]) -> bool:
    """Return whether a box, (2, 2) px, overlaps none of those that are taken."""
    if not taken:
        return True
    taken_boxes = np.array(taken)
    beyond = (box[1] <= taken_boxes[:, 0]) | (box[0] >= taken_boxes[:, 1])
    return bool(beyond.any(axis=1).all())


def nearest_places(ends: tuple[Array, Array], half: Array, most: Array) -> list[Array]:
    """Return places all over a picture, px, the nearest to the middle of an arrow first; `half` and
    `most` as of `number_places`.
    """
    across = np.linspace(half[0], most[0], PLACES)
    down = np.linspace(half[1], most[1], PLACES)
    places = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    away = np.linalg.norm(places - (ends[0] + ends[1]) / 2, axis=1)
    return list(places[away.argsort(kind="stable")])


def number_places(ends: tuple[Array, Array], half: Array, most: Array, gap: float) -> list[Array]:
    """Return the places of the middle of an arrow's number, px, the best first.

    `half` is half the size of the number, and `most` the farthest place that it may have.
    """
    free, foot = ends
    side = 1.0 if free[0] >= foot[0] else -1.0
    middle = (free + foot) / 2
    reach = np.array([side * (gap + half[0]), 0.0])
    apart = np.array([0.0, abs(free[1] - foot[1]) / 2 + 2 * half[1]])
    steep = abs(free[1] - foot[1]) > abs(free[0] - foot[0])
    beside = middle + reach if steep else middle - apart
    within = np.maximum(half, most)
    beside[0] = np.clip(beside[0], half[0], within[0])
    return [free + reach, beside, foot - reach]


def paint(
    image: Image.Image, edge: Array, rgba: Sequence[float], rim: int = 0, inner: float = 0.0
) -> None:
    """Fill an outline, (points, 2) px, with smooth edges, and a rim of paper around it, px; or only
    an `inner` edge of so many px, around paper.
    """
    corner = np.floor(edge.min(axis=0)).astype(int) - rim
    far = np.ceil(edge.max(axis=0)).astype(int) + 1 + rim
    place = tuple(corner.tolist())
    size = SUPERSAMPLING * (far - corner)
    mask = Image.new("L", tuple(size.tolist()))
    points = list(map(tuple, (SUPERSAMPLING * (edge - corner)).tolist()))
    opaque = round(255 * rgba[3])
    ImageDraw.Draw(mask).polygon(points, opaque)
    mask = mask.reduce(SUPERSAMPLING)
    if rim:
        wide = widened(np.asarray(mask), rim)
        image.paste(style.rgb(style.PAPER), place, Image.fromarray(wide))
    if inner:
        image.paste(style.rgb(style.PAPER), place, mask)
        mask = Image.new("L", tuple(size.tolist()))
        line = max(1, round(SUPERSAMPLING * inner))
        ImageDraw.Draw(mask).polygon(points, outline=opaque, width=line)
        mask = mask.reduce(SUPERSAMPLING)
    image.paste(bytes_of(rgba), place, mask)


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
