"""Orders of accuracy: how a law's error falls with the control period, beside the order that theory
promises.

    table = orders(["classical", "twisting", "super_twisting"], "duffing", conditions="coulomb")
    print(table)                                  # the most accurate law first
    table[0].e.order, table[0].e.theory           # exponent of the period, measured and promised

Runs have no noise. The error of a run is the largest |e|, or |s|, at the control samples of its
last 20 %, over all driven channels. That is an ultimate bound, as the theorems on accuracy state
it: |e| <= C h^r for a control period h. `scaling` determines the exponent r and says which errors
do not count. The file of a law states the order that theory promises, see `law_function`. Theory
promises no order if there is a drive, a delay, a sensor or an estimate of the velocity between law
and mechanism.

A mechanism with friction, contacts or other parts takes at least 16 physics steps in each control
period, so that the error of the first-order integrator does not count. RK4, for plain equations and
exact friction, keeps the scenario's step.
"""

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, NamedTuple

import numpy as np

from smc_mujoco.common.aliases import Floats
from smc_mujoco.common.constraints import Called, constrained
from smc_mujoco.common.errors import ScenarioError, items_of, number, one_line, shown, whole
from smc_mujoco.common.progress import Report, summed
from smc_mujoco.common.tabular import Cell, Tables, Tabular
from smc_mujoco.common.text import joined
from smc_mujoco.control import gain_sets as sets
from smc_mujoco.control.component import Template
from smc_mujoco.control.law import Law
from smc_mujoco.control.source import by_words, kinds
from smc_mujoco.draw.colouring import law_colour
from smc_mujoco.evidence.accuracy.scaling import QUANTITIES, Accuracy, scaling
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.fold import first_sample
from smc_mujoco.simulation.coerce import MIN_TIME
from smc_mujoco.simulation.conditions import Condition
from smc_mujoco.simulation.grid import (
    DURATION,
    Starts,
    case,
    listed,
    listed_conditions,
    listed_laws,
)
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Noise
from smc_mujoco.simulation.trace import Trace

PERIODS = (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4)  # s
# chosen: a disturbance that every law can bear, and that leaves smooth laws an error
DEFAULT_CONDITION = "constant"
DEFAULT_SEEDS = 3  # initial states of each law at each period; chosen
# physics steps in a control period of a mechanism with friction, contacts or other parts
MIN_STEPS = 16
RESOLUTION = 1e-11  # of the initial error; chosen, above rounding and the creep of stuck joints
PARTS = 3  # of a run, each as long as its last part, in which errors are compared
MAX_SEEDS = 10_000
RELATIVE_DEGREE = 2  # of a mechanism without a drive
KEY = (
    "|e| is the largest at the samples of the last 20 % of all runs, without noise, at the longest "
    "and the shortest control period. Orders are exponents of the control period, with 95 % "
    "intervals. Theory promises at least the order in the last column, for e and s if they differ."
)


class AccuracyTable(Tables, list[Accuracy]):
    """Accuracies of laws, shown as tables; for each plant and condition the most accurate law is
    first.
    """

    @property
    def groups(self) -> dict[str, list[Accuracy]]:
        """The rows of each plant and condition, by both names."""
        rows: dict[str, list[Accuracy]] = {}
        for row in self:
            rows.setdefault(f"{row.plant}, {row.condition}", []).append(row)
        return rows

    @property
    def tables(self) -> list[Tabular]:
        """A table for each plant and condition, with remarks on its laws."""
        tables = []
        for title, rows in self.groups.items():
            tables.append(_table(f"{title}: |e| in {rows[0].unit}", rows))
        if tables:
            last = tables.pop()
            tables.append(dataclasses.replace(last, notes=[*last.notes, KEY]))
        return tables


def _table(title: str, rows: Sequence[Accuracy]) -> Tabular:
    """Return the table of rows that share plant and condition.

    Its title also says where the laws' gains come from.
    """
    first, *_, last = rows[0].periods
    gains = {row.law: row.gains for row in rows}
    cells = []
    notes = []
    for row in rows:
        name = row.law
        if row.why:
            name += "*"
            notes.append(f"* {row.law}: {row.why}")
        law = Cell(name, colour=law_colour(row.law))
        cells.append([law, row.error(0), row.error(-1), str(row.e), str(row.s), row.theory])
    return Tabular(
        headings=[
            "law",
            f"{1e3 * first:g} ms",
            f"{1e3 * last:g} ms",
            "order of e",
            "order of s",
            "theory",
        ],
        rows=cells,
        title=", ".join(filter(None, [title, by_words(gains)])),
        notes=notes,
    )


