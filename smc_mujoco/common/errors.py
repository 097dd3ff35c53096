"""ScenarioError, the error that users see: one sentence with thing, value and cure; and the checks
that raise it.
"""

import difflib
import inspect
import itertools
import math
import numbers
import re
import sys
import warnings
from collections.abc import Iterable, Mapping
from contextvars import ContextVar
from typing import Any, TypeVar

T = TypeVar("T")
MAX_NAME = 100  # characters: chosen, for tables and figures
MAX_ITEMS = 1_000_000  # items of a list that a user gives, and runs of a grid: chosen
MAX_LISTED = 12  # names that a refusal lists, where all stand elsewhere; chosen
MAX_LETTERS = 1100  # of these names
IN_LIST = ("law", "plant", "surface", "scene", "condition", "metric")  # kinds of `list`
PLACES = {"word": "docs/words.md"} | {kind: f"smc-mujoco list {kind}s" for kind in IN_LIST}
MAX_MESSAGE = 1500  # characters of a message, which may hold a long path: chosen
END_OF_MESSAGE = 500  # characters of a longer message that are kept at its end, with the cure
MAX_MEANT = 3  # names that a word of them may mean: chosen
MAX_SHOWN = 60  # characters of a value in a message: chosen


class ScenarioError(ValueError):
    """Bad input. The message is one sentence on one line: the thing, its value, the cure."""

    def __init__(self, message: str):
        if len(message) > MAX_MESSAGE:
            start = message[: MAX_MESSAGE - END_OF_MESSAGE - len("...")]
            message = f"{start}...{message[-END_OF_MESSAGE:]}"
        super().__init__(printable(message))


class BrokenLawError(ScenarioError):
    """An error: a law fails whatever its gains are."""


class ScenarioWarning(UserWarning):
    """A scenario that runs, but is probably not what its author means.

    The message is one sentence, as an error's.
    """


class UnitWarning(ScenarioWarning):
    """A value that may be in another unit, such as degrees."""


def printable(text: str) -> str:
    """Return the text with escapes for characters that a terminal would act on, such as a newline
    in a file's name.
    """
    characters = []
    for c in text:
        if c.isprintable():
            characters.append(c)
        else:
            characters.append(c.encode("unicode_escape").decode())
    return "".join(characters)


def shown(value: object) -> str:
    """Return a value's repr on one line of at most MAX_SHOWN characters; its class in <> if the
    repr fails.
    """
    try:
        text = " ".join(_brief(value).split())
    except Exception:  # from a __repr__ of the user's; RecursionError in deeply nested lists
        text = f"<{type(value).__name__}>"
    if len(text) > MAX_SHOWN:
        text = f"{text[: MAX_SHOWN - 3]}..."
    return printable(text)


def _brief(value: object) -> str:
    """Return the repr of a value, or that of its first MAX_SHOWN items if it is a long text, list
    or dict.
    """
    if isinstance(value, str | bytes | list | tuple):
        value = value[:MAX_SHOWN]
    elif isinstance(value, dict):
        value = dict(itertools.islice(value.items(), MAX_SHOWN))
    return repr(value)


def unknown(kind: str, name: object, known: Iterable[str]) -> ScenarioError:
    """Return the error for a name that is not in `known`.

    It suggests the nearest name, or lists all names; of many that stand elsewhere, three.
    """
    # claims have numbers
    names = sorted(known, key=lambda text: (int(text) if text.isdecimal() else -1, text))
    hint = "there are none with a name"
    if kind in PLACES and isinstance(name, str) and len(names) > MAX_LISTED:
        near = difflib.get_close_matches(name, names, n=MAX_MEANT, cutoff=0.0)
        hint = f"near it are {', '.join(near)}; {PLACES[kind]} has all"
    elif names:
        hint = f"choose from {one_line(', '.join(names), MAX_LETTERS)}"
    if isinstance(name, str) and (near := _nearest(name, names)):
        hint = f"did you mean {' or '.join(map(repr, near))}?"
    return ScenarioError(f"unknown {kind} {shown(name)}: {hint}")


def _nearest(name: str, names: list[str]) -> list[str]:
    """Return the names that an abbreviation may mean, else the nearest in spelling, else the first
    that contains it.
    """
    plain = {candidate.casefold(): candidate for candidate in names}
    lowered = name.casefold()
    if name.isupper():
        abbreviated = []
        for candidate in names:
            if _abbreviates(lowered, candidate.split("_")):
                abbreviated.append(candidate)
        if abbreviated:
            return abbreviated
    words = [candidate for candidate in plain if lowered in candidate.split("_")]
    if len(words) > 1:
        return [plain[candidate] for candidate in words[:MAX_MEANT]]
    close = difflib.get_close_matches(lowered, list(plain), n=1)
    if len(lowered) <= 3:  # most short words are near each other
        close = [candidate for candidate in close if candidate[0] == lowered[0]]
    if not close and len(lowered) > 1:
        close = [candidate for candidate in plain if lowered in candidate]
    return [plain[close[0]]] if close else []


def _abbreviates(short: str, words: list[str]) -> bool:
    """Return whether `short` is a usual abbreviation of a name's words, as sta, stc and stsmc of
    super_twisting.
    """
    initials = "".join(word[:1] for word in words)
    ending = "smc?" if len(words) == 1 else "(a|c|sm|smc)?"
    return re.fullmatch(re.escape(initials) + ending, short) is not None


