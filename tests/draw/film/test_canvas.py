"""Pictures of which only a part is drawn again are those that are drawn whole."""

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.common import gl
from smc_mujoco.draw.film import camera, canvas
from smc_mujoco.draw.film.arrows import Arrow
from smc_mujoco.draw.film.canvas import Canvas
from smc_mujoco.draw.film.stage import Stage

pytestmark = pytest.mark.skipif(gl.missing() is not None, reason=str(gl.missing()))
SIZE = (640, 230)
ROOM = camera.Room(20, 20, 620, 210)
SEEN = 24  # of 255: a sample of a smoothed edge more or less is no difference


def stage(plant: str, **fields) -> Stage:
    trace = smc.run(smc.Scenario(plant=plant, duration=1.0, **{"law": "none"} | fields))
    return Stage([trace, trace], ["#0072B2", "#D55E00"], SIZE, ROOM)


def poses(shown: Stage, count: int = 6) -> list[tuple[np.ndarray, ...]]:
    """Positions of two machines, of which the second moves."""
    return [
        (np.full(shown.shown[0], 0.2), np.full(shown.shown[1], 0.2 + 0.15 * k))
        for k in range(count)
    ]


def pictures(shown: Stage, push: bool) -> list[np.ndarray]:
    found = []
    for k, (first, second) in enumerate(poses(shown)):
        shown.pose(0, first)
        shown.pose(1, second)
        arrow = Arrow(0.0, 0.2 * k - 0.5, (1.0, 0.0, 0.0, 1.0))
        found.append(shown.render([(1, 0, arrow)] if push else ()))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("plant", "push"), [("van_der_pol", True), ("pendulum_network", False)])
def test_parts_drawn_again_are_those_of_the_whole_picture(plant, push, monkeypatch):
    """Shadows and springs too; the first machine stands still."""
    areas = []
    whole = lambda *_: [(0, 0, *SIZE)]
    changed = Canvas.changed

    def noted(self, *shapes):
        areas.append(changed(self, *shapes))
        return areas[-1]

    with stage(plant) as shown:
        monkeypatch.setattr(Canvas, "changed", noted)
        parts = pictures(shown, push)
        monkeypatch.setattr(Canvas, "changed", whole)
        wholes = pictures(shown, push)
    assert all(sum(map(canvas.pixels, found)) < 0.8 * SIZE[0] * SIZE[1] for found in areas)
    assert np.abs(parts[0].astype(int) - parts[-1]).max() > 100  # it moves
    for part, full in zip(parts, wholes, strict=True):
        assert (np.abs(part.astype(int) - full).max(axis=2) > SEEN).mean() < 3e-4


def test_rectangles_are_joined_where_one_takes_less_time_than_two():
    near = [(0, 0, 10, 10), (12, 0, 20, 10)]
    far = [(0, 0, 10, 10), (500, 0, 510, 10)]
    assert canvas.joined(near, lambda area: canvas.pixels(area) + 50) == [(0, 0, 20, 10)]
    assert canvas.joined(far, lambda area: canvas.pixels(area) + 50) == far
    chain = [(0, 0, 10, 10), (100, 0, 110, 10), (10, 0, 100, 10)]  # the third joins the others
    assert canvas.joined(chain, canvas.pixels) == [(0, 0, 110, 10)]


def test_two_machines_that_move_far_apart_are_drawn_in_two_rectangles(monkeypatch):
    drawn = []
    render = Canvas.render
    monkeypatch.setattr(
        Canvas, "render", lambda self, area, *rest: drawn.append(area) or render(self, area, *rest)
    )
    with stage("overhead_crane", law=smc.law("hierarchical")) as shown:
        for x in (0.2, 0.25):
            for k in range(2):
                shown.pose(k, np.array([x, 0.1])[: shown.shown[k]])
            shown.render()
    assert drawn[0] == (0, 0, *SIZE)
    assert len(drawn) == 3
    ((left, *_, high), (*_, right, low)) = sorted(drawn[1:])
    assert sum(map(canvas.pixels, drawn[1:])) < 0.75 * (right - left) * max(low, high)


