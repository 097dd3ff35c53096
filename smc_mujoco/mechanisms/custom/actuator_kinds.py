"""What an actuator of a user's model is, in the words of MJCF, and why it is no plain motor or no
servo whose set-point a law may command.
"""

import math

import mujoco

from smc_mujoco.common.aliases import Pair
from smc_mujoco.mechanisms.hardware.position_servo import UNBOUNDED, PositionServo

EQUAL = 1e-9  # relative: gain and stiffness of a servo, which a file may write twice

# what a kind of dynamics or of gain is, and what its command would be
DYNAMICS = {
    "mjDYN_DCMOTOR": "is a <dcmotor>, whose command is no force",
    "mjDYN_PID": "is a <pid>, whose command is a position",
    "mjDYN_MUSCLE": "is a <muscle>, whose command is an activation",
}
GAINS = {
    "mjGAIN_DCMOTOR": "is a <dcmotor>, whose command is no force",
    "mjGAIN_PID": "is a <pid>, whose command is a position",
    "mjGAIN_MUSCLE": "is a <muscle>, whose command is an activation",
    "mjGAIN_AFFINE": "is a <damper>, or has a gain that depends on its length or speed",
    "mjGAIN_USER": "has a gain by a callback",
    "mjGAIN_SO3": "is a servo of an attitude",
}
BIASES = {
    "mjBIAS_USER": "has a bias by a callback",
    "mjBIAS_SO3": "is a servo of an attitude",
    "mjBIAS_MUSCLE": "is a <muscle>, whose command is an activation",
}


def no_motor(model: mujoco.MjModel, i: int) -> str:
    """Return why an actuator is not a motor; "" if it is one."""
    dynamics = mujoco.mjtDyn(model.actuator_dyntype[i]).name
    gain = mujoco.mjtGain(model.actuator_gaintype[i]).name
    bias = mujoco.mjtBias(model.actuator_biastype[i]).name
    kind = DYNAMICS.get(dynamics) or GAINS.get(gain) or BIASES.get(bias)
    kind = kind or _with_bias(model, i, dynamics)
    if not kind and dynamics != "mjDYN_NONE":
        kind = f"has dynamics (dyntype {dynamics.removeprefix('mjDYN_').lower()})"
    if delay := float(model.actuator_delay[i]):
        kind = f"{kind or 'is a motor'}, with a delay of {delay:g} s"
    return kind or _spoilt(model, i)


def no_servo(model: mujoco.MjModel, i: int) -> str:
    """Return why an actuator is not a `<position>` servo of a joint's own position; "" if it is
    one.
    """
    bias, stiffness, _ = model.actuator_biasprm[i, :3].tolist()
    gain = float(model.actuator_gainprm[i, 0])
    affine = model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_AFFINE
    if not no_motor(model, i) or not (affine and stiffness):
        return f"{no_motor(model, i) or 'is a motor'}, and has no set-point"
    if model.actuator_gaintype[i] != mujoco.mjtGain.mjGAIN_FIXED:
        return no_motor(model, i)
    if model.actuator_dyntype[i] != mujoco.mjtDyn.mjDYN_NONE:
        lag = mujoco.mjtDyn(model.actuator_dyntype[i]).name.removeprefix("mjDYN_").lower()
        return f"is a servo with dynamics (dyntype {lag})"
    if delay := float(model.actuator_delay[i]):
        return f"is a servo with a delay of {delay:g} s"
    if bias or not math.isclose(gain, -stiffness, rel_tol=EQUAL):
        return f"has the gain {gain:g} and the bias {bias:g} {stiffness:g}, and is no <position>"
    return _spoilt(model, i)


def servo_of(model: mujoco.MjModel, i: int, goal: float, step: float) -> PositionServo:
    """Return a `<position>` servo as it acts at its joint, with gear 1."""
    gear = float(model.actuator_gear[i, 0])
    _, stiffness, damping = model.actuator_biasprm[i, :3].tolist()
    ctrlrange = UNBOUNDED
    clamped = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL.value
    if model.actuator_ctrllimited[i] and clamped:
        ctrlrange = _times(model.actuator_ctrlrange[i].tolist(), 1.0 / gear)
    return PositionServo(
        kp=-gear * gear * stiffness,
        kv=-gear * gear * damping,
        forcerange=forcerange_of(model, i),
        ctrlrange=ctrlrange,
        goal=goal,
        step=step,
    )


def forcerange_of(model: mujoco.MjModel, i: int) -> Pair:
    """Return the least and the largest force of an actuator at its joint, N m or N, by its
    forcerange alone.
    """
    if not model.actuator_forcelimited[i]:
        return UNBOUNDED
    return _times(model.actuator_forcerange[i].tolist(), float(model.actuator_gear[i, 0]))


def _times(ends: list[float], factor: float) -> Pair:
    """Return the lowest and the highest of two ends times a factor."""
    low, high = sorted(factor * end for end in ends)
    return low, high


def _spoilt(model: mujoco.MjModel, i: int) -> str:
    """Return what else a force of gear and gain alone has not, or ""."""
    if (
        model.actuator_armature[i]
        or model.actuator_damping[i]
        or model.actuator_dampingpoly[i].any()
    ):
        return "has armature or damping"
    group = int(model.actuator_group[i])
    if 0 <= group <= 30 and model.opt.disableactuator >> group & 1:
        return "is in a group that actuatorgroupdisable turns off"
    if not model.actuator_gear[i, 0] * model.actuator_gainprm[i, 0]:
        return "has gear or gain 0"
    return ""


def _with_bias(model: mujoco.MjModel, i: int, dynamics: str) -> str:
    """Return what an actuator is whose force depends on its length or its speed, or ""."""
    if model.actuator_biastype[i] != mujoco.mjtBias.mjBIAS_AFFINE:
        return ""
    constant, length, speed = model.actuator_biasprm[i, :3].tolist()
    if dynamics == "mjDYN_INTEGRATOR" and length:
        return "is an <intvelocity>, a servo whose command is a speed"
    if length:
        return "is a <position> servo, whose command is a position"
    if speed:
        return "is a <velocity> servo, whose command is a speed"
    if dynamics == "mjDYN_FILTER":
        return "is a <cylinder>, whose force follows a pressure"
    return f"has a constant force of {constant:g} beside its command" if constant else ""
