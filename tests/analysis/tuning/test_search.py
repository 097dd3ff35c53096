"""What tuning promises: one rule for every law, the same gains for the same seed, never worse for a larger budget."""

import dataclasses
import itertools
import json
import math
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from helpers.words import words

import smc_mujoco as smc
from smc_mujoco.analysis import ranking
from smc_mujoco.analysis.tuning import search, search_space
from smc_mujoco.analysis.tuning.objective import FAILURE_COST, Objective
from smc_mujoco.analysis.tuning.result import MAX_SETS, Evaluation, compare, load
from smc_mujoco.analysis.tuning.search import EVALUATIONS_PER_GAIN, SPARE_EVALUATIONS, tune
from smc_mujoco.cli import main
from smc_mujoco.control.law import catalogue
from smc_mujoco.control.units import Gain, Unit
from smc_mujoco.evidence.papers.gaber import scenarios
from smc_mujoco.metrics.catalogue import itae, tv
from smc_mujoco.studies.fair_gains import Trial

SHORT = Objective(duration=0.5)
LEAN = Objective(conditions=("nominal",), duration=0.25)


@smc.law_function(gains={"when": 0.1, "k": 3.0})
def failing(y, gains, memory):
    return math.nan if y.t > gains.when else -gains.k * (y.de + 2.0 * y.e), y.e


def one_gain(y, gains, memory):
    return -gains.k * (y.de + 2.0 * y.e), y.e


@pytest.fixture(scope="module")
def found():
    """One tuning, for those tests that only look at it."""
    return tune("duffing", "observer_free", budget=32, seed=3, objective=SHORT)


@pytest.fixture(scope="module")
def rival():
    """Another law's, on equal terms."""
    return tune("duffing", "classical", budget=32, seed=3, objective=SHORT)


# the same seed, a larger budget


def test_tracking_is_a_share_of_where_a_run_starts():
    """It moves by a tenth of its start until the second sample."""
    trace = smc.run(smc.Scenario(plant="duffing", law="none", x0=1.0, v0=100.0, duration=0.05))
    tracking, variation = SHORT.terms_of_run(trace)
    assert tracking == itae(trace)
    assert variation == 0.0


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:no set of gains")
def test_the_same_seed_gives_the_same_gains_to_the_last_bit_at_any_thread_count(found):
    assert tune("duffing", "observer_free", budget=32, seed=3, objective=SHORT, threads=1) == found
    other = tune("duffing", "observer_free", budget=4, seed=4, objective=SHORT)
    assert other.history[-1].gains not in {e.gains for e in found.history}


@pytest.mark.slow
def test_a_larger_budget_repeats_the_starts_of_a_smaller_one_and_is_never_worse(monkeypatch):
    monkeypatch.setattr(search, "_spread", lambda *_: None)
    runs = [
        tune("duffing", "observer_free", budget=k * 2 * EVALUATIONS_PER_GAIN + SPARE_EVALUATIONS, objective=LEAN)
        for k in (1, 3)
    ]
    longest = runs[-1]
    assert [len(one.ends) for one in runs] == [1, 3]
    for one in runs:
        assert one.ends == longest.ends[: len(one.ends)]
        assert one.history == longest.history[: len(one.history)]
        assert one.objective == min(one.ends) == min(e.objective for e in one.history)
    assert longest.converged is not None
    assert runs[0].converged is None


def test_candidates_are_screened_cheaply_and_descents_are_accurate(monkeypatch):
    """Euler's method chooses where a descent begins, RK4 decides: its objective is the one that counts."""
    methods, run = [], search.run
    monkeypatch.setattr(
        search,
        "run",
        lambda cases, threads: methods.extend(c.resolved.integrator for c in cases) or run(cases, threads),
    )
    tuned = tune("duffing", "observer_free", budget=2 * EVALUATIONS_PER_GAIN, objective=LEAN)
    assert (
        methods.count("Euler")
        == tuned.screened
        == 2 * EVALUATIONS_PER_GAIN // 8 + 2 * EVALUATIONS_PER_GAIN // 2 // 6 * 6
    )
    assert methods.count("RK4") == len(tuned.history) + 1  # and the law's own gains
    assert 2 * EVALUATIONS_PER_GAIN // 8 < len(tuned.history) <= 3 * 2 * EVALUATIONS_PER_GAIN // 8 + 4


