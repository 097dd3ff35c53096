"""A paper as data: a folder with paper.toml, its claims and thresholds, and claims.py, a function for each claim.

    paper("levant_1993")            # one that ships
    paper("./my_paper")             # your own folder

docs/audit_a_paper.md shows how to write one, and lists the fields. A folder that is broken is refused with one
sentence, which says what is wrong with which file.
"""

import dataclasses
import functools
import importlib
import inspect
import os
import re
import sys
import tomllib
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from smc_mujoco.common.catalogue import KINDS, Catalogue, added, source, warn
from smc_mujoco.common.errors import ScenarioError, find, name, shown, unknown
from smc_mujoco.common.files import reading, replacing
from smc_mujoco.common.frozen import frozen
from smc_mujoco.control import gain_sets
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.law import catalogue as laws_known
from smc_mujoco.control.source import STUDY
from smc_mujoco.evidence.audit.verdict import (
    DERIVED,
    EXISTENTIAL,
    NAMED,
    OURS,
    PAPER,
    UNIVERSAL,
    WHOSE,
    Statement,
    Threshold,
)  # fmt: skip
from smc_mujoco.mechanisms.named import from_text
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.plant import catalogue as plants_known
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.simulation.conditions import DURATION, Condition, condition, find_condition, read_fields
from smc_mujoco.simulation.conditions import NAMED as CONDITIONS
from smc_mujoco.simulation.scenario import Scenario

PAPER_FILE, CODE_FILE = "paper.toml", "claims.py"
SHIPPED_PACKAGE = "smc_mujoco.evidence.papers"
QUANTIFIERS = {"universal": UNIVERSAL, "existential": EXISTENTIAL, "named": NAMED}
NO_FIELDS: Mapping[str, Any] = frozen({})
TEXT_FIELDS = ("title", "authors", "source", "read", "access", "note", "runs")  # of a paper
READ_PARTS = ("full text", "abstract", "textbook", "second hand", "nothing")  # what of a paper was read
KINDS_OF_CLAIM = {PAPER: "of its sentences", DERIVED: "derived", OURS: "beside it"}
GAIN_QUANTIFIERS = ("all", "some")  # of the gains that a paper allows
SUITE_SETS = (*gain_sets.SETS, "default")  # of the suite
CLAIM_FIELDS = {  # field of a claim -> its type and what to write; the first six are needed
    "id": (str, "a text"),
    "text": (str, "a text"),
    "whose": (str, '"paper" for a sentence of the paper, "derived" for what follows from one, "ours" for a question'),
    "where": (str, "a text"),
    "function": (str, "the name of a function"),
    "holds_if": (dict | str, 'a table, as { "settling time, s" = "< 2" }'),
    "how": (str, "a text: how it is derived, or why it is asked"),
    "read": (str, f"one of {', '.join(READ_PARTS)}"),
    "over": (str, '"all" or "some" of the gains in [allowed.LAW]'),
    "words": (str, "a text: holds_if in words"),
    "measured": (str, "a text"),
    "note": (str, "a text"),
    "instead": (str, "a sentence: what the author may claim instead"),
    "shown_by": (str, "the command that shows it"),
    "quantifier": (str, "universal, existential or named"),
    "quick": (str, "a text"),
    "late": (bool, "true or false"),
    "varies": (str, "a text: why its numbers differ from audit to audit"),
    "immune": (str, "a text: why no mutant of the law loses the claim"),
    "plants": (list, "a list of names"),
    "laws": (list, "a list of names"),
    "conditions": (list, "a list of names"),
    "runs": (str, 'fields of a scenario, as "duration=5.0"'),
    "values": (dict, "a table of numbers"),
}
REQUIRED_FIELDS = tuple(CLAIM_FIELDS)[:6]


class Allowed(NamedTuple):
    """The gains of a law that a paper allows, within the bounds of the search.

    Attributes:
      bounds: gain -> lowest and highest value, both positive.
      margins: function of gains, name -> value, that returns condition of the theorem -> margin, positive where it is
        met. None without conditions.
    """

    bounds: Mapping[str, tuple[float, float]]
    margins: Callable[[Mapping[str, float]], Mapping[str, float]] | None = None


