"""What each velocity estimator gives on a ramp, a parabola and noise, and inside a run."""

import math

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco import plain
from smc_mujoco.estimators import Reading

H = 1e-3  # s


def estimates(estimator, x, v=None, h=H):
    """The estimator's output on samples x and sensor readings v, (K,)."""
    memory, gains = np.zeros(estimator.memory), plain.named(estimator)
    v = np.zeros_like(x) if v is None else v
    return np.array([estimator.function(Reading(h, *xv), gains, memory) for xv in zip(x, v, strict=True)])


def differenced(tau):
    return smc.estimator("filtered_difference", tau=tau)


def test_measured_is_the_sensor():
    x, v = np.random.default_rng(0).normal(size=(2, 100))
    np.testing.assert_array_equal(estimates(smc.estimator("measured"), x, v), v)


@pytest.mark.parametrize("tau", [0.0, 1e-3, 5e-3, 0.1])
@pytest.mark.parametrize("h", [1e-3, 5e-3])
def test_filtered_difference_of_a_ramp_is_its_slope_after_an_exponential(tau, h):
    """v_k = c (1 - a^k), a = tau / (tau + h): exact at once for tau = 0."""
    k = np.arange(3000)
    v = estimates(differenced(tau), 0.7 - 2.0 * k * h, h=h)
    np.testing.assert_allclose(v, -2.0 * (1 - (tau / (tau + h)) ** k), atol=1e-9)


@pytest.mark.parametrize("tau", [0.0, 5e-3, 0.05])
def test_filtered_difference_lags_by_tau_and_half_a_sample(tau):
    """On x = t^2 / 2 the velocity is t; the filter's share of the lag is tau, the difference's is h / 2."""
    t = np.arange(4000) * H
    lag = t - estimates(differenced(tau), t**2 / 2)
    np.testing.assert_allclose(lag[2000:], tau + H / 2, atol=1e-9)


@pytest.mark.parametrize("tau", [0.0, 1e-3, 5e-3, 0.05])
def test_filtered_difference_passes_noise_by_its_formula(tau):
    """The impulse response is (1-a)/h (1, -(1-a), -(1-a) a, ...): its energy is 2 (1-a)^2 / ((1+a) h^2)."""
    gain = math.sqrt(2.0 / ((tau + H) * (2.0 * tau + H)))
    impulse = np.zeros(5000)
    impulse[1] = 1.0
    assert np.linalg.norm(estimates(differenced(tau), impulse)) == pytest.approx(gain, rel=1e-9)
    noise = 0.01 * np.random.default_rng(0).normal(size=200_000)
    assert estimates(differenced(tau), noise)[2000:].std() == pytest.approx(0.01 * gain, rel=0.02)


def test_filtered_difference_starts_from_zero_wherever_the_plant_starts():
    assert estimates(differenced(5e-3), np.full(5, 1e3)).tolist() == [0.0] * 5


def test_filtered_difference_does_not_read_the_velocity_sensor():
    x, v = np.random.default_rng(0).normal(size=(2, 100))
    np.testing.assert_array_equal(estimates(differenced(5e-3), x, v), estimates(differenced(5e-3), x))


def test_a_negative_time_constant_is_refused():
    """tau = -5 ms at 1 ms is a = 1.25: an estimate that grows without bound."""
    with pytest.raises(smc.ScenarioError, match="tau"):
        differenced(-5e-3)


@smc.law_function()
def show_position(y, gains, memory):
    return 0.0, y.x


@smc.law_function()
def show_velocity(y, gains, memory):
    return 0.0, y.v


@pytest.mark.parametrize("period", [1e-3, 5e-3])
def test_in_a_run_every_channel_has_its_own_estimate_of_what_it_measures(period):
    common = {"plant": "pendulum_network", "duration": 0.3, "control_period": period, "seed": 2}
    common |= {"velocity": differenced(5e-3), "noise": smc.Noise(position=0.01, velocity=9.0)}
    x, v = (trace.s for trace in smc.run([smc.Scenario(law=law(), **common) for law in (show_position, show_velocity)]))
    for i in range(5):
        expected = estimates(differenced(5e-3), x[:, i], h=period)
        np.testing.assert_allclose(v[:, i], expected, rtol=1e-12, atol=1e-12)


def test_in_a_run_the_estimate_follows_the_true_velocity():
    common = {"plant": "duffing", "duration": 5.0}
    free = smc.run(smc.Scenario(law=show_velocity(), velocity=differenced(2e-3), **common))
    late = np.interp(free.t - 2e-3 - H / 2, free.t, free.v[:, 0])
    np.testing.assert_allclose(free.s[50:, 0], late[50:], atol=2e-5)
    sensed = smc.run(smc.Scenario(law=show_velocity(), **common))
    np.testing.assert_array_equal(sensed.s, sensed.v)
