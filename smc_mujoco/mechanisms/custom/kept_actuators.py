"""Actuators of a user's file that stay as they are: u is their own command.

A `<position>` or a `<pid>` is a PositionServo, a `<dcmotor>` on a voltage a DCMotor, the filter of
a motor a CommandFilter, and the delay of any of them a CommandDelay, each as it acts at its joint
with gear 1.
"""

import dataclasses
import math

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Pair
from smc_mujoco.mechanisms.custom.actuator_kinds import filters, gear_of, no_motor, spoilt
from smc_mujoco.mechanisms.hardware.command_delay import INTERPOLATIONS, ROUNDING, CommandDelay
from smc_mujoco.mechanisms.hardware.command_filter import CommandFilter
from smc_mujoco.mechanisms.hardware.drives import DCMotor
from smc_mujoco.mechanisms.hardware.part import Actuator
from smc_mujoco.mechanisms.hardware.position_servo import UNBOUNDED, PositionServo

EQUAL = 1e-9  # relative: numbers of a file that should agree
LEAST_TAU = 1e-15  # s, as in MuJoCo
AFFINE = mujoco.mjtBias.mjBIAS_AFFINE.value
FIXED = mujoco.mjtGain.mjGAIN_FIXED.value
EULER = mujoco.mjtDyn.mjDYN_FILTER.value
FILTERED = (mujoco.mjtDyn.mjDYN_FILTEREXACT.value, EULER)
INTEGRATED = mujoco.mjtDyn.mjDYN_INTEGRATOR.value
OF_DCMOTOR = mujoco.mjtGain.mjGAIN_DCMOTOR.value
OF_PID = mujoco.mjtGain.mjGAIN_PID.value
POSITION = mujoco.mjtCtrlInput.mjINPUT_POS.value
VELOCITY = mujoco.mjtCtrlInput.mjINPUT_VEL.value
VOLTAGE = mujoco.mjtCtrlInput.mjINPUT_VOLTAGE.value


def not_kept(model: mujoco.MjModel, i: int) -> str:
    """Return why an actuator cannot stay as it is; "" if it can."""
    if model.actuator_gaintype[i] == OF_DCMOTOR:
        return _no_plain_dcmotor(model, i)
    if model.actuator_gaintype[i] == OF_PID:
        return _no_plain_pid(model, i)
    bias, stiffness, _ = model.actuator_biasprm[i, :3].tolist()
    if model.actuator_gaintype[i] != FIXED or model.actuator_biastype[i] != AFFINE or not stiffness:
        return no_motor(model, i) or "is a motor, whose command is a force"
    if why := _with_dynamics(model, i):
        return why
    gain = float(model.actuator_gainprm[i, 0])
    if bias or not math.isclose(gain, -stiffness, rel_tol=EQUAL):
        return (
            f"has the gain {gain:g} and the bias {bias:g} {stiffness:g}, so it is not a <position>"
        )
    return spoilt(model, i)


def _with_dynamics(model: mujoco.MjModel, i: int) -> str:
    """Return which dynamics a servo has beside a timeconst, or ""."""
    if model.actuator_dyntype[i] == INTEGRATED:
        return no_motor(model, i)  # it takes a speed
    if filters(model, i):
        return ""
    if model.actuator_dyntype[i] in FILTERED:
        return "is a servo with a timeconst and with actlimited or actearly"
    if model.actuator_dyntype[i] != mujoco.mjtDyn.mjDYN_NONE:
        kind = mujoco.mjtDyn(model.actuator_dyntype[i]).name
        return f"is a servo with dynamics (dyntype {kind.removeprefix('mjDYN_').lower()})"
    return ""


def _no_plain_pid(model: mujoco.MjModel, i: int) -> str:
    """Return why the set-point of a `<pid>` cannot be all of its command; "" if it can."""
    inputs = int(model.actuator_ctrlspec[i])
    if not inputs & POSITION or not model.actuator_biasprm[i, 1]:
        return "is a <pid> without a position as its command, or with kp 0"
    if inputs & VELOCITY:
        low, high = _range_of(model, int(model.actuator_ctrladr[i]) + 1)
        if not low <= 0.0 <= high:
            return f"is a <pid> whose velrange {low:g} to {high:g} leaves out 0"
    return spoilt(model, i)


def _no_plain_dcmotor(model: mujoco.MjModel, i: int) -> str:
    """Return what a `<dcmotor>` has besides resistance, torque constant, inductance and cogging;
    "" if nothing.
    """
    winding = model.actuator_gainprm[i]
    state = model.actuator_dynprm[i]
    torque = model.actuator_biasprm[i]
    # the first number of MuJoCo's state is the time constant of the winding
    if winding[2:].any() or state[1:].any() or torque[2:].any():
        return "is a <dcmotor> with a controller, heat, friction, a slew rate or a cogging phase"
    if model.actuator_ctrlspec[i] != VOLTAGE:
        return "is a <dcmotor> whose command is not a voltage"
    if state[0] and model.actuator_delay[i]:
        return "is a <dcmotor> with an inductance and a delay"
    if gear_of(model, i) < 0.0:
        return f"is a <dcmotor> of gear {gear_of(model, i):g}, which is negative"
    for what, (low, high) in (
        ("ctrlrange", ctrlrange_of(model, i)),
        ("forcerange", forcerange_of(model, i)),
    ):
        if not math.isclose(-low, high, rel_tol=EQUAL):
            return f"is a <dcmotor> whose {what} {low:g} to {high:g} is not symmetric"
    return spoilt(model, i)


