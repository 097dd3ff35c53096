"""Converters from what users give for a scenario's fields to what the fields hold.

A converter takes the field's name, what the user gave, and the scenario, whose fields before this
one are converted already. It raises ScenarioError, one sentence with the field, the value and the
cure, for what it cannot convert.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from smc_mujoco.common.aliases import Floats, Numbers
from smc_mujoco.common.errors import ScenarioError, items_of, number, shown, unknown, warn_once
from smc_mujoco.common.text import counted, joined, stated
from smc_mujoco.control import from_text, gain_sets
from smc_mujoco.control.component import Component, Template, by_channel
from smc_mujoco.control.estimator import estimator_catalogue as estimators
from smc_mujoco.control.law import Law
from smc_mujoco.control.surface import surface_catalogue as surfaces
from smc_mujoco.mechanisms.custom.model_numbers import dotted, model_numbers, with_model_numbers
from smc_mujoco.mechanisms.hardware.contact import Contact, Obstacle, kinds
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.hardware.feedforward import Compensable, Feedforward
from smc_mujoco.mechanisms.hardware.part import Actuator, Friction, OnJoints, chains
from smc_mujoco.mechanisms.hardware.stribeck import loaded
from smc_mujoco.mechanisms.layout import all_joints, channel_names, driven_names
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.controller import MAX_STATE
from smc_mujoco.simulation.signals import (
    Constant,
    Jump,
    PerChannel,
    Signal,
    parameter_factors,
)

T = TypeVar("T")
P = TypeVar("P", bound=OnJoints)

INTEGRATORS = ("RK4", "Euler", "implicitfast", "implicit")
MODELS = ("none", "nominal", "true")
MIN_TIME = 1e-9  # s, of periods
REST = Constant(0.0)

ByChannel = (
    Mapping[str, T] | Sequence[T]
)  # joint -> value, or values in the order of the driven channels
Laws = Law | Template | str | ByChannel[Law | Template | str]
EVERY = "*"  # in a mapping from joints to parts
Some = T | Sequence[T]
SomeByJoint = Some[T] | Mapping[str, Some[T]] | Sequence[Some[T] | Mapping[str, Some[T]]]
Frictions = SomeByJoint[Friction]
Actuators = SomeByJoint[Actuator]
Sensors = SomeByJoint[Encoder]


def plant(name: str, value: object, s: Any) -> Plant:
    """Return a plant, from itself or its name. Numbers of its joints and bodies that the scenario
    changes are among its parameters.
    """
    machine = as_plant(value)
    fields = vars(s)
    mismatch = fields.get("mismatch")
    jump = fields.get("jump")
    changed: list[str] = []
    if isinstance(mismatch, Mapping):
        changed += dotted(mismatch)
    if isinstance(jump, Jump):
        numbers = model_numbers(machine)
        for path in dotted(jump.of_plant):
            if path in numbers:
                changed.append(path)
    return with_model_numbers(machine, changed)


def coerced_law(value: Law | Template | str) -> Law:
    """Return a law, from itself, its template or its text."""
    law = from_text.law(value) if isinstance(value, str) else value
    return _component("law", law)


def coerced_laws(name: str, value: Laws | None, s: Any) -> Law:
    """Return the law of a plant's driven channels, from one law, one for each channel, or None for
    the suggested.
    """
    if value is None:
        value = s.plant.suggested.get("law")
    if not isinstance(value, Mapping | list | tuple):
        return _of_plant(value, s)
    channels = []
    for item in values_per_channel(name, value, s.plant):
        channels.append(_of_plant(item, s))
    return by_channel(channels)


def _of_plant(value: Any, s: Any) -> Law:
    """Return a law. One given by its name has the gains that are shipped for the plant, if there
    are some and the scenario has the model, the surface and the goal for which they were tuned;
    else its defaults, with a warning.
    """
    chosen = coerced_law(value)
    if value != chosen.name or not chosen.gains:
        return chosen
    model = "nominal" if chosen.requires_model else "none"
    as_tuned = s.model in (None, model) and s.surface is None and s.tracks == "position"
    if as_tuned and gain_sets.in_set(s.plant, chosen.name, "tuned"):
        warn_once(gain_sets.other_parameters_warning(s.plant))
        return gain_sets.law_with_gains(s.plant, chosen.name)
    # defaults of a law of many joints are rates, which hold for any machine
    if not (chosen.plants or chosen.joint):
        warn_once(gain_sets.default_gains_warning(s.plant, chosen))
    return chosen


def coerced_surface(name: str, value: object, s: Any) -> Any:
    """Return a surface, from itself, its template or its text, as "linear(c=3)"."""
    if isinstance(value, str):
        return from_text.component(name, value, surfaces(), "linear(c=3)")
    if value is None:
        return None
    return _component("surface", value)


def velocity(name: str, value: object, s: Any) -> Any:
    """Return an estimator, from itself, its template or its text, as "levant(L=4800)"."""
    if isinstance(value, str):
        return from_text.component("velocity estimator", value, estimators(), "levant(L=4800)")
    if value is None:
        return None
    return _component("estimator", value)


def _component(kind: str, value: object) -> Component:
    """Return a component of one kind, from itself or its template."""
    if isinstance(value, Template):
        value = value()
    if isinstance(value, Component) and value.kind == kind:
        return value
    field = "velocity" if kind == "estimator" else kind
    if callable(value):
        alternative = ""
        home = "design." if kind == "surface" else ""
        if kind == "law":
            alternative = ", or smc.law_from(function) for a policy of an observation"
        raise ScenarioError(
            f"{field} is a bare {type(value).__name__}: "
            f"give smc.{home}{kind}_function(function){alternative}"
        )
    raise ScenarioError(
        f"{field} is {shown(value)}: give smc.{kind}(...), your own {kind}, or a name"
    )


def input_delay(name: str, value: float, s: Any) -> float:
    """Return a delay, s, that is not longer than the run."""
    return number(name, value, low=0.0, high=s.duration)


def values_per_channel(name: str, value: ByChannel[T], plant: Plant) -> list[T]:
    """Return one value for each driven channel of a plant, in order, from a sequence, or a mapping
    by joint.
    """
    if isinstance(value, Mapping):
        joints = driven_names(plant)
        for joint in value:
            if joint not in joints:
                raise unknown(f"driven joint of {plant.name} in {name}", joint, joints)
        for joint in joints:
            if joint not in value:
                raise ScenarioError(
                    f"{name} has nothing for joint {joint!r} of {plant.name}: give one for each"
                )
        return [value[joint] for joint in joints]
    if len(value) != plant.driven:
        raise ScenarioError(
            f"{name} has {len(value)} values for the {plant.driven} driven channels of "
            f"{plant.name}: give one, or {plant.driven}"
        )
    return list(value)


def bound(name: str, value: float | ByChannel[float] | None, s: Any) -> float | Floats | None:
    """Return the bound on |u| of all channels, or of each driven one if they differ."""
    if value is None:
        return None
    if isinstance(value, np.ndarray):
        value = value.tolist()
    items: list[Any] = [value]
    if isinstance(value, Mapping | list | tuple):
        items = values_per_channel(name, value, s.plant)
    bounds = tuple(number(name, item, above=0.0, infinite=True) for item in items)
    return bounds[0] if len(set(bounds)) == 1 else bounds


def state(name: str, value: float | Sequence[float] | None, s: Any) -> Floats | None:
    """Return n positions or velocities, from n numbers or one.

    Beyond MAX_STATE a run would have diverged.
    """
    if value is None:
        return None
    if isinstance(value, np.ndarray):
        value = value.tolist()
    values: list[Any] = [value]
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        values = items_of(name, value)
    n = s.plant.n
    if len(values) not in (1, n):
        counts = "one number"
        if n > 1:
            counts += f", or {n}"
        raise ScenarioError(
            f"{name} has {len(values)} values, and {s.plant.name} {counted(n, 'channel')}: give "
            f"{counts}"
        )
    states = []
    for item in values * (n // len(values)):
        checked = number(name, item, low=-MAX_STATE, high=MAX_STATE)
        states.append(checked)
    return tuple(states)


def physics_step(name: str, value: float | None, s: Any) -> float | None:
    """Return the physics step, s, as an exact fraction of the control period."""
    if value is None:
        return None
    h = number(name, value, above=0.0, low=MIN_TIME)
    period = s.control_period
    count = period / h
    if not 1.0 - 1e-9 <= count < math.inf or abs(count - round(count)) > 1e-6 * count:
        raise ScenarioError(
            f"physics_step {h:g} s does not divide the control period {period:g} s: give "
            f"{period:g}/N"
        )
    return period / round(count)


def mechanism(name: str, value: str, s: Any) -> str:
    """Return the name of a mechanism that the plant offers."""
    names = ["equation", *s.plant.mechanisms]
    if not isinstance(value, str) or value not in names:
        raise unknown(f"{name} of {s.plant.name}", value, names)
    return value


def instance(kind: type[T], example: str, default: Any = None) -> Callable[[str, T | None, Any], T]:
    """Return the converter for a field that is an instance of `kind`; None becomes the default."""

    def convert(name: str, value: T | None, s: Any) -> T:
        if not isinstance(value, kind | None):
            raise ScenarioError(f"{name} is {shown(value)}: give {example} or None")
        return default if value is None else value  # pyright: ignore[reportReturnType]

    return convert


def several(kind: type[T], example: str) -> Callable[[str, object, Any], tuple[T, ...]]:
    """Return the converter for a field that is a tuple of `kind`, from one, several or None."""

    def convert(name: str, value: object, s: Any) -> tuple[T, ...]:
        for item in (items := as_tuple(value)):
            if not isinstance(item, kind):
                raise ScenarioError(
                    f"{name} is {shown(item)}: give one such as {example}, or several, or None"
                )
        return items

    return convert


def disturbance(name: str, value: object, s: Any) -> tuple[Signal, ...]:
    """Return the disturbances, from one, several or None."""
    if isinstance(value, Mapping):
        driven = driven_names(s.plant)
        joint = next(iter(value), driven[0])
        if joint not in driven:
            raise unknown(f"joint of {s.plant.name} in {name}", joint, driven)
        cure = "give one signal without a joint"
        if not s.plant.pose:
            cure += "; only a constant force can act on one joint, by "
            cure += f"fault=smc.Fault(at=..., bias=..., on={joint!r})"
        fact = f"{name} is {shown(value)}, and a disturbance acts on every driven joint"
        raise ScenarioError(f"{fact}: {cure}")
    return several(Signal, "smc.Sine(amplitude=0.2, omega=5.0)")(name, value, s)


def mismatch(name: str, value: Numbers | None, s: Any) -> Numbers:
    """Return parameter factors; None means no factors."""
    return parameter_factors(name, {} if value is None else value)


def suggested_reference(plant: Plant) -> Signal:
    """Return the reference that the plant's channels suggest; a channel that suggests none gets the
    plant's rest.
    """
    at_rest = [Constant(x) for x in plant.rest[: plant.driven]] or [REST]
    none = (None,) * len(at_rest)
    suggested = plant.suggested.get("reference", none)
    signals = []
    for rest, signal in zip(itertools.cycle(at_rest), suggested, strict=False):
        signals.append(signal or rest)
    return _reference(signals, plant)


def reference(name: str, value: Signal | ByChannel[Signal] | None, s: Any) -> Signal | None:
    """Return the reference of a plant's driven channels, from one signal or one for each
    channel.
    """
    if value is None:
        return None
    return _reference(value, s.plant)


def _reference(value: Signal | ByChannel[Signal], plant: Plant) -> Signal:
    """Return the reference of a plant's driven channels.

    A list of one signal counts as the signal. Joints that a mapping leaves out hold their goal.
    """
    at_goal = [Constant(x) for x in plant.rest] or [REST] * plant.n
    if isinstance(value, Mapping):
        joints = driven_names(plant)
        goals = zip(joints, at_goal, strict=False)
        value = dict(goals) | dict(value)
    elif isinstance(value, Signal) and getattr(value, "about", ""):
        value = [value] * plant.driven  # pyright: ignore[reportAssignmentType] a Sine
    if isinstance(value, PerChannel):
        value = value.signals
    if isinstance(value, list | tuple) and len(value) == 1:
        value = value[0]
    items: list[Any] = [value]
    of_measured: list[Any] = []  # of measured channels
    if isinstance(value, Mapping | list | tuple):
        own, of_measured = _split(value, plant)
        items = values_per_channel("reference", own, plant) + of_measured
    for item in items:
        if not isinstance(item, Signal):
            amplitude = "0.0"
            if isinstance(item, int | float):
                amplitude = shown(item)
            cure = f"give one signal, such as smc.Constant({amplitude})"
            if callable(item):
                cure = "give its samples, smc.signals.TimeSeries(times, values)"
            raise ScenarioError(f"reference is {shown(item)}: {cure}")
    for i, item in enumerate(items):
        if getattr(item, "about", ""):
            about_goal = dataclasses.replace(item, about="")
            items[i] = at_goal[i] + about_goal
    if not of_measured and all(item == items[0] for item in items):
        return items[0]
    return PerChannel(tuple(items))


def _split(value: Any, plant: Plant) -> tuple[Any, list[Any]]:
    """Return the references of driven channels, and those of the others if any of these has one;
    where it has none, it is the channel's goal.
    """
    if isinstance(value, list | tuple):
        if plant.measured and len(value) == plant.n:
            return value[: plant.driven], list(value[plant.driven :])
        return value, []
    names = channel_names(plant)[plant.driven :] if plant.measured else ()
    if not any(name in value for name in names):
        return value, []
    driven = {}
    for joint, signal in value.items():
        if joint not in names:
            driven[joint] = signal
    goals = zip(names, plant.goal or (0.0,) * plant.free, strict=True)
    of_measured = [value.get(name, Constant(goal)) for name, goal in goals]
    return driven, of_measured


def contact(name: str, value: object, s: Any) -> tuple[Obstacle, ...]:
    """Return obstacles, from one or several, themselves or kinds of the plant's own; None means
    "none".
    """
    parts = []
    for item in as_tuple(value):
        part = Contact(item) if isinstance(item, str) else item
        if not isinstance(part, Obstacle):
            names = ", ".join(["none", *s.plant.contacts])
            raise ScenarioError(
                f"{name} is {shown(item)}: give smc.Stops, smc.Wall, smc.Ball or one of {names}"
            )
        part.check(s.plant)
        if part != Contact("none"):
            parts.append(part)
    if len(own := kinds(parts)) > 1:
        raise ScenarioError(f"{name} has {own[0]!r} and {own[1]!r} of the plant's own: give one")
    return tuple(parts)


def friction(name: str, value: Frictions | None, s: Any) -> tuple[Friction, ...]:
    """Return frictions sorted by kind, from one, several or None, or by joint.

    Kinds on a joint must differ, and one at most keeps a state by which it holds the joint at rest.
    """
    items = _by_joint(name, value, s, Friction, "smc.Coulomb(0.05)", all_joints)
    return _together(name, items, s)


def _together(name: str, items: Sequence[Friction], s: Any) -> tuple[Friction, ...]:
    """Return frictions sorted by kind, checked as `friction` says."""
    items = [loaded(part) for part in items]
    for part, another in itertools.combinations(items, 2):
        if part.side != another.side:  # of a spring or a play: two bodies
            continue
        same = type(part) is type(another) and part.on == another.on
        first_joints = part.joint_names(s.plant)
        shared = {*first_joints} & {*another.joint_names(s.plant)}
        if same or (part.keeps_state and another.keeps_state and shared):
            kinds = f"{type(part).__name__} and {type(another).__name__}"
            raise ScenarioError(f"{name} has {kinds} on the same joint: give one of them")
    ordered = sorted(items, key=lambda part: (type(part).__name__, part.on, part.side))
    return tuple(ordered)


def feedforward(name: str, value: object, s: Any) -> Signal | Feedforward | None:
    """Return a known signal, or a compensation with its frictions as the plant's joints have
    them.
    """
    if isinstance(value, Feedforward):
        where = f"friction of {name}"
        kind: Any = Compensable
        parts = _by_joint(where, value.friction, s, kind, "smc.Coulomb(0.05)", all_joints)
        rubs = [part for part in parts if isinstance(part, Friction)]
        driven = driven_names(s.plant)
        plays = [_placed(where, part, s.plant, driven) for part in parts if part not in rubs]
        return dataclasses.replace(value, friction=(*_together(where, rubs, s), *plays))
    if not isinstance(value, Signal | None):
        raise ScenarioError(
            f"{name} is {shown(value)}: give smc.Feedforward(friction), or one signal, such as "
            "smc.signals.TimeSeries(times, values), or None"
        )
    return value


def _by_joint(
    name: str,
    value: Any,
    s: Any,
    kind: type[P],
    example: str,
    joints: Callable[[Plant], Sequence[str]],
) -> list[P]:
    """Return the parts given as one, several, None or by joint, each with the joints that it acts
    on, which must be among `joints` of the plant.

    Without parts the plant's model is not made, which takes a second for a thousand pendulums.
    """
    several_parts = several(kind, example)
    items: list[P] = []
    for item in as_tuple(value):
        if isinstance(item, Mapping):
            for joint in sorted(item, key=str):
                for part in several_parts(name, item[joint], s):
                    items.append(dataclasses.replace(part, on=(joint,)))
        else:
            items += several_parts(name, item, s)
    placed = []
    for part in items:
        one_placed = _placed(name, part, s.plant, joints(s.plant))
        placed.append(one_placed)
    return placed


def _placed(name: str, part: P, plant: Plant, joints: Sequence[str]) -> P:
    """Return a part with the joints that it acts on."""
    on = joints if EVERY in part.on else part.on
    if isinstance(part, Friction) and not on:
        for value in stated(part).values():  # a number for each channel is one by name
            if isinstance(value, tuple) and len(value) == plant.n > plant.driven:
                on = channel_names(plant)
    for joint in on:
        if joint not in joints:
            raise unknown(f"joint of {plant.name} in {name}", joint, joints)
    if not isinstance(part, Friction) and set(on) == set(joints):
        on = ()
    return dataclasses.replace(part, on=tuple(on))


def actuator(name: str, value: Actuators | None, s: Any) -> tuple[Actuator, ...]:
    """Return the actuators, from one, several or None, or by joint: at most two drives of a joint
    in the given order, then an ElasticJoint or a Backlash.
    """
    if value is None and "actuator" not in s.plant.suggested:
        return ()
    driven = driven_names(s.plant)
    added = [part for part in as_tuple(value) if not getattr(part, "is_of_file", False)]
    items = _by_joint(name, added, s, Actuator, "smc.Lag(0.01)", driven_names)
    of_file = _kept(items, s.plant)
    if of_file:
        before = []
        after = []
        for part in items:
            if any(part.before(drive) for drive in of_file):
                before.append(part)
            else:
                after.append(part)
        items = before + of_file + after
    for chain in dict.fromkeys(chains(items, driven)):
        drives = []
        beside = []
        for part in chain:
            if part.drives:
                drives.append(part)
            else:
                beside.append(type(part).__name__)
        if len(beside) > 1:
            raise ScenarioError(
                f"{name} has {joined(beside)}, and a joint has one rotor beside it: give one"
            )
        if len(drives) > 2 or (len(drives) == 2 and not drives[0].before(drives[1])):
            raise ScenarioError(_too_many(name, drives, of_file))
    return tuple(sorted(items, key=lambda part: not part.drives))


def _too_many(name: str, drives: Sequence[Actuator], of_file: Sequence[Actuator]) -> str:
    """Return a sentence that refuses the drives of one joint, which are too many."""
    if file := next((part for part in drives if part in of_file), None):
        too_many = joined(type(part).__name__ for part in drives if part is not file)
        return (
            f"{name} has {too_many}, and the joint keeps the {type(file).__name__} of its file: "
            "leave that out, or give smc.Channel(motor=True) for an ideal motor instead"
        )
    return (
        f"{name} has the drives {shown(tuple(drives))}: give one drive, or (smc.Lag(0.01), another)"
    )


def _kept(items: list[Actuator], plant: Plant) -> list[Actuator]:
    """Return the actuators of its file that a plant keeps, for joints to which `items` give none of
    their kind. An item that is one of them, as of a record, is taken out.
    """
    parts = []
    suggested = plant.suggested.get("actuator", ())
    for joint, chain in zip(driven_names(plant), suggested, strict=False):
        for part in chain:
            own = part.of_file(() if plant.driven == 1 else (joint,))
            if own in items:
                items.remove(own)
            if not _has_drive(items, part, joint):
                parts.append(own)
    return parts


def _has_drive(items: Sequence[Actuator], part: Actuator, joint: str) -> bool:
    """Say whether a joint has a given drive of the part's kind; one without names is of all."""
    for item in items:
        on_joint = not item.on or joint in item.on
        if on_joint and type(item) is type(part):
            return True
    return False


def sensor(name: str, value: Sensors | None, s: Any) -> Encoder | tuple[Encoder, ...] | None:
    """Return the encoder of all channels, or those of some joints."""
    if value is None:
        return None
    joints = channel_names(s.plant)
    items = _by_joint(name, value, s, Encoder, "smc.Encoder(counts=...)", channel_names)
    for joint, taken in zip(joints, chains(items, joints), strict=True):
        if len(taken) > 1:
            raise ScenarioError(f"{name} has two parts on joint {joint!r}: give one")
    if len(items) == 1 and not items[0].on:
        return items[0]
    return tuple(items) or None


def as_tuple(value: object) -> tuple[Any, ...]:
    """Return one value, several or None as a tuple."""
    if value is None:
        return ()
    if isinstance(value, tuple | list):
        return tuple(value)
    return (value,)
