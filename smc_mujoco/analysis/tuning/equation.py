"""J of candidates by the fast engine, in place of MuJoCo.

Its J differs from MuJoCo's by rounding, which laws that chatter magnify to about 1e-3. So it may
only find gains; the J on record is MuJoCo's.
"""

from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np

from smc_mujoco.analysis.engine.group import Group, key
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.common.aliases import Floats, Pair
from smc_mujoco.simulation import state
from smc_mujoco.simulation.scenario import Scenario


class Equations:
    """The runs by the plant's equation, all candidates at once."""

    def __init__(
        self,
        goal: Objective,
        cases: Sequence[Scenario],
        names: Sequence[str],
        threads: int,
        device: str,
    ):
        self.goal = goal
        self.cases = cases
        self.threads = threads
        self.device = device
        members: dict[Hashable, list[int]] = {}
        for index, case in enumerate(cases):
            members.setdefault(key(case), []).append(index)
        self.groups = []
        for indices in members.values():
            made = Group([cases[i] for i in indices], ("itae", "tv"))
            self.groups.append((indices, made, [made.gain_columns(name) for name in names]))

    def __call__(self, candidates: Sequence[Floats], terms: Any) -> list[Pair]:
        count = len(self.cases)
        costs = [(0.0, 0.0)] * (count * len(candidates))
        for indices, made, columns in self.groups:
            rows = np.tile(made.rows, (len(candidates), 1))
            for k, gains in enumerate(candidates):
                own = rows[k * len(indices) : (k + 1) * len(indices)]
                for value, places in zip(gains, columns, strict=True):
                    own[:, places] = value
            scores = made.run(rows, self.threads, self.device)
            for row, score in enumerate(scores.tolist()):
                index = indices[row % len(indices)]
                costs[row // len(indices) * count + index] = self._costs(self.cases[index], *score)
        return costs

    def _costs(
        self, case: Scenario, failure: float, failed_step: float, itae: float, tv: float
    ) -> Pair:
        if failure != state.FINE:
            return self.goal.terms_of_failure(failed_step * case.resolved.physics_step)
        start = sum(map(abs, case.resolved.x0))
        return self.goal.terms_of_sums(case, itae, start, tv)
