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
    STREAM,
    Form,
    Part,
    measured_places,
    parameters,
    row_places,
    work_places,
)
from smc_mujoco.analysis.engine.scores import own, tallying
from smc_mujoco.common.jit import call, named, place
from smc_mujoco.common.numba_internals import cgutils
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.joint_law import head_at, measurement_at
from smc_mujoco.control.law import Measurement
from smc_mujoco.mechanisms.hardware.drives import advanced, factors_at, kept_at
from smc_mujoco.mechanisms.hardware.moments import JointState, Sight
from smc_mujoco.simulation import philox
from smc_mujoco.simulation.controller import LAST_STAGE, MAX_STATE
from smc_mujoco.simulation.signals import after_pauses
from smc_mujoco.simulation.state import DIVERGED, FINE, NOT_FINITE, RAISED

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
    keep = _keeping(form)
    record = _recording(form)
    n = form.n
    clock = form.clock
    size = work_at.size
    X, V = work_at.of("x", "v")
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
                    keep(work)
                    if not clock or k == samples:
                        record(row, work, scores, log, k)
                if k == samples:
                    break
                advance(row, tables, work, k, within, step)
            if clock and k < samples:  # a late sample has come
                record(row, work, scores, log, k)
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
        made.data = builder.gep(args[0], [args[1]])
        made.nitems = args[2]
        made.itemsize = eight
        made.shape = cgutils.pack_array(builder, [args[2]])
        made.strides = cgutils.pack_array(builder, [eight])
        made.meminfo = cgutils.get_null_value(made.meminfo.type)
        made.parent = cgutils.get_null_value(made.parent.type)
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


def _signal(form: Form, name: str, kind: Any, compile_user: Compiler) -> Any:
    """Return a compiled function (row, tables, work, t, i) -> value, rate and acceleration of a
    signal in channel i; of one that sees the loop, (row, work, t, e, de, s).
    """
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


def _by_channel(functions: Sequence[Any]) -> Any:
    """Return a compiled function that calls the function of channel i, or the last one."""
    chosen = functions[-1]
    for j in range(len(functions) - 2, -1, -1):
        chosen = _either(j, functions[j], chosen)
    return chosen


def _either(j: int, function: Any, others: Any) -> Any:
    @own
    def choose(row, tables, work, y, i):
        if i == j:
            return function(row, tables, work, y, i)
        return others(row, tables, work, y, i)

    return choose


@own
def _absent(row, tables, work, t, i):
    return 0.0, 0.0, 0.0


def _lateness(form: Form) -> Any:
    """Return a compiled function (row, k) -> by how many physics steps sample k is late; -1 if it
    does not run.
    """
    if not form.clock:
        return own(lambda row, k: 0)
    SAMPLES, STEPS, SEED, JITTER, MISSED = row_places(form).of(
        "samples", "steps", "seed", "jitter", "missed"
    )
    PAUSE, PAUSE_SAMPLES, PAUSE_PHASE = row_places(form).of("pause", "pause_samples", "pause_phase")

    @own
    def late(row, k):
        if k == 0 or k == int(row[SAMPLES]):
            return 0
        if row[MISSED] != 0.0 and philox.uniform(row[SEED], 0, philox.MISSED, k) < row[MISSED]:
            return -1
        if row[PAUSE] != 0.0:
            return after_pauses(
                k,
                int(row[STEPS]),
                int(row[PAUSE]),
                int(row[PAUSE_SAMPLES]),
                int(row[PAUSE_PHASE]),
            )
        if row[JITTER] == 0.0:
            return 0
        return int(philox.uniform(row[SEED], 0, philox.JITTER, k) * (row[JITTER] + 1.0))

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
    def apply(work, k):
        for i in range(n):
            work[APPLIED + i] = work[BUFFER + k % slots * n + i]

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
        if not delayed:
            if within == late:
                apply(work, k)
            return FINE
        steps = int(row[STEPS])
        past = step - int(row[DELAY])
        if past >= 0:
            sent = past
            if steps > 1:
                sent = past // steps
            if past - sent * steps == late_of(row, sent):
                apply(work, sent)
        return FINE

    return sample


