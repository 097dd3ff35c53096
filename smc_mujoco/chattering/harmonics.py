"""Harmonic balance: what a compiled law returns for a sinusoidal error, and how the mechanism
answers a sinusoidal u.

The response is that of MuJoCo's model, linearised about rest by finite differences, with drives,
back-EMF, springs and joints without an actuator. The gain is that of the compiled law, with its
estimator and its surface, at its control period, under an excitation: an error that oscillates for
some periods. There is no approximation but that this error is a sine. Play between rotor and joint
is a second nonlinear element, see `play`, and multiplies the gain.
"""

import copy
import dataclasses
import functools
import itertools
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.analysis.state_space import NONLINEAR_FLAGS, rates
from smc_mujoco.common.aliases import Array, ArrayPair, Floats, Pair
from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.jit import NotCompilable, call
from smc_mujoco.common.mjcb import installed
from smc_mujoco.control.component import Component
from smc_mujoco.control.law import Measurement
from smc_mujoco.mechanisms.hardware.backlash import Backlash
from smc_mujoco.mechanisms.hardware.command_filter import CommandFilter
from smc_mujoco.mechanisms.hardware.drives import DCMotor
from smc_mujoco.mechanisms.hardware.elastic_joint import ElasticJoint
from smc_mujoco.mechanisms.hardware.part import Actuator
from smc_mujoco.mechanisms.hardware.position_servo import PositionServo
from smc_mujoco.mechanisms.layout import dof_ids, drive_ids, moving_joints
from smc_mujoco.simulation import cfunctions
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.scenario import Scenario

DIFFERENCE_STEP = 1e-6  # SI units, of finite differences
MAX_SAMPLES_PER_PERIOD = 1000  # of an excitation: a law that would take more is called this often
# times the largest number in a period: about as many samples has an excitation
EXCITATION_SAMPLES = 3
MIN_PERIODS, MAX_PERIODS = 12, 600  # of an excitation
SETTLING_SHARE = 0.4  # of an excitation, while memories settle: left out
REST_SAMPLES = 1000  # samples before an encoder's reading moves by one count, and as many after it
MAX_HARMONICS = 31  # of u that pass through the mechanism: the peak of a triangle is right to 1.3 %
NEGLIGIBLE_SHARE = 1e-9  # of the first harmonic, below which another one is left out
# passes of the harmonics through mechanism and law: a third changes amplitudes by less than 0.2 %
HARMONIC_PASSES = 2
SAMPLE_POSITIONS = 16  # tried places of the first sample in its control period
FIELDS = {name: i for i, name in enumerate(Measurement._fields)}
T, DT, X, V, E, DE, F, G, A = map(
    Measurement._fields.index, ("t", "dt", "x", "v", "e", "de", "f", "g", "a")
)
LIMIT, MODEL, HAS_SURFACE, S, V_EQ = map(
    Measurement._fields.index, ("limit", "model", "has_surface", "s", "v_eq")
)
Q, DQ, FQ, GQ = map(Measurement._fields.index, ("q", "dq", "fq", "gq"))


@dataclasses.dataclass(frozen=True)
class Wave:
    """What a law returns for e = amplitude sin(omega t), plus the harmonics that the mechanism lets
    through.
    """

    amplitude: float  # of the first harmonic of e, rad or m
    omega: float  # rad/s
    # first harmonic of u over that of e, unit of u per rad or m, times the describing function of
    # play
    gain: complex
    third: float  # third harmonic of s over the first
    s: float  # half the range of the sliding variable
    u: float  # half the range of u
    rate: float  # amplitude of the first harmonic of s, times omega
    drift: float  # relative change of the gain from the first to the second half of the excitation


