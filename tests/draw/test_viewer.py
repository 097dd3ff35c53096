"""What `smc-mujoco run --view` promises: the run of smc.run, at the user's pace and with their gains; or a sentence."""

import dataclasses
import sys
import types

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.cli import main
from smc_mujoco.cli import scene as show
from smc_mujoco.common import gl
from smc_mujoco.draw import display
from smc_mujoco.draw import viewer as live
from smc_mujoco.simulation import reference
from smc_mujoco.simulation.trace import ARRAYS, from_log

FRAME = 1.0 / 60.0
DUFFING = smc.Scenario(plant="duffing", law=smc.law("observer_free", lam=6.0, k1=3.0), duration=0.4)
HARD = smc.Scenario(
    plant="inverted_pendulum",
    law=smc.law("super_twisting"),
    surface="terminal",
    model="nominal",
    duration=0.3,
    noise=smc.Noise(0.001, 0.01),
    disturbance=(smc.Sine(0.2, 5.0), smc.signals.Gust(1.0, time=0.1, width=0.05)),
    input_delay=0.005,
    friction=smc.hardware.LuGre(coulomb=0.05, static=0.08, stribeck=0.05),
    actuator=(smc.DCMotor(), smc.Backlash(0.01)),
    sensor=smc.Encoder(counts=4096, delay=0.001),
    contact="stops",
    jump=smc.Jump(time=0.15, factors={"m": 1.5}),
    seed=3,
)
NETWORK = smc.Scenario(plant=smc.plant("pendulum_network", n=3), law=smc.law("classical"), duration=0.2)


class Viewer:
    """A stand-in for MuJoCo's: the user's hand is `moves`, a function of the frame's number."""

    def __init__(self, moves=lambda frame: None):
        self.moves, self.frames, self.texts = moves, 0, []

    def set_texts(self, texts):
        self.texts.append(texts[3])

    def sync(self):
        self.moves(self.frames)
        self.frames += 1


@pytest.fixture
def said():
    return []


@pytest.fixture
def shown(said):
    """A scenario as it is shown: (live, viewer)."""

    def made(scenario=DUFFING, moves=lambda view, frame: None):
        view = live.Live(scenario, said.append)
        return view, Viewer(lambda frame: moves(view, frame))

    return made


def finish(view, viewer):
    """Frames until the run's duration is over; its trace."""
    for _ in range(200):
        view.frame(viewer, FRAME)
        if view.step > view.loop.total or view.loop.failure:
            break
    loop = view.loop
    return from_log(view.scenario, loop.log.copy(), loop.failed_step, loop.failure)


def slide(view, name, value):
    view.data.ctrl[view.model.actuator(f"gain:{name}").id] = value


def same(trace, other):
    for name in ARRAYS:
        np.testing.assert_allclose(getattr(trace, name), getattr(other, name), rtol=0.0, atol=1e-9, err_msg=name)


# the run


@pytest.mark.parametrize(
    ("scenario", "run"),
    [
        (DUFFING, smc.run),
        (NETWORK, smc.run),
        (HARD, reference.run),
    ],  # the last: compiling all that is in it takes seconds
    ids=["duffing", "network", "hard"],
)
def test_untouched_it_is_the_run_that_run_makes(scenario, run, shown):
    view, viewer = shown(scenario)
    same(finish(view, viewer), run(scenario))
    assert viewer.frames > 5
    assert view.law == scenario.law


