"""Friction from pairs of speed and torque: made pairs give their numbers within the errors told, and
the part resists as they do.
"""

import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

import smc_mujoco as smc
from smc_mujoco.cli.main import app
from smc_mujoco.simulation.conditions import from_file

T = np.linspace(0.0, 20.0, 10_000)
SPEED = 1.5 * np.sin(1.7 * T) + 0.4 * np.sin(5.0 * T)
SIGN = np.sign(SPEED)
SHAPES = {
    "level, viscous, offset": SIGN,
    "smooth level, viscous, offset": np.tanh(SPEED / 0.2),
    "level, drop, viscous, offset": SIGN * (1.0 + 0.6 * np.exp(-((SPEED / 0.15) ** 2))),
}
# of public logs of a Franka (joint 4 of NNFM, "Comparative data"), where they are kept
LOGS = Path(os.environ.get("NNFM", ""))


def pairs(model, seed=0, noise=0.1):
    """Torques of a joint with a level of 0.3 N m, 0.25 N m s/rad and 0.1 N m."""
    random = np.random.default_rng(seed)
    return 0.3 * SHAPES[model] + 0.25 * SPEED + 0.1 + noise * random.standard_normal(len(T))


@pytest.mark.slow
def test_level_and_offset_are_within_two_standard_errors_in_90_of_100():
    model = "level, viscous, offset"
    within = dict.fromkeys(("level", "offset", "viscous"), 0)
    for seed in range(100):
        best = smc.identify_friction(SPEED, pairs(model, seed)).fits[model]
        for name, true in (("level", 0.3), ("offset", 0.1), ("viscous", 0.25)):
            within[name] += abs(best.numbers[name] - true) <= 2.0 * best.errors[name]
    assert min(within.values()) >= 90
    assert max(within.values()) < 100  # errors that are too large would tell nothing


