"""What films of made-up motion draw, recorded: letters and badges, charts, arrows, bars and the paths of tips."""

import collections
import contextlib
import dataclasses
import itertools
import math
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from helpers import arms, sketch
from helpers.sketch import Pen, counted, failed, made, numbers
from matplotlib.figure import Figure
from PIL import Image, ImageDraw

import smc_mujoco as smc
from smc_mujoco.common import gl, progress
from smc_mujoco.draw import states, style
from smc_mujoco.draw.decimate import finite
from smc_mujoco.draw.film import arm, arrows, camera, charts, film, pace
from smc_mujoco.draw.film.canvas import roundness
from smc_mujoco.draw.film.caption import Caption
from smc_mujoco.draw.film.stage import Stage
from smc_mujoco.draw.states import CALM, STRUCK, STUCK, State
from smc_mujoco.metrics import tip

COLOURS = ["#0072B2", "#E69F00"]
SIZE = (640, 300)


@pytest.fixture
def pen(monkeypatch):
    """Notes of what is drawn over pictures."""
    monkeypatch.setattr(ImageDraw, "Draw", Pen)
    Pen.notes.clear()
    return Pen.notes


def machine(plant: str, law: str = "classical", **fields) -> smc.Trace:
    trace = made(smc.Scenario(plant=plant, law=law, **{"duration": 1.0} | fields))
    return trace if trace.scenario.realistic else dataclasses.replace(trace, reaction=0.0 * trace.reaction)


def paper(size=SIZE) -> np.ndarray:
    return np.full((size[1], size[0], 3), 255, np.uint8)


@pytest.mark.parametrize("row", [True, False])
def test_letters_and_badges_of_machines_in_a_row_and_behind_each_other(row, pen, snapshot):
    jump = smc.Jump(0.2, {"mass": 2.0})
    parts = {"jump": jump, "friction": smc.Coulomb(0.2), "contact": "stops", "actuator": smc.Lag(0.02)}
    first = machine("duffing", **parts)
    traces = [first, failed(machine("duffing", "adaptive", **parts), 600, "the law raised ValueError: no")]
    told = [[State("sticks", STUCK)], [State("slides", CALM), State("contact", STRUCK)]]
    caption = Caption(traces, ["one", "other"], COLOURS, None, SIZE, 0.7, arrows.scales(traces), told, row)
    caption.place(np.array([[90.0, 80, 190, 180], [140, 120, 340, 230]]))
    for time, gone, speed in ((0.3, False, 0.125), (1.7, False, 0.2), (1.9, True, 4.0)):
        caption.over(paper(), time, (False, gone), (told[0][0], told[1][gone]), speed)
    pen += [f"{name} {numbers(getattr(caption, name))}" for name in ("room", "badge", "pills", "badges", "apart")]
    assert counted(pen) == snapshot


def test_the_strip_of_an_encoder_and_a_network_with_a_title(pen, snapshot):
    coarse = machine("inverted_pendulum", sensor=smc.Encoder(counts=64, delay=0.05, bias=0.03))
    caption = Caption([coarse], ["one"], COLOURS[:1], "A title", SIZE, 1.0, arrows.scales([coarse]), [[None]])
    caption.place(np.array([[200.0, 60, 420, 220]]))
    caption.over(paper(), 0.25, (False,), (None,))
    many = machine(smc.plant("pendulum_network", n=8))
    caption = Caption([many], ["a far too long label " * 5], COLOURS[:1], None, SIZE, 1.0, arrows.scales([many]))
    caption.place(np.array([[20.0, 60, 120, 220]]))
    caption.over(paper(), 0.25, (False,))
    assert counted(pen) == snapshot


