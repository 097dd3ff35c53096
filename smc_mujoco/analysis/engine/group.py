"""Scenarios as groups of runs that one loop can make: their form, and their numbers in rows."""

import math
from collections import Counter
from collections.abc import Hashable, Sequence
from typing import Any, cast

import numpy as np

from smc_mujoco.analysis.engine.form import (
    ACTIVE,
    FAILED_STEP,
    FAILURE,
    PARAMETERS,
    SCORES,
    STREAM,
    Form,
    Part,
    parameters,
    row_places,
    signals,
)
from smc_mujoco.analysis.engine.scores import METRICS, RESTING
from smc_mujoco.common.jit import AtAddress, Uncompiled
from smc_mujoco.control.component import Component, gain_at
from smc_mujoco.mechanisms.hardware.drives import DriveStep, Lag, RateLimit, Series
from smc_mujoco.mechanisms.hardware.friction import Coulomb, Viscous
from smc_mujoco.mechanisms.hardware.sliding import Sliding
from smc_mujoco.metrics.catalogue import TRANSIENT_SHARE
from smc_mujoco.metrics.conventions import LAST_PART, ROUNDING, SETTLING_BAND, groups
from smc_mujoco.simulation.cfunctions import compile_component
from smc_mujoco.simulation.prepare import known_values, pause_phase, references
from smc_mujoco.simulation.run import cores
from smc_mujoco.simulation.scenario import Resolved, Scenario
from smc_mujoco.simulation.signals import Constant, Push, Signal
from smc_mujoco.simulation.state import FINE


def why_not(scenario: Scenario, metrics: Sequence[str] = (), device: str = "cpu") -> str:
    """Return what this engine cannot do of a scenario, in one sentence; "" if it does all."""
    s = scenario.resolved
    plant = s.plant
    parts = [part for part in (*s.law.parts, s.surface, s.velocity) if part is not None]
    beyond = {
        f"{plant.name} is more than one equation a joint": bool(
            plant.by_mujoco or plant.unmodelled or plant.direct or plant.measured
        ),
        "it has MuJoCo's friction, contacts or another mechanism": not (
            s.plain_equation or (s.exact_friction and not plant.free)
        ),
        "it has an actuator other than lags and rate limits": not all(
            isinstance(part, Lag | RateLimit) for part in s.actuator
        ),
        "its sensor reads at its own times, or only some joints": bool(s.readings)
        or any(sensor.on for sensor in s.sensors),
        f"its integrator is {s.integrator}": s.integrator != "RK4",
        "a law of many joints, or in C, is for the processor": device == "cuda"
        and any(part.function is None for part in _laws(s)),
        "an actuator fails": s.fault is not None,
        "a disturbance acts on a body": any(
            d.cartesian or d.air or isinstance(d, Push) for d in s.disturbance
        ),
        "its law does not compile": any(isinstance(part.function, Uncompiled) for part in parts),
    }
    moving = not all(isinstance(signal, Constant) for signal in s.references)
    for name in metrics:
        beyond[f"it does not sum up {name}"] = name not in METRICS
        beyond[f"{name} of a reference that moves"] = name in RESTING and moving
    return next((words for words, holds in beyond.items() if holds), "")


def key(scenario: Scenario) -> Hashable:
    """Return what is equal for scenarios that one loop can run together."""
    s = scenario.resolved
    return _parts(s), _fixed(s)


def _part(c: Component) -> Part:
    function = c.function
    if c.joint or isinstance(function, AtAddress):
        function = None
    return Part(function, tuple(c.gains), c.memory)


def _laws(s: Resolved) -> tuple[Part, ...]:
    return tuple(map(_part, s.law.of_channels(s.plant.driven)))


def _parts(s: Resolved) -> tuple:
    return (
        _laws(s),
        Part(s.plant.nominal, tuple(s.plant.parameters)),
        _part(s.velocity),
        None if s.surface is None else _part(s.surface),
        tuple(Part(part.stage_force, part.names, part.memory) for part in s.exact_parts),
        next((Part(sensor.read, sensor.names, sensor.memory) for sensor in s.sensors), None),
    )


def _drives(s: Resolved) -> np.ndarray:
    """Return the DriveStep of every channel, (n, fields); 0 where the force is the command."""
    factors = np.zeros((s.plant.n, len(DriveStep._fields)))
    for part, _ in s.acting:
        if isinstance(part, Series):
            factors[list(part.of)] = part.effect
    return factors


