"""Python files of the user, run for what they define."""

import runpy
import sys
import traceback
from pathlib import Path

from smc_mujoco.common.errors import ScenarioError


def execute(path: Path) -> dict:
    """Return what a user's script defines. It can import modules beside it.

    Raises:
      ScenarioError: the script raises anything.
    """
    sys.path.insert(0, str(path.resolve().parent))
    try:
        return runpy.run_path(str(path))
    except Exception as error:  # whatever a user's script raises
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
        where = f"{path}, line {lines[-1]}" if lines else str(path)
        what = str(error) if isinstance(error, ScenarioError) else f"{type(error).__name__}: {error}; fix the file"
        raise ScenarioError(f"{where}: {what}") from error
