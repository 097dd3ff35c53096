"""Python files of the user, run for what they define."""

import runpy
import sys
import traceback
from pathlib import Path

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import reading


def execute(path: Path) -> dict:
    """Return what a user's script defines. It can import modules beside it."""
    with reading(path, "Python file", "fix it") as file:
        compile(file.read_bytes(), str(path), "exec", dont_inherit=True)
    sys.path.insert(0, str(path.resolve().parent))
    try:
        return runpy.run_path(str(path))
    except ScenarioError as error:
        lines = []
        for frame in traceback.extract_tb(error.__traceback__):
            if frame.filename == str(path):
                lines.append(frame.lineno)
        if lines:
            where = f"{path}, line {lines[-1]}"
        else:
            where = str(path)
        raise ScenarioError(f"{where}: {error}") from error


def users_traceback(error: BaseException) -> str:
    """Return the traceback of an exception that a script raised, without what called it; "" for any
    other exception.
    """
    step = error.__traceback__
    inside = False
    while step is not None:
        code = step.tb_frame.f_code
        if inside and "runpy" not in code.co_filename:
            return "".join(traceback.format_exception(type(error), error, step))
        inside = inside or code is execute.__code__
        step = step.tb_next
    return ""
