"""Scores of many scenarios without their traces: by the fast engine or, on a CUDA device, by MuJoCo
Warp where they can, else by MuJoCo.

Where the engine's numbers are shown, MuJoCo repeats some of them, and `ScoredRuns.checked` says how
far apart they were.
"""

import math
import random
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from smc_mujoco.analysis.engine import CHECKED
from smc_mujoco.common.text import joined
from smc_mujoco.metrics.conventions import groups
from smc_mujoco.simulation import prepare
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace, warn_of_broken

if TYPE_CHECKING:
    from smc_mujoco.analysis.engine.form import Form
    from smc_mujoco.analysis.engine.group import FormGroup

MIN_WORK = 20_000_000  # physics steps times channels, about a minute of MuJoCo's: chosen
Scored = tuple[list[float], float | None]  # metrics, and the time of a failure, s
Report = Callable[[int], None]  # called with the physics steps since its last call


def worth_compiling(work: int) -> bool:
    """Return whether runs of so many physics steps times channels take MuJoCo longer than compiling
    their law takes.
    """
    return work >= MIN_WORK


class ScoredRuns:
    """Runs that are scored.

    Args:
      formulas: name of a metric -> its value for a trace of MuJoCo's.
      device: of the fast engine.
      threads: as in `run`.
      worth_compiling: whether the runs are worth it. If not, on the processor, all are MuJoCo's.
      by_group: whether a formula is the worst of the groups of channels. With several groups all
        runs are MuJoCo's.
      worlds: whether there are so many runs at once that MuJoCo Warp may be worth it.
    """

    def __init__(
        self,
        formulas: Mapping[str, Callable[[Trace], float]],
        device: str = "cpu",
        threads: int | None = None,
        worth_compiling: bool = True,
        by_group: bool = False,
        worlds: bool = False,
    ):
        self.formulas = formulas
        self.device = device
        self.worth_compiling = worth_compiling or device != "cpu"
        self.by_group = by_group
        self.worlds = worlds
        self.threads = threads
        self.broken: dict[str, str] = {}  # law -> how it failed first, in a sentence
        self.forms: dict[Hashable, list[Form]] = {}
        self.compiles: dict[Hashable, str] = {}  # why a form does not compile
        self.random = random.Random(0)
        self.refused: Counter[str] = Counter()  # why a card cannot run them -> runs of MuJoCo's
        self.count = 0
        self.drawn: list[tuple[Scenario, Scored]] = []

    def scored(
        self, cases: Sequence[Scenario], report: Report = lambda steps: None
    ) -> list[Scored]:
        """Return the scores of scenarios, in their order."""
        results: list[Scored] = [([], None)] * len(cases)
        members: dict[Any, list[int]] = {}
        for i, case in enumerate(cases):
            kind, why = self._kind(case)
            if why and self.device != "cpu":
                self.refused[why] += 1
            members.setdefault(kind and (kind, kind.key_of(case)), []).append(i)
        for key, indices in self._large_enough(members).items():
            batch = [cases[i] for i in indices]
            if key is None:
                scored = self.by_mujoco(batch, report)
            else:
                forms_of_kind = self.forms.get(key, [])
                group = key[0](batch, tuple(self.formulas), forms_of_kind)
                self.forms[key] = [group.form]
                scored = group.scored(self.device, self.threads)
                report(sum(case.work for case in batch))
                self._take(batch, scored)
            for i, scores in zip(indices, scored, strict=True):
                results[i] = scores
        return results

    def _large_enough(self, members: dict[Any, list[int]]) -> dict[Any, list[int]]:
        """Return groups of runs, in which those that are too few for their kind are MuJoCo's."""
        large: dict[Any, list[int]] = {}
        for key, indices in members.items():
            if key is not None and len(indices) < key[0].least:
                self.refused[f"they are fewer than {key[0].least} of one model"] += len(indices)
                large.setdefault(None, []).extend(indices)
            else:
                large.setdefault(key, []).extend(indices)
        return large

    def covers(self, case: Scenario) -> bool:
        """Return whether the fast engine can run a scenario."""
        return self._kind(case)[0] is not None

    def _kind(self, case: Scenario) -> "tuple[type[FormGroup] | None, str]":
        """Return the kind of group that runs a scenario; None and why if MuJoCo has to."""
        from smc_mujoco.analysis.engine.choice import chosen

        if not self.worth_compiling:
            return None, "they are few"
        if self.by_group and len(groups(case)) > 1:
            return None, "its channels are of several groups"
        kind, why = chosen(case, tuple(self.formulas), self.device, self.worlds)
        if kind is None:
            return None, why
        of_disturbances = map(type, case.resolved.disturbance)
        functions = kind.key_of(case), *of_disturbances
        if functions not in self.compiles:
            self.compiles[functions] = prepare.why_not_compiled(case)
        if why := self.compiles[functions]:
            return None, why
        return kind, ""

    def by_mujoco(
        self, cases: Sequence[Scenario], report: Report = lambda steps: None
    ) -> list[Scored]:
        """Return the same, by MuJoCo alone."""
        results: list[Scored] = [([], None)] * len(cases)
        for i, trace in stream(cases, self.threads, report):
            values = [math.nan] * len(self.formulas)
            if trace.diverged_at is None:
                values = [formula(trace) for formula in self.formulas.values()]
            elif trace.broken:
                self.broken.setdefault(trace.scenario.law.name, trace.broken)
            results[i] = values, trace.diverged_at
        return results

    def _take(self, cases: Sequence[Scenario], scored: Iterable[Scored]) -> None:
        """Draw runs evenly from all, see J. S. Vitter, ACM Trans. Math. Softw. 11:37, 1985,
        algorithm R.
        """
        for pair in zip(cases, scored, strict=True):
            self.count += 1
            if len(self.drawn) < CHECKED:
                self.drawn.append(pair)
            elif (place := self.random.randrange(self.count)) < CHECKED:
                self.drawn[place] = pair

    def checked(self) -> str:
        """Return in words how far the scores are from MuJoCo's, which repeats some runs, and why a
        card could not run others; "" if MuJoCo made all.

        Warn of laws that fail in these, or in MuJoCo's own.
        """
        by_mujoco = self.by_mujoco([case for case, _ in self.drawn])
        warn_of_broken(self.broken)
        refused = []
        for why, n in self.refused.items():
            refused.append(f"MuJoCo made {n} runs: {why}")
        if not self.drawn:
            return "; ".join(refused)
        apart = dict.fromkeys(self.formulas, 0.0)
        failed = 0  # in one of the two
        for (_, (ours, time)), (theirs, other_time) in zip(self.drawn, by_mujoco, strict=True):
            if (time is None) != (other_time is None):
                failed += 1
            elif time is None:
                for name, value, their_value in zip(apart, ours, theirs, strict=True):
                    if value != their_value and not (math.isnan(value) and math.isnan(their_value)):
                        apart[name] = max(apart[name], abs(value - their_value))
        parts = []
        for name, value in apart.items():
            parts.append(f"{value:.1g} in {name}")
        apart_by = (
            f"MuJoCo repeated {len(self.drawn)} runs of another engine: {failed} failed in one of "
            f"the two only, and scores of the others differ by at most {joined(parts)}"
        )
        return "; ".join([apart_by, *refused])
