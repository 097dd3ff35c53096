"""What each velocity estimator gives on polynomials, sines and noise, and inside a run."""

import itertools
import math

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from scipy.signal import savgol_coeffs

import smc_mujoco as smc
from smc_mujoco.common.rebuild import rebuild
from smc_mujoco.control.estimator import Reading
from smc_mujoco.simulation import python_functions

pytestmark = pytest.mark.quick

H = 1e-3  # s
FROM_POSITION = [name for name in smc.laws(kind="estimator") if name != "measured"]
ESTIMATORS = pytest.mark.parametrize("name", FROM_POSITION)
SECOND = ("extended_state_observer", "kalman", "integral_chain", "savitzky_golay", "levant")


def both(estimator, x, v=None, h=H):
    """Velocities and accelerations on samples x and sensor readings v, (2, K)."""
    function = rebuild(estimator.function, lambda f: f)
    gains = python_functions.gains_of(estimator)
    memory = np.zeros(estimator.memory)
    x = np.asarray(x, float)
    v = np.zeros_like(x) if v is None else v
    readings = (Reading(h, *xv) for xv in zip(x.tolist(), v.tolist(), strict=True))
    outs = [function(y, gains, memory) for y in readings]
    return np.array([out if isinstance(out, tuple) else (out, 0.0) for out in outs]).T


def estimates(estimator, x, v=None, h=H):
    """The estimator's velocity on samples x and sensor readings v, (K,)."""
    return both(estimator, x, v, h)[0]


def differenced(tau):
    return smc.estimator("filtered_difference", tau=tau)


@pytest.mark.parametrize(
    ("tau", "h"),
    [
        (0.0, 5e-3),
        (1e-3, 1e-3),
        (0.1, 5e-3),
    ],
)
def test_filtered_difference_of_a_ramp_is_its_slope_after_an_exponential(tau, h):
    """v_k = c (1 - a^k), a = tau / (tau + h): exact at once for tau = 0."""
    k = np.arange(3000)
    v = estimates(differenced(tau), 0.7 - 2.0 * k * h, h=h)
    np.testing.assert_allclose(v, -2.0 * (1 - (tau / (tau + h)) ** k), atol=1e-9)


@pytest.mark.parametrize("tau", [0.0, 5e-3, 0.05])
def test_filtered_difference_passes_noise_by_its_formula(tau):
    """The impulse response is (1-a)/h (1, -(1-a), -(1-a) a, ...): its energy is 2 (1-a)^2 / ((1+a)
    h^2).
    """
    gain = math.sqrt(2.0 / ((tau + H) * (2.0 * tau + H)))
    impulse = np.zeros(5000)
    impulse[1] = 1.0
    assert np.linalg.norm(estimates(differenced(tau), impulse)) == pytest.approx(gain, rel=1e-9)


@smc.law_function()
def show_position(y, gains, memory):
    return 0.0, y.x


@smc.law_function()
def show_velocity(y, gains, memory):
    return 0.0, y.v


@smc.law_function()
def show_acceleration(y, gains, memory):
    return 0.0, y.a


@pytest.mark.parametrize(
    ("name", "period"), list(zip(FROM_POSITION, itertools.cycle([1e-3, 5e-3])))
)
def test_in_a_run_every_channel_has_its_own_estimate_of_what_it_measures(name, period):
    """Memory shared between channels or runs, or a dt from elsewhere, would show."""
    estimator = smc.estimator(name)
    common = {
        "plant": "pendulum_network",
        "duration": 0.3,
        "control_period": period,
        "seed": 2,
    }
    common |= {
        "velocity": estimator,
        "noise": smc.Noise(position=0.01, velocity=9.0),
    }
    laws = (show_position(), show_velocity(), show_acceleration(), show_velocity())
    x, v, a, again = (
        trace.s for trace in smc.run([smc.Scenario(law=law, **common) for law in laws])
    )
    np.testing.assert_array_equal(again, v)
    for i in range(5):
        expected = both(estimator, x[:, i], h=period)
        scale = np.abs(expected).max(axis=1) + 1e-3
        np.testing.assert_allclose(
            v[:, i],
            expected[0],
            rtol=0,
            atol=1e-9 * scale[0],
        )
        np.testing.assert_allclose(
            a[:, i],
            expected[1],
            rtol=0,
            atol=1e-9 * scale[1],
        )


