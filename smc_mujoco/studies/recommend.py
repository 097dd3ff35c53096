"""Recommend a law within minutes: a race over sets of gains, then runs with the gains to use.

The race says which law has the lowest J however it is tuned. Of each law that may be the best, the
three sets of the lowest J run on the same two unseen instances, which choose one. Eight others say
which law has the lowest J with these gains, as their units are runs. The tables, the share of runs
that settle, and the margins are of these gains, too, on runs of their own. Under RK4 all these runs
have twice the usual physics step, where that fits.
"""

import dataclasses
import functools
import math
import operator
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from smc_mujoco.analysis.paired_runs import SETTLES, values
from smc_mujoco.analysis.ranking import Comparison
from smc_mujoco.analysis.step_halving import doubled, halved
from smc_mujoco.analysis.tuning import search
from smc_mujoco.analysis.tuning.objective import FAILURE_COST, Objective, weighed
from smc_mujoco.analysis.tuning.result import Tuned
from smc_mujoco.common.errors import BrokenLawError, ScenarioError
from smc_mujoco.common.progress import bar
from smc_mujoco.common.text import joined
from smc_mujoco.control import source
from smc_mujoco.control.component import Component
from smc_mujoco.mechanisms.custom.scales import at_goal
from smc_mujoco.mechanisms.layout import driven_names
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.robustness.margins import COARSE, Margin, margins_of
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation.conditions import Condition
from smc_mujoco.simulation.doubts import constant_goal
from smc_mujoco.simulation.force_bounds import default_u_max
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Noise
from smc_mujoco.studies.answer_time import FEWEST_SEEDS, SHOWN, AnswerTime
from smc_mujoco.studies.fair_gains import NOT_TUNED, Candidate, Laws, Trial, default_of
from smc_mujoco.studies.leaderboard import leaderboard
from smc_mujoco.studies.race import Entrant, Race, compared, judgements, race, unseen
from smc_mujoco.studies.recommendation import RELIABLE, NoLaw, RaceRecommendation
from smc_mujoco.studies.table import Table

BY = "plant", "condition"  # what the runs of a table have in common
CONSIDERED = 3  # sets of gains of a law, those of the lowest J; chosen
CHOOSING = range(1001, 1003)  # unseen instances that choose one of them
DECIDING = range(2000, 2008)  # and that compare laws with these; chosen
BESIDE_NONE = range(3000, 3004)  # and on which the first law stands beside no law; chosen
KINDS = ("delay", "friction", "mass", "blow")  # of the margins
KINDS_OF_POSES = ("delay", "disturbance", "mass", "blow")  # of a free body
LIGHT = 0.01  # of the bound on u: a smaller load pushes nothing; chosen
TRIED = 15  # runs that a coarse margin takes, on average; chosen
# judgements of each law after a race: of the sets considered, and of the one chosen
AFTER = CONSIDERED * len(CHOOSING) + judgements(DECIDING)
Settled = dict[str, dict[str, tuple[int, int]]]


def recommend(
    trial: Trial,
    plant: Plant,
    laws: Laws,
    metrics: Sequence[str],
    seeds: int,
    clock: AnswerTime,
    relevant: float,
    untried_laws: Sequence[str],
) -> RaceRecommendation:
    """Race laws on a plant and recommend one of them, all as long as the clock lets it; `metrics`
    are those of the tables, from that many seeds, and `untried_laws` further laws that suit.
    """
    goal = trial.asked_goal(plant)
    entrants, left_out = _entrants(trial, plant, laws)
    table_work = sum(
        _coarse(trial, plant, "none", condition).work for condition in trial.conditions
    )
    kinds = len(KINDS) + 1  # friction from two sides
    margins_work = TRIED * kinds * _coarse(trial, plant, "none", trial.conditions[0]).work
    clock.unit = _work_of_judgement(plant, goal)
    few = min(seeds, FEWEST_SEEDS)
    clock.table, clock.choice = few * table_work, AFTER * clock.unit
    clock.after = margins_work + 2 * len(BESIDE_NONE) * clock.unit
    raced = race(trial, plant, entrants, goal, clock, relevant)
    chosen, tuned = _chosen(trial, plant, raced, _shown(raced), goal)
    fixed = None
    if clock.work_left >= len(chosen) * (judgements(DECIDING) * clock.unit + few * table_work):
        rivals = [*chosen][: max(2, len(raced.first))]
        fixed = _fixed(trial, plant, {law: chosen[law] for law in rivals}, goal, relevant)
    candidates = [Candidate(law, (law,)) for law in chosen.values()]
    count = clock.seeds(seeds, len(chosen) * table_work, margins_work)
    table = trial.run({plant.name: candidates}, count, coarse=True)
    settled = _settled(table)
    least = {law: _least_share(settled[law]) for law in chosen}
    order = in_order({law: settled[law] for law in chosen}, fixed, raced.winner)
    compared_metrics = list(metrics)
    if min(least.values()) < 1.0 and SETTLES not in compared_metrics:
        compared_metrics.append(SETTLES)
    boards = leaderboard(table, compared_metrics, BY, defaults=True, relevant=relevant)
    if not boards:
        raise ScenarioError(f"no need has a number in any run on {plant.name}: ask for others")
    ordered = tuple(chosen[law] for law in order)
    first = ordered[0]
    together = _together(trial, plant, first, count)
    weighs, no_law = _weighed(trial, plant, first, goal, clock)
    base = _base_of_margins(trial, plant, first)
    helped = helped_joints(base)
    margins, untried = _margins(trial, base, clock)
    opposed = _opposed(trial, base, helped, clock)
    return RaceRecommendation(
        table=table,
        leaderboard=boards,
        laws=ordered,
        settles=least,
        race=raced,
        fixed=fixed,
        settled=settled,
        together=together,
        weighs=weighs,
        no_law=no_law,
        assumed=_assumed(trial, plant, goal),
        margins=margins,
        beside=str(base.condition),
        untried=untried,
        helped=[driven_names(plant)[i] for i in helped],
        opposed=opposed,
        seeds=seeds,
        worst_run=_worst_run(table, first.name),
        tuned=tuned.get(first.name),
        left_out=left_out,
        untried_laws=untried_laws,
        judged=f"over {joined(_judged(trial, goal))} on {plant.name}",
    )


