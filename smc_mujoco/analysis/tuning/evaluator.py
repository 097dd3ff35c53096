"""The objective J of laws with given gains."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from smc_mujoco.analysis.tuning.objective import OBJECTIVES, Objective
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control.component import Component
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.run import run


def objectives(
    plant: Plant | str,
    laws: Sequence[Component],
    goal: Objective = OBJECTIVES["balanced"],
    instances: Sequence[int] | None = None,
    threads: int | None = None,
    halved: bool = False,
) -> np.ndarray:
    """Return J of laws on instances that no search has seen, (laws,), s^2, computed by MuJoCo.

    Args:
      laws: with their gains. Law i runs on instance i: its own starts and noise, one run for each condition.
      instances: numbers of the instances, in place of 0, 1, ...
      threads: as in `run`.
      halved: whether the runs have half their physics step.
    """
    numbers = range(len(laws)) if instances is None else instances
    if len(numbers) != len(laws):
        raise ScenarioError(f"{len(laws)} laws and {len(numbers)} instances: give an instance for each law")
    cases = [goal.unseen(plant, law, number) for law, number in zip(laws, numbers, strict=True)]
    if halved:
        cases = [[dataclasses.replace(c, physics_step=0.5 * c.resolved.physics_step) for c in its] for its in cases]
    size, traces = len(goal.conditions), run([case for its in cases for case in its], threads)
    totals = []
    for i, its in enumerate(cases):
        tracking, variation = goal.terms(traces[i * size : (i + 1) * size])
        totals.append(tracking + goal.weight * variation + goal.excess(its[0]))
    return np.array(totals)
