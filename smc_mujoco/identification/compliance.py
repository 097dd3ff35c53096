"""Compliance: a spring between motor and joint, as one of the things that a model may lack.

At the solution the logs are replayed with what such a spring does to the joint at first order, with
the encoder on either side of it. A rotor of inertia j and a joint of J - j are bent by z:

    j (1 - j / J) z'' + damping z' + stiffness z = u - j x''

where x is the motion without the spring; and the joint is pushed by -j z''. A command is held over
a sample, so z and z' are exact at samples, however stiff the spring is. Where residuals are no more
than the noise of the log, nothing is looked for.
"""

import copy
import math

import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.identification import records
from smc_mujoco.identification.lack_of_fit import Lack
from smc_mujoco.identification.lacking_forces import command_of, period_of, pushed
from smc_mujoco.identification.log_rig import LogRig
from smc_mujoco.identification.paths import DELAY
from smc_mujoco.identification.replays import Piece, Replays, Slopes
from smc_mujoco.identification.rig import Values
from smc_mujoco.identification.steps import filtered
from smc_mujoco.mechanisms.hardware.beside_joint import BesideJoint
from smc_mujoco.mechanisms.hardware.elastic_joint import ElasticJoint
from smc_mujoco.mechanisms.hardware.part import SIDES
from smc_mujoco.mechanisms.layout import dof_ids, driven_names

ABOVE_NOISE = 1.5  # rms of residuals over the noise, from which a spring is looked for; chosen
BEND = 2e-3  # rad (m), of the spring under the rms of the command; chosen
# of the joint's inertia: the rotor's, at least, and what of the armature it takes, at most; chosen
ROTOR_SHARE, MOST_OF_ROTOR = 0.1, 0.9
LOSS = 0.1  # of the root of stiffness and inertia: the spring's damping; chosen


def compliance(rig: LogRig, replays: Replays, slopes: Slopes) -> list[Lack]:
    """Return what a spring before each driven joint would change in the residuals, with the encoder
    on either side. `rig`: with the values of the slopes.
    """
    beside = any(isinstance(part, BesideJoint) for part in rig.base.actuator)
    if beside or rig.base.sensor or not rig.base.force_command or _as_noise(rig, replays, slopes):
        return []
    lacks = []
    (predicted,) = replays.predicted([slopes.point])
    before = list(map(replays.relative, replays.pieces, predicted))
    trial = copy.copy(replays)
    for i, joint in enumerate(driven_names(rig.plant)):
        spring, inertia = _spring(rig, replays, i)
        column = rig.columns.x[i]
        bends, forces = [], []
        for piece, columns in zip(replays.pieces, predicted, strict=True):
            bend, force = _bent(rig, i, piece, columns[column], spring, inertia)
            bends.append(bend)
            forces.append(force)
        trial.pieces = pushed(replays.pieces, forces, i)
        (after,) = trial.predicted([slopes.point])
        for side in SIDES:
            changes = []
            for k, piece in enumerate(replays.pieces):
                columns = dict(after[k])
                if side == "motor":
                    columns[column] = columns[column] + bends[k]
                changes.append(replays.relative(piece, columns) - before[k])
            lacks.append(Lack(_text(joint, spring, side), changes))
    return lacks


def _text(joint: str, spring: ElasticJoint, side: str) -> str:
    """Return what is lacking, and what to do."""
    numbers = f"{spring.stiffness:.3g}, {spring.damping:.2g}, {spring.rotor_inertia:.3g}"
    return (
        f"lack of fit: the model lacks a spring between motor and {joint}, whose encoder reads the "
        f"{'motor' if side == 'motor' else 'joint'}: find --for actuator.{joint}.stiffness,"
        f"actuator.{joint}.rotor_inertia with --condition \"geared: actuator={{'{joint}': "
        f"ElasticJoint({numbers})}}, sensor=Encoder(8192, side='{side}')\""
    )


def _as_noise(rig: LogRig, replays: Replays, slopes: Slopes) -> bool:
    """Return whether the residuals are no more than the noise of the logs."""
    for piece, residuals in zip(replays.pieces, slopes.residuals, strict=True):
        columns = residuals.reshape(-1, slopes.columns).T
        for (name, values), column in zip(piece.measured.items(), columns, strict=True):
            rms = piece.spread[name] * float(np.sqrt(np.mean(column**2)))
            noise = max(records.white_noise(values), records.sensor_step(values) / math.sqrt(12.0))
            if rms > ABOVE_NOISE * noise:
                return False
    return True


def _spring(rig: LogRig, replays: Replays, i: int) -> tuple[ElasticJoint, float]:
    """Return a spring before driven joint i that bends by BEND, and the inertia of joint and
    rotor.
    """
    commands = [np.asarray(data[rig.columns.inputs[i]], float) for data in replays.data]
    force = float(np.std(np.concatenate(commands))) or 1.0
    model = rig.numbers_of(Values(**rig.values))["plant"].load()
    dof = dof_ids(model)[i]
    inertia = float(model.dof_M0[dof])
    armature = min(float(model.dof_armature[dof]), MOST_OF_ROTOR * inertia)
    rotor = max(armature, ROTOR_SHARE * inertia)
    stiffness = force / BEND
    damping = LOSS * math.sqrt(stiffness * rotor)
    joint = driven_names(rig.plant)[i]
    return ElasticJoint(stiffness, damping, rotor, on=(joint,)), inertia


def _bent(
    rig: LogRig, i: int, piece: Piece, x: Array, spring: ElasticJoint, inertia: float
) -> tuple[Array, Array]:
    """Return by how much a spring is bent at each sample of a piece, and what it adds to each
    command, (N,); `x`: the motion without it.
    """
    period = period_of(piece)
    t = period * np.arange(len(x))
    acts = t + rig.values.get(DELAY, rig.base.input_delay)
    speed = np.interp(np.append(acts, acts[-1] + period), t, np.gradient(x, period))
    gain = rig.of_motors("gain", 1.0)[i]
    j = spring.rotor_inertia
    load = gain * command_of(piece, i) - j * np.diff(speed) / period
    load = np.append(load, load[-1])
    bending = np.array([j * (1.0 - j / inertia), spring.damping, spring.stiffness])
    moved = load - load[0]  # it begins bent, at rest
    bend = load[0] / spring.stiffness + filtered((np.ones(1), bending), moved, period)
    rate = filtered((np.array([1.0, 0.0]), bending), moved, period)
    return np.interp(t, acts, bend[:-1]), -j * np.diff(rate) / period / gain
