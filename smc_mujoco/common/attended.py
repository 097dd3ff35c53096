"""Threads for code that may outlive its caller: MuJoCo calling a user's law, or a compiler.

    attended([work], stop)    # as work(), but Ctrl-C ends it within PATIENCE

Code in a thread cannot be ended from outside, and crashes if Python ends meanwhile. So such code
has one owner. It waits for its threads with signals delayed, asks them to stop where a signal's
handler raises, and lets no process end as usual while one of them runs.
"""

import atexit
import contextlib
import gc
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NoReturn

from smc_mujoco.common.interrupts import delay_signals, handling

PATIENCE = 0.5  # s that threads have to end after they were asked to stop: chosen
POLL = 0.05  # s between looks at the signals
ENDED_BY_CTRL_C = 130  # the exit code of a shell's command that Ctrl-C ended
STOPPED = "stopped. A command that keeps a folder goes on from it if you run it again."

_running: dict[threading.Thread, Callable[[], None]] = {}  # thread -> what asks it to stop


def attended(jobs: Iterable[Callable[[], Any]], stop: Callable[[], Any]) -> None:
    """Do jobs at the same time, each in a thread of its own, and wait for all.

    `stop` asks them to end soon. It is called where the handler of a signal raises; the exception
    goes on when they have ended, or after PATIENCE. A job that does not end by then runs on, and
    keeps alive what it and `stop` refer to.
    """
    if threading.current_thread() in _running:
        for job in jobs:
            job()
        return
    raised: list[BaseException] = []

    def work(job: Callable[[], Any]) -> None:
        _running[threading.current_thread()] = stop
        try:
            job()
        except BaseException as error:
            raised.append(error)
        finally:
            del _running[threading.current_thread()]

    threads = []
    for job in jobs:
        threads.append(threading.Thread(target=work, args=(job,), daemon=True))
    with delay_signals() as deliver:
        try:
            for thread in threads:
                thread.start()
            while alive := _alive(threads):
                alive[0].join(POLL)
                deliver()
        except BaseException:
            stop()
            _wait(threads)
            raise
    if raised:
        raise raised.pop()


def _alive(threads: Iterable[threading.Thread]) -> list[threading.Thread]:
    return [thread for thread in threads if thread.is_alive()]


def _wait(threads: Iterable[threading.Thread]) -> None:
    """Wait until threads have ended, at most for PATIENCE."""
    last = time.monotonic() + PATIENCE
    while (alive := _alive(threads)) and (rest := last - time.monotonic()) > 0.0:
        alive[0].join(rest)


def ignore_ctrl_c() -> None:
    """Let a Ctrl-C from now on interrupt nothing. One that has come already may be raised here."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def end_at_ctrl_c() -> None:
    """Let Ctrl-C end the process at once, but where `raising` lets it raise. Of a process that
    ignores it nothing changes.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, stop_at_once)
        sys.unraisablehook = _stop_if_lost


def _stop_if_lost(unraisable: "sys.UnraisableHookArgs") -> None:
    """End at a Ctrl-C that was raised where Python drops what is raised, as in a finalizer."""
    if issubclass(unraisable.exc_type, KeyboardInterrupt):
        stop_at_once()
    sys.__unraisablehook__(unraisable)


@contextlib.contextmanager
def raising() -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt in a with block, also in a process that it ends at
    once.
    """
    ends = signal.getsignal(signal.SIGINT) is stop_at_once
    with handling(signal.default_int_handler, [signal.SIGINT] if ends else []):
        yield


def stop_at_once(*_: object) -> NoReturn:
    """Say that the command was stopped, and end the process: the handler of a signal."""
    with contextlib.suppress(OSError):
        os.write(2, f"smc-mujoco: {STOPPED}\n".encode())
    leave()


@atexit.register  # when this is imported, so that it is called after the handlers of others
def _end_with_python() -> None:
    """End the process at once if one of the threads does not end: it would crash in a Python that
    is half gone. Python's last collections are left out: they take .5 s, which Ctrl-C would wait
    for.
    """
    ignore_ctrl_c()
    gc.freeze()
    for stop in list(_running.values()):
        stop()
    threads = list(_running)
    _wait(threads)
    if _alive(threads):
        leave()


def leave() -> NoReturn:
    """End the process at once, as Ctrl-C does."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(Exception):
            stream.flush()
    os._exit(ENDED_BY_CTRL_C)


# Called just before it: a Ctrl-C that is raised in there does not skip the end of the threads.
atexit.register(ignore_ctrl_c)
