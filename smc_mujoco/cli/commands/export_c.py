"""smc-mujoco export-c LAW: a law of the library as one file of C99."""

from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import loading, mendable


@mendable()
def export_c(
    law: options.LawName,
    gains: Annotated[str, typer.Option(metavar="NAME=VALUE,...", help="Gains; the law's own where left out.")] = "",
    numbers: Annotated[
        str, typer.Option("--type", metavar="double|float|q15", help="Numbers; q15 for observer_free only.")
    ] = "double",
) -> None:
    """Write a law out as one file of C99 without dependencies, for firmware or for smc.law_from_c.

    The C is translated from the law's Python, operation by operation. It keeps its state in the memory[] that it is
    given, allocates nothing, and says at its top how many bytes of code and state it takes. In double precision it
    gives the trace of the library's own law; compile it with -ffp-contract=off for the same bits.

    Example: smc-mujoco export-c observer_free --gains lam=6,k1=3 --type float > observer_free.c
    """
    with loading():
        from smc_mujoco.control.c.export import law_to_c
        from smc_mujoco.control.c.load import parsed_gains
        from smc_mujoco.control.law import law as find

    print(law_to_c(find(law, **parsed_gains(gains, "--gains")), numbers), end="")
