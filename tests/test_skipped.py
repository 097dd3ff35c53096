"""Which modules of tests CI skips whole, so that a test that runs nowhere is seen.

Run it as CI does, with what `make test` installs.
"""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
SKIPPED = {  # module -> why it is skipped
    "tests/analysis/test_engine_gpu.py": "it needs a CUDA device",
    "tests/draw/test_view_browser.py": "it needs Chromium or Chrome, which CI's machines have",
}
PRINT = """
import sys
import pytest

class Modules:
    def __init__(self):
        self.run = set()
        self.skipped = set()

    def pytest_collectreport(self, report):
        if report.skipped:
            self.skipped.add(report.nodeid)

    def pytest_itemcollected(self, item):
        marks = list(item.iter_markers("skipif"))
        if any(mark.args[0] for mark in marks):
            self.skipped.add(item.nodeid.partition("::")[0])
        else:
            self.run.add(item.nodeid.partition("::")[0])

modules = Modules()
pytest.main(["--collect-only", "-qqq", "tests"], plugins=[modules])
print("skipped:", *sorted(modules.skipped - modules.run))
"""


def test_ci_skips_these_modules_and_no_other():
    done = subprocess.run(
        [sys.executable, "-c", PRINT], cwd=ROOT, capture_output=True, text=True, check=True
    )
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("skipped:")]
    skipped = set(SKIPPED)
    if shutil.which("chromium") or shutil.which("google-chrome"):
        skipped.remove("tests/draw/test_view_browser.py")
    assert line.split()[1:] == sorted(skipped)
