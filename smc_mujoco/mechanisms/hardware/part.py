"""Parts that make a mechanism realistic: edits of its model, and numbers in the model's fields.

A part is frozen data. `edit` adds objects to an MjSpec, such as a rotor, a stop, or an actuator
that acts as friction. `fields` yields the fields of the compiled model that the part's numbers set,
so that simulations with different numbers share one model in a Batch. What MuJoCo does not
simulate, a part does itself by compiled functions, see moments.py.
"""

import dataclasses
import math
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, NamedTuple, TypeVar

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.common.constraints import Number, OneOf, constrain
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.text import stated
from smc_mujoco.mechanisms.hardware.moments import Run, Torque
from smc_mujoco.mechanisms.layout import (
    ROTOR,
    channel_names,
    dof_ids,
    drive_actuators,
    drive_ids,
    driven_ids,
    driven_names,
    joints,
)
from smc_mujoco.mechanisms.plant import MAX_PARAMETER, Field, Plant

SIDES = "link", "motor"  # of an ElasticJoint or a Backlash
P = TypeVar("P", bound="OnJoints")

# The hardest constraint that MuJoCo offers: it reads a time constant of less than two steps as two
# steps.
HARD_SOLREF = (1e-9, 1.0)  # time constant in s, damping ratio
# impedance at and away from zero; equal, so the rest has no effect
HARD_SOLIMP = (0.9999, 0.9999, 0.001, 0.5, 2.0)

# Numbers of parts
Offset = Annotated[float, Number(low=-MAX_PARAMETER, high=MAX_PARAMETER)]
Natural = Annotated[float, Number(low=0.0, high=MAX_PARAMETER)]
Positive = Annotated[float, Number(above=0.0, high=MAX_PARAMETER)]


