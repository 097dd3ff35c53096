"""Users' functions called as the Python they are: what they return is checked, what they raise becomes a sentence."""

import math
from typing import Any

import numpy as np

from smc_mujoco.compiled import named as record_type
from smc_mujoco.component import Component
from smc_mujoco.errors import shown
from smc_mujoco.signals import Signal


class Failure(Exception):
    """Why a run ended early."""


def signalled(signal: Signal, t: float, *state: Any) -> list[float]:
    """A signal and its two derivatives at time t; `state` is what random ones also take."""
    name, function = type(signal).__name__, type(signal).value
    try:
        given = state if signal.random else (signal.data,) if signal.series else ()
        out = function(t, signal, *given)
    except Exception as error:
        raise Failure(f"{name} raised {type(error).__name__} ({error})") from error
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
    except Exception as error:
        what = f"{component.kind} {component.name!r} raised {type(error).__name__} ({error})"
        raise Failure(f"{what} in channel {channel}") from error


def surfaced(surface: Component, out: Any) -> list[float]:
    """s and eq, as floats."""
    return numbers(f"surface {surface.name!r}", out, "the two numbers s, eq", 2)


def estimated(estimator: Component, out: Any) -> list[float]:
    """Velocity and acceleration, as floats; NaN for an acceleration that is not estimated."""
    pair = out if isinstance(out, tuple) else (out, math.nan)
    return numbers(f"estimator {estimator.name!r}", pair, "a velocity, or it and an acceleration", 2)
