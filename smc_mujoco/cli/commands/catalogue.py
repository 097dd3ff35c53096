"""smc-mujoco list, laws: what there is to choose from."""

import sys
from typing import Annotated

import typer

from smc_mujoco.cli.terminal import loading, mendable


@mendable()
def list_() -> None:
    """List plants, laws, surfaces, velocity estimators, scenes, and the conditions of the paper's study."""
    with loading():
        from rich.console import Console

        from smc_mujoco.cli import tables
        from smc_mujoco.control.estimator import catalogue as estimators
        from smc_mujoco.control.law import catalogue as laws
        from smc_mujoco.control.surface import catalogue as surfaces
        from smc_mujoco.mechanisms.plant import catalogue as plants
        from smc_mujoco.studies import scene
        from smc_mujoco.studies.paper import scenarios

    console = Console()

    def first(doc: str | None) -> str:
        return (doc or "").strip().partition("\n")[0].rstrip(":")  # before a formula

    known = {
        "Plants": ((name, first(sys.modules[p.build.__module__].__doc__)) for name, p in plants().items()),
        "Laws": ((name, first(t.doc)) for name, t in laws().items()),
        "Surfaces": ((name, first(t.doc)) for name, t in surfaces().items()),
        "Velocity estimators": ((name, first(t.doc)) for name, t in estimators().items()),
        "Scenes, for smc-mujoco run": ((name, scene.question(path)) for name, path in scene.scenes().items()),
    }
    for title, rows in known.items():
        console.print(tables.catalogue(title, rows), "")
    names = ", ".join(scenarios.CONDITIONS)
    console.print(tables.catalogue("Conditions, for smc.paper.comparison(plant, condition)", [("", names)]))


@mendable()
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
    with loading():
        from rich.console import Console

        from smc_mujoco.cli import law_pages

    law_pages.print_pages(name, Console())
