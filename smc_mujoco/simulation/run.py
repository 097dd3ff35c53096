"""From scenarios to traces, in batches of bounded memory.

The scenarios of a group have the same plant, size, kinds of parts (not the same numbers),
integrator, physics step and number of steps. They may differ in parameters, friction levels, laws,
gains, signals, delays and seeds. A scenario of which something does not compile has a batch of its
own, whose callback calls Python. The results do not depend on the number of threads, the grouping
or the other runs.
"""

import contextlib
import copy
import ctypes
import functools
import os
import sys
import time
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from typing import Annotated, Any, overload

import mujoco
import numpy as np

from smc_mujoco.common import arithmetic
from smc_mujoco.common.attended import attended
from smc_mujoco.common.constraints import Shown, Whole, constrained
from smc_mujoco.common.errors import ScenarioError, has_items, shown, warn_once
from smc_mujoco.common.process import return_freed_memory
from smc_mujoco.common.progress import bar
from smc_mujoco.common.text import counted
from smc_mujoco.mechanisms.plant import field_array
from smc_mujoco.simulation import callback, doubts, state
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.controller import MAX_STATE
from smc_mujoco.simulation.law_checks import blind
from smc_mujoco.simulation.prepare import Prepared, pack, prepare, put_after_jump
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import PLANT_DIVERGED as PLANT_DIVERGED_SHORT
from smc_mujoco.simulation.trace import Trace, from_log, warn_of_broken

# isort: split
from mujoco.batch import Batch, SimulationError  # by now imported by callback

from smc_mujoco.common.aliases import Array, ProgressTo

BATCH_BYTES = 256 * 2**20  # of logs and records in one Batch
MIN_TRIM_RUNS = 64  # after a batch of fewer runs, freed memory is not returned to the system
MMAP_THRESHOLD = -3  # glibc's M_MMAP_THRESHOLD
LARGE = 2**20  # bytes; chosen: more than the log of a run
SLICE_STEPS = 50_000  # physics steps times channels in a slice, about .2 s of a core
# physics steps in a slice of a user's model, which takes 0.1 s and more a step with contacts once
# it has diverged
USER_MODEL_STEPS = 200
SLICE_TIME = 0.2  # s: a slice that takes longer is followed by shorter ones
FULL_WARNINGS = mujoco.mjtWarning.mjWARN_CONTACTFULL, mujoco.mjtWarning.mjWARN_CNSTRFULL
DRY_FRICTION = "dof_frictionloss", "tendon_frictionloss"  # fields of a model
LOST_CONTACTS = (
    "MuJoCo had no room for all contacts in the model's memory: give its <size> more memory"
)

INTERRUPTED = (
    "other code set a callback of MuJoCo's during the run, or took its control callback away, so "
    "that its law was not called: call mujoco.set_mjcb_control and its like before or after the "
    "run, or restore what mujoco.get_mjcb_control() returned"
)
TIPPED_OVER = "the base has tipped over, by more than 60 degrees"
DISTURBANCE_NOT_FINITE = "the disturbance became NaN or inf"
PLANT_DIVERGED = f"{PLANT_DIVERGED_SHORT} (|x| or |v| above {MAX_STATE:g}, or NaN)"


def check_arithmetic() -> None:
    """Raise ScenarioError if other code has changed how this thread computes."""
    if not arithmetic.computes_as_usual():
        raise ScenarioError(
            "other code has changed the arithmetic of this thread (rounding, flush-to-zero): call "
            "C's fesetround(FE_TONEAREST) before the run, and leave it so"
        )


# called with the number of steps since its last call, in the thread that steps
Report = Callable[[int], None]


class PlainLoopWarning(UserWarning):
    """A warning: a law or signal does not compile and is called in Python, which takes several
    times longer.
    """


