"""Ownership of MuJoCo's callbacks, and the compiling of models while a callback is installed.

A process has one set of callbacks, eight of them. A run installs the control callback and removes the other seven, so
that a trace depends on its scenario alone; afterwards all are put back.

MuJoCo cannot compile a model while a callback is a Python function, because it would call that function with a model
that Python does not know. The reference loop installs such a function. The compiled callback is native code, with
which MuJoCo can compile models.
"""

import contextlib
import ctypes
import os
import threading
from collections.abc import Iterator
from typing import Any

import mujoco

CALLBACKS = ("control", "passive", "contactfilter", "sensor", "time", "act_dyn", "act_gain", "act_bias")

_lock = threading.RLock()  # whoever has replaced the callback
_free = threading.RLock()  # whoever compiles where no Python callback is; held shortly, and nothing waited for under it


def _after_fork() -> None:
    """A child has none of its parent's threads: neither who holds a lock, nor the run whose callback is installed."""
    global _lock, _free
    _lock, _free = threading.RLock(), threading.RLock()
    mujoco.set_mjcb_control(None)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


@contextlib.contextmanager
def held(control: Any) -> Iterator[None]:
    """That control callback, None for none, and no other callback for the length of a with block.

    Then all are again what they were before. Other threads, whose runs would go on without their laws, are waited for,
    and wait.
    """
    with _lock:
        before = _installed()
        try:
            _put(dict.fromkeys(CALLBACKS) | {"control": control})
            yield
        finally:
            _put(before)


def uninstalled() -> contextlib.AbstractContextManager[None]:
    """No callback for the length of a with block."""
    return held(None)


def compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """The spec's model.

    Where a Python callback is installed, it is taken away meanwhile: by the thread whose run it is, as where a policy
    makes an environment, at once; by others once that run is over. Native ones are not waited for.

    Raises:
      ValueError: MuJoCo cannot compile it.
    """
    with _free:
        if not any(map(_python, _installed().values())):
            return spec.compile()
    with uninstalled():
        return spec.compile()


def _installed() -> dict[str, Any]:
    """Every callback by its name, None where there is none."""
    return {name: getattr(mujoco, f"get_mjcb_{name}")() for name in CALLBACKS}


def _put(callbacks: dict[str, Any]) -> None:
    """Install callbacks, as `_installed` gives them, where they are not there yet."""
    with _free if any(map(_python, callbacks.values())) else contextlib.nullcontext():
        for name, callback in callbacks.items():
            if getattr(mujoco, f"get_mjcb_{name}")() is not callback:
                getattr(mujoco, f"set_mjcb_{name}")(callback)


def _python(callback: Any) -> bool:
    return callback is not None and not isinstance(callback, ctypes._CFuncPtr)
