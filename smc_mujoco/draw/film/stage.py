"""The stage of a film: poses and renders the machines of all traces under one camera that sees them
all.

The camera stands at the nearest place from which every machine stays inside the room that the page
leaves, wherever its trace takes it.
"""

import itertools
import warnings
from collections.abc import Sequence

import mujoco
import numpy as np
from PIL import Image, ImageDraw

from smc_mujoco.common.errors import ScenarioWarning, users_stacklevel
from smc_mujoco.draw import style
from smc_mujoco.draw.film import arrows, camera, scene
from smc_mujoco.draw.film.act import Act
from smc_mujoco.draw.film.canvas import Canvas
from smc_mujoco.draw.film.puppet import Puppet, moved_bodies
from smc_mujoco.mechanisms.hardware.part import joints
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.trace import Trace

ROW_SHARE = 0.95  # of the width, which the places of machines in a row take at least; chosen
DISTANCE_ROUNDING = 1e-9  # of a camera's distance
LAW_SHARE = (
    0.75  # of the law's colour in that of a user's model, where several laws are shown; chosen
)
DEFAULT_RGBA = np.array([0.5, 0.5, 0.5, 1.0], np.float32)  # MuJoCo's colour of geoms
COLOUR_TOLERANCE = 8  # of 255: colours that differ by less are one; chosen
MIN_PICTURE_SHARE = 2e-4  # of a picture that shows something, such as 120 px of 1280 x 460; chosen
GROUPS = 3  # groups of geoms that MuJoCo draws by default
GHOST_RGBA = np.array([0.12, 0.14, 0.16, 0.22], np.float32)  # ink, translucent
GHOST_SIZE = 0.97  # of its machine's, so that a machine at its reference hides it
SHAPE_FIELDS = ("geom_pos", "geom_size", "geom_group", "geom_sameframe")
OTHER = mujoco.mjtObj.mjOBJ_UNKNOWN