def one_line(text: str, length: int = 200) -> str:
    """Return text on one line of at most `length` characters, with a ? for each that cannot be
    printed.
    """
    letters = []
    for c in " ".join(text[: 2 * length].split()):
        if c.isprintable():
            letters.append(c)
        else:
            letters.append("?")
    text = "".join(letters)
    if len(text) <= length:
        return text
    return f"{text[: length - 3]}..."


def find(kind: str, name: object, known: Mapping[str, T]) -> T:
    """Return known[name]; raise ScenarioError, which names the nearest key, if there is none."""
    if not isinstance(name, str) or name not in known:
        raise unknown(kind, name, known)
    return known[name]


def number(
    what: str,
    value: object,
    *,
    above: float = -math.inf,
    low: float = -math.inf,
    high: float = math.inf,
    infinite: bool = False,
) -> float:
    """Return `value` as a float that is > `above`, >= `low` and <= `high`, finite unless
    `infinite`, and never NaN.
    """
    real = _real(value)
    if real is None:
        raise ScenarioError(f"{what} is {shown(value)}: give a number")
    try:
        x = float(real)
    except OverflowError:
        x = math.inf
    if math.isnan(x) or (math.isinf(x) and not infinite):
        raise ScenarioError(f"{what} is {shown(value)}: give a finite number")
    if x <= above:
        raise ScenarioError(f"{what} is {x:g}: give a number greater than {above:g}")
    if x < low:
        raise ScenarioError(f"{what} is {x:g}: give at least {low:g}")
    if x > high:
        raise ScenarioError(f"{what} is {x:g}: give at most {high:g}")
    return x


def whole(what: str, value: object, low: int, high: int) -> int:
    """Return `value` as an int in [low, high], or raise ScenarioError naming `what`."""
    real = _real(value)
    if real is None or not low <= real <= high or real != real // 1:
        raise ScenarioError(f"{what} is {shown(value)}: give a whole number from {low} to {high}")
    return int(real)


def _real(value: Any) -> Any:
    """Return a real number, also from an array without axes; None for anything else, such as flags
    and durations.
    """
    import numpy as np  # which a command's help does without

    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        return None
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    if isinstance(value, bool | np.bool_ | np.timedelta64) or not isinstance(value, numbers.Real):
        return None
    return value


def items_of(what: str, values: Iterable[T]) -> list[T]:
    """Return the items of a user's list, or raise ScenarioError naming `what` if there are more
    than MAX_ITEMS.
    """
    if isinstance(values, str):
        raise ScenarioError(f"{what} is {shown(values)}: give a list, [{shown(values)}]")
    try:
        items = iter(values)
    except Exception:  # an array without axes, or a user's object that fails
        raise ScenarioError(f"{what} is {shown(values)}: give a list") from None
    first = list(itertools.islice(items, MAX_ITEMS + 1))
    if len(first) > MAX_ITEMS:
        raise ScenarioError(f"{what} has more than {MAX_ITEMS:,} items: give fewer")
    return first


def has_items(value: object) -> bool:
    """Return whether a value has items, as a list or a generator has; an array without axes has
    none.
    """
    import numpy as np

    return isinstance(value, Iterable) and not (isinstance(value, np.ndarray) and value.ndim == 0)


def has(value: object, name: str) -> bool:
    """Return whether a value has an attribute. It runs no code of the value."""
    return inspect.getattr_static(value, name, None) is not None


def words(error: BaseException) -> str:
    """Return type and message of an exception, which another package may have raised, on one
    line.
    """
    try:
        return one_line(f"{type(error).__name__}: {error}")
    except Exception:
        return f"{type(error).__name__}, whose message cannot be read"


def name(what: str, value: object) -> str:
    """Return `value` if it is a name, 1 to MAX_NAME printable characters, else raise ScenarioError
    naming `what`.
    """
    if not isinstance(value, str) or not value.isprintable() or not value.strip():
        raise ScenarioError(f"{what} is {shown(value)}: give a name of printable characters")
    if len(value) > MAX_NAME:
        raise ScenarioError(
            f"{what} is {shown(value)}, {len(value)} characters: give at most {MAX_NAME}"
        )
    return value


# what `warn_once` has warned of in this call of the user's, however many scenarios it makes
warned: ContextVar[set[str]] = ContextVar("warned")


def warn_once(sentence: str, kind: type[Warning] = ScenarioWarning) -> None:
    """Warn of a doubt, if any, that a call of the user's may raise many times; also if only its
    numbers differ, as those of starts that were drawn around a doubtful one.
    """
    before = warned.get(set())
    words = re.sub(r"(?<![\w.])-?\d[\d.]*(e[-+]?\d+)?(?!\w)", "#", sentence)  # not the 2 of j2
    if sentence and words not in before:
        before.add(words)
        warnings.warn(sentence, kind, users_stacklevel())


def users_stacklevel() -> int:
    """Return the stacklevel of the nearest caller outside this package and `dataclasses`: that of
    the user's line.
    """
    frame = sys._getframe(1)
    level = 1
    inner = "smc_mujoco", "dataclasses"
    while frame.f_back is not None:
        if frame.f_globals.get("__name__", "").partition(".")[0] not in inner:
            break
        frame = frame.f_back
        level += 1
    return level
