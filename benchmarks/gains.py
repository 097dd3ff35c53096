"""The gains of the sets "tuned" and "tracking", found again: smc_mujoco/control/tuned_gains.

    python benchmarks/gains.py              # those that are missing, that another rule found, or
                                            # that miss a condition of their law's theorem
    python benchmarks/gains.py my_law       # only those of some laws
    python benchmarks/gains.py --all        # all of them

Every law by the same rule: twelve searches for the usual laws, which come
first, three for all others and for the set "tracking". The gains of a law on a plant are stored as
soon as their searches end, so this may be stopped at any time, and goes on there. Gains that
another rule found stay, with that rule beside them, until this rule has found some.
"""

import argparse
import time
import warnings
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any, NamedTuple

import smc_mujoco as smc
from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.analysis.tuning.search import RULE, SEARCHES
from smc_mujoco.common.files import read_json, replacing, to_json
from smc_mujoco.control import gain_sets
from smc_mujoco.simulation.force_bounds import U_MAX
from smc_mujoco.simulation.gaber_study import PLANTS

PROCESSES = 2
# with as many searches as the usual laws: a board of all of them has no place for one more, see
# `analysis.ranking`, but the boards of problems rank it
RANKED = (*gain_sets.COMPARED, "hodob")
# searches of a law that is not on the first page, and of the set "tracking": too few for a verdict
OTHERS = 3


class Task(NamedTuple):
    """The searches for the gains of a law on a plant."""

    gains: str  # the set
    plant: str
    law: str
    searches: int

    @property
    def work(self) -> int:
        """A measure of their time: searches, times gains, times channels."""
        plant = smc.plant(self.plant)
        box = search_space.box(smc.law(self.law), search_space.scales(plant, U_MAX))
        return self.searches * len(box) * plant.n


def tasks() -> Iterator[Task]:
    """Every law on every plant: those of the first page first, in the set that ranks them."""
    yield from (Task("tuned", plant, law, SEARCHES) for law in RANKED for plant in PLANTS)
    rarer_laws = [law for law in gain_sets.general() if law not in RANKED]
    yield from (Task("tuned", plant, law, OTHERS) for law in rarer_laws for plant in PLANTS)
    yield from (Task("tracking", plant, law, OTHERS) for law in gain_sets.LAWS for plant in PLANTS)


def tune(task: Task) -> dict[str, Any]:
    """Search for the gains of a law on a plant, and return their record."""
    goal = gain_sets.OBJECTIVES[task.gains]
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "no set of gains tried", smc.errors.ScenarioWarning)
        return smc.tune(
            task.plant, task.law, objective=goal, threads=1, searches=task.searches
        ).record()


def store(task: Task, record: dict[str, Any]) -> None:
    """Put a record into the file of a set, which has one line for each law on each plant."""
    path = gain_sets.file_of(task.gains)
    data = known(path)
    data["plants"].setdefault(task.plant, {})[task.law] = {
        n: value for n, value in record.items() if n != "rule"
    }
    write(path, data)


def known(path: Path) -> dict[str, Any]:
    """Return what the file of a set has; records that another rule than today's found say which."""
    if path.exists():
        data = read_json(path)
    else:
        data = {"rule": RULE, "plants": {}}
    if data["rule"] != RULE:
        for laws in data["plants"].values():
            laws.update({law: {"rule": data["rule"]} | record for law, record in laws.items()})
    return data | {"rule": RULE}


def write(path: Path, data: dict[str, Any]) -> None:
    """Write the file of a set, a line for each record."""
    plants = (
        f"{to_json(plant)}: {{\n"
        + ",\n".join(f" {to_json(law)}: {to_json(laws[law])}" for law in sorted(laws))
        + "\n}"
        for plant, laws in sorted(data["plants"].items())
    )
    with replacing(path) as file:
        text = f'{{"rule": {to_json(data["rule"])},\n"plants": {{\n' + ",\n".join(plants) + "\n}}\n"
        file.write_text(text, encoding="utf-8")


def wanted(laws: list[str], again: bool) -> list[Task]:
    """Return the tasks to do: all, or those whose gains are missing, have another rule or miss a
    condition of their law's theorem.
    """

    def is_missing(task: Task) -> bool:
        record = known(gain_sets.file_of(task.gains))["plants"].get(task.plant, {}).get(task.law)
        if record is None or "rule" in record:
            return True
        sets = range(len(record["sets"]))
        laws = [gain_sets.law_with_gains(task.plant, task.law, task.gains, i) for i in sets]
        return any(law.source.outside for law in laws)

    return [
        task for task in tasks() if (again or is_missing(task)) and (not laws or task.law in laws)
    ]


def main() -> None:
    """Tune what is asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("laws", nargs="*", help="only these laws")
    parser.add_argument("--all", action="store_true", help="tune again what is there")
    options = parser.parse_args()
    todo = wanted(options.laws, options.all)
    start = time.monotonic()
    done = 0
    whole_work = sum(task.work for task in todo)
    with ProcessPoolExecutor(PROCESSES) as pool:
        running = {pool.submit(tune, task): task for task in todo}
        for count, future in enumerate(as_completed(running), 1):
            task = running[future]
            record = future.result()
            store(task, record)
            done += task.work
            minutes = (time.monotonic() - start) / 60.0 * (whole_work / done - 1.0)
            least = min(record["objectives"])
            most = max(record["objectives"])
            words = f"{task.gains}: {task.plant}, {task.law}: J {least:.4g} to {most:.4g} s²"
            print(f"{count}/{len(todo)} {words}; about {minutes:.0f} min left", flush=True)


if __name__ == "__main__":
    main()
