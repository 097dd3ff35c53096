"""The long attack on what the suite promises: any scenario, any call and any file ends well or in
one sentence.

    make attack                                                       # all parts, 10 minutes, with new seeds
    python tests/attack.py calls --seed 7 --cases 25000               # one part
    python tests/attack.py calls --seed 7 --start 1234 --cases 1      # one case again, as the attack prints it

Parts: `scenarios` (wild fields, run to a trace that is sound), `batches` (several together, the
same bits as alone), `calls` (public names with what they do not take), `files` (damaged ones).
Found is: an exception that is not ours, a sentence that is none, a trace with a number that was not
computed, a crash, and a case that takes longer than LIMIT. Every case is made of its part, the seed
and its number alone. Exit code 1 where something was found.
"""

import argparse
import concurrent.futures
import contextlib
import dataclasses
import faulthandler
import functools
import inspect
import json
import math
import os
import random
import re
import select
import signal
import subprocess
import sys
import tempfile
import time
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import wild

import smc_mujoco as smc
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.common.errors import shown
from smc_mujoco.mechanisms.rotation import pose_errors
from smc_mujoco.simulation.state import LOGGED

START = 600.0  # s in which a process is ready, compiling included
# s a case may take; what computes on after a wrong-typed call is ended after LONG and counts as
# accepted
LIMIT = 60.0
LONG = 2.0  # s
SLICE = 10_000  # cases a process at most; each process compiles its laws again, for a minute
MOST = 400  # physics steps times channels of a run that is played
HERE = Path(__file__).parent
SCRIPT = __file__  # what a child runs
CASES = {
    "scenarios": 40_000,
    "batches": 2_000,
    "calls": 25_000,
    "files": 8_000,
}  # 10 minutes on two cores


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


def sound(trace: smc.Trace) -> None:
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
                f"{name} has shape {array.shape}, type {array.dtype}, writeable {array.flags.writeable}"
            )
        if not np.isfinite(array[:end]).all() or not np.isnan(array[end:]).all():
            raise Found(
                f"{name} is not finite up to sample {end} and NaN from there: {array[:, 0].tolist()}"
            )
    for name in ("u", "applied"):
        if not np.all(np.abs(getattr(trace, name)[:end]) <= scenario.resolved.u_max):
            raise Found(f"{name} beyond u_max")
    x0 = np.array(scenario.resolved.x0)
    exact = slice(
        None, 3 if scenario.plant.pose else None
    )  # a rotation vector may have another with the same attitude
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
    if (
        random.random() < 0.1 and scenario.law.name in smc.laws()
    ):  # whose code a file can bring back
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


# calls


SANE: dict[str, Any] = {  # what an argument of this name is, of a public call that is right
    **{
        "plant": "duffing",
        "of": "duffing",
        "law": "classical",
        "plants": ["duffing"],
        "laws": ["classical"],
    },
    **{
        "conditions": ["nominal"],
        "condition": "nominal",
        "law_name": "classical",
        "seeds": 1,
        "duration": 0.02,
    },
    **{
        "points": (2, 2),
        "kinds": ["delay"],
        "budget": 8,
        "gains": "tuned",
        "kind": "none",
        "channels": ["shoulder"],
    },
    **{
        "labels": ["a"],
        "title": "a",
        "size": (320, 180),
        "fps": 10.0,
        "span": (0.0, 0.1),
        "time": 0.0,
        "out": "out",
    },
    **{
        "mechanism": "springs",
        "i": 0,
        "step": 0,
        "seed": 0,
        "factors": {},
        "numbers": "double",
        "act": print,
    },
    **{
        "times": [0.0, 1.0],
        "values": [0.0, 1.0],
        "column": None,
        "only": [1],
        "quick": True,
        "metrics": ["itae"],
    },
    **{
        "threads": 1,
        "low": 0.0,
        "high": 5.0,
        "name": "classical",
        "scene": "none such",
        "resolution": 0.1,
    },
}
OWN: dict[str, dict[str, Any]] = {  # where the argument of a call is another than its name says
    **{name: {"path": path} for name, path in {"film": "a.mp4"}.items()},
    **{
        "load": {"path": "trace.npz"},
        "Table.read": {"path": "out"},
        "plant_from": {"path": "arm.xml"},
    },
    **{
        "TimeSeries.from_csv": {"path": "a.csv"},
        "Trace.export": {"path": "a.csv"},
        "plant": {"name": "duffing"},
    },
    **{
        "surface": {"name": "linear"},
        "estimator": {"name": "measured"},
        "law_from_c": {"source": "law.c", "name": None},
    },
    **{
        "law_function": {"gains": {"k": 1.0}, "function": None},
        "surface_function": {"gains": {}, "function": None},
    },
    **{
        "estimator_function": {"gains": {}, "function": None},
        "Table.column": {"name": "itae"},
        "Law": {"gains": {}},
    },
    **{
        "Scene": {"conditions": {}},
        "Claim.checks": {"gains": "tuned"},
        "Channel": {"actuator": None},
    },
}


