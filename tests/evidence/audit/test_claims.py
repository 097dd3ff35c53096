"""The audit: how checks make verdicts, that it can fail, and what it computes is what happens."""

import dataclasses
import json
import math
from types import SimpleNamespace

import numpy as np
import pytest
from papers.gaber.claims import OURS

import smc_mujoco as smc
from smc_mujoco.analysis.linear_theory import critical_delay
from smc_mujoco.common.files import to_json
from smc_mujoco.evidence.audit import audit, claim_runs
from smc_mujoco.evidence.audit.audit import claims, measure
from smc_mujoco.evidence.audit.claim_runs import ClaimRuns
from smc_mujoco.evidence.audit.paper import ClaimEntry, paper
from smc_mujoco.evidence.audit.variants import VARIANTS, variant, with_gains
from smc_mujoco.evidence.audit.verdict import (
    EXISTENTIAL,
    NAMED,
    NOT_SHOWN,
    NOT_TESTABLE,
    PARTLY,
    REFUTED,
    SUPPORTED,
    UNIVERSAL,
    Beside,
    check,
    combined,
    ratio,
    verdict,
)
from smc_mujoco.evidence.papers.gaber import lyapunov
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.simulation.gaber_study import PLANTS
from smc_mujoco.simulation.grid import grid
from smc_mujoco.simulation.run_key import run_key

GABER = paper("gaber")
CODE = GABER.claims["14"].evidence.__globals__  # of its claims.py
measured = SimpleNamespace(**CODE)
LIST = """1 3 4 5 7 10 11 12 13 14 15 18 19 20 21 24 25 27 28 29 31 32 33 34 35 36 37 38 39 40
          45 46 48 49 50 51 52 55 56 57 59 61 T"""
UNIVERSALS = {"11", "18", "19", "20", "24", "50", "59"}

# checks


@pytest.mark.quick
def test_a_check_holds_just_where_its_relation_does():
    for relation, below, on_limit, above in (
        ("<", 1, 0, 0),
        ("<=", 1, 1, 0),
        (">", 0, 0, 1),
        (">=", 0, 1, 1),
    ):
        assert [check("x", value, relation, 2.0).holds for value in (1.0, 2.0, 3.0)] == [
            below,
            on_limit,
            above,
        ]


@pytest.mark.parametrize("relation", ["<", "<=", ">", ">="])
@pytest.mark.parametrize(
    ("value", "limit"),
    [
        (math.nan, 1.0),
        (1.0, math.nan),
        (math.nan, math.nan),
        (math.inf, math.inf),
    ],
)
def test_what_cannot_be_compared_never_holds(relation, value, limit):
    assert not check("x", value, relation, limit).holds


def test_never_is_later_than_any_time():
    assert check("x", math.inf, ">", 3.0).holds
    assert check("x", 3.0, "<", math.inf).holds
    assert not check("x", math.inf, "<=", 3.0).holds


def test_ratios_of_nothing_are_no_numbers_that_hold():
    assert math.isnan(ratio(0.0, 0.0))
    assert math.isnan(ratio(math.inf, math.inf))
    assert ratio(1.0, 0.0) == math.inf
    assert ratio(1.0, 4.0) == 0.25


def test_slack_is_the_room_to_the_limit():
    assert check("x", 1.0, "<", 4.0).slack == check("x", 7.0, ">", 4.0).slack == 0.75
    assert check("x", 2.0, "<=", 0.0).slack == -2.0
    assert check("x", math.nan, "<", 1.0).slack == check("x", math.inf, "<", 1.0).slack == -math.inf


# verdicts

YES = check("yes", 1.0, "<", 2.0)
NO = check("no", 3.0, "<", 2.0)
ASIDE = Beside("theory", 7.0)


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        ([YES], SUPPORTED),
        ([YES, check("also", 1.0, ">", 0.0)], SUPPORTED),
        ([NO], REFUTED),
        ([YES, NO], REFUTED),
        ([], NOT_TESTABLE),
        ([ASIDE], NOT_TESTABLE),
        ([NO, ASIDE], REFUTED),
        ([check("x", math.nan, "<", 1.0)], REFUTED),
    ],
)
def test_the_verdict_is_of_the_checks_alone(found, expected):
    assert verdict(found) == expected


