"""The table of a rig: the fit of its twins."""

from collections.abc import Mapping

from smc_mujoco.common.tabular import Tabular


def fits(title: str, by_name: Mapping[str, Mapping[str, float]]) -> Tabular:
    """Return the fit of each twin of a record, %, or when it falls."""
    rows = []
    for name, fit in by_name.items():
        rows.append([name, *(f"{value:z.1f}" for value in fit.values())])
    heads = ["twin", *next(iter(by_name.values()))]
    return Tabular(headings=heads, rows=rows, title=f"{title}: fit, %")
