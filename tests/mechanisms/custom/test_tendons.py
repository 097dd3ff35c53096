"""Channels whose force is shared over tendons, against moment arms that are known and an own bounded
least squares.
"""

import re
import warnings

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.engine.scored_runs import ScoredRuns
from smc_mujoco.errors import ScenarioWarning
from smc_mujoco.mechanisms.hardware.tendons import RIDGE, share

# two straight tendons on either side of a hinge at the origin, m: x and z of where they hold
FIXED = np.array([[0.08, 0.05], [-0.08, 0.05]])
MOVED = np.array([[0.02, -0.15], [-0.02, -0.15]])
SITE = '<site name="{}" pos="{} 0 {}"/>'
ANTAGONISTS = f"""<mujoco model="finger"><worldbody>{SITE.format("a", *FIXED[0])}
{SITE.format("b", *FIXED[1])}<body><joint name="j" axis="0 1 0" damping=".01"/>
<geom size=".02" pos="0 0 -.2" mass=".3" contype="0" conaffinity="0"/>
{SITE.format("ea", *MOVED[0])}{SITE.format("eb", *MOVED[1])}</body></worldbody>
<tendon><spatial name="front"><site site="a"/><site site="ea"/></spatial>
<spatial name="back"><site site="b"/><site site="eb"/></spatial></tendon><actuator>
<motor name="front" tendon="front" gear="-1" ctrlrange="{{low}} 60"/>
<motor name="back" tendon="back" ctrlrange="-60 {{push}}"/></actuator></mujoco>"""
# three tendons over two joints; the first crosses both
ARMS = np.array([[0.03, -0.02, -0.025], [0.02, 0.0, -0.03]])
THREE = f"""<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="j1" axis="0 1 0"/>
<geom size=".03" pos="0 0 -.2" mass=".4" contype="0" conaffinity="0"/><body pos="0 0 -.3"><joint name="j2" axis="0 1 0"/>
<geom size=".02" pos="0 0 -.2" mass=".2" contype="0" conaffinity="0"/></body></body></worldbody><tendon>{
    "".join(
        f'<fixed name="t{i}">'
        + "".join(f'<joint joint="j{n + 1}" coef="{-arm}"/>' for n, arm in enumerate(column) if arm)
        + "</fixed>"
        for i, column in enumerate(ARMS.T)
    )
}</tendon><actuator>{
    "".join(f'<motor tendon="t{i}" gear="-1" ctrlrange="0 90"/>' for i in range(3))
}</actuator></mujoco>"""


def tensions(trace):
    assert trace.tension is not None
    return trace.tension


def finger(low=0, push=0):
    return ANTAGONISTS.format(low=low, push=push)


def arms_at(angles):
    """Return the moment arms of both tendons of the finger, (K + 1, 2) m: that of a pull of 1 N from
    the moved end to the fixed one, about y.
    """
    cos = np.cos(angles)[:, None]
    sin = np.sin(angles)[:, None]
    x = MOVED[:, 0] * cos + MOVED[:, 1] * sin
    z = MOVED[:, 1] * cos - MOVED[:, 0] * sin
    along = FIXED[:, 0] - x, FIXED[:, 1] - z
    return (z * along[0] - x * along[1]) / np.hypot(*along)


def run_of(plant, amplitude=0.1, **fields):
    law = smc.law("pid", kp=6.0, kd=0.4, ki=0.0)
    references = [smc.Sine(amplitude, omega=5.0)] * plant.driven
    return smc.run(smc.Scenario(plant=plant, law=law, reference=references, duration=1.0, **fields))


def test_antagonists_give_the_force_of_a_motor_and_never_push():
    plant = smc.plant_from(finger(), ["j"], name="finger")
    assert plant.limits == pytest.approx((60.0 * np.abs(arms_at(np.zeros(1))).min(),))
    trace = run_of(plant, 0.5)
    expected = np.maximum(trace.applied / arms_at(trace.x[:, 0]), 0.0)
    np.testing.assert_allclose(tensions(trace), expected, atol=1e-6)
    assert tensions(trace).min() == 0.0
    assert tensions(trace).max(axis=0).min() > 1.0
    assert trace.unreached == ""
    with pytest.warns(ScenarioWarning, match="leaves out that 'front' and 'back' pull at it"):
        motor = smc.plant_from(finger(), {"j": smc.Channel(motor=True)}, name="motor")
    alone = run_of(motor, 0.5, u_max=plant.limits[0])
    np.testing.assert_allclose(trace.x, alone.x, atol=1e-8)


def test_a_least_tension_pulls_at_both_sides():
    trace = run_of(smc.plant_from(finger(low=5), ["j"], name="finger"))
    assert tensions(trace)[:, 0].min() == 5.0
    torque = (arms_at(trace.x[:, 0]) * tensions(trace)).sum(axis=1)
    np.testing.assert_allclose(torque, trace.applied[:, 0], atol=1e-8)


