"""The command line: smc-mujoco, whose commands are those of `commands`."""

import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.answers import command
from smc_mujoco.cli.commands import (
    analysis,
    glossary,
    listing,
    machine_numbers,
    rigs,
    run_and_look,
    studies,
)
from smc_mujoco.cli.console import errors_as_sentences
from smc_mujoco.cli.help_pages import GroupedCommand, GroupedProgram, with_all
from smc_mujoco.common import annexes
from smc_mujoco.common.errors import ScenarioError, UnitWarning, printable
from smc_mujoco.common.gl import choose_gl
from smc_mujoco.common.version import __version__

app = typer.Typer(
    help="Simulate, compare and tune sliding-mode controllers on MuJoCo mechanisms.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    cls=GroupedProgram,
)
DRAWN = ("film", "figure", "plot", "video")  # commands that do not exist, and that users try
# heading in the help -> commands; the annexes add theirs
GROUPS: dict[str, list[Callable[..., None]]] = {
    "Run and look": [
        listing.list_,
        glossary.explain,
        run_and_look.run,
        run_and_look.show,
        run_and_look.view,
    ],
    "Compare": [studies.compare, studies.which],
    "Tune and analyse": [
        analysis.tune,
        analysis.margins,
        analysis.worst,
        analysis.sensitivity,
    ],
    "Machines": [machine_numbers.excitation, machine_numbers.identify, rigs.rig],
}
for annex in sorted(filter(annexes.installed, annexes.ANNEXES)):
    more = annexes.module(f"smc_mujoco.{annex}.commands", "the command line").GROUPS
    for group, commands in more.items():
        GROUPS.setdefault(group, []).extend(commands)
for group, commands in GROUPS.items():
    for function in commands:
        name = function.__name__.strip("_").replace("_", "-")  # list_ -> list, export_c -> export-c
        command_of = app.command(name, cls=GroupedCommand, rich_help_panel=group)
        command_of(errors_as_sentences()(function))


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line.

    An error that the user can correct ends in one sentence and exit code 2.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by the shell, as by >&-
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        # a character that the terminal lacks is shown as ?
        stream.reconfigure(errors="replace")  # pyright: ignore[reportAttributeAccessIssue] Python made it a TextIOWrapper
    if threading.current_thread() is threading.main_thread():
        # ends as Ctrl-C does, and leaves no half-written files
        signal.signal(signal.SIGTERM, _end)
    choose_gl()  # before a command imports mujoco, which fails if MUJOCO_GL does not name a backend
    warnings.showwarning = _showing_once()
    words = sys.argv[1:] if arguments is None else arguments
    if words and words[0] in DRAWN:
        with errors_as_sentences():
            raise ScenarioError(
                f"no command {words[0]!r}: `smc-mujoco run SCENE` writes figures and a film, and "
                "smc.figure and smc.film draw any traces in Python"
            )
    if words and words[0] == "run" and "--law" in words:
        with errors_as_sentences():
            raise ScenarioError(
                "run takes a scene, which has its laws: `smc-mujoco compare PLANT --law LAW` runs "
                "laws on a plant"
            )
    command.remember(words)
    try:
        app(with_all(words), prog_name=command.PROGRAM)
    finally:
        command.remember(())  # what follows is Python's


def _showing_once() -> Callable[..., None]:
    """Return a showwarning that prints each sentence once, also if parts of a command repeat it."""
    sentences: set[str] = set()

    def show(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
        if (sentence := printable(str(message))) not in sentences:
            if issubclass(category, UnitWarning):
                command.doubt(sentence)
            sentences.add(sentence)
            print(f"smc-mujoco: {sentence}", file=sys.stderr)

    return show


def _end(*_: object) -> None:
    """End as Ctrl-C does, also where that is ignored, as in a shell's background job."""
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.raise_signal(signal.SIGINT)
    raise KeyboardInterrupt


def play(scene: str) -> None:
    """Run a scene file as a script: `if __name__ == "__main__": smc.play(__file__)`."""
    main(["run", os.fspath(scene), *sys.argv[1:]])


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"smc-mujoco {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """Define the options that come before a command."""
