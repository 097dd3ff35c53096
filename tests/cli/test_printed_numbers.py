"""What a command prints is what its file holds, in the unit that the head names: a table a command,
read from its end.
"""

import json
import math
import re
from pathlib import Path

import pytest
from pyarrow import parquet

from smc_mujoco.cli import main

pytestmark = pytest.mark.quick

FAILS = """
import math
import smc_mujoco as smc

@smc.law_function
def fails(y, gains, memory):
    return math.nan, y.e
"""


@pytest.fixture
def printed(tmp_path, monkeypatch, capsys):
    """A function that runs a command line in an empty folder and returns what it prints."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def run(line: str) -> str:
        with pytest.raises(SystemExit) as end:
            main.main(line.split())
        assert not end.value.code
        return capsys.readouterr().out

    return run


def row(out: str, *starts: str) -> list[str]:
    """Return the words of the first line of a table that begins with these words, without rules."""
    for line in out.splitlines():
        words = re.sub("[│|]", " ", line).split()
        if words[: len(starts)] == [*starts]:
            return words
    raise AssertionError(f"no line begins with {starts} in {out}")


def near(word: str, value: float) -> bool:
    """Whether a printed number has the first three digits of a value."""
    return math.isclose(float(word), value, rel_tol=6e-3)


def test_compare_prints_the_medians_and_the_counts_of_its_table(printed):
    Path("fails.py").write_text(FAILS)
    out = printed(
        "compare duffing --law classical,pid,fails.py --gains default --no-tune --condition nominal"
        " --seeds 3 --duration 0.3 --out there --metric itae,rms_error"
    )
    rows = parquet.read_table("there/results.parquet").to_pylist()
    failed = sum(record["failure"] is not None for record in rows)
    assert failed == 3
    page = Path("there/report.html").read_text()
    assert f"{len(rows)} runs, {failed} stopped early" in page
    of_runs = out[out.index("duffing under nominal") :]
    for law in ("classical", "pid"):
        rows_of_law = [record for record in rows if record["law"] == law]
        values = []
        for name in ("itae", "rms_error"):
            values.append(sorted(record[name] for record in rows_of_law)[1])
        medians = [float(word) for word in row(of_runs, law)[2:]]  # after the law and J
        assert medians == pytest.approx(values, rel=6e-3)
    assert "3 of 3" in of_runs


def test_margins_are_printed_in_their_unit(printed):
    line = "margins duffing --law pid --kind mass --quick --json m.json"
    answer = printed(line)
    margins = json.loads(Path("m.json").read_text())
    for out, full in ((answer, False), (printed(f"{line} --full"), True)):
        for margin in margins:
            if full:
                words = row(out[out.index(f"largest {margin['kind']}") :], "duffing", "pid")
                assert near(words[2], margin["value"])
                assert near(words[3], margin["resolution"])
                assert words[-1] == margin["unit"]
            else:
                numbers = [word for word in row(out, "pid")[1:] if word != "to"]
                for end in (margin["low"], margin["high"]):
                    assert any(near(word, end) for word in numbers), (numbers, end)


def test_worst_prints_what_its_file_holds(printed):
    out = printed(
        "worst duffing --law classical,pid --budget 3 --duration 0.2 --gains default --json w.json"
    )
    for case in json.loads(Path("w.json").read_text()):
        words = row(out, case["scenario"]["law"]["name"])
        assert near(words[1], case["value"])
        assert near(words[2], case["median"])
        assert row(out, case["unit"]) == [case["unit"], case["unit"]]


def test_sensitivity_prints_shares_in_per_cent_and_ranges_in_their_unit(printed):
    line = "sensitivity duffing --law classical --bound mass=0.7:1.3,delay=0:0.02 --points 16 "
    line += "--duration 0.3 --json s.json"
    full = printed(f"{line} --full")
    out = printed(line)
    axes = json.loads(Path("s.json").read_text())["axes"]
    assert row(full, "delay")[:5] == ["delay", "0", "s", "20", "ms"]
    for axis in axes:
        shares = [f"{100.0 * axis[kind]['median']:.0f}" for kind in ("first", "total")]
        assert shares == [word for word in row(full, axis["name"])[-3:] if word.isdigit()][-2:]
        assert row(out, axis["name"])[-2] == shares[1]
    first = axes[0]
    low = f"{100.0 * first['total']['low']:.0f}"
    assert first["total"]["high"] > 0.995
    assert f"{first['name']} explains {low} to over 99 %" in out


def test_tune_prints_the_gains_of_its_file(printed):
    out = printed(
        "tune duffing --law classical --searches 2 --budget 8 --condition nominal --out g.json"
    )
    gains = json.loads(Path("g.json").read_text())["scenario"]["law"]["gains"]
    printed_gains = dict(re.findall(r"(\w+)=([\d.e-]+)", " ".join(row(out, "gains"))))
    for name, value in gains.items():
        assert float(printed_gains[name]) == value
