"""Statistics: intervals cover what they say, ranks are paired, and no winner is declared inside the
noise.
"""

import contextlib
import dataclasses
import json
import math
import re

import numpy as np
import pytest
from scipy import stats

import smc_mujoco as smc
from smc_mujoco import grid
from smc_mujoco.analysis import paired_runs as cells
from smc_mujoco.analysis.bootstrap import Interval, median_of, share_interval
from smc_mujoco.analysis.ranking import (
    RELEVANT,
    Comparison,
    Limits,
    Rank,
    _holm,
    exceeds,
    least_visible_lead,
    linked,
)
from smc_mujoco.analysis.ranking import ranks as places
from smc_mujoco.common.errors import ScenarioError, find
from smc_mujoco.common.tabular import plain
from smc_mujoco.evidence.papers.gaber import scenarios as paper
from smc_mujoco.simulation import serialise
from smc_mujoco.studies import board as boards_of
from smc_mujoco.studies import run_key
from smc_mujoco.studies.board import Board, Boards
from smc_mujoco.studies.leaderboard import METRICS, leaderboard
from smc_mujoco.studies.study import study as run_study

INF = math.inf


class Stand:
    """A stand-in for a study's table: columns by name."""

    def __init__(self, **columns):
        rows = len(columns["law"])
        given = {
            "plant": ["duffing"] * rows,
            "condition": ["nominal"] * rows,
            "failure": [None] * rows,
        }
        given |= {"diverged_at": [math.nan] * rows, "seed": list(range(rows))}
        self.columns = {name: np.asarray(values) for name, values in (given | columns).items()}

    def column(self, name: str) -> np.ndarray:
        return find("column", name, self.columns)

    def scenario(self, i: int):
        return serialise.restore(json.loads(self.column("scenario")[i]))

    def taken(self, rows) -> "Stand":
        return Stand(**{name: values[rows] for name, values in self.columns.items()})


def stand(scores: dict[str, np.ndarray], metric: str = "itae", **columns) -> Stand:
    """law -> (conditions, seeds) as a table of one plant."""
    conditions, seeds = next(iter(scores.values())).shape
    return Stand(
        law=np.repeat(list(scores), conditions * seeds),
        condition=np.tile(np.repeat([f"c{i}" for i in range(conditions)], seeds), len(scores)),
        seed=np.tile(np.arange(seeds), len(scores) * conditions),
        **{metric: np.concatenate([s.ravel() for s in scores.values()])},
        **columns,
    )


def by_law(found):
    return {one.law: one for one in found}


def ranks(scores, **options) -> list[Rank]:
    return places(Comparison(scores, **options))


def within(count: int, runs: int, probability: float) -> bool:
    """Whether a count is one that a binomial distribution has in all but 1 of 10,000 draws."""
    return bool(stats.binomtest(count, runs, probability).pvalue > 1e-4)


# medians


def interval(values) -> Interval:
    """The interval of values (n,) in any order, or of (blocks, n), whose columns are drawn
    together.
    """
    rows = np.atleast_2d(np.asarray(values, float))
    return median_of(np.sort(rows) if len(rows) == 1 else rows)


def test_few_values_by_hand():
    assert interval([3.0, 1.0, 2.0]) == Interval(2.0, 1.0, 3.0, 3)
    assert interval([4.0, 1.0, 2.0, 3.0]) == Interval(2.5, 1.0, 4.0, 4)


@pytest.mark.parametrize(("n", "low", "high"), [(5, 1, 5), (7, 1, 7), (10, 2, 9), (20, 6, 15)])
def test_the_ends_are_the_order_statistics_that_the_binomial_distribution_gives(n, low, high):
    """P*(median* <= x_(j)) = P(Bin(n, j / n) >= n / 2), Efron 1979; against the expanded
    percentile.
    """
    tail = stats.norm.cdf(-math.sqrt(n / (n - 1)) * stats.t.ppf(0.975, n - 1))
    below = [stats.binom.sf(math.ceil(n / 2) - 1, n, j / n) for j in range(1, n + 1)]
    assert 1 + np.argmax(np.array(below) >= tail) == low
    assert interval(np.arange(1.0, n + 1))[1:3] == (low, high)


def test_from_six_to_forty_seeds_it_covers_93_percent_or_more():
    for n in range(6, 41):
        low, high = interval(np.arange(1, n + 1))[1:3]
        assert stats.binom.cdf(high - 1, n, 0.5) - stats.binom.cdf(low - 1, n, 0.5) > 0.93


@pytest.mark.slow
def test_blocks_are_drawn_by_seed_and_so_the_interval_covers_where_that_of_pooled_runs_does_not():
    rng = np.random.default_rng(0)
    runs = 300
    covered = 0
    pooled = 0
    for _ in range(runs):
        # the seed decides; median 0
        values = rng.normal(size=(1, 12)) + 0.1 * rng.normal(size=(8, 12))
        one = interval(values)
        other = interval(values.ravel())
        covered += one.low <= 0 <= one.high
        pooled += other.low <= 0 <= other.high
    assert covered / runs > 0.92
    assert pooled / runs < 0.7


def test_never_is_worst_and_ends_an_interval():
    assert interval([1, 2, 3, 4, INF, INF, INF]) == Interval(4.0, 1.0, INF, 7)
    assert interval([1, INF]).median == INF
    assert interval([INF] * 9) == Interval(INF, INF, INF, 9)


def test_a_constant_has_no_width_and_a_single_seed_no_interval():
    assert interval([2.5] * 6) == Interval(2.5, 2.5, 2.5, 6)
    for one in (interval([2.5]), interval([[1.0], [4.0]])):
        assert one.median == 2.5
        assert math.isnan(one.low)
        assert math.isnan(one.high)
        assert one.n == 1


def test_intervals_are_the_same_each_time_and_in_any_order():
    rng = np.random.default_rng(0)
    values = rng.normal(size=30)  # whose upper end is near the next value
    assert {interval(rng.permutation(values)) for _ in range(20)} == {interval(values)}
    assert np.exp(interval(values)[1:3]) == pytest.approx(interval(np.exp(values))[1:3])


@pytest.mark.parametrize(("k", "n"), [(0, 1), (0, 17), (3, 20), (15, 15), (20, 20)])
def test_the_interval_of_a_share_is_wilson_s(k, n):
    wanted = stats.binomtest(k, n).proportion_ci(method="wilson")
    found = share_interval(k / n, n)
    assert found[1:3] == pytest.approx(tuple(wanted), abs=1e-12)
    assert found.low <= found.median <= found.high


# ranks