def _fixed(s: Resolved) -> tuple:
    return (
        s.plant.n,
        s.plant.driven,
        s.law.joint,
        bool(s.actuator),
        tuple(map(type, references(s))),
        None if s.feedforward is None else type(s.feedforward),
        tuple(None if error is None else type(error) for error in s.noise.errors),
        s.model == "true",
    )


class Group:
    """Runs of one form.

    Args:
      scenarios: of one `key`.
      metrics: what is scored, names of `scores.METRICS`.
      known: a form whose code is compiled already; the group's form contains it, to use that code.
    """

    def __init__(
        self, scenarios: Sequence[Scenario], metrics: Sequence[str] = (), known: Form | None = None
    ):
        resolved = [scenario.resolved for scenario in scenarios]
        first = resolved[0]
        laws, nominal, estimator, surface, frictions, sensor = _parts(first)
        n, driven, joint, drive, kinds, feedforward, errors, true_model = _fixed(first)
        clock = not all(s.clock.regular for s in resolved)
        delay = max(s.delay_steps // s.steps for s in resolved)
        slots = 1
        while slots < delay + 1 + clock:  # few sizes, each of which is compiled
            slots *= 256
        kinds_of_all: Counter[type] = Counter()
        for s in resolved:
            kinds_of_all |= Counter(map(type, s.disturbance))
        form = Form(
            n=n,
            driven=driven,
            joint=joint,
            laws=laws,
            nominal=nominal,
            estimator=estimator,
            surface=surface,
            frictions=frictions,
            sensor=sensor,
            drive=drive,
            references=kinds,
            disturbances=tuple(kinds_of_all.elements()),
            feedforward=feedforward,
            errors=errors,
            noise=any(s.noise.position or s.noise.velocity for s in resolved),
            true_model=true_model,
            jump=any(s.jump for s in resolved),
            delay=any(s.delay_steps for s in resolved),
            clock=clock,
            slots=slots,
            metrics=tuple(metrics),
        )
        self.form = _wider(form, known)
        self.scenarios = resolved
        self.places = row_places(self.form)
        self.rows = np.zeros((len(resolved), self.places.size))
        self._points: list[np.ndarray] = []
        self._starts: dict[int, int] = {}  # of series in the tables
        for row, s in zip(self.rows, resolved, strict=True):
            self._fill(row, s)
        self.tables = np.concatenate([*self._points, np.zeros(1)])

    def run(self, rows: np.ndarray, threads: int | None = None, device: str = "cpu") -> np.ndarray:
        """Return the scores of rows, (runs, SCORES + metrics); NaN after a failure."""
        if device == "cpu":
            from smc_mujoco.analysis.engine import cpu

            return cpu.run(self.form, rows, self.tables, cores(threads))
        from smc_mujoco.analysis.engine import gpu

        return gpu.run(self.form, rows, self.tables)

    def scored(self, device: str, threads: int | None) -> list[tuple[list[float], float | None]]:
        """Return the metrics of every scenario, and the time of its failure, s, or None."""
        found = []
        for s, scores in zip(self.scenarios, self.run(self.rows, threads, device), strict=True):
            time = None
            if scores[FAILURE] != FINE:
                time = float(scores[FAILED_STEP] * s.physics_step)
            found.append((scores[SCORES:].tolist(), time))
        return found

    def _put(self, row: np.ndarray, name: str, values: Any) -> None:
        first = self.places.at[name]
        row[first : first + np.size(values)] = np.ravel(values)

    def _fill(self, row: np.ndarray, s: Resolved) -> None:
        pause, pause_samples = s.clock.pauses(s.control_period, s.physics_step)
        t = np.arange(s.samples + 1) * s.control_period
        settings = {
            "samples": s.samples,
            "steps": s.steps,
            "step": s.physics_step,
            "period": s.control_period,
            "delay": s.delay_steps,
            "jump_step": s.jump_step,
            "seed": s.seed,
            "uses_model": s.model != "none",
            "sigma_x": s.noise.position,
            "sigma_v": s.noise.velocity,
            "jitter": s.clock.jitter_steps(s.physics_step),
            "missed": s.clock.missed,
            "pause": pause,
            "pause_samples": pause_samples,
            "pause_phase": pause_phase(s) if pause else 0,
            "bands": _bands(s),
            "early": np.searchsorted(t, TRANSIENT_SHARE * (1.0 - ROUNDING) * t[-1]),
            "late": np.searchsorted(t, t[-1] - LAST_PART * (1 + ROUNDING) * t[-1]),
            "x0": s.x0,
            "v0": s.v0,
            "limits": s.limits,
            "known": known_values(s),
            "estimator": list(s.velocity.gains.values()),
            "surface": list(s.surface.gains.values()) if s.surface else [],
        }
        for name, step in (("before", 0), ("after", max(s.jump_step, 0))):
            values = vars(s.plant.values(s.factors(step)))
            settings[name] = [values[parameter] for parameter in s.plant.parameters]
        if self.form.drive:
            settings["drives"] = _drives(s)
        if self.form.sensor:
            settings["hinges"] = [unit == "rad" for unit in s.plant.units]
            settings["sensor"] = s.sensors[0].numbers(cast(Any, None))
        for name, values in settings.items():
            self._put(row, name, values)
        self._fill_frictions(row, s)
        self._fill_gains(row, s.law)
        self._fill_signals(row, s)

    def _fill_frictions(self, row: np.ndarray, s: Resolved) -> None:
        for name, kind, value in (("levels", Coulomb, "level"), ("damping", Viscous, "b")):
            for part in s.friction:
                if isinstance(part, kind):
                    places = self.places.at[name] + np.array(part.channels(s.plant))
                    row[places] += getattr(part, value)
        for j, part in enumerate(s.exact_parts):
            first = self.places.at[f"friction {j}"]
            size = 1 + len(part.names)
            for place, i in enumerate(part.channels(s.plant)):
                numbers = part.parameters(place) if isinstance(part, Sliding) else ()
                row[first + size * i] = 1.0
                row[first + size * i + 1 : first + size * i + 1 + len(numbers)] = numbers

    def _fill_gains(self, row: np.ndarray, law: Component) -> None:
        for i, part in enumerate(law.of_channels(self.form.driven)):
            gains = []
            for value in part.gains.values():
                gains += [gain_at(value, j) for j in range(self._columns)]
            self._put(row, f"law {i}", gains)
            if self.form.laws[i].function is None:
                self._put(row, f"address {i}", compile_component(part).address)

    @property
    def _columns(self) -> int:
        """The number of values of a gain in the row of a law."""
        return self.form.driven if self.form.joint else 1

    def gain_columns(self, name: str) -> list[int]:
        """Return where a gain of the law is in a row: of every channel."""
        found = []
        for i, part in enumerate(self.form.laws):
            first = self.places.at[f"law {i}"] + part.names.index(name) * self._columns
            found += range(first, first + self._columns)
        return found

    def _fill_signals(self, row: np.ndarray, s: Resolved) -> None:
        named: dict[str, tuple[Signal | None, int]] = {"feedforward": (s.feedforward, 0)}
        for i, signal in enumerate(references(s)):
            named[f"references {i}"] = signal, 0
        for i, signal in enumerate(s.noise.errors):
            named[f"errors {i}"] = signal, 0
        free = list(self.form.disturbances)
        for i, signal in enumerate(s.disturbance):
            place = free.index(type(signal))
            free[place] = type(None)
            named[f"disturbances {place}"] = signal, s.noise_stream(i)
        for name, kind in signals(self.form).items():
            signal, stream = named.get(name, (None, 0))
            if signal is None:
                continue
            numbers = np.zeros(PARAMETERS + len(parameters(kind)) + 2 * kind.series)
            numbers[ACTIVE] = 1.0
            numbers[STREAM] = stream
            values = list(signal.parameters().values())
            if kind.series:
                values += [self._table(signal.data), signal.data.shape[1]]
            numbers[PARAMETERS:] = values
            self._put(row, name, numbers)

    def _table(self, data: np.ndarray) -> int:
        """Return where the points of a series begin in the tables."""
        if id(data) not in self._starts:
            self._starts[id(data)] = sum(points.size for points in self._points)
            self._points.append(data.ravel())
        return self._starts[id(data)]


def _bands(s: Resolved) -> np.ndarray:
    """Return the settling band of every channel, (n,); NaN where a reference moves."""
    goals = np.zeros(s.plant.n)
    for i, signal in enumerate(s.references):
        goals[i] = math.nan
        if isinstance(signal, Constant):
            goals[i] = signal.amplitude
    bands = np.abs(np.subtract(s.x0, goals))
    for group in groups(s):
        channels = list(group.channels)
        bands[channels] = SETTLING_BAND * (bands[channels].max() or 1.0)
    return bands


def _wider(form: Form, other: Form | None) -> Form:
    """Return a form that also has what another one of the same `key` has, for a loop for both."""
    if other is None:
        return form
    flags = {}
    for name in ("noise", "jump", "delay", "clock"):
        flags[name] = getattr(form, name) or getattr(other, name)
    kinds = Counter(form.disturbances) | Counter(other.disturbances)
    return form._replace(
        **flags, disturbances=tuple(kinds.elements()), slots=max(form.slots, other.slots)
    )
