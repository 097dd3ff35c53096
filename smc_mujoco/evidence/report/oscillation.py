"""Chattering in a report: predicted by harmonic balance behind a lagging actuator, and measured in
runs.
"""

import dataclasses
import math
import statistics

from smc_mujoco.analysis.chattering import chattering
from smc_mujoco.analysis.step_halving import step_halving
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import read_json, write_json
from smc_mujoco.evidence.report.plan import GAINS, Report, Work
from smc_mujoco.mechanisms.hardware.drives import Lag
from smc_mujoco.metrics.limit_cycle import NO_CYCLE, channel_cycle
from smc_mujoco.simulation.grid import case
from smc_mujoco.simulation.run import run

LAG = 0.01  # s, of the actuator
DURATION = 8.0  # s, of the runs
PREDICTED = (
    "amplitude",
    "frequency",
    "third_harmonic",
    "uncertainty",
)  # fields of a `Chattering` that are kept


@dataclasses.dataclass(frozen=True, kw_only=True)
class Oscillation:
    """The limit cycle of s of one law on one plant; NaN where there is none."""

    plant: str
    law: str
    amplitude: float  # predicted, in the unit of s
    frequency: float  # predicted, Hz
    measured_amplitude: float  # of a run
    measured_frequency: float
    third_harmonic: float  # like `uncertainty`, how good the prediction is; see `Chattering`
    uncertainty: float
    marked: bool  # whether the run's numbers depend on the physics step, see `step_halving`

    @property
    def error(self) -> float:
        """The error of the predicted amplitude in percent of the measured one; NaN where one of
        them is missing.
        """
        return 100.0 * (self.amplitude / self.measured_amplitude - 1.0)


def oscillations(work: Work) -> tuple[Oscillation, ...]:
    """Return the limit cycles of all laws on all plants behind a lagging actuator, plant by plant."""
    laws = work.plan.laws
    by_plant = work.kept(
        "chattering",
        "plants",
        [(plant,) for plant in work.plan.plants],
        [laws, LAG, DURATION, GAINS],
        lambda plant, report: _on(plant, laws, work.threads, report),
        lambda rows, path: write_json(path, [dataclasses.asdict(row) for row in rows]),
        lambda path: [Oscillation(**entry) for entry in read_json(path)],
    )
    return tuple(row for rows in by_plant for row in rows)


def _on(
    plant: str, laws: tuple[str, ...], threads: int | None, report: Report
) -> list[Oscillation]:
    """Return the limit cycles on a plant.

    Laws whose chattering cannot be predicted are left out.
    """
    rows = []
    cases = [
        case(plant, law, "nominal", DURATION, GAINS, changes={"actuator": Lag(LAG)}) for law in laws
    ]
    traces = run(cases, threads)
    changes = step_halving(traces, 0, threads)
    for done, (scenario, trace, change) in enumerate(zip(cases, traces, changes, strict=True)):
        report(done, len(cases))
        try:
            cycle = chattering(scenario)
        except ScenarioError:
            continue
        if trace.diverged_at is not None:
            amplitude, frequency = NO_CYCLE
        else:
            amplitude, frequency = channel_cycle(trace)
        predicted = {name: getattr(cycle, name) for name in PREDICTED}
        measured = {
            "measured_amplitude": amplitude,
            "measured_frequency": frequency,
            "marked": change.marked,
        }
        rows.append(Oscillation(plant=plant, law=scenario.law.name, **predicted, **measured))
    return rows


def sentence(rows: tuple[Oscillation, ...]) -> str:
    """Return in a sentence how many limit cycles were predicted, how many were found, and how large
    the error is.
    """
    both = [row for row in rows if not math.isnan(row.error)]
    calm = sum(math.isnan(row.amplitude) and math.isnan(row.measured_amplitude) for row in rows)
    text = f"Of {len(rows)} pairs of plant and law {len(both)} are predicted to oscillate and do; {calm} do neither"
    if wrong := len(rows) - len(both) - calm:
        text += f"; for {wrong} prediction and run disagree"
    if not both:
        return f"{text}."
    errors = [abs(row.error) for row in both]
    median = statistics.median(errors)
    largest = max(errors)
    return f"{text}. The median error of the predicted amplitude is {median:.2g} %, the largest {largest:.0f} %."
