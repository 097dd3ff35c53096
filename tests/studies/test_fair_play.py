"""Cheats: laws that know more than their measurements. Each must be impossible, or marked in the table."""

import json
import secrets
import sys
from pathlib import Path

import mujoco
import numpy as np
import pyarrow.parquet as pq
import pytest

import smc_mujoco as smc
from smc_mujoco.simulation import philox
from smc_mujoco.simulation.scenario import MAX_SEED
from smc_mujoco.studies import noise_key, study

NOISY = {"plant": "duffing", "duration": 0.4, "noise": smc.Noise(position=0.01, velocity=0.05)}
CALLS = [0]


@smc.law_function(gains={"k": 5.0})
def honest(y, gains, memory):
    return -gains.k * (y.de + 3.0 * y.e), y.e


@smc.law_function(gains={"k": 5.0}, memory=4)
def tries_seeds(y, gains, memory):
    """Find the seed whose noise explains the second reading best, and take its noise away from all later ones."""
    k = round(y.t / y.dt)
    if k == 1:
        best = 1e9
        for seed in range(64):
            z, before = philox.normals(seed, 0, 0, 1), philox.normals(seed, 0, 0, 0)
            v, v0 = y.v - 0.05 * z[1], memory[2] - 0.05 * before[1]
            x, x0 = y.x - 0.01 * z[0], memory[1] - 0.01 * before[0]
            miss = abs(x - x0 - y.dt * 0.5 * (v + v0)) / 0.0001 + abs(v - v0) / 0.01
            if miss < best:
                best, memory[0] = miss, seed
    memory[1], memory[2] = (y.x, y.v) if k == 0 else (memory[1], memory[2])
    z = philox.normals(int(memory[0]), 0, 0, k) if k else (0.0, 0.0)
    return -gains.k * (y.v - 0.05 * z[1] + 3.0 * (y.x - 0.01 * z[0])), y.e


def plant_data():
    """The MjData of the run that calls, found in the frames of the callers."""
    frame = sys._getframe()
    while frame is not None:
        for value in list(frame.f_locals.values()):
            if isinstance(value, mujoco.MjData):
                return value
        frame = frame.f_back
    return None


@smc.law_function(gains={"k": 5.0})
def peeks(y, gains, memory):
    data = plant_data()
    x, v = (y.x, y.v) if data is None else (float(data.qpos[0]), float(data.qvel[0]))
    return -gains.k * (v + 3.0 * x), y.e


@smc.law_function(gains={"k": 5.0})
def gives_up(y, gains, memory):
    """Return NaN from the second sample on where it would do badly: at starts on one side."""
    bad = y.x > 1.55 if y.t == 0.0 else memory[0] != 0.0
    memory[0] = 1.0 if bad else 0.0
    return (np.nan if bad and y.t > 0.0 else -gains.k * (y.de + 3.0 * y.e)), y.e


@pytest.fixture(autouse=True)
def drawn(monkeypatch):
    """Draw keys here, which are fixed in all other tests."""
    monkeypatch.setattr(noise_key, "draw_key", lambda: secrets.randbelow(MAX_SEED) + 1)


# the noise


def rates(key):
    """Variation of u of the honest law and of the one that tries the public seeds."""
    runs = [
        smc.Scenario(**NOISY, law=law, seed=seed, noise_key=key, x0=0.4)
        for law in (honest, tries_seeds)
        for seed in (3, 41)
    ]
    scores = [smc.score(trace)["tv_rate"] for trace in smc.run(runs)]
    return np.mean(scores[:2]), np.mean(scores[2:])


def test_a_law_that_tries_the_public_seeds_knows_nothing_of_a_keyed_run():
    fair, cheat = rates(0)
    assert cheat < 0.1 * fair  # with public seeds it pays
    fair, cheat = rates(9_007_199_254_000_000)
    assert cheat > fair


def test_the_key_changes_all_random_numbers_and_both_loops_agree():
    from smc_mujoco.simulation import reference

    fields = NOISY | {"disturbance": smc.signals.OrnsteinUhlenbeck(0.5, 0.1)}
    keyed = smc.Scenario(**fields, law=honest, seed=3, noise_key=5)
    other = smc.Scenario(**fields, law=honest, seed=3)
    assert keyed != other
    assert keyed.noise_seed != 3 == other.noise_seed
    assert np.array_equal(smc.run(keyed).u, reference.run(keyed).u)
    assert not np.array_equal(smc.run(keyed).u, smc.run(other).u)
    assert 0 <= keyed.noise_seed <= MAX_SEED


