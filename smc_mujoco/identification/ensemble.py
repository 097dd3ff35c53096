"""Rankings of laws over a rig's parameter sets: does a winner win whichever of them is true?

    table = smc.study(ensemble.runs(smc.rig("qube_servo")), "qube")
    print(ensemble.verdict(smc.leaderboard(table)))

`tuned` gives every law gains by one rule: the searches of `smc.tune`, each candidate once on every
parameter set.
"""

import dataclasses
import math
import warnings
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from smc_mujoco.analysis.tuning.objective import BUDGET, SEARCHES, Objective
from smc_mujoco.analysis.tuning.search import tune
from smc_mujoco.common.aliases import AnyPath, Fields, ProgressTo
from smc_mujoco.common.errors import BrokenLawError, ScenarioError, ScenarioWarning
from smc_mujoco.control.law import Law
from smc_mujoco.identification.rig import Rig, Values
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation.conditions import Condition
from smc_mujoco.simulation.grid import Starts, all_combinations, grid
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.studies.board_tables import Boards
from smc_mujoco.studies.fair_gains import NOT_TUNED, Candidate, candidate_of
from smc_mujoco.studies.leaderboard import leaderboard
from smc_mujoco.studies.study import FULL, study
from smc_mujoco.studies.table import Table

BY_STARTS = ("x0", "v0")  # fields of a rig's machine that the starts of the grid replace


def runs(
    rig: Rig,
    laws: Sequence[str | Law | Candidate] | None = None,
    seeds: int = 20,
    gains: str = "default",
    duration: float = 10.0,
    starts: Starts | None = None,
) -> list[Scenario]:
    """Return scenarios of every law on every parameter set from every seed.

    The set is the condition.

    `laws`: by default the rig's own; the name of one of these means it, with its gains; or those
    that `tuned` returns. `seeds`, `gains`, `duration` and `starts` are as in `smc.grid`; starts are
    by default within 20 % of the rig's x0.
    """
    untuned = []
    candidates = []
    for law in _chosen(rig, laws):
        (candidates if isinstance(law, Candidate) else untuned).append(law)
    around = _starts(rig, starts)
    nominal = [Condition("nominal", {})]
    scenarios = []
    for name, fields in _machines(rig).items():
        plant = fields.pop("plant")
        base = []
        if untuned:
            base += grid([plant], untuned, ["nominal"], seeds, gains, duration, around)
        if candidates:
            base += all_combinations(
                [plant], lambda _: candidates, nominal, range(seeds), duration, around
            )
        for scenario in base:
            scenarios.append(dataclasses.replace(scenario, **fields).named(name))
    return scenarios


def objective(rig: Rig, starts: Starts | None = None) -> Objective:
    """Return what `tuned` minimises: the J of tuning, with a run on each parameter set in place of
    each condition.
    """
    machines = _machines(rig)
    around = _starts(rig, starts)
    fields: Fields = machines["set 1"] | {"law": "none", "x0": around.x0}
    if fields["u_max"] == math.inf:  # firmware bounds its own command: take the drive's bound
        fields["u_max"] = None
    first = Scenario(**fields)
    period = first.control_period
    conditions = []
    for name, machine in machines.items():
        conditions.append(Condition(name, machine))
    return Objective(
        conditions=tuple(conditions),
        starts=around,
        control_period=period,
        weight=period,
        u_max=min(first.limits),
    )


def tuned(
    rig: Rig,
    laws: Sequence[str | Law] | None = None,
    searches: int = SEARCHES,
    budget: int = BUDGET,
    starts: Starts | None = None,
    out: AnyPath | None = None,
    threads: int | None = None,
    progress: ProgressTo = False,
) -> list[Candidate]:
    """Return laws with the gains of every search, by one rule for all, see `smc.tune`.

    A law that has no gains to search keeps its own, and its remark says why. `laws` and `starts`
    are as in `runs`; `out` is a folder that keeps each search.
    """
    goal = objective(rig, starts)
    plant = _machines(rig)["set 1"]["plant"]
    candidates = []
    for law in map(coerce.coerced_law, _chosen(rig, laws)):
        try:
            with warnings.catch_warnings():  # the remark says it
                warnings.filterwarnings("ignore", "no set of gains tried", ScenarioWarning)
                tuning = tune(
                    plant,
                    law,
                    budget,
                    objective=goal,
                    searches=searches,
                    out=out,
                    threads=threads,
                    progress=progress,
                )
        except BrokenLawError:
            raise
        except ScenarioError as error:
            candidates.append(Candidate(law, (law,), f"{NOT_TUNED}{error}"))
        else:
            candidates.append(candidate_of(law, tuning))
    return candidates


def compare_on_ensemble(
    rig: Rig,
    laws: Sequence[str | Law] | None,
    seeds: int,
    out: Path,
    duration: float | None,
    starts: Starts | None,
    searches: int | None,
    threads: int | None,
    **options: Any,
) -> tuple[Table, Boards, list[Candidate]]:
    """Return the runs of laws on all parameter sets, their boards, and the laws with the gains that
    searches found: none unless `searches` is given.

    Arguments are as in `smc.compare`; `options` are those of `leaderboard`.
    """
    candidates = []
    if searches is not None:
        candidates = tuned(
            rig,
            laws,
            searches,
            starts=starts,
            out=out / "searches",
            threads=threads,
            progress=True,
        )
    length = FULL.duration if duration is None else duration
    scenarios = runs(rig, candidates or laws, seeds, duration=length, starts=starts)
    table = study(scenarios, out, True, threads, progress=True, half_steps=True)
    return table, leaderboard(table, **options), candidates


def _chosen(rig: Rig, laws: Sequence[Any] | None) -> list[Any]:
    """Return the laws to compare: the rig's own have its gains."""
    if not rig.ensemble:
        raise ScenarioError(
            f"{rig.name} has only one parameter set: choose a rig with an ensemble, such as "
            "qube_servo, or identify it from records and draw sets with Identified.drawn"
        )
    shipped = {law.name: law for law in rig.laws}
    compared = rig.laws if laws is None else laws
    if not compared:
        raise ScenarioError(
            f"no laws have gains for {rig.name}: give some, such as pid(kp=30,kd=6)"
        )
    return [shipped.get(law, law) if isinstance(law, str) else law for law in compared]


def _starts(rig: Rig, starts: Starts | None) -> Starts:
    return Starts(x0=rig.x0) if starts is None else starts


def _machines(rig: Rig) -> dict[str, Fields]:
    """Return set -> the fields of a Scenario that a rig's machine has, without where runs begin."""
    machines = {}
    for name, member in rig.members().items():
        fields: Fields = {"u_max": None, "physics_step": None}
        fields |= member.machine(Values(**member.values))
        for start in BY_STARTS:
            fields.pop(start, None)
        machines[name] = fields
    return machines


def verdict(boards: Sequence[Any]) -> str:
    """Return a line for each metric of `smc.leaderboard`: whether one law wins on every parameter
    set, and who wins on how many.
    """
    lines = []
    for board in boards:
        count = len(board.blocks)
        if board.winner:
            lines.append(f"{board.label}: {board.winner} wins on all {count} parameter sets")
            continue
        wins = Counter(filter(None, (block.winner for block in board.blocks)))
        words = []
        for law, number in wins.most_common():
            words.append(f"{law} on {number}")
        shared = ", ".join(words) or "none on any"
        lines.append(f"{board.label}: no law wins on all {count} parameter sets ({shared})")
    return "\n".join(lines)
