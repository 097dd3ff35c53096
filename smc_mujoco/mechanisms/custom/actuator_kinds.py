"""What an actuator of a user's model is, in the words of MJCF, and why it is no plain motor."""

import mujoco

# what a kind of dynamics or of gain is, and what its command would be
DYNAMICS = {
    "mjDYN_DCMOTOR": "is a <dcmotor>, whose command is no force",
    "mjDYN_PID": "is a <pid>, whose command is a position",
    "mjDYN_MUSCLE": "is a <muscle>, whose command is an activation",
}
FILTERS = ("mjDYN_FILTER", "mjDYN_FILTEREXACT")
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
    if not kind and dynamics != "mjDYN_NONE" and not filters(model, i):
        kind = f"has dynamics (dyntype {dynamics.removeprefix('mjDYN_').lower()})"
        if dynamics in FILTERS:
            kind += " with actlimited or actearly"
    if not kind and not model.actuator_gainprm[i, 0]:
        kind = "has gain 0"
    return kind or spoilt(model, i)


def filters(model: mujoco.MjModel, i: int) -> bool:
    """Return whether MuJoCo filters the command of an actuator, and does no more to it."""
    filtered = mujoco.mjtDyn(model.actuator_dyntype[i]).name in FILTERS
    return filtered and not (model.actuator_actlimited[i] or model.actuator_actearly[i])


def spoilt(model: mujoco.MjModel, i: int) -> str:
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
    return "" if gear_of(model, i) else "has gear 0"


def gear_of(model: mujoco.MjModel, i: int) -> float:
    """Return the gear of an actuator on a hinge or a slide."""
    return float(model.actuator_gear[model.actuator_outadr[i], 0])


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
