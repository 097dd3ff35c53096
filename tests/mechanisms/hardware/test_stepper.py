"""A stepper motor's steps, field and torque are those of an event integration, written here from
its docstring.
"""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from helpers import reference

import smc_mujoco as smc
from smc_mujoco.hardware import Stepper
from smc_mujoco.simulation import model
from smc_mujoco.simulation.callback import installed

PERIOD = 5e-3  # s, of the control
MOTOR = Stepper(
    steps=1600,
    torque=0.3,
    damping=4e-3,
    speed=60.0,
    ramp=80.0,
    stop_band=0.2,
)
# accelerations that turn, and stop; rates below and above sqrt(2 ramp)
SLOW = smc.Sine(6.0, 17.0, phase=math.pi / 2)
FAST = smc.Sine(40.0, 25.0, phase=math.pi / 2)
KINDS = {
    "slow": (MOTOR, SLOW),
    "fast": (MOTOR, FAST),
    "without queue": (dataclasses.replace(MOTOR, queue=0.0), SLOW),
    "each step when it is due": (dataclasses.replace(MOTOR, refill=0.0), FAST),
    "jumps": (
        dataclasses.replace(
            MOTOR,
            spread=0.0,
            stop_band=0.0,
        ),
        FAST,
    ),
    "half spread": (
        dataclasses.replace(
            MOTOR,
            spread=0.5,
            queue=0.05,
            longest_spread=0.004,
        ),
        SLOW,
    ),
    "slips": (dataclasses.replace(MOTOR, torque=0.02), FAST),
    "turns at once": (dataclasses.replace(MOTOR, stop_band=0.05), smc.Sine(60.0, 120.0, phase=1.5)),
    "geared": (dataclasses.replace(MOTOR, gear=3.0, torque=0.05), SLOW),
}


PLANT = smc.plant("inverted_pendulum", m=0.02, l=0.3)


def scenario(motor, push, plant=PLANT, **fields):
    fields = {
        "duration": 1.2,
        "seed": 5,
        "x0": 0.3,
        "control_period": PERIOD,
        "law": "none",
    } | fields
    return smc.Scenario(
        plant=plant,
        actuator=motor,
        feedforward=push,
        **fields,
    )


class Generator:
    """The pulse generator: the period of each step, for a wanted direction and rate."""

    def __init__(self, ramp):
        self.ramp = ramp
        self.wish = (0, 0)  # direction and rate
        self.way = 0
        self.n = 0
        self.period = math.inf

    def next_step(self):
        """Return the period of a step that is added, 0 for none."""
        speed, rate = self.wish
        if self.way and speed != self.way and self.n > 0:
            self.n -= 1
            return self.period
        if speed != self.way:
            self.way = speed
            self.n = 0
            self.period = math.inf
        if not self.way:
            return 0.0
        if 1.0 / rate < self.period:
            fastest = 1.0 / math.sqrt(2.0 * self.ramp * (self.n + 1))
            self.period = min(self.period, max(1.0 / rate, fastest))
            self.n += 1
        elif 1.0 / rate > self.period:
            slowest = self.period**-2 - 2.0 * self.ramp
            self.period = 1.0 / max(rate, math.sqrt(max(slowest, 0.0)))
            self.n -= 1
        self.n = max(self.n, 1)
        return self.period


def steps_by_events(motor, commands, phase, duration):
    """Times and directions of all steps, from events in the order of time.

    `commands`: (time, u) of the samples.
    """
    per = motor.steps * motor.gear / math.tau
    generator = Generator(motor.ramp * per)
    speed = 0.0
    last = 0.0
    events = [(t, 0, u) for t, u in commands]
    if motor.refill:
        looks = []
        for k in range(math.ceil(duration / motor.refill)):
            looks.append((k + phase) * motor.refill)
        events += [(t, 1, 0.0) for t in looks if t < duration]
    steps = []
    free = 0.0

    def add(now):
        nonlocal free
        time = max(now, free)
        before = generator.way
        if length := generator.next_step():
            steps.append((time, generator.way or before))
            free = time + length
        return length

    events.sort()
    for i, (t, is_look, u) in enumerate(events):
        if is_look:
            while (free <= t or free - t < motor.queue) and add(t):
                pass
            continue
        speed = max(-motor.speed * per, min(motor.speed * per, speed + u * per * (t - last)))
        last = t
        rate = math.floor(abs(speed) + 1e-9)
        sign = 1 if speed >= 0.0 else -1
        stops = abs(speed) < motor.stop_band * per or rate < 1 or generator.wish[0] == -sign
        generator.wish = (0, 0) if stops else (sign, rate)
        if i + 1 < len(events):
            until = events[i + 1][0]
        else:
            until = duration
        while not motor.refill and max(free, t) < until and add(t):
            pass
    return [(t, way) for t, way in steps if t < duration]


