"""Realistic mechanisms as a whole: parts in scenarios, alone and together, against the reference
loop and the formulas.

What one part does on its own stands in test_friction, test_actuators, test_contact and
test_sensors.
"""

import dataclasses
import itertools
import math

import mujoco
import numpy as np
import pytest
from helpers import reference
from helpers.runs import assert_loops_agree, assert_same

import smc_mujoco as smc
from smc_mujoco.mechanisms.layout import joint_ids
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.integration import REALISTIC_STEP
from smc_mujoco.simulation.prepare import prepare

PLANTS = pytest.mark.parametrize("name", smc.paper.GAINS)
TWO = pytest.mark.parametrize("name", ["duffing", "pendulum_network"])
LUGRE = smc.hardware.LuGre(coulomb=0.05, static=0.08, stribeck=0.01)
# motors of any strength
pytestmark = pytest.mark.filterwarnings("ignore::smc_mujoco.errors.ScenarioWarning")
MOTOR = smc.DCMotor()


# of three bobs the first, which then runs into the second
APART = {
    "x0": (-0.5, 0.0, 0.0),
    "v0": (12.0, 0.0, 0.0),
}


def small(name):
    """The plant; of networks three channels."""
    if smc.plant(name).network:
        return smc.plant(name, n=3)
    return smc.plant(name)


def scenario(name="duffing", law="observer_free", **changes):
    """The paper's law with its gains on a plant, for a short while."""
    plant = small(name) if isinstance(name, str) else name
    if isinstance(law, str):
        law = smc.law(law, **smc.paper.GAINS[plant.name].get(law, {}))
    return smc.Scenario(**({"plant": plant, "law": law, "duration": 0.1} | changes))


def start(plant):
    """A start free of every obstacle, towards them."""
    if plant.n == 1:
        return {"x0": 0.9 * plant.x0[0], "v0": 3.0}
    return APART


# the callback and the oracle


PARTS = {
    "viscous": {"friction": smc.Viscous(0.1)},
    "coulomb": {"friction": smc.Coulomb(0.5)},
    "lugre": {"friction": LUGRE},
    "all frictions": {"friction": (smc.Viscous(0.1), LUGRE, smc.Coulomb(0.02))},
    "lag": {"actuator": smc.Lag(0.01)},
    "rate limit": {"actuator": smc.hardware.RateLimit(100.0)},
    "motor": {"actuator": MOTOR},
    "motor, no inductance, cogging, ripple": {
        "actuator": smc.DCMotor(inductance=0.0, cogging=0.02, ripple=0.3)
    },
    "backlash": {"actuator": smc.Backlash(0.02)},
    "motor and backlash": {"actuator": (MOTOR, smc.Backlash(0.02))},
    "backlash and lugre": {"actuator": (smc.Lag(0.01), smc.Backlash(0.02)), "friction": LUGRE},
    "elastic joint": {
        "actuator": (MOTOR, smc.hardware.ElasticJoint(500.0, 0.1, 0.01)),
        "sensor": smc.Encoder(500, side="motor", delay=1e-3),
    },
    "encoder": {
        "sensor": smc.Encoder(
            500,
            bias=0.01,
            dropout=0.2,
            period=2.5e-3,
            delay=1e-3,
        ),
        "friction": LUGRE,
    },
    "gust": {
        "disturbance": (
            smc.signals.Gust(5.0, time=0.02, width=0.05),
            smc.signals.Impulse(0.2, time=0.01, width=2e-3),
        )
    },
    "noise": {
        "disturbance": smc.signals.BandLimited(1.0, low=1.0, high=40.0),
        "noise": smc.Noise(0.01, 0.05),
    },
    "delay": {"input_delay": 7.5e-4, "actuator": MOTOR},
    "filter": {"actuator": (smc.Lag(0.01), smc.hardware.CommandFilter(0.02))},
    "delays": {"input_delay": 2e-3, "actuator": smc.hardware.CommandDelay(5e-3)},
    "series": {
        "disturbance": smc.signals.TimeSeries((0.0, 0.02, 0.05), (0.0, 1.0, -1.0)),
        "friction": smc.Coulomb(0.1),
    },
    "heavier": {
        "jump": smc.Jump(0.05, {"mass": 3.0}),
        "friction": (LUGRE, smc.Viscous(0.1)),
        "actuator": MOTOR,
    },
}


