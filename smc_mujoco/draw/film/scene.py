"""The model of a film: one machine a trace, side by side, without their surroundings, and a camera
that suits them.

Machines are the scenarios' mechanisms with all that they touch. The camera looks in the direction
of the plant's own camera `look`, or of the chosen one. Rails and columns are cut to what moves: a
film shows the motion. A user's model keeps its cameras; its lights, sky and floor are the film's.
"""

import dataclasses
import itertools
from collections.abc import Sequence

import mujoco
import numpy as np

from smc_mujoco.common import mjcb
from smc_mujoco.common.errors import find
from smc_mujoco.draw.film import camera
from smc_mujoco.draw.film.camera import Camera
from smc_mujoco.mechanisms.hardware.part import joint_ids
from smc_mujoco.mechanisms.plant import model_path
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.scenario import Scenario

MAX_CHANNELS = 6  # of a network: more would be hidden by the next machine
ROW_GAP = 0.15  # between machines in a row, of their width or height; chosen
ARM_GAP = 0.04  # the same between arms, which have no arrows beside them
MIN_DISTANCE = 0.05  # m between machines, chosen
HIDDEN_GROUP = 5  # a group of geoms that MuJoCo does not draw by default
TENDON_GROUPS = 3  # groups of tendons that MuJoCo draws by default
QUALITY = {
    "offsamples": 4,
    "shadowsize": 2048,
    "numslices": 36,
    "numstacks": 10,
    "numquads": 1,
}  # looks and speed
LOOK = "look"
SUN = "sun"  # the light whose shadows lie on the floor, see canvas.py
FLOOR_CELLS = 7  # of the floor's grid, in the width of what is seen; chosen
HAZE = (0.66, 0.725, 0.80)  # red, green, blue, chosen
HAZE_AT_TOP = 0.9  # share of the full haze at the top of the picture, chosen
HAZE_HORIZON = (
    3.0  # largest distance at which the haze is that thick, in distances of the farthest machine
)
MIN_HAZE_DISTANCE = (
    1.05  # times the distance of the farthest point: a nearer floor gets no haze; chosen
)
LOW_ELEVATION = (
    -12.0
)  # degrees: a view from a little above a user's model, so that the floor is seen; chosen
FRONT, ABOVE = (
    (90.0, LOW_ELEVATION),
    (90.0, -70.0),
)  # azimuth, elevation: for slides, for vertical hinges; degrees
CORNER = (125.0, -18.0)  # for hinges about several axes; chosen
PARALLEL_COSINE = 0.95  # of two axes that count as parallel; chosen
OTHER_VIEWS = (
    CORNER,
    FRONT,
    ABOVE,
    (0.0, LOW_ELEVATION),
    (-55.0, -30.0),
)  # views to try where one shows nothing
EMISSION = 0.13  # of the floor, so that it is nearly as white as the page below
# of the size of what moves, on both sides of it, to which rails and columns are cut; chosen
CUT_MARGIN = 0.08
SLENDER = 3.0  # a rail or column is longer than this many thicknesses; chosen
RAIL_END = 0.06  # of a rail's length: what stands within it of an end is moved with the end; chosen
ROUND_GEOMS = [int(mujoco.mjtGeom.mjGEOM_CYLINDER), int(mujoco.mjtGeom.mjGEOM_CAPSULE)]
BOB, BOB_GROWTH = "bob", 1.3  # a pendulum's mass is the larger in films
DIAL, DIAL_OPACITY = ("face", "bezel"), 0.4  # a dial is the paler
CUT_FIELDS = ("geom_pos", "geom_size", "geom_aabb", "geom_group", "geom_sameframe")
FIXED = mujoco.mjtCamLight.mjCAMLIGHT_FIXED.value
DIRECTIONAL = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
PLANE = mujoco.mjtGeom.mjGEOM_PLANE
CAPSULE = mujoco.mjtGeom.mjGEOM_CAPSULE


