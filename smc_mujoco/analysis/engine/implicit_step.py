"""A physics step of the loop by MuJoCo's implicitfast: for frictions whose force is held over it,
and for plays.
"""

# pyright: reportCallIssue=false
from collections.abc import Sequence
from typing import Any

from smc_mujoco.analysis.engine.advance import and_friction, driving, valuing
from smc_mujoco.analysis.engine.calls import Compiler, acting, array_in, reader
from smc_mujoco.analysis.engine.form import SETTING, STATES, Form, PartAt, layout
from smc_mujoco.analysis.engine.soft_constraints import Body, dry_friction, flank_force
from smc_mujoco.common.jit import always, inlined, record_in
from smc_mujoco.mechanisms.hardware.moments import CHANNEL_STATE, JointState

state_in = record_in(CHANNEL_STATE)


def advancing_implicitly(form: Form, compile_user: Compiler) -> Any:
    """Return a function (view, k, within, step): a physics step h of MuJoCo's implicitfast, for
    frictions whose force F is held over it, and for MuJoCo's constraints, whose force is c. Of
    joint i, which moves alone:

        (1 - h df_i/dv_i + h g_i b_i) a_i = f_i(x, v) + g_i (u_i + d_i + F_i + c_i)
        v_i += h a_i,   x_i += h v_i

    with b_i the damping of bristles. f is linear in v, so its slope is a difference from rest. A
    damper between two joints acts by the speeds of the step's start in the other joint's equation:
    MuJoCo keeps no derivative where the inertia matrix has no entry. With a rotor beside the joint,
    u_i is on the rotor, which has such an equation too.
    """
    n = form.n
    bodies = form.bodies
    values = valuing(form)
    accelerate = _accelerating(form, compile_user)
    work_at = layout(form).work

    @inlined
    def advance(view, k, within, step):
        row, _, work = view
        h = row[SETTING.step]
        p = values(row, step)
        for i in range(n):
            accelerate(view, i, step, p)
        for i in range(bodies):
            work[work_at.v + i] += h * work[work_at.a + i]
            work[work_at.x + i] += h * work[work_at.v + i]

    return advance


def _accelerating(form: Form, compile_user: Compiler) -> Any:
    """Return a function (view, i, step, p): accelerate joint i, and the rotor beside it, of a plant
    with the values p.
    """
    n = form.n
    driven = form.driven
    behind = []  # which rotor is beside a channel's joint; -1 without one
    for i in range(n):
        behind.append(form.rotors.index(i) if i in form.rotors else -1)
    rotor_of = tuple(behind)
    nominal = compile_user(form.nominal.function)
    drive = driving(form)
    rub = _rubbing(form, layout(form).frictions, compile_user)
    turn = _turning(form, compile_user)
    row_at, work_at = layout(form)[:2]

    @inlined
    def accelerate(view, i, step, p):
        row, _, work = view
        h = row[SETTING.step]
        xs = array_in(work, work_at.x, n)
        vs = array_in(work, work_at.v, n)
        unit = array_in(work, work_at.unit, n)
        f, g = nominal(xs, vs, i, p)
        at_rest = nominal(xs, array_in(work, work_at.rest, n), i, p)[0]
        unit[i] = 1.0
        slope = nominal(xs, unit, i, p)[0] - at_rest
        unit[i] = 0.0
        pushed = work[work_at.d + i]
        state = state_in(work, work_at.states + STATES * i)
        load = at_rest / g + pushed + work[work_at.dry + i]
        y = _state_of(step * h, h, xs[i], vs[i], state.delayed, state.middle, load)
        rubbed = rub(view, y, i)
        motor = drive(view, i, 0) if i < driven else 0.0
        force = rubbed + pushed if rotor_of[i] >= 0 else rubbed + motor + pushed
        damping = row[row_at.damping + i]
        a = f + g * (force - damping * vs[i])
        joint = Body(vs[i], a, g, row[row_at.levels + i])
        work[work_at.dry + i] = 0.0
        flank = 0.0
        if rotor_of[i] >= 0:
            flank = -turn(view, y, i, rotor_of[i], joint, motor)
        dry = dry_friction(joint, flank, h)
        work[work_at.dry + i] += dry
        state.reaction += rubbed + flank + dry
        a += g * (flank + dry)
        counted = damping + row[row_at.counted + i]
        work[work_at.a + i] = a / (1.0 + h * counted * g - h * slope)

    return accelerate


@inlined
def _state_of(t, h, x, v, u, motor, load):
    """Return what the force of a friction may depend on, of a joint or a rotor."""
    return JointState(t, h, x, v, u, motor, load, 0.0, 0.0, 0.0, 0.0, 0.0)


def _turning(form: Form, compile_user: Compiler) -> Any:
    """Return a function (view, y, i, k, joint, motor) -> the force of a play on rotor k, which is
    beside the joint of channel i and has the force of its motor. It accelerates the rotor.
    """
    if not form.rotors:
        return always(0.0)
    first = form.n
    width = len(form.beside_names)
    play_at = reader(form.beside_names)
    rub = _rubbing(form, layout(form).rotor_frictions, compile_user)
    row_at, work_at = layout(form)[:2]

    @inlined
    def turn(view, y, i, k, joint, motor):
        row, _, work = view
        play = play_at(row, row_at.beside + width * k)
        x = work[work_at.x + first + k]
        v = work[work_at.v + first + k]
        of_rotor = _state_of(y.t, y.h, x, v, y.u, y.motor, 0.0)
        force = motor + rub(view, of_rotor, i) + play.weight
        mobility = 1.0 / play.rotor_inertia
        damping = play.rotor_damping + row[row_at.damping + first + k]
        a = mobility * (force - damping * v)
        rotor = Body(v, a, mobility, row[row_at.levels + first + k])
        flank = flank_force(joint, rotor, x - y.x, 0.5 * play.gap, y.h)
        dry = dry_friction(rotor, flank, y.h)
        work[work_at.dry + i] += dry
        a += mobility * (flank + dry)
        counted = damping + row[row_at.counted + first + k]
        work[work_at.a + first + k] = a / (1.0 + y.h * counted * mobility)
        return flank

    return turn


def _rubbing(form: Form, frictions: Sequence[PartAt], compile_user: Compiler) -> Any:
    """Return a function (view, y, i) -> the force of frictions for the JointState of channel i."""
    total = always(0.0)
    for part_at in reversed(frictions):
        total = and_friction(part_at.part, total, acting(part_at, compile_user))
    return total
