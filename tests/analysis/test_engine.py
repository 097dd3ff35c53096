"""The fast engine against MuJoCo: one contract for laws, plants and conditions."""

import dataclasses
import math
import random

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.engine import cpu, group
from smc_mujoco.analysis.engine.form import FAILED_STEP, FAILURE, LOGGED, SCORES, SETTING
from smc_mujoco.analysis.engine.scores import RESTING, engine_metrics, holds
from smc_mujoco.control.law import law_catalogue as laws
from smc_mujoco.hardware import ElasticJoint, RateLimit, Sigmoid
from smc_mujoco.mechanisms.plant import Field
from smc_mujoco.metrics import catalogue
from smc_mujoco.metrics.conventions import folded
from smc_mujoco.metrics.fold import Fold
from smc_mujoco.signals import BandLimited, Held, MinimumJerk, OrnsteinUhlenbeck, Relay
from smc_mujoco.simulation import state

AGREES = 1e-9  # of the start
BESIDE = (-2e-12, -1e-12, 1e-12, 2e-12)  # rad or m
SINE = smc.Sine(0.2, 5.0)
EVERY = frozenset(engine_metrics())  # metrics; half of what a loop takes to compile
FEW = frozenset(("energy", "itae", "tv"))  # of u, v and x, of loops whose samples are compared


@smc.hardware.friction_function(numbers={"stiffness": 500.0, "level": 0.3}, memory=1)
def dahl(y, p, memory):
    """P. R. Dahl's bristle, which bends and slips."""
    bend = math.copysign(p.level / p.stiffness, y.v)
    force = -p.stiffness * memory[0]
    memory[0] = bend + (memory[0] - bend) * math.exp(-abs(y.v) * y.h / abs(bend))
    return force


ALIKE = {  # they differ in numbers alone, and one loop runs them together
    "nominal": {},
    "noise": {"noise": smc.Noise(1e-3, 5e-3), "seed": 7},
    "delay": {"input_delay": 3e-3, "disturbance": SINE, "control_period": 2e-3},
    "random": {"disturbance": (OrnsteinUhlenbeck(0.2, 0.1), smc.Step(0.1, 2.0)), "seed": 3},
    "jump": {"jump": smc.Jump(3.0, {"mass": 2.0}), "mismatch": {"mass": 0.8}},
    "relay": {"disturbance": Relay(0.2, rate=1.0), "model": "nominal"},
    "jitter": {"clock": smc.Clock(jitter=5e-4, missed=0.1), "physics_step": 2.5e-4},
    "fault": {"fault": smc.Fault(1.0, gain=0.6), "input_delay": 2e-3},
    "stuck": {"fault": smc.Fault(0.5, stuck=True)},
    "pauses": {"clock": smc.Clock(pause=5e-3, pause_every=0.1)},
}
APART = {
    "estimated": {"velocity": "levant", "input_delay": 3e-3, "disturbance": SINE},
    "moving": {
        "reference": MinimumJerk(0.4, 1.0, 2.0),
        "feedforward": smc.Constant(0.1),
        "disturbance": Relay(0.2, rate=1.0),
    },
    "true model": {"model": "true", "disturbance": BandLimited(0.1, 1.0, 5.0)},
    "known errors": {"noise": smc.Noise(velocity_error=Held((0.0, 0.5), (0.0, 0.01)))},
    "surface": {"surface": "nonsingular_terminal"},
    "coulomb": {"friction": (smc.Coulomb(0.2), smc.Viscous(0.1)), "disturbance": SINE},
    "formula": {"friction": Sigmoid(0.4, 50.0), "disturbance": SINE, "model": "true"},
    "encoder": {"sensor": smc.Encoder(2048, bias=1e-3, dropout=0.1), "noise": smc.Noise(1e-3)},
    "late sensor": {"sensor": smc.Encoder(2048, period=4e-3, delay=3e-3, dropout=0.1)},
    "skew": {"sensor": smc.Encoder(delay=2e-3, skew=1e-3), "noise": smc.Noise(1e-3)},
    "own friction": {"friction": (dahl(level=0.1), smc.Viscous(0.1)), "disturbance": SINE},
    "compensation": {
        "friction": (smc.Coulomb(0.2), smc.Viscous(0.1)),
        "feedforward": smc.Feedforward((smc.Coulomb(0.2), smc.Viscous(0.1)), error=0.3),
        "reference": MinimumJerk(0.4, 1.0, 2.0),
    },
    "compensation at speed": {
        "friction": Sigmoid(0.4, 50.0),
        "feedforward": smc.Feedforward(Sigmoid(0.4, 50.0), on="speed", eps=0.02),
        "noise": smc.Noise(1e-3, 5e-3),
    },
    "compensation on the error": {
        "friction": smc.Coulomb(0.2),
        "feedforward": smc.Feedforward(smc.Coulomb(0.2), on="error", eps=0.1),
        "reference": MinimumJerk(0.4, 1.0, 2.0),
    },
    "compensation of a loss that grows with the load": {
        "friction": smc.Coulomb(0.1, km=0.1),
        "feedforward": smc.Feedforward(smc.Coulomb(0.1, km=0.1), on="speed", eps=0.1),
        "reference": MinimumJerk(0.4, 1.0, 2.0),
    },
    "lag": {"actuator": smc.Lag(0.01), "friction": smc.Coulomb(0.1), "input_delay": 3e-3},
    "drives": {"actuator": (smc.Lag(0.01), RateLimit(50.0))},
}


