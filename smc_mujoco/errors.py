"""The one error users see: a sentence that names the thing, the value and the cure; and the checks that raise it."""

import difflib
import math
import numbers
from collections.abc import Iterable, Mapping
from typing import TypeVar

import numpy as np

T = TypeVar("T")
LONGEST_NAME = 100  # characters: chosen, for tables and figures


class ScenarioError(ValueError):
    """Bad input. The message is one sentence: the thing, its value, the cure."""


def shown(value: object) -> str:
    """A value on one line, cut where it is long."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def unknown(kind: str, name: object, known: Iterable[str]) -> ScenarioError:
    """The error for a name that is not among `known`, with the nearest that is."""
    names = sorted(known)
    near = _nearest(name, names) if isinstance(name, str) else []
    hint = f"did you mean {near[0]!r}?" if near else f"choose from {', '.join(names)}" if names else "there are none"
    return ScenarioError(f"unknown {kind} {shown(name)}: {hint}")


def _nearest(name: str, names: list[str]) -> list[str]:
    """The nearest of names in spelling, whatever the case, or the first that contains the name."""
    plain = {known.casefold(): known for known in names}
    wanted = name.casefold()
    close = difflib.get_close_matches(wanted, list(plain), n=1)
    return [plain[near] for near in close or [known for known in plain if wanted and wanted in known]][:1]


def find(kind: str, name: object, known: Mapping[str, T]) -> T:
    """known[name], or the error that says what is known."""
    if not isinstance(name, str) or name not in known:
        raise unknown(kind, name, known)
    return known[name]


def number(
    what: str,
    value: object,
    *,
    above: float = -math.inf,
    least: float = -math.inf,
    most: float = math.inf,
    infinite: bool = False,
) -> float:
    """`value` as a float in (above, inf) and [least, most], or ScenarioError naming `what`."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    if isinstance(value, bool | np.bool_) or not isinstance(value, numbers.Real):
        raise ScenarioError(f"{what} is {shown(value)}: give a number")
    try:
        x = float(value)
    except OverflowError:
        x = math.inf
    if math.isnan(x) or (math.isinf(x) and not infinite):
        raise ScenarioError(f"{what} is {shown(value)}: give a finite number")
    if x <= above:
        raise ScenarioError(f"{what} is {x:g}: give a number greater than {above:g}")
    if x < least:
        raise ScenarioError(f"{what} is {x:g}: give at least {least:g}")
    if x > most:
        raise ScenarioError(f"{what} is {x:g}: give at most {most:g}")
    return x


def whole(what: str, value: object, least: int, most: int) -> int:
    """`value` as an int in [least, most], or ScenarioError naming `what`."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    integral = isinstance(value, numbers.Integral) or (isinstance(value, numbers.Real) and value == value // 1)
    if isinstance(value, bool | np.bool_) or not integral or not least <= value <= most:  # pyright: ignore
        raise ScenarioError(f"{what} is {shown(value)}: give a whole number from {least} to {most}")
    return int(value)  # pyright: ignore


def name(what: str, value: object) -> str:
    """`value` if it is a name: one line of 1 to 100 printable characters; else ScenarioError naming `what`."""
    if not isinstance(value, str) or not value.isprintable() or not value.strip():
        raise ScenarioError(f"{what} is {shown(value)}: give a name of printable characters")
    if len(value) > LONGEST_NAME:
        raise ScenarioError(f"{what} is {shown(value)}, {len(value)} characters: give at most {LONGEST_NAME}")
    return value
