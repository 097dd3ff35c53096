"""Results that are kept in files, so that what was killed and is started again computes nothing twice."""

import contextlib
import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from smc_mujoco.analysis.tuning import result
from smc_mujoco.common import fingerprint

T = TypeVar("T")


def cached(
    path: Path, depends: object, make: Callable[[], T], save: Callable[[T, Path], object], load: Callable[[Path], T]
) -> T:
    """Return what `make` returns, from its file if there is one.

    The file's name ends in a hash of what the result depends on: `depends`, the package's code, models and gains, and
    the versions of the packages below. Files with other hashes are removed when a new one is written.

    Args:
      path: of the file, without the hash.
      depends: what the result depends on besides the code, as JSON data.
    """
    text = json.dumps([depends, fingerprint.package(), result.versions()], sort_keys=True, default=str)
    file = path.with_stem(f"{path.stem}-{hashlib.sha256(text.encode()).hexdigest()[:12]}")
    if file.exists():
        with contextlib.suppress(Exception):  # damaged bytes raise any exception there is; compute it again
            return load(file)
    made = make()
    for old in path.parent.glob(f"{path.stem}-{'?' * 12}.*"):
        old.unlink()
    save(made, file)
    return load(file)
