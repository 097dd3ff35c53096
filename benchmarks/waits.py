"""Where people wait: the processor time of what a person starts, part by part, beside a fixed piece
of work, so that machines can be compared.

    python benchmarks/waits.py [ROW ...] [--write] [--rounds N] [--beside FOLDER]

Each row runs in a process of its own, in an empty folder. A row of a cold folder has an empty cache
of compiled code, too; the others have what the machine keeps, so that the first round of a machine
takes longer. `demo` clones the repository and needs a network. --beside runs the rows of another
checkout in turn with these; --write keeps the rows in benchmarks/waits.json, from which README has
its times.

Times are of the processor and of all processes that a row starts, so that other work on the machine
counts little. Parts that two cores make at once, as the charts of a film and the next picture, each
count the time of both. The fixed work is a million bare steps of a pendulum by MuJoCo.
"""

import argparse
import contextlib
import functools
import importlib
import json
import os
import resource
import shlex
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
MEASURED = Path(__file__).with_suffix(".json")
FIXED_STEPS = 1_000_000
PENDULUM = """<mujoco><worldbody><body><joint axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".02" mass="1"/></body></worldbody></mujoco>"""
TWO_JOINTS = """<mujoco model="arm"><compiler angle="radian"/><worldbody><body>
<joint name="shoulder" axis="0 1 0" damping=".2"/>
<geom type="capsule" fromto="0 0 0 0 0 -.35" size=".02" mass="1.2"/><body pos="0 0 -.35">
<joint name="elbow" axis="0 1 0" damping=".05"/>
<geom type="capsule" fromto="0 0 0 0 0 -.3" size=".02" mass=".6"/></body></body></worldbody>
<actuator><motor joint="shoulder" ctrllimited="true" ctrlrange="-20 20"/>
<motor joint="elbow" ctrllimited="true" ctrlrange="-8 8"/></actuator></mujoco>"""


def work() -> None:
    """The fixed piece of work."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(PENDULUM)
    mujoco.mj_step(model, mujoco.MjData(model), FIXED_STEPS)


def command(*words: str) -> None:
    """A command of smc-mujoco."""
    from smc_mujoco.cli.main import main

    with contextlib.suppress(SystemExit):
        main(words)


def first_screen() -> None:
    """The command of README's first screen, with the law that stands there."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    law = text.split('```python title="my_law.py"\n')[1].split("```")[0]
    Path("my_law.py").write_text(law, encoding="utf-8")
    line = text.split("\nsmc-mujoco compare ")[1].split("\n")[0]
    command("compare", *shlex.split(line))


def film() -> None:
    """The film of two machines, 3 s each."""
    import smc_mujoco as smc

    traces = smc.run(
        [smc.Scenario(plant="duffing", law=law, duration=3.0) for law in ("pid", "super_twisting")]
    )
    smc.film(traces, "duffing.mp4")


def which() -> None:
    """The recommendation for two joints among three laws, to the first look of its race."""
    import smc_mujoco as smc
    from smc_mujoco.studies import race

    race.LOOKS = race.LOOKS[:1]
    Path("arm.xml").write_text(TWO_JOINTS, encoding="utf-8")
    laws = ["pid", "super_twisting", "adrc"]
    conditions = ["nominal", "noise", "sine"]
    answer = smc.which("arm.xml:shoulder,elbow", conditions, laws=laws, threads=1)
    print(answer, answer.law)


def identify() -> None:
    """Eight numbers of two joints, from a log of 8 s and another to check them."""
    benchmark = importlib.import_module("identify")
    identified, _ = benchmark.found_of("two", 0)
    print(identified, identified.values, identified.errors)


def basin() -> None:
    """The region of attraction of one law, 400 states."""
    import smc_mujoco as smc

    print(smc.design.basin("inverted_pendulum", "super_twisting", points=(20, 20)))


def demo() -> None:
    """`make demo` in a fresh clone."""
    subprocess.run(["git", "clone", "--quiet", str(ROOT), "clone"], check=True)
    subprocess.run(["make", "demo"], cwd="clone", check=True)


class Row(NamedTuple):
    """A thing that a person waits for."""

    action: Callable[[], None]
    bound: str
    parts: Mapping[str, str] = {}  # part -> the function that it is, as module:name
    cold: bool = False


DRAW = "smc_mujoco.draw.film"
STUDIES = "smc_mujoco.studies"
ROWS = {
    "film": Row(
        film,
        "MuJoCo draws on the processor",
        {
            "rendering": "mujoco:Renderer.render",
            "outlines": f"{DRAW}.canvas:Canvas.outlined",
            "arrows": f"{DRAW}.stage:Stage.stamped",
            "charts": f"{DRAW}.sheet:Sheet.picture",
        },
    ),
    "which": Row(
        which,
        "runs of MuJoCo",
        {
            "first sets": f"{STUDIES}.race:_first_sets",
            "other sets": f"{STUDIES}.race:_search_round",
            "searched again": f"{STUDIES}.race:_again",
            "judging": f"{STUDIES}.race:_judge",
            "choosing": f"{STUDIES}.recommend:_chosen",
            "unseen runs": f"{STUDIES}.recommend:_fixed",
            "tables": f"{STUDIES}.recommend:leaderboard",
            "margins": f"{STUDIES}.recommend:_margins",
        },
    ),
    "comparison": Row(
        first_screen,
        "runs of MuJoCo, then the compiler",
        {
            "compiling": "numba.core.dispatcher:_FunctionCompiler.compile",
            "gains": f"{STUDIES}.fair_gains:Trial.candidates",
            "runs": f"{STUDIES}.fair_gains:Trial.run",
            "unseen runs": f"{STUDIES}.fair_gains:Trial.holdout",
        },
        cold=True,
    ),
    "list": Row(functools.partial(command, "list"), "imports"),
    "help": Row(functools.partial(command, "--help"), "imports"),
    "identify": Row(
        identify,
        "replays by MuJoCo",
        {"replays": "smc_mujoco.identification.replays:Replays._replayed"},
    ),
    "claims": Row(
        functools.partial(command, "claims"), "runs of MuJoCo, then their scores", cold=True
    ),
    "demo": Row(demo, "the network, MuJoCo draws on the processor"),
    "basin": Row(basin, "the compiler, then runs of MuJoCo", cold=True),
}


