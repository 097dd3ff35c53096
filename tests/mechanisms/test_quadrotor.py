"""The quadrotor: its rotors, drag and wind against integrations and closed forms that share no code
with it.
"""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import smc_mujoco as smc
from smc_mujoco.mechanisms import rotation
from smc_mujoco.mechanisms.hardware.rotors import ROTOR, spun
from smc_mujoco.mechanisms.plant import Field

QUADROTOR = smc.plant("quadrotor")
P = dict(QUADROTOR.parameters)
G = P["grav"]
FREE_BODY = {
    "joint": True,
    "plants": ("a free body",),
}


@smc.law_function(**FREE_BODY)
def flip(y, gains, memory):
    """A wrench of time alone: a roll, a pitch and a yaw while the thrust changes."""
    u = np.zeros(6)
    q = rotation.quaternion(y.x[3], y.x[4], y.x[5])
    u[0], u[1], u[2] = rotation.turned(q, 0.0, 0.0, 0.3 + 0.05 * math.sin(9.0 * y.t))
    u[3] = 6e-4 * math.sin(5.0 * y.t)
    u[4] = 3e-4 * math.cos(7.0 * y.t)
    u[5] = 2e-4 * math.sin(3.0 * y.t + 1.0)
    return u, np.zeros(6)


def rotor_rate(W, c, p):
    """Return W' of a rotor, as its equation says."""
    if c >= W:
        return p["rise"] * (c - W)
    return p["fall"] * (c - W) + p["fall2"] * (c * c - W * W)


def newton_euler(duration, period, p, wind):
    """Return the state at the end of `flip`, by DOP853 between samples: no MuJoCo.

    The wind blows from the start.
    """
    drag = np.diag([p["Dx"], p["Dy"], p["Dz"]])
    J = np.diag([p["Jx"], p["Jy"], p["Jz"]])
    places = p["a"] * np.array([(1, -1), (-1, -1), (-1, 1), (1, 1)])
    spins = np.array([1.0, -1.0, 1.0, -1.0])
    state = np.concatenate(
        [[0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0], np.zeros(6), np.full(4, speed(p, p["m"] * G / 4))]
    )
    for k in range(round(duration / period)):
        t = k * period
        F = 0.3 + 0.05 * math.sin(9.0 * t)
        M = 6e-4 * math.sin(5.0 * t), 3e-4 * math.cos(7.0 * t), 2e-4 * math.sin(3.0 * t + 1.0)
        # as in the firmware's power distribution
        signs = np.array([(-1, -1, -1), (-1, 1, 1), (1, 1, -1), (1, -1, 1)])
        thrusts = F / 4 + signs @ np.array([M[0] / p["a"], M[1] / p["a"], M[2] / p["c"]]) / 4
        thrusts = np.clip(thrusts - max(0.0, thrusts.max() - p["fmax"]), 0.0, p["fmax"])
        reported = np.array([speed(p, f) for f in thrusts])

        def rates(t, y, reported=reported):
            q = y[3:7] / np.linalg.norm(y[3:7])
            v = y[7:10]
            w = y[10:13]
            W = y[13:]
            turn = Rotation.from_quat(q, scalar_first=True)
            f = np.clip(p["k1"] * W + p["k2"] * W * W, 0.0, p["fmax"])
            dW = np.array([rotor_rate(a, b, p) for a, b in zip(W, reported, strict=True)])
            torque = np.array([f @ places[:, 1], -f @ places[:, 0], -p["c"] * f @ spins])
            h = p["Jr"] * spins @ W
            dh = p["Jr"] * spins @ dW
            spin = np.array([0.0, 0.0, 1.0])
            torque -= np.cross(w, J @ w + h * spin) + dh * spin
            force = turn.apply([0.0, 0.0, f.sum()]) - turn.apply(drag @ turn.inv().apply(v - wind))
            dq = 0.5 * np.array([-q[1:] @ w, *(q[0] * w + np.cross(q[1:], w))])
            return np.concatenate(
                [v, dq, force / p["m"] - [0.0, 0.0, G], np.linalg.solve(J, torque), dW]
            )

        state = solve_ivp(
            rates,
            (0.0, period),
            state,
            "DOP853",
            rtol=1e-11,
            atol=1e-13,
        ).y[:, -1]
    return (
        state[:3],
        Rotation.from_quat(state[3:7], scalar_first=True).as_matrix(),
        state[7:10],
        state[10:13],
    )


