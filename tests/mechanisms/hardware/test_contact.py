"""Contacts obey Coulomb and Newton: friction stops a block where it must, blows keep the speed they
should.
"""

import math

import mujoco
import numpy as np
import pytest
from helpers.models import unnamed

from smc_mujoco.common import mjcb
from smc_mujoco.mechanisms.hardware.contact import Contact, damping_ratio
from smc_mujoco.mechanisms.plant import plant, plant_catalogue, write_fields

pytestmark = pytest.mark.quick

with mjcb.installed(None):  # this import compiles a model
    pass

STEP = 2.5e-4  # s
G = 9.81  # m/s^2
OFFERED = [
    (name, kind)
    for name, p in sorted(plant_catalogue().items())
    for kind in p.contacts
    if name != "panda"
]
CARTS = pytest.mark.parametrize("name", ["duffing", "van_der_pol"])
# Where a mechanism that nothing else moves meets its obstacle, and the way it goes there.
MEETS = {
    ("duffing", "floor"): (1.7, 1),
    ("duffing", "stops"): (-1.7, -1),
    ("duffing", "peg"): (0.5, -1),
    ("van_der_pol", "floor"): (2.2, 1),
    ("van_der_pol", "stops"): (-2.2, -1),
    ("van_der_pol", "peg"): (0.5, -1),
    ("inverted_pendulum", "floor"): (2.44, 1),
    ("inverted_pendulum", "stops"): (1.0, 1),
    ("inverted_pendulum", "wall"): (0.7, 1),
    ("inverted_pendulum", "peg"): (0.2, -1),
}
HITS = pytest.mark.parametrize(("name", "kind"), MEETS, ids=["-".join(pair) for pair in MEETS])


def idle(name):
    """The plant without its own forces."""
    p = plant_catalogue()[name]
    zero = {}
    for key in p.parameters:
        if key not in ("m", "l", "M"):
            zero[key] = 0.0
    if p.n > 1:
        return plant(name, n=2, **zero)
    return plant(name, **zero)


def built(p, contact, mechanism="equation"):
    spec = p.spec()
    fields = p.fields
    if mechanism != "equation":
        p.mechanisms[mechanism].edit(spec)
        fields = p.mechanisms[mechanism].fields
    contact.check(p)
    contact.edit_on(p, spec)
    spec.option.timestep, spec.option.integrator = STEP, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model = spec.compile()
    write_fields(model, fields(model, p.values({})))
    write_fields(model, contact.fields(model))
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    return model, data


def steps(model, data, seconds):
    """A loop over the steps of so many seconds."""
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        yield


# sliding


@pytest.mark.parametrize(
    ("name", "friction", "mass"),
    [
        ("duffing", 0.05, 0.5),
        ("duffing", 0.3, 2.0),
        ("van_der_pol", 0.1, 2.0),
        ("van_der_pol", 0.6, 0.5),
    ],
)
def test_a_sliding_block_stops_after_v0_squared_over_2_mu_g(name, friction, mass):
    p = plant(name, **{**idle(name).parameters, "M": mass})
    model, data = built(p, Contact("floor", friction=friction))
    speed = math.sqrt(2 * friction * G * 1.5)
    data.qpos[0] = -1.0
    data.qvel[0] = speed
    for _ in steps(model, data, speed / (friction * G) + 0.2):
        pass
    assert data.qpos[0] + 1.0 == pytest.approx(1.5, rel=0.01)
    assert abs(data.qvel[0]) < 1e-5


@CARTS
def test_a_stuck_block_does_not_creep(name):
    model, data = built(idle(name), Contact("floor"))
    data.ctrl[0] = 0.95 * 0.1 * G
    for _ in steps(model, data, 0.2):
        pass
    start = data.qpos[0]
    for _ in steps(model, data, 1.0):
        assert abs(data.qvel[0]) < 1e-5
    assert abs(data.qpos[0] - start) < 1e-6


@CARTS
def test_a_block_breaks_away_at_mu_m_g(name):
    model, data = built(idle(name), Contact("floor", friction=0.2))
    for _ in steps(model, data, 8.0):
        data.ctrl[0] = 0.5 * data.time
        if data.qvel[0] > 1e-4:
            break
    assert data.ctrl[0] == pytest.approx(0.2 * G, rel=0.01)


@pytest.mark.parametrize(
    ("name", "mechanism"),
    [
        ("duffing", "equation"),
        ("van_der_pol", "equation"),
    ],
)
def test_a_block_lies_still_on_its_bed_from_the_start(name, mechanism):
    p = plant(name)
    model, data = built(p, Contact("floor", friction=1.0), mechanism)
    lift = model.joint("lift").qposadr[0]
    data.qpos[0] = 0.3
    for _ in steps(model, data, 1.0):
        assert data.ncon == 4
        assert abs(data.qpos[lift]) < 1e-6
        assert abs(data.qvel).max() < 1e-5
    assert data.qpos[0] == pytest.approx(0.3, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "friction"),
    [
        ("duffing", 0.05),
        ("van_der_pol", 0.2),
        ("duffing", 0.5),
    ],
)
def test_a_sliding_block_never_leaves_its_bed_and_feels_one_force(name, friction):
    model, data = built(idle(name), Contact("floor", friction=friction))
    data.qpos[0] = -1.0
    data.qvel[0] = 2.0
    for _ in steps(model, data, 0.7 * 2.0 / (friction * G) if friction > 0.1 else 1.0):
        assert data.ncon == 4
        if data.time > 0.03:  # the start at speed has died away
            assert data.qfrc_constraint[0] == pytest.approx(-friction * G, rel=0.04)


# blows


BLOWS = [
    (*pair, e)
    for i, pair in enumerate(MEETS)
    for j, e in enumerate((0.1, 0.2, 0.5, 0.8, 0.95))
    if i % 5 == j
]


