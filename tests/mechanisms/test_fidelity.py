"""Mechanisms built by other means agree with their equations where they must, and depart as far as
they say.
"""

import mujoco
import numpy as np
import pytest

from smc_mujoco.mechanisms.geometry.pendulum_chain import HOOK_ARM
from smc_mujoco.mechanisms.hardware.contact import Contact
from smc_mujoco.mechanisms.plant import catalogue, plant, write

pytestmark = pytest.mark.quick

NETWORKS = pytest.mark.parametrize("name", ["pendulum_network", "inverted_pendulum_network"])
OTHERS = [(name, other) for name, p in sorted(catalogue().items()) for other in p.mechanisms]


def built(p, mechanism="springs", contact="none"):
    spec = p.spec()
    p.mechanisms[mechanism].edit(spec)
    Contact(contact).edit_on(p, spec)
    model = spec.compile()
    write(model, p.mechanisms[mechanism].fields(model, p.values({})))
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    return model, data


def pull(model, data, x, v=0.0):
    """x'' at a state."""
    data.qpos[:] = x
    data.qvel[:] = v
    mujoco.mj_forward(model, data)
    return data.qacc.copy()


DUFFINGS = [
    {},
    {"alpha": -2.0, "beta": 0.5, "M": 3.0},
    {"alpha": -0.3, "beta": 4.0},
]


@pytest.mark.parametrize("parameters", DUFFINGS)
def test_two_preloaded_springs_have_duffings_wells_and_their_stiffness(parameters):
    p = plant("duffing", **parameters)
    model, data = built(p)
    a, b, m = (p.parameters[key] for key in ("alpha", "beta", "M"))
    well = np.sqrt(-a / b)
    small = 1e-5
    for place in (-well, 0.0, well):
        assert pull(model, data, place) == pytest.approx(0.0, abs=1e-12)
    slope = (pull(model, data, well + small) - pull(model, data, well - small)) / (2 * small)
    assert slope == pytest.approx(2 * a / m, rel=1e-6)
    assert pull(model, data, 0.1) > 0.0  # the middle snaps through
    assert pull(model, data, well, 1.0) == pytest.approx(-p.parameters["delta"] / m)


def test_the_hill_between_duffings_wells_is_nineteen_percent_too_high():
    model, data = built(plant("duffing", delta=0.0))
    data.qpos[0] = 0.0
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    mujoco.mj_forward(model, data)
    assert data.energy[0] == pytest.approx(0.25 * 1.19, rel=0.005)


@pytest.mark.parametrize(
    "parameters",
    [
        {},
        {"mu": 2.5, "k": 3.0, "M": 0.5},
    ],
)
def test_the_active_and_the_transverse_damper_change_sign_where_van_der_pols_does(parameters):
    p = plant("van_der_pol", **parameters)
    model, data = built(p)
    mu, k, m = (p.parameters[key] for key in ("mu", "k", "M"))
    for x in (-2.0, -1.0, 0.0, 0.5, 1.0):
        assert pull(model, data, x) == pytest.approx(-k * x / m, abs=1e-9)
    for v in (-3.0, 2.0):
        assert pull(model, data, 0.0, v) == pytest.approx(mu * v / m)
        assert pull(model, data, 1.0, v) == pytest.approx(-k / m, rel=1e-9)
        assert pull(model, data, -1.0, v) == pytest.approx(k / m, rel=1e-9)
    assert pull(model, data, 2.0, 1.0) + 2 * k / m == pytest.approx(mu / m * (1 - 10 * 4 / (4 + 9)))


def test_the_limit_cycle_of_the_built_van_der_pol_reaches_two_metres_and_twelve_centimetres():
    model, data = built(plant("van_der_pol"))
    data.qpos[0] = 1.0
    mujoco.mj_step(model, data, 30_000)
    reached = []
    for _ in range(7_000):  # a period takes 6.6 s
        mujoco.mj_step(model, data)
        reached.append(abs(data.qpos[0]))
    assert max(reached) == pytest.approx(2.118, abs=0.002)


@NETWORKS
def test_a_spring_between_rods_gives_kc_times_the_sine_of_the_difference(name):
    p = plant(name, b=0.0, grav=0.0)
    model, data = built(p)
    x = np.random.default_rng(1).uniform(-1.0, 1.0, p.n)
    torque = p.parameters["kc"] * np.sin(np.diff(x))
    expected = np.zeros(p.n)
    expected[:-1] += torque
    expected[1:] -= torque
    np.testing.assert_allclose(
        pull(model, data, x) * 0.5 * 0.5**2,
        expected,
        rtol=1e-9,
        atol=1e-12,
    )
    assert p.parameters["l"] > HOOK_ARM


@NETWORKS
def test_in_a_row_a_spring_between_rods_has_the_couplings_stiffness(name):
    p = plant(name, b=0.0, grav=0.0)
    model, data = built(p, contact="bobs")
    assert pull(model, data, 0.0) == pytest.approx(np.zeros(p.n), abs=1e-12)
    x = np.zeros(p.n)
    x[1] = 1e-6
    torque = pull(model, data, x) * 0.5 * 0.5**2
    np.testing.assert_allclose(torque[:3], 0.5e-6 * np.array([1.0, -2.0, 1.0]), rtol=1e-4)


DEVIATIONS = {
    "duffing": 0.189,
    "van_der_pol": 0.231,
    "pendulum_network": 0.164,
    "inverted_pendulum_network": 0.312,
}


def test_every_other_mechanism_has_its_deviation_here():
    assert {name for name, _ in OTHERS} == set(DEVIATIONS)
