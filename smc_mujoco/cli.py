"""The command line: smc-mujoco list | run SCENE | show TRACE."""

import contextlib
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.errors import ScenarioError

app = typer.Typer(
    help="Sliding-mode controllers on MuJoCo mechanisms: run scenes, compare laws, look at traces.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; what the user can mend ends in one sentence and exit code 2."""
    try:
        app(arguments, prog_name="smc-mujoco")
    except ScenarioError as error:
        _fail(str(error))
    except OSError as error:
        _fail(f"{error.filename or 'a file'}: {error.strerror or error}; choose another folder or make room")
    except KeyboardInterrupt:
        _fail("stopped; files already written are complete", 130)


def play(scene: str) -> None:
    """Run a scene file as a script: `if __name__ == "__main__": smc.play(__file__)`."""
    main(["run", scene, *sys.argv[1:]])


def _fail(sentence: str, code: int = 2) -> None:
    print(f"smc-mujoco: {sentence}", file=sys.stderr)
    raise SystemExit(code)


@app.command("list")
def list_() -> None:
    """List plants, laws, velocity estimators, conditions of the paper's study, and scenes."""
    from rich.console import Console

    from smc_mujoco import paper, scene, tables
    from smc_mujoco.estimators import catalogue as estimators
    from smc_mujoco.law import catalogue as laws
    from smc_mujoco.plant import catalogue as plants

    def first(doc: str | None) -> str:
        return (doc or "").strip().partition("\n")[0]

    known = {
        "Plants": ((name, first(sys.modules[p.build.__module__].__doc__)) for name, p in plants().items()),
        "Laws": ((name, first(t.doc)) for name, t in laws().items()),
        "Velocity estimators": ((name, first(t.doc)) for name, t in estimators().items()),
        "Scenes (smc-mujoco run NAME)": ((name, scene.question(path)) for name, path in scene.scenes().items()),
    }
    console = Console()
    for title, rows in known.items():
        console.print(tables.catalogue(title, rows), "")
    console.print("[bold]Conditions of the study[/]", ", ".join(paper.CONDITIONS), sep="\n  ", highlight=False)


@app.command()
def run(
    name: Annotated[str, typer.Argument(metavar="SCENE", help="A scene file, or the name of one that `list` shows.")],
    out: Annotated[Path | None, typer.Option(help="Folder for the results; default videos/SCENE.")] = None,
    video: Annotated[bool, typer.Option(help="Whether to film the machines.")] = True,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of all random numbers instead of the scene's.")] = None,
    threads: Annotated[int | None, typer.Option(min=1, help="Simulations at once; default one per core.")] = None,
    timing: Annotated[bool, typer.Option("--timing", help="Say where the time went.")] = False,
) -> None:
    """Run a scene: print its scores; write its traces, figures and film.

    Example: smc-mujoco run duffing --no-video --out results
    """
    clock = Clock()
    with clock("loading"):
        from rich.console import Console

        from smc_mujoco import scene as scenes
        from smc_mujoco import show, tables

        path = scenes.find(name)
        scene = scenes.read(path)
        if seed is not None:
            scene = scene.seeded(seed)
    out = out or Path("videos") / path.stem
    console = Console()
    with clock("compiling"):
        show.compile_laws(scene)
    with clock("simulating"):
        traces = show.simulate(scene, threads)
    for condition, runs in traces.items():
        console.print(tables.scores(f"{scene.title}, {condition}", runs), "")
    written = []
    with clock("traces"):
        written += show.save(traces, out)
    with clock("figures"):
        written += show.figures(scene, traces, out)
    if video:
        with clock("film"):
            written += show.film(scene, traces, out, console)
    console.print("wrote", style="dim")
    for file in written:
        console.print(f"  {file}", soft_wrap=True, highlight=False)
    if timing:
        console.print("  ".join(f"{what} {seconds:.2f} s" for what, seconds in clock.spent.items()), style="dim")


@app.command()
def show(
    trace: Annotated[Path, typer.Argument(metavar="TRACE", help="A .npz file that `run` or Trace.save wrote.")],
    figure: Annotated[Path | None, typer.Option(help="Also draw it: FIGURE.svg and FIGURE.png.")] = None,
    export: Annotated[Path | None, typer.Option(help="Also write its columns, to a .csv or .mat file.")] = None,
) -> None:
    """Show a trace: what was run, how it went, and its scores."""
    from rich.console import Console

    from smc_mujoco import tables
    from smc_mujoco.trace import load

    loaded, console = load(trace), Console()
    s = loaded.scenario
    console.print(f"[bold]{s.plant.name}[/] under [bold]{s.law}[/], {s.duration:g} s at {s.control_period:g} s")
    for name in ("x", "v", "u", "s"):
        column = getattr(loaded, name)[:, 0]
        console.print(f"{name} {tables.spark(column)} {column[0]:.3g} to {column[-1]:.3g}", highlight=False)
    if loaded.failure:
        console.print(f"failed: {loaded.failure}", style="red")
    else:
        console.print(tables.trace_summary(loaded))
    if export:
        console.print(f"wrote {loaded.export(export)}")
    if figure:
        from smc_mujoco.figure import figure as draw

        for path in draw([loaded], figure):
            console.print(f"wrote {path}")


class Clock:
    """Seconds spent in named stretches."""

    def __init__(self):
        self.spent: dict[str, float] = {}

    @contextlib.contextmanager
    def __call__(self, what: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.spent[what] = time.perf_counter() - start
