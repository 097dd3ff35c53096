"""Conditions: noise, disturbances, delays and other circumstances of a run, as named fields of a
Scenario.

    worn = smc.condition("worn gear", friction=smc.Coulomb(0.05), actuator=smc.Backlash(0.02))
    smc.grid(["duffing"], ["classical"], ["nominal", worn, "noise + delay_10ms"], seeds=16)

A condition applies to any plant. Those of the suite are in `NAMED`, under names such as "noise".
Names joined by "+" apply together. As text, a condition is its name, a colon and its fields,
written as in Python. Such a text is parsed, and only a file that it names is run:

    worn gear: friction=Coulomb(0.05), sensor=Encoder(counts=4096)
    mine: friction=my_parts.py:stribeck(static=0.3)

The levels of the suite are those of a machine of the study's size. Dry friction is of any size: a
sixtieth of the machine's bound on the force of each driven joint, 0.1 N m or N in the study. The
viscous friction of "friction" is half as much at 1 rad/s or m/s. The dry friction of "stiction" is
six times as large in motion, and nine times at rest: a law with an integral may hunt under it, and
a search under this condition counts that. The backlash is that of a worn
gear, the lag that of a hydraulic valve, and the counts, per revolution or metre, are those of an
inexpensive encoder. On a free body and on a user's model, whose size may be any, a disturbance is
the same share of the largest force as it is of u_max in the study. The play, the counts and the
motor of a user's model are as large beside its joints as those of the study, and its stepper is
refused where a rig's steps and rates do not suit it. Under "elastic" a spring is between each joint
and its rotor, with a resonance of 68 Hz on the study's pendulum, and elsewhere as much faster than
what the bound on u can do; under "motor_side" the controller reads the rotors. Under "contact" a
joint has stops about its goal, and a blow drives it there whatever u does, see `blow`. Under
"jitter" samples are late by up to half of the suite's control period. Under "missed" one sample in
ten does not run. Under "stepper" u is the wanted acceleration, so gains for a force do not suit it:
tune under it. Its rates are those of the firmware of rig stepper_furuta; it is 30 times as strong
as other drives, near that machine's ratio of torque to inertia, as one of their strength loses
steps here. Under "fault" every actuator loses half of its force at 2 s.
"""

import ast
import contextlib
import dataclasses
import functools
import inspect
import math
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.common import errors
from smc_mujoco.common.aliases import AnyPath, Data
from smc_mujoco.common.errors import ScenarioError, find, number, shown, unknown
from smc_mujoco.common.files import reading
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.registry import subclasses
from smc_mujoco.common.scripts import IN_FILE, WITHIN, object_named, place
from smc_mujoco.common.text import joined, stated
from smc_mujoco.control import gain_sets
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.estimator import catalogue as estimators
from smc_mujoco.control.estimator import estimator
from smc_mujoco.mechanisms.custom.scales import BESIDE, at_goal, usual_start
from smc_mujoco.mechanisms.hardware import obstacles, servos  # noqa: F401
from smc_mujoco.mechanisms.hardware.backlash import MIN_INERTIA, Backlash
from smc_mujoco.mechanisms.hardware.contact import Obstacle
from smc_mujoco.mechanisms.hardware.drives import DCMotor, Lag
from smc_mujoco.mechanisms.hardware.elastic_joint import ElasticJoint
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.hardware.friction import Coulomb, LuGre, Viscous
from smc_mujoco.mechanisms.hardware.part import Actuator, Friction, Part
from smc_mujoco.mechanisms.hardware.stepper import of_rig
from smc_mujoco.mechanisms.hardware.stribeck import Stribeck
from smc_mujoco.mechanisms.layout import channel_names
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.plant import catalogue as plants
from smc_mujoco.simulation import (
    coerce,
    time_series,  # noqa: F401
)
from smc_mujoco.simulation.blow import bump
from smc_mujoco.simulation.force_bounds import U_MAX, default_u_max
from smc_mujoco.simulation.law_checks import NOT_OF_FREE_BODIES
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import (
    Clock,
    Constant,
    Fault,
    Jump,
    Noise,
    OrnsteinUhlenbeck,
    Pulse,
    Signal,
    Sine,
    Step,
)

# fields, or a function of plant and duration that returns them
Recipe = Data | Callable[[Plant, float], Data]

