"""How good the indices of `smc.sensitivity` are: errors, sums and intervals on functions whose
indices are known.

    python benchmarks/sensitivity.py [POINTS ...]

A row has, for a function and a number of points: the rms error of first-order and total indices, by
the suite and by Saltelli's estimates (2010), as they come, without bounds; the largest sum of first
and the least sum of total ones, of both; and how often a nominal 95 % interval holds an index above
0.02. 60 seeds. True indices are estimates from 65,536 points. It takes some minutes.
"""

import math
import sys
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.stats import sobol_indices

from smc_mujoco.robustness import sobol

SEEDS = 60
TRUE_POINTS = 2**16
TOLD = 0.02
WEIGHTS = np.array([0.0, 1.0, 4.5, 9.0, 99.0, 99.0, 99.0, 99.0])  # of Sobol's g


def ishigami(x: np.ndarray) -> np.ndarray:
    a, b, c, _ = (2.0 * math.pi * x - math.pi).T
    return np.sin(a) + 7.0 * np.sin(b) ** 2 + 0.1 * c**4 * np.sin(a)


FUNCTIONS: dict[str, tuple[int, Callable[[np.ndarray], np.ndarray]]] = {
    "ishigami": (4, ishigami),
    "one axis": (8, lambda x: 10.0 * x[:, 0] + 0.3 * x[:, 1:].sum(1)),
    "sum": (8, lambda x: x.sum(1)),
    "product": (8, lambda x: 3.0 * x[:, 0] * (1.0 + x[:, 1]) + 0.5 * x[:, 2:].sum(1)),
    "g": (8, lambda x: np.prod((np.abs(4.0 * x - 2.0) + WEIGHTS) / (1.0 + WEIGHTS), axis=1)),
    "cliff": (8, lambda x: np.log(1e-3 + (x[:, 0] > 0.9) + 0.02 * x[:, 1] + 0.01 * x[:, 2] ** 2)),
}


def known(scores: np.ndarray, n: int, **options) -> np.ndarray:
    """Return the first-order and total indices from the scores of a design, (2, k)."""
    a, b, *mixed = scores.reshape(-1, 1, n).copy()
    found = sobol_indices(func={"f_A": a, "f_B": b, "f_AB": np.array(mixed)}, n=n, **options)
    return np.reshape([found.first_order, found.total_order], (2, -1))


def row(name: str, n: int) -> str:
    """Return what a function tells with a number of points."""
    k, function = FUNCTIONS[name]
    space: Any = SimpleNamespace(names=tuple(map(str, range(k))), ends=[(0.0, 1.0, "")] * k)
    true = np.maximum(known(function(sobol.designs(TRUE_POINTS, k, SEEDS)), TRUE_POINTS), 0.0)
    ours = []
    saltelli = []
    held = []
    for seed in range(SEEDS):
        designs = sobol.designs(n, k, seed)
        scores = function(designs)
        scores -= scores.min() + 1.0  # none is positive, so none is told by its logarithm
        axes = sobol.indices(space, scores, n, designs[: 2 * n], scores[: 2 * n], seed)
        its = np.array([[axis.first[:3] for axis in axes], [axis.total[:3] for axis in axes]])
        ours.append(its[..., 0])
        held.append((its[..., 1] <= true + 1e-9) & (true <= its[..., 2] + 1e-9))
        saltelli.append(known(scores, n))
    line = f"{name}, {n} points: "
    for who, found in (("", np.array(ours)), ("Saltelli's ", np.array(saltelli))):
        errors = np.sqrt(np.square(found - true).mean(axis=(0, 2)))
        sums = found.sum(2)
        line += (
            f"{who}errors {errors[0]:.3f} {errors[1]:.3f}, sums {sums[:, 0].max():.2f} "
            f"{sums[:, 1].min():.2f}; "
        )
    share = [np.array(held)[:, i, true[i] > TOLD].mean() for i in (0, 1)]
    return f"{line}held {share[0]:.2f} {share[1]:.2f}"


if __name__ == "__main__":
    for points in map(int, sys.argv[1:] or (8, 32, 64)):
        for name in FUNCTIONS:
            print(row(name, points), flush=True)
