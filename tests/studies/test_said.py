"""What worst cases, accuracies, needs and kept files say and are named, of made-up numbers."""

import dataclasses
import math
import pickle
import sys
import threading
from pathlib import Path

import arms
import numpy as np
import pytest
from helpers.sketch import made

import smc_mujoco as smc
from smc_mujoco.analysis.bootstrap import Interval
from smc_mujoco.analysis.ranking import Rank
from smc_mujoco.common import cache
from smc_mujoco.common.tabular import plain
from smc_mujoco.evidence.accuracy import accuracy as accuracies
from smc_mujoco.evidence.accuracy.accuracy import AccuracyTable, Run, Setup
from smc_mujoco.evidence.accuracy.scaling import Accuracy, Scaling
from smc_mujoco.simulation.conditions import find_condition
from smc_mujoco.studies import executors, run_key, study, worst_case
from smc_mujoco.studies.advice import Choice, ties
from smc_mujoco.studies.scene import slug
from smc_mujoco.studies.worst_case import WorstCase, WorstCases, default_budget

RUN = smc.Scenario(plant="duffing", law="classical", duration=8.0)
WITHIN = smc.Uncertainty(disturbance=0.5, mass=(0.8, 1.2))


def attacked(law: str, value: float, median: float, **fields: object) -> WorstCase:
    """The worst case of a law, of made-up values."""
    scenario = dataclasses.replace(RUN, law=smc.law(law))
    given = {
        "unit": "m",
        "found_by": "bang-bang",
        "tried": 48,
        "metric": "rms_error",
        "outside": "",
        "seed": 0,
    }
    both = {"scenario": scenario, "nominal": scenario, "within": WITHIN}
    return WorstCase(value=value, median=median, **given | both | fields)


def rows_of(text: str) -> dict[str, list[str]]:
    """The cells of a printed table by the name that begins a row, without its mark."""
    return {
        line.split()[0].rstrip("*"): line.split()[1:] for line in text.splitlines() if line.strip()
    }


def test_worst_cases_stand_from_the_least_with_their_places_by_median_their_class_and_what_lies_outside():
    cases = [
        attacked("classical", 0.2, 0.05, outside="the law is for |d| <= 0.1 N", sets=3),
        attacked("pid", math.inf, 0.04, found_by="sine"),
        attacked("adaptive", 0.1, 0.07, unit=""),
    ]
    text = plain(WorstCases(cases), 100)
    rows = rows_of(text)
    assert [law for law in rows if law in ("adaptive", "classical", "pid")][:3] == [
        "adaptive",
        "classical",
        "pid",
    ]
    assert rows["adaptive"] == ["0.100", "0.0700", "3", "bang-bang"]
    assert rows["pid"] == ["fails", "0.0400", "1", "sine"]
    assert "tau between the two orders: -1.00" in text
    assert "tau" not in plain(
        WorstCases(cases[:2]), 100
    )  # of two laws there is no order to speak of
    assert ["in m," in plain(WorstCases(those), 100) for those in (cases, cases[:2])] == [
        False,
        True,
    ]
    for said in (text, plain(cases[0], 100)):
        assert "classical: the law is for |d| <= 0.1 N" in said
    for case, sets in ((cases[0], True), (cases[1], False)):
        assert ("any of 3 parameter sets" in case.heading) is sets
        assert all(
            part in case.heading
            for part in ("Duffing oscillator", "|d| <= 0.5 N", "mass x 0.8 to 1.2")
        )
    assert all(
        part in repr(cases[1])
        for part in ("pid on duffing", "rms error fails", "0.0400 m", "|d| <= 0.5 N")
    )
    names = "value median unit found_by tried metric outside seed sets within scenario"
    assert list(cases[0].about()) == names.split()


