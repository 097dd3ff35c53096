"""First-order laws beside the study's, each held to what its docstring states, on plants A and B
sampled exactly.
"""

import math

import numpy as np
import pytest
from helpers.plants_ab import (
    constant,
    plant_a,
    plant_b,
    sine,
    wave,
)
from scipy.optimize import brentq

import smc_mujoco as smc
from smc_mujoco.control.laws.fuzzy_gain import inferred

pytestmark = pytest.mark.quick

D, RATE = 1.5, 1.0  # bounds on |d| and |d'| of `wave`
DECADES = pytest.mark.parametrize("s0", [10.0**p for p in range(-2, 5)])


# reaching laws


@pytest.mark.parametrize("s0", [0.3, -1.0, 5.0, 100.0])
def test_exponential_reaching_takes_the_time_of_its_formula(s0):
    k = 2.0
    q = 3.0
    run = plant_a(
        smc.law("exponential_reaching", k=k, q=q),
        s=s0,
        h=1e-4,
    )
    assert run.reached(1e-4 * k) == pytest.approx(math.log(1 + q * abs(s0) / k) / q, abs=2e-3)


@pytest.mark.parametrize(
    ("k", "a", "s0"),
    [
        (2.0, 0.5, 4.0),
        (6.0, 0.5, 1.0),
        (1.0, 0.25, -2.0),
        (3.0, 0.75, 1.0),
    ],
)
def test_power_rate_takes_the_time_of_its_formula(k, a, s0):
    h = 1e-4
    run = plant_a(
        smc.law("power_rate", k=k, a=a),
        s=s0,
        h=h,
    )
    assert run.reached((h * k) ** (1 / (1 - a)) + 1e-9) == pytest.approx(
        abs(s0) ** (1 - a) / (k * (1 - a)), rel=0.03, abs=2e-3
    )


@pytest.mark.parametrize("d", [0.5, 1.9])
def test_power_rate_ends_where_it_balances_a_constant_disturbance(d):
    run = plant_a(smc.law("power_rate", k=2.0, a=0.5), constant(d), duration=30.0)
    assert run.s[-1] == pytest.approx((d / 2.0) ** 2, rel=1e-6)
    assert plant_a(smc.law("power_rate", k=2.0, a=0.5), sine(d, 7.0)).residual() <= (d / 2.0) ** 2


@DECADES
def test_fixed_time_reaches_before_its_bound_over_six_decades(s0):
    k1 = 2.0
    k2 = 2.0
    a = 0.5
    b = 1.5
    k = 1.6
    h = 1e-3
    law = smc.law(
        "fixed_time",
        k1=k1,
        k2=k2,
        a=a,
        b=b,
        k=k,
    )
    bound = 1 / (k1 * (1 - a)) + 1 / (k2 * (b - 1))
    assert plant_a(law, wave, s=s0, duration=4.0).reached(2 * h * (k + D)) <= bound
    assert (
        plant_a(
            smc.law(
                "fixed_time",
                k1=k1,
                k2=k2,
                a=a,
                b=b,
                k=0.0,
            ),
            s=s0,
            duration=4.0,
        ).reached(1e-4)
        <= bound
    )


@DECADES
def test_prescribed_time_is_kept_over_six_decades_and_not_beaten_by_far(s0):
    """s = s0 (1 - t/T)^m without d: at T it is 0, and half-way as the formula says."""
    law = smc.law(
        "prescribed_time",
        T=2.0,
        m=2.0,
        k=2.0,
    )
    T = 2.0
    m = 2.0
    h = 1e-3
    run = plant_a(law, wave, s=s0, duration=4.0)
    assert run.reached(h * (2.0 + D)) <= T + 2 * h
    alone = plant_a(
        smc.law("prescribed_time", T=T, m=m, k=0.0),
        s=s0,
        duration=4.0,
    )
    late = alone.t > T + h / 2
    assert np.abs(alone.s[late]).max() <= 1e-12 * s0
    early = alone.t < 0.95 * T
    np.testing.assert_allclose(alone.s[early], s0 * (1 - alone.t[early] / T) ** m, rtol=0.03)
    assert np.abs(alone.u).max() == pytest.approx(m * s0 / T, rel=1e-9)


# discretisations


def test_implicit_varies_a_thousand_times_less_than_explicit():
    implicit = plant_a(smc.law("implicit_first_order", k=2.0), wave)
    assert plant_a(smc.law("classical", k=2.0), wave).variation() > 1000 * implicit.variation()
    mean = wave.integral(1, 1e-3), wave.integral(1, 0.0)
    assert mean[0] - mean[1] == pytest.approx(5e-4, rel=1e-2)
    since = []
    for t in implicit.t[5001:]:
        since.append((wave.integral(1, t) - wave.integral(1, t - 1e-3)) / 1e-3)
    np.testing.assert_allclose(implicit.u[5001:], -np.array(since), atol=1e-9)


