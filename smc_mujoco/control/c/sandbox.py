"""Try a law's library in a process of its own, which it may take down, and say in one sentence how that ended.

The process runs this file as a script: it loads the library, sets it up, calls the law where asked, and unloads it.
It writes its progress to a file, whose last line names what was going on when it died, or what it found. A script
cannot import smc_mujoco quickly, so the functions that start the process import what they need of it themselves.
"""

import contextlib
import ctypes
import json
import math
import os
import random
import re
import signal
import struct
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

STEPS, LONG_STEPS = 500, 10_000  # samples of 1 ms in each of the runs, and in the longest
LATER_STEPS, GROWTH = 200, 1.06  # samples after those, and the ratio of the times of two in a row: to 15 hours
MAX_POSITION = 3.0  # where a stop holds the double integrator, which a law need not stabilise
GUARD, GUARDS = -7.25, 512  # a value that no law writes by chance; how many stand on either side of its numbers
MORE_GAINS = 16  # beyond those that have names, to see whether the law reads them
BEYOND = 2**40  # the code of glue.c for a law of floats that wrote beyond its memory; one more: beyond out
ALTERED = BEYOND + 2  # the code of glue.c for a law that changed the arithmetic of its thread
ALTERS = "changes the arithmetic of its thread (rounding, flush-to-zero, traps), by which other simulations compute too"
FAULTS = {  # code -> what the law did, for its size of memory, and the cure
    BEYOND: ("writes beyond the {} numbers of its memory", "say more in smc_law_memory, or give memory="),
    BEYOND + 1: ("writes beyond the two numbers of out", "write out[0] and out[1] alone"),
    ALTERED: (ALTERS, "let it restore that, and leave out -Ofast and -ffast-math"),
}
SHARED = "which all channels and simulations share, on several threads"
NUMBERS = ("smc_law_memory", "smc_law_real", "smc_law_degree", "smc_law_modelled")
DOUBLES = ctypes.POINTER(ctypes.c_double)

# What a law does that ends by these signals. By others most read, write or divide.
SIGNALS = {int(signal.SIGABRT): "aborts", int(signal.SIGFPE): "divides, or traps floating-point exceptions"}
# Lines of the sanitizers: undefined behaviour; a kind of access, and the functions that it happened in.
UNDEFINED = re.compile(r"^(?P<file>.+?):(?P<line>\d+):\d+: runtime error: (?P<what>.*)$", re.MULTILINE)
ACCESS = re.compile(r"AddressSanitizer: (?P<what>[\w-]+).*(?:\n(?P<size>(?:READ|WRITE) of size \d+))?")
FRAME = re.compile(r"^ +#\d+ .* in \S+ (?P<file>.+?):(?P<line>\d+)(?::\d+)?$", re.MULTILINE)


class Library(NamedTuple):
    """A law's library that this process has not loaded.

    Attributes:
      file: the library; compiled, or a copy.
      path: the file that the user gave.
      symbol: the law's function.
      flags: more for the compiler.
      timeout: s, for a process that tries it.
      warnings: the compiler's.
    """

    file: Path
    path: Path
    symbol: str
    flags: Sequence[str]
    timeout: float
    warnings: Sequence[str] = ()


def load(library: Library) -> dict[str, Any]:
    """Load, set up and unload a library in a process of its own, and return what its file says of its law.

    Raises:
      ScenarioError: it crashed, did not end in time, or did what a law must not.
    """
    return _run(library, None)


def call(library: Library, fields: Sequence[str], gains: Sequence[float], memory: int, modelled: bool) -> list[str]:
    """Call a law in a process of its own, then with sanitizers, and return sentences on what could not be seen.

    Args:
      fields: names of the numbers in a measurement.
      gains: their values.
      memory: how many numbers of state it has.
      modelled: whether it cannot do without the nominal model.

    Raises:
      ScenarioError: as of `load`.
    """
    from smc_mujoco.control.c import build

    calls, unseen, name = build.fresh(".calls"), [], library.path.name
    anchor, data = build.static_data(library.file, library.symbol)
    if not data:
        unseen.append(f"{name}: static data that it changes is not seen, as nm shows no names of it")
    order = {"fields": fields, "gains": gains, "memory": memory, "modelled": modelled}
    _run(library, order | {"calls": str(calls), "anchor": anchor, "data": data})
    if why := _sanitize(library, calls, len(gains), memory):
        unseen.append(f"{name} is tried without address and undefined-behaviour sanitizers: {why}")
    calls.unlink()
    return unseen


