"""The kinds of margins: what is put into a run, its levels, and what linear theory expects."""

import dataclasses
import warnings
from collections.abc import Callable

import numpy as np

from smc_mujoco.analysis import linear_theory as theory
from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, ScenarioWarning
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.robustness.level_search import QUANTA, LevelSearch
from smc_mujoco.robustness.uncertainty import JITTER_SHARES, with_friction, with_jitter
from smc_mujoco.simulation.coerce import REST
from smc_mujoco.simulation.force_bounds import default_u_max
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Constant, Fault, Impulse, Noise
from smc_mujoco.simulation.trace import Trace

TOLERATED_ERROR = 0.05  # of the scale: the audit's threshold for a final error
REST_SHARE = CATALOGUE["rest_share"]  # which must be below it
# 1/s, noise of the velocity over that of the position: that of the study's sensor
VELOCITY_NOISE_RATIO = 5.0
MAX_FORCE = 6.0  # N or N m: the study's u_max; no actuator there holds a larger force
MAX_MASS_RATIO, MAX_NOISE = 64.0, 2.048  # mass ratio; rad or m: chosen, far above tolerated levels
POWERS = 2.0 ** np.arange(-8, 1)
FORCES = tuple((MAX_FORCE * POWERS).tolist())
NOISES = tuple((MAX_NOISE * POWERS).tolist())
BLOWS = tuple((8.0 * POWERS).tolist())  # of F T of the plant's scales; chosen
MASS_RATIOS = tuple(np.geomspace(1.0, MAX_MASS_RATIO, 10)[1:].tolist())
JITTERS = tuple(i / JITTER_SHARES for i in range(1, JITTER_SHARES))  # of the control period
DELAYS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)  # s


@keyword_dataclass
class MarginKind:
    """A kind of margin: something that a law tolerates up to some level."""

    label: str  # in tables and figures
    unit: str  # {x} stands for the unit of x, {u} for that of u
    levels: tuple[float, ...]  # tried first, from small to large
    put: Callable[[Scenario, float], Scenario]  # the scenario with a level
    none: float = 0.0  # the level without any effect
    # the level that the scenario itself has, where a level replaces it
    own: Callable[[Scenario], float] | None = None
    signed: bool = False  # whether a level is tolerated only if its negative is, too
    # by what the levels are multiplied for a scenario
    size: Callable[[Scenario], float] = lambda base: 1.0
    # of which a level is a multiple; 0: any level
    quantum: Callable[[Scenario], float] = lambda base: 0.0
    # largest level by linear theory, if there is any
    theory: Callable[[Scenario], float | None] = lambda base: None

    def scenarios(self, base: Scenario, level: float) -> list[Scenario]:
        """Return the scenarios that tell whether a level is tolerated."""
        levels = [level, -level] if self.signed else [level]
        scenarios = []
        with warnings.catch_warnings():  # a level is no slip of a unit
            warnings.filterwarnings("ignore", "the true .* times the nominal", ScenarioWarning)
            warnings.filterwarnings("ignore", ".* no command moves it", ScenarioWarning)
            for value in levels:
                scenarios.append(self.put(base, value))
        return scenarios

    def search(self, base: Scenario, resolution: float) -> LevelSearch:
        """Return the search for the margin of a scenario."""
        low = self.own(base) if self.own else self.none
        if quantum := self.quantum(base):

            def rounded(level: float) -> float:
                return max(1, round(level / quantum)) * quantum

            step = QUANTA[resolution] * quantum
            levels = list(map(rounded, self.levels))
            return LevelSearch(levels=levels, resolution=lambda low: step, rounded=rounded, low=low)
        size = self.size(base)
        levels = [size * level for level in self.levels]
        return LevelSearch(
            levels=levels, resolution=lambda low: resolution * max(low, levels[0]), low=low
        )

    def expected(self, base: Scenario) -> float | None:
        """Return the largest level by linear theory; None if there is none for the law, the plant
        or the condition.
        """
        changes = (
            base.disturbance,
            base.friction,
            base.mismatch,
            base.jump,
            base.fault,
            base.sensor,
            base.feedforward,
            not base.clock.regular,
            base.resolved.model != "none",
            base.resolved.reference != REST,
        )
        if any(changes):
            return None  # not in the theory
        try:
            return self.theory(base)
        except ScenarioError:
            return None


def tolerates(trace: Trace) -> bool:
    """Return whether a run did not fail and ended within 5 % of its scale, in every group of its
    channels.
    """
    return trace.failure is None and REST_SHARE.of(trace) <= TOLERATED_ERROR


def _critical_delay(base: Scenario) -> float | None:
    if base.actuator or base.resolved.velocity.name != "measured":
        return None  # not in the theory
    lam_k1 = theory.linear_gains(base.law)
    if lam_k1 is None:
        return None
    return theory.critical_delay(base.plant, *lam_k1, base.control_period)


