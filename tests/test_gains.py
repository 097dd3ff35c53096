"""The sets of gains: what ships was tuned alike, is what its files say, and comes out again."""

import itertools

import pytest

from smc_mujoco import gains, paper, tuned, tuning
from smc_mujoco.errors import ScenarioError

PAIRS = list(itertools.product(gains.OBJECTIVES, paper.PLANTS))


def shipped(gain_set: str, plant: str) -> list[tuned.Tuned]:
    return [tuned.shipped(plant, law, gains.OBJECTIVES[gain_set]) for law in gains.LAWS]


@pytest.mark.parametrize(("gain_set", "plant"), PAIRS)
def test_all_laws_were_tuned_alike(gain_set, plant):
    board = tuning.compare(shipped(gain_set, plant))  # refuses another rule, budget, seed, objective or width of bounds
    assert {t.law.name for t in board} == set(gains.LAWS)
    assert {t.budget for t in board} == {len(t.history) for t in board} == {256}


def test_a_law_with_a_wider_budget_than_its_rivals_is_refused():
    import dataclasses

    fair = shipped("tuned", "duffing")
    favoured = dataclasses.replace(fair[0], budget=512)
    with pytest.raises(ScenarioError, match="budget"):
        tuning.compare([favoured, *fair[1:]])


@pytest.mark.parametrize(("gain_set", "plant"), PAIRS)
def test_gains_are_the_best_of_the_history_in_their_file(gain_set, plant):
    for found in shipped(gain_set, plant):
        best = min(found.history, key=lambda e: e.objective)
        assert found.objective == best.objective
        assert tuple(found.gains.values()) == best.gains
        assert dict(gains.law(plant, found.law.name, gain_set).gains) == dict(found.law.gains)


def test_the_bound_is_the_same_for_every_law_and_both_sets():
    assert {t.definition.u_max for pair in PAIRS for t in shipped(*pair)} == {paper.U_MAX}


@pytest.mark.parametrize(("gain_set", "law"), [("tuned", "observer_free"), ("tracking", "super_twisting")])
def test_a_shipped_search_comes_out_again(gain_set, law):
    known = tuned.shipped("duffing", law, gains.OBJECTIVES[gain_set])
    again = tuning.tune("duffing", law, budget=12, seed=known.seed, objective=known.definition)
    assert [e.gains for e in again.history] == [e.gains for e in known.history[:12]]
    for one, other in zip(again.history, known.history, strict=False):
        # another processor rounds otherwise, and switching laws under noise magnify it
        assert one.objective == pytest.approx(other.objective, rel=1e-3)


@pytest.mark.parametrize("plant", paper.PLANTS)
def test_the_first_set_is_the_studys(plant):
    for law, values in paper.GAINS[plant].items():
        assert dict(gains.law(plant, law, "study").gains) == dict(gains.law(plant, law, "default").gains) | values
        assert paper.scenario(plant, law).law == gains.law(plant, law, "study")


@pytest.mark.parametrize("name", ["conditioned_super_twisting", "super_twisting_unclamped"])
def test_forms_of_a_law_take_its_gains_in_the_first_set(name):
    one, other = (gains.law("duffing", law, "study") for law in ("super_twisting", name))
    assert dict(one.gains) == dict(other.gains) | {"w_max": paper.U_MAX}


@pytest.mark.parametrize("gain_set", gains.OBJECTIVES)
def test_the_law_without_a_clamp_takes_the_gains_of_its_rival(gain_set):
    one, other = (gains.law("duffing", law, gain_set) for law in ("super_twisting", "super_twisting_unclamped"))
    assert other.name == "super_twisting_unclamped"
    assert dict(one.gains) == dict(other.gains) | {"w_max": one.gains["w_max"]}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("duffing", "classical", "best"), "unknown set of gains 'best'"),
        (("duffing", "twisting", "tuned"), "smc-mujoco tune duffing twisting"),
        (("overhead_crane", "classical", "tuned"), "no gains in set 'tuned'"),
        (("duffing", "clasical", "study"), "did you mean 'classical'"),
        (("duffing", "twisting", "study"), "unknown law of the paper's study"),
    ],
)
def test_what_has_no_gains_gets_a_sentence(arguments, words):
    with pytest.raises(ScenarioError, match=words):
        gains.law(*arguments)
