"""Winners: medians, ranks and intervals by hand, the rule of a winner term by term, and how often
it errs.
"""

import dataclasses
import math

import numpy as np
import pytest
from helpers.tables import MadeTable, table_of
from scipy import stats

import smc_mujoco as smc
from smc_mujoco.analysis import paired_runs
from smc_mujoco.analysis.bootstrap import Interval, median_of, share_interval
from smc_mujoco.analysis.ranking import (
    RELEVANT,
    Comparison,
    exceeds,
    holm,
    linked,
    ranks,
)
from smc_mujoco.analysis.signed_rank import least_visible_lead
from smc_mujoco.answers.facts import Barred, Lead, Open, Tied
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.simulation import gaber_study as paper
from smc_mujoco.simulation import run_key
from smc_mujoco.studies.leaderboard import METRICS, leaderboard

INF = math.inf
NAN = math.nan


def mean_ranks(scores, **options) -> dict[str, float]:
    return {rank.law: rank.mean for rank in ranks(Comparison(scores, **options))}


def interval(values) -> Interval:
    """The interval of values (n,) in any order, or of (blocks, n), drawn together."""
    rows = np.atleast_2d(np.asarray(values, float))
    return median_of(np.sort(rows) if len(rows) == 1 else rows)


def blocks(*factors: float, seeds: int = 20, seed: int = 0) -> np.ndarray:
    """Starts that vary far more from seed to seed than laws do, times a factor a block: (blocks,
    seeds).
    """
    starts = np.random.default_rng(seed).lognormal(size=(1, seeds))
    return starts * np.array(factors)[:, None]


def twelve(factor: float, spread: float = 0.02, seed: int = 0) -> np.ndarray:
    """Values of 12 units, (1, 12)."""
    return factor * np.exp(spread * np.random.default_rng(seed).normal(size=(1, 12)))


def spreading(laws: int, conditions: int, spread: float, rng, tails: bool = False):
    """Equal laws of 24 runs, whose own gain sets spread their scores; conditions share the gains,
    laws the starts.
    """
    size = laws, 1, 24
    if tails:
        own = rng.standard_t(1.5, size=size)
    else:
        own = rng.normal(size=size)
    start = rng.normal(scale=0.1, size=(1, conditions, 24))
    return np.exp(spread * own + start + rng.normal(scale=0.01, size=(laws, conditions, 24)))


# medians


MEDIANS = [
    ([3.0, 1.0, 2.0], (2.0, 1.0, 3.0, 3)),
    ([4.0, 1.0, 2.0, 3.0], (2.5, 1.0, 4.0, 4)),
    ([1, 2, 3, 4, INF, INF, INF], (4.0, 1.0, INF, 7)),  # never is the worst
    ([INF] * 9, (INF, INF, INF, 9)),
    ([2.5] * 6, (2.5, 2.5, 2.5, 6)),
    ([2.5], (2.5, NAN, NAN, 1)),
    ([[1.0], [4.0]], (2.5, NAN, NAN, 1)),
]


@pytest.mark.quick
@pytest.mark.parametrize(("values", "wanted"), MEDIANS)
def test_an_interval_by_hand(values, wanted):
    assert interval(values) == pytest.approx(wanted, nan_ok=True)


@pytest.mark.parametrize(
    ("n", "low", "high"),
    [
        (5, 1, 5),
        (7, 1, 7),
        (10, 2, 9),
        (20, 6, 15),
    ],
)
def test_the_ends_are_the_order_statistics_that_the_binomial_distribution_gives(n, low, high):
    """P*(median* <= x_(j)) = P(Bin(n, j / n) >= n / 2), Efron 1979; against the expanded
    percentile.
    """
    tail = stats.norm.cdf(-math.sqrt(n / (n - 1)) * stats.t.ppf(0.975, n - 1))
    below = []
    for j in range(1, n + 1):
        below.append(stats.binom.sf(math.ceil(n / 2) - 1, n, j / n))
    assert 1 + np.argmax(np.array(below) >= tail) == low
    assert interval(np.arange(1.0, n + 1))[1:3] == (low, high)


@pytest.mark.slow
def test_blocks_are_drawn_by_seed_and_so_the_interval_covers_where_that_of_pooled_runs_does_not():
    rng = np.random.default_rng(0)
    covered = np.zeros(2)
    for _ in range(300):
        # the seed decides; median 0
        values = rng.normal(size=(1, 12)) + 0.1 * rng.normal(size=(8, 12))
        for i, drawn_interval in enumerate((interval(values), interval(values.ravel()))):
            covered[i] += drawn_interval.low <= 0 <= drawn_interval.high
    assert covered[0] > 0.92 * 300
    assert covered[1] < 0.7 * 300


