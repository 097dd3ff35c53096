"""Joints and a free base that are measured and not driven, under laws of many joints."""

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.control.written import state_feedback

POLES = """<mujoco model="poles"><option timestep=".001"/>
<default><geom type="capsule" size=".02" contype="0" conaffinity="0"/></default><worldbody><body>
<joint name="slide" type="slide" axis="1 0 0"/><geom type="box" size=".1 .05 .05" mass="1.2"/>
<body><joint name="low" axis="0 1 0" damping=".006"/><geom fromto="0 0 0 0 0 .5" mass=".3"/>
<body pos="0 0 .5"><joint name="high" axis="0 1 0" damping=".004"/>
<geom fromto="0 0 0 0 0 .35" mass=".12"/></body></body></body></worldbody>
<actuator><motor joint="slide" ctrlrange="-90 90"/></actuator></mujoco>"""
WHEELS = """<mujoco model="wheels"><option timestep=".001"/><worldbody>
<geom type="plane" size="20 20 .1"/><body name="frame" pos="0 0 .08"><freejoint/>
<geom type="box" size=".04 .09 .2" pos="0 0 .2" mass="4"/>
<body pos="0 .13 0"><joint name="left" axis="0 1 0"/>
<geom type="cylinder" size=".08 .02" euler="90 0 0" mass=".4"/></body>
<body pos="0 -.13 0"><joint name="right" axis="0 1 0"/>
<geom type="cylinder" size=".08 .02" euler="90 0 0" mass=".4"/></body></body></worldbody>
<actuator><motor joint="left" ctrlrange="-9 9"/><motor joint="right" ctrlrange="-9 9"/></actuator>
</mujoco>"""
TILT = 6  # channel base_ry of the wheels
PUSH = 40.0, 6.0, 1.0, 1.5  # N m per rad of tilt, its rate, the way and its speed


def poles(order=("low", "high")):
    return smc.plant_from(POLES, ["slide"], measured=order)


def wheels():
    return smc.plant_from(WHEELS, ["left", "right"], measured=["base"])


@pytest.fixture(scope="module")
def gains():
    """K of the poles and of the wheels."""
    balance = np.zeros((2, 16))
    tilt, rate, way, speed = PUSH
    balance[:, [TILT, 8 + TILT]] = -tilt - way, -rate - speed
    balance[:, [0, 1, 8, 9]] = np.array([-way, -way, -speed, -speed]) / 2.0
    return {"poles": [[9.0, 75.0, 340.0, 13.0, 36.0, 34.0]], "wheels": balance.tolist()}


def started(plant, tilt):
    x0 = np.array(plant.x0)
    x0[TILT if plant.base >= 0 else 1] = tilt
    return tuple(x0)


@pytest.mark.parametrize("make", [poles, wheels], ids=["poles", "wheels"])
@pytest.mark.parametrize("tilt", [0.03, -0.05])
def test_a_gain_matrix_drives_the_machine_as_in_plain_mujoco(make, tilt, gains):
    plant = make()
    K = np.array(gains[make.__name__])
    settings = {"physics_step": 1e-3, "integrator": "Euler", "duration": 2.0, "u_max": 9.0}
    law = state_feedback(K, "balance")
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law=law,
            x0=started(plant, tilt),
            **settings,
        )
    )

    model = mujoco.MjModel.from_xml_string(POLES if make is poles else WHEELS)
    data = mujoco.MjData(model)
    if make is wheels:
        data.qpos[3:7] = np.cos(tilt / 2), 0.0, np.sin(tilt / 2), 0.0
    else:
        data.qpos[1] = tilt
    for k in range(len(trace.t)):
        x = data.qpos.copy()
        v = data.qvel.copy()
        if make is wheels:
            lean = data.qpos[3:7]
            angle = 2.0 * np.arctan2(lean[2], lean[0])
            turn = 2.0 * lean[[1, 3]]  # of rotations this small
            x = np.array([*x[7:], *x[:3], turn[0], angle, turn[1]])
            v = np.array([*v[6:], *v[:6]])
        assert np.allclose(
            trace.x[k],
            x,
            rtol=0.0,
            atol=1e-7,
        )
        error = x - np.array([0.0] * plant.driven + list(plant.goal))
        data.ctrl[:] = np.clip(-K @ np.concatenate([error, v]), -9.0, 9.0)
        mujoco.mj_step(model, data)


