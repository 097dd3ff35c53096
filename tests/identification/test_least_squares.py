"""The parts of identification on a record that a formula makes: y = a f(t) + b g(t) + x0 of each
piece.
"""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import butter, freqz

import smc_mujoco as smc
from smc_mujoco.identification import (
    first_guess,
    gauss_newton,
    inverse_dynamics,
    records,
    replays,
    standard_errors,
)
from smc_mujoco.identification.own_rig import own_rig
from smc_mujoco.identification.replays import Piece, Point, Replays, Slopes
from smc_mujoco.identification.rig import Fall, Quantity, fallen, percentages

pytestmark = pytest.mark.quick

TRUE = np.array([2.0, -0.5])
T = np.linspace(0.0, 1.0, 400)
SPREAD = 4.0


def curves(t):
    return np.column_stack([np.sin(9.0 * t), t**2])


class Curve(Replays):
    """Replays of a formula, which is linear in the quantities a >= 0 and b, and in the offset of
    each of 3 pieces.
    """

    def __init__(self, noise=0.0, start=(1.0, 1.0), spread=SPREAD):
        random = np.random.default_rng(1)
        y = (
            curves(T) @ TRUE
            + 0.3 * np.repeat([1.0, -1.0, 0.5], [150, 150, 100])
            + noise * random.normal(size=T.size)
        )
        self.parts = np.split(np.arange(T.size), [150, 300])
        self.pieces = [
            Piece(0, None, 0, {"y": y[part]}, {"y": spread}, np.ones(1)) for part in self.parts
        ]
        self.names = ["a", "b"]
        self.free = np.arange(1)
        self.data = [None]
        self.evaluations = 0
        self.low = np.array([0.0, -50.0])
        self.high = np.array([80.0, 50.0])
        self.first = start
        self.tried = []

        self.steps = {}
        self.slope_steps = self.rough_steps = {}
        self.corrections = None
        self.step_errors = None
        self.closed = False
        self.report = lambda count: None
        columns = SimpleNamespace(state=(), x=("y",))
        self.twin = SimpleNamespace(
            dynamics=None,
            springs=(),
            hidden=(),
            columns=columns,
            finer=lambda part, times: part,
        )
        self.replayed = []
        self.lag = 0.0

    @property
    def start(self):
        return Point(np.array(self.first), np.zeros((3, 1)))

    def rig(self, point) -> Any:
        plain = SimpleNamespace(
            realistic=self.lag > 0.0,
            control_period=1e-3,
            resolved=SimpleNamespace(physics_step=1e-3),
            input_delay=0.0,
            friction=(),
        )
        return SimpleNamespace(repeated=lambda part: plain)

    def _part(self, k) -> Any:
        return None

    def only(self, indices):
        subset = super().only(indices)
        subset.parts = [self.parts[k] for k in indices]
        return subset

    def _replayed(self, rigs, points, fields):
        """Return the formula, with an error of `lag` times the physics step."""
        self.tried += points
        self.replayed.append(fields)
        error = self.lag * fields.get("physics_step", 0.0)
        return [
            [
                {"y": curves(T[part]) @ point.values + point.states[k] + error * T[part]}
                for k, part in enumerate(self.parts)
            ]
            for point in points
        ]

    def at_rest(self, point):
        return Point(point.values, 0.0 * point.states)


class Bent(Curve):
    """A curve that bends with a, and whose steps of 1 ms err."""

    def _replayed(self, rigs, points, fields):
        step = fields.get("physics_step", 1e-3)
        self.replayed.append((step, len(points)))
        predictions = []
        for point in points:
            a, b = point.values
            columns = []
            for k, part in enumerate(self.parts):
                bent = curves(T[part]) @ [a + (a - TRUE[0]) ** 3, b] + point.states[k]
                columns.append(
                    {"y": bent + 300.0 * step * (curves(T[part])[:, 0] + np.sqrt(T[part]))}
                )
            predictions.append(columns)
        return predictions


