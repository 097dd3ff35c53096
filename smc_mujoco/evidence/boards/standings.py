"""The boards as tables: published rows with your own among them, best score first."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from smc_mujoco.common import errors
from smc_mujoco.common.text import joined
from smc_mujoco.evidence.boards.entries import FEEDBACKS, entry, on_board
from smc_mujoco.evidence.boards.published import ROBUSTNESS, SIMULATION, RobustnessRow, Row
from smc_mujoco.evidence.boards.scoring import criteria, score, shoulder_first
from smc_mujoco.evidence.boards.simulator import Robustness
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.replay import replay

NAME = "trajectory + Riccati"  # of this package's entry
MEASURED_MARK = "*"  # ends the name of a row with measured velocities
KEY = (
    "trajectory + ...: this package's optimised trajectory under a feedback. Riccati: the entry, 9 tanh(s / 6 N m); "
    "linear: its slope, 1.5 s; clipped: s, the Riccati gain itself; sliding: 9 tanh(s / 0.06 N m), which switches. All "
    "are clipped at 6 N m. *: measured velocities, as in published rows; else velocities from a filter of 5 positions"
)
# Fields of a Scenario that are an entry's own. The rules fix all others.
DESIGN_FIELDS = ("law", "model", "surface", "velocity", "reference", "feedforward", "seed", "noise_key", "condition")
CRITERION_WORDS = {
    "swing_up_time": "time",
    "energy": "energy",
    "torque_cost": "torque cost",
    "torque_smoothness": "variation of the torque",
    "velocity_cost": "velocity cost",
}
TEST_WORDS = {
    "model": "other models",
    "velocity_noise": "velocity noise",
    "torque_noise": "torque noise",
    "torque_response": "torque response",
    "delay": "delay",
    "perturbations": "perturbations",
}


def experiments(robot: str) -> dict[str, Scenario]:
    """Return name of row -> run of the entry and of its control experiments, each with both kinds of velocities.

    Raises:
      ScenarioError: another robot than pendubot and acrobot.
    """
    rows = {f"trajectory + {feedback}": entry(robot, feedback) for feedback in FEEDBACKS}
    measured = {name + MEASURED_MARK: dataclasses.replace(run, velocity="measured") for name, run in rows.items()}
    return rows | measured


def board(runs: Trace | Mapping[str, Trace], name: str = NAME) -> tuple[Row, ...]:
    """Return the rows of the version-2 simulation board of a trace's plant, with the trace's row under this name.

    Args:
      runs: a trace, or name -> trace for several rows; traces of one plant.
      name: of the row of a single trace.

    Raises:
      ScenarioError: another plant than pendubot and acrobot, a run by other rules than the boards', a law that
        needs the Python loop and knows more than its measurements, or a name that cannot be printed or is that of a
        published row.
    """
    traces = runs if isinstance(runs, Mapping) else {name: runs}
    robot = next(iter(traces.values())).scenario.plant.name
    shoulder_first(robot)
    rows = [_row(_new_name(label, SIMULATION[robot]["v2"]), trace, robot) for label, trace in traces.items()]
    return tuple(sorted((*SIMULATION[robot]["v2"], *rows), key=lambda row: -row.score))


def _row(name: str, trace: Trace, robot: str) -> Row:
    """Return the row of a trace; raise ScenarioError for a run by other rules than the boards'."""
    values, ran = criteria(trace), _ruled(trace.scenario)
    for rule, right in _ruled(on_board(robot, "none")).items():
        if (value := ran.get(rule)) != right:
            raise errors.ScenarioError(
                f"the run has {rule} {errors.shown(value)}, and the boards have {errors.shown(right)}: "
                "use smc.boards.on_board"
            )
    # a compiled law sees no plant
    if prepare(trace.scenario).why_not and not (result := replay(trace)).same:
        raise errors.ScenarioError(f"{trace.scenario.law.name} cannot enter the board, {result.why}: see smc.replay")
    return Row(name=name, score=score(values), **{field: getattr(values, field) for field in Row._fields[1:6]})


