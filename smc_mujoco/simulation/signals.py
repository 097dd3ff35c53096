"""References r(t) and disturbances d(t), each with one pure function of time; noise, jumps and the
clock.

The float fields of a signal are its parameters p. Its function `value` is compiled, and has one of
four forms:

    value(t, p) -> (r, r', r'')                       deterministic; of a disturbance only r counts
    value(t, p, memory, seed, channel, stream)        process noise
    value(t, p, data)                                 a series, which holds an array
    value(t, p, memory, e, de, s)                     a disturbance that sees the loop

The memory of process noise is its state in one channel. The stream number separates it from the
other noises of a run. Times are in seconds. A reference is in m or rad, a disturbance in N or N m.
"""

import dataclasses
import math
from collections import namedtuple
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from typing import Annotated, ClassVar

import numpy as np
from numba import njit
from numba.extending import register_jitable

from smc_mujoco.common.aliases import Numbers, Pair
from smc_mujoco.common.constraints import Boolean, Natural, Number, Positive, constrain, suggesting
from smc_mujoco.common.data import frozen_data
from smc_mujoco.common.errors import ScenarioError, items_of, number, shown
from smc_mujoco.common.frozen import Frozen, frozen
from smc_mujoco.simulation import philox
from smc_mujoco.simulation.part_numbers import is_path

FOOT = 0.3048  # m
SAMPLES = 500  # of a reference, where its extremes are looked for; chosen
EARLY = (
    1.0 - 1e-15
)  # factor on a switching time, because sums of decimal times differ from it by an ulp or two
MAX_MISSED = 0.99  # probability; chosen: of a hundred samples one runs
MAX_BEAT = 32  # periods of a beat, chosen: runs are seldom longer
SAME_RATIO = 1e-6  # of the ratio of two periods, chosen: a phase moves by no more in a run
SINUSOIDS = (
    32  # of band-limited noise; chosen: its kurtosis is 3 - 3/64, 1.6 % below that of a Gaussian
)


@frozen_data
class Signal:
    """Base of all signals, which checks that every parameter is a finite number, within the
    constraint of its type.

    Your own r(t) or d(t) is `smc.signals.TimeSeries(times, values)`, or `Held`, of your numbers; or
    a frozen dataclass with a function of time, which is compiled, and returns the value and its
    first two derivatives (0 will do for a disturbance):

        @dataclasses.dataclass(frozen=True)
        class Decay(smc.Signal):
            amplitude: float = 1.0

            @staticmethod
            def value(t, p):
                return p.amplitude * math.exp(-t), 0.0, 0.0

        smc.run(smc.Scenario(plant="duffing", law="pid", disturbance=Decay(0.5), duration=1.0))

    A signal that repeats itself after a time has an attribute or a property `period`, s: metrics of
    the last part of a run are then taken over whole periods.

    If the class attribute `cartesian` is true, the signal is a force on bodies, N, not on joints: a
    `Push` on one body, or else a horizontal force on the body of each channel.
    """

    memory: ClassVar[int] = 0  # floats of state in each channel
    random: ClassVar[bool] = False  # whether `value` takes memory, seed, channel and stream
    series: ClassVar[bool] = False  # whether `value` takes data
    sees: ClassVar[bool] = (
        False  # whether `value` takes e, de and s; then it is called once per control sample
    )
    rows: ClassVar[int] = 2  # of `data`
    cartesian: ClassVar[bool] = False
    air: ClassVar[bool] = False  # whether it is a wind, m/s
    data: ClassVar[np.ndarray]  # of a series, (rows, N) float64, C-contiguous
    value: ClassVar[
        Callable[..., tuple[float, float, float]]
    ]  # static: value, first and second derivative

    def __post_init__(self):
        constrain(self)
        for name, value in self.parameters().items():
            object.__setattr__(self, name, number(f"{type(self).__name__}'s {name}", value))

    def parameters(self) -> dict[str, float]:
        """Return parameter name -> value."""
        return {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}

    def __add__(self, other: "Signal") -> "Signal":
        """Return the sum of two signals of time, such as Constant(-1.57) + Sine(0.1, 3.0)."""
        return added(self, other)

    @property
    def along(self) -> tuple[float, float, float]:
        """What the value of a signal in space is multiplied by along each axis of the world."""
        return getattr(self, "x", 0.0), getattr(self, "y", 0.0), getattr(self, "z", 0.0)


