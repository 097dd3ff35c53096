"""What a line says is what its fact holds, and words of answers are explained."""

import dataclasses
import math
import re
import shlex

import pytest
from helpers.words import words

from smc_mujoco.answers import answers
from smc_mujoco.answers.answer import Answer
from smc_mujoco.answers.explain import explain, glossary
from smc_mujoco.answers.facts import Fact, Lead, NextStep, Open, Screen, Settles, Tied, Trails
from smc_mujoco.answers.templates import percent, said
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import shipped
from smc_mujoco.common.tabular import Cell, Tabular

pytestmark = pytest.mark.quick


def test_a_lead_names_law_rival_metric_and_both_ends():
    lines = dict(
        answers.verdict_lines(
            [
                Lead(law="adrc", rival="pid", metric="J", low=0.213, high=0.254),
                Lead(law="adrc", rival="pid", metric="ITAE", low=0.11, high=0.18),
                Lead(law="adrc", rival="sta", metric="energy", low=0.5),
                Lead(law="mine", rival="pid", metric="settling time", low=0.2, high=0.34),
                Lead(law="mine", rival="", metric=answers.SHARE),
            ]
        )
    )
    assert words(lines["adrc"]) == words(
        "J 21 to 25 % and ITAE 11 to 18 % below pid; energy at least 50 % below sta"
    )
    assert re.findall(r"\d+", lines["mine"]) == ["20", "34"]
    assert lines["mine"].endswith("; more settled runs than any rival")


def test_a_line_of_evidence_has_the_ratio_with_its_interval_and_the_samples():
    fact = Lead(
        law="a", rival="b", metric="J", low=0.211, high=0.255, ratio=0.767, ahead=11, samples=12
    )
    text = answers.evidence(fact)
    assert "ratio 0.767, 0.745 to 0.789" in text
    assert "11 of 12 runs" in text
    charged = Open(metric="J", laws=("a", "b"), hidden=0.3, charged=0.2)
    assert "20 % is taken off" in answers.evidence(charged)
    assert "taken off" not in answers.evidence(dataclasses.replace(charged, charged=0.0))


@pytest.mark.parametrize(
    ("low", "high", "text"),
    [
        (0.213, 0.254, "21 to 25 %"),
        (0.211, 0.212, "21 %"),
        (0.0123, 0.9989, "1.2 to over 99 %"),
        (0.998, math.nan, "over 99 %"),
        (0.031, math.nan, "at least 3.1 %"),
    ],
)
def test_shares_have_two_digits(low, high, text):
    assert percent(low, high) == text


def text(fact):
    return said(fact)[1]


def test_the_law_to_use_comes_with_its_gains_and_the_laws_that_lead_elsewhere():
    elsewhere = [
        Fact("unless", aims="ITAE or energy", law="pid", gains="kp=2"),
        Fact("unless", aims="J", law="sta", gains=None),
    ]
    words = text(Fact("use", law="adrc", gains="wc=30", unless=elsewhere))
    assert words.index("adrc") < words.index("wc=30") < words.index("pid") < words.index("sta")
    assert "(" not in text(Fact("use", law="none", gains=None))
    assert text(Fact("use", law="a", rivals=("a", "b"), metric="J")).startswith("Undecided")
    assert text(Fact("use", law="a", level=("a", "b"), metric="J")) == "Level by J: a and b. Use a."


def test_settled_runs_are_counted_by_law():
    short = [Fact("of law", law="b", runs=Settles(7, 12))]
    all_but_one = text(Fact("settled runs", short=short, others=True))
    assert all_but_one == "Settled runs: b 7 of 12, all of the others."


def test_a_law_that_loses_has_its_ratio_and_who_is_ahead():
    behind = {"law": "mine", "leader": "adrc", "metric": "J"}
    two = Trails(**behind, times=1.783, ahead=("adrc", "pid"))
    assert answers.verdict_lines([two]) == [("mine", "J 1.78 times adrc's; behind adrc and pid")]
    alone = Trails(**behind, times=1.783, ahead=("adrc",))
    assert answers.verdict_lines([alone]) == [("mine", "J 1.78 times adrc's")]
    unknown = Trails(**behind, times=math.nan, ahead=("adrc",))
    assert answers.verdict_lines([unknown]) == [("mine", "behind adrc")]