@pytest.mark.parametrize(
    ("k", "n"),
    [
        (0, 1),
        (0, 17),
        (3, 20),
        (15, 15),
        (20, 20),
    ],
)
def test_the_interval_of_a_share_is_wilson_s(k, n):
    wilson = stats.binomtest(k, n).proportion_ci(method="wilson")
    share = share_interval(k / n, n)
    assert share[1:3] == pytest.approx(tuple(wilson), abs=1e-12)
    assert share.low <= share.median <= share.high


def test_intervals_of_medians_have_sets_of_gains_as_samples():
    sets = np.arange(24) % 3
    values = np.exp(0.5 * sets + 0.01 * np.random.default_rng(0).normal(size=24))[None]
    three = median_of(values, linked(sets))
    assert three.n == 3
    assert median_of(values).n == 24
    assert three.low < 1.1  # the whole range of the sets
    assert three.high > 2.6


# ranks


def test_ranks_are_those_of_the_medians_of_each_block():
    scores = {"a": [[1.0, 1.0, 9.0], [INF, INF, 1.0]], "b": [[1.02, 5.0, 1.0], [INF, INF, 2.0]]}
    scores["c"] = [[3.0, 1.0, 4.0], [2.0, 3.0, INF]]
    # medians 1, 1.02, 3: the first two tied; never, never, 3
    assert mean_ranks(scores) == {"a": 2.0, "b": 2.0, "c": 2.0}
    scores["b"][0][0] = 1.04  # by more than 3 %
    assert mean_ranks(scores) == {"a": 1.75, "b": 2.25, "c": 2.0}
    shares = {"a": np.arange(10) < 3, "b": np.arange(10) < 4}  # by means: both medians are 0
    assert mean_ranks(shares, shares=True) == {"a": 1.0, "b": 2.0}


def test_a_law_that_fails_less_often_comes_first_whatever_its_median():
    scores = {
        "never_fails": [5.0] * 4,
        "fails": [1.0, 1.0, 1.0, INF],
        "also": [1.0, 2.0, 3.0, INF],
    }
    orders = []
    for rank in ranks(Comparison({law: 3 * values for law, values in scores.items()})):
        orders.append((rank.law, rank.place, rank.best))
    assert orders == [("never_fails", 1, True), ("fails", 2, False), ("also", 3, False)]


def test_the_least_relevant_difference_is_a_share_and_values_below_the_floor_are_equal():
    leads = exceeds([1.04, 1.02, INF, INF, 1.0], [1.0, 1.0, 1.0, INF, INF])
    assert leads.tolist() == [True, False, True, False, False]
    assert exceeds(1.04, 1.0, 0.5)
    assert not exceeds(1.04, 1.0, 0.5, relevant=0.05)
    assert not exceeds(1.04, 0.0, 1.02)


def test_the_limit_of_p_values_is_that_of_holms_method():
    p = np.array([0.01, 0.04, 0.03, 0.005])
    assert holm(p, 0.05) == pytest.approx(0.05 / 2)  # rejects 0.005 and 0.01, at 0.05 / 4 and / 3
    assert holm(p, 0.2) == pytest.approx(0.2)  # rejects all
    assert holm(p, 0.001) == pytest.approx(0.001 / 4)


# the rule of a winner, of each term


A = twelve(1.0)
B = twelve(2.0, seed=1)
SOME = np.where(np.arange(12) % 4 == 0, 1.0, NAN)  # one run in four is repeated
FLAT = np.ones((1, 12))
WINS = [  # what a law and a rival with twice its values have besides, who wins, and the rule
    ({"halves": {"a": A, "b": B}}, "a", "half the step changes nothing"),
    ({"halves": {"a": 3.0 * A, "b": B}}, None, "what half the step gives is charged to the law"),
    ({"halves": {"a": A, "b": 0.4 * B}}, None, "and counts for the rival"),
    ({"halves": {"a": 0.1 * A, "b": 9.0 * B}}, "a", "but neither spares the law nor the rival"),
    ({"halves": {"a": 1.3 * SOME * A, "b": SOME * B}}, "a", "the median change widens the others"),
    ({"halves": {"a": 3.0 * SOME * A, "b": SOME * B}}, None, "up"),
    ({"halves": {"a": SOME * A / 3.0, "b": SOME * B}}, None, "and down"),
    # 0.86^5 is 0.47: the rival would be where the law is after as much time again
    ({"trends": {"a": FLAT, "b": 0.86 * FLAT}}, None, "a falling rival is charged"),
    ({"trends": {"a": FLAT, "b": 0.98 * FLAT}}, "a", "two percent are no trend"),
    ({"trends": {"a": FLAT, "b": 2.0 * FLAT}}, "a", "a rising rival gains nothing"),
    ({"trends": {"a": 1.16 * FLAT, "b": FLAT}}, None, "a rising law is charged"),
    ({"trends": {"a": 0.5 * FLAT, "b": FLAT}}, "a", "a falling one is not"),
    ({"floors": 1e3}, None, "values below what the problem can show win nothing"),
    ({"floors": 1.3}, "a", "a law below it beats a rival beyond it"),
    ({"relevant": 0.5}, None, "a lead that is just relevant wins nothing"),
]