MAX_JOINED = 20  # conditions in one name: chosen
GRID_FIELDS = ("plant", "law", "model", "surface", "seed", "duration")  # that a grid sets itself
CONDITION_FIELDS = [name for name in Scenario.fields() if name not in GRID_FIELDS]
# their values add up when conditions are joined
ADDITIVE_FIELDS = ("disturbance", "friction", "actuator", "contact")
ABSTRACT = (Part, Friction, Actuator, Obstacle, Signal)  # classes that a text cannot name
PLAIN = (Noise, Jump, Fault, Clock)  # fields' values that are neither parts nor signals
WHAT = "part, signal or estimator"  # that a text may name
# a text in quotes, or FILE.py:NAME without them
FILES = re.compile(rf"'[^']*'|\"[^\"]*\"|(?P<bare>{WITHIN.pattern})")
CONSTANTS = {"inf": math.inf, "pi": math.pi}

# The suite's defaults, under which its plants and laws are compared.
PLANTS = tuple(gain_sets.STUDY)  # the plants of the first paper
DURATION, CONTROL_PERIOD = 10.0, 1e-3  # s

BOUNDS_PER_FRICTION = 60.0  # of u, on each driven joint
BRISTLE_STIFFNESS = 1e4  # 1/rad (1/m), of bristles over the friction at which a joint breaks away
# of a user's joint, from the study's pendulum of 0.125 kg m^2: its largest acceleration, rad/s^2,
# and the share of a rotor; chosen: what a rig's stepper suits, rad/s^2 (m/s^2) and rad (m)
STUDY_ACCELERATION = 48.0
ROTOR_SHARE = 0.008
STEPPER_ACCELERATIONS = (5.0, 500.0)
SHORTEST_WAY_OF_STEPS = 0.15
SINE = Sine(amplitude=0.2, omega=5.0)
SENSOR_NOISE = Noise(position=0.01, velocity=0.05)
STICTION_SPEED = 0.05  # rad/s (m/s), at which friction has fallen, chosen: that of the bristles
# of an elastic joint, chosen: its rotor's share of the inertia, as of a geared arm; its resonance
# over the joint's own rate, sqrt(bound/(inertia way)), which is 68 Hz on the study's pendulum, ten
# times its loop; and the share of critical damping
ELASTIC_ROTOR = 0.5
RESONANCE = 43.6
STRUCTURAL_DAMPING = 0.01
DIFFERENCED = estimator("filtered_difference", tau=5e-3)


@dataclasses.dataclass(frozen=True)
class Condition:
    """A named condition; see `condition`."""

    name: str
    fields: Recipe
    # the file that it was read from, if it was all of it, for commands that are printed
    file: str = dataclasses.field(default="", compare=False, repr=False)

    def __post_init__(self):
        if not callable(self.fields):
            fields = {}
            for name, value in self.fields.items():
                fields[name] = _frozen(value)
            object.__setattr__(self, "fields", frozen(fields))

    def __reduce__(self):
        """Pickle one of the suite by its name: its fields may be a function in a function."""
        if all(name.strip() in NAMED for name in self.name.split("+")):
            return find_condition, (self.name,)
        return super().__reduce__()

    def on(self, plant: Plant, duration: float) -> dict[str, Any]:
        """Return the Scenario fields for a plant and a duration, s.

        Single events happen at half of the duration.
        """
        length = number("duration", duration, above=0.0)
        template = self.fields(plant, length) if callable(self.fields) else self.fields
        fields = dict(template)
        refused = []
        for name in NOT_OF_FREE_BODIES:
            if plant.pose and fields.get(name) and not isinstance(fields[name], Mapping):
                refused.append(name)
        if refused:
            raise ScenarioError(
                f"condition {self.name!r} sets {refused[0]}, and {plant.name} is a free body, "
                "which takes none: choose another condition"
            )
        return fields

    def __add__(self, other: "Condition | str") -> "Condition":
        """Return both at once.

        Disturbances, frictions and actuators add up; other fields must not differ.
        """
        pair = self, find_condition(other)
        return Condition(
            f"{self.name} + {pair[1].name}",
            lambda plant, duration: _joined_fields(pair, plant, duration),
        )

    def __str__(self) -> str:
        """Return the text that `parse` reads, or the name alone for a condition of the suite."""
        return self.text()

    def text(self, files: bool = True) -> str:
        """Return the text that `parse` reads, or the name alone for a condition of the suite.

        Without `files` it names a user's part alone, without the file that has it.
        """
        if self.name in NAMED or callable(self.fields):
            return self.name
        try:
            texts = _assignments(self.fields, functools.partial(_as_text, files=files))
        # the repr of a value that no scenario takes may fail; this text is for the error about it
        except Exception:
            texts = _assignments(self.fields, shown)
        return f"{self.name}: {texts}"

    def brief(self, plant: Plant, duration: float) -> str:
        """Return the fields on a plant for people, without those of parts that are none or 0 by
        default; arguments and errors as in `on`.
        """
        fields = self.on(plant, duration)
        return _assignments(fields, functools.partial(_as_text, files=False, brief=True))