@frozen_data
class PerChannel(Signal):
    """A separate reference for each driven channel.

    A scenario makes it when it is given several references.
    """

    signals: tuple[Signal, ...]

    def parameters(self) -> dict[str, float]:
        return {}  # each signal has its own


@suggesting
@frozen_data
class Constant(Signal):
    """r(t) = amplitude."""

    amplitude: float = 0.0

    @staticmethod
    def value(t, p):
        return p.amplitude, 0.0, 0.0


@suggesting
@frozen_data
class Sine(Signal):
    """r(t) = amplitude sin(omega t + phase); omega in rad/s.

    As a reference with about="goal" it is added to the plant's default goal.
    """

    amplitude: float
    omega: float
    phase: float = 0.0
    about: dataclasses.InitVar[str] = ""

    def __post_init__(self, about: str):
        super().__post_init__()
        if not isinstance(about, str) or about not in ("", "goal"):
            raise ScenarioError(f"Sine's about is {shown(about)}: give 'goal', or leave it out")
        object.__setattr__(self, "about", about)

    @property
    def period(self) -> float:
        """The period, s; 0 of a constant."""
        return abs(2.0 * math.pi / self.omega) if self.omega and self.amplitude else 0.0

    @staticmethod
    def value(t, p):
        angle = p.omega * t + p.phase
        r = p.amplitude * math.sin(angle)
        return r, p.amplitude * p.omega * math.cos(angle), -p.omega * p.omega * r


@suggesting
@frozen_data
class Step(Signal):
    """0 before `time`, amplitude from then on."""

    amplitude: float
    time: float = 0.0

    @staticmethod
    def value(t, p):
        return (p.amplitude if t >= p.time * EARLY else 0.0), 0.0, 0.0


@suggesting
@frozen_data
class Ramp(Signal):
    """0 before `time`, slope (t - time) from then on; slope in the signal's unit per second."""

    slope: float
    time: float = 0.0

    @staticmethod
    def value(t, p):
        if t < p.time * EARLY:
            return 0.0, 0.0, 0.0
        return p.slope * (t - p.time), p.slope, 0.0


@suggesting
@frozen_data
class MinimumJerk(Signal):
    """amplitude (10 a^3 - 15 a^4 + 6 a^5), a = (t - time)/duration clipped to 0 .. 1: from rest to
    rest.

    No other move in that time has a smaller integral of the squared jerk. Velocity and acceleration
    are 0 at both ends. Source: T. Flash & N. Hogan, "The coordination of arm movements: an
    experimentally confirmed mathematical model", J. Neuroscience 5(7):1688, 1985.
    """

    amplitude: float
    time: float
    duration: Positive

    @staticmethod
    def value(t, p):
        a = min(max((t - p.time) / p.duration, 0.0), 1.0)
        b = 1.0 - a
        T = p.duration
        r = p.amplitude * a * a * a * (10.0 - a * (15.0 - 6.0 * a))
        return (
            r,
            p.amplitude * 30.0 * a * a * b * b / T,
            p.amplitude * 60.0 * a * b * (1.0 - 2.0 * a) / (T * T),
        )


@suggesting
@frozen_data
class Pulse(Signal):
    """amplitude for time <= t < time + width, else 0."""

    amplitude: float
    time: float
    width: Positive

    @staticmethod
    def value(t, p):
        on = p.time * EARLY <= t < (p.time + p.width) * EARLY
        return (p.amplitude if on else 0.0), 0.0, 0.0


@suggesting
@frozen_data
class Impulse(Signal):
    """impulse / width for time <= t < time + width, else 0: a blow with the time integral
    `impulse`, N s or N m s.

    The integral is exact if width is a whole number of physics steps, as 5 ms is for default steps.
    """

    impulse: float
    time: float
    width: Positive = 5e-3

    def __post_init__(self):
        super().__post_init__()
        number("Impulse's force, impulse / width,", self.impulse / self.width)

    @staticmethod
    def value(t, p):
        on = p.time * EARLY <= t < (p.time + p.width) * EARLY
        return (p.impulse / p.width if on else 0.0), 0.0, 0.0


