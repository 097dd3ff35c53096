"""Drives, which turn a law's command u, in N m (N on a slide), into force: lag, rate limit, DC
motor.

A scenario takes one drive, or a Lag and another drive in series, and a Backlash after them.

The callback simulates Lag, RateLimit and the winding of a DCMotor (`DriveStep`) and gives MuJoCo
the mean of their force over each physics step. So the velocities at the ends of the steps are those
of the equations, whatever the step is, and any integrator may be used; only a RateLimit behind a
Lag is not exact, see there. A state that MuJoCo integrates would give each step the force of its
end. This lead of half a step would take away a part of the delay that a limit cycle depends on:
behind one lag, most of it.

A winding also feels the joint's speed, which only MuJoCo knows within a step. `winding_step` is
exact for a speed that changes linearly there.
"""

# pyright: reportIncompatibleVariableOverride=false
# (a constant of the base class is a property here)
import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, NamedTuple

import mujoco
import numpy as np
from numba import njit
from numba.extending import register_jitable

from smc_mujoco.common.constraints import Bound, Number, OneOf
from smc_mujoco.common.data import frozen_data
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.jit import floats, record_at
from smc_mujoco.mechanisms.hardware.moments import Run, Torque, channel_at, drive_at, state_at
from smc_mujoco.mechanisms.hardware.part import (
    Actuator,
    Natural,
    NominalDrive,
    Offset,
    Part,
    Positive,
)
from smc_mujoco.mechanisms.plant import MAX_PARAMETER, Field, Plant

# Where a dcmotor's numbers lie in the compiled model:
# of actuator_gainprm: resistance, ohm, and torque constant, N m/A at the joint
WINDING = slice(0, 2)
MIN_WINDING_TIME = 1e-12  # s: a winding with a shorter time constant counts as instantaneous
MIN_RESISTANCE = 1e-9  # ohm: with less, the voltage of a command is lost in rounding
MAX_TIME_CONSTANTS = 1e9  # of a lag in a physics step: more count as this many
SHORT_STEP = 1e-3  # time constants: the series in `winding_step` errs by less than 1e-11 below it
MIN_SHARE = 1e-9  # of a winding's drag that MuJoCo gets, so that it does not divide by 0
MIN_CONSTANT = 1e-9  # N m/A at the joint, of the weakest motor
COMMANDS = ("torque", "voltage")
# of actuator_biasprm: amplitude, N m at the joint, and periods a radian of it
COGGING = slice(0, 2)


@frozen_data
class Lag(Actuator):
    """First-order lag, tau f' = u - f, from f = 0.

    The mean force over each physics step is exact for a held u.

    Two in series, `actuator=(Lag(mu), Lag(mu))`, are the parasitic actuator of the literature, u /
    (mu p + 1)^2: exact for a held u too. A Lag may stand before a RateLimit or a DCMotor as well.

    Attributes:
      tau: s, 0 (no lag) or more.
    """

    in_callback: ClassVar[bool] = True
    leads: ClassVar[bool] = True
    has_moment: ClassVar[bool] = True

    units: ClassVar[Mapping[str, str]] = {"tau": "s"}

    tau: Natural

    @property
    def delay(self) -> float:
        """The time constant tau, s."""
        return self.tau


@frozen_data
class RateLimit(Actuator):
    """A force that follows u no faster than `rate`, from 0: f(t + h) = u clipped to f(t) +- rate h.

    The mean force over each physics step is exact for a held u. Behind a Lag it errs in the steps
    in which the force meets the lag's output, at most by the change of that output in the step:
    little, if the step is short beside tau.

    Before a position servo it limits the set-point, which starts at the goal: the profile velocity
    of hobby servos. A `<pid>` of a file does this itself, by its slewmax.

    Attributes:
      rate: N m/s (N/s), or rad/s (m/s) of a set-point; greater than 0; math.inf for no limit.
    """

    in_callback: ClassVar[bool] = True

    units: ClassVar[Mapping[str, str]] = {"rate": "{f}/s"}

    rate: Bound

    @property
    def limited(self) -> bool:
        """Whether the rate is finite."""
        return self.rate < math.inf

    def before(self, drive: Actuator) -> bool:
        return drive.unit == "{x}"  # a set-point


