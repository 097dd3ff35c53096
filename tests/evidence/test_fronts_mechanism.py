"""Why the fronts lie where they do, by integrations of the tests' own: the plants' equations and
RK4 in Python, with nothing of the suite but its laws.
"""

import cmath
import math
from collections.abc import Callable
from types import FunctionType, SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.control import gain_sets

H = 1e-3  # s
BOUND = 6.0  # N or N m


class Machine(NamedTuple):
    """x'' = force(x, v) + g (u + d), and its line at rest: x'' = a1 x + a2 v + g (u + d)."""

    force: Callable[[float, float], float]
    g: float
    a1: float
    a2: float
    wc: float  # rad/s, of the tuned ADRC
    x0: float


MACHINES = {
    "duffing": Machine(lambda x, v: x - x**3 - 0.2 * v, 1.0, 1.0, -0.2, 8.2, 1.5),
    "inverted_pendulum": Machine(
        lambda x, v: 19.62 * math.sin(x) - 0.16 * v, 8.0, 19.62, -0.16, 30.0, 0.5
    ),
}
# gains of a super-twisting law that hold 1 N at wc / 2, by plant
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


class Driven:
    """A law without a model, called sample by sample."""

    def __init__(self, name: str, gains: dict[str, float], bound: float = BOUND, function=None):
        law = smc.law(name)
        self.function = in_python(function or law.function)
        self.gains = SimpleNamespace(**{**law.gains, **gains})
        self.memory = np.zeros(max(1, law.memory))
        self.bound = bound

    def __call__(self, t: float, x: float, v: float, g: float) -> float:
        y = SimpleNamespace(t=t, dt=H, x=x, v=v, e=x, de=v, ddr=0.0, f=0.0, g=g)
        y.limit, y.model, y.has_surface = self.bound, 0.0, 0.0
        u, _ = self.function(y, self.gains, self.memory)
        return min(max(u, -self.bound), self.bound)


def run(law, machine, force=1.0, omega=0.0, seconds=6.0, start=0.0, noise=0.0):
    """Return x and u at every sample of a run under a load force sin(omega t + 0.3)."""
    steps = round(seconds / H)
    x, v = start, 0.0
    sensor = np.random.default_rng(3).normal(size=(steps, 2)) * (noise, 5.0 * noise)
    log = np.empty((steps, 2))

    def acceleration(x: float, v: float, u: float, t: float) -> float:
        return machine.force(x, v) + machine.g * (u + force * math.sin(omega * t + 0.3))

    for k in range(steps):
        t = k * H
        u = law(t, x + sensor[k, 0], v + sensor[k, 1], machine.g)
        log[k] = x, u
        a = acceleration(x, v, u, t)
        v2, x2 = v + 0.5 * H * a, x + 0.5 * H * v
        b = acceleration(x2, v2, u, t + 0.5 * H)
        v3, x3 = v + 0.5 * H * b, x + 0.5 * H * v2
        c = acceleration(x3, v3, u, t + 0.5 * H)
        v4, x4 = v + H * c, x + H * v3
        d = acceleration(x4, v4, u, t + H)
        x += H / 6 * (v + 2 * v2 + 2 * v3 + v4)
        v += H / 6 * (a + 2 * b + 2 * c + d)
    return log.T


def late(x: np.ndarray, omega: float) -> float:
    """Return the rms of the last periods, of 2 s or one at least."""
    period = math.tau / omega
    return float(np.sqrt(np.mean(x[-round(max(1, round(2.0 / period)) * period / H) :] ** 2)))


def response(law: Driven, machine: Machine, omega: float) -> complex:
    """Return C of a law alone, u = -C x, from a sine of 1e-6 that it is driven with."""
    periods = max(4, math.ceil(3.0 * omega / math.tau))
    last = round(periods * math.tau / omega / H)
    total = 0.0 + 0.0j
    for k in range(2 * last):
        t = k * H
        x, v = 1e-6 * math.sin(omega * t), 1e-6 * omega * math.cos(omega * t)
        u = law(t, x, v, machine.g)
        if k >= last:
            total += u * cmath.exp(-1j * omega * t)
    held = cmath.exp(-0.5j * omega * H)  # u is constant over a period
    return -2j * total / last / 1e-6 * held


