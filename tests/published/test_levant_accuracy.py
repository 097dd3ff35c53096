"""Levant's orders of accuracy, measured in runs: under noise of size eps, and in the sampling
period h.

An r-sliding law with Levant's differentiator keeps |s^(i)| = O(eps^((r-i)/r)) and O(h^(r-i)), i = 0
.. r-1 (A. Levant, Int. J. Control 76:924, 2003, whose abstract, "up to the rth order of sliding
precision with respect to the sampling interval", could be read; 1993, Int. J. Control 58:1247, for
r = 2: "proportional to the square of the switching time delay"). A differentiator of order n errs
in the i-th derivative by O(eps^((n+1-i)/(n+1))) (Automatica 34:379, 1998; 2003).

The bounds are for the worst noise. White noise sampled at one fixed period is not the worst for
every eps, since more samples of it average out where the loop is slower. Here the period is in
proportion to eps^(1/r), so that the noise is the same for every eps, relative to the speed of the
loop.
"""

import functools
import math
import re

import numpy as np
import pytest
from helpers.pages import ROOT
from helpers.runs import free_mass
from numba import njit

import smc_mujoco as smc
from smc_mujoco.control.estimators.levant import levant

WITHIN, TOLD = 0.1, 0.02  # of the theorem's exponent, and of that on the page
NOISE, PERIOD = 2, 4  # columns of the page
PERIODS = (2e-3, 1e-3, 5e-4, 2.5e-4)  # s
# with 4 the exponent of e under noise comes out between .95 and 1.11; without noise 4 are enough
SEEDS = 24
# samples in which errors are measured: as many for every period, as their maximum grows with the
# number
LATE = 3000


def exponents(sizes, errors):
    """Exponents p of errors ~ sizes^p, (derivatives,); errors (sizes, runs, derivatives)."""
    logs = np.log(errors).mean(axis=1)
    return np.polyfit(np.log(sizes), logs, 1)[0]


def check(found, theorem, row, column):
    """Exponents are those of the theorem, and those that docs/published.md tells."""
    np.testing.assert_allclose(found, theorem, rtol=0, atol=WITHIN)
    (line,) = re.findall(
        rf"^\| `{row}.*", (ROOT / "docs" / "published.md").read_text(), re.MULTILINE
    )
    np.testing.assert_allclose(
        found, [float(figure) for figure in line.split("|")[column].split(",")], rtol=0, atol=TOLD
    )


def late(*signals):
    """Largest magnitude of each signal at the end of its run."""
    return [np.abs(signal[-LATE:]).max() for signal in signals]


# sliding modes


SECOND = {
    "law": [smc.law("twisting", r1=3.7, r2=2.3), smc.law("quasi_continuous", a=6.0, b=1.0)],
    "velocity": smc.estimator("levant", L=7.5, order=1),  # > 6 + 0.3 of u and d
    "disturbance": smc.Sine(0.3, 20.0),
    "settled": 1.5,  # s
}
THIRD = {
    "law": [smc.law("nested_third_order", a=60.0, w=1.0)],
    "velocity": smc.estimator("levant", L=7.5, order=2),  # > 60 / 10 of u behind the lag, and d'
    "disturbance": smc.Sine(0.05, 10.0),
    "actuator": smc.Lag(10.0),  # s: x''' = (u - f) / 10, f small beside u
    "u_max": 1e3,
    "settled": 10.0,  # s
}
LAWS = {r: [law.name for law in fields["law"]] for r, fields in ((2, SECOND), (3, THIRD))}


@functools.cache
def sliding(r, noise):
    """Errors of e .. e^(r-1) with the periods, (laws, periods, runs, r); noise is (period / 30
    ms)^r, or 0.
    """
    fields = dict(SECOND if r == 2 else THIRD)
    laws = fields.pop("law")
    settled = fields.pop("settled")
    scenarios = []
    for law in laws:
        for h in PERIODS:
            for seed in range(SEEDS if noise else 4):
                scenarios.append(
                    smc.Scenario(
                        plant=free_mass(),
                        law=law,
                        x0=0.02 + 0.01 * seed,
                        duration=settled + LATE * h,
                        control_period=h,
                        physics_step=h,
                        noise=smc.Noise(position=noise * (h / 0.03) ** r),
                        seed=seed,
                        **({"u_max": 20.0} | fields),
                    )
                )
    errors = []
    for t in smc.run(scenarios):
        errors.append(late(t.x, t.v, t.force + t.d)[:r])
    return np.reshape(errors, (len(laws), len(PERIODS), -1, r))


