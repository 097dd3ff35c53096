"""What users give for a scenario's fields, made into what the fields hold, or refused in one sentence."""

import functools
import math
from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError, number, shown, taken, unknown
from smc_mujoco.common.mjcb import compiled
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.estimator import estimator
from smc_mujoco.control.law import law
from smc_mujoco.control.surface import surface
from smc_mujoco.mechanisms.hardware.contact import Contact
from smc_mujoco.mechanisms.hardware.drives import Lag
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.hardware.part import Actuator, Friction, Part
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.signals import Signal

P = TypeVar("P", bound=Part)

INTEGRATORS = ("RK4", "Euler", "implicitfast", "implicit")
MODELS = ("none", "nominal")
LARGEST_STEP = 1e-3  # s; the ideal plants under RK4 follow their equations to 1e-9 at this step
REALISTIC_STEP = (
    2.5e-4  # s; what halving it changes is studied in tests/simulation/test_convergence.py and told in docs/design.md
)
U_MAX = 6.0  # N or N m; the study's
FAR = 1e6  # initial states beyond this have already diverged


class FilledVelocity(Component):
    """An estimator that was left out; dataclasses.replace finds it anew."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Component) and vars(self) == vars(other)

    def __hash__(self) -> int:
        return Component.__hash__(self)

    def __reduce__(self):
        return filled_velocity, (self.name,)


class FilledStart(tuple):
    """An x0 that was left out; dataclasses.replace finds it anew."""


def filled_velocity(name: str) -> FilledVelocity:
    """The estimator of that name with its default gains, marked as left out."""
    return FilledVelocity(**vars(estimator(name)))


class FilledNumber(float):
    """A physics step, or u_max, that was left out; dataclasses.replace finds it anew."""


class FilledName(str):
    """An integrator, or a model, that was left out; dataclasses.replace finds it anew."""


def component(value: object, kind: str) -> Component:
    """A law, a surface or an estimator, from one, its template or its name."""
    if isinstance(value, str):
        return {"law": law, "surface": surface, "estimator": estimator}[kind](value)
    if isinstance(value, Template):
        value = value()
    if isinstance(value, Component) and value.kind == kind:
        return value
    field = {"law": "law", "surface": "surface", "estimator": "velocity"}[kind]
    raise ScenarioError(f"{field} is {shown(value)}: give smc.{kind}(...), one of your own, or a name")


def velocity(value: object, sensor: Encoder | None) -> Component:
    """An estimator; the default one for the sensor where none is given."""
    if value is None or left_out(value):
        return filled_velocity("measured" if sensor is None else "filtered_difference")
    return component(value, "estimator")


def left_out(value: object) -> bool:
    """Whether a default was filled in that depends on other fields."""
    return isinstance(value, FilledNumber | FilledName | FilledVelocity | FilledStart)


def physics_step(step: object, period: float, realistic: bool, least: float) -> float:
    """A step that divides the control period; the default one where none is given."""
    if step is None or isinstance(step, FilledNumber):
        largest = REALISTIC_STEP if realistic else LARGEST_STEP
        return FilledNumber(period / math.ceil(period / largest - 1e-9))
    h = number("physics_step", step, above=0.0, least=least)
    count = period / h
    if count < 1.0 - 1e-9 or abs(count - round(count)) > 1e-6 * count:
        raise ScenarioError(f"physics_step {h:g} s does not divide the control period {period:g} s: give {period:g}/N")
    return period / round(count)


def u_max(value: object, plant: Plant) -> float:
    """A bound on |u|; the default one for the plant's motors where none is given."""
    if value is None or isinstance(value, FilledNumber):
        return FilledNumber(max((limit for limit in plant.limits if limit < math.inf), default=U_MAX))
    return number("u_max", value, above=0.0, infinite=True)


def integrator(name: object, realistic: bool) -> str:
    """The name of one of MuJoCo's integrators; the default one where none is given."""
    if name is None or isinstance(name, FilledName):
        return FilledName("implicitfast" if realistic else "RK4")
    if not isinstance(name, str) or name not in INTEGRATORS:
        raise unknown("integrator", name, INTEGRATORS)
    return name


def model(value: object, law: Component) -> str:
    """What the law may know of the plant, "none" or "nominal"; what it needs where nothing is said."""
    if value is None or isinstance(value, FilledName):
        return FilledName("nominal" if law.requires_model else "none")
    if not isinstance(value, str) or value not in MODELS:
        raise unknown("model", value, MODELS)
    return value


def start(value: object, plant: Plant, kind: str) -> tuple[float, ...]:
    """x0; where none is given the plant's own, in order from left to right where the pendulums stand in a row."""
    if value is None or isinstance(value, FilledStart):
        return FilledStart(sorted(plant.x0) if kind == "bobs" else plant.x0)
    return state("x0", value, plant.n)


