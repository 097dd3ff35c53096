"""Suites: lists of problems, by name; and boards, the questions that a problem informs.

A file `suites/NAME.txt` has an ID a line. The suites `smc-30@1` and `smc-50@1` follow a pattern
that knows no law: with plants and conditions counted from 0 in the order of the rules, a problem is
in if (condition + 2 plant + version) mod 5 is below 3, or 5.
"""

from pathlib import Path

from smc_mujoco.common.aliases import Names
from smc_mujoco.common.errors import find
from smc_mujoco.problems.problem import problem, rules

SUITES = Path(__file__).parent / "suites"
PERIOD = 5  # of the pattern


def suites() -> Names:
    """List the names of the suites."""
    return tuple(sorted(path.stem for path in SUITES.glob("*.txt")))


def suite(name: str) -> Names:
    """Return the IDs of a suite's problems. Raise ScenarioError for an unknown name."""
    find("suite", name, dict.fromkeys(suites()))
    lines = (SUITES / f"{name}.txt").read_text(encoding="utf-8").splitlines()
    names = []
    for line in lines:
        if line and not line.startswith("#"):
            names.append(line)
    return tuple(names)


def folder(name: str, seed: int) -> str:
    """Return the folder of a suite's results: its name, with the seed unless that is 0."""
    return f"{name}-seed-{seed}" if seed else name


def boards(name: str) -> Names:
    """Return the questions that a problem informs, of "forces", "sensors", "speed" and "calm"."""
    chosen = problem(name)
    informed = []
    for board, conditions in rules(chosen.version)["boards"].items():
        if {"*", chosen.condition} & {*conditions}:
            informed.append(board)
    return tuple(informed)


def pattern(version: int, share: int) -> Names:
    """Return the IDs that the pattern of a version chooses, `share` of 5 of its plants and
    conditions.
    """
    rules_of_version = rules(version)
    chosen = []
    for j, plant in enumerate(rules_of_version["plants"]):
        for i, condition in enumerate(rules_of_version["conditions"]):
            if (i + 2 * j + version) % PERIOD < share:
                chosen.append(f"{plant}/{condition}@{version}")
    return tuple(chosen)
