"""The lead of a family of laws over the next, by hand."""

import math
from typing import Any

import numpy as np
import pytest

import smc_mujoco as smc
from benchmarks import families
from smc_mujoco.control import gain_sets
from smc_mujoco.studies.fair_gains import Candidate

pytestmark = pytest.mark.quick
RUNS = 12
MODEL = """
<mujoco model="slide">
  <worldbody>
    <body>
      <joint name="slide" type="slide" axis="1 0 0"/>
      <geom size="0.1" mass="1" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <actuator><motor joint="slide" gear="60" ctrlrange="-1 1"/></actuator>
</mujoco>
"""


def lead(sets=None, floor=0.0, **scores) -> Any:
    its = {}
    for law, values in scores.items():
        its[law] = np.broadcast_to(np.asarray(values, float), RUNS).copy()
    return families.lead(
        its, {law: np.arange(RUNS) if sets is None else sets for law in its}, floor
    )


def test_every_law_that_is_compared_is_in_one_family():
    assert sorted(law for laws in families.FAMILIES.values() for law in laws) == sorted(
        gain_sets.COMPARED
    )


def test_a_law_is_scored_in_the_half_of_the_runs_that_did_not_choose_it():
    even = np.arange(RUNS) % 2 == 0
    own = np.where(even, 1.0, 100.0)
    other = np.where(even, 100.0, 1.0)
    scores, best = families.chosen_by_halves(np.array([own, other]))
    assert best == [1, 0]  # the odd runs choose the second law, for the even ones
    assert (scores == 100.0).all()


def test_the_lead_is_the_ratio_to_the_next_family_and_sure_where_its_interval_is_above_1():
    noise = np.exp(np.linspace(-0.2, 0.2, RUNS))
    found = lead(
        classical=3.0 * noise,
        observer_free=9.0,
        adrc=2.0,
        pid=5.0,
    )
    assert found.first == "rivals"
    assert found.second == "switching"
    assert found.laws == ("adrc",)
    assert found.low < found.times < found.high
    assert found.times == pytest.approx(1.5, rel=0.02)
    assert found.sure
    assert not lead(classical=2.0 * noise, adrc=2.0).sure


def test_runs_that_share_gains_count_once():
    sets = np.arange(RUNS) % 6  # a run and the sixth after it
    values = np.exp(np.linspace(0.1, 1.2, RUNS))
    found = lead(sets, classical=values, adrc=1.0)
    by_set = np.log(values).reshape(2, 6).mean(axis=0)
    assert math.log(found.low) == pytest.approx(by_set.min())
    assert math.log(found.high) == pytest.approx(by_set.max())


def test_what_nobody_can_see_is_no_lead_and_one_family_has_none():
    assert lead(floor=1e-3, classical=1e-5, adrc=1e-9).times == 1.0
    assert lead(classical=1.0, adaptive=2.0) is None


def test_a_sentence_stands_is_open_or_is_contradicted_by_its_interval():
    axis, _, highest, score, kind, _ = next(
        one for one in families.SENTENCES if one[-1] == "is level at best"
    )
    cell = {
        "plant": "duffing",
        "axis": axis,
        "level": highest,
        "score": score,
        "kind": kind,
    }
    ends = [(0.9, 1.1), (0.9, 1.2), (1.01, 1.05), (1.2, 1.3)]
    cells = []
    for low, high in ends:
        cells.append(cell | {"low": low, "high": high})
    cells += [cells[0] | {"level": 2 * highest}, cells[0] | {"kind": "another"}]
    assert [*families.judged(cells)][-1] == "in all: 2 of 4 stand, 1 contradicted"
    axis, _, level, score, kind, does = families.SENTENCES[0]
    assert does == "leads"
    cells = [
        cells[0]
        | {
            "axis": axis,
            "level": level,
            "score": score,
            "kind": kind,
            "low": low,
        }
        for low in (0.9, 1.01)
    ]
    assert [*families.judged(cells)][-1] == "in all: 1 of 2 stand, 0 contradicted"