@overload
def run(scenarios: Scenario, threads: int | None = None, progress: ProgressTo = False) -> Trace: ...
@overload
def run(
    scenarios: Iterable[Scenario | Prepared],
    threads: int | None = None,
    progress: ProgressTo = False,
) -> list[Trace]: ...
def run(
    scenarios: Scenario | Iterable[Scenario | Prepared],
    threads: int | None = None,
    progress: ProgressTo = False,
) -> Trace | list[Trace]:
    """Run one scenario or many.

        trace = smc.run(smc.Scenario(plant="duffing", law="pid", duration=1.0))
        print(trace.t.shape, trace.x.shape, trace.u.shape)

    Args:
      scenarios: a Scenario, or any number of them.
      threads: how many simulations at once; None for one per available core.
      progress: whether to show a progress bar, or a function that is called with a text and the
        share that is done.

    Returns:
      The Trace, or a list of them in the order of the scenarios. A run fails if its law raises or
      returns NaN, or if the plant diverges. Its Trace says so in `diverged_at` and `failure`; the
      other runs continue.

    Raises:
      ScenarioError: not a Scenario, or threads below 1.

    MuJoCo's eight callbacks are global to the process. During a run no other callback is called,
    and a run fails if other code sets one, or takes its control callback away. Ctrl-C ends
    the call within a second. A compiled law that never returns cannot be stopped: it keeps
    one core busy until Python ends, with exit code 130.
    """
    shown_bar = Shown()("progress", progress)
    prepared = list(map(prepare, as_iterable(scenarios)))
    for item in prepared:
        warn_once(blind(item.scenario.plant, item.scenario.law.parts))
        warn_once(doubts.of_default_gains(item.scenario))
    work = sum(item.scenario.work for item in prepared)
    with bar(counted(len(prepared), "run"), work, shown=shown_bar) as progress_bar:
        traces = dict(stream(prepared, threads, progress_bar.advance))
    broken = {}
    for trace in traces.values():
        if " raised " in trace.broken or " instead of " in trace.broken:
            broken.setdefault(trace.scenario.law.name, trace.broken)
    warn_of_broken(broken)
    for trace in traces.values():
        warn_once(trace.unresolved)
        warn_once(trace.unmet)
        warn_once(trace.unreached)
    if isinstance(scenarios, Scenario):
        return traces[0]
    return [traces[i] for i in range(len(prepared))]


def as_iterable(scenarios: Any) -> Iterable[Scenario | Prepared]:
    """Return one scenario, or what yields several, as the latter."""
    if isinstance(scenarios, Scenario):
        return [scenarios]
    if has_items(scenarios) and not isinstance(scenarios, str):
        return scenarios
    raise ScenarioError(
        f"cannot run {shown(scenarios)}: give smc.Scenario(plant='duffing', law='pid'), or several"
    )


def stream(
    scenarios: Iterable[Scenario | Prepared],
    threads: int | None = None,
    report: Report = lambda steps: None,
) -> Iterator[tuple[int, Trace]]:
    """Yield pairs (index, Trace) as soon as their batch is done. At most one batch is in memory.

        for i, trace in smc.stream(smc.grid("duffing", "pid", seeds=4, duration=1.0)):
            print(i, smc.score(trace)["itae"])

    Args:
      scenarios: as in `run`.
      threads: as in `run`.
      report: called with the number of steps since its last call, in the thread that steps.

    Returns:
      An iterator over (index, Trace).
    """
    threads = cores(threads)
    if not callable(report):
        raise ScenarioError(f"report is {shown(report)}: give a function of a number of steps")
    for group in _by_mechanism(as_iterable(scenarios)):
        for batch in _batches(((i, prepare(item)) for i, item in group), threads):
            indices, items = zip(*batch, strict=True)
            if items[0].why_not:
                words = f"{items[0].why_not}; it runs in Python, several times slower"
                warn_once(words, PlainLoopWarning)
            with callback.installed(), memory_for(items):
                traces = ScenarioBatch(items, threads).run(report)
            if len(batch) >= MIN_TRIM_RUNS:
                return_freed_memory()
            del items, batch  # with the model, before the next one is compiled
            yield from zip(indices, traces, strict=True)


def _by_mechanism(
    scenarios: Iterable[Scenario | Prepared],
) -> Iterator[Iterable[tuple[int, Scenario | Prepared]]]:
    """Yield pairs (index, scenario), of a sequence those of one own model together: no other such
    model, which may be large, is then in memory while they run.
    """
    if not isinstance(scenarios, Sequence):
        yield enumerate(scenarios)
        return
    groups: dict[Hashable, list[tuple[int, Scenario | Prepared]]] = {}
    for pair in enumerate(scenarios):
        item = pair[1].scenario if isinstance(pair[1], Prepared) else pair[1]
        key = None
        if isinstance(item, Scenario) and item.plant.is_user_model:
            key = models.structure(item)
        groups.setdefault(key, []).append(pair)
    yield from groups.values()


