"""Numbers of a user's machine, by their paths, from logs of another simulation; and what is said of
logs and paths that cannot be used.
"""

import dataclasses
import re

import numpy as np
import pytest
from helpers.machine_logs import chain, log, servo_log, sines
from typer.testing import CliRunner

import smc_mujoco as smc
from smc_mujoco.analysis.engine import group
from smc_mujoco.cli.main import app
from smc_mujoco.errors import ScenarioWarning
from smc_mujoco.identification.first_guess import first_guess
from smc_mujoco.identification.friction_figure import curve_error, friction, measured_friction
from smc_mujoco.identification.identify import SLOW
from smc_mujoco.identification.own_rig import own_rig
from smc_mujoco.identification.replays import Replays
from smc_mujoco.mechanisms.custom.model_numbers import KINDS
from smc_mujoco.mechanisms.hardware.servos import ServoFriction
from smc_mujoco.simulation.conditions import from_file

ONE = chain([0.4], [1.0])
TRUTH = {"j1.damping": 0.3, "j1.frictionloss": 0.4, "j1.armature": 0.02, "input_delay": 0.004}
TWO = chain([0.35, 0.3], [1.2, 0.6])
MOTION = sines([0.0], [0.5, 0.3, 0.15], [0.4, 1.1, 2.7])


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path, monkeypatch):
    """The command writes into the present folder."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def arm():
    """An arm of one joint, whose file knows neither friction nor delay."""
    return smc.plant_from(ONE, ["j1"])


@pytest.fixture(scope="module")
def run():
    """3 s of it under a PD loop at 500 Hz."""
    return log(ONE, TRUTH, MOTION, 20.0, 1.5, duration=3.0)


@pytest.fixture(scope="module")
def found(arm, run):
    """Its numbers."""
    return smc.identify(arm, run, list(TRUTH))


def test_one_joint_s_friction_armature_and_delay_are_found_without_a_start(found):
    """Bounds fixed before: 1 % or two standard errors, and 0.1 ms."""
    for name, true in TRUTH.items():
        off = abs(found.values[name] - true)
        assert off <= max(2.0 * found.errors[name], 0.01 * true), name
    assert abs(found.values["input_delay"] - TRUTH["input_delay"]) < 1e-4
    assert min(found.by_pieces[0].values()) > 99.0
    assert not found.notes


def test_slow_residuals_that_nothing_explains_are_told(arm):
    """A force that the log lacks."""
    run = smc.run(
        smc.Scenario(
            plant=arm,
            law=smc.law("pid", kp=20.0, ki=0.0, kd=1.5),
            reference=smc.Sine(0.5, 2.5) + smc.Sine(0.3, 7.0),
            disturbance=smc.Sine(0.3, 1.7),
            noise=smc.Noise(2e-4),
            control_period=2e-3,
            duration=3.0,
            u_max=20.0,
        )
    )
    assert SLOW in smc.identify(arm, run, ["j1.armature", "j1.damping"]).notes


@pytest.mark.slow
def test_friction_that_gives_way_before_it_slides_is_told_and_in_the_errors():
    """A user's log of MuJoCo alone, whose default dry friction creeps: an armature 6 % off had an
    error of 1 %. Bristles of a LuGre, as of a real joint, do the same.
    """
    arm = smc.plant_from(ONE.replace('name="j1"', 'name="j1" damping=".3"'), ["j1"])
    machine = smc.Scenario(plant=arm, law="none", input_delay=0.004)
    names = ["j1.frictionloss", "j1.armature"]
    creeping = log(ONE, TRUTH, MOTION, 20.0, 1.5, duration=2.0, soft=True)
    bristles = smc.hardware.LuGre(0.4, 0.4, stribeck=1.0, stiffness=2000.0, damping=6.0)
    bending = smc.run(
        smc.Scenario(
            plant=arm,
            law=smc.law("pid", kp=20.0, ki=0.0, kd=1.5),
            reference=smc.Sine(0.5, 2.5) + smc.Sine(0.3, 7.0) + smc.Sine(0.15, 17.0),
            mismatch={"j1.armature": TRUTH["j1.armature"]},
            friction=bristles,
            noise=smc.Noise(2e-4),
            sensor=smc.Encoder(4096),
            control_period=2e-3,
            input_delay=0.004,
            duration=2.0,
            u_max=20.0,
        )
    )
    for run, way in ((creeping, "MuJoCo's default does"), (bending, "bristles that bend by")):
        identified = smc.identify(machine, run, names)
        assert (
            SLOW not in identified.notes
        )  # what is slow in the residuals is told, and in the errors
        shares = []
        for name in names:
            off = abs(identified.values[name] - TRUTH[name])
            shares.append(off / TRUTH[name])
            assert off < 2.0 * identified.errors[name], (way, name, off)
        assert max(shares) > 0.01
        (note,) = [note for note in identified.notes if "gives way" in note]
        assert way in note
    # what the note says to do can be done, and its numbers are near the bristles'
    (paths,) = re.findall(r"--for (\S+)", note)
    (text,) = re.findall(r'--condition "(.+?)"', note)
    quantities = ["j1.armature", *paths.split(",")]
    cured = smc.identify(arm, bending, quantities, condition=f"{text}, input_delay=0.004")
    assert cured.values["friction.j1.coulomb"] == pytest.approx(0.4, rel=0.01)
    assert cured.values["j1.armature"] == pytest.approx(TRUTH["j1.armature"], rel=0.02)


@pytest.mark.parametrize(("late", "coarse"), [(0.003, 1.0), (0.0035, 0.48)])
def test_finer_commands_break_a_joint_away_though_a_delay_is_between_commands(arm, late, coarse):
    """A mean of two commands is too weak for that, so it moves for half of the time."""
    level, force, period = TRUTH["j1.frictionloss"], 0.7, 2e-3
    t = period * np.arange(501)
    u = np.where(np.arange(501) % 10 == 5, force, 0.0)
    rig = own_rig(arm, list(TRUTH)).with_values(TRUTH | {"input_delay": late}, "true")
    part = rig.part({"t": t, "x": 0.1 * np.sin(10.0 * t), "u": u})
    finer = rig.finer(part, 4)
    inertia = float(arm.load().dof_M0[0]) + TRUTH["j1.armature"]
    travel = 0.5 * (force - level) * period**2 / inertia * force / level
    for commands, share in ((part, coarse), (finer, 1.0)):
        trace = smc.run(rig.repeated(commands, state=np.zeros(2)))
        assert trace.x[-1, 0] == pytest.approx(50.0 * travel * share, rel=0.05)


def test_a_log_that_an_open_loop_leaves_is_told_apart_from_a_poor_fit(found):
    poor_fits = tuple(dict.fromkeys(fit, -210.0) for fit in found.fits)
    (note,) = dataclasses.replace(found, fits=poor_fits).notes
    assert "judge by the pieces" in note
    (note,) = dataclasses.replace(found, fits=poor_fits, by_pieces=poor_fits).notes
    assert note.startswith("the fit is poor")


def test_a_first_guess_is_within_a_tenth_without_a_simulation(arm, run):
    """10 % from 3 s of a log; delays are tried in steps of 1 ms."""
    guess = first_guess(own_rig(arm, list(TRUTH)), [run])
    for name, true in TRUTH.items():
        assert guess.values[name] == pytest.approx(true, rel=0.1 if name != "input_delay" else 0.3)


@pytest.mark.slow
def test_two_motors_in_one_log_with_a_gain_and_a_delay_between_samples():
    """The delay is 1.5 samples. 2 % and 0.2 ms were fixed before."""
    truth = {
        "j1.damping": 0.25,
        "j1.frictionloss": 0.5,
        "j2.damping": 0.08,
        "j2.frictionloss": 0.15,
        "j2.gain": 0.85,
        "input_delay": 0.006,
    }
    motion = sines([0.0, 0.3], [0.5, 0.3, 0.12], [0.4, 1.1, 2.7])
    run = log(
        TWO, truth, motion, [40.0, 15.0], [3.0, 0.8], joints=("j1", "j2"), rate=250.0, duration=3.0
    )
    identified = smc.identify(smc.plant_from(TWO, ["j1", "j2"]), run, list(truth))
    for name, true in truth.items():
        assert identified.values[name] == pytest.approx(
            true, rel=0.04 if name == "input_delay" else 0.02
        )


def test_numbers_found_are_a_condition_that_files_and_runs_take(found, arm, tmp_path):
    condition = smc.condition("x", friction=smc.Coulomb(0.1))
    assert condition.on(arm, 1.0) != found.condition().on(arm, 1.0)
    fields = found.condition().on(arm, 1.0)
    assert fields["mismatch"]["j1.damping"] == pytest.approx(found.values["j1.damping"])
    assert fields["input_delay"] == pytest.approx(0.004)
    path = found.save(tmp_path / "found.txt")
    (read,) = from_file(path)
    assert read.on(arm, 1.0) == fields
    assert fields.pop("noise").position == found.noise
    rounding = 2.0 * np.pi / 4096 / np.sqrt(12.0)
    assert found.noise == pytest.approx(np.hypot(2e-4, rounding), rel=0.15)
    law = smc.law("pid", kp=20.0, ki=0.0, kd=1.5)
    common = {"plant": arm, "law": law, "duration": 0.5, "x0": 0.5, "u_max": 10.0}
    by_parts = smc.Scenario(
        **common,
        friction=(
            smc.Coulomb(found.values["j1.frictionloss"]),
            smc.Viscous(found.values["j1.damping"]),
        ),
        mismatch={"j1.armature": found.values["j1.armature"]},
        input_delay=0.004,
        physics_step=2.5e-4,
    )
    ours, theirs = smc.run([smc.Scenario(**common, **fields), by_parts])
    np.testing.assert_allclose(ours.x, theirs.x, atol=1e-9)


def test_a_joint_s_number_is_a_parameter_that_a_mismatch_changes():
    damped = smc.plant_from(ONE.replace('name="j1"', 'name="j1" damping=".2"'), ["j1"])
    common = {"plant": damped, "law": "none", "feedforward": smc.Sine(2.5, 3.0), "duration": 1.0}
    ours, theirs = smc.run(
        [
            smc.Scenario(**common, mismatch={"j1.damping": 1.5, "j1.frictionloss": 0.4}),
            smc.Scenario(**common, friction=(smc.Viscous(0.1), smc.Coulomb(0.4))),
        ]
    )
    np.testing.assert_allclose(ours.x, theirs.x, atol=1e-12)
    with pytest.raises(smc.ScenarioError, match=r"unknown parameter of chain 'j1\.dampng'"):
        smc.Scenario(**common, mismatch={"j1.dampng": 1.5})


def test_a_gearbox_that_warms_up_is_a_jump_of_its_joint_s_friction():
    """From then on the run is that of the other numbers, from the state that it has."""
    arm = smc.plant_from(ONE.replace('name="j1"', 'name="j1" damping=".2"'), ["j1"])
    cold, warm = {"j1.frictionloss": 0.8}, {"j1.frictionloss": 0.3, "j1.damping": 0.5}
    common = {"plant": arm, "law": "none", "u_max": 5.0}
    jump = smc.Jump(1.0, {"j1.frictionloss": warm["j1.frictionloss"] - 0.8, "j1.damping": 0.5})
    jumping = smc.Scenario(
        **common, feedforward=smc.Sine(2.5, 3.0), mismatch=cold, jump=jump, duration=2.0
    )
    first = smc.run(jumping)
    np.testing.assert_array_equal(
        first.x[:1001], smc.run(dataclasses.replace(jumping, jump=None, duration=1.0)).x
    )
    rest = smc.run(
        smc.Scenario(
            **common,
            feedforward=smc.Sine(2.5, 3.0, phase=3.0),
            mismatch=warm,
            x0=first.x[1000, 0],
            v0=first.v[1000, 0],
            duration=1.0,
        )
    )
    np.testing.assert_allclose(first.x[1000:], rest.x, atol=1e-9)
    assert "more than one equation a joint" in group.why_not(jumping, ("itae",))


@pytest.mark.filterwarnings("ignore:the dry friction of chain creeps")
def test_dry_friction_that_is_added_is_as_soft_as_the_file_says():
    """Also where the file has none, and only its softness."""
    runs = []
    for level, change in (("0", 0.4), (".4", 1.0)):
        option = f'name="j1" solreffriction=".0201 1" frictionloss="{level}"'
        arm = smc.plant_from(ONE.replace('name="j1"', option), ["j1"])
        fields = {"law": "none", "feedforward": smc.Sine(2.5, 3.0), "duration": 1.0, "u_max": 5.0}
        runs.append(
            smc.run(smc.Scenario(plant=arm, mismatch={"j1.frictionloss": change}, **fields))
        )
    np.testing.assert_array_equal(runs[0].x, runs[1].x)


def test_the_numbers_of_a_part_have_the_ranges_of_its_type(arm):
    servo = ServoFriction(kc=0.1, kcs=0.05, vs=0.3)
    machine = smc.Scenario(plant=arm, law="none", friction={"j1": servo}, actuator=smc.DCMotor())
    rig = own_rig(machine, ["friction.j1.kc", "friction.vs", "actuator.resistance", "j1.offset"])
    ranges = {name: (quantity.value, quantity.least) for name, quantity in rig.quantities.items()}
    assert ranges["friction.j1.kc"] == (0.1, 0.0)
    assert ranges["friction.vs"] == (0.3, 1e-9)
    assert ranges["actuator.resistance"][1] == 1e-9
    assert ranges["j1.offset"] == (0.0, -np.inf)
    units = [rig.quantities[name].unit for name in ("friction.j1.kc", "friction.vs")]
    assert units == ["N m", "rad/s"]
    moved = rig.with_values({"friction.vs": 0.5})
    assert moved.scenario("none").friction[0].vs == 0.5


@pytest.mark.quick
def test_the_units_of_a_slide_s_friction_are_those_of_a_slide():
    sled = ONE.replace('axis="0 1 0"', 'type="slide" axis="1 0 0"')
    bristles = smc.hardware.LuGre(0.2, 0.3, 0.1)
    machine = smc.Scenario(plant=smc.plant_from(sled, ["j1"]), law="none", friction=bristles)
    names = ["friction.coulomb", "friction.stribeck", "friction.stiffness"]
    rig = own_rig(machine, names)
    assert [rig.quantities[name].unit for name in names] == ["N", "m/s", "N/m"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: {"t": d["t"], "x": d["x"]}, "has no column u"),
        (lambda d: d | {"x": np.degrees(d["x"])}, "if it is in degrees, divide it by 57.3"),
        (lambda d: {name: values[::16] for name, values in d.items()}, "31.2 samples a second"),
        (
            lambda d: d | {"x": 1e-4 * np.random.default_rng(0).normal(size=len(d["t"]))},
            "no joint of chain moves in the record",
        ),
        (lambda d: d | {"t": 1e3 * d["t"]}, "give time in s"),
    ],
    ids=["without u", "degrees", "30 Hz", "at rest", "ms"],
)
def test_a_log_that_cannot_be_used_is_refused_in_a_sentence(arm, run, change, words):
    with pytest.raises(smc.ScenarioError, match=words):
        smc.identify(arm, change(run), ["j1.damping"])


def test_a_column_with_the_other_sign_and_small_angles_in_degrees_are_named(arm, run, refused):
    """Of a range of 0.07 rad, in degrees 4, which is no large angle."""
    names = ["j1.damping", "j1.frictionloss"]
    for turned in ("x", "u"):
        with pytest.raises(smc.ScenarioError, match=r"u of chain pushes against.* turn the sign"):
            smc.identify(arm, run | {turned: -run[turned]}, names)
    t = np.arange(0.0, 2.0, 2e-3)
    x = 0.07 * np.sin(12.0 * t)
    small = {"t": t, "x": np.degrees(x), "u": 0.05 * -144.0 * x + 1.96 * np.sin(x)}
    refused(lambda: smc.identify(arm, small, names), "column x of chain reaches 4", "in degrees")


def test_a_column_that_is_missing_is_named_before_the_numbers_are_asked_for(run, tmp_path):
    (tmp_path / "arm.xml").write_text(ONE)
    rows = np.column_stack([run["t"], run["x"], run["u"]])
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header="t,angle,u", comments="")
    words = ["identify", str(tmp_path / "arm.xml"), str(tmp_path / "run.csv")]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 2
    message = " ".join(done.output.split())
    assert "has no column x (it has t, angle, u)" in message
    assert "--columns x=NAME" in message
    done = CliRunner().invoke(app, [*words, "--columns", "x=angle"])
    assert done.exit_code == 2
    message = " ".join(done.output.split())
    assert "no number of arm is named. There are m, grav, input_delay, j1.damping" in message
    usual = ["j1.damping", "j1.frictionloss", "j1.armature", "input_delay"]
    line = ["smc-mujoco", *words, "--columns", "x=angle", "--for", ",".join(usual)]
    assert message.endswith(f"write {' '.join(line)}")


def test_the_friction_panel_of_a_servo_has_its_force_and_no_set_point():
    """By a log of MuJoCo alone: damping times speed and dry friction, where the joint slides."""
    servo = '<position joint="j1" kp="60" kv="3" ctrlrange="-1.5 1.5" forcerange="-12 12"/>'
    xml = chain([0.5], [0.8]).replace('<motor joint="j1"/>', servo)
    truth = {"j1.damping": 0.4, "j1.frictionloss": 0.3, "j1.armature": 0.03}
    rig = own_rig(smc.plant_from(xml, {"j1": smc.Channel(servo=True)}), list(truth))
    rig = rig.with_values(truth)
    t = np.arange(0.0, 3.0, 2e-3)
    log = servo_log(xml, truth, t, 0.4 * np.sin(3.0 * t))
    check_friction_of_servo(rig, log)


def check_friction_of_servo(rig, log):
    """Assert that the points of the panel are 0.4 v + 0.3 sign v where the joint slides."""
    v, forces = measured_friction(rig, rig.checked(log))
    slides = (np.abs(v[:, 0]) > 0.8) & np.isfinite(forces[:, 0])
    assert slides.sum() > 50
    expected = 0.4 * v[slides, 0] + 0.3 * np.sign(v[slides, 0])
    np.testing.assert_allclose(forces[slides, 0], expected, atol=0.06)
    turns = np.flatnonzero(np.diff(np.sign(v[:, 0])))
    assert len(turns)
    assert np.isnan(forces[turns, 0]).all()  # smoothed, they would go through 0


def pid_log(imax, first):
    """Return the file of an arm on a `<pid>`, the numbers that it lacks, and a log by MuJoCo alone
    that begins `first` s after the servo.
    """
    pid = f'<pid joint="j1" kp="60" kv="3" ki="40" imax="{imax}"/>'
    xml = chain([0.5], [0.8]).replace('<motor joint="j1"/>', pid)
    truth = {"j1.damping": 0.4, "j1.frictionloss": 0.3, "j1.armature": 0.03}
    truth["input_delay"] = 0.0039
    t = np.arange(0.0, first + 3.0, 2e-3)
    u = 0.6 + 0.4 * np.sin(2.5 * t) + 0.2 * np.sin(7.0 * t + 1.0) + 0.1 * np.sin(15.0 * t)
    log = servo_log(xml, truth, t, u)
    for name in log:
        log[name] = log[name][t >= first]
    return xml, truth, log


@pytest.mark.parametrize(("rate", "longest"), [(1000.0, 1e-3), (250.0, 2e-3)])
def test_trials_of_a_slow_log_hold_a_command_for_a_long_step(rate, longest):
    """They have a row for each of the log, and hardly differ from replays with short steps."""
    truth = {"j1.damping": 0.25, "j1.frictionloss": 0.5, "j2.damping": 0.08, "input_delay": 0.006}
    t = np.arange(round(rate)) / rate
    moving = {"x_j1": 0.3 * np.sin(6.0 * t), "x_j2": 0.3 * np.cos(5.0 * t)}
    pushed = {"u_j1": 5.0 * np.sin(7.0 * t), "u_j2": np.cos(9.0 * t)}
    rig = own_rig(smc.plant_from(TWO, ["j1", "j2"]), list(truth)).with_values(truth)
    replays = Replays(rig, list(truth), [{"t": t} | moving | pushed], False)
    assert replays.slope_steps == {"physics_step": pytest.approx(longest)}
    (short,) = replays.predicted([replays.start])
    replays.steps = replays.slope_steps
    (long,) = replays.predicted([replays.start])
    for name, values in short[0].items():
        assert long[0][name].shape == values.shape == (len(t),)
        np.testing.assert_allclose(long[0][name], values, atol=2e-3 * np.ptp(values))


def test_replays_have_the_same_steps_whatever_dry_friction_is_tried():
    """Else the cost of a search jumps where it tries no friction, and ends beside its minimum."""
    xml, truth, log = pid_log(0.03, 0.0)
    rig = own_rig(smc.plant_from(xml, {"j1": smc.Channel(servo=True, u_max=3.0)}), list(truth))
    steps = set()
    for tried_friction in (0.0, 0.3):
        tried = rig.with_values(truth | {"j1.frictionloss": tried_friction})
        replayed = tried.repeated(tried.part(log, 0.0, 0.1)).resolved
        steps.add((replayed.physics_step, replayed.integrator))
    assert len(steps) == 1


def test_a_piece_of_a_pid_s_log_begins_with_what_its_servo_has_integrated():
    """In a replay from 1 s on, by the log up to there; imax holds the integral for a while."""
    xml, truth, log = pid_log(0.03, 0.0)
    rig = own_rig(smc.plant_from(xml, {"j1": smc.Channel(servo=True, u_max=3.0)}), list(truth))
    part = rig.with_values(truth).part(log, 1.0, 1.0)
    assert 0.005 < abs(part.state[0]) <= 0.03
    off = []
    for integral in (part.state[0], 0.0):
        trace = smc.run(rig.with_values(truth).repeated(part, state=[integral, *part.state[1:]]))
        off.append(np.abs(trace.x[:: part.stride, 0] - log["x"][500:1001]).max())
    assert off[0] < 2e-3
    assert off[1] > 4e-3


@pytest.mark.slow
@pytest.mark.parametrize("imax", [1.0, 0.03])
def test_numbers_behind_a_pid_are_found_from_a_log_that_begins_in_its_course(imax):
    """Two errors were fixed before. With integrals of 0 the damping was 0, and the delay 13 ms."""
    xml, truth, log = pid_log(imax, 2.0)
    arm = smc.plant_from(xml, {"j1": smc.Channel(servo=True, u_max=3.0)})
    identified = smc.identify(arm, log, list(truth))
    for name, true in truth.items():
        assert abs(identified.values[name] - true) < 2.0 * identified.errors[name], name
        assert identified.errors[name] < 0.05 * true, name
    assert not identified.notes


def test_a_motor_s_column_that_is_missing_is_named():
    arm = smc.plant_from(TWO, ["j1", "j2"])
    t = np.arange(0.0, 2.0, 2e-3)
    columns = {"t": t, "x_j1": np.sin(t), "x_j2": np.cos(t), "u_j1": np.sin(t)}
    with pytest.raises(smc.ScenarioError, match="has no column u_j2"):
        smc.identify(arm, columns, ["m"])


def test_a_log_without_any_command_is_not_taken_for_a_file_without_joints(run, tmp_path):
    (tmp_path / "arm.xml").write_text(ONE)
    positions = {"t": run["t"], "x_j1": run["x"]}
    with pytest.raises(smc.ScenarioError, match="has x_j1 and no command: give u_j1"):
        smc.identify(str(tmp_path / "arm.xml"), positions, ["j1.damping"])


def test_a_number_of_a_joint_without_a_column_is_not_guessed(run, tmp_path):
    file = tmp_path / "two.xml"
    file.write_text(TWO)
    log = {"t": run["t"], "x_j2": run["x"], "u_j2": run["u"], "q_j1": run["x"]}
    with pytest.raises(smc.ScenarioError, match=r"no x_j1 and u_j1: its columns are t, x_j2, u_j2"):
        smc.identify(str(file), log, ["j1.damping", "j2.damping"])


def test_a_log_of_one_joint_asks_which_of_several_it_is(run, tmp_path):
    file = tmp_path / "two.xml"
    file.write_text(TWO)
    with pytest.raises(smc.ScenarioError, match="log has x of one joint, and"):
        smc.identify(str(file), run, ["m"])


def test_a_command_in_milliamperes_is_doubted_unless_its_gain_is_asked_for(arm, run):
    """Of a motor of 0.1 N m/A."""
    in_mA = {name: values[:900] for name, values in run.items()}
    in_mA["u"] = in_mA["u"] * 1e4
    with pytest.raises(smc.ScenarioError, match="if it is not in N m but in mA"):
        smc.identify(arm, in_mA, ["j1.damping"])
    identified = smc.identify(arm, in_mA, ["j1.gain", *TRUTH], most=1)
    assert identified.values["j1.gain"] == pytest.approx(1e-4, rel=0.05)
    assert any("relative to the model's mass" in note for note in identified.notes)


def test_an_unknown_path_lists_what_there_is(arm, run):
    with pytest.raises(smc.ScenarioError, match=r"input_delay, j1\.armature, j1\.damping"):
        smc.identify(arm, run, ["mass of the thing"])
    with pytest.raises(smc.ScenarioError, match=r"There are m, grav.*give names=\['j1\.damping'"):
        smc.identify(arm, run)
    loads = (smc.Constant(0.1), smc.Constant(0.2))
    two_loads = smc.Scenario(plant=arm, law="none", disturbance=loads)
    with pytest.raises(smc.ScenarioError, match="is a number of 2 parts"):
        smc.identify(two_loads, run, ["disturbance.amplitude"])
    changed = smc.Scenario(plant=arm, law="none", mismatch={"j1.damping": 0.2})
    with pytest.raises(smc.ScenarioError, match=r"no mismatch of j1\.damping: name them"):
        smc.identify(changed, run, ["input_delay"])  # it was left out without a word


def test_what_has_no_slope_or_the_slope_of_another_is_named(arm, run):
    machine = smc.Scenario(plant=arm, law="none", contact=smc.Stops({"j1": (-3.0, 3.0)}))
    with pytest.raises(smc.ScenarioError, match=r"depends on contact\."):
        smc.identify(machine, run, ["contact.restitution"])
    friction = smc.Scenario(plant=arm, law="none", friction=smc.Viscous(0.1))
    with pytest.raises(smc.ScenarioError, match=r"cannot tell .* apart"):
        smc.identify(friction, run, ["friction.b", "j1.damping"])


def test_a_trace_counts_as_the_log_of_a_machine(arm):
    """Of which the plant knows no friction: with the encoder's rounding, and without its states."""
    trace = smc.run(
        smc.Scenario(
            plant=arm,
            law=smc.law("pid", kp=20.0, ki=0.0, kd=2.0),
            reference=smc.Sine(0.6, 4.0),
            friction=smc.Coulomb(0.3),
            mismatch={"j1.damping": 0.2},
            sensor=smc.Encoder(counts=4096),
            control_period=2e-3,
            duration=2.0,
            u_max=10.0,
        )
    )
    identified = smc.identify(arm, trace, ["j1.damping", "j1.frictionloss"])
    assert identified.values["j1.damping"] == pytest.approx(0.2, rel=0.02)
    assert identified.values["j1.frictionloss"] == pytest.approx(0.3, rel=0.02)


