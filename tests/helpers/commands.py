"""How a command refuses, and interpreters of their own."""

import os
import subprocess
import sys

from helpers.pages import ROOT


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