def test_ranks_are_those_of_the_medians_of_each_block():
    scores = {"a": [[1.0, 1.0, 9.0], [INF, INF, 1.0]], "b": [[1.02, 5.0, 1.0], [INF, INF, 2.0]]}
    scores["c"] = [[3.0, 1.0, 4.0], [2.0, 3.0, INF]]
    found = by_law(ranks(scores))  # medians 1, 1.02, 3: the first two tied; never, never, 3
    assert {law: rank.mean for law, rank in found.items()} == {"a": 2.0, "b": 2.0, "c": 2.0}
    scores["b"][0][0] = 1.04  # by more than 3 %
    assert {law: rank.mean for law, rank in by_law(ranks(scores)).items()} == {
        "a": 1.75,
        "b": 2.25,
        "c": 2.0,
    }


def test_ranks_of_shares_are_those_of_their_means():
    # of runs that do not settle; both medians are 0
    scores = {"a": np.arange(10) < 3, "b": np.arange(10) < 4}
    found = by_law(ranks(scores, shares=True))
    assert {law: rank.mean for law, rank in found.items()} == {"a": 1.0, "b": 2.0}


def test_a_law_that_fails_less_often_comes_first_whatever_its_median():
    scores = {"never_fails": [5.0] * 4, "fails": [1.0, 1.0, 1.0, INF], "also": [1.0, 2.0, 3.0, INF]}
    found = ranks(scores)
    assert [(rank.law, rank.place) for rank in found] == [
        ("never_fails", 1),
        ("fails", 2),
        ("also", 3),
    ]
    assert [rank.best for rank in found] == [True, False, False]


def test_the_least_relevant_difference_is_a_share_and_values_below_the_floor_are_equal():
    assert exceeds([1.04, 1.02, INF, INF, 1.0], [1.0, 1.0, 1.0, INF, INF]).tolist() == [
        True,
        False,
        True,
        False,
        False,
    ]
    assert exceeds(1.04, 1.0, 0.5)
    assert not exceeds(1.04, 1.0, 0.5, relevant=0.05)
    assert not exceeds(1.04, 0.0, 1.02)
    assert not exceeds(1e-10, 0.0, 1e-9)


def test_the_limit_of_p_values_is_that_of_holms_method():
    p = np.array([0.01, 0.04, 0.03, 0.005])
    # rejects 0.005 and 0.01, at 0.05 / 4 and 0.05 / 3
    assert _holm(p, 0.05) == pytest.approx(0.05 / 2)
    assert _holm(p, 0.2) == pytest.approx(0.2)  # rejects all
    assert _holm(p, 0.001) == pytest.approx(0.001 / 4)


def blocks(*factors: float, seeds: int = 20, seed: int = 0) -> np.ndarray:
    """Starts that vary far more from seed to seed than laws do, times a factor a block: (blocks,
    seeds).
    """
    return np.random.default_rng(seed).lognormal(size=(1, seeds)) * np.array(factors)[:, None]


def test_a_law_better_by_little_in_every_run_wins_although_the_medians_intervals_overlap():
    scores = {"a": blocks(1.0), "b": blocks(1.05)}
    a = interval(scores["a"])
    b = interval(scores["b"])
    assert a.high > b.low
    found = by_law(ranks(scores))
    assert (found["a"].best, found["b"].best) == (True, False)
    effect = Comparison(scores).effect(0, "a", "b")
    assert effect[:3] == pytest.approx((1 / 1.05, 1 / 1.05, 1 / 1.05))
    assert (effect.ahead, effect.samples, effect.sets) == (20, 20, False)
    # the same, unpaired
    shuffled = {"a": blocks(1.0), "b": np.random.default_rng(1).permutation(blocks(1.05)[0])}
    assert all(rank.best for rank in ranks(shuffled))


@pytest.mark.parametrize(
    ("factor", "relevant", "wins"), [(1.02, 0.03, False), (1.04, 0.03, True), (1.04, 0.05, False)]
)
def test_less_than_the_least_relevant_difference_is_a_tie_however_sure_it_is(
    factor, relevant, wins
):
    found = Comparison({"a": blocks(1.0), "b": blocks(factor)}, relevant=relevant)
    assert found.best == [("a",) if wins else ("a", "b")]
    assert (1 - 1 / factor > relevant) == wins
    floored = Comparison(
        {"a": blocks(1.0), "b": blocks(factor)}, floors=blocks(1.0).max(), relevant=relevant
    )
    assert floored.best == [("a", "b")]


def test_a_law_that_is_always_last_does_not_hide_that_another_is_beaten():
    scores = {"a": blocks(1.0), "b": blocks(1.1), "z": blocks(9.0), "never": blocks(INF)}
    assert Comparison({law: scores[law] for law in "ab"}).best == [("a",)]
    assert Comparison(scores).best == [("a",)]


@pytest.mark.parametrize(("seeds", "wins"), [(1, False), (6, False), (7, True)])
def test_two_conditions_need_seven_seeds_as_the_least_p_is_two_to_the_one_minus_n(seeds, wins):
    board = leaderboard(
        stand({"a": blocks(1, 2, seeds=seeds), "b": blocks(2, 4, seeds=seeds)}), ["itae"]
    )[0]
    assert board.winner == ("a" if wins else None)
    assert ("too few" in board.result) != wins


def spreading(
    laws: int, conditions: int, spread: float, rng: np.random.Generator, tails: bool = False
):
    """Equal laws of 24 runs, whose own gain sets spread their scores; conditions share the gains,
    laws the starts.
    """
    size = (laws, 1, 24)
    if tails:
        own = rng.standard_t(1.5, size=size)
    else:
        own = rng.normal(size=size)
    start = rng.normal(scale=0.1, size=(1, conditions, 24))
    return np.exp(spread * own + start + rng.normal(scale=0.01, size=(laws, conditions, 24)))


@pytest.mark.slow
def test_two_laws_apart_by_the_least_relevant_difference_have_a_false_winner_in_at_most_five_percent():
    """The worst case of the hypothesis: a lead that just does not matter, and a third law far
    behind.
    """
    rng = np.random.default_rng(1)
    wrong = 0
    runs = 800
    for _ in range(runs):
        a, b, c = spreading(3, 1, 0.15, rng, tails=True)
        wrong += any(Comparison({"a": (1 - RELEVANT) * a, "b": b, "c": 9 * c}).winners)
    assert stats.binomtest(wrong, runs, 0.05, alternative="greater").pvalue > 1e-3
    assert wrong > 0.01 * runs  # the test is not idle: one of its two sides is exact