def state(name: str, value: object, n: int) -> tuple[float, ...]:
    """n numbers, from one or n of them."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    items = taken(name, value) if isinstance(value, Iterable) and not isinstance(value, str | bytes) else [value]
    if len(items) == 1:
        items *= n
    if len(items) != n:
        raise ScenarioError(f"{name} has {len(items)} values for {n} channels: give one number or {n}")
    return tuple(number(name, item, least=-FAR, most=FAR) for item in items)


def signals(name: str, value: object) -> tuple[Signal, ...]:
    """Signals, from one, several or None; of references exactly one."""
    items: tuple[Any, ...] = several(value)
    for item in items:
        if not isinstance(item, Signal):
            raise ScenarioError(f"{name} is {shown(item)}: give a signal such as smc.Sine(amplitude=0.2, omega=5.0)")
    if name == "reference" and len(items) != 1:
        raise ScenarioError(f"reference is {shown(value)}: give one signal, such as smc.Constant(0.0)")
    return items


def parts(name: str, value: object, kind: type[P], example: str) -> tuple[P, ...]:
    """Parts of one kind, from one, several or None."""
    items = several(value)
    for item in items:
        if not isinstance(item, kind):
            raise ScenarioError(f"{name} is {shown(item)}: give one such as {example}, or several, or None")
    return items


def friction(value: object) -> tuple[Friction, ...]:
    """Frictions, no two of a kind, in one order, whatever the user's."""
    items = parts("friction", value, Friction, "smc.Coulomb(0.05)")
    _once("friction", items, [type(part).__name__ for part in items])
    return tuple(sorted(items, key=lambda part: type(part).__name__))


def actuator(value: object) -> tuple[Actuator, ...]:
    """A drive, or a Lag and another in series, in the user's order, and after them a Backlash."""
    items = parts("actuator", value, Actuator, "smc.Lag(0.01)")
    drives = [part for part in items if part.drives]
    _once("actuator", items, [type(part).__name__ for part in items if not part.drives])
    if len(drives) > 2:
        raise ScenarioError(f"actuator has {len(drives)} drives, {shown(items)}: give one, or two in series")
    if len(drives) == 2 and not isinstance(drives[0], Lag):
        raise ScenarioError(
            f"actuator has {shown(drives[0])} before {shown(drives[1])}, and of two drives in series the first is a "
            f"Lag: give one drive, or (smc.Lag(0.01), another)"
        )
    return tuple(sorted(items, key=lambda part: not part.drives))


def _once(name: str, items: tuple[Part, ...], kinds: list[str]) -> None:
    """Raise ScenarioError for two parts that would take each other's place."""
    if twice := [kind for kind in kinds if kinds.count(kind) > 1]:
        raise ScenarioError(f"{name} has a {twice[0]} twice, {shown(items)}: give one")


def contact_fits(contact: Contact, plant: Plant, factors: Mapping[str, float]) -> None:
    """Raise ScenarioError where a parameter has not the value for which the obstacles stand."""
    for name, value in plant.placed.items() if contact.kind != "none" else ():
        is_now = getattr(plant.values(factors), name)
        if is_now != value:
            raise ScenarioError(
                f"contact {contact.kind!r} of {plant.name} stands where {name} is {value:g}, and {name} is {is_now:g}: "
                f"leave {name} as it is"
            )


def contact(value: object, plant: Plant) -> Contact:
    """A contact that the plant offers, from one, its kind or None."""
    if value is None or isinstance(value, str):
        value = Contact("none" if value is None else value)
    if not isinstance(value, Contact):
        raise ScenarioError(f"contact is {shown(value)}: give smc.Contact(...) or one of {', '.join(plant.contacts)}")
    value.check(plant)
    return value


def mechanism(value: object, plant: Plant) -> str:
    """The name of a mechanism that the plant offers."""
    names = ["equation", *plant.mechanisms]
    if not isinstance(value, str) or value not in names:
        raise unknown(f"mechanism of {plant.name}", value, names)
    return value


def check_numbers(plant: Plant, name: str, factors: Mapping[str, float]) -> None:
    """Raise ScenarioError for parameter factors that a plant's mechanism cannot have."""
    values = plant.values(factors)
    if name != "equation":
        list(plant.mechanisms[name].fields(built(plant, name), values))


@functools.lru_cache(maxsize=16)
def built(plant: Plant, name: str) -> mujoco.MjModel:
    """A plant's other mechanism, compiled."""
    spec = plant.spec()
    plant.mechanisms[name].edit(spec)
    return compiled(spec)


def several(value: object) -> tuple[Any, ...]:
    """One, several or None as a tuple."""
    return () if value is None else tuple(value) if isinstance(value, tuple | list) else (value,)
