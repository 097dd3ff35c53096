"""A robot of one's own: what a text says of its channels, bounds, mistakes in laws, and the shapes
of a URDF.
"""

import re
import struct
import warnings

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.common.errors import ScenarioWarning
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
<limit lower="-2" upper="2" effort="40"/></joint>
<joint name="j2" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0 0 -0.5"/>
<axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="20"/></joint></robot>"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "mine.xml").write_text(MODEL)
    (tmp_path / "arm.urdf").write_text(ARM)
    (tmp_path / "one.xml").write_text(re.sub(r"<body pos.*?</body>", "", MODEL, flags=re.DOTALL))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.quick
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
    seen = as_plant("mine.xml:lift(motor)+tilt( measured )")
    assert seen == smc.plant_from("mine.xml", {"lift": smc.Channel(motor=True)}, measured=["tilt"])
    assert seen.argument == "mine.xml:lift(motor)+tilt(measured)"
    of_text = as_plant("mine.xml:lift(motor,u_max=30)+tilt(motor, u_max=5)")
    assert smc.Scenario(plant=of_text, law="classical").resolved.u_max == (30.0, 5.0)


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


def test_a_joint_of_a_urdf_with_an_effort_gets_an_ideal_motor(folder):
    with pytest.warns(ScenarioWarning) as caught:
        plant = as_plant("arm.urdf:j1")
    said = " ".join(str(warning.message) for warning in caught)
    assert "no actuators, so joint 'j1' gets an ideal motor" in said
    assert plant.argument == "arm.urdf:j1(motor)+held"
    assert plant == as_plant("arm.urdf:j1(motor)+held")
    assert plant.limits == (40.0,)
    # nothing says that a motor is there, or how strong it is
    with pytest.raises(smc.ScenarioError, match=r'give "mine.xml:lift\(motor\)\+tilt"'):
        as_plant("mine.xml:lift+tilt")


def tetrahedron(size):
    """The bytes of a binary STL."""
    corners = size * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    content = b"\0" * 80 + struct.pack("<I", 4)
    for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)):
        content += struct.pack("<12fH", 0, 0, 0, *corners[list(face)].ravel(), 0)
    return content


MESH = '<{0}><geometry><mesh filename="{1}"/></geometry></{0}>'
MESHES = {  # name in the URDF -> where the file lies, below the folder above the package
    "package://arm_description/meshes/link.stl": "arm_description/meshes/link.stl",
    "package:///other/link.STL": "other/link.STL",
    "../meshes/link.stl": "arm_description/meshes/link.stl",
    "link.stl": "arm_description/urdf/link.stl",
    "package://away/meshes/link.stl": "arm_description/urdf/link.stl",
}


def in_package(tmp_path, old="", new="", visual="", collision=""):
    """The URDF above in a package, with two shapes on its last link and one text replaced."""
    text = ARM.replace(old, new, 1) if old else ARM
    shapes = MESH.format("visual", visual) * bool(visual)
    shapes += MESH.format("collision", collision) * bool(collision)
    file = tmp_path / "arm_description" / "urdf" / "arm.urdf"
    file.parent.mkdir(parents=True)
    before, after = text.rsplit("</link>", 1)
    file.write_text(f"{before}{shapes}</link>{after}")
    return file


def read(file):
    """The model of a plant, and what was said of the file."""
    with warnings.catch_warnings(record=True) as reported:
        warnings.simplefilter("always")
        plant = smc.plant_from(file, {"j1": {"motor": True}, "j2": {"motor": True}})
    sentences = [str(warning.message) for warning in reported]
    return plant.load(), [text for text in sentences if "give way by" not in text]


@pytest.mark.parametrize("name", MESHES)
def test_a_mesh_is_found_where_its_name_says_and_counts(tmp_path, name):
    file = in_package(tmp_path, collision=name)
    file.write_text('\n<?xml version="1.0"?>' + file.read_text())
    mesh = tmp_path / MESHES[name]
    mesh.parent.mkdir(parents=True, exist_ok=True)
    mesh.write_bytes(tetrahedron(0.1))
    model, said = read(file)
    assert (model.nmesh, said) == (1, [])
    plant = smc.plant_from(file, {"j1": {"motor": True}})
    mesh.write_bytes(tetrahedron(0.2))
    with pytest.raises(smc.ScenarioError, match=r"has changed: call smc.plant_from again"):
        plant.spec()


