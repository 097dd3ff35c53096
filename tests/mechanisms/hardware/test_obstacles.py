"""Stops, walls and balls on three machines of a user's own: a two-link arm, a cart with a pole, an
arm of meshes. Where they stand, what a blow leaves, and that they change nothing before it.
"""

import dataclasses
import math

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.metrics.tip import contacts
from smc_mujoco.simulation import conditions
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.run import states

ARM = """
<mujoco model="two_link">
  <compiler angle="degree"/>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder" axis="0 1 0" damping="0.02"/>
      <geom type="capsule" size="0.03" fromto="0 0 0 0.4 0 0" mass="1" contype="0" conaffinity="0"/>
      <body name="fore" pos="0.4 0 0">
        <joint name="elbow" axis="0 1 0" damping="0.02"/>
        <geom type="capsule" size="0.03" fromto="0 0 0 0.3 0 0" mass="0.6"/>
        <geom type="sphere" size="0.09" pos="0.3 0 0" mass="0" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="shoulder"/><motor joint="elbow"/></actuator>
</mujoco>
"""
CART = """
<mujoco model="cart_with_pole">
  <option><flag contact="disable"/></option>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 0.1"/>
    <body name="cart" pos="0 0 0.06" >
      <joint name="slide" type="slide" axis="1 0 0"/>
      <geom type="box" size="0.15 0.1 0.08" mass="1"/>
      <body name="pole" pos="0 0 0.08">
        <joint name="hinge" axis="0 1 0"/>
        <geom type="cylinder" size="0.01" fromto="0 0 0 0 0 -0.5" mass="0.2"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="slide"/></actuator>
</mujoco>
"""
VERTICES = np.array(
    [[0, -0.04, -0.04], [0, 0.04, -0.04], [0, 0, 0.05], [0.35, -0.03, 0.02], [0.35, 0.03, -0.03]]
)
MESHES = f"""
<mujoco model="of_meshes">
  <asset><mesh name="link" vertex="{" ".join(map(str, VERTICES.ravel()))}"/></asset>
  <worldbody>
    <body name="first" pos="0 0 1">
      <joint name="turn" axis="0 1 0"/>
      <geom type="mesh" mesh="link" mass="1" contype="0" conaffinity="0"/>
      <body name="second" pos="0.35 0 0" euler="20 0 0">
        <joint name="fold" axis="0 1 0"/>
        <geom type="mesh" mesh="link" mass="0.7"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="turn"/><motor joint="fold"/></actuator>
</mujoco>
"""
Channel = smc.Channel
MACHINES = {  # model, channels, the body that is hit, the way to a wall, its joint and a stop
    "arm": (ARM, {"shoulder": Channel(x0=-0.5), "elbow": Channel(x0=-0.3)}, "fore", "elbow"),
    "cart": (CART, {"slide": Channel(partner="hinge", partner_x0=0.2)}, "cart", "slide"),
    "meshes": (MESHES, {"turn": Channel(x0=-0.5), "fold": Channel(x0=-0.2)}, "second", "fold"),
}
EVERY = pytest.mark.parametrize("name", MACHINES)
STEP = 2.5e-4  # s


def machine(name):
    model, channels, body, joint = MACHINES[name]
    return smc.plant_from(model, channels=channels, name=name), body, joint


def free(name, contact, seconds=0.6, **fields):
    """A run without a law: the arms fall, the cart rolls at 0.8 m/s."""
    plant, _, _ = machine(name)
    if name == "cart":
        fields = {"v0": (0.8, 0.0)} | fields
    common = {"plant": plant, "law": "none", "duration": seconds, "control_period": STEP}
    return smc.run(smc.Scenario(contact=contact, **common | fields))


def wall(name, gap=0.05, restitution=0.3):
    direction = (2, 0, 0) if name == "cart" else (0, 0, -1)
    return smc.Wall(
        machine(name)[1],
        direction=direction,
        gap=gap,
        restitution=restitution,
    )


def distances(trace):
    """The distance of what a pair of the run's model brings together, (K + 1,) m."""
    scenario = trace.scenario
    model = models.with_values(models.compile_model(scenario), scenario)
    data = mujoco.MjData(model)
    gaps = []
    for pose in states(trace, trace.t)[0]:
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        pairs = zip(model.pair_geom1, model.pair_geom2, strict=True)
        gaps.append(min(mujoco.mj_geomDistance(model, data, *pair, 9.0, None) for pair in pairs))
    return np.array(gaps)


def held(name):
    """Fields that hold a machine at its start."""
    plant, _, _ = machine(name)
    rest = [smc.Constant(x) for x in plant.x0[: plant.driven]]
    law = smc.law("pid", kp=4000.0, kd=100.0, ki=0.0)
    return {"law": law, "reference": rest, "u_max": 500.0, "v0": 0.0}


