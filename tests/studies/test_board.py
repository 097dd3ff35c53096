"""Boards: each cell has its number, its interval and its marks, in text, HTML and LaTeX; and why no
law wins is said.
"""

import dataclasses
import math
import re
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from helpers.tables import MadeTable, changed, table_of
from hypothesis import example, given
from hypothesis import strategies as st

import smc_mujoco as smc
from smc_mujoco.analysis.paired_runs import floor
from smc_mujoco.analysis.ranking import Effect
from smc_mujoco.answers.answers import evidence
from smc_mujoco.answers.explain import meaning
from smc_mujoco.answers.facts import Barred, Lead, NotRanked, Open, Tied
from smc_mujoco.common.tabular import TEX, plain_text
from smc_mujoco.common.text import number, span
from smc_mujoco.draw import dot_plot
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.studies.block import Block
from smc_mujoco.studies.board import Board
from smc_mujoco.studies.board_numbers import median_text, sizes
from smc_mujoco.studies.board_tables import Boards
from smc_mujoco.studies.leaderboard import leaderboard

pytestmark = pytest.mark.quick

EVIL = r"50 % & <b>x_1^{2}</b> \ λ = 2 #~$"
LAWS = (EVIL, "second", "third")
METRICS = ("itae", "settles", "ultimate_bound")


def made(seeds: int = 20, conditions: tuple[str, ...] = ("nominal",)) -> MadeTable:
    """Three laws, the last clearly better in ITAE, which never settles."""
    count = seeds * len(conditions)
    noise = np.random.default_rng(0).uniform(0.9, 1.1, (len(LAWS), count))
    return MadeTable(
        law=np.repeat(LAWS, count),
        condition=np.tile(np.repeat(conditions, seeds), len(LAWS)),
        seed=np.tile(np.arange(seeds), len(LAWS) * len(conditions)),
        itae=(np.array([[1.0], [2.0], [4e-7]]) * noise).ravel(),
        settling_time=np.repeat([0.5, 1.0, math.inf], count),
        tv_rate=np.repeat([3.0, 2.0, 1.0], count),
        ultimate_bound=np.full(len(LAWS) * count, 0.1),
    )


NO_WINNER = "no winner in these metrics"


@pytest.fixture(scope="module")
def boards() -> Boards:
    return leaderboard(made(), metrics=METRICS)


def cells_of_html(boards: Boards) -> dict[str, list[str]]:
    """Law -> the text of its cells in the last HTML table, which must be well-formed."""
    text = boards.full._repr_html_().replace("<br>", "<br/>")
    rows = {}
    for row in ElementTree.fromstring(f"<div>{text}</div>").iter("tr"):
        name, *cells = [" ".join(cell.itertext()) for cell in row]
        if cells:
            rows[name.removesuffix(" given")] = cells
    del rows["law"]
    return rows


@pytest.mark.parametrize(
    ("first", "laws"),
    [
        ("ultimate_bound", ["third", EVIL, "second"]),
        ("settles", [*LAWS]),
    ],
)
def test_laws_stand_by_place_in_the_first_metric_then_in_the_next(first, laws):
    (table,) = leaderboard(made(), metrics=(first, "itae")).tables
    assert [row[0].text for row in table.rows] == laws


def test_laws_that_share_a_place_stand_by_their_median():
    scores = {"b": 1.0 + 0.01 * np.ones((1, 12)), "a": 1.0 + 0.02 * np.ones((1, 12))}
    (table,) = leaderboard(table_of(scores), metrics=["itae"]).tables
    assert [row[0].text for row in table.rows] == ["b", "a"]


def test_the_last_table_says_how_laws_failed():
    table = made(conditions=("nominal", "noise"))
    table.columns["failure"][-3:-1] = ["sensor lost, at t = 1 s", "sensor lost, at t = 2 s"]
    table.columns["diverged_at"][:1] = 0.5
    first, last = leaderboard(table, by=("plant", "condition")).tables
    assert "failed in" not in " ".join(first.notes)
    for note in (
        f"{EVIL} failed in 1 of 40 runs, first: it diverged.",
        "third failed in 2 of 40 runs, first: sensor lost, at t = 1 s.",
    ):
        assert note in last.notes


