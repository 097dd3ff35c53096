"""J of the sets of gains of quick searches over that of whole searches: quick_searches.json.

    python benchmarks/quick_searches.py [--write]

Two joints, three laws, seven quick searches of each, made once more where they were stuck as in a
race, and two whole ones. J is the median of the same three unseen instances under friction,
contact, delay and noise. It takes five minutes of processor time.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np

import smc_mujoco as smc
from smc_mujoco.analysis.tuning import quick_search, search
from smc_mujoco.analysis.tuning.evaluator import with_gains
from smc_mujoco.analysis.tuning.objective import BUDGET, Objective, objectives
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation.conditions import find_condition
from smc_mujoco.studies.race import LOOKS, stuck

FILE = Path(__file__).with_suffix(".json")
CONDITIONS = tuple(map(find_condition, ("noise", "friction", "delay_10ms", "contact")))
GOAL = Objective(conditions=CONDITIONS, duration=2.0)
LAWS, WHOLE, INSTANCES = ("super_twisting", "adrc", "pid"), 2, 3
LIFT = """<mujoco model="lift"><compiler angle="radian"/><default>
<geom type="capsule" size=".03" contype="0" conaffinity="0"/></default><worldbody>
<body name="upper" pos="0 0 1.2"><joint name="shoulder" axis="0 1 0" damping=".1" armature=".02"
range="-2 2"/><geom fromto="0 0 0 0 0 -.5" mass="1.5"/><body name="fore" pos="0 0 -.5">
<joint name="elbow" axis="0 1 0" damping=".1" armature=".01" range="-1.5 1.5"/>
<geom fromto="0 0 0 0 0 -.4" mass=".8"/></body></body></worldbody><actuator>
<motor joint="shoulder" gear="40" ctrlrange="-1 1"/><motor joint="elbow" gear="20"
ctrlrange="-1 1"/></actuator></mujoco>"""
HOBBY = """<mujoco model="hobby"><compiler angle="radian"/><worldbody><body name="arm">
<joint name="j" axis="0 -1 0" damping=".6" armature=".028" frictionloss=".052" range="-1.9 1.9"/>
<geom type="capsule" fromto="0 0 0 .2 0 0" size=".02" mass=".3" contype="0" conaffinity="0"/>
</body></worldbody><actuator><motor joint="j" ctrlrange="-2.94 2.94"/></actuator></mujoco>"""
PLANTS = {
    "lift": lambda: smc.plant_from(LIFT, ["elbow"], name="lift", others="held"),
    "hobby": lambda: smc.plant_from(HOBBY, ["j"], name="hobby"),
}


def medians(task: search.TuningTask, found: list[search.SearchResult]) -> np.ndarray:
    """Return the median J of each set on the same unseen instances."""
    values = []
    for search_result in found:
        law = with_gains(task.law, tuple(task.box), search_result.best.gains)
        J, _ = objectives(task.plant, [law] * INSTANCES, task.goal, range(INSTANCES), 1)
        values.append(float(np.median(J)))
    return np.array(values)


def searched(plant: Plant, name: str, quick: bool) -> tuple[np.ndarray, int, float]:
    """Return J of the sets of a law, how many searches were stuck, and seconds of a search."""
    budget = quick_search.BUDGET if quick else BUDGET
    task = search.task_of(plant, coerce.coerced_law(name), GOAL, budget, 0, 1)._replace(quick=quick)
    start = time.process_time()
    search_results = [
        task.search(i, "", lambda count: None) for i in range(LOOKS[0] if quick else WHOLE)
    ]
    seconds = (time.process_time() - start) / len(search_results)
    again = (
        stuck([search_result.best.objective for search_result in search_results]) if quick else []
    )
    for i in again:
        better = (search_results[i], task.search(i, "", lambda count: None, 1))
        search_results[i] = min(better, key=lambda search_result: search_result.best.objective)
    return medians(task, search_results), len(again), seconds


def main() -> None:
    """Print a row for each plant and law, and write them all where it is asked for."""
    rows = []
    for name, make in PLANTS.items():
        plant = make()
        for law in LAWS:
            quick, again, seconds = searched(plant, law, True)
            whole_medians, _, whole_seconds = searched(plant, law, False)
            ratios = quick / np.median(whole_medians)
            row = {
                "plant": name,
                "law": law,
                "median": float(f"{np.median(ratios):.3g}"),
                "worst": float(f"{ratios.max():.3g}"),
                "again": again,
                "time": float(f"{seconds / whole_seconds:.2g}"),
            }
            rows.append(row)
            print(row, flush=True)
    if "--write" in sys.argv:
        FILE.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
