"""A study loses nothing: whatever befalls it, it ends with the same table, bit for bit."""

import functools
import os
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import runs
from helpers.runs import fails_late

import smc_mujoco as smc
from smc_mujoco.simulation import gaber_study as paper
from smc_mujoco.simulation import scenario_json
from smc_mujoco.simulation.grid import grid
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.run_key import condition
from smc_mujoco.studies import batches
from smc_mujoco.studies import study as store
from smc_mujoco.studies.study import study
from smc_mujoco.studies.table import Table

scenario = functools.partial(runs.scenario, duration=0.05)


def small(
    seeds: int = 2, conditions: tuple[str, ...] = ("nominal", "noise"), duration: float = 0.05
) -> list:
    return grid(["duffing"], ["observer_free", "classical"], conditions, seeds, "study", duration)


def bytes_of(out: Path) -> bytes:
    return (out / "results.parquet").read_bytes()


@pytest.fixture
def ran(monkeypatch):
    """The scenarios of all runs so far."""
    scenarios = []
    honest = batches.run_batch

    def counted(batch, *rest):
        scenarios.extend(trace.scenario for trace in batch)
        return honest(batch, *rest)

    monkeypatch.setattr(batches, "run_batch", counted)
    return scenarios


@pytest.fixture
def none_runs(monkeypatch):
    """From now on a run is an error."""

    def refuse(*_: object) -> None:
        raise AssertionError("a finished run is run again")

    return lambda: monkeypatch.setattr(batches, "run_batch", refuse)


@smc.law_function
def raises(y, gains, memory):
    return 1.0 / (y.t - y.t), y.e


# the grid


@pytest.mark.quick
def test_the_grid_is_every_combination_in_order():
    scenarios = grid(
        ["duffing", "van_der_pol"],
        ["classical", "adaptive"],
        ["nominal", "noise"],
        2,
        "study",
        duration=1.0,
    )
    names = []
    for s in scenarios:
        names.append((s.plant.name, condition(s), s.law.name, s.seed))
    assert names == [
        (plant, name, law, seed)
        for plant in ("duffing", "van_der_pol")
        for name in ("nominal", "noise")
        for law in ("classical", "adaptive")
        for seed in (0, 1)
    ]


def test_seed_0_is_the_papers_own_scenario():
    (scenario,) = grid(["pendulum_network"], ["classical"], ["noise"], 1, "study")
    assert scenario == paper.scenario("pendulum_network", "classical", "noise")


def test_a_seed_has_one_start_for_all_laws_and_conditions_near_the_papers():
    scenarios = grid(
        ["pendulum_network"], ["classical", "adaptive"], ["nominal", "coulomb"], [3, 4], "study"
    )
    starts = {}
    for s in scenarios:
        starts[s.seed] = {t.resolved.x0 for t in scenarios if t.seed == s.seed}
    for starts_of_seed in starts.values():
        assert len(starts_of_seed) == 1
    nominal = np.array(scenarios[0].plant.x0)
    for seed, (x0,) in starts.items():
        z = []
        for i in range(nominal.size):
            z.append(np.random.default_rng([seed, i]).uniform(-1.0, 1.0))
        assert np.allclose(x0, nominal * (1.0 + 0.2 * np.array(z)))
    assert starts[3] != starts[4]


@pytest.mark.slow
def test_no_start_lies_beyond_a_stop():
    scenarios = grid(paper.PLANTS, ["none"], ["contact"], 3, "study", duration=10.0)
    single = [s for s in scenarios if s.plant.n == 1]
    for s in single:
        assert 0.8 <= s.resolved.x0[0] / s.plant.x0[0] <= 1.0
    assert len({(s.plant.name, s.resolved.x0) for s in scenarios}) == len(paper.PLANTS) * 3
    for scenario in scenarios:
        prepare(scenario)  # checks the start


def test_laws_may_come_with_gains_of_their_own():
    law = smc.law("classical", k=2.5)
    assert [s.law for s in grid(["duffing"], [law], ["nominal"], 1)] == [law]
    assert [s.law for s in grid(["duffing"], [raises], ["nominal"], 1)] == [raises()]


