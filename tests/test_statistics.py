"""Statistics: intervals cover what they say, ranks are paired, and no winner is declared inside the noise."""

import io
import math

import numpy as np
import pytest
from rich.console import Console
from scipy import stats

from smc_mujoco.errors import ScenarioError
from smc_mujoco.leaderboard import METRICS, Board, leaderboard, leaderboard_table
from smc_mujoco.ranking import friedman, ranks, worse
from smc_mujoco.statistics import Interval, median_interval, share_interval

INF = math.inf
FEW = 199  # resamples


class Stand:
    """A stand-in for a study's table: columns by name."""

    def __init__(self, **columns):
        rows = len(columns["law"])
        given = {"plant": ["duffing"] * rows, "condition": ["nominal"] * rows, "failure": [None] * rows}
        given |= {"diverged_at": [math.nan] * rows, "seed": list(range(rows))}
        self.columns = {name: np.asarray(values) for name, values in (given | columns).items()}

    def column(self, name: str) -> np.ndarray:
        return self.columns[name]

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


def within(count: int, runs: int, probability: float) -> bool:
    """Whether a count is one that a binomial distribution has but for 1 in 10,000."""
    return bool(stats.binomtest(count, runs, probability).pvalue > 1e-4)


# medians


def test_few_values_by_hand():
    assert median_interval([3.0, 1.0, 2.0]) == Interval(2.0, 1.0, 3.0, 3)
    assert median_interval([4.0, 1.0, 2.0, 3.0]) == Interval(2.5, 1.0, 4.0, 4)


@pytest.mark.parametrize(("n", "low", "high"), [(5, 1, 5), (7, 1, 7), (10, 2, 9), (20, 6, 15)])
def test_the_ends_are_the_order_statistics_that_the_binomial_distribution_gives(n, low, high):
    """P*(median* <= x_(j)) = P(Bin(n, j / n) >= n / 2), Efron 1979; against the expanded percentile."""
    tail = stats.norm.cdf(-math.sqrt(n / (n - 1)) * stats.t.ppf(0.975, n - 1))
    below = [stats.binom.sf(math.ceil(n / 2) - 1, n, j / n) for j in range(1, n + 1)]
    assert 1 + np.argmax(np.array(below) >= tail) == low
    assert median_interval(np.arange(1.0, n + 1))[1:3] == (low, high)


@pytest.mark.parametrize(("n", "low", "high"), [(5, 1, 5), (10, 2, 9), (20, 6, 15)])
def test_the_interval_of_a_skewed_sample_covers_as_often_as_its_order_statistics_do(n, low, high):
    rng, runs = np.random.default_rng(n), 1000
    samples = rng.lognormal(sigma=2.0, size=(runs, n))  # median 1
    samples[rng.random((runs, n)) < 0.1 * (samples > 1)] = INF  # as failures among the worse half: the median stays
    found = [median_interval(sample) for sample in samples]
    covered = sum(one.low <= 1.0 <= one.high for one in found)
    probability = stats.binom.cdf(high - 1, n, 0.5) - stats.binom.cdf(low - 1, n, 0.5)
    assert probability >= min(0.93, 1 - 2 ** (1 - n))
    assert within(covered, runs, probability)


def test_from_six_to_forty_seeds_it_covers_93_percent_or_more():
    for n in range(6, 41):
        low, high = median_interval(np.arange(1, n + 1))[1:3]
        assert stats.binom.cdf(high - 1, n, 0.5) - stats.binom.cdf(low - 1, n, 0.5) > 0.93


def test_blocks_are_drawn_by_seed_and_so_the_interval_covers_where_that_of_pooled_runs_does_not():
    rng, runs, covered, pooled = np.random.default_rng(0), 300, 0, 0
    for _ in range(runs):
        values = rng.normal(size=(1, 12)) + 0.1 * rng.normal(size=(8, 12))  # the seed decides; median 0
        one, other = median_interval(values), median_interval(values.ravel())
        covered += one.low <= 0 <= one.high
        pooled += other.low <= 0 <= other.high
    assert covered / runs > 0.92
    assert pooled / runs < 0.7