def test_the_viewer_shows_the_present_state_of_the_run(shown, monkeypatch):
    monkeypatch.setattr(live, "MAX_FRAME_TIME", 60.0)  # a slow machine shortens no frame
    view, viewer = shown(HARD)
    for _ in range(12):
        view.frame(viewer, FRAME)
        assert view.data.time == view.loop.data.time
        np.testing.assert_array_equal(view.data.qpos, view.loop.data.qpos)
        drives = len(view.loop.data.ctrl)
        np.testing.assert_array_equal(view.data.ctrl[:drives], view.loop.data.ctrl)
        assert view.data.ctrl[:drives].any()
    assert view.step == pytest.approx(12 * FRAME / HARD.resolved.physics_step, abs=1.0)
    np.testing.assert_allclose(view.model.body_mass, view.loop.model.body_mass)  # after the jump
    assert any(view.model.body_mass != live.Live(HARD).model.body_mass)
    view.begin(HARD)
    np.testing.assert_array_equal(view.model.body_mass, live.Live(HARD).model.body_mass)


def test_a_run_that_is_over_restarts_with_its_gains(shown):
    view, viewer = shown()
    slide(view, "lam", 12.0)
    first = finish(view, viewer)
    second = finish(view, viewer)
    assert view.law.gains == {"lam": 12.0, "k1": 3.0}
    same(first, second)


# pause


def test_in_pause_nothing_moves_and_nothing_is_lost(shown):
    view, viewer = shown()
    for _ in range(5):
        view.frame(viewer, FRAME)
    view.key(live.SPACE_KEY)
    before = view.step, view.loop.data.qpos.copy(), view.loop.log.copy(), view.data.time
    for _ in range(5):
        view.frame(viewer, FRAME)
    after = view.step, view.loop.data.qpos, view.loop.log, view.data.time
    for one, other in zip(before, after, strict=True):
        assert np.asarray(one).tobytes() == np.asarray(other).tobytes()
    assert "paused" in viewer.texts[-1]
    assert "paused" not in viewer.texts[0]
    view.key(live.SPACE_KEY)
    same(finish(view, viewer), smc.run(DUFFING))


def test_other_keys_do_nothing(shown):
    view, _ = shown()
    view.key(ord("P"))
    assert not view.paused


def test_the_camera_begins_where_the_plants_own_stands(shown):
    view, _ = shown()
    cam, look = mujoco.MjvCamera(), view.data.cam("look")
    live.aim(view.model, view.data, cam)
    azimuth, elevation = np.radians([cam.azimuth, cam.elevation])
    ahead = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    np.testing.assert_allclose(cam.lookat - cam.distance * np.array(ahead), look.xpos, atol=1e-9)
    np.testing.assert_allclose(ahead, -look.xmat.reshape(3, 3)[:, 2], atol=1e-9)
    assert cam.distance > 1.0


# gains


def test_there_is_a_slider_for_each_gain_a_decade_either_side(shown):
    view, _ = shown()
    assert view.model.nu == 3  # with the motor
    for name, gain in DUFFING.law.gains.items():
        slider = view.model.actuator(f"gain:{name}")
        assert view.data.ctrl[slider.id] == gain
        np.testing.assert_allclose(slider.ctrlrange, [gain / 10.0, gain * 10.0])
        assert not slider.gear.any()


@pytest.mark.parametrize(("gain", "ends"), [(2.0, [0.2, 20.0]), (-2.0, [-20.0, -0.2]), (0.0, [0.0, 1.0])])
def test_a_slider_keeps_the_sign_of_its_gain(gain, ends):
    assert live.slider_range(gain) == pytest.approx(ends)


def test_a_law_without_gains_has_no_sliders(shown):
    scenario = dataclasses.replace(DUFFING, law=smc.law("none"), duration=0.1)
    view, viewer = shown(scenario)
    assert view.model.nu == 1
    same(finish(view, viewer), smc.run(scenario))


def test_a_slider_moved_before_the_start_gives_the_run_with_that_gain(shown):
    view, viewer = shown()
    slide(view, "lam", 0.6)
    trace = finish(view, viewer)
    assert trace.scenario.law == smc.law("observer_free", lam=0.6, k1=3.0)
    same(trace, smc.run(dataclasses.replace(DUFFING, law=trace.scenario.law)))