@pytest.mark.parametrize("limits", [[0.4, 0.2, 0.9], math.inf])
def test_bars_force_and_blow_of_an_arm(limits, pen, monkeypatch, snapshot):
    monkeypatch.setattr(tip, "knows_contacts", lambda scenario: True)
    monkeypatch.setattr(tip, "contacts", lambda trace: SimpleNamespace(push=20.0 * trace.x))
    push = smc.Push("hand", y=30.0, z=40.0, time=0.1, width=0.02)
    trace = machine(arms.arm(), "none", u_max=limits, reference=smc.Sine(0.3, 4.0), duration=0.3)
    trace = dataclasses.replace(trace, scenario=dataclasses.replace(trace.scenario, disturbance=push))
    edges = np.array([0.08, 0.1, 0.11, 0.24])
    low = np.array([[100.0, 220.0, 260.0, 290.0]])

    def project(points):
        return np.array([150.0, 200.0]) + 100.0 * points[:, [0, 2]] * (1.0, -1.0)

    over = arm.Overlay([trace], COLOURS[:1], np.array([[0.1, 0.0, 0.2]]), project, SIZE, edges, low, 0.8)
    picture = paper()
    for frame in range(3):
        picture = over.over(paper(), frame, lambda k, name: np.array([0.4, 0.0, 0.9]))
    trails = [
        numbers([*trail.corner, *trail.fine.size, np.asarray(trail.fine).mean(), (np.asarray(trail.fine) > 0).mean()])
        for trail in (*over.trails, *over.wanted)
    ]
    sums = [picture[:, :, k].mean() for k in range(3)]
    said = [
        *arm.key([trace]),
        counted(pen),
        *trails,
        numbers(sums),
        numbers(arm.room([trace], 300.0)),
        numbers(over.errors),
    ]
    assert "\n".join(said) == snapshot


def test_charts_below_a_film_and_their_dots(monkeypatch, snapshot):
    figures = []
    monkeypatch.setattr(charts, "Figure", lambda **given: figures.append(Figure(**given)) or figures[0])
    parts = {"friction": smc.Coulomb(0.2), "jump": smc.Jump(0.4, {"mass": 2.0})}
    lost = failed(machine("duffing", "adaptive", **parts), 600, "the law raised ValueError: no")
    lost = finite(dataclasses.replace(lost, x=0.5 * lost.x, u=0.3 * lost.u))
    traces = [machine("duffing", **parts), lost]
    shown = charts.Charts(traces, ["one", "other"], COLOURS, (640, 130), 0.7)
    said = [sketch.sketch(figures[0]), f"{shown.frames} {shown.dot} {shown.end}"]
    said += [numbers([t[-1], y[0], y[-1], y.min()]) for paths in shown.paths for t, y in paths]
    for time in (0.3, 0.8):
        image = shown.at(time)
        for left, top, right, bottom in shown.frames:
            now = round(left + (right - left) * time)
            assert (image[top:bottom, left : now - 8] == shown.full[top:bottom, left : now - 8]).all()
            assert (image[:, now + 8 : right] == shown.faint[:, now + 8 : right]).all()
            column = image[top:bottom, now].astype(int)
            runs = [np.flatnonzero(np.abs(column - style.rgb(colour)).max(axis=1) < 3) for colour in COLOURS]
            said.append(f"{time} s: {[(len(run), round(float(run.mean()), 1)) if len(run) else 0 for run in runs]}")
    assert "\n".join(said) == snapshot


HINGES = """
<mujoco model="arm"><worldbody>
  <camera name="first" pos="0 -3 1" xyaxes="1 0 0 0 0 1"/><geom name="wall" type="box" size=".1 .1 1" pos="-.5 0 1"/>
  <body pos="0 0 1"><joint name="j" axis="0 1 0"/><geom type="capsule" size=".05" fromto="0 0 0 0 0 .5"/>
    <body pos="0 0 .5"><joint name="k" axis="0 0 1"/><geom size=".1" pos=".2 0 0" rgba=".2 .9 .2 1"/></body></body>
</worldbody><actuator><motor joint="j"/><motor joint="k"/></actuator></mujoco>"""
KINDS = {
    "rails behind each other": {"plant": "van_der_pol"},
    "pendulums on a gear": {
        "plant": "inverted_pendulum", "actuator": smc.Backlash(0.2), "jump": smc.Jump(0.5, {"l": 1.5}),
    },
    "network": {"plant": "pendulum_network"},
    "carts with poles": {"plant": "cart_pole"},
    "a model of one's own": {"plant": smc.plant_from(HINGES, ["j", "k"], name="own")},
}  # fmt: skip


