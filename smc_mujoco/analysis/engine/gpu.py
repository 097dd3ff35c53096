"""The loop of a form on a CUDA device, a thread a run.

It needs the package numba-cuda: `pip install 'smc-mujoco[gpu]'`.
"""

# pyright: reportMissingImports=false, reportCallIssue=false, reportAttributeAccessIssue=false
import functools
import importlib
import warnings
from typing import Any

import numpy as np

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.extras import MissingPackageError, cure, extra

with extra("gpu", "device 'cuda'"):
    import numba_cuda  # noqa: F401  without it, numba has a device of its own

    if not hasattr(np, "row_stack"):  # numba-cuda 0.30 asks for it, and numpy 2.5 has none
        setattr(np, "row_stack", np.vstack)  # noqa: B010
        importlib.import_module("numba.cuda.np.arrayobj")
        delattr(np, "row_stack")
    from numba import cuda, float32, float64, njit, types
    from numba.extending import intrinsic

from smc_mujoco.analysis.engine import noise
from smc_mujoco.analysis.engine.calls import View
from smc_mujoco.analysis.engine.form import FAILURE, SCORES, UNDER_WAY, Form, layout
from smc_mujoco.analysis.engine.loop import simulation
from smc_mujoco.analysis.engine.world_callback import World, controlling
from smc_mujoco.common.aliases import Array
from smc_mujoco.common.numba_internals import cgutils

THREADS = 128  # in a block
PIECE = 2**18  # runs in a call of the device: they fill an H100, and Ctrl-C waits for them
ARGUMENTS = types.void(float64[:, ::1], float64[::1], float64[:, ::1])
OF_WORLDS = types.void(
    float64[:, ::1], float64[::1], float64[:, ::1], float64[:, ::1], *[float32[:, ::1]] * 4
)


@intrinsic
def _pointer(typingctx, array):
    """Return a pointer to the numbers of an array."""

    def codegen(context, builder, signature, args):
        return cgutils.create_struct_proxy(array)(context, builder, args[0]).data

    return types.CPointer(array.dtype)(array), codegen


def kernel(form: Form) -> Any:
    """Return the kernel of a form in Python, (rows, tables, scores)."""
    start, take = simulation(form, njit(error_model="numpy"), noise.drawn)
    row_size = layout(form).row_size
    work_size = layout(form).work_size
    score_size = SCORES + len(form.metrics)

    def runs(rows, tables, scores):
        run = cuda.grid(1)
        if run >= len(rows):
            return
        row = cuda.local.array(row_size, float64)
        work = cuda.local.array(work_size, float64)
        own_scores = cuda.local.array(score_size, float64)
        for i in range(row_size):
            row[i] = rows[run, i]
        for i in range(score_size):
            own_scores[i] = np.nan
        view = View(_pointer(row), _pointer(tables), _pointer(work))
        samples = start(view, _pointer(own_scores))
        for k in range(samples + 1):
            take(view, _pointer(own_scores), _pointer(own_scores), k)
            if own_scores[FAILURE] != UNDER_WAY:
                break
        for i in range(score_size):
            scores[run, i] = own_scores[i]

    return runs


def control_kernel(form: Form) -> Any:
    """Return the control callback of worlds in Python, (rows, tables, work, scores, qpos, qvel,
    ctrl, qfrc_applied).
    """
    control = controlling(form, njit(error_model="numpy"))

    def callback(rows, tables, work, scores, qpos, qvel, ctrl, qfrc_applied):
        i = cuda.grid(1)
        if i < len(rows):
            view = View(_pointer(rows[i]), _pointer(tables), _pointer(work[i]))
            world = World(
                _pointer(qpos[i]), _pointer(qvel[i]), _pointer(ctrl[i]), _pointer(qfrc_applied[i])
            )
            control(view, _pointer(scores[i]), world)

    return callback


def check_device() -> None:
    """Raise ScenarioError unless this machine has a CUDA device, and all that its code needs."""
    if not cuda.is_available():
        raise ScenarioError("CUDA finds no card on this machine: give device 'cpu'")
    try:
        behind = cuda.cudadrv.driver.get_version()[0] < cuda.runtime.get_version()[0]
    except RuntimeError as error:  # numba-cuda is here without its libraries
        raise MissingPackageError(f"device 'cuda' needs libnvrtc: {cure('gpu')}") from error
    if behind:
        raise ScenarioError(
            "the NVIDIA driver is older than numba-cuda's libraries: install a newer driver, or "
            "give device 'cpu'"
        )


@functools.lru_cache(maxsize=64)
def compiled_kernel(form: Form) -> Any:
    """Return the compiled kernel of a form, for the device of this machine."""
    return cuda.jit(ARGUMENTS)(kernel(form))


@functools.lru_cache(maxsize=64)
def compiled_control(form: Form) -> Any:
    """Return the compiled control callback of worlds, for the device of this machine."""
    return cuda.jit(OF_WORLDS)(control_kernel(form))


def run_rows(form: Form, rows: Array, tables: Array) -> Array:
    """Return the scores of runs, as `cpu.run` does."""
    simulate = compiled_kernel(form)
    width = SCORES + len(form.metrics)
    scores = np.full((len(rows), width), np.nan)
    points = cuda.to_device(tables)
    for first in range(0, len(rows), PIECE):
        piece = np.ascontiguousarray(rows[first : first + PIECE])
        part = cuda.to_device(piece)
        on_device = cuda.device_array((len(part), scores.shape[1]))
        with warnings.catch_warnings():  # few runs leave the device half idle
            warnings.filterwarnings("ignore", message=".*Grid size")
            blocks = -(-len(part) // THREADS)
            simulate[blocks, THREADS](part, points, on_device)
        scores[first : first + PIECE] = on_device.copy_to_host()
    return scores