@pytest.mark.parametrize(
    ("ends", "verdict"),
    [
        ((1.0, 1.009), None),
        ((1.0, 1.009, 1.0099), True),
        ((1.0, 1.009, 1.011), False),
        ((1.3, 1.011, 1.0, 1.004, 2.0), False),
        ((1.3, 1.009, 1.0, 1.004, 2.0), True),
    ],
)
def test_a_search_has_converged_when_three_starts_end_within_a_percent_of_the_best(found, ends, verdict):
    assert dataclasses.replace(found, ends=ends).converged is verdict


@pytest.mark.slow
def test_a_search_ends_when_it_has_converged_and_knows_enough_sets_of_gains(monkeypatch):
    monkeypatch.setattr(search, "converged", lambda ends: len(ends) == 2)
    monkeypatch.setattr(search, "near_optimal", lambda history: history[:MAX_SETS])
    assert len(tune("duffing", "observer_free", objective=LEAN).ends) == 2
    monkeypatch.setattr(search, "near_optimal", lambda history: history[: MAX_SETS - 1])
    assert (
        len(tune("duffing", "observer_free", budget=6 * EVALUATIONS_PER_GAIN + SPARE_EVALUATIONS, objective=LEAN).ends)
        == 3
    )


def test_a_search_that_knows_few_sets_ends_with_random_steps_from_these_within_its_bounds():
    """J is near-optimal within 0.05 decades of the origin, where three sets are known, far closer to each other."""

    class Ledger:
        left, evaluations = (
            SPARE_EVALUATIONS,
            [Evaluation((10.0**z, 10.0**-z), 1.0, 1.0, 0.0) for z in (0.0, 1e-4, -1e-4)],
        )

        def cost(self, logs):
            J = 1.0 + 12.0 * float(logs @ logs)
            self.evaluations.append(Evaluation(tuple((10.0**logs).tolist()), J, J, 0.0))
            return J

    ledger = Ledger()
    search._spread(ledger, {"a": (0.5, 1.05), "b": (0.5, 2.0)}, np.random.default_rng(0))
    near = search.near_optimal(ledger.evaluations)
    assert len(near) == MAX_SETS
    assert np.ptp(np.log10([one.gains for one in near]), axis=0).min() > 0.02  # a hundred times as far apart
    assert max(one.gains[0] for one in ledger.evaluations) <= 1.05 * (1 + 1e-12)


def test_sets_are_near_optimal_distinct_and_cover_what_is_near_optimal(found):
    """The best first; no more than 24; the farthest from it is among them, and what costs 4 % more is not."""
    line = [Evaluation((10.0 ** (k / 100), 1.0), 1.0 + k / 2500, 1.0, 0.0) for k in range(101)]
    tuned = dataclasses.replace(found, history=tuple(reversed(line)), objective=1.0)
    assert len(search.near_optimal(tuned.history)) == 76
    sets = tuned.sets
    assert sets[0] == line[0]
    assert len(set(sets)) == MAX_SETS
    assert line[75] in sets
    places = sorted(math.log10(one.gains[0]) for one in sets)
    assert max(b - a for a, b in itertools.pairwise(places)) <= 0.06  # 0.75 decades in 24 sets
    assert [one.gains for one in sets[1:]] != sorted(one.gains for one in sets[1:])
    assert tuned.record()["sets"] == [one.gains for one in sets]


def test_runs_of_two_laws_make_as_many_samples_as_the_law_with_fewer_sets_has(found):
    """Sets that runs use in turn link their runs: 8 and 13 of them would make a single sample."""
    few, many = (dataclasses.replace(found, history=_near(k)).sets for k in (8, 13))
    runs = range(24)
    linked = ranking.linked(*(np.array([k % len(sets) for k in runs]) for sets in (few, many)))
    assert linked is not None
    assert len(set(linked)) == len(few) == 6


def _near(count):
    return tuple(Evaluation((1.0 + k / 100, 1.0), 1.0, 1.0, 0.0) for k in range(count))


def test_what_is_not_integrated_by_rk4_is_run_as_it_is_in_both_rounds():
    cases = Objective(conditions=("coulomb",)).scenarios("duffing", smc.law("classical"), 0)
    assert search._under_euler(cases[0]) == cases[0]
    assert cases[0].resolved.integrator == "implicitfast"


