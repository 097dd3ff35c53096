"""Laws written in C: `law_from_c` compiles and loads them, and they run in the callback like the library's own.

The C function is told in `smc_law.h`, beside this file. A file is compiled together with a few lines that call it as
the callback calls laws, so that one of another type is a compiler's error; a shared library is called as it is. What
can hang or crash - loading, smc_setup, and where asked for the law itself - is tried in a process of its own first.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import ctypes
import functools
import hashlib
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numba import carray

from smc_mujoco.common import errors
from smc_mujoco.common.errors import ScenarioError, whole
from smc_mujoco.common.jit import AtAddress, Function, call_int, pointer
from smc_mujoco.control.c import build, child, said, trial
from smc_mujoco.control.component import Template, template
from smc_mujoco.control.units import Gain


class CLaw(AtAddress):
    """A law in C: called by address in the callback, and here, through ctypes, in the plain loop.

    What tells it from others is its machine code, and so all that went into it: file, headers, flags, compiler.
    """

    def __init__(self, path: Path, symbol: str, file: Path, doc: str | None):
        self.path, self.symbol, self.file = path, symbol, file
        self.code = file.read_bytes()
        self.digest = hashlib.sha256(symbol.encode() + b"\0" + self.code).hexdigest()
        self._function, self.library = trial.entry(str(file), symbol)
        self.address: int = ctypes.cast(self._function, ctypes.c_void_p).value or 0
        if not hasattr(self.library, "smc_mujoco_entry"):
            self._trampoline = _trampoline(self.address)
            self.address = self._trampoline.address
        self.sizes = 0, 1  # how many gains and numbers of memory
        self.__name__ = re.sub(r"\W", "_", path.stem)
        self.__module__, self.__doc__ = path.name, doc

    def __call__(self, y: Sequence[float], gains: Sequence[float], memory: np.ndarray) -> tuple[float, float]:
        """u and s; ArithmeticError where the C function returns anything but 0."""
        out, doubles = trial.doubles([math.nan] * 2), ctypes.POINTER(ctypes.c_double)
        code = self._function(trial.doubles(y), trial.doubles(gains), memory.ctypes.data_as(doubles), out)
        if code != 0:
            raise ArithmeticError(f"{self.symbol} {trial.wrong(code, self.sizes[1]) or f'returned {code}'}")
        return out[0], out[1]

    def sized(self, gains: int, memory: int) -> None:
        """Say how many gains and numbers of memory there are."""
        self.sizes = gains, memory
        trial.sized(self.library, gains, memory)

    def __repr__(self) -> str:
        return f"<C function {self.symbol} of {self.path.name}>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, CLaw) and self._told() == other._told()

    def __hash__(self) -> int:
        return hash(self._told())

    def _told(self) -> tuple:
        """What tells it from others; a copy of it, pickled or loaded again, is the same law."""
        return self.digest, self.sizes, self.__name__

    def __reduce__(self):
        """By its machine code: another process runs this one, whatever its file holds by then."""
        return _again, (self.path.name, self.symbol, self.code, self.sizes, self.__name__, self.__doc__)


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
        `smc_law.h`, which the file may include, tells the function.
      gains: name -> default or Gain, in the order of the function's gains[]. A file that says smc_law_gains has names
        and defaults itself; these then change the defaults.
      memory: numbers of state per channel; where left out what the file says in smc_law_memory, or 8.
      name: of the law; the file's where left out.
      symbol: the function's name.
      flags: more for the compiler: "-Ifirmware/include", "-DUNIT_TEST", "filter.c".
      isolate: whether to try the law first in a process of its own, on short runs of a double integrator: it tells by
        a sentence what crashes, hangs, returns NaN, reads gains that have no name, writes beyond its memory or keeps
        state elsewhere.
      timeout: s, for each of the compiler, the set-up and the trial.
      positive, nonnegative, degree, plants, modelled: as of `smc.law_function`; where degree and modelled are left
        out, what the file says in smc_law_degree and smc_law_modelled.

    Returns:
      A Template, called with gains for the Law of a Scenario: `law_from_c("my_law.c")(lam=5.0)`. It is the code of now:
      an edit of the file asks for another call. Pickled, it takes its machine code along.

    Raises:
      ScenarioError: no such file or function, what does not compile or has another type, a set-up that fails, crashes
        or does not end, and with isolate a law that does.

    C is not checked while it runs. A law that reads or writes where it should not takes the whole process down, or
    changes a neighbour's numbers; one that does not return hangs it. Try what is new with isolate=True, or with
    `smc-mujoco check-c my_law.c`.
    """
    if name is not None:
        errors.name("name", name)
    told = {name: gain for name, gain in gains.items() if isinstance(gain, Gain)} if isinstance(gains, Mapping) else {}
    plain = {**gains, **{name: gain.default for name, gain in told.items()}} if gains and told else gains
    tried = child.tried(source, symbol, flags, timeout, plain, memory, modelled, isolate)  # pyright: ignore[reportArgumentType]
    degree = whole("degree", tried.facts.get("smc_law_degree") or 1 if degree is None else degree, 1, 3)
    path = tried.library.path
    law = CLaw(path, symbol, tried.library.file, said.comment(path))
    _set_up(law)
    law.sized(len(tried.gains), tried.memory)
    law.__name__ = name or law.__name__
    given = {name: told.get(name, value) for name, value in tried.gains.items()}
    return template(
        "law", given, tried.memory, positive, nonnegative, degree, None, plants, requires_model=tried.modelled
    )(law)


@functools.cache
def _again(file: str, symbol: str, code: bytes, sizes: tuple[int, int], name: str, doc: str | None) -> CLaw:
    """The law of another process, loaded once in this one."""
    copy = build.fresh(".so")
    copy.write_bytes(code)
    try:
        law = CLaw(Path(file), symbol, copy, doc)
    except OSError as error:
        why = str(error).replace(str(copy), file)
        raise ScenarioError(
            f"{file} cannot be loaded ({why}): run it on machines like the one it was built on"
        ) from None
    _set_up(law)
    law.sized(*sizes)
    law.__name__ = name
    return law


def _set_up(law: CLaw) -> None:
    if code := trial.set_up(law.library):
        raise ScenarioError(f"{law.path.name}: smc_setup returned {code}: mend it")


def _trampoline(address: int) -> Function:
    """A C function that returns an int, as one that returns what the callback takes."""

    def native(y: Any, g: Any, m: Any, out: Any):
        output = carray(pointer(out), (2,))
        output[0], output[1] = math.nan, math.nan  # what a law leaves out ends its run
        return call_int(address, y, g, m, out)

    return Function(native)
