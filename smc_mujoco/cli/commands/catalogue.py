"""smc-mujoco list, laws: what there is to choose from."""

import sys
from typing import Annotated

import typer

from smc_mujoco.cli.terminal import Terminal, errors_as_sentences
from smc_mujoco.common.interrupts import held_back


@errors_as_sentences()
def list_() -> None:
    """List plants, laws, surfaces, velocity estimators, scenes, and the conditions of the paper's study."""
    with held_back():
        from smc_mujoco.cli import law_pages, tables
        from smc_mujoco.mechanisms.plant import catalogue as plants
        from smc_mujoco.studies import scene
        from smc_mujoco.studies.paper import scenarios

    def first_line(doc: str | None) -> str:
        return (doc or "").strip().partition("\n")[0].rstrip(":")  # a formula may follow

    lists = {"Plants": [(name, first_line(sys.modules[p.build.__module__].__doc__)) for name, p in plants().items()]}
    for title, templates in law_pages.CATALOGUES.items():
        lists[title] = [(name, first_line(template.doc)) for name, template in templates().items()]
    lists["Scenes, for smc-mujoco run"] = [(name, scene.question(path)) for name, path in scene.scenes().items()]
    lists["Conditions, for smc.paper.comparison(plant, condition)"] = [("", ", ".join(scenarios.CONDITIONS))]
    terminal = Terminal()
    for title, rows in lists.items():
        terminal.print(tables.catalogue(title, rows), "")


@errors_as_sentences()
def laws(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="A law, surface or velocity estimator; by default all.")
    ] = None,
) -> None:
    """Show all laws, surfaces and velocity estimators, or one in full: formula, gains, conditions, source.

    The column deg is the relative degree of the variable that a law drives to zero: 1 for a sliding variable s, of any
    surface of degree 1; 2 for the error e and its rate; 3 for e and two rates.

    Example: smc-mujoco laws super_twisting
    """
    with held_back():
        from smc_mujoco.cli import law_pages

    law_pages.print_pages(name, Terminal())