@dataclasses.dataclass(frozen=True, kw_only=True)
class Entry(Statement):
    """A claim of a paper. Besides the attributes of a `Statement` it has:

    Attributes:
      evidence: function from runs under one set of gains to numbers, or to checks and the numbers beside them.
      thresholds: what the numbers must be; empty if the function returns checks with limits.
      quick: what a quick audit measures instead, if that is less.
      late: whether it looks at the runs of all other claims, and so comes after them.
      varies: why its numbers differ from audit to audit, as a timing; they are not sealed.
      immune: why no mutant of the law loses the claim, if none can.
      plants, laws, conditions: names of what it is about; the first law is the one that mutants replace.
      fields: of the scenarios of its runs.
      values: its numbers, such as the levels of a sweep.
    """

    evidence: Callable[[Any], Any]
    thresholds: tuple[Threshold, ...] = ()
    quick: str = ""
    late: bool = False
    varies: str = ""
    immune: str = ""
    plants: tuple[str, ...] = ()
    laws: tuple[str, ...] = ()
    conditions: tuple[str, ...] = ()
    fields: Mapping[str, Any] = NO_FIELDS
    values: Mapping[str, Any] = NO_FIELDS


@dataclasses.dataclass(frozen=True, kw_only=True)
class Paper:
    """A paper, its claims, and what their runs are made of.

    Attributes:
      name: of its folder.
      title, authors, source: as one cites it.
      read: what was read of it, one of READ_PARTS.
      access: where, and what could not be read.
      note: what a reader of the audit should know.
      sets: set of gains -> plant ("" for all) -> law -> gain -> value; None for a set of the suite.
      quick_sets: the sets of a quick audit.
      plants, conditions, laws: its own, by name.
      fields: of the scenarios of all its runs.
      allowed: law -> gains that the paper allows, for claims about all or some of them.
      claims: in the order of the file.
    """

    name: str
    folder: Path
    title: str
    authors: str
    source: str
    read: str
    access: str = ""
    note: str = ""
    sets: Mapping[str, Mapping[str, Mapping[str, Mapping[str, float]]] | None]
    quick_sets: tuple[str, ...]
    plants: Mapping[str, Plant]
    conditions: Mapping[str, Condition]
    laws: Mapping[str, Template | Component]
    fields: Mapping[str, Any]
    allowed: Mapping[str, Allowed]
    claims: Mapping[str, Entry]

    @property
    def contents(self) -> str:
        """How many claims of each kind it has, and what of the paper was read, in a few words."""
        kinds = [claim.whose for claim in self.claims.values()]
        counts = [f"{kinds.count(kind)} {word}" for kind, word in KINDS_OF_CLAIM.items() if kind in kinds]
        return f"{', '.join(counts)}; {self.read} read"

    def plant(self, plant: str) -> Plant:
        """Return a plant by the paper's name or the suite's."""
        if plant in self.plants:
            return self.plants[plant]
        find("plant", plant, plants_known() | self.plants)
        return find_plant(plant)

    def condition(self, text: str | Condition) -> Condition:
        """Return a condition by the paper's name, the suite's, or from its text."""
        if isinstance(text, str) and not set(":+") & set(text):
            return find("condition", text, {**CONDITIONS, **self.conditions})
        return find_condition(text)

    def law(self, plant: str, law: str, gains: str) -> Component:
        """Return a law with the gains that a set has for a plant. A law of the paper's folder keeps its defaults.

        Raises:
          ScenarioError: an unknown law, set or gain, or a set that lacks gains of a law of the library.
        """
        of_set = find("set of gains", gains, self.sets)
        if of_set is None:
            if law in self.laws or law not in (*gain_sets.LAWS, *gain_sets.STUDY_ALIASES):
                gains = "default"
            return self._bound(law, {}) if law in self.laws else gain_sets.law(self.plant(plant), law, gains)
        values = {**of_set.get("", {}).get(law, {}), **of_set.get(plant, {}).get(law, {})}
        made = self._bound(law, values)
        known = {} if law in self.laws else find("law", law, laws_known()).gains
        lacking = [f"{gain} = {one.default:g}" for gain, one in known.items() if not one.held and gain not in values]
        if lacking:
            raise ScenarioError(
                f"the gains {gains!r} of {law} lack some, whose defaults are not the paper's: write in [gains.{gains}] "
                f"what the paper has for {', '.join(lacking)}"
            )
        return made

    def _bound(self, law: str, gains: Mapping[str, float]) -> Component:
        """Return a law with these gains, and its defaults for the rest."""
        base, defaults = find("law", law, laws_known() | self.laws), {}
        if isinstance(base, Component):
            base, defaults = base.template or base, base.gains
        values = {**defaults, **gains}
        made = base.bind(values) if isinstance(base, Template) else dataclasses.replace(base, gains=values)
        return made.sourced(STUDY) if gains else made


