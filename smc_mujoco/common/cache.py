"""Results in files, so that a computation that was killed and is started again computes nothing
twice.
"""

import contextlib
import hashlib
import json
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeVar

from smc_mujoco.common import fingerprint
from smc_mujoco.common.files import reading, writable
from smc_mujoco.common.version import versions

T = TypeVar("T")


def cached(
    path: Path,
    depends: object,
    make: Callable[[], T],
    save: Callable[[T, Path], object],
    load: Callable[[Path], T],
) -> T:
    """Return the result of `make`, from its file if there is one.

    The file's name ends in two hashes. One is of `depends` (as JSON), the code and the versions.
    The other is of the content, so that a changed file is not read. When a file is written, files
    with other hashes are removed.
    """
    text = json.dumps([depends, fingerprint.package(), versions()], sort_keys=True, default=str)
    stem = f"{path.stem}-{hashlib.sha256(text.encode()).hexdigest()[:12]}"
    for file in path.parent.glob(f"{stem}-{'?' * 12}{path.suffix}"):
        with contextlib.suppress(
            Exception
        ):  # damaged bytes may raise any exception: compute the result again
            if file.stem.endswith(_seal(path.parent.glob(f"{file.stem}.*"))):
                return load(file)
    writable(path)
    made = make()
    with tempfile.TemporaryDirectory(prefix=f".{path.stem}-", dir=path.parent) as scratch:
        save(made, Path(scratch, path.name))
        written = sorted(
            Path(scratch).iterdir(), key=lambda file: file.suffix == path.suffix
        )  # the file itself last
        final = path.with_stem(f"{stem}-{_seal(written)}")
        for old in path.parent.glob(f"{path.stem}-{'?' * 12}-{'?' * 12}.*"):
            old.unlink()
        for file in written:
            file.replace(final.with_suffix(file.suffix))
    return load(final)


def _seal(files: Iterable[Path]) -> str:
    """Return a hash of the content of files."""
    digest = hashlib.sha256()
    for file in sorted(files, key=lambda file: file.suffix):
        with reading(file, "result", "start it again"):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:12]
