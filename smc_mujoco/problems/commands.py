"""The command of the benchmark: enter a law in a suite."""

from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.console import Terminal, importing
from smc_mujoco.common.errors import find, printable
from smc_mujoco.common.text import counted

Folder = Annotated[
    str, typer.Argument(metavar="FOLDER", help="A law and entry.toml, or a law of the library.")
]
Seed = Annotated[
    int, typer.Option(min=0, help="Seed of the instances; 0: those that everybody can see.")
]
Instances = Annotated[
    int | None, typer.Option(min=1, help="Instances of each problem, in place of 15.")
]
Verify = Annotated[
    bool, typer.Option("--verify", help="Run again, and compare with the result that is there.")
]
Against = Annotated[
    Path | None,
    typer.Option(
        metavar="RESULTS",
        help="Earlier results, a folder or .zip: say what changed; exit 1 if worse.",
    ),
]
Site = Annotated[
    bool, typer.Option("--site", help="Also build static pages of all results, in site.")
]


def enter(
    folder: Folder,
    suite: Annotated[str, typer.Option(metavar="SUITE", help="Suite of problems.")] = "smc-30@1",
    seed: Seed = 0,
    results: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder of the results.")] = Path(
        "results"
    ),
    instances: Instances = None,
    verify: Verify = False,
    against: Against = None,
    site: Site = False,
    threads: options.Threads = None,
    executor: options.Executor = None,
) -> None:
    """Enter a law in a benchmark: run it on a suite of problems, and say where it stands.

    In the suites smc-load@1 and smc-friction@1 the law is a name, FILE.py or either beside a
    compensation, "pid + Feedforward(1)". The command searches for its gains, which takes minutes,
    and writes the board with its row. In the other suites it is a FOLDER that has one law, law.py,
    law.c or law.fmu, and entry.toml:

        name = "soft relay"
        authors = ["A. Author"]
        source = "where the law comes from"
        licence = "MIT"
        division = "one set"

        [gains.all]
        k = 4.0

    Divisions: "one set" of gains for all plants; "search", a set for each plant ([gains.duffing])
    by this project's search; "free", a set for each plant found in any way.

    A law is a program: read a stranger's before you run it. The pages of --site need no network and
    no server.

    Example: smc-mujoco enter my_law.py --suite smc-friction@1

    Example: smc-mujoco enter entries/soft_relay --site
    """
    with importing():
        from smc_mujoco.problems.suite import suites
        from smc_mujoco.problems.tracking import tracking_suites
    find("suite", suite, dict.fromkeys((*tracking_suites(), *suites())))
    if suite in tracking_suites():
        _enter_tracking(folder, suite, results, threads, executor)
        return
    with importing():
        from smc_mujoco.problems import enter as entering
        from smc_mujoco.problems.results import results as load

    terminal = Terminal()
    earlier = None if against is None else load(against)
    target = entering.enter(folder, suite, seed, results, instances, verify)
    loaded = load(target.parent)
    (name,) = [name for name, entry in loaded.entries.items() if entry.folder == target]
    terminal.note(f"{printable(name)} in {loaded.title}")
    terminal.print(loaded.places(name), "")
    about = loaded.entries[name].about
    for failure in about["failures"]:
        terminal.note(f"failed: {printable(failure)}")
    drawn = counted(about["instances"], "instance")
    runs = f"{drawn} of seed {seed}, {counted(about['failed'], 'failed run')}"
    terminal.note(f"{runs}, {terminal.seconds:.0f} s", "dim")
    terminal.wrote(target)
    if site:
        _write_site(results, terminal)
    if earlier is not None:
        changes = loaded.compare(earlier)
        terminal.print(str(changes))
        if changes.worse:
            raise typer.Exit(1)


def _enter_tracking(
    text: str, suite: str, results: Path, threads: int | None, executor: str | None
) -> None:
    """Search for an entry's gains in a suite of tracking problems, and print where it stands."""
    from smc_mujoco.answers.answers import screen_lines
    from smc_mujoco.problems import tracking_page, tracking_results

    terminal = Terminal()
    target = tracking_results.enter_tracking(text, suite, results, threads, True, executor)
    board = tracking_results.tracking_board(suite, results)
    entry = tracking_results.read_result(target).name
    page = tracking_page.write_board(board, target.parent / "board.md", entry)
    for line in screen_lines(board.standing(entry)):
        terminal.note(line)
    terminal.wrote(page)


def _write_site(results: Path, terminal: Terminal) -> None:
    """Write the pages of all results."""
    from smc_mujoco.problems import pages

    page, left_out = pages.build_pages(results, results / "site")
    for why in left_out:
        terminal.note(f"left out: {printable(why)}", wrap=True)
    terminal.wrote(page)


GROUPS = {"Benchmark": [enter]}  # heading in the help -> commands
