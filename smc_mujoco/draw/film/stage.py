"""The stage of a film: poses and renders one machine under its camera, with its arrows.

All machines of a film have the same view. The camera stands at the nearest place from which every
machine stays in its tile, wherever its trace takes it; it follows machines that go far.
"""

import warnings
from collections.abc import Sequence

import mujoco
import numpy as np
from PIL import Image, ImageDraw

from smc_mujoco.common.aliases import Array
from smc_mujoco.common.errors import ScenarioWarning, users_stacklevel
from smc_mujoco.draw import lettering, style
from smc_mujoco.draw.film import arrow_lines, arrows, camera, flat_arrows, world
from smc_mujoco.draw.film.canvas import Canvas
from smc_mujoco.draw.film.puppet import Puppet, moved_bodies
from smc_mujoco.draw.film.sheet import STATE_HEIGHT, STATE_PLACE
from smc_mujoco.draw.film.track import MachineTrack

LAW_SHARE = 0.75  # of the law's colour in a user's model, where several laws are shown; chosen
DEFAULT_RGBA = np.array([0.5, 0.5, 0.5, 1.0], np.float32)  # MuJoCo's colour of geoms
OUTLINE = 2.6  # px of a film of full size, around where the reference wants the machine; chosen
DOTS = 5.0, 16.0  # px of a film of full size, from a machine to its reference: size, pitch; chosen
WHITE = np.ones(4, np.float32)
SHAPE_FIELDS = ("geom_pos", "geom_size", "geom_group", "geom_sameframe")