@pytest.mark.parametrize(
    ("touched", "said"),
    [
        ([False] * 4, "No run touches a stop or an obstacle on duffing under contact"),
        ([True, True, False, False], "No run of b touches a stop or an obstacle on duffing under"),
        ([True, False, False, True], ""),
        ([False, None, None, False], ""),  # a run that failed may have touched
        ([None] * 4, ""),
    ],
)
def test_the_last_table_says_where_no_run_touches(touched, said):
    law, condition = ["a", "a", "b", "b"], ["contact"] * 4
    table = MadeTable(
        law=law, condition=condition, seed=[0, 1, 0, 1], itae=[1.0, 2.0, 3.0, 4.0], touched=touched
    )
    text = repr(leaderboard(table, ["itae"]))
    if said:
        assert said in " ".join(text.split())
    else:
        assert "touches" not in text


def test_html_and_latex_have_the_numbers_of_the_text(boards):
    """Also of a law whose name each of them must escape."""
    (table,) = boards.tables
    text = plain_text(boards.full, 200)
    html = cells_of_html(boards)
    latex = {}
    inside = boards.to_latex().split(r"\midrule")[2].partition(r"\bottomrule")[0]
    for row in inside.split(r"\addlinespace"):
        lines = []
        for line in row.strip().splitlines():
            lines.append(re.split(r"(?<!\\) & ", line.removesuffix(r" \\")))
        name, *rest = zip(*lines, strict=True)
        latex[name[0]] = rest
        assert name[1] == r"\footnotesize given"
    assert list(html) == ["third", EVIL, "second"]
    escaped = r"50 \% \& $<$b$>$x\_1\textasciicircum{}\{2\}$<$/b$>$ \textbackslash{} $\lambda$ = 2"
    assert list(latex)[1].startswith(escaped)
    for row, in_latex in zip(table.rows, latex.values(), strict=True):
        for cell, html_text, tex in zip(
            row[1:],
            html[row[0].text],
            in_latex,
            strict=True,
        ):
            parts = [cell.text, *cell.below.splitlines()]
            assert " ".join(parts) in html_text.replace(" *", "")
            for part in parts:
                assert re.search(rf"(?<![\d.]){re.escape(part)}[* \n]", text), part
            for part, line in zip(parts, tex, strict=False):
                shared = r"([\d.]+)e(-\d)–([\d.]+)e\2"
                power = re.sub(shared, r"(\1--\3)$\\cdot10^{\2}$", part)
                power = re.sub(r"([\d.]+)e(-\d)", r"$\1\\cdot10^{\2}$", power)
                assert power.replace("–", "--") in line
    assert re.fullmatch(r"[34]\.\de-7", table.rows[0][1].text)  # 4e-7 times 0.9 to 1.1
    below = table.to_latex().partition("bottomrule")[2]
    assert "Third: ITAE" in below
    assert "; final error: " in below
    (few,) = leaderboard(made(seeds=3), metrics=["itae"]).tables
    assert "Third:" not in few.to_latex().partition("bottomrule")[2]
    assert table.rows[2][2][:2] == ("100", "84–100")


@given(st.lists(st.floats(1e-12, 1e7) | st.just(math.inf), min_size=3, max_size=3).map(sorted))
@example([0.606, 0.608, 0.612])
@example([1e-12, 1e-11, 1e-10])
def test_a_printed_median_lies_in_its_printed_interval(values):
    def number(text: str) -> float:
        return float(text.replace("never", "inf").replace("<1e-9", "0"))

    texts = sizes(values, "settling_time")
    ends = re.split("–| to ", span(texts[0], texts[2]))
    if any(ends):
        assert number(ends[0]) <= number(texts[1]) <= number(ends[1])
    else:
        assert texts[0] == texts[1] == texts[2]