class Loop:
    """The law and the linearised mechanism of one driven channel of a scenario."""

    def __init__(self, scenario: Scenario, channel: int = 0):
        self.scenario = scenario
        self.channel = channel
        self.delay = 0.0
        s = scenario.resolved
        plant = s.plant
        if not s.clock.regular:
            raise ScenarioError(
                "chattering is predicted for samples that are on time: measure it in a run"
            )
        if s.accelerates:
            raise ScenarioError(
                "chattering is not predicted for a Stepper, whose queue is no lag: measure it in "
                "a run"
            )
        for part in s.actuator:
            if part.force is not None:
                raise ScenarioError(
                    f"chattering is not predicted behind {type(part).__name__}, whose force is a "
                    "function of your own: measure it in a run"
                )
            if isinstance(part, PositionServo) and part.by_pid:
                raise ScenarioError(
                    "chattering is not predicted for a PositionServo with ki or slewmax: measure "
                    "it in a run"
                )
            if isinstance(part, PositionServo) and (part.goal or part.step):
                raise ScenarioError(
                    "chattering is predicted about x = 0 and without steps of a set-point, but a "
                    f"PositionServo has goal {part.goal:g} and step {part.step:g}: measure it in a "
                    "run"
                )
        for joint, low, high in plant.ranges:
            if not low <= 0.0 <= high:
                raise ScenarioError(
                    f"chattering is predicted about x = 0, which joint {joint!r} of {plant.name} "
                    "does not reach: measure it in a run"
                )
        # the joint without an actuator that the channel moves, if there is one
        free = channel + plant.driven
        if free < plant.n:
            self.joints = [channel, free]
        else:
            self.joints = [channel]
        law = s.law.of_channel(channel)
        self.controller = CompiledController(s.velocity, s.surface, law)
        self._linearise_mechanism()
        self.nominal_models = list(map(self._nominal_model, self.joints))
        # all amplitudes of a frequency share an answer and a clock, and the loops of `later` share
        # them and the gains
        self._answer = functools.lru_cache(maxsize=1024)(self._solve)
        self.gain = functools.lru_cache(maxsize=10_000)(self._gain)
        self._clock = functools.lru_cache(maxsize=4)(self._clock_of)

    def later(self, delay: float) -> "Loop":
        """Return the loop with an additional delay, s."""
        delayed = copy.copy(self)
        delayed.delay = self.delay + delay
        return delayed

    def _linearise_mechanism(self) -> None:
        """Linearise MuJoCo's model about rest at x = 0, without contacts, limits, dry friction and
        gaps.
        """
        s = self.scenario.resolved
        motors: list[Actuator] = []
        for part in s.actuator:
            if isinstance(part, DCMotor):
                motors.append(dataclasses.replace(part, inductance=0.0))
            if isinstance(part, CommandFilter):
                motors.append(part)
            if isinstance(part, PositionServo):  # `transition` puts its filter before it
                motors.append(dataclasses.replace(part, timeconst=0.0))
        for part in s.actuator:
            if isinstance(part, ElasticJoint):
                motors.append(part)
        gears = [part for part in s.actuator if isinstance(part, Backlash)]
        friction = s.friction
        if gears:  # the rotor is rigid on the joint here
            friction = [dataclasses.replace(part, side="link") for part in friction]
        chain = s.drive_train.chains[self.channel]
        ideal = dataclasses.replace(
            self.scenario,
            actuator=motors,
            friction=friction,
            contact="none",
            x0=None,
            v0=None,
            jump=None,
            integrator=s.integrator,
            physics_step=s.physics_step,
        )
        with installed(None):
            model = models.with_values(models.compile_model(ideal), ideal)
            model.opt.disableflags |= NONLINEAR_FLAGS
            model.actuator_delay[:] = 0.0  # `_solve` has it
            for gear in gears:
                driven = dof_ids(model)[gear.channels(s.plant)]
                model.dof_armature[driven] += gear.rotor_inertia
                model.dof_damping[driven] += gear.rotor_damping
                mujoco.mj_setConst(model, mujoco.MjData(model))
            gear = next((part for part in gears if part in chain), None)
            self.step = float(model.opt.timestep)
            data = mujoco.MjData(model)
            data.qpos[:], data.qvel[:] = models.initial_state(
                model, dataclasses.replace(ideal, x0=0.0, v0=0.0)
            )
            self.a, b = transition(model, data, chain)
            of_channel = b[:, model.actuator_ctrladr[drive_ids(model)[self.channel]]]
            self.b = of_channel * s.drive_train.scales[self.channel]
            self.rows = dof_ids(model)
            shafts = model.jnt_dofadr[moving_joints(model)[1]]
            for sensor in s.sensors:
                if sensor.side == "motor":
                    read = [*sensor.channels(s.plant)]
                    self.rows[read] = shafts[read]
            self.nv = model.nv
            self.gap = self._joint_gap(gear, model, data) if gear else 0.0

    def _nominal_model(self, joint: int) -> Floats:
        """Return nominal f and g of a joint at rest, and the derivatives of f with its x and v."""
        plant = self.scenario.resolved.plant
        zeros = np.zeros(plant.n)
        step = np.eye(plant.n)[joint] * DIFFERENCE_STEP
        p = copy.copy(plant.values({}))
        f, g = plant.nominal(zeros, zeros, joint, p)
        fx = plant.nominal(step, zeros, joint, p)[0]
        fv = plant.nominal(zeros, step, joint, p)[0]
        return f, g, (fx - f) / DIFFERENCE_STEP, (fv - f) / DIFFERENCE_STEP

    def response(self, omega: complex) -> complex:
        """Return the amplitude of x at control samples per unit of sampled and held u, rad or m."""
        late = np.exp(-1j * omega * self.delay)
        of_channel = self._answer(omega)[self.rows[self.channel]]
        return complex(of_channel * late)

    def coupling(self, omega: float) -> float:
        """Return the largest amplitude of another driven channel under this one's u, over that of
        its own x.
        """
        driven = self.rows[: self.scenario.plant.driven]
        answer = np.abs(self._answer(omega)[driven])
        of_others = np.delete(answer, self.channel)
        return float(of_others.max(initial=0.0) / answer[self.channel])

    def _solve(self, omega: complex) -> Array:
        """Return the state at samples per unit of held u, with u's images at omega + 2 pi m /
        control_period.
        """
        s = self.scenario.resolved
        count = round(s.control_period / self.step)
        turns = math.tau * np.arange(count) / count
        z = np.exp(1j * (omega * self.step + turns))
        passed = sum(z**-i for i in range(count)) / count  # by the hold
        late = s.input_delay
        for part in s.drive_train.chains[self.channel]:
            late += part.lateness
        passed = passed * z ** -round(late / self.step)

        resolvent = z[:, None, None] * np.eye(len(self.a)) - self.a
        column = self.b[:, None]
        answers = np.linalg.solve(resolvent, column)[:, :, 0]
        if (sensor := s.encoder(self.channel)) is not None:
            answers = answers * np.exp(-1j * omega * sensor.delay)
        return passed @ answers

    @cached_property
    def s_of_one_count(self) -> float:
        """The largest |s| after the reading of x has moved by one count of the encoder at rest; 0
        without one.
        """
        s = self.scenario.resolved
        count = 0.0
        if (sensor := s.encoder(self.channel)) is not None:
            count = sensor.quantum(s.plant.units[self.channel] == "rad")
        if not count:
            return 0.0
        first_half = np.arange(2 * REST_SAMPLES) < REST_SAMPLES
        x = np.where(first_half, 0.0, count)
        zeros = np.zeros(len(x))
        _, sliding = self._controlled(s.control_period, [x, zeros])
        return float(np.abs(sliding).max())

    def _controlled(self, h: float, motion: list[Array]) -> ArrayPair:
        """Return u and s for x and v of the channel, and of the joint that it moves, every h
        seconds.
        """
        s = self.scenario.resolved
        limit = self.scenario.limits[self.channel]
        fixed = {DT: h, LIMIT: limit, MODEL: s.model != "none"}
        return self.controller(fixed, motion, self.nominal_models)

    def _gain(
        self, amplitude: float, omega: float, max_samples: float = MAX_SAMPLES_PER_PERIOD
    ) -> complex:
        """Return the first harmonic of u over that of e = amplitude sin(omega t), times that of
        play, see `Wave`.
        """
        _, u, _ = self._excited([amplitude], omega, max_samples)
        first_harmonic = _first(u, self._clock(omega, max_samples, 0.0).against)
        return self._gain_of(first_harmonic, amplitude, omega)

    def phases(self, amplitude: float, omega: float) -> Pair:
        """Return the lowest and highest phase of a locked cycle's gain relative to `gain`, rad: one
        <= 0, one >= 0.

        `gain` is a mean over all positions of the samples in the period, but a cycle of a whole
        number of samples is locked to one. A relay then switches up to half a control period
        earlier or later than in the mean.
        """
        h = max(self.scenario.control_period, math.tau / omega / MAX_SAMPLES_PER_PERIOD)
        # of an even number of samples, four or more
        half_samples = round(math.pi / omega / h)
        locked = math.tau / h / (2 * max(half_samples, 2))
        mean = self.gain(amplitude, 1.001 * locked)
        shifts = []
        for position in (np.arange(SAMPLE_POSITIONS) + 0.5) / SAMPLE_POSITIONS:
            angles, u, _ = self._excited([amplitude], locked, MAX_SAMPLES_PER_PERIOD, position)
            at_locked = self._gain_of(_harmonic(u, angles), amplitude, locked)
            shifts.append(float(np.angle(at_locked / mean)))
        scale = omega / locked
        earliest = scale * min(*shifts, 0.0)
        latest = scale * max(*shifts, 0.0)
        return earliest, latest

    def _gain_of(self, first: complex, amplitude: float, omega: float) -> complex:
        half_turn = self.scenario.control_period * omega
        two_samples = math.isclose(half_turn, math.pi, rel_tol=1e-9)
        # with two samples a period a wave and its image are the same
        images = 2.0 if two_samples else 1.0
        return first / (1j * amplitude * images) * play(amplitude, self.gap)

    def _joint_gap(self, gear: Backlash, model: mujoco.MjModel, data: mujoco.MjData) -> float:
        """Return how far the joint moves while the rotor crosses its play, rad or m: see `play`."""
        dof = self.rows[self.channel]
        mobility = np.zeros(model.nv)
        force = np.eye(model.nv)[dof]
        mujoco.mj_forward(model, data)
        mujoco.mj_solveM(model, data, mobility[None], force[None])
        rotor = gear.rotor_inertia
        for part in self.scenario.drive_train.chains[self.channel]:
            if isinstance(part, DCMotor):
                rotor += part.gear**2 * part.rotor_inertia
        return gear.gap * rotor * float(mobility[dof])

    def wave(self, amplitude: float, omega: float) -> Wave:
        """Return what the law returns for e with this first harmonic, and the others that follow
        from u.
        """
        angles, u, s = self._excited([amplitude], omega, MAX_SAMPLES_PER_PERIOD)
        harmonics: list[complex] = [amplitude]
        for _ in range(HARMONIC_PASSES):
            harmonics = self._harmonics_of_e(amplitude, omega, u, angles)
            angles, u, s = self._excited(harmonics, omega, MAX_SAMPLES_PER_PERIOD)
        first = _harmonic(u, angles)
        of_s = _harmonic(s, angles)
        half = len(u) // 2
        early = _harmonic(u[:half], angles[:half])
        late = _harmonic(u[half:], angles[half:])
        return Wave(
            amplitude=amplitude,
            omega=omega,
            gain=self._gain_of(first, amplitude, omega),
            third=abs(_harmonic(s, 3.0 * angles) / of_s)
            if of_s and len(harmonics) > 1
            else math.nan,
            s=float(np.ptp(s)) / 2.0,
            u=float(np.ptp(u)) / 2.0,
            rate=omega * abs(of_s),
            drift=abs(late - early) / (abs(first) or 1.0),
        )

    def _harmonics_of_e(
        self, amplitude: float, omega: float, u: Array, angles: Array
    ) -> list[complex]:
        """Return the harmonics of e: the given amplitude, then the mechanism's answer to the other
        harmonics of u.
        """
        half = math.pi / self.scenario.control_period
        below_nyquist = math.ceil(half / omega) - 1
        highest = min(MAX_HARMONICS, below_nyquist)
        one_back = np.exp(-1j * angles)
        repeated = itertools.repeat(one_back, max(highest, 1))
        powers = itertools.accumulate(repeated, np.multiply)
        first = _first(u, next(powers))
        rest = []
        for n, power in enumerate(powers, 2):
            harmonic = self.response(n * omega) * _first(u, power)
            rest.append(harmonic / 1j)
        # u is shifted in time until the answer to its first harmonic has the phase of e
        shift = 0j
        if first:
            shift = 1j * amplitude / (first * self.response(omega))
        turn = shift / abs(shift) if shift else 0j
        harmonics: list[complex] = [amplitude]
        for n, answer in enumerate(rest, 2):
            harmonics.append(answer * turn**n)
        return harmonics

    def _excited(
        self, amplitudes: Sequence[complex], omega: float, max_samples: float, position: float = 0.0
    ) -> tuple[Array, Array, Array]:
        """Return omega t, u and s of the samples after memories have settled, for an error of these
        harmonics.

        The error is the sum of Re(amplitude_n exp(j n omega t)). It starts at its largest value, so
        that integrals of odd functions of it have no mean. The first sample is at `position`, in
        control periods.
        """
        clock = self._clock(omega, max_samples, position)
        motion = []
        for joint in self.joints:
            x, v = np.zeros((2, len(clock.turns)))
            turns = np.ones_like(clock.turns)
            for n, amplitude in enumerate(amplitudes, 1):
                turns *= clock.turns
                if abs(amplitude) < NEGLIGIBLE_SHARE * abs(amplitudes[0]):
                    continue
                answer = self._answer(n * omega)
                e = amplitude * turns
                own_answer = answer[self.rows[self.channel]]
                x += (answer[self.rows[joint]] / own_answer * e).real
                answered = answer[self.nv + self.rows[joint]] / own_answer
                v += (answered * e).real
            motion += [x, v]
        u, s = self._controlled(clock.h, motion)
        limit = self.scenario.limits[self.channel]
        clipped = np.clip(u[clock.first :], -limit, limit)
        return clock.angles, clipped, s[clock.first :]

    def _clock_of(self, omega: float, max_samples: float, position: float) -> "SampleTimes":
        period = math.tau / omega
        h = max(self.scenario.resolved.control_period, period / max_samples)
        periods = min(
            max(math.ceil(EXCITATION_SAMPLES * max_samples * h / period), MIN_PERIODS), MAX_PERIODS
        )
        count = math.ceil(periods * period / h)
        first = int(SETTLING_SHARE * count)
        times = h * np.arange(first, count)
        angles = omega * (times + h * position)
        samples = np.arange(count) + position
        turns = np.exp(1j * omega * h * samples)
        against = np.exp(-1j * angles)
        return SampleTimes(h, turns, first, angles, against)


