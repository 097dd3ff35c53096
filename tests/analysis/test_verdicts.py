"""How often verdicts are wrong, that they are found where there is a winner, and that a law which
is added changes nothing that is said of the others but what it must.
"""

import math
from typing import Any

import numpy as np
import pytest
from helpers.tables import table_of

from smc_mujoco.analysis.ranking import Comparison, corrected, needed_to_rank, needed_to_win
from smc_mujoco.metrics.fold import Fold, first_sample, late_periods
from smc_mujoco.studies.leaderboard import leaderboard

SETS = 12


def drawn(rng, centres, spread: float, blocks: int = 1, stuck: float = 0.1) -> dict:
    """Return law -> (blocks, 12) of laws with these centres of the logarithm. Half of a search's
    variance is the same in all blocks; one in ten is stuck at twice the value.
    """
    scores = {}
    for i, centre in enumerate(centres):
        of_set = rng.normal(size=(1, SETS))
        of_run = rng.normal(size=(blocks, SETS))
        late = math.log(2.0) * (rng.random((1, SETS)) < stuck)
        scores[f"law{i:02}"] = np.exp(centre + spread * (of_set + of_run) / math.sqrt(2.0) + late)
    return scores


@pytest.mark.parametrize("laws", [2, 4, pytest.param(16, marks=pytest.mark.slow)])
@pytest.mark.parametrize("spread", [0.02, 0.2])
def test_of_twins_few_win_and_few_are_taken_for_worse(laws, spread):
    """5 % of tables may have a winner, and a twin may be beaten in 5 % of blocks."""
    rng = np.random.default_rng(laws)
    won = lost = 0
    for _ in range(100):
        comparison = Comparison(drawn(rng, [0.0] * laws, spread, blocks=2))
        won += any(comparison.winners)
        lost += comparison.worse[0].sum()
    assert won <= 5
    assert lost <= 10


def test_a_law_that_is_better_than_fifteen_others_by_half_wins_with_twelve_sets():
    rng = np.random.default_rng(1)
    named = 0
    for _ in range(10):
        comparison = Comparison(drawn(rng, [0.0, *[math.log(1.5)] * 15], 0.1, blocks=3, stuck=0.0))
        named += comparison.winners.count("law00")
        assert set(comparison.winners) <= {"law00", None}
    assert named >= 27  # of 30


@pytest.mark.quick
def test_six_sets_name_a_winner_of_one_block_among_any_number_of_laws():
    scores = drawn(np.random.default_rng(2), [0.0, *[1.5] * 20], 0.02)
    for sets, winner in ((6, "law00"), (5, None)):
        comparison = Comparison({law: values[:, :sets] for law, values in scores.items()})
        assert comparison.winners == [winner]
        # where none wins, so few say nothing of any law
        assert comparison.best.sum() == (winner is not None)


def test_a_winner_is_corrected_for_all_blocks_of_its_metric_step_by_step():
    """A p-value of .0215 is enough in one block, and in two if the other has a winner."""
    ahead = np.linspace(0.5, 0.6, 12)[None]
    late = np.where(np.arange(12) < 11, ahead, 2.5)
    even = np.where(np.arange(12) % 2, 0.9, 1.1)[None]
    ones = np.ones((1, 12))
    assert 0.0125 < Comparison({"a": late, "b": ones}).p[0, 0, 1] < 0.025
    for law, winners in (
        (late, ["a"]),
        (np.vstack([late, even]), [None, None]),
        (np.vstack([late, ahead]), ["a", "a"]),
    ):
        assert Comparison({"a": law, "b": np.ones_like(law)}).winners == winners
    six = Comparison({"a": ahead[:, :6], "b": ones[:, :6]})
    assert six.visible(0, "a", "b") < 0.9
    two = [Comparison({"a": ahead[:, :6], "b": ones[:, :6]}) for _ in range(2)]
    corrected(two)
    assert two[0].visible(0, "a", "b") == 1.0  # no six units are enough beside another block


def test_the_units_that_are_needed():
    assert [needed_to_win(blocks) for blocks in (1, 4, 12, 102, 103)] == [6, 8, 9, 12, 13]
    assert [needed_to_rank(laws) for laws in (2, 16, 41)] == [9, 9, 10]  # 5 % / 15, 5 % / 40


def test_a_law_with_few_sets_of_gains_takes_no_other_s_verdict_along():
    """Three sets of a law that is 16 times worse left the winner of J without a verdict."""
    scores = drawn(np.random.default_rng(3), [0.0, 0.5, 2.8], 0.02)
    sets = {law: np.arange(SETS)[None] for law in scores}
    sets["law02"] = np.arange(SETS)[None] % 3
    comparison = Comparison(scores, sets=sets)
    assert comparison.ranked.tolist() == [[True], [True], [False]]
    assert comparison.winners == ["law00"]
    assert comparison.best.tolist() == [[True], [False], [False]]
    assert comparison.worse.tolist() == [[False], [True], [False]]


