"""Films: the machines of all traces in MuJoCo, each in its tile, above charts that grow with the
clock.

In order: pace.py sets the speed; track.py says what each run does at each frame; camera.py lays out
the tiles, or shared_picture.py carts on one; viewpoint.py finds the side from which a user's
machine is seen; world.py composes a machine's model, puppet.py poses it, stage.py adds the arrows
of arrows.py (arrow_lines.py says where they lie, flat_arrows.py paints them), and canvas.py
renders; arm.py draws over arms and what flies; sheet.py is the page with the text and the charts,
made as figures are; video.py writes.
Frames are made and written one by one, so that memory does not grow with a film's length.
"""

import contextlib
import dataclasses
import functools
import itertools
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, overload

import numpy as np
from matplotlib import rc_context
from PIL import Image

from smc_mujoco.common import errors, extras, gl, mjcb
from smc_mujoco.common.aliases import AnyPath, Array, Pair
from smc_mujoco.common.errors import ScenarioError, items_of, number
from smc_mujoco.common.files import clear_abandoned, replacing, with_ending
from smc_mujoco.common.progress import Bar, bar
from smc_mujoco.draw import horizon, shared_axes, style
from smc_mujoco.draw.decimate import end
from smc_mujoco.draw.figure import DrawnRuns
from smc_mujoco.draw.film import arrows, camera, pace, shared_picture
from smc_mujoco.draw.film.camera import Camera, checked
from smc_mujoco.draw.film.pace import FilmClock
from smc_mujoco.draw.film.puppet import Course, Puppet
from smc_mujoco.draw.film.sheet import (
    STATE_HEIGHT,
    Moment,
    Sheet,
    head_lines,
    label_sizes,
    letters,
    room_of,
)
from smc_mujoco.draw.film.stage import Stage
from smc_mujoco.draw.film.track import MachineTrack
from smc_mujoco.draw.film.video import encoder, mediapy
from smc_mujoco.metrics.conventions import ChannelGroup
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.trace import Trace

if TYPE_CHECKING:
    from mediapy import VideoMetadata

    from smc_mujoco.draw.film import arm

FPS = 30.0
WEBP_FPS = 20.0
MAX_WEBP_FRAMES = 600
MAX_MACHINES = 8  # more are too small to tell apart
MIN_SIZE = (320, 180)  # px
MAX_SIZE = (1920, 1080)
FULL_SIZE = (1280, 720)  # for which sizes of letters are stated
SMALL_SIZE = (800, 450)
MAX_GRID = 120  # times of a run that set the place of all; chosen
LAST_FRAME_TIME = 1200  # ms for which a clip's last picture stays before the clip repeats


@dataclasses.dataclass(repr=False, eq=False)
class Frames:
    """Pictures of a film, each (height, width, 3) uint8.

    They are made while you iterate, as often as you do.

    `mediapy.show_video` and `mediapy.write_video` take them as they are;
    `numpy.stack(list(frames))` is an array. `clock` has the times of the run at each picture, s.
    Arguments: as `film`.

    Raises:
      ScenarioError: as `film`; those of size and OpenGL are raised at the first picture.
    """

    traces: Trace | Sequence[Trace]
    labels: Sequence[str] | None = None
    title: str | None = None
    size: tuple[int, int] = SMALL_SIZE
    fps: float = FPS
    speed: float | None = None
    camera: Camera | None = None
    at: float | None = None
    span: Pair | None = None

    def __post_init__(self) -> None:
        self.camera = checked(self.camera)
        if self.at is not None:
            last = end(shared_axes.traces_of_one_plant(self.traces))
            time = number("at", self.at, low=0.0, high=last + 1e-9)
            self.clock = pace.clock(self.traces, self.fps, self.speed).still(time)
        else:
            self.clock = pace.clock(self.traces, self.fps, self.speed)
        if self.span is not None:
            ends = items_of("span", self.span)
            if len(ends) != 2:
                raise ScenarioError(f"span is {errors.shown(self.span)}: give two times, in s")
            start = number("span", ends[0])
            stop = number("span", ends[1])
            self.clock = self.clock.part(start, stop)
            if not len(self):
                raise ScenarioError(
                    f"a film of {start:g} .. {stop:g} s has no frames: give a span within the runs"
                )

    def __len__(self) -> int:
        close = self.clock.close
        return len(self.clock.times) + (len(close.times) if close else 0)

    def __iter__(self) -> Generator[Array]:
        return pictures(self)

    def __repr__(self) -> str:
        return f"Frames({len(self)} of {self.size[0]} x {self.size[1]} px, {self.fps:g} a second)"

    @property
    def metadata(self) -> "VideoMetadata":
        """The playback speed, which mediapy reads here.

        It also gets the ffmpeg of imageio_ffmpeg.
        """
        width, height = self.size
        return mediapy().VideoMetadata(len(self), (height, width), self.fps, None)


