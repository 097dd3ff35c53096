"""Which tests are run: `make quick` passes where all tests pass, and deletes no record."""

import os
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NONE_QUICK = {  # files all of whose tests take longer
    "analysis/test_engine_gpu.py",
    "cli/test_ctrl_c.py",
    "common/test_arithmetic.py",
    "common/test_children.py",
    "draw/test_view_browser.py",
    "draw/test_words_fit.py",
    "evidence/papers/test_quick_verdicts_of_gaber.py",
    "evidence/rigs/test_qube_servo.py",
    "identification/test_kept_replays.py",
    "identification/test_numbers_of_parts.py",
    "published/test_levant_accuracy.py",
    "studies/test_kills.py",
    "test_skipped.py",
}


@pytest.mark.quick
def test_every_other_file_has_a_quick_test():
    without = set()
    for path in (ROOT / "tests").rglob("test_*.py"):
        if "mark.quick" not in path.read_text(encoding="utf-8"):
            without.add(path.relative_to(ROOT / "tests").as_posix())
    assert without <= NONE_QUICK, "mark a test of each that takes little: @pytest.mark.quick"


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
