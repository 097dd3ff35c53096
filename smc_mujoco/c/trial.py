"""A law's library tried in a process of its own, which it may take down: loaded, set up, called.

It runs as a script and imports nothing but Python's own. It tells how far it came by lines in a file: the last one
names what was going on when the process died, or what was found.
"""

import ctypes
import json
import math
import os
import random
import struct
import sys
from collections.abc import Iterator
from pathlib import Path

STEPS = 500  # samples of 1 ms in each of the runs
BEYOND = 2**40  # what the glue returns where a law of floats wrote beyond its memory; one more: beyond out
GUARD, PLAY = -7.25, 512  # a value that no law writes by chance; how many of them lie on either side of its numbers
MORE = 16  # gains beyond those that have names, given to see whether it reads them
PAGE = 4096  # bytes to which addresses of segments are rounded, or a multiple
SHARED = "which all channels and simulations share, on several threads"
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


def set_up(library) -> int:
    """Call smc_setup where there is one; its code."""
    return int(library.smc_setup()) if hasattr(library, "smc_setup") else 0


def sized(library, gains: int, memory: int) -> None:
    """Tell the glue how many gains and numbers of memory there are."""
    if hasattr(library, "smc_mujoco_entry"):
        ctypes.c_int.in_dll(library, "smc_mujoco_gains").value = gains
        ctypes.c_int.in_dll(library, "smc_mujoco_memory").value = memory


def writable(path: str) -> list[tuple[int, int]]:
    """Address and size of what a loaded library may change, static variables among it; on 64-bit Linux, else none."""
    real = os.path.realpath(path)
    try:
        maps = [line for line in Path("/proc/self/maps").read_text().splitlines() if line.endswith(f" {real}")]
        image = Path(path).read_bytes()
    except OSError:
        return []
    if not maps or image[:6] != b"\x7fELF\x02\x01":
        return []
    found = list(segments(image))
    base = min(int(line.partition("-")[0], 16) for line in maps) - min(at for at, _, _ in found) // PAGE * PAGE
    return [(base + at, size) for at, size, flags in found if flags & 2]  # PF_W


