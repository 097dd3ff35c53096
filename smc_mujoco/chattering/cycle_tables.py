"""Limit cycles as predicted and as measured in runs: the table of `chatter`, and its JSON."""

import math
from collections.abc import Sequence

from smc_mujoco.analysis.step_halving import MARK, NOTE, StepChange
from smc_mujoco.chattering.prediction import Chattering
from smc_mujoco.common.aliases import Fields, Pair
from smc_mujoco.common.tabular import Cell, Tabular
from smc_mujoco.common.text import number
from smc_mujoco.draw import colouring
from smc_mujoco.simulation.scenario import Scenario


def table(
    scenarios: Sequence[Scenario],
    channel: int,
    cycles: Sequence[Chattering],
    measured: Sequence[Pair],
    changes: Sequence[StepChange],
) -> Tabular:
    """Return predicted and measured limit cycles of a channel (amplitude of s, Hz), a line for each
    scenario.
    """
    plant = scenarios[0].plant
    last = "coupling" if plant.driven > 1 else "third harmonic"
    unit = f"{plant.units[channel]}/s"
    heads = [f"s predicted ({unit})", f"s measured ({unit})"]
    heads = ["law", *heads, "predicted (Hz)", "measured (Hz)", "±", last]
    rows = []
    for scenario, cycle, (amplitude, frequency), change in zip(
        scenarios, cycles, measured, changes, strict=True
    ):
        law = Cell(scenario.law.name, colour=colouring.law_colour(scenario.law.name))
        mark = MARK if change.marked else ""
        sizes = number(cycle.amplitude), number(amplitude) + mark
        rates = number(cycle.frequency), number(frequency) + mark
        share = cycle.coupling if plant.driven > 1 else cycle.third_harmonic
        off = "irregular" if cycle.uncertainty > 1.0 else _share(cycle.uncertainty)
        rows.append((law, *sizes, *rates, off, _share(share)))
    notes = [NOTE] if any(change.marked for change in changes) else []
    return Tabular(headings=heads, rows=rows, title=f"chattering of {plant.name}", notes=notes)


def cycle_rows(
    scenarios: Sequence[Scenario],
    cycles: Sequence[Chattering],
    measured: Sequence[Pair],
    changes: Sequence[StepChange],
) -> list[Fields]:
    """Return predicted cycles of scenarios, measured amplitudes of s and frequencies, and their
    changes, as JSON data.
    """
    rows = []
    for scenario, cycle, (amplitude, frequency), change in zip(
        scenarios, cycles, measured, changes, strict=True
    ):
        row = {"plant": scenario.plant.name, "law": scenario.law.name}
        gains = dict(scenario.law.gains)
        row |= {"gains": gains, **vars(cycle)}
        row["gain"] = [cycle.gain.real, cycle.gain.imag]
        row["response"] = [cycle.response.real, cycle.response.imag]
        row["uncertainty"] = cycle.uncertainty
        row |= {"measured_amplitude": amplitude, "measured_frequency": frequency}
        row |= {"half_step_changes": vars(change), "marked": change.marked}
        rows.append(row)
    return rows


def _share(share: float) -> str:
    """Return a share in percent; "" for NaN."""
    if math.isnan(share):
        return ""
    return f"{100 * share:.0f} %" if share <= 1.0 else "> 100 %"
