"""Running a scene: from its declaration to printed scores, traces, figures and a film."""

import contextlib
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from smc_mujoco.analysis.apart import apart
from smc_mujoco.analysis.step_halving import NUDGE, first_order, halved, nudged
from smc_mujoco.cli import tables
from smc_mujoco.cli.terminal import Terminal
from smc_mujoco.common import gl
from smc_mujoco.common.errors import ScenarioError, printable
from smc_mujoco.common.files import slug
from smc_mujoco.draw import style
from smc_mujoco.draw.film.camera import Camera
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.scene import Scene

Traces = Mapping[str, Mapping[str, Trace]]  # condition -> label -> Trace
NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w])")
Timer = Callable[[str], AbstractContextManager[None]]


def perform(
    scene: Scene,
    out: Path,
    filming: bool,
    threads: int | None,
    clock: Timer,
    terminal: Terminal,
    export: Sequence[str],
    question: str,
    repeated: bool = True,
) -> None:
    """Run a scene: print its question, scores and answer; write its traces, figures and film to the
    folder `out`.

    Runs are `repeated` at half the physics step, and from a nudged start: what then differs is
    marked.
    """
    if question:
        terminal.note(f"{question}\n", "bold", wrap=True)
    out.mkdir(parents=True, exist_ok=True)
    traces = simulate(scene, threads, clock)
    with clock("repeating"):
        again = repeat(scene, threads) if repeated else {}
    for condition, runs in traces.items():
        title = _title(scene, condition)
        others = again.get(condition)
        for table in [*tables.scores(title, runs, others), *tables.tips(title, runs, others)]:
            terminal.print(table)
        for label, trace in runs.items():
            if trace.failure:
                terminal.note(f"{label}: {trace.failure}", "red", wrap=True)
        terminal.print()
    for table in tables.answers(scene.answers, traces, again) if scene.answers else ():
        terminal.print(table, "")
    with clock("traces"):  # first, so that runs are kept if the scene's own answer fails
        written = save(traces, out, export)
    answer = scene.sentence(traces)
    terminal.note(answer, "bold", wrap=True)
    for words in other_answers(scene, traces, again, answer) if again else ():
        terminal.note(words, "yellow", wrap=True)
    terminal.print()
    with clock("figures"):
        written += figures(scene, traces, out)
    try:
        if filming:
            with clock("film"):
                path = out / f"{slug(scene.film)}.mp4"
                title = _title(scene, scene.film)
                runs = [*traces[scene.film].values()]
                names = [*map(style.label, traces[scene.film])]
                written += filmed(runs, path, names, title, terminal, scene.camera)
    finally:  # also if the film fails or is stopped
        terminal.print("wrote", style="dim")
        for file in written:
            terminal.note(f"  {printable(str(file))}")


def _title(scene: Scene, condition: str) -> str:
    if len(scene.conditions) > 1:
        return f"{scene.title}, {condition}"
    return scene.title


def simulate(scene: Scene, threads: int | None, clock: Timer = contextlib.nullcontext) -> Traces:
    """Run all scenarios of the scene at once, with a progress bar."""
    with clock("compiling"):
        runs = [
            (condition, label, prepare(scenario)) for condition, label, scenario in scene.runs()
        ]
    with clock("simulating"):
        made = run([prepared for _, _, prepared in runs], threads, progress=True)
    traces: dict[str, dict[str, Trace]] = {}
    for (condition, label, _), trace in zip(runs, made, strict=True):
        traces.setdefault(condition, {})[label] = trace
    return traces


def repeat(scene: Scene, threads: int | None) -> dict[str, dict[str, list[Trace]]]:
    """Return condition -> label -> the same run at half the physics step, and from a nudged start."""
    changed: list[tuple[str, str, Scenario]] = []
    for condition, label, scenario in scene.runs():
        try:
            changed += [(condition, label, halved(scenario)), (condition, label, nudged(scenario))]
        except ScenarioError:  # its step cannot be halved
            continue
    made: dict[str, dict[str, list[Trace]]] = {}
    for (condition, label, _), trace in zip(
        changed, run([s for *_, s in changed], threads, progress=True), strict=True
    ):
        made.setdefault(condition, {}).setdefault(label, []).append(trace)
    return made


def other_answers(
    scene: Scene, traces: Traces, again: Mapping[str, tables.Again], answer: str
) -> list[str]:
    """Return the scene's answer at half the physics step and from nudged starts, where it says
    something else.
    """
    said = []
    for k, words in enumerate(
        ("At half the physics step", f"From starts moved by {NUDGE:g} of themselves")
    ):
        runs = {}
        for c, its in traces.items():
            runs[c] = {label: again.get(c, {}).get(label, [t, t])[k] for label, t in its.items()}
        other = scene.sentence(runs)
        order = k == 0 and any(
            first_order(trace.scenario) for its in runs.values() for trace in its.values()
        )
        if not same_answer(answer, other, order):
            said.append(f"{words}: {other}")
    return said


def same_answer(one: str, other: str, first_order: bool = False) -> bool:
    """Return whether two answers say the same: equal words, and numbers that are not `apart`."""
    if NUMBER.sub("#", one) != NUMBER.sub("#", other):
        return False
    pairs = zip(map(float, NUMBER.findall(one)), map(float, NUMBER.findall(other)), strict=True)
    return not any(apart(pair, first_order=first_order) for pair in pairs)


def save(traces: Traces, out: Path, export: Sequence[str] = ()) -> list[Path]:
    """Save each run as .npz, and in each format of `export`; return the files."""
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
    from smc_mujoco.draw.page import files

    if scene.figure == "signals":
        named = {
            condition: {style.label(label): t for label, t in runs.items()}
            for condition, runs in traces.items()
        }
        signals(named, out / "signals", scene.title)
        return files(out / "signals")
    if scene.figure == "chattering":
        from smc_mujoco.draw.amplitudes import amplitudes

        amplitudes(traces, out / "chattering", title=scene.title)
        return files(out / "chattering")
    written: list[Path] = []
    for condition, runs in traces.items():
        path = out / f"{slug(condition)}.svg"
        figure(
            list(runs.values()),
            path,
            labels=[*map(style.label, runs)],
            title=_title(scene, condition),
        )
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

    if sentence := video.missing() or gl.note():
        terminal.note(sentence, "yellow")
    if video.missing():
        return []
    return [video.film(runs, path, names, title, camera=camera)]