@pytest.mark.parametrize("plant", MACHINES)
@pytest.mark.parametrize(
    "law", ["boundary_layer", "observer_free", "adrc", "pd_observer", "pid", "lqi"]
)
def test_below_its_bounds_a_continuous_law_is_its_gain_at_the_loads_frequency(law, plant):
    """|x| = D |G / (1 + G C)| of nine in ten sets within 10 %, whatever the law is called.

    A smooth sliding law with less error than that would show that its surface counts.
    """
    machine = MACHINES[plant]
    ratios = []
    for i, ratio in enumerate((0.5, 1.0, 2.0)):
        omega = ratio * machine.wc
        gains = dict(gain_sets.law(plant, law, seed=i).gains)
        C = response(Driven(law, gains, bound=1e9), machine, omega)
        line = (1j * omega) ** 2 - machine.a2 * 1j * omega - machine.a1
        predicted = 0.3 * machine.g / abs(line + machine.g * C) / math.sqrt(2.0)
        x, u = run(Driven(law, gains), machine, 0.3, omega, seconds=5.0)
        assert np.abs(u[-2000:]).max() < BOUND
        ratios.append(late(x, omega) / predicted)
    assert np.abs(np.array(ratios) - 1.0).max() < 0.1, ratios


def softened(y, gains, memory):
    """Super-twisting with a slope of width eps in place of the sign in its integral."""
    s = y.de + gains.c * y.e
    u = -gains.k1 * math.copysign(math.sqrt(abs(s)), s) + memory[0]
    memory[0] -= y.dt * gains.k2 * min(max(s / gains.eps, -1.0), 1.0)
    return u, s


@pytest.mark.parametrize("plant", MACHINES)
@pytest.mark.parametrize("factor", [1.0, 1.4])
def test_the_error_of_super_twisting_grows_with_the_width_of_its_integrals_slope(factor, plant):
    """So its steep integral of bounded rate is what leads, and an eps whose error does not grow
    would show that it is not. The widths lie beyond the cycle that the sampled sign has anyway.
    """
    machine = MACHINES[plant]
    omega = 0.5 * machine.wc
    gains = {name: factor * value for name, value in TWISTING[plant].items()}
    laws = [Driven("super_twisting", gains)]
    for eps in (1e-3, 1e-2, 0.1, 1.0):
        laws.append(Driven("super_twisting", {**gains, "eps": eps}, function=softened))
    errors = [late(run(law, machine, 1.0, omega)[0], omega) for law in laws]
    assert errors == sorted(errors)
    assert errors[-1] > 10.0 * errors[0]


def test_the_price_of_noise_in_J_ends_where_that_of_a_quiet_sensor_does_not():
    """From a slope of 150 N s/m on, the command jumps from bound to bound in J's run with noise, and
    three times the slope costs nothing there. With a tenth of the noise it costs twice as much.
    """
    machine = MACHINES["duffing"]
    variation: dict[float, list[float]] = {}
    for noise in (0.01, 1e-3):
        for slope in (150.0, 450.0):
            law = Driven("boundary_layer", {"k": BOUND, "c": 4.0, "phi": BOUND / slope})
            _, u = run(law, machine, 0.0, noise=noise, seconds=3.0)
            variation.setdefault(noise, []).append(float(np.abs(np.diff(u)).mean()))
    assert variation[0.01][1] < 1.25 * variation[0.01][0]
    assert variation[1e-3][1] > 2.0 * variation[1e-3][0]


@pytest.mark.parametrize("plant", MACHINES)
def test_the_lead_of_super_twisting_ends_where_the_load_is_faster_than_its_integral(plant):
    """At D omega = 0.6 k2 its error is a hundredth of that at 1.7 k2."""
    machine = MACHINES[plant]
    gains = TWISTING[plant]
    errors = []
    for share in (0.6, 1.7):
        omega = 0.5 * machine.wc
        force = share * gains["k2"] / omega
        errors.append(late(run(Driven("super_twisting", gains), machine, force, omega)[0], omega))
    assert errors[0] < 0.01 * errors[1]