@dataclasses.dataclass(frozen=True)
class Part:
    """Base of all parts.

    What MuJoCo does not simulate is one of the functions here, see moments.py.
    """

    force: ClassVar[Callable[..., float] | None] = None
    stage_force: ClassVar[Callable[..., tuple[float, float]] | None] = None
    brake: ClassVar[Callable[..., tuple[float, float, float]] | None] = None
    act: ClassVar[Callable[..., None] | None] = None
    push: ClassVar[Callable[..., None] | None] = None
    read: ClassVar[Callable[..., tuple[float, float]] | None] = None
    # names of its numbers, by which these functions read a row of `numbers`
    names: ClassVar[tuple[str, ...]] = ("unused",)
    # units of its numbers; {f}, {x} and {m} are those of its joint's force, position and inertia
    units: ClassVar[Mapping[str, str]] = {}
    memory: ClassVar[int] = 0  # numbers that it keeps for each joint
    # name of its number that implicitfast counts as damping, beside a force held over a step
    counted: ClassVar[str] = ""
    is_drive: ClassVar[bool] = False  # whether its function gives the force of the drive
    sums_force: ClassVar[bool] = False  # whether it then adds it to the sum of a channel's state

    def __post_init__(self) -> None:
        constrain(self)

    @property
    def written(self) -> tuple[Any, int]:
        """The function of every stage that its author wrote, and the numbers that it may index."""
        return self.stage_force, self.memory

    def numbers(self, run: Run) -> list[Sequence[float]]:
        """Return the numbers of each joint, (n, names), or one row for all."""
        del run
        return [(0.0,)]

    def start(self, run: Run) -> list[Sequence[float]]:
        """Return the memory of each joint at the start of a run, (n, memory)."""
        return [(0.0,) * self.memory] * run.n

    def friction_rows(self, run: Run) -> dict[int, int]:
        """Return joint -> row of MuJoCo's constraints, of joints whose dry friction it sets.

        Raises:
          ScenarioError: flags of the model that turn dry friction off, or a jump that moves the
            rows.
        """
        del run
        return {}

    def channels(self, plant: Plant) -> Sequence[int]:
        """Return the channels on which its functions act; (-1,) if it acts on all at once."""
        return range(plant.n)

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Add the part's objects to a mechanism, for every channel."""

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        """Yield the fields of the edited, compiled model that the part's numbers set."""
        del model
        yield from ()

    def begin(self, model: mujoco.MjModel, act: np.ndarray) -> None:
        """Write its activations at the start of a run, where they are not 0, into those of all
        actuators, (na,).
        """

    def place(self, model: mujoco.MjModel, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Move what it has beside joints, from where these are at the start of a run."""

    def structure(self) -> Hashable:
        """Return a key that is equal for parts whose `edit` does the same: their simulations share
        a model.
        """
        return type(self)


@dataclasses.dataclass(frozen=True)
class OnJoints(Part):
    """Base of parts that a scenario gives to some joints, or to all that take one.

    Attributes:
      on: names of the joints that it acts on, as a scenario's mapping from joints to parts sets
        them; without any, the joints that an actuator drives.
    """

    on: tuple[str, ...] = dataclasses.field(default=(), kw_only=True)

    def __init_subclass__(cls) -> None:
        cls.__repr__ = OnJoints.__repr__  # dataclasses keep it

    def __post_init__(self) -> None:
        if isinstance(self.on, str):  # one name, else its letters would be names
            object.__setattr__(self, "on", (self.on,))
        super().__post_init__()

    def __repr__(self) -> str:
        words = [f"{name}={value!r}" for name, value in stated(self).items()]
        return f"{type(self).__name__}({', '.join(words)})"

    def structure(self) -> tuple[Hashable, ...]:
        return type(self), self.on

    def channels(self, plant: Plant) -> Sequence[int]:
        if not self.on:
            return range(plant.driven)
        return [channel_names(plant).index(name) for name in self.on]

    def joint_names(self, plant: Plant) -> tuple[str, ...]:
        """Return the names of the plant's joints that it acts on."""
        return self.on or driven_names(plant)


class Added(NamedTuple):
    """What a friction adds to each of its joints in the model."""

    damping: float = 0.0  # N m s/rad (N s/m)
    dry: float = 0.0  # dry friction, N m (N)
    per_speed: float = 0.0  # damping that the speed adds, N m s^2/rad^2 (N s^2/m^2)


@dataclasses.dataclass(frozen=True)
class Friction(OnJoints):
    """Base of frictions, which resist a joint's motion beside the plant's own damping.

    Attributes:
      side: "link": on the joint; "motor": on the rotor beside it, of an ElasticJoint or a Backlash,
        for Viscous, Coulomb and LuGre.
    """

    # Whether it keeps a state by which it holds a joint at rest: bristles, or the place where it
    # stuck. Not Coulomb, which is MuJoCo's alone. One at most on a joint.
    keeps_state: ClassVar[bool] = False
    smooth: ClassVar[bool] = False  # whether it is a damper, which RK4 integrates
    forces: ClassVar[tuple[str, ...]] = ()  # fields that its force is proportional to
    # two of its numbers, of which the second is the first or more; identification keeps them so
    ordered: ClassVar[tuple[str, ...]] = ()
    # (y, p, memory) -> the force that a joint needs to move against it at the steady speed y.v
    steady: ClassVar[Callable[..., float] | None] = None
    added_to_model: ClassVar[Added] = Added()

    side: Annotated[str, OneOf(names=SIDES)] = dataclasses.field(default="link", kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.side == "motor" and not (self.force is None and self.brake is None):
            raise ScenarioError(
                f"{type(self).__name__} acts on the joint, not on side 'motor': leave side out, or "
                "give Viscous, Coulomb or LuGre there"
            )

    def structure(self) -> tuple[Hashable, ...]:
        return *super().structure(), self.side

    def numbers(self, run: Run) -> list[Sequence[float]]:
        if self.steady is None:
            return super().numbers(run)
        return [self.parameters(0)]

    def parameters(self, i: int) -> tuple[float, ...]:
        """Return the numbers of its joint i."""
        del i  # they are the same for all
        return tuple(getattr(self, name) for name in self.names)

    def joints(self, spec: mujoco.MjSpec) -> list[mujoco.MjsJoint]:
        """Return the joints that it acts on."""
        named = [spec.joint(name) for name in self.on]
        on_joints = named or joints(spec)[: len(drive_actuators(spec))]
        if self.side == "motor":
            return [spec.joint(ROTOR + joint.name) for joint in on_joints]
        return on_joints

    def dofs(self, model: mujoco.MjModel) -> np.ndarray:
        """Return the degrees of freedom that it acts on."""
        if self.side == "motor":
            shafts = model.actuator_trnid[drive_ids(model), 0]
            driven = driven_ids(model)
            named = [model.joint(name).id for name in self.on] or driven
            return model.jnt_dofadr[shafts[np.isin(driven, named)]]
        named = [model.joint(name).dofadr[0] for name in self.on]
        return np.array(named or dof_ids(model)[: len(drive_ids(model))], int)

    def scaled(self, factor: float) -> "Friction":
        """Return this friction with a factor on its force."""
        if not self.forces:
            raise ScenarioError(
                f"{type(self).__name__} cannot be scaled: "
                "name its fields that are forces in `forces`"
            )
        scaled = {}
        for name in self.forces:
            value = getattr(self, name)
            if value is not None:
                scaled[name] = (factor * np.asarray(value)).tolist()
        return dataclasses.replace(self, **scaled)

    def check(self, plant: Plant) -> None:
        """Raise ScenarioError if it does not suit the plant."""

    def sticks(self, v: np.ndarray, force: np.ndarray) -> np.ndarray | None:
        """Return where a joint sticks, from its velocity and the force of friction, (K + 1,) each;
        None if it sticks where it is at rest.
        """
        del v, force

    @property
    def loss_of_load(self) -> Any:
        """The share of what it carries that it loses, also by joint, which compensation counts."""
        return 0.0

    @property
    def held(self) -> Any:
        """The part whose `force`, held over a step, is this friction; None if there is none."""
        return self if self.force is not None else None

    @property
    def exact(self) -> Any:
        """The part that gives the stages of RK4 this dry friction of joints that move alone, with a
        method `behind`; None if there is none.
        """
        return None


class NominalDrive(NamedTuple):
    """Force of an actuator as the law's model knows it: gain u - drag v."""

    gain: float = 1.0  # force per unit of u
    drag: float = 0.0  # force per unit of the joint's velocity


@dataclasses.dataclass(frozen=True)
class Actuator(OnJoints):
    """Base of actuators, which stand between the command u, such as the wanted force, a voltage or
    a set-point, and the joint.
    """

    drives: ClassVar[bool] = True  # whether it turns u into force; else it stands after a drive
    leads: ClassVar[bool] = False  # whether another drive may follow
    in_callback: ClassVar[bool] = False  # whether the callback simulates all of it

    scale: ClassVar[float] = 1.0  # control of the model's actuator per unit of u
    delay: ClassVar[float] = (
        0.0  # s, time constant with which the force follows a held u; 0 for none
    )
    lateness: ClassVar[float] = 0.0  # s, by which it gets its command late
    limited: ClassVar[bool] = False  # whether the rate of the force is limited
    # of u, where {x} stands for that of the joint; "" for that of the joint's force
    unit: ClassVar[str] = ""
    meaning: ClassVar[str] = ""  # what u is, in words, where tables say so; {x} as in `unit`
    accelerates: ClassVar[bool] = False  # whether u is the acceleration of the joint
    bound: ClassVar[float | None] = None  # on u, in its unit, if u is no force
    stall: ClassVar[float | None] = None  # N m (N), the largest force at rest; None: any
    has_moment: ClassVar[bool] = False  # whether RK4 gets the first moment of its force, too
    even: ClassVar[bool] = False  # whether `mujoco_torque` is all that it does
    smooth: ClassVar[bool] = True  # whether RK4 may integrate it
    nominal: ClassVar[NominalDrive] = NominalDrive()  # what the law's model knows of it

    # whether it is that of the plant's file, which a scenario with another plant leaves behind; a
    # copy with other numbers is not
    is_of_file: bool = dataclasses.field(
        default=False, init=False, compare=False, repr=False, kw_only=True
    )

    def of_file(self, on: tuple[str, ...]) -> "Actuator":
        """Return a copy on these joints that is marked as that of the plant's file."""
        copy = dataclasses.replace(self, on=on)
        object.__setattr__(copy, "is_of_file", True)  # as a frozen class sets what is no argument
        return copy

    def before(self, drive: "Actuator") -> bool:
        """Return whether it may stand before a drive of the same joint."""
        del drive
        return self.leads

    def drives_of(self, spec: mujoco.MjSpec) -> list[mujoco.MjsActuator]:
        """Return the actuators that it changes."""
        if not self.on:
            return drive_actuators(spec)
        drives = []
        for drive in drive_actuators(spec):
            if drive.target.removeprefix(ROTOR) in self.on:
                drives.append(drive)
        return drives

    def drive_ids(self, model: mujoco.MjModel) -> np.ndarray:
        """Return their indices in the compiled model."""
        ids = drive_ids(model)
        named = [model.joint(name).id for name in self.on]
        return ids[np.isin(driven_ids(model), named)] if named else ids

    def force_at(self, bound: float) -> float:
        """Return the largest force that a bound on |u| allows at rest, N m (N)."""
        return bound * self.nominal.gain

    def force_of(self, u: Array, x: Array, v: Array) -> Array:
        """Return the force of commands at positions and velocities, N m (N), as the nominal drive
        has it.
        """
        del x
        return self.nominal.gain * u - self.nominal.drag * v

    def longest_step(self, plant: Plant) -> float:
        """Return the longest default physics step beside it, s."""
        del plant
        return math.inf

    def mujoco_torque(self, step: float, rk4: bool) -> Torque:
        """Return how MuJoCo computes its force in a physics step, s."""
        del step, rk4
        return Torque()

    def suits(self, s: Any, chain: Sequence["Actuator"]) -> None:
        """Raise ScenarioError if it does not suit the other fields of a resolved scenario, or the
        actuators of a joint, of which it is one.
        """


def chains(parts: Sequence[P], joints: Sequence[str]) -> list[tuple[P, ...]]:
    """Return those of the parts that each joint has."""
    parts_by_joint = []
    for joint in joints:
        of_joint = tuple(part for part in parts if not part.on or joint in part.on)
        parts_by_joint.append(of_joint)
    return parts_by_joint
