"""Laws under friction: how sets are chosen and sentences judged, by hand, and the page against the
file that it rests on.
"""

import dataclasses
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

import smc_mujoco as smc
from benchmarks import friction, friction_by_own_loop, friction_plants
from benchmarks import friction_sentences as sentences
from benchmarks.friction import Case, Choice, Sets
from smc_mujoco.analysis.engine.group import FormGroup
from smc_mujoco.analysis.engine.scores import summed_up
from smc_mujoco.analysis.tuning.objective import CONDITIONS, Objective

FILE = Path(friction.__file__).with_suffix(".json")
POINTS = json.loads(FILE.read_text())
PAGE = (FILE.parents[1] / "docs" / "what_wins_under_friction.md").read_text()
OWN = json.loads(Path(friction_by_own_loop.__file__).with_suffix(".json").read_text())
DRAWN = sorted(FILE.parent.glob("friction_drawn*.json"))
JOINTS = friction_plants.joints()


@pytest.mark.quick
@pytest.mark.parametrize(
    ("ours", "theirs", "factor", "said"),
    [
        (2.0, 4.0, 1.0, "stands"),
        (2.0, 2.9, 1.0, "open"),  # another search may find as much
        (4.0, 2.0, 1.0, "contradicted"),
        (2.0, 5.0, 3.0, "open"),
        (2.0, 7.0, 3.0, "stands"),
        (0.1, 0.9, 1.0, "not ranked"),
        (0.1, 1.4, 1.0, "open"),  # the better one counts as one count
        (2.0, math.inf, 1.0, "stands"),
        (math.inf, 2.0, 1.0, "contradicted"),
        (math.inf, math.inf, 1.0, "not ranked"),
    ],
)
def test_a_lead_is_judged_above_one_count_alone(ours, theirs, factor, said):
    assert sentences.leads(ours, theirs, factor) == said


@pytest.mark.quick
def test_a_level_buys_the_least_error_of_the_sets_that_it_affords():
    J = np.array([1.0, 3.0, 5.0, math.nan, 2.0])
    rates = np.array([5.0, 9.0, 5.0, 5.0, 25.0])
    errors = np.array([[4.0], [3.0], [1.0], [1.0], [2.0]])
    sets = Sets(np.zeros((5, 1)), J, rates, errors)
    assert friction.chosen(sets, Choice("J", 0.0, 0), 1.0) == 0
    assert friction.chosen(sets, Choice("R", 10.0, 0), 1.0) == 1  # J of the third is beyond 4
    assert friction.chosen(sets, Choice("R", 30.0, 0), 1.0) == 4
    assert friction.chosen(sets, Choice("R", 3.0, 0), 1.0) == -1
    assert friction.on_front(sets).tolist() == [0, 2]


@pytest.mark.quick
def test_a_seed_draws_its_joints():
    first, again, other = (friction_plants.drawn(seed)["drawn_rail"] for seed in (7, 7, 8))
    assert first.levels == again.levels != other.levels
    assert first.plant.parameters == again.plant.parameters != other.plant.parameters
    moving, resting = first.levels["stribeck"]
    assert resting / moving == pytest.approx(1.5)


@pytest.mark.parametrize("name", ["rail", "geared", "ak80"])
def test_a_point_of_the_page_is_the_same_by_the_engine_and_by_mujoco(name):
    """Here of a sine with a feedforward that is wrong; two seconds of it."""
    one = JOINTS[name]
    case = Case(next(iter(one.levels)), "sine", 0.7)
    law = smc.law("pid", kp=20.0, ki=30.0, kd=2.0, tau=0.0)
    run = dataclasses.replace(friction.scenario(one, law, case, 3), duration=2.0)
    scores = FormGroup([run], friction.SUMS).scored("cpu", 1)[0][0]
    expected = smc.score(smc.run(run))
    assert scores == pytest.approx([expected[metric] for metric in friction.SUMS], rel=1e-6)


@pytest.mark.quick
def test_mujoco_runs_each_point_that_is_printed_and_agrees():
    for point in POINTS:
        if "chose" in point:
            assert len(point["mujoco"]) == friction.BY_MUJOCO
    ratios = sentences.agreement(POINTS)
    assert np.mean(np.abs(np.log(ratios)) < math.log(1.1)) > 0.9


