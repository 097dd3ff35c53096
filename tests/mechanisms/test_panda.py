"""The Panda: its model against Newton and Euler's equations on the maker's frames, its payload,
limits and contacts.

The equations and the published numbers are written again here; nothing of the plant's own file is
used for them.
"""

import dataclasses
import math

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.mechanisms.hardware.contact import Contact

GRAV = 9.81
STATES = 1000
# a, m, and alpha, rad, of the link before; d, m: Franka Emika, modified Denavit-Hartenberg
# parameters
FRAMES = (
    (0, 0, 0.333),
    (0, -math.pi / 2, 0),
    (0, math.pi / 2, 0.316),
    (0.0825, math.pi / 2, 0),
    (-0.0825, -math.pi / 2, 0.384),
    (0, math.pi / 2, 0),
    (0.088, math.pi / 2, 0),
)
# kg, m, kg m^2 about the centre (xx yy zz xy xz yz): Gaz et al. 2019
LINKS = (
    (
        4.970684,
        (0.003875, 0.002081, -0.04762),
        (0.70337, 0.70661, 0.0091170, -0.00013900, 0.0067720, 0.019169),
    ),
    (
        0.646926,
        (-0.003141, -0.02872, 0.003495),
        (0.0079620, 2.8110e-2, 2.5995e-2, -3.925e-3, 1.0254e-2, 7.04e-4),
    ),
    (
        3.228604,
        (2.7518e-2, 3.9252e-2, -6.6502e-2),
        (3.7242e-2, 3.6155e-2, 1.083e-2, -4.761e-3, -1.1396e-2, -1.2805e-2),
    ),
    (
        3.587895,
        (-5.317e-2, 1.04419e-1, 2.7454e-2),
        (2.5853e-2, 1.9552e-2, 2.8323e-2, 7.796e-3, -1.332e-3, 8.641e-3),
    ),
    (
        1.225946,
        (-1.1953e-2, 4.1065e-2, -3.8437e-2),
        (3.5549e-2, 2.9474e-2, 8.627e-3, -2.117e-3, -4.037e-3, 2.29e-4),
    ),
    (
        1.666555,
        (6.0149e-2, -1.4117e-2, -1.0517e-2),
        (1.964e-3, 4.354e-3, 5.433e-3, 1.09e-4, -1.158e-3, 3.41e-4),
    ),
    (
        0.735522,
        (1.0517e-2, -4.252e-3, 6.1597e-2),
        (1.2516e-2, 1.0027e-2, 4.815e-3, -4.28e-4, -1.196e-3, -7.41e-4),
    ),
)
HOME = np.array([0.0, 0.0, 0.0, -math.pi / 2, 0.0, math.pi / 2, -math.pi / 4])
LOW = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])  # rad
HIGH = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])


def rotation(alpha, theta):
    """Of a frame against the one before: about the x of that one, then about its own z."""
    ca = math.cos(alpha)
    sa = math.sin(alpha)
    c = math.cos(theta)
    s = math.sin(theta)
    return np.array([[c, -s, 0], [ca * s, ca * c, -sa], [sa * s, sa * c, ca]])