@pytest.mark.filterwarnings("ignore:no set of gains")
@pytest.mark.parametrize("budget", [1, 7, 64])
def test_it_stops_at_the_budget_and_no_set_of_gains_is_paid_for_twice(budget):
    tuned = tune("duffing", "observer_free", budget=budget, objective=LEAN)
    assert 0.6 * budget <= tuned.evaluations <= budget
    assert tuned.history
    assert len({e.gains for e in tuned.history}) == len(tuned.history)


def test_a_law_of_one_gain_is_tuned():
    law = smc.law_function(gains={"k": Gain(1.0, Unit(force=1, position=-1, time=1), positive=True)})(one_gain)
    tuned = tune("duffing", law, budget=EVALUATIONS_PER_GAIN, objective=LEAN)
    assert tuned.screened == EVALUATIONS_PER_GAIN // 8
    assert tuned.objective < tuned.before


def test_the_cost_of_the_best_gains_can_be_repeated(found):
    traces = smc.run(found.definition.scenarios(found.plant, found.law, found.seed))
    again = sum(itae(t) / abs(t.x[0, 0]) + 1e-3 * tv(t) / (6.0 * 0.5) for t in traces)
    assert again == pytest.approx(found.objective, rel=1e-12)
    assert [t.scenario.input_delay for t in traces] == [0.0, 0.0, 0.01, *[0.0] * 4]
    assert [t.scenario.noise.position > 0.0 for t in traces] == [False, True, *[False] * 5]
    assert [bool(t.scenario.disturbance) for t in traces] == [False] * 3 + [True] * 2 + [False] * 2
    assert [t.scenario.mismatch.get("mass", 1.0) for t in traces] == [1.0] * 5 + [0.7, 1.3]


@pytest.mark.slow
def test_tuning_beats_the_default_gains(found, rival):
    for tuned in (found, rival):
        assert tuned.objective < tuned.before


def test_the_front_is_what_no_other_evaluation_beats(found):
    front = found.front
    assert found.objective == min(e.objective for e in front)
    for e in front:
        assert not any(o.tracking <= e.tracking and o.variation < e.variation for o in found.history)
    assert [e.variation for e in front] == sorted((e.variation for e in front), reverse=True)


# the search space


def test_scales_are_those_of_the_plant():
    scales = search_space.scales(smc.plant("duffing", M=6.0), u_max=4.0, with_model=False)
    assert scales == {"X": 1.5, "F": 4.0, "M": pytest.approx(6.0), "T": pytest.approx(1.5)}
    assert search_space.scales(smc.plant("duffing", M=6.0), u_max=4.0, with_model=True)["F"] == pytest.approx(4.0 / 6.0)
    assert search_space.scales(smc.plant("inverted_pendulum"), 6.0, False)["M"] == pytest.approx(0.5 * 0.5**2)


def test_a_gain_is_searched_three_decades_wide_about_its_scale():
    scales = {"X": 2.0, "F": 6.0, "M": 1.0, "T": 0.5}
    box = search_space.box(smc.law("super_twisting"), scales)
    middle = {name: math.sqrt(low * high) for name, (low, high) in box.items()}
    assert middle == {"k1": pytest.approx(6.0 / 4.0**0.5), "k2": pytest.approx(12.0), "c": pytest.approx(2.0)}
    assert [high / low for low, high in box.values()] == pytest.approx([1000.0] * 3)


def test_a_force_is_searched_up_to_what_the_actuator_gives_and_no_further():
    scales = {"X": 2.0, "F": 6.0, "M": 1.0, "T": 0.5}
    assert search_space.box(smc.law("twisting"), scales)["r1"] == (pytest.approx(6.0 / 10**1.5), 6.0)
    box = search_space.box(smc.law("observer_free"), scales)
    wider = search_space.widened(smc.law("observer_free"), box)
    assert wider["lam"] == (pytest.approx(box["lam"][0] / 10), 6.0)
    assert wider["k1"] == (pytest.approx(box["k1"][0] / 10), pytest.approx(box["k1"][1] * 10))


@pytest.mark.parametrize("law", ["extended_state", "disturbance_observer"])
def test_a_gain_over_another_is_searched_up_to_what_the_actuator_gives(law):
    tuned = tune("duffing", law, budget=EVALUATIONS_PER_GAIN, objective=LEAN)
    order = list(tuned.bounds)
    forces = [e.gains[order.index("k")] / e.gains[order.index("b")] for e in tuned.history]
    assert 5.0 < max(forces) <= 6.0 * (1.0 + search_space.ROUNDING_TOLERANCE)
    assert sum(force > 6.0 * (1.0 - search_space.ROUNDING_TOLERANCE) for force in forces) > 3
    beyond = dataclasses.replace(tuned, law=dataclasses.replace(tuned.law, gains={**tuned.law.gains, "k": 1e3}))
    assert beyond.at_bound["k"] == "upper"


