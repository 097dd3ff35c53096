"""The adviser: what it advises follows from its runs, what it says follows from its numbers, and it can say "no"."""

import dataclasses
import math

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.tuning import search
from smc_mujoco.cli import main
from smc_mujoco.control import gain_sets
from smc_mujoco.control.law import catalogue, law_function
from smc_mujoco.control.properties import searched
from smc_mujoco.studies import adviser
from smc_mujoco.studies.advice import NEEDS

FAST, SLOW = smc.law("observer_free", lam=6.0, k1=2.0), smc.law("observer_free", lam=6.0, k1=4.0).named("slow")
COMMON = {"duration": 2.5, "seeds": 16, "conditions": ["nominal", "noise"]}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("which")


@pytest.fixture(scope="module")
def advice(folder):
    """A law that chatters, a fast one, a slow one, and none, which is the calmest."""
    laws = ["classical", FAST, SLOW, smc.law("none").named("idle")]
    return smc.which("duffing", needs=["fast", "calm"], laws=laws, out=folder, **COMMON)


def text(advice):
    return " ".join(advice.answer)


def test_the_advised_law_has_the_best_mean_rank_of_those_that_settle(advice):
    ranks = {choice.law.name: choice.rank.mean for choice in advice.choices if choice.fit}
    assert advice.law.name == min(ranks, key=ranks.__getitem__) == advice.choices[0].law.name
    assert advice.law == FAST
    assert list(ranks.values()) == sorted(ranks.values())


def test_doing_nothing_is_calmest_and_is_not_advised(advice):
    idle = advice.choices[-1]
    assert (idle.law.name, idle.fit, idle.settles) == ("idle", False, 0.0)
    assert idle.unbeaten["calm"] == 2
    assert advice.rows[-1][1:3] == ["–", "0 %"]
    assert "settles too seldom" in advice.key


def test_a_law_settles_less_than_half_as_often_as_the_best_before_it_is_not_fit(advice):
    for condition in COMMON["conditions"]:
        runs = advice.table.select(condition=condition)
        share = {law: np.isfinite(runs.select(law=law).column("settling_time")).mean() for law in ("idle", "slow")}
        assert share == {"idle": 0.0, "slow": 1.0}


def test_wins_are_those_of_the_comparison_and_the_answer_counts_them(advice):
    first, second = advice.law.name, advice.second.name
    won, lost = advice.wins(first, second), advice.wins(second, first)
    assert won
    assert not set(won) & set(lost)
    assert f"it wins {len(won)}, loses {len(lost)} and is level in {4 - len(won) - len(lost)} of 4" in text(advice)
    medians = {
        law: advice.table.select(law=law, condition="nominal").column("settling_time") for law in (first, "slow")
    }
    assert np.median(medians[first]) < 0.97 * np.median(medians["slow"])
    assert ("fast", "nominal") in advice.wins(first, "slow")
    assert ("fast", "nominal") not in advice.wins("slow", first)


def test_the_answer_says_what_why_and_how_sure(advice):
    use, second, sure = advice.answer
    assert use.startswith(f"Use {FAST} (gains as given), because it has the best mean rank: ")
    assert second.startswith(f"Second choice: {advice.second} (")
    assert sure.startswith("How sure: against the second")
    low, high = advice.choices[0].rank.low, advice.choices[0].rank.high
    assert f"its place is {low:g}{f' to {high:g}' if high > low else ''} of 4" in sure
    assert "better than it on calm: idle" in sure


def test_where_another_law_is_better_the_answer_says_on_what(advice):
    lost = 2 - advice.choices[0].unbeaten["calm"]
    assert lost == 2
    assert "on calm another is better in 2 of 2 conditions" in advice.answer[0]


def test_sentences_follow_the_numbers(advice):
    """With the first two laws exchanged, they exchange their places in every sentence."""
    turned = dataclasses.replace(advice, choices=(advice.choices[1], advice.choices[0], *advice.choices[2:]))
    assert turned.answer[0].startswith(f"Use {advice.second} ")
    won, lost = len(advice.wins(advice.second.name, FAST.name)), len(advice.wins(FAST.name, advice.second.name))
    assert f"it wins {won}, loses {lost} " in turned.answer[2]


