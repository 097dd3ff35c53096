"""Fronts of error against price: how sets are chosen and sentences judged, by hand, and what it
takes to turn a sentence of the page.
"""

import functools
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks import fronts, fronts_by_own_loop, fronts_sentences
from benchmarks.fronts import CONDITIONS, Job, Sets
from benchmarks.fronts_sentences import FLOOR, LEVELS, SENTENCES, Sentence

PAGE = Path(fronts.__file__).parents[1] / "docs" / "where_sliding_mode_loses.md"
TEXT = " ".join(PAGE.read_text().split())
POINTS = fronts_sentences.read(Path(fronts.__file__).with_suffix(".json"))  # of the page
OWN = json.loads(Path(fronts_by_own_loop.__file__).with_suffix(".json").read_text())
ONE = Sentence("one", ("super_twisting",), ("pid",), ("middle",), high=3.0)


def point(law, error, level=2.0, **fields):
    """A point of a front, whose error is known within 2 %."""
    known = math.inf if math.isnan(error) else error
    made = {"plant": "duffing", "model": "none", "law": law, "price": "J", "level": level}
    made |= {"search": 11, "draw": None, "period": 1e-3, "condition": "middle", "within": True}
    return made | {"chose": known, "error": [known, 0.98 * known, 1.02 * known]} | fields


@pytest.mark.quick
@pytest.mark.parametrize(
    ("ours", "theirs", "said"),
    [
        (0.01, 0.025, "stands"),
        (0.01, 0.015, "open"),  # another search may find as much
        (0.025, 0.01, "contradicted"),
        (None, 0.01, "contradicted"),  # nothing at this price
        (0.01, None, "unopposed"),
        (FLOOR / 100, FLOOR / 2, "not ranked"),
        (FLOOR / 100, FLOOR * 2.5, "below the floor"),
        (FLOOR / 100, FLOOR * 1.8, "not ranked"),  # another search may find it below, too
        (FLOOR * 2.5, FLOOR / 100, "contradicted"),
        (math.nan, 0.01, "not settled"),  # half of its runs fail
    ],
)
def test_a_sentence_is_judged_by_the_lead_at_the_prices_that_it_is_about(ours, theirs, said):
    points = []
    for law, error in (("super_twisting", ours), ("pid", theirs)):
        for change in ({"level": 4.0}, {"model": "nominal"}, {"price": "rate"}):
            points.append(point(law, 1.0, **({"level": 2.5} | change)))
        if error is not None:
            points.append(point(law, error))
    (found,) = fronts_sentences.judged(points, [ONE])
    assert found.verdict == said
    if said in ("stands", "open"):
        assert found.lead == pytest.approx(theirs / ours)
        assert found.low <= found.lead <= found.high
    assert not list(fronts_sentences.judged(points, [ONE._replace(within=False)]))


@pytest.mark.quick
def test_a_median_has_an_interval_of_two_values_and_a_failed_run_is_beyond_all():
    values = np.arange(1.0, 129.0)
    middle, low, high = fronts_sentences.with_interval(np.random.default_rng(2).permutation(values))
    assert middle == 64.5
    assert low + high == 129.0
    # fewer than `low` of 128 tosses fall on one side
    tails = [math.comb(128, k) / 2.0**128 for k in range(int(low) + 1)]
    assert sum(tails[:-1]) <= fronts_sentences.ERROR / 2 < sum(tails)
    assert fronts_sentences.with_interval([*values[:11], math.nan]) == (6.5, 1.0, math.inf)
    assert fronts_sentences.with_interval([math.nan] * 7 + [1.0] * 5)[0] == math.inf


@pytest.mark.quick
@pytest.mark.parametrize(
    ("theirs", "again", "said", "lead"),
    [
        (0.025, 0.03, "stands", 2.5),
        (0.004, 0.003, "contradicted", 0.4),
        (0.022, 0.004, "open", 2.2),
        (0.03, 0.012, "open", 1.2),
        (0.025, None, "open", 2.5),  # the second search has no law at this price
    ],
)
def test_what_two_searches_say_is_the_smallest_lead_that_both_have(theirs, again, said, lead):
    points = [point("super_twisting", 0.01), point("pid", theirs)]
    if again is None:
        points.append(point("pid", 0.01, level=3.0, search=12))
    else:
        points += [point("super_twisting", 0.01, search=12), point("pid", again, search=12)]
    cell, *_ = fronts_sentences.cells(points, [ONE])
    found = fronts_sentences.weakest(cell)
    assert found.verdict == said
    assert found.lead == pytest.approx(lead)
    assert found.low == pytest.approx(0.98 / 1.02 * min(theirs, again or theirs) / 0.01)
    assert found.high == pytest.approx(1.02 / 0.98 * max(theirs, again or theirs) / 0.01)


