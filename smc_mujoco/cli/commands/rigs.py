"""smc-mujoco rig: records of a real machine beside its twin."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.console import Terminal, importing
from smc_mujoco.common.errors import ScenarioError

Name = Annotated[
    str | None,
    typer.Argument(
        metavar="RIG",
        help=("A rig, such as qube_servo. Without one: lists the rigs."),
    ),
]
Files = Annotated[
    list[Path] | None,
    typer.Argument(
        metavar="FILE",
        help="Record: a CSV or npz file of columns.",
    ),
]
Sets = Annotated[
    str | None,
    typer.Option(help="Published parameter sets to show too, separated by commas; default: none."),
]
Start = Annotated[
    float | None,
    typer.Option(
        min=0.0, help="Where the film starts, s of the record; default the rig's own start."
    ),
]
Duration = Annotated[
    float | None,
    typer.Option(help="Duration of the film, s; default to the end of the record."),
]
Film = Annotated[
    Path | None, typer.Option(help="Also film machine and twins side by side, to a .mp4 file.")
]


def rig(
    name: Name = None,
    files: Files = None,
    columns: options.Columns = None,
    figure: Annotated[Path | None, options.picture("the (first) record and its residuals")] = None,
    sets: Sets = None,
    start: Start = None,
    duration: Duration = None,
    film: Film = None,
    json: options.Json = None,
) -> None:
    """Compare a record of a real machine with its simulation.

    The simulation, or twin, starts from the measured state. If the machine's controller is known,
    the loop is closed and only the references are those of the record; else the twin repeats the
    recorded command. The table has the fit of the whole record, 100 (1 - |y - yhat| / |y - mean y|)
    percent.

    A record has a column for each signal, sampled at the rate of the rig's controller, angles in
    rad and time in s. The first line of a CSV file has the names of the columns.

    Without a rig it lists the rigs.

    Example: smc-mujoco rig

    Example: smc-mujoco rig qube_servo run.csv --sets driver --duration 6 --film run.mp4

    """
    terminal = Terminal(json)
    named = options.pairs(columns, "columns", "theta=arm_angle,t=time")
    if name is None:
        _list(terminal)
    elif not files or len(files) > 1:
        raise ScenarioError(
            f"{len(files or ())} records of {name}: give one file; smc-mujoco identify takes many"
        )
    else:
        chosen_sets = options.parsed_names(sets)
        _repeat(name, files[0], named, chosen_sets, start, duration, figure, film, terminal)
    terminal.finish()


def _list(terminal: Terminal) -> None:
    """List the rigs."""
    with importing():
        from smc_mujoco.common.tabular import of_fields
        from smc_mujoco.identification.published_rig import rig_catalogue

    terminal.print(
        of_fields("Rigs", {name: entry.label for name, entry in rig_catalogue().items()})
    )


def _repeat(
    rig: str,
    file: Path,
    columns: Mapping[str, str],
    sets: Sequence[str],
    start: float | None,
    duration: float | None,
    figure: Path | None,
    film: Path | None,
    terminal: Terminal,
) -> None:
    """Show a record beside the runs of the rig's twins."""
    with importing():
        from smc_mujoco.cli.run_scene import filmed
        from smc_mujoco.common.files import with_ending, writable
        from smc_mujoco.common.tabular import Tabular
        from smc_mujoco.identification.published_rig import rig as find_rig
        from smc_mujoco.identification.records import load_record
        from smc_mujoco.simulation.run import run
        from smc_mujoco.simulation.trace import Trace

    twin = find_rig(rig)
    writable(figure, film and with_ending(film, ".mp4"))
    record = load_record(file, columns)
    if isinstance(record, Trace):
        raise ScenarioError(
            f"{file} is a trace: give a record, with columns {', '.join(twin.needed)}"
        )
    twins = {"twin": twin} | {name: twin.set(name) for name in sets}
    fits = {"twin": twin.fit(record)}
    for name, twin_shown in twins.items():
        if name != "twin":
            fits[name] = twin_shown.fits([record])[0]
    rows = [(name, *(f"{value:z.1f}" for value in fit.values())) for name, fit in fits.items()]
    heads = ["twin", *fits["twin"]]
    terminal.print(Tabular(headings=heads, rows=rows, title=f"{twin.label}: fit, %"))
    title = f"{twin.name}: {file.stem}"
    if figure:
        from smc_mujoco.identification.residual_figure import residual_figure

        predictions = {}
        for name, twin_shown in twins.items():
            predictions[name] = twin_shown.predictions([record])[0]
        predicted = {}
        for name, prediction in predictions.items():
            predicted[name] = prediction[0]
        _, measured, t = predictions["twin"]
        terminal.wrote(*residual_figure(title, t, measured, predicted, fits, twin.units, figure))
    if film:
        replays = []
        for twin_shown in twins.values():
            replays.append(twin_shown.replay(record, start, duration))
        repeated = run(replays)
        traces = [twin.measured(record, start, duration), *repeated]
        begin = twin.start if start is None else start
        since = float(record[twin.columns.time][0]) + begin
        if since:
            title += f", from {since:.6g} s of the record"
        terminal.wrote(*filmed(traces, film, ["measured", *twins], title, terminal))
