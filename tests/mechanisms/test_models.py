"""Each model is its equation and nothing else: held against `nominal` at random states, for every
plant.
"""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.mechanisms.custom.nominal_model import NominalModel
from smc_mujoco.mechanisms.layout import joint_ids
from smc_mujoco.mechanisms.plant import plant, plant_catalogue, write_fields

pytestmark = pytest.mark.quick

ALL = sorted(plant_catalogue())
NAMES = [
    name for name in ALL if not plant_catalogue()[name].pose
]  # of a free body see test_quadrotor.py
# largest n -> which are tested
SIZES = {
    1: [1],
    2: [2],
    7: [7],
}
SIZED = [(name, n) for name in NAMES for n in SIZES.get(plant_catalogue()[name].sizes[1], [2, 5])]
CASES = pytest.mark.parametrize(("name", "n"), SIZED, ids=[f"{name}-{n}" for name, n in SIZED])
PLANTS = pytest.mark.parametrize("name", ALL)


def sized(name, n, **parameters):
    """The plant without dry friction, which is tested in tests/mechanisms/test_rig_plants.py."""
    size = {"n": n} if n > 1 else {}
    return plant(
        name,
        **size,
        **dict.fromkeys(plant_catalogue()[name].dry, 0.0),
        **parameters,
    )


def changed(name, n, rng):
    """The plant with every parameter moved by up to 40%."""
    wet = {}
    for key, value in sized(name, n).parameters.items():
        if key not in plant_catalogue()[name].dry:
            wet[key] = value
    return sized(
        name, n, **{key: (value or 0.1) * rng.uniform(0.6, 1.4) for key, value in wet.items()}
    )


def expected(p, x, v, u):
    """x'' by the plant's nominal equation, (n,), and the size of its largest term."""
    parameters = SimpleNamespace(**p.parameters)
    if isinstance(p.nominal, NominalModel):
        inputs = (u,)
    else:
        inputs = ()
    terms = [p.nominal(x, v, i, parameters, *inputs) for i in range(p.n)]
    # that of the joint it moves with
    forces = []
    for i in range(p.n):
        forces.append(u[i if i < p.driven else i - p.driven])
    acc = np.array([f + g * force for (f, g), force in zip(terms, forces, strict=True)])
    size = max(max(abs(f), abs(g * force)) for (f, g), force in zip(terms, forces, strict=True))
    return acc, size


def within(p, x):
    """x from -2 .. 2, scaled to the ranges of the joints that have limits: the equation knows of
    none.
    """
    if not p.ranges:
        return x
    low, high = np.array([channel_range[1:] for channel_range in p.ranges]).T
    return low + (high - low) * (x + 2) / 4


def acceleration(model, data, x, v, u):
    joints = joint_ids(model)  # one coordinate each
    data.qpos[joints] = x
    data.qvel[joints] = v
    data.ctrl[:] = u[: model.nu]
    mujoco.mj_forward(model, data)
    return data.qacc[joints].copy()


def worst_error(p, model, rng, trials=20):
    """The largest |qacc - (f + g u)| over random states, relative to the largest term."""
    data = mujoco.MjData(model)
    worst = 0.0
    for _ in range(trials):
        x = within(p, rng.uniform(-2, 2, p.n))
        v = rng.uniform(-3, 3, p.n)
        u = rng.uniform(-6, 6, p.n)
        acc, size = expected(p, x, v, u)
        worst = max(worst, np.abs(acceleration(model, data, x, v, u) - acc).max() / size)
    return worst


@CASES
def test_the_model_obeys_its_equation_with_its_own_and_with_other_parameters(name, n):
    rng = np.random.default_rng(1)
    p = sized(name, n)
    assert worst_error(p, p.load(), rng) < 1e-9
    changes = [changed(name, n, rng) for _ in range(2)]
    for change in changes:
        assert worst_error(change, change.load(), rng) < 1e-9
    model = p.load()  # as a jump does in a running simulation
    write_fields(model, changes[0].fields(model, changes[0].values({})))
    mujoco.mj_setConst(model, mujoco.MjData(model))
    assert worst_error(changes[0], model, rng) < 1e-9


def test_a_long_chain_obeys_its_equation():
    p = sized("pendulum_network", 40)
    assert (
        worst_error(
            p,
            p.load(),
            np.random.default_rng(1),
            trials=5,
        )
        < 1e-9
    )


@CASES
def test_every_parameter_is_felt_by_the_model(name, n):
    """Without this, a parameter missing from `fields` and from `nominal` alike would pass."""
    rng = np.random.default_rng(4)
    size = {"n": n} if n > 1 else {}
    p = plant_catalogue()[name]
    values = {key: value or 0.01 * min((1.0, *p.limits)) for key, value in p.parameters.items()}
    x = within(p, rng.uniform(1.1, 2, n))
    v = rng.uniform(1, 3, n)
    u = rng.uniform(1, 6, n) * min((1.0, *p.limits))
    before = plant(name, **size, **values).load()
    for key, value in values.items():
        after = plant(name, **size, **values | {key: 1.25 * value}).load()
        a, b = (acceleration(m, mujoco.MjData(m), x, v, u) for m in (before, after))
        assert np.all(np.abs(a - b) > 1e-6), key


@PLANTS
def test_default_fields_change_nothing_of_the_compiled_file(name):
    p = plant_catalogue()[name]
    model = p.spec().compile()
    for field, index, value, _ in p.fields(model, p.values({})):
        if field.startswith("opt."):
            owner = model.opt
        else:
            owner = model
        compiled = getattr(owner, field.removeprefix("opt."))
        assert np.all(compiled[index] == np.asarray(value)), field


@CASES
def test_nothing_moves_but_the_equation(name, n):
    p = sized(name, n)
    model = p.load()
    assert model.nv == model.nq == n
    assert model.nu == p.driven
    assert not model.dof_armature.any()
    assert not model.dof_frictionloss.any()
    assert not model.tendon_frictionloss.any()
    assert not model.tendon_armature.any()
    assert model.jnt_limited.all() if p.ranges else not model.jnt_limited.any()
    np.testing.assert_array_equal(
        model.jnt_range[joint_ids(model)] if p.ranges else (),
        [channel_range[1:] for channel_range in p.ranges],
    )
    assert not model.geom_contype.any()
    assert not model.geom_conaffinity.any()
    assert model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT
    assert model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_AUTORESET
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4
    assert model.opt.timestep == 1e-3
    assert not model.actuator_ctrllimited.any()
    assert np.all(model.actuator_gear[:, 0] == 1.0)


@pytest.mark.parametrize("name", ["cart_pole", "pendulum_network", "overhead_crane"])
def test_a_true_parameter_beyond_what_a_plant_takes_is_refused(name):
    with pytest.raises(
        smc.ScenarioError, match=rf"{name}'s true l becomes \S+: give other factors"
    ):
        smc.run(
            smc.Scenario(
                plant=name,
                law="none",
                duration=0.01,
                mismatch={"l": 1e277},
            )
        )
