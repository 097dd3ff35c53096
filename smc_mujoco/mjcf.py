"""MJCF files of others: read with errors in one line, and told apart by a hash of all files they are made of."""

import hashlib
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import mujoco

from smc_mujoco.errors import ScenarioError

FOLDERS = ("meshdir", "texturedir", "assetdir")  # where a <compiler> may say that assets lie


def read(path: Path) -> mujoco.MjSpec:
    """The model as an editable MjSpec; files that it includes are found from where it lies.

    Raises:
      ScenarioError: no such file, or one that MuJoCo cannot read.
    """
    if not path.is_file():
        raise ScenarioError(f"no model at {path}: give the path of an MJCF file (.xml)")
    try:
        return mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise broken(path, error) from None


def compiled(path: Path, spec: mujoco.MjSpec) -> mujoco.MjModel:
    """The spec of that file, compiled.

    Raises:
      ScenarioError: MuJoCo cannot compile it.
    """
    try:
        return spec.compile()
    except ValueError as error:
        raise broken(path, error) from None


def broken(path: Path, error: Exception) -> ScenarioError:
    """MuJoCo's complaint about a file, in one line."""
    return ScenarioError(f"MuJoCo cannot read {path} ({' '.join(str(error).split())}): mend the file")


def digest(path: Path) -> str:
    """SHA-256 of the file and of every file that it names: includes, meshes, textures; 64 hex digits."""
    found = hashlib.sha256()
    for content in _contents(path, [path.parent], set()):
        found.update(hashlib.sha256(content).digest())
    return found.hexdigest()


def _contents(path: Path, folders: list[Path], seen: set[Path]) -> Iterator[bytes]:
    """The bytes of a file and of those it names, each once, in the order in which they are named."""
    if path.resolve() in seen:
        return
    seen.add(path.resolve())
    content = path.read_bytes()
    yield content
    if path.suffix.lower() not in (".xml", ".mjcf", ".urdf"):
        return
    try:
        elements = list(ET.fromstring(content).iter())
    except ET.ParseError:
        return  # MuJoCo will say so
    named = [e.get(name) for e in elements if e.tag == "compiler" for name in FOLDERS]
    folders = [*folders, path.parent, *(base / name for base in folders[:1] for name in named if name)]
    for element in elements:
        for name in [value for key, value in element.attrib.items() if key.startswith("file")]:
            if place := next((folder / name for folder in folders if (folder / name).is_file()), None):
                yield from _contents(place, folders, seen)
