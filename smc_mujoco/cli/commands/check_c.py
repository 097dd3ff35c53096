"""smc-mujoco check-c FILE: a law of your own in C, tried in a process of its own."""

import re
from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.terminal import loading, mendable
from smc_mujoco.common.errors import ScenarioError

OPTIONS = re.compile(r"\b(gains|memory|timeout|flag)s?=$")  # arguments of law_from_c, with which its sentences end


@mendable()
def check_c(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A .c file with smc_law in it, or a .so.")],
    gains: Annotated[
        str, typer.Option(metavar="NAME=VALUE,...", help="Its gains, in order. If the file names them: other values.")
    ] = "",
    memory: Annotated[int | None, typer.Option(min=1, help="Numbers of state; default: what it says, or 8.")] = None,
    symbol: Annotated[str, typer.Option(help="The function's name.")] = "smc_law",
    flag: Annotated[list[str] | None, typer.Option(help="One more for the compiler, such as --flag=-Iinclude.")] = None,
    timeout: Annotated[float, typer.Option(help="Seconds for the compiler, the set-up and the trial, each.")] = 10.0,
) -> None:
    """Compile a control law in C and try it in a process of its own: says what is wrong with it in one sentence.

    It is run on a double integrator under noise, with and without model and surface, for 10 s and at later times, and
    called at states far away. A crash, an endless loop, NaN, gains without a name, a write beyond its memory, state
    kept outside of it (static data, above all), and changed rounding or flush-to-zero end in exit code 2. A .c file is
    then run with the compiler's address and undefined-behaviour sanitizers. The signature is told in smc_law.h, which
    stands at the top of every file that `export-c` writes.

    The process is not a sandbox: the law can open files and connections, as any program can that you start.

    Example: smc-mujoco check-c my_law.c --gains lam=6,k1=3
    """
    with loading():
        from smc_mujoco.control.c.load import check, parsed_gains

    given = parsed_gains(gains, "--gains") if gains else None
    try:
        for line in check(file, given, memory, symbol, flag or (), timeout):
            print(line)
    except ScenarioError as error:
        raise ScenarioError(OPTIONS.sub(r"--\1", str(error))) from None