@pytest.mark.parametrize(("given", "winner", "rule"), WINS, ids=[row[-1] for row in WINS])
def test_the_winner_by_the_rule(given, winner, rule):
    assert Comparison({"a": A, "b": B}, **given).winners == [winner], rule


def test_a_law_better_by_little_in_every_run_wins_although_the_medians_intervals_overlap():
    scores = {"a": blocks(1.0), "b": blocks(1.05)}
    assert interval(scores["a"]).high > interval(scores["b"]).low
    comparison = Comparison(scores)
    assert comparison.best.tolist() == [[True], [False]]
    effect = comparison.effect(0, "a", "b")
    assert effect[:3] == pytest.approx((1 / 1.05, 1 / 1.05, 1 / 1.05))
    assert (effect.ahead, effect.samples, effect.sets) == (20, 20, False)
    spread = Comparison({"a": A, "b": B}).effect(0, "a", "b")
    assert spread.low < spread.value < spread.high < 1.0
    unpaired = np.random.default_rng(1).permutation(scores["b"][0])
    assert Comparison({"a": scores["a"], "b": unpaired}).best.all()
    # nor does a law that is always last hide it
    assert Comparison(scores | {"z": blocks(9.0), "never": blocks(INF)}).winners == ["a"]


@pytest.mark.slow
def test_two_laws_apart_by_what_is_just_relevant_have_a_false_winner_in_at_most_five_percent():
    """The worst case of the hypothesis: a lead that just does not matter, and a third law far
    behind.
    """
    rng = np.random.default_rng(1)
    wrong = 0
    for _ in range(800):
        a, b, c = spreading(3, 1, 0.15, rng, tails=True)
        wrong += any(
            Comparison(
                {
                    "a": (1 - RELEVANT) * a,
                    "b": b,
                    "c": 9 * c,
                }
            ).winners
        )
    assert (
        stats.binomtest(
            wrong,
            800,
            0.05,
            alternative="greater",
        ).pvalue
        > 1e-3
    )
    assert wrong > 8  # the test is not idle: one of its two sides is exact


def test_units_cancel_and_equal_laws_are_never_separated():
    rng = np.random.default_rng(1)
    for _ in range(50):
        cells = {}
        for law in "abc":
            cells[law] = np.exp(rng.normal(size=(2, 12)))
        in_metres = Comparison(cells, 0.3)
        in_millimetres = Comparison({law: 1e3 * values for law, values in cells.items()}, 300.0)
        assert in_metres.p == pytest.approx(in_millimetres.p, abs=1e-12)
        assert in_metres.winners == in_millimetres.winners
    same = Comparison(dict.fromkeys("abc", np.exp(rng.normal(size=(2, 12)))))
    assert {rank[1:] for rank in ranks(same)} == {(2, 2, True)}


# units: runs that share gains, and runs that repeat others


def test_runs_linked_by_sets_of_gains_of_either_law_are_one_sample():
    # 0001 1122 and so on: the second set of a is linked to both of b
    a = np.arange(12) // 4
    b = np.arange(12) // 6
    assert linked(a, b) == (0,) * 12
    assert linked(a, a) == (*[0] * 4, *[1] * 4, *[2] * 4)
    assert linked(*np.array([[5, 5, 7, 7], [5, -1, 7, 8]])) == (0, 0, 1, 1)
    assert linked(*np.array([[5, 5, -1, 5]])) is None