class World:
    """Right arguments of every public call, made once a process, in its folder."""

    def __init__(self) -> None:
        self.scenario = smc.Scenario(plant="duffing", law="classical", duration=0.2)
        self.trace = smc.run(self.scenario)
        self.trace.save("trace.npz")
        self.trace.export("a.csv")
        self.table = smc.study(
            smc.grid(["duffing"], ["classical", "none"], ["nominal", "noise"], 2, duration=0.2),
            "out",
        )
        Path("arm.xml").write_text(wild.ARM)
        Path("law.c").write_text(smc.exchange.law_to_c("classical"))
        self.tuned = smc.tune(
            "duffing", "classical", budget=1, objective=Objective(duration=0.2), searches=1
        )
        self.tuned.save("tuned.json")
        self.sane = SANE | {
            "scenarios": [self.scenario],
            "trace": self.trace,
            "traces": self.trace,
            "table": self.table,
        }
        self.sane |= {"path": "a", "conditions_": None, "environment": self.trace.scenario.plant}
        self.calls = dict(self._calls())

    def _calls(self) -> Iterator[tuple[str, Callable]]:
        """Name -> what to call, of all that is public."""
        held = [
            self.scenario,
            self.trace,
            self.table,
            self.tuned,
            self.scenario.plant,
            smc.Coulomb(0.1),
            smc.Lag(0.1),
        ]
        held += [
            smc.Encoder(),
            smc.Sine(1.0, 1.0),
            smc.signals.TimeSeries([0, 1], [0, 1]),
            smc.Contact("none"),
        ]
        held += [smc.Scene(title="a", conditions={"b": {"c": self.scenario}})]
        instances = {type(one): one for one in held}
        for name in sorted(one for one in dir(smc) if not one.startswith("_")):
            value = getattr(smc, name)
            if inspect.ismodule(value):
                shelf = {inner: getattr(value, inner) for inner in getattr(value, "__all__", ())}
                for inner, function in (vars(value) | shelf).items():
                    if (
                        inspect.isfunction(function)
                        and not inner.startswith("_")
                        and hasattr(function, "explains")
                    ):
                        yield f"{name}.{inner}", function
            elif callable(value) and not (
                isinstance(value, type) and issubclass(value, BaseException | list)
            ):
                yield name, value
            for method, there in vars(value).items() if isinstance(value, type) else ():
                if isinstance(there, classmethod | staticmethod):
                    function = there.__func__
                else:
                    function = there
                if (
                    not method.startswith("_")
                    and inspect.isfunction(function)
                    and hasattr(function, "explains")
                ):
                    bound = getattr(instances.get(value, value), method)
                    if not isinstance(there, staticmethod | classmethod) and value not in instances:
                        continue  # nothing at hand to call it on
                    yield f"{name}.{method}", bound

    def right(self, name: str, call: Callable) -> dict[str, Any]:
        """The arguments with which the call is right, as far as they are known."""
        named = {}
        own = OWN.get(name, {})
        for parameter in inspect.signature(call).parameters.values():
            if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
                continue
            if parameter.name in own or parameter.name in self.sane:
                named[parameter.name] = own.get(parameter.name, self.sane.get(parameter.name))
            elif repr(parameter.default) == "<factory>":
                continue
            elif parameter.default is not parameter.empty:
                named[parameter.name] = parameter.default
            else:
                named[parameter.name] = 0.5
        return named


