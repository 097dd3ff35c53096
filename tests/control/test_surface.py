"""Surfaces: what eq keeps, what the error does on s = 0, and first-order laws on every one of them.

On a free mass, which is the double integrator e'' = u + d, unless a test names a plant.
"""

import itertools
import math

import numpy as np
import pytest
from helpers.plants_ab import measured
from helpers.runs import free_mass
from scipy.integrate import quad

import smc_mujoco as smc
from smc_mujoco.control.law import laws
from smc_mujoco.control.surface import surface
from smc_mujoco.simulation import python_functions

pytestmark = pytest.mark.quick

SURFACES = pytest.mark.parametrize("name", laws(kind="surface"))
# those that an acceleration of the error keeps
SECOND = [name for name in laws(kind="surface") if name != "higher_order"]
MASS = free_mass()
HUM = smc.Sine(amplitude=0.4, omega=3.0)
SHAKEN = 1.2e-3 * 3.0  # bound on s from sampling: (k + D) dt for k = 2, and half as much again


def at(slid, memory, e, de, t=0.0, a=0.0, h=1e-3):
    """s and eq of a surface."""
    return slid.function(measured(e, de, dt=h, t=t, a=a), python_functions.gains_of(slid), memory)


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
    """From any state, one short step under e'' = eq changes s by O(h^2), and under another e'' by
    O(h).
    """
    slid = surface(name)
    h = 1e-6
    random = np.random.default_rng(0)
    for _ in range(100):
        e, de = np.sign(random.normal(size=2)) * random.uniform(0.2, 1.5, size=2)
        for extra in (0.0, 1.0):
            memory = np.zeros(slid.memory)
            t = 0.0
            for before in random.normal(size=(3, 2)):
                at(slid, memory, *before, t=t, h=h)
                t += h
            s, eq = at(slid, memory, e, de, t=t, h=h)
            a = eq + extra
            moved, _ = at(
                slid,
                memory,
                e + h * de + h * h * a / 2,
                de + h * a,
                t=t + h,
                h=h,
            )
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
        assert at(
            slid,
            mirrored,
            -e,
            -de,
            t=k * 1e-3,
            a=-a,
        ) == (-s, -eq)
        assert at(slid, rest, 0.0, 0.0, t=k * 1e-3) == (0.0, 0.0)


def second_order(k2, k1, v, t):
    """The response of e'' + k2 e' + k1 e = 0 from e = 1 and e' = v, for real poles."""
    fast, slow = sorted(np.roots([1.0, k2, k1]))
    return ((v - slow) * np.exp(fast * t) - (v - fast) * np.exp(slow * t)) / (fast - slow)


# e'(0), and e from e(0) = 1; the integral and the global surface have no reaching phase
RESPONSES = [
    ("linear", {"c": 2.0}, -2.0, lambda t: np.exp(-2.0 * t)),
    ("integral", {"k1": 2.0, "k2": 3.0}, 0.0, lambda t: second_order(3.0, 2.0, 0.0, t)),
    ("integral", {"k1": 2.0, "k2": 3.0}, 1.5, lambda t: second_order(3.0, 2.0, 1.5, t)),
    ("pid", {"kp": 3.0, "ki": 2.0}, -3.0, lambda t: second_order(3.0, 2.0, -3.0, t)),
    (
        "global_",
        {"c": 2.5, "q": 1.5},
        0.0,
        lambda t: np.exp(-2.5 * t) + 2.5 * (np.exp(-1.5 * t) - np.exp(-2.5 * t)),
    ),
]


@pytest.mark.parametrize(("name", "gains", "de", "due"), RESPONSES)
def test_from_its_surface_the_error_follows_the_closed_form(name, gains, de, due):
    trace = slide(name, de=de, **gains)
    assert np.abs(trace.s).max() <= SHAKEN
    np.testing.assert_allclose(trace.x[:, 0], due(trace.t), atol=2 * SHAKEN)


TERMINAL = [  # speed on s = 0, and the time it takes from e
    (
        "terminal",
        lambda g, e: g["b"] * e ** g["p"],
        lambda g, e: e ** (1 - g["p"]) / (g["b"] * (1 - g["p"])),
    ),
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
    (
        "nonsingular_fast_terminal",
        lambda g, e: ((e + g["a"] * e ** g["q"]) / g["b"]) ** (1 / g["p"]),
        None,
    ),
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
    assert at(slid, np.zeros(slid.memory), e, -speed(slid.gains, e))[0] == pytest.approx(
        0.0, abs=1e-12
    )
    duration = quad(lambda r: 1 / speed(slid.gains, r), 0.0, e)[0]
    if due is not None:
        assert due(slid.gains, e) == pytest.approx(duration, rel=1e-6)
    trace = slide(name, e=e, de=-speed(slid.gains, e))
    outside = np.flatnonzero(np.abs(trace.x[:, 0]) > 0.01)
    assert trace.t[outside[-1]] == pytest.approx(
        quad(lambda r: 1 / speed(slid.gains, r), 0.01, e)[0], rel=0.02
    )
    assert np.abs(trace.x[trace.t > 1.05 * duration + 0.05]).max() < 2e-3


def shares(name, law):
    """Ultimate bounds over the start, of a law on a surface, on three plants."""
    plants = ("duffing", "van_der_pol", "inverted_pendulum")
    runs = []
    for p in plants:
        runs.append(
            smc.Scenario(
                plant=p,
                law=law,
                surface=name,
                duration=8.0,
                integrator="Euler",
            )
        )
    traces = smc.run(runs)
    for trace in traces:
        assert not trace.failure
    return [smc.score(trace)["ultimate_bound"] / np.abs(trace.x[0]).max() for trace in traces]


@pytest.mark.parametrize(
    ("name", "law"),
    list(
        zip(laws(kind="surface"), itertools.cycle(["observer_free", "boundary_layer", "classical"]))
    ),
)
def test_first_order_laws_settle_every_plant_on_every_surface(name, law):
    if name.startswith("nonsingular"):
        law = "classical"
    assert max(shares(name, law)) <= 0.05


def test_the_surface_of_order_3_holds_its_polynomial_on_s_equal_to_zero():
    """An acceleration of eq lies on it, and with it e'' + k2 e' + k1 e = 0."""
    slid = surface("higher_order")
    for e, de in np.random.default_rng(0).normal(size=(50, 2)):
        _, eq = at(slid, np.zeros(1), e, de)
        assert at(slid, np.zeros(1), e, de, a=eq)[0] == pytest.approx(0.0, abs=1e-12)
        assert eq == pytest.approx(-5.0 * de - 6.25 * e)


def test_memory_of_a_surface_belongs_to_a_channel_and_a_run():
    plant = smc.plant("pendulum_network", n=3, kc=0.0)
    scenario = smc.Scenario(
        plant=plant,
        law=smc.law("classical"),
        surface="integral",
        x0=(0.5, 0.0, -0.5),
        duration=0.5,
    )
    trace, again = smc.run([scenario, scenario])
    assert not trace.x[:, 1].any()
    np.testing.assert_array_equal(trace.x[:, 2], -trace.x[:, 0])
    np.testing.assert_array_equal(trace.u, again.u)