def condition(name: str, **fields: Any) -> Condition:
    """Return your own condition, for `grid`, `tune`, `margins` and `basin`.

        smc.condition("dry", friction=smc.Coulomb(0.05), noise=smc.Noise(position=1e-3))

    In its place these functions, as the commands, take its text, or the path of a text file with
    one condition a line, as `Identified.save` writes it. They take the names of
    the suite's conditions, too, such as noise, sine, step, delay_10ms, light, heavy, jump_hard,
    period_20ms, friction, coulomb, stiction, lag_20ms, dc_motor, backlash, encoder, contact and
    fault; `smc-mujoco list` has all.

    Args:
      name: its name in tables and figures; not a name of the suite. Or, without fields, the text of
        a condition, such as "dry: friction=Coulomb(0.05)", or names of the suite's, such as
        "noise+encoder".
      fields: fields of a Scenario, such as friction=smc.Coulomb(0.05), except plant, law, model,
        surface, seed and duration.

    Returns:
      A Condition.

    Raises:
      ScenarioError: the name is one of the suite's, a field does not exist or belongs to no
        condition, or there is no field at all.
    """
    if isinstance(name, str) and set(":+") & set(name) and not fields:
        return find_condition(name)
    if errors.name("a condition's name", name) in NAMED:
        raise ScenarioError(f"condition {name!r} is a name of the suite: give another")
    if set(":+,") & set(name):
        raise ScenarioError(f"condition {shown(name)} has one of : + , in it: give another name")
    if not fields:
        raise ScenarioError(
            f"condition {name!r} has no fields: give some, such as friction=smc.Coulomb(0.05)"
        )
    for field in fields:
        if field in GRID_FIELDS:
            raise ScenarioError(
                f"condition {name!r} sets {field}, which the grid sets itself: leave it out"
            )
        if field not in CONDITION_FIELDS:
            raise unknown("field of a Scenario", field, CONDITION_FIELDS)
    return Condition(name, fields)


def find_condition(value: "Condition | AnyPath") -> Condition:
    """Return the Condition for a Condition, a name, several names joined by "+", the text of a
    condition, or the path of a text file with one.
    """
    conditions = find_conditions(value)
    if len(conditions) != 1:
        names = joined(repr(condition.name) for condition in conditions)
        raise ScenarioError(
            f"{str(value)!r} has {len(conditions)} conditions ({names}), and this takes one: leave "
            "the others out, or join two as noise+encoder"
        )
    return conditions[0]


def find_conditions(value: "Condition | AnyPath") -> list[Condition]:
    """Return what `find_condition` does, or every condition of a file."""
    if isinstance(value, Condition):
        return [value]
    if isinstance(value, os.PathLike) or _is_path(value):
        return from_file(Path(value))
    return [_of_text(value)]


def _is_path(text: object) -> bool:
    """Return whether a text is the path of a file, and no name or text of a condition."""
    if not isinstance(text, str) or set(":=(") & set(text) or text in NAMED:
        return False
    path = Path(text)
    return path.name != text or bool(path.suffix) or os.path.isfile(path)