@functools.cache
def world() -> World:
    """The World of this process."""
    return World()


class Long(KeyboardInterrupt):
    """A call that computes on: it was accepted."""


@contextlib.contextmanager
def alarm(seconds: float) -> Iterator[None]:
    """Raise Long in what takes longer, again and again, where Ctrl-C would stop it."""

    def ring(*_: object) -> None:
        raise Long

    signal.signal(signal.SIGINT, ring)
    signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    signal.setitimer(signal.ITIMER_REAL, seconds, 1.0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def calls(random: Random) -> str:
    """A public name, called with one or two arguments of any type, one too few, or one that it does
    not know.
    """
    name = random.choice(sorted(world().calls))
    call = world().calls[name]
    named = world().right(name, call)
    keywords = any(p.kind is p.VAR_KEYWORD for p in inspect.signature(call).parameters.values())
    for key in random.sample(sorted(named), min(len(named), random.choice([1, 1, 2]))):
        named[key] = wild.value(random)
    if callable(named.get("report")):  # what a function of the user's raises is the user's
        named["report"] = lambda *args: None
    if keywords or random.random() < 0.05:
        named[random.choice(["k1", "mass", "l", "n", "lam", "traces_", "x"])] = wild.value(random)
    if named and random.random() < 0.05:
        del named[random.choice(sorted(named))]
    parameters = inspect.signature(call).parameters
    placed = []
    for p in parameters.values():
        if p.kind is p.POSITIONAL_ONLY and p.name in named:
            placed.append(named.pop(p.name))
    told = f"smc.{name}({', '.join(f'{key}={shown(held)}' for key, held in named.items())})"
    try:
        with alarm(LONG):
            result = call(*placed, **named)
            if inspect.isgenerator(result):
                next(result, None)
    except smc.ScenarioError as error:
        sentence(str(error))
        return "refused"
    except (
        TypeError,
        AttributeError,
    ):  # Python's own words for a wrong type, or a name that the call does not have
        return "refused"
    except (
        ZeroDivisionError,
        ValueError,
    ) as error:  # of an argument's own code: a wild value's, or an array's truth
        if str(error) != "awkward" and "truth value of an" not in str(error):
            raise Found(f"{_where(error)} from {told}: {_first(error)}") from None
        return "refused"
    except Long:
        return "computes"
    except BaseException as error:  # SystemExit too, unless it ends a script
        if name == "play" and isinstance(error, SystemExit):
            return "refused"
        raise Found(f"{_where(error)} from {told}: {_first(error)}") from None
    return "accepted"


def _where(error: BaseException) -> str:
    """The type of an exception and the line of this package, or else of another, that it came from."""
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


# files

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
    "NaN",
    math.nan,
    math.inf,
]


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
    at = random.randrange(len(data))
    match random.randrange(5):
        case 0:
            return data[:at]
        case 1:
            return data[:at] + random.randbytes(random.randint(1, 40)) + data[at:]
        case 2:
            return data[:at] + data[at + random.randint(1, 40) :]
        case 3:
            return (
                data[:at]
                + random.choice([b"nan", b"1e999", b"null", b"[", b"-", b"\0", b",,"])
                + data[at + 1 :]
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
        "tuned": ("tuned.json", tuned.load),
        "json": ("tuned.json", tuned.load),
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
        with alarm(LIMIT / 2):
            found = read(place)
            if isinstance(found, smc.Table):
                found.rows()
                for i in range(min(len(found), 2)):
                    found.scenario(i)
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
    "calls": calls,
    "files": files,
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


def child(part: str, seed: int, start: int, cases: int) -> None:
    """Run cases, each told, on the standard output that the calls do not get."""
    faulthandler.enable()
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(os.open(os.devnull, os.O_RDWR), 1)
    if part in ("calls", "files"):
        world()
    out.write("[]\n")
    for i in range(start, start + cases):
        out.write(f"{json.dumps([i, *case(part, seed, i)])}\n")


def slice_of(part: str, seed: int, start: int, cases: int) -> Iterator[tuple[int, str, str]]:
    """(case, how it ended, what was found) of a slice, each process begun again after the case that
    ended it.
    """
    end = start + cases
    while start < end:
        with (
            tempfile.TemporaryDirectory(prefix="attack") as folder,
            tempfile.TemporaryFile() as errors,
        ):
            command = [sys.executable, SCRIPT, part, "--seed", str(seed), "--start", str(start)]
            process = subprocess.Popen(
                [*command, "--cases", str(end - start), "--child"],
                cwd=folder,
                env=os.environ | {"PYTHONPATH": str(Path(smc.__file__).parents[1]), "HOME": folder},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=errors,
            )
            hung = False
            with process:
                for line in lines(process):
                    hung = not line
                    if line and (ended := json.loads(line)):
                        yield tuple(ended)
                        start = ended[0] + 1
                process.kill()
            if start < end:
                errors.seek(0)
                told = []
                for text in errors.read().decode(errors="replace").splitlines():
                    if text.strip():
                        told.append(text.strip())
                why = f"the process ended with code {process.returncode}: {' | '.join(told[-12:])}"
                yield start, "found", f"takes longer than {LIMIT:g} s" if hung else why
                start += 1


def lines(process: subprocess.Popen) -> Iterator[bytes]:
    """The lines that a process writes, and after LIMIT without one b""."""
    held = b""
    pipe = process.stdout
    limit = START
    assert pipe is not None
    while select.select([pipe], [], [], limit)[0]:
        limit = LIMIT
        if not (read := os.read(pipe.fileno(), 2**16)):
            return
        *whole, held = (held + read).split(b"\n")
        yield from whole
    yield b""


def attacked(part: str, seed: int, start: int, cases: int, jobs: int) -> int:
    """Run a part in slices, print what was found; how many."""
    begun = time.monotonic()
    ends = Counter()
    kinds = Counter()
    size = min(SLICE, -(-cases // jobs))
    slices = []
    for first in range(start, start + cases, size):
        slices.append((first, min(size, start + cases - first)))
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        for results in pool.map(lambda piece: list(slice_of(part, seed, *piece)), slices):
            for i, end, why in results:
                ends[end] += 1
                if why:
                    kind = re.sub(r"\(.*\)|0x\w+|\d+\.?\d*", "", why)[:90]
                    kinds[kind] += 1
                    if kinds[kind] <= 3:
                        again = f"python tests/attack.py {part} --seed {seed} --start {i} --cases 1"
                        print(f"  {why}\n    {again}", flush=True)
    told = ", ".join(f"{count} {end}" for end, count in sorted(ends.items()))
    seconds = time.monotonic() - begun
    print(
        f"{part}: seed {seed}, {sum(ends.values())} cases from {start}, {seconds:.0f} s: {told}",
        flush=True,
    )
    return ends["found"]


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__.split("\n", maxsplit=1)[0] if __doc__ else None
    )
    parser.add_argument("part", nargs="?", choices=[*PARTS, "all"], default="all")
    parser.add_argument("--seed", type=int, help="default: a new one")
    parser.add_argument("--start", type=int, default=0, help="the first case")
    parser.add_argument("--cases", type=int, help="how many of each part")
    parser.add_argument("--jobs", type=int, default=2, help="processes at once")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.seed is None:
        seed = random.SystemRandom().randrange(10**6)
    else:
        seed = given.seed
    if given.child:
        child(given.part, seed, given.start, given.cases)
        return 0
    if given.part == "all":
        parts = list(PARTS)
    else:
        parts = [given.part]
    print(f"seed {seed}; a case may take {LIMIT:g} s", flush=True)
    return int(
        sum(
            attacked(part, seed, given.start, given.cases or CASES[part], given.jobs)
            for part in parts
        )
        > 0
    )


if __name__ == "__main__":
    sys.exit(main())
