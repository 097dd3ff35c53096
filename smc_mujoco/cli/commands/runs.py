"""smc-mujoco run, show: the runs of a scene, on record or in a window, and a saved trace."""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Clock, Terminal
from smc_mujoco.common.interrupts import delay_ctrl_c


def run(
    ctx: typer.Context,
    name: options.SceneName,
    out: Annotated[
        Path, typer.Option(metavar="FOLDER", help="For results; each scene has a folder of its name in it.")
    ] = Path("videos"),
    film: Annotated[bool, typer.Option(help="Whether to film the machines.")] = True,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of all random numbers; default the scene's.")] = None,
    threads: options.Threads = None,
    export: Annotated[
        str | None,
        typer.Option(metavar="FORMAT,...", help="Also write each trace as csv, mat, mcap or parquet, beside its .npz."),
    ] = None,
    repeat: Annotated[
        bool, typer.Option(help="Whether to repeat runs at half the physics step, to mark what depends on it.")
    ] = True,
    timing: Annotated[bool, typer.Option("--timing", help="Print how long each part took.")] = False,
    view: Annotated[
        bool, typer.Option("--view", help="Watch one run in MuJoCo's viewer instead, and change its law's gains.")
    ] = False,
    condition: Annotated[
        str | None, typer.Option(help="Of the run in the viewer; default the condition of the film.")
    ] = None,
    label: Annotated[str | None, typer.Option(help="Of the run in the viewer; default the condition's first.")] = None,
) -> None:
    """Run a scene: print its question, scores and answer; write its traces, figures and film.

    Each run is repeated at half the physics step, and from a start moved by 1e-9 of itself. A score that changes by
    more than 5 % is marked, and an answer that says something else is printed, too.

    Exported traces have every number to the last bit, and its unit.

    With --view a window shows one run in real time, and nothing is written:

    - Pause and continue: the space bar.
    - Change a gain: its slider gain:NAME in the panel "Control" at the right, from a tenth of the scene's value to ten
      times that value. At the end the law is printed, as code that makes it.
    - Push a body: double-click it, hold Ctrl, and drag with the right mouse button.
    - Start again: Backspace. The run also starts again by itself when its duration is over. Changed gains are kept.

    All other sliders and settings of the viewer change only the picture.

    Example: smc-mujoco run duffing --no-film --out results --export csv,parquet

    Example: smc-mujoco run inverted_pendulum --view --label super_twisting
    """
    options.only_for(ctx, ("condition", "label"), view, "a run in the viewer, --view")
    options.only_for(ctx, ("out", "film", "threads", "export", "repeat", "timing"), not view, "runs without --view")
    if view:
        _watch(name, seed, condition, label)
        return
    clock = Clock()
    with clock("loading"), delay_ctrl_c():
        from smc_mujoco.cli.scene import perform
        from smc_mujoco.simulation.trace import formats
        from smc_mujoco.studies import scene as scenes

    endings = () if export is None else formats(export)
    path = scenes.find(name)
    scene = scenes.read(path)
    if seed is not None:
        scene = scene.seeded(seed)
    terminal, folder = Terminal(), out / path.stem
    perform(scene, folder, film, threads, clock, terminal, endings, scenes.question(path), repeat)
    if timing:
        terminal.note(str(clock), "dim")


def show(
    trace: Annotated[Path, typer.Argument(metavar="TRACE", help="A .npz file from `smc-mujoco run` or Trace.save.")],
    figure: Annotated[Path | None, options.picture("it")] = None,
    export: Annotated[
        str | None,
        typer.Option(metavar="FORMAT,...", help="Also write it as csv, mat, mcap or parquet, beside TRACE."),
    ] = None,
) -> None:
    """Show a trace: what was run, how it went, and its scores.

    Example: smc-mujoco show videos/duffing/nominal-classical.npz --figure classical
    """
    with delay_ctrl_c():
        from smc_mujoco.analysis.step_halving import UNTRIED, repeats_all
        from smc_mujoco.cli import tables
        from smc_mujoco.common.text import capital
        from smc_mujoco.simulation.trace import formats, load

    endings = () if export is None else formats(export)
    loaded, terminal = load(trace), Terminal()
    written = [loaded.export(trace.with_suffix(f".{ending}")) for ending in endings]
    if figure:
        from smc_mujoco.draw.figure import figure as draw
        from smc_mujoco.draw.page import files as drawn

        draw([loaded], figure)
        written += drawn(figure)
    s = loaded.scenario
    plant, law, times = (s.plant.name, "bold"), (str(s.law), "bold"), f", {s.duration:g} s at {s.control_period:g} s"
    terminal.print(Text.assemble(plant, " under ", law, times, f", gains: {s.law.source}"))
    if loaded.failure:
        terminal.note(f"failed: {loaded.failure}", "red", wrap=True)
    else:
        for table in tables.trace_summary(loaded):
            terminal.print(table)
        if repeats_all(s):
            terminal.note(f"{capital(UNTRIED)}.", "dim", wrap=True)
    terminal.wrote(*written)


def _watch(name: str, seed: int | None, condition: str | None, label: str | None) -> None:
    """Show one run of a scene in MuJoCo's viewer."""
    from smc_mujoco.common.errors import ScenarioError, find
    from smc_mujoco.draw import display

    no_window = display.missing()
    if sys.platform == "linux" and not no_window:
        os.environ["MUJOCO_GL"] = "glfw"  # one library for all windows
    with delay_ctrl_c():
        from smc_mujoco.draw import viewer
        from smc_mujoco.studies import scene as scenes

    scene = scenes.read(scenes.find(name))
    if seed is not None:
        scene = scene.seeded(seed)
    runs = scene.conditions[scene.film]
    if condition is not None:
        runs = find(f"condition of {name}", condition, scene.conditions)
    scenario = next(iter(runs.values())) if label is None else find(f"label in {name}", label, runs)
    if no_window:
        raise ScenarioError(no_window)
    viewer.watch(scenario)
