"""Users' models: read from a file, text, MjSpec or PyMJCF, checked, identified by a hash."""

import collections
import contextlib
import dataclasses
import functools
import glob
import hashlib
import html
import itertools
import os
import re
import sys
import threading
import weakref
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common import libmujoco, mjcb, process
from smc_mujoco.common.errors import ScenarioError, find, number, shown
from smc_mujoco.mechanisms.custom import file_numbers, urdf
from smc_mujoco.mechanisms.layout import LEAD, ROTOR
from smc_mujoco.mechanisms.plant import MAX_PARAMETER, leave_out_scenery

# Attributes that name files, and the folders where a <compiler> may say that they lie. They are
# found in the text, as MuJoCo reads files that are no XML; those of a comment count, too.
FILES = re.compile(rb"""\bfile\w*\s*=\s*(?:"([^"]*)"|'([^']*)')""")
FOLDERS = re.compile(rb"""\b(?:mesh|texture|asset)dir\s*=\s*(?:"([^"]*)"|'([^']*)')""")
OWN_NAME = re.compile(rb"""<mujoco\b[^>]*?\bmodel\s*=\s*(?:"([^"]*)"|'([^']*)')""")
COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
BEFORE_XML = b"\xef\xbb\xbf \t\r\n"  # what may stand before it
XML = (".xml", ".mjcf", ".urdf")
DIGITS = 17  # of numbers in the XML of an MjSpec: enough for any float64
ROUNDING = 1e-12  # relative and absolute: change of a model's numbers when it is written and read

RESERVED = ("smc:", LEAD, ROTOR)  # prefixes of names of this package's parts
# kinds of object that this package's parts add
RESERVED_KINDS = ("BODY", "JOINT", "GEOM", "TENDON", "TEXT")
# Parts of names of fields that do not affect the motion, or that MuJoCo computes.
UNUSED = ("_user", "numeric_data", "key_", "bvh_", "aabb", "invweight0")
CURES = {  # words of MuJoCo's message on a file -> what to do
    "Error opening file": "put that file there, seen from the model's folder",
    "volume is too small": 'give that mesh inertia="shell"; in a URDF, one with a volume',
    "ASCII": "save that file as a binary STL",
    "mass and inertia": "give that body a mass and an inertia (<inertial>)",
    "not found Element 'plugin'": "load its library before (mujoco.mj_loadPluginLibrary)",
    "must be positive in geom": "give its shapes sizes above 0, or delete them",
    "surrogates not allowed": "rename it, or its folder, in UTF-8",
    "positive eigenvalues": "give that body three moments of inertia above 0",
}
FROM_MUJOCO = ValueError, RuntimeError, mujoco.FatalError  # what it raises on a model
OF_A_PART = "not found", "invalid qpos size", "mujocoinclude"  # words on a file that is no model

# kinds of elements that parts add, and attributes that a default has not, on which MuJoCo fails
ADDED = "actuator", "equality", "geom", "joint", "site", "tendon"
NO_VALUES = {"classname", "compiler", "frame", "id", "info", "name", "parent", "signature"}
MAX_KEPT = 16  # models that are kept as they were read; chosen
Stamp = dict[str, tuple[int, int]]  # file -> time of its last change, ns, and size

_stamps: dict[str, Stamp] = {}  # of a hash, when it was taken
_latest: Stamp = {}  # of every file that was hashed, when it was last
_known: dict[str, Path] = {}  # hash of a file that this process has read -> where it was
_lock = threading.Lock()  # held while MuJoCo writes XML with more digits
process.free_after_fork(_lock)


POSE = "pose"  # name of the keyframe of a user's pose
SLIDE = mujoco.mjtJoint.mjJNT_SLIDE.value


