"""Foreign machine code (laws in C, FMUs, policies, models): tried in another process, and watched
in our own.

The process of a trial runs this file as a script. It may crash, hang or fill its memory: it has
limits, and ends with everything that it has started. It reports its progress as lines in a file.
The last line is the stage at which it died, a fault, or "unloading". What is tried must load
quickly, so only functions of this file import smc_mujoco.
"""

import contextlib
import ctypes
import functools
import importlib
import json
import os
import signal
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

MAX_MEMORY = 4 * 2**30  # bytes that a trial may have: chosen
MAX_FILE = 10**9  # bytes of a file that a trial writes: chosen
MAX_PROGRESS = 10**7  # bytes of a report: chosen
BLOCK_SIZE = 2**16  # bytes; no file system gives a file more at once
FAULT, END = (
    "Fault",
    "unloading",
)  # a line that begins so names a fault; the last line of a trial that passes
ALTERS = "changes the arithmetic of its thread (rounding, flush-to-zero, traps), by which other simulations compute too"
# Signal -> its usual cause. The causes of other signals are reads, writes and divisions.
CAUSES = {
    int(signal.SIGABRT): "aborts",
    int(signal.SIGFPE): "divides, or traps floating-point exceptions",
}


class Fault(Exception):
    """What is wrong with foreign code, in words."""


class Failed(Exception):
    """A trial that failed, in words."""

    def __init__(self, stage: str, fault: str, code: int | None, timeout: float):
        super().__init__(fault or f"{stage} {_ended(code, timeout)}")
        self.stage, self.fault, self.code = (
            stage,
            fault,
            code,
        )  # code: None if the process was stopped


def tried(module: str, order: Mapping[str, Any], timeout: float) -> Any:
    """Call `attempt(order, say)` of a module in another process.

    Return its result: plain data, as the order is.

    `attempt` calls `say` with each stage that it begins, and raises Fault with what is wrong. The
    timeout is in s.
    """
    from smc_mujoco.common import files, process

    with files.scratch() as folder:
        task = {
            "module": module,
            "order": order,
            "path": [os.path.abspath(place) for place in sys.path],
        }
        with files.no_room():
            (folder / "order").write_text(json.dumps(task), encoding="utf-8")
        try:
            code = process.timed(
                [sys.executable, "-P", __file__, str(folder)], timeout, output=False
            ).returncode
        except process.TimedOut:
            code = None
        report = folder / "report"
        if report.exists():
            text = report.read_bytes()[:MAX_PROGRESS].decode(errors="replace")
        else:
            text = ""
        lines = ["loading", *text.splitlines()]
        if lines[-1] == END and code == 0:
            return json.loads(lines[-2])
        with files.no_room():  # a report that could not be written is no fault of the module
            (folder / "block").write_bytes(bytes(BLOCK_SIZE))
    stages = [line for line in lines if not line.startswith(f"{FAULT} ")]
    raise Failed(
        stages[-1],
        lines[-1].removeprefix(f"{FAULT} ") if lines[-1] != stages[-1] else "",
        code,
        timeout,
    )


def _ended(code: int | None, timeout: float) -> str:
    """Return in words how a process ended: by an exit code, a signal or the timeout."""
    if code is None:
        return f"did not end within {timeout:g} s: fix what it waits for, or give timeout="
    if code >= 0:
        return f"ended the process with exit code {code}: let it return"
    names = {known.value: known.name for known in signal.Signals}  # without most real-time signals
    name = names.get(-code, f"signal {-code}")
    does = CAUSES.get(-code, "reads, writes or divides")
    return f"died of {name} ({signal.strsignal(-code)}): fix where it {does}"


class Arithmetic:
    """How this thread rounds, flushes and traps, which foreign code may change for all that
    computes after it.
    """

    def __init__(self) -> None:
        self.numbers = (ctypes.c_double * 4)(3.0, 10.0, 2.0**-1022, 2.0**1000)
        self.environment = ctypes.create_string_buffer(256)  # C's fenv_t has 8 to 32 bytes
        self.library = ctypes.PyDLL(None if os.name == "posix" else "ucrtbase")
        self.traps: Callable[[], int] = getattr(
            self.library, "fegetexcept", lambda: 0
        )  # only in some C libraries
        self.library.fegetenv(self.environment)
        self.state = self.traps()
        self.results = computed(self.numbers)

    def changed(self) -> bool:
        """Return whether this thread computes differently from before, and restore it if it does."""
        if self.traps() == self.state and computed(self.numbers) == self.results:
            return False
        self.library.fesetenv(self.environment)
        return True


def computed(numbers: Any) -> tuple[float, ...]:
    """Return results that differ between the directions of rounding, and where subnormal numbers
    are flushed to 0.

    The float64 nearest to 1/3 is below it, and that to 1/10 above. No result is subnormal itself:
    it may be read as 0.
    """
    three, ten, tiny, big = (
        numbers[0],
        numbers[1],
        numbers[2],
        numbers[3],
    )  # from memory: no compiler knows them
    return 1.0 / three, 1.0 / ten, tiny / ten * big


# the process of a trial


def limit() -> None:
    """Bound this process's memory and its files, where the system can. It writes no core dumps."""
    try:
        import resource
    except ImportError:  # Windows
        return
    bounds = (
        (resource.RLIMIT_DATA, MAX_MEMORY),
        (resource.RLIMIT_FSIZE, MAX_FILE),
        (resource.RLIMIT_CORE, 0),
    )
    for kind, bound in bounds:
        with contextlib.suppress(OSError, ValueError):  # the system sets a lower bound already
            resource.setrlimit(kind, (bound, resource.getrlimit(kind)[1]))


def run(folder: Path) -> None:
    """Carry out the order in a folder, and report there."""
    order = json.loads((folder / "order").read_text(encoding="utf-8"))
    sys.path[:] = order["path"]
    limit()
    with (folder / "report").open("w", encoding="utf-8") as report:
        say = functools.partial(print, file=report, flush=True)
        try:
            result = json.dumps(
                importlib.import_module(order["module"]).attempt(order["order"], say)
            )
            say(f"{result}\n{END}")
        except MemoryError:
            say(FAULT, f"takes more than {MAX_MEMORY / 2**30:g} GiB of memory: make it smaller")
        except Exception as error:
            if type(error).__name__ in (FAULT, "ScenarioError"):
                kind = ""
            else:
                kind = f"{type(error).__name__}: "
            say(FAULT, f"{kind}{' '.join(str(error).split())}")


if __name__ == "__main__":
    run(Path(sys.argv[1]))
