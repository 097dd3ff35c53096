"""RealAIGym's robustness test: six ways in which the machine differs from the model, at many
levels.

    model            one parameter at 21 values: Ir 0 to 1e-4 kg m^2; m1 r1, I1, m2 r2, m2, I2 at
                     75 to 125 %; b of each joint -0.1 to 0.1 N m s/rad; cf -0.2 to 0.2 N m
    velocity noise   standard deviation 0 to 0.5 rad/s of both velocities, 10 runs a level
    torque noise     standard deviation 0 to 1.1 N m, 10 runs a level
    torque response  tau_k = tau_(k-1) + r (u_k - tau_(k-1)), r = 0.1 to 2
    delay            positions and velocities 0 to 40 ms late
    perturbations    50 profiles of 3 pulses, standard width 0.05 to 0.1 s, 0.5 to 5 N m

A case is survived if after 10 s the state is within (0.35, 0.35, 1, 1) of upright and at rest; a
level with several runs if more than half of these do. Each test's percentage has the same weight.

The published simulator is repeated here, because some of these machines cannot be built: friction
that pushes, a response beyond 1. It is RK4 at 2 ms of the double pendulum's equation, with the dry
friction cf arctan(100 q'). The law and its estimator run as in every scenario, compiled, by their
addresses. In the published simulator a pulse on the joint without a motor has no effect (its input
matrix is 0 there), so only the driven joint's are drawn. The published test has other random
numbers at every run; here they depend only on `SEED`. Source:
leaderboard/*/robustness_v2 and src/python/double_pendulum of
github.com/dfki-ric-underactuated-lab/double_pendulum (BSD-3-Clause), rewritten here.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numba import njit

from realaigym.scoring import shoulder_first
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.interrupts import delay_signals
from smc_mujoco.common.jit import NotCompilable, call
from smc_mujoco.control.law import Measurement
from smc_mujoco.mechanisms.plants.double_pendulum import MODEL_1_1, accelerations
from smc_mujoco.simulation import cfunctions
from smc_mujoco.simulation.coerce import REST
from smc_mujoco.simulation.scenario import Scenario

SEED = 20240  # of all random numbers; chosen before any run
STEP, STEPS = 2e-3, 5000  # s; number of steps
UPRIGHT_TOLERANCES = (0.35, 0.35, 1.0, 1.0)  # rad, rad, rad/s, rad/s, of upright and at rest
LEVELS = 21
REPEATS = 10
PROFILES = 50
PULSES = 3
MIN_PULSE_GAP, PULSE_WIDTH, PULSE_AMPLITUDE = 1.0, (0.05, 0.1), (0.5, 5.0)  # s; s; N m
# what is scaled -> the parameter
SCALED_PARAMETERS = {"m1r1": "r1", "I1": "I1", "m2r2": "r2", "m2": "m2", "I2": "I2"}
# parameter -> ends of its values
MODEL_LEVELS = {"Ir": (0.0, 1e-4)} | dict.fromkeys(SCALED_PARAMETERS, (0.75, 1.25))
MODEL_LEVELS |= {"b1": (-0.1, 0.1), "b2": (-0.1, 0.1), "cf1": (-0.2, 0.2), "cf2": (-0.2, 0.2)}
MEASUREMENT_SIZE = len(Measurement._fields)
ROOM = 11
T, DT, LIMIT, USES_MODEL, X, V, E, DE, Q, DQ, F, G, FQ, GQ = (  # places in a measurement
    Measurement._fields.index(name)
    for name in ("t", "dt", "limit", "model", "x", "v", "e", "de", "q", "dq", "f", "g", "fq", "gq")
)
TESTS = ("model", "velocity_noise", "torque_noise", "torque_response", "delay", "perturbations")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Case:
    """A machine that differs from the model."""

    test: str = ""  # one of TESTS
    name: str = ""  # the parameter that differs in the test "model", else the test
    value: float = 0.0  # its level
    # true values, where they differ
    parameters: Mapping[str, float] = dataclasses.field(default_factory=dict)
    velocity_noise: float = 0.0  # standard deviation, rad/s
    torque_noise: float = 0.0  # standard deviation, N m
    response: float = 1.0  # r of the motor
    delay: int = 0  # of the measurement, in control periods
    pulses: tuple[
        tuple[float, float, float], ...
    ] = ()  # centre (s), standard width (s) and amplitude (N m) of each
    seed: int = 0  # of the noise


@dataclasses.dataclass(frozen=True, repr=False)
class Robustness:
    """The result of the test: percent of survived levels of each test, and the score, their mean in
    0 .. 1.
    """

    # test -> (name, level, whether the law survived it)
    survived: Mapping[str, tuple[tuple[str, float, bool], ...]]

    def __repr__(self) -> str:
        tests = ", ".join(f"{test} {percent:.1f} %" for test, percent in self.percent.items())
        return f"Robustness(score {self.score:.3f}, survived: {tests})"

    @property
    def percent(self) -> dict[str, float]:
        """Percent of the levels of each test that the law survived."""
        return {
            test: 100.0 * float(np.mean([ok for *_, ok in levels]))
            for test, levels in self.survived.items()
        }

    @property
    def score(self) -> float:
        """The overall robustness score, in 0 .. 1: the mean over the tests."""
        return sum(self.percent.values()) / (100.0 * len(self.survived))


def cases() -> list[Case]:
    """Return every run of the test, in order: runs of one level stand together."""
    listed = list[Case]()

    def levels(low: float, high: float) -> list[float]:
        return np.linspace(low, high, LEVELS).tolist()

    for name, ends in MODEL_LEVELS.items():
        parameter = SCALED_PARAMETERS.get(name, name)
        if name in SCALED_PARAMETERS:
            unit = MODEL_1_1[parameter]
        else:
            unit = 1.0
        cases_of = [(value, {parameter: unit * value}) for value in levels(*ends)]
        listed += [
            Case(test="model", name=name, value=value, parameters=changed)
            for value, changed in cases_of
        ]

    def case(test: str, value: float, **fields: Any) -> Case:
        return Case(test=test, name=test, value=value, **fields)

    for test, most in (("velocity_noise", 0.5), ("torque_noise", 1.1)):
        for seed, value in enumerate(np.repeat(levels(0.0, most), REPEATS).tolist()):
            listed.append(case(test, value, seed=seed, **{test: value}))
    listed += [case("torque_response", value, response=value) for value in levels(0.1, 2.0)]
    listed += [case("delay", count * STEP, delay=count) for count in range(LEVELS)]
    rng = np.random.default_rng([SEED, 0])
    return listed + [case("perturbations", float(k), pulses=_pulses(rng)) for k in range(PROFILES)]


def _pulses(rng: np.random.Generator) -> tuple[tuple[float, float, float], ...]:
    """Return the pulses of the driven joint: half of those of a profile, which lie at least
    MIN_PULSE_GAP apart.
    """
    count = 2 * PULSES
    centres = np.cumsum(
        MIN_PULSE_GAP
        + rng.uniform(0.0, (STEP * STEPS - (count + 1) * MIN_PULSE_GAP) / count, count)
    )
    widths = rng.uniform(*PULSE_WIDTH, PULSES)
    reach = PULSE_AMPLITUDE[1] - PULSE_AMPLITUDE[0]
    amplitudes = rng.uniform(-reach, reach, PULSES)
    amplitudes += np.copysign(PULSE_AMPLITUDE[0], amplitudes)
    rows = zip(rng.permutation(centres)[:PULSES], widths, amplitudes, strict=True)
    return tuple(
        (float(centre), float(width), float(amplitude)) for centre, width, amplitude in rows
    )


def robustness(
    scenario: Scenario, report: Callable[[float, float], None] | None = None
) -> Robustness:
    """Return what a law survives of the robustness test.

    Args:
      scenario: plant pendubot or acrobot; its law and velocity estimator are tested. The law may
        know the plant's nominal parameters if the scenario says so.
      report: called with the number of runs done and the number of all.

    Raises:
      ScenarioError: another plant, a surface, a reference that moves, or a law that does not
        compile.
    """
    machine = Machine(scenario)
    todo = cases()
    levels: dict[tuple[str, str, float], list[bool]] = {}
    for done, case in enumerate(todo, 1):
        ended = upright(machine.simulate(case)[0][-1])
        levels.setdefault((case.test, case.name, case.value), []).append(ended)
        if report is not None:
            report(done, len(todo))
    survived = {test: list[tuple[str, float, bool]]() for test in TESTS}
    for (test, name, value), results in levels.items():
        survived[test].append((name, value, sum(results) > len(results) / 2))
    return Robustness({test: tuple(rows) for test, rows in survived.items()})


def upright(state: np.ndarray) -> bool:
    """Return whether a state (q1, q2, q1', q2') is within UPRIGHT_TOLERANCES of rest upright; inf
    is not.
    """
    if not np.isfinite(state).all():
        return False
    angles = [
        math.remainder(state[0] - math.pi, 2.0 * math.pi),
        math.remainder(state[1], 2.0 * math.pi),
    ]
    return all(
        abs(value) < limit
        for value, limit in zip((*angles, *state[2:]), UPRIGHT_TOLERANCES, strict=True)
    )


class Machine:
    """The published simulator with a law, its estimator and what it knows of the plant."""

    def __init__(self, scenario: Scenario):
        resolved = scenario.resolved
        self.driven = shoulder_first(scenario.plant.name).index(0)
        if (
            scenario.surface is not None
            or resolved.reference != REST
            or scenario.feedforward is not None
        ):
            raise ScenarioError(
                f"the robustness test of {scenario.plant.name} is only of the law and its "
                "estimator: leave out "
                "surface, reference and feedforward"
            )
        law = scenario.law.of_channel(0)
        velocity = resolved.velocity
        try:
            self.law = cfunctions.compile_component(law)
            self.estimator = cfunctions.compile_component(velocity)
        except NotCompilable as error:
            raise ScenarioError(
                f"the robustness test runs compiled laws only, and {error}"
            ) from None
        self.gains = np.array([*law.gains.values(), 0.0])
        self.filter = np.array([*velocity.gains.values(), 0.0])
        self.sizes = law.memory, velocity.memory
        self.known = tuple(scenario.plant.parameters[name] for name in MODEL_1_1)
        self.limit = scenario.limits[0]
        self.uses_model = float(resolved.model == "nominal")

    def start(self) -> tuple[Any, Any, Any, Any, Any, Any]:
        """Return addresses, gains, empty memories, and what the law knows, for a compiled loop."""
        functions = np.array([self.law.address, self.estimator.address])
        memory = np.zeros(self.sizes[0])
        past = np.zeros((2, self.sizes[1]))
        return functions, self.gains, self.filter, memory, past, self.known

    def simulate(self, case: Case) -> tuple[np.ndarray, np.ndarray]:
        """Return the states (q1, q2, q1', q2'), (5001, 4), and the motor's torque, N m, (5000,), of
        a case.
        """
        true = dict(zip(MODEL_1_1, self.known, strict=True)) | dict(case.parameters)
        t = STEP * np.arange(STEPS)
        rng = np.random.default_rng([SEED, case.seed, 0])
        noise = rng.normal(size=(STEPS, 3)) * [
            case.velocity_noise,
            case.velocity_noise,
            case.torque_noise,
        ]
        pulse = np.zeros(STEPS)
        for centre, width, amplitude in case.pulses:
            pulse += amplitude * np.exp(-0.5 * ((t - centre) / width) ** 2)
        states = np.zeros((STEPS + 1, 4))
        torque = np.zeros(STEPS)
        with delay_signals():  # numba may compile it now
            raised = _simulate(
                *self.start(),
                tuple(true.values()),
                self.driven,
                self.limit,
                self.uses_model,
                noise,
                pulse,
                case.response,
                case.delay,
                states,
                torque,
            )
        if raised:
            raise ScenarioError(
                "the law raised an exception in the robustness test: run it in a scenario"
            )
        return states, torque


@njit(error_model="numpy")
def _slope(x, u1, u2, p):
    """Return the derivative of the state (4 numbers) under torques on both joints."""
    m1, m2, l1, r1, r2, I1, I2, Ir, gear, b1, b2, cf1, cf2, grav = p
    a1, a2, W11, W12, W22 = accelerations(
        x[0], x[1], x[2], x[3], m1, m2, l1, r1, r2, I1, I2, Ir, gear, b1, b2, grav
    )
    u1 -= cf1 * math.atan(100.0 * x[2])
    u2 -= cf2 * math.atan(100.0 * x[3])
    return x[2], x[3], a1 + W11 * u1 + W12 * u2, a2 + W12 * u1 + W22 * u2


@njit(error_model="numpy")
def _moved(x, k, h):
    """Return the state after a time h at the slope k."""
    return x[0] + h * k[0], x[1] + h * k[1], x[2] + h * k[2], x[3] + h * k[3]


@njit(error_model="numpy")
def stepped(x, u1, u2, p):
    """Return the state after a step of RK4 under constant torques."""
    k1 = _slope(x, u1, u2, p)
    k2 = _slope(_moved(x, k1, STEP / 2), u1, u2, p)
    k3 = _slope(_moved(x, k2, STEP / 2), u1, u2, p)
    k4 = _slope(_moved(x, k3, STEP), u1, u2, p)
    return _moved(_moved(_moved(_moved(x, k1, STEP / 6), k2, STEP / 3), k3, STEP / 3), k4, STEP / 6)


@njit(error_model="numpy")
def answered(functions, gains, tuning, memory, memories, known, driven, seen, y, room):
    """Return a law's answer to a measured state, (4,), and whether it or its estimator raised an
    exception.

    `y` has t, dt, limit and model, and gets the rest of the measurement; `room` is ROOM numbers to
    work in.
    """
    control = room[:2]
    reading = room[2:5]
    estimate = room[5:7]
    position = room[7:9]
    velocity = room[9:]
    for joint in range(2):
        reading[0], reading[1], reading[2] = STEP, seen[joint], seen[2 + joint]
        if (
            call(
                functions[1],
                reading.ctypes.data,
                tuning.ctypes.data,
                memories[joint].ctypes.data,
                estimate.ctypes.data,
            )
            != 0
        ):
            return 0.0, True
        position[joint], velocity[joint] = seen[joint], estimate[0]
    f1, f2, W11, W12, W22 = accelerations(
        position[0],
        position[1],
        velocity[0],
        velocity[1],
        *known[:11],
        known[13],  # pyright: ignore[reportCallIssue] after eleven
    )
    if driven == 0:
        f = f1
        fq = f2
        g = W11
        free = 1
    else:
        f = f2
        fq = f1
        g = W22
        free = 0
    y[X], y[V], y[E], y[DE] = position[driven], velocity[driven], position[driven], velocity[driven]
    y[Q], y[DQ], y[F], y[G], y[FQ], y[GQ] = position[free], velocity[free], f, g, fq, W12
    raised = (
        call(
            functions[0], y.ctypes.data, gains.ctypes.data, memory.ctypes.data, control.ctypes.data
        )
        != 0
    )
    return control[0], raised


@njit(error_model="numpy")
def _simulate(
    functions,
    gains,
    tuning,
    memory,
    memories,
    known,
    true,
    driven,
    limit,
    uses_model,
    noise,
    pulse,
    response,
    delay,
    states,
    torque,
):
    """Run a case; states and torque are written.

    Return whether the law or its estimator raised an exception.
    """
    x = (0.0, 0.0, 0.0, 0.0)
    motor = 0.0
    seen = np.zeros(4)
    y = np.zeros(MEASUREMENT_SIZE)
    room = np.zeros(ROOM)
    y[DT], y[LIMIT], y[USES_MODEL] = STEP, limit, uses_model
    for k in range(len(torque)):
        seen[:] = states[max(0, k - delay)]
        seen[2] += noise[k, 0]
        seen[3] += noise[k, 1]
        y[T] = k * STEP
        target_torque, raised = answered(
            functions, gains, tuning, memory, memories, known, driven, seen, y, room
        )
        if raised:
            return True
        motor += response * (min(max(target_torque, -limit), limit) - motor)
        motor = min(max(motor + noise[k, 2], -limit), limit)
        u = motor + pulse[k]
        u1, u2 = (u, 0.0) if driven == 0 else (0.0, u)
        x = stepped(x, u1, u2, true)
        torque[k] = motor
        states[k + 1, 0], states[k + 1, 1], states[k + 1, 2], states[k + 1, 3] = x
        if not abs(x[2]) + abs(x[3]) < 1e6:
            states[k + 1 :] = math.inf
            return False
    return False
