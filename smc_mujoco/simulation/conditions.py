"""Conditions: what a plant has to be controlled in, as named fields of a Scenario, for any plant.

    worn = smc.condition("worn gear", friction=smc.Coulomb(0.05), actuator=smc.Backlash(0.02))
    smc.grid(["duffing"], ["classical"], ["nominal", worn, "noise + delay_10ms"], seeds=16)

The suite's own have names, such as "noise"; `NAMED` has them. Those joined by "+" hold at once. As text a condition is
its name, a colon and its fields, written as in Python; that is parsed and never evaluated:

    worn gear: friction=Coulomb(0.05), sensor=Encoder(counts=4096)

The suite's levels are those of a machine of the study's size. 0.1 N m or N of friction is u_max / 60, the gap a worn
gear's, the lag a hydraulic valve's, the counts, per revolution or metre, an inexpensive encoder's; the pulse of
"contact", as strong as u_max, throws what can be thrown.
"""

import ast
import contextlib
import dataclasses
import inspect
import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from smc_mujoco.common import errors
from smc_mujoco.common.errors import ScenarioError, find, shown, unknown
from smc_mujoco.common.files import reading
from smc_mujoco.common.frozen import frozen
from smc_mujoco.control.component import Component
from smc_mujoco.control.estimator import catalogue as estimators
from smc_mujoco.control.estimator import estimator
from smc_mujoco.mechanisms.hardware.backlash import Backlash
from smc_mujoco.mechanisms.hardware.drives import DCMotor, Drive, Lag
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.hardware.friction import Coulomb, LuGre
from smc_mujoco.mechanisms.hardware.part import Actuator, Friction, Part
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.plant import catalogue as plants
from smc_mujoco.simulation.perturbations import Jump, Noise
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Constant, OrnsteinUhlenbeck, Pulse, Recorded, Signal, Sine, Step

Fields = Mapping[str, Any]

# What is of the plant, the law or the run, and of no condition.
OTHERS = ("plant", "law", "model", "surface", "seed", "duration")
FIELDS = [f.name for f in dataclasses.fields(Scenario) if f.init and f.name not in OTHERS]
SEVERAL = ("disturbance", "friction", "actuator")  # fields that add up where conditions are joined
BASES = (Part, Friction, Actuator, Drive, Signal, Recorded)  # of which there are none
CONSTANTS = {"inf": math.inf, "pi": math.pi}

SINE = Sine(amplitude=0.2, omega=5.0)
SENSOR_NOISE = Noise(position=0.01, velocity=0.05)
DIFFERENCED = estimator("filtered_difference", tau=5e-3)

# Plant -> parameter -> factor, at half time, with the sine disturbance: a mild and a hard one. Plants say them.
JUMP_MILD, JUMP_HARD = (
    {name: dict(plant.jumps[size]) for name, plant in plants().items() if size in plant.jumps}
    for size in ("mild", "hard")
)


@dataclasses.dataclass(frozen=True)
class Condition:
    """A named condition; see `condition`.

    Attributes:
      name: what tables and figures call it.
      fields: Scenario field -> value, or a function of the plant and the duration, s, that gives them.
    """

    name: str
    fields: Fields | Callable[[Plant, float], Fields]

    def __post_init__(self):
        if not callable(self.fields):
            object.__setattr__(self, "fields", frozen({name: _frozen(value) for name, value in self.fields.items()}))

    def on(self, plant: Plant, duration: float) -> dict[str, Any]:
        """The Scenario fields on a plant, in runs of that duration; what happens once does so at half time.

        Raises:
          ScenarioError: a condition that has no numbers for the plant.
        """
        return dict(self.fields(plant, duration) if callable(self.fields) else self.fields)

    def __add__(self, other: "Condition | str") -> "Condition":
        """Both at once. Disturbances, frictions and actuators add up; of any other field only one may say something."""
        both = self, find_condition(other)
        return Condition(" + ".join(one.name for one in both), lambda plant, duration: _joined(both, plant, duration))

    def __str__(self) -> str:
        """The text that `parsed` reads; the name alone of one of the suite's."""
        if self.name in NAMED or callable(self.fields):
            return self.name
        try:
            texts = {name: _text(value) for name, value in self.fields.items()}
        except Exception:  # of a user's value, whose repr fails or nests too deep; no scenario takes it either
            texts = {name: shown(value) for name, value in self.fields.items()}
        return f"{self.name}: " + ", ".join(f"{name}={text}" for name, text in texts.items())


