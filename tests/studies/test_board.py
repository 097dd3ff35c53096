"""Boards in notebooks and papers: the numbers of the text board, escaped, and bold only what is not beaten."""

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
from smc_mujoco.evidence.report import words
from smc_mujoco.studies import board
from smc_mujoco.studies.board import Boards, Lead, spread
from smc_mujoco.studies.leaderboard import leaderboard

pytestmark = pytest.mark.quick

EVIL = r"50 % & <b>x_1^{2}</b> \ λ = 2 #~$"
LAWS = (EVIL, "second", "third")
SEEDS = 20
METRICS = ("itae", "settles", "ultimate_bound")


class Stand:
    """A stand-in for a study's table: three laws, the first clearly better in ITAE; one law never settles."""

    def __init__(self, seeds: int = SEEDS, conditions: tuple[str, ...] = ("nominal",)):
        laws, count = len(LAWS), seeds * len(conditions)
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
    for table in ElementTree.fromstring(f"<div>{boards._repr_html_().replace('<br>', '<br/>')}</div>").iter("table"):
        rows = [[" ".join(cell.itertext()) for cell in row if cell.tag == "td"] for row in table.iter("tr")]
        found.append({row[0]: row[1:] for row in rows if len(row) > 1})
    return found


@pytest.mark.parametrize(("first", "laws"), [("ultimate_bound", ["third", EVIL, "second"]), ("settles", [*LAWS])])
def test_laws_stand_by_place_in_the_first_metric_then_in_the_next(first, laws):
    (table,) = leaderboard(Stand(), metrics=(first, "itae")).tables
    assert [row[0].text for row in table.rows] == laws


def test_the_last_table_says_how_laws_failed():
    stand = Stand(conditions=("nominal", "noise"))
    stand.columns["failure"][-3:-1] = ["sensor lost, at t = 1 s", "sensor lost, at t = 2 s"]
    stand.columns["diverged_at"][:1] = 0.5
    first, last = (" ".join(table.notes) for table in leaderboard(stand, by=("plant", "condition")).tables)
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
    for ends in (spread(interval, "settling_time").split("–"), words.interval(median, low, high).split(" – ")):
        if any(ends):
            assert size(ends[0]) <= size(middle) <= size(ends[1])
    assert middle == words.number(median)
    assert board.size(math.inf, "itae") == "fails"


