"""What a screen says of a result is what the result holds, beside two different numbers."""

import dataclasses
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import typer

import smc_mujoco as smc
from smc_mujoco.analysis.tuning.result import Tuned
from smc_mujoco.answers import answers, command
from smc_mujoco.answers.facts import Fact, Lead, NextStep, Screen, Settles, Span
from smc_mujoco.answers.templates import as_text, is_said, said
from smc_mujoco.cli import main
from smc_mujoco.robustness.margins import Margin, Margins
from smc_mujoco.robustness.sensitivity import Sensitivity
from smc_mujoco.robustness.worst_case import WorstCase, WorstCases

pytestmark = pytest.mark.quick

SCENARIO = smc.Scenario(plant="duffing", law=smc.law("classical"), duration=1.0)


def rows(table):
    """Return the names of a table -> the texts of their rows, a star behind a strong one."""
    texts = {}
    for name, *cells in table.rows:
        texts[name] = [
            getattr(cell, "text", cell) + "*" * getattr(cell, "strong", 0) for cell in cells
        ]
    return texts


def facts(screen):
    """Return label -> text of the facts."""
    return dict(answers.lines_of(screen.facts))


def test_margins_stand_below_their_kind_and_the_star_is_at_the_largest():
    settings: dict[str, Any] = {"plant": "duffing", "searched": 9.0, "theory": None}
    margins = Margins()
    for law, delay, friction in (("a", 0.02, 1.0), ("b", 0.01, 3.0), ("c", math.nan, 0.5)):
        for kind, level, unit in (("delay", delay, "s"), ("friction", friction, "N")):
            margins.append(
                Margin(law=law, kind=kind, value=level, unit=unit, resolution=1e-3, **settings)
            )
    (table,) = margins.screen.tables
    assert [*table.headings] == ["", "delay (s)", "friction (N)"]
    assert rows(table) == {
        "a": ["0.0200*", "1.00"],
        "b": ["0.0100", "3.00*"],
        "c": ["fails at 0", "0.500"],
    }
    says = facts(margins.screen)
    assert ("delay" in says["a"], "friction" in says["a"]) == (True, False)
    assert ("delay" in says["b"], "friction" in says["b"]) == (False, True)
    assert says["fails"].endswith(": c")
    heading = answers.screen_lines(margins.screen)[0]
    assert "a range is" not in heading
    ranged = Margins([dataclasses.replace(margin, low=0.1, high=0.2, sets=7) for margin in margins])
    assert "a range is over its sets of gains" in " ".join(answers.screen_lines(ranged.screen)[:2])


def test_worst_runs_and_medians_are_not_exchanged_and_the_first_law_leads():
    cases = []
    for law, worst, median in (("pid", 0.4, 0.01), ("classical", 0.3, 0.02)):
        scenario = dataclasses.replace(SCENARIO, law=smc.law(law))
        numbers = {"value": worst, "median": median, "unit": "m", "tried": 48, "seed": 0}
        about = {"found_by": "sine", "metric": "rms_error", "outside": "", "scenario": scenario}
        within = smc.Uncertainty(disturbance=0.5)
        cases.append(WorstCase(**numbers, **about, nominal=scenario, within=within))
    screen = WorstCases(cases).screen
    (table,) = screen.tables
    assert rows(table) == {"classical": ["0.300", "0.0200"], "pid": ["0.400", "0.0100"]}
    assert [heading.split(" (")[0] for heading in table.headings[1:]] == ["worst found", "median"]
    lead, *outside = screen.facts
    assert not any(map(is_said, outside))
    assert (lead.law, lead.rival, lead.low) == ("classical", "pid", pytest.approx(0.25))


def test_tuned_gains_are_compared_with_the_law_s_own():
    tuning: Any = SimpleNamespace(
        law=SimpleNamespace(name="pid"),
        plant=SimpleNamespace(name="duffing"),
        gains={"kp": 2.0, "kd": 3.0},
        objective=0.3,
        before=0.4,
        searches=(1, 2, 3),
        spread=0.04,
        at_bound={"kd": "upper"},
        budget=8,
    )
    says = facts(Tuned.screen.fget(tuning))  # pyright: ignore[reportOptionalCall]
    assert says["gains"] == "kp=2, kd=3"
    assert says["J"].startswith("0.300 s²")
    assert "25 % below" in says["J"]
    assert says["searches"] == "3; J of the worst is 4 % above the best"
    assert ("kd" in says["at bound"], "upper" in says["at bound"]) == (True, True)
    tuning.before = 0.2
    assert "0.200 s² with the law's own gains" in facts(Tuned.screen.fget(tuning))["J"]  # pyright: ignore[reportOptionalCall]
    tuning.before = math.inf
    assert "own gains fail" in facts(Tuned.screen.fget(tuning))["J"]  # pyright: ignore[reportOptionalCall]


