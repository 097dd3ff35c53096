"""A sample of a form's run, written out as one function that numba compiles for every target.

The order of a step is that of `simulation.step`, as in the control callback. Here are its moments:
a run reads its numbers from its row, and keeps its state in `work`, see `form.layout`.
"""

# pyright: reportCallIssue=false
import math
from typing import Any, NamedTuple

from smc_mujoco.analysis.engine.advance import advancing
from smc_mujoco.analysis.engine.calls import (
    Compiler,
    acting,
    added,
    array_in,
    by_channel,
    calling,
    channel_law,
    estimating,
    reader,
    settings_in,
    signal,
)
from smc_mujoco.analysis.engine.form import (
    FAILED_STEP,
    FAILURE,
    LOGGED,
    SETTING,
    STATES,
    UNDER_WAY,
    WIDTH,
    Form,
    PartAt,
    layout,
    measured_places,
)
from smc_mujoco.analysis.engine.implicit_step import advancing_implicitly
from smc_mujoco.analysis.engine.scores import COLUMN, log_in, tallying
from smc_mujoco.common.aliases import Fields
from smc_mujoco.common.jit import address_of, always, beyond, inlined, record_in
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.joint_law import begin_measurement, put_channel
from smc_mujoco.mechanisms.hardware.feedforward import AT_REST, ON
from smc_mujoco.mechanisms.hardware.moments import CHANNEL_STATE, JointState, Sight
from smc_mujoco.simulation import philox
from smc_mujoco.simulation.controller import MAX_STATE
from smc_mujoco.simulation.state import FINE
from smc_mujoco.simulation.step import Asked, Moments, asking, lateness, order, reading_at

state_in = record_in(CHANNEL_STATE)
LOGGED_COLUMNS = tuple(COLUMN[name] for name in LOGGED)


class PlainDrive(NamedTuple):
    """A drive whose command is its force, as a DRIVE."""

    limit: float
    scale: float = 1.0
    gain: float = 1.0
    drag: float = 0.0
    accelerates: float = 0.0


def simulation(form: Form, compile_user: Compiler, noise: Any) -> Any:
    """Return two compiled functions: start(view, scores) begins a run of the form and returns its
    number of periods K, take(view, scores, log, k) takes its sample k, from 0 to K, and the steps
    of that period.

    The run has ended once its failure among the scores is not UNDER_WAY. `log`, a pointer, has the
    numbers `form.LOGGED` of every channel at every sample, if the row says `logging`. `noise` is a
    moment, see `noise`.
    """
    begin, between = order(moments(form, compile_user, noise))
    if form.implicit:
        advance = advancing_implicitly(form, compile_user)
    else:
        advance = advancing(form, between, compile_user)
    remember = remembering(form)
    joints = form.rotors
    rotors = len(joints)
    record = recording(form)
    n = form.n
    row_at, work_at = layout(form)[:2]
    size = layout(form).work_size

    @inlined
    def start(view, scores):
        row, _, work = view
        for j in range(size):
            work[j] = 0.0
        for i in range(n):
            work[work_at.x + i] = row[row_at.x0 + i]
            work[work_at.v + i] = row[row_at.v0 + i]
        if rotors:
            for k in range(rotors):
                work[work_at.x + n + k] = row[row_at.x0 + joints[k]]
                work[work_at.v + n + k] = row[row_at.v0 + joints[k]]
        scores[FAILURE] = UNDER_WAY
        return int(row[SETTING.samples])

    @inlined
    def take(view, scores, log, k):
        samples = int(view.row[SETTING.samples])
        steps = int(view.row[SETTING.steps])
        last = samples * steps
        for within in range(steps):
            step = k * steps + within
            scores[FAILED_STEP] = step
            remember(view, step)
            failure = begin(view, k, within, step)
            if failure != FINE:
                scores[FAILURE] = failure
                return
            if step == last:
                break
            advance(view, k, within, step)
        record(view, scores, log, k)  # at the end of its period: the sample may come late
        if k == samples:
            scores[FAILURE] = FINE

    return start, take


def moments(form: Form, compile_user: Compiler, noise: Any) -> Moments:
    """Return what a run of the form does at each moment."""
    of_form = Moments(
        **_records(form),
        **_sensing(form, compile_user),
        **_forces(form, compile_user),
        feedforward=_feeding(form, compile_user),
        compensate=_compensating(form, compile_user),
        ask=None,
        noise=noise,
        noisy=form.noise,
        clock=form.clock,
        delayed=form.delay,
        fails=form.fails,
        sums=form.rubs,
    )
    if form.joint:
        return of_form._replace(ask=_asking_all(form, compile_user))
    return of_form._replace(ask=asking(of_form, _asked(form, compile_user)))


