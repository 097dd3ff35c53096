"""Rotors beside joints: what an encoder on either side reads, and where a spring or a play stands at
the start of a piece, of logs by an integration of both equations.
"""

import dataclasses
import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.machine_logs import chain, sines

import smc_mujoco as smc
from smc_mujoco.identification import gauss_newton, lack_of_fit
from smc_mujoco.identification.compliance import compliance
from smc_mujoco.identification.first_guess import first_guess
from smc_mujoco.identification.hidden_starts import begun, hidden_starts
from smc_mujoco.identification.own_rig import own_rig
from smc_mujoco.identification.replays import Point, Replays
from smc_mujoco.simulation.conditions import find_condition
from smc_mujoco.simulation.readings import readings

RANDOM = np.random.default_rng(0)
STEP, RATE = 2e-5, 500.0  # s, Hz
SPRING = smc.hardware.ElasticJoint(500.0, 0.5, 0.03)
PLAY = smc.Backlash(0.02, 0.03)
MOTION = sines([0.0], [0.5, 0.3, 0.15], [0.4, 1.1, 2.7])


@pytest.fixture(scope="module")
def arm():
    return smc.plant_from(
        chain([0.4], [1.0]).replace('name="j1"', 'name="j1" damping=".2"'), ["j1"]
    )


@pytest.fixture(scope="module")
def logs(arm):
    """What an encoder on each side of the spring reads in 1.2 s, under one loop on the rotor."""
    inertia, weight = float(arm.load().dof_M0[0]), 9.81 * 0.2
    x = v = y = w = u = 0.0
    rows = []
    for k in range(round(1.2 / STEP)):
        if k % round(1.0 / RATE / STEP) == 0:
            (r,), (dr,) = MOTION(k * STEP)
            u = 20.0 * (r - y) + 1.5 * (dr - w)
            rows.append((k * STEP, y, x, u))
        f = SPRING.stiffness * (y - x) + SPRING.damping * (w - v)
        w += STEP * (u - f) / SPRING.rotor_inertia
        v += STEP * (f - 0.2 * v - weight * math.sin(x)) / inertia
        x += STEP * v
        y += STEP * w
    t, rotor, joint, command = np.array(rows).T
    return {"motor": {"t": t, "x": rotor, "u": command}, "link": {"t": t, "x": joint, "u": command}}


def rig_of(arm, side, names=("input_delay",)):
    scenario = smc.Scenario(
        plant=arm, law="none", actuator=SPRING, sensor=smc.Encoder(math.inf, side=side)
    )
    return own_rig(scenario, list(names))


@pytest.mark.parametrize("side", ["motor", "link"])
def test_a_replay_gives_what_the_encoder_of_its_side_reads(arm, logs, side):
    opposite = {"motor": "link", "link": "motor"}[side]
    rig = rig_of(arm, side)
    assert rig.fit(logs[side])["x"] > 99.9
    assert rig.fit(logs[opposite])["x"] < 99.7


@pytest.mark.parametrize("side", ["motor", "link"])
def test_a_piece_that_begins_in_motion_begins_with_a_bent_spring(arm, logs, side):
    """Unbent, it would swing by 3 mrad."""
    bend = logs["motor"]["x"] - logs["link"]["x"]
    first = int(np.argmax(np.abs(bend[:300])))
    late = {name: column[first:] for name, column in logs[side].items()}
    rig = rig_of(arm, side)
    assert rig.fit(late)["x"] > 99.95  # 99.84 and 99.89 with the bend that the command alone gives
    replays = Replays(rig, [], [late], False)
    assert len(replays.free) == 4
    start = replays.slopes(replays.start)
    point = Point(np.zeros(0), start.moves(np.zeros(0)))
    (residuals,) = replays.residuals([point])
    assert np.linalg.norm(residuals[0]) < 3e-4
    assert abs(bend[first]) > 1e-3
    state = replays.state(point, 0)
    assert state is not None
    assert state[0] == pytest.approx(bend[first], abs=2e-4)


