"""Gains of the laws that the study compares, on its five plants, in sets.

    law("duffing", "classical")                # as tuned by the rule of `tuning`, variation of u priced
    law("duffing", "classical", "study")       # as first chosen

- study: a first tuning of the paper's laws to the same bound |u| <= 6, kept whatever the results.
- tuned: what `tuning` finds for every general law with 96 evaluations, with a price on the variation of u. The laws of
  LAWS are tuned from three seeds, all others from one, so that the spread of tuning shows in their results. Three
  tunings are three samples of it, however many runs take them in turn.
- tracking: the same for the laws of LAWS, from one seed and without that price.
- default: the law's own.

The files of `tuned_gains/` hold each tuning whole, with history and versions; `make gains` makes them again.
"""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from pathlib import Path

from smc_mujoco.common.errors import ScenarioError, find, shown
from smc_mujoco.common.files import read_json
from smc_mujoco.control.component import Component
from smc_mujoco.control.law import catalogue
from smc_mujoco.control.law import law as find_law
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.plant import catalogue as plants_known
from smc_mujoco.mechanisms.plant import plant as find_plant

SETS = ("study", "tuned", "tracking")
OBJECTIVES = {"tuned": "balanced", "tracking": "tracking"}  # set -> objective of its tuning
# What the report's first page compares: the four laws of the paper, the two that its first study added, and the first
# law of each other family in the order of README's table, which was there before any of them was tuned.
LAWS = (
    "observer_free", "classical", "boundary_layer", "adaptive", "super_twisting", "conditioned_super_twisting",
    "implicit_first_order", "twisting", "terminal", "extended_state", "pid",
)  # fmt: skip
SEEDS = {"tuned": 3, "tracking": 1}  # set -> from how many seeds the laws of LAWS are tuned

# The same law computed otherwise, or under the name of its published form: it takes the gains of the law itself.
FORMS = {f"observer_free_{form}": "observer_free" for form in ("q15", "single", "table", "taylor")}
FORMS["super_twisting_unclamped"] = "super_twisting"
SAME = FORMS | {"conditioned_super_twisting": "super_twisting"}  # in the first set, whose gains it was not given

# The first set: plant -> law -> gains. Super-twisting's were found with its integral held within u_max, and are run so.
STUDY: dict[str, dict[str, dict[str, float]]] = {
    "inverted_pendulum": {
        "observer_free": {"lam": 4.364, "k1": 9.708},
        "classical": {"k": 1.945, "c": 12.0},
        "boundary_layer": {"k": 6.0, "c": 9.06, "phi": 2.096},
        "adaptive": {"gamma": 104.7, "c": 12.0, "k0": 0.0},
        "adaptive_leak": {"gamma": 20.31, "c": 12.0, "leak": 8.865, "deadzone": 0.2114, "k0": 0.0},
        "super_twisting": {"k1": 2.489, "k2": 16.92, "c": 10.04, "w_max": 6.0},
    },
    "van_der_pol": {
        "observer_free": {"lam": 6.0, "k1": 1.976},
        "classical": {"k": 6.0, "c": 2.849},
        "boundary_layer": {"k": 5.763, "c": 2.768, "phi": 0.01578},
        "adaptive": {"gamma": 66.11, "c": 2.853, "k0": 0.0},
        "adaptive_leak": {"gamma": 7.738, "c": 2.821, "leak": 0.9379, "deadzone": 0.03367, "k0": 0.0},
        "super_twisting": {"k1": 4.567, "k2": 45.47, "c": 2.16, "w_max": 6.0},
    },
    "duffing": {
        "observer_free": {"lam": 6.0, "k1": 3.076},
        "classical": {"k": 3.91, "c": 3.576},
        "boundary_layer": {"k": 6.0, "c": 3.975, "phi": 0.5429},
        "adaptive": {"gamma": 600.0, "c": 4.371, "k0": 0.0},
        "adaptive_leak": {"gamma": 13.87, "c": 4.256, "leak": 2.979, "deadzone": 0.009447, "k0": 0.0},
        "super_twisting": {"k1": 8.073, "k2": 0.3443, "c": 4.061, "w_max": 6.0},
    },
    "pendulum_network": {
        "observer_free": {"lam": 2.922, "k1": 6.19},
        "classical": {"k": 0.9747, "c": 5.944},
        "boundary_layer": {"k": 6.0, "c": 6.705, "phi": 2.577},
        "adaptive": {"gamma": 1.294, "c": 6.718, "k0": 0.0},
        "adaptive_leak": {"gamma": 24.32, "c": 9.468, "leak": 9.259, "deadzone": 0.3184, "k0": 0.0},
        "super_twisting": {"k1": 1.87, "k2": 1.145, "c": 6.256, "w_max": 6.0},
    },
    "inverted_pendulum_network": {
        "observer_free": {"lam": 3.961, "k1": 9.362},
        "classical": {"k": 1.73, "c": 11.11},
        "boundary_layer": {"k": 6.0, "c": 8.705, "phi": 2.328},
        "adaptive": {"gamma": 2.189, "c": 9.408, "k0": 0.0},
        "adaptive_leak": {"gamma": 28.47, "c": 11.36, "leak": 11.46, "deadzone": 0.153, "k0": 0.0},
        "super_twisting": {"k1": 1.95, "k2": 1.057, "c": 9.086, "w_max": 6.0},
    },
}