def check(plant, law, conditions, duration=10.0, of=EVERY):
    """Compare the samples and scores of runs, in one group, with those of MuJoCo."""
    base = smc.Scenario(
        plant=plant, law=smc.law(law) if isinstance(law, str) else law, duration=duration
    )
    cases = [dataclasses.replace(base, **fields) for fields in conditions.values()]
    moving = not isinstance(cases[0].references[0], smc.Constant)
    metrics = catalogue.CATALOGUE.keys() & of
    metrics = metrics.difference(RESTING if moving else ())
    if cases[0].resolved.integrator == "implicitfast":
        metrics = set(metrics).difference(filter(holds, metrics))
    metrics = sorted(metrics)
    assert not any(group.why_not(case, metrics) for case in cases)
    form_group = group.FormGroup(cases, metrics)
    form_group.rows[:, SETTING.logging] = 1.0
    logs = np.full((len(cases), base.samples + 1, base.plant.n, len(LOGGED)), np.nan)
    scores = cpu.run_rows(form_group.form, form_group.rows, form_group.tables, 1, logs)
    near = [_beside(cases, offset) for offset in BESIDE]
    close = list(map(smc.run, near))
    others_scores = []
    for near_scores in near:
        moved = group.FormGroup(near_scores, metrics)
        others_scores.append(moved.run(moved.rows))
    for i, (name, trace) in enumerate(zip(conditions, smc.run(cases), strict=True)):
        score = scores[i]
        beside_traces = [traces[i] for traces in close]
        if trace.diverged_at is not None:
            assert score[FAILURE] != state.FINE
            step = trace.scenario.resolved.physics_step
            assert score[FAILED_STEP] * step == pytest.approx(trace.diverged_at, abs=2e-3)
            continue
        assert score[FAILURE] == state.FINE
        if base.law.template and base.law.template.continuous:
            for j, column in enumerate(LOGGED):
                samples = getattr(trace, column)
                apart = np.abs(logs[i, : len(samples), :, j] - samples).max()
                room = 3.0 * max(
                    np.abs(getattr(scores_of_run, column) - samples).max()
                    for scores_of_run in beside_traces
                )
                assert apart <= AGREES * max(1.0, np.abs(samples).max()) + room, (name, column)
        beside = [catalogue.score(trace), *map(catalogue.score, beside_traces)]
        scores_beside = [score, *(near_scores[i] for near_scores in others_scores)]
        for j, metric in enumerate(metrics):
            # of all starts, because one alone may lie at an end of what rounding makes of it
            values = [scores_of_run[metric] for scores_of_run in beside]
            values_found = [scores_of_run[SCORES + j] for scores_of_run in scores_beside]
            room = AGREES + 3.0 * max(_spread(values), _spread(values_found))
            expected = pytest.approx(np.median(values), rel=AGREES, abs=room)
            assert np.median(values_found) == expected, (name, metric)


