"""A scenario: everything that defines a run, as plain data, checked when it is made.

What the true mechanism is (`plant`, `mismatch`, `jump`, and friction, contact, actuator and sensor) and what the law
may believe (the plant's nominal parameters) are kept apart. Two scenarios that are equal give the same trace to the
last bit.
"""

import copy
import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from smc_mujoco.common.errors import ScenarioError, number, shown, whole
from smc_mujoco.control.component import Template
from smc_mujoco.control.estimator import Estimator
from smc_mujoco.control.law import Law
from smc_mujoco.control.surface import Surface
from smc_mujoco.mechanisms.hardware.contact import Contact
from smc_mujoco.mechanisms.hardware.drives import Tandem, tandem
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.hardware.part import Actuator, Friction
from smc_mujoco.mechanisms.plant import Plant, plant
from smc_mujoco.simulation import coerce, consistency
from smc_mujoco.simulation.perturbations import Jump, Noise, parameter_factors
from smc_mujoco.simulation.philox import PROCESS
from smc_mujoco.simulation.signals import Constant, Signal

SHORTEST, LONGEST = 1e-9, 1e9  # s, of periods and of runs

REST, QUIET, FREE = Constant(0.0), Noise(), Contact("none")
MISSING: Any = None  # a field left out, filled in when the scenario is made


