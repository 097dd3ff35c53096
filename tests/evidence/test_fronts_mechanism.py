"""Why the fronts lie where they do, by integrations of the tests' own: the plants' equations and
the midpoint rule in Python, with nothing of the suite but its laws.
"""

import cmath
import math
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.control import gain_sets

H, BOUND = 1e-3, 6.0  # s; N or N m
# x'' = force(x, v) + g (u + d), its line at rest a1 x + a2 v + g (u + d), and wc of the tuned ADRC
PLANTS = {
    "duffing": (lambda x, v: x - x**3 - 0.2 * v, 1.0, 1.0, -0.2, 8.2),
    "inverted_pendulum": (lambda x, v: 19.62 * math.sin(x) - 0.16 * v, 8.0, 19.62, -0.16, 30.0),
}
# gains of super-twisting that hold 1 N at wc / 2
TWISTING = {
    "duffing": {"k1": 6.9, "k2": 13.7, "c": 2.95},
    "inverted_pendulum": {"k1": 6.0, "k2": 25.0, "c": 8.0},
}


def in_python(function: Any) -> FunctionType:
    """Return a law's function with Python in place of every compiled one that it calls."""
    space = dict(function.__globals__)
    for name in function.__code__.co_names:
        if hasattr(space.get(name), "py_func"):
            space[name] = in_python(space[name].py_func)
    return FunctionType(function.__code__, space)


def driven(name, gains, g, limit=BOUND, function=None):
    """Return u of a law without a model as a function of t, x, v."""
    law = smc.law(name)
    called = in_python(function or law.function)
    values = SimpleNamespace(**{**law.gains, **gains})
    memory = np.zeros(max(1, law.memory))
    fixed = {"dt": H, "ddr": 0.0, "f": 0.0, "g": g, "limit": limit, "model": 0.0}

    def command(t, x, v):
        y = SimpleNamespace(t=t, x=x, v=v, e=x, de=v, has_surface=0.0, **fixed)
        return min(max(called(y, values, memory)[0], -limit), limit)

    return command


def run(law, plant, force, omega, seconds=5.0, noise=0.0):
    """Return x and u at every sample, from rest, under a load force sin(omega t + 0.3)."""
    f, g, *_ = PLANTS[plant]
    x = v = 0.0
    log = []
    sensor = np.random.default_rng(3).normal(size=(round(seconds / H), 2)) * (noise, 5.0 * noise)

    def acceleration(t, u, x, v):
        return f(x, v) + g * (u + force * math.sin(omega * t + 0.3))

    for k, (of_x, of_v) in enumerate(sensor.tolist()):
        u = law(k * H, x + of_x, v + of_v)
        log.append((x, u))
        middle = v + 0.5 * H * acceleration(k * H, u, x, v)
        v += H * acceleration(k * H + 0.5 * H, u, x + 0.5 * H * v, middle)
        x += H * middle
    return np.array(log).T


def late(x: np.ndarray, omega: float) -> float:
    """Return the rms of the last periods, of 2 s or one at least."""
    period = math.tau / omega
    return float(np.sqrt(np.mean(x[-round(max(1, round(2.0 / period)) * period / H) :] ** 2)))


def response(law, omega: float) -> complex:
    """Return C of a law alone, u = -C x, from a sine of 1e-6 that it is driven with."""
    last = round(max(4, math.ceil(3.0 * omega / math.tau)) * math.tau / omega / H)
    total = 0.0 + 0.0j
    for k in range(2 * last):
        turn = cmath.exp(1j * omega * k * H)
        u = law(k * H, 1e-6 * turn.imag, 1e-6 * omega * turn.real)
        total += (k >= last) * u / turn
    return -2j * total / last / 1e-6 * cmath.exp(-0.5j * omega * H)  # u is held for a period


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(
    "law", ["boundary_layer", "observer_free", "adrc", "pd_observer", "pid", "lqi"]
)
def test_below_its_bounds_a_continuous_law_is_its_gain_at_the_loads_frequency(law, plant):
    """|x| = D |G / (1 + G C)| within 10 %, whatever the law is called.

    A smooth sliding law with less error than that would show that its surface counts.
    """
    _, g, a1, a2, wc = PLANTS[plant]
    for search, ratio in enumerate((0.5, 2.0)):
        omega = ratio * wc
        gains = gain_sets.law(plant, law, seed=search).gains
        C = response(driven(law, gains, g, limit=1e9), omega)
        predicted = 0.3 * g / abs((1j * omega) ** 2 - a2 * 1j * omega - a1 + g * C)
        x, u = run(driven(law, gains, g), plant, 0.3, omega)
        assert np.abs(u[-2000:]).max() < BOUND
        assert late(x, omega) == pytest.approx(predicted / math.sqrt(2.0), rel=0.1)


def softened(y, gains, memory):
    """Super-twisting with a slope of width eps in place of the sign in its integral."""
    s = y.de + gains.c * y.e
    u = -gains.k1 * math.copysign(math.sqrt(abs(s)), s) + memory[0]
    memory[0] -= y.dt * gains.k2 * min(max(s / gains.eps, -1.0), 1.0)
    return u, s


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("factor", [1.0, 1.4])
def test_the_error_of_super_twisting_grows_with_the_width_of_its_integrals_slope(factor, plant):
    """So its steep integral of bounded rate is what leads, and an eps whose error does not grow
    would show that it is not. The widths lie beyond the cycle that the sampled sign has anyway.
    """
    _, g, *_, wc = PLANTS[plant]
    gains = {name: factor * value for name, value in TWISTING[plant].items()}
    laws = [driven("super_twisting", gains, g)]
    for eps in (1e-3, 1e-2, 0.1, 1.0):
        laws.append(driven("super_twisting", {**gains, "eps": eps}, g, function=softened))
    errors = [late(run(law, plant, 1.0, 0.5 * wc, seconds=4.0)[0], 0.5 * wc) for law in laws]
    assert errors == sorted(errors)
    assert errors[-1] > 10.0 * errors[0]


def test_the_price_of_noise_in_J_ends_where_that_of_a_quiet_sensor_does_not():
    """From a slope of 150 N s/m on, the command jumps from bound to bound in J's run with noise, and
    three times the slope costs nothing there. With a tenth of the noise it costs twice as much.
    """
    grows = []
    for noise in (0.01, 1e-3):
        variation = []
        for slope in (150.0, 450.0):
            law = driven("boundary_layer", {"k": BOUND, "c": 4.0, "phi": BOUND / slope}, 1.0)
            _, u = run(law, "duffing", 0.0, 1.0, seconds=2.0, noise=noise)
            variation.append(np.abs(np.diff(u)).mean())
        grows.append(variation[1] / variation[0])
    assert grows[0] < 1.25
    assert grows[1] > 2.0
