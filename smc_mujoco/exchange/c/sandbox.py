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
from collections.abc import Callable, Generator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from smc_mujoco.common.guard import ALTERS, Arithmetic, Failed, Fault, run_isolated

STEPS = 500  # samples of 1 ms of a run
MAX_POSITION = 3.0  # m, of the double integrators of a trial
MAX_COMMAND = 6.0  # N, bound on u in a trial
GUARD = [-7.25] * 512  # on either side of an array: values that no law writes by chance
MASS_COUPLING = 0.1  # elements of M off its diagonal
BEYOND = 2**40  # codes of glue.c from here on
FAULTS = {  # code -> fault, formatted with the size of memory, and cure
    BEYOND: (
        "writes beyond the {} numbers of its memory",
        "say more in smc_law_memory, or give memory=",
    ),
    BEYOND + 1: (
        "writes beyond the numbers of out",
        "write only u and s, which are out[0] and out[1] for one channel",
    ),
    BEYOND + 3: (
        "asks for the Jacobian of a tip, and there is none",
        "give the plant a tip, and the law the model",
    ),
    BEYOND + 4: ("changes its measurement", "keep what changes in memory"),
}
TWO_ANSWERS = (
    "gave two answers to one measurement, as from state which all channels and simulations share, "
    "on several threads: keep it in memory"
)
INTS = (
    "smc_law_memory",
    "smc_law_real",
    "smc_law_degree",
    "smc_law_modelled",
    "smc_mujoco_joints",
)
DOUBLES = ctypes.POINTER(ctypes.c_double)
# C(x, v) w, or the Jacobian of the tip
ON_REQUEST = ctypes.CFUNCTYPE(ctypes.c_int64, *[DOUBLES] * 4)


class Library(NamedTuple):
    """A law's library, not loaded into this process."""

    file: Path  # the library, compiled or copied
    path: Path  # the user's file
    symbol: str  # name of the law's function
    timeout: float  # of a trial, s
    warnings: Sequence[str] = ()  # of the compiler


def load(library: Library, trial: dict[str, Any] | None = None) -> dict[str, Any]:
    """Load, set up, try and unload a library in a separate process, and return the constants that
    describe its law.

    `trial`: "fields", names of the numbers in a measurement, or of the arrays in one of many
    "joints"; "gains", each gain's number for each channel; "memory" and "modelled" as in smc_law.h.
    None: the law is not called.
    """
    from smc_mujoco.common.errors import ScenarioError
    from smc_mujoco.exchange.c import build

    words = {"library": str(library.file), "symbol": library.symbol, "trial": trial}
    try:
        return run_isolated(__name__, words, library.timeout)
    except Failed as failed:
        why = str(failed).replace(str(library.file), library.path.name)
        missing = re.search("undefined symbol|not found", why) and library.symbol in why
        if missing and failed.stage == "loading":
            raise ScenarioError(build.undefined(library.path, library.symbol)) from None
        colon = "" if why.startswith("cannot") else ":"
        raise ScenarioError(f"{library.path.name}{colon} {why}") from None


# libraries through ctypes, in the separate process and in the one that runs the law


def entry(path: str, symbol: str):
    """Return the law's ctypes function, and its library."""
    library = ctypes.CDLL(path, mode=getattr(os, "RTLD_NOW", 0) | getattr(os, "RTLD_LOCAL", 0))
    glued = hasattr(library, "smc_mujoco_entry")
    function = getattr(library, "smc_mujoco_entry" if glued else symbol)
    function.restype = ctypes.c_int64 if glued else ctypes.c_int
    function.argtypes = [DOUBLES] * 4
    return function, library