@contextlib.contextmanager
def timed(parts: Mapping[str, str]) -> Iterator[dict[str, float]]:
    """Yield the seconds in functions, which are timed meanwhile; not again within themselves."""
    seconds = dict.fromkeys(parts, 0.0)
    for part, place in parts.items():
        module, _, path = place.partition(":")
        *outer, name = path.split(".")
        with contextlib.suppress(ImportError, AttributeError):  # another checkout may not have it
            owner: Any = functools.reduce(getattr, outer, importlib.import_module(module))
            setattr(owner, name, _timed(getattr(owner, name), part, seconds))
    yield seconds


def _timed(function: Callable, part: str, seconds: dict[str, float]) -> Callable:
    inside: list[None] = []

    @functools.wraps(function)
    def call(*arguments: Any, **named: Any) -> Any:
        start = time.process_time()
        inside.append(None)
        try:
            return function(*arguments, **named)
        finally:
            inside.pop()
            if not inside:
                seconds[part] += time.process_time() - start

    return call


def child(name: str, report: Path) -> None:
    """Run a row in this process, and write the seconds of its parts to a file."""
    sys.path.append(str(ROOT / "tests"))  # of logs that `identify` makes
    if name == "work":
        work()
        return
    with timed(ROWS[name].parts) as seconds:
        ROWS[name].action()
    report.write_text(json.dumps(seconds), encoding="utf-8")


def spent(name: str, checkout: Path = ROOT) -> tuple[float, dict[str, float]]:
    """Return the processor seconds of a row of a checkout, in a process of its own, and those of
    its parts.
    """
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place, "empty")
        folder.mkdir()
        report = Path(place, "parts.json")
        environment = os.environ | {"PYTHONPATH": str(checkout)}
        if name in ROWS and ROWS[name].cold:
            environment["NUMBA_CACHE_DIR"] = environment["XDG_CACHE_HOME"] = f"{place}/cache"
        before = children()
        words = [sys.executable, __file__, "--child", name, str(report)]
        with Path(place, "said").open("w+", encoding="utf-8") as said:
            done = subprocess.run(
                words, cwd=folder, env=environment, stdout=said, stderr=said, check=False
            )
            if done.returncode:
                said.seek(0)
                sys.exit(f"{name}: {said.read()}")
        parts = json.loads(report.read_text(encoding="utf-8")) if report.exists() else {}
        return children() - before, parts


def children() -> float:
    """Return the processor seconds of all processes that this one has waited for."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def measured(name: str, checkouts: list[Path], rounds: int) -> list[dict[str, Any]]:
    """Return the row of each checkout, by turns: medians over rounds."""
    times: list[list[tuple[float, float, dict[str, float]]]] = [[] for _ in checkouts]
    for _ in range(rounds):
        for of_checkout, checkout in zip(times, checkouts, strict=True):
            of_work, _ = spent("work")
            of_checkout.append((of_work, *spent(name, checkout)))
    rows = []
    for of_checkout in times:
        seconds = statistics.median(took for _, took, _ in of_checkout)
        ratio = statistics.median(took / of_work for of_work, took, _ in of_checkout)
        parts = {}
        for part in ROWS[name].parts:
            parts[part] = round(statistics.median(of_row[part] for *_, of_row in of_checkout), 2)
        rows.append({"ratio": round(ratio, 2), "seconds": round(seconds, 2), "parts": parts})
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", nargs="*", default=[*ROWS], choices=ROWS, metavar="ROW")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--beside", type=Path)
    options = parser.parse_args()
    checkouts = [ROOT, *([options.beside.resolve()] if options.beside else [])]
    print(f"{'':12s} {'ratio':>8s} {'s here':>8s}  bound by; parts, s")
    for name in options.rows:
        rows = measured(name, checkouts, options.rounds)
        for row, checkout in zip(rows, checkouts, strict=True):
            title = name if checkout == ROOT else "  beside"
            parts = ", ".join(f"{part} {took:.1f}" for part, took in row["parts"].items())
            words = "; ".join(filter(None, [ROWS[name].bound, parts]))
            print(f"{title:12s} {row['ratio']:8.2f} {row['seconds']:8.2f}  {words}", flush=True)
        if options.write:
            table = json.loads(MEASURED.read_text()) if MEASURED.exists() else {}
            table[name] = rows[0] | {"bound": ROWS[name].bound}
            MEASURED.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        child(sys.argv[2], Path(sys.argv[3]))
    else:
        main()