@pytest.mark.parametrize(
    ("g", "chatters"),
    [
        (0.5, False),
        (1.9, False),
        (2.1, True),
        (8.0, True),
    ],
)
@pytest.mark.parametrize("b", [1.0, 8.0])
def test_implicit_model_free_chatters_from_g_of_two_b_on_and_never_with_the_model(b, g, chatters):
    law = smc.law("implicit_first_order", k=4.0, b=b)
    assert (plant_a(law, wave, g=b * g).variation() > 100) == chatters
    assert plant_a(law, wave, g=g, f=0.7, model=1.0).variation() < 10


def test_discrete_time_does_not_wind_up_at_an_actuator_weaker_than_k():
    h = 1e-3
    limit = 2.0
    run = plant_a(
        smc.law("discrete_time", k=6.0),
        wave,
        s=20.0,
        duration=60.0,
        limit=limit,
    )
    assert run.s.min() > -(h**2) * RATE * 3
    assert run.reached(h**2 * RATE * 1.01) < math.inf


@pytest.mark.parametrize(
    ("g", "settles"),
    [
        (0.2, True),
        (1.3, True),
        (1.4, False),
    ],
)
def test_discrete_time_settles_just_where_jury_says(g, settles):
    run = plant_a(
        smc.law("discrete_time", k=2.0),
        constant(0.2),
        g=g,
        s=0.01,
    )
    assert (run.residual() < 1e-9) == settles


def test_discrete_reaching_follows_its_recursion_on_the_sampled_double_integrator():
    eps = 3.0
    q = 4.0
    c = 2.5
    h = 1e-2
    law = smc.law(
        "discrete_reaching",
        eps=eps,
        q=q,
        c=c,
    )
    run = plant_b(
        law,
        x=(1.0, 0.3),
        h=h,
        f=-2.0,
        g=3.0,
        model=1.0,
    )
    s = run.sigma
    np.testing.assert_allclose(s[1:], (1 - q * h) * s[:-1] - eps * h * np.sign(s[:-1]), atol=1e-12)
    euler = plant_b(
        smc.law(
            "exponential_reaching",
            k=eps,
            q=q,
            c=c,
        ),
        x=(1.0, 0.3),
        h=h,
        f=-2.0,
        g=3.0,
        model=1.0,
    ).sigma
    assert np.abs(euler[1:] - (1 - q * h) * euler[:-1] + eps * h * np.sign(euler[:-1])).max() > 1e-4


@pytest.mark.parametrize("q", [0.0, 4.0, 60.0])
def test_discrete_reaching_ends_in_its_quasi_sliding_band(q):
    eps = 3.0
    h = 1e-2
    run = plant_b(
        smc.law("discrete_reaching", eps=eps, q=q),
        x=(1.0, 0.0),
        h=h,
        model=1.0,
    )
    s = run.sigma
    crossed = np.flatnonzero(s[1:] * s[:-1] < 0)[0] + 1
    assert np.all(np.abs(s[crossed:]) <= eps * h + 1e-12)
    assert np.all(np.diff(np.sign(s[crossed:])) != 0), "changes its sign in every sample"
    assert np.all(np.diff(np.abs(s[:crossed])) < 0)
    if q > 0:
        np.testing.assert_allclose(np.abs(s[-100:]), eps * h / (2 - q * h), rtol=1e-6)
    under = plant_a(smc.law("discrete_reaching", eps=eps, q=q), wave, h=h)
    assert under.residual() <= (eps + D) * h


# layers, barriers, rules


@pytest.mark.parametrize("d", [0.5, 1.5, 5.0])
def test_barrier_holds_its_bound_when_the_period_is_short_enough_and_a_constant_attains_it(d):
    eps = 0.1
    h = 0.9 * eps / (1 + d) ** 2 if d > 2 else 5e-3
    law = smc.law(
        "barrier_adaptive",
        eps=eps,
        k_max=50.0,
    )
    bound = eps * d / (1 + d)
    run = plant_a(law, sine(d, 3.0), h=h)
    assert run.residual() <= bound * (1 + 1e-9)
    entered = np.flatnonzero(np.abs(run.s) <= eps / 2)[0]
    assert np.abs(run.s[entered:]).max() <= max(bound, eps / 2)
    assert plant_a(
        law,
        constant(d),
        h=h,
        duration=30.0,
    ).s[-1] == pytest.approx(bound, rel=1e-6)


def test_fuzzy_gain_interpolates_its_nine_rules():
    table = [[0, 0, 0.5], [0, 0.5, 1], [0.5, 1, 1]]
    for i, size in enumerate((0.0, 0.5, 1.0)):
        for j, rate in enumerate((-1.0, 0.0, 1.0)):
            assert inferred(size, rate) == table[i][j]
    assert inferred(7.0, -3.0) == table[2][0]
    assert inferred(0.25, 0.0) == 0.25
    assert inferred(0.75, 0.5) == pytest.approx((0.5 + 1 + 1 + 1) / 4)
    grid = np.linspace(0, 1.2, 61)
    rates = np.linspace(-1.2, 1.2, 61)
    values = np.array([[inferred(size, rate) for rate in rates] for size in grid])
    assert np.all(np.diff(values, axis=0) >= -1e-15), "harder further out"
    assert np.all(np.diff(values, axis=1) >= -1e-15), "harder when it rises"
    assert max(np.abs(np.diff(values, axis=axis)).max() for axis in (0, 1)) < 0.05