def _coarse(
    trial: Trial, plant: Plant, law: Component | str, condition: Condition | str
) -> Scenario:
    """Return a run as those of the tables and margins: at twice the usual step under RK4."""
    return doubled(trial.case(plant, law, condition))


def _least_share(settled: Mapping[str, tuple[int, int]]) -> float:
    """Return the least share of a condition's runs that settle, of (settled, all) by condition."""
    return min(count / runs for count, runs in settled.values())


def _shown(raced: Race) -> list[str]:
    """Return the laws that tables show: those that may be the best, then the others of lowest J."""
    rest = [law for law in raced.running if law not in raced.first]
    return [*raced.first, *rest][:SHOWN]


def _entrants(trial: Trial, plant: Plant, laws: Laws) -> tuple[list[Entrant], dict[str, str]]:
    """Return the laws that race, and why others cannot be tuned, by name."""
    candidates = trial.known(plant, laws)
    rule = trial.rule(plant, candidates)
    entrants = []
    left_out: dict[str, str] = {}
    for law, candidate in zip(laws, candidates, strict=True):
        bound = coerce.law(law)
        task = None
        if candidate is None:
            try:
                task = search.task_of(plant, bound, rule.goal, rule.budget, 0, trial.threads)
                task = task._replace(quick=rule.quick, device=trial.device)
            except BrokenLawError:
                raise
            except ScenarioError as error:
                left_out[bound.name] = f"{NOT_TUNED}{error}"
        if candidate or task:
            entrants.append(Entrant(candidate, task))
        elif trial.defaults or len(laws) == 1:
            entrants.append(Entrant(default_of(law), None))
    return entrants, left_out


def in_order(settled: Settled, fixed: Comparison | None, winner: str | None) -> list[str]:
    """Return the laws, the one to use first: those that settle reliably, then those that settle in
    some run, and among equals the one that runs name where sets of gains name no winner.
    """
    better = fixed.winners[0] if fixed and not winner else None

    def place(law: str) -> tuple[bool, bool, bool]:
        of_law = settled[law]
        never = not any(done for done, _ in of_law.values())
        return _least_share(of_law) < RELIABLE, never, law != better

    return sorted(settled, key=place)


def _chosen(
    trial: Trial, plant: Plant, raced: Race, names: Sequence[str], goal: Objective
) -> tuple[dict[str, Component], dict[str, Tuned]]:
    """Return the laws with the set of gains that has the lowest J on the same unseen instances, and
    their searches.
    """
    chosen, tunings = {}, {}
    for name in _counted(f"choosing gains of {joined(names)}: law", names, trial):
        entrant = raced.entrants[name]
        law = entrant.gains(0)
        if entrant.count > 1:
            order = np.argsort(entrant.values[: entrant.count], kind="stable")[:CONSIDERED].tolist()
            sets = list(map(entrant.gains, order))
            laws = []
            for tried in sets:
                laws += [tried] * len(CHOOSING)
            J, _ = unseen(trial, plant, laws, goal, [*CHOOSING] * len(sets))
            logarithms = np.log(J).reshape(len(sets), -1)
            law = sets[int(logarithms.sum(axis=1).argmin())]
        if entrant.task:
            tuned = search.result_of(entrant.task, tuple(entrant.found)).sourced()
            law = law.sourced(source.TUNED, tuned.search)
            tunings[name] = tuned.of_law(law)
        chosen[name] = law
    return chosen, tunings


