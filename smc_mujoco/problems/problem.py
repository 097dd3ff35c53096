"""Problems: a plant under a condition, by name, whose instances everybody draws alike.

    problem = smc.problem("duffing/noise@1")
    traces = smc.run(problem.scenarios("super_twisting"))
    print([problem.measures(trace) for trace in traces])

An ID is plant/condition@version. The version's rules, `rules/VERSION.toml`, have the duration, the
bound on u, the ranges and the order of the draws, and the targets. Instances are drawn from the ID
and a seed; those of the seed 0 are the visible ones.
"""

import dataclasses
import functools
import hashlib
import math
import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from smc_mujoco.common.aliases import Array, Data, Floats, Names, Numbers
from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, find, items_of, shown, whole
from smc_mujoco.control import gain_sets
from smc_mujoco.control.component import Template
from smc_mujoco.control.law import Law, all_laws
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.metrics import conventions
from smc_mujoco.metrics.catalogue import ITAE, TV
from smc_mujoco.metrics.fold import first_sample
from smc_mujoco.robustness.uncertainty import Uncertainty
from smc_mujoco.robustness.worst_case import worst_case
from smc_mujoco.simulation.grid import Starts, case
from smc_mujoco.simulation.model import mixer
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

RULES = Path(__file__).parent / "rules"
ID = re.compile(r"(\w+)/(\w+)@(\d+)")
MAX_SEED = 2**256 - 1
DRAWS = 8  # of an instance, see the rules
STEP = 4096  # of the generator's counter from one instance to the next
MAX_INSTANCE = 10**9  # chosen
MEASURES = "accuracy", "settling", "calm"  # that have targets
SIZES = "sigma", "amplitude", "x", "y", "z", "w20"  # fields of a disturbance that scale it


@keyword_dataclass
class Instance:
    """What distinguishes an instance of a problem from the others: a side and factors, see the
    rules.
    """

    side: float
    start: float
    mass: float
    disturbance: float
    seed: int


