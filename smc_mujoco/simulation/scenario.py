"""A scenario: everything that defines a run, as plain data, checked when it is made.

A field that was left out is None if its default depends on other fields; `scenario.resolved` has
the default. The fields plant, mismatch, jump, friction, contact, actuator and sensor set the true
mechanism. The law knows at most the plant's nominal parameters.
"""

import copy
import dataclasses
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar

from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.constraints import Number, OneOf, Seed, of_fields, suggesting
from smc_mujoco.common.errors import UnitWarning, find, shown, warn_once
from smc_mujoco.control import nominal_gains
from smc_mujoco.control.component import Template
from smc_mujoco.control.estimator import Estimator, estimator
from smc_mujoco.control.law import Law
from smc_mujoco.control.surface import Surface
from smc_mujoco.mechanisms.hardware.contact import Obstacle, kinds
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.hardware.feedforward import Feedforward
from smc_mujoco.mechanisms.hardware.part import Actuator, Friction, Part
from smc_mujoco.mechanisms.layout import drive_ids, driven_names, loaded
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import (
    acting_parts,
    coerce,
    doubts,
    force_bounds,
    integration,
    part_numbers,
    scenario_checks,
)
from smc_mujoco.simulation.coerce import MIN_TIME
from smc_mujoco.simulation.drive_train import DriveTrain
from smc_mujoco.simulation.philox import PROCESS
from smc_mujoco.simulation.signals import (
    Clock,
    Fault,
    Jump,
    Noise,
    PerChannel,
    Signal,
    common_period,
)

