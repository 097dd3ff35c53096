"""Scenarios of one layout in one Batch: from scenarios to rows, through the simulation, to traces."""

import math
from collections.abc import Callable, Sequence

import mujoco
import numpy as np

from smc_mujoco.control.component import Component
from smc_mujoco.mechanisms.hardware import encoder
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.plant import Coupled, Plant, array
from smc_mujoco.simulation import callback, controller, native, reference, state
from smc_mujoco.simulation import model as assembly
from smc_mujoco.simulation.channels import COLUMNS, channels
from smc_mujoco.simulation.guarded import retold
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Signal
from smc_mujoco.simulation.trace import Trace, from_log

# isort: split
from mujoco.batch import Batch, SimulationError  # by now imported by callback

PERFECT = Encoder(counts=math.inf)
SLICE_STEPS = 400_000  # physics steps times channels between two looks at the clock, about a second
FOREIGN_STEPS = 200  # of an own model: with its contacts MuJoCo takes 0.1 s and more a step once it has diverged
FULL = mujoco.mjtWarning.mjWARN_CONTACTFULL, mujoco.mjtWarning.mjWARN_CNSTRFULL
OVERFLOWED = "MuJoCo had no room for all contacts in the model's memory: give its <size> more memory"

Report = Callable[[int], None]  # told the number of simulated steps just done


def contents(scenario: Scenario) -> state.Contents:
    """What the scenario's row says, with everything it names compiled.

    Raises:
      NotCompilable: the law, the estimator, a signal or the plant's nominal model is not for numba.
    """
    sensor = scenario.sensor or PERFECT
    return state.Contents(
        law=_component(scenario.law),
        model=scenario.model == "nominal",
        surface=scenario.surface and _component(scenario.surface),
        estimator=_component(scenario.velocity),
        nominal=_nominal(scenario.plant),
        reference=_signal(scenario.reference),
        disturbances=[_signal(d, scenario.stream(i)) for i, d in enumerate(scenario.disturbance)],
        n=scenario.plant.n,
        steps=scenario.steps,
        stages=scenario.stages,
        step=scenario.physics_step,
        period=scenario.control_period,
        delay=scenario.delay_steps,
        limit=scenario.u_max,
        limits=scenario.limits if scenario.plant.limits else (),
        seed=scenario.seed,
        sigma_x=scenario.noise.position,
        sigma_v=scenario.noise.velocity,
        scale=math.prod(part.scale for part in scenario.actuator),
        tandem=scenario.tandem,
        bias=sensor.bias,
        counts=0.0 if sensor.counts == math.inf else sensor.counts,
        lost=sensor.dropout,
        read_period=sensor.period or 0.0,
        read_delay=sensor.delay,
    )


