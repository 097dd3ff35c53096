"""Models of runs: what only a picture needs is deleted, everything else stays."""

import dataclasses
import sys
import weakref

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.tuning import evaluator
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.simulation import model
from smc_mujoco.simulation import run as runs
from smc_mujoco.simulation.model import compile_model, without_scenery
from smc_mujoco.simulation.signals import Push

pytestmark = pytest.mark.quick

REFERRED = """
<mujoco>
  <default><geom size="0.1" contype="0" conaffinity="0"/></default>
  <worldbody>
    <light/>
    <camera/>
    <geom name="floor" type="plane" size="1 1 1" contype="1"/>
    <geom name="wall"/>
    <geom name="pulley" type="sphere"/>
    <geom name="seen"/>
    <geom name="drawn"/>
    <body>
      <geom name="frame"/>
      <site name="from" pos="-1 0 0"/>
      <body pos="1 0 0"><joint type="slide"/><geom name="bob" mass="1"/><site name="to"/></body>
      <body name="lump"><joint type="slide"/><geom name="shape" mass="2" pos=".1 0 0"/></body>
      <body name="cart">
        <joint name="slide" type="slide"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
        <geom name="paint"/><geom name="buffer" conaffinity="1"/>
      </body>
      <body name="column"><geom name="stone"/><body name="dial"><geom name="number"/></body></body>
      <body name="struck"><geom name="glass"/></body>
    </body>
  </worldbody>
  <contact><pair geom1="wall" geom2="bob"/></contact>
  <tendon><spatial><site site="from"/><geom geom="pulley"/><site site="to"/></spatial></tendon>
  <sensor><framepos objtype="geom" objname="seen"/></sensor>
</mujoco>
"""


def named(model: mujoco.MjModel, kind: str) -> list[str]:
    """Return the names of a model's bodies or geoms."""
    count = getattr(model, f"n{kind}")
    return [getattr(model, kind)(i).name for i in range(count)]


def test_what_touches_or_is_referred_to_or_pushed_is_no_scenery_and_bodies_keep_their_mass():
    with_scenery = mujoco.MjSpec.from_string(REFERRED).compile()
    spec = mujoco.MjSpec.from_string(REFERRED)
    without_scenery(spec, {"struck"})
    bare = spec.compile()
    assert named(bare, "geom") == ["floor", "wall", "pulley", "seen", "bob", "buffer"]
    assert named(bare, "body") == ["world", "", "", "lump", "cart", "struck"]
    assert bare.nlight == bare.ncam == 0
    for name in ("body_mass", "body_inertia", "body_ipos", "body_iquat"):
        moving = getattr(with_scenery, name)[[2, 3, 4]]
        np.testing.assert_array_equal(getattr(bare, name)[[2, 3, 4]], moving)


def test_scenery_is_not_deleted_part_by_part_which_takes_a_time_quadratic_in_their_number():
    spec = smc.plant("pendulum_network", n=60).spec()
    deleted = []

    def called(frame, event, function):
        if event == "c_call" and function.__name__ == "delete":
            deleted.append(function)

    before = sys.getprofile()
    sys.setprofile(called)
    try:
        without_scenery(spec)
    finally:
        sys.setprofile(before)
    assert 0 < len(deleted) < 10


COUPLED = 70  # joints; MuJoCo solves sparsely from 60 on


