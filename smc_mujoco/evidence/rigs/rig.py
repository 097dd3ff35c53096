"""A rig: a real machine as data, which makes scenarios of that machine and repeats its records in
simulation.

    rig = smc.rig("qube_servo")
    rig.scenario(law="none", duration=5.0)         # a Scenario of that machine
    rig.fit(record)                                # {"theta": 95.1, ...}, percent

A rig's file states its quantities, each with unit and source, and a function that makes the fields
of a Scenario from them. Identification changes the quantities. Everything else is done with
scenarios, runs and traces.
"""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from smc_mujoco.common.catalogue import Catalogue, added, discover, imported
from smc_mujoco.common.errors import ScenarioError, find, number
from smc_mujoco.common.frozen import frozen
from smc_mujoco.control.law import Law
from smc_mujoco.evidence.rigs import inverse, records
from smc_mujoco.evidence.rigs.predictions import Prediction
from smc_mujoco.evidence.rigs.records import Columns, Record
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario, default_u_max
from smc_mujoco.simulation.time_series import TimeSeries
from smc_mujoco.simulation.trace import Trace

Values = SimpleNamespace  # quantities by name
Source = Mapping[str, Any] | Trace  # a record as columns by name, or as a simulated run
# percent: if radians improve a fit by this, and beyond this, its angles are in degrees; chosen
RADIANS_GAIN = 50.0
FAILED_FIT = -1e3  # percent: fit of a replay that fails in an open loop
FALL_RANGES = (
    2.0  # ranges of a measured joint, beyond which the twin of a closed loop has fallen; chosen
)


@dataclasses.dataclass(frozen=True)
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

    # s of the record, when a joint is first further from the measured one than that joint's whole
    # range
    time: float

    def __new__(cls, time: float) -> "Fall":
        made = super().__new__(cls, -np.inf)
        made.time = time
        return made

    def __format__(self, spec: str) -> str:
        return f"falls at {self.time:.1f} s"

    def __str__(self) -> str:
        return format(self)

    __repr__ = __str__


@dataclasses.dataclass(frozen=True)
class Part:
    """What a replay takes from a record, whatever the quantities of the rig."""

    fields: Mapping[str, Any]  # of the replay's Scenario: law, duration, signals
    state: np.ndarray  # measured positions and velocities at the start, (2n,)
    largest_u: float  # of the recorded command, in the unit of u
    zero: Mapping[str, float]  # quantities that the record determines, see `Rig.zero`


