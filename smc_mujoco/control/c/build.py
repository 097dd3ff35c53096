"""Compile C with the system's compiler into a shared library, and say its errors in one sentence."""

import atexit
import functools
import itertools
import os
import re
import shlex
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.process import Late, timed
from smc_mujoco.control.law import Measurement

HERE = Path(__file__).parent
HEADER = HERE / "smc_law.h"
INPUTS = len(Measurement._fields)  # numbers in a measurement
PROTOTYPE = "int smc_law(const smc_measurement *y, const smc_real *gains, smc_real *memory, smc_real *out)"
# The same arithmetic as compiled Python: no products and sums fused into one rounding.
FLAGS = ("-O2", "-fPIC", "-shared", "-ffp-contract=off")
# A library calls its own functions and uses its own data, also where C has the name: remove, y0, timezone.
OWN_NAMES = ("-Wl,-Bsymbolic",) if sys.platform not in ("darwin", "win32") else ()
# For a trial: a step beyond an array, or what C leaves undefined, ends the process with a report.
SANITIZERS = ("-O0", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
WARNINGS = ("-Wall", "-Wextra")
# Warnings of compilers that are errors here.
STRICT = tuple(
    f"-Werror={name}" for name in ("incompatible-pointer-types", "implicit-function-declaration", "int-conversion")
)
ERROR = re.compile(r"^(?P<file>[^:\n]+):(?:(?P<line>\d+):)?(?:\d+:)? (?:fatal )?error: (?P<what>.*)$", re.MULTILINE)
WARNING = re.compile(r"^[^:\n]+:\d+:(?:\d+:)? warning: .*$", re.MULTILINE)
# Lines of `nm -f sysv`. A number that the compiler adds to a variable's name is left out.
FUNCTION = re.compile(r"^(\S+) *\|([0-9a-f]+)\| +T +\| +FUNC\|", re.MULTILINE)
DATA = re.compile(r"^(\S+?)(?:\.\d+)? *\|([0-9a-f]+)\| +[bBdDuV] +\| +OBJECT\|([0-9a-f]+)\|", re.MULTILINE)

_count = itertools.count()


@functools.cache
def folder() -> Path:
    """Return a folder for what is compiled. It stays until the process ends.

    A file that is deleted earlier gives its number to a new one, which the loader then takes for the old one.
    """
    path = tempfile.mkdtemp(prefix="smc_mujoco-")
    atexit.register(_remove, path, os.getpid())
    return Path(path)


def _remove(path: str, owner: int) -> None:
    if os.getpid() == owner:  # a forked child leaves its parent's files
        shutil.rmtree(path, ignore_errors=True)


def fresh(suffix: str) -> Path:
    """Return a file name that nothing had before."""
    return folder() / f"{os.getpid()}-{next(_count)}{suffix}"


def compiler() -> list[str]:
    """Return the command of the C compiler: $CC, or cc."""
    command = os.environ.get("CC", "")
    try:
        return shlex.split(command) or ["cc"]
    except ValueError:  # a quotation without an end: there is no such program
        return [command]


def library(source: Path, symbol: str, flags: Sequence[str], timeout: float) -> tuple[Path, list[str]]:
    """Compile a C file, with the glue that calls `symbol` in it, and return the library and the compiler's warnings.

    Raises:
      ScenarioError: there is no compiler, it needs too long, or it finds an error.
    """
    path, target, command = str(source.resolve()), fresh(".so"), compiler()
    if set('"\\\n') & set(path):
        raise ScenarioError(
            f"cannot include {shown(str(source))} in C: give a path without quotation marks and backslashes"
        )
    macros = [f'-DSMC_SOURCE="{path}"', f"-DSMC_SYMBOL={symbol}", f"-DSMC_INPUTS={INPUTS}", "-I", str(HERE)]
    files = [str(HERE / "glue.c"), "-o", str(target)]
    try:
        done = timed([*command, *FLAGS, *OWN_NAMES, *STRICT, *macros, *files, *flags, "-lm"], timeout)
    except Late:
        raise ScenarioError(
            f"{source.name} takes {command[0]} more than {timeout:g} s to compile: make it shorter, or give timeout="
        ) from None
    except OSError:
        raise ScenarioError(
            f"{source.name} cannot be compiled, as there is no C compiler {command[0]!r}: install one, or set CC"
        ) from None
    if done.returncode or not target.exists():
        raise ScenarioError(_sentence(source, symbol, " ".join(command), done.stderr))
    return target, WARNING.findall(done.stderr)


@functools.cache
def replayer(command: tuple[str, ...]) -> Path | None:
    """Return the program of `replay.c` with a compiler's sanitizers, or None where it has none that work."""
    target = fresh(".exe")
    line = [*command, *SANITIZERS, f"-DSMC_INPUTS={INPUTS}", str(HERE / "replay.c"), "-o", str(target), "-ldl"]
    try:
        if timed(line, 60.0).returncode or timed([str(target)], 60.0).returncode:
            return None
    except (Late, OSError):
        return None
    return target


def static_data(library: Path, symbol: str) -> tuple[int, list[tuple[str, int, int]]]:
    """Return a law's address in its library, and name, address and size of the library's static data.

    nm tells them. The data is what the law may change, without constants.
    """
    try:
        table = timed(["nm", "-f", "sysv", str(library)], 60.0).stdout
    except (Late, OSError):
        return 0, []
    functions = {name: int(address, 16) for name, address in FUNCTION.findall(table)}
    data = [(name, int(address, 16), int(size, 16)) for name, address, size in DATA.findall(table)]
    return functions.get("smc_mujoco_entry", functions.get(symbol, 0)), data


def undefined(source: str, symbol: str) -> str:
    """Return the sentence for a file without the law's function."""
    return f"{source} has no function {symbol}: define {_prototype(symbol)}"


def _prototype(symbol: str) -> str:
    return PROTOTYPE.replace("smc_law(", f"{symbol}(")


def _sentence(source: Path, symbol: str, command: str, said: str) -> str:
    """Return the first error of a compiler, with a cure."""
    error, name = ERROR.search(said), source.name
    what, file = (error["what"], Path(error["file"]).name) if error else ("", "")
    if (f"'{symbol}'" in what and "undeclared" in what) or re.search(rf"ndefined \w+.*\b_?{symbol}\b", said):
        return undefined(name, symbol)
    if error is None or error["line"] is None:  # of the linker, or of the command
        lines = [line for line in said.splitlines() if line.strip()] or ["it says nothing"]
        telling = [line for line in lines if re.search(r"ndefined|cannot find|error:", line)] or lines
        return f"{name} does not compile, {command} says: {telling[0].strip()}; mend it, or give other flags="
    if f"'{symbol}'" in what or file == "glue.c":
        return f"{name} has another {symbol} than smc_mujoco calls: it must be {_prototype(symbol)}"
    where = f"line {error['line']}" if file == name else f"{error['file']}, line {error['line']}"
    return f"{name} does not compile: {where}, {what}; mend it"
