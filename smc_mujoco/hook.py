"""Who holds MuJoCo's control callback, which is one for the whole process; and models compiled whoever does.

MuJoCo compiles no model while a Python callback is installed: it would call that with a model Python does not know. The
plain loop installs one; the harness is native, and a model compiles under it.
"""

import contextlib
import ctypes
import os
import threading
from collections.abc import Iterator
from typing import Any

import mujoco

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
    """That control callback, None for none, for the length of a with block; then again what was there before.

    Other threads, whose runs would go on without their laws, are waited for, and wait.
    """
    with _lock:
        before = mujoco.get_mjcb_control()
        try:
            _put(control)
            yield
        finally:
            _put(before)


def uninstalled() -> contextlib.AbstractContextManager[None]:
    """No control callback for the length of a with block."""
    return held(None)


def compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """The spec's model.

    Where a Python callback is installed, it is taken away meanwhile: by the thread whose run it is, as where a policy
    makes an environment, at once; by others once that run is over. Native ones are not waited for.

    Raises:
      ValueError: MuJoCo cannot compile it.
    """
    with _free:
        if not _python(mujoco.get_mjcb_control()):
            return spec.compile()
    with uninstalled():
        return spec.compile()


def _put(control: Any) -> None:
    with _free if _python(control) else contextlib.nullcontext():
        mujoco.set_mjcb_control(control)


def _python(control: Any) -> bool:
    return control is not None and not isinstance(control, ctypes._CFuncPtr)
