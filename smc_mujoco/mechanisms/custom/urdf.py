"""URDFs as they lie in robots' repositories: with meshes of a package, meshes that MuJoCo cannot
read or that are missing, and impossible inertias.
"""

import itertools
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

READABLE = (".stl", ".obj", ".msh")
UNSEEN_GROUP = 3  # of geoms: pictures show groups 0 to 2
ROUNDED = 1e-3  # share of an inertia, chosen: by less its digits may be wrong
LEAST = 1e-13  # kg m^2: MuJoCo refuses less
ENOUGH = 1.0 + 1e-9  # times what an inertia lacks, so that rounding does not undo it


class Urdf(NamedTuple):
    """A URDF that MuJoCo can read."""

    text: str
    meshes: dict[str, Path]  # name in the text -> file
    lost: list[str]  # names of meshes without a file that MuJoCo can read
    raised: list[str]  # links with an inertia that no body has

    def spec(self) -> mujoco.MjSpec:
        """Return it with its visual shapes, which replace the others in pictures, and with names of
        shapes by which a sentence tells the link. No link touches the one that carries it, which
        MuJoCo does not see where that is part of the world.
        """
        assets = {name: file.read_bytes() for name, file in self.meshes.items()}
        spec = mujoco.MjSpec.from_string(self.text, assets=assets)
        for body in spec.bodies:
            for k, geom in enumerate(body.geoms):
                geom.name = geom.name or (f"{body.name}:{k}" if k else body.name)
            if not all(geom.contype for geom in body.geoms):
                for geom in body.geoms:
                    if geom.contype:
                        geom.group = UNSEEN_GROUP
        fixed = ["world"]
        carried = []
        for body in spec.bodies[1:]:
            if body.parent.name not in fixed:
                continue
            if body.joints:
                carried.append(body.name)
            else:
                fixed.append(body.name)
        if spec.compiler.fusestatic:  # into the world
            fixed = fixed[:1]
        for first, second in itertools.product(fixed, carried):
            spec.add_exclude(bodyname1=first, bodyname2=second)
        return spec

    def notes(self, label: str, spec: mujoco.MjSpec) -> list[str]:
        """Return a sentence on each kind of change to the file, whose `spec` this is."""
        guessed = []
        moving = set()
        for body in spec.bodies[1:]:
            if body.joints or body.parent.name in moving:
                moving.add(body.name)
                solid = any(geom.contype for geom in body.geoms)
                if solid and not body.explicitinertial:
                    guessed.append(body.name)
        sentences = []
        if self.lost:
            sentences.append(
                f"{label} is read without its shapes {_listed(self.lost)}, which are missing or "
                "no .stl, .obj or .msh: put such files there, or do without"
            )
        if self.raised:
            sentences.append(
                f"no body has the inertia that {label} gives {_listed(self.raised)}, one moment "
                "of which exceeds the sum of the others: all three are raised by the difference, "
                "so correct them"
            )
        if re.search(r' velocity="[^"]*[1-9]', self.text):
            sentences.append(
                f"the velocity limits of {label} hold nothing: give references that keep to them"
            )
        if guessed:
            sentences.append(
                f"{label} gives {_listed(guessed)} no <inertial>, and MuJoCo takes that of their "
                "shapes with the density of water: give one to each"
            )
        return sentences


def read_urdf(file: Path) -> Urdf | None:
    """Return what a file says in a form that MuJoCo can read, or None where it is no URDF."""
    try:
        # with neither namespaces nor their prefixes, as MuJoCo reads it
        text = file.read_bytes().strip().replace(b"xmlns=", b"ns=")
        robot = ET.fromstring(re.sub(rb"(</?\w+):", rb"\1_", text))
        if robot.tag != "robot":
            return None
        return _mended(robot, file)
    except (OSError, ValueError, ET.ParseError):  # MuJoCo says what is wrong
        return None


def _mended(robot: ET.Element, file: Path) -> Urdf:
    own = robot.find("mujoco")
    if own is None:
        own = ET.SubElement(robot, "mujoco")
    compiler = own.find("compiler")
    if compiler is None:
        compiler = ET.SubElement(own, "compiler")
    folder = file.parent / compiler.attrib.pop("meshdir", "")
    compiler.attrib.setdefault("discardvisual", "false")
    compiler.set("strippath", "false")
    read = Urdf("", {}, [], [])
    stems: dict[str, Path] = {}
    for link in robot.iter("link"):
        shapes = [*link.findall("visual"), *link.findall("collision")]
        for shape in shapes:
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            name = mesh.get("filename", "")
            mesh_file = _found(name, folder, file.parent)
            if mesh_file is None:
                link.remove(shape)
                read.lost.append(name)
                continue
            stem = mesh_file.stem  # MuJoCo takes files with the same one for one mesh
            while stems.setdefault(stem, mesh_file) != mesh_file:
                stem += "_"
            alias = stem + mesh_file.suffix.lower()
            mesh.set("filename", alias)
            read.meshes[alias] = mesh_file
        inertia = link.find("inertial/inertia")
        if inertia is not None and _raised(inertia):
            read.raised.append(link.get("name", ""))
    return read._replace(text=ET.tostring(robot, encoding="unicode"))


def _found(name: str, meshdir: Path, folder: Path) -> Path | None:
    """Return the file that a mesh's name means, if MuJoCo can read it. A package is a folder above
    the URDF, or beside one above.
    """
    _, package, rest = name.rpartition("://")
    named = meshdir / Path(rest).name
    places = [meshdir / rest, named, folder / rest]
    rest = rest.lstrip("/")
    for above in (folder, *folder.parents) if package else ():
        places += [above / rest, above / rest.partition("/")[2]]
    for place in places:
        if place.suffix.lower() in READABLE and place.is_file():
            return place.resolve()
    return None


def _raised(inertia: ET.Element) -> bool:
    """Raise an inertia that no body has by what it lacks. Return whether that is more than
    rounding.
    """
    axes = ("xx", "xy", "xz", "yy", "yz", "zz")
    xx, xy, xz, yy, yz, zz = (float(inertia.get(f"i{axis}", 0.0)) for axis in axes)
    small, middle, large = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    missing = max(large - middle - small, LEAST - small)
    lacking = missing + (ENOUGH - 1.0) * large
    if large <= 0.0:  # MuJoCo says what is wrong
        return False
    if lacking > 0.0:
        inertia.set("ixx", str(xx + lacking))
        inertia.set("iyy", str(yy + lacking))
        inertia.set("izz", str(zz + lacking))
    return bool(large - middle - small > ROUNDED * large)


def _listed(names: Iterable[str]) -> str:
    """Return the first three names, and how many more there are."""
    quoted = [repr(name) for name in dict.fromkeys(names)]
    if len(quoted) > 3:
        quoted[3:] = [f"{len(quoted) - 3} more"]
    return ", ".join(quoted)