@overload
def film(
    traces: Trace | Sequence[Trace],
    path: AnyPath,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: tuple[int, int] | None = None,
    fps: float | None = None,
    speed: float | None = None,
    camera: Camera | None = None,
    *,
    at: float | None = None,
    span: Pair | None = None,
) -> Path: ...


@overload
def film(
    traces: Trace | Sequence[Trace],
    path: None = None,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: tuple[int, int] | None = None,
    fps: float | None = None,
    speed: float | None = None,
    camera: Camera | None = None,
    *,
    at: float | None = None,
    span: Pair | None = None,
) -> Frames: ...


def film(
    traces: Trace | Sequence[Trace],
    path: AnyPath | None = None,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: tuple[int, int] | None = None,
    fps: float | None = None,
    speed: float | None = None,
    camera: Camera | None = None,
    *,
    at: float | None = None,
    span: Pair | None = None,
) -> Path | Frames:
    """Film traces of one plant, from t = 0 to the end of the longest, and return the path of the
    file.

        trace = smc.run(smc.Scenario(plant="duffing", law="pid", duration=1.0))
        smc.film(trace, "duffing.png", at=0.5)

    Fast motion and blows are shown in slow motion, and rest is shown faster. The clock tells the
    speed. The progress of writing is shown on stderr: as a bar on a terminal, elsewhere as a line
    each ten seconds.

    Args:
      traces: several, or a single one.
      path: its ending tells what is written: .mp4, a film; .webp, an animated picture that web
        pages show as an image; .png, the picture at the time `at`. None writes nothing, and returns
        the pictures for other packages, `Frames`.
      labels: one a trace; default: the laws' labels, with what differs between runs of one law.
      title: None for the plant's name, and the condition if all traces have one; "" for no title.
      size: width and height in px, even. Default: 1280 x 720, and 800 x 450 for .webp and `Frames`.
      fps: frames a second; default: 30, and 20 for .webp.
      speed: of playback, such as 1 for real time or 0.25; default: 1, 1/2, 1/4 or 1/8
        by how fast things move, 1/8 at blows, and 4 where all rests.
      camera: name of a camera of the model, or (azimuth, elevation) in degrees as of MuJoCo's free
        camera. It gives the direction of the view, and the camera is as near as it can see all
        machines. Default: the plant's own `look`. For your own model: its first camera that does
        not move, if that shows at least half of what the driven joints do; else across the plane in
        which they turn, from a side on which other parts hide least of them.
      at: the time of a single picture, s.
      span: the part of the runs that is shown, (start, stop) in s; default: all, and the first 4 s
        for .webp.

    Returns:
      The path of the file; without a path the pictures, `Frames`.

    Raises:
      ScenarioError: nothing to show, a size that is odd or too small or large, another ending, or
        no OpenGL to render with.
    """
    if path is None:
        ending = ""
    else:
        ending = with_ending(path, *WRITERS).suffix
    if path is not None and (ending == ".png") != (at is not None):
        raise ScenarioError(
            "the picture at a time is a .png: give at, in s, with a path that ends in .png"
        )
    if at is not None and span is not None:
        raise ScenarioError(
            "at and span exclude each other: give at for a picture, or span for a film"
        )
    if fps is None:
        fps = WEBP_FPS if ending == ".webp" else FPS
    if ending == ".webp" and span is None:
        span = (0.0, 4.0)
    if size is None:
        size = SMALL_SIZE if ending in ("", ".webp") else FULL_SIZE
    frames = Frames(traces, labels, title, size, fps, speed, camera, at, span)
    if path is None:
        return frames
    return write_film(frames, Path(path))


