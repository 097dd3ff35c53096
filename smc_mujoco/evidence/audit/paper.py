"""A paper as data: a folder with paper.toml, its claims and thresholds, and claims.py, a function
for each claim.

    paper("levant_1993")            # one that ships
    paper("./my_paper")             # your own folder

docs/audit_a_paper.md shows how to write one, and lists the fields. A folder that is broken is
refused with one sentence, which says what is wrong with which file.
"""

import contextlib
import dataclasses
import functools
import importlib
import inspect
import os
import re
import sys
import tomllib
import traceback
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from smc_mujoco.common import files
from smc_mujoco.common.aliases import Data, Fields, Names, Numbers, Pair
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import MAX_ITEMS, ScenarioError, find, shown, unknown, whole, words
from smc_mujoco.common.files import as_path, reading, replacing
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.registry import KINDS, Catalogue, added, module_spec, warn
from smc_mujoco.control import gain_sets
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.law import law_catalogue as laws_known
from smc_mujoco.control.source import STUDY
from smc_mujoco.evidence.audit.verdict import (
    DERIVED,
    OURS,
    QUANTIFIERS,
    WHOSE_WORDS,
    Statement,
    Threshold,
)
from smc_mujoco.mechanisms.named import from_text
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.mechanisms.plant import plant_catalogue as plants_known
from smc_mujoco.simulation.condition_text import read_fields
from smc_mujoco.simulation.conditions import NAMED as CONDITIONS
from smc_mujoco.simulation.conditions import Condition, condition, find_condition
from smc_mujoco.simulation.scenario import Scenario

PAPER_FILE = "paper.toml"
CODE_FILE = "claims.py"
KINDS_OF_CLAIM = {"paper": "of its sentences", "derived": "derived", "ours": "beside it"}
NO_FIELDS: Data = frozen({})
# How much of a paper was read.
READ_PARTS: dict[str, None] = dict.fromkeys(
    ("full text", "abstract", "textbook", "second hand", "nothing")
)
TEXT_FIELDS = ("title", "authors", "source", "read", "access", "note")  # of a paper
# sets of gains that a search tries over the bounds, and around the best of them
SPREAD_SETS, NEAR_SETS = 6, 3
CURES: dict[Any, str] = {
    str: "a text",
    list: "a list of names",
    dict: "a table",
    bool: "true or false",
    dict | str: 'a table, as { "settling time, s" = "< 2" }',
}
FIELDS_CURE = 'fields of a scenario, as "duration=5.0"'
PAPER_FIELDS: Fields = {  # field of a paper -> its type
    **dict.fromkeys((*TEXT_FIELDS, "runs"), str),
    **dict.fromkeys(("claim", "sets", "quick_sets"), list),
    **dict.fromkeys(("plants", "conditions", "gains", "allowed"), dict),
}
REQUIRED_OF_CLAIM = ("id", "text", "whose", "where", "function", "holds_if")
CLAIM_FIELDS: Fields = {  # the same of a claim
    **dict.fromkeys((*REQUIRED_OF_CLAIM, "how", "over", "searched", "rivals", "runs"), str),
    **dict.fromkeys(("read", "words", "measured", "note", "instead", "shown_by"), str),
    **dict.fromkeys(("quantifier", "quick", "varies", "immune", "limit"), str),
    **dict.fromkeys(("plants", "laws", "conditions"), list),
    "holds_if": dict | str,
    "late": bool,
    **dict.fromkeys(("values", "examples"), dict),
}
REQUIRED_OF_PAPER = ("title", "authors", "source", "read", "claim")


class Allowed(NamedTuple):
    """The gains of a law that a paper allows, within the bounds of the search."""

    bounds: Mapping[str, Pair]  # gain -> lowest and highest value, both positive
    margins: Callable[[Numbers], Numbers] | None = None  # gains -> {condition: margin}
    spread: int = SPREAD_SETS  # sets of gains that a search tries over the whole bounds
    near: int = NEAR_SETS  # and around the best of them


