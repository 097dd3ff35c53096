"""A scenario: everything that defines a run, as plain data, checked when it is made.

A field that was left out is None if its default depends on other fields; `scenario.resolved` has
the default. The fields plant, mismatch, jump, friction, contact, actuator and sensor set the true
mechanism. The law knows at most the plant's nominal parameters.
"""

import copy
import dataclasses
import functools
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar

import mujoco
import numpy as np

from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.constraints import Number, OneOf, Seed, of_fields, suggesting
from smc_mujoco.common.errors import ScenarioError, find, shown, warn_once
from smc_mujoco.common.mjcb import compiled
from smc_mujoco.common.text import joined
from smc_mujoco.control import nominal_gains
from smc_mujoco.control.component import Template, gain_text
from smc_mujoco.control.estimator import Estimator, estimator
from smc_mujoco.control.law import Law, joint_catalogue, suits
from smc_mujoco.control.surface import Surface
from smc_mujoco.control.written import StateFeedback
from smc_mujoco.mechanisms.hardware.contact import Obstacle, kinds
from smc_mujoco.mechanisms.hardware.drives import in_series
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.hardware.feedforward import Feedforward
from smc_mujoco.mechanisms.hardware.friction import DryFriction, LuGre
from smc_mujoco.mechanisms.hardware.moments import Torque
from smc_mujoco.mechanisms.hardware.part import Actuator, Friction, NominalDrive, Part, chains
from smc_mujoco.mechanisms.hardware.rotors import Rotors, flies
from smc_mujoco.mechanisms.layout import channel_names, drive_ids, driven_names, loaded, moves_alone
from smc_mujoco.mechanisms.plant import MAX_EXCESS, Plant, check_ranges
from smc_mujoco.simulation import coerce, integration
from smc_mujoco.simulation.coerce import MIN_TIME
from smc_mujoco.simulation.philox import PROCESS
from smc_mujoco.simulation.signals import (
    Clock,
    Constant,
    Dryden,
    Fault,
    Impulse,
    Jump,
    Noise,
    OrnsteinUhlenbeck,
    PerChannel,
    Push,
    Signal,
    extremes,
)

MAX_TIME = 1e9  # s, of runs
U_MAX = 6.0  # N or N m, chosen: the bound of every study here
# Fields that no scenario of a free body sets, with their words
NOT_OF_FREE_BODIES = {
    "friction": "friction except on a joint that you name",
    "actuator": "actuator, as its thrusters are its drives",
    "sensor": "sensor, as sensors measure joints",
    "feedforward": "feedforward",
    "clock": "clock with late or missed samples",
    "velocity": "estimated velocity",
}
MAX_STEPS = 100_000_000  # per run: minutes of computing
MAX_VALUES = 20_000_000  # control samples times channels: a trace of about 1 GB
LOST_SHARE = 0.05  # of a duration that is no whole number of periods, before it is told; chosen
MAX_LATENESS = 0.3  # stiffness times step over damping of bristles; chosen: joints rest 20 % off
MAX_ANGLE = (
    3.0 * math.pi
)  # rad: chosen; swing-ups stay below 1.5 turns, and a larger number may be degrees
MAX_DEGREES = 720.0  # chosen; a number above this is not taken for degrees
LONG_TIME = 1.0  # s; chosen: an input delay or a control period that is as long may be in ms
LARGE_FACTORS = 15.0, 1000.0  # chosen: a mismatch between them may be in percent
MAX_CONDITION_NUMBER = 1e12  # of a mass matrix; chosen: its inverse has 4 digits

Out = TypeVar("Out")


def field(convert: Callable[..., Out], default: Any = dataclasses.MISSING) -> Out:
    """Return a dataclass field; `convert`, a function of `coerce`, makes its value from what the
    user gives.
    """
    return dataclasses.field(default=default, metadata={"convert": convert})


