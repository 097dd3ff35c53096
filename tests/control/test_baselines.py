"""The baselines are what their textbooks say:

PID, LQR, computed torque, and a pendulum swung up by its energy.

Most runs are on a free unit mass, x'' = u + d: the Duffing oscillator without its springs.
"""

import math

import numpy as np
import pytest
from helpers import plants_ab
from helpers.runs import free_mass
from scipy.linalg import expm, solve_continuous_are

import smc_mujoco as smc
from smc_mujoco.control import nominal_gains

FREE = free_mass()


def called(law, times=1, memory=None, **y):
    """The law's last u after some calls."""
    if memory is None:
        memory = np.zeros(law.memory)
    return [plants_ab.called(law, plants_ab.measured(**y), memory)[0] for _ in range(times)][-1]


def free(law, **fields):
    """A run on the free mass."""
    return smc.run(
        smc.Scenario(
            **(
                {
                    "plant": FREE,
                    "law": law,
                    "x0": 1.0,
                    "u_max": math.inf,
                }
                | fields
            )
        )
    )


# PID


@pytest.mark.quick
def test_pid_on_a_free_mass_moves_as_its_three_poles_say():
    """z = (integral of e, e, de), z' = A z, to the order of the control period."""
    kp = 10.0
    ki = 5.0
    kd = 6.0
    trace = free(
        smc.law(
            "pid",
            kp=kp,
            ki=ki,
            kd=kd,
            tau=0.0,
        ),
        duration=4.0,
        control_period=5e-4,
    )
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-ki, -kp, -kd]])
    exact = np.array([expm(A * t) @ (0.0, 1.0, 0.0) for t in trace.t[::200]])
    np.testing.assert_allclose(trace.x[::200, 0], exact[:, 1], atol=1e-3)


@pytest.mark.parametrize("ki", [1e-9, 1e-6, 1e-3])
def test_a_tiny_integral_gain_of_pid_is_as_good_as_none_after_saturation(ki):
    runs = []
    for gain in (0.0, ki):
        law = smc.law("pid", kp=30.0, ki=gain, kd=6.0)
        runs.append(smc.Scenario(plant="inverted_pendulum", law=law, x0=1.2))
    none, tiny = smc.run(runs)
    assert np.abs(none.u).max() == 6.0
    assert smc.score(tiny)["itae"] < 1.3 * smc.score(none)["itae"]


def test_only_the_integral_leaves_no_error_under_a_constant_force():
    """Without it the mass rests where kp e = d."""
    with_it = smc.law("pid")
    without = smc.law("pid", ki=0.0)
    for law, rest in (
        (with_it, 0.0),
        (without, 0.2),
        (smc.law("computed_torque", kp=10.0), 0.2),
    ):
        trace = free(
            law,
            disturbance=smc.Constant(2.0),
            duration=15.0,
            u_max=10.0,
        )
        assert trace.x[-1, 0] == pytest.approx(rest, abs=2e-3)
        assert trace.u[-1, 0] == pytest.approx(-2.0, abs=2e-2)


def test_back_calculation_holds_the_integrator_where_the_bound_is_barely_exceeded():
    """Held at e = 1 the integrator rests where (sat(u) - u) / tt = ki e: u exceeds the bound by ki
    tt.
    """
    with pytest.warns(smc.errors.ScenarioWarning, match="kp kd > M ki"):
        law = smc.law(
            "pid",
            kp=10.0,
            ki=5.0,
            kd=0.0,
            tt=0.5,
        )
    assert called(law, 20_000, e=1.0, limit=6.0) == pytest.approx(-(6.0 + 5.0 * 0.5), rel=1e-6)
    # no bound: it winds up as ki t
    assert called(law, 1001, e=1.0) == pytest.approx(-(10.0 + 5.0), rel=1e-9)


@pytest.mark.parametrize(
    ("name", "gains"),
    [
        ("pid", {"ki": 0.0, "tau": 0.0}),
        (
            "lqi",
            {
                "q0": 0.0,
                "a1": 0.0,
                "a2": 0.0,
                "b": 1.0,
            },
        ),
    ],
)
def test_a_law_whose_integral_has_no_gain_remembers_no_saturation(name, gains):
    """Back-calculation would leave a bias that no integral takes back."""
    law = smc.law(name, **gains)
    memory = np.zeros(law.memory)
    called(
        law,
        1000,
        memory,
        e=50.0,
        limit=1.0,
    )
    assert called(law, 1, memory, e=0.1) == called(law, e=0.1)


# LQR


def closed_form(law, **y):
    """k1 and k2, seen from outside."""
    return -called(law, e=1.0, **y), -called(law, de=1.0, **y)


