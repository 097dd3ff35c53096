"""Laws written in C: `law_from_c` compiles and loads them, and they run in the callback like the library's own.

The C function is told in `smc_law.h`, beside this file. A file is compiled together with a few lines that call it as
the callback calls laws, so that one of another type is a compiler's error; a shared library is called as it is. What
can hang or crash - loading, smc_setup, and where asked for the law itself - is tried in a process of its own first.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import ctypes
import math
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numba import carray

from smc_mujoco.c import build, child, trial
from smc_mujoco.compiled import AtAddress, Function, call_int, pointer
from smc_mujoco.component import Template, template
from smc_mujoco.errors import ScenarioError, number, shown, unknown, whole

LIBRARIES = (".so", ".dylib")
DEFAULT_MEMORY = 8


class CLaw(AtAddress):
    """A law in C: called by address in the callback, and here, through ctypes, in the plain loop."""

    def __init__(self, origin: tuple[str, str, tuple[str, ...], float], library: Path):
        self.origin = origin
        self.path, self.symbol = Path(origin[0]), origin[1]
        self.warnings: list[str] = []
        self.file = library
        self._function, self.library = trial.entry(str(library), self.symbol)
        if hasattr(self.library, "smc_mujoco_entry"):
            self.address: int = ctypes.cast(self._function, ctypes.c_void_p).value or 0
        else:
            self._trampoline = _trampoline(ctypes.cast(self._function, ctypes.c_void_p).value or 0)
            self.address = self._trampoline.address
        self.sizes = 0, 1  # how many gains and numbers of memory
        self.__name__ = re.sub(r"\W", "_", self.path.stem)
        self.__module__, self.__doc__ = self.path.name, _comment(self.path)

    def __call__(self, y: Sequence[float], gains: Sequence[float], memory: np.ndarray) -> tuple[float, float]:
        """u and s; ArithmeticError where the C function returns anything but 0."""
        out, doubles = trial.doubles([math.nan] * 2), ctypes.POINTER(ctypes.c_double)
        code = self._function(trial.doubles(y), trial.doubles(gains), memory.ctypes.data_as(doubles), out)
        if code in (trial.BEYOND, trial.BEYOND + 1):
            own = f"the {self.sizes[1]} numbers of its memory" if code == trial.BEYOND else "the two numbers of out"
            raise ArithmeticError(f"{self.symbol} writes beyond {own}")
        if code != 0:
            raise ArithmeticError(f"{self.symbol} returned {code}")
        return out[0], out[1]

    def sized(self, gains: int, memory: int) -> None:
        """Say how many gains and numbers of memory there are."""
        self.sizes = gains, memory
        trial.sized(self.library, gains, memory)

    def __reduce__(self):
        """By what it was made of: another process compiles it again."""
        return _again, (self.origin, self.sizes, self.__name__)


def law_from_c(
    source: str | Path,
    *,
    gains: Mapping[str, float] | None = None,
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
        `smc_law.h`, which the file may include, tells the function.
      gains: name -> default, in the order of the function's gains[]. A file that says smc_law_gains has names and
        defaults itself; these then change the defaults.
      memory: numbers of state per channel; where left out what the file says in smc_law_memory, or 8.
      name: of the law; the file's where left out.
      symbol: the function's name.
      flags: more for the compiler: "-Ifirmware/include", "-DUNIT_TEST", "filter.c".
      isolate: whether to try the law first in a process of its own, on short runs of a double integrator: it tells by
        a sentence what crashes, hangs, returns NaN, writes beyond its memory or keeps state elsewhere.
      timeout: s, for each of the compiler, the set-up and the trial.
      positive, nonnegative, degree, plants, modelled: as of `smc.law_function`; where degree and modelled are left
        out, what the file says in smc_law_degree and smc_law_modelled.

    Returns:
      A Template, called with gains for the Law of a Scenario: `law_from_c("my_law.c")(lam=5.0)`.

    Raises:
      ScenarioError: no such file or function, what does not compile or has another type, a set-up that fails, crashes
        or does not end, and with isolate a law that does.

    C is not checked while it runs. A law that reads or writes where it should not takes the whole process down, or
    changes a neighbour's numbers; one that does not return hangs it. Try what is new with isolate=True, or with
    `smc-mujoco check-c my_law.c`.
    """
    if not isinstance(source, str | Path):
        raise ScenarioError(f"cannot take a law from {shown(source)}: give the path of a .c file, or of a .so")
    path = Path(source)
    timeout = number("timeout", timeout, above=0.0)
    if not isinstance(symbol, str) or not re.fullmatch(r"[A-Za-z_]\w*", symbol, re.ASCII):
        raise ScenarioError(f"symbol is {shown(symbol)}: give the name of a C function")
    if not isinstance(gains, Mapping | None):
        raise ScenarioError(f"gains is {shown(gains)}: give names with their defaults, such as {{'k1': 3.0}}")
    if isinstance(flags, str) or not isinstance(flags, Sequence) or not all(isinstance(flag, str) for flag in flags):
        raise ScenarioError(f"flags is {shown(flags)}: give several, such as ['-DUNIT_TEST']")
    if name is not None and not (isinstance(name, str) and name.isprintable() and name.strip()):
        raise ScenarioError(f"name is {shown(name)}: give a word, such as 'my_law'")
    law = _loaded(str(path), symbol, tuple(flags), timeout)
    defaults, size = _gains(law, gains), _memory(law, memory)
    degree = whole("degree", (_number(law, "smc_law_degree") or 1) if degree is None else degree, 1, 3)
    modelled = bool(_number(law, "smc_law_modelled")) if modelled is None else modelled
    law.sized(len(defaults), size)
    if isolate:
        child.attempt(law.file, path, symbol, timeout, values=list(defaults.values()), memory=size, modelled=modelled)
    law.__name__ = name or law.__name__
    return template("law", defaults, size, positive, nonnegative, degree, None, plants, modelled)(law)