@keyword_dataclass
class ClaimEntry(Statement):
    """A claim of a paper, with what measures it."""

    evidence: Callable[
        [Any], Any
    ]  # from runs under one set of gains to numbers, or to checks and numbers beside them
    thresholds: tuple[Threshold, ...] = ()  # empty if the function returns checks with limits
    quick: str = ""  # what a quick audit measures instead, if that is less
    late: bool = False  # whether it looks at the runs of all other claims, and so comes after them
    searched: str = ""  # the law whose gains are searched; the first of `laws` without it
    varies: str = (
        ""  # why its numbers, such as timings, differ from audit to audit; they are not sealed
    )
    immune: str = ""  # why no mutant of the law loses the claim, if none can
    plants: Names = ()
    laws: Names = ()  # the first is the one that mutants replace
    conditions: Names = ()
    fields: Data = NO_FIELDS  # of the scenarios of its runs
    values: Data = NO_FIELDS  # its numbers, such as the levels of a sweep


@keyword_dataclass
class Paper:
    """A paper, its claims, and what their runs are made of."""

    name: str  # of its folder
    folder: Path
    title: str
    authors: str
    source: str
    read: str  # how much of it was read, one of READ_PARTS
    access: str = ""  # where it was read, and what could not be read
    note: str = ""  # what a reader of the audit should know
    sets: Mapping[
        str, Mapping[str, Mapping[str, Numbers]] | None
    ]  # plant ("" for all) -> law -> gains
    quick_sets: Names
    plants: Mapping[str, Plant]  # its own, like the conditions and laws below
    conditions: Mapping[str, Condition]
    laws: Mapping[str, Template | Component]
    fields: Data  # of the scenarios of all its runs
    allowed: Mapping[str, Allowed]  # law -> gains, for claims about all or some of them
    claims: Mapping[str, ClaimEntry]  # in the order of the file

    @property
    def contents(self) -> str:
        """How many claims of each kind it has, and what of the paper was read, in a few words."""
        kinds = [claim.whose for claim in self.claims.values()]
        counts = []
        for kind, word in KINDS_OF_CLAIM.items():
            if kind in kinds:
                counts.append(f"{kinds.count(kind)} {word}")
        return f"{', '.join(counts)}; {self.read} read"

    def plant(self, plant: str) -> Plant:
        """Return a plant by the paper's name or the suite's."""
        find("plant", plant, plants_known() | self.plants)
        if plant in self.plants:
            return self.plants[plant]
        return find_plant(plant)

    def condition(self, text: str | Condition) -> Condition:
        """Return a condition by the paper's name, the suite's, or from its text."""
        if isinstance(text, str) and not set(":+") & set(text):
            return find("condition", text, {**CONDITIONS, **self.conditions})
        return find_condition(text)

    def law(self, plant: str, law: str, gains: str) -> Component:
        """Return a law with the gains that a set has for a plant.

        A law of the paper's folder keeps its defaults.
        """
        of_set = find("set of gains", gains, self.sets)
        if of_set is None:
            if law in self.laws:
                return self.bound(law, {})
            has_sets = law in (*gain_sets.COMPARED, *gain_sets.STUDY_ALIASES)
            return gain_sets.law_with_gains(
                self.plant(plant), law, gains if has_sets else "default"
            )
        general = of_set.get("", {}).get(law, {})
        of_plant = of_set.get(plant, {}).get(law, {})
        values = {**general, **of_plant}
        bound_law = self.bound(law, values)
        if law in self.laws:
            has_sets = {}
        else:
            has_sets = find("law", law, laws_known()).gains
        lacking = []
        for gain, declared in has_sets.items():
            if not declared.held and gain not in values:
                lacking.append(f"{gain} = {declared.default:g}")
        if lacking:
            raise ScenarioError(
                f"the gains {gains!r} of {law} lack some, whose defaults are not the paper's: "
                f"write in [gains.{gains}] what the paper has for {', '.join(lacking)}"
            )
        return bound_law

    def bound(self, law: str, gains: Numbers) -> Component:
        """Return a law with these gains, and its defaults for the rest."""
        base = find("law", law, laws_known() | self.laws)
        defaults = {}
        if isinstance(base, Component):
            base, defaults = base.template or base, base.gains
        values = {**defaults, **gains}
        if isinstance(base, Template):
            component = base.bind(values)
        else:
            component = dataclasses.replace(base, gains=values)
        return component.sourced(STUDY) if gains else component


