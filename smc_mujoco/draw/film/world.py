"""The model of a machine in a film, without its surroundings, and its cameras.

It is the scenario's mechanism with all that it touches. Rails and columns are cut to what moves: a
film shows the motion. A user's model keeps its cameras; its lights, sky and floor are the film's.
"""

import dataclasses
import itertools
from collections.abc import Sequence

import mujoco
import numpy as np

from smc_mujoco.common import mjcb
from smc_mujoco.common.aliases import Array
from smc_mujoco.common.errors import find
from smc_mujoco.draw.film import camera
from smc_mujoco.mechanisms.layout import OWN
from smc_mujoco.mechanisms.plant import model_path
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.scenario import Scenario

# Numbers of presentation here are chosen.
MAX_CHANNELS = 6  # of a network: more would be hidden by the next machine
DRAWN_GROUPS = 3  # groups of geoms and tendons that MuJoCo draws by default
HIDDEN_GROUP = 5  # a group of geoms that MuJoCo does not draw by default
QUALITY = {"offsamples": 4, "shadowsize": 2048, "numslices": 36, "numstacks": 10, "numquads": 1}
SIZES = "memory", "njmax", "nconmax", "nemax", "nstack", "nuserdata"  # of a model's arrays
AMBIENT = (0.30, 0.31, 0.33)  # light that models the form: less from everywhere,
KEY = (0.60, 0.58, 0.55)  # more from one side,
FILL = (0.10, 0.11, 0.14)  # and little from the other
SUN = "sun"  # the light whose shadows lie on the floor, see canvas.py
FLOOR_CELLS = 7  # of the floor's grid, in the width of what is seen
HAZE = (0.76, 0.81, 0.86, 1.0)  # red, green, blue, opacity
DIAL_OPACITY = 0.25  # of the dial behind a pendulum
PALE = (0.62, 0.64, 0.67, 1.0)  # of what stands behind a rod
HAZE_AT_TOP = 0.9  # share of the full haze at the top of the picture
HAZE_HORIZON = 3.0  # largest distance of that haze, in distances of the farthest machine
MIN_HAZE_DISTANCE = 1.05  # of the farthest point: a nearer floor, seen from above, gets no haze
CUT_MARGIN = 0.08  # of the size of what moves, beyond which rails and columns are cut
SLENDER = 3.0  # a rail or column is longer than this many thicknesses
RAIL_END = 0.06  # of a rail's length: what stands within it of an end is moved with the end
ROUND_GEOMS = [int(mujoco.mjtGeom.mjGEOM_CYLINDER), int(mujoco.mjtGeom.mjGEOM_CAPSULE)]
CUT_FIELDS = ("geom_pos", "geom_size", "geom_aabb", "geom_group", "geom_sameframe")
PLANE = mujoco.mjtGeom.mjGEOM_PLANE
CAPSULE = mujoco.mjtGeom.mjGEOM_CAPSULE
HINGE = mujoco.mjtJoint.mjJNT_HINGE
CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))  # of a box


def compose(
    scenario: Scenario, height: float, size: tuple[int, int], turn: Array
) -> mujoco.MjModel:
    """Return the model of a machine at a height over the floor, m, its names prefixed m/, with a
    camera `film`.

    Pictures are of `size` px. The lights of a user's machine go around it with the camera, whose
    turn is given: it is as bright from every side.
    """
    spec = mujoco.MjSpec.from_file(str(model_path("common/theme.xml")))
    for name, value in QUALITY.items():
        setattr(spec.visual.quality, name, value)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = size
    machine = models.spec(scenario)
    frame = spec.worldbody.add_frame(pos=(0.0, 0.0, height))
    if scenario.plant.on_stage:
        surroundings = [machine.geom("floor"), machine.material("floor"), *machine.textures]
        strip(machine, *machine.lights, *surroundings)
        spec.option = machine.option
        spec.compiler = machine.compiler
        for body in machine.worldbody.bodies:
            if body.name == "machine" or body.name.startswith(OWN):
                frame.attach_body(body, "m/", "")
    else:
        spec.attach(users_machine(machine, spec), frame=frame, prefix="m/")
        around = np.arctan2(turn[0, 0], -turn[1, 0]) - 0.5 * np.pi
        cosine, sine = np.cos(around), np.sin(around)
        for light in spec.lights:
            x, y, z = light.dir
            light.dir = (cosine * x - sine * y, sine * x + cosine * y, z)
    spec.material("floor").emission = 0.13  # nearly as white as the page below
    spec.visual.headlight.ambient = AMBIENT
    spec.light("key").diffuse = KEY
    spec.light("fill").diffuse = FILL
    for light in spec.lights:
        if light.castshadow and light.type == mujoco.mjtLightType.mjLIGHT_DIRECTIONAL:
            light.name = SUN
            light.castshadow = False
            break
    spec.worldbody.add_camera(name="film", fovy=camera.FOVY)
    spec.stat.meansize = 0.1
    return mjcb.compiled_spec(spec)


