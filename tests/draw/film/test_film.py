"""Films: the right frames, moving machines in their laws' colours, arrows that push, failures that
show.
"""

import contextlib
import dataclasses
import itertools
import os
import signal
import subprocess

import numpy as np
import pytest
from helpers.films import staged, without_charts
from helpers.runs import at_defaults
from helpers.sketch import failed, made

import smc_mujoco as smc
from smc_mujoco.common import gl, progress
from smc_mujoco.draw import colouring, decimate, states, style, wording
from smc_mujoco.draw.film import camera, film, pace, video, world
from smc_mujoco.draw.film.arrows import (
    Arrow,
    Scale,
    arrows,
    loads,
    scale_words,
    scales,
    scales_by_channel,
    weights,
)
from smc_mujoco.draw.film.pace import FilmClock
from smc_mujoco.draw.film.stage import Stage
from smc_mujoco.draw.film.track import MachineTrack
from smc_mujoco.mechanisms.hardware.friction import Coulomb, LuGre
from smc_mujoco.metrics.conventions import groups
from smc_mujoco.simulation import model as models

LAWS = ("observer_free", "classical", "adaptive", "super_twisting")
SIZE = (480, 270)
renders = pytest.mark.skipif(gl.missing_renderer() is not None, reason=str(gl.missing_renderer()))


def runs(
    plant: str = "duffing", condition: str = "nominal", laws=LAWS, duration: float = 0.3
) -> list[smc.Trace]:
    return smc.run(
        list(
            smc.paper.comparison(
                plant,
                condition,
                laws,
                duration=duration,
            ).values()
        )
    )


def driven(traces):
    """The first group of channels of a trace's plant."""
    return groups(traces[0].scenario.plant)[0]


def pictures(traces, times, charts=False, **options) -> list[np.ndarray]:
    clock = FilmClock(np.array(times), np.ones(len(times)))
    with contextlib.nullcontext() if charts else without_charts:
        frames = film.Frames(
            traces,
            options.get("labels"),
            size=options.get("size", SIZE),
            at=0.0,
        )
        frames.clock = clock
        return list(frames)


def seconds(trace: smc.Trace, fps: float = 30.0) -> np.ndarray:
    """Times of a film's frames in real time."""
    return pace.clock([trace], fps, 1.0).times


def machines(picture: np.ndarray) -> np.ndarray:
    """The part of a frame between the title and the labels."""
    return picture[int(0.13 * len(picture)) : int(0.53 * len(picture))]


def share(picture: np.ndarray, colour: str) -> float:
    """Share of pixels whose hue is that of a colour, whatever the light."""
    pixels = machines(picture).reshape(-1, 3).astype(float)
    target = np.array(style.rgb(colour), float)
    pixels, target = pixels - pixels.min(axis=1, keepdims=True), target - target.min()
    strong = pixels.max(axis=1) > 60
    alike = pixels @ target > 0.985 * np.linalg.norm(pixels, axis=1) * np.linalg.norm(target)
    return float((strong & alike).mean())


@pytest.mark.quick
def test_arrows_are_to_scale_and_a_bar_shows_switching():
    (trace,) = runs("van_der_pol", "sine", LAWS[:1])
    u = np.where(np.arange(301) % 2, 6.0, -3.0)[:, None]
    strong = dataclasses.replace(trace, applied=u, d=10.0 * trace.d)
    acting = loads(strong, np.array([0.0, 0.1, 0.2]))
    arrow, bar, push = arrows(acting, 1, 0, Scale(6.0, 1.0, longest=6.0, full=6.0), "#0072B2")
    assert arrow.high == pytest.approx(0.25, abs=0.02)
    assert (bar.low, bar.high, bar.head) == (-0.5, 1.0, False)
    # each arrow is beyond the one before
    assert [part.layer for part in (arrow, bar, push)] == [0, 0, 1]
    assert 3.0 * push.high == pytest.approx(np.sin(5 * trace.t[101:201]).mean(), abs=0.02)