@keyword_dataclass
class Problem:
    """A problem. It is made by `problem`.

    Attributes:
      id: its name, such as "duffing/noise@1".
      plant, condition, version: the three parts of the name.
      rules: the text of the version's rules.
    """

    id: str
    plant: str
    condition: str
    version: int
    rules: str

    @cached_property
    def _values(self) -> Data:
        """The rules' values for the plant and the condition."""
        rules_of_version = rules(self.version)
        special = rules_of_version.get("special", {}).get(self.plant, {})
        of_plant = rules_of_version["more"].get(self.plant, {}) | special
        return rules_of_version | of_plant | (rules_of_version["worst"] if self._attacked else {})

    @property
    def _attacked(self) -> bool:
        """Whether an adversary chooses the runs of each law."""
        return self.condition in _attacks(self.version)

    @cached_property
    def _frozen(self) -> Data:
        """The levels of each measure, and the oracle's numbers; {} before they are frozen."""
        return rules(self.version).get("targets", {}).get(f"{self.plant}/{self.condition}", {})

    @property
    def u_max(self) -> float | None:
        """Bound on |u|, N or N m; None: what the plant's actuators give."""
        return self._values.get("u_max")

    @property
    def duration(self) -> float:
        """Length of every run, s."""
        return self._values["duration"]

    @property
    def visible(self) -> int:
        """Number of visible instances."""
        return self._values["visible"]

    @property
    def budget(self) -> int:
        """How many runs an instance takes: 1, or those of the adversary's search."""
        return self._values["budget"] if self._attacked else 1

    @property
    def targets(self) -> dict[str, Floats]:
        """Measure -> the levels that laws are to reach, the hardest first."""
        levels = {}
        if self._frozen:
            for name in MEASURES:
                levels[name] = tuple(self._frozen[name])
        return levels

    def __repr__(self) -> str:
        return f"Problem({self.id!r})"

    def instance(self, index: int, seed: int = 0) -> Instance:
        """Return what an instance has drawn; `seed` as in `scenarios`."""
        seed = whole("the seed of the instances", seed, 0, MAX_SEED)
        number = f"{seed:064x}" if seed else ""  # NUMBER of the rules
        key = int.from_bytes(hashlib.sha256(f"{self.id}{number}".encode()).digest()[:16])
        index = whole("an instance", index, 0, MAX_INSTANCE)
        words = np.random.Philox(key=key, counter=STEP * index).random_raw(DRAWS).tolist()
        u = [(word >> 11) * 2.0**-53 for word in words]
        factors = {}
        for i, name in enumerate(("start", "mass", "disturbance"), 1):
            low, high = self._values[name]
            factors[name] = low + (high - low) * u[i]
        return Instance(side=-1.0 if u[0] < 0.5 else 1.0, **factors, seed=words[4] % 2**52)

    def scenarios(
        self,
        law: str | Law | Template,
        instances: str | Iterable[int] = "visible",
        seed: int = 0,
    ) -> tuple[Scenario, ...]:
        """Return the scenarios of a law, one for each instance.

        Args:
          law: a name, which gets its best shipped gains for the plant if there are some, or a law
            with its own gains.
          instances: "visible", the first of the rules' number of them, or the instances themselves.
          seed: from which instances are drawn; 0: the visible ones.

        Raises:
          ScenarioError: instances or a seed that do not exist, or a law that the plant cannot have.
        """
        if isinstance(instances, str):
            find("kind of instances", instances, {"visible": None})
            instances = range(self.visible)
        base = self._base(law)
        cases = []
        for index in items_of("instances", instances):
            scenario = self._place(base, self.instance(index, seed))
            if self._attacked:
                scenario = self._worst(scenario)
            cases.append(scenario)
        return tuple(cases)

    def _base(self, law: str | Law | Template) -> Scenario:
        """Return the scenario before anything is drawn."""
        if isinstance(law, str) and law in all_laws():
            shipped = gain_sets.in_set(find_plant(self.plant), law, "tuned")
            law = gain_sets.law_with_gains(self.plant, law, "tuned" if shipped else "default")
        changes = {"u_max": self.u_max, "control_period": self._values["control_period"]}
        condition = self.condition
        if self._attacked:
            condition = "nominal"
        elif text := self._values.get("texts", {}).get(condition):
            condition = f"{condition}: {text}"
        return case(
            self.plant, law, condition, self.duration, starts=Starts(spread=0.0), changes=changes
        )

    def _place(self, base: Scenario, drawn: Instance) -> Scenario:
        """Return the scenario of an instance, before an adversary chooses its run."""
        plant = base.plant
        force = drawn.disturbance * self._values.get("scale", 1.0)
        mismatch = {}
        for name, value in base.mismatch.items():
            mismatch[name] = value * (force if name in plant.added else 1.0)
        mismatch["mass"] = drawn.mass * mismatch.pop("mass", mismatch.pop(plant.mass, 1.0))
        # a number is added to -0.0 without a change of a bit
        rest = plant.rest or (-0.0,) * plant.n
        x0 = []
        for place, origin in zip(base.resolved.x0, rest, strict=True):
            x0.append(origin + drawn.side * drawn.start * (place - origin))
        disturbance = [_scaled(signal, force) for signal in base.disturbance]
        scenario = dataclasses.replace(
            base, x0=x0, mismatch=mismatch, disturbance=disturbance, seed=drawn.seed
        )
        return scenario.named(self.condition)

    def _worst(self, scenario: Scenario) -> Scenario:
        """Return the worst run that an adversary finds for the scenario's law."""
        within = Uncertainty(**self._values["conditions"][self.condition])
        worst = worst_case(scenario, within=within, budget=self.budget, seed=scenario.seed)
        return worst.scenario.named(self.condition)

    def measures(self, trace: Trace) -> dict[str, float]:
        """Return the measures of a run, and the time from which each target is reached and kept, s
        (NaN for never).

        failed: 1 for a run that failed, whose other measures are infinite. accuracy, itae [s^2],
        settling [s] into 2 % and calm [1/s], the variation of u per second over its bound, are of
        the whole trace; "accuracy_1" is the time of the first target, the hardest. A level of calm
        counts from the time from which the easiest accuracy holds, because effort counts only where
        the error does.
        """
        if trace.failure is not None or trace.diverged_at is not None:
            values = dict.fromkeys(("accuracy", "itae", "settling", "calm"), math.inf)
            return {"failed": 1.0} | values | dict.fromkeys(self._names(), math.nan)
        groups = conventions.by_group(trace).values()
        relative = []
        for part in groups:
            relative.append(np.abs(conventions.error(part)) / conventions.scale(part))
        worst = np.max(list(map(conventions.row_max, relative)), axis=0)
        total = np.sum([error.sum(axis=1) for error in relative], axis=0)
        plant = trace.scenario.plant
        bounds = mixer(plant)[:, -1]
        if bounds.size:
            commands = trace.applied  # of the rotors
        else:
            bounds = np.array(trace.scenario.limits[: plant.driven])
            commands = trace.u
        variation = TV.channels(trace.t, commands[:, : len(bounds)]) / bounds
        last = float(worst[first_sample("late", trace.t) :].max())
        values = {
            "failed": 0.0,
            "accuracy": max(last, self._values["floor"]),
            "itae": float(ITAE.of(trace.t, total[:, None])),
            "settling": _within_from(trace, worst, conventions.SETTLING_BAND),
            "calm": float(variation.max() / self.duration),
        }
        return values | self._times(trace, worst, values)

    def _times(self, trace: Trace, worst: Array, values: Numbers) -> dict[str, float]:
        """Return the time of each target, by name."""
        reached = []
        for level in self.targets.get("accuracy", ()):
            reached.append(_within_from(trace, worst, level))
        times = dict(zip(self._names(), map(_or_never, reached), strict=False))
        counted = {
            "settling": _or_never(values["settling"]),
            "calm": _or_never(reached[-1]) if reached else math.nan,
        }
        for measure, time in counted.items():
            for i, level in enumerate(self.targets.get(measure, ()), 1):
                if values[measure] <= level:
                    times[f"{measure}_{i}"] = time
                else:
                    times[f"{measure}_{i}"] = math.nan
        return times

    def _names(self) -> list[str]:
        """List the names of the targets' times."""
        names = []
        for measure in MEASURES:
            for i in range(1, len(self.targets.get(measure, ())) + 1):
                names.append(f"{measure}_{i}")
        return names