@pytest.mark.slow
def test_a_lead_of_ten_percent_over_ten_laws_is_seen_with_a_probability_of_eighty_percent():
    rng = np.random.default_rng(0)
    seen = 0
    runs = 100
    for _ in range(runs):
        cells = spreading(11, 5, 0.05, rng)
        cells[0] *= 0.9
        seen += Comparison({f"law{i}": own for i, own in enumerate(cells)}).winners[0] == "law0"
    assert seen / runs >= 0.8


def test_a_winner_is_one_whose_intervals_of_the_ratio_end_beyond_the_least_relevant_difference():
    rng = np.random.default_rng(2)
    named = 0
    for _ in range(100):
        cells = spreading(3, 2, 0.1, rng)
        cells[0] *= rng.choice([0.8, 0.9, 1.0])
        found = Comparison({f"law{i}": own for i, own in enumerate(cells)})
        for block, winner in enumerate(found.winners):
            for law in found.laws:
                rivals = [found.effect(block, law, rival) for rival in found.laws if rival != law]
                beyond = all(effect.high < 1 - RELEVANT for effect in rivals)
                assert (law == winner) == beyond
                assert all(effect.low <= effect.value <= effect.high for effect in rivals)
            named += winner is not None
    assert 30 < named < 130


@pytest.mark.parametrize("sets", [np.arange(24) % 3, np.arange(24) // 8])
def test_three_sets_of_gains_are_three_samples_whatever_the_seeds(sets):
    scores = {"a": blocks(1.0, seeds=24), "b": blocks(2.0, seeds=24)}
    found = Comparison(scores, sets={"a": sets[None], "b": 10 + sets[None]})
    assert found.samples[0, 0, 1] == 3
    assert found.winners == [None]
    one = Comparison(scores, sets={"a": np.zeros((1, 24), int), "b": np.zeros((1, 24), int)})
    each = Comparison(scores, sets={"a": np.arange(24)[None], "b": np.arange(24)[None]})
    paper = Comparison(scores, sets={"a": np.arange(24)[None], "b": np.zeros((1, 24), int)})
    assert [(c.samples[0, 0, 1], c.winners) for c in (one, each, paper)] == [(24, ["a"])] * 3
    assert [c.effect(0, "a", "b").sets for c in (one, each, paper)] == [False, True, True]


def test_a_law_that_is_unbeaten_only_as_its_sets_are_few_is_not_among_the_best():
    """Ten times worse than two others, with three sets of gains in place of 24: no test could
    tell.
    """
    rng = np.random.default_rng(5)
    scores = {}
    for law, size in (("a", 1.0), ("b", 1.2), ("c", 10.0)):
        scores[law] = size * np.exp(rng.normal(0.0, 0.01, 24))
    own = np.arange(24)
    few = np.arange(24) % 3
    found = Comparison(scores, sets={"a": own, "b": own, "c": few})
    assert found.beaten[:, 0].tolist() == [False, True, False]
    assert found.undecided[:, 0].tolist() == [False, False, True]
    assert found.best == [("a",)]
    assert [rank.best for rank in places(found)] == [True, False, False]
    assert not Comparison(scores, sets={"a": own, "b": own, "c": own}).undecided.any()
    assert Comparison(
        scores | {"c": 1.01 * scores["a"]}, sets={"a": own, "b": own, "c": few}
    ).best == [("a", "c")]


def test_runs_linked_by_sets_of_gains_of_either_law_are_one_sample():
    scores = {"a": blocks(1.0, seeds=12), "b": blocks(2.0, seeds=12)}
    # 0001 1122: the second set of a is linked to both of b
    a, b = np.arange(12) // 4, np.arange(12) // 6
    assert Comparison(scores, sets={"a": a[None], "b": b[None]}).samples[0, 0, 1] == 1
    assert Comparison(scores, sets={"a": a[None], "b": a[None]}).samples[0, 0, 1] == 3
    assert linked(*np.array([[5, 5, 7, 7], [5, -1, 7, 8]])) == (0, 0, 1, 1)
    assert linked(*np.array([[5, 5, -1, 5]])) is None


def test_the_difference_of_a_sample_is_the_median_of_its_runs():
    a = np.ones((1, 9))
    b = np.array([[1.1, 1.2, 9.0, 1.0, 1.3, INF, 2.0, 3.0, 1.0]])
    found = Comparison(
        {"a": a, "b": b}, sets={"a": np.arange(9)[None] // 3, "b": np.zeros((1, 9), int)}
    )
    assert np.exp(found.leads[0, 0, 1, :3]) == pytest.approx([1.2, 1.3, 2.0])
    assert np.exp(-found.leads[0, 1, 0, :3]) == pytest.approx([1.2, 1.3, 2.0])
    assert np.isnan(found.leads[0, 0, 1, 3:]).all()


def test_intervals_of_medians_have_sets_of_gains_as_samples():
    sets = np.arange(24) % 3
    rng = np.random.default_rng(0)
    values = np.exp(0.5 * sets + 0.01 * rng.normal(size=24))[None]
    three = median_of(values, linked(sets))
    runs = median_of(values)
    assert (three.n, runs.n) == (3, 24)
    assert three.low < 1.1  # the whole range of the sets
    assert three.high > 2.6
    assert runs.low > three.low or runs.high < three.high


def test_a_law_that_fails_wins_nothing_and_is_not_better_than_one_that_does_not():
    failing = blocks(0.5, seeds=24)
    failing[0, 3] = INF
    board = leaderboard(stand({"a": failing, "b": blocks(1.0, seeds=24)}), ["itae"])[0]
    assert (board.winner, board.best) == (None, ("b",))
    assert [entry.law for entry in board.entries] == ["b", "a"]
    assert [board.failures(entry) for entry in board.entries] == ["", "1 of 24 failed"]
    assert "1 of 24 failed" in " ".join(printed([board]).split())
    both = leaderboard(stand({"a": failing, "b": 2 * failing}), ["itae"])[0]
    assert (both.winner, both.best, both.result) == (
        None,
        (),
        "no winner: every law has runs that fail",
    )


def test_the_verdict_on_a_block_does_not_depend_on_how_runs_are_grouped_into_boards():
    rng = np.random.default_rng(4)
    for _ in range(8):
        cells = spreading(3, 4, 0.08, rng)
        cells[0] *= np.array([0.85, 0.9, 0.95, 1.0])[:, None]
        table = stand({f"law{i}": own for i, own in enumerate(cells)})
        parts = [leaderboard(table, ["itae"], by) for by in (("plant",), ("plant", "condition"))]
        winners = [[block.winner for board in boards for block in board.blocks] for boards in parts]
        assert winners[0] == winners[1]
        assert {board.family for boards in parts for board in boards} == {4}


def test_laws_that_do_the_same_are_never_separated():
    scores = np.random.default_rng(0).lognormal(size=(4, 30))
    for rank in ranks({"a": scores, "b": scores.copy(), "c": scores.copy()}):
        assert (rank.mean, rank.place, rank.best) == (2, 2, True)


# the rule of a winner, of each term


def twelve(*factors: float, spread: float = 0.02, seed: int = 0) -> np.ndarray:
    """Values of 12 units in each block, of their own, (blocks, 12)."""
    return (
        np.exp(spread * np.random.default_rng(seed).normal(size=(len(factors), 12)))
        * np.array(factors)[:, None]
    )


A = twelve(1.0)
B = twelve(2.0, seed=1)
SOME = np.where(np.arange(12) % 4 == 0, 1.0, math.nan)  # one run in four is repeated
WINS = [  # what a law and a rival with twice its values have besides, who wins, and the rule
    ({"halves": {"a": A, "b": B}}, "a", "half the step changes nothing"),
    ({"halves": {"a": 3.0 * A, "b": B}}, None, "what half the step gives is charged to the law"),
    ({"halves": {"a": A, "b": 0.4 * B}}, None, "and counts for the rival"),
    (
        {"halves": {"a": 0.1 * A, "b": 9.0 * B}},
        "a",
        "but neither spares the law nor is charged to the rival",
    ),
    (
        {"halves": {"a": 1.3 * SOME * A, "b": SOME * B}},
        "a",
        "the median change widens runs that are not repeated",
    ),
    ({"halves": {"a": 3.0 * SOME * A, "b": SOME * B}}, None, "up"),
    ({"halves": {"a": SOME * A / 3.0, "b": SOME * B}}, None, "and down"),
    # 0.86^5 is 0.47: the rival would be where the law is after as much time again
    (
        {"trends": {"a": np.ones((1, 12)), "b": np.full((1, 12), 0.86)}},
        None,
        "a falling rival is charged",
    ),
    (
        {"trends": {"a": np.ones((1, 12)), "b": np.full((1, 12), 0.98)}},
        "a",
        "two percent are no trend",
    ),
    (
        {"trends": {"a": np.ones((1, 12)), "b": np.full((1, 12), 2.0)}},
        "a",
        "a rising rival gains nothing",
    ),
    (
        {"trends": {"a": np.full((1, 12), 1.16), "b": np.ones((1, 12))}},
        None,
        "a rising law is charged",
    ),
    ({"trends": {"a": np.full((1, 12), 0.5), "b": np.ones((1, 12))}}, "a", "a falling one is not"),
    ({"floors": 0.0}, "a", "without a floor any size counts"),
    ({"floors": 1e3}, None, "values below what the problem can show win nothing"),
    ({"floors": 1.3}, "a", "a law below it beats a rival beyond it"),
]


@pytest.mark.parametrize(("given", "winner", "rule"), WINS, ids=[row[-1] for row in WINS])
def test_the_winner_by_the_rule(given, winner, rule):
    assert Comparison({"a": A, "b": B}, **given).winners == [winner], rule


def test_a_law_that_grows_more_accurate_never_loses_its_win():
    rng = np.random.default_rng(0)
    for _ in range(300):
        cells = {law: np.exp(rng.normal(scale=0.3, size=(1, 12))) for law in "ab"}
        cells["a"] *= 0.7
        halves = {}
        for law, y in cells.items():
            halves[law] = np.where(
                rng.random((1, 12)) < 0.5, y * np.exp(0.1 * rng.normal(size=(1, 12))), math.nan
            )
        trends = {law: np.exp(0.05 * rng.normal(size=(1, 12))) for law in "ab"}

        def p(cells, halves=halves, trends=trends, floor=0.2):
            return Comparison(cells, floor, halves=halves, trends=trends).p[0, 0, 1]

        before = p(cells)
        runs = rng.random((1, 12)) < 0.4
        lower = np.where(runs, rng.choice([0.9, 1e-3, 0.0]), 1.0)
        both = {law: np.all(np.isnan(y)) for law, y in halves.items()}
        assert (
            p(cells | {"a": cells["a"] * lower}, halves | {"a": halves["a"] * lower}) <= before
        ), both
        assert p(cells, halves, trends | {"a": trends["a"] * lower}) <= before
        raised = np.where(lower < 1.0, 1.0 / np.maximum(lower, 1e-3), 1.0)
        assert p(cells | {"b": cells["b"] * raised}, halves | {"b": halves["b"] * raised}) <= before


def test_units_cancel():
    rng = np.random.default_rng(1)
    for _ in range(100):
        cells = {law: np.exp(rng.normal(size=(2, 12))) for law in "abc"}
        one = Comparison(cells, 0.3)
        other = Comparison({law: 1e3 * y for law, y in cells.items()}, 300.0)
        assert one.p == pytest.approx(other.p, abs=1e-12)
        assert one.winners == other.winners


@pytest.mark.parametrize(
    ("factor", "floor", "marked"),
    [
        (1.04, 0.0, False),
        (1.06, 0.0, True),
        (0.94, 0.0, True),
        (np.inf, 0.0, True),
        (1.06, 1e3, False),
    ],
)
def test_a_median_that_half_the_step_moves_is_marked_by_the_rule_of_all_numbers(
    factor, floor, marked
):
    cells = {"a": blocks(1.0), "b": blocks(2.0)}
    found = Comparison(cells, floor, halves={"a": factor * cells["a"], "b": cells["b"]})
    middle = float(np.median(cells["a"]))
    assert found.step_change(0, "a") == (
        pytest.approx((middle, factor * middle)) if marked else None
    )
    assert found.step_change(0, "b") is None


@pytest.mark.parametrize(
    ("parts", "marked"), [({}, False), ({"actuator": smc.Backlash(0.01)}, True)]
)
def test_without_rk4_half_of_the_change_is_marked(parts, marked):
    """Of runs under RK4, and under implicitfast: half the step moves a by 3 %."""
    runs = {"a": blocks(1.0), "b": blocks(3.0)}
    halves = []
    for law, of in runs.items():
        for y in of[0]:
            halves.append(json.dumps({"itae": (1.03 if law == "a" else 1.02) * y}))
    ran = run_key.row(paper.scenario("duffing", "none", changes=parts))["scenario"]
    table = stand(runs, half_step=np.array(halves, object), scenario=np.array([ran] * 40))
    ((block,),) = (board.blocks for board in leaderboard(table, ["itae"]))
    assert list(block.by_step) == ["a"] * marked


@pytest.mark.parametrize("repeated", [1, 4])
def test_a_winner_that_becomes_better_in_some_runs_stays_the_winner(repeated):
    """In all runs y, y' or rho fall alone; where one run in four is repeated, y and y' of a run
    fall together.
    """
    rng = np.random.default_rng(7)
    wins = 0
    again = np.arange(12) % repeated == 0
    for _ in range(120):
        cells = {
            law: np.exp(rng.normal(rng.normal(0.0, 0.4, (2, 1)), 0.1, (2, 12))) for law in "abc"
        }
        halves = {}
        for law, y in cells.items():
            halves[law] = np.where(again, y * np.exp(rng.normal(0.0, 0.05, (2, 12))), math.nan)
        trends = {law: np.exp(rng.normal(0.05, 0.05, (2, 12))) for law in cells}
        for block, winner in enumerate(
            Comparison(cells, 0.5, halves=halves, trends=trends).winners
        ):
            if winner is None:
                continue
            less = np.where(
                (rng.random(12) < 0.4) & (np.arange(2) == block)[:, None],
                np.exp(-rng.exponential(1.0)),
                1.0,
            )
            parts = rng.integers(3) if repeated == 1 else 3
            better = []
            for k, of in enumerate((cells, halves, trends)):
                better.append(
                    of | {winner: of[winner] * less} if parts == k or (parts == 3 and k < 2) else of
                )
            assert (
                Comparison(better[0], 0.5, halves=better[1], trends=better[2]).winners[block]
                == winner
            )
            wins += 1
    assert wins > 50


def test_laws_are_level_only_if_an_interval_of_twelve_units_says_so():
    close = {"a": twelve(1.0), "b": twelve(1.0, seed=1)}
    apart = {"a": twelve(1.0), "b": twelve(1.2, seed=1)}
    noisy = {"a": twelve(1.0, spread=0.3), "b": twelve(1.0, spread=0.3, seed=1)}
    assert [Comparison(c).level[0, 0, 1] for c in (close, apart, noisy)] == [True, False, False]
    assert not Comparison({law: y[:, :11] for law, y in close.items()}).level[0, 0, 1]
    effect = Comparison(close).effect(0, "a", "b", winner=False)
    assert 0.9 < effect.low < effect.high < 1 / 0.9


def test_the_least_visible_lead_is_its_formula_and_charges_what_the_step_does():
    leads = np.random.default_rng(2).normal(scale=0.1, size=12)
    s = np.median([abs(a - b) for i, a in enumerate(leads) for b in leads[:i]]) / 0.954
    quantiles = stats.t.isf(0.001, 11) + stats.t.isf(0.2, 11)
    wanted = 1 - 0.97 * math.exp(-quantiles * s * math.sqrt(math.pi / 36))
    assert least_visible_lead(leads, 0.001) == pytest.approx(wanted)
    assert least_visible_lead(leads, 1e-4) == 1.0  # no result of 12 units has so small a p
    cells = {"a": twelve(1.0), "b": twelve(1.0, seed=1)}
    plain = Comparison(cells)
    charged = Comparison(cells, halves={"a": 2.0 * cells["a"], "b": cells["b"]})
    assert 1 - charged.visible(0, "a", "b") == pytest.approx(
        (1 - plain.visible(0, "a", "b")) / 2, rel=0.05
    )


@pytest.mark.slow
@pytest.mark.parametrize(("units", "blocks_of_family"), [(12, 1), (12, 20), (24, 4)])
def test_the_least_visible_lead_is_seen_with_a_probability_of_eighty_percent(
    units, blocks_of_family
):
    rng = np.random.default_rng(units)
    level = 0.025 / blocks_of_family
    seen = 0
    runs = 400
    for _ in range(runs):
        a, b, c, d = np.exp(0.1 * rng.normal(size=(4, units)))
        lead = least_visible_lead(np.log(b / a), level)  # of another sample of the same laws
        limits = Limits(level, level, level)
        seen += Comparison({"a": (1 - lead) * c, "b": d}, limits=limits).winners == ["a"]
    assert 0.72 <= seen / runs <= 0.88


def test_over_several_conditions_only_what_holds_in_each_is_told():
    """a beats b, b beats c and c beats a, each in two of three conditions."""
    scores = {"a": blocks(1, 2, 3), "b": blocks(2, 3, 1), "c": blocks(3, 1, 2)}
    board = leaderboard(stand(scores), ["itae"])[0]
    assert (board.best, board.winner) == ((), None)
    assert board.result == (
        "no winner in all 3 conditions: a wins under c0, loses under c1 and c2; b wins under c2, "
        "loses under c0 and "
        "c1; c wins under c1, loses under c0 and c2, for these gains"
    )
    assert leaderboard(stand({"a": blocks(1, 2), "b": blocks(2, 4)}), ["itae"])[0].result == (
        "a wins in both conditions: at least 50 % less than b (50 to 50 %), ahead in 20 of 20 "
        "runs, for these gains"
    )
    both = leaderboard(stand({"a": blocks(1), "b": blocks(2)}), ["itae"])[0]
    one_set = dataclasses.replace(both.blocks[0], sets=12, given=("b",))
    assert dataclasses.replace(both, blocks=(one_set,)).result.endswith(
        "runs, for these gains of b"
    )
    assert dataclasses.replace(
        both, blocks=(dataclasses.replace(one_set, given=()),)
    ).result.endswith("20 runs")
    level = leaderboard(stand({"a": blocks(1, 2), "b": blocks(1.01, 4)}), ["itae"])[0]
    assert level.result == "no winner in both conditions: a wins under c1, for these gains"
    first = leaderboard(
        stand({"a": blocks(1, 2), "b": blocks(1.01, 4), "c": blocks(4, 2.01)}), ["itae"]
    )[0]
    assert first.result == "no winner, undefeated: a"


# leaderboards


def study(seeds: int = 20, seed: int = 0) -> Stand:
    """Two plants, three laws, two conditions; law c never settles on duffing, and fails in one run
    on van_der_pol.
    """
    rng = np.random.default_rng(seed)
    rows = []
    for plant in ("van_der_pol", "duffing"):
        for condition in ("nominal", "noise"):
            for s in range(seeds):
                start = rng.lognormal()
                rows += [(plant, condition, s, law, start * (1 + i)) for i, law in enumerate("abc")]
    plants, conditions, number, laws, values = (
        np.array(column) for column in zip(*rows, strict=True)
    )
    settling = np.where((plants == "duffing") & (laws == "c"), INF, values)
    failed = (plants == "van_der_pol") & (laws == "c") & (number == 1) & (conditions == "noise")
    metrics = {name: np.where(failed, math.nan, values) for name in METRICS[2:]}
    return Stand(
        plant=plants,
        condition=conditions,
        seed=number,
        law=laws,
        settling_time=np.where(failed, math.nan, settling),
        failure=np.where(failed, "left the world", None),
        diverged_at=np.where(failed, 1.0, math.nan),
        spread_settling_time=np.full(len(rows), math.nan),
        **metrics,
    )


def picked(boards: list[Board], metric: str, **group: str) -> Board:
    (found,) = (b for b in boards if b.metric == metric and b.group == group)
    return found


def test_a_board_for_each_plant_and_metric_with_medians_shares_and_winners():
    table = study()
    boards = leaderboard(table)
    assert [(b.group["plant"], b.metric) for b in boards[:5]] == [
        ("van_der_pol", name) for name in METRICS
    ]
    assert len(boards) == 10
    itae = picked(boards, "itae", plant="duffing")
    assert [entry.law for entry in itae.entries] == ["a", "b", "c"]
    rows = (table.column("plant") == "duffing") & (table.column("law") == "b")
    each = []
    for c in ("nominal", "noise"):
        each.append(np.median(table.column("itae")[rows & (table.column("condition") == c)]))
    assert itae.entries[1].interval.median == np.median(each)
    assert [block.medians["b"] for block in itae.blocks] == each
    assert (itae.winner, [(block.runs, block.seeds) for block in itae.blocks]) == (
        "a",
        [(20, 20)] * 2,
    )
    start = (
        "ITAE on duffing under nominal and noise: a wins in both conditions: at least 50 % "
        "less than b"
    )
    assert itae.verdict.startswith(start)
    assert itae.unit == "{x} s^2"
    settles = picked(boards, "settles", plant="duffing")
    assert [entry.interval.median for entry in settles.entries] == [1.0, 1.0, 0.0]
    assert settles.result == "no winner, undefeated: a and b; level within 10 %"
    assert by_law(picked(boards, "settling_time", plant="duffing").entries)["c"].interval[:3] == (
        INF,
        INF,
        INF,
    )
    failing = by_law(picked(boards, "settles", plant="van_der_pol").entries)["c"]
    assert failing.interval.median == 39 / 40


def test_the_order_of_rows_and_the_names_of_laws_change_nothing():
    table = study()
    boards = leaderboard(table)
    shuffled = leaderboard(table.taken(np.random.default_rng(1).permutation(240)))
    for board in boards:
        assert picked(shuffled, board.metric, **board.group) == board
    names = {"a": "z", "b": "y", "c": "x"}
    renamed = table.taken(slice(None))
    renamed.columns["law"] = np.array([names[law] for law in table.column("law")])
    for before, after in zip(boards, leaderboard(renamed), strict=True):
        old = by_law(before.entries)
        new = by_law(after.entries)
        for law, name in names.items():
            assert new[name].interval == old[law].interval
            assert new[name].rank.mean == pytest.approx(old[law].rank.mean)
            assert new[name].rank.best == old[law].rank.best
            assert new[name].rank.place == old[law].rank.place


def test_only_runs_that_all_laws_have_are_compared():
    table = study()
    lacking = (
        (table.column("law") == "b")
        & (table.column("seed") == 3)
        & (table.column("condition") == "noise")
    )
    boards = leaderboard(table.taken(~lacking), ["itae"])
    assert [[block.runs for block in board.blocks] for board in boards] == [[20, 19]] * 2
    assert {entry.interval.n for entry in boards[0].entries} == {20}
    without = leaderboard(
        table.taken((table.column("law") != "b") | (table.column("seed") != 3)), ["itae"]
    )
    assert [[block.runs for block in board.blocks] for board in without] == [[19, 19]] * 2


def test_a_metric_that_does_not_apply_has_no_board():
    assert leaderboard(study(), ["spread_settling_time"]) == []
    assert [b.metric for b in leaderboard(study(), ["spread_settling_time", "itae"])] == [
        "itae",
        "itae",
    ]


def test_what_cannot_be_compared_is_refused(refused):
    table = study()
    first = (table.column("law") == "a") == (table.column("condition") == "nominal")
    for bad, options in (
        (table.taken(slice(0, 0)), {}),
        (table, {"metrics": ["speed"]}),
        (table, {"metrics": ()}),
        (table, {"by": ("law",)}),
        (table, {"by": ()}),
        (table.taken(np.r_[0:240, 0]), {}),
        (table.taken(first), {}),
    ):
        refused(lambda bad=bad, options=options: leaderboard(bad, **options))


def printed(boards: list[Board], width: int = 100) -> str:
    return plain(Boards(boards), width)


def test_a_leaderboard_breaks_no_number_at_80_columns():
    # two by two they are tied
    factors = []
    for i in range(6):
        for near in (1.0, 1.01):
            factors.append(1.2345e-5 * 2**i * near)
    names = ["observer_free_adaptive", *(f"law{i}" for i in range(11))]
    scores = dict(zip(names, blocks(*factors)[:, None], strict=True))
    values = np.concatenate([own[0] for own in scores.values()])
    others = dict.fromkeys(("settling_time", "ultimate_bound", "tv_rate"), values)
    boards = leaderboard(stand(scores, **others), METRICS)
    narrow, wide = (printed(boards, width=width) for width in (80, 300))
    assert max(map(len, narrow.splitlines())) <= 80
    assert sorted(re.findall(r"[0-9.e-]+", narrow)) == sorted(re.findall(r"[0-9.e-]+", wide))


# what a verdict may say


def checked(boards: list[Board]) -> int:
    """How many winners boards name, each of them confirmed by the numbers that the board shows."""
    named = 0
    for board in boards:
        for block in board.blocks:
            if block.winner:
                assert block.best == (block.winner,)
                assert block.lacking[block.winner] == 0
                if block.lead:
                    assert block.lead.law == block.winner
                    assert block.lead.effect.high < 1 - RELEVANT
                named += 1
            assert not any(block.lacking[law] for law in block.best)
        if board.winner:
            (first,) = (entry for entry in board.entries if entry.law == board.winner)
            assert first.failed == 0
            assert set(board.wins(board.winner)) == {block.condition for block in board.blocks}
        for entry in board.entries:
            assert not set(board.wins(entry.law)) & set(board.losses(entry.law))
            told = all(entry.law not in block.undecided for block in board.blocks)
            assert entry.rank.best == (
                told and not board.losses(entry.law) and not board.fails(entry.law)
            )
    return named


STIFF = smc.plant("duffing", beta=5.0)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"starts": smc.starts(x0=1.0)}, "x0 of classical and pid differ"),
        ({"duration": 2.0}, "duration of classical and pid differ"),
        ({"plants": STIFF}, "plant of classical and pid differ"),
        (
            {"conditions": smc.condition("worn", friction=smc.Coulomb(0.2))},
            "friction of classical and pid differ",
        ),
    ],
)
def test_runs_that_differ_in_more_than_the_law_are_not_compared(changed, words):
    given = {
        "plants": "duffing",
        "conditions": smc.condition("worn", friction=smc.Coulomb(0.05)),
        "duration": 1.0,
    }
    given |= {"gains": "default"}
    for law, fields, refused in (("pid", {}, False), ("pid", changed, True)):
        runs = smc.grid(**(given | {"laws": "classical"})) + smc.grid(
            **(given | fields | {"laws": law})
        )
        rows = [run_key.row(s) for s in runs]
        names = ("plant", "law", "condition", "seed", "scenario")
        table = Stand(**{name: [row[name] for row in rows] for name in names}, itae=[1.0, 2.0])
        with pytest.raises(ScenarioError, match=words) if refused else contextlib.nullcontext():
            leaderboard(table, ["itae"])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0])
