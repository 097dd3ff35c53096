"""Films: the right frames, moving machines in their laws' colours, arrows that push, failures that show."""

import contextlib
import dataclasses
import itertools
import os
import signal
import subprocess

import numpy as np
import pytest
from helpers.films import without_charts
from helpers.sketch import failed

import smc_mujoco as smc
from smc_mujoco.common import gl, progress
from smc_mujoco.draw import states, style
from smc_mujoco.draw.film import act, camera, encoder, film, pace, puppet, scene, stage
from smc_mujoco.draw.film.arrows import Arrow, Scale, arrows, loads, scales
from smc_mujoco.draw.film.caption import Caption, key
from smc_mujoco.draw.film.pace import Clock
from smc_mujoco.draw.film.stage import Stage
from smc_mujoco.mechanisms.hardware.friction import Coulomb, LuGre
from smc_mujoco.mechanisms.plant import Variant
from smc_mujoco.metrics.conventions import groups
from smc_mujoco.simulation import model as models

LAWS = ("observer_free", "classical", "adaptive", "super_twisting")
SIZE = (480, 270)
renders = pytest.mark.skipif(gl.missing() is not None, reason=str(gl.missing()))


def runs(plant: str = "duffing", condition: str = "nominal", laws=LAWS, duration: float = 0.3) -> list[smc.Trace]:
    return smc.run(list(smc.paper.comparison(plant, condition, laws, duration=duration).values()))


def driven(traces):
    """The first group of channels of a trace's plant."""
    return groups(traces[0].scenario.plant)[0]


def pictures(traces, times, charts=False, **options) -> list[np.ndarray]:
    clock = Clock(np.array(times), np.ones(len(times)))
    with contextlib.nullcontext() if charts else without_charts:
        frames = film.Frames(traces, options.get("labels"), size=options.get("size", SIZE), at=0.0)
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
    pixels, wanted = machines(picture).reshape(-1, 3).astype(float), np.array(style.rgb(colour), float)
    pixels, wanted = pixels - pixels.min(axis=1, keepdims=True), wanted - wanted.min()
    strong = pixels.max(axis=1) > 60
    alike = pixels @ wanted > 0.985 * np.linalg.norm(pixels, axis=1) * np.linalg.norm(wanted)
    return float((strong & alike).mean())


@renders
def test_every_machine_moves():
    traces = runs(duration=1.0)
    first, last = pictures(traces, [0.0, 1.0])
    moved = np.abs(machines(first).astype(int) - machines(last)).max(axis=2) > 40
    rows = np.flatnonzero(moved.any(axis=1))
    assert moved.mean() > 0.02
    assert np.ptp(rows) > 0.5 * len(moved)  # from the nearest rail to the farthest


def test_arrows_are_to_scale_and_a_bar_shows_switching():
    (trace,) = runs("van_der_pol", "sine", LAWS[:1])
    u = np.where(np.arange(301) % 2, 6.0, -3.0)[:, None]
    acting = loads(dataclasses.replace(trace, applied=u), np.array([0.0, 0.1, 0.2]))
    arrow, bar, push = arrows(acting, 1, 0, Scale(6.0, 0.2), "#0072B2")
    assert arrow.high == pytest.approx(0.25, abs=0.02)
    assert (bar.low, bar.high, bar.head) == (-0.5, 1.0, False)
    assert [part.layer for part in (arrow, bar, push)] == [0, 0, 1]  # each arrow is beyond the one before
    assert push.high == pytest.approx(np.sin(5 * trace.t[101:201]).mean(), abs=0.02)