ABOUT = [entry._replace(sentence="a") for entry in (YES, NO)]
OTHER = YES._replace(what="other", sentence="b")


@pytest.mark.parametrize(
    ("found", "quantifier", "expected"),
    [
        ([YES, NO], UNIVERSAL, REFUTED),
        ([YES, NO], EXISTENTIAL, SUPPORTED),
        ([NO], EXISTENTIAL, NOT_SHOWN),
        ([*ABOUT, OTHER], NAMED, PARTLY),
        ([*ABOUT, OTHER], EXISTENTIAL, SUPPORTED),
        ([ABOUT[1], OTHER], UNIVERSAL, PARTLY),
    ],
)
def test_a_sentence_holds_with_all_its_checks_and_an_existential_one_with_one(
    found, quantifier, expected
):
    assert verdict(found, quantifier) == expected


def test_one_counter_example_refutes_what_is_said_of_all_gains():
    verdicts = {"study": SUPPORTED, "tuned": REFUTED}
    part = {"study": PARTLY, "tuned": REFUTED}
    assert combined(verdicts, UNIVERSAL)[0] == REFUTED
    assert combined(verdicts, EXISTENTIAL)[0] == SUPPORTED
    assert combined(verdicts, NAMED)[0] == PARTLY
    assert combined({"study": PARTLY, "tuned": SUPPORTED}, UNIVERSAL)[0] == PARTLY
    assert combined(verdicts, over="all")[0] == REFUTED
    assert (
        combined({"study": SUPPORTED, "tuned": NOT_SHOWN}, UNIVERSAL, over="some")[0] == SUPPORTED
    )
    assert combined(part, UNIVERSAL, over="some")[0] == PARTLY
    assert combined(part, EXISTENTIAL, over="all")[0] == PARTLY


def test_universal_claims_are_those_of_the_list():
    assert {id for id, entry in GABER.claims.items() if entry.quantifier == UNIVERSAL} == UNIVERSALS


def entry(id="900", found=(YES,), note=""):
    reported = {
        "text": "text",
        "where": "here",
        "measured": "this",
        "holds_if": "< 2",
        "note": note,
    }
    return ClaimEntry(
        id=id,
        evidence=lambda runs: found[runs.gains] if isinstance(found, dict) else found,
        **reported,
    )


@pytest.fixture
def only(monkeypatch):
    """A paper with the claims given alone."""

    def put(*entries):
        short = dataclasses.replace(GABER, claims={entry.id: entry for entry in entries})
        monkeypatch.setattr(audit, "find_paper", lambda which: short)

    return put


def test_a_claim_says_what_it_depends_on(only):
    only(entry(found={"study": [YES, ASIDE], "tuned": [NO]}, note="Mind the gap."))
    (claim,) = claims(gains=["study", "tuned"])
    assert (claim.verdict, claim.flips, claim.verdicts) == (
        PARTLY,
        True,
        {"study": SUPPORTED, "tuned": REFUTED},
    )
    assert claim.numbers["study"] == {
        "yes": {
            "value": 1.0,
            "relation": "<",
            "limit": 2.0,
            "holds": True,
            "sentence": "",
        }
    }
    assert claim.beside == {"study": {"theory": 7.0}, "tuned": {}}
    assert claim.note.startswith("Mind the gap. The verdict depends on the gains")
    assert claim.checks("tuned") == [NO]
    assert claim.decisive("tuned") == NO