def test_callback_equals_plain_loop_with_every_part():
    """Each part on one plant."""
    scenarios = []
    for name, fields in zip(itertools.cycle(smc.paper.GAINS), PARTS.values()):
        scenarios.append(scenario(name, "super_twisting", duration=0.06, **fields))
    assert_loops_agree(scenarios)


# one batch


NUMBERS = {
    "lugre": [
        {"friction": f}
        for f in (
            LUGRE,
            smc.hardware.LuGre(0.01, 0.01, 0.1),
            dataclasses.replace(LUGRE, stiffness=200.0, damping=1.0),
        )
    ],
    "rate limit": [{"actuator": smc.hardware.RateLimit(rate)} for rate in (1.0, 500.0, math.inf)],
    "motor": [
        {"actuator": m}
        for m in (
            MOTOR,
            smc.DCMotor(
                0.5,
                1e-3,
                0.05,
                5.0,
                1e-4,
                0.01,
                7.0,
                12.0,
                2.0,
            ),
            smc.DCMotor(voltage=math.inf, current=math.inf, rotor_inertia=0.0),
        )
    ],
    "backlash": [
        {"actuator": smc.Backlash(*numbers)}
        for numbers in ((0.0,), (0.02, 1e-2, 0.0), (0.1, 1e-3, 0.1), (1.0,))
    ],
    "late encoder": [
        {"sensor": s}
        for s in (
            smc.Encoder(delay=0.03),
            smc.Encoder(period=7e-3),
            smc.Encoder(100, period=3e-3, delay=1e-3, dropout=0.5),
        )
    ],
    "input delay": [{"input_delay": delay, "friction": LUGRE} for delay in (0.0, 2.5e-4, 0.0125)],
    "plant": [
        {
            "friction": LUGRE,
            "actuator": MOTOR,
            "mismatch": {"mass": 1.3},
        },
        {
            "friction": LUGRE,
            "actuator": MOTOR,
            "jump": smc.Jump(0.05, {"mass": 0.5}),
        },
        {
            "friction": LUGRE,
            "actuator": MOTOR,
            "noise": smc.Noise(0.01),
            "disturbance": smc.signals.Gust(3.0, 0.0, 0.1),
        },
    ],
}
CONTACT_NUMBERS = [
    (name, contact) for name in smc.paper.GAINS for contact in smc.plant(name).contacts
]


def one_batch(scenarios):
    """Fail unless the scenarios share a layout, and run in one batch as they run alone, on any
    number of threads.
    """
    assert len({prepare(s).key for s in scenarios}) == 1
    alone = [smc.run(s, threads=1) for s in scenarios]
    for threads in (1, 3):
        for a, b in zip(alone, smc.run(scenarios, threads=threads), strict=True):
            assert_same(a, b)
    return alone


@pytest.mark.quick
@pytest.mark.parametrize(
    ("name", "part"),
    list(zip(itertools.cycle(["duffing", "inverted_pendulum", "pendulum_network"]), NUMBERS)),
)
def test_scenarios_that_differ_in_numbers_are_one_batch(name, part):
    # its default follows the drive
    if "actuator" in NUMBERS[part][0]:
        step = {"physics_step": 2.5e-4}
    else:
        step = {}
    scenarios = []
    for fields in NUMBERS[part]:
        scenarios.append(scenario(name, **fields, **step))
    traces = one_batch([scenarios[i] for i in (0, 1, 2, *range(3, len(scenarios)), 0)])
    assert len({trace.u.tobytes() for trace in traces}) == len(scenarios)  # and the numbers arrive
    assert_same(traces[0], traces[-1])


# with every realism at zero