def riccati(a1, a2, b, q, r):
    """The optimal gains and cost matrix, by scipy."""
    A = np.array([[0.0, 1.0], [a1, a2]])
    B = np.array([[0.0], [b]])
    P = solve_continuous_are(A, B, np.diag(q), np.array([[r]]))
    return (B.T @ P / r)[0], P


@pytest.mark.parametrize("seed", range(20))
def test_lqr_s_closed_form_solves_the_riccati_equation(seed):
    rng = np.random.default_rng(seed)
    a1, a2 = rng.normal(scale=10.0, size=2)
    b, r, *q = np.exp(rng.normal(scale=1.5, size=4))
    law = smc.law(
        "lqr",
        q1=q[0],
        q2=q[1],
        r=r,
        a1=a1,
        a2=a2,
        b=b,
    )
    np.testing.assert_allclose(closed_form(law), riccati(a1, a2, b, q, r)[0], rtol=1e-7)


def test_design_linearises_a_plant_at_the_origin():
    inertia = 0.5 * 0.5**2
    expected = {
        "inverted_pendulum": (9.81 / 0.5, -0.02 / inertia, 1 / inertia),
        "duffing": (1.0, -0.2, 1.0),
        "van_der_pol": (-1.0, 1.0, 1.0),
        # at an end of the row one spring only holds the pendulum back
        "inverted_pendulum_network": (9.81 / 0.5 - 0.5 / inertia, -0.02 / inertia, 1 / inertia),
        "pendulum_network": (-9.81 / 0.5 - 0.5 / inertia, -0.02 / inertia, 1 / inertia),
    }
    for name, numbers in expected.items():
        np.testing.assert_allclose(
            nominal_gains.linearised(smc.plant(name), "lqr"), numbers, rtol=1e-6
        )
    heavy = smc.plant("duffing", M=2.0, alpha=4.0)
    np.testing.assert_allclose(nominal_gains.linearised(heavy, "lqr"), (-2.0, -0.1, 0.5), rtol=1e-6)


# computed torque


def test_without_the_model_computed_torque_is_a_pd_law():
    law = smc.law("computed_torque", kp=9.0, kd=4.0)
    assert called(
        law,
        e=0.5,
        de=-0.2,
        f=3.0,
        g=7.0,
        ddr=11.0,
    ) == -(9.0 * 0.5 + 4.0 * -0.2)
    assert (
        called(
            law,
            e=0.5,
            de=-0.2,
            f=3.0,
            g=7.0,
            ddr=11.0,
            model=1.0,
        )
        == (-3.7 - 3.0 + 11.0) / 7.0
    )


# swing-up

J, W = 0.125, math.sqrt(9.81 / 0.5)  # of the library's pendulum


def energy(trace):
    """E at every sample, J; 0 upright at rest."""
    return J * (0.5 * trace.v**2 + W**2 * (np.cos(trace.x) - 1.0))[:, 0]


@pytest.mark.parametrize("u_max", [0.3, 0.5, 1.0, 2.0, 6.0])
def test_swing_up_lifts_the_hanging_pendulum_by_a_torque_that_cannot_hold_it(u_max):
    """m g l = 2.45 N m.

    Without friction the energy never falls before the catch, and then the pendulum stays up.
    """
    plant = smc.plant("inverted_pendulum", b=0.0)
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law="swing_up",
            x0=math.pi,
            u_max=u_max,
            duration=15.0,
        )
    )
    E = energy(trace)
    up = np.cos(trace.x[:, 0])
    caught = np.argmax(up > math.cos(1.0))
    assert E[0] == pytest.approx(-2 * J * W**2)
    rising = E[:caught]
    assert rising.max() > -J * W**2  # it got there by swinging
    assert np.diff(rising).min() > -1e-5 * J * W**2
    assert trace.failure is None
    assert up[-5000:].min() > 1.0 - 1e-9
    assert np.abs(trace.u[-5000:]).max() < 1e-6


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_catch_holds_all_that_its_torque_can_hold_and_nothing_more(side):
    """Upright with the speed v0, s = v0: it returns for |v0| < u_max / (J w), else it falls
    whatever the law.
    """
    for part, holds in (
        (0.95, True),
        (1.05, False),
    ):
        v0 = side * part * 0.3 / (J * W)
        law = smc.law("swing_up", part=0.99)
        trace = smc.run(
            smc.Scenario(
                plant="inverted_pendulum",
                law=law,
                x0=0.0,
                v0=v0,
                u_max=0.3,
                duration=3.0,
            )
        )
        assert (np.abs(trace.x).max() < 1.0) == holds
