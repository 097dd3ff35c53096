"""Gains of the laws that the study compares, on its five plants, in sets.

    law("duffing", "classical")                # as tuned by the rule of `tuning`, variation of u priced
    law("duffing", "classical", "study")       # as first chosen

- study: a first tuning of all laws to the same bound |u| <= 6, kept whatever the results.
- tuned, tracking: what `tuning` finds with 256 evaluations from seed 0, with a price on the variation of u and without.
  They are the files in `tuned_gains/`, whole with history and versions; `make gains` makes them anew.
- default: the law's own.
"""

import dataclasses
import functools
from collections.abc import Mapping
from pathlib import Path

from smc_mujoco.component import Component
from smc_mujoco.errors import ScenarioError, find, shown
from smc_mujoco.files import read_json
from smc_mujoco.law import law as find_law
from smc_mujoco.plant import catalogue

SETS = ("study", "tuned", "tracking")
OBJECTIVES = {"tuned": "balanced", "tracking": "tracking"}  # set -> objective of its tuning
LAWS = ("observer_free", "classical", "boundary_layer", "adaptive", "super_twisting", "conditioned_super_twisting")

# Forms of a law take the gains of the law itself, as far as they have them.
FORMS = {"super_twisting_unclamped": "super_twisting"}
SAME = {"conditioned_super_twisting": "super_twisting"} | FORMS  # in the first set

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


def law(plant: str, name: str, gains: str = "tuned") -> Component:
    """The law with its gains for a plant, from a set. No warning tells of conditions that they miss: they are as found.

    Raises:
      ScenarioError: an unknown set, or one that has no gains for this law on this plant.
    """
    base = find_law(name)
    sets = {"study": _study, "tuned": _found, "tracking": _found, "default": lambda plant, name, gains: base.gains}
    found = find("set of gains", gains, sets)(plant, name, gains)
    return dataclasses.replace(base, gains={gain: found.get(gain, value) for gain, value in base.gains.items()})


def paper_plant(plant: object) -> str:
    """The name of one of the paper's plants, which have conditions and gains; ScenarioError for any other plant."""
    if isinstance(plant, str) and (plant in STUDY or plant not in catalogue()):
        find("plant of the paper's study", plant, STUDY)
        return plant
    raise ScenarioError(
        f"plant is {shown(plant)}, and the paper's plants, which have conditions and gains, are {', '.join(STUDY)}: "
        "give one of these, or smc.study scenarios of your own"
    )


def file(plant: str, name: str, objective: str) -> Path:
    """Where the tuning of a law on a plant for an objective is kept."""
    return Path(__file__).parent / "tuned_gains" / objective / f"{plant}-{name}.json"


def _study(plant: str, name: str, gains: str) -> Mapping[str, float]:
    laws = STUDY[paper_plant(plant)]
    return find("law of the paper's study", SAME.get(name, name), laws)


@functools.cache
def _found(plant: str, name: str, gains: str) -> Mapping[str, float]:
    path = file(plant, FORMS.get(name, name), OBJECTIVES[gains])
    if not path.is_file():
        cure = f"give the law with gains of its own (smc-mujoco tune {plant} {name} finds them), or take default ones"
        raise ScenarioError(f"no gains in set {gains!r} for {name} on {plant}: {cure} (--gains default)")
    return read_json(path)["scenario"]["law"]["gains"]
