"""The machines on the page of `smc.view`, in the colours, light and camera of a film."""

import time
from collections.abc import Callable, Iterator, Sequence

import mujoco
import numpy as np
from viser import ClientHandle, FrameHandle, MeshHandle, SceneNodeDragEvent, ViserServer

from smc_mujoco.common.aliases import Array
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.draw import colouring, style, wording
from smc_mujoco.draw.film import arrow_lines, arrows, camera, shared_picture, world
from smc_mujoco.draw.film.puppet import Puppet, moved_bodies
from smc_mujoco.draw.film.stage import DEFAULT_RGBA, LAW_SHARE
from smc_mujoco.draw.session import Session
from smc_mujoco.draw.view_shapes import arrow_mesh, body_meshes, geom_meshes, joined
from smc_mujoco.mechanisms.layout import joint_ids
from smc_mujoco.simulation.signals import Push

Line = tuple[Array, float]  # of an arrow: its points, (m, 3) m, and its width, m
# Numbers of presentation here are chosen.
GHOST = 0.35  # opacity of the second run's machine, where it stands in the first
SIZE = 800, 800  # px, of a picture in whose middle the machines are
FREE = 0.17  # of its sides, around them
DARKEST = 0.15  # of a colour, in which light and shade still show a shape
OVER = 0.1  # sizes of what moves, from there to the name of its law
LINE = 0.08  # the same, from one name to the next
UP = 0.27  # of a phone's height, which the panel covers from below, to the machines
APART = 1.15  # widths of a machine, to the one beside it
MAX_STAND = 2.0  # sizes of what moves: wider things that stand still may be behind the next machine
AHEAD = 4.0  # s of the runs, which the camera sees whole
AHEAD_WORK = 1.0  # s at most, to look ahead
POSES = 40  # of a run, looked at
PUSH_SEEN = 0.5  # s for which the arrow of a push stays
GRAVITY = 9.81  # m/s^2, for the force of a push: the weight of what moves, a size of it away
# intensity of each light, and the direction from which it comes
LIGHTS = {"key": (2.0, (-0.35, -0.55, 0.80)), "fill": (0.8, (0.45, -0.80, 0.35))}
AMBIENT = 1.8
TENDON = 2.0  # px, width of a tendon
FLOOR_LINES = 10  # of the floor's grid, to each side; viser's own takes ten times as long to draw
PULLEY = -2  # in data.wrap_obj, where a branch of a tendon ends
Pushed = Callable[[str, Array], None]  # a body, with a force in the axes of the world, (3,) N