DIGITS = [  # value, metric, text
    (0.12345, "itae", "0.123"),
    (math.inf, "itae", "fails"),
    (math.inf, "settling_time", "never"),
    (0.525, "settles", "52"),
    (2.34567, "objective", "2.35"),
    (math.nan, "itae", ""),
]


@pytest.mark.parametrize(("value", "metric", "text"), DIGITS)
def test_a_number_of_a_board_has_three_digits(value, metric, text):
    assert [median_text(value, metric)] == sizes([value], metric) == [text]


def test_a_cell_has_one_notation():
    table = made()
    table.columns["itae"][:20] = np.geomspace(3e-5, 4e-3, 20)
    halves = np.full(60, None, object)
    halves[:20] = '{"itae": 0.01}'
    table.columns["half_step"] = halves
    cells = {row[0].text: row[1] for row in leaderboard(table, ["itae"]).tables[0].rows}
    cell = cells[EVIL]
    assert re.fullmatch(r"\d\.\de-4", cell.text)
    assert re.fullmatch(r"\d\.\de-4–\d\.\de-3", cell.below)
    assert cell.alarm == f"some runs {cell.text}, at half the step 1.0e-2"


def test_only_what_no_law_beats_is_marked(boards):
    def marked(boards):
        return [[cell.strong for cell in row[1:]] for row in boards.tables[0].rows]

    assert marked(boards) == [[True, False, True], [False, True, True], [False, True, True]]
    assert r"\textbf{100}" in boards.to_latex()
    assert "<b>100</b>" in boards._repr_html_()
    assert "100*" in repr(boards.full)
    few = leaderboard(made(seeds=3), metrics=["itae"])
    assert not few[0].best
    for conditions, needed in (("nominal",), 6), (("nominal", "noise"), 7):
        (board,) = leaderboard(made(seeds=3, conditions=conditions), metrics=["itae"])
        fact: Any = board.blocks[0].verdict
        assert fact.needed == needed  # of one block, and of two
    assert not any(map(any, marked(few)))
    wide = made()  # twenty runs are enough, but these say too little of a median
    wide.columns["itae"] = np.exp(20.0 * np.random.default_rng(1).normal(size=60))
    blind = leaderboard(wide, metrics=["itae"])
    (block,) = blind[0].blocks
    assert len(blind[0].best) == 3
    assert not any(map(any, marked(blind)))
    fact: Any = block.verdict
    assert (fact.hidden > 0.995, fact.needed) == (True, 0)
    some_boards = made()  # the first median is known within a factor of 10, the others within 1.2
    random = np.random.default_rng(3)
    some_boards.columns["itae"] = np.exp(np.repeat([2.5, 0.1, 0.1], 20) * random.normal(size=60))
    board = leaderboard(some_boards, metrics=["itae"])[0]
    assert board.winner is None
    assert EVIL in board.best
    cells = {row[0].text: row[1] for row in Boards([board]).tables[0].rows}
    assert [cells[law].strong for law in LAWS] == [False, True, True]
    fact: Any = board.blocks[0].verdict
    assert fact == Open(metric="ITAE", laws=board.best, hidden=fact.hidden)
    seen = f"{100 * fact.hidden:.2g}"
    assert f"{seen} %" in repr(board)
    assert rf"(leads below {seen}~\% might not show)" in Boards([board]).to_latex()


@pytest.mark.parametrize("conditions", [("nominal",), ("nominal", "noise", "sine")])
@pytest.mark.parametrize("never", [0.0, 0.4, 1.0])  # share of the rivals' runs
@pytest.mark.parametrize("spread", [0.1, 3.0, 9.0])
def test_a_law_that_wins_is_marked_and_its_ratio_is_a_number(never, spread, conditions):
    """It was "0 of classical (0 to .5)" where its runs never settle."""
    table = made(conditions=conditions)
    random = np.random.default_rng(int(10 * (spread + never)))
    times = np.exp(random.normal(size=(3, 20 * len(conditions))) * spread)
    times[2] *= np.exp(-4.0 * spread - 1.0)
    times[:2][random.random(times[:2].shape) < never] = math.inf
    table.columns["settling_time"] = times.ravel()
    (board,) = ranked_boards = leaderboard(table, metrics=["settling_time"])
    assert board.winner == "third"
    assert ranked_boards.tables[0].rows[0][1].strong
    for block in board.blocks:
        fact: Any = block.verdict
        assert (fact.law, fact.metric, fact.samples) == ("third", "settling time", 20)
        if never:
            assert re.fullmatch(r"\d+ of 20", fact.gaps)
            assert math.isnan(fact.low)
        else:
            assert 0.0 < fact.low <= 1.0 - fact.ratio <= fact.high <= 1.0
            assert fact.gaps == ""


