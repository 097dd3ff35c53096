"""smc-mujoco export-fmu, check-fmu: controllers as FMUs, for Simulink, Modelica and back."""

import math
from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import errors_as_sentences
from smc_mujoco.common.interrupts import delay_ctrl_c


@errors_as_sentences()
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


@errors_as_sentences()
def check_fmu(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="An .fmu file of FMI 2.0 or 3.0 for Co-Simulation.")],
    variables: Annotated[
        str,
        typer.Option(
            metavar="NAME=VARIABLE,...",
            help="Its variables for x, v, r, u, ..., as x=theta,u=torque; default by their names.",
        ),
    ] = "",
    constants: Annotated[
        str, typer.Option(metavar="VARIABLE=VALUE,...", help="Inputs that keep one value, as enable=1.")
    ] = "",
    period: Annotated[float | None, typer.Option(help="Seconds between its steps; default its own period.")] = None,
    timeout: Annotated[float, typer.Option(help="Seconds that the trial may take.")] = 30.0,
) -> None:
    """Try a controller in an FMU in a separate process, and show its inputs, outputs, period and gains.

    The trial runs it for 500 steps on a double integrator. A failure, a crash, an endless step or a command that is not
    finite ends in one sentence and exit code 2. An FMU that passes can be used as a law: smc.law_from_fmu(FILE). The
    command needs FMPy: `pip install 'smc-mujoco[fmu]'`.

    Example: smc-mujoco check-fmu controller.fmu --variables x=theta,v=omega,u=torque --constants enable=1
    """
    with delay_ctrl_c():
        from smc_mujoco.exchange.fmu.load import check

    values = options.numbers(constants or None, "--constants", "enable=1")
    meanings = options.pairs(variables or None, "--variables", "x=theta,u=torque")
    for line in check(file, timeout, variables=meanings, constants=values, period=period):
        print(line)
