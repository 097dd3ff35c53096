"""The adviser: what it advises follows from its runs, what it says follows from its numbers, and it
can say "no".
"""

import dataclasses
import functools
import io
import math
import re
import types
from pathlib import Path

import mujoco
import numpy as np
import pytest
from rich.console import Console

import smc_mujoco as smc
from smc_mujoco.analysis import ranking
from smc_mujoco.analysis.bootstrap import median_of
from smc_mujoco.analysis.tuning import search
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.cli import main
from smc_mujoco.common.text import number
from smc_mujoco.control import gain_sets
from smc_mujoco.control.component import Template
from smc_mujoco.control.law import catalogue, law_function
from smc_mujoco.control.properties import searched
from smc_mujoco.control.units import FORCE_PER_POSITION, FORCE_PER_SPEED, Gain
from smc_mujoco.studies import adviser, fair_gains
from smc_mujoco.studies.advice import NEEDS

FAST = smc.law("observer_free", lam=6.0, k1=2.0)
SLOW = smc.law("observer_free", lam=6.0, k1=5.0).named("slow")
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


@pytest.mark.slow
def test_the_advised_law_has_the_best_mean_rank_of_those_that_settle(advice):
    ranks = {choice.law.name: choice.rank.mean for choice in advice.choices if choice.fit}
    assert advice.law.name == min(ranks, key=ranks.__getitem__) == advice.choices[0].law.name
    assert advice.law == FAST
    assert list(ranks.values()) == sorted(ranks.values())


def test_doing_nothing_is_calmest_and_is_not_advised_nor_compared(advice):
    idle = advice.choices[-1]
    assert (idle.law.name, idle.fit, idle.settles) == ("idle", False, 1 / 16)
    assert idle.medians["calm"].median == 0.0
    assert [getattr(cell, "text", cell) for cell in advice.tables[0].rows[-1][1:]] == [
        "–",
        "6 %",
        "never",
        "0",
    ]
    assert "settles too seldom" in advice.key
    assert advice.compared == [choice.law.name for choice in advice.choices[:-1]]
    assert "idle" not in text(advice)


def test_the_answer_says_what_why_and_how_sure(advice):
    use, because, second, sure = advice.answer
    assert use == f"Use {FAST} (gains: yours)."
    assert because.startswith(
        "Because it has the best mean rank of 3 laws. It settles in 100 % of its runs. Fast: "
    )
    settling, calm = (number(advice.choices[0].medians[need].median) for need in ("fast", "calm"))
    assert (
        f"Fast: settling time {settling} s; no law is better. Calm: TV rate {calm} N/s; no law"
        in because
    )
    assert second.startswith(f"Second choice: {advice.second} (gains: yours); worse on ")
    assert "calm" in second
    assert sure.startswith("How sure: it dominates slow")
    comparison = advice.comparison
    blocks = [k for k, (need, _) in enumerate(advice.blocks) if need == "fast"]
    a, b = (comparison.laws.index(name) for name in ("observer_free", "slow"))
    least = max(blocks, key=lambda k: comparison.p[k, a, b])
    effect = comparison.effect(least, "observer_free", "slow", winner=False)
    where = f"fast under {advice.blocks[least][1]}, where it does worst, {100 * (1 - effect.value):.0f} % less"
    assert f"observer_free against slow: {where} (" in sure
    assert f"ahead in {effect.ahead} of 16 runs" in sure