@pytest.mark.slow
def test_a_spring_that_the_model_lacks_is_named_with_the_encoder_s_side(arm, logs):
    names = ["j1.damping", "j1.armature", "input_delay"]
    rig = first_guess(own_rig(arm, names), [logs["motor"]])
    replays = Replays(rig, names, [logs["motor"]], False)
    slopes = gauss_newton.refine(replays, replays.slopes(replays.start), 6)
    solved = rig.with_values(replays.values(slopes.point))
    lacks = compliance(solved, replays, slopes)
    link, motor = lack_of_fit._shares(slopes, lacks)
    assert motor.explained > max(0.5, link.explained)
    assert motor.deviations > lack_of_fit.SIGNIFICANT
    (text,) = [lack.text for lack in lacks if "reads the motor" in lack.text]
    (written,) = re.findall(r'--condition "(.+)"', text)
    assert smc.condition("geared", **find_condition(written).on(arm, 1.0))
    spread = replays.pieces[0].spread["x"]
    quiet = [1e-9 * row / spread for row in slopes.residuals]
    noisy = dict(logs["motor"], x=logs["motor"]["x"] + 1e-3 * RANDOM.standard_normal(600))
    rounded = Replays(rig, names, [noisy], False)
    assert compliance(solved, rounded, dataclasses.replace(slopes, residuals=quiet)) == []


@pytest.mark.quick
def test_hidden_starts_are_put_into_the_parts_of_their_joints_within_the_play(arm):
    scenario = smc.Scenario(plant=arm, law="none", actuator=PLAY)
    starts = hidden_starts(scenario)
    assert [start.field for start in starts] == ["lead", "lead_rate"]
    (part,) = begun(scenario.actuator, arm, starts, np.array([0.5, -2.0]))
    assert (part.lead, part.lead_rate) == (0.01, -2.0)
    x = np.linspace(0.0, 0.1, 100)
    assert starts[0].guesses(np.full(100, 3.0), x, 1e-3).tolist() == [0.01] * 100
    assert starts[1].guesses(np.full(100, 3.0), x, 1e-3).tolist() == [0.0] * 100


def test_a_run_begins_where_its_rotor_is(arm):
    """An unloaded rotor in its play keeps its speed until it meets a flank."""
    begin = dataclasses.replace(PLAY, lead=-0.01, lead_rate=0.5)
    scenario = smc.Scenario(
        plant=arm,
        law="none",
        actuator=begin,
        sensor=smc.Encoder(math.inf, side="motor"),
        x0=0.0,
        duration=0.02,
    )
    t = 1e-3 * np.arange(21)
    np.testing.assert_allclose(readings(smc.run(scenario))[:, 0], 0.5 * t - 0.01, atol=1e-6)


@smc.law_function(gains={"k": 20.0})
def telling(y, gains, memory):
    return -gains.k * y.e - 2.0 * y.de, y.x


@pytest.mark.parametrize("side", ["motor", "link"])
def test_readings_of_a_run_are_what_its_law_read(arm, side):
    scenario = smc.Scenario(
        plant=arm,
        law=telling(),
        actuator=SPRING,
        sensor=smc.Encoder(4096, bias=0.01, side=side),
        noise=smc.Noise(1e-3),
        x0=0.3,
        duration=0.1,
    )
    trace = smc.run(scenario)
    np.testing.assert_array_equal(readings(trace), trace.s)
    assert np.std(trace.s - trace.x) > 5e-4


@pytest.mark.parametrize("start", [(0.1, 0.15, 0.3), (0.2, 0.2, 1.0), (0.5, 0.6, 0.05)])
def test_a_level_at_rest_and_one_while_sliding_keep_their_slopes_whatever_the_start(arm, start):
    """Where forces alone put the level at rest below the other, one overwrote the other."""
    machine = {"plant": arm, "u_max": 20.0, "control_period": 2e-3}
    run = smc.run(
        smc.Scenario(
            **machine,
            friction=smc.hardware.Stribeck(0.3, 0.5, 0.15),
            law=smc.law("pid", kp=20.0, ki=0.0, kd=1.5),
            reference=smc.Sine(0.5, 2.5) + smc.Sine(0.3, 7.0),
            duration=1.1,
        )
    )
    names = ["friction.coulomb", "friction.static", "friction.stribeck"]
    base = smc.Scenario(plant=arm, law="none", friction=smc.hardware.Stribeck(*start))
    rig, data = own_rig(base, names).reading([run])
    guess = first_guess(rig, data)
    assert guess.values["friction.static"] >= 1.049 * guess.values["friction.coulomb"]
    replays = Replays(guess, names, data, False)
    slopes = replays.slopes(replays.start)
    assert np.linalg.norm(slopes.freed_slopes, axis=0).min() > 1e-4
    swapped = guess.with_values({"friction.coulomb": 0.6, "friction.static": 0.4})
    part = swapped.scenario("none").friction[0]
    assert (part.coulomb, part.static) == (0.4, 0.6)