class SampleTimes(NamedTuple):
    """The times of an excitation's samples."""

    h: float  # from one sample to the next, s
    turns: Array  # exp(j omega t) of all samples, complex, (K,)
    first: int  # number of samples in which memories settle
    angles: Array  # omega t of the others, rad
    against: Array  # exp(-j omega t) of the others, complex


class CompiledController:
    """Estimator, surface and law in compiled code, called without a simulation."""

    def __init__(self, *parts: Component | None):
        try:
            functions = []
            for part in parts:
                functions.append(None if part is None else cfunctions.compile_component(part))
        except NotCompilable as error:
            raise ScenarioError(
                f"chattering is not predicted for a law that does not compile: {error}"
            ) from None
        self.functions, self.parts = functions, parts  # the functions keep their addresses alive
        addresses = []
        self.gains = []
        for part, function in zip(parts, functions, strict=True):
            addresses.append(0 if function is None else function.address)
            gains = () if part is None else part.gains.values()
            self.gains.append(np.array([*gains, 0.0]))
        self.addresses = np.array(addresses)

    def __call__(
        self,
        fixed: Mapping[int, float],
        motion: Sequence[Array],
        models: Sequence[Floats],
    ) -> ArrayPair:
        """Return u and s, each (K,), for the samples of a motion, with memories as at the start of
        a run.

        `fixed` has fields of a measurement with their values in all samples; `motion` has x and v
        of the channel, then those of the joint that it moves, if any; `models` is as
        `Loop._nominal_model` returns it for these.
        """
        x, v, *of_joint = motion
        q = dq = np.empty(0)
        joint_model = (0.0,) * 4
        if of_joint:
            q, dq = of_joint
            joint_model = models[1]
        start = np.zeros(len(FIELDS))
        for field, value in fixed.items():
            start[field] = value
        out = np.empty((len(x), 2))
        y = np.empty(len(FIELDS))
        g0, g1, g2 = self.gains
        m0, m1, m2 = (np.zeros(part.memory if part else 1) for part in self.parts)
        model = np.array([models[0], joint_model])
        done = _run(self.addresses, g0, g1, g2, m0, m1, m2, start, x, v, q, dq, model, y, out)
        if done < 0:
            raise ScenarioError(
                "the law raised an exception in the harmonic balance: correct the law"
            )
        if done < len(x):
            raise ScenarioError(
                f"the law returned {out[done, 0]:g} at x = {y[X]:g}, v = {y[V]:g}: correct the law"
            )
        return out[:, 0], out[:, 1]


