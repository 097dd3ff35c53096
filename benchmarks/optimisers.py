"""`tune`, CMA-ES and Optuna at the same number of evaluations of J, and what J their gains have in
runs that none of them has seen.

    pip install optuna
    python benchmarks/optimisers.py [--write]

Each of the searches has its own initial states and noise, which the three share. The table of
docs/recipes.md is that of benchmarks/optimisers.json, which --write writes.
"""

import json
import math
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

import smc_mujoco as smc
from smc_mujoco.analysis.tuning.objective import objectives
from smc_mujoco.analysis.tuning.objective_function import ObjectiveFunction

MEASURED = Path(__file__).with_suffix(".json")
CASES = ("duffing", "pid"), ("duffing", "super_twisting"), ("inverted_pendulum", "adrc")
SEARCHES = 6
BUDGET = 64  # evaluations for each gain, as in `tune`
WORST = 1e12  # in place of inf, for gains outside the law's theorem


def by_cma_es(objective: ObjectiveFunction, count: int, seed: int) -> list[float]:
    """The best gains of CMA-ES in the logarithm of the gains."""
    from cmaes import CMA

    bounds = np.log10(list(objective.bounds.values()))
    search = CMA(mean=bounds.mean(axis=1), sigma=0.5, bounds=bounds, seed=seed + 1)
    evaluated: list[tuple[float, list[float]]] = []
    while len(evaluated) < count:
        population = [search.ask() for _ in range(search.population_size)]
        costs = []
        for logs in population:
            gains = (10.0**logs).tolist()
            costs.append(min(objective(gains), WORST))
            evaluated.append((costs[-1], gains))
        search.tell(list(zip(population, np.log(costs).tolist(), strict=True)))
    return min(evaluated[:count])[1]


def by_optuna(objective: ObjectiveFunction, count: int, seed: int) -> list[float]:
    """The best gains of Optuna's default sampler, TPE."""
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)

    def cost(trial) -> float:
        gains = []
        for name, (low, high) in objective.bounds.items():
            gains.append(trial.suggest_float(name, low, high, log=True))
        return math.log(min(objective(gains), WORST))

    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=seed))
    study.optimize(cost, n_trials=count)
    return [study.best_params[name] for name in objective.bounds]


OTHERS: dict[str, Callable] = {"CMA-ES": by_cma_es, "Optuna": by_optuna}


def measure() -> dict[str, dict[str, list[float]]]:
    """J of every optimiser's gains in unseen runs, for each search."""
    rows = {}
    for plant, name in CASES:
        law = smc.law(name)
        count = BUDGET * len(smc.design.objective(plant, law).bounds)
        tuned = smc.tune(plant, law, budget=BUDGET, searches=SEARCHES)
        laws = {
            "tune": [
                law(**dict(zip(tuned.bounds, search_result.gains, strict=True)))
                for search_result in tuned.sets
            ]
        }
        for optimiser, best in OTHERS.items():
            laws[optimiser] = []
            for i in range(SEARCHES):
                objective = smc.design.objective(plant, law, search=i)
                laws[optimiser].append(objective.law(best(objective, count, i)))
        row = {}
        for optimiser, gained_laws in laws.items():
            row[optimiser] = objectives(plant, gained_laws)[0].tolist()
        rows[f"{plant} | {name}"] = row
        print(plant, name, row, flush=True)
    return rows


def table(rows: dict[str, dict[str, list[float]]]) -> str:
    """The table of docs/recipes.md: median and largest J of the searches, s^2."""
    lines = ["| plant | law | `tune` | CMA-ES | Optuna |", "|---|---|---|---|---|"]
    for name, row in rows.items():
        cells = []
        for optimiser in ("tune", *OTHERS):
            cells.append(f"{np.median(row[optimiser]):.3g} ({max(row[optimiser]):.3g})")
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    measured = measure()
    print(table(measured))
    if "--write" in sys.argv:
        MEASURED.write_text(json.dumps(measured, indent=1) + "\n", encoding="utf-8")
