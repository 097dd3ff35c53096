"""smc-mujoco list, laws: what there is to choose from."""

import inspect
from collections.abc import Callable
from typing import Annotated, TypeVar

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Terminal, errors_as_sentences
from smc_mujoco.common.interrupts import delay_ctrl_c

T = TypeVar("T")


@errors_as_sentences()
def list_() -> None:
    """List plants, laws, surfaces, velocity estimators, scenes, and conditions.

    The line about an entry of another installed package ends with the name of that package, in brackets.
    """
    with delay_ctrl_c():
        from smc_mujoco.cli import law_pages, tables
        from smc_mujoco.common.catalogue import Catalogue
        from smc_mujoco.mechanisms.plant import catalogue as plants
        from smc_mujoco.simulation.conditions import DURATION, NAMED
        from smc_mujoco.studies import scene

    def first_line(doc: str | None) -> str:
        return (doc or "").strip().partition("\n")[0].rstrip(":")  # a colon where a formula follows

    def listed(known: Catalogue[T], doc: Callable[[T], str | None]) -> list[tuple[str, str]]:
        lines = {name: first_line(doc(entry)) for name, entry in known.items()}
        return [(name, tables.with_package(line, known.package(name))) for name, line in lines.items()]

    lists = {"Plants": listed(plants(), lambda plant: getattr(inspect.getmodule(plant.build), "__doc__", ""))}
    for title, templates in law_pages.CATALOGUES.items():
        lists[title] = listed(templates(), lambda template: template.doc)
    lists["Scenes, for smc-mujoco run"] = listed(scene.scenes(), scene.question)
    machine = plants()["inverted_pendulum"]  # it has stops, and numbers for jumps
    lists["Conditions, on inverted_pendulum for 10 s"] = [
        (name, condition.brief(machine, DURATION) or "the scenario's defaults") for name, condition in NAMED.items()
    ]
    terminal = Terminal()
    for title, rows in lists.items():
        terminal.print(tables.catalogue(title, rows), "")


@errors_as_sentences()
def laws(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME|FILE",
            autocompletion=options.LAWS,
            help="A law, surface or velocity estimator, or a file with a law; by default all.",
        ),
    ] = None,
    needs: Annotated[
        str | None,
        typer.Option(
            help="Only laws that have all these, as a,b: no-velocity, no-acceleration, no-model, continuous (u), "
            "finite-time (of the error), finite-reaching (of s), one-gain, two-gains (at most)."
        ),
    ] = None,
    plant: Annotated[
        str | None, typer.Option(metavar="PLANT", autocompletion=options.PLANTS, help="Only laws that suit a plant.")
    ] = None,
) -> None:
    """Show all laws, surfaces and velocity estimators, those laws that suit, or one in full with gains and source.

    The column deg is the relative degree of the variable that a law drives to zero: 1 for a sliding variable s, of any
    surface of degree 1; 2 for the error e and its rate; 3 for e and two rates.

    The command "smc-mujoco which" compares laws that suit a plant, and advises one.

    Example: smc-mujoco laws super_twisting

    Example: smc-mujoco laws --needs continuous,two-gains
    """
    with delay_ctrl_c():
        from smc_mujoco.cli import law_pages
        from smc_mujoco.common.errors import ScenarioError

    filtered = needs is not None or plant is not None
    if name is not None and filtered:
        raise ScenarioError(f"laws {name} shows one law: leave it out, or leave out --needs and --plant")
    if filtered:
        chosen = None if plant is None else options.plant(plant)
        law_pages.print_suitable(options.names(needs), chosen, Terminal())
    elif name is None:
        law_pages.print_lists(Terminal())
    else:
        law_pages.print_pages(name, Terminal())