@renders
def test_a_torque_s_arrow_points_to_where_it_moves_the_pendulum():
    trace = smc.run(
        smc.Scenario(
            plant="inverted_pendulum",
            law="none",
            duration=0.01,
            x0=0.0,
        )
    )

    def column(picture):
        """Return the mean column of what differs from the pendulum upright, from the middle."""
        columns = np.nonzero(np.abs(picture.astype(int) - upright).max(axis=2) > 60)[1]
        return columns.mean() - 0.5 * picture.shape[1]

    with staged(trace, (640, 360)) as scene:
        scene.arrange(np.array([0.0]))
        upright = scene.render().astype(int)
        leftwards, right = (
            column(scene.render([(0, Arrow(0.0, end, (1.0, 0.0, 0.0, 1.0)))]))
            for end in (-1.0, 1.0)
        )
        scene.arrange(np.array([0.4]))
        leaning = column(scene.render())
    assert leaning * right > 0.0 > leaning * leftwards


@renders
def test_a_failed_machine_turns_grey_stays_where_it_was_and_has_no_goal(monkeypatch):
    good, bad = runs("inverted_pendulum", laws=LAWS[:2])
    goals = []
    plain = Stage.arrange

    def arrange(stage, x, ahead=0.0, time=0.0, goal=None):
        goals.append(goal is None or goal[0] - stage.track.trace.r[0, 0])
        plain(stage, x, ahead, time, goal)

    monkeypatch.setattr(Stage, "arrange", arrange)
    before, after, later = pictures([good, failed(bad, 150)], [0.1, 0.2, 0.3])
    assert goals[2:] == [0.0, 0.0, *[0.0, True] * 2]  # after those of the first pose
    orange = colouring.law_colour(LAWS[1])
    assert share(before, orange) > 3e-4
    assert share(after, orange) < 0.2 * share(before, orange)  # brass is left
    right = machines(after).shape[1] // 2
    assert np.abs(machines(after)[:, right:].astype(int) - machines(later)[:, right:]).max() < 30


@pytest.mark.skipif(os.name == "nt", reason="Windows has no masks of signals")
def test_an_encoder_that_is_started_never_receives_ctrl_c():
    with video.sigint_blocked():
        process = subprocess.Popen(["sleep", "60"])
    process.send_signal(signal.SIGINT)
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(0.2)
    process.kill()
    process.wait()


@renders
@without_charts
def test_a_film_that_is_stopped_leaves_nothing(tmp_path, monkeypatch):
    def stop(bar, work):
        raise KeyboardInterrupt

    monkeypatch.setattr(progress.Bar, "advance", stop)
    with pytest.raises(KeyboardInterrupt):
        film.film(runs(), tmp_path / "a.mp4", size=SIZE)
    assert not list(tmp_path.iterdir())


# realistic mechanisms

VARIANTS = [
    (plant, field, name)
    for plant in smc.plants()
    for field, offered in (("contact", "contacts"), ("mechanism", "mechanisms"))
    for name in getattr(smc.plant(plant), offered)
]


def realistic(law: str = "observer_free", plant: str = "duffing", **parts) -> smc.Trace:
    shipped_law = smc.paper.scenario(plant, law).law
    return smc.run(smc.Scenario(plant=plant, law=shipped_law, **({"duration": 2.0} | parts)))


def moods(trace: smc.Trace, fps: float = 30.0) -> list[tuple[str | None, int]]:
    """What a film tells of a trace, and for how many frames."""
    reported = states.timeline(trace, seconds(trace, fps))
    words = [now.words if now else None for now in reported]
    return [(now, len(list(run))) for now, run in itertools.groupby(words)]


@pytest.fixture(scope="module")
def hit() -> smc.Trace:
    """A cart that hits its stop once, at about 0.07 s."""
    return realistic(contact="stops", v0=3.0)


@pytest.fixture(scope="module")
def stuck() -> smc.Trace:
    return realistic(friction=Coulomb(0.5))


