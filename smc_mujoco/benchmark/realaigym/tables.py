"""Tables of RealAIGym's boards."""

from collections.abc import Collection, Sequence

from rich.table import Column, Table

from smc_mujoco.benchmark.realaigym.published import GlobalRow, RobustnessRow, Row
from smc_mujoco.cli.tables import titled

ONE = 2, 2, 2, 3, 1, 3  # digits of a row of the simulation board
BOARDS = {  # kind of row -> title, headings of columns, digits after the point
    Row: ("simulation, version 2",
          ("up at\ns", "energy\nJ", "torque\nN²m²s", "smooth\nN m", "speed\nrad²/s", "score"), ONE),
    RobustnessRow: ("survived, version 2",
                    ("model\n%", "noise\nof v %", "noise\nof u %", "lag\n%", "delay\n%", "blows\n%", "score"),
                    (1,) * 6 + (3,)),
    GlobalRow: ("a minute of resets, version 3", ("swing-ups", "up for\ns", "score"), (1, 3, 3)),
}  # fmt: skip


def board(robot: str, rows: Sequence[Row | RobustnessRow | GlobalRow], bold: Collection[str]) -> Table:
    """Return a board of RealAIGym for a robot, with the rows named in `bold` in bold."""
    title, heads, digits = BOARDS[type(rows[0])]
    columns = [Column(head, justify="right") for head in heads]
    table = titled(f"{robot}, {title}", "controller", *columns, pad_edge=False)
    for row in rows:
        cells = [f"{value:.{places}f}" for value, places in zip(row[1:], digits, strict=False)]
        table.add_row(row.name, *cells, style="bold" if row.name in bold else None)
    return table