@dataclasses.dataclass(frozen=True)
class ModelSource:
    """The source of a model: a file, or a text with the files that it names."""

    path: str  # of the file, absolute; "" for a text
    sha256: str  # of the model and all files that it names, 64 hex digits
    text: str = ""  # the MJCF, where there is no file
    assets: tuple[tuple[str, bytes], ...] = ()  # name and content of each file that the text names
    # joints and their positions, rad or m, of a keyframe POSE that the model gets; () for none
    pose: tuple[tuple[str, float], ...] = ()

    @property
    def file(self) -> str:
        """The file as a user writes it in the current folder; "" for a text."""
        return self.path and os.path.relpath(self.path)

    @property
    def label(self) -> str:
        """The file's name; for a text, words with the name that the model gives itself."""
        if self.path:
            return Path(self.path).name
        return f"the text of model {self.name.removesuffix('.xml')!r}"

    @property
    def name(self) -> str:
        """The file's name; for a text, the name that the model gives itself, as a file's name."""
        if self.path:
            return Path(self.path).name
        names = _values(OWN_NAME, _encoded(self.text))
        return f"{(names and names[0]) or 'model'}.xml"

    def spec(self) -> mujoco.MjSpec:
        """Return the model as an editable MjSpec of one's own.

        The file is parsed once. A change of it is an error.
        """
        spec = _parsed(self)
        self.check_unchanged()
        return spec.copy()

    def check_unchanged(self) -> None:
        """Raise ScenarioError if the file, or one that it names, is another than was read."""
        if self.path and not _unchanged(self):
            raise ScenarioError(
                f"{self.path}, or a file that it names, has changed: call smc.plant_from again"
            )

    def posed(self, pose: Mapping[str, float]) -> "ModelSource":
        """Return the source with a keyframe POSE in which joints have positions, rad or m.

        Raises:
          ScenarioError: no such hinge or slide, or a position that is beyond its range.
        """
        model = mjcb.compiled_spec(self.spec())
        names = [model.joint(i).name for i in range(model.njnt) if model.jnt_type[i] >= SLIDE]
        pairs = []
        for name, value in pose.items():
            find(f"joint of {self.label}", name, dict.fromkeys(names))
            place = number(f"pose of {name}", value)
            joint = model.joint(name)
            low, high = joint.range
            if model.jnt_limited[joint.id] and not low <= place <= high:
                raise ScenarioError(
                    f"pose of {name} is {place:g}, beyond its range from {low:.4g} to {high:.4g}: "
                    "give one within it, rad or m"
                )
            pairs.append((name, place))
        return dataclasses.replace(self, pose=tuple(pairs))

    def read(self) -> mujoco.MjSpec:
        """Parse the model, and check its numbers; a free joint without a name has its body's."""
        spec = self._read()
        if self.pose:
            model = mjcb.compiled_spec(spec.copy())
            qpos = model.qpos0.copy()
            for name, place in self.pose:
                qpos[model.joint(name).qposadr] = place
            spec.add_key(name=POSE, qpos=qpos)
        return spec

    def _read(self) -> mujoco.MjSpec:
        included = {}
        for name, content in self.assets:
            if name.lower().endswith(XML):
                included[name] = content
        texts = [_encoded(self.text), *included.values()]
        if self.path:
            contents = map(Path.read_bytes, map(Path, _stamps[self.sha256]))
            texts = [content for content in contents if _is_text(content)]
        file_numbers.check_texts(self.label, texts)
        try:
            self.path.encode()  # MuJoCo reads a path in UTF-8
            if not self.path:
                spec = mujoco.MjSpec.from_string(
                    self.text, include=included or None, assets=dict(self.assets)
                )
            elif from_urdf := urdf.read_urdf(Path(self.path)):
                file_numbers.check_urdf(self.label, from_urdf.text)
                spec = from_urdf.spec()
            else:
                spec = mujoco.MjSpec.from_file(self.path)
        except ScenarioError:
            raise
        except FROM_MUJOCO as error:
            raise broken(self.path or self.label, str(error), self.path) from None
        file_numbers.check_file_numbers(self.label, spec)
        taken = {joint.name for joint in spec.joints}
        for joint in spec.joints:
            if (
                joint.type == mujoco.mjtJoint.mjJNT_FREE
                and not joint.name
                and joint.parent.name not in taken
            ):
                joint.name = joint.parent.name
        _forget_defaults(spec)
        return spec

    def compiled(self, spec: mujoco.MjSpec) -> mujoco.MjModel:
        """Return the spec of this model, compiled."""
        try:
            return mjcb.compiled_spec(spec, _built)
        except FROM_MUJOCO as error:
            raise broken(self.path or self.label, str(error), self.path) from None


def _forget_defaults(spec: mujoco.MjSpec) -> None:
    """Reset the default classes of a model, whose own elements have their values by now: what parts
    add to it takes none of them.
    """
    fresh = mujoco.MjSpec()
    classes = {default.name: default for default in (body.classname for body in spec.bodies)}
    for default in (spec.default, *classes.values()):
        for kind in ADDED:
            plain = getattr(fresh.default, kind)
            for name in {*dir(plain)} - NO_VALUES:
                value = getattr(plain, name)
                if hasattr(value, "__int__"):  # a number, an array or a choice
                    setattr(getattr(default, kind), name, value)


