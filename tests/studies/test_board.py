"""Boards in notebooks and papers: the numbers of the text board, escaped, and bold only what is not
beaten.
"""

import dataclasses
import math
import re
import types
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from smc_mujoco.analysis.bootstrap import Interval
from smc_mujoco.analysis.ranking import Effect
from smc_mujoco.common.errors import ScenarioError, find
from smc_mujoco.common.html import text
from smc_mujoco.common.tabular import TEX, plain
from smc_mujoco.control.source import TUNED, Search, Source
from smc_mujoco.studies import board
from smc_mujoco.studies.board import Boards, Lead, spread
from smc_mujoco.studies.leaderboard import leaderboard

pytestmark = pytest.mark.quick

EVIL = r"50 % & <b>x_1^{2}</b> \ λ = 2 #~$"
LAWS = (EVIL, "second", "third")
SEEDS = 20
METRICS = ("itae", "settles", "ultimate_bound")


class Stand:
    """A stand-in for a study's table: three laws, the first clearly better in ITAE; one law never
    settles.
    """

    def __init__(self, seeds: int = SEEDS, conditions: tuple[str, ...] = ("nominal",)):
        laws = len(LAWS)
        count = seeds * len(conditions)
        noise = np.random.default_rng(0).uniform(0.9, 1.1, (laws, count))
        sizes = np.array([[1.0], [2.0], [4e-7]])
        self.columns = {
            "plant": ["duffing"] * laws * count,
            "law": np.repeat(LAWS, count),
            "condition": np.tile(np.repeat(conditions, seeds), laws),
            "seed": np.tile(np.arange(seeds), laws * len(conditions)),
            "failure": [None] * laws * count,
            "diverged_at": np.full(laws * count, math.nan),
            "itae": (sizes[:] * noise).ravel(),
            "settling_time": np.repeat([0.5, 1.0, math.inf], count),
            "tv_rate": np.repeat([3.0, 2.0, 1.0], count),
            "ultimate_bound": np.repeat([0.1, 0.1, 0.1], count),
        }

    def column(self, name: str) -> np.ndarray:
        return np.asarray(find("column", name, self.columns))

    def scenario(self, i: int):
        raise ScenarioError("no run")


@pytest.fixture(scope="module")
def boards() -> Boards:
    return leaderboard(Stand(), metrics=METRICS)


def cells(boards: Boards) -> list[dict[str, list[str]]]:
    """The HTML's tables: law -> the text of its cells. It must be well-formed."""
    found = []
    for table in ElementTree.fromstring(
        f"<div>{boards._repr_html_().replace('<br>', '<br/>')}</div>"
    ).iter("table"):
        rows = []
        for row in table.iter("tr"):
            rows.append([" ".join(cell.itertext()) for cell in row if cell.tag == "td"])
        found.append({row[0]: row[1:] for row in rows if len(row) > 1})
    return found


@pytest.mark.parametrize(
    ("first", "laws"), [("ultimate_bound", ["third", EVIL, "second"]), ("settles", [*LAWS])]
)
def test_laws_stand_by_place_in_the_first_metric_then_in_the_next(first, laws):
    (table,) = leaderboard(Stand(), metrics=(first, "itae")).tables
    assert [row[0].text for row in table.rows] == laws


def test_the_last_table_says_how_laws_failed():
    stand = Stand(conditions=("nominal", "noise"))
    stand.columns["failure"][-3:-1] = ["sensor lost, at t = 1 s", "sensor lost, at t = 2 s"]
    stand.columns["diverged_at"][:1] = 0.5
    first, last = (
        " ".join(table.notes) for table in leaderboard(stand, by=("plant", "condition")).tables
    )
    assert "failed in" not in first
    assert f"{EVIL} failed in 1 of 40 runs, the first: it diverged." in last
    assert "third failed in 2 of 40 runs, the first: sensor lost, at t = 1 s. " in last


