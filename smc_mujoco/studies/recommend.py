"""Recommend a law: a race over sets of gains, then runs with the gains to use.

The race says which law has the lowest J however it is tuned. Of each law that may be the best, the
three sets of the lowest J run on the same two unseen instances, which choose one. Eight others say
which law has the lowest J with these gains, as their units are runs. The tables, the share of runs
that settle, how the law rests, and the margins are of these gains, too, on runs of their own. Under
RK4 all these runs have twice the usual physics step, where that fits. Each part is left out for
which there is no time, the film and the margins first.
"""

import dataclasses
import functools
import math
import operator
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from smc_mujoco.analysis.paired_runs import SETTLES, values
from smc_mujoco.analysis.ranking import Comparison
from smc_mujoco.analysis.step_halving import doubled, halved
from smc_mujoco.analysis.tuning import search
from smc_mujoco.analysis.tuning.objective import Objective, weighed
from smc_mujoco.analysis.tuning.result import Tuned
from smc_mujoco.analysis.tuning.run_limits import (
    CALM,
    LIMIT_COST,
    OVERSHOOT,
    RunLimit,
    overshoot,
    swing,
)
from smc_mujoco.answers.facts import Settles
from smc_mujoco.common.errors import BrokenLawError, ScenarioError
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.process import return_freed_memory
from smc_mujoco.common.progress import bar
from smc_mujoco.common.text import joined
from smc_mujoco.control import source
from smc_mujoco.control.component import Component
from smc_mujoco.mechanisms.custom.scales import at_goal
from smc_mujoco.mechanisms.layout import driven_names
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.robustness.level_search import COARSE
from smc_mujoco.robustness.margins import Margin, margins_of
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation.conditions import Condition
from smc_mujoco.simulation.doubts import constant_goal
from smc_mujoco.simulation.force_bounds import default_u_max
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.run import lower_mmap_threshold, run_unjudged
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Constant, Noise
from smc_mujoco.studies.answer_time import FEWEST_SEEDS, SHOWN, AnswerTime
from smc_mujoco.studies.fair_gains import NOT_TUNED, Candidate, Laws, Trial, default_of
from smc_mujoco.studies.leaderboard import leaderboard
from smc_mujoco.studies.race import (
    WITHOUT,
    Entrant,
    Race,
    RaceCourse,
    ReadyEntrant,
    SearchedEntrant,
    compared,
    hopeless,
    judgements,
    race,
    unseen,
)
from smc_mujoco.studies.recommendation import (
    RELIABLE,
    AddedNoise,
    AtRest,
    Recommendation,
    Settled,
    Tolerance,
    lost_runs,
)
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
LEAST_RUNS = 3  # of a law in each condition: for the tables, and the film twice; chosen
# judgements of each law after a race: of the sets considered, and of the one chosen
AFTER = CONSIDERED * len(CHOOSING) + judgements(DECIDING)


class Question(NamedTuple):
    """What a recommendation is asked, beside the course of its race."""

    laws: Laws
    metrics: Sequence[str]  # of the tables
    relevant: float  # as in `ranking`
    untried_laws: Sequence[str]  # further laws of the package that suit
    by_user: bool = True  # whether the user named conditions


