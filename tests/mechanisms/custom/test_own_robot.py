"""A robot of one's own: what a text says of its channels, bounds, mistakes in laws, and the shapes
of a URDF.
"""

import re
import warnings

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.mechanisms.named import as_plant

MODEL = """<mujoco><worldbody><body><joint name="lift" type="slide" axis="0 0 1"/>
<geom size=".1" mass="3"/>
<body pos="0 0 -.1"><joint name="tilt" axis="0 1 0" damping=".1"/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03"/></body></body></worldbody></mujoco>"""
ARM = """<robot name="arm"><link name="base"/>
<link name="l1"><inertial><origin xyz="0 0 -0.25"/><mass value="1.5"/>
<inertia ixx="0.03" iyy="0.03" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><origin xyz="0 0 -0.25"/><geometry><cylinder radius="0.03" length="0.5"/></geometry>
</visual>
<collision><origin xyz="0 0 -0.25"/><geometry><box size=".1 .1 .5"/></geometry></collision></link>
<link name="l2"><inertial><origin xyz="0 0 -0.2"/><mass value="0.8"/>
<inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><origin xyz="0 0 -0.2"/><geometry><cylinder radius="0.03" length="0.4"/></geometry>
</visual></link>
<joint name="j1" type="revolute"><parent link="base"/><child link="l1"/><origin xyz="0 0 1.2"/>
<axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="40" velocity="10"/></joint>
<joint name="j2" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0 0 -0.5"/>
<axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="20" velocity="10"/></joint></robot>"""
RUN = {"law": "classical", "duration": 0.01}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "mine.xml").write_text(MODEL)
    (tmp_path / "arm.urdf").write_text(ARM)
    (tmp_path / "one.xml").write_text(re.sub(r"<body pos.*?</body>", "", MODEL, flags=re.DOTALL))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_text_says_of_a_channel_what_python_says(folder):
    said = as_plant("mine.xml:lift(motor,partner=tilt,u_max=30,x0=0.1,partner_x0=-0.2)")
    channel = smc.Channel(
        motor=True,
        partner="tilt",
        u_max=30.0,
        x0=0.1,
        partner_x0=-0.2,
    )
    assert said == smc.plant_from("mine.xml", {"lift": channel})
    assert said.argument == "mine.xml:lift(motor,partner=tilt,x0=0.1,partner_x0=-0.2)"
    both = as_plant("mine.xml:lift(motor,u_max=30)+tilt(motor, u_max=5)")
    assert smc.Scenario(plant=both, **RUN).resolved.u_max == (30.0, 5.0)


def bounds(text, **fields):
    with warnings.catch_warnings(record=True) as reported:
        warnings.simplefilter("always")
        scenario = smc.Scenario(plant=as_plant(text), **(RUN | fields))
    return scenario.resolved.u_max, [str(warning.message) for warning in reported]


def one(y, gains, memory):
    return -gains.k * y.e


def test_a_urdf_keeps_its_visual_shapes_and_its_motion(folder):
    plant = as_plant("arm.urdf:j1(motor)+j2(motor)")
    model = plant.build(2).compile()
    plain = mujoco.MjSpec.from_file("arm.urdf").compile()
    assert plain.ngeom == 1
    assert model.ngeom == 3
    # the box, which is for contacts, is not seen
    assert sorted(model.geom_group.tolist()) == [1, 1, 3]
    np.testing.assert_array_equal(model.body_mass, plain.body_mass)
    np.testing.assert_array_equal(model.body_inertia, plain.body_inertia)