@pytest.mark.parametrize(
    "field", ["value", "median", "unit", "found_by", "tried", "metric", "outside", "seed", "sets"]
)
def test_a_worst_case_that_is_kept_is_the_one_that_is_read(field, tmp_path, monkeypatch):
    found = attacked(
        "classical", 0.2, 0.05, outside="no", sets=3, seed=2, found_by="sine", tried=50, unit="rad"
    )
    monkeypatch.setattr(worst_case, "worst_case", lambda *_, **__: found)
    path = tmp_path / "worst" / "a.json"
    for _ in range(2):
        again = worst_case.cached_worst_case(path, RUN, WITHIN, 24)
        assert getattr(again, field) == getattr(found, field)
        assert (again.scenario.plant, again.within) == (found.scenario.plant, WITHIN)
        monkeypatch.setattr(worst_case, "worst_case", None)  # would raise
    (kept,) = path.parent.iterdir()
    assert [len(part) for part in kept.stem.split("-")] == [1, 12, 12]


def test_a_default_budget_is_as_many_runs_as_take_the_time_of_that_many_steps():
    """2.5 million steps for two numbers of runs; a channel adds half, dry friction doubles."""
    rough = dataclasses.replace(RUN, friction=smc.Coulomb(0.1), duration=1.0)
    network = smc.Scenario(plant="pendulum_network", law="classical", duration=8.0)
    assert default_budget(RUN, WITHIN) == 2_500_000 // (8000 * 2)
    assert default_budget(rough, WITHIN) == 2_500_000 // (1000 * rough.steps * 2 * 2)
    assert default_budget(RUN, dataclasses.replace(WITHIN, friction=(0.0, 0.1))) == 2_500_000 // (
        8000 * 2 * 2
    )
    assert default_budget(network, WITHIN) == 2_500_000 // (8000 * 6)
    assert default_budget(dataclasses.replace(RUN, duration=500.0), WITHIN) == 24
    assert default_budget(dataclasses.replace(RUN, duration=0.5), WITHIN) == 1024


def measured(
    law: str, condition: str = "constant", gains: str = "shipped", why: str = "", failed: int = 0
) -> Accuracy:
    periods = (4e-3, 2e-3, 1e-3)
    errors = ((0.8, 0.2, 0.05), (0.4, 0.11, 0.03))
    scaling = Scaling(
        errors=errors, used=periods, order=1.9, low=1.8, high=2.1, theory=2.0, why=why
    )
    free = dataclasses.replace(scaling, theory=1.0, order=math.nan, low=math.nan, high=math.nan)
    names = {
        "plant": "duffing",
        "condition": condition,
        "law": law,
        "gains": gains,
        "unit": "m",
        "runs": 6,
    }
    return Accuracy(**names, periods=periods, e=scaling, s=free, failed=failed, floor=1e-9)


def test_a_table_of_accuracies_marks_laws_with_a_reason_and_says_whose_gains_are_not_tuned():
    rows = [
        measured("classical"),
        measured("pid", gains="default", why="the gains violate k > d", failed=2),
    ]
    table = AccuracyTable([*rows, measured("adaptive", "coulomb", gains="default")])
    first, second = plain(table, 100).split("duffing, coulomb")
    lines = rows_of(first)
    assert lines["classical"] == ["8.0e-01", "5.0e-02", "1.90", "±0.20", "none", "2,", "1"]
    assert "pid* " in first
    assert "classical* " not in first
    assert "* pid: the gains violate k > d" in first
    assert "default gains: pid; tuned: classical" in first
    assert "|e| in m, gains: default" in second
    assert "default gains" not in second


PROMISED = [  # change of the run, what keeps theory from promising an order
    ({"actuator": smc.Lag(0.01)}, "drive"),
    ({"input_delay": 1e-3}, "delay"),
    ({"clock": smc.Clock(jitter=1e-4)}, "late"),
    ({"noise": smc.Noise(1e-3)}, "noise"),
    ({"sensor": smc.Encoder(counts=4096)}, "encoder"),
    ({"velocity": smc.estimator("filtered_difference")}, "velocity"),
    ({"law": smc.law("nested_third_order")}, "relative degree"),
]