def _measuring(form: Form, compile_user: Compiler) -> Any:
    """Return a compiled function (row, tables, work, k, t): sensors, noise and estimators of all
    channels.
    """
    n = form.n
    noise = form.noise
    errors = []
    for i, kind in enumerate(form.errors):
        if kind is None:
            errors.append(_absent)
        else:
            errors.append(_signal(form, f"errors {i}", kind, compile_user))
    position_error, velocity_error = errors
    read = _reading(form, compile_user)
    estimate = compile_user(form.estimator.function)
    gains = reader(form.estimator.names)
    memory = form.estimator.memory
    GAINS, SEED, SIGMA_X, SIGMA_V, PERIOD = row_places(form).of(
        "estimator", "seed", "sigma_x", "sigma_v", "period"
    )
    X, V, SEEN_X, SEEN_V, SEEN_A, MEMORY = work_places(form).of(
        "x", "v", "seen_x", "seen_v", "seen_a", "estimator"
    )

    @own
    def measure(row, tables, work, k, t):
        for i in range(n):
            x = work[X + i] + position_error(row, tables, work, t, 0)[0]
            v = work[V + i] + velocity_error(row, tables, work, t, 0)[0]
            if noise and (row[SIGMA_X] != 0.0 or row[SIGMA_V] != 0.0):
                z = philox.normals(row[SEED], i, philox.MEASUREMENT, k)
                x += row[SIGMA_X] * z[0]
                v += row[SIGMA_V] * z[1]
            x, v = read(row, work, i, k, x, v)
            state = view(work, MEMORY + i * memory, memory)
            found = _pair(estimate(Reading(row[PERIOD], x, v), gains(row, GAINS), state))
            work[SEEN_X + i] = x
            work[SEEN_V + i] = found[0]
            work[SEEN_A + i] = found[1]

    return measure


def _reading(form: Form, compile_user: Compiler) -> Any:
    """Return a compiled function (row, work, i, k, x, v) -> what the sensor of channel i gives."""
    sensor = form.sensor
    if sensor is None:
        return own(lambda row, work, i, k, x, v: (x, v))
    read = compile_user(sensor.function)
    numbers = reader(sensor.names)
    memory = sensor.memory
    HINGES, NUMBERS, SEED = row_places(form).of("hinges", "sensor", "seed")
    MEMORY = work_places(form).at["sensor"]

    @own
    def reading(row, work, i, k, x, v):
        chance = philox.uniform(row[SEED], i, philox.DROPOUT, k)
        sight = Sight(x, v, float(k), row[HINGES + i], chance)
        return read(sight, numbers(row, NUMBERS), view(work, MEMORY + i * memory, memory))

    return reading


def _law(form: Form, i: int, compile_user: Compiler) -> Any:
    """Return a compiled function (row, tables, work, y, channel) -> u and s of law i."""
    part = form.laws[i]
    if part.function is None:
        return _law_in_c(form, i)
    function = compile_user(part.function)
    gains = reader(part.names)
    memory = part.memory
    at = row_places(form).at[f"law {i}"]
    first = work_places(form).at["law"]

    @own
    def law(row, tables, work, y, channel):
        state = view(work, first + channel * memory, memory)
        return function(y, gains(row, at), state)

    return law


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
    ADDRESS, GAINS = row_places(form).of(f"address {i}", f"law {i}")
    MEASURED, COMMANDED, MEMORY = work_places(form).of("measured", "commanded", "law")

    @own
    def ask(row, work, channel):
        first = place(work)
        state = first + 8 * (MEMORY + channel * memory)
        gains = place(row) + 8 * GAINS
        address = int(row[ADDRESS])
        if call(address, first + 8 * MEASURED, gains, state, first + 8 * COMMANDED) != 0:
            raise ValueError

    return ask


@functools.cache
def _replacing(names: tuple[str, ...]) -> Callable:
    """Return a compiled function (y, numbers) -> the measurement y with other values of these."""
    fields = []
    for name in Measurement._fields:
        value = f"y.{name}"
        if name in names:
            value = f"numbers[{names.index(name)}]"
        fields.append(f"{name}={value}")
    space = {"Measurement": Measurement}
    exec(f"def replaced(y, numbers): return Measurement({', '.join(fields)})", space)
    return own(space["replaced"])


def _surface(form: Form, compile_user: Compiler) -> Any:
    """Return a compiled function (row, work, y, channel) -> y with the surface's s and v_eq."""
    part = form.surface
    if part is None:
        return own(lambda row, work, y, channel: y)
    function = compile_user(part.function)
    gains = reader(part.names)
    memory = part.memory
    at = row_places(form).at["surface"]
    first = work_places(form).at["surface"]
    replaced = _replacing(("has_surface", "s", "v_eq"))

    @own
    def on_surface(row, work, y, channel):
        state = view(work, first + channel * memory, memory)
        s, v_eq = function(y, gains(row, at), state)
        return replaced(y, (1.0, s, v_eq))

    return on_surface


def _referring(form: Form, compile_user: Compiler) -> Any:
    """Return a compiled function (row, tables, work, t, i): the reference of channel i."""
    references = []
    for i, kind in enumerate(form.references):
        references.append(_signal(form, f"references {i}", kind, compile_user))
    return _by_channel(references)


