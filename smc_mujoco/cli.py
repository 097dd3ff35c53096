"""The command line: smc-mujoco list | laws | run | show | tune, here, and the commands of `commands`."""

import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.commands import basin, bench, check_c, claims, export_c, margins, report, view
from smc_mujoco.terminal import Clock, loading, mendable

app = typer.Typer(
    help="Sliding-mode controllers on MuJoCo mechanisms: run scenes, compare laws, look at traces.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; what the user can mend ends in one sentence and exit code 2."""
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="replace")  # a terminal that lacks a character shows another
    warnings.showwarning = lambda message, *_, **__: print(f"smc-mujoco: {message}", file=sys.stderr)
    app(arguments, prog_name="smc-mujoco")


def play(scene: str) -> None:
    """Run a scene file as a script: `if __name__ == "__main__": smc.play(__file__)`."""
    main(["run", scene, *sys.argv[1:]])


def _version(wanted: bool) -> None:
    if wanted:
        import smc_mujoco

        print(f"smc-mujoco {smc_mujoco.__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Options before a command."""


@app.command("list")
def list_() -> None:
    """List plants, laws, surfaces, velocity estimators, scenes, and the conditions of the paper's study."""
    with mendable():
        with loading():
            from rich.console import Console

            from smc_mujoco import show

        show.catalogues(Console())


@app.command()
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
    with mendable():
        with loading():
            from rich.console import Console

            from smc_mujoco import lawbook

        lawbook.show(name, Console())


@app.command()
def run(
    name: Annotated[str, typer.Argument(metavar="SCENE", help="A scene file, or the name of one that `list` shows.")],
    out: Annotated[Path | None, typer.Option(help="Folder for the results; default videos/SCENE.")] = None,
    video: Annotated[bool, typer.Option(help="Whether to film the machines.")] = True,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of all random numbers instead of the scene's.")] = None,
    threads: Annotated[int | None, typer.Option(min=1, help="Simulations at once; default one per core.")] = None,
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
    with mendable():
        clock = Clock()
        with clock("loading"), loading():
            from rich.console import Console

            from smc_mujoco import scene as scenes
            from smc_mujoco import show
            from smc_mujoco.trace import formats

        exported = () if export is None else formats(export)
        path = scenes.find(name)
        scene = scenes.read(path)
        if seed is not None:
            scene = scene.seeded(seed)
        console = Console()
        show.perform(scene, out or Path("videos") / path.stem, video, threads, clock, console, exported)
        if timing:
            console.print(str(clock), style="dim", soft_wrap=True, highlight=False)


@app.command()
def show(
    trace: Annotated[Path, typer.Argument(metavar="TRACE", help="A .npz file that `run` or Trace.save wrote.")],
    figure: Annotated[Path | None, typer.Option(help="Also draw it, as FIGURE.svg and FIGURE.png.")] = None,
    export: Annotated[
        Path | None, typer.Option(help="Also write its columns, with units, to a .csv, .mat or .parquet file.")
    ] = None,
) -> None:
    """Show a trace: what was run, how it went, and its scores."""
    with mendable():
        with loading():
            from rich.console import Console

            from smc_mujoco.show import summary
            from smc_mujoco.trace import load

        loaded, console = load(trace), Console()
        written = [loaded.export(export)] if export else []
        if figure:
            from smc_mujoco.draw.figure import figure as draw

            written += draw([loaded], figure)
        summary(loaded, console)
        for path in written:
            console.print(f"wrote {path}", soft_wrap=True, highlight=False)


@app.command()
def tune(
    plant: Annotated[str, typer.Argument(metavar="PLANT", help="One that `list` shows.")],
    law: Annotated[str, typer.Argument(metavar="LAW", help="One that `laws` shows.")],
    objective: Annotated[
        str, typer.Option(help="balanced: error, and variation of u; tracking: error alone.")
    ] = "balanced",
    budget: Annotated[int, typer.Option(min=1, help="How many sets of gains to evaluate.")] = 256,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search and of the noise.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Also write gains, history and provenance to a .json file.")] = None,
    front: Annotated[
        Path | None, typer.Option(help="Also draw error against variation, as FRONT.svg and .png.")
    ] = None,
    threads: Annotated[int | None, typer.Option(min=1, help="Simulations at once; default one per core.")] = None,
) -> None:
    """Find a law's gains on a plant by the rule that is the same for every law.

    Same bound on u, same objective (error times time, and variation of u, in a nominal, a noisy and a delayed run of
    5 s), same number of gains tried, same width of search about the scale that each gain has by dimension. The same
    seed gives the same gains; a larger budget never worse ones.

    Example: smc-mujoco tune duffing observer_free --budget 128 --out duffing.json
    """
    with mendable():
        with loading():
            from rich.console import Console

            from smc_mujoco import tuned, tuning
            from smc_mujoco.files import writable

        for file in (out, front):
            if file:
                writable(file)
        path, clock, console = out and tuned.checked(out), Clock(), Console()
        with clock("tuning"):
            found = tuning.tune(plant, law, budget, seed, objective, threads, progress=True)
        console.print(tuned.table(found))
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
            console.print(f"wrote {found.save(path)}", soft_wrap=True, highlight=False)
        if front:
            from smc_mujoco.draw.pareto import pareto

            for drawn in pareto([found], front):
                console.print(f"wrote {drawn}", soft_wrap=True, highlight=False)


for command in (bench.bench, margins.margins, basin.basin, claims.claims, report.report, view.view):
    app.command()(command)
app.command("check-c")(check_c.check_c)
app.command("export-c")(export_c.export_c)
