"""smc-mujoco identify: quantities of a rig from records of it."""

from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Terminal, errors_as_sentences
from smc_mujoco.common.interrupts import held_back


@errors_as_sentences()
def identify(
    rig: Annotated[str, typer.Argument(metavar="RIG", help="A rig, such as qube_servo or emps.")],
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Records: CSV or npz files of columns, or saved traces.")
    ],
    columns: Annotated[
        str | None,
        typer.Option(help="Names of columns where they differ, as theta=arm_angle,plant_input=voltage."),
    ] = None,
    quantities: Annotated[
        str | None, typer.Option(help="Quantities to find, as a,b; default those that the rig's records determine.")
    ] = None,
    starts: Annotated[int, typer.Option(min=1, help="How many sets of values the search may start from.")] = 4,
    seed: Annotated[int, typer.Option(min=0, help="Seed of these starts.")] = 0,
    figure: Annotated[
        Path | None, typer.Option(help="Also draw the first record and its residuals, as FIGURE.svg and .png.")
    ] = None,
    json: options.Json = None,
) -> None:
    """Find the quantities of a machine from records of it.

    The rig's references, controller, encoder and delay are replayed, and the quantities with the least squares of the
    residuals are printed, with their standard errors, what the records cannot tell, and the fit of each record before
    and after: 100 (1 - |y - yhat| / |y - mean y|) percent. A record has a column for each signal, with a first line of
    names in CSV; angles in rad, time in s, at the rate of the rig's controller.

    Example: smc-mujoco identify emps run1.csv run2.csv --columns x=position,r=reference,u=voltage
    """
    with held_back():
        from smc_mujoco.cli import tables
        from smc_mujoco.common.errors import ScenarioError
        from smc_mujoco.common.files import ended, writable
        from smc_mujoco.twins.identify import identify as find
        from smc_mujoco.twins.records import load
        from smc_mujoco.twins.rig import rig as find_rig

    for file in (figure, json):
        if file:
            writable(file)
    terminal, twin, named = Terminal(), find_rig(rig), {}
    for pair in options.names(columns):
        ours, equals, theirs = pair.partition("=")
        if not (ours and equals and theirs):
            raise ScenarioError(f"columns {pair!r} cannot be read: write them as theta=arm_angle,t=time")
        named[ours.strip()] = theirs.strip()
    found = find(
        twin,
        [load(file, named) for file in files],
        options.names(quantities) or None,
        starts=starts,
        seed=seed,
        progress=True,
    )
    for table in tables.identified(found, [str(file) for file in files]):
        terminal.print(table)
    for note in found.notes:
        terminal.print(note)
    terminal.note(f"{found.evaluations} sets of values, seed {seed}, {terminal.seconds:.0f} s")
    if json:
        terminal.wrote(found.save(ended(json, ".json")))
    if figure:
        terminal.wrote(*found.figure(figure))
