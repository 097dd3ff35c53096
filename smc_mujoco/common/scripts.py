"""Python files of the user, run for what they define.

`my_parts.py:stribeck` names what a file defines, on the command line and in texts.
"""

import functools
import os
import re
import runpy
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import reading
from smc_mujoco.common.text import joined

# FILE.py:NAME, by itself, and within a text of parts, where a path with a space is in quotes
IN_FILE = re.compile(r"(?P<file>[^:]+\.py):(?P<name>[^\W\d]\w*)")
WITHIN = re.compile(r"[^\s'\"=,:(){}\[\]+]+\.py:[^\W\d]\w*")

_places: dict[int, tuple[Any, str]] = {}  # id of what a text's file defines -> it, FILE.py:NAME


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


def object_named(text: str, what: str, is_kind: Callable[[Any], bool]) -> Any:
    """Return what FILE.py:NAME names, such as "my_parts.py:stribeck". The file is run, unless it is
    imported already.

    Args:
      text: matches IN_FILE.
      what: the kind of thing that is looked for, for errors.
      wanted: whether something that the file defines is of this kind.

    Raises:
      ScenarioError: there is no such file, or nothing of this kind has the name in it.
    """
    file, _, name = text.rpartition(":")
    if not os.path.isfile(file):
        raise ScenarioError(f"no file {file!r}: give the file that defines {name!r}")
    defined = _imported(file) or _defined(file, Path(file).read_bytes())
    if name in defined and is_kind(defined[name]):
        return defined[name]
    fitting = []
    for defined_name, value in defined.items():
        if is_kind(value):
            fitting.append(defined_name)
    cure = f"it has {joined(fitting)}" if fitting else "it has none"
    raise ScenarioError(f"{file} has no {what} {name!r}: {cure}")


def _imported(file: str) -> dict:
    """Return what a module of this file defines; empty if none was imported."""
    for module in list(sys.modules.values()):
        path = getattr(module, "__file__", None) or ""
        alike = os.path.basename(path) == os.path.basename(file) and os.path.isfile(path)
        if alike and os.path.samefile(path, file):
            return vars(module)
    return {}


@functools.cache
def _defined(file: str, content: bytes) -> dict:
    """Return what a file of this content defines. The file is run once, so two texts that name the
    same part get the same object.
    """
    del content
    defined = execute(Path(file))
    for name, value in defined.items():
        if callable(value):
            _places[id(value)] = value, f"{file}:{name}"
    return defined


def script_place(thing: Any) -> str:
    """Return FILE.py:NAME of a user's class or function, from this folder; "" if no file has it."""
    if id(thing) in _places:
        return _places[id(thing)][1]
    name = getattr(thing, "__name__", "")
    module = sys.modules.get(getattr(thing, "__module__", None) or "")
    file = str(getattr(module, "__file__", None) or "")
    if not file.endswith(".py") or vars(module).get(name) is not thing:
        return ""
    path = Path(file).resolve()
    if path.is_relative_to(Path.cwd()):
        path = path.relative_to(Path.cwd())
    return f"{path}:{name}"


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
