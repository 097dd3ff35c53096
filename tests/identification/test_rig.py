"""A rig makes scenarios of its quantities, and takes a run of its own as a record."""

import pytest
from helpers.machines import AXIS, PENDULUM

import smc_mujoco as smc


@pytest.mark.quick
def test_a_pendulum_has_the_inertia_and_the_moment_of_its_rig():
    m, l = (PENDULUM.scenario("none").plant.parameters[name] for name in ("m", "l"))
    inertias = PENDULUM.quantities["inertia"].value, PENDULUM.quantities["mass_moment"].value
    assert (m * l * l, m * l) == pytest.approx(inertias)


def test_a_changed_quantity_is_of_the_changed_machine_alone():
    lighter = AXIS.with_values({"mass": 80.0})
    assert lighter.scenario().plant.parameters["M"] == 80.0
    assert lighter.quantities["mass"].source == "given"
    assert AXIS.scenario().plant.parameters["M"] == AXIS.values["mass"]


def test_a_trace_is_a_record_too():
    run = smc.run(AXIS.scenario(duration=0.3, reference=smc.Sine(0.05, 8.0), x0=0.0))
    fit = AXIS.fit(run)
    assert min(fit.values()) > 99.0
    assert fit.keys() == {"x", "u"}
    assert AXIS.with_values({"mass": 80.0}).fit(run)["u"] < 95.0
    with pytest.raises(
        smc.ScenarioError,
        match="is one of servo_axis and the plant of lifted_pendulum is inverted_pendulum",
    ):
        PENDULUM.fit(run)


def test_columns_have_the_units_of_the_machine():
    assert AXIS.units == {"x": "m", "u": "V"}
    assert PENDULUM.units == {"position": "rad", "torque": "N m"}


def test_what_cannot_be_repeated_is_refused_by_name():
    run = smc.run(AXIS.scenario(duration=0.1, x0=0.0))
    record = {"t": run.t, "u": run.u[:, 0]}
    with pytest.raises(smc.ScenarioError, match="the record of axis has no column x"):
        AXIS.fit(record)