@pytest.mark.skipif(gl.missing() is not None, reason=str(gl.missing()))
@pytest.mark.parametrize("kind", KINDS)
def test_the_stage_of_two_machines_with_arrows_ghosts_and_shadows(kind, pen, snapshot):
    traces = [machine(law="none", **KINDS[kind]) for _ in range(2)]
    red = (1.0, 0.0, 0.0, 1.0)
    with Stage(traces, COLOURS, SIZE, camera.Room(30, 60, 610, 270)) as stage:
        model, canvas, (first, second) = stage.model, stage.canvas, stage.shown
        stage.set_shape(1, 0.6)
        stage.pose(0, np.linspace(0.2, 0.3, first))
        stage.pose(1, np.linspace(-0.3, 0.4, second), np.full(second, 0.1), 0.2)
        stage.aim(1, np.full(second, 0.1))
        stage.render()
        drawn = [(0, 0, arrows.Arrow(0.0, 0.8, red)), (1, 0, arrows.Arrow(-0.7, 0.3, red, 1, 0.65, head=False))]
        stage.pose(0, np.linspace(0.25, 0.3, first))
        rendered = []
        canvas.render = lambda area, views, render=canvas.render: rendered.append(area) or render(area, views)
        stage.render(drawn)
        said = [sketch.shapes(canvas.renderer.scene, len(stage.links[1]) + 2)]
        numbers_of = {
            "places": stage.where, "boxes": stage.boxes, "camera": stage.place, "turn": stage.turn, "sun": canvas.sun,
            "pose": stage.data.qpos, "goal": stage.goal.qpos, "casts": np.flatnonzero(canvas.casts),
            "links": np.concatenate(stage.links), "hidden": np.flatnonzero(model.geom_group > 2),
            "colours": np.unique(np.concatenate([model.geom_rgba, model.mat_rgba]), axis=0).mean(axis=0),
            "floor": model.mat_texrepeat[model.material("floor").id], "centre": [*model.stat.center, model.stat.extent],
            "haze": [model.vis.map.fogstart, model.vis.map.fogend, *model.vis.rgba.fog], "drawn": rendered,
            "quality": [model.vis.quality.numslices, model.vis.quality.numstacks, model.vis.quality.offsamples],
            "sizes": model.geom_size.sum(axis=0), "radii": roundness(model),
            "counts": [model.nlight, model.ncam, model.nu],
        }  # fmt: skip
        said += [f"{name} {numbers(values)}" for name, values in numbers_of.items()]
        said += [
            str(mount._replace(front=numbers(() if mount.front is None else mount.front))) for mount in stage.mounts[1]
        ]
    assert counted([*said, *pen]) == snapshot


def test_a_model_without_round_shapes_has_no_radii():
    box = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom type='box' size='1 1 1'/></worldbody></mujoco>")
    assert roundness(box).tolist() == [0.0, 0.0]


def test_states_of_machines_with_friction_a_gear_and_stops(snapshot):
    """Runs that move, rest, and touch a stop at the start of each second."""
    rub, gear = {"friction": smc.Coulomb(0.2)}, {"actuator": smc.Backlash(0.2)}
    kinds = [
        rub,
        gear,
        rub | gear,
        {"contact": "stops"},
        {"contact": "stops", **gear},
        {"friction": smc.Viscous(1.0)} | gear,
        {},
    ]
    said = []
    for kind in kinds:
        trace = made(smc.Scenario(plant="duffing", law="none", duration=4.0, **kind))
        still = (trace.t % 2.0 > 1.0)[:, None]
        pushes = (np.sign(np.sin(3.0 * trace.t)) * ((trace.t % 1.0 > 0.2) | (trace.t % 1.0 < 0.01)))[:, None]
        x = np.where(trace.t % 1.0 < 0.01, 2.0, 0.1)[:, None]
        moved = {"x": x, "v": np.where(still, 0.0, 1.0), "reaction": pushes, "force": -pushes}
        told = states.timeline(dataclasses.replace(trace, **moved), np.arange(0.0, 4.0, 1 / 30))
        runs = [(now and f"{now.words} {now.mood}", len([*run])) for now, run in itertools.groupby(told)]
        said.append(f"{kind}: {runs} {states.has_dry_friction(trace.scenario)} {states.has_contact(trace.scenario)}")
    two = made(smc.Scenario(plant="cart_pole", law="none", duration=1.0, **rub, **gear))
    halves = dataclasses.replace(
        two, v=np.column_stack([0.0 * two.t, 1.0 + two.t]), force=np.column_stack([two.t, 0.0 * two.t])
    )
    said += [str(states.timeline(halves, np.array([0.5])))]
    assert "\n".join(said) == snapshot