def _tolerated_force(base: Scenario) -> float | None:
    if not base.force_command:
        return None  # not in the theory
    largest_error = TOLERATED_ERROR * (max(map(abs, base.resolved.x0)) or 1.0)
    return theory.tolerated_force(base.plant, base.law, largest_error, min(base.limits))


def _size_of_force(base: Scenario) -> float:
    """Return the bound on u of a user's own model over that of the study; 1 for other plants."""
    if base.plant.is_user_model:
        return default_u_max(base.plant) / MAX_FORCE
    return 1.0


def _size_of_blow(base: Scenario) -> float:
    """Return F T of the plant's scales: the momentum that the drives stop in the time T."""
    far = np.abs(np.subtract(base.resolved.x0, base.plant.origin)).max()
    scales = search_space.scales(base.plant, min(base.drive_train.forces), float(far))
    return scales["F"] * scales["T"]


def _with_blow(base: Scenario, level: float) -> Scenario:
    blow = Impulse(level, time=base.duration / 2)
    return dataclasses.replace(base, disturbance=(*base.disturbance, blow))


def _with_mass(base: Scenario, level: float) -> Scenario:
    """Return the scenario with `level` times the nominal mass."""
    return dataclasses.replace(base, mismatch=dict(base.mismatch) | {_name_of_mass(base): level})


def _own_mass(base: Scenario) -> float:
    return base.mismatch.get(_name_of_mass(base), 1.0)


def _name_of_mass(base: Scenario) -> str:
    """Return what the mismatch calls the mass: "mass", or by its own name."""
    return base.plant.mass if base.plant.mass in base.mismatch else "mass"


def _with_noise(base: Scenario, level: float) -> Scenario:
    return dataclasses.replace(
        base, noise=Noise(position=level, velocity=VELOCITY_NOISE_RATIO * level)
    )


def _with_force(base: Scenario, level: float) -> Scenario:
    return dataclasses.replace(base, disturbance=(*base.disturbance, Constant(level)))


def _with_missed(base: Scenario, level: float) -> Scenario:
    return dataclasses.replace(base, clock=dataclasses.replace(base.clock, missed=level))


def _with_lost_gain(base: Scenario, level: float) -> Scenario:
    """Return the scenario with a share of gain lost from its start on, by the actuator of its fault
    or by all.
    """
    on = base.fault.on if base.fault else None
    return dataclasses.replace(base, fault=Fault(at=0.0, gain=1.0 - level, on=on))


MARGIN_KINDS: dict[str, MarginKind] = {
    "delay": MarginKind(
        label="input delay",
        unit="s",
        levels=DELAYS,
        put=lambda base, level: dataclasses.replace(base, input_delay=level),
        own=lambda base: base.input_delay,
        quantum=lambda base: base.control_period,
        theory=_critical_delay,
    ),
    "disturbance": MarginKind(
        label="constant disturbance",
        unit="{u}",
        levels=FORCES,
        put=_with_force,
        signed=True,
        size=_size_of_force,
        theory=_tolerated_force,
    ),
    "friction": MarginKind(
        label="dry friction",
        unit="{u}",
        levels=FORCES,
        put=with_friction,
        size=_size_of_force,
        theory=_tolerated_force,
    ),
    "mass": MarginKind(
        label="mass, of the nominal",
        unit="1",
        levels=MASS_RATIOS,
        put=_with_mass,
        none=1.0,
        own=_own_mass,
    ),
    "blow": MarginKind(
        label="blow halfway through the run, on every driven joint",
        unit="{u} s",
        levels=BLOWS,
        put=_with_blow,
        signed=True,
        size=_size_of_blow,
    ),
    "noise": MarginKind(
        label="position noise",
        unit="{x}",
        levels=NOISES,
        put=_with_noise,
        own=lambda base: base.noise.position,
    ),
    "jitter": MarginKind(
        label="largest delay of a sample, of the control period",
        unit="1",
        levels=JITTERS,
        put=with_jitter,
        own=lambda base: base.clock.jitter / base.control_period,
        quantum=lambda base: JITTERS[0],
    ),
    "missed": MarginKind(
        label="share of missed samples",
        unit="1",
        levels=tuple(i / 10 for i in range(1, 10)),
        put=_with_missed,
        own=lambda base: base.clock.missed,
    ),
    "loss": MarginKind(
        label="share of gain that an actuator loses",
        unit="1",
        levels=tuple(i / 10 for i in range(1, 10)),
        put=_with_lost_gain,
    ),
}
# the usual ones, and the default
KINDS = "delay", "disturbance", "friction", "mass", "noise"