@frozen_data
class DCMotor(Actuator):
    """Motor and gearbox on a voltage amplifier:

    V = scale u, the voltage whose stall torque is u; or V = u.

        L i' = V - R i - gear k v        |V| <= voltage; x, v: of the joint
        torque = gear k i + gear cogging sin(gear poles x)        |gear k i| <= gear k current
        inertia added at the joint: gear^2 rotor_inertia

    The law does not know it: back-EMF takes (gear k)^2/R v, inductance delays by L/R. Without
    limits, the torque tends to u as gear k goes to 0. The current's limit cuts the torque, not i,
    which is back within a few L/R.

    With command="voltage" u is the voltage itself, in V, as on a rig whose amplifier takes volts.
    |u| is then bounded by `voltage`, too, and the nominal model of a law is per volt: gear k/R is
    part of its g, and the back-EMF of its f. The law's model never has the inductance, the cogging,
    the ripple, and the limit of the current.

    Defaults: maxon RE 40, 24 V, number 148867 (data sheet; ironless: no cogging), gearhead GP 42 C
    12:1, exactly 49:4, the 30 A peak of an ESCON 70/10 amplifier: 11.1 N m and 65 rad/s at most,
    0.46 N m s/rad of back-EMF. On a slide gear is in rad/m: a pinion of 82 mm. The gearbox has no
    losses: add a friction. A scenario warns of a motor whose torque at rest, `stall`, is less than
    a joint needs to stay at its initial position.

    A commutator shorts a coil whenever one of its two brushes bridges two bars. Then V - gear k v
    drives more current, and the torque of that current grows by a share, the sum over both brushes
    of

        ripple exp((cos(bars (gear x - brush)) - 1) / (bars bridge)^2)

    Attributes:
      resistance: ohm, 1e-9 or more.
      inductance: H, 0 (current at once) or more.
      torque_constant: k, N m/A, which is V s/rad; greater than 0.
      gear: turns of the motor per turn of the joint, rad/m on a slide; greater than 0.
      rotor_inertia: kg m^2 at the motor, 0 or more.
      cogging: N m at the motor, the amplitude; 0 or more.
      poles: periods of cogging per turn of the motor, 0 or more; the default is chosen.
      voltage: V, the supply, greater than 0; math.inf for no limit.
      current: A, the amplifier's limit, greater than 0; math.inf for none.
      ripple: share of the torque that a brush adds, 0 or more; 0 for an even torque. It needs
        inductance 0.
      bars: of the commutator, greater than 0; the default is chosen.
      bridge, bridge_2: rad at the motor, over which each brush bridges two bars, greater than 0;
        chosen.
      brush, brush_2: rad at the motor, an angle at which each brush bridges two bars; chosen.
      command: what u is: "torque", N m (N) at the joint, or "voltage", V.
    """

    units: ClassVar[Mapping[str, str]] = {
        "resistance": "ohm",
        "inductance": "H",
        "torque_constant": "N m/A",
        "rotor_inertia": "kg m^2",
        "cogging": "N m",
        "voltage": "V",
        "current": "A",
        "bridge": "rad",
        "bridge_2": "rad",
        "brush": "rad",
        "brush_2": "rad",
    }

    resistance: Annotated[float, Number(low=MIN_RESISTANCE, high=MAX_PARAMETER)] = 0.299
    inductance: Natural = 0.0823e-3
    torque_constant: Positive = 30.2e-3
    gear: Positive = 12.25
    rotor_inertia: Natural = 142e-7
    cogging: Natural = 0.0
    poles: Natural = 12.0
    voltage: Bound = 24.0
    current: Bound = 30.0
    ripple: Natural = 0.0
    bars: Positive = 9.0
    bridge: Positive = 0.01
    bridge_2: Positive = 0.01
    brush: Offset = 0.0
    brush_2: Offset = 0.35
    command: Annotated[str, OneOf(names=COMMANDS)] = "torque"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.ripple and self.delay:
            numbers = f"ripple {self.ripple:g} and inductance {self.inductance:g} H"
            raise ScenarioError(
                f"DCMotor has {numbers}, and ripple is of a current without delay: "
                "give inductance=0"
            )
        if (
            not self.constant >= MIN_CONSTANT
            or not self.resistance / self.constant <= MAX_PARAMETER
        ):
            raise ScenarioError(
                f"DCMotor's gear {self.gear:g} times torque_constant {self.torque_constant:g} "
                f"N m/A is too weak for a resistance of {self.resistance:g} ohm: "
                "give a stronger motor"
            )

    @property
    def constant(self) -> float:
        """Torque at the joint per ampere, N m/A (N/A)."""
        return self.gear * self.torque_constant

    @property
    def scale(self) -> float:
        """V per unit of u: per N m (N) of stall torque, or 1 if u is the voltage."""
        if self.by_voltage:
            return 1.0
        return self.resistance / self.constant

    @property
    def by_voltage(self) -> bool:
        """Whether u is the voltage."""
        return self.command == "voltage"

    @property
    def unit(self) -> str:
        """Unit of u, "V" if it is the voltage; "" for that of the joint's force."""
        return "V" if self.by_voltage else ""

    @property
    def meaning(self) -> str:
        """What u is, in words, if it is the voltage."""
        return "the voltage of its motor, in V" if self.by_voltage else ""

    @property
    def nominal(self) -> NominalDrive:
        """Torque per unit of u and of velocity, N m/V and N m s/rad, if u is the voltage; else u is
        the torque.
        """
        if not self.by_voltage:
            return NominalDrive()
        per_volt = self.constant / self.resistance
        return NominalDrive(per_volt, per_volt * self.constant)

    @property
    def stall(self) -> float:
        """The largest torque that voltage and current allow at rest, N m (N)."""
        return min(self.voltage * self.constant / self.resistance, self.constant * self.current)

    @property
    def bound(self) -> float | None:
        """V, the supply, if u is the voltage."""
        return self.voltage if self.by_voltage else None

    def side_by_side(self, count: float) -> "DCMotor":
        """Return the one motor that `count` of these, or a fraction, on one joint equal."""
        return dataclasses.replace(
            self,
            resistance=self.resistance / count,
            inductance=self.inductance / count,
            rotor_inertia=self.rotor_inertia * count,
            cogging=self.cogging * count,
            current=self.current * count,
        )

    @property
    def even(self) -> bool:
        """Whether it has neither cogging nor ripple."""
        return not (self.cogging or self.ripple)

    def mujoco_torque(self, step: float, rk4: bool) -> Torque:
        """Return how MuJoCo computes the torque of an even motor in a physics step, s."""
        gain = self.constant / self.resistance
        share, voltage = self._share(step, rk4)
        return Torque(gain, share * gain * self.constant, voltage, self.constant * self.current)

    def _share(self, step: float, rk4: bool) -> tuple[float, float]:
        """Return the share of the drag that MuJoCo gets, and the bound on the voltage there."""
        if self.delay:  # the callback simulates the winding, and bounds its voltage
            return winding_step(step / self.delay, rk4)[1], math.inf
        # `rippled` bounds it before the ripple
        return 1.0, math.inf if self.ripple else self.voltage

    def edit(self, spec: mujoco.MjSpec) -> None:
        kind = int(mujoco.mjtCtrlInput.mjINPUT_VOLTAGE)
        constants = (self.constant, self.constant)
        for actuator in self.drives_of(spec):
            actuator.set_to_dcmotor(motorconst=constants, resistance=self.resistance, ctrlspec=kind)
            actuator.ctrllimited = True
            actuator.ctrlrange = (-1.0, 1.0)
            actuator.forcelimited = True
            actuator.forcerange = (-1.0, 1.0)

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        ids = self.drive_ids(model)
        torque = self.constant * self.current
        rk4 = model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4
        share, voltage = self._share(model.opt.timestep, rk4)
        yield Field(
            "actuator_gainprm", (ids, WINDING), (share * self.resistance, share * self.constant)
        )
        yield Field(
            "actuator_biasprm", (ids, COGGING), (self.gear * self.cogging, self.gear * self.poles)
        )
        yield Field("actuator_ctrlrange", ids, (-voltage, voltage))
        yield Field("actuator_forcerange", ids, (-torque, torque))
        driven = model.jnt_dofadr[model.actuator_trnid[ids, 0]]
        yield Field("dof_armature", driven, self.gear**2 * self.rotor_inertia, adds=True)

    @property
    def delay(self) -> float:
        """L/R in s, the winding's time constant; below MIN_WINDING_TIME it counts as 0."""
        if self.inductance > MIN_WINDING_TIME * self.resistance:
            return self.inductance / self.resistance
        return 0.0