def write_film(frames: Frames, path: Path, between: Callable[[], object] = bool) -> Path:
    """Write frames to a file, as its ending tells, and return its path. `between` is called
    between pictures, and may raise; then there is no file.
    """
    images = pictures(frames, ahead=True, between=between)
    clear_abandoned(path)
    with replacing(path) as part, contextlib.closing(images), bar("film", len(frames)) as progress:
        WRITERS[path.suffix](frames, _counted(images, progress, between), part)
    return path


def _counted(
    made: Iterator[Array], progress: Bar, between: Callable[[], object]
) -> Iterator[Array]:
    for picture in made:
        yield picture
        progress.advance(1)
        between()


def _write_mp4(frames: Frames, made: Iterator[Array], part: Path) -> None:
    first = next(made)
    with encoder(part, first.shape[:2], frames.fps) as write_frame:
        for picture in itertools.chain([first], made):
            write_frame(picture)


def _write_webp(frames: Frames, made: Iterator[Array], part: Path) -> None:
    count = len(frames)
    if count > MAX_WEBP_FRAMES:
        raise ScenarioError(
            f"a .webp of {count} frames: give a span with at most {MAX_WEBP_FRAMES}, or an .mp4"
        )
    images = list(map(Image.fromarray, made))
    ends = [round(1000 / frames.fps)] * (count - 1) + [LAST_FRAME_TIME]
    images[0].save(
        part, save_all=True, append_images=images[1:], duration=ends, loop=0, quality=75, method=4
    )


def _write_png(frames: Frames, made: Iterator[Array], part: Path) -> None:
    first = Image.fromarray(next(made))
    first.save(part, optimize=True)


WRITERS = {".mp4": _write_mp4, ".webp": _write_webp, ".png": _write_png}


def missing_for_film() -> str | None:
    """Return None if a film can be written, else one sentence that says why not and what to do."""
    return gl.missing_renderer() or extras.missing_extra(
        "film", "no film: it", "mediapy", "imageio_ffmpeg"
    )


def _checked_size(size: Iterable[int]) -> tuple[int, int]:
    """Return width and height of a film; refuse odd ones, and those out of range."""
    sides = items_of("size", size)
    fit = len(sides) == 2
    for side, low, high in zip(sides, MIN_SIZE, MAX_SIZE, strict=False):
        is_integer = isinstance(side, int | np.integer)
        fit &= is_integer and low <= side <= high and side % 2 == 0
    if not fit:
        cure = f"two even numbers from {MIN_SIZE} to {MAX_SIZE}"
        raise ScenarioError(f"a film of {errors.shown(size)} px: give {cure}")
    return int(sides[0]), int(sides[1])


