"""Laws written in C: `law_from_c` compiles and loads them, and they run in the callback like the library's own.

`smc_law.h`, beside this file, describes the C function. A file is compiled together with a few lines that call it as
the callback calls laws, so that a law of another type is a compiler's error. A shared library is called as it is. What
can hang or crash is tried in a process of its own first: loading, smc_setup, and where asked the law itself.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import ctypes
import functools
import hashlib
import math
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numba import carray

from smc_mujoco.common import errors
from smc_mujoco.common.errors import ScenarioError, number, shown, whole
from smc_mujoco.common.jit import AtAddress, Function, call_int, pointer
from smc_mujoco.control.c import build, sandbox
from smc_mujoco.control.component import Template, template
from smc_mujoco.control.law import Measurement
from smc_mujoco.control.units import Gain

LIBRARIES = (".so", ".dylib")
MAX_TIMEOUT = 86_400.0  # s
DEFAULT_MEMORY = 8


class CLaw(AtAddress):
    """A law in C: called by its address in the callback, and through ctypes in the reference loop.

    Two laws are equal where their machine code is, and so all that went into it: file, headers, flags, compiler.
    """

    def __init__(self, path: Path, symbol: str, file: Path, doc: str | None):
        self.path, self.symbol = path, symbol
        self.code = file.read_bytes()
        self.digest = hashlib.sha256(symbol.encode() + b"\0" + self.code).hexdigest()
        self._function, self.library = sandbox.entry(str(file), symbol)
        self.address: int = ctypes.cast(self._function, ctypes.c_void_p).value or 0
        if not hasattr(self.library, "smc_mujoco_entry"):
            self._trampoline = _trampoline(self.address)
            self.address = self._trampoline.address
        self.sizes = 0, 1  # how many gains and numbers of memory
        self.__name__ = re.sub(r"\W", "_", path.stem)
        self.__module__, self.__doc__ = path.name, doc

    def __call__(self, y: Sequence[float], gains: Sequence[float], memory: np.ndarray) -> tuple[float, float]:
        """Return u and s. ArithmeticError where the C function returns anything but 0."""
        out = sandbox.doubles([math.nan] * 2)
        code = self._function(sandbox.doubles(y), sandbox.doubles(gains), memory.ctypes.data_as(sandbox.DOUBLES), out)
        if code != 0:
            what, _ = sandbox.FAULTS.get(code, (f"returned {code}", ""))
            raise ArithmeticError(f"{self.symbol} {what.format(self.sizes[1])}")
        return out[0], out[1]

    def set_up(self, gains: int, memory: int, name: str | None) -> None:
        """Call smc_setup, and set the name and how many gains and numbers of memory there are."""
        if code := sandbox.set_up(self.library):
            raise ScenarioError(f"{self.path.name}: smc_setup returned {code}: mend it")
        self.sizes, self.__name__ = (gains, memory), name or self.__name__
        sandbox.set_sizes(self.library, gains, memory)

    def __repr__(self) -> str:
        return f"<C function {self.symbol} of {self.path.name}>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, CLaw) and self._identity() == other._identity()

    def __hash__(self) -> int:
        return hash(self._identity())

    def _identity(self) -> tuple:
        """Return what distinguishes it. A copy, pickled or loaded again, is the same law."""
        return self.digest, self.sizes, self.__name__

    def __reduce__(self):
        """Pickle the machine code: another process runs this law, whatever its file holds by then."""
        return _unpickled, (self.path.name, self.symbol, self.code, self.sizes, self.__name__, self.__doc__)


@functools.cache
def _unpickled(file: str, symbol: str, code: bytes, sizes: tuple[int, int], name: str, doc: str | None) -> CLaw:
    """Return the law of another process, loaded once in this one."""
    copy = build.fresh(".so")
    copy.write_bytes(code)
    try:
        law = CLaw(Path(file), symbol, copy, doc)
    except OSError as error:
        why = str(error).replace(str(copy), file)
        raise ScenarioError(
            f"{file} cannot be loaded ({why}): run it on machines like the one it was built on"
        ) from None
    law.set_up(*sizes, name)
    return law


def _trampoline(address: int) -> Function:
    """Return a function of the callback's type that calls a C function which returns an int."""

    def native(y: Any, g: Any, m: Any, out: Any):
        output = carray(pointer(out), (2,))
        output[0], output[1] = math.nan, math.nan  # a number that the law leaves out ends its run
        return call_int(address, y, g, m, out)

    return Function(native)


