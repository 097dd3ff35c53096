"""Films: the machines of all traces side by side in MuJoCo, in real time, above charts that grow with the clock.

Control and disturbance are arrows at the machine: the mean over the frame, and behind the control's a bar for its range,
so that a control which switches faster than the film shows how far it swings.
"""

import contextlib
import functools
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from smc_mujoco import caption, gl, panels, style
from smc_mujoco.charts import Charts
from smc_mujoco.envelope import Envelope, samples, windows
from smc_mujoco.errors import ScenarioError
from smc_mujoco.files import replacing
from smc_mujoco.stage import SHOWN, Arrow, Room, Stage
from smc_mujoco.trace import Trace

FPS = 30.0
MOST = 8  # machines: more are too small to tell apart
WIDE = 1280  # px, the width that sizes of letters are stated for
SHARE = 0.36  # of the height, for the charts
CRF = 21  # of x264, chosen: clean on a slide at about 1 MB for 10 s
Report = Callable[[int], None]


def film(
    traces: Sequence[Trace],
    path: str | os.PathLike,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: tuple[int, int] = (1280, 720),
    fps: float = FPS,
    report: Report = lambda frames: None,
) -> Path:
    """Write an .mp4 of traces of one plant, from t = 0 to the end of the longest.

    Args:
      labels: one a trace; default: the laws' names.
      title: default: the plant's name.
      size: width and height in px, even.
      report: called with the number of frames written since its last call.

    Raises:
      ScenarioError: nothing to show, a size that cannot be, or no OpenGL to render with.
    """
    import imageio_ffmpeg
    import mediapy

    path = Path(path)
    if path.suffix != ".mp4":
        raise ScenarioError(f"cannot film to {path.name!r}: end the name in .mp4")
    times = clock(traces, fps)
    pictures = frames(traces, times, labels, title, size)
    mediapy.set_ffmpeg(imageio_ffmpeg.get_ffmpeg_exe())
    with replacing(path) as part, contextlib.closing(pictures):
        first = next(pictures)
        options = {"codec": "h264", "encoded_format": "yuv420p", "crf": CRF, "fps": fps}
        with mediapy.VideoWriter(
            part, first.shape[:2], **options, ffmpeg_args="-movflags +faststart"
        ) as writer:
            writer.add_image(first)
            report(1)
            for picture in pictures:
                writer.add_image(picture)
                report(1)
    return path


def clip(
    traces: Sequence[Trace],
    path: str | os.PathLike,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    span: tuple[float, float] = (0.0, 4.0),
    size: tuple[int, int] = (800, 450),
    fps: float = 20.0,
    report: Report = lambda frames: None,
) -> Path:
    """Write an animated .webp of the span from .. to in s: small, and shown by web pages as an image. Else as `film`."""
    path = Path(path)
    if path.suffix != ".webp":
        raise ScenarioError(f"cannot write a clip to {path.name!r}: end the name in .webp")
    times = clock(traces, fps)
    times = times[(times >= span[0]) & (times <= span[1])]
    if not 0 < len(times) <= 600:
        raise ScenarioError(
            f"a clip of {span[0]:g} .. {span[1]:g} s has {len(times)} frames: give a span with 1 to 600"
        )
    pictures = []
    for picture in frames(traces, times, labels, title, size):
        pictures.append(Image.fromarray(picture))
        report(1)
    ends = [round(1000 / fps)] * (len(times) - 1) + [
        1200
    ]  # ms; the last picture stays before it starts again
    with replacing(path) as part:
        pictures[0].save(
            part, save_all=True, append_images=pictures[1:], duration=ends, loop=0, quality=60, method=4
        )
    return path


