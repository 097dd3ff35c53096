"""One screen of a comparison: it fits, and each of its numbers is that of the boards."""

import dataclasses
import math
import re

import numpy as np
import pytest
from helpers.tables import MadeTable, changed

from smc_mujoco.analysis.tuning import result
from smc_mujoco.answers import answers
from smc_mujoco.answers.explain import explain
from smc_mujoco.answers.facts import Lead, NextStep, Open, Screen, Settles, Trails
from smc_mujoco.answers.templates import TEXTS, said
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.robustness import sensitivity, worst_case
from smc_mujoco.studies import compare
from smc_mujoco.studies.board_numbers import median_text, unit_of
from smc_mujoco.studies.contests import contests
from smc_mujoco.studies.leaderboard import METRICS, leaderboard

pytestmark = pytest.mark.quick

LAWS = ("observer_based_finite_time", "super_twisting", "adrc", "pid", "my_law")
SEEDS = 12
HEADINGS = worst_case.HEADINGS, sensitivity.HEADINGS, result.HEADINGS, compare.GAINS
HEADINGS += (
    compare.RUNS,
    compare.TIME_HEADINGS,
    ("margin", "to within", "all sets", "theory", "unit"),
)
OWN = {plant: dict.fromkeys(LAWS, "wc=29.9, w=31.7, b=8.53") for plant in ("duffing", "pendulum")}


def table(conditions=("friction",), plants=("duffing",)):
    """Runs of five laws: the first wins in ITAE, the last in settling time."""
    cells = [(plant, condition) for plant in plants for condition in conditions]
    count = len(cells) * SEEDS
    noise = np.random.default_rng(0).uniform(0.95, 1.05, (5, count))
    first = np.array([[1.0], [1.3], [1.4], [1.6], [2.0]]) * noise
    return MadeTable(
        law=np.repeat(LAWS, count),
        plant=np.tile(np.repeat([plant for plant, _ in cells], SEEDS), 5),
        condition=np.tile(np.repeat([condition for _, condition in cells], SEEDS), 5),
        seed=np.tile(np.arange(SEEDS), 5 * len(cells)),
        itae=(0.1 * first).ravel(),
        settling_time=first[::-1].ravel(),
        ultimate_bound=np.full(5 * count, 1e-3) * noise.ravel(),
        tv_rate=(500.0 * noise).ravel(),
    )


@pytest.fixture(scope="module")
def boards():
    return leaderboard(table(), by=("plant", "condition"))


@pytest.fixture(scope="module")
def contest(boards):
    (contest,) = contests(boards, OWN, ("my_law", "pid"))
    return contest


def column(contest, name):
    """Return the cells of a metric, in the order of LAWS."""
    i = contest.metrics.index(name)
    return [row[1 + i] for row in sorted(contest.table.rows, key=lambda row: LAWS.index(row[0]))]


def test_five_laws_in_one_condition_fit_a_screen_of_80_by_24(contest):
    command = f"smc-mujoco compare inverted_pendulum --law {','.join(LAWS)} --seeds 24"
    step = NextStep(f"{command} --condition friction+encoder+delay_10ms", "tries all at once")
    report = "compared/report.html"
    lines = answers.screen_lines(Screen(contests=[contest], next=step, report=report, word="lead"))
    assert len(lines) <= answers.LINES
    assert max(map(len, lines)) <= answers.WIDTH


