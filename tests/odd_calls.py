"""Calls with odd arguments: of public functions, and of commands.

Each call is right but for one argument or a few. It ends well, in a ScenarioError of one sentence,
or in a TypeError; a command ends with exit code 0 or 2, and without a traceback.
"""

import contextlib
import functools
import inspect
import io
import operator
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import typer
import wild
from helpers import annexes

import smc_mujoco as smc
from smc_mujoco.cli import main

SCENE = """import smc_mujoco as smc
scene = smc.Scene(
    title="t", figure="overview", film="nominal",
    conditions={"nominal": {"a": smc.Scenario(plant="duffing", law="none", duration=0.01)}},
    answer=lambda traces: "It ran.",
)
"""
TEXTS = [
    "",
    " ",
    "0",
    "1",
    "-1",
    "3",
    "007",
    "1e999",
    "nan",
    "-inf",
    "inf",
    "9" * 400,
    "0x10",
    "1,",
]
TEXTS += [
    ",",
    "a,b",
    "a=b",
    "=",
    "a=",
    "M=nan",
    "mass=1:2:3",
    "mass=nan:inf",
    ":",
    "a:b",
    "lag:",
    "@",
]
TEXTS += [
    "duffing",
    "pid",
    "pid(",
    "pid(kp=",
    "pid(kp=nan)",
    "pid(text=1)",
    "linear(c=x)",
    "(",
    ")",
]
TEXTS += ["noise", "worn: friction=Coulomb(-1)", "w: x=1", "w: friction=", "w: __import__('os')"]
TEXTS += [
    "é" * 300,
    "名",
    "\ud800",
    "\x1b[31m",
    "a\nb",
    "%s{0}",
    "../../x",
    "/",
    ".",
    "~",
    "x" * 9999,
]
TEXTS += [
    "nowhere.npz",
    "nowhere.py",
    "nowhere.json",
    "nowhere.xml:a",
    "no/where.c",
    "nowhere.toml",
]
FILES = ["a.csv", "a.json", "a.npz", "a.py", "a.xml", "a.xml:shoulder", "a.xml:x@y", "empty.npz"]
FILES += ["bom.toml", "folder", "trace.npz", "scene.py", "list.json", "a.c", "out.json", "out.csv"]
BRIEF = "--seeds 1 --duration 0.1 --quick"
COMPARED = ["duffing --law ?", "? --law pid", "--rig ?", "duffing --law pid --condition ?"]
WHICH = ["duffing --law ?", "? --law pid", "duffing --law pid --need ?"]
WHICH += ["duffing --law pid --condition ?"]
LINES = {  # command -> its shortest right lines, "?" for what is always odd
    "list": ["", "pid", "--plant duffing", "--need continuous"],
    "run": ["scene.py --no-film --no-repeat", "?"],
    "show": ["trace.npz", "?"],
    "view": ["?", "a.xml:shoulder --port 0 --law ?"],
    "compare": [f"{words} {BRIEF}" for words in COMPARED],
    "which": [f"{words} {BRIEF}" for words in WHICH],
    "tune": ["duffing --law ?", "? --law pid", "duffing --law pid --condition ?"],
    "margins": ["duffing --law pid --gains default --kind ?", "? --law pid", "duffing --law ?"],
    "worst": ["duffing --law classical --gains default --budget 1 --duration 0.01"],
    "sensitivity": ["duffing --gains default --points 8 --duration 0.01"],
    "chatter": ["duffing --law ?", "duffing --gains default --actuator ?", "? --law pid"],
    "export": ["pid out.c", "pid out.fmu --no-binary", "? out.c", "?"],
    "enter": ["?", "folder", "a.py", "pid --suite ?", "pid --against ?"],
    "claims": ["--papers", "?", "--paper ?", "--check ?", "1 --gains ?"],
    "rig": ["?", "emps ?", "emps a.csv", "emps a.csv --fit", "duffing ? --fit"],
}


