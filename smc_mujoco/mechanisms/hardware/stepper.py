"""A stepper motor behind a pulse generator: the command is an acceleration, and the motor follows a
field that steps.

    u, in rad/s^2 -> speed -> rate of steps -> queue of steps
      -> the motor's field -> torque ~ sin(field - shaft)

`command` is the firmware's part at a control sample, `advance` fills the queue, and `field` turns
the field. They know no MuJoCo. g, the state of one motor, is a record of GENERATOR; p is a
`Pulsing`; the queue has two numbers for a step, its time and its direction.
"""

# pyright: reportIncompatibleVariableOverride=false
# (a constant of the base class is a function or a property here)
import dataclasses
import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, NamedTuple

import mujoco
from numba.extending import register_jitable

from smc_mujoco.common.constraints import Number, Whole
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.jit import floats, pointer, record_at
from smc_mujoco.mechanisms.hardware.moments import Run, channel_at, state_at
from smc_mujoco.mechanisms.hardware.part import Actuator, Natural, Positive
from smc_mujoco.mechanisms.plant import Field, Plant

LONGEST_STEP = 2.5e-4  # s, of physics; chosen
MAX_QUEUED = 100_000  # steps of one motor; chosen, 1.6 MB
MAX_RATE = 1e7  # steps/s; chosen, drivers take 1e6 or so
MIN_REFILL = 1e-5  # s between two looks of the generator; chosen, that a run ends
ROUNDING = 1e-9  # steps/s: a rate that is less than this below a whole number is that number


