"""Files: the package's folders, names, atomic writing, reading what may be damaged, JSON with NaN
and infinity.
"""

import contextlib
import csv
import errno
import glob
import hashlib
import json
import math
import os
import re
import stat
import tempfile
import time
import uuid
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from smc_mujoco.common.aliases import AnyPath
from smc_mujoco.common.errors import ScenarioError, shown

MAX_NAME = 60  # bytes of a name in a file's name, which most file systems limit to 255
CHANGED = "it is damaged, or was changed, since it was written"
MAX_SIZE = 2 * 10**9  # bytes of a file that is read: chosen
MAX_UNPACKED = 500_000_000  # bytes of an archive
MAX_RATIO = 20  # of them per byte packed
MAX_MEMBERS = 10_000  # files of an archive
ABANDONED = 24 * 3600  # s since anything was written to a file that is not whole
# numbers that JSON lacks
NON_FINITE = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}


def shipped(folder: str) -> Path:
    """Return models/, scenes/, benchmarks/papers/ or docs/, of a checkout or an installed wheel."""
    here = Path(__file__).parents[1]
    for place in (here / folder, here.parent / folder):
        if place.is_dir():
            return place
    raise ScenarioError(f"no folder {folder!r} in {here} or beside it: reinstall smc-mujoco")


def slug(name: str, max_bytes: int = MAX_NAME) -> str:
    """Return a name as part of a file name: letters, digits, and _ . + - between them.

    It has no separator of folders and begins with no dot. Beyond `max_bytes` it is cut and ends in
    a hash.
    """
    words = re.sub(r"\s*=\s*", "-", name.lower())
    part = re.sub(r"[^\w.+-]+", "_", words).lstrip("._").rstrip("_") or "run"
    if len(part.encode()) > max_bytes:
        start = part.encode()[: max_bytes - 9].decode(errors="ignore")
        part = f"{start}-{hashlib.sha256(name.encode(errors='surrogatepass')).hexdigest()[:8]}"
    return part


def as_path(path: object, what: str = "the path") -> Path:
    """Return a path; raise ScenarioError, which names `what`, for what is none, or what no file can
    be called.
    """
    if not isinstance(path, str | os.PathLike):
        raise ScenarioError(f"{what} is {shown(path)}: give the name of a file or folder as a text")
    named = Path(path)
    try:
        named.lstat()
    except ValueError:
        cure = "give a name without \\0, which UTF-8 can encode"
        raise ScenarioError(f"{what} is {shown(str(path))}: {cure}") from None
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise ScenarioError(
                f"{what} is {shown(str(path))}: {error.strerror}; give a shorter one"
            ) from None
    return named


def with_ending(path: AnyPath, *endings: str) -> Path:
    """Return the path if its name ends in one of `endings`, such as ".json"; raise ScenarioError
    otherwise.
    """
    path = as_path(path)
    if path.suffix not in endings:
        raise ScenarioError(f"cannot save to {str(path)!r}: end the name in {' or '.join(endings)}")
    return path


def writable(*paths: AnyPath | None) -> None:
    """Raise ScenarioError for a file that cannot be written.

    Call it before a computation that takes minutes.
    """
    for target in paths:
        if target is None:
            continue
        path = Path(target)
        if os.path.isdir(path):  # unlike Path.is_dir, False also for a name that is too long
            raise ScenarioError(f"cannot write {path}: it is a folder, give the file in it a name")
        with (
            _writing(path),
            tempfile.TemporaryFile(dir=path.parent),
            contextlib.suppress(FileNotFoundError),
        ):
            _part(path).lstat()  # raises for a name that is too long


@contextlib.contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Make a file's folder, and turn an OSError in the block into a ScenarioError."""
    as_path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        why = error.strerror or error
        raise ScenarioError(
            f"cannot write {path}: {why}; choose another folder or make room"
        ) from error


def without_room(why: object) -> ScenarioError:
    """Return the error for temporary files that cannot be written."""
    return ScenarioError(f"no temporary file can be written ({why}): make room, or set TMPDIR")


@contextlib.contextmanager
def no_room(*numbers: int) -> Iterator[None]:
    """Turn an OSError in the block, which writes temporary files, into a ScenarioError; `numbers`:
    only these errno.
    """
    try:
        yield
    except OSError as error:
        if numbers and error.errno not in numbers:
            raise
        raise without_room(error.strerror or error) from error


@contextlib.contextmanager
def scratch() -> Iterator[Path]:
    """Yield a temporary folder, which is removed after the block."""
    with no_room():
        folder = tempfile.TemporaryDirectory(prefix="smc_mujoco-", ignore_cleanup_errors=True)
    with folder as name:
        yield Path(name)


@contextlib.contextmanager
def reading(path: AnyPath, kind: str, cure: str) -> Iterator[Path]:
    """Turn an exception in the with block, which reads a file, into one sentence.

    Yield the path.
    """
    if not isinstance(path, str | os.PathLike):
        raise ScenarioError(f"cannot read {shown(path)}: {cure}")
    try:
        if (file := Path(path)).exists() and not file.is_file():  # a pipe or a device may never end
            raise ScenarioError("it is not a regular file")
        _bounded(file)
        yield file
    except FileNotFoundError:
        raise ScenarioError(f"no {kind} at {path}: {cure}") from None
    except UnicodeError:
        raise ScenarioError(f"{path} is not a {kind} (it is not text): {cure}") from None
    except Exception as error:  # damaged bytes raise any exception there is
        why = " ".join(str(error).split())
        if not isinstance(error, ScenarioError):
            why = ", ".join(filter(None, (type(error).__name__, why)))
        raise ScenarioError(f"{path} is not a {kind} ({why}): {cure}") from None