class Machines:
    """The machines of a session's runs in the scene of a page, which tells `pushed` what the mouse
    did.
    """

    def __init__(self, server: ViserServer, session: Session, pushed: Pushed):
        self.scene = server.scene
        self.session = session
        self.pushed = pushed
        first = session.scenarios[0]
        puppet = Puppet.of(first)
        self.turn = puppet.turn(None)
        self.model = session.screen()
        if first.plant.on_stage:
            world.restyle(self.model)
        self.data = mujoco.MjData(self.model)
        joints = joint_ids(self.model)
        self.moved = moved_bodies(self.model, joints)
        self.links = np.isin(self.model.geom_bodyid, self.moved) & (
            self.model.geom_group < world.DRAWN_GROUPS
        )
        if not self.links.any():
            raise ScenarioError(
                f"nothing that moves on {first.plant.name} has a shape to be seen: give its bodies "
                "geoms, or its links <visual>"
            )
        slides = self.model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_SLIDE
        self.carts = shared_picture.places([puppet, puppet], self.turn)
        self.colours = colouring.law_colours([scenario.law for scenario in session.scenarios])
        if len(set(self.colours)) < len(self.colours):  # one law twice
            self.colours = list(colouring.RUN_COLOURS[: len(self.colours)])
        self.points = np.concatenate(list(self.reached()))
        self.size = float(np.ptp(self.points, axis=0).max())
        own = float(np.ptp(self.points[: 8 * self.links.sum()], axis=0).max())  # in one pose
        front = self.turn[:, 2]
        self.mounts = []
        for mount in arrow_lines.mounts(
            first.plant, self.model, joints.tolist(), slides.tolist(), puppet.rail, front
        ):
            radius = min(mount.radius, arrow_lines.BENT_SIZE * own / len(joints) ** 0.5)
            if first.plant.has_path:  # an arm of the library, where a film writes numbers
                radius = arrow_lines.USER_RADIUS * own
            self.mounts.append(
                mount._replace(radius=radius, front=front if radius else mount.front)
            )
        weight = GRAVITY * self.model.body_mass[self.moved].sum()  # N
        self.weight = float(f"{weight:.2g}")
        right, up, back = self.turn.T
        corners = world.boxes(self.model, self.data)[world.still(self.model)] @ right
        stands = corners[np.ptp(corners, axis=1) < MAX_STAND * self.size]
        across = np.append(stands, self.points @ right)
        self.width = float(np.ptp(across))
        high = np.max(self.points @ up) + OVER * self.size
        middle = 0.5 * (across.min() + across.max())
        self.over = self.turn @ np.array([middle, high, np.mean(self.points @ back)])
        self.light()
        self.meshes = geom_meshes(self.model)
        self.runs = [MachineNodes(self, run, colour) for run, colour in enumerate(self.colours)]
        self.stand(beside=True)
        self.show()
        self.place_camera(server)

    def reached(self) -> Iterator[Array]:
        """Yield the corners of what moves, (m, 3) m, in the next seconds of the runs, and start
        them again.
        """
        session = self.session
        began = time.perf_counter()
        last = min(session.samples, round(AHEAD / session.scenarios[0].control_period))
        for sample in np.linspace(0, last, POSES).astype(int).tolist():
            session.advance_to(sample)
            for run in range(len(session.scenarios)):
                self.pose(run)
                yield world.boxes(self.model, self.data)[self.links].reshape(-1, 3)
            if time.perf_counter() - began > AHEAD_WORK:
                break
        session.begin(session.scenarios)

    def pose(self, run: int) -> None:
        """Put the machine where a run is."""
        self.data.qpos[:] = self.session.state(run)[0]
        world.forward(self.model, self.data)

    def light(self) -> None:
        """Light the scene as a film does, over a floor with its grid."""
        scene = self.scene
        scene.world_axes.visible = False
        scene.configure_default_lights(enabled=False)
        scene.configure_environment_map(None)
        scene.add_light_ambient("/light/ambient", intensity=AMBIENT)
        for name, (intensity, place) in LIGHTS.items():
            scene.add_light_directional(f"/light/{name}", intensity=intensity, position=place)
        floors = self.model.geom_type == world.PLANE
        if floors.any():
            height = float(self.model.geom_pos[floors, 2].max())
        else:
            height = float(world.boxes(self.model, self.data)[..., 2].min())
        lines = 2.0 * world.floor_cell(self.size) * np.arange(-FLOOR_LINES, FLOOR_LINES + 1)
        ends = np.array([lines[0], lines[-1]])
        along_x = np.stack(np.broadcast_arrays(ends, lines[:, None], height), axis=-1)
        middle = self.points.mean(axis=0) * (1.0, 1.0, 0.0)
        scene.add_line_segments(
            "/floor",
            np.concatenate([along_x, along_x[..., [1, 0, 2]]]) + middle,
            style.rgb(style.GRID),
            thickness=2.0,
            thickness_units="screen",
        )

    def stand(self, beside: bool) -> None:
        """Put the second machine beside the first, of carts before it, or into it as its ghost."""
        step = np.zeros(3)
        if beside and self.carts is not None:
            step = self.carts[1]
        elif beside:
            step = APART * self.width * self.turn[:, 0]
        self.step = step
        for run, machine in enumerate(self.runs):
            machine.stand(run * step, beside)

    def place_camera(self, server: ViserServer) -> None:
        """Let tabs begin where a film's camera sees all machines."""
        points = np.concatenate([self.points + run * self.step for run in range(len(self.runs))])
        free = FREE * SIZE[0]
        room = camera.Room(free, free, SIZE[0] - free, SIZE[1] - free)
        place = camera.fit(points, self.turn, SIZE, room)
        self.distance = float((place - points.mean(axis=0)) @ self.turn[:, 2])
        self.middle = place - self.distance * self.turn[:, 2]
        first = server.initial_camera
        first.fov = np.radians(camera.FOVY)
        first.near, first.far = 0.02 * self.distance, 50.0 * self.distance
        first.position = place
        first.look_at = self.middle

    def fit_to(self, client: ClientHandle) -> None:
        """Move the camera of a tab that is higher than wide, such as a phone's, back."""
        aspect = client.camera.aspect
        if aspect < 1.0:
            distance = self.distance / aspect
            height = SIZE[1] * camera.pixel(SIZE) * distance
            middle = self.middle - UP * height * self.turn[:, 1]
            client.camera.position = middle + distance * self.turn[:, 2]
            client.camera.look_at = middle

    def push(self, force: float) -> None:
        """Push the first driven body to the right of the picture, with a peak in N."""
        names = [self.model.body(body).name for body in self.moved]
        body = next(filter(None, names), None)
        if body is None:
            raise ScenarioError('no body that moves has a name: give one, as <body name="arm">')
        self.pushed(body, force * self.turn[:, 0])

    def show(self) -> None:
        """Put all machines where their runs are."""
        for machine in self.runs:
            machine.show()