def transition(
    model: mujoco.MjModel, data: mujoco.MjData, actuator: Sequence[Actuator]
) -> ArrayPair:
    """Return A (n, n) and B (n, nu) of a physics step at `data`, without any integrator's error."""
    from scipy.linalg import expm

    block = rates(model, data)
    for drive in reversed(actuator):
        if drive.delay and not isinstance(drive, CommandFilter):  # which is in the model
            block = _behind(drive, block, model)
    n = len(block) - model.nu
    stepped = expm(block * float(model.opt.timestep))
    return stepped[:n, :n], stepped[:n, n:]


def _behind(drive: Actuator, block: Array, model: mujoco.MjModel) -> Array:
    """Return the `rates` of a model behind a drive: the drive's outputs become states, and its
    inputs the commands.

    A motor's model has no inductance: the voltage V - gear k v becomes the state R i.
    """
    ids = drive_ids(model)
    commands = model.actuator_ctrladr[ids]
    outputs = len(block) - model.nu + commands
    speeds = model.nv + model.jnt_dofadr[model.actuator_trnid[ids, 0]]
    behind = np.pad(block, (0, model.nu))
    if isinstance(drive, DCMotor):
        behind[:, speeds] += drive.constant * behind[:, outputs]
        behind[outputs, speeds] = -drive.constant / drive.delay
    behind[outputs, outputs] = -1.0 / drive.delay
    behind[outputs, len(block) + commands] = 1.0 / drive.delay
    return behind