@pytest.mark.parametrize("seed", [1, 2])
def test_many_coupled_joints_move_alike_whether_the_solver_is_dense_or_sparse(seed):
    random = np.random.default_rng(seed)
    world = mujoco.MjSpec()
    world.option.gravity = (0.0, 0.0, 0.0)
    for i in range(COUPLED):
        body = world.worldbody.add_body(pos=(0.1 * i, 0.0, 0.0))
        body.add_joint(name=f"j{i}", type=mujoco.mjtJoint.mjJNT_SLIDE, damping=[0.1, 0.0, 0.0])
        mass = random.choice([0.01, 0.1, 1.0, 5.0])
        body.add_geom(size=(0.02, 0.0, 0.0), mass=mass, contype=0, conaffinity=0)
    for _ in range(COUPLED):
        tendon = world.add_tendon(frictionloss=0.3, limited=True, range=(-0.02, 0.02))
        tendon.solref_limit[0] = 0.005
        for joint in random.choice(COUPLED, 3, replace=False):
            tendon.wrap_joint(f"j{joint}", random.choice([-1.0, 1.0, 2.0]))
    model = world.compile()
    speeds = random.normal(size=COUPLED)
    ends = {}
    for jacobian in (mujoco.mjtJacobian.mjJAC_DENSE, mujoco.mjtJacobian.mjJAC_AUTO):
        model.opt.jacobian = jacobian
        data = mujoco.MjData(model)
        data.qvel[:] = speeds
        mujoco.mj_step(model, data, 200)
        ends[jacobian] = data.qpos.copy()
    dense, default = ends.values()
    assert np.abs(dense).max() > 0.1
    np.testing.assert_allclose(default, dense, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("contact", "geoms"),
    [
        ("none", 0),
        ("stops", 8),
    ],
)
def test_a_run_has_a_model_without_scenery_and_the_same_bits(contact, geoms, monkeypatch):
    scenario = smc.Scenario(
        plant="cart_pole",
        law="classical",
        contact=contact,
        x0=(1.2, 0.0),
        duration=0.5,
    )
    with_scenery = compile_model(scenario)
    bare = compile_model(scenario, scenery=False)
    assert bare.ngeom == geoms
    assert bare.nlight == 0
    assert bare.ncam == 0
    assert bare.npair == with_scenery.npair
    assert bare.nsensor == with_scenery.nsensor
    short = smc.run(scenario)
    monkeypatch.setattr(model, "_mechanisms", weakref.WeakValueDictionary())
    monkeypatch.setattr(model, "without_scenery", lambda *given: None)
    for name, array in smc.run(scenario).arrays().items():
        np.testing.assert_array_equal(array, short.arrays()[name])


def test_a_body_that_is_pushed_stays_in_a_run():
    pushed = smc.Scenario(
        plant="duffing",
        law=smc.law("classical"),
        disturbance=Push("scale", x=1.0),
        duration=0.01,
    )
    without = dataclasses.replace(pushed, disturbance=())
    assert [trace.failure for trace in smc.run([without, pushed])] == [None, None]


MESHES = """<mujoco><asset><mesh name="paint" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>
<mesh name="shell" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1"/></asset><worldbody><light/>
<geom name="base" size=".1" contype="0" conaffinity="0"/><geom type="plane" size="1 1 .1"/>
<body pos="0 0 .3"><joint name="turn" axis="0 1 0"/><geom type="mesh" mesh="shell" pos=".2 0 0"/>
<geom type="mesh" mesh="paint" mass="2" contype="0" conaffinity="0"/></body></worldbody></mujoco>"""


def test_runs_of_a_users_model_have_no_meshes_that_touch_nothing_and_the_same_bits(monkeypatch):
    """It falls on the floor, with the inertia of what is left out; nothing is where a file has all
    inertias from geoms.
    """
    of_geoms = MESHES.replace("<asset>", '<compiler inertiafromgeom="true"/><asset>')
    with_geoms = smc.plant_from(of_geoms, {"turn": smc.Channel(motor=True)}, name="kept")
    scenario = smc.Scenario(plant=with_geoms, law=smc.law("none"))
    assert compile_model(scenario, scenery=False).ngeom == 4
    plant = smc.plant_from(MESHES, {"turn": smc.Channel(motor=True)}, name="painted")
    scenario = smc.Scenario(plant=plant, law=smc.law("none"), x0=0.1, duration=0.4)
    with_scenery = compile_model(scenario)
    bare = compile_model(scenario, scenery=False)
    assert (with_scenery.ngeom, with_scenery.nmesh) == (4, 2)
    assert (bare.ngeom, bare.nmesh, bare.nlight) == (2, 1, 1)
    short = smc.run(scenario)
    monkeypatch.setattr(model, "_mechanisms", weakref.WeakValueDictionary())
    compiled = model.compile_model
    monkeypatch.setattr(model, "compile_model", lambda made, size, scenery: compiled(made, size))
    assert model.mechanism(scenario).model.nmesh == 2
    for name, array in smc.run(scenario).arrays().items():
        np.testing.assert_array_equal(array, short.arrays()[name])


