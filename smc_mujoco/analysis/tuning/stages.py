"""The stages of a search for gains, on evaluations that are kept: a hypercube, an evolution and a
descent, in the logarithm of the gains. `search` and `quick_search` say which evaluations they use.
"""

import contextlib
import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from smc_mujoco.analysis.tuning.evaluator import Evaluator
from smc_mujoco.analysis.tuning.objective import Evaluation
from smc_mujoco.analysis.tuning.search_space import Box
from smc_mujoco.common.aliases import Array, Names

Gains = tuple[float, ...]
SCREENED_SHARE, EVOLVED_SHARE = 1 / 8, 1 / 2  # of the evaluations; the rest descend
FIRST_DEVIATION = 0.3  # decades: first standard deviation of the evolution; chosen
FIRST_RADIUS, LAST_RADIUS = 0.1, 0.005  # decades, of the descent's trust region; chosen
PATIENCE = 1e-3  # a descent ends when 2 n + 2 evaluations lower J by a smaller share
GAIN_DIGITS = 4
DRAWS = 1000  # of gains that hold the conditions of the law's theorem, before it gives up; chosen
BISECTIONS = 20  # to the border of the theorem; chosen


@dataclasses.dataclass
class Trials:
    """The evaluations of one search.

    `cheap` screens candidates, `accurate` decides; both may be the same.
    """

    cheap: Evaluator
    accurate: Evaluator
    names: Names
    # gains -> the largest values of some of them
    limit: Callable[[dict[str, float]], dict[str, float]]
    report: Callable[[int], None]  # called with the number of new evaluations
    # whether gains hold the conditions of the law's theorem
    holds: Callable[[Gains], bool] = lambda gains: True
    screened: dict[Gains, Evaluation] = dataclasses.field(default_factory=dict)
    decided: dict[Gains, Evaluation] = dataclasses.field(default_factory=dict)

    def __post_init__(self):
        if self.cheap is self.accurate:
            self.screened = self.decided

    @property
    def count(self) -> int:
        """The number of evaluations."""
        screened = 0 if self.screened is self.decided else len(self.screened)
        return len(self.decided) + screened

    @property
    def best(self) -> Evaluation:
        """The accurate evaluation with the least J."""
        return min(self.decided.values(), key=lambda one: one.objective)

    def screen(self, logs: Array) -> Array:
        """Return J of candidates (candidates, gains), given as log10 gains, from cheap runs."""
        candidates = list(map(self.gains, logs.tolist()))
        return self._costs(candidates, self.cheap, self.screened)

    def cost(self, logs: Array) -> float:
        """Return the accurate J of a candidate, given as log10 gains (gains,)."""
        gains = self.gains(logs.tolist())
        return self._costs([gains], self.accurate, self.decided)[0]

    def within(self, logs: Array) -> bool:
        """Return whether log10 gains hold the conditions of the law's theorem."""
        return self.holds(self.gains(logs.tolist()))

    def drawn(self, draw: Callable[[], Array], inside: Array) -> Array:
        """Return the first of DRAWS draws within the theorem, else `inside`."""
        for _ in range(DRAWS):
            if self.within(logs := draw()):
                return logs
        return inside

    def drawn_back(self, logs: Array, inside: Array) -> Array:
        """Return the log10 gains on the way from those `inside` to others, where the theorem
        ends.
        """
        if self.within(logs):
            return logs
        share = 0.0
        for k in range(1, BISECTIONS + 1):
            further = share + 0.5**k
            if self.within(inside + further * (logs - inside)):
                share = further
        return inside + share * (logs - inside)

    def gains(self, logs: Sequence[float]) -> Gains:
        """Return the gains of a candidate, with four digits."""
        gains = {}
        for name, z in zip(self.names, logs, strict=True):
            gains[name] = _rounded(10.0**z)
        for name, largest in self.limit(gains).items():
            gains[name] = min(gains[name], _rounded(largest))
        return tuple(gains.values())

    def _costs(
        self, candidates: list[Gains], evaluate: Evaluator, known: dict[Gains, Evaluation]
    ) -> Array:
        fresh = dict.fromkeys(gains for gains in candidates if gains not in known)
        new = list(fresh)
        known.update(zip(new, evaluate(new), strict=True))
        self.report(len(new))
        return np.array([known[gains].objective for gains in candidates])


def _rounded(gain: float) -> float:
    return float(f"{gain:.{GAIN_DIGITS}g}")


def hypercube(
    trials: Trials, box: Box, random: np.random.Generator, size: int, inside: Array
) -> tuple[Array, float]:
    """Return the log10 gains of the best of a Latin hypercube in the box, and their J; those
    `inside` if size is 0.
    """
    from scipy.stats.qmc import LatinHypercube

    low, high = np.log10(list(box.values())).T
    if not size:
        return inside, np.inf
    drawn = LatinHypercube(len(low), rng=random).random(size)
    logs = low + (high - low) * drawn
    for i, gains in enumerate(logs):
        if not trials.within(gains):
            logs[i] = trials.drawn(lambda: random.uniform(low, high), inside)
    costs = trials.screen(logs)
    return logs[np.argmin(costs)], costs.min()


def evolved(
    trials: Trials, box: Box, random: np.random.Generator, logs: Array, cost: float, size: int
) -> Array:
    """Return the best log10 gains of an evolution from those given, whose J is `cost`, within a
    box.
    """
    from cmaes import CMA

    if len(logs) < 2:  # CMA-ES adapts a covariance
        return logs
    bounds = np.log10(list(box.values()))
    seed = int(random.integers(2**31))
    evolution = CMA(mean=logs, sigma=FIRST_DEVIATION, bounds=bounds, seed=seed)
    for _ in range(size // evolution.population_size):
        drawn = []
        for _ in range(evolution.population_size):
            drawn.append(trials.drawn(evolution.ask, logs))
        candidates = np.array(drawn)
        costs = trials.screen(candidates)
        evolution.tell(list(zip(candidates, costs, strict=True)))
        if costs.min() < cost:
            logs = candidates[np.argmin(costs)]
            cost = costs.min()
    return logs


class _DescentEnded(Exception):
    """A descent has ended."""


def descend(trials: Trials, box: Box, logs: Array, size: int) -> None:
    """Descend from log10 gains within a box with at most `size` accurate evaluations, until they
    gain too little.
    """
    from scipy.optimize import Bounds, minimize

    low, high = np.log10(list(box.values())).T
    costs = [trials.cost(logs)]
    window = 2 * len(logs) + 2

    def cost(z: Array) -> float:
        gains = trials.drawn_back(np.clip(z, low, high), logs)
        costs.append(trials.cost(gains))
        if len(costs) > 2 * window and min(costs[:-window]) <= min(costs) * (1.0 + PATIENCE):
            raise _DescentEnded
        return np.log(costs[-1])

    if size <= 1:
        return
    bounds, radii = (
        Bounds(low, high),
        {"initial_tr_radius": FIRST_RADIUS, "final_tr_radius": LAST_RADIUS},
    )  # pyright: ignore[reportArgumentType]
    with contextlib.suppress(_DescentEnded):
        options = {"maxfev": size - 1, **radii}
        minimize(cost, logs, method="COBYQA", bounds=bounds, options=options)