def _bounded(file: Path) -> None:
    """Raise ScenarioError for a file that is too large, or an archive that unpacks to too much."""
    size = file.stat().st_size
    if size > MAX_SIZE:
        raise ScenarioError(f"it has {size / 1e6:,.0f} MB, more than {MAX_SIZE / 1e6:,.0f} MB")
    if not zipfile.is_zipfile(file):
        return
    with zipfile.ZipFile(file) as archive:
        members = archive.infolist()
    unpacked = sum(member.file_size for member in members)
    if unpacked > max(MAX_UNPACKED, MAX_RATIO * size) or len(members) > MAX_MEMBERS:
        raise ScenarioError(
            f"it unpacks from {size / 1e6:,.0f} MB to {len(members):,} files of "
            f"{unpacked / 1e6:,.0f} MB in all, and {MAX_MEMBERS:,} files and "
            f"{MAX_UNPACKED / 1e6:,.0f} MB are allowed"
        )


def csv_rows(path: AnyPath) -> list[tuple[int, list[str]]]:
    """Return line number and cells of each row.

    If semicolons separate the cells, a comma is a decimal point.
    """
    with reading(
        path, "CSV file", "give a CSV file, with commas or semicolons between cells"
    ) as file:
        with file.open(newline="", encoding="utf-8-sig") as text:
            semicolons = ";" in re.sub('"[^"]*"', "", text.readline())
            text.seek(0)
            reader = csv.reader(text, strict=True, delimiter=";" if semicolons else ",")
            rows = []
            for row in reader:
                if len(row) > 1 or any(row):
                    rows.append((reader.line_num, list(map(str.strip, row))))
        if any("\0" in "".join(row) for _, row in rows):
            raise ScenarioError("it is not text")
    if semicolons:
        for _, row in rows:
            row[:] = [cell.replace(",", ".") for cell in row]
    return rows


def plain_data(data: Any) -> Any:
    """Return the data with words for NaN and infinities.

    A text that is such a word gets a leading '.
    """
    if isinstance(data, Mapping):
        return {name: plain_data(value) for name, value in data.items()}
    if isinstance(data, list | tuple):
        return list(map(plain_data, data))
    if isinstance(data, float) and not math.isfinite(data):
        if math.isnan(data):
            return "NaN"
        return "Infinity" if data > 0 else "-Infinity"
    if isinstance(data, str) and data.lstrip("'") in NON_FINITE:
        return f"'{data}"
    return data


def _restored(data: Any) -> Any:
    """Undo `plain`, except that tuples become lists."""
    if isinstance(data, dict):
        return {name: _restored(value) for name, value in data.items()}
    if isinstance(data, list):
        return list(map(_restored, data))
    if isinstance(data, str) and data.lstrip("'") in NON_FINITE:
        if data.startswith("'"):
            return data[1:]
        return NON_FINITE[data]
    return data


def to_json(data: Any, indent: int | None = None, sort_keys: bool = False) -> str:
    """Return the data as JSON, made `plain`."""
    return json.dumps(plain_data(data), indent=indent, sort_keys=sort_keys, allow_nan=False)


def from_json(text: str) -> Any:
    """Return the data in a JSON text, with numbers in place of the words of `plain`.

    Raises:
      ValueError: it is no JSON, or an object has a name twice.
    """
    return _restored(json.loads(text, object_pairs_hook=_object))


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    data = dict(pairs)
    if len(data) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"{shown(twice)} stands in it twice")
    return data


def write_json(path: Path, data: Any, indent: int | None = 1) -> Path:
    """Write data as a JSON file, atomically."""
    text = to_json(data, indent)
    return write_text(path, f"{text}\n")


def read_json(path: Path) -> Any:
    """Return the data in a JSON file, see `from_json`."""
    return from_json(path.read_text(encoding="utf-8"))


def sealed(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the data of a JSON file with its seal: a hash of all the rest, 64 hex digits."""
    return dict(data) | {"seal": _seal(data)}


def unsealed(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the data of a JSON file; ScenarioError if its seal is not theirs."""
    if data.get("seal") != _seal(data):
        raise ScenarioError(CHANGED)
    return dict(data)


def _seal(data: Mapping[str, Any]) -> str:
    rest = {name: value for name, value in data.items() if name != "seal"}
    return hashlib.sha256(to_json(rest, sort_keys=True).encode()).hexdigest()


def _part(path: Path) -> Path:
    """Return the name of a new file beside `path`."""
    return path.with_name(f".{path.stem}.{uuid.uuid4().hex}{path.suffix}")


def write_text(path: Path, text: str) -> Path:
    """Write a text, all of it or nothing. Return the path."""
    with replacing(path) as file:
        file.write_text(text, encoding="utf-8")
    return path


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary file beside `path`.

    It replaces `path` if the block succeeds, and is deleted otherwise.
    """
    part = _part(path)
    with _writing(path):
        part.touch(exist_ok=False)
        try:
            yield part
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


def clear_abandoned(path: Path) -> None:
    """Delete the parts of a file that processes have left which were killed a day ago or before."""
    for part in path.parent.glob(f".{glob.escape(path.stem)}.{32 * '?'}{path.suffix}"):
        with contextlib.suppress(OSError):
            if time.time() - part.stat().st_mtime > ABANDONED:
                part.unlink()


def own(path: Path) -> bool:
    """Return whether nobody but this user, and the administrator, can have written a file or a
    folder.

    Raises:
      OSError: there is none.
    """
    about = path.stat()
    if os.name != "posix":
        return True
    by_anybody = stat.S_IWGRP | stat.S_IWOTH
    return about.st_uid in (os.getuid(), 0) and not about.st_mode & by_anybody
