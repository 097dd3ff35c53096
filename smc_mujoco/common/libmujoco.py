"""MuJoCo's shared library, for C functions that its Python package does not offer."""

import ctypes
import functools
from pathlib import Path

import mujoco

from smc_mujoco.common.errors import ScenarioError


def path() -> Path:
    """Return the path of the library's file."""
    folder = Path(mujoco.__file__).parent
    files = []
    for pattern in ("libmujoco*.so*", "libmujoco*.dylib", "mujoco.dll"):
        files += folder.glob(pattern)
    if not files:
        raise ScenarioError(f"no MuJoCo library in {folder}: reinstall mujoco")
    return files[0]


@functools.cache
def library() -> ctypes.CDLL:
    """Return the loaded library."""
    return ctypes.CDLL(str(path()))
