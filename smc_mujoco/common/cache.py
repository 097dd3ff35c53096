"""Results in files, so that a computation that was killed and is started again computes nothing
twice.
"""

import contextlib
import dataclasses
import hashlib
import json
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Generic, TypeVar

from smc_mujoco.common import fingerprint
from smc_mujoco.common.files import reading, writable
from smc_mujoco.common.version import versions

T = TypeVar("T")


@dataclasses.dataclass(frozen=True)
class CachedResult(Generic[T]):
    """The file of one result.

    Its name ends in two hashes. One is of `depends` (as JSON), the code and the versions. The other
    is of the content, so that a changed file is not read. When a file is written, files with other
    hashes are removed.
    """

    path: Path
    depends: object
    save: Callable[[T, Path], object]
    load: Callable[[Path], T]

    @property
    def stem(self) -> str:
        """The name of the file without the hash of its content and its suffix."""
        about = [self.depends, fingerprint.package(), versions()]
        text = json.dumps(about, sort_keys=True, default=str)
        return f"{self.path.stem}-{hashlib.sha256(text.encode()).hexdigest()[:12]}"

    def read(self) -> T | None:
        """Return the result, or None if no file has it."""
        folder = self.path.parent
        for file in folder.glob(f"{self.stem}-{'?' * 12}{self.path.suffix}"):
            with contextlib.suppress(
                Exception
            ):  # damaged bytes may raise any exception: compute the result again
                if file.stem.endswith(_seal(folder.glob(f"{file.stem}.*"))):
                    return self.load(file)
        return None

    def keep(self, made: T) -> T:
        """Write the result, and return it as it is read."""
        path = self.path
        with tempfile.TemporaryDirectory(prefix=f".{path.stem}-", dir=path.parent) as scratch:
            self.save(made, Path(scratch, path.name))
            written = sorted(
                Path(scratch).iterdir(), key=lambda file: file.suffix == path.suffix
            )  # the file itself last
            final = path.with_stem(f"{self.stem}-{_seal(written)}")
            for old in path.parent.glob(f"{path.stem}-{'?' * 12}-{'?' * 12}.*"):
                old.unlink()
            for file in written:
                file.replace(final.with_suffix(file.suffix))
        return self.load(final)


def cached(
    path: Path,
    depends: object,
    make: Callable[[], T],
    save: Callable[[T, Path], object],
    load: Callable[[Path], T],
) -> T:
    """Return the result of `make`, from its file if there is one; see `CachedResult`."""
    file = CachedResult(path, depends, save, load)
    if (result := file.read()) is not None:
        return result
    writable(path)
    return file.keep(make())


def _seal(files: Iterable[Path]) -> str:
    """Return a hash of the content of files."""
    digest = hashlib.sha256()
    for file in sorted(files, key=lambda file: file.suffix):
        with reading(file, "result", "start it again"):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:12]