@pytest.mark.slow
def test_neighbours_that_depend_on_each_other_count_once():
    """Noise that keeps its value for 50 pairs."""
    model = "level, viscous, offset"
    outside = 0
    for seed in range(40):
        random = np.random.default_rng(seed)
        slow = np.repeat(0.1 * random.standard_normal(len(T) // 50), 50)
        fit = smc.identify_friction(SPEED, pairs(model, noise=0.0) + slow).fits[model]
        outside += abs(fit.numbers["offset"] - 0.1) > 2.0 * fit.errors["offset"]
    assert outside <= 6


@pytest.mark.parametrize("model", SHAPES)
def test_the_model_that_made_the_pairs_is_taken_and_its_part_is_they(model):
    fits = smc.identify_friction(SPEED, pairs(model, noise=0.01))
    assert fits.best.model == model
    assert fits.best.rms == pytest.approx(0.01, rel=0.05)
    assert fits.best.held_out == pytest.approx(0.01, rel=0.05)
    part = fits.part
    p = SimpleNamespace(**dict(zip(part.names, part.parameters(0), strict=True)))
    force = [part.value(v, 0.0, 0.0, p)[0] for v in SPEED[1::97]]
    np.testing.assert_allclose(force, pairs(model, noise=0.0)[1::97], atol=0.02)
    for name, true in (("drop", 0.18), ("stribeck", 0.15), ("width", 0.2)):
        if name in fits.best.numbers:
            error = fits.best.errors[name]
            assert fits.best.numbers[name] == pytest.approx(true, abs=3.0 * error)
            assert error < 0.1 * true
    assert smc.run(smc.Scenario(plant="duffing", law="none", friction=part)).failure is None


def test_held_out_is_of_the_other_log_by_the_numbers_of_this():
    model = "level, viscous, offset"
    second_log = SPEED, pairs(model, noise=0.0) + 0.2
    friction = smc.identify_friction(SPEED, pairs(model, noise=0.0), second_log)
    fit = friction.fits[model]
    assert fit.rms < 1e-9
    assert fit.held_out == pytest.approx(0.2)
    assert "offset of the pairs held out differs by +0.2 N m" in str(friction)


def test_a_held_out_log_that_differs_by_more_than_its_offset_has_no_such_sentence():
    model = "level, viscous, offset"
    for torques in (pairs(model), 1.5 * pairs(model), pairs(model) + 0.001):
        assert "offset of" not in str(smc.identify_friction(SPEED, pairs(model), (SPEED, torques)))


def test_what_would_be_negative_is_0_and_told():
    friction = smc.identify_friction(SPEED, 0.3 * SIGN - 0.05 * SPEED)
    fit = friction.fits["level, viscous, offset"]
    assert fit.numbers["viscous"] == 0.0
    assert fit.at_zero == ("viscous",)
    taken = smc.identify_friction(SPEED, 0.3 * SIGN - 0.05 * SPEED + 0.5)
    assert "viscous would be negative, and is 0" in str(taken)


def test_pairs_without_friction_are_told(refused):
    random = np.random.default_rng(0)
    friction = smc.identify_friction(SPEED, random.standard_normal(len(T)))
    assert friction.best.r2 < 0.5
    assert "no friction in it" in str(friction)
    assert "explains nothing of the variation" in str(friction)
    refused(lambda: friction.part, "no friction in it", "gravity")


@pytest.mark.quick
@pytest.mark.parametrize(
    ("speed", "torque", "words"),
    [
        (SPEED, SPEED[:-1], "one number of each"),
        (["a"] * 200, [1.0] * 200, "one number of each"),
        (np.where(T > 19.0, np.nan, SPEED), SPEED, "not finite"),
        (SPEED[:50], SPEED[:50], "of the pairs move: give 100"),
        (np.zeros(500), np.ones(500), "0 of the pairs move"),
        (np.abs(SPEED) + 0.1, SPEED, "speeds of one sign"),
    ],
)
def test_pairs_that_tell_nothing_are_refused(speed, torque, words, refused):
    refused(lambda: smc.identify_friction(speed, torque), words)


def test_the_error_of_the_curve_is_that_of_its_numbers():
    """By hand for a level and viscous friction: v' C v with v = (sign, speed)."""
    fit = smc.identify_friction(SPEED, pairs("level, viscous, offset")).fits["level, viscous"]
    level, viscous = fit.numbers["level"], fit.numbers["viscous"]
    v = np.array([-2.0, 0.5])
    np.testing.assert_allclose(fit.force(v), level * np.sign(v) + viscous * v)
    of_level, of_pair, of_viscous = fit.covariance[0, 0], fit.covariance[0, 1], fit.covariance[1, 1]
    variance = of_level + 2.0 * of_pair * np.abs(v) + of_viscous * v**2
    np.testing.assert_allclose(fit.force_error(v), np.sqrt(variance))
    np.testing.assert_allclose(np.sqrt(np.diag(fit.covariance)), list(fit.errors.values()))


def test_the_command_says_what_the_function_says_and_writes_a_figure_and_a_condition(tmp_path):
    torque = pairs("level, drop, viscous, offset", noise=0.01)
    table = np.column_stack([SPEED, torque])[::5]
    file = tmp_path / "pairs.csv"
    np.savetxt(file, table, delimiter=",", header="dq,tau", comments="")
    friction = smc.identify_friction(*table.T)
    columns = ["identify", "--pairs", str(file), "--columns", "speed=dq,torque=tau"]
    written = ["--figure", str(tmp_path / "friction"), "--out", str(tmp_path / "found.txt")]
    done = CliRunner().invoke(app, [*columns, *written])
    assert done.exit_code == 0, done.output
    assert done.output.startswith(f"{friction}\n")
    assert (tmp_path / "friction.png").stat().st_size > 10_000
    (read,) = from_file(tmp_path / "found.txt")
    assert isinstance(read.fields, dict)
    assert read.fields["friction"].static == pytest.approx(friction.part.static, rel=1e-6)
    for words_typed, words in (
        (columns[:3], "no column speed (it has dq, tau)"),
        ([*columns, "--for", "m"], "leave out the machine"),
        (["identify"], "needs a machine and its logs"),
    ):
        wrong = CliRunner().invoke(app, words_typed)
        assert wrong.exit_code == 2
        assert words in " ".join(wrong.output.split())


@pytest.mark.skipif(not (LOGS / "case4_slow.csv").is_file(), reason="NNFM=FOLDER has public logs")
def test_a_franka_s_joint_4_is_foretold_from_slow_to_middle():
    logs = []
    for name in ("slow", "middle"):
        log = np.genfromtxt(LOGS / f"case4_{name}.csv", delimiter=",", names=True)
        logs.append((log["dq7"], log["q7_tau_J_compensate"]))
    slow, middle = logs
    assert smc.identify_friction(*slow, held_out=middle).best.held_out <= 0.07