def struck(text):
    """The names of the sentences that a page strikes out."""
    return set(re.findall(r"~~\*\*(\w+)", text))


@pytest.mark.quick
def test_the_points_of_the_page_bear_the_sentences_that_it_does_not_strike_out():
    found = sentences.judged(POINTS)
    assert {one.sentence for one in found} == set(sentences.SENTENCES)
    for path in DRAWN:
        found += sentences.judged(json.loads(path.read_text()))
    contradicted = {one.sentence for one in found if one.verdict == "contradicted"}
    assert contradicted == struck(PAGE)


@pytest.mark.quick
def test_every_row_of_the_page_is_that_of_the_file():
    rows = [*sentences.page_rows(POINTS)]
    for path in DRAWN:
        rows += sentences.verdict_rows(json.loads(path.read_text()), path.stem)
    rows += sentences.verdict_rows(POINTS, "friction")
    missing = [row for row in rows if row not in PAGE]
    assert not missing
    tables = [line for line in PAGE.splitlines() if line.startswith("| `")]
    assert not set(tables).difference(rows)


def claims():
    """What the page's sentences say in numbers, made of the files."""
    two = sentences.two_digits
    by_chance = json.loads(DRAWN[0].read_text())
    points, drawn = sentences.Points(POINTS), sentences.Points(by_chance)
    sine = {"price": "R", "level": 10.0, "task": "sine"}
    dearer = sine | {"level": 30.0}

    def at(*where, **price):
        point = points.find(*where, **price)
        assert point is not None
        return point

    def error(law, share=0.0, price=sine):
        return two(sentences.error(points.find("rail", law, "coulomb30", share=share, **price)))

    def turned(law):
        return two(at("rail", law, "coulomb10", **sine)["turned"])

    dry = ("coulomb10", "coulomb30", "stribeck")
    at_rest = [sentences.error(drawn.find("drawn_rail", "pd_observer", one)) for one in dry]
    off = []
    for law in ("hodob", "observer_free_integral"):
        off += [sentences.error(points.find("rail", law, one)) for one in (*dry, "load", "lugre")]
    still = at("rail", "classical", "coulomb30")
    resists = JOINTS["rail"].levels["coulomb30"][0] * JOINTS["rail"].bound
    assert still["stuck"] == 1.0
    before = [*sentences.judged(POINTS), *sentences.judged(by_chance)]
    stand = [one for one in before if one.verdict == "stands"]
    alone = [one for one in stand if one.values[1] == math.inf]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sentences, "SEARCH", 2.5)
        stricter = [*sentences.judged(POINTS), *sentences.judged(by_chance)]
    verdicts = [one.verdict for one in stricter]
    assert verdicts.count("contradicted") == len(
        [one for one in before if one.verdict == "contradicted"]
    )
    assert [one.joint for one in alone if one.sentence == "right"] == ["ak80"]
    moving = [
        drawn.share("drawn_rail", law, one) for law in ("hodob", "pd_observer") for one in dry
    ]
    ratios = sentences.search_noise(POINTS)
    chose = at("rail", "pid", "coulomb10", **sine)["chose"]
    wrong = {error("pd", share) for share in (0.7, 1.3)}

    def swings(law):
        its = {"joint": "rail", "law": law, "price": "hunting"}
        ranges = [point["range"] for point in POINTS if its.items() <= point.items()]
        return f"{two(min(ranges))} to {two(max(ranges))}"

    implicit = "implicit_super_twisting"
    resting = [
        two(sentences.error(points.find("rail", law, "coulomb30")))
        for law in (implicit, "super_twisting")
    ]
    forms = [point for point in POINTS if point["law"] == implicit and point["price"] == "R"]
    assert {point["joint"] for point in forms if point["errors"]} == {"rail"}
    return [
        f"on the rail `hodob` moves by {swings('hodob')} counts from 30 to 40 s, and "
        f"`super_twisting` by {swings('super_twisting')}, hardly more than the {friction.STILL:.0f}",
        f"`{implicit}` has {error(implicit)} counts at R 10 and {error(implicit, price=dearer)} at "
        f"R 30, the explicit one {error('super_twisting')} and "
        f"{error('super_twisting', price=dearer)}. With the right compensation at R 10 they have "
        f"{error(implicit, 1.0)} and {error('super_twisting', 1.0)}, at rest with gains of least J "
        f"{resting[0]} and {resting[1]}.",
        f"Sets with R above {max(friction.RATES):.0f} did not run under friction",
        f"a PD with it has an error of {error('pd', 1.0)} counts of the encoder, super-twisting "
        f"{error('super_twisting')}.",
        f"the PD has {wrong.pop()} counts, level with super-twisting",
        f"a PD with an observer has {error('pd_observer')}, ADRC {error('adrc')}. With "
        f"compensation as well, ADRC has {error('adrc', 1.0)}.",
        f"a plain PID without compensation has {error('pid')} in the same case",
        f"super-twisting has {error('super_twisting', price=dearer)}, the PD with an observer "
        f"{error('pd_observer', price=dearer)}, ADRC {error('adrc', price=dearer)}.",
        f"the boundary layer has {error('boundary_layer', 1.0)} and the integral sliding law "
        f"{error('observer_free_integral', 1.0)}",
        f"its k is {still['gains']['k']:.2f} N, the friction {resists:.1f} N",
        f"in {len(alone)} of the {len(stand)} points that stand",
        f"{verdicts.count('stands')} of the {len(stand)} points would stand",
        f"under LuGre on the rail, with {two(sentences.error(points.find('rail', 'super_twisting', 'lugre')))}",
        f"with {two(min(at_rest))} to {two(max(at_rest))} counts",
        f"are off by {two(min(off))} to {two(max(off))} counts on the rail",
        f"{100 * max(moving[:3]):.0f} % of them move, at most {100 * max(moving[3:]):.0f} % of the",
        f"on the rail under 10 % is {turned('super_twisting')} counts, the observers' "
        f"{turned('pd_observer')} and {turned('adrc')}",
        f"of {len(ratios)} points the two searches are {two(np.median(ratios))} times apart in the "
        f"median, and in {np.isinf(ratios).sum()} only one found a set",
        f"`pid` on the rail has {two(min(chose))} by one, {two(max(chose))} by the other",
        f"Each law had {POINTS[0]['searched']} sets in two searches",
    ]