@pytest.mark.parametrize(("change", "reason"), PROMISED, ids=lambda given: str(given)[:20])
def test_theory_promises_an_order_only_to_ideal_channels_of_the_law_s_relative_degree(
    change, reason
):
    assert reason in accuracies._why_no_promise(dataclasses.replace(RUN, **change))
    assert not accuracies._why_no_promise(RUN)


def test_bounds_that_are_reached_and_steps_that_matter_are_reasons_from_their_thresholds_on():
    scenario = dataclasses.replace(RUN, law=smc.law("super_twisting", k1=0.01, k2=9.0))
    setup = Setup([scenario] * 4, (2e-3, 1e-3), 2)
    told = {}
    for share in (0.0499, 0.05, 0.5):
        told[share] = [
            kind
            for kind, words in accuracies._reasons(setup, [Run({}, 0.01), Run({}, share)])
            if "bound" in words
        ]
    assert told == {0.0499: [], 0.05: ["saturated"], 0.5: ["saturated"]}
    changes = [
        (1.0, 1.04),
        (1.0, 1.06),
        (1.0, 0.94),
        (1e-9, 2e-9),
        (math.inf, 1.0),
        (1.0, math.inf),
    ]
    found = [accuracies._step_change(error, halved, 2e-9) for error, halved in changes]
    assert [bool(words) for words in found] == [False, True, True, False, False, False]
    assert "+6 %" in found[1]
    assert "-6 %" in found[2]


def test_an_order_is_of_periods_at_which_no_run_failed_and_a_failure_is_its_reason():
    scenario = dataclasses.replace(RUN, law=smc.law("super_twisting", k1=0.01, k2=9.0))
    setup = Setup([scenario] * 5, (2e-3, 1e-3), 2)
    parts = {"e": (1.0, 0.9, 0.8), "s": (0.3, 0.2, 0.1)}
    halved = Run({"e": (0.4, 0.4, 0.4), "s": (0.1, 0.1, 0.1)})
    runs = [Run(parts), Run({name: np.divide(values, 4.0) for name, values in parts.items()})] * 2
    row = accuracies._row(setup, [*runs, halved])
    assert row.e.errors == ((0.8, 0.2), (0.8, 0.2))  # at the end of each run
    assert row.s.errors == ((pytest.approx(0.1), pytest.approx(0.025)),) * 2
    assert (row.e.used, row.s.used) == ((2e-3, 1e-3),) * 2
    assert (row.e.order, row.s.order) == (pytest.approx(2.0), pytest.approx(2.0))
    assert (row.runs, row.failed, row.unit, row.gains) == (4, 0, "m", "yours")
    lost = Run(dict.fromkeys(parts, (math.inf,) * 3), failure="it blew up")
    row = accuracies._row(setup, [*runs[:3], lost, halved])
    assert (row.e.used, row.failed) == ((2e-3,), 1)
    assert math.isnan(row.e.order)
    assert "1 of 4 runs failed, the first: it blew up" in row.e.why
    assert "+100 %" in row.e.why
    assert "+300 %" in row.s.why


@pytest.mark.parametrize(("condition", "steps"), [("constant", 1), ("coulomb", 1), ("lugre", 16)])
def test_a_mechanism_with_parts_takes_sixteen_steps_a_period_and_half_of_them_once(
    condition, steps
):
    given = (
        smc.plant("duffing"),
        find_condition(condition),
        "classical",
        (4e-3, 1e-3),
        [0, 3],
        "tuned",
        2.0,
        None,
    )
    setup = accuracies._setup(*given)
    assert (setup.periods, setup.starts) == ((4e-3, 1e-3), 2)
    *whole, half = setup.scenarios
    assert [(one.seed, one.control_period) for one in whole] == [
        (0, 4e-3),
        (0, 1e-3),
        (3, 4e-3),
        (3, 1e-3),
    ]
    expected = []
    for one in whole:
        expected.append(min(one.control_period, 1e-3) if steps == 1 else one.control_period / 16)
    assert [one.physics_step for one in whole] == pytest.approx(expected)
    assert (half.control_period, half.physics_step) == pytest.approx((1e-3, 1e-3 / steps / 2))
    assert [one.x0 is None for one in whole] == [
        True,
        True,
        False,
        False,
    ]  # the first start is the plant's own
    assert whole[2].x0 == whole[3].x0