def test_files_of_one_name_in_two_folders_are_two_meshes(tmp_path):
    names = "package://arm_description/seen/link.stl", "package://arm_description/solid/link.stl"
    file = in_package(tmp_path, visual=names[0], collision=names[1])
    for folder, size in (("seen", 0.3), ("solid", 0.1)):
        (tmp_path / "arm_description" / folder).mkdir()
        mesh = tmp_path / "arm_description" / folder / "link.stl"
        mesh.write_bytes(tetrahedron(size))
    model, _ = read(file)
    solid = model.geom_dataid[(model.geom_contype > 0) & (model.geom_dataid >= 0)]
    assert np.ptp(model.mesh_vert[model.mesh_vertadr[solid[0]] :][:4], axis=0).max() < 0.2


PARTS = ("motor.xml", "robot.xml")
INERTIA = 'ixx="0.01" iyy="0.01" izz="0.001"'
INERTIAL = re.findall("<inertial>.*?</inertial>", ARM, re.DOTALL)[1]
CHANGED = {  # what differs from the URDF, and the words of the one sentence on it
    "dae": ({"visual": "package://a/m.dae", "collision": "no.stl"}, "'package://a/m.dae', 'no.stl'"),
    "inertia": ({"old": INERTIA, "new": 'ixx="0.01" iyy="0.01" izz="0.05"'}, "gives 'l2'"),
    "negative": ({"old": INERTIA, "new": 'ixx="-0.01" iyy="0.01" izz="0.01"'}, "gives 'l2'"),
    "fast": ({"old": 'effort="20"', "new": 'effort="20" velocity="3.5"'}, "velocity limits of arm.urdf"),
    "bare": ({"old": INERTIAL, "new": "<collision><geometry><sphere radius='.1'/></geometry></collision>"}, "gives 'l2' no"),
}  # fmt: skip


@pytest.mark.parametrize("kind", CHANGED)
def test_what_is_changed_in_a_urdf_is_said_once_by_its_link(tmp_path, kind):
    fields, words = CHANGED[kind]
    model, said = read(in_package(tmp_path, **fields))
    (sentence,) = said
    assert words in sentence
    small, middle, large = sorted(model.body_inertia[2])
    assert 0.0 < large <= small + middle


