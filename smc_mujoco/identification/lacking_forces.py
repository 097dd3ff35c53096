"""Forces that a model may lack, and what each would change in the residuals of its replays.

A force of each shape is added to the recorded command of each motor: near rest, with the direction,
the speed, the position and the time, and of what the model may have left out. The shapes follow
from the motion that the replay of the log predicts, which has no noise. The replays of all logs
with all shapes are one batch.
"""

import copy
import dataclasses
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.identification.lack_of_fit import Lack
from smc_mujoco.identification.log_rig import LogPart, LogRig
from smc_mujoco.identification.paths import DELAY
from smc_mujoco.identification.records import Record
from smc_mujoco.identification.replays import Piece, Point, Replays, Slopes
from smc_mujoco.mechanisms.hardware.beside_joint import BesideJoint
from smc_mujoco.mechanisms.layout import driven_names

SIZE = 0.01  # of the command's deviation: a force so small acts linearly; chosen
NEAR_REST = 0.1, 0.3  # of the speed's rms: widths of a drop of friction with speed; chosen
WAVES = 4  # half waves of a force over the range of positions; chosen
SLOW_WAVES = 2  # of a friction over that range, and of a force over the time of a log; chosen
AVERAGED = 0.02  # s, over which a command is averaged: what is left is fast; chosen
RESTING = 1e-6  # of the speed's rms: below it a joint rests
REST = (
    "near rest: friction that drops with speed looks like this, and so does a jerky command that "
    "acts between samples; for the former find a Stribeck in a scenario"
)
DIRECTION = "of viscous friction that differs between the directions"
SPEED = "that grows faster than the speed, as a drag"
PLACE = "that depends on its position, as of another mass or centre of mass, a spring or cogging"
RUBS = "of friction that depends on its position"
LOAD = "of friction that grows with the load: give a Stribeck with km"
TIME = "that changes in the course of the log"
WARMTH = "of friction that changes in the course of the log, as it warms up"
COMMAND = (
    "as the fast part of its command: what was applied between samples differs from the log, so "
    "record every command of the loop; or a spring is between motor and joint, an ElasticJoint"
)
SPRUNG = (
    "as the fast part of its command: what was applied between samples differs from the log, so "
    "record every command of the loop; or the search ended at another stiffness or play than the "
    "machine's: start it from another"
)
LEFT_OUT = {
    "armature": "in proportion to its acceleration",
    "damping": "in proportion to its speed",
    "frictionloss": "of dry friction",
    "offset": "that is constant, or differs between the directions",
}


class JointMotion(NamedTuple):
    """How a joint moves in a piece of a log when the command of each sample acts: N samples, each
    relative to what is said.
    """

    place: Array  # from 0 to 1, over the range of all logs
    speed: Array  # over its rms in all logs
    acceleration: Array  # over its rms in all logs
    time: Array  # from 0 to 1, over the log
    command: Array  # of its motor, its fast part
    load: Array | None  # the rest of that command; None of a set-point

    @property
    def direction(self) -> Array:
        """The direction of the motion, -1 or 1: at rest, that of the next motion."""
        moving = np.abs(self.speed) > RESTING
        following = np.where(moving, np.arange(len(moving)), len(moving) - 1)
        following = np.minimum.accumulate(following[::-1])[::-1]
        return np.sign(self.speed)[following]


def shapes(motion: JointMotion) -> Iterator[tuple[str, Array]]:
    """Yield what a model may lack, in words, and its force in a motion, (N,)."""
    direction = motion.direction
    speed = motion.speed
    for width in NEAR_REST:
        yield REST, direction * np.exp(-((speed / width) ** 2))
    yield DIRECTION, np.abs(speed)
    yield SPEED, speed * np.abs(speed)
    for k in range(1, WAVES + 1):
        yield PLACE, np.cos(k * math.pi * motion.place)
    for k in range(1, SLOW_WAVES + 1):
        yield RUBS, direction * np.cos(k * math.pi * motion.place)
        yield TIME, np.cos(k * math.pi * motion.time)
        yield WARMTH, direction * np.cos(k * math.pi * motion.time)
    yield COMMAND, motion.command
    if motion.load is not None:
        yield LOAD, direction * np.abs(motion.load)


def left_out(motion: JointMotion, joint: str, names: Sequence[str]) -> Iterator[tuple[str, Array]]:
    """Yield what a model may lack, and its force, of the joint's numbers that are not found."""
    forces = {
        "armature": motion.acceleration,
        "damping": motion.speed,
        "frictionloss": motion.direction,
        "offset": np.ones(len(motion.speed)),
    }
    for kind, force in forces.items():
        if f"{joint}.{kind}" not in names:
            yield f"{LEFT_OUT[kind]}: find {joint}.{kind}", force