def test_a_gain_is_divided_by_one_that_the_law_has(refused):
    refused(lambda: smc.law_function(gains={"k": Gain(1.0, over="B"), "b": 1.0})(lambda y, gains, memory: (0.0, 0.0)))


def test_a_held_gain_keeps_its_value():
    tuned = tune("duffing", smc.law("adaptive", k0=1.25), budget=5, objective=LEAN)
    assert tuned.law.gains["k0"] == 1.25
    assert set(tuned.bounds) == {"gamma", "c"}


def test_the_search_knows_nothing_of_the_gains_it_is_given():
    one, other = (tune("duffing", smc.law("classical", k=k), budget=20, objective=LEAN) for k in (0.5, 5.0))
    assert one.history == other.history
    assert one.before != other.before


def test_gains_without_units_are_searched_about_their_defaults_with_a_warning():
    with pytest.warns(smc.ScenarioWarning, match=r"failing's when and k have no unit.*Gain\("):
        tuned = tune("duffing", failing(), budget=5, objective=LEAN)
    for name, (low, high) in tuned.bounds.items():
        assert low * high == pytest.approx(failing().gains[name] ** 2)


def test_a_gain_without_a_unit_that_is_not_positive_is_refused(refused):
    refused(lambda: tune("duffing", smc.law_function(one_gain, gains={"k": 0.0})(), budget=5, objective=LEAN))


@pytest.mark.slow
def test_a_search_leaves_a_box_that_lacks_the_optimum_by_a_decade_and_says_so():
    own = catalogue()["observer_free"]
    odd = dataclasses.replace(own, gains=dict(own.gains) | {"lam": Gain(6.0, Unit(force=-2), positive=True)})
    tuned = tune(
        "duffing", odd, budget=2 * EVALUATIONS_PER_GAIN, objective=Objective(conditions=("nominal",), duration=1.5)
    )
    low, high = tuned.bounds["lam"]
    assert tuned.searched["lam"] == (pytest.approx(low / 10), pytest.approx(10 * high))
    assert high < tuned.gains["lam"] <= 10 * high


@pytest.mark.parametrize(("gain", "side"), [(1.14, "lower"), (1.16, None), (860.0, None), (880.0, "upper")])
def test_near_a_bound_is_within_two_percent_of_its_decades(gain, side):
    assert search_space.at_bound({"k": gain}, {"k": (1.0, 1000.0)}).get("k") == side


# runs that fail


def test_a_run_that_fails_costs_more_than_any_other_and_less_the_later_it_fails():
    goal = Objective(conditions=("nominal",), duration=0.2)
    laws = [failing(when=when) for when in (0.0, 0.05, 0.1, 0.15, 1.0)]
    traces = smc.run([goal.scenarios("duffing", law, 0)[0] for law in laws])
    costs = [goal.terms([trace])[0] for trace in traces]
    assert all(map(math.isfinite, costs))
    assert costs == sorted(costs, reverse=True)
    assert len(set(costs)) == 5
    assert costs[-1] < 1.0 < FAILURE_COST <= costs[-2]


# equal terms


def test_a_law_that_got_more_than_its_rivals_is_not_compared(found, rival, refused):
    assert {one.law.name for one in compare([rival, found])} == {"classical", "observer_free"}
    assert compare([rival, found]) == sorted([rival, found], key=lambda one: one.objective)
    unequal = {
        "budget": dataclasses.replace(rival, budget=33),
        "rule": dataclasses.replace(rival, rule="by hand"),
        "objective": dataclasses.replace(rival, definition=Objective(duration=0.5, u_max=12.0)),
        "seed": dataclasses.replace(rival, seed=4),
        "plant": dataclasses.replace(rival, plant=smc.plant("duffing", M=2.0)),
    }
    away = dataclasses.replace(rival, law=dataclasses.replace(rival.law, function=None))
    assert len(compare([away, found])) == 2
    for one in unequal.values():
        refused(lambda one=one: compare([found, one]))
    refused(lambda: compare([]))


