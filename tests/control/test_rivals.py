"""Laws without a sliding mode that want to win are what their textbooks say, with foreign solvers
as judges.
"""

import math

import mujoco
import numpy as np
import pytest
from helpers.plants_ab import called, constant, measured, plant_b
from scipy.linalg import expm, solve_continuous_are, solve_discrete_are

import smc_mujoco as smc
from smc_mujoco.control.laws import loop_shaping, lqi, mpc

RIVALS = ("adrc", "pd_observer", "hodob", "lqi", "mpc", "loop_shaping")
UNIT = {"a1": 0.0, "a2": 0.0, "b": 1.0}  # the plant e'' = u
# a1, a2, b
PLANTS = (
    (0.0, 0.0, 1.0),
    (18.0, 0.7, 0.9),
    (-23.6, -0.16, 8.0),
    (
        5.0,
        -1.0,
        0.4,
    ),
)


def call(law, memory, **fields):
    """The law's u, clipped to its limit."""
    y = measured(**fields)
    u, _ = called(law, y, memory)
    return min(max(u, -y.limit), y.limit)


def answer(law, memory, omega, h, samples=80_000):
    """The complex factor from e = cos(omega t) to the law's u, once it has settled."""
    t = h * np.arange(samples)
    u = np.array(
        [
            called(
                law,
                measured(
                    e=math.cos(omega * time),
                    dt=h,
                ),
                memory,
            )[0]
            for time in t
        ]
    )
    last = t > t[-1] - 4.0 * math.pi / omega
    basis = np.stack(
        [np.cos(omega * t[last]), -np.sin(omega * t[last]), np.ones(last.sum())], axis=1
    )
    real, imaginary, _ = np.linalg.lstsq(basis, u[last], rcond=None)[0]
    return complex(real, imaginary)


def bounded(name):
    """The law with b = 1, on e'' = u where it knows a plant, and with an integral of a rate of 1 /
    s or more.
    """
    if name in ("adrc", "pd_observer", "hodob"):
        gains = {}
    else:
        gains = UNIT
    return smc.law(name, **({"b": 1.0} | gains | ({"wi": 1.0} if name == "loop_shaping" else {})))


# what holds of all


@pytest.mark.quick
@pytest.mark.parametrize("name", RIVALS)
def test_a_constant_disturbance_leaves_no_error(name):
    run = plant_b(bounded(name), constant(2.0), duration=20.0)
    assert abs(run.x[-1, 0]) < 1e-5
    assert run.u[-1] == pytest.approx(-2.0, abs=1e-4)


@pytest.mark.parametrize("name", RIVALS)
def test_a_law_that_does_not_see_its_bound_swings_up_and_one_that_does_comes_to_rest(name):
    """From a start that holds u at its bound for seconds.

    A law that is told of no bound has no anti-windup.
    """
    own, blind = (
        plant_b(
            bounded(name),
            x=(5.0, 0.0),
            limit=1.0,
            reported=reported,
            duration=30.0,
        )
        for reported in (None, 1e9)
    )
    assert (np.abs(own.u) == 1.0).sum() > 2000
    assert own.residual() < 0.05
    assert own.x.min() > -5.0
    assert blind.residual() > 10.0


@pytest.mark.parametrize("name", RIVALS)
@pytest.mark.parametrize("limit", [math.inf, 3.0])
def test_with_the_model_the_law_controls_the_acceleration(name, limit):
    """g u + f - r'' is the v of the law without the model on e'' = v, whatever f, g and r'' are at
    a sample.

    Where u has a bound, f is r'', so that the bound on v is symmetric and g times as large.
    """
    plain = bounded(name)
    rng = np.random.default_rng(0)
    informed = smc.law(
        name, **{key: value for key, value in plain.gains.items() if key not in UNIT}
    )
    own = np.zeros(plain.memory)
    memory_with_model = np.zeros(plain.memory)
    g = -2.0
    for _ in range(200):
        e, de, f = rng.normal(size=3)
        ddr = rng.normal() if limit == math.inf else f
        v = call(
            plain,
            own,
            e=e,
            de=de,
            limit=abs(g) * limit,
        )
        u = call(
            informed,
            memory_with_model,
            e=e,
            de=de,
            f=f,
            g=g,
            ddr=ddr,
            model=1.0,
            limit=limit,
        )
        assert g * u + f - ddr == pytest.approx(v, rel=1e-9, abs=1e-9)


# ADRC


def test_adrc_is_a_pid_controller_with_a_filter_of_second_order():
    """Its answer to e = cos(omega t), at a short period, is that of the transfer function in its
    docstring.
    """
    wc = 3.0
    w = 8.0
    b = 0.7
    omega = 5.0
    h = 1e-4
    law = smc.law("adrc", wc=wc, w=w, b=b)
    memory = np.zeros(5)
    got = answer(law, memory, omega, h)
    p = 1j * omega
    top = (
        wc**2 * w**3
        + (3 * wc**2 * w**2 + 2 * wc * w**3) * p
        + (3 * w * wc**2 + 6 * wc * w**2 + w**3) * p**2
    )
    exact = -top / (b * p * (p**2 + (3 * w + 2 * wc) * p + 3 * w**2 + 6 * w * wc + wc**2))
    assert got == pytest.approx(exact, rel=5e-3)