def _of_text(value: object) -> Condition:
    """Return the condition of names joined by "+", or of a text."""
    if not isinstance(value, str):
        raise ScenarioError(f"condition is {shown(value)}: give a name, or smc.condition(...)")
    if in_file := IN_FILE.fullmatch(value):
        kind = f'condition (of a part: "{in_file["name"]}: friction={value}")'
        return object_named(value, kind, lambda thing: isinstance(thing, Condition))
    if ":" in value:
        return parse(value)
    if set("=(") & set(value):
        raise ScenarioError(
            f"condition {shown(value)} has no colon: write a name, a colon and fields, as worn: "
            "x0=0.3"
        )
    if (count := value.count("+") + 1) > MAX_JOINED:
        raise ScenarioError(
            f"condition {shown(value)} joins {count:,} conditions: give at most {MAX_JOINED}"
        )
    first, *further = [_named(part.strip()) for part in value.split("+")]
    return sum(further, start=first)


def _named(name: str) -> Condition:
    """Return a condition of the suite."""
    if name not in NAMED and (delay := OTHER_DELAY.fullmatch(name)):
        seconds = f"{float(delay[1]) / 1e3:g}"
        raise ScenarioError(
            f"unknown condition {name!r}: write another delay as 'late: input_delay={seconds}'"
        )
    return find("condition", name, NAMED)


def applicable(names: Iterable[str], plants: Sequence[Plant], duration: float) -> list[str]:
    """Return those of the names, of conditions of the suite, that apply to every plant."""
    fitting = []
    for name in names:
        with contextlib.suppress(ScenarioError):
            for plant in plants:
                fields = NAMED[name].on(plant, duration)
                Scenario.recorded(plant=plant, law="none", duration=duration, **fields)
            fitting.append(name)
    return fitting


def parse(text: str) -> Condition:
    """Return the condition that a text describes, such as "worn gear: friction=Coulomb(0.05)"."""
    name, _, fields = text.partition(":")
    if set(",+") & set(name):
        raise ScenarioError(
            f"condition {shown(text)} has a comma or a + before its colon: a condition of your own "
            "needs its own --condition, in Python its own text"
        )
    try:
        values = read_fields(fields)
    except SyntaxError:
        cure = 'write it as "worn gear: friction=Coulomb(0.05), x0=0.3"'
        if with_unit := re.search(r"\b\d[\d.]*(?![eE][-+]?\d)[a-zA-Z]+", fields):
            cure = f"numbers stand without a unit, in SI, and {with_unit[0]!r} has one"
        raise ScenarioError(f"condition {shown(text)} cannot be read: {cure}") from None
    return condition(name.strip(), **values)


def read_fields(text: str) -> dict[str, Any]:
    """Return the fields in a text such as "friction=Coulomb(0.05), x0=0.3".

    No text is run, but a file is whose part the text names, as "friction=my_parts.py:stribeck()".
    """
    quoted = FILES.sub(_in_quotes, text)
    try:
        call = ast.parse(f"_({quoted})", mode="eval").body
    except (ValueError, RecursionError, MemoryError):
        call = None
    if not isinstance(call, ast.Call) or call.args:
        raise SyntaxError
    if any(word.arg is None for word in call.keywords):
        raise SyntaxError
    return _keywords(call)


def _in_quotes(found: re.Match[str]) -> str:
    """Return FILE.py:NAME in quotes, as Python reads it."""
    return repr(found["bare"]) if found["bare"] else found[0]


def from_file(path: Path) -> list[Condition]:
    """Return the conditions in a text file, one per line.

    Empty lines and lines that begin with # are skipped.
    """
    cure = "give a text file, one condition a line, or a condition, such as worn: x0=0.3"
    with reading(path, "file of conditions", cure) as file:
        lines = file.read_text(encoding="utf-8").splitlines()
    conditions = []
    for count, line in enumerate(lines, 1):
        text = line.strip()
        try:
            if text and not text.startswith("#"):
                conditions.append(_of_text(text))
        except ScenarioError as error:
            raise ScenarioError(f"line {count} of {str(path)!r}: {error}") from None
    if not conditions:
        raise ScenarioError(f"{str(path)!r} has no condition: write one on a line")
    if len(conditions) == 1:
        return [dataclasses.replace(conditions[0], file=str(path))]
    return conditions


