"""MuJoCo's control callback: one C function for every simulation of the process.

    with installed():
        batch.step(nstep=1000)

The callback is global to the process: `installed` holds a lock, and puts back what was there before. The callback does
nothing in simulations of others: it knows ours by the magic number in their userdata.
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
from smc_mujoco.simulation.state import simulation_at

with mjcb.installed(None):  # this import compiles a model: here, before it would have to wait for a run of ours
    import mujoco.batch

USERDATA = 2  # numbers in mjData.userdata: magic() and the address of the simulation's record


@functools.cache
def magic() -> float:
    """Magic number that marks our userdata.

    A hash of the sources, so that a stale compiled callback ignores a record written by newer code.
    """
    rooms = Path(__file__).parent, Path(__file__).parents[1] / "common", Path(__file__).parents[1] / "control"
    sources = b"".join(path.read_bytes() for room in rooms for path in sorted(room.glob("*.py")))
    return float(int.from_bytes(hashlib.sha256(sources).digest()[:6]))


@functools.cache
def callback():
    """The compiled callback void(const mjModel*, mjData*), from numba's cache on disk where there is one."""
    at, ours = offsets.offsets(), magic()
    nuserdata, userdata = at.nuserdata, at.userdata
    qpos, qvel, ctrl, xfrc, qfrc = at.qpos, at.qvel, at.ctrl, at.xfrc_applied, at.qfrc_applied
    sensors, xipos, xanchor = at.sensordata, at.xipos, at.xanchor
    actuators, constraints = at.actuator_force, at.qfrc_constraint

    def control(model, data):
        if integers(model + nuserdata)[0] < USERDATA:
            return
        ours_or_not = pointer(integers(data + userdata)[0])
        if ours_or_not[0] != ours:
            return
        address = int(ours_or_not[1])
        arrays = Arrays(
            pointer(integers(data + qpos)[0]),
            pointer(integers(data + qvel)[0]),
            pointer(integers(data + ctrl)[0]),
            pointer(integers(data + xfrc)[0]),
            pointer(integers(data + qfrc)[0]),
            pointer(integers(data + sensors)[0]),
            pointer(integers(data + xipos)[0]),
            pointer(integers(data + xanchor)[0]),
            pointer(integers(data + actuators)[0]),
            pointer(integers(data + constraints)[0]),
        )
        run_simulation(address, simulation_at(address), arrays)

    return compiled(types.void(types.intp, types.intp), control, cache=True)


@functools.cache
def silence():
    """A C function that prints nothing: MuJoCo's warnings name no run, and the controller marks each that diverges."""

    def silent(message):
        return

    return compiled(types.void(types.intp), silent, cache=True)


@contextlib.contextmanager
def installed(control=None) -> Iterator[None]:
    """Install our control callback, or another, for the length of a with block; other threads wait."""
    with mjcb.installed(None):
        function, silent = callback().ctypes if control is None else control, silence().ctypes
        before = mujoco.get_mju_user_warning()
        with mjcb.installed(function):
            try:
                mujoco.set_mju_user_warning(silent)
                yield
            finally:
                mujoco.set_mju_user_warning(before)
