"""Super-twisting laws, laws of relative degree 2 and 3, and terminal laws, each held to what is
proved of it.

On the chains of plants_ab.py, sampled without error; relative degree 3 on mechanisms behind an
actuator lag.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.plants_ab import called as call
from helpers.plants_ab import (
    constant,
    measured,
    on_surface,
    plant_a,
    plant_b,
    plant_c,
    ramp,
    rest,
    sine,
    wave,
)

import smc_mujoco as smc
from smc_mujoco.control.surface import surface

pytestmark = pytest.mark.quick

STEPS = (1e-2, 1e-3, 2e-4)
HUM = sine(1 / 6, 6.0) + constant(0.3)  # |d'| <= 1, of a period that the last 20 % of 6 s hold
DECADES = math.log10(STEPS[0] / STEPS[2])
TWISTED = (
    "implicit_super_twisting",
    "proper_super_twisting",
    "conditioned_super_twisting",
    "proper_conditioned_super_twisting",
)


def law(name, **gains):
    return smc.law(name, **gains)


# super-twisting, discretised


@pytest.mark.parametrize("name", ["implicit_super_twisting", "proper_super_twisting"])
def test_implicit_laws_solve_their_inclusion(name):
    """5,000 random gains, periods and states: u + k1 [z]^(1/2) - w+ is 0, and w+ is in w - dt k2
    sgn(z), of s' = b u.
    """
    rng = np.random.default_rng(12)
    k1, k2, b, dt = 10.0 ** rng.uniform((-1, -1, -1, -4), (1, 1, 1, 0), (5_000, 4)).T
    s, w = rng.normal(size=(2, 5_000)) * 10.0 ** rng.uniform(-6, 0, (2, 5_000))
    s *= np.where(rng.random(5_000) < 0.3, b * dt * dt * k2, 1.0)  # inside the sliding layer too
    function = law(name).function
    on = 0
    assert function is not None
    for values in np.array([k1, k2, b, dt, s, w]).T.tolist():
        k1_, k2_, b_, h, s_, w_ = values
        memory = np.array([w_])
        u, _ = function(on_surface(s_, dt=h), SimpleNamespace(k1=k1_, k2=k2_, b=b_, c=0.0), memory)
        after = memory[0]
        ahead = s_ + h * b_ * u
        root = (after - u) / k1_
        if name == "proper_super_twisting":
            ahead = s_ + h * b_ * (u - after)
            root = (2.0 * after - w_ - u) / k1_
        z = root * abs(root)
        scale = abs(s_) + h * b_ * (abs(u) + abs(w_) + abs(after))
        assert abs(ahead - z) <= 1e-12 * (scale + abs(z)), values
        if abs(z) <= 1e-12 * scale:
            on += 1
            assert abs(after - w_) <= h * k2_ * (1.0 + 1e-12) + 1e-15, values
        else:
            assert after == pytest.approx(
                w_ - h * k2_ * math.copysign(1.0, z), rel=1e-12, abs=1e-15
            ), values
    assert 250 < on < 4_750


@pytest.mark.parametrize("name", ["super_twisting", *TWISTED])
def test_a_disturbance_of_slope_below_k2_is_followed_and_one_above_is_not(name):
    followed = plant_a(law(name, k1=1.5, k2=1.1), ramp(0.8))
    lost = plant_a(law(name, k1=1.5, k2=0.5), ramp(0.8))
    assert followed.residual() <= 1.01e-3 * 8.0
    assert np.abs(followed.u + 0.8 * followed.t)[-100:].max() < 0.02
    assert lost.residual() > 0.5


def test_conditioned_super_twisting_bounds_the_command_itself_and_so_knows_the_model():
    """With f and g known, s' = -5 + 4 u + d is the plant s' = v + d with v in [-13, 3]."""
    fields = {
        "f": -5.0,
        "g": 4.0,
        "model": 1.0,
        "limit": 2.0,
    }
    run = plant_a(
        law(
            "conditioned_super_twisting",
            k1=1.5,
            k2=1.1,
        ),
        wave,
        s=-20.0,
        duration=20.0,
        **fields,
    )
    assert run.residual() < 20 * 1e-3**2
    assert run.s.max() < 3.0**2 / (2 * 1.1)
    assert run.memory[:, 0].max() <= 3.0 + 2e-3


def test_clamped_super_twisting_keeps_its_integral_within_w_max_and_its_accuracy_below_it():
    gains = {"k1": 1.5, "k2": 1.1, "w_max": 0.5}
    for sign in (1.0, -1.0):
        beyond = plant_a(law("super_twisting", **gains), constant(sign * 0.8), duration=40.0)
        assert np.abs(beyond.memory).max() == 0.5
        assert beyond.s[-1] == pytest.approx(sign * (0.3 / 1.5) ** 2, rel=1e-6)
    below = constant(0.2) + sine(0.2, 3.0)  # |d| <= 0.4
    clamped, plain = (
        plant_a(law("super_twisting", **gains | {"w_max": w}), below) for w in (0.5, math.inf)
    )
    assert clamped.residual() == pytest.approx(plain.residual(), rel=0.2)
    assert clamped.residual() < 10 * 1e-3**2


def test_adaptive_super_twisting_finds_gains_for_disturbances_of_any_size_and_lets_them_go():
    rule = law("adaptive_super_twisting")
    k0 = rule.gains["k0"]
    least = rule.gains["least"]
    mu = rule.gains["mu"]
    for size in (0.5, 5.0, 20.0):
        run = plant_a(rule, sine(size), duration=20.0)
        assert run.residual() < 10 * mu
    K = k0 + run.memory[:, 1]
    assert 10.0 < K[-1] < 40.0
    assert (
        plant_a(law("super_twisting", k1=k0, k2=k0), sine(20.0), duration=20.0).residual()
        > 100 * mu
    )
    quiet = plant_a(rule, rest, duration=20.0)
    assert k0 + quiet.memory[-1, 1] == pytest.approx(least, abs=0.01)
    assert (k0 + quiet.memory[:, 1]).min() >= least - 1e-3 * rule.gains["rate"] - 1e-12


# relative degree 2


@pytest.mark.parametrize(
    ("r1", "r2"),
    [
        (3.7, 2.3),
        (4.0, 1.0),
    ],
)
def test_twisting_takes_the_time_of_its_geometric_spiral(r1, r2):
    q = (r1 - r2) / (r1 + r2)
    finite = math.sqrt(2 / (r1 - r2)) * (1 + q) / (1 - math.sqrt(q))
    run = plant_b(
        law("twisting", r1=r1, r2=r2),
        h=2e-4,
        duration=8.0,
    )
    assert run.reached(1e-5) == pytest.approx(finite, rel=0.01)
    assert run.s.min() == pytest.approx(-q, rel=1e-2)
    four = plant_b(
        law("twisting", r1=r1, r2=r2),
        x=(4.0, 0.0),
        h=4e-4,
        duration=13.0,
    )
    assert four.reached(4e-5) == pytest.approx(2 * finite, rel=0.01)


def test_suboptimal_stops_without_overshoot_at_a_fixed_part_of_where_it_was():
    r1 = 4.0
    r2 = 1.5
    run = plant_b(
        law("suboptimal", r1=r1, r2=r2),
        h=1e-4,
        duration=4.0,
    )
    v = run.x[:, 1]
    stops = run.s[1:][(v[:-1] < 0) & (v[1:] >= 0)]
    np.testing.assert_allclose(stops[:4], (r2 / (r1 + r2)) ** np.arange(1, 5), rtol=0.02)
    assert run.s.min() > -1e-6


def test_prescribed_convergence_and_quasi_continuous_come_in_along_their_curves():
    b = 2.0
    run = plant_b(
        law("prescribed_convergence", a=5.0, b=b),
        x=(1.0, -b),
        h=1e-4,
        duration=3.0,
    )
    assert run.reached(1e-5) == pytest.approx(2 / b, rel=0.01)
    slow = law("quasi_continuous", a=6.0, b=1.0)
    r = min(root.real for root in np.roots([1.0, 1.0, -12.0, 12.0]) if root.real > 1.0)
    run = plant_b(
        slow,
        x=(1.0, -r),
        h=1e-4,
        duration=3.0,
    )
    assert run.reached(1e-5) == pytest.approx(2 / r, rel=0.01)
    sliding = (run.s > 1e-3) & (run.t > 0.1)
    np.testing.assert_allclose(run.x[sliding, 1], -r * np.sqrt(run.s[sliding]), rtol=0.02)


SECOND = ("twisting", "quasi_continuous", "prescribed_convergence", "suboptimal")


def powers(law, d, plant=plant_b, duration=6.0):
    """The power of the period within which each state of a chain ends, and the runs."""
    runs = []
    for h in STEPS:
        runs.append(plant(law, d, h=h, duration=duration))
    ends = np.array([np.abs(run.x[-len(run.t) // 5 :]).max(axis=0) for run in runs])
    return np.log10(ends[0] / ends[2]) / DECADES, runs


@pytest.mark.parametrize("name", SECOND)
def test_discontinuous_laws_of_degree_2_are_accurate_to_the_second_power_of_the_period(name):
    exponents, runs = powers(law(name), HUM)
    assert exponents == pytest.approx([2.0, 1.0], abs=0.25)
    assert runs[1].reached(1e-3) < 4.0


@pytest.mark.parametrize(
    ("name", "power"),
    [
        ("terminal", 1 / 0.6),
        ("nonsingular_terminal", 1.6),
        ("nonsingular_fast_terminal", 1.6),
    ],
)
def test_terminal_laws_are_accurate_to_the_power_of_their_surface_or_better(name, power):
    """de = O(dt), and on the surface |e| goes as |de|^power."""
    assert power - 0.25 < powers(law(name), HUM)[0][0] < 2.1


def test_continuous_twisting_is_of_third_order_and_its_command_becomes_the_disturbance():
    exponents, runs = powers(law("continuous_twisting"), HUM)
    assert exponents == pytest.approx([3.0, 2.0], abs=0.25)
    late = runs[2].t > 4.0
    assert np.abs(runs[2].u + [HUM(t) for t in runs[2].t])[late].max() < 0.01


TERMINAL_LAWS = pytest.mark.parametrize(
    ("name", "speed"),
    [
        ("terminal", lambda g, e: g["b"] * e ** g["p"]),
        ("nonsingular_terminal", lambda g, e: (g["B"] * e) ** (1 / g["p"])),
        (
            "nonsingular_fast_terminal",
            lambda g, e: ((e + g["a"] * e ** g["q"]) / g["b"]) ** (1 / g["p"]),
        ),
    ],
)


@TERMINAL_LAWS
def test_without_the_model_k_must_cover_what_g_makes_of_the_equivalent_control_too(name, speed):
    """From the surface, g = 3, |f| = 1: s stays where k g > |f| + |g - 1| |eq|, and leaves where k
    g > |f| alone.
    """
    e = 1.5
    f = 1.0
    g = 3.0
    rule = law(name)
    start = (e, -speed(rule.gains, e))
    slid = surface(name)
    eq = call(slid, measured(*start), np.zeros(slid.memory))[1]
    needed = (abs(f) + (g - 1.0) * abs(eq)) / g
    for share, stays in (
        (1.1, True),
        (0.9, False),
    ):
        assert share * needed * g > abs(f)
        run = plant_b(
            law(name, k=share * needed),
            x=start,
            f=math.copysign(f, eq),
            g=g,
            duration=0.1,
        )
        assert (np.diff(np.sign(run.sigma[2:50])) != 0.0).any() == stays, share


@pytest.mark.parametrize(
    "name", ["twisting", "suboptimal", "terminal", "nonsingular_terminal", "continuous_twisting"]
)
def test_the_model_takes_the_plant_out_of_a_law_of_degree_2(name):
    """f = -9.81 and g = 4 known: the run is that of e'' = v + d."""
    bare = plant_b(law(name), HUM, duration=3.0)
    with_model = plant_b(
        law(name),
        HUM,
        duration=3.0,
        f=-9.81,
        g=4.0,
        model=1.0,
    )
    np.testing.assert_allclose(with_model.s, bare.s, atol=1e-3)
    assert (
        plant_b(
            law(name),
            HUM,
            duration=3.0,
            f=-9.81,
            g=1.0,
        ).residual()
        > 0.05
    )


# relative degree 3


def test_nested_law_of_degree_3_is_accurate_to_the_third_power_of_the_period():
    exponents, runs = powers(law("nested_third_order", a=5.0, w=1.0), sine(0.5, 2.0), plant_c, 10.0)
    assert exponents == pytest.approx([3.0, 2.0, 1.0], abs=0.3)
    assert runs[1].reached(1e-4) < 7.0


def test_observer_free_law_of_degree_3_is_locally_stable_just_where_its_condition_says():
    """On a mass behind a lag, J = 1: stable for (1 + lam) lam k2 > tau lam k1."""
    for tau, k1, k2, lam in (
        (0.05, 6.25, 5.0, 6.0),
        (2.0, 6.25, 5.0, 1.0),
        (2.0, 6.25, 8.0, 1.0),
        (1.0, 9.0, 1.0, 6.0),
    ):
        rule = law(
            "observer_free_third",
            lam=lam,
            k1=k1,
            k2=k2,
        )
        run = np.abs(
            plant_c(
                rule,
                x=(1e-6,) * 3,
                g=1 / tau,
                rates=(0.0, 0.0, -1 / tau),
                duration=20.0,
            ).s
        )
        assert ((1 + lam) * k2 > tau * k1) == (run[-4000:].max() < run[-12_000:-8000].max())


def third_order(L=1.0, **more):
    """Third-order super-twisting with the gains of Levant's differentiator for |d''| <= L."""
    gains = {"k1": 2.0 * L ** (1 / 3), "k2": 2.12 * L ** (2 / 3), "k3": 1.1 * L}
    return law("third_order_super_twisting", **gains, **more)


