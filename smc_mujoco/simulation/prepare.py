"""Preparation: what a scenario names, compiled, and which scenarios can share a Batch.

    prepared = prepare(scenario)            # functions, mechanism, key: once a run
    record[i], arrays = pack(prepared, log) # the record that the callback reads, see state.py

What does not compile runs in the reference loop; `prepared.why_not` says why.
"""

import dataclasses
import math
from collections.abc import Hashable, Mapping
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.jit import AtAddress, Function, NotCompilable
from smc_mujoco.control import joint_law
from smc_mujoco.control.component import at
from smc_mujoco.control.properties import read_by
from smc_mujoco.mechanisms.custom.nominal_model import NominalModel, native_coriolis, native_jacobian
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.plant import Native
from smc_mujoco.simulation import native, state
from smc_mujoco.simulation.model import Mechanism, mechanism, with_values
from smc_mujoco.simulation.scenario import Resolved, Scenario
from smc_mujoco.simulation.signals import PerChannel, Push, Recorded, Signal

PERFECT = Encoder(counts=math.inf)
ONE_OF_ALL = ("laws", "references")  # tables that a record has only where channels differ
DATA_BYTES, CHANNEL_BYTES = 176 * 2**10, 2 * 2**10  # of an mjData, measured: what it takes, and a channel more
READING_BYTES = 67  # measured: of a delayed sensor's history, per channel and reading, in mjData and in the Batch


@dataclasses.dataclass(frozen=True, slots=True)
class Functions:
    """The compiled functions of a scenario. `nominal` is None for a model that MuJoCo itself computes."""

    laws: tuple[Function | AtAddress, ...]  # one for all channels, or one for each driven channel
    surface: Function | AtAddress | None
    estimator: Function | AtAddress
    nominal: Function | None
    references: tuple[Function, ...]  # one for all channels, or one for each driven channel
    feedforward: Function | None
    disturbances: tuple[Function, ...]
    friction: Function | None  # by a formula
    errors: tuple[Function | None, Function | None]  # of measurement: of position and velocity


@dataclasses.dataclass(frozen=True, slots=True)
class Prepared:
    """A scenario that is ready to run.

    Attributes:
      scenario: as it was given.
      functions: compiled; None where one does not compile.
      why_not: what does not compile, in one sentence.
      mechanism: its compiled model and channels, which scenarios of the same structure share.
      key: equal for scenarios that can share a Batch.
    """

    scenario: Scenario
    functions: Functions | None
    why_not: str
    mechanism: Mechanism
    key: Hashable

    @property
    def bytes(self) -> int:
        """Memory of its simulation: log, mjData, record, and the history of a delayed sensor."""
        s = self.scenario.resolved
        surface = 0 if s.surface is None else s.surface.memory
        memories = s.law.memory + surface + s.velocity.memory + sum(d.memory for d in s.disturbance)
        numbers = 200 + s.plant.n * (memories + s.input_delay / s.control_period + 20)
        numbers += joint_law.stored_dtype(s.plant.n).itemsize / 8 if s.law.joint else 0
        of_channel = state.LOG.itemsize * (s.samples + 1) + CHANNEL_BYTES + READING_BYTES * s.readings
        return int(of_channel * s.plant.n + 8 * numbers + state.SIMULATION.itemsize + DATA_BYTES)


def prepare(scenario: object) -> Prepared:
    """Return a scenario with its functions and its mechanism compiled.

    Raises:
      ScenarioError: it is not a Scenario, it came from a file without the code of its functions, or it starts inside an
        obstacle or beyond it.
    """
    if isinstance(scenario, Prepared):
        return scenario
    if not isinstance(scenario, Scenario):
        raise ScenarioError(f"cannot run {shown(scenario)}: give a smc.Scenario")
    _check_code(scenario)
    made = mechanism(scenario)
    made.check_start(scenario)
    key = made, scenario.control_period, scenario.samples
    try:
        return Prepared(scenario, _compile(scenario.resolved), "", made, key)
    except NotCompilable as error:
        return Prepared(scenario, None, str(error), made, key)