def _parsed(node: ast.expr) -> Any:  # noqa: PLR0911  # a table
    """Return the value of a literal, or of a call that makes a part, a signal or an estimator."""
    match node:
        case ast.Constant(value=str() as text) if IN_FILE.fullmatch(text):
            return _call(ast.Call(func=node, args=[], keywords=[]))
        case ast.Constant(value=value):
            return value
        case ast.Name(id=name) if name in CONSTANTS:
            return CONSTANTS[name]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -errors.number("a value", _parsed(operand), infinite=True)
        case ast.Tuple(elts=items) | ast.List(elts=items):
            return tuple(map(_parsed, items))
        case ast.Dict(keys=keys, values=values) if None not in keys:
            parsed = {}
            for key, value in zip(keys, values, strict=True):
                if key is not None:
                    parsed[_parsed(key)] = _parsed(value)
            return parsed
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            first = _parsed(left)
            second = _parsed(right)
            if isinstance(first, Signal) and isinstance(second, Signal):
                return first + second
        case ast.Call():
            return _call(node)
    raise ScenarioError(
        f"condition has {shown(ast.unparse(node))}: give numbers, texts and parts such as "
        "Coulomb(0.05)"
    )


def _call(node: ast.Call) -> Any:
    """Return the part, signal or estimator that a call makes."""
    kind: Any
    if isinstance(node.func, ast.Constant):
        kind = object_named(str(node.func.value), WHAT, _usable)
    else:
        name = ast.unparse(node.func).removeprefix("smc.")
        kind = find(WHAT, name, estimators() | _kinds())
    if not callable(kind):
        if node.args or node.keywords:
            raise ScenarioError(
                f"condition has {shown(ast.unparse(node))}, which is {kind}: leave its brackets out"
            )
        return kind
    values = map(_parsed, node.args)
    keywords = _keywords(node)
    try:
        return kind(*values, **keywords)
    except TypeError:
        parameters = getattr(kind, "defaults", ())
        if isinstance(kind, type):
            parameters = inspect.signature(kind).parameters
        cure = f"it takes {', '.join(parameters) or 'nothing'}"
        raise ScenarioError(f"condition has {shown(ast.unparse(node))}: {cure}") from None


def _usable(thing: Any) -> bool:
    """Return whether a thing of a user's file is a part, signal or estimator, or a kind of it."""
    if isinstance(thing, Template):
        return thing.kind == "estimator"
    if isinstance(thing, type):
        return issubclass(thing, (Part, Signal, *PLAIN)) and thing not in ABSTRACT
    return isinstance(thing, Part | Signal | Noise | Jump | Fault | Clock)


def _keywords(node: ast.Call) -> dict[str, Any]:
    """Return keyword -> value of a call, in which no keyword may stand twice."""
    keywords: dict[str, Any] = {}
    for word in node.keywords:
        if str(word.arg) in keywords:
            call = shown(ast.unparse(node).removeprefix("_"))
            raise ScenarioError(f"condition has {word.arg} twice, in {call}: give it once")
        keywords[str(word.arg)] = _parsed(word.value)
    return keywords


def _kinds() -> dict[str, Any]:
    """Return name -> class of all parts and signals, also users'.

    If two have one name, the suite's is returned.
    """
    kinds: list[type] = [*PLAIN]
    for kind in (*subclasses(Part), *subclasses(Signal)):
        if kind not in ABSTRACT:
            kinds.append(kind)
    kinds.sort(key=lambda kind: kind.__module__.startswith("smc_mujoco."))
    return {kind.__name__: kind for kind in kinds}


def _assignments(fields: Data, as_text: Callable[[Any], str]) -> str:
    """Write fields as assignments, with commas between them."""
    return ", ".join(f"{name}={as_text(value)}" for name, value in fields.items())


def _as_text(value: Any, files: bool = True, brief: bool = False) -> str:
    """Return a value as `parse` reads it, with or without the files of a user's parts; or `brief`,
    for people, with six digits and without the fields of parts that are none or 0 by default.
    """
    as_text = functools.partial(_as_text, files=files, brief=brief)
    if isinstance(value, Component):
        own = files and value.name not in estimators()
        word = _word(value.template, own) or value.name
        return f"{word}({_assignments(value.gains, repr)})"
    if isinstance(value, Part | Signal | Noise | Jump | Fault | Clock):
        fields = stated(value)
        if brief:
            changed = stated(value, defaults=False)
            fields = {name: number for name, number in fields.items() if name in changed or number}
        if getattr(value, "about", ""):
            fields["about"] = "goal"
        kind = type(value)
        own = files and not kind.__module__.startswith("smc_mujoco.")
        word = _word(kind, own) or kind.__name__
        return f"{word}({_assignments(fields, as_text)})"
    if isinstance(value, tuple):
        end = "" if brief else ","
        return f"({', '.join(map(as_text, value))}{end})"
    if isinstance(value, Mapping):
        items = []
        for key, item in value.items():
            items.append(f"{key!r}: {as_text(item)}")
        return f"{{{', '.join(items)}}}"
    return f"{value:.6g}" if brief and isinstance(value, float) else repr(value)