def run_unjudged(
    scenarios: Iterable[Scenario | Prepared], threads: int | None = None
) -> list[Trace]:
    """Run scenarios as `run` does, but without a word on gains that are only tried."""
    traces = dict(stream(scenarios, threads))
    return [traces[i] for i in range(len(traces))]


@contextlib.contextmanager
def memory_for(prepared: Sequence[Prepared]) -> Iterator[None]:
    """Turn a MemoryError into one sentence about the runs."""
    try:
        yield
    except (MemoryError, ValueError, mujoco.FatalError) as error:  # MuJoCo raises any of the three
        if not (isinstance(error, MemoryError) or "allocate memory" in str(error)):
            raise
        needed = sum(item.bytes for item in prepared) / 2**20
        raise ScenarioError(
            f"no memory for {counted(len(prepared), 'run')} at once, about {needed:.0f} MiB beside "
            "the traces kept so far: give a shorter duration, a longer control period or fewer "
            "channels, or take traces from smc.stream"
        ) from None


@functools.cache
def lower_mmap_threshold() -> None:
    """Have the C library, if it is glibc, return freed blocks of LARGE bytes to the system at once.

    Otherwise it keeps them for later blocks of that size, such as the arena of an mjData, whose
    pages MuJoCo does not touch. A race on an arm with meshes of 20 MB takes 0.9 GB, 1.5 without.
    """
    if sys.platform == "linux" and hasattr(ctypes.CDLL(None), "mallopt"):
        ctypes.CDLL(None).mallopt(MMAP_THRESHOLD, LARGE)


def _batches(
    scenarios: Iterable[tuple[int, Prepared]], threads: int
) -> Iterator[list[tuple[int, Prepared]]]:
    """Yield runs in batches of one key, each as soon as it is full: at most BATCH_BYTES, but at
    least one run for each thread.

    What is called in Python has a batch of its own.
    """
    waiting: dict[Hashable, list[tuple[int, Prepared]]] = {}
    sizes: dict[Hashable, int] = {}
    for index, prepared in scenarios:
        if prepared.why_not:
            yield [(index, prepared)]
            continue
        key = prepared.key
        batch = waiting.setdefault(key, [])
        size = sizes.get(key, 0) + prepared.bytes
        if len(batch) >= threads and size > BATCH_BYTES:
            yield batch
            batch = waiting[key] = []
            size = prepared.bytes
        batch.append((index, prepared))
        sizes[key] = size
    yield from waiting.values()


@constrained
def cores(threads: Annotated[int, Whole(low=1, high=1024)] | None = None) -> int:
    """Return how many simulations to step at once:

    `threads`, or one for each core that this process may use.
    """
    if threads is None:
        if hasattr(os, "sched_getaffinity"):
            return len(os.sched_getaffinity(0))
        return os.cpu_count() or 1
    return threads


def poses(trace: Trace, times: Array) -> Array:
    """Return qpos at times in s, (times, nq), see `states`."""
    return states(trace, times)[0]


def states(trace: Trace, times: Array) -> tuple[Array, Array]:
    """Return qpos, (times, nq), and qvel, (times, nv), at times in s, each at the physics step
    before; after a failure the last one.

    A trace has the channels only, so the run is simulated again.
    """
    prepared = prepare(trace.scenario)
    scenario = trace.scenario.resolved
    total = scenario.samples * scenario.steps
    ends: list[int] = np.clip(
        np.floor(times / scenario.physics_step + 1e-6).astype(int), 0, total
    ).tolist()
    state_at = {}
    with callback.installed():
        batch = ScenarioBatch([prepared], threads=1)
        qpos = batch.batch.bind("qpos")
        qvel = batch.batch.bind("qvel")
        last = qpos[0].copy(), qvel[0].copy()
        for end in sorted(set(ends)):
            batch.advance_to(end)
            if batch.records["failure"][0] == state.FINE:
                last = qpos[0].copy(), qvel[0].copy()
            state_at[end] = last
    pairs = [state_at[end] for end in ends]
    every_qpos = np.array([q for q, _ in pairs])
    return every_qpos, np.array([v for _, v in pairs])


