"""Entries, entering and results: what is taken, refused and marked, and where entries stand."""

import re
import shutil

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.benchmark import commands, entrant, entry, results, runs, suite
from smc_mujoco.benchmark import enter as entering
from smc_mujoco.common import guard
from smc_mujoco.common.errors import ScenarioError

HEAD = "import math\n\nimport smc_mujoco as smc\n\n\n"
LAW = '@smc.law_function(gains={"k": 4.0})\ndef own(y, gains, memory):\n    """Own."""\n    return %s, 0.0\n'
PLAIN = HEAD + LAW % "-gains.k * math.tanh(y.v + 2.0 * y.e)"
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
    lines = [f"{key} = {value!r}".replace("'", '"') for key, value in (ABOUT | about).items()]
    (folder / "entry.toml").write_text("\n".join([*lines, gains]), encoding="utf-8")
    return folder


@pytest.fixture
def small(monkeypatch):
    """Let suites have two problems."""
    monkeypatch.setattr(suite, "suite", lambda name: PROBLEMS)


def test_an_entry_has_its_gains_on_each_plant(tmp_path):
    one = entry.read(written(tmp_path / "one", gains="[gains.all]\nk = 2.5"))
    assert (one.law("duffing").gains["k"], one.law("furuta").gains["k"]) == (2.5, 2.5)
    assert [entry.read(name).division for name in ("pid", "geometric")] == [
        "search",
        "one set",
    ]  # shipped, defaults
    free = entry.read(written(tmp_path / "free", gains="[gains.duffing]\nk = 2.5", division="free"))
    assert (free.law("duffing").gains["k"], free.law("van_der_pol").gains["k"]) == (2.5, 4.0)
    assert free.law("duffing").name == "own law"
    assert one.digest != free.digest
    for plant in ("furuta", "acrobot"):
        its = entry.read(
            written(tmp_path / plant, gains=f"[gains.{plant}]\nk = 2.5", division="free")
        )
        assert its.law(plant).gains["k"] == 2.5


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"gains": '[gains."duffing/noise"]\nk = 2.0', "division": "free"},
            "duffing/noise",
        ),  # gains of a cell
        ({"gains": "[gains.duffing]\nk = 2.0"}, r"\[gains.all\]"),
        ({"gains": '[gains.all]\nk = "2"'}, "gain k"),
        ({"division": "best of many"}, "division"),
        ({"authors": []}, "authors"),
        ({"place": 1}, "place"),
        ({"code": "def ("}, "not Python"),
    ],
)
def test_an_entry_that_says_too_little_or_too_much_is_refused(change, words, tmp_path):
    with pytest.raises(ScenarioError, match=words):
        entry.read(written(tmp_path / "entry", **change))


def test_an_entry_has_one_law(tmp_path):
    folder = written(tmp_path / "entry")
    (folder / "law.c").write_text("", encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"law.py and law.c"):
        entry.read(folder)
    for file in folder.glob("law.*"):
        file.unlink()
    with pytest.raises(ScenarioError, match="none of them"):
        entry.read(folder)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("import os", "import os"),  # forks, files, the environment
        ("import time", "import time"),
        (
            "from smc_mujoco.benchmark import problem",
            "from smc_mujoco.benchmark import problem",
        ),  # peeks at the rules
        ("SEED = smc.problem('duffing/noise@1').instance(0).seed", ".problem"),  # public seeds
        ("KEY = open('noise_key').read()", "open"),
        ("RUN = math.__loader__", ".__loader__"),
        ("import numpy as np\nZ = np.load('z.npy')", ".load"),
        ("exec('import os')", "exec"),
        ("OPEN = getattr(math, 'x')", "getattr"),  # any name from a text
        (
            "import smc_mujoco as lib\nSEED = lib.problem('duffing/noise@1').instance(0).seed",
            ".problem",
        ),
        ("lib = smc\nSEED = lib.problem('duffing/noise@1').instance(0).seed", "smc"),
        ("import numpy as np\nnp.savez('z')", ".savez"),
        ("from numpy import *", r"from numpy import \*"),
        ("import numpy.ctypeslib", "import numpy.ctypeslib"),
        ("ALL = (i for i in []).gi_frame.f_builtins", ".gi_frame"),
        ("match math:\n    case object(__loader__=loader):\n        pass", "a match statement"),
    ],
)
def test_a_file_that_can_do_more_than_compute_is_told(line, words, tmp_path):
    cheat = entry.read(written(tmp_path / "entry", PLAIN.replace("\n\n\n", f"\n\n{line}\n\n", 1)))
    assert re.search(f"has {words}, which can do more than compute", cheat.why_unread)
    fair = "import numpy as np\nfrom math import pi\nK = np.array([np.sqrt(pi), np.inf])"
    first = "from __future__ import annotations"
    main = "if __name__ == '__main__':\n    K = max(K)\n"
    assert (
        entry.read(written(tmp_path / "fair", f"{first}\n{fair}\n{PLAIN}\n{main}")).why_unread == ""
    )