def play(amplitude: float, gap: float) -> complex:
    """Return the describing function of play: the force on the joint over that on a rotor without
    play, complex.

    Rotor m1 and joint m2 are free masses, with plastic impacts, under u = sin(omega t). The rotor
    leaves its flank when u changes its sign. It moves alone until the angle c with c - sin c = play
    m1 omega^2 / |u|. There it hits the other flank and passes on to the joint the impulse 1 - cos c
    that it has from u. The amplitude of x is |play(...) u| / ((m1 + m2) omega^2), so c depends on
    amplitude over gap alone. `gap` is that of the play, times m1 / (m1 + m2): how far the joint
    moves while the rotor crosses, rad or m.
    """
    if gap == 0.0:
        return 1.0 + 0.0j
    from scipy.optimize import brentq

    def excess(c: float) -> float:
        return (c - math.sin(c)) * amplitude - gap * abs(_play_at(c))

    if excess(math.pi) < 0.0:
        return _play_at(math.pi)
    return _play_at(float(brentq(excess, 0.0, math.pi)))  # type: ignore[arg-type]


def _play_at(c: float) -> complex:
    impulse = 1.0 - math.cos(c)
    sine = 0.5 * (math.pi - c) + 0.25 * math.sin(2.0 * c) + impulse * math.sin(c)
    cosine = -0.5 * math.sin(c) ** 2 + impulse * math.cos(c)
    return complex(sine, cosine) * 2.0 / math.pi