def pictures(
    frames: Frames, ahead: bool = False, between: Callable[[], object] = bool
) -> Generator[Array]:
    """Yield the pictures of a film at the times of its clock, each (height, width, 3) uint8; with
    `ahead` while the next one is drawn.

    What comes before the first one takes seconds for a robot with meshes. `between` is called
    between its steps, and may raise.
    """
    with rc_context({"axes.facecolor": style.PAPER}):  # whatever the caller's page
        runs = DrawnRuns.of(frames.traces, frames.labels)
    size = _checked_size(frames.size)
    if len(runs.traces) > MAX_MACHINES:
        raise ScenarioError(f"{len(runs.traces)} machines in one film: show at most {MAX_MACHINES}")
    if why := gl.missing_renderer():
        raise ScenarioError(why)
    clock = frames.clock
    scales = arrows.scales(runs.traces)
    tracks = tracks_at(clock, runs, scales)
    between()
    keys = [arrows.scale_words(runs.traces, scales)]
    if clock.close:
        keys.append([f"last periods, deflections × {clock.close.factor:g}"])
    lines = head_lines(runs, size, frames.title, keys)
    with mjcb.uncached():  # the renderers will need that memory
        placed = placement(tracks, frames.camera, runs.names, size, lines)
        order = ""
        if placed.lanes is not None:
            order = "back to front"
            ordered = [[*key, order] for key in keys]
            lines = head_lines(runs, size, frames.title, ordered)
            placed = placement(tracks, frames.camera, runs.names, size, lines)
        between()
        stages = list(staged(tracks, placed, clock.times))
    arguments = size, placed.tiles, placed.labels, frames.title
    sheet = Sheet(runs, *arguments, keys[0], lines=lines, order=order)
    between()
    with contextlib.ExitStack() as opened:
        for stage in stages:
            opened.enter_context(stage)
            between()
        shots = separate_shots
        if placed.lanes is not None:
            shared_picture.hide_between(stages)
            shots = shared_picture.shots
        overlays = []
        if runs.traces[0].scenario.plant.has_path:
            from smc_mujoco.draw.film import arm

            overlays = arm.overlays(stages)
        yield from drawn(clock, stages, shots, overlays, sheet, ahead)
        if close := clock.close:
            start = float(close.times[0])
            last = _since(runs, start)
            sheet = Sheet(last, *arguments, keys[-1], start, lines, order)
            for stage, track in zip(stages, tracks_at(close, runs, scales), strict=True):
                middle = track.x.mean(axis=0)
                larger = close.factor * (track.x - middle)
                track.x = middle + larger
                stage.track = track
            yield from drawn(close, stages, shots, overlays, sheet, ahead)


def _since(runs: DrawnRuns, start: float) -> DrawnRuns:
    """Return runs from a time on, s, with all of them in sight."""
    closing = [horizon.since(trace, start) for trace in runs.traces]
    stop = end(closing)
    return runs._replace(traces=closing, span=(stop, stop))


def tracks_at(
    clock: FilmClock, runs: DrawnRuns, scales: Mapping[ChannelGroup, arrows.Scale]
) -> list[MachineTrack]:
    """Return what the runs do at the frames of a clock."""
    stop = runs.span[1]
    count = max(1, round(FPS * stop))
    samples = 1 + min(MAX_GRID, count)
    grid = np.linspace(0.0, stop, samples)  # also for a still
    tracks = []
    for trace, colour in zip(runs.traces, runs.colours, strict=True):
        tracks.append(MachineTrack(trace, colour, clock, grid, scales))
    return tracks


def separate_shots(stages: Sequence[Stage], frame: int, time: float) -> list[Array]:
    """Return the picture of each machine at a frame, whose time is given, s."""
    return [stage.shot(frame, time) for stage in stages]


def drawn(
    clock: FilmClock,
    stages: Sequence[Stage],
    shots: Callable[[Sequence[Stage], int, float], list[Array]],
    overlays: Sequence["arm.Overlay"],
    sheet: Sheet,
    ahead: bool,
) -> Generator[Array]:
    """Yield the pictures at the times of a clock; `ahead` draws the page of one, on a second core,
    beside the machines of the next one.
    """
    waiting: deque[Future[Array]] = deque()
    with ThreadPoolExecutor(1) as second_core:
        for moment, machines in machines_at(clock, stages, shots, overlays):
            waiting.append(second_core.submit(sheet.picture, moment, machines))
            if len(waiting) > ahead:
                yield waiting.popleft().result()
        for page in waiting:
            yield page.result()