def _word(kind: Any, own: bool) -> str:
    """Return FILE.py:NAME of a kind of part that is the user's own; "" if no file has it."""
    where = place(kind) if own else ""
    return where if WITHIN.fullmatch(where) else where and repr(where)


def _frozen(value: Any) -> Any:
    """Return an immutable copy of a field's value."""
    if isinstance(value, Mapping):
        return frozen(value)
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list):
        return tuple(value)
    return value


def _differ(first: Any, second: Any) -> bool:
    """Return whether two values of a field differ, as those do that cannot be compared."""
    try:
        return bool(first != second)
    except Exception:  # no scenario takes such a value; the caller's sentence names the field
        return True


def _joined_fields(
    pair: tuple[Condition, Condition], plant: Plant, duration: float
) -> dict[str, Any]:
    """Return the fields of two conditions at once."""
    first, second = (condition.on(plant, duration) for condition in pair)
    for field in second:
        if field not in first:
            continue
        if field in ADDITIVE_FIELDS:
            earlier = coerce.as_tuple(first[field])
            second[field] = *earlier, *coerce.as_tuple(second[field])
        elif _differ(first[field], second[field]):
            names = " and ".join(repr(condition.name) for condition in pair)
            raise ScenarioError(
                f"conditions {names} both set {field}: give one of them, or smc.condition(...)"
            )
    return first | second


def _jump(size: str) -> Recipe:
    """Return a parameter jump at half time, with the sine disturbance; `size` is "mild" or
    "hard".
    """

    def fields(plant: Plant, duration: float) -> Data:
        if size not in plant.jumps:
            with_jump = []
            for name, machine in plants().items():
                if size in machine.jumps:
                    with_jump.append(name)
            cure = f"choose another condition, or one of {', '.join(with_jump)}"
            raise ScenarioError(
                f"condition 'jump_{size}' has no numbers for plant {plant.name!r}: {cure}"
            )
        return {
            "disturbance": _sized(SINE, plant),
            "jump": Jump(time=duration / 2, factors=plant.jumps[size]),
        }

    return fields


def _contact(plant: Plant, duration: float) -> Data:
    """Return a joint's stops about its goal, and a blow that reaches them whatever u does."""
    stops, blow = bump(plant, duration / 2, 1.0 / BOUNDS_PER_FRICTION)
    return {"contact": stops, "disturbance": blow}


def _stepper(plant: Plant, duration: float) -> Data:
    """Return a stepper motor, and its largest acceleration as the bound on u."""
    if not plant.is_user_model:
        motor = of_rig(30.0 * default_u_max(plant))
        return {"actuator": motor, "u_max": motor.ramp}
    slowest, fastest = STEPPER_ACCELERATIONS
    for name, joint in zip(channel_names(plant), _joint_sizes(plant), strict=False):
        able = joint.limit / joint.inertia
        if not slowest <= able <= fastest or joint.travel < SHORTEST_WAY_OF_STEPS:
            raise ScenarioError(
                f"condition 'stepper' has the steps and rates of a rig, and joint {name!r} of "
                f"{plant.name} has {able:.2g} rad/s^2 (m/s^2) at its bound and moves by "
                f"{joint.travel:.2g} rad (m): give your own, as pulses: "
                "actuator=Stepper(torque=2, speed=60, ramp=80), u_max=80"
            )
    motors: Any = _each_joint("actuator", lambda limit, plant: of_rig(30.0 * limit))
    return motors(plant, duration) | {"u_max": of_rig(1.0).ramp}


def _fault(plant: Plant, duration: float) -> Data:
    """Return the loss of half the force, at 2 s, or at half of a run that is too short for it."""
    time = 2.0 if duration > 2.0 else duration / 2
    return {"fault": Fault(at=time, gain=0.5)}