def shipped() -> dict[str, Path]:
    """Return name -> folder of every paper that ships, in alphabetical order."""
    home = files.shipped("benchmarks/papers")
    folders = {}
    for path in sorted(home.glob(f"*/{PAPER_FILE}")):
        folders[path.parent.name] = path.parent
    return folders


Home = tuple[Path, str]  # a paper's folder, and the name under which it is imported


@functools.cache
def paper_catalogue() -> Catalogue[Home]:
    """Return name -> home of every paper that ships or comes with another package."""
    of_suite = {}
    for name, folder in shipped().items():
        of_suite[name] = (folder, _package(folder))
    return Catalogue(of_suite, added("smc_mujoco.papers", _of_package))


def _of_package(point: EntryPoint) -> Home:
    """Return the home of the paper that an entry point of another package names."""
    spec = module_spec(point)
    if not spec.submodule_search_locations:
        raise ScenarioError(f"{spec.origin} is no folder: give {KINDS[point.group][1]}")
    return Path(next(iter(spec.submodule_search_locations))), point.module


def paper(which: str | Path) -> Paper:
    """Return a paper by its name in `smc-mujoco claims --papers`, or from its folder."""
    paper_homes = paper_catalogue()
    if isinstance(which, str) and which in paper_homes:
        return _read_once(*paper_homes[which])
    folder = as_path(which, "the paper")
    if not os.path.isdir(folder):
        if isinstance(which, str) and not set("/\\.") & set(which):
            raise unknown("paper", which, paper_homes)
        raise ScenarioError(
            f"no folder {str(which)!r} with a {PAPER_FILE}: "
            f"give one, or a name of {', '.join(paper_homes)}"
        )
    return _read(folder, _package(folder))


def papers() -> dict[str, Paper]:
    """Return every paper that ships, or comes with another package, by its name, in alphabetical
    order.
    """
    paper_by_name: dict[str, Paper] = {}
    for key, home in paper_catalogue().items():
        try:
            paper_by_name[key] = _read_once(*home)
        except ScenarioError as error:
            if not (package := paper_catalogue().package(key)):
                raise
            warn(f"package {package!r}: its paper {key!r}: {error}")
    return paper_by_name


def new(folder: Path) -> list[Path]:
    """Copy the template, a paper that runs, to a folder, and return the files."""
    if os.path.exists(folder) and (not folder.is_dir() or any(folder.iterdir())):
        raise ScenarioError(f"{folder} is there already: give the name of a new folder")
    written = [folder / PAPER_FILE, folder / CODE_FILE]
    for file in written:
        with replacing(file) as part:
            part.write_text(
                (Path(__file__).parent / "template" / file.name).read_text(encoding="utf-8"),
                "utf-8",
            )
    return written


def _package(folder: Path) -> str:
    """Make a package of a user's folder, so that its modules are imported, and return its name."""
    package = ModuleType("paper_" + re.sub(r"\W", "_", folder.resolve().name))
    package.__path__ = [str(folder.resolve())]
    for module in list(sys.modules):
        if module.partition(".")[0] == package.__name__:
            del sys.modules[module]
    sys.modules[package.__name__] = package
    importlib.invalidate_caches()
    return package.__name__


@contextlib.contextmanager
def _about(what: object) -> Iterator[None]:
    """Put what an error is about before its message."""
    try:
        yield
    except ScenarioError as error:
        raise ScenarioError(f"{what}: {error}") from None


