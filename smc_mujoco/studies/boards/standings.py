"""The boards as tables: published rows with one's own among them, best score first."""

from smc_mujoco.common import errors
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.boards.entries import on_board
from smc_mujoco.studies.boards.published import ROBUSTNESS, SIMULATION, RobustnessRow, Row
from smc_mujoco.studies.boards.scoring import criteria, score, shoulder_first
from smc_mujoco.studies.boards.simulator import Robustness

NAME = "smc_mujoco"  # of this package's entry
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
    """Return the rows of the version-2 simulation board of a trace's plant, with its own row of this name.

    Raises:
      ScenarioError: another plant than pendubot and acrobot, a run by other rules than the boards', or a name that
        cannot be printed.
    """
    found = criteria(trace)
    ran, ruled = trace.scenario, on_board(trace.scenario.plant.name, "none")
    for rule in ("duration", "control_period", "x0", "v0", "limits"):
        if (value := getattr(ran, rule)) != (right := getattr(ruled, rule)):
            raise errors.ScenarioError(
                f"{rule} of the run is {value} and on the boards {right}: use smc.boards.on_board"
            )
    values = {field: getattr(found, field) for field in Row._fields[1:6]}
    own = Row(name=errors.name("name of the row", name), score=score(found), **values)
    return tuple(sorted((*SIMULATION[trace.scenario.plant.name]["v2"], own), key=lambda row: -row.score))


def robustness_board(robot: str, found: Robustness, name: str = NAME) -> tuple[RobustnessRow, ...]:
    """Return the rows of the robustness board of a robot, with a result of this name among them.

    Raises:
      ScenarioError: another robot, or a name that cannot be printed.
    """
    shoulder_first(robot)
    own = RobustnessRow(name=errors.name("name of the row", name), score=found.score, **found.percent)
    return tuple(sorted((*ROBUSTNESS[robot], own), key=lambda row: -row.score))


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