def test_two_offsets_are_left_out_of_runs_and_said_so(found):
    rig = own_rig(smc.plant_from(TWO, ["j1", "j2"]), ["j1.offset", "j2.offset"])
    assert rig.not_in_runs == ("j1.offset", "j2.offset")
    without_numbers = dataclasses.replace(
        found, rig=rig, values={}, errors={}, correlations=np.zeros((0, 0))
    )
    assert any("j1.offset, j2.offset" in note for note in without_numbers.notes)


def test_a_gain_is_a_motor_whose_u_is_a_current_within_the_joint_s_force():
    bounded = ONE.replace('joint="j1"/>', 'joint="j1" ctrllimited="true" ctrlrange="-150 150"/>')
    arm = smc.plant_from(bounded, ["j1"])
    rig = own_rig(arm, ["j1.gain", "j1.offset"])
    rig = rig.with_values({"j1.gain": 8.478, "j1.offset": 3.0})
    fields = rig.condition_fields()
    scenario = smc.Scenario(
        plant=arm, law="none", feedforward=smc.Constant(100.0), x0=0.0, duration=0.01, **fields
    )
    assert scenario.limits == (pytest.approx(150.0 / 8.478),)
    trace = smc.run(scenario)
    assert trace.units()["u"] == "A"
    assert trace.u[-1, 0] == pytest.approx(17.693, abs=1e-3)
    start = smc.run(dataclasses.replace(scenario, feedforward=smc.Constant(1.0)))
    inertia = float(arm.load().dof_M0[0])
    assert start.v[-1, 0] == pytest.approx((8.478 + 3.0) * 0.01 / inertia, rel=0.02)


