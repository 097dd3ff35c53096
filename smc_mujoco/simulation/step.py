"""The order of a control step, once for all that drive a run: MuJoCo's control callback (see
`controller`), the fast engine, and the callback of MuJoCo Warp's worlds (see `analysis/engine`).

At the first stage of a physics step:

    sums of the forces of the step before
    the sample of the control period, if it comes in this step; for each channel
        sense -> noise -> read -> estimate -> reference and model -> law -> compensation of
        friction -> bound -> ring
    the command whose delay has passed, with what a fault makes of it
    disturbances; at the first step of a period, the log

At every later stage there are disturbances alone. The driver lets its parts act after either, and
integrates.

A sample may come late in its period, or be missed, see `Clock`. Its log then repeats the command of
the sample before.

A driver says how it does each of these by its `Moments`: compiled functions of its `view` of a run,
which the order only passes on. They write into the records of `state` and `moments`, LOG,
CHANNEL_STATE and DRIVE, which every driver has. A new condition is written here, with a flag for
runs that are without it.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import math
from typing import Any, NamedTuple

from smc_mujoco.common.jit import always, inlined
from smc_mujoco.control.measurement import Measurement
from smc_mujoco.simulation import philox
from smc_mujoco.simulation.signals import after_pauses
from smc_mujoco.simulation.state import DIVERGED, FINE, LAW_RAISED, NOT_FINITE, RAISED

MAX_CONTROL = 1e10  # MuJoCo drops all controls if one is larger
# of a step: where RK4's last stage evaluates signals, just before a jump at the step's end
LAST_STAGE = 1.0 - 1e-8


class Moments(NamedTuple):
    """What a driver does at each moment: compiled functions, of `view` first.

    Functions that call a user's function return first whether it raised.
    """

    n: Any  # (view) -> channels
    driven: Any  # (view) -> those that have an actuator, which come first
    settings: Any  # (view) -> a record with numbers of `prepare.settings`, by their names
    late: Any  # (view, k) -> by how many physics steps sample k is late; -1 if it does not run
    # records of a channel
    now: Any  # (view, k, i) -> LOG at sample k
    before: Any  # (view, k, i) -> LOG at the sample before
    state: Any  # (view, i) -> CHANNEL_STATE
    drive: Any  # (view, i) -> DRIVE, or its limit, scale, gain, drag and accelerates
    # arrays of all channels, (n,)
    ring: Any  # (view, k) -> commands of sample k
    seen: Any  # (view) -> measured positions, estimated velocities and accelerations
    # a sample
    errors: Any  # (view, t) -> errors of position and velocity
    sense: Any  # (view, i, t) -> x and v at the sensor
    noise: Any  # (view, i, j) -> normal numbers of reading j, of position and velocity
    estimate: Any  # (view, i, x, v) -> raised, v and a
    feedforward: Any  # (view, t) -> raised, value; before the laws
    ask: Any  # (view, k, t, i) -> failure, u and s of channel i; see `asking`
    # a physics step
    diverged: Any  # (view) -> whether a position or velocity is too large
    disturb: Any  # (view, t, k) -> failure; k is the sample at its first stage, and -1 elsewhere
    truth: Any  # (view, i) -> x and v
    applied: Any  # (view, i) -> the command that the actuator has
    disturbance: Any  # (view, i) -> force on the joint
    # what a driver may leave out
    reading: Any = inlined(lambda view, i, k, t: k)  # -> the index of the sensor's reading
    # -> raised, x and v that the sensor makes of reading j
    read: Any = inlined(lambda view, i, j, x, v: (False, x, v))
    # (view, k, t, i, u) -> raised, what compensates friction of channel i beside the u of its law
    compensate: Any = always((False, 0.0))
    commanded: Any = always(None)  # (view, i, u): after the bound
    finish: Any = always(FINE)  # (view, k) -> failure; after all laws
    apply: Any = always(None)  # (view, i, u): give the actuator its command
    arrived: Any = always(None)  # (view): after all of them
    sum_forces: Any = always(None)  # (view)
    over: Any = always(FINE)  # (view, k) -> failure, where no sample may follow
    # whether sensors may have noise, samples and commands come late, actuators fail, and forces be
    # summed; what a run cannot have is not compiled
    noisy: bool = True
    clock: bool = True
    delayed: bool = True
    fails: bool = True
    sums: bool = True


class Asked(NamedTuple):
    """What a driver does to ask the law of one channel, beside the fields of Moments."""

    partners: Any  # (view) -> whether a joint without actuator moves with each channel
    knows: Any  # (view) -> whether the nominal model is the true one
    refer: Any  # (view, i, k, t) -> raised, r, r' and r''
    nominal: Any  # (view, i) -> raised, f and g
    law: Any  # (view, i, y) -> raised, u and s
    # (view, i, dr) -> how far the reference that the law sees leads, through a play
    lead: Any = always(0.0)
    slides: Any = always(False)  # (view) -> whether there is a surface
    slide: Any = always((False, 0.0, 0.0))  # (view, i, y) -> raised, s and v_eq


class Order(NamedTuple):
    """The order of a driver."""

    begin: Any  # (view, k, within, step) -> failure: the first stage of a physics step
    between: Any  # (view, k, within, stage) -> failure: a later one


# Each function below takes what it needs of `of` by name: numba finds functions within a tuple on
# the processor only.
def order(of: Moments) -> Order:
    """Return the order of a control step, composed of a driver's moments."""
    settings_of = of.settings
    late_of = of.late
    sum_forces = of.sum_forces
    diverged = of.diverged
    over = of.over
    disturb = of.disturb
    sample = _sampling(of)
    arrive = _arriving(of)
    log = _logging(of)

    @inlined
    def begin(view, k, within, step):
        settings = settings_of(view)
        sum_forces(view)
        failure = DIVERGED if diverged(view) else over(view, k)
        late = late_of(view, k)
        if failure == FINE:
            failure = sample(view, k, within, late)
        arrive(view, k, step, within == late)
        if failure == FINE:
            t = k * settings.period + within * settings.step
            failure = disturb(view, t, k if within == 0 else -1)
        if failure == FINE and within == 0:
            log(view, k)
        return failure

    @inlined
    def between(view, k, within, stage):
        settings = settings_of(view)
        fraction = LAST_STAGE if stage == 3 else 0.5
        return disturb(view, k * settings.period + (within + fraction) * settings.step, -1)

    return Order(begin, between)


