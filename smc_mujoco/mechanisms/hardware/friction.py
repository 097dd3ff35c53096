"""Friction in joints: viscous, Coulomb, and LuGre, which sticks without creep.

MuJoCo simulates all three: a joint's damping, its `frictionloss`, and the bristles of a `dcmotor`
actuator. Under RK4 the callback simulates dry friction on joints that move alone, see `dry_step`.
"""

# pyright: reportIncompatibleVariableOverride=false
# (a constant of the base class is a function or a property here)
import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import ClassVar

import mujoco
import numpy as np
from numba import njit

from smc_mujoco.common.data import frozen_data
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.hardware.moments import Run
from smc_mujoco.mechanisms.hardware.part import (
    HARD_SOLIMP,
    HARD_SOLREF,
    Actuator,
    Added,
    Friction,
    Natural,
    Part,
    Positive,
)
from smc_mujoco.mechanisms.layout import PASSIVE, ROTOR
from smc_mujoco.mechanisms.plant import Field, Plant

# Where a dcmotor's bristles lie in the compiled model.
STIFFNESS, DAMPING = 5, 6  # of actuator_dynprm
LEVELS = slice(3, 6)  # of actuator_biasprm: coulomb, static, stribeck
# share of g(v) that bristles carry when they slide; chosen: a slow ramp's stick and slip, by an
# event-driven set-valued integration, then last as long within 2 %
SLIDES = 0.99
RELATIVE_DAMPING = 0.2  # default damping of bristles over sqrt(stiffness inertia)


@frozen_data
class Viscous(Friction):
    """Friction -b v, on top of the plant's own damping.

    Attributes:
      b: N m s/rad, N s/m on a slide; 0 or more.
    """

    smooth = True
    forces = names = ("b",)
    units: ClassVar[Mapping[str, str]] = {"b": "{f} s/{x}"}

    b: Natural

    @staticmethod
    def steady(y, p, memory):
        return p.b * y.v

    @property
    def added_to_model(self) -> Added:
        """Its damping, and no dry friction."""
        return Added(damping=self.b)

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        yield Field("dof_damping", self.dofs(model), self.b, adds=True)


@frozen_data
class Coulomb(Friction):
    """Dry friction: -level sign(v) on a sliding joint; on a joint at rest, the force up to level
    that holds it.

    On joints that move alone, behind no drive but lags and rate limits, RK4's stages get its mean
    and first moment over the step, as `Scenario.exact_friction` says. Such a joint stops, sticks
    and turns back within a step.

    Elsewhere it is MuJoCo's. In a step in which a joint stops or turns back, friction then has one
    direction for all of it. It is a soft constraint, so a stuck joint creeps at (1 - d) tc/2 a0,
    with impedance d, time constant tc, and a0 the acceleration that friction holds back. With the
    hardest constraint that is 1e-4 h a0 for a physics step h: 2e-7 rad/s for a pendulum of 0.125 kg
    m^2 that holds 1 N m at h = 0.25 ms.

    With `km` it is a `Stribeck` of the same numbers, in a scenario and its record.

    Attributes:
      level: N m, N on a slide; 0 (none) or more.
      km: dry friction for each N m (N) that the gearbox carries, 0 or more, as in `Stribeck`.
    """

    names = ("level",)
    forces = "level", "km"
    units: ClassVar[Mapping[str, str]] = {"level": "{f}"}

    level: Natural
    km: Natural = dataclasses.field(default=0.0, kw_only=True)

    @staticmethod
    def steady(y, p, memory):
        return math.copysign(p.level, y.v)

    @property
    def added_to_model(self) -> Added:
        """No damping, and its dry friction."""
        return Added(dry=self.level)

    @property
    def exact(self) -> Part:
        return DryFriction()

    def edit(self, spec: mujoco.MjSpec) -> None:
        for joint in self.joints(spec):
            joint.solref_friction = HARD_SOLREF
            joint.solimp_friction = HARD_SOLIMP

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        yield Field("dof_frictionloss", self.dofs(model), self.level, adds=True)


@njit(error_model="numpy")
def dry_step(v, smooth, sliding, starting, low, high, mobility, h):
    """Return what dry friction does to a joint that moves alone, in a step of h s in which no other
    force changes.

    Within the step, the joint slides, stops, and then sticks or turns back.

    Args:
      v: speed at the start of the step, rad/s (m/s).
      smooth: sum of the other forces on the joint, N m (N).
      sliding: friction on the joint while it moves as at v, N m (N).
      starting: friction on it when it then moves, N m (N); with `smooth` out of the bounds their
        sum must push the joint beyond the bound that was passed.
      low, high: bounds of the `smooth` that friction holds at rest, N m (N).
      mobility: 1 over the joint's inertia, 1/(kg m^2) (1/kg).
      h: s.

    Returns:
      The mean of the friction over the step, N m (N); the rise that gives RK4's stages its first
      moment, see `drives._rise`; and the time for which it holds the joint at rest, s, which is the
      last of the step.
    """
    remaining = h
    mean = 0.0
    moment = 0.0
    held = 0.0
    while remaining > 0.0:
        force = -smooth
        span = remaining
        if v == 0.0 and low <= smooth <= high:
            held = remaining
        else:
            force = sliding if v != 0.0 else starting
            direction = math.copysign(1.0, v if v != 0.0 else smooth + force)
            slowing = -direction * (smooth + force) * mobility
            if abs(v) < slowing * remaining:
                span = abs(v) / slowing
            v = 0.0
        mean += force * span
        moment += force * span * (remaining - 0.5 * span)
        remaining -= span
    mean = mean / h
    moment = moment / (h * h)
    return mean, 6.0 * (0.5 * mean - moment), held


