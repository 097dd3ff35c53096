"""The loop of a form on the processor, in threads."""

# pyright: reportCallIssue=false
import functools
from collections.abc import Iterator
from typing import Any

import numpy as np

from smc_mujoco.analysis.engine import noise
from smc_mujoco.analysis.engine.calls import View, compiled_once
from smc_mujoco.analysis.engine.form import FAILURE, SCORES, SETTING, UNDER_WAY, Form, layout
from smc_mujoco.analysis.engine.loop import simulation
from smc_mujoco.common.aliases import Array
from smc_mujoco.common.attended import attended
from smc_mujoco.common.jit import inlined, jit, pointer
from smc_mujoco.simulation.state import RAISED, address

# in a call of compiled code: .05 s of a core, or .15 with dry friction
PIECE_STEPS = 500_000
# Runs that are taken in turn, sample by sample: each number of a run waits for the one before, and
# meanwhile the processor computes another run. Chosen: a third gains nothing.
LANES = 2


@functools.lru_cache(maxsize=64)
def compiled_runs(form: Form) -> Any:
    """Return the compiled runs of a form, (count, addresses of rows, tables, work, scores and
    logs, bytes of a log). `work` has the state of LANES runs.
    """
    start, take = simulation(form, jit, noise.drawn_ahead(form))
    row_bytes = 8 * layout(form).row_size
    work_bytes = 8 * _work_size(form)
    score_bytes = 8 * (SCORES + len(form.metrics))

    @inlined
    def view(i, lane, rows, tables, work):
        return View(
            pointer(rows + row_bytes * i), pointer(tables), pointer(work + work_bytes * lane)
        )

    def runs(count, rows, tables, work, scores, logs, log_bytes):
        for first in range(0, count, LANES):
            last = min(first + LANES, count)
            samples = 0
            for i in range(first, last):
                scores_of_run = pointer(scores + score_bytes * i)
                samples = max(samples, start(view(i, i - first, rows, tables, work), scores_of_run))
            for k in range(samples + 1):
                for i in range(first, last):
                    scores_of_run = pointer(scores + score_bytes * i)
                    if scores_of_run[FAILURE] != UNDER_WAY:
                        continue
                    log = pointer(logs + log_bytes * i)
                    try:
                        take(view(i, i - first, rows, tables, work), scores_of_run, log, k)
                    except Exception:
                        scores_of_run[FAILURE] = RAISED

    return compiled_once(runs)


def _work_size(form: Form) -> int:
    """Return how many numbers the state of a run has."""
    return layout(form).work_size + noise.drawn_size(form)


def run_rows(
    form: Form, rows: Array, tables: Array, threads: int, logs: Array | None = None
) -> Array:
    """Return the scores of runs, (runs, SCORES + metrics), given their rows; NaN after a failure.

    `logs` is (runs, K + 1, n, 6) and gets `form.LOGGED`, if the rows say `logging`.
    """
    simulate = compiled_runs(form)
    rows = np.array(rows, order="C")  # a copy, in which `stop` writes
    width = SCORES + len(form.metrics)
    scores = np.full((len(rows), width), np.nan)
    if logs is None:
        logs = np.zeros((len(rows), 0))

    def piece(part: slice) -> None:
        work = np.zeros(LANES * _work_size(form))
        arrays = rows[part], tables, work, scores[part], logs[part]
        simulate(len(rows[part]), *map(address, arrays), logs[part].strides[0])

    def share() -> None:
        for part in parts:  # each thread takes the next piece that none has begun
            piece(part)

    def stop() -> None:
        rows[:, SETTING.step] = np.nan  # a run ends where its state is not finite

    pieces = list(_pieces(form, rows, threads))
    parts = iter(pieces)
    attended([share] * min(threads, len(pieces)), stop)
    return scores


def _pieces(form: Form, rows: Array, threads: int) -> Iterator[slice]:
    """Yield the runs of a call: a share for each thread, of at most PIECE_STEPS."""
    if not len(rows):
        return
    steps = rows[:, SETTING.samples] * rows[:, SETTING.steps]
    longest = np.max(steps) * form.n
    size = max(1, min(-(-len(rows) // threads), int(PIECE_STEPS // longest)))
    for first in range(0, len(rows), size):
        yield slice(first, first + size)
