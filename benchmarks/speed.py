"""How fast: the callback path beside bare mj_step, threads, networks, and other packages, all in
one run.

    make bench            or            python benchmarks/speed.py [--quick] [--write]

README's figures are those of benchmarks/speed.json, which --write writes.

Times are of the processor, so that other work on the machine counts little; those of two threads
are elapsed. A ratio is the median over rounds that alternate between the two sides. A peer that is
not installed is left out by name.

MuJoCo's timers are off during a run, and its model has no scenery. So a step of a run is compared
with two steps without a law: a plain mj_step, with timers and scenery, and a bare one without them,
which shows what the callback takes.
"""

import contextlib
import dataclasses
import functools
import importlib.util
import json
import statistics
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
from mujoco.batch import Batch
from rich.console import Console
from rich.table import Table

import smc_mujoco as smc
from smc_mujoco.common import mjcb
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.callback import installed
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.run import ScenarioBatch

QUICK = "--quick" in sys.argv
ROUNDS = 3 if QUICK else 9
STEPS = 2_000 if QUICK else 10_000
BARE = functools.partial(mjcb.installed, None)  # neither the callback nor MuJoCo's timers
MEASURED = Path(__file__).with_suffix(".json")
console = Console()
measured: dict[str, float] = {}  # what --write writes: time of a step over that of a bare one


def seconds(action: Callable[[], object], clock: Callable[[], float]) -> float:
    """How long an action takes."""
    start = clock()
    action()
    return clock() - start


def ratio(
    one: Callable[[], object],
    other: Callable[[], object],
    clock: Callable[[], float] = time.process_time,
) -> tuple[float, float, float]:
    """Seconds of each, and the median over rounds of their ratio."""
    for action in (one, other):
        action()
    rounds = [(seconds(one, clock), seconds(other, clock)) for _ in range(ROUNDS)]
    ones, second_times = zip(*rounds, strict=True)
    return (
        statistics.median(ones),
        statistics.median(second_times),
        statistics.median(a / b for a, b in rounds),
    )


def batch_of(scenario: smc.Scenario, runs: int, threads: int = 1) -> ScenarioBatch:
    """A batch of equal runs, ready to step."""
    with installed():
        return ScenarioBatch(
            [prepare(dataclasses.replace(scenario, seed=seed)) for seed in range(runs)], threads
        )


def stepping(
    batch: ScenarioBatch,
    steps: int,
    within: Callable[[], contextlib.AbstractContextManager] = installed,
) -> Callable[[], None]:
    """Steps of a batch from its present state, with the callback or BARE."""
    start = batch.batch.state.copy()
    records = batch.records.copy()
    numbers = [packed.numbers.copy() for packed in batch.packed]

    def action() -> None:
        batch.batch.state[:], batch.records[:] = start, records
        for packed, first in zip(batch.packed, numbers, strict=True):
            packed.numbers[:] = first
        with within():
            batch.batch.step(nstep=steps)

    return action


def plain_batch(scenario: smc.Scenario, runs: int, threads: int = 1) -> Batch:
    """A batch of a plant's whole model, with scenery.

    It is stepped outside of `installed`, with MuJoCo's timers.
    """
    first = scenario.resolved
    model = models.with_values(models.compile_model(first), first)
    batch = Batch(model, runs, threads)
    batch.bind("qpos")[:], batch.bind("qvel")[:] = models.initial_state(model, first)
    return batch


def plain_steps(scenario: smc.Scenario, runs: int, steps: int) -> Callable[[], None]:
    """Plain mj_step of equal runs from their first state."""
    batch = plain_batch(scenario, runs)
    start = batch.state.copy()

    def action() -> None:
        batch.state[:] = start
        batch.step(nstep=steps)

    return action


def callback_against_mj_step(table: Table) -> None:
    """The same plant, stepped with the callback, plainly and bare, one thread."""
    disturbed = {
        "noise": smc.Noise(position=0.01, velocity=0.05),
        "disturbance": smc.Sine(0.2, 5.0),
    }
    for name, fields, targets in (
        ("alone", {}, (1.08, 1.08)),
        ("with noise and disturbance", disturbed, (1.20, 1.10)),
    ):
        for integrator, target in zip(("Euler", "RK4"), targets, strict=True):
            scenario = dataclasses.replace(
                smc.paper.scenario("inverted_pendulum", "super_twisting"),
                integrator=integrator,
                **fields,
            )
            batch = batch_of(scenario, 16)
            # both before the first step
            with_law, bare = stepping(batch, STEPS), stepping(batch, STEPS, BARE)
            plain = plain_steps(scenario, 16, STEPS)
            per = 1e6 / (16 * STEPS)
            for rival, steps, goal in (
                ("mj_step", plain, f"<= {target}"),
                ("bare mj_step", bare, ""),
            ):
                a, b, r = ratio(with_law, steps)
                row(table, f"callback / {rival}, {integrator}, {name}", a * per, b * per, r, goal)
                if rival == "bare mj_step":
                    measured[f"{integrator}, {name}"] = round(r, 3)