@dataclasses.dataclass(frozen=True)
class Stepper(Actuator):
    """Stepper motor, driver and pulse generator: u is the wanted acceleration of the joint, rad/s^2
    (m/s^2).

    At each control sample the firmware adds u times the time since the last sample to a speed.
    Below the stop band it asks for a stop, else for steps at this rate, in whole steps/s. If the
    sign changes while steps are wanted, it asks for a stop first, and for the other direction at
    the next sample.

    The generator looks at this wish every `refill`, and adds steps to a queue until `queue` is
    filled. A step in the queue does not change any more, and its whole period is committed with it:
    a new rate acts after the queue, and up to a period later. A counter n of the steps with which
    it became faster shapes its ramp. A faster step has the period max(1/rate, 1/sqrt(2 ramp (n +
    1))), no longer than the last; a slower one 1/rate, as far as `ramp` allows it, and n - 1, at
    least 1. To stop it makes n more steps at the last period, and only then turns back. This is the
    logic of FastAccelStepper 0.33.9 (MIT) on an ATmega2560, as far as its sources tell; how it
    slows down above the speed sqrt(2 ramp) is chosen.

    The driver spreads a step of the field over the interval before it, as drivers with finer
    microsteps do. The field holds the rotor by a magnetic spring, which slips by itself if the load
    is too large:

        torque = gear torque sin(teeth gear (field - x)) - gear^2 damping v

    A law's nominal model is x'' = u. There is no model of currents: the torque does not fall with
    speed.

    A motor that slips is chaotic: the fourth digit of its torque may decide which pole catches it.
    No physics step resolves that.

    Defaults: a NEMA 17 motor of 1.8 degrees at 8 microsteps, typical numbers; damping is chosen.
    Speeds and accelerations are those of the joint, in rad or m.

    Attributes:
      steps: per turn of the motor, with microsteps; math.inf: the field turns at the commanded
        speed at once, without a generator.
      teeth: of the rotor, periods of the torque per turn of the motor; greater than 0.
      torque: N m at the motor, the largest that the field holds; greater than 0.
      damping: N m s/rad at the motor, 0 or more.
      rotor_inertia: kg m^2 at the motor, 0 or more.
      gear: turns of the motor per turn of the joint, rad/m on a slide; greater than 0.
      speed: bound on the commanded speed, rad/s (m/s), greater than 0.
      ramp: rad/s^2 (m/s^2), of the generator's ramp, and the default of u_max; greater than 0.
      stop_band: rad/s (m/s): a slower command means stop; 0 or more. A rate below 1 step/s does,
        too.
      queue: s of steps that are queued, 0 or more.
      refill: s between two looks of the generator at its queue, 0 or more, and not between 0 and
        1e-5. The first comes after a part of it that depends on the seed. If it is 0, each step is
        computed when due, whatever `queue` is.
      spread: share of the last interval over which the driver spreads a step, 0 .. 1; a step is a
        jump if it is 0.
      longest_spread: s, the longest interval that the driver measures, 0 or more; chosen: a step at
        50 Hz.
    """

    unit = "{x}/s^2"
    accelerates = True
    is_drive = True
    sums_force = True

    steps: Annotated[float, Whole(low=1, high=10**9, infinite=True)] = 1600
    teeth: Positive = 50.0
    torque: Positive = 0.4
    damping: Natural = 0.002
    rotor_inertia: Natural = 54e-7
    gear: Positive = 1.0
    speed: Positive = 40.0
    ramp: Positive = 80.0
    stop_band: Natural = 0.2
    queue: Natural = 0.02
    refill: Natural = 4.096e-3
    spread: Annotated[float, Number(low=0.0, high=1.0)] = 1.0
    longest_spread: Natural = 0.02

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.queued > MAX_QUEUED:
            long = f"queue {self.queue:g} s at a speed of {self.speed:g} is {self.queued:,} steps"
            raise ScenarioError(
                f"Stepper's {long}: "
                f"give at most {MAX_QUEUED:,}, by a shorter queue or a lower speed"
            )
        if self.steps < math.inf and self.speed * self.per_unit > MAX_RATE:
            fast = f"speed {self.speed:g} is {self.speed * self.per_unit:g} steps/s"
            raise ScenarioError(
                f"Stepper's {fast}: give at most {MAX_RATE:g}, by a lower speed or fewer steps"
            )
        if 0.0 < self.refill < MIN_REFILL:
            raise ScenarioError(
                f"Stepper's refill is {self.refill:g} s: give 0, or {MIN_REFILL:g} or more"
            )

    @property
    def per_unit(self) -> float:
        """Steps per rad (m) of the joint; rad of the motor without steps."""
        if self.steps == math.inf:
            return self.gear
        return self.gear * self.steps / math.tau

    @property
    def queued(self) -> int:
        """How many steps the queue must hold."""
        if self.steps == math.inf:
            return 1
        return 4 + math.ceil((self.queue + self.refill) * self.speed * self.per_unit)

    @property
    def stall(self) -> float:
        """The largest torque that the field holds at rest, N m (N)."""
        return self.gear * self.torque

    @property
    def bound(self) -> float:
        """The default of u_max, rad/s^2 (m/s^2)."""
        return self.ramp

    def force_at(self, bound: float) -> float:
        return self.stall

    def longest_step(self, plant: Plant) -> float:
        return LONGEST_STEP

    def suits(self, s: Any, chain: Sequence[Actuator]) -> None:
        if s.fault is not None:
            raise ScenarioError(
                "a Stepper takes an acceleration, and a Fault is of a force: leave one of them out"
            )
        if len([part for part in chain if part.drives]) > 1:
            raise ScenarioError(
                f"a Stepper is behind {shown(chain[0])}, and its firmware takes numbers, no "
                "force: leave that out, or give input_delay"
            )
        if s.law.joint and s.model != "none":
            raise ScenarioError(
                f"law {s.law.name!r} is of many joints with a nominal model, whose u is a force, "
                "and a Stepper's u is an acceleration: give model='none', a law of one channel, or "
                "another actuator"
            )

    def edit(self, spec: mujoco.MjSpec) -> None:
        for actuator in self.drives_of(spec):
            actuator.set_to_motor()
            actuator.ctrllimited = actuator.forcelimited = False

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        driven = model.jnt_dofadr[model.actuator_trnid[self.drive_ids(model), 0]]
        yield Field("dof_armature", driven, self.gear**2 * self.rotor_inertia, adds=True)
        yield Field("dof_damping", driven, self.gear**2 * self.damping, adds=True)

    @property
    def memory(self) -> int:
        """Numbers of a motor and its queue."""
        return len(GENERATOR) + 2 * self.queued

    @property
    def names(self) -> tuple[str, ...]:
        """The fields of a Pulsing."""
        return Pulsing._fields

    def numbers(self, run: Run) -> list[Sequence[float]]:
        return [pulsing(self)]

    def start(self, run: Run) -> list[Sequence[float]]:
        """Return each motor at rest, with its field at its joint, and an empty queue."""
        rows = []
        for phase, x in zip(run.phases, run.x0, strict=True):
            motor = dict.fromkeys(GENERATOR, 0.0) | {"phase": phase, "origin": x}
            motor |= {"stepped": -math.inf, "until": math.inf}
            rows.append([*motor.values(), *[0.0] * (2 * self.queued)])
        return rows

    @staticmethod
    def act(sim, data, part):
        """Give a motor its torque at a stage, in the field whose stages have its mean and moment
        over the step.
        """
        channel = channel_at(sim.channels, part.channel)
        state = state_at(sim.states, part.channel)
        p = pulsing_at(part.function.parameters, 0)
        motor = motor_at(part.function.memory, 0)
        queue = pointer(part.function.memory + MOTOR_BYTES)
        if sim.stage == 0:
            start = sim.now * sim.step
            end = (sim.now + 1) * sim.step
            if sim.arrived != 0:
                command(motor, p, state.delayed, start)
            advance(motor, p, queue, start, end)
            field(motor, p, queue, start, end)
        moved = motor.middle
        weight = 1.0
        if sim.stages > 1:  # RK4
            if sim.stage == 3:
                moved += motor.rise
            else:
                moved += -motor.rise if sim.stage == 0 else 0.0
            weight = 6.0 if sim.stage % 3 == 0 else 3.0
        force = torque(motor, p, data.qpos[channel.shaft_qpos], moved)
        data.ctrl[channel.ctrl] = force
        state.force += force / weight