def test_a_choice_has_an_interval_below_a_median_that_has_one_and_the_median_below_a_worst_case():
    cases = (attacked("classical", 0.2, 0.05), attacked("classical", 0.3, 0.02))
    first = Choice(
        law=smc.law("classical"),
        remark="",
        rank=Rank("classical", 1.0, 1.0, True),
        settles=1.0,
        reliable=True,
        fit=True,
        worst=cases,
        medians={"fast": Interval(0.5, 0.4, 0.6, 8), "calm": Interval(1.0, 1.0, 1.0, 8)},
    )
    assert [first.below(need) for need in ("fast", "calm")] == ["0.400–0.600", ""]
    assert "0.0200" in first.below("robust")  # of the case with the largest worst found
    assert "a remark" in dataclasses.replace(first, remark="a remark").gains
    for plant in ("duffing", "pendulum_network", "panda"):
        assert [metric.name for metric in ties(smc.plant(plant))] == ["overshoot", "energy"]


def test_names_of_files(tmp_path):
    row = {
        "plant": "my plant",
        "condition": "delay = 0.01, c",
        "law": "λ/..",
        "seed": 3,
        "hash": "0123456789abcdef",
    }
    assert study.trace_file(tmp_path, row).name == "my_plant-delay-0.01_c-λ_..-3-01234567.npz"
    names = ["", "...", "A  =  B", "x" * 60, "x" * 61, "é" * 31, "a/b\\c", "_a_", "k=-1.5+2"]
    made = [slug(name) for name in names]
    assert made[:3] == ["run", "run", "a-b"]
    assert made[3] == "x" * 60
    assert [(len(one.encode()), one[-9]) for one in made[4:6]] == [(60, "-"), (59, "-")]
    assert made[6:] == ["a_b_c", "a", "k--1.5+2"]


def test_a_result_is_read_only_where_its_seal_fits(tmp_path):
    def save(made: str, path: Path) -> None:
        assert path.parent.name.startswith(".a-")  # a hidden folder, which a kill may leave
        path.write_text(made)

    def kept(depends: object, value: str) -> str:
        return cache.cached(tmp_path / "a.txt", depends, lambda: value, save, Path.read_text)

    assert (kept(1, "one"), kept(1, "two")) == ("one", "one")
    (file,) = tmp_path.iterdir()
    file.write_text("other")
    assert kept(1, "three") == "three"
    assert kept(2, "four") == "four"
    assert [one.read_text() for one in tmp_path.iterdir()] == [
        "four"
    ]  # those with other hashes are removed


@pytest.mark.parametrize("task", ["sway", "payload", "wall", "behind", "blow"])
def test_a_task_of_the_arm_has_its_part_its_seed_and_all_that_disturbs_it(task):
    one = arms.scenario(task, smc.law("none"), seed=2, payload=0.5)
    assert one.seed == 2
    assert one.noise is not None
    assert dict(one.mismatch) == {"payload": 0.5}  # the law knows nothing of it
    assert (one.jump is not None) is (task == "payload")
    assert bool(one.disturbance) is (task == "blow")
    assert (one.contact is not None and one.contact.kind == "wall") is (task in ("wall", "behind"))


@pytest.mark.parametrize("name", arms.GAINS)
def test_gains_of_laws_of_the_arm_are_those_that_a_search_found_within_its_torques(name):
    law = arms.gained(name)
    assert law.source.search is not None
    assert law.source.kind == "shipped"
    assert law.gains != smc.law(arms.OUTER.get(name, name)).gains
    assert all(
        np.isfinite(np.ravel(value)).all() for key, value in law.gains.items() if key != "w_max"
    )