@functools.cache
def world() -> smc.Trace:
    """Write the files that commands are given, once, and return a trace."""
    trace = smc.run(smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.02))
    trace.save("trace.npz")
    Path("a.csv").write_text("t,x\n0,1\n1,nan\n")
    Path("a.json").write_text('{"x": [1, null]}')
    Path("list.json").write_text("[1e999]")
    np.savez("a.npz", x=np.zeros(3), t=np.array([{}], dtype=object))
    Path("a.py").write_text("x = 1\n")
    Path("a.c").write_text("int x;\n")
    Path("a.xml").write_text(wild.ARM)
    Path("empty.npz").write_bytes(b"")
    Path("bom.toml").write_bytes(b"\xef\xbb\xbfname = 'x'\n")
    Path("folder").mkdir(exist_ok=True)
    Path("folder/law.py").write_text("x = 1\n")
    Path("folder/entry.toml").write_bytes(b"\xef\xbb\xbfname = 'x'\n")
    Path("scene.py").write_text(SCENE)
    return trace


def text(random: Random) -> str:
    """An odd text of a command line."""
    return random.choice(random.choice([TEXTS, FILES]))


def line(random: Random) -> list[str]:
    """A command line with odd values."""
    name = random.choice(sorted(annexes.here(LINES)))
    words = [name]
    for word in random.choice(LINES[name]).split():
        words.append(text(random) if word == "?" else word)
    command: Any = typer.main.get_command(main.app)
    options = [option for option in command.commands[name].params if option.opts[0][:2] == "--"]
    for option in random.sample(options, random.randint(0, 2)):
        if option.name in ("help", "worst", "site", "mutants", "film", "browser"):
            continue
        words.append(option.opts[0])
        if not option.is_flag:
            words.append(text(random))
    return words


def commands(random: Random, sentence: Callable[[str], None]) -> str:
    """Run an odd command line."""
    world()
    words = line(random)
    out = io.StringIO()
    code: object = 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        try:
            main.app(words, prog_name="smc-mujoco")
        except SystemExit as ended:
            code = ended.code or 0
        except BaseException as error:
            raise AssertionError(f"{words} ends in {type(error).__name__}: {error}") from error
    said = out.getvalue()
    if code not in (0, 2) or "Traceback" in said:
        raise AssertionError(f"{words} ends with {code}: {said[-300:]}")
    if code and "Usage:" not in said:
        sentence(said.splitlines()[-1].removeprefix("smc-mujoco: "))
    return "refused" if code else "ran"


