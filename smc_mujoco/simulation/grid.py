"""Grids: plants x laws x conditions x seeds, as scenarios that are compared on equal terms.

    scenarios = smc.grid(["duffing", arm], ["classical", my_law], ["noise", worn_gear], seeds=16)

Plants, laws and conditions are names in the suite, or the user's objects. A seed gives all laws and
conditions the same start. Seed 0 is x0 itself. Seed s starts channel i from

    x_i = x0_i (1 + spread z_i) + by z_i,    z_i uniform in [-1, 1], drawn from (s, i)

On a user's model x0 counts from the default goal.

A free body may rest anywhere, so that x0 is no scale. It starts at x_i = x0_i + (spread + by) z_i,
in m and rad, also from seed 0.

Seed s > 0 also moves each sinusoidal disturbance by a phase, uniform and drawn from s: runs of one
phase would be one number.

A run with contacts must start clear of its obstacles. There -|z_i| replaces z_i, which moves the
start inwards, and pendulums that may touch each other ("bobs") start in order from left to right.
"""

import dataclasses
import math
import os
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Annotated, NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Data, Fields, Floats
from smc_mujoco.common.constraints import Natural, SeedOf, constrained
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import (
    MAX_ITEMS,
    ScenarioError,
    ScenarioWarning,
    items_of,
    number,
    one_line,
    shown,
    users_stacklevel,
    warn_once,
    whole,
)
from smc_mujoco.common.frozen import frozen
from smc_mujoco.control import from_text
from smc_mujoco.control import gain_sets as sets
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.law import Law, all_laws, checked_name
from smc_mujoco.mechanisms.custom.clearance import raised
from smc_mujoco.mechanisms.custom.scales import beside_goal
from smc_mujoco.mechanisms.hardware.contact import kinds
from smc_mujoco.mechanisms.hardware.feedforward import Feedforward
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation.coerce import REST
from smc_mujoco.simulation.conditions import (
    CONTROL_PERIOD,
    DURATION,
    Condition,
    find_condition,
    find_conditions,
)
from smc_mujoco.simulation.force_bounds import U_MAX
from smc_mujoco.simulation.model import compile_model, initial_state, with_values
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Noise, Sine

LawOfSeed = Callable[[int], Law]  # seed -> the law of that run
MAX_REST_ACCELERATION = 1e-9  # rad/s^2 or m/s^2; chosen: rounding stays below
SPREAD = 0.2  # of x0, to either side; chosen
MAX_SPREAD = 2.0  # chosen; a larger one may be in percent
GRID_SEEDS = 2**52  # number of a grid's seeds; tuning takes larger ones
# beyond the channels, whose starts are drawn with their index
ERROR_STREAM = 2**31
PHASE_STREAM = ERROR_STREAM + 1
# where a plant starts at 0
START_CURE = "say where its runs begin, with starts=smc.starts(x0=0.5) or --x0 0.5"


@keyword_dataclass
class Starts:
    """Where runs begin, by seed. The fields are the arguments of `starts`."""

    x0: Floats | None = None
    spread: float = SPREAD
    by: float = 0.0

    def largest(self, scenario: Scenario) -> float:
        """Return the largest |x| of any channel at the middle of the starts, from the goal of a
        user's model, or `by` if all are 0, rad or m.

        Of a free body it is the largest distance from rest along an axis, m, from which a run may
        start.
        """
        plant = scenario.plant
        if plant.pose:
            middle = scenario.resolved.x0 if self.x0 is None else self.x0
            far = _farthest(middle[:3], plant.rest[:3])
            return far + self.spread + self.by
        middle = self.place(scenario, 0).resolved.x0
        return _farthest(middle, plant.origin) or self.by

    def check_condition(self, name: str, fields: Data) -> None:
        """Raise ScenarioError if both the starts and the fields of a condition set x0."""
        if self.x0 is not None and "x0" in fields:
            raise ScenarioError(
                f"condition {name!r} and the starts, or --x0, both set x0: give one of them"
            )

    def place(self, scenario: Scenario, seed: int) -> Scenario:
        """Return a scenario with a seed, from the start that belongs to the seed, and with the
        error of its compensation that does.
        """
        return _with_drawn_error(self._started(scenario, seed), seed)

    def _started(self, scenario: Scenario, seed: int) -> Scenario:
        """Return a scenario with a seed, from the start that belongs to the seed."""
        if self.x0 is not None:
            scenario = dataclasses.replace(scenario, x0=self.x0)
        elif not self.by and _at_goal(scenario):
            scenario = dataclasses.replace(scenario, x0=beside_goal(scenario.plant))
        if seed == 0 and not scenario.plant.pose:
            return dataclasses.replace(scenario, seed=0)
        z = []
        for i in range(scenario.plant.n):
            generator = np.random.default_rng([seed, i])
            factor = generator.uniform(-1.0, 1.0)
            if scenario.contact:
                factor = -abs(factor)
            z.append(factor)
        x0 = []
        for x, r, factor in zip(scenario.resolved.x0, scenario.plant.origin, z, strict=True):
            if scenario.plant.pose:
                x0.append(x + (self.spread + self.by) * factor)
            else:
                away = self.by if x >= r else -self.by
                scattered = (x - r) * (1.0 + self.spread * factor)
                x0.append(r + scattered + away * factor)
        if "bobs" in kinds(scenario.contact):
            x0.sort()
        if scenario.plant.pose and scenario.plant.is_user_model:
            x0 = raised(scenario.plant, tuple(x0))
        return dataclasses.replace(scenario, seed=seed, x0=x0)


