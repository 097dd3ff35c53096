"""The long attack on what the suite promises: any scenario and any file ends well or in one
sentence.

    make attack                                       # all parts, with a new seed
    SEED=7 python -m pytest tests/attack.py -k files  # one part, with the seed that it was told

Parts: `scenarios` (wild fields, run to a trace that is sound), `batches` (several together, the
same bits as alone), `interrupts` (Ctrl-C, after which nothing is lost), `files` (damaged ones),
`calls` (of functions with odd arguments), `commands`.
Found is: an exception that is not ours, a sentence that is none, a trace with a number that was not
computed, a crash, and cases that take too long, of which pytest ends the process. Every case is
made of its part, the seed and its number alone.
"""

import contextlib
import dataclasses
import functools
import json
import math
import os
import random
import signal
import tempfile
import time
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import odd_calls
import pytest
import wild

import smc_mujoco as smc
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.mechanisms.rotation import pose_errors
from smc_mujoco.simulation.state import LOGGED

SEED = int(os.environ.get("SEED") or 0)
TOGETHER = 20  # cases of a test
MOST = 400  # physics steps times channels of a run that is played
# 10 minutes on two cores
CASES = {
    "scenarios": 40_000,
    "batches": 2_000,
    "interrupts": 200,
    "files": 8_000,
    "calls": 5_000,
    "commands": 5_000,
}


class Found(AssertionError):
    """What must not be, in words."""


def sentence(text: str) -> None:
    """Raise Found for an error or a failure that is no sentence."""
    if not text or not text.isprintable() or len(text) > 1500:
        raise Found(f"no sentence: {text[:200]!r}")


# scenarios


def attempt(random: Random) -> smc.Scenario | None:
    """A Scenario, one in three of a grid; None where it was refused in a sentence, or takes longer
    than a blink.
    """
    try:
        fields = wild.fields(random)
        gridded = random.random() < 1 / 3
        if gridded:
            scenario = random.choice(wild.gridded(random, fields))
        else:
            scenario = smc.Scenario(**fields)
    except smc.ScenarioError as error:
        sentence(str(error))
        return None
    except TypeError as error:  # a field that a Scenario does not have
        if "unexpected keyword" not in str(error):
            raise
        return None
    knots = []
    for d in scenario.disturbance:
        if isinstance(d, smc.signals.OrnsteinUhlenbeck):
            knots.append(scenario.duration / d.dt)
    work = scenario.samples * scenario.steps * scenario.plant.n
    if work <= MOST and max(knots, default=0.0) < 1e5 and scenario.readings < 10_000:
        return scenario
    return None


def ran(scenarios: Any) -> Any:
    """What smc.run gives, or None where it refuses."""
    try:
        return smc.run(scenarios, threads=2)
    except smc.ScenarioError as error:
        sentence(str(error))
        return None


