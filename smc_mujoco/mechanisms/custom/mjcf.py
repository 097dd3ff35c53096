"""Users' models: read from a file, a text, an MjSpec or PyMJCF, tried in a child process, checked, identified by hash.

MuJoCo compiles a model in its own process, which a model may crash, or whose memory it may fill. So `tried` compiles
each model once in a child process first, with bounds on time and memory. That takes some hundredths of a second.
"""

import dataclasses
import functools
import hashlib
import json
import os
import re
import signal
import sys
import tempfile
import threading
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path, PurePosixPath

import mujoco
import numpy as np

from smc_mujoco.common import libmujoco, mjcb, process
from smc_mujoco.common.errors import ScenarioError, find, shown
from smc_mujoco.mechanisms.custom import mjcf_trial
from smc_mujoco.mechanisms.hardware.part import PLAY, ROTOR
from smc_mujoco.mechanisms.plant import LARGEST

FOLDERS = ("meshdir", "texturedir", "assetdir")  # where a <compiler> may say that assets lie
XML = (".xml", ".mjcf", ".urdf")
MEMORY = 4 * 2**30  # bytes of address space that a model may take where it is tried: chosen
DIGITS = 17  # of numbers in a text made of an MjSpec: all
SAME = 1e-12  # how far numbers of a model may move when it is written and read: rounding

RESERVED = ("smc:", PLAY, ROTOR)  # beginnings of the names of our own parts
NAMED = ("BODY", "JOINT", "GEOM", "TENDON", "TEXT")  # the kinds that our own parts are of
UNUSED = ("_user", "numeric_data", "key_", "bvh_", "aabb", "invweight0")  # in fields that set no motion, or follow
KINDS = {"body": "BODY", "jnt": "JOINT", "geom": "GEOM", "site": "SITE"}  # how a field's name begins -> what it is of
KINDS |= {"actuator": "ACTUATOR", "tendon": "TENDON", "eq": "EQUALITY"}

_tried: set[str] = set()  # hashes of models that passed
_lock = threading.Lock()  # held while MuJoCo writes another number of digits


@dataclasses.dataclass(frozen=True)
class Source:
    """The source of a model: a file, or a text with the files that it names.

    Attributes:
      path: of the file, absolute; "" for a text.
      sha256: of all that the model is made of, 64 hex digits.
      text: the MJCF, where there is no file.
      assets: name and content of each file that the text names.
    """

    path: str
    sha256: str
    text: str = ""
    assets: tuple[tuple[str, bytes], ...] = ()

    @property
    def label(self) -> str:
        """The file's name; of a text the name that its file would have."""
        return Path(self.path).name if self.path else f"{_modelname(self.text)}.xml"

    def read(self) -> mujoco.MjSpec:
        """Return the model as an editable MjSpec.

        Raises:
          ScenarioError: MuJoCo cannot read it, or the file is another than it was.
        """
        try:
            if not self.path:
                included = {name: content for name, content in self.assets if name.lower().endswith(XML)}
                return mujoco.MjSpec.from_string(self.text, include=included or None, assets=dict(self.assets))
            spec = mujoco.MjSpec.from_file(self.path)
        except ValueError as error:
            raise broken(self.path or self.label, str(error)) from None
        if digest(Path(self.path)) != self.sha256:
            raise ScenarioError(f"{self.path}, or a file that it names, has changed: call smc.plant_from again")
        return spec

    def compiled(self, spec: mujoco.MjSpec) -> mujoco.MjModel:
        """Return the spec of this model, compiled.

        Raises:
          ScenarioError: MuJoCo cannot compile it.
        """
        try:
            return mjcb.compiled(spec)
        except ValueError as error:
            raise broken(self.path or self.label, str(error)) from None