def cells(boards) -> dict:
    """Law -> its cells."""
    values_by_law: dict = {}
    for table in boards.tables:
        for name, *row in table.rows:
            values_by_law.setdefault(name.text, []).extend(row)
    return values_by_law


@pytest.mark.parametrize("seed", range(6))
def test_a_law_that_is_beaten_changes_no_other_cell(seed):
    """And one of several that may be the best changes nothing but stars."""
    rng = np.random.default_rng(seed)
    scores = drawn(rng, rng.normal(0.0, 0.5, 6), 0.15, blocks=3)
    table = table_of(scores)
    boards = leaderboard(table, ["itae"], by=("plant", "condition"))
    before = cells(boards)
    beaten = 0
    for law in scores:
        rest = table.taken(table.column("law") != law)
        after = cells(leaderboard(rest, ["itae"], by=("plant", "condition")))
        for rival, row in after.items():
            for own, old, new in zip(before[law], before[rival], row, strict=True):
                assert new._replace(strong=old.strong) == old
                assert new == old or own.strong
                beaten += not own.strong
    assert beaten > 20


def test_the_ratio_of_a_winner_is_its_least_lead_and_not_that_over_the_noisiest_rival():
    """It was .406 times my_law's, whose p-value was the largest, where it is .846 times another's."""
    rng = np.random.default_rng(5)
    scores = {
        "first": np.exp(0.01 * rng.normal(size=(1, SETS))),
        "near": 1.18 * np.exp(0.01 * rng.normal(size=(1, SETS))),
        "noisy": 2.5 * np.exp(0.6 * rng.normal(size=(1, SETS))),
    }
    p = Comparison(scores).p[0, 0]
    assert p[1] <= p[2]  # as closest was told by these
    (board,) = leaderboard(table_of(scores), ["itae"])
    (block,) = board.blocks
    lead: Any = block.verdict
    assert (block.winner, lead.rival) == ("first", "near")
    assert 0.13 < lead.low < lead.high < 0.17


def test_beside_a_law_below_the_floor_none_above_it_is_starred():
    """Duffing's pid, 8.7e-4 m, had the star of a column with 1e-9 m in it."""
    low = np.full(SETS, 0.5)
    straddling = np.where(np.arange(SETS) < 5, 0.9, 1.4)
    comparison = Comparison({"low": low, "above": straddling, "far": 9.0 * low}, 1.0)
    assert comparison.winners == [None]
    assert dict(zip(comparison.laws, comparison.best[:, 0].tolist(), strict=True)) == {
        "above": False,
        "far": False,
        "low": True,
    }
    assert not comparison.worse[comparison.laws.index("above"), 0]


LATE_METRICS = {
    "ultimate_bound": Fold("e", "largest", part="late"),
    "tv_rate": Fold("u", "sum", part="late", change=True, rate=True),
}


def under_a_sine(rng, name, lead):
    """A comparison of two laws whose runs are sines of one amplitude, the second larger by a lead,
    each law with a phase of its own; runs differ by 5 % and 0.1 rad.
    """
    duration, h = 10.0, 0.02
    period = 2 * math.pi / 5.0
    part = late_periods(duration, period) * period
    t = np.arange(0.0, duration + h / 2, h)
    values, trends = {}, {}
    for law, size in (("first", 1.0), ("second", 1.0 / (1.0 - lead))):
        phase = rng.uniform(0.0, 2 * math.pi)
        amplitudes = size * np.exp(rng.normal(0.0, 0.05, 12))
        phases = phase + rng.normal(0.0, 0.1, 12)
        values[law], trends[law] = [], []
        for amplitude, angle in zip(amplitudes, phases, strict=True):
            signal = np.sin(5.0 * t + angle) + 0.02 * rng.normal(size=t.size)
            begin = first_sample("late", t, part)
            fold = LATE_METRICS[name]
            sizes = []
            for end in (t.size, begin + 1):  # the last part, and as much before it
                start = first_sample("late", t[:end], part)
                sizes.append(fold.of(t[:end], amplitude * signal[:end, None], start))
            values[law].append(sizes[0])
            trends[law].append(sizes[0] / sizes[1])
    return Comparison(values, trends=trends, powers=duration / part)


@pytest.mark.slow
@pytest.mark.parametrize("name", LATE_METRICS)
def test_under_a_sine_equal_laws_have_no_winner_and_a_lead_of_a_quarter_shows(name):
    rng = np.random.default_rng(11)
    twins = [under_a_sine(rng, name, 0.0).winners[0] for _ in range(200)]
    assert sum(map(bool, twins)) <= 10
    apart = [under_a_sine(rng, name, 0.25).winners[0] for _ in range(50)]
    assert apart.count("first") >= 40
    assert "second" not in apart