@dataclasses.dataclass(frozen=True, kw_only=True)
class Scenario:
    """Everything that defines a run. SI units; angles in radians.

    Attributes:
      plant: a Plant or the name of one.
      law: a Law (`smc.law(name, **gains)` or your own), or the name of one.
      model: what the law may know of the plant: "none", or its "nominal" f and g, for x'' = f + g u. Default: "none",
        and "nominal" for a law that cannot do without.
      surface: a Surface or the name of one, for the laws that take one; None: the law's own, de + c e.
      duration: s. The run lasts the whole control periods that fit into it.
      control_period: s; the law runs this often and its command is held in between.
      physics_step: s; must divide the control period. Default: the largest such step up to 1 ms for the plant's plain
        equation, up to 0.25 ms with friction, contact, a mechanism or an actuator.
      u_max: bound on |u|, N or N m; may be infinite. Default: 6, or of a model of yours whose motors have limits, what
        the strongest of those gives. A motor's own limit holds too: see `limits`.
      x0, v0: initial state, one number or n of them. Default: the plant's x0, and 0.
      reference: r(t), the same for every channel.
      disturbance: d(t), one signal or several to be added, or None.
      noise: measurement noise, or None.
      input_delay: s; a whole number of physics steps. Before the first command arrives, u is 0.
      velocity: the velocity the law sees: an Estimator or the name of one. Default: "measured", and with an encoder,
        which measures none, "filtered_difference".
      mismatch: parameter name -> factor on the true plant's parameter. `mass` is the plant's mass.
      jump: a change of the true plant's parameters in mid-run, or None.
      seed: of every random number of the run, 0 .. 2^53 - 1.
      integrator: RK4, Euler, implicitfast or implicit. Default: RK4 for the plant's plain equation, else implicitfast.
      friction: of every joint, beside the plant's own: Viscous, Coulomb, LuGre, or several of them.
      contact: what the mechanism touches: a Contact or its kind, one of those the plant offers, or "none".
      mechanism: "equation", or another build of the mechanism that the plant offers.
      actuator: between command and joint: a drive - Lag, RateLimit, DCMotor - or a Lag and another drive in series, in
        this order, and a Backlash after them; None: the command is the force. u is bounded before the drives.
      sensor: an Encoder, or None: position and velocity as they are, with `noise`.
      condition: what a grid calls the run's condition, see `named`; no argument, and gone where a field is replaced.

    Raises:
      ScenarioError: for anything out of its range, in one sentence.

    Warns:
      ScenarioWarning: a hinge's start or reference of more than one and a half turns, up to 720 rad, which may be meant
        in degrees; a phase, a v0 or a Backlash that may be in degrees too; a mismatch that may be in percent, a delay
        in ms; a DCMotor that cannot hold a joint where it starts, though a force of u_max could.
    """

    plant: Plant
    law: Law
    model: str = MISSING
    surface: Surface | None = None
    duration: float = 10.0
    control_period: float = 1e-3
    physics_step: float = MISSING
    u_max: float = MISSING
    x0: tuple[float, ...] = MISSING
    v0: tuple[float, ...] = MISSING
    reference: Signal = REST
    disturbance: tuple[Signal, ...] = ()
    noise: Noise = QUIET
    input_delay: float = 0.0
    velocity: Estimator = MISSING
    mismatch: Mapping[str, float] = MISSING
    jump: Jump | None = None
    seed: int = 0
    integrator: str = MISSING
    friction: tuple[Friction, ...] = ()
    contact: Contact = FREE
    mechanism: str = "equation"
    actuator: tuple[Actuator, ...] = ()
    sensor: Encoder | None = None
    condition: str | None = dataclasses.field(default=None, init=False, repr=False, compare=False)

    if TYPE_CHECKING:  # what the fields are made from; what they are stands above

        def __init__(
            self,
            *,
            plant: Plant | str,
            law: Law | Template | str,
            model: str | None = None,
            surface: Surface | Template | str | None = None,
            duration: float = 10.0,
            control_period: float = 1e-3,
            physics_step: float | None = None,
            u_max: float | None = None,
            x0: float | Sequence[float] | None = None,
            v0: float | Sequence[float] | None = None,
            reference: Signal = REST,
            disturbance: Signal | Sequence[Signal] | None = None,
            noise: Noise | None = None,
            input_delay: float = 0.0,
            velocity: Estimator | Template | str | None = None,
            mismatch: Mapping[str, float] | None = None,
            jump: Jump | None = None,
            seed: int = 0,
            integrator: str | None = None,
            friction: Friction | Sequence[Friction] | None = None,
            contact: Contact | str | None = None,
            mechanism: str = "equation",
            actuator: Actuator | Sequence[Actuator] | None = None,
            sensor: Encoder | None = None,
        ) -> None: ...

    def __post_init__(self):
        def put(name: str, value: object) -> None:
            object.__setattr__(self, name, value)

        put("plant", plant(self.plant) if isinstance(self.plant, str) else self.plant)
        if not isinstance(self.plant, Plant):
            raise ScenarioError(
                f"plant is {shown(self.plant)}: give smc.plant(...) or one of the names smc.plants() lists"
            )
        put("friction", coerce.friction(self.friction))
        put("contact", coerce.contact(self.contact, self.plant))
        put("mechanism", coerce.mechanism(self.mechanism, self.plant))
        put("actuator", coerce.actuator(self.actuator))
        if not isinstance(self.sensor, Encoder | None):
            raise ScenarioError(f"sensor is {shown(self.sensor)}: give smc.Encoder(counts=...) or None")
        put("law", coerce.component(self.law, "law"))
        put("model", coerce.model(self.model, self.law))
        put("surface", None if self.surface is None else coerce.component(self.surface, "surface"))
        put("velocity", coerce.velocity(self.velocity, self.sensor))
        put("duration", number("duration", self.duration, above=0.0, most=LONGEST))
        put("control_period", number("control_period", self.control_period, above=0.0, least=SHORTEST))
        put("u_max", coerce.u_max(self.u_max, self.plant))
        put("input_delay", number("input_delay", self.input_delay, least=0.0, most=self.duration))
        put("physics_step", coerce.physics_step(self.physics_step, self.control_period, self.realistic, SHORTEST))
        put("x0", coerce.start(self.x0, self.plant, self.contact.kind))
        put("v0", coerce.state("v0", 0.0 if self.v0 is None else self.v0, self.plant.n))
        put("reference", coerce.signals("reference", self.reference)[0])
        put("disturbance", coerce.signals("disturbance", self.disturbance))
        put("noise", QUIET if self.noise is None else self.noise)
        if not isinstance(self.noise, Noise):
            raise ScenarioError(f"noise is {shown(self.noise)}: give smc.Noise(position=..., velocity=...) or None")
        put("mismatch", parameter_factors("mismatch", {} if self.mismatch is None else self.mismatch))
        if not isinstance(self.jump, Jump | None):
            raise ScenarioError(f"jump is {shown(self.jump)}: give smc.Jump(time=..., factors=...) or None")
        put("integrator", coerce.integrator(self.integrator, self.realistic))
        put("seed", whole("seed", self.seed, 0, 2**53 - 1))
        consistency.check(self)

    def named(self, condition: str | None) -> "Scenario":
        """This scenario under a name for its condition, which tables show and which changes nothing of the run."""
        found = copy.copy(self)
        object.__setattr__(found, "condition", condition)
        return found

    @property
    def realistic(self) -> bool:
        """Whether the mechanism is more than the plant's equation."""
        parts = self.friction or self.actuator or self.contact.kind != "none" or self.mechanism != "equation"
        return bool(parts or not self.plant.smooth)

    @property
    def left_out(self) -> list[str]:
        """Fields whose defaults depend on others: dataclasses.replace finds them anew."""
        return [
            name
            for name in ("model", "physics_step", "integrator", "velocity", "u_max", "x0")
            if coerce.left_out(getattr(self, name))
        ]

    @property
    def limits(self) -> tuple[float, ...]:
        """The bound on |u| of each driven channel, N or N m: u_max, or its own motor's limit where that is less."""
        return tuple(min(self.u_max, limit) for limit in self.plant.limits) or (self.u_max,) * self.plant.driven

    @property
    def steps(self) -> int:
        """Physics steps per control period."""
        return round(self.control_period / self.physics_step)

    @property
    def samples(self) -> int:
        """K, the number of control periods; a trace has K + 1 samples."""
        return math.floor(self.duration / self.control_period + 1e-6)

    @property
    def stages(self) -> int:
        """Callbacks per physics step: one a stage of the integrator."""
        return 4 if self.integrator == "RK4" else 1

    @property
    def readings(self) -> int:
        """How many readings of its sensor are under way at once, of which MuJoCo keeps a history."""
        return 0 if self.sensor is None else self.sensor.readings(self.physics_step)

    @property
    def delay_steps(self) -> int:
        """The input delay in physics steps."""
        return round(self.input_delay / self.physics_step)

    @property
    def jump_step(self) -> int:
        """The physics step from which the jump holds; -1 without one."""
        return -1 if self.jump is None else math.ceil(self.jump.time / self.physics_step - 1e-6)

    @property
    def tandem(self) -> Tandem | None:
        """What two drives in series do in a physics step; None without a second drive."""
        return tandem(self.actuator, self.physics_step)

    @property
    def work(self) -> int:
        """Physics steps times channels: what a run costs, by which progress and batches are measured."""
        return self.samples * self.steps * self.plant.n

    def stream(self, i: int) -> int:
        """The stream of random numbers of disturbance i, 0 for one that takes none."""
        if not 0 <= i < len(self.disturbance):
            raise ScenarioError(
                f"there is no disturbance {shown(i)}: the scenario has {len(self.disturbance)}, from 0 on"
            )
        random = [d.random for d in self.disturbance]
        return PROCESS + sum(random[:i]) if random[i] else 0

    def factors(self, step: int) -> dict[str, float]:
        """The true plant's parameter factors at a physics step: mismatch, and from its time on the jump."""
        factors = dict(self.mismatch)
        if self.jump is not None and step >= self.jump_step:
            for name, factor in self.jump.factors.items():
                factors[name] = factors.get(name, 1.0) * factor
        return factors
