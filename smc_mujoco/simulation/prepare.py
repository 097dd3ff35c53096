"""Preparation of a run: its functions and its model, compiled, and the record that the callback reads.

    prepared = prepare(scenario)              # functions, mechanism, key
    record[i], arrays = pack(prepared, log)   # see state.py

What does not compile runs in the reference loop; `prepared.why_not` says why.
"""

import dataclasses
import math
from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.jit import NotCompilable
from smc_mujoco.control import joint_law
from smc_mujoco.control.component import gain_at
from smc_mujoco.mechanisms.custom.nominal_model import NominalModel, native_coriolis, native_jacobian
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.plant import Native
from smc_mujoco.simulation import cfunctions, state
from smc_mujoco.simulation.model import Mechanism, check_start, mechanism, with_values
from smc_mujoco.simulation.scenario import Resolved, Scenario
from smc_mujoco.simulation.signals import PerChannel, Push, Signal

IDEAL_SENSOR = Encoder(counts=math.inf)
DATA_BYTES, CHANNEL_BYTES = 176 * 2**10, 2 * 2**10  # of an mjData without channels, and per channel; measured
READING_BYTES = 67  # of a delayed sensor's history, per channel and reading, in mjData and in the Batch; measured


@dataclasses.dataclass(frozen=True, slots=True)
class Prepared:
    """A scenario that is ready to run."""

    scenario: Scenario  # not resolved
    functions: dict[str, Any] | None  # what -> compiled; None if one of them does not compile
    why_not: str  # what does not compile, in one sentence
    mechanism: Mechanism
    key: Hashable  # equal for scenarios that can share a Batch

    @property
    def bytes(self) -> int:
        """Memory of its simulation: log, mjData, record, and the history of a delayed sensor."""
        s = self.scenario.resolved
        surface = 0 if s.surface is None else s.surface.memory
        memories = s.law.memory + surface + s.velocity.memory + sum(d.memory for d in s.disturbance)
        numbers = 200 + s.plant.n * (memories + s.input_delay / s.control_period + 20)
        numbers += joint_law.stored_dtype(s.plant.n).itemsize / 8 if s.law.joint else 0
        per_channel = state.LOG.itemsize * (s.samples + 1) + CHANNEL_BYTES + READING_BYTES * s.readings
        return int(per_channel * s.plant.n + 8 * numbers + state.SIMULATION.itemsize + DATA_BYTES)


def prepare(scenario: object) -> Prepared:
    """Return a scenario with its functions and its mechanism compiled, after a check of its start and its code."""
    if isinstance(scenario, Prepared):
        return scenario
    if not isinstance(scenario, Scenario):
        raise ScenarioError(f"cannot run {shown(scenario)}: give a smc.Scenario")
    for part in (*scenario.law.parts, scenario.surface, scenario.resolved.velocity):
        if part is not None and part.function is None:
            raise ScenarioError(f"{part.kind} {part.name!r} came from a file without its code: give the {part.kind}")
    shared = mechanism(scenario)
    check_start(shared, scenario)
    key = shared, scenario.control_period, scenario.samples
    try:
        return Prepared(scenario, _compile(scenario.resolved), "", shared, key)
    except NotCompilable as error:
        return Prepared(scenario, None, str(error), shared, key)


def _compile(s: Resolved) -> dict[str, Any]:
    """Compile every function of a scenario; NotCompilable names the first that numba refuses."""
    plant, by_mujoco = s.plant, isinstance(s.plant.nominal, NominalModel)
    optional = [signal for signal in (s.feedforward, *s.noise.errors) if signal]
    for signal in (*dict.fromkeys(s.references), *s.disturbance, *optional):
        cfunctions.signal_values(signal)  # refuses data that compiled code would misread
    return {
        "laws": [cfunctions.compile_component(law) for law in s.law.of_channels(plant.driven)],  # one for all, or each
        "surface": s.surface and cfunctions.compile_component(s.surface),
        "estimator": cfunctions.compile_component(s.velocity),
        "nominal": None if by_mujoco else cfunctions.compile_nominal(plant.nominal, tuple(plant.parameters)),
        "references": [cfunctions.compile_signal(signal) for signal in references(s)],
        "feedforward": s.feedforward and cfunctions.compile_signal(s.feedforward),
        "disturbances": [cfunctions.compile_signal(signal) for signal in s.disturbance],
        "friction": s.formula_friction and cfunctions.compile_friction(s.formula_friction),  # by a formula
        "errors": [error and cfunctions.compile_signal(error) for error in s.noise.errors],  # of position and velocity
    }