class DriveStep(NamedTuple):
    """Effect of a physics step on the drives that the callback simulates.

    `first` is the output of the first lag. `second` is that of the second lag, or the force behind
    a RateLimit, or the torque of a winding's current, plus `drag` times the speed. All are in the
    unit of u, in which a winding's torque is that of a rotor at rest. All factors without a unit
    are shares of a state's distance from u. v is the speed at the start of the step.
    """

    force_first: float = 0.0  # of `first` in the mean force over the step
    force_second: float = 0.0  # of `second` in it
    first_left: float = 0.0  # of `first` in itself at the end of the step
    second_first: float = 0.0  # of `first` in `second` at the end of the step
    second_left: float = 0.0  # of `second` in itself there
    lagged: float = 0.0  # 1 with a lag, 0 without one
    reach: float = (
        0.0  # largest change of the force in a step, in the unit of u; 0 without a RateLimit
    )
    voltage: float = 0.0  # bound on a winding's voltage, in the unit of u; 0 without a winding
    # of a winding, times v, in the unit of u: what it takes from `second` to make it the torque
    drag: float = 0.0
    force_drag: float = 0.0  # the same: from the mean force, beside MuJoCo's own share of the drag
    second_drag: float = 0.0  # the same: from `second` at the end of the step
    ripple: float = 0.0  # this and all after it: of a DCMotor, see `rippled`; 0 for an even torque
    turns: float = 0.0
    angle: float = 0.0
    angle_2: float = 0.0
    sharpness: float = 0.0
    sharpness_2: float = 0.0
    supply: float = 0.0
    constant: float = 0.0
    # of `first` in the rise of the force within an RK4 step, from its middle to its last stage
    rise_first: float = 0.0

    def start(self, v: Any) -> np.ndarray:
        """Return both states at the start of a run at the speeds v, (2, ...): no force, and no
        current.
        """
        return np.array([np.zeros_like(v), self.drag * v])


