"""Time per control sample of every law and velocity estimator, beside the classical law.

    python benchmarks/laws.py [--quick]

"call" is the law's compiled C function alone, on states that vary from sample to sample. "sample"
is all that the callback does once a control period in a channel - read, estimate, nominal model,
law, clip, log - with that law in it, for a row of 100 pendulums; its target is 3x the classical
law. The target of `mpc`, which solves a program where bounds come and go, as on these states, is 4x
pid for the median over the samples of a run. Only ratios within one run mean anything on a shared
machine; each number is the least of several rounds, as other work only adds to it.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import sys
import time
from collections.abc import Callable

import mujoco
import numpy as np
from numba import njit
from rich import box
from rich.console import Console
from rich.table import Table

import smc_mujoco as smc
from smc_mujoco.analysis.law_time import law_time
from smc_mujoco.common.jit import call
from smc_mujoco.control.component import Component
from smc_mujoco.control.estimator import estimator_catalogue as estimators
from smc_mujoco.control.law import Measurement
from smc_mujoco.control.law import law_catalogue as laws
from smc_mujoco.simulation import cfunctions
from smc_mujoco.simulation.callback import callback, installed
from smc_mujoco.simulation.grid import case
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.run import ScenarioBatch
from smc_mujoco.simulation.state import FINE

QUICK = "--quick" in sys.argv
if QUICK:
    CALLS = 50_000
    ROUNDS = 5
else:
    CALLS = 200_000
    ROUNDS = 15
if QUICK:
    SAMPLES = 200
    PENDULUMS = 100
else:
    SAMPLES = 500
    PENDULUMS = 100
# times the classical law; other laws; times pid, in a run
MOST, SOLVERS, MOST_OF_PID = 3.0, ("mpc",), 4.0
AT = {name: i for i, name in enumerate(Measurement._fields)}
E = AT["e"]
DE = AT["de"]
A = AT["a"]


@njit
def drive(function, y, gains, memory, out, states, addresses):
    """Call a C function once per state."""
    total = 0.0
    for k in range(len(states)):
        y[E], y[DE], y[A] = states[k, 0], states[k, 1], states[k, 2]
        call(function, addresses[0], addresses[1], addresses[2], addresses[3])
        total += out[0]
    return total


@njit
def read(function, y, gains, memory, out, states, addresses):
    """Call an estimator once per state."""
    total = 0.0
    for k in range(len(states)):
        y[1], y[2] = states[k, 0], states[k, 1]
        call(function, addresses[0], addresses[1], addresses[2], addresses[3])
        total += out[0]
    return total


def nanoseconds(component: Component, loop: Callable, model: float = 0.0) -> float:
    """Least time per call over the rounds, with the loop that calls."""
    function = cfunctions.compile_component(component)
    y = np.zeros(len(AT))
    out = np.zeros(3)
    if loop is drive:
        for name, value in (("dt", 1e-3), ("g", 8.0), ("limit", 6.0), ("model", model), ("f", 1.0)):
            y[AT[name]] = value
    else:
        y[0] = 1e-3
    gains = np.array([*component.gains.values(), 0.0])
    memory = np.zeros(max(component.memory, 1))
    addresses = np.array([a.ctypes.data for a in (y, gains, memory, out)])
    t = np.arange(CALLS) * 1e-3
    states = np.column_stack([0.3 * np.sin(7 * t), 2.1 * np.cos(7 * t), -14.7 * np.sin(7 * t)])
    least = np.inf
    for _ in range(ROUNDS):
        memory[:] = 0.0
        start = time.perf_counter()
        loop(function.address, y, gains, memory, out, states, addresses)
        least = min(least, time.perf_counter() - start)
    return 1e9 * least / CALLS


def sample(law: str, velocity: str = "measured") -> float:
    """Least ns of the callback per control sample and channel: a row of pendulums, sampled without
    being stepped.
    """
    scenario = smc.Scenario(
        plant=smc.plant("pendulum_network", n=PENDULUMS),
        law=law,
        velocity=velocity,
        integrator="Euler",
        duration=1.0,
    )
    with installed():
        batch = ScenarioBatch([prepare(scenario)], 1)  # keeps what its record points to
        data = mujoco.MjData(batch.model)
        record = batch.records.copy()
        numbers = batch.packed[0].numbers.copy()
        userdata = batch.batch.bind("userdata")[0].copy()
        phase = np.linspace(0.0, 40.0, PENDULUMS)
        data.qpos[:], data.qvel[:] = 0.3 * np.sin(phase), 2.1 * np.cos(phase)
        mujoco.mj_forward(batch.model, data)
    function = callback().ctypes
    model = batch.model._address
    address = data._address
    moved = phase + 7e-3 * np.arange(SAMPLES)[:, None]
    seen = np.empty((SAMPLES, len(data.sensordata)))  # position and velocity, channel by channel
    seen[:, 0::2], seen[:, 1::2] = 0.3 * np.sin(moved), 2.1 * np.cos(moved)
    least = np.inf
    for _ in range(ROUNDS):
        data.userdata[:], batch.records[:], batch.packed[0].numbers[:] = userdata, record, numbers
        start = time.perf_counter()
        for k in range(SAMPLES):
            data.sensordata[:] = seen[k]
            function(model, address)
        least = min(least, time.perf_counter() - start)
        assert batch.records["failure"][0] == FINE, law
    return 1e9 * least / (SAMPLES * PENDULUMS)


def general(name: str) -> bool:
    """Whether a law is for the pendulums of the measurement."""
    template = laws()[name]
    return template.relative_degree < 3 and (
        not template.plants or "pendulum_network" in template.plants
    )


def main() -> None:
    """Print the two tables."""
    console = Console()
    call_base = nanoseconds(smc.law("classical"), drive)
    sample_base = sample("classical")
    table = Table(box=box.SIMPLE_HEAD, title="Laws, ns", title_justify="left")
    for head in ("law", "call", "with model", "x classical", "sample", "x classical"):
        table.add_column(head, justify="left" if head == "law" else "right", no_wrap=True)
    rows = []
    worst = 0.0
    for name in laws():
        blind, seeing = (nanoseconds(smc.law(name), drive, model) for model in (0.0, 1.0))
        sample_time = sample(name) if general(name) else np.nan
        worst = max(
            worst, sample_time / sample_base if general(name) and name not in SOLVERS else 0.0
        )
        rows.append((blind, name, seeing, sample_time))
    for blind, name, seeing, sample_time in sorted(rows):
        if np.isnan(sample_time):
            cells = ("", "")
        else:
            cells = (f"{sample_time:.0f}", f"{sample_time / sample_base:.2f}")
        table.add_row(name, f"{blind:.1f}", f"{seeing:.1f}", f"{blind / call_base:.1f}", *cells)
    console.print(table)
    verdict = "held" if worst <= MOST else "missed"
    console.print(
        f"largest time per sample: {worst:.2f}x classical, target <= {MOST:g}x: {verdict}",
        highlight=False,
    )
    for name in SOLVERS:
        timed = law_time(case("duffing", name, "nominal", 2.0, "tuned", 0))
        assert timed is not None
        if timed.ratio <= MOST_OF_PID:
            verdict = "held"
        else:
            verdict = "missed"
        words = (
            f"{1e9 * timed.median:.0f} ns, 99 % {1e9 * timed.high:.0f} ns, {timed.ratio:.2f}x pid"
        )
        console.print(
            f"{name} in a run: {words}, target <= {MOST_OF_PID:g}x: {verdict}", highlight=False
        )
    table = Table(box=box.SIMPLE_HEAD, title="Velocity estimators, ns", title_justify="left")
    for head in ("estimator", "call", "x classical", "sample", "x measured"):
        table.add_column(head, justify="left" if head == "estimator" else "right", no_wrap=True)
    for name in estimators():
        spent = nanoseconds(smc.estimator(name), read)
        sample_time = sample("classical", name)
        table.add_row(
            name,
            f"{spent:.1f}",
            f"{spent / call_base:.1f}",
            f"{sample_time:.0f}",
            f"{sample_time / sample_base:.2f}",
        )
    console.print(table)


if __name__ == "__main__":
    main()
