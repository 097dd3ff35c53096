"""Integrator chains on which laws are held to their theorems, sampled without error.

Plant A is s' = f + g u + d, plant B is x1' = x2, x2' = f + g u + d, plant C has one integrator more; f and g are
constant, u is held between samples, and the integrals of d are given in closed form, so a run is exact to rounding.

    plant_a(smc.law("classical", k=2.0), wave).residual()
    plant_b(smc.law("twisting"), sine(0.5, 2.0) + constant(0.1), x=(1.0, 0.0), f=-9.81, g=2.0, model=1.0)

A law of degree 1 sees plant A's s as what a surface gives, with eq = 0; a law of higher degree has no use for it. On
plant B laws see e = x1, de = x2, on plant C also a = x3. The reference is 0.
"""

import dataclasses
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from smc_mujoco.common.rebuild import rebuild
from smc_mujoco.control.law import Law, Measurement
from smc_mujoco.simulation import reference


@dataclasses.dataclass(frozen=True)
class Force:
    """A disturbance d(t): integral(n, t) is its n-th repeated integral, n = 0 .. 3, with any constants."""

    integral: Callable[[int, float], float]

    def __call__(self, t: float) -> float:
        return self.integral(0, t)

    def __add__(self, other: "Force") -> "Force":
        return Force(lambda n, t: self.integral(n, t) + other.integral(n, t))


def constant(size: float) -> Force:
    return Force(lambda n, t: size * t**n / math.factorial(n))


def ramp(rate: float) -> Force:
    return Force(lambda n, t: rate * t ** (n + 1) / math.factorial(n + 1))


def sine(size: float, omega: float = 1.0) -> Force:
    return Force(lambda n, t: size * omega**-n * math.sin(omega * t - n * math.pi / 2))


T, X, V, E, DE, A, SURFACED, S = map(Measurement._fields.index, ("t", "x", "v", "e", "de", "a", "has_surface", "s"))

rest = constant(0.0)
wave = sine(1.0) + constant(0.5)  # |d| <= 1.5, |d'| <= 1


def measured(e=0.0, de=0.0, dt=1e-3, f=0.0, g=1.0, t=0.0, a=0.0, limit=math.inf, model=0.0):
    """What a law sees with the reference at 0 and no surface."""
    return Measurement(
        t=t, dt=dt, x=e, v=de, e=e, de=de, r=0.0, dr=0.0, ddr=0.0, f=f, g=g, a=a, limit=limit, model=model
    )


def on_surface(s, dt=1e-3, eq=0.0, **y):
    """What a law sees whose scenario has a surface; e = 0, de = s for laws that take none."""
    return measured(de=s, dt=dt, **y)._replace(has_surface=1.0, s=s, v_eq=eq)


def called(law: Law, y: Measurement, memory: np.ndarray):
    """u and s of a law that keeps its memory."""
    assert law.function is not None
    return law.function(y, reference.gains_of(law), memory)


def one(law: Law, **y):
    """A law's first u and s from e, de and the rest of `measured`."""
    return called(law, measured(**y), np.zeros(law.memory))


