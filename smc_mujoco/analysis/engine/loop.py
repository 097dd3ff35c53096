"""The run of a form, written out as one loop that numba compiles for every target.

The order of what happens in a step is that of the control callback, see `controller`. A run reads
its numbers from `row`, the points of its series from `tables`, and keeps its state in `work`. The
functions of a user come compiled: on the processor with checks, so that a law that writes beyond
its memory raises.
"""

# pyright: reportCallIssue=false
import functools
import math
from collections.abc import Callable, Sequence
from typing import Any

from numba import types
from numba.extending import intrinsic, overload

from smc_mujoco.analysis.engine.form import (
    ACTIVE,
    FAILED_STEP,
    FAILURE,
    LOGGED,
    PARAMETERS,
    SETTINGS,
    STREAM,
    Form,
    measured_places,
    parameters,
    parts,
    row_places,
    signals,
    work_places,
)
from smc_mujoco.analysis.engine.scores import own, tallying
from smc_mujoco.common.jit import call, named, place
from smc_mujoco.common.numba_internals import arrayobj, cgutils
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.joint_law import begin_measurement, put_channel
from smc_mujoco.control.law import Measurement
from smc_mujoco.mechanisms.hardware.drives import kept_at
from smc_mujoco.mechanisms.hardware.moments import JointState, Sight
from smc_mujoco.simulation import philox
from smc_mujoco.simulation.controller import MAX_STATE
from smc_mujoco.simulation.state import DIVERGED, FINE, NOT_FINITE, RAISED
from smc_mujoco.simulation.step import LAST_STAGE, lateness

Compiler = Callable[[Any], Any]


def simulation(form: Form, compile_user: Compiler) -> Any:
    """Return the compiled run of a form, simulate(row, tables, work, scores, log).

    All are pointers to numbers; `log` has the numbers `form.LOGGED` of every channel at every
    sample, if the row says `logging`.
    """
    work_at = work_places(form)
    disturb = _disturbing(form, compile_user)
    sample = _sampling(form, compile_user)
    advance = _advancing(form, disturb, compile_user)
    record = _recording(form)
    n = form.n
    size = work_at.size
    X, V, REACTION = work_at.of("x", "v", "reaction")
    STATE = tuple(work_at.of("x", "v", "d"))
    SAMPLED = tuple(work_at.of("sample_x", "sample_v", "sample_d"))
    reactions = n if form.frictions else 0
    SAMPLES, STEPS, STEP, PERIOD, X0, V0 = row_places(form).of(
        "samples", "steps", "step", "period", "x0", "v0"
    )

    @own
    def simulate(row, tables, work, scores, log):
        for j in range(size):
            work[j] = 0.0
        scores[FAILURE] = RAISED
        samples = int(row[SAMPLES])
        steps = int(row[STEPS])
        for i in range(n):
            work[X + i] = row[X0 + i]
            work[V + i] = row[V0 + i]
        for k in range(samples + 1):
            for within in range(steps):
                step = k * steps + within
                scores[FAILED_STEP] = step
                for i in range(n):
                    if not (abs(work[X + i]) < MAX_STATE and abs(work[V + i]) < MAX_STATE):
                        scores[FAILURE] = DIVERGED
                        return
                failure = sample(row, tables, work, k, within, step)
                if failure != FINE:
                    scores[FAILURE] = failure
                    return
                seen = k if within == 0 else -1
                disturb(row, tables, work, k * row[PERIOD] + within * row[STEP], seen)
                if within == 0:
                    for i in range(n):
                        for j in range(3):
                            work[SAMPLED[j] + i] = work[STATE[j] + i]
                    for i in range(reactions):  # of their mean over the period
                        work[REACTION + i] = 0.0
                if k == samples:
                    break
                advance(row, tables, work, k, within, step)
            record(row, work, scores, log, k)  # at the end of its period: the sample may come late
        scores[FAILURE] = FINE

    return simulate


@functools.cache
def reader(names: tuple[str, ...]) -> Callable:
    """Return a compiled function (array, at) -> the numbers from an index on, by these names."""
    values = [f"array[at + {i}]" for i in range(len(names))] or ["0.0"]
    space = {"Parameters": named(names)}
    exec(f"def parameters_at(array, at): return Parameters({', '.join(values)})", space)
    return own(space["parameters_at"])


