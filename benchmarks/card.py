"""What a CUDA device makes of machines of your own, against the processor, in ten minutes.

    python benchmarks/card.py            # or "no device": make gpu
    python benchmarks/card.py --write    # also benchmarks/card.json, and the table of docs/gpu.md

Measured are: whether a step is captured as one graph; the time of a step of MuJoCo Warp by the
number of worlds, with and without the control callback; runs of a Panda of 3 s a second, beside all
threads of this machine; whether contacts fit, and how far scores are from MuJoCo's; and a wide
search of gains against `smc.tune`. A part that fails is reported, and the others go on.
"""

import datetime
import functools
import json
import sys
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from engine import has_device
from scipy.stats import qmc

import smc_mujoco as smc
from smc_mujoco.analysis.engine.form import FAILURE, SCORES, SETTING
from smc_mujoco.analysis.engine.worlds import WorldGroup
from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics import catalogue
from smc_mujoco.simulation import state
from smc_mujoco.simulation.conditions import NAMED
from smc_mujoco.simulation.run import cores

ROOT = Path(__file__).parents[1]
MEASURED = Path(__file__).with_suffix(".json")
PAGE = ROOT / "docs" / "gpu.md"
ARM = """
<mujoco model="arm">
  <default><geom type="capsule" size="0.03" contype="0" conaffinity="0"/></default>
  <worldbody>
    <body pos="0 0 1.2">
      <joint name="shoulder" axis="0 1 0" damping="0.1"/>
      <geom fromto="0 0 0 0 0 -0.5" mass="1.5"/>
      <body pos="0 0 -0.5">
        <joint name="elbow" axis="0 1 0" damping="0.1"/>
        <geom fromto="0 0 0 0 0 -0.4" mass="0.8"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="shoulder" ctrlrange="-40 40"/><motor joint="elbow" ctrlrange="-20 20"/>
  </actuator>
</mujoco>
"""
WALL = ARM.replace('contype="0" conaffinity="0"', 'contype="1" conaffinity="2"').replace(
    "<worldbody>",
    '<worldbody><geom type="box" size=".05 .5 .5" pos=".3 0 .5" contype="2" conaffinity="1"/>',
)
METRICS = ("itae", "tv", "rms_error", "ultimate_bound")
WORLDS = (1, 1_000, 32_768, 262_144)
STEPS = 100, 300  # the difference of their times leaves out compilation and start
PANDAS = 100_000
BY_MUJOCO = 64
NOISE = smc.Noise(1e-4, 1e-3)
# Rows of the table: what, then name in the JSON
ROWS = {
    "a step of 1 / 1,000 / 32,768 / 262,144 worlds of a two-joint arm, ms": "arm",
    "the same of a Panda with its limits, ms": "panda",
    "share of the control callback in the last": "callback",
    "runs of a Panda, 3 s each, per second on the card": "card_runs",
    "the same in all threads of that machine's processor": "thread_runs",
    "largest relative error of scores, 64 runs of an arm at a wall, 10 s": "wall_apart",
    "of these runs, failed on the card": "wall_failed",
    "J of a wide search's gains over J of smc.tune's, and its time over tune's": "wide",
}


def arm(text: str = ARM) -> Plant:
    return smc.plant_from(
        text, {"shoulder": smc.Channel(x0=0.4), "elbow": smc.Channel(x0=-0.3)}, name="arm"
    )


def group_of(plant: Plant, duration: float, **fields: Any) -> WorldGroup:
    fields = {"noise": NOISE, "law": smc.law("pid")} | fields
    return WorldGroup([smc.Scenario(plant=plant, duration=duration, **fields)], METRICS)


def rows_of(group: WorldGroup, count: int) -> np.ndarray:
    """Rows of runs that differ in seed and start."""
    rows = np.repeat(group.rows[:1], count, axis=0)
    x0_place = group.layout.row.x0
    n = group.form.n
    rows[:, x0_place : x0_place + n] += np.random.default_rng(1).uniform(-0.05, 0.05, (count, n))
    rows[:, SETTING.seed] = np.arange(count)
    return rows


def seconds(action: Callable[[], object]) -> float:
    began = time.perf_counter()
    action()
    return time.perf_counter() - began


def step_time(group: WorldGroup, count: int) -> float:
    """Milliseconds of a physics step with its callback."""
    rows = rows_of(group, count)
    taken = []
    for steps in STEPS:
        rows[:, SETTING.samples] = steps // rows[0, SETTING.steps]
        taken.append(seconds(lambda: group.run(rows)))
    return 1e3 * (taken[1] - taken[0]) / (STEPS[1] - STEPS[0])


def bare_step_time(group: WorldGroup, count: int) -> float:
    """The same without the callback."""
    import mujoco_warp
    import warp

    from smc_mujoco.analysis.engine import warp as engine

    members = np.zeros(count, int)
    model, data = engine.worlds_of(group.runs, rows_of(group, count), members, {}, engine.CONTACTS)
    step = functools.partial(mujoco_warp.step, model, data)
    step()
    with warp.ScopedCapture() as capture:
        step()
    warp.synchronize()
    began = time.perf_counter()
    for _ in range(STEPS[1]):
        warp.capture_launch(capture.graph)
    warp.synchronize()
    return 1e3 * (time.perf_counter() - began) / STEPS[1]


def times_of_steps() -> dict[str, Any]:
    """Times of steps, and whether a step was captured."""
    panda = group_of(smc.plant("panda"), 1.0)
    times: dict[str, Any] = {}
    for name, group in (("arm", group_of(arm(), 1.0)), ("panda", panda)):
        times[name] = [step_time(group, count) for count in WORLDS]
    times["callback"] = 1.0 - bare_step_time(panda, WORLDS[-1]) / times["panda"][-1]
    return times


