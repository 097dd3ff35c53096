"""The commands of the benchmark: enter a law in a suite, and build the pages of the results."""

from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.terminal import Terminal
from smc_mujoco.common.errors import ScenarioError, printable
from smc_mujoco.common.files import reading
from smc_mujoco.common.interrupts import delay_ctrl_c

Results = Annotated[
    Path, typer.Option("--results", metavar="FOLDER", help="Folder of the results.")
]


def enter(
    folder: Annotated[
        str, typer.Argument(metavar="FOLDER", help="A law and entry.toml, or a law of the library.")
    ],
    suite: Annotated[str, typer.Option(metavar="SUITE", help="Suite of problems.")] = "smc-30@1",
    hidden: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Hidden instances: a file with their number, 64 hex digits."
        ),
    ] = None,
    results: Results = Path("results"),
    instances: Annotated[
        int | None, typer.Option(min=1, help="Instances of each problem, in place of 15.")
    ] = None,
    verify: Annotated[
        bool, typer.Option("--verify", help="Run again, and compare with the result that is there.")
    ] = False,
    against: Annotated[
        Path | None,
        typer.Option(
            metavar="RESULTS",
            help="Earlier results, a folder or .zip: say what changed; exit 1 if worse.",
        ),
    ] = None,
) -> None:
    """Enter a law in a benchmark: run it on a suite of problems, and say where it stands.

    FOLDER has one law, law.py, law.c or law.fmu, and entry.toml:

        name = "soft relay"
        authors = ["A. Author"]
        source = "where the law comes from"
        licence = "MIT"
        division = "one set"

        [gains.all]
        k = 4.0

    Divisions: "one set" of gains for all plants; "search", a set for each plant ([gains.duffing])
    by this project's search; "free", a set for each plant found in any way.

    The law runs in a process of its own, with bounds on time and memory. A law that is not checked
    runs twice, in opposite orders, and is marked: it runs in Python, in C or in an FMU, or its file
    can do more than compute.

    Example: smc-mujoco enter entries/soft_relay && smc-mujoco site
    """
    with delay_ctrl_c():
        from smc_mujoco.benchmark import enter as entering
        from smc_mujoco.benchmark.results import TITLES
        from smc_mujoco.benchmark.results import results as load

    terminal = Terminal()
    number = ""
    if hidden:
        with reading(hidden, "file with the number", "write 64 hex digits in it") as file:
            number = file.read_text(encoding="utf-8").strip()
    if against is None:
        earlier = None
    else:
        earlier = load(against, hidden=bool(number))
    target = entering.enter(folder, suite, number, results, instances, verify, progress=True)
    found = load(results / suite, hidden=bool(number))
    name = next(one.name for one in found.entries.values() if one.folder == target)
    about = found.entries[name].about
    for question, board in found.boards().items():
        mine = next(one for one in board.standings if one.entry == name)
        if mine.place:
            place = f"place {mine.place} of {len(board.standings)}"
        else:
            place = "beside the others"
        terminal.print(f"{TITLES[question]}: {place}, {100 * mine.reached:.0f} % of the targets")
    for mark in about["marks"]:
        terminal.note(f"* {mark}")
    terminal.note(f"{about['instances']} instances, {terminal.seconds:.0f} s", "dim")
    terminal.wrote(target)
    if earlier is not None:
        changes = found.compare(earlier)
        terminal.print(str(changes))
        if changes.worse:
            raise typer.Exit(1)


def site(
    results: Results = Path("results"),
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Folder of the pages; none: the folder of the results, site."
        ),
    ] = None,
) -> None:
    """Build static pages of all results: the boards of each suite, and a page for each entry.

    The pages need no network and no server: open results/site/index.html, or copy the folder to any
    host.

    Example: smc-mujoco site --results results --out public
    """
    with delay_ctrl_c():
        from smc_mujoco.benchmark import pages

    terminal = Terminal()
    if not results.is_dir():
        raise ScenarioError(
            f"no folder {str(results)!r}: enter a law first, with smc-mujoco enter FOLDER"
        )
    page, left_out = pages.build(results, results / "site" if out is None else out)
    for why in left_out:
        terminal.note(f"left out: {printable(why)}", wrap=True)
    terminal.wrote(page)


GROUPS = {"Benchmark": [enter, site]}  # heading in the help -> commands