class Jumpy(Curve):
    """A curve whose second quantity is a delay of a command that jumps at each sample: within a
    sample of it the slopes by the delay say little of how far it is off. `stuck`: its second piece
    is 0.3 off and fails where its state moves by more than 0.01.
    """

    def __init__(self, start, stuck=False):
        super().__init__(start=start)
        self.names = ["a", "input_delay"]
        self.scales = np.array([1.0, 1e-3])
        self.low = np.zeros(2)
        self.high = np.array([80.0, 50.0])
        self.stuck = stuck
        noise = np.random.default_rng(3).normal(size=600)
        self.command = lambda late: np.interp(T * 400.0 + 100.0 - 2.0 * late, np.arange(600), noise)
        y = 2.0 * np.sin(9.0 * T) + self.command(3.0)
        self.pieces = []
        for k, part in enumerate(self.parts):
            measured = {"y": y[part] + 0.3 * (stuck and k == 1)}
            self.pieces.append(Piece(0, None, 0, measured, {"y": SPREAD}, np.ones(1)))

    def _replayed(self, rigs, points, fields):
        self.tried += points
        predictions = []
        for point in points:
            a, late = point.values
            y = a * np.sin(9.0 * T) + self.command(late)
            columns = []
            for k, part in enumerate(self.parts):
                fails = self.stuck and part[0] == 150 and abs(point.states[k, 0]) > 0.01
                columns.append({"y": y[part] + point.states[k] + 1e3 * fails})
            predictions.append(columns)
        return predictions

    def at_rest(self, point):
        return Point(point.values, 0.0 * point.states + 1.0)


class Rough(Curve):
    """The curve at the true values, with steps that err at random, in proportion to the step."""

    def __init__(self, seed):
        super().__init__(start=TRUE)
        self.seed = seed

    def _replayed(self, rigs, points, fields):
        step = fields.get("physics_step", 1e-3)
        predictions = super()._replayed(rigs, points, fields)
        error = step * np.random.default_rng([self.seed, round(1e7 * step)]).normal(size=T.size)
        for columns in predictions:
            for part, column in zip(self.parts, columns, strict=True):
                column["y"] = column["y"] + error[part]
        return predictions


class Held(Curve):
    """Pieces without quantities, each an offset, whose states up to 2 change nothing."""

    def __init__(self):
        super().__init__(start=())
        self.names = []
        self.low = self.high = np.zeros(0)
        self.pieces = [
            Piece(0, None, 0, {"y": np.full(100, y)}, {"y": SPREAD}, np.ones(1))
            for y in (0.0, 1.0, -0.5)
        ]

    @property
    def start(self):
        return Point(np.zeros(0), np.zeros((len(self.pieces), 1)))

    def _replayed(self, rigs, points, fields):
        self.replayed.append(len(self.pieces))
        predictions = []
        for point in points:
            offsets = np.sign(point.states[:, 0]) * np.maximum(
                np.abs(point.states[:, 0]) - 2.0, 0.0
            )
            predictions.append([{"y": np.full(100, offset)} for offset in offsets])
        return predictions


def block(k, rows):
    """Columns of the quantities and of the three offsets, for the rows of a piece."""
    return np.column_stack([-curves(T[rows]), -np.eye(3)[[k]].repeat(len(rows), 0)]) / SPREAD


@pytest.mark.parametrize(
    "values",
    [
        (1.0, 1.0),
        (0.0, -50.0),
        (80.0, 0.0),
    ],
    ids=["inside", "lowest", "highest"],
)
@pytest.mark.parametrize("central", [True, False])
def test_slopes_are_derivatives_also_at_the_ends_of_ranges(values, central):
    curve = Curve(spread=100.0 * SPREAD)
    slopes = curve.slopes(Point(np.array(values), np.zeros((3, 1))), central)
    for k, part in enumerate(curve.parts):
        exact = block(k, part) / 100.0
        np.testing.assert_allclose(
            np.hstack([slopes.by_values[k], slopes.by_states[k]]),
            exact[:, [0, 1, 2 + k]],
            atol=1e-9,
        )
        expected = (curve.pieces[k].measured["y"] - curves(T[part]) @ values) / SPREAD / 100.0
        np.testing.assert_allclose(slopes.residuals[k], expected, atol=1e-12)
    assert slopes.columns == 1
    assert slopes.records == 1
    assert slopes.fit == pytest.approx(
        100.0 * (1.0 - math.sqrt(sum(np.sum(r**2) for r in slopes.residuals)))
    )


