"""Which law suits a plant: a comparison by the rules of `compare`, and an answer of four lines.

A need is a metric to compare, such as "fast", or a property that each law must have, such as
"continuous". A law that settles in less than half as many runs of a condition as the law that
settles most often is not compared, because a law that does nothing would be the calmest. The others
stand by the number of their runs that fail, then by their mean rank over all needs and conditions,
see `Boards.order`. This order is not tested; the last line of the answer says how sure it is.

Within minutes the laws race instead, see `race` and `recommend`.
"""

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np

from smc_mujoco.analysis.engine import Device
from smc_mujoco.analysis.paired_runs import SETTLES, values
from smc_mujoco.analysis.ranking import RELEVANT, Relevant
from smc_mujoco.common.constraints import Boolean, FilePath, Positive, Whole, constrained
from smc_mujoco.common.errors import ScenarioError, find
from smc_mujoco.control import gain_sets
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.properties import PROPERTIES, suitable
from smc_mujoco.mechanisms.custom.scales import falls
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.catalogue import CATALOGUE, metric_of, metrics
from smc_mujoco.simulation.conditions import Condition
from smc_mujoco.simulation.grid import Starts, listed, listed_laws
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.workers import Workers
from smc_mujoco.studies.answer_time import FILMED, FILMED_SHARE, AnswerTime
from smc_mujoco.studies.compare import DrawSeed
from smc_mujoco.studies.fair_gains import Laws, Trial, law_or_template
from smc_mujoco.studies.leaderboard import leaderboard
from smc_mujoco.studies.recommend import recommend
from smc_mujoco.studies.recommendation import Recommendation
from smc_mujoco.studies.table import Table

NEEDS: Mapping[str, str] = {metric.need: metric.name for metric in metrics() if metric.need}
DEFAULT_NEEDS = ("fast", "accurate", "calm")
DEFAULT_CONDITIONS = ("nominal", "noise", "sine")
MIN_SETTLED = 0.5  # of the share of runs that settle under the best law; chosen
SEEDS, RACE_SEEDS = 24, 14  # runs of a law in each condition, of a whole comparison and of a race
QUICK_MINUTES = 10.0


@constrained
def which(
    plant: str | Plant,
    conditions: str | Condition | Sequence[str | Condition] | None = None,
    needs: str | Sequence[str] = DEFAULT_NEEDS,
    laws: str | Component | Template | Sequence[str | Component | Template] | None = None,
    seeds: Annotated[int, Whole(low=1, high=10_000)] | None = None,
    duration: Positive | None = None,
    starts: Starts | None = None,
    out: Annotated[str | Path, FilePath()] = "which",
    quick: Boolean = False,
    threads: int | None = None,
    progress: bool = False,
    defaults: Boolean = False,
    relevant: Relevant = RELEVANT,
    seed: DrawSeed = 0,
    device: Device = "cpu",
    executor: Workers | None = None,
    falling: Boolean = False,
    minutes: Positive | None = None,
) -> Recommendation:
    """Recommend a law for a plant: compare the laws that suit, with gains for the plant, and say
    how certain the answer is.

        recommended = smc.which("duffing", "friction", laws=["pid", "adrc"], minutes=1)
        print(recommended)
        print(recommended.law)

    Args:
      plant: a name, a Plant, or your own MJCF and its joints, as "arm.xml:shoulder,elbow".
      conditions: names, texts or Conditions, see `condition`. Each is tried alone; "noise +
        coulomb" is one that has both. Default: nominal, noise and sine.
      needs: the scores to compare: "fast", "accurate" (at the end), "on-track" (on the way),
        "calm", "gentle", "frugal", "no-overshoot"; by default fast, accurate and calm. With
        minutes they are only shown: the laws are compared by J. And what every law must have:
        "continuous" and the other names of `smc_mujoco.control.properties.PROPERTIES`.
      laws: the laws to compare, by name or with your own gains. Default: all that suit; of
        these the usual ones on your own model within minutes. The answer says how many were not
        tried.
      seeds: runs of a law in each condition, each with another start and other noise. Default: 24,
        or 14 with minutes.
      duration: of a run, s. Default: 5, or 3 with minutes.
      out: folder for gains and runs, which another call reads.
      quick: the same as minutes=10.
      defaults: whether a law may win over rivals whose gains are their defaults.
      falling: whether to go on where the base of your model falls while its joints are held, so
        that no law of a joint can be judged.
      minutes: how long the whole may take. Then laws race: their gains are searched under the
        conditions asked for and noise, a quarter as long, in turn over the laws until one has the
        lowest J, at most 12 sets a law. The race leaves time for the tables, the margins and a
        film, which are shorter where there is little; margins go before a film. Laws for whose
        first set there is no time are in `race.unsearched`. The clock may change which laws, sets,
        runs and margins there are, and with them the answer; with the same ones it is the same to
        the last bit. After a stop, the same call goes on with the sets that the folder has. The
        `RaceRecommendation` that comes back has the `margins` of the first law and its `worst_run`,
        too. Default: a whole comparison, which no clock stops.
      starts, relevant, threads, progress, seed, device, executor: as in `compare`.

    Returns:
      A `Recommendation`, which prints as tables and lines: `law` has the gains to use, `second` is
      the next law, `table` has a row a run.

    Raises:
      ScenarioError: an unknown name, no law that suits, a need without a number on this plant, or
        a base that falls.
    """
    began = time.monotonic()
    if quick and minutes is None:
        minutes = QUICK_MINUTES
    machine = as_plant(plant)
    if not falling and (why := falls(machine)):
        raise ScenarioError(f"{why}; falling=True (--falling) goes on all the same")
    metrics_asked, properties = _metrics_and_properties(needs)
    chosen = _suited(machine, properties, laws)
    if minutes and machine.is_user_model and laws is None:
        chosen = [law for law in chosen if law.name in gain_sets.COMPARED] or chosen
    trial = Trial.of(
        [machine],
        conditions,
        DEFAULT_CONDITIONS,
        duration or (3.0 if minutes else 5.0),
        out,
        starts=starts,
        threads=threads,
        progress=progress,
        defaults=defaults,
        seed=seed,
        quick=minutes is not None,
        device=device,
        executor=executor,
    )
    trial.check({machine.name: chosen})
    compared = _with_values(trial.case(machine, "none", trial.conditions[0]), metrics_asked)
    if minutes:
        spare = 60.0 * min(FILMED, FILMED_SHARE * minutes)
        clock = AnswerTime(began + 60.0 * minutes - spare, spare)
        names = {law.name for law in chosen}
        untried = [law.name for law in _of_package(machine, properties) if law.name not in names]
        return recommend(
            trial, machine, chosen, compared, seeds or RACE_SEEDS, clock, relevant, untried
        )
    count = seeds or SEEDS
    candidates = trial.candidates({machine.name: chosen}, count)
    table = trial.run(candidates, count)
    settles, fit = _fit(table)
    boards = leaderboard(table.select(law=fit), compared, defaults=defaults, relevant=relevant)
    if not boards:
        raise ScenarioError(f"no need has a number in any run on {machine.name}: ask for others")
    found = {law.name: law for law, *_ in candidates[machine.name]}
    ordered = tuple(found[name] for name in boards.order)
    return Recommendation(table=table, leaderboard=boards, laws=ordered, settles=settles)