@renders
@pytest.mark.parametrize("plant", ["duffing"])
def test_an_arrow_ends_where_the_bar_of_its_range_does(plant):
    """MuJoCo draws an arrow in half the length of a capsule between the same points."""
    trace = smc.run(smc.Scenario(plant=plant, law="none", duration=0.01, x0=0.0))
    ends = []
    with Stage([trace], ["#0072B2"], (640, 360), camera.Room(200, 100, 440, 300)) as scene:
        scene.pose(0, trace.x[0])
        empty = scene.render().astype(int)
        for head in (True, False):
            arrow = Arrow(0.0, 1.0, (1.0, 0.0, 0.0, 1.0), head=head)
            drawn = np.abs(scene.render([(0, 0, arrow)]) - empty).max(axis=2) > 60
            ends.append(np.flatnonzero(drawn.any(axis=0)).max())
    assert ends[0] == pytest.approx(ends[1], abs=4)


@renders
def test_a_torque_s_arrow_points_to_where_it_moves_the_pendulum():
    trace = smc.run(smc.Scenario(plant="inverted_pendulum", law="none", duration=0.01, x0=0.0))

    def column(picture):
        """Return the mean column of what differs from the pendulum upright, from the middle."""
        return np.nonzero(np.abs(picture.astype(int) - upright).max(axis=2) > 60)[1].mean() - 320

    with Stage([trace], ["#0072B2"], (640, 360), camera.Room(200, 100, 440, 300)) as scene:
        scene.pose(0, np.array([0.0]))
        upright = scene.render().astype(int)
        left, right = (column(scene.render([(0, 0, Arrow(0.0, end, (1.0, 0.0, 0.0, 1.0)))])) for end in (-1.0, 1.0))
        scene.pose(0, np.array([0.4]))
        leaning = column(scene.render())
    assert leaning * right > 0.0 > leaning * left


@renders
def test_a_failed_machine_turns_grey_stays_where_it_was_and_has_no_goal(monkeypatch):
    good, bad = runs("inverted_pendulum", laws=LAWS[:2])
    goals = []
    monkeypatch.setattr(Stage, "aim", lambda stage, k, r: goals.append((k, r is None or r[0] - traces[k].r[0, 0])))
    traces = good, bad
    before, after, later = pictures([good, failed(bad, 150)], [0.1, 0.2, 0.3])
    assert goals == [(0, 0.0), (1, 0.0), *[(0, 0.0), (1, True)] * 2]
    orange = style.law_colour(LAWS[1])
    assert share(before, orange) > 3e-4
    assert share(after, orange) < 0.2 * share(before, orange)  # brass is left
    right = machines(after).shape[1] // 2
    assert np.abs(machines(after)[:, right:].astype(int) - machines(later)[:, right:]).max() < 30


@pytest.mark.slow
@renders
def test_a_machine_that_fails_at_once_is_grey_from_the_start():
    good, bad = runs("pendulum_network", laws=LAWS[::3])
    first, last = pictures([failed(bad, 0)], [0.0, 0.3])
    assert share(first, style.law_colour(LAWS[3])) == 0.0
    assert np.abs(machines(first).astype(int) - machines(last)).max() < 30
    pictures([good, failed(bad, 0)], [0.0, 0.3], charts=True)


@pytest.mark.slow
@renders
def test_a_jump_changes_the_machine_and_is_told():
    jump = smc.Jump(0.2, {"l": 1.5})
    trace = smc.run(smc.Scenario(plant="inverted_pendulum", law="classical", duration=0.4, jump=jump))
    room = camera.Room(10, 10, 470, 160)
    with Stage([trace], ["#0072B2"], (480, 170), room) as stage:
        lengths = []
        for time in (0.1, 0.3, 0.1):
            stage.set_shape(0, time)
            lengths.append(float(stage.model.geom("m0/bob").pos[2]))
    assert lengths == pytest.approx([0.5, 0.75, 0.5])
    before, after = pictures([trace], [0.1, 0.3])
    corner = slice(10, 50), slice(300, None)
    assert (after[corner].mean(axis=2) < 80).sum() > 2 * (before[corner].mean(axis=2) < 80).sum()


