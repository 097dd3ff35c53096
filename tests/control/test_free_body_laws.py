"""Laws of free bodies on a Crazyflie: the closed forms of steady errors, the shorter way, and a lemniscate."""

import math

import numpy as np
import pytest
from numba import njit
from scipy.spatial.transform import Rotation

import smc_mujoco as smc
from smc_mujoco.common.files import shipped
from smc_mujoco.control.attitude import of_thrust, rate_of
from smc_mujoco.control.units import Gain

TEXT = (shipped("models").parent / "examples" / "quadrotor.xml").read_text(encoding="utf-8")
J, G = 16.8e-6, 9.81
TORQUE = 3e-4  # N m


@pytest.fixture(scope="module")
def drone():
    return smc.plant_from(TEXT, channels=["body"], name="drone", keyframe="hover")


def pushed(law):
    """A law of the library with a constant torque about the roll axis added to what it commands."""
    base = njit(law.function)
    gains = {name: Gain(value, shared=True) for name, value in law.gains.items()}

    @smc.law_function(joint=True, requires_model=True, plants=("a free body",), gains=gains, memory=law.memory)
    def with_torque(y, gains, memory):
        u, s = base(y, gains, memory)
        u[3] += TORQUE
        return u, s

    return with_torque


def sag(K, rho, c, heavier):
    return math.atanh((heavier - 1.0) * G / K) / (rho * c)


@pytest.mark.parametrize(
    ("law", "expected"), [("quaternion_sliding", sag(5.0, 1.0, 1.25, 1.19)), ("geometric", 0.19 * G / 7.0)]
)
def test_an_unknown_weight_sags_by_the_closed_form(drone, law, expected):
    scenario = smc.Scenario(plant=drone, law=law, mismatch={"m": 1.19}, duration=12.0, control_period=2e-3)
    assert -smc.run(scenario).e[-1, 2] == pytest.approx(expected, rel=1e-3)


def test_an_unknown_torque_turns_the_body_by_the_closed_form(drone):
    """The body hovers level, so that the wanted attitude is the one that is off, and the position with it."""
    law, common = smc.law("quaternion_sliding"), {"plant": drone, "duration": 10.0, "control_period": 2e-3}
    s = math.atanh(TORQUE / (J * law.gains["K"])) / law.gains["rho"]
    trace = smc.run(smc.Scenario(law=pushed(law), **common))
    assert trace.s[-1, 3] == pytest.approx(s, rel=1e-6)
    tilt = 2.0 * math.asin(s / law.gains["lam"])  # of the wanted thrust, m (c Kx rhox e) sideways and m g upwards
    sideways = 5.0 * math.tanh(1.25 * abs(trace.e[-1, 1])) / G
    assert math.atan(sideways) == pytest.approx(tilt, rel=1e-4)
    law = smc.law("geometric")
    trace = smc.run(smc.Scenario(law=pushed(law), **common))
    assert math.atan(7.0 * abs(trace.e[-1, 1]) / G) == pytest.approx(math.asin(TORQUE / (J * 421.7)), rel=1e-4)


