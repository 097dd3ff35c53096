"""Friction acts on the joints that it is given to: the driven ones, those of a mapping, or all."""

import dataclasses
import json
import math

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.common.files import shipped, to_json
from smc_mujoco.simulation import conditions, scenario_json

LUGRE = smc.hardware.LuGre(0.05, 0.1, 0.05)
SIGMOID = smc.hardware.Sigmoid(0.1, 9.0)
PARTS = [smc.Coulomb(0.1), smc.Viscous(0.3), LUGRE, SIGMOID]
EACH = pytest.mark.parametrize("part", PARTS, ids=lambda part: type(part).__name__)
CARTS = pytest.mark.parametrize(
    ("plant", "driven", "free"),
    [
        ("cart_pole", "slide", "hinge"),
        ("overhead_crane", "slide", "hinge"),
        ("furuta", "arm", "hinge"),
    ],
)
FORMS = [
    {"slide": smc.Coulomb(0.1)},
    {"hinge": (smc.Coulomb(1e-3), smc.Viscous(1e-4))},
    {"*": LUGRE},
    (smc.Coulomb(0.1), {"hinge": smc.Coulomb(1e-3)}),
    {"slide": SIGMOID, "hinge": smc.hardware.Sigmoid(1e-3, 9.0)},
]


def scenario(friction, plant="cart_pole", **fields):
    return smc.Scenario(
        plant=plant, law="none", friction=friction, **{"duration": 0.3, "v0": 0.5} | fields
    )


@pytest.mark.quick
@EACH
@CARTS
def test_a_part_alone_is_on_the_driven_joint_and_by_name_on_any(part, plant, driven, free):
    alone, named, hinge, on_both, none = smc.run(
        [
            scenario(
                friction,
                plant,
                integrator="implicitfast",
                physics_step=2.5e-4,
            )
            for friction in (part, {driven: part}, {free: part}, {"*": part}, None)
        ]
    )
    assert np.array_equal(alone.x, named.x)
    assert np.all(named.reaction[:, 1] == 0.0)
    assert np.all(hinge.reaction[:, 0] == 0.0)
    for trace in (named, hinge, on_both):
        assert not np.array_equal(trace.x, none.x)
    if not isinstance(part, smc.Viscous):  # which is no reaction, but the plant's damping
        assert on_both.reaction[1:].all(axis=1).any()


@pytest.mark.parametrize("friction", FORMS, ids=range(len(FORMS)))
def test_joints_survive_text_json_and_a_batch(friction):
    rubbing = scenario(friction)
    data = json.loads(to_json(scenario_json.describe(rubbing)))
    assert scenario_json.restore(data) == rubbing
    worn = smc.condition("worn", friction=friction)
    assert "on=()" not in str(worn)
    again = conditions.parse(str(worn)).on(rubbing.plant, 1.0)["friction"]
    assert scenario(again) == rubbing
    batch = smc.run([scenario(form) for form in FORMS])[FORMS.index(friction)]
    assert np.array_equal(batch.x, smc.run(rubbing).x)


def test_one_joint_may_be_given_by_its_name_alone():
    """Its letters were taken for names of joints."""
    assert smc.Coulomb(0.1, on="slide") == smc.Coulomb(0.1, on=("slide",))


@pytest.mark.parametrize(
    ("friction", "words"),
    [
        ({"wheel": smc.Coulomb(0.1)}, "unknown joint .* 'wheel': choose from hinge, slide"),
        (smc.Coulomb(0.1, on=("wheel",)), "unknown joint .* 'wheel'"),
        ([{"slide": smc.Coulomb(0.1)}, smc.Coulomb(0.1, on=["slide"])], "on the same joint"),
        ({"slide": 0.1}, "friction is 0.1: give"),
        ({"*": LUGRE, "hinge": SIGMOID}, "LuGre and Sigmoid on the same joint"),
        ({"slide": (smc.Coulomb(0.1), smc.Coulomb(0.2))}, "Coulomb and Coulomb on the same joint"),
        ({"*": smc.hardware.Sigmoid((0.1, 0.2, 0.3), 9.0)}, "one number, or 2"),
    ],
)
def test_what_no_joint_can_have_is_refused(friction, words):
    with pytest.raises(smc.ScenarioError, match=words):
        scenario(friction)


