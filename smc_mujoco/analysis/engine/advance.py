"""A physics step of the loop: the plant's equation with its drives and its friction, under RK4."""

# pyright: reportCallIssue=false
from typing import Any

from smc_mujoco.analysis.engine.calls import Compiler, acting, array_in, reader
from smc_mujoco.analysis.engine.form import SETTING, STATES, ChannelFunction, Form, layout
from smc_mujoco.common.jit import always, inlined, record_in
from smc_mujoco.mechanisms.hardware.drives import KEPT
from smc_mujoco.mechanisms.hardware.moments import CHANNEL_STATE, JointState

kept_in = record_in(KEPT)
state_in = record_in(CHANNEL_STATE)


def advancing(form: Form, between: Any, compile_user: Compiler) -> Any:
    """Return a function (view, k, within, step): a physics step of RK4."""
    n = form.n
    bodies = form.bodies
    driven = form.driven
    rubs = bool(form.frictions)
    # a signal without memory is the same at the third stage as at the second
    remembers = any(kind.memory for kind in form.disturbances)
    drive = driving(form)
    bend = _bending(form)
    friction = _rubbing(form, compile_user)
    nominal = compile_user(form.nominal.function)
    values = valuing(form)
    work_at = layout(form).work

    @inlined
    def advance(view, k, within, step):
        row, _, work = view
        h = row[SETTING.step]
        xs = array_in(work, work_at.x, n)
        vs = array_in(work, work_at.v, n)
        p = values(row, step)
        for i in range(bodies):
            work[work_at.x0 + i] = work[work_at.x + i]
            work[work_at.v0 + i] = work[work_at.v + i]
            work[work_at.sum_v + i] = 0.0
            work[work_at.sum_a + i] = 0.0
        for stage in range(4):
            if stage > 0 and (stage != 2 or remembers):
                between(view, k, within, stage)
            for i in range(driven):
                work[work_at.motor + i] = drive(view, i, stage)
            bend(view)
            for i in range(n):
                f, g = nominal(xs, vs, i, p)
                actuator = i
                if i >= driven:  # it has none, and moves with that of this channel
                    actuator -= driven
                force = work[work_at.motor + actuator] + work[work_at.d + actuator]
                if rubs:
                    at_rest = nominal(xs, array_in(work, work_at.rest, n), i, p)[0]
                    force += friction(view, i, stage, step, f, at_rest, g)
                work[work_at.a + i] = f + g * force
            weight = 1.0 if stage % 3 == 0 else 2.0
            reach = h if stage == 2 else 0.5 * h
            for i in range(bodies):
                speed = work[work_at.v + i]
                change = work[work_at.a + i]
                work[work_at.sum_v + i] += weight * speed
                work[work_at.sum_a + i] += weight * change
                work[work_at.x + i] = work[work_at.x0 + i] + reach * speed
                work[work_at.v + i] = work[work_at.v0 + i] + reach * change
        for i in range(bodies):
            work[work_at.x + i] = work[work_at.x0 + i] + h / 6.0 * work[work_at.sum_v + i]
            work[work_at.v + i] = work[work_at.v0 + i] + h / 6.0 * work[work_at.sum_a + i]

    return advance


def valuing(form: Form) -> Any:
    """Return a function (row, step) -> the plant's values in a physics step, by their names."""
    jump = form.jump
    values = reader(form.nominal.names)
    row_at = layout(form).row

    @inlined
    def valued(row, step):
        first = row_at.before
        if jump and row[SETTING.jump_step] >= 0.0 and step >= row[SETTING.jump_step]:
            first = row_at.after
        return values(row, first)

    return valued


def driving(form: Form) -> Any:
    """Return a function (view, i, stage) -> the force of the drive of channel i, whose mean over
    the step is the state's `middle`.
    """
    drive_at = layout(form).drive
    work_at = layout(form).work
    if drive_at is None:

        @inlined
        def command(view, i, stage):
            state = state_in(view.work, work_at.states + STATES * i)
            state.middle = state.delayed
            return state.delayed

        return command
    part, _, numbers, memory = drive_at
    advance = part.function
    factors = reader(part.names)
    size = len(part.names)
    width = part.memory

    @inlined
    def drive(view, i, stage):
        row, _, work = view
        filters = kept_in(work, memory + width * i)
        state = state_in(work, work_at.states + STATES * i)
        if stage == 0:
            of_drive = factors(row, numbers + size * i)
            state.middle = advance(of_drive, filters, state.delayed, work[work_at.v + i])
        force = state.middle
        if stage == 0:
            force -= filters.rise
        elif stage == 3:
            force += filters.rise
        return force

    return drive


def _bending(form: Form) -> Any:
    """Return a function (view): accelerate the rotors, and put what their springs pass on in the
    place of the drives' force.
    """
    if not form.rotors:
        return always(None)
    joints = form.rotors
    rotors = len(joints)
    first = form.n
    width = len(form.beside_names)
    spring_at = reader(form.beside_names)
    row_at, work_at = layout(form)[:2]

    @inlined
    def bend(view):
        row, _, work = view
        for k in range(rotors):
            spring = spring_at(row, row_at.beside + width * k)
            joint = joints[k]
            rotor = first + k
            speed = work[work_at.v + rotor]
            force = spring.stiffness * (work[work_at.x + rotor] - work[work_at.x + joint])
            force += spring.damping * (speed - work[work_at.v + joint])
            drive = work[work_at.motor + joint] - force - spring.rotor_damping * speed
            work[work_at.a + rotor] = drive / spring.rotor_inertia
            work[work_at.motor + joint] = force

    return bend


def _rubbing(form: Form, compile_user: Compiler) -> Any:
    """Return a function (view, i, stage, step, f, at_rest, g) -> friction on channel i; `f` is at
    its speed, `at_rest` is f at speed 0.
    """
    total = always(0.0)
    for part_at in reversed(layout(form).frictions):
        total = and_friction(part_at.part, total, _holding(form, acting(part_at, compile_user)))
    row_at, work_at = layout(form)[:2]

    @inlined
    def friction(view, i, stage, step, f, at_rest, g):
        row, _, work = view
        h = row[SETTING.step]
        state = state_in(work, work_at.states + STATES * i)
        drag = row[row_at.damping + i] * work[work_at.v + i]
        pushed = work[work_at.d + i]
        y = JointState(
            t=step * h,
            h=h,
            x=work[work_at.x + i],
            v=work[work_at.v + i],
            u=state.delayed,
            motor=work[work_at.motor + i],
            load=at_rest / g + pushed,
            stage=float(stage),
            others=f / g - drag + pushed,
            mean=state.middle,
            level=row[row_at.levels + i],
            mobility=g,
        )
        force = total(view, y, i)
        state.reaction += force / (6.0 if stage % 3 == 0 else 3.0)
        return force - drag

    return friction


def _holding(form: Form, of_stage: Any) -> Any:
    """Return a function (view, y, i) -> the force of a friction that is of a stage. It adds the
    time for which friction holds the joint to that of the channel.
    """
    work_at = layout(form).work

    @inlined
    def force(view, y, i):
        exerted, held = of_stage(view, y, i)
        state_in(view.work, work_at.states + STATES * i).held += held
        return exerted

    return force


def and_friction(part: ChannelFunction, inner: Any, force: Any) -> Any:
    """Return a function (view, y, i) -> the force of a friction on channel i, and of the others."""
    channels = part.channels

    @inlined
    def total(view, y, i):
        sum_of_forces = inner(view, y, i)
        if i in channels:
            sum_of_forces += force(view, y, i)
        return sum_of_forces

    return total
