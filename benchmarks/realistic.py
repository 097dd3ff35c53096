"""How fast realistic mechanisms run: steps per second on two threads, and beside bare mj_step of
the same model.

    python benchmarks/realistic.py [--quick]

Every one-joint plant with every part, and under every contact that it offers, while that is
touched. Each number is the median over rounds; the ratio is that of rounds which alternate between
the two sides. The target is 250,000 steps a second of simulations that step side by side.
"""

import dataclasses
import os
import statistics
import time

import mujoco
from rich.console import Console
from rich.table import Table
from speed import BARE, ROUNDS, STEPS, batch_of, ratio, seconds, stepping

import smc_mujoco as smc
from smc_mujoco.simulation.model import parts

TARGET = 250_000  # steps a second, on two threads
RUNS = 32
THREADS = 2
console = Console(width=130)

PARTS = {
    "ideal, implicitfast": {"integrator": "implicitfast", "physics_step": 2.5e-4},
    "viscous": {"friction": smc.Viscous(0.1)},
    "coulomb": {"friction": smc.Coulomb(0.05)},
    "lugre": {"friction": smc.hardware.LuGre(coulomb=0.05, static=0.08, stribeck=0.01)},
    "lag": {"actuator": smc.Lag(0.01)},
    "rate limit": {"actuator": smc.hardware.RateLimit(100.0)},
    "dc motor": {"actuator": smc.DCMotor()},
    "backlash": {"actuator": smc.Backlash(0.02)},
    "encoder": {"sensor": smc.Encoder(4096, dropout=0.1, delay=2e-3), "friction": smc.Viscous(0.1)},
    "gust": {
        "disturbance": smc.signals.Gust(2.0, time=0.0, width=10.0),
        "friction": smc.Viscous(0.1),
    },
    "lugre, motor, backlash, encoder": {
        "friction": smc.hardware.LuGre(coulomb=0.05, static=0.08, stribeck=0.01),
        "actuator": (smc.DCMotor(), smc.Backlash(0.02)),
        "sensor": smc.Encoder(4096),
    },
}
STARTS = {  # from which a contact is touched soon and for long
    "floor": {"inverted_pendulum": {"law": smc.law("none"), "x0": 2.3, "v0": 1.0}},
    "wall": {"inverted_pendulum": {"law": smc.law("none"), "x0": 0.6, "v0": 1.0}},
    "stops": {"inverted_pendulum": {"law": smc.law("none"), "x0": 0.9, "v0": 1.0}},
}


def cases(plant: str) -> dict[str, smc.Scenario]:
    """Name -> scenario of a plant with one part, mechanism or contact."""
    offered = smc.plant(plant)
    fields = PARTS | {f"mechanism {name}": {"mechanism": name} for name in offered.mechanisms}
    fields |= {
        f"contact {kind}": {"contact": kind} | STARTS.get(kind, {}).get(plant, {})
        for kind in offered.contacts
    }
    gains = smc.paper.GAINS[plant]["observer_free"]
    plain = smc.Scenario(plant=plant, law=smc.law("observer_free", **gains))  # pyright: ignore[reportArgumentType]
    return {name: dataclasses.replace(plain, **changes) for name, changes in fields.items()}


def measure(scenario: smc.Scenario) -> tuple[float, float]:
    """Steps per second on two threads, and on one thread the time of the callback path over that of
    a bare mj_step.
    """
    steps = STEPS // 4
    together = stepping(batch_of(scenario, RUNS, THREADS), steps)
    together()
    rate = (
        RUNS
        * steps
        / statistics.median(seconds(together, time.perf_counter) for _ in range(ROUNDS))
    )
    alone = batch_of(scenario, 4)
    return rate, ratio(stepping(alone, steps), stepping(alone, steps, BARE))[2]


if __name__ == "__main__":
    table = Table(title="steps a second of realistic one-joint plants", title_justify="left")
    for head in ("plant", "part", "steps/s, 2 threads", f"target {TARGET:,}", "callback / mj_step"):
        table.add_column(head, justify="left" if head in ("plant", "part") else "right")
    for plant in (name for name in smc.plants() if smc.plant(name).n == 1):
        for name, scenario in cases(plant).items():
            rate, over = measure(scenario)
            verdict = "met" if rate >= TARGET else "[red]missed"
            if len(parts(scenario)) > 1:
                words = f"{name} ({len(parts(scenario))} parts)"
            else:
                words = name
            table.add_row(plant, words, f"{rate:,.0f}", verdict, f"{over:.2f}")
    console.print(table)
    load = ", ".join(f"{x:.1f}" for x in os.getloadavg())
    console.print(
        f"mujoco {mujoco.__version__}, {os.cpu_count()} cores, load {load}, median of {ROUNDS} "
        "rounds"
    )
