"""The controller in Python: measurement in, u and s out, as in the run, with nobody stepping a
mechanism.
"""

import dataclasses

import numpy as np
import pytest
from helpers import arms
from helpers.python_controller import Controller

import smc_mujoco as smc
from smc_mujoco.simulation.python_functions import Failure

NOISE = smc.Noise(position=0.001, velocity=0.01)
SCENARIOS = {
    "a channel with noise, surface and feedforward": smc.Scenario(
        plant="duffing",
        law=smc.law("super_twisting"),
        surface="integral",
        noise=NOISE,
        feedforward=smc.Sine(0.3, 4.0),
        seed=2,
    ),
    "a free joint, its model, an encoder that loses readings": smc.Scenario(
        plant="furuta",
        law="observer_free",
        model="nominal",
        sensor=smc.Encoder(counts=4096, dropout=0.3),
    ),
    "a network with an estimator": smc.Scenario(
        plant=smc.plant("pendulum_network", n=3),
        law=smc.law("observer_free"),
        velocity="levant",
        u_max=2.0,
    ),
    "compensation at the speed that is estimated": smc.Scenario(
        plant=smc.plant("pendulum_network", n=3),
        law=smc.law("pid"),
        velocity="levant",
        noise=NOISE,
        clock=smc.Clock(missed=0.0),
        feedforward=smc.Feedforward((smc.Coulomb(0.2), smc.Viscous(0.3)), on="speed", error=-0.2),
    ),
    "compensation of one joint of many, at its reference's speed": smc.Scenario(
        plant=arms.arm(),
        law="computed_torque_sliding",
        model="nominal",
        reference=smc.Sine(0.2, 5.0),
        feedforward=smc.Feedforward({"lift": smc.Coulomb(2.0)}, error=0.3),
        u_max=60.0,
    ),
    "a law of many joints": smc.Scenario(
        plant=arms.arm(),
        law="computed_torque_sliding",
        model="nominal",
        reference=smc.Sine(0.2, 5.0),
        u_max=60.0,
    ),
}


@pytest.mark.quick
@pytest.mark.parametrize("name", SCENARIOS)
def test_it_gives_the_u_and_s_of_the_run_from_the_positions_and_velocities_of_the_run(name):
    trace = smc.run(dataclasses.replace(SCENARIOS[name], duration=0.05))
    controller = Controller(trace.scenario)
    outputs = []
    for k, t in enumerate(trace.t.tolist()):
        outputs.append(controller(k, t, trace.x[k], trace.v[k]))
    np.testing.assert_allclose([u for u, _ in outputs], trace.u, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose([s for _, s in outputs], trace.s, rtol=1e-12, atol=1e-12)


def test_what_the_sensors_read_is_not_written_to():
    x = np.array([0.3])
    v = np.array([-0.1])
    Controller(smc.Scenario(plant="duffing", law=smc.law("classical"), noise=NOISE))(1, 1e-3, x, v)
    assert x[0] == 0.3
    assert v[0] == -0.1


def test_a_law_without_a_number_fails_the_call():
    @smc.law_function
    def broken(y, gains, memory):
        return y.e / 0.0, 0.0

    with pytest.raises(Failure, match="law 'broken' raised ZeroDivisionError"):
        Controller(smc.Scenario(plant="duffing", law=broken()))(0, 0.0, np.zeros(1), np.zeros(1))
