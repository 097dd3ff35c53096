"""Try a law's library in a separate process, which may crash, and report the result in one
sentence.

`worker`, in the process of `common.guard`, loads the library, sets it up, calls the law on
request, and unloads it. The process must start quickly, so the functions that start it, and only
they, import more of smc_mujoco.
"""

import ctypes
import itertools
import math
import os
import random
import re
import struct
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from smc_mujoco.common.guard import ALTERS, Arithmetic, Failed, Fault, run_isolated

STEPS, LONG_STEPS = 500, 10_000  # samples of 1 ms per run, and in the longest run
LATER_STEPS, TIME_RATIO = (
    200,
    1.06,
)  # samples after those, and the ratio of successive times: up to 15 hours
MAX_POSITION = 3.0  # a stop for the double integrator, because a law need not stabilise it
GUARD_VALUE, GUARD_COUNT = (
    -7.25,
    512,
)  # a value that no law writes by chance, and its number on either side of an array
MASS_COUPLING = 0.1  # elements of M off its diagonal
OVERRUN = 2**40  # code of glue.c: a law of floats wrote beyond its memory; one more: beyond out
ALTERED_ARITHMETIC = OVERRUN + 2  # code of glue.c: a law changed the arithmetic of its thread
FAULTS = {  # code -> fault, formatted with the size of memory, and cure
    OVERRUN: (
        "writes beyond the {} numbers of its memory",
        "say more in smc_law_memory, or give memory=",
    ),
    OVERRUN + 1: (
        "writes beyond the numbers of out",
        "write only u and s, which are out[0] and out[1] for one channel",
    ),
    OVERRUN + 4: ("changes its measurement", "keep what changes in memory"),
    OVERRUN + 3: (
        "asks for the Jacobian of a tip, and there is none",
        "give the plant a tip, and the law the model",
    ),
    ALTERED_ARITHMETIC: (ALTERS, "let it restore that, and leave out -Ofast and -ffast-math"),
}
TWO_ANSWERS = (
    "gave two answers to one measurement, as from state which all channels and simulations share, on several threads: "
    "keep it in memory"
)
INT_NAMES = (
    "smc_law_memory",
    "smc_law_real",
    "smc_law_degree",
    "smc_law_modelled",
    "smc_mujoco_joints",
)
TEXT_NAMES = ("smc_law_gains", "smc_law_shared")
DOUBLES = ctypes.POINTER(ctypes.c_double)
ON_REQUEST = ctypes.CFUNCTYPE(
    ctypes.c_int64, *[DOUBLES] * 4
)  # C(x, v) w, or the Jacobian of the tip
# Output of the sanitizers: undefined behaviour; a bad access, and the stack frames it happened in.
UNDEFINED_LINE = re.compile(
    r"^(?P<file>.+?):(?P<line>\d+):\d+: runtime error: (?P<what>.*)$", re.MULTILINE
)
ACCESS_LINE = re.compile(
    r"AddressSanitizer: (?P<what>[\w-]+).*(?:\n(?P<size>(?:READ|WRITE) of size \d+))?"
)
FRAME_LINE = re.compile(r"^ +#\d+ .* in \S+ (?P<file>.+?):(?P<line>\d+)(?::\d+)?$", re.MULTILINE)


class Library(NamedTuple):
    """A law's library, not loaded into this process."""

    file: Path  # the library, compiled or copied
    path: Path  # the user's file
    symbol: str  # name of the law's function
    flags: Sequence[str]  # of the compiler
    timeout: float  # of a trial, s
    warnings: Sequence[str] = ()  # of the compiler


def load(library: Library, trial: dict[str, Any] | None = None) -> dict[str, Any]:
    """Load, set up, try and unload a library in a separate process, and return the constants that
    describe its law.

    `trial`: "fields", names of the numbers in a measurement, or of the arrays in one of many
    "joints"; "gains", each gain's number for each channel; "memory" and "modelled" as in smc_law.h;
    "calls", a new file for the gains and the measurement of each call, which `sanitize` reads.
    None: the law is not called.
    """
    from smc_mujoco.common.errors import ScenarioError
    from smc_mujoco.exchange.c import build

    words = {"library": str(library.file), "symbol": library.symbol, "trial": trial}
    try:
        return run_isolated(__name__, words, library.timeout)
    except Failed as failed:
        why = str(failed).replace(str(library.file), library.path.name)
        file = library.path.name
        if (
            library.symbol in why
            and failed.stage == "loading"
            and re.search("undefined symbol|not found", why)
        ):
            raise ScenarioError(build.undefined(library.path, library.symbol)) from None
        raise ScenarioError(
            f"{file} {why}" if why.startswith("cannot") else f"{file}: {why}"
        ) from None