def _run(library: Library, trial: dict | None) -> dict[str, Any]:
    """Run this file as a script, and return what it says of the law at its end."""
    from smc_mujoco.common.errors import ScenarioError
    from smc_mujoco.common.process import Late, timed
    from smc_mujoco.control.c import build

    progress, order = build.fresh(".txt"), build.fresh(".json")
    words = {"library": str(library.file), "symbol": library.symbol, "progress": str(progress), "trial": trial}
    order.write_text(json.dumps(words))
    command = [sys.executable, "-I", "-S", __file__, str(order)]
    try:
        code = timed(command, library.timeout, heard=False).returncode
    except Late:
        code = None
    lines = (progress.read_text() if progress.exists() else "").splitlines() or ["loading"]
    if lines[-1] == "unloading" and code == 0:
        return json.loads(lines[-2])
    file, last = library.path.name, lines[-1].replace(str(library.file), library.path.name)
    kind, _, why = last.partition(" ")
    if kind == Fault.__name__:
        raise ScenarioError(f"{file}: {why}")
    if library.symbol in why and ("undefined symbol" in why or "not found" in why):
        raise ScenarioError(build.undefined(file, library.symbol))
    if why:
        why = " ".join(why.split())
        raise ScenarioError(f"{file} cannot be loaded ({why}): build it for this machine, with all it needs")
    raise ScenarioError(f"{file}: {last} {_ended(code, library.timeout)}")


def _ended(code: int | None, timeout: float) -> str:
    """Say how a process ended: with an exit code, by a signal, or not in time."""
    if code is None:
        return f"did not end within {timeout:g} s: mend what it waits for, or give timeout="
    if code >= 0:
        return f"ended the process with exit code {code}: let it return"
    names = {known.value: known.name for known in signal.Signals}  # without most of the real-time ones
    name, does = names.get(-code, f"signal {-code}"), SIGNALS.get(-code, "reads, writes or divides")
    return f"died of {name} ({signal.strsignal(-code)}): mend where it {does}"


def _sanitize(library: Library, calls: Path, gains: int, memory: int) -> str:
    """Repeat the calls of a trial with sanitizers. Return why that is not possible, or an empty text."""
    from smc_mujoco.common.errors import ScenarioError
    from smc_mujoco.common.process import Late, timed
    from smc_mujoco.control.c import build

    compiler = build.compiler()
    if library.path.suffix != ".c":
        return "give its .c file"
    if (program := build.replayer(tuple(compiler))) is None:
        return f"{compiler[0]} has none that work here"
    try:
        file, _ = build.library(library.path, library.symbol, (*library.flags, *build.SANITIZERS), library.timeout)
    except ScenarioError:
        return f"{compiler[0]} has none with these flags"
    try:
        done = timed([str(n) for n in (program, file, calls, gains, memory)], library.timeout)
    except Late:
        late = f"{library.symbol} did not end within {library.timeout:g} s with sanitizers"
        raise ScenarioError(f"{library.path.name}: {late}: give timeout=") from None
    if done.returncode == 0:
        return ""
    what, places = "it does not end as without sanitizers", []
    if found := UNDEFINED.search(done.stderr):
        what, places = found["what"], [found]
    elif found := ACCESS.search(done.stderr):
        what = ", ".join(filter(None, found.group("what", "size")))
        places = [frame for frame in FRAME.finditer(done.stderr) if Path(frame["file"]).exists()]
    name = Path(places[0]["file"]).name if places else library.path.name
    where = f"line {places[0]['line']}" if places else library.symbol
    raise ScenarioError(f"{name} does harm in {where}: {what}; mend it")


# Libraries through ctypes: in the script, and where smc_mujoco loads a law


def entry(path: str, symbol: str):
    """Return the function of a library as ctypes calls it, and the library."""
    library = ctypes.CDLL(path, mode=getattr(os, "RTLD_NOW", 0) | getattr(os, "RTLD_LOCAL", 0))
    glued = hasattr(library, "smc_mujoco_entry")
    function = getattr(library, "smc_mujoco_entry" if glued else symbol)
    function.restype, function.argtypes = ctypes.c_int64 if glued else ctypes.c_int, [DOUBLES] * 4
    return function, library


def facts(library) -> dict[str, str | int]:
    """Return what a file says of its law, by the names in smc_law.h, and whether the glue is in it."""
    found: dict[str, str | int] = {"glue": hasattr(library, "smc_mujoco_entry")}
    if hasattr(library, "smc_law_gains"):
        text = ctypes.string_at(ctypes.addressof(ctypes.c_char.in_dll(library, "smc_law_gains")))
        found["smc_law_gains"] = text.decode(errors="replace")
    return found | {name: ctypes.c_int.in_dll(library, name).value for name in NUMBERS if hasattr(library, name)}


def set_up(library) -> int:
    """Call smc_setup where there is one, and return its code."""
    return int(library.smc_setup()) if hasattr(library, "smc_setup") else 0