def test_only_what_no_law_beats_is_bold(boards):
    first, second = boards[0], boards[1]
    assert first.winner == "third"
    assert bold(first._repr_html_())[1:] == [cells(Boards([first]))[0]["third"][0].split()[0]]  # the first is the title
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
    assert {getattr(row[0], "text", row[0]): getattr(row[-1], "text", row[-1]) for row in table.rows} == {
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
    blocks = [dataclasses.replace(made.blocks[0], condition=name) for name in ("nominal", "x0=1, seed=2", "sine")]
    blocks[2] = dataclasses.replace(blocks[2], ahead=None, lead=None)
    assert "third wins under nominal; x0=1, seed=2" in dataclasses.replace(made, blocks=tuple(blocks)).result


def test_verdicts_are_said_once_with_their_metrics(boards):
    html = boards._repr_html_()
    assert boards[0].verdict.startswith("ITAE on duffing under nominal: third wins: ")
    assert text(boards[0].verdict) in html
    both = leaderboard(Stand(), metrics=["ultimate_bound", "ultimate_bound"])
    assert repr(both).count("no winner: cannot tell them apart") + repr(both).count("laws are level") == 1


def test_a_group_is_a_table_and_no_board_is_said(boards):
    several = leaderboard(Stand(conditions=("nominal", "noise")), by=("plant", "condition"), metrics=["itae"])
    html = several._repr_html_()
    assert bold(html)[::2] == ["duffing, nominal: 20 seeds", "duffing, noise: 20 seeds"]
    assert several.to_latex().count(r"\begin{tabular}") == 2
    assert "in a paired test, corrected for 2 comparisons a metric. Pairs of runs tell by how much" in html
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
    rows = {re.split(r"(?<!\\)&", row)[0].strip(): re.split(r"(?<!\\) & ", row[:-3]) for row in tabular[4:-2]}
    for law in ("second", "third"):
        plain = [re.sub(r"\\textbf\{(.*?)\} \[|\[|\]", r"\1 ", cell.replace("--", "–")) for cell in rows[law][1:]]
        plain = [re.sub(r"\$\\cdot\$10\$\^\{(-\d)\}\$", r"e\1", cell) for cell in plain]
        plain = [cell.replace(r"\textbf{", "").replace("}", "") for cell in plain]
        plain = [cell.replace(r"\%", "%").replace(",", "") for cell in plain]
        assert [" ".join(cell.split()) for cell in plain] == shown[law]
    assert lines[0] == "% duffing, nominal: 20 seeds"
    assert "needs booktabs" in boards.to_latex()


def test_latex_escapes_names(boards):
    (row,) = [line for line in boards.to_latex().splitlines() if line.startswith("50")]
    name, *sizes = re.split(r"(?<!\\) & ", row)
    escaped = (
        r"50 \% \& $<$b$>$x\_1\textasciicircum{}\{2\}$<$/b$>$ \textbackslash{} $\lambda$ = 2 \#\textasciitilde{}\$"
    )
    assert name == escaped
    assert len(sizes) == len(METRICS)


def test_latex_has_no_letter_that_an_engine_may_not_know():
    assert all(text.isascii() and (text.startswith(("\\", "$")) or c == "–") for c, text in TEX.items())
    assert all(text.count("$") % 2 == 0 for c, text in TEX.items() if c != "$")
    assert TEX["μ"] == r"$\mu$"
    assert TEX["ω"] == r"$\omega$"
    assert TEX["Ω"] == r"$\Omega$"
    assert TEX["₂"] == "$_2$"
    assert TEX["²"] == "$^2$"


# every word


@pytest.mark.parametrize(
    ("options", "stand"),
    [
        ({"metrics": (*METRICS, "settling_time")}, {}),
        ({"metrics": ["itae", "settling_time"], "relevant": 0.5}, {"seeds": 3}),
        ({"metrics": ["itae", "settles"], "by": ("plant", "condition")}, {"conditions": ("nominal", "noise")}),
        ({"metrics": ["itae"]}, {"conditions": tuple("abcde"), "seeds": 6}),
    ],
)
def test_boards_say_as_recorded(options, stand, snapshot):
    made = leaderboard(Stand(**stand), **options)
    units = [one.unit for one in made]
    assert f"{plain(made, 100)}{units}" == snapshot


def test_boards_of_plants_in_several_units_as_recorded(snapshot):
    """All metrics, by default; positions are in m and in rad."""
    stand = Stand(conditions=("nominal", "noise"))
    stand.columns["plant"] = np.where(stand.column("condition") == "noise", "inverted_pendulum", "duffing")
    assert plain(leaderboard(stand), 100) == snapshot


def test_why_there_is_no_winner_as_recorded(snapshot):
    (made,) = leaderboard(Stand(conditions=("nominal", "noise")), metrics=["itae"])
    first, second = made.blocks
    laws, none, about = (
        dict.fromkeys(LAWS, 2),
        dict.fromkeys(LAWS, 0),
        Search(rule="CMA-ES", evaluations=90, about_defaults=True),
    )
    about = Source(kind=TUNED, search=about)
    changes = {
        "one condition": {"blocks": (first,)},
        "wins here and there": {"blocks": (first, dataclasses.replace(second, ahead="second", best=("second",)))},
        "barred": {"blocks": (dataclasses.replace(first, untuned=("second", "third", EVIL)), second)},
        "all fail": {"blocks": (dataclasses.replace(first, ahead=None, best=(), lacking=laws),)},
        "never": {"blocks": (dataclasses.replace(first, ahead=None, best=(), lacking=laws),), "unit": "s"},
        "one law": {"entries": made.entries[:1], "blocks": (dataclasses.replace(first, ahead=None),)},
        "undecided": {
            "blocks": (dataclasses.replace(first, ahead=None, best=(), undecided=("second",), lacking=none),),
            "entries": tuple(dataclasses.replace(one, rank=one.rank._replace(best=False)) for one in made.entries),
        },
        "few sets": {"blocks": (dataclasses.replace(first, ahead=None, samples=3, sets=3),)},
        "linked sets": {"blocks": (dataclasses.replace(first, ahead=None, samples=2, sets=3),)},
        "few runs of two": {"blocks": (dataclasses.replace(first, ahead=None, samples=1, runs=7),)},
        "repeated runs": {
            "blocks": (dataclasses.replace(first, ahead=None, samples=4, runs=4),),
            "entries": tuple(dataclasses.replace(one, interval=one.interval._replace(n=4)) for one in made.entries),
        },
        "few for many": {"blocks": (dataclasses.replace(first, ahead=None, samples=6, runs=20),), "family": 40},
        "without an interval": {"blocks": (dataclasses.replace(first, lead=None),)},
        "searched about defaults": {
            "blocks": (dataclasses.replace(first, sets=3), second),
            "entries": tuple(
                dataclasses.replace(one, sources=(about,), failed=k) for k, one in enumerate(made.entries)
            ),
        },
        "sensor": {"metric": "ultimate_bound", "unit": "{x}", "resolution": 0.02, "by_step": True},
    }
    said = []
    for name, change in changes.items():
        one = dataclasses.replace(made, **change)
        failures = filter(None, [one.failures(entry) for entry in one.entries])
        said += [
            f"{name}: {one.result}; {one.too_few}; {', '.join(failures)}",
            *dict.fromkeys(each.sample for each in one.blocks),
        ]
        said += [board.key([one])] if name in ("repeated runs", "few for many", "sensor") else []
    assert "\n".join(said) == snapshot


def test_effects_in_words(snapshot):
    effects = [
        (0.85, 0.8, 0.9), (1.15, 1.1, 1.2), (0.95, 0.93, 1.02), (0.3, 0.2, 0.4), (0.3, 0.2, 0.5), (0.25, 0.0, 0.4),
        (0.0, 0.0, 0.3), (20.0, 12.0, 30.0), (20.0, 10.0, 30.0), (math.inf, 15.0, math.inf), (1.0, 1.0, 1.0),
        (0.9, 0.0, math.inf), (1.0, 0.98, 1.01), (0.9005, 0.9, 0.901), (math.inf, 2.0, math.inf),
    ]  # fmt: skip
    said = []
    for values in effects:
        effect = Effect(*values, 5, 8, True, 0.1)
        said += [board.size_in_words(effect), Lead("a", "b", effect._replace(sets=bool(len(said) % 4))).words]
    assert "\n".join(said) == snapshot
