"""Laws written in C:

`law_from_c` compiles and loads them, and they run in the callback like the library's own.

`smc_law.h`, beside this file, describes the C function. A file is compiled together with `glue.c`,
which calls the law the way the callback does, so a law of another type is a compiler error. A
shared library is called directly. It runs in this process, which it may crash.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import ctypes
import dataclasses
import functools
import hashlib
import math
import os
import re
import shutil
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.common import errors
from smc_mujoco.common.constraints import Timeout, constrained
from smc_mujoco.common.errors import ScenarioError, items_of, shown, whole
from smc_mujoco.common.files import as_path
from smc_mujoco.common.jit import AtAddress, CompiledFunction, call_int, pointer
from smc_mujoco.control.component import Template, as_gains, gain_text, template_decorator
from smc_mujoco.control.from_text import parsed_gains
from smc_mujoco.control.joint_law import ARRAYS
from smc_mujoco.control.units import Gain
from smc_mujoco.exchange.c import build, shared_library

LIBRARY_SUFFIXES = (".so", ".dylib")
DEFAULT_MEMORY = 8


class CLaw(AtAddress):
    """A law in C: called by its address in the callback, and from Python through ctypes.

    Two laws are equal if their machine code is. It follows from file, headers, flags and compiler.
    """

    def __init__(self, path: Path, symbol: str, file: Path):
        self.path = path
        self.symbol = symbol
        self.code = file.read_bytes()
        content = symbol.encode() + b"\0" + self.code
        self.digest = hashlib.sha256(content).hexdigest()
        self._function, self.library = shared_library.entry(str(file), symbol)
        as_pointer = ctypes.cast(self._function, ctypes.c_void_p)
        self.address: int = as_pointer.value or 0
        self.joints = 0
        if hasattr(self.library, "smc_mujoco_entry"):
            self.joints = ctypes.c_int.in_dll(self.library, "smc_mujoco_joints").value
        else:
            self._trampoline = _trampoline(self.address)
            self.address = self._trampoline.address
        self.sizes = 0, 1  # number of gains, and of memory slots
        self.__name__ = re.sub(r"\W", "_", path.stem)
        self.__module__ = path.name
        self.__doc__ = None

    def __call__(self, y: Any, gains: Sequence[Any], memory: np.ndarray) -> tuple[Any, Any]:
        """Return u and s, two vectors of a law of many joints.

        `y`: a Measurement, or a JointMeasurement.
        """
        if not self.joints:
            u, s = self._out(y, gains, memory, 2)
            return u, s
        n = self.joints
        requests = shared_library.Requests(
            n,
            lambda w: y.dynamics.coriolis(np.array(w)).tolist(),
            lambda: y.dynamics.jacobian().ravel(),
        )
        arrays = [np.ravel(getattr(y, name)).tolist() for name in ARRAYS]
        numbers = shared_library.stored(y[:3], requests, arrays)
        gains_by_joint = np.concatenate(
            [np.empty(0), *(np.broadcast_to(gain, n) for gain in gains)]
        )
        out = self._out(numbers, gains_by_joint.tolist(), memory, 2 * n)
        commands = np.array(out[:n])
        return commands, np.array(out[n:])

    def _out(
        self, y: Sequence[float], gains: Sequence[float], memory: np.ndarray, count: int
    ) -> list[float]:
        """Call the C function, and return the numbers of its out[]."""
        out = shared_library.doubles([math.nan] * count)
        place = memory.ctypes.data_as(shared_library.DOUBLES)
        code = self._function(shared_library.doubles(y), shared_library.doubles(gains), place, out)
        if code != 0:
            what = shared_library.FAULTS.get(code, f"returned {code}")
            raise ArithmeticError(f"{self.symbol} {what.format(self.sizes[1])}")
        return out[:]

    def set_up(self, gains: int, memory: int, name: str | None) -> None:
        """Call smc_setup, and set the name and the number of gains and of memory slots."""
        if code := shared_library.set_up(self.library):
            raise ScenarioError(f"{self.path.name}: smc_setup returned {code}: fix it")
        self.sizes, self.__name__ = (gains, memory), name or self.__name__
        shared_library.set_sizes(self.library, gains, memory)

    def __repr__(self) -> str:
        return f"<C function {self.symbol} of {self.path.name}>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, CLaw) and self._identity() == other._identity()

    def __hash__(self) -> int:
        return hash(self._identity())

    def _identity(self) -> tuple:
        """Return the key of equality: a copy, pickled or loaded again, is the same law."""
        return self.digest, self.sizes, self.__name__

    def __reduce__(self):
        """Pickle the machine code: another process runs this law even if its file has changed."""
        return _unpickled, (self.path.name, self.symbol, self.code, self.sizes, self.__name__)


@functools.cache
def _unpickled(file: str, symbol: str, code: bytes, sizes: tuple[int, int], name: str) -> CLaw:
    """Return a law from another process, loaded once in this one."""
    copy = build.fresh(".so")
    copy.write_bytes(code)
    try:
        law = CLaw(Path(file), symbol, copy)
    except OSError as error:
        why = str(error).replace(str(copy), file)
        raise ScenarioError(
            f"{file} cannot be loaded ({why}): run it on machines like the one it was built on"
        ) from None
    law.set_up(*sizes, name)
    return law


def _trampoline(address: int) -> CompiledFunction:
    """Return a function of the callback's type that calls a C function which returns an int."""

    def native(y: Any, g: Any, m: Any, out: Any):
        output = pointer(out)
        output[0] = math.nan  # a result that the law does not set ends its run
        output[1] = math.nan
        return call_int(address, y, g, m, out)

    return CompiledFunction(native)