@pytest.mark.parametrize(("name", "kind", "restitution"), BLOWS)
def test_a_blow_keeps_the_share_of_speed_it_should(name, kind, restitution):
    place, way = MEETS[name, kind]
    for speed, ahead in (
        (0.3, 0.0101),
        (1.0, 0.01004),
        (2.0, 0.01021),
        (3.0, 0.01037),
    ):
        model, data = built(idle(name), contact := Contact(kind, restitution=restitution))
        if kind == "floor" and len(data.qpos) > 1:
            write_fields(
                model,
                Contact(
                    kind,
                    friction=0.0,
                    restitution=restitution,
                ).fields(model),
            )
        data.qpos[0] = place - way * ahead
        data.qvel[0] = way * speed
        for _ in steps(model, data, 1.0):
            if way * data.qvel[0] < 0.0 and way * (data.qpos[0] - place) < -1e-3:
                break
        assert -way * data.qvel[0] == pytest.approx(restitution * speed, rel=0.05), contact


@pytest.mark.parametrize(
    ("name", "restitution", "within"),
    [
        ("pendulum_network", 0.1, 0.13),
        ("inverted_pendulum_network", 0.2, 0.1),
        ("pendulum_network", 0.5, 0.05),
        ("inverted_pendulum_network", 0.95, 0.05),
    ],
)
def test_two_bobs_part_with_their_share_of_speed(name, restitution, within):
    """Their blows are short, so that they cannot slip through each other: few steps for a strong
    dashpot.
    """
    for speed, ahead in (
        (0.3, 0.01),
        (1.0, 0.0103),
        (1.0, 0.0107),
        (3.0, 0.0103),
        (3.0, 0.0107),
    ):
        model, data = built(idle(name), Contact("bobs", restitution=restitution))
        data.qpos[0] = -ahead
        data.qvel[0] = speed
        for _ in steps(model, data, 1.0):
            if data.qvel[1] > data.qvel[0] and data.ncon == 0:
                break
        assert data.qvel[1] - data.qvel[0] == pytest.approx(restitution * speed, rel=within)
        assert data.qvel.sum() == pytest.approx(speed, rel=1e-2)  # the momentum, straight on


@HITS
def test_a_body_that_leans_on_an_obstacle_rests_and_hardly_sinks_in(name, kind):
    place, way = MEETS[name, kind]
    model, data = built(idle(name), Contact(kind))
    data.qpos[0] = place - way * 0.001
    data.ctrl[0] = way * 3.0
    mujoco.mj_step(model, data, round(3.0 / STEP))
    for _ in steps(model, data, 0.1):
        assert abs(data.qvel[0]) < 1e-6
    assert abs(data.qpos[0] - place) < 1e-4


def test_the_damping_ratio_gives_the_restitution_of_a_spring_and_dashpot_that_never_pull():
    """Schwager and Poeschel's case released at zero force, integrated here."""
    for e in (0.05, math.exp(-2.0), 0.3, 0.7, 0.95):  # the second has the damping ratio 1
        zeta = damping_ratio(e)
        h = 1e-4
        x = 0.0
        v = 1.0
        while x + 2 * zeta * v > 0.0:
            half = v - h / 2 * (x + 2 * zeta * v)
            x, v = x + h * half, v - h * (x + h / 2 * v + 2 * zeta * half)
        assert -v == pytest.approx(e, rel=1e-3)


def cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


def tangled(model, data):
    """Whether the rods of two neighbours cross in the plane."""
    n = model.nv
    pivots = np.array([data.body(f"p{i}/pendulum").xpos[[0, 2]] for i in range(n)])
    rods = np.array([data.geom(f"p{i}/bob").xpos[[0, 2]] for i in range(n)]) - pivots
    for a, b, way in zip(rods, rods[1:], np.diff(pivots, axis=0), strict=False):
        across = cross(a, b)
        if across and 0.0 < cross(way, b) / across < 1.0 and 0.0 < cross(way, a) / across < 1.0:
            return True
    return False


@pytest.mark.parametrize("restitution", [0.2, 0.95])
def test_a_chain_that_falls_does_not_tangle(restitution):
    model, data = built(
        plant("inverted_pendulum_network"), Contact("bobs", restitution=restitution)
    )
    rng = np.random.default_rng(3)
    for _ in range(3):
        mujoco.mj_resetData(model, data)
        data.qpos[0] = -0.3
        data.qvel[:] = rng.uniform(-3.0, 3.0, model.nv)
        for k, _ in enumerate(steps(model, data, 3.0)):
            assert k % 40 or not tangled(model, data)


@pytest.mark.parametrize("name", ["pendulum_network", "inverted_pendulum_network"])
def test_bobs_that_start_on_each_others_sides_start_inside(name):
    model, data = built(plant(name), Contact("bobs"))
    data.qpos[:] = plant(name).x0
    mujoco.mj_forward(model, data)
    assert tangled(model, data)
    assert min(contact.dist for contact in data.contact) < -0.01


# energy


# numbers and names


def test_a_contact_without_numbers_keeps_the_plants_own():
    for name, kind in OFFERED:
        p = plant_catalogue()[name]
        model, _ = built(p, Contact(kind))
        assert list(Contact(kind).fields(model)) == []
        rubs = any(model.pair(i).name.startswith("rub:") for i in range(model.npair))
        assert (model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC) == rubs
        assert (model.opt.impratio >= 100.0) == rubs
        assert model.npair > 0
        assert not model.geom_contype.any()
        assert not model.geom_conaffinity.any()
        assert unnamed(model) == []
        assert np.count_nonzero(model.body_mass) == p.n
        assert np.all(model.geom_matid >= 0)
