"""Controls: u = 0 must reach no target, and a law that is told everything must reach all."""

import dataclasses

import controls
import numpy as np
import pytest
from helpers import reference

import smc_mujoco as smc
from smc_mujoco.control.law import law_function


@law_function(requires_model=True)
def reported(y, gains, memory):
    """Log f, and the command of one newton."""
    return 1.0, y.f


@pytest.mark.quick
@pytest.mark.parametrize(
    ("fields", "force"),
    [
        ({"disturbance": smc.Constant(0.3)}, lambda trace: 0.3),
        (
            {"disturbance": smc.Sine(amplitude=0.2, omega=5.0)},
            lambda trace: 0.2 * np.sin(5.0 * trace.t[1:]),
        ),
        ({"friction": smc.Coulomb(0.1)}, lambda trace: -0.1 * np.sign(trace.v[1:, 0])),
    ],
)
def test_the_true_model_has_true_parameters_and_the_other_forces(fields, force):
    """The force is that of the last instant before the sample, and friction's mean over the period
    before it.
    """
    plant = smc.plant("duffing")
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law=reported(),
            model="true",
            mismatch={"mass": 1.4},
            duration=0.3,
            v0=0.5,
            **fields,
        )
    )
    p = plant.values({})
    x = trace.x[1:, 0]
    v = trace.v[1:, 0]
    f = (-p.delta * v - p.alpha * x - p.beta * x**3 + force(trace)) / (1.4 * p.M)
    np.testing.assert_allclose(trace.s[1:, 0], f, rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    "name", ["inverted_pendulum_network/friction@1", "duffing/process_noise@1", "duffing/missed@1"]
)
def test_the_compiled_oracle_is_the_one_of_the_reference_loop(name):
    (scenario,) = controls.scenarios(smc.problem(name), controls.oracle(), [1])
    short = dataclasses.replace(scenario, duration=0.2)
    compiled = smc.run(short)
    plain = reference.run(short)
    np.testing.assert_allclose(compiled.u, plain.u, rtol=0, atol=1e-9)


def test_no_law_of_an_entry_is_told_anything():
    (scenario,) = smc.problem("duffing/noise@1").scenarios(reported(), [0])
    assert scenario.model is None
    assert scenario.noise.position == 0.01


@pytest.mark.parametrize(
    ("name", "reported"),
    [
        ("geometric", False),
        ("oracle", True),
    ],
)
def test_the_oracle_of_flight_alone_knows_a_payload(name, reported):
    problem = smc.problem("quadrotor/payload@2")
    law = controls.oracle_of("quadrotor", 8.0, 1.5) if name == "oracle" else smc.law(name)
    (scenario,) = controls.scenarios(problem, law, [0])
    payload = 0.006 * problem.instance(0).disturbance
    assert (scenario.plant.parameters["payload"], scenario.mismatch.get("payload")) == (
        (payload, None) if reported else (0.0, payload)
    )


@pytest.mark.slow
def test_the_oracle_of_flight_leaves_no_error_behind_a_rotor_that_fades():
    """A fading rotor's torque is what its feedback alone, without an integral, would not take."""
    problem = smc.problem("quadrotor/fading_rotor@2")
    for trace in smc.run(
        controls.scenarios(problem, controls.oracle_of("quadrotor", 8.0, 1.5), [0, 3])
    ):
        assert problem.measures(trace)["accuracy"] == 1e-6


def test_who_does_nothing_holds_a_quadrotor_in_the_air():
    """So that it fails for want of feedback, not because it falls."""
    problem = smc.problem("quadrotor/slow_rotors@2")
    (scenario,) = problem.scenarios(controls.zero("quadrotor"), [0])
    trace = smc.run(scenario)
    np.testing.assert_allclose(trace.e, trace.e[0] * np.ones((len(trace.t), 1)), rtol=0, atol=1e-9)