@suggesting
@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Scenario:
    """Everything that defines a run. SI units; angles in radians.

    Attributes:
      plant: a Plant or the name of one.
      law: a Law (`smc.law(name, **gains)` or your own), or the name of one. To give each driven
        channel its own, give a list in the channels' order, or a mapping from the joints' names;
        u_max and reference take these forms, too. Default of all three: what the plant's channels
        suggest, see `smc.Channel`.
      model: what the law may know of the plant: "none", or its "nominal" f and g, for x'' = f + g
        u. Default: "nominal" for a law that requires it, else "none". "true" is for controls, as no
        controller knows it: f and g of the true parameters, with the forces of disturbances,
        friction and contacts on the joint in f.
      surface: a Surface or the name of one, for laws that take one. None: the law's own, de + c e.
      duration: s. The run lasts as many whole control periods as fit into it.
      control_period: s between two runs of the law. The command is held in between.
      physics_step: s; must divide the control period. Default: the largest such step up to 0.25 ms
        with friction (without `exact_friction`), contact, a mechanism or a plant that is not
        `smooth`, half of that with a Backlash, else up to 1 ms; always up to a quarter of the
        clock's jitter, and as fine as the oscillation of an ElasticJoint needs. On your own model
        only friction needs 0.25 ms, a contact 0.5 ms; fast poles and hard constraints need as much,
        see docs/accuracy.md. Where 1 ms holds, a drive whose force changes within a control period
        may lower it, to a quarter of that period or half of the drive's time constant, whichever is
        longer.
      u_max: bound on |u|, N or N m; may be infinite. Default: 6; of your own model the limit of the
        strongest motor, or what a joint without a limit needs: twice its load, (60/s^2 M + 8/s D)
        times its way, and 1.5 times its dry friction. A motor's own limit holds too: see `limits`.
        If u is a voltage, the bound is in V; its default is the motor's.
      x0, v0: initial state, rad or m and rad/s or m/s: one number, or one per channel. Default: the
        plant's x0; v0 = 0.
      reference: r(t), the same for every channel, or one for each driven channel; joints that a
        mapping leaves out hold their default. Default: the plant's `rest`, or 0.
      feedforward: what is added to the law's u before its bound: a Feedforward, which compensates
        friction; or a known signal, the same for every driven channel, such as an excitation, or
        the command of a recorded experiment (with the law "none"). None: nothing is added.
      disturbance: d(t) on every driven channel: one signal, or several to be added, or None. On one
        joint acts a Fault's bias, on a body a Push.
      noise: measurement noise, or None.
      input_delay: s; a whole number of physics steps. Before the first command arrives, u is 0.
      clock: the controller's Clock: its samples may come late or be missed. None: all are on time.
      velocity: an Estimator of the velocity that the law sees, or the name of one. Default:
        "measured", or "filtered_difference" with an encoder, which measures no velocity.
      mismatch: parameter name -> factor on the true plant's parameter. For a parameter in
        `plant.added`, such as a payload in kg, the value is added instead. `mass` is the plant's
        mass.
      jump: a change of the true plant's parameters in mid-run, or None.
      fault: a Fault of one or all actuators in mid-run: less gain, a bias, or stuck. Or None.
      tracks: "position", or "speed" for a speed loop: then x' is scored and drawn against r', so
        that settling time, overshoot and bounds are of the speed. The law reads the same.
      seed: of every random number of the run, 0 .. 2^53 - 1.
      integrator: RK4, Euler, implicitfast or implicit. Default: RK4 for the plant's plain equation,
        also behind a Lag, a RateLimit or a DCMotor, with `exact_friction`, and for your own model;
        else implicitfast, as with LuGre, a Backlash, or poles of your model that make RK4 unstable.
      friction: in addition to the plant's own: Viscous, Coulomb, LuGre, Sigmoid, or several of
        them, on the joints that an actuator drives, with their numbers in the unit of each. By
        name, {"slide": Coulomb(0.1), "hinge": Viscous(1e-4)}, any joint has its own, and "*" is all
        of them.
      contact: what the mechanism touches: a kind that the plant offers, such as "stops", or a
        hardware.Contact of one; Stops, a Wall, a Ball, which any plant takes; several; or "none".
      mechanism: "equation", or the name of another mechanism that the plant offers.
      actuator: what is between command and joint: a drive (Lag, RateLimit, DCMotor), or a Lag and
        another drive; a Backlash or an ElasticJoint may follow. None: the command is the force. u
        is limited to u_max before the drives. By name, {"shoulder": DCMotor(), "elbow": Lag(0.01)},
        a driven joint has its own.
      sensor: an Encoder, or None: position and velocity as they are, with `noise`. By name, too.
      condition: name of the run's condition in a grid, set by `named`; dataclasses.replace drops
        it.

    A field that is left out stays None, also under dataclasses.replace, so that its default follows
    the other fields. `resolved` is the same scenario with its defaults. Scenarios whose resolved
    fields are equal are equal, and give the same trace to the last bit.

    Raises:
      ScenarioError: a value out of its range, or values that do not fit together, in one sentence.

    Warns:
      ScenarioWarning: a start or a reference that may be in degrees, a delay in ms, a mismatch in
        percent; LuGre bristles that are too stiff for the physics step; or a DCMotor that cannot
        hold a joint where it starts, though a force of u_max could.
    """

    # other names of fields -> the field, for the error that an unknown field raises
    synonyms: ClassVar[Mapping[str, str]] = {
        "controller": "law",
        "system": "plant",
        "dt": "control_period",
        "delay": "input_delay",
    }

    # converted in this order
    plant: Plant = field(coerce.plant)
    law: Law = field(coerce.laws, None)
    model: Annotated[str, OneOf(names=coerce.MODELS)] | None = None
    surface: Surface | None = field(coerce.surface, None)
    duration: Annotated[float, Number(above=0.0, high=MAX_TIME)] = 10.0
    control_period: Annotated[float, Number(low=MIN_TIME)] = 1e-3
    physics_step: float | None = field(coerce.physics_step, None)
    u_max: float | tuple[float, ...] | None = field(coerce.bound, None)
    x0: tuple[float, ...] | None = field(coerce.state, None)
    v0: tuple[float, ...] | None = field(coerce.state, None)
    reference: Signal | None = field(coerce.reference, None)
    feedforward: Signal | Feedforward | None = field(coerce.feedforward, None)
    disturbance: tuple[Signal, ...] = field(coerce.disturbance, None)
    noise: Noise = field(
        coerce.instance(Noise, "smc.Noise(position=..., velocity=...)", Noise()), None
    )
    input_delay: float = field(coerce.input_delay, 0.0)
    clock: Clock = field(coerce.instance(Clock, "smc.Clock(jitter=..., missed=...)", Clock()), None)
    velocity: Estimator | None = field(coerce.velocity, None)
    mismatch: Mapping[str, float] = field(coerce.mismatch, None)
    jump: Jump | None = field(coerce.instance(Jump, "smc.Jump(time=..., factors=...)"), None)
    fault: Fault | None = field(coerce.instance(Fault, "smc.Fault(at=..., gain=...)"), None)
    tracks: Annotated[str, OneOf(names=("position", "speed"))] = "position"
    seed: Seed = 0
    integrator: Annotated[str, OneOf(names=coerce.INTEGRATORS)] | None = None
    friction: tuple[Friction, ...] = field(coerce.friction, None)
    contact: tuple[Obstacle, ...] = field(coerce.contact, None)
    mechanism: str = field(coerce.mechanism, "equation")
    actuator: tuple[Actuator, ...] = field(coerce.actuator, None)
    sensor: Encoder | tuple[Encoder, ...] | None = field(coerce.sensor, None)
    condition: str | None = dataclasses.field(default=None, init=False, repr=False)

    if TYPE_CHECKING:  # what the converters take, which a type checker cannot see

        def __init__(
            self,
            *,
            plant: Plant | str,
            law: coerce.Laws | None = None,
            model: str | None = None,
            surface: Surface | Template | str | None = None,
            duration: float = 10.0,
            control_period: float = 1e-3,
            physics_step: float | None = None,
            u_max: float | coerce.ByChannel[float] | None = None,
            x0: float | Sequence[float] | None = None,
            v0: float | Sequence[float] | None = None,
            reference: Signal | coerce.ByChannel[Signal] | None = None,
            feedforward: Signal | Feedforward | None = None,
            disturbance: Signal | Sequence[Signal] | None = None,
            noise: Noise | None = None,
            input_delay: float = 0.0,
            clock: Clock | None = None,
            velocity: Estimator | Template | str | None = None,
            mismatch: Mapping[str, float] | None = None,
            jump: Jump | None = None,
            fault: Fault | None = None,
            tracks: str = "position",
            seed: int = 0,
            integrator: str | None = None,
            friction: coerce.Frictions | None = None,
            contact: Obstacle | str | Sequence[Obstacle | str] | None = None,
            mechanism: str = "equation",
            actuator: coerce.Actuators | None = None,
            sensor: coerce.Sensors | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        self._convert()
        check(self.resolved)
        check_ranges(self.plant.name, self.plant.ranges, self.resolved.x0)
        check_reference_ranges(self.resolved)
        check_inertia(self.resolved)
        check_obstacles(self.resolved)
        check_names(self.resolved)
        warn_once(next(_doubts(self.resolved), ""))
        own = self.plant.is_user_model and self.force_command
        if own and self.u_max is None and self.law.name != "none":
            warn_once(_assumed_bound(self.plant, self.limits))

    @classmethod
    def recorded(cls, **fields: Any) -> "Scenario":
        """Make the scenario of a recorded run, without warnings and without checks that are newer
        than the run.
        """
        scenario = object.__new__(cls)
        for f in dataclasses.fields(cls):
            vars(scenario)[f.name] = fields.get(f.name, f.default)
        scenario._convert()
        check(scenario.resolved)
        return scenario

    def _convert(self) -> None:
        """Convert every field from what the user gave."""
        declared = of_fields(Scenario)
        for f in dataclasses.fields(self):
            value = getattr(self, f.name)
            if convert := f.metadata.get("convert"):
                vars(self)[f.name] = convert(f.name, value, self)  # the class is frozen
            elif f.name in declared:
                vars(self)[f.name] = declared[f.name](f.name, value)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scenario) and self.resolved._values() == other.resolved._values()

    def __hash__(self) -> int:
        return hash(self.resolved._values())

    def _values(self) -> tuple:
        """Return all fields that decide the run."""
        return tuple(getattr(self, name) for name in self.fields())

    def __getstate__(self) -> dict[str, Any]:
        # a copy resolves again
        return {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}

    @cached_property
    def resolved(self) -> "Resolved":
        """This scenario with the defaults that depend on other fields."""
        resolved = object.__new__(Resolved)
        vars(resolved).update(self.__getstate__() | _defaults(self))
        return resolved

    def _repr_html_(self) -> str:
        """Return plant, law, duration and the fields that differ from their defaults, in SI
        units.
        """
        from smc_mujoco.common import html

        parameters = ", ".join(
            f"{name} = {value:g}" for name, value in self.plant.parameters.items()
        )
        rows = {
            "plant": f"{self.plant.name} ({parameters})",
            "law": self.law,
            "gains": self.law.source,
        }
        for name, value in {"duration": self.duration, **self.given}.items():
            rows[name.replace("_", " ")] = shown(value)
        return html.fields(rows, "Scenario")

    @property
    def given(self) -> dict[str, Any]:
        """The fields that differ from their defaults, without plant and law."""
        absent = (None, (), {}, Noise(), Clock())  # of fields that were left out
        found = {}
        for f in dataclasses.fields(self):
            value = getattr(self, f.name)
            if f.name not in ("plant", "law") and value != f.default and value not in absent:
                found[f.name] = value
        return found

    @classmethod
    def fields(cls) -> tuple[str, ...]:
        """Return the names of the fields that can be set."""
        return tuple(f.name for f in dataclasses.fields(cls) if f.init)

    def named(self, condition: str | None) -> "Scenario":
        """Return this scenario with a name for its condition.

        Tables show it; the run is the same.
        """
        scenario = copy.copy(self)
        object.__setattr__(scenario, "condition", condition)
        return scenario

    @property
    def realistic(self) -> bool:
        """Whether the mechanism is more than the plant's equation."""
        return bool(self.actuator) or not self.plain_equation

    @property
    def plain_equation(self) -> bool:
        """Whether MuJoCo integrates only the plant's equation, with or without drives."""
        if self.friction or self.contact or self.mechanism != "equation":
            return False
        smooth = self.plant.smooth and not self.plant.rubs
        return smooth and all(part.smooth for part in self.actuator)

    @property
    def exact_friction(self) -> bool:
        """Whether the callback gives RK4 the moments of dry friction in each step, see
        `friction.dry_step`.

        It knows all other forces on joints that move alone: behind lags and rate limits, and for
        friction by a formula also behind a DC motor without cogging and ripple. In other scenarios
        Coulomb friction is MuJoCo's, and so is what holds joints with a formula.
        """
        return bool(self.exact_parts)

    @cached_property
    def exact_parts(self) -> tuple[Part, ...]:
        """The parts that do this; () without `exact_friction`."""
        dry = [part.exact for part in self.friction if not part.smooth]
        if self.plant.rubs:
            dry.append(DryFriction())
        exact = tuple(dict.fromkeys(dry))
        # the dry friction in the model is of all joints, and takes no formula beside it
        if not exact or None in exact or (len(exact) > 1 and DryFriction() in exact):
            return ()
        if self.contact or self.mechanism != "equation":
            return ()
        if self.integrator not in (None, "RK4") or not moves_alone(self.plant):
            return ()
        if any(isinstance(d, Push) for d in self.disturbance):
            return ()
        for actuator in self.actuator:
            if not all(part.behind(actuator) for part in exact):
                return ()
        return exact

    @cached_property
    def acting(self) -> tuple[tuple[Part, str], ...]:
        """The parts that the callback simulates, in the order in which they act, with what they do:
        "act", "force", "brake" or "stage_force", see hardware/moments.py.
        """
        drives: list[Part] = [Rotors()] if flies(self.plant) else []
        s = self.resolved
        drives += in_series(self.chains, s.physics_step, s.integrator == "RK4")
        acting = []
        for part in (*drives, *self.actuator):
            if part.act is not None:
                acting.append((part, "act"))
            elif part.force is not None:
                acting.append((part, "force"))
        for part in self.friction:
            if part in self.exact_parts:
                continue
            for kind in ("force", "brake"):
                if getattr(part, kind) is not None:
                    acting.append((part, kind))
        return (*acting, *((part, "stage_force") for part in self.exact_parts))

    @cached_property
    def chains(self) -> list[tuple[Actuator, ...]]:
        """The actuators of each driven channel, in series."""
        if not self.actuator:
            return [()] * self.plant.driven
        return chains(self.actuator, driven_names(self.plant))

    @cached_property
    def motors(self) -> list[Actuator]:
        """The motor of each driven channel whose u is no force; else an Actuator that does
        nothing.
        """
        found = []
        for chain in self.chains:
            special = (part for part in chain if part.unit or part.accelerates)
            found.append(next(special, Actuator()))
        return found

    @property
    def sensors(self) -> tuple[Encoder, ...]:
        """The encoders."""
        return coerce.as_tuple(self.sensor)

    def encoder(self, i: int) -> Encoder | None:
        """Return the encoder of channel i."""
        return next((part for part in self.sensors if i in part.channels(self.plant)), None)

    @property
    def accelerates(self) -> bool:
        """Whether u is an acceleration, of any joint."""
        return any(part.accelerates for part in self.actuator)

    @property
    def force_command(self) -> bool:
        """Whether u is a force."""
        return not any(part.unit or part.accelerates for part in self.actuator)

    @property
    def efforts(self) -> tuple[str, ...]:
        """Unit of u in each channel, (n,): that of the joint's force, "V", or that of its
        acceleration.
        """
        efforts = list(self.plant.efforts)
        for i, motor in enumerate(self.motors):
            efforts[i] = motor.unit or efforts[i]
            if motor.accelerates:
                efforts[i] = f"{self.plant.units[i]}/s^2"
        return tuple(efforts)

    @cached_property
    def limits(self) -> tuple[float, ...]:
        """The bound on |u| of each driven channel, in the unit of u: the lesser of u_max and the
        motor's limit.
        """
        bounds = self.resolved.u_max
        if not isinstance(bounds, tuple):
            bounds = (bounds,) * self.plant.driven
        limits = self.plant.limits or bounds
        found = []
        for motor, bound, limit in zip(self.motors, bounds, limits, strict=True):
            if motor.accelerates:  # the plant's limits are of a force
                found.append(bound)
            elif motor.unit:
                found.append(min(bound, motor.bound or math.inf))
            else:
                found.append(min(bound, limit))
        return tuple(found)

    @property
    def known_signal(self) -> Signal | None:
        """The feedforward that is a signal."""
        return self.feedforward if isinstance(self.feedforward, Signal) else None

    @property
    def compensated(self) -> tuple[Friction, ...]:
        """The frictions that the feedforward compensates."""
        given = self.feedforward
        return given.friction if isinstance(given, Feedforward) else ()  # pyright: ignore[reportReturnType]

    @property
    def references(self) -> tuple[Signal, ...]:
        """The reference of each driven channel; of all if it names measured channels."""
        reference = self.resolved.reference
        if isinstance(reference, PerChannel):
            return reference.signals
        return (reference,) * self.plant.driven

    @property
    def scored_channels(self) -> tuple[int, ...]:
        """The plant's `scored_channels`; all if the reference names measured channels."""
        if self.plant.measured and len(self.references) == self.plant.n:
            return tuple(range(self.plant.n))
        return self.plant.scored_channels

    @cached_property
    def steps(self) -> int:
        """Physics steps per control period."""
        return round(self.control_period / self.resolved.physics_step)

    @cached_property
    def samples(self) -> int:
        """K, the number of control periods; a trace has K + 1 samples."""
        return math.floor(self.duration / self.control_period + 1e-6)

    @cached_property
    def stages(self) -> int:
        """Callbacks per physics step: one for each stage of the integrator."""
        return 4 if self.resolved.integrator == "RK4" else 1

    @property
    def readings(self) -> int:
        """How many delayed readings of the sensor MuJoCo keeps."""
        step = self.resolved.physics_step
        return max((sensor.readings(step, self.plant.n) for sensor in self.sensors), default=0)

    @cached_property
    def delay_steps(self) -> int:
        """The input delay in physics steps."""
        return round(self.input_delay / self.resolved.physics_step)

    @property
    def fault_step(self) -> int:
        """The first physics step with the fault; beyond all steps without one."""
        if self.fault is None:
            return 2**62
        return math.ceil(self.fault.at / self.resolved.physics_step - 1e-6)

    def failing(self) -> int:
        """Return the index of the actuator that the fault is on; -1 for all."""
        if self.fault is None or self.fault.on is None:
            return -1
        names = driven_names(self.plant)
        if self.plant.pose:
            model = loaded(self.plant)
            names = [model.actuator(i).name for i in drive_ids(model).tolist()]
        return find("actuator of Fault", self.fault.on, dict(zip(names, itertools.count())))

    @property
    def jump_step(self) -> int:
        """The first physics step with the parameters of the jump; -1 without a jump."""
        if self.jump is None:
            return -1
        return math.ceil(self.jump.time / self.resolved.physics_step - 1e-6)

    @property
    def torques(self) -> list[Torque]:
        """What MuJoCo's actuator of each driven channel makes of its control in a step with
        `exact_friction`.
        """
        found = []
        for chain in self.chains:
            even = [
                part.mujoco_torque(self.resolved.physics_step, True) for part in chain if part.even
            ]
            found.append(even[0] if even else Torque())
        return found

    @property
    def scales(self) -> list[float]:
        """The control of the actuator of each driven channel, per unit of u."""
        return [math.prod(part.scale for part in chain) for chain in self.chains]

    @property
    def work(self) -> int:
        """Physics steps times channels: a measure of the run's cost."""
        return self.samples * self.steps * self.plant.n

    def noise_stream(self, i: int) -> int:
        """The number of the random stream of disturbance i; 0 for a disturbance without
        randomness.
        """
        random = [d.random for d in self.disturbance]
        return PROCESS + sum(random[:i]) if random[i] else 0

    @cached_property
    def nominal_drives(self) -> list[NominalDrive]:
        """The actuator of each channel, (n,), in the nominal model: its force is gain u - drag
        v.
        """
        return [motor.nominal for motor in self.motors] + [NominalDrive()] * self.plant.free

    def factors(self, step: int) -> dict[str, float]:
        """Return parameter -> its factor at a physics step; for parameters in `plant.added`, the
        number added.
        """
        factors = dict(self.mismatch)
        if self.jump is not None and step >= self.jump_step:
            for name, factor in self.jump.factors.items():
                if name in self.plant.added:
                    factors[name] = factors.get(name, 0.0) + factor
                else:
                    factors[name] = factors.get(name, 1.0) * factor
        return factors


