"""The three stages of one search for gains: a Latin hypercube, an evolution, a descent.

    find(trials, box, searched, size, random)

Each stage begins with the best gains of the one before. All work in the logarithm (base 10) of the gains.
"""

import contextlib
import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from smc_mujoco.analysis.tuning.evaluator import Evaluator
from smc_mujoco.analysis.tuning.objective import Evaluation
from smc_mujoco.analysis.tuning.search_space import Box

SCREENED_SHARE, EVOLVED_SHARE = 1 / 8, 1 / 2  # of the evaluations; the rest descend
FIRST_DEVIATION = 0.3  # decades: first standard deviation of the evolution; chosen
FIRST_RADIUS, LAST_RADIUS = 0.1, 0.005  # decades, of the descent's trust region; chosen
PATIENCE = 1e-3  # a descent ends when 2 n + 2 evaluations lower J by a smaller share
GAIN_DIGITS = 4

Gains = tuple[float, ...]


@dataclasses.dataclass
class Trials:
    """The evaluations of one search. `cheap` screens candidates, `accurate` decides; both may be the same."""

    cheap: Evaluator
    accurate: Evaluator
    names: tuple[str, ...]
    limit: Callable[[dict[str, float]], dict[str, float]]  # gains -> the largest values of some of them
    report: Callable[[int], None]  # called with the number of new evaluations
    screened: dict[Gains, Evaluation] = dataclasses.field(default_factory=dict)
    decided: dict[Gains, Evaluation] = dataclasses.field(default_factory=dict)

    def __post_init__(self):
        if self.cheap is self.accurate:
            self.screened = self.decided

    @property
    def count(self) -> int:
        """The number of evaluations."""
        return len(self.decided) + (0 if self.screened is self.decided else len(self.screened))

    @property
    def best(self) -> Evaluation:
        """The accurate evaluation with the least J."""
        return min(self.decided.values(), key=lambda one: one.objective)

    def screen(self, logs: np.ndarray) -> np.ndarray:
        """Return J of candidates (candidates, gains), given as log10 gains, from cheap runs."""
        return self._costs([self.gains(row) for row in logs.tolist()], self.cheap, self.screened)

    def cost(self, logs: np.ndarray) -> float:
        """Return the accurate J of a candidate, given as log10 gains (gains,)."""
        return self._costs([self.gains(logs.tolist())], self.accurate, self.decided)[0]

    def gains(self, logs: Sequence[float]) -> Gains:
        """Return the gains of a candidate, with four digits."""
        gains = {name: _rounded(10.0**z) for name, z in zip(self.names, logs, strict=True)}
        for name, largest in self.limit(gains).items():
            gains[name] = min(gains[name], _rounded(largest))
        return tuple(gains.values())

    def _costs(self, candidates: list[Gains], evaluate: Evaluator, known: dict[Gains, Evaluation]) -> np.ndarray:
        new = list(dict.fromkeys(gains for gains in candidates if gains not in known))
        known.update(zip(new, evaluate(new), strict=True))
        self.report(len(new))
        return np.array([known[gains].objective for gains in candidates])


def _rounded(gain: float) -> float:
    return float(f"{gain:.{GAIN_DIGITS}g}")


def find(trials: Trials, box: Box, searched: Box, size: int, random: np.random.Generator) -> None:
    """Make one search of at most `size` evaluations, with starts in the box, within the bounds `searched`."""
    logs, cost = _screened(trials, box, random, int(SCREENED_SHARE * size))
    logs = _evolved(trials, searched, random, logs, cost, int(EVOLVED_SHARE * size))
    _descend(trials, searched, logs, size - trials.count)


def _screened(trials: Trials, box: Box, random: np.random.Generator, size: int) -> tuple[np.ndarray, float]:
    """Return the log10 gains of the best of a Latin hypercube in the box, and their J; the middle if size is 0."""
    from scipy.stats.qmc import LatinHypercube

    low, high = np.log10(list(box.values())).T
    if not size:
        return (low + high) / 2.0, np.inf
    logs = low + (high - low) * LatinHypercube(len(low), rng=random).random(size)
    costs = trials.screen(logs)
    return logs[np.argmin(costs)], costs.min()


def _evolved(
    trials: Trials, box: Box, random: np.random.Generator, logs: np.ndarray, cost: float, size: int
) -> np.ndarray:
    """Return the best log10 gains of an evolution from those given, whose J is `cost`, within a box."""
    from cmaes import CMA

    if len(logs) < 2:  # CMA-ES adapts a covariance
        return logs
    bounds, seed = np.log10(list(box.values())), int(random.integers(2**31))
    evolution = CMA(mean=logs, sigma=FIRST_DEVIATION, bounds=bounds, seed=seed)
    for _ in range(size // evolution.population_size):
        candidates = np.array([evolution.ask() for _ in range(evolution.population_size)])
        costs = trials.screen(candidates)
        evolution.tell(list(zip(candidates, costs, strict=True)))
        if costs.min() < cost:
            logs, cost = candidates[np.argmin(costs)], costs.min()
    return logs


class _Enough(Exception):
    """A descent has ended."""


def _descend(trials: Trials, box: Box, logs: np.ndarray, size: int) -> None:
    """Descend from log10 gains within a box with at most `size` accurate evaluations, until they gain too little."""
    from scipy.optimize import Bounds, minimize

    low, high = np.log10(list(box.values())).T
    costs = [trials.cost(logs)]
    window = 2 * len(logs) + 2

    def cost(z: np.ndarray) -> float:
        costs.append(trials.cost(np.clip(z, low, high)))
        if len(costs) > 2 * window and min(costs[:-window]) <= min(costs) * (1.0 + PATIENCE):
            raise _Enough
        return np.log(costs[-1])

    if size <= 1:
        return
    bounds, radii = Bounds(low, high), {"initial_tr_radius": FIRST_RADIUS, "final_tr_radius": LAST_RADIUS}  # pyright: ignore[reportArgumentType]
    with contextlib.suppress(_Enough):
        minimize(cost, logs, method="COBYQA", bounds=bounds, options={"maxfev": size - 1, **radii})
