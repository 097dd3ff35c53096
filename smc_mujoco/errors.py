"""The one error users see: a sentence that names the thing, the value and the cure."""

import difflib
import math
from collections.abc import Iterable


class ScenarioError(ValueError):
    """Bad input. The message is one sentence: the thing, its value, the cure."""


def unknown(kind: str, name: object, known: Iterable[str]) -> ScenarioError:
    """The error for a name that is not among `known`, with the nearest that is."""
    names = sorted(known)
    near = difflib.get_close_matches(str(name), names, n=1)
    hint = f"did you mean {near[0]!r}?" if near else f"choose from {', '.join(names)}"
    return ScenarioError(f"unknown {kind} {name!r}: {hint}")


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
    if isinstance(value, bool) or not hasattr(value, "__float__"):
        raise ScenarioError(f"{what} is {value!r}: give a number")
    try:
        x = float(value)  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError):
        raise ScenarioError(f"{what} is {value!r}: give a number") from None
    if math.isnan(x) or (math.isinf(x) and not infinite):
        raise ScenarioError(f"{what} is {x}: give a finite number")
    if x <= above:
        raise ScenarioError(f"{what} is {x:g}: give a number greater than {above:g}")
    if x < least:
        raise ScenarioError(f"{what} is {x:g}: give at least {least:g}")
    if x > most:
        raise ScenarioError(f"{what} is {x:g}: give at most {most:g}")
    return x
