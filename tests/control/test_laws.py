"""The laws of the study are held to what is proved of them, mostly on plant A: s' = u + d, u held
between samples.

What every law must have walks the catalogue in test_laws_catalogue.py.
"""

import math

import numpy as np
import pytest
from helpers.plants_ab import constant, one, orders, plant_a, sine, wave
from scipy.linalg import expm

import smc_mujoco as smc

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("against", [0.0, 0.5, 1.5])
def test_classical_reaches_in_the_time_that_the_gain_leaves(against):
    """|s|' = -(k - D) where a constant disturbance D pushes away: reached at |s0| / (k - D)."""
    run = plant_a(smc.law("classical", k=2.0), constant(against), s=1.0)
    reached = run.t[np.argmax(np.abs(run.s) <= 1e-3 * (2.0 + against))]
    assert reached == pytest.approx(1.0 / (2.0 - against), abs=0.01)


TWIST = {"k1": 1.5, "k2": 1.1}
# Multiples of a power of the period: k + D, D and L where |d| <= D and |d'| <= L, of `dynamic` and
# the explicit super-twisting law as measured.
RESIDUALS = [
    ("classical", {"k": 2.0}, 1, 3.5),
    ("implicit_first_order", {"k": 2.0}, 1, 1.5),
    ("implicit_super_twisting", TWIST, 1, 1.5),
    ("implicit_super_twisting", {"k1": 6.0, "k2": 8.0}, 1, 1.5),
    ("dynamic", {"k": 10.0, "q": 3.0}, 1, 0.58),
    ("super_twisting", TWIST, 2, 6.0),
    ("discrete_time", {"k": 2.0}, 2, 1.0),
    ("proper_super_twisting", TWIST, 2, 1.0),
]


@pytest.mark.parametrize(("name", "gains", "power", "multiple"), RESIDUALS)
def test_a_sampled_law_ends_within_a_multiple_of_a_power_of_the_period_and_not_far_below(
    name, gains, power, multiple
):
    h = np.array([1e-3, 1e-4])
    shares = orders(smc.law(name, **gains), steps=h)[1] / (multiple * h**power)
    assert np.all((shares > 0.9) & (shares < 1.0 + 1e-5)), shares


@pytest.mark.parametrize(
    ("k", "phi", "d"),
    [
        (6.0, 0.5, 1.5),
        (2.0, 1.0, 1.9),
        (6.0, 0.01, 5.0),
    ],
)
def test_boundary_layer_ends_within_phi_d_over_k_and_a_constant_attains_it(k, phi, d):
    law = smc.law("boundary_layer", k=k, phi=phi)
    bound = phi * d / k
    assert plant_a(law, constant(d), duration=30).s[-1] == pytest.approx(bound, rel=1e-9)
    assert plant_a(law, sine(d, 7.0), duration=30).residual() <= bound


def gain(law, run):
    """K of an adaptive law at every sample."""
    return law.gains["k0"] + run.memory[:, 0]


@pytest.mark.parametrize("sigma", [0.0, 0.05])
def test_adaptive_gain_never_decreases(sigma):
    law = smc.law("adaptive", k0=0.3)
    noise = sigma * np.random.default_rng(0).normal(size=10_000)
    run = plant_a(law, wave, noise=noise)
    assert np.all(np.diff(gain(law, run)) >= 0.0)
    np.testing.assert_array_equal(np.abs(run.u), gain(law, run))


def test_noise_winds_up_the_adaptive_gain_without_end_and_the_leak_bounds_it():
    noise = 0.05 * np.random.default_rng(1).normal(size=80_000)
    plain_law = smc.law("adaptive", gamma=15.0)
    leaky = smc.law("adaptive_leak", gamma=15.0)
    growing = plant_a(
        plain_law,
        wave,
        noise=noise,
        duration=80,
    )
    bounded = plant_a(
        leaky,
        wave,
        noise=noise,
        duration=80,
    )
    early, late = (gain(plain_law, growing)[k] for k in (40_000, 79_999))
    assert late - early > 15.0 * 40 * 0.05 * math.sqrt(2 / math.pi) * 0.9  # gamma T E|noise|
    K = gain(leaky, bounded)
    g = leaky.gains
    assert K[40_000:].max() < 1.3 * K[20_000:40_000].max()
    assert K.max() <= g["gamma"] * np.abs(bounded.s + noise).max() / g["leak"]
    assert K.max() < late / 4


def test_observer_free_is_bounded_by_lam_and_saturates_there():
    law = smc.law("observer_free", lam=2.5, k1=3.0)
    states = np.random.default_rng(0).normal(
        scale=5.0,
        size=(1000, 2),
    )
    forces = np.array([one(law, e=e, de=de)[0] for e, de in states])
    assert np.abs(forces).max() <= 2.5
    assert one(law, e=1e9)[0] == -2.5
    np.testing.assert_allclose(
        forces, -2.5 * np.tanh(states[:, 1] + 3.0 * states[:, 0]), rtol=1e-14
    )


# Plant, (J, D, K) of its linearisation J x'' + D x' + K x = u at the origin, lam, k1.
LOCAL = [
    ("van_der_pol", (1.0, -1.0, 1.0), 0.8, 1.0),  # lam < -D
    ("van_der_pol", (1.0, -1.0, 1.0), 1.2, 1.0),
    ("van_der_pol", (1.0, -1.0, 1.0), 1.5, -0.8),  # lam k1 < -K
    ("inverted_pendulum", (0.125, 0.02, -2.4525), 3.0, 1.0),
    ("inverted_pendulum", (0.125, 0.02, -2.4525), 0.5, 4.0),  # lam k1 < -K
    ("inverted_pendulum", (0.125, 0.02, -2.4525), 0.5, 6.0),
]


@pytest.mark.slow
@pytest.mark.parametrize(("plant", "linear", "lam", "k1"), LOCAL)
def test_observer_free_is_locally_stable_just_where_its_condition_says(plant, linear, lam, k1):
    """The envelope of a tiny error goes at the rate of the linearisation's slowest root."""
    J, D, K = linear
    law = smc.law("observer_free", lam=lam, k1=k1)
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law=law,
            x0=1e-6,
            duration=20.0,
            control_period=2e-3,
            u_max=math.inf,
        )
    )
    closed = np.array([[0.0, 1.0], [-(K + lam * k1) / J, -(D + lam) / J]])
    stable = lam > -D and lam * k1 > -K
    assert stable == bool(np.linalg.eigvals(closed).real.max() < 0)
    states = np.array([np.linalg.norm(expm(closed * t) @ (1e-6, 0.0)) for t in trace.t[::250]])
    norms = np.hypot(trace.x, trace.v)[::250, 0]
    tiny = states < 1e-2
    np.testing.assert_allclose(
        norms[tiny],
        states[tiny],
        rtol=0.05,
        atol=1e-9,
    )
    assert norms[tiny][-1] < 0.5e-6 if stable else norms[tiny][-1] > 3e-6
