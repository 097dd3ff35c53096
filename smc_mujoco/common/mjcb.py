"""Ownership of MuJoCo's callbacks, and the compiling of models while a callback is installed.

A process has one set of eight callbacks. A run installs the control callback and a time callback,
and removes the other six, so that a trace depends only on its scenario. Afterwards all are
restored.

MuJoCo reads the clock about 25 times in each evaluation of the forces, to fill `mjData.timer`. That
takes 16 to 40 % of a plain `mj_step`. The time callback of a run reads no clock, so the durations
in `mjData.timer` are 0.

MuJoCo cannot compile a model while a callback is a Python function, because it would call that
function with a model that Python does not know. So a user's is removed meanwhile.
"""

import contextlib
import ctypes
import functools
import os
import re
import threading
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common import libmujoco
from smc_mujoco.common.process import return_freed_memory

CALLBACKS = (
    "control",
    "passive",
    "contactfilter",
    "sensor",
    "time",
    "act_dyn",
    "act_gain",
    "act_bias",
)
LARGE = (
    10_000_000  # bytes of a model, chosen: those of meshes, whose compiling takes many times that
)

_lock = threading.RLock()  # held while callbacks are replaced
# MuJoCo warns of a model with each of its many compilations: once is enough, when a plant is made
# of it
warnings.filterwarnings("ignore", category=UserWarning, module=re.escape(__name__), append=True)


def _after_fork() -> None:
    """Free the lock and remove our callbacks: a child process has none of its parent's threads."""
    global _lock  # noqa: PLW0603
    _lock = threading.RLock()
    mujoco.set_mjcb_control(None)
    # else it is None or a user's
    if no_clock.cache_info().currsize and mujoco.get_mjcb_time() is no_clock():
        mujoco.set_mjcb_time(None)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


@contextlib.contextmanager
def installed(control: Any) -> Iterator[None]:
    """Install a control callback, or None, and `no_clock`, and no others, in a with block.

    Other threads wait.
    """
    with _lock:
        before = _callbacks()
        ours = dict.fromkeys(CALLBACKS) | {"control": control, "time": no_clock()}
        try:
            _install(ours)
            yield
        finally:
            _install(before)


@functools.cache
def slots() -> np.ndarray:
    """Return the addresses of MuJoCo's variables for the callbacks that a run has not, int64."""
    addresses = []
    for name in CALLBACKS:
        if name not in ("control", "time"):
            slot = ctypes.c_void_p.in_dll(libmujoco.library(), f"mjcb_{name}")
            addresses.append(ctypes.addressof(slot))
    return np.array(addresses)


@functools.cache
def no_clock() -> Any:
    """Return a time callback, a C function that returns 0.

    Without one, MuJoCo would read the system's clock.
    """
    from llvmlite import binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    # what numba compiles for C calls a second function: that took 3 % of a step
    code = binding.parse_assembly("define double @zero() { ret double 0.0 }")
    target = binding.Target.from_default_triple().create_target_machine()
    engine = binding.create_mcjit_compiler(code, target)
    engine.finalize_object()
    function = ctypes.CFUNCTYPE(ctypes.c_double)(engine.get_function_address("zero"))
    function.engine = engine  # pyright: ignore[reportAttributeAccessIssue] it owns the code
    return function


def compiled_spec(
    spec: mujoco.MjSpec, build: Callable[[mujoco.MjSpec], mujoco.MjModel] | None = None
) -> mujoco.MjModel:
    """Compile a spec; MuJoCo's warnings are shown if `build`, which compiles it, is a function of
    another module.
    """
    without = contextlib.nullcontext()
    if any(map(_python, _callbacks().values())):
        without = installed(None)
    with without:
        model = build(spec) if build else spec.compile()
    if mujoco.mj_sizeModel(model) > LARGE:
        return_freed_memory()
    return model


@contextlib.contextmanager
def uncached() -> Iterator[None]:
    """Clear MuJoCo's cache of meshes and pictures, and keep it empty in a with block: a humanoid's
    takes twice what its model does.
    """
    cache = mujoco.mj_getCache()
    capacity = mujoco.mj_getCacheCapacity(cache)
    mujoco.mj_setCacheCapacity(cache, 0)
    return_freed_memory()
    try:
        yield
    finally:
        mujoco.mj_setCacheCapacity(cache, capacity)
        return_freed_memory()


def _callbacks() -> dict[str, Any]:
    """Return name -> the installed callback, or None."""
    installed = {}
    for name in CALLBACKS:
        installed[name] = getattr(mujoco, f"get_mjcb_{name}")()
    return installed


def _install(callbacks: dict[str, Any]) -> None:
    """Install those of the callbacks, given as `_callbacks` returns them, that are not installed
    yet.
    """
    for name, callback in callbacks.items():
        if getattr(mujoco, f"get_mjcb_{name}")() is not callback:
            getattr(mujoco, f"set_mjcb_{name}")(callback)


def silence(data: mujoco.MjData) -> None:
    """Let MuJoCo print no warning of `data`: it prints one only the first time. In a control
    callback that would never end.
    """
    data.warning.number[:] = 1


def _python(callback: Any) -> bool:
    return callback is not None and not isinstance(callback, ctypes._CFuncPtr)  # pyright: ignore[reportAttributeAccessIssue] the base of all C functions
