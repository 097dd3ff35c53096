"""Surfaces: what eq keeps, what the error does on s = 0, and first-order laws on every one of them.

On a free mass, which is the double integrator e'' = u + d, unless a test names a plant.
"""

import itertools
import math

import numpy as np
import pytest
from helpers.plants_ab import measured
from scipy.integrate import quad

import smc_mujoco as smc
from smc_mujoco.control.law import laws
from smc_mujoco.control.surface import surface
from smc_mujoco.simulation import python_controller

pytestmark = pytest.mark.quick

SURFACES = pytest.mark.parametrize("name", laws(kind="surface"))
SECOND = [
    name for name in laws(kind="surface") if name != "higher_order"
]  # those that an acceleration of the error keeps
MASS = smc.plant("duffing", M=1.0, alpha=0.0, beta=0.0, delta=0.0)
HUM = smc.Sine(amplitude=0.4, omega=3.0)
SHAKEN = 1.2e-3 * 3.0  # bound on s from sampling: (k + D) dt for k = 2, and half as much again


def at(slid, memory, e, de, t=0.0, a=0.0, h=1e-3):
    """s and eq of a surface."""
    return slid.function(measured(e, de, dt=h, t=t, a=a), python_controller.gains_of(slid), memory)


def slide(name, e=1.0, de=0.0, duration=6.0, k=2.0, disturbance=HUM, **gains):
    """The free mass under the classical law on a surface."""
    return smc.run(
        smc.Scenario(
            plant=MASS,
            law=smc.law("classical", k=k),
            surface=surface(name, **gains),
            x0=e,
            v0=de,
            duration=duration,
            disturbance=disturbance,
            u_max=math.inf,
        )
    )


@pytest.mark.parametrize("name", SECOND)
def test_eq_is_the_acceleration_that_keeps_s(name):
    """From any state, one short step under e'' = eq changes s by O(h^2), and under another e'' by O(h)."""
    slid, h, random = surface(name), 1e-6, np.random.default_rng(0)
    for _ in range(100):
        e, de = np.sign(random.normal(size=2)) * random.uniform(0.2, 1.5, size=2)
        for extra in (0.0, 1.0):
            memory, t = np.zeros(slid.memory), 0.0
            for before in random.normal(size=(3, 2)):
                at(slid, memory, *before, t=t, h=h)
                t += h
            s, eq = at(slid, memory, e, de, t=t, h=h)
            a = eq + extra
            moved, _ = at(slid, memory, e + h * de + h * h * a / 2, de + h * a, t=t + h, h=h)
            if extra:
                assert (moved - s) / h > 0.05
            else:
                assert abs(moved - s) / h < 2e-3


@SURFACES
def test_eq_is_finite_everywhere(name):
    slid = surface(name)
    values = [0.0, 5e-324, 1e-300, 1e-12, 1.0, 1e3, 1e6]
    for e in values:
        for de in values:
            for sign in (1.0, -1.0):
                assert np.isfinite(at(slid, np.zeros(slid.memory), sign * e, de)).all()


@SURFACES
def test_every_surface_is_odd_and_zero_at_rest(name):
    slid = surface(name)
    ours, mirrored, rest = (np.zeros(slid.memory) for _ in range(3))
    for k, (e, de, a) in enumerate(np.random.default_rng(0).normal(size=(200, 3))):
        s, eq = at(slid, ours, e, de, t=k * 1e-3, a=a)
        assert at(slid, mirrored, -e, -de, t=k * 1e-3, a=-a) == (-s, -eq)
        assert at(slid, rest, 0.0, 0.0, t=k * 1e-3) == (0.0, 0.0)


def test_on_the_linear_surface_the_error_decays_at_c():
    trace = slide("linear", de=-2.0, c=2.0)
    np.testing.assert_allclose(trace.x[:, 0], np.exp(-2.0 * trace.t), atol=2 * SHAKEN / 2.0)


