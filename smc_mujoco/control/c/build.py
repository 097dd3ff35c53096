"""C compiled with the system's compiler into a library of this process; what the compiler says, in one sentence."""

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
from smc_mujoco.control.c.trial import BEYOND

HERE = Path(__file__).parent
HEADER = HERE / "smc_law.h"
INPUTS = 21  # numbers in a measurement, as in law.Measurement
PROTOTYPE = "int smc_law(const smc_measurement *y, const smc_real *gains, smc_real *memory, smc_real *out)"
# The same arithmetic as compiled Python: no products and sums fused into one rounding.
FLAGS = ("-O2", "-fPIC", "-shared", "-ffp-contract=off")
# Calls of its own functions, and its own data, whatever else in the process has the name: C's remove, y0, timezone.
OWN = ("-Wl,-Bsymbolic",) if sys.platform not in ("darwin", "win32") else ()
# For a trial: what writes or reads beyond arrays, or does what C leaves undefined, ends the process with a report.
SANITIZERS = ("-O0", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
WRONG = ("incompatible-pointer-types", "implicit-function-declaration", "int-conversion")  # are errors, not warnings
ERROR = re.compile(r"^(?P<file>[^:\n]+):(?:(?P<line>\d+):)?(?:\d+:)? (?:fatal )?error: (?P<said>.*)$", re.MULTILINE)
# Lines of `nm -f sysv`; what a compiler adds to names of variables in functions is left out.
FUNCTION = re.compile(r"^(\S+) *\|([0-9a-f]+)\| +T +\| +FUNC\|", re.MULTILINE)
DATA = re.compile(r"^(\S+?)(?:\.\d+)? *\|([0-9a-f]+)\| +[bBdDuV] +\| +OBJECT\|([0-9a-f]+)\|", re.MULTILINE)
WARNING = re.compile(r"^[^:\n]+:\d+:(?:\d+:)? warning: .*$", re.MULTILINE)


@functools.cache
def folder() -> Path:
    """A folder for what is compiled, until the process ends.

    Not less: the loader takes a library for one that it has where a deleted file's number is used again.
    """
    made = tempfile.mkdtemp(prefix="smc_mujoco-")
    atexit.register(_remove, made, os.getpid())
    return Path(made)


def _remove(made: str, owner: int) -> None:
    if os.getpid() == owner:  # a forked child leaves its parent's files
        shutil.rmtree(made, ignore_errors=True)


_count = itertools.count()


def fresh(suffix: str) -> Path:
    """A file name that nothing had before."""
    return folder() / f"{os.getpid()}-{next(_count)}{suffix}"


def compiler() -> list[str]:
    """The command of the C compiler: $CC, or cc."""
    said = os.environ.get("CC", "")
    try:
        return shlex.split(said) or ["cc"]
    except ValueError:  # a quotation without an end: there is no such program
        return [said]


def library(source: Path, symbol: str, flags: Sequence[str], timeout: float) -> tuple[Path, list[str]]:
    """A C file, and the glue that calls `symbol` in it, as a shared library; and the compiler's warnings.

    Raises:
      ScenarioError: there is no compiler, it needs too long, or it finds an error.
    """
    if set('"\\\n') & set(str(source.resolve())):
        raise ScenarioError(
            f"cannot include {shown(str(source))} in C: give a path without quotation marks and backslashes"
        )
    target, command = fresh(".so"), compiler()
    strict = [f"-Werror={name}" for name in WRONG]
    given = [f'-DSMC_SOURCE="{source.resolve()}"', f"-DSMC_SYMBOL={symbol}", f"-DSMC_INPUTS={INPUTS}"]
    given += [f"-DSMC_BEYOND={BEYOND}", "-I", str(HERE)]
    line = [*command, *FLAGS, *OWN, *strict, *given, str(HERE / "glue.c"), "-o", str(target), *flags, "-lm"]
    try:
        done = timed(line, timeout)
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
    """The program of `replay.c` with a compiler's sanitizers, or None where it has none that work."""
    target = fresh(".exe")
    line = [*command, *SANITIZERS, f"-DSMC_INPUTS={INPUTS}", str(HERE / "replay.c"), "-o", str(target), "-ldl"]
    try:
        if timed(line, 60.0).returncode or timed([str(target)], 60.0).returncode:
            return None
    except (Late, OSError):
        return None
    return target


def data(library: Path, symbol: str) -> tuple[int, list[tuple[str, int, int]]]:
    """Address of a law in its library; and name, address and size of what the library may change, as nm tells them."""
    try:
        table = timed(["nm", "-f", "sysv", str(library)], 60.0).stdout
    except (Late, OSError):
        return 0, []
    functions = {name: int(at, 16) for name, at in FUNCTION.findall(table)}
    found = [(name, int(at, 16), int(size, 16)) for name, at, size in DATA.findall(table)]
    return functions.get("smc_mujoco_entry", functions.get(symbol, 0)), found


def undefined(source: str, symbol: str) -> str:
    """The sentence for a law without its function."""
    return f"{source} has no function {symbol}: define {PROTOTYPE.replace('smc_law(', symbol + '(')}"


def _sentence(source: Path, symbol: str, command: str, said: str) -> str:
    """What the compiler did not like first, and the cure."""
    error, prototype = ERROR.search(said), PROTOTYPE.replace("smc_law(", symbol + "(")
    what = error["said"] if error else ""
    if (f"'{symbol}'" in what and "undeclared" in what) or re.search(rf"ndefined \w+.*\b_?{symbol}\b", said):
        return undefined(source.name, symbol)
    if error is None or error["line"] is None:  # of the linker, or of the command
        words = [line for line in said.splitlines() if line.strip()] or ["it says nothing"]
        telling = [line for line in words if re.search(r"ndefined|cannot find|error:", line)] or words
        return f"{source.name} does not compile, {command} says: {telling[0].strip()}; mend it, or give other flags="
    if f"'{symbol}'" in what or Path(error["file"]).name == "glue.c":
        return f"{source.name} has another {symbol} than smc_mujoco calls: it must be {prototype}"
    where = (
        f"line {error['line']}" if Path(error["file"]).name == source.name else f"{error['file']}, line {error['line']}"
    )
    return f"{source.name} does not compile: {where}, {what}; mend it"