def test_what_is_tied_and_what_is_open_stand_on_lines_of_their_own():
    facts = [
        Open(metric="J", laws=("a", "b"), hidden=0.12),
        Open(metric="energy", laws=("a", "b"), hidden=0.3),
        Open(metric="ITAE", laws=("a", "b"), needed=8, unit="sets"),
        Tied(metric="J", laws=("a", "b"), floor="0.1 mrad"),
    ]
    assert answers.verdict_lines(facts) == [
        ("tied", "J: a, b"),
        (
            "open",
            "J and energy: a, b (leads below 30 % might not show); "
            "ITAE: a, b (deciding takes 8 sets)",
        ),
    ]


def test_a_line_is_at_most_80_wide_and_a_command_can_be_pasted():
    words = ["smc-mujoco", "compare", *["a b"] * 3, *["x" * 20] * 5]
    lines = answers.labelled(
        [
            ("adrc", "J 21 to 25 % below the rest " * 9),
            ("next", f"{shlex.join(words)}\n"),
        ]
    )
    assert max(map(len, lines)) <= answers.WIDTH
    assert lines[1].startswith(" " * 6)
    pasted = "\n".join(lines).partition("next")[2].replace("\\\n", "")
    assert shlex.split(pasted) == words


class Sample(Answer):
    @property
    def screen(self):
        facts = [Fact("sentence", label="b", text="< c")]
        return Screen(heading=Fact("law on plant", law="a", plant="b"), facts=facts)

    @property
    def tables(self):
        return [Tabular(headings=["law", "J"], rows=[["a", Cell("1", "0.9–1.1")]], title="All")]


def test_a_result_prints_its_answer_and_holds_its_evidence(tmp_path):
    result = Sample()
    assert str(result) == repr(result) == "a on b\nb  < c"
    assert "0.9–1.1" in str(result.full)
    in_notebook = result._repr_html_()
    answer, evidence = in_notebook.split("<details>")
    assert "&lt; c" in answer
    assert "0.9–1.1" in evidence
    page = result.to_html(tmp_path / "report.html").read_text()
    assert page.index("&lt; c") < page.index("0.9–1.1")
    assert "<h1>a on b</h1>" in page


def test_a_page_leaves_the_breaking_of_lines_to_the_browser(tmp_path, monkeypatch):
    command = f"smc-mujoco compare {30 * 'duffing '}"
    screen = Screen(
        heading=Fact("law on plant", law="a", plant="b"),
        tables=[Tabular(headings=["", "J (s²)"], rows=[["adrc", "0.2"]])],
        facts=[Fact("sentence", label="doubt", text=40 * "a long doubt ")],
        next=NextStep(command, "tries all"),
    )
    monkeypatch.setattr(Sample, "screen", screen)
    page = Sample().to_html(tmp_path / "report.html").read_text()
    assert "<pre" not in page
    assert "<p>a on b</p>" in page
    assert 40 * "a long doubt " in page
    assert f"{command}<br>Tries all." in page


@pytest.mark.parametrize("word", sorted(glossary()))
def test_an_explanation_fits_ten_lines_of_a_screen(word):
    lines = explain(word).splitlines()
    assert lines[0] == word
    assert 2 <= len(lines) <= 10
    assert max(map(len, lines)) <= answers.WIDTH
    assert "](" not in "".join(lines)


def test_a_word_is_found_in_any_case_and_number():
    assert explain("Stars") == explain("star")


def test_an_unknown_word_is_refused_with_a_near_one():
    with pytest.raises(ScenarioError, match="star"):
        explain("strar")


def test_a_word_is_explained_in_one_place():
    page = (shipped("docs") / "words.md").read_text(encoding="utf-8")
    explained = []
    for heading in re.findall(r"^## (.*)$", page, re.MULTILINE):
        explained += [word.strip() for word in re.sub(r"\(.*?\)", "", heading).split(",")]
    assert len(explained) == len(set(explained))
