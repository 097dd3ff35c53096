"""What a study costs beside the simulation alone: 4,400 runs of 10 s at 1 ms, against plain
mj_step.

    python benchmarks/study.py [--quick]

5 plants x 4 laws x 11 conditions x 20 seeds; --quick takes 2 of the seeds. The study is all that
`smc.study` does: looking up what is there, running with laws, noise and delays, scoring, writing
parts and table. Plain is mj_step of the same plants, as often and on as many threads, without a
controller. Both take turns, a slice of the grid at a time, so that what else the machine does falls
on both. Compiling the laws, once a process, is left out. The targets are 1.3 and 1.5 GB.
"""

import resource
import shutil
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import track
from speed import plain_batch

import smc_mujoco as smc
from smc_mujoco.simulation import gaber_study as paper
from smc_mujoco.simulation.grid import grid
from smc_mujoco.simulation.run import cores
from smc_mujoco.studies import batches
from smc_mujoco.studies.study import study

QUICK = "--quick" in sys.argv
# All at the control period of 1 ms, with the plant's plain equation.
CONDITIONS = [
    "nominal",
    "noise",
    "sine",
    "constant",
    "step",
    "pulse",
    "process_noise",
    "delay_10ms",
    "heavy",
]
CONDITIONS += ["jump_mild", "differenced_5ms_noise"]
SEEDS = range(2) if QUICK else range(20)
SLICE = 2 if QUICK else 5  # seeds
MOST, MEMORY = 1.3, 1.5e9  # times plain mj_step; bytes
console = Console()


def slices() -> list[list[smc.Scenario]]:
    """The grid in slices of one plant and some seeds."""
    parts = [SEEDS[i : i + SLICE] for i in range(0, len(SEEDS), SLICE)]
    return [
        grid([plant], paper.LAWS, CONDITIONS, seeds, "study")
        for seeds in parts
        for plant in paper.PLANTS
    ]


def plain(scenarios: Sequence[smc.Scenario], threads: int) -> float:
    """Seconds of stepping these plants, in the same batches, without the callback."""
    spent = 0.0
    for prepared in batches.batches(scenarios):
        scenario = prepared[0].scenario
        batch = plain_batch(scenario, len(prepared), min(threads, len(prepared)))
        start = time.perf_counter()
        batch.step(nstep=scenario.samples * scenario.steps)
        spent += time.perf_counter() - start
    return spent


def main() -> None:
    """Print the ratio and the memory."""
    threads = cores()
    out = Path(tempfile.mkdtemp())
    study(grid(paper.PLANTS, paper.LAWS, CONDITIONS, 1, "study", duration=5.1), out / "compiled")
    studied = simulated = 0.0
    grids = slices()
    try:
        for number, scenarios in enumerate(track(grids, "slices", console=console, transient=True)):
            for side in ("study", "plain") if number % 2 else ("plain", "study"):
                if side == "plain":
                    simulated += plain(scenarios, threads)
                else:
                    start = time.perf_counter()
                    study(scenarios, out, threads=threads)
                    studied += time.perf_counter() - start
        start = time.perf_counter()
        table = study([s for scenarios in grids for s in scenarios], out, threads=threads)
        studied += time.perf_counter() - start
    finally:
        shutil.rmtree(out)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (
        1 if sys.platform == "darwin" else 1024
    )
    summary = (
        f"{len(table)} runs of 10 s, {threads} threads: study {studied:.1f} s, plain "
        f"mj_step {simulated:.1f} s"
    )
    console.print(summary, highlight=False)
    for what, value, most, unit in (
        ("ratio", studied / simulated, MOST, ""),
        ("peak", peak / 1e9, MEMORY / 1e9, " GB"),
    ):
        verdict = "held" if value <= most else "missed"
        console.print(
            f"{what} {value:.2f}{unit}, target <= {most:g}{unit}: {verdict}", highlight=False
        )


if __name__ == "__main__":
    main()
