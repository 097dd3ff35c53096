"""Progress: a bar on a terminal, lines in a log, and in a notebook a line of which nothing stays."""

from unittest.mock import MagicMock, call

import pytest

import smc_mujoco as smc
from smc_mujoco.common import progress

pytestmark = pytest.mark.quick


def test_a_terminal_s_bar_vanishes_and_shows_the_time_left(monkeypatch):
    """rich is given; what it is asked is told."""
    monkeypatch.setattr(progress.time, "monotonic", lambda: 1.0)
    monkeypatch.setattr("rich.progress.Progress", rich := MagicMock())
    monkeypatch.setattr("rich.console.Console.is_terminal", True)
    for counted, share in (
        (True, "MofNCompleteColumn"),
        (False, "TaskProgressColumn"),
    ):
        with progress.bar("runs", 8.0, counted=counted) as bar:
            bar.advance(2.0)
            bar.reached(3.0, 9.0)
            bar.says("more", 0.5)
        columns = []
        for column in rich.call_args.args:
            columns.append(type(column).__name__)
        assert columns == ["TextColumn", "BarColumn", share, "TextColumn"]
        console = rich.call_args.kwargs["console"]
        assert rich.call_args.kwargs == {"transient": True, "console": console}
        assert console.stderr
    task = (bars := rich.return_value.__enter__.return_value).add_task.return_value
    states = (2.0, 8.0, "runs"), (3.0, 9.0, "runs"), (3.5, 9.0, "more")
    drawn = []
    for done, total, what in states:
        fields = {"completed": done, "total": total, "description": what, "left": "0 s left"}
        drawn.append(call.update(task, **fields))
    assert bars.mock_calls[-4:] == [call.add_task("runs", total=8.0, left=""), *drawn]


def test_a_log_gets_a_line_each_ten_seconds(monkeypatch, capsys):
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    with progress.bar("duffing", 40.0) as bar:
        for _ in range(40):
            now[0] += 1.0
            bar.advance(1.0)
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines()[:2] == ["duffing, 25 %, 30 s left", "duffing, 50 %, 20 s left"]
    assert len(err.splitlines()) == 4


def test_a_notebook_s_line_is_replaced_by_the_next_and_leaves_nothing(monkeypatch, capsys):
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    monkeypatch.setattr("rich.console._is_jupyter", lambda: True)
    monkeypatch.setattr("IPython.display.DisplayHandle", handle := MagicMock())
    with progress.bar("film", 4.0):
        pass
    assert handle.return_value.mock_calls == []
    with progress.bar("film", 40.0) as bar:
        for _ in range(29):
            now[0] += 1.0
            bar.advance(1.0)
    lines = "film, 25 %, 30 s left", "film, 50 %, 20 s left", ""
    first, *later = [{"text/plain": line} for line in lines]
    displayed = [call.display(first, raw=True), *(call.update(line, raw=True) for line in later)]
    assert handle.return_value.mock_calls == displayed
    assert capsys.readouterr() == ("", "")


def test_the_time_left_is_the_median_of_pieces_that_were_not_read_from_a_file(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    bar = progress.Bar("pid", 6.0)
    said = []
    for i, seconds in enumerate((0.01, 90.0, 4.0, 5.0)):
        now[0] += seconds
        bar.add_piece(seconds, 5 - i)
        bar.reached(i + 1.0, 6.0)
        said.append(str(bar).rpartition(", ")[2])
    now[0] += 3.0
    assert [*said, bar.left] == [
        "0 s left",
        "6 min left",
        "3 min left",
        "10 s left",
        "7 s left",
    ]


def test_a_count_is_of_whole_runs_and_of_runs_a_second(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    said: list[str] = []
    monkeypatch.setattr(progress.Bar, "says", lambda bar, text, work=0.0: said.append(text))
    with progress.counter(8, 800, shown=True) as stepped:
        now[0] = 104.0
        stepped(250)
    with progress.counter(0, 0, shown=True):
        pass
    assert said == [
        "0 of 8 simulations, 0 per second",
        "2 of 8 simulations, 0.625 per second",
        "0 of 0 simulations, 0 per second",
    ]


def test_pieces_of_work_are_reported_as_their_sum():
    reports: list[tuple[float, float]] = []
    add = progress.summed(lambda *both: reports.append(both), 1.5, 9.0)
    add(2.0)
    add(0.25)
    assert reports == [(3.5, 9.0), (3.75, 9.0)]


def test_no_time_is_estimated_before_a_tenth_is_done(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    bar = progress.Bar("tuning", 100.0)
    now[0] = 9.0
    bar.advance(9.0)
    assert str(bar) == "tuning, 9 %"
    bar.advance(1.0)
    assert str(bar) == "tuning, 10 %, 81 s left"


def test_a_function_is_told_of_progress():
    reports = []
    scenario = smc.Scenario(plant="duffing", law="pid", duration=0.1)
    smc.run([scenario] * 3, progress=lambda text, share: reports.append((text, share)))
    text, share = reports[-1]
    assert "3 runs" in text
    assert share == 1.0
    with pytest.raises(smc.ScenarioError, match="give True or False"):
        smc.run(scenario, progress=1.5)
