"""Gains by one rule: which law is tuned, from which starts, and when a kept search is searched
again.
"""

import dataclasses
import functools
import importlib
import runpy
import types
from pathlib import Path

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.tuning import search
from smc_mujoco.analysis.tuning.effort import Search
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.control import from_text
from smc_mujoco.control.law import all_laws, law_catalogue, law_function
from smc_mujoco.control.units import FORCE_PER_POSITION, FORCE_PER_SPEED, Gain
from smc_mujoco.simulation.conditions import NAMED, find_condition
from smc_mujoco.simulation.grid import Draws
from smc_mujoco.studies import fair_gains
from smc_mujoco.studies.fair_gains import Candidate, GainChoice, Trial

FAST = smc.law("observer_free", lam=6.0, k1=2.0)
DUFFING = smc.plant("duffing")


def trial(folder, plants=(), starts=None, gains=GainChoice(), **effort) -> Trial:  # noqa: B008
    return Trial(plants, [], 1.0, folder, Draws(12, starts), Search(**effort), gains)


@pytest.mark.quick
def test_laws_are_tuned_from_the_starts_of_the_packages_gains_where_these_are_compared(monkeypatch):
    searches = []

    def search_gains(self, plant, law, rule):
        searches.append(rule.goal.starts)

    monkeypatch.setattr(Trial, "search_gains", search_gains)
    other_starts = smc.starts(x0=0.5)
    mine = law_function(gains={"k": 2.0})(lambda y, gains, memory: (-gains.k * y.e, y.e))
    laws = [law_catalogue()["classical"], mine]
    for plant in (DUFFING, smc.plant("duffing", M=2.0)):
        trial(Path("gains"), [plant], other_starts, GainChoice(defaults=True)).candidates(
            {"duffing": laws}, 12
        )
    assert searches == [Objective().starts, other_starts, other_starts]


@pytest.mark.usefixtures("by_mujoco")
def test_a_law_of_a_user_is_tuned_for_a_plant_once_and_its_gains_are_kept(tmp_path, monkeypatch):
    gains = {"kp": Gain(0.01, FORCE_PER_POSITION), "kd": Gain(0.01, FORCE_PER_SPEED)}

    @law_function(gains=gains, continuous=True)
    def my_pd(y, gains, memory):
        return -gains.kp * y.e - gains.kd * y.de, y.e

    tuned = []
    tune = search.tune

    def counted(*args, **options):
        tuned.append(tune(*args, **options))
        return tuned[-1]

    monkeypatch.setattr(search, "tune", counted)
    monkeypatch.setattr(fair_gains, "Objective", functools.partial(Objective, duration=1.0))
    # no catalogue has it, so its name says nothing to what reads the file of a tuning
    heavy = dataclasses.replace(smc.plant("duffing", M=2.0), name="mine")
    for _ in range(2):
        searched = trial(tmp_path, [heavy], searches=2, budget=8)
        (candidate,) = searched.candidates({"mine": [my_pd]}, 12)["mine"]
        assert candidate.law.function is my_pd.function
        assert candidate.law.gains == tuned[0].law.gains != my_pd.defaults
        assert [dict(law.gains) for law in candidate.sets] == [
            dict(zip(("kp", "kd"), gain_set.gains, strict=True)) for gain_set in tuned[0].sets
        ]
        assert candidate.law.source.kind == "tuned here"
        assert candidate.remark.startswith("at most 8 sets were tried for each gain, where 64")
    assert len(tuned) == 1


LAW_FILE = """
import math
import numba
import smc_mujoco as smc
from smc_mujoco.control.units import FORCE, RATE, Gain

@numba.njit
def root(s):
    return math.copysign(math.sqrt(abs(s)), s)

@smc.law_function(gains={"lam": Gain(6.0, FORCE), "k1": Gain(3.0, RATE)})
def root_sliding(y, gains, memory):
    s = y.de + gains.k1 * y.e
    return -gains.lam * root(s), s
"""