def problem(name: str) -> Problem:
    """Return the problem of a name, such as "duffing/noise@1".

        smc.problem("duffing/noise@1")

    Returns:
      A `Problem`, for which any law can be run and scored.

    Raises:
      ScenarioError: a text that is no such name, or an unknown version, plant or condition.
    """
    if isinstance(name, str):
        parts = ID.fullmatch(name)
    else:
        parts = None
    if parts is None:
        raise ScenarioError(
            f"problem {shown(name)} is no plant/condition@version: write it as duffing/noise@1"
        )
    plant, condition, version = parts.groups()
    find("version of the rules", version, dict.fromkeys(versions()))
    rules_of_version = rules(int(version))
    conditions: dict[str, dict[str, None]] = {}
    for cell in cells(int(version)):
        of_plant, _, of_condition = cell.partition("/")
        conditions.setdefault(of_plant, {})[of_condition] = None
    find("plant of the problems", plant, conditions)
    find(f"condition of problems of {plant}", condition, conditions[plant])
    if f"{plant}/{condition}" in rules_of_version.get("frozen", {}).get("left_out", ()):
        raise ScenarioError(
            f"problem {name!r} is left out by rule, as a control forbids it: choose another"
        )
    return Problem(
        id=name, plant=plant, condition=condition, version=int(version), rules=_text(int(version))
    )


def cells(version: int) -> list[str]:
    """List every plant/condition of the rules, also those that are left out."""
    rules_of_version = rules(version)
    plants = rules_of_version.get("plants", [])
    usual: list[str] = rules_of_version.get("conditions", [])
    conditions = dict.fromkeys(plants, usual)
    for plant, fields in rules_of_version["more"].items():
        conditions[plant] = fields["conditions"]
    listed = []
    attacks = dict.fromkeys(plants, _attacks(version))
    for plant, of_plant in (*conditions.items(), *attacks.items()):
        for condition in of_plant:
            listed.append(f"{plant}/{condition}")
    return listed


def _attacks(version: int) -> Data:
    """Return the conditions in which an adversary chooses the runs of each law."""
    return rules(version).get("worst", {}).get("conditions", {})


def versions() -> Names:
    """List the versions of the rules."""
    return tuple(sorted((path.stem for path in RULES.glob("*.toml")), key=int))


@functools.cache
def _text(version: int) -> str:
    return (RULES / f"{version}.toml").read_text(encoding="utf-8")


@functools.cache
def rules(version: int) -> Data:
    """Return the rules of a version."""
    return tomllib.loads(_text(version))


def _scaled(signal: Any, factor: float) -> Any:
    """Return a disturbance times a factor."""
    sizes = {}
    for field in dataclasses.fields(signal):
        if field.name in SIZES:
            sizes[field.name] = factor * getattr(signal, field.name)
    return dataclasses.replace(signal, **sizes)


def _within_from(trace: Trace, error: Array, level: float) -> float:
    """Return the time from which an error, (K + 1,), is kept below a level, s; inf if that is in
    the last fifth.
    """
    time = conventions.last_exit(trace.t, error, level)
    if time <= trace.t[first_sample("late", trace.t)]:
        return time
    return math.inf


def _or_never(time: float) -> float:
    """Return a time, or NaN for infinity."""
    return time if time < math.inf else math.nan
