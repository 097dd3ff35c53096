"""Scenarios as groups of runs that one loop can make: their form, and their numbers in rows."""

import functools
import math
from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np

from smc_mujoco.analysis.engine import noise
from smc_mujoco.analysis.engine.form import (
    FAILED_STEP,
    FAILURE,
    LOGGED,
    SCORES,
    SETTING,
    ChannelFunction,
    Form,
    PartAt,
    Settings,
    SignalAt,
    layout,
)
from smc_mujoco.analysis.engine.scores import CYCLE, RESTING, cycles, holds, summed_up
from smc_mujoco.common import fingerprint, indices
from smc_mujoco.common.aliases import Fields
from smc_mujoco.common.jit import AtAddress, Uncompiled
from smc_mujoco.control.component import Component
from smc_mujoco.mechanisms.hardware.backlash import Backlash
from smc_mujoco.mechanisms.hardware.beside_joint import BesideJoint
from smc_mujoco.mechanisms.hardware.drives import advanced
from smc_mujoco.mechanisms.hardware.elastic_joint import ElasticJoint
from smc_mujoco.mechanisms.layout import moves_alone
from smc_mujoco.metrics.conventions import SETTLING_BAND, groups, late_time, settling_band
from smc_mujoco.metrics.fold import first_sample
from smc_mujoco.simulation.cfunctions import compile_component
from smc_mujoco.simulation.prepare import compensation, nominal_values, references, run_of, settings
from smc_mujoco.simulation.run import cores
from smc_mujoco.simulation.scenario import Resolved, Scenario
from smc_mujoco.simulation.signals import Constant, Push, Signal
from smc_mujoco.simulation.state import FINE

LOG_NUMBERS = 8_000_000  # of the logs that are kept at once, 64 MB
# fields in which forms of one key may differ, at their least
VARYING: Fields = {
    "noise": False,
    "jump": False,
    "delay": False,
    "clock": False,
    "fails": False,
    "drops": False,
    "slots": 1,
}


def why_not(scenario: Scenario, metrics: Sequence[str] = (), device: str = "cpu") -> str:
    """Return what this engine cannot do of a scenario, in one sentence; "" if it does all."""
    s = scenario.resolved
    plant = s.plant
    beyond = {
        f"{plant.name} is more than one equation a joint": bool(
            plant.by_mujoco or plant.unmodelled or plant.direct or plant.measured
        ),
        "it has friction by a formula beside a play or a force that is held over a step": (
            not s.exact_friction and _has_brakes(s) and _needs_implicit(s)
        ),
        "it has drag, which grows with the speed": any(
            part.added_to_model.per_speed for part in s.friction
        ),
        "it has MuJoCo's friction, contacts, another mechanism, or a play on joints that do not "
        "move alone": not (
            s.plain_equation or (s.exact_friction and not plant.free) or steps_implicitly(s)
        ),
        "it has an elastic joint beside a play, LuGre or another force that is held over a step": (
            steps_implicitly(s) and any(isinstance(part, ElasticJoint) for part in s.actuator)
        ),
        "it has an actuator other than lags, rate limits, and springs or plays before joints": (
            not all(isinstance(part, _beside(s)) or lags(part) for part in s.actuator)
        ),
        f"its integrator is {s.integrator}": s.integrator
        != ("implicitfast" if steps_implicitly(s) else "RK4"),
    }
    for name in filter(holds, metrics):
        sentence = (
            f"{name} needs the force of friction or of a play on the joint, as a trace has it"
        )
        beyond[sentence] = steps_implicitly(s)
    return first_of(beyond) or why_not_sampled(s, metrics, device)


def why_not_sampled(s: Resolved, metrics: Sequence[str], device: str) -> str:
    """Return what a scenario needs of a sample that this engine cannot do, by any integrator."""
    parts = _components(s)
    beyond = {
        "a law of many joints, or in C, is for the processor": device == "cuda"
        and any(_part(law).function is None for law in s.law.of_channels(s.plant.driven)),
        "a function of its user's may index beyond its memory, which only the processor checks": (
            device == "cuda" and not all(map(_indexes_within, _users(s)))
        ),
        "a Feedforward leads through a play": bool(getattr(s.feedforward, "plays", ())),
        "a disturbance acts on a body": any(map(_on_a_body, s.disturbance)),
        "numbers of its parts jump": len(s.machines) > 1,
        "its rotors do not start beside their joints": any(
            isinstance(part, BesideJoint) and (part.lead or part.lead_rate) for part in s.actuator
        ),
        "its law does not compile": any(isinstance(part.function, Uncompiled) for part in parts),
    }
    moving = not all(isinstance(signal, Constant) for signal in s.references)
    for name in metrics:
        of_log = name in CYCLE
        beyond[f"{name} needs a log, which only the processor writes"] = of_log and device == "cuda"
        beyond[f"it does not sum up {name}"] = not (of_log or summed_up(name))
        only = f"the engine sums up {name} only for a reference at rest"
        beyond[only] = name in RESTING and moving
    return first_of(beyond)


