"""The sets of gains: shipped gains come from the same rule, are near-optimal as stored, and each
run has its own.
"""

import dataclasses
import itertools
import warnings

import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.tuning import objective, search, search_space
from smc_mujoco.common.errors import ScenarioWarning
from smc_mujoco.control import gain_sets as gains
from smc_mujoco.simulation import gaber_study, grid
from smc_mujoco.simulation.run import run

pytestmark = pytest.mark.quick

SETS = list(itertools.product(gains.OBJECTIVES, gaber_study.PLANTS))


def shipped(gain_set: str, plant: str) -> dict[str, gains.TunedGains]:
    """The gains of the laws of the first page, and of all others that have some: a new law has none
    yet.
    """
    if gain_set == "tuned":
        general = gains.general_laws([plant], gain_set)
    else:
        general = ()
    return {name: gains.tuned(plant, name, gain_set) for name in {*gains.LAWS, *general}}


@pytest.mark.slow
def test_every_general_law_of_a_release_has_gains():
    """Of those that are missing: python benchmarks/gains.py NAME."""
    assert set(gains.general()) == set(gains.general_laws(gaber_study.PLANTS, "tuned"))


@pytest.mark.parametrize(("gain_set", "plant"), SETS)
def test_every_law_of_a_set_has_gains_and_these_are_all_that_tuning_moves(gain_set, plant):
    for name, tuned in shipped(gain_set, plant).items():
        law = gains.law_with_gains(plant, name, gain_set)
        scales = search_space.scales(grid.as_plant(plant), gaber_study.U_MAX)
        for gain_set_of_search in tuned.sets:
            assert set(gain_set_of_search) == set(search_space.box(law, scales)), name


@pytest.mark.parametrize(("gain_set", "plant"), SETS)
def test_every_shipped_set_is_within_its_laws_theorem(gain_set, plant):
    """Of those that are not: python benchmarks/gains.py NAME."""
    for name, tuned in shipped(gain_set, plant).items():
        for i in range(len(tuned.sets)):
            assert not gains.law_with_gains(plant, name, gain_set, i).source.outside, (name, i)


def test_a_law_by_its_name_alone_has_its_shipped_gains_or_says_that_it_has_its_defaults(refused):
    shipped = gains.law_with_gains("duffing", "pid")
    assert shipped.gains != smc.law("pid").gains
    by_name = smc.Scenario(plant="duffing", law="pid")
    assert by_name.law == smc.law("pid", plant="duffing") == shipped
    assert by_name.law.source.kind == "shipped"
    own = smc.law("pid", plant="duffing", kp=50.0)
    assert own.gains == dict(shipped.gains) | {"kp": 50.0}
    assert own.source.kind == "given"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for written in (smc.law("pid"), smc.law("pid").template, "pid(kp=9)"):
            law = smc.Scenario(plant="duffing", law=written).law
            assert dict(law.gains) | {"kp": 0.0} == dict(smc.law("pid").gains) | {"kp": 0.0}
        law = smc.Scenario(plant="cart_pole", law="hierarchical").law
        assert law == smc.law("hierarchical")
    # tuned without a model, without a surface, for positions
    for fields in ({"model": "nominal"}, {"surface": "linear(c=3)"}, {"tracks": "speed"}):
        with pytest.warns(
            ScenarioWarning, match="'classical' runs on duffing with its default gains"
        ):
            law = smc.Scenario(plant="duffing", law="classical", **fields).law
        assert law.gains == smc.law("classical").gains
    network = smc.Scenario(plant="pendulum_network", law=["pid", smc.law("pid")] + ["pid"] * 3)
    assert network.law.of_channel(0) == gains.law_with_gains("pendulum_network", "pid")
    assert network.law.of_channel(1) == smc.law("pid")
    heavy = smc.plant("inverted_pendulum", m=0.7)
    for make in (
        lambda: smc.Scenario(plant=heavy, law="pid"),
        lambda: smc.law("pid", plant=heavy),
        lambda: grid.grid(heavy, "pid"),
    ):
        with pytest.warns(ScenarioWarning, match="default parameters, and this one has m = 0.7"):
            make()
    refused(lambda: smc.law("pid", plant="cart_pole"), "pid", "cart_pole", "tune")


def test_run_i_of_a_law_has_gain_set_i():
    scenarios = grid.grid("duffing", ["observer_free", "power_rate"], "nominal", 50)
    for name in ("observer_free", "power_rate"):
        sets = gains.tuned("duffing", name).sets
        assert len(sets) > 1
        ran = [s.law.gains for s in scenarios if s.law.name == name]
        for k, law in enumerate(ran):
            for gain, value in sets[k % len(sets)].items():
                assert law[gain] == value


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gain_set", "law"),
    [
        ("tuned", "observer_free"),
        ("tracking", "super_twisting"),
    ],
)
def test_shipped_gains_cost_what_their_record_says(gain_set, law):
    """Set i in the runs of search i."""
    tuned = gains.tuned("duffing", law, gain_set)
    goal = objective.OBJECTIVES[gains.OBJECTIVES[gain_set]]
    goal = dataclasses.replace(goal, u_max=gaber_study.U_MAX)
    for i, expected in enumerate(tuned.objectives[:3]):
        cases = goal.scenarios(
            "duffing", gains.law_with_gains("duffing", law, gain_set, i), tuned.seed, i
        )
        # another processor rounds otherwise, and switching laws under noise magnify it
        assert goal.evaluation(cases[0], run(cases)).objective == pytest.approx(expected, rel=1e-2)


@pytest.mark.slow
def test_the_first_shipped_search_comes_out_again():
    tuned = gains.tuned("duffing", "observer_free")
    again = search.tune(
        "duffing",
        "observer_free",
        seed=tuned.seed,
        searches=1,
    )
    # another processor rounds otherwise
    assert again.objective == pytest.approx(tuned.objectives[0], rel=1e-3)