def test_robust_goes_by_the_worst_found_and_tells_the_median_too(folder, monkeypatch):
    monkeypatch.setattr(adviser, "MIN_BUDGET", 9)
    monkeypatch.setattr(adviser, "default_budget", lambda scenario, within: 9)
    options = {
        "laws": ["classical", FAST, SLOW],
        "within": smc.Uncertainty(disturbance=2.0),
        "out": folder,
    }
    made = smc.which(
        "duffing", needs="robust", conditions="nominal", duration=2.5, seeds=6, **options
    )
    alone = {
        one.law.name: smc.worst_case(
            smc.Scenario(plant="duffing", law=one.law, duration=2.5),
            within=options["within"],
            budget=9,
        )
        for one in made.choices
    }
    assert [one.law.name for one in made.choices] == sorted(alone, key=lambda law: alone[law].value)
    assert [one.worst_found.value for one in made.choices] == [
        alone[one.law.name].value for one in made.choices
    ]
    milder = dataclasses.replace(made.choices[0].worst[0], value=0.0)
    for worst in (
        (milder, *made.choices[0].worst),
        (*made.choices[0].worst, milder),
    ):  # of two conditions
        assert (
            dataclasses.replace(made.choices[0], worst=worst).worst_found
            is made.choices[0].worst[0]
        )
    first, second, third = (one.law.name for one in made.choices)
    assert made.wins(first, second) == made.wins(second, third) == [("robust", "nominal")]
    assert made.wins(third, second) == made.wins(second, first) == []
    said = text(made)
    assert f"Robust: worst found rms error {alone[first].words}; no law is better." in said
    assert (
        "worst found in 18 runs of each law in each condition, half of them random, within |d| <= 2 N"
        in said
    )
    slow = alone["slow"]
    assert slow.median < alone[first].median
    median = f"would put slow first, with {number(slow.median)} m: its worst found is {slow.words}."
    assert f"The median of the random runs {median}" in said
    assert made.tables[0].rows[0][3][:3] == (
        number(alone[first].value),
        f"median {number(alone[first].median)}",
        True,
    )
    both = smc.which(
        "duffing", needs="fast,robust", conditions="nominal", duration=2.5, seeds=6, **options
    )
    tested = ranking.Comparison(
        {law: both.comparison.cells[i, :1] for i, law in enumerate(both.comparison.laws)}
    )
    assert both.comparison.limits == tested.limits  # what has no test is in no family of tests
    assert text(made).endswith(
        "There is no test, as the worst found is one value of a law and no sample."
    )
    assert (
        "Except for robust, these comparisons hold over sets of gains, for these gains of"
        in text(both)
    )
    alike = options | {"starts": smc.starts(spread=0.0), "laws": [FAST, SLOW]}
    one = smc.which(
        "duffing", needs="fast,robust", conditions="nominal", duration=2.5, seeds=6, **alike
    )
    assert one.comparison.cells.shape == (2, 2, 1)  # every seed is the same run
    assert one.wins("observer_free", "slow") == [("robust", "nominal")]


def with_cells(advice, restraint=None, **cells):
    """Advice on the same runs with other scores: law -> medians of fast and calm, each under
    nominal and noise.
    """
    spread = np.linspace(0.99, 1.01, 24)
    scores = {}
    for law, own in cells.items():
        if np.ndim(own) == 1:
            scores[law] = np.outer(own, spread)
        else:
            scores[law] = np.array(own)
    comparison = ranking.Comparison(scores)
    names = {choice.law.name: choice for choice in advice.choices}
    choices = []
    for rank in adviser._order(comparison, restraint or dict.fromkeys(cells, ())):
        medians = {}
        for k, need in enumerate(("fast", "calm")):
            medians[need] = median_of(scores[rank.law][2 * k : 2 * k + 2])
        choices.append(dataclasses.replace(names[rank.law], rank=rank, medians=medians))
    return dataclasses.replace(advice, comparison=comparison, choices=tuple(choices))


def test_a_law_that_another_dominates_is_not_advised_for_its_mean_rank(advice):
    """Slow has the lower median in three blocks, but is ahead in half of the seeds only; in the
    fourth it is worse.
    """
    mixed = np.tile([0.5, 1.6], 12)
    even = np.ones(24)
    cells = {"observer_free": [mixed, mixed, mixed, 5 * even], "slow": [even, even, even, 9 * even]}
    found = with_cells(advice, **cells)
    first, second = found.choices
    assert second.rank.mean < first.rank.mean
    assert (
        "the best mean rank of those that none dominates, being better somewhere" in found.answer[1]
    )
    assert (first.law.name, found.dominates("observer_free")) == ("observer_free", ["slow"])
    assert found.dominates("slow") == []
    cells["slow"] = [0.4 * even, even, even, 9 * even]  # now it is better in one block
    traded = with_cells(advice, **cells)
    assert (traded.law.name, traded.dominates("observer_free")) == ("slow", [])


