"""The integrator and the step of a user's model: RK4 while it is stable, however much the file may
touch; and what a run cannot resolve is told in one sentence.
"""

import dataclasses
import json
from pathlib import Path

import integrators
import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.tuning.objective import Objective, objectives
from smc_mujoco.errors import ScenarioWarning
from smc_mujoco.hardware import ElasticJoint, LuGre
from smc_mujoco.mechanisms.custom import poles
from smc_mujoco.simulation import integration, resolution

CHAIN = """<mujoco model="chain"><compiler angle="radian"/>
<default><geom type="capsule" size=".02" contype="0" conaffinity="0"/></default><worldbody>
<body name="upper" pos="0 0 1"><joint name="j1" axis="0 1 0" armature=".01" {0}/>
<geom name="u" fromto="0 0 0 0 0 -.3" mass=".6"/>
<body name="fore" pos="0 0 -.3"><joint name="j2" axis="0 1 0" armature=".01" {0}/>
<geom name="f" fromto="0 0 0 0 0 -.25" mass=".4"/></body></body></worldbody>
<actuator><motor joint="j1" ctrlrange="-20 20"/><motor joint="j2" ctrlrange="-10 10"/></actuator>
{1}</mujoco>"""
FINGER = """<mujoco model="finger"><compiler angle="radian"/>
<default><geom type="capsule" size=".006" contype="0" conaffinity="0"/></default><worldbody>
<body pos="0 0 .3"><joint name="j1" axis="0 1 0" damping="{0}"/>
<geom fromto="0 0 0 0 0 .04" mass=".02"/><body pos="0 0 .04">
<joint name="j2" axis="0 1 0" damping="{0}"/><geom fromto="0 0 0 0 0 .03" mass=".012"/></body></body>
</worldbody><actuator><motor joint="j1" ctrlrange="-.3 .3"/><motor joint="j2" ctrlrange="-.2 .2"/>
</actuator></mujoco>"""
WHEEL = """<mujoco model="wheel"><compiler angle="radian"/><worldbody><body><joint name="a" {}/>
<geom type="sphere" size=".1" mass="0" contype="0" conaffinity="0"/>
<inertial pos="0 0 0" mass="1" diaginertia="2 2 2"/></body><body name="other" pos="1 0 0">
<joint name="b"/><geom type="sphere" size=".1" mass="0" contype="0" conaffinity="0"/>
<inertial pos="0 0 0" mass="1" diaginertia="2 2 2"/></body></worldbody>
<actuator><motor joint="b"/>{}</actuator></mujoco>"""
RANGE = 'range="-6 6"'
PARTS = {name: smc.Coulomb(level) for name, level in (("j1", 0.5), ("j2", 0.2))}


def chain(joint="", more="", text=CHAIN):
    channels = {"j1": smc.Channel(x0=0.3), "j2": smc.Channel(x0=-0.2)}
    return smc.plant_from(text.format(joint, more), channels)


def scenario(joint="", more="", text=CHAIN, **fields):
    fields = {"law": "pid", "duration": 2.0, "reference": smc.Sine(0.3, 3.0)} | fields
    return smc.Scenario(plant=chain(joint, more, text), **fields)


def of_file(level_1, level_2):
    """The chain with frictionloss in its file."""
    text = CHAIN.replace("{0}/>", f'{{0}} frictionloss="{level_1}"/>', 1)
    return text.replace("{0}/>", f'{{0}} frictionloss="{level_2}"/>', 1)


@pytest.mark.quick
@pytest.mark.parametrize(
    ("fields", "integrator", "step"),
    [
        ({}, "RK4", 1e-3),
        ({"joint": RANGE}, "RK4", 1e-3),
        ({"joint": f'{RANGE} solreflimit=".005 1"'}, "RK4", 5e-4),
        ({"joint": f'{RANGE} solreflimit="-1e6 -100"'}, "RK4", 2.5e-4),
        ({"joint": RANGE, "contact": smc.Wall("fore", direction=(1, 0, 0), gap=1.0)}, "RK4", 5e-4),
        ({"joint": 'damping="15"'}, "RK4", 5e-4),
        ({"joint": RANGE, "friction": smc.Viscous(15.0)}, "RK4", 5e-4),
        ({"joint": f'damping="8" {RANGE}', "mismatch": {"mass": 0.5}}, "RK4", 5e-4),
        ({"joint": 'damping="120"'}, "implicitfast", 2.5e-4),
        ({"joint": 'damping="8"', "physics_step": 5e-3, "control_period": 5e-3}, "implicitfast", 0),
        ({"joint": RANGE, "friction": PARTS}, "RK4", 2.5e-4),
        ({"text": of_file(0.5, 0.2), "friction": smc.Viscous(0.01)}, "RK4", 2.5e-4),
        ({"joint": RANGE, "friction": LuGre(0.3, 0.4, 0.1, 300.0)}, "implicitfast", 2.5e-4),
        ({"joint": RANGE, "actuator": smc.Backlash(0.01, 0.01)}, "implicitfast", 1.25e-4),
        ({"joint": RANGE, "actuator": ElasticJoint(200.0, 0.0, 0.1)}, "RK4", 1e-3 / 3),
        ({"joint": RANGE, "integrator": "Euler"}, "Euler", 2.5e-4),
    ],
    ids=str,
)
def test_a_users_model_is_stepped_by_its_fastest_rates(fields, integrator, step):
    resolved = scenario(**fields).resolved
    assert resolved.integrator == integrator
    assert resolved.physics_step == (step or fields["physics_step"])