def recommend(
    trial: Trial, plant: Plant, question: Question, goal: Objective, clock: AnswerTime
) -> Recommendation:
    """Race laws on a plant and recommend one of them, all as long as the clock lets it."""
    lower_mmap_threshold()
    course = RaceCourse(trial, plant, goal, clock)
    entrants, left_out = _entrants(trial, plant, question.laws, goal)
    table_work = _work_of_tables(course)
    kinds = len(KINDS) + 1  # friction from two sides
    margins_work = TRIED * kinds * _coarse(trial, plant, WITHOUT, trial.conditions[0]).work
    clock.unit = _work_of_judgement(course)
    few = min(trial.draws.seeds, FEWEST_SEEDS)
    looked = bool(goal.limits)  # whether each law has a run more, which shows how it rests
    clock.table, clock.choice = (few + looked) * table_work, AFTER * clock.unit
    clock.after = margins_work + 2 * len(BESIDE_NONE) * clock.unit
    clock.least = (LEAST_RUNS + looked) * table_work
    raced = race(course, entrants, question.relevant)
    names = _shown(raced)
    if not clock.fits(len(names) * (1 + looked) * table_work):
        names = names[:1]
    chosen, tunings = _chosen(course, raced, names)
    fixed = None
    if clock.fits(len(chosen) * (judgements(DECIDING) * clock.unit + few * table_work)):
        rivals = [*chosen][: max(2, len(raced.first))]
        fixed = _fixed(course, {law: chosen[law] for law in rivals}, question.relevant)
    candidates = [Candidate(law, (law,)) for law in chosen.values()]
    count = clock.seeds(trial.draws.seeds + looked, len(chosen) * table_work, margins_work)
    count = max(1, count - looked)
    with clock.timed(count * len(chosen) * table_work):
        table = trial.run({plant.name: candidates}, count, coarse=True)
    settled = _settled(table)
    rests = {name: _at_rest(course, law) for name, law in chosen.items()}
    shaky = [name for name, rest in rests.items() if rest and rest.share > CALM]
    broken = breaking(goal.limits, fixed, rests)
    order = in_order({law: settled[law] for law in chosen}, fixed, raced, shaky, broken)
    metrics = list(question.metrics)
    if min(least_share(settled[law]) for law in chosen) < 1.0 and SETTLES not in metrics:
        metrics.append(SETTLES)
    boards = leaderboard(table, metrics, BY, defaults=True, relevant=question.relevant)
    if not boards:
        raise ScenarioError(f"no need has a number in any run on {plant.name}: ask for others")
    first = chosen[order[0]]
    together = _together(course, first, count)
    weighs, no_law = _weighed(course, first)
    base = _base_of_margins(trial, plant, first)
    helped = helped_joints(base)
    margins, untried = _margins(trial, base, clock)
    opposed = _opposed(trial, base, helped, clock)
    return Recommendation(
        table=table,
        leaderboard=boards,
        laws=tuple(chosen[law] for law in order),
        race=raced,
        fixed=fixed,
        settled=settled,
        together=together,
        weighs=weighs,
        no_law=no_law,
        rests=rests,
        limits=goal.limits,
        noises=_noises(course),
        tolerance=Tolerance(
            margins=margins,
            beside=str(base.condition),
            untried=untried,
            helped=[driven_names(plant)[i] for i in helped],
            opposed=opposed,
        ),
        seeds=trial.draws.seeds,
        worst_run=_worst_run(table, first.name),
        tuned=tunings.get(first.name),
        left_out=left_out,
        untried_laws=question.untried_laws,
        judged=_judged(trial, goal, question.by_user),
        folder=trial.folder,
        pictured=clock.left + clock.spare > 2.0 * clock.pace * base.work,
    )


def _coarse(
    trial: Trial, plant: Plant, law: Component | str, condition: Condition | str
) -> Scenario:
    """Return a run as those of the tables and margins: at twice the usual step under RK4."""
    return doubled(trial.case(plant, law, condition))


def _work_of_tables(course: RaceCourse) -> float:
    """Return the work of a law's runs from one seed."""
    trial, plant, *_ = course
    return sum(_coarse(trial, plant, WITHOUT, condition).work for condition in trial.conditions)


def least_share(settled: Mapping[str, Settles]) -> float:
    """Return the least share of a condition's runs that settle."""
    return min(runs.count / runs.total for runs in settled.values())


def _shown(raced: Race) -> list[str]:
    """Return the laws that tables show: those that may be the best, then the others of lowest J; no
    law only where it may be the best.
    """
    values = {name: raced.entrants[name].values for name in raced.running}
    first = [law for law in raced.first if law != WITHOUT or law not in hopeless(values)]
    rest = [law for law in raced.running if law not in first and law != WITHOUT]
    return [*first, *rest][:SHOWN]


def _entrants(
    trial: Trial, plant: Plant, laws: Laws, goal: Objective
) -> tuple[list[Entrant], dict[str, str]]:
    """Return the laws that race, "none" first, and why others cannot be tuned, by name."""
    candidates = trial.known(plant, laws)
    rule = trial.rule(plant, candidates)
    entrants: list[Entrant] = []
    if all(coerce.coerced_law(law).name != WITHOUT for law in laws):
        entrants.append(ReadyEntrant(default_of(coerce.coerced_law(WITHOUT))))
    left_out: dict[str, str] = {}
    for law, candidate in zip(laws, candidates, strict=True):
        if candidate:
            entrants.append(ReadyEntrant(candidate))
            continue
        bound = coerce.coerced_law(law)
        try:
            sought = dataclasses.replace(
                rule.goal, limits=tuple(limit.for_search for limit in goal.limits)
            )
            task = search.task_of(plant, bound, sought, rule.budget, 0, trial.threads)
            entrants.append(
                SearchedEntrant(task._replace(quick=rule.quick, device=trial.search.device))
            )
        except BrokenLawError:
            raise
        except ScenarioError as error:
            left_out[bound.name] = f"{NOT_TUNED}{error}"
            if trial.gains.defaults or len(laws) == 1:
                entrants.append(ReadyEntrant(default_of(law)))
    return entrants, left_out


