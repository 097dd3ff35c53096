"""Laws of many joints: the compiled callback against the Python loop, threads, and bad input."""

import math
import pickle

import mujoco
import numpy as np
import pytest
from helpers import arms, reference
from helpers.runs import assert_loops_agree, assert_same
from numba import njit

import smc_mujoco as smc
from smc_mujoco.control.joint_law import (
    coriolis,
    jacobian,
    norm,
    product,
    saturate,
    torque,
)
from smc_mujoco.control.law import FREE_BODY, joint_law_catalogue
from smc_mujoco.mechanisms.custom.nominal_model import NominalModel
from smc_mujoco.mechanisms.plant import Values


@pytest.fixture(scope="module")
def arm():
    return arms.arm()


@smc.law_function(
    joint=True,
    gains={"k": 20.0, "c": 5.0},
    memory=3,
    requires_model=True,
)
def curious(y, gains, memory):
    """Reads everything that a law of many joints may read, remembers, and writes over its
    reference.
    """
    s = y.de + gains.c * y.e
    memory[:, 0] += y.dt * saturate(s)
    memory[0, 1] = y.t
    for i in range(len(s)):
        memory[i, 2] = math.tanh(y.a[i] / y.limit[i])
    u = torque(y, -gains.c * y.de - gains.k * s) - coriolis(y, 0.1 * s) - product(y.M, memory[:, 0])
    u = u + 1e-3 * (norm(y.x) * y.g + y.v + y.r - y.dr + memory[:, 2] + memory[0, 1])
    y.r[:] = y.x
    return u, s


@njit
def weight(y):
    return y.g


@smc.law_function(joint=True, requires_model=True)
def held(y, gains, memory):
    """A law that reads g in a function that it calls; without such a law g is not computed."""
    return weight(y) - 5.0 * y.e - y.de, y.de


def cases(arm):
    """Scenarios that differ in all that the law's road touches, most in one Batch."""
    common = {
        "duration": 0.05,
        "reference": smc.Sine(0.2, 5.0),
        "noise": smc.Noise(1e-3, 1e-2),
    }
    loaded = {
        "velocity": "levant",
        "input_delay": 2e-3,
        "mismatch": {"m": 1.4},
        "feedforward": smc.Constant(0.3),
    }
    for name in (
        name for name, law in joint_law_catalogue().items() if FREE_BODY not in law.plants
    ):
        yield smc.Scenario(
            plant=arm,
            law=name,
            x0=(0.1, -0.3, 0.2),
            **common,
        )
        if name != "hybrid_sliding":  # which needs a tip
            yield smc.Scenario(plant="double_pendulum", law=name, **common)
    yield smc.Scenario(
        plant=arm,
        law=curious(k=[10.0, 20.0, 30.0]),
        u_max=20.0,
        **common | loaded,
    )
    pushes = (
        smc.signals.Push(
            "upper",
            x=3.0,
            z=-5.0,
            time=0.01,
            width=0.02,
        ),
        smc.signals.Push("hand", y=2.0, time=0.02),
        smc.Sine(0.2, 9.0),
    )
    yield smc.Scenario(
        plant=arm,
        law=curious,
        disturbance=pushes,
        **common,
    )
    yield smc.Scenario(
        plant=arm,
        law=curious,
        model="none",
        **common,
    )
    yield smc.Scenario(plant=arm, law=held, **common)
    yield smc.Scenario(
        plant="pendulum_network",
        law=curious,
        control_period=2e-3,
        **common,
    )
    swinging = smc.plant("inverted_pendulum_network", n=3)
    yield smc.Scenario(plant=swinging, law=curious, **common)
    volts = smc.DCMotor(command="voltage", gear=50.0, voltage=1e3)  # of which u takes a third
    yield smc.Scenario(
        plant=swinging,
        law=curious,
        actuator=volts,
        **common,
    )


def test_callback_equals_plain_loop_under_laws_of_many_joints(arm):
    assert_loops_agree(list(cases(arm)))


TENDON = """
<mujoco><option gravity="0 0 -5" wind="1 0 0" density="1.2"/><worldbody>
  <body pos="0 0 1" gravcomp="0.3"><joint name="a" axis="0 1 0" stiffness="1"/>
    <geom type="capsule" size="0.1" fromto="0 0 0 0.4 0 0" mass="1"/>
    <body pos="0.4 0 0" gravcomp="0.5"><joint name="b" axis="0 1 0" actuatorgravcomp="{own}"/>
      <geom type="capsule" size="0.1" fromto="0 0 0 0.4 0 0" mass="1"/></body></body>
</worldbody>{tendon}<actuator>
  <motor name="a" joint="a"/><motor name="b" joint="b"/>{actuator}
</actuator></mujoco>
"""
PULL = """<tendon><fixed name="t" stiffness="3" damping="1">
  <joint joint="a" coef="1"/><joint joint="b" coef="-2"/></fixed></tendon>"""