def left_share(gap):
    """The speed at which a blow parts, as a share of the speed before it, from distances sample by
    sample.
    """
    speed = np.diff(gap)
    first = int(np.argmax(gap < 0.0))
    last = first + int(np.argmax(gap[first:] > 0.0))
    assert last > first
    return -speed[first:last].max() / speed[first - 2]


@EVERY
@pytest.mark.parametrize("restitution", [0.3, pytest.param(0.7, marks=pytest.mark.slow)])
def test_a_blow_parts_with_the_share_of_speed_that_was_asked(name, restitution):
    plant, body, joint = machine(name)
    channel = list(MACHINES[name][1]).index(joint)
    end = plant.x0[channel] + 0.2
    stopped = free(name, smc.Stops({joint: (end - 2.0, end)}, restitution), 0.5)
    hit = free(name, wall(name, 0.1, restitution), 0.5)
    ball = smc.Ball(
        body,
        mass=0.01,
        height=0.2,
        restitution=restitution,
    )
    fallen = free(name, ball, 0.3, **held(name))
    gaps = end - stopped.x[:, channel], distances(hit), distances(fallen)
    assert list(map(left_share, gaps)) == pytest.approx([restitution] * 3, abs=0.02)


def corners(name):
    """Points in the axes of the body that is hit, and the radius of the balls around them."""
    if name == "meshes":
        return VERTICES, 0.0
    if name == "arm":
        return np.array([[0, 0, 0], [0.3, 0, 0]]), 0.03
    return np.stack(np.meshgrid((-0.15, 0.15), (-0.1, 0.1), (-0.08, 0.08)), -1).reshape(-1, 3), 0.0


@pytest.mark.quick
@EVERY
@pytest.mark.parametrize("direction", [(0, 0, -1), (1, 0, 0), (1.0, -2.0, 0.5), (-3, 0, 4)])
def test_a_wall_stands_where_the_body_ends_and_the_gap(name, direction):
    plant, body, _ = machine(name)
    part = smc.Wall(body, direction=direction, gap=0.07)
    scenario = smc.Scenario(plant=plant, law="none", contact=part)
    model = models.compile_model(scenario)
    data = mujoco.MjData(model)
    models.put_initial_state(model, data, scenario)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0
    points, radius = corners(name)
    world = points @ data.body(body).xmat.reshape(3, 3).T + data.body(body).xpos
    way = np.array(direction) / math.hypot(*direction)
    place = data.geom(model.pair_geom2[0]).xpos
    assert place @ way - (world @ way).max() - radius == pytest.approx(0.07, abs=1e-6)


@EVERY
def test_a_ball_falls_from_rest_by_its_height(name):
    _, body, _ = machine(name)
    gap = distances(
        free(
            name,
            smc.Ball(body, mass=0.01, height=0.1),
            0.16,
            **held(name),
        )
    )
    assert gap[0] > 0.0
    met = STEP * int(np.argmax(gap < 0.0))
    assert met == pytest.approx(math.sqrt(2 * 0.1 / 9.81), abs=0.001)


@EVERY
def test_the_force_of_contact_is_what_changes_the_momentum_of_a_ball(name):
    _, body, _ = machine(name)
    trace = free(
        name,
        smc.Ball(body, mass=0.1, height=0.1),
        0.2,
        **held(name),
    )
    pressed = contacts(trace)
    struck = np.flatnonzero(pressed.force)
    first = struck[0] - 1
    last = struck[0] + np.argmax(pressed.force[struck[0] :] == 0.0)
    v = states(trace, trace.t)[1][:, -6:-3]
    fallen = np.array([0, 0, -9.81]) * (trace.t[last] - trace.t[first])
    momentum = 0.1 * (v[last] - v[first] - fallen)
    impulse = -np.trapezoid(pressed.push[first : last + 1], trace.t[first : last + 1], axis=0)
    assert np.linalg.norm(impulse) > 0.1
    assert impulse == pytest.approx(momentum, abs=0.02 * np.linalg.norm(momentum))


@EVERY
def test_what_is_far_away_changes_no_bit(name):
    _, body, joint = machine(name)
    far = smc.Stops({joint: (-90.0, 90.0)}), wall(name, gap=90.0), smc.Ball(body, height=90.0)
    stepped = {"integrator": "implicitfast", "physics_step": STEP}
    alone = free(name, None, **stepped)
    for part in (*far, far):
        with_it = free(name, part, **stepped)
        for array, same in zip(with_it.arrays().values(), alone.arrays().values(), strict=True):
            np.testing.assert_array_equal(array, same)


@EVERY
def test_obstacles_are_data(name, tmp_path):
    _, body, joint = machine(name)
    parts = smc.Stops({joint: (-9.0, 9.0)}, 0.5), wall(name), smc.Ball(body, mass=0.2)
    trace = free(name, parts, 0.01)
    again = smc.load(trace.save(tmp_path / "run.npz"))
    assert again.scenario == trace.scenario
    assert hash(again.scenario) == hash(trace.scenario)
    condition = smc.condition("hit", contact=parts)
    read = conditions.find_condition(str(condition))
    assert read.on(trace.scenario.plant, 1.0)["contact"] == parts
    bouncier = dataclasses.replace(parts[0], restitution=0.6)
    assert dataclasses.replace(trace.scenario, contact=bouncier) != trace.scenario


