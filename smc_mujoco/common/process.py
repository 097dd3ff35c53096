"""Commands that end in time."""

import contextlib
import os
import signal
import subprocess
from collections.abc import Sequence


class Late(Exception):
    """A command was ended after its time."""


def timed(command: Sequence[str], timeout: float, heard: bool = True) -> subprocess.CompletedProcess[str]:
    """A command that ends in time, with every process that it started.

    Args:
      heard: whether to keep what it prints; what user's code prints without end would fill the memory.

    Raises:
      Late: it did not.
      OSError: there is no such program.
    """
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE if heard else subprocess.DEVNULL,
        stderr=subprocess.PIPE if heard else subprocess.DEVNULL,
        text=True,
        errors="replace",
        env=os.environ | {"LC_ALL": "C"},
        start_new_session=True,
    )
    try:
        said = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        raise Late from None
    finally:
        if process.poll() is None or (process.stdout and not process.stdout.closed):  # it, or what it left behind
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
    return subprocess.CompletedProcess(command, process.returncode, *said)
