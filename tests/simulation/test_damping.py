"""A trace's reaction has the damping of Viscous and of a user's file, as it has their dry friction:
one motion has one reaction, however its friction is written.
"""

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc

ARM = """<mujoco model="arm"><compiler angle="radian"/>
<default><geom type="capsule" size=".02" contype="0" conaffinity="0"/></default><worldbody>
<body pos="0 0 1"><joint name="lift" axis="0 1 0" armature=".01" {}/>
<geom fromto="0 0 0 0 0 -.3" mass=".6"/></body></worldbody>
<actuator><motor joint="lift" ctrlrange="-5 5"/></actuator></mujoco>"""
WRITTEN = {
    "parts": ("", (smc.Coulomb(0.2), smc.Viscous(0.5))),
    "a formula": ("", smc.hardware.ServoFriction(kc=0.2, kv=0.5)),
    "the file": ('frictionloss=".2" damping=".5"', None),
    "the file and a part": ('damping=".3"', (smc.Coulomb(0.2), smc.Viscous(0.2))),
}


def swing(joint="", friction=None, **fields):
    plant = smc.plant_from(ARM.format(joint), {"lift": smc.Channel(x0=0.4)})
    fields = {"law": "pid", "duration": 2.0, "reference": smc.Sine(0.5, 3.0)} | fields
    return smc.run(smc.Scenario(plant=plant, friction=friction, **fields))


def test_one_motion_has_one_reaction_however_its_friction_is_written():
    first, *further = (swing(*written) for written in WRITTEN.values())
    peak = smc.score(first)["peak_reaction"]
    assert peak > 0.6  # of which the dry friction is 0.2
    for trace in further:
        np.testing.assert_allclose(trace.x, first.x, atol=1e-5)
        assert smc.score(trace)["peak_reaction"] == pytest.approx(peak, rel=1e-5)
        # a formula is that of the speed at the start of a step, also where a joint starts or turns
        assert np.quantile(np.abs(trace.reaction - first.reaction), 0.99) < 2e-3


@pytest.mark.quick
@pytest.mark.parametrize("damping", [".5", ".1 .2 .3"])
def test_the_reaction_of_damping_is_that_of_mujoco(damping):
    trace = swing(f'damping="{damping}"', law="none", v0=1.0)
    model = trace.scenario.plant.load()
    data = mujoco.MjData(model)
    expected = []
    for x, v in zip(trace.x[:, 0], trace.v[:, 0], strict=True):
        data.qpos[0], data.qvel[0] = x, v
        mujoco.mj_forward(model, data)
        expected.append(data.qfrc_damper[0])
    means = 0.5 * (np.array(expected[1:]) + expected[:-1])
    np.testing.assert_allclose(trace.reaction[1:, 0], means, rtol=1e-3, atol=1e-4)
    assert trace.reaction[0, 0] == 0.0


def test_damping_holds_no_joint_and_is_no_friction_of_a_plant_of_the_library():
    hangs = swing('damping=".5"', law="none", duration=5.0)  # at rest in the end
    assert smc.score(hangs)["stick_time"] == 0.0
    assert not smc.run(smc.Scenario(plant="duffing", law="pid", duration=0.1)).reaction.any()
    viscous = smc.Scenario(plant="duffing", law="pid", duration=0.1, friction=smc.Viscous(0.5))
    trace = smc.run(viscous)
    np.testing.assert_allclose(trace.reaction[1:], -0.5 * np.diff(trace.x, axis=0) / 1e-3)


def test_a_file_keeps_what_damping_exerted(tmp_path):
    trace = swing('damping=".5"')
    again = smc.load(trace.save(tmp_path / "run"))
    np.testing.assert_array_equal(again.reaction, trace.reaction)
    assert not again.holding.any()