def test_a_slider_moved_in_mid_run_changes_the_gain_from_there_on(shown, monkeypatch):
    monkeypatch.setattr(live, "MAX_FRAME_TIME", 60.0)  # a slow machine shortens no frame
    view, viewer = shown(moves=lambda view, frame: slide(view, "k1", 9.0) if frame == 9 else None)
    trace, untouched = finish(view, viewer), smc.run(DUFFING)
    at = round(10 * FRAME / DUFFING.control_period)
    np.testing.assert_allclose(trace.s[: at - 1], untouched.s[: at - 1], rtol=0.0, atol=1e-9)
    late = slice(at + 2, None)
    np.testing.assert_allclose(trace.s[late], (trace.v + 9.0 * trace.x)[late], rtol=0.0, atol=1e-9)


def test_gains_stay_within_their_sliders(shown):
    view, viewer = shown()
    slide(view, "lam", 0.0)  # what "Clear all" does
    view.frame(viewer, FRAME)
    assert view.law.gains["lam"] == pytest.approx(0.6)


def test_a_law_with_changed_gains_is_printed_as_the_code_that_makes_it(shown):
    view, viewer = shown()
    slide(view, "lam", 9.0)
    view.frame(viewer, FRAME)
    assert live.as_code(view.law) == "smc.law('observer_free', lam=9, k1=3)"
    assert eval(live.as_code(view.law), {"smc": smc}) == view.law


def test_a_law_of_ones_own_is_printed_by_its_name():
    @smc.law_function(gains={"k": 3.0})
    def mine(y, gains, memory):
        return -gains.k * y.e, y.e

    assert live.as_code(mine()) == "mine(k=3)"


# the mouse, reset, failures


def test_the_mouse_pushes_while_it_pulls(shown):
    joint = mujoco.mjtObj.mjOBJ_BODY

    def push(view, frame):
        body = int(view.model.jnt_bodyid[0])
        assert mujoco.mj_id2name(view.model, joint, body) == mujoco.mj_id2name(view.loop.model, joint, body)
        if 5 <= frame < 8:
            view.data.xfrc_applied[body, 0] = 20.0

    view, viewer = shown(moves=push)
    pushed, untouched = finish(view, viewer), smc.run(DUFFING)
    impulse = 20.0 * 3 * FRAME  # N s on 1 kg: v changes by this, and by what the law and the spring do
    assert np.max(np.abs(pushed.v - untouched.v)) == pytest.approx(impulse, rel=0.4)
    assert not view.loop.data.xfrc_applied.any()


def test_a_reset_of_the_viewer_restarts_the_run(shown):
    view, viewer = shown(moves=lambda view, frame: mujoco.mj_resetData(view.model, view.data) if frame == 9 else None)
    slide(view, "lam", 12.0)
    for _ in range(10):
        view.frame(viewer, FRAME)
    assert view.step > 100
    view.frame(viewer, 0.0)
    assert view.step == 0
    assert view.law.gains == {"lam": 12.0, "k1": 3.0}  # though a reset puts its slider to 0


def test_a_law_that_fails_is_told_and_paused_and_space_restarts_the_run(shown, said):
    @smc.law_function(gains={"k": 3.0})
    def breaks(y, gains, memory):
        return (1.0 / 0.0 if y.t > 0.05 else 0.0), y.e

    view, viewer = shown(dataclasses.replace(DUFFING, law=breaks()))
    for _ in range(10):
        view.frame(viewer, FRAME)
    (sentence,) = said
    assert "'breaks' raised ZeroDivisionError" in sentence
    assert "t = 0.051 s" in sentence
    assert view.paused
    view.key(live.SPACE_KEY)
    view.frame(viewer, FRAME)
    assert view.loop.failure is None
    assert view.data.time == pytest.approx(FRAME, abs=1e-3)


def test_a_slow_machine_is_told_of_and_never_simulates_much_in_a_frame(shown):
    view, viewer = shown()
    view.frame(viewer, 10.0)
    assert view.step <= round(live.MAX_FRAME_TIME / DUFFING.resolved.physics_step) + 1
    assert "slower than real time" in viewer.texts[-1]


