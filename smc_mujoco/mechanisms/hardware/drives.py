"""Drives, which turn a law's command u, in N m (N on a slide), into force: lag, rate limit, DC motor.

A scenario takes one, or a Lag and another in series (`tandem`), and a Backlash after them. Numbers are for
implicitfast, whose steps integrate the drives' states exactly for a held u.

Of two in series the second is MuJoCo's own, and the first one's output a is what it is asked for. The first is a lag,
tau1 a' = u - a from a = 0, which the callback moves on step by step. In between, MuJoCo holds what the second is asked
for over a physics step of length h, while a moves. It holds the mean of a with the weights exp(-(h - t)/tau2) that the
second's own lag gives it: this brings the second to where the moving a would. So the output of two lags is exact at the
end of each step for a held u, as that of one lag is.
"""

import dataclasses
import math
from collections.abc import Hashable, Iterator
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.hardware.part import Actuator, drive_ids, drives
from smc_mujoco.mechanisms.plant import LARGEST, Field

# Where a dcmotor's numbers lie in the compiled model:
WINDING = slice(0, 2)  # of actuator_gainprm: resistance, ohm, and torque constant, N m/A at the joint
SUDDEN = 1e-12  # s: a winding that is faster lets MuJoCo divide by nearly nothing
LEAST_RESISTANCE = 1e-9  # ohm: with less, a command is hardly a voltage that a number can hold
LEAST_LAG = 1e-15  # s: a shorter first lag of two counts as this one, as in MuJoCo
LEAST_CONSTANT = 1e-9  # N m/A at the joint: a weaker motor is none
TIME_CONSTANT, SLEW = 0, 7  # of actuator_dynprm: s, and u per s
COGGING = slice(0, 2)  # of actuator_biasprm: amplitude, N m at the joint, and periods a radian of it


@dataclasses.dataclass(frozen=True)
class Drive(Actuator):
    """Base of what turns a command into force."""

    stateful = True


@dataclasses.dataclass(frozen=True)
class Lag(Drive):
    """First-order lag, tau f' = u - f, from f = 0: the force at the end of each physics step, exact for a held u.

    Limits: implicitfast or Euler. Under RK4 MuJoCo's filter errs by h/(2 tau), and diverges below tau = h/2.8.
    tau = 0 is the plant's own actuator, in a model of its own.

    Two in series, `actuator=(Lag(mu), Lag(mu))`, are the parasitic actuator of the literature, u / (mu p + 1)^2: exact
    for a held u too. A Lag may stand before a RateLimit or a DCMotor as well.

    Attributes:
      tau: s, 0 (no lag) or more.
    """

    tau: float

    def __post_init__(self) -> None:
        self.check_numbers("tau", least=0.0)

    def edit(self, spec: mujoco.MjSpec) -> None:
        for actuator in drives(spec) if self.tau else ():
            actuator.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
            actuator.dynprm[0] = self.tau
            actuator.actearly = True

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        if self.tau:
            yield Field("actuator_dynprm", (drive_ids(model), 0), self.tau)

    def structure(self) -> Hashable:
        return type(self), self.tau > 0.0

    @property
    def delay(self) -> float:
        """The time constant tau, s."""
        return self.tau


@dataclasses.dataclass(frozen=True)
class RateLimit(Drive):
    """A force that follows u no faster than `rate`, from 0: f(t + h) = u clipped to f(t) +- rate h.

    MuJoCo's dcmotor in torque mode, with a slew limit; its motor is too weak to notice. Limits: implicitfast or Euler;
    under RK4 f lags within a step, and slopes near the rate are cut.

    Attributes:
      rate: N m/s (N/s), greater than 0; math.inf for no limit.
    """

    rate: float

    def __post_init__(self) -> None:
        self.check_numbers("rate", above=0.0, most=math.inf, infinite=True)

    def edit(self, spec: mujoco.MjSpec) -> None:
        for actuator in drives(spec):
            actuator.set_to_dcmotor(
                motorconst=(1e-6, 1e-6),
                resistance=1e-6,
                controller=(0.0, 0.0, 0.0, 1.0, 0.0, 0.0),
                ctrlspec=int(mujoco.mjtCtrlInput.mjINPUT_FF),
            )

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        yield Field("actuator_dynprm", (drive_ids(model), SLEW), self.rate)