def second_order(k2, k1, t):
    """The response of e'' + k2 e' + k1 e = 0 from e = 1 at rest, for real poles."""
    fast, slow = np.roots([1.0, k2, k1])
    return (fast * np.exp(slow * t) - slow * np.exp(fast * t)) / (fast - slow)


def test_the_integral_surface_has_no_reaching_phase_and_leaves_the_nominal_response():
    trace = slide("integral", k1=2.0, k2=3.0)
    assert np.abs(trace.s[:, 0]).max() <= SHAKEN
    np.testing.assert_allclose(trace.x[:, 0], second_order(3.0, 2.0, trace.t), atol=2 * SHAKEN)
    moving = slide("integral", de=1.5)
    assert np.abs(moving.s[:, 0]).max() <= SHAKEN
    assert np.abs(slide("linear").s[:500, 0]).min() > 0.5  # as the linear surface has


def test_on_the_pid_surface_the_error_follows_its_polynomial():
    """From s(0) = 0: de = -kp e, with e'(0) as it is."""
    kp, ki = 3.0, 2.0
    trace = slide("pid", de=-kp, kp=kp, ki=ki)
    fast, slow = sorted(np.roots([1.0, kp, ki]))
    due = ((-kp - slow) * np.exp(fast * trace.t) - (-kp - fast) * np.exp(slow * trace.t)) / (fast - slow)
    np.testing.assert_allclose(trace.x[:, 0], due, atol=2 * SHAKEN)
    assert np.abs(trace.s[:, 0]).max() <= SHAKEN


def test_the_global_surface_has_no_reaching_phase_and_becomes_the_linear_one():
    c, q = 2.5, 1.5
    trace = slide("global_", c=c, q=q)
    assert np.abs(trace.s[:, 0]).max() <= SHAKEN
    t, s0 = trace.t, c
    due = np.exp(-c * t) + s0 * (np.exp(-q * t) - np.exp(-c * t)) / (c - q)
    np.testing.assert_allclose(trace.x[:, 0], due, atol=2 * SHAKEN)
    assert np.abs(trace.v + c * trace.x)[-1, 0] < s0 * math.exp(-q * 6.0) + SHAKEN


TERMINAL = [  # speed on s = 0, and the time it takes from e
    ("terminal", lambda g, e: g["b"] * e ** g["p"], lambda g, e: e ** (1 - g["p"]) / (g["b"] * (1 - g["p"]))),
    (
        "fast_terminal",
        lambda g, e: g["a"] * e + g["b"] * e ** g["p"],
        lambda g, e: math.log(1 + g["a"] * e ** (1 - g["p"]) / g["b"]) / (g["a"] * (1 - g["p"])),
    ),
    (
        "nonsingular_terminal",
        lambda g, e: (g["B"] * e) ** (1 / g["p"]),
        lambda g, e: e ** (1 - 1 / g["p"]) / (g["B"] ** (1 / g["p"]) * (1 - 1 / g["p"])),
    ),
    ("nonsingular_fast_terminal", lambda g, e: ((e + g["a"] * e ** g["q"]) / g["b"]) ** (1 / g["p"]), None),
    (
        "predefined_time",
        lambda g, e: math.exp(e ** g["p"]) * e ** (1 - g["p"]) / (g["p"] * g["T"]),
        lambda g, e: g["T"] * (1 - math.exp(-(e ** g["p"]))),
    ),
]