class Resolved(Scenario):
    """A scenario with all defaults: these fields are not None."""

    model: str
    physics_step: float
    u_max: float | tuple[float, ...]  # pyright: ignore[reportIncompatibleVariableOverride]
    x0: tuple[float, ...]  # pyright: ignore[reportIncompatibleVariableOverride]
    v0: tuple[float, ...]  # pyright: ignore[reportIncompatibleVariableOverride]
    reference: Signal  # pyright: ignore[reportIncompatibleVariableOverride]
    velocity: Estimator  # pyright: ignore[reportIncompatibleVariableOverride]
    integrator: str

    def _convert(self) -> None:
        super()._convert()
        vars(self).update(_defaults(self))

    @property
    def resolved(self) -> "Resolved":  # pyright: ignore[reportIncompatibleVariableOverride]
        """The scenario itself."""
        return self


def _defaults(s: Scenario) -> dict[str, Any]:
    """Return the defaults of the fields that are None, and the law with what it takes from the
    plant.
    """
    x0 = s.plant.x0
    if "bobs" in kinds(s.contact):  # pendulums in a row must not start beyond each other
        x0 = tuple(sorted(x0))
    defaults = {
        "model": "nominal" if s.law.requires_model else "none",
        "physics_step": s.control_period / integration.default_steps(s),
        "u_max": _default_bound(s),
        "x0": x0,
        "v0": (0.0,) * s.plant.n,
        "reference": coerce.suggested_reference(s.plant),
        "velocity": estimator("measured" if s.sensor is None else "filtered_difference"),
        "integrator": integration.default_integrator(s),
    }
    missing = {name: value for name, value in defaults.items() if getattr(s, name) is None}
    return missing | {"law": nominal_gains.at_plant(s.law, s.plant)}