# what holds of every estimator


@ESTIMATORS
def test_an_estimate_starts_without_a_kick_is_odd_and_does_not_read_the_velocity_sensor(name):
    np.testing.assert_array_equal(both(smc.estimator(name), np.full(50, 1e3)), np.zeros((2, 50)))
    x, v = np.random.default_rng(0).normal(size=(2, 200))
    np.testing.assert_array_equal(both(smc.estimator(name), x, v), -both(smc.estimator(name), -x))


@pytest.mark.parametrize(("name", "h"), list(zip(FROM_POSITION, itertools.cycle([5e-3, 1e-3]))))
def test_an_estimate_of_a_ramp_is_its_slope_and_no_acceleration(name, h):
    t = np.arange(round(2.0 / h)) * h
    estimator = smc.estimator(name)
    v, a = both(estimator, 5.0 - 3.0 * t, h=h)[:, -100:]
    L = estimator.gains.get("L", 0.0)
    np.testing.assert_allclose(
        v,
        -3.0,
        rtol=0,
        atol=1e-9 + 8 * L * h**2,
    )
    np.testing.assert_allclose(
        a,
        0.0,
        rtol=0,
        atol=1e-6 + 5 * L * h,
    )


@pytest.mark.parametrize("name", SECOND)
def test_an_estimate_of_second_order_is_exact_on_parabolas(name):
    """The integral chain, except for its lag: it gives the velocity of 3 / w before."""
    t = np.arange(3000) * H
    late = 0.0
    if name == "integral_chain":
        late = 3.0 / smc.estimator(name).gains["w"]
    L = smc.estimator(name).gains.get("L", 0.0)
    v, a = both(smc.estimator(name), 1.0 - 3.0 * t + 2.0 * t**2)[:, -100:]
    np.testing.assert_allclose(
        v,
        -3.0 + 4.0 * (t[-100:] - late),
        rtol=0,
        atol=1e-7 + 8 * L * H**2,
    )
    np.testing.assert_allclose(
        a,
        4.0,
        rtol=0,
        atol=1e-4 + 5 * L * H,
    )


# noise gains: white noise passes with the root of the impulse response's energy


def gains_of(name, **gains):
    """Noise gains to velocity and acceleration."""
    impulse = np.zeros(6000)
    impulse[1] = 1.0
    return np.linalg.norm(both(smc.estimator(name, **gains), impulse), axis=1)


@pytest.mark.parametrize("w", [20.0, 100.0, 1000.0])
def test_observers_pass_noise_by_their_formulas(w):
    b = math.exp(-w * H)
    assert gains_of("high_gain", w=w)[0] == pytest.approx(
        math.sqrt(2 * (1 - b) ** 3 / (1 + b) ** 3) / H, rel=1e-6
    )
    v = math.sqrt((1 - b) ** 3 * (13 + 50 * b + 49 * b * b) / (2 * (1 + b) ** 5)) / H
    a = math.sqrt(6 * (1 - b) ** 5 / (1 + b) ** 5) / H**2
    np.testing.assert_allclose(gains_of("extended_state_observer", w=w), [v, a], rtol=1e-6)


# each by itself


@pytest.mark.parametrize("w", [20.0, 100.0, 3000.0])
def test_high_gain_lags_by_two_over_w_on_a_parabola(w):
    """(1 + 3 b) / (2 (1 - b)) periods, which is 2 / w for small w h; stable for any w h."""
    t = np.arange(2000) * H
    b = math.exp(-w * H)
    lag = t - estimates(smc.estimator("high_gain", w=w), t**2 / 2)
    np.testing.assert_allclose(lag[-100:], H * (1 + 3 * b) / (2 * (1 - b)), rtol=1e-6)
    if w * H <= 0.1:
        assert lag[-1] == pytest.approx(2 / w, rel=0.06)


