"""Integrator chains on which laws are held to their theorems, sampled without error.

Plant A is s' = f + g u + d, plant B is x1' = x2, x2' = f + g u + d, plant C has one integrator
more; f and g are constant, u is held between samples, and the integrals of d are given in closed
form, so a run is exact to rounding.

    plant_a(smc.law("classical", k=2.0), wave).residual()
    plant_b(smc.law("twisting"), sine(0.5, 2.0) + constant(0.1), x=(1.0, 0.0), f=-9.81, g=2.0,
    model=1.0)

A law of degree 1 sees plant A's s as what a surface gives, with eq = 0; a law of higher degree has
no use for it. On plant B laws see e = x1, de = x2, on plant C also a = x3. The reference is 0, or
moves at a constant speed; then the states are those of the error.
"""

import ctypes
import dataclasses
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from scipy.linalg import expm

from smc_mujoco.common.jit import call, pointer
from smc_mujoco.control.law import Law, Measurement
from smc_mujoco.simulation import cfunctions


@dataclasses.dataclass(frozen=True)
class Force:
    """A disturbance d(t): integral(n, t) is its n-th repeated integral, n = 0 .. 3, with any
    constants.
    """

    integral: Callable[[int, Any], Any]  # t and the result are numbers or arrays

    def __call__(self, t: Any) -> Any:
        return self.integral(0, t)

    def __add__(self, other: "Force") -> "Force":
        return Force(lambda n, t: self.integral(n, t) + other.integral(n, t))


def constant(size: float) -> Force:
    return Force(lambda n, t: size * t**n / math.factorial(n))


def ramp(rate: float) -> Force:
    return Force(lambda n, t: rate * t ** (n + 1) / math.factorial(n + 1))


def sine(size: float, omega: float = 1.0) -> Force:
    return Force(lambda n, t: size * omega**-n * np.sin(omega * t - n * math.pi / 2))


T, X, V, R, DR, E, DE, A, HAS_SURFACE, S = map(
    Measurement._fields.index, ("t", "x", "v", "r", "dr", "e", "de", "a", "has_surface", "s")
)

C_FUNCTION = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 4)

rest = constant(0.0)
wave = sine(1.0) + constant(0.5)  # |d| <= 1.5, |d'| <= 1


def measured(e=0.0, de=0.0, dt=1e-3, **more):
    """What a law sees with the reference at 0, f = 0, g = 1 and no surface, but for the fields in
    `more`.
    """
    zero = dict.fromkeys(("t", "r", "dr", "ddr", "f"), 0.0)
    return Measurement(
        **(
            zero
            | {
                "dt": dt,
                "x": e,
                "v": de,
                "e": e,
                "de": de,
                "g": 1.0,
            }
            | more
        )
    )


def on_surface(s, dt=1e-3, eq=0.0, **y):
    """What a law sees whose scenario has a surface; e = 0, de = s for laws that take none."""
    return measured(de=s, dt=dt, **y)._replace(has_surface=1.0, s=s, v_eq=eq)


def called(law: Law, y: Measurement, memory: np.ndarray):
    """u and s of a law that keeps its memory, compiled, as the callback calls it."""
    out = np.zeros(2)
    arrays = np.array(y), np.array([*law.gains.values(), 0.0]), memory, out
    function = C_FUNCTION(cfunctions.compile_component(law).address)
    assert not function(*(array.ctypes.data for array in arrays))
    return tuple(out)


def one(law: Law, **y):
    """A law's first u and s from e, de and the rest of `measured`."""
    return called(law, measured(**y), np.zeros(law.memory))