def _asking(form: Form, compile_user: Compiler) -> Any:
    """Return a compiled function (row, tables, work, t, i) -> u, s and r of channel i."""
    n = form.n
    driven = form.driven
    true_model = form.true_model
    refer = _referring(form, compile_user)
    law = _by_channel([_law(form, i, compile_user) for i in range(len(form.laws))])
    on_surface = _surface(form, compile_user)
    with_partner = _replacing(("q", "dq", "fq", "gq"))
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
        y = Measurement(
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
            has_surface=0.0,
            s=0.0,
            v_eq=0.0,
            q=0.0,
            dq=0.0,
            fq=0.0,
            gq=0.0,
        )
        if n > driven:
            partner = i + driven
            fq, gq = nominal(xs, vs, partner, known)
            y = with_partner(y, (xs[partner], vs[partner], fq, gq))
        u, s = law(row, tables, work, on_surface(row, work, y, i), i)
        return u, s, r

    return ask


def _asking_all(form: Form, compile_user: Compiler) -> Any:
    """Return the same of a law of many joints, which is asked once, for all channels."""
    n = form.n
    driven = form.driven
    refer = _referring(form, compile_user)
    law = _calling(form, 0)
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
        head = head_at(place(work) + 8 * MEASURED, 0)
        head.t = t
        head.dt = row[PERIOD]
        head.model = row[USES_MODEL]
        head.dynamics = 0.0
        head.n = n
        head.driven = driven
        y = measurement_at(place(work) + 8 * MEASURED)
        known = values(row, KNOWN)
        xs = view(work, SEEN_X, n)
        vs = view(work, SEEN_V, n)
        for i in range(n):
            r, dr, ddr = refer(row, tables, work, t, i)
            work[R + i] = r
            y.x[i] = xs[i]
            y.v[i] = vs[i]
            y.e[i] = xs[i] - r
            y.de[i] = vs[i] - dr
            y.r[i] = r
            y.dr[i] = dr
            y.ddr[i] = ddr
            y.a[i] = work[SEEN_A + i]
            if math.isnan(y.a[i]):
                y.a[i] = ddr
            y.limit[i] = row[LIMITS + i]
            y.h[i] = 0.0
            y.g[i] = 0.0
            for j in range(n):
                y.M[i, j] = 0.0
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
    ask = (_asking_all if form.joint else _asking)(form, compile_user)
    if form.feedforward is None:
        feed = _absent
    else:
        feed = _signal(form, "feedforward", form.feedforward, compile_user)
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
    if not form.disturbances:
        return own(lambda row, tables, work, t, k: None)
    driven = form.driven
    total = own(lambda row, tables, work, t, i, k, d: d)
    for j, kind in reversed(list(enumerate(form.disturbances))):
        total = _adding(form, f"disturbances {j}", kind, total, compile_user)
    D = work_places(form).at["d"]

    @own
    def disturb(row, tables, work, t, k):
        for i in range(driven):
            work[D + i] = total(row, tables, work, t, i, k, 0.0)

    return disturb


def _adding(form: Form, name: str, kind: Any, others: Any, compile_user: Compiler) -> Any:
    """Return a compiled function that adds a disturbance, and the others, to d."""
    evaluate = _signal(form, name, kind, compile_user)
    active = row_places(form).at[name] + ACTIVE
    last = work_places(form).at[name]
    alone = kind.random
    sees = kind.sees
    PERIOD = row_places(form).at["period"]
    X, V, R, LAST_R, S = work_places(form).of("x", "v", "r", "last_r", "s")

    @own
    def value(row, tables, work, t, i, k):
        if sees:
            if i > 0 or k < 0:
                return work[last]
            r = work[R]
            rate = (r - work[LAST_R]) / row[PERIOD] if k > 0 else 0.0
            return evaluate(row, work, t, work[X] - r, work[V] - rate, work[S])[0]
        if i > 0 and not alone:
            return work[last]
        return evaluate(row, tables, work, t, i)[0]

    @own
    def add(row, tables, work, t, i, k, d):
        if row[active] != 0.0:
            work[last] = value(row, tables, work, t, i, k)
            d += work[last]
        return others(row, tables, work, t, i, k, d)

    return add


def _driving(form: Form) -> Any:
    """Return a compiled function (row, work, i, stage): the force of the drive of channel i, and
    its mean over the step.
    """
    FACTORS = row_places(form).at["drives"]
    V, APPLIED, MEAN, MOTOR, KEPT = work_places(form).of("v", "applied", "mean", "motor", "drives")

    @own
    def move(row, work, i, stage):
        kept = kept_at(place(work) + 8 * KEPT, i)
        if stage == 0:
            factors = factors_at(place(row) + 8 * FACTORS, i)
            work[MEAN + i] = advanced(factors, kept, work[APPLIED + i], work[V + i])
        work[MOTOR + i] = work[MEAN + i]
        if stage == 0:
            work[MOTOR + i] -= kept.rise
        elif stage == 3:
            work[MOTOR + i] += kept.rise

    return move


