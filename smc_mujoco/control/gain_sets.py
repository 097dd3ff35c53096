"""Sets of gains for the laws that the study compares, on its five plants.

    law("duffing", "classical")           # by the rule of `tuning`, with a cost of u's variation
    law("duffing", "classical", "study")  # as first chosen

- study: a first tuning of the paper's laws to the same bound |u| <= 6. It is never changed in the
  light of results.
- tuned: the gains that independent searches by `tuning` found, for every general law, with a cost
  of the variation of u. The runs of a study use their sets in turn, run i that of search i, so that
  gains are part of the sample. The laws of COMPARED and `hodob` have twelve searches, all others
  three, too few for a verdict.
- tracking: the same for the laws of LAWS, of three searches, without that cost.
- default: the default gains of the law.

`tuned_gains/` has a file for each set. `make gains` computes them again, except the set "study".
"""

import dataclasses
import functools
import inspect
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

from smc_mujoco.common.aliases import Data, Floats, Names, Numbers
from smc_mujoco.common.constraints import OneOf, constrained
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, find, shown
from smc_mujoco.common.files import read_json
from smc_mujoco.control import source
from smc_mujoco.control.component import Component, gains_text
from smc_mujoco.control.law import law_catalogue
from smc_mujoco.control.law import library_law as find_law
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.plant import plant_catalogue as plants_known

SETS = ("study", "tuned", "tracking")
KNOWN_SETS: Mapping[str, None] = dict.fromkeys((*SETS, "default"))
NameOfSet = Annotated[str, OneOf(names=(*KNOWN_SETS,))]
OBJECTIVES = {"tuned": "balanced", "tracking": "tracking"}  # set -> objective of its tuning
# The usual laws, which are compared where none are named: the four of the
# paper, two more of its first study, and the first law of each other family in the table of
# docs/catalogue.md, which was written before any tuning; then laws without a sliding mode that want
# to win, written for that after the others were tuned.
LAWS = (
    "observer_free",
    "classical",
    "boundary_layer",
    "adaptive",
    "super_twisting",
    "conditioned_super_twisting",
    "implicit_first_order",
    "twisting",
    "terminal",
    "extended_state",
    "pid",
)
RIVALS = ("adrc", "pd_observer", "lqi", "mpc", "loop_shaping")
COMPARED = (*LAWS, *RIVALS)

# Other implementation or name of a law -> the law whose gains it uses.
ALIASES = {
    f"observer_free_{form}": "observer_free" for form in ("q15", "single", "table", "taylor")
}
ALIASES["super_twisting_unclamped"] = "super_twisting"
ALIASES["proper_conditioned_super_twisting"] = (
    "proper_super_twisting"  # the same law while u is not saturated
)
STUDY_ALIASES = ALIASES | {"conditioned_super_twisting": "super_twisting"}  # in the set "study"


def file_of(gains: str) -> Path:
    """Return the path of a set's file."""
    return Path(__file__).parent / "tuned_gains" / f"{gains}.json"


# The set "study": plant -> law -> gains. Super-twisting was tuned with w_max = u_max, and runs with
# it.
STUDY: dict[str, dict[str, dict[str, float]]] = read_json(file_of("study"))


@constrained
def law_with_gains(
    plant: str | Plant, name: str, gains: NameOfSet = "tuned", seed: int | None = None
) -> Component:
    """Return the law with its gains for a plant, from a set, without warnings of conditions that
    they violate.

    With a seed, the gains are those of search `seed` modulo their number; without, those of the
    least J of all.
    """
    base = find_law(name)
    if gains == "default":
        return base
    plant = as_plant(plant)
    if gains == "study":
        of_plant = STUDY[paper_plant(plant.name)]
        search = None
        values = find("law of the paper's study", STUDY_ALIASES.get(name, name), of_plant)
    else:
        shipped = tuned(plant, name, gains)
        if seed is None:
            values = shipped.best
        else:
            values = shipped.sets[seed % len(shipped.sets)]
        search = shipped.search
    replaced = {}
    for gain, value in base.gains.items():
        replaced[gain] = values.get(gain, value)
    law = dataclasses.replace(base, gains=replaced)
    return law.sourced(source.SHIPPED if search else source.STUDY, search)


def default_gains_warning(plant: Plant, law: Component) -> str:
    """Return a sentence on a law that was given by its name, and has no gains for a run."""
    return (
        f"law {law.name!r} runs on {plant.name} with its default gains, {gains_text(law.gains)}, "
        f"as none are shipped for such a run: tune it with smc.tune(plant, {law.name!r}), or give "
        f"smc.law({law.name!r}) to say that you want the defaults"
    )


def other_parameters_warning(plant: Plant, gains: str = "tuned") -> str:
    """Return a sentence on a plant that has not the parameters for which gains were tuned, or
    "".
    """
    standard = plants_known().get(plant.name)
    if standard is None or plant.parameters == standard.parameters:
        return ""
    changed = []
    for name, value in plant.parameters.items():
        if value != standard.parameters[name]:
            changed.append(f"{name} = {value:g}")
    return (
        f"gains of set {gains!r} were tuned for {plant.name} with its default parameters, and "
        f"this one has {', '.join(changed)}: tune the law on it, or give the law's gains yourself"
    )


