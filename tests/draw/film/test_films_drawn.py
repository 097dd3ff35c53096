"""What films of made-up motion draw: letters and badges, charts, arrows, bars, and the words for
states.
"""

import contextlib
import dataclasses
import itertools
from pathlib import Path

import numpy as np
import pytest
from helpers.films import picture, sheet, staged
from helpers.runs import at_defaults
from helpers.sketch import failed, made
from helpers.sources import loaded
from PIL import Image

import smc_mujoco as smc
from smc_mujoco.common import gl, progress
from smc_mujoco.draw import states, style
from smc_mujoco.draw.figure import DrawnRuns
from smc_mujoco.draw.film import arrow_lines, arrows, charts, film, flight, world
from smc_mujoco.draw.film.sheet import Moment, Sheet, head_lines, label_sizes, least_gains, room_of
from smc_mujoco.draw.states import State

SIZE = (640, 300)


def machine(plant: str, law: str = "classical", **fields) -> smc.Trace:
    trace = made(smc.Scenario(plant=plant, law=at_defaults(law), **{"duration": 1.0} | fields))
    if trace.scenario.realistic:
        return trace
    return dataclasses.replace(trace, reaction=0.0 * trace.reaction)


def paper(size=SIZE) -> np.ndarray:
    return np.full((size[1], size[0], 3), 255, np.uint8)


@pytest.mark.parametrize("wide", [300, 150])
def test_labels_stay_below_their_tiles_on_as_many_lines_as_were_measured(wide):
    traces = [machine("duffing"), machine("duffing", "adaptive")]
    names = ["one", "one that has a long name"]
    size = (640, 360)
    high = float(label_sizes(names, size, wide)[0][:, 1].max())
    tiles = np.array([[0, 60, wide, 160], [wide + 2, 60, 2 * wide + 2, 160]])
    labels = np.array([[left_edge, 160, right, 160 + high] for left_edge, _, right, _ in tiles])
    runs = DrawnRuns.of(traces, names)
    page = Sheet(runs, size, tiles, labels)
    drawn = [text for text in page.page.texts if text.get_text().replace("\n", " ") in names]
    assert len(drawn) == 2
    for text, (left_edge, top, right, bottom) in zip(drawn, labels, strict=True):
        box = text.get_window_extent()
        assert left_edge <= box.x0 < box.x1 <= right
        assert top <= size[1] - box.y1 < size[1] - box.y0 <= bottom + 1.0
    assert ("\n" in drawn[1].get_text()) == (wide == 150)


def test_the_clock_the_pace_what_changed_and_what_is_said_are_told_at_their_time():
    parts = {"friction": smc.Coulomb(0.2), "jump": smc.Jump(0.2, {"mass": 2.0})}
    traces = [machine("duffing", **parts), machine("duffing", "adaptive", **parts)]
    tiles = np.array([[0, 60, 320, 160], [320, 60, 640, 160]])
    page = Sheet(DrawnRuns.of(traces, ["one", "other"]), (640, 360), tiles, 1.0 * tiles)
    blank = np.zeros((100, 320, 3), np.uint8)
    hit = State("hit, 5 N", style.REACTION, 0.5)
    for time, speed, clock, pace, changed in (
        (0.1, 1.0, "0.10 s", "", False),
        (0.3, 0.125, "0.300 s", "8× slower", True),
        (0.9, 4.0, "0.90 s", "4× faster", True),
    ):
        frame = page.picture(Moment(time, speed, (hit, None)), (blank, blank))
        assert (page.clock.get_text(), page.pace.get_text()) == (clock, pace)
        assert (page.below.get_text() == "mass × 2 since 0.2 s") is changed
        assert [text.get_text() for text in page.says] == ["hit, 5 N", ""]
        assert frame[60:160, :320].any()
        assert not frame[60:160, 322:638].any()