def set_sizes(library, gains: int, memory: int) -> None:
    """Tell the glue how many gains and numbers of memory there are."""
    if hasattr(library, "smc_mujoco_entry"):
        ctypes.c_int.in_dll(library, "smc_mujoco_gains").value = gains
        ctypes.c_int.in_dll(library, "smc_mujoco_memory").value = memory


def doubles(values) -> ctypes.Array:
    """Return an array of C doubles."""
    return (ctypes.c_double * len(values))(*values)


# The script


class Fault(Exception):
    """What is wrong with a law, in words."""


def arithmetic() -> bytes:
    """Return bits of results that another rounding or flush-to-zero changes. An enabled trap ends the process."""
    one, half, big, inf, zero, ulp, normal, tiny = 1.0, 0.5, 1e308, math.inf, 0.0, 2.0**-52, 2.0**-1022, 2.0**-1074
    with contextlib.suppress(ValueError):
        math.pow(zero, -one)  # divides by zero
    return struct.pack("6d", big * big, inf - inf, one + 0.3 * ulp, one + 0.7 * ulp, normal * half, tiny + tiny)


STANDARD = arithmetic()


class Fenced:
    """Numbers between guards, which no law may write."""

    def __init__(self, values, guard: float = GUARD):
        edge = [guard] * GUARDS
        self.whole = doubles([*edge, *values, *edge])
        self.own = (ctypes.c_double * len(values)).from_buffer(self.whole, 8 * GUARDS)
        self.before = self.guards()

    def guards(self) -> bytes:
        """Return the guards, bit by bit."""
        whole = bytes(self.whole)
        return whole[: 8 * GUARDS] + whole[-8 * GUARDS :]

    def crossed(self) -> bool:
        """Return whether a guard has changed."""
        return self.guards() != self.before


