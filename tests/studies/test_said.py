"""What worst cases, accuracies, needs and kept files say and are named, of made-up numbers, recorded."""

import dataclasses
import math
import pickle
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from helpers.sketch import made
from helpers.words import words

import smc_mujoco as smc
from smc_mujoco.analysis.bootstrap import Interval
from smc_mujoco.analysis.ranking import Rank
from smc_mujoco.common import cache
from smc_mujoco.common.tabular import plain
from smc_mujoco.control import gain_sets
from smc_mujoco.evidence.accuracy import accuracy as accuracies
from smc_mujoco.evidence.accuracy.accuracy import AccuracyTable, Run, Setup
from smc_mujoco.evidence.accuracy.scaling import Accuracy, Scaling
from smc_mujoco.simulation.conditions import find_condition
from smc_mujoco.studies import (
    arms,
    executors,
    pickling,
    run_key,
    store,
    study,
    worst_case,
)
from smc_mujoco.studies.advice import Choice, ties
from smc_mujoco.studies.scene import slug
from smc_mujoco.studies.worst_case import WorstCase, WorstCases, default_budget

RUN = smc.Scenario(plant="duffing", law="classical", duration=8.0)
WITHIN = smc.Uncertainty(disturbance=0.5, mass=(0.8, 1.2))


def attacked(law: str, value: float, median: float, **fields: object) -> WorstCase:
    """The worst case of a law, of made-up values."""
    scenario = dataclasses.replace(RUN, law=smc.law(law))
    given = {"unit": "m", "found_by": "bang-bang", "tried": 48, "metric": "rms_error", "outside": "", "seed": 0}
    both = {"scenario": scenario, "nominal": scenario, "within": WITHIN}
    return WorstCase(value=value, median=median, **given | both | fields)


def test_worst_cases_say_as_recorded(snapshot):
    cases = [
        attacked("classical", 0.2, 0.05, outside="the law is for |d| <= 0.1 N", sets=3),
        attacked("pid", math.inf, 0.04, found_by="sine"),
        attacked("adaptive", 0.1, 0.07, unit=""),
    ]
    said = [plain(WorstCases(cases), 100), plain(WorstCases(cases[:2]), 100), plain(cases[0], 100), repr(cases[1])]
    said += [case.heading for case in cases] + [str(cases[0].about().keys())]
    assert "\n".join(said) == snapshot


@pytest.mark.parametrize("field", ["value", "median", "unit", "found_by", "tried", "metric", "outside", "seed", "sets"])
def test_a_worst_case_that_is_kept_is_the_one_that_is_read(field, tmp_path, monkeypatch):
    found = attacked("classical", 0.2, 0.05, outside="no", sets=3, seed=2, found_by="sine", tried=50, unit="rad")
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
    assert default_budget(RUN, dataclasses.replace(WITHIN, friction=(0.0, 0.1))) == 2_500_000 // (8000 * 2 * 2)
    assert default_budget(network, WITHIN) == 2_500_000 // (8000 * 6)
    assert default_budget(dataclasses.replace(RUN, duration=500.0), WITHIN) == 24
    assert default_budget(dataclasses.replace(RUN, duration=0.5), WITHIN) == 1024


def measured(law: str, condition: str = "constant", gains: str = "shipped", why: str = "", failed: int = 0) -> Accuracy:
    periods = (4e-3, 2e-3, 1e-3)
    errors = ((0.8, 0.2, 0.05), (0.4, 0.11, 0.03))
    scaling = Scaling(errors=errors, used=periods, order=1.9, low=1.8, high=2.1, theory=2.0, why=why)
    free = dataclasses.replace(scaling, theory=1.0, order=math.nan, low=math.nan, high=math.nan)
    names = {"plant": "duffing", "condition": condition, "law": law, "gains": gains, "unit": "m", "runs": 6}
    return Accuracy(**names, periods=periods, e=scaling, s=free, failed=failed, floor=1e-9)


def test_accuracies_say_as_recorded(snapshot):
    rows = [measured("classical"), measured("pid", gains="default", why="the gains violate k > d", failed=2)]
    table = AccuracyTable([*rows, measured("adaptive", "coulomb", gains="default")])
    assert plain(table, 100) == snapshot