def test_a_plot_has_a_ring_around_each_winner_and_no_other_dot():
    table = made(conditions=("nominal", "noise"))
    metrics = ["itae", "ultimate_bound"]
    winners = leaderboard(table, metrics).winners
    assert winners == [("itae", "duffing", name, "third") for name in ("nominal", "noise")]
    drawn = dot_plot.plot(table, metrics=metrics, winners=winners)
    rings = []
    for ax in drawn.axes:
        hollow = [line for line in ax.lines if line.get_markerfacecolor() == "none"]
        rings.append([float(np.asarray(line.get_xdata())[0]) for line in hollow])
    of_third = table.column("itae")[table.column("law") == "third"]
    assert len(rings[0]) == 2
    assert min(of_third) <= min(rings[0]) <= max(rings[0]) <= max(of_third)
    assert rings[1] == []


@pytest.mark.parametrize(
    ("metric", "winners", "said"),
    [
        ("itae", [("itae", "duffing", "nominal", "third")], ["winner"]),
        ("ultimate_bound", [("itae", "duffing", "nominal", "third")], [NO_WINNER]),
        ("itae", [], [NO_WINNER]),
        ("itae", None, []),
    ],
)
def test_the_key_of_a_plot_says_what_a_ring_is_or_that_no_law_of_these_metrics_wins(
    metric, winners, said
):
    """A reader who had seen stars in a table took a plot without rings for a fault."""
    drawn = dot_plot.plot(made(), metrics=[metric], winners=winners)
    words = [text.get_text() for legend in drawn.legends for text in legend.get_texts()]
    assert [word for word in words if "winner" in word] == said


def test_an_axis_is_logarithmic_where_a_condition_is_several_times_as_slow():
    """Settling times under a disturbance are ten times the others, of laws that are close."""
    table = made(conditions=("nominal", "noise"))
    for slower, scale in ((10.0, "log"), (3.0, "linear")):
        times = np.repeat([0.32, 0.36, 0.40], 40)
        times[table.column("condition") == "noise"] *= slower
        table.columns["settling_time"] = times
        (ax,) = dot_plot.plot(table, metrics=["settling_time"]).axes
        assert ax.get_xscale() == scale


def test_a_law_has_its_label_in_latex_and_plots_and_values_below_the_floor_are_shaded(tmp_path):
    @smc.law_function(gains={"k": 20.0}, label="Root sliding")
    def root_sliding(y, gains, memory):
        return -gains.k * y.e - 5.0 * y.de, y.e

    plant = dataclasses.replace(smc.plant("inverted_pendulum"), label="My rod")
    runs = smc.grid(plant, [root_sliding, "pid"], ["nominal", "noise"], 2, duration=1.5)
    table = smc.study(runs, tmp_path)
    boards = leaderboard(table, ["ultimate_bound"], by=("plant", "condition"))
    latex = boards.to_latex()
    for condition in ("nominal", "noise"):
        assert rf"\footnotesize\raggedright My rod, {condition}: 2 runs a law" in latex
    assert "\nRoot sliding &" in latex
    assert "root_sliding" in repr(boards)
    drawn = dot_plot.plot(table.select(condition="nominal"), metrics=["ultimate_bound"])
    (ax,) = drawn.axes
    assert [text.get_text() for text in ax.get_yticklabels()] == ["Root sliding", "PID"]
    (ax,) = dot_plot.plot(table, metrics=["ultimate_bound"]).axes
    least_x, _ = ax.get_xlim()
    floors = []
    for condition in ("nominal", "noise"):
        floors.append(floor(table.select(condition=condition).scenario(0), "ultimate_bound"))
    ends = [shade.get_datalim(ax.transData).x1 for shade in ax.collections]
    assert ends == pytest.approx([max(least_x, floors[0]), max(least_x, floors[1])])
    assert least_x < floors[1]


