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
from collections.abc import Iterator
from pathlib import Path

import mujoco
from numba import carray, types

from smc_mujoco.common.jit import compiled, integers, pointer
from smc_mujoco.common.mjcb import held, uninstalled
from smc_mujoco.simulation import offsets
from smc_mujoco.simulation.controller import control as run_row
from smc_mujoco.simulation.state import HEADER, IS_ROW

with uninstalled():  # this import compiles a model: done here, before a run of ours that it would have to wait for
    import mujoco.batch


@functools.cache
def mark() -> float:
    """What a row of ours begins with: changes with any of our modules, so that no cached harness reads a newer row."""
    sources = b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))
    return float(int.from_bytes(hashlib.sha256(sources).digest()[:6]))


@functools.cache
def harness():
    """The compiled callback void(const mjModel*, mjData*), from numba's cache on disk where there is one."""
    at, ours = offsets.offsets(), mark()
    nuserdata, qpos, qvel, ctrl, applied, xfrc, userdata, sensors, tips, anchors, actuators, constraints = at

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
            carray(pointer(integers(data + tips)[0]), (1 << 40,)),
            carray(pointer(integers(data + anchors)[0]), (1 << 40,)),
            carray(pointer(integers(data + actuators)[0]), (1 << 40,)),
            carray(pointer(integers(data + constraints)[0]), (1 << 40,)),
            carray(pointer(integers(data + applied)[0]), (1 << 40,)),
        )

    return compiled(types.void(types.intp, types.intp), control, cache=True)


@functools.cache
def silence():
    """A C function that prints nothing: MuJoCo's warnings name no run, and the harness marks each that diverges."""

    def silent(message):
        return

    return compiled(types.void(types.intp), silent, cache=True)


@contextlib.contextmanager
def installed(control=None) -> Iterator[None]:
    """Install the harness, or another control callback, for the length of a with block; other threads wait."""
    with uninstalled():
        function, silent = harness().ctypes if control is None else control, silence().ctypes
        before = mujoco.get_mju_user_warning()
        with held(function):
            try:
                mujoco.set_mju_user_warning(silent)
                yield
            finally:
                mujoco.set_mju_user_warning(before)