def test_reasons_why_theory_promises_nothing_as_recorded(snapshot):
    fields = [
        {"actuator": smc.Lag(0.01)}, {"input_delay": 1e-3}, {"clock": smc.Clock(jitter=1e-4)},
        {"noise": smc.Noise(1e-3)}, {"sensor": smc.Encoder(counts=4096)},
        {"velocity": smc.estimator("filtered_difference")},
        {"law": smc.law("nested_third_order")}, {},
    ]  # fmt: skip
    said = []
    for change in fields:
        try:
            said.append(accuracies._why_no_promise(dataclasses.replace(RUN, **change)))
        except smc.ScenarioError as error:
            said.append(f"{change}: {error}")
    scenario = dataclasses.replace(RUN, law=smc.law("super_twisting", k1=0.01, k2=9.0))
    setup = Setup([scenario] * 4, (2e-3, 1e-3), 2)
    for saturated in (0.0499, 0.05, 0.5):
        said += map(str, accuracies._reasons(setup, [Run({}, 0.01), Run({}, saturated)]))
    for error, halved in ((1.0, 1.25), (1.0, 1.26), (1.0, 0.74), (1e-9, 2e-9), (math.inf, 1.0), (1.0, math.inf)):
        said.append(accuracies._step_change(error, halved, 2e-9))
    parts = {"e": (1.0, 0.9, 0.8), "s": (0.3, 0.2, 0.1)}
    halved = {"e": (0.4, 0.4, 0.4), "s": (0.1, 0.1, 0.1)}
    runs = [Run(parts), Run({name: np.divide(values, 4.0) for name, values in parts.items()})] * 2
    lost = Run(dict.fromkeys(parts, (math.inf,) * 3), failure="it blew up")
    for failing in ([], [lost]):
        given = [*runs[: 4 - len(failing)], *failing, Run(halved)]
        row = accuracies._row(setup._replace(scenarios=[scenario] * 5), given)
        said += [f"{one.errors} {one.used} {one.order:.6f} {one.theory} {one.why}" for one in (row.e, row.s)]
        said.append(f"{row.gains} {row.unit} {row.periods} {row.runs} {row.failed} {row.floor:g}")
    assert "\n".join(said) == snapshot


def test_a_mechanism_with_parts_takes_sixteen_steps_a_period_and_half_of_them_once(snapshot):
    said = []
    for condition in ("constant", "coulomb", "lugre"):
        given = smc.plant("duffing"), find_condition(condition), "classical", (4e-3, 1e-3), [0, 3], "tuned", 2.0, None
        setup = accuracies._setup(*given)
        said.append(f"{condition} {setup.periods} {setup.starts}")
        said += [
            f"{one.seed} {one.control_period:g} {one.physics_step:g} {one.x0} {one.duration}" for one in setup.scenarios
        ]
    assert "\n".join(said) == snapshot


def test_needs_and_choices_say_as_recorded(snapshot):
    cases = (attacked("classical", 0.2, 0.05), attacked("classical", 0.3, 0.02))
    first = Choice(
        law=smc.law("classical"), remark="", rank=Rank("classical", 1.0, 1.0, True), settles=1.0, reliable=True,
        fit=True, worst=cases, medians={"fast": Interval(0.5, 0.4, 0.6, 8), "calm": Interval(1.0, 1.0, 1.0, 8)},
    )  # fmt: skip
    other = dataclasses.replace(first, law=smc.law("pid"), remark="a remark")
    said = [first.below(need) for need in ("fast", "calm", "robust")] + [first.gains, other.gains]
    said += [
        str([metric.name for metric in ties(smc.plant(plant))]) for plant in ("duffing", "pendulum_network", "panda")
    ]
    assert "\n".join(said) == snapshot


def test_names_of_files(tmp_path):
    row = {"plant": "my plant", "condition": "delay = 0.01, c", "law": "λ/..", "seed": 3, "hash": "0123456789abcdef"}
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
    assert [one.read_text() for one in tmp_path.iterdir()] == ["four"]  # those with other hashes are removed