def in_order(
    settled: Mapping[str, Mapping[str, Settles]],
    fixed: Comparison | None,
    raced: Race | None,
    shaky: Sequence[str] = (),
    broken: Mapping[str, int] = frozen({}),
) -> list[str]:
    """Return the laws, the one to use first: those that settle reliably, then those that settle in
    some run, and of each those first with which the fewest runs break a limit. Among equals the one
    that runs name where sets of gains name no winner; where nothing does, those that rest before
    the `shaky`, of the laws that may be the best.
    """
    winner = raced.winner if raced else None
    better = fixed.winners[0] if fixed and not winner else None
    undecided = raced.first if raced and not winner and not better else []

    def place(law: str) -> tuple[int, ...]:
        of_law = settled[law]
        never = not any(runs.count for runs in of_law.values())
        behind = bool(undecided) and law not in undecided
        shakes = bool(undecided) and law in shaky
        lost = broken.get(law, 0)
        return least_share(of_law) < RELIABLE, never, lost, law != better, behind, shakes

    return sorted(settled, key=place)


def _chosen(
    course: RaceCourse, raced: Race, names: Sequence[str]
) -> tuple[dict[str, Component], dict[str, Tuned]]:
    """Return the laws with the set of gains that has the lowest J on the same unseen instances, and
    their searches. Without time, the set is that of the lowest J so far.
    """
    chosen, tunings = {}, {}
    for name in _counted(f"choosing gains of {joined(names)}: law", names, course.trial):
        entrant = raced.entrants[name]
        law = entrant.gains(0)
        if entrant.count > 1:
            law = _best_set(course, entrant)
        if isinstance(entrant, SearchedEntrant):
            beside = course.clock.fits(course.clock.unit)
            tuned = search.result_of(entrant.task, tuple(entrant.results), beside).sourced()
            law = law.sourced(source.TUNED, tuned.search)
            tunings[name] = tuned.of_law(law)
        chosen[name] = law
    return chosen, tunings


def _best_set(course: RaceCourse, entrant: Entrant) -> Component:
    """Return a law with the set of its gains that `_chosen` takes."""
    order = np.argsort(entrant.values[: entrant.count], kind="stable")[:CONSIDERED].tolist()
    sets = list(map(entrant.gains, order))
    work = len(sets) * len(CHOOSING) * course.clock.unit
    if not course.clock.fits(work):
        return sets[0]
    laws = []
    for of_set in sets:
        laws += [of_set] * len(CHOOSING)
    with course.clock.timed(work):
        J, _ = unseen(course.trial, course.plant, laws, course.goal, [*CHOOSING] * len(sets))
    logarithms = np.log(J).reshape(len(sets), -1)
    return sets[int(logarithms.sum(axis=1).argmin())]


def _counted(what: str, names: Sequence[str], trial: Trial) -> Iterator[str]:
    """Yield names, with a bar."""
    with bar(what, len(names), trial.progress, counted=True) as drawn:
        for name in names:
            yield name
            drawn.advance(1.0)


def _fixed(
    course: RaceCourse, chosen: Mapping[str, Component], relevant: float
) -> Comparison | None:
    """Return the comparison of laws with these gains, u = 0 among them; None for one law."""
    laws = dict(chosen) | {WITHOUT: coerce.coerced_law(WITHOUT)}
    if len(laws) < 2:
        return None
    J = {}
    halves = {}
    set_numbers = {}
    fine = {}
    work = judgements(DECIDING) * course.clock.unit
    for name in _counted("unseen runs of law", [*laws], course.trial):
        repeated = [laws[name]] * len(DECIDING)
        with course.clock.timed(work):
            J[name], halves[name] = unseen(
                course.trial, course.plant, repeated, course.goal, DECIDING
            )
        set_numbers[name] = np.zeros(len(DECIDING))
        fine[name] = J[name] < LIMIT_COST
    return compared(J, course.goal, halves, set_numbers, fine, relevant)


def breaking(
    limits: Sequence[RunLimit], fixed: Comparison | None, rests: Mapping[str, AtRest | None]
) -> dict[str, int]:
    """Return law -> in how many runs it breaks a limit that was asked for, by the unseen runs with
    these gains and by those that show how it rests.
    """
    if not limits:
        return {}
    broken = lost_runs(fixed)
    for limit in limits:
        for law, rest in rests.items():
            if rest and limit.what == OVERSHOOT and rest.overshoot > limit.most:
                broken[law] = broken.get(law, 0) + 1
    return broken


def _settled(table: Table) -> Settled:
    """Return law -> condition -> the numbers of runs that settle, and of all."""
    counts: Settled = {}
    columns = table.column("law").tolist(), table.column("condition").tolist()
    for law, condition, missed in zip(*columns, values(table, SETTLES).tolist(), strict=True):
        so_far = counts.setdefault(law, {}).get(condition, Settles(0, 0))
        counts[law][condition] = Settles(so_far.count + (not missed), so_far.total + 1)
    return counts