@intrinsic
def view(typingctx, numbers, first, count):
    """Return an array (count,) of the numbers from an index on, behind a pointer."""
    array = types.Array(types.float64, 1, "C")

    def codegen(context, builder, signature, args):
        made = cgutils.create_struct_proxy(array)(context, builder)
        eight = context.get_constant(types.intp, 8)
        arrayobj.populate_array(
            made,
            data=builder.gep(args[0], [args[1]]),
            shape=[args[2]],
            strides=[eight],
            itemsize=eight,
            meminfo=None,
        )
        return made._getvalue()

    return array(numbers, types.intp, types.intp), codegen


def _pair(found):
    """Return an estimator's velocity and acceleration, NaN if it gives none."""
    raise NotImplementedError


@overload(_pair)
def _pair_of(found):
    if isinstance(found, types.BaseTuple):
        return lambda found: (found[0], found[1])
    return lambda found: (found, math.nan)


def _signal(form: Form, name: str, compile_user: Compiler) -> Any:
    """Return a compiled function (row, tables, work, t, i) -> value, rate and acceleration of a
    signal in channel i, all 0 without one; of one that sees the loop, (row, work, t, e, de, s).
    """
    kind = signals(form).get(name)
    if kind is None:
        return own(lambda row, tables, work, t, i: (0.0, 0.0, 0.0))
    value = compile_user(kind.value)
    values = reader(parameters(kind))
    at = row_places(form).at[name]
    table = at + PARAMETERS + len(parameters(kind))
    kept = work_places(form).at[name] + 1
    memory = kind.memory
    seed = row_places(form).at["seed"]
    rows = kind.rows

    def random(row, tables, work, t, i):
        state = view(work, kept + i * memory, memory)
        numbers = values(row, at + PARAMETERS)
        return value(t, numbers, state, row[seed], float(i), row[at + STREAM])

    def series(row, tables, work, t, i):
        first = int(row[table])
        count = int(row[table + 1])
        points = view(tables, first, rows * count).reshape((rows, count))
        return value(t, values(row, at + PARAMETERS), points)

    def seeing(row, work, t, e, de, s):
        return value(t, values(row, at + PARAMETERS), view(work, kept, memory), e, de, s)

    def plain(row, tables, work, t, i):
        return value(t, values(row, at + PARAMETERS))

    if kind.random:
        return own(random)
    if kind.sees:
        return own(seeing)
    return own(series if kind.series else plain)


def _acting(form: Form, name: str, compile_user: Compiler) -> Any:
    """Return a compiled function (row, tables, work, y, i) -> what a function of `form.parts` gives
    channel i for y; None without such a function.
    """
    part = parts(form).get(name)
    if part is None:
        return None
    function = compile_user(part.function)
    numbers = reader(part.names)
    memory = part.memory
    size = len(part.names) if part.channels else 0
    FIRST = row_places(form).at[name]
    MEMORY = work_places(form).at[name]

    @own
    def act(row, tables, work, y, i):
        state = view(work, MEMORY + i * memory, memory)
        return function(y, numbers(row, FIRST + i * size), state)

    return act


def _by_channel(functions: Sequence[Any], j: int = 0) -> Any:
    """Return a compiled function that calls the function of channel i, or the last one."""
    function = functions[j]
    if j == len(functions) - 1:
        return function
    others = _by_channel(functions, j + 1)

    @own
    def choose(row, tables, work, y, i):
        if i == j:
            return function(row, tables, work, y, i)
        return others(row, tables, work, y, i)

    return choose


def _lateness(form: Form) -> Any:
    """Return a compiled function (row, k) -> by how many physics steps sample k is late; -1 if it
    does not run.
    """
    if not form.clock:
        return own(lambda row, k: 0)
    settings = reader(SETTINGS)

    @own
    def late(row, k):
        numbers = settings(row, 0)
        return int(lateness(numbers, k, int(numbers.samples)))

    return late