def pandas() -> dict[str, Any]:
    """Runs a second, on the card and in all threads of the processor."""
    group = group_of(smc.plant("panda"), 3.0)
    rows = rows_of(group, PANDAS)
    taken = seconds(lambda: group.run(rows))
    fields = {"plant": "panda", "law": smc.law("pid"), "noise": NOISE, "duration": 3.0}
    cases = [smc.Scenario(seed=seed, **fields) for seed in range(BY_MUJOCO)]
    by_threads = seconds(lambda: smc.run(cases))
    threads = {"thread_runs": BY_MUJOCO / by_threads, "threads": cores(None)}
    return {"card_runs": PANDAS / taken} | threads


def wall() -> dict[str, Any]:
    """How far scores of runs with contacts are from MuJoCo's. Contacts that do not fit raise."""
    cases = []
    for seed in range(BY_MUJOCO):
        x0 = (0.4 + 1e-3 * seed, -0.3)
        cases.append(
            smc.Scenario(plant=arm(WALL), law=smc.law("pid"), noise=NOISE, seed=seed, x0=x0)
        )
    group = WorldGroup(cases, METRICS)
    group_scores = group.run(group.rows)  # raises where contacts do not fit
    apart = 0.0
    for scores, trace in zip(group_scores, smc.run(cases), strict=True):
        for name, value in zip(METRICS, scores[SCORES:], strict=True):
            expected = getattr(catalogue, name)(trace)
            apart = max(apart, abs(value - expected) / max(abs(expected), 1e-12))
    return {"wall_apart": apart, "wall_failed": int((group_scores[:, FAILURE] != state.FINE).sum())}


def costs(group: WorldGroup, goal: Objective, names: list[str], sets: np.ndarray) -> np.ndarray:
    """J of sets of gains, in one batch."""
    case = group.scenarios[0]
    rows = np.repeat(group.rows[:1], len(sets), axis=0)
    for j, name in enumerate(names):
        rows[:, group.gain_columns(name)] = sets[:, [j]]
    J = []
    start = sum(map(abs, case.x0))
    for failure, step, itae, tv in group.run(rows).tolist():
        terms = goal.terms_of_failure(step * case.physics_step)
        if failure == state.FINE:
            terms = goal.terms_of_sums(case, itae, start, tv)
        J.append(terms[0] + goal.weight * terms[1])
    return np.array(J)


def wide() -> dict[str, Any]:
    """A search of four batches against `smc.tune`: J and time. MuJoCo runs J, on unseen starts."""
    plant = arm()
    law = smc.law("super_twisting")
    goal = Objective(conditions=(NAMED["noise"],), duration=3.0)
    began = time.perf_counter()
    (case,) = goal.scenarios(plant, law)
    group = WorldGroup([case], ("itae", "tv"))
    bound = float(np.max(case.resolved.u_max))
    box = search_space.box(law, search_space.scales(plant, bound))
    names = list(box)
    low, high = np.log10(list(box.values())).T
    logs = qmc.scale(
        qmc.LatinHypercube(len(box), rng=np.random.default_rng(1)).random(4096), low, high
    )
    draw = np.random.default_rng(1)
    best = logs
    for _ in range(4):
        ranks = np.argsort(costs(group, goal, names, 10**logs))
        best = logs[ranks[:64]]
        logs = np.vstack([best, draw.multivariate_normal(best.mean(0), np.cov(best.T), 960)])
    taken = time.perf_counter() - began
    began = time.perf_counter()
    tuned = smc.tune(plant, law, objective=goal, searches=1)
    of_tune = time.perf_counter() - began
    gains = dict(zip(names, 10 ** best[0], strict=True))
    J = []
    for gained_law in (smc.law("super_twisting", **gains), tuned.law):
        (unseen,) = goal.scenarios(plant, gained_law, search=1)
        terms = goal.terms_of_run(smc.run(unseen))
        J.append(terms[0] + goal.weight * terms[1])
    return {"wide": [J[0] / J[1], taken / of_tune]}


def shown(value: Any) -> str:
    """A number of the JSON as the page has it."""
    if value is None:
        return "not measured"
    if isinstance(value, list):
        return " / ".join(f"{number:.3g}" for number in value)
    return f"{value:.3g}"


def table(measured: dict[str, Any]) -> str:
    """The page's table, of what the JSON has."""
    where = measured.get("card", "no card was at hand")
    lines = [f"| own machine on a card ({where}) | |", "|---|---|"]
    for what, name in ROWS.items():
        lines.append(f"| {what} | {shown(measured.get(name))} |")
    return "\n".join(lines)


def load() -> dict[str, Any]:
    """What was measured; empty if nothing was."""
    return json.loads(MEASURED.read_text(encoding="utf-8")) if MEASURED.exists() else {}


def main() -> None:
    if not has_device():
        return
    from smc_mujoco.analysis.engine import gpu

    before = table(load())
    name = gpu.cuda.get_current_device().name
    card = name.decode() if isinstance(name, bytes) else name
    measured: dict[str, Any] = {"card": f"{card}, {datetime.date.today()}"}
    for part in (times_of_steps, pandas, wall, wide):
        try:
            with warnings.catch_warnings(record=True) as caught:
                measured |= part()
            print(part.__name__, *map(str, caught), flush=True)
        except Exception:  # the others go on
            print(f"{part.__name__} failed:\n{traceback.format_exc()}", flush=True)
    print(table(measured))
    if "--write" in sys.argv:
        MEASURED.write_text(json.dumps(measured, indent=1) + "\n", encoding="utf-8")
        page = PAGE.read_text(encoding="utf-8")
        PAGE.write_text(page.replace(before, table(measured)), encoding="utf-8")


if __name__ == "__main__":
    main()