def lags(part: Any) -> bool:
    """Say whether a part is a lag or a rate limit, which the callback steps itself."""
    return part.in_callback and part.force is None


def _on_a_body(disturbance: Any) -> bool:
    return disturbance.cartesian or disturbance.air or isinstance(disturbance, Push)


def _components(s: Resolved) -> list[Any]:
    """Return the parts of the law, its surface and its estimator."""
    return [part for part in (*s.law.parts, s.surface, s.velocity) if part is not None]


def first_of(beyond: Mapping[str, bool]) -> str:
    """Return the first of some sentences that holds; "" if none does."""
    for words, applies in beyond.items():
        if applies:
            return words
    return ""


def _users(s: Resolved) -> list[tuple[Any, int]]:
    """Return the functions of a run that are not this package's, each with its memory."""
    functions = []
    for part in _components(s):
        functions.append((part.function, part.memory))
    for signal in (*s.references, *s.disturbance, s.feedforward_signal, *s.noise.errors):
        if signal is not None:
            functions.append((type(signal).value, signal.memory))
    for part in s.sensors:
        functions.append((part.read, part.memory))
    for part in s.exact_parts:
        functions.append(part.written)
    for part in s.compensated:
        functions.append((part.steady, part.memory))
    for part in _held(s):
        functions.append((part.force, part.memory))
    users = []
    for function, memory in functions:
        if not fingerprint.ours(function):
            users.append((function, memory))
    return users


def _indexes_within(user: tuple[Any, int]) -> bool:
    return indices.constant_indices(*user)


def steps_implicitly(s: Resolved) -> bool:
    """Return whether the loop has a step of implicitfast for it: for plays and for frictions whose
    force is held over a step, of joints that move alone. Dampers and MuJoCo's own dry friction may
    be beside them.
    """
    if s.contact or s.mechanism != "equation" or s.exact_friction or s.plant.rubs:
        return False
    return _needs_implicit(s) and not _has_brakes(s) and moves_alone(s.plant)


def _needs_implicit(s: Resolved) -> bool:
    """Return whether it has plays, or frictions whose force is held over a step."""
    return bool(_held(s)) or any(isinstance(part, Backlash) for part in s.actuator)


def _has_brakes(s: Resolved) -> bool:
    """Return whether it has frictions by a formula."""
    return any(part.brake is not None for part in s.friction)


def _beside(s: Resolved) -> type[BesideJoint]:
    """Return what the loop may have between a rotor and its joint."""
    return Backlash if steps_implicitly(s) else ElasticJoint


def group_key(scenario: Scenario) -> Hashable:
    """Return what is equal for scenarios that one loop can run together."""
    return form_of(scenario.resolved)._replace(**VARYING, disturbances=())


def _rotors(s: Resolved) -> tuple[int, ...]:
    """Return the channels whose drive turns a rotor."""
    turning = []
    for i, chain in enumerate(s.drive_train.chains):
        if any(isinstance(part, BesideJoint) for part in chain):
            turning.append(i)
    return tuple(turning)