@register_jitable
def rippled(motor, V, x, v):
    """Return the voltage at which an even motor has the torque of a motor with ripple, at V, x and
    v of its joint.
    """
    V = min(max(V, -motor.supply), motor.supply)
    share = math.exp(motor.sharpness * (math.cos(motor.turns * x - motor.angle) - 1.0))
    share += math.exp(motor.sharpness_2 * (math.cos(motor.turns * x - motor.angle_2) - 1.0))
    return V + motor.ripple * share * (V - motor.constant * v)


@njit(error_model="numpy", inline="always")
def advanced(factors, state, u, v):
    """Advance a joint's drives by a physics step at the command u and the speed v.

    Return the mean force. `factors` is a DriveStep.
    """
    second = state.second
    a = state.first - u
    b = second - u
    force = u + factors.force_first * a
    state.first = u + factors.first_left * a
    state.rise = factors.rise_first * a
    if factors.voltage != 0.0:
        bound = factors.voltage
        torque = second - factors.drag * v
        mean = min(max(force, -bound), bound)
        end = min(max(u + factors.second_first * a, -bound), bound)
        state.second = end + factors.second_left * (torque - end) - factors.second_drag * v
        return mean + factors.force_second * (torque - mean) - factors.force_drag * v
    if factors.reach == 0.0:
        state.second = u + factors.second_first * a + factors.second_left * b
        return force + factors.force_second * b
    reach = factors.reach
    state.second = min(max(state.first, second - reach), second + reach)
    if state.second != state.first:
        return 0.5 * (second + state.second)
    gap = min(max(u + factors.lagged * a - second, -reach), reach)
    return force - 0.5 * gap * abs(gap) / reach


