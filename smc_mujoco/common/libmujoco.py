"""MuJoCo's shared library, for C functions that its Python package does not offer, and the versions
of its parts.
"""

import ctypes
import functools
from pathlib import Path

import mujoco

from smc_mujoco.common.errors import ScenarioError

PARTS = ("mujoco", "mujoco_core", "mujoco_studio")  # from MuJoCo 4 on it is three packages


def check_parts(packages: Path) -> None:
    """Raise ScenarioError if MuJoCo's parts in a folder of packages are of two versions.

    pip puts an older mujoco over the newer parts without a word.
    """
    versions = {}
    for info in sorted(packages.glob("mujoco*.dist-info")):
        name, _, version = info.stem.partition("-")
        if name in PARTS:
            versions[name.replace("_", "-")] = version
    if len(set(versions.values())) > 1:
        parts = ", ".join(map(" ".join, versions.items()))
        raise ScenarioError(
            f"MuJoCo's parts are of two versions ({parts}): run `pip uninstall "
            f"{' '.join(versions)}`, then install again"
        )


check_parts(Path(mujoco.__file__).parents[1])


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
