"""Which law suits a plant: a comparison by the rules of `compare`, and an answer of four lines.

A need is a metric to compare, such as "fast", or a property that each law must have, such as
"continuous". A law that settles in less than half as many runs of a condition as the law that
settles most often is not compared, because a law that does nothing would be the calmest. The others
stand by the number of their runs that fail, then by their mean rank over all needs and conditions,
see `Boards.order`. This order is not tested; the last line of the answer says how sure it is.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np

from smc_mujoco.analysis.engine import Device
from smc_mujoco.analysis.paired_runs import SETTLES, values
from smc_mujoco.analysis.ranking import RELEVANT, Relevant
from smc_mujoco.common.constraints import Boolean, FilePath, Positive, Whole, constrained
from smc_mujoco.common.errors import ScenarioError, find
from smc_mujoco.common.tabular import Tables, Tabular
from smc_mujoco.control import gain_sets
from smc_mujoco.control.component import Component, Template, gain_text
from smc_mujoco.control.properties import PROPERTIES, suitable
from smc_mujoco.mechanisms.custom.scales import falls
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.catalogue import CATALOGUE, metrics
from smc_mujoco.simulation.conditions import Condition
from smc_mujoco.simulation.grid import Starts, listed, listed_laws
from smc_mujoco.simulation.workers import Workers
from smc_mujoco.studies.board import Boards
from smc_mujoco.studies.compare import DrawSeed
from smc_mujoco.studies.fair_gains import Laws, Trial, law_or_template
from smc_mujoco.studies.leaderboard import leaderboard
from smc_mujoco.studies.table import Table

NEEDS: Mapping[str, str] = {metric.need: metric.name for metric in metrics() if metric.need}
DEFAULT_NEEDS = ("fast", "accurate", "calm")
DEFAULT_CONDITIONS = ("nominal", "noise", "sine")
RELIABLE = 0.9  # share of the runs of every condition in which a reliable law settles; chosen
MIN_SETTLED = 0.5  # of the share of runs that settle under the best law; chosen
# laws that go on where quick tunes all of them first, and the seeds of their first runs; chosen
FINALISTS, FEW = 5, 6
QUICK_SEARCHES, QUICK_BUDGET = 3, 16  # budget: evaluations of a search for each gain


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Advice(Tables):
    """Laws compared for a plant, best first, and which to use; `print` shows it."""

    table: Table  # the runs of all laws
    leaderboard: Boards  # of the laws that settle often enough, a board for each need
    laws: tuple[Component, ...]  # with their gains: those of the boards, best first
    settles: Mapping[str, float]  # law -> the least share of its runs that settle in a condition
    left_out: Sequence[str] = ()  # laws that did not go on after one search and FEW runs

    @property
    def law(self) -> Component:
        """The first law, with its gains."""
        return self.laws[0]

    @property
    def second(self) -> Component | None:
        """The second law, with its gains; None if there is no other."""
        return self.laws[1] if len(self.laws) > 1 else None

    @property
    def answer(self) -> list[str]:
        """Four lines: the law, its gains, the second, and the evidence."""
        first = self.law
        gains = ", ".join(f"{name}={gain_text(value)}" for name, value in first.gains.items())
        return [
            f"Use: {self._name}",
            f"Gains: {gains or 'none'}, {first.source}",
            f"Second: {self.second or 'none'}",
            f"Evidence: {self._sure}",
        ]

    @property
    def _name(self) -> str:
        """The first law's name, or a sentence if it does not settle reliably."""
        if self.settles[self.law.name] < RELIABLE:
            return f"no law settles reliably; the nearest is {self.law.name}"
        return self.law.name

    @property
    def _sure(self) -> str:
        boards = self.leaderboard
        settles = self.settles[self.law.name]
        if settles < RELIABLE:
            share = f"{100 * settles:.0f} % of its runs in its worst condition"
            return f"no law is reliable here; this one settles in {share}"
        if len(self.laws) < 2:
            return "there is no second law"
        if barred := [law for board in boards for law in board.barred if law != self.law.name]:
            return f"first so far; --defaults lets a law win over {barred[0]}'s default gains"
        if all(board.too_few for board in boards):
            return f"first so far; {boards[0].too_few}"
        name = self.law.name
        blocks = sum(len(board.blocks) for board in boards)
        wins = sum(len(board.wins(name)) for board in boards)
        losses = sum(len(board.losses(name)) for board in boards)
        text = f"it wins {wins} of {blocks} comparisons, and another law wins {losses}"
        if wins:
            return text
        return f"first so far; {text}"

    @property
    def tables(self) -> list[Tabular]:
        """The tables of the `leaderboard`, with the answer below the last."""
        *others, last = self.leaderboard.tables
        notes = [*last.notes, ""]
        if self.left_out:
            notes.append(
                f"Left out after one search and {FEW} runs in each condition, though the best may "
                f"be among them (run without quick, or name five laws): {', '.join(self.left_out)}"
            )
        if rare := sorted(self.settles.keys() - {law.name for law in self.laws}):
            notes.append(
                "Not compared, as they settle in fewer than half as many runs as another law: "
                f"{', '.join(rare)}"
            )
        return [*others, dataclasses.replace(last, notes=notes + self.answer)]