def field_of(motor, steps):
    """Knots (t, position of the field in rad of the joint) of a piecewise linear field; two at a
    jump.
    """
    knots = [(0.0, 0.0)]
    target = 0
    before = -math.inf

    def at(t):
        if len(knots) > 1:
            (t0, p0), (t1, p1) = knots[-2:]
        else:
            (t0, p0), (t1, p1) = (knots[0], knots[0])
        if t >= t1 or t1 == t0:
            return p1
        return p0 + (p1 - p0) * (t - t0) / (t1 - t0)

    for t, way in steps:
        now = at(t)
        while len(knots) > 1 and knots[-1][0] > t:  # not reached
            knots.pop()
        target = target + way
        interval = motor.spread * min(t - before, motor.longest_spread)
        knots += [(t, now), (t + interval, float(target))]
        before = t
    times, positions = map(np.array, zip(*knots, strict=True))
    return times, positions * math.tau / (motor.steps * motor.gear)


def moved(motor, steps, plant, x0, times, inertia, substep=2e-5):
    """x, v and the mean torque between `times` of the joint, by RK4 that stops at each knot of the
    field.
    """
    knots, positions = field_of(motor, steps)
    grid = np.unique(
        np.concatenate([np.arange(0.0, times[-1], substep), times, knots[knots <= times[-1]]])
    )
    x = x0
    v = 0.0
    impulse = 0.0
    values = plant.values({})
    rows = []

    def torque(place, x):
        return motor.gear * motor.torque * math.sin(motor.teeth * motor.gear * (x0 + place - x))

    def rate(place, x, v):
        f, g = plant.nominal(np.array([x]), np.array([v]), 0, values)
        free = 1.0 / g  # the plant's inertia, to which the rotor's is added
        return (f * free + torque(place, x) - motor.gear**2 * motor.damping * v) / (free + inertia)

    instants = set(times)
    for a, b in itertools.pairwise(grid):
        if a in instants:
            rows.append((x, v, impulse))
        h = b - a
        # the field is continuous from the right at a, and from the left at b
        if a not in knots:
            first = np.interp(a, knots, positions)
        else:
            first = positions[np.flatnonzero(knots == a)[-1]]
        if b not in knots:
            last = np.interp(b, knots, positions)
        else:
            last = positions[np.flatnonzero(knots == b)[0]]
        mid = 0.5 * (first + last)
        k1 = rate(first, x, v)
        k2 = rate(mid, x + h / 2 * v, v + h / 2 * k1)
        k3 = rate(mid, x + h / 2 * (v + h / 2 * k1), v + h / 2 * k2)
        k4 = rate(last, x + h * (v + h / 2 * k2), v + h * k3)
        middle = x + h / 2 * v + h * h / 8 * k1
        start = x
        x = x + h * v + h * h / 6 * (k1 + k2 + k3)
        v = v + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        impulse += h / 6 * (torque(first, start) + 4 * torque(mid, middle) + torque(last, x))
    rows.append((x, v, impulse))
    x, v, impulse = np.array(rows).T
    return x, v, np.diff(impulse) / np.diff(times)


def by_events(one):
    """Steps of a scenario's motor by events, with the commands of its run's samples."""
    s = one.resolved
    motor = one.actuator[0]
    trace = smc.run(one)
    commands = list(zip(trace.t, trace.u[:, 0], strict=True))
    return trace, steps_by_events(
        motor, commands[:-1], reference.motors_at_start(s)[0]["phase"], trace.t[-1]
    )


def looped(one):
    """The reference loop of a scenario, after its run."""
    with installed():
        loop = reference.Loop(one, model.mechanism(one))
    with installed(loop.control):
        for step in range(loop.total):
            loop.step(step)
    assert not loop.failure
    return loop


# all kinds: the motion test below, which is integrated with these steps
@pytest.mark.parametrize("kind", ["slow", "fast", "each step when it is due", "turns at once"])
def test_the_steps_are_those_of_an_event_integration(kind):
    motor, push = KINDS[kind]
    # so that the queue has room for all
    pushed = scenario(dataclasses.replace(motor, speed=400.0), push)
    _, steps = by_events(pushed)
    state, queue = (own := looped(pushed).motors[0]).state, own.queue
    expected = []
    for i in range(int(state.tail)):
        expected.append((queue[2 * i], queue[2 * i + 1]))
    expected = [step for step in expected if step[0] < pushed.duration]
    assert len(steps) > 30
    assert {way for _, way in steps} == {-1, 1}
    assert [way for _, way in expected] == [way for _, way in steps]
    assert [t for t, _ in expected] == pytest.approx([t for t, _ in steps], abs=1e-12)


