"""Cases of the marker `smc`: plants and conditions of the study as arguments of a test."""

from collections.abc import Collection, Mapping, Sequence

from smc_mujoco.common.errors import ScenarioError, find, shown
from smc_mujoco.mechanisms.plant import catalogue as plants
from smc_mujoco.simulation.conditions import PLANTS, find_condition

DEFAULTS = {"plants": PLANTS, "conditions": ("nominal",)}
NAMES = {  # argument -> the name of what the marker gives for it
    "plant": lambda given: find("plant", given, plants()).name,
    "condition": lambda given: str(find_condition(given)),
}
EXAMPLE = '@pytest.mark.smc(plants=["duffing"], conditions=["nominal", "noise"])'


def cases(given: Sequence[object], named: Mapping[str, object], arguments: Collection[str]) -> dict[str, list[str]]:
    """Return the test's argument, "plant" or "condition" -> the names with which the test runs."""
    if given:
        raise ScenarioError(f"marker smc is given {shown(given[0])}: name its arguments, as in {EXAMPLE}")
    for name in named:
        find("argument of marker smc", name, DEFAULTS)
    used: dict[str, list[str]] = {}
    for plural, default in DEFAULTS.items():
        argument, value = plural.removesuffix("s"), named.get(plural, default)
        several = value if isinstance(value, list | tuple) else [value]
        if argument in arguments:
            if not several:
                raise ScenarioError(f"{plural} of marker smc is {shown(value)}: give names, as in {EXAMPLE}")
            used[argument] = [NAMES[argument](one) for one in several]
        elif plural in named:
            raise ScenarioError(f"marker smc gives {plural} and the test takes no {argument}: add the argument")
    if not used:
        raise ScenarioError("marker smc is on a test that takes neither plant nor condition: add the arguments")
    return used