# no reaching phase, no switching


def nominal_loop(t, c, q, x):
    """x1 of s0' = -q s0, s0 = x2 + c x1, from x at rest."""
    return x * (c * np.exp(-q * t) - q * np.exp(-c * t)) / (c - q)


@pytest.mark.parametrize(
    ("f", "g", "model"),
    [
        (0.0, 1.0, 0.0),
        (-3.0, 2.0, 1.0),
    ],
)
def test_integral_has_no_reaching_phase_and_runs_the_nominal_loop(f, g, model):
    M = 4.0
    c = 2.5
    q = 1.5
    h = 1e-3
    law = smc.law("integral", M=M, c=c, q=q)
    run = plant_b(
        law,
        wave,
        x=(1.0, 0.0),
        f=f,
        g=g,
        model=model,
    )
    assert np.abs(run.sigma).max() <= 1.01 * h * (M + D), "from t = 0"
    np.testing.assert_allclose(run.s, nominal_loop(run.t, c, q, 1.0), atol=2e-3)
    classical = plant_b(smc.law("classical", k=M, c=c), wave, x=(1.0, 0.0))
    assert abs(classical.sigma[0]) == c
    assert np.abs(classical.s - nominal_loop(run.t, c, q, 1.0)).max() > 0.02


def test_dynamic_is_continuous_in_u_and_decays_with_q():
    k = 10.0
    q = 3.0
    h = 1e-3
    run = plant_a(smc.law("dynamic", k=k, q=q), wave, s=1.0)
    assert np.abs(np.diff(run.u)).max() <= h * k * (1 + 1e-9)
    assert run.variation() < 0.01 * plant_a(smc.law("classical", k=2.0), wave).variation()
    rate = np.diff(run.s) / h + q * run.s[1:]
    reached = np.flatnonzero(np.abs(rate) > 3 * h * (k + q * D))[-1] + 2
    assert run.t[reached] < 1.0, "sigma = s' + q s is reached and kept"
    part = slice(reached, reached + 1000)
    expected = run.s[reached] * np.exp(-q * (run.t[part] - run.t[reached]))
    np.testing.assert_allclose(run.s[part], expected, atol=3 * h * k / q)


# what mends the paper's law


# J, D, K of J x'' + D x' + K x = u + d; lam, k1, ki; d. The condition is an equality between the
# pairs.
INTEGRAL = [
    ((1.0, 0.0, 0.0), (2.0, 1.0, 1.8), 0.0), ((1.0, 0.0, 0.0), (2.0, 1.0, 2.2), 0.0),
    ((1.0, 0.0, 0.0), (2.0, 1.0, 1.3), 1.0), ((1.0, 0.0, 0.0), (2.0, 1.0, 1.7), 1.0),
    ((0.5, -1.0, -2.0), (3.0, 2.0, 4.8), 0.0), ((0.5, -1.0, -2.0), (3.0, 2.0, 6.0), 0.0),
    ((2.0, 0.5, 1.0), (1.0, -0.5, 0.3), 0.0), ((2.0, 0.5, 1.0), (1.0, -0.5, 0.45), 0.0),
    ((1.0, -2.0, 3.0), (1.5, 1.0, 0.1), 0.0),
]  # fmt: skip


@pytest.mark.parametrize(("linear", "gains", "d"), INTEGRAL)
def test_observer_free_integral_is_locally_stable_just_where_routh_and_hurwitz_say(
    linear, gains, d
):
    (J, damping, K), (lam, k1, ki) = linear, gains
    m = lam * (1 - (d / lam) ** 2)
    stable = m > -damping and ki > 0 and (damping + m) * (K + m * k1) > J * m * ki
    roots = np.roots([J, damping + m, K + m * k1, m * ki])
    assert stable == bool(roots.real.max() < 0)
    law = smc.law(
        "observer_free_integral",
        lam=lam,
        k1=k1,
        ki=ki,
    )
    size, rest = 1e-6, [math.atanh(d / lam) / ki]  # beside the rest that the load leaves
    run = plant_b(
        law,
        x=(size, 0.0),
        f=d / J,
        g=1 / J,
        rates=(-K / J, -damping / J),
        memory=rest,
        duration=60.0,
    )
    assert (np.abs(run.s[-2000:]).max() < size) == stable


@pytest.mark.parametrize("d", [0.05, 2.0, 8.0])
def test_observer_free_adaptive_rests_where_its_docstring_says(d):
    lam = 6.0
    gamma = 200.0
    leak = 1.0
    zone = 0.1
    law = smc.law(
        "observer_free_adaptive",
        lam=lam,
        gamma=gamma,
        leak=leak,
        deadzone=zone,
    )
    run = plant_a(law, constant(d), duration=30.0)
    b = brentq(lambda b: (lam + gamma * max(b - zone, 0.0) / leak) * math.tanh(b) - d, 0.0, 5.0)
    assert run.s[-1] == pytest.approx(b, rel=1e-6)
