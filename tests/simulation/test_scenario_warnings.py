"""Scenarios that can be run, and are hardly what their author means, say so; those of the study do
not.
"""

import dataclasses
import math
import re
import warnings

import pytest

import smc_mujoco as smc
from smc_mujoco.simulation import gaber_study, scenario_json
from smc_mujoco.simulation.conditions import find_condition

pytestmark = pytest.mark.quick

PENDULUM = smc.Scenario(plant="inverted_pendulum", law="none", duration=0.01)
DEGREES = [
    {"x0": 30.0},
    {"x0": -10.0},
    {"reference": smc.Constant(30.0)},
    {"reference": smc.Sine(amplitude=-90.0, omega=1.0)},
    {"reference": smc.Step(720.0)},
]


# fields of a number, and the ends of the numbers that are taken for another unit, with the end or
# not
SUSPICIOUS = [
    (lambda x: {"x0": x}, (3.0 * math.pi, False), (720.0, True)),
    (lambda x: {"reference": smc.Sine(-x, 1.0)}, (3.0 * math.pi, False), (720.0, True)),
]


def test_what_is_taken_for_another_unit_ends_where_it_should():
    plain = smc.Scenario(plant="inverted_pendulum", law="none", duration=6.0)

    def warned(fields):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            dataclasses.replace(plain, **fields)
        return len(caught)

    for fields, (low, with_low), (high, with_high) in SUSPICIOUS:
        assert warned(fields(low)) == with_low
        assert warned(fields(0.999 * low)) == 0
        assert warned(fields(high)) == with_high
        assert warned(fields(1.001 * high)) == 0


def test_angles_of_several_turns_may_be_degrees():
    for fields in DEGREES:
        with pytest.warns(
            smc.errors.ScenarioWarning,
            match=r"rad, \d+\.\d turns: if it is \S+ degrees, give -?\d",
        ) as caught:
            smc.Scenario(
                plant="inverted_pendulum",
                law="none",
                duration=0.01,
                **fields,
            )
        assert [warning.filename for warning in caught] == [__file__]


@pytest.mark.parametrize(
    ("fields", "cure"),
    [
        ({"input_delay": 1.0}, "1 ms, give 0.001"),
        ({"input_delay": 5.0}, "5 ms, give 0.005"),
        ({"control_period": 2.0}, "2 ms, give 0.002"),
        ({"mismatch": {"mass": 30.0}}, "30 % more, give 1.3"),
        ({"mismatch": {"l": 15.0}}, "15 % more, give 1.15"),
    ],
)
def test_a_number_that_may_be_in_ms_or_percent_is_questioned(fields, cure):
    plain = smc.Scenario(plant="inverted_pendulum", law="none", duration=6.0)
    with pytest.warns(smc.errors.ScenarioWarning, match=f": if it is {cure}$"):
        dataclasses.replace(plain, **fields)


def test_long_delays_and_large_factors_that_may_be_meant_are_not_questioned():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for fields in ({"input_delay": 0.99}, {"mismatch": {"mass": 14.9}}):
            smc.Scenario(plant="inverted_pendulum", law="none", **fields)
        smc.Scenario(plant="panda", law="none", mismatch={"payload": 20.0})


def test_turns_ramps_places_and_what_is_no_angle_are_no_degrees():
    for fields in (
        {"x0": 1.5 * math.tau},
        {"x0": 1e3},
        {"reference": smc.signals.Ramp(100.0)},
    ):
        dataclasses.replace(PENDULUM, **fields)
    smc.Scenario(plant="duffing", law="none", x0=9.0)
    smc.Scenario(
        plant="cart_pole",
        law="none",
        x0=(30.0, 0.1),
        reference=smc.Constant(30.0),
    )
    with pytest.warns(smc.errors.ScenarioWarning, match="x0 is 30 rad"):
        smc.Scenario(plant="cart_pole", law="none", x0=(0.0, 30.0))


