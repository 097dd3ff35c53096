"""smc-mujoco run SCENE: its scores, traces, figures and film."""

from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Clock, loading, mendable


@mendable()
def run(
    name: options.SceneName,
    out: Annotated[Path | None, typer.Option(help="Folder for the results; default videos/SCENE.")] = None,
    video: Annotated[bool, typer.Option(help="Whether to film the machines.")] = True,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of all random numbers instead of the scene's.")] = None,
    threads: options.Threads = None,
    export: Annotated[
        str | None,
        typer.Option(metavar="FORMAT,...", help="Also write each trace as csv, mat or parquet, beside its .npz."),
    ] = None,
    timing: Annotated[bool, typer.Option("--timing", help="Say where the time went.")] = False,
) -> None:
    """Run a scene: print its scores; write its traces, figures and film.

    Exported traces hold every number to the last bit, and its unit: csv in the first line ("t [s],x [m],..."), mat in
    the struct `units`, parquet in each column's metadata, "unit".

    Example: smc-mujoco run duffing --no-video --out results --export csv,parquet
    """
    clock = Clock()
    with clock("loading"), loading():
        from rich.console import Console

        from smc_mujoco.cli.scene import perform
        from smc_mujoco.simulation.trace import formats
        from smc_mujoco.studies import scene as scenes

    exported = () if export is None else formats(export)
    path = scenes.find(name)
    scene = scenes.read(path)
    if seed is not None:
        scene = scene.seeded(seed)
    console = Console()
    perform(scene, out or Path("videos") / path.stem, video, threads, clock, console, exported)
    if timing:
        console.print(str(clock), style="dim", soft_wrap=True, highlight=False)