def test_the_grid_takes_iterators():
    names = [["duffing", "van_der_pol"], ["classical", "adaptive"], ["nominal", "noise"]]
    once = grid(*map(iter, names), np.int64(2), "study")  # pyright: ignore[reportArgumentType]
    assert once == grid(*names, np.arange(2), "study")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"plants": ["dufing"]}, "did you mean 'duffing'"),
        ({"laws": ["clasical"]}, "did you mean 'classical'"),
        ({"conditions": ["noisy"]}, "unknown condition"),
        ({"seeds": 0}, "seeds is 0"),
        ({"seeds": [-1]}, "seed is -1"),
        ({"plants": 3}, "plants is 3: give several"),
        ({"plants": [3]}, "plant is 3"),
        ({"conditions": []}, "give several"),
        ({"seeds": None}, "seeds is None: give a whole number"),
        ({"plants": paper.PLANTS, "seeds": 10**6}, "5,000,000 runs: give fewer seeds"),
    ],
)
def test_what_the_grid_cannot_make_is_one_sentence(change, said):
    arguments = {
        "plants": ["duffing"],
        "laws": ["classical"],
        "conditions": ["noise"],
        "seeds": 1,
        "gains": "study",
    }
    with pytest.raises(smc.ScenarioError, match=said) as error:
        grid(**(arguments | change))
    assert "\n" not in str(error.value)


def test_what_cannot_be_studied_is_refused_before_anything_runs(tmp_path):
    with pytest.raises(smc.ScenarioError, match="cannot study 3"):
        study([*small(), 3], tmp_path / "a")
    (tmp_path / "file").write_text("")
    with pytest.raises(smc.ScenarioError, match="cannot use"):
        study(small(), tmp_path / "file")
    assert not (tmp_path / "a").exists()


# failures


def test_failed_runs_have_no_scores_and_their_own_words_in_any_company(tmp_path, monkeypatch):
    failing = [scenario(fails_late(when=when)) for when in (0.01, 0.02, 0.03)] + [
        scenario(raises()),
        *small(1),
    ]
    study(failing, tmp_path / "together")
    monkeypatch.setattr(batches, "MAX_WORK", 1)
    table = study(failing, tmp_path / "alone")
    assert bytes_of(tmp_path / "together") == bytes_of(tmp_path / "alone")
    said = table.column("failure")
    assert ["returned" in said[i] for i in range(3)] == [True] * 3
    assert "ZeroDivision" in said[3]
    assert said[4:].tolist() == [None] * 4
    assert np.allclose(table.column("diverged_at")[:4], [0.011, 0.021, 0.031, 0.0])
    assert np.isnan(table.column("itae")).tolist() == [True] * 4 + [False] * 4


# resuming


def test_a_finished_study_runs_nothing_and_ends_with_the_same_bytes(tmp_path, none_runs):
    study(small(), tmp_path)
    before = bytes_of(tmp_path)
    none_runs()
    study(small(), tmp_path)
    assert bytes_of(tmp_path) == before


def test_a_study_says_how_many_runs_were_there(tmp_path, capsys):
    study(small(seeds=2), tmp_path, progress=True)
    assert capsys.readouterr().err == ""
    study(small(seeds=3), tmp_path, progress=True)
    assert capsys.readouterr().err == f"8 of 12 simulations are in {tmp_path / 'parts'}\n"


def test_a_larger_grid_takes_over_what_is_there(tmp_path, ran):
    study(small(seeds=2), tmp_path)
    ran.clear()
    study(small(seeds=3), tmp_path)
    assert sorted(s.seed for s in ran) == [2] * 4
    study(small(seeds=3), tmp_path / "fresh")
    assert bytes_of(tmp_path) == bytes_of(tmp_path / "fresh")


def test_without_resume_everything_is_run_again_and_foreign_files_stay(tmp_path, ran):
    study(small(), tmp_path)
    (tmp_path / "parts" / "mine.parquet").write_text("not a part")
    ran.clear()
    study(small(), tmp_path, resume=False)
    assert len(ran) == len(small())
    assert (tmp_path / "parts" / "mine.parquet").exists()


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def foreign(path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table({"hash": ["a"]}), path)


def other_scores(path: Path) -> None:
    import pyarrow.parquet as pq

    pq.write_table(pq.read_table(path).replace_schema_metadata({"scores": "other"}), path)