def _read(folder: Path, package: str) -> Paper:
    """Return the paper in a folder, whose code is imported under a package's name."""
    with reading(
        folder / PAPER_FILE, "paper", "make one with `smc-mujoco claims --new FOLDER`"
    ) as file:
        text = file.read_text(encoding="utf-8")
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{folder / PAPER_FILE} is no TOML: {error}") from None
    code = _module(folder, package)
    with _about(folder / PAPER_FILE):
        return _checked(folder, data, code)


_read_once = functools.cache(_read)  # for installed papers only: a user's folder may change


def _module(folder: Path, package: str) -> ModuleType:
    """Return the module claims.py with a paper's functions."""
    if not (folder / CODE_FILE).is_file():
        raise ScenarioError(
            f"no {CODE_FILE} in {folder}: write one, with a function for each claim of {PAPER_FILE}"
        )
    before, sys.dont_write_bytecode = (
        sys.dont_write_bytecode,
        True,
    )  # a user's folder stays as it is
    try:
        with _about(folder / CODE_FILE):
            return importlib.import_module(f"{package}.claims")
    except ScenarioError:
        raise
    except SyntaxError as error:
        raise ScenarioError(f"{error.filename}, line {error.lineno}: {error.msg}") from None
    except (Exception, SystemExit) as error:  # whatever the user's module raises
        raise ScenarioError(f"{_place(error, folder)}: {words(error)}") from None
    finally:
        sys.dont_write_bytecode = before


def _place(error: BaseException, folder: Path) -> str:
    """Return the file and line of a paper's folder at which an exception was raised."""
    frames = []
    for frame in traceback.extract_tb(error.__traceback__):
        if Path(frame.filename).is_relative_to(folder.resolve()):
            frames.append(frame)
    if frames:
        return f"{frames[-1].filename}, line {frames[-1].lineno}"
    return str(folder / CODE_FILE)


def failed(paper: Paper, entry: ClaimEntry, error: BaseException) -> ScenarioError:
    """Return the error for a claim whose function raised an exception."""
    called = f"function {inspect.unwrap(entry.evidence).__name__} of claim {entry.id}"
    if isinstance(error, ScenarioError):
        return ScenarioError(f"{paper.name}: {called}: {error}")
    return ScenarioError(f"{_place(error, paper.folder)}: {called} raised {words(error)}")


def _values(data: Data, fields: Data, required: Names) -> dict:
    """Return the values of a table, texts with single spaces; refuse unknown fields, wrong types
    and missing fields.
    """
    for field in data:
        find("field", field, fields)
    values = {}
    for field, value in data.items():
        values[field] = _typed(field, value, fields[field])
    for field in required:
        if not values.get(field):
            raise ScenarioError(f"it has no {field}: write {field}, {CURES[fields[field]]}")
    return values


def _typed(field: str, value: Any, kind: Any, cure: str = "") -> Any:
    """Return a value of this type, a text with single spaces, or raise ScenarioError naming the
    field.
    """
    if not isinstance(value, kind):
        raise ScenarioError(f"{field} is {shown(value)}: write {cure or CURES[kind]}")
    if isinstance(value, str):
        return " ".join(value.split())
    return value


def _checked(folder: Path, data: Data, code: ModuleType) -> Paper:
    """Return the paper in a file's data."""
    values = _values(data, PAPER_FIELDS, REQUIRED_OF_PAPER)
    find("part in read", values["read"], READ_PARTS)
    sets = _sets(values.get("gains", {}), values.get("sets", []))
    quick_sets = tuple(values.get("quick_sets", list(sets)[:1]))
    for item in quick_sets:
        find("set of gains in quick_sets", item, sets)
    texts = {}
    for field in TEXT_FIELDS:
        if field in values:
            texts[field] = values[field]
    plants = {}
    for key, item in values.get("plants", {}).items():
        plants[key] = _plant(f"plants.{key}", item, folder)
    conditions = {}
    for key, text in values.get("conditions", {}).items():
        conditions[key] = condition(key, **_fields(f"conditions.{key}", text))
    paper = Paper(
        name=folder.resolve().name,
        folder=folder,
        **texts,
        sets=sets,
        quick_sets=quick_sets,
        plants=plants,
        conditions=conditions,
        laws=dict(_laws(code)),
        fields=_fields("runs", values.get("runs", "")),
        allowed={},
        claims={},
    )
    functions = {}
    for key, value in vars(code).items():
        if inspect.isfunction(value):
            functions[key] = value
    allowed = {}
    for law, item in values.get("allowed", {}).items():
        allowed[law] = _allowed(law, item, functions, paper)
    paper = dataclasses.replace(paper, allowed=allowed)
    entries = {}
    for number, item in enumerate(values["claim"], 1):
        with _about(
            f"claim {item.get('id', f'number {number}') if isinstance(item, dict) else number}"
        ):
            entry = _entry(_typed("it", item, dict), functions, paper)
            if entry.id in entries:
                raise ScenarioError("it is there twice: give one another id")
        entries[entry.id] = entry
    return dataclasses.replace(paper, claims=entries)