@pytest.mark.parametrize(
    "decisive",
    [
        check("worst", 9.0, "<", 2.0),
        check("never", math.inf, "<", 2.0),
        check("none", math.nan, "<", 2.0),
    ],
)
def test_the_check_that_fails_by_most_decides(only, decisive):
    only(entry(found=[YES, NO, check("worse", 30.0, "<", 20.0), decisive]))
    assert claims(gains="study")[0].decisive("study").what == decisive.what  # pyright: ignore[reportOptionalMemberAccess]


def test_if_all_checks_hold_the_nearest_to_its_limit_decides(only):
    near = check("near", 1.9, "<", 2.0)
    only(entry(found=[YES, near]))
    assert claims(gains="study")[0].decisive("study") == near


def test_claims_are_json_without_loss(only):
    only(entry(found=[check("a", math.inf, "<", 1.0), check("b", math.nan, "<", -math.inf), ASIDE]))
    text = to_json(audit.document(claims(gains="study")))
    reported = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))[
        "claims"
    ][0]
    assert float(reported["numbers"]["study"]["a"]["value"]) == math.inf
    assert math.isnan(float(reported["numbers"]["study"]["b"]["value"]))
    assert reported["beside"] == {"study": {"theory": 7.0}}
    assert reported["flips"] is False


# the list


def test_every_claim_of_the_list_is_there_once_and_in_order():
    assert list(GABER.claims) == LIST.split()


def test_late_claims_come_last_and_every_one_is_reported(only):
    order = []
    reported = []
    late = dataclasses.replace(
        entry("1"), late=True, plants=(), evidence=lambda runs: order.append("1") or [YES]
    )
    of_two = dataclasses.replace(
        entry("2"),
        plants=("duffing", "van_der_pol"),
        evidence=lambda runs: order.append("2") or [YES],
    )
    only(late, of_two)
    report = audit.audit(
        gains=["study", "tuned"], report=lambda done, whole: reported.append((done, whole))
    )
    assert [claim.id for claim in report.claims] == ["1", "2"]
    assert order == ["2", "1", "2", "1"]
    assert reported == [(done, 6) for done in (2, 3, 5, 6)]


# runs


@pytest.fixture
def runs():
    return ClaimRuns(GABER, "study", quick=True)


def substituted(name):
    return {OURS: lambda law: variant(law, name)}


def short(runs, name="duffing", **changes):
    return runs.scenario(name, OURS, duration=0.05, **changes)


def test_a_run_is_made_once(runs, monkeypatch):
    streamed = []
    stream = claim_runs.stream
    monkeypatch.setattr(
        claim_runs, "stream", lambda some, threads: streamed.extend(some) or stream(some, threads)
    )
    first = runs.scores([short(runs), short(runs), short(runs, seed=1)])
    assert first[0] == first[1]
    assert runs.scores([short(runs, seed=1), short(runs)]) == [first[2], first[0]]
    assert len(streamed) == 2


def test_a_run_that_fails_is_infinitely_bad_in_everything(runs):
    @smc.law_function
    def lost(y, gains, memory):
        return math.nan, 0.0

    (scores,) = runs.scores([short(runs, law=lost())])
    assert set(scores) >= {m.name for m in metrics() if not m.network}
    assert set(scores.values()) == {math.inf}


def test_the_rows_of_a_table_stand_for_their_runs(runs):
    scenario = short(runs)
    row = {}
    for m in metrics():
        row[m.name] = None if m.network else 1.5
    row |= {
        "hash": run_key(scenario),
        "law": OURS,
        "gains": '{"lam": 6.0}',
        "failure": None,
    }
    table = ClaimRuns(
        GABER, "study", table=claim_runs.of_table(SimpleNamespace(rows=lambda: [row]))
    )
    assert table.scores([scenario])[0]["itae"] == 1.5
    assert [run.gains for run in table.results()] == [{"lam": 6.0}]


@pytest.mark.parametrize("condition", ["nominal", "noise", "jump_hard", "encoder"])
def test_a_run_of_the_study_has_the_key_that_the_study_gives_it(runs, condition):
    (scenario,) = grid(["duffing"], [OURS], [condition], 1, "study")
    assert run_key(runs.scenario("duffing", OURS, condition)) == run_key(scenario)