def _sized(signal: Signal, plant: Plant) -> Signal:
    """Return a disturbance of the study's plants; for a free body and a user's model that share of
    the largest force.
    """
    if not (plant.pose or plant.is_user_model):
        return signal
    name = "sigma" if isinstance(signal, OrnsteinUhlenbeck) else "amplitude"
    size = getattr(signal, name) * default_u_max(plant) / U_MAX
    return dataclasses.replace(signal, **{name: size})


def _disturbed(make: Callable[[float], Signal]) -> Recipe:
    """Return the disturbance that a function makes for half of the duration."""
    return lambda plant, duration: {"disturbance": _sized(make(duration / 2), plant)}


def _each_joint(name: str, make: Callable[[float, Plant], Any]) -> Recipe:
    """Return a recipe for field `name`: one part per driven joint, made from its bound."""

    def fields(plant: Plant, duration: float) -> Data:
        limits = Scenario.recorded(plant=plant, law="none").drive_train.forces
        parts = [make(limit, plant) for limit in limits]
        if plant.pose or len(set(parts)) == 1:
            return {name: parts[0]}
        by_joint = zip(channel_names(plant), parts, strict=False)
        return {name: dict(by_joint)}

    return fields


def _rubbing(make: Callable[[float, Plant], Friction | tuple[Friction, ...]]) -> Recipe:
    """Return the friction that a function makes of a level, a sixtieth of the bound on each driven
    joint.
    """
    return _each_joint("friction", lambda limit, plant: make(limit / BOUNDS_PER_FRICTION, plant))


def _sticking(limit: float, plant: Plant) -> Friction:
    """Return dry friction that falls from 15 % of the bound at rest to 10 % in motion."""
    return Stribeck(0.1 * limit, 0.15 * limit, STICTION_SPEED)


def _bristles(level: float, plant: Plant) -> Friction:
    """Return bristles that bend by 0.1 mrad (mm) before a joint slides, as those of the study do.
    On the library's plants they have the study's stiffness. The default step does not resolve them
    on furuta: at a tenth of it `rotary_swing_up` settles 0.6 % earlier and has 3 % more ITAE.
    """
    stiffness = BRISTLE_STIFFNESS * level if plant.is_user_model else LuGre.stiffness
    return LuGre(0.5 * level, level, stribeck=0.05, stiffness=stiffness)


class JointSize(NamedTuple):
    """The size of a driven joint."""

    limit: float  # N m or N, its largest force
    inertia: float  # kg m^2 or kg, at the goal
    travel: float  # rad or m, from where runs start to the goal


def _joint_sizes(plant: Plant) -> list[JointSize]:
    """Return the sizes of the driven joints."""
    moments = at_goal(plant)
    inertias = np.diag(moments.M)[moments.dofs].tolist()
    apart = np.subtract(usual_start(plant), plant.origin)
    ways = np.abs(apart)[: plant.driven].tolist()
    limits = Scenario.recorded(plant=plant, law="none").drive_train.forces
    joints = zip(limits, inertias, ways, strict=True)
    own = []
    for limit, inertia, way in joints:
        own.append(JointSize(limit, inertia, way or BESIDE))
    return own


def _fitted(usual: Actuator, fit: Callable[[JointSize], Actuator]) -> Recipe:
    """Return a recipe for an actuator: the usual one, or one that fits each driven joint of a
    user's model.
    """

    def fields(plant: Plant, duration: float) -> Data:
        if not plant.has_user_joints:
            return {"actuator": usual}
        parts = list(map(fit, _joint_sizes(plant)))
        if len(set(parts)) == 1:
            return {"actuator": parts[0]}
        by_joint = zip(channel_names(plant), parts, strict=False)
        return {"actuator": dict(by_joint)}

    return fields


def _backlash(joint: JointSize) -> Backlash:
    """Return the study's play and rotor as shares of the way and of the inertia."""
    rotor = max(ROTOR_SHARE * joint.inertia, MIN_INERTIA)
    return Backlash(0.01 * min(1.0, joint.travel / BESIDE), rotor_inertia=rotor)