@pytest.mark.parametrize("name", ["crazyflie", pytest.param("crazyflow", marks=pytest.mark.slow)])
def test_two_seconds_of_a_flip_in_wind_are_those_of_an_integration_without_mujoco(name):
    plant = smc.plant(
        "quadrotor",
        set=name,
        Dx=0.02,
        Jr=3e-7,
    )
    place, turn, v, w = newton_euler(2.0, 4e-3, dict(plant.parameters), np.array([1.0, -2.0, 0.5]))
    misses = []
    for step in (2e-3, 1e-3):
        trace = smc.run(
            smc.Scenario(
                plant=plant,
                law=flip,
                control_period=4e-3,
                physics_step=step,
                duration=2.0,
                x0=QUADROTOR.rest,
                disturbance=smc.signals.Wind(1.0, -2.0, 0.5),
            )
        )
        attitude = Rotation.from_rotvec(trace.x[-1, 3:].copy()).as_matrix()
        off = trace.x[-1, :3] - place, attitude - turn, trace.v[-1] - [*v, *w]
        misses.append([np.abs(values).max() for values in off])
    assert np.abs(trace.v[:, 3:]).max() > 10.0  # rad/s: it does turn over
    assert max(misses[1][:2]) < 1e-4
    assert np.all(np.array(misses[0]) > 3.4 * np.array(misses[1]))


@dataclasses.dataclass(frozen=True)
class AllTurnAlike:
    """The quadrotor's fields, with rotors that all turn counter-clockwise, so that their angular
    momentum is not 0.
    """

    def __call__(self, model, p):
        yield from QUADROTOR.fields(model, p)
        yield Field("actuator_user", (slice(None), list(ROTOR.fields or ()).index("spin")), 1.0)


@pytest.mark.filterwarnings("ignore:control_period is 5 s")
@pytest.mark.parametrize("fall", [0.0, 3.0], ids=["steady", "slowing down"])
def test_a_tumbling_body_with_spinning_rotors_keeps_its_angular_momentum(fall):
    """Without lever and torque per thrust nothing turns the body but its rotors."""
    plant = smc.plant(
        "quadrotor",
        a=1e-11,
        c=1e-11,
        Jr=1e-8,
        Jy=20e-6,
        Dx=0.0,
        Dy=0.0,
        Dz=0.0,
        rise=0.0,
        fall=fall,
    )
    plant = dataclasses.replace(plant, fields=AllTurnAlike())
    J = np.diag([16.8e-6, 20e-6, 29.8e-6])
    start = speed(P, P["m"] * G / 4)
    idle = speed(P, 0.0)
    misses = []
    for step in (2e-3, 1e-3):
        trace = smc.run(
            smc.Scenario(
                plant=plant,
                law="none",
                x0=(0.0, 0.0, 3.0, 0.3, -0.2, 0.1),
                v0=(1.0, -2.0, 3.0, 5.0, 20.0, 3.0),
                duration=5.0,
                control_period=5.0,
                integrator="RK4",
                physics_step=step,
            )
        )
        w = trace.v[:, 3:]
        h = 4 * 1e-8 * (idle + (start - idle) * np.exp(-fall * trace.t))
        momentum = Rotation.from_rotvec(trace.x[:, 3:].copy()).apply(
            w @ J + np.outer(h, [0.0, 0.0, 1.0])
        )
        size = np.linalg.norm(momentum, axis=1)
        energy = np.einsum("ki,ij,kj->k", w, J, w)
        misses.append(np.abs(momentum[1] - momentum[0]).max() / size[0])
        if fall == 0.0 and step == 1e-3:
            assert np.ptp(size) < 1e-10 * size[0]
            assert np.ptp(energy) < 1e-10 * energy[0]
    assert misses[1] < 1e-4
    assert misses[0] > 3.5 * misses[1]


def speed(p, thrust):
    """Return the speed at which a rotor gives a thrust, from its curve."""
    return (math.sqrt(p["k1"] ** 2 + 4 * p["k2"] * thrust) - p["k1"]) / (2 * p["k2"])