def test_entering_twice_gives_equal_bytes_and_a_forged_table_is_refused(
    tmp_path, small, monkeypatch
):
    folder = written(tmp_path / "entry")
    out = tmp_path / "results"
    target = entering.enter(folder, out=out, instances=2)
    assert (
        entering.enter(folder, out=out, instances=2, verify=True) == target
    )  # the same bytes again
    found = smc.results(target.parent)
    about = found.entries["own law"].about
    assert (about["checked"], about["marks"], len(found.entries["own law"].runs)) == (True, [], 4)
    with pytest.raises(
        ScenarioError, match="is the result of 'own law': give the entry another name"
    ):
        entering.enter(written(tmp_path / "same_folder", name="Own law"), out=out, instances=2)
    table = target / "runs.parquet"
    other = tmp_path / "other"
    shutil.copytree(target.parent, other)
    rows = [
        runs.rows(smc.problem(name), smc.problem(name).scenarios("pid", [0, 1]), [0, 1], [])
        for name in PROBLEMS
    ]
    runs.write(table, rows)  # the runs of another law
    with pytest.raises(ScenarioError, match="not the table that its result was written for"):
        smc.results(target.parent)
    monkeypatch.setattr(
        guard, "run_isolated", lambda module, job, limit: entrant.worker(job, lambda *stage: None)
    )
    with pytest.raises(ScenarioError, match="not what"):
        entering.enter(folder, out=out, instances=2, verify=True)
    for name in ("x" * 5000, "a\0b", "\ud800"):  # names that no file system takes
        with pytest.raises(ScenarioError, match=r"^the path is"):
            smc.results(name)
    archive = shutil.make_archive(str(tmp_path / "packed"), "zip", other)
    assert str(found.compare(smc.results(archive))).count("the same") == 4


def test_a_table_does_not_depend_on_how_many_runs_are_in_memory_at_once(tmp_path, monkeypatch):
    most = []
    tables = []
    rows = runs.rows
    monkeypatch.setattr(
        runs, "rows", lambda one, part, *rest: (most.append(len(part)), rows(one, part, *rest))[1]
    )
    order = {
        "folder": "pid",
        "number": "",
        "problems": PROBLEMS,
        "instances": [*range(5)],
        "timed": False,
    }
    for at_once in (2, 5):
        monkeypatch.setattr(entrant, "AT_ONCE", at_once)
        table = tmp_path / f"{at_once}.parquet"
        entrant.worker(
            order | {"rows": str(table), "count": str(tmp_path / "count")}, lambda stage: None
        )
        tables.append(table.read_bytes())
    assert most == [2, 2, 1, 2, 2, 1, 5, 5]
    assert tables[0] == tables[1]
    assert (tmp_path / "count").read_text() == "10"


STATEFUL = (
    HEAD + "SEEN = []\n\n\n" + LAW % "-gains.k * y.e - 1e-4 * (SEEN.append(y.e) or len(SEEN))"
)


@pytest.mark.slow
def test_a_law_that_keeps_something_between_runs_is_marked(tmp_path, small):
    target = entering.enter(
        written(tmp_path / "entry", STATEFUL), out=tmp_path / "results", instances=2
    )
    marks = smc.results(target.parent).entries["own law"].about["marks"]
    assert any(mark.startswith("unchecked: ") for mark in marks)
    assert any("keeps something between runs" in mark for mark in marks)