def compose(
    scenarios: Sequence[Scenario], places: np.ndarray, size: tuple[int, int]
) -> mujoco.MjModel:
    """Return one model with machine k at place k, (3,) m, its names prefixed m<k>/, and a camera
    `film`.

    Pictures are of `size` px.
    """
    spec = mujoco.MjSpec.from_file(str(model_path("common/theme.xml")))
    for name, value in QUALITY.items():
        setattr(spec.visual.quality, name, value)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = size
    for k, (scenario, place) in enumerate(zip(scenarios, places, strict=True)):
        machine = models.spec(scenario)
        if not scenario.plant.on_stage:
            machine = users_machine(machine, spec)
            spec.attach(machine, frame=spec.worldbody.add_frame(pos=place), prefix=f"m{k}/")
            continue
        strip(
            machine,
            *machine.lights,
            machine.geom("floor"),
            machine.material("floor"),
            *machine.textures,
        )
        if k == 0:
            spec.option = machine.option
            spec.compiler = machine.compiler
        spec.worldbody.add_frame(pos=place).attach_body(machine.body("machine"), f"m{k}/", "")
    spec.material("floor").emission = EMISSION
    sun = next(
        (light for light in spec.lights if light.castshadow and light.type == DIRECTIONAL), None
    )
    if sun:
        sun.name = SUN
        sun.castshadow = False
    spec.worldbody.add_camera(name="film", fovy=camera.FOVY)
    spec.stat.meansize = 0.1
    return mjcb.compiled(spec)


def strip(machine: mujoco.MjSpec, *surroundings) -> None:
    """Delete what a picture does not need, as it is posed and not simulated, and the machine's
    surroundings.
    """
    acting = [*machine.pairs, *machine.sensors, *machine.actuators, *machine.keys]
    for item in [*acting, *surroundings]:
        machine.delete(item)


def users_machine(machine: mujoco.MjSpec, film: mujoco.MjSpec) -> mujoco.MjSpec:
    """Return a user's mechanism without its surroundings, with the film's settings."""
    machine.option = film.option  # MuJoCo warns of settings that differ
    for name in (name for name in dir(machine) if name.startswith("nuser_")):
        setattr(machine, name, getattr(film, name))
    for name in ("global_", "quality", "headlight", "map", "scale", "rgba"):
        settings = getattr(film.visual, name)
        for field in (field for field in dir(settings) if not field.startswith("_")):
            setattr(getattr(machine.visual, name), field, getattr(settings, field))
    planes = [geom for geom in machine.geoms if geom.type == PLANE]
    skies = []
    for texture in machine.textures:
        if texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
            skies.append(texture)
    strip(machine, *machine.equalities, *machine.texts, *planes, *skies, *machine.lights)
    return machine


def set_floor(
    model: mujoco.MjModel,
    turn: np.ndarray,
    place: np.ndarray,
    size: tuple[int, int],
    points: np.ndarray,
) -> None:
    """Suit the floor to machines whose points are (m, 3) m: its grid, and the haze into which it
    fades behind them.
    """
    model.stat.center[:] = (points.min(axis=0) + points.max(axis=0)) / 2
    model.stat.extent = np.ptp(points, axis=0).max()
    # m
    sizes = []
    for power in range(-4, 5):
        for step in (1.0, 2.0, 5.0):
            sizes.append(step * 10.0**power)
    cell = min(sizes, key=lambda size: abs(np.log(FLOOR_CELLS * size / model.stat.extent)))
    model.mat_texrepeat[model.material("floor").id] = 1.0 / cell
    start = float(((points - place) @ -turn[:, 2]).max())
    ray = turn[:, 1] * camera.pixel(size) * size[1] / 2 - turn[:, 2]  # at the top of the picture
    # m along the view; inf: it sees the horizon
    if ray[2] < 0.0:
        floor = float(-place[2] / ray[2])
    else:
        floor = np.inf
    stop = min(floor, HAZE_HORIZON * start)
    if (
        stop < MIN_HAZE_DISTANCE * start
    ):  # a view from above: the floor is no farther than the machine
        stop = HAZE_HORIZON * start
    model.vis.map.fogstart = start / model.stat.extent
    model.vis.map.fogend = (start + (stop - start) / HAZE_AT_TOP) / model.stat.extent
    model.vis.rgba.fog[:] = (*HAZE, 1.0)


def turn(scenario: Scenario, chosen: Camera | None = None) -> np.ndarray:
    """Return the frame of the camera, (3, 3), as camera.py has it: the chosen one, else the plant's
    own.
    """
    if isinstance(chosen, str):
        return camera_of(scenario, chosen)
    if chosen is not None:
        return camera.turn(*chosen)
    if not scenario.plant.on_stage:
        return camera.turn(*view(models.compile_model(scenario)))
    return camera_of(scenario, LOOK)


def camera_of(scenario: Scenario, name: str) -> np.ndarray:
    """Return the frame of a camera of the scenario's model, (3, 3), at the start of its run."""
    model = models.compile_model(scenario)
    names = {model.camera(i).name: i for i in range(model.ncam) if model.camera(i).name}
    which = find(f"camera of {scenario.plant.name}", name, names)
    data = mujoco.MjData(model)
    data.qpos[:] = models.initial_state(model, scenario)[0]
    forward(model, data)
    return data.cam_xmat[which].reshape(3, 3).copy()


