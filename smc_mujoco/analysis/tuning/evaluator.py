"""J of candidates, on runs that keep their memory from one candidate to the next.

    evaluate = Evaluator(goal, cases, ("lam", "k1"))      # once a search
    evaluate([(6.0, 2.5), (6.0, 3.0)])                    # an Evaluation for each

A search evaluates hundreds of sets of gains of one law in the same few runs. So an evaluator
prepares them once, puts the gains of each candidate into the buffers that compiled code reads, and
takes J from the logs. It has three engines: MuJoCo, in a Batch that lasts; the fast one of
`equation`, which may only find gains, and leaves to MuJoCo the cases that it cannot run; and `run`,
for laws that do not compile. J is that of
`Objective.terms_of_run`.
"""

import dataclasses
import warnings
from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.analysis.engine.scores import over_log
from smc_mujoco.analysis.tuning import equation
from smc_mujoco.analysis.tuning.objective import Evaluation, Objective
from smc_mujoco.common.aliases import Array, Floats, Pair
from smc_mujoco.control.component import Component
from smc_mujoco.metrics.catalogue import ITAE, TV
from smc_mujoco.simulation import callback, state
from smc_mujoco.simulation.model import structure
from smc_mujoco.simulation.prepare import Packed, Prepared, prepare
from smc_mujoco.simulation.run import (
    BATCH_BYTES,
    PlainLoopWarning,
    ScenarioBatch,
    cores,
    memory_for,
    run_unjudged,
)
from smc_mujoco.simulation.scenario import Scenario

LARGE_MODELS = 16 * 2**20  # bytes of a search's models, as with meshes; chosen
MUJOCO, EQUATION, PYTHON = "MuJoCo", "the equation", "Python"  # engines
# a case, when it failed, s, (K + 1, n) LOG -> tracking and variation
Terms = Callable[[Scenario, float | None, np.ndarray], Pair]


