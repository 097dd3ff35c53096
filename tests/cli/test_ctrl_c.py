"""Whoever presses Ctrl-C again and again while a command compiles or simulates ends it in order."""

import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from smc_mujoco.cli import console
from smc_mujoco.common.attended import ENDED_BY_CTRL_C, STOPPED

ROOT = Path(__file__).parents[2]
BETWEEN_PRESSES = 0.02  # s
ARM = """<mujoco><worldbody><body><joint name="j" axis="0 -1 0" damping="2"/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".03" mass="3" contype="0" conaffinity="0"/></body>
</worldbody><actuator><motor joint="j" ctrlrange="-60 60"/></actuator></mujoco>"""
COMMANDS = {
    "run": ["run", str(ROOT / "scenes/duffing.py"), "--no-film"],
    "film": ["run", str(ROOT / "scenes/duffing.py")],
    "tune": ["tune", "duffing", "--law", "pid"],
    "which": ["which", "duffing", "--minutes", "2"],
    "identify": ["identify", "arm.xml:j", "log.csv", "--for", "j.damping"],
}


WAITING = "print(flush=True); signal.pause(); print('went on')"
IMPORTING = f"""from smc_mujoco.cli.console import importing
with importing(): {WAITING}"""
PROGRAM = f"""from types import ModuleType
from smc_mujoco.__main__ import main
from smc_mujoco.common.attended import raising
class Dropped:
    def __del__(self): {WAITING}
def run():
    with raising(): Dropped()
class Imported(ModuleType):
    def __getattr__(self, name):
        {{}}
        return run
sys.modules["smc_mujoco.cli.main"] = Imported("smc_mujoco.cli.main")
main()"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize(
    "waits",
    [IMPORTING, PROGRAM.format(WAITING), PROGRAM.format("pass")],
    ids=["a command's imports", "the program's imports", "a finalizer"],
)
def test_ctrl_c_ends_at_once_what_cannot_raise_it(waits):
    code = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    code += waits
    with subprocess.Popen(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as command:
        assert command.stdout
        command.stdout.readline()
        command.send_signal(signal.SIGINT)
        printed, said = command.communicate(timeout=60.0)
    assert command.returncode == ENDED_BY_CTRL_C
    assert not printed
    assert said == f"smc-mujoco: {STOPPED}\n"


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("name", COMMANDS)
def test_many_presses_of_ctrl_c_end_a_command_as_one_does(name, tmp_path):
    (tmp_path / "arm.xml").write_text(ARM)
    rows = [f"{0.01 * i},{math.sin(0.03 * i)},{math.cos(0.03 * i)}\n" for i in range(500)]
    (tmp_path / "log.csv").write_text("t,x,u\n" + "".join(rows))
    # nothing is compiled yet, and what compiles does not hear Ctrl-C
    environment = os.environ | {"PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    code += f"import sys; sys.argv[1:] = {COMMANDS[name]!r}\n"
    code += "from smc_mujoco.__main__ import main; main()"
    with subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as command:
        while command.poll() is None and not (tmp_path / "cache").exists():
            time.sleep(BETWEEN_PRESSES)  # until it compiles
        for _ in range(round(1.0 / BETWEEN_PRESSES)):
            if command.poll() is not None:
                break
            command.send_signal(signal.SIGINT)
            time.sleep(BETWEEN_PRESSES)
        assert command.wait(60.0) == ENDED_BY_CTRL_C


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_a_caller_s_own_signal_reaches_it_while_modules_are_imported(monkeypatch):
    monkeypatch.setattr(
        console, "stop_at_once", lambda *_: pytest.fail("the process would have ended")
    )
    arrived = []
    before = signal.signal(signal.SIGUSR1, lambda number, _: arrived.append(number))
    try:
        with console.importing():
            signal.raise_signal(signal.SIGUSR1)
    finally:
        signal.signal(signal.SIGUSR1, before)
    assert arrived == [signal.SIGUSR1]