@pytest.mark.parametrize(
    ("joint", "more", "part", "expected"),
    [
        ('damping="8"', "", (), 4.0),
        ('stiffness="50"', "", (), 5.0),
        ("", '<position joint="a" kp="2" kv="12"/>', (), 5.828),  # roots of 2 p^2 + 12 p + 2
        ("", '<general joint="a" dyntype="filter" dynprm=".01"/>', (), 100.0),
        ("", "", (smc.Viscous(8.0),), 4.0),
    ],
)
def test_poles_are_those_of_dampers_springs_servos_lags_and_parts(joint, more, part, expected):
    plant = smc.plant_from(WHEEL.format(joint, more), ["b"], others="file")
    assert poles.fastest_pole(plant, part) == pytest.approx(expected, rel=1e-3)


def own_rk4(plant, x0, step, u, duration, period=1e-3):
    """Angles at the samples by a loop of mj_step, under u(t, q, v) held for a period."""
    model = plant.load()
    model.opt.timestep, model.opt.integrator = step, mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    data.qpos[:] = x0
    positions = [data.qpos.copy()]
    for k in range(round(duration / period)):
        data.ctrl[:] = u(k * period, data.qpos, data.qvel)
        for _ in range(round(period / step)):
            mujoco.mj_step(model, data)
        positions.append(data.qpos.copy())
    return np.array(positions)


@smc.law_function(gains={"k": 20.0})
def pulls(y, g, m):
    return -g.k * y.e - 0.1 * g.k * y.de, y.de


def test_a_range_that_is_never_reached_costs_no_accuracy():
    with_range = scenario(RANGE, law=pulls())
    trace = smc.run(with_range)

    def u(t, q, v):
        r, dr = 0.3 * np.sin(3.0 * t), 0.9 * np.cos(3.0 * t)
        return -20.0 * (q - r) - 2.0 * (v - dr)

    truth = own_rk4(with_range.plant, with_range.resolved.x0, 1e-3 / 16, u, 2.0)
    np.testing.assert_allclose(trace.x, truth, atol=1e-9)  # 1e-4 under implicitfast at 0.25 ms


@pytest.mark.parametrize("damping", [0.005, 0.02])
def test_a_light_finger_is_right_or_told(damping):
    """Under RK4 at 1 ms the first was 18 rad off in silence, and the second diverged."""
    finger = scenario(damping, text=FINGER, law="none", duration=0.5)
    trace = smc.run(finger)
    step = 2e-6 if damping > 0.01 else 2e-5
    truth = own_rk4(finger.plant, finger.resolved.x0, step, lambda *_: np.zeros(2), 0.1)
    error = np.abs(trace.x[:101] - truth).max()
    assert error < 1e-5 or ("fastest pole" in trace.unresolved and error < 1e-2)
    with pytest.warns(ScenarioWarning, match="unstable"):
        smc.run(scenario(damping, text=FINGER, integrator="RK4", physics_step=1e-3, duration=1e-3))


@pytest.mark.parametrize("law", ["pid", "super_twisting", "none"])
def test_coulomb_is_frictionloss_on_joints_that_move_together(law):
    fields = {"law": law, "reference": smc.Constant(0.0), "duration": 1.0}
    part = smc.run(scenario(RANGE, friction=PARTS, **fields))
    file = smc.run(scenario(RANGE, text=of_file(0.5, 0.2), **fields))
    np.testing.assert_allclose(part.x, file.x, atol=1e-9)
    last = part.x[-100:]
    assert law != "none" or np.ptp(last, axis=0).max() < 1e-9  # no creep


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"joint": RANGE}, ""),
        ({"joint": RANGE, "friction": PARTS}, ""),
        ({"joint": RANGE, "noise": smc.Noise(position=1e-4)}, ""),
        ({"joint": RANGE, "law": "super_twisting"}, "coupled joints"),
        ({"joint": RANGE, "law": "super_twisting", "friction": PARTS}, "dry friction"),
        ({"joint": RANGE, "friction": LuGre(0.3, 0.4, 0.1, 300.0)}, "LuGre acts once"),
        ({"joint": RANGE, "actuator": smc.Backlash(0.01, 0.01)}, "Backlash acts once"),
        ({"joint": 'damping="120"'}, "fastest pole"),
        ({"joint": 'damping="120"', "integrator": "implicitfast"}, ""),  # as asked
    ],
    ids=str,
)
@pytest.mark.filterwarnings("always:.* runs under|u of .* chatters")
def test_what_a_step_does_not_resolve_is_told_once_at_the_run(fields, told, recwarn):
    trace = smc.run(scenario(**fields))
    assert told in trace.unresolved
    assert bool(told) == bool(trace.unresolved)
    sentences = [str(w.message) for w in recwarn if "runs under" in str(w) or "chatters" in str(w)]
    assert sentences == ([trace.unresolved] if told else [])


