"""Names and numbers as a report writes them: laws, plants, conditions, metrics, kinds of margin.

Colours and names are those of `draw.style`; numbers those of the terminal's tables, three significant digits.
"""

import functools
import html
import math
import re

from smc_mujoco.analysis.margin_kinds import MARGIN_KINDS
from smc_mujoco.common.text import number as written
from smc_mujoco.control import gain_sets as gains
from smc_mujoco.control.law import laws
from smc_mujoco.draw import style
from smc_mujoco.draw.style import law_initials as short
from smc_mujoco.draw.style import law_name as law
from smc_mujoco.mechanisms.plant import catalogue as plants
from smc_mujoco.metrics import catalogue
from smc_mujoco.studies.paper.claims.verdict import MARKS

# What the overview compares, and what each asks for; the tables' columns.
HEADLINE = ("settling_time", "itae", "ultimate_bound", "tv_rate")
COLUMNS = ("settling_time", "overshoot", "itae", "ultimate_bound", "steady_error", "max_u", "tv_rate")
RANKED = ("settles", *HEADLINE)  # columns of the ranking by plant
ASKS = {
    "settling_time": "fast",
    "itae": "accurate on the way",
    "ultimate_bound": "accurate in the end",
    "tv_rate": "calm",
}

__all__ = ["MARKS", "law", "short", "style"]


def number(value: float) -> str:
    """Three significant digits; "never" for inf, "none" for NaN."""
    return "none" if math.isnan(value) else written(value)


def colour(name: str) -> str:
    """The colour that a law has in figures and films; no two laws of the short list have the same."""
    return _colours().get(name, style.law_colour(name))


@functools.cache
def _colours() -> dict[str, str]:
    return dict(zip(gains.LAWS, style.law_colours(gains.LAWS), strict=True))


def plant(name: str) -> str:
    """A plant's name as people write it."""
    known = plants().get(name)
    return (known and known.short) or style.in_words(name)


def condition(name: str) -> str:
    """A condition's name with spaces."""
    return name.replace("_", " ")


def kind(name: str) -> str:
    """A kind of margin as people write it."""
    return MARGIN_KINDS[name].label if name in MARGIN_KINDS else name.replace("_", " ")


def metric(name: str) -> str:
    """A metric's name as people write it."""
    return catalogue.CATALOGUE[name].label if name in catalogue.CATALOGUE else name.replace("_", " ")


def unit(name: str, plant_name: str | None = None) -> str:
    """A metric's unit on a plant, or on all of those that differ: "rad or m"."""
    known = {m.name: m for m in catalogue.metrics()}
    if name not in known:
        return ""
    xs = [plants()[plant_name].unit] if plant_name in plants() else ["rad", "m"]
    units = dict.fromkeys(typeset(known[name].unit_for(x)) for x in xs)
    return " or ".join(u for u in units if u != "1")


def typeset(unit: str) -> str:
    """A unit with its dots and powers: "rad s^2" as "rad·s²"."""
    return re.sub(r"\((\w+)\)²", r"\1²", unit.replace("^2", "²")).replace(" ", "·")


def interval(median: float, low: float, high: float) -> str:
    """The interval about a median, "" where it is unknown, or too narrow to be seen in three digits."""
    if math.isnan(low) or math.isnan(high) or number(low) == number(median) == number(high):
        return ""
    return f"{number(low)} – {number(high)}"


SIGNS = {"<=": "≤", ">=": "≥", "!=": "≠", "^2": "²", "alphadot": "α′", "alpha": "α", "lambda": "λ", "eps": "ε"}
SIGNS |= {"Vdot": "V′", "xdot": "x′"}


def pretty(text: str) -> str:
    """Return a sentence of the audit, written in ASCII, with mathematical signs and proper names."""
    signs = [rf"(?<![^\W\d_]){s}(?![^\W\d_])" if s.isalpha() else re.escape(s) for s in SIGNS]  # no eps within steps
    text = re.sub("|".join(signs), lambda m: SIGNS[m[0]], text)
    names = {name: plant(name) for name in plants()} | {name: style.law_name(name).lower() for name in laws()}
    named = "|".join(sorted((name for name in names if "_" in name or name in plants()), key=len, reverse=True))
    return re.sub(rf"\b({named})\b(?!_)", lambda m: names[m[1]], text)


def bound(value: float) -> str:
    """Return a number of theory, which may be infinite."""
    return "no bound" if math.isinf(value) else number(value)


def escape(text: str) -> str:
    """Return text for a chart, where HTML tags would have an effect."""
    return html.escape(text, quote=False)