def bold(text: str) -> list[str]:
    return re.findall(r"<b>(.*?)</b>", text)


def test_html_has_the_numbers_of_the_text_board(boards):
    (shown,) = cells(boards)
    assert set(shown) == set(LAWS)
    text = plain(boards, 200)
    for law in LAWS:
        for middle, interval in (cell.split(" ")[:2] for cell in shown[law]):
            assert re.search(rf"(?<![\d.]){re.escape(middle)}[* \n]", text), middle
            assert re.search(rf"(?<![\d.]){re.escape(interval)}(?![\d.])", text), interval
    assert shown["third"][1].startswith("0 0–16")
    assert shown["second"][1].startswith("100 ")
    assert re.fullmatch(r"[34]\.\de-7 \S+e-7–\S+e-7 sees [\d.]+ %", shown["third"][0])


@given(st.lists(st.floats(1e-12, 1e7) | st.just(math.inf), min_size=3, max_size=3).map(sorted))
@example([0.606, 0.608, 0.612])
def test_printed_median_lies_in_its_printed_interval(values):
    def size(text: str) -> float:
        return float(text.replace("never", "inf").replace("<1e-9", "0"))

    low, median, high = values
    interval = Interval(median, low, high, 20)
    middle = board.size(median, "settling_time")
    ends = spread(interval, "settling_time").split("–")
    if any(ends):
        assert size(ends[0]) <= size(middle) <= size(ends[1])
    assert board.size(math.inf, "itae") == "fails"


def test_only_what_no_law_beats_is_bold(boards):
    first = boards[0]
    second = boards[1]
    assert first.winner == "third"
    assert bold(first._repr_html_())[1:] == [
        cells(Boards([first]))[0]["third"][0].split()[0]
    ]  # the first is the title
    assert set(second.best) == {EVIL, "second"}
    assert bold(second._repr_html_())[1:] == ["100", "100"]
    assert second.to_latex().count(r"\textbf{100}") == 2
    assert "100*" in repr(second)
    few = leaderboard(Stand(seeds=3), metrics=["itae"])
    assert few[0].best
    assert "textbf" not in few.to_latex()
    assert "*" not in repr(few)
    assert bold(few._repr_html_())[1:] == []
    assert "too few" in few._repr_html_()


def test_a_worst_case_stands_beside_its_law_and_one_without_runs_is_refused():
    found = types.SimpleNamespace(value=2.0, median=1.0, unit="rad", shown=str)
    (table,) = leaderboard(Stand(), METRICS, worst={"duffing": {"second": found}}).tables
    assert table.headings[-1] == "worst found (rad)"
    assert {len(row) for row in table.rows} == {len(table.headings)}
    assert {
        getattr(row[0], "text", row[0]): getattr(row[-1], "text", row[-1]) for row in table.rows
    } == {
        EVIL: "",
        "second": "2.0",
        "third": "",
    }
    for worst in ({"duffing": {"fourth": found}}, {"pendulum": {"second": found}}):
        with pytest.raises(ScenarioError, match="has no run in the table: leave it out"):
            leaderboard(Stand(), METRICS, worst=worst)


def test_names_with_commas_stand_between_semicolons():
    two = Stand(conditions=("nominal", "noise"))
    (made,) = leaderboard(two, ["itae"])
    assert made.result.startswith("third wins in both conditions")
    blocks = []
    for name in ("nominal", "x0=1, seed=2", "sine"):
        blocks.append(dataclasses.replace(made.blocks[0], condition=name))
    blocks[2] = dataclasses.replace(blocks[2], ahead=None, lead=None)
    assert (
        "third wins under nominal; x0=1, seed=2"
        in dataclasses.replace(made, blocks=tuple(blocks)).result
    )