def law_from_c(
    source: str | Path,
    *,
    gains: Mapping[str, float | Gain] | None = None,
    memory: int | None = None,
    name: str | None = None,
    symbol: str = "smc_law",
    flags: Sequence[str] = (),
    timeout: float = 10.0,
    plants: Iterable[str] = (),
) -> Template:
    """Load your own law in C.

    It runs in MuJoCo's control callback at the speed of the built-in laws.

    Args:
      source: a .c file, compiled by $CC or cc in a temporary folder; or a .so with the function in
        double precision. `smc_law.h`, which the file may include, describes the function. A file
        that defines SMC_JOINTS before that has a law of so many joints.
      gains: name -> default or Gain, in the order of the function's gains[]. If the file has
        smc_law_gains, they change its defaults.
      memory: number of state variables per channel. Default: smc_law_memory of the file, or 8.
      name: of the law. Default: the file's name.
      symbol: the function's name.
      flags: additional compiler flags or files: "-Ifirmware/include", "-DUNIT_TEST", "filter.c".
      timeout: s, for the compilation.
      plants: as in `smc.law_function`.

    Returns:
      A Template. Called with gains it returns the Law of a Scenario:
      `law_from_c("my_law.c")(lam=5.0)`. It does not follow later edits of the file: call
      `law_from_c` again. A pickle contains the machine code.

    Raises:
      ScenarioError: no such file or function, a compiler error, a function of another type, or a
        set-up that fails.

    Nothing checks C while it runs. A law that accesses other memory crashes the process or changes
    the numbers of other runs; one that does not return hangs it. Load only what you trust.
    """
    if name is not None:
        errors.name("name", name)
    library = _library(source, symbol, flags, timeout)
    about = _about(library, gains, memory)
    law = CLaw(library.path, symbol, library.file)
    law.set_up(len(about.gains), about.memory, name)
    return template_decorator(
        "law",
        about.gains,
        about.memory,
        relative_degree=about.degree,
        plants=plants,
        requires_model=about.modelled,
        joint=bool(about.joints),
    )(law)


def check_law_source(
    source: Path,
    gains: Mapping[str, float] | None,
    memory: int | None,
    symbol: str,
    flags: Sequence[str],
    timeout: float,
) -> Iterator[str]:
    """Compile and load a law, and yield lines: warnings, gains and memory."""
    if source.suffix == ".c":
        flags = (*build.WARNING_FLAGS, *flags)
    library = _library(source, symbol, flags, timeout)
    about = _about(library, gains, memory)
    yield from library.warnings
    texts = []
    for name, gain in about.gains.items():
        texts.append(f"{name} = {gain_text(gain.default)}")
    joints = f"{about.joints} joints; " if about.joints else ""
    gain_texts = ", ".join(texts) or "none"
    yield f"{source.name}: {symbol} is a law; {joints}gains {gain_texts}; memory {about.memory}"