def test_no_random_table_has_a_verdict_that_contradicts_it(seed):
    rng = np.random.default_rng(seed)
    named = 0
    for _ in range(12):
        laws = rng.integers(2, 7)
        conditions = rng.integers(1, 5)
        seeds = rng.integers(14, 26)
        common = rng.lognormal(size=(1, 1, seeds))
        values = common * rng.lognormal(
            sigma=rng.choice([0.01, 0.2, 1.0]), size=(laws, conditions, seeds)
        )
        values *= rng.choice([0.2, 1.0, 1.02, 1.05, 2.0], size=(laws, conditions, 1))
        values = np.where(rng.random(values.shape) < rng.choice([0.0, 0.0, 0.2]), INF, values)
        if rng.random() < 0.3:
            values = np.ceil(4 * values) / 4  # ties
        table = stand({f"law{i}": v for i, v in enumerate(values)}, settling_time=values.ravel())
        named += checked(leaderboard(table, ["itae", "settles", "settling_time"]))
        named += checked(leaderboard(table, ["itae"], by=("plant", "condition")))
    assert named > 5


def test_a_seed_is_a_sample_of_two_laws_if_it_changes_one():
    still = np.ones((1, 20))
    moved = blocks(2.0)
    (board,) = leaderboard(stand({"a": still, "b": moved}), ["itae"])
    assert (board.blocks[0].runs, board.winner) == (20, "a")
    other = stand({"a": still, "b": 2 * still}, tv_rate=np.tile(np.arange(20.0), 2))
    assert leaderboard(other, ["itae"])[0].blocks[0].runs == 20