ZEROS = {
    "viscous": {"friction": smc.Viscous(0.0)},
    "coulomb": {"friction": smc.Coulomb(0.0)},
    "lag": {"actuator": smc.Lag(0.0)},
    "rate limit": {"actuator": smc.hardware.RateLimit(math.inf)},
    "backlash": {"actuator": smc.Backlash(0.0, rotor_inertia=1e-9)},
    "motor": {
        "actuator": smc.DCMotor(
            inductance=0.0,
            torque_constant=1e-6,
            gear=1.0,
            rotor_inertia=0.0,
            voltage=math.inf,
            current=math.inf,
        )
    },
    "lugre": {"friction": smc.hardware.LuGre(1e-9, 1e-9, 1.0, stiffness=1e-6, damping=0.0)},
}


@TWO
def test_without_realism_the_realistic_path_is_the_ideal_one_to_first_order(name):
    """implicitfast errs by O(h): h, h/2, h/4 against RK4."""
    steps = (2.5e-4, 1.25e-4, 6.25e-5)
    common = {
        "sensor": smc.Encoder(math.inf),
        "velocity": "measured",
        "integrator": "implicitfast",
        "duration": 0.25,
    }
    laws = ["observer_free", "boundary_layer"]
    ideals = dict(
        zip(laws, smc.run([scenario(name, law, duration=0.25) for law in laws]), strict=True)
    )
    cases = list(zip(ZEROS, itertools.cycle(laws)))
    traces = iter(
        smc.run(
            [
                scenario(name, law, physics_step=h, **common, **ZEROS[zero])
                for zero, law in cases
                for h in steps
            ]
        )
    )
    for zero, law in cases:
        errors = []
        for _ in steps:
            errors.append(np.abs(next(traces).x - ideals[law].x).max())
        assert errors[0] < 4e-3, zero
        np.testing.assert_allclose(
            np.log2(np.array(errors[:-1]) / errors[1:]), 1.0, atol=0.1, err_msg=zero
        )


@pytest.mark.parametrize(
    ("name", "contact"),
    [(n, c) for n, c in CONTACT_NUMBERS if c in ("stops", "wall") or n == "inverted_pendulum"],
)
def test_an_obstacle_that_is_not_reached_is_not_there(name, contact):
    start = {"x0": 0.15 if name == "inverted_pendulum" else 1.2, "v0": -0.1}
    if contact == "peg":
        law = smc.law("none")
    else:
        law = "observer_free"
    if contact == "peg":
        start = {"x0": 1.0, "v0": 0.0}  # and away from there
    ideal = smc.run(scenario(name, law, duration=0.3, **start))
    beside = smc.run(
        scenario(
            name,
            law,
            duration=0.3,
            integrator="RK4",
            physics_step=1e-3,
            contact=contact,
            **start,
        )
    )
    assert not beside.reaction.any()
    np.testing.assert_allclose(beside.x, ideal.x, atol=1e-9)
    np.testing.assert_allclose(beside.u, ideal.u, atol=1e-8)


# where smooth laws rest under friction


def balance(trace, end=-1):
    """What the law's command and the plant's own forces exert on each joint at rest at a sample,
    (n,).
    """
    s = trace.scenario
    values = s.plant.values({})
    x = trace.x[end]
    law = s.law.name
    gains = s.law.gains
    if law == "observer_free":
        u = -gains["lam"] * np.tanh(gains["k1"] * x)
    else:
        u = -gains["k"] * np.clip(gains["c"] * x / gains["phi"], -1.0, 1.0)
    own = []
    for i in range(s.plant.n):
        own.append(s.plant.nominal(x, 0.0 * x, i, values))
    return np.clip(u, -s.resolved.u_max, s.resolved.u_max) + np.array([f / g for f, g in own])


# energy


def energies(s):
    """Mechanical energy at every physics step of a scenario without a command."""
    model = models.with_values(models.compile_model(s), s)
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = models.initial_state(model, s)
    energy = data.energy
    totals = []
    for _ in range(s.samples * s.steps):
        mujoco.mj_step(model, data)
        totals.append(energy[0] + energy[1])
    return np.array(totals)