def test_the_difference_of_a_sample_is_the_median_of_its_runs():
    b = np.array([1.1, 1.2, 9.0, 1.0, 1.3, INF, 2.0, 3.0, 1.0])
    sets = {"a": np.arange(9) // 3, "b": np.zeros(9, int)}
    comparison = Comparison({"a": np.ones(9), "b": b}, sets=sets)
    assert np.exp(comparison.leads[0, 0, 1, :3]) == pytest.approx([1.2, 1.3, 2.0])
    assert np.exp(-comparison.leads[0, 1, 0, :3]) == pytest.approx([1.2, 1.3, 2.0])
    assert np.isnan(comparison.leads[0, 0, 1, 3:]).all()


def test_seeds_that_change_nothing_but_rounding_are_one_sample_of_two_laws_beside_a_third():
    still = np.ones((1, 20))
    moved = blocks(2.0)
    steps = np.arange(20.0)
    for values, samples in (
        (still, 1),
        (still + 1e-12 * steps, 1),
        (still + 1e-5 * steps, 20),
    ):
        (board,) = leaderboard(table_of({"a": values, "b": 2 * values}), ["itae"])
        assert board.blocks[0].runs == samples
        assert board.winner == ("a" if samples > 1 else None)
    scores = {
        "a": moved,
        "b": 0.01 * still,
        "c": 0.02 * still,
    }
    (board,) = leaderboard(table_of(scores), ["itae"])
    (block,) = board.blocks
    assert block.runs == 20
    assert block.best == ("b", "c")  # one sample of two laws tells nothing
    assert [*block.behind] == ["a"]
    moved_table = table_of({"a": still, "b": 2 * still}, tv_rate=np.tile(np.arange(20.0), 2))
    assert leaderboard(moved_table, ["itae"])[0].blocks[0].runs == 20


# level laws, and leads that would have been seen


def test_laws_are_level_only_if_an_interval_of_twelve_units_says_so():
    close = {"a": twelve(1.0), "b": twelve(1.0, seed=1)}
    apart = {"a": twelve(1.0), "b": twelve(1.2, seed=1)}
    noisy = {"a": twelve(1.0, spread=0.3), "b": twelve(1.0, spread=0.3, seed=1)}
    fewer = {}
    for law, values in close.items():
        fewer[law] = values[:, :11]
    for scores, level in (
        (close, True),
        (apart, False),
        (noisy, False),
        (fewer, False),
    ):
        assert Comparison(scores).level[0, 0, 1] == level
    # of shares: twelve runs that settle say nothing of 10 %, only that the same ones do
    settles = np.zeros((1, 12))
    shifted = settles.copy()
    shifted[0, 3] = 1.0
    for rival, level in ((settles, True), (shifted, False)):
        assert Comparison({"a": settles, "b": rival}, shares=True).level[0, 0, 1] == level
    effect = Comparison(close).effect(0, "a", "b")
    assert 0.9 < effect.low < effect.high < 1 / 0.9


def test_the_least_visible_lead_follows_from_the_units_and_charges_what_the_step_does():
    leads = np.random.default_rng(2).normal(scale=0.1, size=12)
    seen = least_visible_lead(leads, 0.001, 0.03)
    # of a normal sample nearly that of Student's law, with the signed ranks' efficiency
    s = np.median([abs(a - b) for i, a in enumerate(leads) for b in leads[:i]]) / 0.954
    quantiles = stats.t.isf(0.001, 11) + stats.t.isf(0.2, 11)
    usual = 1 - 0.97 * math.exp(-quantiles * s * math.sqrt(math.pi / 36))
    assert usual < seen < usual + 0.1
    assert least_visible_lead([*leads, NAN], 0.001, 0.03) == seen
    assert least_visible_lead(leads, 1e-4, 0.03) == 1.0  # no 12 units have so small a p-value
    assert least_visible_lead([*leads[:11], INF], 0.001, 0.03) == 1.0
    cells = {"a": twelve(1.0), "b": twelve(1.0, seed=1)}
    plain = 1 - Comparison(cells).visible(0, "a", "b")
    assert Comparison(cells).charged(0, "a", "b") == 0.0
    charged = Comparison(cells, halves={"a": 2.0 * cells["a"], "b": cells["b"]})
    assert charged.charged(0, "a", "b") == pytest.approx(0.5, rel=0.05)
    assert 1 - charged.visible(0, "a", "b") == pytest.approx(plain / 2, rel=0.05)


SHAPES = {  # of the logarithms of a law and of its rival over their searches
    "normal": 2 * (lambda rng, size: rng.normal(0.0, 0.1, size),),
    "one of ten searches twice as bad": 2
    * (lambda rng, size: rng.normal(0.0, 0.02, size) + 0.7 * (rng.random(size) < 0.1),),
    "Student's, 2 degrees": 2 * (lambda rng, size: 0.03 * rng.standard_t(2, size),),
    "a long tail of the law's alone": (
        lambda rng, size: rng.exponential(0.15, size),
        lambda rng, size: rng.normal(0.0, 0.02, size),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("units", "family"),
    [
        (12, 1),
        (12, 4),
        (24, 4),
    ],
)
@pytest.mark.parametrize("shape", SHAPES)
def test_the_least_visible_lead_is_seen_with_a_probability_of_eighty_percent(units, family, shape):
    """The formula for normal samples gave 41 % where one of ten searches is twice as bad, and
    quantiles of 80 % on both sides 63 % under a long tail.
    """
    rng = np.random.default_rng(units)
    level = 0.025 / family
    law, rival = SHAPES[shape]
    centre = np.median((rival(rng, (2, 40000)) - law(rng, (2, 40000))).mean(axis=0))
    seen = 0
    for _ in range(200):
        a, c = np.exp(law(rng, (2, units)) + centre)
        b, d = np.exp(rival(rng, (2, units)))
        lead = least_visible_lead(np.log(b / a), level, 0.03)  # of another sample of the same laws
        comparison = Comparison({"a": (1 - lead) * c, "b": d})
        seen += comparison.p[0, 0, 1] <= level
    assert 0.69 <= seen / 200 <= 0.94


# half the step


@pytest.mark.parametrize(
    ("factor", "floor", "first_order", "marked"),
    [
        (1.04, 0.0, False, False),
        (1.06, 0.0, False, True),
        (0.94, 0.0, False, True),
        (INF, 0.0, False, True),
        (1.06, 1e3, False, False),
        (1.03, 0.0, True, True),  # half the step has half of the error
        (1.02, 0.0, True, False),
    ],
)
def test_a_median_that_half_the_step_moves_is_marked(factor, floor, first_order, marked):
    cells = {"a": blocks(1.0), "b": blocks(2.0)}
    halves = {"a": factor * cells["a"], "b": cells["b"]}
    comparison = Comparison(
        cells,
        floor,
        halves=halves,
        first_order=first_order,
    )
    middle = float(np.median(cells["a"]))
    if marked:
        step_medians = pytest.approx((middle, factor * middle))
    else:
        step_medians = None
    assert comparison.step_change(0, "a") == step_medians
    assert comparison.step_change(0, "b") is None


# boards


def study(seeds: int = 20) -> MadeTable:
    """Two plants, three laws, two conditions; law c never settles on duffing, and fails in one run
    on van_der_pol.
    """
    rng = np.random.default_rng(0)
    rows = []
    for plant in ("van_der_pol", "duffing"):
        for condition in ("nominal", "noise"):
            for seed in range(seeds):
                start = rng.lognormal()
                for i, law in enumerate("abc"):
                    rows.append((plant, condition, seed, law, start * (1 + i)))
    plant, condition, seed, law, values = (np.array(column) for column in zip(*rows, strict=True))
    never = (plant == "duffing") & (law == "c")
    lost = (plant == "van_der_pol") & (law == "c") & (seed == 1) & (condition == "noise")
    return MadeTable(
        plant=plant,
        condition=condition,
        seed=seed,
        law=law,
        duration=np.full(len(values), 1e3),
        settling_time=np.where(lost, NAN, np.where(never, INF, values)),
        failure=np.where(lost, "left the world", None),
        diverged_at=np.where(lost, 1.0, NAN),
        **{name: np.where(lost, NAN, values) for name in METRICS[2:]},
    )


def entries(boards, metric: str, plant: str) -> dict:
    (board,) = [
        of_metric
        for of_metric in boards
        if of_metric.metric == metric and of_metric.group["plant"] == plant
    ]
    return {entry.law: entry for entry in board.entries}


def test_a_board_for_each_plant_and_metric_with_medians_shares_and_winners():
    table = study()
    boards = leaderboard(table)
    groups = [(board.group["plant"], board.metric) for board in boards]
    assert groups == [(plant, name) for plant in ("van_der_pol", "duffing") for name in METRICS]
    (itae,) = [board for board in boards[5:] if board.metric == "itae"]
    rows = (table.column("plant") == "duffing") & (table.column("law") == "b")
    medians = []
    for condition in ("nominal", "noise"):
        medians.append(
            np.median(table.column("itae")[rows & (table.column("condition") == condition)])
        )
    assert [block.medians["b"] for block in itae.blocks] == medians
    assert itae.entries[1].interval.median == np.median(medians)
    assert [(block.runs, block.winner) for block in itae.blocks] == [(20, "a")] * 2
    assert itae.winner == "a"
    assert itae.unit == "{x} s^2"
    assert entries(boards, "settling_time", "duffing")["c"].interval[:3] == (INF, INF, INF)
    assert entries(boards, "settles", "van_der_pol")["c"].interval.median == 39 / 40
    assert entries(boards, "itae", "van_der_pol")["c"].failed == 1
    assert "c failed in 1 of 80 runs, first: left the world." in boards.remarks


def test_only_runs_that_all_laws_have_are_compared():
    table = study()
    lacking = (table.column("law") == "b") & (table.column("seed") == 3)
    here = lacking & (table.column("condition") == "noise")
    for rows, counts in (
        (~here, [20, 19]),
        (~lacking, [19, 19]),
    ):
        boards = leaderboard(table.taken(rows), ["itae"])
        assert [[block.runs for block in board.blocks] for board in boards] == [counts] * 2


def test_a_law_that_fails_wins_nothing_and_is_not_better_than_one_that_does_not():
    failing = blocks(0.5, seeds=24)
    failing[0, 3] = INF
    (board,) = leaderboard(table_of({"a": failing, "b": blocks(1.0, seeds=24)}), ["itae"])
    assert board.winner is None
    assert board.best == ("b",)
    assert [board.failures(entry) for entry in board.entries] == ["", "1 of 24 failed"]
    (board_of_both,) = leaderboard(table_of({"a": failing, "b": 2 * failing}), ["itae"])
    assert board_of_both.winner is None
    assert board_of_both.best == ()
    fails = np.r_[np.full(7, INF), np.full(9, 0.5)]
    assert Comparison({"fails": fails, "works": np.linspace(0.9, 1.1, 16)}).best.tolist() == [
        [False],
        [True],
    ]


def test_what_cannot_be_compared_is_refused(refused):
    table = study()
    apart = (table.column("law") == "a") == (table.column("condition") == "nominal")
    for bad, options, word in (
        (table.taken(slice(0, 0)), {}, "no runs"),
        (table, {"metrics": ["speed"]}, "'speed'"),
        (table, {"by": ("law",)}, "('law',)"),
        (table.taken(np.r_[0:240, 0]), {}, "several runs"),
        (table.taken(apart), {}, "in common"),
    ):
        refused(lambda bad=bad, options=options: leaderboard(bad, **options), word)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({}, None),
        ({"starts": smc.starts(x0=1.0)}, "x0 of classical and pid differ"),
        ({"plants": smc.plant("duffing", beta=5.0)}, "plant of classical and pid differ"),
        ({"conditions": smc.condition("worn", friction=smc.Coulomb(0.2))}, "friction of classical"),
    ],
)
def test_runs_that_differ_in_more_than_the_law_are_not_compared(changed, words):
    worn = smc.condition("worn", friction=smc.Coulomb(0.05))
    settings = {
        "plants": "duffing",
        "conditions": worn,
        "duration": 1.0,
        "gains": "default",
    }
    runs = smc.grid(**settings, laws="classical") + smc.grid(**settings | changed, laws="pid")
    rows = [run_key.row(scenario) for scenario in runs]
    names = "plant", "law", "condition", "seed", "scenario"
    table = MadeTable(**{name: [row[name] for row in rows] for name in names}, itae=[1.0, 2.0])
    if words is None:
        leaderboard(table, ["itae"])
        return
    with pytest.raises(ScenarioError, match=words):
        leaderboard(table, ["itae"])


