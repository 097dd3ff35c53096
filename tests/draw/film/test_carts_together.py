"""Carts on one picture, labels that are whole, and words of what pictures hide: measured."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from helpers.films import staged, without_charts

import smc_mujoco as smc
from smc_mujoco.common import gl
from smc_mujoco.draw import colouring, states, style
from smc_mujoco.draw.film import arrow_lines, arrows, film, world
from smc_mujoco.draw.film.sheet import label_sizes

SIZE = (800, 450)
renders = pytest.mark.skipif(gl.missing_renderer() is not None, reason=str(gl.missing_renderer()))


def placed(traces, names):
    clock = film.FilmClock(np.array([0.0, 0.1]), np.ones(2))
    runs = film.DrawnRuns.of(traces, names)
    tracks = film.tracks_at(clock, runs, arrows.scales(traces))
    return film.placement(tracks, None, names, SIZE)


@renders
@without_charts
def test_carts_share_a_picture_in_which_each_is_in_its_colour_and_larger():
    laws = ("classical", "adaptive")
    traces = [
        smc.run(smc.Scenario(plant="duffing", law=smc.law(law), duration=0.3)) for law in laws
    ]
    place = placed(traces, list(laws))
    assert place.lanes is not None
    assert place.tiles[0, 2] == place.tiles[1, 0]
    (frame,) = film.Frames(traces, size=SIZE, at=0.2)
    for colour in colouring.trace_colours(traces):
        r, g, b = style.rgb(colour)
        hue = np.array([r, g, b]) / max(r, g, b)
        pixels = frame.reshape(-1, 3) / np.maximum(frame.reshape(-1, 3).max(axis=1), 1)[:, None]
        strong = frame.reshape(-1, 3).max(axis=1) > 60
        assert (strong & (np.abs(pixels - hue).max(axis=1) < 0.12)).sum() > 300, colour


def test_pendulums_have_tiles_of_their_own():
    traces = []
    for law in ("classical", "adaptive"):
        scenario = smc.Scenario(plant="inverted_pendulum", law=smc.law(law), duration=0.2)
        traces.append(smc.run(scenario))
    assert placed(traces, ["one", "two"]).lanes is None


@pytest.mark.quick
def test_a_long_name_is_broken_after_underscores_before_it_makes_machines_small():
    names = ["adaptive_quaternion_sliding", "geometric"]
    sizes, read = label_sizes(names, SIZE, 140.0)
    assert (sizes[:, 0] <= 140.0).all()
    assert read < 1.0
    assert label_sizes(names, SIZE, 400.0)[1] == 1.0


@pytest.mark.parametrize("drives", [False, True])
def test_a_picture_says_how_far_what_the_camera_follows_is_off_its_place(drives):
    """A robot that rolled away for ever looked the stillest of three."""
    drone = smc.plant("quadrotor")
    run = smc.run(smc.Scenario(plant=drone, law="geometric", x0=drone.rest, duration=0.05))
    first = 0
    if drives:
        robot = Path(__file__).parents[3] / "models" / "two_wheels.xml"
        plant = smc.plant_from(robot, ["left", "right"], measured=["base"])
        run = smc.run(smc.Scenario(plant=plant, law="none", duration=0.03))
        first = plant.base
    assert states.timeline(run, np.array([0.01])) == [None]
    moved = run.x.copy()
    moved[:, first] += 0.123
    (said,) = states.timeline(dataclasses.replace(run, x=moved), np.array([0.02]))
    assert said is not None
    assert said.words == "120 mm off"
    far = run.x + 10.0 * (moved - run.x)
    (said,) = states.timeline(dataclasses.replace(run, x=far), np.array([0.02]))
    assert said is not None
    assert said.words == "1.2 m off"


@renders
def test_in_one_picture_of_several_machines_words_say_their_order(monkeypatch):
    """In grey nothing else tells the carts apart."""
    sheet_class = film.Sheet
    keys = []

    def kept(*parts, **fields):
        page = sheet_class(*parts, **fields)
        keys.append(page.key)
        return page

    monkeypatch.setattr(film, "Sheet", kept)
    runs = []
    for law in ("classical", "adaptive"):
        runs.append(smc.run(smc.Scenario(plant="duffing", law=smc.law(law), duration=0.1)))
    for film_runs, title in (
        (runs, None),
        (runs, "Two carts of one oscillator"),
        (runs[:1], None),
    ):
        next(iter(film.Frames(film_runs, title=title, size=SIZE, at=0.05)))
    assert ["back to front" in key for key in keys] == [True, True, False]


@renders
def test_the_name_of_one_machine_takes_nothing_of_the_picture_s_width():
    run = smc.run(smc.Scenario(plant="inverted_pendulum", law="classical", duration=0.1))
    (tile,) = placed([run], ["Classical"]).tiles.tolist()
    assert tile[0] == 0
    assert tile[2] > 0.99 * SIZE[0]


@renders
@pytest.mark.parametrize("off", [0.0, 0.1, 2.0])
def test_dots_lead_from_a_machine_that_is_followed_to_where_it_should_be(off):
    drone = smc.plant("quadrotor")
    run = smc.run(smc.Scenario(plant=drone, law="geometric", x0=drone.rest, duration=0.05))
    reference = run.x + off * np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    with staged(dataclasses.replace(run, r=reference), SIZE) as stage:
        still = np.asarray(stage.shot(0, 0.0), int)
        stage.followed = np.zeros((1, 3))
        dotted = np.asarray(stage.shot(0, 0.0), int)
        ends = stage.project(np.array([run.x[0, :3], reference[0, :3]]))
    y, x = np.nonzero((np.abs(dotted - still) > 60).any(axis=2))
    if off == 0.0:
        assert not len(x)
        return
    assert np.abs(x - ends[0, 0]).max() < 20
    assert y.max() < ends[0, 1] + 10
    assert abs(y.min() - max(0.0, ends[1, 1])) < 20
    assert len(np.unique(y)) < 0.6 * np.ptp(y)  # with gaps


@pytest.mark.parametrize("push", [1.0, -1.0])
def test_arrows_of_carts_on_one_picture_begin_at_the_side_to_which_they_point(push):
    """Over a cart, where they are elsewhere, stands the cart behind it."""
    runs = []
    for law in ("classical", "adaptive"):
        runs.append(smc.run(smc.Scenario(plant="duffing", law=smc.law(law), duration=0.1)))
    for puppet in placed(runs, ["one", "other"]).puppets:
        model, data = puppet.model, puppet.data[0]
        data.qpos[:] = puppet.start
        world.forward(model, data)
        arrow = arrows.Arrow(0.0, push, arrows.WHITE)
        arrow_path = arrow_lines.path(model, data, puppet.mounts[0], arrow)
        assert arrow_path
        cart = arrow_lines.arrow_geom(model, model.jnt_bodyid[puppet.ids[0]])
        box = world.boxes(model, data)[cart]
        side = box[:, 0].max() if push > 0.0 else box[:, 0].min()
        line = arrow_path[0]
        assert line[0, 0] == pytest.approx(side, abs=1e-6)
        assert (line[-1, 0] - side) * push > 0.0
        assert line[:, 1:] == pytest.approx(np.tile(box[:, 1:].mean(axis=0), (40, 1)), abs=1e-6)
