"""The encoder's thread: order, a bound on memory, errors in one sentence."""

import contextlib

import mediapy
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.draw.film import video

pytestmark = pytest.mark.quick

PICTURE = np.zeros((180, 320, 3), np.uint8)


def encode(folder, count):
    with video.encoder(folder / "a.mp4", (180, 320), 30.0) as write:
        for _ in range(count):
            write(PICTURE)


def test_an_error_of_the_encoder_ends_the_film_in_one_sentence_and_soon(tmp_path, monkeypatch):
    calls = []

    def broken(self, picture):
        calls.append(picture)
        if len(calls) == 3:
            raise RuntimeError("Error writing: no space\nleft on device")

    monkeypatch.setattr(mediapy.VideoWriter, "add_image", broken)
    with pytest.raises(
        smc.ScenarioError, match="cannot write mp4: Error writing: no space left on device"
    ):
        encode(tmp_path, 10_000)
    assert len(calls) == 3  # none that came later


def test_ctrl_c_ends_a_film_as_itself_though_ffmpeg_complains_of_half_a_picture(
    tmp_path, monkeypatch
):
    close = mediapy.VideoWriter.close

    def complain(self):
        with contextlib.suppress(RuntimeError):
            close(self)
        raise RuntimeError("Error writing: half a picture")

    def stopped():
        with video.encoder(tmp_path / "a.mp4", (180, 320), 30.0):
            monkeypatch.setattr(mediapy.VideoWriter, "close", complain)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