@suggesting
@frozen_data
class Gust(Signal):
    """amplitude/2 (1 - cos(2 pi (t - time)/width)) for time <= t <= time + width, else 0: a
    horizontal force, N.

    The discrete gust of 14 CFR 25.341(a)(2) and EASA CS-25.341(a)(2), U = U_ds/2 (1 - cos(pi s/H))
    for 0 <= s <= 2H, here as a force over time, where `width` stands for 2H. (The gust of
    MIL-F-8785C rises in the same way and stays.) It acts on the centre of mass of every channel's
    body: the force on a slide is F, the torque on a bob F l cos x.
    """

    amplitude: float
    time: float
    width: Positive

    cartesian = True

    @staticmethod
    def value(t, p):
        part = (t - p.time) / p.width
        if not 0.0 <= part <= 1.0:
            return 0.0, 0.0, 0.0
        return p.amplitude / 2.0 * (1.0 - math.cos(2.0 * math.pi * part)), 0.0, 0.0


@suggesting
@frozen_data
class Push(Signal):
    """A force in space on the centre of mass of one body, in the shape of a half sine: a blow on
    the arm.

    (x, y, z) sin(pi (t - time) / width) for time <= t <= time + width, else 0. The impulse is 2
    width / pi (x, y, z). On plants whose disturbances act on joints, as on the panda and on users'
    models, a trace's d does not contain the push. On others, d has its effect on the body's joint:
    the force along a slide, or the torque of its horizontal part about a hinge.

    Attributes:
      body: its name in the model.
      x, y, z: the peak in the axes of the world, N.
      time, width: s.
    """

    body: str
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    time: float = 1.0
    width: Positive = 0.05

    cartesian = True

    def parameters(self) -> dict[str, float]:
        return {name: getattr(self, name) for name in ("x", "y", "z", "time", "width")}

    @staticmethod
    def value(t, p):
        part = (t - p.time) / p.width
        if not 0.0 <= part <= 1.0:
            return 0.0, 0.0, 0.0
        return math.sin(math.pi * part), 0.0, 0.0


@suggesting
@frozen_data
class Wind(Signal):
    """Air that moves past a body with drag, such as the `quadrotor`; a trace's d has the force that
    it exerts.

    (x, y, z) from `time` on, or with a width the gust (x, y, z) (1 - cos(2 pi (t - time) / width))
    / 2 while it lasts.

    Attributes:
      x, y, z: speed in the axes of the world, m/s.
      time: s.
      width: s; 0: the wind stays.
    """

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    time: float = 0.0
    width: Natural = 0.0

    air = True

    @staticmethod
    def value(t, p):
        if t < p.time * EARLY:
            return 0.0, 0.0, 0.0
        if p.width == 0.0:
            return 1.0, 0.0, 0.0
        part = (t - p.time) / p.width
        return (0.5 - 0.5 * math.cos(2.0 * math.pi * part) if part < 1.0 else 0.0), 0.0, 0.0


@suggesting
@frozen_data
class Dryden(Signal):
    """Turbulence of MIL-F-8785C at low altitude: wind past a body with drag, of its own spectrum
    along x, y and z.

    The world's x is taken for the direction of the mean wind. With h the height in feet, b = 0.177
    + 0.000823 h, lengths L_z = h and L_x = L_y = h/b^1.2 feet, standard deviations s_z = 0.1 w20
    and s_x = s_y = s_z/b^0.4, and T = L/speed:

        s sqrt(2 T)/(1 + T p) along x,    s sqrt(T) (1 + sqrt(3) T p)/(1 + T p)^2 along y and z

    of white noise, with p of Laplace's transform. Both are discretised exactly on knots dt apart
    and are linear between, so that the rms is s whatever the step. `Wind` gives the mean. Source:
    MIL-F-8785C (1980), 3.7.

    Attributes:
      w20: wind at 20 feet, m/s: 7.7 light, 15 moderate, 23 severe.
      height: m, from 3.05 to 305.
      speed: of the air past the body, m/s. At hover in no wind the spectrum is singular: give 1 or
        more.
      dt: s.
    """

    w20: Natural
    height: Annotated[float, Number(low=3.04, high=305.0)] = 3.05
    speed: Annotated[float, Number(low=0.1, high=1e3)] = 1.0
    dt: Positive = 1e-3

    x: ClassVar[float] = 1.0  # the value is the wind itself
    y: ClassVar[float] = 1.0
    z: ClassVar[float] = 1.0
    memory = 5  # next knot, the two states, value at the last knot, value at the next
    random = True
    air = True

    @staticmethod
    def value(t, p, memory, seed, channel, stream):
        feet = p.height / FOOT
        b = 0.177 + 0.000823 * feet
        size = 0.1 * p.w20
        length = p.height
        if channel < 2.0:
            size, length = size / b**0.4, length / b**1.2
        return (
            _dryden(
                t,
                size,
                length / p.speed,
                p.dt,
                memory,
                seed,
                channel,
                stream,
            ),
            0.0,
            0.0,
        )