def _check_code(scenario: Scenario) -> None:
    """Raise ScenarioError if a function of a scenario came from a file without its code."""
    known = dict.fromkeys(scenario.references)
    known |= {} if scenario.feedforward is None else {scenario.feedforward: None}
    for part in (*scenario.law.parts, scenario.surface, scenario.resolved.velocity):
        if part is not None and part.function is None:
            raise ScenarioError(f"{part.kind} {part.name!r} came from a file without its code: give the {part.kind}")
    for signal in (*known, *scenario.disturbance, *scenario.noise.errors):
        if isinstance(signal, Recorded):
            raise ScenarioError(f"signal {signal.kind!r} came from a file without its code: give the signal")


def _compile(s: Resolved) -> Functions:
    """Compile every function of a scenario; NotCompilable names the first that numba refuses."""
    plant = s.plant
    others = [one for one in (s.feedforward, *s.noise.errors) if one]
    for signal in (*dict.fromkeys(s.references), *s.disturbance, *others):
        native.values_of(signal)  # refuses data that compiled code would misread
    return Functions(
        laws=tuple(native.component(law) for law in s.law.of_channels(plant.driven)),
        surface=s.surface and native.component(s.surface),
        estimator=native.component(s.velocity),
        nominal=None
        if isinstance(plant.nominal, NominalModel)
        else native.nominal(plant.nominal, tuple(plant.parameters)),
        references=tuple(native.of_signal(signal) for signal in references(s)),
        feedforward=s.feedforward and native.of_signal(s.feedforward),
        disturbances=tuple(map(native.of_signal, s.disturbance)),
        friction=s.sliding and native.of_friction(s.sliding),
        errors=tuple(one and native.of_signal(one) for one in s.noise.errors),  # pyright: ignore[reportArgumentType]
    )


def references(s: Resolved) -> tuple[Signal, ...]:
    """Return the reference of all channels, or those of the driven channels if they differ."""
    return s.references if isinstance(s.reference, PerChannel) else (s.reference,)


@dataclasses.dataclass(frozen=True, slots=True)
class Packed:
    """The arrays whose addresses are in a simulation's record. They must exist as long as the simulation.

    Attributes:
      numbers: gains, memories and all else that is float64.
      signals: the disturbances, (m,) SIGNAL.
      laws, references: those of the driven channels, (driven,) FUNCTION; (0,) where all have the same.
      frictions: by a formula, (n,) FUNCTION, or (0,).
      nominal: the data of MuJoCo's own nominal model, or None.
    """

    numbers: np.ndarray
    signals: np.ndarray
    laws: np.ndarray
    references: np.ndarray
    frictions: np.ndarray
    nominal: Any


def pack(prepared: Prepared, log: np.ndarray) -> tuple[tuple, Packed]:
    """Return a simulation's record, as a tuple for an array of SIMULATION, and the arrays that it points to.

    Args:
      log: (K + 1, n) LOG, written at samples. It must outlive the run, as `prepared` must.
    """
    s, mechanism, buffer = prepared.scenario.resolved, prepared.mechanism, state.Buffer()
    nominal = _native_nominal(s)
    tables = _tables(prepared, buffer)
    values = _functions(prepared, nominal, buffer) | _circumstances(s) | _arrays(s, buffer)
    if s.law.joint:
        values |= _joint_measurement(s, nominal, values, buffer)
    values["law"], values["reference"] = tables["laws"][0], tables["references"][0]
    numbers = buffer.array()
    kept = {
        name: np.array(
            [buffer.as_tuple(kind, one) for one in (table if len(table) > 1 or name not in ONE_OF_ALL else ())], kind
        )
        for (name, table), kind in zip(tables.items(), (state.FUNCTION,) * 3 + (state.SIGNAL,), strict=True)
    }
    values |= {name: state.address(table) for name, table in kept.items() if len(table)}
    values |= {"n": s.plant.n, "driven": s.plant.driven, "nq": mechanism.model.nq, "nv": mechanism.model.nv}
    values |= {"samples": len(log), "signal_count": len(kept["signals"]), "log": state.address(log)}
    values["channels"] = state.address(mechanism.channels)
    return buffer.as_tuple(state.SIMULATION, values), Packed(numbers, **kept, nominal=nominal)