def facts(library) -> dict[str, Any]:
    """Return the constants of smc_law.h that a library defines, and whether it has the glue."""
    constants: dict[str, Any] = {"glue": hasattr(library, "smc_mujoco_entry")}
    for name in ("smc_law_gains", "smc_law_shared"):
        if hasattr(library, name):
            text = ctypes.string_at(ctypes.addressof(ctypes.c_char.in_dll(library, name)))
            constants[name] = text.decode(errors="replace")
    for name in INTS:
        if hasattr(library, name):
            constants[name] = ctypes.c_int.in_dll(library, name).value
    return constants


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
    sizes = requests.joints, requests.joints
    return [*head, float(requests.address), *sizes, *itertools.chain.from_iterable(arrays)]


# in the separate process


class Fenced:
    """An array between guards, which a law must not write."""

    def __init__(self, values: Sequence[float]):
        self.whole = doubles([*GUARD, *values, *GUARD])
        self.values = (ctypes.c_double * len(values)).from_buffer(self.whole, 8 * len(GUARD))

    def crossed(self) -> bool:
        """Return whether a guard has changed."""
        count = len(GUARD)
        return [*self.whole[:count], *self.whole[-count:]] != 2 * GUARD


def double_integrators(
    channels: int, dt: float, draws: random.Random
) -> Generator[list[dict[str, float]], list[float], None]:
    """Yield what is measured of x'' = u of each channel every dt, s, with noise and a sine as
    reference; take the commands, N.

    Positions stop at MAX_POSITION, because a law need not stabilise them.
    """
    xs = [1.0 - 0.1 * i for i in range(channels)]
    vs = [0.0] * channels
    for k in itertools.count():
        t = dt * k
        r = 0.1 * math.sin(t)
        dr = 0.1 * math.cos(t)
        common = {"t": t, "dt": dt, "r": r, "dr": dr, "ddr": -r, "a": -r, "limit": MAX_COMMAND}
        common |= {"g": 1.0, "gq": 1.0, "model": 1.0}
        seen = []
        for x, v in zip(xs, vs, strict=True):
            e = x + draws.gauss(0.0, 1e-3) - r
            de = v + draws.gauss(0.0, 1e-2) - dr
            seen.append(common | {"x": e + r, "v": de + dr, "e": e, "de": de, "q": 0.1 * e})
        for i, u in enumerate((yield seen)):
            vs[i] += dt * min(max(u, -MAX_COMMAND), MAX_COMMAND)
            xs[i] += dt * vs[i]
            if abs(xs[i]) > MAX_POSITION:
                xs[i] = math.copysign(MAX_POSITION, xs[i])
                vs[i] = 0.0


