"""Standard errors and correlations of identified quantities, and errors where records cannot tell
them apart.

Standard errors allow for residuals that depend on their neighbours: they come from a jackknife, at
first order, that leaves out one block of time after the other. The states at the start of the
block's piece are found again without it, because they share its samples. Blocks must be longer than
the residuals' correlation time. Where a force that was not recorded moves the machine, no record
has enough of them. So a standard error is at least that of least squares with as many residuals as
are independent of each other. It is still too small then, and a note says so.

What a model lacks makes pieces and records disagree by more than that. So a standard error is also
at least the scatter between pieces, and between records, if there are several.

Correlations are those of least squares, which the motion decides. One pattern in the residuals
would correlate all errors of a jackknife, also of quantities that the motion tells apart well.

A closed loop feeds the noise of its measurement back. If one short transient decides a quantity,
the other blocks do not show the effect of that noise. So closed loops are also simulated with their
own noise and rounding, and a standard error is at least the deviation that these cause.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.identification import records
from smc_mujoco.identification.least_squares import least_squares
from smc_mujoco.identification.replays import Point, Replays, Slopes
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.signals import Noise

MAX_CORRELATION = 0.98  # beyond this correlation records cannot tell two quantities apart; chosen
REPEATS = 24  # simulated repetitions of the records of a closed loop, for standard errors; chosen
# Of the jackknife, chosen: blocks of time in all pieces together, and the length of a block in
# correlation times of the residuals.
BLOCKS = (60, 400)
CORRELATION_TIMES = 10.0
MIN_SHARE = 1e-3  # of the information that the other groups must have, as more counts; chosen
MIN_POWER = 1e-300  # in place of the power 0 of residuals that are all 0
# ratio of the slopes' singular values below which quantities cannot be told apart; chosen
SINGULAR_RATIO = 1e-6


def statistics(replays: Replays, slopes: Slopes, by_model: Array) -> tuple[dict[str, float], Array]:
    """Return the standard error of each quantity and their correlations (p, p), at the solution.

    `by_model`: errors of the quantities that the simulation's steps and what the model lacks
    cause, in their scales, (p,).
    """
    names = replays.names
    J = slopes.freed_slopes
    covariance = np.linalg.pinv(J.T @ J)
    sizes = np.sqrt(np.diag(covariance))
    with np.errstate(all="ignore"):
        correlations = np.nan_to_num(covariance / np.outer(sizes, sizes))
    count = independent(slopes)
    deviation = np.sqrt(np.diag(jackknife(slopes)))
    deviation = np.maximum(deviation, by_correlation(slopes, J, count))
    by_piece = list(range(len(slopes.residuals)))
    by_record = [piece.record for piece in replays.pieces]
    deviation = np.maximum(deviation, between(slopes, by_piece))
    deviation = np.maximum(deviation, between(slopes, by_record))
    if replays.closed:
        deviation = np.maximum(deviation, _fed_back(replays, slopes.point, J))
    deviation = np.hypot(deviation, by_model)
    errors = dict(zip(names, (deviation * replays.scales).tolist(), strict=True))
    return errors, correlations


def check_told_apart(replays: Replays, slopes: Slopes) -> None:
    """Raise ScenarioError where nothing depends on a quantity, or two cannot be told apart."""
    names = replays.names
    J = slopes.freed_slopes
    sizes = np.linalg.norm(J, axis=0)
    for name, size in zip(names, sizes, strict=True):
        if size == 0.0:
            raise ScenarioError(
                replays.twin.unseen(name)
                or f"nothing in the records depends on {name}: leave it out, or give other records"
            )
    _, singular, rows = np.linalg.svd(J / sizes, full_matrices=False)
    if singular[-1] < SINGULAR_RATIO * singular[0]:
        first, second = np.argsort(-np.abs(rows[-1]))[:2]
        unseen = filter(None, map(replays.twin.unseen, (names[first], names[second])))
        raise ScenarioError(
            next(unseen, "")
            or f"the records of {replays.twin.name} cannot tell {names[first]} and {names[second]} "
            "apart: leave one out, or give a longer record or one of a richer motion"
        )


def between(slopes: Slopes, groups: Sequence[int]) -> Array:
    """Return the deviation of the solution, (p,), by how much groups of pieces disagree; 0 with
    fewer than two. `groups`: the group of each piece.

    A group's pull on the solution is that of its residuals, which the solution has fitted. So a
    group that decides a quantity alone pulls too little. With the factor (1 - B)^(-1/2), where B is
    its share of the information, the variance is right for white noise. Source: R. M. Bell and D.
    F. McCaffrey, Bias reduction in standard errors for linear regression with multi-stage samples,
    Survey Methodology 28(2), 2002 (CR2).
    """
    p = slopes.by_values[0].shape[1]
    sums = {group: (np.zeros((p, p)), np.zeros(p)) for group in groups}
    pieces = zip(groups, slopes.residuals, slopes.by_values, slopes.by_states, strict=True)
    for group, r, J, S in pieces:
        A, g = _normal(r, J, S)
        sums[group] = sums[group][0] + A, sums[group][1] + g
    if len(sums) < 2:
        return np.zeros(p)
    information = np.sum([A for A, _ in sums.values()], axis=0)
    sizes, vectors = np.linalg.eigh(information)
    whiten = vectors / np.sqrt(np.maximum(sizes, SINGULAR_RATIO**2 * sizes[-1]))
    variance = np.zeros(p)
    for A, g in sums.values():
        shares, axes = np.linalg.eigh(whiten.T @ A @ whiten)
        factors = 1.0 / np.sqrt(np.maximum(1.0 - shares, MIN_SHARE))
        pull = axes @ (factors * (axes.T @ (whiten.T @ g)))
        variance += (whiten @ pull) ** 2
    return np.sqrt(variance)


def jackknife(slopes: Slopes) -> Array:
    """Return the covariance of the solution, (p, p), from leaving out one block of time after the
    other.
    """
    pieces = list(zip(slopes.residuals, slopes.by_values, slopes.by_states, strict=True))
    parts = -(-_blocks(slopes) // len(pieces))
    p = slopes.by_values[0].shape[1]
    A = np.zeros((p, p))
    g = np.zeros(p)
    normal = []
    for piece in pieces:
        piece_A, piece_g = _normal(*piece)
        A = A + piece_A
        g = g + piece_g
        normal.append((piece_A, piece_g))
    moves = []
    for (r, J, S), (piece_A, piece_g) in zip(pieces, normal, strict=True):
        block = np.arange(len(r)) * parts // len(r)
        for b in range(parts):
            rest = block != b
            left_A, left_g = _normal(r[rest], J[rest], S[rest])
            moves.append(least_squares(A - piece_A + left_A, g - piece_g + left_g))
    moved = np.array(moves) - least_squares(A, g)
    return (len(moved) - 1) / len(moved) * moved.T @ moved


def by_correlation(slopes: Slopes, J: Array, count: float) -> Array:
    """Return the deviation of the solution, (p,), by least squares with `count` samples that are
    independent.
    """
    variance = slopes.cost / max(count * slopes.columns - J.shape[1], 1.0)
    return np.sqrt(variance * np.diag(np.linalg.pinv(J.T @ J)))


def _blocks(slopes: Slopes) -> int:
    """Return the number of blocks: as many as are independent of each other, within BLOCKS."""
    return int(np.clip(independent(slopes) / CORRELATION_TIMES, *BLOCKS))


def independent(slopes: Slopes) -> float:
    """Return how many samples of the residuals are independent of each other: their number over a
    correlation time.
    """
    times = []
    for r in slopes.residuals:
        times += map(correlation_time, r.reshape(-1, slopes.columns).T)
    return sum(map(len, slopes.residuals)) / slopes.columns / float(np.median(times))


def correlation_time(r: Array) -> float:
    """Return 1 + 2 (sum of the autocorrelations of residuals up to the first one below 0), in
    samples.
    """
    power = np.abs(np.fft.rfft(r, 2 * len(r))) ** 2
    correlation = np.fft.irfft(power)[: len(r)]
    end = int(np.argmax(correlation < 0.0)) or len(correlation)
    return 1.0 + 2.0 * float(correlation[1:end].sum() / max(correlation[0], MIN_POWER))


def _normal(r: Array, J: Array, S: Array) -> tuple[Array, Array]:
    """Return J'J and J'r of a piece, (p, p) and (p,), with J less what states S at its start can
    cause.
    """
    J = J - S @ least_squares(S, J, SINGULAR_RATIO)
    return J.T @ J, J.T @ r


def _fed_back(replays: Replays, point: Point, J: Array) -> Array:
    """Return the deviation of the solution, (p,), that the measurement's noise causes through the
    controller.

    It is the root mean square over REPEATS simulations of the records with their noise and
    rounding, at first order.
    """
    rig = replays.rig(point)
    calm = []
    noises = []
    for k, piece in enumerate(replays.pieces):
        state = replays.state(point, k)
        calm.append(rig.repeated(piece.part, state=state))  # pyright: ignore[reportArgumentType]
        noise = records.noise(rig.checked(replays.data[piece.record]), rig.columns)
        rounded = rig.repeated(piece.part, rounded=True, state=state)  # pyright: ignore[reportArgumentType]
        noises.append(dataclasses.replace(rounded, noise=Noise(noise)))
    scenarios = list(calm)
    for repeat in range(REPEATS):
        for scenario in noises:
            scenarios.append(dataclasses.replace(scenario, seed=repeat))
    traces = iter(run(scenarios))
    rows = []
    for _ in range(1 + REPEATS):
        predicted = replays.by_piece(rig, traces)
        rows.append(np.concatenate(list(map(replays.relative, replays.pieces, predicted))))
    expected, *repeats = rows
    moves = [least_squares(J, repeat - expected) for repeat in repeats]
    moved = np.array(moves)
    replays.report(1)
    return np.sqrt(np.mean(moved**2, axis=0))