def _function(made: Any, values: Any, buffer: state.Buffer, memory: int = 0, channels: int = 1) -> dict[str, int]:
    """Return the fields of a FUNCTION. Its parameters and its memory, of each channel, go into the buffer."""
    places = buffer.put(values), buffer.reserve(memory * channels)
    return {"address": made.address, "parameters": places[0], "memory": places[1], "stride": 8 * memory}


def _tables(prepared: Prepared, buffer: state.Buffer) -> dict[str, list[dict[str, Any]]]:
    """Return the laws, references and frictions of the channels, and the disturbances."""
    s, compiled = prepared.scenario.resolved, prepared.functions
    assert compiled is not None
    n, memory = s.plant.n, {"memory": buffer.reserve(s.law.memory * s.plant.n), "stride": 8 * s.law.memory}
    each = range(n if s.law.joint else 1)  # numbers of a gain
    laws = zip(compiled.laws, s.law.of_channels(s.plant.driven), strict=True)
    named = zip(compiled.references, references(s), strict=True)
    disturbed = enumerate(zip(compiled.disturbances, s.disturbance, strict=True))
    return {
        "laws": [
            _function(made, [at(value, i) for value in law.gains.values() for i in each], buffer) | memory
            for made, law in laws
        ],
        "references": [_function(made, native.values_of(signal), buffer) for made, signal in named],
        "frictions": _frictions(prepared, buffer),
        "signals": [
            pushed(d, prepared.mechanism.model)
            | {"function": _function(made, native.values_of(d), buffer, d.memory, n)}
            | {"stream": s.stream(i), "cartesian": d.cartesian, "sees": d.sees}
            for i, (made, d) in disturbed
        ],
    }


def _functions(prepared: Prepared, nominal: Native | None, buffer: state.Buffer) -> dict[str, Any]:
    """Return the functions of a record that all channels share, but law and reference."""
    s, compiled = prepared.scenario.resolved, prepared.functions
    assert compiled is not None
    n, functions = s.plant.n, {}
    for name, made, part in (("estimator", compiled.estimator, s.velocity), ("surface", compiled.surface, s.surface)):
        if part is not None:
            functions[name] = _function(made, part.gains.values(), buffer, part.memory, n)
    if nominal is not None:
        functions["dynamics" if s.law.joint else "nominal"] = _function(nominal, nominal.values, buffer)
    elif compiled.nominal is not None:
        functions["nominal"] = _function(compiled.nominal, s.plant.parameters.values(), buffer)
    if s.feedforward is not None:
        functions["feedforward"] = _function(compiled.feedforward, native.values_of(s.feedforward), buffer)
    errors = zip(("position_error", "velocity_error"), compiled.errors, s.noise.errors, strict=True)
    return functions | {name: _function(made, native.values_of(one), buffer) for name, made, one in errors if one}


def _circumstances(s: Resolved) -> dict[str, Any]:
    """Return the numbers of a record: of clock, sensor and drives."""
    sensor, drives = s.sensor or PERFECT, s.drive_step
    return {
        "steps": s.steps,
        "stages": s.stages,
        "step": s.physics_step,
        "period": s.control_period,
        "jitter": s.clock.steps(s.physics_step),
        "missed": s.clock.missed,
        "delay": s.delay_steps,
        "scale": math.prod(part.scale for part in s.actuator),
        "has_drives": drives is not None,
        "drive_step": drives._asdict() if drives else {},
        "seed": s.noise_seed,
        "sigma_x": s.noise.position,
        "sigma_v": s.noise.velocity,
        "bias": sensor.bias,
        "counts": 0.0 if sensor.counts == math.inf else sensor.counts,
        "dropout": sensor.dropout,
        "read_period": sensor.period or 0.0,
        "read_delay": sensor.delay,
        "uses_model": s.model == "nominal",
        "drive_gain": s.drive.gain,
        "drive_drag": s.drive.drag,
    }


