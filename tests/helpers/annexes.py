"""Which annexes are here: the one place that lists of all that the package has ask.

What a test needs of an annex lives in the annex's folder of tests, and goes with it. Lists with
names of all rooms, such as the lines of commands, leave out what belongs to a missing annex.
"""

import re
from collections.abc import Iterable

from helpers.pages import ROOT
from smc_mujoco.common import annexes, lazy

HERE = tuple(filter(annexes.installed, annexes.ANNEXES))
COMMANDS = {
    "chatter": "chattering",
    "claims": "evidence",
    "enter": "problems",
    "export": "exchange",
}
MACHINES = re.compile(r"\brigs?[( ]")  # published machines are data of an annex


def _public() -> dict[str, str]:
    """Public name -> its annex."""
    names = {}
    for shelf in ("__init__", "accuracy", "design"):
        stub = (ROOT / "smc_mujoco" / f"{shelf}.pyi").read_text(encoding="utf-8")
        for module, name in lazy.NAMES.findall(stub):
            annex = f"{module}.{name}".split(".")[1]
            if annex in annexes.ANNEXES:
                names[name if shelf == "__init__" else f"{shelf}.{name}"] = annex
    return names


PUBLIC = _public()
USED = re.compile(rf"\bsmc\.({'|'.join(map(re.escape, PUBLIC))})\b")


def of(name: str) -> str:
    """Return the annex of a public name, a command, or a module without `smc_mujoco.`; else
    nothing.
    """
    first = re.split("[./]", name)[0]
    if first in annexes.ANNEXES:
        return first
    return PUBLIC.get(name) or PUBLIC.get(first) or COMMANDS.get(name, "")


def here(names: Iterable[str]) -> list[str]:
    """Return those of some names that are of the core or of an annex that is here."""
    return [name for name in names if of(name) in ("", *HERE)]


def lacking(code: str) -> bool:
    """Return whether a text's code uses something of an annex that is missing."""
    used = {PUBLIC[name] for name in USED.findall(code)}
    if MACHINES.search(code):
        used.add("evidence")
    for word in re.findall(r"smc-mujoco (\w+)", code):
        used.add(COMMANDS.get(word, ""))
    return not used <= {"", *HERE}