def test_a_table_has_a_row_for_each_finalist_with_intervals(advice):
    assert advice.heads == ["law", "place", "settles", "fast: settling time, s", "calm: TV rate, N/s"]
    interval = advice.choices[0].medians["fast"]
    assert interval.low <= interval.median <= interval.high
    assert f"{interval.median:.3g}" in advice.rows[0][3]
    for row in advice.rows:
        assert all(cell in str(advice) for cell in row)
    assert "<td>observer_free</td>" in advice._repr_html_()
    assert repr(advice) == f"Advice(duffing: {FAST})"


def test_equal_laws_are_level_and_no_law_is_called_the_best(folder):
    twins = [FAST, FAST.named("twin")]
    found = smc.which("duffing", needs="fast,calm", laws=twins, out=folder, **COMMON)
    assert found.level == [found.choices[1].law.name]
    assert found.answer[0].startswith("No law can be called the best: both laws are level in every comparison.")
    assert "level with the first in every comparison" in found.answer[1]
    assert "not to be told from it: " in text(found)


def test_few_seeds_tell_no_law_from_another(folder):
    few = smc.which("duffing", needs="fast", laws=[FAST, SLOW], out=folder, **COMMON | {"seeds": 4})
    assert few.answer[0].startswith("No law can be called the best")
    assert not few.comparison.better.any()


def test_if_nothing_settles_nothing_is_advised(folder):
    found = smc.which("duffing", needs="calm", laws=[FAST, SLOW], out=folder, duration=0.1, seeds=4)
    assert found.answer[0].startswith("No law can be advised, because none settles in any run: give longer runs")


def test_one_law_is_the_only_one(folder):
    found = smc.which("duffing", laws=FAST, out=folder, **COMMON)
    assert (found.second, found.needs) == (None, adviser.USUAL)
    assert (
        found.answer[0]
        == f"Use {FAST} (gains as given), because it is the only law here that suits. It settles in 100 % of its runs."
    )
    assert found.answer[1:] == ["How sure: nothing could be compared with it."]


# the screening


def test_finalists_are_the_best_of_a_screening_and_run_from_other_seeds(folder, monkeypatch):
    monkeypatch.setattr(adviser, "FULL", adviser.FULL._replace(finalists=2, screening=3))
    found = smc.which("duffing", needs="fast", laws=[SLOW, FAST, smc.law("none").named("idle")], out=folder, **COMMON)
    assert [choice.law.name for choice in found.choices] == ["observer_free", "slow"]
    assert found.others == ("idle",)
    assert found.answer[-1] == "A screening left out 1 other laws, best first: idle"
    screened = smc.Table.read(folder / "screening")
    assert set(screened.column("seed")) == {0, 1, 2}
    assert set(found.table.column("seed")) == set(range(3, 19))
    assert set(screened.column("law")) == {"observer_free", "slow", "idle"}


# gains


def test_gains_of_the_package_are_taken_where_there_are_some(folder):
    found = smc.which("duffing", laws=["classical"], out=folder, **COMMON)
    assert found.law == gain_sets.law("duffing", "classical")
    assert found.choices[0].source == "tuned gains of the package"


def test_gains_are_tuned_for_other_parameters_once_and_kept(folder, monkeypatch):
    heavy = smc.plant("duffing", M=2.0)
    monkeypatch.setattr(adviser, "FULL", adviser.FULL._replace(budget=4))
    options = {"laws": ["classical"], "out": folder} | COMMON | {"seeds": 2, "conditions": "nominal"}
    found = smc.which(heavy, **options)
    assert found.choices[0].source == "tuned here, 4 sets of gains tried"
    assert found.law.gains == search.tune(heavy, "classical", 4).law.gains
    monkeypatch.setattr(search, "tune", None)
    assert smc.which(heavy, **options).law == found.law


def test_a_law_of_a_user_is_tuned_too(folder, monkeypatch):
    from smc_mujoco.control.units import FORCE_PER_POSITION, FORCE_PER_SPEED, Gain

    @law_function(gains={"kp": Gain(10.0, FORCE_PER_POSITION), "kd": Gain(5.0, FORCE_PER_SPEED)}, continuous=True)
    def my_pd(y, gains, memory):
        return -gains.kp * y.e - gains.kd * y.de, y.e

    monkeypatch.setattr(adviser, "FULL", adviser.FULL._replace(budget=4))
    found = smc.which("duffing", "nominal", "fast,continuous", [my_pd], seeds=2, duration=1.0, out=folder)
    assert found.law.name == "my_pd"
    assert found.law.function is my_pd.function
    assert found.law.gains != my_pd.defaults


