"""A model that nobody here wrote has its picture and its figure."""

import importlib.util
import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest
from helpers.films import staged, without_charts

import smc_mujoco as smc
from smc_mujoco.common import gl
from smc_mujoco.draw.film.arrow_lines import MAX_SWEEP, path
from smc_mujoco.draw.film.arrows import Scale, frames, scale_words, scales

pytestmark = pytest.mark.skipif(
    gl.missing_renderer() is not None, reason=str(gl.missing_renderer())
)
SUITE = importlib.util.find_spec("dm_control")
if SUITE is None or not SUITE.submodule_search_locations:
    pytest.skip("dm_control is not installed", allow_module_level=True)
FOREIGN = Path(SUITE.submodule_search_locations[0]) / "suite"


@pytest.mark.parametrize(
    ("group", "floor", "words"),
    [
        (3, "", "shows no part that moves"),
        (0, '<geom type="box" size="9 9 .1"/>', None),
    ],
)
@without_charts
def test_a_picture_that_shows_nothing_is_told(tmp_path, group, floor, words):
    (tmp_path / "one.xml").write_text(f"""
      <mujoco><worldbody>{floor}<body pos="0 0 .5"><joint name="j" axis="0 1 0"/>
        <geom size=".1" pos="0 0 .3" group="{group}"/></body></worldbody>
      <actuator><motor joint="j"/></actuator></mujoco>""")
    trace = smc.run(
        smc.Scenario(plant=smc.plant_from(tmp_path / "one.xml", ["j"]), law="none", duration=0.1)
    )
    if words:
        with pytest.warns(smc.errors.ScenarioWarning, match=words):
            smc.film([trace], tmp_path / "a.png", at=0.1, size=(320, 180))
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            smc.film([trace], tmp_path / "a.png", at=0.1, size=(320, 180))


def test_the_key_names_what_pushes_a_foreign_model_of_its_own_accord():
    plant = smc.plant_from(FOREIGN / "cartpole.xml", {"slider": smc.Channel(partner="hinge_1")})
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law="none",
            duration=0.3,
            x0=(1.79, 0.0),
            v0=(2.0, 0.0),
        )
    )
    assert trace.reaction.any()  # the joint's limit
    assert "reaction" in scale_words([trace], scales([trace]))[0]


def hung(floor, **fields):
    """A run of a pendulum on a fixed bracket, 1.2 m above the world's origin."""
    plant = smc.plant_from(
        f"""<mujoco><default><geom contype="0" conaffinity="0"/></default><worldbody>
          {floor}<geom type="box" size=".05 .05 .05" pos="0 0 1.2"/><body name="rod" pos="0 0 1.2">
          <joint name="j" axis="0 1 0"/><geom type="capsule" size=".02" fromto="0 0 0 0 0 -.5"/>
          </body></worldbody><actuator><motor joint="j" ctrlrange="-8 8"/></actuator></mujoco>""",
        ["j"],
    )
    return smc.run(
        smc.Scenario(
            plant=plant,
            law="none",
            duration=0.1,
            **fields,
        )
    )


def test_a_blow_is_an_arrow_to_its_body_that_is_to_the_scale_of_the_others():
    push = smc.signals.Push(
        "rod",
        x=24.0,
        time=0.05,
        width=0.02,
    )
    trace = hung("", disturbance=push)
    sizes = [
        Scale(
            8.0,
            0.0,
            longest=8.0,
            full=8.0,
        )
    ]
    edges = np.array([0.0, 0.04, 0.06])
    before, during = frames(trace, edges, np.zeros(2), sizes, "#0072B2")
    assert not before.arrows
    ((_, arrow),) = during.arrows
    with staged(trace, (640, 360)) as scene:
        arrow_path = path(scene.model, scene.data, scene.mounts[0], arrow)
        assert arrow_path is not None
        rod = scene.data.body("m/rod").xipos
        longest = MAX_SWEEP * scene.mounts[0].radius
    line = arrow_path[0]
    assert (np.diff(line[:, 0]) > 0.0).all()
    assert 0.0 < rod[0] - line[-1, 0] < longest
    assert np.ptp(line[:, 0]) == pytest.approx(3.0 * longest)


@pytest.mark.quick
@pytest.mark.parametrize(("floor", "shown"), [(0.6, 0.6), (-3.0, 0.68)])  # m; -3 is out of sight
def test_a_foreign_machine_has_its_own_floor_or_one_close_below(floor, shown):
    trace = hung(f'<geom type="plane" size="1 1 .1" pos="0 0 {floor}"/>')
    with staged(trace, (640, 360)) as scene:
        assert scene.puppet.height == pytest.approx(-shown, abs=0.01)


@without_charts
def test_a_picture_leaves_no_mesh_in_mujocos_cache(tmp_path):
    """A humanoid's take as much as all else that is live while it is filmed."""
    (tmp_path / "a.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    (tmp_path / "m.xml").write_text("""<mujoco><asset><mesh name="a" file="a.obj"/></asset>
      <worldbody><body><joint name="j"/><geom type="mesh" mesh="a"/></body></worldbody>
      <actuator><motor joint="j"/></actuator></mujoco>""")
    plant = smc.plant_from(tmp_path / "m.xml", ["j"])
    cache = mujoco.mj_getCache()
    capacity = mujoco.mj_getCacheCapacity(cache)
    assert mujoco.mj_getCacheSize(cache) > 0
    trace = smc.run(smc.Scenario(plant=plant, law="none", duration=0.01))
    smc.film(trace, tmp_path / "a.png", at=0.0, size=(320, 180))
    assert mujoco.mj_getCacheSize(cache) == 0
    assert mujoco.mj_getCacheCapacity(cache) == capacity > 0
