"""The annexes, which the core reaches by name only. It works where they are missing."""

import importlib
import importlib.util
from types import ModuleType

ANNEXES = ("chattering", "exchange", "evidence", "problems")


def module(name: str, what: str) -> ModuleType:
    """Return a module of the package; `what` needs it, as the error says if its annex is
    missing.
    """
    if annex := missing_annex(name):
        from smc_mujoco.common.extras import MissingPackageError

        raise MissingPackageError(
            f"{what} needs smc_mujoco.{annex}, which is missing here: install all of smc-mujoco"
        )
    return importlib.import_module(name)


def missing_annex(name: str) -> str:
    """Return the annex of a module of the package if it is not installed, else nothing."""
    annex = name.split(".")[1]
    return annex if annex in ANNEXES and not installed(annex) else ""


def installed(annex: str) -> bool:
    """Return whether an annex is installed."""
    return importlib.util.find_spec(f"smc_mujoco.{annex}") is not None
