"""What MuJoCo takes from a file without a word, and no machine has, is one sentence."""

import re

import pytest

import smc_mujoco as smc
from smc_mujoco.common.errors import ScenarioError

MJCF = """<mujoco model="m"><compiler angle="radian"/><option viscosity="0"/><worldbody>
<body name="b"><joint name="j" axis="0 1 0" damping="0.1" frictionloss="0.01" range="-3 3"/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".02" mass="1" contype="0" conaffinity="0"/></body>
</worldbody><tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>
<actuator><position joint="j" kp="3" kv=".1" ctrlrange="-5 5" forcerange="-9 9"/></actuator>
<keyframe><key name="home" qpos="0.1"/></keyframe></mujoco>"""
URDF = """<robot name="u"><link name="w"/><link name="a"><inertial><mass value="1"/>
<origin xyz="0 0 -.2"/><inertia ixx=".02" iyy=".02" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial>
</link><joint name="j" type="revolute"><parent link="w"/><child link="a"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="5" velocity="0"/><dynamics damping=".1" friction=".01"/></joint>
</robot>"""
WRONG = [  # in the file, in its place, what the sentence says
    (MJCF, 'mass="1"', 'mass="nan"', 'mass="nan"'),
    (MJCF, 'qpos="0.1"', 'qpos="nan"', 'qpos="nan"'),
    (MJCF, 'fromto="0 0 0 0 0 -.4"', 'fromto="0 0 NaN 0 0 -.4"', "fromto"),
    (MJCF, 'damping="0.1"', 'damping="-1"', "damping -1 of joint 'j'"),
    (MJCF, 'damping="0.1"', 'stiffness="-2"', "stiffness -2 of joint 'j'"),
    (MJCF, 'damping="0.1"', 'armature="-2"', "armature -2 of joint 'j'"),
    (MJCF, 'frictionloss="0.01"', 'frictionloss="-1"', "frictionloss -1 of joint 'j'"),
    (MJCF, 'name="t"', 'name="t" stiffness="-4"', "stiffness -4 of tendon 't'"),
    (MJCF, 'viscosity="0"', 'viscosity="-5"', "viscosity -5"),
    (MJCF, 'kp="3"', 'kp="-3"', "kp -3 of actuator"),
    (MJCF, 'range="-3 3"', 'range="3 -3"', "range 3 -3 of joint 'j'"),
    (MJCF, 'ctrlrange="-5 5"', 'ctrlrange="5 -5"', "ctrlrange 5 -5 of actuator"),
    (MJCF, 'forcerange="-9 9"', 'forcerange="9 -9"', "forcerange 9 -9 of actuator"),
    (URDF, 'lower="-3" upper="3"', 'lower="3" upper="-3"', "range 3 -3 of joint 'j'"),
    (URDF, 'effort="5"', 'effort="-5"', "effort -5 of joint 'j'"),
    (URDF, 'velocity="0"', 'velocity="-1"', "velocity -1 of joint 'j'"),
    (URDF, 'damping=".1"', 'damping="-.1"', "damping -.1 of joint 'j'"),
    (URDF, 'friction=".01"', 'friction="-1"', "friction -1 of joint 'j'"),
    (URDF, 'mass value="1"', 'mass value="nan"', 'value="nan"'),
]


@pytest.mark.quick
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("text", [MJCF, URDF], ids=["mjcf", "urdf"])
def test_a_file_whose_numbers_a_machine_may_have_is_read(text, tmp_path):
    path = tmp_path / ("m.urdf" if text == URDF else "m.xml")
    path.write_text(text)
    assert smc.plant_from(path, ["j"]).n == 1


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("text", "right", "wrong", "words"), WRONG, ids=[w[2] for w in WRONG])
def test_a_number_that_no_machine_has_is_refused(text, right, wrong, words, tmp_path):
    assert right in text
    path = tmp_path / ("m.urdf" if text == URDF else "m.xml")
    path.write_text(text.replace(right, wrong, 1))
    with pytest.raises(ScenarioError, match=re.escape(words)) as refused:
        smc.plant_from(path, ["j"])
    assert "give" in str(refused.value)


def test_a_wrong_number_of_an_included_file_or_a_text_is_refused(tmp_path):
    (tmp_path / "inc.xml").write_text('<mujocoinclude><geom size=".1" mass="nan"/></mujocoinclude>')
    path = tmp_path / "m.xml"
    path.write_text(MJCF.replace("</body>", '<include file="inc.xml"/></body>'))
    for model in (path, MJCF.replace('mass="1"', 'mass="nan"')):
        with pytest.raises(ScenarioError, match="nan"):
            smc.plant_from(model, ["j"])