def test_verdicts_are_said_once_with_their_metrics(boards):
    html = boards._repr_html_()
    assert boards[0].verdict.startswith("ITAE on duffing under nominal: third wins: ")
    assert text(boards[0].verdict) in html
    both = leaderboard(Stand(), metrics=["ultimate_bound", "ultimate_bound"])
    assert (
        repr(both).count("no winner: cannot tell them apart") + repr(both).count("laws are level")
        == 1
    )


def test_a_group_is_a_table_and_no_board_is_said(boards):
    several = leaderboard(
        Stand(conditions=("nominal", "noise")), by=("plant", "condition"), metrics=["itae"]
    )
    html = several._repr_html_()
    assert bold(html)[::2] == ["duffing, nominal: 20 seeds", "duffing, noise: 20 seeds"]
    assert several.to_latex().count(r"\begin{tabular}") == 2
    assert (
        "in a paired test, corrected for 2 comparisons a metric. Pairs of runs tell by how much"
        in html
    )
    assert "in a paired test. Pairs of runs tell by how much" in boards._repr_html_()
    assert "no boards" in Boards()._repr_html_()
    assert Boards().to_latex() == ""


# LaTeX


def test_latex_is_a_booktabs_table_of_the_same_numbers(boards):
    lines = boards.to_latex().splitlines()
    tabular = [line for line in lines if not line.startswith("%")]
    assert tabular[:2] == [r"\begin{tabular}{lrrr}", r"\toprule"]
    assert tabular[3] == r"\midrule"
    assert tabular[-2:] == [r"\bottomrule", r"\end{tabular}"]
    assert tabular[2] == r"law & ITAE (m s$^{2}$) & settles (\%) & ultimate bound (m) \\"
    (shown,) = cells(boards)
    rows = {}
    for row in tabular[4:-2]:
        rows[re.split(r"(?<!\\)&", row)[0].strip()] = re.split(r"(?<!\\) & ", row[:-3])
    for law in ("second", "third"):
        plain = []
        for cell in rows[law][1:]:
            plain.append(re.sub(r"\\textbf\{(.*?)\} \[|\[|\]", r"\1 ", cell.replace("--", "–")))
        plain = [re.sub(r"\$\\cdot\$10\$\^\{(-\d)\}\$", r"e\1", cell) for cell in plain]
        plain = [cell.replace(r"\textbf{", "").replace("}", "") for cell in plain]
        plain = [cell.replace(r"\%", "%").replace(",", "") for cell in plain]
        assert [" ".join(cell.split()) for cell in plain] == shown[law]
    assert lines[0] == "% duffing, nominal: 20 seeds"
    assert "needs booktabs" in boards.to_latex()


def test_latex_escapes_names(boards):
    (row,) = [line for line in boards.to_latex().splitlines() if line.startswith("50")]
    name, *sizes = re.split(r"(?<!\\) & ", row)
    escaped = r"50 \% \& $<$b$>$x\_1\textasciicircum{}\{2\}$<$/b$>$ \textbackslash{} $\lambda$ = 2 \#\textasciitilde{}\$"
    assert name == escaped
    assert len(sizes) == len(METRICS)


def test_latex_has_no_letter_that_an_engine_may_not_know():
    assert all(
        text.isascii() and (text.startswith(("\\", "$")) or c == "–") for c, text in TEX.items()
    )
    assert all(text.count("$") % 2 == 0 for c, text in TEX.items() if c != "$")
    assert TEX["μ"] == r"$\mu$"
    assert TEX["ω"] == r"$\omega$"
    assert TEX["Ω"] == r"$\Omega$"
    assert TEX["₂"] == "$_2$"
    assert TEX["²"] == "$^2$"


# what is said of every board


BOARDS = [
    ({"metrics": (*METRICS, "settling_time")}, {}),
    ({"metrics": ["itae", "settling_time"], "relevant": 0.5}, {"seeds": 3}),
    (
        {"metrics": ["itae", "settles"], "by": ("plant", "condition")},
        {"conditions": ("nominal", "noise")},
    ),
    ({"metrics": ["itae"]}, {"conditions": tuple("abcde"), "seeds": 6}),
    ({}, {"conditions": ("nominal", "noise")}),
]