def _default_bound(s: Scenario) -> float | tuple[float, ...]:
    """Return the default of u_max: of each joint that of its motor, or what the plant suggests."""
    suggested = suggested_u_max(s.plant)
    if not any(part.bound is not None for part in s.actuator):
        return suggested
    bounds = list(suggested) if isinstance(suggested, tuple) else [suggested] * s.plant.driven
    for i, motor in enumerate(s.motors):
        bounds[i] = bounds[i] if motor.bound is None else motor.bound
    return tuple(bounds) if len(set(bounds)) > 1 else bounds[0]


def suggested_u_max(plant: Plant) -> float | tuple[float, ...]:
    """Return what the plant's channels suggest, or the default bound; one number if all channels
    have the same.
    """
    given = plant.suggested.get("u_max", (None,) * plant.driven)
    limits = [default_u_max(plant)] * len(given)
    # the bound of one joint's motor is no other's
    if _unbounded(plant):
        limits = _limits(plant)
    bounds = []
    for limit, bound in zip(limits, given, strict=True):
        bounds.append(limit if bound is None else bound)
    return tuple(bounds) if len(set(bounds)) > 1 else bounds[0]


def default_u_max(plant: Plant) -> float:
    """Return the bound on |u| where none is given, N or N m: the limit of the plant's strongest
    motor, else 6, or what a user's joint needs.
    """
    return max(_limits(plant), default=U_MAX)