def sanitize(library: Library, calls: Path, gains: int, memory: int) -> str:
    """Repeat the calls of a trial with sanitizers.

    Return why this is not possible, or an empty text.
    """
    from smc_mujoco.common.errors import ScenarioError
    from smc_mujoco.common.process import TimedOut, timed
    from smc_mujoco.exchange.c import build

    compiler = build.compiler()
    if library.path.suffix != ".c":
        return "give its .c file"
    if (program := build.replayer(tuple(compiler))) is None:
        return f"{compiler[0]} has none that work here"
    try:
        file, _ = build.library(
            library.path, library.symbol, (*library.flags, *build.SANITIZER_FLAGS), library.timeout
        )
    except ScenarioError:
        return f"{compiler[0]} has none with these flags"
    try:
        done = timed([str(n) for n in (program, file, calls, gains, memory)], library.timeout)
    except TimedOut:
        late = f"{library.symbol} did not end within {library.timeout:g} s with sanitizers"
        raise ScenarioError(f"{library.path.name}: {late}: give timeout=") from None
    if done.returncode == 0:
        return ""
    what = "it does not end as without sanitizers"
    places = []
    if report := UNDEFINED_LINE.search(done.stderr):
        what = report["what"]
        places = [report]
    elif report := ACCESS_LINE.search(done.stderr):
        what = ", ".join(filter(None, report.group("what", "size")))
        places = []
        for frame in FRAME_LINE.finditer(done.stderr):
            if Path(frame["file"]).exists():
                places.append(frame)
    if places:
        name = Path(places[0]["file"]).name
    else:
        name = library.path.name
    if places:
        where = f"line {places[0]['line']}"
    else:
        where = library.symbol
    raise ScenarioError(f"{name} makes an error in {where}: {what}; fix it")


# libraries through ctypes, in the separate process and in the one that runs the law


def entry(path: str, symbol: str):
    """Return the law's ctypes function, and its library."""
    library = ctypes.CDLL(path, mode=getattr(os, "RTLD_NOW", 0) | getattr(os, "RTLD_LOCAL", 0))
    glued = hasattr(library, "smc_mujoco_entry")
    function = getattr(library, "smc_mujoco_entry" if glued else symbol)
    function.restype = ctypes.c_int64 if glued else ctypes.c_int
    function.argtypes = [DOUBLES] * 4
    return function, library


def facts(library) -> dict[str, str | int]:
    """Return the constants of smc_law.h that a library defines, and whether it contains the glue."""
    constants: dict[str, str | int] = {"glue": hasattr(library, "smc_mujoco_entry")}
    for name in TEXT_NAMES:
        if hasattr(library, name):
            text = ctypes.string_at(ctypes.addressof(ctypes.c_char.in_dll(library, name)))
            constants[name] = text.decode(errors="replace")
    return constants | {
        name: ctypes.c_int.in_dll(library, name).value
        for name in INT_NAMES
        if hasattr(library, name)
    }


def set_up(library) -> int:
    """Return the result of smc_setup; 0 if the library has none."""
    if hasattr(library, "smc_setup"):
        return int(library.smc_setup())
    return 0


def set_sizes(library, gains: int, memory: int) -> None:
    """Set the number of gains and of memory slots in the glue, if the library contains it."""
    if hasattr(library, "smc_mujoco_entry"):
        ctypes.c_int.in_dll(library, "smc_mujoco_gains").value = gains
        ctypes.c_int.in_dll(library, "smc_mujoco_memory").value = memory


def doubles(values) -> ctypes.Array:
    """Return an array of C doubles."""
    return (ctypes.c_double * len(values))(*values)


class Requests:
    """C functions that compute what a law of many joints asks for.

    They are valid as long as this object lives.

    `coriolis`: a list w -> the numbers of C(x, v) w. `jacobian` returns the numbers of the tip's
    Jacobian by rows, or raises ValueError if there is none. `address` is that of a table with the
    addresses of both functions and of their parameters, and with the force per unit of u.
    """

    def __init__(self, joints: int, coriolis: Callable, jacobian: Callable):
        def answer(out, function, *arguments) -> int:
            try:
                for i, number in enumerate(function(*arguments)):
                    out[i] = number
            except ValueError:
                return 1
            return 0

        product = ON_REQUEST(lambda w, parameters, memory, out: answer(out, coriolis, w[:joints]))
        tip = ON_REQUEST(lambda nothing, parameters, memory, out: answer(out, jacobian))
        self.joints = joints
        self.functions = (product, tip)
        addresses = [
            float(ctypes.cast(function, ctypes.c_void_p).value or 0) for function in self.functions
        ]
        self.table = doubles([*addresses, 0.0, 1.0])
        self.address = ctypes.addressof(self.table)


