"""What worst cases, needs and kept files say and are named, of made-up numbers."""

import dataclasses
from pathlib import Path

import arms
import pytest

import smc_mujoco as smc
from smc_mujoco.common import cache
from smc_mujoco.robustness import worst_case
from smc_mujoco.robustness.worst_case import WorstCase, default_budget
from smc_mujoco.simulation import run_key
from smc_mujoco.studies import study
from smc_mujoco.studies.scene import slug

RUN = smc.Scenario(plant="duffing", law=smc.law("classical"), duration=8.0)
WITHIN = smc.Uncertainty(disturbance=0.5, mass=(0.8, 1.2))


def attacked(law: str, value: float, median: float, **fields: object) -> WorstCase:
    """The worst case of a law, of made-up values."""
    scenario = dataclasses.replace(RUN, law=smc.law(law))
    settings = {
        "unit": "m",
        "found_by": "bang-bang",
        "tried": 48,
        "metric": "rms_error",
        "outside": "",
        "seed": 0,
    }
    scenarios = {"scenario": scenario, "nominal": scenario, "within": WITHIN}
    return WorstCase(value=value, median=median, **settings | scenarios | fields)


@pytest.mark.quick
@pytest.mark.parametrize(
    "field", ["value", "median", "unit", "found_by", "tried", "metric", "outside", "seed", "sets"]
)
def test_a_worst_case_that_is_kept_is_the_one_that_is_read(field, tmp_path, monkeypatch):
    worst = attacked(
        "classical",
        0.2,
        0.05,
        outside="no",
        sets=3,
        seed=2,
        found_by="sine",
        tried=50,
        unit="rad",
    )
    monkeypatch.setattr(worst_case, "worst_case", lambda *_, **__: worst)
    path = tmp_path / "worst" / "a.json"
    for _ in range(2):
        again = worst_case.cached_worst_case(path, RUN, WITHIN, 24)
        assert getattr(again, field) == getattr(worst, field)
        assert again.scenario.plant == worst.scenario.plant
        assert again.within == WITHIN
        monkeypatch.setattr(worst_case, "worst_case", None)  # would raise
    (file,) = path.parent.iterdir()
    assert [len(part) for part in file.stem.split("-")] == [1, 12, 12]


def test_a_default_budget_is_as_many_runs_as_take_the_time_of_that_many_steps():
    """2.5 million steps for two numbers of runs; a channel adds half, dry friction doubles."""
    rough = dataclasses.replace(RUN, friction=smc.Coulomb(0.1), duration=1.0)
    network = smc.Scenario(plant="pendulum_network", law=smc.law("classical"), duration=8.0)
    assert default_budget(RUN, WITHIN) == 2_500_000 // (8000 * 2)
    assert default_budget(rough, WITHIN) == 2_500_000 // (1000 * rough.steps * 2 * 2)
    assert default_budget(RUN, dataclasses.replace(WITHIN, friction=(0.0, 0.1))) == 2_500_000 // (
        8000 * 2 * 2
    )
    assert default_budget(network, WITHIN) == 2_500_000 // (8000 * 6)
    assert default_budget(dataclasses.replace(RUN, duration=500.0), WITHIN) == 24
    assert default_budget(dataclasses.replace(RUN, duration=0.5), WITHIN) == 1024


def test_names_of_files():
    names = ["", "...", "A  =  B", "x" * 60, "x" * 61, "é" * 31, "a/b\\c", "_a_", "k=-1.5+2"]
    slugs = [slug(name) for name in names]
    assert slugs[:3] == ["run", "run", "a-b"]
    assert slugs[3] == "x" * 60
    assert [(len(name_of_file.encode()), name_of_file[-9]) for name_of_file in slugs[4:6]] == [
        (60, "-"),
        (59, "-"),
    ]
    assert slugs[6:] == ["a_b_c", "a", "k--1.5+2"]


def test_a_result_is_read_only_where_its_seal_fits(tmp_path):
    def save(made: str, path: Path) -> None:
        assert path.parent.name.startswith(".a-")  # a hidden folder, which a kill may leave
        path.write_text(made)

    def kept(depends: object, value: str) -> str:
        return cache.cached(tmp_path / "a.txt", depends, lambda: value, save, Path.read_text)

    assert kept(1, "one") == "one"
    assert kept(1, "two") == "one"
    (file,) = tmp_path.iterdir()
    file.write_text("other")
    assert kept(1, "three") == "three"
    assert kept(2, "four") == "four"
    # those with other hashes are removed
    assert [file_left.read_text() for file_left in tmp_path.iterdir()] == ["four"]


@pytest.mark.parametrize("task", ["sway", "payload", "wall", "behind", "blow"])
def test_a_task_of_the_arm_has_its_part_its_seed_and_all_that_disturbs_it(task):
    scenario = arms.scenario(task, smc.law("none"), seed=2, payload=0.5)
    assert scenario.seed == 2
    assert scenario.noise is not None
    assert dict(scenario.mismatch) == {"payload": 0.5}  # the law knows nothing of it
    assert (scenario.jump is not None) is (task == "payload")
    assert bool(scenario.disturbance) is (task == "blow")
    assert (bool(scenario.contact) and scenario.contact[0].kind == "wall") is (
        task in ("wall", "behind")
    )


def test_a_part_with_scores_by_other_code_counts_as_not_done(tmp_path, monkeypatch):
    store = study.Store(tmp_path)
    store.open(resume=True)
    store.add([run_key.row(RUN)])
    again = study.Store(tmp_path)
    again.open(resume=True)
    assert list(again.where) == [run_key.run_key(RUN)]
    monkeypatch.setattr(study.fingerprint, "of", lambda thing: "other")
    other_store = study.Store(tmp_path)
    other_store.open(resume=True)
    assert not other_store.where