@pytest.mark.quick
@pytest.mark.parametrize(
    ("error", "settled"),
    [
        ([0.01, 0.0097, 0.0103], True),
        ([0.01, 0.0096, 0.0102], False),
        ([0.01, 0.0098, 0.0104], False),
        ([FLOOR / 2, FLOOR / 9, FLOOR], True),  # below the floor, wherever
        ([FLOOR / 2, FLOOR / 9, 0.3], False),  # some runs swing
        ([math.inf, 0.01, math.inf], False),
    ],
)
def test_an_error_is_a_number_where_its_interval_is_narrow(error, settled):
    assert fronts_sentences.is_settled(error) == settled
    points = [point("super_twisting", 0.01) | {"error": error}, point("pid", 0.5)]
    (found,) = fronts_sentences.judged(points, [ONE])
    assert (found.verdict == "not settled") == (not settled)


@pytest.mark.quick
def test_no_lead_is_told_where_a_search_has_an_error_that_is_not_settled():
    points = [point("super_twisting", 0.01), point("pid", 0.05)]
    wide = point("super_twisting", 0.01, search=12) | {"error": [0.01, 0.005, 0.02]}
    (cell,) = fronts_sentences.cells([*points, wide, point("pid", 0.05, search=12)], [ONE])
    found = fronts_sentences.weakest(cell)
    assert found.verdict == "not settled"
    assert fronts_sentences.cell(found) == "not settled: 2.5 to 10"


@pytest.mark.quick
def test_more_runs_are_asked_for_where_a_quarter_of_the_errors_is_elsewhere():
    alike = np.full(128, 0.01)
    assert fronts.are_alike(alike)
    swings = np.where(np.arange(128) < 70, alike, 0.3)  # the interval of the median is narrow
    assert not fronts.are_alike(swings)
    assert not fronts.are_alike(np.where(np.arange(128) < 70, alike, np.nan))
    assert fronts.are_alike(np.linspace(0.0, FLOOR, 128))


@pytest.mark.quick
def test_a_lead_that_the_other_search_has_below_the_floor_is_not_ranked():
    points = [point("super_twisting", 0.01), point("pid", 0.02)]
    points += [point(law, FLOOR / 3, search=12) for law in ("super_twisting", "pid")]
    (cell,) = fronts_sentences.cells(points, [ONE])
    assert fronts_sentences.weakest(cell).verdict == "not ranked"


@pytest.mark.quick
def test_a_sentence_is_struck_out_if_one_search_contradicts_it():
    points = [point("hodob", 0.01), point("boundary_layer", 0.03)]
    second = [point("hodob", 0.03, search=12), point("boundary_layer", 0.01, search=12)]
    name = "smooth, quiet"
    counts = fronts_sentences.counted(points)[name, False]
    assert (counts["stands"], counts["contradicted"]) == (1, 0)
    assert name not in fronts_sentences.contradicted(points)
    assert fronts_sentences.counted(points + second)[name, False]["contradicted"] == 1
    assert name in fronts_sentences.contradicted(points + second)


@pytest.mark.quick
def test_two_searches_are_compared_where_both_have_a_point_above_the_floor():
    points = [point("pid", 0.01), point("adrc", FLOOR / 9), point("pid", 0.5, level=3.0)]
    points += [point("pid", 0.03, search=12), point("adrc", FLOOR / 3, search=12)]
    found = fronts_sentences.between(points)
    assert (found.compared, found.apart) == (1, 1.0)
    assert found.median == pytest.approx(3.0)
    assert found.by_chance == 0.5  # both searches toss a coin each