def test_the_numbers_of_the_screen_are_those_of_the_boards(boards, contest):
    for law, *cells in contest.table.rows:
        for heading, name, cell in zip(
            contest.table.headings[1:], contest.metrics, cells, strict=True
        ):
            label, _, unit = heading.partition(" (")
            assert label == name
            (board,) = [candidate for candidate in boards if candidate.label == name]
            (entry,) = [entry for entry in board.entries if entry.law == law]
            assert cell.text == median_text(entry.interval.median, board.metric)
            assert unit.removesuffix(")") == unit_of(board)
            assert cell.strong == (board.winner == law)
    assert contest.settled
    assert said(contest.settled)[1] == f"All {len(LAWS) * SEEDS} runs settled."
    (board,) = [candidate for candidate in boards if candidate.metric == "settles"]
    unsettled = {law: i / SEEDS for i, law in enumerate(LAWS)}  # shares
    block = changed(board.blocks[0], medians=unsettled)
    (apart,) = contests([boards[-1], dataclasses.replace(board, blocks=(block,))], OWN, ())
    assert apart.settled
    short = {fact.values["law"]: fact.values["runs"] for fact in apart.settled.values["short"]}
    assert short == {law: Settles(SEEDS - i, SEEDS) for i, law in enumerate(LAWS) if i}
    assert apart.settled.values["others"]
    none = changed(block, medians=dict.fromkeys(LAWS, 1.0))
    (lost,) = contests([boards[-1], dataclasses.replace(board, blocks=(none,))], OWN, ())
    assert lost.settled
    assert said(lost.settled)[1] == f"No run of {len(LAWS) * SEEDS} settled."


def test_the_heading_of_J_says_over_how_many_conditions_it_is(boards):
    (board,) = [candidate for candidate in boards if candidate.metric == "itae"]
    summed = dataclasses.replace(board, metric="objective", unit="s^2", summed=("noise", "sine"))
    (contest,) = contests([summed, board], OWN, ())
    assert contest.table.headings[1] == "J over 2 conditions (s^2)"


def test_a_lead_on_the_screen_is_the_least_lead_of_the_board(boards, contest):
    (lead,) = [
        fact for fact in contest.verdicts if isinstance(fact, Lead) and fact.metric == "ITAE"
    ]
    (board,) = [candidate for candidate in boards if candidate.metric == "itae"]
    assert lead == board.blocks[0].verdict
    assert (lead.law, lead.rival) == (LAWS[0], LAWS[1])
    assert lead.low < 1.0 - 1.0 / 1.3 < lead.high < 1.0 - 1.0 / 1.4  # and not over another rival
    medians = {law: cell.text for law, cell in zip(LAWS, column(contest, "ITAE"), strict=True)}
    assert float(medians[LAWS[1]]) == pytest.approx(0.13, rel=0.05)
    lines = "\n".join(answers.screen_lines(Screen(contests=[contest])))
    assert f"{100 * lead.low:.2g} to {100 * lead.high:.2g} % below {lead.rival}" in lines


def test_the_law_to_use_is_the_first_metrics_and_others_are_named_where_they_win(contest):
    use = contest.use.values
    assert use["law"] == LAWS[-1]
    assert [row[0] for row in contest.table.rows if row[1].strong] == [LAWS[-1]]
    assert [(fact.values["law"], fact.values["aims"]) for fact in use["unless"]] == [
        (LAWS[0], "ITAE")
    ]
    assert use["gains"] == use["unless"][0].values["gains"] == OWN["duffing"][LAWS[0]]
    assert use["gains"] in said(contest.use)[1]


def test_without_J_the_law_for_now_is_the_first_row_of_the_table():
    """All settle alike, so the next metric orders the laws, and not their names."""
    few = table()
    boards = leaderboard(few.taken(few.column("seed") < 3), by=("plant", "condition"))
    (contest,) = contests(boards, OWN, ())
    assert contest.use
    assert contest.use.values["rivals"]
    assert contest.use.values["law"] == contest.table.rows[0][0] == LAWS[-1]
    assert min(LAWS) != LAWS[-1]


def test_of_laws_that_are_level_any_may_be_used_and_nothing_is_undecided():
    boards = leaderboard(table(), ["ultimate_bound"], by=("plant", "condition"))
    (contest,) = contests(boards, OWN, ())
    assert contest.use
    assert sorted(contest.use.values["level"]) == sorted(LAWS)
    assert "rivals" not in contest.use.values


def test_an_own_law_that_loses_has_its_ratio(contest):
    (fact,) = [fact for fact in contest.trails if fact.law == "pid"]
    assert isinstance(fact, Trails)
    times = {law: float(first.text) for law, first, *_ in contest.table.rows}
    ratio = times["pid"] / times[fact.leader]
    assert fact.times == pytest.approx(ratio, rel=0.05)
    assert fact.ahead[0] == fact.leader == LAWS[-1]