def test_tasks_of_the_arm_as_recorded(snapshot):
    """Every field of every task, and every law with the gains that the search found."""
    said = []
    for task in ("sway", "payload", "wall", "behind", "blow"):
        one = arms.scenario(task, smc.law("none"), seed=2, payload=0.5)
        fields = {field.name: getattr(one, field.name) for field in dataclasses.fields(one)}
        del fields["plant"], fields["law"], fields["reference"], fields["friction"]
        points = [np.array(signal.values) for signal in one.references]
        said.append(f"{task} {words(str(fields['x0']))} {[round(float(p.sum()), 3) for p in points]}")
        said.append(str({name: value for name, value in fields.items() if name != "x0"}))
    said += [repr(arms.gained(name)) for name in arms.GAINS] + [repr(arms.hybrid(one)) for one in (False, True)]
    said += [f"{arms.gained(name).source} {arms.gained(name).source.search}" for name in [*arms.GAINS][:1]]
    assert "\n".join(said) == snapshot


def test_the_figures_of_worst_cases_are_of_their_runs_with_their_names(monkeypatch):
    monkeypatch.setattr(worst_case, "run", lambda scenarios: [made(one) for one in scenarios])
    one, other = attacked("classical", 0.2, 0.05), attacked("adaptive", 0.3, 0.06)
    for page, labels in (
        (one.figure(), ["as given", "worst found, rms error 0.200 m"]),
        (WorstCases([one]).figure(), ["as given", "worst found, rms error 0.200 m"]),
        (WorstCases([one, other]).figure(), ["classical: 0.200 m", "adaptive: 0.300 m"]),
    ):
        assert [text.get_text() for text in page.legends[0].get_texts()][:2] == labels
        assert page.legends[0].get_title().get_text() == one.heading
        names = ["error e (m)", "control u (N)", "disturbance d (N)", "velocity v (m/s)"]
        assert sorted(ax.get_ylabel() for ax in page.axes) == sorted(names)
    assert one.plot(title="mine", panels=["x"]).legends[0].get_title().get_text() == "mine"


def test_an_accuracy_has_these_runs_by_default(monkeypatch, snapshot):
    asked = []
    monkeypatch.setattr(
        accuracies, "stream", lambda scenarios, threads, report: asked.append((scenarios, threads)) or {}
    )
    with pytest.raises(KeyError):  # no run was measured
        smc.accuracy("classical", "duffing")
    (scenarios, threads), *_ = asked
    runs = [
        f"{one.seed} {one.control_period:g} {one.physics_step:g} {one.duration} {one.condition}" for one in scenarios
    ]
    gains = scenarios[0].law.gains == gain_sets.law("duffing", "classical").gains
    assert "\n".join([f"{threads} {gains} {scenarios[0].condition}", *runs]) == snapshot


def test_what_cannot_be_sent_is_said_as_recorded(monkeypatch, snapshot):
    said = []

    def told(call, *given):
        with pytest.raises(smc.ScenarioError) as error:
            call(*given)
        said.append(str(error.value))

    told(pickling.packed, threading.Lock())
    told(executors.run_on_worker, b"cnot_there\nf\n.", [])
    monkeypatch.setattr(run_key, "description", lambda one: {"versions": {"mujoco": "1", "numba": "2"}})
    monkeypatch.setattr(run_key, "key", lambda *_, **__: "other")
    monkeypatch.setattr(executors.platform, "python_version", lambda: "3")
    told(executors.run_on_worker, pickle.dumps([RUN]), ["key"])
    monkeypatch.setitem(sys.modules, "cloudpickle", None)
    told(pickling.packed, threading.Lock())
    assert "\n".join(said) == snapshot


def test_what_a_script_defines_is_sent_with_its_code(monkeypatch):
    """Pickle names it by `__main__`, which another process has not."""
    names = {"__name__": "__main__"}
    exec("def doubled(x):\n    return 2.0 * x", names)
    monkeypatch.setattr(sys.modules["__main__"], "doubled", names["doubled"], raising=False)
    sent = pickling.packed(names["doubled"])
    monkeypatch.delattr(sys.modules["__main__"], "doubled")
    assert pickle.loads(sent)(3.0) == 6.0
    assert pickling.packed(math.hypot) == pickle.dumps(math.hypot)


def test_a_part_with_scores_by_other_code_counts_as_not_done(tmp_path, monkeypatch):
    kept = store.Store(tmp_path)
    kept.open(resume=True)
    kept.add([run_key.row(RUN)])
    again = store.Store(tmp_path)
    again.open(resume=True)
    assert list(again.where) == [run_key.key(RUN)]
    monkeypatch.setattr(store.fingerprint, "of", lambda thing: "other")
    other = store.Store(tmp_path)
    other.open(resume=True)
    assert not other.where