PASSIVE = {
    "coulomb": {"friction": smc.Coulomb(0.05)},
    "lugre": {"friction": LUGRE},
    "backlash": {"actuator": smc.Backlash(0.05, rotor_inertia=0.01)},
    "both": {"actuator": smc.Backlash(0.05, rotor_inertia=0.01), "friction": LUGRE},
    "springs": {"mechanism": "springs", "friction": smc.Coulomb(0.05)},
}


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("pendulum_network", "springs"),
        ("duffing", "both"),
        ("inverted_pendulum", "lugre"),
        ("pendulum_network", "backlash"),
        ("inverted_pendulum_network", "coulomb"),
    ],
)
def test_a_passive_mechanism_never_gains_energy(name, part):
    s = scenario(name, "none", duration=2.0, v0=0.5, **PASSIVE[part])
    energy = energies(s)
    span = energy[0] - energy.min()
    # in bent bristles
    if LUGRE in s.friction:
        stored = s.plant.n * LUGRE.static**2 / (2 * LUGRE.stiffness)
    else:
        stored = 0.0
    gained = (energy - np.minimum.accumulate(energy)).max()
    assert span > 0.05
    assert gained <= 1e-3 * span + stored


# a jump of the mass in mid-run


@pytest.mark.parametrize("name", ["duffing", "inverted_pendulum", "pendulum_network"])
def test_after_a_jump_the_run_is_that_of_the_other_mass_from_there(name):
    fields = {"friction": (smc.Coulomb(0.3), smc.Viscous(0.1))}
    jumping = smc.run(scenario(name, jump=smc.Jump(0.04, {"mass": 2.0}), **fields))
    start = {"x0": tuple(jumping.x[40]), "v0": tuple(jumping.v[40])}
    rest = smc.run(
        scenario(
            name,
            mismatch={"mass": 2.0},
            duration=0.06,
            **start,
            **fields,
        )
    )
    np.testing.assert_allclose(jumping.x[40:], rest.x, atol=1e-9)
    np.testing.assert_allclose(jumping.v[40:], rest.v, atol=1e-7)


# what force and reaction say


@pytest.mark.parametrize(
    ("name", "friction"),
    [
        ("duffing", smc.hardware.LuGre(20.0, 20.0, 0.1)),
        ("inverted_pendulum", smc.Coulomb(20.0)),
        ("pendulum_network", smc.hardware.LuGre(20.0, 20.0, 0.1)),
    ],
)
def test_the_reaction_that_holds_a_stuck_joint_balances_all_other_forces(name, friction):
    trace = smc.run(scenario(name, friction=friction, duration=8.0, disturbance=smc.Constant(0.7)))
    assert np.abs(trace.v[-1]).max() < 1e-4
    np.testing.assert_allclose(trace.force[-1], trace.applied[-2], rtol=1e-12)
    np.testing.assert_allclose(
        trace.reaction[-1], -(balance(trace) + trace.d[-1]), rtol=1e-3, atol=1e-3
    )


@PLANTS
def test_a_motors_force_is_its_torque(name):
    """Of a held rotor, gear k i settles at u, the stall torque; the current's limit cuts it."""
    fields = {
        "friction": smc.Coulomb(50.0),
        "duration": 0.05,
        "law": smc.law("observer_free", lam=3.0, k1=20.0),
    }
    trace = smc.run(scenario(name, actuator=MOTOR, **fields))
    np.testing.assert_allclose(trace.force[-1], trace.applied[-1], rtol=1e-3)
    limit = 5.0 * MOTOR.constant
    cut = smc.run(scenario(name, actuator=dataclasses.replace(MOTOR, current=5.0), **fields))
    np.testing.assert_allclose(
        np.abs(cut.force[-1]), np.minimum(limit, np.abs(cut.applied[-1])), rtol=1e-3
    )


LOSSLESS = {  # so that the sum below knows every force from the trace
    "duffing": {"delta": 0.0},
    "inverted_pendulum": {"b": 0.0},
    "pendulum_network": {"b": 0.0},
    "inverted_pendulum_network": {"b": 0.0},
    "van_der_pol": {"mu": 0.0},
}
PUSHED = {
    "coulomb": {"friction": smc.Coulomb(0.4)},
    "lugre": {"friction": LUGRE},
    "both": {"friction": (LUGRE, smc.Coulomb(0.1))},
    "lag": {"actuator": smc.Lag(0.02), "friction": smc.Coulomb(0.4)},
    "rate limit": {"actuator": smc.hardware.RateLimit(50.0)},
    "motor": {"actuator": dataclasses.replace(MOTOR, rotor_inertia=0.0), "friction": LUGRE},
    "backlash": {"actuator": smc.Backlash(0.05, rotor_inertia=0.01)},
    "stops": {"contact": "stops", "v0": 5.0},
    "bobs": {"contact": "bobs", **APART},
    "floor": {"contact": "floor"},
    "peg": {"contact": "peg"},
    "wall": {"contact": "wall", "v0": 5.0},
}