@pytest.mark.parametrize("plant", ["inverted_pendulum", "duffing"])
def test_long_words_stay_in_the_picture(plant):
    bad = [failed(trace, 150, "it blew up") for trace in runs(plant)]
    names, size = ["a label of more than forty letters, number " + str(i) for i in range(4)], (1280, 460)
    scales, row = {driven(bad): Scale(6.0, 0.2)}, plant != "duffing"
    caption = Caption(bad, names, ["#0072B2"] * 4, "A long title " * 20, size, 1.0, scales, row=row)
    caption.place(np.array([[300.0 * k, 80.0 * k, 300.0 * k + 290, 80.0 * k + 200] for k in range(4)]))
    assert (caption.pills[:, :2] >= 0).all()
    assert (caption.pills[:, 2:] <= size).all()
    assert (caption.pills[:, 2] - caption.pills[:, 0] > [caption.width(text) - 1e-9 for text in caption.texts()]).all()
    assert all(text.endswith("…: failed at 0.15 s") for text in caption.texts())
    assert caption.title.endswith("…")
    assert 24 + style.width(caption.title, 24, bold=True) < 1280 - 24 - style.width("10.00 s", 24, bold=True)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no masks of signals")
def test_an_encoder_that_is_started_never_receives_ctrl_c():
    with encoder.sigint_blocked():
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


def test_without_opengl_one_sentence_says_what_to_do(monkeypatch, tmp_path):
    monkeypatch.setattr(gl, "missing", lambda: "no film: install a renderer")
    with pytest.raises(smc.ScenarioError, match="install a renderer"):
        film.film(runs(laws=LAWS[:1]), tmp_path / "a.mp4")


# realistic mechanisms

ROOM = camera.Room(10, 10, 470, 160)
VARIANTS = [
    (plant, field, name)
    for plant in smc.plants()
    for field, offered in (("contact", "contacts"), ("mechanism", "mechanisms"))
    for name in getattr(smc.plant(plant), offered)
]


def realistic(law: str = "observer_free", plant: str = "duffing", **parts) -> smc.Trace:
    given = smc.paper.scenario(plant, law).law
    return smc.run(smc.Scenario(plant=plant, law=given, **({"duration": 2.0} | parts)))


def moods(trace: smc.Trace, fps: float = 30.0) -> list[tuple[str | None, int]]:
    """What a film tells of a trace, and for how many frames."""
    told = states.timeline(trace, seconds(trace, fps))
    return [(now.words if now else None, len(list(run))) for now, run in itertools.groupby(told)]


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
    scenario = smc.Scenario(plant=plant, law="none", x0=start, duration=0.1, **{field: name})
    model = scene.compose([scenario] * 2, np.array([[0.0, 0, 0], [0, 9, 0]]), SIZE)
    shown = {model.geom(i).name for i in range(model.ngeom)}
    wanted = [geom.name for geom in models.spec(scenario).geoms if geom.name not in ("", "floor")]
    assert [f"m{k}/{geom}" for k in range(2) for geom in wanted if f"m{k}/{geom}" not in shown] == []
    assert model.nskin == 2 * len(models.spec(scenario).skins)


def stood(scenarios) -> np.ndarray:
    """Where machines stand."""
    found = [puppet.Puppet(scenario) for scenario in scenarios]
    reaches = [each.reach(smc.run(scenario)) for each, scenario in zip(found[:1], scenarios, strict=False)]
    return stage.standing_places(found, reaches * len(found), scene.turn(scenarios[0]))


@pytest.mark.parametrize(("plant", "field", "name"), VARIANTS[::6], ids=str)
def test_machines_side_by_side_keep_apart(plant, field, name):
    start = None if smc.plant(plant).ranges else 0.5
    scenario = smc.Scenario(plant=plant, law="none", x0=start, duration=0.1, **{field: name})
    corners = scene.fixed_boxes(models.compile_model(scenario))[..., :2]
    low, high = corners.min(axis=1), corners.max(axis=1)
    step = stood([scenario] * 3)[1, :2] - stood([scenario] * 3)[0, :2]
    for by in (step, 2 * step):
        apart = np.maximum(low[:, None] + by - high[None], low[None] - high[:, None] - by).max(axis=2)
        assert apart.min() >= 0.0