def _entry(data: Data, functions: Mapping[str, Callable], paper: Paper) -> ClaimEntry:
    """Return a claim from its table."""
    values: Fields = {"read": paper.read} | _values(data, CLAIM_FIELDS, REQUIRED_OF_CLAIM)
    function = find(f"function of {CODE_FILE}", values.pop("function"), functions)
    threshold_text = values.pop("holds_if")
    if isinstance(threshold_text, str):
        thresholds = ()
    else:
        thresholds = tuple(_thresholds(threshold_text))
    values["holds_if"] = values.pop(
        "words",
        threshold_text if isinstance(threshold_text, str) else ", ".join(map(str, thresholds)),
    )
    values["quantifier"] = find("quantifier", values.get("quantifier", "named"), QUANTIFIERS)
    for field in ("plants", "laws", "conditions"):
        values[field] = tuple(values.get(field, ()))
    values.setdefault(
        "measured",
        " ".join((inspect.getdoc(function) or "").partition("\n\n")[0].split()).rstrip("."),
    )
    fields = _fields("runs", values.pop("runs", ""))
    entry = ClaimEntry(**values, evidence=function, thresholds=thresholds, fields=fields)
    _check(entry, paper)
    return entry


def _check(entry: ClaimEntry, paper: Paper) -> None:
    """Raise ScenarioError if a claim has an unknown name, or does not say whose it is, how derived
    or over what.
    """
    find("origin in whose", entry.whose, WHOSE_WORDS)
    find("part in read", entry.read, READ_PARTS)
    if entry.whose == DERIVED and not entry.how:
        raise ScenarioError("it is derived, and does not say how: write how, a text")
    if entry.whose != OURS and entry.read == "nothing":
        raise ScenarioError(
            f'nothing of the paper was read, and it is {entry.whose!r}: write whose = "ours"'
        )
    for name in entry.plants:
        paper.plant(name)
    for plant, gains in entry.examples.items():
        find("plant in examples", plant, dict.fromkeys(entry.plants))
        paper.bound(entry.searched or entry.laws[0], gains)
    for name in entry.conditions:
        paper.condition(name)
    for law in entry.laws:
        find("law", law, laws_known() | paper.laws)
        for gains, of_set in paper.sets.items():
            for plant in entry.plants if of_set is not None else ():
                paper.law(plant, law, gains)
    if entry.over:
        find("quantifier in over", entry.over, dict.fromkeys(("all", "some")))
        if entry.rivals:
            find("set of gains in rivals", entry.rivals, paper.sets)
        if (law := entry.searched or next(iter(entry.laws), "LAW")) not in paper.allowed:
            raise ScenarioError(
                f"it is about {entry.over} gains, and there is no table [allowed.{law}]: write one"
            )


