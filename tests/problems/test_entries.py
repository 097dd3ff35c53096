"""Entries, entering and results: what is taken and refused, and where entries stand."""

import shutil

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import read_json, write_json
from smc_mujoco.problems import enter as entering
from smc_mujoco.problems import entry, entry_runs, results, suite

LAW = """import math

import smc_mujoco as smc


@smc.law_function(gains={"k": 4.0})
def own(y, gains, memory):
    return %s, 0.0
"""
PLAIN = LAW % "-gains.k * math.tanh(y.v + 2.0 * y.e)"
ABOUT = {
    "name": "own law",
    "authors": ["A"],
    "source": "here",
    "licence": "MIT",
    "division": "one set",
}
PROBLEMS = ("duffing/noise@1", "van_der_pol/sine@1")


def written(folder, code=PLAIN, gains="", **about):
    """Return a folder with an entry."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "law.py").write_text(code, encoding="utf-8")
    lines = []
    for key, value in (ABOUT | about).items():
        lines.append(f"{key} = {value!r}".replace("'", '"'))
    (folder / "entry.toml").write_text("\n".join([*lines, gains]), encoding="utf-8")
    return folder


@pytest.fixture
def small(monkeypatch):
    """Let suites have two problems."""
    monkeypatch.setattr(suite, "suite", lambda name: PROBLEMS)


@pytest.mark.quick
def test_an_entry_has_its_gains_on_each_plant(tmp_path):
    fixed = entry.read_entry(written(tmp_path / "one", gains="[gains.all]\nk = 2.5"))
    assert fixed.law("duffing").gains["k"] == 2.5
    assert fixed.law("furuta").gains["k"] == 2.5
    # of the library: shipped gains, defaults
    assert [entry.read_entry(name).division for name in ("pid", "geometric")] == [
        "search",
        "one set",
    ]
    free = entry.read_entry(
        written(tmp_path / "free", gains="[gains.duffing]\nk = 2.5", division="free")
    )
    assert free.law("duffing").gains["k"] == 2.5
    assert free.law("van_der_pol").gains["k"] == 4.0
    assert free.law("duffing").name == "own law"
    assert fixed.digest != free.digest


def test_an_entry_has_one_law(tmp_path):
    folder = written(tmp_path / "entry")
    (folder / "law.c").write_text("", encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"law.py and law.c"):
        entry.read_entry(folder)


def test_entering_twice_gives_equal_bytes_and_a_changed_table_is_refused(tmp_path, small):
    """The whole road of a round: a drawn seed, results beside the visible ones, verified, and
    compared with an archive.
    """
    folder = written(tmp_path / "entry")
    out = tmp_path / "results"
    visible = entering.enter(folder, out=out, instances=2)
    target = entering.enter(folder, seed=7, out=out, instances=2)
    assert target == out / "smc-30@1-seed-7" / "own_law"
    assert (
        entering.enter(
            folder,
            seed=7,
            out=out,
            instances=2,
            verify=True,
        )
        == target
    )
    entered = smc.results(target.parent)
    about = entered.entries["own law"].about
    assert about["seed"] == 7
    assert about["failed"] == 0
    assert entered.title == "smc-30@1, seed 7"
    drawn = entered.entries["own law"].runs.columns(PROBLEMS[0])["itae"]
    assert not np.array_equal(
        drawn, entry_runs.EntryRuns(visible / "runs.parquet").columns(PROBLEMS[0])["itae"]
    )
    with pytest.raises(ScenarioError, match="seed 7"):
        entered.compare(smc.results(visible.parent))
    archive = shutil.make_archive(str(tmp_path / "packed"), "zip", target.parent)
    assert str(entered.compare(smc.results(archive))).count("0 worse, 0 better") == 4
    written(tmp_path / "entry", gains="[gains.all]\nk = 2.0")
    with pytest.raises(ScenarioError, match="not what"):
        entering.enter(folder, out=out, instances=2, verify=True)
    shutil.copy(visible / "runs.parquet", target)
    with pytest.raises(ScenarioError, match="not the table that its result was written for"):
        smc.results(target.parent)


@pytest.mark.parametrize(
    "other",
    [
        {"name": "Own law"},  # whose result would be in the same folder
        {"authors": ["B"]},
        {"code": LAW % "-gains.k * y.e"},
        {"gains": "[gains.all]\nk = 2.0"},
    ],
)
def test_no_entry_replaces_another_of_its_name(other, tmp_path):
    target = tmp_path / "results" / "smc-30@1" / "own_law"
    first = entry.read_entry(written(tmp_path / "first"))
    write_json(target / "result.json", {"entry": first.about})
    with pytest.raises(ScenarioError, match="another entry, 'own law': give this one another name"):
        entering.enter(written(tmp_path / "second", **other), out=tmp_path / "results")
    assert read_json(target / "result.json")["entry"]["digest"] == first.digest


def test_a_file_about_an_entry_may_begin_with_a_byte_order_mark(tmp_path):
    folder = written(tmp_path / "entry")
    about = (folder / "entry.toml").read_bytes()
    (folder / "entry.toml").write_bytes(b"\xef\xbb\xbf" + about)
    assert entry.read_entry(folder).name == "own law"


def test_an_entry_that_is_stopped_goes_on_and_gives_the_same_bytes(tmp_path, small, monkeypatch):
    """What is done is not computed twice, unless the law or the instances are others."""
    uninterrupted = entering.enter(written(tmp_path / "entry"), out=tmp_path / "whole", instances=2)
    assert sorted(path.name for path in uninterrupted.iterdir()) == ["result.json", "runs.parquet"]
    table, parts = tmp_path / "runs.parquet", tmp_path / "parts"
    job = {"problems": PROBLEMS, "count": 2, "seed": 0, "table": table, "parts": parts}
    job["folder"] = tmp_path / "entry"
    computed = []
    runs_of = entry_runs.instance_rows

    def rows(one, *arguments):
        if len(computed) == 1 and not table.exists():
            raise KeyboardInterrupt
        computed.append(one.id)
        return runs_of(one, *arguments)

    monkeypatch.setattr(entry_runs, "instance_rows", rows)
    with pytest.raises(KeyboardInterrupt):
        entering.run(**job)
    assert computed == [PROBLEMS[0]]
    table.touch()
    entering.run(**job)
    assert computed == [*PROBLEMS]
    assert table.read_bytes() == (uninterrupted / "runs.parquet").read_bytes()
    for changed in ({"count": 1}, {"seed": 7}, {}):
        if not changed:
            (tmp_path / "entry" / "beside.py").write_text("")
        entering.run(**job | changed)
    assert computed == 4 * [*PROBLEMS]


@pytest.mark.slow
def test_failed_runs_are_told_and_stand_last(tmp_path, small):
    out = tmp_path / "results"
    entering.enter(
        written(tmp_path / "entry", LAW % "gains.k * y.e / 0.0 * 0.0"), out=out, instances=1
    )
    entering.enter(written(tmp_path / "fine", name="fine law"), out=out, instances=1)
    entered = smc.results(out / "smc-30@1")
    about = entered.entries["own law"].about
    assert about["failed"] == 2
    assert "duffing" in about["failures"][0]
    assert [standing.entry for standing in entered.boards()["speed"].standings] == [
        "fine law",
        "own law",
    ]


def made(medians):
    """Return results of entries with given medians on the problems of smc-30@1, (entry -> factor of
    each problem).
    """
    suite_results = results.Results("smc-30@1", 0, {})
    for name, values in medians.items():
        result = object.__new__(results.EntryResult)
        rows = {}
        for cell, value in zip(suite_results.problems, values, strict=True):
            rows[cell] = dict.fromkeys(entry_runs.VALUES, value)
        result.__dict__["medians"] = rows
        result.targets = lambda problems, measure: np.zeros(0)  # pyright: ignore[reportAttributeAccessIssue]
        suite_results.entries[name] = result
    return suite_results


def test_equal_entries_share_a_place_and_one_that_is_better_is_first():
    middle = np.linspace(0.1, 1.0, 30)
    board = made(
        {
            "a": middle,
            "b": middle,
            "c": 0.5 * middle,
            "d": 2.0 * middle,
        }
    ).board("speed")
    places = {}
    for standing in board.standings:
        places[standing.entry] = (standing.place, standing.rank, standing.best)
    assert places == {
        "c": (1, 1.0, True),
        "a": (2, 2.5, False),
        "b": (2, 2.5, False),
        "d": (4, 4.0, False),
    }
    close = made({"a": middle, "b": middle * np.where(np.arange(30) % 2, 0.9, 1.1)}).board("speed")
    for standing in close.standings:
        assert standing.best


def test_a_change_says_where_and_by_how_much():
    old = np.full(30, 1.0)
    new = old.copy()
    new[:4] = (1.2, 1.5, 1.1, 0.8)
    changes = made({"a": new}).compare(made({"a": old})).changes
    (change,) = [change for change in changes if change.question == "speed"]
    worst = suite.suite("smc-30@1")[1]
    assert str(change) == f"a, speed: 3 worse, 1 better, of 30; at most 1.5 times, in {worst}"
    assert not made({"a": old * 1.005}).compare(made({"a": old})).worse


def test_variation_of_u_counts_only_where_the_easiest_accuracy_is_kept(tmp_path):
    """Else who does nothing is the calmest: here three runs of five keep no accuracy, and one of
    five in the other.
    """
    groups = []
    for name, accurate in zip(PROBLEMS, (2, 4), strict=True):
        easiest = f"accuracy_{len(smc.problem(name).targets['accuracy'])}"
        group = []
        for i in range(5):
            row = dict.fromkeys(entry_runs.VALUES, 0.1 * (i + 1)) | {"problem": name, "instance": i}
            group.append(row | {easiest: 1.0 if i < accurate else np.nan})
        groups.append(group)
    entry_runs.write_rows(tmp_path / "runs.parquet", groups)
    medians = entry_runs.EntryRuns(tmp_path / "runs.parquet").medians()
    assert [medians[name]["calm"] for name in PROBLEMS] == [np.inf, pytest.approx(0.3)]
