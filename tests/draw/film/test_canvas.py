"""Pictures of machines: colours, shapes, shadows and outlines."""

import numpy as np
import pytest
from helpers.films import staged
from PIL import Image, ImageFilter

import smc_mujoco as smc
from smc_mujoco.common import gl
from smc_mujoco.draw.film import changes
from smc_mujoco.draw.film.dilation import widened
from smc_mujoco.draw.film.stage import Stage
from smc_mujoco.simulation.model import compile_model

pytestmark = pytest.mark.skipif(
    gl.missing_renderer() is not None, reason=str(gl.missing_renderer())
)
SIZE = (640, 230)
SEEN = 24  # of 255: a sample of a smoothed edge more or less is no difference


def stage(plant: str, **fields) -> Stage:
    trace = smc.run(smc.Scenario(plant=plant, duration=1.0, **{"law": "none"} | fields))
    return staged(trace, SIZE, strip=20.0)


def changed(one, other):
    return np.abs(one.astype(int) - other).max(axis=2)


def test_a_changed_colour_or_shape_is_drawn():
    jump = smc.Jump(0.5, {"l": 1.5})
    with stage("inverted_pendulum", jump=jump) as view:
        view.arrange(np.zeros(1))
        first = view.render()
        view.set_colour("#A9AFB6")
        grey = view.render()
        view.arrange(np.zeros(1), time=0.6)
        for unlike in (first, view.render()):
            assert (changed(unlike, grey) > 50).sum() > 50


@pytest.mark.quick
def test_the_ground_of_van_der_pol_has_no_law_s_colour_and_two_greys():
    model = compile_model(smc.Scenario(plant="van_der_pol", law="none"))
    light, dark = (model.mat(name).rgba[:3] for name in ("energy_in", "energy_out"))
    for tint in (light, dark):
        assert np.ptp(tint) <= 0.1
    assert light.mean() - dark.mean() >= 0.1


def test_shadows_lie_on_the_floor_where_the_light_casts_them_with_smooth_edges():
    with stage("inverted_pendulum") as view:
        lit = view.render().astype(int)
        view.canvas.casts[:] = False
        bare = view.render().astype(int)
    darker = (bare - lit).min(axis=2)
    shadow = np.median(darker[darker > 10])
    edge = (darker > 0.2 * shadow) & (darker < 0.8 * shadow)
    assert (darker > 0.8 * shadow).sum() > 500
    assert edge.sum() > 50


def test_an_outline_stands_where_the_reference_is():
    with stage("van_der_pol") as view:
        view.arrange(np.array([1.5]))
        alone = view.render()
        view.arrange(np.array([1.5]), goal=np.array([0.1]))
        outline = changed(view.render(), alone) > 20
        columns = np.flatnonzero(outline.any(axis=0))
        assert outline.sum() > 100
        assert columns.max() < 0.6 * SIZE[0]
        view.arrange(np.array([1.5]))
        assert (changed(view.render(), alone) > SEEN).mean() < 3e-4


def test_an_outline_is_a_line_and_covers_nothing():
    """A machine of the drone's grey was mistaken for its reference."""
    with stage("inverted_pendulum") as view:
        view.arrange(np.array([0.6]))
        alone = view.render()
        view.arrange(np.array([0.6]), goal=np.array([0.0]))
        outline = changed(view.render(), alone) > 20
        view.arrange(np.array([0.0]))
        machine = changed(view.render(), alone) > 20
    assert 50 < outline.sum() < 0.3 * machine.sum()


def test_an_outline_that_the_picture_s_edge_would_cut_is_not_drawn():
    with stage("inverted_pendulum") as view:
        edge = view.project(np.zeros((1, 3)))[0, 0]
        metre = view.project(view.turn[:, :1].T)[0, 0] - edge
        for beyond, drawn in ((-60.0, True), (0.0, False)):  # px of the rod from the left edge
            view.model.cam_pos[view.camera] += (edge + beyond) / metre * view.turn[:, 0]
            view.arrange(np.array([0.6]))
            alone = view.render()
            view.arrange(np.array([0.6]), goal=np.array([0.0]))
            assert (changed(view.render(), alone).max() > 50) == drawn
            view.model.cam_pos[view.camera] -= (edge + beyond) / metre * view.turn[:, 0]


