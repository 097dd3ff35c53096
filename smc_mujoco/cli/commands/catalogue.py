"""smc-mujoco list, laws: what there is to choose from."""

import inspect
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Terminal
from smc_mujoco.common.interrupts import delay_ctrl_c


def list_() -> None:
    """List plants, laws, surfaces, velocity estimators, scenes, and conditions.

    The line about an entry of another installed package ends with the name of that package, in brackets.
    """
    with delay_ctrl_c():
        from smc_mujoco.cli import law_pages, tables
        from smc_mujoco.mechanisms.plant import catalogue as plants
        from smc_mujoco.simulation.conditions import DURATION, NAMED
        from smc_mujoco.studies import scene

    lists = {
        "Plants": tables.listed(plants(), lambda plant: getattr(inspect.getmodule(plant.build), "__doc__", "")),
        **law_pages.lists(),
        "Scenes, for smc-mujoco run": tables.listed(scene.scenes(), scene.question),
    }
    machine = plants()["inverted_pendulum"]  # it has stops, and numbers for jumps
    lists["Conditions, on inverted_pendulum for 10 s"] = [
        (name, condition.brief(machine, DURATION) or "the scenario's defaults") for name, condition in NAMED.items()
    ]
    terminal = Terminal()
    for title, rows in lists.items():
        terminal.print(tables.catalogue(title, rows), "")


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
        law_pages.print_suitable(options.names(needs), plant, Terminal())
    elif name is None:
        law_pages.print_lists(Terminal())
    else:
        law_pages.print_pages(name, Terminal())