def test_a_chirp_is_recommended_and_a_staircase_is_last_because_it_rests(arm, tmp_path):
    names = ["j1.damping", "j1.frictionloss"]
    guess = {name: TRUTH[name] for name in names}
    fields = {"u_max": 5.0, "v_max": 4.0, "duration": 6.0, "rate": 250.0}
    advice = smc.design.excitation(arm, names, guess=guess, **fields)
    assert "chirp" in advice.motions[0].name
    last = advice.motions[-1]
    assert last.name == "staircase"
    assert last.rest > 0.4
    assert {*last.worst_pair[:2]} == {*names}
    assert "staircase is last: its errors are" in str(advice)
    assert re.search(r"\|u\| up to [.\d]+ N m, \|v\| up to [.\d]+ rad/s$", str(advice), re.M)
    for motion in advice.motions:
        assert motion.largest_u <= 5.0
        assert np.abs(np.gradient(motion.positions[0], motion.times)).max() <= 4.0
    with advice.save(tmp_path / "motion.csv").open() as file:
        assert file.readline() == "t,r\n"
        assert len(file.readlines()) == 1501
    svg, png = advice.figure(tmp_path / "motions")
    drawn = svg.read_text()
    for motion in advice.motions:
        assert f"<!-- {motion.name} -->" in drawn
        assert f"geometric mean {100.0 * motion.mean_share:.2g} %" in drawn
    assert png.stat().st_size > 10_000