@pytest.mark.parametrize(
    ("name", "speed", "due", "e"),
    [(*row, e) for row, e in zip(TERMINAL, itertools.cycle([0.3, 2.0, 1.0]))],
    ids=[row[0] for row in TERMINAL],
)
def test_on_a_terminal_surface_the_error_ends_at_the_stated_time(name, speed, due, e):
    slid = surface(name)
    assert at(slid, np.zeros(slid.memory), e, -speed(slid.gains, e))[0] == pytest.approx(0.0, abs=1e-12)
    whole = quad(lambda r: 1 / speed(slid.gains, r), 0.0, e)[0]
    if due is not None:
        assert due(slid.gains, e) == pytest.approx(whole, rel=1e-6)
    trace = slide(name, e=e, de=-speed(slid.gains, e))
    outside = np.flatnonzero(np.abs(trace.x[:, 0]) > 0.01)
    assert trace.t[outside[-1]] == pytest.approx(quad(lambda r: 1 / speed(slid.gains, r), 0.01, e)[0], rel=0.02)
    assert np.abs(trace.x[trace.t > 1.05 * whole + 0.05]).max() < 2e-3


def shares(name, law):
    """Ultimate bounds over the start, of a law on a surface, on three plants."""
    plants = ("duffing", "van_der_pol", "inverted_pendulum")
    runs = [smc.Scenario(plant=p, law=law, surface=name, duration=8.0, integrator="Euler") for p in plants]
    traces = smc.run(runs)
    assert not any(trace.failure for trace in traces)
    return [smc.score(trace)["ultimate_bound"] / np.abs(trace.x[0]).max() for trace in traces]


@pytest.mark.parametrize(
    ("name", "law"), list(zip(laws(kind="surface"), itertools.cycle(["observer_free", "boundary_layer", "classical"])))
)
def test_first_order_laws_settle_every_plant_on_every_surface(name, law):
    if name.startswith("nonsingular"):
        law = "classical"
    assert max(shares(name, law)) <= 0.05


def test_tanh_leaves_an_error_on_non_singular_terminal_surfaces():
    """There s is a length, of which its layer takes 1 whole unit."""
    found = shares("nonsingular_terminal", "observer_free")
    assert found[0] < 0.05 < found[2] < 0.2


@pytest.mark.parametrize("law", ["classical", "boundary_layer", "observer_free", "super_twisting"])
def test_first_order_laws_take_the_surface_of_order_3_behind_an_actuator_lag(law):
    common = {
        "surface": "higher_order",
        "actuator": smc.Lag(0.05),
        "velocity": smc.estimator("levant", order=2, L=200.0),
    }
    for trace in smc.run([smc.Scenario(plant=p, law=law, **common) for p in ("duffing", "van_der_pol")]):
        assert trace.failure is None
        assert smc.score(trace)["ultimate_bound"] <= 0.05 * np.abs(trace.x[0]).max()


def test_the_surface_of_order_3_holds_its_polynomial_on_s_equal_to_zero():
    """An acceleration of eq lies on it, and with it e'' + k2 e' + k1 e = 0."""
    slid = surface("higher_order")
    for e, de in np.random.default_rng(0).normal(size=(50, 2)):
        _, eq = at(slid, np.zeros(1), e, de)
        assert at(slid, np.zeros(1), e, de, a=eq)[0] == pytest.approx(0.0, abs=1e-12)
        assert eq == pytest.approx(-5.0 * de - 6.25 * e)


def test_the_surface_replaces_the_laws_own():
    """c of the law is of no account, and the trace's s is the surface's."""
    common = {"plant": "duffing", "duration": 0.5, "surface": surface("linear", c=2.0)}
    one, other = smc.run([smc.Scenario(law=smc.law("classical", c=c), **common) for c in (1.0, 9.0)])
    np.testing.assert_array_equal(one.u, other.u)
    np.testing.assert_allclose(one.s, one.v + 2.0 * one.x, atol=1e-12)


def test_memory_of_a_surface_belongs_to_a_channel_and_a_run():
    plant = smc.plant("pendulum_network", n=3, kc=0.0)
    scenario = smc.Scenario(plant=plant, law="classical", surface="integral", x0=(0.5, 0.0, -0.5), duration=0.5)
    trace, again = smc.run([scenario, scenario])
    assert not trace.x[:, 1].any()
    np.testing.assert_array_equal(trace.x[:, 2], -trace.x[:, 0])
    np.testing.assert_array_equal(trace.u, again.u)
