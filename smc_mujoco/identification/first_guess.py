"""Where a search for quantities of a user's machine starts: least squares of forces, without a
simulation.

The recorded forces, less those that the measured motion takes by MuJoCo's inverse dynamics, are
linear in damping, dry friction, armature, stiffness, offset, gain and masses. Both sides go through
the same filter, see inverse_dynamics.py. A delay is found by trying many. Quantities in which
forces are not linear start at their own values.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from smc_mujoco.common.aliases import Array, Data, Numbers
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.identification import inverse_dynamics
from smc_mujoco.identification.inverse_dynamics import (
    CUBIC_DEGREE,
    CUTOFF,
    Filter,
    cubic_samples,
)
from smc_mujoco.identification.least_squares import least_squares
from smc_mujoco.identification.log_rig import LogRig, moves
from smc_mujoco.identification.paths import DELAY, MAX_DELAY, slope, steady_force
from smc_mujoco.identification.records import Columns, Record, stacked, step_of
from smc_mujoco.mechanisms.custom.model_numbers import KINDS, PAYLOAD, SLIDING
from smc_mujoco.mechanisms.hardware.part import Friction
from smc_mujoco.mechanisms.layout import channel_names, driven_names
from smc_mujoco.mechanisms.plant import degrees_hint

# least squares, one after the other, in which parameters of a plant of the library may be no
# linear factors of forces; chosen
PASSES = 6
WEIGHINGS = 4  # least squares with the noise of each joint by the one before; chosen
LEAST_NOISE = 1e-9  # of the forces, of a joint without noise
LARGEST_FACTOR = 10.0  # of a pass, for a parameter that cannot be negative; chosen
DELAY_STEP = 1e-3  # s, between delays that are tried; chosen
# Samples in a period of the fastest forces that are compared, and these in Hz; chosen: of four
# known machines the worst start is then 7 % off, and 19 % with 5 Hz
SAMPLES_A_PERIOD, FASTEST = 40.0, 10.0
SMALL = (
    0.02  # of the command's deviation, or of the inertia: start of what would be negative; chosen
)
APART = 1.05  # the level of a friction at rest over that while sliding, at the start; chosen
SHIFT = 0.01  # of a parameter, for the slope of forces by it
LARGEST_ANGLE = 3.0 * math.pi  # rad: a larger one may be in degrees; chosen
MAX_BEYOND = 0.1  # of a joint's range, by which a log may pass it, as stops are soft; chosen
FITS = 0.5  # of the force that a motion takes: in degrees a log has a 57th of it; chosen
TOO_SMALL = 0.1  # of the force that a motion takes: angles may be in degrees; chosen
# cosine of the commands and the forces that a motion takes: beyond it they agree, and beyond its
# negative one of their columns has the other sign; chosen
AGREES = 0.5
TOO_LARGE = 50.0  # times that force: a command may be in another unit; chosen


class Forces(NamedTuple):
    """What a log says about forces, below the cutoff: M samples of n joints."""

    slopes: Array  # of the force that the motion takes by the linear quantities, (M n, p)
    rigid: Array  # that force with these quantities at 0, or at their own values, (M n,)
    commands: list[Array]  # for each delay the commands, (M, driven)


def first_guess(rig: LogRig, data: Sequence[Data]) -> LogRig:
    """Return the rig with values from least squares of the forces of its logs.

    Raises:
      ScenarioError: angles in degrees, or a column with the wrong sign.
    """
    delays = [0.0]
    if DELAY in rig.quantities:
        delays = np.arange(0.0, MAX_DELAY + 1e-9, DELAY_STEP).tolist()
    checked = _usable(rig, data)
    guessed = rig
    for step in range(PASSES if checked else 0):
        logs = [forces(guessed, record, delays) for record in checked]
        if not step:
            check_columns(rig, checked, logs)
        guessed = _guessed(guessed, data, logs, delays)
        if rig.plant.is_user_model:
            break  # the forces are linear
    return guessed


def _usable(rig: LogRig, data: Sequence[Data]) -> list[Record]:
    """Return the logs whose forces can be compared: none where the command is no force."""
    columns = dataclasses.replace(rig.columns, torque=rig.columns.x)
    usable = []
    for log in data if rig.base.force_command else ():
        record = rig.checked(log)
        if inverse_dynamics.long_enough(record, columns):
            usable.append(record)
    return usable


def _guessed(
    rig: LogRig, data: Sequence[Data], logs: Sequence[Forces], delays: Sequence[float]
) -> LogRig:
    """Return the rig with the values of least squares, and the delay whose residual is least."""
    gained = []
    found_gains = []
    for i, joint in enumerate(driven_names(rig.plant)):
        gain = f"{joint}.gain"
        if gain in rig.free:
            gained.append(i)
            found_gains.append(gain)
    A = np.concatenate([log.slopes for log in logs])
    best: tuple[float, float, Array] | None = None
    for k, late in enumerate(delays):
        targets, gains = [], []
        for log in logs:
            target, moved = _commanded(log, k, gained)
            targets.append(target - log.rigid)
            gains.append(-moved)
        full = np.hstack([A, np.concatenate(gains)])
        b = np.concatenate(targets)
        solution, noise = _weighted(full, b, rig.plant.n)
        if best is None or noise < best[0]:
            best = noise, late, solution
    assert best is not None
    names = [*linear(rig), *found_gains]
    values = dict(zip(names, best[2].tolist(), strict=True))
    for name in names:
        if not starts_from_zero(rig, name):
            values[name] += rig.values[name]
        if rig.quantities[name].least >= 0.0 and name in rig.plant.parameters and "." not in name:
            values[name] = _near(values[name], rig.values[name])
    if DELAY in rig.quantities:
        values[DELAY] = best[1] or 0.5 * DELAY_STEP
    return _within(rig, values, data)


def _near(value: float, before: float) -> float:
    """Return a value that cannot be negative within a factor of the one before, if that is not
    0.
    """
    if not before:
        return value
    return min(max(value, before / LARGEST_FACTOR), before * LARGEST_FACTOR)


def _commanded(log: Forces, k: int, gained: Sequence[int]) -> tuple[Array, Array]:
    """Return the force of the motors whose gain is known, (M n,), and that of each other for a
    gain of 1, (M n, gained).
    """
    commands = log.commands[k]
    n = len(log.rigid) // len(commands)
    commanded = np.zeros((len(commands), n))
    commanded[:, : commands.shape[1]] = commands
    moved = np.zeros((len(log.rigid), len(gained)))
    for j, i in enumerate(gained):
        alone = np.zeros_like(commanded)
        alone[:, i] = commands[:, i]
        moved[:, j] = alone.ravel()
        commanded[:, i] = 0.0
    return commanded.ravel(), moved


def _weighted(A: Array, b: Array, n: int) -> tuple[Array, float]:
    """Return the most likely x of A x = b + noise, whose rows are those of n joints in turn, each
    with a noise of its own, and the logarithm of these noises' product.

    A joint that nearly rests, or shakes under a noisy command, would else decide the delay of all.
    """
    sizes = np.ones(n)
    solution = np.zeros(A.shape[1])
    for _ in range(WEIGHINGS):
        weights = np.tile(1.0 / sizes, len(b) // n)
        solution = _solved(A * weights[:, None], b * weights)
        residuals = (b - A @ solution).reshape(-1, n)
        sizes = np.maximum(np.sqrt(np.mean(residuals**2, axis=0)), LEAST_NOISE * np.std(b))
    return solution, float(np.sum(np.log(sizes)))


def _solved(A: Array, b: Array) -> Array:
    """Return the least squares of A x = b, 0 for columns that are 0."""
    sizes = np.linalg.norm(A, axis=0)
    used = sizes > 1e-9 * max(sizes.max(initial=0.0), 1e-300)
    solution = np.zeros(A.shape[1])
    scales = sizes[used]
    solution[used] = least_squares(A[:, used] / scales, b, 1e-6) / scales
    return solution


def _within(rig: LogRig, values: Numbers, data: Sequence[Data]) -> LogRig:
    """Return the rig with values cut to their ranges; one that would be 0 or less starts small, as
    the search takes steps by factors.
    """
    u = 0.0
    for record in data:
        for name in rig.columns.inputs:
            u = max(u, float(np.std(record[name])))
    inertia = float(np.min(rig.plant.load().dof_M0))
    changed = dict(rig.quantities)
    for name, value in values.items():
        quantity = changed[name]
        start = min(max(value, quantity.least), quantity.most)
        if start <= quantity.least and quantity.least >= 0.0:
            small = SMALL * (inertia if name.endswith(".armature") else u)
            start = quantity.value if quantity.value > quantity.least else small
        changed[name] = dataclasses.replace(quantity, value=start, source="forces of the logs")
    guessed = dataclasses.replace(rig, quantities=changed)
    return guessed.with_values(guessed.in_order(guessed.values, APART), "forces of the logs")


def linear(rig: LogRig) -> list[str]:
    """Return the quantities in which the forces are linear, in the order of their columns."""
    return [name for name in rig.quantities if _is_linear(rig, name)]


def starts_from_zero(rig: LogRig, name: str) -> bool:
    """Return whether the slopes' base has this quantity at 0; else it has its own value."""
    return (name in rig.plant.parameters and "." in name) or name.endswith((".offset", ".gain"))


