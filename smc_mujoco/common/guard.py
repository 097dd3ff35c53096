"""Foreign machine code (laws in C, FMUs, policies, models): first run in another process, and
watched in our own.

The other process runs this file as a script. It may crash, hang or fill its memory: it has limits,
and ends with everything that it has started. It reports its progress as lines in a file. The last
line is the stage at which it died, a fault, or "unloading". It must start quickly, so only
functions of this file import smc_mujoco.
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

MAX_MEMORY = 4 * 2**30  # bytes that the process may have: chosen
MAX_FILE = 10**9  # bytes of a file that it writes: chosen
MAX_PROGRESS = 10**7  # bytes of a report: chosen
BLOCK_SIZE = 2**16  # bytes; no file system gives a file more at once
FAULT = "Fault"  # begins a line that names a fault
END = "unloading"  # the last line of a job that passes
ALTERS = (
    "changes the arithmetic of its thread (rounding, flush-to-zero, traps), by which other "
    "simulations compute too"
)
# what `computed` returns where nothing was changed
USUAL = (
    float.fromhex("0x1.5555555555555p-2"),
    float.fromhex("0x1.999999999999ap-4"),
    float.fromhex("0x1.99999999999a0p-26"),
)
# Signal -> its usual cause. The causes of other signals are reads, writes and divisions.
CAUSES = {
    int(signal.SIGABRT): "aborts",
    int(signal.SIGFPE): "divides, or traps floating-point exceptions",
}


class Fault(Exception):
    """What is wrong with foreign code, in words."""


class Failed(Exception):
    """A job that failed, in words."""

    def __init__(self, stage: str, fault: str, code: int | None, timeout: float):
        super().__init__(fault or f"{stage} {_ended(code, timeout)}")
        self.stage = stage
        self.fault = fault
        self.code = code  # None if the process was stopped


def run_isolated(module: str, job: Mapping[str, Any], timeout: float) -> Any:
    """Return what `worker(job, report)` of a module returns in another process.

    Job and result are plain data. The worker calls `report` with each stage that it begins, and
    raises Fault with what is wrong. The timeout is in s.
    """
    from smc_mujoco.common import files, process

    with files.scratch() as folder:
        path = [os.path.abspath(place) for place in sys.path]
        with files.no_room():
            task = json.dumps(
                {
                    "module": module,
                    "job": job,
                    "path": path,
                }
            )
            (folder / "job").write_text(task, encoding="utf-8")
        command = [sys.executable, "-P", __file__, str(folder)]
        try:
            code = process.timed(command, timeout, output=False).returncode
        except process.TimedOut:
            code = None
        lines = ["loading"]
        report = folder / "report"
        if report.exists():
            lines += report.read_bytes()[:MAX_PROGRESS].decode(errors="replace").splitlines()
        if lines[-1] == END and code == 0:
            return json.loads(lines[-2])
        with files.no_room():  # a report that could not be written is no fault of the module
            (folder / "block").write_bytes(bytes(BLOCK_SIZE))
    fault = ""
    if lines[-1].startswith(f"{FAULT} "):
        fault = lines.pop().removeprefix(f"{FAULT} ")
    raise Failed(lines[-1], fault, code, timeout)


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


def computes_as_usual() -> bool:
    """Return whether this thread rounds to the nearest number, and keeps subnormal ones."""
    return computed((3.0, 10.0, 2.0**-1022, 2.0**1000)) == USUAL


class Arithmetic:
    """How this thread rounds, flushes and traps, which foreign code may change for all that
    computes after it.
    """

    def __init__(self) -> None:
        self.numbers = (ctypes.c_double * 4)(3.0, 10.0, 2.0**-1022, 2.0**1000)
        self.environment = ctypes.create_string_buffer(256)  # C's fenv_t has 8 to 32 bytes
        self.library = ctypes.PyDLL(None if os.name == "posix" else "ucrtbase")
        # only in some C libraries
        self.traps: Callable[[], int] = getattr(self.library, "fegetexcept", lambda: 0)
        self.library.fegetenv(self.environment)
        self.state = self.traps()
        self.results = computed(self.numbers)

    def changed(self) -> bool:
        """Return whether this thread computes differently from before, and restore it if it
        does.
        """
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
    three, ten, tiny, big = numbers[:]  # from memory: no compiler knows them
    return 1.0 / three, 1.0 / ten, tiny / ten * big


# the other process


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
    """Do the job in a folder, and report there."""
    task = json.loads((folder / "job").read_text(encoding="utf-8"))
    sys.path[:] = task["path"]
    limit()
    with (folder / "report").open("w", encoding="utf-8") as file:
        report = functools.partial(print, file=file, flush=True)
        try:
            result = importlib.import_module(task["module"]).worker(task["job"], report)
            report(f"{json.dumps(result)}\n{END}")
        except MemoryError:
            report(FAULT, f"takes more than {MAX_MEMORY / 2**30:g} GiB of memory: make it smaller")
        except Exception as error:
            words = " ".join(str(error).split())
            if type(error).__name__ not in (FAULT, "ScenarioError"):
                words = f"{type(error).__name__}: {words}"
            report(FAULT, words)


if __name__ == "__main__":
    run(Path(sys.argv[1]))