def _counted(what: str, names: Sequence[str], trial: Trial) -> Iterator[str]:
    """Yield names, with a bar."""
    with bar(what, len(names), trial.progress, counted=True) as drawn:
        for name in names:
            yield name
            drawn.advance(1.0)


def _fixed(
    trial: Trial,
    plant: Plant,
    chosen: Mapping[str, Component],
    goal: Objective,
    relevant: float,
) -> Comparison | None:
    """Return the comparison of laws with these gains; None for one law."""
    if len(chosen) < 2:
        return None
    J = {}
    halves = {}
    set_numbers = {}
    fine = {}
    for name in _counted("unseen runs of law", [*chosen], trial):
        law = chosen[name]
        J[name], halves[name] = unseen(trial, plant, [law] * len(DECIDING), goal, DECIDING)
        set_numbers[name] = np.zeros(len(DECIDING))
        fine[name] = J[name] < FAILURE_COST
    return compared(J, goal, halves, set_numbers, fine, relevant)


def _settled(table: Table) -> Settled:
    """Return law -> condition -> the numbers of runs that settle, and of all."""
    counts: Settled = {}
    columns = table.column("law").tolist(), table.column("condition").tolist()
    for law, condition, missed in zip(*columns, values(table, SETTLES).tolist(), strict=True):
        done, runs = counts.setdefault(law, {}).get(condition, (0, 0))
        counts[law][condition] = done + (not missed), runs + 1
    return counts


def _together(trial: Trial, plant: Plant, law: Component, seeds: int) -> tuple[int, int] | None:
    """Return in how many runs a law settles under all conditions asked for at once, and how many
    there are; None for a single condition, or for some that exclude each other.
    """
    if len(trial.conditions) < 2:
        return None
    combined = functools.reduce(operator.add, trial.conditions)
    try:
        trial.case(plant, law, combined)  # parts may exclude each other, such as two drives
    except ScenarioError:
        return None
    at_once = trial._replace(conditions=[combined], folder=trial.folder / "together")
    table = at_once.run({plant.name: [Candidate(law, (law,))]}, seeds, coarse=True)
    return _settled(table)[law.name][combined.name]


def _weighed(
    trial: Trial, plant: Plant, law: Component, goal: Objective, clock: AnswerTime
) -> tuple[dict[str, float], NoLaw]:
    """Return condition -> its share in J of a law, and how no law does on the same instances, of
    which there is at least one.
    """
    fit = min(len(BESIDE_NONE), clock.work_left / (2 * clock.unit))
    instances = BESIDE_NONE[: max(1, int(fit))]
    names = [condition.name for condition in goal.conditions]
    costs, settled = weighed(plant, law, goal, instances, trial.threads)
    none = coerce.law("none")
    without_costs, settled_without = weighed(plant, none, goal, instances, trial.threads)
    total = costs.sum(axis=0)
    parts = (total / total.sum()).tolist()
    ratios = without_costs.sum(axis=1) / costs.sum(axis=1)
    failed = np.maximum(costs, without_costs) >= FAILURE_COST
    without = dict(zip(names, settled_without.sum(axis=0).tolist(), strict=True))
    case = trial.case(plant, none, trial.conditions[0])
    return dict(zip(names, parts, strict=True)), NoLaw(
        times=math.nan if failed.any() else float(np.median(ratios)),
        runs=len(instances),
        duration=goal.duration,
        settled=without,
        settled_by_law=dict(zip(names, settled.sum(axis=0).tolist(), strict=True)),
        holds=case.efforts[0] == plant.unit,
    )


def _judged(trial: Trial, goal: Objective) -> list[str]:
    """Return the conditions that J is of, with a word on those that were not asked for."""
    by_user = {condition.name for condition in trial.conditions}
    names = []
    for condition in goal.conditions:
        added = "" if condition.name in by_user else " (added, see Assumed)"
        names.append(f"{condition.name}{added}")
    return names


