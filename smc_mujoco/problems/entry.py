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

Divisions differ in where gains may come from, see DIVISIONS. A law is a program: read it before you
run it.
"""

import dataclasses
import hashlib
import os
import tomllib
from collections.abc import Mapping
from pathlib import Path

from smc_mujoco.common.aliases import AnyPath, Data, Fields, Names, Numbers
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, find, number, shown
from smc_mujoco.common.files import reading
from smc_mujoco.control import gain_sets
from smc_mujoco.control.from_text import law as law_of
from smc_mujoco.control.law import Law, all_laws
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.mechanisms.plant import plants

ABOUT = "entry.toml"
FILES = ("law.py", "law.c", "law.fmu")
TEXTS = ("name", "source", "licence", "division")
DIVISIONS = {
    "one set": "one set of gains, [gains.all], for all plants",
    "search": "a set for each plant, found by the search of this project (smc-mujoco tune)",
    "free": "a set for each plant, found in any way",
}
EVERYWHERE = "all"  # the set of gains of the division "one set"


@keyword_dataclass
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
    authors: Names
    source: str
    licence: str
    division: str
    gains: Mapping[str, Numbers]
    file: Path | None
    digest: str

    def law(self, plant: str) -> Law | str:
        """Return the law with its gains for a plant, or the name of a law of the library.

        This runs its file's code.
        """
        if self.file is None:
            return self.name
        gains = self.gains.get(EVERYWHERE, self.gains.get(plant, {}))
        return law_of(str(self.file), **gains).named(self.name)  # pyright: ignore[reportArgumentType]

    @property
    def about(self) -> Fields:
        """The entry as plain data, for its result."""
        fields = dataclasses.asdict(self)
        del fields["file"]
        return fields


def read_entry(folder: AnyPath) -> Entry:
    """Return the entry in a folder, without running its code; or that of a law of the library.

    Raises:
      ScenarioError: no or several laws, a missing or wrong line of entry.toml, or gains for a
        single problem.
    """
    if folder in all_laws() and not os.path.isdir(folder):
        return _of_library(str(folder))
    folder = Path(folder)
    laws = []
    for name in FILES:
        if (folder / name).is_file():
            laws.append(folder / name)
    if len(laws) != 1:
        names = " and ".join(path.name for path in laws) or "none of them"
        raise ScenarioError(f"entry {str(folder)!r} has {names}: give one of {', '.join(FILES)}")
    with reading(
        folder / ABOUT, "description of an entry", f"write {', '.join(TEXTS)} and authors in it"
    ) as file:
        text = file.read_bytes()
        try:
            about = tomllib.loads(text.decode("utf-8-sig"))
        except tomllib.TOMLDecodeError as error:
            raise ScenarioError(f"it is not TOML: {error}") from None
        fields = _fields(about)
    with reading(laws[0], "law", "give a file of at most 100 MB") as file:
        code = file.read_bytes()
    return Entry(**fields, file=laws[0], digest=hashlib.sha256(text + code).hexdigest())


def _of_library(name: str) -> Entry:
    """Return the entry of a law of the library.

    It has shipped gains, which the search found, or else its defaults.
    """
    machines = map(find_plant, plants())
    shipped = any(gain_sets.in_set(machine, name, "tuned") for machine in machines)
    return Entry(
        name=name,
        authors=("the authors of smc_mujoco",),
        source=f"smc_mujoco, law {name}",
        licence="Apache-2.0",
        division="search" if shipped else "one set",
        gains={},
        file=None,
        digest=hashlib.sha256(name.encode()).hexdigest(),
    )


def _fields(about: Data) -> Fields:
    """Return the fields of an Entry that a file about it gives."""
    for name in about:
        find("line of entry.toml", name, dict.fromkeys((*TEXTS, "authors", "gains")))
    fields: Fields = {}
    for name in TEXTS:
        fields[name] = _text(name, about.get(name))
    find("division", fields["division"], DIVISIONS)
    authors = about.get("authors")
    if not isinstance(authors, list) or not authors:
        raise ScenarioError(f'authors is {shown(authors)}: give names, as authors = ["A. Author"]')
    fields["authors"] = tuple(_text("authors", author) for author in authors)
    fields["gains"] = _gains(about.get("gains", {}), fields["division"])
    return fields


def _text(name: str, value: object) -> str:
    """Return a text of entry.toml."""
    if not isinstance(value, str) or not value.strip() or not value.isprintable():
        raise ScenarioError(f'{name} is {shown(value)}: give a text, as {name} = "..."')
    return value.strip()


def _gains(sets: object, division: str) -> Mapping[str, Numbers]:
    """Return plant -> gain -> value, as a division allows them."""
    if division == "one set":
        allowed = (EVERYWHERE,)
    else:
        allowed = plants()
    cure = f"the division {division!r} takes {DIVISIONS[division]}, so write [gains.{allowed[0]}]"
    if not isinstance(sets, dict):
        raise ScenarioError(f"gains is {shown(sets)}: {cure}")
    gains = {}
    for plant, values in sets.items():
        if plant not in allowed or not isinstance(values, dict):
            raise ScenarioError(f"gains for {shown(plant)}: {cure}")
        numbers = {}
        for name, value in values.items():
            numbers[name] = number(f"gain {name}", value)
        gains[plant] = numbers
    return gains