def test_laws_that_tie_stand_in_the_order_of_overshoot_and_energy_and_the_answer_says_so(advice):
    cells = {"observer_free": [1.0, 1, 9, 9], "slow": [1.01, 1, 9, 9], "classical": [2, 2, 9, 9]}
    less = {"slow": (1.0, 1.0)}
    more = {"slow": (1.5, 1.0)}
    others = {"observer_free": (1.0, 2.0), "classical": (1.0, 3.0)}
    for restraint, first in ((less, "slow"), (more, "observer_free")):
        found = with_cells(advice, restraint | others, **cells)
        (other,) = {"slow", "observer_free"} - {first}
        assert [choice.law.name for choice in found.choices] == [first, other, "classical"]
        assert found.tied == found.level == [other]
        assert (
            f"it ties with {other}; laws that tie stand in the order of overshoot, then of energy, less first"
            in text(found)
        )


def test_a_law_that_ties_with_one_of_better_mean_rank_is_advised_for_the_rule(advice):
    """Slow is ahead of classical by more than 3 %, observer_free is not, and ties with both in
    three blocks.
    """
    even = np.ones(24)
    cells = {
        "observer_free": [1.02 * even] * 4,
        "slow": [even] * 4,
        "classical": [*[1.04 * even] * 3, 3 * even],
    }
    restraint = {"observer_free": (1.0,), "slow": (2.0,), "classical": (1.0,)}
    found = with_cells(advice, restraint, **cells)
    first, second = found.choices[:2]
    assert (first.law.name, second.law.name) == ("observer_free", "slow")
    assert second.rank.mean < first.rank.mean
    assert found.answer[1].startswith(
        "Because it ties with slow, of better mean rank, and laws that tie stand in the "
    )


def test_an_answer_over_sets_of_gains_counts_them(advice):
    """Ahead with 9 of 24 sets of gains is not a lead, whatever the other 15 are."""
    scores = {"observer_free": np.tile([[0.8], [0.8], [1.0], [1.0]], 24), "slow": np.ones((4, 24))}
    scores["observer_free"][2:, 9:] = 1.1
    scores["observer_free"][2:, :9] = 0.7
    sets = {law: np.tile(np.arange(24) + 24 * i, (4, 1)) for i, law in enumerate(scores)}
    comparison = ranking.Comparison(scores, sets=sets)
    assert comparison.winners == ["observer_free", "observer_free", None, None]
    choices = []
    for rank in adviser._order(comparison, dict.fromkeys(scores, ())):
        for choice in advice.choices:
            if choice.law.name == rank.law:
                choices.append(dataclasses.replace(choice, rank=rank))
    found = dataclasses.replace(advice, comparison=comparison, choices=tuple(choices))
    assert found.samples == "24 sets of gains"
    assert "ahead in 9 of 24 sets of gains" in text(found)
    assert "These comparisons hold over sets of gains, over starts and noise." in text(found)
    assert "not tested" not in text(found)  # the first dominates all that there are


def test_restraint_ranks_laws_by_overshoot_and_by_energy_of_u(advice):
    (group,) = adviser.paired_runs.groups(advice.table, by=("plant",))
    ran = adviser.paired_runs.scenarios(advice.table, group)
    found = adviser._restraint(advice.table, group, ran, advice.plant, ranking.RELEVANT)
    assert set(found) == set(group.laws)
    energies = {law: np.median(advice.table.select(law=law).column("energy")) for law in group.laws}
    overshoots = {}
    for law in group.laws:
        overshoots[law] = np.median(advice.table.select(law=law).column("overshoot"))
    assert found["idle"][1] == 1.0 == min(rank for _, rank in found.values())
    assert energies["idle"] == 0.0
    most = max(overshoots, key=overshoots.__getitem__)
    assert found[most][0] == max(rank for rank, _ in found.values())