def law(plant: str | Plant, name: str, gains: str = "tuned", seed: int = 0) -> Component:
    """Return the law with its gains for a plant, from a set. It warns of no condition that these gains miss.

    Args:
      seed: of a run; run s takes the gains from tuning seed s modulo the number of seeds that the law was tuned from.

    Raises:
      ScenarioError: an unknown set, or one that has no gains for this law on this plant.
    """
    base = find_law(name)
    find("set of gains", gains, dict.fromkeys((*SETS, "default")))
    if gains == "default":
        return base
    machine = find_plant(plant) if isinstance(plant, str) else plant
    tuned = FORMS.get(name, name)
    found = _study(machine.name, name) if gains == "study" else _found(machine, tuned, gains, seed)
    return dataclasses.replace(base, gains={gain: found.get(gain, value) for gain, value in base.gains.items()})


def general() -> tuple[str, ...]:
    """List every law that can be a rival on some plant: those of LAWS, then all others by name."""
    others = {name for name, each in catalogue().items() if not each.plants} - {"none", *FORMS, *LAWS}
    return *LAWS, *sorted(others)


def general_laws(plants: Sequence[str | Plant], gains: str) -> list[str]:
    """List the general laws that have gains in a set on each of these plants, those of LAWS first.

    Raises:
      ScenarioError: an unknown set, or one without gains for any law on these plants.
    """
    found, why = [], None
    for name in general():
        try:
            for plant in plants:
                law(plant, name, gains)
        except ScenarioError as error:
            why = error
        else:
            found.append(name)
    if not found and why:
        raise why
    return found


def tunings(gains: str, name: str) -> int:
    """Return from how many seeds a law was tuned for a set."""
    return SEEDS[gains] if name in LAWS else 1


def paper_plant(plant: object) -> str:
    """Return the name of one of the paper's plants, which have gains; ScenarioError for any other plant."""
    if isinstance(plant, str) and (plant in STUDY or plant not in plants_known()):
        find("plant of the paper's study", plant, STUDY)
        return plant
    raise ScenarioError(
        f"plant is {shown(plant)}, and the paper's plants, which have conditions and gains, are {', '.join(STUDY)}: "
        "give one of these, or smc.study scenarios of your own"
    )


def file(plant: str, name: str, objective: str, seed: int = 0) -> Path:
    """Return where the tuning of a law on a plant for an objective from a seed is kept."""
    ending = f"-{seed}" if seed else ""
    return Path(__file__).parent / "tuned_gains" / objective / f"{plant}-{name}{ending}.json"


def _study(plant: str, name: str) -> Mapping[str, float]:
    laws = STUDY[paper_plant(plant)]
    return find("law of the paper's study", SAME.get(name, name), laws)


def _found(plant: Plant, name: str, gains: str, seed: int) -> Mapping[str, float]:
    path = file(plant.name, name, OBJECTIVES[gains], seed % tunings(gains, name))
    if not path.is_file():
        raise ScenarioError(f"no gains in set {gains!r} for {name} on {plant.name}: {_cure(plant, name)}")
    return _read(path)


def _cure(plant: Plant, name: str) -> str:
    """Return what to do about a law that a set has no gains for on a plant."""
    example = next(iter(find_law(name).gains), "k")
    own = f"give the law with gains of its own, as {name}({example}=...)"
    if not plant.unscaled:
        own += f", or as the FILE.json that smc-mujoco tune {plant.argument} {name} --out FILE.json writes"
    return f"{own}, or take default ones (--gains default)"


@functools.cache
def _read(path: Path) -> Mapping[str, float]:
    return read_json(path)["scenario"]["law"]["gains"]