class Stage:
    """The compiled scene of one machine: a context, which opens and closes its renderer, `canvas`.

    `points`, (m, 3) m, are what the machines of a film reach in this view; `alone` is whether the
    film has no other machine; `followed`, (frames, 3) m, is where the camera goes with the machine;
    `beside`, (3,) m, is the place of one that shares its picture with others.
    """

    def __init__(
        self,
        track: MachineTrack,
        puppet: Puppet,
        view: camera.View,
        points: Array,
        scale: float = 1.0,
        alone: bool = True,
        followed: Array | None = None,
        beside: Array | float = 0.0,
    ):
        self.track = track
        self.puppet = puppet
        self.size, self.turn, self.place, _ = view
        self.start = view.place
        self.scale = scale
        self.alone = alone
        self.followed = followed
        self.beside = beside
        self.is_users = not puppet.scenario.plant.on_stage
        self.model = world.compose(puppet.scenario, puppet.height, self.size, self.turn)
        if not self.is_users:
            world.restyle(self.model)
        self.data = mujoco.MjData(self.model)
        self.goal = mujoco.MjData(self.model)
        self.aimed = False
        self.words: list[Array] = []  # the box, (2, 2) px, of what is said of the machine
        material = self.model.geom_matid
        painted = self.model.mat_rgba[material]
        stated = (material >= 0)[:, None]
        self.paint = np.where(stated, painted, self.model.geom_rgba)
        opaque = self.paint[:, 3] > 0.0
        visible = (self.model.geom_group < world.DRAWN_GROUPS) & opaque
        away = self.place - points.mean(axis=0)
        distance = float(away @ self.turn[:, 2])
        tall = self.size[1] * camera.pixel(self.size) * distance  # m
        self.find_joints(visible, arrow_lines.MAX_BENT_SHARE * tall)
        self.shape = -1
        self.colour = ""
        film = self.model.camera("film")
        self.camera = film.id
        mujoco.mju_mat2Quat(self.model.cam_quat[film.id], self.turn.ravel())
        self.arrange(track.trace.x[0, : puppet.shown])
        self.set_colour(track.colour)
        self.look(0)
        world.forward(self.model, self.data)
        world.set_floor(self.model, view, points, self.place - self.start)
        if self.is_users and not len(self.links):
            warnings.warn(
                f"the picture of {puppet.scenario.plant.name} shows no part that moves: "
                "give it geoms in groups 0 to 2 that are not transparent",
                ScenarioWarning,
                users_stacklevel(),
            )

    def __enter__(self) -> "Stage":
        self.canvas = Canvas(self.model, self.data, self.size)
        return self

    def __exit__(self, *_: object) -> None:
        self.canvas.close()

    def find_joints(self, visible: Array, radius: float) -> None:
        """Find the geoms that the joints move, and the mounts of arrows; bent ones have at most
        this radius, m.
        """
        ids = []
        self.mounts = []
        for joint, mount in zip(self.puppet.ids.tolist(), self.puppet.mounts, strict=True):
            ids.append(self.model.joint(f"m/{self.puppet.model.joint(joint).name}").id)
            bent = min(mount.radius, radius)
            self.mounts.append(mount._replace(joint=ids[-1], radius=bent))
        moved = moved_bodies(self.model, ids)  # by joints: bodies without one may be fused
        self.links = np.flatnonzero(np.isin(self.model.geom_bodyid, moved) & visible)

    def look(self, frame: int) -> None:
        """Put the camera where it is at a frame."""
        if self.followed is not None:
            self.place = self.start + self.followed[frame]
        self.model.cam_pos[self.camera] = self.place

    def arrange(
        self,
        x: Array,
        ahead: Array | float = 0.0,
        time: float = 0.0,
        goal: Array | None = None,
    ) -> None:
        """Put the channels at x, (shown,) rad or m, at a time, s; `ahead` is the lead of the rotors
        over their joints. A ghost shows where the machine is at `goal`, (shown,).

        Joints without a channel are where they were at that time.
        """
        rest = self.track.rest(time)
        now = self.puppet.shape(time)
        self.data.qpos[:] = self.puppet.qpos(x, ahead, rest)
        self.aimed = goal is not None
        if goal is not None:
            self.goal.qpos[:] = self.puppet.qpos(goal, rest=rest)
        if now != self.shape:
            self.set_shape(now)

    def set_shape(self, now: int) -> None:
        """Give the machine one of its shapes: its rod may be longer than the plant's, and may
        change in a jump.
        """
        self.shape = now
        single = self.puppet.shapes[now].model
        for geom in range(single.ngeom):
            name = single.geom(geom).name
            copy = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_GEOM, f"m/{name}")
            if name and copy >= 0:
                for field in SHAPE_FIELDS:
                    getattr(self.model, field)[copy] = getattr(single, field)[geom]
                if single.geom_bodyid[geom] == 0:
                    self.model.geom_pos[copy, 2] += self.puppet.height

    def set_colour(self, colour: str) -> None:
        """Colour the accent of the machine.

        A user's model has none: colour its links, those unpainted if it is alone.
        """
        if self.colour == colour:
            return
        self.colour = colour
        rgb = np.array(style.rgb(colour)) / 255
        if not self.is_users:
            accent = self.model.mat("m/accent")
            accent.rgba[:3] = rgb
            own = (self.model.geom_matid == accent.id) & (self.model.geom_rgba != DEFAULT_RGBA).any(
                1
            )
            self.model.geom_rgba[own, :3] = rgb  # a transparent accent has its own colour
            return
        links = self.links
        if self.alone and colour != style.FAILED:
            links = links[(self.paint[links] == DEFAULT_RGBA).all(axis=1)]
        self.model.geom_matid[links] = -1
        self.model.geom_rgba[links] = self.paint[links]
        own = (1.0 - LAW_SHARE) * self.paint[links, :3]
        self.model.geom_rgba[links, :3] = LAW_SHARE * rgb + own

    def shot(self, frame: int, time: float) -> Array:
        """Return the picture at a frame, whose time is given, s: (height, width, 3) uint8."""
        return self.render(self.pose(frame, time))

    def pose(self, frame: int, time: float) -> Sequence[tuple[int, arrows.Arrow]]:
        """Put the machine where it is at a frame, whose time is given, s, and return its arrows.

        A machine that has failed is grey, without an outline or arrows.
        """
        track = self.track
        failed = track.failed(time)
        self.words = []
        if state := track.states[frame]:
            high = flat_arrows.LETTERS * self.scale
            wide = STATE_PLACE * high + lettering.width(state.words, high, bold=True)
            self.words.append(np.array([(0.0, 0.0), (wide, STATE_HEIGHT * high)]))
        goal = None if failed else track.r[frame]
        self.arrange(track.x[frame], track.ahead[frame], time, goal)
        self.look(frame)
        self.set_colour(style.FAILED if failed else track.colour)
        return () if failed else track.drawn[frame].arrows

    def forward(self) -> None:
        """Compute where everything is in the machine's pose, and where its reference wants it."""
        world.forward(self.model, self.data)
        world.forward(self.model, self.goal)

    def render(self, drawn: Sequence[tuple[int, arrows.Arrow]] = ()) -> Array:
        """Return the picture, (height, width, 3) uint8, with arrows given as (channel, arrow);
        read-only.
        """
        self.forward()
        picture = self.canvas.draw(lambda shown: None)
        picture = self.canvas.outlined(picture, self.add_outline, OUTLINE * self.scale)
        image = Image.fromarray(picture)
        if self.followed is not None and self.aimed:
            self.dot_to_goal(image)
        stamped = self.stamped(image, drawn, self.words)
        taken = [*self.words, *flat_arrows.boxes(stamped, self.scale)]
        flat_arrows.write_numbers(image, stamped, self.scale, taken, image.width)
        return np.asarray(image)

    def dot_to_goal(self, image: Image.Image) -> None:
        """Draw dots over the picture of a machine that is followed, to where its reference wants
        it, or to the picture's edge.
        """
        middles = [data.geom_xpos[self.links].mean(axis=0) for data in (self.data, self.goal)]
        start, stop = self.project(np.array(middles))
        way = stop - start
        far = float(np.linalg.norm(way))
        size, pitch = np.array(DOTS) * self.scale
        for distance in np.arange(pitch, min(far, sum(image.size)), pitch).tolist():
            middle = start + distance / far * way
            box = [*(middle - size / 2).tolist(), *(middle + size / 2).tolist()]
            ImageDraw.Draw(image).ellipse(box, style.INK)

    def stamped(
        self,
        image: Image.Image,
        drawn: Sequence[tuple[int, arrows.Arrow]],
        words: Sequence[Array],
    ) -> list[flat_arrows.Stamped]:
        """Draw arrows, given as (channel, arrow), over a picture in which words are in boxes of
        (2, 2) px each; return those that are seen.
        """
        stamps = []
        for i, arrow in sorted(drawn, key=lambda item: item[1].head):  # bars are behind arrows
            if stamp := self.draw_arrow(image, self.mounts[i], arrow, words):
                stamps.append(stamp)
        return stamps

    def draw_arrow(
        self,
        image: Image.Image,
        mount: arrow_lines.Mount,
        arrow: arrows.Arrow,
        words: Sequence[Array],
    ) -> flat_arrows.Stamped | None:
        """Draw an arrow over the picture and return it; nothing, None, if it has no place or points
        at the camera, or if it lies under the words that have its value.
        """
        path = arrow_lines.path(self.model, self.data, mount, arrow)
        if not path:
            return None
        points, width = path
        line = self.project(points)
        length = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
        if length < flat_arrows.MIN_PIXELS * self.scale:
            return None
        beside = points[0] + width * self.turn[:, 1]
        across = self.project(np.array([points[0], beside]))
        least = flat_arrows.MIN_SHAFT * self.scale * arrow.size
        thick = max(float(np.ptp(across[:, 1])), least)
        if arrow.on_blow and flat_arrows.covers(words, flat_arrows.outline(line, thick)):
            return None
        if mount.radius and not arrow.body:
            anchor = self.project(self.data.xanchor[[mount.joint]])[0]
            leader = [*anchor.tolist(), *line[0].tolist()]
            ImageDraw.Draw(image).line(leader, style.INK, max(1, round(self.scale)))
        return flat_arrows.stamp(image, line, thick, arrow, round(flat_arrows.RIM * self.scale))

    def project(self, points: Array) -> Array:
        """Return where points (m, 3) m are in the picture, (m, 2) px."""
        return camera.project(points + self.beside, self.turn, self.place, self.size)

    def find(self, name: str) -> Array:
        """Return where a site of the machine is, or the centre of mass of a body, (3,) m."""
        if mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_SITE, f"m/{name}") >= 0:
            return self.data.site(f"m/{name}").xpos
        return self.data.body(f"m/{name}").xipos

    def add_outline(self, shown: mujoco.MjvScene) -> None:
        """Add white copies of the links, as the reference wants them, if the machine is aimed."""
        model = self.model
        for i in self.links.tolist() if self.aimed else ():
            if shown.ngeom >= shown.maxgeom:
                return
            shape = shown.geoms[shown.ngeom]
            place = self.goal.geom_xpos[i] + self.beside
            turn = self.goal.geom_xmat[i]
            mujoco.mjv_initGeom(shape, model.geom_type[i], model.geom_size[i], place, turn, WHITE)
            shape.dataid = 2 * model.geom_dataid[i]
            shape.objtype = mujoco.mjtObj.mjOBJ_UNKNOWN
            shown.ngeom += 1

    def add_beside(self, shown: mujoco.MjvScene) -> None:
        """Add the machine to the scene of another, at its place beside it."""
        first = shown.ngeom
        all_geoms = mujoco.mjtCatBit.mjCAT_ALL
        look = self.canvas.option, mujoco.MjvPerturb()
        mujoco.mjv_addGeoms(self.model, self.data, *look, all_geoms, shown)
        for shape in shown.geoms[first : shown.ngeom]:
            shape.pos[:] += self.beside

    def hide(self, geoms: Array) -> None:
        """Draw no geoms of these indices, and no skins, such as springs."""
        self.model.geom_group[geoms] = world.HIDDEN_GROUP
        self.canvas.option.flags[mujoco.mjtVisFlag.mjVIS_SKIN] = 0
