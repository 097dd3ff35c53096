"""smc-mujoco check-c, export-c: control laws in C."""

import re
from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import errors_as_sentences
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.interrupts import delay_ctrl_c

ARGUMENT_AT_END = re.compile(r"\b(gains|memory|timeout|flag)s?=$")  # of law_from_c, at the end of its error sentences


@errors_as_sentences()
def check_c(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A .c file with smc_law in it, or a .so.")],
    gains: Annotated[
        str, typer.Option(metavar="NAME=VALUE,...", help="The law's gains, in order, if the file does not define them.")
    ] = "",
    memory: Annotated[
        int | None, typer.Option(min=1, help="How many numbers its memory has; default as the file says, or 8.")
    ] = None,
    symbol: Annotated[str, typer.Option(help="Name of the function.")] = "smc_law",
    flag: Annotated[
        list[str] | None, typer.Option(help="A compiler flag, as --flag=-Iinclude; may be repeated.")
    ] = None,
    timeout: Annotated[float, typer.Option(help="Seconds that compiler, set-up and trial may take, each.")] = 10.0,
) -> None:
    """Compile a control law in C, try it in a separate process, and say in one sentence what is wrong with it.

    The trial runs the law on a double integrator under noise, with and without model and surface, for 10 s. It also
    calls the law at later times and with very large errors. It finds crashes, endless loops, NaN, writes beyond the
    law's memory, state kept elsewhere (such as static data), and a changed rounding mode or flush-to-zero. Any finding
    ends in exit code 2. smc_law.h describes the signature; it is at the top of every file that `smc-mujoco export-c`
    writes.

    The process is not a sandbox: the law can open files and connections, like any program that you start.

    Example: smc-mujoco check-c my_law.c --gains lam=6,k1=3
    """
    with delay_ctrl_c():
        from smc_mujoco.control.from_text import parsed_gains
        from smc_mujoco.exchange.c.load import check

    values = parsed_gains(gains, "--gains") if gains else None
    try:
        for line in check(file, values, memory, symbol, flag or (), timeout):
            print(line)
    except ScenarioError as error:
        raise ScenarioError(ARGUMENT_AT_END.sub(r"--\1", str(error))) from None


@errors_as_sentences()
def export_c(
    law: options.LawText,
    gains: options.GainValues = "",
    numbers: Annotated[
        str, typer.Option("--type", metavar="double|float|q15", help="Type of numbers; q15 for observer_free only.")
    ] = "double",
    joints: options.Joints = None,
) -> None:
    """Write a law as one file of C99 without dependencies, for firmware or for smc.law_from_c.

    The C is translated from the law's Python, operation by operation. It keeps its state in the array memory[] that its
    caller passes, and allocates nothing. The comment at its top says how many bytes of code and state it takes. In
    double precision it gives the trace of the library's own law; compile it with -ffp-contract=off to get the same
    bits.

    LAW may also be a file: my_law.py with one law, made by @smc.law_function, or gains.json that `smc-mujoco tune
    --out` wrote.

    A law of many joints is written for a number of joints. Its gains may have one value for each joint, as in
    --gains "k=8 20 15,c=5".

    Example: smc-mujoco export-c observer_free --gains lam=6,k1=3 --type float > observer_free.c
    """
    with delay_ctrl_c():
        from smc_mujoco.exchange.c.export import law_to_c

    with options.joints_as_option():
        text = law_to_c(options.law_with(law, gains), numbers, joints)
    print(text, end="")
