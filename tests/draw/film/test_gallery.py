"""The clips of the gallery are what the code would make today: of each, a few pictures are made
anew.
"""

import io
from pathlib import Path

import numpy as np
import pytest
from helpers.sources import loaded
from PIL import Image

from smc_mujoco.common import gl

BLOCK = 15  # px
# of 255, of the mean of a block: clips differ by up to 5; letters 4 px off, by 34
MAX_DIFFERENCE = 14.0
gallery = loaded(Path(__file__).parents[3] / "videos" / "gallery.py")


def blocks(picture):
    """Return the mean of each block of a picture, (rows, columns, 3)."""
    height, width = (size - size % BLOCK for size in picture.shape[:2])
    return (
        picture[:height, :width]
        .reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3)
        .mean(axis=(1, 3))
    )


# that with contacts and four bodies; the others take as long each, and run with the slow tests
CLIPS = ["hard_stops"]
for clip_name in sorted(set(gallery.CLIPS) - {"hard_stops"}):
    CLIPS.append(pytest.param(clip_name, marks=pytest.mark.slow))


def as_kept(picture):
    """Return a picture as WebP keeps it, which spreads the colour of violet letters, (height,
    width, 3).
    """
    file = io.BytesIO()
    Image.fromarray(picture).save(file, "WEBP", quality=75, method=4)
    with Image.open(file) as clip:
        return np.asarray(clip.convert("RGB"), float)


@pytest.mark.quick
def test_each_file_is_a_clip():
    assert {path.stem for path in gallery.FOLDER.iterdir()} == set(gallery.CLIPS)


@pytest.mark.skipif(bool(gl.missing_renderer()), reason="no OpenGL")
@pytest.mark.parametrize("name", CLIPS)
def test_a_clip_is_what_the_code_would_make(name, monkeypatch):
    frames = gallery.CLIPS[name].frames()
    full_clock = frames.clock
    played = type(full_clock).played  # numbers are held in the time of the whole film
    monkeypatch.setattr(type(full_clock), "played", lambda clock, t: played(full_clock, t))
    with Image.open(gallery.FOLDER / f"{name}.webp") as clip:
        assert clip.n_frames == len(frames)
        assert clip.size == frames.size
        for k in (len(frames) // 3, 2 * len(frames) // 3):
            part = slice(k - 1, k + 2)  # with those beside it: the last has a sample more
            frames.clock = type(full_clock)(full_clock.times[part], full_clock.speeds[part])
            _, new, _ = frames
            clip.seek(k)
            old = np.asarray(clip.convert("RGB"), float)
            assert np.abs(blocks(old) - blocks(as_kept(new))).max() < MAX_DIFFERENCE, (
                f"{name}: make gallery"
            )
