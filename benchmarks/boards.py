"""RealAIGym's boards of a robot, with this package's rows among the published ones.

    python benchmarks/boards.py acrobot
    python benchmarks/boards.py pendubot --entry examples/entries/soft_relay

The task: swing the double pendulum up from rest and balance it, with one motor of 6 N m at the
shoulder (pendubot) or at the elbow (acrobot), in 10 s. Less is better in every criterion, more in
the score. On the board of 2025 the machine is carried off 15 times in a minute, and the time
upright counts.
"""

import argparse
from collections.abc import Collection, Sequence

import realaigym
from realaigym.published import GlobalRow, RobustnessRow, Row
from rich.console import Console

import smc_mujoco as smc
from smc_mujoco.common.tabular import Cell, Tabular
from smc_mujoco.problems import entry as entries

BOARDS = {  # kind of row -> title, headings of columns, digits after the point
    Row: (
        "simulation, version 2",
        ("up at (s)", "energy (J)", "torque (N²m²s)", "smooth (N m)", "speed (rad²/s)", "score"),
        (2, 2, 2, 3, 1, 3),
    ),
    RobustnessRow: (
        "survived, version 2",
        (
            "model (%)",
            "noise of v (%)",
            "noise of u (%)",
            "lag (%)",
            "delay (%)",
            "blows (%)",
            "score",
        ),
        (1, 1, 1, 1, 1, 1, 3),
    ),
    GlobalRow: ("a minute of resets, version 3", ("swing-ups", "up for (s)", "score"), (1, 3, 3)),
}


def table(
    robot: str, rows: Sequence[Row | RobustnessRow | GlobalRow], bold: Collection[str]
) -> Tabular:
    """Return a board for a robot, with the rows named in `bold` in bold."""
    title, headings, digits = BOARDS[type(rows[0])]
    lines = []
    for row in rows:
        cells = [f"{value:.{places}f}" for value, places in zip(row[1:], digits, strict=False)]
        lines.append([Cell(row.name, strong=row.name in bold), *cells])
    return Tabular(headings=["controller", *headings], rows=lines, title=f"{robot}, {title}")


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the boards."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("robot", choices=realaigym.ROBOTS)
    parser.add_argument("--entry", metavar="FOLDER", help="a law and entry.toml: its rows alone")
    parser.add_argument("--no-robustness", action="store_true", help="leave out its 722 machines")
    options = parser.parse_args(arguments)
    robot = options.robot
    rows = realaigym.experiments(robot)
    of_2025 = realaigym.global_experiments(robot)
    if options.entry:
        entry = entries.read_entry(options.entry)
        rows = of_2025 = {entry.name: realaigym.on_board(robot, entry.law(robot))}
    console = Console()
    traces = dict(zip(rows, smc.run(list(rows.values())), strict=True))
    console.print(table(robot, realaigym.board(traces), rows))
    if not options.no_robustness:
        survived = {name: realaigym.robustness(scenario) for name, scenario in rows.items()}
        console.print(table(robot, realaigym.robustness_board(robot, survived), rows))
    minutes = [realaigym.global_row(name, scenario) for name, scenario in of_2025.items()]
    console.print(table(robot, realaigym.global_board(robot, minutes), of_2025))
    if not options.entry:
        console.print(realaigym.KEY, style="dim")
    console.print(
        f"2025: means over four seeds of the resets. Published rows: {realaigym.SOURCE}.",
        style="dim",
    )


if __name__ == "__main__":
    main()
