"""Drives, which turn a law's command u, in N m (N on a slide), into force: lag, rate limit, DC motor.

A scenario takes one drive, or a Lag and another drive in series (`tandem`), and a Backlash after them. The limits below
hold for implicitfast, whose steps integrate the drives' states exactly for a held u.

Of two drives in series, MuJoCo simulates the second, and the callback the first: a lag, tau1 a' = u - a from a = 0,
whose output a is the second's command. MuJoCo holds that command over a physics step of length h, although a moves. So
it gets the mean of a over the step with the weights exp(-(h - t)/tau2) of the second's own lag, which has the same
effect at the end of the step. The output of two lags is then exact at the end of each step for a held u, as is that of
one lag.
"""

import dataclasses
import math
from collections.abc import Hashable, Iterator
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError, unknown
from smc_mujoco.mechanisms.hardware.part import Actuator, Nominal, drive_ids, drives
from smc_mujoco.mechanisms.plant import MAX_PARAMETER, Field

# Where a dcmotor's numbers lie in the compiled model:
WINDING = slice(0, 2)  # of actuator_gainprm: resistance, ohm, and torque constant, N m/A at the joint
SUDDEN = 1e-12  # s: a winding with a shorter time constant counts as instantaneous, else MuJoCo divides by about 0
MIN_RESISTANCE = 1e-9  # ohm: with less, the voltage of a command is lost in rounding
MIN_LAG = 1e-15  # s: a shorter first lag of two counts as this, as in MuJoCo
MIN_CONSTANT = 1e-9  # N m/A at the joint, of the weakest motor
TIME_CONSTANT, SLEW = 0, 7  # of actuator_dynprm: s, and u per s
COMMANDS = ("torque", "voltage")
COGGING = slice(0, 2)  # of actuator_biasprm: amplitude, N m at the joint, and periods a radian of it


@dataclasses.dataclass(frozen=True)
class Drive(Actuator):
    """Base of drives."""

    @property
    def stateful(self) -> bool:
        """Whether it has a state that MuJoCo integrates, inaccurately under RK4."""
        return True


@dataclasses.dataclass(frozen=True)
class Lag(Drive):
    """First-order lag, tau f' = u - f, from f = 0: the force at the end of each physics step, exact for a held u.

    Limits: implicitfast or Euler. Under RK4 MuJoCo's filter errs by h/(2 tau), and diverges below tau = h/2.8.
    tau = 0 is the plant's own actuator; it is compiled into another model than tau > 0.

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

    It is MuJoCo's dcmotor in torque mode, with a slew limit and a back-EMF too small to notice. Limits: implicitfast or
    Euler; under RK4 f lags within a step, and slopes near the rate are cut.

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
    """Motor and gearbox on a voltage amplifier: V = scale u, the voltage whose stall torque is u; or V = u.

        L i' = V - R i - gear k v        |V| <= voltage; x, v: of the joint
        torque = gear k i + gear cogging sin(gear poles x)        |torque| <= gear k current
        inertia added at the joint: gear^2 rotor_inertia

    The law does not know it: back-EMF takes (gear k)^2/R v, inductance delays by L/R. Without limits, the torque tends
    to u as gear k goes to 0. The current's limit cuts the torque, not i, which is back within a few L/R.

    With command="voltage" u is the voltage itself, in V, as on a rig whose amplifier takes volts. |u| is then bounded
    by `voltage`, too, and a law that has the nominal model has it per volt: gear k/R is part of its g, and the back-EMF
    of its f. The law's model never has the inductance, the cogging, and the limit of the current.

    Defaults: maxon RE 40, 24 V, number 148867 (data sheet; ironless: no cogging), gearhead GP 42 C 12:1, exactly
    49:4, the 30 A peak of an ESCON 70/10 amplifier: 11.1 N m and 65 rad/s at most, 0.46 N m s/rad of back-EMF. On a
    slide gear is in rad/m: a pinion of 82 mm. The gearbox has no losses: add a friction. A scenario warns of a motor
    whose torque at rest, `stall`, is less than a joint needs to stay at its initial position.

    Limits: implicitfast or Euler; with inductance 0, which is compiled into another model, RK4 too.

    Attributes:
      resistance: ohm, 1e-9 or more.
      inductance: H, 0 (current at once) or more.
      torque_constant: k, N m/A, which is V s/rad; greater than 0.
      gear: turns of the motor per turn of the joint, rad/m on a slide; greater than 0.
      rotor_inertia: kg m^2 at the motor, 0 or more.
      cogging: N m at the motor, the amplitude; 0 or more.
      poles: periods of cogging per turn of the motor, 0 or more; the default is chosen.
      voltage: V, the supply; math.inf for no limit.
      current: A, the amplifier's limit; math.inf for none.
      command: what u is: "torque", N m (N) at the joint, or "voltage", V.
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
    command: str = "torque"

    def __post_init__(self) -> None:
        if self.command not in COMMANDS:
            raise unknown("command of DCMotor", self.command, COMMANDS)
        self.check_numbers("resistance", above=0.0, least=MIN_RESISTANCE)
        self.check_numbers("torque_constant", "gear", above=0.0)
        self.check_numbers("inductance", "rotor_inertia", "cogging", "poles", least=0.0)
        self.check_numbers("voltage", "current", above=0.0, most=math.inf, infinite=True)
        if not self.constant >= MIN_CONSTANT or not self.resistance / self.constant <= MAX_PARAMETER:
            raise ScenarioError(
                f"DCMotor's gear {self.gear:g} times torque_constant {self.torque_constant:g} N m/A is too weak for a "
                f"resistance of {self.resistance:g} ohm: give a stronger motor"
            )

    @property
    def stateful(self) -> bool:
        """Whether it has a state that MuJoCo integrates, inaccurately under RK4: the winding's current."""
        return self.delay > 0.0

    @property
    def constant(self) -> float:
        """Torque at the joint per ampere, N m/A (N/A)."""
        return self.gear * self.torque_constant

    @property
    def scale(self) -> float:
        """V per unit of u: per N m (N) of stall torque, or 1 if u is the voltage."""
        return 1.0 if self.command == "voltage" else self.resistance / self.constant

    @property
    def unit(self) -> str:
        """Unit of u, "V" if it is the voltage; "" for that of the joint's force."""
        return "V" if self.command == "voltage" else ""

    @property
    def nominal(self) -> Nominal:
        """Torque per unit of u and of velocity, N m/V and N m s/rad, if u is the voltage; else u is the torque."""
        per_volt = self.constant / self.resistance
        return Nominal(per_volt, per_volt * self.constant) if self.command == "voltage" else Nominal()

    @property
    def stall(self) -> float:
        """The most torque that voltage and current allow at rest, N m (N)."""
        return min(self.voltage * self.constant / self.resistance, self.constant * self.current)

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
    """Return the effect of two drives in series in a physics step of `step` s; None without a second drive."""
    both = [part for part in actuator if part.drives]
    if len(both) < 2:
        return None
    first, second = (step / max(drive.delay, MIN_LAG) for drive in both)  # the step, in units of each time constant
    apart = abs(second - first)
    mean = -math.expm1(-apart) / apart if apart else 1.0
    held = second * math.exp(-min(first, second)) * mean / -math.expm1(-second)
    return Tandem(held=held, left=math.exp(-first))