def test_a_motor_too_weak_for_gravity_at_the_start_says_so():
    """m g l sin 0.5 = 1.176 N m; gear 1 gives 30 A times 0.0302 N m/A, 1 V at gear 12.25 gives
    0.3699/0.299 N m.
    """
    words = (
        "DCMotor gives at most 0.906 N m at rest, and channel 0 of inverted_pendulum needs 1.18 to "
        "hold its start"
    )
    with pytest.warns(smc.errors.ScenarioWarning, match=words):
        dataclasses.replace(PENDULUM, actuator=smc.DCMotor(gear=1.0))
    for fields in (
        {"actuator": smc.DCMotor()},
        {"actuator": smc.DCMotor(voltage=1.0)},
        {"actuator": smc.DCMotor(gear=1.0), "x0": 0.3},
        {"actuator": smc.DCMotor(gear=1.0), "u_max": 1.1},  # no motor could: it is to swing
    ):
        dataclasses.replace(PENDULUM, **fields)
    with pytest.warns(
        smc.errors.ScenarioWarning, match=r"0.378 N at rest, and channel 0 of duffing needs 1.88"
    ):
        smc.Scenario(plant="duffing", law="none", actuator=smc.DCMotor(resistance=23.5))


def test_a_run_that_has_been_is_read_without_a_warning():
    with pytest.warns(smc.errors.ScenarioWarning):
        scenario = dataclasses.replace(PENDULUM, x0=30.0, actuator=smc.DCMotor(gear=1.0))
    assert scenario_json.restore(scenario_json.describe(scenario)) == scenario


def test_the_study_warns_of_nothing():
    """pytest makes errors of warnings; scenes are read by their own tests."""
    for plant in smc.plants():
        for condition in gaber_study.CONDITIONS:
            try:
                fields = find_condition(condition).on(smc.plant(plant), 5.0)
                smc.Scenario(
                    plant=plant,
                    law="none",
                    duration=5.0,
                    **{"x0": None} | fields,
                )
            except smc.ScenarioError:  # it is not for this plant
                continue


@pytest.mark.parametrize("plant", ["inverted_pendulum", "duffing", "double_pendulum"])
@pytest.mark.parametrize("damping", [None, 5.0])
@pytest.mark.parametrize("stiffness", [1e4, 1e5, 1e6])
def test_bristles_too_stiff_for_the_step_are_told_and_those_of_the_step_told_are_not(
    plant, damping, stiffness
):
    """With 1e5 a loop rested at a tenth of where the friction holds it, in silence."""
    fields = {"plant": plant, "law": "none", "control_period": 1e-3}
    fields["friction"] = smc.hardware.LuGre(0.3, 0.3, 0.1, stiffness, damping)
    inertia = smc.plant(plant).load().dof_M0.min()
    resolved = damping or 0.2 * math.sqrt(stiffness * inertia)
    if stiffness * 2.5e-4 < 0.3 * resolved:
        smc.Scenario(**fields)
        return
    with pytest.warns(smc.errors.ScenarioWarning, match="LuGre.*physics_step") as caught:
        smc.Scenario(**fields)
    (step,) = map(float, re.findall(r"physics_step of ([0-9.e-]+) or", str(caught[0].message)))
    smc.Scenario(**fields, physics_step=1e-3 / math.ceil(1e-3 / step))


def test_a_law_that_cannot_see_the_pole_is_named_when_it_runs():
    fields = {"plant": "cart_pole", "duration": 0.01}
    with pytest.warns(
        smc.errors.ScenarioWarning, match=r"pid of cart_pole cannot see .* reads y\.q"
    ):
        smc.run(smc.Scenario(law="pid", **fields))
    smc.run([smc.Scenario(law=law, **fields) for law in ("hierarchical", "none")])


def duffing(**fields) -> smc.Scenario:
    return smc.Scenario(plant="duffing", law="none", **fields)


@pytest.mark.parametrize(
    ("make", "cure"),
    [
        (lambda: duffing(x0=30.0), "give 0.03"),
        (lambda: duffing(friction=smc.Coulomb(100.0), u_max=6.0), "give less friction"),
        (lambda: smc.starts(spread=20.0), "give 0.2"),
    ],
)
def test_a_size_that_no_machine_has_is_told(make, cure):
    with pytest.warns(smc.errors.ScenarioWarning, match=cure):
        make()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        duffing(x0=9.0, friction=smc.Coulomb(5.0), u_max=6.0)
        smc.starts(spread=2.0)