def test_never_is_worst_and_ends_an_interval():
    assert median_interval([1, 2, 3, 4, INF, INF, INF]) == Interval(4.0, 1.0, INF, 7)
    assert median_interval([1, INF]).median == INF
    assert median_interval([INF] * 9) == Interval(INF, INF, INF, 9)


def test_a_constant_has_no_width_and_a_single_seed_no_interval():
    assert median_interval([2.5] * 6) == Interval(2.5, 2.5, 2.5, 6)
    for one in (median_interval([2.5]), median_interval([[1.0], [4.0]])):
        assert one.median == 2.5
        assert math.isnan(one.low)
        assert math.isnan(one.high)
        assert one.n == 1


def test_intervals_are_the_same_each_time_and_in_any_order():
    rng = np.random.default_rng(0)
    values = rng.normal(size=30)  # whose upper end is near the next value
    assert {median_interval(rng.permutation(values)) for _ in range(20)} == {median_interval(values)}
    assert np.exp(median_interval(values)[1:3]) == pytest.approx(median_interval(np.exp(values))[1:3])


@pytest.mark.parametrize("values", [[], [1.0, math.nan], np.zeros((2, 2, 2))])
def test_values_that_are_none_are_refused(values):
    with pytest.raises(ScenarioError, match="give"):
        median_interval(values)


@pytest.mark.parametrize(("name", "value"), [("level", 1.0), ("level", 0.0), ("resamples", 9)])
def test_a_level_or_a_number_of_resamples_out_of_range_is_refused(name, value):
    with pytest.raises(ScenarioError, match=name):
        median_interval([1.0, 2.0], **{name: value})


@pytest.mark.parametrize(("k", "n"), [(0, 1), (3, 20), (20, 20)])
def test_the_interval_of_a_share_is_wilson_s(k, n):
    wanted = stats.binomtest(k, n).proportion_ci(method="wilson")
    assert share_interval(k / n, n)[1:3] == pytest.approx(tuple(wanted), abs=1e-12)


# ranks


def test_ranks_by_hand_with_ties_and_failures():
    scores = {"a": np.array([1.0, 1.0, INF]), "b": np.array([1.0, 2.0, INF]), "c": np.array([3.0, INF, 5.0])}
    found = by_law(ranks(scores))
    assert {law: rank.mean for law, rank in found.items()} == pytest.approx(
        {"a": (1.5 + 1 + 2.5) / 3, "b": (1.5 + 2 + 2.5) / 3, "c": (3 + 3 + 1) / 3}
    )
    wanted = np.array([stats.rankdata(column) for column in np.stack(list(scores.values())).T]).mean(axis=0)
    assert [found[law].mean for law in scores] == pytest.approx(wanted)


def test_the_interval_of_a_place_is_that_of_seeds_drawn_again_and_laws_ranked_again():
    rng = np.random.default_rng(5)
    scores = {f"law{i}": rng.lognormal(size=(3, 12)) * (1 + 0.3 * i) for i in range(5)}
    cells = np.stack(list(scores.values()))
    place = stats.rankdata(cells, axis=0).mean(axis=1)  # law, seed
    places = [stats.rankdata(place[:, rng.integers(0, 12, 12)].mean(axis=1).round(9)) for _ in range(2000)]
    tail = stats.norm.cdf(-math.sqrt(12 / 11) * stats.t.ppf(0.975, 11))
    low, high = np.quantile(places, [tail, 1 - tail], axis=0)
    found = by_law(ranks(scores))
    assert [found[law].low for law in scores] == pytest.approx(low, abs=0.5)
    assert [found[law].high for law in scores] == pytest.approx(high, abs=0.5)
    assert [found[law].median for law in scores] == pytest.approx(np.median(places, axis=0), abs=0.5)
    assert len(set(low)) > 2  # not all alike


def test_differences_that_are_rounding_are_ties():
    a, b = np.array([1.0, 1e-12, 1.0, INF]), np.array([1.0 + 1e-9, 3e-11, 1.001, 2.0])
    assert worse(a, b).tolist() == [0.0, 0.0, -1.0, 1.0]
    assert worse(b, a).tolist() == [0.0, 0.0, 1.0, -1.0]


