"""MuJoCo's control callback: one C function for every simulation of the process.

    with installed():
        batch.step(nstep=1000)

The callback is global to the process, so `installed` holds a lock, and restores the callback that was there before. The
callback acts only in this package's simulations, which it recognises by the magic number in their userdata.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import contextlib
import functools
import hashlib
from collections.abc import Iterator
from pathlib import Path

import mujoco
from numba import types

from smc_mujoco.common import mjcb
from smc_mujoco.common.jit import compiled, integers, pointer
from smc_mujoco.simulation import offsets
from smc_mujoco.simulation.controller import Arrays
from smc_mujoco.simulation.controller import control as run_simulation
from smc_mujoco.simulation.model import USERDATA
from smc_mujoco.simulation.state import simulation_at

with mjcb.installed(None):  # this import compiles a model; imported later, it would wait for a run to end
    import mujoco.batch


@functools.cache
def magic() -> float:
    """Magic number that marks this package's userdata.

    It is a hash of the sources, so that an outdated compiled callback ignores a record written by newer code.
    """
    package = Path(__file__).parents[1]
    folders = (package / name for name in ("simulation", "common", "control", "mechanisms", "mechanisms/hardware"))
    sources = b"".join(path.read_bytes() for folder in folders for path in sorted(folder.glob("*.py")))
    return float(int.from_bytes(hashlib.sha256(sources).digest()[:6]))


@functools.cache
def callback():
    """Return the compiled callback void(const mjModel*, mjData*), from numba's cache on disk if it is there."""
    at, ours = offsets.offsets(), magic()

    def control(model, data):
        if integers(model + at.nuserdata)[0] < USERDATA:
            return
        userdata = pointer(integers(data + at.userdata)[0])
        if userdata[0] != ours:
            return
        address = int(userdata[1])
        arrays = Arrays(
            pointer(integers(data + at.qpos)[0]),
            pointer(integers(data + at.qvel)[0]),
            pointer(integers(data + at.ctrl)[0]),
            pointer(integers(data + at.xfrc_applied)[0]),
            pointer(integers(data + at.qfrc_applied)[0]),
            pointer(integers(data + at.sensordata)[0]),
            pointer(integers(data + at.xipos)[0]),
            pointer(integers(data + at.xanchor)[0]),
            pointer(integers(data + at.xaxis)[0]),
            pointer(integers(data + at.actuator_force)[0]),
            pointer(integers(data + at.qfrc_constraint)[0]),
            pointer(integers(data + at.qfrc_bias)[0]),
            pointer(integers(data + at.qfrc_spring)[0]),
        )
        run_simulation(address, simulation_at(address, 0), arrays)

    return compiled(types.void(types.intp, types.intp), control, cache=True)


@functools.cache
def silence():
    """Return a C function that ignores MuJoCo's warnings, which do not say which run they are about."""

    def silent(message):
        return

    return compiled(types.void(types.intp), silent, cache=True)


@contextlib.contextmanager
def installed(control=None) -> Iterator[None]:
    """Install our control callback, or another one, for the length of a with block. Other threads wait."""
    with mjcb.installed(None):
        function, silent = callback().ctypes if control is None else control, silence().ctypes
        before = mujoco.get_mju_user_warning()
        with mjcb.installed(function):
            try:
                mujoco.set_mju_user_warning(silent)
                yield
            finally:
                mujoco.set_mju_user_warning(before)