def _metrics_and_properties(needs: str | Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the metrics and the properties among the needs; without metrics, DEFAULT_NEEDS."""
    compared, properties = [], []
    listed_needs = needs.split(",") if isinstance(needs, str) else listed("needs", needs)
    for need in listed_needs:
        name = need.strip() if isinstance(need, str) else need
        find("need", name, {**NEEDS, **PROPERTIES})
        if name in NEEDS:
            compared.append(NEEDS[name])
        else:
            properties.append(name)
    return compared or [NEEDS[name] for name in DEFAULT_NEEDS], properties


def _with_values(run: Scenario, asked: Sequence[str]) -> list[str]:
    """Return those of the default metrics that have one value in a run. Raise ScenarioError for
    others that have none, as where motors have different units.
    """
    if list(asked) != [NEEDS[name] for name in DEFAULT_NEEDS]:
        for metric in asked:
            metric_of(run, metric)
    return [metric for metric in asked if not CATALOGUE[metric].refusal(run)]


def _suited(plant: Plant, properties: Sequence[str], laws: object) -> Laws:
    """Return the laws to compare. Those without given gains are templates."""
    if laws is None:
        chosen = _of_package(plant, properties)
    else:
        chosen = []
        for law in map(law_or_template, listed_laws(laws)):
            if isinstance(law, Template):
                template = law
            else:
                template = law.template
            if not template or all(PROPERTIES[name].holds(template) for name in properties):
                chosen.append(law)
    if not chosen:
        raise ScenarioError(
            f"no law for {plant.name} has {', '.join(properties) or 'gains'}: ask for less, or "
            "give your own, as laws=[my_law]"
        )
    return chosen


def _of_package(plant: Plant, properties: Sequence[str]) -> list[Component | Template]:
    """Return the package's laws that suit a plant, each once."""
    left_out = {"none", *gain_sets.ALIASES}  # whose gains are those of laws that are there
    return [law for law in suitable(properties, plant) if law.name not in left_out]


def _fit(table: Table) -> tuple[dict[str, float], list[str]]:
    """Return the least share of a law's runs that settle in a condition, and the laws that settle
    often enough to be compared; all if none does.
    """
    laws = table.column("law")
    conditions = table.column("condition")
    settled = 1.0 - values(table, SETTLES)
    names = sorted(set(laws.tolist()))
    tested = sorted(set(conditions.tolist()))
    shares = np.empty((len(names), len(tested)))
    for i, law in enumerate(names):
        for k, condition in enumerate(tested):
            shares[i, k] = settled[(laws == law) & (conditions == condition)].mean()
    enough = np.all(shares >= MIN_SETTLED * shares.max(axis=0), axis=1)
    least = dict(zip(names, shares.min(axis=1).tolist(), strict=True))
    return least, np.array(names)[enough].tolist() or names