MOVED = ("slips", "without queue", "jumps", "geared")  # the others: seconds each
REST = [pytest.param(kind, marks=pytest.mark.slow) for kind in KINDS if kind not in MOVED]


@pytest.mark.parametrize("kind", [*MOVED, *REST])
def test_the_joint_moves_as_behind_these_steps(kind):
    motor, push = KINDS[kind]
    pushed = scenario(
        motor,
        push,
        duration=0.8,
        physics_step=1.25e-4,
    )
    trace, steps = by_events(pushed)
    x, v, force = moved(
        motor, steps, pushed.plant, 0.3, trace.t, motor.gear**2 * motor.rotor_inertia
    )
    # RK4 gets the mean and the first moment of a jump within a step
    rough = 5e3 if kind == "jumps" else 1.0
    assert trace.x[:, 0] == pytest.approx(x, abs=rough * 1e-9)
    assert trace.v[:, 0] == pytest.approx(v, abs=rough * 1e-7)
    assert trace.force[1:, 0] == pytest.approx(force, abs=rough * 1e-8)
    assert np.ptp(x) > 0.04


CONDITIONS = {
    "late and missed samples": {
        "clock": smc.Clock(jitter=2e-3, missed=0.2),
        "input_delay": 3e-3,
    },
    "friction": {"friction": smc.Coulomb(0.01)},
    "play": {"actuator": (MOTOR, smc.Backlash(0.05))},
    "several motors": {
        "plant": "pendulum_network",
        "x0": 0.1,
        "law": smc.law("pid"),
        "actuator": Stepper(torque=20.0),
    },
    "a free joint": {
        "plant": "cart_pole",
        "x0": (0.0, 0.05),
        "law": "hierarchical",
    },
}


@pytest.mark.parametrize("name", CONDITIONS)
def test_the_callback_is_the_reference_loop_to_the_last_bit(name):
    fields = {
        "plant": PLANT,
        "law": "none",
        "actuator": MOTOR,
        "feedforward": SLOW,
        "x0": 0.3,
    } | CONDITIONS[name]
    stepped = smc.Scenario(
        **fields,
        duration=0.4,
        control_period=PERIOD,
        seed=2,
    )
    compiled = smc.run(stepped)
    looped = reference.run(stepped)
    for column, values in compiled.arrays().items():
        assert np.array_equal(values, looped.arrays()[column]), column


def test_a_missed_sample_adds_no_speed_and_the_next_adds_that_of_both():
    """A field without a generator turns at the speed that the firmware sums."""
    missing = scenario(
        dataclasses.replace(MOTOR, steps=math.inf), SLOW, clock=smc.Clock(missed=0.3), duration=0.5
    )
    loop = looped(missing)
    speed = 0.0
    last = 0.0
    for k, t in enumerate(PERIOD * np.arange(missing.samples)):
        if loop.late(k) >= 0:
            speed = speed + loop.log["u"][k, 0] * (t - last)
            last = t
    assert 10 < sum(loop.late(k) < 0 for k in range(missing.samples)) < 50
    assert loop.motors[0].state.speed == pytest.approx(speed, rel=1e-12)


@pytest.mark.quick
def test_a_strong_motor_without_a_generator_has_the_wanted_acceleration():
    """The plain twin of a stepper: x'' = u, a sample late."""
    ideal = Stepper(
        steps=math.inf,
        torque=1e3,
        damping=0.0,
        ramp=100.0,
    )
    trace = smc.run(
        scenario(
            ideal,
            SLOW,
            control_period=1e-3,
            physics_step=1.25e-4,
        )
    )
    speed = np.cumsum(np.append(0.0, 1e-3 * trace.u[1:, 0]))
    assert trace.v[:, 0] == pytest.approx(speed, abs=0.02)
    assert np.ptp(speed) > 0.6


@smc.law_function(gains={"a": 3.0})
def pushed(y, gains, memory):
    return gains.a, y.fq + y.gq * gains.a


def test_the_nominal_model_has_the_acceleration_as_its_input():
    plant = smc.plant("furuta", bq=1e-5)
    x = (0.3, 0.2)
    v = (1.0, 2.0)
    trace = smc.run(
        scenario(
            MOTOR,
            None,
            plant,
            law=pushed(),
            model="nominal",
            x0=x,
            v0=v,
            duration=0.01,
        )
    )
    p = plant.values({})
    Jp = p.Jc + p.m * p.l**2
    s = math.sin(x[1])
    c = math.cos(x[1])
    torque = (
        Jp * s * c * v[0] ** 2 + p.m * p.grav * p.l * s - p.bq * v[1] - p.m * p.L * p.l * c * 3.0
    )
    assert trace.s[0, 0] == pytest.approx(torque / Jp, rel=1e-12)
    assert trace.units()["u0"] == "rad/s^2"
