"""Tables of a rig: the fit of its twins, and the quantities that were identified."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rich.table import Column, Table
from rich.text import Text

from smc_mujoco.cli.tables import titled
from smc_mujoco.common.text import number
from smc_mujoco.identification.identify import Identified


def fits(title: str, by_name: Mapping[str, Mapping[str, float]]) -> Table:
    """Return the fit of each twin of a record, %, or when it falls."""
    table = titled(
        f"{title}: fit, %",
        "",
        *(Column(head, justify="right") for head in next(iter(by_name.values()))),
    )
    for name, fit in by_name.items():
        table.add_row(name, *(f"{value:z.1f}" for value in fit.values()))
    return table


def _to_error(value: float, error: float) -> str:
    """Return a value to the second digit of its standard error, with four digits or more: "3.19981"
    for 2.1e-4.
    """
    if value and error:
        digits = math.floor(math.log10(abs(value))) - math.floor(math.log10(error)) + 2
    else:
        digits = 4
    return f"{value:#.{min(max(digits, 4), 12)}g}"


def identified(result: Identified, names: Sequence[str]) -> list[Table]:
    """Return a table of the quantities found, with standard errors and values before, and one of
    each record's fit.
    """
    values = titled(
        result.rig.label,
        "quantity",
        *(Column(head, justify="right") for head in ("value", "±", "before")),
        "",
    )
    for name, value in result.values.items():
        quantity = result.rig.quantities[name]
        before = number(result.before.values[name])
        error = result.errors[name]
        values.add_row(
            name, _to_error(value, error), f"{error:.2g}", before, Text(quantity.unit, "dim")
        )
    heads = [Column(head, justify="right") for head in result.fits[0]]
    fits = titled("fit, % (before)", "record", *heads)
    for name, fit, before in zip(names, result.fits, result.fits_before, strict=True):
        fits.add_row(name, *(f"{value:.1f} ({before[key]:.1f})" for key, value in fit.items()))
    return [values, fits]
