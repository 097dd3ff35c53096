"""Lack of fit: what a model lacks, by what the residuals show, and how far that moves the numbers.

Numbers absorb what a model lacks, and the scatter of residuals does not show how much of it. So
each thing that it may lack, see lacking_forces.py and presliding.py, is tried at the solution, at
first order: its change of the residuals is the slope of a further number. One after the other, the
thing that explains most of what is left is taken, if it stands out of the scatter between blocks of
time (a score test). How far each moves the numbers is part of their errors.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.common.data import frozen_data
from smc_mujoco.identification.least_squares import least_squares
from smc_mujoco.identification.replays import Point, Slopes

SIGNIFICANT = 6.0  # deviations between blocks, beyond which a lack stands out; chosen
BLOCKS = 8  # of a piece; chosen
UNSEEN = 3.0  # deviations between blocks, of a lack that gives way and is not seen; chosen
OWN_SHARE = 0.04  # of a lack's change, which no number and no earlier lack can cause; chosen
MOST = 6  # lacks that are taken; chosen
# of the squared residuals, and of a number's error: a lack of more is told; chosen
EXPLAINED, MOVED = 0.1, 0.7


@frozen_data
class Lack:
    """Something that a model may lack."""

    text: str  # what it is, and what to do
    changes: list[Array]  # of the residuals of each piece by it, (N,)
    # whether it only adds to what there is, and counts even where the residuals hardly show it
    gives_way: bool = False


class Explained(NamedTuple):
    """What a lack explains beside the numbers and earlier lacks."""

    explained: float = 0.0  # of the squared residuals that are left
    deviations: float = 0.0  # of the scatter between blocks


class Taken(NamedTuple):
    """A lack that is taken."""

    lack: Lack
    explained: float  # as of Explained
    deviations: float
    move: Array  # how far it moves the numbers, in their scales, (p,)

    def matters(self, errors: Array) -> bool:
        """Return whether it explains much, or moves a number by most of its error, (p,)."""
        return self.explained > EXPLAINED or bool(np.any(np.abs(self.move) > MOVED * errors))


class LackOfFit(NamedTuple):
    """What the residuals show of what a model lacks."""

    taken: list[Taken]
    slopes: Slopes  # at the least squares with the lacks as further numbers, which come last
    unseen: Array  # how far what does not stand out may move the numbers, in their scales, (p,)

    @property
    def moved(self) -> Array:
        """How far the lacks move the numbers, in their scales, (p,)."""
        squares = self.unseen**2
        for taken in self.taken:
            squares = squares + taken.move**2
        return np.sqrt(squares)

    def told(self, errors: Array) -> tuple[str, ...]:
        """Return what is lacking, in words, where it matters beside errors in scales, (p,)."""
        texts = []
        for taken in self.taken:
            if taken.matters(errors):
                texts.append(taken.lack.text)
        return tuple(dict.fromkeys(texts))


def lack_of_fit(slopes: Slopes, lacks: Sequence[Lack]) -> LackOfFit:
    """Return what the model lacks of several things."""
    p = slopes.by_values[0].shape[1]
    taken: list[Taken] = []
    fitted = slopes
    rest = list(lacks)
    while rest and len(taken) < MOST:
        shares = _shares(fitted, rest)
        k = _strongest(shares)
        if k < 0:
            break
        lack = rest.pop(k)
        fitted, move = _with(fitted, lack, p)
        taken.append(Taken(lack, *shares[k], move))
    return LackOfFit(taken, fitted, _unseen(fitted, rest, p))


def _unseen(slopes: Slopes, lacks: Sequence[Lack], p: int) -> Array:
    """Return how far lacks that give way may move the first p numbers and not stand out, (p,): the
    most of any, by UNSEEN deviations or those that it has, and at most as far as it does.
    """
    most = np.zeros(p)
    giving = []
    for lack in lacks:
        if lack.gives_way:
            giving.append(dataclasses.replace(lack, gives_way=False))
    for lack, share in zip(giving, _shares(slopes, giving), strict=True):
        if not share.deviations:
            continue
        _, step, move = _wider(slopes, lack, p)
        size = float(step[-1])
        may_be = max(UNSEEN * abs(size) / share.deviations, size)
        most = np.maximum(most, np.abs(move / size) * min(may_be, 1.0))
    return most


def _strongest(shares: Sequence[Explained]) -> int:
    """Return the index of the lack that explains most of those that stand out; -1 if none does."""
    best = -1
    for k, share in enumerate(shares):
        stands_out = share.deviations > SIGNIFICANT
        if stands_out and (best < 0 or share.explained > shares[best].explained):
            best = k
    return best


def _shares(slopes: Slopes, lacks: Sequence[Lack]) -> list[Explained]:
    """Return what each lack alone explains beside the numbers of the slopes."""
    basis = slopes.basis
    r = slopes.freed_residuals
    residuals = r - basis @ (basis.T @ r)
    starts = _starts(slopes)
    shares = []
    for lack in lacks:
        change = np.concatenate(slopes.freed(lack.changes))
        own = change - basis @ (basis.T @ change)
        power = float(own @ own)
        if power <= OWN_SHARE**2 * float(change @ change):
            shares.append(Explained())
            continue
        size = -float(own @ residuals) / power
        if lack.gives_way and size <= 0.0:
            shares.append(Explained())
            continue
        pulls = np.add.reduceat(own * (residuals + size * own), starts)
        scatter = float(np.linalg.norm(pulls))
        explained = size**2 * power / max(float(residuals @ residuals), 1e-300)
        shares.append(Explained(explained, abs(size) * power / max(scatter, 1e-300)))
    return shares


def _starts(slopes: Slopes) -> Array:
    """Return the first row of each block of time in all pieces."""
    starts = []
    first = 0
    for r in slopes.residuals:
        starts.append(first + np.arange(BLOCKS) * len(r) // BLOCKS)
        first += len(r)
    return np.concatenate(starts)


def _with(slopes: Slopes, lack: Lack, p: int) -> tuple[Slopes, Array]:
    """Return the slopes at the least squares with a lack as a further number, and how far it moves
    the first p numbers, (p,).
    """
    wider, step, move = _wider(slopes, lack, p)
    return wider.stepped(step), move


def _wider(slopes: Slopes, lack: Lack, p: int) -> tuple[Slopes, Array, Array]:
    """Return the slopes with a lack as a further number, the step to the least squares, and how
    far it moves the first p numbers, (p,).
    """
    r = slopes.freed_residuals
    J = slopes.freed_slopes
    before = least_squares(J, -r)
    columns = []
    for by_values, change in zip(slopes.by_values, lack.changes, strict=True):
        columns.append(np.column_stack([by_values, change]))
    point = Point(np.append(slopes.point.values, 0.0), slopes.point.states)
    wider = dataclasses.replace(slopes, point=point, by_values=columns)
    change = np.concatenate(slopes.freed(lack.changes))
    step = least_squares(np.column_stack([J, change]), -r)
    move = step[:p] - before[:p]
    if lack.gives_way:  # at most as it does
        move = move / max(abs(step[-1]), 1.0)
    return wider, step, move
