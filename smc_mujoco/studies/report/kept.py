"""Results kept in a report's folder, so that one which was killed goes on where it was.

    kept(folder / "margins-duffing.json", [plant, laws], make, save, load)

A file's name ends in a hash of what it depends on: the arguments, the package's code, models and gains, the versions of
the packages below. What depends on anything else is computed anew.
"""

import contextlib
import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from smc_mujoco.analysis.tuning.result import versions
from smc_mujoco.common import fingerprint

T = TypeVar("T")


def kept(
    path: Path, depends: object, make: Callable[[], T], save: Callable[[T, Path], object], load: Callable[[Path], T]
) -> T:
    """What `make` finds, from its file if there is one. Files of other arguments or code go away when it is written.

    Args:
      path: of the file; before its ending the hash is put.
      depends: what the result depends on beside the code, JSON-able.
    """
    text = json.dumps([depends, fingerprint.package(), versions()], sort_keys=True, default=str)
    own = path.with_stem(f"{path.stem}-{hashlib.sha256(text.encode()).hexdigest()[:12]}")
    if own.exists():
        with contextlib.suppress(Exception):  # whatever damaged bytes raise: it is computed again
            return load(own)
    found = make()
    for old in path.parent.glob(f"{path.stem}-{'?' * 12}.*"):
        old.unlink()
    save(found, own)
    return load(own)
