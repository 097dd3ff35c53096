"""What the physics step of a run of a user's model does not resolve, in one sentence.

docs/accuracy.md has how far such runs are off. `smc.accuracy.step_halving` repeats a run, and says
how far its own numbers are. Here `trace` is a Trace, which imports this module.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from smc_mujoco.common.text import number
from smc_mujoco.mechanisms.custom.poles import coupled
from smc_mujoco.simulation import integration
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Noise

LAST = 0.2  # of the run, in which u is looked at: that of the metrics
# 1/s, chosen: variation of u a second over its range, from which it chatters: five times up and
# down
CHATTER = 10.0
LEAST_SWING = 1e-6  # of the largest |u| of a run: less is no chattering; chosen


def unresolved(trace: Any) -> str:
    """Return what the step of a run does not resolve, in a sentence; "" if nothing is known."""
    scenario = trace.scenario
    if not scenario.plant.is_user_model or trace.failure:
        return ""
    return next(_of_scenario(scenario, switches(trace)), "") or next(_of_motion(trace), "")


def _of_scenario(s: Scenario, chatters: bool) -> Iterator[str]:
    """Yield a sentence if the default integrator or step is known to be coarse, or RK4 unstable;
    with what the step costs where u `chatters` on joints that move together.
    """
    off = "may be some percent off"
    if chatters and coupled(s.plant):  # 0.8, 15 and 23 % of an rms error were seen, and 108 %
        off = "may be a quarter off, or a small error twice too large"
        off += ", as u chatters on coupled joints"
    step = s.resolved.physics_step
    name = s.plant.name
    how = f"{name} runs under {s.resolved.integrator} at {1e3 * step:g} ms"
    if not integration.suits_rk4(s):
        if s.integrator is None:
            parts = [*s.friction, *s.actuator]
            part = next(p for p in parts if not integration.resolves(p))
            kind = type(part).__name__
            yield (
                f"{how}, of first order, as {kind} acts once a step: numbers {off}. Give "
                f"physics_step={step / 4:g} for less error"
            )
        return
    pole = integration.fastest_pole(s)
    if step * pole <= integration.MAX_POLE:
        return
    steps = s.control_period * pole / integration.MAX_POLE
    fine = s.control_period / math.ceil(steps)
    fast = f"its fastest pole, {number(pole)} 1/s (damping, springs or servos on light bodies)"
    if s.resolved.integrator == "RK4" and step * pole > integration.MAX_STABLE_POLE:
        yield f"{how}, which {fast}, may make unstable: give physics_step={fine:.3g} or less"
    elif s.integrator is None and s.resolved.integrator != "RK4":
        yield (
            f"{how}, of first order, for {fast}: numbers {off}. RK4 needs "
            f"physics_step={fine:.3g} or less"
        )


def _of_motion(trace: Any) -> Iterator[str]:
    """Yield a sentence if u chatters while dry friction or contacts act, or on joints that move
    together.
    """
    if not switches(trace):
        return
    cure = "smc.accuracy.step_halving([trace]) repeats the run at shorter steps"
    name = f"{trace.scenario.plant.name} under {trace.scenario.law.name}"
    if np.any(trace.holding[_last(trace)]):
        yield (
            f"u of {name} chatters while dry friction, limits or contacts act on its joints, and "
            "the remaining error depends on the physics step, however short the step is; in "
            f"Python {cure}"
        )
    elif coupled(trace.scenario.plant):
        yield (
            f"u of {name} chatters on coupled joints, so rounding errors alone may change the "
            f"final error by a few percent, at any physics step; in Python {cure}"
        )


def switches(trace: Any) -> bool:
    """Return whether u chatters in the last part. With noise, only a law does so whose theorem is
    of sliding: noise alone makes u of any law vary.
    """
    s = trace.scenario
    orders = [law.template and law.template.order("e", law.gains) for law in s.law.parts]
    smooth = (s.noise != Noise() or bool(s.sensors)) and not any(orders)
    driven = trace.scenario.plant.driven
    u = trace.u[_last(trace), :driven]
    if smooth or len(u) < 2:
        return False
    changes = np.diff(u, axis=0)
    variation = np.abs(changes).sum(axis=0)
    seconds = len(u) * trace.scenario.control_period
    swing = np.ptp(u, axis=0)
    visible = swing > LEAST_SWING * np.abs(trace.u[:, :driven]).max(axis=0)
    return bool(np.any(visible & (variation > CHATTER * seconds * swing)))


def _last(trace: Any) -> slice:
    """Return the samples of the last part."""
    start = (1.0 - LAST) * len(trace.t)
    return slice(int(start), None)
