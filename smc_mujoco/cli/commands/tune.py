"""smc-mujoco tune PLANT LAW: gains by the rule that is the same for every law."""

from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Clock, loading, mendable, wrote


@mendable()
def tune(
    plant: Annotated[str, typer.Argument(metavar="PLANT", help="One that `list` shows, or FILE.xml:joint+joint.")],
    law: options.LawName,
    objective: Annotated[
        str, typer.Option(help="balanced: error, and variation of u; tracking: error alone.")
    ] = "balanced",
    budget: Annotated[int, typer.Option(min=1, help="How many sets of gains to evaluate.")] = 96,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search and of the noise.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Also write gains, history and provenance to a .json file.")] = None,
    front: Annotated[
        Path | None, typer.Option(help="Also draw error against variation, as FRONT.svg and .png.")
    ] = None,
    conditions: Annotated[
        str | None, typer.Option(help="Names, as a,b, in place of the objective's seven, which are given at the end.")
    ] = None,
    condition: options.Conditions = None,
    x0: options.Middle = None,
    spread: options.Spread = None,
    threads: options.Threads = None,
) -> None:
    """Find a law's gains on a plant by the rule that is the same for every law.

    Same bound on u, same objective (error times time, and variation of u, in runs of 5 s: nominal, noisy, delayed,
    disturbed by a sine and by a constant, and with 30 % more and less mass), same number of gains tried, same width of
    search about the scale that each gain has by dimension. The same seed gives the same gains.

    Example: smc-mujoco tune duffing observer_free --budget 96 --out duffing.json
    """
    with loading():
        from rich.console import Console

        from smc_mujoco.analysis.tuning import result, search
        from smc_mujoco.cli import tables
        from smc_mujoco.common.files import writable

    for file in (out, front):
        if file:
            writable(file)
    path, clock, console = out and result.checked(out), Clock(), Console()
    with clock("tuning"):
        found = search.tune(
            options.plant(plant),
            law,
            budget,
            seed,
            objective,
            threads,
            progress=True,
            conditions=options.conditions(options.names(conditions), condition) or None,
            starts=options.starts(x0, spread),
        )
    console.print(tables.tuning(found))
    console.print(f"{found.definition}", soft_wrap=True, highlight=False)
    console.print(
        f"objective {found.objective:.4g} s², with the law's default gains {found.before:.4g}; "
        f"{len(found.history)} set{'s' * (budget > 1)} of gains, seed {seed}, {clock.spent['tuning']:.1f} s",
        soft_wrap=True,
        highlight=False,
    )
    if found.objective > found.before:
        console.print("no set of gains tried is better than the default ones: give a larger --budget")
    if path:
        wrote(console, found.save(path))
    if front:
        from smc_mujoco.draw.pareto import pareto

        for drawn in pareto([found], front):
            wrote(console, drawn)