def _records(form: Form) -> Fields:
    """Return the moments that say where a run's records and arrays are."""
    n = form.n
    slots = form.slots
    row_at, work_at = layout(form)[:2]

    @inlined
    def late(view, k):
        settings = settings_in(view.row, 0)
        return int(lateness(settings, k, int(settings.samples)))

    @inlined
    def seen(view):
        work = view.work
        return (
            beyond(work, work_at.seen_x),
            beyond(work, work_at.seen_v),
            beyond(work, work_at.seen_a),
        )

    limits = row_at.limits
    return {
        "n": always(n),
        "driven": always(form.driven),
        "settings": inlined(lambda view: settings_in(view.row, 0)),
        "late": late if form.clock else always(0),
        "now": inlined(lambda view, k, i: log_in(view.work, work_at.now + WIDTH * i)),
        "before": inlined(lambda view, k, i: log_in(view.work, work_at.before + WIDTH * i)),
        "state": inlined(lambda view, i: state_in(view.work, work_at.states + STATES * i)),
        "drive": inlined(lambda view, i: PlainDrive(view.row[limits + i], 1.0, 1.0, 0.0, 0.0)),
        "ring": inlined(lambda view, k: beyond(view.work, work_at.ring + k % slots * n)),
        "seen": seen,
    }


def remembering(form: Form) -> Any:
    """Return a function (view, step): keep the state for a sensor that is late."""
    if not form.past:
        return always(None)
    bodies = form.bodies
    past = form.past
    work_at = layout(form).work

    @inlined
    def remember(view, step):
        first = work_at.past + step % past * 2 * bodies
        for i in range(bodies):
            view.work[first + i] = view.work[work_at.x + i]
            view.work[first + bodies + i] = view.work[work_at.v + i]

    return remember


def _siding(form: Form) -> Any:
    """Return a function (i) -> the body whose position the sensor of channel i gives."""
    if not form.motor_side:
        return inlined(lambda i: i)
    bodies = list(range(form.n))
    for i in form.motor_side:
        bodies[i] = form.n + form.rotors.index(i)
    read = tuple(bodies)
    return inlined(lambda i: read[i])


def _late_sensing(form: Form) -> Fields:
    """Return the moments of a sensor that reads at its own times, or gives the past."""
    bodies = form.bodies
    past = form.past
    side = _siding(form)
    row_at, work_at = layout(form)[:2]

    @inlined
    def reading(view, i, k, t):
        return reading_at(k, t, view.row[row_at.periods + i], view.row[row_at.delays + i])

    @inlined
    def sense(view, i, t):
        h = view.row[SETTING.step]
        time = t - view.row[row_at.delays + i]
        period = view.row[row_at.periods + i]
        if period != 0.0:
            time = reading(view, i, 0, t) * period
        # on CUDA, floor gives a float
        step = max(0, int(math.floor(time / h + 0.5)))  # noqa: RUF046
        place = work_at.past + step % past * 2 * bodies + side(i)
        return view.work[place], view.work[place + bodies]

    return {"reading": reading, "sense": sense}


def _sensing(form: Form, compile_user: Compiler) -> Fields:
    """Return the moments of sensors, their errors, and the estimator."""
    places = layout(form)
    row_at, work_at = places[:2]
    estimator = estimating(places.estimator, compile_user)
    side = _siding(form)

    @inlined
    def estimate(view, i, x, v):
        v, a = estimator(view, Reading(view.row[SETTING.period], x, v), i)
        return False, v, a

    @inlined
    def sense(view, i, t):
        body = side(i)
        return view.work[work_at.x + body], view.work[work_at.v + body]

    fields: Fields = {
        "errors": always((-0.0, -0.0)),  # which change no bit
        "sense": sense,
        "estimate": estimate,
    }
    if form.past:
        fields |= _late_sensing(form)
    if any(form.errors):
        error_of_x, error_of_v = places.errors
        of_x = signal(error_of_x, compile_user)
        of_v = signal(error_of_v, compile_user)
        fields["errors"] = inlined(lambda view, t: (of_x(view, t, 0)[0], of_v(view, t, 0)[0]))
    if places.sensor:
        sensor = acting(places.sensor, compile_user)
        drops = form.drops

        @inlined
        def read(view, i, j, x, v):
            chance = 1.0
            if drops:
                chance = philox.uniform(view.row[SETTING.seed], i, philox.DROPOUT, j)
            sight = Sight(x, v, float(j), view.row[row_at.hinges + i], chance)
            x, v = sensor(view, sight, i)
            return False, x, v

        fields["read"] = read
    return fields


