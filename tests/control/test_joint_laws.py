"""Laws of many joints, held against their theorems on an arm whose model the law knows exactly."""

import numpy as np
import pytest
from helpers import arms

import smc_mujoco as smc
from smc_mujoco.control import joint_law
from smc_mujoco.mechanisms.plant import Values

SWING = smc.Sine(0.4, 3.0)
X0 = (0.1, 0.5, -0.3)


def run(law, **fields):
    """A run of the arm with strong motors, under RK4."""
    common = {
        "plant": arms.arm(),
        "law": law,
        "duration": 2.0,
        "u_max": 1e4,
        "reference": SWING,
        "x0": X0,
    }
    trace = smc.run(smc.Scenario(**common | fields))
    assert trace.failure is None
    return trace


def inertia(x):
    """The nominal M of the arm."""
    plant = arms.arm()
    return plant.nominal.dynamics(np.array(x), np.zeros(3), Values(**plant.parameters)).M


@pytest.mark.quick
def test_computed_torque_sliding_reaches_its_layer_at_the_predicted_time():
    k = 5.0
    width = 0.05
    trace = run(
        smc.law(
            "computed_torque_sliding",
            k=k,
            c=4.0,
            width=width,
        ),
        control_period=2e-4,
        duration=0.8,
    )
    for i in range(3):
        start = abs(trace.s[0, i])
        reached = trace.t[np.argmax(np.abs(trace.s[:, i]) <= width)]
        assert reached == pytest.approx((start - width) / k, rel=2e-3)
        before = trace.t < 0.9 * reached
        np.testing.assert_allclose(
            np.abs(trace.s[before, i]), start - k * trace.t[before], atol=2e-3 * start
        )


def test_super_twisting_reaches_and_stays_at_second_order_in_the_period():
    """Reached before 2 sqrt|s0| / k1 without a disturbance; |s| = O(dt^2) under one whose rate is
    below L.
    """
    calm = run(
        smc.law("super_twisting_computed_torque", w_max=[9.0, 9.0, 9.0]),
        control_period=2e-4,
        duration=1.5,
    )
    for i in range(3):
        first = calm.t[np.argmax(np.sign(calm.s[:, i]) != np.sign(calm.s[0, i]))]
        assert 0.5 < first / (2.0 * np.sqrt(abs(calm.s[0, i])) / 4.7) <= 1.0
        before = np.flatnonzero(calm.t < 0.9 * first)  # until then w = -k2 t sgn(s)
        rate = -np.sign(calm.s[0, i]) * (
            4.7 * np.sqrt(np.abs(calm.s[before, i])) + 11.0 * calm.t[before]
        )
        np.testing.assert_allclose(
            np.diff(calm.s[:, i])[before] / 2e-4, rate, atol=0.01 * np.abs(rate).max()
        )
    # |d_a'| stays below L, so k1 = 1.5 sqrt(L) and k2 = 1.1 L are enough
    L = 60.0
    d = smc.Sine(0.5, 3.0)
    law = smc.law(
        "super_twisting_computed_torque",
        k1=1.5 * np.sqrt(L),
        k2=1.1 * L,
        c=4.0,
    )
    residuals = []
    for dt in (1e-3, 5e-4):
        trace = run(
            law,
            control_period=dt,
            disturbance=d,
            duration=2.5,
        )
        d_a = np.array(
            [np.linalg.solve(inertia(x), load) for x, load in zip(trace.x, trace.d, strict=True)]
        )
        assert np.abs(np.diff(d_a, axis=0)).max() / dt < L
        residuals.append(np.abs(trace.s[trace.t > 2.0]).max())
    assert residuals[0] / residuals[1] == pytest.approx(4.0, rel=0.3)
    assert residuals[0] < 3.0 * L * 1e-6


