"""A payload of a user's model: what a mismatch, a jump, a class of uncertainty and a log say of
it.
"""

import dataclasses
import math

import numpy as np
import pytest
from helpers.machine_logs import log, sines

import smc_mujoco as smc
from smc_mujoco.draw import wording

FREE = 'contype="0" conaffinity="0"'
ARM = f"""<mujoco model="carrier"><compiler angle="radian"/><worldbody><body name="upper">
<joint name="lift" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1" {FREE}/>
<body name="hand" pos="0 0 -.4"><joint name="bend" axis="0 1 0" damping=".1"/>
<inertial pos="0 0 -.15" mass=".5" diaginertia=".004 .004 .0002"/>
<geom type="capsule" fromto="0 0 0 0 0 -.3" size=".02" {FREE}/></body></body></worldbody>
<actuator><motor joint="lift"/><motor joint="bend"/></actuator></mujoco>"""
HEAVY = ARM.replace('mass=".5"', 'mass=".9"')  # with 0.4 kg at the centre of mass
RUN = {"law": "pid", "x0": (0.3, -0.2), "duration": 0.5, "u_max": (30.0, 10.0)}


@pytest.fixture(scope="module")
def arm():
    return smc.plant_from(ARM, ["lift", "bend"])


def test_a_payload_is_a_point_mass_at_the_centre_of_mass_that_no_other_mass_scales(arm):
    heavy = smc.plant_from(HEAVY, ["lift", "bend"])
    more = ARM.replace('mass="1"', 'mass="1.2"').replace('mass=".5"', 'mass="1"')
    more = more.replace(".004 .004 .0002", ".0048 .0048 .00024")  # 0.6 kg and 0.4 kg
    more = smc.plant_from(more, ["lift", "bend"])
    carried = {"hand.payload": 0.4}
    runs = smc.run(
        [
            smc.Scenario(plant=heavy, **RUN),
            smc.Scenario(plant=arm, mismatch=carried, **RUN),
            smc.Scenario(plant=arm, jump=smc.Jump(0.0, carried), **RUN),
            smc.Scenario(plant=more, **RUN),
            smc.Scenario(plant=arm, mismatch={**carried, "mass": 1.2}, **RUN),
        ]
    )
    for run in runs[1:3]:
        np.testing.assert_allclose(run.x, runs[0].x, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(runs[4].x, runs[3].x, rtol=0.0, atol=1e-12)
    assert np.abs(runs[3].x - runs[0].x).max() > 1e-3
    assert "hand.payload + 0.4 kg" in runs[1].scenario.plant.change(carried)


@pytest.mark.quick
def test_a_law_does_not_know_of_a_payload(arm):
    base = smc.Scenario(plant=arm, model="nominal", **RUN | {"law": "classical"})
    carrying = dataclasses.replace(base, mismatch={"hand.payload": 0.4})
    light, heavy = smc.run([base, carrying])
    assert np.abs(light.x - heavy.x).max() > 1e-3
    np.testing.assert_array_equal(light.u[0], heavy.u[0])


def test_a_payload_or_a_damping_that_no_machine_can_have_is_refused(arm):
    for name, words in (("hnd", "did you mean 'hand.payload'"), ("world", "unknown parameter")):
        with pytest.raises(smc.ScenarioError, match=words):
            smc.Scenario(plant=arm, mismatch={f"{name}.payload": 1.0}, **RUN)
    for name in ("hand.payload", "bend.damping"):  # the model has none of one, some of the other
        with pytest.raises(smc.ScenarioError, match=rf"true {name} becomes -\S+: give other"):
            smc.Scenario(plant=arm, mismatch={name: -0.1}, **RUN)


def test_an_adversary_chooses_a_payload_and_a_friction_of_an_own_model(arm):
    ranges = {"hand.payload": (0.0, 1.0), "bend.damping": (0.5, 2.0)}
    base = smc.Scenario(plant=arm, **RUN)
    worst = smc.worst_case(base, within=smc.Uncertainty(parameters=ranges), budget=8)
    for name, (low, high) in ranges.items():
        assert low <= worst.constants[name] == worst.scenario.mismatch[name] <= high
    carried = worst.constants["hand.payload"]
    assert f" with hand.payload {carried:.4g}, bend.damping " in str(worst)


def test_a_payload_is_found_from_a_log(arm):
    motion = sines([0.0, 0.0], [0.5, 0.3], [0.4, 1.1])
    run = log(HEAVY, {}, motion, [40.0, 15.0], [3.0, 1.0], joints=("lift", "bend"), duration=2.0)
    identified = smc.identify(arm, run, ["hand.payload"])
    off = abs(identified.values["hand.payload"] - 0.4)
    assert off < max(2.0 * identified.errors["hand.payload"], 1e-3)


def test_figures_tell_a_run_with_a_payload_from_one_without(arm):
    cases = {"empty": {}, "loaded": {"hand.payload": 0.4}, "heavy": {"mass": 1.2}}
    runs = [smc.Scenario(plant=arm, mismatch=mismatch, **RUN) for mismatch in cases.values()]
    empty, loaded, heavy = smc.run(runs)
    differences = [wording.differences(trace, [empty, loaded]) for trace in (empty, loaded)]
    assert differences == ["", "hand.payload = 0.4"]
    assert "hand.payload = 0.4" in wording.differences(loaded, [loaded, heavy])


COMPENSATED = """<mujoco model="rz"><compiler angle="radian"/><worldbody>
<body name="link" gravcomp="1"><joint name="j" axis="0 -1 0" damping="2" armature=".05"/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".03" mass="3" contype="0" conaffinity="0"/>
<body name="hand" pos=".4 0 0" gravcomp="1"><geom size=".03" mass=".5" contype="0"
conaffinity="0"/></body></body></worldbody><actuator><motor joint="j" ctrlrange="-60 60"/></actuator>
</mujoco>"""


@pytest.mark.parametrize(
    ("mismatch", "moment"),
    [
        ({}, 0.0),
        ({"hand.payload": 1.0}, 9.81 * 0.4),
        ({"mass": 1.3}, 0.3 * 9.81 * (3.0 * 0.2 + 0.5 * 0.4)),
        ({"grav": 1.2}, 0.2 * 9.81 * (3.0 * 0.2 + 0.5 * 0.4)),
        ({"hand.payload": 1.0, "mass": 0.9}, 9.81 * (0.4 - 0.1 * (3.0 * 0.2 + 0.5 * 0.4))),
    ],
)
def test_a_compensation_of_gravity_compensates_what_its_maker_knew(mismatch, moment):
    """MuJoCo compensates the true masses: an unknown load was carried for nothing."""
    plant = smc.plant_from(COMPENSATED, ["j"], name="rz")
    law = smc.law("pid", kp=200.0, kd=20.0, ki=0.0)
    start = {"duration": 3.0, "x0": 0.0, "control_period": 1e-3}
    trace = smc.run(smc.Scenario(plant=plant, law=law, mismatch=mismatch, **start))
    lean = trace.x[-1, 0]
    assert trace.u[-1, 0] == pytest.approx(moment * math.cos(lean), abs=1e-3)
    jump = smc.Jump(time=1e-3, factors=mismatch) if mismatch else None
    jumped = smc.run(smc.Scenario(plant=plant, law=law, jump=jump, **start))
    assert jumped.x[-1, 0] == pytest.approx(lean, abs=1e-6)


def test_a_law_that_knows_the_true_machine_knows_what_is_not_compensated():
    plant = smc.plant_from(COMPENSATED, ["j"], name="rz")
    law = smc.law("computed_torque", kp=100.0, kd=20.0)
    trace = smc.run(
        smc.Scenario(
            plant=plant, law=law, model="true", mismatch={"mass": 1.3}, x0=0.0, duration=1.0
        )
    )
    assert abs(trace.x[-1, 0]) < 1e-9
    assert trace.u[-1, 0] == pytest.approx(0.3 * 9.81 * (3.0 * 0.2 + 0.5 * 0.4))
