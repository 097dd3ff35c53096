"""A law's library tried in child processes before this one loads it, and how that ended in one sentence."""

import json
import re
import shutil
import signal
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from smc_mujoco.common.errors import ScenarioError, number, shown
from smc_mujoco.control.c import build, said, trial

LIBRARIES = (".so", ".dylib")
LONGEST = 86_400.0  # s, of a timeout
# What a law may have done that dies of a signal; of others, what most die of.
DEADLY = {int(signal.SIGABRT): "aborts", int(signal.SIGFPE): "divides, or traps floating-point exceptions"}
# In what the sanitizers print: undefined behaviour; a kind of access, and the functions that it happened in.
UNDEFINED = re.compile(r"^(?P<file>.+?):(?P<line>\d+):\d+: runtime error: (?P<said>.*)$", re.MULTILINE)
ACCESS = re.compile(r"AddressSanitizer: (?P<said>[\w-]+).*(?:\n(?P<size>(?:READ|WRITE) of size \d+))?")
FRAME = re.compile(r"^ +#\d+ .* in \S+ (?P<file>.+?):(?P<line>\d+)(?::\d+)?$", re.MULTILINE)


class Library(NamedTuple):
    """A law's library that is not loaded yet.

    Attributes:
      file: the library; compiled, or a copy.
      path: the file that the user gave.
      symbol: the law's function.
      timeout: s, for a trial.
    """

    file: Path
    path: Path
    symbol: str
    timeout: float


class Tried(NamedTuple):
    """A law that passed its trial and is not loaded here yet.

    Attributes:
      library: its library.
      facts: what its file says of it, by the names in `smc_law.h`.
      gains, memory, modelled: what it is called with.
      warnings: the compiler's.
      unseen: sentences on what the trial could not see.
    """

    library: Library
    facts: dict[str, Any]
    gains: dict[str, float]
    memory: int
    modelled: bool
    warnings: list[str]
    unseen: list[str]


def tried(
    source: str | Path,
    symbol: str,
    flags: Sequence[str],
    timeout: float,
    gains: Mapping[str, float] | None,
    memory: int | None,
    modelled: bool | None,
    isolate: bool,
) -> Tried:
    """The law in a file, compiled where it is not, and tried as far as asked; arguments and errors of `law_from_c`."""
    if not isinstance(source, str | Path):
        raise ScenarioError(f"cannot take a law from {shown(source)}: give the path of a .c file, or of a .so")
    path = Path(source)
    timeout = number("timeout", timeout, above=0.0, most=LONGEST)
    if not isinstance(symbol, str) or not re.fullmatch(r"[A-Za-z_]\w*", symbol, re.ASCII):
        raise ScenarioError(f"symbol is {shown(symbol)}: give the name of a C function")
    if not isinstance(gains, Mapping | None):
        raise ScenarioError(f"gains is {shown(gains)}: give names with their defaults, such as {{'k1': 3.0}}")
    if isinstance(flags, str) or not isinstance(flags, Sequence) or not all(isinstance(flag, str) for flag in flags):
        raise ScenarioError(f"flags is {shown(flags)}: give several, such as ['-DUNIT_TEST']")
    if path.suffix not in (".c", *LIBRARIES):
        raise ScenarioError(f"cannot take a law from {shown(str(path))}: give a .c file, or a shared library, .so")
    if not path.is_file():
        raise ScenarioError(f"there is no file {path}: give the path of a .c file or of a .so")
    warned: list[str] = []
    if path.suffix == ".c":
        file, warned = build.library(path, symbol, flags, timeout)
    else:
        try:
            file = Path(shutil.copy(path, build.fresh(path.suffix)))  # so that one built again is loaded again
        except OSError as error:
            raise ScenarioError(f"{path} cannot be read ({error.strerror}): give one that can") from None
    library = Library(file, path, symbol, timeout)
    facts = attempt(library)
    if facts.get("smc_law_real", 8) != 8 and not facts["glue"]:
        raise ScenarioError(f"{path.name} is a library of single precision: give its .c file, or build it of doubles")
    defaults, size = said.gains(facts, path.name, gains), said.memory(facts, memory)
    modelled = bool(facts.get("smc_law_modelled")) if modelled is None else modelled
    unseen = call(library, list(defaults.values()), size, modelled, flags) if isolate else []
    return Tried(library, facts, defaults, size, modelled, warned, unseen)


def checked(
    source: str | Path,
    gains: Mapping[str, float] | None,
    memory: int | None,
    symbol: str,
    flags: Sequence[str],
    timeout: float,
) -> Iterator[str]:
    """Lines on a law that passes its trial, which this process does not load; errors as of `law_from_c`.

    They are what the compiler warns of, what the trial could not see, and what the law is called with.
    """
    path = Path(source)
    more = ("-Wall", "-Wextra", *flags) if path.suffix == ".c" else tuple(flags)
    law = tried(path, symbol, more, timeout, gains, memory, None, isolate=True)
    yield from law.warnings
    yield from law.unseen
    named = ", ".join(f"{name} = {value:g}" for name, value in law.gains.items()) or "none"
    yield f"{path.name}: {symbol} passes; gains {named}; memory {law.memory}"


