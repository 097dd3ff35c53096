"""The runs of an objective without MuJoCo: a plant's equation, integrated by RK4 under the same
compiled controller.

A search evaluates thousands of runs, and its best gains are then run by MuJoCo, whose J is the one
on record. So this engine may only find gains. It takes a fifteenth of MuJoCo's time, and its J
differs from MuJoCo's by rounding, which laws that chatter magnify to about 1e-3.

The equation is the compiled nominal model of the plant, with the true parameters: x_i'' = f_i(x, v)
+ g_i(x) (u_i + d_i). Its state stands in an mjData, in which the callback of every run reads and
writes as in a run of MuJoCo. A law, a signal or a sensor thus has one implementation.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import functools
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
from numba import njit, types

from smc_mujoco.common import fingerprint
from smc_mujoco.common.jit import Key, call, call_callback, compiled, pointer, record_at
from smc_mujoco.mechanisms.plant import SEEN, Plant
from smc_mujoco.simulation import callback, cfunctions, state
from smc_mujoco.simulation.cfunctions import seen_at
from smc_mujoco.simulation.model import with_values
from smc_mujoco.simulation.prepare import Prepared, pack
from smc_mujoco.simulation.signals import Push
from smc_mujoco.simulation.state import channel_at, simulation_at

# One run: addresses of mjModel, mjData and the record, of the callback and the nominal model, of
# the plant's parameters before and after a jump, which comes at `jump_step` (-1: never), of fields
# of mjData, of what the nominal model reads, and of SCRATCH numbers a channel. `memoryless`: 1 if
# the disturbances depend on time alone.
FIELDS = ("qpos", "qvel", "ctrl", "xfrc_applied", "sensordata", "userdata")
OWNERS = ("model", "data", "record")
CHANGES = ("before", "after", "jump_step")
ADDRESSES = (*OWNERS, "callback", "nominal", *CHANGES, "memoryless", *FIELDS, "seen", "scratch")
RUN = np.dtype([(name, "i8") for name in ADDRESSES])
run_at = record_at(RUN)
SCRATCH = 12  # state at a step's start, and measured; velocities and accelerations of four stages


def fits(prepared: Prepared) -> bool:
    """Return whether a run's mechanism is nothing but its plant's equation, in compiled functions,
    under RK4.
    """
    s = prepared.scenario.resolved
    other = s.plant.by_mujoco or s.plant.unmodelled or s.plant.direct or s.plant.free
    plain = s.plain_equation and not s.actuator and s.sensor is None and s.integrator == "RK4"
    on_joints = not any(d.cartesian or isinstance(d, Push) for d in s.disturbance)
    return bool(plain and on_joints and not other and not prepared.why_not)


class EquationRun:
    """A run that can be repeated, with its record, numbers and log as in a ScenarioBatch, and an
    mjData.
    """

    def __init__(self, prepared: Prepared):
        self.prepared = prepared  # the record has addresses of its arrays
        s = self.scenario = prepared.scenario.resolved
        n = s.plant.n
        plant = s.plant
        self.log = np.full((s.samples + 1, n), np.nan, state.LOG)
        self.record = np.zeros(1, state.SIMULATION)
        self.record[0], self.packed = pack(prepared, self.log)
        self.model = with_values(prepared.mechanism.model, prepared.scenario)
        self.data = mujoco.MjData(self.model)
        self.scratch = np.zeros(SCRATCH * n)
        at = state.address(self.scratch)
        self.seen = np.array([(0, n, at + 16 * n, at + 24 * n, at)], SEEN)
        self.parameters = [_parameters(plant, s.factors(step)) for step in (0, max(s.jump_step, 0))]
        self.nominal = cfunctions.compile_nominal(plant)
        functions = callback.callback().address, self.nominal.address
        owners = self.model._address, self.data._address, state.address(self.record)
        fields = {}
        for name in FIELDS:
            fields[name] = getattr(self.data, name)
        fields["userdata"][:] = callback.MAGIC, state.address(self.record)
        channels = prepared.mechanism.channels
        fields["qpos"][channels["qpos"]], fields["qvel"][channels["qvel"]] = s.x0, s.v0
        changes = (
            *map(state.address, self.parameters),
            s.jump_step,
            not any(d.memory for d in s.disturbance),
        )
        places = *map(state.address, fields.values()), state.address(self.seen), at
        self.run = np.array([(*owners, *functions, *changes, *places)], RUN)
        # what a run changes
        self.changed = [self.record.view(np.uint8), self.packed.numbers, *fields.values()]
        self.at_start = [array.copy() for array in self.changed]

    def restart(self) -> None:
        """Put record, numbers and state at the start of the run."""
        for array, first in zip(self.changed, self.at_start, strict=True):
            array[:] = first

    def simulate(self) -> None:
        """Run to the end. The samples are then in `log`, and a failure in `record`."""
        _loop().ctypes(state.address(self.run))


def _parameters(plant: Plant, factors: Mapping[str, float]) -> np.ndarray:
    values = vars(plant.values(factors))
    return np.array([values[name] for name in plant.parameters], float)


@functools.cache
def _loop() -> Any:
    """Return the compiled loop of a run, void(address of its RUN), from numba's cache on disk if it
    is there.
    """

    def simulate(address):
        run = run_at(address, 0)
        _simulate(run, simulation_at(run.record, 0))

    key = Key("equation", fingerprint.now(simulate))
    return compiled(types.void(types.intp), simulate, key)


@njit(error_model="numpy")
def _simulate(run, sim):  # noqa: PLR0912
    """Take all steps of a run, with a callback where it does something, and one at the end, for the
    last sample.
    """
    n = sim.n
    h = sim.step
    qpos = pointer(run.qpos)
    qvel = pointer(run.qvel)
    x = pointer(run.scratch)
    v = pointer(run.scratch + 8 * n)
    speed = pointer(run.scratch + 32 * n)
    a = pointer(run.scratch + 64 * n)
    for step in range((sim.samples - 1) * sim.steps):
        if run.jump_step < 0 or step < run.jump_step:
            parameters = run.before
        else:
            parameters = run.after
        for i in range(n):
            channel = channel_at(sim.channels, i)
            x[i], v[i] = qpos[channel.qpos], qvel[channel.qvel]
        for stage in range(4):
            if stage == 0:
                past = 0.0
            elif stage == 3:
                past = h
            else:
                past = 0.5 * h
            for i in range(n):
                channel = channel_at(sim.channels, i)
                before = (stage - 1) * n + i
                if stage > 0:
                    qpos[channel.qpos] = x[i] + past * speed[before]
                    qvel[channel.qvel] = v[i] + past * a[before]
                speed[stage * n + i] = qvel[channel.qvel]
            if (stage > 0 and sim.disturbance_count == 0) or (stage == 2 and run.memoryless != 0):
                # all that the callback does here: disturbances at the time of stage 1 are there
                # already
                sim.calls += 1
            elif not _call_back(run, sim):
                return
            if not _accelerate(run, sim, parameters, run.scratch + 64 * n + 8 * stage * n):
                return
        for i in range(n):
            channel = channel_at(sim.channels, i)
            first = n + i
            last = 3 * n + i
            qpos[channel.qpos] = x[i] + h / 6.0 * (
                speed[i] + 2.0 * (speed[first] + speed[n + first]) + speed[last]
            )
            qvel[channel.qvel] = v[i] + h / 6.0 * (a[i] + 2.0 * (a[first] + a[n + first]) + a[last])
    _call_back(run, sim)


@njit(error_model="numpy", inline="always")
def _call_back(run, sim):
    """Call the callback at the state in mjData, with sensors that read it.

    Return whether the run has not failed.
    """
    qpos = pointer(run.qpos)
    qvel = pointer(run.qvel)
    sensors = pointer(run.sensordata)
    for i in range(sim.n):
        channel = channel_at(sim.channels, i)
        sensors[channel.x_sensor], sensors[channel.v_sensor] = (
            qpos[channel.qpos],
            qvel[channel.qvel],
        )
    call_callback(run.callback, run.model, run.data)
    return sim.failure == state.FINE


@njit(error_model="numpy")
def _accelerate(run, sim, parameters, a):
    """Write the accelerations (n,) at a stage's state to an address.

    Return False if the nominal model raises.
    """
    n = sim.n
    seen = seen_at(run.seen, 0)
    out = sim.model
    qpos = pointer(run.qpos)
    qvel = pointer(run.qvel)
    ctrl = pointer(run.ctrl)
    xfrc = pointer(run.xfrc_applied)
    x = pointer(run.scratch + 16 * n)
    v = pointer(run.scratch + 24 * n)
    for i in range(n):
        channel = channel_at(sim.channels, i)
        x[i], v[i] = qpos[channel.qpos], qvel[channel.qvel]
    for i in range(n):
        channel = channel_at(sim.channels, i)
        seen.i = i
        if call(run.nominal, run.seen, parameters, 0, run.record + state.AT.model) != 0:
            sim.failure = state.DIVERGED
            sim.failed_step = (sim.calls - 1) // sim.stages
            return False
        pointer(a)[i] = out.f + out.g * (ctrl[channel.ctrl] + channel.sign * xfrc[channel.xfrc])
    return True