def _with_drawn_error(scenario: Scenario, seed: int) -> Scenario:
    """Return a scenario whose Feedforward has the error of a seed, evenly within that of the
    Feedforward.
    """
    feedforward = scenario.feedforward
    if not isinstance(feedforward, Feedforward) or feedforward.error == 0.0:
        return scenario
    most = abs(feedforward.error)
    generator = np.random.default_rng([seed, ERROR_STREAM])
    drawn = generator.uniform(-most, most)
    compensation = dataclasses.replace(feedforward, error=float(drawn))
    return dataclasses.replace(scenario, feedforward=compensation)


def _with_drawn_phases(scenario: Scenario) -> Scenario:
    """Return a scenario whose sinusoidal disturbances have the phases of its seed."""
    if scenario.seed == 0 or not any(isinstance(load, Sine) for load in scenario.disturbance):
        return scenario
    generator = np.random.default_rng([scenario.seed, PHASE_STREAM])
    loads = []
    for load in scenario.disturbance:
        if isinstance(load, Sine):
            phase = load.phase + float(generator.uniform(0.0, 2.0 * math.pi))
            loads.append(dataclasses.replace(load, phase=phase))
        else:
            loads.append(load)
    drawn = dataclasses.replace(scenario, disturbance=tuple(loads))
    return drawn.named(scenario.condition)


def _farthest(start: Sequence[float], rest: Sequence[float]) -> float:
    """Return the largest distance of a channel from its place of rest."""
    return max(abs(x - r) for x, r in zip(start, rest, strict=True))


def _at_goal(scenario: Scenario) -> bool:
    """Return whether a run of a user's joints starts where it should end, because nobody said
    where.
    """
    plant = scenario.plant
    joints = plant.has_user_joints
    return joints and scenario.x0 is None and plant.x0 == plant.origin


@constrained
def starts(
    x0: float | Sequence[float] | None = None, spread: Natural = SPREAD, by: Natural = 0.0
) -> Starts:
    """Return where the runs of a grid begin, by seed.

        smc.grid("duffing", "pid", seeds=3, starts=smc.starts(x0=0.4, spread=0.1))

    Args:
      x0: the middle of all starts, rad or m: one number for all channels, or one for each. Default:
        the plant's x0. If your own model has its x0 at its goal, and `by` is 0, its driven joints
        start beside the goal: at most 0.3 rad (m) from it, at most 0.6 of the way to a limit of
        their range, and nearer where they would touch something.
      spread: how far starts lie to either side of the middle, as a fraction of it, 0 or more; of a
        free body in m and rad.
      by: a distance that is added to it, rad or m, 0 or more; for a plant that rests at 0.

    Returns:
      A `Starts`, for `grid`, `tune`, `compare` and the questions about robustness.

    Raises:
      ScenarioError: a number out of its range.

    Warns:
      ScenarioWarning: a spread that may be in percent.
    """
    middle = None
    if isinstance(x0, Sequence) and not isinstance(x0, str):
        middle = tuple(number("x0", item) for item in items_of("x0", x0))
    elif x0 is not None:
        middle = (number("x0", x0),)
    if spread > MAX_SPREAD:
        warn_once(
            f"spread is {spread:g}, so starts lie up to {spread:g} times as far from the goal as "
            f"x0 to either side: if it is {spread:g} %, give {spread / 100.0:g}"
        )
    return Starts(x0=middle, spread=spread, by=by)


