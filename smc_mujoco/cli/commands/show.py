"""smc-mujoco show TRACE: one run, from its file."""

from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.terminal import loading, mendable, wrote


def show(
    trace: Annotated[Path, typer.Argument(metavar="TRACE", help="A .npz file that `run` or Trace.save wrote.")],
    figure: Annotated[Path | None, typer.Option(help="Also draw it, as FIGURE.svg and FIGURE.png.")] = None,
    export: Annotated[
        str | None,
        typer.Option(
            metavar="FORMAT,...|FILE",
            help="Also write its columns, with units, as csv, mat or parquet beside TRACE, or to a named file.",
        ),
    ] = None,
) -> None:
    """Show a trace: what was run, how it went, and its scores."""
    with mendable():
        with loading():
            from rich.console import Console

            from smc_mujoco.cli.show import summary
            from smc_mujoco.simulation.trace import formats, load

        files = [] if export is None else [Path(export)]
        if export is not None and "." not in export and Path(export).name == export:
            files = [trace.with_suffix(f".{ending}") for ending in formats(export)]
        loaded, console = load(trace), Console()
        written = [loaded.export(file) for file in files]
        if figure:
            from smc_mujoco.draw.figure import figure as draw

            written += draw([loaded], figure)
        summary(loaded, console)
        for path in written:
            wrote(console, path)
