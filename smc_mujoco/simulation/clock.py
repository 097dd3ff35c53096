"""The controller's clock: samples that are late, and samples that are missed.

A real-time task is woken every control period T, some time after it should be. Sample k runs at

    t_k = k T + late_k,    late_k uniform among the physics steps from 0 to `jitter`,

or not at all: then the last command stays, and neither estimator nor law sees that sample. The first sample and the
last one are on time. Which samples are late or missed depends on the seed and k alone, as all random numbers are
counter-based.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import dataclasses
import math

from numba import njit

from smc_mujoco.common.errors import ScenarioError, number
from smc_mujoco.simulation import philox

MAX_MISSED = 0.99  # probability; chosen: of a hundred samples one runs


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
        if not self.jitter:
            return
        if self.jitter_steps(physics_step) >= round(control_period / physics_step):
            raise ScenarioError(
                f"Clock's jitter {self.jitter:g} s is not shorter than the control period of {control_period:g} s: "
                "give a shorter one, and missed=... for samples that do not run"
            )
        if not self.jitter_steps(physics_step):
            raise ScenarioError(
                f"Clock's jitter {self.jitter:g} s is shorter than a physics step of {physics_step:g} s: "
                "give a shorter physics_step"
            )


@njit(error_model="numpy", inline="always")
def late(sim, k):
    """Return by how many physics steps sample k of a simulation is late."""
    if sim.jitter == 0 or k == 0 or k == sim.samples - 1:
        return 0
    return int(philox.uniform(sim.seed, 0, philox.JITTER, k) * (sim.jitter + 1))


@njit(error_model="numpy", inline="always")
def missed(sim, k):
    """Return whether sample k of a simulation does not run."""
    if sim.missed == 0.0 or k == 0 or k == sim.samples - 1:
        return False
    return philox.uniform(sim.seed, 0, philox.MISSED, k) < sim.missed