def _limits(plant: Plant) -> list[float]:
    """Return the limits of the plant's motors; where a user's model has none, what a joint
    needs.
    """
    if not _unbounded(plant):
        return [limit for limit in plant.limits if limit < math.inf]
    from smc_mujoco.mechanisms.custom.scales import needs

    limits = plant.limits or (math.inf,) * plant.driven
    return [
        n if limit == math.inf else limit for n, limit in zip(needs(plant), limits, strict=True)
    ]


def _unbounded(plant: Plant) -> bool:
    """Return whether nothing bounds the force on some joint of a user's model."""
    bounded = plant.limits and math.inf not in plant.limits
    return plant.is_user_model and not plant.pose and not bounded


def check(s: Resolved) -> None:
    """Raise ScenarioError for fields that do not fit together."""
    check_clock(s)
    check_signals(s)
    check_law(s)
    check_mechanism(s)


def check_clock(s: Resolved) -> None:
    """Check that the delay is a whole number of steps, the jump is within the run, and the trace
    fits into memory.
    """
    delay = s.input_delay / s.physics_step
    if abs(delay - round(delay)) > 1e-6 or (delay > 0.0 and round(delay) == 0):
        raise ScenarioError(
            f"input_delay {s.input_delay:g} s is not a whole number of physics steps of "
            f"{s.physics_step:g} s: give a physics_step that divides it"
        )
    if s.samples < 1:
        raise ScenarioError(
            f"duration {s.duration:g} s is shorter than one control period of {s.control_period:g} "
            "s: give a longer one"
        )
    if s.samples * s.steps > MAX_STEPS or (s.samples + 1) * s.plant.n > MAX_VALUES:
        raise ScenarioError(
            f"duration {s.duration:g} s is {s.samples:.3g} control samples of {s.plant.n} channels "
            f"and {s.samples * s.steps:.3g} physics steps: give a shorter duration or longer "
            f"periods (at most {MAX_VALUES:.0e} values and {MAX_STEPS:.0e} steps)"
        )
    times = {"jump": s.jump and s.jump.time, "fault": s.fault and s.fault.at}
    for name, time in times.items():
        if time is not None and time >= s.duration:
            raise ScenarioError(
                f"{name} at {time:g} s comes after the end of the run at {s.duration:g} s: give an "
                "earlier time"
            )
    s.failing()  # refuses an unknown one
    for sensor in s.sensors:
        sensor.check(s.physics_step)
    s.clock.check(s.control_period, s.physics_step)