def _rubbing(form: Form, compile_user: Compiler) -> Any:
    """Return a compiled function (row, work, i, stage, step, f, at_rest, g) -> friction on channel
    i; `f` is at its speed, `at_rest` is f at speed 0.
    """
    rub = own(lambda row, work, y, i: 0.0)
    for j, part in reversed(list(enumerate(form.frictions))):
        rub = _and_friction(form, j, part, rub, compile_user)
    H, LEVELS, DAMPING = row_places(form).of("step", "levels", "damping")
    X, V, APPLIED, MEAN, MOTOR, D, REACTION = work_places(form).of(
        "x", "v", "applied", "mean", "motor", "d", "reaction"
    )

    @own
    def friction(row, work, i, stage, step, f, at_rest, g):
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
        force = rub(row, work, y, i)
        work[REACTION + i] += force / (6.0 if stage % 3 == 0 else 3.0)
        return force - drag

    return friction


def _and_friction(form: Form, j: int, part: Part, others: Any, compile_user: Compiler) -> Any:
    """Return a compiled function (row, work, y, i) -> the force of friction j on channel i, and of
    the others.
    """
    force = compile_user(part.function)
    numbers = reader(part.names)
    size = 1 + len(part.names)
    memory = part.memory
    FIRST = row_places(form).at[f"friction {j}"]
    MEMORY = work_places(form).at[f"friction {j}"]

    @own
    def rub(row, work, y, i):
        total = others(row, work, y, i)
        at = FIRST + size * i
        if row[at] != 0.0:
            state = view(work, MEMORY + i * memory, memory)
            total += force(y, numbers(row, at + 1), state)[0]
        return total

    return rub


def _advancing(form: Form, disturb: Any, compile_user: Compiler) -> Any:
    """Return a compiled function (row, tables, work, k, within, step): a physics step of RK4."""
    n = form.n
    driven = form.driven
    jump = form.jump
    drive = form.drive
    rubs = bool(form.frictions)
    disturbed = bool(form.disturbances)
    # a signal without memory is the same at the second stage and at the third
    remembers = any(kind.memory for kind in form.disturbances)
    move = _driving(form)
    friction = _rubbing(form, compile_user)
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
            if disturbed and stage > 0 and (stage != 2 or remembers):
                fraction = LAST_STAGE if stage == 3 else 0.5
                disturb(row, tables, work, k * row[PERIOD] + (within + fraction) * h, -1)
            if drive:
                for i in range(driven):
                    move(row, work, i, stage)
            for i in range(n):
                f, g = nominal(xs, vs, i, p)
                actuator = i
                if i >= driven:  # it has none, and moves with that of this channel
                    actuator -= driven
                force = work[MOTOR + actuator] + work[D + actuator]
                if rubs:
                    at_rest = nominal(xs, view(work, REST, n), i, p)[0]
                    force += friction(row, work, i, stage, step, f, at_rest, g)
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


def _keeping(form: Form) -> Any:
    """Return a compiled function (work): keep the state of all channels at a sample, and begin the
    next mean of friction.
    """
    n = form.n
    rubs = bool(form.frictions)
    X, V, D, REACTION, SAMPLE_X, SAMPLE_V, SAMPLE_D = work_places(form).of(
        "x", "v", "d", "reaction", "sample_x", "sample_v", "sample_d"
    )

    @own
    def keep(work):
        for i in range(n):
            work[SAMPLE_X + i] = work[X + i]
            work[SAMPLE_V + i] = work[V + i]
            work[SAMPLE_D + i] = work[D + i]
            if rubs:
                work[REACTION + i] = 0.0

    return keep


def _recording(form: Form) -> Any:
    """Return a compiled function (row, work, scores, log, k): what is kept of sample k."""
    n = form.n
    columns = len(LOGGED)
    tally = tallying(form)
    LOGGING = row_places(form).at["logging"]
    X, V, D, U, S, R, LAST_U, LAST_R = work_places(form).of(
        "sample_x", "sample_v", "sample_d", "u", "s", "r", "last_u", "last_r"
    )

    @own
    def record(row, work, scores, log, k):
        tally(row, work, scores, k)
        for i in range(n):
            if row[LOGGING] != 0.0:
                at = (k * n + i) * columns
                log[at + 0] = work[X + i]
                log[at + 1] = work[V + i]
                log[at + 2] = work[U + i]
                log[at + 3] = work[S + i]
                log[at + 4] = work[D + i]
                log[at + 5] = work[R + i]
            work[LAST_U + i] = work[U + i]
            work[LAST_R + i] = work[R + i]

    return record