def test_a_title_in_latex_has_words_and_one_of_a_terminal_has_names():
    table = made(conditions=("delay_10ms",))
    table.columns["plant"] = np.full(60, "inverted_pendulum")
    (board,) = leaderboard(table, ["itae"])
    (summed,) = Boards([dataclasses.replace(board, summed=("noise", "light_load"))]).tables
    assert (
        summed.title
        == "inverted_pendulum, delay_10ms under noise and light_load: 20 runs a law, one set of gains"
    )
    assert (
        summed.label
        == "Inverted pendulum, delay 10 ms under noise and light load: 20 runs a law, one set of gains"
    )


@pytest.mark.parametrize(
    ("metric", "heading"),
    [
        ("settles", "settled runs"),
        ("settling_time", "settling time"),
        ("ultimate_bound", "final error"),
        ("itae", "ITAE"),
        ("tv_rate", "variation of u"),
    ],
)
def test_latex_says_in_print_what_its_own_columns_are(metric, heading):
    (table,) = leaderboard(made(), [metric]).tables
    metrics = "settled runs", "settling time", "final error", "ITAE", "variation of u"
    said = [name for name in metrics if meaning(name) in table.under[-1]]
    assert said == [heading]


def test_what_latex_says_of_all_tables_stands_below_the_last_one_only():
    table = made(conditions=("nominal", "noise"))
    nominal = np.flatnonzero(table.column("condition") == "nominal")
    table.columns["settling_time"] = np.full(120, math.inf)
    table.columns["half_step"] = np.full(120, None, object)
    table.columns["half_step"][nominal[:20]] = '{"itae": 10.0}'
    first, last = leaderboard(table, ["itae"], by=("plant", "condition")).tables
    (wins,) = first.under
    assert wins.startswith("Third: ITAE")
    *_, key = last.under
    for word in ("shipped", "ITAE", "may be the best", "some runs"):  # a step of the first one
        assert key.count(meaning(word)) == 1
    assert "(a):~" in first.to_latex()
    assert "(a):~" not in last.to_latex()
    assert meaning("floor") not in key


def test_a_verdict_that_says_below_is_no_cell_below_a_floor():
    random = np.random.default_rng(0)
    table = made()
    table.columns["itae"] = np.exp(0.3 * random.normal(size=60))
    boards = leaderboard(table, ["itae"])
    assert "leads below" in repr(boards[0])
    (tabular,) = boards.tables
    assert meaning("floor") not in tabular.under[-1]


def test_the_shade_below_the_floor_begins_at_0_on_a_linear_axis():
    table = made()
    table.columns["tv_rate"] = np.repeat([30.0, 20.0, 0.0], 20)
    (ax,) = dot_plot.plot(table, metrics=["tv_rate"]).axes
    assert ax.get_xscale() == "linear"
    assert ax.get_xlim()[0] < 0.0
    (shade,) = ax.collections
    assert shade.get_datalim(ax.transData).x0 == 0.0


def test_a_name_is_no_formula_in_a_plot_and_no_command_in_latex():
    """One ended in matplotlib's ValueError, another lost its dollars."""
    table = made(conditions=("nominal\n\\end{document}", "noise"))
    names = dict(zip(LAWS, (r"$\write18{id}$", "a $5$ b", "third"), strict=True))
    table.columns["law"] = np.array([names[law] for law in table.column("law")])
    drawn = dot_plot.plot(table, metrics=["itae"])
    drawn.canvas.draw()
    labels = [text for ax in drawn.axes for text in ax.get_yticklabels()]
    assert not any(text.get_parse_math() for text in labels)
    latex = leaderboard(table, ["itae"], by=("plant", "condition")).to_latex()
    assert r"\$\textbackslash{}write18\{id\}\$" in latex
    assert r"a \$5\$ b" in latex
    for line in latex.splitlines():
        assert line.startswith("%") or r"\end{document}" not in line


