"""The benchmark's targets, controls and rank correlations, from runs of the catalogue.

    python benchmarks/problems.py measure --out measures.json            # visible instances
    python benchmarks/problems.py measure --out hidden.json --number HEX # those of a number, 64 hex digits, or "random"
    python benchmarks/problems.py freeze measures.json                   # writes the targets into the rules
    python benchmarks/problems.py agree measures.json hidden.json        # rank correlations of the boards

`measure` runs every general law with its best shipped gains, and both controls, on every problem of the rules: about
ten minutes of processor time for seven instances. It goes on where it was stopped.
"""

import argparse
import itertools
import json
import math
import secrets
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from smc_mujoco.benchmark import controls
from smc_mujoco.benchmark import problem as problems
from smc_mujoco.control import gain_sets
from smc_mujoco.simulation.run import stream

INSTANCES = 7  # of each problem, for medians of laws
BANDWIDTHS = (8.0, 16.0, 32.0)  # rad/s, of the oracle
MEASURES = "failed", "accuracy", "itae", "settling", "calm"
Runs = dict[str, dict[str, list[list[float]]]]  # problem -> law -> MEASURES of each instance


def cells(version: int = 1) -> list[str]:
    """List the problems of a version."""
    of = problems.rules(version)
    return [f"{p}/{c}@{version}" for p, c in itertools.product(of["plants"], of["conditions"])]


def measure(out: Path, number: str, instances: int) -> None:
    """Run all laws and controls on all problems, and write their measures."""
    done: dict = json.loads(out.read_text()) if out.exists() else {"number": number, "runs": {}}
    number, runs = done["number"], done["runs"]
    for name in (name for name in cells() if name not in runs):
        one = problems.problem(name)
        laws = {law: law for law in gain_sets.general() if gain_sets.in_set(one.plant, law, "tuned")}
        laws |= {"zero": controls.laws()["zero"]}
        laws |= {f"oracle {w:g}": controls.oracle(w=w) for w in BANDWIDTHS}
        scenarios = [s for law in laws.values() for s in one.scenarios(law, range(instances), number)]
        found = [[math.nan]] * len(scenarios)
        for i, trace in stream(scenarios):
            values = one.measures(trace)
            found[i] = [values[name] for name in MEASURES]
        runs[name] = dict(zip(laws, (found[i : i + instances] for i in range(0, len(found), instances)), strict=True))
        out.write_text(json.dumps(done))
        print(name, file=sys.stderr, flush=True)


def parser() -> argparse.ArgumentParser:
    """Return the command line."""
    made = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = made.add_subparsers(dest="command", required=True)
    measured = commands.add_parser("measure")
    measured.add_argument("--out", type=Path, required=True)
    measured.add_argument("--number", default="")
    measured.add_argument("--instances", type=int, default=INSTANCES)
    return made


if __name__ == "__main__":
    given = parser().parse_args()
    if given.command == "measure":
        number = secrets.token_hex(32) if given.number == "random" else given.number
        measure(given.out, number, given.instances)
