"""Films and figures in a notebook's cell: they are there, play at their speed, and fit on a
phone.
"""

import base64
import io
import re
import subprocess
import sys
import types

import imageio_ffmpeg
import numpy as np
import pytest
from helpers.films import without_charts
from PIL import Image

import smc_mujoco as smc
from smc_mujoco.common import gl, html

SIZE = (320, 180)
FILM = {"size": SIZE, "fps": 20.0, "speed": 1.0}
renders = pytest.mark.skipif(gl.missing_renderer() is not None, reason=str(gl.missing_renderer()))


@pytest.fixture(scope="module")
def trace() -> smc.Trace:
    return smc.run(smc.Scenario(plant="inverted_pendulum", law=smc.law("classical"), duration=0.2))


@pytest.fixture
def cell(monkeypatch) -> list[str]:
    """A notebook's cell: the HTML that it shows, in order."""
    texts: list[str] = []
    display = types.ModuleType("IPython.display")
    display.HTML = str
    display.display = lambda text, **_: (
        texts.append(text) or types.SimpleNamespace(update=lambda text: None)
    )
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    monkeypatch.setattr(html, "in_notebook", lambda: True)
    return texts


def content(shown: str) -> bytes:
    """The file in a page."""
    return base64.b64decode(re.findall(r'src="data:[^;]+;base64,([^"]+)"', shown)[0])


# figures


def test_a_notebook_shows_a_figure_that_pyplot_does_not_know_of(trace):
    title = "A noisy sensor under a sine, and dry friction"
    figure = smc.figure(trace, title=title, size="ieee-column")
    assert figure.legends[0].get_title().get_text().split() == title.split()
    picture, metadata = figure._repr_png_()
    assert Image.open(io.BytesIO(picture)).width == pytest.approx(252 / 72.27 * 200, abs=1)
    assert metadata == {"width": pytest.approx(252 / 72.27 * 96)}
    formatters = pytest.importorskip("IPython.core.formatters")
    reported, about = formatters.DisplayFormatter().format(figure)
    assert reported["image/png"] == picture
    assert about["image/png"] == metadata


# films


@renders
@without_charts
def test_frames_are_those_of_the_film_again_and_again(trace):
    frames = smc.film(trace, title="twice", **FILM)
    assert len(frames) == 5
    assert np.allclose(frames.clock.times, [0.0, 0.05, 0.1, 0.15, 0.2])
    first = list(frames)
    second = list(frames)
    assert np.array_equal(first, second)
    assert first[0].shape == (180, 320, 3)
    assert not np.array_equal(first[0], first[-1])
    assert repr(frames) == "Frames(5 of 320 x 180 px, 20 a second)"


@pytest.mark.quick
@renders
@without_charts
def test_mediapy_takes_the_frames_with_their_speed(trace):
    mediapy = pytest.importorskip("mediapy")
    video = mediapy.show_video(smc.film(trace, **FILM), return_html=True)
    assert probe(content(video)) == (320, 180, 20.0, 5)


@renders
@without_charts
def test_show_films_traces_and_frames(cell, trace):
    smc.show([trace, trace], labels=["a", "b"], **FILM)
    smc.show(smc.film(trace, **FILM))
    assert [probe(content(text)) for text in cell if text] == [(320, 180, 20.0, 5)] * 2
    for text in cell:
        if text:
            assert 'width="320"' in text
            assert "max-width:100%" in text
    assert content(cell[0]) != content(cell[-1])


def probe(film: bytes) -> tuple[int, int, float, int]:
    """Width, height, frames a second and number of frames of an .mp4."""
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", "pipe:", "-f", "null", "-"]
    reported = subprocess.run(command, input=film, capture_output=True, check=False).stderr.decode()
    width, height = re.findall(r"Video:.* (\d+)x(\d+)", reported)[0]
    return (
        int(width),
        int(height),
        float(re.findall(r"([\d.]+) fps", reported)[0]),
        int(re.findall(r"frame= *(\d+)", reported)[-1]),
    )


# mistakes
