"""The package's own code as a hash, so that what an older or an edited one has computed is not taken for its own."""

import functools
import hashlib
from pathlib import Path

from smc_mujoco.common.files import shipped

PACKAGE = Path(__file__).parents[1]
BESIDE = ("models", "scenes")  # in a wheel they lie in the package, in a checkout beside it
SHOWS = ("report", "commands")  # folders that say how results are shown, not what they are


@functools.cache
def code(*without: str) -> str:
    """A hash of code, models and gains, but for what only shows results and the folders `without`."""
    files = {path.relative_to(PACKAGE): path for path in PACKAGE.rglob("*")}
    files = {name: path for name, path in files.items() if name.parts[0] not in (*BESIDE, *SHOWS, *without)}
    files |= {Path("models") / path.name: path for path in shipped("models").rglob("*")}
    digest = hashlib.sha256()
    for name, path in sorted(files.items()):
        if path.suffix in (".py", ".xml", ".json"):
            digest.update(name.as_posix().encode() + path.read_bytes())
    return digest.hexdigest()