def _is_linear(rig: LogRig, name: str) -> bool:
    if name in rig.places:
        place = rig.places[name]
        part = getattr(rig.base, place.field)[place.part]
        return isinstance(part, Friction) and place.name in part.forces
    joint, _, kind = name.rpartition(".")
    of_joint = joint in channel_names(rig.plant) and kind in (*KINDS, "offset")
    return of_joint or _of_inertia(rig, name)


def _of_inertia(rig: LogRig, name: str) -> bool:
    """Return whether a quantity is a parameter of which the forces of a rigid motion depend: one
    of the plant's own, or a payload.
    """
    owner, _, kind = name.rpartition(".")
    return name in rig.plant.parameters and (not owner or kind == PAYLOAD)


def forces(rig: LogRig, record: Record, delays: Sequence[float]) -> Forces:
    """Return what a log says about forces."""
    columns = dataclasses.replace(rig.columns, torque=rig.columns.x)
    limit = cutoff(record, columns)
    filtered = Filter(record, columns, limit)
    x, v, a = filtered.motion(rig.columns.x)
    zeroed = {name: 0.0 for name in rig.plant.parameters if "." in name}
    base = rig.values_of_plant() | zeroed

    def inertial(parameters: Numbers) -> Array:
        plant = dataclasses.replace(rig.plant, parameters=parameters)
        needed = inverse_dynamics.torques(plant, record, columns, limit)
        return stacked(needed, rig.columns.x)

    plain = inertial(base)
    rigid = plain + _of_parts(rig, filtered, v)
    slopes = []
    for name in linear(rig):
        if _of_inertia(rig, name):
            step = SHIFT * abs(base[name]) or SHIFT
            shifted = inertial(base | {name: base[name] + step})
            slopes.append(((shifted - plain) / step).ravel())
        else:
            slopes.append(_column(rig, name, filtered, (x, v, a)).ravel())
    commands = []
    for late in delays:
        commands.append(_low_commands(rig, record, filtered, late))
    columns_of = np.column_stack(slopes) if slopes else np.zeros((plain.size, 0))
    return Forces(columns_of, rigid.ravel(), commands)