def segments(image: bytes) -> Iterator[tuple[int, int, int]]:
    """Address, size and flags of what an ELF file of 64 bits loads (elf(5): Elf64_Ehdr, Elf64_Phdr)."""
    (table,) = struct.unpack_from("<Q", image, 32)
    width, count = struct.unpack_from("<HH", image, 54)
    for i in range(count):
        kind, flags, _, at, _, _, size = struct.unpack_from("<IIQQQQQ", image, table + width * i)
        if kind == 1:  # PT_LOAD
            yield at, size, flags


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
    """Runs of a law on a double integrator x'' = u, and calls far away from it."""

    def __init__(self, law, library, gains: list[float], memory: int):
        self.law, self.library, self.size = law, library, memory
        self.writable = writable(library._name)
        self.static = self.statics()
        self.gains = Fenced(gains, math.nan)  # what it reads of more gains than it has ends in u
        self.held = bytes(self.gains.whole)
        self.random = random.Random(0)

    def call(self, y: list[float], memory: Fenced) -> tuple[int, float, float]:
        """The law's code, u and s; Found where it writes where nothing is its own."""
        given, out = Fenced(y), Fenced([math.nan, math.nan])
        before = bytes(given.whole)
        code = self.law(given.own, self.gains.own, memory.own, out.own)
        if code == BEYOND or memory.passed():
            raise Found(
                f"writes beyond the {self.size} numbers of its memory: say more in smc_law_memory, or give memory="
            )
        if code == BEYOND + 1 or out.passed():
            raise Found("writes beyond the two numbers of out, u and s: write out[0] and out[1] alone")
        if bytes(self.gains.whole) != self.held or bytes(given.whole) != before:
            raise Found("changes its gains or its measurement: keep what changes in memory")
        return code, out.own[0], out.own[1]

    def run(self, model: float, surfaced: float, x: float) -> None:
        """A run with measurement noise and a sine for reference."""
        v, dt, memory = 0.0, 1e-3, Fenced([0.0] * self.size)
        for k in range(STEPS):
            t = k * dt
            r, dr, ddr = 0.1 * math.sin(t), 0.1 * math.cos(t), -0.1 * math.sin(t)
            e, de = x + self.random.gauss(0.0, 1e-3) - r, v + self.random.gauss(0.0, 1e-2) - dr
            slid = [1.0, de + 2.0 * e, -2.0 * de] if surfaced else [0.0] * 3
            y = [t, dt, e + r, de + dr, e, de, r, dr, ddr, 0.0, 1.0, ddr, 6.0, model, *slid, 0.1 * e, 0.0, 0.0, 1.0]
            before = Fenced(memory.own[:])
            code, u, s = self.call(y, memory)
            if code != 0 or not (math.isfinite(u) and math.isfinite(s)):
                self.starved(y, before)
                said = code or f"u = {u}, s = {s}"
                raise Found(f"returned {said} at t = {t:g}, e = {e:g}, de = {de:g}: mend it, or the gains")
            if k % 50 == 0:
                self.alone()
                if repr(self.call(y, before)) != repr((code, u, s)):
                    raise Found(f"gave two answers to one measurement, as from state {SHARED}: keep it in memory")
            v += dt * min(max(u, -6.0), 6.0)
            x += dt * v

    def statics(self) -> list[bytes]:
        """The static data of now."""
        return [ctypes.string_at(at, size) for at, size in self.writable]

    def alone(self) -> None:
        """Found where it has changed what other simulations see."""
        if self.statics() != self.static:
            raise Found(f"changes static data, {SHARED}: keep state in memory, and fill tables in smc_setup")

    def starved(self, y: list[float], memory: Fenced) -> None:
        """Found where u is a number once there are more gains than were named."""
        count, out = self.gains.count, Fenced([math.nan, math.nan])
        sized(self.library, count + MORE, self.size)
        code = self.law(Fenced(y).own, Fenced([*self.gains.own, *[1.0] * MORE]).own, memory.own, out.own)
        sized(self.library, count, self.size)
        if code == 0 and all(map(math.isfinite, out.own)):
            raise Found(
                f"reads more gains than the {count} that have names: name them in smc_law_gains, or give gains="
            )

    def all(self, modelled: bool) -> None:
        """Every kind of run; and states at the end of the finite world, where it may give up."""
        for model in (1.0,) if modelled else (0.0, 1.0):
            for surfaced in (0.0, 1.0):
                self.run(model, surfaced, 1.0 - 2.0 * surfaced)
        for e in (-1e6, -1e3, 0.0, 1e3, 1e6):
            for de in (-1e6, 0.0, 1e6):
                y = [0.0, 1e-3, e, de, e, de, *[0.0] * 4, 1.0, 0.0, 6.0, 1.0, *[0.0] * 7]
                self.call(y, Fenced([0.0] * self.size))
        self.alone()


def main(asked: str) -> None:
    """Do what a JSON text asks: library, symbol, gains, memory, whether to call the law, and the file to tell."""
    order = json.loads(asked)
    with Path(order["told"]).open("w", buffering=1) as told:
        print("loading", file=told)
        try:
            law, library = entry(order["library"], order["symbol"])
            print("smc_setup", file=told)
            if code := set_up(library):
                raise Found(f"smc_setup returned {code}: mend it")
            if order["call"]:
                print(order["symbol"], file=told)
                sized(library, len(order["gains"]), order["memory"])
                try:
                    Trial(law, library, order["gains"], order["memory"]).all(order["modelled"])
                except Found as found:
                    raise Found(f"{order['symbol']} {found}") from None
            print("fine", file=told)
        except (Found, OSError, AttributeError) as error:
            print(f"{type(error).__name__} {error}", file=told)


if __name__ == "__main__":
    main(sys.argv[1])