def sound(trace: smc.Trace) -> None:  # noqa: PLR0912
    """Raise Found unless the trace has its shape, finite numbers up to where it says that it ends,
    then NaN.
    """
    scenario = trace.scenario
    samples = scenario.samples + 1
    n = scenario.plant.n
    end = scenario.samples + 1
    if (trace.diverged_at is None) != (trace.failure is None):
        raise Found(f"diverged_at {trace.diverged_at}, failure {trace.failure}")
    if trace.diverged_at is not None and trace.failure is not None:
        sentence(trace.failure)
        step = round(trace.diverged_at / scenario.resolved.physics_step)
        end = -(-step // scenario.steps)
        if not math.isclose(
            trace.diverged_at, step * scenario.resolved.physics_step, abs_tol=1e-12
        ):
            raise Found(f"ends between steps, at {trace.diverged_at!r}")
        if not 0 <= step <= scenario.samples * scenario.steps:
            raise Found(f"ends outside the run, at step {step}")
        if f"at t = {trace.diverged_at:.6g} s" not in trace.failure:
            raise Found(f"does not say when: {trace.failure}")
    if trace.t.shape != (samples,) or not np.allclose(
        trace.t, np.arange(samples) * scenario.control_period, 1e-14
    ):
        raise Found("wrong times")
    for name in LOGGED:
        array = getattr(trace, name)
        if array.shape != (samples, n) or array.dtype != np.float64 or array.flags.writeable:
            raise Found(
                f"{name} has shape {array.shape}, type {array.dtype}, writeable "
                f"{array.flags.writeable}"
            )
        if not np.isfinite(array[:end]).all() or not np.isnan(array[end:]).all():
            raise Found(
                f"{name} is not finite up to sample {end} and NaN from there: "
                f"{array[:, 0].tolist()}"
            )
    for name in ("u", "applied"):
        if not np.all(np.abs(getattr(trace, name)[:end]) <= scenario.resolved.u_max):
            raise Found(f"{name} beyond u_max")
    x0 = np.array(scenario.resolved.x0)
    # a rotation vector may have another with the same attitude
    exact = slice(None, 3 if scenario.plant.pose else None)
    if scenario.plant.pose and np.abs(x0).max() < 1e3:
        turned = pose_errors(trace.x[:1], x0[None])[0, 3:]
    else:
        turned = 0.0
    begins = np.array_equal(trace.x[0, exact], x0[exact]) and np.abs(turned).max() < 1e-9
    if end and not (begins and tuple(trace.v[0]) == scenario.resolved.v0):
        raise Found("does not begin at its start")


def scenarios(random: Random) -> str:
    """One wild scenario."""
    scenario = attempt(random)
    trace = None if scenario is None else ran(scenario)
    if scenario is None or trace is None:
        return "refused"
    sound(trace)
    # whose code a file can bring back
    if random.random() < 0.1 and scenario.law.name in smc.laws():
        same(trace, smc.load(trace.save("trace.npz")))
    return "ended early" if trace.failure else "ran"


def same(trace: smc.Trace, other: smc.Trace) -> None:
    """Raise Found where two traces differ in a bit, or in a word."""
    if other.scenario != trace.scenario or (other.diverged_at, other.failure) != (
        trace.diverged_at,
        trace.failure,
    ):
        raise Found(f"{trace!r} and {other!r} differ")
    for name in ("t", *LOGGED):
        if getattr(trace, name).tobytes() != getattr(other, name).tobytes():
            raise Found(f"{name} of {trace!r} and {other!r} differ")


def batches(random: Random) -> str:
    """Several wild scenarios together: the same bits as alone."""
    many = []
    for scenario in (attempt(random) for _ in range(random.randint(3, 8))):
        if scenario is not None:
            many.append(scenario)
    many += [
        dataclasses.replace(s, seed=random.randrange(9))
        for s in many
        for _ in range(random.randrange(3))
    ]
    alone = [ran(scenario) for scenario in many]
    many, alone = [s for s, t in zip(many, alone, strict=True) if t], [t for t in alone if t]
    if not many:
        return "refused"
    for trace, single in zip(ran(many), alone, strict=True):
        sound(trace)
        same(trace, single)
    return "ran"


# interrupts

KEPT = {  # what keeps its pieces in a folder -> its call, and what it gives in a word
    "study": lambda folder: (
        smc.study(
            smc.grid("duffing", ["classical", "pid"], ["nominal", "dc_motor"], 4, duration=1.0),
            folder,
        ).data
    ),
    "tune": lambda folder: (
        smc.tune(
            "duffing", "pid", budget=1, objective=Objective(duration=0.2), searches=4, out=folder
        ).sets
    ),
}


@functools.cache
def undisturbed(kind: str) -> tuple[Any, float]:
    """What a call gives that nobody stops, and how long it takes when all is compiled, s."""
    for folder in ("compiling", "undisturbed"):
        begun = time.monotonic()
        result = KEPT[kind](Path(folder, kind))
    return result, time.monotonic() - begun


def pressed(random: Random, call: Callable[[], Any], longest: float) -> Any:
    """What a call gives that is stopped one to three times, after at most so many seconds; None
    where it does not come to its end.
    """
    calls_to_wait = random.randint(1, 3)

    def press(number: int, frame: Any) -> None:
        nonlocal calls_to_wait
        calls_to_wait -= 1
        if calls_to_wait <= 0:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, press)
    result = None
    with contextlib.suppress(KeyboardInterrupt):  # the second may come while the first is caught
        try:
            signal.setitimer(signal.ITIMER_REAL, random.uniform(1e-3, longest), 0.05)
            result = call()
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGALRM, before)
    return result


def interrupts(random: Random) -> str:
    """A call that Ctrl-C stops, again and again, until it comes to its end in the same folder: what
    was kept is there, is not made again, and the end is that of a call that nobody stopped.
    """
    kind = random.choice(sorted(KEPT))
    undisturbed_result, seconds = undisturbed(kind)
    result = None
    finished: dict[Path, int] = {}
    stops = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        while result is None:
            result = pressed(random, lambda: KEPT[kind](folder), seconds)
            stops += result is None
            files = [path for path in folder.rglob("*") if path.is_file()]
            if odd := [path.name for path in files if path.name.startswith(".")]:
                raise Found(f"{kind} leaves {odd}")
            now = {path: path.stat().st_mtime_ns for path in files if path.stem != "results"}
            if not finished.items() <= now.items():
                raise Found(f"{kind} loses what was kept, or makes it again")
            finished = now
    if result != undisturbed_result:
        raise Found(f"{kind} ends with something else after {stops} stops")
    return "stopped" if stops else "ran"


# files


@functools.cache
def world() -> None:
    """Write right files into the folder of this process, once."""
    scenario = smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.2)
    trace = smc.run(scenario)
    trace.save("trace.npz")
    trace.export("a.csv")
    runs = smc.grid(["duffing"], ["classical", "none"], ["nominal", "noise"], 2, duration=0.2)
    smc.study(runs, "out")
    short = Objective(duration=0.2)
    tuned = smc.tune("duffing", "classical", budget=1, objective=short, searches=1)
    tuned.save("tuned.json")