def test_it_plays_until_the_window_is_closed(shown):
    def move(view, frame):
        if frame == 2:  # what MuJoCo raises where the window is closed while it is written to
            raise mujoco.UnexpectedError("closed")

    view, viewer = shown(moves=move)
    viewer.is_running = lambda: len(viewer.texts) < 3
    live.play(view, viewer)
    assert view.step > 0
    assert viewer.frames == 2


# the command


@pytest.fixture
def call(capsys):
    def called(*words):
        with pytest.raises(SystemExit) as end:
            main.main(list(words))
        printed = capsys.readouterr()
        return end.value.code or 0, printed.out, printed.err

    return called


@pytest.fixture
def screen(monkeypatch):
    """A display, as far as the command can tell, and no window: the scenarios that would be watched."""
    watched = []
    monkeypatch.setattr(display, "missing", lambda: None)
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    monkeypatch.setattr(live, "watch", watched.append)
    return watched


def test_without_a_display_one_sentence_says_so(call, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    code, out, err = call("run", "duffing", "--view")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("smc-mujoco: no view: there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set): ")


def test_a_display_that_does_not_answer_is_named(call, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", ":9876")
    code, out, err = call("run", "duffing", "--view")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "no window opens on DISPLAY=:9876" in err


def test_on_macos_it_needs_mjpython(monkeypatch):
    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.setitem(sys.modules, "mujoco.viewer", types.SimpleNamespace(_MJPYTHON=None))
    assert "mjpython $(which smc-mujoco) view" in str(display.missing())
    monkeypatch.setitem(sys.modules, "mujoco.viewer", types.SimpleNamespace(_MJPYTHON=object()))
    monkeypatch.setattr(gl, "probe", lambda backend, code: None)
    assert display.missing() is None


def test_condition_and_label_name_the_run(call, screen):
    assert call("run", "duffing", "--view")[0] == 0
    assert call("run", "vdp_noise", "--view", "--label", "classical")[0] == 0
    assert [(s.plant.name, s.law.name) for s in screen] == [("duffing", "observer_free"), ("van_der_pol", "classical")]


@pytest.mark.parametrize("display_there", [True, False])
@pytest.mark.parametrize("words", [("nowhere",), ("duffing", "--condition", "windy"), ("duffing", "--label", "mine")])
def test_what_the_scene_does_not_have_is_named_before_a_display_is_missed(
    words, display_there, call, screen, monkeypatch
):
    monkeypatch.setattr(display, "missing", lambda: None if display_there else "no view: there is no display")
    code, out, err = call("run", *words, "--view")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert repr(words[-1]) in err
    assert screen == []


# files of other programs


@pytest.fixture
def short(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(show, "figures", lambda *_: [])
    (tmp_path / "short.py").write_text(
        "import smc_mujoco as smc\n"
        "run = smc.Scenario(plant='duffing', law='classical', duration=0.05)\n"
        "scene = smc.Scene(title='Short', conditions={'calm': {'one': run}})\n"
    )
    return tmp_path


def test_run_exports_each_trace_beside_its_npz(call, short):
    code, out, _ = call("run", "short.py", "--no-film", "--out", "out", "--export", "csv, mat,parquet")
    assert code == 0
    files = {f"calm-one.{ending}" for ending in ("npz", "csv", "mat", "parquet")}
    assert {path.name for path in (short / "out" / "short").iterdir()} == files
    assert all(file in out for file in files)


@pytest.mark.parametrize("formats", ["xlsx", "csv,xlsx", "", "csv,,mat"])
def test_another_format_is_refused_before_the_run(formats, call, short):
    code, _, err = call("run", "short.py", "--no-film", "--out", "out", "--export", formats)
    assert (code, err.count("\n")) == (2, 1)
    assert "csv, mat, mcap, parquet" in err
    assert not (short / "out").exists()