def test_half_a_step_that_moves_a_median_is_an_alarm():
    table = made()
    halves = []
    for value in table.column("itae")[:20]:
        halves.append(f'{{"itae": {1.5 * value}}}')
    table.columns["half_step"] = np.array([*halves, *[None] * 40], object)
    rows = {}
    for row in leaderboard(table, ["itae"]).tables[0].rows:
        rows[row[0].text] = row[1]
    before = float(np.median(table.column("itae")[:20]))
    moved = f"some runs {median_text(before, 'itae')}, at half the step {median_text(1.5 * before, 'itae')}"
    assert rows[EVIL].alarm == moved
    assert rows["second"].alarm == ""


def test_each_group_has_a_table_with_its_units_and_its_sample():
    table = made(conditions=("nominal", "noise"))
    pendulum = table.column("condition") == "noise"
    table.columns["plant"] = np.where(pendulum, "inverted_pendulum", "duffing")
    metrics = [*METRICS, "settling_time", "tv_rate"]
    boards = leaderboard(table, metrics, ("plant", "condition"))
    first, second = boards.tables
    units = "m s^2", "%", "m", "s", "N/s", "rad s^2", "%", "rad", "s", "N m/s"
    for heading, unit in zip([*first.headings[1:], *second.headings[1:]], units, strict=True):
        assert f"({unit})" in heading
    assert first.title == "duffing, nominal: 20 runs a law, one set of gains"
    assert second.title == "inverted_pendulum, noise: 20 runs a law, one set of gains"
    for board in boards:
        for fact in board.verdicts.values():
            assert (board.winner is None) != isinstance(fact, Lead)
    assert "no boards" in Boards()._repr_html_()
    assert Boards().to_latex() == ""


def test_a_metric_in_a_unit_without_a_floor_says_so(monkeypatch):
    sentence = "no floor is known for a metric in 'W', so any difference counts"
    (board,) = leaderboard(made(), ["itae"])
    assert sentence not in board.lines
    entry = dataclasses.replace(CATALOGUE["itae"], unit="W")
    monkeypatch.setitem(CATALOGUE, "itae", entry)
    (board,) = leaderboard(made(), ["itae"])
    assert board.lines[-1] == sentence


def test_latex_has_no_letter_that_an_engine_may_not_know():
    for character, text in TEX.items():
        assert text.isascii()
        assert text.startswith(("\\", "$")) or text in {"--", "~"}
        assert character == "$" or text.count("$") % 2 == 0


@pytest.fixture(scope="module")
def pair() -> Board:
    """The board of one metric under two conditions, in both of which the third law wins."""
    return leaderboard(made(conditions=("nominal", "noise")), metrics=["itae"])[0]


def verdicts_of(metric="itae", floor="0.1 m", untuned=(), samples=20, **fields) -> Block:
    """A block of three laws in one family, the last of which wins; `fields` are arrays by law."""

    def column(name, default):
        return np.broadcast_to(np.atleast_2d(fields.pop(name, default)).T, (3, 1))

    centres = column("centres", (1.0, 2.0, 0.5))
    comparison: Any = SimpleNamespace(
        laws=LAWS,
        shares=metric == "settles",
        family=1,
        relevant=0.05,
        winners=[fields.pop("winner", "third")],
        centres=centres,
        without_value=column("without_value", 0),
        away=column("away", False)[..., None],
        below=column("below", False),
        best=column("best", False),
        worse=column("worse", False),
        ranked=column("ranked", True),
        sets=column("sets", 1),
        units=column("units", 20),
        samples=np.full((1, 3, 3), samples),
        seeds=np.array([20]),
        level=np.full((1, 3, 3), fields.pop("level", True)),
        effect=lambda at, law, rival: fields["effect"],
        visible=lambda at, law, rival: fields["visible"],
        charged=lambda at, law, rival: fields["charged"],
    )
    about: Any = {"plant": "duffing", "condition": "nominal", "seeds": 20}
    return Block(comparison=comparison, metric=metric, floor=floor, untuned=untuned, **about)


