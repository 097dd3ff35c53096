"""smc-mujoco run, show, view: a scene's runs, a saved trace, any machine in a browser tab."""

from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.console import Terminal, importing


def run(
    name: options.SceneName,
    out: Annotated[
        Path,
        typer.Option(metavar="FOLDER", help="Folder for results; one subfolder per scene."),
    ] = Path("videos"),
    film: Annotated[bool, typer.Option(help="Whether to film the machines.")] = True,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed of all random numbers; default: the scene's.")
    ] = None,
    threads: options.Threads = None,
    export: Annotated[
        str | None,
        typer.Option(
            metavar="FORMAT,...",
            help="Also write each trace as csv, mat or parquet, beside its .npz.",
        ),
    ] = None,
    repeat: Annotated[
        bool,
        typer.Option(
            help="Whether to repeat runs at half the physics step, and mark scores that differ."
        ),
    ] = True,
    json: options.Json = None,
) -> None:
    """Run a scene (a prepared experiment), print its scores, and write traces, figures and a film.

    Each run is repeated at half the physics step, and from an initial position changed by 1e-9 of
    its value. It is also repeated at a quarter of the step if u chatters, and under RK4 if there
    are contacts. A score that changes by more than 5 % is marked. If the integrator is not RK4, a
    change of more than 2.5 % at half the step is marked too.

    Exported traces keep full precision, and the unit of each signal.

    Example: smc-mujoco run duffing --no-film --out results --export csv,parquet
    """
    with importing():
        from smc_mujoco.cli.run_scene import perform
        from smc_mujoco.simulation.trace import formats
        from smc_mujoco.studies import scene as scenes

    endings = () if export is None else formats(export)
    path = scenes.find(name)
    scene = scenes.read_scene(path)
    if seed is not None:
        scene = scene.seeded(seed)
    terminal = Terminal(json)
    folder = out / path.stem
    perform(scene, folder, film, threads, terminal, endings, scenes.question(path), repeat)
    terminal.finish()


def show(
    trace: Annotated[
        Path,
        typer.Argument(metavar="TRACE", help="A .npz file from `smc-mujoco run` or Trace.save."),
    ],
    figure: Annotated[Path | None, options.picture("it")] = None,
    export: Annotated[
        str | None,
        typer.Option(
            metavar="FORMAT,...", help="Also write it as csv, mat or parquet, beside TRACE."
        ),
    ] = None,
    json: options.Json = None,
) -> None:
    """Show a trace: what was run, how it went, and its scores.

    Example: smc-mujoco show videos/duffing/nominal-classical.npz --figure classical
    """
    with importing():
        from smc_mujoco.analysis.step_halving import UNTRIED, repeats_every_run
        from smc_mujoco.cli import tables
        from smc_mujoco.common.text import capital
        from smc_mujoco.simulation.conditions import Condition
        from smc_mujoco.simulation.trace import formats, load

    endings = () if export is None else formats(export)
    loaded = load(trace)
    terminal = Terminal(json)
    written = []
    for ending in endings:
        written.append(loaded.export(trace.with_suffix(f".{ending}")))
    if figure:
        from smc_mujoco.draw.figure import figure as draw
        from smc_mujoco.draw.page import files as drawn

        draw([loaded], figure)
        written += drawn(figure)
    s = loaded.scenario
    plant = (s.plant.name, "bold")
    law = (str(s.law), "bold")
    times = f", {s.duration:g} s at {s.control_period:g} s"
    gains = f", gains: {s.law.source}"
    fields = {}
    for name, value in s.given.items():
        if name not in ("duration", "control_period"):
            fields[name] = value
    conditions = Condition("others", fields).brief(s.plant, s.duration)
    terminal.print(
        Text.assemble(plant, " under ", law, times, gains, conditions and f", {conditions}")
    )
    if loaded.failure:
        terminal.note(f"failed: {loaded.failure}", "red", wrap=True)
    else:
        for table in tables.trace_summary(loaded):
            terminal.print(table)
        if repeats_every_run(s):
            terminal.note(f"{capital(UNTRIED)}.", "dim", wrap=True)
    terminal.wrote(*written)
    terminal.finish()


def view(
    machine: Annotated[
        str,
        typer.Argument(
            metavar="MACHINE",
            autocompletion=options.PLANTS,
            help="A plant from `smc-mujoco list`, joints of your own model (FILE.xml:joint+joint), "
            "a free joint of it (FILE.xml:joint), or a scene file (FILE.py). A scene shows the "
            "first two runs of its film.",
        ),
    ],
    law: options.Laws = None,
    port: Annotated[
        int,
        typer.Option(
            min=0, max=65535, help="Port of the page; 0: the first free one from 8080 up."
        ),
    ] = 0,
    browser: Annotated[bool, typer.Option(help="Whether to open the browser tab.")] = True,
    record: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write an .html page that plays the runs without a server, and show nothing.",
        ),
    ] = None,
) -> None:
    """Watch a machine under one or two laws in a browser tab. Push it, change its gains, and save
    the scene.

    The panel changes each law and its gains, and the plant's mass, delay, noise and friction; each
    change restarts the runs, or repeats them up to now while they are paused. Charts show x, u and
    s. The button "save as scene" writes view.py, and `smc-mujoco run view.py` repeats the runs bit
    for bit.

    To push a part, drag it with the mouse and let go. Only this machine can open the page's
    address, which holds a secret word. Ctrl-C ends it.

    Example: smc-mujoco view inverted_pendulum --law pid,adrc

    Example: smc-mujoco view arm.xml:shoulder+elbow --law adrc --record run.html
    """
    with importing():
        from smc_mujoco.draw.view import view as show_view

    viewed = machine
    if machine.endswith(".py"):
        from smc_mujoco.studies import scene as scenes

        scene = scenes.read_scene(scenes.find(machine))
        viewed = list(scene.conditions[scene.film].values())[:2]
    show_view(viewed, options.parsed_laws(law), port, browser, record)