@pytest.mark.quick
def test_the_numbers_of_the_sentences_are_those_of_the_files():
    text = " ".join(PAGE.split())
    missing = [claim for claim in claims() if claim not in text]
    assert not missing


@pytest.mark.quick
def test_super_twisting_rests_within_the_counts_that_the_page_says():
    for path in (FILE, *DRAWN):
        points = sentences.Points(json.loads(path.read_text()))
        for joint in points.joints:
            for one in points.frictions(joint, (*sentences.DRY, "load")):
                assert sentences.error(points.find(joint, "super_twisting", one)) < 1.3


@pytest.mark.quick
def test_limit_cycles_need_a_second_pass_as_the_page_says():
    cycles = "chattering_amplitude", "chattering_frequency"
    assert not any(map(summed_up, cycles))
    assert all(map(summed_up, ("rest_share", "ripple", "slip_rate", "stick_time")))


@pytest.mark.quick
def test_an_own_loop_has_the_order_that_the_page_says():
    assert friction_by_own_loop.in_words(POINTS, OWN) in " ".join(PAGE.split())


def test_the_own_loop_gives_its_medians_again():
    """A law through reversals and one at rest, with other starts, phases and noise."""
    its = ("pid", "sine"), ("hodob", "rest")
    rng = np.random.default_rng(8)
    for point, own in zip(friction_by_own_loop.printed(POINTS), OWN, strict=True):
        if (point["law"], point["task"]) in its and own > friction_by_own_loop.FLOOR:
            assert friction_by_own_loop.median(point, rng) == pytest.approx(own, rel=0.1)


def test_stiction_would_raise_J_by_what_the_page_says():
    assert "stiction" not in [condition.name for condition in CONDITIONS]
    goals = [Objective(), Objective(conditions=(*CONDITIONS, "stiction"))]
    more = []
    for law in ("pid", "pd_observer", "adrc", "super_twisting", "boundary_layer", "hodob"):
        gains = smc.law(law, plant="duffing").gains
        costs = []
        for goal in goals:
            cost = smc.design.objective("duffing", law, goal, threads=1)
            costs.append(cost([gains[name] for name in cost.bounds]))
        more.append(100 * (costs[1] / costs[0] - 1))
    said = f"of six laws with their shipped gains on duffing {min(more):.0f} to {max(more):.0f} %"
    assert said in " ".join(PAGE.split())