@pytest.mark.parametrize("harm", [cut, foreign, other_scores, lambda path: path.write_bytes(b"")])
def test_a_part_that_is_none_is_computed_again(tmp_path, monkeypatch, ran, harm):
    monkeypatch.setattr(batches, "MAX_WORK", 50)
    study(small(), tmp_path)
    before = bytes_of(tmp_path)
    parts = sorted((tmp_path / "parts").iterdir())
    assert len(parts) > 3
    harm(parts[1])
    ran.clear()
    study(small(), tmp_path)
    assert 0 < len(ran) < len(small())
    assert bytes_of(tmp_path) == before


def test_runs_of_other_versions_are_run_again(tmp_path, monkeypatch):
    study(small(), tmp_path)
    described = scenario_json.describe
    monkeypatch.setattr(
        scenario_json, "describe", lambda s: described(s) | {"versions": {"mujoco": "99"}}
    )
    table = study(small(), tmp_path)
    assert set(table.column("versions")) == {'{"mujoco": "99"}'}


@pytest.mark.slow
def test_the_table_is_written_in_groups_from_parts_in_any_order(tmp_path, monkeypatch):
    scenarios = small(seeds=4)
    study(scenarios, tmp_path / "one")
    monkeypatch.setattr(batches, "MAX_WORK", 1)
    monkeypatch.setattr(store, "MAX_OPEN_PARTS", 1)
    shuffled = []
    for i in np.random.default_rng(0).permutation(len(scenarios)):
        shuffled.append(scenarios[i])
    study(shuffled, tmp_path / "two")
    study(scenarios, tmp_path / "two")
    assert bytes_of(tmp_path / "one") == bytes_of(tmp_path / "two")
    monkeypatch.setattr(store, "ROWS_PER_GROUP", 3)
    assert study(scenarios, tmp_path / "two").rows() == Table.read(tmp_path / "one").rows()


@pytest.mark.parametrize(
    ("plant", "law"),
    [
        ("inverted_pendulum", "classical"),
        ("duffing", "super_twisting"),
        ("van_der_pol", "observer_free"),
        ("pendulum_network", "classical"),
    ],
)
def test_a_law_that_does_nothing_wins_in_no_metric(plant, law, tmp_path):
    """However calm, gentle and steady a plant is that was let fall or hang."""
    runs = smc.grid(plant, ["none", law], "nominal", 7, "study", 4.0)
    table = study(runs, tmp_path)
    boards = smc.leaderboard(table, list(smc.score(smc.run(runs[0]))), defaults=True)
    assert len(boards) > 15
    assert {board.winner for board in boards} <= {law, None}
    assert any(board.winner == law for board in boards)
    for board in boards:
        assert all("none" not in block.best for block in board.blocks), board.metric


def test_a_metric_of_a_piece_of_a_period_is_not_compared_and_the_board_says_why(tmp_path):
    slow, fast = (f"{name}: disturbance=Sine(0.2, {w})" for name, w in (("slow", 5), ("fast", 20)))
    runs = smc.grid("duffing", ["pid", "adrc"], [slow, fast], seeds=2, duration=2.0)
    boards = smc.leaderboard(smc.study(runs, tmp_path), ["itae", "ultimate_bound"])
    conditions = {}
    for board in boards:
        conditions[board.metric] = [block.condition for block in board.blocks]
    assert conditions == {"itae": ["slow", "fast"], "ultimate_bound": ["fast"]}
    (reason,) = boards.absent
    assert "ultimate_bound" in reason
    assert "duffing under slow" in reason


def test_a_kept_run_is_called_as_the_study_calls_it(tmp_path, none_runs):
    rubbing = scenario(friction=smc.Coulomb(0.1))
    study([rubbing.named("nominal")], tmp_path)
    none_runs()
    for name in (None, "coulomb", "nominal"):
        table = study([rubbing.named(name)], tmp_path)
        assert table.column("condition")[0] == condition(rubbing.named(name))
        assert Table.read(tmp_path / "results.parquet").scenario(0).condition == name


@pytest.mark.skipif(sys.platform != "linux", reason="other systems' names are texts")
def test_a_folder_may_have_a_name_that_is_no_text(tmp_path):
    """All runs were made, and then the table could not be read."""
    out = Path(os.fsdecode(bytes(tmp_path) + b"/\xe9tude"))
    assert len(study([scenario()], out)) == len(Table.read(out)) == 1
