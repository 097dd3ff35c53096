"""Accuracy in a report: error over control period without noise, and the order of each law beside theory's."""

from collections.abc import Iterator

from smc_mujoco.evidence.accuracy.accuracy import AccuracyTable, accuracy, load
from smc_mujoco.evidence.accuracy.scaling import ORDER_BAND
from smc_mujoco.evidence.report import words
from smc_mujoco.evidence.report.plan import GAINS, Report, Work
from smc_mujoco.studies.cache import cached

CONDITIONS = ("constant", "coulomb")  # a steady force, and dry friction


def accuracies(work: Work) -> AccuracyTable:
    """Return the accuracy of all laws on the plan's plants, condition by condition."""
    plan = work.plan

    def compute(pair: tuple[str, str], report: Report) -> AccuracyTable:
        plant, condition = pair
        return cached(
            work.folder / f"accuracy-{plant}-{condition}.json",
            [plan.laws, plan.periods, plan.accuracy_starts, GAINS],
            lambda: accuracy(
                plan.laws,
                plant,
                plan.periods,
                condition,
                plan.accuracy_starts,
                GAINS,
                threads=work.threads,
                report=report,
            ),
            AccuracyTable.save,
            load,
        )

    pairs = [(plant, condition) for plant in plan.accurate for condition in CONDITIONS]
    return AccuracyTable(row for rows in work.each("accuracy", "tables", pairs, compute) for row in rows)


def sentences(table: AccuracyTable) -> Iterator[str]:
    """Yield a sentence for each plant and condition: how many laws have the promised order."""
    for title, rows in table.groups.items():
        promised = [row.s for row in rows if row.s.theory is not None]
        kept = sum(order.as_promised for order in promised)
        plant, _, condition = title.partition(", ")
        yield (
            f"{words.plant(plant)}, {condition}: the order of s is within {ORDER_BAND:g} of theory’s for {kept} of "
            f"{len(promised)} laws."
        )