def lacking_forces(rig: LogRig, replays: Replays, slopes: Slopes) -> list[Lack]:
    """Return what forces of many shapes would change in the residuals, for each motor. `rig`: with
    the values of the slopes.
    """
    texts = []
    trial = copy.copy(replays)
    trial.corrections = None
    trial.steps = replays.steps | replays.rough_steps
    (predicted,) = trial.predicted([slopes.point])
    pieces = list(replays.pieces)
    for i, joint in enumerate(driven_names(rig.plant)):
        geared = any(isinstance(part, BesideJoint) for part in rig.base.drive_train.chains[i])
        shapes_by_piece = []
        for motion in _motions(rig, replays, predicted, i):
            shapes_by_piece.append([*shapes(motion), *left_out(motion, joint, replays.names)])
        for of_pieces in zip(*shapes_by_piece, strict=True):
            words = SPRUNG if geared and of_pieces[0][0] == COMMAND else of_pieces[0][0]
            texts.append(f"lack of fit: the model lacks a force on {joint} {words}")
            pieces += _slightly_pushed(replays.pieces, [force for _, force in of_pieces], i)
    trial.pieces = pieces
    states = np.tile(slopes.point.states, (len(texts) + 1, 1))
    (rows,) = trial.residuals([Point(slopes.point.values, states)])
    count = len(replays.pieces)
    lacks = []
    for k, text in enumerate(texts, 1):
        changes = []
        for after, before in zip(rows[k * count : (k + 1) * count], rows[:count], strict=True):
            changes.append(after - before)
        lacks.append(Lack(text, changes))
    return lacks


def _motions(
    rig: LogRig, replays: Replays, predicted: Sequence[Record], i: int
) -> list[JointMotion]:
    """Return the motion of joint i in each piece, as it is predicted."""
    late = rig.values.get(DELAY, rig.base.input_delay)
    x, v, a = [], [], []
    for piece, columns in zip(replays.pieces, predicted, strict=True):
        period = period_of(piece)
        place = columns[rig.columns.x[i]]
        speed = np.gradient(place, period)
        t = period * np.arange(len(place))
        acts = t + late + 0.5 * period  # a command is held over a sample
        x.append(np.interp(acts, t, place))
        v.append(np.interp(acts, t, speed))
        a.append(np.interp(acts, t, np.gradient(speed, period)))
    least = np.concatenate(x).min()
    reach = np.ptp(np.concatenate(x)) or 1.0
    fast = _rms(np.concatenate(v))
    strong = _rms(np.concatenate(a))
    records = [piece.record for piece in replays.pieces]
    sets_position = rig.base.efforts[i] == rig.plant.units[i]
    motions = []
    for k, piece in enumerate(replays.pieces):
        share = np.arange(len(x[k])) / len(x[k])
        before = k - records.index(piece.record)
        motions.append(
            JointMotion(
                place=(x[k] - least) / reach,
                speed=v[k] / fast,
                acceleration=a[k] / strong,
                time=(before + share) / records.count(piece.record),
                command=command_of(piece, i) - _slow_part(piece, i),
                load=None if sets_position else _slow_part(piece, i),
            )
        )
    return motions


def period_of(piece: Piece) -> float:
    """Return the time between samples of a piece, s."""
    assert isinstance(piece.part, LogPart)
    return piece.part.period * piece.part.stride


def _rms(values: Array) -> float:
    """Return the root mean square; 1 if it is 0."""
    return float(np.sqrt(np.mean(values**2))) or 1.0


def command_of(piece: Piece, i: int) -> Array:
    """Return the command of motor i, (N,)."""
    part = piece.part
    assert isinstance(part, LogPart)
    return part.u[part.before :: part.stride, i]


def _slow_part(piece: Piece, i: int) -> Array:
    """Return the command of motor i averaged over some samples, (N,)."""
    from scipy.ndimage import uniform_filter1d

    size = 2 * max(1, round(AVERAGED / 2.0 / period_of(piece))) + 1
    return uniform_filter1d(command_of(piece, i), size, mode="nearest")


def _slightly_pushed(pieces: Sequence[Piece], forces: Sequence[Array], i: int) -> list[Piece]:
    """Return the pieces with forces added to the commands of motor i, SIZE of its deviation."""
    commands = []
    for piece in pieces:
        assert isinstance(piece.part, LogPart)
        commands.append(piece.part.u[:, i])
    size = SIZE * (float(np.std(np.concatenate(commands))) or 1.0) / _rms(np.concatenate(forces))
    return pushed(pieces, [size * force for force in forces], i)


def pushed(pieces: Sequence[Piece], forces: Sequence[Array], i: int) -> list[Piece]:
    """Return the pieces with forces added to the commands of motor i."""
    moved = []
    for piece, force in zip(pieces, forces, strict=True):
        part = piece.part
        assert isinstance(part, LogPart)
        u = part.u.copy()
        held = np.repeat(force, part.stride)
        u[: part.before, i] += held[0]
        u[part.before :, i] += held[: len(u) - part.before]
        moved.append(dataclasses.replace(piece, part=dataclasses.replace(part, u=u)))
    return moved
