"""Identified numbers as text, with the digits that their errors leave, and above a condition."""

import math
from pathlib import Path

from smc_mujoco.common.files import replacing
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


def save_condition(file: Path, text: str, condition: Condition) -> Path:
    """Write a condition with what was found as comments above it. Return the path."""
    with replacing(file) as part:
        comments = "".join(f"# {line}\n" for line in text.splitlines())
        part.write_text(f"{comments}{condition}\n", encoding="utf-8")
    return file
