"""Files: the shipped ones, and written ones that are there whole or not at all."""

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from smc_mujoco.errors import ScenarioError


def shipped(folder: str) -> Path:
    """The folder models/ or scenes/, from a checkout or from an installed wheel."""
    here = Path(__file__).parent
    for place in (here / folder, here.parent / folder):
        if place.is_dir():
            return place
    raise ScenarioError(f"no folder {folder!r} in {here} or beside it: reinstall smc-mujoco")


def ended(path: str | os.PathLike, ending: str) -> Path:
    """The path, if a file can have its name and the ending, such as ".json"; else a ScenarioError."""
    path = Path(path)
    if path.suffix != ending or "\0" in path.name:
        raise ScenarioError(f"cannot save to {str(path)!r}: end the name in {ending}")
    return path


def writable(path: str | os.PathLike) -> None:
    """Raise ScenarioError for a file that cannot be written, before minutes go by."""
    path = Path(path)
    if path.is_dir():
        raise ScenarioError(f"cannot write {path}: it is a folder, give the file in it a name")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        why = error.strerror or error
        raise ScenarioError(f"cannot write {path}: {why}; choose another folder or make room") from error


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary file beside `path`, with its ending, that takes its place when the block ends well, else goes away.

    Raises:
      ScenarioError: the folder cannot be made or written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}.", suffix=path.suffix)
        os.close(handle)
        try:
            yield Path(name)
            os.chmod(name, 0o666 & ~_umask())
            os.replace(name, path)
        finally:
            Path(name).unlink(missing_ok=True)
    except OSError as error:
        why = error.strerror or error
        raise ScenarioError(f"cannot write {path}: {why}; choose another folder or make room") from error


def _umask() -> int:
    """The user's; it can only be read by setting it."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