def references(s: Resolved) -> tuple[Signal, ...]:
    """Return the reference of all channels, or those of the driven channels if they differ."""
    return s.references if isinstance(s.reference, PerChannel) else (s.reference,)


@dataclasses.dataclass(frozen=True, slots=True)
class Packed:
    """The arrays whose addresses are in a simulation's record. They must exist as long as the simulation."""

    numbers: np.ndarray  # gains, memories and all else that is float64
    disturbances: np.ndarray  # (m,) DISTURBANCE
    laws: np.ndarray  # (driven,) FUNCTION; (0,) if all channels have the same
    references: np.ndarray  # (driven,) FUNCTION; (0,) if all channels have the same
    frictions: np.ndarray  # by a formula, (n,) FUNCTION, or (0,)
    nominal: Any  # the data of a nominal model that MuJoCo computes, or None


def pack(prepared: Prepared, log: np.ndarray) -> tuple[tuple, Packed]:
    """Return a simulation's record, as a tuple for an array of SIMULATION, and the arrays that it points to.

    The log, (K + 1, n) LOG, is written at samples. It and `prepared` must outlive the run.
    """
    s, mechanism, buffer = prepared.scenario.resolved, prepared.mechanism, state.Buffer()
    nominal = _native_nominal(s)
    tables = _tables(prepared, buffer)
    values = _shared_functions(prepared, nominal, buffer) | _settings(s) | _arrays(s, buffer)
    if s.law.joint:
        values |= _joint_measurement(s, nominal, values, buffer)
    for name, shared in (("laws", "law"), ("references", "reference")):
        values[shared] = tables[name][0]
        tables[name] = tables[name] if len(tables[name]) > 1 else []
    numbers = buffer.array()
    arrays = {}
    for name, rows in tables.items():
        kind = state.DISTURBANCE if name == "disturbances" else state.FUNCTION
        arrays[name] = np.array([buffer.as_tuple(kind, row) for row in rows], kind)
    values |= {name: state.address(array) for name, array in arrays.items() if len(array)}
    values |= {"n": s.plant.n, "driven": s.plant.driven, "nq": mechanism.model.nq, "nv": mechanism.model.nv}
    values |= {"samples": len(log), "disturbance_count": len(s.disturbance)}
    values |= {"channels": state.address(mechanism.channels), "log": state.address(log)}
    return buffer.as_tuple(state.SIMULATION, values), Packed(numbers, **arrays, nominal=nominal)


def _function(compiled: Any, values: Any, buffer: state.Buffer, memory: int = 0, channels: int = 1) -> dict[str, int]:
    """Return the fields of a FUNCTION. Its parameters, and its memory in each channel, go into the buffer."""
    parameters, first = buffer.put(values), buffer.reserve(memory * channels)
    return {"address": compiled.address, "parameters": parameters, "memory": first, "stride": 8 * memory}


def _tables(prepared: Prepared, buffer: state.Buffer) -> dict[str, list[dict[str, Any]]]:
    """Return the laws, references and frictions of the channels, and the disturbances, as fields of records."""
    s, functions = prepared.scenario.resolved, prepared.functions
    assert functions is not None
    n, memory = s.plant.n, {"memory": buffer.reserve(s.law.memory * s.plant.n), "stride": 8 * s.law.memory}
    each = range(n if s.law.joint else 1)  # numbers of a gain
    laws = zip(functions["laws"], s.law.of_channels(s.plant.driven), strict=True)
    signals = zip(functions["references"], references(s), strict=True)
    disturbances = enumerate(zip(functions["disturbances"], s.disturbance, strict=True))
    return {
        "laws": [
            _function(compiled, [gain_at(value, i) for value in law.gains.values() for i in each], buffer) | memory
            for compiled, law in laws
        ],
        "references": [_signal(compiled, signal, buffer) for compiled, signal in signals],
        "frictions": _frictions(prepared, buffer),
        "disturbances": [
            {"function": _signal(compiled, d, buffer, n), "stream": s.noise_stream(i)}
            | {"cartesian": d.cartesian, "sees": d.sees, "peak": (d.x, d.y, d.z) if isinstance(d, Push) else (0.0,) * 3}
            | {"body": 6 * prepared.mechanism.model.body(d.body).id if isinstance(d, Push) else -1}
            for i, (compiled, d) in disturbances
        ],
    }