SERVO = '<position tendon="t" kp="4" kv="0.5"/>'


@pytest.mark.quick
@pytest.mark.parametrize(
    "parts",
    [
        {},
        {"tendon": PULL},
        {"tendon": PULL, "actuator": SERVO},
        {"own": "true"},
    ],
    ids=["bodies", "tendon", "another actuator", "gravity compensated by the actuator"],
)
def test_all_forces_of_the_model_are_in_h_also_after_runs_of_other_laws(parts):
    """Also those that MuJoCo computes elsewhere, and with data that a law of one channel has used
    before.
    """
    text = TENDON.format(**{"tendon": "", "actuator": "", "own": "false"} | parts)
    channels = {name: smc.Channel(x0=0.3) for name in "ab"}
    plant = smc.plant_from(text, channels=channels, name="pulled")
    common = {
        "plant": plant,
        "duration": 0.02,
        "model": "nominal",
        "v0": (1.0, -2.0),
        "u_max": 1e3,
    }
    smc.run(smc.Scenario(law=smc.law("computed_torque"), **common))
    trace = smc.run(smc.Scenario(law=curious, **common))
    assert trace.failure is None
    assert_same(trace, reference.run(trace.scenario))


def test_nominal_dynamics_are_those_of_inverse_dynamics(arm):
    """M a + h is the force that MuJoCo's inverse dynamics ask for at random states; g is h at
    rest.
    """
    rng = np.random.default_rng(1)
    model = arm.load()
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT.value
    data = mujoco.MjData(model)
    dofs = [2, 0, 1]
    for _ in range(10):
        x, v, a = rng.normal(size=(3, 3))
        data.qpos[dofs], data.qvel[dofs], data.qacc[dofs] = x, v, a
        mujoco.mj_inverse(model, data)
        values = Values(**arm.parameters)
        dynamics = arm.nominal.dynamics(x, v, values)
        np.testing.assert_allclose(
            dynamics.M @ a + dynamics.h, data.qfrc_inverse[dofs], rtol=1e-10, atol=1e-10
        )
        np.testing.assert_allclose(
            dynamics.g, arm.nominal.dynamics(x, 0 * v, values).h, rtol=1e-12, atol=1e-12
        )


def test_the_jacobian_is_the_tips_velocity(arm):
    """Its columns are those of the channels, in their order, not the model's."""
    model = arm.load()
    data = mujoco.MjData(model)
    x = np.array([0.1, 0.4, -0.3])
    h = 1e-6

    def place(at):
        data.qpos[[2, 0, 1]] = at
        mujoco.mj_forward(model, data)
        return data.site("tip").xpos.copy()

    jacobian = arm.nominal.jacobian(x, Values(**arm.parameters), "tip")
    expected = np.column_stack(
        [(place(x + h * unit) - place(x - h * unit)) / (2 * h) for unit in np.eye(3)]
    )
    np.testing.assert_allclose(jacobian, expected, atol=1e-9)


def test_coriolis_is_christoffels(arm):
    """C v is the part of h that is quadratic in v, and M' - 2 C is skew-symmetric: w' M' w = 2 w' C
    w.
    """
    rng = np.random.default_rng(2)
    values = Values(**arm.parameters)
    h = 1e-5
    nominal = arm.nominal
    assert isinstance(nominal, NominalModel)
    damping = np.array([0.3, 0.1, 0.0])
    for _ in range(5):
        x, v, w = rng.normal(size=(3, 3))
        dynamics = nominal.dynamics(x, v, values)
        quadratic = dynamics.h - dynamics.g - damping * v
        np.testing.assert_allclose(
            nominal.coriolis(x, v, v, values), quadratic, rtol=1e-9, atol=1e-9
        )
        after, before = (nominal.dynamics(x + sign * h * v, v, values).M for sign in (1, -1))
        rate = w @ (after - before) @ w / (2 * h)
        assert rate == pytest.approx(2 * w @ nominal.coriolis(x, v, w, values), abs=1e-7)


@smc.law_function(joint=True)
def short(y, gains, memory):
    return y.e[:1], y.e