def condition(name: str, **fields: Any) -> Condition:
    """A condition of your own, for `grid`, `tune`, `margins` and `basin`.

    Args:
      name: what tables and figures call it; not one of the suite's names.
      fields: of a Scenario, such as friction=smc.Coulomb(0.05); all but plant, law, model, surface, seed and duration.

    Raises:
      ScenarioError: a name that is taken, a field that there is not or that is none of a condition, or no field at all.
    """
    if errors.name("a condition's name", name) in NAMED or set(":+,") & set(name):
        raise ScenarioError(f"condition {shown(name)} is a name of the suite, or has one of : + , in it: give another")
    if not fields:
        raise ScenarioError(f"condition {name!r} has no fields: give some, such as friction=smc.Coulomb(0.05)")
    for field in fields:
        if field in OTHERS:
            raise ScenarioError(f"condition {name!r} sets {field}, which the grid itself says: leave it out")
        if field not in FIELDS:
            raise unknown("field of a Scenario", field, FIELDS)
    return Condition(name, fields)


def find_condition(value: Condition | str) -> Condition:
    """A Condition, from one, a name, several names joined by "+", or a condition's text.

    Raises:
      ScenarioError: none of these.
    """
    if isinstance(value, Condition):
        return value
    if not isinstance(value, str):
        raise ScenarioError(f"condition is {shown(value)}: give a name, or smc.condition(...)")
    if ":" in value:
        return parsed(value)
    if set("=(") & set(value):
        raise ScenarioError(f"condition {shown(value)} has no colon: write a name, a colon and fields, as worn: x0=0.3")
    found = [find("condition", part.strip(), NAMED) for part in value.split("+")]
    return sum(found[1:], start=found[0])


def suiting(names: Iterable[str], plants: Iterable[Plant], duration: float) -> list[str]:
    """Of the suite's conditions of these names, those that have numbers for each plant."""
    plants, found = list(plants), []
    for name in names:
        with contextlib.suppress(ScenarioError):
            for plant in plants:
                NAMED[name].on(plant, duration)
            found.append(name)
    return found


