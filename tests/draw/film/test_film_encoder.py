"""The encoder's thread: order, a bound on memory, errors in one sentence."""

import contextlib
import threading
import time

import mediapy
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.draw.film import encoder
from smc_mujoco.draw.film.encoder import MAX_WAITING, in_thread

pytestmark = pytest.mark.quick

PICTURE = np.zeros((180, 320, 3), np.uint8)


def encode(folder, count):
    with encoder.encoder(folder / "a.mp4", (180, 320), 30.0) as write:
        for _ in range(count):
            write(PICTURE)


def test_pictures_are_written_in_order_and_all_by_the_end():
    written = []
    with in_thread(lambda picture: written.append(int(picture[0, 0, 0]))) as write:
        for k in range(50):
            write(np.full((1, 1, 1), k))
    assert written == list(range(50))


def test_no_more_pictures_wait_than_agreed():
    gate = threading.Event()
    written = []
    with in_thread(lambda picture: (gate.wait(), written.append(picture))) as write:
        for _ in range(MAX_WAITING + 1):  # one more is with the writer
            write(PICTURE)
        late = threading.Thread(target=write, args=(PICTURE,))
        late.start()
        time.sleep(0.05)
        assert late.is_alive()
        gate.set()
        late.join(timeout=10.0)
        assert not late.is_alive()
    assert len(written) == MAX_WAITING + 2


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
    assert len(calls) <= 3 + MAX_WAITING  # none that came later


def test_an_error_with_the_last_picture_is_not_lost(tmp_path, monkeypatch):
    def broken(self, picture):
        raise OSError("Broken pipe")

    monkeypatch.setattr(mediapy.VideoWriter, "add_image", broken)
    with pytest.raises(smc.ScenarioError, match="cannot write mp4: Broken pipe"):
        encode(tmp_path, 1)


def test_ctrl_c_ends_a_film_as_itself_though_ffmpeg_complains_of_half_a_picture(
    tmp_path, monkeypatch
):
    close = mediapy.VideoWriter.close

    def complain(self):
        with contextlib.suppress(RuntimeError):
            close(self)
        raise RuntimeError("Error writing: half a picture")

    def stopped():
        with encoder.encoder(tmp_path / "a.mp4", (180, 320), 30.0):
            monkeypatch.setattr(mediapy.VideoWriter, "close", complain)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()


def test_an_error_where_pictures_are_made_is_that_error_and_the_rest_is_dropped():
    written = []

    def slow(picture):
        time.sleep(0.01)
        written.append(picture)

    def interrupted():
        with in_thread(slow) as write:
            for _ in range(MAX_WAITING):
                write(PICTURE)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert len(written) < MAX_WAITING