@pytest.mark.slow
def test_a_law_that_never_ends_is_stopped(tmp_path, small, monkeypatch):
    monkeypatch.setattr(entering, "TRIAL_TIME", 45.0)
    code = PLAIN.replace("    return", "    while y.e == y.e:\n        pass\n    return")
    with pytest.raises(
        ScenarioError, match=r"is not done .* duffing.* within 45 s: let its law end"
    ):
        entering.enter(written(tmp_path / "entry", code), out=tmp_path / "results", instances=1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("gains.k * y.e / 0.0 * 0.0", "2 of 2 runs fail"),
        ("float(len([0.0] * 10**10))", "MemoryError"),
    ],
)
def test_failed_runs_are_told_and_stand_last(body, words, tmp_path, small):
    out = tmp_path / "results"
    entering.enter(written(tmp_path / "entry", HEAD + LAW % body), out=out, instances=1)
    entering.enter(written(tmp_path / "fine", name="fine law"), out=out, instances=1)
    found = smc.results(out / "smc-30@1")
    assert words in found.entries["own law"].about["marks"][0]
    assert [one.entry for one in found.boards()["speed"].standings] == ["fine law", "own law"]


class Known:
    """Results with given medians, in place of a file."""

    def __init__(self, itae):
        self.itae = itae

    def medians(self):
        return {str(i): {"itae": value} for i, value in enumerate(self.itae)}


def test_a_law_that_knows_the_visible_instances_is_marked():
    rng = np.random.default_rng(5)
    visible = rng.uniform(0.1, 1.0, 30)
    assert (
        entering._better_on_visible(Known(visible), Known(visible * rng.uniform(0.8, 1.25, 30)))
        == []
    )
    (mark,) = entering._better_on_visible(Known(visible), Known(3.0 * visible))
    assert "30 of 30" in mark


def made(medians, checked=None, hidden=False):
    """Return results of entries with given medians on the problems of smc-30@1, (entry -> factor of
    each problem).
    """
    found = results.Results("smc-30@1", {}, hidden)
    for name, values in medians.items():
        one = object.__new__(results.Result)
        rows = {}
        for cell, value in zip(found.problems, values, strict=True):
            rows[cell] = dict.fromkeys(runs.VALUES, value)
        one.about = {
            "entry": {"name": name},
            "checked": (checked or {}).get(name, True),
            "marks": [],
        }
        one.__dict__["medians"] = rows
        one.targets = lambda problems, measure: np.zeros(0)  # pyright: ignore[reportAttributeAccessIssue]
        found.entries[name] = one
    return found


def test_equal_laws_are_level_and_a_better_one_is_first():
    middle = np.linspace(0.1, 1.0, 30)
    board = made({"a": middle, "b": middle, "c": 0.5 * middle, "d": 2.0 * middle}).board("speed")
    places = {one.entry: (one.place, one.rank, one.level) for one in board.standings}
    assert places == {
        "c": (1, 1.0, True),
        "a": (2, 2.5, False),
        "b": (2, 2.5, False),
        "d": (4, 4.0, False),
    }
    close = made({"a": middle, "b": middle * np.where(np.arange(30) % 2, 0.9, 1.1)}).board("speed")
    assert all(one.level for one in close.standings)


def test_laws_that_are_not_checked_have_no_place_on_hidden_instances():
    middle = np.linspace(0.1, 1.0, 30)
    entries = {"fast": 0.1 * middle, "slow": middle}
    shown = made(entries, {"fast": False}).board("speed")
    kept = made(entries, {"fast": False}, hidden=True).board("speed")
    assert [(one.entry, one.place) for one in shown.standings] == [("fast", 1), ("slow", 2)]
    assert [(one.entry, one.place) for one in kept.standings] == [("slow", 1), ("fast", None)]