def test_a_law_better_by_little_in_every_run_wins_although_the_medians_intervals_overlap():
    start = np.random.default_rng(0).lognormal(size=(1, 12))  # far more from seed to seed than from law to law
    scores = {"a": start, "b": 1.05 * start}
    a, b = median_interval(scores["a"]), median_interval(scores["b"])
    assert a.high > b.low
    found = by_law(ranks(scores))
    assert (found["a"].best, found["b"].best) == (True, False)
    assert (found["a"].low, found["a"].high, found["b"].low, found["b"].high) == (1, 1, 2, 2)
    shuffled = {"a": start, "b": 1.05 * np.random.default_rng(1).permutation(start[0])}  # the same runs, unpaired
    assert all(rank.best for rank in ranks(shuffled))


def test_a_law_that_is_always_last_does_not_hide_that_another_is_beaten():
    rng = np.random.default_rng(0)
    a = rng.lognormal(size=(10, 20))
    b = a * np.where(rng.random(a.shape) < 0.7, 1.1, 0.9)  # worse in 70 % of each seed's cells
    alone, among = by_law(ranks({"a": a, "b": b})), by_law(ranks({"a": a, "b": b, "z": 9 * a, "never": INF * a}))
    assert [law for law, rank in alone.items() if rank.best] == ["a"]
    assert [law for law, rank in among.items() if rank.best] == ["a"]


@pytest.mark.parametrize(("seeds", "wins"), [(1, False), (5, False), (6, True)])
def test_fewer_than_six_seeds_tell_no_laws_apart(seeds, wins):
    scores = {"a": np.full((3, seeds), 1.0), "b": np.full((3, seeds), 2.0)}
    board = leaderboard(stand(scores), ["itae"])[0]
    assert board.winner == ("a" if wins else None)
    assert ("too few" in board.verdict) != wins
    assert (0.5**seeds <= 0.025) == wins


