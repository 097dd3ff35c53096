"""smc-mujoco report: the whole study as one HTML file."""

from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.common.errors import printable
from smc_mujoco.common.interrupts import delay_signals


def report(
    quick: Annotated[
        bool,
        typer.Option(
            "--quick", help="A small report in five minutes, with fewer and shorter runs."
        ),
    ] = False,
    out: Annotated[Path, typer.Option(help="Folder for the report and its data.")] = Path("report"),
    seeds: Annotated[
        int | None, typer.Option(min=1, help="Runs of a law in every cell of the grid; default 24.")
    ] = None,
    law: Annotated[
        list[str] | None,
        typer.Option(autocompletion=options.LAWS, help="Further laws, separated by commas."),
    ] = None,
    threads: options.Threads = None,
) -> None:
    """Run the package's own study in about 20 minutes, and write it as one HTML file.

    The report has the tables of `smc-mujoco compare`, the paper's claims, margins and films. The
    file OUT/report.html needs no network and no other file; the data are in the same folder. A
    stopped command resumes when you start it again.

    Example: smc-mujoco report --quick --out look
    """
    with delay_signals():
        from smc_mujoco.evidence.report import report as make

    path = make(out, quick, seeds, threads, progress=True, laws=options.names(law))
    print(
        f"wrote {printable(str(path))} ({path.stat().st_size / 1e6:.1f} MB): open it in a browser"
    )