@pytest.mark.usefixtures("by_mujoco")
def test_a_law_has_its_gains_and_runs_whichever_way_its_file_is_reached(tmp_path, monkeypatch):
    """As a script, by its name on the command line, and by an import; until a helper changes."""
    monkeypatch.chdir(tmp_path)
    Path("root_law.py").write_text(LAW_FILE)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(fair_gains, "Objective", functools.partial(Objective, duration=0.5))

    def files(law) -> list[Path]:
        options = {"seeds": 1, "searches": 1, "budget": 8, "duration": 0.5}
        smc.compare([law], "duffing", "nominal", out="out", progress=False, **options)
        return sorted(path for path in Path("out").rglob("*") if path.is_file())

    first = files(runpy.run_path("root_law.py", run_name="__main__")["root_sliding"])
    (named,) = from_text.laws_of_text("root_law.py")
    assert files(named) == first
    (gains,) = Path("out/gains").glob("*.json")
    gains.unlink()  # the file of the search is enough
    again = files(importlib.import_module("root_law").root_sliding)
    assert {path.parent for path in {*again} ^ {*first}} == {gains.parent}
    Path("root_law.py").write_text(LAW_FILE.replace("sqrt(abs(s))", "tanh(abs(s))"))
    changed = files(runpy.run_path("root_law.py", run_name="__main__")["root_sliding"])
    new = {path.parent.name for path in {*changed} - {*first}}
    assert new == {"gains", "searches", "parts", "unseen"}


def test_kept_gains_are_searched_again_where_the_search_or_the_plants_code_differs(
    tmp_path, monkeypatch
):
    @law_function(gains={"kp": Gain(1.0, FORCE_PER_POSITION), "kd": Gain(1.0, FORCE_PER_SPEED)})
    def my_spring(y, gains, memory):
        return -gains.kp * y.e - gains.kd * y.de, y.e

    def build(n):
        return DUFFING.build(n)

    searches = []

    def cached(path, depends, *rest):
        searches.append(str(depends))
        return types.SimpleNamespace(before=1.0, objective=2.0, law=FAST)

    monkeypatch.setattr(fair_gains, "cached", cached)
    fixed = Gain(1.0, FORCE_PER_SPEED, held=True)
    held = dataclasses.replace(my_spring, gains={**my_spring.gains, "kd": fixed})
    other_starts = dataclasses.replace(DUFFING, build=build)
    rule = trial(tmp_path).rule(DUFFING, [])
    for plant, law in (
        (DUFFING, my_spring),
        (DUFFING, my_spring),
        (DUFFING, held),
        (other_starts, held),
    ):
        trial(tmp_path).search_gains(plant, law, rule)
    assert searches[0] == searches[1]
    assert len(set(searches)) == 3


def test_a_laws_own_gains_are_taken_where_no_tried_set_is_better(tmp_path, monkeypatch):
    sets = []
    for gains in (
        tuple(FAST.gains.values()),
        (5.0, 2.5),
    ):
        sets.append(types.SimpleNamespace(gains=gains))
    tuned = types.SimpleNamespace(
        before=1.0,
        objective=2.0,
        law=FAST,
        sets=sets,
        bounds=FAST.gains,
        gains=FAST.gains,
        at_bound={},
    )
    monkeypatch.setattr(fair_gains, "cached", lambda *rest: tuned)
    default = smc.law("observer_free")
    rule = trial(tmp_path).rule(DUFFING, [])
    own = trial(tmp_path).search_gains(DUFFING, default, rule)
    assert own.law == default
    assert own.remark == "its defaults, better than those tried"
    assert own.law.source.kind == FAST.source.kind
    tuned.before = 3.0
    searched = trial(tmp_path).search_gains(DUFFING, default, rule)
    assert searched.law == FAST
    assert searched.remark == ""
    for budget, where in ((8, "trails"), (100, "leads")):
        other_starts = trial(tmp_path).search_gains(DUFFING, default, rule._replace(budget=budget))
        assert other_starts.remark.endswith(f"where it {where}, its search may be why")
    # also with another seed of the comparison run i has the gains of search i
    for first in (0, 1_000_000):
        assert [searched(first + i).gains["k1"] for i in range(3)] == [2.0, 2.5, 2.0]


def test_quick_searches_are_under_what_is_asked_for_and_noise_where_no_gains_are_shipped():
    """A condition that has noise needs no other; where some gains are shipped, all are as these."""
    machine = dataclasses.replace(smc.plant("duffing", M=2.0), name="mine")
    other_starts = smc.starts(x0=0.5)
    for names, searched in (
        (("friction", "delay_10ms"), ["friction", "delay_10ms", "noise"]),
        (("noise + friction",), ["noise + friction"]),
    ):
        conditions = [find_condition(name) for name in names]
        quick = trial(Path("gains"), [machine], other_starts, quick=True)._replace(
            conditions=conditions
        )
        rule = quick.rule(machine, [None])
        assert [condition.name for condition in rule.goal.conditions] == searched
        assert rule.goal.duration == pytest.approx(quick.duration * 2 / 3)
        assert (rule.goal.starts, rule.quick, rule.budget) == (other_starts, True, 16)
    shipped = quick.known(DUFFING, [law_catalogue()["pid"]])
    rule_of_all = quick.rule(DUFFING, [*shipped, None])
    assert (rule_of_all.goal.starts, rule_of_all.quick) == (Objective().starts, False)


