"""Public studies that this package runs again (benchmarks/public_studies.py): its mechanisms, parts
and sampled loop against RK4 of the studies' equations, and both against what they print.
"""

import math
from types import SimpleNamespace

import numpy as np
import public_studies as studies
import pytest

import smc_mujoco as smc


def held(slope, law, gains, start, goal, period, substeps, count):
    """Positions and u (count, n) of x'' = slope(x, v, u) at the samples of a law that holds u."""
    h = period / substeps
    y = np.array(start, float)
    trajectories = []
    for k in range(count):
        x, v = np.split(y, 2)
        r, dr, ddr = goal(k * period)
        see = {"x": x, "v": v, "e": x - r, "de": v - dr, "ddr": ddr}
        if not law.joint:
            see = {"e": x[0], "de": v[0], "q": x[1], "dq": v[1]}
        u, _ = law.function(SimpleNamespace(**see), SimpleNamespace(**gains), None)
        trajectories.append((x, u))

        def rate(y, u=u):
            return np.append(y[y.size // 2 :], slope(*np.split(y, 2), u))

        for _ in range(substeps):
            k1 = rate(y)
            k2 = rate(y + h / 2 * k1)
            k3 = rate(y + h / 2 * k2)
            y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(y + h * k3))
    x, u = zip(*trajectories, strict=True)
    return np.array(x), np.array(u)


def arm(q, v, u):
    """H q'' + C q' + g = u of the report."""
    c, k = math.cos(q[1]), 0.5 * 0.6 * math.sin(q[1])
    h12 = 0.4 * (0.1 + 0.5 * c) + 0.2 * (0.4 + 0.5 * c) + 0.05
    h11 = 0.24 + 4 * (0.26 + 0.1 * c) + 0.5 * (0.41 + 0.4 * c) + 0.48
    lower = 0.6 * 9.81 * math.cos(q[0] + q[1])
    load = lower + 3.45 * 9.81 * math.cos(q[0]) - k * v[1] * (2 * v[0] + v[1])
    return np.linalg.solve([[h11, h12], [h12, 0.17]], u - [load, lower + k * v[0] ** 2])


def path(t):
    w, sizes = 0.2 * math.pi, np.array([math.pi / 6, math.pi / 3])
    s, c = math.sin(w * t), math.cos(w * t)
    r = np.array([math.pi / 4, -math.pi / 3]) + sizes * [s, c]
    return r, sizes * w * [c, -s], -sizes * w * w * np.array([s, c])


@pytest.mark.parametrize("lam", [3.0, 11.0])
def test_the_arm_is_the_report_s_equation(lam):
    trace = smc.run(studies.arm(lam, studies.PATH, duration=0.05))
    gains = {"lam": lam, "width": 0.1, "c": np.full(2, 0.5)}
    start = [*studies.ARM_START, 0.0, 0.0]
    x, u = held(arm, studies.bounded, gains, start, path, 5e-5, 1, 1000)
    np.testing.assert_allclose(trace.x[:1000], x, atol=1e-7)
    np.testing.assert_allclose(trace.u[:1000], u, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize("level", [0.4, -0.4])
def test_the_cart_is_the_study_s_equation_and_its_rows_are_the_study_s(level):
    def slope(x, v, u):
        lever = 0.04 * math.cos(x[1])
        push = 0.04 * v[1] ** 2 * math.sin(x[1]) + level * np.sign(v[0]) + u
        return np.linalg.solve([[0.7, lever], [lever, 0.008]], [push, 0.3924 * math.sin(x[1])])

    trace = smc.run(studies.cart(0.6, level))
    start = [0.0, studies.TILT, 0.0, 0.0]
    gains = {"eta": 2.5, "width": 0.05}
    x, u = held(slope, studies.combined, gains, start, lambda t: (0, 0, 0), 2e-3, 2, 251)
    np.testing.assert_allclose(trace.x[:251], x, atol=1e-4)
    np.testing.assert_allclose(trace.u[:251, 0], u, atol=0.01)
    for t, row in studies.LIMA.items():
        k = round(t / 2e-3)
        row_simulated = (*trace.x[k], trace.u[k - 1, 0])
        # only with a force that pushes
        assert np.allclose(row_simulated, row, rtol=0.01, atol=1e-4) == (level > 0.0 or k == 1)


@pytest.mark.slow
def test_in_forty_seconds_the_cart_s_command_is_that_of_the_study_s_table():
    u = smc.run(studies.cart()).u[:-1, 0]
    command_figures = np.abs(u).mean(), np.abs(np.diff(u, prepend=0.0)).sum()
    assert command_figures == pytest.approx((studies.LIMA_MEAN, studies.LIMA_STEPS), rel=0.01)


@pytest.mark.quick
@pytest.mark.parametrize(
    ("scenario", "push"),
    [
        (studies.link(), lambda t, x, v: -v - 9.81 * math.sin(x)),
        (studies.unit(), lambda t, x, v: math.sin(2 * t)),
    ],
)
def test_euler_s_steps_as_the_studies_take_them_agree_within_one_percent(scenario, push):
    trace = smc.run(scenario)
    law, h = scenario.law, scenario.control_period
    x, v = trace.x[0, 0], trace.v[0, 0]
    errors = []
    for t, r in zip(trace.t[:-1], trace.r[:-1, 0], strict=True):
        errors.append(x - r)
        see = SimpleNamespace(x=x, e=x - r, de=v)
        u, _ = law.function(see, SimpleNamespace(**law.gains), None)
        x, v = x + h * v, v + h * (u + push(t, x, v))
    np.testing.assert_allclose(trace.e[:-1, 0], errors, atol=0.01 * abs(errors[0]))