def _allowed(law: str, data: object, functions: Mapping[str, Callable], paper: Paper) -> Allowed:
    """Return the gains that a paper allows for a law, from the table [allowed.LAW]."""
    table = dict(_typed(f"allowed.{law}", data, dict))
    find("law in allowed", law, laws_known() | paper.laws)
    margins = table.pop("margins", None)
    if margins is not None:
        margins = find(f"function of {CODE_FILE} in allowed.{law}", margins, functions)
    spread, near = _typed(
        "tried", table.pop("tried", [SPREAD_SETS, NEAR_SETS]), list, "two numbers, as [64, 24]"
    )
    bounds = {}
    for gain, ends in table.items():
        find(f"gain of {law} in allowed", gain, paper.bound(law, {}).gains)
        pair = []
        if isinstance(ends, list):
            for end in ends:
                if isinstance(end, int | float):
                    pair.append(end)
        if len(pair) != 2 or not 0.0 < pair[0] < pair[1]:
            raise ScenarioError(
                f"allowed.{law}.{gain} is {shown(ends)}: "
                "write two positive numbers, the lower first"
            )
        bounds[gain] = (float(pair[0]), float(pair[1]))
    return Allowed(
        bounds, margins, whole("tried", spread, 1, MAX_ITEMS), whole("tried", near, 0, MAX_ITEMS)
    )


def _thresholds(conditions: Data) -> Iterator[Threshold]:
    """Yield the thresholds in a table: measure -> text, or {asked, sentence}."""
    for measure, threshold in conditions.items():
        if isinstance(threshold, dict):
            parts = threshold
        else:
            parts = {"asked": threshold}
        for field in parts:
            find(
                f"field of the threshold of {measure!r}",
                field,
                dict.fromkeys(("asked", "sentence")),
            )
        yield Threshold.read(measure, parts.get("asked"), str(parts.get("sentence", "")))


def _sets(tables: Data, listed: list[str]) -> Fields:
    """Return set of gains -> plant -> law -> gains; None for a set of the suite."""
    for key in tables:
        if key in gain_sets.KNOWN_SETS:
            raise ScenarioError(
                f"gains.{key} is a set of the suite: give yours another name, such as gains.paper"
            )
    sets: Fields = {}
    for key in listed or list(tables) or ["default"]:
        sets[key] = find("set of gains in sets", key, {**tables, **gain_sets.KNOWN_SETS})
        if sets[key] is None:
            continue
        of_set: dict[str, Fields] = {}
        for law_or_plant, values in _typed(f"gains.{key}", sets[key], dict).items():
            table = _typed(f"gains.{key}.{law_or_plant}", values, dict)
            if table and all(isinstance(value, dict) for value in table.values()):
                of_set[law_or_plant] = table
            else:
                of_set.setdefault("", {})[law_or_plant] = table
        sets[key] = of_set
    return sets


def _plant(what: str, data: object, folder: Path) -> Plant:
    """Return a plant from its table: {plant, parameters...}; plant may be FILE.xml:joint+joint."""
    example = 'a table, as { plant = "duffing", delta = 0.0 }'
    values = dict(_typed(what, data, dict, example))
    base = _typed(f"{what}.plant", values.pop("plant", None), str, example)
    with _about(what):
        return from_text(base, folder, **values)


def _fields(what: str, text: object) -> Fields:
    """Return fields of a scenario from a text, such as "duration=5.0, control_period=1e-4"."""
    words = _typed(what, text, str, FIELDS_CURE)
    with _about(what):
        try:
            fields = read_fields(words)
        except SyntaxError:
            raise ScenarioError(f"it is {shown(text)}: write {FIELDS_CURE}") from None
    for field in fields:
        find(
            f"field of a scenario in {what}",
            field,
            dict.fromkeys(set(Scenario.fields()) - {"plant", "law"}),
        )
    return fields


def _laws(code: ModuleType) -> Iterator[tuple[str, Template | Component]]:
    """Yield name, law of every law in a paper's module; refuse one with the name of another law of
    the library.
    """
    for value in vars(code).values():
        if isinstance(value, Template | Component) and value.kind == "law":
            library_law = laws_known().get(value.name)
            if library_law and library_law.function is not value.function:
                raise ScenarioError(
                    f"law {value.name!r} of {CODE_FILE} is a name of the library's: rename it"
                )
            yield value.name, value
