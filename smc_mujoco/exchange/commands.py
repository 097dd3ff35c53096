"""smc-mujoco export: a law as C or as an FMU."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.console import importing
from smc_mujoco.common.errors import ScenarioError

if TYPE_CHECKING:
    from smc_mujoco.control.law import Law
    from smc_mujoco.simulation.scenario import Scenario

What = Annotated[
    list[str],
    typer.Argument(
        metavar="[LAW] OUT",
        autocompletion=options.LAWS,
        help="A law, and OUT.c or OUT.fmu.",
        show_default=False,
    ),
]
Numbers = Annotated[
    str,
    typer.Option(
        "--type",
        metavar="double|float|q15",
        help="C: type of numbers; q15 for observer_free only.",
    ),
]
Surface = Annotated[
    str | None,
    typer.Option(
        metavar="NAME|TEXT", help="FMU: a surface, as linear(c=3); default the law's own."
    ),
]
Velocity = Annotated[
    str | None,
    typer.Option(
        metavar="NAME|TEXT",
        help="FMU: a velocity estimator, as levant(L=4800); default v is an input.",
    ),
]
UMax = Annotated[float, typer.Option("--u-max", help="FMU: bound on |u|, N or N m.")]
Model = Annotated[
    str | None,
    typer.Option(
        metavar="none|nominal",
        help="FMU: nominal: f and g of x'' = f + g u are inputs; default as needed.",
    ),
]
Ros2 = Annotated[
    bool, typer.Option("--ros2", help="Write OUT as a package for ros2_control, a folder.")
]
Plain = Annotated[bool, typer.Option("--plain", help="Write OUT as C with a main loop, a folder.")]
Binary = Annotated[bool, typer.Option(help="FMU: whether to compile a binary for this machine.")]


def export(
    ctx: typer.Context,
    what: What,
    gains: options.GainValues = "",
    joints: options.Joints = None,
    numbers: Numbers = "double",
    surface: Surface = None,
    velocity: Velocity = None,
    period: Annotated[float, typer.Option(help="FMU: control period, s.")] = 1e-3,
    u_max: UMax = math.inf,
    model: Model = None,
    binary: Binary = True,
    ros2: Ros2 = False,
    plain: Plain = False,
) -> None:
    """Export a law as C or as an FMU, to OUT.c or OUT.fmu; or as a folder that compiles as it is.

    LAW is a name of `smc-mujoco list`, my_law.py with one law, made by @smc.law_function, or
    gains.json that `smc-mujoco tune --out` wrote. If you leave it out, it is the name of OUT, as in
    observer_free.c. A law of many joints may have one value of a gain for each joint, as in --gains
    "k=8 20 15,c=5".

    - OUT.c: C99 without dependencies, for firmware or for smc.law_from. The C is translated from
      the law's Python, operation by operation. It keeps its state in the array memory[] that its
      caller passes, and allocates nothing. The comment at its top says how many bytes of
      state it takes. In double precision it gives the trace of the library's own law; compile it
      with -ffp-contract=off to get the same bits.
    - OUT.fmu: FMI 3.0 for Co-Simulation, for Simulink, Modelica and other tools, with C source code
      and a binary for this machine; it needs no Python. Its inputs are x, v (unless an estimator
      replaces it), the reference r and dr, and ddr if the law reads it. Its outputs are u and s.
      All gains are tunable parameters. The law runs every
      --period seconds on the inputs as they are at that time. A law of many joints has a variable
      for each element: x[1], x[2], M[1,1], and inputs for those of M, h, g, the matrix C of
      Coriolis forces and the tip's Jacobian J that it reads.

    Example: smc-mujoco export observer_free.c --gains lam=6,k1=3 --type float

    With --ros2 OUT is a folder, a package of ros2_control with the law's gains, bound, estimator
    and compensation of friction as parameters; with --plain a folder of C with a main loop and a
    Makefile. A file that tune or which wrote gives all of these.

    Example: smc-mujoco export which/recommended.json my_controller --ros2

    Example: smc-mujoco export super_twisting controller.fmu --gains k1=5,k2=8 --velocity levant
    --u-max 6
    """
    packed = ros2 or plain
    name, out = _law_and_file(what, packed)
    of_controller = "surface", "velocity", "period", "u_max"
    options.only_for(ctx, ("numbers",), out.suffix == ".c", "OUT.c")
    options.only_for(ctx, ("model", "binary"), out.suffix == ".fmu", "OUT.fmu")
    options.only_for(ctx, of_controller, packed or out.suffix == ".fmu", "OUT.fmu or a folder")
    if ros2 and plain:
        raise ScenarioError("a folder is for --ros2 or --plain: give one of them")
    with importing():
        from smc_mujoco.control import from_text
    chosen = from_text.law(
        name,
        **from_text.parsed_gains(gains, "--gains"),  # pyright: ignore[reportArgumentType]
    )
    with importing():
        if packed:
            from smc_mujoco.exchange.loop.package import law_to_package

            what_it_is = "a package for ros2_control" if ros2 else "C with a main loop"
            kind = "ros2" if ros2 else "plain"
            tuned = _tuned_scenario(name, gains)
            if tuned is not None:
                law_to_package(tuned, out, kind)
            else:
                law_to_package(
                    chosen,
                    out,
                    kind,
                    surface=surface,
                    velocity=velocity,
                    control_period=period,
                    u_max=u_max,
                    joints=joints,
                )
        elif out.suffix == ".c":
            _write_c(out, chosen, numbers, joints)
            what_it_is = "C99"
        else:
            from smc_mujoco.exchange.fmu.export_fmu import law_to_fmu

            law_to_fmu(
                chosen,
                out,
                surface=surface,
                velocity=velocity,
                control_period=period,
                u_max=u_max,
                model=model,
                joints=joints,
                binary=binary,
            )
            what_it_is = f"FMI 3.0, Co-Simulation, every {period:g} s"
    size = "" if packed else f", {out.stat().st_size / 1024:.0f} kB"
    print(f"{out}{size}; {what_it_is}")


def _tuned_scenario(name: str, gains: str) -> "Scenario | None":
    """Return the scenario of a tuning's file, which has the bound and the estimator, too; None for
    another law.
    """
    if not name.endswith(".json") or gains:
        return None
    from smc_mujoco.analysis.tuning.result import load_tuned

    tuned = load_tuned(name)
    return tuned.definition.scenarios(tuned.plant, tuned.law, tuned.seed)[0]


def _law_and_file(what: list[str], packed: bool) -> tuple[str, Path]:
    """Return the text of the law and the file or the folder to write, from the command's
    arguments.
    """
    *laws, last = what
    out = Path(last)
    if packed and out.suffix:
        raise ScenarioError(f"cannot write {last} as a folder: give a name without an ending")
    if not packed and out.suffix not in (".c", ".fmu"):
        raise ScenarioError(
            f"cannot write {last}: end its name in .c or .fmu, or add --ros2 or --plain"
        )
    if len(laws) > 1:
        raise ScenarioError(f"{len(laws)} laws for {out}: give one")
    return laws[0] if laws else out.stem, out


def _write_c(out: Path, law: "Law", numbers: str, joints: int | None) -> None:
    """Write a law as C."""
    from smc_mujoco.common.files import write_text
    from smc_mujoco.exchange.c.export_c import law_to_c

    text = law_to_c(law, numbers, joints)
    write_text(out, text)


# heading in the help -> commands
GROUPS = {"Exchange": [export]}