def test_every_law_of_the_paper_is_bounded_by_the_same_u():
    for law in scenarios.LAWS:
        assert {s.resolved.u_max for s in Objective().scenarios("van_der_pol", smc.law(law), 0)} == {6.0}


# files


def test_a_tuning_is_saved_and_read_back_as_it_was(found, tmp_path):
    path = found.save(tmp_path / "new" / "it.json")
    assert load(path) == found
    held = json.loads(path.read_text())
    assert held["budget"] == 32
    assert held["record"]["sets"][0] == list(found.gains.values())
    assert held["definition"]["conditions"] == ["nominal", "noise", "delay_10ms", "sine", "constant", "light", "heavy"]
    assert set(held["versions"]) == {"smc_mujoco", "mujoco", "numba", "numpy", "scipy", "cmaes"}


def test_a_tuning_says_what_was_searched_and_how(found, tmp_path, snapshot):
    gains = {"lam": 2.0, "k1": 3.0}, {"lam": 6.0, "k1": 1e-3}
    plain, extreme = (dataclasses.replace(found, law=dataclasses.replace(found.law, gains=one)) for one in gains)
    failing = dataclasses.replace(plain, ends=(1.0, 1.005, 1.0101), screened=0, history=found.history[:1])
    agreeing = dataclasses.replace(plain, ends=(1.0, 1.005, 1.0099))
    tables = [one.tables[0] for one in (plain, extreme, failing, agreeing)]
    said = [words(f"{one.title} {one.headings} {one.rows} {one.notes}") for one in tables] + [words(repr(plain))]
    goals = Objective(u_max=12.0, chattering=0.01, conditions=("nominal", "sine")), Objective(weight=0.0)
    stored = sorted(json.loads(found.save(tmp_path / "a.json").read_text()))
    assert [*said, *map(str, goals), goals[0].describe(), stored] == snapshot


def test_what_is_no_tuning_is_refused(found, tmp_path, refused):
    broken = tmp_path / "broken.json"
    for text in ("", "[]", "{}", '{"scenario": {}}'):
        broken.write_text(text)
        refused(lambda: load(broken))
    refused(lambda: load(tmp_path / "none.json"))
    refused(lambda: found.save(tmp_path / "it.txt"))


# bad input


def test_bad_input_is_one_sentence(refused):
    for changed in [
        {"plant": "dufing"},
        {"plant": 3},
        {"law": "clasical"},
        {"law": "none"},
        {"law": "hierarchical"},
        {"plant": "cart_pole", "law": "classical"},
        {"budget": 0},
        {"budget": 2.5},
        {"seed": -1},
        {"objective": "best"},
        {"threads": 0},
    ]:
        given = {"plant": "duffing", "law": "classical", "budget": 5, "objective": LEAN} | changed
        refused(lambda given=given: tune(**given))


def not_yet(y, gains, memory):
    raise ValueError("not yet")


def mistyped(y, gains, memory):
    return -gains.q * y.e if abs(y.e) < 1.0 else -gains.k * y.e, y.e


@pytest.mark.filterwarnings("ignore:.*does not compile", "ignore:.* no unit")
@pytest.mark.parametrize("function", [not_yet, mistyped])
def test_a_law_that_fails_by_itself_is_not_searched_and_says_why(function, monkeypatch, tmp_path, refused):
    law = smc.law_function(gains={"k": 3.0})(function)
    monkeypatch.setattr(search, "_search", None)
    refused(lambda: Trial([], [], 1.0, None, tmp_path, None, False).gains_on(smc.plant("duffing"), [law], 4))


@pytest.mark.filterwarnings("ignore:.* no unit")
def test_a_law_that_fails_later_is_refused_if_no_gains_mend_it(refused):
    def made(limit):
        @smc.law_function(gains={"k": 3.0})
        def sensor_lost(y, gains, memory):
            if y.t > 0.01 and gains.k > limit:
                raise ValueError("sensor lost")
            return -gains.k * y.e, y.e

        return sensor_lost

    refused(lambda: tune("duffing", made(0.0), budget=EVALUATIONS_PER_GAIN, objective=LEAN))
    assert not tune("duffing", made(2.0), budget=8, objective=LEAN).sets[0].failed


def test_a_bad_objective_is_refused(refused):
    for changed in (
        {"conditions": ("calm",)},
        {"conditions": 3},
        {"conditions": ()},
        {"weight": -1.0},
    ):
        refused(lambda changed=changed: Objective(**changed))
    for name in ("duration", "u_max", "control_period", "chattering"):
        for value in (0.0, math.inf, "1"):
            refused(lambda changed={name: value}: Objective(**changed))