@functools.lru_cache(maxsize=MAX_KEPT)
def _parsed(source: ModelSource) -> mujoco.MjSpec:
    """Return the model of a source, which is shared."""
    return source.read()


_unedited: weakref.WeakValueDictionary[ModelSource, mujoco.MjModel] = weakref.WeakValueDictionary()
_small: collections.deque[mujoco.MjModel] = collections.deque(maxlen=MAX_KEPT)  # that stay


def unedited_model(source: ModelSource) -> mujoco.MjModel:
    """Return the model of a source, without what is only seen, which all who use it now share."""
    source.check_unchanged()
    if (model := _unedited.get(source)) is None:
        spec = source.spec()
        leave_out_scenery(spec)
        model = _unedited[source] = source.compiled(spec)
        if mujoco.mj_sizeModel(model) <= mjcb.LARGE:
            _small.append(model)
    return model


def _built(spec: mujoco.MjSpec) -> mujoco.MjModel:
    return spec.compile()


def model_source(model: object, assets: Mapping[str, bytes | str] | None = None) -> ModelSource:
    """Coerce the path of a file, a text with its assets, an MjSpec, or a mjcf.RootElement of
    dm_control to a ModelSource, which stays as it is.
    """
    pymjcf = sys.modules.get("dm_control.mjcf")
    text = isinstance(model, str) and model.lstrip().startswith("<")
    if assets is not None and not text:
        raise ScenarioError(f"assets is {shown(assets)}, and the model is not text: leave them out")
    if isinstance(model, ModelSource):
        return model
    if isinstance(model, mujoco.MjSpec):
        return _of_spec(model)
    if pymjcf is not None and isinstance(model, pymjcf.RootElement):
        return _of_text(model.to_xml_string(), model.get_assets())  # pyright: ignore[reportAttributeAccessIssue] dm_control's own
    if text:
        return _of_text(str(model), {} if assets is None else assets)
    if not isinstance(model, str | os.PathLike):
        raise ScenarioError(
            f"path is {shown(model)}: give the path of an MJCF file (.xml), its text, "
            "an MjSpec or a mjcf.RootElement"
        )
    path = Path(os.path.abspath(os.fspath(model)))  # pyright: ignore[reportArgumentType]
    try:
        exists = path.is_file()
    except (OSError, ValueError):  # not a valid file name
        exists = False
    if not exists:
        raise ScenarioError(f"no model at {path}: give the path of an MJCF file (.xml)")
    if path.suffix == ".xacro":
        raise ScenarioError(
            f"{path.name} is no model yet: give what xacro {path.name} > FILE.urdf writes"
        )
    return _of_file(path)


def _of_file(path: Path) -> ModelSource:
    """Return the source of a file as it is now."""
    sha256, stamp = digest(path)
    _known[sha256] = path
    _note(sha256, stamp)
    return ModelSource(str(path), sha256)


def _note(sha256: str, stamp: Stamp) -> None:
    """Take note of when the files of a hash were read. MuJoCo's cache, which takes a mesh that is
    written again in the same second for the old one, is cleared if one has changed since.
    """
    _stamps[sha256] = stamp
    if not stamp.items() <= _latest.items():
        mujoco.mj_clearCache(mujoco.mj_getCache())
        _latest.update(stamp)


def source_of_record(name: str, sha256: str) -> ModelSource:
    """Return the source of a file that a record names without its folder: where this process has
    read it, else in the current folder or in one within it.
    """
    below = Path().glob(f"*/{glob.escape(name)}")
    places = [Path(name), *sorted(below)]
    if sha256 in _known:
        places.insert(0, _known[sha256])
    candidates = list(filter(Path.is_file, places))
    for place in candidates:
        now = _of_file(Path(os.path.abspath(place)))
        if now.sha256 == sha256:
            return now
    if candidates:
        raise ScenarioError(
            f"its model {candidates[0]}, or a file that it names, has changed since the run: put "
            "it back"
        )
    raise ScenarioError(f"its model {name} is not there: put it back, or run in its folder")