def stored(head, requests: Requests, arrays) -> list[float]:
    """Return the numbers of a joint measurement from t, dt and model and its arrays, see
    `joint_law.measurement_at`.
    """
    return [*head, float(requests.address), requests.joints, *itertools.chain.from_iterable(arrays)]


# in the separate process


class Fenced:
    """An array between guards, which a law must not write."""

    def __init__(self, values, guard: float = GUARD_VALUE):
        edge = [guard] * GUARD_COUNT
        self.whole = doubles([*edge, *values, *edge])
        self.values = (ctypes.c_double * len(values)).from_buffer(self.whole, 8 * GUARD_COUNT)
        self.before = self.guards()

    def guards(self) -> bytes:
        """Return the bytes of the guards."""
        whole = bytes(self.whole)
        return whole[: 8 * GUARD_COUNT] + whole[-8 * GUARD_COUNT :]

    def crossed(self) -> bool:
        """Return whether a guard has changed."""
        return self.guards() != self.before


class Trial:
    """Runs of a law on a double integrator x'' = u for each channel, and calls far outside of them.

    `order`: the trial of `load`. `calls`: its open file.
    """

    def __init__(self, law, order, calls):
        self.calls = calls
        self.law = law
        self.fields = order["fields"]
        self.size = order["memory"]
        self.modelled = order["modelled"]
        self.joints = order["joints"]
        self.channels = max(1, order["joints"])
        self.requests = Requests(
            self.joints, lambda w: [0.1 * element for element in w], self.jacobian
        )
        self.y, self.out = (
            Fenced(self.measurement([{}] * self.channels)),
            Fenced([0.0] * (2 * self.channels)),
        )
        self.gains = Fenced(order["gains"], math.nan)  # a gain without a name is NaN
        self.gains_before = bytes(self.gains.whole)
        calls.write(bytes(self.gains.values))
        self.random = random.Random(0)
        self.arithmetic = Arithmetic()
        self.first: list[
            tuple[list[float], str]
        ] = []  # measurements of the first calls, and the law's answers

    def all(self) -> None:
        """Make every kind of run, and calls at very large errors, at which a law may return an
        error.
        """
        steps = LONG_STEPS
        for model in (1.0,) if self.modelled else (0.0, 1.0):
            for surfaced in (0.0,) if self.joints else (0.0, 1.0):
                self.run(model, surfaced, 1.0 - 2.0 * surfaced, steps)
                steps = STEPS
        for e in (-1e6, -1e3, 0.0, 1e3, 1e6):
            for de in (-1e6, 0.0, 1e6):
                far = {
                    "dt": 1e-3,
                    "x": e,
                    "v": de,
                    "e": e,
                    "de": de,
                    "g": 1.0,
                    "limit": 6.0,
                    "model": 1.0,
                }
                self.call(self.measurement([far] * self.channels), self.state())
        memory = self.state()
        for (
            y,
            answer,
        ) in self.first:  # by now, state that is kept elsewhere is not as it was at the first call
            if repr(self.answer(y, memory)) != answer:
                raise Fault(TWO_ANSWERS)

    def run(self, model: float, surfaced: float, x0: float, steps: int) -> None:
        """Make a run with measurement noise and a sine as reference.

        After `steps` the time grows geometrically.
        """
        xs = [x0 - 0.1 * i for i in range(self.channels)]
        vs = [0.0] * self.channels
        dt = 1e-3
        memory = self.state()
        for k in range(steps + LATER_STEPS):
            t = dt * (k if k < steps else steps * TIME_RATIO ** (k - steps))
            seen = []
            r = 0.1 * math.sin(t)
            dr = 0.1 * math.cos(t)
            ddr = -0.1 * math.sin(t)
            for x, v in zip(xs, vs, strict=True):
                e = x + self.random.gauss(0.0, 1e-3) - r
                de = v + self.random.gauss(0.0, 1e-2) - dr
                channel = {
                    "t": t,
                    "dt": dt,
                    "x": e + r,
                    "v": de + dr,
                    "e": e,
                    "de": de,
                    "r": r,
                    "dr": dr,
                    "ddr": ddr,
                }
                channel |= {
                    "g": 1.0,
                    "a": ddr,
                    "limit": 6.0,
                    "model": model,
                    "q": 0.1 * e,
                    "gq": 1.0,
                }
                if surfaced:
                    channel |= {"has_surface": 1.0, "s": de + 2.0 * e, "v_eq": -2.0 * de}
                seen.append(channel)
            y = self.measurement(seen)
            before = bytes(memory.values)
            code, us, ss = self.call(y, memory)
            for i, (channel, u, s) in enumerate(zip(seen, us, ss, strict=True)):
                if code != 0 or not (math.isfinite(u) and math.isfinite(s)):
                    what = code or f"u = {u}, s = {s}"
                    joint = f" of joint {i}" * bool(self.joints and not code)
                    where = f"t = {t:g}, e = {channel['e']:g}, de = {channel['de']:g}"
                    cure = (
                        "fix it, or name all gains that it reads in smc_law_gains, or give gains="
                    )
                    raise Fault(f"returned {what}{joint} at {where}: {cure}")
            if k % 50 == 0 and repr(self.answer(y, self.state(before))) != repr((code, us, ss)):
                raise Fault(TWO_ANSWERS)
            if len(self.first) < STEPS:
                self.first.append((y, repr((code, us, ss))))
            for i, u in enumerate(us):
                vs[i] += dt * min(max(u, -6.0), 6.0)
                xs[i] += dt * vs[i]
                if abs(xs[i]) > MAX_POSITION:
                    xs[i], vs[i] = math.copysign(MAX_POSITION, xs[i]), 0.0

    def measurement(self, seen: list[dict[str, float]]) -> list[float]:
        """Return the numbers of a measurement in their order, from those of each channel.

        Those left out are 0.
        """
        if not self.joints:
            return [seen[0].get(name, 0.0) for name in self.fields]
        M = []
        for i in range(self.joints):
            for j in range(self.joints):
                M.append(1.0 if i == j else MASS_COUPLING)
        known = {"M": M, "h": [0.0] * self.joints, "g": [0.0] * self.joints}
        arrays = []
        for name in self.fields:
            arrays.append(known.get(name) or [channel.get(name, 0.0) for channel in seen])
        return stored(
            [seen[0].get(name, 0.0) for name in ("t", "dt", "model")], self.requests, arrays
        )

    def jacobian(self) -> list[float]:
        """Return the Jacobian of a tip that the first three joints move."""
        return [float(row == i) for row in range(3) for i in range(self.joints)]

    def state(self, saved: bytes = b"") -> Fenced:
        """Return a memory of zeros, or with saved content."""
        count = self.size * self.channels
        return Fenced(struct.unpack(f"{count}d", saved) if saved else [0.0] * count)

    def call(self, y: list[float], memory: Fenced) -> tuple[int, list[float], list[float]]:
        """Record the call for the sanitizers, and return what the law answers."""
        self.calls.write(struct.pack(f"{len(y)}d", *y))
        return self.answer(y, memory)

    def answer(self, y: list[float], memory: Fenced) -> tuple[int, list[float], list[float]]:
        """Return the law's code, u and s. Raise Fault if it writes anything but memory and out."""
        self.y.values[:], self.out.values[:] = y, [math.nan] * len(self.out.values)
        y_before = bytes(self.y.whole)
        code = self.law(self.y.values, self.gains.values, memory.values, self.out.values)
        if memory.crossed():
            code = OVERRUN
        elif self.out.crossed():
            code = OVERRUN + 1
        elif self.arithmetic.changed():
            code = ALTERED_ARITHMETIC
        if code in FAULTS:
            what, cure = FAULTS[code]
            raise Fault(f"{what.format(self.size)}: {cure}")
        if bytes(self.gains.whole) != self.gains_before or bytes(self.y.whole) != y_before:
            raise Fault("changes its gains or its measurement: keep what changes in memory")
        return code, self.out.values[: self.channels], self.out.values[self.channels :]


def worker(job: Mapping[str, Any], report: Callable) -> dict[str, str | int]:
    """Load, set up and on request call a law. Return the library's constants."""
    arithmetic = Arithmetic()
    symbol = job["symbol"]

    def done(step: str) -> None:
        if arithmetic.changed():
            raise Fault(f"{step} {ALTERS}: {FAULTS[ALTERED_ARITHMETIC][1]}")

    report("loading")
    try:
        law, library = entry(job["library"], symbol)
    except (OSError, AttributeError) as error:
        raise Fault(
            f"cannot be loaded ({error}): build it for this machine, with all it needs"
        ) from None
    done("loading it")
    report("smc_setup")
    if code := set_up(library):
        raise Fault(f"smc_setup returned {code}: fix it")
    done("smc_setup")
    if trial := job["trial"]:
        report(symbol)
        set_sizes(library, len(trial["gains"]) // max(1, trial["joints"]), trial["memory"])
        try:
            with Path(trial["calls"]).open("wb") as calls:
                Trial(law, trial, calls).all()
        except Fault as fault:
            raise Fault(f"{symbol} {fault}") from None
    return facts(library)
