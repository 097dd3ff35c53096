"""Running a scene: from its declaration to printed scores, traces, figures and a film."""

import contextlib
from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.text import Text

from smc_mujoco.analysis.step_halving import repetitions
from smc_mujoco.cli import tables
from smc_mujoco.cli.console import Terminal
from smc_mujoco.common import annexes, gl
from smc_mujoco.common.errors import ScenarioError, printable
from smc_mujoco.common.files import slug
from smc_mujoco.draw import wording
from smc_mujoco.draw.film.camera import Camera
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.scene import Scene

Traces = Mapping[str, Mapping[str, Trace]]  # condition -> label -> Trace


def perform(
    scene: Scene,
    out: Path,
    filming: bool,
    threads: int | None,
    terminal: Terminal,
    export: Sequence[str],
    question: str,
    repeated: bool = True,
) -> None:
    """Run a scene: print its question, scores and answer; write its traces, figures and film to the
    folder `out`.

    `repeated`: whether each run is repeated, see `analysis.step_halving`, and what differs marked.
    """
    if question:
        terminal.note(f"{question}\n", "bold", wrap=True)
    out.mkdir(parents=True, exist_ok=True)
    traces = simulate(scene, threads)
    written = save(traces, out, export)  # first, so that runs are kept if the scene's answer fails
    again = repeat(traces, threads) if repeated else {}
    terminal.print(Text(scene.sentence(traces), "bold"))
    terminal.print()
    for condition, runs in traces.items():
        title = _title(scene, condition)
        repeats = again.get(condition)
        for table in [*tables.scores(title, runs, repeats), *tables.tips(title, runs, repeats)]:
            terminal.print(table)
        for label, trace in runs.items():
            if trace.failure:
                terminal.note(f"{label}: {trace.failure}", "red", wrap=True)
        terminal.print()
    for table in tables.answers(scene.answers, traces, again) if scene.answers else ():
        terminal.print(table, "")
    written += figures(scene, traces, out)
    try:
        if filming:
            path = out / f"{slug(scene.film)}.mp4"
            title = _title(scene, scene.film)
            runs = [*traces[scene.film].values()]
            names = [*map(wording.label, traces[scene.film])]
            written += filmed(runs, path, names, title, terminal, scene.camera)
    finally:  # also if the film fails or is stopped
        terminal.print("wrote", style="dim")
        for file in written:
            terminal.note(f"  {printable(str(file))}")


def _title(scene: Scene, condition: str) -> str:
    if len(scene.conditions) > 1:
        return wording.under(scene.title, condition)
    return scene.title


def simulate(scene: Scene, threads: int | None) -> Traces:
    """Run all scenarios of the scene at once, with a progress bar."""
    runs = list(scene.runs())
    finished = run([scenario for _, _, scenario in runs], threads, progress=True)
    traces: dict[str, dict[str, Trace]] = {}
    for (condition, label, _), trace in zip(runs, finished, strict=True):
        traces.setdefault(condition, {})[label] = trace
    return traces


def repeat(traces: Traces, threads: int | None) -> dict[str, dict[str, list[Trace]]]:
    """Return condition -> label -> the `repetitions` of the run."""
    changed: list[tuple[str, str, Scenario]] = []
    for condition, runs in traces.items():
        for label, trace in runs.items():
            with contextlib.suppress(ScenarioError):  # its step cannot be halved
                for again in repetitions(trace):
                    changed.append((condition, label, again))
    repeated = run([scenario for *_, scenario in changed], threads, progress=True)
    by_condition: dict[str, dict[str, list[Trace]]] = {}
    for (condition, label, _), trace in zip(changed, repeated, strict=True):
        by_condition.setdefault(condition, {}).setdefault(label, []).append(trace)
    return by_condition


def save(traces: Traces, out: Path, export: Sequence[str] = ()) -> list[Path]:
    """Save each run as .npz, and in each format of `export`; return the files."""
    written: list[Path] = []
    for condition, runs in traces.items():
        for label, trace in runs.items():
            name = f"{slug(condition)}-{slug(label)}"
            written.append(trace.save(out / f"{name}.npz"))
            for ending in export:
                written.append(trace.export(out / f"{name}.{ending}"))
    return written


def figures(scene: Scene, traces: Traces, out: Path) -> list[Path]:
    """Draw the scene's figures, SVG and PNG; return the files."""
    from smc_mujoco.draw.figure import figure
    from smc_mujoco.draw.page import files

    if scene.figure == "chattering":
        what = "a figure of chattering"
        drawing = annexes.module("smc_mujoco.chattering.amplitudes", what)
        drawing.amplitudes(traces, out / "chattering", title=scene.title)
        return files(out / "chattering")
    panels = ["u"] if scene.figure == "signals" else None
    written: list[Path] = []
    for condition, runs in traces.items():
        path = out / f"{slug(condition)}.svg"
        names = list(map(wording.label, runs))
        title = _title(scene, condition)
        figure(list(runs.values()), path, labels=names, title=title, panels=panels)
        written += files(path)
    return written


def filmed(
    runs: Sequence[Trace],
    path: Path,
    names: Sequence[str] | None,
    title: str,
    terminal: Terminal,
    camera: Camera | None = None,
) -> list[Path]:
    """Film runs with a progress bar and return the file; if nothing can render, print why and
    return [].
    """
    from smc_mujoco.draw.film import film as video

    if sentence := video.missing_for_film() or gl.note():
        terminal.note(sentence, "yellow")
    if video.missing_for_film():
        return []
    return [video.film(runs, path, names, title, camera=camera)]