@pytest.mark.parametrize(("plant", "field", "name"), VARIANTS, ids=str)
def test_a_film_shows_all_that_a_scenario_s_mechanism_has(plant, field, name):
    start = None if smc.plant(plant).ranges else 0.5
    scenario = smc.Scenario(
        plant=plant,
        law="none",
        x0=start,
        duration=0.1,
        **{field: name},
    )
    model = world.compose(scenario, 0.0, SIZE, camera.turn(90.0, 0.0))
    drawn_geoms = {model.geom(i).name for i in range(model.ngeom)}
    solid_geoms = []
    for geom in models.spec(scenario).geoms:
        if geom.name not in ("", "floor"):
            solid_geoms.append(geom.name)
    assert [geom for geom in solid_geoms if f"m/{geom}" not in drawn_geoms] == []
    assert model.nskin == len(models.spec(scenario).skins)


def test_only_dry_friction_sticks():
    assert moods(realistic(friction=smc.Viscous(1.0))) == [(None, 61)]
    for cf, cfq in itertools.product((0.0, 2e-3), repeat=2):
        twin = smc.Scenario(plant=smc.plant("furuta", cf=cf, cfq=cfq), law="none")
        assert states.has_dry_friction(twin).tolist() == [cf > 0.0, cfq > 0.0]
    assert moods(realistic(friction=Coulomb(0.0))) == [(None, 61)]
    assert moods(realistic(friction=LuGre(0.5, 0.8, 0.05)))[-1][0] == "sticks"
    assert (
        moods(
            realistic(
                "none",
                contact="floor",
                x0=0.9,
                duration=1.0,
            )
        )[-1][0]
        == "sticks"
    )


def test_what_is_told_lasts_in_the_film_not_in_the_run(hit):
    """In slow motion the word is gone from the picture of a cart that has left its stop."""
    slow = pace.clock([hit], 30.0, 0.125)
    lasts = []
    for times, played in ((slow.times, slow.played), (hit.t, None)):
        is_told = [now is not None for now in states.timeline(hit, times, played)]
        lasts.append(float(np.ptp(times[is_told])))
    touch = float(np.ptp(hit.t[states.in_contact(hit)[:, 0]]))
    held = states.HOLD_TIME + states.MIN_STATE_TIME
    assert lasts[1] == pytest.approx(held, abs=0.01)
    assert lasts[0] == pytest.approx(
        max(touch, 0.125 * states.HOLD_TIME) + 0.125 * states.MIN_STATE_TIME, abs=0.01
    )


def test_what_is_held_lasts_and_has_no_short_gaps():
    t = np.arange(100) * 0.01
    on = np.zeros(100, bool)
    on[[10, 40, 70]] = True
    assert np.flatnonzero(np.diff(states.extended(on, t, 0.16).astype(int))).tolist() == [9, 85]
    assert np.flatnonzero(np.diff(states.extended(on, t, 0.1).astype(int))).tolist() == [
        9,
        19,
        39,
        49,
        69,
        79,
    ]
    assert not states.extended(on & False, t, 0.15).any()


def test_of_a_failed_machine_the_failure_is_told(stuck):
    reported = states.timeline(failed(stuck, 500), np.array([0.1, 0.49, 0.5, 1.0]))
    said = [now.words for now in reported if now]
    assert said == ["diverged at 0.5 s"] * 2
    at_once = states.timeline(decimate.finite(failed(stuck, 0)), np.array([0.0, 1.0]))
    assert [now.words for now in at_once if now] == ["diverged at 0 s"] * 2


def test_friction_draws_an_arrow_of_its_own(stuck):
    scale = scales([stuck])[driven([stuck])]
    *_, violet = arrows(loads(stuck, np.array([0.1, 0.11])), 0, 0, scale, "#0072B2")
    assert violet.rgba[:3] == pytest.approx(np.array(style.rgb(style.REACTION)) / 255)
    assert abs(violet.high) == pytest.approx(0.5 / scale.longest, rel=0.05)  # it slides


