"""The stage of a film: poses and renders the machines of all traces under one camera that sees them
all.

The camera stands at the nearest place from which every machine stays inside the room that the page
leaves, wherever its trace takes it.
"""

import warnings
from collections.abc import Sequence

import mujoco
import numpy as np
from PIL import Image, ImageDraw

from smc_mujoco.common.errors import ScenarioWarning, users_stacklevel
from smc_mujoco.draw import style
from smc_mujoco.draw.film import arrows, camera, scene
from smc_mujoco.draw.film.canvas import Canvas
from smc_mujoco.draw.film.puppet import Puppet, moved_bodies
from smc_mujoco.draw.film.track import MachineTrack
from smc_mujoco.mechanisms.hardware.part import joints
from smc_mujoco.simulation import model as models

ROW_SHARE = 0.95  # of the width, which the places of machines in a row take at least; chosen
LAW_SHARE = 0.75  # of the law's colour in a user's model, where several laws are shown; chosen
DEFAULT_RGBA = np.array([0.5, 0.5, 0.5, 1.0], np.float32)  # MuJoCo's colour of geoms
GROUPS = 3  # groups of geoms that MuJoCo draws by default
GHOST_RGBA = np.array([0.12, 0.14, 0.16, 0.22], np.float32)  # ink, translucent
GHOST_SIZE = 0.97  # of its machine's, so that a machine at its reference hides it
SHAPE_FIELDS = ("geom_pos", "geom_size", "geom_group", "geom_sameframe")