def test_expected_errors_follow_the_encoder_and_the_noise_which_are_said(arm):
    fields = {"u_max": 5.0, "duration": 1.0, "rate": 250.0}
    coarse = smc.design.excitation(arm, ["j1.damping"], noise=0.0, counts=1024, **fields)
    fine = smc.design.excitation(arm, ["j1.damping"], noise=0.0, counts=2**17, **fields)
    noisy = smc.design.excitation(arm, ["j1.damping"], noise=1e-3, counts=2**17, **fields)
    assert "noise of 0 rad (m), encoders of 131072 counts" in str(fine)
    for worse in (coarse, noisy):
        assert worse.motions[0].mean_share > 1.5 * fine.motions[0].mean_share


def test_a_motion_stays_within_range_and_speed_and_an_unknown_one_is_refused(tmp_path):
    limited = smc.plant_from(ONE.replace('name="j1"', 'name="j1" range="-.2 .3"'), ["j1"])
    advice = smc.design.excitation(limited, ["j1.damping"], u_max=5.0, duration=2.0, rate=250.0)
    for motion in advice.motions:
        assert np.abs(motion.positions[0]).max() <= 0.9 * 0.2 + 1e-12
    with pytest.raises(smc.ScenarioError, match="unknown motion 'jump'"):
        advice.save(tmp_path / "motion.csv", "jump")