class Evaluator:
    """J of candidates in the runs of one search.

    Args:
      goal: the objective.
      cases: the runs of a candidate, as `Objective.scenarios` returns them, all with the same law.
      names: the gains that a candidate consists of.
      threads: as in `run`.
      by_equation: whether the plant's equation replaces MuJoCo where it can.
      off: disable flags of what does not act in MuJoCo, such as contacts.
      slots: how many candidates MuJoCo runs at once.
      device: of the runs by equation, "cpu" or "cuda".
    """

    def __init__(
        self,
        goal: Objective,
        cases: Sequence[Scenario],
        names: Sequence[str],
        threads: int | None = None,
        by_equation: bool = False,
        off: int = 0,
        slots: int = 1,
        device: str = "cpu",
    ):
        self.goal = goal
        self.cases = list(cases)
        self.names = tuple(names)
        self.threads = cores(threads)
        self._options = threads, by_equation, off, slots, device
        self._off, self._slots, self._device = off, slots, device
        self._prepared: list[Prepared] = []  # the cases, unless their models are large
        self._large = False
        self._bytes = 0  # of the cases
        sizes: dict[Hashable, int] = {}  # key of a model, and its bytes
        keys = []
        self.engine = MUJOCO
        for case in self.cases:
            item = prepare(case)
            if item.why_not:
                self.engine = PYTHON
            keys.append((structure(case), case.control_period, case.samples))
            sizes[keys[-1][0]] = mujoco.mj_sizeModel(item.mechanism.model)
            self._large = sum(sizes.values()) > LARGE_MODELS
            self._prepared = [] if self._large else [*self._prepared, item]
            self._bytes += item.bytes
            del item  # with a large model, before the next one is compiled
        self._members: list[tuple[Hashable, list[int]]] = []  # key of the equation, and cases
        self._runners: list[Any] = []  # of each of these
        if self.engine == PYTHON:
            return
        members: dict[tuple[Hashable, Hashable], list[int]] = {}
        for i, key in enumerate(keys):
            logless = by_equation and not goal.limits  # which need a log
            fast = equation.key_of(self.cases[i], device) if logless else None
            own_key = None if fast else key
            members.setdefault((fast, own_key), []).append(i)
        for (fast, _), indices in members.items():
            if fast:
                self.engine = EQUATION
            self._members.append((fast, indices))

    def _runner(self, fast: Hashable, indices: Sequence[int]) -> Any:
        """Return what runs these cases, as many candidates at once as fit the memory of a batch."""
        slots = max(1, min(self._slots, BATCH_BYTES // self._bytes))
        cases = [self.cases[i] for i in indices]
        if self._large:
            batch = list(map(prepare, cases))
        else:
            batch = [self._prepared[i] for i in indices]
        with memory_for(batch), callback.installed():
            if fast:
                return equation.Equations(self.goal, cases, self.names, self.threads, self._device)
            return _RepeatedBatch(batch, self.names, self.threads, self._off, slots)

    def _each_runner(self) -> Iterator[tuple[Sequence[int], Any]]:
        """Yield the indices of cases and what runs them, which is kept for the next candidates; of
        large models, which a batch has twice, one after the other is made and freed.
        """
        if self._large:
            for member in self._members:
                yield member[1], self._runner(*member)
            return
        self._prepared = self._prepared or list(map(prepare, self.cases))
        if not self._runners:
            self._runners = [self._runner(*member) for member in self._members]
        for (_, indices), runner in zip(self._members, self._runners, strict=True):
            yield indices, runner

    def release(self) -> None:
        """Free the memory of the runs and of their models, which the next call makes again."""
        self._runners = []
        self._prepared = []

    def __call__(self, candidates: Sequence[Floats]) -> list[Evaluation]:
        """Return the evaluations of sets of gains."""
        size = len(self.cases)
        terms = [(0.0, 0.0)] * (size * len(candidates))
        for indices, engine in self._each_runner():
            for k, costs in enumerate(engine(candidates, self._terms)):
                row, column = divmod(k, len(indices))
                terms[row * size + indices[column]] = costs
            del engine  # before the next one is made
        if self.engine == PYTHON:
            terms = self._terms_of_traces(candidates)
        evaluations = []
        for k, gains in enumerate(candidates):
            terms_of_set = terms[k * size : (k + 1) * size]
            of_tracking, of_variation = zip(*terms_of_set, strict=True)
            tracking = float(sum(of_tracking))
            variation = float(sum(of_variation))
            cost = tracking + self.goal.weight * variation + self.excess(gains)
            evaluations.append(Evaluation(gains, cost, tracking, variation))
        return evaluations

    def of_first(self) -> "Evaluator":
        """Return the evaluator of the first case alone."""
        return Evaluator(self.goal, self.cases[:1], self.names, *self._options)

    def law(self, gains: Floats) -> Component:
        """Return the law with these gains."""
        return with_gains(self.cases[0].law, self.names, gains)

    def excess(self, gains: Floats) -> float:
        """Return what a candidate's predicted chattering costs, s^2."""
        if self.goal.chattering is None:
            return 0.0
        case = dataclasses.replace(self.cases[0], law=self.law(gains))
        return self.goal.excess(case)

    def _terms_of_traces(self, candidates: Sequence[Floats]) -> list[Pair]:
        laws = []
        for gains in candidates:
            laws.append(self.law(gains))
        with warnings.catch_warnings():
            # the runs of the law's own gains have warned
            warnings.simplefilter("ignore", PlainLoopWarning)
            cases = []
            for law in laws:
                for case in self.cases:
                    cases.append(dataclasses.replace(case, law=law))
            traces = run_unjudged(cases, self.threads)
        return list(map(self.goal.terms_of_run, traces))

    def _terms(self, case: Scenario, failed_at: float | None, log: np.ndarray) -> Pair:
        """Return tracking and variation of the run of a case, see `Terms`."""
        if failed_at is not None:
            return self.goal.terms_of_failure(failed_at)
        apart = log["x"] - log["r"]
        finite = np.isfinite(apart).all(axis=1)
        if not finite.all():
            first_failed = int(np.argmin(finite)) * case.control_period
            return self.goal.terms_of_failure(first_failed)
        if case.plant.pose:
            return self.goal.terms_of_pose(case, log["x"], log["r"], log["u"])
        distances = np.abs(log["x"][0]).tolist()
        start = sum(distances)
        itae, tv = over_log((ITAE, TV), log, case.plant.driven, case.control_period)
        tracking, variation = self.goal.terms_of_sums(case, itae, start, tv)
        return tracking + self.goal.cost_of_limits(case, log["x"], log["u"]), variation


def with_gains(law: Component, names: Sequence[str], values: Sequence[float]) -> Component:
    """Return the law with other gains, without a warning for violated conditions of its theorem."""
    changed = dict(zip(names, values, strict=True))
    gains = dict(law.gains) | changed
    return dataclasses.replace(law, gains=gains)


def _putter(
    prepared: Prepared, names: Sequence[str], record: Any, packed: Packed
) -> Callable[[Array], None]:
    """Return the function that puts a candidate's gains among the numbers of a run."""
    law = prepared.scenario.law
    start = int(record["law"]["parameters"])
    width = prepared.scenario.plant.driven if law.joint else 1
    values = state.array_at(packed.numbers, start, (len(law.gains), width))
    rows = []
    for name in names:
        rows.append(list(law.gains).index(name))

    def put(gains: Array) -> None:
        values[rows] = np.reshape(gains, (-1, 1))

    return put


class _RepeatedBatch(ScenarioBatch):
    """Cases of one key that run again and again in MuJoCo, with gains of `slots` candidates at
    once.
    """

    def __init__(
        self,
        cases: Sequence[Prepared],
        names: Sequence[str],
        threads: int,
        off: int,
        slots: int,
    ):
        prepared = [*cases] * slots
        super().__init__(prepared, threads, off)
        self.slots = slots
        self.cases = [item.scenario for item in cases]
        self.first_records = self.records.copy()
        self.first_numbers = [packed.numbers.copy() for packed in self.packed]
        self.start = {name: array.copy() for name, array in self.started.items()}
        runs = zip(prepared, self.records, self.packed, strict=True)
        self.put = [_putter(item, names, record, packed) for item, record, packed in runs]

    def __call__(self, candidates: Sequence[Floats], terms: Terms) -> list[Pair]:
        costs: list[Pair] = []
        count = len(self.cases)
        for first in range(0, len(candidates), self.slots):
            side_by_side = candidates[first : first + self.slots]
            self.again(np.repeat(side_by_side, count, axis=0))
            for k in range(len(side_by_side) * count):
                case = self.cases[k % count]
                costs.append(terms(case, self.failed_at(k), self.logs[k]))
        return costs

    def again(self, gains: Array) -> None:
        """Run the first simulations, as many as gains are given, from their start."""
        self.records[:] = self.first_records
        self.records["failure"][len(gains) :] = state.INTERRUPTED  # they are not stepped
        for packed, first in zip(self.packed, self.first_numbers, strict=True):
            packed.numbers[:] = first
        for put, values in zip(self.put, gains, strict=False):
            put(values)
        self.errors.clear()
        self.calls = 0
        with callback.installed(), memory_for(self.prepared):
            self.reset()
            for name, values in self.start.items():
                self.batch.bind(name)[:] = values
            if self.fields:
                self.set_parameters(0, range(len(self.scenarios)))
            self.simulate(lambda steps: None)

    def failed_at(self, i: int) -> float | None:
        """Return the time at which a run failed, s, or None."""
        step = int(self.records["failed_step"][i])
        if self.records["failure"][i] == state.FINE:
            step, failure = self.spoiled(i)
            if failure is None:
                return None
        return step * self.scenarios[i].physics_step
