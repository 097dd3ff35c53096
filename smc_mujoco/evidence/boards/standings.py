"""The boards as tables: published rows with your own among them, best score first."""

import dataclasses

from smc_mujoco.common import errors
from smc_mujoco.evidence.boards.entries import on_board
from smc_mujoco.evidence.boards.published import ROBUSTNESS, SIMULATION, RobustnessRow, Row
from smc_mujoco.evidence.boards.scoring import criteria, score, shoulder_first
from smc_mujoco.evidence.boards.simulator import Robustness
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

NAME = "smc_mujoco"  # of this package's entry
# Fields of a Scenario that are an entry's own. The rules fix all others.
DESIGN = ("law", "model", "surface", "velocity", "reference", "feedforward", "seed", "condition")
WORDS = {
    "swing_up_time": "time",
    "energy": "energy",
    "torque_cost": "torque cost",
    "torque_smoothness": "variation of the torque",
    "velocity_cost": "velocity cost",
}
TESTS = {
    "model": "other models",
    "velocity_noise": "velocity noise",
    "torque_noise": "torque noise",
    "torque_response": "torque response",
    "delay": "delay",
    "perturbations": "perturbations",
}


def board(trace: Trace, name: str = NAME) -> tuple[Row, ...]:
    """Return the rows of the version-2 simulation board of a trace's plant, with the trace's row under this name.

    Raises:
      ScenarioError: another plant than pendubot and acrobot, a run by other rules than the boards', or a name that
        cannot be printed or is that of a published row.
    """
    found, robot = criteria(trace), trace.scenario.plant.name
    ran = _ruled(trace.scenario)
    for rule, right in _ruled(on_board(robot, "none")).items():
        if (value := ran.get(rule)) != right:
            raise errors.ScenarioError(
                f"{rule} of the run is {errors.shown(value)} and on the boards {errors.shown(right)}: "
                "use smc.boards.on_board"
            )
    values = {field: getattr(found, field) for field in Row._fields[1:6]}
    published = SIMULATION[robot]["v2"]
    own = Row(name=_new_name(name, published), score=score(found), **values)
    return tuple(sorted((*published, own), key=lambda row: -row.score))


def robustness_board(robot: str, found: Robustness, name: str = NAME) -> tuple[RobustnessRow, ...]:
    """Return the rows of the robustness board of a robot, with the row of a result under this name.

    Raises:
      ScenarioError: another robot, or a name that cannot be printed or is that of a published row.
    """
    shoulder_first(robot)
    own = RobustnessRow(name=_new_name(name, ROBUSTNESS[robot]), score=found.score, **found.percent)
    return tuple(sorted((*ROBUSTNESS[robot], own), key=lambda row: -row.score))


def _ruled(scenario: Scenario) -> dict[str, object]:
    """Return name -> value of all that the rules fix: the plant's parameters, and the fields that are not in DESIGN."""
    resolved = scenario.resolved
    fields = [field.name for field in dataclasses.fields(Scenario) if field.name not in (*DESIGN, "u_max")]
    return {**scenario.plant.parameters, **{name: getattr(resolved, name) for name in ("limits", *fields)}}


def _new_name(name: str, published: tuple[Row, ...] | tuple[RobustnessRow, ...]) -> str:
    """Return the name of a row if it can be printed and no published row has it."""
    if errors.name("name of the row", name) in [row.name for row in published]:
        raise errors.ScenarioError(f"name of the row is {name!r}, which a published row has: give another")
    return name


def verdict(robot: str, trace: Trace, found: Robustness | None, name: str = NAME) -> str:
    """Return a sentence that says where a row stands on the boards, and in which tests another is better."""
    rows = board(trace, name)
    place = next(i for i, row in enumerate(rows, 1) if row.name == name)
    text = f"{name} is number {place} of {len(rows)} on the {robot}'s board, with {rows[place - 1].score:.3f}"
    others = SIMULATION[robot]["v2"]
    worse = [
        words
        for field, words in WORDS.items()
        if getattr(rows[place - 1], field) > min(getattr(row, field) for row in others)
    ]
    text += f"; others have less {_listed(worse)}" if worse else "; no other is better in any criterion"
    if found is None:
        return text
    rows = robustness_board(robot, found, name)
    place = next(i for i, row in enumerate(rows, 1) if row.name == name)
    text += f". In robustness it is number {place} of {len(rows)}, with {rows[place - 1].score:.3f}"
    worse = [
        f"{words} ({best.name}: {getattr(best, field):g} against {found.percent[field]:.3g} %)"
        for field, words in TESTS.items()
        if getattr(best := max(ROBUSTNESS[robot], key=lambda row: getattr(row, field)), field)
        > round(found.percent[field], 1)
    ]
    weak = [parameter for parameter, count in found.parameters.items() if count <= 10]
    text += f"; others survive more of {_listed(worse)}" if worse else "; no other survives more of any test"
    return text + (f"; fewer than half of the values of {_listed(weak)} are survived" if weak else "")


def _listed(words: list[str]) -> str:
    """Return words as "a, b and c"."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