def machines_at(
    clock: FilmClock,
    stages: Sequence[Stage],
    shots: Callable[[Sequence[Stage], int, float], list[Array]],
    overlays: Sequence["arm.Overlay"],
) -> Iterator[tuple[Moment, list[Array]]]:
    """Yield what the page says at each time of a clock, and the pictures of the machines."""
    for frame, time in enumerate(clock.times.tolist()):
        machines = shots(stages, frame, time)
        for k, over in enumerate(overlays):
            machines[k] = over.over(machines[k], frame)
        states = [stage.track.states[frame] for stage in stages]
        yield Moment(time, float(clock.speeds[frame]), states, len(clock.times) == 1), machines


class Placement(NamedTuple):
    """Where the machines of a film stand: the puppets, their tiles and labels, (machines, 4) px,
    the view of each, the points that it shows, their courses if the camera follows them, and their
    places if they share one picture, as of `shared_picture.places`.
    """

    puppets: Sequence[Puppet]
    tiles: Array
    labels: Array
    view: camera.View
    points: Array
    scale: float
    followed: Sequence[Course] = ()
    lanes: Array | None = None


def placement(
    tracks: Sequence[MachineTrack],
    chosen: Camera | None,
    names: Sequence[str],
    size: tuple[int, int],
    lines: int = 2,
) -> Placement:
    """Return where machines stand in a film of some size, px, before the chosen camera, below so
    many lines of words.
    """
    models.forget_large()  # a film has models of its own
    puppets = [Puppet.of(track.trace.scenario) for track in tracks]
    turn = puppets[0].turn(chosen)
    courses = []
    for track, puppet in zip(tracks, puppets, strict=True):
        courses.append(puppet.course(track))
    followed = any(map(Puppet.travels, puppets, courses))
    reaches = []
    for i, track in enumerate(tracks):
        reach, puppets[i] = puppets[i].placed(track, courses[i], followed, turn[:, 2])
        reaches.append(reach)
    points = np.concatenate(reaches)
    if not followed:  # all stand on one floor, on stands that are cut alike
        reaches = []
        for i, puppet in enumerate(puppets):
            reach, puppets[i] = puppet.surrounded(points, courses, turn)
            reaches.append(reach)
        points = np.concatenate(reaches)
    sizes = functools.partial(label_sizes, names, size)
    room = room_of(size, lines)
    words = STATE_HEIGHT * letters(size) if any(track.speaks for track in tracks) else 0.0
    many_machines = len(tracks) > 1  # the name of one has room below it, where no chart is as wide
    tiles, labels, view = camera.layout(
        len(tracks), room, sizes, points, turn, many_machines, words
    )
    lanes = shared_picture.places(puppets, turn)
    if lanes is not None:
        points_of_lanes = np.concatenate([points + place for place in lanes])
        shared = shared_picture.layout(len(tracks), room, sizes, points_of_lanes, turn, words)
        if camera.magnification(shared[2], points_of_lanes) > camera.magnification(view, points):
            tiles, labels, view = shared
            points = points_of_lanes
            puppets = list(map(shared_picture.in_line, puppets))
        else:
            lanes = None
    scale = size[0] / FULL_SIZE[0]
    ways = courses if followed else ()
    return Placement(puppets, tiles, labels, view, points, scale, ways, lanes)


def staged(tracks: Sequence[MachineTrack], placed: Placement, times: Array) -> Iterator[Stage]:
    """Yield the stages of machines, one after the other."""
    missed = np.array([track.missed for track in tracks])
    widened = np.zeros((len(tracks), 1, 3))
    if placed.followed and missed.size:
        widened = camera.widened(placed.view, placed.points, missed)
    for k, track in enumerate(tracks):
        puppet = placed.puppets[k]
        path = None
        if placed.followed:
            raised = np.array([0.0, 0.0, puppet.height])
            path = placed.followed[k].followed(times) + raised + widened[k]
        alone = len(tracks) == 1
        beside = 0.0 if placed.lanes is None else placed.lanes[k]
        yield Stage(track, puppet, placed.view, placed.points, placed.scale, alone, path, beside)