def test_a_change_of_plant_keeps_the_gains_of_its_name(runs):
    scenario = short(runs, "pendulum_network", plant=find_plant("pendulum_network", n=2))
    assert scenario.plant.n == 2
    assert scenario.law == runs.law("pendulum_network", OURS)


def test_a_mutant_stands_for_its_law_alone():
    runs = ClaimRuns(GABER, "study", substitute=substituted("zero"))
    law = ClaimRuns(GABER, "study").law("duffing", OURS)
    assert runs.law("duffing", OURS) == dataclasses.replace(variant(law, "zero"), name=OURS)
    assert runs.law("duffing", "classical") == ClaimRuns(GABER, "study").law("duffing", "classical")


# laws made of laws


def test_an_input_gain_multiplies_the_command_at_each_sample(runs):
    law = runs.law("duffing", OURS)
    variants = (law, *(variant(law, name) for name in ("reversed", "zero", "squeezed")))
    traces = runs.traces([short(runs, law=law_variant) for law_variant in variants])
    for trace, gain in zip(
        traces,
        (lambda x: 1.0, lambda x: -1.0, lambda x: 0.0, lambda x: 1 / (1 + x**2)),
        strict=True,
    ):
        assert np.array_equal(trace.s, traces[0].s) is (trace is traces[0])
        expected = -law.gains["lam"] * np.tanh(trace.v + law.gains["k1"] * trace.x) * gain(trace.x)
        np.testing.assert_allclose(trace.u, expected, rtol=1e-12)


def test_each_variant_of_each_law_has_its_own_file_in_numba_s_cache():
    laws = [smc.law(name) for name in ("classical", "pid")]
    variants = []
    for law in laws:
        for name in VARIANTS:
            variants.append(variant(law, name))
    assert len({getattr(variant.function, "__qualname__", "") for variant in variants}) == len(
        variants
    )


def test_an_input_gain_multiplies_what_the_actuator_gives_and_not_what_the_law_asks_for(runs):
    strong = with_gains(runs.law("duffing", OURS), lam=26.0)  # of which 6 N come
    (trace,) = runs.traces([short(runs, law=variant(strong, "squeezed"))])
    command = -26.0 * np.tanh(trace.v + strong.gains["k1"] * trace.x)
    np.testing.assert_allclose(
        trace.u, np.clip(command, -6.0, 6.0) / (1.0 + trace.x**2), rtol=1e-12
    )


# Lyapunov


def along(name, period):
    """Finite differences of V along a run, and V' of the map at the same samples."""
    plant = find_plant(name)
    lam = 2.5
    k1 = 4.0
    x0 = [0.6] * plant.n  # a network synchronised
    scenario = smc.Scenario(
        plant=plant,
        law=smc.law(OURS, lam=lam, k1=k1),
        x0=x0,
        v0=-1.0,
        duration=0.5,
        control_period=period,
    )
    trace = smc.run(scenario)
    x = trace.x[:, 0]
    v = trace.v[:, 0]
    height = lyapunov.surface(plant, lam, k1, x, v) ** 2 / 2.0
    measured = (height[2:] - height[:-2]) / (2 * period)
    mapped = lyapunov.vdot(plant, lam, k1, x, v)[1:-1]
    return np.abs(measured - mapped).max() / np.abs(mapped).max()


@pytest.mark.parametrize("name", PLANTS)
def test_the_map_is_the_slope_of_v_along_trajectories(name):
    coarse = along(name, 1e-3)
    fine = along(name, 2.5e-4)
    assert fine < 0.01
    # what is left is the command's being held, first order in the control period
    assert 3.0 < coarse / fine < 5.0


