"""What foreign machine code may do in its trial, and to the arithmetic of a run: found, in one
sentence, and ended.
"""

import contextlib
import ctypes
import ctypes.util
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

import smc_mujoco as smc
from smc_mujoco.common import guard

pytestmark = pytest.mark.skipif(os.name != "posix", reason="the code of these trials is for POSIX")


def worker(job: Mapping[str, Any], report: Callable) -> Any:
    """What a test wants done, in the other process."""
    report("working")
    kind = job["kind"]
    if kind == "fill":
        return len([bytes(2**26) for _ in range(1000)])
    if kind == "write":
        with Path(job["file"]).open("wb") as file:
            file.truncate(guard.MAX_FILE + 1)
    if kind == "forks":
        children = []
        while len(children) < 20:
            if (child := os.fork()) == 0:
                signal.pause()
            children.append(child)
        return children
    if kind == "exit":
        os._exit(1)
    if kind == "deep":
        raise guard.Fault(f"is wrong:\n {job['kind']}")
    return job


def test_what_a_trial_returns_comes_back():
    assert guard.run_isolated(__name__, {"kind": "none", "more": [1.5, None]}, 60.0) == {
        "kind": "none",
        "more": [1.5, None],
    }


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("fill", "takes more than 4 GiB of memory: make it smaller"),
        ("write", r"OSError: \[Errno 27\] File too large"),
        ("deep", "is wrong: deep"),
    ],
)
def test_a_trial_has_limits(kind, said, tmp_path):
    with pytest.raises(guard.Failed, match=f"^{said}") as failed:
        guard.run_isolated(__name__, {"kind": kind, "file": str(tmp_path / "large")}, 60.0)
    assert failed.value.stage == "working"
    assert failed.value.code == 0
    assert not [path for path in tmp_path.iterdir() if path.stat().st_size > 0]


def test_a_trial_without_room_for_its_report_blames_no_module():
    import resource

    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (guard.BLOCK_SIZE // 2, limits[1]))
        with pytest.raises(smc.ScenarioError) as refused:
            guard.run_isolated(__name__, {"kind": "exit"}, 60.0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert (
        str(refused.value)
        == "no temporary file can be written (File too large): make room, or set TMPDIR"
    )


def test_what_a_trial_starts_ends_with_it():
    running = guard.run_isolated(__name__, {"kind": "forks"}, 60.0)
    until(lambda: not any(map(alive, running)))  # the process that inherits orphans has noticed


SLEEPS = """import time
while True:
    time.sleep(1.0)
"""
LAW = """import smc_mujoco as smc
@smc.law_function()
def own(y, gains, memory):
    while y.t < 1e9:
        memory[0] += 1.0
    return 0.0, 0.0
"""
HANGS = """#include "smc_law.h"
int smc_setup(void) { for (volatile int i = 0; i < 2; i = 0) { } return 0; }
int smc_law(const smc_measurement *y, const smc_real *gains, smc_real *memory, smc_real *out)
{
    (void)y; (void)gains; (void)memory;
    out[0] = out[1] = 0.0;
    return 0;
}
"""
ENTRY = """name = "own"
authors = ["A"]
source = "here"
licence = "MIT"
division = "one set"
"""
CHILDREN = {  # what starts a process -> code that waits for it for ever
    "worker": "guard.run_isolated('waits', {}, 600.0)",
    "compiler": "os.environ['CC'] = './cc'; smc.exchange.law_from_c('hangs.c')",
    "law in C": "smc.exchange.law_from_c('hangs.c', timeout=600.0)",
    "entry": "from smc_mujoco.problems.enter import enter; enter('entry', instances=1)",
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
    (tmp_path / "waits.py").write_text(SLEEPS)
    (tmp_path / "hangs.c").write_text(HANGS)
    (tmp_path / "cc").write_text(f"#!{sys.executable}\n{SLEEPS}")
    (tmp_path / "cc").chmod(0o755)
    (tmp_path / "entry").mkdir()
    (tmp_path / "entry/law.py").write_text(LAW)
    (tmp_path / "entry/entry.toml").write_text(ENTRY)
    code = "import os, signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    code += "sys.path.insert(0, '.'); import smc_mujoco as smc\n"
    code += f"from smc_mujoco.common import guard, process\n{CHILDREN[starts]}"
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    root = str(Path(__file__).parents[2])
    environment["PYTHONPATH"] = root
    with subprocess.Popen(
        [sys.executable, "-c", code], cwd=tmp_path, env=environment, stderr=subprocess.DEVNULL
    ) as parent:
        until(lambda: sessions(parent.pid))
        time.sleep(2.0)  # a law begins to compute
        started = sessions(parent.pid)
        assert started
        parent.send_signal(how)
    time.sleep(2.0)
    assert {
        pid: words for pid, (session, _, words) in processes().items() if session in started
    } == {}


def processes() -> dict[int, tuple[int, int, str]]:
    """Return process -> its session, its parent and its command, of those that live."""
    found = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            words, rest = path.read_text().rsplit(")", 1)
            state, parent, _, session = rest.split()[:4]
            if state != "Z":
                found[int(path.parent.name)] = int(session), int(parent), words
    return found


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


def alive(process: int) -> bool:
    state = Path(f"/proc/{process}/stat")
    return state.exists() and state.read_text().rpartition(")")[2].split()[0] != "Z"


FLUSH = 0x8040  # of SSE's register: small results are 0, and small operands


@pytest.mark.parametrize("mode", ["FE_DOWNWARD", "FE_UPWARD", "FE_TOWARDZERO", "flush", "trap"])
def test_a_change_of_the_arithmetic_is_seen_and_undone(mode):
    if os.uname().machine != "x86_64" or ctypes.util.find_library("c") is None:
        pytest.skip("the numbers of the modes are those of x86 and of the GNU C library")
    modes = {"FE_DOWNWARD": 0x400, "FE_UPWARD": 0x800, "FE_TOWARDZERO": 0xC00}
    arithmetic = guard.Arithmetic()
    three = 3.0
    ten = 10.0
    least = 2.0**-1022
    library = arithmetic.library
    environment = ctypes.create_string_buffer(bytes(arithmetic.environment), 256)
    assert not arithmetic.changed()
    if mode in modes:
        library.fesetround(modes[mode])
    elif mode == "trap":
        library.feenableexcept(4)
    else:
        state = ctypes.c_uint32.from_buffer(environment, 28)
        state.value |= FLUSH
        library.fesetenv(environment)
    assert arithmetic.changed()
    assert not arithmetic.changed()
    assert library.fegetround() == library.fegetexcept() == 0
    assert 1.0 / three == float.fromhex("0x1.5555555555555p-2")
    assert 1.0 / ten == float.fromhex("0x1.999999999999ap-4")
    assert least / ten * 2.0**1000 > 0.0


@pytest.mark.skipif(os.uname().machine != "x86_64", reason="the number of the mode is that of x86")
def test_a_run_is_refused_where_other_code_has_set_the_rounding():
    """It would change every run of the process in silence."""
    scenario = smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.01)
    smc.run(scenario)
    library = guard.Arithmetic().library
    library.fesetround(0x800)
    try:
        with pytest.raises(smc.ScenarioError, match="arithmetic of this thread"):
            smc.run(scenario)
    finally:
        library.fesetround(0)
    assert smc.run(scenario).failure is None