def _sampling(form: Form, compile_user: Compiler) -> Any:
    """Return a compiled function (row, tables, work, k, within, step) -> failure code.

    It measures and runs the law, if sample k comes in this step, and applies the command whose
    delay has passed.
    """
    n = form.n
    delayed = form.delay
    slots = form.slots
    measure = _measuring(form, compile_user)
    command = _commanding(form, compile_user)
    late_of = _lateness(form)
    U, BUFFER, APPLIED = work_places(form).of("u", "buffer", "applied")
    STEPS, STEP, PERIOD, DELAY = row_places(form).of("steps", "step", "period", "delay")

    @own
    def sample(row, tables, work, k, within, step):
        late = late_of(row, k)
        if within == 0 and late != 0:  # until then the last command stays
            for i in range(n):
                work[BUFFER + k % slots * n + i] = work[U + i]
        if within == late:
            t = k * row[PERIOD] + late * row[STEP]
            measure(row, tables, work, k, t)
            if not command(row, tables, work, k, t):
                return NOT_FINITE
        sent = k
        arrives = within == late
        if delayed:
            steps = int(row[STEPS])
            past = step - int(row[DELAY])
            sent = past
            if steps > 1:
                sent = past // steps
            arrives = past >= 0 and past - sent * steps == late_of(row, sent)
        if arrives:
            for i in range(n):
                work[APPLIED + i] = work[BUFFER + sent % slots * n + i]
        return FINE

    return sample


def _measuring(form: Form, compile_user: Compiler) -> Any:
    """Return a compiled function (row, tables, work, k, t): sensors, noise and estimators of all
    channels.
    """
    n = form.n
    noise = form.noise
    position_error = _signal(form, "errors 0", compile_user)
    velocity_error = _signal(form, "errors 1", compile_user)
    sensed = bool(form.sensors)
    read = _acting(form, "sensors 0", compile_user)
    estimate = _acting(form, "estimators 0", compile_user)
    HINGES, SEED, SIGMA_X, SIGMA_V, PERIOD = row_places(form).of(
        "hinges", "seed", "sigma_x", "sigma_v", "period"
    )
    X, V, SEEN_X, SEEN_V, SEEN_A = work_places(form).of("x", "v", "seen_x", "seen_v", "seen_a")

    @own
    def measure(row, tables, work, k, t):
        for i in range(n):
            x = work[X + i] + position_error(row, tables, work, t, 0)[0]
            v = work[V + i] + velocity_error(row, tables, work, t, 0)[0]
            if noise and (row[SIGMA_X] != 0.0 or row[SIGMA_V] != 0.0):
                z = philox.normals(row[SEED], i, philox.MEASUREMENT, k)
                x += row[SIGMA_X] * z[0]
                v += row[SIGMA_V] * z[1]
            if sensed:
                chance = philox.uniform(row[SEED], i, philox.DROPOUT, k)
                sight = Sight(x, v, float(k), row[HINGES + i], chance)
                x, v = read(row, tables, work, sight, i)
            found = _pair(estimate(row, tables, work, Reading(row[PERIOD], x, v), i))
            work[SEEN_X + i] = x
            work[SEEN_V + i] = found[0]
            work[SEEN_A + i] = found[1]

    return measure


def _law(form: Form, i: int, compile_user: Compiler) -> Any:
    """Return a compiled function (row, tables, work, y, channel) -> u and s of law i."""
    if form.laws[i].function is None:
        return _law_in_c(form, i)
    return _acting(form, f"laws {i}", compile_user)


def _law_in_c(form: Form, i: int) -> Any:
    """Return the same of a law in C, which takes addresses."""
    ask = _calling(form, i)
    size = measured_places(form)
    MEASURED, COMMANDED = work_places(form).of("measured", "commanded")

    @own
    def law(row, tables, work, y, channel):
        for j in range(size):
            work[MEASURED + j] = y[j]
        ask(row, work, channel)
        return work[COMMANDED], work[COMMANDED + 1]

    return law


def _calling(form: Form, i: int) -> Any:
    """Return a compiled function (row, work, channel): call law i, which is in C, on what was
    measured.
    """
    memory = form.laws[i].memory
    ADDRESS, GAINS = row_places(form).of(f"laws {i} address", f"laws {i}")
    MEASURED, COMMANDED, MEMORY = work_places(form).of("measured", "commanded", f"laws {i}")

    @own
    def ask(row, work, channel):
        first = place(work)
        state = first + 8 * (MEMORY + channel * memory)
        gains = place(row) + 8 * GAINS
        address = int(row[ADDRESS])
        if call(address, first + 8 * MEASURED, gains, state, first + 8 * COMMANDED) != 0:
            raise ValueError

    return ask


