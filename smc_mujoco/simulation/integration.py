"""The integrator and the physics step of a scenario that gives none.

A plant of the library runs under RK4 at 1 ms while MuJoCo integrates its equation alone, else under
implicitfast at 0.25 ms. A user's model runs under RK4 whatever it may touch, as a range that is
never reached costs nothing then. Its step is the longest of 1, 0.5 and 0.25 ms that resolves its
fastest pole and its constraints. It runs under implicitfast where RK4 would be unstable, and where
a part has a state that moves once a step. docs/accuracy.md has what this costs and what it gives.

Here `s` is a Scenario, which imports this module.
"""

import dataclasses
import math
from typing import Any

from smc_mujoco.mechanisms.hardware.part import Actuator, Friction

MAX_STEP = 1e-3  # s; the ideal plants under RK4 follow their equations to 1e-9 at this step
# s; tests/simulation/test_convergence.py measures what halving it changes
REALISTIC_STEP = 2.5e-4
# s, of walls, balls and stops on a user's model: at 1 ms blows under chatter err 50 times as much
BLOW_STEP = 5e-4
OWN_STEPS = MAX_STEP, BLOW_STEP, REALISTIC_STEP  # s, of a user's model, the first that it bears
# of a step times the fastest pole: RK4 resolves it below the first, and is unstable above 2.8; the
# second leaves room for poses in which the pole is faster
MAX_POLE = 0.7
MAX_STABLE_POLE = 2.0
MAX_CONSTRAINT_RATE = 0.2  # of a step times the fastest rate of limits, contacts and ties
MIN_JITTER_STEPS = (
    4  # physics steps in the clock's jitter; chosen: the delay of a sample has five values or more
)
MIN_RESOLVED_LAG = (
    0.02  # control periods: a shorter lag needs no shorter physics step, see `longest_step`
)
DRIVE_STEPS = 4  # physics steps per control period: enough behind any drive, see `longest_step`
MAX_DEFAULT_STEPS = 100_000  # per control period, if no physics step is given
MIN_MASS = 1e-6  # of the factors on the mass, below which a pole grows no further


def default_integrator(s: Any) -> str:
    """Return RK4 where it is stable and no part rules it out, else implicitfast."""
    if not s.plant.is_user_model:
        return "RK4" if s.plain_equation or s.exact_friction else "implicitfast"
    step = s.physics_step or s.control_period / default_steps(s)
    return "RK4" if suits_rk4(s) and step * fastest_pole(s) <= MAX_STABLE_POLE else "implicitfast"


def suits_rk4(s: Any) -> bool:
    """Return whether no part of a scenario rules RK4 out."""
    return all(map(resolves, s.actuator)) and (s.exact_friction or all(map(resolves, s.friction)))


def resolves(part: Actuator | Friction) -> bool:
    """Return whether RK4 may simulate a part: it has no play, and no state that moves once a
    step.
    """
    if isinstance(part, Actuator):
        return part.smooth
    return not part.keeps_state and part.force is None


def fastest_pole(s: Any) -> float:
    """Return the fastest pole of a user's model in a scenario, 1/s, see `poles.fastest_pole`. A
    lighter body has a faster one.
    """
    from smc_mujoco.mechanisms.custom import poles

    mass = least = 1.0
    for factors in (s.mismatch, s.jump.factors if s.jump else {}):
        own_factor = factors.get(s.plant.mass, 1.0)
        mass *= factors.get("mass", 1.0) * own_factor
        least = min(least, mass)
    parts = []
    for part in s.actuator:
        if not part.in_callback:
            parts.append(part)
    for part in s.friction:
        if part.smooth:
            parts.append(part)
    pole = poles.fastest_pole(s.plant, tuple(parts))
    return pole / max(least, MIN_MASS)


def longest_step(s: Any) -> float:
    """Return the largest default physics step, s.

    A drive's force changes within a step. Behind one Lag, RK4 gets its mean and its first moment,
    so that velocities and positions at the ends of steps are exact. Behind other drives it gets the
    mean: velocities are exact, and positions err by step^2/12 times the change of the acceleration:
    in a cycle of frequency omega, by (omega step)^2/12 of its amplitude. With four steps this is 5
    % in the fastest cycle of a sampled law, which lasts two samples. Cycles behind a long delay are
    slower: a step of half of it is enough. A force that follows u at once sets no limit.
    """
    bounds = [s.clock.jitter / MIN_JITTER_STEPS or MAX_STEP]
    bounds += [part.longest_step(s.plant) for part in s.actuator]
    bounds += [part.longest_step for part in s.contact]
    bounds.append(_step_of_mechanism(s))
    longest = min(MAX_STEP, *bounds)
    if bounds[-1] == REALISTIC_STEP:  # which resolves drives, too
        return longest
    alone = all(len(chain) < 2 for chain in s.drive_train.chains)
    if alone and all(part.has_moment for part in s.actuator):
        return longest
    for part in s.actuator:
        if part.delay >= MIN_RESOLVED_LAG * s.control_period or part.limited:
            slowest = max(0.5 * part.delay, s.control_period / DRIVE_STEPS)
            longest = min(longest, slowest)
    return longest


def _step_of_mechanism(s: Any) -> float:
    """Return the longest step that joints, constraints and friction bear, s."""
    exact = s.plain_equation or s.exact_friction
    if not s.plant.is_user_model:
        return MAX_STEP if exact else REALISTIC_STEP
    if not suits_rk4(s) or (s.integrator not in (None, "RK4") and not s.plain_equation):
        return REALISTIC_STEP
    from smc_mujoco.mechanisms.custom import poles

    dry = poles.rubs(s.plant) or any(not part.smooth for part in s.friction)
    if dry and not exact:
        return REALISTIC_STEP
    pole = fastest_pole(s)
    rate = 0.0 if s.plain_equation else poles.constraint_rate(s.plant)
    for step in OWN_STEPS:
        hits = s.contact and step > BLOW_STEP
        resolved = step * pole <= MAX_POLE and step * rate <= MAX_CONSTRAINT_RATE * (1.0 + 1e-9)
        if resolved and not hits:
            return step
    return REALISTIC_STEP


def default_steps(s: Any) -> int:
    """Return the default number of physics steps per control period.

    Behind a drive, and with `exact_friction`, up to four times as many steps are tried, until all
    delays are a whole number of steps.
    """
    # a scenario that needs less is refused later
    shortest = min(map(longest_step, s.machines))
    longest = max(shortest, s.control_period / MAX_DEFAULT_STEPS)
    minimum = math.ceil(s.control_period / longest - 1e-9)
    if any(math.isfinite(part.longest_step) for part in s.contact):
        minimum += minimum % 2  # so that a search can double the step
    if s.actuator or s.exact_friction:
        for steps in range(minimum, 4 * minimum + 1):
            if _divides_delays(s, steps):
                return steps
    # an actuator's delay is rounded up to whole steps
    rounded = any(part.lateness for part in s.actuator)
    return 4 * minimum if rounded else minimum


def _divides_delays(s: Any, steps: int) -> bool:
    """Return whether all delays are whole numbers of this many steps a control period."""
    delays = [s.input_delay]
    for part in s.actuator:
        delays.append(part.lateness)
    for delay in delays:
        periods = delay / s.control_period
        if abs(math.remainder(periods * steps, 1.0)) >= 1e-6:
            return False
    return True


def stepped_by_mujoco(s: Any) -> Any:
    """Return the scenario with MuJoCo's Coulomb friction, for what runs without the callback's."""
    if s.exact_friction:
        return dataclasses.replace(s, integrator="implicitfast")
    return s
