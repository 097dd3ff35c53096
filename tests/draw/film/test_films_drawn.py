"""What films of made-up motion draw: letters and badges, charts, arrows, bars, and the words for
states.
"""

import contextlib
import dataclasses
import itertools

import numpy as np
import pytest
from helpers.films import staged
from helpers.runs import at_defaults
from helpers.sketch import Pen, failed, made
from PIL import Image, ImageDraw

import smc_mujoco as smc
from smc_mujoco.common import gl, progress
from smc_mujoco.draw import states, style
from smc_mujoco.draw.decimate import finite
from smc_mujoco.draw.film import arrows, charts, film
from smc_mujoco.draw.film.caption import Caption
from smc_mujoco.draw.states import CALM, STRUCK, STUCK, State

COLOURS = ["#0072B2", "#E69F00"]
SIZE = (640, 300)


@pytest.fixture
def pen(monkeypatch):
    """Notes of what is drawn over pictures."""
    monkeypatch.setattr(ImageDraw, "Draw", Pen)
    Pen.notes.clear()
    return Pen.notes


def machine(plant: str, law: str = "classical", **fields) -> smc.Trace:
    trace = made(smc.Scenario(plant=plant, law=at_defaults(law), **{"duration": 1.0} | fields))
    if trace.scenario.realistic:
        return trace
    return dataclasses.replace(trace, reaction=0.0 * trace.reaction)


def paper(size=SIZE) -> np.ndarray:
    return np.full((size[1], size[0], 3), 255, np.uint8)


def apart(boxes: np.ndarray) -> bool:
    """Whether no two boxes (left, top, right, bottom) overlap."""
    gaps = []
    for a, b in itertools.combinations(boxes, 2):
        gaps.append(max(a[0] - b[2], b[0] - a[2], a[1] - b[3], b[1] - a[3]))
    return min(gaps) >= -1e-9


@pytest.mark.parametrize("wide", [320, 180])
def test_labels_and_badges_are_apart_at_the_foot_of_their_tiles(wide, pen):
    jump = smc.Jump(0.2, {"mass": 2.0})
    parts = {
        "jump": jump,
        "friction": smc.Coulomb(0.2),
        "contact": "stops",
        "actuator": smc.Lag(0.02),
    }
    first = machine("duffing", **parts)
    traces = [
        first,
        failed(machine("duffing", "adaptive", **parts), 600, "the law raised ValueError: no"),
    ]
    reported = [[State("sticks", STUCK)], [State("slides", CALM), State("contact", STRUCK)]]
    caption = Caption(
        traces, ["one", "other"], COLOURS, None, SIZE, 0.5, arrows.scales(traces), reported
    )
    tiles = np.array([[0, 60, wide, 300], [wide + 2, 60, 2 * wide + 2, 300]])
    caption.place(tiles)
    boxes = np.concatenate([caption.labels, caption.badges])
    assert apart(boxes)
    both = np.concatenate([tiles, tiles])
    assert (boxes[:, 0] >= both[:, 0]).all()
    assert (boxes[:, 2:] <= both[:, 2:]).all()
    assert (boxes[:, 1] >= 300.0 - caption.strip(wide)).all()
    said = []
    for time, gone, speed in (
        (0.1, False, 1.0),
        (0.3, False, 0.125),
        (1.7, False, 0.2),
        (1.9, True, 4.0),
    ):
        pen.clear()
        caption.over(paper(), time, (False, gone), (reported[0][0], reported[1][gone]), speed)
        said.append("\n".join(pen).replace("\\n", " "))
    for picture, clock, pace_words, other, fill, state, changed in zip(
        said,
        ("0.10 s", "0.300 s", "1.70 s", "1.90 s"),
        ("real time", "8× slower", "5× slower", "4× faster"),
        ("'other'", "'other'", "'other'", "other: failed at 0.6 s"),
        (COLOURS[1], COLOURS[1], COLOURS[1], style.FAILED),
        ("slides", "slides", "slides", "contact"),
        (False, True, True, True),
        strict=True,
    ):
        assert clock in picture
        assert (pace_words in picture) != (pace_words == "real time")
        for words in ("'one'", other, fill, "'sticks'", f"'{state}'"):
            assert words in picture
        assert ("mass × 2 since 0.2 s" in picture) is changed


