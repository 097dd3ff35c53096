"""Real springs between the rods of a network agree with its coupling where they must."""

import mujoco
import numpy as np
import pytest

from smc_mujoco.mechanisms.geometry.pendulum_chain import HOOK_ARM
from smc_mujoco.mechanisms.hardware.contact import Contact
from smc_mujoco.mechanisms.plant import plant, write_fields

pytestmark = pytest.mark.quick

NETWORKS = pytest.mark.parametrize("name", ["pendulum_network", "inverted_pendulum_network"])


def built(p, mechanism="springs", contact="none"):
    spec = p.spec()
    p.mechanisms[mechanism].edit(spec)
    Contact(contact).edit_on(p, spec)
    model = spec.compile()
    write_fields(model, p.mechanisms[mechanism].fields(model, p.values({})))
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    return model, data


def pull(model, data, x, v=0.0):
    """x'' at a state."""
    data.qpos[:] = x
    data.qvel[:] = v
    mujoco.mj_forward(model, data)
    return data.qacc.copy()


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