def test_a_step_is_least_squares_with_damping_within_a_factor_of_ten():
    curve = Curve(start=(1.0, 1.0))
    slopes = curve.slopes(curve.start)
    J, r = (np.concatenate(slopes.freed(rows)) for rows in (slopes.by_values, slopes.residuals))
    np.testing.assert_allclose(gauss_newton._moved(curve, slopes, 0.0), TRUE, atol=1e-6)
    damped = np.linalg.solve(J.T @ J * (1.0 + 0.5 * np.eye(2)), -J.T @ r)
    np.testing.assert_allclose(gauss_newton._moved(curve, slopes, 0.5), 1.0 + damped)
    for first, reached in (
        ((0.1, 1.0), 1.0),
        ((25.0, 1.0), 2.5),
        ((1e-4, 1.0), 2.0),
        ((1.1e-4, 1.0), 1.1e-3),
    ):
        curve = Curve(start=first)
        slopes = curve.slopes(curve.start)
        assert gauss_newton._moved(curve, slopes, 0.0)[0] == pytest.approx(reached, rel=1e-3)


def test_a_search_reaches_least_squares_and_tries_no_rival_of_a_good_start():
    curve = Curve(noise=0.002)
    reached = gauss_newton.search(curve, curve.slopes(curve.start), 4, 0, 30, 1e-5)
    rows = np.vstack([block(k, part) for k, part in enumerate(curve.parts)])
    y = np.concatenate([piece.measured["y"] for piece in curve.pieces]) / SPREAD
    exact = np.linalg.lstsq(-rows, y, rcond=None)[0]
    np.testing.assert_allclose(reached.point.values, exact[:2], rtol=1e-6)
    np.testing.assert_allclose(reached.point.states.ravel(), exact[2:], atol=1e-6)
    assert reached.fit > gauss_newton.GOOD_FIT
    assert curve.evaluations < 80
    none = gauss_newton.refine(curve, curve.slopes(curve.start), 0)
    assert none.point is not reached.point
    np.testing.assert_array_equal(none.point.values, curve.start.values)


@pytest.mark.parametrize("late", [1.0, 5.0, 12.0])
def test_a_delay_is_found_from_samples_away_although_its_slopes_say_little(late):
    curve = Jumpy((1.0, late))
    first = curve.slopes(curve.start)
    stalled = gauss_newton.refine(curve, first, 30)
    assert abs(stalled.point.values[1] - 3.0) > 0.3
    reached = gauss_newton.search(curve, first, 1, 0, 30, 1e-5)
    np.testing.assert_allclose(reached.point.values, [2.0, 3.0], atol=1e-3)
    assert gauss_newton._other_delay(curve, reached, 0.01) is None


def test_what_another_delay_changes_is_of_longer_steps_whose_errors_cancel():
    curve = Curve()
    slopes = curve.slopes(curve.start)
    points = [
        Point(curve.start.values + np.array([0.0, move]), curve.start.states) for move in (0.1, 0.2)
    ]
    exact = curve.residuals(points)
    curve.rough_steps, curve.lag = {"physics_step": 1e-3}, 50.0
    curve.replayed.clear()
    for rows, expected in zip(curve.delayed(slopes, points), exact, strict=True):
        for row, right in zip(rows, expected, strict=True):
            np.testing.assert_allclose(row, right, atol=1e-12)
    assert curve.replayed == [{"physics_step": 1e-3}]
    assert not curve.steps


def test_a_step_that_promises_less_than_the_search_asks_is_not_replayed():
    curve = Curve(noise=0.05, start=(1.0, 1.0))
    slopes = curve.slopes(curve.start)
    curve.replayed.clear()
    gauss_newton.refine(curve, slopes, 30, 0.01, rough=True)
    assert len(curve.replayed) == 1


