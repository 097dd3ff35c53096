"""Encoding of a film by ffmpeg, which is a process of its own."""

import contextlib
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import numpy as np

from smc_mujoco.common import extras
from smc_mujoco.common.errors import ScenarioError

# Clean on a slide at about 1 MB for 10 s; half the time of x264's default preset, and no larger
# files. All are chosen.
CODEC = {"codec": "h264", "crf": 21, "ffmpeg_args": "-preset veryfast -movflags +faststart"}


@contextlib.contextmanager
def encoder(
    path: Path, shape: tuple[int, int], fps: float
) -> Iterator[Callable[[np.ndarray], None]]:
    """Yield a function that adds a picture (height, width, 3) to a film, .mp4.

    The film is whole afterwards.

    Ctrl-C raises KeyboardInterrupt here. The terminal sends it to ffmpeg too, which must not end
    first.
    """
    writer = mediapy().VideoWriter(path, shape, encoded_format="yuv420p", fps=fps, **CODEC)
    try:
        with sigint_blocked():
            writer.__enter__()
        with contextlib.closing(writer):
            yield writer.add_image
    except (OSError, RuntimeError) as error:
        if isinstance(error.__context__, KeyboardInterrupt):  # ffmpeg complains of half a picture
            raise KeyboardInterrupt from None
        words = " ".join(str(error).split())
        raise ScenarioError(f"cannot write mp4: {words}") from error


def mediapy() -> ModuleType:
    """Return mediapy, with the ffmpeg of imageio_ffmpeg."""
    with extras.extra("film", "a film"):
        import imageio_ffmpeg
        import mediapy as module

    module.set_ffmpeg(imageio_ffmpeg.get_ffmpeg_exe())
    return module


@contextlib.contextmanager
def sigint_blocked() -> Iterator[None]:
    """Block SIGINT: a process started meanwhile never receives it, and this one receives it
    afterwards.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
