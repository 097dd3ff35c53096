"""References through waypoints: least jerk, smoothness, and a tip that follows a path in space."""

import mujoco
import numpy as np
import pytest
from helpers import arms, reference
from helpers.runs import assert_same
from numpy.polynomial import Polynomial

import smc_mujoco as smc

pytestmark = pytest.mark.quick

TIMES = (0.2, 0.5, 1.3, 1.5, 2.0)
VALUES = (0.1, 0.6, -0.4, 0.0, 0.3)


def of(signal, t):
    """r, r' and r'' at times t."""
    return np.array([signal.value(float(time), None, signal.data) for time in t]).T


def jerk_squared(times, states):
    """The integral of r'''^2 of the quintics through states (r, r', r'') at times."""
    total = 0.0
    for T, start, end in zip(
        np.diff(times),
        states[:-1],
        states[1:],
        strict=True,
    ):
        powers = np.array(
            [
                [T**k, k * T ** (k - 1) if k else 0, k * (k - 1) * T ** (k - 2) if k > 1 else 0]
                for k in range(6)
            ]
        )
        low = np.array([start[0], start[1], start[2] / 2])
        high = np.linalg.solve(powers[3:].T, np.array(end) - powers[:3].T @ low)
        jerk = Polynomial([*low, *high]).deriv(3)
        total += (jerk * jerk).integ()(T)
    return total


def test_waypoints_passes_its_points_and_rests_at_both_ends():
    signal = smc.signals.Waypoints(TIMES, VALUES)
    r, dr, ddr = of(signal, TIMES)
    np.testing.assert_allclose(r, VALUES, atol=1e-15)
    assert dr[[0, -1]].tolist() == ddr[[0, -1]].tolist() == [0.0, 0.0]
    assert of(signal, (-1.0, 5.0)).tolist() == [[0.1, 0.3], [0.0, 0.0], [0.0, 0.0]]
    assert np.abs(dr[1:-1]).min() > 0.1


def test_waypoints_rates_are_derivatives_and_its_fourth_is_continuous():
    signal = smc.signals.Waypoints(TIMES, VALUES)
    h = 1e-4
    t = np.linspace(0.25, 1.95, 200)
    (before, rate, _), (after, later, _) = of(signal, t - h), of(signal, t + h)
    _, dr, ddr = of(signal, t)
    np.testing.assert_allclose((after - before) / (2 * h), dr, atol=1e-5)
    np.testing.assert_allclose((later - rate) / (2 * h), ddr, atol=1e-4)
    for knot in TIMES[1:-1]:
        ends = []
        for x in knot + np.outer((-1, 1), np.linspace(0, 0.15, 12)):
            ends.append(Polynomial.fit(x, of(signal, x)[0], 5).deriv(4)(knot))
        assert ends[0] == pytest.approx(ends[1], rel=1e-4)


def test_waypoints_has_the_least_jerk_of_all_through_its_points():
    data = smc.signals.Waypoints(TIMES, VALUES).data
    rng = np.random.default_rng(0)
    states = data[1:].T
    least = jerk_squared(TIMES, states)
    for _ in range(20):
        moved = states.copy()
        moved[1:-1, 1:] += rng.normal(size=(3, 2)) * (0.01, 0.1)
        assert jerk_squared(TIMES, moved) > least


def test_a_run_follows_waypoints_in_both_loops(tmp_path):
    signals = [
        smc.signals.Waypoints(TIMES, VALUES),
        smc.signals.Waypoints((0.0, 0.3, 2.0), (0.2, 0.4, 0.2)),
    ]
    scenario = smc.Scenario(
        plant="double_pendulum",
        law=smc.law("computed_torque_sliding", k=20.0),
        reference=signals,
        duration=0.6,
        x0=(0.1, 0.2),
    )
    trace = smc.run(scenario)
    assert_same(trace, reference.run(scenario))
    np.testing.assert_array_equal(
        trace.r, np.array([of(signal_of_joint, trace.t)[0] for signal_of_joint in signals]).T
    )
    assert smc.load(trace.save(tmp_path / "a.npz")).scenario == scenario


def tip(x):
    """Where the arm's tip is, by MuJoCo, at positions of reach, turn and lift."""
    model = arms.arm().load()
    data = mujoco.MjData(model)
    data.qpos[[2, 0, 1]] = x
    mujoco.mj_forward(model, data)
    return data.site("tip").xpos.copy()


def test_cartesian_path_moves_the_tip_through_its_points():
    points = [tip((0.1, 0.2, 0.3)), tip((0.0, 1.0, 0.5)), tip((0.2, 0.6, -0.2))]
    times = (0.0, 1.0, 1.8)
    path = smc.signals.cartesian_path(
        arms.arm(),
        times,
        points,
        site="tip",
        x0=(0.1, 0.2, 0.3),
    )
    lines = []
    for i in range(3):
        lines.append(smc.signals.Waypoints(times, [point[i] for point in points]))
    t = np.linspace(0.0, 1.8, 41) + 0.003  # between the knots
    tips = np.array(
        [tip(x) for x in np.array([of(signal_of_joint, t)[0] for signal_of_joint in path]).T]
    )
    np.testing.assert_allclose(
        tips, np.array([of(signal_of_joint, t)[0] for signal_of_joint in lines]).T, atol=2e-6
    )


def test_a_run_of_the_arm_follows_a_path_in_space():
    """Computed torque with the perfect model follows a minimum-jerk path to 1e-6 rad."""
    start = (0.1, 0.2, 0.3)
    path = smc.signals.cartesian_path(
        arms.arm(), (0.0, 1.0), [tip(start), tip((0.2, 1.0, 0.0))], site="tip", x0=start
    )
    trace = smc.run(
        smc.Scenario(
            plant=arms.arm(),
            law=smc.law("computed_torque_sliding", c=20.0, k=40.0),
            reference=path,
            x0=start,
            u_max=1e3,
            duration=1.2,
            control_period=2.5e-4,
        )
    )
    assert np.abs(trace.x - trace.r).max() < 1e-6


ARM = arms.arm
REFUSED = {
    "site": lambda: smc.signals.cartesian_path(ARM(), (0, 1), [(0, 0, 0)] * 2),
    "cart_pole": lambda: smc.signals.cartesian_path(
        "cart_pole", (0, 1), [(0, 0, 0)] * 2, body="cart"
    ),
    "x0 has 9": lambda: smc.signals.cartesian_path(
        ARM(), (0, 1), [(0, 0, 0)] * 2, site="tip", x0=(0.1,) * 9
    ),
}


def test_bad_input_is_one_sentence(refused):
    for word, make in REFUSED.items():
        refused(make, word)


def test_a_point_beyond_reach_is_named_with_its_distance(refused):
    points = [(0.0, 0.0, 0.46), (0.0, 0.0, 9.0)]
    said = (
        "the tip of double_pendulum does not reach (0, 0, 0.4601) m, point 1 of 101 on its path: "
        "it stays 8.",
        "m away; give points within reach, or another x0",
    )
    refused(
        lambda: smc.signals.cartesian_path(
            "double_pendulum",
            (0, 1),
            points,
            body="lower",
        ),
        *said,
    )