def test_shared_forces_are_optimal_for_arms_at_random():
    """The conditions of Karush, Kuhn and Tucker hold to rounding."""
    random = np.random.default_rng(3)
    for _ in range(300):
        n, m = random.integers(1, 5), random.integers(1, 9)
        arms = random.normal(size=(n, m)) * (random.random((n, m)) < 0.7)
        low = random.choice([0.0, 0.5, -1.0], size=m)
        high = low + random.exponential(5.0, size=m)
        torques = random.normal(size=n) * random.choice([0.1, 5.0, 100.0])
        tensions = np.zeros(m)
        share(arms, torques, low, high, tensions, np.zeros((m + 3, m)))
        assert np.all(tensions >= low)
        assert np.all(tensions <= high)
        ridge = RIDGE * (arms**2).sum(axis=0).max()
        slope = arms.T @ (torques - arms @ tensions) - ridge * tensions
        rounding = 1e-10 * (1.0 + np.abs(torques).max() + np.abs(tensions).max())
        assert np.all(slope[tensions < high] <= rounding)
        assert np.all(slope[tensions > low] >= -rounding)


def test_a_run_beyond_what_tendons_give_is_told_once(tmp_path):
    single = finger().replace('<motor name="back" tendon="back" ctrlrange="-60 0"/>', "")
    plant = smc.plant_from(single, ["j"], name="single")
    with pytest.warns(ScenarioWarning, match="the tendons of single lack force") as caught:
        trace = run_of(plant)
    assert sum("lack force" in str(warning.message) for warning in caught) == 1
    assert "'front' can be pulled no less" in trace.unreached
    assert "joint 'j'" in trace.unreached
    assert "N m" in trace.unreached
    pushes = trace.applied[:, 0] * arms_at(trace.x[:, 0])[:, 0] < 0.0
    assert pushes.any()
    assert np.all(tensions(trace)[pushes] == 0.0)
    assert re.search(r"in \d+ % of", trace.unreached)  # 1e+02 % was printed
    back = smc.load(trace.save(tmp_path / "single.npz"))
    np.testing.assert_array_equal(tensions(back), tensions(trace))
    weak = smc.plant_from(THREE.replace("0 90", "0 9"), ["j1", "j2"], name="weak")
    with pytest.warns(ScenarioWarning, match="can be pulled no more"):
        run_of(weak, 2.0)


@pytest.mark.parametrize(
    ("text", "joints", "words"),
    [
        (THREE, ["j1"], "also moves joint 'j2'"),
        (finger().replace(' ctrlrange="-60 0"', ""), ["j"], "'back' of .* has no bound"),
        (finger().replace('ctrlrange="-60 0"', 'ctrlrange="0 60"'), ["j"], "only pushes"),
        (
            finger().replace("<motor name", '<general dyntype="filter" dynprm=".1" name', 1),
            ["j"],
            "'front' of .* has a lag",
        ),
    ],
)
def test_tendons_that_cannot_share_a_force_are_refused(text, joints, words):
    with pytest.raises(smc.ScenarioError, match=words):
        smc.plant_from(text, joints)


def test_a_motor_that_may_push_its_tendon_is_told():
    with pytest.warns(ScenarioWarning, match="'back' of .* may push with 7 N"):
        plant = smc.plant_from(finger(push=7), ["j"], name="finger")
    assert tensions(run_of(plant)).min() == 0.0


@pytest.mark.quick
def test_no_other_drive_stands_on_a_joint_of_tendons():
    plant = smc.plant_from(finger(), ["j"], name="finger")
    with pytest.raises(smc.ScenarioError, match=r"tendons drive joint 'j'.*Lag.*leave actuator"):
        smc.Scenario(plant=plant, law="pid", actuator=smc.Lag(0.01)).resolved  # noqa: B018


def test_the_fast_engine_leaves_tendons_to_mujoco():
    plant = smc.plant_from(finger(), ["j"], name="finger")
    case = smc.Scenario(plant=plant, law=smc.law("pid", kp=8.0), duration=0.5)
    assert not ScoredRuns(("itae",)).covers(case)


def test_a_joint_with_a_motor_of_its_own_keeps_it_beside_tendons():
    text = THREE.replace("<actuator>", '<actuator><motor joint="j3" ctrlrange="-3 3"/>').replace(
        "</worldbody>",
        '<body pos="1 0 0"><joint name="j3" axis="0 1 0"/><geom size=".02" pos="0 0 -.2" contype="0" conaffinity="0"/></body>'
        "</worldbody>",
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plant = smc.plant_from(text, ["j3", "j1", "j2"], name="both")
    assert plant.limits[0] == 3.0
    trace = run_of(plant)
    np.testing.assert_allclose(trace.force[1:], trace.applied[:-1], atol=1e-7)
