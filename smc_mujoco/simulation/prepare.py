"""Preparation: what a scenario names, compiled, and which scenarios can share a Batch.

    prepared = prepare(scenario)            # functions, mechanism, key: once a run
    record[i], arrays = pack(prepared, log) # the record that the callback reads, see state.py

What does not compile runs in the reference loop; `prepared.why_not` says why.
"""

import dataclasses
import math
from collections.abc import Hashable
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.jit import AtAddress, Function, NotCompilable
from smc_mujoco.control import joint_law
from smc_mujoco.control.component import Component, at
from smc_mujoco.control.properties import read_by
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.plant import Coupled, Native
from smc_mujoco.simulation import native, state
from smc_mujoco.simulation.model import Mechanism, mechanism, with_values
from smc_mujoco.simulation.scenario import Resolved, Scenario
from smc_mujoco.simulation.signals import PerChannel, Push, Recorded, Signal

PERFECT = Encoder(counts=math.inf)
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
        numbers += joint_law.numbers(s.plant.n) if s.law.joint else 0
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
    for signal in (*known, *scenario.disturbance):
        if isinstance(signal, Recorded):
            raise ScenarioError(f"signal {signal.kind!r} came from a file without its code: give the signal")


def _compile(s: Resolved) -> Functions:
    """Compile every function of a scenario; NotCompilable names the first that numba refuses."""
    plant = s.plant
    for signal in (*dict.fromkeys(s.references), *s.disturbance, *([] if s.feedforward is None else [s.feedforward])):
        native.values_of(signal)  # refuses data that compiled code would misread
    return Functions(
        laws=tuple(native.component(law) for law in s.law.of_channels(plant.driven)),
        surface=s.surface and native.component(s.surface),
        estimator=native.component(s.velocity),
        nominal=None if isinstance(plant.nominal, Coupled) else native.nominal(plant.nominal, tuple(plant.parameters)),
        references=tuple(native.of_signal(signal) for signal in references(s)),
        feedforward=s.feedforward and native.of_signal(s.feedforward),
        disturbances=tuple(map(native.of_signal, s.disturbance)),
        friction=s.sliding and native.of_friction(s.sliding),
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
    s, compiled = prepared.scenario.resolved, prepared.functions
    model, channels = prepared.mechanism.model, prepared.mechanism.channels
    assert compiled is not None
    n, sensor, drives, buffer = s.plant.n, s.sensor or PERFECT, s.drive_step, state.Buffer()

    def function(made: Any, values: Any, memory: int = 0, channels: int = n) -> dict[str, int]:
        places = buffer.put(values), buffer.reserve(memory * channels)
        return {"address": made.address, "parameters": places[0], "memory": places[1], "stride": 8 * memory}

    coupled, joint = s.plant.nominal if isinstance(s.plant.nominal, Coupled) else None, s.law.joint
    modelled = s.model == "nominal"
    own = None if coupled is None else _own(s, coupled)
    functions = {
        "estimator": function(compiled.estimator, s.velocity.gains.values(), s.velocity.memory),
    }
    law_functions = [
        function(made, joint_gains(law, n) if joint else law.gains.values())
        for made, law in zip(compiled.laws, s.law.of_channels(s.plant.driven), strict=True)
    ]
    memory = buffer.reserve(s.law.memory * n)
    law_functions = [one | {"memory": memory, "stride": 8 * s.law.memory} for one in law_functions]
    signal_functions = [
        function(made, native.values_of(signal))
        for made, signal in zip(compiled.references, references(s), strict=True)
    ]
    functions |= {"law": law_functions[0], "reference": signal_functions[0]}
    if own is not None:
        functions["dynamics" if joint else "nominal"] = function(own, own.values)
    elif compiled.nominal is not None:
        functions["nominal"] = function(compiled.nominal, s.plant.parameters.values())
    if s.feedforward is not None:
        functions["feedforward"] = function(compiled.feedforward, native.values_of(s.feedforward))
    if s.surface is not None:
        functions["surface"] = function(compiled.surface, s.surface.gains.values(), s.surface.memory)
    disturbances = [
        pushed(d, model)
        | {"function": function(made, native.values_of(d), d.memory)}
        | {"stream": s.stream(i), "cartesian": d.cartesian, "sees": d.sees}
        for i, (made, d) in enumerate(zip(compiled.disturbances, s.disturbance, strict=True))
    ]
    frictions = _frictions(prepared, buffer)
    jitter = s.clock.steps(s.physics_step)
    slots = s.delay_steps // s.steps + (2 if jitter else 1)  # late commands may arrive after the next sample began
    joints = buffer.put([0.0, float(n), *[0.0] * (4 * n)])
    states = buffer.reserve(state.CHANNEL_STATE.itemsize // 8 * n)
    limits, delay_buffer = buffer.put(s.limits), buffer.reserve(slots * n)
    measurement = buffer.reserve(joint_law.numbers(n)) if joint else None
    torques = buffer.reserve(2 * n) if joint else None
    dynamics = buffer.reserve(4) if joint and own is not None else None
    numbers = buffer.array()

    def placed(found: dict[str, int]) -> dict[str, int]:
        return found | {name: buffer.address(found[name]) for name in ("parameters", "memory")}

    signals = np.array(
        [state.as_tuple(state.SIGNAL, one | {"function": placed(one["function"])}) for one in disturbances],
        state.SIGNAL,
    )
    several = {
        name: [] if len(each) == 1 else each
        for name, each in (("laws", law_functions), ("references", signal_functions))
    }
    tables = {
        name: np.array([state.as_tuple(state.FUNCTION, placed(one)) for one in each], state.FUNCTION)
        for name, each in (several | {"frictions": frictions}).items()
    }
    at = buffer.address(joints)
    values: dict[str, Any] = {name: placed(found) for name, found in functions.items()}
    if measurement is not None and torques is not None:
        values |= {"joint": buffer.address(measurement), "torques": buffer.address(torques)}
    if dynamics is not None and coupled is not None:
        called = coupled.native_coriolis(), coupled.native_jacobian(), values["dynamics"]["parameters"], s.drive.gain
        numbers[dynamics : dynamics + 4] = called
        values["on_request"] = buffer.address(dynamics)
    values |= {name: state.address(table) for name, table in tables.items() if len(table)}
    values |= {
        "n": n,
        "driven": int(np.sum(channels["ctrl"] >= 0)),
        "nq": model.nq,
        "nv": model.nv,
        "samples": len(log),
        "signal_count": len(signals),
        "steps": s.steps,
        "stages": s.stages,
        "step": s.physics_step,
        "period": s.control_period,
        "channels": state.address(channels),
        "states": buffer.address(states),
        "log": state.address(log),
        "signals": state.address(signals),
        "jitter": jitter,
        "missed": s.clock.missed,
        "delay": s.delay_steps,
        "delay_slots": slots,
        "delay_buffer": buffer.address(delay_buffer),
        "limits": buffer.address(limits),
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
        "uses_model": modelled,
        "drive_gain": s.drive.gain,
        "drive_drag": s.drive.drag,
        "joints": at,
        "x": at + 16,
        "v": at + 16 + 8 * n,
        "a": at + 16 + 16 * n,
        "u": at + 16 + 24 * n,
    }
    return state.as_tuple(state.SIMULATION, values), Packed(numbers, signals, **tables, nominal=own)


def _own(s: Resolved, nominal: Coupled) -> Native | None:
    """Return MuJoCo's own nominal model for one simulation; None for a law of many joints that may not use it."""
    if not s.law.joint:
        return nominal.native(s.plant.parameters)
    if s.model == "none":
        return None
    return nominal.native_dynamics(s.plant.parameters, s.plant.tip, at_rest="g" in read_by(s.law.function))


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


def joint_gains(law: Component, n: int) -> list[float]:
    """Return n numbers for each gain of a law of many joints, one after the other."""
    return [at(value, i) for value in law.gains.values() for i in range(n)]