@pytest.mark.parametrize(("options", "stand"), BOARDS, ids=range(len(BOARDS)))
def test_every_column_has_its_unit_every_cell_its_interval_and_each_metric_one_verdict_with_what_it_is_of(
    options, stand
):
    data = Stand(**stand)
    if not options:  # all metrics, of plants in m and in rad
        data.columns["plant"] = np.where(
            data.column("condition") == "noise", "inverted_pendulum", "duffing"
        )
    made = leaderboard(data, **options)
    said = " ".join(plain(made, 100).split())
    tables = made.tables
    names = {"itae": "ITAE", "settles": "share that settles", "ultimate_bound": "ultimate bound"}
    for one in made:
        length = "rad" if "pendulum" in one.about else "m"
        force = "N m" if length == "rad" else "N"
        units = {"itae": "{x} s^2", "settles": "", "ultimate_bound": "{x}", "settling_time": "s"}
        assert one.unit == units.get(one.metric, one.unit)
        heading = f"({(one.unit or '%').replace('{x}', length).replace('{u}', force)})"
        assert any(
            heading in " ".join(str(cell).split()) for table in tables for cell in table.headings
        )
        assert names.get(one.metric, "") in said
        assert all(name in one.verdict for name in (one.label, *one.group.values()))
        assert (one.winner is None) == ("no winner" in one.result)
        assert one.winner is None or f"{one.winner} wins" in one.result
        few = stand.get("seeds", SEEDS) < 20  # for one or five comparisons
        assert ("too few" in one.result) is few
        for entry in one.entries:
            low, _, high = spread(entry.interval, one.metric).partition("–")
            assert low in said
            assert high in said
    assert all(f"{stand.get('seeds', SEEDS)} seeds" in table.title for table in tables)
    assert ("corrected for" in said) == (made[0].family > 1)
    assert f"{100 * options.get('relevant', 0.03):.0f} % of the larger value" in said
    assert ("fewer than 6" in said) == (stand.get("seeds", SEEDS) < 6)


@pytest.fixture(scope="module")
def pair() -> board.Board:
    """The board of one metric under two conditions, in both of which the third law wins."""
    (made,) = leaderboard(Stand(conditions=("nominal", "noise")), metrics=["itae"])
    return made


REASONS = {  # changes of the first block -> what stands instead of a winner
    "barred": ({"untuned": ("second", "third", EVIL)}, "third wins under noise"),
    "all fail": (
        {"ahead": None, "best": (), "lacking": dict.fromkeys(LAWS, 2)},
        "every law has runs that fail",
    ),
    "undecided": ({"ahead": None, "best": (), "undecided": ("second",)}, "too few samples to tell"),
    "few sets": (
        {"ahead": None, "samples": 3, "sets": 3},
        "3 sets of gains, too few for 2 comparisons: take 7 seeds (--seeds 7) and as many",
    ),
    "linked sets": (
        {"ahead": None, "samples": 2, "sets": 3},
        "3 sets of gains: 2 samples, too few",
    ),
    "few runs of two": (
        {"ahead": None, "samples": 1, "runs": 7},
        "7 distinct runs: 1 sample, too few",
    ),
    "repeated runs": ({"ahead": None, "samples": 4, "runs": 4}, "4 distinct runs, too few"),
}


@pytest.mark.parametrize("reason", REASONS)
def test_where_there_is_no_winner_the_reason_is_said(reason, pair):
    change, said = REASONS[reason]
    blocks = [dataclasses.replace(pair.blocks[0], **change)] + [pair.blocks[1]] * (
        reason == "barred"
    )
    entries = tuple(
        dataclasses.replace(one, rank=one.rank._replace(best=False)) for one in pair.entries
    )
    one = dataclasses.replace(
        pair, blocks=tuple(blocks), entries=entries if reason == "undecided" else pair.entries
    )
    assert one.result.startswith("no winner")
    assert said in one.result
    assert ("too few for" in one.too_few) == ("too few for" in one.result)