def test_a_sensitivity_says_its_spread_its_failures_and_what_to_narrow():
    half = SimpleNamespace(
        half=("mass", 0.7, 1.0), before=0.4, median=0.1, failed=0.0, failed_before=0.0
    )
    analysis: Any = SimpleNamespace(
        values=np.linspace(0.0, 1.0, 101),
        failed=np.arange(101) < 7,
        axes=[],
        improvement=half,
        unscored=0,
        leading=SimpleNamespace(name="mass", total=SimpleNamespace(low=0.3, high=0.6)),
        label="rms error",
        text=lambda value: f"{value:.2f} m",
        scenario=SCENARIO,
        space=SimpleNamespace(),
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("smc_mujoco.robustness.sensitivity._words", lambda space, cuts: cuts[0][0])
        analysis._facts = Sensitivity._facts.fget(analysis)  # pyright: ignore[reportOptionalCall]
        screen = Sensitivity.screen.fget(analysis)  # pyright: ignore[reportOptionalCall]
    says = facts(screen)
    assert says["rms error"] == "0.05 m to 0.95 m in 90 % of 101 runs"
    assert says["fail"] == "7 of 101 runs (3.4 to 14 %)"
    assert says["narrow"] == "mass first: the median is then 0.10 m, not 0.40 m"
    assert "mass explains 30 to 60 % of the variance" in said(screen.heading)[1]


@pytest.mark.parametrize(
    ("value", "form", "text"),
    [
        (Settles(3, 24), "", "3 of 24"),
        (Span(0.2, 0.35), "%", "20 to 35 %"),
        (Span(0.72, 1.03), "", "0.720 to 1.03"),
        (Span(1.0, 1.0), "", "1.00"),
        (0.015, "ms", "15 ms"),
        (0.17, "%", "17 %"),
        (2, "law", "2 laws"),
        (["a", "b"], "", "a and b"),
        (["a", "b"], ",", "a, b"),
    ],
)
def test_values_have_their_texts(value, form, text):
    assert as_text(value, form) == text


def test_what_is_not_known_is_left_out():
    unsettled = {"runs": Settles(1, 2), "times": Span(math.nan, math.nan), "together": None}
    assert said(Fact("settles", **unsettled)) == ("settles", "1 of 2 runs")
    lead = Lead(law="a", rival="b", metric="J", low=0.2, high=0.35)
    best = {"laws": 3, "lead": lead}
    assert said(Fact("best", **best)) == (
        "best of 3 laws",
        "J 20 to 35 % below b, with these gains (95 %)",
    )
    assert "after 7 searches" in said(Fact("best", **best, searches=7))[1]


def test_a_fact_without_a_value_that_its_text_needs_is_not_said():
    facts = [
        Fact("never", where=["sine"]),
        Fact("never", where=[]),
        Fact("late", delay=math.nan),
        Fact("without", runs=None, below=None),
    ]
    screen = Screen(notes=[Fact("gains are", gains="")], facts=facts)
    assert answers.screen_lines(screen)[-1] == "beware  no law settles under sine"
    assert len(answers.lines_of(screen.facts)) == 1
    assert "<p>" not in answers.screen_html(screen)


def test_facts_without_room_on_a_screen_are_counted_and_commands_stay():
    doubts = [Fact("sentence", label="doubt", text=f"number {i}") for i in range(30)]
    lines = answers.screen_lines(Screen(facts=doubts, next=NextStep("smc-mujoco list", "lists")))
    assert len(lines) <= answers.LINES - answers.BELOW
    count = sum(line.startswith("doubt") for line in lines)
    assert f"{30 - count} lines" in next(line for line in lines if line.startswith("further"))
    assert lines[-2].split() == ["next", "smc-mujoco", "list"]


def test_a_doubtful_value_is_the_next_step_and_a_command_does_not_repeat_it():
    command.remember(["compare", "duffing", "--x0", "30"])
    try:
        command.doubt("x0 is 30 rad: if it is 30 degrees, give 0.5236")
        ((label, text),) = [answers.next_step(NextStep(command.again({}), "makes more"))]
        assert (label, "0.5236" in text, "compare" in text) == ("next", True, False)
    finally:
        command.remember([])
    assert "makes more" in answers.next_step(NextStep(command.again({}), "makes more"))[1]


@pytest.mark.parametrize("words", ["margins --quick duffing", "margins duffing --quick"])
def test_another_command_keeps_what_stands_behind_an_option_without_a_value(words):
    name, *rest = words.split()
    command.remember([name, *rest])
    try:
        typer.main.get_command(main.app).commands[name].make_context(name, rest)
        assert command.instead("worst", {}, ("--law",)) == "smc-mujoco worst duffing"
    finally:
        command.remember([])