def _assumed(trial: Trial, plant: Plant, goal: Objective) -> str:
    """Return how often u changes and what it is made from, and each noise, in words; of noise that
    no condition asked for has, that it is added.
    """
    period = 1e3 * trial.case(plant, "none", "nominal").control_period
    parts = [
        f"u changes every {period:g} ms and is computed from measured positions and velocities, "
        "unless a condition says otherwise"
    ]
    by_user = {condition.name for condition in trial.conditions}
    for condition in trial.conditions:
        velocity = trial.case(plant, "none", condition).resolved.velocity
        if velocity.name != "measured":
            parts.append(f"under {condition.name} the velocity is {velocity} of the positions")
    units = " or ".join(dict.fromkeys(plant.units[: plant.driven]))
    for condition in goal.conditions:
        noise = condition.on(plant, goal.duration).get("noise")
        if isinstance(noise, Noise):
            parts.append(
                f"under {condition.name} the measured positions carry noise of "
                f"{noise.position:g} {units} and the measured velocities noise of "
                f"{noise.velocity:g} {units}/s (standard deviations)"
            )
            if condition.name not in by_user:
                parts[-1] += (
                    ". None of your conditions has noise, so the condition "
                    f"{condition.name} was added: to replace it, give a condition with "
                    "noise=Noise(...)"
                )
    return "; ".join(parts)


def _worst_run(table: Table, law: str) -> Scenario:
    """Return the run of a law that settles last, or never, in the condition in which it settles in
    the fewest runs, or latest.
    """
    times = values(table, "settling_time")
    missed = values(table, SETTLES)
    own = table.column("law") == law
    worst, rank = 0, (-1.0, -1.0)
    for condition in dict.fromkeys(table.column("condition").tolist()):
        rows = np.flatnonzero(own & (table.column("condition") == condition))
        late = float(missed[rows].mean()), float(np.median(times[rows]))
        if late > rank:
            worst, rank = int(rows[np.argmax(times[rows])]), late
    return table.scenario(worst)


def _base_of_margins(trial: Trial, plant: Plant, law: Component) -> Scenario:
    """Return the run beside which margins are found: under the condition asked for, if it is the
    only one or has other commands, else without conditions.
    """
    plain = _coarse(trial, plant, law, "nominal")
    first = _coarse(trial, plant, law, trial.conditions[0])
    return first if len(trial.conditions) == 1 or plain.efforts != first.efforts else plain


def _margins(trial: Trial, base: Scenario, clock: AnswerTime) -> tuple[list[Margin], list[str]]:
    """Return what the law of a run tolerates beside it, and the kinds for which there is no time;
    none of either where it starts at its goal.
    """
    if base.resolved.x0 == constant_goal(base):
        return [], []
    kinds = KINDS_OF_POSES if base.plant.pose else KINDS
    margins: list[Margin] = []
    for pair in (kinds[:2], kinds[2:]):
        tried = pair[: int(min(len(pair), clock.margins_left / (TRIED * base.work)))]
        if tried:
            with bar(f"margins of {joined(tried)}", shown=trial.progress) as drawn:
                margins += margins_of([base], tried, COARSE, trial.threads, drawn.reached)
        if len(tried) < len(pair):
            break
    return margins, [*kinds[len(margins) :]]


def helped_joints(base: Scenario) -> list[int]:
    """Return the driven channels of a user's model that what they carry pushes from the start of a
    run to the goal.
    """
    plant = base.plant
    if not plant.is_user_model or plant.pose:
        return []
    apart = np.subtract(base.resolved.x0, plant.origin)[: plant.driven]
    helps = at_goal(plant).load * np.sign(apart)
    return np.flatnonzero(helps > LIGHT * default_u_max(plant)).tolist()


def _opposed(
    trial: Trial, base: Scenario, helped: Sequence[int], clock: AnswerTime
) -> Margin | None:
    """Return the margin of friction beside a run that starts with the `helped` channels as far on
    the other side of their goal; None if there are none, no time, or no room there.
    """
    if not helped or clock.margins_left < TRIED * base.work:
        return None
    x0 = np.array(base.resolved.x0)
    x0[helped] = 2.0 * np.array(base.plant.origin)[helped] - x0[helped]
    try:
        mirrored = dataclasses.replace(base, x0=tuple(x0.tolist()))
    except ScenarioError:  # beyond a limit, or inside something
        return None
    with bar("margin from the other side", shown=trial.progress) as drawn:
        return margins_of([mirrored], ["friction"], COARSE, trial.threads, drawn.reached)[0]


def _work_of_judgement(plant: Plant, goal: Objective) -> float:
    """Return the work of the runs that judge one set of gains, at twice their step where they may
    have it. Their models are compiled here, so that the first judgement takes as long as others.
    """
    cases = list(map(doubled, goal.holdout(plant, coerce.law("none"), 0)))
    for case in cases:
        prepare(case)
        prepare(halved(case))
    return sum(case.work for case in cases)