def test_charts_are_uncovered_up_to_the_clock_with_a_dot_where_each_run_is():
    parts = {"friction": smc.Coulomb(0.2), "jump": smc.Jump(0.4, {"mass": 2.0})}
    lost = failed(machine("duffing", "adaptive", **parts), 600, "the law raised ValueError: no")
    lost = finite(dataclasses.replace(lost, x=0.5 * lost.x, u=0.3 * lost.u))
    traces = [machine("duffing", **parts), lost]
    shown = charts.Charts(traces, ["one", "other"], COLOURS, (640, 130), 0.7)
    found = []
    for time in (0.3, 0.8):
        image = shown.at(time)
        for (left, top, right, bottom), paths in zip(shown.frames, shown.paths, strict=True):
            now = round(left + (right - left) * time)
            assert (
                image[top:bottom, left : now - 8] == shown.full[top:bottom, left : now - 8]
            ).all()
            assert (image[:, now + 8 : right] == shown.faint[:, now + 8 : right]).all()
            column = image[:, now].astype(int)
            for colour, (t, y) in zip(COLOURS, paths, strict=True):
                dot = np.flatnonzero(np.abs(column - style.rgb(colour)).max(axis=1) < 3)
                assert time <= t[-1] or not len(dot)  # a run that failed has none
                found += [(colour, time)] * bool(len(dot))
                assert not len(dot) or dot.mean() == pytest.approx(np.interp(time, t, y), abs=3.0)
    counts = []
    for each in itertools.product(COLOURS, (0.3, 0.8)):
        counts.append(found.count(each))
    assert counts == [2, 2, 1, 0]  # where both are in one place the first is on top
    ends = [t[-1] for paths in shown.paths for t, _ in paths]
    assert ends == pytest.approx([1.0, 0.599] * 2)


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


@pytest.mark.skipif(gl.missing() is not None, reason=str(gl.missing()))
@pytest.mark.parametrize("kind", KINDS)
def test_a_machine_stays_in_its_tile_with_its_arrows(kind):
    trace = machine(law="none", **KINDS[kind])
    red = (1.0, 0.0, 0.0, 1.0)
    with staged(trace, SIZE, strip=40.0) as stage:
        n = stage.puppet.shown
        stage.arrange(np.linspace(-0.3, 0.4, n), np.full(n, 0.1), 0.2)
        stage.aim(np.full(n, 0.1))
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
    (RUB, {"slides"}, {"sticks"}, {"slides"}, True, False),
    (GEAR, FLANKS, FLANKS, None, False, False),
    (
        RUB | GEAR,
        {"slides, left flank", "slides, right flank"},
        {"sticks, right flank"},
        None,
        True,
        False,
    ),
    ({"contact": "stops"}, {None}, {None}, {"contact"}, False, True),
    ({"contact": "stops"} | GEAR, FLANKS, FLANKS, {"contact"}, False, True),
    ({"friction": smc.Viscous(1.0)} | GEAR, FLANKS, FLANKS, None, False, False),
    ({}, {None}, {None}, {None}, False, False),
]


@pytest.mark.parametrize(
    ("parts", "moving", "resting", "touching", "dry", "stops"), STATES, ids=range(len(STATES))
)
def test_a_machine_is_told_to_slide_stick_touch_or_lie_on_a_flank_when_it_does(
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
    for second, expected in (
        (0, moving),
        (1, resting),
        (2, moving),
        (3, resting),
    ):
        assert {
            word for word, t in zip(words, times, strict=True) if second + 0.4 < t < second + 0.95
        } <= expected
    if touching:
        assert {
            word for word, t in zip(words, times, strict=True) if 1.02 < t < 1.1
        } <= touching | resting
    assert ("contact" in words) is stops
    assert states.has_dry_friction(trace.scenario) is dry


def test_of_two_joints_the_state_told_is_of_what_happens_in_either():
    two = made(
        smc.Scenario(
            plant="cart_pole",
            law="none",
            duration=1.0,
            **RUB,
            **GEAR,
        )
    )
    v = np.column_stack([0.0 * two.t, 1.0 + two.t])
    force = np.column_stack([two.t, 0.0 * two.t])
    (reported,) = states.timeline(dataclasses.replace(two, v=v, force=force), np.array([0.5]))
    assert reported
    assert reported.words == "1 of 2 stick, 1 of 2 in play"


def test_arguments_reach_a_film_s_frames_and_its_file(monkeypatch, tmp_path):
    """Of a film, a clip and a still; the pictures are blank."""
    asked = []
    wrote = []
    reported = []

    def blank(frames):
        times = frames.clock.times
        asked.append(
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
    given = (["a"], "b", size, (10.0, -20.0))
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
    assert asked == [(0.0, 5.0, 26, *given), (5.0, 5.0, 1, *given), (1.0, 1.5, 6, *given)]
    asked.clear()
    film.film(trace, tmp_path / "first.mp4")
    film.film(trace, tmp_path / "a.png", at=0.5)
    film.film(trace, tmp_path / "a.webp", size=size)
    assert [one[3:] for one in asked] == [(None, None, (1280, 720), None)] * 2 + [
        (None, None, size, None)
    ]
    assert asked[0][:2] == (0.0, 5.0)
    assert asked[1][:3] == (0.5, 0.5, 1)
    assert asked[2][1] < 5.0  # a clip ends where little happens any more
    assert wrote == [((180, 320), 10.0), ((720, 1280), 30.0)]
    assert set(reported) == {1}
    with Image.open(tmp_path / "b.webp") as clip, Image.open(tmp_path / "b.png") as still:
        assert clip.n_frames == 6
        assert clip.size == size
        assert still.size == size
