"""Pictures of which only a part is drawn again are those that are drawn whole."""

import numpy as np
import pytest
from helpers.films import staged

import smc_mujoco as smc
from smc_mujoco.common import gl
from smc_mujoco.draw.film import camera
from smc_mujoco.draw.film.arrows import Arrow
from smc_mujoco.draw.film.canvas import Canvas
from smc_mujoco.draw.film.stage import Stage

pytestmark = pytest.mark.skipif(gl.missing() is not None, reason=str(gl.missing()))
SIZE = (640, 230)
ROOM = camera.Room(20, 20, 620, 210)
SEEN = 24  # of 255: a sample of a smoothed edge more or less is no difference


def stage(plant: str, **fields) -> Stage:
    trace = smc.run(smc.Scenario(plant=plant, duration=1.0, **{"law": "none"} | fields))
    return staged([trace, trace], ["#0072B2", "#D55E00"], SIZE, ROOM)


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
@pytest.mark.parametrize(
    ("plant", "push"),
    [
        ("van_der_pol", True),
        ("pendulum_network", False),
    ],
)
def test_a_part_drawn_again_is_that_of_the_whole_picture(plant, push, monkeypatch):
    """Shadows and springs too; the first machine stands still."""
    areas = []
    render = Canvas.render
    with stage(plant) as shown:
        monkeypatch.setattr(
            Canvas, "render", lambda self, *area: areas.append(area) or render(self, *area)
        )
        parts = pictures(shown, push)
        draw = Canvas.draw
        monkeypatch.setattr(Canvas, "draw", lambda self, add, whole: draw(self, add, whole=True))
        wholes = pictures(shown, push)
    sizes = []
    for left, top, right, bottom in areas:
        sizes.append((right - left) * (bottom - top))
    assert max(sizes[1:6]) < 0.8 * SIZE[0] * SIZE[1] == 0.8 * sizes[0]
    assert np.abs(parts[0].astype(int) - parts[-1]).max() > 100  # it moves
    for part, full in zip(parts, wholes, strict=True):
        assert (np.abs(part.astype(int) - full).max(axis=2) > SEEN).mean() < 3e-4


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


def test_shadows_lie_on_the_floor_where_the_light_casts_them_with_smooth_edges():
    with stage("inverted_pendulum") as shown:
        lit = shown.render().astype(int)
        shown.canvas.casts[:] = False
        shown.changed = True
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