def shares(told, expected):
    """Return told errors over expected ones, of numbers of joints."""
    ratios = {}
    for name, error in told.items():
        if name.endswith((".damping", ".frictionloss", ".armature")):
            ratios[name] = error / expected[name]
    return ratios


@pytest.mark.slow
def test_expected_errors_are_those_that_logs_of_the_motion_tell():
    """Within a factor of 2, fixed before; in the median of three logs by the other simulation,
    whose controller tracks the motion. What one log tells is chance in part.
    """
    arm = smc.plant_from(ONE, ["j1"])
    advice = smc.design.excitation(arm, list(TRUTH), guess=TRUTH, u_max=20.0, duration=6.0)
    motion = next(
        candidate for candidate in advice.motions if candidate.name.startswith("three sines")
    )
    t, r = np.array(motion.times), np.array(motion.positions[0])
    dr = np.gradient(r, t)

    def reference(time):
        return np.array([np.interp(time, t, r)]), np.array([np.interp(time, t, dr)])

    errors_by_seed = []
    for seed in range(3):
        run = log(ONE, TRUTH, reference, 40.0, 3.0, duration=6.0, seed=seed)
        errors_by_seed.append(smc.identify(arm, run, list(TRUTH)).errors)
    for name, expected in motion.errors.items():
        typical = np.median([errors[name] for errors in errors_by_seed])
        assert 0.5 < typical / expected < 2.0, name