# what matters in a problem


FINE = paper.scenario("duffing", "none")  # x0 1.5 m, |u| <= 6 N, 10 s
LOW = paper.scenario("duffing", "none", changes={"x0": -1.5})
COARSE = paper.scenario("duffing", "none", changes={"sensor": smc.Encoder(counts=50)})
NOISY = paper.scenario("duffing", "none", changes={"noise": smc.Noise(position=0.02)})
AT_REST = paper.scenario("duffing", "none", changes={"x0": 0.0})
UNBOUNDED = paper.scenario("duffing", "none", changes={"u_max": INF})
AIRBORNE = smc.Scenario(plant="quadrotor", law="none", x0=(0.3, 0.0, 1.1, 0.0, 0.0, 0.2))
FALLEN = dataclasses.replace(AIRBORNE, x0=(0.0, 0.0, 0.6, 0.0, 0.0, 0.0))  # rest is at 1 m
FLOORS = [
    (FINE, "ultimate_bound", 1.5e-4),
    (LOW, "ultimate_bound", 1.5e-4),  # a start below rest is as far from it
    (COARSE, "ultimate_bound", 0.01),
    (NOISY, "ultimate_bound", 0.02),
    (NOISY, "rms_error", 1.5e-4),
    (NOISY, "iae", 1.5e-3),
    (NOISY, "itae", 7.5e-3),
    (NOISY, "overshoot", 100 * 0.02 / 1.5),
    (NOISY, "settling_time", 1e-3),  # s, a control period
    (AT_REST, "overshoot", 0.0),
    (AIRBORNE, "ultimate_bound", 3e-5),
    (FALLEN, "ultimate_bound", 4e-5),
    (FINE, "max_u", 6e-3),
    (FINE, "tv_rate", 6e-3),
    (UNBOUNDED, "tv_rate", 0.0),
]


