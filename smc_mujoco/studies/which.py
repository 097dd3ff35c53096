"""Which law suits a plant: a race of laws by J, until one has the lowest or the time is over.

A need is a metric to show, such as "fast"; a limit that searches keep, such as "overshoot<10"; or a
property that each law must have, such as "continuous". See `race` and `recommend`.
"""

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

from smc_mujoco.analysis.engine import Device
from smc_mujoco.analysis.ranking import Relevant
from smc_mujoco.analysis.relevant import RELEVANT
from smc_mujoco.analysis.tuning.effort import Search
from smc_mujoco.analysis.tuning.run_limits import RunLimit, limits_in
from smc_mujoco.common.constraints import Boolean, FilePath, Positive, Progress, Whole, constrained
from smc_mujoco.common.errors import ScenarioError, find
from smc_mujoco.control import gain_sets
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.properties import PROPERTIES, suitable
from smc_mujoco.mechanisms.custom.scales import falls
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.catalogue import CATALOGUE, metric_of, metrics
from smc_mujoco.simulation.conditions import Condition
from smc_mujoco.simulation.grid import Draws, Starts, listed, listed_laws
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.workers import Workers
from smc_mujoco.studies.answer_time import AnswerTime
from smc_mujoco.studies.compare import DrawSeed
from smc_mujoco.studies.fair_gains import GainChoice, Laws, Trial, law_or_template
from smc_mujoco.studies.race import WITHOUT
from smc_mujoco.studies.recommend import Question, recommend
from smc_mujoco.studies.recommendation import Recommendation

NEEDS: Mapping[str, str] = {metric.need: metric.name for metric in metrics() if metric.need}
DEFAULT_NEEDS = ("fast", "accurate", "calm")  # which are shown; none is a limit
DEFAULT_CONDITIONS = ("nominal", "noise", "sine")
DURATION = 3.0  # of a run, s
SEEDS = 14  # runs of a law in each condition
QUICK_MINUTES = 10.0
# Those that a person would try, first: with little time, they are searched
NATURAL = ("pid", "super_twisting", "adrc", *gain_sets.COMPARED)


@constrained
def which(
    plant: str | Plant,
    conditions: str | Condition | Sequence[str | Condition] | None = None,
    needs: str | Sequence[str] | None = None,
    laws: str | Component | Template | Sequence[str | Component | Template] | None = None,
    seeds: Annotated[int, Whole(low=1, high=10_000)] | None = None,
    duration: Positive | None = None,
    starts: Starts | None = None,
    out: Annotated[str | Path, FilePath()] = "which",
    quick: Boolean = False,
    threads: int | None = None,
    progress: Progress = False,
    defaults: Boolean = False,
    relevant: Relevant = RELEVANT,
    seed: DrawSeed = 0,
    device: Device = "cpu",
    executor: Workers | None = None,
    falling: Boolean = False,
    minutes: Positive | None = None,
) -> Recommendation:
    """Recommend a law for a plant: laws race by J until one has the lowest, and the answer says how
    certain that is.

        recommended = smc.which("duffing", "friction", laws=["pid", "adrc"], minutes=1)
        print(recommended)
        print(recommended.law)

    The gains of the laws are searched under the conditions asked for and noise, a quarter as long
    as by `tune`, in turn over the laws until one has the lowest J, at most 12 sets a law. On a
    plant for which the package ships gains, laws have these. u = 0 races, too, and is the answer
    where it is the best.

    Args:
      plant: a name, a Plant, or your own MJCF and its joints, as "arm.xml:shoulder,elbow".
      conditions: names, texts or Conditions, see `condition`. Each is tried alone; "noise +
        coulomb" is one that has both. Default: nominal, noise and sine.
      needs: limits that the gains keep: "no-overshoot", "overshoot<10" (in % of the way to the
        goal) and "calm" (u rests where nothing moves). What every law must have: "continuous" and
        the other names of `smc_mujoco.control.properties.PROPERTIES`. And scores that tables show:
        "fast", "accurate" (at the end), "on-track" (on the way), "gentle", "frugal"; by default
        fast, accurate and calm, without a limit.
      laws: the laws to compare, by name or with your own gains. Default: all that suit; of
        these the usual ones on your own model. The answer says how many were not tried.
      seeds: runs of a law in each condition, each with another start and other noise. Default: 14.
      duration: of a run, s. Default: 3.
      out: folder for gains, runs and the report, which another call reads.
      quick: the same as minutes=10.
      defaults: whether a law that cannot be tuned may race with its default gains.
      falling: whether to go on where the base of your model falls while its joints are held, so
        that no law of a joint can be judged.
      minutes: how long the whole may take. Every law gets a first set of gains, from a shorter
        search where that is short; laws whose search the clock ends are in `race.unsearched`.
        Tables, margins and a film then take what is left, the film last. The clock may change which
        laws, sets, runs and margins there are, and with them the answer; with the same ones it is
        the same to the last bit. After a stop, the same call goes on with the sets that the folder
        has. Default: no limit.
      starts, relevant, threads, progress, seed, device, executor: as in `compare`.

    Returns:
      A `Recommendation`, which prints as an answer of one screen: `law` has the gains to use,
      `second` is the next law, `margins` what the first withstands, `worst_run` its worst run,
      `table` has a row a run, and `full` all tables. The folder has `report.html`, and
      `recommended.json` where gains were searched.

    Raises:
      ScenarioError: an unknown name, no law that suits, a need without a number on this plant, or
        a base that falls.
    """
    began = time.monotonic()
    if quick and minutes is None:
        minutes = QUICK_MINUTES
    machine = as_plant(plant)
    if not falling and (why := falls(machine)):
        raise ScenarioError(
            f"{why}; falling=True (--falling) goes on, with a duration that ends first"
        )
    asked_metrics, properties, limits = _read_needs(needs)
    chosen = _suited(machine, properties, laws)
    if machine.is_user_model and laws is None:
        chosen = [law for law in chosen if law.name in gain_sets.COMPARED] or chosen
    trial = Trial.of(
        [machine],
        conditions,
        DEFAULT_CONDITIONS,
        duration or DURATION,
        out,
        draws=Draws(seeds or SEEDS, starts, seed),
        search=Search(quick=True, device=device, executor=executor),
        gains=GainChoice(defaults=defaults),
        threads=threads,
        progress=progress,
    )
    trial.check({machine.name: chosen})
    shown_metrics = _with_values(
        trial.case(machine, WITHOUT, trial.conditions[0]), asked_metrics, needs is None
    )
    names = {law.name for law in chosen}
    untried = [law.name for law in _of_package(machine, properties) if law.name not in names]
    question = Question(chosen, shown_metrics, relevant, untried, conditions is not None)
    goal = trial.asked_goal(machine, limits)
    recommendation = recommend(trial, machine, question, goal, AnswerTime.within(began, minutes))
    recommendation.save()
    return recommendation


