"""Compile C into a shared library with the system's compiler, and report its errors in one
sentence.
"""

import atexit
import functools
import itertools
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.files import no_room
from smc_mujoco.common.process import TimedOut, timed
from smc_mujoco.control import joint_law
from smc_mujoco.control.law import Measurement

FOLDER = Path(__file__).parent
HEADER = FOLDER / "smc_law.h"
MEASUREMENT_SIZE = len(Measurement._fields)  # numbers in a measurement
# How a measurement is stored, for glue.c.
LAYOUT_FLAGS = f"-DSMC_INPUTS={MEASUREMENT_SIZE}", f"-DSMC_VECTORS={joint_law.ARRAYS.index('M')}"
PROTOTYPE = (
    "int {}(const smc_measurement *y, const smc_real *gains, smc_real *memory, smc_real *out)"
)
# The same arithmetic as compiled Python: no fused multiply-add.
LIBRARY_FLAGS = ("-O2", "-fPIC", "-shared", "-ffp-contract=off")
# A library uses its own functions and data even if the C library has the same names, such as
# remove, y0, timezone.
SYMBOLIC_FLAGS = () if sys.platform in ("darwin", "win32") else ("-Wl,-Bsymbolic",)
WARNING_FLAGS = ("-Wall", "-Wextra")
# Compiler warnings that are errors here.
STRICT_FLAGS = (
    "-Werror=incompatible-pointer-types",
    "-Werror=implicit-function-declaration",
    "-Werror=int-conversion",
)
ERROR = re.compile(
    r"^(?P<file>[^:\n]+):(?P<line>\d+):(?:\d+:)? (?:fatal )?error: (?P<what>.*)$", re.MULTILINE
)
WARNING = re.compile(r"^[^:\n]+:\d+:(?:\d+:)? warning: .*$", re.MULTILINE)
_count = itertools.count()


@functools.cache
def folder() -> Path:
    """Return the folder for compiled files, which is removed when the process ends.

    No file is deleted earlier: a new file could get its inode number, and the loader would take it
    for the old one.
    """
    with no_room():
        path = tempfile.mkdtemp(prefix="smc_mujoco-")
        owner = os.getpid()

    @atexit.register
    def remove() -> None:
        if os.getpid() == owner:  # a forked child leaves its parent's files
            shutil.rmtree(path, ignore_errors=True)

    return Path(path)


def fresh(suffix: str) -> Path:
    """Return a new file name in `folder()`."""
    return folder() / f"{os.getpid()}-{next(_count)}{suffix}"


def compiler() -> list[str]:
    """Return the command of the C compiler: $CC, or cc."""
    command = os.environ.get("CC", "")
    try:
        return shlex.split(command) or ["cc"]
    except ValueError:  # an unclosed quotation mark: no such program
        return [command]


def compiled_library(
    rest: Sequence[str], target: Path, name: str, timeout: float
) -> subprocess.CompletedProcess[str]:
    """Compile a shared library within a time, s, from the files and flags in `rest`.

    `name` says in words what it is, for errors.
    """
    command = compiler()
    line = [*command, *LIBRARY_FLAGS, *rest, "-o", str(target), "-lm"]
    try:
        return timed(line, timeout)
    except TimedOut:
        raise ScenarioError(
            f"{name} takes {command[0]} more than {timeout:g} s to compile: make it shorter, or "
            "give timeout="
        ) from None
    except OSError:
        raise ScenarioError(
            f"{name} cannot be compiled, as there is no C compiler {command[0]!r}: install one, or "
            "set CC"
        ) from None


def library(
    source: Path, symbol: str, flags: Sequence[str], timeout: float
) -> tuple[Path, list[str]]:
    """Compile a C file with the glue that calls its function `symbol`.

    Return the library and the warnings.
    """
    path = str(source.resolve())
    target = fresh(".so")
    if set('"\\\n') & set(path):
        raise ScenarioError(
            f"cannot include {shown(str(source))} in C: give a path without quotation marks and "
            "backslashes"
        )
    macros = [f'-DSMC_SOURCE="{path}"', f"-DSMC_SYMBOL={symbol}", *LAYOUT_FLAGS, "-I", str(FOLDER)]
    rest = [*SYMBOLIC_FLAGS, *STRICT_FLAGS, *macros, str(FOLDER / "glue.c"), *flags]
    done = compiled_library(rest, target, source.name, timeout)
    if done.returncode or not target.exists():
        raise ScenarioError(_sentence(source, symbol, done.stderr))
    return target, WARNING.findall(done.stderr)


def undefined(source: Path, symbol: str) -> str:
    """Return the error message for a file without the law's function."""
    return f"{source.name} has no function {symbol}: define {PROTOTYPE.format(symbol)}"


def _sentence(source: Path, symbol: str, output: str) -> str:
    """Return the first error in a compiler's output, with a cure."""
    must = f"the law must be {PROTOTYPE.format(symbol)}"
    if re.search(rf"'{symbol}' undeclared|ndefined \w+.*\b_?{symbol}\b", output):
        return undefined(source, symbol)
    error = ERROR.search(output)
    if error is None:  # from the linker or the command itself
        nonempty = filter(str.strip, output.splitlines())
        lines = list(nonempty) or ["it says nothing"]
        telling = [line for line in lines if re.search(r"ndefined|cannot find|error:", line)]
        said = (telling or lines)[0].strip()
        command = " ".join(compiler())
        return f"{source.name} does not compile, {command} says: {said}; fix it, or its flags"
    file = Path(error["file"]).name
    if f"'{symbol}'" in error["what"] or file == "glue.c":
        return f"{source.name} has another {symbol} than smc_mujoco calls: {must}"
    where = f"{file}, line {error['line']}: {error['what']}"
    return f"{source.name} does not compile: {where}; fix it; {must}"