def law_from_c(
    source: str | Path,
    *,
    gains: Mapping[str, float | Gain] | None = None,
    memory: int | None = None,
    name: str | None = None,
    symbol: str = "smc_law",
    flags: Sequence[str] = (),
    isolate: bool = False,
    timeout: float = 10.0,
    positive: Iterable[str] = (),
    nonnegative: Iterable[str] = (),
    degree: int | None = None,
    plants: Iterable[str] = (),
    modelled: bool | None = None,
) -> Template:
    """A law of your own in C, running in MuJoCo's control callback at the speed of the built-in ones.

    Args:
      source: a .c file, compiled by $CC or cc in a temporary folder; or a .so with the function in double precision.
        `smc_law.h`, which the file may include, describes the function.
      gains: name -> default or Gain, in the order of the function's gains[]. A file with smc_law_gains has names and
        defaults itself; these then change the defaults.
      memory: numbers of state per channel; where left out what the file says in smc_law_memory, or 8.
      name: of the law; the file's where left out.
      symbol: the function's name.
      flags: more for the compiler: "-Ifirmware/include", "-DUNIT_TEST", "filter.c".
      isolate: whether to try the law first in a process of its own, on short runs of a double integrator. One sentence
        says where it crashes, hangs, returns NaN, reads gains that have no name, writes beyond its memory or keeps
        state elsewhere.
      timeout: s, for each of the compiler, the set-up and the trial.
      positive, nonnegative, degree, plants, modelled: as of `smc.law_function`; where degree and modelled are left
        out, what the file says in smc_law_degree and smc_law_modelled.

    Returns:
      A Template, called with gains for the Law of a Scenario: `law_from_c("my_law.c")(lam=5.0)`. It is the code of now:
      after an edit of the file call this again. Pickled, it takes its machine code along.

    Raises:
      ScenarioError: no such file or function, what does not compile or has another type, a set-up that fails, crashes
        or does not end, and with isolate a law that does.

    C is not checked while it runs. A law that reads or writes where it should not takes the whole process down, or
    changes a neighbour's numbers; one that does not return hangs it. Try what is new with isolate=True, or with
    `smc-mujoco check-c my_law.c`.
    """
    if name is not None:
        errors.name("name", name)
    library = _library(source, symbol, flags, timeout)
    about = _about(library, gains, memory, degree, modelled)
    if isolate:
        sandbox.call(library, Measurement._fields, about.values, about.memory, about.modelled)
    law = CLaw(library.path, symbol, library.file, _first_comment(library.path))
    law.set_up(len(about.gains), about.memory, name)
    gains, memory, degree, modelled = about
    return template("law", gains, memory, positive, nonnegative, degree, None, plants, requires_model=modelled)(law)


def check(
    source: Path,
    gains: Mapping[str, float] | None,
    memory: int | None,
    symbol: str,
    flags: Sequence[str],
    timeout: float,
) -> Iterator[str]:
    """Yield lines on a law that passes its trial, without loading it: warnings, what was not seen, gains and memory.

    Arguments and errors are those of `law_from_c`.
    """
    library = _library(source, symbol, (*build.WARNINGS, *flags) if source.suffix == ".c" else flags, timeout)
    about = _about(library, gains, memory, None, None)
    yield from library.warnings
    yield from sandbox.call(library, Measurement._fields, about.values, about.memory, about.modelled)
    gains_text = (
        ", ".join(f"{name} = {value:g}" for name, value in zip(about.gains, about.values, strict=True)) or "none"
    )
    yield f"{source.name}: {symbol} passes; gains {gains_text}; memory {about.memory}"