def _read_needs(
    needs: str | Sequence[str] | None,
) -> tuple[list[str], list[str], tuple[RunLimit, ...]]:
    """Return the metrics, the properties and the limits that needs are; without metrics,
    DEFAULT_NEEDS.
    """
    if needs is None:
        needs = DEFAULT_NEEDS
        limits = ()
    else:
        needs = needs.split(",") if isinstance(needs, str) else listed("needs", needs)
        limits = limits_in(needs)
    compared, properties = [], []
    for need in needs:
        name = need.strip() if isinstance(need, str) else need
        if limits and limits_in([name]):
            name = "calm" if name == "calm" else "no-overshoot"
        find("need", name, {**NEEDS, **PROPERTIES})
        if name in NEEDS:
            compared.append(NEEDS[name])
        else:
            properties.append(name)
    return compared or [NEEDS[name] for name in DEFAULT_NEEDS], properties, limits


def _with_values(run: Scenario, compared: Sequence[str], by_default: bool) -> list[str]:
    """Return those of the metrics that have one value in a run. Raise ScenarioError for others that
    were asked for and have none, as where motors have different units.
    """
    if not by_default:
        for metric in compared:
            metric_of(run, metric)
    return [metric for metric in compared if not CATALOGUE[metric].refusal(run)]


def _suited(plant: Plant, properties: Sequence[str], laws: object) -> Laws:
    """Return the laws to compare, in the order in which a person would try them; those of the user
    in their own. Those without given gains are templates.
    """
    if laws is None:
        chosen = sorted(_of_package(plant, properties), key=_place)
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


def _place(law: Component | Template) -> tuple[int, str]:
    """Return the place of a law of the package in the order of trying."""
    place = NATURAL.index(law.name) if law.name in NATURAL else len(NATURAL)
    return place, law.name


def _of_package(plant: Plant, properties: Sequence[str]) -> list[Component | Template]:
    """Return the package's laws that suit a plant, each once."""
    left_out = {WITHOUT, *gain_sets.ALIASES}  # whose gains are those of laws that are there
    return [law for law in suitable(properties, plant) if law.name not in left_out]
