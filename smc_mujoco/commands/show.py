"""smc-mujoco show TRACE: one run, from its file."""

from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.terminal import loading, mendable


def show(
    trace: Annotated[Path, typer.Argument(metavar="TRACE", help="A .npz file that `run` or Trace.save wrote.")],
    figure: Annotated[Path | None, typer.Option(help="Also draw it, as FIGURE.svg and FIGURE.png.")] = None,
    export: Annotated[
        Path | None, typer.Option(help="Also write its columns, with units, to a .csv, .mat or .parquet file.")
    ] = None,
) -> None:
    """Show a trace: what was run, how it went, and its scores."""
    with mendable():
        with loading():
            from rich.console import Console

            from smc_mujoco.show import summary
            from smc_mujoco.trace import load

        loaded, console = load(trace), Console()
        written = [loaded.export(export)] if export else []
        if figure:
            from smc_mujoco.draw.figure import figure as draw

            written += draw([loaded], figure)
        summary(loaded, console)
        for path in written:
            console.print(f"wrote {path}", soft_wrap=True, highlight=False)