@dataclasses.dataclass(frozen=True)
class DCMotor(Drive):
    """Motor and gearbox on a voltage amplifier: V = scale u, the voltage whose stall torque is u.

        L i' = V - R i - gear k v        |V| <= voltage; x, v: of the joint
        torque = gear k i + gear cogging sin(gear poles x)        |torque| <= gear k current
        inertia at the joint: gear^2 rotor_inertia more

    The law is not told: back-EMF takes (gear k)^2/R v, inductance delays by L/R. As gear k goes to 0 without limits
    the torque becomes u. The current's limit cuts the torque; i itself runs on, and is back within a few L/R.

    Defaults: maxon RE 40, 24 V, number 148867 (data sheet; ironless: no cogging), gearhead GP 42 C 12:1, exactly
    49:4, the 30 A peak of an ESCON 70/10 amplifier: 11.1 N m and 65 rad/s at most, 0.46 N m s/rad of back-EMF. On a
    slide gear is in rad/m: a pinion of 82 mm. The gearbox loses nothing: give a friction. A scenario warns of a motor
    whose torque at rest, `stall`, is less than a joint needs to stand where it starts.

    Limits: implicitfast or Euler; under RK4 a step must be shorter than 2.8 L/R. inductance 0 is a model of its own.

    Attributes:
      resistance: ohm, 1e-9 or more.
      inductance: H, 0 (current at once) or more.
      torque_constant: k, N m/A, which is V s/rad; greater than 0.
      gear: turns of the motor a turn of the joint, rad/m on a slide; greater than 0.
      rotor_inertia: kg m^2 at the motor, 0 or more.
      cogging: N m at the motor, the amplitude; 0 or more.
      poles: periods of cogging a turn of the motor, 0 or more; the default is chosen.
      voltage: V, the supply; math.inf for no limit.
      current: A, the amplifier's limit; math.inf for none.
    """

    resistance: float = 0.299
    inductance: float = 0.0823e-3
    torque_constant: float = 30.2e-3
    gear: float = 12.25
    rotor_inertia: float = 142e-7
    cogging: float = 0.0
    poles: float = 12.0
    voltage: float = 24.0
    current: float = 30.0

    def __post_init__(self) -> None:
        self.check_numbers("resistance", above=0.0, least=LEAST_RESISTANCE)
        self.check_numbers("torque_constant", "gear", above=0.0)
        self.check_numbers("inductance", "rotor_inertia", "cogging", "poles", least=0.0)
        self.check_numbers("voltage", "current", above=0.0, most=math.inf, infinite=True)
        if not self.constant >= LEAST_CONSTANT or not self.scale <= LARGEST:
            raise ScenarioError(
                f"DCMotor's gear {self.gear:g} times torque_constant {self.torque_constant:g} N m/A is too weak for a "
                f"resistance of {self.resistance:g} ohm: give a stronger motor"
            )

    @property
    def constant(self) -> float:
        """Torque at the joint per ampere, N m/A (N/A)."""
        return self.gear * self.torque_constant

    @property
    def scale(self) -> float:
        """V per N m (V/N) of stall torque."""
        return self.resistance / self.constant

    @property
    def stall(self) -> float:
        """The most torque that voltage and current allow at rest, N m (N)."""
        return min(self.voltage / self.scale, self.constant * self.current)

    def edit(self, spec: mujoco.MjSpec) -> None:
        for actuator in drives(spec):
            actuator.set_to_dcmotor(
                motorconst=(self.constant, self.constant),
                resistance=self.resistance,
                inductance=(self.inductance if self.delay else 0.0, 0.0),
                ctrlspec=int(mujoco.mjtCtrlInput.mjINPUT_VOLTAGE),
            )
            actuator.ctrllimited, actuator.ctrlrange = True, (-1.0, 1.0)
            actuator.forcelimited, actuator.forcerange = True, (-1.0, 1.0)

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        ids = drive_ids(model)
        torque = self.constant * self.current
        yield Field("actuator_gainprm", (ids, WINDING), (self.resistance, self.constant))
        yield Field("actuator_dynprm", (ids, TIME_CONSTANT), self.delay)
        yield Field("actuator_biasprm", (ids, COGGING), (self.gear * self.cogging, self.gear * self.poles))
        yield Field("actuator_ctrlrange", ids, (-self.voltage, self.voltage))
        yield Field("actuator_forcerange", ids, (-torque, torque))
        driven = model.jnt_dofadr[model.actuator_trnid[ids, 0]]
        yield Field("dof_armature", driven, self.gear**2 * self.rotor_inertia, adds=True)

    def structure(self) -> Hashable:
        return type(self), self.delay > 0.0

    @property
    def delay(self) -> float:
        """L/R in s, the winding's time constant; below SUDDEN it counts as 0."""
        return self.inductance / self.resistance if self.inductance > SUDDEN * self.resistance else 0.0


class Tandem(NamedTuple):
    """Effect of a physics step on two drives in series, with output a of the first under a command u.

    Attributes:
      held: share of a in the second drive's command, u + held (a - u); 0 .. 1.
      left: share of a in its value at the end of the step, u + left (a - u); 0 .. 1.
    """

    held: float
    left: float

    def __call__(self, u: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the second drive's command over a step, and a at its end; both have the shape of u and a."""
        return u + self.held * (a - u), u + self.left * (a - u)


def tandem(actuator: tuple[Actuator, ...], step: float) -> Tandem | None:
    """Return what two drives in series do in a physics step of `step` s; None without a second drive."""
    both = [part for part in actuator if part.drives]
    if len(both) < 2:
        return None
    first, second = (step / max(drive.delay, LEAST_LAG) for drive in both)  # in their time constants
    apart = abs(second - first)
    mean = -math.expm1(-apart) / apart if apart else 1.0
    held = second * math.exp(-min(first, second)) * mean / -math.expm1(-second)
    return Tandem(held=held, left=math.exp(-first))