def test_realistic_carts_stand_so_far_behind_each_other_that_no_part_of_one_meets_another(monkeypatch):
    """One reaches from y = -0.45 to 0.82 m, the two parts of the other from -0.5 to 1.42 m."""
    cart = smc.Scenario(plant="duffing", law="none", contact="stops", x0=0.5)
    turn = scene.turn(cart)
    bounds = [[(-0.45, 0.82)], [(-0.5, -0.3), (0.1, 1.42)]]
    boxes = [np.array([[(0.0, low, 9.0), (1.0, high, 8.0)] for low, high in machine]) for machine in bounds]
    for order, apart in (((0, 1), 1.37), ((0, 1, 0), 1.92)):  # 0.82 + 0.5 and 1.42 + 0.45, and a gap of 5 cm
        machines = iter(boxes[k] for k in order)
        monkeypatch.setattr(scene, "fixed_boxes", lambda model, machines=machines: next(machines))
        monkeypatch.setattr(models, "compile_model", lambda scenario: None)
        assert scene.lane([cart] * len(order), [], turn) == pytest.approx([0.0, apart, 0.0])


def test_ideal_machines_stand_where_their_plant_says_and_nothing_is_told_of_them():
    (trace,) = runs(laws=LAWS[:1])
    assert np.diff(stood([trace.scenario] * 2), axis=0) == pytest.approx(np.array([trace.scenario.plant.lane]))
    assert moods(trace) == [(None, 10)]
    assert scales([trace])[driven([trace])].reaction == 0.0
    assert not any("violet" in words for words in key([trace], scales([trace])))


def test_a_joint_is_told_to_stick_from_when_it_rests_and_to_slide_before(stuck):
    (first, slides), (second, _) = moods(stuck)
    assert (first, second) == ("slides", "sticks")
    moving = np.flatnonzero(np.abs(stuck.v) > 1e-3 * np.abs(stuck.v).max())[-1]
    assert slides / 30 == pytest.approx(stuck.t[moving] + states.MIN_STATE_TIME, abs=0.04)  # it has rested so long


def test_a_cart_rests_beside_the_speed_of_carts_and_not_of_its_pole():
    trace = smc.run(smc.Scenario(plant="cart_pole", law="none", x0=0.0, duration=0.01))
    fast = dataclasses.replace(trace, v=np.column_stack([np.full(11, 0.05), np.linspace(100.0, 0.0, 11)]))
    assert not states.at_rest(fast)[:, 0].any()
    assert states.at_rest(fast)[:, 1].tolist() == [False] * 10 + [True]


def test_only_dry_friction_sticks():
    assert moods(realistic(friction=smc.Viscous(1.0))) == [(None, 61)]
    for cf, cfq in itertools.product((0.0, 2e-3), repeat=2):
        twin = smc.Scenario(plant=smc.plant("furuta", cf=cf, cfq=cfq), law="none")
        assert states.has_dry_friction(twin) is (cf > 0.0 or cfq > 0.0)
    assert moods(realistic(friction=Coulomb(0.0))) == [(None, 61)]
    assert moods(realistic(friction=LuGre(0.5, 0.8, 0.05)))[-1][0] == "sticks"
    assert moods(realistic("none", contact="floor", x0=0.9, duration=1.0))[-1][0] == "sticks"


def test_a_blow_of_milliseconds_is_told_as_long_as_it_takes_to_read(hit):
    touching = hit.t[states.in_contact(hit)[:, 0]]
    assert 0.0 < np.ptp(touching) < 0.05
    (before, _), (blow, frames), (after, _) = moods(hit)
    assert (before, blow, after) == (None, "contact", None)
    assert frames / 30 >= states.MIN_STATE_TIME
    words = [now.words if now else None for now in states.timeline(hit, seconds(hit))]
    assert words.index("contact") == np.ceil(touching[0] * 30)  # at once, and not before


