"""The commands of the exchange annex: laws in C and as FMUs, and the live page."""

import math
import re
from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Terminal
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.interrupts import delay_ctrl_c

ARGUMENT_AT_END = re.compile(r"\b(gains|memory|timeout|flag)s?=$")  # of law_from_c, at the end of its error sentences


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
    law's memory, state kept elsewhere (such as static data), and a changed rounding mode or flush-to-zero. It then runs
    a .c file with the compiler's address and undefined-behaviour sanitizers. Any finding ends in exit code 2. smc_law.h
    describes the signature; it is at the top of every file that `smc-mujoco export-c` writes.

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


def export_fmu(
    law: options.LawText,
    gains: options.GainValues = "",
    surface: Annotated[
        str | None, typer.Option(metavar="NAME|TEXT", help="A surface, as linear(c=3); default the law's own.")
    ] = None,
    velocity: Annotated[
        str | None,
        typer.Option(metavar="NAME|TEXT", help="A velocity estimator, as levant(L=4800); default v is an input."),
    ] = None,
    period: Annotated[float, typer.Option(help="Control period, s.")] = 1e-3,
    u_max: Annotated[float, typer.Option("--u-max", help="Bound on |u|, N or N m.")] = math.inf,
    model: Annotated[
        str | None,
        typer.Option(metavar="none|nominal", help="nominal: f and g of x'' = f + g u are inputs; default as needed."),
    ] = None,
    joint: Annotated[str, typer.Option(metavar="hinge|slide", help="Units: rad and N m, or m and N.")] = "hinge",
    joints: options.Joints = None,
    binary: Annotated[bool, typer.Option(help="Whether to compile a binary for this machine.")] = True,
    out: Annotated[Path | None, typer.Option(help="The file to write; default the law's name with .fmu.")] = None,
) -> None:
    """Write a law as an FMU for Simulink, Modelica and other tools: FMI 3.0 for Co-Simulation.

    The file contains C source code and a binary for this machine; it needs no Python. Its inputs are x, v (unless an
    estimator replaces it), the reference r and dr, and ddr if the law reads it. Its outputs are u and s. All gains are
    tunable parameters. The law runs every --period seconds on the inputs as they are at that time. In double precision
    it gives the bits of `smc-mujoco run`. LAW may also be a file: my_law.py with one law, made by
    @smc.law_function, or gains.json that `smc-mujoco tune --out` wrote.

    A law of many joints has a variable for each element: x[1], x[2], M[1,1]. Its inputs are also those of M, h, g, the
    matrix C of Coriolis forces and the tip's Jacobian J that it reads. Its gains may have one value for each joint, as
    in --gains "k=8 20 15,c=5".

    Example: smc-mujoco export-fmu super_twisting --gains k1=5,k2=8 --velocity levant --u-max 6 --out controller.fmu
    """
    with delay_ctrl_c():
        from smc_mujoco.exchange.fmu.export import export_fmu as export

    chosen = options.law_with(law, gains)
    with options.joints_as_option():
        path = export(
            chosen, out, surface=surface, velocity=velocity, control_period=period, u_max=u_max, model=model,
            joint=joint, joints=joints, binary=binary,
        )  # fmt: skip
    print(f"{path}, {path.stat().st_size / 1024:.0f} kB; FMI 3.0, Co-Simulation, every {period:g} s")


def live(
    plants: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[PLANT...]",
            autocompletion=options.PLANTS,
            help="Plants with one motor; by default inverted_pendulum, duffing and van_der_pol.",
        ),
    ] = None,
    law: Annotated[
        list[str] | None,
        typer.Option(metavar="LAW|FILE", help="Your own law, in addition to the library's; may be repeated."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the page.")] = Path("live"),
) -> None:
    """Build a web page in which MuJoCo runs: choose laws, move sliders, push the machine, compare two laws.

    The page is a folder of files. Any web server can serve it without this package and without network, for example
    `python -m http.server --directory live`. The browser simulates the models of the package under its laws, translated
    to JavaScript, with the same sampling, delay, noise and integrator. Its traces are those of `smc-mujoco run` within
    rounding. The address of the page holds all that you set, so that a link shares it.

    `--law` takes a Python file with laws made by @smc.law_function, a law with gains such as "pid(kp=50, ki=1)", or
    gains.json that `smc-mujoco tune --out` wrote.

    The first build fetches MuJoCo for browsers and three.js (10 MB) with npm. Node.js has npm, and so has
    `pip install 'smc-mujoco[live]'`.

    Example: smc-mujoco live duffing cart_pole --law my_law.py
    """
    with delay_ctrl_c():
        from smc_mujoco.common.progress import bar
        from smc_mujoco.exchange.live.build import DEFAULT_PLANTS
        from smc_mujoco.exchange.live.build import live as build

    terminal = Terminal()
    with bar("the live page", shown=terminal.is_terminal):
        page = build(plants or DEFAULT_PLANTS, law or (), out)
    terminal.wrote(page)
    terminal.note(f"serve it: python -m http.server --directory {page.parent}")


# heading in the help -> commands
GROUPS = {"Run and look": [live], "Exchange": [export_c, check_c, export_fmu]}
