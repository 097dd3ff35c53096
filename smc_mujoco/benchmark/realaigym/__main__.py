"""python -m smc_mujoco.benchmark.realaigym: swing-ups among the published rows of RealAIGym."""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Column, Table

from smc_mujoco.benchmark.realaigym.published import GlobalRow, RobustnessRow, Row
from smc_mujoco.cli.commands import options
from smc_mujoco.cli.tables import titled
from smc_mujoco.cli.terminal import Terminal, errors_as_sentences
from smc_mujoco.common.interrupts import delay_ctrl_c

ONE = 2, 2, 2, 3, 1, 3  # digits of a row of the simulation board
BOARDS = {  # kind of row -> title, headings of columns, digits after the point
    Row: (
        "simulation, version 2",
        ("up at\ns", "energy\nJ", "torque\nN²m²s", "smooth\nN m", "speed\nrad²/s", "score"),
        ONE,
    ),
    RobustnessRow: (
        "survived, version 2",
        ("model\n%", "noise\nof v %", "noise\nof u %", "lag\n%", "delay\n%", "blows\n%", "score"),
        (1,) * 6 + (3,),
    ),
    GlobalRow: ("a minute of resets, version 3", ("swing-ups", "up for\ns", "score"), (1, 3, 3)),
}


def table(
    robot: str, rows: Sequence[Row | RobustnessRow | GlobalRow], bold: Collection[str]
) -> Table:
    """Return a board of RealAIGym for a robot, with the rows named in `bold` in bold."""
    title, heads, digits = BOARDS[type(rows[0])]
    columns = [Column(head, justify="right") for head in heads]
    made = titled(f"{robot}, {title}", "controller", *columns, pad_edge=False)
    for row in rows:
        cells = [f"{value:.{places}f}" for value, places in zip(row[1:], digits, strict=False)]
        made.add_row(row.name, *cells, style="bold" if row.name in bold else None)
    return made


def board(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="acrobot or pendubot.")],
    robustness: Annotated[
        bool,
        typer.Option(
            help="Whether to run the robustness test too: 722 machines a row, some 20 s in all."
        ),
    ] = True,
    entry: Annotated[
        str | None,
        typer.Option(
            metavar="FOLDER",
            help="A law and entry.toml, see smc-mujoco enter: its rows, not this package's.",
        ),
    ] = None,
    figure: Annotated[Path | None, options.picture("the run")] = None,
    film: Annotated[Path | None, typer.Option(help="Also film the run, to a .mp4 file.")] = None,
) -> None:
    """Show RealAIGym's boards of a robot, with this package's rows among the published ones.

    The task: swing the double pendulum up from rest and balance it, with one motor of 6 N m at the
    shoulder (pendubot) or at the elbow (acrobot), in 10 s. Less is better in every criterion, more
    in the score. This package's rows are an optimised trajectory under a Riccati law, and control
    experiments on the same trajectory. On the board of 2025 the machine is carried off 15 times in
    a minute, and the time upright counts. For your own law give --entry, or use smc.boards, see
    docs/boards.md.

    Example: python -m smc_mujoco.benchmark.realaigym acrobot --figure acrobot --film acrobot.mp4
    """
    with delay_ctrl_c():
        from smc_mujoco.benchmark import entry as entries
        from smc_mujoco.benchmark import realaigym as boards
        from smc_mujoco.cli.scene import filmed
        from smc_mujoco.common.files import with_ending, writable
        from smc_mujoco.common.progress import bar
        from smc_mujoco.simulation.run import run

    terminal = Terminal()
    rows = boards.experiments(robot)
    mine = boards.global_experiments(robot)
    first = boards.NAME
    if entry:
        one = entries.read(entry)
        rows = {one.name: boards.on_board(robot, one.law(robot))}
        first = one.name
        mine = rows
    writable(figure, film and with_ending(film, ".mp4"))
    traces = dict(zip(rows, run(list(rows.values())), strict=True))
    terminal.print(table(robot, boards.board(traces), rows))
    if robustness:
        with bar(f"robustness of {robot}") as drawn:
            results = {
                name: boards.robustness(
                    scenario, lambda done, all, i=i: drawn.reached(i * all + done, len(rows) * all)
                )
                for i, (name, scenario) in enumerate(rows.items())
            }
        terminal.print(table(robot, boards.robustness_board(robot, results), rows))
    terminal.print(
        table(
            robot,
            boards.global_board(
                robot, [boards.global_row(name, run) for name, run in mine.items()]
            ),
            mine,
        )
    )
    about = "" if entry else f"{boards.KEY}. "
    terminal.note(
        f"{about}On the board of 2025 they are means over four seeds of the resets.",
        "dim",
        wrap=True,
    )
    terminal.note(f"published rows: {boards.SOURCE}; {terminal.seconds:.0f} s", "dim", wrap=True)
    title = f"{robot.capitalize()}: swing-up and balance"
    if figure:
        from smc_mujoco.draw.figure import figure as draw
        from smc_mujoco.draw.page import files

        draw([traces[first]], figure, title=title)
        terminal.wrote(*files(figure))
    if film:
        terminal.wrote(*filmed([traces[first]], film, None, title, terminal))


app = typer.Typer(pretty_exceptions_enable=False, rich_markup_mode="markdown")
app.command()(errors_as_sentences()(board))

if __name__ == "__main__":
    app(prog_name="python -m smc_mujoco.benchmark.realaigym")