def check_signals(s: Resolved) -> None:
    """Check that the signals can be disturbances and a reference, and that none is shorter than a
    step.
    """
    for d in s.disturbance:
        shortest = s.plant.n * s.duration / max(MAX_STEPS, s.work)  # between knots, s
        if isinstance(d, OrnsteinUhlenbeck | Dryden) and d.dt < shortest:
            raise ScenarioError(
                f"{type(d).__name__}'s dt {d.dt:g} s makes too many knots: give {shortest:.3g} s "
                "or more"
            )
        if isinstance(d, Impulse) and d.width < s.physics_step:
            raise ScenarioError(
                f"{shown(d)} is shorter than a physics step of {s.physics_step:g} s: widen it"
            )
    for signal in (*s.disturbance, s.known_signal):
        if getattr(signal, "about", ""):
            raise ScenarioError(f"{shown(signal)} is about the goal: only a reference may be")
    if any(isinstance(signal, PerChannel) for signal in (*s.disturbance, s.known_signal)):
        raise ScenarioError(
            "only a reference may have a signal for each channel: give one signal for all"
        )
    for d in s.disturbance:
        if d.air and not flies(s.plant):
            raise ScenarioError(
                f"disturbance {shown(d)} is a wind, and {s.plant.name} has no drag: give a force, "
                "or plant 'quadrotor'"
            )
    for push in [d for d in s.disturbance if isinstance(d, Push)]:
        find(f"body of {s.plant.name} in a Push", push.body, dict.fromkeys(bodies(s.plant)))
    forces = [d for d in s.disturbance if d.cartesian and not isinstance(d, Push)]
    if forces and s.plant.direct and not s.plant.pose:
        raise ScenarioError(
            f"disturbance {shown(forces[0])} is a force on a body, and disturbances of "
            f"{s.plant.name} act on its joints: give another signal"
        )
    for signal in dict.fromkeys(s.references):
        check_function_of_time("reference", signal, "a smooth signal")
    if s.known_signal:
        check_function_of_time("feedforward", s.known_signal, "a known signal of u")


def check_reference_ranges(s: Resolved) -> None:
    """Check that each reference stays within its joint's range."""
    if not s.plant.ranges:
        return
    for (joint, low, high), signal in zip(s.plant.ranges, s.references, strict=False):
        least, most = extremes(signal, s.duration)
        if not low - MAX_EXCESS <= least <= most <= high + MAX_EXCESS:
            raise ScenarioError(
                f"the reference of joint {joint!r} of {s.plant.name} goes from {least:.4g} to "
                f"{most:.4g}, beyond its range from {low:g} to {high:g}: give another reference"
            )


def check_function_of_time(name: str, signal: Signal, cure: str) -> None:
    """Check that a signal is a number that only time decides."""
    kinds = {
        "a force": signal.cartesian,
        "a wind": signal.air,
        "noise": signal.random,
        "one that sees the loop": signal.sees,
    }
    for kind, applies in kinds.items():
        if applies:
            raise ScenarioError(f"{name} is {type(signal).__name__}, which is {kind}: give {cure}")


@functools.lru_cache(maxsize=32)
def bodies(plant: Plant) -> tuple[str, ...]:
    """Return the names of a plant's bodies."""
    model = loaded(plant)
    return tuple(name for i in range(1, model.nbody) if (name := model.body(i).name))


def check_law(s: Resolved) -> None:
    """Check that the law suits the plant, and the surface the law."""
    check_channels(s)
    check_free_body(s)
    if s.model == "true" and (s.law.joint or s.jump or s.accelerates or s.clock.jitter):
        raise ScenarioError(
            "model 'true' does not go with a law of many joints, a jump, acceleration as u or a "
            "clock with jitter: leave that out, or give model='nominal'"
        )
    for law in s.law.parts:
        if not suits(law, s.plant):
            cure = f"smc-mujoco list --plant {s.plant.argument} lists those for it"
            if s.plant.is_user_model and suits(
                law, dataclasses.replace(s.plant, underactuated=True)
            ):
                cure = "give each channel a partner"
            raise ScenarioError(
                f"law {law.name!r} is only for {', '.join(law.plants)}, not for {s.plant.name}: "
                f"{cure}"
            )
    if s.model != "none" and s.plant.unmodelled:
        raise ScenarioError(f"{s.plant.name} has no nominal model: {s.plant.unmodelled}")
    for law in s.law.parts:
        if s.surface is not None:
            check_surface(s.surface, law)
        period = getattr(law.function, "control_period", None)  # of a discrete controller
        if period is not None and abs(s.control_period - period) > 1e-9 * period:
            raise ScenarioError(
                f"law {law.name!r} is discretised for {period:g} s, and control_period is "
                f"{s.control_period:g} s: give control_period={period:g}, or the controller of "
                "continuous time"
            )


def check_surface(surface: Surface, law: Law) -> None:
    """Check that surface and law both have a sliding variable of relative degree 1."""
    if not law.relative_degree == surface.relative_degree == 1:
        raise ScenarioError(
            f"surface {surface.name!r} has relative degree {surface.relative_degree}, and law "
            f"{law.name!r} {law.relative_degree}: leave the surface out, or give a surface and a "
            "law of relative degree 1"
        )