@constrained
def grid(
    plants: str | Plant | Sequence[str | Plant],
    laws: str | Law | Template | Sequence[str | Law | Template],
    conditions: str | Condition | Sequence[str | Condition] = "nominal",
    seeds: int | Iterable[int] = 1,
    gains: sets.NameOfSet = "tuned",
    duration: float = DURATION,
    starts: Starts | None = None,
) -> list[Scenario]:
    """Return scenarios of every plant, condition, law and seed.

        scenarios = smc.grid("duffing", ["pid", "adrc"], ["nominal", "noise"], seeds=3)
        len(scenarios)  # 12

    The plant varies slowest, then condition, law and seed.

    Args:
      plants: names or Plants, one or several.
      laws: names, which get their gains from the set `gains`, or laws with their own gains, also as
        text, see `law`.
      conditions: names, such as "noise" or "noise + coulomb", or your own conditions, see
        `condition`.
      seeds: a number of seeds, 0, 1, ..., or the seeds themselves. A seed is a start, a noise and
        the phase of sinusoidal disturbances, the same in every condition and under every law; see
        `starts`. If a law was tuned several times, the seed also selects which of its gains are
        used.
      gains: "study", "tuned", "tracking" or "default", see `gains`.
      duration: of each run, s.
      starts: where runs begin, by seed. Default: within 20 % of the plant's own x0.

    Returns:
      A list of Scenarios.

    Raises:
      ScenarioError: an unknown name, different plants, laws or conditions of the same name, no
        gains in the set, runs that begin at rest at 0 and stay there, or more than a million runs.

    Warns:
      ScenarioWarning: gains of a set that were tuned for other parameters of the plant.
    """
    seeds = _seeds(seeds)
    plants = listed("plants", plants)
    laws = listed_laws(laws)
    conditions = listed_conditions(conditions)
    if (runs := len(plants) * len(laws) * len(conditions) * len(seeds)) > MAX_ITEMS:
        raise ScenarioError(
            f"the grid has {runs:,} runs: give fewer seeds, {MAX_ITEMS:,} runs at most"
        )
    check_names(plants, laws, conditions)

    def laws_on(plant: Plant) -> list[LawOfSeed]:
        return [lambda seed, law=law: _law(plant, law, gains, seed) for law in laws]

    machines = [as_plant(plant) for plant in plants]
    return all_combinations(machines, laws_on, conditions, seeds, duration, starts)


def _seeds(seeds: object) -> list[int]:
    """Return seeds: those given, or as many as a number says."""
    if not isinstance(seeds, Iterable):
        seeds = range(whole("seeds", seeds, 1, MAX_ITEMS))
    checked = []
    for seed in listed("seeds", seeds):
        checked.append(whole("a seed", seed, 0, GRID_SEEDS - 1))
    return checked


def all_combinations(
    plants: Sequence[Plant],
    laws: Callable[[Plant], Sequence[LawOfSeed]],
    conditions: Sequence[Condition],
    seeds: Sequence[int],
    duration: float,
    starts: Starts | None = None,
) -> list[Scenario]:
    """Return scenarios as `grid` does.

    `laws` returns, for a plant, functions seed -> law, one for each law.
    """
    scenarios = []
    for plant in plants:
        for condition in conditions:
            runs = []
            for law in laws(plant):
                for seed in seeds:
                    run = case(plant, law(seed), condition, duration, seed=seed, starts=starts)
                    runs.append(_with_drawn_phases(run))
            check_moving(runs[: len(seeds)])
            scenarios += runs
    return scenarios


@constrained
def case(
    plant: str | Plant,
    law: str | Law | Template,
    condition: str | Condition = "nominal",
    duration: float = DURATION,
    gains: str = "tuned",
    seed: Annotated[int, SeedOf(high=GRID_SEEDS - 1)] = 0,
    starts: Starts | None = None,
    changes: Data = frozen({}),
) -> Scenario:
    """Return one run of a grid, with `changes` of the fields that its condition sets."""
    plant = as_plant(plant)
    condition = find_condition(condition)
    fields: Fields = {
        "plant": plant,
        "law": _law(plant, law, gains, seed),
        "duration": duration,
    }
    if plant.name in sets.STUDY:
        fields |= {"control_period": CONTROL_PERIOD, "u_max": U_MAX}
    of_condition = condition.on(plant, duration)
    starts = checked_starts(Starts() if starts is None else starts)
    starts.check_condition(condition.name, of_condition)
    scenario = Scenario(**fields | of_condition | dict(changes))
    return starts.place(scenario, seed).named(condition.name)