@pytest.mark.parametrize("w", [30.0, 100.0])
def test_the_extended_state_observer_s_errors_are_bounded_by_the_jerk_and_attained(w):
    """|x'' - z3| <= 3 J / w and |x' - z2| <= 3 J / w^2; a cubic attains both."""
    t = np.arange(4000) * 1e-4
    v, a = both(smc.estimator("extended_state_observer", w=w), t**3 / 6, h=1e-4)
    assert t[-1] - a[-1] == pytest.approx(3 / w, rel=0.02)
    assert t[-1] ** 2 / 2 - v[-1] == pytest.approx(3 / w**2, rel=0.02)
    t = np.arange(20_000) * 1e-4
    v, a = both(smc.estimator("extended_state_observer", w=w), np.sin(7 * t), h=1e-4)
    late = t > 20 / w
    assert np.abs(a + 49 * np.sin(7 * t))[late].max() <= 3 * 343 / w
    assert np.abs(v - 7 * np.cos(7 * t))[late].max() <= 3 * 343 / w**2


@pytest.mark.parametrize("lam", [1e-15, 1e-9, 1e-3, 1.0, 1e3, 1e6])
def test_kalman_s_gains_are_those_of_the_riccati_equation(lam):
    """From poles a thousand periods slow to those of a jerk that swamps the noise."""
    A = np.array([[1, 1, 0.5], [0, 1, 1], [0, 0, 1]])
    C = np.array([[1.0, 0.0, 0.0]])
    Q = lam * np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
    P = solve_discrete_are(A.T, C.T, Q, np.eye(1))
    K = P[:, 0] / (P[0, 0] + 1.0)
    z = np.array([0.5, 0.0, 0.0])
    expected = []
    x = np.append(0.5, np.random.default_rng(0).normal(size=200))
    for reading in x:
        z = A @ z
        z = z + K * (reading - z[0])
        expected.append(z[1:])
    for h in (1.0, 1e-3):
        out = both(
            smc.estimator(
                "kalman",
                sigma=0.01,
                q=lam * 1e-4 / h**5,
            ),
            x,
            h=h,
        ) * np.array([[h], [h * h]])
        np.testing.assert_allclose(
            out, np.transpose(expected), rtol=1e-5, atol=1e-7 * np.abs(expected).max()
        )


@pytest.mark.parametrize(
    ("window", "degree"),
    [
        (2, 1),
        (5, 2),
        (15, 3),
        (31, 2),
        (128, 4),
    ],
)
def test_savitzky_golay_is_scipy_s_filter_at_the_last_point(window, degree):
    x = np.random.default_rng(0).normal(size=400)
    out = both(
        smc.estimator(
            "savitzky_golay",
            window=window,
            degree=degree,
        ),
        x,
    )
    for order in (1, 2):
        if degree >= order:
            c = savgol_coeffs(
                window,
                degree,
                deriv=order,
                delta=H,
                pos=window - 1,
                use="dot",
            )
        else:
            c = [0.0]
        expected = np.convolve(x, c[::-1], "valid")[-200:]
        np.testing.assert_allclose(
            out[order - 1, -200:], expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max()
        )


LIGHT_ARM = """<mujoco><worldbody>
<body><joint name="up" axis="0 1 0" damping="0.1" armature="0.01"/>
<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" mass="1"/>
<body pos="0.3 0 0"><joint name="fore" axis="0 1 0" damping="0.1" armature="0.01"/>
<geom type="capsule" fromto="0 0 0 0.25 0 0" size="0.025" mass="0.6"/></body></body>
</worldbody><actuator><motor joint="up" ctrlrange="-20 20"/>
<motor joint="fore" ctrlrange="-8 8"/></actuator></mujoco>"""


def test_levant_needs_an_L_above_the_jerk_of_the_machine_as_its_page_says():
    """The default is for the library's plants; on a light arm the loop diverges."""
    arm = smc.plant_from(LIGHT_ARM, ["up", "fore"])
    pid = smc.law("pid", kp=60.0, ki=20.0, kd=3.0)

    def late_error(velocity):
        fields = {"plant": arm, "law": pid, "x0": 0.3, "velocity": velocity}
        trace = smc.run(smc.Scenario(**fields, duration=5.0))
        return trace, smc.score(trace)["ultimate_bound"]

    measured, least = late_error("measured")
    jerk = abs(np.diff(measured.v, 2, axis=0)).max() / H**2
    acceleration = abs(np.diff(measured.v, axis=0)).max() / H
    assert 4800.0 < jerk < 2e5
    assert late_error("levant")[1] > 1.0
    for chosen in ({"L": 2.0 * jerk}, {"L": 2.0 * acceleration, "order": 1}):
        assert late_error(smc.estimator("levant", **chosen))[1] < 2.0 * least, chosen