@pytest.mark.slow
@pytest.mark.parametrize("r", [2, 3])
def test_errors_under_noise_have_levant_s_exponents(r):
    eps = (np.array(PERIODS) / 0.03) ** r
    for law, errors in zip(LAWS[r], sliding(r, 1.0), strict=True):
        check(exponents(eps, errors), (r - np.arange(r)) / r, law, NOISE)


@pytest.mark.slow
@pytest.mark.parametrize("r", [2, 3])
def test_errors_in_the_sampling_period_have_levant_s_exponents(r):
    for law, errors in zip(LAWS[r], sliding(r, 0.0), strict=True):
        check(exponents(PERIODS, errors), r - np.arange(r), law, PERIOD)


@pytest.mark.slow
def test_noise_is_what_the_errors_under_noise_are_made_of():
    """Ten times the errors that sampling alone leaves, so that the exponents are those of the
    noise.
    """
    for r in (2, 3):
        alone = sliding(r, 0.0)[..., 0]
        assert np.all(sliding(r, 1.0)[:, :, : alone.shape[2], 0] > 10.0 * alone)


# differentiators


estimate = njit(levant.function)


@smc.estimator_function(gains={"L": 1.0, "order": 1.0}, memory=5)
def position(y, gains, memory):
    """The differentiator's z0, which a law does not get: its estimate of the position at the
    sample.
    """
    z0 = memory[1]
    estimate(y, gains, memory)
    return z0, 0.0


@smc.law_function(memory=1)
def shows_velocity(y, gains, memory):
    return 0.0, y.v


@smc.law_function(memory=1)
def shows_acceleration(y, gains, memory):
    return 0.0, y.a


def differentiation(n, noise):
    """Errors of z0 .. zn on x = sin t, (periods, runs, n + 1); noise is (period / 30 ms)^(n + 1),
    or 0.
    """
    shows = [
        (shows_velocity(), position(L=1.0, order=n)),
        (shows_velocity(), smc.estimator("levant", L=1.0, order=n)),
        (shows_acceleration(), smc.estimator("levant", L=1.0, order=n)),
    ]
    periods = 8.0 * np.array(PERIODS)
    scenarios = []
    for h in periods:
        for seed in range(3 if noise else 1):
            for law, velocity in shows[: n + 1]:
                scenarios.append(
                    smc.Scenario(
                        plant=free_mass(),
                        law=law,
                        velocity=velocity,
                        x0=math.sin(seed),
                        v0=math.cos(seed),
                        disturbance=smc.Sine(-1.0, 1.0, seed),
                        control_period=h,
                        physics_step=h,
                        duration=12.0 + LATE * h,
                        noise=smc.Noise(position=noise * (h / 0.03) ** (n + 1)),
                        seed=seed,
                    )
                )
    errors = []
    for k, trace in enumerate(smc.run(scenarios)):
        true = np.sin(trace.t + trace.scenario.seed + k % (n + 1) * math.pi / 2)
        errors += late(trace.s[:, 0] - true)
    return periods, np.reshape(errors, (len(periods), -1, n + 1))


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 2])
def test_differentiators_err_under_noise_with_levant_s_exponents(n):
    periods, errors = differentiation(n, 1.0)
    eps = (periods / 0.03) ** (n + 1)
    check(
        exponents(eps, errors), (n + 1 - np.arange(n + 1)) / (n + 1), f"levant`, order {n}", NOISE
    )


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 2])
def test_differentiators_err_in_the_sampling_period_with_levant_s_exponents(n):
    periods, errors = differentiation(n, 0.0)
    check(exponents(periods, errors), n + 1 - np.arange(n + 1), f"levant`, order {n}", PERIOD)
