"""Numbers and lists as text."""

import dataclasses
import math
import re
from collections.abc import Iterable
from typing import Any

UNDERSCORED = re.compile(r"(?<![\w.])\.?\d[\d.]*_")  # a number as 1_0, in a text that Python reads
LEAST_PRINTED = 1e-9  # smaller numbers are not printed digit by digit


def number(value: float, digits: int = 3) -> str:
    """Return a number to `digits` significant digits, at most two before an exponent; "never" for
    inf, "none" for NaN, "<1e-9" if it is that small.
    """
    if math.isnan(value):
        return "none"
    if math.isinf(value):
        return "never"
    if 0.0 < abs(value) < LEAST_PRINTED:
        return "<1e-9"
    if value == 0.0:
        return "0"
    if 1e-3 <= abs(value) < 1e5:
        return f"{value:.{max(0, digits - 1 - math.floor(math.log10(abs(value))))}f}"
    return _with_exponent(value, min(digits, 2))


def real(text: str) -> float:
    """Return the number that a user wrote, in the digits 0 to 9; ValueError for another text. To
    Python 1_0 is a number, too, and so are digits of other alphabets.
    """
    if "_" in text or not text.strip().isascii():
        raise ValueError(text)
    return float(text)


def in_one_notation(values: Iterable[float]) -> list[str]:
    """Return each number as `number` does; all with an exponent if one of them has one, but for 0,
    "never", "none" and "<1e-9".
    """
    numbers = {}
    texts = []
    for i, value in enumerate(values):
        texts.append(number(value))
        if texts[i][-1].isdigit() and abs(value) >= LEAST_PRINTED:
            numbers[i] = value
    if any("e" in texts[i] for i in numbers):
        for i, value in numbers.items():
            texts[i] = _with_exponent(value, 2)
    return texts


def _with_exponent(value: float, digits: int) -> str:
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def span(low: str, high: str) -> str:
    """Return the range of a median: "1.1–1.3"; "1.1 to never" where some never reach it; "1.1 or
    more" where some have no value; "" where both ends are the same text, and the median says it.
    """
    if low == high:
        return ""
    if high == "never":
        return f"{low} to {high}"
    return f"{low} or more" if high[:1].isalpha() else f"{low}–{high}"


def joined(parts: Iterable[str], last_word: str = "and") -> str:
    """Return "a, b and c"; "" for no parts."""
    *first_parts, last = list(parts) or [""]
    if first_parts:
        return f"{', '.join(first_parts)} {last_word} {last}"
    return last


def capital(text: str) -> str:
    """Return the text with a capital first letter, as at the start of a sentence; the others
    stay.
    """
    return text[:1].upper() + text[1:]


def first_paragraph(text: str | None) -> str:
    """Return the first paragraph of a docstring, on one line; "" without one."""
    return " ".join((text or "").strip().partition("\n\n")[0].split())


def every(count: int) -> str:
    """Return "both" of two things, "all 3" of three."""
    return "both" if count == 2 else f"all {count}"


def counted(count: int, noun: str) -> str:
    """Return "1 run" or "3 runs"."""
    return f"1 {noun}" if count == 1 else f"{count} {noun}s"


def stated(data: Any, defaults: bool = True) -> dict[str, Any]:
    """Return the fields of frozen data that its text states, those by keyword alone last, and only
    if they differ from their defaults; without `defaults`, all are so.
    """
    values = {}
    for field in sorted(dataclasses.fields(data), key=lambda field: bool(field.kw_only)):
        value = getattr(data, field.name)
        if field.init and (value != field.default or (defaults and not field.kw_only)):
            values[field.name] = value
    return values