def of_rig(torque: float) -> Stepper:
    """Return the stepper motor and pulse generator of rig stepper_furuta, with another holding
    torque, N m (N).
    """
    rate = math.tau / 1600.0  # rad/s of a hinge or m/s of a slide at a step a second
    return Stepper(torque=torque, speed=15e3 * rate, ramp=20e3 * rate, stop_band=50.0 * rate)


class Pulsing(NamedTuple):
    """A Stepper as its functions read it. Lengths are steps, or rad of the motor without steps."""

    per_unit: float = 0.0  # steps per rad (m) of the joint
    top: float = 0.0  # bound on the speed, steps/s
    ramp: float = 0.0  # steps/s^2
    band: float = 0.0  # stop band, steps/s
    queue: float = 0.0  # s
    refill: float = 0.0  # s
    spread: float = 0.0
    longest: float = 0.0  # s
    slots: float = 0.0  # steps that the queue has room for
    steady: float = 0.0  # 1 without steps
    sharpness: float = 0.0  # periods of the torque per rad (m) of the joint, times 2 pi
    torque: float = 0.0  # at the joint, N m (N)


# The state of a motor: the commanded speed and when it was commanded; the direction that the
# firmware wants, 0 for a stop, and its rate; of the generator the phase and number of its looks at
# the queue, the direction of its steps, its ramp's counter, the period of the last step, and the
# end of this period; numbers of the queue's first step and of the one behind its last; of the field
# the position of the driver's, the position wanted, its speed and when it ends, and the time of the
# last step; the joint's position at the start; the field's mean over a physics step, and its rise
# from the middle of the step to its end.
GENERATOR = (
    "speed",
    "commanded",
    "wanted",
    "rate",
    "phase",
    "looks",
    "direction",
    "n",
    "period",
    "free",
    "head",
    "tail",
    "position",
    "target",
    "slope",
    "until",
    "stepped",
    "origin",
    "middle",
    "rise",
)


MOTOR_BYTES = 8 * len(GENERATOR)
motor_at = record_at(floats(GENERATOR))
pulsing_at = record_at(floats(Pulsing._fields))


def pulsing(stepper: Stepper) -> Pulsing:
    """Return a Stepper as its functions read it."""
    unit = stepper.per_unit
    return Pulsing(
        per_unit=unit,
        top=stepper.speed * unit,
        ramp=stepper.ramp * unit,
        band=stepper.stop_band * unit,
        queue=stepper.queue,
        refill=stepper.refill,
        spread=stepper.spread,
        longest=stepper.longest_spread,
        slots=stepper.queued,
        steady=float(stepper.steps == math.inf),
        sharpness=stepper.teeth * stepper.gear,
        torque=stepper.gear * stepper.torque,
    )