def _where(error: BaseException) -> str:
    """The type of an exception and the file, of this package if it can be, that it came from."""
    step = error.__traceback__
    files = []
    while step is not None:
        files.append(f"{step.tb_frame.f_code.co_filename}:{step.tb_lineno}")
        step = step.tb_next
    own = [file for file in files if "smc_mujoco" in file] or files
    return f"{type(error).__name__} in {Path(own[-1]).name}"


def _first(error: BaseException) -> str:
    try:
        return str(error).strip().split("\n")[0][:200]
    except Exception:
        return "?"


ABSURD = [
    None,
    True,
    0,
    -1,
    1e308,
    10**30,
    0.5,
    "",
    "x",
    "\ud800",
    [],
    [[]],
    {},
    {"x": 1},
]
ABSURD += ["NaN", math.nan, math.inf]


def grown(random: Random, node: Any) -> Any:
    """JSON with one node replaced, dropped or doubled."""
    if isinstance(node, dict) and node and random.random() < 0.85:
        key = random.choice(sorted(node))
        match random.randrange(8):
            case 0:
                return {k: v for k, v in node.items() if k != key}
            case 1:
                return node | {f"{key}x": node[key]}
        return node | {key: grown(random, node[key])}
    if isinstance(node, list) and node and random.random() < 0.85:
        i = random.randrange(len(node))
        return [*node[:i], grown(random, node[i]), *node[i + random.choice([1, 1, 1, 0]) :]]
    return random.choice(ABSURD)


def damaged(random: Random, data: bytes) -> bytes:
    """Bytes with some flipped, cut, doubled or replaced."""
    place = random.randrange(len(data))
    match random.randrange(5):
        case 0:
            return data[:place]
        case 1:
            return data[:place] + random.randbytes(random.randint(1, 40)) + data[place:]
        case 2:
            return data[:place] + data[place + random.randint(1, 40) :]
        case 3:
            return (
                data[:place]
                + random.choice([b"nan", b"1e999", b"null", b"[", b"-", b"\0", b",,"])
                + data[place + 1 :]
            )
    many = bytearray(data)
    for _ in range(random.randint(1, 4)):
        many[random.randrange(len(many))] ^= 1 << random.randrange(8)
    return bytes(many)


def files(random: Random) -> str:
    """A damaged file, read."""
    from smc_mujoco.analysis.tuning import result as tuned

    world()
    kind = random.choice(["trace", "about", "tuned", "json", "table", "csv"])
    source, read = {
        "trace": ("trace.npz", smc.load),
        "about": ("trace.npz", smc.load),
        "tuned": ("tuned.json", tuned.load_tuned),
        "json": ("tuned.json", tuned.load_tuned),
        "table": ("out/results.parquet", smc.Table.read),
        "csv": ("a.csv", smc.signals.TimeSeries.from_csv),
    }[kind]
    place = Path(f"damaged{Path(source).suffix}")
    data = Path(source).read_bytes()
    if kind == "json":
        place.write_text(json.dumps(grown(random, json.loads(data))))
    elif kind == "about":
        with np.load(source) as file:
            arrays = dict(file)
        arrays["about"] = np.array(json.dumps(grown(random, json.loads(str(arrays["about"])))))
        np.savez(place, **arrays)
    elif kind == "trace" and random.random() < 0.5:  # whole, but of other arrays
        with np.load(source) as file:
            arrays = dict(file)
        odd = []
        for array in wild.ARRAYS:
            if array is not np.ma.masked and array.dtype != object:
                odd.append(array)
        arrays[random.choice(sorted(arrays))] = random.choice(odd)
        np.savez(place, **arrays)
    else:
        place.write_bytes(damaged(random, data))
    try:
        content = read(place)
        if isinstance(content, smc.Table):
            content.rows()
            for i in range(min(len(content), 2)):
                content.scenario(i)
    except smc.ScenarioError as error:
        sentence(str(error))
        return "refused"
    except zipfile.BadZipFile as error:
        raise Found(f"BadZipFile: {error}") from None
    return "read"


# running them

PARTS: dict[str, Callable[[Random], str]] = {
    "scenarios": scenarios,
    "batches": batches,
    "interrupts": interrupts,
    "files": files,
    "calls": functools.partial(odd_calls.calls, sentence=sentence),
    "commands": functools.partial(odd_calls.commands, sentence=sentence),
}


def case(part: str, seed: int, i: int) -> tuple[str, str]:
    """How a case ended, and what was found, "" for nothing."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return PARTS[part](random.Random(f"{part} {seed} {i}")), ""
    except Found as error:
        return "found", str(error)
    except Exception as error:
        return "found", f"{_where(error)}: {_first(error)}"


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """One folder for all cases of a process, whose files the first of them writes."""
    return tmp_path_factory.mktemp("attack")


@pytest.mark.parametrize(
    ("part", "start"),
    [(part, start) for part in PARTS for start in range(0, CASES[part], TOGETHER)],
)
def test_nothing_is_found(part, start, folder, monkeypatch):
    monkeypatch.chdir(folder)
    monkeypatch.setenv("HOME", str(folder))
    for i in range(start, start + TOGETHER):
        _, why = case(part, SEED, i)
        assert not why, f"case {i} of {part}, seed {SEED}: {why}"
