"""Films: the right frames, moving machines in their laws' colours, arrows that push, failures that show."""

import dataclasses
import os
import signal
import subprocess
import sys

import imageio_ffmpeg
import mediapy
import numpy as np
import pytest
from PIL import Image

import smc_mujoco as smc
from smc_mujoco import gl
from smc_mujoco.draw import camera, style, video
from smc_mujoco.draw.arrows import Longest, acts, arrows
from smc_mujoco.draw.caption import Caption
from smc_mujoco.draw.stage import Stage

LAWS = ("observer_free", "classical", "adaptive", "super_twisting")
SIZE = (480, 270)
renders = pytest.mark.skipif(gl.missing() is not None, reason=str(gl.missing()))


def runs(plant: str = "duffing", condition: str = "nominal", laws=LAWS, duration: float = 0.3) -> list[smc.Trace]:
    return smc.run(list(smc.paper.comparison(plant, condition, laws, duration=duration).values()))


def broken(trace: smc.Trace, at: int) -> smc.Trace:
    """The trace as if it had diverged at sample `at`."""
    arrays = {name: getattr(trace, name).copy() for name in ("x", "v", "u", "applied", "s", "d", "r")}
    for array in arrays.values():
        array[at:] = np.nan
    return dataclasses.replace(trace, **arrays, diverged_at=float(trace.t[at]), failure="it blew up")


def pictures(traces, times, **options) -> list[np.ndarray]:
    return list(video.frames(traces, np.array(times), options.get("labels"), None, options.get("size", SIZE)))


def machines(picture: np.ndarray) -> np.ndarray:
    """The part of a frame between the title and the labels."""
    return picture[int(0.13 * len(picture)) : int(0.53 * len(picture))]


def share(picture: np.ndarray, colour: str) -> float:
    """Share of pixels whose hue is that of a colour, whatever the light."""
    pixels, wanted = machines(picture).reshape(-1, 3).astype(float), np.array(style.rgb(colour), float)
    pixels, wanted = pixels - pixels.min(axis=1, keepdims=True), wanted - wanted.min()
    strong = pixels.max(axis=1) > 60
    alike = pixels @ wanted > 0.985 * np.linalg.norm(pixels, axis=1) * np.linalg.norm(wanted)
    return float((strong & alike).mean())


@renders
def test_film_has_a_frame_every_thirtieth_of_a_second(tmp_path):
    written = []
    path = video.film(runs(), tmp_path / "new" / "a.mp4", size=SIZE, report=written.append)
    mediapy.set_ffmpeg(imageio_ffmpeg.get_ffmpeg_exe())
    film = mediapy.read_video(path)
    assert film.shape == (10, 270, 480, 3)
    assert film.metadata is not None
    assert film.metadata.fps == 30
    assert sum(written) == 10
    assert [p.name for p in path.parent.iterdir()] == ["a.mp4"]


@renders
def test_every_machine_moves():
    traces = runs(duration=1.0)
    first, last = pictures(traces, [0.0, 1.0])
    moved = np.abs(machines(first).astype(int) - machines(last)).max(axis=2) > 40
    rows = np.flatnonzero(moved.any(axis=1))
    assert moved.mean() > 0.02
    assert np.ptp(rows) > 0.5 * len(moved)  # from the nearest rail to the farthest


@renders
@pytest.mark.parametrize("plant", ["inverted_pendulum", "van_der_pol", "duffing", "pendulum_network"])
def test_every_law_has_its_colour(plant):
    (picture,) = pictures(runs(plant), [0.1], size=(640, 360))
    for law in LAWS:
        assert share(picture, style.law_colour(law)) > 3e-4, law


@renders
def test_a_large_control_draws_an_arrow():
    (with_control,) = pictures(runs(laws=LAWS[:1]), [0.2])
    quiet = dataclasses.replace(runs(laws=LAWS[:1])[0], u=np.zeros((301, 1)), applied=np.zeros((301, 1)))
    (without,) = pictures([quiet], [0.2])
    blue = style.law_colour(LAWS[0])
    assert share(with_control, blue) > share(without, blue) + 1e-3


def test_arrows_are_to_scale_and_a_bar_shows_switching():
    (trace,) = runs("van_der_pol", "sine", LAWS[:1])
    u = np.where(np.arange(301) % 2, 6.0, -3.0)[:, None]
    acting = acts(dataclasses.replace(trace, applied=u), np.array([0.1, 0.2]), gap=0.1)
    arrow, bar, push = arrows(acting, 1, 0, Longest(6.0, 0.2), "#0072B2")
    assert arrow.high == pytest.approx(0.25, abs=0.02)
    assert (bar.low, bar.high, bar.head) == (-0.5, 1.0, False)
    assert push.high == pytest.approx(np.sin(5 * trace.t[101:201]).mean(), abs=0.02)


@renders
def test_a_failed_machine_turns_grey_and_stays_where_it_was():
    good, bad = runs("inverted_pendulum", laws=LAWS[:2])
    before, after, later = pictures([good, broken(bad, 150)], [0.1, 0.2, 0.3])
    orange = style.law_colour(LAWS[1])
    assert share(before, orange) > 3e-4
    assert share(after, orange) < 0.2 * share(before, orange)  # brass is left
    right = machines(after).shape[1] // 2
    assert np.abs(machines(after)[:, right:].astype(int) - machines(later)[:, right:]).max() < 30


