"""smc-mujoco bench: the study's grid, computed so that nothing is lost, to a table and a leaderboard."""

from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Clock, loading, mendable, wrote


@mendable()
def bench(
    quick: Annotated[
        bool,
        typer.Option(
            "--quick", help="A fraction: 3 plants, 3 conditions, 16 seeds, 3 s a run; half a minute on 2 cores."
        ),
    ] = False,
    plants: Annotated[
        str | None, typer.Option(help="Plants, as a,b or FILE.xml:joint+joint; default the paper's five.")
    ] = None,
    laws: Annotated[
        str | None, typer.Option(help=f"Laws, as a,b, or all; default the report's short list. {options.OWN_GAINS}")
    ] = None,
    conditions: Annotated[
        str | None,
        typer.Option(help="Conditions, as a,b; default those of 12 that suit the plants, or none beside --condition."),
    ] = None,
    condition: options.Conditions = None,
    x0: options.Middle = None,
    spread: options.Spread = None,
    seeds: Annotated[
        int | None, typer.Option(min=1, help="How many starts and noises; default 20, of which 16 can name a winner.")
    ] = None,
    gains: options.Gains = "tuned",
    duration: Annotated[float | None, typer.Option(help="Of a run, s; default 10.")] = None,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("study"),
    executor: Annotated[str, typer.Option(help="local, or dask://HOST:PORT of a scheduler.")] = "local",
    traces: Annotated[
        str, typer.Option(help="Which to save: none, all, or the worst by plant and condition.")
    ] = "none",
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget the runs that the folder holds.")] = False,
    threads: options.Threads = None,
) -> None:
    """Compare laws on plants in conditions: every combination from every seed, to OUT/results.parquet.

    Finished runs are kept: stop it whenever you like, start it again with the same options, and it goes on. The table
    is of the last command alone: give each study an --out of its own. Laws and conditions are those that `smc-mujoco
    list` shows; --laws all ranks every general law that has gains in the set on these plants: `default` ones are there
    for all. The leaderboard says who wins under each condition, and over all of them what holds in every one.

    Example: smc-mujoco bench --plants duffing --conditions noise,coulomb --seeds 16 --out duffing
    """
    with loading():
        from rich.console import Console

        from smc_mujoco.cli import tables
        from smc_mujoco.control.gain_sets import general_laws
        from smc_mujoco.mechanisms.plant import plant as find_plant
        from smc_mujoco.simulation.conditions import suiting
        from smc_mujoco.simulation.grid import grid
        from smc_mujoco.studies.leaderboard import leaderboard
        from smc_mujoco.studies.study import FULL, QUICK, study

    clock, console = Clock(), Console()
    chosen = QUICK if quick else FULL
    with clock("in all"):
        named = [options.plant(text) for text in options.names(plants, chosen.plants)]
        length = chosen.duration if duration is None else duration
        machines = [find_plant(plant) if isinstance(plant, str) else plant for plant in named]
        usual = () if condition else suiting(chosen.conditions, machines, length)
        ranked = options.names(laws, chosen.laws)
        ranked = general_laws(named, gains) if laws == "all" else [options.law(text) for text in ranked]
        scenarios = grid(
            named,
            ranked,
            options.conditions(options.names(conditions, usual), condition),
            seeds or chosen.seeds,
            gains,
            length,
            options.starts(x0, spread),
        )
        table = study(scenarios, out, not fresh, executor, threads, progress=True, traces=traces)
    console.print(tables.leaderboard(leaderboard(table)))
    failed = len(table) - table.data["failure"].null_count
    counts = f"{len(table)} run{'s' * (len(table) != 1)}, {failed} of them failed"
    said = f"{counts}, {options.origin(ranked, gains)}, {clock.spent['in all']:.0f} s"
    console.print(said, soft_wrap=True, highlight=False)
    wrote(console, out / "results.parquet")