@njit(error_model="numpy")
def _dryden(t, sigma, T, dt, memory, seed, channel, stream):
    """Return the wind along one axis: of first order along the mean wind (channel 0), else of
    second.
    """
    root = math.sqrt(3.0)
    knot = t / dt
    x = dt / T
    decay = math.exp(-x)
    if memory[0] == 0.0:  # the stationary state
        z = philox.normals(seed, channel, stream, 0)
        memory[1] = sigma * (z[0] if channel == 0.0 else math.sqrt(0.5) * z[0])
        memory[2] = sigma * (math.sqrt(0.125) * z[0] + math.sqrt(0.125) * z[1])
        if channel == 0.0:
            memory[4] = memory[1]
        else:
            memory[4] = root * memory[1] + (1.0 - root) * memory[2]
    while memory[0] <= knot:
        memory[3] = memory[4]
        memory[0] += 1.0
        z = philox.normals(seed, channel, stream, memory[0])
        if channel == 0.0:
            memory[1] = decay * memory[1] + sigma * math.sqrt(-math.expm1(-2.0 * x)) * z[0]
            memory[4] = memory[1]
            continue
        first = -0.5 * math.expm1(-2.0 * x)  # covariances of both states' noise in a step
        covariance = 0.25 - decay * decay * (0.5 * x + 0.25)
        second = 0.25 - decay * decay * (0.5 * x * x + 0.5 * x + 0.25)
        a = math.sqrt(first)
        c = covariance / a
        p = decay * memory[1]
        q = decay * (x * memory[1] + memory[2])
        memory[1] = p + sigma * a * z[0]
        memory[2] = q + sigma * (c * z[0] + math.sqrt(max(0.0, second - c * c)) * z[1])
        memory[4] = root * memory[1] + (1.0 - root) * memory[2]
    return memory[4] + (memory[0] - knot) * (memory[3] - memory[4])


@suggesting
@frozen_data
class Relay(Signal):
    """A disturbance that sees the loop: it goes to `amplitude` if s sigma + rate e' + error e > 0,
    else to -amplitude.

    It sees the true error e, its rate e' and the law's sliding variable sigma at a control sample.
    It is constant until the next. With a positive `rate` alone it pushes along the motion: no other
    |d| <= amplitude gives the loop more energy. With a `slope` above 0 it changes by at most
    `slope` from sample to sample. Before `start` it is 0. All channels get the force of channel 0.

    Attributes:
      amplitude: N or N m.
      s, rate, error: weights of sigma, of e' and of e.
      slope: largest change between two control samples, N or N m; 0: no limit.
      start: s.
    """

    amplitude: float
    s: float = 0.0
    rate: float = 0.0
    error: float = 0.0
    slope: Natural = 0.0
    start: Natural = 0.0

    memory = 1  # its force now
    sees = True

    @staticmethod
    def value(t, p, memory, e, de, s):
        if p.s * s + p.rate * de + p.error * e > 0.0:
            goal = p.amplitude
        else:
            goal = -p.amplitude
        goal = 0.0 if t < p.start else goal
        step = goal - memory[0]
        if p.slope == 0.0:
            memory[0] = goal
        else:
            memory[0] = memory[0] + min(max(step, -p.slope), p.slope)
        return memory[0], 0.0, 0.0