def still(
    traces: Sequence[Trace],
    time: float,
    path: str | os.PathLike,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: tuple[int, int] = (1280, 720),
) -> Path:
    """Write the frame at `time` in s as a .png. Else as `film`."""
    path = Path(path)
    if path.suffix != ".png":
        raise ScenarioError(f"cannot write a picture to {path.name!r}: end the name in .png")
    with (
        contextlib.closing(frames(traces, np.array([time]), labels, title, size)) as pictures,
        replacing(path) as part,
    ):
        Image.fromarray(next(pictures)).save(part, optimize=True)
    return path


def clock(traces: Sequence[Trace], fps: float) -> np.ndarray:
    """The times of a film's frames, s: 0, 1/fps, ... until the longest trace ends."""
    style.same_plant(traces)
    if not 1.0 <= fps <= 120.0:
        raise ScenarioError(f"fps is {fps:g}: give 1 to 120")
    return np.arange(int(max(trace.t[-1] for trace in traces) * fps + 1e-6) + 1) / fps


def frames(
    traces: Sequence[Trace],
    times: np.ndarray,
    labels: Sequence[str] | None,
    title: str | None,
    size: tuple[int, int],
) -> Iterator[np.ndarray]:
    """The film's pictures at the given times, each (height, width, 3) uint8."""
    names, colours = style.labels(style.same_plant(traces), labels), style.colours(traces)
    if len(traces) > MOST:
        raise ScenarioError(f"{len(traces)} machines in one film: show at most {MOST}")
    if any(
        side % 2 or not low <= side <= high
        for side, low, high in zip(size, (320, 180), (1920, 1080), strict=True)
    ):
        raise ScenarioError(f"size is {size}: give even numbers from (320, 180) to (1920, 1080)")
    if why := gl.missing():
        raise ScenarioError(why)
    scale = (size[0] / WIDE) ** 0.6  # letters shrink less than pictures
    below = 2 * round(SHARE * size[1] / 2)
    stage_size = size[0], size[1] - below
    gap = 1.0 / 30 if len(times) < 2 else times[1] - times[0]
    acts = [acting(trace, times, gap) for trace in traces]
    longest = strongest(traces, "applied"), strongest(traces, "d")
    words = Words(traces, names, colours, title, stage_size, scale, longest)
    charts = Charts(traces, colours, (size[0], below), scale)
    with Stage(traces, colours, stage_size, words.room) as stage:
        words.put(stage.boxes)
        places = [positions(trace, times)[:, :n] for trace, n in zip(traces, stage.shown, strict=True)]
        for f, time in enumerate(times):
            failed = tuple(t.diverged_at is not None and time >= t.diverged_at for t in traces)
            arrows = []
            for k, (control, disturbance) in enumerate(acts):
                stage.pose(k, places[k][f])
                stage.paint(k, style.FAILED if failed[k] else colours[k])
                if not failed[k]:
                    arrows += pushes(k, stage.shown[k], f, control, disturbance, longest, colours[k])
            top = words.over(stage.render(arrows), float(time), failed)
            yield np.concatenate([top, charts.at(float(time))])


def strongest(traces: Sequence[Trace], name: str) -> float:
    """The largest control or disturbance of the runs that lasted; where none did, of all but their ends."""
    return max(map(abs, panels.span(traces, name)))


def positions(trace: Trace, times: np.ndarray) -> np.ndarray:
    """x at the times, (times, n), between samples on a straight line; after a failure the last finite one."""
    n = samples(trace)
    return np.stack([np.interp(times, trace.t[:n], x) for x in trace.x[:n].T], axis=1)


def acting(trace: Trace, times: np.ndarray, gap: float) -> tuple[Envelope, Envelope]:
    """Control as the actuator gets it, and disturbance, over the `gap` seconds before each time."""
    n, edges = samples(trace), np.concatenate([[times[0] - gap], times])
    return windows(trace.t[:n], trace.applied[:n], edges), windows(trace.t[:n], trace.d[:n], edges)


