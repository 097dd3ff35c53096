"""Actuators of a user's file that stay as they are: u is their own command.

A `<position>` is a PositionServo, and a `<dcmotor>` on a voltage a DCMotor, each as it acts at its
joint with gear 1.
"""

import math

import mujoco

from smc_mujoco.common.aliases import Pair
from smc_mujoco.mechanisms.custom.actuator_kinds import no_motor, spoilt
from smc_mujoco.mechanisms.hardware.drives import DCMotor
from smc_mujoco.mechanisms.hardware.part import Actuator
from smc_mujoco.mechanisms.hardware.position_servo import UNBOUNDED, PositionServo

EQUAL = 1e-9  # relative: numbers of a file that should agree
AFFINE = mujoco.mjtBias.mjBIAS_AFFINE.value
FIXED = mujoco.mjtGain.mjGAIN_FIXED.value
FILTERED = mujoco.mjtDyn.mjDYN_FILTEREXACT.value
INTEGRATED = mujoco.mjtDyn.mjDYN_INTEGRATOR.value
OF_DCMOTOR = mujoco.mjtGain.mjGAIN_DCMOTOR.value
VOLTAGE = mujoco.mjtCtrlInput.mjINPUT_VOLTAGE.value


def not_kept(model: mujoco.MjModel, i: int) -> str:
    """Return why an actuator cannot stay as it is; "" if it can."""
    if delay := float(model.actuator_delay[i]):
        return f"has a delay of {delay:g} s, which input_delay has instead"
    if model.actuator_gaintype[i] == OF_DCMOTOR:
        return _no_plain_dcmotor(model, i)
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
    if model.actuator_dyntype[i] == FILTERED:
        if model.actuator_actlimited[i] or model.actuator_actearly[i]:
            return "is a servo with a timeconst and with actlimited or actearly"
    elif model.actuator_dyntype[i] != mujoco.mjtDyn.mjDYN_NONE:
        kind = mujoco.mjtDyn(model.actuator_dyntype[i]).name
        return f"is a servo with dynamics (dyntype {kind.removeprefix('mjDYN_').lower()})"
    return ""


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
    if model.actuator_gear[i, 0] < 0.0:
        return f"is a <dcmotor> of gear {model.actuator_gear[i, 0]:g}, which is negative"
    for what, (low, high) in (
        ("ctrlrange", ctrlrange_of(model, i)),
        ("forcerange", forcerange_of(model, i)),
    ):
        if not math.isclose(-low, high, rel_tol=EQUAL):
            return f"is a <dcmotor> whose {what} {low:g} to {high:g} is not symmetric"
    return spoilt(model, i)


def kept(model: mujoco.MjModel, i: int, goal: float, step: float) -> Actuator:
    """Return an actuator that stays as it is. `goal` and `step` are those of a set-point."""
    gear = float(model.actuator_gear[i, 0])
    if model.actuator_gaintype[i] == OF_DCMOTOR:
        return _dcmotor(model, i, gear)
    _, stiffness, damping = model.actuator_biasprm[i, :3].tolist()
    filtered = model.actuator_dyntype[i] == FILTERED
    return PositionServo(
        kp=-gear * gear * stiffness,
        kv=-gear * gear * damping,
        forcerange=forcerange_of(model, i),
        ctrlrange=_times(ctrlrange_of(model, i), 1.0 / gear),
        goal=goal,
        step=step,
        timeconst=float(model.actuator_dynprm[i, 0]) if filtered else 0.0,
    )


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
    """Return the least and the largest command that an actuator takes, in its own unit."""
    clamped = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL.value
    if not (model.actuator_ctrllimited[i] and clamped):
        return UNBOUNDED
    low, high = model.actuator_ctrlrange[i].tolist()
    return low, high


def forcerange_of(model: mujoco.MjModel, i: int) -> Pair:
    """Return the least and the largest force of an actuator at its joint, N m or N, by its
    forcerange alone.
    """
    if not model.actuator_forcelimited[i]:
        return UNBOUNDED
    low, high = model.actuator_forcerange[i].tolist()
    gear = float(model.actuator_gear[i, 0])
    return _times((low, high), gear)


def _times(ends: Pair, factor: float) -> Pair:
    """Return the lowest and the highest of two ends times a factor."""
    low, high = sorted(factor * end for end in ends)
    return low, high