# the command


@pytest.fixture
def call(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)

    def run(*arguments):
        with pytest.raises(SystemExit) as end:
            main.main(["tune", *arguments])
        return end.value.code, *capsys.readouterr()

    return run


@pytest.mark.slow
@pytest.mark.filterwarnings("always")
def test_the_command_prints_gains_and_writes_what_it_found(call, tmp_path):
    code, out, err = call("duffing", "classical", "--budget", "3", "--objective", "tracking", "--out", "k.json")
    tuned = load(tmp_path / "k.json")
    assert code == 0
    assert f"{tuned.gains['k']:g}" in out
    assert f"objective {tuned.objective:.4g} s², with the law's own gains {tuned.before:.4g} s²; 3 sets" in out
    assert tuned.definition == Objective(weight=0.0, u_max=6.0)
    assert ("no set of gains" in err) == (tuned.objective > tuned.before)


@pytest.mark.filterwarnings("always")
def test_the_command_says_when_the_laws_own_gains_are_better(call):
    _, out, err = call("duffing", "super_twisting", "--budget", "1")
    assert "1 set of gains" in out
    assert re.fullmatch(WORSE.replace("classical", "super_twisting"), err.removeprefix("smc-mujoco: ").rstrip())


WORSE = (
    r"no set of gains tried for classical on duffing is better than the law's own, with an objective of \S+ s² instead "
    r"of \S+ s²: give a larger budget"
)


def test_warns_if_and_only_if_the_laws_own_gains_are_better():
    first = tune("duffing", smc.law("classical", k=0.5), budget=20, objective=LEAN)
    assert first.objective < first.before
    with pytest.warns(smc.ScenarioWarning, match=WORSE) as caught:
        again = tune("duffing", first.law, budget=1, objective=LEAN)
    assert again.objective > again.before
    assert [Path(one.filename).name for one in caught] == ["test_search.py"]
    tune("duffing", first.law, budget=20, objective=LEAN)  # as good as its own: a warning would be an error


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("dufing", "classical"), "duffing"),
        (("duffing", "clasical"), "classical"),
        (("duffing", "classical", "--objective", "best"), "balanced"),
        (("duffing", "classical", "--out", "k.txt"), ".json"),
        (("duffing", "none"), "no gain"),
    ],
)
def test_the_command_refuses_in_one_sentence(call, arguments, word):
    code, out, err = call(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("smc-mujoco: ")
    assert err.count("\n") == 1
    assert word in err


def test_a_notebook_shows_the_gains_with_their_bounds(found):
    shown = found._repr_html_()
    rows = re.findall(r"<td[^>]*>(\w+)</td>" + 3 * r"<td[^>]*>([^<]*)</td>", shown)
    assert [row[0] for row in rows] == list(found.gains)
    for name, value, low, high in rows:
        assert float(value) == pytest.approx(found.gains[name], rel=1e-5)
        assert [float(low), float(high)] == pytest.approx(list(found.searched[name]), rel=1e-2)
    assert f"objective {found.objective:.4g} s²" in shown
    assert f"own gains {found.before:.4g} s²" in shown
    assert "observer_free on duffing" in shown


LAGGING = smc.condition("lagging", actuator=smc.Lag(0.01))
LAGGED = Objective(conditions=(LAGGING,), duration=0.5)


def predicted(tuned) -> float:
    return smc.chattering(tuned.law, plant=tuned.plant, actuator=smc.Lag(0.01)).amplitude


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_grid")
def test_gains_are_tuned_within_a_bound_on_predicted_chattering():
    free = tune("duffing", "classical", 20, objective=LAGGED)
    bound = tune("duffing", "classical", 20, objective=LAGGED, chattering=1e-4)
    assert predicted(bound) <= 1e-4 < predicted(free)
    assert bound.objective < FAILURE_COST
    assert "predicted chattering of s <= 0.0001" in str(bound.definition)


@pytest.mark.usefixtures("coarse_grid")
def test_it_warns_if_all_gains_tried_chatter_too_much():
    with pytest.warns(smc.ScenarioWarning, match="are predicted to chatter with more than 1e-12"):
        tuned = tune("duffing", "classical", 2, objective=LAGGED, chattering=1e-12)
    assert tuned.objective > 2.0 * FAILURE_COST