class Chunk:
    """Scenarios of one layout in one Batch; to be made and run while the callback is installed."""

    def __init__(self, scenarios: Sequence[Scenario], threads: int):
        first = self.first = scenarios[0]
        self.scenarios = scenarios
        self.logs = [np.full((state.LOGS, first.samples + 1, first.plant.n), np.nan) for _ in scenarios]
        self.table = np.empty((first.plant.n, COLUMNS), np.int64)
        self.contents = [contents(scenario) for scenario in scenarios]  # whose addresses the rows hold
        rows = [
            state.pack(said, callback.mark(), self.table, log)
            for said, log in zip(self.contents, self.logs, strict=True)
        ]
        self.compiled = assembly.model(scenarios, nuserdata=max(map(len, rows)))
        self.model = assembly.numbered(self.compiled, first)
        self.table[:] = channels(self.model)
        for packed in rows:
            packed[state.POSITIONS], packed[state.VELOCITIES] = self.model.nq, self.model.nv
        # persistent: at a sample, mjData still holds the forces of this simulation's last step
        self.batch = Batch(self.model, len(scenarios), min(threads, len(scenarios)), persistent=True)
        self.batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        self.rows = self.batch.bind("userdata")
        qpos, qvel = self.batch.bind("qpos"), self.batch.bind("qvel")
        for i, (scenario, packed) in enumerate(zip(scenarios, rows, strict=True)):
            self.rows[i, : len(packed)] = packed
            qpos[i], qvel[i] = assembly.start(self.model, scenario)
        self.fields: dict[str, np.ndarray] = {}  # model fields that differ between the simulations
        self.errors: dict[int, str] = {}
        self.calls = 0  # of the callback that each simulation has had
        self.spare = mujoco.MjData(self.model)
        self.set_parameters(0, range(len(scenarios)))
        if self.model.nhistory:
            self.fill_histories()

    def run(self, report: Report) -> list[Trace]:
        """Simulate all of them to the end."""
        total = self.first.samples * self.first.steps
        starts = sorted({0} | {s.jump_step for s in self.scenarios if 0 < s.jump_step < total})
        for start, end in zip(starts, [*starts[1:], total], strict=True):
            if start:
                self.set_parameters(start, [i for i, s in enumerate(self.scenarios) if s.jump_step == start])
            self.advance(end - start, report)
        self.attempt(self.batch.forward, 1)  # the callback's last sample, at the end
        return [self.trace(i) for i in range(len(self.scenarios))]

    def set_parameters(self, step: int, indices: Sequence[int]) -> None:
        """Give simulations the true parameters that hold from a step on."""
        derived = []
        for i in indices:
            for name, value in assembly.numbers(self.compiled, self.scenarios[i], step).items():
                held = self.fields[name][i] if name in self.fields else array(self.model, name)
                if np.any(held != value):
                    self.fields[name] = self.batch.expand(name)
                    self.fields[name][i] = value
                    derived.append(i)
        if derived:
            self.batch.set_const(np.unique(derived).astype(np.int32))

    def fill_histories(self) -> None:
        """Let late sensors have read the initial state before the run."""
        history = self.batch.bind("history")
        model, data = assembly.numbered(self.compiled, self.first), mujoco.MjData(self.model)
        for i, scenario in enumerate(self.scenarios):
            data.qpos[:], data.qvel[:] = assembly.start(model, scenario)
            assembly.put_numbers(model, self.compiled, scenario, 0)
            encoder.remember(model, data)
            history[i] = data.history

    def advance(self, steps: int, report: Report) -> None:
        """Step the simulations that still run, in slices, so that progress shows and Ctrl-C is heard."""
        size = len(self.scenarios) * self.first.plant.n
        while steps:
            most = FOREIGN_STEPS if self.first.plant.direct else SLICE_STEPS // size
            count = min(steps, max(1, most))
            self.attempt(lambda alive, count=count: self.batch.step(alive, nstep=count), count * self.first.stages)
            report(count * size)
            steps -= count

    def attempt(self, action: Callable[[np.ndarray], None], calls: int) -> None:
        """Do something to the simulations that still run; note those in which MuJoCo raises, or that lack calls.

        Args:
          calls: how often it has the callback called in each.
        """
        alive = np.flatnonzero(self.rows[:, state.FAILURE] == state.FINE).astype(np.int32)
        before, self.calls = self.calls, self.calls + calls
        try:
            action(alive)
        except SimulationError as error:
            for i in error.ids:
                self.errors[int(i)] = " ".join(self.batch.error(int(i)).split())
                self.rows[i, state.FAILURE] = state.DIVERGED
                self.rows[i, state.FAILED_STEP] = self.rows[i, state.CALLS] // self.rows[i, state.STAGES]
        except (ValueError, mujoco.UnexpectedError) as error:
            if "allocate memory" in str(error):
                raise
            # someone's Python function took the callback's place; the count of calls tells
        short = [i for i in alive if i not in self.errors and self.rows[i, state.CALLS] != self.calls]
        self.rows[short, state.FAILURE], self.rows[short, state.FAILED_STEP] = (
            state.INTERRUPTED,
            before // self.first.stages,
        )

    def trace(self, i: int) -> Trace:
        """The Trace of simulation i."""
        scenario = self.scenarios[i]
        failure, step = int(self.rows[i, state.FAILURE]), int(self.rows[i, state.FAILED_STEP])
        reason = None if failure == state.FINE else self.reason(i, failure)
        if reason is None and (self.model.npair or scenario.plant.direct) and self.overflowed(i):
            reason, step = OVERFLOWED, 0
        return from_log(scenario, self.logs[i], step, reason)

    def overflowed(self, i: int) -> bool:
        """Whether MuJoCo left out contacts of simulation i because its memory for them was full."""
        warnings = self.batch.get_data(i, self.spare).warning
        return any(warnings[kind].number for kind in FULL)

    def reason(self, i: int, failure: int) -> str:
        """What went wrong in simulation i."""
        scenario = self.scenarios[i]
        if state.NOT_FINITE <= failure < state.INTERRUPTED:
            if told := retold(scenario, self.rows[i]):
                return told
            if told := reference.run(scenario).failure:
                return told.rpartition(", at t = ")[0]
        law, estimator = f"law {scenario.law.name!r}", f"estimator {scenario.velocity.name!r}"
        return {
            state.DIVERGED: self.errors.get(i, reference.LEFT_THE_WORLD),
            state.NOT_FINITE: f"{law} returned NaN, inf or a command above {controller.HUGE:g}",
            state.DISTURBANCE_NOT_FINITE: "the disturbance became NaN or inf",
            state.ESTIMATOR_RAISED: f"{estimator} raised an exception",
            state.REFERENCE_RAISED: f"reference {type(scenario.reference).__name__} raised an exception",
            state.NOMINAL_RAISED: f"the nominal model of {scenario.plant.name} raised an exception",
            state.LAW_RAISED: f"{law} raised an exception",
            state.DISTURBANCE_RAISED: "a disturbance raised an exception",
            state.INTERRUPTED: reference.INTERRUPTED,
            state.SURFACE_RAISED: f"surface {scenario.surface and scenario.surface.name!r} raised an exception",
        }[failure]


def _nominal(plant: Plant) -> state.Part:
    if isinstance(plant.nominal, Coupled):
        own = plant.nominal.native(plant.parameters)
        return state.Part(address=own.address, values=own.values, kept=own)
    names, values = tuple(plant.parameters), tuple(plant.parameters.values())
    return state.Part(address=native.nominal(plant.nominal, names).address, values=values)


def _component(c: Component) -> state.Part:
    return state.Part(address=native.component(c).address, values=tuple(c.gains.values()), memory=c.memory)


def _signal(s: Signal, stream: int = 0) -> state.Part:
    values, function = native.values_of(s), native.of_signal(s)
    return state.Part(address=function.address, values=values, memory=s.memory, stream=stream, cartesian=s.cartesian)