def _at_rest(course: RaceCourse, law: Component) -> AtRest | None:
    """Return how a law ends its runs without noise and without disturbances that vary, in the
    condition in which u swings most, and its largest overshoot there before any event; None without
    a goal to rest at, or without time, unless limits were asked for.
    """
    trial, plant, goal, clock = course
    if not goal.limits and not clock.fits(_work_of_tables(course)):
        return None
    cases = [_quiet(_coarse(trial, plant, law, condition)) for condition in trial.conditions]
    traces = run_unjudged(cases, trial.threads)
    largest, where = None, ""
    most, where_most = math.nan, ""
    for condition, case, trace in zip(trial.conditions, cases, traces, strict=True):
        if trace.failure is not None or trace.diverged_at is not None:
            continue
        of_run = swing(case, trace.u)
        if not math.isnan(of_run.share) and (largest is None or of_run.share > largest.share):
            largest, where = of_run, condition.name
        percent = overshoot(case, trace.x)
        if not math.isnan(percent) and not percent <= most:
            most, where_most = percent, condition.name
    if largest is None:
        return None
    size, frequency, share, channel = largest
    return AtRest(size, frequency, share, cases[0].efforts[channel], where, most, where_most)


def _quiet(case: Scenario) -> Scenario:
    """Return a run without noise and without disturbances that vary from its start."""
    disturbance = []
    for part in case.disturbance:
        if isinstance(part, Constant) or getattr(part, "time", 0.0) > 0.0:
            disturbance.append(part)
    return dataclasses.replace(case, noise=Noise(), disturbance=tuple(disturbance))


def _together(course: RaceCourse, law: Component, seeds: int) -> Settles | None:
    """Return in how many runs a law settles under all conditions asked for at once, and how many
    there are; None for a single condition, for some that exclude each other, or without time.
    """
    trial, plant, _, clock = course
    if len(trial.conditions) < 2:
        return None
    combined = functools.reduce(operator.add, trial.conditions)
    try:
        case = _coarse(trial, plant, law, combined)  # parts may exclude each other, as two drives
    except ScenarioError:
        return None
    if not clock.fits(seeds * case.work):
        return None
    at_once = trial._replace(conditions=[combined], folder=trial.folder / "together")
    with clock.timed(seeds * case.work):
        table = at_once.run({plant.name: [Candidate(law, (law,))]}, seeds, coarse=True)
    return _settled(table)[law.name][combined.name]


def _weighed(
    course: RaceCourse, law: Component
) -> tuple[dict[str, float], dict[str, Settles] | None]:
    """Return condition -> its share in J of a law, and how no law does on the same instances; {}
    and None without time.
    """
    trial, plant, goal, clock = course
    count = int(min(len(BESIDE_NONE), clock.work_left / (2 * clock.unit)))
    if not count:
        return {}, None
    instances = BESIDE_NONE[:count]
    names = [condition.name for condition in goal.conditions]
    with clock.timed(2 * count * clock.unit):
        costs, _ = weighed(plant, law, goal, instances, trial.threads)
        none = coerce.coerced_law(WITHOUT)
        _, settled_without = weighed(plant, none, goal, instances, trial.threads)
    total = costs.sum(axis=0)
    parts = (total / total.sum()).tolist()
    settled = [Settles(done, count) for done in settled_without.sum(axis=0).tolist()]
    return dict(zip(names, parts, strict=True)), dict(zip(names, settled, strict=True))


def _judged(trial: Trial, goal: Objective, asked: bool) -> dict[str, bool]:
    """Return the conditions that J is of, and whether each was asked for; if none was, the nominal
    one is.
    """
    by_user = {condition.name for condition in trial.conditions} if asked else {"nominal"}
    return {condition.name: condition.name in by_user for condition in goal.conditions}


def _noises(course: RaceCourse) -> list[AddedNoise]:
    """Return the noise of each condition that has some."""
    trial, plant, goal, _ = course
    by_user = {condition.name for condition in trial.conditions}
    units = " or ".join(dict.fromkeys(plant.units[: plant.driven]))
    noises = []
    for condition in goal.conditions:
        noise = condition.on(plant, goal.duration).get("noise")
        if isinstance(noise, Noise):
            added = condition.name not in by_user
            noises.append(AddedNoise(condition.name, noise.position, noise.velocity, units, added))
    return noises


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
    if not plant.has_user_joints:
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


def _work_of_judgement(course: RaceCourse) -> float:
    """Return the work of the runs that judge one set of gains, at twice their step where they may
    have it. Their models are compiled here, so that the first judgement takes as long as others.
    """
    cases = list(map(doubled, course.goal.holdout(course.plant, coerce.coerced_law(WITHOUT), 0)))
    with bar("preparing runs", 2 * len(cases), course.trial.progress, counted=True) as drawn:
        for case in cases:
            for prepared in (case, halved(case)):
                prepare(prepared)
                drawn.advance(1.0)
    return_freed_memory()
    return sum(case.work for case in cases)