class Trial:
    """Runs of a law on a double integrator x'' = u for each channel.

    `order`: the trial of `load`.
    """

    def __init__(self, law: Callable, order: Mapping[str, Any]):
        self.law = law
        self.fields = order["fields"]
        self.size = order["memory"]
        self.modelled = order["modelled"]
        self.joints = order["joints"]
        self.channels = max(1, order["joints"])
        self.requests = Requests(
            self.joints, lambda w: [0.1 * element for element in w], self.jacobian
        )
        # what is beyond the gains that have a name is NaN
        self.gains = doubles([*order["gains"], *[math.nan] * len(GUARD)])
        self.random = random.Random(0)

    def all(self) -> None:
        """Make runs with the nominal model, without it, and with a surface, where the law can."""
        ways = [(1.0, 0.0)]
        if not self.modelled:
            ways.append((0.0, 0.0))
        if not self.joints:
            ways.append((1.0, 1.0))
        for model, surface in ways:
            self.run(model, surface)

    def run(self, model: float, surface: float) -> None:
        """Make a run with measurement noise and a sine as reference."""
        memory = self.state()
        motion = double_integrators(self.channels, 1e-3, self.random)
        seen = next(motion)
        for k in range(STEPS):
            for channel in seen:
                channel |= {"model": model, "has_surface": surface}
                if surface:
                    e, de = channel["e"], channel["de"]
                    channel |= {"s": de + 2.0 * e, "v_eq": -2.0 * de}
            y = self.measurement(seen)
            before = bytes(memory.values)
            answer = self.answer(y, memory)
            self.check(seen, *answer)
            if k % 50 == 0 and repr(self.answer(y, self.state(before))) != repr(answer):
                raise Fault(TWO_ANSWERS)
            seen = motion.send(answer[1])

    def check(
        self, seen: Sequence[Mapping[str, float]], code: int, us: list[float], ss: list[float]
    ) -> None:
        """Raise Fault for a code other than 0, or for a u or s that is not finite."""
        for i, (channel, u, s) in enumerate(zip(seen, us, ss, strict=True)):
            if code == 0 and math.isfinite(u) and math.isfinite(s):
                continue
            what = str(code)
            if code == 0:
                what = f"u = {u}, s = {s}"
                if self.joints:
                    what += f" of joint {i}"
            where = f"t = {channel['t']:g}, e = {channel['e']:g}, de = {channel['de']:g}"
            cure = "fix it, or name all gains that it reads in smc_law_gains, or give gains="
            raise Fault(f"returned {what} at {where}: {cure}")

    def measurement(self, seen: list[dict[str, float]]) -> list[float]:
        """Return the numbers of a measurement in their order, from those of each channel.

        Those left out are 0.
        """
        if not self.joints:
            return [seen[0].get(name, 0.0) for name in self.fields]
        n = self.joints
        M = [MASS_COUPLING] * (n * n)
        M[:: n + 1] = [1.0] * n
        known = {"M": M, "h": [0.0] * n, "g": [0.0] * n}
        arrays = [
            known.get(name) or [channel.get(name, 0.0) for channel in seen] for name in self.fields
        ]
        head = [seen[0][name] for name in ("t", "dt", "model")]
        return stored(head, self.requests, arrays)

    def jacobian(self) -> list[float]:
        """Return the Jacobian of a tip that the first three joints move."""
        return [float(row == i) for row in range(3) for i in range(self.joints)]

    def state(self, saved: bytes = b"") -> Fenced:
        """Return a memory of zeros, or with saved content."""
        count = self.size * self.channels
        return Fenced(struct.unpack(f"{count}d", saved or bytes(8 * count)))

    def answer(self, y: list[float], memory: Fenced) -> tuple[int, list[float], list[float]]:
        """Return the law's code, u and s. Raise Fault if it writes anything but memory and out."""
        given = doubles(y)
        out = Fenced([math.nan] * (2 * self.channels))
        before = bytes(given) + bytes(self.gains)
        code = self.law(given, self.gains, memory.values, out.values)
        if memory.crossed():
            code = BEYOND
        elif out.crossed():
            code = BEYOND + 1
        if code in FAULTS:
            what, cure = FAULTS[code]
            raise Fault(f"{what.format(self.size)}: {cure}")
        if bytes(given) + bytes(self.gains) != before:
            raise Fault("changes its gains or its measurement: keep what changes in memory")
        return code, out.values[: self.channels], out.values[self.channels :]


def worker(job: Mapping[str, Any], report: Callable) -> dict[str, Any]:
    """Load, set up and on request call a law. Return the library's constants."""
    arithmetic = Arithmetic()
    symbol = job["symbol"]
    report("loading")
    try:
        law, library = entry(job["library"], symbol)
    except (OSError, AttributeError) as error:
        raise Fault(
            f"cannot be loaded ({error}): build it for this machine, with all it needs"
        ) from None
    report("smc_setup")
    if code := set_up(library):
        raise Fault(f"smc_setup returned {code}: fix it")
    if arithmetic.changed():
        raise Fault(f"loading it {ALTERS}: leave out -Ofast and -ffast-math")
    if trial := job["trial"]:
        report(symbol)
        set_sizes(library, len(trial["gains"]) // max(1, trial["joints"]), trial["memory"])
        try:
            Trial(law, trial).all()
        except Fault as fault:
            raise Fault(f"{symbol} {fault}") from None
    return facts(library)
