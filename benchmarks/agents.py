"""What an environment's step costs, beside dm_control's and gymnasium's own, all in one run.

    make bench            or            python benchmarks/agents.py [--quick]

Only ratios within one run mean anything on a shared machine; each is the median over rounds that
alternate between the two sides. Single environments are measured in processor time, which other
work does not stretch, batches in wall time. Here a step is one RK4 step of 1 ms. In dm_control's
pendulum it is one Euler step. In gymnasium's InvertedPendulum it is two RK4 steps, which take a
third of its time; so the last row counts those one by one.
"""

import importlib.util
import statistics
import sys
import time
import warnings
from collections.abc import Callable

import mujoco
import numpy as np
from rich.console import Console
from rich.table import Table

from smc_mujoco.envs import dm_control_env

QUICK = "--quick" in sys.argv
ROUNDS = 5 if QUICK else 15
STEPS = 1_000 if QUICK else 3_000
COPIES = 1024
console = Console()


def seconds(action: Callable[[], object], clock: Callable[[], float]) -> float:
    """How long an action takes."""
    start = clock()
    action()
    return clock() - start


def compare(
    table: Table, what: str, one: tuple, other: tuple, target: str, clock=time.perf_counter
) -> None:
    """A row: microseconds per step of (action, steps) and of another, and the median over rounds of
    their ratio.
    """
    for action, _ in (one, other):
        action()
    rounds = [
        (seconds(one[0], clock) * 1e6 / one[1], seconds(other[0], clock) * 1e6 / other[1])
        for _ in range(ROUNDS)
    ]
    a, b = (statistics.median(side) for side in zip(*rounds, strict=True))
    r = statistics.median(x / y for x, y in rounds)
    table.add_row(what, f"{a:.2f}", f"{b:.2f}", f"{r:.2f}", target)


def stepping(environment, action) -> tuple[Callable[[], object], int]:
    """STEPS steps of an environment of dm_env or gymnasium."""

    def steps() -> None:
        environment.reset()
        for _ in range(STEPS):
            environment.step(action)

    return steps, STEPS


def singles(table: Table) -> None:
    """One environment: ours beside dm_control's pendulum."""
    import gymnasium
    from dm_control import suite as theirs

    endless = {"duration": 1e4}
    peer = stepping(
        theirs.load("pendulum", "swingup", task_kwargs={"time_limit": float("inf")}), np.zeros(1)
    )
    for plant in ("inverted_pendulum", "duffing", "van_der_pol"):
        mine = stepping(dm_control_env.load(plant, changes=endless), np.zeros(1))
        compare(
            table,
            f"dm_env {plant} / dm_control pendulum, per step",
            mine,
            peer,
            "<= 1.5",
            time.process_time,
        )
    mine = stepping(
        gymnasium.make("smc_mujoco:smc/InvertedPendulum-v0", changes=endless), np.zeros(1)
    )
    compare(
        table,
        "gymnasium inverted_pendulum / dm_control pendulum, per step",
        mine,
        peer,
        "<= 1.5",
        time.process_time,
    )


def vectors(table: Table) -> None:
    """Many copies: gymnasium's SyncVectorEnv of its InvertedPendulum beside our Batch."""
    import gymnasium

    ours = gymnasium.make_vec("smc_mujoco:smc/InvertedPendulum-v0", num_envs=COPIES)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # glfw misses a display that nobody asked for
        theirs = gymnasium.make_vec(
            "InvertedPendulum-v5", num_envs=COPIES, vectorization_mode="sync"
        )
    count = 20 if QUICK else 50
    skip = theirs.unwrapped.envs[0].unwrapped.frame_skip  # pyright: ignore[reportAttributeAccessIssue] of a vector of environments

    def steps(environments) -> Callable[[], object]:
        actions = np.zeros(environments.action_space.shape, environments.action_space.dtype)
        environments.reset(seed=0)
        return lambda: [environments.step(actions) for _ in range(count)]

    a = steps(theirs)
    b = steps(ours)
    compare(
        table,
        f"SyncVectorEnv / ours, {COPIES} copies, per step of a copy",
        (a, count * COPIES),
        (b, count * COPIES),
        ">= 10",
    )
    compare(table, "the same, per RK4 step", (a, count * COPIES * skip), (b, count * COPIES), "")


if __name__ == "__main__":
    if importlib.util.find_spec("gymnasium") is None:
        sys.exit("gymnasium is not installed: make bench installs it")
    table = Table(title="microseconds per step", title_justify="left")
    for head in ("comparison", "first", "second", "ratio", "target"):
        table.add_column(head, justify="left" if head == "comparison" else "right")
    for part in (singles, vectors):
        part(table)
    console.print(table)
    console.print(
        f"mujoco {mujoco.__version__}, median of {ROUNDS} alternating rounds, one machine, one run"
    )
