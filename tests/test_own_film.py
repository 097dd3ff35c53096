"""A model that nobody here wrote has its picture and its figure."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import smc_mujoco as smc
from smc_mujoco import gl

pytestmark = pytest.mark.skipif(gl.missing() is not None, reason=str(gl.missing()))
SUITE = importlib.util.find_spec("dm_control")


@pytest.mark.parametrize(
    ("name", "channels"),
    [
        ("cartpole", {"slider": smc.Channel(partner="hinge_1")}),
        ("acrobot", {"elbow": None}),
        ("manipulator", {"arm_root": None, "arm_shoulder": None}),
    ],
)
def test_a_foreign_model_has_its_picture(tmp_path, name, channels):
    assert SUITE is not None
    assert SUITE.submodule_search_locations
    plant = smc.plant_from(Path(SUITE.submodule_search_locations[0]) / "suite" / f"{name}.xml", channels)
    runs = [smc.Scenario(plant=plant, law=law, duration=0.2) for law in ("none", "super_twisting")]
    traces = smc.run(runs)
    still = smc.still(traces, 0.1, tmp_path / "a.png", size=(640, 360))
    assert np.asarray(Image.open(still))[60:200].std() > 5.0
    assert all(path.stat().st_size for path in smc.figure(traces, tmp_path / "a.svg"))


def test_a_body_without_a_shape_has_no_arrow_and_no_error(tmp_path):
    (tmp_path / "bare.xml").write_text("""
      <mujoco><worldbody><geom size="1 1 .1" type="plane"/><body>
        <inertial pos="0 0 .2" mass="1" diaginertia="1 1 1"/><joint name="j" axis="0 1 0"/></body>
        <body pos="0 0 .5"><joint name="i" axis="0 1 0"/><geom size=".1"/></body></worldbody>
      <actuator><motor joint="j"/><motor joint="i"/></actuator></mujoco>""")
    plant = smc.plant_from(tmp_path / "bare.xml", ["j", "i"])
    trace = smc.run(smc.Scenario(plant=plant, law="classical", duration=0.2, x0=0.3))
    assert smc.still([trace], 0.1, tmp_path / "a.png", size=(640, 360)).stat().st_size