def _forces(form: Form, compile_user: Compiler) -> Fields:
    """Return the moments of a physics step: the state, and the forces that act on it."""
    bodies = form.bodies
    work_at = layout(form).work

    @inlined
    def diverged(view):
        work = view.work
        for i in range(bodies):
            if not (abs(work[work_at.x + i]) < MAX_STATE and abs(work[work_at.v + i]) < MAX_STATE):
                return True
        return False

    @inlined
    def applied(view, i):
        return state_in(view.work, work_at.states + STATES * i).delayed

    return {
        "diverged": diverged,
        "disturb": _disturbing(form, compile_user),
        "truth": inlined(lambda view, i: (view.work[work_at.x + i], view.work[work_at.v + i])),
        "applied": applied,
        "disturbance": inlined(lambda view, i: view.work[work_at.d + i]),
    }


def _disturbing(form: Form, compile_user: Compiler) -> Any:
    """Return a function (view, t, k) -> FINE: write the sum of the disturbances on each channel at
    time t, s.

    k is the sample at its first stage, and -1 at all others.
    """
    if not form.disturbances:
        return always(FINE)
    driven = form.driven
    work_at = layout(form).work

    @inlined
    def total(view, t, k, seen):
        for i in range(driven):
            view.work[work_at.d + i] = 0.0

    for signal_at in layout(form).disturbances:
        total = added(signal_at, total, work_at.d, driven, compile_user)

    @inlined
    def disturb(view, t, k):
        work = view.work
        now = log_in(work, work_at.now)
        rate = 0.0
        if k > 0:
            rate = (now.r - log_in(work, work_at.before).r) / view.row[SETTING.period]
        total(view, t, k, (work[work_at.x] - now.r, work[work_at.v] - rate, now.s))
        return FINE

    return disturb


def _feeding(form: Form, compile_user: Compiler) -> Any:
    """Return a function (view, t) -> whether it raised, and the feedforward."""
    if form.feedforward is None:
        return always((False, 0.0))
    feed = signal(layout(form).feedforward, compile_user)
    return inlined(lambda view, t: (False, feed(view, t, 0)[0]))