def test_the_command_takes_joints_from_a_log_and_writes_a_figure_and_a_condition(run, tmp_path):
    (tmp_path / "arm.xml").write_text(ONE)
    rows = np.column_stack([run["t"], run["x"], run["u"]])[:700]
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header="t,x_j1,u_j1", comments="")
    files = [str(tmp_path / name) for name in ("arm.xml", "run.csv")]
    options = ["--for", "j1.damping,input_delay", "--held-out", files[1]]
    done = CliRunner().invoke(app, ["identify", *files, *options])
    assert done.exit_code == 0, done.output
    rows = re.findall(r"^(\S+) +(\S+) +± (\S+) +(.+)$", done.output, re.MULTILINE)
    assert [(name, unit) for name, _, _, unit in rows] == [
        ("j1.damping", "N m s/rad"),
        ("input_delay", "ms"),
    ]
    (condition,) = from_file(tmp_path / "found.txt")
    late = condition.on(smc.plant_from(ONE, ["j1"]), 1.0)["input_delay"]
    assert float(rows[1][1]) == pytest.approx(1e3 * late, abs=0.13)  # whole steps of 0.25 ms
    assert re.search(r"fits (\S+) %, held out (\S+) %", done.output)
    assert max(map(len, done.output.splitlines())) <= 80
    assert len(done.output.splitlines()) <= 24
    page = (tmp_path / "fit" / "report.html").read_text()
    assert "Correlations of the errors" in page
    assert "data:image/svg+xml" in page
    assert (tmp_path / "fit.svg").stat().st_size > 10_000
    wrong = CliRunner().invoke(app, ["identify", *files, "--for", "nothing.here"])
    assert wrong.exit_code == 2
    assert "choose from grav, input_delay, j1.armature" in " ".join(wrong.output.split())