@EVERY
def test_what_does_not_fit_is_refused_with_the_names_that_there_are(name, refused):
    plant, body, joint = machine(name)
    refused(lambda: free(name, smc.Stops({"knee": (-1, 1)})), "knee", joint)
    refused(lambda: free(name, smc.Ball("knee")), "knee", body)
    refused(lambda: free(name, smc.Wall("world", (0, 0, 1), 0.1)), "world", body)
    refused(lambda: smc.Wall(body, (0, 0), 0.1), "direction", "(0, 0, -1)")
    refused(lambda: smc.Stops({joint: (1, -1)}), joint, "lowest first")
    refused(lambda: free(name, "stops"), "stops", "none")
    refused(lambda: free(name, smc.Stops({joint: (4, 5)})), joint, "4 and 5", "x0")
    away = [x + 0.9 for x in plant.x0]
    refused(lambda: free(name, wall(name), x0=away), body, "wall", "x0")


# a robot that stands {deep} m deep in its floor, and whose arm stands in its base
STANDING = """<mujoco model="dog"><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
<body name="base" pos="0 0 {high}"><freejoint/><geom name="trunk" type="box" size=".2 .1 .12"
mass="5"/><body name="arm" pos="0 0 .1"><joint name="arm" axis="0 1 0" range="-57 57" damping=".1"/>
<geom name="rod" type="capsule" fromto="0 0 {base} 0 0 .3" size=".02" mass=".3"/><body
name="hand" pos="0 0 .3"><geom name="hand" size=".03" mass=".1"/></body></body></body></worldbody>
<contact><pair geom1="trunk" geom2="hand"/></contact><actuator><motor joint="arm"
ctrlrange="-5 5"/></actuator></mujoco>"""


@pytest.mark.parametrize("deep", [0.0, 1.5e-3, 4e-3])
def test_a_robot_that_stands_a_little_in_its_floor_takes_any_obstacle(deep):
    text = STANDING.format(high=0.12 - deep, base=0.05)
    dog = smc.plant_from(text, {"arm": smc.Channel(x0=0.3)}, others="held")
    law = smc.law("pid", kp=3.0, ki=0.0, kd=0.3)
    ball = smc.Ball("arm", mass=0.05, height=0.02)
    wall = smc.Wall("arm", direction=(1, 0, 0), gap=0.05)
    for part in (smc.Stops({"arm": (-0.5, 0.5)}), ball, wall):
        run = smc.Scenario(plant=dog, law=law, contact=part, duration=0.05)
        assert smc.run(run).failure is None
    with pytest.raises(smc.ScenarioError, match=r"x0 \(-0\.6,\) of dog 'rod' is beyond the obst"):
        smc.run(dataclasses.replace(run, contact=ball, x0=-0.6))
    with pytest.raises(
        smc.ScenarioError, match=r"mm in its wall \(the gap of 50 mm .* x0, 0\.3\): "
    ):
        dataclasses.replace(run, x0=0.8)


@EVERY
def test_a_goal_in_an_obstacle_is_said(name):
    plant, body, joint = machine(name)
    goal = smc.Constant(0.9)
    for part, words in ((smc.Stops({joint: (-0.7, 0.8)}), joint), (wall(name), body)):
        with pytest.warns(smc.errors.ScenarioWarning, match=f"reference.*{words}"):
            smc.Scenario(
                plant=plant,
                law=smc.law("pid"),
                reference=goal,
                contact=part,
            )


SLIDER = """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="s" type="slide"
axis="1 0 0"/><geom size=".05" mass="3" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor joint="s"/></actuator></mujoco>"""


@pytest.mark.parametrize("restitution", [0.1, 0.8])
def test_reactions_of_a_blow_sum_up_to_its_impulse_over_where_samples_fall(restitution):
    """A sum of samples is off by where they fall after the first contact, at which the force jumps
    from 0 to its damper's: by up to half of it for a period."""
    plant = smc.plant_from(SLIDER, ["s"])
    stops = smc.Stops({"s": (-0.05, 0.05)}, restitution)
    period, speed = 5e-4, 2.0
    runs = []
    for late in np.arange(8) / 8:
        start = {"x0": -late * period * speed, "v0": speed, "duration": 0.06}
        run = smc.Scenario(plant=plant, law="none", contact=stops, control_period=period, **start)
        runs.append(run)
    impulses = []
    for trace in smc.run(runs):
        lost = speed - trace.v.min()
        impulses.append(-trace.reaction.sum() * period / (3.0 * lost))
    assert np.mean(impulses) == pytest.approx(1.0, abs=2e-3)
    assert np.ptp(impulses) > 0.01