@pytest.mark.parametrize(("scenario", "metric", "floor"), FLOORS)
def test_the_smallest_value_that_matters_by_hand(scenario, metric, floor):
    assert paired_runs.floor(scenario, metric) == pytest.approx(floor)


SHOWN = [
    (NOISY, "0.02 m"),
    (COARSE, "0.01 m"),
    (FINE, "0.00015 m"),
]
BELOW = [  # factors of q of laws a, b and c, the verdict, and what it says
    ((0.3, 0.9), Tied, {"laws": ("a", "b"), "floor": "q"}),
    ((0.5, 0.6, 3.0), Tied, {"laws": ("a", "b"), "floor": "q"}),
    ((0.5, 1.01), Open, {"laws": ("a",)}),
    (
        (0.5, 4.0, 5.0),
        Lead,
        {
            "law": "a",
            "rival": "b",
            "floor": "q",
            "ahead": 12,
            "low": pytest.approx(3 / 4, rel=0.01),
        },
    ),
    (
        (2.0, 3.0),
        Lead,
        {
            "law": "a",
            "rival": "b",
            "floor": "",
            "ahead": 12,
            "ratio": pytest.approx(2 / 3, rel=0.01),
        },
    ),
    ((2.0, 2.0), Tied, {"laws": ("a", "b"), "floor": ""}),
]


