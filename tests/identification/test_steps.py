"""Plants from step logs of transfer functions whose numbers are known."""

import numpy as np
import pytest
from scipy.signal import TransferFunction, lsim

import smc_mujoco as smc

STEP = 0.005
T = STEP * np.arange(400)
U = np.where(T >= 0.2, 1.5, 0.0) - np.where(T >= 1.1, 3.0, 0.0)


def response(denominator, gain=4.0, late=0.03, noise=0.02, seed=0):
    """The response to U, `late` s later, with noise."""
    fine = 1e-3 * np.arange(2000)
    held = np.interp(fine - late, np.repeat(T, 2)[1:], np.repeat(U, 2)[:-1])
    _, y, _ = lsim(TransferFunction([gain], denominator), held, fine, interp=False)
    return np.interp(T, fine, y) + noise * np.random.default_rng(seed).standard_normal(len(T))


def check(model, truth):
    for name, true in truth.items():
        off = abs(model.values[name] - true)
        assert off < max(3.0 * model.errors[name], 0.01 * true), (name, model.values[name])
        assert model.errors[name] < 0.1 * true, name


@pytest.mark.parametrize("gain", [-4.0])
def test_a_first_order_speed_has_its_gain_time_constant_and_delay(gain):
    plant = smc.plant_from_steps({"t": T, "u": U, "v": response([0.25, 1.0], gain)})
    assert "lag" not in plant.model.values
    check(plant.model, {"time_constant": 0.25, "delay": 0.03})
    assert plant.model.values["gain"] == pytest.approx(gain, rel=0.01)
    assert plant.limits == (1.5,)


@pytest.mark.slow
def test_errors_are_those_of_the_scatter_between_logs():
    values, errors = [], []
    for seed in range(8):
        log = {"t": T, "u": U, "v": response([0.25, 1.0], seed=seed)}
        model = smc.plant_from_steps(log).model
        values.append(list(model.values.values()))
        errors.append(list(model.errors.values()))
    ratio = np.std(values, axis=0, ddof=1) / np.mean(errors, axis=0)
    assert np.all((ratio > 0.5) & (ratio < 1.8)), ratio


def test_a_lag_that_shows_is_a_second_time_constant():
    slow = np.polymul([0.25, 1.0], [0.06, 1.0])
    plant = smc.plant_from_steps({"t": T, "u": U, "v": response(slow, noise=0.005)})
    check(plant.model, {"time_constant": 0.25, "lag": 0.06})


def test_the_plant_answers_a_step_as_the_log_did():
    v = response([0.25, 1.0], noise=0.0)
    plant = smc.plant_from_steps({"t": T, "u": U, "v": v}, u_max=10.0)
    run = smc.Scenario(
        plant=plant,
        law="none",
        feedforward=smc.signals.Held(T.tolist(), U.tolist()),
        control_period=STEP,
        duration=float(T[-1]),
        x0=0.0,
    )
    assert np.abs(smc.run(run).v[:, 0] - v).max() < 0.02 * np.ptp(v)
    assert "gain" in str(plant.model)


def test_a_position_that_swings_has_its_damping_ratio():
    x = response([0.1**2, 2.0 * 0.3 * 0.1, 1.0], gain=0.2, noise=0.001)
    plant = smc.plant_from_steps({"t": T, "u": U, "x": x}, tracks="position")
    check(plant.model, {"gain": 0.2, "time_constant": 0.1, "damping_ratio": 0.3, "delay": 0.03})
    model = plant.load()
    assert model.jnt_stiffness.ravel()[0] == pytest.approx(5.0, rel=0.01)


@pytest.mark.quick
@pytest.mark.parametrize(
    ("log", "words"),
    [
        ({"t": T, "u": U}, "no column v"),
        ({"t": T, "u": 0.0 * U, "v": U}, "does not step"),
        ({"t": T, "u": U, "v": np.random.default_rng(0).standard_normal(400)}, "does not follow"),
        ({"t": T, "u": U, "v": np.cumsum(U)}, "does not come to rest"),
        (3, "give a file"),
    ],
)
def test_a_log_that_tells_nothing_is_refused(log, words, refused):
    refused(lambda: smc.plant_from_steps(log), words)