@pytest.mark.quick
@pytest.mark.parametrize(
    "numbers",
    [
        (7.0, 0.0, 5.0, 2e-3),
        (4.0, 1e-3, 0.0, 3e-3),
        (0.0, 2e-3, 9.0, 0.0),
    ],
    ids=str,
)
@pytest.mark.parametrize(
    ("first", "reported"),
    [
        (500.0, 2000.0),
        (2000.0, 300.0),
        (900.0, 900.0),
    ],
)
def test_a_rotor_follows_its_equation_for_whatever_step(numbers, first, reported):
    rise, rise2, fall, fall2 = numbers
    rotor = np.zeros((), ROTOR).view(np.recarray)
    rotor.rise, rotor.rise2, rotor.fall, rotor.fall2 = numbers

    def rate(t, W):
        if reported >= W[0]:
            a = rise
            b = rise2
        else:
            a = fall
            b = fall2
        return [a * (reported - W[0]) + b * (reported**2 - W[0] ** 2)]

    speed, slope = spun.py_func(rotor, first, reported, 0.3)
    expected = solve_ivp(
        rate,
        (0.0, 0.3),
        [first],
        "DOP853",
        rtol=1e-12,
        atol=1e-9,
    ).y[0, -1]
    assert speed == pytest.approx(expected, rel=1e-9)
    assert slope == pytest.approx(
        rate(0.0, [speed])[0],
        rel=1e-6,
        abs=1e-9,
    )
    half = spun.py_func(rotor, first, reported, 0.1)[0]
    assert spun.py_func(rotor, half, reported, 0.2)[0] == pytest.approx(speed, rel=1e-12)


def falling(**fields):
    """Return a run of a body that falls with its rotors at rest."""
    plant = fields.pop(
        "plant",
        smc.plant(
            "quadrotor",
            lift=0.0,
            Dx=0.02,
            Dy=0.01,
            Dz=0.03,
        ),
    )
    start = {
        "x0": (0.0, 0.0, 50.0, 0.0, 0.0, 0.0),
        "v0": (3.0, -2.0, 4.0, 0.0, 0.0, 0.0),
    }
    return smc.run(
        smc.Scenario(**(start | {"plant": plant, "law": "none", "duration": 2.0} | fields))
    )


def test_a_gust_of_wind_is_a_raised_cosine():
    trace = falling(
        disturbance=smc.signals.Wind(
            x=3.0,
            time=0.5,
            width=1.0,
        )
    )
    shape = np.where(
        np.abs(trace.t - 1.0) < 0.5, 0.5 - 0.5 * np.cos(2 * np.pi * (trace.t - 0.5)), 0.0
    )
    np.testing.assert_allclose(trace.d[:, 0], 0.02 * 3.0 * shape, atol=1e-12)


@pytest.mark.parametrize("step", [5e-3, pytest.param(1e-3, marks=pytest.mark.slow)])
def test_turbulence_has_its_rms_and_its_correlation_whatever_the_step(step):
    """MIL-F-8785C's lengths and sizes at 3.05 m; 60 runs of 20 s, 8 correlation times each along x
    and y.
    """
    wind = smc.signals.Dryden(
        w20=7.7,
        height=3.048,
        speed=5.0,
    )
    base = {
        "plant": smc.plant(
            "quadrotor",
            lift=0.0,
            Dx=1.0,
            Dy=1.0,
            Dz=1.0,
        ),
        "law": "none",
        "duration": 20.0,
    }
    base |= {
        "physics_step": step,
        "control_period": 0.05,
        "x0": QUADROTOR.rest,
        "disturbance": wind,
    }
    d = np.array(
        [
            trace.d[:, :3]
            for trace in smc.run([smc.Scenario(**base, seed=seed) for seed in range(60)])
        ]
    )
    b = 0.177 + 0.000823 * 10
    sigma = 0.77 / np.array([b**0.4, b**0.4, 1.0])
    times = 3.048 / np.array([b**1.2, b**1.2, 1.0]) / 5.0
    np.testing.assert_allclose(np.sqrt((d**2).mean(axis=(0, 1))), sigma, rtol=0.06)
    lag = 10  # samples, 0.5 s
    x = lag * 0.05 / times
    expected = np.exp(-x) * np.array([1.0, 1.0 - x[1] / 2, 1.0 - x[2] / 2])
    correlation = (d[:, lag:] * d[:, :-lag]).mean(axis=(0, 1)) / (d**2).mean(axis=(0, 1))
    np.testing.assert_allclose(correlation, expected, atol=0.05)
    assert np.abs(np.corrcoef(d.reshape(-1, 3).T)[np.triu_indices(3, 1)]).max() < 0.15