# What a dry friction keeps within a step: its mean and its rise to the last stage; the other forces
# for which these are right, and the share of their change that it takes up; its bounds
FRICTION, RISE, SMOOTH, HOLDING, LOW, HIGH = range(6)


@njit(error_model="numpy")
def begin_step(y, memory, sliding, starting, low, high):
    """Keep what `dry_step` says of a JointState at the first stage, and return how long friction
    holds the joint, s.
    """
    smooth = y.others + y.mean
    friction, rise, held = dry_step(y.v, smooth, sliding, starting, low, high, y.mobility, y.h)
    slid = 1.0 - held / y.h
    memory[FRICTION] = friction
    memory[RISE] = rise
    memory[SMOOTH] = smooth
    memory[HOLDING] = 1.0 - slid * slid if held > 0.0 else 0.0
    memory[LOW] = min(-high, sliding, starting)
    memory[HIGH] = max(-low, sliding, starting)
    return held


@njit(error_model="numpy")
def at_stage(y, memory):
    """Return the friction at a stage of the step that `begin_step` began, N m (N).

    While it holds the joint, it takes up what the other forces change within the step, too.
    """
    holding = memory[FRICTION] - memory[HOLDING] * (y.others + y.motor - memory[SMOOTH])
    return with_rise(y, memory, min(max(holding, memory[LOW]), memory[HIGH]))


@njit(error_model="numpy")
def with_rise(y, memory, force):
    """Return a force with the rise that gives RK4's stages its first moment."""
    if y.stage == 0.0:
        return force - memory[RISE]
    return force + memory[RISE] if y.stage == 3.0 else force


@frozen_data
class DryFriction(Part):
    """Dry friction, at every stage of RK4, of joints that move alone and whose level is in the
    model: of a plant's own, and of Coulomb.
    """

    memory = HIGH + 1

    @property
    def written(self) -> tuple[Callable, int]:
        """Its function, and the numbers that it may index."""
        return self.stage_force, self.memory

    def behind(self, actuator: Actuator) -> bool:
        """Return whether it knows the force of a drive within a step."""
        return actuator.in_callback

    @staticmethod
    def stage_force(y, p, memory):
        held = 0.0
        if y.stage == 0.0:
            sliding = -math.copysign(y.level, y.v)
            starting = -math.copysign(y.level, y.others + y.mean)
            held = begin_step(y, memory, sliding, starting, -y.level, y.level)
        return at_stage(y, memory), held


@frozen_data
class Bristles(Part):
    """The force of LuGre's bristles, as MuJoCo's `dcmotor` exerts it under implicitfast: the bend z
    follows from v, held over the step, and the force from z and v at the step's start.
    """

    names = "coulomb", "static", "stribeck", "stiffness", "damping"
    memory = 1
    counted = "damping"

    friction: "LuGre"

    @property
    def side(self) -> str:
        """The side of a play that it acts on."""
        return self.friction.side

    def channels(self, plant: Plant) -> Sequence[int]:
        return self.friction.channels(plant)

    def numbers(self, run: Run) -> list[Sequence[float]]:
        model = run.model
        rows = []
        shaft = ROTOR if self.side == "motor" else ""
        for dof in run.dofs:
            joint = shaft + model.joint(int(model.dof_jntid[dof])).name
            bristles = model.actuator(PASSIVE + joint).id
            levels = model.actuator_biasprm[bristles, LEVELS]
            rows.append([*levels, *model.actuator_dynprm[bristles, [STIFFNESS, DAMPING]]])
        return rows

    @staticmethod
    def force(y, p, memory):
        bend = memory[0]
        speed = y.v / p.stribeck
        level = p.coulomb + (p.static - p.coulomb) * math.exp(-speed * speed)
        decay = -p.stiffness * abs(y.v) / level
        rate = decay * bend + y.v
        decayed = math.exp(decay * y.h)
        reach = y.h if decay == 0.0 else (decayed - 1.0) / decay
        memory[0] = decayed * bend + reach * y.v
        return -(p.stiffness * bend + p.damping * rate)