def test_laws_that_tie_are_ordered_by_the_given_least_relevant_difference(folder, monkeypatch):
    def ranked(*given, relevant, true=adviser.ranked):
        asked.add(relevant)
        return true(*given, relevant=relevant)

    asked = set()
    monkeypatch.setattr(adviser, "ranked", ranked)
    smc.which("duffing", needs="fast", laws=["classical", FAST], out=folder, relevant=0.2, **COMMON)
    assert asked == {0.2}


def test_the_reason_names_laws_with_the_same_mean_rank(advice):
    first, *others = advice.choices
    equal = []
    for choice in others:
        equal.append(dataclasses.replace(choice, rank=choice.rank._replace(mean=first.rank.mean)))
    names = [choice.law.name for choice in equal]
    for same, ending in (
        (1, f", as has {names[0]}."),
        (2, f", as have {names[0]} and {names[1]}."),
    ):
        found = dataclasses.replace(advice, choices=(first, *equal[:same], *others[same:]))
        assert f"the best mean rank of 3 laws{ending}" in found.answer[1]


def test_a_table_has_a_row_for_each_law_with_intervals(advice):
    (table,) = advice.tables
    assert table.headings == [
        "law",
        "place",
        "settles",
        "fast: settling time (s)",
        "calm: TV rate (N/s)",
    ]
    interval = advice.choices[0].medians["fast"]
    assert interval.low <= interval.median <= interval.high
    assert f"{interval.median:.3g}" in table.rows[0][3].text
    assert f"{interval.low:.3g}–{interval.high:.3g}" in table.rows[0][3].below
    assert ">observer_free</td>" in advice._repr_html_()
    assert "<br>Use observer_free(" in advice._repr_html_()
    assert repr(advice) == f"Advice(duffing: {FAST})"


def test_if_nothing_settles_nothing_is_advised(folder):
    found = smc.which("duffing", needs="calm", laws=[FAST, SLOW], out=folder, duration=0.1, seeds=4)
    assert found.answer[0].startswith(
        "No law can be advised, because none settles in any run: give longer runs than 0.1 s"
    )
    assert "observer_free" not in found.answer[0]  # no law is named
    alone = smc.which("duffing", needs="calm", laws=[FAST], out=folder, duration=0.1, seeds=4)
    assert alone.answer[0].endswith("or easier conditions.")


def test_one_law_is_the_only_one(folder):
    found = smc.which("duffing", laws=FAST, out=folder, **COMMON)
    assert (found.second, found.needs) == (None, adviser.DEFAULT_NEEDS)
    assert found.answer == [
        f"Use {FAST} (gains: yours).",
        "Because it is the only law here that suits. It settles in 100 % of its runs.",
        "Not sure: there was no second law.",
    ]


# the runs


def test_every_law_runs_from_the_same_seeds_and_none_is_left_out(folder):
    laws = [smc.law("observer_free", lam=lam, k1=2.0).named(f"l{lam}") for lam in range(1, 15)]
    few = smc.which("duffing", "noise", ["fast", "calm"], laws, 2, 0.5, out=folder)
    assert sorted(choice.law.name for choice in few.choices) == sorted(law.name for law in laws)
    assert few.table.select(law=few.choices[-1].law.name).column("seed").tolist() == [0, 1]
    (table,) = few.tables
    assert [row[0].text for row in table.rows] == [choice.law.name for choice in few.choices[:12]]
    assert (
        f"2 more laws: {few.choices[12].law.name} and {few.choices[13].law.name}. "
        in table.notes[0]
    )
    unfit = dataclasses.replace(few.choices[-1], fit=False)
    assert "–:" in dataclasses.replace(few, choices=(unfit, *few.choices[1:])).key
    assert (
        "–:" not in dataclasses.replace(few, choices=(*few.choices[:-1], unfit)).key
    )  # it has no row