def test_the_pace_is_apart_from_the_key_on_its_line():
    """ "back to front 2× slower" read as one phrase."""
    runs = DrawnRuns.of([machine("duffing")], ["one"])
    box = np.array([[0, 60, 320, 160]])
    dotted = {}
    for count in range(46, 58):
        page = Sheet(runs, (640, 360), box, 1.0 * box, "", ["l" * count], lines=1)
        page.picture(Moment(0.1, 0.125, (None,)), [np.zeros((100, 320, 3), np.uint8)])
        renderer = page.canvas.get_renderer()
        pace = page.pace.get_window_extent(renderer).x0
        gap = (pace - page.below.get_window_extent(renderer).x1) / page.letters
        dotted[gap] = page.pace.get_text()
    assert min(dotted) > 0.2
    for gap, words in dotted.items():
        assert words == ("8× slower" if gap > 1.5 else "· 8× slower"), gap
    assert len(set(dotted.values())) == 2


def test_a_blow_is_told_with_its_times_and_then_no_more():
    named = HINGES.replace('<body pos="0 0 1">', '<body name="link" pos="0 0 1">')
    plant = smc.plant_from(named, ["j", "k"], name="own")
    push = smc.signals.Push("link", x=400.0, time=1.0, width=0.05)
    trace = machine(plant, "none", duration=3.0, disturbance=push)
    page = sheet([trace], ["one"])
    opacities = {}
    for time in (0.99, 1.02, 1.08, 1.5):
        picture(page, time, 0.125)
        if page.below.get_text() == "blow of 400 N, 1.00 to 1.05 s":
            opacities[time] = page.below.get_alpha()
    assert opacities == pytest.approx({1.02: 1.0, 1.08: 0.6})
    assert page.below.get_alpha() == 1.0


def test_words_over_machines_are_on_one_line_where_they_have_room():
    size = (800, 450)
    trace = machine("duffing")
    key = ["→ u 6 N"]
    lines = []
    for run, title, keys in (
        (trace, "Duffing", [key]),
        (trace, "Duffing under a title that is long", [key]),
        (trace, "Duffing", [key, ["last periods, deflections × 1000"] * 2]),
        (machine("duffing", jump=smc.Jump(0.2, {"mass": 2.0})), "Duffing", [key]),
        (machine("duffing", jump=smc.Jump(0.2, {"mass": 2.0})), " ", [key * 9]),
    ):
        lines.append(head_lines(DrawnRuns.of([run], ["one"]), size, title, keys))
    assert lines == [1, 2, 2, 2, 1]
    for law, count in ((smc.law("pid", kp=9.0), 1), (at_defaults("pid"), 2)):
        runs = DrawnRuns.of([made(smc.Scenario(plant="duffing", law=law))], None)
        assert head_lines(runs, size, "A title of middle length", [key]) == count, "told"
    mixed = "gains: default for PID, given for ADRC"
    assert [*map(least_gains, (mixed, "gains: default", "gains: given"))] == [
        "gains partly default",
        "gains: default",
        "",
    ]
    tile, label = np.zeros((1, 4), int), np.array([[0, 200, 800, 240]])
    page = Sheet(DrawnRuns.of([trace], ["one"]), size, tile, label, "Duffing", key, lines=1)
    picture(page, 0.5, 0.125)
    words = [page.page.texts[0], page.below, page.pace, page.clock]
    assert page.below.get_text().startswith("→ u 6 N")
    boxes = [text.get_window_extent() for text in words]
    for before, after in itertools.pairwise(boxes):
        assert before.x1 < after.x0
    assert min(box.y0 for box in boxes) > size[1] - room_of(size, 1).top
    full = Sheet(DrawnRuns.of([trace], ["one"]), size, tile, label, "Duffing " * 4, lines=1)
    assert full.key == "", "whole words or none"
    bare = Sheet(DrawnRuns.of([trace], ["one"]), size, tile, label, "", ["u 6 N " * 40], lines=1)
    assert bare.key.startswith("u 6 N u"), "it is cropped, as on a line of its own"
    place = bare.below.get_window_extent(bare.canvas.get_renderer()).x0
    assert place == pytest.approx(page.page.texts[0].get_window_extent().x0, abs=1.0)


