"""A process that the package starts ends with the one that started it."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

SLEEPS = """import time
while True:
    time.sleep(1.0)
"""
CHILDREN = {  # what starts a process -> code that waits for it for ever
    "renderer": "from smc_mujoco.common import gl; gl.probe('egl', open('waits.py').read())",
    "command": "process.timed(['sh', '-c', 'sleep 100 & sleep 100'], 600.0, output=False)",
}
ENDS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL]


@pytest.mark.slow
@pytest.mark.skipif(not os.path.isdir("/proc"), reason="it reads who lives from /proc")
@pytest.mark.parametrize("how", ENDS)
@pytest.mark.parametrize("starts", CHILDREN)
def test_no_child_lives_two_seconds_after_its_parent(starts, how, tmp_path):
    """However the parent ends: a child that computes for ever was left to itself."""
    assert_none_outlives(CHILDREN[starts], how, tmp_path)


def assert_none_outlives(code, how, tmp_path):
    """Fail if a child that this code starts lives on where its parent ends by a signal."""
    (tmp_path / "waits.py").write_text(SLEEPS)
    (tmp_path / "law.c").touch()
    (tmp_path / "cc").write_text(f"#!{sys.executable}\n{SLEEPS}")
    (tmp_path / "cc").chmod(0o755)
    begin = "import os, signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    begin += "sys.path.insert(0, '.'); import smc_mujoco as smc\n"
    code = f"{begin}from smc_mujoco.common import process\n{code}"
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    root = str(Path(__file__).parents[2])
    environment["PYTHONPATH"] = root
    with subprocess.Popen(
        [sys.executable, "-c", code], cwd=tmp_path, env=environment, stderr=subprocess.DEVNULL
    ) as parent:
        until(lambda: sessions(parent.pid))
        time.sleep(2.0)
        started = sessions(parent.pid)
        assert started
        parent.send_signal(how)
    time.sleep(2.0)
    assert {
        pid: words for pid, (session, _, words) in processes().items() if session in started
    } == {}


def processes() -> dict[int, tuple[int, int, str]]:
    """Return process -> its session, its parent and its command, of those that live."""
    by_pid = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            words, rest = path.read_text().rsplit(")", 1)
            state, parent, _, session = rest.split()[:4]
            if state != "Z":
                by_pid[int(path.parent.name)] = int(session), int(parent), words
    return by_pid


def sessions(parent: int) -> set[int]:
    """Return the sessions that the children of a process began."""
    own = os.getsid(parent)
    return {session for session, starter, _ in processes().values() if starter == parent} - {own}


def until(true: Callable[[], object]) -> None:
    """Wait for something, 30 s at most."""
    for _ in range(3000):
        if true():
            return
        time.sleep(0.01)
    pytest.fail("it took too long")