class ScenarioBatch:
    """Scenarios of one key (`Prepared.key`) in one Batch.

    Make and run it while the callback is installed.

    `off` has MuJoCo's disable flags of what does not act, such as contacts.
    """

    def __init__(
        self,
        prepared: Sequence[Prepared],
        threads: int,
        off: int = 0,
        python: bool = False,
    ):
        lower_mmap_threshold()
        self.prepared = prepared
        self.python = python
        self.scenarios = scenarios = [item.scenario.resolved for item in prepared]
        first = scenarios[0]
        count = len(scenarios)
        self.base = prepared[0].mechanism.model
        self.model = copy.copy(prepared[0].mechanism.model)
        self.model.opt.disableflags |= off
        if not self.may_have_constraints():
            self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT.value
        set_fields = models.put_values(self.model, self.base, first, 0)
        self.scratch = mujoco.MjData(self.model)
        mujoco.mj_setConst(self.model, self.scratch)
        # The shared model has the first scenario's values. Scenarios that do not set these fields
        # need the base values.
        self.base_values = {name: field_array(self.base, name) for name in set_fields}
        shape = (first.samples + 1, first.plant.n)
        self.logs = [np.full(shape, np.nan, state.LOG) for _ in scenarios]
        self.records = np.zeros(count, state.SIMULATION)
        self.packed = []  # the arrays whose addresses are in the records
        self.called: list[Any] = []  # functions that are called in Python
        for i, (item, log) in enumerate(zip(prepared, self.logs, strict=True)):
            self.records[i], packed = pack(item, log, python)
            self.packed.append(packed)
            self.called += packed.python
        # persistent: at a sample, mjData still holds the forces of this simulation's last step
        self.batch = Batch(self.model, count, min(threads, count), persistent=True)
        self.reset()
        self.put_initial_states()
        self.fields: dict[str, Array] = {}  # model fields that differ between the simulations
        self.errors: dict[int, str] = {}  # simulation -> MuJoCo's error
        self.calls = 0  # callbacks that each simulation should have had by now
        self.set_parameters(0, range(count))

    def may_have_constraints(self) -> bool:
        """Return whether any simulation may ever have a limit, contact, dry friction or equality
        constraint.

        Without, MuJoCo need not look for them, which takes a tenth of its step. No bit of a trace
        depends on it.
        """
        model = self.base
        touching = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT.value
        touching = touching and (
            model.npair or (np.any(model.geom_contype) and np.any(model.geom_conaffinity))
        )
        if touching or model.neq or np.any(model.jnt_limited) or np.any(model.tendon_limited):
            return True
        if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS.value:
            return False  # the callback has the friction
        for scenario in self.scenarios:
            for step in {0, scenario.jump_step}:
                values = models.field_values(model, scenario, step)
                for name in DRY_FRICTION:
                    if np.any(values.get(name, getattr(model, name))):
                        return True
        return False

    def reset(self) -> None:
        """Put MuJoCo's states at the model's defaults, and tell the callback which record is
        whose.
        """
        count = len(self.scenarios)
        self.step = 0  # physics steps done
        self.stopped = False
        self.batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        offsets = np.arange(count) * self.records.itemsize
        addresses = state.address(self.records) + offsets
        self.batch.bind("userdata")[:] = np.column_stack(
            [np.full(count, callback.MAGIC), addresses]
        )

    def run(self, report: Report) -> list[Trace]:
        """Simulate all scenarios to the end, and return their traces."""
        self.simulate(report)
        return [self.trace(i) for i in range(len(self.scenarios))]

    def simulate(self, report: Report) -> None:
        """Simulate all scenarios to the end. Their samples are then in `logs`."""

        def to_the_end() -> None:
            self.advance_to(self.scenarios[0].samples * self.scenarios[0].steps, report)
            self.run_alive(self.batch.forward, 1)  # the last sample, at the end of the run

        self.attend(to_the_end)

    def attend(self, job: Callable[[], None]) -> None:
        """Do a job that steps, in one thread that Ctrl-C stops; in this one if laws are called in
        Python.
        """
        if self.called:
            job()
        else:
            attended([job], self.stop)

    def advance_to(self, end: int, report: Report = lambda steps: None) -> None:
        """Step all scenarios to a physics step, each with the parameters that hold from its jump
        on.
        """
        self.attend(functools.partial(self._advance_to, end, report))

    def _advance_to(self, end: int, report: Report) -> None:
        jumps = [s.jump_step for s in self.scenarios]
        stops = {end}
        for step in jumps:
            if self.step < step <= end:
                stops.add(step)
        for stop in sorted(stops):
            self.advance(stop - self.step, report)
            self.step = stop
            if stop > 0:
                jumping = []
                for i, step in enumerate(jumps):
                    if step == stop:
                        jumping.append(i)
                self.set_parameters(stop, jumping)
                for i in jumping:
                    put_after_jump(self.prepared[i], self.packed[i])

    def set_parameters(self, step: int, indices: Sequence[int]) -> None:
        """Set the true parameters that hold from a physics step on, in the simulations of these
        indices.
        """
        changed = []
        for i in indices:
            present = models.field_values(self.base, self.scenarios[i], step)
            values = self.base_values | present
            for name, value in values.items():
                if name in self.fields:
                    before = self.fields[name][i]
                else:
                    before = field_array(self.model, name)
                if np.any(before != value):
                    self.fields[name] = self.batch.expand(name)
                    self.fields[name][i] = value
                    changed.append(i)
        if changed:
            self.batch.set_const(np.unique(changed).astype(np.int32))

    @property
    def started(self) -> dict[str, Array]:
        """The arrays of all simulations whose start is not MuJoCo's: states, and the past of
        delayed sensors.
        """
        names = ["qpos", "qvel"]
        if self.model.na:
            names.append("act")
        if self.model.nhistory:
            names.append("history")
        return {name: self.batch.bind(name) for name in names}

    def put_initial_states(self) -> None:
        """Put all simulations at t = 0, with the past readings of delayed sensors."""
        delayed = bool(self.model.nhistory)
        arrays = self.started
        model = self.model
        if delayed:  # the periods of the readings differ between scenarios
            model = copy.copy(self.model)
        data = self.scratch
        for i, scenario in enumerate(self.scenarios):
            if delayed:
                models.put_values(model, self.base, scenario, 0)
            models.put_initial_state(model, data, scenario)
            for name, array in arrays.items():
                array[i] = getattr(data, name)

    def advance(self, steps: int, report: Report) -> None:
        """Step the simulations that still run, in slices, so that the progress bar moves and
        `stop` works.
        """
        first = self.scenarios[0]
        channels = len(self.scenarios) * first.plant.n
        slice_steps = max(1, SLICE_STEPS // channels)
        if first.plant.is_user_model:
            slice_steps = min(slice_steps, USER_MODEL_STEPS)
        while steps and not self.stopped:
            count = min(steps, slice_steps)
            step = functools.partial(self.batch.step, nstep=count)
            begin = time.perf_counter()
            self.run_alive(step, count * first.stages)
            if (taken := time.perf_counter() - begin) > SLICE_TIME:
                slice_steps = max(1, int(count * SLICE_TIME / taken))
            report(count * channels)
            steps -= count

    def run_alive(self, action: Callable[[Array], None], calls: int) -> None:
        """Apply an action to the simulations that still run, and mark those that fail.

        The action is a function of their indices; MuJoCo should call the callback `calls` times in
        each.
        """
        records = self.records
        fine = records["failure"] == state.FINE
        alive = np.flatnonzero(fine).astype(np.int32)
        before = self.calls
        self.calls += calls
        check_arithmetic()
        try:
            with self.hearing_ctrl_c():
                action(alive)
        except SimulationError as error:
            for i in error.ids:
                self.errors[int(i)] = " ".join(self.batch.error(int(i)).split())
                records["failure"][i] = state.DIVERGED
                records["failed_step"][i] = records["calls"][i] // records["stages"][i]
        except (ValueError, mujoco.UnexpectedError) as error:
            if "allocate memory" in str(error):
                raise
            # another Python callback replaced ours: the number of calls shows it
        check_arithmetic()
        interrupted = []
        for i in alive:
            if i not in self.errors and records["calls"][i] != self.calls:
                interrupted.append(i)
        records["failure"][interrupted] = state.INTERRUPTED
        records["failed_step"][interrupted] = before // self.scenarios[0].stages

    def hearing_ctrl_c(self) -> contextlib.AbstractContextManager[None]:
        """Return a block at whose end Ctrl-C is raised that came while a function was called in
        Python.
        """
        if not self.called:
            return contextlib.nullcontext()
        from smc_mujoco.simulation import python_functions

        return python_functions.hearing_ctrl_c(self.called)

    def stop(self) -> None:
        """Let the callback do nothing more: it calls no law. The slice soon ends, and is the
        last.
        """
        self.stopped = True
        self.records["failure"] = state.INTERRUPTED

    def trace(self, i: int) -> Trace:
        """Return the Trace of simulation i."""
        code = int(self.records["failure"][i])
        if code == state.FINE:
            step, failure = self.spoiled(i)
        else:
            step = int(self.records["failed_step"][i])
            failure = self.failure(i, code)
        scenario = self.prepared[i].scenario
        return from_log(scenario, self.logs[i], step, failure)

    def spoiled(self, i: int) -> tuple[int, str | None]:
        """Return why simulation i counts as failed though it came to its end, or None, and from
        which physics step on.
        """
        plant = self.scenarios[i].plant
        if not (self.model.npair or plant.is_user_model):
            return 0, None
        data = self.batch.get_data(i, self.scratch)
        if any(data.warning[kind].number for kind in FULL_WARNINGS):
            return 0, LOST_CONTACTS
        if plant.has_user_joints:
            from smc_mujoco.mechanisms.custom import scales

            if scales.tips_over(self.model, data):
                return self.step, TIPPED_OVER
        return 0, None

    def failure(self, i: int, code: int) -> str:
        """Return the failure of simulation i in words."""
        sentences = {
            state.DIVERGED: self.errors.get(i, PLANT_DIVERGED),
            state.INTERRUPTED: INTERRUPTED,
            state.DISTURBANCE_NOT_FINITE: DISTURBANCE_NOT_FINITE,
        }
        if code in sentences:
            return sentences[code]
        if why := self.python_failure(i):
            return why
        if code in (state.LAW_RAISED, state.NOT_FINITE) and (why := self.law_failure(i)):
            return why
        if self.python:
            return "a compiled function of the run failed, and the same in Python did not"
        again = ScenarioBatch([self.prepared[i]], threads=1, python=True)
        again.simulate(lambda steps: None)
        return again.failure(0, int(again.records["failure"][0]))

    def python_failure(self, i: int) -> str:
        """Return what a function of simulation i that is called in Python raised; "" if none
        did.
        """
        for function in self.packed[i].python:
            if function.error is not None:
                return function.message(int(self.records["seen"]["i"][i]))
        return ""

    def law_failure(self, i: int) -> str:
        """Return what the law of simulation i raised, or the u and s in its record.

        Compiled code keeps no text of an exception, so its law is called again in Python. Return ""
        if it raises none there, because it had changed its memory before it raised.
        """
        s = self.scenarios[i]
        record = self.records[i]
        numbers = self.packed[i].numbers
        n = s.plant.n
        channel = int(record["seen"]["i"])
        width = int(record["width"])
        place = int(record["commands"])
        commands = state.array_at(numbers, place, (2, width))
        start = int(record["law"]["memory"])
        slots = state.array_at(numbers, start, (n, s.law.memory))
        memory = slots.copy()
        if s.law.joint:
            law = s.law
            y = int(record["joint"])
        else:
            law = s.law.of_channel(channel)
            memory = memory[channel]
            rows = self.records[i : i + 1]
            y = state.address(rows) + state.AT.y
        if not self.packed[i].python:
            from smc_mujoco.simulation import python_functions

            function = python_functions.of_component(law, s)
            outputs = np.empty(2 * width)
            places = (y, 0, memory.ctypes.data, outputs.ctypes.data)
            function.call(*map(python_functions.pointer, places))
            if function.error is not None:
                return function.message(channel)
        if record["failure"] == state.LAW_RAISED:
            return ""
        u, sliding = commands[:, channel % width].tolist()
        return f"law {s.law.name!r} returned u = {u:g}, s = {sliding:g} in channel {channel}"