@suggesting
@frozen_data
class OrnsteinUhlenbeck(Signal):
    """Process noise with standard deviation sigma and correlation time tau, independent in every
    channel.

    d_(k+1) = a d_k + sigma sqrt(1 - a^2) n_k, a = exp(-dt/tau), on knots dt apart and linear
    between them: the exact discretisation (Gillespie 1996, Phys. Rev. E 54:2084), stationary from
    the start. Neither knots nor path depend on the physics step and the control period. `dt`
    defaults to 1 ms.
    """

    sigma: Natural
    tau: Positive
    dt: Positive = 1e-3

    memory = 3  # next knot, value at the last knot, value at the next
    random = True

    @staticmethod
    def value(t, p, memory, seed, channel, stream):
        return (
            _ornstein_uhlenbeck(
                t,
                p.sigma,
                p.tau,
                p.dt,
                memory,
                seed,
                channel,
                stream,
            ),
            0.0,
            0.0,
        )


@njit(error_model="numpy")
def _ornstein_uhlenbeck(t, sigma, tau, dt, memory, seed, channel, stream):
    knot = t / dt
    if memory[0] == 0.0:
        memory[2] = sigma * philox.normals(seed, channel, stream, 0)[0]
    a = math.exp(-dt / tau)
    while memory[0] <= knot:
        memory[1] = memory[2]
        memory[0] += 1.0
        memory[2] = (
            a * memory[1]
            + sigma * math.sqrt(1.0 - a * a) * philox.normals(seed, channel, stream, memory[0])[0]
        )
    return memory[2] + (memory[0] - knot) * (memory[1] - memory[2])


@suggesting
@frozen_data
class BandLimited(Signal):
    """Process noise of standard deviation sigma between the frequencies low and high, Hz,
    independent in every channel.

    d(t) = sigma sqrt(2/N) sum cos(2 pi f_i t + phi_i), N = 32, phi_i uniform: the spectral
    representation of a flat spectrum (Shinozuka & Deodatis 1991, Appl. Mech. Rev. 44:191). f_i is
    uniform in the i-th of N equal parts of the band, so that the path does not repeat after N/(high
    - low) seconds (Shinozuka & Jan 1972, J. Sound Vib. 25:111). The path is the same under every
    physics step and control period.
    """

    sigma: Natural
    low: Natural
    high: float

    memory = 2 * SINUSOIDS  # angular frequencies, phases
    random = True

    def __post_init__(self):
        super().__post_init__()
        if self.high <= self.low:
            raise ScenarioError(
                f"BandLimited's high is {self.high:g} Hz: give more than low, {self.low:g} Hz"
            )

    @staticmethod
    def value(t, p, memory, seed, channel, stream):
        return (
            _band_limited(
                t,
                p.sigma,
                p.low,
                p.high,
                memory,
                seed,
                channel,
                stream,
            ),
            0.0,
            0.0,
        )


@njit(error_model="numpy")
def _band_limited(t, sigma, low, high, memory, seed, channel, stream):
    if memory[SINUSOIDS - 1] == 0.0:
        for i in range(SINUSOIDS):
            part = (i + philox.uniform(seed, channel, stream, 2 * i)) / SINUSOIDS
            memory[i] = 2.0 * math.pi * (low + part * (high - low))
            memory[SINUSOIDS + i] = 2.0 * math.pi * philox.uniform(seed, channel, stream, 2 * i + 1)
    total = 0.0
    for i in range(SINUSOIDS):
        total += math.cos(memory[i] * t + memory[SINUSOIDS + i])
    return sigma * math.sqrt(2.0 / SINUSOIDS) * total


def common_period(signals: Iterable[Signal]) -> float:
    """Return the period of signals together, s: that of their beat; 0 if none is periodic, inf if
    it is more than MAX_BEAT of the longest period.
    """
    together = 0.0
    for signal in signals:
        parts = getattr(signal, "signals", None)
        period = float(getattr(signal, "period", 0.0) if parts is None else common_period(parts))
        if not together or not period:
            together = together or period
            continue
        ratio = max(together, period) / min(together, period)
        beat = Fraction(ratio if ratio < MAX_BEAT else 0.0).limit_denominator(MAX_BEAT)
        if abs(beat - ratio) > SAME_RATIO * ratio:
            return math.inf
        together = max(together, period) * beat.denominator
    return together