@register_jitable
def command(g, p, u, t):
    """Give the firmware a command u at time t, s."""
    g.speed = min(max(g.speed + p.per_unit * u * (t - g.commanded), -p.top), p.top)
    g.commanded = t
    size = math.floor(abs(g.speed) + ROUNDING)
    direction = math.copysign(1.0, g.speed)
    if abs(g.speed) < p.band or size < 1.0 or direction == -g.wanted:
        g.wanted = 0.0
    else:
        g.wanted = direction
        g.rate = size


@register_jitable
def advance(g, p, queue, start, end):
    """Queue the steps of all looks of the generator from `start` to before `end`, s."""
    while p.steady == 0.0:
        if p.refill > 0.0:
            now = (g.looks + g.phase) * p.refill
        else:
            now = max(g.free, start)
        if now >= end:
            return
        while g.free <= now or (p.refill > 0.0 and g.free - now < p.queue):
            direction = next_step(g, p)
            if direction == 0.0:
                break
            slot = 2 * int(g.tail % p.slots)
            g.free = max(g.free, now)
            queue[slot] = g.free
            queue[slot + 1] = direction
            g.free += g.period
            g.tail += 1.0
        if p.refill > 0.0:
            g.looks += 1.0
        elif g.free <= now:  # it stands
            return


@register_jitable
def next_step(g, p):
    """Return the direction of the next step, whose period is `g.period`; 0 if it stands."""
    if g.direction not in (0.0, g.wanted) and g.n >= 1.0:  # it runs down
        g.n -= 1.0
        return g.direction
    if g.direction != g.wanted:
        g.direction = g.wanted
        g.n = 0.0
        g.period = math.inf
    if g.direction == 0.0:
        return 0.0
    period = 1.0 / g.rate
    if period < g.period:
        g.n += 1.0
        g.period = min(max(period, 1.0 / math.sqrt(2.0 * p.ramp * g.n)), g.period)
    elif period > g.period:
        g.n -= 1.0
        slowest = g.period**-2 - 2.0 * p.ramp
        if slowest > 0.0:
            g.period = min(period, 1.0 / math.sqrt(slowest))
        else:
            g.period = period
    g.n = max(g.n, 1.0)
    return g.direction


@register_jitable
def field(g, p, queue, start, end):
    """Turn the field from `start` to `end`, s, and keep its mean, and its rise as `drives._rise`
    defines it.
    """
    t = start
    mean = 0.0
    moment = 0.0
    if p.steady != 0.0:
        g.slope = g.speed
        g.until = math.inf
    while t < end:
        if g.head < g.tail:
            step_time = queue[2 * int(g.head % p.slots)]
        else:
            step_time = math.inf
        reached = g.until if g.slope != 0.0 else math.inf
        after = max(min(step_time, reached, end), t)
        span = after - t
        remaining = end - t
        mean += span * (g.position + 0.5 * g.slope * span)
        moment += span * (
            g.position * (remaining - 0.5 * span) + g.slope * span * (0.5 * remaining - span / 3.0)
        )
        g.position += g.slope * span
        t = after
        if t == reached:
            g.position = g.target
            g.slope = 0.0
        if t == step_time:
            g.target += queue[2 * int(g.head % p.slots) + 1]
            g.head += 1.0
            interval = p.spread * min(t - g.stepped, p.longest)
            g.stepped = t
            g.until = t + interval
            if interval > 0.0:
                g.slope = (g.target - g.position) / interval
            else:
                g.position = g.target
                g.slope = 0.0
    h = end - start
    mean = mean / h
    moment = moment / (h * h)
    g.middle = mean
    g.rise = 6.0 * (0.5 * mean - moment)


@register_jitable
def torque(g, p, x, moved):
    """Return the torque on a joint at x, when the field is at `moved`."""
    return p.torque * math.sin(p.sharpness * (g.origin + moved / p.per_unit - x))