def _spread(values):
    """How far apart the values are that are not infinite."""
    finite = [value for value in values if value < np.inf]
    return np.ptp(finite or [0.0])


def _beside(cases, offset):
    """The runs from other starts, and with other masses: so close that only rounding tells them
    apart.
    """
    moved = []
    for case in cases:
        x0 = tuple(x + offset for x in case.resolved.x0)
        mass = case.mismatch.get("mass", 1.0) * (1.0 + offset)
        moved.append(dataclasses.replace(case, x0=x0, mismatch={"mass": mass}))
    return moved


@pytest.mark.parametrize(
    "plant", ["duffing", pytest.param("inverted_pendulum_network", marks=pytest.mark.slow)]
)
def test_a_run_is_that_of_mujoco_at_every_sample(plant):
    check(plant, "boundary_layer", ALIKE, duration=4.0, of=FEW | {"settling_time", "tv_rate"})


@pytest.mark.slow
@pytest.mark.parametrize("condition", APART)
@pytest.mark.parametrize(
    ("plant", "law"),
    [("inverted_pendulum", "super_twisting"), ("pendulum_network", "boundary_layer")],
)
def test_a_run_of_other_parts_is_that_of_mujoco(plant, law, condition):
    check(plant, law, {condition: APART[condition]}, duration=4.0)


ROW = smc.plant("pendulum_network", n=2)


def damped_fields(model, p):
    yield from ROW.fields(model, p)
    yield Field("tendon_damping", model.tendon("coupling0").id, p.kd)


def damped(x, v, i, p):
    inertia = p.m * p.l**2
    pull = p.kc * (x[1 - i] - x[i]) + p.kd * (v[1 - i] - v[i])
    return (pull - p.b * v[i] - p.m * p.grav * p.l * math.sin(x[i])) / inertia, 1.0 / inertia


def test_a_damper_between_joints_acts_as_in_mujoco_under_an_own_friction():
    """At kd = 2 N m s/rad a step that also solved for the other joint's speed was 6e-5 rad apart."""
    plant = dataclasses.replace(
        ROW,
        name="damped_row",
        parameters={**ROW.parameters, "kd": 2.0},
        fields=damped_fields,
        nominal=damped,
    )
    conditions = {"own friction": {"friction": dahl(level=0.1)}}
    check(plant, "pid", conditions, duration=0.5, of=FEW)


@smc.law_function(gains={"k": 0.5, "reach": math.inf})
def raising(y, gains, memory):
    if abs(y.x) > gains.reach:
        raise ValueError("too far")
    return -gains.k * (y.e + y.de), y.e


def test_a_run_beside_another_is_that_run_alone():
    """Runs take turns and draw noise for many samples: one that ends, fails or raises leaves the
    others as they are.
    """
    base = smc.Scenario(plant="duffing", law=raising(), duration=0.5, noise=smc.Noise(1e-3, 5e-3))
    short, raises = 0.03, raising(reach=0.0)
    cases = []
    for seed, fields in enumerate(
        (
            {"duration": short},
            {"duration": short, "law": raises},
            {},
            {"law": raises},
            {"x0": 9e5, "law": raising(k=-1e3)},
            {},
            {"duration": short},
        )
    ):
        cases.append(dataclasses.replace(base, seed=seed, **fields))
    form_group = group.FormGroup(cases, ("itae", "tv"))
    together = form_group.run(form_group.rows, threads=1)
    alone = [form_group.run(form_group.rows[i : i + 1])[0] for i in range(len(cases))]
    np.testing.assert_array_equal(together, alone)
    fine, raised, diverged = state.FINE, state.RAISED, state.DIVERGED
    assert together[:, FAILURE].tolist() == [fine, raised, fine, raised, diverged, fine, fine]