def _of_text(text: str, assets: Mapping[str, Any]) -> ModelSource:
    """Return the source of a text whose files are all among the assets."""
    kinds = bytes | bytearray | memoryview | str
    if not (
        isinstance(assets, Mapping)
        and all(isinstance(k, str) and isinstance(assets[k], kinds) for k in assets)
    ):
        raise ScenarioError(
            f"assets is {shown(assets)}: give names of files with their contents, as bytes or text"
        )
    contents = {}
    texts = [_encoded(text)]
    for name, content in assets.items():
        contents[name] = content.encode() if isinstance(content, str) else bytes(content)
        if name.lower().endswith(XML):
            texts.append(contents[name])
    asset_names = {PurePosixPath(name).name for name in contents}
    for name in itertools.chain.from_iterable(map(_files, (COMMENT.sub(b"", t) for t in texts))):
        if PurePosixPath(name).name not in asset_names:
            cure = f"give assets={{{name!r}: its bytes}}, or the path of the model's file"
            raise ScenarioError(
                f"the model names the file {shown(name)}, and a text has no folder: {cure}"
            )
    pairs = tuple(sorted(contents.items()))
    parts = [_encoded(text)]
    for name, content in pairs:
        parts += [name.encode(), content]
    return ModelSource("", _sha256(parts), text, pairs)


def _of_spec(spec: mujoco.MjSpec) -> ModelSource:
    """Return the source of an MjSpec as it is now: its XML with all digits, and the files that it
    names.
    """
    copied = spec.copy()
    mujoco.mj_clearCache(mujoco.mj_getCache())
    try:
        model = mjcb.compiled_spec(copied)
        text = full_precision_xml(copied)
    except FROM_MUJOCO as error:
        raise broken("the MjSpec", str(error), "") from None
    as_text = _of_text(text, _assets(spec, text))
    if lost := _difference(model, as_text.compiled(as_text.spec())):
        raise ScenarioError(
            f"the MjSpec loses its {lost} when it is written as XML: "
            "write the file, and give its path"
        )
    return as_text


def digest_of(spec: mujoco.MjSpec) -> str:
    """Hash an MjSpec as it is now, and the files that it names: SHA-256, 64 hex digits."""
    text = full_precision_xml(spec)
    assets = dict(sorted(_assets(spec, text).items()))
    return _sha256([text.encode(), *assets.values()])


def _assets(spec: mujoco.MjSpec, text: str) -> dict[str, bytes]:
    """Return name -> content of each file that an MjSpec names, given its XML."""
    inner = {"", *_values(FOLDERS, _encoded(text))}
    assets = dict(spec.assets)
    for name in _files(_encoded(text)):
        for folder in sorted(inner):
            place = Path(spec.modelfiledir) / folder / name
            if name not in assets and place.is_file():
                assets[name] = place.read_bytes()
    return assets


def full_precision_xml(spec: mujoco.MjSpec) -> str:
    """Return the XML of a compiled spec, with all digits if this MuJoCo can write them."""
    library = libmujoco.library()
    try:
        get = library._mjPRIVATE__get_xml_precision
        put = library._mjPRIVATE__set_xml_precision
    except AttributeError:  # the caller checks what is lost, with `_difference`
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
    for name in number_fields(model):
        a = getattr(model, name)
        b = getattr(again, name)
        if a.shape != b.shape or not np.allclose(
            a, b, rtol=ROUNDING, atol=ROUNDING, equal_nan=True
        ):
            return name
    return ""


def number_fields(model: mujoco.MjModel) -> list[str]:
    """Return the names of the model's arrays of numbers."""
    names = []
    for name in dir(model):
        if name[0] != "_" and isinstance(getattr(model, name), np.ndarray):
            names.append(name)
    return names


def broken(where: str, error: str, path: str) -> ScenarioError:
    """Return the error for MuJoCo's message about a model; path is that of its file, if any."""
    cure = next((CURES[words] for words in CURES if words in error), "")
    for file in sorted(Path(path).parent.glob("*.xml")) if path else ():
        if not cure and file.is_file() and Path(path).name in _files(file.read_bytes()):
            cure = f"give {file.name}, which includes it, or fix the file"
    if not cure:
        cure = "fix the file" if path else "fix it"
        if path and any(words in error for words in OF_A_PART):
            cure += ", or give the one that includes it"
    return ScenarioError(f"MuJoCo cannot read {where} ({' '.join(error.split())}): {cure}")


def pick(label: str, kind: str, name: object, names: Sequence[str]) -> int:
    """Return the index of a name among those of a model, or raise ScenarioError with the names that
    exist.
    """
    numbers = {present: i for i, present in enumerate(names) if present}
    if not numbers:
        raise ScenarioError(
            f"unknown {kind} of {label} {shown(name)}: none has a name there, so give one of its "
            f"{kind}s a name, or another file if it has none, such as the one that includes it"
        )
    return find(f"{kind} of {label}", name, numbers)