def bounds_of(signal: Signal) -> Pair | None:
    """Return bounds of |d| and |d'|, the second inf if d jumps; None if they are not known."""
    match signal:
        case Constant(amplitude=a):
            return abs(a), 0.0
        case Sine(amplitude=a, omega=omega):
            return abs(a), abs(a * omega)
        case MinimumJerk(amplitude=a, duration=T):
            return abs(a), 1.875 * abs(a) / T
        case Step(amplitude=a) | Pulse(amplitude=a) | Relay(amplitude=a):
            return abs(a), math.inf
    return None


@suggesting
@frozen_data
class Noise:
    """Measurement noise:

    Gaussian with mean 0, plus errors that are known functions of time, equal in all channels.

    Attributes:
      position, velocity: standard deviations, in SI units.
      position_error, velocity_error: signals that are added to what is measured, such as
        Held(times, values).
    """

    position: Natural = 0.0
    velocity: Natural = 0.0
    position_error: Signal | None = dataclasses.field(default=None, repr=False)
    velocity_error: Signal | None = dataclasses.field(default=None, repr=False)

    def __post_init__(self):
        constrain(self)
        for error in self.errors:
            is_signal = isinstance(error, Signal | None) and not isinstance(error, PerChannel)
            if not is_signal or (
                error and (error.random or error.cartesian or error.sees or error.air)
            ):
                cure = "give a known signal, such as smc.signals.Held(times, values)"
                raise ScenarioError(f"Noise's error is {shown(error)}: {cure}")

    @property
    def errors(self) -> tuple[Signal | None, Signal | None]:
        """The errors of position and velocity."""
        return self.position_error, self.velocity_error


@suggesting
@frozen_data
class Jump:
    """A change of the plant's parameters, or of numbers of parts, at `time`, s, for the rest of the
    run.

        smc.Jump(time=2.0, factors={"friction.elbow.level": 0.7})  # a gearbox that is warm

    `factors` has names with the factors that multiply them: parameters of the plant, numbers of a
    model's joints and bodies ("elbow.damping", "hand.payload"), and paths to numbers of parts,
    FIELD.JOINT.NAME or FIELD.NAME. For parameters in `plant.added`, such as the payload of an arm
    of the library, and for numbers that are 0, it has terms, which are added. Your own model has
    "mass", of all bodies at once, "grav", and numbers of its joints and bodies.

    What a part keeps, such as the bend of bristles, stays as it is. The law and its bound on u do
    not know of the change. The u of a DCMotor by torque is its stall torque after it, too.
    """

    time: Natural
    factors: Numbers

    def __post_init__(self):
        constrain(self)
        object.__setattr__(self, "factors", parameter_factors("Jump", self.factors))

    @property
    def of_parts(self) -> dict[str, float]:
        """The factors on numbers of parts, by path."""
        return {path: factor for path, factor in self.factors.items() if is_path(path)}

    @property
    def of_plant(self) -> dict[str, float]:
        """The factors on parameters of the plant."""
        return {name: factor for name, factor in self.factors.items() if not is_path(name)}

    @property
    def text(self) -> str:
        """When it is, in words."""
        return f"jump at {self.time:g} s"