@pytest.mark.quick
def test_two_searches_choose_on_other_instances_and_are_judged_on_the_same_unseen_ones():
    benches = [fronts.Bench(Job("duffing", "pid", 8.2, search=search)) for search in (11, 12)]
    starts = [[one.resolved.x0 for one in bench.cases] for bench in benches]
    assert not set(starts[0]) & set(starts[1])
    assert [len(bench.loaded) for bench in benches] == [fronts.CHOOSERS] * 2
    first = min(one.seed for one in benches[0].cases)
    assert first > fronts.MORE  # the unseen ones are before them


@pytest.mark.quick
def test_a_set_is_judged_by_the_worst_of_the_instances_that_choose():
    bench = fronts.Bench(Job("duffing", "pid", 8.2))
    gains = np.array([[40.0, 60.0, 12.0, 0.1], [1e-3, 1e-3, 1e-3, 1.0]])
    its = bench.judged(gains)
    alone = []
    for priced, loaded in zip(bench.priced, bench.loaded, strict=True):
        sums = bench.sums(gains[:1], loaded)
        cost = bench.prices(bench.sums(gains[:1], priced), priced)[0]
        alone.append([cost, *(sums[0, :, fronts.RMS] / bench.start)])
    assert [its.J[0], *its.errors[0]] == pytest.approx(np.max(alone, axis=0))
    assert len(set(np.array(alone)[:, 0])) == fronts.CHOOSERS
    assert np.isnan(its.J[1])  # it stays where it starts


@pytest.mark.quick
def test_a_level_buys_the_least_error_among_sets_that_have_settled():
    errors = np.tile([[0.3], [0.2], [0.1], [0.05]], (1, len(CONDITIONS)))
    settled = np.ones(errors.shape, bool)
    settled[3] = False
    J = np.array([1.0, 2.0, 4.0, 1.5])
    sets = Sets(np.zeros((4, 1)), J, errors, settled, np.array([50.0, 5.0, 500.0, 5.0]))
    found = {}
    for price, level, condition, i in fronts.chosen(sets, LEVELS, 1.0):
        if condition == 0:
            found[price, level] = i
    bought = [found[at] for at in (("J", 1.5), ("J", 3.0), ("J", 5.0), ("rate", 30.0))]
    assert bought == [0, 1, 2, 1]
    just = fronts.chosen(sets, {"J": (4.0,)}, 1.0)  # 4 is within the margin of its level
    assert [i for *_, condition, i in just if condition == 0] == [1]
    assert [*fronts.on_front(sets)] == [True, True, True, False]


@pytest.mark.quick
def test_loads_and_prices_are_drawn_from_a_seed_and_the_plant():
    conditions, levels = fronts.drawn(7, "duffing")
    assert (conditions, levels) == fronts.drawn(7, "duffing")
    assert conditions != fronts.drawn(8, "duffing")[0]
    assert conditions != fronts.drawn(7, "arm.xml:elbow")[0]
    for given, made in zip(CONDITIONS, conditions, strict=True):
        assert made.kind == given.kind
        assert 0.5 * given.noise <= made.noise <= 2.0 * given.noise
        assert 0.7 * given.ratio <= made.ratio <= 1.4 * given.ratio
    for price, its in LEVELS.items():
        assert its[0] <= min(levels[price]) <= max(levels[price]) <= its[-1]


@pytest.mark.quick
def test_a_gain_at_the_edge_of_its_box_is_named_once_for_a_plant_with_how_often():
    edges = [{"l": "upper"}, {"l": "upper"}, {}]
    points = [point("hodob", 0.1, gains={"l": 632.5}, edges=edge) for edge in edges]
    (said,) = fronts_sentences.at_edges(points)
    assert said.startswith(
        "hodob on duffing: l = 632.5 is at the upper end of where it was searched: a larger"
    )
    assert said.endswith("(2 of 3 points)")


@pytest.mark.quick
def test_the_implicit_laws_assumed_gain_is_searched():
    implicit = fronts.Bench(Job("inverted_pendulum", "implicit_super_twisting", 30.0))
    low, high = fronts.drawn_from(implicit.task)["b"]
    assert low < 8.0 < high  # the pendulum's g
    assert "b" in implicit.names
    assert fronts.assumed(fronts.Bench(Job("duffing", "pid", 8.2)).task) == {}