TWO = (True, True, False)
LOST = {"winner": None}
OPEN = LOST | {"best": TWO, "level": False, "visible": 0.27}
FEW = LOST | {"samples": 3, "sets": 3}
REASONS = {  # changes of a block -> the verdict
    "few sets below the floor": (
        FEW | {"below": True, "floor": "0.1 m"},
        Tied(metric="ITAE", laws=LAWS, floor="0.1 m"),
    ),
    "two of the best below the floor": (
        LOST | {"below": TWO, "best": True, "floor": "0.1 m"},
        Tied(metric="ITAE", laws=LAWS[:2], floor="0.1 m"),
    ),
    "barred": (
        {"untuned": ("second", "third")},
        Barred(metric="ITAE", laws=("second",), defaults=True),
    ),
    "all fail": (LOST | {"away": True}, Barred(metric="ITAE", laws=LAWS, defaults=False)),
    "few sets": (FEW, Open(metric="ITAE", laws=LAWS, needed=6, unit="sets of gains")),
    "few runs": (
        LOST | {"samples": 4},
        Open(metric="ITAE", laws=LAWS, needed=6, unit="runs"),
    ),
    "few runs and sets": (
        LOST | {"samples": 4, "sets": (12, 12, 1)},
        Open(metric="ITAE", laws=LAWS, needed=6, unit="sets of gains or runs"),
    ),
    "enough to win but not to rank": (
        LOST | {"samples": 7},
        Open(metric="ITAE", laws=LAWS, needed=9, unit="runs"),
    ),
    "one ranked": (
        LOST | {"ranked": (True, False, False)},
        Open(metric="ITAE", laws=LAWS, needed=21, unit="runs"),
    ),
    "level": (LOST | {"best": TWO}, Tied(metric="ITAE", laws=LAWS[:2])),
    "open": (OPEN | {"charged": 0.0}, Open(metric="ITAE", laws=LAWS[:2], hidden=0.27)),
    "charged": (
        OPEN | {"charged": 0.2},
        Open(metric="ITAE", laws=LAWS[:2], hidden=0.27, charged=0.2),
    ),
    "charged by less than counts": (
        OPEN | {"charged": 0.02},
        Open(metric="ITAE", laws=LAWS[:2], hidden=0.27),
    ),
    "all runs settle": (
        FEW | {"metric": "settles", "centres": (0.0, 0.0, 0.0)},
        Tied(metric="settled runs", laws=LAWS),
    ),
    "some runs settle": (
        FEW | {"metric": "settles", "centres": (0.0, 0.5, 1.0)},
        Open(metric="settled runs", laws=LAWS, needed=6, unit="sets of gains"),
    ),
    "a share": ({"metric": "settles"}, Lead(law="third", rival="", metric="settled runs")),
}


@pytest.mark.parametrize("case", REASONS)
def test_where_there_is_no_winner_the_reason_is_a_fact(case):
    change, fact = REASONS[case]
    assert verdicts_of(**change).verdict == fact


LEADS = {  # how a law compares with its runner-up -> the fields of its lead
    "ratio": (
        Effect(0.85, 0.8, 0.9, 5, 8, True),
        {"low": 0.1, "high": 0.2, "ratio": 0.85, "ahead": 5, "unit": "sets of gains"},
    ),
    "runs": (
        Effect(0.992, 0.99, 0.993, 0, 8, False),
        {"low": 0.007, "high": 0.01, "ahead": 0, "unit": "runs"},
    ),
    "floor": (
        Effect(0.4, 0.0, 0.4, 8, 8, True, below=True),
        {"low": 0.6, "high": math.nan, "floor": "1 m"},
    ),
    "no value": (
        Effect(0.0, 0.0, 0.0, 8, 8, True, below=True),
        {"low": math.nan, "gaps": "8 of 20"},
    ),
}


