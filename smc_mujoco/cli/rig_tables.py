"""The table of a rig: the fit of its twins."""

from __future__ import annotations

from collections.abc import Mapping

from rich.table import Table

from smc_mujoco.cli.tables import number_columns, titled


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