OTHERS = {  # plant, law, and what else the scenario has
    "joints": ("inverted_pendulum_network", "passivity_based", {"model": "nominal"}),
    "cart": ("cart_pole", "hierarchical", {}),
    "arm": ("furuta", "rotary_swing_up", {"x0": (0.0, 3.0)}),
    "elastic": (
        smc.plant("inverted_pendulum_network", n=3),
        "boundary_layer",
        {"actuator": {"p2/hinge": ElasticJoint(3e3, 1.0, 0.01, 1e-3)}, "v0": (0.1, 0.2, 0.3)},
    ),
    "rotor": (
        "duffing",
        "boundary_layer",
        {
            "actuator": (smc.Lag(0.01), ElasticJoint(4e3, 4.0, 0.1)),
            "sensor": smc.Encoder(math.inf, side="motor", delay=2e-3),
        },
    ),
    "sticking": (
        "duffing",
        smc.law("pid", kp=60.0, ki=40.0, kd=8.0),
        {"friction": smc.Coulomb(2.0), "reference": smc.Sine(0.1, 3.0), "x0": 0.0},
    ),
    "bristles": (
        smc.plant("pendulum_network", n=2),
        "boundary_layer",
        {
            "friction": (smc.hardware.LuGre(0.1, 0.15, 0.05), smc.Viscous(0.1)),
            "jump": smc.Jump(1.0, {"m": 2.0}),
        },
    ),
    "torque": ("pendulum_network", smc.law("pid").on_computed_torque(), {"model": "nominal"}),
}


SLOW = [pytest.param(kind, marks=pytest.mark.slow) for kind in ("cart", "arm", "torque")]


@pytest.mark.parametrize("kind", ["joints", "elastic", "rotor", "sticking", "bristles", *SLOW])
def test_a_law_or_a_machine_of_another_kind_runs_as_in_mujoco(kind):
    plant, law, fields = OTHERS[kind]
    noisy = {"noise": smc.Noise(1e-4, 5e-4), "disturbance": SINE, "input_delay": 2e-3}
    metrics_of_kind = (
        EVERY if kind in ("joints", "sticking") else FEW
    )  # of several channels, and of friction
    check(plant, law, {"plain": fields, "noise": fields | noisy}, duration=2.0, of=metrics_of_kind)


def solved(plant, **numbers):
    """The plant, where MuJoCo's search for the forces of constraints goes on to the end. By itself it
    stops early, which moved samples of such runs by up to 1e-9 rad and 3e-7 rad/s.
    """
    plant = smc.plant(plant, **numbers)

    def build(n):
        spec = plant.build(n)
        spec.option.tolerance = 0.0
        return spec

    return dataclasses.replace(plant, build=build)


@smc.hardware.friction_function(numbers={"share": 0.1, "rate": 20.0}, memory=1)
def yielding(y, p, memory):
    """Gives way to what acts on the joint, late."""
    memory[0] += y.h * p.rate * (y.load + y.motor - memory[0])
    return -p.share * memory[0]