# what is kept from one picture to the next


def places(view, count=6):
    """Arrange a machine that moves, whose goal stands still and then jumps."""
    for k in range(count):
        goal = np.full(view.puppet.shown, 0.1 if k < count - 1 else 0.4)
        view.arrange(np.full(view.puppet.shown, 0.6 - 0.1 * k), goal=goal)
        view.forward()
        yield k


@pytest.mark.parametrize("plant", ["inverted_pendulum", "van_der_pol"])
def test_a_kept_outline_is_the_same_array_as_a_new_one(plant):
    with stage(plant) as view, stage(plant) as second_view:
        for _ in zip(places(view), places(second_view), strict=True):
            picture = view.canvas.draw(lambda shown: None)
            outlined = view.canvas.outlined(picture, view.add_outline, 2.0)
            second_view.canvas.draw(lambda shown: None)
            second_view.canvas.outline_look = b""
            drawn = second_view.canvas.outlined(picture, second_view.add_outline, 2.0)
            assert np.array_equal(outlined, drawn)
            assert changed(outlined, picture).max() > 50


def test_an_outline_is_drawn_again_only_when_its_shapes_or_the_camera_move(monkeypatch):
    counts = []
    with stage("inverted_pendulum") as view:
        draw = view.canvas.outline_of
        monkeypatch.setattr(
            view.canvas, "outline_of", lambda width: counts.append(width) or draw(width)
        )
        for _ in places(view):
            view.render()
        assert len(counts) == 2
        view.model.cam_pos[view.camera] += 0.1
        view.render()
        assert len(counts) == 3


@pytest.mark.parametrize("plant", ["inverted_pendulum", "duffing", "cart_pole", "panda"])
def test_a_picture_of_which_parts_are_kept_is_the_whole_one(plant):
    drawn = []
    with stage(plant) as view:
        canvas = view.canvas
        for _ in places(view):
            before = canvas.look
            picture = canvas.draw(lambda shown: None)
            look = canvas.look
            assert look is not None
            drawn.append(look.changed(before, view.model, SIZE))
            whole_picture = canvas.renderer.render()
            unlike = changed(picture, whole_picture)
            assert (unlike > SEEN).sum() <= 30  # samples of smooth edges
            assert (unlike > 3 * SEEN).sum() == 0
    assert drawn[0] is None
    assert any(drawn)


def test_all_of_a_picture_is_drawn_where_a_change_shows_elsewhere():
    with stage("inverted_pendulum") as view:
        list(places(view, 1))
        canvas = view.canvas
        canvas.draw(lambda shown: None)
        before = canvas.look
        assert before is not None
        assert list(before.changed(before, view.model, SIZE)) == []
        view.model.cam_pos[view.camera] += 0.01
        list(places(view, 1))
        canvas.draw(lambda shown: None)
        look = canvas.look
        assert look is not None
        assert look.changed(before, view.model, SIZE) is None
        view.model.geom_rgba[view.links] = 0.0
        canvas.draw(lambda shown: None)
        view.model.light_castshadow[:] = 1
        canvas.draw(lambda shown: None)
        assert canvas.look is None


def test_boxes_are_joined_where_that_takes_less_time():
    parts = []
    far = 4 * changes.PART_COST
    changes.join(parts, (0, 0, 10, 10))
    changes.join(parts, (20, 0, 30, 10))
    changes.join(parts, (far, 0, far + 10, 10))
    assert parts == [(0, 0, 30, 10), (far, 0, far + 10, 10)]
    changes.join(parts, (0, 0, far, 100))
    assert parts == [(0, 0, far + 10, 100)]


@pytest.mark.parametrize("reach", [1, 2, 5, 40])
def test_shapes_are_widened_as_by_a_filter_of_ranks(reach):
    shapes = (np.random.default_rng(0).random((37, 53)) > 0.97).astype(np.uint8) * 200
    filtered = Image.fromarray(shapes).filter(ImageFilter.MaxFilter(2 * reach + 1))
    assert np.array_equal(widened(shapes, reach), np.asarray(filtered))
