"""Friction acts on the joints that it is given to: the driven ones, those of a mapping, or all."""

import json
import math

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.common.files import to_json
from smc_mujoco.simulation import conditions, serialise

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


@EACH
@CARTS
def test_a_part_alone_is_on_the_driven_joint_and_by_name_on_any(part, plant, driven, free):
    alone, named, hinge, both, none = smc.run(
        [
            scenario(friction, plant, integrator="implicitfast", physics_step=2.5e-4)
            for friction in (part, {driven: part}, {free: part}, {"*": part}, None)
        ]
    )
    assert np.array_equal(alone.x, named.x)
    assert np.all(named.reaction[:, 1] == 0.0)
    assert np.all(hinge.reaction[:, 0] == 0.0)
    for one in (named, hinge, both):
        assert not np.array_equal(one.x, none.x)
    if not isinstance(part, smc.Viscous):  # which is no reaction, but the plant's damping
        assert both.reaction[1:].all(axis=1).any()


@pytest.mark.parametrize("friction", FORMS, ids=range(len(FORMS)))
def test_joints_survive_text_json_and_a_batch(friction):
    made = scenario(friction)
    data = json.loads(to_json(serialise.describe(made)))
    assert serialise.restore(data) == made
    worn = smc.condition("worn", friction=friction)
    assert "on=()" not in str(worn)
    again = conditions.parse(str(worn)).on(made.plant, 1.0)["friction"]
    assert scenario(again) == made
    batch = smc.run([scenario(other) for other in FORMS])[FORMS.index(friction)]
    assert np.array_equal(batch.x, smc.run(made).x)


@pytest.mark.parametrize(
    ("friction", "words"),
    [
        ({"wheel": smc.Coulomb(0.1)}, "unknown joint .* 'wheel': choose from hinge, slide"),
        (smc.Coulomb(0.1, on=("wheel",)), "unknown joint .* 'wheel'"),
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
    data = json.loads(to_json(serialise.describe(scenario({"*": LUGRE}))))
    for driven, joints in {False: ("slide", "hinge"), True: ()}.items():
        values = data["friction"][0]["values"]
        values.pop("on", None)
        values["driven"] = driven
        assert serialise.restore(data).friction[0].on == joints


@pytest.mark.parametrize("name", ["coulomb", "friction", "lugre"])
@pytest.mark.parametrize("plant", smc.plants())
def test_named_frictions_are_shares_of_the_bound_on_each_driven_joint(name, plant):
    machine = smc.plant(plant)
    if machine.pose:
        return
    made = smc.Scenario(plant=plant, law="none", **conditions.NAMED[name].on(machine, 1.0))
    largest = {}
    for part in made.friction:
        for joint in part.joint_names(machine):
            level = (
                part.static if name == "lugre" else part.level if hasattr(part, "level") else 0.0
            )
            largest[joint] = max(level, largest.get(joint, 0.0))
    assert list(largest.values()) == pytest.approx([bound / 60.0 for bound in made.limits])
    assert math.isclose(largest[next(iter(largest))], made.limits[0] / 60.0)
