"""Torques of RealAIGym's double pendulum, from its motion: of simulated runs, and of the public
sys-id records.
"""

import re
from pathlib import Path

import numpy as np
import pytest
from helpers.pages import ROOT

import smc_mujoco as smc

DATA = Path(smc.__file__).resolve().parents[2] / "shared" / "rigs"
RIG = smc.rig("realaigym_acrobot")
TRAIN = "C1-sysid-03", "C1-sysid-13"
UNUSED = (
    "C1-sysid-01",
    "C1-sysid-05",
    "C1-sysid-07",
    "acrobot-ilqr_tvlqr_lqr-01",
    "pendubot-ilqr_tvlqr_lqr-01",
)


def rms(rig, record):
    """Residual of the torques of both joints, N m."""
    return np.sqrt(np.mean(apart(rig, record) ** 2))


def apart(rig, record):
    """Predicted minus measured torque of both joints, N m, (2, N)."""
    ((predicted, measured, _),) = rig.predictions([record])
    return np.array([predicted[name] - measured[name] for name in RIG.columns.torque])


@pytest.fixture(scope="module")
def swung():
    """4 s of the acrobot without friction under a torque at its elbow, as a record."""
    rig = RIG.set("model_1_1")
    trace = smc.run(
        rig.scenario(
            "none",
            feedforward=smc.Sine(1.0, 6.0),
            duration=4.0,
            sensor=None,
            x0=(0.3, 0.2),
        )
    )
    x, v = trace.x[:, ::-1], trace.v[:, ::-1]  # shoulder, elbow
    record = {
        "time": trace.t,
        "tau_meas1": np.zeros(len(trace.t)),
        "tau_meas2": trace.u[:, 0],
    }
    for i in range(2):
        record |= {f"pos_meas{i + 1}": x[:, i], f"vel_meas{i + 1}": v[:, i]}
    return rig, record


def test_torques_of_a_simulated_run_are_the_commands(swung):
    rig, record = swung
    assert rms(rig, record) < 0.02
    assert rms(rig.with_values({"I2": 0.06}), record) > 0.05


def test_noise_of_the_encoders_does_not_make_a_link_lighter(swung):
    """Noise of an acceleration must not count as motion that takes a torque: least squares would
    shrink the inertia.
    """
    rig, record = swung
    rng = np.random.default_rng(1)
    noisy = record | {
        f"pos_meas{i}": record[f"pos_meas{i}"] + rng.normal(0.0, 1e-3, 2001) for i in (1, 2)
    }
    identified = smc.identify(rig, noisy, ("r2", "I2"), starts=1)
    assert identified.values["I2"] == pytest.approx(rig.values["I2"], rel=0.05)


@pytest.mark.quick
def test_the_published_dry_friction_is_what_its_arctangent_reaches():
    reached = np.arctan(100.0 * 20.0)  # at 20 rad/s
    published = {
        "1_0": (0.16, 0.12),
        "2_0": (0.1747, 0.11),
        "3_0": (0.033, 0.035),
    }
    for model, frictions in published.items():
        values = RIG.set(f"model_{model}").values
        for name, cf in zip(("cf1", "cf2"), frictions, strict=True):
            assert values[name] == pytest.approx(cf * reached, rel=1e-3)


@pytest.fixture(scope="module")
def known():
    if not DATA.exists():
        pytest.skip("the public records are not at hand")
    return {name: dict(np.load(DATA / f"double_pendulum-{name}.npz")) for name in TRAIN + UNUSED}


@pytest.mark.parametrize("name", UNUSED)
def test_the_twin_predicts_unused_torques_better_than_the_published_model(known, name):
    assert rms(RIG, known[name]) < rms(RIG.set("model_1_0"), known[name])


def test_torques_of_unused_records_are_as_far_off_as_the_page_tells(known):
    text = (ROOT / "docs" / "rigs.md").read_text(encoding="utf-8")
    reported = np.array(re.findall(r"(\.\d{3}) / (\.\d{3})", text), float).reshape(2, 3, 2)
    for rig, rows in zip((RIG, RIG.set("model_1_0")), reported, strict=True):
        for name, row in zip(UNUSED[:3], rows, strict=True):
            errors = np.sqrt(np.mean(apart(rig, known[name]) ** 2, axis=1))
            np.testing.assert_allclose(errors, row, rtol=0.0, atol=6e-4)


@pytest.mark.slow
def test_the_numbers_are_those_that_the_records_give(known):
    identified = smc.identify(RIG, [known[name] for name in TRAIN], starts=1, most=3)
    for name in ("r1", "r2", "I1", "I2", "cf1", "cf2"):
        assert identified.values[name] == pytest.approx(RIG.values[name], rel=0.01)
