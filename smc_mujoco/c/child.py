"""A law's library tried in a child process, and how that ended in one sentence."""

import json
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from smc_mujoco.c import build, trial
from smc_mujoco.errors import ScenarioError


def attempt(
    file: Path,
    path: Path,
    symbol: str,
    timeout: float,
    values: Sequence[float] | None = None,
    memory: int = 1,
    modelled: bool = False,
) -> None:
    """Load and set up a library in a process of its own, and with `values` for gains call its law.

    Raises:
      ScenarioError: it crashed, did not end in time, or did what a law must not, in one sentence.
    """
    told = build.fresh(".txt")
    order = {"library": str(file), "symbol": symbol, "told": str(told), "call": values is not None}
    order |= {"gains": list(values or ()), "memory": memory, "modelled": modelled}
    command = [sys.executable, "-I", "-S", trial.__file__, json.dumps(order)]
    try:
        code = build.timed(command, timeout, heard=False).returncode
    except build.Late:
        code = None
    lines = (told.read_text() if told.exists() else "").splitlines() or ["loading"]
    if lines[-1] != "fine":
        raise ScenarioError(_sentence(path.name, symbol, lines[-1].replace(str(file), path.name), code, timeout))


def _sentence(file: str, symbol: str, last: str, code: int | None, timeout: float) -> str:
    """What the trial's last line, and how its process ended, say of a law."""
    kind, _, words = last.partition(" ")
    if kind == "Found":
        return f"{file}: {words}"
    if symbol in words and ("undefined symbol" in words or "not found" in words):
        return build.undefined(file, symbol)
    if words:
        return f"{file} cannot be loaded ({' '.join(words.split())}): build it for this machine, with all it needs"
    if code is None:
        return f"{file}: {last} did not end within {timeout:g} s: mend what it waits for, or give timeout="
    if code < 0:
        names = {known.value: known.name for known in signal.Signals}  # without most of the real-time ones
        name = names.get(-code, f"signal {-code}")
        return f"{file}: {last} died of {name} ({signal.strsignal(-code)}): mend where it reads, writes or divides"
    return f"{file}: {last} ended the process with exit code {code}: let it return"