@renders
@pytest.mark.parametrize("plant", ["inverted_pendulum", "van_der_pol", "pendulum_network"])
def test_a_machine_that_fails_at_once_is_grey_from_the_start(plant):
    good, bad = runs(plant, laws=LAWS[::3])
    first, last = pictures([broken(bad, 0)], [0.0, 0.3])
    assert share(first, style.law_colour(LAWS[3])) == 0.0
    assert np.abs(machines(first).astype(int) - machines(last)).max() < 30
    pictures([good, broken(bad, 0)], [0.0, 0.3])


@renders
def test_a_jump_changes_the_machine_and_is_told():
    jump = smc.Jump(0.2, {"l": 1.5})
    trace = smc.run(smc.Scenario(plant="inverted_pendulum", law="classical", duration=0.4, jump=jump))
    room = camera.Room(10, 10, 470, 160)
    with Stage([trace], ["#0072B2"], (480, 170), room) as stage:
        lengths = []
        for time in (0.1, 0.3, 0.1):
            stage.dress(0, time)
            lengths.append(float(stage.model.geom("m0/bob").pos[2]))
    assert lengths == pytest.approx([0.5, 0.75, 0.5])
    before, after = pictures([trace], [0.1, 0.3])
    corner = slice(10, 50), slice(300, None)
    assert (after[corner].mean(axis=2) < 80).sum() > 2 * (before[corner].mean(axis=2) < 80).sum()


@pytest.mark.parametrize("plant", ["inverted_pendulum", "duffing"])
def test_long_words_stay_in_the_picture(plant):
    bad = [broken(trace, 150) for trace in runs(plant)]
    names, size = ["a label of more than forty letters, number " + str(i) for i in range(4)], (1280, 460)
    caption = Caption(bad, names, ["#0072B2"] * 4, "A long title " * 20, size, 1.0, Longest(6.0, 0.2))
    caption.put(np.array([[300.0 * k, 80.0 * k, 300.0 * k + 290, 80.0 * k + 200] for k in range(4)]))
    assert (caption.pills[:, :2] >= 0).all()
    assert (caption.pills[:, 2:] <= size).all()
    assert (caption.pills[:, 2] - caption.pills[:, 0] >= [caption.width(text) for text in caption.texts()]).all()
    assert all(text.endswith("…: failed at 0.15 s") for text in caption.texts())
    assert caption.title.endswith("…")
    assert 24 + style.width(caption.title, 24, bold=True) < 1280 - 24 - style.width("10.00 s", 24, bold=True)


@renders
@pytest.mark.skipif(os.name == "nt", reason="Windows has no process groups to interrupt")
def test_ctrl_c_ends_a_film_as_itself_and_leaves_nothing(tmp_path):
    code = """
import sys
import smc_mujoco as smc
trace = smc.run(smc.Scenario(plant="duffing", law="none", duration=100.0))
smc.film([trace], sys.argv[1], size=(320, 180), report=lambda n: print(n, flush=True))
"""
    command = [sys.executable, "-c", code, str(tmp_path / "a.mp4")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, start_new_session=True, env=environment, **pipes) as process:
        assert process.stdout is not None
        for _ in range(5):
            process.stdout.readline()
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        _, error = process.communicate(timeout=60)
    assert error.strip().endswith("KeyboardInterrupt")
    assert "RuntimeError" not in error
    assert not list(tmp_path.iterdir())


@renders
def test_stills_and_clips_are_written_and_networks_are_cut(tmp_path):
    many = smc.plant("inverted_pendulum_network", n=30)
    traces = smc.run([smc.Scenario(plant=many, law="none", duration=0.2)])
    still = video.still(traces, 0.1, tmp_path / "a.png", size=SIZE)
    with Image.open(still) as image:
        assert image.size == SIZE
    with Image.open(video.clip(traces, tmp_path / "a.webp", span=(0.0, 0.2), size=SIZE)) as clip:
        assert (clip.n_frames, clip.size) == (5, SIZE)


def test_camera_sees_all_points_as_near_as_it_can():
    points = np.random.default_rng(0).uniform((-3, 0, 0), (3, 2, 1), (200, 3))
    turn = np.array([[1.0, 0, 0], [0, 0.3, -(0.91**0.5)], [0, 0.91**0.5, 0.3]])
    room = camera.Room(100, 50, 1200, 400)
    px = camera.project(points, turn, camera.fit(points, turn, (1280, 460), room), (1280, 460))
    (left, top), (right, bottom) = px.min(axis=0), px.max(axis=0)
    assert left >= 100 - 1e-6
    assert right <= 1200 + 1e-6
    assert top >= 50 - 1e-6
    assert bottom <= 400 + 1e-6
    assert right - left == pytest.approx(1100) or bottom - top == pytest.approx(350)


@pytest.mark.parametrize(
    ("traces", "options", "sentence"),
    [
        (0, {}, "no traces"),
        (1, {"size": (481, 270)}, "two even numbers"),
        (1, {"fps": 0.0}, "give 1 to 120"),
        (9, {"size": SIZE}, "at most 8"),
    ],
)
def test_refuses_what_makes_no_film(traces, options, sentence, tmp_path):
    with pytest.raises(smc.ScenarioError, match=sentence):
        video.film(runs(laws=LAWS[:1]) * traces, tmp_path / "a.mp4", **options)
    assert not list(tmp_path.iterdir())


def test_without_opengl_one_sentence_says_what_to_do(monkeypatch, tmp_path):
    monkeypatch.setattr(gl, "missing", lambda: "no film: install a renderer")
    with pytest.raises(smc.ScenarioError, match="install a renderer"):
        video.film(runs(laws=LAWS[:1]), tmp_path / "a.mp4")
