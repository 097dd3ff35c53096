"""Plants with a joint that no actuator drives, and the law that is for them.

The equations are written again here, as mass matrix and forces; nothing of the plants' own
`nominal` is used for them.
"""

import dataclasses
import itertools
import math
from collections import namedtuple
from types import SimpleNamespace

import mujoco
import numba
import numpy as np
import pytest

import smc_mujoco as smc

NAMES = ("cart_pole", "overhead_crane")
PLANTS = pytest.mark.parametrize("name", NAMES)
GRAV = 9.81
# m, L of the law's docstring
LENGTH = {"cart_pole": 4.0 / 3.0 * 0.5, "overhead_crane": -0.7}
LAW = SimpleNamespace(**smc.law("hierarchical").gains)


def acceleration(name, p, x, v, u):
    """(x'', q'') from the Lagrangian: the body's middle lies at x + l sin q, up cos q or down; I
    about it.
    """
    if name == "cart_pole":
        up = 1.0
        inertia = p.m * p.l**2 / 3
    else:
        up = -1.0
        inertia = 0.0
    lever = up * p.m * p.l * math.cos(x[1])
    mass = np.array([[p.M + p.m, lever], [lever, p.m * p.l**2 + inertia]])
    swing = up * p.m * p.l * math.sin(x[1])
    force = np.array([u - p.b * v[0] + swing * v[1] ** 2, p.grav * swing - p.bq * v[1]])
    return np.linalg.solve(mass, force)


def changed(name, rng):
    """The plant with every parameter moved by up to 40 %, and with friction."""
    values = {}
    for key, value in smc.plant(name).parameters.items():
        values[key] = (value or 0.3) * rng.uniform(0.6, 1.4)
    return smc.plant(name, **values)


def scenario(name, law="hierarchical", **fields):
    return smc.Scenario(
        plant=name,
        law=law,
        model=fields.pop("model", "nominal"),
        **fields,
    )


def bound(trace):
    """The largest error of the last fifth, of the cart in m or of what it carries in rad, over the
    largest x0.
    """
    assert trace.failure is None
    start = max(map(abs, trace.scenario.resolved.x0))
    return max(scores["ultimate_bound"] for scores in smc.scores(trace).values()) / start


def surface(trace, law=LAW):
    """S from the true state."""
    (x, q), (v, dq) = trace.x.T, trace.v.T
    return law.a * (v + law.c1 * x) + dq + law.c2 * q


# the plants


@pytest.mark.quick
@PLANTS
def test_the_model_is_its_equation(name):
    rng = np.random.default_rng(0)
    for p in (smc.plant(name), *(changed(name, rng) for _ in range(5))):
        model = p.load()
        values = SimpleNamespace(**p.parameters)
        data = mujoco.MjData(model)
        for _ in range(20):
            data.qpos[:] = rng.uniform(-2, 2, 2)
            data.qvel[:] = rng.uniform(-3, 3, 2)
            data.ctrl[:] = rng.uniform(-6, 6)
            mujoco.mj_forward(model, data)
            expected = acceleration(name, values, data.qpos, data.qvel, data.ctrl[0])
            assert np.abs(data.qacc - expected).max() < 1e-9 * max(1.0, np.abs(expected).max())


@PLANTS
def test_nominal_is_the_equation_of_both_joints_and_compiles_to_it(name):
    rng = np.random.default_rng(1)
    Parameters = namedtuple("Parameters", smc.plant(name).parameters)
    compiled = numba.njit(smc.plant(name).nominal)
    for _ in range(20):
        p = changed(name, rng)
        x = rng.uniform(-2, 2, 2)
        v = rng.uniform(-3, 3, 2)
        u = rng.uniform(-6, 6)
        values = Parameters(**p.parameters)
        for i, expected in enumerate(acceleration(name, values, x, v, u)):
            f, g = p.nominal(x, v, i, values)
            assert f + g * u == pytest.approx(expected, rel=1e-11, abs=1e-11)
            assert compiled(x, v, i, values) == (f, g)


def energies(p, trace):
    """Kinetic and potential energy of a run, J."""
    model = p.load()
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data = mujoco.MjData(model)
    totals = []
    for x, v in zip(trace.x, trace.v, strict=True):
        data.qpos[:] = x
        data.qvel[:] = v
        mujoco.mj_forward(model, data)
        totals.append(data.energy.sum())
    return np.array(totals)