@pytest.mark.skipif(gl.missing_renderer() is not None, reason=str(gl.missing_renderer()))
def test_the_front_rotors_of_a_drone_have_the_colour_of_its_law_and_stay_transparent():
    with staged(machine("quadrotor", "geometric"), SIZE, colour="#0072B2") as stage:
        for name, is_own in (("disc1", True), ("disc2", False)):
            shade = stage.model.geom(f"m/{name}").rgba
            own = np.array(style.rgb("#0072B2")) / 255
            assert (np.abs(shade[:3] - own).max() < 0.01) == is_own
            assert 0.0 < shade[3] < 1.0


@pytest.mark.skipif(gl.missing_renderer() is not None, reason=str(gl.missing_renderer()))
def test_the_wind_on_a_drone_has_its_arrow_over_it_and_its_path_a_map():
    drone = smc.plant("quadrotor")
    wind = smc.signals.Wind(4.0, time=0.1, width=0.4)
    trace = smc.run(
        smc.Scenario(plant=drone, law="geometric", x0=drone.rest, disturbance=wind, duration=0.4)
    )
    error, path = charts.strip([trace])
    assert (error.quantity, path.quantity) == ("distance", "path")
    assert flight.plane(path.traces).tolist() == [0, 2]
    yaw = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.5])
    turned = dataclasses.replace(trace, x=trace.x + yaw)
    assert [panel.label[:8] for panel in charts.strip([turned])] == ["|x − r| "] * 2
    with staged(trace, SIZE) as stage:
        stage.arrange(trace.x[-1])
        stage.forward()
        for way in np.eye(3):
            arrow = arrows.Arrow(0.0, 1.0, arrows.WHITE, way=way)
            arrow_path = arrow_lines.path(stage.model, stage.data, stage.mounts[0], arrow)
            assert arrow_path
            drawn = stage.project(arrow_path[0])[:, 1].max()
            tops = world.boxes(stage.model, stage.data)[stage.links].max(axis=1)
            assert drawn < stage.project(tops)[:, 1].min()


def test_panels_are_uncovered_up_to_the_clock_with_a_dot_where_each_run_is():
    parts = {"friction": smc.Coulomb(0.2), "jump": smc.Jump(0.4, {"mass": 2.0})}
    lost = failed(machine("duffing", "adaptive", **parts), 600, "the law raised ValueError: no")
    lost = dataclasses.replace(lost, x=0.5 * lost.x, u=0.3 * lost.u)
    page = sheet([machine("duffing", **parts), lost], ["one", "other"])
    runs = page.runs
    full, empty = page.full[..., :3], page.empty[..., :3]
    dots_seen = []
    for time in (0.3, 0.8):
        image = picture(page, time)
        for (left_edge, top, right, bottom), panel in zip(page.frames, page.moving, strict=True):
            now = round(left_edge + (right - left_edge) * time / panel.axes.get_xlim()[1])
            past = np.s_[top:bottom, left_edge : now - 14]
            future = np.s_[top:bottom, now + 14 : right]
            assert (image[past] == full[past]).all()
            assert (image[future] == empty[future]).all()
            column = image[: bottom + 20, now].astype(int)
            column[: top - 20] = 255
            for colour, (_, t, y) in zip(runs.colours, reversed(panel.dots), strict=True):
                dot = np.flatnonzero(np.abs(column - style.rgb(colour)).max(axis=1) < 3)
                assert time <= t[-1] or not len(dot)  # a run that failed has none
                dots_seen += [(colour, time)] * bool(len(dot))
                if len(dot):
                    place = (time, np.interp(time, t, y))
                    height = 720 - panel.axes.transData.transform(place)[1]
                    assert dot.mean() == pytest.approx(height, abs=3.0)
    counts = [dots_seen.count(pair) for pair in itertools.product(runs.colours, (0.3, 0.8))]
    assert counts == [2, 2, 1, 0]  # where both are in one place the first is on top


