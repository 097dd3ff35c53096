"""smc-mujoco claims: which of the paper's claims hold, under which gains, by what numbers."""

from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Clock, loading, mendable
from smc_mujoco.common.errors import printable


@mendable()
def claims(
    ids: Annotated[
        list[str] | None,
        typer.Argument(metavar="ID", help="Claims, as 3 18; all without one.", show_default=False),
    ] = None,
    gains: Annotated[str | None, typer.Option(help="Sets of gains, as a,b; default study,tuned,tracking.")] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Coarser grids, no network above 50 pendulums, tuned gains alone.")
    ] = False,
    table: Annotated[Path | None, typer.Option(help="results.parquet of a bench: its runs are not made again.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document instead of tables.")] = False,
    out: Annotated[Path | None, typer.Option(help="Also write that JSON document to a file.")] = None,
    threads: options.Threads = None,
) -> None:
    """Audit the paper's claims: each measured against the threshold that was fixed for it before any run.

    A claim is supported where all its sentences hold, refuted where none does, partly supported between; under each
    set of gains, and where the verdict depends on the set it says so. One counter-example refutes a universal claim. A
    few claims are shown in full, with every check; all of them take minutes.

    Example: smc-mujoco claims 3 18 --gains tuned
    """
    with loading():
        from rich.console import Console

        from smc_mujoco.cli import tables
        from smc_mujoco.common.files import replacing, writable
        from smc_mujoco.common.progress import bar
        from smc_mujoco.studies.paper.claims.audit import claims as audit
        from smc_mujoco.studies.paper.claims.audit import document, evaluations
        from smc_mujoco.studies.table import Table

    clock, console = Clock(), Console()
    names = None if gains is None else options.names(gains)
    known = None if table is None else Table.read(table)
    if out:
        writable(out)
    with clock("in all"), bar("claims", evaluations(ids or None, names, quick), counted=True) as drawn:
        found = audit(known, ids or None, names, quick, threads=threads, report=drawn.advance)
    text = document(found)
    if out:
        with replacing(out) as file:
            file.write_text(text + "\n")
    if json:
        print(text)
    else:
        tables.print_claims(found, console, full=bool(ids))
        written = f"; wrote {printable(str(out))}" if out else ""
        where = "; quick: coarser grids than the claims say" * quick + written
        console.print(f"{clock.spent['in all']:.0f} s{where}", style="dim", soft_wrap=True, highlight=False)
