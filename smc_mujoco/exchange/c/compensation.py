"""What a Feedforward adds to a law's u, in C: Python that is translated, as the law's is.

It has the operations of the control callback in their order, so that it gives the same bits. The
share `error` of a Feedforward is left out: it says how far the compensation is off on the true
machine, which no controller knows. What is written is the Feedforward with error=0.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from smc_mujoco.common import jit
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.exchange.c.translation.values import Kind
from smc_mujoco.mechanisms.hardware.feedforward import AT_REST, Feedforward
from smc_mujoco.mechanisms.hardware.moments import JointState
from smc_mujoco.simulation.prepare import compensations
from smc_mujoco.simulation.scenario import Scenario

# (y, total) -> nothing; it sets total, which has the law's own u, to what is added to u
Compensate = Callable[..., None]
NAME = "smc_compensation"  # in C


def compensate_of(scenario: Scenario) -> Compensate | None:
    """Return what the Feedforward of a scenario adds to u; None without one.

    Raises:
      ScenarioError: the law has one channel, but the compensation differs between the channels.
    """
    s = scenario.resolved
    feedforward = s.feedforward
    if not isinstance(feedforward, Feedforward):
        return None
    terms: list[list[tuple]] = [[] for _ in range(s.plant.driven)]
    if not any(True for _ in compensations(scenario)):
        return None
    for part, i, numbers in compensations(scenario):
        p = jit.named(part.names)(*numbers)
        memory = max(part.memory, 1)
        terms[i].append((part.steady, p, memory))
    on = feedforward.on
    gains = [nominal.gain for nominal in s.drive_train.nominal[: s.plant.driven]]
    if not s.law.joint:
        first = repr((terms[0], gains[0]))
        for of_channel in zip(terms, gains, strict=True):
            if repr(of_channel) != first:
                raise ScenarioError(
                    "the scenario's Feedforward differs between its channels, but a law of one "
                    "channel is written once for all: give one that is the same for every channel"
                )
        added = _added(terms[0], on, feedforward.eps, gains[0])
        return _of_channel(added) if on != "error" else _of_channel_on_error(added)
    compensate: Compensate = add_nothing
    for i, (own, gain) in enumerate(zip(terms, gains, strict=True)):
        if own:
            added = _added(own, on, feedforward.eps, gain)
            if on == "error":
                compensate = _with_joint_on_error(compensate, added, i)
            else:
                compensate = _with_joint(compensate, added, i)
    return compensate


def function(compensate: Compensate, joints: int) -> dict[str, tuple[Compensate, list[Kind]]]:
    """Return name in smc_law.h -> function, and the kinds of its arguments. `joints`: 0 for one
    channel.
    """
    vector = Kind("real", (max(joints, 1),))
    return {NAME: (compensate, [Kind("y"), vector])}


def compensated(law: Callable, compensate: Compensate, joints: int) -> Callable:
    """Return a law's function with the compensation in its u."""

    def of_channel(y, gains, memory):
        u, s = law(y, gains, memory)
        added = np.zeros(1)
        added[0] = u
        compensate(y, added)
        return u + added[0], s

    def of_joints(y, gains, memory):
        u, s = law(y, gains, memory)
        added = u + np.zeros(joints)
        compensate(y, added)
        return u + added, s

    return of_joints if joints else of_channel


def of_reference(v, dr):
    """Return the speed of the reference."""
    return dr


def of_joint(v, dr):
    """Return the speed that is measured or estimated."""
    return v


def no_force(y):
    """Return the force of no friction."""
    return 0.0


def add_nothing(y, total):
    """Set what is added to 0."""
    total[:] = np.zeros(len(total))


def _of_channel(added: Callable) -> Compensate:
    def compensate(y, total):
        total[0] = added(y.t, y.x, y.v, y.dr, total[0])

    return compensate


def _of_channel_on_error(added: Callable) -> Compensate:
    def compensate(y, total):
        total[0] = added(y.t, y.x, y.v, y.r, total[0])

    return compensate


def _with_joint_on_error(others: Callable, added: Callable, i: int) -> Compensate:
    """Return others, and what is added to u of joint i, whose error has the direction."""

    def compensate(y, total):
        own = total[i]
        others(y, total)
        total[i] = added(y.t, y.x[i], y.v[i], y.r[i], own)

    return compensate


def _with_joint(others: Compensate, added: Callable, i: int) -> Compensate:
    """Return others, and what is added to u of joint i."""

    def compensate(y, total):
        own = total[i]
        others(y, total)
        total[i] = added(y.t, y.x[i], y.v[i], y.dr[i], own)

    return compensate


def _added(terms: Sequence[tuple], on: str, eps: float, gain: float) -> Callable:
    """Return what is added to u of one joint, by its time, position, speed and that of the
    reference, or the reference itself on the error.
    """
    speed = of_reference if on == "reference" else of_joint
    force = no_force
    for steady, p, size in terms:
        force = _with_friction(force, steady, p, size)

    def added(t, x, v, dr, u):
        v = speed(v, dr)
        y = JointState(t, 0.0, x, v, gain * u, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        return math.tanh(abs(v) / eps) * force(y) / gain

    def on_error(t, x, v, r, u):
        size = r - x
        v = math.copysign(AT_REST, size)
        y = JointState(t, 0.0, x, v, gain * u, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        return math.tanh(abs(size) / eps) * force(y) / gain

    return on_error if on == "error" else added


def _with_friction(others: Callable, steady: Any, p: Any, size: int) -> Callable:
    """Return the force of others and of a friction with the numbers p."""

    def force(y):
        return others(y) + steady(y, p, np.zeros(size))

    return force