@smc.law_function(joint=True, gains={"when": 0.01})
def late(y, gains, memory):
    """Returns NaN for its second joint after a time in s."""
    u = -y.e
    if y.t > gains.when[1]:
        u[1] = math.nan
    return u, y.e


@smc.law_function(joint=True)
def tipped(y, gains, memory):
    """Needs a tip."""
    return jacobian(y)[0], y.e


@smc.law_function(joint=True, memory=1)
def beyond(y, gains, memory):
    memory[len(y.e), 0] = 1.0
    return -y.e, y.e


def test_a_push_gives_its_impulse_to_its_body(refused):
    """A sphere that swings freely, without gravity: l F dt of angular momentum, F dt = 2 width peak
    / pi.
    """
    text = """<mujoco><option gravity="0 0 0"/><worldbody>
      <body name="bob"><joint name="a" axis="0 1 0"/>
      <geom type="sphere" size="0.01" pos="0 0 -1" mass="2"/></body></worldbody></mujoco>"""
    plant = smc.plant_from(text, channels={"a": {"motor": True}}, name="bob")
    push = smc.signals.Push(
        "bob",
        x=-30.0,
        y=9.0,
        time=0.1,
        width=0.02,
    )
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law="none",
            disturbance=push,
            duration=0.2,
        )
    )
    assert np.abs(trace.v[trace.t < 0.1]).max() == 0.0
    assert trace.v[-1, 0] == pytest.approx(30.0 * 0.02 * 2 / math.pi / 2.0, rel=1e-3)
    refused(
        lambda: smc.Scenario(plant=plant, law="none", disturbance=smc.signals.Push("bub")),
        "body",
        "'bub'",
    )


def test_a_failing_law_ends_its_own_run_with_the_reason():
    reasons = [
        (short, "instead of two vectors u, s of 2 numbers each, at t = 0 s"),
        (late, "law 'late' returned u = nan, s = 0.5"),
        (beyond, "law 'beyond' raised IndexError"),
        (
            tipped,
            "law 'tipped' raised ValueError (there is no tip, or the law has no model: give the "
            "plant a tip",
        ),
    ]
    common = {"plant": "double_pendulum", "duration": 0.03}
    laws = [law for law, _ in reasons]
    *failed, sound = smc.run([smc.Scenario(law=law, **common) for law in (*laws, "classical")])
    for trace, (_, said) in zip(failed, reasons, strict=True):
        assert said in str(trace.failure)
    assert sound.failure is None


def test_a_joint_law_pickles_and_survives_a_file(tmp_path, arm):
    law = smc.law("computed_torque_sliding", k=[3, 4, 5])
    assert pickle.loads(pickle.dumps(law)) == law
    trace = smc.run(smc.Scenario(plant=arm, law=law, duration=0.02))
    loaded = smc.load(trace.save(tmp_path / "a.npz"))
    assert loaded.scenario == trace.scenario
    assert_same(smc.run(loaded.scenario), trace)


TWICE = """
<mujoco><worldbody><body>
  <joint name="a" axis="0 1 0"/><joint name="b" axis="0 1 0"/>
  <geom type="sphere" size="0.1" pos="0 0 -1"/>
</body></worldbody></mujoco>
"""
WELDED = """
<mujoco><worldbody>
  <body name="one"><joint name="a" axis="0 1 0"/>
    <geom type="sphere" size="0.1" pos="0 0 -1"/></body>
  <body name="two" pos="1 0 0"><joint name="b" axis="0 1 0"/>
    <geom type="sphere" size="0.1" pos="0 0 -1"/></body>
</worldbody><equality><weld body1="one" body2="two"/></equality></mujoco>
"""
TORQUE = "computed_torque_sliding"
REFUSED = {
    "gain k": lambda: smc.Scenario(plant="double_pendulum", law=smc.law(TORQUE, k=[1.0, 2.0, 3.0])),
    "surface": lambda: smc.Scenario(plant="double_pendulum", law=TORQUE, surface="terminal"),
    "singular": lambda: smc.Scenario(
        plant=smc.plant_from(
            TWICE, channels={n: smc.Channel(motor=True) for n in "ab"}, name="twice"
        ),
        law=TORQUE,
    ),
    "equality constraints": lambda: smc.Scenario(
        plant=smc.plant_from(
            WELDED, channels={n: smc.Channel(motor=True) for n in "ab"}, name="welded"
        ),
        law=TORQUE,
    ),
}


@pytest.mark.filterwarnings("ignore:Inertia matrix is too close to singular")
def test_bad_input_is_one_sentence(refused):
    for word, make in REFUSED.items():
        refused(make, word)