class MachineNodes:
    """The nodes of one run's machine in the scene."""

    def __init__(self, machines: Machines, run: int, colour: str):
        self.machines = machines
        self.run = run
        self.rgb = style.rgb(colour)
        self.frame = machines.scene.add_frame(f"/{run}", show_axes=False)
        self.bodies: dict[int, FrameHandle] = {}  # those that move
        self.meshes: list[tuple[MeshHandle, float]] = []  # with their own opacity
        self.between = np.zeros(machines.model.ngeom, bool)  # what films hide between two carts
        if machines.carts is not None and len(machines.colours) > 1:
            *beyond, _ = shared_picture.around(
                machines.model, machines.data, machines.links, machines.turn
            )
            self.between = beyond[run]
        self.add_bodies()
        self.name = machines.scene.add_label(
            f"/{run}/name",
            wording.law_name(machines.session.scenarios[run].law),
            position=machines.over,
            anchor="bottom-center",
        )
        self.control_arrows = self.add_arrows("u", self.rgb)
        self.push_arrows = self.add_arrows("push", style.rgb(style.DISTURBANCE))
        self.tendons = None
        if len(lines := tendon_lines(machines.model, machines.data)):
            colours = np.broadcast_to(style.rgb(style.INK), lines.shape)
            look = {"thickness": TENDON, "thickness_units": "screen"}
            self.tendons = machines.scene.add_line_segments(
                f"/{run}/tendons", lines, colours, **look
            )
        self.largest = 0.0  # |u| so far, which the longest arrow shows

    def add_bodies(self) -> None:
        """Add the shapes of all bodies."""
        model = self.machines.model
        data = self.machines.data
        painted = self.painted()
        for body in range(model.nbody):
            node = f"/{self.run}/{body}"
            place = {"position": data.xpos[body], "wxyz": data.xquat[body]}
            frame = self.machines.scene.add_frame(node, show_axes=False, **place)
            if model.body_weldid[body]:
                self.bodies[body] = frame
            for k, (rgba, mesh) in enumerate(
                body_meshes(model, body, self.machines.meshes, painted)
            ):
                handle = self.machines.scene.add_mesh_simple(
                    f"{node}/{k}", mesh.vertices, mesh.faces, color=np.array(rgba[:3])
                )
                self.meshes.append((handle, rgba[3]))
                if body in self.machines.moved and model.body(body).name:
                    handle.on_drag("left")(self.dragged(model.body(body).name))

    def add_arrows(self, name: str, rgb: tuple[int, int, int]) -> MeshHandle:
        """Add arrows of one colour, which `draw_arrows` draws."""
        nothing = np.zeros((3, 3))
        return self.machines.scene.add_mesh_simple(
            f"/{self.run}/{name}", nothing, np.array([[0, 1, 2]]), color=rgb, visible=False
        )

    def painted(self) -> Array:
        """Return the colour of each geom, (geoms, 4), with the law's where a film has it."""
        model = self.machines.model
        material = model.geom_matid
        stated = (material >= 0) & (model.geom_rgba == DEFAULT_RGBA).all(axis=1)
        paint = model.geom_rgba.copy()
        paint[stated] = model.mat_rgba[material[stated]]
        for geom in np.flatnonzero(material >= 0).tolist():
            paint[geom, :3] *= texture_colour(model, material[geom])
        paint[:, :3] = np.maximum(paint[:, :3], DARKEST)
        rgb = np.array(self.rgb) / 255
        paint[self.between, 3] = 0.0
        if self.machines.session.scenarios[0].plant.on_stage:
            paint[material == model.mat("accent").id, :3] = rgb
            return paint
        links = self.machines.links.copy()
        if len(self.machines.colours) == 1:
            links &= (paint == DEFAULT_RGBA).all(axis=1)
        paint[links, :3] = LAW_SHARE * rgb + (1.0 - LAW_SHARE) * paint[links, :3]
        return paint

    def dragged(self, body: str) -> Callable[[SceneNodeDragEvent], None]:
        """Return what the mouse does with a body: it is pushed when the button is let go, the way
        of the mouse, and by the weight of all that moves for a way as long as its size.
        """
        machines = self.machines

        def push(event: SceneNodeDragEvent) -> None:
            if event.phase == "end":
                way = np.subtract(event.end_position, event.start_position)
                machines.pushed(body, machines.weight / machines.size * way)

        return push

    def stand(self, place: Array, beside: bool) -> None:
        """Put the machine at a place, (3,) m; not beside the first, a second one is its ghost."""
        self.frame.position = place
        second_line = 0.0 if beside else self.run * LINE
        self.name.position = self.machines.over + second_line * self.machines.size * np.array(
            [0.0, 0.0, 1.0]
        )
        for mesh, opacity in self.meshes:
            seen = opacity if beside or not self.run else GHOST * opacity
            mesh.opacity = seen if seen < 1.0 else None

    def show(self) -> None:
        """Put the machine and its arrows where its run is."""
        self.machines.pose(self.run)
        for body, frame in self.bodies.items():
            frame.position = self.machines.data.xpos[body]
            frame.wxyz = self.machines.data.xquat[body]
        if self.tendons is not None:
            lines = tendon_lines(self.machines.model, self.machines.data)
            self.tendons.points = lines.astype(np.float32)
        draw_arrows(self.control_arrows, self.controls())
        draw_arrows(self.push_arrows, self.pushes())

    def controls(self) -> list[Line]:
        """Return the lines of the arrows of u, as a film has them; of what flies, and of a network,
        none.
        """
        session = self.machines.session
        log = session.log(self.run)
        plant = session.scenarios[self.run].plant
        if not len(log) or plant.pose or arrows.is_network(plant):
            return []
        applied = np.nan_to_num(log[-1]["applied"])
        self.largest = max(self.largest, float(np.abs(applied).max(initial=0.0)))
        lines = []
        for mount, u in zip(self.machines.mounts, applied.tolist(), strict=True):
            if abs(u) > arrows.MIN_LENGTH * self.largest:
                arrow = arrows.Arrow(0.0, u / self.largest, arrows.WHITE)
                lines.append(self.line(mount, arrow))
        return [line for line in lines if line]

    def pushes(self) -> list[Line]:
        """Return the lines of the arrows of pushes that are over for less than a moment."""
        session = self.machines.session
        lines = []
        for push in session.scenarios[self.run].disturbance:
            if isinstance(push, Push) and 0.0 <= session.time - push.time < PUSH_SEEN:
                force = np.array([push.x, push.y, push.z])
                way = force / np.linalg.norm(force)
                arrow = arrows.Arrow(0.0, 1.0, arrows.WHITE, way=way, body=push.body)
                lines.append(self.line(self.machines.mounts[0], arrow))
        return [line for line in lines if line]

    def line(self, mount: arrow_lines.Mount, arrow: arrows.Arrow) -> Line | None:
        """Return the line of an arrow, and its width, m."""
        return arrow_lines.path(self.machines.model, self.machines.data, mount, arrow)