def cutoff(record: Record, columns: Columns) -> float:
    """Return the frequency below which forces are compared, Hz: the steps of dry friction tell
    most, and a log of few samples a second does not have them.
    """
    rate = 1.0 / step_of(record[columns.time])
    return min(max(CUTOFF, rate / SAMPLES_A_PERIOD), FASTEST)


def motion_forces(rig: LogRig, record: Record, late: float) -> tuple[Array, Array, Array, Array]:
    """Return positions, speeds, the forces that the motion takes by the rig's own numbers, and the
    commands that reach the motors, (M, n) each but the last, (M, driven), below 5 Hz.
    """
    columns = dataclasses.replace(rig.columns, torque=rig.columns.x)
    filtered = Filter(record, columns)
    needed = inverse_dynamics.torques(rig.plant, record, columns)
    positions, speeds = [], []
    for name in rig.columns.x:
        positions.append(filtered.low(filtered.cubic(name)))
        speeds.append(filtered.low(filtered.cubic(name, 1)))
    commands = _low_commands(rig, record, filtered, late)
    forces = stacked(needed, rig.columns.x)
    return np.column_stack(positions), np.column_stack(speeds), forces, commands


def _of_parts(rig: LogRig, filtered: Filter, v: Array) -> Array:
    """Return the force of the frictions of the scenario at their own numbers, (M, n)."""
    count = len(filtered.low(v[:, 0]))
    friction = np.zeros((count, v.shape[1]))
    for part in rig.base.friction:
        for k, i in enumerate(part.joint_names(rig.plant)):
            channel = channel_names(rig.plant).index(i)
            speeds = _smooth_speed(v[:, channel])
            friction[:, channel] += filtered.low(steady_force(part, speeds, k))
    return friction