HINGES = """
<mujoco model="arm"><worldbody>
  <camera name="first" pos="0 -3 1" xyaxes="1 0 0 0 0 1"/><geom name="wall" type="box"
    size=".1 .1 1" pos="-.5 0 1"/>
  <body pos="0 0 1"><joint name="j" axis="0 1 0"/><geom type="capsule" size=".05"
    fromto="0 0 0 0 0 .5"/>
    <body pos="0 0 .5"><joint name="k" axis="0 0 1"/><geom size=".1" pos=".2 0 0"
      rgba=".2 .9 .2 1"/></body></body>
</worldbody><actuator><motor joint="j"/><motor joint="k"/></actuator></mujoco>"""
KINDS = {
    "rails behind each other": {"plant": "van_der_pol"},
    "pendulums on a gear": {
        "plant": "inverted_pendulum",
        "actuator": smc.Backlash(0.2),
        "jump": smc.Jump(0.5, {"l": 1.5}),
    },
    "network": {"plant": "pendulum_network"},
    "carts with poles": {"plant": "cart_pole"},
    "a model of one's own": {"plant": smc.plant_from(HINGES, ["j", "k"], name="own")},
}


@pytest.mark.skipif(gl.missing_renderer() is not None, reason=str(gl.missing_renderer()))
@pytest.mark.parametrize("kind", KINDS)
def test_a_machine_stays_in_its_tile_with_its_arrows(kind):
    trace = machine(law="none", **KINDS[kind])
    red = (1.0, 0.0, 0.0, 1.0)
    with staged(trace, SIZE, strip=40.0) as stage:
        n = stage.puppet.shown
        stage.arrange(np.linspace(-0.3, 0.4, n), np.full(n, 0.1), 0.2, np.full(n, 0.1))
        before = stage.render()
        assert set(stage.links).isdisjoint(np.flatnonzero(stage.model.geom_group > 2))
        drawn = [
            (0, arrows.Arrow(0.0, 0.8, red)),
            (0, arrows.Arrow(-0.7, 0.3, red, 1, 0.65, head=False)),
        ]
        stage.arrange(np.linspace(0.25, 0.3, n))
        red_parts = []
        for picture in map(np.asarray, (before, stage.render(drawn))):
            red_parts.append(
                (picture[:, :, 0] > 120 + picture[:, :, 1:].max(axis=2).astype(int)).sum()
            )
        assert red_parts[0] == 0
        assert red_parts[1] > 20


GEAR = {"actuator": smc.Backlash(0.2)}
RUB = {"friction": smc.Coulomb(0.2)}
FLANKS = {"left flank", "right flank"}
# parts, words while it moves, rests and touches; whether it has dry friction, and contact
STATES = [
    (RUB, {None}, {"sticks"}, {None}, True, False),
    (GEAR, FLANKS, FLANKS, None, False, False),
    (
        RUB | GEAR,
        FLANKS,
        {"sticks, right flank"},
        None,
        True,
        False,
    ),
    ({"contact": "stops"}, {None}, {None}, {"hit, 1 N"}, False, True),
    ({"contact": "stops"} | GEAR, FLANKS, FLANKS, {"hit, 1 N"}, False, True),
    ({"friction": smc.Viscous(1.0)} | GEAR, FLANKS, FLANKS, None, False, False),
    ({}, {None}, {None}, {None}, False, False),
]