def test_a_plant_that_cannot_be_tuned_has_default_gains_and_says_so(folder):
    found = smc.which("overhead_crane", "nominal", "fast", seeds=2, duration=1.0, out=folder)
    assert found.law == smc.law("hierarchical")
    assert found.choices[0].source.startswith("default gains, as tuning is not possible here: it has free joints")


# what is asked


def test_needs_are_metrics_to_compare_and_properties_to_have():
    machine = smc.plant("duffing")
    assert adviser._needs("calm, continuous,fast", machine) == (("calm", "fast"), ("continuous",))
    assert adviser._needs(["two-gains"], machine) == (adviser.USUAL, ("two-gains",))
    names = {law.name for law in adviser._suited(machine, ["continuous", "two-gains"], None)}
    assert "observer_free" in names
    assert not names & {"none", "classical", "observer_free_q15", "hierarchical"}
    assert all(law.continuous and len(searched(law)) in (1, 2) for law in map(catalogue().__getitem__, names))
    assert (NEEDS["fast"].name, NEEDS["calm"].name) == ("settling_time", "tv_rate")


def test_without_a_velocity_sensor_velocity_is_differentiated(folder):
    found = smc.which("duffing", "noise", "fast,no-velocity", [FAST], seeds=1, duration=0.5, out=folder)
    assert found.conditions == ("noise (no velocity sensor)",)
    (scenario,) = (found.table.scenario(i) for i in range(1))
    assert scenario.resolved.velocity.name == "filtered_difference"
    assert scenario.noise == smc.Noise(0.01, 0.05)
    own = smc.condition("own", velocity="levant")
    assert adviser._without_velocity(own).on(smc.plant("duffing"), 1.0) == {"velocity": "levant"}


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"needs": "quick"}, "unknown need 'quick': choose from accurate, calm, "),
        ({"needs": "one-gain"}, "no law for duffing is among those that have one gain to choose"),
        ({"needs": "continuous", "laws": ["twisting"]}, "no law for duffing is among those that have a continuous u"),
        ({"plant": "dufing"}, "did you mean 'duffing'"),
        ({"laws": ["clasical"]}, "did you mean 'classical'"),
        ({"laws": [FAST, smc.law("observer_free")]}, "two laws have one name"),
        ({"conditions": "jump_mil"}, "did you mean 'jump_mild'"),
        ({"conditions": "a: friction=Coulomb(-1)"}, "Coulomb"),
        ({"seeds": 0}, "seeds is 0"),
        ({"duration": 0.0}, "duration is 0"),
    ],
)
def test_what_cannot_be_is_one_sentence_before_anything_is_searched(arguments, sentence, tmp_path, monkeypatch):
    monkeypatch.setattr(search, "tune", None)
    with pytest.raises(smc.ScenarioError, match=sentence.replace("(", r"\(")):
        smc.which(**{"plant": "duffing", "out": tmp_path} | arguments)


# the command


def test_the_command_prints_the_table_and_the_answer(folder, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    laws = "fast: observer_free(lam=6,k1=2),slow: observer_free(lam=6,k1=4)"
    options = ("--needs", "fast", "--conditions", "nominal", "--seeds", "16", "--duration", "2.5", "--out", str(folder))
    with pytest.raises(SystemExit) as end:
        main.main(["which", "duffing", "--laws", laws, *options])
    printed = " ".join(capsys.readouterr().out.split())
    assert not end.value.code
    assert (
        "Use fast(lam=6, k1=2) (gains as given), because it has the best mean rank: no finalist is better on fast."
        in printed
    )
    assert "Second choice: slow(lam=6, k1=4) (gains as given); worse on fast." in printed
    assert "How sure: against the second it wins 1, loses 0 and is level in 0 of 1" in printed
    assert math.isfinite(float(printed.partition("results.parquet; ")[2].split()[0]))


def test_the_command_says_in_one_sentence_what_is_wrong(capsys):
    with pytest.raises(SystemExit) as end:
        main.main(["which", "duffing", "--needs", "quick"])
    assert end.value.code == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
