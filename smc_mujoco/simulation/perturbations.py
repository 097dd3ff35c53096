"""Measurement noise, and jumps of the plant's parameters during a run."""

import dataclasses
from collections.abc import Mapping

from smc_mujoco.common.errors import ScenarioError, number, shown
from smc_mujoco.common.frozen import Frozen, frozen


@dataclasses.dataclass(frozen=True)
class Noise:
    """Zero-mean Gaussian measurement noise, by the standard deviations of position and velocity, in SI units."""

    position: float = 0.0
    velocity: float = 0.0

    def __post_init__(self):
        for name in ("position", "velocity"):
            object.__setattr__(self, name, number(f"Noise's {name}", getattr(self, name), least=0.0))


@dataclasses.dataclass(frozen=True)
class Jump:
    """A change of the plant's parameters from `time`, s, on.

    Each is multiplied by its factor in `factors` (parameter name -> factor); those in `plant.added`, such as a payload,
    grow by it.
    """

    time: float
    factors: Mapping[str, float]

    def __post_init__(self):
        object.__setattr__(self, "time", number("Jump's time", self.time, least=0.0))
        object.__setattr__(self, "factors", parameter_factors("Jump", self.factors))


def parameter_factors(name: str, value: object) -> Frozen[float]:
    """Return parameter name -> factor, checked. Errors call it `name`."""
    if not isinstance(value, Mapping):
        raise ScenarioError(f"{name} is {shown(value)}: give parameter names with their factors, such as {{'M': 1.3}}")
    return frozen({str(key): number(f"{name} of {key}", factor) for key, factor in value.items()})
