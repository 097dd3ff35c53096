"""smc-mujoco identify, replay: a rig's quantities from its records, and records beside their twins."""

from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Terminal
from smc_mujoco.common.interrupts import delay_ctrl_c


def identify(
    rig: Annotated[
        str, typer.Argument(metavar="RIG", help="A rig, such as qube_servo, a plant, or FILE.xml:joint+joint.")
    ],
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Records: CSV or npz files of columns, or saved traces.")
    ],
    columns: options.Columns = None,
    quantities: Annotated[
        str | None, typer.Option(help="Quantities to find, as a,b; default those that the rig's records determine.")
    ] = None,
    start: Annotated[
        str | None,
        typer.Option("--set", metavar="NAME=VALUE,...", help="Values from which the search starts, SI units: M=5,b=8."),
    ] = None,
    starts: Annotated[int, typer.Option(min=1, help="How many parameter sets the search may start from.")] = 4,
    seed: Annotated[int, typer.Option(min=0, help="Seed of these starts.")] = 0,
    figure: Annotated[Path | None, options.picture("the first record and its residuals")] = None,
    json: options.Json = None,
) -> None:
    """Fit a machine's parameters (mass, friction, motor) to measured data.

    The rig's references, controller, encoder and delay are replayed, and the quantities are chosen that give the least
    sum of squared residuals. The command prints them with their standard errors, says what the records cannot tell, and
    gives the fit of each record before and after: 100 (1 - |y - yhat| / |y - mean y|) percent. A record has a column
    for each signal, sampled at the rate of the rig's controller, angles in rad and time in s. The first line of a CSV
    file has the names of the columns.

    Example: smc-mujoco identify servo_axis run.csv --set M=5,b=8 --columns x=position,u=force
    """
    with delay_ctrl_c():
        from smc_mujoco.evidence.commands import tables
        from smc_mujoco.evidence.rigs.identify import identify as find
        from smc_mujoco.evidence.rigs.records import load
        from smc_mujoco.evidence.rigs.rig import rigs
        from smc_mujoco.mechanisms.named import as_plant
        from smc_mujoco.mechanisms.plant import catalogue as plants

    terminal, named = Terminal(), options.columns(columns)
    options.check_files(json, figure)
    identified = find(
        as_plant(rig) if rig not in rigs() and (rig in plants() or ".xml" in rig) else rig,
        [load(file, named) for file in files],
        options.names(quantities) or None,
        start=options.numbers(start, "--set", "M=5,b=8"),
        starts=starts,
        seed=seed,
        progress=True,
    )
    for table in tables.identified(identified, [str(file) for file in files]):
        terminal.print(table)
    for note in identified.notes:
        terminal.note(note, wrap=True)
    terminal.note(f"{identified.evaluations} parameter sets, seed {seed}, {terminal.seconds:.0f} s")
    if json:
        terminal.wrote(identified.save(json))
    if figure:
        terminal.wrote(*identified.figure(figure))


def replay(
    rig: Annotated[str, typer.Argument(metavar="RIG", help="A rig, such as qube_servo or simple_pendulum_ak80.")],
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A record: CSV or npz file of columns.")],
    columns: options.Columns = None,
    quantities: Annotated[
        str | None, typer.Option(help="Published parameter sets whose twins are shown too, as a,b; default none.")
    ] = None,
    start: Annotated[
        float | None, typer.Option(min=0.0, help="Where the film starts, s of the record; default the rig's own start.")
    ] = None,
    duration: Annotated[
        float | None, typer.Option(help="Duration of the film, s; default to the end of the record.")
    ] = None,
    figure: Annotated[Path | None, options.picture("the columns and their residuals")] = None,
    film: Annotated[Path | None, typer.Option(help="Also film machine and twins side by side, to a .mp4 file.")] = None,
) -> None:
    """Repeat a record of a real machine by its twin, and show both side by side.

    The twin starts from the measured state. If the machine's controller is known, the loop is closed and only the
    references are those of the record; else the twin repeats the recorded command. The table has the fit of the whole
    record, 100 (1 - |y - yhat| / |y - mean y|) percent, and that of a machine that does nothing.

    Example: smc-mujoco replay qube_servo run.csv --quantities driver --duration 6 --film run.mp4
    """
    with delay_ctrl_c():
        from smc_mujoco.cli.scene import filmed
        from smc_mujoco.common.errors import ScenarioError
        from smc_mujoco.common.files import with_ending, writable
        from smc_mujoco.evidence.commands import tables
        from smc_mujoco.evidence.rigs.records import load
        from smc_mujoco.evidence.rigs.rig import rig as find_rig
        from smc_mujoco.simulation.run import run
        from smc_mujoco.simulation.trace import Trace

    terminal, twin = Terminal(), find_rig(rig)
    writable(figure, film and with_ending(film, ".mp4"))
    record = load(file, options.columns(columns))
    if isinstance(record, Trace):
        raise ScenarioError(f"{file} is a trace: give a record, with columns {', '.join(twin.needed)}")
    twins = {"twin": twin} | {name: twin.set(name) for name in options.names(quantities)}
    fits = {"twin": twin.fit(record)}
    fits |= {name: shown.fits([record])[0] for name, shown in twins.items() if name != "twin"}
    terminal.print(tables.fits(twin.label, fits | {"do nothing": twin.idle(record)}))
    title = f"{twin.name}: {file.stem}"
    if figure:
        from smc_mujoco.evidence.rigs.figure import residual_figure

        predictions = {name: shown.predictions([record])[0] for name, shown in twins.items()}
        predicted = {name: columns for name, (columns, _, _) in predictions.items()}
        _, measured, t = predictions["twin"]
        terminal.wrote(*residual_figure(title, t, measured, predicted, fits, twin.units, figure))
    if film:
        repeated = run([shown.replay(record, start, duration) for shown in twins.values()])
        traces = [twin.measured(record, start, duration), *repeated]
        since = float(record[twin.columns.time][0]) + (twin.start if start is None else start)
        title += f", from {since:.6g} s of the record" * bool(since)
        terminal.wrote(*filmed(traces, film, ["measured", *twins], title, terminal))