@pytest.mark.quick
@pytest.mark.parametrize(
    ("parts", "moving", "resting", "touching", "dry", "stops"), STATES, ids=range(len(STATES))
)
def test_a_machine_is_told_to_stick_touch_or_lie_on_a_flank_when_it_does(
    parts, moving, resting, touching, dry, stops
):
    """It moves in even seconds, rests in odd ones, and touches a stop at the start of each."""
    trace = made(
        smc.Scenario(
            plant="duffing",
            law="none",
            duration=4.0,
            **parts,
        )
    )
    still = (trace.t % 2.0 > 1.0)[:, None]
    pushes = (np.sign(np.sin(3.0 * trace.t)) * ((trace.t % 1.0 > 0.2) | (trace.t % 1.0 < 0.01)))[
        :, None
    ]
    x = np.where(trace.t % 1.0 < 0.01, 2.0, 0.1)[:, None]
    moved = {
        "x": x,
        "v": np.where(still, 0.0, 1.0),
        "reaction": pushes,
        "force": -pushes,
    }
    times = np.arange(0.0, 4.0, 1 / 30)
    reported = states.timeline(dataclasses.replace(trace, **moved), times)
    words = [now and now.words for now in reported]
    time_to_tell = states.HOLD_TIME + states.MIN_STATE_TIME + 0.02 if stops else 0.4
    for second, expected in (
        (0, moving),
        (1, resting),
        (2, moving),
        (3, resting),
    ):
        assert {
            word
            for word, t in zip(words, times, strict=True)
            if second + time_to_tell < t < second + 0.95
        } <= expected
    if touching:
        assert {
            word for word, t in zip(words, times, strict=True) if 1.02 < t < 1.1
        } <= touching | resting
    assert ("hit, 1 N" in words) is stops
    assert states.has_dry_friction(trace.scenario).tolist() == [dry]


@pytest.mark.parametrize(
    ("plant", "parts", "said"),
    [
        ("furuta", {"friction": {"arm": smc.Coulomb(0.04)}}, "arm sticks"),
        ("furuta", {"friction": {"hinge": smc.hardware.LuGre(0.5, 0.8, 0.05)}}, "hinge sticks"),
        (smc.plant("furuta", cf=0.002), {}, "arm sticks"),
        (smc.plant("furuta", cf=0.002, cfq=0.002), {}, "sticks"),
    ],
)
def test_of_two_joints_at_rest_only_that_sticks_which_has_dry_friction(plant, parts, said):
    """The hinge of a Furuta pendulum whose arm alone rubs was said to stick."""
    run = made(smc.Scenario(plant=plant, law="none", duration=1.0, **parts))
    rests = dataclasses.replace(run, v=0.0 * run.v)
    (reported,) = states.timeline(rests, np.array([0.5]))
    assert reported
    assert reported.words == said


def test_words_on_joints_that_stop_one_after_the_other_do_not_flicker():
    rubs = smc.plant("furuta", cf=0.002, cfq=0.002)
    run = made(smc.Scenario(plant=rubs, law="none", duration=3.0))
    moves = [(run.t < 1.02) | (run.t > 2.02), (run.t < 1.07) | (run.t > 2.07)]
    rests = dataclasses.replace(run, v=np.column_stack(moves).astype(float))
    times = np.arange(0.0, 3.0, 0.01)
    words = [now and now.words for now in states.timeline(rests, times)]
    assert words[150] == "sticks"
    for word, frames in itertools.groupby(words):
        assert len(list(frames)) * 0.01 > states.MIN_STATE_TIME - 1e-6, word
    for word, time in zip(words, times, strict=True):
        assert word is None or 1.02 < time < 2.08