@pytest.mark.parametrize(
    ("law", "published"),
    [(smc.law("quaternion_sliding"), (0.0016, 0.0068)), (smc.law("geometric", kv=2.0), (0.0038, 0.0148))],
    ids=["quaternion_sliding", "geometric"],
)
def test_errors_on_a_lemniscate_are_of_the_size_of_another_coding(drone, law, published):
    """Periods of 6 and 4 s, rms of the position's error in the second lap: that coding had other rotors."""
    rms = []
    for period in (6.0, 4.0):
        w = math.tau / period
        path = [smc.Sine(1.0, w), smc.Sine(0.5, 2.0 * w), smc.Constant(1.0), *[smc.Constant(0.0)] * 3]
        start = {"v0": (w, w, 0.0, 0.0, 0.0, 0.0), "duration": 2.0 * period, "control_period": 2e-3}
        trace = smc.run(smc.Scenario(plant=drone, law=law, reference=path, **start))
        rms.append(float(np.sqrt(np.mean(np.sum(trace.e[len(trace.t) // 2 :, :3] ** 2, axis=1)))))
    assert rms == pytest.approx(published, rel=0.25)


@pytest.mark.parametrize("law", ["quaternion_sliding", "geometric"])
def test_a_turn_across_the_back_takes_the_shorter_way(drone, law):
    """From a heading of 160 to one of -160 degrees it turns by 40 degrees, not by 320, as from 40 to 0."""
    paths = []
    for start, end in ((160.0, -160.0), (40.0, 0.0)):
        goal = [smc.Constant(value) for value in (0.0, 0.0, 1.0, 0.0, 0.0, math.radians(end))]
        at = (0.0, 0.0, 1.0, 0.0, 0.0, math.radians(start))
        trace = smc.run(smc.Scenario(plant=drone, law=law, x0=at, reference=goal, duration=4.0))
        paths.append(math.degrees(np.trapezoid(np.abs(trace.v[:, 5]), trace.t)))
        assert np.abs(trace.e[-1]).max() < 0.01
    assert paths[0] == pytest.approx(paths[1], rel=1e-6)  # q and -q are the same attitude
    assert 39.0 < paths[0] < 60.0


@pytest.mark.parametrize("law", ["quaternion_sliding", "geometric"])
def test_it_recovers_from_upside_down(drone, law):
    """170 degrees of roll, turning, at rest in the air with room below."""
    start = {"x0": (0.0, 0.0, 30.0, math.radians(170.0), 0.0, 0.0), "v0": (0.0, 0.0, 0.0, 10.0, 5.0, 3.0)}
    goal = [smc.Constant(value) for value in (0.0, 0.0, 30.0, 0.0, 0.0, 0.0)]
    trace = smc.run(smc.Scenario(plant=drone, law=law, reference=goal, duration=14.0, control_period=2e-3, **start))
    assert np.abs(trace.e[-1]).max() < 0.05
    assert trace.x[:, 2].min() > 15.0


@pytest.mark.parametrize(("law", "kq", "kw"), [("geometric", 421.7, 69.27), ("quaternion_sliding", 400.0, 104.0)])
def test_noise_leaves_millimetres_and_a_delay_beyond_the_margin_of_the_attitude_loses_it(drone, law, kq, kw):
    """With w' = -kw w - kq angle behind the rotors' lag, whose phase at the crossover decides; no path, all gains
    published. Wanted attitudes from sample to sample lost the drone in noise: 28 and 77 m.
    """
    w = np.geomspace(1.0, 100.0, 100_000)
    loop = (1j * w * kw + kq) / ((1j * w) ** 2 * (0.0625j * w + 1.0))
    cross = np.argmax(np.abs(loop) < 1.0)
    margin = (math.pi + np.angle(loop[cross])) / w[cross]
    common = {"plant": drone, "law": law, "x0": (0.2, -0.2, 1.2, 0.2, -0.2, 0.2), "duration": 8.0}
    noisy = {"noise": smc.Noise(0.01, 0.05), "input_delay": 5e-3}
    seen, lost = smc.run([smc.Scenario(**common, **noisy), smc.Scenario(**common, input_delay=10e-3)])
    assert np.abs(seen.e[len(seen.t) // 2 :, :3]).max() < 0.02
    assert 5e-3 < margin < 10e-3
    assert np.abs(lost.e[-1, :3]).max() > 10.0


def test_a_law_of_less_gain_stands_noise_and_ten_milliseconds(drone):
    law = smc.law("geometric", kx=2.0, kv=2.0, kR=120.0, kW=24.0)  # of the firmware's INDI
    noisy = {"noise": smc.Noise(0.01, 0.05), "input_delay": 10e-3}
    trace = smc.run(smc.Scenario(plant=drone, law=law, x0=(0.2, -0.2, 1.2, 0.2, -0.2, 0.2), duration=8.0, **noisy))
    assert np.abs(trace.e[len(trace.t) // 2 :, :3]).max() < 0.02


def rate_by_differences(F, r, dr, h=1e-6):
    """Of the wanted attitude, where force and heading are functions of time."""
    turns = [Rotation.from_quat(of_thrust(F(t), r + t * dr), scalar_first=True) for t in (-h, h)]
    return (turns[0].inv() * turns[1]).as_rotvec() / (2.0 * h)


@pytest.mark.parametrize("F", [(0.1, -0.2, 0.3), (0.5, 0.1, -0.2), (-0.3, 0.9, -2.0)])
def test_the_rate_of_the_wanted_attitude_is_that_of_its_differences(F):
    F, dF, r, dr = (np.array(one) for one in (F, (0.4, -1.1, 0.8), (0.2, -0.3, 0.6), (1.0, 0.5, -2.0)))
    expected = rate_by_differences(lambda t: F + t * dF, r, dr)
    np.testing.assert_allclose(rate_of(of_thrust(F, r), F, dF, r, dr), expected, rtol=1e-6, atol=1e-7)


def test_the_rate_of_an_attitude_along_the_heading_turns_with_it():
    r, dr = np.array([0.2, -0.3, 0.6]), np.array([1.0, 0.5, -2.0])

    def F(t):
        return Rotation.from_rotvec(r + t * dr).apply([0.7, 0.0, 0.0])

    dF = (F(1e-6) - F(-1e-6)) / 2e-6
    expected = rate_by_differences(F, r, dr)
    np.testing.assert_allclose(rate_of(of_thrust(F(0.0), r), F(0.0), dF, r, dr), expected, rtol=1e-6, atol=1e-7)


def attitude_of(F, heading):
    """The rotation whose third axis is along F, and whose first is nearest to the heading."""
    z = F / np.linalg.norm(F)
    y = np.cross(z, Rotation.from_rotvec(heading).apply([1.0, 0.0, 0.0]))
    y /= np.linalg.norm(y)
    return Rotation.from_matrix(np.column_stack([np.cross(y, z), y, z]))


def geometric_torque(error, turning):
    E = error.as_matrix()
    antisymmetric = 0.5 * (E - E.T)
    return -421.7 * np.array([antisymmetric[2, 1], antisymmetric[0, 2], antisymmetric[1, 0]]) - 69.27 * turning


def sliding_torque(error, turning):
    q = error.as_quat(scalar_first=True, canonical=True)
    rate = 0.5 * (q[0] * turning + np.cross(q[1:], turning))
    return -8.0 * rate - 400.0 * np.tanh(0.25 * (turning + 8.0 * q[1:]))


@pytest.mark.parametrize(
    ("law", "force", "torque"),
    [
        ("geometric", lambda e, de: -7.0 * e - 4.0 * de, geometric_torque),
        ("quaternion_sliding", lambda e, de: -1.25 * de - 5.0 * np.tanh(de + 1.25 * e), sliding_torque),
    ],
)
def test_commands_of_a_body_that_tumbles_are_the_formula_coded_again(drone, law, force, torque):
    """By rotation matrices, on a path that turns its heading. The inertia is not that of a ball, so w x J w counts."""
    path = [smc.Sine(0.5, 2.0), smc.Sine(0.4, 3.0), smc.Sine(0.3, 1.0), *[smc.Constant(0.0)] * 2, smc.Sine(0.8, 4.0)]
    start = {"x0": (0.3, -0.2, 1.0, 0.4, -0.3, 0.2), "v0": (0.5, -0.4, 0.3, 6.0, -9.0, 7.0)}
    body = smc.plant_from(TEXT.replace('"16.8e-6 16.8e-6', '"12e-6 20e-6'), channels=["body"], keyframe="hover")
    trace = smc.run(smc.Scenario(plant=body, law=law, reference=path, duration=0.1, control_period=2e-3, **start))
    J, dt, before, limits = np.diag([12e-6, 20e-6, 29.8e-6]), 2e-3, None, np.array(trace.scenario.limits)
    free, h = 0, 1e-5  # torques within their bounds
    for k, t in enumerate(trace.t[:-1]):
        r, dr, ddr = (np.array([of(one, t) for one in path[:3]]) for of in (value, rate, acceleration))
        R, w, e, de = (
            Rotation.from_rotvec(trace.x[k, 3:].copy()), trace.v[k, 3:], trace.x[k, :3] - r, trace.v[k, :3] - dr,
        )  # fmt: skip
        slow, earlier = before or (de, ddr)
        slow = (slow + dt * 10.0 * de) / (1.0 + dt * 10.0)  # the implicit step of slow' = 10 (de - slow)
        dde, jerk, before = 10.0 * (de - slow), (ddr - earlier) / dt, (slow, ddr)

        def wanted(ahead, t=t, e=e, de=de, ddr=ddr, dde=dde, jerk=jerk):
            F = 0.0319 * (ddr + ahead * jerk + force(e + ahead * de, de + ahead * dde) + [0.0, 0.0, G])
            return F, attitude_of(F, np.array([0.0, 0.0, value(path[5], t) + ahead * rate(path[5], t)]))

        F, goal = wanted(0.0)
        turning = (wanted(-h)[1].inv() * wanted(h)[1]).as_rotvec() / (2.0 * h)
        error = goal.inv() * R
        moving = error.inv().apply(turning)
        change = torque(error, w - moving) - np.cross(w, moving)
        up = R.apply([0.0, 0.0, 1.0])
        command = np.array([*(F @ up * up), *(J @ change + np.cross(w, J @ w))])
        np.testing.assert_allclose(trace.u[k], np.clip(command, -limits, limits), rtol=1e-6, atol=1e-10)
        free += np.sum(np.abs(command[3:]) < limits[3:])
    assert free > 50


def value(path, t):
    return getattr(path, "amplitude", 0.0) * math.sin(getattr(path, "omega", 0.0) * t)


def rate(path, t):
    return path.amplitude * path.omega * math.cos(path.omega * t)


def acceleration(path, t):
    return -path.amplitude * path.omega**2 * math.sin(path.omega * t)