def test_starts_of_pieces_that_are_off_do_not_keep_a_search_of_numbers_going():
    """They promise most of the cost, and a piece whose start is stuck does so step after step."""
    curve = Curve(noise=0.05)
    solved = gauss_newton.refine(curve, curve.slopes(curve.start), 5).point
    slopes = curve.slopes(Point(solved.values, solved.states + 1.0))
    assert gauss_newton._promise(curve, slopes) > 0.9 * slopes.cost
    assert gauss_newton._share_of_numbers(curve, slopes) < 1e-6
    assert gauss_newton._share_of_numbers(curve, curve.slopes(curve.start)) > 0.9


def test_residuals_that_are_there_are_not_replayed_again_for_slopes():
    curve = Curve()
    curve.slope_steps = {"physics_step": 1e-3}
    exact = curve.residuals([curve.start])[0]
    curve.replayed.clear()
    slopes = curve.slopes(curve.start, residuals=exact)
    assert slopes.residuals is exact
    assert curve.replayed == [{"physics_step": 1e-3}]


def test_the_last_delay_is_the_one_that_fits_and_its_error_has_the_move():
    curve = Jumpy((2.0, 2.4))
    first = curve.slopes(curve.start)
    assert abs(gauss_newton._solved(curve, first).point.values[1] - 3.0) > 0.2
    reached, moved = gauss_newton.extrapolated(curve, first, 1)
    assert abs(reached.point.values[1] - 3.0) < 0.1
    assert moved[1] >= 0.25
    at_truth = curve.slopes(Point(np.array([2.0, 3.0]), curve.start.states))
    reached, moved = gauss_newton.extrapolated(curve, at_truth, 1)
    assert moved[1] < 1e-6


def test_a_piece_whose_start_may_not_move_does_not_stop_the_others():
    curve = Jumpy((1.0, 3.2), stuck=True)
    reached = gauss_newton.refine(curve, curve.slopes(curve.start), 30)
    np.testing.assert_allclose(reached.point.values, [2.0, 3.0], atol=1e-3)
    assert reached.point.states[1] == 0.0


def test_a_joint_that_shakes_does_not_decide_the_start_of_what_a_calm_one_tells():
    random = np.random.default_rng(3)
    A = random.normal(size=(400, 2))
    A[0::2, 0] = 0.0  # the first number is that of the second joint, which is calm
    b = A @ [1.5, -2.0] + random.normal(size=400) * np.tile([5.0, 1e-3], 200)
    solution, noise = first_guess._weighted(A, b, 2)
    np.testing.assert_allclose(solution, [1.5, -2.0], atol=1e-3)
    rests = np.sqrt(np.mean((b - A @ solution).reshape(-1, 2) ** 2, axis=0))
    assert noise == pytest.approx(np.log(rests).sum(), rel=1e-3)
    exact, _ = first_guess._weighted(A, A @ [1.5, -2.0], 2)
    np.testing.assert_allclose(exact, [1.5, -2.0], atol=1e-9)


def test_further_starts_are_the_best_of_many_within_ranges():
    curve = Curve(start=(0.5, 30.0))
    points = gauss_newton._random(curve, 3, 7)
    drawn = np.array([point.values for point in curve.tried])
    assert np.all((drawn >= [0.01, -50.0]) & (drawn <= [80.0, 50.0]))
    costs = curve.costs(list(curve.tried)).sum(axis=1).tolist()
    assert curve.costs(points).sum(axis=1).tolist() == sorted(costs)[:3]


def test_a_solution_that_is_worse_than_the_start_is_not_kept():
    curve = Curve(start=tuple(TRUE))
    bad = curve.slopes(Point(np.array([1.5, 3.0]), np.zeros((3, 1))))
    better = gauss_newton.not_worse(curve, bad)
    np.testing.assert_allclose(better.point.values, TRUE, atol=1e-6)
    assert gauss_newton.not_worse(curve, better) is better