@inlined
def lateness(settings, k, last):
    """Return by how many physics steps sample k is late; -1 if it does not run."""
    if k in (0, last):
        return 0
    missed = settings.missed
    if (
        missed != 0.0
        and philox.uniform(settings.seed, philox.NO_CHANNEL, philox.MISSED, k) < missed
    ):
        return -1
    if settings.pause != 0:
        return after_pauses(
            k, settings.steps, settings.pause, settings.pause_samples, settings.pause_phase
        )
    if settings.jitter == 0:
        return 0
    return int(
        philox.uniform(settings.seed, philox.NO_CHANNEL, philox.JITTER, k) * (settings.jitter + 1)
    )


@inlined
def reading_at(k, t, period, delay):
    """Return the index of the reading that a sensor gives at sample k, at time t, s: the sample's,
    or that of the sensor's own clock.
    """
    if period == 0.0:
        return k
    return max(0, math.floor((t - delay) / period + 1e-6))


def _sampling(of: Moments) -> Any:
    """Return a function (view, k, within, late) -> failure: sample k, if it comes in this physics
    step, `within` steps into its period.
    """
    settings_of = of.settings
    clock = of.clock
    measure = _measuring(of)
    command = _commanding(of)
    repeat = _repeating(of)

    @inlined
    def sample(view, k, within, late):
        settings = settings_of(view)
        if clock and within == 0 and late != 0:
            repeat(view, k)
        if within != late:
            return FINE
        t = k * settings.period + late * settings.step
        failure = measure(view, k, t)
        if failure == FINE:
            failure = command(view, k, t)
        if clock and failure != FINE and late != 0:
            repeat(view, k)  # some channels may have written into the log
        return failure

    return sample


def _repeating(of: Moments) -> Any:
    """Return a function (view, k): give sample k the command of the sample before, with its u, s,
    r and compensation in the log.
    """
    n_of = of.n
    ring_of = of.ring
    now_of = of.now
    before_of = of.before

    @inlined
    def repeat(view, k):
        ring = ring_of(view, k)
        for i in range(n_of(view)):
            now = now_of(view, k, i)
            before = before_of(view, k, i)
            now.u, now.s, now.r, ring[i] = before.u, before.s, before.r, before.u
            now.compensation = before.compensation

    return repeat


