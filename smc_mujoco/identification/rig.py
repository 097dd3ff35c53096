"""A rig: a real machine as data, which makes scenarios of that machine and repeats its records in
simulation. A published machine is a PublishedRig, a user's own an OwnRig.

    rig = smc.rig("qube_servo")
    rig.scenario(law="none", duration=5.0)         # a Scenario of that machine
    rig.fit(record)                                # {"theta": 95.1, ...}, percent

A rig's file states its quantities, each with unit and source, and a function that makes the fields
of a Scenario from them. Identification changes the quantities. Everything else is done with
scenarios, runs and traces.
"""

import dataclasses
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar, Self

import numpy as np

from smc_mujoco.common.aliases import AnyPath, Array, Data, Fields, Floats, Names, Numbers
from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.data import frozen_data, keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, ScenarioWarning, find, number
from smc_mujoco.common.frozen import frozen
from smc_mujoco.control.law import Law
from smc_mujoco.identification import inverse_dynamics, records
from smc_mujoco.identification.records import Columns, Record
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

Values = SimpleNamespace  # quantities by name
Source = Mapping[str, Any] | Trace  # a record as columns by name, or as a simulated run
FAILED_FIT = -1e3  # percent: fit of a replay that fails in an open loop
FALL_RANGES = 2.0  # ranges of a joint beyond which the twin of a closed loop has fallen; chosen


@frozen_data
class Quantity:
    """A number of a rig."""

    value: float  # SI
    unit: str  # such as "kg m^2" or "V s/rad"; "" for none
    source: str  # a publication and its licence, or the records it was identified from
    least: float = -np.inf  # ends of the range that identification keeps to
    most: float = np.inf


class Fall(float):
    """The fit of a closed loop that the twin cannot hold: minus infinity, which prints as "falls at
    8.4 s".
    """

    time: float  # s of the record, when a joint is first off by more than its measured range

    def __new__(cls, time: float) -> "Fall":
        fit = super().__new__(cls, -np.inf)
        fit.time = time
        return fit

    def __format__(self, spec: str) -> str:
        return f"falls at {self.time:.1f} s"

    def __str__(self) -> str:
        return format(self)

    __repr__ = __str__


@frozen_data
class RecordPart:
    """What a replay takes from a record, whatever the quantities of the rig."""

    fields: Data  # of the replay's Scenario: law, duration, signals
    # hidden numbers, positions and velocities at the start, (q + 2n,), see `Rig.hidden`
    state: Array
    largest_u: float = 0.0  # of the recorded command, in the unit of u
    # quantities that the record determines, see `PublishedRig.zero`
    zero: Numbers = dataclasses.field(default_factory=dict)
    stride: int = 1  # control periods of the replay for each sample of the record


