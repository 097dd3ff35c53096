"""Identified numbers as text: with the digits that their errors leave, a table, and a condition
below them.
"""

import math
from collections.abc import Mapping
from pathlib import Path

from smc_mujoco.common.aliases import Numbers
from smc_mujoco.common.files import write_text
from smc_mujoco.common.tabular import Tabular
from smc_mujoco.simulation.conditions import Condition


def to_error(value: float, error: float) -> str:
    """Return a value to the second digit of its standard error, with four digits or more: "3.19981"
    for 2.1e-4.
    """
    digits = 4
    if value and error and math.isfinite(error):
        size = math.floor(math.log10(abs(value)))
        digits = size - math.floor(math.log10(error)) + 2
    return f"{value:#.{min(max(digits, 4), 12)}g}"


def table(values: Numbers, errors: Numbers, units: Mapping[str, str]) -> list[str]:
    """Return lines with each number, its value, standard error and unit."""
    rows = []
    for name, value in values.items():
        rows.append((name, to_error(value, errors[name]), f"{errors[name]:.2g}", units[name]))
    return str(Tabular(headings=("number", "value", "±", "unit"), rows=rows)).splitlines()


def save_condition(file: Path, text: str, condition: Condition) -> Path:
    """Write a condition with what was found as comments above it. Return the path."""
    comments = "".join(f"# {line}\n" for line in text.splitlines())
    return write_text(file, f"{comments}{condition}\n")