@frozen_data
class LuGre(Friction):
    """Friction of elastic bristles: stiction, the Stribeck drop with speed, and a stuck joint that
    does not creep.

        z' = v - stiffness |v| / g(v) z                           z: bend of the bristles, rad
        g(v) = coulomb + (static - coulomb) exp(-(v / stribeck)^2)
        friction = -(stiffness z + damping z')

    Source: C. Canudas de Wit, H. Olsson, K. J. Astrom and P. Lischinsky, A new model for control of
    systems with friction, IEEE Transactions on Automatic Control 40(3), 1995, eqs. (1) to (4)
    without the viscous term, which is `Viscous`. MuJoCo integrates z exactly for v held over a
    step, and computes the force from z and v at its start.

    Limits: implicitfast or Euler; under RK4 z is explicit and diverges at stiffness |v| h > 2.8
    coulomb. The bristles start unbent: after a jump of speed, such as an initial v0, the friction
    of the first step is damping v0.

    Attributes:
      coulomb: N m (N): friction when sliding fast; greater than 0.
      static: N m (N): friction at which the joint breaks away; coulomb or more.
      stribeck: rad/s (m/s): the speed at which friction falls from static to coulomb; greater than
        0.
      stiffness: N m/rad (N/m), greater than 0. The default is chosen: a hundredth of the paper's
        1e5, whose bristles would oscillate at up to 900 rad/s on these plants. At up to 89 rad/s
        they are stable and resolved even at h = 1 ms. They bend by 0.1 mrad under 0.1 N m.
      damping: N m s/rad (N s/m), 0 or more. It should be several times stiffness h, because
        MuJoCo bends bristles a step late: they oscillate and joints rest at wrong places. A
        scenario warns of such bristles if they are stiffer than the default. None: 0.2
        sqrt(stiffness inertia), with each joint's inertia at the plant's default parameters: 2.2
        for the pendulum. This is a fifth of the paper's rule, chosen because implicitfast counts
        damping h as inertia, 0.4 % of the pendulum's at h = 0.25 ms. With half of it, bristles
        oscillate too long.
    """

    keeps_state = True
    forces = ordered = "coulomb", "static"
    names = "coulomb", "static", "stribeck"
    units: ClassVar[Mapping[str, str]] = {
        "coulomb": "{f}",
        "static": "{f}",
        "stribeck": "{x}/s",
        "stiffness": "{f}/{x}",
        "damping": "{f} s/{x}",
    }

    coulomb: Positive
    static: Positive
    stribeck: Positive
    stiffness: Positive = 1e3
    damping: Natural | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.static < self.coulomb:
            raise ScenarioError(
                f"LuGre's static {self.static:g} is less than its coulomb {self.coulomb:g}: "
                "give static >= coulomb"
            )

    @property
    def held(self) -> Part:
        return Bristles(self)

    @staticmethod
    def steady(y, p, memory):
        drop = math.exp(-((y.v / p.stribeck) ** 2))
        return math.copysign(p.coulomb + (p.static - p.coulomb) * drop, y.v)

    def sticks(self, v: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return where the bristles bend: they carry less than what slides at this speed."""
        drop = np.exp(-((v / self.stribeck) ** 2))
        sliding = self.coulomb + (self.static - self.coulomb) * drop
        return np.abs(force) < SLIDES * sliding

    def default_damping(self, inertia: np.ndarray) -> np.ndarray:
        """Return the damping of bristles on joints of these inertias, kg m^2 (kg)."""
        return RELATIVE_DAMPING * np.sqrt(self.stiffness * inertia)

    def edit(self, spec: mujoco.MjSpec) -> None:
        for joint in self.joints(spec):
            name = PASSIVE + joint.name
            on_joint = mujoco.mjtTrn.mjTRN_JOINT
            spec.add_actuator(name=name, target=joint.name, trntype=on_joint).set_to_dcmotor(
                motorconst=(1e-9, 1e-9),  # a dcmotor needs a motor constant: too small to notice
                resistance=1.0,
                lugre=(
                    self.stiffness,
                    self.damping or 1.0,
                    self.coulomb,
                    self.static,
                    self.stribeck,
                ),
                ctrlspec=int(mujoco.mjtCtrlInput.mjINPUT_NONE),
            )

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        dofs = self.dofs(model)
        bristles = []
        for joint in model.dof_jntid[dofs]:
            bristles.append(model.actuator(PASSIVE + model.joint(int(joint)).name).id)
        yield Field("actuator_dynprm", (bristles, STIFFNESS), self.stiffness)
        damping = self.default_damping(model.dof_M0[dofs])
        yield Field(
            "actuator_dynprm",
            (bristles, DAMPING),
            damping if self.damping is None else self.damping,
        )
        yield Field(
            "actuator_biasprm", (bristles, LEVELS), (self.coulomb, self.static, self.stribeck)
        )