class Stage:
    """The compiled scene and its renderer: a context, which closes the renderer.

    The machines are at `where`, (machines, 3) m, in the picture at `boxes`, (machines, 4) px: left,
    top, right, bottom.
    """

    def __init__(
        self,
        traces: Sequence[Trace],
        colours: Sequence[str],
        size: tuple[int, int],
        room: camera.Room,
        chosen: camera.Camera | None = None,
        acts: Sequence[Act] = (),
        apart: float = 0.0,
        scale: float = 1.0,
    ):
        self.puppets = [Puppet(trace.scenario) for trace in traces]
        scenarios = [puppet.scenario for puppet in self.puppets]
        self.shown = [puppet.shown for puppet in self.puppets]
        self.is_users = not scenarios[0].plant.on_stage
        turn = scene.turn(scenarios[0], chosen)
        self.motions = [act.motion for act in acts] or [None] * len(traces)
        drawn = [act.framing for act in acts] or [()] * len(traces)
        cut = scene.in_a_row(scenarios[0], turn)
        for puppet in self.puppets:
            puppet.mounts = arrows.mounts(
                puppet.scenario, puppet.ids, puppet.slides, puppet.rail, turn[:, 2]
            )
        runs = zip(self.puppets, traces, self.motions, drawn, strict=True)
        reaches = [puppet.reach(trace, motion, its, cut) for puppet, trace, motion, its in runs]
        where, seen, place = placed(self.puppets, reaches, turn, size, room, apart)
        for puppet, there in zip(self.puppets, where, strict=True):
            puppet.place = there
        self.model = scene.compose(scenarios, where, size)
        self.where = where
        if not self.is_users:
            scene.restyle(self.model)
        self.data, self.goal = mujoco.MjData(self.model), mujoco.MjData(self.model)
        self.aimed = np.zeros(len(traces), bool)
        self.rest: list[np.ndarray | None] = [None] * len(traces)
        ends = np.cumsum([0, *(puppet.shapes[0].model.nq for puppet in self.puppets)]).tolist()
        self.blocks = [slice(*pair) for pair in itertools.pairwise(ends)]
        material = self.model.geom_matid
        self.paint = np.where(
            (material >= 0)[:, None], self.model.mat_rgba[material], self.model.geom_rgba
        )
        names = [[joint.name for joint in joints(models.spec(scenario))] for scenario in scenarios]
        self.joints = [
            [self.model.joint(f"m{k}/{name}").id for name in its] for k, its in enumerate(names)
        ]
        visible = (self.model.geom_group < GROUPS) & (self.paint[:, 3] > 0.0)
        moved = [
            moved_bodies(self.model, its) for its in self.joints
        ]  # by joints: bodies without one may be fused
        self.links = [
            np.flatnonzero(np.isin(self.model.geom_bodyid, its) & visible) for its in moved
        ]
        self.shape = [-1] * len(scenarios)
        self.colours = [""] * len(scenarios)
        self.changed = True
        for k, colour in enumerate(colours):
            self.set_shape(k, 0.0)
            self.set_colour(k, colour)
            self.pose(k, traces[k].x[0, : self.shown[k]])
        layers = []
        for its in drawn:
            for one in its:
                for _, arrow in one.arrows:
                    layers.append(arrow.layer)
        most = (
            arrows.MAX_BENT_SHARE * size[1] / (1.0 + arrows.BENT_DISTANCE * max(layers, default=0))
        )  # px
        most *= camera.pixel(size) * float(
            (place - np.concatenate(seen).mean(axis=0)) @ turn[:, 2]
        )  # m
        self.mounts = [
            [
                mount._replace(joint=i, radius=min(mount.radius, most))
                for i, mount in zip(ids, its.mounts, strict=True)
            ]
            for ids, its in zip(self.joints, self.puppets, strict=True)
        ]
        self.scale = scale
        film = self.model.camera("film")
        film.pos = place
        mujoco.mju_mat2Quat(self.model.cam_quat[film.id], turn.ravel())
        flat = [camera.project(points, turn, place, size) for points in seen]
        self.boxes = np.array([[*points.min(axis=0), *points.max(axis=0)] for points in flat])
        scene.forward(self.model, self.data)
        scene.set_floor(self.model, turn, place, size, np.concatenate(seen))
        self.turn = turn
        self.place = place
        self.size = size
        self.canvas = Canvas(self.model, self.data, size, arms=scene.are_arms(scenarios))

    def __enter__(self) -> "Stage":
        return self

    def __exit__(self, *_: object) -> None:
        self.canvas.close()

    def shows(self) -> bool:
        """Return whether a picture shows some of what the channels move."""
        links = np.concatenate(self.links)
        casts = self.canvas.casts
        groups = self.model.geom_group[links].copy()
        self.canvas.casts = np.zeros_like(casts)  # a shadow shows nothing
        picture, self.changed = self.canvas.draw(whole=True).astype(int), True
        self.model.geom_group[links] = scene.HIDDEN_GROUP
        bare = self.canvas.draw(whole=True)
        self.canvas.casts, self.model.geom_group[links] = casts, groups
        return bool(
            (np.abs(picture - bare).max(axis=2) > COLOUR_TOLERANCE).mean() > MIN_PICTURE_SHARE
        )

    def set_shape(self, k: int, time: float) -> None:
        """Give machine k its shape at a time, s: its rod may be longer than the plant's, and may
        change in a jump.
        """
        now = self.puppets[k].shape(time)
        if now == self.shape[k]:
            return
        self.shape[k], single = now, self.puppets[k].shapes[now].model
        for geom in range(single.ngeom):
            name = single.geom(geom).name
            copy = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_GEOM, f"m{k}/{name}")
            if name and copy >= 0:
                for field in SHAPE_FIELDS:
                    getattr(self.model, field)[copy] = getattr(single, field)[geom]
                self.model.geom_pos[copy] += self.where[k] * (single.geom_bodyid[geom] == 0)
        self.changed = True

    def set_colour(self, k: int, colour: str) -> None:
        """Colour the accent of machine k.

        A user's model has none: colour its links, those unpainted if it is alone.
        """
        if self.colours[k] == colour:
            return
        rgb = np.array(style.rgb(colour)) / 255
        links = self.links[k]
        if self.is_users:
            if len(self.colours) == 1 and colour != style.FAILED:
                links = links[(self.paint[links] == DEFAULT_RGBA).all(axis=1)]
            if len(links):
                self.model.geom_matid[links] = -1
                self.model.geom_rgba[links] = self.paint[links]
                self.model.geom_rgba[links, :3] = (
                    LAW_SHARE * rgb + (1.0 - LAW_SHARE) * self.paint[links, :3]
                )
        else:
            self.model.mat(f"m{k}/accent").rgba[:3] = rgb
        self.colours[k], self.changed = colour, True

    def aim(self, k: int, r: np.ndarray | None) -> None:
        """Show where the reference r, (shown,) rad or m, wants machine k, as a ghost; None: show no
        ghost.
        """
        self.aimed[k] = r is not None
        if r is not None:
            self.goal.qpos[self.blocks[k]] = self.puppets[k].qpos(r, rest=self.rest[k])

    def pose(
        self, k: int, x: np.ndarray, ahead: np.ndarray | None = None, time: float = 0.0
    ) -> None:
        """Put machine k's channels at x, (shown,) rad or m; `ahead` is the lead of the rotors over
        their joints.

        Joints without a channel are where they were at that time, s.
        """
        motion = self.motions[k]
        if motion is None:
            self.rest[k] = None
        else:
            self.rest[k] = motion.at(time)
        self.data.qpos[self.blocks[k]] = self.puppets[k].qpos(x, ahead, self.rest[k])

    def render(self, drawn: Sequence[tuple[int, int, arrows.Arrow]] = ()) -> np.ndarray:
        """Return the picture, (height, width, 3) uint8, with arrows given as (machine, channel,
        arrow); read-only.
        """
        scene.forward(self.model, self.data)
        scene.forward(self.model, self.goal)

        def add(shown: mujoco.MjvScene) -> None:
            for k in np.flatnonzero(self.aimed):
                self.ghost(shown, self.links[k])

        whole, self.changed = self.changed, False
        picture = self.canvas.draw(add, whole)
        if not drawn:
            return picture
        image = Image.fromarray(picture)
        for k, i, arrow in sorted(drawn, key=lambda one: one[2].head):  # bars are behind arrows
            if found := arrows.path(self.model, self.data, self.mounts[k][i], arrow):
                points, width = found
                line, sizes = map(
                    self.project,
                    (points, np.array([points[0], points[0] + width * self.turn[:, 1]])),
                )
                if np.ptp(line, axis=0).max() > 1.0:  # else it points at the camera
                    if self.mounts[k][i].radius:
                        anchor = self.project(self.data.xanchor[self.mounts[k][i].joint][None])[0]
                        leader = [tuple(point.tolist()) for point in (anchor, line[0])]
                        ImageDraw.Draw(image).line(leader, style.INK, max(1, round(self.scale)))
                    least = arrows.MIN_SHAFT * self.scale * arrow.size
                    outline = arrows.outline(
                        line, max(float(np.ptp(sizes[:, 1])), least), arrow.head
                    )
                    bent = self.mounts[k][i].radius > 0.0  # it lies over a link of its colour
                    arrows.paint(
                        image,
                        outline,
                        arrow.rgba,
                        rim=round(arrows.RIM * self.scale) if bent else 0,
                    )
        return np.asarray(image)

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return where points (m, 3) m are in the picture, (m, 2) px."""
        return camera.project(points, self.turn, self.place, self.size)

    def find(self, k: int, name: str) -> np.ndarray:
        """Return where a site of machine k is, or the centre of mass of a body, (3,) m."""
        if mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_SITE, f"m{k}/{name}") >= 0:
            return self.data.site(f"m{k}/{name}").xpos
        return self.data.body(f"m{k}/{name}").xipos

    def ghost(self, shown: mujoco.MjvScene, links: np.ndarray) -> None:
        """Add translucent copies of geoms, posed as the reference wants them."""
        model = self.model
        goal = self.goal
        for i in links[: shown.maxgeom - shown.ngeom].tolist():
            shape = shown.geoms[shown.ngeom]
            size = GHOST_SIZE * model.geom_size[i]
            mujoco.mjv_initGeom(
                shape, model.geom_type[i], size, goal.geom_xpos[i], goal.geom_xmat[i], GHOST_RGBA
            )
            shape.dataid = 2 * model.geom_dataid[i]
            shape.objtype = OTHER
            shape.transparent = 1
            shape.specular = 0.0
            shown.ngeom += 1


def placed(
    puppets: Sequence[Puppet],
    reaches: Sequence[np.ndarray],
    turn: np.ndarray,
    size: tuple[int, int],
    room: camera.Room,
    apart: float,
) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
    """Return the places of the machines, (machines, 3) m, their points there, and the place of the
    camera, (3,) m.

    Machines in a row are at least `apart` px apart, and fill ROW_SHARE of the room if that makes
    them no smaller.
    """
    where = standing_places(puppets, reaches, turn)
    if scene.are_arms([puppet.scenario for puppet in puppets]):  # the floor hides what is below it
        floors = [(-np.inf, -np.inf, -there[2]) for there in where]
        reaches = [np.maximum(points, floor) for points, floor in zip(reaches, floors, strict=True)]

    def fitted(where: np.ndarray) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
        seen = [points + there for points, there in zip(reaches, where, strict=True)]
        return where, seen, camera.fit(np.concatenate(seen), turn, size, room)

    fit = fitted(where)
    if len(where) > 1:
        step = np.diff(camera.project(where, turn, fit[2], size)[:, 0]).mean()
    else:
        step = 0.0
    pitch = ROW_SHARE * (room.right - room.left) / len(where)
    if 0.0 < step < apart:  # else labels would not be below their machines
        fit = fitted(where * (apart / step, apart / step, 1.0))
    elif 0.0 < step < pitch and scene.in_a_row(puppets[0].scenario, turn):
        wide = fitted(where * (pitch / step, pitch / step, 1.0))
        if (wide[2] - fit[2]) @ turn[:, 2] < DISTANCE_ROUNDING * np.abs(fit[2]).max():
            return wide
    return fit


def standing_places(
    puppets: Sequence[Puppet], reaches: Sequence[np.ndarray], turn: np.ndarray
) -> np.ndarray:
    """Return where the machines stand, (machines, 3) m: side by side, on the floor."""
    scenarios = [puppet.scenario for puppet in puppets]
    step = scene.lane(scenarios, reaches, turn)
    middles = step * (np.arange(len(puppets)) - (len(puppets) - 1) / 2)[:, None]
    middles[:, 2] -= [puppet.lowered for puppet in puppets]
    if not scenarios[0].plant.on_stage:  # the floor hides what is below it
        middles[:, 2] += [max(0.0, -float(points[:, 2].min())) for points in reaches]
    return middles


def framed(
    acts: Sequence[Act],
    size: tuple[int, int],
    room: camera.Room,
    chosen: camera.Camera | None,
    apart: float,
    scale: float,
) -> Stage:
    """Return the stage from the chosen view or, if that shows nothing, from the first of others
    that shows something.

    The library's own machines are in sight unless a view is chosen. Arguments are those of `Stage`.
    A warning tells if the chosen view, or every view, shows nothing.
    """
    traces = [act.trace for act in acts]
    colours = [act.colour for act in acts]
    name = traces[0].scenario.plant.name
    for view in (chosen, *scene.OTHER_VIEWS):
        stage = Stage(traces, colours, size, room, view, acts, apart, scale)
        if (chosen is None and not stage.is_users) or stage.shows():
            if view != chosen is not None:
                fact = (
                    f"camera {chosen!r} shows nothing of {name}: the picture is from camera={view}"
                )
                warnings.warn(fact, ScenarioWarning, users_stacklevel())
            return stage
        if not any(len(links) for links in stage.links):
            fact = (
                "shows no part that moves: give it geoms in groups 0 to 2 that are not transparent"
            )
            break
        stage.canvas.close()
    else:
        stage = Stage(traces, colours, size, room, chosen, acts, apart, scale)
        fact = "shows nothing from any side: give another camera, such as camera=(60, -20)"
    warnings.warn(f"the picture of {name} {fact}", ScenarioWarning, users_stacklevel())
    return stage