@pytest.mark.parametrize("make", [poles, wheels], ids=["poles", "wheels"])
@pytest.mark.parametrize("tilt", [-0.1, 0.06])
def test_the_regulator_stands_and_its_trace_comes_back(make, tilt, tmp_path):
    plant = make()
    law = smc.design.lqr(plant)
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law=law,
            x0=started(plant, tilt),
            duration=6.0,
        )
    )
    errors = np.abs(trace.x - trace.r)[:, list(plant.scored_channels)]
    assert errors[-1].max() < 0.02 * abs(tilt)
    assert smc.score(trace)["settling_time"] < 5.0
    again = smc.load(trace.save(tmp_path / "run.npz"))
    assert np.array_equal(again.x, trace.x)
    assert again.scenario.plant == plant


@pytest.mark.quick
def test_the_order_of_measured_joints_is_that_of_the_channels():
    x0 = {"slide": 0.1, "low": 0.02, "high": -0.03}
    traces = []
    for order in (("low", "high"), ("high", "low")):
        names = ("slide", *order)
        start = tuple(x0[name] for name in names)
        trace = smc.run(
            smc.Scenario(
                plant=poles(order),
                law=smc.law("pid"),
                x0=start,
                duration=0.2,
            )
        )
        traces.append(trace.columns())
    for name in x0:
        assert np.array_equal(traces[0][f"x_{name}"], traces[1][f"x_{name}"])


def test_a_law_reads_the_whole_mass_matrix_and_gives_u_of_the_driven():
    seen = []

    @smc.law_function(joint=True, requires_model=True)
    def reading(y, gains, memory):
        seen.append((y.M.copy(), y.h.copy(), y.limit.copy()))
        return [0.5], [0.0]

    start = {"x0": (0.0, 0.2, -0.4), "v0": (0.1, -0.3, 0.6), "u_max": 9.0}
    with pytest.warns(match="does not compile"):
        trace = smc.run(
            smc.Scenario(
                plant=poles(),
                law=reading,
                duration=0.005,
                **start,
            )
        )
    M, h, limit = seen[0]
    assert limit.tolist() == [9.0, 0.0, 0.0]
    acceleration = np.linalg.solve(M, np.array([0.5, 0.0, 0.0]) - h)
    assert np.allclose((trace.v[1] - trace.v[0]) / 1e-3, acceleration, rtol=0.02)


def test_where_a_base_is_counts_only_if_the_reference_says_where_it_should_be(gains):
    plant = wheels()
    law = state_feedback(np.array(gains["wheels"]), "balance")
    still = smc.Constant(0.0)
    with_base = {"left": still, "right": still, "base_x": smc.Constant(0.3)}
    bounds = []
    for reference in (None, with_base):
        scenario = smc.Scenario(
            plant=plant,
            law=law,
            duration=0.5,
            reference=reference,
        )
        trace = smc.run(scenario)
        bounds.append(smc.scores(trace)["free m"]["ultimate_bound"])
    assert bounds[0] < 1e-3
    assert bounds[1] == pytest.approx(0.3, abs=0.02)
    assert trace.r[-1, plant.base] == 0.3
    assert trace.r[-1, plant.base + 2] == 0.08


@pytest.mark.parametrize(
    ("measured", "named"),
    [
        ("low", "'low'"),
        (["low", "low"], "'low'"),
        (["slide"], "'slide'"),
        (["hip"], "'hip'"),
        (3, "3"),
    ],
)
def test_joints_that_cannot_be_measured_are_refused_by_name(measured, named):
    with pytest.raises(smc.ScenarioError, match=named):
        poles(measured)


@pytest.mark.parametrize("K", [np.ones((1, 4)), np.ones((2, 6)), np.full((1, 6), np.inf)])
def test_a_gain_matrix_that_does_not_fit_is_refused(K):
    with pytest.raises(smc.ScenarioError):
        smc.Scenario(plant=poles(), law=state_feedback(K, "balance"))


def test_laws_of_driven_joints_alone_are_not_for_measured_ones():
    joint_law = smc.laws(kind="joint")[0]
    with pytest.raises(smc.ScenarioError, match="without an actuator"):
        smc.Scenario(plant=poles(), law=joint_law)
    assert smc.laws(poles()) == ["none"]