def test_a_study_draws_a_key_keeps_it_and_repeats_with_it(tmp_path):
    runs = smc.grid("duffing", [honest, "pid"], "noise", seeds=2, duration=0.1)
    first = smc.study(runs, tmp_path / "a", noise_key="drawn")
    again = smc.study(runs, tmp_path / "a", noise_key="drawn")
    other = smc.study(runs, tmp_path / "b", noise_key="drawn")
    (key,) = {*first.column("noise_key").tolist()}
    repeated = smc.study(runs, tmp_path / "c", noise_key=key)
    assert again.data.equals(first.data)
    assert repeated.data.equals(first.data)
    assert {*other.column("noise_key").tolist()} != {key}
    assert first.column("condition").tolist() == ["noise"] * 4
    assert first.scenario(0).noise_key == key
    assert {*smc.study(runs, tmp_path / "d").column("noise_key").tolist()} == {0}


def test_a_key_that_an_author_may_have_read_is_not_used_for_another_law(tmp_path, capsys):
    runs = smc.grid("duffing", [honest], "noise", seeds=1, duration=0.05)
    (key,) = smc.study(runs, tmp_path, noise_key="drawn").column("noise_key").tolist()
    library = smc.grid("duffing", [honest, "pid"], "noise", seeds=1, duration=0.05)
    assert {*smc.study(library, tmp_path, noise_key="drawn").column("noise_key").tolist()} == {key}
    gains = smc.grid("duffing", [honest(k=float(key % 1000))], "noise", seeds=1, duration=0.05)
    assert smc.study(gains, tmp_path, noise_key="drawn").column("noise_key").tolist() != [key]
    assert (
        "law honest has changed (its gains): a new noise key is drawn, and all runs are done again"
        in capsys.readouterr().err
    )


def test_a_study_that_begins_again_says_which_law_has_changed_and_which_of_its_variables(tmp_path, capsys):
    script = """
import smc_mujoco as smc
WIDTH = {width}
def size():
    return WIDTH
@smc.law_function(gains={{"k": 2.0}})
def mine(y, gains, memory):
    return -gains.k * (y.e + y.de) / {reads}, y.e
"""

    def ran(width, reads="WIDTH", **gains):
        space = {}
        exec(script.format(width=width, reads=reads), space)
        runs = smc.grid("duffing", [space["mine"](**gains)], duration=0.05)
        smc.study(runs, tmp_path, noise_key="drawn")
        return capsys.readouterr().err.strip().partition(":")[0]

    assert [ran(0.2), ran(0.2)] == ["", ""]
    assert ran(0.3) == "law mine has changed (WIDTH)"
    assert ran(0.3, k=3.0) == "law mine has changed (its gains)"
    assert ran(0.3, "(2.0 * WIDTH)", k=3.0) == "law mine has changed (its code)"


@smc.law_function(gains={"k": 5.0})
def looks(y, gains, memory):
    """Note which files of the study tell its key while it runs."""
    for file in filter(Path.is_file, LOOKED["folder"].rglob("*")):
        text = str(pq.read_table(file).to_pylist()) if file.suffix == ".parquet" else file.read_bytes().decode("latin1")
        LOOKED["calls"] += 1
        LOOKED["told"] += [file.name] * (str(LOOKED["key"]) in text)
    return -gains.k * (y.de + 3.0 * y.e), y.e


LOOKED = {"calls": 0, "told": [], "folder": Path(), "key": 0}


