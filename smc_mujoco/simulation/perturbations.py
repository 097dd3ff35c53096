"""Measurement noise, and jumps of the plant's parameters during a run."""

import dataclasses
from collections.abc import Mapping

from smc_mujoco.common.errors import ScenarioError, number, shown
from smc_mujoco.common.frozen import Frozen, frozen
from smc_mujoco.simulation.signals import PerChannel, Signal


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