def source(model: object, assets: Mapping[str, bytes] | None = None) -> Source:
    """Coerce the path of a file, the text of one, an MjSpec, or a mjcf.RootElement of dm_control to a Source.

    Args:
      assets: name -> content of the files that a text names.

    Raises:
      ScenarioError: none of these, no such file, a file that a text names and nobody gives, or an MjSpec that XML does
        not hold.
    """
    pymjcf = sys.modules.get("dm_control.mjcf")
    text = isinstance(model, str) and model.lstrip().startswith("<")
    if assets is not None and not text:
        raise ScenarioError(f"assets is {shown(assets)}, and the model is no text: leave them out")
    if isinstance(model, mujoco.MjSpec):
        return _of_spec(model)
    if pymjcf is not None and isinstance(model, pymjcf.RootElement):
        return _of_text(model.to_xml_string(precision=DIGITS), model.get_assets())
    if text:
        return _of_text(str(model), {} if assets is None else assets)
    if not isinstance(model, str | os.PathLike):
        raise ScenarioError(
            f"path is {shown(model)}: give the path of an MJCF file (.xml), its text, an MjSpec or a mjcf.RootElement"
        )
    path = Path(os.path.abspath(os.fspath(model)))  # pyright: ignore[reportArgumentType]
    try:
        there = path.is_file()
    except (OSError, ValueError):  # no name that a file can have
        there = False
    if not there:
        raise ScenarioError(f"no model at {path}: give the path of an MJCF file (.xml)")
    return Source(str(path), digest(path))


def _of_text(text: str, assets: Mapping[str, bytes]) -> Source:
    """Return the source of a text whose files are all among the assets."""
    fits = isinstance(assets, Mapping) and all(isinstance(k, str) and isinstance(v, bytes) for k, v in assets.items())
    if not fits:
        raise ScenarioError(f"assets is {shown(assets)}: give names of files with their contents, as bytes")
    given = {PurePosixPath(name).name for name in assets}
    texts = [text, *(content for name, content in assets.items() if name.lower().endswith(XML))]
    for name in _files(element for one in texts for element in _elements(one)):
        if PurePosixPath(name).name not in given:
            raise ScenarioError(
                f"the model names the file {shown(name)}, and its text lies in no folder: give "
                f"assets={{{name!r}: its bytes}}, or the path of the model's file"
            )
    pairs = tuple(sorted(assets.items()))
    parts = [
        text.encode(errors="surrogatepass"),
        *(part for name, content in pairs for part in (name.encode(), content)),
    ]
    return Source("", _sha256(parts), text, pairs)


def _of_spec(spec: mujoco.MjSpec) -> Source:
    """Return the source of an MjSpec as it is now: its XML with all digits, and the files that it names."""
    own = spec.copy()
    try:
        model = mjcb.compiled(own)
        text = _exactly(own)
    except (ValueError, mujoco.FatalError) as error:
        raise broken("the MjSpec", str(error)) from None
    elements = _elements(text)
    inner = {"", *(element.get(name, "") for element in elements if element.tag == "compiler" for name in FOLDERS)}
    assets = dict(spec.assets)
    for name in _files(elements):
        places = [Path(spec.modelfiledir) / sub / name for sub in sorted(inner)]
        if name not in assets and (found := [place for place in places if place.is_file()]):
            assets[name] = found[0].read_bytes()
    made = _of_text(text, assets)
    if lost := _difference(model, made.compiled(made.read())):
        raise ScenarioError(f"the MjSpec loses its {lost} when it is written as XML: write the file, and give its path")
    return made


def _exactly(spec: mujoco.MjSpec) -> str:
    """Return the XML of a compiled spec, with all digits where this MuJoCo can write them."""
    library = libmujoco.library()
    try:
        get, put = library._mjPRIVATE__get_xml_precision, library._mjPRIVATE__set_xml_precision
    except AttributeError:  # `_difference` finds what is lost then
        return spec.to_xml()
    with _lock:
        before = get()
        put(DIGITS)
        try:
            return spec.to_xml()
        finally:
            put(before)


def _difference(model: mujoco.MjModel, again: mujoco.MjModel) -> str:
    """Return the first field in which two models differ by more than rounding, or ""."""
    for name in fields(model):
        one, other = getattr(model, name), getattr(again, name)
        if one.shape != other.shape or not np.allclose(one, other, rtol=SAME, atol=SAME, equal_nan=True):
            return name
    return ""