def pushed():
    """(plant, part): each part on one plant that offers it, on one plant after the other."""
    plants = itertools.cycle(smc.paper.GAINS)
    for part, fields in PUSHED.items():
        yield (
            next(
                n
                for n in plants
                if fields.get("contact", "none") in {"none", *smc.plant(n).contacts}
            ),
            part,
        )


@pytest.mark.parametrize(("name", "part"), list(pushed()))
def test_the_impulse_of_all_forces_is_the_change_of_momentum(name, part):
    """Step by step:

    M (v_(k+1) - v_k) = h (force + reaction + d + the plant's own); a play hands the force on.
    """
    fields = dict(PUSHED[part])
    n = {"n": 3} if smc.plant(name).n > 1 else {}
    plant = smc.plant(name, **LOSSLESS[name], **n)
    h = 2.5e-4
    common = {
        "control_period": h,
        "physics_step": h,
        "integrator": "Euler",
        "disturbance": smc.Sine(1.0, 20.0),
    }
    trace = smc.run(scenario(plant, duration=0.3, **common, **fields))
    assert trace.failure is None
    values = plant.values({})
    own = np.array(
        [[plant.nominal(x, 0 * x, i, values)[0] for i in range(plant.n)] for x in trace.x]
    )
    inertia = 1.0 / plant.nominal(trace.x[0], trace.v[0], 0, values)[1]
    force = 0.0 if part == "backlash" else trace.force[1:]
    momentum = inertia * np.diff(trace.v, axis=0)
    right = h * (force + trace.reaction[1:] + trace.d[:-1] + inertia * own[:-1])
    # a blow's force is found to a tolerance, which MuJoCo's solver has
    exact = 1e-4 if "contact" in fields else 1e-6
    np.testing.assert_allclose(momentum, right, atol=exact * np.abs(momentum).max())
    if part == "backlash":
        assert np.abs(trace.reaction).max() > 0.5


def test_forces_are_means_over_the_control_period():
    """The impulse of a blow that is over between two samples is still in them, to the last newton
    second.
    """
    fine, coarse = (
        smc.run(
            scenario(
                law="none",
                contact="stops",
                v0=5.0,
                duration=0.3,
                control_period=p,
            )
        )
        for p in (2.5e-4, 0.02)
    )
    total = fine.reaction[1:].sum() * 2.5e-4
    assert abs(total) > 1.0
    assert coarse.reaction[1:].sum() * 0.02 == pytest.approx(total, rel=1e-9)


# what is refused


INSIDE = [
    {"plant": "duffing", "contact": "stops", "x0": 1.71},
    {"plant": "duffing", "contact": "floor", "x0": 1.9},
    {"plant": "duffing", "contact": "peg", "x0": 0.48},
    {"plant": "inverted_pendulum", "contact": "wall", "x0": 1.5},
    {"plant": "inverted_pendulum", "contact": "peg", "x0": 0.1},
    {
        "plant": "inverted_pendulum_network",
        "contact": "bobs",
        "x0": (0.3, -0.3, 0.0, 0.0, 0.0),
    },
]


def test_a_start_inside_an_obstacle_is_refused_before_anything_runs(refused):
    for fields in INSIDE:
        inside = smc.Scenario(law="none", duration=0.01, **fields)
        free = smc.Scenario(plant="van_der_pol", law="none", duration=0.01)
        words = (
            f"at x0 {inside.x0} of {fields['plant']} ",
            f"of contact {fields['contact']!r}: give another x0",
        )
        refused(lambda runs=(free, inside): next(iter(smc.stream(runs))), *words)