@constrained
def _library(
    source: str | Path, symbol: str, flags: Sequence[str], timeout: Timeout
) -> shared_library.Library:
    """Return the library of a law, compiled from a .c file or copied.

    Arguments and errors as in `law_from_c`.
    """
    if sys.platform == "win32":
        raise ScenarioError(
            f"cannot take a law from {shown(str(source))} on Windows: run it on Linux, or in WSL"
        )
    path = as_path(source, "the law")
    if not isinstance(symbol, str) or not re.fullmatch(r"[A-Za-z_]\w*", symbol, re.ASCII):
        raise ScenarioError(f"symbol is {shown(symbol)}: give the name of a C function")
    flags = items_of("flags", flags)
    if not all(isinstance(flag, str) for flag in flags):
        raise ScenarioError(f"flags is {shown(flags)}: give texts, such as ['-DUNIT_TEST']")
    if path.suffix not in (".c", *LIBRARY_SUFFIXES):
        raise ScenarioError(
            f"cannot take a law from {shown(str(path))}: give a .c file, or a shared library, .so"
        )
    if not os.path.isfile(path):
        raise ScenarioError(f"there is no file {path}: give the path of a .c file or of a .so")
    if path.suffix == ".c":
        file, warnings = build.library(path, symbol, flags, timeout)
        return shared_library.Library(file, path, symbol, warnings)
    try:
        copy = shutil.copy(
            path, build.fresh(path.suffix)
        )  # so that a rebuilt library is loaded again
    except OSError as error:
        raise ScenarioError(
            f"{path} cannot be read ({error.strerror}): give one that can"
        ) from None
    return shared_library.Library(Path(copy), path, symbol)


class About(NamedTuple):
    """Properties of a law in C; `joints` is 0 for a law of one channel."""

    gains: dict[str, Gain]
    memory: int
    degree: int
    modelled: bool
    joints: int


def _loaded(library: shared_library.Library) -> ctypes.CDLL:
    """Load a library into this process."""
    try:
        _, loaded = shared_library.entry(str(library.file), library.symbol)
    except (OSError, AttributeError) as error:
        why = str(error).replace(str(library.file), library.path.name)
        if re.search(rf"(undefined symbol|not found).*{library.symbol}", why):
            raise ScenarioError(build.undefined(library.path, library.symbol)) from None
        raise ScenarioError(
            f"{library.path.name} cannot be loaded ({why}): build it for this machine, with all it "
            "needs"
        ) from None
    return loaded


def _about(
    library: shared_library.Library, gains: Mapping[str, float | Gain] | None, memory: int | None
) -> About:
    """Return the properties of a library's law: the arguments, or else what the file states."""
    facts = shared_library.facts(_loaded(library))
    file = library.path.name
    joints = facts.get("smc_mujoco_joints", 0)
    if "smc_law_shared" in facts and not facts["glue"]:
        raise ScenarioError(f"{file} is a library with a law of many joints: give its .c file")
    if facts.get("smc_law_real", 8) != 8 and not facts["glue"]:
        raise ScenarioError(
            f"{file} is a library of single precision: give its .c file, or build it of doubles"
        )
    text = facts.get("smc_law_gains")
    if text is None:
        stated = {}
    else:
        stated = parsed_gains(text, f"{file}'s smc_law_gains")
    named = as_gains(gains, stated)
    for name in () if text is None else named:
        errors.find(f"gain of {file}", name, stated)
    for name, gain in named.items():
        if isinstance(gain.default, tuple) and len(gain.default) != joints:
            cure = "give it one number"
            if joints:
                cure += f", or {joints}"
            raise ScenarioError(f"gain {name} of {file} is {gain_text(gain.default)}: {cure}")
    for name in filter(None, facts.get("smc_law_shared", "").split(",")):
        gain = errors.find(f"shared gain of {file}", name, named)
        if isinstance(gain.default, tuple):
            raise ScenarioError(
                f"shared gain {name} of {file} is {gain_text(gain.default)}: give it one number"
            )
        named[name] = dataclasses.replace(gain, shared=True)
    return About(
        named,
        whole(
            "memory",
            max(facts.get("smc_law_memory", DEFAULT_MEMORY), 1) if memory is None else memory,
            1,
            10_000,
        ),
        whole("degree", facts.get("smc_law_degree") or 1, 1, 3),
        bool(facts.get("smc_law_modelled")),
        joints,
    )