def test_runs_one_after_another_share_a_model_that_none_of_them_changes(monkeypatch):
    compilations = []
    compiled = model.compile_model
    monkeypatch.setattr(model, "_mechanisms", weakref.WeakValueDictionary())
    monkeypatch.setattr(
        model,
        "compile_model",
        lambda *args, **named: compilations.append(args) or compiled(*args, **named),
    )
    numbers = (2.0, 1.0, 1.5), (3.0, 2.0, 0.5), (2.0, 1.0, 1.5)
    first, _, again = (
        smc.run(
            smc.Scenario(
                plant="duffing",
                law=smc.law("classical", k=k),
                mismatch={"M": M},
                x0=x0,
                duration=0.01,
            )
        )
        for k, M, x0 in numbers
    )
    assert len(compilations) == 1
    np.testing.assert_array_equal(again.x, first.x)


def test_a_thread_may_keep_its_model_while_another_counts_the_bytes_of_those_kept(monkeypatch):
    first, second = (smc.Scenario(plant=name, law="pid") for name in ("duffing", "van_der_pol"))
    monkeypatch.setattr(model, "_recent", type(model._recent)())
    monkeypatch.setattr(model, "_mechanisms", weakref.WeakValueDictionary())
    size, meanwhile = mujoco.mj_sizeModel, [second]

    def counted(compiled):
        if meanwhile:  # as if the second thread ran now
            model.mechanism(meanwhile.pop())
        return size(compiled)

    monkeypatch.setattr(mujoco, "mj_sizeModel", counted)
    shared = model.mechanism(first)
    assert shared in model._recent
    assert not meanwhile


OWN = """<mujoco model="own"><worldbody><body><joint name="j" axis="0 1 0"/>
<geom type="sphere" size=".1" pos="0 0 -.5"/></body></worldbody></mujoco>"""


def test_of_large_models_one_is_in_memory_while_runs_and_searches_of_several_are_made(monkeypatch):
    monkeypatch.setattr(model, "MAX_RECENT_BYTES", 0)
    monkeypatch.setattr(evaluator, "LARGE_MODELS", 0)
    monkeypatch.setattr(model, "_recent", [])
    monkeypatch.setattr(model, "_mechanisms", weakref.WeakValueDictionary())
    batches, together = weakref.WeakSet(), []
    make = runs.ScenarioBatch.__init__

    def noted(batch, prepared, *rest):
        together.append((len(prepared), len(model._mechanisms), len(batches)))
        batches.add(batch)
        make(batch, prepared, *rest)

    def alone(*given, **named):
        assert not model._mechanisms
        return compile_model(*given, **named)

    monkeypatch.setattr(runs.ScenarioBatch, "__init__", noted)
    monkeypatch.setattr(model, "compile_model", alone)
    law = smc.law("observer_free", lam=6.0, k1=3.0)
    own = smc.plant_from(OWN, {"j": smc.Channel(motor=True, x0=0.3)})
    cases = [smc.Scenario(plant=own, law=law, duration=0.1, physics_step=h) for h in (1e-3, 5e-4)]
    runs.run_unjudged([*cases, *cases])
    assert together == [(2, 1, 0), (2, 1, 0)]
    together.clear()
    goal = Objective(conditions=("nominal",), duration=0.1)
    evaluator.Evaluator(goal, cases, ("lam",))([(6.0,), (7.0,)])
    assert together == [(1, 1, 0), (1, 1, 0)]
