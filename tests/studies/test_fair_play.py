"""Cheats: laws that know more than their measurements. Each must be impossible, or shown in the table."""

import json
import secrets
import sys
import threading
import time

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.simulation import philox
from smc_mujoco.simulation.scenario import MAX_SEED
from smc_mujoco.studies import noise_key, replay
from smc_mujoco.studies.replay import replays

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
def peeks_for_s(y, gains, memory):
    return -gains.k * (y.de + 3.0 * y.e), y.e if (data := plant_data()) is None else float(data.qpos[0])


@smc.estimator_function
def peeking_estimator(y, gains, memory):
    return y.v if (data := plant_data()) is None else float(data.qvel[0])


@smc.estimator_function
def honest_estimator(y, gains, memory):
    return y.v


@smc.surface_function(gains={"c": 3.0})
def honest_surface(y, gains, memory):
    return y.de + gains.c * y.e, 0.0


@smc.law_function(gains={"k": 5.0})
def writes(y, gains, memory):
    if (data := plant_data()) is not None:
        data.qpos[0] *= 0.9
    return -gains.k * (y.de + 3.0 * y.e), y.e


@smc.law_function(gains={"k": 5.0})
def counts_calls(y, gains, memory):
    CALLS.append(CALLS.pop() + 1)
    return -gains.k * (y.de + 3.0 * y.e) * (1.0 + 0.01 * (CALLS[0] * 0.618 % 1.0)), y.e


@smc.law_function(gains={"k": 5.0})
def reads_the_clock(y, gains, memory):
    return -gains.k * (y.de + 3.0 * y.e) * (1.0 + 0.01 * (time.perf_counter_ns() % 7)), y.e


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


CHEATS = {law.name: law for law in (peeks, writes, counts_calls, reads_the_clock, peeks_for_s)}


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

    fields = NOISY | {"disturbance": smc.OrnsteinUhlenbeck(0.5, 0.1)}
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


@pytest.mark.parametrize("key", ["often", -1, 2**53, 1.5])
def test_a_wrong_key_is_one_sentence(tmp_path, key):
    with pytest.raises(smc.ScenarioError, match="noise_key is "):
        smc.study(smc.grid("duffing", "pid", duration=0.05), tmp_path, noise_key=key)


# replays


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*the run takes the reference loop")
def test_a_replay_tells_cheats_from_honest_laws():
    fields = NOISY | {"noise_key": 77}
    laws = [honest(), *(law() for law in CHEATS.values()), smc.law("super_twisting"), smc.law("pid")]
    runs = [smc.Scenario(**fields, law=law) for law in laws]
    runs += [
        smc.Scenario(
            plant="inverted_pendulum", law="classical", model="nominal", sensor=smc.Encoder(4096), duration=0.4
        ),
        smc.Scenario(plant="double_pendulum", law=smc.law("computed_torque_sliding"), duration=0.3),
        smc.Scenario(plant="duffing", law="pid", clock=smc.Clock(jitter=0.0005, missed=0.1), duration=0.4),
        smc.Scenario(plant="duffing", law="pid", friction=smc.Coulomb(0.1), actuator=smc.DCMotor(), duration=0.4),
        smc.Scenario(plant="duffing", law=honest, feedforward=smc.Sine(1.0, 2.0), input_delay=0.002, duration=0.4),
    ]
    quiet = fields | {"noise": smc.Noise(position=0.002, velocity=0.01), "model": "nominal"}
    runs += [smc.Scenario(**quiet, law=law) for law in (peeks(k=0.2), honest)]  # which change u by less than 1 % of it
    runs += [
        smc.Scenario(**fields, law=honest, velocity=honest_estimator),
        smc.Scenario(**fields, law="classical", surface=honest_surface),
    ]
    found = dict(zip([f"{i} {run.law.name}" for i, run in enumerate(runs)], replays(smc.run(runs)), strict=True))
    assert {name.partition(" ")[2] for name, one in found.items() if not one.same} == {*CHEATS}
    assert [one.same for name, one in found.items() if name.endswith(" peeks")] == [False, False]
    assert "the plant does not move as recorded" in found["2 writes"].why
    assert "the law computes other commands from its measurements alone" in found["1 peeks"].why


@pytest.fixture
def here(monkeypatch):
    """Replay in this process."""
    monkeypatch.setattr(replay, "_in_fresh_process", lambda task, given: getattr(replay, task)(given))


@pytest.mark.filterwarnings("ignore:.*the run takes the reference loop")
def test_an_estimator_of_a_user_s_is_replayed_without_the_plant(here):
    brief = NOISY | {"noise_key": 77, "law": honest(k=0.2), "duration": 0.02}
    runs = [smc.Scenario(**brief, velocity=each) for each in (peeking_estimator, honest_estimator)]
    assert [one.same for one in replays(smc.run(runs))] == [False, True]


def test_a_law_that_ends_its_process_is_a_cheat_and_one_that_cannot_be_sent_stops_no_other(here, monkeypatch):
    lock = threading.Lock()

    @smc.law_function
    def locked(y, gains, memory):
        return -5.0 * y.e + 0.0 * (lock is None), y.e

    def ends(task, given):
        if task == "commands_of" and any(b"honest" in law for law, _ in given):
            raise smc.ScenarioError("a replay failed in its process")
        return getattr(replay, task)(given)

    monkeypatch.setattr(replay, "_in_fresh_process", ends)
    runs = [smc.Scenario(plant="duffing", law=law, duration=0.01) for law in (locked, honest, smc.law("pid"))]
    with pytest.warns(smc.PlainLoopWarning):
        unsent, ended, fair = replays(smc.run(runs))
    assert unsent.same is None
    assert "cannot be sent to another process" in unsent.why
    assert ended == (False, "the law ends the process in which it is replayed, or takes too long there")
    assert fair.same


@pytest.mark.filterwarnings("ignore:.*the run takes the reference loop")
def test_a_cheat_is_a_failure_in_the_table(tmp_path, here):
    runs = smc.grid("duffing", [honest, peeks, counts_calls, "pid"], "noise", seeds=2, duration=0.4)
    table = smc.study(runs, tmp_path, noise_key=5, replay=True)
    rows = {}
    for row in table.rows():
        rows.setdefault(row["law"], []).append((row["replayed"], row["failure"]))
    assert sorted(rows["honest"], key=str) == [(None, None), (True, None)]
    assert rows["pid"] == [(None, None)] * 2
    for cheat in ("peeks", "counts_calls"):
        ((verdict, why),) = [row for row in rows[cheat] if row[0] is not None]
        assert verdict is False
        assert why
    boards = smc.leaderboard(table, ["tv_rate"])
    assert {entry.law: entry.failed for entry in boards[0].entries} == {
        "honest": 0,
        "peeks": 1,
        "counts_calls": 1,
        "pid": 0,
    }
    results = json.loads((tmp_path / "replays.json").read_text())
    assert len(results) == 3


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