def test_the_friction_s_curve_is_the_model_s_and_its_parts_with_the_errors_of_both(arm):
    """By hand: (b + B) v + (f + F) sign v, and sqrt((s_b v)^2 + s_f^2)."""
    machine = smc.Scenario(plant=arm, law="none", friction=smc.Viscous(0.2))
    rig = own_rig(machine, ["j1.damping", "j1.frictionloss", "friction.b"])
    rig = rig.with_values({"j1.damping": 0.1, "j1.frictionloss": 0.4, "friction.b": 0.3})
    v = np.array([-2.0, 0.5])
    np.testing.assert_allclose(friction(rig, rig.values, 0, v), 0.4 * v + 0.4 * np.sign(v))
    error = curve_error(rig, np.diag([0.01**2, 0.02**2, 0.0]), 0, v)
    np.testing.assert_allclose(error, np.hypot(0.01 * v, 0.02), rtol=1e-6)


def test_a_range_in_degrees_that_was_meant_in_rad_is_told(refused):
    """MuJoCo reads the file's 1.57 as degrees where its compiler does not say radian."""
    limited = ONE.replace('name="j1"', 'name="j1" limited="true" range="-1.57 1.57"')
    slack = limited.replace('name="j1"', 'name="j1" solreflimit="0.001 1"')
    with pytest.warns(ScenarioWarning, match="moves from -0.0274 to 0.0274 rad. If the file"):
        arm = smc.plant_from(slack.replace('<compiler angle="radian"/>', ""), ["j1"])
    words = "-1.57 to 1.57 rad", 'angle="radian"'
    refused(lambda: smc.Scenario(plant=arm, law="none", x0=0.3), *words)
    refused(lambda: smc.Scenario(plant=arm, law="none", reference=smc.Constant(0.5)), *words)
    t = np.arange(0.0, 2.0, 0.002)
    run = {"t": t, "x": 0.5 * np.sin(3.0 * t), "u": np.sin(3.0 * t)}
    note = own_rig(arm, ["j1.damping"]).doubts([run])[0]
    assert "x reaches 0.5 rad, beyond the range of j1" in note, note
    assert all(word in note for word in words)
    far = smc.plant_from(limited, ["j1"])
    said = refused(lambda: smc.Scenario(plant=far, law="none", x0=2.0), "outside its range")
    assert "radian" not in said