@dataclasses.dataclass(frozen=True, kw_only=True)
class Rig:
    """A real machine.

    Attributes:
      name, label: as in `smc.rigs()`, and what it is, in a line.
      quantities: name -> Quantity.
      machine: function of the quantities, by name, that returns fields of a Scenario: plant,
        actuator, sensor, ...
      controller: the rig's own law, if it is known. Closed-loop records are replayed with it.
      columns: names of its records' columns.
      commands: function of a record and the index of the start, that returns what the rig adds to
        its controller's u from there on, (K,). None: only the column of the feedforward, if there
        is one.
      zero: function of the quantities, by name, and a record that returns quantities which differ
        between records, such as angles from where an encoder was switched on.
      start, score_from: s after a record's first sample, at which a replay starts, and from which
        its fit counts.
      dynamics: function of the quantities, by name, that returns a plant with the joints of the
        record, for records whose torques are predicted from the measured motion. None: records are
        replayed.
      identified_from: names of the records that its quantities were identified from, see
        `twin_figures`.
      free: names of the quantities that its records determine, which `smc.identify` finds by
        default.
      window: s, of the pieces in which identification first repeats a record; each starts from its
        measured state.
      published: name of a parameter set -> its values of quantities by name, and its source under
        "source".
      ensemble: other parameter sets that fit about as well, each by name.
      laws: laws with gains for this machine, which a ranking compares by default.
      x0: middle of the initial states of a ranking, rad or m, (n,); None: the plant's own.
      prediction: figures that are predicted where records cannot be replayed, see
        `evidence.rigs.predictions`.
      about: licence and history of the data, and what the twin predicts well or badly.
    """

    name: str
    label: str
    quantities: Mapping[str, Quantity]
    machine: Callable[[Values], dict[str, Any]]
    controller: Law | None = None
    columns: Columns = dataclasses.field(default_factory=Columns)
    commands: Callable[[Record, int], np.ndarray] | None = None
    zero: Callable[[Values, Record], dict[str, float]] | None = None
    start: float = 0.0
    score_from: float = 0.0
    dynamics: Callable[[Values], Plant] | None = None
    identified_from: tuple[str, ...] = ()
    free: tuple[str, ...] = ()
    window: float = 1.0
    published: Mapping[str, Mapping[str, Any]] = dataclasses.field(default_factory=dict)
    ensemble: tuple[Mapping[str, float], ...] = ()
    laws: tuple[Law, ...] = ()
    x0: tuple[float, ...] | None = None
    prediction: Prediction | None = None
    about: str = ""

    def __post_init__(self) -> None:
        for name in ("quantities", "published"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def __repr__(self) -> str:
        return f"rig({self.name!r})"

    @property
    def values(self) -> dict[str, float]:
        """Quantity -> its value."""
        return {name: quantity.value for name, quantity in self.quantities.items()}

    def with_values(self, values: Mapping[str, float], source: str = "given") -> "Rig":
        """Return the rig with other values of some quantities, SI units, that come from a source."""
        changed = dict(self.quantities)
        for name, value in values.items():
            known = find(f"quantity of {self.name}", name, changed)
            new = number(f"{self.name}'s {name}", value, low=known.least, high=known.most)
            if new != known.value:
                changed[name] = dataclasses.replace(known, value=new, source=source)
        return dataclasses.replace(self, quantities=changed)

    def set(self, name: str) -> "Rig":
        """Return the rig with a published parameter set."""
        chosen = dict(find(f"parameter set of {self.name}", name, self.published))
        return self.with_values(chosen, chosen.pop("source"))

    def members(self) -> dict[str, "Rig"]:
        """Return name -> the rig with one of its parameter sets: "set 1" for its own, then those of
        the ensemble.
        """
        sets = {
            f"set {i + 2}": self.with_values(values, "ensemble")
            for i, values in enumerate(self.ensemble)
        }
        return {"set 1": self} | sets

    def scenario(self, law: Law | str | None = None, **fields: Any) -> Scenario:
        """Return a Scenario of the machine under a law, by default the rig's own controller.

        `fields`: fields of a Scenario that replace the rig's.
        """
        if law is None and self.controller is None:
            raise ScenarioError(f"the controller of {self.name} is not known: give a law")
        controlled: dict[str, Any] = {"law": law or self.controller}
        return Scenario(**self.machine(Values(**self.values)) | controlled | fields)

    def replay(
        self, record: Mapping[str, Any], start: float | None = None, duration: float | None = None
    ) -> Scenario:
        """Return the scenario that repeats a record from its measured state on.

        With the rig's own controller the loop is closed: only references and feedforward come from
        the record, and u is the controller's. Without one, the recorded command is the feedforward
        of the law "none". The encoder does not round, because the sample in which a count changes
        cannot be predicted.

        Args:
          record: column -> values, (K,); see `columns`.
          start: s after the first sample; None: the rig's `start`.
          duration: s; None: to the end of the record.

        Raises:
          ScenarioError: a start before the record, fewer than 50 samples to repeat, or what `fit`
            raises of a record.
        """
        return self.repeated(self.part(record, start, duration))

    def part(
        self,
        record: Mapping[str, Any],
        start: float | None = None,
        duration: float | None = None,
        closed: bool = True,
    ) -> Part:
        """Return what a replay takes from a record.

        If not `closed`, it has the recorded command in any case.
        """
        if self.dynamics is not None:
            raise ScenarioError(
                f"records of {self.name} are not replayed, as their torques are predicted: use fit"
            )
        data = self.checked(record)
        period = self.step(data)
        first = round((self.start if start is None else number("start", start, low=0.0)) / period)
        last = len(data[self.columns.time]) - 1
        if duration is not None:
            shortest = round(records.MIN_SAMPLES * period, 9)
            last = min(last, first + round(number("duration", duration, low=shortest) / period))
        if last - first < records.MIN_SAMPLES:
            raise self._too_short(data, "repeat", first + records.MIN_SAMPLES + 1)
        times = (period * np.arange(last + 1 - first)).tolist()

        def signal(values: np.ndarray) -> TimeSeries:
            return TimeSeries(times, values[: len(times)].tolist())

        law = self.controller if closed else None
        fields: dict[str, Any] = {"law": law or "none", "duration": times[-1]}
        if law is None:
            fields |= {
                "feedforward": signal(data[self.columns.u][first:]),
                "control_period": period,
            }
        else:
            added = data.get(self.columns.feedforward, np.zeros(last + 1))[first:]
            fields["reference"] = signal(data[self.columns.reference][first:])
            fields["feedforward"] = signal(
                added if self.commands is None else self.commands(data, first)
            )
        largest = float(np.abs(data[self.columns.u][first : last + 1]).max())
        state = np.concatenate(records.state(data, self.columns, period, first))
        if self.zero:
            zero = self.zero(Values(**self.values), data)
        else:
            zero = {}
        return Part(fields=fields, state=state, largest_u=largest, zero=zero)

    def _too_short(self, data: Record, what: str, samples: int) -> ScenarioError:
        """Return the error for a record of fewer samples than it takes to repeat or to score it."""
        period = self.step(data)
        count = len(data[self.columns.time])
        return ScenarioError(
            f"the record of {self.name} lasts {count * period:.3g} s, too short to {what} it: give at least "
            f"{samples * period:.3g} s"
        )

    def repeated(
        self, part: Part, rounded: bool = False, state: np.ndarray | None = None, **changes: Any
    ) -> Scenario:
        """Return the scenario that repeats a part of a record.

        `rounded`: whether the encoder rounds to counts. `state`: at the start, (2n,), in place of
        the measured one. `changes`: fields of the Scenario that differ.
        """
        fields = self.machine(Values(**self.values | dict(part.zero)))
        sensor = fields.get("sensor")
        if sensor is not None and not rounded:
            fields["sensor"] = sensor = dataclasses.replace(sensor, counts=np.inf)
        x, v = np.split(part.state if state is None else state, 2)
        if sensor and not self.columns.state:
            bias = sensor.bias
        else:
            bias = 0.0
        if self.controller is None:
            fields.pop("physics_step", None)
            if (
                fields.get("actuator") is None and fields.get("u_max") is None
            ):  # the machine has had this command
                fields["u_max"] = max(part.largest_u, default_u_max(fields["plant"]))
        return Scenario.recorded(
            **fields | dict(part.fields) | {"x0": tuple(x - bias), "v0": tuple(v)} | changes
        )

    def measured(
        self, record: Mapping[str, Any], start: float | None = None, duration: float | None = None
    ) -> Trace:
        """Return a record as a trace of the machine, for figures and films beside those of twins;
        see `replay`.

        x and u are measured, v follows from cubics through the positions, and what was not measured
        is 0.
        """
        scenario = self.replay(record, start, duration)
        data = self.checked(record)
        period = scenario.control_period
        n = scenario.plant.n
        first = round((self.start if start is None else start) / period)
        count = scenario.samples
        part = slice(first, first + count + 1)
        if scenario.sensor:
            bias = scenario.sensor.bias
        else:
            bias = 0.0
        x, v, u, r = np.zeros((4, count + 1, n))
        for i, name in enumerate(self.columns.x):
            x[:, i] = data[name][part] - bias
            v[:, i] = records.rate(data[name], period)[part]
        u[:, 0] = data[self.columns.u][part]
        if self.columns.reference in data:
            r[:, 0] = data[self.columns.reference][part]
        zero: dict[str, Any] = {
            name: np.zeros((count + 1, n)) for name in ("s", "d", "force", "reaction")
        }
        t = period * np.arange(count + 1)
        return Trace(t=t, x=x, v=v, u=u, applied=u.copy(), r=r, **zero, scenario=scenario)

    @property
    def needed(self) -> tuple[str, ...]:
        """The columns that a record must have."""
        return self.columns.needed(self.controller is not None)

    def checked(self, record: Mapping[str, Any]) -> Record:
        """Return the columns of a record that a replay reads, (K,) each. Raises as `fit`."""
        return records.checked(record, self.columns, self.period, self.name)

    @property
    def units(self) -> dict[str, str]:
        """The unit of each column that `fit` compares."""
        if self.dynamics is not None:
            return dict.fromkeys(self.columns.torque, "N m")
        scenario = self.scenario("none")
        joints = dict(zip(self.columns.x, scenario.plant.units, strict=False))
        return joints | {self.columns.u: scenario.efforts[0]}

    @functools.cached_property
    def period(self) -> float | None:
        """The control period of closed-loop records, s; None for records of an open loop, whose
        rate is their own.
        """
        if self.controller is None:
            return None
        return self.scenario().control_period

    def step(self, data: Record) -> float:
        """Return the time between samples of a record, as `checked` returns it, s: in a closed loop
        the period.
        """
        return self.period or records.step_of(data[self.columns.time])

    def reading(self, many: Sequence[Source]) -> tuple["Rig", list[Mapping[str, Any]]]:
        """Return the rig that repeats records, and these as columns.

        It repeats a trace by its law, from its start.
        """
        traces = [record for record in many if isinstance(record, Trace)]
        if not traces:
            return self, [record for record in many if not isinstance(record, Trace)]
        if len(traces) < len(many) or len({trace.scenario.law for trace in traces}) > 1:
            raise ScenarioError(
                "records are traces of one law, or columns: give one kind at a time"
            )
        plant = self.machine(Values(**self.values))["plant"].name
        if other := next(
            (trace.scenario.plant.name for trace in traces if trace.scenario.plant.name != plant),
            None,
        ):
            raise ScenarioError(
                f"the trace is one of {other} and the plant of {self.name} is {plant}: give one of its own"
            )
        law = traces[0].scenario.law
        state = tuple(
            f"{kind} of {name}" for kind in ("position", "velocity") for name in self.columns.x
        )
        rig = dataclasses.replace(
            self,
            controller=None if law.name == "none" else law,
            commands=None,
            dynamics=None,
            start=0.0,
            score_from=0.0,
            columns=dataclasses.replace(self.columns, state=state, torque=()),
        )
        return rig, [records.of_trace(trace, rig.columns) for trace in traces]

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
          ScenarioError: a missing column, NaN, time that is not increasing at the rig's rate, a
            record too short, or angles in degrees.
        """
        rig, data = self.reading([record])
        fit = rig.fits(data)[0]
        rig.refuse_degrees(data[0], fit)
        return fit

    def refuse_degrees(self, record: Mapping[str, Any], fit: Mapping[str, float]) -> None:
        """Raise ScenarioError if a record has degrees in place of radians.

        It has degrees if it fits far better with all its angles, those of a joint, or the
        references taken as degrees. A record that fits well as it is, by `fit`, is not simulated
        again.
        """
        if (
            min(fit.values()) >= 100.0 - RADIANS_GAIN
            or "rad" not in self.scenario("none").plant.units
        ):
            return
        joints = self.columns.x
        references = self.columns.references
        pairs = [(x, *references[i : i + 1]) for i, x in enumerate(joints)]
        sets = (
            (*joints, *references),
            *((name,) for name in (*joints, *references)),
            *pairs,
            references,
        )
        there = [tuple(name for name in names if name in record) for names in sets]
        suspects = [names for names in dict.fromkeys(there) if names]
        others = self.fits([records.in_radians(record, self.columns, names) for names in suspects])
        best = max(range(len(suspects)), key=lambda i: min(others[i].values()))
        if min(others[best].values()) > max(RADIANS_GAIN, min(fit.values()) + RADIANS_GAIN):
            if best == 0:
                which = "angles"
            else:
                which = f"values of {' and '.join(suspects[best])}"
            raise ScenarioError(
                f"the {which} of the record of {self.name} look like degrees, as it fits by "
                f"{records.percent(others[best])} with them in radians and by {records.percent(fit)} as they are: "
                "give radians"
            )

    def fits(
        self,
        many: Sequence[Mapping[str, Any]],
        states: Sequence[np.ndarray | None] | None = None,
        **changes: Any,
    ) -> list[dict[str, float]]:
        """Return `fit` of several records, simulated in one batch, without the check for degrees;
        see `predictions`.
        """
        predictions = self.predictions(many, states, **changes)
        fits = [percentages(*prediction[:2]) for prediction in predictions]
        if self.controller is not None:
            for fit, (predicted, measured, t) in zip(fits, predictions, strict=True):
                if (
                    fall := fallen({name: predicted[name] for name in self.columns.x}, measured, t)
                ) is not None:
                    fit.update(dict.fromkeys(fit, fall))
        return [
            {"u" if name == self.columns.u else name: value for name, value in fit.items()}
            for fit in fits
        ]

    def predictions(
        self,
        many: Sequence[Mapping[str, Any]],
        states: Sequence[np.ndarray | None] | None = None,
        **changes: Any,
    ) -> list[tuple[Record, Record, np.ndarray]]:
        """Return the predicted columns, the measured columns and their times of each record, from
        `score_from` on.

        `states`: at the start of each, (2n,), in place of the measured ones. `changes`: fields of
        the replays that differ, such as their physics step.
        """
        data = [self.checked(record) for record in many]
        names = self.columns
        if self.dynamics is not None:
            plant = self.dynamics(Values(**self.values))
            return [
                (
                    inverse.torques(plant, one, names),
                    inverse.measured(one, names),
                    inverse.times(one, names),
                )
                for one in data
            ]
        pairs = zip(many, states or [None] * len(many), strict=True)
        traces = run(
            [self.repeated(self.part(record), state=state, **changes) for record, state in pairs]
        )
        replayed = []
        for columns, trace in zip(data, traces, strict=True):
            period = trace.scenario.control_period
            first = round(self.score_from / period)
            after = round((self.score_from - self.start) / period)
            if len(trace.t) < after + records.MIN_SAMPLES:
                raise self._too_short(columns, "score", first + records.MIN_SAMPLES)
            predicted = {name: values[after:] for name, values in self.predicted(trace).items()}
            parts = {
                name: columns[name][first : first + len(values)]
                for name, values in predicted.items()
            }
            replayed.append(
                (predicted, parts, columns[names.time][first : first + len(trace.t) - after])
            )
        return replayed

    def idle(self, record: Mapping[str, Any]) -> dict[str, float]:
        """Return the fit of a machine that does nothing, as a baseline for twins.

        Names and unit are those of `fit`.

        In a closed loop its joints are where their references are, and u is the feedforward. In an
        open loop it stays where the record is at `score_from`. If torques are predicted, they are
        0.
        """
        data = self.checked(record)
        columns = self.columns
        if self.dynamics is not None:
            measured = inverse.measured(data, columns)
            return percentages(
                {name: np.zeros_like(values) for name, values in measured.items()}, measured
            )
        first = round(self.score_from / self.step(data))
        measured = {name: data[name][first:] for name in columns.x}
        if self.period is None:
            return percentages(
                {name: np.full_like(values, values[0]) for name, values in measured.items()},
                measured,
            )
        references = dict(zip(columns.x, columns.references, strict=False))
        zero = np.zeros(len(data[columns.time]))
        predicted = {name: data.get(references.get(name, ""), zero)[first:] for name in columns.x}
        predicted["u"], measured["u"] = (
            data.get(columns.feedforward, zero)[first:],
            data[columns.u][first:],
        )
        return percentages(predicted, measured)

    def predicted(self, trace: Trace) -> Record:
        """Return the columns of a record that a replay gives, (K,) each, without the columns'
        offset.
        """
        by_column = records.positions(trace, self.columns)
        return by_column | (
            {} if trace.scenario.law.name == "none" else {self.columns.u: trace.u[:, 0]}
        )


def percentages(predicted: Record, measured: Record) -> dict[str, float]:
    """Return the fit of each column, percent: 100 (1 - |y - yhat| / |y - mean y|)."""
    percent = {}
    for name, values in predicted.items():
        y = measured[name]
        with np.errstate(all="ignore"):
            share = float(np.linalg.norm(y - values) / np.linalg.norm(y - y.mean()))
        if np.isfinite(share):
            percent[name] = 100.0 * (1.0 - share)
        else:
            percent[name] = FAILED_FIT
    return percent


def fallen(predicted: Record, measured: Record, t: np.ndarray) -> Fall | None:
    """Return the fall of a twin whose joints leave the measured ones by FALL_RANGES ranges; else
    None.
    """
    for name, values in predicted.items():
        error = np.nan_to_num(np.abs(values - measured[name]), nan=np.inf)
        span = np.ptp(measured[name])
        if error.max() > FALL_RANGES * span > 0.0:
            return Fall(float(t[np.argmax(error > span)]))
    return None


@functools.cache
def catalogue() -> Catalogue[Rig]:
    """Return every rig of smc_mujoco.evidence.rigs.machines and of other packages, by name."""
    machines = discover("smc_mujoco.evidence.rigs.machines", Rig)
    return Catalogue(machines, added("smc_mujoco.rigs", imported(Rig, lambda rig: True)))


def rig(name: str, **values: float) -> Rig:
    """Return the rig `name`, with some of its quantities changed.

    Raises:
      ScenarioError: an unknown rig or quantity, or a value out of its range.
    """
    return find("rig", name, catalogue()).with_values(values)


def rigs() -> list[str]:
    """List the names that `rig` knows."""
    return list(catalogue())