@constrained
def which(
    plant: str | Plant,
    conditions: str | Condition | Sequence[str | Condition] | None = None,
    needs: str | Sequence[str] = DEFAULT_NEEDS,
    laws: str | Component | Template | Sequence[str | Component | Template] | None = None,
    seeds: Annotated[int, Whole(low=1, high=10_000)] = 24,
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
) -> Advice:
    """Recommend a law for a plant: compare all laws that suit, with gains for the plant, and say
    how certain the answer is.

    Args:
      plant: a name, a Plant, or your own MJCF and its joints, as "arm.xml:shoulder,elbow".
      conditions: names, texts or Conditions, see `condition`. Default: nominal, noise and sine.
      needs: what to compare: "fast", "accurate" (at the end), "on-track" (on the way), "calm",
        "gentle", "frugal", "no-overshoot"; by default fast, accurate and calm. And what every law
        must have: "continuous" and the other names of `smc_mujoco.control.properties.PROPERTIES`.
      laws: the laws to compare, by name or with your own gains. Default: all that suit.
      seeds: runs of a law in each condition, each with another start and other noise.
      duration: of a run, s. Default: 5, or 3 if quick.
      out: folder for gains and runs, which another call reads.
      quick: shorter runs, three searches of 16 evaluations a gain in place of 12 of 64. On your own
        model also a shorter objective, and by default the usual laws. There
        one search and six runs in each condition come first, and the best five laws go on.
      defaults: whether a law may win over rivals whose gains are their defaults.
      falling: whether to go on where the base of your model falls while its joints are held, so
        that no law of a joint can be judged.
      starts, relevant, threads, progress, seed, device, executor: as in `compare`.

    Raises:
      ScenarioError: an unknown name, no law that suits, a need without a number on this plant, or
        a base that falls.
    """
    machine = as_plant(plant)
    if not falling and (why := falls(machine)):
        raise ScenarioError(f"{why}; falling=True (--falling) goes on all the same")
    compared, properties = _asked(machine, needs)
    brief = quick and machine.is_user_model
    chosen = _suited(machine, properties, laws)
    if brief and laws is None:
        known = [law for law in chosen if law.name in gain_sets.COMPARED]
        chosen = known or chosen
    length = duration or (3.0 if quick else 5.0)
    trial = Trial.of(
        [machine],
        conditions,
        DEFAULT_CONDITIONS,
        length,
        out,
        starts=starts,
        threads=threads,
        progress=progress,
        defaults=defaults,
        seed=seed,
        brief=brief,
        device=device,
        executor=executor,
    )
    if quick:
        trial = trial._replace(usual=QUICK_SEARCHES, budget=QUICK_BUDGET)
    trial.check({machine.name: chosen})

    def judged(table: Table) -> tuple[dict[str, float], Boards]:
        settles, fit = _fit(table)
        boards = leaderboard(table.select(law=fit), compared, defaults=defaults, relevant=relevant)
        if not boards:
            raise ScenarioError(
                f"no need has a number in any run on {machine.name}: ask for others"
            )
        return settles, boards

    left_out: list[str] = []
    if brief and len(chosen) > FINALISTS:
        first = trial._replace(usual=1).candidates({machine.name: chosen}, FEW)
        _, boards = judged(trial.run(first, min(FEW, seeds), half_steps=False))
        best = boards.order[:FINALISTS]
        left_out = [law.name for law in chosen if law.name not in best]
        chosen = [law for law in chosen if law.name in best]
    candidates = trial.candidates({machine.name: chosen}, seeds)
    table = trial.run(candidates, seeds)
    settles, boards = judged(table)
    found = {law.name: law for law, _, _ in candidates[machine.name]}
    ordered = tuple(found[name] for name in boards.order)
    return Advice(table=table, leaderboard=boards, laws=ordered, settles=settles, left_out=left_out)


def _asked(plant: Plant, needs: str | Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the metrics and the properties among the needs; without metrics, DEFAULT_NEEDS."""
    compared, properties = [], []
    given = needs.split(",") if isinstance(needs, str) else listed("needs", needs)
    for need in given:
        name = need.strip() if isinstance(need, str) else need
        find("need", name, {**NEEDS, **PROPERTIES})
        if name in NEEDS:
            compared.append(NEEDS[name])
        else:
            properties.append(name)
    for metric in compared:
        if why := CATALOGUE[metric].refusal(plant):
            raise ScenarioError(why)
    return compared or [NEEDS[name] for name in DEFAULT_NEEDS], properties


def _suited(plant: Plant, properties: Sequence[str], laws: object) -> Laws:
    """Return the laws to compare. Those without given gains are templates."""
    if laws is None:
        left_out = {"none", *gain_sets.ALIASES}  # whose gains are those of laws that are there
        chosen = [law for law in suitable(properties, plant) if law.name not in left_out]
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


def _fit(table: Table) -> tuple[dict[str, float], list[str]]:
    """Return the least share of a law's runs that settle in a condition, and the laws that settle
    often enough to be compared; all if none does.
    """
    laws, conditions = table.column("law"), table.column("condition")
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