def view(model: mujoco.MjModel) -> tuple[float, float]:
    """Return azimuth and elevation, degrees, of a user's first fixed camera, or of one that sees
    its joints turn.

    The view looks down at least a little: along the floor, or from below, there is nothing to see.
    """
    for i in range(model.ncam):
        if model.cam_bodyid[i] == 0 and model.cam_mode[i] == FIXED:
            right, _, back = model.cam_mat0[i].reshape(3, 3).T
            azimuth, elevation = np.degrees(
                [np.arctan2(right[0], -right[1]), np.arcsin(np.clip(-back[2], -1.0, 1.0))]
            )
            return float(azimuth), min(float(elevation), LOW_ELEVATION)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    axes = data.xaxis[
        [i for i in joint_ids(model) if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_HINGE]
    ]
    if not len(axes):
        return FRONT
    if (np.abs(axes @ axes[0]) < PARALLEL_COSINE).any():
        return CORNER
    if abs(axes[0, 2]) > PARALLEL_COSINE:
        return ABOVE
    return float(
        np.degrees(np.arctan2(abs(axes[0, 1]), axes[0, 0] * np.sign(axes[0, 1] or 1.0)))
    ), LOW_ELEVATION


def in_a_row(scenario: Scenario, turn: np.ndarray) -> bool:
    """Return whether machines stand in a row across the picture, and not behind each other.

    They do if the plant's lane lies across it, if they carry something that would hide the machine
    behind, or if the model is the user's.
    """
    if not scenario.plant.on_stage or scenario.plant.free:
        return True
    step = np.array(scenario.plant.lane)
    return bool(abs(step @ turn[:, 0]) > 0.5 * np.linalg.norm(step))


def lane(
    scenarios: Sequence[Scenario], reaches: Sequence[np.ndarray], turn: np.ndarray
) -> np.ndarray:
    """Return the step from one machine to the next, (3,) m.

    Machines in a row stand as close as they can without hiding each other. Others stand the plant's
    lane apart, or further if they are realistic and would intersect.
    """
    step = np.array(scenarios[0].plant.lane)
    if in_a_row(scenarios[0], turn):
        right = np.array([*turn[:2, 0], 0.0])
        if right.any():
            right = right / np.linalg.norm(right)
        else:
            right = np.array([1.0, 0.0, 0.0])
        sides = [points @ right for points in reaches]
        wide = max(
            (one.max() - other.min() for one, other in itertools.pairwise(sides)), default=0.0
        )
        tall = max(float(np.ptp(points[:, 2])) for points in reaches)
        gap = ARM_GAP if scenarios[0].plant.tip else ROW_GAP
        return (wide + gap * max(wide, tall)) * right
    if not any(scenario.realistic for scenario in scenarios):
        return step
    way = step / np.linalg.norm(step)
    sides = [fixed_boxes(models.compile_model(scenario)) @ way for scenario in scenarios]
    pairs = itertools.combinations(range(len(sides)), 2)
    apart = max(
        ((sides[j].max() - sides[k].min() + MIN_DISTANCE) / (k - j) for j, k in pairs), default=0.0
    )
    return max(float(np.linalg.norm(step)), apart) * way


def forward(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Compute where everything is at data.qpos."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    if (model.tendon_group < TENDON_GROUPS).any():
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)