def test_a_jackknife_leaves_out_one_block_after_the_other():
    curve = Curve(noise=0.05)
    slopes = gauss_newton.refine(curve, curve.slopes(curve.start), 5)
    parts = math.ceil(standard_errors._blocks(slopes) / 3)
    rows = np.vstack([block(k, part) for k, part in enumerate(curve.parts)])
    y = np.concatenate(slopes.residuals)
    blocks = np.concatenate(
        [
            k * parts + np.arange(len(part)) * parts // len(part)
            for k, part in enumerate(curve.parts)
        ]
    )
    without_block = np.array(
        [
            np.linalg.lstsq(rows[blocks != b], y[blocks != b], rcond=None)[0][:2]
            for b in range(3 * parts)
        ]
    )
    solution = np.linalg.lstsq(rows, y, rcond=None)[0][:2]
    expected = (
        (len(without_block) - 1)
        / len(without_block)
        * (without_block - solution).T
        @ (without_block - solution)
    )
    np.testing.assert_allclose(standard_errors.jackknife(slopes), expected, rtol=1e-6)
    noise = 0.05 / SPREAD * np.sqrt(np.diag(np.linalg.inv(rows.T @ rows))[:2])
    np.testing.assert_allclose(np.sqrt(np.diag(expected)), noise, rtol=0.35)


def test_slow_residuals_widen_standard_errors_where_the_blocks_of_the_jackknife_are_too_short():
    """Of 40 lines through 400 samples, whose errors last 50 samples, or are independent."""
    random = np.random.default_rng(3)
    J = np.column_stack([np.ones(400), np.linspace(-1.0, 1.0, 400)])
    inverse_normal = np.linalg.inv(J.T @ J)
    for memory, low, high in (
        (0.96, 0.7, 1.7),
        (0.0, 0.7, 1.3),
    ):
        shares = []
        blocks = []
        for _ in range(40):
            noise = random.normal(size=400)
            for k in range(1, 400):
                noise[k] += memory * noise[k - 1]
            r = noise - J @ (inverse_normal @ (J.T @ noise))
            slopes = Slopes(
                Point(np.zeros(2), np.zeros((1, 0))), [r], [J], [np.zeros((400, 0))], 1, 1
            )
            moved = inverse_normal @ (J.T @ noise)
            shares.append(
                moved
                / standard_errors.by_correlation(slopes, J, standard_errors.independent(slopes))
            )
            blocks.append(moved / np.sqrt(np.diag(standard_errors.jackknife(slopes))))
        assert low < np.sqrt(np.mean(np.square(shares))) < high
        assert (np.sqrt(np.mean(np.square(blocks))) > 2.0) == (memory > 0.0)


@pytest.mark.parametrize(
    ("value", "least", "most", "scale"),
    [
        (3.0, 0.0, 100.0, 3.0),
        (-0.2, 0.0, 100.0, 1.0),
        (0.0, 0.0, math.inf, 1e-3),
        (0.2, -math.inf, 1.0, 0.2),
    ],
)
def test_a_quantity_has_the_scale_of_its_value_or_a_hundredth_of_its_range(
    value, least, most, scale
):
    assert replays._scale(Quantity(value, "", "given here", least, most)) == pytest.approx(scale)


def test_corrected_replays_have_steps_that_divide_the_period():
    plain = smc.Scenario(plant="duffing", law=smc.law("pid"), control_period=0.0011)
    assert replays._steps(plain, 0) == {"integrator": "RK4", "physics_step": pytest.approx(2.2e-4)}
    assert replays._steps(plain, 2)["physics_step"] == pytest.approx(5.5e-5)
    even = smc.Scenario(plant="duffing", law=smc.law("pid"), control_period=0.001)
    assert replays._steps(even, 1)["physics_step"] == pytest.approx(1.25e-4)
    late = smc.Scenario(
        plant="duffing",
        law=smc.law("pid"),
        input_delay=0.003,
        friction=smc.hardware.LuGre(0.3, 0.4, 0.01),
    )
    assert replays._steps(late, 1)["integrator"] == "implicitfast"
    assert replays._steps(late, 1)["physics_step"] == late.resolved.physics_step / 2