@functools.cache
def _fields(kind: type) -> tuple[str, ...]:
    return tuple(name for name in dir(kind) if not name.startswith("_"))


def fields(model: mujoco.MjModel) -> list[str]:
    """Return the names of the model's arrays of numbers."""
    return [name for name in _fields(type(model)) if isinstance(getattr(model, name), np.ndarray)]


def tried(source: Source, timeout: float) -> None:
    """Compile a model in a process of its own, unless this process has done so before.

    Args:
      timeout: s.

    Raises:
      ScenarioError: MuJoCo cannot read it, dies of it, or takes more time or memory than it may.
    """
    if source.sha256 in _tried:
        return
    with tempfile.TemporaryDirectory(prefix="smc_mujoco-") as temporary:
        folder, copies = Path(temporary), {}
        text, report, order = folder / "text", folder / "report", folder / "order"
        text.write_text(source.text, errors="surrogatepass")
        for i, (name, content) in enumerate(source.assets):
            copies[name] = str(folder / str(i))
            Path(copies[name]).write_bytes(content)
        files = {"path": source.path, "text": str(text), "assets": copies, "report": str(report), "memory": MEMORY}
        plugins = [*map(str, libmujoco.plugins())]
        order.write_text(json.dumps(files | {"library": str(libmujoco.path()), "plugins": plugins}))
        command = [sys.executable, "-I", "-S", mjcf_trial.__file__, str(order)]
        try:
            code = process.timed(command, timeout, output=False).returncode
        except process.Late:
            code = None
        except OSError:  # this process may start none
            return
        last = (report.read_text(errors="replace") if report.exists() else "").splitlines() or ["loading"]
    if last[-1].startswith("error") and "plugin" in last[-1]:  # one that its user has loaded here, perhaps
        return
    if last[-1] not in ("fine", "loading"):  # of the latter no model is to blame
        raise _complaint(source, last[-1], code, timeout)
    _tried.add(source.sha256)


def _complaint(source: Source, last: str, code: int | None, timeout: float) -> ScenarioError:
    """Return what is wrong with a model, from the last line of a trial and how its process ended."""
    stage, _, words = last.partition(" ")
    full = code == -getattr(signal, "SIGKILL", 0) or re.search(r"unknown exception|bad_alloc|memory|allocat", words)
    if full:
        return ScenarioError(f"{source.label} takes MuJoCo more than {MEMORY / 2**30:g} GiB of memory: make it smaller")
    if stage == "error":
        return broken(source.path or source.label, words)
    if code is None:
        return ScenarioError(
            f"{source.label} takes MuJoCo more than {timeout:g} s to compile: make it smaller, or give timeout="
        )
    names = {known.value: known.name for known in signal.Signals}
    how = names.get(-code, f"exit code {code}")
    hint = f"more than {MEMORY / 2**30:g} GiB of memory" if how == "SIGABRT" else "a model that attaches itself"
    return ScenarioError(f"{source.label} ends MuJoCo with {how}, as does {hint}: mend the model")


def broken(where: str, error: str) -> ScenarioError:
    """Return MuJoCo's complaint about a model in one line: what, and where."""
    text = " ".join(error.split())
    line = re.search(r"[Ll]ine(?: number=)? ?(\d+)", text)
    place = f", line {line[1]}" if line and line[1] != "0" else ""
    if "Include error" in text or (line and not place):  # MuJoCo does not say in which
        place = f" in a file that it includes{place}"
    if parsed := re.search(r"XML_ERROR_(\w+)", text):  # of the parser, before MuJoCo has looked at it
        element = re.search(r"XMLElement name=(\S+)", text)
        text = parsed[1].replace("_", " ").lower().replace("parsing", "error in") + (
            f" <{element[1]}>" if element else ""
        )
    text = re.sub(r"^(?:(?:XML )?Error: |Schema violation: |ParseXML: )+|,? ?line \d+$", "", text)
    text = re.sub(r" Element '(\w+)'$", r" in <\1>", re.sub(r" Element name '.*$", "", text))
    return ScenarioError(f"MuJoCo cannot read {where} ({text}{place}): mend the file")