def shipped() -> dict[str, Path]:
    """Return name -> folder of every paper that ships, in alphabetical order."""
    home = Path(str(importlib.import_module(SHIPPED_PACKAGE).__file__)).parent
    return {path.parent.name: path.parent for path in sorted(home.glob(f"*/{PAPER_FILE}"))}


class Home(NamedTuple):
    """Where a paper is: its folder, and the name under which the folder is imported."""

    folder: Path
    package: str


@functools.cache
def catalogue() -> Catalogue[Home]:
    """Return where every paper is that ships, or comes with another package, by name."""
    of_suite = {name: Home(folder, f"{SHIPPED_PACKAGE}.{name}") for name, folder in shipped().items()}
    return Catalogue(of_suite, added("smc_mujoco.papers", _of_package))


def _of_package(point: EntryPoint) -> Home:
    """Return where the paper is that an entry point of another package names."""
    spec = source(point)
    if not spec.submodule_search_locations:
        raise ScenarioError(f"{spec.origin} is no folder: give {KINDS[point.group][1]}")
    return Home(Path(next(iter(spec.submodule_search_locations))), point.module)


def paper(which: str | Path) -> Paper:
    """Return a paper by its name in `smc-mujoco papers`, or from its folder.

    Raises:
      ScenarioError: there is none, or something is wrong with one of its files, in one sentence.
    """
    known = catalogue()
    if isinstance(which, str) and which in known:
        return _known(known[which])
    folder = Path(which)
    if not os.path.isdir(folder):
        if isinstance(which, str) and not set("/\\.") & set(which):
            raise unknown("paper", which, known)
        raise ScenarioError(f"no folder {str(which)!r} with a {PAPER_FILE}: give one, or a name of {', '.join(known)}")
    return _read(folder, _package(folder))


@functools.cache
def _known(home: Home) -> Paper:
    return _read(home.folder, home.package)


def papers() -> dict[str, Paper]:
    """Return every paper that ships, or comes with another package, by its name, in alphabetical order."""
    known: dict[str, Paper] = {}
    for key, home in catalogue().items():
        try:
            known[key] = _known(home)
        except ScenarioError as error:
            if not (package := catalogue().package(key)):
                raise
            warn(f"package {package!r}: its paper {key!r}: {error}")
    return known


def new(folder: Path) -> list[Path]:
    """Copy the template, a paper that runs, to a folder, and return the files."""
    if os.path.exists(folder) and (not folder.is_dir() or any(folder.iterdir())):
        raise ScenarioError(f"{folder} is there already: give the name of a new folder")
    written = [folder / PAPER_FILE, folder / CODE_FILE]
    for file in written:
        with replacing(file) as part:
            part.write_text((Path(__file__).parent / "template" / file.name).read_text(encoding="utf-8"), "utf-8")
    return written


def _package(folder: Path) -> str:
    """Make a package of a user's folder, so that its modules can be imported, and return its name."""
    package = ModuleType("paper_" + re.sub(r"\W", "_", folder.resolve().name))
    package.__path__ = [str(folder.resolve())]
    for known in [module for module in sys.modules if module.partition(".")[0] == package.__name__]:
        del sys.modules[known]
    sys.modules[package.__name__] = package
    importlib.invalidate_caches()
    return package.__name__


def _read(folder: Path, package: str) -> Paper:
    """Return the paper in a folder, whose code is imported under a package's name."""
    cure = "make one with `smc-mujoco papers --new FOLDER`"
    with reading(folder / PAPER_FILE, "paper", cure) as file:
        text = file.read_text(encoding="utf-8")
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{folder / PAPER_FILE} is no TOML: {error}") from None
    code = _module(folder, package)
    try:
        return _checked(folder, data, code)
    except ScenarioError as error:
        raise ScenarioError(f"{folder / PAPER_FILE}: {error}") from None