def test_third_order_super_twisting_is_of_third_order_and_its_integral_becomes_the_disturbance():
    load = sine(1.0) + constant(0.5)  # |d''| <= 1
    exponents, runs = powers(third_order(), load, plant_a, duration=20.0)
    assert exponents[0] == pytest.approx(3.0, abs=0.25)
    late = runs[2].t > 15.0
    assert np.abs(runs[2].u + [load(t) for t in runs[2].t])[late].max() < 0.01


def test_a_load_of_constant_rate_leaves_no_error_of_third_order_super_twisting_alone():
    """k3 > 0 is all that it needs, where super-twisting needs k2 above the rate."""
    for rule, stays in ((third_order(), False), (law("super_twisting", k1=3.0, k2=0.5), True)):
        run = plant_a(rule, ramp(0.8), duration=20.0)
        assert (run.residual() > 1e-3) == stays


def test_the_clamp_of_third_order_super_twisting_holds_both_integrals():
    run = plant_a(third_order(w_max=0.5), constant(0.8), duration=40.0)
    assert np.abs(run.memory[:, 0]).max() <= 0.5
    assert np.abs(run.memory[:, 1]).max() < 2.0
    below = [plant_a(third_order(w_max=w), constant(0.3)).residual() for w in (0.5, math.inf)]
    assert below[0] == pytest.approx(below[1], abs=1e-6)


def test_twisting_is_siconos_explicit_one():
    """An independent implementation, x'' = 19 x - 2 x' + u, u held over 50 ms: the published (x,
    x').
    """
    plant = smc.plant(
        "duffing",
        M=1.0,
        delta=2.0,
        alpha=-19.0,
        beta=0.0,
    )
    scenario = smc.Scenario(
        plant=plant,
        law=law("twisting", r1=300.0, r2=60.0),
        x0=-15.0,
        v0=20.0,
        control_period=0.05,
        physics_step=1e-3,
        u_max=math.inf,
        duration=1.5,
        integrator="RK4",
    )
    trace = smc.run(scenario)
    published = {
        0.05: (-14.09545908221278, 16.38486565996921),
        0.85: (2.395615641163373, 52.44596952716989),
        1.5: (-3.460806002951802, 6.786006803216882),
    }
    for t, state in published.items():
        k = round(t / 0.05)
        np.testing.assert_allclose(
            (trace.x[k, 0], trace.v[k, 0]),
            state,
            rtol=0,
            atol=1e-8,
        )