class Sampled(NamedTuple):
    """A run: t (K,), the chain's states x (K, n), commanded u and the law's own s (K,) and its
    memory (K, m), before each sample.
    """

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
        if outside[-1] + 1 < self.t.size:
            return float(self.t[outside[-1] + 1])
        return math.inf

    def variation(self) -> float:
        """Total variation of u in the last 20 % of the run."""
        return float(np.abs(np.diff(self.u[-len(self.u) // 5 :])).sum())


def chain(
    law,
    d,
    x,
    h,
    duration,
    sign=1.0,
    noise=None,
    f=0.0,
    g=1.0,
    model=0.0,
    limit=math.inf,
    reported=None,
    rates=None,
    memory=(),
    speed=0.0,
):
    """A chain of len(x) = 1, 2 or 3 integrators under a law.

    Args:
      d: Force.
      x: initial state.
      h: control period, s.
      sign: -1 turns the control round.
      noise: (K,) or (K, n), added to the state that the law sees.
      f, g: constants of the plant; model: 1 where the law may use them.
      limit: bound on |u|; reported: what the law is told of it, limit unless given.
      rates: of the last state by each state, (n,): with them a linear plant, without d.
      memory: the first cells of the law's memory at the start.
      speed: of the reference, of plants B and C.
    """
    count = round(duration / h)
    n = len(x)
    function = cfunctions.compile_component(law)  # as the callback calls it
    y = np.array(
        measured(
            dt=h,
            f=f,
            g=g,
            limit=limit if reported is None else reported,
            model=model,
        )
    )
    y[HAS_SURFACE] = float(n == 1)
    y[DR] = speed
    gains = np.array([*law.gains.values(), 0.0])
    out = np.zeros(2)
    cells = np.zeros(law.memory + 1)
    cells[: len(memory)] = memory
    shift = np.diag(np.ones(n), 1)  # of the states and the push, which is held
    if rates is not None:
        shift[n - 1, :n] = rates
    step, x = expm(h * shift)[:n].copy(), np.array(x, dtype=float)
    kicks = kicked(d, n, h, count)
    errors = np.zeros((count, n))
    if noise is None:
        errors += 0.0
    else:
        errors += np.reshape(noise, (count, -1))
    states = np.empty((count, n))
    log = np.empty((count, 2))
    memories = np.empty((count, law.memory))
    arrays = [y, gains, cells, out, x, step, kicks, errors, states, log, memories]
    numbers = h, f, sign * g, limit
    raised = _chain(
        function.address,
        *(a.ctypes.data for a in arrays),
        count,
        n,
        law.memory,
        *numbers,
    )
    assert not raised, f"{law.name} raised"
    return Sampled(np.arange(count) * h, states, *log.T.copy(), memories)


@njit
def _chain(
    law,
    y,
    gains,
    cells,
    out,
    x,
    step,
    kicks,
    errors,
    states,
    log,
    memories,
    count,
    n,
    size,
    h,
    f,
    g,
    limit,
):
    """Fill states, log (u, s) and memories of a chain, all by address, sample by sample.

    Return 1 if the law raised.
    """
    y_pointer = pointer(y)
    memory = pointer(cells)
    answer = pointer(out)
    state = pointer(x)
    moved = pointer(step)
    kick = pointer(kicks)
    noise = pointer(errors)
    states_pointer = pointer(states)
    logged = pointer(log)
    remembered = pointer(memories)
    for k in range(count):
        y_pointer[T], row = k * h, k * n
        first = state[0] + noise[row]
        if n == 1:
            y_pointer[V] = y_pointer[DE] = y_pointer[S] = first
        else:
            y_pointer[R] = y_pointer[DR] * y_pointer[T]
            y_pointer[E] = first
            y_pointer[X] = first + y_pointer[R]
            y_pointer[DE] = state[1] + noise[row + 1]
            y_pointer[V] = y_pointer[DE] + y_pointer[DR]
            y_pointer[A] = state[2] + noise[row + 2] if n == 3 else 0.0
        for i in range(n):
            states_pointer[row + i] = state[i]
        for i in range(size):
            remembered[k * size + i] = memory[i]
        if call(law, y, gains, cells, out) != 0:
            return 1
        u = min(max(answer[0], -limit), limit)
        logged[2 * k], logged[2 * k + 1] = u, answer[1]
        for i in range(n):
            after = kick[row + i] + moved[i * (n + 1) + n] * (f + g * u)
            for j in range(n):
                after += moved[i * (n + 1) + j] * states_pointer[row + j]
            state[i] = after
    return 0


def kicked(d, n, h, count):
    """What d adds to each state over each period, (K, n):

    Taylor's remainder of its repeated integrals.
    """
    moments = [d.integral(m, np.arange(count + 1) * h) for m in range(1, n + 1)]  # integral m + 1
    kicks = np.empty((count, n))
    for i in range(n):
        m = n - i
        kicks[:, i] = moments[m - 1][1:] - sum(
            h**j / math.factorial(j) * moments[m - j - 1][:-1] for j in range(m)
        )
    return kicks


def plant_a(law, d=rest, s=1.0, h=1e-3, duration=10.0, **options):
    """s' = f + g u + d from s; options as of `chain`."""
    return chain(
        law,
        d,
        (s,),
        h,
        duration,
        **options,
    )


def plant_b(law, d=rest, x=(1.0, 0.0), h=1e-3, duration=10.0, **options):
    """x1' = x2, x2' = f + g u + d from x; options as of `chain`."""
    return chain(
        law,
        d,
        x,
        h,
        duration,
        **options,
    )


def plant_c(law, d=rest, x=(1.0, 0.0, 0.0), h=1e-3, duration=10.0, **options):
    """x1' = x2, x2' = x3, x3' = f + g u + d from x; the law sees x3 as a. Options as of `chain`."""
    return chain(
        law,
        d,
        x,
        h,
        duration,
        **options,
    )


def orders(law, d=wave, steps=(1e-2, 1e-3, 1e-4), plant=plant_a, duration=10.0, **options):
    """Order of the residual in the control period between each two steps, and the residuals."""
    residuals = np.array(
        [plant(law, d, h=h, duration=duration, **options).residual() for h in steps]
    )
    return np.diff(np.log(residuals)) / np.diff(np.log(steps)), residuals
