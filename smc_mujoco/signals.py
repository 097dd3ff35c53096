"""References r(t) and disturbances d(t): frozen data plus one pure function of time.

A signal is a frozen dataclass whose float fields are its parameters p and whose `value` is compiled. Deterministic
signals read `value(t, p) -> (r, r', r'')`; as a disturbance only the first is used. Process noise depends on the
channel, the seed and its own past, and reads `value(t, p, memory, seed, channel, stream)`: memory is its per-channel
state, stream tells it from the run's other noises.
Times in seconds, values in the unit of what the signal is added to (reference: m or rad; disturbance: N or N m).
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import ClassVar

from numba import njit

from smc_mujoco import noise
from smc_mujoco.errors import number
from smc_mujoco.frozen import frozen

EARLY = 1.0 - 1e-15  # sums and products of decimal times miss a sample's time by an ulp or two, to either side


@dataclasses.dataclass(frozen=True)
class Signal:
    """Base of all signals: checks that every parameter is a finite number."""

    memory: ClassVar[int] = 0  # floats of per-channel state
    positive: ClassVar[tuple[str, ...]] = ()  # parameters that must exceed 0
    random: ClassVar[bool] = False  # whether value takes memory, seed, channel and stream

    def __post_init__(self):
        for name, value in self.parameters().items():
            above = 0.0 if name in self.positive else -math.inf
            object.__setattr__(self, name, number(f"{type(self).__name__}'s {name}", value, above=above))

    def parameters(self) -> dict[str, float]:
        """Parameter name -> value."""
        return {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}

    value: ClassVar[Callable[..., tuple[float, float, float]]]  # a static method: value, first and second derivative


@dataclasses.dataclass(frozen=True)
class Constant(Signal):
    """r(t) = amplitude."""

    amplitude: float = 0.0

    @staticmethod
    def value(t, p):
        return p.amplitude, 0.0, 0.0


@dataclasses.dataclass(frozen=True)
class Sine(Signal):
    """r(t) = amplitude sin(omega t + phase); omega in rad/s."""

    amplitude: float
    omega: float
    phase: float = 0.0

    @staticmethod
    def value(t, p):
        angle = p.omega * t + p.phase
        r = p.amplitude * math.sin(angle)
        return r, p.amplitude * p.omega * math.cos(angle), -p.omega * p.omega * r


@dataclasses.dataclass(frozen=True)
class Step(Signal):
    """0 before `time`, amplitude from then on."""

    amplitude: float
    time: float = 0.0

    @staticmethod
    def value(t, p):
        return (p.amplitude if t >= p.time * EARLY else 0.0), 0.0, 0.0


@dataclasses.dataclass(frozen=True)
class Pulse(Signal):
    """amplitude for time <= t < time + width, else 0."""

    amplitude: float
    time: float
    width: float

    positive = ("width",)

    @staticmethod
    def value(t, p):
        on = p.time * EARLY <= t < (p.time + p.width) * EARLY
        return (p.amplitude if on else 0.0), 0.0, 0.0


@dataclasses.dataclass(frozen=True)
class OrnsteinUhlenbeck(Signal):
    """Process noise with standard deviation sigma and correlation time tau, independent in every channel.

    d_(k+1) = a d_k + sigma sqrt(1 - a^2) n_k, a = exp(-dt/tau), on knots dt apart and linear between them: the exact
    discretisation (Gillespie 1996, Phys. Rev. E 54:2084), stationary from the start. The knots are its own, so
    the path is the same under every physics step and control period. `dt` defaults to 1 ms.
    """

    sigma: float
    tau: float
    dt: float = 1e-3

    memory = 3  # next knot, value at the last knot, value at the next
    positive = ("tau", "dt")
    random = True

    def __post_init__(self):
        super().__post_init__()
        number("OrnsteinUhlenbeck's sigma", self.sigma, least=0.0)

    @staticmethod
    def value(t, p, memory, seed, channel, stream):
        return _ornstein_uhlenbeck(t, p.sigma, p.tau, p.dt, memory, seed, channel, stream), 0.0, 0.0


@njit(error_model="numpy")
def _ornstein_uhlenbeck(t, sigma, tau, dt, memory, seed, channel, stream):
    knot = t / dt
    if memory[0] == 0.0:
        memory[2] = sigma * noise.normals(seed, channel, stream, 0)[0]
    a = math.exp(-dt / tau)
    while memory[0] <= knot:
        memory[1] = memory[2]
        memory[0] += 1.0
        memory[2] = a * memory[1] + sigma * math.sqrt(1.0 - a * a) * noise.normals(seed, channel, stream, memory[0])[0]
    return memory[2] + (memory[0] - knot) * (memory[1] - memory[2])


@dataclasses.dataclass(frozen=True)
class Recorded(Signal):
    """A signal that a file names and that is not at hand: its parameters without its function; it cannot run."""

    kind: str
    module: str
    values: Mapping[str, float]

    def parameters(self) -> dict[str, float]:
        """Parameter name -> value, as recorded."""
        return dict(self.values)

    def __post_init__(self):
        object.__setattr__(self, "values", frozen(self.values))


def kinds() -> list[type[Signal]]:
    """Every kind of signal, users' own included."""
    found = Signal.__subclasses__()
    for kind in found:
        found.extend(kind.__subclasses__())
    return found