def _elastic(plant: Plant, duration: float) -> Data:
    """Return springs between joints and rotors: with the resonance of the study's, as a multiple of
    the rate at which the bound moves the joint by the longest way of all.
    """
    if plant.pose:
        return {"actuator": ElasticJoint(1.0)}  # which the caller refuses
    parts = []
    joints = _joint_sizes(plant)
    way = max(joint.travel for joint in joints)
    for joint in joints:
        rotor = max(ELASTIC_ROTOR * joint.inertia, MIN_INERTIA)
        moving = rotor * joint.inertia / (rotor + joint.inertia)
        ratio = joint.limit / (joint.inertia * way)
        omega = RESONANCE * math.sqrt(ratio)
        damping = 2.0 * STRUCTURAL_DAMPING * omega * moving
        numbers = (moving * omega**2, damping, rotor)
        parts.append(ElasticJoint(*(float(f"{number:.3g}") for number in numbers)))
    if len(set(parts)) == 1:
        return {"actuator": parts[0]}
    by_joint = zip(channel_names(plant), parts, strict=False)
    return {"actuator": dict(by_joint)}


def _motor_side(plant: Plant, duration: float) -> Data:
    """Return the same, where the controller reads the rotors, without error."""
    encoder = Encoder(counts=math.inf, side="motor")
    seen = {"sensor": encoder, "velocity": estimator("measured")}
    return {**_elastic(plant, duration), **seen}


def _encoder(plant: Plant, duration: float) -> Data:
    """Return the study's encoder; on a user's model with as many counts on the shortest way as it
    has on 0.3 rad, or more.
    """
    way = BESIDE
    if plant.has_user_joints:
        way = min(BESIDE, *(joint.travel for joint in _joint_sizes(plant)))
    return {"sensor": Encoder(counts=math.ceil(4096 * BESIDE / way))}


def _motor(joint: JointSize) -> DCMotor:
    """Return as many default motors in parallel as the bound is times the study's; with less gear
    where the joint accelerates faster than the study's, so that the rotors are no heavier beside
    it.
    """
    gear = min(1.0, STUDY_ACCELERATION * joint.inertia / joint.limit)
    motor = dataclasses.replace(DCMotor(), gear=gear * DCMotor.gear)
    return motor.side_by_side(joint.limit / U_MAX / gear)


# cli/names.py reads the names from the text
IDEAL: dict[str, Recipe] = {
    "nominal": {},
    "noise": {"noise": SENSOR_NOISE},
    "sine": _disturbed(lambda half: SINE),
    "constant": _disturbed(lambda half: Constant(0.2)),
    "step": _disturbed(lambda half: Step(0.2, time=half)),
    "pulse": _disturbed(lambda half: Pulse(2.0, time=half, width=0.1)),
    "process_noise": _disturbed(lambda half: OrnsteinUhlenbeck(sigma=0.2, tau=0.1)),
    "delay_1ms": {"input_delay": 0.001},
    "delay_5ms": {"input_delay": 0.005},
    "delay_10ms": {"input_delay": 0.01},
    "delay_20ms": {"input_delay": 0.02},
    "delay_50ms": {"input_delay": 0.05},
    "light": {"mismatch": {"mass": 0.7}},
    "heavy": {"mismatch": {"mass": 1.3}},
    "jump_mild": _jump("mild"),
    "jump_hard": _jump("hard"),
    "period_10ms": {"control_period": 0.01},
    "period_20ms": {"control_period": 0.02},
    "period_50ms": {"control_period": 0.05},
    "differenced_5ms": {"velocity": DIFFERENCED},
    "differenced_5ms_noise": {"velocity": DIFFERENCED, "noise": Noise(position=0.01)},
}
REAL: dict[str, Recipe] = {
    "friction": _rubbing(lambda level, plant: (Coulomb(level), Viscous(0.5 * level))),
    "coulomb": _rubbing(lambda level, plant: Coulomb(level)),
    "lugre": _rubbing(_bristles),
    "stiction": _each_joint("friction", _sticking),
    "lag_20ms": {"actuator": Lag(0.02)},
    "dc_motor": _fitted(DCMotor(), _motor),
    "stepper": _stepper,
    "backlash": _fitted(Backlash(0.01), _backlash),
    "elastic": _elastic,
    "motor_side": _motor_side,
    "encoder": _encoder,
    "jitter": {"clock": Clock(jitter=0.5e-3)},
    "missed": {"clock": Clock(missed=0.1)},
    "contact": _contact,
    "fault": _fault,
}

OTHER_DELAY = re.compile(r"delay_([0-9.]+)ms")
NAMED: dict[str, Condition] = {
    name: Condition(name, fields) for name, fields in (IDEAL | REAL).items()
}
