"""smc-mujoco list, laws: what there is to choose from."""

from typing import Annotated

import typer

from smc_mujoco.cli.terminal import loading, mendable


def list_() -> None:
    """List plants, laws, surfaces, velocity estimators, scenes, and the conditions of the paper's study."""
    with mendable():
        with loading():
            from rich.console import Console

            from smc_mujoco.cli import show

        show.catalogues(Console())


def laws(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="A law, a surface or a velocity estimator; all without one.")
    ] = None,
) -> None:
    """Show the laws there are, or one in full: formula, gains, conditions, discretisation, source.

    The table has every law, surface and velocity estimator with its formula. deg is the relative degree of what a law
    acts on: 1 a sliding variable s, with any surface of degree 1; 2 the error e and its rate; 3 e and two rates.

    Example: smc-mujoco laws super_twisting
    """
    with mendable():
        with loading():
            from rich.console import Console

            from smc_mujoco.cli import lawbook

        lawbook.show(name, Console())