def cross(a, b):
    """Their vector product: np.cross takes ten times as long."""
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def torques(q, v, a, payload=0.0, lp=0.04, links=LINKS):
    """The torques of the joints by Newton and Euler's recursion, (7,); J. J. Craig, Introduction to
    Robotics, 6.5.
    """
    z = np.array([0.0, 0.0, 1.0])
    steel = 7850.0
    bodies = []
    for m, c, (A, B, C, D, E, F) in links:
        bodies.append([(m, np.array(c), np.array([[A, D, E], [D, B, F], [E, F, C]]))])
    radius = (3 * payload / (4 * math.pi * steel)) ** (1 / 3)
    bodies[6].append((payload, np.array([0, 0, 0.107 + lp]), 0.4 * payload * radius**2 * np.eye(3)))
    turns = []
    for (_, alpha, _), angle in zip(FRAMES, q, strict=True):
        turns.append(rotation(alpha, angle))
    offsets = []
    for a_, al, d in FRAMES:
        offsets.append(np.array([a_, -math.sin(al) * d, math.cos(al) * d]))
    w = np.zeros(3)
    dw = np.zeros(3)
    acc = np.array([0.0, 0.0, GRAV])
    loads = []
    for turn, offset, rate, rise, parts in zip(
        turns,
        offsets,
        v,
        a,
        bodies,
        strict=True,
    ):
        acc = turn.T @ (acc + cross(dw, offset) + cross(w, cross(w, offset)))
        spin = turn.T @ w
        dw = turn.T @ dw + cross(spin, rate * z) + rise * z
        w = spin + rate * z
        force = np.zeros(3)
        moment = np.zeros(3)
        for mass, centre, inertia in parts:
            f = mass * (acc + cross(dw, centre) + cross(w, cross(w, centre)))
            force = force + f
            moment = moment + cross(centre, f) + inertia @ dw + cross(w, inertia @ w)
        loads.append((force, moment))
    published = np.zeros(7)
    force = np.zeros(3)
    moment = np.zeros(3)
    for i in range(6, -1, -1):
        if i < 6:
            moment = turns[i + 1] @ moment + cross(offsets[i + 1], turns[i + 1] @ force)
            force = turns[i + 1] @ force
        force = force + loads[i][0]
        moment = moment + loads[i][1]
        published[i] = moment[2]
    return published


@pytest.mark.quick
@pytest.mark.parametrize("payload", [0.0, 2.0])
def test_a_thousand_states_obey_newton_and_euler(payload):
    rng = np.random.default_rng(7)
    plant = smc.plant("panda", payload=payload)
    model = plant.load()
    data = mujoco.MjData(model)
    worst = 0.0
    for _ in range(STATES if payload else 100):
        q = rng.uniform(LOW, HIGH)
        v = rng.uniform(-2.5, 2.5, 7)
        u = rng.uniform(-1, 1, 7) * plant.limits
        data.qpos[:] = q
        data.qvel[:] = v
        data.ctrl[:] = u
        mujoco.mj_forward(model, data)
        expected = torques(q, v, data.qacc, payload)
        worst = max(worst, np.abs(expected - u).max() / max(1.0, np.abs(data.qacc).max()))
    assert worst < 1e-10


def test_a_mismatch_makes_the_arm_that_of_the_second_set():
    common = {
        "law": "none",
        "x0": HOME,
        "v0": (0.5,) * 7,
        "duration": 0.1,
    }
    unknown = smc.Scenario(
        plant="panda",
        mismatch={"delta": 1.0},
        **common,
    )
    traces = smc.run(
        [
            smc.Scenario(plant="panda", **common),
            unknown,
            smc.Scenario(plant=smc.plant("panda", delta=1), **common),
        ]
    )
    np.testing.assert_array_equal(traces[1].x, traces[2].x)
    assert np.abs(traces[0].x[-1] - traces[1].x[-1]).max() > 1e-3
    with pytest.raises(
        smc.ScenarioError, match=r"panda's delta is 1\.5: give the share of the second set, 0 to 1"
    ):
        smc.run(dataclasses.replace(unknown, mismatch={"delta": 1.5}))


def test_the_flange_is_where_the_makers_frames_put_it():
    model = smc.plant("panda").load()
    data = mujoco.MjData(model)
    rng = np.random.default_rng(9)
    for _ in range(20):
        q = rng.uniform(LOW, HIGH)
        turn = np.eye(3)
        place = np.zeros(3)
        for (a, alpha, d), angle in zip(FRAMES, q, strict=True):
            place = place + turn @ [a, -math.sin(alpha) * d, math.cos(alpha) * d]
            turn = turn @ rotation(alpha, angle)
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(data.site("flange").xpos, place + 0.107 * turn[:, 2], atol=1e-12)
        np.testing.assert_allclose(data.site("tip").xpos, place + 0.195 * turn[:, 2], atol=1e-12)