# PD with an observer


def test_pd_observer_is_incremental_dynamic_inversion():
    """u = F(u) + (v - F(e'')) / b, one filter F of first order on both."""
    wc = 4.0
    l = 30.0
    b = 0.6
    h = 1e-3
    law = smc.law("pd_observer", wc=wc, l=l, b=b)
    memory = np.zeros(4)
    share = 1.0 - math.exp(-l * h)
    rng = np.random.default_rng(0)
    of_u = of_a = last = u = 0.0
    for k in range(300):
        e, de = rng.normal(size=2)
        if k:
            of_u = of_u + share * (u - of_u)
            of_a = of_a + share * ((de - last) / h - of_a)
        v = -(wc**2) * e - 2.0 * wc * de
        u = min(max(of_u + (v - of_a) / b, -5.0), 5.0)
        assert call(law, memory, e=e, de=de, limit=5.0) == pytest.approx(u, abs=1e-9)
        last = de


# PD with a second-order observer


def loop_of_hodob(wc, l, g, h):
    """The matrix from one sample of e'' = g u to the next, of e, de and the memory of the law with
    b = 1.
    """
    law = smc.law("hodob", wc=wc, l=l, b=1.0)

    def after(state):
        e, de, *slots = state
        memory = np.array([1.0, *slots])
        u, _ = called(law, measured(e=e, de=de, dt=h), memory)
        return [e + h * de + h * h / 2.0 * g * u, de + h * g * u, *memory[1:]]

    return np.array([after(unit) for unit in np.eye(6)]).T


@pytest.mark.parametrize(("wc", "l", "h"), [(3.0, 8.0, 1e-3), (5.0, 40.0, 0.02)])
def test_hodob_has_its_observer_s_two_poles_beside_those_of_the_pd(wc, l, h):
    poles = np.sort_complex(np.linalg.eigvals(loop_of_hodob(wc, l, 1.0, h)))
    A = np.array([[1.0, h], [0.0, 1.0]]) - np.outer([h * h / 2.0, h], [wc * wc, 2.0 * wc])
    exact = [0.0, 0.0, *np.linalg.eigvals(A), math.exp(-l * h), math.exp(-l * h)]
    np.testing.assert_allclose(poles, np.sort_complex(exact), atol=1e-6)


@pytest.mark.parametrize(("wc", "l"), [(3.0, 6.0), (3.0, 40.0), (8.0, 2.0)])
def test_hodob_is_stable_from_the_input_gain_of_its_docstring_on(wc, l):
    """Slowly sampled, and slow about its observer, up to that of the observer's loop alone."""
    least = wc * l / (wc * wc + 3.0 * wc * l + l * l)
    P = math.exp(-1.0)
    most = 1.0 + (1.0 + P) ** 2 / ((1.0 - P) * (3.0 + P))
    for bound, inside, *numbers in ((least, 1.02, wc, l, 1e-4), (most, 0.98, 1e-3, 1.0, 1.0)):
        for factor, holds in ((inside, True), (1.0 / inside, False)):
            loop = loop_of_hodob(*numbers[:2], factor * bound, numbers[2])
            assert (np.abs(np.linalg.eigvals(loop)).max() < 1.0) == holds


# LQR with an integral


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(
    "q",
    [
        (1.0, 10.0, 2.0),
        (300.0, 5.0, 0.0),
        (1e-3, 100.0, 16.0),
    ],
)
def test_lqi_solves_its_riccati_equation(plant, q):
    a1, a2, b = plant
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, a1, a2]])
    B = np.array([[0.0], [0.0], [b]])
    ki, k1, k2 = (B.T @ solve_continuous_are(A, B, np.diag(q), np.eye(1)))[0]
    np.testing.assert_allclose(lqi.feedback(a1, a2, b, *q), (k1, k2, ki), rtol=1e-9)


# model-predictive control