def test_replays_are_corrected_by_what_two_step_sizes_leave():
    curve = Curve()
    assert not curve.correct(curve.start, 1)  # an ideal machine's steps do not err
    assert curve.short_steps == {}
    exact, curve.lag = curve.predicted([curve.start]), 800.0
    assert curve.correct(curve.start, 2)
    assert [columns["physics_step"] for columns in curve.replayed[-3:]] == [
        2.5e-4,
        1.25e-4,
        6.25e-5,
    ]
    (predicted,) = curve.predicted([curve.start])
    for columns, uncorrected in zip(predicted, exact[0], strict=True):
        np.testing.assert_allclose(columns["y"], uncorrected["y"], atol=1e-12)
    assert curve.short_steps == {"integrator": "RK4", "physics_step": 6.25e-5}
    slopes = curve.slopes(curve.start)
    curve.replayed.clear()
    sharp = curve.sharpened(slopes)
    assert {columns["physics_step"] for columns in curve.replayed} == {6.25e-5}
    assert sharp.residuals is slopes.residuals
    assert curve.steps == {"integrator": "RK4", "physics_step": 2.5e-4}
    for closed in (
        {"closed": True},
        {"twin": SimpleNamespace(dynamics=None, springs=(), columns=SimpleNamespace(state=("y",)))},
    ):
        uncorrected = Curve()
        vars(uncorrected).update(closed, lag=800.0)
        assert not uncorrected.correct(uncorrected.start, 1)


def test_replays_are_solved_for_steps_of_0_with_the_slopes_of_longer_ones():
    curve = Bent()
    searched = gauss_newton.search(curve, curve.slopes(curve.start), 1, 0, 30, 1e-5)
    reached = curve.slopes(searched.point)
    assert abs(reached.point.values[0] - TRUE[0]) > 0.1  # by the error of the steps
    curve.replayed.clear()
    solved, moved = gauss_newton.extrapolated(curve, reached, 30)
    np.testing.assert_allclose(solved.point.values, TRUE, atol=1e-5)
    assert (moved < 1e-3).all()
    assert max(count for _, count in curve.replayed) <= len(gauss_newton.SHARES) + 1
    once, _ = gauss_newton.extrapolated(curve, reached)
    assert abs(once.point.values[0] - TRUE[0]) > 5e-3  # one step of derivatives is not enough


def test_what_steps_leave_is_the_error_of_the_extrapolation_where_they_err_at_random():
    """The told deviation is that of 2 x(h/4) - x(h/2), in the mean over 200 draws: within 10 %, three
    deviations of that mean.
    """
    off, expected = [], []
    for seed in range(200):
        curve = Rough(seed)
        solved, moved = gauss_newton.extrapolated(curve, curve.slopes(curve.start))
        off.append(solved.point.values - curve.start.values)
        expected.append(moved)
    ratio = np.sqrt(np.mean(np.square(expected)) / np.mean(np.square(off)))
    assert 0.9 < ratio < 1.1


def test_a_piece_that_is_held_at_its_start_is_fitted_from_other_velocities():
    curve = Held()
    reached = gauss_newton.fit_starts(curve, 12)
    np.testing.assert_allclose(reached.point.states.ravel(), [0.0, 3.0, -2.5], atol=1e-6)
    assert reached.cost < 1e-12
    after = curve.replayed.index(2)
    assert set(curve.replayed[:after]) == {3}
    assert set(curve.replayed[after:]) == {2}  # a piece that has its start is left alone