def test_a_winner_is_told_by_how_much_for_which_gains_and_in_which_conditions(pair):
    first, second = pair.blocks
    both = pair.result
    assert both.startswith("third wins in both conditions: at least ")
    assert both.endswith(", ahead in 20 of 20 runs, for these gains")
    turned = dataclasses.replace(second, ahead="second", best=("second",), worse=("third",))
    here = dataclasses.replace(pair, blocks=(first, turned))
    assert here.result.startswith(
        "no winner in both conditions: third wins under nominal, loses under noise"
    )
    assert dataclasses.replace(pair, blocks=(dataclasses.replace(first, lead=None),)).result == (
        "third wins, for these gains"
    )
    alone = dataclasses.replace(
        pair, entries=pair.entries[:1], blocks=(dataclasses.replace(first, ahead=None),)
    )
    assert alone.result == "no winner: one law"
    ever = dataclasses.replace(first, ahead=None, best=(), lacking=dict.fromkeys(LAWS, 2))
    assert "never end" in dataclasses.replace(pair, blocks=(ever,), unit="s").result
    many = dataclasses.replace(
        pair, blocks=(dataclasses.replace(first, ahead=None, samples=6, runs=20),), family=40
    )
    assert "6 samples, too few for 40 comparisons" in many.result
    assert "corrected for 40 comparisons" in board.key([many])
    about = Source(kind=TUNED, search=Search(rule="CMA-ES", evaluations=90, about_defaults=True))
    entries = tuple(
        dataclasses.replace(one, sources=(about,), failed=k) for k, one in enumerate(pair.entries)
    )
    searched = dataclasses.replace(pair, entries=entries)
    assert "about its defaults and not by the rule" in searched.result
    failures = [searched.failures(one) for one in entries]
    assert [bool(words) for words in failures] == [False, True, True]
    assert "2 of 40" in failures[2]
    sensor = dataclasses.replace(
        pair, metric="ultimate_bound", unit="{x}", resolution=0.02, by_step=True
    )
    assert board.key([sensor]) != board.key(
        [dataclasses.replace(sensor, resolution=0.0, by_step=False)]
    )


EFFECTS = [  # ratio, its interval, the size in words
    (0.85, 0.8, 0.9, "15 % less (10 to 20 %)"),
    (1.15, 1.1, 1.2, "15 % more (10 to 20 %)"),
    (0.95, 0.93, 1.02, "5 % less (-2 to 7 %)"),
    (0.3, 0.2, 0.4, "3.33 times less (2.50 to 5.00 times)"),
    (0.3, 0.2, 0.5, "70 % less (50 to 80 %)"),
    (0.25, 0.0, 0.4, "4.00 times less (2.50 times or more)"),
    (0.0, 0.0, 0.3, "the other has no value in most runs"),
    (20.0, 12.0, 30.0, "20.0 times as much (12.0 to 30.0 times)"),
    (20.0, 10.0, 30.0, "1900 % more (900 to 2900 %)"),
    (1.0, 1.0, 1.0, "no difference"),
    (math.inf, 15.0, math.inf, "the other alone has a value in most runs"),
    (0.9, 0.0, math.inf, "10 % less (too few for an interval)"),
]


@pytest.mark.parametrize(("ratio", "low", "high", "said"), EFFECTS)
def test_a_difference_is_told_in_percent_or_in_times_with_its_interval(ratio, low, high, said):
    effect = Effect(ratio, low, high, 5, 8, True, 0.1)
    assert board.size_in_words(effect) == said
    for sets, of in ((False, "runs"), (True, "sets of gains")):
        assert Lead("a", "b", effect._replace(sets=sets)).words.endswith(f", ahead in 5 of 8 {of}")