@constrained
def orders(
    laws: str | Law | Template | Sequence[str | Law | Template],
    plants: str | Plant | Sequence[str | Plant],
    periods: Sequence[float] = PERIODS,
    conditions: str | Condition | Sequence[str | Condition] = DEFAULT_CONDITION,
    seeds: int | Iterable[int] = DEFAULT_SEEDS,
    gains: sets.NameOfSet = "tuned",
    duration: float = DURATION,
    starts: Starts | None = None,
    threads: int | None = None,
    report: Annotated[Report, Called()] = lambda done, whole: None,
) -> AccuracyTable:
    """Measure how the errors of laws fall with the control period: the order of accuracy, beside
    theory's.

        periods = 4e-3, 2e-3
        print(smc.accuracy.orders("super_twisting", "duffing", periods, seeds=1, duration=2.0))

    Args:
      laws, plants: names, or your own laws and plants, one or several.
      periods: control periods, s; two or more, and three or more for an interval.
      conditions: names, such as "coulomb" or "constant + sine", or your own conditions. Theory
        promises an order under a disturbance. The default, "constant", is a constant force of 0.2 N
        or N m.
      seeds: a number of seeds, or the seeds: initial states, and gains where a law was tuned
        several times.
      gains: set of gains for laws given by name, see `gain_sets`. A law without gains in the set
        for a plant gets its defaults, as the table's title says.
      duration: of each run, s.
      starts: initial states, see `smc.starts`. Default: within 20 % of the plant's own x0.
      threads: as in `run`.
      report: called with the work done and the whole work, in simulated steps.

    Returns:
      An `AccuracyTable`, a list of `Accuracy`. For each plant and condition laws whose runs all
      succeed come first, and of these the one with the smallest error at the shortest period.

    Raises:
      ScenarioError: fewer than two periods, a condition that sets the period, a plant whose driven
        channels have different units, or as `grid`.
    """
    descending = _longest_first(periods)
    numbers = listed(
        "seeds",
        seeds if isinstance(seeds, Iterable) else range(whole("seeds", seeds, 1, MAX_SEEDS)),
    )
    setups = []
    for plant in listed("plants", plants):
        for condition in listed_conditions(conditions):
            plant_and_condition = as_plant(plant), condition
            for law in listed_laws(laws):
                setups.append(
                    _setup(*plant_and_condition, law, descending, numbers, gains, duration, starts)
                )
    return _ordered(_run(setups, threads, report))


def _ordered(rows: AccuracyTable) -> AccuracyTable:
    """Return the rows of each plant and condition from the most accurate law on."""
    ordered = AccuracyTable()
    for group in rows.groups.values():
        ordered += sorted(group, key=lambda row: row.place)
    return ordered


def _longest_first(periods: Sequence[float]) -> Floats:
    """Return the control periods in descending order; refuse fewer than two, equal ones, and what
    is no period.
    """
    numbers = []
    for h in items_of("periods", periods):
        numbers.append(number("a period", h, above=0.0, low=MIN_TIME))
    if len(numbers) < 2 or len(set(numbers)) < len(numbers):
        raise ScenarioError(
            f"periods is {shown(periods)}: give two or more different ones in s, such as {PERIODS}"
        )
    return tuple(sorted(numbers, reverse=True))


class PeriodRun(NamedTuple):
    """The numbers of a run that its row needs."""

    parts: Mapping[
        str, Sequence[float]
    ]  # "e" and "s" -> largest magnitude in each of its last parts; inf if it failed
    failure: str | None = None  # how it failed


def _measured(trace: Trace) -> PeriodRun:
    """Return the numbers of a run, over its driven channels."""
    if trace.diverged_at is not None:
        return PeriodRun(
            dict.fromkeys(QUANTITIES, (math.inf,) * PARTS),
            failure=trace.failure or f"it diverged at {trace.diverged_at:g} s",
        )
    driven = slice(trace.scenario.plant.driven)
    count = len(trace.t) - first_sample("late", trace.t)
    sizes = {
        "e": np.abs(trace.x - trace.r)[-PARTS * count :, driven],
        "s": np.abs(trace.s)[-PARTS * count :, driven],
    }
    parts = {}
    for name, size in sizes.items():
        parts[name] = [float(part.max()) for part in np.array_split(size, PARTS)]
    return PeriodRun(parts)