def test_runs_that_only_judge_gains_warn_of_nothing():
    """Those of laws and gains that are not chosen would warn, too."""
    law = smc.law("super_twisting")
    goal = Objective(conditions=("nominal",), duration=2.0)
    with pytest.warns(ScenarioWarning, match="chatters on coupled joints"):
        smc.run(goal.holdout(chain(RANGE), law, 0))
    objectives(chain(RANGE), [law], goal)


def test_u_that_varies_in_its_last_digits_does_not_chatter():
    trace = smc.run(scenario(joint=RANGE, law="super_twisting", duration=0.5))
    assert resolution.switches(trace)
    last = len(trace.u) // 2
    for size, chatters in ((1e-3, True), (1e-9, False)):
        u = trace.u.copy()
        u[last:] = 1.0 + size * (-1.0) ** np.arange(len(u) - last)[:, None]
        assert resolution.switches(dataclasses.replace(trace, u=u)) == chatters


def test_one_joint_alone_that_chatters_is_resolved():
    arm = CHAIN.replace('name="j2"', 'name="j2" stiffness="0"').format(RANGE, "")
    start = arm.index('<body name="fore"')
    single = arm[:start] + arm[arm.index("</body>", start) + len("</body>") :]
    single = single.replace('<motor joint="j2" ctrlrange="-10 10"/>', "")
    plant = smc.plant_from(single, {"j1": smc.Channel(x0=0.3)})
    fields = {"plant": plant, "law": "super_twisting", "duration": 2.0}
    coarse = smc.run(smc.Scenario(**fields))
    fine = smc.run(smc.Scenario(**fields, physics_step=1e-3 / 16))
    assert coarse.scenario.resolved.physics_step == integration.MAX_STEP
    assert not coarse.unresolved
    bounds = [smc.score(trace)["ultimate_bound"] for trace in (coarse, fine)]
    assert bounds[0] == pytest.approx(bounds[1], rel=0.03)


def test_the_table_of_twelve_machines_is_that_of_the_benchmark_and_within_its_bars():
    measured = json.loads(integrators.MEASURED.read_text(encoding="utf-8"))
    page = Path(integrators.__file__).parents[1] / "docs" / "accuracy.md"
    assert integrators.table(measured) in page.read_text(encoding="utf-8")
    assert len(measured) == len(integrators.MACHINES) * len(integrators.LAWS) == 24
    for name, row in measured.items():
        most = 1.0 if name.endswith("pid") else 3.0
        errors = [abs(row[f"now {score}"]) for score in integrators.SCORES]
        assert row["marked"] or max(errors) < most
    assert np.median([row["cost"] for row in measured.values()]) < 1.15


TWO_HINGES = """<mujoco><worldbody><body><joint name="a" axis="0 1 0"/><geom type="capsule"
fromto="0 0 0 0 0 -.3" size=".02" mass="1" contype="0" conaffinity="0"/><body pos="0 0 -.3">
<joint name="b" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -.3" size=".02" mass="1"
contype="0" conaffinity="0"/></body></body></worldbody><actuator>
<motor joint="a" ctrlrange="-20 20"/><motor joint="b" ctrlrange="-20 20"/></actuator></mujoco>"""


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("law", "off"),
    [
        (smc.law("classical", k=8.0, c=5.0), "twice too large"),
        (smc.law("pid", kp=20.0, kd=3.0, ki=0.0), "some percent off"),
    ],
)
def test_a_friction_that_acts_once_a_step_errs_by_more_where_u_chatters(law, off):
    fields = {"plant": smc.plant_from(TWO_HINGES, ["a", "b"]), "x0": 0.3, "duration": 0.5}
    friction = smc.hardware.Stribeck(0.1)
    assert off in smc.run(smc.Scenario(law=law, friction=friction, **fields)).unresolved