def test_a_seed_that_changes_a_third_law_is_no_sample_of_two():
    still = np.ones((1, 20))
    moved = blocks(2.0)
    (board,) = leaderboard(stand({"a": moved, "b": 0.01 * still, "c": 0.02 * still}), ["itae"])
    (block,) = board.blocks
    assert (block.runs, block.samples) == (20, 20)
    assert (block.best, block.undecided, board.winner, board.losses("a")) == (
        ("b",),
        ("c",),
        None,
        ["c0"],
    )
    assert board.result == "no winner, undefeated: b; too few samples to tell whether c is beaten"


@pytest.mark.parametrize("laws", ["ab", "abc"])
def test_of_equal_laws_none_is_called_undefeated_because_runs_of_another_fail(laws):
    """A run in ten fails by chance.

    A law is defeated only where a test says that another is better.
    """
    draws = np.random.default_rng(3)
    undefeated = 0
    for _ in range(40):
        scores = {name: draws.lognormal(sigma=0.1, size=(1, 12)) for name in laws}
        for values in scores.values():
            values[draws.random(values.shape) < 0.1] = INF
        undefeated += "undefeated" in leaderboard(stand(scores), ["itae"])[0].result
    assert undefeated <= 4
    one = blocks(1.0), blocks(1.0)
    one[1][0, 3] = INF
    (board,) = leaderboard(stand({"a": one[0], "b": one[1]}), ["itae"])
    assert (
        board.result
        == "no winner, none beaten; b has runs that fail, too few to tell whether it is beaten"
    )
    assert (board.fails("b"), board.losses("b")) == (["c0"], [])
    one[1][0, 3:] = INF
    assert leaderboard(stand({"a": one[0], "b": one[1]}), ["itae"])[0].result.startswith("a wins")


