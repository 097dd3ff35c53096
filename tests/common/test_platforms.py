"""What assumes Linux has a way without: files, locks, processes, processors, pictures, C."""

import ast
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

import smc_mujoco as smc
from smc_mujoco.common import gl, process

PACKAGE = Path(smc.__file__).parent
POSITION = {"read_text": 0, "write_text": 1}  # of the encoding among the arguments


def test_every_text_file_is_read_and_written_as_utf_8():
    """Windows would take its own encoding, in which a text from Linux is another."""
    bare = []
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Attribute)
                and node.func.attr in POSITION
            ):
                stated = len(node.args) > POSITION[node.func.attr] or "encoding" in {
                    word.arg for word in node.keywords
                }
                if stated:
                    bare += []
                else:
                    bare += [f"{path.relative_to(PACKAGE)}:{node.lineno}"]
    assert bare == []


@pytest.mark.quick
@pytest.mark.skipif(not hasattr(os, "killpg"), reason="it is about systems that have it")
def test_without_process_groups_a_late_command_dies_with_its_children(monkeypatch):
    commands = []
    real = subprocess.run

    def taskkill(command: list[str], **options: object) -> object:
        if command[0] != "taskkill":
            return real(command, **options)
        commands.append(command)
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.delattr(os, "killpg")
    monkeypatch.setattr(subprocess, "run", taskkill)
    with pytest.raises(process.TimedOut):
        process.timed([sys.executable, "-c", "import time; time.sleep(60)"], 0.2)
    ((*command, number),) = commands
    assert command == ["taskkill", "/F", "/T", "/PID"]
    with pytest.raises(ProcessLookupError):  # it has ended, and was waited for
        os.kill(int(number), 0)


@pytest.mark.skipif(not hasattr(os, "setsid"), reason="it is about systems that have it")
def test_a_command_is_late_in_time_though_a_process_of_another_session_holds_its_pipes():
    leaves = "import os, time; os.fork() or (os.setsid(), time.sleep(120))"
    begun = time.monotonic()
    with pytest.raises(process.TimedOut):
        process.timed([sys.executable, "-c", leaves], 0.5)
    assert time.monotonic() - begun < 100.0


@pytest.mark.parametrize("platform", ["darwin", "win32"])
def test_other_systems_than_linux_keep_mujoco_s_own_choice_of_opengl(platform, monkeypatch):
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(gl, "choice", gl.choice.__wrapped__)
    assert gl.choice() == ("", "")
    assert gl.choose_gl() == ""
    assert "MUJOCO_GL" not in os.environ
