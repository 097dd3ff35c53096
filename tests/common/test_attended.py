"""Threads that may outlive their caller: Ctrl-C stops them, and Python ends in spite of them."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from smc_mujoco.common import attended
from smc_mujoco.common.cached import cached_property

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals and forks of POSIX")


@pytest.fixture(autouse=True)
def _heard(monkeypatch):
    """Ctrl-C is heard, also where the tests run in a shell's background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


class Job:
    """Work that lasts until it is stopped."""

    def __init__(self):
        self.begun = threading.Event()
        self.stopped = threading.Event()
        self.ended = False
        self.thread: threading.Thread | None = None

    def __call__(self):
        self.thread = threading.current_thread()
        self.begun.set()
        assert self.stopped.wait(20.0)
        self.ended = True


def press(job, times, number=signal.SIGINT):
    """Send signals once the job has begun. Return an event: all are sent."""
    sent = threading.Event()

    def work():
        assert job.begun.wait(20.0)
        for _ in range(times):
            os.kill(os.getpid(), number)
            time.sleep(2.0 * attended.POLL)
        sent.set()

    threading.Thread(target=work).start()
    return sent


@pytest.mark.quick
@pytest.mark.parametrize("times", [1, 3])
def test_ctrl_c_stops_the_threads_and_waits_for_them(times):
    job = Job()
    sent = press(job, times)

    def stop():
        assert sent.wait(20.0)
        job.stopped.set()

    with pytest.raises(KeyboardInterrupt):
        attended.attended([job, job], stop)
    assert job.ended
    assert job.thread is not None
    assert not job.thread.is_alive()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_signal_whose_handler_returns_stops_nothing():
    job = Job()
    before = signal.signal(signal.SIGUSR1, lambda *_: job.stopped.set())
    try:
        press(job, 1, signal.SIGUSR1)
        attended.attended([job], lambda: pytest.fail("it was stopped"))
    finally:
        signal.signal(signal.SIGUSR1, before)
    assert job.ended


def test_what_a_job_raises_is_raised_and_a_job_may_attend_to_others():
    seen = []

    def inner():
        seen.append(threading.current_thread())
        raise ValueError("of the job")

    def outer():
        seen.append(threading.current_thread())
        attended.attended([inner], bool)

    with pytest.raises(ValueError, match="of the job"):
        attended.attended([outer], bool)
    assert seen[0] is seen[1]
    assert seen[0] is not threading.main_thread()


NEVER_ENDS = """
import os, signal, threading, time
from smc_mujoco.common import attended
begun = threading.Event()
def job():
    begun.set()
    threading.Event().wait()
def press():
    begun.wait()
    for _ in range(PRESSES):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.02)
threading.Thread(target=press, daemon=True).start()
try:
    attended.attended([job], bool)
except KeyboardInterrupt:
    print("went on")
"""


@pytest.mark.parametrize("presses", [1, 100])
def test_a_thread_that_never_ends_lets_the_caller_go_on_and_python_end(presses):
    """Python would crash with the thread: whoever presses Ctrl-C for 2 s ends no wait early."""
    begin = time.monotonic()
    code = NEVER_ENDS.replace("PRESSES", str(presses))
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=50, check=False
    )
    assert "in _end_with_python" not in ended.stderr
    assert ended.returncode == attended.ENDED_BY_CTRL_C
    assert time.monotonic() - begin > 2.0 * attended.PATIENCE
    if presses == 1:
        assert ended.stdout == "went on\n"


class Slow:
    @cached_property
    def value(self):
        self.begun.set()
        assert self.go_on.wait(20.0)
        return self

    def __init__(self):
        self.begun = threading.Event()
        self.go_on = threading.Event()


@pytest.mark.filterwarnings("ignore:.*use of fork")
def test_a_fork_while_a_property_is_computed_blocks_no_child():
    slow = Slow()
    quick = Slow()
    quick.go_on.set()
    thread = threading.Thread(target=lambda: slow.value)
    thread.start()
    assert slow.begun.wait(20.0)
    child = os.fork()
    if child == 0:
        signal.alarm(10)  # ends a child that hangs
        os._exit(quick.value is not quick)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    slow.go_on.set()
    thread.join()
    assert slow.value is slow
    assert Slow.value.__doc__ is None
