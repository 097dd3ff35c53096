"""The boards as tables: published rows with your own among them, best score first."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from realaigym.entries import FEEDBACKS, entry, on_board
from realaigym.published import (
    GLOBAL,
    ROBUSTNESS,
    SIMULATION,
    GlobalRow,
    RobustnessRow,
    Row,
)
from realaigym.scoring import criteria, score, shoulder_first
from realaigym.simulator import Robustness
from smc_mujoco.common import errors
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

NAME = "trajectory + Riccati"  # of this package's entry
MEASURED_MARK = "*"  # ends the name of a row with measured velocities
KEY = (
    "trajectory + ...: this package's optimised trajectory under a feedback. Riccati: the "
    "entry, 9 tanh(s / 6 N m); "
    "linear: its slope, 1.5 s; clipped: s, the Riccati gain itself; sliding: 9 tanh(s / 0.06 N "
    "m), which switches. All "
    "are clipped at 6 N m. *: measured velocities, as in published rows; else velocities from "
    "a filter of 5 positions"
)
# Fields of a Scenario that are an entry's own. The rules fix all others.
DESIGN_FIELDS = (
    "law",
    "model",
    "surface",
    "velocity",
    "reference",
    "feedforward",
    "seed",
    "condition",
)


def experiments(robot: str) -> dict[str, Scenario]:
    """Return name of row -> run of the entry and of its control experiments, each with both kinds
    of velocities.
    """
    rows = {f"trajectory + {feedback}": entry(robot, feedback) for feedback in FEEDBACKS}
    measured = {}
    for name, run in rows.items():
        measured[name + MEASURED_MARK] = dataclasses.replace(run, velocity="measured")
    return rows | measured


def board(runs: Trace | Mapping[str, Trace], name: str = NAME) -> tuple[Row, ...]:
    """Return the rows of the version-2 simulation board of a trace's plant, with the trace's row
    under this name.

    Args:
      runs: a trace, or name -> trace for several rows; traces of one plant.
      name: of the row of a single trace.

    Raises:
      ScenarioError: another plant than pendubot and acrobot, a run by other rules than the boards',
        or the name of a published row.
    """
    if isinstance(runs, Mapping):
        traces = runs
    else:
        traces = {name: runs}
    robot = next(iter(traces.values())).scenario.plant.name
    shoulder_first(robot)
    rows = [_row(label, trace, robot) for label, trace in traces.items()]
    return _ranked(SIMULATION[robot]["v2"], rows)


def robustness_board(robot: str, results: Mapping[str, Robustness]) -> tuple[RobustnessRow, ...]:
    """Return the rows of the robustness board of a robot, with rows of results by name."""
    shoulder_first(robot)
    rows = []
    for name, result in results.items():
        rows.append(RobustnessRow(name=name, score=result.score, **result.percent))
    return _ranked(ROBUSTNESS[robot], rows)


def global_board(robot: str, rows: Sequence[GlobalRow]) -> tuple[GlobalRow, ...]:
    """Return the rows of the board of 2025 of a robot, with these among them."""
    shoulder_first(robot)
    return _ranked(GLOBAL[robot], [*rows])


def _ranked(published: tuple[Any, ...], rows: list[Any]) -> tuple[Any, ...]:
    """Return published and other rows, best score first. Refuse a name that is taken."""
    taken = {row.name for row in published}
    for row in rows:
        if row.name in taken:
            raise errors.ScenarioError(f"row {row.name!r} is published: give another name")
    return tuple(sorted((*published, *rows), key=lambda row: -row.score))


def _row(name: str, trace: Trace, robot: str) -> Row:
    """Return the row of a trace; raise ScenarioError for a run by other rules than the boards'."""
    values = criteria(trace)
    ran = _ruled(trace.scenario)
    for rule, right in _ruled(on_board(robot, "none")).items():
        if (value := ran.get(rule)) != right:
            raise errors.ScenarioError(
                f"the run has {rule} {errors.shown(value)}, and the boards have "
                f"{errors.shown(right)}: "
                "use realaigym.on_board"
            )
    return Row(
        name=name,
        score=score(values),
        **{field: getattr(values, field) for field in Row._fields[1:6]},
    )


def _ruled(scenario: Scenario) -> dict[str, object]:
    """Return name -> value of all that the rules fix: the plant's parameters, and the fields not in
    DESIGN_FIELDS.
    """
    resolved = scenario.resolved
    fields = []
    for field in dataclasses.fields(Scenario):
        if field.name not in (*DESIGN_FIELDS, "u_max"):
            fields.append(field.name)
    return {
        **scenario.plant.parameters,
        **{name: getattr(resolved, name) for name in ("limits", *fields)},
    }
