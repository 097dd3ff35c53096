"""smc-mujoco show TRACE: one run, from its file."""

import itertools
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from smc_mujoco.cli.terminal import loading, mendable, wrote

if TYPE_CHECKING:
    from rich.console import Console

    from smc_mujoco.simulation.trace import Trace


@mendable()
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
    with loading():
        from rich.console import Console

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


def summary(trace: "Trace", console: "Console") -> None:
    """Print what a trace is of, how its channels run, and its scores; of a large group only the first channel."""
    from smc_mujoco.cli import tables

    s = trace.scenario
    console.print(f"[bold]{s.plant.name}[/] under [bold]{s.law}[/], {s.duration:g} s at {s.control_period:g} s")
    for group, heading in tables.headings(s.plant).items():
        if heading:
            console.print(f"{heading}:", highlight=False, markup=False)
        channels = list(group.channels if len(group.channels) <= tables.MAX_NAMED_JOINTS else group.channels[:1])
        rubs = trace.reaction[:, channels].any()
        for name, i in itertools.product(("x", "v", *("u", "s") * group.driven, *["reaction"] * bool(rubs)), channels):
            column = getattr(trace, name)[:, i]
            label = f"{name}{i}" if s.plant.n > 1 else name  # as columns of an export are called
            line = f"{label} {tables.spark(column)} {column[0]:.3g} to {column[-1]:.3g}"
            console.print(line, highlight=False, soft_wrap=True)
    if trace.failure:
        console.print(f"failed: {trace.failure}", style="red", highlight=False, markup=False)
    else:
        for table in tables.trace_summary(trace):
            console.print(table)
