"""The sets of gains: shipped gains were tuned in the same way, equal their files, and are found again."""

import dataclasses
import itertools

import pytest

from smc_mujoco.analysis.tuning import objective, result, search, search_space
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control import gain_sets as gains
from smc_mujoco.control.law import catalogue
from smc_mujoco.control.units import FORCE
from smc_mujoco.evidence.papers.gaber import scenarios
from smc_mujoco.simulation import grid

TUNINGS = [
    (name, plant, seed) for name, plant in itertools.product(gains.OBJECTIVES, scenarios.PLANTS)
    for seed in range(gains.SEEDS[name])
]  # fmt: skip


def shipped(gain_set: str, plant: str, seed: int = 0) -> list[result.Tuned]:
    laws = gains.general() if gain_set == "tuned" and seed == 0 else gains.LAWS
    return [result.shipped(plant, name, gains.OBJECTIVES[gain_set], seed) for name in laws]


@pytest.mark.parametrize(("gain_set", "plant", "seed"), TUNINGS)
def test_all_laws_were_tuned_alike(gain_set, plant, seed):
    board = search.compare(shipped(gain_set, plant, seed))  # refuses another rule, budget, seed, objective or bounds
    assert {t.rule for t in board} == {search.RULE}
    assert {t.seed for t in board} == {seed}
    assert {t.budget for t in board} == {len(t.history) for t in board} == {96}
    goal = objective.OBJECTIVES[gains.OBJECTIVES[gain_set]]
    assert {t.definition for t in board} == {dataclasses.replace(goal, u_max=scenarios.U_MAX)}


def test_every_general_law_is_a_rival():
    assert len(gains.general()) >= 35
    assert len(set(gains.general())) == len(gains.general())
    left_out = set(catalogue()) - set(gains.general())
    assert left_out == {*gains.FORMS, "none", "swing_up", "rotary_swing_up", "hierarchical"}
    assert set(gains.FORMS) <= set(catalogue())


def test_no_force_among_the_gains_is_more_than_the_actuator_gives():
    for plant in scenarios.PLANTS:
        for found in shipped("tuned", plant):
            forces = [gain for gain in found.gains if search_space.unit(found.law, gain) == FORCE]
            assert all(found.gains[gain] <= found.scales["F"] * (1.0 + 1e-3) for gain in forces), found


@pytest.mark.parametrize(("gain_set", "plant", "seed"), TUNINGS)
def test_no_gain_over_another_is_more_than_the_actuator_gives(gain_set, plant, seed):
    """The force k / b of the observers' laws is bounded as every force is."""
    divided = 0
    for found in shipped(gain_set, plant, seed):
        assert found.law.template is not None
        for name, gain in found.law.template.gains.items():
            if gain.over is not None:
                force = found.gains[name] / found.gains[gain.over]
                assert force <= found.scales["F"] * (1.0 + search_space.ROUNDING), found
                divided += 1
    assert divided


def test_a_law_with_a_wider_budget_than_its_rivals_is_refused():
    fair = shipped("tuned", "duffing")[:3]
    favoured = dataclasses.replace(fair[0], budget=512)
    with pytest.raises(ScenarioError, match="budget"):
        search.compare([favoured, *fair[1:]])


@pytest.mark.parametrize(("gain_set", "plant", "seed"), TUNINGS)
def test_gains_are_the_best_of_the_finals_in_their_file(gain_set, plant, seed):
    for found in shipped(gain_set, plant, seed):
        best = min(found.finals, key=lambda e: e.objective)
        assert found.objective == best.objective
        assert tuple(found.gains.values()) == best.gains
        assert {e.gains for e in found.finals} <= {e.gains for e in found.history}
        given = gains.law(plant, found.law.name, gain_set, seed).gains
        assert {name: given[name] for name in found.gains} == found.gains


def test_runs_take_the_gains_of_three_tunings_in_turn():
    made = grid.grid("duffing", ["observer_free", "power_rate"], "nominal", 6)
    own, other = ([s.law for s in made if s.law.name == name] for name in ("observer_free", "power_rate"))
    assert own[:3] == own[3:]
    assert len(set(own)) == 3
    assert len(set(other)) == 1


def test_forms_of_a_law_take_its_gains():
    exact, single = (gains.law("duffing", name) for name in ("observer_free", "observer_free_single"))
    assert dict(exact.gains) == dict(single.gains)


def test_the_bound_is_the_same_for_every_law_and_both_sets():
    assert {t.definition.u_max for name, plant, seed in TUNINGS for t in shipped(name, plant, seed)} == {
        scenarios.U_MAX
    }


@pytest.mark.filterwarnings("ignore:no set of gains tried")
@pytest.mark.parametrize(("gain_set", "law"), [("tuned", "observer_free"), ("tracking", "super_twisting")])
def test_a_shipped_search_comes_out_again(gain_set, law):
    known = result.shipped("duffing", law, gains.OBJECTIVES[gain_set])
    again = search.tune("duffing", law, budget=4, seed=known.seed, objective=known.definition)
    assert [e.gains for e in again.history] == [e.gains for e in known.history[:4]]
    for one, other in zip(again.history, known.history, strict=False):
        # another processor rounds otherwise, and switching laws under noise magnify it
        assert one.objective == pytest.approx(other.objective, rel=1e-3)


@pytest.mark.parametrize("plant", scenarios.PLANTS)
def test_the_first_set_is_the_studys(plant):
    for law, values in scenarios.GAINS[plant].items():
        assert dict(gains.law(plant, law, "study").gains) == dict(gains.law(plant, law, "default").gains) | values
        assert scenarios.scenario(plant, law).law == gains.law(plant, law, "study")


@pytest.mark.parametrize("name", ["conditioned_super_twisting", "super_twisting_unclamped"])
def test_forms_of_a_law_take_its_gains_in_the_first_set(name):
    one, other = (gains.law("duffing", law, "study") for law in ("super_twisting", name))
    assert dict(one.gains) == dict(other.gains) | {"w_max": scenarios.U_MAX}


@pytest.mark.parametrize("gain_set", gains.OBJECTIVES)
def test_the_law_without_a_clamp_takes_the_gains_of_its_rival(gain_set):
    one, other = (gains.law("duffing", law, gain_set) for law in ("super_twisting", "super_twisting_unclamped"))
    assert other.name == "super_twisting_unclamped"
    assert dict(one.gains) == dict(other.gains) | {"w_max": one.gains["w_max"]}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("duffing", "classical", "best"), "unknown set of gains 'best'"),
        (("duffing", "hierarchical", "tuned"), "smc-mujoco tune duffing hierarchical"),
        (("overhead_crane", "classical", "tuned"), "no gains in set 'tuned'"),
        (("duffing", "clasical", "study"), "did you mean 'classical'"),
        (("duffing", "twisting", "study"), "unknown law of the paper's study"),
    ],
)
def test_what_has_no_gains_gets_a_sentence(arguments, words):
    with pytest.raises(ScenarioError, match=words):
        gains.law(*arguments)
