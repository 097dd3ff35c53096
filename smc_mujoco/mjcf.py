"""MJCF files of others: read with errors in one line, and told apart by a hash of all files they are made of."""

import hashlib
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

import mujoco

from smc_mujoco import hook
from smc_mujoco.errors import ScenarioError, find, shown

FOLDERS = ("meshdir", "texturedir", "assetdir")  # where a <compiler> may say that assets lie
XML = (".xml", ".mjcf", ".urdf")


def read(path: Path) -> mujoco.MjSpec:
    """The model as an editable MjSpec; files that it includes are found from where it lies.

    Raises:
      ScenarioError: no such file, or one that MuJoCo cannot read.
    """
    try:
        there = path.is_file()
    except (OSError, ValueError):  # no name that a file can have
        there = False
    if not there:
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
        return hook.compiled(spec)
    except ValueError as error:
        raise broken(path, error) from None


def broken(path: Path, error: Exception) -> ScenarioError:
    """MuJoCo's complaint about a file, in one line: what, and where."""
    text = " ".join(str(error).split())
    line = re.search(r"[Ll]ine(?: number=)? ?(\d+)", text)
    where = f", line {line[1]}" if line and line[1] != "0" else ""
    if "Include error" in text or (line and not where):  # MuJoCo does not say in which
        where = f" in a file that it includes{where}"
    if parsed := re.search(r"XML_ERROR_(\w+)", text):  # of the parser, before MuJoCo has looked at it
        element = re.search(r"XMLElement name=(\S+)", text)
        text = parsed[1].replace("_", " ").lower().replace("parsing", "error in") + (
            f" <{element[1]}>" if element else ""
        )
    text = re.sub(r"^(?:(?:XML )?Error: |Schema violation: |ParseXML: )+|,? ?line \d+$", "", text)
    text = re.sub(r" Element '(\w+)'$", r" in <\1>", re.sub(r" Element name '.*$", "", text))
    return ScenarioError(f"MuJoCo cannot read {path} ({text}{where}): mend the file")


def pick(file: Path, kind: str, name: object, there: Mapping[str, int]) -> int:
    """The number of what has that name in a file, or the ScenarioError that says what has one."""
    if not there:
        raise ScenarioError(f"unknown {kind} of {file.name} {shown(name)}: none has a name there, so give it one")
    return find(f"{kind} of {file.name}", name, there)


def digest(path: Path) -> str:
    """SHA-256 of the file and of every file that it names: includes, attached models, meshes, textures; 64 hex digits.

    Where a name may stand for several files, all of them count.
    """
    texts, files = [path], {path.resolve(): None}
    names, folders, inner = [], {}, {"": None}
    for text in texts:  # to which those are added that they name
        folders[text.parent] = None
        for element in _elements(text):
            names += [value for key, value in element.attrib.items() if key.startswith("file")]
            inner |= {element.get(name, ""): None for name in FOLDERS if element.tag == "compiler"}
        for place in [folder / sub / name for name in names for sub in inner for folder in folders]:
            if place.is_file() and place.resolve() not in files:
                files[place.resolve()] = None
                texts += [place] if place.suffix.lower() in XML else []
    return hashlib.sha256(b"".join(hashlib.sha256(file.read_bytes()).digest() for file in files)).hexdigest()


def _elements(path: Path) -> list[ET.Element]:
    """The elements of an XML file; none where it is no such file, of which MuJoCo tells."""
    try:
        return list(ET.fromstring(path.read_bytes()).iter())
    except (OSError, ET.ParseError):
        return []