SHORT = smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.01)
TRACE = object()  # stands for the trace of a run
# public name -> its right arguments, which cost little; ... for what is always odd
ARGUMENTS: dict[str, dict[str, Any]] = {
    "tune": {"plant": ..., "law": "pid", "budget": 1, "searches": 1, "objective": "balanced"},
    "compare": {"laws": ..., "plants": "duffing", "conditions": "nominal", "seeds": 1},
    "which": {"plant": "duffing", "needs": ..., "laws": "pid", "conditions": "nominal"},
    "margins": {"plants": "duffing", "laws": "pid", "kinds": ..., "gains": "default"},
    "worst_case": {
        "scenario": SHORT,
        "metric": "peak",
        "within": smc.Uncertainty(disturbance=1.0),
        "budget": 1,
        "seed": 0,
    },
    "sensitivity": {"scenario": SHORT, "metric": "peak", "points": ..., "seed": 0},
    "design.basin": {"plant": "duffing", "law": ..., "points": (2, 2), "duration": 0.1},
    "design.objective": {"plant": "duffing", "law": ..., "objective": "balanced", "search": 0},
    "design.chattering": {"law": SHORT, "channel": 0},
    "design.lqr": {"plant": "duffing", "q": (100.0, 16.0), "r": 1.0},
    "design.state_space": {"plant": "duffing", "x": 0.1},
    "design.excitation": {"machine": "duffing", "names": ["M"], "u_max": ...},
    "accuracy.step_halving": {"traces": ..., "channel": 0},
    "identify_friction": {"speed": [-1.0, -0.5, 0.5, 1.0], "torque": ...},
    "Feedforward": {"friction": smc.Coulomb(0.2), "error": 0.1},
    "hardware.Stribeck": {"coulomb": 1.0, "static": 2.0},
    "hardware.servo": {"name": "xl330", "model": "m4"},
    "signals.cartesian_path": {"plant": "double_pendulum", "times": [0.0, 1.0], "points": ...},
    "exchange.law_to_c": {"law": "pid", "numbers": "double"},
    "exchange.law_from_c": {"source": "a.c", "flags": ...},
    "exchange.law_from_control": {"K": np.array([[1.0, 2.0]]), "inputs": ["e", "de"]},
    "claims": {"table": ...},
    "grid": {"plants": "duffing", "laws": "pid", "conditions": "nominal", "seeds": 1},
    "study": {"scenarios": [SHORT], "out": ...},
    "leaderboard": {"table": ..., "metrics": ["itae"]},
    "Table.read": {"path": "a.csv"},
    "load": {"path": "trace.npz"},
    "law": {"text": "pid", "kp": 3.0},
    "surface": {"name": "linear", "c": 3.0},
    "estimator": {"name": "levant"},
    "laws": {"plant": "duffing"},
    "plant": {"name": "duffing", "M": 1.0, "set": None},
    "condition": {"name": "noise"},
    "starts": {"x0": 0.3},
    "law_from": {"source": np.array([[3.0, 1.0]]), "name": "x"},
    "law_function": {"function": lambda y, gains, memory: (0.0, 0.0), "gains": {"k": 1.0}},
    "results": {"source": ...},
    "problem": {"name": "duffing/noise@1"},
    "rig": {"name": "emps"},
    "identify": {"machine": "emps", "logs": ...},
    "policy": {"act": lambda y: 0.0},
    "plot": {"table": ..., "path": "p.pdf"},
    "figure": {"traces": TRACE, "path": ...},
    "film": {"traces": ..., "path": "f.mp4"},
    "plant_from": {"path": "a.xml", "channels": ["shoulder"]},
    "Uncertainty": {"mass": (0.9, 1.1), "disturbance": 1.0},
    "Channel": {"x0": 0.1},
    "scores": {"trace": ...},
    "score": {"runs": TRACE, "metrics": ["itae"]},
}
CALLS: dict[Callable, dict[str, Any]] = {}
for name in annexes.here(ARGUMENTS):
    CALLS[operator.attrgetter(name)(smc)] = ARGUMENTS[name]


PARAMETERS: dict[Callable, list[str]] = {}
for function in CALLS:
    PARAMETERS[function] = []
    for name, parameter in inspect.signature(function).parameters.items():
        if parameter.kind is not parameter.VAR_KEYWORD:
            PARAMETERS[function].append(name)


def calls(random: Random, sentence: Callable[[str], None]) -> str:
    """Call a public function with odd arguments."""
    trace = world()
    function = random.choice(list(CALLS))
    arguments = {}
    for name, right in CALLS[function].items():
        arguments[name] = trace if right is TRACE else right
    odd = [name for name, value in arguments.items() if value is ...]
    keywords = sorted({*arguments, *PARAMETERS[function]} - {"progress", "report"})
    odd += random.sample(keywords, random.randint(0 if odd else 1, min(2, len(keywords))))
    for name in odd:
        arguments[name] = wild.value(random)
    first, *_ = arguments
    try:
        if random.random() < 0.5:
            function(arguments.pop(first), **arguments)
        else:
            function(**arguments)
    except smc.ScenarioError as error:
        sentence(str(error))
        return "refused"
    except TypeError:
        return "of another type"
    return "ran"