def test_compare_counts_distinct_runs_of_each_pair():
    low, high = blocks(1.0, 2.0, seeds=20)
    did = {"a": np.arange(20), "b": np.arange(20) // 2, "c": np.arange(20) % 2}
    found = Comparison(
        {"a": low, "b": high, "c": 2 * high}, outcomes={law: own[None] for law, own in did.items()}
    )
    assert found.samples[0].tolist() == [[0, 20, 20], [20, 0, 20], [20, 20, 0]]
    found = Comparison({"a": low, "b": high, "c": 2 * high}, outcomes=did | {"a": did["b"]})
    assert found.samples[0, 0, 1] == found.samples[0, 1, 0] == 10
    assert found.p[0, 0, 2] == found.p[0, 1, 2] < found.p[0, 0, 1] == pytest.approx(0.5**10)


def test_one_condition_without_randomness_is_one_sample_beside_others():
    (a, b), (one,) = blocks(1.0, 2.0, seeds=20), np.full((1, 20), 1.0)
    table = stand({"a": np.stack([a, one]), "b": np.stack([b, 2 * one])})
    (board,) = leaderboard(table, ["itae"])
    assert [(block.seeds, block.runs, block.winner) for block in board.blocks] == [
        (20, 20, "a"),
        (20, 1, None),
    ]
    text = " ".join(printed([board]).split())
    assert "20 seeds, 1 distinct run" in text
    assert board.result == "no winner in both conditions: a wins under c0, for these gains"


def test_seeds_that_change_rounding_alone_are_one_sample():
    values = 1.0 + 1e-12 * np.arange(20.0)
    (board,) = leaderboard(stand({"a": values[None], "b": 2 * values[None]}), ["itae"])
    assert (
        board.result
        == "no winner: 20 seeds, 1 distinct run, too few: most seeds change nothing here"
    )
    apart = 1.0 + 1e-5 * np.arange(20.0)
    assert (
        leaderboard(stand({"a": apart[None], "b": 2 * apart[None]}), ["itae"])[0].blocks[0].runs
        == 20
    )


def test_a_block_without_randomness_is_in_every_resample():
    (one,), nothing = blocks(1.0, seeds=20), [math.nan] * 19
    both = median_of(np.stack([one, [5.0, *nothing]]))
    alone = median_of(one[None])
    assert both[:3] == pytest.approx([(5.0 + end) / 2 for end in alone[:3]])


def test_positions_are_told_apart_as_far_as_the_sensor_of_the_condition_resolves_them():
    fine = paper.scenario("duffing", "none")  # x0 1.5 m
    coarse = paper.scenario("duffing", "none", changes={"sensor": smc.Encoder(counts=50)})
    noisy = paper.scenario("duffing", "none", changes={"noise": smc.Noise(position=0.02)})
    assert [cells.floor(one, "ultimate_bound") for one in (fine, coarse, noisy)] == pytest.approx(
        [1.5e-4, 0.01, 0.02]
    )
    assert [cells.floor(noisy, name) for name in ("rms_error", "iae", "itae")] == pytest.approx(
        [1.5e-4, 1.5e-3, 7.5e-3]
    )
    assert cells.floor(noisy, "overshoot") == pytest.approx(100 * 0.02 / 1.5)
    assert cells.floor(noisy, "settling_time") == 1e-3  # s, a control period
    assert cells.floor(paper.scenario("duffing", "none", changes={"x0": 0.0}), "overshoot") == 0.0
    assert cells.floor(noisy, "ultimate_bound", eps=0.0) == 0.02
    high = smc.Scenario(plant="quadrotor", law="none", x0=(0.3, 0.0, 1.1, 0.0, 0.0, 0.2))
    # of the way to rest, which is at 1 m
    assert cells.floor(high, "ultimate_bound") == pytest.approx(3e-5)
    # |u| <= 6 N
    assert [cells.floor(fine, name) for name in ("max_u", "tv_rate")] == pytest.approx([6e-3, 6e-3])
    unbounded = paper.scenario("duffing", "none", changes={"u_max": math.inf})
    assert cells.floor(unbounded, "tv_rate") == 0.0
    table = stand({"a": blocks(1e-3), "b": blocks(2e-3)}, metric="ultimate_bound")
    table.columns["scenario"] = np.array([run_key.row(fine)["scenario"]] * 40)
    assert leaderboard(table, ["ultimate_bound"])[0].winner == "a"
    # the smallest difference that this problem shows is 1.5e-4
    for near, small in (1.1e-3, True), (1.5e-3, False):
        close = stand({"a": blocks(1e-3, 1e-3), "b": blocks(near, 2e-3)}, metric="ultimate_bound")
        close.columns["scenario"] = np.array(
            [run_key.row(fine)["scenario"]] * len(close.columns["seed"])
        )
        (board,) = leaderboard(close, ["ultimate_bound"])
        assert board.winner == "a"
        assert ("by less than the problem can show" in board.result) == small
        assert (
            "'by less than the problem can show'" in " ".join(printed([board]).split())
        ) == small
    table.columns["scenario"] = np.array([run_key.row(noisy)["scenario"]] * 40)
    (board,) = leaderboard(table, ["ultimate_bound"])
    assert board.result == "no winner: both laws are level within 10 %"
    assert "up to 0.0200 rad or m of a position" in " ".join(printed([board]).split())


def test_a_law_is_not_marked_where_no_lead_would_have_been_seen():
    """Twelve runs are enough for a winner, but these spread over more than any lead."""
    for spread, marked in ((0.01, True), (20.0, False)):
        cells = {}
        for i, law in enumerate("ab"):
            cells[law] = np.exp(spread * np.random.default_rng(i).normal(size=(1, 20)))
        (board,) = leaderboard(stand(cells), ["itae"])
        assert (board.too_few, set(board.best)) == ("", {"a", "b"})
        assert ("*" in printed([board])) == marked
        assert ("sees no lead" in printed([board])) != marked


# a metric of each family: a time, an error of the last part, an integral, a command, and a cycle
# that runs may not have
@pytest.mark.parametrize(
    "metric", ["settling_time", "ultimate_bound", "itae", "tv_rate", "chattering_amplitude"]
)
def test_a_median_that_half_the_step_moves_by_more_than_five_percent_is_marked_on_boards(
    metric,
):
    runs = {"a": blocks(1.0), "b": blocks(3.0), "c": blocks(9.0)}
    changes = {"a": 1.06, "b": 1.04, "c": 0.9}
    halves = [
        json.dumps({metric: changes[law] * y})
        for law, of in runs.items()
        for y in of.ravel().tolist()
    ]
    table = stand(runs, metric=metric, half_step=np.array(halves, object))
    (board,) = leaderboard(table, [metric])
    (of_board,) = board.tables
    alarms = {law.text: cell.alarm for law, cell, *_ in of_board.rows}
    middles = {law: float(np.median(runs[law])) for law in changes}
    pairs = {law: (y, changes[law] * y) for law, y in middles.items()}
    said = {
        law: " to ".join(boards_of.size(y, metric) for y in pair) + " by the step"
        for law, pair in pairs.items()
    }
    assert alarms == {"a": said["a"], "b": "", "c": said["c"]}
    assert "'by the step': the medians" in " ".join(printed([board]).split())


def test_boards_say_where_no_run_was_compared_with_half_its_step(tmp_path):
    said = {}
    for condition in ("nominal", "backlash"):
        runs = grid("duffing", ["classical", "twisting"], condition, 1, duration=0.5)
        boards = leaderboard(
            run_study(runs, tmp_path / condition), ["itae", "chattering_amplitude"]
        )
        said[condition] = (
            [board.by_step for board in boards],
            "half the physics step" in " ".join(str(boards).split()),
        )
    assert said == {"nominal": ([False, False], False), "backlash": ([True, True], True)}


def test_a_law_that_fails_more_often_does_not_tie():
    failing = np.r_[np.full(7, np.inf), np.full(9, 0.5)]
    assert Comparison({"fails": failing, "works": np.linspace(0.9, 1.1, 16)}).best == [("works",)]
    found = Comparison({"fails": np.where(np.isinf(failing), np.inf, 1.0), "works": np.ones(16)})
    assert not found.tied[0, 1]


def test_a_block_without_a_test_is_decided_by_the_least_relevant_difference_and_is_in_no_family():
    tested = {
        "a": np.linspace(1.0, 1.1, 16),
        "b": np.linspace(1.2, 1.3, 16),
        "c": np.linspace(1.0, 1.1, 16),
    }
    alone = {"a": [1.0], "b": [1.02], "c": [1.04]}
    scores = {law: np.full((2, 16), math.nan) for law in tested}
    for law, rows in scores.items():
        rows[0], rows[1, :1] = tested[law], alone[law]
    found = Comparison(scores, untested=[False, True])
    assert found.limits == Comparison(tested).limits
    better = [(found.laws[i], found.laws[k]) for i, k in np.argwhere(found.better[1])]
    assert better == [("a", "c")]  # 3 % of the larger value are relevant
    assert Comparison(alone, untested=True).better.sum() == 1
    assert not Comparison(alone).better.any()