def test_a_law_with_a_run_that_does_not_arrive_is_not_to_be_used(boards):
    """J is of other runs, in which it may arrive."""
    *first, last = boards
    (block,) = last.blocks
    lost = changed(block, away=(LAWS[-1],))
    (contest,) = contests([*first, dataclasses.replace(last, blocks=(lost,))], OWN, ())
    assert contest.use is None
    elsewhere = changed(block, away=(LAWS[0],))
    (contest,) = contests([*first, dataclasses.replace(last, blocks=(elsewhere,))], OWN, ())
    assert contest.use
    assert (contest.use.values["law"], contest.use.values["unless"]) == (LAWS[-1], [])


def test_more_than_five_plants_and_conditions_are_one_table_of_winners():
    ranked = leaderboard(
        table(("friction", "noise", "encoder"), ("duffing", "pendulum")), by=("plant", "condition")
    )
    blocks = contests(ranked, OWN, ())
    assert len(blocks) == 6
    lines = answers.screen_lines(Screen(contests=blocks))
    assert max(map(len, lines)) <= answers.WIDTH
    text = " ".join(lines)
    for block in blocks:
        assert len(re.findall(rf"^{block.plant} +{block.condition} ", "\n".join(lines), re.M)) == 1
    assert text.count("my_law") == 6


def test_of_many_contests_J_is_said_once_for_each_plant_with_the_law_to_use():
    conditions = ("friction", "noise", "encoder", "sine", "lag", "delay")
    boards = leaderboard(table(conditions), ["itae"], by=("plant", "condition"))
    (J,) = leaderboard(table(("all",)), ["itae"], by=("plant",))
    J = dataclasses.replace(J, metric="objective", unit="s^2")
    won = dataclasses.replace(J.blocks[0].verdict, metric="J")
    even = Open(metric="J", laws=LAWS[:2], hidden=0.1)
    for verdict, said_of in ((won, [LAWS[0], f"below {LAWS[1]}"]), (even, ["Undecided", LAWS[0]])):
        block = changed(J.blocks[0], verdict=verdict)
        of_plant = dataclasses.replace(J, blocks=(block,))
        (part,) = answers.blocks(Screen(contests=contests([of_plant, *boards], OWN, ())))
        assert part.tables[0].headings == ["", "", "ITAE"]
        ((plant, text),) = part.pairs
        assert plant == "duffing"
        assert [word for word in said_of if word not in text] == []
        assert "might not show" not in text


@pytest.mark.parametrize(
    "word",
    [
        *(CATALOGUE[name].label for name in METRICS if name in CATALOGUE),
        *("J", "settled", "settled runs", "floor", "star", "best", "lead", "below"),
        *("tied", "open", "not ranked", "no winner", "beware", "gains", "margin", "worst"),
        *sorted({re.sub(r"\{.*?\}", "", label).strip() for label, _ in TEXTS.values()} - {""}),
        *sorted(
            {heading.partition(" (")[0] for table in HEADINGS for heading in table}
            - {"from", "to", ""}
        ),
        *("shipped", "tuned here", "given", "default", "interval", "searches", "evaluations"),
        *("J spread", "relative time", "arrived", "to within", "theory", "all sets", "found by"),
        *(
            "alone",
            "with others",
            "narrow",
            "fail",
            "withstands",
            "without a law",
            "at rest",
            "held out",
        ),
    ],
)
def test_every_word_of_answers_and_tables_is_explained(word):
    assert len(explain(word).splitlines()) > 1


def test_the_share_of_the_bound_stands_beside_the_variation_of_u(boards):
    (board,) = [candidate for candidate in boards if candidate.metric == "tv_rate"]
    blocks = tuple(dataclasses.replace(block, bound=250.0) for block in board.blocks)
    (contest,) = contests([dataclasses.replace(board, blocks=blocks)], {}, ())
    assert "of bound" in contest.table.headings[1]
    for law, cell in contest.table.rows:
        (number,) = re.findall(r"\(([\d.]+) %\)", cell.text)
        share = float(number)
        assert math.isclose(share, 100 * blocks[0].medians[law] / 250.0, rel_tol=0.06)
