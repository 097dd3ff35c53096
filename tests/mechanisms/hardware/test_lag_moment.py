"""Behind a Lag, RK4 gives the motion of the continuous force: its stages have the force's mean and
first moment.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import smc_mujoco as smc
from smc_mujoco.mechanisms.plant import Plant

DURATION = 0.2
PERIOD = 1e-3


def exact(plant: Plant, x0: float, u: np.ndarray, tau: float) -> np.ndarray:
    """Positions at the samples, of x'' = f + g F and tau F' = u - F with commands that are held, to
    1e-12.
    """
    values = plant.values({})
    state = np.array([x0, 0.0, 0.0])
    positions = [x0]

    def slope(_, y, held):
        f, g = plant.nominal(y[:1], y[1:2], 0, values)
        return [y[1], f + g * y[2], (held - y[2]) / tau]

    for held in u[:-1]:
        state = solve_ivp(
            slope, (0.0, PERIOD), state, "DOP853", rtol=1e-12, atol=1e-14, args=(held,)
        ).y[:, -1]
        positions.append(state[0])
    return np.array(positions)


@pytest.mark.parametrize("tau", [2e-4, 1e-3, 5e-3, 0.05])
@pytest.mark.parametrize("plant", ["duffing", "inverted_pendulum"])
def test_positions_behind_a_lag_are_those_of_its_continuous_force_at_the_default_step(plant, tau):
    scenario = smc.Scenario(
        plant=plant,
        law=smc.law("classical"),
        x0=0.01,
        duration=DURATION,
        actuator=smc.Lag(tau),
    )
    assert scenario.resolved.integrator == "RK4"
    assert scenario.resolved.physics_step == PERIOD
    trace = smc.run(scenario)
    assert np.ptp(trace.u) == 8.0  # it switches
    assert trace.x[:, 0] == pytest.approx(exact(scenario.plant, 0.01, trace.u[:, 0], tau), abs=1e-9)


@pytest.mark.quick
def test_the_mean_of_its_force_over_a_control_period_is_in_the_trace():
    tau = 5e-3
    trace = smc.run(
        smc.Scenario(
            plant="duffing",
            law=smc.law("classical"),
            duration=0.05,
            actuator=smc.Lag(5e-3),
        )
    )
    force = 0.0
    means = [0.0]
    for u in trace.u[:-1, 0]:
        end = u + (force - u) * np.exp(-PERIOD / tau)
        means.append(u + (force - end) * tau / PERIOD)  # of F = u + (F0 - u) exp(-t / tau)
        force = end
    assert trace.force[:, 0] == pytest.approx(np.array(means), abs=1e-12)