def _module(folder: Path, package: str) -> ModuleType:
    """Return the module claims.py with a paper's functions."""
    if not (folder / CODE_FILE).is_file():
        raise ScenarioError(f"no {CODE_FILE} in {folder}: write one, with a function for each claim of {PAPER_FILE}")
    before, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # a user's folder stays as it is
    try:
        return importlib.import_module(f"{package}.claims")
    except ScenarioError as error:
        raise ScenarioError(f"{folder / CODE_FILE}: {error}") from None
    except SyntaxError as error:
        raise ScenarioError(f"{error.filename}, line {error.lineno}: {error.msg}") from None
    except (Exception, SystemExit) as error:  # whatever the user's module raises
        raise ScenarioError(f"{_place(error, folder)}: {_said(error)}") from None
    finally:
        sys.dont_write_bytecode = before


def _said(error: BaseException) -> str:
    """Return the class and the message of an exception, on one line."""
    return ", ".join(filter(None, (type(error).__name__, " ".join(str(error).split()))))


def _place(error: BaseException, folder: Path) -> str:
    """Return the file and line of a paper's folder at which an exception was raised."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if Path(f.filename).is_relative_to(folder.resolve())]
    return f"{frames[-1].filename}, line {frames[-1].lineno}" if frames else str(folder / CODE_FILE)


def failed(paper: Paper, entry: Entry, error: BaseException) -> ScenarioError:
    """Return the error for a claim whose function raised an exception."""
    called = f"function {inspect.unwrap(entry.evidence).__name__} of claim {entry.id}"
    if isinstance(error, ScenarioError):
        return ScenarioError(f"{paper.name}: {called}: {error}")
    return ScenarioError(f"{_place(error, paper.folder)}: {called} raised {_said(error)}")


def _checked(folder: Path, data: Mapping[str, Any], code: ModuleType) -> Paper:
    """Return the paper in a file's data."""
    known = (*TEXT_FIELDS, "sets", "quick_sets", "plants", "conditions", "gains", "allowed", "claim")
    for field in data:
        if field not in known:
            raise unknown("field", field, known)
    texts = {field: _text(_typed(field, data.get(field, ""), str, "a text")) for field in TEXT_FIELDS}
    for field in TEXT_FIELDS[:3]:
        if not texts[field].strip():
            raise ScenarioError(f"no {field}: write one, as in the template of `smc-mujoco papers --new FOLDER`")
    _one_of("read", texts["read"], READ_PARTS)
    parts: dict[str, Any] = {
        "fields": _fields("runs", texts.pop("runs")),
        "plants": {key: _plant(key, one, folder) for key, one in _table(data, "plants")},
        "conditions": {key: _condition(key, one) for key, one in _table(data, "conditions")},
        "laws": dict(_laws(code)),
    }
    sets = _sets(data)
    quick = _names("quick_sets", data.get("quick_sets", list(sets)[:1]))
    for one in quick:
        find("set of gains in quick_sets", one, sets)
    paper = Paper(
        name=folder.resolve().name, folder=folder, sets=sets, quick_sets=quick, allowed={}, claims={}, **texts, **parts
    )
    functions = {key: value for key, value in vars(code).items() if inspect.isfunction(value)}
    allowed = {law: _allowed(law, one, functions, paper) for law, one in _table(data, "allowed")}
    paper = dataclasses.replace(paper, allowed=allowed)
    claims = _typed("claim", data.get("claim", []), list, "tables, each under a line [[claim]]")
    if not claims:
        raise ScenarioError("no claims: write each under a line [[claim]]")
    entries: dict[str, Entry] = {}
    for number, one in enumerate(claims, 1):
        called = f"claim {one.get('id', f'number {number}') if isinstance(one, dict) else number}"
        try:
            entry = _entry(_typed("it", one, dict, "a table"), functions, paper)
        except ScenarioError as error:
            raise ScenarioError(f"{called}: {error}") from None
        if entry.id in entries:
            raise ScenarioError(f"{called} is there twice: give one another id")
        entries[entry.id] = entry
    return dataclasses.replace(paper, claims=entries)


