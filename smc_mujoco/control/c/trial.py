"""A law's library tried in a process of its own, which it may take down: loaded, set up, called, unloaded.

It runs as a script and imports nothing but Python's own. It tells how far it came by lines in a file: the last one
names what was going on when the process died, or what was found.
"""

import contextlib
import ctypes
import json
import math
import os
import random
import struct
import sys
from pathlib import Path

STEPS, LONG = 500, 10_000  # samples of 1 ms in each of the runs, and in the longest
LATER, GROWTH = 200, 1.06  # samples after those, and the ratio of the times of two in a row: to 15 hours
STOP = 3.0  # where a stop holds the double integrator, which a law need not stabilise
BEYOND = 2**40  # what the glue returns where a law of floats wrote beyond its memory; one more: beyond out
ALTERED = BEYOND + 2  # what the glue returns where a law changed the arithmetic of its thread
GUARD, PLAY = -7.25, 512  # a value that no law writes by chance; how many of them lie on either side of its numbers
MORE = 16  # gains beyond those that have names, given to see whether it reads them
ALTERS = "changes the arithmetic of its thread (rounding, flush-to-zero, traps), by which other simulations compute too"
CURES = {
    BEYOND: "say more in smc_law_memory, or give memory=",
    BEYOND + 1: "write out[0] and out[1] alone",
    ALTERED: "let it restore that, and leave out -Ofast and -ffast-math",
}
SHARED = "which all channels and simulations share, on several threads"
NUMBERS = ("smc_law_memory", "smc_law_real", "smc_law_degree", "smc_law_modelled")
DOUBLES = ctypes.POINTER(ctypes.c_double)
Array = ctypes.Array  # of doubles


class Found(Exception):
    """What is wrong with a law, in words."""


def entry(path: str, symbol: str):
    """The function of a library as ctypes calls it, and the library."""
    library = ctypes.CDLL(path, mode=getattr(os, "RTLD_NOW", 0) | getattr(os, "RTLD_LOCAL", 0))
    wide = hasattr(library, "smc_mujoco_entry")
    function = getattr(library, "smc_mujoco_entry" if wide else symbol)
    function.restype, function.argtypes = ctypes.c_int64 if wide else ctypes.c_int, [DOUBLES] * 4
    return function, library


def facts(library) -> dict[str, str | int]:
    """What a file says of its law, by the names in smc_law.h, and whether the glue is in it."""
    found: dict[str, str | int] = {"glue": hasattr(library, "smc_mujoco_entry")}
    if hasattr(library, "smc_law_gains"):
        text = ctypes.string_at(ctypes.addressof(ctypes.c_char.in_dll(library, "smc_law_gains")))
        found["smc_law_gains"] = text.decode(errors="replace")
    return found | {name: ctypes.c_int.in_dll(library, name).value for name in NUMBERS if hasattr(library, name)}


def set_up(library) -> int:
    """Call smc_setup where there is one; its code."""
    return int(library.smc_setup()) if hasattr(library, "smc_setup") else 0


def sized(library, gains: int, memory: int) -> None:
    """Tell the glue how many gains and numbers of memory there are."""
    if hasattr(library, "smc_mujoco_entry"):
        ctypes.c_int.in_dll(library, "smc_mujoco_gains").value = gains
        ctypes.c_int.in_dll(library, "smc_mujoco_memory").value = memory


def wrong(code: int, memory: int) -> str | None:
    """What a code of the glue says of a law with so many numbers of memory; None for the law's own codes."""
    return {
        BEYOND: f"writes beyond the {memory} numbers of its memory",
        BEYOND + 1: "writes beyond the two numbers of out",
        ALTERED: ALTERS,
    }.get(code)


def arithmetic() -> bytes:
    """The bits of results that another rounding or flush-to-zero changes; a trap that is enabled ends the process."""
    one, half, big, inf, nought, ulp, normal, tiny = 1.0, 0.5, 1e308, math.inf, 0.0, 2.0**-52, 2.0**-1022, 2.0**-1074
    with contextlib.suppress(ValueError):
        math.pow(nought, -one)  # divides by zero
    return struct.pack("6d", big * big, inf - inf, one + 0.3 * ulp, one + 0.7 * ulp, normal * half, tiny + tiny)