def strip(machine: mujoco.MjSpec, *surroundings) -> None:
    """Delete what a picture does not need, as it is posed and not simulated, and the machine's
    surroundings.
    """
    acting = [*machine.pairs, *machine.sensors, *machine.actuators, *machine.keys]
    for item in [*acting, *surroundings]:
        machine.delete(item)


def users_machine(machine: mujoco.MjSpec, film: mujoco.MjSpec) -> mujoco.MjSpec:
    """Return a user's mechanism without its surroundings, with the film's settings.

    MuJoCo warns of settings that differ.
    """
    machine.option = film.option
    for name in dir(machine):
        if name.startswith("nuser_") or name in SIZES:
            setattr(machine, name, getattr(film, name))
    for name in ("global_", "quality", "headlight", "map", "scale", "rgba"):
        settings = getattr(film.visual, name)
        for field in dir(settings):
            if not field.startswith("_"):
                setattr(getattr(machine.visual, name), field, getattr(settings, field))
    sky = mujoco.mjtTexture.mjTEXTURE_SKYBOX
    removed = [*machine.equalities, *machine.texts]
    for geom in machine.geoms:
        if geom.type == PLANE:
            removed.append(geom)
    for texture in machine.textures:
        if texture.type == sky:
            removed.append(texture)
    strip(machine, *removed, *machine.lights)
    return machine


def set_floor(model: mujoco.MjModel, view: camera.View, points: Array, moved: Array) -> None:
    """Suit the floor to machines whose points are (m, 3) m, moved with the camera: its grid, and
    the haze into which it fades behind them.
    """
    size, turn, place, _ = view
    points = points + moved
    place = place + moved
    lowest = points.min(axis=0)
    ends = lowest + points.max(axis=0)
    model.stat.center[:] = ends / 2
    sides = np.ptp(points, axis=0)
    model.stat.extent = extent = sides.max()
    model.mat_texrepeat[model.material("floor").id] = 1.0 / floor_cell(extent)
    depth = (points - place) @ -turn[:, 2]
    start = float(depth.max())
    across = turn[:, 1] * camera.pixel(size)
    half = across * size[1] / 2
    low = -half - turn[:, 2]
    if low[2] < 0.0:  # where the foot of the picture meets the floor, below what flies
        start = max(start, -place[2] / low[2])
    ray = half - turn[:, 2]  # at the top of the picture
    stop = HAZE_HORIZON * start
    if ray[2] < 0.0 and -place[2] / ray[2] >= MIN_HAZE_DISTANCE * start:  # where it meets the floor
        stop = min(stop, -place[2] / ray[2])
    model.vis.map.fogstart = start / extent
    model.vis.map.fogend = (start + (stop - start) / HAZE_AT_TOP) / extent
    model.vis.rgba.fog[:] = HAZE


def floor_cell(extent: float) -> float:
    """Return the width of a cell of the floor's grid below what is so wide, m."""
    decades = 10.0 ** np.arange(-4, 5)
    cells = np.outer(decades, (1.0, 2.0, 5.0)).ravel()  # m
    misfit = np.abs(np.log(FLOOR_CELLS * cells / extent))
    return float(cells[misfit.argmin()])


def named_turn(model: mujoco.MjModel, pose: Array, chosen: str, whose: str) -> Array:
    """Return the frame of a camera of a model in a pose, (nq,), (3, 3), as camera.py has it.
    `whose` model it is, is for messages.
    """
    names = {}
    for i in range(model.ncam):
        if model.camera(i).name:
            names[model.camera(i).name] = i
    which = find(f"camera of {whose}", chosen, names)
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    forward(model, data)
    return data.cam_xmat[which].reshape(3, 3).copy()


def forward(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Compute where everything is at data.qpos."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    if (model.tendon_group < DRAWN_GROUPS).any():
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)