@pytest.mark.parametrize("name", PLANTS)
@pytest.mark.parametrize("lam", [0.1, 3.0, 1e3])
def test_v_rises_on_one_side_of_alpha_0_whatever_lambda_is(name, lam):
    plant = find_plant(name)
    k1 = 4.0
    x = 0.7
    near = 1e-6 / lam
    sides = lyapunov.vdot(plant, lam, k1, np.full(2, x), -k1 * x + np.array([near, -near]))
    assert sides.max() > 0.0 > sides.min()


def test_a_plant_on_which_the_claim_is_true_shows_no_rise():
    """f = -k1 v - alpha makes alpha' = -alpha - lam tanh(alpha): V falls wherever s is not 0."""
    k1 = 4.0
    plant = dataclasses.replace(
        find_plant("duffing"), nominal=lambda x, v, i, p: (-k1 * v[i] - (v[i] + k1 * x[i]), 1.0)
    )
    x, v = lyapunov.plane(plant, k1, points=21)
    away = np.abs(lyapunov.surface(plant, 2.0, k1, x, v)) > 1e-6
    assert (lyapunov.vdot(plant, 2.0, k1, x, v)[away] < 0.0).all()


# searches


def about(plants, **options):
    """Runs of claim 24, of these plants."""
    return ClaimRuns(GABER, "study", **options).of(
        dataclasses.replace(GABER.claims["24"], plants=plants)
    )


def test_the_smallest_lambda_found_is_that_of_the_sampled_linear_theory():
    runs = about(("inverted_pendulum", "duffing"))
    for name, smallest_lambda in measured.smallest_stable(runs).items():
        loop = runs.law(name, OURS).gains["k1"], measured.LONG_PERIOD
        assert critical_delay(find_plant(name), smallest_lambda, *loop) > 0.0, name
        assert critical_delay(find_plant(name), smallest_lambda / 1.02, *loop) == 0.0, name


def test_the_smallest_lambda_is_of_starts_near_rest_without_velocity(monkeypatch):
    runs = about(("inverted_pendulum_network",))
    tried = []
    trace = SimpleNamespace(t=np.arange(10.0), x=np.zeros((10, 5)))
    monkeypatch.setattr(runs, "traces", lambda grid: tried.extend(grid) or [trace])
    measured.dying(runs, {"inverted_pendulum_network": [2.0]})
    (scenario,) = tried
    assert scenario.x0 == pytest.approx([1e-3 * x for x in scenario.plant.x0])
    assert scenario.resolved.v0 == (0.0,) * scenario.plant.n


@pytest.mark.slow
def test_a_law_without_effect_stabilises_what_hangs_alone():
    runs = about(("duffing", "pendulum_network"), quick=True, substitute=substituted("zero"))
    smallest = measured.smallest_stable(runs)
    assert smallest == {"duffing": math.inf, "pendulum_network": measured.MIN_LAMBDA}


# the audit


def test_the_same_audit_twice_gives_the_same():
    first, again = (
        claims(
            only=["18"],
            gains="study",
            quick=True,
            threads=threads,
        )
        for threads in (None, 1)
    )
    assert again == first


@pytest.mark.slow
def test_the_wrong_sign_converges_just_where_the_plant_has_it_too():
    assert claims(only=["21"], gains="study")[0].verdict == REFUTED
    runs = ClaimRuns(GABER, "study", substitute=substituted("reversed")).of(GABER.claims["21"])
    assert verdict(measure(GABER.claims["21"], runs)) == SUPPORTED


# the command


@pytest.mark.parametrize(
    ("quick", "reported"),
    [
        (True, "; here, quickly, 51 x 51 points"),
        (False, "one pendulum"),
    ],
)
def test_a_quick_audit_tells_what_it_measures_instead(quick, reported):
    (claim,) = claims(only=["18"], gains="study", quick=quick)
    assert claim.measured.endswith(reported)


def test_what_is_no_table_is_refused(refused):
    refused(lambda: claims(table=math.nan), "table is nan", "smc.Table.read")  # pyright: ignore[reportArgumentType]