MAX_TIME = 1e9  # s, of runs

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
      law: a Law (`smc.law(name, **gains)` or your own), or the name of one. A name has the gains
        that are shipped for the plant, or else the law's defaults, which suit no machine of your
        own: tune them first. `smc.law(name)` always has the defaults. To give each driven channel
        its own, give a list in the channels' order, or a mapping from the joints' names; u_max and
        reference take these forms, too. Default of all three: what the plant's channels suggest,
        see `smc.Channel`.
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
        only friction needs 0.25 ms, a contact 0.5 ms; fast poles and hard constraints may need as
        much. `trace.unresolved` says what a step cannot resolve, and `smc.accuracy.step_halving`
        repeats runs with half of it. Where 1 ms holds, a drive whose force changes within a control
        period may lower it, to a quarter of that period or half of the drive's time constant,
        whichever is longer.
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
      disturbance: d(t) on every driven channel: one signal, or several to be added, or None. Of
        your own model it acts on the joint alone, as its motor does; of a plant of the library on
        the body that the joint carries, so that it moves other joints, too. On one joint acts a
        Fault's bias, on a body a Push.
      noise: measurement noise, or None. With an Encoder it is added to the position before that is
        rounded to counts.
      input_delay: s; a whole number of physics steps. Before the first command arrives, u is 0.
      clock: the controller's Clock: its samples may come late or be missed. None: all are on time.
      velocity: an Estimator of the velocity that the law sees, or the name of one. Default:
        "measured", or "filtered_difference" with an encoder, which measures no velocity.
      mismatch: parameter name -> factor on the true plant's parameter. For a parameter in
        `plant.added`, such as a payload in kg, the value is added instead. `mass` is what
        `plant.mass` names: of a double pendulum m2 alone. Your own model has numbers of its
        joints, as "elbow.damping", and payloads of its bodies, as "hand.payload", a point mass in
        kg at the body's centre of mass.
      jump: a change of the true plant's parameters, or of numbers of parts, in mid-run, or None.
      fault: a Fault of one or all actuators in mid-run: less gain, a bias, or stuck. Or None.
      tracks: "position", or "speed" for a speed loop: then x' is scored and drawn against r', so
        that settling time, overshoot and bounds are of the speed. The law reads the same. A speed
        of 3 rad/s is `smc.signals.Ramp(3.0)`; a Step of the position asks for the speed 0.
      seed: of every random number of the run, 0 .. 2^53 - 1.
      integrator: RK4, Euler, implicitfast or implicit. Default: RK4 for the plant's plain equation,
        also behind a Lag, a RateLimit or a DCMotor, with `exact_friction`, and for your own model;
        else implicitfast, as with LuGre, a Backlash, or poles of your model that make RK4 unstable.
      friction: in addition to the plant's own: Viscous, Coulomb, Stribeck, LuGre, or several of
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
        percent; a position as the reference of a speed loop; LuGre bristles that are too stiff for
        the physics step; or a DCMotor that cannot hold a joint where it starts, though a force of
        u_max could.
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
    law: Law = field(coerce.coerced_laws, None)
    model: Annotated[str, OneOf(names=coerce.MODELS)] | None = None
    surface: Surface | None = field(coerce.coerced_surface, None)
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
        scenario_checks.check_fields(self.resolved)
        scenario_checks.check_start(self.resolved)
        if slip := next(doubts.of_units(self.resolved), ""):
            warn_once(slip, UnitWarning)
        else:
            warn_once(next(doubts.of_values(self.resolved), ""))
        if self.u_max is None:
            warn_once(doubts.of_assumed_bound(self.resolved))

    @classmethod
    def recorded(cls, **fields: Any) -> "Scenario":
        """Make the scenario of a recorded run, without warnings and without checks that are newer
        than the run.
        """
        scenario = object.__new__(cls)
        for f in dataclasses.fields(cls):
            vars(scenario)[f.name] = fields.get(f.name, f.default)
        scenario._convert()
        scenario_checks.check_fields(scenario.resolved)
        return scenario

    def _convert(self) -> None:
        """Convert every field from what the user gave."""
        declared = of_fields(Scenario)
        converted = []
        for f in dataclasses.fields(self):
            if "convert" in f.metadata:
                converted.append(f)
            elif f.name in declared:
                raw = getattr(self, f.name)
                vars(self)[f.name] = declared[f.name](f.name, raw)
        for f in converted:  # these may depend on the others
            raw = getattr(self, f.name)
            value = f.metadata["convert"](f.name, raw, self)
            vars(self)[f.name] = value  # the class is frozen

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
        from smc_mujoco.common.tabular import of_fields

        texts = []
        for name, value in self.plant.parameters.items():
            texts.append(f"{name} = {value:g}")
        parameters = ", ".join(texts)
        rows = {
            "plant": f"{self.plant.name} ({parameters})",
            "law": self.law,
            "gains": self.law.source,
        }
        for name, value in {"duration": self.duration, **self.given}.items():
            rows[name.replace("_", " ")] = shown(value)
        return of_fields("Scenario", rows)._repr_html_()

    @property
    def given(self) -> dict[str, Any]:
        """The fields that differ from their defaults, without plant and law."""
        absent = (None, (), {}, Noise(), Clock())  # of fields that were left out
        fields = {}
        for f in dataclasses.fields(self):
            value = getattr(self, f.name)
            if f.name not in ("plant", "law") and value != f.default and value not in absent:
                fields[f.name] = value
        return fields

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
        return acting_parts.plain_equation(self)

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
        return acting_parts.exact_parts(self)

    @cached_property
    def acting(self) -> tuple[tuple[Part, str], ...]:
        """The parts that the callback simulates, in the order in which they act, with what they do:
        "act", "force", "brake" or "stage_force", see hardware/moments.py.
        """
        return acting_parts.acting(self)

    @cached_property
    def drive_train(self) -> DriveTrain:
        """The drives of each driven channel."""
        return DriveTrain(self)

    @property
    def accelerates(self) -> bool:
        """Whether u is an acceleration, of any joint."""
        return self.drive_train.accelerates

    @property
    def force_command(self) -> bool:
        """Whether u is a force."""
        return self.drive_train.force_command

    @property
    def efforts(self) -> tuple[str, ...]:
        """Unit of u in each channel, (n,): that of the joint's force, "V", or that of its
        acceleration or of its position.
        """
        return self.drive_train.efforts

    @cached_property
    def limits(self) -> tuple[float, ...]:
        """The bound on |u| of each driven channel, in the unit of u: the lesser of u_max and the
        motor's limit.
        """
        return self.drive_train.limits

    @property
    def sensors(self) -> tuple[Encoder, ...]:
        """The encoders."""
        return coerce.as_tuple(self.sensor)

    def encoder(self, i: int) -> Encoder | None:
        """Return the encoder of channel i."""
        return next((part for part in self.sensors if i in part.channels(self.plant)), None)

    @property
    def feedforward_signal(self) -> Signal | None:
        """The feedforward that is a signal."""
        return self.feedforward if isinstance(self.feedforward, Signal) else None

    @property
    def compensated(self) -> tuple[Friction, ...]:
        """The frictions that the feedforward compensates."""
        feedforward = self.feedforward
        return feedforward.frictions if isinstance(feedforward, Feedforward) else ()

    @property
    def references(self) -> tuple[Signal, ...]:
        """The reference of each driven channel; of all if it names measured channels."""
        reference = self.resolved.reference
        if isinstance(reference, PerChannel):
            return reference.signals
        return (reference,) * self.plant.driven

    @property
    def load_period(self) -> float:
        """The common period of disturbances and references, s; 0 if none is periodic, inf if they
        have none in common.
        """
        return common_period((*self.disturbance, *self.references))

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
        numbered = zip(names, itertools.count())
        return find("actuator of Fault", self.fault.on, dict(numbered))

    @property
    def jump_step(self) -> int:
        """The first physics step with the parameters of the jump; -1 without a jump."""
        if self.jump is None:
            return -1
        return math.ceil(self.jump.time / self.resolved.physics_step - 1e-6)

    @property
    def jump_sample(self) -> int:
        """The first sample at or after the jump; the number of samples without a jump."""
        if self.jump is None:
            return self.samples + 1
        return -(-self.jump_step // self.steps)

    @cached_property
    def _after_jump(self) -> "Scenario":
        """The scenario with the numbers that its parts have from the jump on."""
        after = object.__new__(type(self))
        vars(after).update(self.__getstate__())
        if self.jump is not None:
            changed = part_numbers.changed(self, self.jump.of_parts)
            vars(after).update(changed)
            vars(after)["jump"] = Jump(self.jump.time, self.jump.of_plant)
        return after

    @property
    def machines(self) -> tuple["Scenario", ...]:
        """The scenario with its parts as they are at the start, and as they are from the jump of
        their numbers on, if there is one.
        """
        if self.jump is None or not self.jump.of_parts:
            return (self,)
        return self, self._after_jump

    def machine(self, step: int) -> "Scenario":
        """Return the scenario with its parts as they are at a physics step."""
        return self.machines[-1 if step >= self.jump_step else 0]

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

    def factors(self, step: int) -> dict[str, float]:
        """Return parameter -> its factor at a physics step; for parameters in `plant.added`, the
        number added.
        """
        factors = dict(self.mismatch)
        if self.jump is not None and step >= self.jump_step:
            for name, factor in self.jump.of_plant.items():
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
    # each is made only where it is missing: steps and bounds take most of a scenario's time
    defaults = {
        "model": lambda: "nominal" if s.law.requires_model else "none",
        "physics_step": lambda: s.control_period / integration.default_steps(s),
        "u_max": lambda: force_bounds.default_bound(
            s, coerce.suggested_reference(s.plant) if s.reference is None else s.reference
        ),
        "x0": lambda: _start(s),
        "v0": lambda: (0.0,) * s.plant.n,
        "reference": lambda: coerce.suggested_reference(s.plant),
        "velocity": lambda: estimator("measured" if s.sensor is None else "filtered_difference"),
        "integrator": lambda: integration.default_integrator(s),
    }
    missing = {}
    for name, default in defaults.items():
        if getattr(s, name) is None:
            missing[name] = default()
    return missing | {"law": nominal_gains.at_plant(s.law, s.plant)}


def _start(s: Scenario) -> tuple[float, ...]:
    """Return the positions at which a run begins by default."""
    x0 = s.plant.x0
    if "bobs" in kinds(s.contact):  # pendulums in a row must not start beyond each other
        return tuple(sorted(x0))
    return x0
