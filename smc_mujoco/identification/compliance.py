"""Compliance: a spring between motor and joint, as one of the things that a model may lack.

At the solution the logs are replayed with such a spring, with the encoder on either side of it.
Where residuals are no more than the noise of the log, nothing is looked for.
"""

import dataclasses
import math
from collections.abc import Iterator

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.common.data import frozen_data
from smc_mujoco.identification import records
from smc_mujoco.identification.lack_of_fit import Lack
from smc_mujoco.identification.log_rig import RUN_STEP, LogRig
from smc_mujoco.identification.replays import Point, Replays, Slopes
from smc_mujoco.identification.rig import Values
from smc_mujoco.mechanisms.hardware.beside_joint import BesideJoint
from smc_mujoco.mechanisms.hardware.elastic_joint import ElasticJoint
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.hardware.part import SIDES
from smc_mujoco.mechanisms.layout import dof_ids, driven_names
from smc_mujoco.mechanisms.plant import Field
from smc_mujoco.mechanisms.plant import Values as Parameters

ABOVE_NOISE = 1.5  # rms of residuals over the noise, from which a spring is looked for; chosen
BEND = 2e-3  # rad (m), of the spring under the rms of the command; chosen
# of the joint's inertia: the rotor's, at least, and what of the armature it takes, at most; chosen
ROTOR_SHARE, MOST_OF_ROTOR = 0.1, 0.9
LOSS = 0.1  # of the root of stiffness and inertia: the spring's damping; chosen
SHORTEST_STEP = 2e-5  # s
MOST_POLE = 0.3  # of a step times the fastest pole; chosen


@frozen_data
class MovedInertia:
    """Plant.fields of a plant whose joint i has given some inertia to its rotor."""

    inner: object
    joint: int
    inertia: float  # kg m^2 (kg)

    def __call__(self, model: mujoco.MjModel, p: Parameters) -> Iterator[Field]:
        yield from self.inner(model, p)  # pyright: ignore[reportCallIssue]
        yield Field("dof_armature", dof_ids(model)[[self.joint]], -self.inertia, adds=True)


def compliance(rig: LogRig, replays: Replays, slopes: Slopes) -> list[Lack]:
    """Return what a spring before each driven joint would change in the residuals, with the encoder
    on either side. `rig`: with the values of the slopes.
    """
    beside = any(isinstance(part, BesideJoint) for part in rig.base.actuator)
    if beside or rig.base.sensor or not rig.base.force_command or _as_noise(rig, replays, slopes):
        return []
    lacks = []
    for i, joint in enumerate(driven_names(rig.plant)):
        spring, armature = _spring(rig, replays, i)
        for side in SIDES:
            changes = _changes(_with_spring(rig, i, spring, armature, side), replays, slopes)
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
    """Return a spring before driven joint i that bends by BEND, and the armature that its rotor
    takes from the joint.
    """
    commands = [np.asarray(data[rig.columns.inputs[i]], float) for data in replays.data]
    force = float(np.std(np.concatenate(commands))) or 1.0
    plant = rig.numbers_of(Values(**rig.values))["plant"]
    model = plant.load()
    dof = dof_ids(model)[i]
    inertia = float(model.dof_M0[dof])
    armature = min(float(model.dof_armature[dof]), MOST_OF_ROTOR * inertia)
    rotor = max(armature, ROTOR_SHARE * inertia)
    stiffness = force / BEND
    damping = LOSS * math.sqrt(stiffness * rotor)
    joint = driven_names(rig.plant)[i]
    return ElasticJoint(stiffness, damping, rotor, on=(joint,)), armature


def _with_spring(rig: LogRig, i: int, spring: ElasticJoint, armature: float, side: str) -> LogRig:
    """Return the rig with a spring before a joint, and its encoder on a side."""
    plant = dataclasses.replace(rig.plant, fields=MovedInertia(rig.plant.fields, i, armature))
    encoder = Encoder(math.inf, side=side, on=spring.on)
    base = dataclasses.replace(
        rig.base, actuator=(*rig.base.actuator, spring), sensor=(encoder,), plant=rig.base.plant
    )
    return dataclasses.replace(rig, base=base, plant=plant)


def _changes(elastic: LogRig, replays: Replays, slopes: Slopes) -> list[Array]:
    """Return what the spring changes in the residuals of each piece, from starts that suit it."""
    trial = Replays(elastic, [], replays.data, False, kept=replays.kept)
    (spring,) = (part for part in elastic.base.actuator if isinstance(part, ElasticJoint))
    control = elastic.repeated(trial.pieces[0].part).control_period  # pyright: ignore[reportArgumentType]
    longest = min(RUN_STEP, max(MOST_POLE / spring.fastest_pole(elastic.plant), SHORTEST_STEP))
    trial.steps = {"physics_step": control / math.ceil(control / longest - 1e-9)}
    hidden = np.zeros((len(trial.pieces), len(elastic.hidden)))
    point = Point(np.zeros(0), np.hstack([hidden, slopes.point.states]))
    bent = trial.slopes(point, central=False)
    changes = []
    moves = bent.moves(np.zeros(0))
    for r, S, move, before in zip(
        bent.residuals, bent.by_states, moves, slopes.residuals, strict=True
    ):
        changes.append(r + S @ move - before)
    return changes