def delay_of(model: mujoco.MjModel, i: int) -> tuple[CommandDelay, ...]:
    """Return the delay of an actuator as MuJoCo has it at the file's timestep; () without one.

    A held command is late by whole steps, and by no more of them than the buffer has samples.
    """
    delay = float(model.actuator_delay[i])
    if not delay:
        return ()
    samples, order = model.actuator_history[i].tolist()
    step = float(model.opt.timestep)
    if order == 0:
        delay = step * math.ceil(delay / step - ROUNDING)
    return (CommandDelay(min(delay, samples * step), INTERPOLATIONS[order]),)


def kept(model: mujoco.MjModel, i: int, goal: float, step: float) -> Actuator:
    """Return an actuator that stays as it is. `goal` and `step` are those of a set-point."""
    gear = gear_of(model, i)
    if model.actuator_gaintype[i] == OF_DCMOTOR:
        return _dcmotor(model, i, gear)
    _, stiffness, damping = model.actuator_biasprm[i, :3].tolist()
    low, high = forcerange_of(model, i)
    joint = model.actuator_trnid[i, 0]
    if model.jnt_actfrclimited[joint]:
        lowest, highest = model.jnt_actfrcrange[joint].tolist()
        low, high = max(low, lowest), min(high, highest)
    servo = PositionServo(
        kp=-gear * gear * stiffness,
        kv=-gear * gear * damping,
        forcerange=(low, high),
        ctrlrange=_times(ctrlrange_of(model, i), 1.0 / gear),
        goal=goal,
        step=step,
    )
    if model.actuator_gaintype[i] == OF_PID:
        largest, rate = np.abs(model.actuator_dynprm[i, :2] / gear).tolist()
        ki = gear * gear * float(model.actuator_gainprm[i, 0])
        return dataclasses.replace(servo, ki=ki, imax=largest if ki else 0.0, slewmax=rate)
    timeconst = float(model.actuator_dynprm[i, 0])
    if filters(model, i) and timeconst:
        return dataclasses.replace(servo, timeconst=timeconst, euler=_by_euler(model, i))
    return servo


def filter_of(model: mujoco.MjModel, i: int) -> tuple[CommandFilter, ...]:
    """Return the filter of a motor, which MuJoCo lets follow faster than a step at once; () without
    one.
    """
    if not filters(model, i):
        return ()
    tau = max(float(model.actuator_dynprm[i, 0]), LEAST_TAU)
    return (CommandFilter(tau, _by_euler(model, i)),)


def _by_euler(model: mujoco.MjModel, i: int) -> bool:
    """Return whether MuJoCo steps the filter of an actuator by Euler's rule."""
    return bool(model.actuator_dyntype[i] == EULER)


def _dcmotor(model: mujoco.MjModel, i: int, gear: float) -> DCMotor:
    resistance, constant = model.actuator_gainprm[i, :2].tolist()
    cogging, periods = model.actuator_biasprm[i, :2].tolist()
    return DCMotor(
        resistance=resistance,
        torque_constant=constant,
        inductance=float(model.actuator_dynprm[i, 0]) * resistance,
        gear=gear,
        rotor_inertia=0.0,
        cogging=cogging,
        poles=periods,
        voltage=ctrlrange_of(model, i)[1],
        current=forcerange_of(model, i)[1] / (gear * constant),
        command="voltage",
    )


def ctrlrange_of(model: mujoco.MjModel, i: int) -> Pair:
    """Return the least and the largest command that an actuator takes, in its own unit; of a
    `<pid>` the set-point.
    """
    return _range_of(model, int(model.actuator_ctrladr[i]))


def _range_of(model: mujoco.MjModel, ctrl: int) -> Pair:
    """Return the range of a number of ctrl."""
    clamped = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL.value
    if not (model.actuator_ctrllimited[ctrl] and clamped):
        return UNBOUNDED
    low, high = model.actuator_ctrlrange[ctrl].tolist()
    return low, high


def of_command(model: mujoco.MjModel, i: int) -> Pair:
    """Return the least and the largest force of a motor before its gear."""
    gain = model.actuator_gainprm[i, 0]
    low, high = sorted(float(gain * end) for end in ctrlrange_of(model, i))
    if model.actuator_forcelimited[i]:
        lowest, highest = model.actuator_forcerange[i]
        low, high = (float(min(max(end, lowest), highest)) for end in (low, high))
    return low, high


def of_motor(model: mujoco.MjModel, i: int) -> Pair:
    """Return the least and the largest force of a motor at its joint or its tendon, N m or N."""
    return _times(of_command(model, i), gear_of(model, i))


def forcerange_of(model: mujoco.MjModel, i: int) -> Pair:
    """Return the least and the largest force of an actuator at its joint, N m or N, by its
    forcerange alone.
    """
    if not model.actuator_forcelimited[i]:
        return UNBOUNDED
    low, high = model.actuator_forcerange[i].tolist()
    return _times((low, high), gear_of(model, i))


def _times(ends: Pair, factor: float) -> Pair:
    """Return the lowest and the highest of two ends times a factor."""
    low, high = sorted(factor * end for end in ends)
    return low, high