def _asking(form: Form, refer: Any, compile_user: Compiler) -> Any:
    """Return a compiled function (row, tables, work, t, i) -> u, s and r of channel i, with a
    function that gives its reference.
    """
    n = form.n
    driven = form.driven
    true_model = form.true_model
    law = _by_channel([_law(form, i, compile_user) for i in range(len(form.laws))])
    slides = bool(form.surfaces)
    surface = _acting(form, "surfaces 0", compile_user)
    nominal = compile_user(form.nominal.function)
    values = reader(form.nominal.names)
    KNOWN, LIMITS, PERIOD, STEPS, USES_MODEL = row_places(form).of(
        "known", "limits", "period", "steps", "uses_model"
    )
    SEEN_X, SEEN_V, SEEN_A, D, REACTION = work_places(form).of(
        "seen_x", "seen_v", "seen_a", "d", "reaction"
    )
    rubs = bool(form.frictions)

    @own
    def ask(row, tables, work, t, i):
        known = values(row, KNOWN)
        xs = view(work, SEEN_X, n)
        vs = view(work, SEEN_V, n)
        r, dr, ddr = refer(row, tables, work, t, i)
        f, g = nominal(xs, vs, i, known)
        if true_model:
            others = work[D + i]
            if rubs:
                others += work[REACTION + i] / row[STEPS]
            f += others * g
        a = work[SEEN_A + i]
        if math.isnan(a):
            a = ddr
        partner = (0.0, 0.0, 0.0, 0.0)
        if n > driven:
            fq, gq = nominal(xs, vs, i + driven, known)
            partner = (xs[i + driven], vs[i + driven], fq, gq)

        def seen(has_surface, s, v_eq):
            return Measurement(
                t=t,
                dt=row[PERIOD],
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
                limit=row[LIMITS + i],
                model=row[USES_MODEL],
                has_surface=has_surface,
                s=s,
                v_eq=v_eq,
                q=partner[0],
                dq=partner[1],
                fq=partner[2],
                gq=partner[3],
            )

        y = seen(0.0, 0.0, 0.0)
        if slides:
            s, v_eq = surface(row, tables, work, y, i)
            y = seen(1.0, s, v_eq)
        u, s = law(row, tables, work, y, i)
        return u, s, r

    return ask


def _asking_all(form: Form, refer: Any, compile_user: Compiler) -> Any:
    """Return the same of a law of many joints, which is asked once, for all channels."""
    n = form.n
    driven = form.driven
    law = _calling(form, 0)
    size = measured_places(form)
    nominal = compile_user(form.nominal.function)
    values = reader(form.nominal.names)
    KNOWN, LIMITS, PERIOD, USES_MODEL = row_places(form).of(
        "known", "limits", "period", "uses_model"
    )
    SEEN_X, SEEN_V, SEEN_A, REST, R, MEASURED, COMMANDED = work_places(form).of(
        "seen_x", "seen_v", "seen_a", "rest", "r", "measured", "commanded"
    )

    @own
    def measure(row, tables, work, t):
        for i in range(size):
            work[MEASURED + i] = 0.0
        address = place(work) + 8 * MEASURED
        y = begin_measurement(address, t, row[PERIOD], row[USES_MODEL], 0, n, driven)
        known = values(row, KNOWN)
        xs = view(work, SEEN_X, n)
        vs = view(work, SEEN_V, n)
        for i in range(n):
            r, dr, ddr = refer(row, tables, work, t, i)
            work[R + i] = r
            put_channel(y, i, xs[i], vs[i], work[SEEN_A + i], row[LIMITS + i], r, dr, ddr)
            y.M[i, i] = 1.0
            if row[USES_MODEL] != 0.0:  # M is diagonal
                f, g = nominal(xs, vs, i, known)
                at_rest = nominal(xs, view(work, REST, n), i, known)[0]
                y.M[i, i] = 1.0 / g
                y.h[i] = -f / g
                y.g[i] = -at_rest / g

    @own
    def ask(row, tables, work, t, i):
        if i == 0:
            measure(row, tables, work, t)
            law(row, work, 0)
        return work[COMMANDED + i], work[COMMANDED + n + i], work[R + i]

    return ask