def test_forces_on_a_slide_that_sticks_sum_to_0_with_its_weight(stuck):
    """Of a servo axis that stood still, u and friction pointed one way, and nothing back."""
    axis = smc.Scenario(plant="servo_axis", law="pid", friction=Coulomb(1.0), duration=0.3)
    jump = smc.Jump(0.2, {"offset": 2.0})
    (trace,) = smc.run([dataclasses.replace(axis, jump=jump)])
    drawn = loads(trace, np.array([0.1, 0.11, 0.29, 0.3]))
    weight = drawn["disturbance"].mean[[0, 2], 0]
    assert weight == pytest.approx([3.1648, 2.0 * 3.1648])
    names = "control", "disturbance", "reaction"
    total = np.sum([drawn[name].mean[[0, 2], 0] for name in names], axis=0)
    assert total == pytest.approx([0.0, 0.0], abs=0.02)
    (scale,) = scales([trace]).values()
    assert scale.disturbance == pytest.approx(2.0 * 3.1648)
    assert not loads(stuck, np.array([0.1, 0.11]))["disturbance"].mean.any()


@pytest.mark.parametrize("carried", ["slide", "hinge"])
def test_only_a_slide_that_no_hinge_turns_has_a_constant_weight(carried):
    plant = smc.plant_from(
        f"""<mujoco><worldbody><body><joint type="{carried}" axis="0 1 0" name="base"/>
          <geom size=".1" mass="1"/><body><joint type="slide" axis="0 0 1" name="lift"/>
          <geom size=".1" mass="2"/></body></body></worldbody>
          <actuator><motor joint="base"/><motor joint="lift"/></actuator></mujoco>""",
        ["base", "lift"],
    )
    trace = made(smc.Scenario(plant=plant, law=at_defaults("pid"), duration=0.1))
    lift = -2.0 * 9.81 if carried == "slide" else 0.0
    assert weights(trace)[-1] == pytest.approx([0.0, lift])


@pytest.mark.parametrize(("joint", "channel"), [("slide", 0), ("hinge", 1)])
def test_the_arrow_of_friction_is_at_the_joint_that_rubs(joint, channel):
    trace = smc.run(
        smc.Scenario(
            plant="cart_pole", law="none", friction={joint: smc.Coulomb(0.02)}, duration=0.3
        )
    )
    sizes = scales_by_channel(scales([trace]))
    acting = loads(trace, np.array([0.2, 0.21]))
    with_arrow = [i for i in range(2) if arrows(acting, 0, i, sizes[i], "#0072B2")]
    assert with_arrow == [channel]
    unit = "N" if joint == "slide" else "N·m"
    assert f"→ reaction 0.02 {unit}" in scale_words([trace], scales([trace]))


def test_an_arrow_longer_than_the_longest_has_its_number_and_others_have_none(hit):
    scale = scales([hit])[driven([hit])]
    assert scale.longest == scale.control < np.abs(hit.reaction).max()
    peak = int(np.abs(hit.reaction[:, 0]).argmax())
    edges = hit.t[[peak - 1, peak, -2, -1]]
    acting = loads(hit, edges)
    cut = [arrow.words for arrow in arrows(acting, 0, 0, scale, "#0072B2") if abs(arrow.high) > 1]
    (size,) = np.abs(acting["reaction"].mean[0])
    assert cut == [f"{wording.short(float(size))} N"]
    assert not any(arrow.words for arrow in arrows(acting, 2, 0, scale, "#0072B2"))


@pytest.mark.parametrize(
    ("peak", "samples", "longest", "words"),
    [
        (9.0, 20, 2.0, "2 N·m"),
        (9.0, 25, 9.0, "9 N·m"),
        (3.9, 20, 3.9, "3.9 N·m"),
        (4.1, 20, 2.0, "2 N·m"),
    ],
)
def test_a_brief_peak_does_not_set_the_longest_arrow(peak, samples, longest, words):
    """Brief is up to 2 % of the 1001 samples."""
    (trace,) = smc.run([smc.Scenario(plant="inverted_pendulum", law="none", duration=1.0)])
    force = np.where(np.arange(1001) < samples, -peak, 2.0)[:, None]
    arrow_scales = scales([dataclasses.replace(trace, applied=force, d=force)])
    scale = arrow_scales[driven([trace])]
    assert scale.longest == scale.full == pytest.approx(longest)
    assert scale_words([trace], arrow_scales) == [f"→ u {words}"]


