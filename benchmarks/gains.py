"""The gains of the sets "tuned" and "tracking", found again: smc_mujoco/control/tuned_gains.

    python benchmarks/gains.py              # those that are missing, or that another rule found
    python benchmarks/gains.py my_law       # only those of some laws
    python benchmarks/gains.py --all        # all of them, within 90 minutes on two cores

Every law by the same rule. Those of the report's first page have the full budget, all others that of three starts, and
the set "tracking" that of one start, which can end far off. Gains are stored as soon as their search ends, so it may be
stopped at any time. A file has the gains of one rule: those of another are left out when the first new ones are stored.
"""

import argparse
import warnings
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import smc_mujoco as smc
from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.analysis.tuning.result import AGREEING_STARTS
from smc_mujoco.analysis.tuning.search import BUDGET, EVALUATIONS_PER_GAIN, RULE, SPARE_EVALUATIONS
from smc_mujoco.common.files import read_json, replacing, to_json
from smc_mujoco.control import gain_sets
from smc_mujoco.evidence.papers.gaber.scenarios import PLANTS
from smc_mujoco.simulation.scenario import U_MAX

PROCESSES = 2
Task = tuple[str, str, str]  # set, plant and law


def tasks() -> Iterator[Task]:
    """Every law on every plant: those of the first page first, in the set that ranks them."""
    yield from (("tuned", plant, law) for plant in PLANTS for law in gain_sets.LAWS)
    others = [law for law in gain_sets.general() if law not in gain_sets.LAWS]
    yield from (("tuned", plant, law) for plant in PLANTS for law in others)
    yield from (("tracking", plant, law) for plant in PLANTS for law in gain_sets.LAWS)


def tune(task: Task) -> dict[str, Any]:
    """Search for the gains of a law on a plant, and return their record."""
    gains, plant, law = task
    searched = search_space.box(smc.law(law), search_space.scales(smc.plant(plant), U_MAX, with_model=False))
    starts = AGREEING_STARTS if gains == "tuned" else 1
    budget = (
        BUDGET
        if starts > 1 and law in gain_sets.LAWS
        else starts * EVALUATIONS_PER_GAIN * len(searched) + SPARE_EVALUATIONS
    )
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "no set of gains tried", smc.ScenarioWarning)
        return smc.tune(plant, law, budget, objective=gain_sets.OBJECTIVES[gains], threads=1).record()


def store(path: Path, plant: str, law: str, record: dict[str, Any]) -> None:
    """Put a record into the file of a set, which has one line for each law on each plant."""
    data = known(path)
    data["plants"].setdefault(plant, {})[law] = {name: value for name, value in record.items() if name != "rule"}
    write(path, data)


def known(path: Path) -> dict[str, Any]:
    """Return what the file of a set has by the rule of today."""
    data = read_json(path) if path.exists() else {}
    return data if data.get("rule") == RULE else {"rule": RULE, "plants": {}}


def write(path: Path, data: dict[str, Any]) -> None:
    """Write the file of a set, a line for each record."""
    plants = (
        f"{to_json(plant)}: {{\n" + ",\n".join(f" {to_json(law)}: {to_json(laws[law])}" for law in sorted(laws)) + "\n}"
        for plant, laws in sorted(data["plants"].items())
    )
    with replacing(path) as file:
        text = f'{{"rule": {to_json(data["rule"])},\n"plants": {{\n' + ",\n".join(plants) + "\n}}\n"
        file.write_text(text, encoding="utf-8")


def wanted(again: bool) -> Iterator[Task]:
    """Yield the tasks to do: all of them, or those whose gains are missing or have another rule."""
    for gains, plant, law in tasks():
        if again or law not in known(gain_sets.file_of(gains))["plants"].get(plant, {}):
            yield gains, plant, law


def main() -> None:
    """Tune what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("laws", nargs="*", help="only these laws")
    parser.add_argument("--all", action="store_true", help="tune again what is there")
    asked = parser.parse_args()
    with ProcessPoolExecutor(PROCESSES) as pool:
        todo = (task for task in wanted(asked.all) if not asked.laws or task[-1] in asked.laws)
        running = {pool.submit(tune, task): task for task in todo}
        for done in as_completed(running):
            (gains, plant, law), record = running[done], done.result()
            store(gain_sets.file_of(gains), plant, law, record)
            ended = {True: "converged", False: "not converged", None: "too few starts"}[record["converged"]]
            print(f"{gains}: {plant}, {law}: {record['objective']:.4g} s², {ended}", flush=True)


if __name__ == "__main__":
    main()