def _measuring(of: Moments) -> Any:
    """Return a function (view, k, t) -> failure: measure the position of every channel, and
    estimate its velocity and acceleration.
    """
    n_of = of.n
    settings_of = of.settings
    seen = of.seen
    errors = of.errors
    sense = of.sense
    reading = of.reading
    read = of.read
    estimate = of.estimate
    noisy = of.noisy
    noise = of.noise

    @inlined
    def measure(view, k, t):
        settings = settings_of(view)
        xs, vs, accelerations = seen(view)
        x_error, v_error = errors(view, t)
        for i in range(n_of(view)):
            x, v = sense(view, i, t)
            x += x_error
            v += v_error
            j = reading(view, i, k, t)
            if noisy and (settings.sigma_x != 0.0 or settings.sigma_v != 0.0):
                x_noise, v_noise = noise(view, i, j)
                x += settings.sigma_x * x_noise
                v += settings.sigma_v * v_noise
            raised, x, v = read(view, i, j, x, v)
            if raised:
                return RAISED
            raised, estimated, a = estimate(view, i, x, v)
            if raised:
                return RAISED
            xs[i], vs[i], accelerations[i] = x, estimated, a
        return FINE

    return measure


def _commanding(of: Moments) -> Any:
    """Return a function (view, k, t) -> failure: ask the law of every channel. What it commands is
    bounded, and sent on its way.
    """
    driven_of = of.driven
    ring_of = of.ring
    feedforward = of.feedforward
    ask = of.ask
    compensate = of.compensate
    drive_of = of.drive
    now_of = of.now
    commanded = of.commanded
    finish = of.finish

    @inlined
    def command(view, k, t):
        ring = ring_of(view, k)
        raised, forward = feedforward(view, t)
        if raised:
            return RAISED
        for i in range(driven_of(view)):
            failure, u, s = ask(view, k, t, i)
            if failure != FINE:
                return failure
            raised, compensation = compensate(view, k, t, i, u + forward)
            if raised:
                return RAISED
            drive = drive_of(view, i)
            u += forward + compensation
            bounded = min(max(u, -drive.limit), drive.limit)
            small = abs(bounded) * max(1.0, drive.scale) < MAX_CONTROL
            now = now_of(view, k, i)
            if not (small and math.isfinite(u) and math.isfinite(s)):
                return NOT_FINITE
            ring[i], now.u, now.s = bounded, bounded, s
            now.compensation = compensation
            commanded(view, i, bounded)
        return finish(view, k)

    return command


def asking(of: Moments, asked: Asked) -> Any:
    """Return a function (view, k, t, i) -> failure, u and s: ask the law of channel i.

    `of` may be without its `ask`, which this is.
    """
    settings_of = of.settings
    drive_of = of.drive
    seen = of.seen
    now_of = of.now
    refer = asked.refer
    slides = asked.slides
    slide = asked.slide
    law = asked.law
    lead = asked.lead
    model = _modelling(of, asked)

    @inlined
    def ask(view, k, t, i):
        settings = settings_of(view)
        xs, vs, accelerations = seen(view)
        limit = drive_of(view, i).limit
        raised, r, dr, ddr = refer(view, i, k, t)
        if raised:
            return RAISED, 0.0, 0.0
        now_of(view, k, i).r = r
        r += lead(view, i, dr)
        raised, f, g, partner = model(view, i)
        if raised:
            return RAISED, 0.0, 0.0
        a = accelerations[i]
        if math.isnan(a):  # the estimator gives none
            a = ddr

        def measured(has_surface, s, v_eq):
            return Measurement(
                t=t,
                dt=settings.period,
                x=xs[i],
                v=vs[i],
                e=xs[i] - r,
                de=vs[i] - dr,
                r=r,
                dr=dr,
                ddr=ddr,
                f=f,
                g=g,
                a=a,
                limit=limit,
                model=settings.uses_model,
                has_surface=has_surface,
                s=s,
                v_eq=v_eq,
                q=partner[0],
                dq=partner[1],
                fq=partner[2],
                gq=partner[3],
            )

        y = measured(0.0, 0.0, 0.0)
        if slides(view):
            raised, s, v_eq = slide(view, i, y)
            if raised:
                return RAISED, 0.0, 0.0
            y = measured(1.0, s, v_eq)
        raised, u, s = law(view, i, y)
        return LAW_RAISED if raised else FINE, u, s

    return ask