def test_a_mismatch_and_a_jump_add_kilograms_to_the_payload():
    fields = {"law": "computed_torque_sliding", "duration": 0.1, "control_period": 2e-3}
    unknown = smc.Scenario(
        plant="panda",
        mismatch={"payload": 0.5},
        jump=smc.Jump(0.05, {"payload": 1.5}),
        **fields,
    )
    assert unknown.factors(0) == {"payload": 0.5}
    late = unknown.factors(unknown.jump_step)
    assert unknown.plant.values(late).payload == 2.0
    loaded, plain = (smc.plant("panda", payload=mass) for mass in (2.0, 0.0))
    first = loaded.load()
    second = plain.load({"payload": 2.0})
    for name in ("body_mass", "body_inertia", "body_pos", "geom_size"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    traces = smc.run(
        [
            unknown,
            smc.Scenario(
                plant="panda",
                mismatch={"payload": 0.5},
                **fields,
            ),
        ]
    )
    half = 25
    np.testing.assert_array_equal(traces[0].x[: half + 1], traces[1].x[: half + 1])
    assert np.abs(traces[0].x[-1] - traces[1].x[-1]).max() > 1e-4


@pytest.mark.parametrize("kind", ["table", "wall"])
def test_a_fall_onto_an_obstacle_gains_no_energy(kind):
    """The probe swings down onto the table, or forward against the wall; the arm's stops are met,
    too.
    """
    plant = smc.plant("panda")
    lowest = 0.0
    spec = plant.spec()
    Contact(kind).edit_on(plant, spec)
    spec.option.timestep, spec.option.integrator = 2.5e-4, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    # of the shoulder, of the elbow
    data.qvel[{"table": 1, "wall": 3}[kind]] = {"table": 1.0, "wall": 5.0}[kind]
    mujoco.mj_forward(model, data)
    start = data.energy.sum()
    touched = False
    while data.time < 1.0:
        mujoco.mj_step(model, data)
        touched = touched or data.ncon > 0
        lowest = min(lowest, data.energy[0] - start)
        assert data.energy.sum() - start <= 1e-3 * -lowest
    assert touched


# a point behind each surface to which the tip is sent from home, the surface's axis, its place and
# the way into it
BEHIND = {
    "table": ((0.5545, 0.0, 0.195), 2, 0.2, -1.0),
    "wall": ((0.66, 0.0, 0.5), 0, 0.65, 1.0),
}


@pytest.mark.parametrize("kind", BEHIND)
def test_the_probe_presses_on_a_surface_and_does_not_pass_through(kind):
    point, axis, place, way = BEHIND[kind]
    home = (0.5545, 0.0, 0.5245)
    path = smc.signals.cartesian_path(
        "panda",
        [0.0, 1.0],
        [home, point],
        site="tip",
    )
    common = {
        "plant": "panda",
        "law": "computed_torque_sliding",
        "reference": path,
        "duration": 1.2,
    }
    depths = {}
    for trace in smc.run([smc.Scenario(**common, contact=surface) for surface in (kind, "none")]):
        assert trace.failure is None
        model = trace.scenario.plant.load()
        depth = []
        data = mujoco.MjData(model)
        for q in trace.x[::10]:
            data.qpos[:] = q
            mujoco.mj_kinematics(model, data)
            depth.append(way * (data.geom("probe").xpos[axis] - place) + 0.012)
        contact = trace.scenario.contact
        depths[contact[0].kind if contact else "none"] = np.array(depth)
    assert depths["none"].max() > 0.004
    assert depths[kind][0] < -0.05
    assert depths[kind].max() < 1e-3
    assert 0.0 < depths[kind][-1] < 1.5e-4
