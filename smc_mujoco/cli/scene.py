"""Performing a scene: from its declaration to printed scores, traces, figures and a film."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from rich.console import Console

from smc_mujoco.cli import tables
from smc_mujoco.common import gl
from smc_mujoco.common.errors import ScenarioError, printable
from smc_mujoco.common.progress import bar
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.scene import Scene, slug

Traces = Mapping[str, Mapping[str, Trace]]  # condition -> label -> Trace
Timer = Callable[[str], AbstractContextManager[None]]


def perform(
    scene: Scene,
    out: Path,
    video: bool,
    threads: int | None,
    clock: Timer,
    console: Console,
    export: Sequence[str] = (),
) -> None:
    """Run a scene: print its scores and answers, write its traces, figures and film to the folder `out`.

    Each trace is written as .npz, and beside it in the formats of `export`.
    """
    _writable(out)
    with clock("compiling"):
        compile_laws(scene)
    with clock("simulating"):
        traces = simulate(scene, threads)
    for condition, runs in traces.items():
        for table in tables.scores(_title(scene, condition), runs):
            console.print(table)
        for label, trace in runs.items():
            if trace.failure:
                console.print(f"{label}: {trace.failure}", style="red", highlight=False, markup=False)
        console.print()
    tell(scene, traces, console)
    with clock("traces"):
        written = save(traces, out, export)
    with clock("figures"):
        written += figures(scene, traces, out)
    if video:
        with clock("film"):
            written += film(scene, traces, out, console)
    console.print("wrote", style="dim")
    for file in written:
        console.print(f"  {printable(str(file))}", soft_wrap=True, highlight=False, markup=False)


def tell(scene: Scene, traces: Traces, console: Console) -> None:
    """Print what answers the scene's question: its metrics, run by run, and its facts."""
    for table in tables.answers(scene.answers, traces) if scene.answers else ():
        console.print(table, "")
    for label, sentence in scene.facts.items():
        console.print(f"{label}: {sentence}", highlight=False, markup=False)
    if scene.facts:
        console.print()


def _writable(out: Path) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ScenarioError(f"cannot make the folder {out} ({error.strerror}): choose another with --out") from error


def _title(scene: Scene, condition: str) -> str:
    return f"{scene.title}, {condition}" if len(scene.conditions) > 1 else scene.title


def compile_laws(scene: Scene) -> None:
    """Compile the laws of the scene's runs in advance; those that do not compile run in the reference loop."""
    for _, _, scenario in scene.runs():
        prepare(scenario)


def simulate(scene: Scene, threads: int | None) -> Traces:
    """Run all scenarios of the scene, in one call, with a progress bar."""
    runs = list(scene.runs())
    traces = run([scenario for _, _, scenario in runs], threads, progress=True)
    found: dict[str, dict[str, Trace]] = {}
    for (condition, label, _), trace in zip(runs, traces, strict=True):
        found.setdefault(condition, {})[label] = trace
    return found


def save(traces: Traces, out: Path, export: Sequence[str] = ()) -> list[Path]:
    """Save each run as .npz, and in each format of Trace.export; return the files."""
    written: list[Path] = []
    for condition, runs in traces.items():
        for label, trace in runs.items():
            name = f"{slug(condition)}-{slug(label)}"
            written.append(trace.save(out / f"{name}.npz"))
            written += [trace.export(out / f"{name}.{ending}") for ending in export]
    return written


def figures(scene: Scene, traces: Traces, out: Path) -> list[Path]:
    """Draw the scene's figures, SVG and PNG; return the files."""
    from smc_mujoco.draw.figure import figure, signals

    if scene.figure == "signals":
        flat = [(condition, trace) for condition, runs in traces.items() for trace in runs.values()]
        return signals([t for _, t in flat], out / "signals", labels=[c for c, _ in flat], title=scene.title)
    written: list[Path] = []
    for condition, runs in traces.items():
        path = out / f"{slug(condition)}.svg"
        written += figure(list(runs.values()), path, labels=_labels(runs), title=_title(scene, condition))
    return written


def _labels(runs: Mapping[str, Trace]) -> list[str]:
    """Return the labels of a condition for pictures; a label that is the law's own name is put in words."""
    from smc_mujoco.draw.style import law_name

    return [law_name(label) if label == trace.scenario.law.name else label for label, trace in runs.items()]


def film(scene: Scene, traces: Traces, out: Path, console: Console) -> list[Path]:
    """Film the scene's filmed condition; where nothing can render, print why and return no file."""
    from smc_mujoco.draw.film import film as video

    if sentence := video.missing() or gl.note():
        console.print(sentence, style="yellow", soft_wrap=True, highlight=False, markup=False)
    if video.missing():
        return []
    runs = traces[scene.film]
    shown = list(runs.values())
    with bar("film", len(video.clock(shown, video.FPS))) as drawn:
        path, title = out / f"{slug(scene.film)}.mp4", _title(scene, scene.film)
        return [video.film(shown, path, _labels(runs), title, report=drawn.advance)]