def test_a_network_has_no_arrows():
    """One of the mean over the picture of five pendulums is seen as a force on one of them."""
    trace = smc.run(smc.Scenario(plant="pendulum_network", law="classical", duration=0.1))
    arrow_scales = scales([trace])
    clock = film.FilmClock(np.array([0.0, 0.1]), np.ones(2))
    track = MachineTrack(trace, "#000000", clock, clock.times, arrow_scales)
    assert not any(drawn.arrows for drawn in track.drawn)
    assert scale_words([trace], arrow_scales) == []


def test_a_set_point_is_no_arrow_and_without_a_law_the_servo_is_named(tmp_path):
    """An arc of 0.4 rad read as a torque; and the servo, which holds the joint, as no control."""
    model = """<mujoco><worldbody><body><joint name="j" axis="0 1 0"/>
      <geom type="capsule" size=".03" fromto="0 0 0 .4 0 0"/></body></worldbody>
      <actuator>{}</actuator></mujoco>"""
    names = []
    control = []
    for actuator in ('<motor joint="j"/>', '<position joint="j" kp="60" kv="4"/>'):
        path = tmp_path / f"{len(names)}.xml"
        path.write_text(model.format(actuator))
        channel = smc.Channel(u_max=3.0, servo=actuator.startswith("<position"))
        plant = smc.plant_from(path, channels={"j": channel})
        run = smc.run(smc.Scenario(plant=plant, law="none", x0=0.3, duration=0.1))
        run = dataclasses.replace(run, applied=np.full_like(run.u, 0.4))
        (scale,) = scales([run]).values()
        control.append(scale.control)
        names += wording.run_names([run], None)
    assert control == [0.4, 0.0]
    assert names == ["No control", "Servo alone"]


def test_behind_a_drive_the_force_is_shown_and_the_command_pale():
    slow = realistic(plant="inverted_pendulum", actuator=smc.Lag(0.2), duration=0.2)
    arrow_scales = scales([slow])
    assert arrow_scales[driven([slow])].drive
    force_arrows = arrows(
        loads(slow, np.array([0.05, 0.06])), 0, 0, arrow_scales[driven([slow])], "#0072B2"
    )
    solid, pale = (arrow for arrow in force_arrows if arrow.head)
    assert abs(solid.high) < 0.5 * abs(pale.high)  # a quarter of the lag's time constant
    assert solid.rgba[3] == 1.0
    assert pale.rgba[3] == 0.45
    assert solid.layer == 0
    assert pale.layer == 1
    assert scale_words([slow], arrow_scales)[0].startswith("→ drive ")
    strong = scales([dataclasses.replace(slow, force=3.0 * slow.applied)])[driven([slow])]
    assert strong.control == pytest.approx(3.0 * np.abs(slow.applied).max())
    for words in scale_words(runs(laws=LAWS[:1]), scales(runs(laws=LAWS[:1]))):
        assert "drive" not in words


def test_sizes_that_a_user_s_file_gives_leave_nothing_on_the_terminal(capfd):
    """MuJoCo itself prints a warning where they differ from the film's."""
    sizes = '<size njmax="500" nconmax="100" nuserdata="3"/>'
    xml = f"""<mujoco>{sizes}<worldbody><body><joint name="j"/><geom size=".1"/></body></worldbody>
    <actuator><motor joint="j" ctrlrange="-1 1"/></actuator></mujoco>"""
    scenario = smc.Scenario(plant=smc.plant_from(xml, ["j"], name="sized"), law="none")
    world.compose(scenario, 0.0, SIZE, camera.turn(90.0, 0.0))
    assert capfd.readouterr() == ("", "")