@pytest.mark.filterwarnings("ignore:.*the run takes the reference loop")
def test_the_key_is_in_the_folder_after_the_last_run_only(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr(noise_key, "draw_key", lambda: 8_111_222_333_444_555)
    monkeypatch.setitem(LOOKED, "folder", tmp_path / "a")
    monkeypatch.setitem(LOOKED, "key", 8_111_222_333_444_555)
    runs = smc.grid("duffing", ["pid", looks], "noise", seeds=2, duration=0.01)
    smc.study(runs[::2], tmp_path / "a", noise_key="drawn", half_steps=True)  # parts, of the package's law
    assert LOOKED["key"] == noise_key.json.loads((tmp_path / "a" / "noise_key.json").read_text())["key"]
    (tmp_path / "a" / "results.parquet").unlink()
    noise_key.forget(tmp_path / "a")
    table = smc.study(runs, tmp_path / "a", noise_key="drawn", traces="all", half_steps=True)
    told = LOOKED["told"]
    assert LOOKED["calls"] > 20
    first = told.index("noise_key.json")  # while the traces are made, after the last run
    assert not told[:first]
    assert {*table.column("noise_key").tolist()} == {LOOKED["key"]}
    assert table.column("checked").tolist() == [run.checked for run in runs]
    assert table.scenario(1).noise_key == LOOKED["key"]
    assert not list((tmp_path / "state").rglob("*.json"))


def test_a_study_that_was_killed_goes_on_with_its_key(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    runs = smc.grid("duffing", [honest, "pid"], "noise", seeds=3, duration=0.05)

    def killed(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(noise_key, "publish", killed)
        with pytest.raises(KeyboardInterrupt):
            smc.study(runs, tmp_path / "a", noise_key="drawn")
    assert not noise_key.public(tmp_path / "a")
    (tmp_path / "a" / "results.parquet").unlink()
    (kept,) = (tmp_path / "state").rglob("*.json")
    key = json.loads(kept.read_text())["key"]
    assert kept.stat().st_mode & 0o77 == 0
    computed = []
    monkeypatch.setattr(study, "_compute", lambda missing, *_: computed.extend(missing))
    table = smc.study(runs, tmp_path / "a", noise_key="drawn")
    assert not computed
    assert {*table.column("noise_key").tolist()} == {key}
    monkeypatch.undo()
    given = smc.study(runs, tmp_path / "b", noise_key=key)
    assert given.data.equals(table.data)


@pytest.mark.filterwarnings("ignore:.*the run takes the reference loop")
def test_no_unchecked_law_runs_again_with_a_public_key(tmp_path, capsys):
    runs = [smc.grid("duffing", [law], "noise", seeds=n, duration=0.01) for n in (1, 2) for law in (peeks, honest)]
    keys = [[smc.study(its, tmp_path / its[0].law.name, noise_key="drawn").column("noise_key")[0]] for its in runs]
    assert keys[1] == keys[3]
    assert keys[0] != keys[2]
    assert "an unchecked law may have read the noise key: a new one is drawn" in capsys.readouterr().err


@pytest.mark.parametrize("key", ["often", -1, 2**53, 1.5])
def test_a_wrong_key_is_one_sentence(tmp_path, key):
    with pytest.raises(smc.ScenarioError, match="noise_key is "):
        smc.study(smc.grid("duffing", "pid", duration=0.05), tmp_path, noise_key=key)


# the ranking


@pytest.mark.filterwarnings("ignore:.*the run takes the reference loop")
def test_an_unchecked_law_is_marked_and_wins_over_no_checked_one(tmp_path):
    table = smc.study(smc.grid("duffing", [calm, honest], "noise", 12, duration=1.0), tmp_path)
    (board,) = smc.leaderboard(table, ["tv_rate"], defaults=True)
    assert [(entry.law, entry.checked) for entry in board.entries] == [("calm", False), ("honest", True)]
    assert board.winner is None
    assert board.result == "no winner: calm is ahead of checked laws, but unchecked"
    asked = smc.leaderboard(table, ["tv_rate"], defaults=True, unchecked=True)
    assert asked[0].winner == "calm"
    assert "unchecked" in str(asked)
    assert "'unchecked': its code" in str(asked)


@smc.law_function(gains={"k": 5.0})
def calm(y, gains, memory):
    CALLS.append(CALLS.pop() + 1)
    return 0.0, y.e


# runs that fail


def test_a_law_that_gives_up_is_never_among_the_best(tmp_path):
    runs = smc.grid("duffing", [honest, gives_up], "noise", seeds=16, duration=0.3)
    table = smc.study(runs, tmp_path)
    failed = sum(failure is not None for failure in table.select(law="gives_up").column("failure"))
    assert 0 < failed < 16
    for board in smc.leaderboard(table, ["itae", "tv_rate", "settling_time"]):
        best = {entry.law for entry in board.entries if entry.rank.best}
        assert "gives_up" not in best, board.metric
        assert board.winner != "gives_up"