# gains


def trial(folder, starts=None):
    return fair_gains.Trial([], [], 1.0, starts, folder, None, False)


def test_laws_are_tuned_as_the_packages_own_gains_were_where_these_are_compared(monkeypatch):
    asked = []
    monkeypatch.setattr(
        fair_gains.Trial,
        "tuned",
        lambda self, plant, law, starts, *effort: asked.append((starts, *effort)),
    )
    other = smc.starts(x0=0.5)
    mine = law_function(gains={"k": 2.0})(lambda y, gains, memory: (-gains.k * y.e, y.e))
    laws = [catalogue()["classical"], mine]
    for plant in (smc.plant("duffing"), smc.plant("duffing", M=2.0)):
        trial(Path("gains"), other).gains_on(plant, laws, 3, 16)
    assert asked == [(None, 3, 16), (other, 3, 16), (other, 3, 16)]


def test_gains_of_the_package_are_taken_where_there_are_some(folder):
    found = smc.which("duffing", laws=["classical"], out=folder, **COMMON)
    assert found.law == gain_sets.law("duffing", "classical")
    assert found.law.source.kind == "shipped"


def test_a_law_of_a_user_is_tuned_for_a_plant_once_and_its_gains_are_kept(folder, monkeypatch):
    gains = {
        "kp": Gain(0.01, FORCE_PER_POSITION),
        "kd": Gain(0.01, FORCE_PER_SPEED),
    }  # next to nothing

    @law_function(gains=gains, continuous=True)
    def my_pd(y, gains, memory):
        return -gains.kp * y.e - gains.kd * y.de, y.e

    heavy = smc.plant("duffing", M=2.0)
    tuned = []
    tune = search.tune
    monkeypatch.setattr(
        search, "tune", lambda *args, **named: tuned.append(tune(*args, **named)) or tuned[-1]
    )
    monkeypatch.setattr(adviser, "FULL", adviser.FULL._replace(searches=2, budget=8))
    monkeypatch.setattr(fair_gains, "Objective", functools.partial(Objective, duration=1.0))
    options = {"laws": [my_pd], "needs": "fast,continuous", "out": folder} | COMMON
    options |= {"seeds": 2, "duration": 1.0, "conditions": "nominal"}
    found = smc.which(heavy, **options)
    assert re.match(
        r"gains: tuned here \(CMA-ES and COBYQA, [23]\d evaluations, 2 searches",
        found.choices[0].gains,
    )
    assert found.law.function is my_pd.function
    assert found.law.gains == tuned[0].law.gains != my_pd.defaults
    assert (tuned[0].budget, len(tuned[0].searches), tuned[0].plant) == (8, 2, heavy)
    assert smc.which(heavy, **options).law == found.law
    assert len(tuned) == 1


def test_a_law_whose_gains_nobody_gave_is_tuned_and_another_keeps_them(tmp_path):
    code = "import smc_mujoco as smc\n@smc.law_function(gains={'k': 2.0})\ndef mine(y, gains, memory):\n"
    (tmp_path / "mine.py").write_text(f"{code}    return -gains.k * y.e, y.e\n")
    file = str(tmp_path / "mine.py")
    chosen = adviser._suited(
        smc.plant("duffing"), (), [file, smc.law(file), f"{file}(k=2)", "pid", FAST]
    )
    assert [one.name for one in chosen] == ["mine", "mine", "mine", "pid", FAST.name]
    assert [isinstance(one, Template) for one in chosen] == [True, True, False, True, False]


