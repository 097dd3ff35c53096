"""Cases of the marker `smc`: plants and conditions of the study as arguments of a test."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from smc_mujoco.common.errors import ScenarioError, find, shown, unknown
from smc_mujoco.mechanisms.plant import catalogue as plants
from smc_mujoco.simulation.conditions import PLANTS, find_condition

EXAMPLE = '@pytest.mark.smc(plants=["duffing"], conditions=["nominal", "noise"])'


def cases(given: Sequence[object], named: Mapping[str, object], arguments: Collection[str]) -> dict[str, list[str]]:
    """Return the test's argument, "plant" or "condition" -> the names with which the test runs."""
    if given:
        raise ScenarioError(f"marker smc is given {shown(given[0])}: name its arguments, as in {EXAMPLE}")
    for name in named:
        if name not in ("plants", "conditions"):
            raise unknown("argument of marker smc", name, ("plants", "conditions"))
    wanted = {
        "plant": _names("plant", named.get("plants", list(PLANTS)), plants()),
        "condition": _conditions(named.get("conditions", ["nominal"])),
    }
    for argument, plural in (("plant", "plants"), ("condition", "conditions")):
        if argument not in arguments and plural in named:
            raise ScenarioError(f"marker smc gives {plural} and the test takes no {argument}: add the argument")
    used = {argument: names for argument, names in wanted.items() if argument in arguments}
    if not used:
        raise ScenarioError("marker smc is on a test that takes neither plant nor condition: add the arguments")
    return used


def _conditions(value: object) -> list[str]:
    """Return one or several conditions as texts."""
    several: Any = value if isinstance(value, list | tuple) else [value]
    return [str(find_condition(condition)) for condition in several]


def _names(kind: str, value: object, known: Mapping[str, object]) -> list[str]:
    """Return one or several names as a list. Raise ScenarioError for an unknown one."""
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list | tuple) or not names:
        raise ScenarioError(f"{kind}s of marker smc is {shown(value)}: give names, as in {EXAMPLE}")
    for name in names:
        find(kind, name, known)
    return list(names)