def test_a_change_says_where_and_by_how_much():
    old = np.full(30, 1.0)
    new = old.copy()
    new[:3], new[3] = (1.2, 1.5, 1.1), 0.8
    (change,) = [
        c for c in made({"a": new}).compare(made({"a": old})).changes if c.question == "speed"
    ]
    problems = suite.suite("smc-30@1")
    assert str(change) == (
        f"a, speed: worse on 3 of 30, by up to 50 % ({problems[1]}); better on 1 of 30, by up to 20 % ({problems[3]})"
    )
    assert not made({"a": old * 1.005}).compare(made({"a": old})).worse


def test_the_process_of_an_entry_tells_which_run_differs(tmp_path):
    one = smc.problem(PROBLEMS[0])
    rows = runs.rows(one, one.scenarios("pid", [0, 1, 2]), [0, 1, 2], [])
    runs.write(tmp_path / "a.parquet", [rows])
    runs.write(tmp_path / "b.parquet", [rows[::-1]])
    assert entrant.same(tmp_path / "a.parquet", tmp_path / "b.parquet", [one.id]) == ""
    runs.write(tmp_path / "c.parquet", [[rows[0], rows[1] | {"itae": 0.1}, rows[2]]])
    assert entrant.same(tmp_path / "a.parquet", tmp_path / "c.parquet", [one.id]) == f"{one.id}#01"


def test_variation_of_u_counts_only_where_the_easiest_accuracy_is_kept(tmp_path):
    """Else who does nothing is the calmest: here three runs of five keep no accuracy, and one of
    five in the other.
    """
    groups = []
    for name, kept in zip(PROBLEMS, (2, 4), strict=True):
        easiest = f"accuracy_{len(smc.problem(name).targets['accuracy'])}"
        groups.append(
            [
                {
                    "problem": name,
                    "instance": i,
                    "failed": 0.0,
                    "accuracy": 0.01,
                    "itae": 1.0,
                    "settling": 1.0,
                }
                | {"calm": 0.1 * (i + 1), easiest: 1.0 if i < kept else np.nan}
                for i in range(5)
            ]
        )
    runs.write(tmp_path / "runs.parquet", groups)
    medians = runs.Runs(tmp_path / "runs.parquet").medians()
    assert [medians[name]["calm"] for name in PROBLEMS] == [np.inf, pytest.approx(0.3)]


def test_a_failure_of_a_file_that_can_do_more_than_compute_is_told_with_what_it_has(
    tmp_path, monkeypatch
):
    """As of one that forks: two processes then write one table, and the failure itself says little."""
    folder = written(
        tmp_path / "entry", PLAIN.replace("\n\n\n", "\n\nimport os\n\nos.fork()\n\n\n", 1)
    )

    def fails(module, order, timeout):
        raise guard.Failed("unloading", "cannot write runs.parquet", None, timeout)

    monkeypatch.setattr(guard, "run_isolated", fails)
    order = {
        "folder": str(folder),
        "number": "",
        "problems": PROBLEMS,
        "instances": [0],
        "timed": False,
    }
    with pytest.raises(
        ScenarioError,
        match=r"cannot write runs.parquet \(line . of law.py has import os, which can",
    ):
        entrant.run_isolated(order | {"rows": str(tmp_path / "rows")}, 1.0)


def test_the_command_tells_the_place_and_the_share_of_targets_of_each_question(
    tmp_path, monkeypatch, capsys
):
    found = made({"own law": np.linspace(0.1, 1.0, 30), "other": np.ones(30)})
    found.entries["own law"].folder = tmp_path
    found.entries["own law"].about["instances"] = 2
    for one in found.entries.values():
        one.targets = lambda problems, measure: np.array([0.5, np.inf])  # half of them
    monkeypatch.setattr(entering, "enter", lambda *_, **__: tmp_path)
    monkeypatch.setattr(results, "results", lambda *_, **__: found)
    commands.enter("own law", results=tmp_path)
    said = []
    for line in capsys.readouterr().out.splitlines():
        if line.endswith("of the targets"):
            said.append(line)
    rows = []
    for board in found.boards().values():
        rows.append(next(row for row in board.standings if row.entry == "own law"))
    assert [re.findall(r"\d+", line) for line in said] == [
        [f"{r.place}", "2", f"{100 * r.reached:.0f}"] for r in rows
    ]