class Sampled(NamedTuple):
    """A run: t (K,), the chain's states x (K, n), commanded u and the law's own s (K,) and its memory (K, m), before
    each sample."""

    t: np.ndarray
    x: np.ndarray
    u: np.ndarray
    sigma: np.ndarray
    memory: np.ndarray

    @property
    def s(self) -> np.ndarray:
        """The first state: s of plant A, x1 of plant B."""
        return self.x[:, 0]

    def residual(self) -> float:
        """Largest |first state| in the last 20 % of the run."""
        return float(np.abs(self.s[-len(self.s) // 5 :]).max())

    def reached(self, band: float) -> float:
        """Time from which |first state| stays within a band; inf if it does not."""
        outside = np.flatnonzero(np.abs(self.s) > band)
        if not outside.size:
            return 0.0
        return float(self.t[outside[-1] + 1]) if outside[-1] + 1 < self.t.size else math.inf

    def variation(self) -> float:
        """Total variation of u in the last 20 % of the run."""
        return float(np.abs(np.diff(self.u[-len(self.u) // 5 :])).sum())


def chain(law, d, x, h, duration, sign=1.0, noise=None, f=0.0, g=1.0, model=0.0, limit=math.inf, dt=None):
    """A chain of len(x) = 1, 2 or 3 integrators under a law.

    Args:
      d: Force.
      x: initial state.
      h: control period, s; dt: what the law is told of it, h unless given.
      sign: -1 turns the control round.
      noise: (K,) or (K, n), added to the state that the law sees.
      f, g: constants of the plant; model: 1 where the law may use them.
      limit: bound on |u|.
    """
    count, n = round(duration / h), len(x)
    function, gains, memory = rebuild(law.function, lambda f: f), reference.gains_of(law), [0.0] * law.memory
    errors = None if noise is None else np.broadcast_to(np.reshape(noise, (count, -1)), (count, n)).tolist()
    taylor = [h**j / math.factorial(j) for j in range(n + 1)]
    # plain lists and one tuple a sample: this loop is most of what the tests of laws take
    y = list(measured(dt=h if dt is None else dt, f=f, g=g, limit=limit, model=model))
    y[SURFACED] = float(n == 1)
    x, states, log, memories = [float(value) for value in x], [], [], []
    for k, kick in enumerate(kicked(d, n, h, count).tolist()):
        seen = x if errors is None else [value + error for value, error in zip(x, errors[k], strict=True)]
        y[T] = k * h
        if n == 1:
            y[V] = y[DE] = y[S] = seen[0]
        else:
            y[X] = y[E] = seen[0]
            y[V] = y[DE] = seen[1]
            y[A] = seen[2] if n == 3 else 0.0
        states.append(x)
        memories.append(memory.copy())
        u, s = function(Measurement._make(y), gains, memory)
        u = min(max(u, -limit), limit)
        log.append((u, s))
        x = moved(x, taylor, f + sign * g * u, kick)
    kept = np.array(memories, dtype=float).reshape(count, law.memory)
    return Sampled(np.arange(count) * h, np.array(states), *np.array(log, dtype=float).T.copy(), kept)


def moved(x, taylor, push, kick):
    """The states a period later, each by its Taylor series: written out, as a sum over j takes thrice the time."""
    if len(x) == 1:
        return [x[0] + taylor[1] * push + kick[0]]
    last = x[-1] + taylor[1] * push + kick[-1]
    if len(x) == 2:
        return [x[0] + taylor[1] * x[1] + taylor[2] * push + kick[0], last]
    first = x[0] + taylor[1] * x[1] + taylor[2] * x[2] + taylor[3] * push + kick[0]
    return [first, x[1] + taylor[1] * x[2] + taylor[2] * push + kick[1], last]


def kicked(d, n, h, count):
    """What d adds to each state over each period, (K, n): Taylor's remainder of its repeated integrals."""
    whole = np.array([[d.integral(m, k * h) for m in range(1, n + 1)] for k in range(count + 1)])  # integral m + 1
    kicks = np.empty((count, n))
    for i in range(n):
        m = n - i
        kicks[:, i] = whole[1:, m - 1] - sum(h**j / math.factorial(j) * whole[:-1, m - j - 1] for j in range(m))
    return kicks


def plant_a(law, d=rest, s=1.0, h=1e-3, duration=10.0, **options):
    """s' = f + g u + d from s; options as of `chain`."""
    return chain(law, d, (s,), h, duration, **options)


def plant_b(law, d=rest, x=(1.0, 0.0), h=1e-3, duration=10.0, **options):
    """x1' = x2, x2' = f + g u + d from x; options as of `chain`."""
    return chain(law, d, x, h, duration, **options)


def plant_c(law, d=rest, x=(1.0, 0.0, 0.0), h=1e-3, duration=10.0, **options):
    """x1' = x2, x2' = x3, x3' = f + g u + d from x; the law sees x3 as a. Options as of `chain`."""
    return chain(law, d, x, h, duration, **options)


def orders(law, d=wave, steps=(1e-2, 1e-3, 1e-4), plant=plant_a, duration=10.0, **options):
    """Order of the residual in the control period between each two steps, and the residuals."""
    residuals = np.array([plant(law, d, h=h, duration=duration, **options).residual() for h in steps])
    return np.diff(np.log(residuals)) / np.diff(np.log(steps)), residuals