def test_a_law_with_fewer_shipped_sets_than_searches_asked_for_is_tuned_too(monkeypatch):
    """It kept its three sets, whatever number was given."""
    laws = [law_catalogue()[name] for name in ("fixed_time", "pid")]
    monkeypatch.setattr(Trial, "search_gains", lambda self, plant, law, starts: law.name)
    for searches, tuned, sets in ((None, 3, 12), (3, 3, 3), (6, "fixed_time", 6)):
        gains = GainChoice(as_many=searches is not None)
        effort = {} if searches is None else {"searches": searches}
        compared = trial(Path("gains"), [DUFFING], gains=gains, **effort)
        few, many = compared.candidates({"duffing": laws}, 12)["duffing"]
        assert (few if searches == 6 else len(few.sets)) == tuned
        assert len(many.sets) == sets
    untuned = trial(
        Path("gains"), [DUFFING], gains=GainChoice(tune=False, as_many=True), searches=6
    )
    assert len(untuned.candidates({"duffing": laws}, 12)["duffing"][0].sets) == 3


def test_what_cannot_be_ranked_is_said_before_laws_are_tuned(monkeypatch, capsys):
    @law_function(gains={"k": 2.0})
    def mine(y, gains, memory):
        return -gains.k * y.e, y.e

    monkeypatch.setattr(Trial, "search_gains", lambda *given: capsys.readouterr().err)
    for usual, words in (
        (
            12,
            "gains to search on duffing: mine and mine; searches of these laws as they are now, which gains keeps, are not repeated\n",
        ),
        (5, "5 sets of gains or runs cannot rank 2 laws in 1 condition; 6"),
    ):
        asked_trial = trial(
            Path("gains"), [DUFFING], gains=GainChoice(defaults=True), searches=usual
        )._replace(progress=True, conditions=[NAMED["noise"]])
        (said, _) = asked_trial.candidates({"duffing": [mine, mine]}, 12)["duffing"]
        assert said.startswith(words)
        assert said.endswith(
            "gains to search on duffing: mine and mine; searches of these laws as they are now, which gains keeps, are not repeated\n"
        )


def test_j_on_unseen_runs_is_kept(tmp_path, monkeypatch):
    candidates = {"duffing": [Candidate(FAST, (FAST, smc.law("observer_free", lam=6.0, k1=2.5)))]}
    here = trial(tmp_path, [DUFFING])
    monkeypatch.setattr(fair_gains, "Objective", functools.partial(Objective, duration=0.3))
    first = here.holdout(candidates, 3)["duffing"]
    monkeypatch.setattr(fair_gains, "objectives", None)
    again = here.holdout(candidates, 3)["duffing"]
    for old, new in zip(first[:4], again[:4], strict=True):
        np.testing.assert_array_equal(old["observer_free"], new["observer_free"])


def test_laws_that_cannot_see_what_nothing_drives_are_named_before_the_runs(tmp_path, capsys):
    laws = [all_laws()[name] for name in ("pid", "hierarchical")]
    for plant, names in (("cart_pole", ["pid"]), ("duffing", [])):
        machine = smc.plant(plant)
        fields = {"draws": Draws(1), "threads": 1, "progress": True}
        trial = Trial.of([machine], "nominal", (), 1.0, tmp_path, **fields)
        trial.check({plant: laws})
        said = capsys.readouterr().err
        assert [law.name for law in laws if law.name in said] == names


def test_a_start_out_of_range_is_refused_before_the_runs_of_any_seed(tmp_path):
    xml = """<mujoco><compiler angle="radian"/><worldbody><body>
    <joint name="j" axis="0 1 0" limited="true" range="-1 1"/><geom size=".1" pos=".2 0 0"/>
    </body></worldbody><actuator><motor joint="j" ctrllimited="true" ctrlrange="-20 20"/></actuator>
    </mujoco>"""
    arm = smc.plant_from(xml, ["j"], name="arm")
    fields = {"draws": Draws(12, smc.starts(x0=0.9, spread=0.2))}
    trial = Trial.of([DUFFING, arm], "nominal", (), 1.0, tmp_path, **fields)
    trial.case(arm, "none", "nominal")  # that of the first seed is in range
    with pytest.raises(smc.ScenarioError, match=r"x0 of joint 'j'.* outside its range"):
        trial.check({DUFFING.name: [FAST], "arm": [FAST]})