def boxes(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Return the corners of each geom's box, (geoms, 8, 3) m."""
    half = model.geom_aabb[:, 3:].copy()
    rods = model.geom_type == CAPSULE  # their compiled boxes are not those of a run that changes it
    half[rods, 2] = model.geom_size[rods, 0] + model.geom_size[rods, 1]
    centres = model.geom_aabb[:, None, :3]
    local = centres + CORNERS * half[:, None]
    turns = data.geom_xmat.reshape(-1, 3, 3)
    turned = np.einsum("gij,gcj->gci", turns, local)
    return turned + data.geom_xpos[:, None]


def still(model: mujoco.MjModel) -> Array:
    """Return which geoms do not move, planes left out, (geoms,)."""
    fixed = model.body_weldid[model.geom_bodyid] == 0
    return fixed & (model.geom_type != PLANE)


def fixed_boxes(model: mujoco.MjModel) -> Array:
    """Return the corners of each geom that does not move, planes left out, (geoms, 8, 3) m."""
    data = mujoco.MjData(model)
    forward(model, data)
    return boxes(model, data)[still(model)]


def first_channels(scenario: Scenario) -> Scenario:
    """Return the scenario with the channels that a film shows."""
    plant = scenario.plant
    if plant.n <= MAX_CHANNELS or plant.direct:
        return scenario
    first_x0 = plant.x0[:MAX_CHANNELS]
    plant = dataclasses.replace(plant, n=MAX_CHANNELS, x0=first_x0)
    x0 = scenario.resolved.x0[:MAX_CHANNELS]
    v0 = scenario.resolved.v0[:MAX_CHANNELS]
    return dataclasses.replace(scenario, plant=plant, x0=x0, v0=v0)


def restyle(model: mujoco.MjModel) -> None:
    """Enlarge the bobs of pendulums, to which the eye should go; make dials translucent, and the
    box pale before which a rod hangs.
    """
    names = []
    for i in range(model.ngeom):
        name = model.geom(i).name
        names.append(name.rpartition("/")[2])
    dial = np.isin(names, ("face", "bezel"))
    painted = model.mat_rgba[model.geom_matid[dial]]
    model.geom_rgba[dial] = painted * (1.0, 1.0, 1.0, DIAL_OPACITY)
    model.geom_matid[dial] = -1
    box = np.isin(names, "cube")
    model.geom_rgba[box] = PALE
    model.geom_matid[box] = -1
    for field in (model.geom_size, model.geom_aabb, model.geom_rbound):
        field[np.isin(names, "bob")] *= 1.3


def cut(machines: Sequence[mujoco.MjModel], points: Array, bars: Array, own: bool) -> None:
    """Shorten columns, and rails and shafts along `bars`, (k, 3), to what moves, whose points are
    (m, 3) m, in all models.

    The foot of a column and the posts at the ends of a rail come closer, and marks beyond are
    hidden. Columns are cut of the library's `own` machines.
    """
    model = machines[0]
    data = mujoco.MjData(model)
    forward(model, data)
    fixed = np.flatnonzero(still(model))
    if not len(fixed):
        return
    corners = boxes(model, data)[fixed]
    margin = CUT_MARGIN * np.ptp(points, axis=0).max()
    lows = points.min(axis=0) - margin
    highs = points.max(axis=0) + margin
    sides = np.ptp(corners, axis=1)
    home = model.geom_bodyid[fixed] == model.geom_bodyid[fixed[0]]
    for axis in range(3):
        turned = np.abs(data.geom_xmat[fixed].reshape(-1, 3, 3)[:, axis])
        least = corners[..., axis].min(axis=1)
        most = corners[..., axis].max(axis=1)
        long = _slender(sides, axis) & (turned.max(axis=1) > 0.999)
        upright = axis == 2
        is_cut = own if upright else (np.abs(bars[:, axis]) > 0.9).any()
        if not long.any() or not is_cut:
            continue
        first = lows[axis]
        last = highs[axis]
        if upright:  # only from below
            beyond = least[~long & (most > first)].min(initial=np.inf)
            first = min(beyond - margin, first)
            last = np.inf
        start, stop = least[long].min(), most[long].max()
        first, last = max(first, start), min(last, stop)
        near = RAIL_END * (stop - start)
        for k, geom in enumerate(fixed.tolist()):
            way = np.zeros(3)
            middle = 0.5 * (least[k] + most[k])
            if long[k]:
                a, b = max(least[k], first), min(most[k], last)
                if a >= b:  # it is beyond
                    model.geom_group[geom] = HIDDEN_GROUP
                    continue
                side = int(turned[k].argmax())
                way[axis] = 0.5 * (a + b) - middle
                lengthen(model, geom, side, 0.5 * (b - a - sides[k, axis]))
            elif home[k] and middle < start + near:
                way[axis] = first - start
            elif home[k] and middle > stop - near:
                way[axis] = last - stop
            elif not upright and not first <= middle <= last:
                model.geom_group[geom] = HIDDEN_GROUP
            _move(model, data, geom, way)
    for machine, name in itertools.product(machines[1:], CUT_FIELDS):
        getattr(machine, name)[fixed] = getattr(model, name)[fixed]


def _move(model: mujoco.MjModel, data: mujoco.MjData, geom: int, way: Array) -> None:
    """Move a geom by `way`, (3,) m in the world."""
    if way.any():
        model.geom_sameframe[geom] = 0  # else MuJoCo takes it to be where its body is
    pose = data.xmat[model.geom_bodyid[geom]].reshape(3, 3)
    model.geom_pos[geom] += way @ pose


def _slender(sides: Array, axis: int) -> Array:
    """Return which boxes, (k, 3) m, are long and narrow along an axis, (k,)."""
    remaining = np.delete(sides, axis, axis=1)
    other_sides = remaining.max(axis=1)
    return sides[:, axis] > SLENDER * other_sides


def lengthen(model: mujoco.MjModel, geom: int, side: int, longer: float) -> None:
    """Make half the length of a geom along a side of its own so much longer, m."""
    place = 1 if int(model.geom_type[geom]) in ROUND_GEOMS else side
    model.geom_size[geom, place] += longer
    model.geom_aabb[geom, 3 + side] += longer