def test_arcs_have_as_many_chords_as_can_be_told_apart():
    """The middle of a chord is r (1 - cos(a / 2)) from its arc, a: its angle."""
    for radius, angle in ((15.0, np.pi), (60.0, 2 * np.pi)):
        count = canvas.facets(radius, angle, 99)
        gaps = [radius * (1.0 - np.cos(angle / n / 2)) for n in (count, count - 1)]
        assert gaps[0] <= canvas.CHORD_GAP < gaps[1] * 1.01
    assert canvas.facets(1e3, np.pi, 10) == 10
    assert canvas.facets(0.0, np.pi, 10) == canvas.MIN_CHORDS


def test_a_picture_in_which_nothing_moves_is_not_drawn_again(monkeypatch):
    with stage("inverted_pendulum") as shown:
        pictures(shown, False)
        monkeypatch.setattr(Canvas, "render", None)
        first = shown.render()
        for angle in 0.95 + np.linspace(0.0, 1e-4, 5):
            shown.pose(1, np.array([angle]))
            assert shown.render() is first


@pytest.mark.slow
def test_slow_motion_adds_up_until_it_is_drawn():
    with stage("inverted_pendulum") as shown:
        shown.pose(1, np.zeros(1))
        last = first = shown.render()
        for angle in np.arange(0.0, 0.1, 5e-4):  # less than a fifth of a pixel each
            shown.pose(1, np.array([angle]))
            last = shown.render()
        assert (np.abs(first.astype(int) - last).max(axis=2) > 100).sum() > 50


def test_a_changed_colour_or_shape_is_drawn():
    jump = smc.Jump(0.5, {"l": 1.5})
    with stage("inverted_pendulum", jump=jump) as shown:
        shown.set_shape(0, 0.0)
        first = shown.render()
        shown.set_colour(0, "#A9AFB6")
        grey = shown.render()
        assert (np.abs(first.astype(int) - grey).max(axis=2) > 50).sum() > 50
        shown.set_shape(0, 0.6)
        longer = shown.render()
        assert (np.abs(longer.astype(int) - grey).max(axis=2) > 50).sum() > 50
        shown.pose(0, np.array([0.5]))
        again = shown.render()
        shown.changed = True
        assert (np.abs(again.astype(int) - shown.render()).max(axis=2) > SEEN).mean() < 3e-4


def test_a_model_with_a_lamp_has_its_pictures_drawn_whole():
    """Where the shadows of a lamp fall is not foretold."""
    with stage("inverted_pendulum") as shown:
        assert shown.canvas.steady
        assert shown.canvas.sun is not None
        assert shown.canvas.sun[2] < -0.5
        shown.model.light_castshadow[shown.model.light("fill").id] = 1
        assert not Canvas(shown.model, shown.data, SIZE).steady


def test_shadows_lie_on_the_floor_where_the_light_casts_them_with_smooth_edges():
    way = np.array([0.3, 0.5, -0.8])
    point = np.array([0.2, -0.1, 1.6])
    assert canvas.flattening(way) @ point == pytest.approx([0.8, 0.9, 0.0], abs=2e-4)
    with stage("inverted_pendulum") as shown:
        lit = shown.render().astype(int)
        shown.canvas.sun, shown.changed = None, True
        bare = shown.render().astype(int)
    darker = (bare - lit).min(axis=2)
    shadow = np.median(darker[darker > 10])
    edge = (darker > 0.2 * shadow) & (darker < 0.8 * shadow)
    assert (darker > 0.8 * shadow).sum() > 500
    assert edge.sum() > 50


def test_a_ghost_stands_where_the_reference_is_and_inside_a_machine_that_is_there():
    with stage("van_der_pol") as shown:
        for k in range(2):
            shown.pose(k, np.array([1.5]))
        alone = shown.render().astype(int)
        shown.aim(0, np.array([-1.0]))
        ghost = np.abs(shown.render().astype(int) - alone).max(axis=2) > 20
        columns = np.flatnonzero(ghost.any(axis=0))
        assert ghost.sum() > 100
        assert columns.max() < SIZE[0] / 2
        shown.aim(0, np.array([1.5]))
        assert (
            np.abs(shown.render().astype(int) - alone).max(axis=2) > 20
        ).sum() < 0.1 * ghost.sum()
        shown.aim(0, None)
        assert (np.abs(shown.render().astype(int) - alone).max(axis=2) > SEEN).mean() < 3e-4