def test_the_start_knows_where_other_joints_are_held():
    """A forearm that hangs from an upper arm held level: gravity pulls it by another angle."""
    key = '<keyframe><key name="home" qpos="1.57 0.3"/></keyframe></mujoco>'
    xml = chain([0.35, 0.3], [1.2, 0.6]).replace("</mujoco>", key)
    arm = smc.plant_from(xml, ["j2"], keyframe="home", others="held")
    true = {"j2.damping": 0.2, "j2.armature": 0.01}
    push = smc.Sine(1.0, 4.0) + smc.Sine(0.5, 11.0)
    run = smc.Scenario(plant=arm, mismatch=true, law="none", feedforward=push, duration=2.0)
    guess = first_guess(*own_rig(arm, list(true)).reading([smc.run(run)]))
    for name, value in true.items():
        assert guess.values[name] == pytest.approx(value, rel=0.15), name


def test_a_condition_that_was_found_has_no_servo_of_the_file_so_it_suits_ideal_motors():
    servo = '<position joint="j2" kp="40" kv="2" ctrlrange="-2 2"/>'
    joints = {"j1": smc.Channel(), "j2": smc.Channel(servo=True)}
    mixed = smc.plant_from(TWO.replace('<motor joint="j2"/>', servo), joints)
    numbers = {"j1.damping": 0.3, "input_delay": 0.004}
    rig = own_rig(mixed, list(numbers)).with_values(numbers, "by hand")
    fields = rig.condition_fields()
    assert fields.keys() == {"mismatch", "input_delay", "physics_step"}
    alone = smc.plant_from(TWO, ["j1"], others="held")
    assert smc.condition("found", **fields).on(alone, 1.0)["mismatch"] == {"j1.damping": 0.3}


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_of_number_starts_near_where_a_run_has_it(kind):
    """A row of KINDS is enough: slope, range and unit."""
    arm = smc.plant_from(ONE, ["j1"])
    true = {"damping": 0.3, "frictionloss": 0.4, "armature": 0.05, "stiffness": 2.0}.get(kind, 0.1)
    motion = smc.Sine(2.0, 4.0) + smc.Sine(1.0, 9.0)
    common = {"plant": arm, "law": "none", "feedforward": motion, "duration": 2.0, "u_max": 9.0}
    run = smc.run(smc.Scenario(**common, mismatch={f"j1.{kind}": true}))
    rig, data = own_rig(arm, [f"j1.{kind}"]).reading([run])
    assert first_guess(rig, data).values[f"j1.{kind}"] == pytest.approx(true, rel=0.1)
    assert rig.quantities[f"j1.{kind}"].least == KINDS[kind].least