@pytest.mark.parametrize("case", LEADS)
@pytest.mark.parametrize("median", [0.5, 3.0])
def test_a_lead_has_its_interval_as_shares_and_names_rivals_of_a_lower_median(case, median):
    effect, fields = LEADS[case]
    lost = (0, 8 * (case == "no value"), 0)
    fact: Any = verdicts_of(
        floor="1 m",
        effect=effect,
        without_value=lost,
        ranked=(False, True, True),
        centres=(0.1, 2.0, median),
    ).verdict
    assert (fact.law, fact.rival, fact.metric, fact.samples) == ("third", "second", "ITAE", 8)
    assert fact.lower == ("second",) * (median > 2.0)
    for name, value in fields.items():
        expected = value if isinstance(value, str) else pytest.approx(value, nan_ok=True)
        assert getattr(fact, name) == expected


def test_a_lead_names_every_rival_of_a_lower_median():
    """It was said of the runner-up alone."""
    effect, _ = LEADS["ratio"]
    fact: Any = verdicts_of(effect=effect, centres=(0.4, 0.45, 0.5)).verdict
    assert fact.lower == LAWS[:2]
    assert f"(lower median: {', '.join(LAWS[:2])})" in evidence(fact)


def test_over_several_conditions_each_verdict_stands_once(pair):
    assert repr(pair).count("under nominal") == repr(pair).count("under noise") == 1
    fact: Any = pair.blocks[0].verdict
    assert f"ratio {number(fact.ratio)}" in repr(pair)
    first, second = pair.blocks
    turned = changed(second, verdict=Lead(law="second", rival="", metric="ITAE"))
    split = dataclasses.replace(pair, blocks=(first, turned)).lines
    assert ["third" in split[0], "nominal" in split[0]] == [True, True]
    assert ["second" in split[1], "noise" in split[1]] == [True, True]
    assert len(split) == 2


def test_a_law_that_is_not_ranked_is_named_beside_the_winner_of_the_others(pair):
    block = verdicts_of(ranked=(True, False, True), units=(20, 3, 20), sets=(7, 3, 1))
    (fact,) = block.not_ranked
    unit = "sets of gains or runs"
    assert fact == NotRanked(metric="ITAE", law="second", samples=3, needed=6, unit=unit)
    blocks = [changed(of_pair, not_ranked=[fact]) for of_pair in pair.blocks]
    assert dataclasses.replace(pair, blocks=tuple(blocks)).not_ranked == [fact]


def test_a_law_with_too_few_sets_to_be_among_the_best_is_named():
    """Of a law with eight sets that led by its median nothing was said."""
    change = LOST | {"best": TWO, "level": False, "visible": 0.3, "charged": 0.0}
    (fact,) = verdicts_of(**change, units=(20, 20, 8), sets=(12, 12, 8)).not_ranked
    assert (fact.law, fact.samples, fact.needed) == ("third", 8, 9)
    assert not verdicts_of(**change, units=(20, 20, 8), worse=(False, False, True)).not_ranked


def test_a_law_that_others_beat_has_its_ratio_to_the_law_in_front(pair):
    (block, _) = pair.blocks
    assert set(block.behind) == {EVIL, "second"}
    behind = block.behind["second"]
    assert (behind.leader, behind.ahead) == ("third", ("third", EVIL))
    ratio = block.medians["second"] / block.medians["third"]
    assert behind.times == pytest.approx(ratio, rel=0.1)


@pytest.mark.parametrize(
    ("sets", "samples", "said"),
    [
        ((7, 7, 1), 7, {"sets": 7, "single": True}),
        ((7, 8, 7), 7, {"sets": 7, "single": False}),
        ((3, 7, 7), 7, {"least": 3, "single": False}),
        ((1, 1, 1), 20, {"least": None, "single": False}),
    ],
)
def test_a_heading_says_if_some_laws_have_more_sets_of_gains(sets, samples, said):
    block = verdicts_of(sets=sets, samples=samples)
    assert block.sample.values == {"seeds": 20, "distinct": None} | said
    assert dataclasses.replace(block, seeds=24).sample.values["distinct"] == 20
