"""Which tests are run: `make quick` passes where all tests pass, and deletes no record."""

import os
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
def test_records_of_cases_that_quick_leaves_out_are_kept_and_not_called_unused(
    pytester, monkeypatch
):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), *sys.path]))
    pytester.makeconftest((ROOT / "tests" / "conftest.py").read_text(encoding="utf-8"))
    pytester.makepyfile("""
        import pytest

        pytestmark = pytest.mark.quick

        @pytest.mark.parametrize("case", "ab")
        def test_case(case, snapshot):
            assert case == snapshot
    """)
    # in processes of their own: syrupy has one session for each
    assert pytester.runpytest_subprocess("--snapshot-update").ret == 0
    (records,) = pytester.path.glob("__snapshots__/*.ambr")
    all_records = records.read_text(encoding="utf-8")
    for arguments in (
        ["--quick"],
        ["--quick", "--snapshot-update"],
    ):
        run = pytester.runpytest_subprocess(*arguments)
        run.assert_outcomes(passed=1, deselected=1)
        assert run.ret == 0
        assert records.read_text(encoding="utf-8") == all_records
    for arguments in (["--collect-only"], ["--collect-only", "--snapshot-update"]):
        run = pytester.runpytest_subprocess(*arguments)
        run.stdout.no_fnmatch_line("*delete unused*")
        assert records.read_text(encoding="utf-8") == all_records
