"""The MuJoCo library that this process runs, for what its Python package does not offer."""

import ctypes
import functools
from pathlib import Path

import mujoco

from smc_mujoco.common.errors import ScenarioError


def path() -> Path:
    """The library's file.

    Raises:
      ScenarioError: it is not where the package has it.
    """
    folder = Path(mujoco.__file__).parent
    names = [path for pattern in ("libmujoco*.so*", "libmujoco*.dylib", "mujoco.dll") for path in folder.glob(pattern)]
    if not names:
        raise ScenarioError(f"no MuJoCo library in {folder}: reinstall mujoco")
    return names[0]


def plugins() -> list[Path]:
    """The plugins that the package loads when it is imported."""
    folder = Path(mujoco.__file__).parent / "plugin"
    return sorted(path for path in folder.glob("*") if path.suffix in (".so", ".dylib", ".dll"))


@functools.cache
def library() -> ctypes.CDLL:
    """The library, for its C functions."""
    return ctypes.CDLL(str(path()))