def test_a_record_is_cut_into_pieces_of_its_window():
    """3.3 s of which each second is one piece, with the scales of its motion."""
    t = 1e-3 * np.arange(3301)
    record = {
        "t": t,
        "x": 0.3 * np.sin(5.0 * t),
        "u": np.cos(3.0 * t),
    }
    twin, data = own_rig(smc.plant("servo_axis"), ["M", "b"]), [record]
    cut = Replays(twin, ["M", "b"], data, False, lambda count: None)
    assert [len(piece.measured["x"]) for piece in cut.pieces] == [1101, 1101, 1101]
    scales = 0.05 * np.array([np.std(0.3 * np.sin(5.0 * t)), np.std(1.5 * np.cos(5.0 * t))])
    spread = np.linalg.norm(record["x"] - record["x"].mean())
    for piece in cut.pieces:
        np.testing.assert_allclose(piece.scales, scales, rtol=1e-4)
        assert piece.spread == {"x": pytest.approx(spread)}
        assert piece.skipped == 0
    assert cut.free.tolist() == [0, 1]
    state = cut.state(Point(cut.start.values, np.tile([2.0, -1.0], (3, 1))), 1)
    np.testing.assert_allclose(
        state, [0.3 * np.sin(5.5), 1.5 * np.cos(5.5)] + scales * [2.0, -1.0], rtol=1e-3
    )
    rest = cut.at_rest(cut.start)
    np.testing.assert_allclose(
        np.array([cut.state(rest, k) for k in range(3)])[:, 1], 0.0, atol=1e-12
    )
    assert (
        len(
            Replays(
                twin,
                ["M"],
                data,
                False,
                lambda count: None,
                whole=True,
            ).pieces
        )
        == 1
    )
    np.testing.assert_allclose(cut.start.values * cut.scales, [twin.values["M"], twin.values["b"]])
    np.testing.assert_allclose(cut.low * cut.scales, [1e-6, 0.0])


def test_residuals_are_shares_of_the_spread_up_to_the_worst():
    curve = Curve()
    piece = Piece(0, None, 0, {"y": np.zeros(4), "z": np.ones(4)}, {"y": 2.0, "z": 4.0}, np.ones(1))
    predicted = {
        "y": np.array([1.0, -5.0, np.nan, np.inf]),
        "z": np.array([0.0, 1.0, 2.0, -np.inf]),
    }
    assert curve.relative(piece, predicted).tolist() == [
        -0.5,
        0.25,
        1.0,
        0.0,
        1.0,
        -0.25,
        -1.0,
        1.0,
    ]
    assert replays._norm(np.array([1.0, 3.0])) == pytest.approx(math.sqrt(2.0))
    assert replays._norm(np.ones(3)) == 1.0


@pytest.mark.parametrize("hertz", [0.8, 3.0, 5.0, 8.0])
def test_torques_above_5_hz_are_left_out_by_four_poles_forward_and_backward(hertz):
    t = 0.002 * np.arange(10_001)
    columns = records.Columns(torque=("tau",))
    data = {"t": t, "tau": np.sin(math.tau * hertz * t)}
    (low,), times = (
        inverse_dynamics.measured_torque(data, columns).values(),
        inverse_dynamics.times(data, columns),
    )
    np.testing.assert_allclose(np.diff(times), 0.01, rtol=1e-9)
    assert times[0] == pytest.approx(0.1)
    assert times[-1] == pytest.approx(19.9)
    _, gain = freqz(*np.array(butter(4, 5.0, fs=100.0)), worN=[hertz], fs=100.0)
    middle = slice(300, -300)
    np.testing.assert_allclose(
        low[middle], abs(gain[0]) ** 2 * np.sin(math.tau * hertz * times[middle]), atol=6e-3
    )


def test_a_twin_falls_beyond_two_ranges_from_when_it_was_one_range_off():
    t = np.linspace(10.0, 14.0, 5)
    measured = {"x": np.array([0.0, 1.0, 0.5, 0.0, 1.0]), "y": np.zeros(5)}
    near = {"x": np.array([0.0, 2.0, 2.5, 2.0, 2.0]), "y": np.full(5, 9.0)}  # y has no range
    assert fallen(near, measured, t) is None
    far = {"x": np.array([0.0, 2.0, 1.6, 2.1, 2.0])}
    fall = fallen(far, measured, t)
    assert isinstance(fall, Fall)
    assert fall.time == 12.0
    assert fall == -math.inf
    assert str(fall) == "falls at 12.0 s"
    assert fallen({"x": np.array([0.0, 1.0, np.nan, 0.0, 1.0])}, measured, t) == -math.inf
    fit = percentages({"x": measured["x"] + 0.25, "y": np.ones(5)}, measured)
    norm = np.linalg.norm(measured["x"] - 0.5)
    assert fit == {"x": pytest.approx(100.0 * (1.0 - 0.25 * math.sqrt(5.0) / norm)), "y": -1e3}


