"""Identified numbers written back into the model file."""

import mujoco
import numpy as np
import pytest
from helpers.machine_logs import chain

import smc_mujoco as smc
from smc_mujoco.errors import ScenarioWarning
from smc_mujoco.identification.model_file import save_model
from smc_mujoco.identification.own_rig import own_rig

SERVO = '<position joint="j1" kp="60" kv="3" ctrlrange="-1.5 1.5" forcerange="-12 12"/>'
URDF = """<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="1"/>
<origin xyz="0 0 -.2"/><inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial>
</link><joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit effort="5" lower="-2" upper="2" velocity="3"/></joint></robot>"""


def rig_of(path, names, **channel):
    joints = {"j1": smc.Channel(**channel)} if channel else ["j1"]
    return own_rig(smc.plant_from(path, joints), names)


@pytest.mark.quick
def test_an_mjcf_has_the_numbers_that_were_found(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(chain([0.4, 0.3], [1.0, 0.5]))
    values = {"j1.damping": 0.3, "j1.frictionloss": 0.4, "j2.armature": 0.02, "m": 3.0}
    arm = smc.plant_from(path, ["j1", "j2"])
    rig = own_rig(arm, [*values, "input_delay"]).with_values(values)
    before = arm.load()
    with pytest.warns(ScenarioWarning, match="without input_delay"):
        written = save_model(rig, tmp_path / "out.xml")
    model = mujoco.MjModel.from_xml_path(str(written))
    assert model.dof_damping[0, 0] if model.dof_damping.ndim > 1 else model.dof_damping[0] == 0.3
    assert model.dof_frictionloss[0] == 0.4
    assert model.dof_armature[1] == 0.02
    assert model.body_mass.sum() == pytest.approx(3.0)
    np.testing.assert_allclose(model.body_inertia[1:3], before.body_inertia[1:3] * 2.0, rtol=1e-6)
    again = own_rig(smc.plant_from(written, ["j1", "j2"]), ["j1.damping", "m"])
    assert again.values == {"j1.damping": 0.3, "m": pytest.approx(3.0)}


def test_a_payload_and_a_servo_s_gains_are_in_the_file(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(
        chain([0.4], [1.0])
        .replace('<motor joint="j1"/>', SERVO)
        .replace("<body ", '<body name="link" ')
    )
    values = {"j1.kp": 90.0, "j1.kv": 1.5, "link.payload": 0.25}
    rig = rig_of(path, list(values), servo=True)
    assert rig.values == {"j1.kp": 60.0, "j1.kv": 3.0, "link.payload": 0.0}
    written = save_model(rig.with_values(values), tmp_path / "out.xml")
    model = mujoco.MjModel.from_xml_path(str(written))
    assert model.body_mass[1] == pytest.approx(1.25)
    assert model.actuator_gainprm[0, 0] == 90.0
    assert model.actuator_biasprm[0, 1:3].tolist() == [-90.0, -1.5]
    condition = rig.with_values({"j1.kp": 90.0}).condition_fields()
    assert condition["actuator"][0].kp == 90.0


def test_a_urdf_keeps_its_form_and_refuses_what_it_cannot_have(tmp_path, refused):
    path = tmp_path / "arm.urdf"
    path.write_text(URDF)
    with pytest.warns(ScenarioWarning):
        arm = smc.plant_from(path, ["j"])
    rig = own_rig(arm, ["j.damping", "j.frictionloss"])
    rig = rig.with_values({"j.damping": 0.3, "j.frictionloss": 0.4})
    written = save_model(rig, tmp_path / "out.urdf").read_text()
    assert '<dynamics damping="0.3" friction="0.4" />' in written
    armature = own_rig(arm, ["j.armature"])
    refused(lambda: save_model(armature, tmp_path / "out.urdf"), "j.armature", "FILE.txt")
    refused(lambda: save_model(rig, tmp_path / "out.json"), "out.json", ".xml")
