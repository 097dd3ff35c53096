"""Commands that end in time and with this process, locks in forked processes, and memory that goes
back to the system.
"""

import contextlib
import ctypes
import errno
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

# Where there is a shell, a command runs beside a reader of a pipe that only this process can write
# to. The pipe closes when this process ends, however it ends; the reader then kills its session.
GUARDED = """exec 3<&0 </dev/null; (read end <&3; kill -9 0) >/dev/null 2>&1 & exec "$@" 3<&-"""


def free_after_fork(lock: Any) -> None:
    """Let a fork wait until no other thread holds a lock, because nobody would release it in the
    child process.
    """
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(
            before=lock.acquire, after_in_parent=lock.release, after_in_child=lock.release
        )


def return_freed_memory() -> None:
    """Return freed memory to the system, if the C library is glibc.

    Without it, a run leaves 45 to 100 kB allocated, and the compiling of a robot's meshes a third
    of what it takes.
    """
    if sys.platform == "linux" and hasattr(ctypes.CDLL(None), "malloc_trim"):
        ctypes.CDLL(None).malloc_trim(0)


class TimedOut(Exception):
    """A command was stopped because its time was up."""


def _kill(process: subprocess.Popen[str]) -> None:
    """Kill a process, on POSIX the first of its session, and every process that it started."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        subprocess.run(
            ["taskkill", "/F", "/T", "/PID", str(process.pid)], capture_output=True, check=False
        )
        process.kill()


def timed(
    command: Sequence[str],
    timeout: float,
    output: bool = True,
    cwd: str | os.PathLike[str] | None = None,
    **environment: str,
) -> subprocess.CompletedProcess[str]:
    """Run a command, and stop it and every process that it started when its time, s, is up, or
    when this process ends.
    """
    # a user's code may print without end
    if output:
        pipe = subprocess.PIPE
    else:
        pipe = subprocess.DEVNULL
    guarded = list(command)
    if os.name == "posix":
        if shutil.which(guarded[0]) is None:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), guarded[0])
        guarded = ["sh", "-c", GUARDED, "sh", *command]
    reading_end, writing_end = os.pipe()
    with (
        os.fdopen(reading_end) as stdin,
        os.fdopen(writing_end, "w"),
        subprocess.Popen(
            guarded,
            cwd=cwd,
            stdin=stdin,
            stdout=pipe,
            stderr=pipe,
            text=True,
            errors="replace",
            env=os.environ | {"LC_ALL": "C"} | environment,
            start_new_session=True,
        ) as process,
        # whose pipes are closed after the block, though a process that left the session may hold
        # them
    ):
        try:
            printed = process.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            raise TimedOut from None
        finally:
            _kill(process)  # what it started too, which may run on after it
    return subprocess.CompletedProcess(command, process.returncode, *printed)