@suggesting
@frozen_data
class Fault:
    """A fault of the actuators that begins at time `at`, s, and stays.

    Each gives `gain` times its command plus `bias`, N m, N or the unit of u; or, if `stuck`, what
    it was told last. The law does not know. Drives come after it: behind a Lag the force follows.
    `on` is the name of the one joint, or of the one thruster, that fails; default: all do. The keys
    of `smc.metrics.joint_scores(trace)` are the joints' names.
    """

    at: Natural
    gain: Annotated[float, Number(low=-10.0, high=10.0)] = 1.0
    bias: Annotated[float, Number(low=-1e9, high=1e9)] = 0.0
    stuck: Boolean = False
    on: str | None = None

    def __post_init__(self):
        constrain(self)
        if self.stuck and (self.gain, self.bias) != (1.0, 0.0):
            raise ScenarioError(
                f"Fault is stuck with gain {self.gain:g} and bias {self.bias:g}: leave those out, "
                "as what is stuck keeps its last command"
            )

    @property
    def words(self) -> str:
        """What it does, such as "actuator × 0.5"."""
        who = self.on or "actuator"
        if self.stuck:
            return f"{who} stuck"
        said = []
        if self.gain != 1.0:
            said.append(f"{who} × {self.gain:g}")
        if self.bias:
            said.append(f"{who} {'−' if self.bias < 0.0 else '+'} {abs(self.bias):g}")
        return ", ".join(said) or "no fault"

    @property
    def text(self) -> str:
        """What it does and when, in words."""
        return f"{self.words} at {self.at:g} s"


def parameter_factors(name: str, value: object) -> Frozen[float]:
    """Return parameter name -> factor, checked; `name` is for errors."""
    if not isinstance(value, Mapping):
        raise ScenarioError(
            f"{name} is {shown(value)}: give parameter names with their factors, such as {{'M': "
            "1.3}"
        )
    factors = {}
    for key, factor in value.items():
        factors[str(key)] = number(f"{name} of {key}", factor)
    return frozen(factors)


@register_jitable
def after_pauses(k, steps, length, samples, phase):
    """Return by how many physics steps sample k of the grid is late in a loop with pauses; -1 if a
    pause covers it.

    A period has `steps` physics steps, a pause `length`; one follows every `samples` samples, the
    first `phase` fewer.
    """
    cycle = samples * steps + length
    end = (k + 1 + phase) * steps - 1
    within = end % cycle
    sample = within // steps
    if sample >= samples:
        return -1
    return steps - 1 - (within - sample * steps)


@suggesting
@frozen_data
class Clock:
    """The timer of the controller.

    A sensor with a clock of its own is an `Encoder` with a `period`.

    A real-time task is woken once in every control period T, a little late. Sample k runs at

        t_k = k T + late_k,    late_k uniform among the physics steps from 0 to `jitter`,

    or not at all: then neither estimator nor law sees that sample. The first and the last sample
    are on time. Which samples are late or missed depends on the seed and k alone.

    A loop without a real-time system waits until a period is over, and has a pause when it does
    something else, such as writing a line of text. All later samples are then later by the pause:
    sample k T of the grid runs where the loop's next sample falls, and one that a pause covers is
    missed.

    Attributes:
      jitter: s, the largest delay of a sample; shorter than the control period. Each sample is late
        by a whole number of physics steps, all equally probable. The law reads the true time in
        `y.t` and the nominal period in `y.dt`, as on a machine whose task does not measure its
        period.
      missed: probability that a sample is missed, 0 .. 0.99. The last command then stays.
      pause: s of a pause, 0 (none) or more; not with `jitter`. Times are rounded to whole physics
        steps.
      pause_every: s between two pauses, without these, at least a control period. The first comes
        after a part of it that depends on the seed.
    """

    jitter: Natural = 0.0
    missed: Annotated[float, Number(low=0.0, high=MAX_MISSED)] = 0.0
    pause: Natural = 0.0
    pause_every: Positive = 1.0

    def __post_init__(self):
        constrain(self)
        if self.pause and self.jitter:
            raise ScenarioError(
                f"Clock has jitter {self.jitter:g} and pause {self.pause:g} s: give one of them"
            )

    @property
    def regular(self) -> bool:
        """Whether all samples run, and on time."""
        return not (self.jitter or self.missed or self.pause)

    def pauses(self, control_period: float, physics_step: float) -> tuple[int, int]:
        """Return the length of a pause in physics steps, and the samples from one to the next; 0, 1
        without pauses.
        """
        length = round(self.pause / physics_step)
        if length:
            return (length, max(1, round(self.pause_every / control_period)))
        return (0, 1)

    def jitter_steps(self, physics_step: float) -> int:
        """Return the largest delay of a sample in physics steps."""
        return math.floor(self.jitter / physics_step + 1e-6)

    def check(self, control_period: float, physics_step: float) -> None:
        """Raise ScenarioError for a jitter that reaches the next sample, or is shorter than a
        physics step.
        """
        steps = round(control_period / physics_step)
        shorter = self.jitter < control_period
        if not self.jitter or (shorter and 1 <= self.jitter_steps(physics_step) < steps):
            return
        if steps > 1:
            cure = f"give at least a physics step, {physics_step:g} s,"
        else:
            cure = (
                f"give a physics_step of {control_period / 4.0:g} s, for example, and a jitter of "
                "at least a physics step,"
            )
        raise ScenarioError(
            f"Clock's jitter is {self.jitter:g} s: {cure} and less than the control period, "
            f"{control_period:g} s, and missed=... for samples that do not run"
        )