def check_channels(s: Resolved) -> None:
    """Check that the law has as many numbers of each gain as channels, and that a law of many
    joints can run.
    """
    for name, value in s.law.gains.items():
        if isinstance(value, tuple) and len(value) != s.plant.driven:
            raise ScenarioError(
                f"gain {name} of {s.law.name} has {len(value)} values, {gain_text(value)}, and "
                f"{s.plant.name} has {s.plant.driven} driven channels: give one number, or "
                f"{s.plant.driven}"
            )
    if not s.law.joint:
        return
    plant = s.plant
    joints = getattr(s.law.function, "joints", s.plant.n)
    sized = f"write it for {plant.n}, with SMC_JOINTS, or --joints of export-c"
    driven = plant.driven
    if isinstance(s.law.function, StateFeedback):
        sized = f"give a K of {driven} x {2 * plant.n}"
        driven = len(s.law.function.K)
    for refused, why in (
        (
            plant.n == 1,
            f"{plant.name} has one: give a law of one channel, such as 'computed_torque'",
        ),
        (
            joints != plant.n,
            f"its code is for {joints}, where {plant.name} has {plant.n}: {sized}",
        ),
        (
            driven != plant.driven,
            f"drives {driven}, where {plant.name} drives {plant.driven}: {sized}",
        ),
        (
            plant.free and s.law.name in joint_catalogue(),
            f"drives all of them, and {plant.name} has {plant.free} without an actuator: give a "
            "law of your own, smc.design.lqr or smc.law_from(K)",
        ),
        (
            plant.free and s.model != "none" and not plant.by_mujoco,
            f"{plant.name} has no mass matrix for it: give model='none'",
        ),
        (s.surface is not None, "has its own surface: leave the surface out"),
    ):
        if refused:
            raise ScenarioError(f"law {s.law.name!r} is of many joints, and {why}")


def check_free_body(s: Resolved) -> None:
    """Check that a law, a signal or a part suits a free body, whose attitude is one thing of three
    numbers.
    """
    if s.plant.pose and s.tracks == "speed":
        raise ScenarioError(
            f"{s.plant.name} is a free body, which tracks a pose: leave tracks='speed' out"
        )
    if s.plant.base >= 0 and s.sensor is not None:
        raise ScenarioError(
            f"the base of {s.plant.name} is measured, and a sensor is of joints: leave sensor out"
        )
    if not s.plant.pose:
        return
    # the law of a trace may have no code
    if not s.law.joint and s.law.name != "none" and s.law.function is not None:
        raise ScenarioError(
            f"law {s.law.name!r} is of one channel, and {s.plant.name} is a free body, whose "
            "channels turn together: give a law of many joints, such as 'geometric'"
        )
    given = {name: (words, getattr(s, name)) for name, words in NOT_OF_FREE_BODIES.items()}
    taken = {
        "clock": not s.clock.regular,
        "velocity": s.velocity.name != "measured",
        "friction": not all(part.on for part in s.friction),
    }
    refused = [words for name, (words, value) in given.items() if taken.get(name, bool(value))]
    if any(d.sees for d in s.disturbance):
        refused.append("disturbance that sees the loop")
    if refused:
        raise ScenarioError(
            f"{s.plant.name} is a free body, which takes no {refused[0]}: leave that out"
        )


def check_inertia(s: Resolved) -> None:
    """Check that the nominal M of a law of many joints can be inverted at the start."""
    if s.law.joint and s.model != "none" and s.plant.by_mujoco:
        M = s.plant.nominal.dynamics(np.array(s.x0), np.array(s.v0), s.plant.values({})).M
        if not np.linalg.cond(M) < MAX_CONDITION_NUMBER:
            raise ScenarioError(
                f"the mass matrix of {s.plant.name} is singular at x0 {shown(s.x0)}, as where two "
                "joints move the same bodies in the same way: drive one of them, or give another "
                "x0"
            )


def check_obstacles(s: Resolved) -> None:
    """Check that a run does not start beyond a stop or in a wall, nor a user's model inside what
    it does not start in by itself.
    """
    if s.plant.is_user_model and s.x0 != s.plant.x0:
        from smc_mujoco.mechanisms.custom.clearance import DEPTH, overlap

        inside = overlap(s.plant, s.x0)
        if inside.depth > max(DEPTH, overlap(s.plant, s.plant.x0).depth):
            raise ScenarioError(
                f"x0 {shown(s.x0)} of {s.plant.name} has {inside}: give another x0, or starts "
                "with less spread"
            )
    for part in s.contact:
        if met := part.meets(s.plant, s.x0):
            raise ScenarioError(f"x0 of {s.plant.name} has {met}: give another x0, or more room")


def check_names(s: Resolved) -> None:
    """Check that no parameter is named twice, once by its own name and once as the mass."""
    for name, factors in (("mismatch", s.mismatch), ("Jump", s.jump.factors if s.jump else {})):
        if s.plant.mass != "mass" and {"mass", s.plant.mass} <= factors.keys():
            both = f"{s.plant.mass} {factors[s.plant.mass]:g} and mass {factors['mass']:g}"
            raise ScenarioError(
                f"{name} has {both}, which are the same parameter of {s.plant.name}: give one of "
                "them"
            )


