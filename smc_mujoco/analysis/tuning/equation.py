"""J of candidates by the fast engine, in place of MuJoCo.

Its J differs from MuJoCo's by rounding, which laws that chatter magnify to about 1e-3. So it may
only find gains; the J on record is MuJoCo's.
"""

from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np

from smc_mujoco.analysis.engine.group import FormGroup, group_key, why_not
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.common.aliases import Floats, Pair
from smc_mujoco.simulation import state
from smc_mujoco.simulation.scenario import Scenario


def key_of(case: Scenario, device: str) -> Hashable:
    """Return the `group_key` of a case if the fast engine can run it on a device, else None."""
    return None if why_not(case, (), device) else group_key(case)


class Equations:
    """The runs of cases of one `group_key` by the plant's equation, all candidates at once."""

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
        self.group = FormGroup(cases, ("itae", "tv"))
        self.columns = list(map(self.group.gain_columns, names))

    def __call__(self, candidates: Sequence[Floats], terms: Any) -> list[Pair]:
        count = len(self.cases)
        rows = np.tile(self.group.rows, (len(candidates), 1))
        for k, gains in enumerate(candidates):
            for value, columns in zip(gains, self.columns, strict=True):
                rows[k * count : (k + 1) * count, columns] = value
        scores_of_rows = self.group.run(rows, self.threads, self.device)
        scores = scores_of_rows.tolist()
        costs = []
        for i, score in enumerate(scores):
            case = self.cases[i % count]
            costs.append(self._costs(case, *score))
        return costs

    def _costs(
        self, case: Scenario, failure: float, failed_step: float, itae: float, tv: float
    ) -> Pair:
        if failure != state.FINE:
            return self.goal.terms_of_failure(failed_step * case.resolved.physics_step)
        start = sum(map(abs, case.resolved.x0))
        return self.goal.terms_of_sums(case, itae, start, tv)