def simulated(laws: int, seeds: int, bad: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Equal laws that share the effect of their seed, a fifth of the runs failing, and `bad` ones that are worse."""
    own = rng.lognormal(sigma=0.5, size=(laws + bad, 1, seeds)) * rng.lognormal(size=(laws + bad, 3, seeds))
    cells = rng.lognormal(size=(1, 1, seeds)) * own
    cells[laws:] *= 30.0
    cells[rng.random(cells.shape) < 0.2] = INF
    return {f"law{i}": c for i, c in enumerate(cells)}


@pytest.mark.parametrize(("laws", "seeds", "bad"), [(2, 6, 0), (2, 20, 0), (2, 12, 2), (3, 8, 1), (6, 20, 0)])
def test_equal_laws_are_seldom_separated(laws, seeds, bad):
    rng, runs = np.random.default_rng(laws + seeds), 250
    winners = out = 0
    for _ in range(runs):
        best = {rank.law for rank in ranks(simulated(laws, seeds, bad, rng), resamples=FEW) if rank.best}
        winners += len(best) == 1
        out += "law0" not in best
    assert stats.binomtest(winners, runs, 0.05, alternative="greater").pvalue > 1e-3
    assert stats.binomtest(out, runs, 0.025, alternative="greater").pvalue > 1e-3


def test_laws_that_do_the_same_are_never_separated():
    scores = np.random.default_rng(0).lognormal(size=(4, 30))
    for rank in ranks({"a": scores, "b": scores.copy(), "c": scores.copy()}):
        assert (rank.mean, rank.median, rank.low, rank.high, rank.p) == (2, 2, 2, 2, 1)


def test_a_law_that_is_clearly_better_wins():
    rng = np.random.default_rng(3)
    wins = 0
    for _ in range(50):
        scores = simulated(4, 20, 0, rng)
        scores["better"] = 0.1 * scores.pop("law0")
        found = by_law(ranks(scores, resamples=FEW))
        wins += found["better"].best and sum(rank.best for rank in found.values()) == 1
    assert wins >= 45


def test_no_law_is_best_where_each_loses_to_another():
    one, two, three = np.full((1, 20), 1.0), np.full((1, 20), 2.0), np.full((1, 20), 3.0)
    scores = {  # a beats b, b beats c and c beats a, each in two of three conditions
        "a": np.concatenate([one, two, three]),
        "b": np.concatenate([two, three, one]),
        "c": np.concatenate([three, one, two]),
    }
    board = leaderboard(stand(scores), ["itae"])[0]
    assert (board.best, board.winner) == ((), None)
    assert board.verdict == "no winner: each loses to another"


def test_friedman_s_test_is_scipy_s_and_the_critical_difference_demsar_s():
    rng = np.random.default_rng(0)
    medians = rng.integers(0, 6, size=(5, 12)).astype(float)  # with ties
    scores = {f"law{i}": np.stack([row - 1, row, row + 1], axis=1) for i, row in enumerate(medians)}
    found = friedman(scores)
    assert found is not None
    assert found.p == pytest.approx(stats.friedmanchisquare(*medians).pvalue)
    assert found.critical_difference == pytest.approx(2.728 * math.sqrt(5 * 6 / (6 * 12)), rel=1e-3)  # his table 5a
    assert found.blocks == 12
    assert friedman({"a": medians[:1], "b": medians[1:2]}) is None
    same = friedman({"a": medians, "b": medians})
    assert same is not None
    assert same.p == 1.0


@pytest.mark.parametrize("other", [np.zeros((2, 3)), np.array([[1.0, math.nan]])])
def test_laws_of_different_cells_are_refused(other):
    with pytest.raises(ScenarioError, match="cells"):
        ranks({"a": np.array([[1.0, 2.0]]), "b": other})


# leaderboards


def study(seeds: int = 8, seed: int = 0) -> Stand:
    """Two plants, three laws, two conditions; law c never settles on duffing, and fails in one run on van_der_pol."""
    rng, rows = np.random.default_rng(seed), []
    for plant in ("van_der_pol", "duffing"):
        for condition in ("nominal", "noise"):
            for s in range(seeds):
                start = rng.lognormal()
                rows += [(plant, condition, s, law, start * (1 + i)) for i, law in enumerate("abc")]
    plants, conditions, number, laws, values = (np.array(column) for column in zip(*rows, strict=True))
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
    assert [(b.group["plant"], b.metric) for b in boards[:5]] == [("van_der_pol", name) for name in METRICS]
    assert len(boards) == 10
    itae = picked(boards, "itae", plant="duffing")
    assert [entry.law for entry in itae.entries] == ["a", "b", "c"]
    rows = (table.column("plant") == "duffing") & (table.column("law") == "b")
    assert itae.entries[1].interval.median == np.median(table.column("itae")[rows])
    assert (itae.winner, itae.verdict, itae.cells, itae.seeds) == ("a", "winner: a", 16, 8)
    assert itae.unit == "{x} s^2"
    settles = picked(boards, "settles", plant="duffing")
    assert [entry.interval.median for entry in settles.entries] == [1.0, 1.0, 0.0]
    assert settles.verdict == "no winner: a, b"
    assert by_law(picked(boards, "settling_time", plant="duffing").entries)["c"].interval[:3] == (INF, INF, INF)
    failing = by_law(picked(boards, "settles", plant="van_der_pol").entries)["c"]
    assert failing.interval.median == 15 / 16


def test_a_failed_run_is_worst_in_every_metric():
    board = leaderboard(study(), ["tv_rate"])[0]
    table = study()
    c = table.column("tv_rate")[(table.column("plant") == "van_der_pol") & (table.column("law") == "c")]
    assert by_law(board.entries)["c"].interval.median == np.median(np.where(np.isnan(c), INF, c))


def test_the_order_of_rows_and_the_names_of_laws_change_nothing():
    table = study()
    boards = leaderboard(table, resamples=FEW)
    shuffled = leaderboard(table.taken(np.random.default_rng(1).permutation(96)), resamples=FEW)
    for board in boards:
        assert picked(shuffled, board.metric, **board.group) == board
    names = {"a": "z", "b": "y", "c": "x"}
    renamed = table.taken(slice(None))
    renamed.columns["law"] = np.array([names[law] for law in table.column("law")])
    for before, after in zip(boards, leaderboard(renamed, resamples=FEW), strict=True):
        old, new = by_law(before.entries), by_law(after.entries)
        for law, name in names.items():
            assert new[name].interval == old[law].interval
            assert new[name].rank.mean == pytest.approx(old[law].rank.mean)
            assert new[name].rank.best == old[law].rank.best
            assert (new[name].rank.low, new[name].rank.high) == (old[law].rank.low, old[law].rank.high)


def test_groups_may_be_conditions_or_all_runs_where_units_allow():
    table = study()
    (all_runs,) = leaderboard(table, ["itae"], by=())
    assert all_runs.cells == 32
    assert math.isnan(all_runs.entries[0].interval.median)  # rad and m, N and N m
    assert all_runs.winner == "a"
    (times,) = leaderboard(table, ["settling_time"], by=())
    assert math.isfinite(times.entries[0].interval.median)
    both = leaderboard(table, ["itae"], by=("plant", "condition"))
    assert [tuple(b.group.values()) for b in both[:2]] == [("van_der_pol", "nominal"), ("van_der_pol", "noise")]
    assert both[0].friedman is None


def test_only_runs_that_all_laws_have_are_compared():
    table = study()
    lacking = (table.column("law") == "b") & (table.column("seed") == 3) & (table.column("condition") == "noise")
    boards = leaderboard(table.taken(~lacking), ["itae"])
    assert [b.cells for b in boards] == [15, 15]
    assert {entry.interval.n for entry in boards[0].entries} == {8}
    without = leaderboard(table.taken((table.column("law") != "b") | (table.column("seed") != 3)), ["itae"])
    assert [(b.cells, b.seeds) for b in without] == [(14, 7), (14, 7)]


def test_a_metric_that_does_not_apply_has_no_board():
    assert leaderboard(study(), ["spread_settling_time"]) == []
    assert [b.metric for b in leaderboard(study(), ["spread_settling_time", "itae"])] == ["itae", "itae"]


def test_what_cannot_be_compared_is_refused():
    table = study()
    first = (table.column("law") == "a") == (table.column("condition") == "nominal")
    for bad, options, words in (
        (table.taken(slice(0, 0)), {}, "no runs"),
        (table, {"metrics": ["speed"]}, "unknown metric"),
        (table, {"metrics": ()}, "metrics is"),
        (table, {"by": ("law",)}, "unknown group"),
        (table, {"level": 1.5}, "level"),
        (table.taken(np.r_[0:96, 0]), {}, "several runs of a on van_der_pol, nominal, seed 0"),
        (table.taken(first), {}, "a, b, c have no run of van_der_pol in common"),
    ):
        with pytest.raises(ScenarioError, match=words):
            leaderboard(bad, **options)


def printed(boards: list[Board], width: int = 100) -> str:
    console = Console(width=width, file=io.StringIO())
    console.print(leaderboard_table(boards))
    return console.file.getvalue()


def test_the_table_says_who_wins_and_where_none_does():
    text = printed(leaderboard(study()))
    for words in ("van_der_pol", "16 runs,", "8 seeds", "winner", "no winner", "2 of 3*", "never", "95 % interval"):
        assert words in text
    assert "too few" in " ".join(printed(leaderboard(study(seeds=3))).split())
    assert max(map(len, printed(leaderboard(study()), width=80).splitlines())) <= 80


def test_a_real_table_has_what_a_leaderboard_needs():
    pa = pytest.importorskip("pyarrow")
    table_type = pytest.importorskip("smc_mujoco.table").Table
    columns = {name: values.tolist() for name, values in study().columns.items()}
    numbers = {name: pa.array(v, from_pandas=True) for name, v in columns.items() if isinstance(v[0], float)}
    table = table_type(data=pa.table(columns | numbers))
    assert leaderboard(table, resamples=FEW) == leaderboard(study(), resamples=FEW)