def hovering(**parameters):
    """Return the thrust of a run whose law commands the weight of a Crazyflie, at its end, N."""

    @smc.law_function(**FREE_BODY)
    def weight(y, gains, memory):
        return np.array([0.0, 0.0, 0.0319 * 9.81, 0.0, 0.0, 0.0]), np.zeros(6)

    plant = smc.plant(
        "quadrotor",
        Jx=1e3,
        Jy=1e3,
        Jz=1e3,
        **parameters,
    )
    return smc.run(
        smc.Scenario(
            plant=plant,
            law=weight,
            duration=2.0,
            x0=QUADROTOR.rest,
        )
    ).force[-1, 2]


def test_a_weak_battery_and_a_fading_rotor_lose_their_share_of_the_thrust():
    weight = P["m"] * G
    assert hovering() == pytest.approx(weight, rel=1e-12)
    assert hovering(fade=0.4) == pytest.approx(0.9 * weight, rel=1e-6)
    sagging = hovering(sag=0.32)
    W = speed(P, weight / 4) * (1 - 0.32 * sagging)
    assert sagging == pytest.approx(4 * (P["k1"] * W + P["k2"] * W * W), rel=1e-9)
    assert 0.80 * weight < sagging < 0.85 * weight


def test_a_payload_that_is_dropped_is_weight_until_then():
    heavy = falling(
        plant=smc.plant(
            "quadrotor",
            lift=0.0,
            payload=0.006,
            Dx=0.0,
            Dy=0.0,
            Dz=0.0319 + 0.006,
        ),
        jump=smc.Jump(time=1.0, factors={"payload": -0.006}),
    )
    k = np.searchsorted(heavy.t, 1.0)
    early = -G + (4.0 + G) * np.exp(-heavy.t[:k])
    np.testing.assert_allclose(heavy.v[:k, 2], early, atol=1e-9)
    rate = 0.0379 / 0.0319
    late = -G / rate + (heavy.v[k, 2] + G / rate) * np.exp(-rate * (heavy.t[k:] - heavy.t[k]))
    np.testing.assert_allclose(heavy.v[k:, 2], late, atol=1e-9)


LIFTS = {  # set -> thrust over weight, as its source or what was derived of it says
    "crazyflie": 1.53,
    "crazyflow": 1.53,
    "gym": 2.25,
    "rotorpy": 1.95,
    "crazys": 2.41,
    "hummingbird": 10.2,
}
# rpm at which a set hovers, of the same sources
HOVERS = {"crazyflow": 18_968, "gym": 14_480, "rotorpy": 17_079}


@pytest.mark.parametrize("name", list(QUADROTOR.sets))
def test_every_set_of_numbers_hovers_where_its_rotors_carry_it(name):
    plant = smc.plant("quadrotor", set=name)
    p = plant.parameters
    assert 4 * p["fmax"] / (p["m"] * G) == pytest.approx(LIFTS[name], rel=0.01)
    if name in HOVERS:
        assert speed(p, p["m"] * G / 4) * 30 / math.pi == pytest.approx(HOVERS[name], rel=2e-3)
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law="geometric",
            model="nominal",
            x0=plant.rest,
            duration=1.0,
        )
    )
    assert trace.failure is None
    assert np.abs(trace.e).max() < 1e-9
    assert plant.limits[3] == pytest.approx(4 * p["fmax"] * p["a"])


@pytest.mark.parametrize("sag", [0.0, 0.32])
@pytest.mark.parametrize("name", ["crazyflie", "crazyflow", "gym", "rotorpy", "hummingbird"])
def test_poses_err_by_the_square_of_the_step_whatever_the_rotors(name, sag):
    """Rotors without lag, and a supply that sags, had errors of order one."""
    if sag and name == "gym":
        return  # an algebraic loop: of order one
    traces = []
    for parts in (1, 2, 32):
        scenario = smc.Scenario(
            plant=smc.plant("quadrotor", set=name, sag=sag),
            law="cascaded_pid",
            duration=0.2,
            control_period=4e-3,
            physics_step=4e-3 / parts,
            integrator="RK4",
        )
        traces.append(smc.run(scenario).x)
    errors = [np.abs(trace - traces[2]).max() for trace in traces[:2]]
    assert math.log2(errors[0] / errors[1]) > 1.8