def _library(source: str | Path, symbol: str, flags: Sequence[str], timeout: float) -> sandbox.Library:
    """Return the library of a law, compiled where it is a .c file. Arguments and errors are those of `law_from_c`."""
    if not isinstance(source, str | Path):
        raise ScenarioError(f"cannot take a law from {shown(source)}: give the path of a .c file, or of a .so")
    path = Path(source)
    timeout = number("timeout", timeout, above=0.0, most=MAX_TIMEOUT)
    if not isinstance(symbol, str) or not re.fullmatch(r"[A-Za-z_]\w*", symbol, re.ASCII):
        raise ScenarioError(f"symbol is {shown(symbol)}: give the name of a C function")
    if isinstance(flags, str) or not isinstance(flags, Sequence) or not all(isinstance(flag, str) for flag in flags):
        raise ScenarioError(f"flags is {shown(flags)}: give several, such as ['-DUNIT_TEST']")
    if path.suffix not in (".c", *LIBRARIES):
        raise ScenarioError(f"cannot take a law from {shown(str(path))}: give a .c file, or a shared library, .so")
    if not path.is_file():
        raise ScenarioError(f"there is no file {path}: give the path of a .c file or of a .so")
    if path.suffix == ".c":
        file, warnings = build.library(path, symbol, flags, timeout)
        return sandbox.Library(file, path, symbol, flags, timeout, warnings)
    try:
        copy = shutil.copy(path, build.fresh(path.suffix))  # so that a library that was built again is loaded again
    except OSError as error:
        raise ScenarioError(f"{path} cannot be read ({error.strerror}): give one that can") from None
    return sandbox.Library(Path(copy), path, symbol, flags, timeout)


class About(NamedTuple):
    """What a law is called with, and what it is."""

    gains: dict[str, float | Gain]
    memory: int
    degree: int
    modelled: bool

    @property
    def values(self) -> list[float]:
        """Defaults of the gains."""
        return [gain.default if isinstance(gain, Gain) else gain for gain in self.gains.values()]


def _about(
    library: sandbox.Library,
    gains: Mapping[str, float | Gain] | None,
    memory: int | None,
    degree: int | None,
    modelled: bool | None,
) -> About:
    """Try to load a library, and return what its file says of its law, changed by what is given."""
    if not isinstance(gains, Mapping | None):
        raise ScenarioError(f"gains is {shown(gains)}: give names with their defaults, such as {{'k1': 3.0}}")
    facts, file, gains = sandbox.load(library), library.path.name, dict(gains or {})
    if facts.get("smc_law_real", 8) != 8 and not facts["glue"]:
        raise ScenarioError(f"{file} is a library of single precision: give its .c file, or build it of doubles")
    if (text := facts.get("smc_law_gains")) is not None:
        own = parsed_gains(text, f"{file}'s smc_law_gains")
        for name in gains:
            errors.find(f"gain of {file}", name, own)
        gains = own | gains
    return About(
        gains,
        whole("memory", max(facts.get("smc_law_memory", DEFAULT_MEMORY), 1) if memory is None else memory, 1, 10_000),
        whole("degree", (facts.get("smc_law_degree") or 1) if degree is None else degree, 1, 3),
        bool(facts.get("smc_law_modelled")) if modelled is None else modelled,
    )


def parsed_gains(text: str, what: str) -> dict[str, float]:
    """Return gains that are given as text, such as "lam=6,k1=3"; `what` names the text in errors."""
    found: dict[str, float] = {}
    for part in filter(None, (p.strip() for p in text.split(","))):
        name, equals, value = (word.strip() for word in part.partition("="))
        if name in found:
            raise ScenarioError(f"{what} is {shown(text)}: give {name} once")
        try:
            found[name] = float(value)
        except ValueError:
            found[name] = math.nan
        if not (equals and name.isidentifier()) or math.isnan(found[name]):
            raise ScenarioError(f"{what} is {shown(text)}: give names and numbers, such as lam=6,k1=3")
    return found


def _first_comment(path: Path) -> str | None:
    """Return the comment that a C file begins with."""
    text = path.read_text(encoding="utf-8", errors="replace") if path.suffix == ".c" else ""
    found = re.match(r"\s*/\*+(.*?)\*/", text, re.DOTALL)
    return re.sub(r"^ ?\* ?", "", found[1], flags=re.MULTILINE).strip() if found else None