def of_lines(noise, J, pieces, values):
    """Slopes at the least squares of a linear curve without states, in pieces."""
    residuals = noise - J @ np.linalg.lstsq(J, noise, rcond=None)[0]
    none = [np.zeros((len(J) // pieces, 0))] * pieces
    point = Point(np.array(values), np.zeros((pieces, 0)))
    return Slopes(point, np.split(residuals, pieces), np.split(J, pieces), none, 1, 1)


def replays_of(pieces, scales, records=None):
    """What `statistics` asks of replays."""
    of_records = [SimpleNamespace(record=k) for k in records or [0] * pieces]
    names = [f"q{k}" for k in range(len(scales))]
    return SimpleNamespace(names=names, scales=np.array(scales), pieces=of_records, closed=False)


def test_errors_and_correlations_are_those_of_a_linear_curve_of_known_covariance():
    """Of 40 draws of white noise: neither half as large nor twice, and their correlation."""
    random = np.random.default_rng(2)
    t = np.linspace(0.0, 1.0, 240)
    J = np.column_stack([np.ones_like(t), t])
    covariance = 0.01 * np.linalg.inv(J.T @ J)
    exact = np.sqrt(np.diag(covariance)) * [2.0, 5.0]  # in the scales of the numbers
    ratios = []
    correlations = np.eye(2)
    for _ in range(40):
        slopes = of_lines(0.1 * random.standard_normal(240), J, 4, [1.0, 1.0])
        errors, correlations = standard_errors.statistics(
            replays_of(4, [2.0, 5.0]), slopes, np.zeros(2)
        )
        ratios.append(np.array(list(errors.values())) / exact)
    assert np.all((np.mean(ratios, axis=0) > 0.9) & (np.mean(ratios, axis=0) < 1.6))
    expected = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    assert correlations[0, 1] == pytest.approx(expected)


def test_the_model_s_part_of_an_error_is_added_as_a_square():
    random = np.random.default_rng(3)
    J = np.ones((100, 1))
    slopes = of_lines(0.1 * random.standard_normal(100), J, 4, [1.0])
    (plain,) = standard_errors.statistics(replays_of(4, [3.0]), slopes, np.zeros(1))[0].values()
    by_model = np.array([0.5])
    (with_model,) = standard_errors.statistics(replays_of(4, [3.0]), slopes, by_model)[0].values()
    assert with_model == pytest.approx(math.hypot(plain, 1.5))


@pytest.mark.parametrize("records", [None, [0, 0, 1, 1]], ids=["pieces", "records"])
def test_pieces_and_records_that_disagree_widen_the_error(records):
    """A step of 1 between pieces, or between records, of white noise of 0.01."""
    random = np.random.default_rng(4)
    level = np.repeat([0.5, -0.5, 0.5, -0.5] if records is None else [0.5, 0.5, -0.5, -0.5], 25)
    J = np.ones((100, 1))
    slopes = of_lines(level + 0.01 * random.standard_normal(100), J, 4, [1.0])
    replayed = replays_of(4, [1.0], records)
    (error,) = standard_errors.statistics(replayed, slopes, np.zeros(1))[0].values()
    groups = records or [0, 1, 2, 3]
    assert error >= standard_errors.between(slopes, groups)[0] * (1.0 - 1e-12)
    # with the information of each group left out of what the others tell
    expected = 0.5 / math.sqrt(len(set(groups)) - 1)
    assert standard_errors.between(slopes, groups)[0] == pytest.approx(expected, rel=0.1)
