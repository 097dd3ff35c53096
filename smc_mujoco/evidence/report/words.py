"""Names and numbers as a report writes them: laws, plants, conditions, metrics, kinds of margin.

Colours and names are those of `draw.style`; numbers those of the terminal's tables, three
significant digits.
"""

import math
import re
from collections.abc import Iterable

from smc_mujoco.analysis.margins import MARGIN_KINDS
from smc_mujoco.common.text import number as in_digits
from smc_mujoco.control import gain_sets
from smc_mujoco.control.law import known_laws, laws
from smc_mujoco.draw import style
from smc_mujoco.draw.style import law_initials as short
from smc_mujoco.draw.style import law_name as law
from smc_mujoco.evidence.audit.verdict import MARKS
from smc_mujoco.mechanisms.plant import catalogue as plants
from smc_mujoco.metrics.catalogue import CATALOGUE

PAPER_LAW = "observer_free"  # the law that the suite was built to test
# What the overview compares; the tables' columns.
MAIN_METRICS = ("settling_time", "itae", "ultimate_bound", "tv_rate")
TABLE_METRICS = (
    "settling_time",
    "overshoot",
    "itae",
    "ultimate_bound",
    "steady_error",
    "max_u",
    "tv_rate",
)
# Mathematical signs and proper names for the audit's ASCII.
SIGNS = {
    "<=": "≤",
    ">=": "≥",
    "!=": "≠",
    "^2": "²",
    "alphadot": "α′",
    "alpha": "α",
    "lambda": "λ",
    "eps": "ε",
}
SIGNS |= {"Vdot": "V′", "xdot": "x′"}

__all__ = ["MARKS", "law", "short", "style"]
FAMILY = {
    "switching": "sliding mode that switches",
    "smoothed": "smoothed sliding mode",
    "rivals": "no sliding mode",
}


def number(value: float) -> str:
    """Return three significant digits; "never" for inf, "none" for NaN."""
    if math.isnan(value):
        return "none"
    return in_digits(value)


def interval(median: float, low: float, high: float) -> str:
    """Return the interval about a median, "" where it is unknown, or too narrow to be seen in three
    digits.
    """
    if math.isnan(low) or math.isnan(high) or number(low) == number(median) == number(high):
        return ""
    return f"{number(low)} – {number(high)}"


def colour(name: str) -> str:
    """Return the colour of a law, different from those of the short list and of other packages'
    laws.
    """
    shown = list(dict.fromkeys([*gain_sets.COMPARED, *known_laws().added, name]))
    return style.law_colours(shown)[shown.index(name)]


def plant(name: str) -> str:
    """Return a plant's short name."""
    return style.plant_name(name, short=True)


def condition(name: str) -> str:
    """Return a condition's name with spaces."""
    return name.replace("_", " ")


def kind(name: str) -> str:
    """Return a kind of margin in words."""
    if name in MARGIN_KINDS:
        return MARGIN_KINDS[name].label
    return name.replace("_", " ")


def metric(name: str) -> str:
    """Return a metric's name in words."""
    if name in CATALOGUE:
        return CATALOGUE[name].label
    return name.replace("_", " ")


def asks(metric: str) -> str:
    """Return the wish that a small value of a metric grants, such as "fast"."""
    return CATALOGUE[metric].need.replace("-", " ")


def unit(metric: str, plant: str | None = None) -> str:
    """Return a metric's unit on a plant; without a plant its different units, as "rad or m"."""
    if metric not in CATALOGUE:
        return ""
    if plant and plant in plants():
        xs = [plants()[plant].unit]
    else:
        xs = ["rad", "m"]
    return either(CATALOGUE[metric].unit_for(x) for x in xs)


def either(units: Iterable[str]) -> str:
    """Return different units as "rad or m"; a ratio has none."""
    return " or ".join(dict.fromkeys(typeset(unit) for unit in units if unit not in ("", "1")))


def typeset(unit: str) -> str:
    """Return a unit with its dots and powers: "rad s^2" as "rad·s²"."""
    return (
        re.sub(r"\((\w+)\)²", r"\1²", unit.replace("^2", "²"))
        .replace(" ", "·")
        .replace("·of·", " of ")
    )


def pretty(text: str) -> str:
    """Return a sentence of the audit, written in ASCII, with mathematical signs, proper names and
    no backquotes.
    """
    text = text.replace("`", "")
    # no eps within steps
    signs = []
    for s in SIGNS:
        signs.append(rf"(?<![^\W\d_]){s}(?![^\W\d_])" if s.isalpha() else re.escape(s))
    text = re.sub("|".join(signs), lambda m: SIGNS[m[0]], text)
    names = {name: plant(name) for name in plants()} | {name: law(name).lower() for name in laws()}
    known = "|".join(
        sorted((name for name in names if "_" in name or name in plants()), key=len, reverse=True)
    )
    return re.sub(rf"\b({known})\b(?!_)", lambda m: names[m[1]], text)