@PLANTS
def test_the_stops_end_the_rail(name):
    """A blow at 2 m/s goes about 1 cm deep (contact.DEPTH), and loses energy."""
    p = smc.plant(name)
    run = scenario(
        p,
        "none",
        model="none",
        x0=0.0,
        v0=(2.0, 0.0),
        contact="stops",
        duration=2.0,
    )
    trace = smc.run(run)
    assert 1.69 < trace.x[:, 0].max() < 1.72
    assert trace.v[:, 0].min() < -0.3
    energy = energies(p, trace)
    assert energy[-1] < energy[0] - 0.2
    assert energy[-1] == pytest.approx(energy[np.argmin(trace.v[:, 0])], abs=0.05 * abs(energy[0]))


# the law


@PLANTS
def test_s_is_zero_in_the_time_of_its_reaching_law_and_stays(name):
    trace = smc.run(scenario(name, u_max=math.inf))
    S = surface(trace)
    np.testing.assert_allclose(S, trace.s[:, 0], atol=1e-12)
    reached = trace.t[np.flatnonzero(np.abs(S) > 2e-3 * LAW.k)[-1] + 1]
    assert reached == pytest.approx(math.log(1 + LAW.rate * abs(S[0]) / LAW.k) / LAW.rate, rel=0.02)
    assert np.abs(S[trace.t > reached]).max() <= 2e-3 * LAW.k


@PLANTS
def test_a_matched_force_is_tolerated_up_to_k_and_beyond_it_s_is_the_rest_over_rate(name):
    p = smc.plant(name)
    values = SimpleNamespace(**p.parameters)
    (_, g), (_, gq) = (p.nominal(np.zeros(2), np.zeros(2), i, values) for i in (0, 1))
    b = abs(LAW.a * g + gq)
    small = 0.8 * LAW.k / b
    large = 1.5 * LAW.k / b
    held, beyond = smc.run(
        [
            scenario(
                name,
                disturbance=smc.Constant(d),
                duration=15.0,
            )
            for d in (small, large)
        ]
    )
    assert bound(held) <= 0.05
    assert np.abs(surface(held)[-1000:]).max() <= 3e-3 * LAW.k
    np.testing.assert_allclose(np.abs(surface(beyond)[-1000:]), 0.5 * LAW.k / LAW.rate, rtol=0.02)


ROUTH = [  # a L, c1, c2
    (0.45, 0.67, 3.6), (0.9, 1.0, 1.3), (0.2, 1.0, 4.0),
    (0.45, 1.3, 1.0), (1.1, 1.0, 1.3), (0.45, -0.3, 3.0),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("name", "gains"), list(zip(itertools.cycle(NAMES), ROUTH)))
def test_the_motion_on_the_surface_is_stable_exactly_where_its_roots_say(name, gains):
    """S -> 0 does not suffice: with gains beyond the condition S stays at 0 while both joints run
    away.
    """
    aL, c1, c2 = gains
    L = LENGTH[name]
    a = aL / abs(L)
    roots = np.roots([1 - a * L, c2 - a * L * c1, a * GRAV, a * c1 * GRAV])
    stable = roots.real.max() < 0
    assert stable == (0 < c1 < c2 and a * L < 1)

    gains = {
        "a": a,
        "c1": c1,
        "c2": c2,
        "k": 1e-3,
        "rate": 5.0,
    }
    law = dataclasses.replace(smc.law("hierarchical"), gains=gains)  # unchecked
    start = np.array([c2, -a * c1]) / math.hypot(c2, a * c1) * 1e-3  # on the surface
    seconds = 5.0 / abs(roots.real.max())
    trace = smc.run(
        scenario(
            name,
            law,
            x0=start.tolist(),
            duration=seconds,
            u_max=math.inf,
        )
    )
    assert trace.failure is None
    sizes = np.linalg.norm(trace.x, axis=1)
    late = sizes[-len(sizes) // 5 :].max() / sizes[0]
    assert late < 0.2 if stable else late > 5.0
    S = surface(trace, SimpleNamespace(**gains))
    assert np.abs(S).max() < 0.01 * max(np.abs(trace.x).max(), np.abs(trace.v).max())
