"""Batches of replays in files, so that a search that was stopped and is started again simulates
nothing twice.

A search is a function of what its replays give, to the last bit. So what is kept is each batch of
replays, by a hash of all that it depends on, and the search is made again from the files.
"""

import contextlib
import hashlib
import shutil
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from smc_mujoco.common.files import replacing, writable
from smc_mujoco.identification.records import Record

Batch = list[list[Record]]  # the predicted columns of each piece, of each rig


class KeptReplays:
    """A folder with batches of replays, each in a file whose name is the hash of what it is of."""

    def __init__(self, folder: Path):
        self.folder = folder

    def batch(self, depends: Iterable[bytes], make: Callable[[], Batch]) -> Batch:
        """Return a batch from its file, or make it and keep it."""
        digest = hashlib.sha256()
        for part in depends:
            digest.update(len(part).to_bytes(8, "little") + part)
        file = self.folder / f"{digest.hexdigest()[:32]}.npz"
        with contextlib.suppress(Exception):  # none, or damaged: make it again
            return _read(file)
        writable(file)
        replayed = make()
        columns = {}
        for i, by_piece in enumerate(replayed):
            for k, record in enumerate(by_piece):
                for name, values in record.items():
                    columns[f"{i}/{k}/{name}"] = values
        with replacing(file) as part, part.open("wb") as stream:
            np.savez(stream, **columns)
        return replayed

    def remove(self) -> None:
        """Remove the folder, when nothing of it is needed any more."""
        shutil.rmtree(self.folder, ignore_errors=True)


def _read(file: Path) -> Batch:
    """Return the batch of a file."""
    batch: Batch = []
    with file.open("rb") as stream, np.load(stream, allow_pickle=False) as columns:
        for place in columns.files:
            i, k, name = place.split("/", 2)
            if int(i) == len(batch):
                batch.append([])
            if int(k) == len(batch[-1]):
                batch[-1].append({})
            batch[-1][-1][name] = columns[place]
    return batch