def robustness_board(
    robot: str, results: Robustness | Mapping[str, Robustness], name: str = NAME
) -> tuple[RobustnessRow, ...]:
    """Return the rows of the robustness board of a robot, with the row of a result under this name.

    Args:
      robot: "pendubot" or "acrobot".
      results: a result, or name -> result for several rows.
      name: of the row of a single result.

    Raises:
      ScenarioError: another robot, or a name that cannot be printed or is that of a published row.
    """
    shoulder_first(robot)
    named = results if isinstance(results, Mapping) else {name: results}
    rows = [
        RobustnessRow(name=_new_name(label, ROBUSTNESS[robot]), score=result.score, **result.percent)
        for label, result in named.items()
    ]
    return tuple(sorted((*ROBUSTNESS[robot], *rows), key=lambda row: -row.score))


def _ruled(scenario: Scenario) -> dict[str, object]:
    """Return name -> value of all that the rules fix: the plant's parameters, and the fields not in DESIGN_FIELDS."""
    resolved = scenario.resolved
    fields = [field.name for field in dataclasses.fields(Scenario) if field.name not in (*DESIGN_FIELDS, "u_max")]
    return {**scenario.plant.parameters, **{name: getattr(resolved, name) for name in ("limits", *fields)}}


def _new_name(name: str, published: tuple[Row, ...] | tuple[RobustnessRow, ...]) -> str:
    """Return the name of a row if it can be printed and no published row has it."""
    if errors.name("name of the row", name) in [row.name for row in published]:
        raise errors.ScenarioError(f"name of the row is {name!r}, which a published row has: give another")
    return name


def verdict(robot: str, trace: Trace, robustness: Robustness | None, name: str = NAME) -> str:
    """Return a sentence that says where a row stands on the boards, and in which tests another is better."""
    rows = board(trace, name)
    place = next(i for i, row in enumerate(rows, 1) if row.name == name)
    text = f"{name} is number {place} of {len(rows)} on the {robot}'s board, with {rows[place - 1].score:.3f}"
    others = SIMULATION[robot]["v2"]
    worse = [
        words
        for field, words in CRITERION_WORDS.items()
        if getattr(rows[place - 1], field) > min(getattr(row, field) for row in others)
    ]
    text += f"; others have less {joined(worse)}" if worse else "; no other is better in any criterion"
    if robustness is None:
        return text
    rows = robustness_board(robot, robustness, name)
    place = next(i for i, row in enumerate(rows, 1) if row.name == name)
    text += f". In robustness it is number {place} of {len(rows)}, with {rows[place - 1].score:.3f}"
    worse = [
        f"{words} ({best.name}: {getattr(best, field):g} against {robustness.percent[field]:.3g} %)"
        for field, words in TEST_WORDS.items()
        if getattr(best := max(ROBUSTNESS[robot], key=lambda row: getattr(row, field)), field)
        > round(robustness.percent[field], 1)
    ]
    weak = [parameter for parameter, count in robustness.parameters.items() if count <= 10]
    text += f"; others survive more of {joined(worse)}" if worse else "; no other survives more of any test"
    return text + (f"; fewer than half of the values of {joined(weak)} are survived" if weak else "")


def comparison(traces: Mapping[str, Trace], results: Mapping[str, Robustness] | None) -> str:
    """Return sentences on what the runs of `experiments` and their robustness say about the entry."""
    trace = traces[NAME]
    robot, gains = trace.scenario.plant.name, trace.scenario.law.of_channel(0).gains
    largest = float(np.abs(gains["k"] * np.tanh(trace.s[:, 0] / gains["phi"])).max())
    linear, clipped, sliding = (score(traces[f"trajectory + {name}"]) for name in ("linear", "clipped", "sliding"))
    text = (
        f"In its scored run the feedback of {NAME} is at most {largest:.2g} of {trace.scenario.limits[0]:g} N m: the "
        f"trajectory makes the score, which is {linear:.3f} with linear feedback, {clipped:.3f} with the clipped "
        f"Riccati gain and {sliding:.3f} with a sliding mode"
    )
    if results is None:
        return text
    rows = robustness_board(robot, results[NAME + MEASURED_MARK])
    place = next(i for i, row in enumerate(rows, 1) if row.name == NAME)
    return text + (
        f". With measured velocities, as in the published rows, its robustness is {rows[place - 1].score:.3f}: number "
        f"{place} of {len(rows)}"
    )