class Stage:
    """The compiled scene and its renderer: a context, which closes the renderer.

    The machines are at `where`, (machines, 3) m, in the picture at `boxes`, (machines, 4) px: left,
    top, right, bottom.
    """

    def __init__(
        self,
        tracks: Sequence[MachineTrack],
        size: tuple[int, int],
        room: camera.Room,
        chosen: camera.Camera | None = None,
        apart: float = 0.0,
        scale: float = 1.0,
    ):
        self.tracks = tracks
        self.size = size
        self.scale = scale
        first = tracks[0].trace.scenario
        self.is_users = not first.plant.on_stage
        self.turn = turn = scene.turn(first, chosen)
        cut = scene.in_a_row(first, turn)
        self.puppets = []
        scenarios = []
        reaches = []
        self.shown = []
        self.blocks = []  # of the positions of all
        start = 0
        for track in tracks:
            puppet = Puppet(track.trace.scenario, turn[:, 2])
            self.puppets.append(puppet)
            scenarios.append(puppet.scenario)
            reaches.append(puppet.reach(track, cut))
            self.shown.append(puppet.shown)
            self.blocks.append(slice(start, start + puppet.model.nq))
            start += puppet.model.nq
        self.where, seen, self.place = placed(self.puppets, reaches, turn, size, room, apart)
        self.model = scene.compose(scenarios, self.where, size)
        if not self.is_users:
            scene.restyle(self.model)
        self.data = mujoco.MjData(self.model)
        self.goal = mujoco.MjData(self.model)
        self.aimed = np.zeros(len(tracks), bool)
        material = self.model.geom_matid
        painted = self.model.mat_rgba[material]
        self.paint = np.where((material >= 0)[:, None], painted, self.model.geom_rgba)
        visible = (self.model.geom_group < GROUPS) & (self.paint[:, 3] > 0.0)
        radius = self.largest_radius(
            float((self.place - np.concatenate(seen).mean(axis=0)) @ turn[:, 2])
        )
        self.links = []
        self.mounts = []
        for k in range(len(tracks)):
            self.find_joints(k, visible, radius)
        self.shape = [-1] * len(tracks)
        self.colours = [""] * len(tracks)
        for k, track in enumerate(tracks):
            self.set_shape(k, 0.0)
            self.set_colour(k, track.colour)
            self.pose(k, track.trace.x[0, : self.shown[k]])
        film = self.model.camera("film")
        film.pos = self.place
        mujoco.mju_mat2Quat(self.model.cam_quat[film.id], turn.ravel())
        self.boxes = np.stack(list(map(self.box, seen)))
        scene.forward(self.model, self.data)
        scene.set_floor(self.model, turn, self.place, size, np.concatenate(seen))
        if self.is_users and not any(map(len, self.links)):
            warnings.warn(
                f"the picture of {first.plant.name} shows no part that moves: "
                "give it geoms in groups 0 to 2 that are not transparent",
                ScenarioWarning,
                users_stacklevel(),
            )
        self.canvas = Canvas(self.model, self.data, size, arms=bool(first.plant.tip))

    def __enter__(self) -> "Stage":
        return self

    def __exit__(self, *_: object) -> None:
        self.canvas.close()

    def find_joints(self, k: int, visible: np.ndarray, radius: float) -> None:
        """Find the geoms that the joints of machine k move, and the mounts of its arrows; bent ones
        have at most this radius, m.
        """
        puppet = self.puppets[k]
        puppet.place = self.where[k]
        ids = []
        mounts = []
        for joint, mount in zip(joints(models.spec(puppet.scenario)), puppet.mounts, strict=True):
            ids.append(self.model.joint(f"m{k}/{joint.name}").id)
            mounts.append(mount._replace(joint=ids[-1], radius=min(mount.radius, radius)))
        moved = moved_bodies(self.model, ids)  # by joints: bodies without one may be fused
        self.links.append(np.flatnonzero(np.isin(self.model.geom_bodyid, moved) & visible))
        self.mounts.append(mounts)

    def largest_radius(self, distance: float) -> float:
        """Return the largest radius of a bent arrow at a distance from the camera, m."""
        layers = 0
        for track in self.tracks:
            for drawn in track.framing:
                layers = max([layers, *(arrow.layer for _, arrow in drawn.arrows)])
        most = arrows.MAX_BENT_SHARE * self.size[1] / (1.0 + arrows.BENT_DISTANCE * layers)  # px
        return most * camera.pixel(self.size) * distance

    def set_shape(self, k: int, time: float) -> None:
        """Give machine k its shape at a time, s: its rod may be longer than the plant's, and may
        change in a jump.
        """
        now = self.puppets[k].shape(time)
        if now == self.shape[k]:
            return
        self.shape[k] = now
        single = self.puppets[k].shapes[now].model
        for geom in range(single.ngeom):
            name = single.geom(geom).name
            copy = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_GEOM, f"m{k}/{name}")
            if name and copy >= 0:
                for field in SHAPE_FIELDS:
                    getattr(self.model, field)[copy] = getattr(single, field)[geom]
                if single.geom_bodyid[geom] == 0:
                    self.model.geom_pos[copy] += self.where[k]

    def set_colour(self, k: int, colour: str) -> None:
        """Colour the accent of machine k.

        A user's model has none: colour its links, those unpainted if it is alone.
        """
        if self.colours[k] == colour:
            return
        self.colours[k] = colour
        rgb = np.array(style.rgb(colour)) / 255
        if not self.is_users:
            self.model.mat(f"m{k}/accent").rgba[:3] = rgb
            return
        links = self.links[k]
        if len(self.colours) == 1 and colour != style.FAILED:
            links = links[(self.paint[links] == DEFAULT_RGBA).all(axis=1)]
        self.model.geom_matid[links] = -1
        self.model.geom_rgba[links] = self.paint[links]
        own = (1.0 - LAW_SHARE) * self.paint[links, :3]
        self.model.geom_rgba[links, :3] = LAW_SHARE * rgb + own

    def rest(self, k: int, time: float) -> np.ndarray | None:
        """Return the pose of machine k at a time, s, in joints that have no channel."""
        motion = self.tracks[k].motion
        return None if motion is None else motion.at(time)

    def aim(self, k: int, r: np.ndarray | None, time: float = 0.0) -> None:
        """Show where the reference r, (shown,) rad or m, wants machine k, as a ghost; None: show no
        ghost.
        """
        self.aimed[k] = r is not None
        if r is not None:
            self.goal.qpos[self.blocks[k]] = self.puppets[k].qpos(r, rest=self.rest(k, time))

    def pose(
        self, k: int, x: np.ndarray, ahead: np.ndarray | float = 0.0, time: float = 0.0
    ) -> None:
        """Put machine k's channels at x, (shown,) rad or m; `ahead` is the lead of the rotors over
        their joints.

        Joints without a channel are where they were at that time, s.
        """
        self.data.qpos[self.blocks[k]] = self.puppets[k].qpos(x, ahead, self.rest(k, time))

    def render(self, drawn: Sequence[tuple[int, int, arrows.Arrow]] = ()) -> np.ndarray:
        """Return the picture, (height, width, 3) uint8, with arrows given as (machine, channel,
        arrow); read-only.
        """
        scene.forward(self.model, self.data)
        scene.forward(self.model, self.goal)
        picture = self.canvas.draw(self.add_ghosts)
        if not drawn:
            return picture
        image = Image.fromarray(picture)
        for k, i, arrow in sorted(drawn, key=lambda item: item[2].head):  # bars are behind arrows
            self.draw_arrow(image, self.mounts[k][i], arrow)
        return np.asarray(image)

    def draw_arrow(self, image: Image.Image, mount: arrows.Mount, arrow: arrows.Arrow) -> None:
        """Draw an arrow over the picture; nothing if it has no place or points at the camera."""
        found = arrows.path(self.model, self.data, mount, arrow)
        if not found:
            return
        points, width = found
        line = self.project(points)
        if np.ptp(line, axis=0).max() <= 1.0:
            return
        across = self.project(np.array([points[0], points[0] + width * self.turn[:, 1]]))
        thick = max(float(np.ptp(across[:, 1])), arrows.MIN_SHAFT * self.scale * arrow.size)
        rim = 0
        if mount.radius:  # it lies over a link of its colour
            anchor = self.project(self.data.xanchor[[mount.joint]])[0]
            leader = [*anchor.tolist(), *line[0].tolist()]
            ImageDraw.Draw(image).line(leader, style.INK, max(1, round(self.scale)))
            rim = round(arrows.RIM * self.scale)
        arrows.paint(image, arrows.outline(line, thick, arrow.head), arrow.rgba, rim)

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return where points (m, 3) m are in the picture, (m, 2) px."""
        return camera.project(points, self.turn, self.place, self.size)

    def box(self, points: np.ndarray) -> np.ndarray:
        """Return the box around points (m, 3) m in the picture, px: left, top, right, bottom."""
        flat = self.project(points)
        return np.append(flat.min(axis=0), flat.max(axis=0))

    def find(self, k: int, name: str) -> np.ndarray:
        """Return where a site of machine k is, or the centre of mass of a body, (3,) m."""
        if mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_SITE, f"m{k}/{name}") >= 0:
            return self.data.site(f"m{k}/{name}").xpos
        return self.data.body(f"m{k}/{name}").xipos

    def add_ghosts(self, shown: mujoco.MjvScene) -> None:
        """Add translucent copies of the machines that are aimed, as their references want them."""
        model = self.model
        links = [self.links[k] for k in np.flatnonzero(self.aimed)]
        for i in np.concatenate([*links, []]).astype(int).tolist():
            if shown.ngeom >= shown.maxgeom:
                return
            shape = shown.geoms[shown.ngeom]
            size = GHOST_SIZE * model.geom_size[i]
            place = self.goal.geom_xpos[i]
            turn = self.goal.geom_xmat[i]
            mujoco.mjv_initGeom(shape, model.geom_type[i], size, place, turn, GHOST_RGBA)
            shape.dataid = 2 * model.geom_dataid[i]
            shape.objtype = mujoco.mjtObj.mjOBJ_UNKNOWN
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

    Machines stand side by side on the floor. In a row they are at least `apart` px apart, and fill
    ROW_SHARE of the room if that makes them no smaller.
    """
    scenarios = [puppet.scenario for puppet in puppets]
    step = scene.lane(scenarios, reaches, turn)
    where = step * (np.arange(len(puppets)) - (len(puppets) - 1) / 2)[:, None]
    where[:, 2] -= [puppet.lowered for puppet in puppets]
    if not scenarios[0].plant.on_stage:  # the floor hides what is below it
        where[:, 2] += [max(0.0, -float(points[:, 2].min())) for points in reaches]
    floor = 0.0 if scenarios[0].plant.tip else -np.inf

    def fitted(where: np.ndarray) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
        lowest = (-np.inf, -np.inf, floor)
        seen = [np.maximum(points + at, lowest) for points, at in zip(reaches, where, strict=True)]
        return where, seen, camera.fit(np.concatenate(seen), turn, size, room)

    fit = fitted(where)
    if len(where) == 1:
        return fit
    pitch = np.diff(camera.project(where, turn, fit[2], size)[:, 0]).mean()
    filled = ROW_SHARE * (room.right - room.left) / len(where)
    if 0.0 < pitch < apart:  # else labels would not be below their machines
        return fitted(where * (apart / pitch, apart / pitch, 1.0))
    if 0.0 < pitch < filled and scene.in_a_row(scenarios[0], turn):
        wide = fitted(where * (filled / pitch, filled / pitch, 1.0))
        if (wide[2] - fit[2]) @ turn[:, 2] < 1e-9 * np.abs(fit[2]).max():
            return wide
    return fit