def _smooth_speed(v: Array) -> Array:
    """Return speeds without those near 0, where a measured direction is noise."""
    slow = SLIDING * np.abs(v).max() + 1e-12
    return v * np.tanh((v / slow) ** 2)


def _column(rig: LogRig, name: str, filtered: Filter, motion: Sequence[Array]) -> Array:
    """Return how the forces of a motion depend on a linear quantity of joints, (M, n)."""
    x, v, a = motion
    count = len(filtered.low(v[:, 0]))
    slopes = np.zeros((count, v.shape[1]))
    names = channel_names(rig.plant)
    if name in rig.places:
        place = rig.places[name]
        part = getattr(rig.base, place.field)[place.part]
        for k, joint in enumerate(part.joint_names(rig.plant)):
            if place.joint in (-1, k):
                channel = names.index(joint)
                slopes[:, channel] = filtered.low(slope(part, place, v[:, channel], k))
        return slopes
    joint, _, kind = name.rpartition(".")
    i = names.index(joint)
    column = -np.ones(len(v))  # of an offset
    if kind in KINDS:
        column = KINDS[kind].slope(x[:, i], v[:, i], a[:, i])
    slopes[:, i] = filtered.low(column)
    return slopes


def _low_commands(rig: LogRig, record: Record, filtered: Filter, late: float) -> Array:
    """Return the commands that reach the motors with a delay, low-passed, (M, driven). Each is held
    over a sample, so that it acts half a sample late.
    """
    from scipy.signal import savgol_filter

    commands = []
    samples = cubic_samples(filtered.step)
    for name in rig.columns.inputs:
        u = record[name]
        samples_late = np.arange(len(u)) - late / filtered.step
        delayed = np.interp(samples_late, np.arange(len(u)), u)
        held = 0.5 * (delayed + np.concatenate([delayed[:1], delayed[:-1]]))
        smooth = np.asarray(savgol_filter(held, samples, CUBIC_DEGREE))
        commands.append(filtered.low(smooth[:: filtered.stride]))
    return np.column_stack(commands)


def check_columns(rig: LogRig, data: Sequence[Record], logs: Sequence[Forces]) -> None:
    """Raise ScenarioError where angles are in degrees, and where a column has the wrong sign."""
    for record, log in zip(data, logs, strict=True):
        shares = force_shares(rig, log)
        cosines = force_cosines(log)
        stopped = bool(_beyond_ranges(rig, record))  # their stops take most of the force
        for i, name in enumerate(rig.columns.x[: len(shares)]):
            if rig.plant.units[i] == "rad" and shares[i] < TOO_SMALL:
                _check_angle(rig, record, i, shares[i], stopped)
            if cosines[i] < -AGREES and not stopped:
                u = rig.columns.inputs[i]
                raise ScenarioError(
                    f"{u} of {rig.name} pushes against the motion of {name} (cosine "
                    f"{cosines[i]:.2f} of {u} and the force that the motion takes): one of the two "
                    "has the other sign in the model, so turn the sign of that column, or the "
                    "joint's axis in the file"
                )


