"""Pictures of machines: colours, shapes, shadows and outlines."""

import numpy as np
import pytest
from helpers.films import staged

import smc_mujoco as smc
from smc_mujoco.common import gl
from smc_mujoco.draw.film.stage import Stage
from smc_mujoco.simulation.model import compile_model

pytestmark = pytest.mark.skipif(gl.missing() is not None, reason=str(gl.missing()))
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