def form_of(s: Resolved, metrics: Sequence[str] = ()) -> Form:
    """Return the form of one run."""
    all_channels = tuple(range(s.plant.n))
    drives = []
    for part in _drives(s):
        drives.append(ChannelFunction(advanced, part.names, part.memory, all_channels))
    sensors = []
    for part in s.sensors:
        sensor = ChannelFunction(part.read, part.names, part.memory, all_channels)
        sensors.append(sensor)
    laws = []
    for law in s.law.of_channels(s.plant.driven):
        laws.append(_part(law)._replace(channels=all_channels if law.joint else ()))
    frictions = [_on_channels(part, part.stage_force, s) for part in s.exact_parts]
    on_rotors = []
    for part in _held(s):
        on_side = on_rotors if part.side == "motor" else frictions
        on_side.append(_on_channels(part, part.force, s))
    compensated = []
    for part in s.compensated:
        compensated.append(_on_channels(part, part.steady, s))
    rotors = _rotors(s)
    motor_side = set()
    for part in s.sensors:
        if part.side == "motor":
            motor_side.update(part.channels(s.plant))
    clock = not s.clock.regular
    # few sizes, each of which is compiled
    slots = _power(256, s.delay_steps // s.steps + 1 + clock)
    past = max(_power(16, _oldest(s)), 16) if s.readings else 0
    return Form(
        n=s.plant.n,
        driven=s.plant.driven,
        joint=s.law.joint,
        nominal=ChannelFunction(s.plant.nominal, tuple(s.plant.parameters)),
        laws=tuple(laws),
        estimator=_part(s.velocity),
        surface=s.surface and _part(s.surface),
        sensor=sensors[0] if sensors else None,
        drive=drives[0] if drives else None,
        rotors=rotors,
        motor_side=tuple(i for i in rotors if i in motor_side),
        frictions=tuple(frictions),
        rotor_frictions=tuple(on_rotors),
        compensated=tuple(compensated),
        compensates_on=compensation(s).get("compensates_on", 0),
        references=tuple(map(type, references(s))),
        disturbances=tuple(Counter(map(type, s.disturbance)).elements()),
        feedforward=s.feedforward_signal and type(s.feedforward_signal),
        errors=tuple(None if error is None else type(error) for error in s.noise.errors),
        noise=bool(s.noise.position or s.noise.velocity),
        true_model=s.model == "true",
        jump=bool(s.jump),
        delay=bool(s.delay_steps),
        clock=clock,
        fails=s.fault is not None,
        drops=any(part.dropout for part in s.sensors),
        implicit=steps_implicitly(s),
        slots=slots,
        past=past,
        metrics=tuple(metrics),
    )


def _on_channels(part: Any, function: Any, s: Resolved) -> ChannelFunction:
    """Return a function of a part, on the part's channels."""
    channels = tuple(part.channels(s.plant))
    return ChannelFunction(function, part.names, part.memory, channels)


def _power(base: int, least: int) -> int:
    """Return the smallest power of a base, 1 or more, that is at least so much."""
    power = 1
    while power < least:
        power *= base
    return power


def _part(c: Component) -> ChannelFunction:
    function = c.function
    if c.joint or isinstance(function, AtAddress):
        function = None
    return ChannelFunction(function, tuple(c.gains), c.memory)


def _drives(s: Resolved) -> list[Any]:
    """Return the callback's drives; each is of some channels."""
    return [part for part, kind in s.acting if kind == "act"]


def _held(s: Resolved) -> list[Any]:
    """Return the frictions whose force is held over a step."""
    if s.exact_friction:
        return []
    return [part.held for part in s.friction if part.held is not None]


def _oldest(s: Resolved) -> int:
    """Return how many physics steps the states reach back that its sensors may give."""
    longest = 0.0
    for part in s.sensors:
        channels = part.channels(s.plant)
        late = part.delay + part.skew * max(channels)
        longest = max(longest, late + (part.period or 0.0))
    return math.ceil(longest / s.physics_step) + 2


def wider(form: Form, other: Form) -> Form:
    """Return a form that also has what another one of the same `key` has, for a loop for both."""
    flags = {}
    for name in VARYING:
        flags[name] = max(getattr(form, name), getattr(other, name))
    kinds = Counter(form.disturbances) | Counter(other.disturbances)
    return form._replace(**flags, disturbances=tuple(kinds.elements()))


class FormGroup:
    """Runs of one form.

    Args:
      scenarios: of one `key`.
      metrics: what is scored, which `scores.summed_up`.
      known: forms that are compiled already; the group's form contains them, to use their code.
    """

    least = 1  # runs that are worth a group

    def __init__(
        self, scenarios: Sequence[Scenario], metrics: Sequence[str] = (), known: Sequence[Form] = ()
    ):
        self.scenarios = [scenario.resolved for scenario in scenarios]
        forms = dict.fromkeys(self.form_of(s, metrics) for s in self.scenarios)
        self.form = functools.reduce(wider, [*forms, *known])
        self.layout = layout(self.form)
        self.rows = np.zeros((len(scenarios), self.layout.row_size))
        self._points: list[np.ndarray] = []
        self._starts: dict[int, int] = {}  # of series in the tables
        for row, s in zip(self.rows, self.scenarios, strict=True):
            self._fill(row, s)
        self.tables = np.concatenate([*self._points, np.zeros(1)])

    @staticmethod
    def key_of(scenario: Scenario) -> Hashable:
        """Return what is equal for scenarios that one group can run."""
        return group_key(scenario)

    def form_of(self, s: Resolved, metrics: Sequence[str]) -> Form:
        """Return the form of one run."""
        return form_of(s, metrics)

    def run(self, rows: np.ndarray, threads: int | None = None, device: str = "cpu") -> np.ndarray:
        """Return the scores of rows, (runs, SCORES + metrics); NaN after a failure."""
        if device == "cpu":
            from smc_mujoco.analysis.engine import cpu

            return cpu.run_rows(self.form, rows, self.tables, cores(threads))
        from smc_mujoco.analysis.engine import gpu

        return gpu.run_rows(self.form, rows, self.tables)

    def scored(self, device: str, threads: int | None) -> list[tuple[list[float], float | None]]:
        """Return the metrics of every scenario, and the time of its failure, s, or None."""
        logs = not set(CYCLE).isdisjoint(self.form.metrics)
        runs = self._logged(threads) if logs else self.run(self.rows, threads, device)
        scored = []
        for s, scores in zip(self.scenarios, runs, strict=True):
            time = None
            if scores[FAILURE] != FINE:
                time = float(scores[FAILED_STEP] * s.physics_step)
            scored.append((scores[SCORES:].tolist(), time))
        return scored

    def _logged(self, threads: int | None) -> np.ndarray:
        """Return the scores of all runs, of which some at a time write a log for the metrics that
        need one.
        """
        from smc_mujoco.analysis.engine import cpu

        rows = self.rows.copy()
        rows[:, SETTING.logging] = 1.0
        shape = int(rows[:, SETTING.samples].max()) + 1, self.form.n, len(LOGGED)
        size = max(1, LOG_NUMBERS // math.prod(shape))
        parts = []
        for first in range(0, len(rows), size):
            batch = rows[first : first + size]
            logs = np.zeros((len(batch), *shape))
            scores = cpu.run_rows(self.form, batch, self.tables, cores(threads), logs)
            for run, row, log in zip(scores, batch, logs, strict=True):
                if run[FAILURE] == FINE:
                    self._put_cycle(run, row, log)
            parts.append(scores)
        return np.concatenate(parts)

    def _put_cycle(self, scores: np.ndarray, row: np.ndarray, log: np.ndarray) -> None:
        """Write the numbers of a run's limit cycle into its scores."""
        driven = log[: int(row[SETTING.samples]) + 1, : self.form.driven]
        cycle = cycles(driven, int(row[SETTING.late]), float(row[SETTING.period]))
        for name, value in zip(CYCLE, cycle, strict=True):
            if name in self.form.metrics:
                scores[SCORES + self.form.metrics.index(name)] = value

    def _fill(self, row: np.ndarray, s: Resolved) -> None:
        row[: len(SETTING)] = _settings(s)
        places = self.layout.row
        _put(row, places.x0, s.x0)
        _put(row, places.v0, s.v0)
        _put(row, places.limits, s.limits)
        scales = _scales(s)
        bands = np.array([settling_band(s, scale) for scale in scales])
        _put(row, places.bands, bands)
        _put(row, places.shares, SETTLING_BAND * scales)
        _put(row, places.nominal, nominal_values(s))
        first = s.plant.values(s.factors(0))
        _put(row, places.before, [*vars(first).values()])
        later = s.plant.values(s.factors(max(s.jump_step, 0)))
        _put(row, places.after, [*vars(later).values()])
        if self.form.noise:
            row[places.draw] = noise.drawing().address
        if s.sensors:
            _put(row, places.hinges, [unit == "rad" for unit in s.plant.units])
        self._fill_law(row, s)
        self._fill_hardware(row, s)
        self._fill_signals(row, s)

    def _fill_law(self, row: np.ndarray, s: Resolved) -> None:
        _put(row, self.layout.estimator.numbers, s.velocity.numbers(1))
        if self.layout.surface and s.surface:
            _put(row, self.layout.surface.numbers, s.surface.numbers(1))
        laws = s.law.of_channels(s.plant.driven)
        for law_at, law in zip(self.layout.laws, laws, strict=True):
            _put(row, law_at.numbers, law.numbers(self._columns))
            if law_at.part.function is None:
                row[law_at.address] = compile_component(law).address

    def _fill_hardware(self, row: np.ndarray, s: Resolved) -> None:
        parts: list[tuple[PartAt | None, Any]] = []
        for part in _drives(s):
            parts.append((self.layout.drive, part))
        for part in s.sensors:
            parts.append((self.layout.sensor, part))
        if self.form.rubs:  # else MuJoCo has them
            held = _held(s)
            on_joints = [part for part in held if part.side == "link"]
            on_rotors = [part for part in held if part.side == "motor"]
            parts += zip(self.layout.frictions, (*s.exact_parts, *on_joints), strict=True)
            parts += zip(self.layout.rotor_frictions, on_rotors, strict=True)
        parts += zip(self.layout.compensated, s.compensated, strict=True)
        for part_at, part in parts:
            assert part_at is not None  # one loop's scenarios have the same parts
            names = len(part.names)
            last = part_at.numbers + self.form.n * names
            table = row[part_at.numbers : last].reshape(-1, names)
            channels = [*part.channels(s.plant)]
            table[channels] = part.numbers(run_of(s, part))
            if part.counted:
                damping = table[channels, part.names.index(part.counted)]
                row[np.add(self.layout.row.counted, self._bodies(part, s))] += damping
        for part in s.sensors if self.form.past else ():
            for i in part.channels(s.plant):
                row[self.layout.row.periods + i] = part.period or 0.0
                row[self.layout.row.delays + i] = part.delay + part.skew * i
        if s.compensated:
            numbers = compensation(s)
            _put(row, self.layout.row.compensation, (numbers["share"], numbers["eps"]))
        self._fill_rotors(row, s)
        places = self.layout.row.damping, self.layout.row.levels
        for part in s.friction if self.form.rubs else ():
            added = part.added_to_model
            for first, value in zip(places, (added.damping, added.dry), strict=True):
                row[np.add(first, self._bodies(part, s))] += value

    def _bodies(self, part: Any, s: Resolved) -> list[int]:
        """Return which bodies a friction acts on: its joints, or their rotors."""
        channels = [*part.channels(s.plant)]
        if part.side == "link":
            return channels
        return [self.form.n + self.form.rotors.index(i) for i in channels]

    def _fill_rotors(self, row: np.ndarray, s: Resolved) -> None:
        width = len(self.form.beside_names)
        for part in s.actuator:
            if not isinstance(part, BesideJoint):
                continue
            numbers = part.numbers(run_of(s, part))
            for i, values in zip(part.channels(s.plant), numbers, strict=True):
                k = self.form.rotors.index(i)
                _put(row, self.layout.row.beside + width * k, values)

    @property
    def _columns(self) -> int:
        """The number of values of a gain in the row of a law."""
        return self.form.driven if self.form.joint else 1

    def gain_columns(self, name: str) -> list[int]:
        """Return where a gain of the law is in a row: of every channel."""
        columns = []
        for law_at in self.layout.laws:
            place = law_at.part.names.index(name)
            first = law_at.numbers + place * self._columns
            columns += range(first, first + self._columns)
        return columns

    def _fill_signals(self, row: np.ndarray, s: Resolved) -> None:
        places = self.layout
        self._fill_signal(row, places.feedforward, s.feedforward_signal)
        for place, signal in zip(places.references, references(s), strict=True):
            self._fill_signal(row, place, signal)
        for place, signal in zip(places.errors, s.noise.errors, strict=True):
            self._fill_signal(row, place, signal)
        free = list(places.disturbances)
        for i, signal in enumerate(s.disturbance):
            place = next(candidate for candidate in free if candidate.kind is type(signal))
            free.remove(place)
            self._fill_signal(row, place, signal, s.noise_stream(i))

    def _fill_signal(
        self, row: np.ndarray, at: SignalAt | None, signal: Signal | None, stream: int = 0
    ) -> None:
        if at is not None and signal is not None:
            values = [1.0, stream, *signal.parameters().values()]
            if signal.series:
                values += [self._table(signal.data), signal.data.shape[1]]
            _put(row, at.numbers, values)

    def _table(self, data: np.ndarray) -> int:
        """Return where the points of a series begin in the tables."""
        if id(data) not in self._starts:
            self._starts[id(data)] = sum(points.size for points in self._points)
            self._points.append(data.ravel())
        return self._starts[id(data)]


def _put(row: np.ndarray, first: int, values: Any) -> None:
    row[first : first + len(values)] = values


def _settings(s: Resolved) -> Settings:
    t = np.arange(s.samples + 1) * s.control_period
    numbers = settings(s) | {
        "samples": s.samples,
        "jump_step": s.jump_step,
        "early": first_sample("early", t),
        "late": first_sample("late", t, late_time(s)),
        "logging": False,
    }
    return Settings(*(numbers[name] for name in Settings._fields))


def _scales(s: Resolved) -> np.ndarray:
    """Return the scale of every channel's group, (n,); NaN where a reference moves."""
    goals = np.zeros(s.plant.n)
    for i, signal in enumerate(s.references):
        goals[i] = math.nan
        if isinstance(signal, Constant):
            goals[i] = signal.amplitude
    scales = np.abs(np.subtract(s.x0, goals))
    for group in groups(s):
        channels = list(group.channels)
        scales[channels] = scales[channels].max() or 1.0
    return scales