class Draws(NamedTuple):
    """Which random numbers the runs of a comparison have: initial states, noise and phases."""

    seeds: int  # runs of a law on each plant in each condition
    starts: Starts | None = None
    seed: int = 0  # another one draws others

    def numbers(self, count: int | None = None) -> range:
        """Return the seeds of that many runs, or of all, which are also the numbers of unseen
        instances.
        """
        first = self.seed * MAX_ITEMS
        return range(first, first + (self.seeds if count is None else count))


def checked_starts(given: object) -> Starts:
    """Return starts. Raise ScenarioError for anything else, such as the number x0."""
    if not isinstance(given, Starts):
        raise ScenarioError(f"starts is {shown(given)}: give starts=smc.starts(x0=0.5)")
    return given


def check_moving(runs: Sequence[Scenario]) -> None:
    """Raise ScenarioError if none of the runs, which differ only in their seeds, moves under any
    law.
    """
    if all(map(_stays_at_rest, runs)):
        first = runs[0]
        raise ScenarioError(
            f"{first.plant.name} starts at rest at 0 and nothing moves it under condition "
            f"{first.condition!r}: give another start, with starts=smc.starts(x0=0.5) or --x0 0.5"
        )


def _stays_at_rest(scenario: Scenario) -> bool:
    """Return whether a run begins at rest at its reference 0, and neither a force nor a sensor ever
    moves it.
    """
    moved = (
        any(scenario.resolved.x0)
        or any(scenario.resolved.v0)
        or scenario.disturbance
        or scenario.sensor
    )
    if (
        moved
        or scenario.feedforward
        or scenario.noise != Noise()
        or scenario.resolved.reference != REST
    ):
        return False
    model = with_values(compile_model(scenario), scenario)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = initial_state(model, scenario)
    mujoco.mj_forward(model, data)
    return bool(np.abs(data.qacc).max() < MAX_REST_ACCELERATION)


def check_names(
    plants: Sequence[str | Plant],
    laws: Sequence[str | Law | Template],
    conditions: Sequence[Condition],
) -> None:
    """Raise ScenarioError if two different plants, laws or conditions have the same name, as tables
    show only names.
    """
    of_plants = []
    for plant in map(as_plant, plants):
        machine = (plant.build, plant.parameters, plant.n)
        of_plants.append((plant.name, plant, machine))
    of_laws = []
    for law in laws:
        if isinstance(law, str):
            of_laws.append((law, law, law))
        else:
            bound = coerce.coerced_law(law)
            of_laws.append((bound.name, bound, bound))
    of_conditions = [(condition.name, condition, str(condition)) for condition in conditions]
    # each thing with its name and what distinguishes it from others
    for what, cure, things in (
        ("plants", "give each its own grid", of_plants),
        (
            "laws",
            "name one of them, as smc.law(...).named('slow') or --law \"slow: classical(k=2)\"",
            of_laws,
        ),
        ("conditions", "give each its own name", of_conditions),
    ):
        first_by_name = {}
        for name, value, content in things:
            first, first_content = first_by_name.setdefault(name, (value, content))
            if first_content != content:
                contents = f"{one_line(str(first))} and {one_line(str(value))}"
                raise ScenarioError(f"two {what} have the name {name!r}, {contents}: {cure}")


def _law(plant: Plant, law: str | Law | Template, gains: str, seed: int) -> Component:
    """Return a law, or the law of a name with its gains for the plant."""
    if not isinstance(law, str) or law not in all_laws():
        return checked_name(coerce.coerced_law(law))
    gains = "default" if law == "none" else gains
    with_gains = sets.law_with_gains(plant, law, gains, seed)
    if gains != "default" and (doubt := sets.other_parameters_warning(plant, gains)):
        warnings.warn(doubt, ScenarioWarning, users_stacklevel())
    return with_gains


def listed_laws(laws: object) -> list[str | Law | Template]:
    """Return one or several laws as a list.

    Names of the library's laws stay names; other texts become laws.
    """
    components = []
    for value in listed("laws", laws):
        components += from_text.laws_of_text(value) if isinstance(value, str) else [value]
    return components


def listed_conditions(conditions: object) -> list[Condition]:
    """Return one or several conditions as a list. The path of a file stands for all that it has."""
    expanded = []
    for value in listed("conditions", conditions):
        expanded += find_conditions(value)
    return expanded


def listed(what: str, values: object) -> list:
    """Return one or several values as a list."""
    if isinstance(values, str | os.PathLike | Plant | Component | Template | Condition):
        return [values]
    if (
        isinstance(values, bytes | Mapping)
        or not isinstance(values, Iterable)
        or not (items := items_of(what, values))
    ):
        raise ScenarioError(f"{what} is {shown(values)}: give several, such as a list")
    return items