def _arrays(s: Resolved, buffer: state.Buffer) -> dict[str, Any]:
    """Return the places of what the callback measures, commands and remembers."""
    n, width = s.plant.n, s.plant.n if s.law.joint else 1
    late = bool(s.clock.steps(s.physics_step))  # late commands may arrive after the next sample began
    slots = s.delay_steps // s.steps + 1 + late
    return {
        "seen": {"n": n} | {name: buffer.reserve(n) for name in ("x", "v", "u")},
        "a": buffer.reserve(n),
        "width": width,
        "commands": buffer.reserve(2 * width),
        "states": buffer.put(_states(s)),
        "limits": buffer.put(s.limits),
        "delay_slots": slots,
        "delay_buffer": buffer.reserve(slots * n),
    }


def _states(s: Resolved) -> list[float]:
    """Return the channels' states at the start of a run."""
    states = np.zeros(s.plant.n, state.CHANNEL_STATE)
    if s.drive_step is not None:
        states["first"], states["second"] = s.drive_step.start(np.array(s.v0))
    return states.view(float).tolist()


def _joint_measurement(
    s: Resolved, nominal: Native | None, functions: Mapping[str, Any], buffer: state.Buffer
) -> dict[str, Any]:
    """Return the fields of a record that only a law of many joints has."""
    stored = joint_law.stored_dtype(s.plant.n)
    head = buffer.reserve(stored.itemsize // 8)
    places = {name: state.Place(head + offset // 8) for name, (_, offset, *_) in (stored.fields or {}).items()}
    fields: dict[str, Any] = {"joint": places | {"head": head}}
    if nominal is not None:
        fields["requests"] = {
            "coriolis": native_coriolis().address,
            "jacobian": native_jacobian().address,
            "parameters": functions["dynamics"]["parameters"],
            "unit": s.drive.gain,
        }
    return fields


def _native_nominal(s: Resolved) -> Native | None:
    """Return MuJoCo's own nominal model for one simulation; None for another, or if a law of many joints has none."""
    if not isinstance(s.plant.nominal, NominalModel):
        return None
    if not s.law.joint:
        return s.plant.nominal.native(s.plant.parameters)
    if s.model == "none":
        return None
    at_rest = "g" in read_by(s.law.function)
    return s.plant.nominal.native_dynamics(s.plant.parameters, s.plant.tip, at_rest=at_rest)


def pushed(disturbance: Signal, model: mujoco.MjModel) -> dict[str, Any]:
    """Return the fields of a SIGNAL that say where a disturbance pushes."""
    if not isinstance(disturbance, Push):
        return {"body": -1, "peak": (0.0, 0.0, 0.0)}
    return {"body": 6 * model.body(disturbance.body).id, "peak": (disturbance.x, disturbance.y, disturbance.z)}


def _frictions(prepared: Prepared, buffer: state.Buffer) -> list[dict[str, int]]:
    """Put the numbers of a friction by a formula into the buffer. Return its FUNCTIONs, one for each joint."""
    made, friction = prepared.functions and prepared.functions.friction, prepared.scenario.sliding
    if made is None or friction is None:
        return []
    shared = prepared.mechanism
    inertia = with_values(shared.model, prepared.scenario).dof_M0[shared.channels["qvel"]]
    places = [(buffer.put(friction.parameters(i)), buffer.put(friction.bristle(i, a))) for i, a in enumerate(inertia)]
    return [{"address": made.address, "parameters": first, "memory": second} for first, second in places]
