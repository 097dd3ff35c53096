"""Entries: laws that their authors enter in a suite.

An entry is a folder with a law and a file about it.

    entries/soft_relay/law.py       # or law.c, law.fmu: one law, see `smc.law`
    entries/soft_relay/entry.toml

    name = "soft relay"
    authors = ["A. Author"]
    source = "where the law comes from"
    licence = "MIT"
    division = "one set"

    [gains.all]
    k = 4.0

Divisions differ in where gains may come from, see DIVISIONS. A folder is data until its law runs in
a process of its own, see `entrant`.
"""

import ast
import builtins
import dataclasses
import hashlib
import os
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from smc_mujoco.benchmark import controls
from smc_mujoco.common.errors import ScenarioError, find, number, shown
from smc_mujoco.common.files import reading
from smc_mujoco.control import gain_sets
from smc_mujoco.control.from_text import law as law_of
from smc_mujoco.control.law import Law, known_laws
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.mechanisms.plant import plants

ABOUT = "entry.toml"
FILES = ("law.py", "law.c", "law.fmu")
TEXTS = "name", "source", "licence"
DIVISIONS = {
    "one set": "one set of gains, [gains.all], for all plants",
    "search": "a set for each plant, found by the search of this project (smc-mujoco tune)",
    "free": "a set for each plant, found in any way",
}
EVERYWHERE = "all"  # the set of gains of the division "one set"
MODULES = {"math", "numpy", "smc_mujoco"}  # that a checked law's file may import
BUILTIN_NAMES = """abs all any bool dict divmod enumerate float int isinstance len list max min pow range reversed round
set sorted str sum tuple zip ArithmeticError ValueError ZeroDivisionError __name__"""
BUILTINS = {*BUILTIN_NAMES.split()}
FRAMES = {
    "gi_frame",
    "cr_frame",
    "ag_frame",
    "tb_frame",
}  # from which all names of Python can be reached
WRITERS = {"tofile", "dump"}  # of arrays
OF_NUMPY = """arange argmax argmin array asarray clip cross diag dot empty eye float64 full interp linspace max min
ndarray ones sum trapezoid zeros"""
NUMPY_NAMES = {*OF_NUMPY.split()}
LIBRARY_NAMES = {
    "law_function",
    "Measurement",
    "surface_function",
    "estimator_function",
}  # that it may take from smc


@dataclasses.dataclass(frozen=True, kw_only=True)
class Entry:
    """An entry, as its folder says.

    Attributes:
      name: of the entry, in tables and as the folder of its results.
      authors, source, licence: who made the law, where it comes from, and what others may do with
        it.
      division: a key of DIVISIONS.
      gains: plant, or "all", -> gain -> value. Gains that are not named are the law's defaults.
      file: of the law; None for one of the library, which has its shipped gains.
      digest: sha256 of both files, or of the name.
    """

    name: str
    authors: tuple[str, ...]
    source: str
    licence: str
    division: str
    gains: Mapping[str, Mapping[str, float]]
    file: Path | None
    digest: str

    def law(self, plant: str) -> Law | str:
        """Return the law with its gains for a plant, or the name of a law of the library.

        This runs its file's code.
        """
        if self.file is None:
            return self.name
        law = law_of(str(self.file), **self.gains.get(EVERYWHERE, self.gains.get(plant, {}))).named(
            self.name
        )
        if controls.is_oracle(law):
            raise ScenarioError(
                f"entry {self.name!r} is the oracle, which is told what no law knows: give another law"
            )
        return law

    @property
    def why_unread(self) -> str:
        """Why importing a law's file of Python may do more than define functions; "" if it cannot."""
        if self.file is None or self.file.suffix != ".py":
            return ""
        for line, what in _beyond(ast.parse(self.file.read_text(encoding="utf-8"))):
            return f"line {line} of {self.file.name} has {what}, which can do more than compute"
        return ""

    @property
    def about(self) -> dict[str, Any]:
        """The entry as plain data, for its result."""
        fields = {}
        for field in dataclasses.fields(self):
            if field.name != "file":
                fields[field.name] = getattr(self, field.name)
        return fields | {
            "authors": list(self.authors),
            "gains": {k: dict(v) for k, v in self.gains.items()},
        }


def read(folder: str | os.PathLike[str]) -> Entry:
    """Return the entry in a folder, without running any of its code; or that of a law's name in the
    library.

    Raises:
      ScenarioError: no or several laws, a missing or wrong line of entry.toml, or gains for a
        single problem.
    """
    if folder in known_laws() and not os.path.isdir(folder):
        return _of_library(str(folder))
    folder = Path(folder)
    laws = [folder / name for name in FILES if (folder / name).is_file()]
    if len(laws) != 1:
        has = " and ".join(path.name for path in laws) or "none of them"
        raise ScenarioError(f"entry {str(folder)!r} has {has}: give one of {', '.join(FILES)}")
    with reading(
        folder / ABOUT, ABOUT, "write name, authors, source, licence and division in it"
    ) as file:
        text = file.read_bytes()
        try:
            about = tomllib.loads(text.decode())
        except tomllib.TOMLDecodeError as error:
            raise ScenarioError(f"it is not TOML: {error}") from None
        fields = _fields(about)
    with reading(laws[0], "law", "give a file of at most 100 MB") as file:
        code = file.read_bytes()
        if file.suffix == ".py":
            try:
                ast.parse(code)
            except (SyntaxError, ValueError) as error:
                raise ScenarioError(f"it is not Python: {error}") from None
    return Entry(**fields, file=laws[0], digest=hashlib.sha256(text + code).hexdigest())