# What a joint keeps of its drives: both states of DriveStep, and the rise of the force from the
# middle of a step of RK4 to its last stage.
factors_at = record_at(floats(DriveStep._fields))
KEPT = floats(("first", "second", "rise"))
kept_at = record_at(KEPT)


@frozen_data
class Series(Part):
    """The drives, in series, of joints that the callback simulates."""

    effect: DriveStep
    on_channels: tuple[int, ...]  # the channels

    is_drive = True
    memory = 3
    names = DriveStep._fields

    @property
    def sums_force(self) -> bool:
        """Whether the stages of RK4 get a moment."""
        return self.effect.rise_first != 0.0

    def numbers(self, run: Run) -> list[Sequence[float]]:
        return [self.effect]

    def start(self, run: Run) -> list[Sequence[float]]:
        return [[*states, 0.0] for states in self.effect.start(np.array(run.v0)).T.tolist()]

    def channels(self, plant: Plant) -> Sequence[int]:
        return self.on_channels

    @staticmethod
    def act(sim, data, part):
        """Give a joint the mean force of a step, or the stages of RK4 its mean and first moment."""
        i = part.channel
        channel = channel_at(sim.channels, i)
        state = state_at(sim.states, i)
        factors = factors_at(part.function.parameters, 0)
        filters = kept_at(part.function.memory, 0)
        if sim.stage == 0:
            v = data.qvel[channel.shaft]
            scale = drive_at(sim.drives, i).scale
            force = scale * advanced(factors, filters, state.delayed, v)
            if factors.ripple != 0.0:
                force = rippled(factors, force, data.qpos[channel.shaft_qpos], v)
            if factors.rise_first != 0.0:
                state.middle = force
                filters.rise *= scale
                force -= filters.rise
            data.ctrl[channel.ctrl] = force
        elif factors.rise_first != 0.0:
            data.ctrl[channel.ctrl] = state.middle
            if sim.stage == 3:
                data.ctrl[channel.ctrl] = state.middle + filters.rise
                # what the actuators did in the stage before, with the mean force
                state.force += data.actuator_force[channel.force]


def in_series(chains: Sequence[tuple[Actuator, ...]], step: float, rk4: bool) -> Iterator[Series]:
    """Yield the drives that the callback simulates, of the actuators of each driven channel."""
    for chain in dict.fromkeys(chains):
        effect = drive_step(chain, step, rk4)
        if effect is not None:
            yield Series(
                effect,
                tuple(i for i, chain_of_channel in enumerate(chains) if chain_of_channel == chain),
            )