def test_arguments_reach_a_film_s_frames_and_its_file(monkeypatch, tmp_path):
    """Of a film, a clip and a still; the pictures are blank."""
    calls = []
    wrote = []
    reported = []

    def blank(frames, ahead=False, between=bool):
        times = frames.clock.times
        calls.append(
            (
                times[0],
                times[-1],
                len(times),
                frames.labels,
                frames.title,
                frames.size,
                frames.camera,
            )
        )
        yield from (paper(frames.size) - np.uint8(40 * k % 256) for k in range(len(times)))

    @contextlib.contextmanager
    def encoder(part, shape, fps):
        part.write_bytes(b"")
        wrote.append((shape, fps))
        yield lambda picture: None

    monkeypatch.setattr(film, "pictures", blank)
    monkeypatch.setattr(film, "encoder", encoder)
    monkeypatch.setattr(progress.Bar, "advance", lambda bar, work: reported.append(work))
    trace = machine("duffing", duration=5.0)
    size = (320, 180)
    looks = {
        "labels": ["a"],
        "title": "b",
        "size": size,
        "camera": (10.0, -20.0),
    }
    film_arguments = (["a"], "b", size, (10.0, -20.0))
    film.film(
        trace,
        tmp_path / "a.mp4",
        fps=10.0,
        speed=2.0,
        **looks,
    )
    film.film(trace, tmp_path / "b.png", at=5.0, **looks)
    film.film(
        trace,
        tmp_path / "b.webp",
        span=(1.0, 1.5),
        fps=10.0,
        speed=1.0,
        **looks,
    )
    assert calls == [
        (0.0, 5.0, 26, *film_arguments),
        (5.0, 5.0, 1, *film_arguments),
        (1.0, 1.5, 6, *film_arguments),
    ]
    calls.clear()
    film.film(trace, tmp_path / "first.mp4")
    film.film(trace, tmp_path / "a.png", at=0.5)
    film.film(trace, tmp_path / "a.webp", size=size)
    assert [call[3:] for call in calls] == [(None, None, (1280, 720), None)] * 2 + [
        (None, None, size, None)
    ]
    assert calls[0][:2] == (0.0, 5.0)
    assert calls[1][:3] == (0.5, 0.5, 1)
    assert calls[2][1] < 5.0  # a clip ends where little happens any more
    assert wrote == [((180, 320), 10.0), ((720, 1280), 30.0)]
    assert set(reported) == {1}
    with Image.open(tmp_path / "b.webp") as clip, Image.open(tmp_path / "b.png") as still:
        assert clip.n_frames == 6
        assert clip.size == size
        assert still.size == size


def test_no_chart_is_spent_on_what_all_runs_agree_in_if_another_differs():
    """All designs of a law for a Furuta pendulum kept its pendulum upright alike."""
    runs = []
    for k in range(3):
        run = machine("furuta", "none")
        free = np.sin(3.0 * run.t)[:, None] * (1.0, 0.0) + (k * run.t)[:, None] * (0.0, 1.0)
        runs.append(dataclasses.replace(run, x=free, u=np.full_like(run.u, 1.0 * k)))
    alike = [dataclasses.replace(run, x=runs[0].x, u=runs[0].u) for run in runs]
    assert [panel.label for panel in charts.strip(alike)] == [
        panel.label for panel in charts.strip(alike[:1])
    ]
    assert len(charts.strip(runs)) == 2
    assert not any(map(charts.all_agree, charts.strip(runs)))
    assert all(map(charts.all_agree, charts.strip(alike)))


@pytest.mark.parametrize(
    ("ends", "quantity"),
    [
        ((0.01, 0.029), "distance"),
        ((0.01, 0.031), "settling"),
        ((0.01,), "settling"),
        ((0.2,), "distance"),
    ],
)
def test_an_error_is_on_a_logarithmic_axis_where_runs_end_more_than_a_factor_of_3_apart(
    ends, quantity
):
    """Two drones that were 210 and 170 mm off were on one line of two decades."""
    runs = []
    for end in ends:
        run = machine("pendulum_network")
        falls = np.interp(run.t, [0.0, 0.5, 1.0], [0.5, end, end])
        runs.append(dataclasses.replace(run, r=0.0 * run.r, x=falls[:, None] + 0.0 * run.x))
    assert charts.strip(runs)[0].quantity == quantity


def test_a_chart_shows_a_joint_that_is_hit():
    """A wall held an arm's shoulder, and a chart was of its lift."""
    scene = loaded(Path(__file__).parents[3] / "scenes" / "unseen_wall.py")
    labels = []
    for wall in (None, scene.WALL):
        run = smc.run(dataclasses.replace(scene.run(scene.LAWS["PID"], wall), duration=0.5))
        run = dataclasses.replace(run, r=run.r + np.array([0.0, 0.0, 1.0]))  # the lift is far off
        labels.append([panel.label.split(" (")[0] for panel in charts.strip([run])])
    assert labels == [["|x − r|", "lift x"], ["|x − r|", "shoulder x"]]
