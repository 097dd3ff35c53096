"""Measurement noise, jumps of the plant's parameters during a run, and the controller's clock.

A real-time task is woken every control period T, some time after it should be. Sample k runs at

    t_k = k T + late_k,    late_k uniform among the physics steps from 0 to `jitter`,

or not at all: then the last command stays, and neither estimator nor law sees that sample. The first sample and the
last one are on time. Which samples are late or missed depends on the seed and k alone.
"""

import dataclasses
import math
from collections.abc import Mapping

from smc_mujoco.common.errors import ScenarioError, number, shown
from smc_mujoco.common.frozen import Frozen, frozen
from smc_mujoco.simulation.signals import PerChannel, Signal

MAX_MISSED = 0.99  # probability; chosen: of a hundred samples one runs


@dataclasses.dataclass(frozen=True)
class Noise:
    """Measurement noise: zero-mean and Gaussian, and errors that are known signals of time, the same in every channel.

    Attributes:
      position, velocity: standard deviations, in SI units.
      position_error, velocity_error: signals that are added to what is measured, such as Held(times, values).
    """

    position: float = 0.0
    velocity: float = 0.0
    position_error: Signal | None = dataclasses.field(default=None, repr=False)
    velocity_error: Signal | None = dataclasses.field(default=None, repr=False)

    def __post_init__(self):
        for name in ("position", "velocity"):
            object.__setattr__(self, name, number(f"Noise's {name}", getattr(self, name), low=0.0))
        for error in self.errors:
            is_signal = isinstance(error, Signal | None) and not isinstance(error, PerChannel)
            if not is_signal or (error and (error.random or error.cartesian or error.sees)):
                cure = "give a known signal, such as smc.Held(times, values)"
                raise ScenarioError(f"Noise's error is {shown(error)}: {cure}")

    @property
    def errors(self) -> tuple[Signal | None, Signal | None]:
        """The errors of position and velocity."""
        return self.position_error, self.velocity_error


@dataclasses.dataclass(frozen=True)
class Jump:
    """A change of the plant's parameters at `time`, s, for the rest of the run.

    `factors` has parameter names with the factors that multiply them. For parameters in `plant.added`, such as a
    payload, it has terms, which are added.
    """

    time: float
    factors: Mapping[str, float]

    def __post_init__(self):
        object.__setattr__(self, "time", number("Jump's time", self.time, low=0.0))
        object.__setattr__(self, "factors", parameter_factors("Jump", self.factors))


def parameter_factors(name: str, value: object) -> Frozen[float]:
    """Return parameter name -> factor, checked; `name` is for errors."""
    if not isinstance(value, Mapping):
        raise ScenarioError(f"{name} is {shown(value)}: give parameter names with their factors, such as {{'M': 1.3}}")
    return frozen({str(key): number(f"{name} of {key}", factor) for key, factor in value.items()})


@dataclasses.dataclass(frozen=True)
class Clock:
    """The timer of the controller. A sensor with a clock of its own is an `Encoder` with a `period`.

    Attributes:
      jitter: s, the largest delay of a sample; shorter than the control period. Each sample is late by a whole number
        of physics steps, all equally probable. The law reads the true time in `y.t` and the nominal period in `y.dt`,
        as on a machine whose task does not measure its period.
      missed: probability that a sample is missed, 0 .. 0.99. The last command then stays.
    """

    jitter: float = 0.0
    missed: float = 0.0

    def __post_init__(self):
        object.__setattr__(self, "jitter", number("Clock's jitter", self.jitter, low=0.0))
        object.__setattr__(self, "missed", number("Clock's missed", self.missed, low=0.0, high=MAX_MISSED))

    @property
    def regular(self) -> bool:
        """Whether all samples run, and on time."""
        return not (self.jitter or self.missed)

    def jitter_steps(self, physics_step: float) -> int:
        """Return the largest delay of a sample in physics steps."""
        return math.floor(self.jitter / physics_step + 1e-6)

    def check(self, control_period: float, physics_step: float) -> None:
        """Raise ScenarioError for a jitter that reaches the next sample, or is shorter than a physics step."""
        if self.jitter and not 1 <= self.jitter_steps(physics_step) < round(control_period / physics_step):
            raise ScenarioError(
                f"Clock's jitter is {self.jitter:g} s: give at least a physics step, {physics_step:g} s, and less than "
                f"the control period, {control_period:g} s, and missed=... for samples that do not run"
            )