def boxes(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Return the corners of each geom's box, (geoms, 8, 3) m."""
    signs = np.array(list(itertools.product((-1, 1), repeat=3)))
    half = model.geom_aabb[:, 3:].copy()
    rods = (
        model.geom_type == CAPSULE
    )  # their boxes are those of the compiled sizes, which a run may change
    half[rods, 2] = model.geom_size[rods, 0] + model.geom_size[rods, 1]
    local = model.geom_aabb[:, None, :3] + signs * half[:, None]
    return (
        np.einsum("gij,gcj->gci", data.geom_xmat.reshape(-1, 3, 3), local) + data.geom_xpos[:, None]
    )


def fixed_boxes(model: mujoco.MjModel) -> np.ndarray:
    """Return the corners of each geom that does not move, planes left out, (geoms, 8, 3) m."""
    data = mujoco.MjData(model)
    forward(model, data)
    return boxes(model, data)[
        (model.body_weldid[model.geom_bodyid] == 0) & (model.geom_type != PLANE)
    ]


def are_arms(scenarios: Sequence[Scenario]) -> bool:
    """Return whether all machines have a tip, which a film then shows."""
    return all(bool(scenario.plant.tip) for scenario in scenarios)


def first_channels(scenario: Scenario) -> Scenario:
    """Return the scenario with the channels that a film shows."""
    plant = scenario.plant
    if plant.n <= MAX_CHANNELS or plant.direct:
        return scenario
    plant = dataclasses.replace(plant, n=MAX_CHANNELS, x0=plant.x0[:MAX_CHANNELS])
    x0, v0 = (values[:MAX_CHANNELS] for values in (scenario.resolved.x0, scenario.resolved.v0))
    return dataclasses.replace(scenario, plant=plant, x0=x0, v0=v0)


def restyle(model: mujoco.MjModel) -> None:
    """Enlarge the bobs of pendulums, to which the eye should go, and make dials translucent."""
    names = [model.geom(i).name.rpartition("/")[2] for i in range(model.ngeom)]
    bobs = np.flatnonzero(np.isin(names, BOB))
    dial = np.flatnonzero(np.isin(names, DIAL))
    model.geom_rgba[dial] = model.mat_rgba[model.geom_matid[dial]] * (1.0, 1.0, 1.0, DIAL_OPACITY)
    model.geom_matid[dial] = -1
    for field in (model.geom_size, model.geom_aabb, model.geom_rbound):
        field[bobs] *= BOB_GROWTH


def cut(
    machines: Sequence[mujoco.MjModel], points: np.ndarray, slides: np.ndarray, own: bool
) -> float:
    """Shorten columns, and rails along `slides`, (k, 3), to what moves, whose points are (m, 3) m,
    in all models.

    The foot of a column and the posts at the ends of a rail come closer, and marks beyond are
    hidden. Columns are cut of the library's `own` machines. Returns how far the foot came up, m.
    """
    model = machines[0]
    data = mujoco.MjData(machines[0])
    forward(model, data)
    fixed = np.flatnonzero((model.body_weldid[model.geom_bodyid] == 0) & (model.geom_type != PLANE))
    corners = boxes(model, data)[fixed]
    raised = 0.0
    margin = CUT_MARGIN * np.ptp(points, axis=0).max()
    low = points.min(axis=0) - margin
    high = points.max(axis=0) + margin
    for axis in range(3) if len(fixed) else ():
        turned = np.abs(data.geom_xmat[fixed].reshape(-1, 3, 3)[:, axis])
        least = corners[..., axis].min(axis=1)
        most = corners[..., axis].max(axis=1)
        sides = np.ptp(corners, axis=1)
        long = (sides[:, axis] > SLENDER * np.delete(sides, axis, axis=1).max(axis=1)) & (
            turned.max(axis=1) > 0.999
        )
        first = low[axis]
        last = high[axis]
        if axis == 2:
            first, last = (
                min(least[~long & (most > first)].min(initial=first) - margin, first),
                np.inf,
            )
        if not long.any() or not (own if axis == 2 else (np.abs(slides[:, axis]) > 0.9).any()):
            continue
        start = least[long].min()
        stop = most[long].max()
        first, last, near = max(first, start), min(last, stop), RAIL_END * (stop - start)
        home = model.geom_bodyid[fixed] == model.geom_bodyid[fixed[0]]
        for k, geom in enumerate(fixed.tolist()):
            way = np.zeros(3)
            middle = 0.5 * (least[k] + most[k])
            if long[k]:
                a = max(least[k], first)
                b = min(most[k], last)
                side = int(turned[k].argmax())
                way[axis], longer = 0.5 * (a + b) - middle, 0.5 * (b - a - sides[k, axis])
                model.geom_size[geom, 1 if int(model.geom_type[geom]) in ROUND_GEOMS else side] += (
                    longer
                )
                model.geom_aabb[geom, 3 + side] += longer
            elif home[k] and middle < start + near:
                way[axis] = first - start
            elif home[k] and middle > stop - near:
                way[axis] = last - stop
            elif axis < 2 and not first <= middle <= last:
                model.geom_group[geom] = HIDDEN_GROUP
            if way.any():
                model.geom_sameframe[geom] = 0  # else MuJoCo takes it to be where its body is
            model.geom_pos[geom] += way @ data.xmat[model.geom_bodyid[geom]].reshape(3, 3)
        raised = first - start if axis == 2 else 0.0
    for other, name in ((other, name) for other in machines[1:] for name in CUT_FIELDS):
        getattr(other, name)[fixed] = getattr(model, name)[fixed]
    return raised