def parsed(text: str) -> Condition:
    """The condition that a text tells, such as "worn gear: friction=Coulomb(0.05)".

    Values are numbers, texts, lists, dicts, and calls of the suite's parts, signals and estimators, or of a user's own
    that are imported. Nothing is evaluated.

    Raises:
      ScenarioError: another text.
    """
    name, _, fields = text.partition(":")
    try:
        call = ast.parse(f"_({fields})", mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        call = None
    if not isinstance(call, ast.Call) or call.args or any(word.arg is None for word in call.keywords):
        cure = 'write it as "worn gear: friction=Coulomb(0.05), sensor=Encoder(counts=4096)"'
        raise ScenarioError(f"condition {shown(text)} cannot be read: {cure}")
    return condition(name.strip(), **_named(call))


def from_file(path: Path) -> list[Condition]:
    """The conditions of a text file, one a line; empty lines and those that begin with # say nothing.

    Raises:
      ScenarioError: a file or a line that cannot be read.
    """
    with reading(path, "file of conditions", "give a text file, a condition a line") as file:
        lines = [line.strip() for line in file.read_text(encoding="utf-8").splitlines()]
    found = []
    for number, line in enumerate(lines, 1):
        try:
            found += [find_condition(line)] if line and not line.startswith("#") else []
        except ScenarioError as error:
            raise ScenarioError(f"line {number} of {str(path)!r}: {error}") from None
    return found


def _value(node: ast.expr) -> Any:
    """The value that a literal, or the call of a part, a signal or an estimator, stands for."""
    if isinstance(node, ast.Constant):
        return node.value
    if isinstance(node, ast.Name) and node.id in CONSTANTS:
        return CONSTANTS[node.id]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return -errors.number("a value", _value(node.operand), infinite=True)
    if isinstance(node, ast.Tuple | ast.List):
        return tuple(_value(item) for item in node.elts)
    if isinstance(node, ast.Dict) and None not in node.keys:
        return {_value(k): _value(v) for k, v in zip(node.keys, node.values, strict=True) if k is not None}
    if isinstance(node, ast.Call):
        return _called(node)
    raise ScenarioError(
        f"condition has {shown(ast.unparse(node))}: give numbers, texts and parts such as Coulomb(0.05)"
    )


def _called(node: ast.Call) -> Any:
    """A part, a signal or an estimator with its numbers."""
    name = ast.unparse(node.func).removeprefix("smc.")
    kind = find("part, signal or estimator", name, _kinds() | estimators())
    values, named = [_value(value) for value in node.args], _named(node)
    try:
        return kind(*values, **named)
    except TypeError:
        known = list(inspect.signature(kind).parameters) if isinstance(kind, type) else list(kind.defaults)
        cure = f"it takes {', '.join(known) or 'nothing'}"
        raise ScenarioError(f"condition has {shown(ast.unparse(node))}: {cure}") from None


def _named(node: ast.Call) -> dict[str, Any]:
    """The named values of a call, each of them given once."""
    found: dict[str, Any] = {}
    for word in node.keywords:
        if str(word.arg) in found:
            raise ScenarioError(f"condition has {word.arg} twice, in {shown(ast.unparse(node))}: give it once")
        found[str(word.arg)] = _value(word.value)
    return found


def _kinds() -> dict[str, Any]:
    """Name -> class, of parts and signals, a user's own included; the suite's own go first where names are the same."""
    found: list[type] = [Noise, Jump]
    bases: list[type] = [Part, Signal]
    for base in bases:
        bases += base.__subclasses__()
    found += [kind for kind in bases if kind not in BASES]
    found.sort(key=lambda kind: kind.__module__.startswith("smc_mujoco."))
    return {kind.__name__: kind for kind in found}


def _text(value: Any) -> str:
    """A value as `parsed` reads it."""
    if isinstance(value, Component):
        return f"{value.name}({', '.join(f'{gain}={number!r}' for gain, number in value.gains.items())})"
    if isinstance(value, Part | Signal | Noise | Jump):
        shown_fields = (f for f in dataclasses.fields(value) if f.init)
        return f"{type(value).__name__}({', '.join(f'{f.name}={_text(getattr(value, f.name))}' for f in shown_fields)})"
    if isinstance(value, tuple):
        return f"({', '.join(map(_text, value))},)"
    return repr(value)


def _frozen(value: Any) -> Any:
    """A field's value that cannot change."""
    if isinstance(value, Mapping):
        return frozen(value)
    value = value.tolist() if isinstance(value, np.ndarray) else value
    return tuple(value) if isinstance(value, list) else value


def _joined(both: Iterable[Condition], plant: Plant, duration: float) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for one in both:
        for field, value in one.on(plant, duration).items():
            if field in found and field in SEVERAL:
                found[field] = (*_several(found[field]), *_several(value))
            elif field in found and not _same(found[field], value):
                names = " and ".join(repr(c.name) for c in both)
                raise ScenarioError(f"conditions {names} both set {field}: give one of them, or smc.condition(...)")
            else:
                found[field] = value
    return found


def _same(one: Any, other: Any) -> bool:
    """Whether two values are equal; those that do not compare, such as arrays, are not."""
    try:
        return bool(one == other)
    except Exception:
        return False


def _several(value: Any) -> tuple:
    return value if isinstance(value, tuple) else (value,)


def _jump(size: str) -> Callable[[Plant, float], Fields]:
    def fields(plant: Plant, duration: float) -> Fields:
        if size not in plant.jumps:
            known = [name for name, one in plants().items() if size in one.jumps]
            cure = f"choose another condition, or one of {', '.join(known)}"
            raise ScenarioError(f"condition 'jump_{size}' has no numbers for plant {plant.name!r}: {cure}")
        return {"disturbance": SINE, "jump": Jump(time=duration / 2, factors=plant.jumps[size])}

    return fields


def _contact(plant: Plant, duration: float) -> Fields:
    """A blow against what a plant may touch: its neighbours, or stops."""
    kinds = {kind: kind for kind in ("bobs", "stops") if kind in plant.contacts}
    if not kinds:
        raise ScenarioError(f"condition 'contact' asks for stops, and plant {plant.name!r} has none: choose another")
    return {"contact": next(iter(kinds)), "disturbance": Pulse(6.0, time=duration / 2, width=0.2)}


IDEAL: dict[str, Fields | Callable[[Plant, float], Fields]] = {
    "nominal": {},
    "noise": {"noise": SENSOR_NOISE},
    "sine": {"disturbance": SINE},
    "constant": {"disturbance": Constant(0.2)},
    "step": lambda plant, duration: {"disturbance": Step(0.2, time=duration / 2)},
    "pulse": lambda plant, duration: {"disturbance": Pulse(2.0, time=duration / 2, width=0.1)},
    "process_noise": {"disturbance": OrnsteinUhlenbeck(sigma=0.2, tau=0.1)},
    **{f"delay_{ms}ms": {"input_delay": ms * 1e-3} for ms in (1, 5, 10, 20, 50)},
    "light": {"mismatch": {"mass": 0.7}},
    "heavy": {"mismatch": {"mass": 1.3}},
    "jump_mild": _jump("mild"),
    "jump_hard": _jump("hard"),
    **{f"period_{ms}ms": {"control_period": ms * 1e-3} for ms in (10, 20, 50)},
    "differenced_5ms": {"velocity": DIFFERENCED},
    "differenced_5ms_noise": {"velocity": DIFFERENCED, "noise": Noise(position=0.01)},
}
REAL: dict[str, Fields | Callable[[Plant, float], Fields]] = {
    "coulomb": {"friction": Coulomb(0.1)},
    "lugre": {"friction": LuGre(coulomb=0.05, static=0.1, stribeck=0.05)},
    "lag_20ms": {"actuator": Lag(0.02)},
    "dc_motor": {"actuator": DCMotor()},
    "backlash": {"actuator": Backlash(0.01)},
    "encoder": {"sensor": Encoder(counts=4096)},
    "contact": _contact,
}

NAMED: dict[str, Condition] = {name: Condition(name, fields) for name, fields in (IDEAL | REAL).items()}