def pushes(
    k: int,
    shown: int,
    f: int,
    control: Envelope,
    disturbance: Envelope,
    longest: tuple[float, float],
    colour: str,
) -> list[Arrow]:
    """The arrows of machine k in frame f."""
    law = tuple(c / 255 for c in style.rgb(colour))
    grey = tuple(c / 255 for c in style.rgb(style.DISTURBANCE))
    arrows = []
    for i in range(shown):
        low, mean, high = (
            float(part[f, i]) / (longest[0] or 1.0) for part in (control.low, control.mean, control.high)
        )
        arrows.append(Arrow(k, i, 0.0, mean, (*law, 1.0), 0))
        if high - low > 0.1:
            arrows.append(Arrow(k, i, low, high, (*law, 0.4), 0, head=False))
        if longest[1] > 0.0:
            arrows.append(Arrow(k, i, 0.0, float(disturbance.mean[f, i]) / longest[1], (*grey, 1.0), 1, 0.65))
    return arrows


class Words:
    """All that is written over the stage; `room` is what it leaves to the machines."""

    def __init__(self, traces, names, colours, title, size, scale, longest):
        self.traces, self.names, self.colours, self.size, self.scale = traces, names, colours, size, scale
        self.title = title or style.plant_name(traces[0])
        unit = style.units(traces[0])["u"]
        self.key = f"coloured arrow: control, longest {longest[0]:.2g} {unit}"
        if longest[1] > 0.0:
            self.key += f"     dark arrow: disturbance, longest {longest[1]:.2g} {unit}"
        hidden = [t.scenario.plant.n for t in traces if t.scenario.plant.n > SHOWN]
        if hidden:
            self.key += f"     the first {SHOWN} of {max(hidden)} pendulums"
        x, y, _ = traces[0].scenario.plant.lane
        side, below = 40 * scale, 52 * scale
        if abs(y) > abs(x):  # behind each other: the labels stand at the left
            side, below = (
                max(caption.pill_size(text, 15 * scale)[0] for text in self.texts()) + 30 * scale,
                20 * scale,
            )
        self.room = Room(side, 84 * scale, size[0] - 40 * scale, size[1] - below)

    def texts(self, failed: Sequence[bool] = ()) -> list[str]:
        """The labels; of machines that failed, or of all that will when `failed` is not given, with the time."""
        failed = failed or [True] * len(self.traces)
        return [
            f"{name}: diverged at {t.diverged_at:.2f} s" if gone and t.diverged_at is not None else name
            for name, t, gone in zip(self.names, self.traces, failed, strict=True)
        ]

    def put(self, boxes: np.ndarray) -> None:
        """Find the labels' places, with the longest texts that they will have."""
        self.centres = caption.place(boxes, self.texts(), 15 * self.scale, self.size)

    @functools.lru_cache(maxsize=2)  # noqa: B019  # one film long
    def sheet(self, failed: tuple[bool, ...]) -> Image.Image:
        """Everything but the clock."""
        sheet = Image.new("RGBA", self.size, (255, 255, 255, 0))
        draw, s = ImageDraw.Draw(sheet), self.scale
        draw.text((24 * s, 16 * s), self.title, fill=style.INK, font=caption.font(24 * s, bold=True))
        draw.text((25 * s, 48 * s), self.key, fill=style.MUTED, font=caption.font(13 * s))
        for text, colour, centre, gone in zip(
            self.texts(failed), self.colours, self.centres, failed, strict=True
        ):
            caption.draw_pill(draw, caption.Pill(text, style.FAILED if gone else colour, centre), 15 * s)
        return sheet

    def over(self, picture: np.ndarray, time: float, failed: tuple[bool, ...]) -> np.ndarray:
        """The picture with the words on it."""
        image, sheet, s = Image.fromarray(picture), self.sheet(failed), self.scale
        image.paste(sheet, mask=sheet)
        where = self.size[0] - 24 * s, 16 * s
        ImageDraw.Draw(image).text(
            where, f"{time:.2f} s", style.INK, caption.font(24 * s, bold=True), anchor="ra"
        )
        return np.asarray(image)