def checked(
    source: str | Path,
    gains: Mapping[str, float] | None,
    memory: int | None,
    symbol: str,
    flags: Sequence[str],
    timeout: float,
) -> Iterator[str]:
    """Lines on a law that passes its trial: what the compiler warns of, and what it is called with; errors as there."""
    path = Path(source)
    more = ("-Wall", "-Wextra", *flags) if path.suffix == ".c" else ()
    made = law_from_c(path, gains=gains, memory=memory, symbol=symbol, flags=more, isolate=True, timeout=timeout)
    assert isinstance(made.function, CLaw)
    yield from made.function.warnings
    named = ", ".join(f"{name} = {value:g}" for name, value in made.defaults.items()) or "none"
    yield f"{path.name}: {symbol} passes; gains {named}; memory {made.memory}"


def _again(origin: tuple[str, str, tuple[str, ...], float], sizes: tuple[int, int], name: str) -> CLaw:
    law = _loaded(*origin)
    law.sized(*sizes)
    law.__name__ = name
    return law


def _loaded(source: str, symbol: str, flags: tuple[str, ...], timeout: float) -> CLaw:
    """The law in a file, compiled where it is not, and set up."""
    path = Path(source)
    if path.suffix not in (".c", *LIBRARIES):
        raise ScenarioError(f"cannot take a law from {path.name!r}: give a .c file, or a shared library, .so")
    if not path.is_file():
        raise ScenarioError(f"there is no file {source}: give the path of a .c file or of a .so")
    said: list[str] = []
    if path.suffix == ".c":
        file, said = build.library(path, symbol, flags, timeout)
    else:
        try:
            file = Path(shutil.copy(path, build.fresh(path.suffix)))  # so that one built again is loaded again
        except OSError as error:
            raise ScenarioError(f"{source} cannot be read ({error.strerror}): give one that can") from None
    child.attempt(file, path, symbol, timeout)
    law = CLaw((source, symbol, flags, timeout), file)
    law.warnings = said
    if _number(law, "smc_law_real") not in (None, 8) and not hasattr(law.library, "smc_mujoco_entry"):
        raise ScenarioError(f"{path.name} is a library of single precision: give its .c file, or build it of doubles")
    if code := trial.set_up(law.library):
        raise ScenarioError(f"{path.name}: smc_setup returned {code}: mend it")
    return law


def _gains(law: CLaw, given: Mapping[str, float] | None) -> dict[str, float]:
    """Names and defaults: the file's, changed by what is given; or what is given."""
    text = _text(law, "smc_law_gains")
    if text is None:
        return dict(given or {})
    said = parsed(text, f"{law.path.name}'s smc_law_gains")
    for key in given or {}:
        if key not in said:
            raise unknown(f"gain of {law.path.name}", key, said)
    return said | dict(given or {})


def parsed(text: str, what: str) -> dict[str, float]:
    """Gains as text, "lam=6,k1=3", as a dict."""
    found: dict[str, float] = {}
    for part in filter(None, (p.strip() for p in text.split(","))):
        key, equals, value = (word.strip() for word in part.partition("="))
        if key in found:
            raise ScenarioError(f"{what} is {shown(text)}: give {key} once")
        try:
            found[key] = float(value)
        except ValueError:
            found[key] = math.nan
        if not (equals and key.isidentifier() and math.isfinite(found[key])):
            raise ScenarioError(f"{what} is {shown(text)}: give names and numbers, such as lam=6,k1=3")
    return found


def _memory(law: CLaw, given: int | None) -> int:
    said = _number(law, "smc_law_memory")
    return whole("memory", given if given is not None else DEFAULT_MEMORY if said is None else max(said, 1), 1, 10_000)


def _number(law: CLaw, name: str) -> int | None:
    return ctypes.c_int.in_dll(law.library, name).value if hasattr(law.library, name) else None


def _text(law: CLaw, name: str) -> str | None:
    if not hasattr(law.library, name):
        return None
    at = ctypes.addressof(ctypes.c_char.in_dll(law.library, name))
    return ctypes.string_at(at).decode("ascii", errors="replace")


def _comment(path: Path) -> str | None:
    """The comment that a C file begins with."""
    text = path.read_text(errors="replace") if path.suffix == ".c" else ""
    found = re.match(r"\s*/\*+(.*?)\*/", text, re.DOTALL)
    return re.sub(r"^ ?\* ?", "", found[1], flags=re.MULTILINE).strip() if found else None


def _trampoline(address: int) -> Function:
    """A C function that returns an int, as one that returns what the callback takes."""

    def native(y: Any, g: Any, m: Any, out: Any):
        output = carray(pointer(out), (2,))
        output[0], output[1] = math.nan, math.nan  # what a law leaves out ends its run
        return call_int(address, y, g, m, out)

    return Function(native)