def test_a_voltage_that_mujoco_would_drop_ends_the_run():
    """MuJoCo drops a control above 1e10: a run may not go on without its motor and say nothing."""
    weak = smc.DCMotor(
        torque_constant=1e-10,
        gear=12.0,
        resistance=1e3,
        rotor_inertia=0.0,
        voltage=math.inf,
    )
    trace = smc.run(scenario(actuator=weak, u_max=math.inf))
    assert trace.failure is not None
    assert_same(trace, reference.run(trace.scenario))


# scenarios as values


EVERYTHING = {
    "friction": (smc.Viscous(0.1), LUGRE, smc.Coulomb(0.02)),
    "actuator": (MOTOR, smc.Backlash(0.02)),
    "sensor": smc.Encoder(
        1000,
        bias=0.01,
        dropout=0.1,
        period=2e-3,
        delay=1e-3,
    ),
    "contact": smc.hardware.Contact("stops", restitution=0.3),
    "disturbance": (
        smc.signals.Gust(1.0, 0.0, 0.1),
        smc.signals.BandLimited(0.1, 1.0, 5.0),
        smc.signals.TimeSeries((0, 1), (0, 1)),
    ),
    "input_delay": 7.5e-4,
}


def test_defaults_follow_the_fields_that_are_given():
    ideal = scenario()
    realistic = scenario(friction=smc.Viscous(0.1))
    assert ideal.resolved.integrator == "RK4"
    assert ideal.resolved.physics_step == 1e-3
    assert realistic.resolved.integrator == "implicitfast"
    assert realistic.resolved.physics_step == REALISTIC_STEP
    for a, b in (
        (ideal, realistic),
        (realistic, ideal),
    ):
        with_friction = dataclasses.replace(a, friction=b.friction)
        back = dataclasses.replace(with_friction, friction=a.friction)
        assert with_friction == b
        assert back == a
        assert hash(back) == hash(a)
    assert (
        dataclasses.replace(realistic, control_period=5e-3).resolved.physics_step == REALISTIC_STEP
    )
    assert dataclasses.replace(realistic, control_period=1e-4).resolved.physics_step == 1e-4


def test_drives_keep_the_plain_integrator():
    for actuator, step in (
        (smc.Lag(0.01), 1e-3),
        (smc.hardware.RateLimit(50.0), 2.5e-4),
        (smc.hardware.RateLimit(math.inf), 1e-3),
        (smc.Lag(1e-3), 1e-3),  # a lag's force has its first moment, too
        (smc.Lag(1e-4), 1e-3),
        ((smc.Lag(6e-4), smc.Lag(0.01)), 2.5e-4),
        (smc.DCMotor(), 2.5e-4),  # L/R = 0.28 ms
        (smc.DCMotor(inductance=0.0), 1e-3),
    ):
        driven = scenario(actuator=actuator)
        assert driven.resolved.integrator == "RK4"
        assert driven.resolved.physics_step == pytest.approx(step)


@PLANTS
def test_a_realistic_trace_comes_back_from_its_file(name, tmp_path):
    offers = smc.plant(name)
    fields = EVERYTHING | {"mechanism": "springs" if offers.mechanisms else "equation"}
    fields["contact"] = smc.hardware.Contact(next(iter(offers.contacts)), restitution=0.3)
    trace = smc.run(scenario(name, **fields, **(APART if offers.n > 1 else {})))
    again = smc.load(trace.save(tmp_path / "a.npz"))
    assert again.scenario == trace.scenario
    assert hash(again.scenario) == hash(trace.scenario)
    assert_same(again, trace)
    assert_same(smc.run(again.scenario), trace)


def test_every_channel_starts_with_its_rotor_in_the_middle_of_the_play():
    s = scenario("pendulum_network", actuator=smc.Backlash(0.1), v0=(0.1, 0.2, 0.3))
    model = models.with_values(models.compile_model(s), s)
    qpos, qvel = models.initial_state(model, s)
    for i, joint in enumerate(joint_ids(model)):
        rotor = model.joint(f"rotor:{model.joint(joint).name}")
        assert qpos[rotor.qposadr[0]] == qpos[model.jnt_qposadr[joint]] == s.resolved.x0[i]
        assert qvel[rotor.dofadr[0]] == s.resolved.v0[i]