def test_touch_is_where_the_stop_pushes_and_there_only(hit):
    pushed = np.abs(hit.reaction[:, 0]) > 1e-6
    touch = states.in_contact(hit)[:, 0]
    assert touch.any()
    # the reaction is that of the step before, and a dashpot lets go before the buffers part
    assert not (pushed & ~touch & ~np.roll(touch, 1)).any()


def test_flanks_are_told_by_where_they_push():
    slack = realistic(plant="inverted_pendulum", actuator=smc.Backlash(0.15), duration=1.0)
    names = {-1: "left flank", 1: "right flank", 0: "in play"}
    flank = np.sign(slack.reaction[:, 0]).astype(int)
    told = states.timeline(slack, slack.t)
    for now, k in zip(told, range(len(slack.t)), strict=True):
        near = slice(max(k - 300, 0), k + 300)
        assert now is not None
        assert now.words == "rattles" or now.words in {names[f] for f in flank[near].tolist()}
    rattling = np.where(np.arange(1001) // 20 % 2, 1.0, -1.0)
    assert (states.backlash_side(rattling, slack.t, states.MIN_STATE_TIME)[200:] == 2).all()
    assert (states.backlash_side(np.ones(1001), slack.t, states.MIN_STATE_TIME) == 1).all()


def test_what_is_held_lasts_and_has_no_short_gaps():
    t = np.arange(100) * 0.01
    on = np.zeros(100, bool)
    on[[10, 40, 70]] = True
    assert np.flatnonzero(np.diff(states.extended(on, t, 0.16).astype(int))).tolist() == [9, 85]
    assert np.flatnonzero(np.diff(states.extended(on, t, 0.1).astype(int))).tolist() == [9, 19, 39, 49, 69, 79]
    assert not states.extended(on & False, t, 0.15).any()


def test_words_never_flicker():
    rng, times = np.random.default_rng(0), np.arange(300) / 30
    names = [states.State("a", states.CALM), states.State("b", states.STUCK), states.State("hit", states.STRUCK)]
    found = [names[i] for i in rng.choice(3, 300, p=(0.48, 0.48, 0.04))]
    shown = states.debounced(found, times, states.MIN_STATE_TIME)
    runs = [(now, len(list(run))) for now, run in itertools.groupby(shown)]
    assert all(frames >= 5 or now == names[2] for now, frames in runs[1:-1])
    assert all(after == now for after, now in zip(shown, found, strict=True) if now == names[2])
    assert shown.index(names[2]) == found.index(names[2])  # nothing is told to hit before it does


def test_several_channels_are_told_in_one():
    assert states.stick_words(np.array([True, True, False])) == "2 of 3 stick"
    assert states.stick_words(np.ones(3, bool)) == "sticks"
    assert states.stick_words(np.zeros(3, bool)) == "slides"
    assert states.backlash_words([0, 0, 1]) == "2 of 3 in play"
    assert states.backlash_words([-1, -1]) == "left flank"


def test_a_failed_machine_has_no_state(stuck):
    told = states.timeline(failed(stuck, 500), np.array([0.1, 0.49, 0.5, 1.0]))
    assert [now is None for now in told] == [False, False, True, True]
    assert states.timeline(film.finite(failed(stuck, 0)), np.array([0.0, 1.0])) == [None, None]


@pytest.mark.slow
@renders
def test_a_tendon_that_a_mechanism_shows_is_drawn_where_it_is():
    def add(spec):
        spec.body("machine").add_site(name="post", pos=(0, -0.5, 0.8))
        spec.body("cart").add_site(name="hook", pos=(0, 0, 0.2))
        line = spec.add_tendon(name="line", width=0.03, rgba=(0.5, 0.0, 1.0, 1.0))
        line.wrap_site("post")
        line.wrap_site("hook")

    base = smc.plant("duffing")
    tied = dataclasses.replace(base, mechanisms={"tied": Variant(add, base.fields)})
    trace = smc.run(smc.Scenario(plant=tied, law="none", mechanism="tied", duration=0.1))
    (with_line,), (without,) = pictures([trace], [0.1]), pictures(runs(laws=LAWS[:1]), [0.1])
    assert share(with_line, style.REACTION) > share(without, style.REACTION) + 3e-3


@pytest.mark.slow
@renders
def test_a_rotor_lies_on_the_flank_that_pushes_and_a_cart_on_its_bed():
    slack = realistic(plant="inverted_pendulum", actuator=smc.Backlash(0.2), duration=0.5)
    with Stage([slack], ["#0072B2"], (480, 170), ROOM) as shown:
        rotor, joint = (shown.data.joint(f"m0/{name}") for name in ("rotor:hinge", "hinge"))
        for flank in (-1.0, 0.0, 1.0):
            shown.pose(0, np.array([0.3]), np.array([flank * 0.1]))
            assert (rotor.qpos[0], joint.qpos[0]) == pytest.approx((0.3 + flank * 0.1, 0.3))
    pushed = np.flatnonzero(slack.reaction[:, 0] > 0)[0]
    ahead = act.rotors(slack, np.append(-1e-3, slack.t))
    assert ahead[pushed + 1, 0] == pytest.approx(0.1)
    assert np.abs(ahead).max() <= 0.1
    resting = realistic(contact="floor", duration=0.2)
    with Stage([resting], ["#0072B2"], (480, 170), ROOM) as shown:
        shown.pose(0, np.array([0.4]))
        assert shown.data.joint("m0/lift").qpos[0] == 0.0


@renders
def test_friction_draws_an_arrow_of_its_own_and_the_key_says_so(stuck):
    bare = dataclasses.replace(stuck, reaction=np.zeros_like(stuck.reaction))
    (rubbed,), (smooth,) = pictures([stuck], [0.5]), pictures([bare], [0.5])
    assert share(rubbed, style.REACTION) > share(smooth, style.REACTION) + 3e-4
    assert "violet arrow: friction, longest 0.5 N" in key([stuck], scales([stuck]))


def test_a_blow_is_cut_at_the_control_s_scale_and_the_key_says_so(hit):
    found = scales([hit])
    scale = found[driven([hit])]
    assert scale.reaction == scale.control < np.abs(hit.reaction).max()
    assert f"violet arrow: contact, longest {scale.control:.2g} N or more" in key([hit], found)


@pytest.mark.parametrize(
    ("peak", "samples", "longest", "words"),
    [
        (9.0, 20, 2.0, "2 N·m or more"),
        (9.0, 25, 9.0, "9 N·m"),
        (3.9, 20, 3.9, "3.9 N·m"),
        (4.1, 20, 2.0, "2 N·m or more"),
    ],
)
def test_a_brief_peak_of_a_channel_does_not_set_the_longest_arrow(peak, samples, longest, words):
    """One of three pendulums is driven with 2 N m; brief is up to 2 % of its 1001 samples."""
    (trace,) = smc.run([smc.Scenario(plant=smc.plant("pendulum_network", n=3), law="none", duration=1.0)])
    force = np.zeros((1001, 3))
    force[:, 1] = np.where(np.arange(1001) < samples, -peak, 2.0)
    found = scales([dataclasses.replace(trace, applied=force, d=force)])
    scale = found[driven([trace])]
    assert (scale.control, scale.disturbance) == (longest, longest)
    said = key([trace], found)
    assert {f"arrow: mean control, longest {words}", f"dark arrow: disturbance, longest {words}"} <= {*said}


@pytest.mark.slow
@renders
def test_the_state_stands_in_a_badge_beside_the_label_in_the_picture():
    plant = "inverted_pendulum"
    traces = [realistic(law, plant, friction=Coulomb(0.5)) for law in LAWS]
    told = [states.timeline(trace, seconds(trace)) for trace in traces]
    names = style.labels(traces, None)
    caption = Caption(traces, names, ["#0072B2"] * 4, None, (1280, 460), 1.0, scales(traces), told, row=True)
    with Stage(traces, ["#0072B2"] * 4, (1280, 460), caption.room) as shown:
        caption.place(shown.boxes)
    boxes = np.concatenate([caption.pills, caption.badges])
    assert (boxes[:, :2] >= 0).all()
    assert (boxes[:, 2:] <= (1280, 460)).all()
    for i, j in itertools.combinations(range(8), 2):
        assert np.maximum(boxes[i, :2] - boxes[j, 2:], boxes[j, :2] - boxes[i, 2:]).max() >= -1e-9
    (early,), (late,) = pictures(traces, [0.1], size=(1280, 720)), pictures(traces, [1.9], size=(1280, 720))
    left, top, right, bottom = caption.badges[0].round().astype(int)
    assert early[top + 4 : bottom - 4, left + 4 : right - 4].mean() > 170  # pale: it slides
    assert late[top + 4 : bottom - 4, left + 4 : right - 4].mean() < 120  # dark: it is held


def test_behind_a_drive_the_force_is_shown_and_the_command_pale():
    slow = realistic(plant="inverted_pendulum", actuator=smc.Lag(0.2), duration=0.2)
    found = scales([slow])
    assert found[driven([slow])].drive
    both = arrows(loads(slow, np.array([0.05, 0.06])), 0, 0, found[driven([slow])], "#0072B2")
    solid, pale = (arrow for arrow in both if arrow.head)
    assert abs(solid.high) < 0.5 * abs(pale.high)  # a quarter of the lag's time constant
    assert (solid.rgba[3], pale.rgba[3]) == (1.0, 0.45)
    assert (solid.layer, pale.layer) == (0, 1)
    assert "pale arrow: command" in key([slow], found)
    strong = scales([dataclasses.replace(slow, force=3.0 * slow.applied)])[driven([slow])]
    assert strong.control == pytest.approx(3.0 * np.abs(slow.applied).max())
    assert not any("pale" in words for words in key(runs(laws=LAWS[:1]), scales(runs(laws=LAWS[:1]))))


def test_a_strip_shows_which_count_an_encoder_reads():
    (trace,) = runs("inverted_pendulum", laws=LAWS[:1])
    coarse = dataclasses.replace(trace, scenario=dataclasses.replace(trace.scenario, sensor=smc.Encoder(counts=64)))
    places = []
    for x in (0.0, 0.03, 0.06, 0.09):  # a count is 0.098 rad
        still = dataclasses.replace(coarse, x=np.full((301, 1), x))
        caption = Caption([still], ["a"], ["#0072B2"], None, (1280, 460), 1.0, scales([still]), [[None]])
        caption.place(np.array([[400.0, 100, 800, 380]]))
        picture = caption.over(np.full((460, 1280, 3), 255, np.uint8), 0.1, (False,), (None,))
        left, top, right, bottom = caption.badges[0].round().astype(int)
        strip = picture[top:bottom, left:right].astype(int)
        blue = (strip[..., 2] - strip[..., 0]) > 100
        places.append((np.flatnonzero(blue.any(axis=0)).mean() - strip.shape[1] / 2) / (strip.shape[1] / 6))
    assert places == pytest.approx([0.0, -0.31, 0.39, 0.08], abs=0.06)  # (reading - position) / count
    assert caption.pills[0, 2] < caption.badges[0, 0]  # there is room beside the label
    assert any("counts of the encoder" in words for words in key([coarse], scales([coarse])))


def test_an_arm_of_many_joints_is_shown_whole():
    (trace,) = smc.run([smc.Scenario(plant=smc.plant("pendulum_network", n=8), law="none", duration=0.01)])
    assert any("first 6 of 8 pendulums" in words for words in key([trace], scales([trace])))
    arm = dataclasses.replace(trace.scenario.plant, direct=True)
    mine = dataclasses.replace(trace, scenario=dataclasses.replace(trace.scenario, plant=arm))
    assert not any("first 6" in words for words in key([mine], scales([mine])))