def digest(path: Path) -> tuple[str, Stamp]:
    """Return the hash of a file and every file that it names, SHA-256, 64 hex digits, with the
    times of their last changes and their sizes, as they were when they were read.

    If a name fits files in several folders, all of them count.
    """
    contents = {}
    stamp: Stamp = {}

    def read(file: Path) -> bytes:
        about = file.stat()
        stamp[str(file)] = about.st_mtime_ns, about.st_size
        contents[file] = file.read_bytes()
        return contents[file]

    if from_urdf := urdf.read_urdf(path):
        for file in (path, *from_urdf.meshes.values()):
            read(file)
        return _sha256(contents.values()), stamp
    names: dict[str, None] = {}
    inner = {"": None}
    folders = {}
    files = {path.resolve(): None}
    for file in (queue := [*files]):  # grows as files name further files
        content = read(file)
        if not _is_text(content):
            continue
        folders[file.parent] = None
        names |= dict.fromkeys(_files(content))
        inner |= dict.fromkeys(_values(FOLDERS, content))
        for name, sub, folder in itertools.product(names, inner, folders):
            place = folder / sub / name
            if place.is_file() and (resolved := place.resolve()) not in files:
                files[resolved] = None
                queue.append(resolved)
    return _sha256(contents.values()), stamp


def _unchanged(source: ModelSource) -> bool:
    """Return whether a file and those that it names are as when they were hashed."""
    with contextlib.suppress(OSError):
        stamps = _stamps.get(source.sha256, {})
        same = bool(stamps)
        for file, stamp in stamps.items():
            now = Path(file).stat()
            same = same and stamp == (now.st_mtime_ns, now.st_size)
        if same:
            return True
    sha256, stamp = digest(Path(source.path))
    if sha256 != source.sha256:
        return False
    _note(sha256, stamp)
    return True


def _sha256(parts: Iterable[bytes]) -> str:
    """Hash the hashes of the parts."""
    total = hashlib.sha256()
    for part in parts:
        total.update(hashlib.sha256(part).digest())
    return total.hexdigest()


def _is_text(content: bytes) -> bool:
    """Return whether the content of a file is a model or a part of one, and no mesh or picture."""
    return content.lstrip(BEFORE_XML).startswith(b"<")


def _encoded(text: str) -> bytes:
    return text.encode(errors="surrogatepass")


def _values(attributes: re.Pattern[bytes], text: bytes) -> list[str]:
    """Return the values of attributes in the text of a model."""
    values = []
    for double, single in attributes.findall(text):
        values.append(html.unescape((double or single).decode(errors="surrogateescape")))
    return values


def _files(text: bytes) -> list[str]:
    """Return the names of files in the text of a model, with and without their folders, which
    MuJoCo may be told to leave out.
    """
    names: dict[str, None] = {}
    for value in _values(FILES, text):
        name = value.replace("\\", "/")
        names |= dict.fromkeys([name, PurePosixPath(name).name])
    return list(filter(None, names))


def check_model(label: str, model: mujoco.MjModel) -> None:
    """Raise ScenarioError for NaN, for numbers beyond MAX_PARAMETER, and for names that this
    package uses itself.
    """
    arrays = [(name, getattr(model, name)) for name in number_fields(model)]
    for name in ("gravity", "wind", "density"):
        numbers = np.atleast_1d(getattr(model.opt, name))
        arrays.append((f"opt.{name}", numbers))
    for field, values in arrays:
        if values.dtype.kind != "f" or any(part in field for part in UNUSED):
            continue
        wrong = ~(np.abs(values) <= MAX_PARAMETER)
        if field.endswith("range"):  # ranges may be infinite
            wrong = np.isnan(values)
        if wrong.any():
            cure = f"give finite numbers of at most {MAX_PARAMETER:g} in its MJCF"
            raise ScenarioError(
                f"{field}[{np.argwhere(wrong)[0][0]}] of {label} is {values[wrong][0]:g}: {cure}"
            )
    for text in model.names.split(b"\0"):
        name = text.decode()
        for kind in RESERVED_KINDS if name.startswith(RESERVED) else ():
            kind_id = getattr(mujoco.mjtObj, f"mjOBJ_{kind}")
            if mujoco.mj_name2id(model, kind_id, name) >= 0:
                own = f"names that begin with {', '.join(RESERVED)} are smc_mujoco's own"
                raise ScenarioError(
                    f"{label} has a {kind.lower()} {name!r}, and {own}: give it another"
                )
