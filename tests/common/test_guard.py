"""What foreign machine code may do in its trial, and to the arithmetic of a run: found, in one
sentence, and ended.
"""

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
    if kind == "waits":
        Path(job["file"]).write_text(str(os.getpid()))
        signal.pause()
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


PARENT = """
import sys
from smc_mujoco.common import guard
sys.path.insert(0, sys.argv[1])
guard.run_isolated("test_guard", {"kind": "waits", "file": sys.argv[2]}, 60.0)
"""


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
def test_it_ends_with_the_process_that_wanted_it_however_that_ends(how, tmp_path):
    file = tmp_path / "process"
    command = [sys.executable, "-c", PARENT, str(Path(__file__).parent), str(file)]
    with subprocess.Popen(command) as parent:
        until(lambda: file.exists() and file.read_text())
        parent.send_signal(how)
    until(lambda: not alive(int(file.read_text())))


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
    scenario = smc.Scenario(plant="duffing", law="classical", duration=0.01)
    smc.run(scenario)
    library = guard.Arithmetic().library
    library.fesetround(0x800)
    try:
        with pytest.raises(smc.ScenarioError, match="arithmetic of this thread"):
            smc.run(scenario)
    finally:
        library.fesetround(0)
    assert smc.run(scenario).failure is None