def _check_angle(rig: LogRig, record: Record, i: int, share: float, stopped: bool) -> None:
    """Raise ScenarioError where the angle of a joint, with the share of the recorded force in the
    force that its motion takes, is in degrees: it is larger than a turn and a half, or the recorded
    forces agree with the motion if it is.
    """
    name = rig.columns.x[i]
    reach = float(np.abs(record[name]).max())
    if reach < LARGEST_ANGLE:
        if stopped:
            return
        turned = dict(record)
        for angle, unit in zip(rig.columns.x, rig.plant.units, strict=True):
            if unit == "rad":
                turned[angle] = np.radians(record[angle])
        if force_cosines(forces(rig, turned, [0.0]))[i] < AGREES:
            return
    cure = "if it is in degrees, divide it by 57.3"
    if not np.any(record[name] % 1.0):
        cure = "if it counts the steps of an encoder, multiply it by 2 pi over those of a turn"
    raise ScenarioError(
        f"column {name} of {rig.name} reaches {reach:.3g}, and in rad its motion takes "
        f"{1.0 / max(share, 1e-9):.3g} times the recorded force: {cure}"
    )


def force_cosines(log: Forces) -> list[float]:
    """Return for each motor the cosine of the recorded force and that which the motion of its joint
    takes by the model's inertia and gravity.
    """
    commands = log.commands[0]
    needed = log.rigid.reshape(len(commands), -1)
    cosines = []
    for i in range(commands.shape[1]):
        sizes = np.linalg.norm(commands[:, i]) * np.linalg.norm(needed[:, i])
        cosines.append(float(commands[:, i] @ needed[:, i] / max(sizes, 1e-300)))
    return cosines


def force_shares(rig: LogRig, log: Forces) -> list[float]:
    """Return for each motor the recorded force over that which the motion of its joint takes by the
    model's inertia and gravity.
    """
    commands = log.commands[0]
    needed = log.rigid.reshape(len(commands), -1)
    shares = []
    for i in range(commands.shape[1]):
        takes = float(np.sqrt(np.mean(needed[:, i] ** 2)))
        size = float(np.sqrt(np.mean(commands[:, i] ** 2)))
        shares.append(size / max(takes, 1e-300))
    return shares


def _beyond_ranges(rig: LogRig, record: Record) -> list[str]:
    """Return sentences on joints that leave their range in a log."""
    said = []
    ranges = zip(rig.columns.x, rig.plant.ranges, rig.plant.units, strict=False)
    for name, (joint, low, high), unit in ranges:
        farthest = float(max(record[name], key=abs))
        beyond = max(low - farthest, farthest - high)
        if beyond > MAX_BEYOND * (high - low):
            said.append(
                f"{name} reaches {farthest:.4g} {unit}, beyond the range of {joint} in the model "
                f"from {low:.4g} to {high:.4g}: correct the file"
                f"{_in_degrees(low, farthest, high, unit)}"
                f"{degrees_hint((low, high), farthest, unit)}"
            )
    return said


def _in_degrees(low: float, x: float, high: float, unit: str) -> str:
    """Return a clause for x that lies in its range if it is in degrees; "" for another."""
    if unit != "rad" or not low <= math.radians(x) <= high:
        return ""
    return ", or, if the log is in degrees, divide the column by 57.3"


def doubts(rig: LogRig, data: Sequence[Data]) -> list[str]:
    """Return sentences on columns that may be in another unit."""
    said = []
    for record in map(rig.checked, data):
        said += _beyond_ranges(rig, record)
    for record in _usable(rig, data):
        log = forces(rig, record, [0.0])
        shares = force_shares(rig, log)
        for i, (x, u) in enumerate(zip(rig.columns.x, rig.columns.inputs, strict=False)):
            reach = float(np.abs(record[x]).max())
            many_turns = rig.plant.units[i] == "rad" and reach > LARGEST_ANGLE
            if many_turns and shares[i] < FITS:
                said.append(f"{x} reaches {reach:.3g} rad: if that is in degrees, divide by 57.3")
            gained = f"{driven_names(rig.plant)[i]}.gain" in rig.quantities
            if shares[i] > TOO_LARGE and not gained and moves(record[x]):
                unit = rig.plant.efforts[i]
                said.append(
                    f"{u} is {shares[i]:.2g} times the force that the motion takes by inertia and "
                    f"gravity: if it is not in {unit} but in mA or N mm, give it in {unit}; if dry "
                    "friction takes the rest, record a larger motion"
                )
    return list(dict.fromkeys(said))
