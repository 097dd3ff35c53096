"""smc-mujoco report: the whole study, as one HTML file."""

from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import loading, mendable
from smc_mujoco.common.errors import printable


@mendable()
def report(
    quick: Annotated[bool, typer.Option("--quick", help="A look in two minutes: less of everything.")] = False,
    out: Annotated[Path, typer.Option(help="Folder for the report and its data.")] = Path("report"),
    seeds: Annotated[
        int | None, typer.Option(min=1, help="Seeds of every cell of the grid; fewer than 16 name no winner.")
    ] = None,
    threads: options.Threads = None,
) -> None:
    """Compute the whole study, in some 20 minutes, and write it as one HTML file: which controller, where, how sure.

    The grid of plants, laws, conditions and seeds; the paper's claims; margins; regions of attraction; films. The file
    OUT/report.html needs no network and no other file; the data lie beside it. Stopped and started again, the command
    goes on where it was.

    Example: smc-mujoco report --quick --out look
    """
    with loading():
        from smc_mujoco.studies.report import report as make

    path = make(out, quick, seeds, threads, progress=True)
    print(f"wrote {printable(str(path))} ({path.stat().st_size / 1e6:.1f} MB): open it in a browser")