def _modelling(of: Moments, asked: Asked) -> Any:
    """Return a function (view, i) -> raised, f and g of the nominal model of channel i, as x'' = f
    + g u, and of the joint that moves with it q, q', and its f and g; 0 without one.
    """
    driven_of = of.driven
    settings_of = of.settings
    state_of = of.state
    drive_of = of.drive
    seen = of.seen
    disturbance = of.disturbance
    partners = asked.partners
    knows = asked.knows
    nominal = asked.nominal

    @inlined
    def model(view, i):
        xs, vs, _ = seen(view)
        drive = drive_of(view, i)
        q = dq = fq = gq = 0.0
        if partners(view):
            partner = i + driven_of(view)
            raised, f, g = nominal(view, partner)
            if raised:
                return True, 0.0, 0.0, (0.0, 0.0, 0.0, 0.0)
            q = xs[partner]
            dq = vs[partner]
            # the force in the nominal model is that of the drive, gain u - drag v
            fq = f - drive.drag * vs[i] * g
            gq = drive.gain * g
        raised, f, g = nominal(view, i)
        force = f - drive.drag * vs[i] * g
        per_u = drive.gain * g
        if knows(view):
            reaction = state_of(view, i).reaction / settings_of(view).steps
            force += (disturbance(view, i) + reaction) * g
        if drive.accelerates != 0.0:  # u is the acceleration x''
            gq /= per_u
            fq -= gq * force
            force = 0.0
            per_u = 1.0
        return raised, force, per_u, (q, dq, fq, gq)

    return model


def _arriving(of: Moments) -> Any:
    """Return a function (view, k, step, arrives): give the actuators the command whose delay has
    passed at this physics step, if there is one. `arrives` is whether there is, without a delay.
    """
    n_of = of.n
    settings_of = of.settings
    late_of = of.late
    ring_of = of.ring
    state_of = of.state
    apply = of.apply
    arrived = of.arrived
    delayed = of.delayed
    fails = of.fails

    @inlined
    def arrive(view, k, step, arrives):
        settings = settings_of(view)
        sent = k
        if delayed:
            steps = int(settings.steps)
            past = step - int(settings.delay)
            sent = past
            if steps > 1:
                sent = past // steps
            arrives = past >= 0 and past - sent * steps == late_of(view, sent)
        begins = False
        if fails:
            if step >= settings.fault_step and settings.stuck != 0 and settings.failing < 0:
                return
            begins = step == settings.fault_step  # on what is held
        if arrives or begins:
            ring = ring_of(view, sent)
            for i in range(n_of(view)):
                state = state_of(view, i)
                u = ring[i] if arrives else state.delayed
                if fails:
                    failing = settings.failing < 0 or settings.failing == i
                    if step >= settings.fault_step and failing:
                        gain, bias = settings.fault_gain, settings.fault_bias
                        u = state.delayed if settings.stuck != 0 else gain * u + bias
                state.delayed = u
                apply(view, i, u)
            arrived(view)

    return arrive


def _logging(of: Moments) -> Any:
    """Return a function (view, k): write sample k of every channel into the log, except u, s, r and
    the compensation, which are there already.
    """
    n_of = of.n
    settings_of = of.settings
    now_of = of.now
    state_of = of.state
    truth = of.truth
    applied = of.applied
    disturbance = of.disturbance
    sums = of.sums

    @inlined
    def log(view, k):
        settings = settings_of(view)
        for i in range(n_of(view)):
            now = now_of(view, k, i)
            state = state_of(view, i)
            now.x, now.v = truth(view, i)
            now.applied = applied(view, i)
            now.d = disturbance(view, i)
            if sums:
                now.force = state.force / settings.steps
                now.reaction = state.reaction / settings.steps
                now.held = state.held
                state.force = state.reaction = state.held = 0.0

    return log
