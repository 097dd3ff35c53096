"""Sums of signals of time, and the extremes of a signal."""

import dataclasses
from collections import namedtuple

import numpy as np
from numba import njit

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.simulation.signals import Constant, MinimumJerk, Ramp, Signal, Sine, Step

SAMPLES = 500  # of a reference, where its extremes are looked for; chosen


@dataclasses.dataclass(frozen=True)
class Sum(Signal):
    """The sum of constants, sines, steps, ramps and moves of minimum jerk."""

    signals: tuple[Signal, ...]

    series = True
    rows = 4  # the number of the kind in KINDS, and up to three parameters

    def __post_init__(self):
        table = np.zeros((self.rows, len(self.signals)))
        for column, signal in zip(table.T, self.signals, strict=True):
            if type(signal) not in KINDS or getattr(signal, "about", ""):
                names = ", ".join(kind.__name__ for kind in KINDS)
                raise ScenarioError(
                    f"{shown(signal)} cannot be added to a signal: give one of {names}"
                )
            numbers = list(signal.parameters().values())
            column[0] = KINDS.index(type(signal))
            column[1 : 1 + len(numbers)] = numbers
        object.__setattr__(self, "data", table)
        self.data.flags.writeable = False

    def __reduce__(self):  # a copy has separate data, also read-only
        return type(self), (self.signals,)

    def parameters(self) -> dict[str, float]:
        return {}  # each signal has its own

    @staticmethod
    def value(t, p, data):
        r, dr, ddr = 0.0, 0.0, 0.0
        for k in range(data.shape[1]):
            one = _part_of_sum(t, data[0, k], data[1, k], data[2, k], data[3, k])
            r += one[0]
            dr += one[1]
            ddr += one[2]
        return r, dr, ddr


KINDS = Constant, Sine, Step, Ramp, MinimumJerk  # what a Sum may have
_constant, _sine, _step, _ramp, _jerk = (njit(error_model="numpy")(kind.value) for kind in KINDS)
_Constant, _Sine, _Step, _Ramp, _Jerk = (
    namedtuple(kind.__name__, [f.name for f in dataclasses.fields(kind)]) for kind in KINDS
)


@njit(error_model="numpy")
def _part_of_sum(t, kind, a, b, c):
    if kind == 0.0:
        return _constant(t, _Constant(a))
    if kind == 1.0:
        return _sine(t, _Sine(a, b, c))
    if kind == 2.0:
        return _step(t, _Step(a, b))
    if kind == 3.0:
        return _ramp(t, _Ramp(a, b))
    return _jerk(t, _Jerk(a, b, c))


def extremes(signal: Signal, duration: float) -> tuple[float, float]:
    """Return the least and the largest value of a signal of time among SAMPLES of a duration, s."""
    if isinstance(signal, Sum):
        parts = signal.signals
    elif signal.series:
        return float(signal.data[1].min()), float(signal.data[1].max())
    else:
        parts = (signal,)
    total = np.zeros(SAMPLES)
    for part in parts:
        for k, t in enumerate(np.linspace(0.0, duration, SAMPLES).tolist()):
            total[k] += type(part).value(t, part)[0]
    return float(total.min()), float(total.max())


def added(first: Signal, second: Signal) -> Sum:
    """Return the sum of two signals, which may be sums."""
    parts = []
    for signal in (first, second):
        parts += signal.signals if isinstance(signal, Sum) else (signal,)
    return Sum(tuple(parts))