STANDARD = arithmetic()


def altered() -> int:
    """ALTERED where the arithmetic of this thread is another than it was, else 0."""
    return ALTERED if arithmetic() != STANDARD else 0


def doubles(values) -> Array:
    """An array of C doubles."""
    return (ctypes.c_double * len(values))(*values)


class Fenced:
    """Numbers between fences, which no law may write."""

    def __init__(self, values, fence: float = GUARD):
        edge, self.count = [fence] * PLAY, len(values)
        self.whole = doubles([*edge, *values, *edge])
        self.own = (ctypes.c_double * self.count).from_buffer(self.whole, 8 * PLAY)
        self.fences = self.outside()

    def outside(self) -> tuple[bytes, bytes]:
        """The fences, bit by bit."""
        held = bytes(self.whole)
        return held[: 8 * PLAY], held[8 * (PLAY + self.count) :]

    def passed(self) -> bool:
        """Whether a fence has changed."""
        return self.outside() != self.fences


class Trial:
    """Runs of a law on a double integrator x'' = u, and calls far away from it.

    Args:
      law, library: as of `entry`.
      gains: their values.
      memory: how many numbers of state it has.
      data: name, address and size of its static data, as far as known.
      calls: a file for the gains and for the measurement of each call, for `replay.c`.
    """

    def __init__(self, law, library, gains, memory: int, data, calls):
        self.law, self.library, self.size, self.data, self.calls = law, library, memory, data, calls
        self.static = self.statics()
        self.y, self.out = Fenced([0.0] * 21), Fenced([0.0] * 2)
        self.gains = Fenced(gains, math.nan)  # what it reads of more gains than it has ends in u
        self.held = bytes(self.gains.whole)
        calls.write(bytes(self.gains.own))
        self.random = random.Random(0)

    def call(self, y: list[float], memory: Fenced) -> tuple[int, float, float]:
        """The law's code, u and s; Found where it writes where nothing is its own."""
        self.y.own[:], self.out.own[:] = y, [math.nan, math.nan]
        given = bytes(self.y.whole)
        code = self.law(self.y.own, self.gains.own, memory.own, self.out.own)
        code = BEYOND if memory.passed() else BEYOND + 1 if self.out.passed() else altered() or code
        if code in CURES:
            raise Found(f"{wrong(code, self.size)}: {CURES[code]}")
        if bytes(self.gains.whole) != self.held or bytes(self.y.whole) != given:
            raise Found("changes its gains or its measurement: keep what changes in memory")
        return code, self.out.own[0], self.out.own[1]

    def run(self, model: float, surfaced: float, x: float, steps: int) -> None:
        """A run with measurement noise and a sine for reference; after its steps the time goes on in leaps."""
        v, dt, memory = 0.0, 1e-3, Fenced([0.0] * self.size)
        for k in range(steps + LATER):
            t = dt * (k if k < steps else steps * GROWTH ** (k - steps))
            r, dr, ddr = 0.1 * math.sin(t), 0.1 * math.cos(t), -0.1 * math.sin(t)
            e, de = x + self.random.gauss(0.0, 1e-3) - r, v + self.random.gauss(0.0, 1e-2) - dr
            slid = [1.0, de + 2.0 * e, -2.0 * de] if surfaced else [0.0] * 3
            y = [t, dt, e + r, de + dr, e, de, r, dr, ddr, 0.0, 1.0, ddr, 6.0, model, *slid, 0.1 * e, 0.0, 0.0, 1.0]
            self.calls.write(struct.pack("21d", *y))
            before = bytes(memory.own)
            code, u, s = self.call(y, memory)
            if code != 0 or not (math.isfinite(u) and math.isfinite(s)):
                self.starved(y, before)
                said = code or f"u = {u}, s = {s}"
                raise Found(f"returned {said} at t = {t:g}, e = {e:g}, de = {de:g}: mend it, or the gains")
            if k % 50 == 0:
                self.alone()
                if repr(self.call(y, self.state(before))) != repr((code, u, s)):
                    raise Found(f"gave two answers to one measurement, as from state {SHARED}: keep it in memory")
            v += dt * min(max(u, -6.0), 6.0)
            x += dt * v
            if abs(x) > STOP:
                x, v = math.copysign(STOP, x), 0.0

    def state(self, kept: bytes) -> Fenced:
        """Memory as it was."""
        return Fenced(struct.unpack(f"{self.size}d", kept))

    def statics(self) -> dict[str, bytes]:
        """The static data of now."""
        return {name: ctypes.string_at(at, size) for name, at, size in self.data}

    def alone(self) -> None:
        """Found where it has changed what other simulations see."""
        changed = [name for name, now in self.statics().items() if now != self.static[name]]
        if changed:
            raise Found(
                f"changes static data ({changed[0]}), {SHARED}: keep state in memory, and fill tables in smc_setup"
            )

    def starved(self, y: list[float], before: bytes) -> None:
        """Found where u is a number once there are more gains than were named."""
        count, out = self.gains.count, Fenced([math.nan, math.nan])
        sized(self.library, count + MORE, self.size)
        more = Fenced([*self.gains.own, *[1.0] * MORE])
        code = self.law(Fenced(y).own, more.own, self.state(before).own, out.own)
        sized(self.library, count, self.size)
        if code == 0 and all(map(math.isfinite, out.own)):
            raise Found(
                f"reads more gains than the {count} that have names: name them in smc_law_gains, or give gains="
            )

    def all(self, modelled: bool) -> None:
        """Every kind of run; and states at the end of the finite world, where it may give up."""
        steps = LONG
        for model in (1.0,) if modelled else (0.0, 1.0):
            for surfaced in (0.0, 1.0):
                self.run(model, surfaced, 1.0 - 2.0 * surfaced, steps)
                steps = STEPS
        for e in (-1e6, -1e3, 0.0, 1e3, 1e6):
            for de in (-1e6, 0.0, 1e6):
                y = [0.0, 1e-3, e, de, e, de, *[0.0] * 4, 1.0, 0.0, 6.0, 1.0, *[0.0] * 7]
                self.calls.write(struct.pack("21d", *y))
                self.call(y, Fenced([0.0] * self.size))
        self.alone()


