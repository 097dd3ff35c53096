"""The condition `contact` reaches its stops whatever u does, on machines of any size."""

import dataclasses
import math

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.step_halving import doubled
from smc_mujoco.control.component import by_channel
from smc_mujoco.mechanisms.custom.scales import at_goal
from smc_mujoco.mechanisms.layout import channel_names
from smc_mujoco.simulation import conditions
from smc_mujoco.simulation.grid import case

MACHINE = """<mujoco model="{name}"><compiler angle="radian"/><worldbody><body pos="0 0 1">
<joint name="j" type="{kind}" axis="0 {axis}" {joint}/><geom type="capsule" fromto="0 0 0 {tip}"
size="{size}" mass="{mass}"/>{more}</body></worldbody><actuator><motor joint="j"
ctrlrange="-{bound} {bound}"/>{motors}</actuator></mujoco>"""
LINK = """<body pos=".3 0 0"><joint name="k" axis="0 1 0" damping=".1"/><geom type="capsule"
fromto="0 0 0 .3 0 0" size=".02" mass=".6"/></body>"""
ARM = {"kind": "hinge", "axis": "1 0", "tip": ".3 0 0", "size": 0.02, "mass": 0.5, "joint": ""}
ARM |= {"bound": 20, "more": "", "motors": ""}
K = '<motor joint="k" ctrlrange="-9 9"/>'
LIFTED = {"axis": "-1 0"}  # gravity pulls from the stop to the start
BUILT = {
    "calf": ({"joint": 'range="-1 1" damping=".1"', "tip": "0 0 -.4", "bound": 10}, ["j"], None),
    "locked": ({"more": LINK, "motors": K}, ["k"], "locked"),
    "slide": ({"kind": "slide", "joint": 'range="0 .04"', "mass": 0.1, "bound": 5}, ["j"], None),
    "wheel": ({"joint": 'armature="1e-5"', "tip": "0 .01 0", "size": 1e-3, "mass": 1e-4}
              | {"bound": 0.05}, ["j"], None),
    # what holds each back besides u: a spring, the load and damping that are large beside the bound
    "stiff": ({"joint": 'stiffness="120" damping="1"', "bound": 2} | LIFTED, ["j"], None),
    "loaded": ({"bound": 0.8} | LIFTED, ["j"], None),
    "viscous": ({"joint": 'damping="1.5"', "bound": 0.8} | LIFTED, ["j"], None),
    "at its end": ({"joint": 'range="0 2"'}, ["j"], None),
}  # fmt: skip
TIME = 1.5  # s, of the blow


@smc.law_function(gains={"kp": 1.0, "kd": 1.0, "load": 0.0, "bound": 1.0, "way": 1.0, "at": 1.0})
def resists(y, gains, memory):
    """Holds the goal by a PD, and from the blow on pushes back with all it has."""
    if y.t < gains.at:
        return gains.load - gains.kp * y.e - gains.kd * y.de, y.e
    return -gains.way * gains.bound, y.e


def machine(name):
    if name not in BUILT:
        return smc.plant(name)
    parts, joints, what_others_do = BUILT[name]
    return smc.plant_from(MACHINE.format(name="m", **ARM | parts), joints, others=what_others_do)


@pytest.mark.parametrize("name", [*BUILT, "duffing", "double_pendulum", "inverted_pendulum"])
def test_a_blow_reaches_the_stops_whatever_u_does(name):
    plant = machine(name)
    fields = conditions.find_condition("contact").on(plant, 2.0 * TIME)
    blow = fields["disturbance"]
    moments = at_goal(plant)
    limits = smc.Scenario(plant=plant, law=smc.law("none")).limits
    laws = []
    for bound, dof, load in zip(limits, moments.dofs, moments.load, strict=True):
        kp = bound / 0.3
        kd = 2.0 * math.sqrt(kp * moments.M[dof, dof])
        way = math.copysign(1.0, blow.impulse)
        laws.append(resists(kp=kp, kd=kd, load=load, bound=bound, way=way, at=TIME))
    hit = conditions.condition("hit", **fields)
    runs = [case(plant, by_channel(laws), hit, TIME + 0.5, seed=seed) for seed in range(2)]
    (stopped,) = fields["contact"].limits.items()
    joint = channel_names(plant).index(stopped[0])
    for trace in smc.run(runs):
        assert trace.failure is None
        beyond = np.clip(trace.x[:, joint], *stopped[1]) != trace.x[:, joint]
        assert not beyond[trace.t < TIME].any()
        # a fast joint comes and leaves within a control period
        assert beyond[trace.t >= TIME].any() or not trace.unmet


SLOW = """<mujoco><compiler angle="radian"/><worldbody><body pos="0 0 2">
<joint name="j" axis="0 1 0" damping="{}" armature="2"/><geom type="capsule" size=".04" mass="12"
fromto="0 0 0 0 0 -.8" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor joint="j" ctrlrange="-330 330"/></actuator></mujoco>"""


@pytest.mark.quick
@pytest.mark.filterwarnings("ignore:.*default gains")
@pytest.mark.parametrize(("law", "damping"), [("pid", 150.0), ("pid", 300.0), ("adrc", 500.0)])
def test_a_blow_that_comes_before_the_law_has_arrived_meets_the_stop(law, damping):
    """It was sized at the goal, and a joint with a damping of 200 was 0.2 rad from there. A blow of
    a third is said to meet nothing."""
    plant = smc.plant_from(SLOW.format(damping), ["j"])
    (scenario,) = smc.grid(plant, smc.law(law), "contact", duration=2.0)
    (blow,) = scenario.disturbance
    weak = dataclasses.replace(blow, impulse=blow.impulse / 3.0)
    short = dataclasses.replace(scenario, disturbance=weak)
    trace = smc.run(scenario)
    with pytest.warns(smc.errors.ScenarioWarning, match="meets nothing"):
        missed = smc.run(short)
    low, high = scenario.contact[0].limits["j"]
    assert np.any((trace.x < low) | (trace.x > high))
    assert not trace.unmet
    assert "meets nothing: joint 'j'" in missed.unmet


FINGER = """<mujoco><compiler angle="radian"/><worldbody><body><joint name="j" axis="0 1 0"
damping="1e-5" armature="1e-6"/><geom type="capsule" fromto="0 0 0 0 0 -.05" size=".0025"
mass=".006" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor joint="j" ctrlrange="-.02 .02"/></actuator></mujoco>"""


@pytest.mark.filterwarnings("ignore:.*default gains")
def test_a_light_joint_is_stopped_within_a_tenth_of_its_way():
    """A finger went through a stop 0.1 rad from its goal by up to 0.14 rad, later by 0.011."""
    plant = smc.plant_from(FINGER, ["j"])
    for law in ("pid", "adrc"):
        (scenario,) = smc.grid(plant, smc.law(law), "contact", duration=2.0)
        trace = smc.run(scenario)
        low, high = scenario.contact[0].limits["j"]
        near = min(-low, high)
        into = max((trace.x - high).max(), (low - trace.x).max())
        assert into < 0.1 * near
        assert not trace.unmet  # though no sample lies beyond: it leaves within a control period
        assert scenario.resolved.physics_step <= 0.25 * scenario.contact[0].depth
        assert doubled(scenario).resolved.physics_step == 2.0 * scenario.resolved.physics_step
        assert trace.failure is None