def test_passivity_based_lowers_v_as_its_theorem_says():
    """V' of V = s' M s / 2 along a run is -s' (K s + k sat(s / width) - d), under a disturbance
    known to us alone.
    """
    K = 1.5
    k = np.array([0.6, 0.9, 0.4])
    width = 0.2
    dt = 1e-4
    law = smc.law(
        "passivity_based",
        K=K,
        k=k,
        c=4.0,
        width=width,
    )
    trace = run(
        law,
        control_period=dt,
        duration=0.6,
        disturbance=smc.Sine(0.2, 7.0),
    )
    s = trace.s
    V = np.array(
        [
            s_of_sample @ inertia(x) @ s_of_sample / 2
            for x, s_of_sample in zip(trace.x, s, strict=True)
        ]
    )
    claimed = -np.sum(s * (K * s + k * np.clip(s / width, -1, 1) - trace.d), axis=1)
    # the mean of both ends of a period, as u is held in it: what remains is O(dt)
    np.testing.assert_allclose(
        np.diff(V) / dt, (claimed[1:] + claimed[:-1]) / 2, atol=2e-3 * np.abs(claimed).max()
    )
    assert V[-1] < 1e-2 * V[0]


def test_unit_vector_keeps_its_direction_and_reaches_all_surfaces_at_once():
    rho = 8.0
    trace = run(
        smc.law(
            "unit_vector",
            rho=rho,
            eps=0.0,
            c=[4.0, 5.0, 3.0],
        ),
        control_period=2e-4,
        duration=0.6,
    )
    length = np.linalg.norm(trace.s, axis=1)
    end = length[0] / rho
    before = trace.t < 0.95 * end
    np.testing.assert_allclose(
        length[before], length[0] - rho * trace.t[before], atol=2e-3 * length[0]
    )
    cosine = trace.s[before] @ trace.s[0] / (length[before] * length[0])
    assert cosine.min() > 1.0 - 1e-5
    assert (length[trace.t > 1.02 * end] < 2.0 * rho * 2e-4).all()


def test_time_delay_sliding_needs_no_model():
    """Constant unknown forces leave nothing; moving ones an error of the order of the period."""
    law = smc.law("time_delay_sliding", m=[0.1, 0.01, 0.05])
    still = run(
        law,
        reference=smc.Constant(0.3),
        disturbance=smc.Constant(0.5),
        duration=6.0,
        velocity="measured",
    )
    assert np.abs(still.x[-1] - still.r[-1]).max() < 1e-9
    errors = []
    for dt in (1e-3, 5e-4):
        moving = run(
            law,
            control_period=dt,
            disturbance=smc.Constant(0.5),
            duration=4.0,
        )
        errors.append(np.abs(moving.s[moving.t > 3.0]).max())
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)


def test_time_delay_sliding_is_stable_below_twice_the_inertia_and_not_above():
    """For joints without coupling and M = 1 / g the estimate's error is multiplied by 1 - m g each
    sample.
    """
    plant = smc.plant(
        "inverted_pendulum_network",
        n=2,
        kc=0.0,
    )
    M = plant.parameters["m"] * plant.parameters["l"] ** 2
    common = {
        "plant": plant,
        "reference": smc.Constant(0.0),
        "x0": 0.2,
        "duration": 0.5,
        "u_max": 1e9,
    }
    stable = run(
        smc.law(
            "time_delay_sliding",
            m=1.9 * M,
            k=1.0,
        ),
        **common,
    )
    assert np.abs(np.diff(stable.u[-20:, 0])).max() < 1e-2
    above = smc.run(
        smc.Scenario(
            law=smc.law(
                "time_delay_sliding",
                m=2.1 * M,
                k=1.0,
            ),
            **common,
        )
    )
    assert not np.abs(np.diff(above.u[-20:, 0])).max() < 10.0


def test_solve_inverts_a_positive_definite_matrix():
    rng = np.random.default_rng(3)
    for n in (1, 3, 7):
        root = rng.normal(size=(n, n))
        b = rng.normal(size=n)
        M = root @ root.T + 0.1 * np.eye(n)
        np.testing.assert_allclose(joint_law.solve(M, b), np.linalg.solve(M, b), rtol=1e-9)
        assert joint_law.solve.py_func(M, b).tolist() == joint_law.solve(M, b).tolist()