def general() -> Names:
    """List every law that can be compared on some plant: those of COMPARED, then all others by
    name.
    """
    left_out = {"none", *ALIASES, *COMPARED}
    further = []
    for name, template in law_catalogue().items():
        if not template.plants and name not in left_out:
            further.append(name)
    return *COMPARED, *sorted(further)


@constrained
def general_laws(plants: Sequence[str | Plant], gains: NameOfSet) -> list[str]:
    """List the general laws that have gains in a set on each of these plants, those of COMPARED
    first.
    """
    named = list(map(as_plant, plants))
    names = list(general())
    for plant in named:
        names = [name for name in names if in_set(plant, name, gains)]
    if names:
        return names
    together = ", ".join(plant.name for plant in named)
    raise ScenarioError(
        f"gains is {gains!r}, and no general law has such gains on {together}: give 'default'"
    )


def in_set(plant: Plant, name: str, gains: str) -> bool:
    """Return whether a set of gains has some for a law on a plant."""
    try:
        law_with_gains(plant, name, gains)
    except ScenarioError:
        return False
    return True


@keyword_dataclass
class TunedGains:
    """The gains of a law on a plant, and the searches that found them."""

    sets: tuple[Numbers, ...]  # each name -> value; of each search, in order
    # J of each, s^2, see `analysis.tuning.objective`; each search has its own runs
    objectives: Floats
    evaluations: int  # number of sets of gains that the searches evaluated
    seed: int
    rule: str  # the search, in words

    @property
    def objective(self) -> float:
        """The least J of a search, s^2."""
        return min(self.objectives)

    @property
    def best(self) -> Numbers:
        """The gains with the least J."""
        return self.sets[self.objectives.index(self.objective)]

    @property
    def search(self) -> source.GainSearch:
        """The searches: their rule, number and evaluations, and how far their J differ."""
        spread = max(self.objectives) / self.objective - 1.0
        count = len(self.sets)
        return source.GainSearch(
            rule=self.rule, evaluations=self.evaluations, searches=count, spread=spread
        )


def tuned(plant: str | Plant, name: str, gains: str = "tuned") -> TunedGains:
    """Return the gains of a law on a plant from a tuned set, and the search behind them."""
    find("set of tuned gains", gains, OBJECTIVES)
    plant = as_plant(plant)
    name = ALIASES.get(name, name)
    if (stored := _stored(plant.name, name, gains)) is not None:
        return stored
    find_law(name)  # raises if there is none
    raise ScenarioError(
        f"no gains in set {gains!r} for {name} on {plant.name}: give the law's gains yourself, "
        "tune them (smc-mujoco tune), or take the defaults (--gains default; in Python "
        f"smc.law({name!r}))"
    )


def paper_plant(plant: object) -> str:
    """Return the plant if it is the name of one of the paper's plants. Raise ScenarioError
    otherwise.
    """
    if isinstance(plant, str) and (plant in STUDY or plant not in plants_known()):
        find("plant of the paper's study", plant, STUDY)
        return plant
    raise ScenarioError(
        f"plant is {shown(plant)}, and the paper's study has conditions and gains only for "
        f"{', '.join(STUDY)}: give one of these, or give smc.study your own scenarios"
    )


def _stored(plant: str, name: str, gains: str) -> TunedGains | None:
    """Return a law's gains on a plant, from this package or that of the law or the plant; None if
    there are none.

    Other packages have files that `smc.tune` wrote, tuned_gains/SET/PLANT-LAW.json beside their
    code.
    """
    if (stored := _package_gains(gains).get((plant, name))) is not None:
        return stored
    files = []
    if law_catalogue().package(name) and (template := law_catalogue().get(name)):
        files.append(Path(inspect.getfile(template.function)))
    if plants_known().package(plant) and (known_plant := plants_known().get(plant)):
        files.append(known_plant.file)
    for folder in (file.parent for file in files):
        if (path := folder / "tuned_gains" / gains / f"{plant}-{name}.json").is_file():
            record = read_json(path)["record"]
            return _from_record(record, record["rule"])
    return None


@functools.cache
def _package_gains(gains: str) -> dict[tuple[str, str], TunedGains]:
    """Return the gains of a set in this package, by plant and law."""
    data = read_json(file_of(gains))
    gains_of = {}
    for plant, laws in data["plants"].items():
        for name, record in laws.items():
            gains_of[plant, name] = _from_record(record, record.get("rule", data["rule"]))
    return gains_of


def _from_record(record: Data, rule: str) -> TunedGains:
    """Return the gains that `Tuned.record` described."""
    return TunedGains(
        sets=tuple(dict(zip(record["gains"], values, strict=True)) for values in record["sets"]),
        objectives=tuple(record["objectives"]),
        evaluations=record["evaluations"],
        seed=record["seed"],
        rule=rule,
    )
