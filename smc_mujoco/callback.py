"""The harness as MuJoCo's control callback: one C function for every simulation of the process.

    with installed():
        batch.step(nstep=1000)

The callback is global to the process: `installed` holds a lock, and puts back what was there before. Simulations
whose userdata hold no row of ours are left alone.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import contextlib
import functools
import hashlib
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import mujoco
from numba import carray, cfunc, types

from smc_mujoco import harness as harness_module
from smc_mujoco import layout, native, noise
from smc_mujoco import row as row_module
from smc_mujoco.harness import control as run_row
from smc_mujoco.native import integers, pointer
from smc_mujoco.row import HEADER, IS_ROW

_lock = threading.RLock()


@functools.cache
def mark() -> float:
    """What a row of ours begins with: it changes with the code, so that no cached harness reads a newer row."""
    sources = [Path(str(module.__file__)).read_bytes() for module in (harness_module, native, noise, row_module)]
    return float(int.from_bytes(hashlib.sha256(b"".join([Path(__file__).read_bytes(), *sources])).digest()[:6]))


@functools.cache
def harness():
    """The compiled callback void(const mjModel*, mjData*), from numba's cache on disk where there is one."""
    at, ours = layout.offsets(), mark()
    nuserdata, qpos, qvel, ctrl, xfrc, userdata, sensors = at

    def control(model, data):
        if integers(model + nuserdata)[0] < HEADER:
            return
        base = integers(data + userdata)[0]
        row = carray(pointer(base), (1 << 40,))
        if row[IS_ROW] != ours:
            return
        run_row(
            base,
            row,
            carray(pointer(integers(data + qpos)[0]), (1 << 40,)),
            carray(pointer(integers(data + qvel)[0]), (1 << 40,)),
            carray(pointer(integers(data + ctrl)[0]), (1 << 40,)),
            carray(pointer(integers(data + xfrc)[0]), (1 << 40,)),
            carray(pointer(integers(data + sensors)[0]), (1 << 40,)),
        )

    return _compiled(types.void(types.intp, types.intp), control)


@functools.cache
def silence():
    """A C function that prints nothing: MuJoCo's warnings name no run, so we count them and report them by run."""

    def silent(message):
        return

    return _compiled(types.void(types.intp), silent)


def _compiled(signature, function: Callable):
    try:
        return cfunc(signature, error_model="numpy", cache=True)(function)
    except RuntimeError:  # nowhere to write a cache
        return cfunc(signature, error_model="numpy")(function)


@contextlib.contextmanager
def installed(control=None) -> Iterator[None]:
    """Install the harness, or another control callback, for the length of a with block; other threads wait."""
    with _lock:
        before = mujoco.get_mjcb_control(), mujoco.get_mju_user_warning()
        try:
            mujoco.set_mjcb_control(None)  # a Python callback keeps MuJoCo from compiling any model, ours too
            mujoco.set_mjcb_control(harness().ctypes if control is None else control)
            mujoco.set_mju_user_warning(silence().ctypes)
            yield
        finally:
            mujoco.set_mjcb_control(before[0])
            mujoco.set_mju_user_warning(before[1])