@pytest.mark.quick
def test_the_page_has_the_tables_of_its_points_and_strikes_out_what_they_contradict():
    lines = PAGE.read_text().splitlines()
    for line in (*fronts_sentences.tables(POINTS), *fronts_sentences.count_table(POINTS)):
        assert line in lines, line
    struck = fronts_sentences.contradicted(POINTS)
    often = fronts_sentences.how_often(POINTS)
    assert set(often) == {sentence.name for sentence in SENTENCES}
    for name, words in often.items():
        (bullet,) = [line for line in lines if re.match(rf"- (~~)?\*{re.escape(name)}\*", line)]
        assert bullet.startswith("- ~~") == (name in struck), name
        assert words in bullet
    words = f"**{len(struck)} of {len(SENTENCES)} sentences are contradicted**"
    assert words in TEXT


@pytest.mark.quick
def test_readme_and_the_page_say_how_often_super_twisting_leads_and_what_two_searches_share():
    assert (
        "\n".join(fronts_sentences.in_readme(POINTS)) in (PAGE.parents[1] / "README.md").read_text()
    )
    assert fronts_sentences.first_words(POINTS) in TEXT
    assert fronts_sentences.of_searches(POINTS) in TEXT
    assert fronts_sentences.of_runs(POINTS) in TEXT
    assert fronts_sentences.often_at_edges(POINTS) in TEXT


@pytest.mark.quick
def test_two_equal_laws_are_told_apart_in_few_cells():
    assert fronts_sentences.between(POINTS).by_chance < 0.05


@pytest.mark.quick
def test_mujoco_has_run_each_point_that_a_sentence_rests_on():
    sides = [side for _, *both in fronts_sentences.two_sides(POINTS) for side in both if side]
    own = [side for side in sides if side["draw"] is None]
    assert own
    near = [np.abs(side["apart"]).max() < 0.05 for side in own if side["error"][0] > FLOOR]
    assert np.mean(near) > 0.95


@pytest.mark.quick
def test_a_loop_of_its_own_gives_the_printed_errors():
    assert fronts_by_own_loop.in_words(POINTS, OWN) in TEXT
    assert fronts_by_own_loop.apart(POINTS, OWN).max() < 0.05


@pytest.mark.slow
def test_the_own_loop_gives_its_medians_again():
    """One point of each law, with other starts, phases and noise than those that are kept."""
    rng = np.random.default_rng(9)
    points = fronts_by_own_loop.printed(POINTS)
    for law in fronts_by_own_loop.GAINS:
        near = [one["law"] == law and "strong" not in one["condition"] for one in points]
        at = near.index(True)
        assert fronts_by_own_loop.median(points[at], rng) == pytest.approx(OWN[at], rel=0.05)


LEFT = [one for one in SENTENCES if one.name not in fronts_sentences.contradicted(POINTS)]


@functools.cache
def choosing(job):
    return fronts.Bench(job)


@pytest.mark.slow
@pytest.mark.parametrize("sentence", LEFT, ids=[sentence.name for sentence in LEFT])
def test_no_change_of_one_gain_of_a_losing_law_turns_a_sentence_that_stands(sentence):
    """By 3, 10 or 30 either way, where the search chose: it costs more than the price, or its error
    is larger still.
    """
    kinds = [condition.kind for condition in CONDITIONS]
    own = [point for point in POINTS if point["draw"] is None]
    for _, first, second in fronts_sentences.two_sides(own, [sentence]):
        stands = fronts_sentences.verdict(sentence, first, second)[-1] == "stands"
        if not (first and second and stands):
            continue
        place = {name: second[name] for name in ("plant", "law", "wc", "period", "search")}
        bench = choosing(Job(**place))
        its = [second["gains"][name] for name in bench.names]
        changed = np.repeat([its], 6 * len(bench.names), axis=0)
        for i, (gain, factor) in enumerate(np.ndindex(len(bench.names), 6)):
            changed[i, gain] *= (1 / 30, 1 / 10, 1 / 3, 3.0, 10.0, 30.0)[factor]
        sets = bench.judged(changed)
        if sentence.price == "least":
            assert (np.nan_to_num(sets.J, nan=np.inf) > first["chose"]).all()
            continue
        cost = sets.rates if sentence.price == "rate" else sets.J / second["least"]
        at = kinds.index(second["condition"])
        affordable = (cost <= fronts.MARGIN * first["level"]) & sets.settled[:, at]
        turned = affordable & (sets.errors[:, at] < first["chose"])
        assert not turned.any(), (first["law"], second["law"], first["level"], changed[turned])