def _compensating(form: Form, compile_user: Compiler) -> Any:
    """Return a function (view, k, t, i, u) -> whether it raised, and what compensates the friction
    of channel i beside u.
    """
    if not form.compensated:
        return always((False, 0.0))
    on_speed = form.compensates_on == ON.index("speed")
    on_error = form.compensates_on == ON.index("error")
    refer = _referring(form, compile_user)
    row_at, work_at = layout(form)[:2]
    steady = always(0.0)
    for part_at in layout(form).compensated:
        steady = _with_steady(form, part_at, steady, compile_user)

    @inlined
    def compensate(view, k, t, i, u):
        r = x = view.work[work_at.seen_x + i]
        v = view.work[work_at.seen_v + i]
        if not on_speed:
            r, v, _ = refer(view, t, i)
        size = v
        if on_error:
            size = r - x
            v = math.copysign(AT_REST, size)
        share = view.row[row_at.compensation]
        eps = view.row[row_at.compensation + 1]
        y = JointState(t, 0.0, x, v, u, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        return False, share * math.tanh(abs(size) / eps) * steady(view, i, y)

    return compensate


def _with_steady(form: Form, part_at: PartAt, inner: Any, compile_user: Compiler) -> Any:
    """Return a function (view, i, y) -> the force that a joint needs against a friction and
    others at a steady speed.
    """
    force = acting(part_at, compile_user)
    acts = tuple(i in part_at.part.channels for i in range(form.n))

    @inlined
    def total(view, i, y):
        needed = inner(view, i, y)
        if acts[i]:
            needed += force(view, y, i)
        return needed

    return total


def _referring(form: Form, compile_user: Compiler) -> Any:
    """Return a function (view, t, i) -> reference of channel i with its rate and acceleration."""
    return by_channel([signal(signal_at, compile_user) for signal_at in layout(form).references])


def _asked(form: Form, compile_user: Compiler) -> Asked:
    """Return what asks the law of one channel."""
    places = layout(form)
    refer = _referring(form, compile_user)
    model = _modelling(form, compile_user)
    laws = by_channel([channel_law(form, law_at, compile_user) for law_at in places.laws])

    @inlined
    def motion(view, i, k, t):
        r, dr, ddr = refer(view, t, i)
        return False, r, dr, ddr

    @inlined
    def nominal(view, i):
        f, g = model(view, i)
        return False, f, g

    moments_of_law = Asked(
        partners=always(form.n > form.driven),
        knows=always(form.true_model),
        refer=motion,
        nominal=nominal,
        law=_answering(laws),
    )
    if places.surface is None:
        return moments_of_law
    slide = _answering(acting(places.surface, compile_user))
    return moments_of_law._replace(slides=always(True), slide=slide)


def _answering(function: Any) -> Any:
    """Return a function (view, y, i) -> two numbers as a moment, which never raises."""

    @inlined
    def answer(view, i, y):
        first, second = function(view, y, i)
        return False, first, second

    return answer


def _modelling(form: Form, compile_user: Compiler) -> Any:
    """Return a function (view, i) -> f and g of channel i by the nominal model, as measured."""
    n = form.n
    function = compile_user(form.nominal.function)
    values = reader(form.nominal.names)
    row_at, work_at = layout(form)[:2]

    @inlined
    def nominal(view, i):
        xs = array_in(view.work, work_at.seen_x, n)
        vs = array_in(view.work, work_at.seen_v, n)
        return function(xs, vs, i, values(view.row, row_at.nominal))

    return nominal


def _asking_all(form: Form, compile_user: Compiler) -> Any:
    """Return a function (view, k, t, i) -> failure, u and s of channel i, of a law of many joints,
    which is asked once, for all channels.
    """
    n = form.n
    work_at = layout(form).work
    measure = _measuring_all(form, compile_user)
    ask = calling(form, layout(form).laws[0])

    @inlined
    def answer(view, k, t, i):
        if i == 0:
            measure(view, t)
            ask(view, 0)
        work = view.work
        return FINE, work[work_at.commanded + i], work[work_at.commanded + n + i]

    return answer


def _measuring_all(form: Form, compile_user: Compiler) -> Any:
    """Return a function (view, t): write what a law of many joints reads."""
    n = form.n
    driven = form.driven
    size = measured_places(form)
    refer = _referring(form, compile_user)
    nominal = compile_user(form.nominal.function)
    values = reader(form.nominal.names)
    row_at, work_at = layout(form)[:2]

    @inlined
    def measure(view, t):
        row, _, work = view
        settings = settings_in(row, 0)
        for i in range(size):
            work[work_at.measured + i] = 0.0
        address = address_of(work) + 8 * work_at.measured
        y = begin_measurement(address, t, settings.period, settings.uses_model, 0, n, driven)
        nominal_numbers = values(row, row_at.nominal)
        xs = array_in(work, work_at.seen_x, n)
        vs = array_in(work, work_at.seen_v, n)
        for i in range(n):
            r, dr, ddr = refer(view, t, i)
            log_in(work, work_at.now + WIDTH * i).r = r
            a = work[work_at.seen_a + i]
            put_channel(y, i, xs[i], vs[i], a, row[row_at.limits + i], r, dr, ddr)
            y.M[i, i] = 1.0
            if settings.uses_model != 0.0:  # M is diagonal
                f, g = nominal(xs, vs, i, nominal_numbers)
                at_rest = nominal(xs, array_in(work, work_at.rest, n), i, nominal_numbers)[0]
                y.M[i, i] = 1.0 / g
                y.h[i] = -f / g
                y.g[i] = -at_rest / g

    return measure


def recording(form: Form) -> Any:
    """Return a function (view, scores, log, k): what is kept of sample k."""
    n = form.n
    columns = len(LOGGED)
    tally = tallying(form)
    work_at = layout(form).work

    @inlined
    def record(view, scores, log, k):
        row, _, work = view
        tally(row, work, scores, k, k == int(row[SETTING.samples]))
        for i in range(n):
            sample = work_at.now + WIDTH * i
            if row[SETTING.logging] != 0.0:
                for j in range(columns):
                    log[(k * n + i) * columns + j] = work[sample + LOGGED_COLUMNS[j]]
            now = log_in(work, sample)
            before = log_in(work, work_at.before + WIDTH * i)
            before.u, before.s, before.r, before.held = now.u, now.s, now.r, now.held

    return record