PLAY = smc.Backlash(0.01, rotor_inertia=0.02, rotor_damping=0.01)
SHAKEN = {"noise": smc.Noise(1e-4, 5e-4), "disturbance": SINE, "input_delay": 2e-3}
GEARS = {  # plant, and what else the scenario has
    "joint": (
        solved("inverted_pendulum"),
        {"actuator": PLAY, "friction": (smc.Coulomb(0.3), smc.Viscous(0.1)), "model": "true"},
    ),
    "rotor": (
        solved("duffing"),
        {
            "actuator": (smc.Lag(0.01), smc.Backlash(0.002, 0.4)),
            "friction": (smc.Coulomb(0.4, side="motor"), smc.Viscous(0.1, side="motor")),
            "sensor": smc.Encoder(math.inf, side="motor", delay=2e-3),
            "jump": smc.Jump(1.0, {"mass": 2.0}),
        },
    ),
    "bristles": (
        solved("duffing"),
        {"actuator": PLAY, "friction": smc.hardware.LuGre(0.2, 0.3, 0.05, side="motor")},
    ),
    "row": (
        solved("pendulum_network", n=3),
        {
            "actuator": {"p1/hinge": PLAY, "p2/hinge": smc.Backlash(0.0)},
            "friction": {
                "p0/hinge": (smc.Coulomb(0.1), dahl(level=0.1)),
                "p1/hinge": (smc.Coulomb(0.1, side="motor"), yielding()),
                "p2/hinge": (smc.Coulomb(0.05), yielding(share=0.2)),
            },
            "v0": (0.1, 0.2, 0.3),
        },
    ),
}


@pytest.mark.parametrize("kind", GEARS)
def test_a_play_is_that_of_mujoco(kind):
    plant, fields = GEARS[kind]
    check(plant, "boundary_layer", {"plain": fields, "noise": fields | SHAKEN}, 1.5, FEW)


def drawn_play(draw):
    """A plant with a play, and with friction of any kind on any side of it."""
    plant = solved(draw.choice(["duffing", "inverted_pendulum", "van_der_pol"]))
    gap = 10.0 ** draw.uniform(-3.5, -1.0)
    play = smc.Backlash(gap, 10.0 ** draw.uniform(-3.0, 0.0), draw.choice([0.0, 0.05]))
    level = 10.0 ** draw.uniform(-2.0, 0.0)
    frictions = [smc.Coulomb(level), smc.hardware.LuGre(level, 1.5 * level, 0.05)]
    sides = draw.sample(["link", "motor"], 2)
    for k, side in enumerate(sides):
        frictions[k] = dataclasses.replace(frictions[k], side=side)
    frictions = draw.sample(frictions, draw.choice([0, 1, 2]))
    if frictions:
        frictions.append(smc.Viscous(0.1, side=frictions[-1].side))
    drive = draw.choice([(), (smc.Lag(0.01),), (RateLimit(200.0),)])
    sensor = smc.Encoder(draw.choice([math.inf, 4096]), side=draw.choice(["link", "motor"]))
    fields = {"actuator": (*drive, play), "friction": tuple(frictions) or None, "sensor": sensor}
    return plant, fields | draw.choice([{}, SHAKEN])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_a_play_that_is_drawn_is_that_of_mujoco(seed):
    draw = random.Random(seed)
    plant, fields = drawn_play(draw)
    law = draw.choice(["boundary_layer", "pid", "super_twisting", "adrc"])
    check(plant, law, {"drawn": fields}, duration=1.5)


@pytest.mark.parametrize(
    ("plant", "fields"),
    [
        ("duffing", {"actuator": PLAY, "friction": Sigmoid(0.4, 50.0)}),
        ("duffing", {"actuator": (smc.DCMotor(), PLAY)}),
        ("duffing", {"actuator": PLAY, "contact": "stops"}),
        ("cart_pole", {"actuator": PLAY}),
        (
            "inverted_pendulum_network",
            {"actuator": {"p0/hinge": PLAY, "p1/hinge": ElasticJoint(3e3)}},
        ),
    ],
    ids=str,
)
def test_what_is_beside_a_play_may_be_for_mujoco_alone(plant, fields):
    case = smc.Scenario(plant=plant, law="none", **fields)
    assert group.why_not(case)
    assert group.why_not(dataclasses.replace(case, contact="none", friction=None), ("stick_time",))