def drive_step(actuator: tuple[Actuator, ...], step: float, rk4: bool) -> DriveStep | None:
    """Return the effect of a physics step of `step` s, of RK4 or another integrator; None if MuJoCo
    needs only u.
    """
    lags = []
    rate = None
    motor = None
    for part in actuator:
        if not part.drives:
            continue
        if isinstance(part, Lag) and part.tau:
            lags.append(min(step / part.tau, MAX_TIME_CONSTANTS))
        if rate is None and isinstance(part, RateLimit):
            rate = part.rate
        if motor is None and isinstance(part, DCMotor) and (part.delay or part.ripple):
            motor = part
    if not lags and motor is None and rate is None:
        return None
    a = lags[0] if lags else math.inf
    effect = DriveStep(force_first=_mean(a), first_left=math.exp(-a), lagged=float(bool(lags)))
    if motor is not None and motor.ripple:
        n = motor.bars
        return effect._replace(
            ripple=motor.ripple,
            turns=n * motor.gear,
            angle=n * motor.brush,
            angle_2=n * motor.brush_2,
            sharpness=(n * motor.bridge) ** -2,
            sharpness_2=(n * motor.bridge_2) ** -2,
            supply=motor.voltage,
            constant=motor.constant,
        )
    if rk4 and len(lags) == 1 and rate is None and motor is None:
        effect = effect._replace(rise_first=_rise(a))
    if rate is not None:
        return effect._replace(reach=rate * step)
    if motor is not None:
        return _wound(effect, motor, a, step, rk4)
    if len(lags) < 2:
        return effect
    b = lags[1]
    passed = _passed(a, b)
    return effect._replace(
        force_first=_mean(a) - passed / b,
        force_second=_mean(b),
        second_first=passed,
        second_left=math.exp(-b),
    )


def _wound(effect: DriveStep, motor: DCMotor, a: float, step: float, rk4: bool) -> DriveStep:
    """Return the effect of a step on a motor's winding behind a lag; the step is `a` of the lag's
    time constants long.

    Behind a lag, the winding gets two voltages that are held over the step: one that gives the mean
    of its torque, and one that gives its end. So both are exact, unless the supply's bound cuts the
    lag's output within the step.
    """
    b = step / motor.delay
    (drag, share), decay = winding_step(b, rk4), math.exp(-b)
    passed = 0.0 if a == math.inf else _passed(a, b)
    emf = motor.constant / motor.scale
    return effect._replace(
        force_first=(effect.force_first - passed / b) / drag,
        force_second=1.0 - drag,
        second_first=passed / -math.expm1(-b),
        second_left=decay,
        voltage=motor.voltage / motor.scale,
        drag=drag * emf,
        force_drag=(drag - share) * emf,
        second_drag=(-math.expm1(-b) - drag) * emf,
    )


def winding_step(b: float, rk4: bool) -> tuple[float, float]:
    """Return the effect of the speed, which changes linearly, on a winding in a physics step of b
    time constants.

    The first number is the weight of a constant speed in the mean torque, and of the speed's change
    in the torque at the end. The second is the share of the drag of a motor without inductance that
    MuJoCo gets, so that the speed's change in the step has its effect on the mean torque. A change
    by 1 has the effect `late` there. RK4 applies a drag at the mean speed, so at half of the
    change, and implicit integrators at the speed at the end.
    """
    drag = 1.0 - _mean(b)
    if b < SHORT_STEP:
        late = b / 6.0 - b**2 / 24.0
    else:
        late = 0.5 - drag / b
    return drag, max(2.0 * late if rk4 else late, MIN_SHARE)


def _mean(a: float) -> float:
    """Return the mean of exp(-t) over 0 .. a."""
    return -math.expm1(-a) / a


def _rise(a: float) -> float:
    """Return the rise that gives RK4's stages the first moment of a force exp(-t) over a step of 0
    .. a.

    With mean m and moment p = integral of (1 - s) f over the step s = 0 .. 1, stages of m - b, m,
    m, m + b with b = 6 (m / 2 - p) change speed and position as the force does, to RK4's order.
    """
    if a < SHORT_STEP:
        return -a / 2.0 + a**2 / 4.0 - 3.0 * a**3 / 40.0
    mean = _mean(a)
    return 6.0 * (mean / 2.0 - (1.0 - mean) / a)


def _passed(a: float, b: float) -> float:
    """Return the second lag's output after a step of a and b time constants, from 1 in the first
    lag at its start.
    """
    apart = abs(b - a)
    return b * math.exp(-min(a, b)) * (_mean(apart) if apart else 1.0)
