"""The command line: smc-mujoco, whose commands are those of `commands`."""

import os
import sys
import warnings
from collections.abc import Sequence
from typing import Annotated

import typer

from smc_mujoco.cli.commands import (
    basin,
    bench,
    catalogue,
    check_c,
    claims,
    export_c,
    margins,
    report,
    run,
    show,
    tune,
    view,
)
from smc_mujoco.common.errors import printable
from smc_mujoco.common.gl import choose_gl

app = typer.Typer(
    help="Sliding-mode controllers on MuJoCo mechanisms: run scenes, compare laws, look at traces.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; what the user can mend ends in one sentence and exit code 2."""
    for name in ("stdin", "stdout", "stderr"):  # in this order, so that each gets the descriptor that was closed
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "r" if name == "stdin" else "w"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="replace")  # a terminal that lacks a character shows another
    if not os.environ.get("COLUMNS", "80").strip("0"):
        del os.environ["COLUMNS"]  # 0 is what a terminal without a width says
    choose_gl()  # before a command imports mujoco, which fails where MUJOCO_GL names no backend
    warnings.showwarning = lambda message, *_, **__: print(f"smc-mujoco: {printable(str(message))}", file=sys.stderr)
    app(arguments, prog_name="smc-mujoco")


def play(scene: str) -> None:
    """Run a scene file as a script: `if __name__ == "__main__": smc.play(__file__)`."""
    main(["run", scene, *sys.argv[1:]])


def _version(wanted: bool) -> None:
    if wanted:
        import smc_mujoco

        print(f"smc-mujoco {smc_mujoco.__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Options before a command."""


COMMANDS = {
    "list": catalogue.list_,
    "laws": catalogue.laws,
    "run": run.run,
    "show": show.show,
    "tune": tune.tune,
    "bench": bench.bench,
    "margins": margins.margins,
    "basin": basin.basin,
    "claims": claims.claims,
    "report": report.report,
    "view": view.view,
    "check-c": check_c.check_c,
    "export-c": export_c.export_c,
}
for name, command in COMMANDS.items():
    app.command(name)(command)
