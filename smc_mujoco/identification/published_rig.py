"""A published machine as a rig, and the replays of its records, by its own controller where that is
known.
"""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from smc_mujoco.common import annexes
from smc_mujoco.common.aliases import AnyPath, Array, Data, Fields, Names, Numbers
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, find
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.registry import Catalogue, added, discover, imported
from smc_mujoco.identification import records
from smc_mujoco.identification.records import Record
from smc_mujoco.identification.residual_figure import residual_figure
from smc_mujoco.identification.rig import RecordPart, Rig, Source, Values
from smc_mujoco.simulation.force_bounds import default_u_max
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.time_series import TimeSeries
from smc_mujoco.simulation.trace import Trace


@keyword_dataclass
class PublishedRig(Rig):
    """A published machine.

    Attributes:
      commands: function of a record and the index of the start, that returns what the rig adds to
        its controller's u from there on, (K,). None: only the column of the feedforward, if there
        is one.
      zero: function of the quantities, by name, and a record that returns quantities which differ
        between records, such as angles from where an encoder was switched on.
      identified_from: names of the records that its quantities were identified from.
      published: name of a parameter set -> its values of quantities by name, and its source under
        "source".
      about: licence and history of the data, and what the twin predicts well or badly.
    """

    commands: Callable[[Record, int], Array] | None = None
    zero: Callable[[Values, Record], dict[str, float]] | None = None
    identified_from: Names = ()
    published: Mapping[str, Data] = dataclasses.field(default_factory=dict)
    about: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "published", frozen(self.published))

    def __repr__(self) -> str:
        return f"rig({self.name!r})"

    def set(self, name: str) -> "PublishedRig":
        """Return the rig with a published parameter set."""
        chosen = dict(find(f"parameter set of {self.name}", name, self.published))
        return self.with_values(chosen, chosen.pop("source"))

    def replay(
        self, record: Data, start: float | None = None, duration: float | None = None
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
        record: Data,
        start: float | None = None,
        duration: float | None = None,
        closed: bool = True,
    ) -> RecordPart:
        """Return what a replay takes from a record.

        If not `closed`, it has the recorded command in any case.
        """
        if self.dynamics is not None:
            raise ScenarioError(
                f"records of {self.name} are not replayed, as their torques are predicted: use fit"
            )
        data = self.checked(record)
        names = self.columns
        period = self.step(data)
        first, last = self.span(data, start, duration)
        times = (period * np.arange(last + 1 - first)).tolist()

        def signal(values: Array) -> TimeSeries:
            return TimeSeries(times, values[: len(times)].tolist())

        fields: Fields = {"duration": times[-1]}
        if self.controller is not None and closed:
            if self.commands is not None:
                fed = self.commands(data, first)
            else:
                fed = data.get(names.feedforward, np.zeros(last + 1))[first:]
            reference = signal(data[names.reference][first:])
            fields |= {"law": self.controller, "reference": reference, "feedforward": signal(fed)}
        else:
            command = signal(data[names.u][first:])
            fields |= {"law": "none", "feedforward": command, "control_period": period}
        zero = {}
        if self.zero:
            zero = self.zero(Values(**self.values), data)
        return RecordPart(
            fields=fields,
            state=np.concatenate(records.state(data, names, period, first)),
            largest_u=float(np.abs(data[names.u][first : last + 1]).max()),
            zero=zero,
        )

    def repeated(
        self, part: RecordPart, rounded: bool = False, state: Array | None = None, **changes: Any
    ) -> Scenario:
        """Return the scenario that repeats a part of a record.

        `rounded`: whether the encoder rounds to counts. `state`: at the start, (2n,), in place of
        the measured one. `changes`: fields of the Scenario that differ.
        """
        fields = self.machine(Values(**self.values | dict(part.zero)))
        sensor = fields.get("sensor")
        x, v = np.split(part.state if state is None else state, 2)
        if sensor is not None:
            if not rounded:
                fields["sensor"] = dataclasses.replace(sensor, counts=np.inf)
            if not self.columns.state:
                x = x - sensor.bias
        if self.controller is None:
            fields.pop("physics_step", None)
            if fields.get("actuator") is None and fields.get("u_max") is None:
                # the machine has had this command
                fields["u_max"] = max(part.largest_u, default_u_max(fields["plant"]))
        return Scenario.recorded(
            **fields | dict(part.fields) | {"x0": tuple(x), "v0": tuple(v)} | changes
        )

    def measured(
        self, record: Data, start: float | None = None, duration: float | None = None
    ) -> Trace:
        """Return a record as a trace of the machine, for figures and films beside those of twins;
        see `replay`.

        x and u are measured, v follows from cubics through the positions, and what was not measured
        is 0.
        """
        scenario = self.replay(record, start, duration)
        data = self.checked(record)
        names = self.columns
        period = scenario.control_period
        count = scenario.samples + 1
        first = self.first(start, period)
        part = slice(first, first + count)
        x, v, u, r, nothing = np.zeros((5, count, scenario.plant.n))
        for i, name in enumerate(names.x):
            x[:, i] = data[name][part]
            v[:, i] = records.rate(data[name], period)[part]
        if scenario.sensors:
            x -= scenario.sensors[0].bias  # of all joints
        u[:, 0] = data[names.u][part]
        if names.reference in data:
            r[:, 0] = data[names.reference][part]
        zero: Fields = dict.fromkeys(("s", "d", "force", "reaction"), nothing)
        t = period * np.arange(count)
        return Trace(t=t, x=x, v=v, u=u, applied=u.copy(), r=r, **zero, scenario=scenario)

    def checked(self, record: Data) -> Record:
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

    def reading(self, many: Sequence[Source]) -> tuple["Rig", list[Data]]:
        """Return the rig that repeats records, and these as columns.

        It repeats a trace by its law, from its start.
        """
        traces = []
        logs = []
        for record in many:
            if isinstance(record, Trace):
                traces.append(record)
            else:
                logs.append(record)
        if not traces:
            return self, logs
        law = traces[0].scenario.law
        if logs or any(trace.scenario.law != law for trace in traces):
            raise ScenarioError(
                "records are traces of one law, or columns: give one kind at a time"
            )
        plant = self.machine(Values(**self.values))["plant"].name
        for trace in traces:
            if trace.scenario.plant.name != plant:
                raise ScenarioError(
                    f"the trace is one of {trace.scenario.plant.name} and the plant of {self.name} "
                    f"is {plant}: give one of its own"
                )
        positions = tuple(f"position of {name}" for name in self.columns.x)
        rates = tuple(f"velocity of {name}" for name in self.columns.x)
        rig = dataclasses.replace(
            self,
            controller=None if law.name == "none" else law,
            commands=None,
            dynamics=None,
            start=0.0,
            score_from=0.0,
            columns=dataclasses.replace(self.columns, state=positions + rates, torque=()),
        )
        return rig, [records.of_trace(trace, rig.columns) for trace in traces]

    def predicted(self, trace: Trace) -> Record:
        """Return the columns of a record that a replay gives, (K,) each, without the columns'
        offset.
        """
        by_column = records.positions(trace, self.columns)
        if trace.scenario.law.name != "none":
            by_column[self.columns.u] = trace.u[:, 0]
        return by_column

    def figure(
        self,
        covariance: Array,
        record: Data,
        prediction: tuple[Record, Record, Array],
        fit: Numbers,
        path: AnyPath,
    ) -> list[Path]:
        """Draw what was identified from a record, see `Identified.figure`."""
        del covariance, record
        predicted, measured, t = prediction
        return residual_figure(
            self.label, t, measured, {"twin": predicted}, {"twin": fit}, self.units, path
        )


@functools.cache
def rig_catalogue() -> Catalogue[PublishedRig]:
    """Return every rig of smc_mujoco.evidence.rigs.machines and of other packages, by name."""
    machines = {}
    if annexes.installed("evidence"):
        machines = discover("smc_mujoco.evidence.rigs.machines", PublishedRig)
    return Catalogue(machines, added("smc_mujoco.rigs", imported(PublishedRig, lambda rig: True)))


def rig(name: str, **values: float) -> PublishedRig:
    """Return the rig `name`, with some of its quantities changed.

        rig = smc.rig("emps")
        print(rig)

    Returns:
      A `Rig`: its `quantities`, and the plant and the parts that they make.

    Raises:
      ScenarioError: an unknown rig or quantity, or a value out of its range.
    """
    return find("rig", name, rig_catalogue()).with_values(values)


def rigs() -> list[str]:
    """List the names that `rig` knows.

        smc.rigs()

    Returns:
      Names, in alphabetical order.
    """
    return list(rig_catalogue())