def test_the_figures_of_worst_cases_are_of_their_runs_with_their_names(monkeypatch):
    monkeypatch.setattr(worst_case, "run", lambda scenarios: [made(one) for one in scenarios])
    one = attacked("classical", 0.2, 0.05)
    other = attacked("adaptive", 0.3, 0.06)
    for page, labels in (
        (one.figure(), ["as given", "worst found, rms error 0.200 m"]),
        (WorstCases([one]).figure(), ["as given", "worst found, rms error 0.200 m"]),
        (
            WorstCases([one, other]).figure(),
            ["Classical: rms error 0.200 m", "Adaptive: rms error 0.300 m"],
        ),
    ):
        assert [text.get_text() for text in page.legends[0].get_texts()][:2] == labels
        assert page.legends[0].get_title().get_text() == one.heading
        names = ["error e (m)", "control u (N)", "disturbance d (N)", "velocity v (m/s)"]
        assert sorted(ax.get_ylabel() for ax in page.axes) == sorted(names)
    assert one.plot(title="mine", panels=["x"]).legends[0].get_title().get_text() == "mine"


SETUP = (
    smc.plant("duffing"),
    find_condition("constant"),
    "classical",
    (4e-3, 1e-3),
    [0],
    "tuned",
    2.0,
    None,
)


def test_an_accuracy_has_three_starts_at_five_periods_and_one_run_at_half_the_step_by_default(
    monkeypatch,
):
    asked = []
    monkeypatch.setattr(
        accuracies,
        "stream",
        lambda scenarios, threads, report: asked.append((scenarios, threads)) or {},
    )
    with pytest.raises(KeyError):  # no run was measured
        smc.audits.accuracy("classical", "duffing")
    (scenarios, threads), *_ = asked
    periods = [4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4]
    runs = [(seed, period, min(period, 1e-3)) for seed in range(3) for period in periods] + [
        (0, 2.5e-4, 1.25e-4)
    ]
    assert [(one.seed, one.control_period, one.physics_step) for one in scenarios] == runs
    assert {(one.duration, one.condition) for one in scenarios} == {(10.0, "constant")}
    assert threads is None
    assert scenarios[0].law.gains == accuracies._setup(*SETUP).scenarios[0].law.gains


def test_what_cannot_be_sent_is_refused_with_the_cure_for_each_side(monkeypatch, refused):
    refused(lambda: executors.packed(threading.Lock()), "plain functions")
    refused(lambda: executors.run_on_worker(b"cnot_there\nf\n.", []), "not_there", "install there")
    monkeypatch.setattr(
        run_key, "description", lambda one: {"versions": {"mujoco": "1", "numba": "2"}}
    )
    monkeypatch.setattr(run_key, "key", lambda *_, **__: "other")
    monkeypatch.setattr(executors.platform, "python_version", lambda: "3")
    refused(
        lambda: executors.run_on_worker(pickle.dumps([RUN]), ["key"]),
        "classical",
        "Python 3, mujoco 1, numba 2",
    )
    monkeypatch.setitem(sys.modules, "cloudpickle", None)
    refused(lambda: executors.packed(threading.Lock()), "pip install cloudpickle")


def test_what_a_script_defines_is_sent_with_its_code(monkeypatch):
    """Pickle names it by `__main__`, which another process has not."""
    names = {"__name__": "__main__"}
    exec("def doubled(x):\n    return 2.0 * x", names)
    monkeypatch.setattr(sys.modules["__main__"], "doubled", names["doubled"], raising=False)
    sent = executors.packed(names["doubled"])
    monkeypatch.delattr(sys.modules["__main__"], "doubled")
    assert pickle.loads(sent)(3.0) == 6.0
    assert executors.packed(math.hypot) == pickle.dumps(math.hypot)


def test_a_part_with_scores_by_other_code_counts_as_not_done(tmp_path, monkeypatch):
    kept = study.Store(tmp_path)
    kept.open(resume=True)
    kept.add([run_key.row(RUN)])
    again = study.Store(tmp_path)
    again.open(resume=True)
    assert list(again.where) == [run_key.key(RUN)]
    monkeypatch.setattr(study.fingerprint, "of", lambda thing: "other")
    other = study.Store(tmp_path)
    other.open(resume=True)
    assert not other.where