def _entry(data: Mapping[str, Any], functions: Mapping[str, Callable], paper: Paper) -> Entry:
    """Return a claim from its table."""
    for field in data:
        find("field", field, CLAIM_FIELDS)
    for field in REQUIRED_FIELDS:
        if field not in data:
            what = "threshold" if field == "holds_if" else field
            raise ScenarioError(f"it has no {what}: write {field}, {CLAIM_FIELDS[field][1]}")
    values = {field: _text(_typed(field, value, *CLAIM_FIELDS[field])) for field, value in data.items()}
    values.setdefault("read", paper.read)
    names: dict[str, Any] = {field: _names(field, values.pop(field, [])) for field in ("plants", "laws", "conditions")}
    function = find(f"function of {CODE_FILE}", values.pop("function"), functions)
    condition = values.pop("holds_if")
    if not condition:
        raise ScenarioError(f"it has no threshold: write holds_if, {CLAIM_FIELDS['holds_if'][1]}")
    thresholds = () if isinstance(condition, str) else tuple(_thresholds(condition))
    texts: dict[str, Any] = {"measured": _text((inspect.getdoc(function) or "").partition("\n\n")[0]).rstrip(".")}
    fields = _fields("runs", values.pop("runs", ""))
    quantifier = find("quantifier", values.pop("quantifier", "named"), QUANTIFIERS)
    words = values.pop("words", condition if isinstance(condition, str) else ", ".join(map(str, thresholds)))
    entry = Entry(
        **texts | values | names,
        holds_if=words,
        quantifier=quantifier,
        evidence=function,
        thresholds=thresholds,
        fields=fields,
    )
    _check_names(entry, paper)
    _check_source(entry, paper)
    return entry


def _check_source(entry: Entry, paper: Paper) -> None:
    """Raise ScenarioError unless a claim says whose it is, from something that was read, and over which gains."""
    _one_of("whose", entry.whose, WHOSE)
    _one_of("read", entry.read, READ_PARTS)
    if entry.whose == DERIVED and not entry.how:
        raise ScenarioError("it is derived, and does not say how: write how, a text")
    if entry.whose != OURS and entry.read == "nothing":
        raise ScenarioError(f'nothing of the paper was read, and it is {entry.whose!r}: write whose = "ours"')
    if entry.over:
        _one_of("over", entry.over, GAIN_QUANTIFIERS)
        if not entry.laws or entry.laws[0] not in paper.allowed:
            law = entry.laws[0] if entry.laws else "LAW"
            raise ScenarioError(f"it is about {entry.over} gains, and there is no table [allowed.{law}]: write one")


def _allowed(law: str, data: object, functions: Mapping[str, Callable], paper: Paper) -> Allowed:
    """Return the gains that a paper allows for a law, from the table [allowed.LAW]."""
    table = dict(_typed(f"allowed.{law}", data, dict, "a table, as { k1 = [1.0, 9.0] }"))
    find("law in allowed", law, laws_known() | paper.laws)
    margins = table.pop("margins", None)
    if margins is not None:
        margins = find(f"function of {CODE_FILE} in allowed.{law}", margins, functions)
    bounds = {}
    for gain, ends in table.items():
        find(f"gain of {law} in allowed", gain, paper._bound(law, {}).gains)
        pair = [end for end in ends if isinstance(end, int | float)] if isinstance(ends, list) else []
        if len(pair) != 2 or not 0.0 < pair[0] < pair[1]:
            raise ScenarioError(f"allowed.{law}.{gain} is {shown(ends)}: write two positive numbers, the lower first")
        bounds[gain] = (float(pair[0]), float(pair[1]))
    return Allowed(bounds, margins)


def _one_of(field: str, value: str, known: Sequence[str]) -> None:
    """Raise ScenarioError for a text that is none of the known ones."""
    if value not in known:
        raise ScenarioError(f"{field} is {value!r}: write one of {', '.join(map(repr, known))}")


def _check_names(entry: Entry, paper: Paper) -> None:
    """Raise ScenarioError for a plant, law or condition that is not known, or gains that a law does not have."""
    for one in entry.plants:
        paper.plant(one)
    for one in entry.conditions:
        paper.condition(one)
    for law in entry.laws:
        find("law", law, laws_known() | paper.laws)
        for gains, of_set in paper.sets.items():
            for plant in entry.plants if of_set is not None else ():
                paper.law(plant, law, gains)


def _thresholds(conditions: Mapping[str, Any]) -> Iterator[Threshold]:
    """Yield the thresholds in a table: measure -> text, or {asked, sentence}."""
    for measure, threshold in conditions.items():
        if isinstance(threshold, dict):
            for field in threshold:
                find(f"field of the threshold of {measure!r}", field, dict.fromkeys(("asked", "sentence")))
            yield Threshold.read(measure, threshold.get("asked"), str(threshold.get("sentence", "")))
        else:
            yield Threshold.read(measure, threshold)


