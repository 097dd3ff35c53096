"""Printed tables say in which unit u is."""

import io
import math
from types import SimpleNamespace
from typing import Any

from rich.console import Console

import smc_mujoco as smc
from smc_mujoco.analysis.margins import Margin
from smc_mujoco.analysis.step_halving import StepChange
from smc_mujoco.cli import tables

VOLTS = smc.run(
    smc.Scenario(
        plant="furuta",
        law="none",
        feedforward=smc.Sine(2.0, 50.0),
        duration=0.1,
        actuator=smc.DCMotor(8.4, 0.0, 0.042, 1.0, 4e-6, voltage=10.0, command="voltage"),
    )
)


def printed(shown) -> str:
    console = Console(file=io.StringIO(), width=160)
    for table in shown:
        console.print(table)
    return console.file.getvalue()  # pyright: ignore[reportAttributeAccessIssue]


def test_a_summary_has_commands_in_volts_and_reactions_in_newton_metres():
    lines = {}
    for line in printed(tables.trace_summary(VOLTS)).splitlines():
        if line.split():
            lines[line.split()[0]] = line
    assert " V/s " in lines["tv_rate"]
    assert " N m " in lines["peak_reaction"]


def test_a_table_of_scores_has_commands_in_volts():
    assert "V/s" in printed(tables.scores("runs", {"none": VOLTS}))
    assert "V/s" in printed(tables.answers(["tv_rate"], {"nominal": {"none": VOLTS}}))


def test_open_margins_uncertain_cycles_and_runs_that_depend_on_the_step_are_marked():
    rows = [
        ("duffing", "pid", 0.5, 0.02, 0.25),
        ("duffing", "lqr", 1.0, 0.0, math.inf),
        ("furuta", "lqr", 0.0, 0.1, None),
    ]
    found = [
        Margin(
            plant=plant,
            law=law,
            kind="delay",
            value=level,
            unit="s",
            resolution=step,
            searched=1.0,
            theory=theory,
        )
        for plant, law, level, step, theory in rows
    ]
    changes = StepChange(0.05, 0.02), StepChange(0.02, 0.06)
    cycles: list[Any] = [
        SimpleNamespace(
            amplitude=0.1, frequency=5.0, uncertainty=1.0, coupling=0.25, third_harmonic=0.04
        ),
        SimpleNamespace(
            amplitude=math.nan,
            frequency=math.nan,
            uncertainty=math.nan,
            coupling=1.5,
            third_harmonic=1.01,
        ),
    ]
    shown = [tables.margins("delay", found)]
    for plant, count in (("duffing", 2), ("double_pendulum", 1)):
        scenarios = [smc.Scenario(plant=plant, law=law) for law in ("pid", "classical")][:count]
        measured = [(0.125, 4.5), (math.nan, math.nan)][:count]
        shown.append(tables.chattering(scenarios, 0, cycles[:count], measured, changes[:count]))
    tables_of = ["\n".join(printed([table]).splitlines()) for table in shown]
    cells = []
    for text in tables_of:
        cells.append([" ".join(line.split()) for line in text.splitlines()])
    assert cells[0][-4:-1] == [
        "duffing pid 0.500 0.0200 0.250 s",
        "lqr >= 1.00 any s",
        "furuta lqr 0 0.100 s",
    ]
    assert "pid 0.100 0.125 5.00 4.50 100 % 4 %" in cells[1]
    assert "classical none none* none none* > 100 %" in cells[1]
    # what a mark means
    assert ["half the physics step" in text for text in tables_of] == [False, True, False]
    assert "pid 0.100 0.125 5.00 4.50 100 % 25 %" in cells[2]
    assert ["s (m/s)" in tables_of[1], "s (rad/s)" in tables_of[2]] == [True, True]
