"""The kinds of margins: what a law has to tolerate, at which levels, and when a run counts as tolerated.

`MARGIN_KINDS` has a Kind for each. `margins` searches them.
"""

import dataclasses
from collections.abc import Callable

import numpy as np

from smc_mujoco.analysis import linear_theory as theory
from smc_mujoco.analysis import linearisation
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.hardware.friction import Coulomb
from smc_mujoco.mechanisms.plant import EFFORT
from smc_mujoco.metrics import catalogue
from smc_mujoco.metrics.conventions import parts, refuse, scale
from smc_mujoco.simulation.perturbations import Noise
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Constant
from smc_mujoco.simulation.trace import Trace

TOLERATED_ERROR = 0.05  # of the scale: the audit's threshold for an ultimate bound
RATE = 5.0  # 1/s: noise of the velocity over that of the position, as of the study's sensor
LARGEST = 6.0  # N or N m: the study's u_max, beyond which no actuator of it holds anything
HEAVIEST, NOISIEST = 64.0, 2.048  # mass ratio; rad or m: chosen, well beyond what is tolerated
DELAYS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)  # s


@dataclasses.dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of margin: something of which a law tolerates some level.

    Attributes:
      label: its name in tables and figures.
      unit: {x} stands for the unit of x, {u} for that of u.
      levels: those looked at first, from small to large.
      put: a scenario with a level of it.
      none: the level at which there is none.
      periods: whether a level is a whole number of control periods.
      theory: the largest level by linear theory, or None where there is none; it may refuse the plant.
    """

    label: str = ""
    unit: str
    levels: tuple[float, ...]
    put: Callable[[Scenario, float], Scenario]
    none: float = 0.0
    periods: bool = False
    theory: Callable[[Scenario], float | None] = lambda base: None

    def unit_for(self, x: str) -> str:
        """Return the unit where positions have the unit x, "rad" or "m"."""
        return self.unit.format(x=x, u=EFFORT[x])

    def scan(self, base: Scenario) -> list[float]:
        """Return the levels that a search tries first in a scenario."""
        return list(dict.fromkeys(self.rounded(base, level) for level in self.levels))

    def rounded(self, base: Scenario, level: float) -> float:
        """Return the nearest level that a scenario can have, above none."""
        if not self.periods:
            return level
        return max(1, round(level / base.control_period)) * base.control_period

    def expected(self, base: Scenario) -> float | None:
        """Return the largest level by linear theory; None where there is no theory for the law, plant or condition."""
        try:
            return None if _pushed(base) else self.theory(base)
        except ScenarioError:
            return None


def tolerates(trace: Trace) -> bool:
    """Return whether a run did not fail and ended within 5 % of its scale, in every group of its channels."""
    try:
        refuse(trace)
    except ScenarioError:  # it failed, or diverged
        return False
    bound = catalogue.CATALOGUE["ultimate_bound"].formula
    return all(bound(part) <= TOLERATED_ERROR * scale(part) for part in parts(trace).values())


def _pushed(base: Scenario) -> bool:
    """Whether forces or a plant that the theory does not know are there already."""
    return bool(base.disturbance or base.friction or base.mismatch or base.jump)


def _doubled(largest: float) -> tuple[float, ...]:
    """Return nine levels, each twice the one before."""
    return tuple(largest * 2.0 ** (i - 8) for i in range(9))


def _critical_delay(base: Scenario) -> float | None:
    lam_k1 = None if base.actuator else linearisation.local(base.law)  # (1) knows no drive
    return None if lam_k1 is None else theory.critical_delay(base.plant, *lam_k1, base.control_period)


def _at_rest(base: Scenario) -> float | None:
    most = TOLERATED_ERROR * (max(map(abs, base.resolved.x0)) or 1.0)
    return theory.tolerated_force(base.plant, base.law, most, min(base.limits))


def _rubbing(base: Scenario, level: float) -> Scenario:
    """Return the scenario with that much more dry friction."""
    others = tuple(part for part in base.friction if not isinstance(part, Coulomb))
    there = sum(part.level for part in base.friction if isinstance(part, Coulomb))
    return dataclasses.replace(base, friction=(*others, Coulomb(there + level)))


def _heavier(base: Scenario, level: float) -> Scenario:
    mass = base.plant.mass if base.plant.mass in base.mismatch else "mass"  # which has two names
    return dataclasses.replace(base, mismatch=dict(base.mismatch) | {mass: level})  # of the nominal one


MARGIN_KINDS: dict[str, Kind] = {
    "delay": Kind(
        label="input delay",
        unit="s",
        levels=DELAYS,
        put=lambda base, level: dataclasses.replace(base, input_delay=level),
        periods=True,
        theory=_critical_delay,
    ),
    "disturbance": Kind(
        label="constant disturbance",
        unit="{u}",
        levels=_doubled(LARGEST),
        put=lambda base, level: dataclasses.replace(base, disturbance=(*base.disturbance, Constant(level))),
        theory=_at_rest,
    ),
    "friction": Kind(
        label="dry friction",
        unit="{u}",
        levels=_doubled(LARGEST),
        put=_rubbing,
        theory=_at_rest,
    ),
    "mass": Kind(
        label="mass",
        unit="1",
        levels=tuple(float(factor) for factor in np.geomspace(1.0, HEAVIEST, 10)[1:]),
        put=_heavier,
        none=1.0,
    ),
    "noise": Kind(
        label="position noise",
        unit="{x}",
        levels=_doubled(NOISIEST),
        put=lambda base, level: dataclasses.replace(base, noise=Noise(position=level, velocity=RATE * level)),
    ),
}
