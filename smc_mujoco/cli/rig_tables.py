"""Tables of a rig: the fit of its twins, and the quantities that were identified."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.table import Table
from rich.text import Text

from smc_mujoco.cli.tables import number_columns, titled
from smc_mujoco.common.text import number
from smc_mujoco.identification.identify import Identified
from smc_mujoco.identification.number_text import to_error


def fits(title: str, by_name: Mapping[str, Mapping[str, float]]) -> Table:
    """Return the fit of each twin of a record, %, or when it falls."""
    table = titled(
        f"{title}: fit, %",
        "",
        *number_columns(next(iter(by_name.values()))),
    )
    for name, fit in by_name.items():
        table.add_row(name, *(f"{value:z.1f}" for value in fit.values()))
    return table


def identified(result: Identified, names: Sequence[str]) -> list[Table]:
    """Return a table of the quantities found, with standard errors and where the search started,
    and one of each log's fit.
    """
    values = titled(
        result.rig.label,
        "quantity",
        *number_columns(("value", "±", "start")),
        "",
    )
    for name, value in result.values.items():
        quantity = result.rig.quantities[name]
        before = number(result.before.values[name])
        error = result.errors[name]
        values.add_row(
            name, to_error(value, error), f"{error:.2g}", before, Text(quantity.unit, "dim")
        )
    heads = number_columns(result.fits[0])
    title = "fit, % (before)"
    if result.by_pieces:
        title = "fit of the whole log, % (in pieces of 1 s)"
    fits = titled(title, "log", *heads)
    beside = list(result.by_pieces or result.fits_before)
    rows = list(zip(names, result.fits, beside, strict=True))
    if result.held_out:
        rows.append(("held out", result.held_out.fit, result.held_out.by_pieces))
    for name, fit, fit_beside in rows:
        cells = [f"{value:.1f}" for value in fit.values()]
        for k, key in enumerate(fit):
            if key in fit_beside:
                cells[k] += f" ({fit_beside[key]:.1f})"
        fits.add_row(name, *cells)
    return [values, fits]