def _commanding(form: Form, compile_user: Compiler) -> Any:
    """Return a compiled function (row, tables, work, k, t) -> whether all commands are finite.

    It runs the law of every channel.
    """
    n = form.n
    driven = form.driven
    slots = form.slots
    references = []
    for i in range(len(form.references)):
        references.append(_signal(form, f"references {i}", compile_user))
    refer = _by_channel(references)
    ask = (_asking_all if form.joint else _asking)(form, refer, compile_user)
    feed = _signal(form, "feedforwards 0", compile_user)
    LIMITS = row_places(form).at["limits"]
    BUFFER, U, S, R = work_places(form).of("buffer", "u", "s", "r")

    @own
    def command(row, tables, work, k, t):
        forward = feed(row, tables, work, t, 0)[0]
        for i in range(driven):
            u, s, r = ask(row, tables, work, t, i)
            u += forward
            if not (math.isfinite(u) and math.isfinite(s) and math.isfinite(r)):
                return False
            limit = row[LIMITS + i]
            u = min(max(u, -limit), limit)
            work[BUFFER + k % slots * n + i] = u
            work[U + i] = u
            work[S + i] = s
            work[R + i] = r
        return True

    return command


def _disturbing(form: Form, compile_user: Compiler) -> Any:
    """Return a compiled function (row, tables, work, t, k): the sum of the disturbances on each
    channel at time t, s.

    k is the sample at its first stage, and -1 at all others.
    """
    driven = form.driven if form.disturbances else 0
    D = work_places(form).at["d"]

    @own
    def disturb(row, tables, work, t, k):
        for i in range(driven):
            work[D + i] = 0.0

    for j in range(len(form.disturbances)):
        disturb = _and_disturbance(form, f"disturbances {j}", disturb, compile_user)
    return disturb


def _and_disturbance(form: Form, name: str, others: Any, compile_user: Compiler) -> Any:
    """Return a compiled function that adds a disturbance to the sum of others."""
    evaluate = _signal(form, name, compile_user)
    driven = form.driven
    alone = signals(form)[name].random
    sees = signals(form)[name].sees
    last = work_places(form).at[name]
    active = row_places(form).at[name] + ACTIVE
    PERIOD = row_places(form).at["period"]
    X, V, R, LAST_R, S, D = work_places(form).of("x", "v", "r", "last_r", "s", "d")

    @own
    def disturb(row, tables, work, t, k):
        others(row, tables, work, t, k)
        for i in range(driven if row[active] != 0.0 else 0):
            if sees:
                if i == 0 and k >= 0:
                    r = work[R]
                    rate = (r - work[LAST_R]) / row[PERIOD] if k > 0 else 0.0
                    work[last] = evaluate(row, work, t, work[X] - r, work[V] - rate, work[S])[0]
            elif i == 0 or alone:
                work[last] = evaluate(row, tables, work, t, i)[0]
            work[D + i] += work[last]

    return disturb


def _driving(form: Form) -> Any:
    """Return a compiled function (row, work, i, stage): the force of the drive of channel i, and
    its mean over the step.
    """
    if not form.drives:
        return own(lambda row, work, i, stage: None)
    (part,) = form.drives
    advance = part.function
    factors = reader(part.names)
    size = len(part.names)
    FACTORS = row_places(form).at["drives 0"]
    V, APPLIED, MEAN, MOTOR, KEPT = work_places(form).of(
        "v", "applied", "mean", "motor", "drives 0"
    )

    @own
    def drive(row, work, i, stage):
        kept = kept_at(place(work) + 8 * KEPT, i)
        if stage == 0:
            of_drive = factors(row, FACTORS + size * i)
            work[MEAN + i] = advance(of_drive, kept, work[APPLIED + i], work[V + i])
        work[MOTOR + i] = work[MEAN + i]
        if stage == 0:
            work[MOTOR + i] -= kept.rise
        elif stage == 3:
            work[MOTOR + i] += kept.rise

    return drive


def _friction(form: Form, compile_user: Compiler) -> Any:
    """Return a compiled function (row, tables, work, i, stage, step, f, at_rest, g) -> friction on
    channel i; `f` is at its speed, `at_rest` is f at speed 0.
    """
    total = own(lambda row, tables, work, y, i: 0.0)
    for j in reversed(range(len(form.frictions))):
        total = _and_friction(form, f"frictions {j}", total, compile_user)
    H, LEVELS, DAMPING = row_places(form).of("step", "levels", "damping")
    X, V, APPLIED, MEAN, MOTOR, D, REACTION = work_places(form).of(
        "x", "v", "applied", "mean", "motor", "d", "reaction"
    )

    @own
    def friction(row, tables, work, i, stage, step, f, at_rest, g):
        drag = row[DAMPING + i] * work[V + i]
        pushed = work[D + i]
        y = JointState(
            t=step * row[H],
            h=row[H],
            x=work[X + i],
            v=work[V + i],
            u=work[APPLIED + i],
            motor=work[MOTOR + i],
            load=at_rest / g + pushed,
            stage=float(stage),
            others=f / g - drag + pushed,
            mean=work[MEAN + i],
            level=row[LEVELS + i],
            mobility=g,
        )
        force = total(row, tables, work, y, i)
        work[REACTION + i] += force / (6.0 if stage % 3 == 0 else 3.0)
        return force - drag

    return friction