def _of_library(name: str) -> Entry:
    """Return the entry of a law of the library, with shipped gains, which its search found, or else
    its defaults.
    """
    shipped = any(gain_sets.in_set(find_plant(plant), name, "tuned") for plant in plants())
    about = {
        "authors": ("the authors of smc_mujoco",),
        "source": f"smc_mujoco, law {name}",
        "licence": "Apache-2.0",
    }
    digest = hashlib.sha256(name.encode()).hexdigest()
    division = "search" if shipped else "one set"
    return Entry(
        name=name, division=division, gains=MappingProxyType({}), file=None, digest=digest, **about
    )


def _fields(about: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of an Entry that a file about it gives."""
    for name in about:
        find("line of entry.toml", name, dict.fromkeys((*TEXTS, "authors", "division", "gains")))
    texts = {name: _text(name, about.get(name)) for name in TEXTS}
    authors = about.get("authors")
    if not isinstance(authors, list) or not authors:
        raise ScenarioError(f'authors is {shown(authors)}: give names, as authors = ["A. Author"]')
    find("division", about.get("division"), DIVISIONS)
    names = tuple(_text("an author", author) for author in authors)
    gains = _gains(about.get("gains", {}), about["division"])
    return texts | {"authors": names, "division": about["division"], "gains": gains}


def _text(name: str, value: object) -> str:
    """Return a text of entry.toml."""
    if not isinstance(value, str) or not value.strip() or not value.isprintable():
        raise ScenarioError(
            f'{name} is {shown(value)}: give a text, as {name.rpartition(" ")[2]} = "..."'
        )
    return value.strip()


def _gains(sets: object, division: str) -> Mapping[str, Mapping[str, float]]:
    """Return plant -> gain -> value, as a division allows them."""
    if division == "one set":
        known = {EVERYWHERE}
    else:
        known = {*plants()}
    if not isinstance(sets, dict):
        raise ScenarioError(f"gains is {shown(sets)}: write a table, as [gains.{sorted(known)[0]}]")
    for name, values in sets.items():
        if name not in known or not isinstance(values, dict):
            raise ScenarioError(
                f"gains for {shown(name)}: the division {division!r} takes {DIVISIONS[division]}, so write "
                f"[gains.{sorted(known)[0]}]"
            )
    return MappingProxyType(
        {
            plant: MappingProxyType(
                {gain: number(f"gain {gain}", value) for gain, value in values.items()}
            )
            for plant, values in sets.items()
        }
    )


def _beyond(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield the line and the words of all in a law's file that may do more than compute: what is
    not known not to.
    """
    nodes = [*ast.walk(tree)]
    named = [name for node in nodes if isinstance(node, ast.Import) for name in node.names]
    modules = {name.asname or name.name: name.name for name in named}
    bases = {id(node.value) for node in nodes if isinstance(node, ast.Attribute)}
    for node in nodes:
        what = ""
        if isinstance(node, ast.Import | ast.ImportFrom):
            what = _imported(node)
        elif isinstance(node, ast.Attribute):
            if isinstance(node.value, ast.Name):
                module = modules.get(node.value.id)
            else:
                module = None
            if _computes(module, node.attr):
                what = ""
            else:
                what = f".{node.attr}"
        elif isinstance(node, ast.Name):
            known = node.id in BUILTINS or not (
                hasattr(builtins, node.id) or node.id.startswith("__")
            )
            if known and (node.id not in modules or id(node) in bases):
                what = ""
            else:
                what = node.id
        elif isinstance(
            node, ast.Global | ast.Nonlocal | ast.Match
        ):  # a pattern reads attributes by name
            what = f"a {type(node).__name__.lower()} statement"
        if what:
            yield getattr(node, "lineno", 1), what


def _imported(node: ast.Import | ast.ImportFrom) -> str:
    """Return what an import brings that may do more than compute, in words; "" for nothing."""
    if isinstance(node, ast.Import):
        far = [name.name for name in node.names if name.name not in MODULES]
        return f"import {far[0]}" if far else ""
    far = []
    for name in node.names:
        if node.module not in MODULES or not _computes(node.module, name.name):
            far.append(name.name)
    if far and node.module != "__future__":
        return f"from {node.module or '.'} import {far[0]}"
    return ""


def _computes(module: str | None, name: str) -> bool:
    """Return whether a name in a module, or of any other object (None), is known to do no more than
    compute.
    """
    if name.startswith("_"):
        return False
    if module == "numpy":
        return name in NUMPY_NAMES or isinstance(getattr(np, name, None), np.ufunc | float)
    if module == "smc_mujoco":
        return name in LIBRARY_NAMES
    return name not in FRAMES | WRITERS
