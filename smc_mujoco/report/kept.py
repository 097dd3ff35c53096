"""Results kept in a report's folder, so that one which was killed goes on where it was.

    kept(folder / "margins-duffing.json", [plant, laws], make, save, load)

A file's name ends in a hash of what it depends on: the arguments, the package's code, models and gains, the versions of
the packages below. What depends on anything else is computed anew.
"""

import functools
import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import smc_mujoco
from smc_mujoco.tuned import versions

T = TypeVar("T")
PACKAGE = Path(smc_mujoco.__file__).parent
SHOWS = ("report", "commands")  # folders that say how results are shown, not what they are


def kept(
    path: Path, depends: object, make: Callable[[], T], save: Callable[[T, Path], object], load: Callable[[Path], T]
) -> T:
    """What `make` finds, from its file if there is one. Files of other arguments or code go away when it is written.

    Args:
      path: of the file; before its ending the hash is put.
      depends: what the result depends on beside the code, JSON-able.
    """
    text = json.dumps([depends, code(), versions()], sort_keys=True, default=str)
    own = path.with_stem(f"{path.stem}-{hashlib.sha256(text.encode()).hexdigest()[:12]}")
    if not own.exists():
        found = make()
        for old in path.parent.glob(f"{path.stem}-{'?' * 12}.*"):
            old.unlink()
        save(found, own)
    return load(own)


@functools.cache
def code() -> str:
    """A hash of all that decides what runs do."""
    digest = hashlib.sha256()
    models = PACKAGE / "models" if (PACKAGE / "models").is_dir() else PACKAGE.parent / "models"
    files = [path for path in PACKAGE.rglob("*") if path.relative_to(PACKAGE).parts[0] not in SHOWS]
    for path in sorted([*files, *models.rglob("*")]):
        if path.suffix in (".py", ".xml", ".json"):
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()