LIGHT = "'l2'.*give that body a mass and an inertia"
FLAT = f"{INERTIAL}<collision><geometry><sphere radius='0'/></geometry></collision>"
REFUSED = {
    "point": (INERTIA, 'ixx="0" iyy="0" izz="0"', LIGHT),
    "massless": (INERTIAL, "", LIGHT),
    "flat": (INERTIAL, FLAT, "give its shapes sizes above 0"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_a_link_without_inertia_or_size_is_refused_and_the_cure_works(tmp_path, kind):
    old, new, cure = REFUSED[kind]
    file = in_package(tmp_path, old, new)
    with pytest.raises(smc.ScenarioError, match=cure):
        read(file)
    file.write_text(ARM)
    assert read(file)[1] == []


def test_a_rounded_inertia_is_mended_in_silence_and_keeps_its_axes(tmp_path):
    model, said = read(in_package(tmp_path, INERTIA, 'ixx="0.001" iyy="0.009" izz="0.0100001"'))
    assert said == []
    np.testing.assert_allclose(np.sort(model.body_inertia[2]), [0.001, 0.009, 0.01], rtol=2e-4)


def test_a_joint_that_mimics_another_follows_it(tmp_path):
    file = in_package(tmp_path, '<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><mimic joint="j2" multiplier="-2" offset=".1"/>')  # fmt: skip
    plant = smc.plant_from(file, {"j2": {"motor": True}})
    data = mujoco.MjData(model := plant.load())
    assert model.neq == 1
    data.joint("j1").qpos, data.joint("j2").qpos = 0.1, 0.0
    model.opt.gravity[:] = 0.0
    data.qfrc_applied[model.joint("j2").dofadr] = 2.0
    mujoco.mj_step(model, data, nstep=int(0.2 / model.opt.timestep))
    follower, leader = data.joint("j1").qpos[0], data.joint("j2").qpos[0]
    assert abs(leader) > 0.02
    assert follower == pytest.approx(0.1 - 2.0 * leader, abs=2e-2)


@pytest.mark.parametrize(
    "compiler", ["", '<compiler meshdir="parts"/>', '<compiler assetdir="a"/>']
)
@pytest.mark.parametrize("included", [False, True])
def test_a_missing_mesh_and_a_part_are_refused_with_cures_that_work(tmp_path, compiler, included):
    asset = f'{compiler}<asset><mesh name="m" file="sub/m.stl"/></asset>'
    (tmp_path / "robot.xml").write_text(
        f"""<mujoco>{asset}<worldbody><body><joint name="j"/><geom type="mesh" mesh="m"/></body>
        </worldbody><actuator><motor joint="j"/></actuator></mujoco>"""
    )
    (tmp_path / "scene.xml").write_text(f'<mujoco><include file="{PARTS[included]}"/></mujoco>')
    (tmp_path / "motor.xml").write_text(
        '<mujoco><default><joint damping="1"/></default><actuator><motor joint="k"/></actuator></mujoco>'
    )
    file = tmp_path / ("scene.xml" if included else "robot.xml")
    with pytest.raises(smc.ScenarioError, match="put that file there, seen from") as caught:
        smc.plant_from(file, ["j"])
    place = tmp_path / re.findall(r"file '(.*?)'", str(caught.value))[0]
    place.parent.mkdir(parents=True)
    place.write_bytes(tetrahedron(0.1))
    assert smc.plant_from(file, ["j"]).n == 1
    if not included:
        with pytest.raises(smc.ScenarioError, match=r"the one that includes it"):
            smc.plant_from(tmp_path / "motor.xml", ["k"])


@pytest.mark.parametrize(
    ("model", "name"),
    [("Arm X-2 scene", "arm_x_2"), ("scene", "big_arm"), ("", "big_arm"), (None, "big_arm")],
)
def test_a_file_whose_name_says_nothing_has_that_of_its_model_or_folder(tmp_path, model, name):
    attribute = "" if model is None else f' model="{model}"'
    text = f"""<mujoco{attribute}><worldbody><body><joint name="j"/><geom size=".1"/></body>
    </worldbody><actuator><motor joint="j" ctrlrange="-1 1"/></actuator></mujoco>"""
    folder = tmp_path / "big_arm"
    folder.mkdir()
    for file in ("scene.xml", "scene_right.xml", "lift.xml"):
        (folder / file).write_text(text)
    assert smc.plant_from(folder / "scene.xml", ["j"]).name == name
    assert smc.plant_from(folder / "scene_right.xml", ["j"]).name == name
    assert smc.plant_from(folder / "lift.xml", ["j"]).name == "lift"


def test_a_xacro_is_refused_with_its_command(folder):
    (folder / "arm.urdf.xacro").write_text(ARM)
    with pytest.raises(
        smc.ScenarioError, match=r"give what xacro arm.urdf.xacro > FILE.urdf writes"
    ):
        smc.plant_from("arm.urdf.xacro", ["j1"])
    with pytest.raises(smc.ScenarioError, match=r"xacro FILE > FILE.urdf"):
        as_plant("arm.urdf.xacro:j1")


CABLES = """<mujoco model="cables"><worldbody><site name="a" pos="-1 0 2"/><site name="b" pos="1 0 2"/>
<body pos="0 0 1"><joint name="x" type="slide" axis="1 0 0"/><geom size=".05" mass="2"/>
<site name="p"/><body pos="0 1 0"><joint name="y" axis="0 0 1"/><geom size=".05"/></body></body>
</worldbody><tendon><spatial name="c1"><site site="a"/><site site="p"/></spatial>
<spatial name="c2"><site site="b"/><site site="p"/></spatial></tendon><actuator>
<motor name="left" tendon="c1" ctrlrange="0 100" gear="-1"/>
<motor tendon="c2" ctrlrange="0 100" gear="-1"/></actuator></mujoco>"""


def test_an_ideal_motor_in_place_of_cables_is_said_to_leave_them_out():
    with pytest.warns(ScenarioWarning, match="leaves out that 'left' and 'c2' pull at it"):
        smc.plant_from(CABLES, {"x": smc.Channel(motor=True)})
    with warnings.catch_warnings():
        warnings.filterwarnings("error", ".*pull at it")
        warnings.filterwarnings("ignore", ".*nothing commands")
        smc.plant_from(CABLES, {"y": smc.Channel(motor=True)})