def threads(table: Table) -> None:
    """Simulated steps per second on two threads against one."""
    scenario = smc.paper.scenario("inverted_pendulum", "super_twisting")
    single, two = (stepping(batch_of(scenario, 64, n), STEPS // 4) for n in (1, 2))
    a, b, r = ratio(single, two, time.perf_counter)
    per = 1e6 / (64 * (STEPS // 4))
    row(table, "1 thread / 2 threads", a * per, b * per, r, ">= 1.8")


def networks(table: Table) -> None:
    """Microseconds per step and pendulum of a long chain against a short one."""
    actions = []
    for n in (1000, 100):
        law = smc.law("observer_free", lam=2.922, k1=6.19)
        scenario = smc.Scenario(plant=smc.plant("pendulum_network", n=n), law=law, duration=1.0)
        actions.append(stepping(batch_of(scenario, 1000 // n), STEPS // 50))
    a, b, r = ratio(*actions)
    per = 1e6 / (1000 * (STEPS // 50))
    row(table, "network n = 1000 / n = 100, per pendulum", a * per, b * per, r, "<= 1.3")


def peers(table: Table) -> None:
    """One simulation with a controller, as each package's users write it; microseconds per
    simulated step.
    """
    ours = batch_of(smc.paper.scenario("inverted_pendulum", "super_twisting"), 1)
    mine = stepping(ours, STEPS)
    for name, module, make in (
        ("dm_control suite pendulum", "dm_control", dm_control_steps),
        ("gymnasium InvertedPendulum", "gymnasium", gymnasium_steps),
        ("opensmc 2.0.0 simulator", "opensmc", opensmc_steps),
    ):
        if importlib.util.find_spec(module) is None:
            console.print(f"{module} is not installed: make bench installs it", style="yellow")
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # glfw misses a display that nobody asked for
            action, steps = make()
        ratio_steps = steps / STEPS
        a, b, r = ratio(action, mine)
        row(table, f"{name} / ours, RK4", a * 1e6 / steps, b * 1e6 / STEPS, r / ratio_steps, "> 1")


def dm_control_steps() -> tuple[Callable[[], object], int]:
    """dm_control's pendulum swing-up with a sliding-mode agent; it takes `n_sub_steps` physics
    steps a control step.
    """
    from dm_control import suite

    environment = suite.load("pendulum", "swingup", task_kwargs={"time_limit": float("inf")})
    count = STEPS // 20

    def action() -> None:
        environment.reset()
        physics = environment.physics
        for _ in range(count):
            s = physics.angular_velocity()[0] + 3.0 * np.arctan2(*physics.pole_orientation()[::-1])
            environment.step(np.array([-np.sign(s)]))

    return action, count * round(environment.control_timestep() / environment.physics.timestep())


def gymnasium_steps() -> tuple[Callable[[], object], int]:
    """gymnasium's InvertedPendulum-v5 with a sliding-mode agent."""
    import gymnasium

    environment = gymnasium.make("InvertedPendulum-v5").unwrapped
    count = STEPS // 20

    def action() -> None:
        state, _ = environment.reset(seed=0)
        for _ in range(count):
            s = state[3] + 3.0 * state[1]
            state, *_ = environment.step(np.array([3.0 * np.sign(s)], np.float32))

    return action, count * environment.frame_skip  # pyright: ignore[reportAttributeAccessIssue] of gymnasium's MuJoCo environments


def opensmc_steps() -> tuple[Callable[[], object], int]:
    """opensmc's own RK4 simulator: its classical law on its double integrator, the least work it
    has.
    """
    from opensmc.controllers import ClassicalSMC
    from opensmc.plants import DoubleIntegrator
    from opensmc.reaching import ConstantRate
    from opensmc.simulator import Simulator
    from opensmc.surfaces import LinearSurface

    count = STEPS // 20
    simulator = Simulator(dt=1e-3, T=count * 1e-3)
    controller = ClassicalSMC(surface=LinearSurface(c=3.0), reaching=ConstantRate(k=4.0))
    return (lambda: simulator.run(controller, DoubleIntegrator(), x0=np.array([1.0, 0.0]))), count


def row(table: Table, what: str, a: float, b: float, r: float, target: str) -> None:
    table.add_row(what, f"{a:.3f}", f"{b:.3f}", f"{r:.2f}", target)


if __name__ == "__main__":
    table = Table(
        title="microseconds per simulated step (per pendulum in networks)", title_justify="left"
    )
    for head in ("comparison", "first", "second", "ratio", "target"):
        table.add_column(head, justify="left" if head == "comparison" else "right")
    for part in (callback_against_mj_step, threads, networks, peers):
        part(table)
    console.print(table)
    if "--write" in sys.argv:
        MEASURED.write_text(json.dumps(measured, indent=1) + "\n")
    console.print(
        f"mujoco {mujoco.__version__}, median of {ROUNDS} alternating rounds, one machine, one run"
    )
