"""Predictions of a machine whose records cannot be replayed: the figures of many runs beside those
of one recording.

    told = predicted(smc.rig("stepper_furuta"), seeds=4)
    told.ordered                     # sets whose laws stand in the machine's order, by what of the twin is left out

A bursty machine never repeats a record. So its twin is a distribution, over seeds and over the
parameter sets of the rig's ensemble, of figures such as the rms of an angle. Some figures of some
laws were fitted on; all others are predicted.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.trace import Trace

RANGE = 5.0, 95.0  # percentiles that are told of a figure
Figures = dict[str, float]  # figure -> value


@dataclasses.dataclass(frozen=True, kw_only=True)
class Prediction:
    """What is predicted of a machine, and what was fitted on."""

    conditions: Mapping[str, Mapping[str, Any]]  # name -> fields of a Scenario
    start: Callable[[int], tuple[float, ...]]  # seed -> x0 of a run
    figures: Callable[[Trace], Figures]
    units: Mapping[str, str]  # figure -> its unit
    shown: tuple[str, ...]  # the figures that are told of every law
    recorded: Mapping[str, Figures]  # condition -> the machine's figures under the law `fitted_on`
    fitted_on: str  # name of a law
    order: tuple[str, ...]  # laws, as the figure `rank` orders them on the machine, the least first
    rank: str
    fallen: Callable[[Figures], bool]  # whether a run fell
    left_out: Mapping[
        str, Mapping[str, float]
    ]  # what of the twin is left out -> the quantities that say so
    about: str


@dataclasses.dataclass(frozen=True, kw_only=True)
class Told:
    """The figures of many runs: (left out, set, law, condition) -> those of each seed."""

    prediction: Prediction
    values: Mapping[tuple[str, str, str, str], Sequence[Figures]]

    def of(
        self, law: str, condition: str, figure: str, without: str = "", one: str = ""
    ) -> np.ndarray:
        """Return a figure of all runs that stood, of one set or of all."""
        chosen = []
        for (out, member, name, under), runs in self.values.items():
            if (out, name, under) == (without, law, condition) and one in ("", member):
                for figures in runs:
                    if not self.prediction.fallen(figures):
                        chosen.append(figures[figure])
        values = np.array(chosen)
        return values[np.isfinite(values)]  # a spectrum of an arm that rests has no phase

    def falls(self, law: str, condition: str, without: str = "") -> float:
        """Return the share of runs that fell."""
        keys = [key for key in self.values if (key[0], key[2], key[3]) == (without, law, condition)]
        return float(
            np.mean(
                [self.prediction.fallen(figures) for key in keys for figures in self.values[key]]
            )
        )

    def medians(self, condition: str, without: str = "") -> dict[str, dict[str, float]]:
        """Return set -> law -> the median of `rank` over seeds; inf if most runs fell."""
        found: dict[str, dict[str, float]] = {}
        for (out, member, law, under), runs in self.values.items():
            if (out, under) == (without, condition):
                ranks = []
                for one in runs:
                    ranks.append(
                        np.inf if self.prediction.fallen(one) else one[self.prediction.rank]
                    )
                found.setdefault(member, {})[law] = float(np.median(ranks))
        return found

    def ordered(self, condition: str, without: str = "") -> tuple[int, int]:
        """Return in how many sets the laws stand in the machine's order, and of how many."""
        sets = self.medians(condition, without).values()
        pairs = list(zip(self.prediction.order, self.prediction.order[1:], strict=False))
        return sum(all(one[a] < one[b] for a, b in pairs) for one in sets), len(sets)

    def correlation(self, condition: str, without: str = "") -> float:
        """Return the rank correlation (Kendall's tau) of the laws over machine and twin, the mean
        over sets.
        """
        order = self.prediction.order
        taus = []
        for one in self.medians(condition, without).values():
            signs = []
            for i, a in enumerate(order):
                for b in order[i + 1 :]:
                    if one[a] != one[b]:
                        signs.append(np.sign(one[b] - one[a]))
            taus.append(sum(signs) / (len(order) * (len(order) - 1) / 2))
        return float(np.mean(taus))


def predicted(
    rig: Any,
    seeds: int = 4,
    sets: int = 0,
    ablate: bool = True,
    report: Callable[[int], None] = lambda count: None,
) -> Told:
    """Run the laws that a Rig's machine ran on every parameter set from every seed, in all
    conditions.

    Without parts of the twin, only in the first condition, and from a quarter of the seeds.

    `sets`: only so many of the ensemble; 0: all. `report` is called with the number of runs after
    each batch.
    """
    if (prediction := rig.prediction) is None:
        raise ScenarioError(
            f"{rig.name} has no figures to predict: give a record, which its twin repeats"
        )
    members = dict(list(rig.members().items())[: sets or None])
    laws = {law.name: law for law in rig.laws if law.name in prediction.order}
    first = next(iter(prediction.conditions))
    values = {}
    for without in ("", *(prediction.left_out if ablate else ())):
        changes = prediction.left_out.get(without, {})
        for member, one in members.items():
            changed = one.with_values(changes, "left out")
            keys = [
                (law, under)
                for law in laws
                for under in (prediction.conditions if not without else (first,))
            ]
            count = max(1, seeds // 4) if without else seeds
            scenarios = [
                _scenario(changed, laws[law], under, seed)
                for law, under in keys
                for seed in range(count)
            ]
            found = [prediction.figures(trace) for trace in run(scenarios)]
            for i, (law, under) in enumerate(keys):
                values[without, member, law, under] = found[i * count : (i + 1) * count]
            report(len(scenarios))
    return Told(prediction=prediction, values=values)


def _scenario(rig: Any, law: Any, condition: str, seed: int) -> Any:
    """Return the run of a law from a seed's start in a condition."""
    about = rig.prediction
    return rig.scenario(law, x0=about.start(seed), seed=seed, **about.conditions[condition])


def percentiles(values: np.ndarray) -> list[float]:
    """Return the median of a figure, and the ends of its RANGE."""
    return [float(np.percentile(values, p)) for p in (50.0, *RANGE)]
