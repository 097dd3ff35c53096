"""Printed tables say in which unit u is."""

import io

import pytest
from rich.console import Console

import smc_mujoco as smc
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


@pytest.mark.quick
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