def attempt(order, told) -> None:
    """Load, set up and where asked call a law; how far it came, and what its file says of it, go to `told`."""
    print("loading", file=told)
    law, library = entry(order["library"], order["symbol"])
    if altered():
        raise Found(f"loading it {ALTERS}: {CURES[ALTERED]}")
    print("smc_setup", file=told)
    if code := set_up(library):
        raise Found(f"smc_setup returned {code}: mend it")
    if altered():
        raise Found(f"smc_setup {ALTERS}: {CURES[ALTERED]}")
    if trial := order["trial"]:
        print(order["symbol"], file=told)
        sized(library, len(trial["gains"]), trial["memory"])
        base = ctypes.cast(law, ctypes.c_void_p).value - trial["anchor"]
        data = [(name, base + at, size) for name, at, size in trial["data"]]
        with Path(trial["calls"]).open("wb") as calls:
            try:
                Trial(law, library, trial["gains"], trial["memory"], data, calls).all(trial["modelled"])
            except Found as found:
                raise Found(f"{order['symbol']} {found}") from None
    print(json.dumps(facts(library)), file=told)
    print("unloading", file=told)


def main(asked: str) -> None:
    """Do what a JSON file asks."""
    order = json.loads(Path(asked).read_text())
    with Path(order["told"]).open("w", buffering=1) as told:
        try:
            attempt(order, told)
        except (Found, OSError, AttributeError) as error:
            print(f"{type(error).__name__} {error}", file=told)


if __name__ == "__main__":
    main(sys.argv[1])