def test_kept_gains_are_searched_again_where_the_search_or_the_plants_code_differs(
    folder, monkeypatch
):
    @law_function(gains={"kp": Gain(1.0, FORCE_PER_POSITION), "kd": Gain(1.0, FORCE_PER_SPEED)})
    def my_spring(y, gains, memory):
        return -gains.kp * y.e - gains.kd * y.de, y.e

    def build(n):
        return mujoco.MjSpec.from_string("<mujoco/>")

    asked = []
    tuned = types.SimpleNamespace(before=1.0, objective=2.0, law=FAST)
    monkeypatch.setattr(
        fair_gains, "cached", lambda path, depends, *rest: asked.append(depends) or tuned
    )
    held = dataclasses.replace(
        my_spring, gains={**my_spring.gains, "kd": Gain(1.0, FORCE_PER_SPEED, held=True)}
    )
    duffing = smc.plant("duffing")
    for plant, law in (
        (duffing, my_spring),
        (duffing, my_spring),
        (duffing, held),
        (dataclasses.replace(duffing, build=build), my_spring),
    ):
        trial(folder).tuned(plant, law, None, 3, 16)
    assert asked[0] == asked[1]
    assert len({str(depends) for depends in asked}) == 3


def test_a_laws_own_gains_are_taken_where_no_tried_set_is_better(folder, monkeypatch):
    tuned = types.SimpleNamespace(before=1.0, objective=2.0, law=FAST)
    monkeypatch.setattr(fair_gains, "cached", lambda *rest: tuned)
    own = trial(folder).tuned(smc.plant("duffing"), smc.law("observer_free"), None, 3, 16)
    assert (own.law, own.remark) == (
        smc.law("observer_free"),
        "its defaults, better than those tried",
    )
    assert own.law.source.kind == FAST.source.kind
    tuned.before = 3.0
    tuned.bounds = FAST.gains
    tuned.sets = [
        types.SimpleNamespace(gains=tuple(FAST.gains.values())),
        types.SimpleNamespace(gains=(5.0, 2.5)),
    ]
    found = trial(folder).tuned(smc.plant("duffing"), smc.law("observer_free"), None, 3, 16)
    assert (found.law, found.remark) == (FAST, "")
    assert [found(seed).gains["k1"] for seed in range(3)] == [2.0, 2.5, 2.0]


def test_a_plant_that_cannot_be_tuned_has_default_gains_and_says_so(folder):
    found = smc.which("overhead_crane", "nominal", "fast", seeds=2, duration=1.0, out=folder)
    assert found.law == smc.law("hierarchical")
    assert found.choices[0].gains.startswith(
        "gains: default; tuning is not possible here: its channels have two units"
    )


# what is asked


def test_needs_are_metrics_to_compare_and_properties_to_have():
    machine = smc.plant("duffing")
    assert adviser._needs("calm, continuous,fast", machine) == (("calm", "fast"), ("continuous",))
    assert adviser._needs(["two-gains"], machine) == (adviser.DEFAULT_NEEDS, ("two-gains",))
    names = {law.name for law in adviser._suited(machine, ["continuous", "two-gains"], None)}
    assert "observer_free" in names
    assert not names & {"none", "classical", "observer_free_q15", "hierarchical"}
    assert all(
        law.continuous and len(searched(law)) in (1, 2)
        for law in map(catalogue().__getitem__, names)
    )
    assert (NEEDS["fast"].name, NEEDS["calm"].name) == ("settling_time", "tv_rate")


def test_without_a_velocity_sensor_velocity_is_differentiated(folder):
    found = smc.which(
        "duffing", "noise", "fast,no-velocity", [FAST], seeds=1, duration=0.5, out=folder
    )
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
        (
            {"needs": "continuous", "laws": ["twisting"]},
            "no law for duffing is among those that have a continuous u",
        ),
        ({"plant": "dufing"}, "did you mean 'duffing'"),
        ({"plant": "acrobot"}, "the package has no law for acrobot: give your own"),
        ({"laws": ["clasical"]}, "did you mean 'classical'"),
        ({"laws": [FAST, smc.law("observer_free")]}, "two laws have one name"),
        ({"conditions": "jump_mil"}, "did you mean 'jump_mild'"),
        ({"conditions": "a: friction=Coulomb(-1)"}, "Coulomb"),
    ],
)
def test_what_cannot_be_is_one_sentence_before_anything_is_searched(
    arguments, sentence, tmp_path, monkeypatch
):
    monkeypatch.setattr(search, "tune", None)
    with pytest.raises(smc.ScenarioError, match=sentence.replace("(", r"\(")):
        smc.which(**{"plant": "duffing", "out": tmp_path} | arguments)