def test_levels_by_lot_are_within_the_sentences_and_of_their_seed():
    levels = families.by_lot(7)
    assert levels == families.by_lot(7) != families.by_lot(8)
    for axis, lowest, highest, *_ in families.SENTENCES:
        assert sum(lowest <= level <= highest for level in levels[axis]) >= families.DRAWN


def test_a_lead_is_told_where_the_gains_admit_the_load_and_where_not():
    runs = {law: np.ones(RUNS) for law in families.SURE} | dict.fromkeys(
        families.FAMILIES["rivals"], np.full(RUNS, 9.0)
    )
    cell = {
        "score": "error",
        "kind": "switching",
        "runs": runs,
        "admitted": dict.fromkeys(families.SURE, [True] * RUNS),
    }
    weaker = runs | dict.fromkeys(families.FAMILIES["rivals"], np.full(RUNS, 2.0))
    beyond = cell | {"runs": weaker, "admitted": {"implicit_first_order": [False] * RUNS}}
    reported = [
        *families.borders([cell, beyond, cell | {"kind": "smoothed"}, cell | {"admitted": {}}])
    ]
    assert [line.split(": ")[1] for line in reported[:2]] == [
        "9 (9 to 9), 12 runs",
        "2 (2 to 2), 12 runs",
    ]
    assert reported[2].endswith("9 (9 to 9), 12 runs")
    assert reported[3].endswith(" 0 runs")


def test_gains_admit_a_load_below_k_and_a_rate_below_k2(tmp_path):
    """On the hanging chain implicit_first_order has k of 0.65 to 0.8 N m, super_twisting k2 of 1 to
    8 N m / s.
    """
    found = families.subject("pendulum_network", tmp_path)
    within, beyond = (found.admitted(families.FORCE, level) for level in (0.6, 1.0))
    # 14 N m / s at least
    assert within == {"implicit_first_order": [True] * RUNS, "super_twisting": [False] * RUNS}
    assert not any(beyond["implicit_first_order"])
    assert not found.admitted("load, omega / wc", 0.25)
    assert found.admitted("load, omega / wc", 0.5)
    assert not found.admitted("noise / start", 1e-3)


def test_a_load_and_friction_are_in_proportion_to_the_bound():
    """The twelve runs of a plant of one's own, whose motor gives 60 N, take turns in the gains of
    its searches.
    """
    plant = smc.plant_from(MODEL, channels={"slide": smc.Channel(x0=0.3)})
    laws = []
    for i in range(RUNS):
        laws.append(smc.law("adrc", wc=float(i + 1)))
    found = families.Subject(plant, {"adrc": Candidate(laws[1], tuple(laws))}, "heavy")
    assert found.load(families.FORCE, 0.5) == (5.0, 1.0)
    assert found.load("load, omega / wc", 0.25) == (10.0, 0.5)
    runs = found.scenarios("friction / u_max", 0.1, "adrc")
    assert [run.law.gains["wc"] for run in runs] == [law.gains["wc"] for law in laws]
    assert {run.friction[0].level for run in runs} == {6.0}
    assert {run.mismatch["mass"] for run in runs} == {1.3}
    assert len({run.resolved.x0 for run in runs}) == RUNS


def test_a_plant_may_be_what_a_python_file_defines(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text("import smc_mujoco as smc\nMINE, N = smc.plant('duffing', beta=2.0), 3\n")
    assert families.of_file(path).parameters["beta"] == 2.0
    path.write_text("import smc_mujoco as smc\nA, B = map(smc.plant, ('duffing', 'van_der_pol'))\n")
    assert families.of_file(path, "van_der_pol").name == "van_der_pol"
    with pytest.raises(
        smc.ScenarioError, match=r"plant of .*mine.py '': choose from duffing, van_der_pol"
    ):
        families.of_file(path)