def check_mechanism(s: Resolved) -> None:
    """Check that the integrator suits the parts, and that mechanism and contact suit the parameters
    at any time.
    """
    states = [part for part in s.friction if part.keeps_state or part.force is not None]
    if s.integrator == "RK4" and states and not s.exact_friction:
        raise ScenarioError(
            f"integrator RK4 has four stages in a step, and the state of {shown(states[0])} moves "
            "once a step: leave the integrator out"
        )
    for chain in dict.fromkeys(s.chains):
        for part in chain:
            part.suits(s, chain)
    for part in s.friction:
        part.check(s.plant)
    if isinstance(s.feedforward, Feedforward):
        s.feedforward.check(s.plant)
        if s.accelerates:
            raise ScenarioError(
                "Feedforward gives a force, and u is an acceleration: leave feedforward out"
            )
    for step in (0, s.samples * s.steps):
        values = s.plant.values(s.factors(step))  # raises for those that the plant cannot have
        if s.mechanism != "equation":
            model = mechanism_model(s.plant, s.mechanism)
            list(s.plant.mechanisms[s.mechanism].fields(model, values))  # raises, too
        for (name, value), kind in itertools.product(s.plant.placed.items(), kinds(s.contact)):
            if (present := getattr(values, name)) != value:
                raise ScenarioError(
                    f"the obstacles of contact {kind!r} of {s.plant.name} are placed for "
                    f"{name} = {value:g}, and {name} is {present:g}: leave {name} as it is"
                )


@functools.lru_cache(maxsize=16)
def mechanism_model(plant: Plant, name: str) -> mujoco.MjModel:
    """Return the model of a mechanism that a plant offers."""
    spec = plant.spec()
    plant.mechanisms[name].edit(spec)
    return compiled(spec)


def _doubtful_units(s: Resolved) -> Iterator[str]:
    """Yield a sentence about each number that may be in ms or percent."""
    for what in ("input_delay", "control_period"):
        if (seconds := getattr(s, what)) >= LONG_TIME:
            yield f"{what} is {seconds:g} s: if it is {seconds:g} ms, give {seconds / 1e3:g}"
    for name, factor in s.mismatch.items():
        low, high = LARGE_FACTORS
        if low <= factor <= high and name not in s.plant.added:
            fact = f"the true {name} of {s.plant.name} is {factor:g} times the nominal one"
            yield f"{fact}: if it is {factor:g} % more, give {1.0 + factor / 100.0:g}"


def _unreachable_goals(s: Resolved) -> Iterator[str]:
    """Yield a sentence about each obstacle that a constant reference runs into."""
    constant = all(isinstance(signal, Constant) for signal in s.references)
    if not constant or s.law.name == "none":
        return
    goal = [signal.parameters()["amplitude"] for signal in s.references]
    goal += s.plant.goal or s.plant.origin[s.plant.driven :]
    for part in s.contact:
        if met := part.meets(s.plant, goal):
            yield (
                f"the reference of {s.plant.name} has {met}, so that it is not reached: give "
                "another reference or more room, unless it is to lean there"
            )


def _doubts(s: Resolved) -> Iterator[str]:
    """Yield a sentence about each number that may be in degrees, ms or percent, each motor that is
    too weak, and bristles that are too stiff.
    """
    for part in s.friction:
        # of the library's plants, softer bristles are those of a named condition or of a rig
        if isinstance(part, LuGre) and (part.stiffness > LuGre.stiffness or s.plant.is_user_model):
            damping = part.damping
            if damping is None:
                model = loaded(s.plant)
                damping = part.default_damping(model.dof_M0[part.dofs(model)].min())
            if part.stiffness * s.physics_step > MAX_LATENESS * damping:
                yield (
                    f"LuGre's bristles of stiffness {part.stiffness:g} and damping {damping:.3g} "
                    f"are too stiff for a physics step of {s.physics_step:g} s: MuJoCo bends them "
                    "a step late, and joints rest at wrong places. Give a physics_step of "
                    f"{0.1 * MAX_LATENESS * damping / part.stiffness:.1g} or less, or softer ones"
                )
    lasts = s.samples * s.control_period
    if abs(lasts - s.duration) > LOST_SHARE * s.duration:
        yield (
            f"duration {s.duration:g} s is not a whole number of control periods of "
            f"{s.control_period:g} s, so the run lasts {lasts:g} s: give a duration of "
            f"{lasts:g} or {lasts + s.control_period:g} s"
        )
    yield from _doubtful_units(s)
    yield from _unreachable_goals(s)
    # ramps may have many turns
    amplitudes = [signal.parameters().get("amplitude", 0.0) for signal in s.references]
    for what, values in (("x0", s.x0), ("the reference's amplitude", amplitudes)):
        for unit, value in zip(s.plant.units, values, strict=False):
            if unit == "rad" and MAX_ANGLE < abs(value) <= MAX_DEGREES:
                fact = f"{what} is {value:g} rad, {abs(value) / math.tau:.1f} turns"
                yield f"{fact}: if it is {value:g} degrees, give math.radians({value:g})"
    for i, chain in enumerate(s.chains):
        for motor in [part for part in chain if part.stall is not None]:
            with np.errstate(all="ignore"):
                f, g = s.plant.nominal(np.array(s.x0), np.zeros(s.plant.n), i, s.plant.values({}))
            need = abs(f) / abs(g) if g else 0.0
            if (motor.stall or 0.0) < need and (need <= s.limits[i] or not s.force_command):
                yield (
                    f"{type(motor).__name__} gives at most {motor.stall:.3g} {s.plant.efforts[i]} "
                    f"at rest, and channel {i} of {s.plant.name} needs {need:.3g} to hold its "
                    "start: give a stronger motor, or more gear"
                )


def _assumed_bound(plant: Plant, limits: tuple[float, ...]) -> str:
    """Return a sentence on the joints of your own model whose force a default limits, or ""."""
    suggested = plant.suggested.get("u_max", (None,) * plant.driven)
    own = plant.limits or (math.inf,) * plant.driven
    free = [i for i, limit in enumerate(own) if limit == math.inf and suggested[i] is None]
    if not free:
        return ""
    joints = joined(repr(channel_names(plant)[i]) for i in free)
    bounds = joined(dict.fromkeys(f"{limits[i]:g} {plant.efforts[i]}" for i in free))
    what = "joint" if len(free) == 1 else "joints"
    example = f"u_max={limits[free[0]]:g}"
    if plant.driven > 1:
        example = f"smc.Channel({example}) for each"
    return (
        f"nothing limits the force on {what} {joints} of {plant.name}; |u| <= {bounds} is assumed "
        f"from its load and inertia: give u_max, the limit of your motor, such as {example}"
    )