def _shared_functions(prepared: Prepared, nominal: Native | None, buffer: state.Buffer) -> dict[str, Any]:
    """Return the functions of a record that all channels share, but law and reference."""
    s, functions = prepared.scenario.resolved, prepared.functions
    assert functions is not None
    fields, n = {}, s.plant.n
    fields["estimator"] = _function(functions["estimator"], s.velocity.gains.values(), buffer, s.velocity.memory, n)
    if s.surface is not None:
        fields["surface"] = _function(functions["surface"], s.surface.gains.values(), buffer, s.surface.memory, n)
    if nominal is not None:
        fields["dynamics" if s.law.joint else "nominal"] = _function(nominal, nominal.values, buffer)
    elif functions["nominal"] is not None:
        fields["nominal"] = _function(functions["nominal"], s.plant.parameters.values(), buffer)
    names = "feedforward", "position_error", "velocity_error"
    signals, compiled = (s.feedforward, *s.noise.errors), (functions["feedforward"], *functions["errors"])
    return fields | {
        name: _signal(function, signal, buffer)
        for name, function, signal in zip(names, compiled, signals, strict=True)
        if signal
    }


def _signal(compiled: Any, signal: Signal, buffer: state.Buffer, channels: int = 1) -> dict[str, int]:
    """Return the fields of a signal's FUNCTION."""
    return _function(compiled, cfunctions.signal_values(signal), buffer, signal.memory, channels)


def _settings(s: Resolved) -> dict[str, Any]:
    """Return the numbers of a record that set clock, sensor and drives."""
    sensor, drives = s.sensor or IDEAL_SENSOR, s.drive_step
    return {
        "steps": s.steps,
        "stages": s.stages,
        "step": s.physics_step,
        "period": s.control_period,
        "jitter": s.clock.jitter_steps(s.physics_step),
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
        "drive_gain": s.nominal_drive.gain,
        "drive_drag": s.nominal_drive.drag,
    }


def _arrays(s: Resolved, buffer: state.Buffer) -> dict[str, Any]:
    """Return the arrays of a record in which the callback keeps measurements, commands and states."""
    n, width = s.plant.n, s.plant.n if s.law.joint else 1
    late = bool(s.clock.jitter_steps(s.physics_step))  # a late command may take effect after the next sample began
    slots = s.delay_steps // s.steps + 1 + late
    states = np.zeros(n, state.CHANNEL_STATE)  # at the start of a run
    if s.drive_step is not None:
        states["first"], states["second"] = s.drive_step.start(np.array(s.v0))
    return {
        "seen": {"n": n} | {name: buffer.reserve(n) for name in ("x", "v", "u")},
        "a": buffer.reserve(n),
        "width": width,
        "commands": buffer.reserve(2 * width),
        "states": buffer.put(states.view(float).tolist()),
        "limits": buffer.put(s.limits),
        "delay_slots": slots,
        "delay_buffer": buffer.reserve(slots * n),
    }


def _joint_measurement(
    s: Resolved, nominal: Native | None, functions: Mapping[str, Any], buffer: state.Buffer
) -> dict[str, Any]:
    """Return the fields of a record that only a law of many joints has."""
    stored = joint_law.stored_dtype(s.plant.n)
    head = buffer.reserve(stored.itemsize // 8)
    arrays = {name: state.Index(head + offset // 8) for name, (_, offset, *_) in (stored.fields or {}).items()}
    fields: dict[str, Any] = {"joint": arrays | {"head": head}}
    if nominal is not None:
        shared = {"parameters": functions["dynamics"]["parameters"], "unit": s.nominal_drive.gain}
        fields["handle"] = {"coriolis": native_coriolis().address, "jacobian": native_jacobian().address} | shared
    return fields


def _native_nominal(s: Resolved) -> Native | None:
    """Return the nominal model for one simulation if MuJoCo computes it and the law uses it, else None."""
    if not isinstance(s.plant.nominal, NominalModel):
        return None
    if not s.law.joint:
        return s.plant.nominal.native(s.plant.parameters)
    if s.model == "none":
        return None
    return s.plant.nominal.native_dynamics(s.plant.parameters, s.plant.tip)


def _frictions(prepared: Prepared, buffer: state.Buffer) -> list[dict[str, int]]:
    """Return the FUNCTIONs of a friction by a formula, one for each joint. Their numbers go into the buffer."""
    compiled, friction = prepared.functions and prepared.functions["friction"], prepared.scenario.formula_friction
    if compiled is None or friction is None:
        return []
    shared = prepared.mechanism
    inertia = with_values(shared.model, prepared.scenario).dof_M0[shared.channels["qvel"]]
    numbers = [(buffer.put(friction.parameters(i)), buffer.put(friction.bristle(i, a))) for i, a in enumerate(inertia)]
    return [{"address": compiled.address, "parameters": first, "memory": second} for first, second in numbers]