def test_another_stiffness_is_tried_with_damping_as_an_undamped_spring_rings():
    """From 478 N m/rad and no damping, of 300 with 0.4: undamped, each stiffness leaves as much."""
    names = ["actuator.stiffness", "actuator.damping"]

    def residuals(points):
        rows = []
        for point in points:
            stiffness, damping = point.values * (100.0, 0.1)
            rings = 1.0 if damping < 0.05 else abs(stiffness / 300.0 - 1.0)
            rows.append([np.array([0.0, 0.0, rings, 0.0])])
        return rows

    replays = SimpleNamespace(
        names=names,
        scales=np.array([100.0, 0.1]),
        low=np.zeros(2),
        high=np.full(2, np.inf),
        twin=SimpleNamespace(springs=names[:1]),
        residuals=residuals,
    )
    present = Point(np.array([4.78, 0.0]), np.zeros((1, 0)))
    slopes = SimpleNamespace(
        point=present,
        residuals=residuals([present])[0],
        basis=np.eye(4)[:, :2],
        freed=lambda rows: rows,
    )
    spring = gauss_newton._other_spring(replays, slopes)  # pyright: ignore[reportArgumentType]
    assert spring is not None
    stiffness, damping = spring.values * replays.scales
    assert stiffness == pytest.approx(0.6 * 478.0)
    assert 1e-4 * stiffness < damping < 1e-2 * stiffness


def test_a_rotor_that_starts_on_the_wrong_flank_of_its_play_is_tried_on_the_other(arm):
    """Seen from the joint, a play of 0.03 came out as 0.0282 with an error of 0.0002: one piece of
    four had started on the wrong flank, where its cost has a valley, too.
    """
    machine = {"plant": arm, "actuator": PLAY, "control_period": 2e-3, "u_max": 20.0}
    motion = smc.Sine(0.5, 2.5) + smc.Sine(0.3, 7.0)
    law = smc.law("pid", kp=20.0, ki=0.0, kd=1.5)
    run = smc.run(smc.Scenario(**machine, law=law, reference=motion, duration=1.4))
    first = 150  # in motion
    log = {"t": run.t[first:], "x": run.x[first:, 0], "u": run.u[first:, 0]}
    replays = Replays(
        own_rig(smc.Scenario(**machine, law="none"), ["input_delay"]), [], [log], False
    )
    ends = []
    for side in (-1.0, 1.0):
        begun_there = replays.at_flanks(replays.start, side)
        state = replays.state(begun_there, 0)
        assert state is not None
        assert state[0] == pytest.approx(side * 0.5 * PLAY.gap)
        ends.append(gauss_newton.refine(replays, replays.slopes(begun_there), 4, 0.01))
    right, wrong = sorted(ends, key=lambda slopes: slopes.cost)
    assert wrong.cost > 5.0 * right.cost
    reached = gauss_newton.search(replays, wrong, 1, 0, 6, 0.01)
    assert reached.cost < 1.1 * right.cost


@pytest.mark.parametrize("side", ["motor", "link"])
def test_a_piece_that_begins_in_the_middle_of_a_play_is_fitted_from_there(arm, side):
    """From the flanks its fit was 91 and 93 %: a play of 0.03 came out as 0.0259 of a motor's log."""
    sensor = smc.Encoder(8192, side=side)
    machine = {"plant": arm, "actuator": PLAY, "sensor": sensor, "control_period": 2e-3}
    motion = smc.Sine(0.5, 2.5) + smc.Sine(0.3, 7.0)
    law = smc.law("pid", kp=20.0, ki=0.0, kd=1.5)
    run = smc.run(smc.Scenario(**machine, law=law, reference=motion, duration=0.6))
    log = {"t": run.t, "x": readings(run, False)[:, 0], "u": run.u[:, 0]}
    rig = own_rig(smc.Scenario(**machine, law="none"), ["input_delay"])
    assert gauss_newton.fit_starts(Replays(rig, [], [log], False), 8).fit > 99.5


@pytest.mark.parametrize(
    ("side", "beside", "plays"),
    [
        ("link", ["input_delay"], ["j1.play"]),
        ("link", [], []),
        ("motor", ["input_delay"], []),
    ],
)
def test_a_play_that_only_the_joint_shows_is_doubted_beside_a_delay(arm, side, beside, plays):
    sensor = smc.Encoder(8192, side=side)
    scenario = smc.Scenario(plant=arm, law="none", actuator=PLAY, sensor=sensor)
    rig = own_rig(scenario, ["j1.play", *beside])
    assert rig.plays_by_impacts == plays
    assert any("an encoder on the motor's side" in text for text in rig.cautions) == bool(plays)