GENERAL = [law for law in laws() if not laws()[law].plants]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_parts_that_are_drawn_together_run_as_in_mujoco(seed):
    draw = random.Random(seed)
    plant = draw.choice(["duffing", "inverted_pendulum", "pendulum_network", "van_der_pol"])
    law = draw.choice(GENERAL)
    parts = ALIKE | APART
    del parts["own friction"]  # the engine runs it without a drive alone
    fields = {}
    for name in draw.sample(sorted(parts), 4):
        fields |= parts[name]
    check(plant, law, {"drawn": fields}, duration=4.0)  # a jump is at 3 s


@pytest.mark.slow
@pytest.mark.parametrize("law", GENERAL)
def test_every_law_runs_as_in_mujoco(law):
    conditions = {name: ALIKE[name] for name in ("nominal", "noise", "delay", "jump")}
    check("inverted_pendulum", law, conditions)


@pytest.mark.quick
def test_a_new_row_is_in_the_score_of_a_trace_and_in_the_engine(monkeypatch):
    monkeypatch.setitem(catalogue.CATALOGUE, "late_speed", None)  # and takes it away again

    @folded("{x}/s", Fold("v", "mean", 2, "late"))
    def late_speed(trace):
        """Root mean square of v in the last part, worst channel."""
        ...

    case = smc.Scenario(plant="duffing", law=smc.law("pid"), duration=0.5)
    trace = smc.run(case)
    expected = np.sqrt(np.mean(trace.v[400:] ** 2))
    assert late_speed(trace) == smc.score(trace)["late_speed"] == pytest.approx(expected)
    assert not group.why_not(case, ("late_speed",))
    by_engine = group.FormGroup([case], ("late_speed",)).scored("cpu", 1)[0][0]
    assert by_engine == pytest.approx([expected], rel=AGREES)


def test_a_spring_beside_bristles_is_refused_for_what_it_is():
    spring = ElasticJoint(500.0, 0.2)
    bristles = smc.hardware.LuGre(0.1, 0.15, 0.05)
    fields = {"plant": "duffing", "law": "none", "duration": 1.0, "actuator": spring}
    assert "elastic joint beside" in group.why_not(smc.Scenario(**fields, friction=bristles))
    assert not group.why_not(smc.Scenario(**fields))


def test_the_limit_cycle_of_a_run_is_that_of_its_trace(monkeypatch):
    """Of channels that chatter and of those that do not, of runs of several lengths, and of so few
    logs at once that they come in parts.
    """
    names = "itae", "chattering_frequency", "chattering_amplitude"
    monkeypatch.setattr(group, "LOG_NUMBERS", 1)
    late = {"plant": "pendulum_network", "input_delay": 4e-3}
    late["law"] = law = smc.law("super_twisting")(k1=20.0, k2=200.0)
    # of one form, which is compiled once
    cases = [
        smc.Scenario(duration=2.0, **late, disturbance=(SINE, smc.Step(0.0))),
        smc.Scenario(duration=3.0, **late, disturbance=(smc.Sine(0.0, 5.0), smc.Step(0.0))),
        smc.Scenario(
            duration=1.0, **late | {"law": law(k1=1e-3, k2=1e-3)}, disturbance=(SINE, smc.Step(0.0))
        ),
        smc.Scenario(duration=1.0, **late, disturbance=(SINE, smc.Step(1e200, 0.99))),
    ]
    alone = []
    for case in cases:
        trace = smc.run(case)
        assert not group.why_not(case, names)
        ((cycle, failed),) = group.FormGroup([case], names).scored("cpu", 1)
        assert (failed is None) == (trace.diverged_at is None)
        if failed is None:
            values = catalogue.score(trace)
            expected = [values[name] for name in names]
            assert cycle == pytest.approx(expected, rel=1e-6, nan_ok=True)
        else:
            assert np.isnan(cycle).all()
        alone.append((cycle, failed))
    assert not np.isnan(alone[0][0] + alone[1][0]).any()  # they chatter
    monkeypatch.undo()
    assert group.FormGroup(cases[:2], names).scored("cpu", 2) == alone[:2]
    assert "only the processor writes" in group.why_not(cases[0], names, "cuda")