def attempt(library: Library) -> dict:
    """Load, set up and unload a library in a process of its own; what its file says of its law.

    Raises:
      ScenarioError: it crashed, did not end in time, or did what a law must not, in one sentence.
    """
    return _tried(library, None)


def call(library: Library, gains: Sequence[float], memory: int, modelled: bool, flags: Sequence[str]) -> list[str]:
    """Call a law in a process of its own, then with sanitizers; sentences on what could not be looked at.

    Raises:
      ScenarioError: as of `attempt`.
    """
    calls, unseen = build.fresh(".calls"), []
    anchor, data = build.data(library.file, library.symbol)
    if not data:
        unseen.append(f"{library.path.name}: static data that it changes is not seen, as nm shows no names of it")
    order = {"gains": list(gains), "memory": memory, "modelled": modelled, "calls": str(calls)}
    _tried(library, order | {"anchor": anchor, "data": data})
    if why := _sanitized(library, calls, len(gains), memory, flags):
        unseen.append(f"{library.path.name} is tried without address and undefined-behaviour sanitizers: {why}")
    calls.unlink()
    return unseen


def _tried(library: Library, order: dict | None) -> dict:
    """What a trial tells at its end."""
    told, asked = build.fresh(".txt"), build.fresh(".json")
    asked.write_text(
        json.dumps({"library": str(library.file), "symbol": library.symbol, "told": str(told), "trial": order})
    )
    try:
        code = build.timed(
            [sys.executable, "-I", "-S", trial.__file__, str(asked)], library.timeout, heard=False
        ).returncode
    except build.Late:
        code = None
    lines = (told.read_text() if told.exists() else "").splitlines() or ["loading"]
    if lines[-1] != "unloading" or code != 0:
        raise ScenarioError(_sentence(library, lines[-1].replace(str(library.file), library.path.name), code))
    return json.loads(lines[-2])


def _sentence(library: Library, last: str, code: int | None) -> str:
    """What the trial's last line, and how its process ended, say of a law."""
    file, (kind, _, words) = library.path.name, last.partition(" ")
    if kind == "Found":
        return f"{file}: {words}"
    if library.symbol in words and ("undefined symbol" in words or "not found" in words):
        return build.undefined(file, library.symbol)
    if words:
        return f"{file} cannot be loaded ({' '.join(words.split())}): build it for this machine, with all it needs"
    if code is None:
        return f"{file}: {last} did not end within {library.timeout:g} s: mend what it waits for, or give timeout="
    if code < 0:
        names = {known.value: known.name for known in signal.Signals}  # without most of the real-time ones
        name = names.get(-code, f"signal {-code}")
        does = DEADLY.get(-code, "reads, writes or divides")
        return f"{file}: {last} died of {name} ({signal.strsignal(-code)}): mend where it {does}"
    return f"{file}: {last} ended the process with exit code {code}: let it return"


def _sanitized(library: Library, calls: Path, gains: int, memory: int, flags: Sequence[str]) -> str:
    """Repeat the calls of a trial with sanitizers; why not, or nothing."""
    if library.path.suffix != ".c":
        return "give its .c file"
    program = build.replayer(tuple(build.compiler()))
    if program is None:
        return f"{build.compiler()[0]} has none that work here"
    try:
        file, _ = build.library(library.path, library.symbol, (*flags, *build.SANITIZERS), library.timeout)
    except ScenarioError:
        return f"{build.compiler()[0]} has none with these flags"
    try:
        done = build.timed([str(n) for n in (program, file, calls, gains, memory)], library.timeout)
    except build.Late:
        raise ScenarioError(
            f"{library.path.name}: {library.symbol} did not end within {library.timeout:g} s with sanitizers: "
            "give timeout="
        ) from None
    if done.returncode:
        raise ScenarioError(_harm(library, done.stderr))
    return ""


def _harm(library: Library, said: str) -> str:
    """What the sanitizers say first."""
    if found := UNDEFINED.search(said):
        what, places = found["said"], [found]
    elif found := ACCESS.search(said):
        what = ", ".join(filter(None, found.group("said", "size")))
        places = [frame for frame in FRAME.finditer(said) if Path(frame["file"]).exists()]
    else:
        what, places = "it does not end as without sanitizers", []
    file = Path(places[0]["file"]).name if places else library.path.name
    where = f"line {places[0]['line']}" if places else library.symbol
    return f"{file} does harm in {where}: {what}; mend it"