@pytest.mark.parametrize("plant", PLANTS)
def test_the_end_s_weight_of_mpc_solves_the_discrete_riccati_equation(plant):
    a1, a2, b = plant
    augmented = expm(0.03 * np.array([[0.0, 1.0, 0.0], [a1, a2, b], [0.0, 0.0, 0.0]]))
    A11, A12, A21, A22, B1, B2 = mpc.sampled(a1, a2, b, 0.03)
    np.testing.assert_allclose(
        [[A11, A12, B1], [A21, A22, B2]],
        augmented[:2],
        rtol=1e-12,
        atol=1e-15,
    )
    P = solve_discrete_are(augmented[:2, :2], augmented[:2, 2:], np.diag([100.0, 16.0]), np.eye(1))
    got = mpc.riccati(A11, A12, A21, A22, B1, B2, 100.0, 16.0)
    np.testing.assert_allclose(got, (P[0, 0], P[0, 1], P[1, 1]), rtol=1e-9)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(
    ("q1", "q2"),
    [
        (100.0, 16.0),
        (3751.0, 48.0),
    ],
)
def test_mpc_s_plan_is_mujoco_s_solution_of_the_same_bounded_problem(plant, q1, q2):
    """From the last plan, its active set or from none: it has one solution.

    With the larger weights whole steps cycle.

    One of 200 jumps to another state may end before its solution, as the law's docstring says.
    Small moves of e, de and d, some of them out of the active set, follow each jump.
    """
    rng = np.random.default_rng(0)
    n = mpc.MOVES
    law = smc.law(
        "mpc",
        q1=q1,
        q2=q2,
        **dict(zip(("a1", "a2", "b"), plant, strict=True)),
    )
    memory = np.zeros(mpc.SLOTS)
    missed = 0
    state = rng.normal(size=3)
    limit = 1.0
    for k in range(800):
        if k % 4 == 0:
            state = rng.normal(size=3)
            limit = 10.0 ** rng.uniform(-1, 1.5)
        else:
            state[k % 4 - 1] += 10.0 ** rng.uniform(-2, 0) * rng.normal()
        e, de, d = state.tolist()
        memory[:5] = 1.0, e, de, d, 0.0
        u = call(
            law,
            memory,
            e=e,
            de=de,
            dt=1e-12,
            limit=limit,
        )
        us = -d / plant[2]
        H = memory[mpc.HESSIAN : mpc.FACTOR].reshape(n, n)
        rows = memory[mpc.PLAN : mpc.GRADIENT].reshape(n, mpc.ROW)
        g = rows[:, mpc.BY_E - mpc.PLAN] * e + rows[:, mpc.BY_DE - mpc.PLAN] * de
        v = np.zeros(n)
        factor = np.zeros((n, n + 7))
        index = np.zeros(n, np.int32)
        rank = mujoco.mju_boxQP(
            v,
            factor,
            index,
            np.ascontiguousarray(H),
            g,
            np.full(n, -limit - us),
            np.full(n, limit - us),
        )
        assert rank >= 0
        wrong = abs(u - min(max(v[0] + us, -limit), limit))
        if (memory[mpc.AT_E : mpc.AT_REACH] == (e, de, -us)).all():
            wrong = max(wrong, np.abs(rows[:, 0] - v).max())
            assert np.abs(rows[:, 0] + us).max() <= limit * (1.0 + 1e-12)
        else:  # only the first move was asked for, as the same moves were said to be free
            assert mpc.recall(n, e, de, -us, limit, memory.copy()) > -1e-9 * limit
        missed += wrong > 1e-8 * max(limit, np.abs(v).max())
    assert missed <= 1


# loop shaping


def shaped(a1, a2, b, k, wi):
    """The shaped plant in observable form."""
    A = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, a1], [0.0, 1.0, a2]])
    return A, np.array([[b * k * wi], [b * k], [0.0]]), np.array([[0.0, 0.0, 1.0]])


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(
    ("k", "wi"),
    [
        (20.0, 0.5),
        (4.0, 2.0),
        (100.0, 5.0),
    ],
)
def test_loop_shaping_solves_both_riccati_equations(plant, k, wi):
    A, B, C = shaped(*plant, k, wi)
    X = solve_continuous_are(A, B, C.T @ C, np.eye(1))
    Z = solve_continuous_are(A.T, C.T, B @ B.T, np.eye(1))
    gamma = 1.1 * math.sqrt(1.0 + np.linalg.eigvals(Z @ X).real.max())
    F = -np.linalg.solve((1.0 - gamma**-2) * np.eye(3) - gamma**-2 * X @ Z, np.eye(3)).T @ B
    got = loop_shaping.design(*plant, k, wi)
    assert got[6] == pytest.approx(gamma, rel=1e-8)
    np.testing.assert_allclose(got[:3], (F.T @ X)[0], rtol=1e-8)
    np.testing.assert_allclose(got[3:6], (-Z @ C.T)[:, 0], rtol=1e-8)


def test_loop_shaping_s_observer_is_sampled_exactly():
    k = 20.0
    wi = 0.5
    plant = (5.0, -1.0, 0.4)
    h = 0.05
    law = smc.law(
        "loop_shaping",
        k=k,
        wi=wi,
        **dict(zip(("a1", "a2", "b"), plant, strict=True)),
    )
    memory = np.zeros(loop_shaping.SLOTS)
    called(law, measured(e=0.1, de=0.0, dt=h), memory)
    A, _, C = shaped(*plant, k, wi)
    M = A + np.outer(loop_shaping.design(*plant, k, wi)[3:6], C)
    augmented = expm(h * np.block([[M, np.eye(3)], [np.zeros((3, 6))]]))[:3]
    got = memory[loop_shaping.PHI :].reshape(2, 3, 3)
    np.testing.assert_allclose(
        got,
        (augmented[:, :3], augmented[:, 3:]),
        rtol=1e-12,
        atol=1e-15,
    )