class Setup(NamedTuple):
    """A law on a plant in a condition."""

    scenarios: list[Scenario]  # for each start one for each period
    periods: Floats  # s, longest first
    starts: int  # their number


def _run(setups: Sequence[Setup], threads: int | None, report: Report) -> AccuracyTable:
    """Run setups, and return a row for each."""
    scenarios = []
    for setup in setups:
        scenarios += setup.scenarios
    counted = summed(report, 0.0, sum(scenario.work for scenario in scenarios))
    runs = {}
    for k, trace in stream(scenarios, threads, counted):
        runs[k] = _measured(trace)
    rows = AccuracyTable()
    first = 0
    for setup in setups:
        last = first + len(setup.scenarios)
        rows.append(_row(setup, [runs[k] for k in range(first, last)]))
        first = last
    return rows


def _setup(
    plant: Plant,
    condition: Condition,
    law: str | Law | Template,
    periods: Floats,
    seeds: Sequence[int],
    gains: str,
    duration: float,
    starts: Starts | None,
) -> Setup:
    """Return the runs of a law on a plant in a condition.

    A law without gains in the set has its defaults.
    """
    fields = condition.on(plant, duration)
    if "control_period" in fields:
        raise ScenarioError(
            f"condition {condition.name!r} sets control_period, which accuracy varies: leave it out"
        )
    if len(units := set(plant.units[: plant.driven])) > 1:
        raise ScenarioError(
            f"{plant.name} has driven channels in {joined(sorted(units))}: "
            "give a plant with one unit"
        )
    if not isinstance(law, str) or sets.in_set(plant, law, gains):
        gain_set = gains
    else:
        gain_set = "default"

    def scenario(seed: int, h: float) -> Scenario:
        run = case(plant, law, condition, duration, gain_set, seed, starts, {"control_period": h})
        if run.resolved.integrator == "RK4":
            steps = run.steps
        else:
            steps = max(run.steps, MIN_STEPS)
        if "physics_step" in fields:
            step = fields["physics_step"]
        else:
            step = h / steps
        return dataclasses.replace(run, physics_step=step).named(run.condition)

    runs = []
    for seed in seeds:
        for h in periods:
            runs.append(scenario(seed, h))
    return Setup(runs, periods, len(seeds))


def _row(setup: Setup, runs: Sequence[PeriodRun]) -> Accuracy:
    """Return the row of a law from its runs, in the order of `Setup.scenarios`."""
    base = setup.scenarios[0]
    failures = []
    for run in runs:
        if run.failure:
            failures.append(run.failure)
    shape = setup.starts, len(setup.periods), PARTS
    floor = RESOLUTION * (max(map(abs, base.resolved.x0)) or 1.0)
    no_promise = _why_no_promise(base)
    remarks = [no_promise]
    if failures:
        first = one_line(failures[0])
        remarks.insert(0, f"{len(failures)} of {len(runs)} runs failed, the first: {first}")
    law = base.law
    scalings = {}
    for name in QUANTITIES:
        parts = np.reshape([run.parts[name] for run in runs], shape)
        theory = None
        if law.template and not no_promise:
            theory = law.template.order(name, law.gains)
        scalings[name] = scaling(parts, setup.periods, theory, floor, remarks)
    return Accuracy(
        plant=base.plant.name,
        condition=base.condition or "",
        law=law.name,
        gains=kinds(scenario.law.source for scenario in setup.scenarios),
        unit=base.plant.units[0],
        periods=setup.periods,
        runs=len(runs),
        failed=len(failures),
        floor=floor,
        **scalings,
    )


def _why_no_promise(scenario: Scenario) -> str:
    """Return why theory promises no order in the control period here; "" if it does."""
    if scenario.actuator:
        return "no promise behind a drive, which adds to the relative degree"
    if scenario.input_delay or not scenario.clock.regular:
        return "no promise with an input delay, or samples that are late or missed"
    if scenario.noise != Noise() or scenario.sensor:
        return "no promise with noise or an encoder"
    if scenario.resolved.velocity.name != "measured":
        return "no promise with an estimated velocity"
    if scenario.law.relative_degree > RELATIVE_DEGREE:
        return f"no promise for a law of a relative degree above {RELATIVE_DEGREE}"
    return ""
