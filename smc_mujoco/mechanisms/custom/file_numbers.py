"""What the numbers of an MJCF or a URDF may be. MuJoCo takes some that no machine has without a
word: it drops a range that is the wrong way round, and a NaN counts as left out.
"""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.text import real


class FileNumber(NamedTuple):
    """A number of a kind of element, or of several."""

    elements: str  # of an MjSpec
    field: str  # of an element, of which the first number counts
    word: str = ""  # for it in the file, if it is another


# Numbers that are 0 or above
NATURAL = (
    FileNumber("joints", "damping"),
    FileNumber("joints", "stiffness"),
    FileNumber("joints", "frictionloss"),
    FileNumber("joints", "armature"),
    FileNumber("tendons", "damping"),
    FileNumber("tendons", "stiffness"),
    FileNumber("tendons", "frictionloss"),
    FileNumber("geoms", "density"),
    FileNumber("actuators", "delay"),
)
OF_OPTION = ("density", "viscosity")
# Pairs of numbers, the lower one first
ORDERED = (
    FileNumber("joints", "range"),
    FileNumber("joints", "actfrcrange", "actuatorfrcrange"),
    FileNumber("tendons", "range"),
    FileNumber("actuators", "ctrlrange"),
    FileNumber("actuators", "forcerange"),
    FileNumber("actuators", "actrange"),
)
# attributes of a URDF's joint: element, attribute
URDF_NATURAL = (
    ("limit", "effort"),
    ("limit", "velocity"),
    ("dynamics", "damping"),
    ("dynamics", "friction"),
)
NAN = re.compile(
    rb"""\b(\w+)\s*=\s*["'](?:[-+.\deE\s]*\s)?[-+]?nan(?:\s[^"']*)?["']""", re.IGNORECASE
)
TEXTS = {b"name", b"class", b"childclass", b"model", b"data"}  # attributes that are no numbers


def check_file_numbers(label: str, spec: mujoco.MjSpec) -> None:
    """Raise ScenarioError for a number of a model that no machine has. `spec` is as it was read."""
    for sentence in _wrong(spec):
        raise ScenarioError(f"{label} has {sentence}")


def check_texts(label: str, texts: Iterable[bytes]) -> None:
    """Raise ScenarioError for a NaN in a file, which MuJoCo takes for a number that is left out."""
    for text in texts:
        for match in NAN.finditer(text):
            if match[1] not in TEXTS:
                raise ScenarioError(
                    f"{label} has {match[0].decode(errors='replace')}: give a number, or leave "
                    f"{match[1].decode()} out"
                )


def check_urdf(label: str, text: str) -> None:
    """Raise ScenarioError for a number of a URDF that no machine has."""
    for joint in ET.fromstring(text).iter("joint"):
        for element, attribute in URDF_NATURAL:
            part = joint.find(element)
            text = "0" if part is None else part.get(attribute, "0")
            if _below_zero(text):
                raise ScenarioError(
                    f"{label} has {attribute} {text.strip()} of joint {joint.get('name')!r}: give "
                    "0 or more"
                )


def _below_zero(text: str) -> bool:
    try:
        return real(text) < 0.0
    except ValueError:  # MuJoCo says so
        return False


def _wrong(spec: mujoco.MjSpec) -> Iterator[str]:
    """Yield words on each wrong number, with its cure."""
    for row in NATURAL:
        for element in getattr(spec, row.elements):
            value = float(np.ravel(getattr(element, row.field))[0])
            if value < 0.0:
                yield f"{row.field} {value:g} of {_called(row, element)}: give 0 or more"
    for name in OF_OPTION:
        if (value := getattr(spec.option, name)) < 0.0:
            yield f"{name} {value:g} of its <option>: give 0 or more"
    for actuator in spec.actuators:
        kp = -float(actuator.biasprm[1])
        if actuator.biastype == mujoco.mjtBias.mjBIAS_AFFINE and kp < 0.0:
            called = _called(FileNumber("actuators", ""), actuator)
            yield f"kp {kp:g} of {called}, which drives it away: give 0 or more"
    for row in ORDERED:
        for element in getattr(spec, row.elements):
            low, high = map(float, getattr(element, row.field))
            if low > high:
                yield (
                    f"{row.word or row.field} {low:g} {high:g} of {_called(row, element)}, which "
                    "MuJoCo takes for none: give the lower one first"
                )


def _called(row: FileNumber, element: Any) -> str:
    """Return words for an element."""
    kind = row.elements.removesuffix("s")
    name = element.name or getattr(element, "target", "")
    return f"{kind} {name!r}" if name else f"a {kind}"