@keyword_dataclass
class Rig:
    """A real machine, and what identification asks of it.

    Attributes:
      name, label: as in `smc.rigs()`, and what it is, in a line.
      quantities: name -> Quantity.
      machine: function of the quantities, by name, that returns fields of a Scenario: plant,
        actuator, sensor, ...
      controller: the rig's own law, if it is known. Closed-loop records are replayed with it.
      columns: names of its records' columns.
      start, score_from: s after a record's first sample, at which a replay starts, and from which
        its fit counts.
      dynamics: function of the quantities, by name, that returns a plant with the joints of the
        record, for records whose torques are predicted from the measured motion. None: records are
        replayed.
      free: names of the quantities that its records determine, which `smc.identify` finds by
        default.
      window: s, of the pieces in which identification first repeats a record; each starts from its
        measured state.
      ensemble: other parameter sets that fit about as well, each by name.
      laws: laws with gains for this machine, which a ranking compares by default.
      x0: middle of the initial states of a ranking, rad or m, (n,); None: the plant's own.
    """

    name: str
    label: str
    quantities: Mapping[str, Quantity]
    machine: Callable[[Values], Fields]
    controller: Law | None = None
    columns: Columns = dataclasses.field(default_factory=Columns)
    start: float = 0.0
    score_from: float = 0.0
    dynamics: Callable[[Values], Plant] | None = None
    free: Names = ()
    window: float = 1.0
    ensemble: tuple[Numbers, ...] = ()
    laws: tuple[Law, ...] = ()
    x0: Floats | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "quantities", frozen(self.quantities))

    def __repr__(self) -> str:
        return f"rig({self.name!r})"

    @property
    def values(self) -> dict[str, float]:
        """Quantity -> its value."""
        return {name: quantity.value for name, quantity in self.quantities.items()}

    def with_values(self, values: Numbers, source: str = "given") -> Self:
        """Return the rig with other values of some quantities, SI units, from a source."""
        changed = dict(self.quantities)
        for name, value in frozen(values).items():
            quantity = find(f"quantity of {self.name}", name, changed)
            new = number(f"{self.name}'s {name}", value, low=quantity.least, high=quantity.most)
            if new != quantity.value:
                changed[name] = dataclasses.replace(quantity, value=new, source=source)
        return dataclasses.replace(self, quantities=changed)

    def members(self) -> dict[str, "Rig"]:
        """Return name -> the rig with one of its parameter sets: "set 1" for its own, then those of
        the ensemble.
        """
        sets: dict[str, Rig] = {"set 1": self}
        for i, values in enumerate(self.ensemble, 2):
            sets[f"set {i}"] = self.with_values(values, "ensemble")
        return sets

    def scenario(self, law: Law | str | None = None, **fields: Any) -> Scenario:
        """Return a Scenario of the machine under a law, by default the rig's own controller.

        `fields`: fields of a Scenario that replace the rig's.
        """
        if law is None and self.controller is None:
            raise ScenarioError(f"the controller of {self.name} is not known: give a law")
        controlled: Fields = {"law": law or self.controller}
        return Scenario(**self.machine(Values(**self.values)) | controlled | fields)

    # How records are repeated: what an implementation gives

    def reading(self, many: Sequence[Source]) -> tuple["Rig", list[Data]]:
        """Return the rig that repeats records, and these as columns."""
        raise NotImplementedError

    def checked(self, record: Data) -> Record:
        """Return the columns of a record that a replay reads, (K,) each. Raises as `fit`."""
        raise NotImplementedError

    def part(
        self,
        record: Data,
        start: float | None = None,
        duration: float | None = None,
        closed: bool = True,
    ) -> RecordPart:
        """Return what a replay takes from a record.

        If not `closed`, it has the recorded command in any case.
        """
        raise NotImplementedError

    def repeated(
        self, part: RecordPart, rounded: bool = False, state: Array | None = None, **changes: Any
    ) -> Scenario:
        """Return the scenario that repeats a part of a record.

        `rounded`: whether the encoder rounds to counts. `state`: at the start, in place of that of
        the part. `changes`: fields of the Scenario that differ.
        """
        raise NotImplementedError

    def predicted(self, trace: Trace) -> Record:
        """Return the columns of a record that a replay gives, (K,) each."""
        raise NotImplementedError

    @property
    def units(self) -> dict[str, str]:
        """The unit of each column that `fit` compares."""
        raise NotImplementedError

    # What identification asks of it

    is_own: ClassVar[bool] = False  # whether a condition can have its values

    def guessed(self, data: Sequence[Data]) -> "Rig":
        """Return the rig with the values from which a search begins."""
        del data
        return self

    def check_named(self, line: Sequence[str]) -> None:
        """Raise ScenarioError if no quantity to find is named, with the cure in the words of a
        shell's `line`, if it has any.
        """

    def doubts(self, data: Sequence[Data]) -> list[str]:
        """Return sentences on what may be wrong with columns of records."""
        del data
        return []

    def unseen(self, name: str) -> str:
        """Return a sentence on why records do not show a quantity, and what to do; "" without."""
        del name
        return ""

    def lacks(self, replays: Any, slopes: Any) -> list[Any]:
        """Return what the model may lack, each a Lack, by replays at a solution."""
        del replays, slopes
        return []

    @property
    def cautions(self) -> list[str]:
        """Sentences on what the quantities mean."""
        return []

    def save_model(self, path: Path) -> Path:
        """Write the machine's model file with the rig's values, and return the path."""
        raise ScenarioError(f"{self.name} has no model file: cannot save {path.name}")

    def condition_fields(self) -> Fields:
        """Return the fields of a condition under which a machine has the rig's values."""
        raise ScenarioError(f"{self.name} is a rig: take rig.scenario(law), or compare(rig=...)")

    def figure(
        self,
        covariance: Array,
        record: Data,
        prediction: tuple[Record, Record, Array],
        fit: Numbers,
        path: AnyPath,
    ) -> list[Path]:
        """Draw what was identified from a record, see `Identified.figure`."""
        raise NotImplementedError

    @cached_property
    def period(self) -> float | None:
        """The control period of closed-loop records, s; None for records of an open loop, whose
        rate is their own.
        """
        return None if self.controller is None else self.scenario().control_period

    def step(self, data: Record) -> float:
        """Return the time between samples of a record, as `checked` returns it, s: in a closed loop
        the period.
        """
        return self.period or records.step_of(data[self.columns.time])

    def span(self, data: Record, start: float | None, duration: float | None) -> tuple[int, int]:
        """Return the first and the last sample of a part of a record."""
        period = self.step(data)
        first = self.first(start, period)
        last = len(data[self.columns.time]) - 1
        if duration is not None:
            shortest = round(records.MIN_SAMPLES * period, 9)
            last = min(last, first + round(number("duration", duration, low=shortest) / period))
        if last - first < records.MIN_SAMPLES:
            raise self._too_short(data, "repeat", first + records.MIN_SAMPLES + 1)
        return first, last

    def first(self, start: float | None, period: float) -> int:
        """Return the sample at which a replay starts."""
        return round((self.start if start is None else number("start", start, low=0.0)) / period)

    def _too_short(self, data: Record, what: str, samples: int) -> ScenarioError:
        """Return the error for a record of fewer samples than it takes to repeat or to score it."""
        period = self.step(data)
        lasts = len(data[self.columns.time]) * period
        return ScenarioError(
            f"the record of {self.name} lasts {lasts:.3g} s, too short to {what} it: "
            f"give at least {samples * period:.3g} s"
        )

    @property
    def hidden(self) -> Sequence[Any]:
        """What no record has at the start of a piece; nothing of a published machine."""
        return ()

    @property
    def half_plays(self) -> Sequence[float]:
        """Half of the play in which each of these stands, rad or m; 0 for what is in none."""
        return ()

    def hidden_spreads(self, record: Record, period: float) -> list[float]:
        """Return how far each hidden number varies in a record."""
        del record, period
        return []

    @property
    def springs(self) -> Sequence[str]:
        """The quantities that are the stiffness of a spring before a joint."""
        return ()

    def in_order(self, values: Numbers) -> dict[str, float]:
        """Return values as they are reported: those of which one is the larger are in order."""
        return dict(values)

    def long_steps(self, part: RecordPart) -> Fields:
        """Return the physics step with which replays of a part are tried; none for its own."""
        del part
        return {}

    def finer(self, part: RecordPart, times: int) -> RecordPart:
        """Return a part with that many times as many commands, where a delay needs them."""
        return part

    @property
    def needed(self) -> Names:
        """The columns that a record must have."""
        return self.columns.needed(self.controller is not None)

    def fit(self, record: Source) -> dict[str, float]:
        """Return how well the twin repeats a record: 100 (1 - |y - yhat| / |y - mean y|), percent.

        The norms are over all samples from `score_from` on. 100 is perfect, 0 is as good as the
        mean.

        Args:
          record: column -> values, (K,), such as a loaded npz file, see `columns`; or a trace, of
            which all samples count.

        Returns:
          Name -> percentage, for each joint's column and, in a closed loop, "u". If torques are
          predicted, for each torque. If the twin falls where the machine stands, each is a `Fall`.

        Raises:
          ScenarioError: a missing column, NaN, time that is not increasing at the rig's rate, or a
            record too short.
        """
        rig, data = self.reading([record])
        return rig.fits(data)[0]

    def fits(
        self,
        many: Sequence[Data],
        states: Sequence[Array | None] | None = None,
        **changes: Any,
    ) -> list[dict[str, float]]:
        """Return `fit` of several records, simulated in one batch; see `predictions`."""
        return self.fits_of(self.predictions(many, states, **changes))

    def fits_of(
        self, predictions: Sequence[tuple[Record, Record, Array]]
    ) -> list[dict[str, float]]:
        """Return the fit of each record whose `predictions` are given."""
        fits = []
        for predicted, measured, t in predictions:
            fit = percentages(predicted, measured)
            if self.columns.u in fit:
                fit["u"] = fit.pop(self.columns.u)
            if self.controller is not None:
                joints = {}
                for name in self.columns.x:
                    joints[name] = predicted[name]
                if fall := fallen(joints, measured, t):
                    fit = dict.fromkeys(fit, fall)
            fits.append(fit)
        return fits

    def predictions(
        self,
        many: Sequence[Data],
        states: Sequence[Array | None] | None = None,
        **changes: Any,
    ) -> list[tuple[Record, Record, Array]]:
        """Return the predicted columns, the measured columns and their times of each record, from
        `score_from` on.

        `states`: at the start of each, (2n,), in place of the measured ones. `changes`: fields of
        the replays that differ, such as their physics step.
        """
        names = self.columns
        data = list(map(self.checked, many))
        predictions = []
        if self.dynamics is not None:
            plant = self.dynamics(Values(**self.values))
            for columns in data:
                measured = inverse_dynamics.measured_torque(columns, names)
                torques = inverse_dynamics.torques(plant, columns, names)
                predictions.append((torques, measured, inverse_dynamics.times(columns, names)))
            return predictions
        parts = list(map(self.part, many))
        scenarios = []
        for part, state in zip(parts, states or [None] * len(many), strict=True):
            scenarios.append(self.repeated(part, state=state, **changes))
        with warnings.catch_warnings():  # of laws, while these commands are a record's
            warnings.simplefilter("ignore", ScenarioWarning)
            traces = run(scenarios)
        for columns, part, trace in zip(data, parts, traces, strict=True):
            period = trace.scenario.control_period * part.stride
            first = round(self.score_from / period)
            after = round((self.score_from - self.start) / period)
            count = len(trace.t[:: part.stride])
            if count < after + records.MIN_SAMPLES:
                raise self._too_short(columns, "score", first + records.MIN_SAMPLES)
            scored = slice(first, first + count - after)
            predicted = self.predicted(trace)
            for name, values in predicted.items():
                predicted[name] = values[:: part.stride][after:]
            measured = {}
            for name in predicted:
                measured[name] = columns[name][scored]
            predictions.append((predicted, measured, columns[names.time][scored]))
        return predictions


def percentages(predicted: Record, measured: Record) -> dict[str, float]:
    """Return the fit of each column, percent: 100 (1 - |y - yhat| / |y - mean y|)."""
    percent = {}
    for name, values in predicted.items():
        y = measured[name]
        with np.errstate(all="ignore"):
            spread = np.linalg.norm(y - y.mean())
            share = float(np.linalg.norm(y - values) / spread)
        if np.isfinite(share):
            percent[name] = 100.0 * (1.0 - share)
        else:
            percent[name] = FAILED_FIT
    return percent


def fallen(predicted: Record, measured: Record, t: Array) -> Fall | None:
    """Return the fall of a twin whose joints leave the measured ones by FALL_RANGES ranges; else
    None.
    """
    for name, values in predicted.items():
        error = np.nan_to_num(np.abs(values - measured[name]), nan=np.inf)
        span = np.ptp(measured[name])
        if error.max() > FALL_RANGES * span > 0.0:
            return Fall(float(t[np.argmax(error > span)]))
    return None
