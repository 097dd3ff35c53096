"""Users' functions called as the Python they are: what they return is checked, what they raise becomes a sentence."""

import math
from typing import Any

import numpy as np

from smc_mujoco.common.errors import one_line, shown
from smc_mujoco.common.jit import named as record_type
from smc_mujoco.common.remade import remade
from smc_mujoco.control.component import Component
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.law import Measurement
from smc_mujoco.mechanisms.plant import Coupled, Plant, Values
from smc_mujoco.simulation import state
from smc_mujoco.simulation.prepare import Packed
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Signal
from smc_mujoco.simulation.state import view

RAISES = (Exception, SystemExit)  # what a user's function may end in, and the other runs go on


class Failure(Exception):
    """Why a run ended early."""


def raised(who: str, error: BaseException, where: str = "") -> Failure:
    """The Failure of a user's function that raised something."""
    try:
        text = str(error)
    except RAISES:
        text = "its text cannot be shown"
    return Failure(f"{who} raised {type(error).__name__} ({one_line(text)}){where}")


def signalled(signal: Signal, t: float, *state: Any) -> list[float]:
    """A signal and its two derivatives at time t; `state` is what random ones also take."""
    name, function = type(signal).__name__, type(signal).value
    try:
        given = state if signal.random else (signal.data,) if signal.series else ()
        out = function(t, signal, *given)
    except RAISES as error:
        raise raised(name, error) from error
    return numbers(name, out, "a value and two derivatives", 3)


def numbers(who: str, out: Any, what: str, count: int = 1) -> list[float]:
    """What a user's function returned, as floats."""
    try:
        values = [float(value) for value in out]
    except (TypeError, ValueError, OverflowError):
        values = []
    if len(values) != count:
        raise Failure(f"{who} returned {shown(out)} instead of {what}")
    return values


def named(component: Component) -> tuple:
    """A component's gains as the record its function reads."""
    return record_type(tuple(component.gains))(*(component.gains.values() or [0.0]))


def guarded(component: Component, function: Any, channel: int, y: tuple, gains: tuple, memory: np.ndarray) -> Any:
    """What a law or an estimator returns; its exception as a Failure that names it."""
    try:
        return function(y, gains, memory)
    except RAISES as error:
        raise raised(f"{component.kind} {component.name!r}", error, f" in channel {channel}") from error


def surfaced(surface: Component, out: Any) -> list[float]:
    """s and eq, as floats."""
    return numbers(f"surface {surface.name!r}", out, "the two numbers s, eq", 2)


def estimated(estimator: Component, out: Any) -> list[float]:
    """Velocity and acceleration, as floats; NaN for an acceleration that is not estimated."""
    pair = out if isinstance(out, tuple) else (out, math.nan)
    return numbers(f"estimator {estimator.name!r}", pair, "a velocity, or it and an acceleration", 2)


def nominal(plant: Plant, x: np.ndarray, v: np.ndarray, i: int, values: Values, u: np.ndarray) -> tuple[float, float]:
    """Nominal f and g of channel i; coupled channels know the last commands u."""
    try:
        return plant.nominal(x, v, i, values, *((u,) if isinstance(plant.nominal, Coupled) else ()))
    except RAISES as error:
        raise raised(f"the nominal model of {plant.name}", error) from error


def as_written(function: Any) -> Any:
    """What `remade` makes of compiled functions here: what they were."""
    return function


def retold(s: Scenario, record: np.ndarray, packed: Packed) -> str | None:
    """Why a simulation failed, in Python's words, which the compiled functions do not have.

    The function that failed is called once more, as Python, with what its record still holds: so the words depend on
    nothing beside the run. None where it does not fail again: it had already changed its memory.
    """
    joints = view(packed.numbers, int(record["joints"]), (2 + 4 * s.plant.n,))
    i = int(joints[0])

    def again(c: Component, y: tuple, function: np.ndarray) -> None:
        memory = view(packed.numbers, int(function["memory"]), (s.plant.n, c.memory))[i].copy()
        guarded(c, remade(c.function, as_written), i, y, named(c), memory)

    try:
        match int(record["failure"]):
            case state.ESTIMATOR_RAISED:
                again(s.velocity, Reading(*record["reading"].tolist()), record["estimator"])
            case state.SURFACE_RAISED if s.surface is not None:
                again(s.surface, Measurement(*record["y"].tolist()), record["surface"])
            case state.LAW_RAISED | state.NOT_FINITE as failure:
                again(s.law, Measurement(*record["y"].tolist()), record["law"])
                if failure == state.NOT_FINITE:
                    u, sliding = record["control"].tolist()
                    return f"law {s.law.name!r} returned u = {u:g}, s = {sliding:g} in channel {i}"
            case state.REFERENCE_RAISED:
                signalled(s.reference, float(record["instant"]["t"]))
            case state.NOMINAL_RAISED:
                x, v, _, u = joints[2:].reshape(4, s.plant.n).copy()
                nominal(s.plant, x, v, i, Values(**s.plant.parameters), u)
            case state.DISTURBANCE_RAISED | state.DISTURBANCE_NOT_FINITE:
                t = float(record["instant"]["t"])
                for j, signal in enumerate(s.disturbance):
                    at = packed.signals[j]["function"]["memory"]
                    memories = view(packed.numbers, int(at), (s.plant.n, signal.memory)).copy()
                    for channel in range(s.plant.n if signal.random else 1):
                        signalled(signal, t, memories[channel], s.seed, channel, s.stream(j))
    except Failure as failure:
        return str(failure)
    return None