@frozen_data
class Sum(Signal):
    """The sum of constants, sines, steps, ramps and moves of minimum jerk, as `+` makes it.

    Disturbances of any kind are added where a scenario gets a tuple: disturbance=(first, second). A
    reference of other kinds is your own `smc.Signal`.
    """

    signals: tuple[Signal, ...]

    series = True
    rows = 4  # the number of the kind in KINDS, and up to three parameters

    def __post_init__(self):
        object.__setattr__(self, "signals", tuple(items_of("signals of Sum", self.signals)))
        table = np.zeros((self.rows, len(self.signals)))
        for column, signal in zip(table.T, self.signals, strict=True):
            if type(signal) not in KINDS or getattr(signal, "about", ""):
                names = ", ".join(kind.__name__ for kind in KINDS)
                raise ScenarioError(
                    f"{shown(signal)} cannot be added to a signal: give one of {names}"
                )
            numbers = list(signal.parameters().values())
            column[0] = KINDS.index(type(signal))
            column[1 : 1 + len(numbers)] = numbers
        object.__setattr__(self, "data", table)
        self.data.flags.writeable = False

    def __reduce__(self):  # a copy has separate data, also read-only
        return type(self), (self.signals,)

    def parameters(self) -> dict[str, float]:
        return {}  # each signal has its own

    @staticmethod
    def value(t, p, data):
        r, dr, ddr = 0.0, 0.0, 0.0
        for k in range(data.shape[1]):
            term = _part_of_sum(t, data[0, k], data[1, k], data[2, k], data[3, k])
            r += term[0]
            dr += term[1]
            ddr += term[2]
        return r, dr, ddr


KINDS = Constant, Sine, Step, Ramp, MinimumJerk  # what a Sum may have
_constant, _sine, _step, _ramp, _jerk = (njit(error_model="numpy")(kind.value) for kind in KINDS)


def _record(kind: type) -> type:
    """Return the type of a signal's numbers in compiled code."""
    return namedtuple(kind.__name__, [field.name for field in dataclasses.fields(kind)])


_Constant, _Sine, _Step, _Ramp, _Jerk = map(_record, KINDS)


@njit(error_model="numpy")
def _part_of_sum(t, kind, a, b, c):
    if kind == 0.0:
        return _constant(t, _Constant(a))
    if kind == 1.0:
        return _sine(t, _Sine(a, b, c))
    if kind == 2.0:
        return _step(t, _Step(a, b))
    if kind == 3.0:
        return _ramp(t, _Ramp(a, b))
    return _jerk(t, _Jerk(a, b, c))


def extremes(signal: Signal, duration: float) -> Pair:
    """Return the least and the largest value of a signal of time among SAMPLES of a duration, s."""
    if isinstance(signal, Sum):
        parts = signal.signals
    elif signal.series:
        return float(signal.data[1].min()), float(signal.data[1].max())
    else:
        parts = (signal,)
    total = np.zeros(SAMPLES)
    for part in parts:
        for k, t in enumerate(np.linspace(0.0, duration, SAMPLES).tolist()):
            total[k] += type(part).value(t, part)[0]
    return float(total.min()), float(total.max())


def added(first: Signal, second: Signal) -> Sum:
    """Return the sum of two signals, which may be sums."""
    parts = []
    for signal in (first, second):
        parts += signal.signals if isinstance(signal, Sum) else (signal,)
    return Sum(tuple(parts))