def test_records_of_older_versions_keep_their_friction_on_every_joint():
    data = json.loads(to_json(scenario_json.describe(scenario({"*": LUGRE}))))
    for driven, joints in {False: ("slide", "hinge"), True: ()}.items():
        values = data["friction"][0]["values"]
        values.pop("on", None)
        values["driven"] = driven
        assert scenario_json.restore(data).friction[0].on == joints


@pytest.mark.parametrize("name", ["coulomb", "friction", "lugre"])
@pytest.mark.parametrize("plant", smc.plants())
def test_named_frictions_are_shares_of_the_bound_on_each_driven_joint(name, plant):
    machine = smc.plant(plant)
    if machine.pose:
        return
    rubbing = smc.Scenario(plant=plant, law="none", **conditions.NAMED[name].on(machine, 1.0))
    largest = {}
    for part in rubbing.friction:
        for joint in part.joint_names(machine):
            level = (
                part.static if name == "lugre" else part.level if hasattr(part, "level") else 0.0
            )
            largest[joint] = max(level, largest.get(joint, 0.0))
    assert list(largest.values()) == pytest.approx([bound / 60.0 for bound in rubbing.limits])
    assert math.isclose(largest[next(iter(largest))], rubbing.limits[0] / 60.0)


PARTNER = smc.Channel(partner="hinge", partner_x0=0.3)
CART = """<mujoco><compiler angle="radian"/>
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody><body><joint name="slide" type="slide" axis="1 0 0" frictionloss="%s"/>
    <geom type="box" size=".1 .05 .05" mass="1"/>
    <body><joint name="hinge" axis="0 1 0" frictionloss="%s"/>
      <inertial pos="0 0 .5" mass=".1" diaginertia=".00833333 .00833333 1e-6"/>
      <geom type="capsule" fromto="0 0 0 0 0 1" size=".01" mass="0"/></body></body></worldbody>
  <actuator><motor joint="slide" ctrlrange="-6 6" ctrllimited="true"/></actuator></mujoco>"""


@pytest.mark.parametrize(("joint", "level"), [("slide", 0.1), ("slide", 0.5), ("hinge", 1e-3)])
def test_a_joints_friction_is_the_frictionloss_of_that_joint_in_a_file(joint, level):
    levels = {"slide": 0.0, "hinge": 0.0, joint: level}
    text = CART % (levels["slide"], levels["hinge"])
    file = smc.plant_from(text, channels={"slide": PARTNER}, name="cart")
    law = {"law": "hierarchical", "duration": 6.0}
    own, ours = smc.run(
        [
            smc.Scenario(plant=file, **law),
            smc.Scenario(plant="cart_pole", friction={joint: smc.Coulomb(level)}, **law),
        ]
    )
    assert np.abs(own.x - ours.x).max() < 0.01 * np.abs(ours.x).max()


@pytest.mark.parametrize("part", [smc.Coulomb(0.02), LUGRE], ids=["Coulomb", "LuGre"])
def test_a_joint_of_a_file_that_is_no_channel_has_friction_by_name(part):
    """A pole that nobody measures stands, and one on a rail that rubs falls."""
    alone = smc.plant_from(
        CART % (0.0, 0.0),
        channels=["slide"],
        name="cart",
        others="file",
    )
    runs = {}
    for joint in ("slide", "hinge", "*"):
        rubbing = smc.Scenario(
            plant=alone, law="none", friction={joint: part}, v0=0.1, duration=1.0, u_max=6.0
        )
        runs[joint] = smc.run(rubbing)
        assert rubbing.friction[0].on == (("slide", "hinge") if joint == "*" else (joint,))
    assert not np.array_equal(runs["slide"].x, runs["*"].x)
    assert np.all(runs["hinge"].reaction == 0.0)  # of the cart
    with pytest.raises(smc.ScenarioError, match="unknown joint of Sigmoid"):
        smc.Scenario(
            plant=alone,
            law="none",
            friction={"hinge": SIGMOID},
            u_max=6.0,
        )