def texture_colour(model: mujoco.MjModel, material: int) -> Array:
    """Return the mean of a material's texture, red, green and blue, 0 .. 1; 1 where it has none."""
    texture = model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB]
    if texture < 0:
        return np.ones(3)
    channels = model.tex_nchannel[texture]
    size = model.tex_height[texture] * model.tex_width[texture] * channels
    first = model.tex_adr[texture]
    texels = model.tex_data[first : first + size].reshape(-1, channels)
    return np.resize(texels.mean(axis=0), 3) / 255  # a grey one has one channel


def not_shown(model: mujoco.MjModel) -> str:
    """Return a sentence on what a model has and the page does not show; "" if it shows all."""
    drawn = (model.geom_group < world.DRAWN_GROUPS) & (model.geom_type != world.PLANE)
    materials = model.geom_matid[drawn & (model.geom_matid >= 0)]
    textured = (model.mat_texid[materials] >= 0).any()
    names = []
    for name, has in (("skins", model.nskin), ("flexible bodies", model.nflex)):
        if has:
            names.append(name)
    words = []
    if names:
        words.append(f"Not shown: {' and '.join(names)}.")
    if textured:
        words.append("Textures are shown as their mean colour.")
    return " ".join(words)


def tendon_lines(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Return the pieces of tendons through space, (pieces, 2, 3) m, between the sites and pulleys
    that they pass and the shapes around which they lie.
    """
    pieces = [np.zeros((0, 2, 3))]
    sides = data.wrap_xpos.reshape(-1, 3)
    passed = data.wrap_obj.ravel()
    for tendon in np.flatnonzero(model.tendon_group < world.DRAWN_GROUPS).tolist():
        first = data.ten_wrapadr[tendon]
        for k in range(first, first + data.ten_wrapnum[tendon] - 1):
            if passed[k] != PULLEY and passed[k + 1] != PULLEY:
                pieces.append(sides[None, k : k + 2])
    return np.concatenate(pieces)


def draw_arrows(handle: MeshHandle, lines: Sequence[Line]) -> None:
    """Draw arrows along lines, or none."""
    handle.visible = bool(lines)
    if lines:
        mesh = joined([arrow_mesh(*line) for line in lines])
        handle.vertices = mesh.vertices.astype(np.float32)
        handle.faces = mesh.faces.astype(np.uint32)
