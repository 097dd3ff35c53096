"""How a command refuses, and interpreters of their own."""

import os
import subprocess
import sys

import pytest

from helpers.pages import ROOT
from smc_mujoco.cli import main


def python(*words, folder=None, path=ROOT, fine=True, **variables):
    """A fresh interpreter that has run with these words, with the package from `path`; `fine`: fail
    unless it did well.

    It answers in UTF-8.
    """
    environment = os.environ | {"PYTHONPATH": str(path), "PYTHONIOENCODING": "utf-8"} | variables
    done = subprocess.run(
        [sys.executable, "-B", *map(str, words)],
        cwd=folder,
        env=environment,
        capture_output=True,
        encoding="utf-8",
        timeout=300,
        check=False,
    )
    assert done.returncode == 0 or not fine, done.stdout + done.stderr
    return done


def assert_refused(capsys, words, said):
    """Fail unless a command ends with code 2 and one line that begins so."""
    with pytest.raises(SystemExit) as end:
        main.main(words)
    printed = capsys.readouterr()
    assert end.value.code == 2
    assert printed.out == ""
    assert printed.err.startswith(f"smc-mujoco: {said}")
    assert len(printed.err.splitlines()) == 1