@pytest.mark.parametrize("name", ["coulomb", "friction", "lugre", "dc_motor"])
@pytest.mark.parametrize("bounds", [(0.03, 0.03), (120.0, 0.9)])
def test_named_parts_of_an_own_machine_are_shares_of_its_own_bounds(name, bounds):
    lift, turn = bounds
    text = ARM % (lift, lift, turn, turn)
    machine = smc.plant_from(text, channels=["lift", "turn"], name="arm")
    rubbing = smc.Scenario(plant=machine, law="none", **conditions.NAMED[name].on(machine, 1.0))
    for joint, bound in zip(("lift", "turn"), bounds, strict=True):
        parts = rubbing.friction + rubbing.actuator
        here = [part for part in parts if joint in part.joint_names(machine)]
        field = {"lugre": "static", "dc_motor": "stall"}.get(name, "level")
        share = {"dc_motor": 1.84975}.get(name, 1.0 / 60.0)
        assert getattr(here[0], field) == pytest.approx(share * bound)
        assert len(here) == (2 if name == "friction" else 1)


@pytest.mark.parametrize("name", ["coulomb", "friction", "lugre"])
@pytest.mark.parametrize("size", [1.0, 1e6])
def test_an_own_joint_of_any_size_comes_to_rest_where_a_named_friction_stops_it(name, size):
    inertia, bound = 2e-5 * size, 0.005 * size
    text = f"""<mujoco><worldbody><body><joint name="j"/><inertial pos="0 0 0" mass="1"
      diaginertia="{inertia} {inertia} {inertia}"/></body></worldbody><actuator>
      <motor joint="j" ctrlrange="-{bound} {bound}"/></actuator></mujoco>"""
    plant = smc.plant_from(text, channels=["j"], name="finger")
    parts = conditions.NAMED[name].on(plant, 1.0)
    trace = smc.run(smc.Scenario(plant=plant, law="none", v0=1.0, duration=1.0, **parts))
    v = np.linspace(0.0, 1.0, 10001)
    shares = {"coulomb": 1.0, "friction": 1.0 + 0.5 * v, "lugre": 0.5 + 0.5 * np.exp(-400.0 * v**2)}
    way = np.trapezoid(inertia * v / (bound / 60.0 * shares[name]), v)
    np.testing.assert_allclose(trace.x[-1], way, rtol=0.02)


ARM = """<mujoco><compiler angle="radian"/><worldbody><body>
  <joint name="lift" type="slide" axis="0 0 1"/><geom size=".05" mass="1"/>
  <body pos=".2 0 0"><joint name="turn" axis="0 0 1"/><geom size=".05" pos=".1 0 0" mass=".3"/>
  </body></body></worldbody><actuator>
  <motor joint="lift" ctrlrange="-%g %g" ctrllimited="true"/>
  <motor joint="turn" ctrlrange="-%g %g" ctrllimited="true"/></actuator></mujoco>"""


@smc.law_function(joint=True, plants=("a free body",))
def hovering(y, gains, memory):
    u = np.zeros(6)
    u[2] = 0.35
    u[4] = 1e-4 * math.sin(5.0 * y.t)
    return u, np.zeros(6)


def test_a_joint_that_a_free_body_carries_rubs_by_name():
    text = (shipped("models").parent / "examples" / "quadrotor.xml").read_text(encoding="utf-8")
    swing = """<body pos="0 0 -.01"><joint name="swing" axis="0 1 0" frictionloss="%g"/>
      <inertial pos=".02 0 -.02" mass=".003" diaginertia="1e-7 1e-7 1e-7"/></body></body>"""
    runs = []
    for in_file, part in ((0.0, None), (0.0, smc.Coulomb(2e-4)), (2e-4, None)):
        carrier = text.replace("</body>", swing % in_file, 1)
        plant = smc.plant_from(carrier, channels=["body"], name="carrier")
        fields = {"friction": {"swing": part} if part else None, "duration": 0.5}
        runs.append(smc.run(smc.Scenario(plant=plant, law=hovering(), **fields)))
    free, named, of_file = (trace.x for trace in runs)
    assert np.abs(named - of_file).max() < 1e-3 * np.abs(named - free).max()
    with pytest.raises(
        smc.ScenarioError, match="takes no friction except on a joint that you name"
    ):
        dataclasses.replace(runs[0].scenario, friction=smc.Coulomb(1e-4))