def pick(label: str, kind: str, name: object, names: Sequence[str]) -> int:
    """Return the index of a name among those of a model, or raise ScenarioError with the names that exist."""
    there = {known: i for i, known in enumerate(names) if known}
    if not there:
        raise ScenarioError(f"unknown {kind} of {label} {shown(name)}: none has a name there, so give it one")
    return find(f"{kind} of {label}", name, there)


def digest(path: Path) -> str:
    """Hash the file and every file that it names (includes, attached models, meshes, textures): SHA-256, 64 hex digits.

    Where a name may stand for several files, all of them count.
    """
    texts, files = [path], {path.resolve(): None}
    names, folders, inner = [], {}, {"": None}
    for text in texts:  # to which those are added that they name
        folders[text.parent] = None
        elements = _elements(text)
        names += _files(elements)
        inner |= {element.get(name, ""): None for element in elements if element.tag == "compiler" for name in FOLDERS}
        for place in [folder / sub / name for name in names for sub in inner for folder in folders]:
            if place.is_file() and place.resolve() not in files:
                files[place.resolve()] = None
                texts += [place] if place.suffix.lower() in XML else []
    return _sha256(file.read_bytes() for file in files)


def _sha256(parts: Iterable[bytes]) -> str:
    """Hash the hashes of the parts."""
    return hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()


def _elements(model: Path | str | bytes) -> list[ET.Element]:
    """Return the elements of an XML file or text; none where it cannot be parsed, which MuJoCo reports."""
    try:
        return list(ET.fromstring(model.read_bytes() if isinstance(model, Path) else model).iter())
    except (OSError, ValueError, ET.ParseError):
        return []


def _files(elements: Iterable[ET.Element]) -> list[str]:
    """Return the names of files in the attributes of elements."""
    return [value for element in elements for key, value in element.attrib.items() if key.startswith("file")]


@functools.lru_cache(maxsize=32)
def _modelname(text: str) -> str:
    """Return the name that a model's text gives it, or "model"."""
    root = next(iter(_elements(text)), None)
    return (root is not None and root.get("model")) or "model"


def check_model(label: str, model: mujoco.MjModel) -> None:
    """Raise ScenarioError for NaN or enormous numbers, and for names that plants use themselves."""
    check_numbers(label, model)
    for name in [text.decode() for text in model.names.split(b"\0")]:
        for start in filter(name.startswith, RESERVED):
            for kind in NAMED:
                if mujoco.mj_name2id(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind}"), name) >= 0:
                    raise ScenarioError(
                        f"{label} has a {kind.lower()} {name!r}, and names that begin with {start!r} are "
                        "smc_mujoco's own: give it another"
                    )


def check_numbers(label: str, model: mujoco.MjModel) -> None:
    """Raise ScenarioError for a number that is NaN, infinite or beyond 1e15 SI units; ranges may be infinite."""
    named = sorted(fields(model), key=lambda name: name.partition("_")[0] not in KINDS)  # what has names first
    arrays = [(name, getattr(model, name)) for name in named]
    arrays += [(f"opt.{name}", np.atleast_1d(getattr(model.opt, name))) for name in ("gravity", "wind", "density")]
    for field, values in arrays:
        if values.dtype.kind != "f" or any(part in field for part in UNUSED):
            continue
        wrong = np.isnan(values) if field.endswith("range") else ~(np.abs(values) <= LARGEST)
        if wrong.any():
            place = tuple(np.argwhere(wrong)[0])
            raise ScenarioError(
                f"{field} of {label} is {values[place]:g}{_where(model, field, int(place[0]))}: "
                f"give finite numbers of at most {LARGEST:g} in its MJCF"
            )


def _where(model: mujoco.MjModel, field: str, i: int) -> str:
    """Return the body, joint, ... to which a number in a field belongs."""
    owner = field.partition("_")[0]
    if owner == "dof":
        owner, i = "jnt", int(model.dof_jntid[i])
    kind = KINDS.get(owner, "")
    name = kind and mujoco.mj_id2name(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind}"), i)
    return f" at {kind.lower()} {name!r}" if name else ""