# the command


def test_the_command_prints_the_table_and_the_answer(folder, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    laws = "fast: observer_free(lam=6,k1=2),slow: observer_free(lam=6,k1=5)"
    options = (
        "--needs",
        "fast",
        "--condition",
        "nominal",
        "--seeds",
        "16",
        "--duration",
        "2.5",
        "--out",
        str(folder),
    )
    with pytest.raises(SystemExit) as end:
        main.main(["which", "duffing", "--law", laws, *options])
    printed = " ".join(capsys.readouterr().out.split())
    assert not end.value.code
    assert (
        "Use fast(lam=6, k1=2) (gains: yours). Because it has the best mean rank of 2 laws. It settles"
        in printed
    )
    assert "Second choice: slow(lam=6, k1=5) (gains: yours); worse on fast." in printed
    assert (
        "How sure: it dominates slow: better somewhere, worse nowhere; fast against slow: fast"
        in printed
    )
    assert math.isfinite(float(printed.partition("results.parquet; ")[2].split()[0]))


@pytest.mark.slow
def test_its_table_fits_into_80_columns_with_three_needs(advice, folder):
    capture = io.StringIO()
    laws = [choice.law for choice in advice.choices]
    many = smc.which("duffing", needs="fast,accurate,calm", laws=laws, out=folder, **COMMON)
    Console(file=capture, width=80).print(many)
    lines = capture.getvalue().splitlines()
    assert max(map(len, lines)) <= 80
    assert any(line.split()[:3] == ["observer_free", "1", "100"] for line in lines)
    assert not any("…" in line for line in lines)
    interval = advice.choices[0].medians["fast"]
    assert f"{number(interval.low)}–{number(interval.high)}" in capture.getvalue()


def test_every_answer_begins_with_a_law_or_with_why_there_is_none_and_its_table_has_a_place_for_each(
    advice,
):
    """With made-up scores of the same runs."""
    traded = with_cells(
        advice, observer_free=[1, 1, 9.9, 9.9], slow=[2, 2, 3, 8], classical=[4, 4, 9, 9]
    )
    even = np.ones(24)
    tied = with_cells(
        advice,
        {"slow": (1.0, 1.0), "observer_free": (1.0, 2.0)},
        observer_free=[1.0, 1, 9, 9],
        slow=[1.01, 1, 9, 9],
    )
    three = with_cells(
        advice, observer_free=[even] * 4, slow=[1.02 * even] * 4, classical=[even] * 4
    )
    first, *rest = traded.choices
    unfit = {"fit": False, "reliable": False}
    once = np.where(
        np.arange(24) * [[1], [0], [1], [0]], math.nan, 1.0
    )  # one distinct run without noise
    made = {
        "one for each need": traded,
        "properties": dataclasses.replace(traded, effort="N", wanted=("settle", "rest")),
        "better in one condition": with_cells(
            advice, observer_free=[1, 1, 9, 9], slow=[2, 2, 9, 3], classical=[3, 3, 10, 10]
        ),
        "two, of which one is better": with_cells(
            advice, observer_free=[1, 1, 2, 2], slow=[2, 2, 3, 8]
        ),
        "undecided": with_cells(
            advice,
            observer_free=once * [[1], [1], [9.9], [9.9]],
            slow=once * [[2], [2], [3], [9.9]],
        ),
        "tied": tied,
        "two level": with_cells(advice, observer_free=[even] * 4, slow=[even] * 4),
        "three level": dataclasses.replace(
            three,
            choices=tuple(
                dataclasses.replace(one, reliable=True, settles=0.96) for one in three.choices
            ),
        ),
        "few": with_cells(advice, observer_free=[even[:3]] * 4, slow=[1.02 * even[:3]] * 4),
        "not fit": dataclasses.replace(
            traded, choices=(dataclasses.replace(first, fit=False, reliable=False), *rest)
        ),
        "nothing settles": dataclasses.replace(
            traded, choices=(dataclasses.replace(first, settles=0.0, **unfit), *rest)
        ),
        "not reliable": dataclasses.replace(
            traded, choices=(dataclasses.replace(first, reliable=False), *rest)
        ),
        "second not fit": dataclasses.replace(
            traded,
            choices=(
                first,
                *(dataclasses.replace(one, fit=False, remark="a remark") for one in rest),
            ),
        ),
        "one default": dataclasses.replace(traded, untuned=("slow", "classical")),
        "two defaults": dataclasses.replace(traded, untuned=("observer_free", "classical")),
    }
    begins = {
        "Use ": (
            "one for each need",
            "properties",
            "better in one condition",
            "two, of which one is better",
            "undecided",
            "second not fit",
        ),
        "No law can be called the best": ("tied", "two level", "three level", "few"),
        "No law can be advised": ("not fit", "nothing settles"),
        "No law is reliable": ("not reliable",),
        "No law is advised over": ("one default", "two defaults"),
    }
    starts = {name: start for start, names in begins.items() for name in names}
    assert set(starts) == set(made)
    for name, one in made.items():
        (table,) = one.tables
        text = " ".join(table.notes)
        laws = [choice.law.name for choice in one.choices]
        assert starts[name] in text, name
        others = []
        for start in begins:
            if start != starts[name] and start in text.replace("Use the one", ""):
                others.append(start)
        assert not others, name
        assert ("Second choice" in text) == (starts[name] == "Use "), name
        assert not re.search(r"nan|None|inf\b|\.\.|, ,", text), name
        assert [str(getattr(row[0], "text", row[0])) for row in table.rows][: len(laws)] == laws
        assert table.headings[:3] == ["law", "place", "settles"]
        assert ["time (s)" in str(table.headings[3]), "rate (N/s)" in str(table.headings[4])] == [
            True,
            True,
        ]
        assert (f"Use {laws[0]}(" in text) == (starts[name] == "Use "), name
    said = {name: " ".join(one.tables[0].notes) for name, one in made.items()}
    assert (made["one for each need"].law.name, made["few"].tied) == ("slow", [])
    words = {
        "one for each need": (
            "Calm: TV rate 5.50 N/s; no law is better.",
            "Fast: settling time 2.00 s; better is observer_free.",
            "it loses some comparisons to observer_free, so the choice depends on what counts",
            "dominates classical",
            "with other starts and noise, or among other laws, a law that it does not dominate may be first.",
        ),
        "better in one condition": (
            "Calm: TV rate 9.00 N/s; better is slow under noise.",
            f"Second choice: {SLOW} (gains: yours); better on calm under noise; worse on fast.",
        ),
        "undecided": ("; no law is better, as far as so few samples tell.",),
        "tied": ("ties with",),
        "two level": (
            ": both laws are level in every comparison of 24 runs.",
            "no difference, ahead in 0 of 24 runs",
        ),
        "few": (
            "with 3 runs, too few for 4 comparisons: give more seeds",
            "How sure: not at all, with 3 runs.",
        ),
        "not reliable": ("slow settles in",),
        "second not fit": ("a remark",),
        "two defaults": ("observer_free", "classical"),
    }
    for name, sentences in words.items():
        assert all(sentence in said[name] for sentence in sentences), (name, said[name])
    assert not any(doubt in said["tied"] for doubt in ("How sure: not at all", "too few"))
    assert "slow" not in said["one default"].partition("No law")[2]
    assert "by laws that settle and rest" in str(made["properties"].tables[0].title)