@pytest.mark.parametrize(("factors", "kind", "fields"), BELOW)
@pytest.mark.parametrize(("run", "q"), SHOWN)
def test_laws_below_the_floor_are_not_ranked_and_a_lead_over_it_is_a_least_one(
    run, q, factors, kind, fields
):
    least = paired_runs.floor(run, "ultimate_bound")
    scores = {}
    for i, factor in enumerate(factors):
        scores["abc"[i]] = least * twelve(factor, spread=0.005, seed=i)
    rows = np.array([run_key.row(run)["scenario"]] * 12 * len(factors))
    table = table_of(scores, "ultimate_bound", scenario=rows)
    boards = leaderboard(table, ["ultimate_bound"])
    (board,) = boards
    (block,) = board.blocks
    (fact,) = board.verdicts.values()
    assert isinstance(fact, kind)
    fields = {name: q if value == "q" else value for name, value in fields.items()}
    assert {name: getattr(fact, name) for name in fields} == fields
    assert board.winner == ("a" if kind is Lead else None)
    if factors == (0.3, 0.9):  # and in another condition neither is
        two = {law: np.vstack([scores[law], 9.0 * scores["a"]]) for law in "ab"}
        table = table_of(two, "ultimate_bound", scenario=np.tile(rows, 2))
        (board_of_both,) = leaderboard(table, ["ultimate_bound"])
        assert [getattr(tied, "floor", None) for tied in board_of_both.verdicts.values()] == [q, ""]
    cells = {}
    for row in boards.tables[0].rows:
        cells[row[0].text] = row[1]
    for law, factor in zip("abc", factors, strict=False):
        below = factor < 1.0
        assert (f"floor {q}" in cells[law].below) == below
        if min(factors) < 1.0:  # those below are the best, and no other is marked
            assert cells[law].strong == below
        if below:
            assert law not in block.behind


def test_a_median_below_the_floor_that_rises_says_that_it_may_pass_it():
    """By 4 with the last fifth of a run, so by 1024 in five further ones."""
    least = paired_runs.floor(FINE, "ultimate_bound")
    scores = {law: least * twelve(0.01, spread=0.005, seed=i) for i, law in enumerate("ab")}
    rows = np.array([run_key.row(FINE)["scenario"]] * 24)
    rises = np.array(['{"ultimate_bound": 1.0}'] * 12 + ['{"ultimate_bound": 4.0}'] * 12)
    table = table_of(scores, "ultimate_bound", scenario=rows, trends=rises)
    (tabular,) = leaderboard(table, ["ultimate_bound"]).tables
    said = {row[0].text: row[1].below.splitlines()[-1] for row in tabular.rows}
    assert said == {"a": "floor 0.00015 m", "b": "may exceed 0.00015 m"}
    assert "may exceed" in tabular.under[-1]


def test_a_lead_over_the_floor_is_printed_only_where_the_test_sees_it():
    """Of twins about the floor one is below it and the other is not, by chance."""
    low = np.where(np.arange(12) < 7, 0.9, 1.9)[None]
    twins = Comparison({"a": low, "b": 2.8 - low}, 1.0)
    assert twins.below.tolist() == [[True], [False]]
    assert twins.effect(0, "a", "b").high == 1.0
    apart = Comparison({"a": low, "b": 10.0 * low}, 1.0)
    assert apart.effect(0, "a", "b").high == pytest.approx(1.0 / 9.0)


