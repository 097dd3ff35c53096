"""smc-mujoco list: what there is to choose from, and a page about one of it."""

import inspect
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from smc_mujoco.cli import names
from smc_mujoco.cli.commands import options
from smc_mujoco.cli.console import Terminal, importing
from smc_mujoco.common import annexes

if TYPE_CHECKING:
    from smc_mujoco.metrics.conventions import Metric

CONDITIONS = "conditions"
KINDS = ("plants", "laws", "surfaces", "estimators", "scenes", CONDITIONS, "metrics")
C_TIME = 10.0  # s, that compiler and trial of a law in C may take, each; chosen


Name = Annotated[
    str | None,
    typer.Argument(
        metavar="NAME|FILE",
        autocompletion=options.LAWS,
        help="A law, surface, velocity estimator, plant, scene, condition or metric, a file "
        "with a law, or a kind, such as scenes; by default all of these.",
    ),
]
Needs = Annotated[
    str | None,
    typer.Option(
        "--need",
        help="Only laws with these properties, as a,b: no-velocity, no-model, continuous "
        "(u), finite-time (of the error), one-gain, two-gains (at most).",
    ),
]
Plant = Annotated[
    str | None,
    typer.Option(
        metavar="PLANT",
        autocompletion=options.PLANTS,
        help="Only laws that suit a plant; with the name of a condition, what it is on this plant.",
    ),
]


def list_(
    ctx: typer.Context,
    name: Name = None,
    needs: Needs = None,
    plant: Plant = None,
    json: options.Json = None,
    full: options.Full = False,
) -> None:
    """List plants, laws, surfaces, velocity estimators, scenes and conditions, or show a law in
    full.

    What another installed package adds is followed by that package's name in brackets. A law is
    shown with its gains and source. The command "smc-mujoco which" compares the laws that suit a
    plant, and recommends one.

    FILE.c (or .so) is compiled and loaded, and one sentence says what is wrong with it (docs/c.md).
    It is a program: load only what you trust.

    Example: smc-mujoco list super_twisting

    Example: smc-mujoco list --need continuous,two-gains

    Example: smc-mujoco list my_law.c
    """
    options.only_for(ctx, ("needs",), name is None, "lists: leave out NAME")
    options.only_for(ctx, ("full",), name is None, "the whole list: leave out NAME")
    if name is not None and plant is not None:
        with importing():
            from smc_mujoco.simulation.conditions import NAMED
        about_condition = name == CONDITIONS or name in NAMED
        options.only_for(ctx, ("plant",), about_condition, "lists and conditions: leave out NAME")
    terminal = Terminal(json)
    if name is not None and Path(name).suffix in (".c", ".so"):
        with importing():
            loader = annexes.module("smc_mujoco.exchange.c.law_from_c", f"a law in C, {name},")
        lines = loader.check_law_source(Path(name), None, None, "smc_law", (), C_TIME)
        terminal.print(*lines, sep="\n", soft_wrap=True)
    elif name is not None and name not in KINDS:
        with importing():
            from smc_mujoco.cli import law_pages
            from smc_mujoco.mechanisms.plant import plant_catalogue as plants
            from smc_mujoco.metrics.catalogue import CATALOGUE
            from smc_mujoco.simulation.conditions import NAMED
            from smc_mujoco.studies.scene import scenes
        if name in {*NAMED, *CATALOGUE, *scenes()} - {*plants()}:
            _print_all(terminal, name, plant)
        else:
            law_pages.print_pages(name, terminal)
    elif name is None and (needs is not None or plant is not None):
        with importing():
            from smc_mujoco.cli import law_pages
        law_pages.print_suitable(options.parsed_names(needs), plant, terminal)
    elif name is None and not full and json is None and not names.of_others():
        _print_names(terminal, names.names())
    else:
        _print_all(terminal, name or "", plant, names_alone=name is None and not full)
    terminal.finish()


def _print_names(terminal: Terminal, names_by_kind: Sequence[tuple[str, Sequence[str]]]) -> None:
    from smc_mujoco.answers.answers import labelled
    from smc_mujoco.answers.facts import Fact
    from smc_mujoco.answers.templates import said

    facts = [Fact("names", label=kind, names=names) for kind, names in names_by_kind]
    terminal.note("\n".join(labelled(map(said, [*facts, Fact("listed")]))))


def _about(metric: "Metric") -> str:
    """Return a metric's summary, with its units for hinges and slides if it has one."""
    units = dict.fromkeys(metric.unit_for(x) for x in ("rad", "m"))
    return f"{metric.summary} [{' or '.join(units)}]".removesuffix(" []")


def _print_all(
    terminal: Terminal, kind: str, plant: str | None = None, names_alone: bool = False
) -> None:
    """Print a line about each plant, law, surface, estimator, scene and condition, about each of a
    kind, or about what has this name, which may be a metric's; or their names alone. Conditions are
    those of the plant, by default one that has stops, and numbers for jumps.
    """
    with importing():
        from smc_mujoco.cli import law_pages, tables
        from smc_mujoco.common.tabular import of_fields
        from smc_mujoco.mechanisms.named import as_plant
        from smc_mujoco.mechanisms.plant import plant_catalogue as plants
        from smc_mujoco.metrics.catalogue import metrics
        from smc_mujoco.simulation.conditions import DURATION, NAMED, applicable
        from smc_mujoco.studies import scene

    lists = {
        "Plants": tables.listed(
            plants(), lambda plant: getattr(inspect.getmodule(plant.build), "__doc__", "")
        ),
        **law_pages.lists(),
        "Scenes, for smc-mujoco run": tables.listed(scene.scenes(), scene.question),
    }
    machine = as_plant(plant or "inverted_pendulum")
    conditions = {}
    fit = applicable(NAMED, [machine], DURATION)
    for name, condition in NAMED.items():
        words = "not for this plant"
        if name in fit:
            words = condition.brief(machine, DURATION) or "the scenario's defaults"
        conditions[name] = words
    lists[f"Conditions, on {machine.name} for 10 s"] = conditions
    lists["Metrics"] = {metric.name: _about(metric) for metric in metrics()}
    if names_alone:
        terminal.printed += [of_fields(title, rows) for title, rows in lists.items()]
        pairs = [(title.partition(",")[0], [*rows]) for title, rows in lists.items()]
        _print_names(terminal, pairs)
        return
    for title, rows in lists.items():
        listed = rows
        if kind not in title.lower():
            listed = {name: about for name, about in rows.items() if name == kind}
        if listed:
            terminal.print(of_fields(title, listed), "")
    terminal.print(
        "smc-mujoco list NAME shows a law or a plant in full; --need one-gain,continuous lists "
        "the laws that have both"
    )