def _sets(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return set of gains -> plant -> law -> gains; None for a set of the suite."""
    tables = dict(_table(data, "gains"))
    for key in tables:
        if key in SUITE_SETS:
            raise ScenarioError(f"gains.{key} is a set of the suite: give yours another name, such as gains.paper")
    listed = _names("sets", data.get("sets", list(tables) or ["default"]))
    sets: dict[str, Any] = {}
    for key in listed or ["default"]:
        if key not in tables:
            find("set of gains in sets", key, dict.fromkeys((*tables, *SUITE_SETS)))
            sets[key] = None
            continue
        of_set: dict[str, dict[str, Any]] = {}
        for law_or_plant, values in _typed(f"gains.{key}", tables[key], dict, "a table").items():
            table = _typed(f"gains.{key}.{law_or_plant}", values, dict, "a table of gains")
            if table and all(isinstance(value, dict) for value in table.values()):
                of_set[law_or_plant] = table
            else:
                of_set.setdefault("", {})[law_or_plant] = table
        for law in {law for laws in of_set.values() for law in laws}:
            name(f"a law in gains.{key}", law)
        sets[key] = of_set
    return sets


def _plant(key: str, data: object, folder: Path) -> Plant:
    """Return a plant from its table: {plant, parameters...}, or {plant = "FILE.xml:joint+joint"}."""
    values = dict(_typed(f"plants.{key}", data, dict, 'a table, as { plant = "duffing", delta = 0.0 }'))
    base = values.pop("plant", None)
    if not isinstance(base, str):
        raise ScenarioError(f'plants.{key} names no plant: write it as {{ plant = "duffing", delta = 0.0 }}')
    try:
        return from_text(base, folder, **values)
    except ScenarioError as error:
        raise ScenarioError(f"plants.{key}: {error}") from None


def _condition(key: str, text: object) -> Condition:
    """Return a condition from its text, fields as in "actuator=Lag(0.01)"."""
    words = _typed(f"conditions.{key}", text, str, 'fields of a scenario, as "actuator=Lag(0.01)"')
    fields = _fields(f"conditions.{key}", words)
    return condition(key, **fields)


def _fields(what: str, text: str) -> dict[str, Any]:
    """Return fields of a scenario from a text, such as "duration=5.0, control_period=1e-4"."""
    try:
        fields = read_fields(text)
    except SyntaxError:
        raise ScenarioError(f'{what} is {shown(text)}: write fields of a scenario, as "duration=5.0"') from None
    except ScenarioError as error:
        raise ScenarioError(f"{what}: {error}") from None
    known = [field.name for field in dataclasses.fields(Scenario) if field.init and field.name not in ("plant", "law")]
    for field in fields:
        if field not in known:
            raise unknown(f"field of a scenario in {what}", field, known)
    return fields


def _laws(code: ModuleType) -> Iterator[tuple[str, Template | Component]]:
    """Yield name, law of every law in a paper's module; refuse one with the name of another law of the library."""
    for value in vars(code).values():
        if isinstance(value, Template | Component) and value.kind == "law":
            known = laws_known().get(value.name)
            if known and known.function is not value.function:
                raise ScenarioError(
                    f"law {value.name!r} of {CODE_FILE} has the name of a law of the library: rename it"
                )
            yield value.name, value


def _table(data: Mapping[str, Any], field: str) -> Iterator[tuple[str, Any]]:
    """Yield the items of a table of the file, which may be missing."""
    yield from _typed(field, data.get(field, {}), dict, f"a table, under a line [{field}]").items()


def _names(field: str, value: object) -> tuple[str, ...]:
    """Return a list of names."""
    items = _typed(field, value, list, 'a list of names, as ["duffing"]')
    for item in items:
        name(f"an item of {field}", item)
    return tuple(items)


def _typed(field: str, value: Any, kind: Any, cure: str) -> Any:
    """Return a value of this type, or raise ScenarioError naming the field."""
    if not isinstance(value, kind):
        raise ScenarioError(f"{field} is {shown(value)}: write {cure}")
    return value


def _text(value: Any) -> Any:
    """Return a text with single spaces, and any other value as it is."""
    return " ".join(value.split()) if isinstance(value, str) else value


def duration_of(paper: Paper, entry: Entry | None, changes: Mapping[str, Any]) -> float:
    """Return the duration of a run, s: as changed, or the claim's, the paper's, or else 10 s."""
    return {"duration": DURATION, **paper.fields, **(entry.fields if entry else {}), **changes}["duration"]