class Trial:
    """Runs of a law on a double integrator x'' = u, and calls far away from it.

    Args:
      law, library: as of `entry`.
      order: fields, gains, memory and modelled as of `call`; the static data and where the file has the law; a file for
        the gains and for the measurement of each call, which `replay.c` reads.
    """

    def __init__(self, law, library, order, calls):
        self.law, self.library, self.calls = law, library, calls
        self.fields, self.size, self.modelled = order["fields"], order["memory"], order["modelled"]
        base = ctypes.cast(law, ctypes.c_void_p).value - order["anchor"]
        self.data = [(name, base + place, size) for name, place, size in order["data"]]
        self.data_before = self.static_data()
        self.y, self.out = Fenced([0.0] * len(self.fields)), Fenced([0.0] * 2)
        self.gains = Fenced(order["gains"], math.nan)  # where the law reads more gains than it has, u is NaN
        self.gains_before = bytes(self.gains.whole)
        calls.write(bytes(self.gains.own))
        self.random = random.Random(0)

    def all(self) -> None:
        """Make every kind of run, and calls at the end of the finite world, where a law may give up."""
        steps = LONG_STEPS
        for model in (1.0,) if self.modelled else (0.0, 1.0):
            for surfaced in (0.0, 1.0):
                self.run(model, surfaced, 1.0 - 2.0 * surfaced, steps)
                steps = STEPS
        for e in (-1e6, -1e3, 0.0, 1e3, 1e6):
            for de in (-1e6, 0.0, 1e6):
                far = {"dt": 1e-3, "x": e, "v": de, "e": e, "de": de, "g": 1.0, "limit": 6.0, "model": 1.0}
                self.call(self.measurement(**far), Fenced([0.0] * self.size))
        self.check_static_data()

    def run(self, model: float, surfaced: float, x: float, steps: int) -> None:
        """Make a run with measurement noise and a sine as reference. After its steps the time goes on in leaps."""
        v, dt, memory = 0.0, 1e-3, Fenced([0.0] * self.size)
        for k in range(steps + LATER_STEPS):
            t = dt * (k if k < steps else steps * GROWTH ** (k - steps))
            r, dr, ddr = 0.1 * math.sin(t), 0.1 * math.cos(t), -0.1 * math.sin(t)
            e, de = x + self.random.gauss(0.0, 1e-3) - r, v + self.random.gauss(0.0, 1e-2) - dr
            seen = {"t": t, "dt": dt, "x": e + r, "v": de + dr, "e": e, "de": de, "r": r, "dr": dr, "ddr": ddr}
            seen |= {"g": 1.0, "a": ddr, "limit": 6.0, "model": model, "q": 0.1 * e, "gq": 1.0}
            if surfaced:
                seen |= {"surfaced": 1.0, "s": de + 2.0 * e, "eq": -2.0 * de}
            y, before = self.measurement(**seen), bytes(memory.own)
            code, u, s = self.call(y, memory)
            if code != 0 or not (math.isfinite(u) and math.isfinite(s)):
                self.check_gains(y, before)
                what = code or f"u = {u}, s = {s}"
                raise Fault(f"returned {what} at t = {t:g}, e = {e:g}, de = {de:g}: mend it, or the gains")
            if k % 50 == 0:
                self.check_static_data()
                if repr(self.law_at(y, self.state(before))) != repr((code, u, s)):
                    raise Fault(f"gave two answers to one measurement, as from state {SHARED}: keep it in memory")
            v += dt * min(max(u, -6.0), 6.0)
            x += dt * v
            if abs(x) > MAX_POSITION:
                x, v = math.copysign(MAX_POSITION, x), 0.0

    def measurement(self, **seen: float) -> list[float]:
        """Return a measurement's numbers in their order: 0 where nothing is given."""
        return [seen.get(name, 0.0) for name in self.fields]

    def state(self, kept: bytes) -> Fenced:
        """Return memory as it was."""
        return Fenced(struct.unpack(f"{self.size}d", kept))

    def call(self, y: list[float], memory: Fenced) -> tuple[int, float, float]:
        """Call the law, and note the call for the sanitizers."""
        self.calls.write(struct.pack(f"{len(y)}d", *y))
        return self.law_at(y, memory)

    def law_at(self, y: list[float], memory: Fenced) -> tuple[int, float, float]:
        """Return the law's code, u and s. Fault where it writes anything but memory and out."""
        self.y.own[:], self.out.own[:] = y, [math.nan, math.nan]
        given = bytes(self.y.whole)
        code = self.law(self.y.own, self.gains.own, memory.own, self.out.own)
        if memory.crossed():
            code = BEYOND
        elif self.out.crossed():
            code = BEYOND + 1
        elif arithmetic() != STANDARD:
            code = ALTERED
        if code in FAULTS:
            what, cure = FAULTS[code]
            raise Fault(f"{what.format(self.size)}: {cure}")
        if bytes(self.gains.whole) != self.gains_before or bytes(self.y.whole) != given:
            raise Fault("changes its gains or its measurement: keep what changes in memory")
        return code, self.out.own[0], self.out.own[1]

    def static_data(self) -> dict[str, bytes]:
        """Return the static data of now."""
        return {name: ctypes.string_at(place, size) for name, place, size in self.data}

    def check_static_data(self) -> None:
        """Fault where the law has changed what other simulations see."""
        changed = [name for name, now in self.static_data().items() if now != self.data_before[name]]
        if changed:
            cure = "keep state in memory, and fill tables in smc_setup"
            raise Fault(f"changes static data ({changed[0]}), {SHARED}: {cure}")

    def check_gains(self, y: list[float], before: bytes) -> None:
        """Fault where u becomes a number once there are more gains than have names."""
        count, out = len(self.gains.own), Fenced([math.nan, math.nan])
        more = Fenced([*self.gains.own, *[1.0] * MORE_GAINS])
        set_sizes(self.library, count + MORE_GAINS, self.size)
        code = self.law(Fenced(y).own, more.own, self.state(before).own, out.own)
        set_sizes(self.library, count, self.size)
        if code == 0 and all(map(math.isfinite, out.own)):
            raise Fault(
                f"reads more gains than the {count} that have names: name them in smc_law_gains, or give gains="
            )


def attempt(order, progress) -> None:
    """Load, set up and where asked call a law; write its progress, and at the end what its file says of it."""

    def done(step: str) -> None:
        if arithmetic() != STANDARD:
            raise Fault(f"{step} {ALTERS}: {FAULTS[ALTERED][1]}")

    symbol = order["symbol"]
    print("loading", file=progress)
    law, library = entry(order["library"], symbol)
    done("loading it")
    print("smc_setup", file=progress)
    if code := set_up(library):
        raise Fault(f"smc_setup returned {code}: mend it")
    done("smc_setup")
    if trial := order["trial"]:
        print(symbol, file=progress)
        set_sizes(library, len(trial["gains"]), trial["memory"])
        with Path(trial["calls"]).open("wb") as calls:
            try:
                Trial(law, library, trial, calls).all()
            except Fault as fault:
                raise Fault(f"{symbol} {fault}") from None
    print(json.dumps(facts(library)), file=progress)
    print("unloading", file=progress)


def main(file: str) -> None:
    """Do what a JSON file asks."""
    order = json.loads(Path(file).read_text())
    with Path(order["progress"]).open("w", buffering=1) as progress:
        try:
            attempt(order, progress)
        except (Fault, OSError, AttributeError) as error:
            print(f"{type(error).__name__} {error}", file=progress)


if __name__ == "__main__":
    main(sys.argv[1])