def _and_friction(form: Form, name: str, others: Any, compile_user: Compiler) -> Any:
    """Return a compiled function (row, tables, work, y, i) -> the force of a friction on channel i,
    and of the others.
    """
    force = _acting(form, name, compile_user)
    channels = parts(form)[name].channels

    @own
    def total(row, tables, work, y, i):
        found = others(row, tables, work, y, i)
        if i in channels:
            found += force(row, tables, work, y, i)[0]
        return found

    return total


def _advancing(form: Form, disturb: Any, compile_user: Compiler) -> Any:
    """Return a compiled function (row, tables, work, k, within, step): a physics step of RK4."""
    n = form.n
    driven = form.driven
    jump = form.jump
    rubs = bool(form.frictions)
    # a signal without memory is the same at the third stage as at the second
    remembers = any(kind.memory for kind in form.disturbances)
    drive = _driving(form)
    friction = _friction(form, compile_user)
    nominal = compile_user(form.nominal.function)
    values = reader(form.nominal.names)
    X, V, A, X0, V0, SUM_V, SUM_A, MOTOR, REST, D = work_places(form).of(
        "x", "v", "a", "x0", "v0", "sum_v", "sum_a", "motor", "rest", "d"
    )
    STEP, PERIOD, JUMP_STEP, BEFORE, AFTER = row_places(form).of(
        "step", "period", "jump_step", "before", "after"
    )

    @own
    def advance(row, tables, work, k, within, step):
        h = row[STEP]
        xs = view(work, X, n)
        vs = view(work, V, n)
        p = values(row, BEFORE)
        if jump and row[JUMP_STEP] >= 0.0 and step >= row[JUMP_STEP]:
            p = values(row, AFTER)
        for i in range(n):
            work[X0 + i] = xs[i]
            work[V0 + i] = vs[i]
            work[SUM_V + i] = 0.0
            work[SUM_A + i] = 0.0
        for stage in range(4):
            if stage > 0 and (stage != 2 or remembers):
                fraction = LAST_STAGE if stage == 3 else 0.5
                disturb(row, tables, work, k * row[PERIOD] + (within + fraction) * h, -1)
            for i in range(driven):
                drive(row, work, i, stage)
            for i in range(n):
                f, g = nominal(xs, vs, i, p)
                actuator = i
                if i >= driven:  # it has none, and moves with that of this channel
                    actuator -= driven
                force = work[MOTOR + actuator] + work[D + actuator]
                if rubs:
                    at_rest = nominal(xs, view(work, REST, n), i, p)[0]
                    force += friction(row, tables, work, i, stage, step, f, at_rest, g)
                work[A + i] = f + g * force
            weight = 1.0 if stage % 3 == 0 else 2.0
            reach = h if stage == 2 else 0.5 * h
            for i in range(n):
                speed = vs[i]
                change = work[A + i]
                work[SUM_V + i] += weight * speed
                work[SUM_A + i] += weight * change
                xs[i] = work[X0 + i] + reach * speed
                vs[i] = work[V0 + i] + reach * change
        for i in range(n):
            xs[i] = work[X0 + i] + h / 6.0 * work[SUM_V + i]
            vs[i] = work[V0 + i] + h / 6.0 * work[SUM_A + i]

    return advance


def _recording(form: Form) -> Any:
    """Return a compiled function (row, work, scores, log, k): what is kept of sample k."""
    n = form.n
    columns = len(LOGGED)
    tally = tallying(form)
    LOGGING = row_places(form).at["logging"]
    U, R, LAST_U, LAST_R = work_places(form).of("u", "r", "last_u", "last_r")
    COLUMNS = tuple(work_places(form).of("sample_x", "sample_v", "u", "s", "sample_d", "r"))

    @own
    def record(row, work, scores, log, k):
        tally(row, work, scores, k)
        for i in range(n):
            if row[LOGGING] != 0.0:
                for j in range(columns):
                    log[(k * n + i) * columns + j] = work[COLUMNS[j] + i]
            work[LAST_U + i] = work[U + i]
            work[LAST_R + i] = work[R + i]

    return record