def test_nothing_is_seen_of_a_law_that_arrives_at_one_step_and_not_at_half_of_it():
    lost = Comparison({"a": A, "b": B}, halves={"a": INF * FLAT, "b": B})
    assert lost.visible(0, "a", "b") == 1.0


def test_a_law_is_below_the_floor_by_more_than_half_of_its_units_and_by_all_that_is_charged():
    q = 1.0
    for count, below in ((6, False), (7, True)):
        values = np.where(np.arange(12) < count, 0.5, 2.0)[None]
        assert Comparison({"a": values, "b": 9.0 * B}, q).below[0, 0] == below
    # seven runs of one set are one unit of six
    sets = {"a": np.maximum(np.arange(12) - 6, 0)[None], "b": np.arange(12)[None]}
    assert not Comparison({"a": values, "b": 9.0 * B}, q, sets=sets).below[0, 0]
    charged = {"halves": {"a": 3.0 * A, "b": B}}, {"trends": {"a": 1.3 * FLAT, "b": FLAT}}
    for options in charged:
        assert not Comparison({"a": 0.5 * A, "b": B}, q, **options).below[0, 0]
    assert not Comparison({"a": A - A, "b": B}).below.any()  # no floor


# runs that have not arrived


ARRIVING = [  # the seeds in which a and b have not arrived, and the winner; a has half of b's value
    ((), (), "a"),
    ((), (3, 4), "a"),
    ((3,), (), None),
    ((3,), (3, 4), None),
]


@pytest.mark.parametrize(("lost", "others", "winner"), ARRIVING)
@pytest.mark.parametrize("metric", ["itae", "tv_rate", "overshoot", "hf_share"])
def test_a_law_wins_nothing_with_a_run_that_has_not_arrived(metric, lost, others, winner):
    arrived = np.ones((2, 12), bool)
    arrived[0, list(lost)] = False
    arrived[1, list(others)] = False
    table = table_of({"a": A, "b": B}, metric, arrived=arrived.ravel())
    (board,) = leaderboard(table, [metric])
    assert board.winner == winner
    (block,) = board.blocks
    assert ("a" in block.best) == (not lost)
    said = " ".join(map(board.failures, board.entries))
    assert ("of 12 not arrived" in said) == (metric != "itae" and bool(lost or others))


def test_where_no_law_arrives_none_wins_and_it_is_said():
    table = table_of({"a": A, "b": B}, "tv_rate", arrived=np.zeros(24, bool))
    boards = leaderboard(table, ["tv_rate"])
    (board,) = boards
    (fact,) = board.verdicts.values()
    assert fact == Barred(metric="variation of u", laws=("a", "b"), defaults=False)
    assert [row[1].text for row in boards.tables[0].rows] == ["not arrived"] * 2


def test_a_run_that_arrives_only_at_the_whole_step_is_charged():
    halves = np.array(['{"tv_rate": 1.0, "arrived": false}'] * 12 + [None] * 12, object)
    table = table_of({"a": A, "b": B}, "tv_rate", half_step=halves)
    (board,) = leaderboard(table, ["tv_rate"])
    assert board.winner is None


def test_a_law_is_not_told_from_the_best_by_its_own_samples_alone():
    """Of two laws one has seven sets of gains, too few to be found worse; of three two are enough."""
    few = np.arange(12) % 7
    many = np.arange(12)
    spread = 1.0 + 0.1 * np.sin(np.arange(12))
    scores = {"few": [spread[::-1]], "many": [spread]}
    sets = {"few": [few], "many": [many]}
    assert not Comparison(scores, sets=sets).best.any()
    beside = Comparison(scores | {"other": [1.01 * spread[::-1]]}, sets=sets | {"other": [many]})
    assert beside.best[:, 0].tolist() == [False, True, True]


def test_a_run_that_is_within_its_band_at_its_end_alone_has_not_settled_in_time():
    """An oscillation a little beyond the band has settling times near the end of the runs."""
    times = np.array([[0.5, 1.59, 1.61, 1.96, math.inf, math.nan, 0.56]])
    durations = np.array([2.0] * 6 + [0.7])  # of which 0.8 is, rounded, below 0.56
    table = table_of({"a": times}, "settling_time", duration=durations)
    expected = [0.0, 0.0, 1.0, 1.0, 1.0, math.nan, 0.0]
    np.testing.assert_array_equal(paired_runs.values(table, "settles"), expected)
