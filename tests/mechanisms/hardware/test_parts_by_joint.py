"""Actuators and sensors by joint: on joints that do not touch, each moves as if all had its part."""

import json

import numpy as np
import pytest
from helpers.own_parts import worn

import smc_mujoco as smc
from smc_mujoco.common.files import to_json
from smc_mujoco.hardware import ElasticJoint, RateLimit, Stepper
from smc_mujoco.simulation import conditions, scenario_json

TWO = """<mujoco><compiler angle="radian"/><worldbody>
  <body><joint name="a" axis="0 1 0" damping=".1"/><geom size=".05" pos=".2 0 0" mass="1"/></body>
  <body pos="0 2 0"><joint name="b" axis="0 1 0" damping=".2"/>
    <geom size=".05" pos="0 0 .3" mass=".5"/></body></worldbody>
  <actuator><motor joint="a"/><motor joint="b"/></actuator></mujoco>"""
PLANT = smc.plant_from(TWO, channels=["a", "b"], name="two")


VOLTS = smc.DCMotor(command="voltage")
ACTUATORS = [
    (smc.Lag(0.01), (smc.Lag(0.02), RateLimit(50.0))),
    (VOLTS, smc.Lag(0.01)),
    (smc.DCMotor(gear=20.0), Stepper(torque=9.0)),
    ((smc.Lag(0.01), VOLTS), (smc.DCMotor(inductance=0.0, cogging=0.01), smc.Backlash(0.01))),
    (worn(), smc.DCMotor(command="voltage", gear=20.0, inductance=0.0, ripple=0.1)),
    (worn(zone=0.3), None),
    (ElasticJoint(90.0, 0.1, 0.02), (smc.Lag(0.01), ElasticJoint(50.0))),
]
FINE = smc.Encoder(4096)
SENSORS = [
    (FINE, None),
    (FINE, smc.Encoder(100, bias=0.1, dropout=0.3)),
    (smc.Encoder(500, delay=0.003), smc.Encoder(300, period=0.005, dropout=0.2)),
    (None, smc.Encoder(500, skew=0.002)),
]
EACH = [("actuator", pair) for pair in ACTUATORS] + [("sensor", pair) for pair in SENSORS]


def scenario(**fields):
    common = {
        "law": smc.law("pid"),
        "duration": 0.2,
        "integrator": "implicitfast",
        "physics_step": 1.25e-4,
    }
    common |= {"x0": (0.4, -0.3), "noise": smc.Noise(1e-3, 1e-2), "seed": 3}
    return smc.Scenario(plant=PLANT, velocity="filtered_difference", **common | fields)


@pytest.mark.quick
@pytest.mark.parametrize("model", ["none", "nominal"])
@pytest.mark.parametrize(("field", "pair"), EACH, ids=str)
def test_a_joint_with_its_own_part_moves_as_if_all_joints_had_it(field, pair, model):
    law = smc.law("observer_free", lam=6.0, k1=3.0)
    scenarios = []
    by_joint = {joint: part for joint, part in zip("ab", pair, strict=True) if part is not None}
    for parts in (by_joint, *pair):
        scenarios.append(scenario(model=model, law=law, **{field: parts}))
    on_both, first, second = smc.run(scenarios)
    assert on_both.failure is None
    for i, alone in enumerate((first, second)):
        for name in ("x", "v", "u", "s", "applied", "force", "reaction"):
            ours, theirs = (getattr(trace, name)[:, i] for trace in (on_both, alone))
            np.testing.assert_allclose(ours, theirs, rtol=1e-8, atol=1e-8, err_msg=name)
        assert on_both.scenario.limits[i] == alone.scenario.limits[i]
        assert on_both.scenario.efforts[i] == alone.scenario.efforts[i]
    assert not np.array_equal(first.x[:, 1], second.x[:, 1])


@pytest.mark.parametrize(("field", "pair"), EACH, ids=str)
def test_they_survive_text_json_and_the_order_of_a_mapping(field, pair):
    by_joint = {joint: part for joint, part in zip("ab", pair, strict=True) if part is not None}
    with_parts = scenario(**{field: by_joint})
    assert (
        scenario_json.restore(json.loads(to_json(scenario_json.describe(with_parts)))) == with_parts
    )
    assert scenario(**{field: dict(reversed(by_joint.items()))}) == with_parts
    text = str(smc.condition("own", **{field: by_joint}))
    assert scenario(**conditions.parse(text).on(PLANT, 1.0)) == with_parts
    part = next(iter(by_joint.values()))
    everywhere, plain = (scenario(**{field: parts}) for parts in ({"*": part}, part))
    assert everywhere == plain
    assert "on=" not in str(smc.condition("own", **{field: part}))


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"actuator": {"c": smc.Lag(0.1)}}, "joint of two in actuator 'c': choose from a, b"),
        ({"sensor": {"c": FINE}}, "joint of two in sensor 'c': choose from a, b"),
        ({"sensor": {"a": smc.Lag(0.1)}}, "sensor is Lag"),
        ({"actuator": {"a": FINE}}, "actuator is Encoder"),
        ({"sensor": (FINE, {"b": FINE})}, "two parts on joint 'b': give one"),
        ({"actuator": (smc.DCMotor(), {"b": smc.Lag(0.1)})}, "give one drive"),
        ({"actuator": {"b": (smc.Lag(0.1), Stepper())}}, "Stepper is behind Lag"),
        (
            {"actuator": {"b": (smc.Backlash(0.1), smc.Backlash(0.2))}},
            "one rotor beside it: give one",
        ),
        (
            {"actuator": {"b": (smc.Backlash(0.1), ElasticJoint(1e3))}},
            "Backlash and ElasticJoint",
        ),
        ({"actuator": {"b": worn(zone=(0.1, 0.2))}}, "acts on 1 joint of two: give one number"),
    ],
)
def test_what_a_joint_cannot_have_is_refused(fields, words):
    with pytest.raises(smc.ScenarioError, match=words):
        scenario(**fields)


def test_a_joint_that_nothing_drives_takes_a_sensor_and_no_motor():
    common = {"plant": "cart_pole", "law": "hierarchical", "duration": 0.5}
    coarse, none = smc.run(
        [smc.Scenario(sensor=part, **common) for part in ({"hinge": smc.Encoder(50)}, None)]
    )
    assert not np.array_equal(coarse.u, none.u)
    with pytest.raises(smc.ScenarioError, match="'hinge': choose from slide"):
        smc.Scenario(actuator={"hinge": smc.Lag(0.1)}, **common)


def test_a_model_by_volts_cancels_what_each_motor_takes():
    """Coupled joints: the model of each channel reads the force of the other, not its volts."""
    ideal, driven = smc.run(
        [
            smc.Scenario(
                plant="double_pendulum",
                law="computed_torque",
                model="nominal",
                actuator=parts,
                duration=1.0,
                u_max=np.inf,
            )
            for parts in (
                None,
                {
                    joint: smc.DCMotor(
                        command="voltage",
                        gear=gear,
                        inductance=0.0,
                        rotor_inertia=0.0,
                        voltage=np.inf,
                        current=np.inf,
                    )
                    for joint, gear in (("shoulder", 2.0), ("elbow", 0.5))
                },
            )
        ]
    )
    assert np.abs(driven.x - ideal.x).max() < 1e-3 * np.abs(ideal.x).max()
    assert driven.scenario.efforts == ("V", "V")
