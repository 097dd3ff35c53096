"""Public studies that this package runs again (benchmarks/public_studies.py), against RK4 of the
studies' equations, written here from their reports, and against what they print.
"""

import math

import numpy as np
import public_studies as studies
import pytest

import smc_mujoco as smc


def held(slope, command, x, period, substeps, count):
    """States (count + 1, n) and commands under a command that is held over each period."""
    h = period / substeps
    states = [np.array(x, float)]
    commands = []
    for k in range(count):
        x = states[-1]
        u = command(k * period, x)
        for _ in range(substeps):
            k1 = slope(x, u)
            k2 = slope(x + h / 2 * k1, u)
            k3 = slope(x + h / 2 * k2, u)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(x + h * k3, u))
        states.append(x)
        commands.append(u)
    return np.array(states), np.array(commands)


def matrices(q, v, lc1, lc2, i1, i2, load):
    """H, C and g of the report: H q'' + C q' + g = u."""
    (m1, m2), (l1, l2) = (6.0, 4.0), (0.5, 0.4)
    c, k = math.cos(q[1]), l1 * (m2 * lc2 + load * l2) * math.sin(q[1])
    h11 = m1 * lc1**2 + m2 * (lc2**2 + l1**2 + 2 * l1 * lc2 * c)
    h11 += load * (l2**2 + l1**2 + 2 * l1 * l2 * c) + i1 + i2
    h12 = m2 * lc2 * (lc2 + l1 * c) + load * l2 * (l2 + l1 * c) + i2
    lower = (m2 * lc2 + load * l2) * 9.81 * math.cos(sum(q))
    upper = (m2 * l1 + load * l1 + m1 * lc1) * 9.81 * math.cos(q[0])
    inertia = np.array([[h11, h12], [h12, lc2**2 * m2 + l2**2 * load + i2]])
    coriolis = np.array([[-k * v[1], -k * (v[0] + v[1])], [k * v[0], 0.0]])
    return inertia, coriolis, np.array([lower + upper, lower])


def arm_slope(x, u):
    h, c, g = matrices(x[:2], x[2:], 0.2, 0.1, 0.43, 0.05, 0.5)
    return np.append(x[2:], np.linalg.solve(h, u - c @ x[2:] - g))


def arm_command(lam, path):
    def command(t, x):
        q, v = x[:2], x[2:]
        w = 0.2 * math.pi
        r, dr, ddr = np.array([math.pi / 2, -math.pi / 3]), np.zeros(2), np.zeros(2)
        if path:
            turn = np.array([math.sin(w * t), math.cos(w * t)])
            sizes = np.array([math.pi / 6, math.pi / 3])
            r = np.array([math.pi / 4, -math.pi / 3]) + sizes * turn
            dr = sizes * w * np.array([turn[1], -turn[0]])
            ddr = -sizes * w**2 * turn
        h, c, g = matrices(q, v, 0.25, 0.15, 0.2, 0.1, 1.0)
        a = ddr - lam * (v - dr)
        # the report's bounds, of the errors of the guess and not of its squares
        e = 4.0 * 0.25 + 2.0 * 0.4
        cos, k = math.cos(q[1]), 0.5 * e * math.sin(q[1])
        e11 = 6 * 0.3 + 4 * 0.25 * (1 + cos) + 2 * (0.41 + 0.4 * cos) + 0.62
        e12 = 4 * 0.25 * (1 + 0.5 * cos) + 0.8 * (0.4 + 0.5 * cos) + 0.14
        most = np.array([[e11, e12], [e12, 4 * 0.25 + 0.32 + 0.14]])
        turning = k * np.array([[-v[1], -v[0] - v[1]], [v[0], 0.0]])
        lower = e * 9.81 * math.cos(q[0] + q[1])
        weight = np.array([lower + (1.0 + 1.8) * 9.81 * math.cos(q[0]), lower])
        high = most @ abs(a) + turning @ abs(v) + weight + 0.5
        return c @ v + g + h @ a - high * np.clip((v - dr + lam * (q - r)) / 0.1, -1, 1)

    return command


@pytest.mark.parametrize("path", [False, True])
@pytest.mark.parametrize("lam", [3.0, 11.0])
def test_the_arm_is_the_report_s_equation(lam, path):
    goal = studies.PATH if path else studies.STEP
    trace = smc.run(studies.arm(lam, goal, duration=0.05))
    start = [*studies.ARM_START, 0.0, 0.0]
    states, u = held(arm_slope, arm_command(lam, path), start, 5e-5, 1, 1000)
    np.testing.assert_allclose(trace.x[:1001], states[:, :2], atol=1e-7)
    np.testing.assert_allclose(trace.u[:1000], u, rtol=1e-4, atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("lam", studies.PETRIDIS)
def test_the_arm_settles_when_its_report_says(lam):
    """Read off figures: within .3 s, and .6 for the passage of 7 s over the top."""
    times = studies.PETRIDIS[lam][::2]
    traces = smc.run([studies.arm(lam), studies.arm(lam, studies.PATH)])
    for trace, printed in zip(traces, times, strict=True):
        assert studies.settled(trace) == pytest.approx(printed, abs=0.35)


def cart_slope(level):
    def slope(y, u):
        _, q, v, w = y
        mass = np.array([[0.7, 0.04 * math.cos(q)], [0.04 * math.cos(q), 0.008]])
        push = 0.04 * w * w * math.sin(q) + level * np.sign(v) + u
        return np.append(y[2:], np.linalg.solve(mass, [push, 0.04 * 9.81 * math.sin(q)]))

    return slope


def cart_command(t, y):
    x, q, v, w = y
    mass = 0.85 * np.array([[0.7, 0.04 * math.cos(q)], [0.04 * math.cos(q), 0.008]])
    own = np.array([0.02, 0.2]) @ np.linalg.inv(mass)
    drift = own @ (0.85 * np.array([0.04 * w * w * math.sin(q), 0.04 * 9.81 * math.sin(q)]))
    s = 0.02 * v + 0.2 * w + 0.05 * x + 0.5 * q
    return -(drift + 0.05 * v + 0.5 * w + 2.5 * np.clip(s / 0.05, -1, 1)) / own[0]


@pytest.mark.parametrize("level", [0.4, 0.0, -0.4])
def test_the_cart_is_the_study_s_equation(level):
    trace = smc.run(studies.cart(0.6, level))
    start = [0.0, studies.TILT, 0.0, 0.0]
    states, u = held(cart_slope(level), cart_command, start, 2e-3, 2, 250)
    np.testing.assert_allclose(trace.x[:251], states[:, :2], atol=1e-4)
    np.testing.assert_allclose(trace.u[:250, 0], u, atol=0.01)
    for t, row in studies.LIMA.items():
        k = round(t / 2e-3)
        found = (*trace.x[k], trace.u[k - 1, 0])
        assert np.allclose(found, row, rtol=0.01, atol=1e-4) == (level == 0.4 or k == 1)


@pytest.mark.slow
def test_in_forty_seconds_the_cart_s_command_is_that_of_the_study_s_table():
    u = smc.run(studies.cart()).u[:-1, 0]
    assert np.abs(u).mean() == pytest.approx(studies.LIMA_MEAN, rel=0.01)
    assert np.abs(np.diff(u, prepend=0.0)).sum() == pytest.approx(studies.LIMA_STEPS, rel=0.01)