def _harmonic(values: Array, angles: Array) -> complex:
    return _first(values, np.exp(-1j * angles))


def _first(values: Array, against: Array) -> complex:
    """Return the complex amplitude of sin(angle), given exp(-j angle): a Hann window of sum 1
    rejects other waves.
    """
    return complex(2j * ((_window(len(values)) * values) @ against))


@functools.lru_cache(maxsize=64)
def _window(count: int) -> Array:
    return np.hanning(count) / np.hanning(count).sum()


@cfunctions.cached
def _run(addresses, g0, g1, g2, m0, m1, m2, start, x, v, q, dq, model, y, out):
    """Call estimator, surface and law for each sample.

    Stop where u is not finite; y is then the measurement there.

    Return the number of samples before that, or -1 if one of the three raised.
    """
    estimate = np.empty(2)
    sliding = np.empty(2)
    reading = np.empty(3)
    at_reading = reading.ctypes.data
    at_y = y.ctypes.data
    at_out = out.ctypes.data
    at_estimate = estimate.ctypes.data
    at_sliding = sliding.ctypes.data
    gains = g0.ctypes.data, g1.ctypes.data, g2.ctypes.data
    memories = m0.ctypes.data, m1.ctypes.data, m2.ctypes.data
    for k in range(len(x)):
        for i in range(len(start)):
            y[i] = start[i]
        y[T] = start[DT] * k
        y[X] = x[k]
        y[E] = x[k]
        y[F] = model[0, 0] + model[0, 2] * x[k] + model[0, 3] * v[k]
        y[G] = model[0, 1]
        if len(q):
            y[Q], y[DQ] = q[k], dq[k]
            y[FQ] = model[1, 0] + model[1, 2] * q[k] + model[1, 3] * dq[k]
            y[GQ] = model[1, 1]
        reading[0] = start[DT]
        reading[1] = x[k]
        reading[2] = v[k]
        if call(addresses[0], at_reading, gains[0], memories[0], at_estimate) != 0:
            return -1
        y[V], y[DE] = estimate[0], v[k] + (estimate[0] - v[k])
        y[A] = 0.0 if math.isnan(estimate[1]) else estimate[1]
        if addresses[1] != 0:
            if call(addresses[1], at_y, gains[1], memories[1], at_sliding) != 0:
                return -1
            y[HAS_SURFACE] = 1.0
            y[S] = sliding[0]
            y[V_EQ] = sliding[1]
        if call(addresses[2], at_y, gains[2], memories[2], at_out + 16 * k) != 0:
            return -1
        if not math.isfinite(out[k, 0]):
            return k
    return len(x)
