"""A scene from its declaration to files: simulate, save, draw, film."""

import re
from collections.abc import Mapping
from pathlib import Path

from rich.console import Console

from smc_mujoco import gl
from smc_mujoco.chunk import contents
from smc_mujoco.native import NotCompilable
from smc_mujoco.run import run
from smc_mujoco.scene import Scene
from smc_mujoco.trace import Trace

Traces = Mapping[str, Mapping[str, Trace]]  # condition -> label -> Trace


def compile_laws(scene: Scene) -> None:
    """Compile what the scene's runs name, ahead of running them; what does not compile runs in the plain loop."""
    for _, _, scenario in scene.runs():
        try:
            contents(scenario)
        except NotCompilable:
            continue


def simulate(scene: Scene, threads: int | None) -> Traces:
    """Every run of the scene, in one call, with a progress bar."""
    runs = list(scene.runs())
    traces = run([scenario for _, _, scenario in runs], threads, progress=True)
    found: dict[str, dict[str, Trace]] = {}
    for (condition, label, _), trace in zip(runs, traces, strict=True):
        found.setdefault(condition, {})[label] = trace
    return found


def save(traces: Traces, out: Path) -> list[Path]:
    """One .npz a run."""
    return [
        trace.save(out / f"{slug(condition)}-{slug(label)}.npz")
        for condition, runs in traces.items()
        for label, trace in runs.items()
    ]


def figures(scene: Scene, traces: Traces, out: Path) -> list[Path]:
    """The scene's figures, SVG and PNG."""
    from smc_mujoco.figure import figure, signals

    if scene.figure == "signals":
        flat = [(condition, trace) for condition, runs in traces.items() for trace in runs.values()]
        return signals([t for _, t in flat], out / "signals", labels=[c for c, _ in flat], title=scene.title)
    written: list[Path] = []
    for condition, runs in traces.items():
        title = f"{scene.title}, {condition}" if len(traces) > 1 else scene.title
        written += figure(list(runs.values()), out / slug(condition), labels=list(runs), title=title)
    return written


def film(scene: Scene, traces: Traces, out: Path, console: Console) -> list[Path]:
    """The film of the scene's filmed condition; none, and a line that says why, where nothing can render."""
    from rich.progress import Progress

    if gl.missing():
        console.print(str(gl.missing()), style="yellow", soft_wrap=True)
        return []
    from smc_mujoco import video

    runs = traces[scene.film]
    shown = list(runs.values())
    with Progress(transient=True, console=console) as bar:
        task = bar.add_task("film", total=len(video.clock(shown, video.FPS)))
        path = out / f"{slug(scene.film)}.mp4"
        return [video.film(shown, path, list(runs), scene.title, report=lambda n: bar.advance(task, n))]


def slug(name: str) -> str:
    """A name as part of a file name."""
    return re.sub(r"[^a-z0-9.]+", "_", name.lower()).strip("_") or "run"