def test_speeds_of_a_film_of_made_up_motion(snapshot):
    """Times, and speeds with their numbers of frames; of an arm that is hit, and of a machine that fails."""
    push = smc.Push("hand", y=30.0, z=40.0, time=1.0, width=0.1)
    hit = machine(arms.arm(), "none", duration=3.0)
    hit = dataclasses.replace(hit, scenario=dataclasses.replace(hit.scenario, disturbance=push))
    lost = failed(machine("duffing", duration=3.0), 900, "the law raised ValueError: no")
    jump = machine("duffing", duration=3.0)
    jump = dataclasses.replace(jump, x=np.clip((jump.t - 1.0) / 0.2, 0.0, 1.0)[:, None])
    said = []
    for traces in ([hit], [lost], [jump], [jump, lost]):
        clock = pace.clock(traces, 30.0)
        runs = [(float(speed), len([*run])) for speed, run in itertools.groupby(clock.speeds.tolist())]
        said.append(f"{numbers(clock.times[[0, 1, 10, -2, -1]])} {runs}")
    assert "\n".join(said) == snapshot


def test_arguments_reach_a_film_s_frames_and_its_file(monkeypatch, tmp_path, snapshot):
    """Of a film, a clip and a still; the pictures are blank."""
    asked, wrote = [], []

    def blank(traces, shown, labels, title, size, chosen=None):
        looks = f"{labels} {title} {size} {chosen}"
        asked.append(f"{len(shown.times)} {numbers(shown.times[[0, -1]])} {sorted(set(shown.speeds.tolist()))} {looks}")
        yield from (paper(size) - np.uint8(k) for k in range(len(shown.times)))

    @contextlib.contextmanager
    def encoder(part, shape, fps):
        part.write_bytes(b"")
        wrote.append(f"{part.suffix} {shape} {fps}")
        yield lambda picture: None

    monkeypatch.setattr(film, "pictures", blank)
    monkeypatch.setattr(film, "encoder", encoder)
    trace, size, told = machine("duffing", duration=5.0), (320, 180), []
    monkeypatch.setattr(progress.Bar, "advance", lambda bar, work: told.append((bar.what, work)))
    looks = {"labels": ["a"], "title": "b", "size": size, "camera": (10.0, -20.0)}
    film.film(trace, tmp_path / "first.mp4")
    film.film(trace, tmp_path / "a.mp4", fps=10.0, speed=2.0, **looks)
    film.film(trace, tmp_path / "a.png", at=0.5)
    film.film(trace, tmp_path / "b.png", at=5.0, **looks)
    film.film(trace, tmp_path / "a.webp", size=size)
    film.film(trace, tmp_path / "b.webp", span=(1.0, 1.5), fps=10.0, speed=1.0, **looks)
    durations = []
    with Image.open(tmp_path / "b.webp") as clip:
        for frame in range(clip.n_frames):
            clip.seek(frame)
            durations.append(clip.info.get("duration"))
    refused = {"span": (1.0,)}, {"span": (9.0, 9.5)}, {"span": (0.0, 4.0), "fps": 120.0, "speed": 0.5}, {"fps": 121.0}
    sentences = []
    for options in refused:
        with pytest.raises(smc.ScenarioError) as error:
            film.film(trace, tmp_path / "c.webp", **options)
        sentences.append(str(error.value))
    names = sorted(path.name for path in tmp_path.iterdir())
    assert "\n".join([*asked, *wrote, *sentences, f"{collections.Counter(told)} {names} {durations}"]) == snapshot
