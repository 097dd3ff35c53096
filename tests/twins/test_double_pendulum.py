"""Torques of RealAIGym's double pendulum, from its motion: of simulated runs, and of the public sys-id records."""

from pathlib import Path

import numpy as np
import pytest

import smc_mujoco as smc

DATA = Path(smc.__file__).resolve().parents[2] / "shared" / "rigs"
RIG = smc.rig("realaigym_acrobot")
TRAIN, UNUSED = ("01", "03"), ("05", "07", "13")


def rms(rig, record):
    """Residual of the torques of both joints, N m."""
    predicted, measured = rig.torques(record), rig.measured_torques(record)
    return np.sqrt(np.mean([(predicted[name] - measured[name]) ** 2 for name in predicted]))


@pytest.fixture(scope="module")
def swung():
    """4 s of the acrobot without friction under a torque at its elbow, as a record."""
    rig = RIG.set("model_1_1")
    trace = smc.run(rig.scenario("none", feedforward=smc.Sine(1.0, 6.0), duration=4.0, sensor=None, x0=(0.3, 0.2)))
    x, v = trace.x[:, ::-1], trace.v[:, ::-1]  # shoulder, elbow
    record = {"time": trace.t, "tau_meas1": np.zeros(len(trace.t)), "tau_meas2": trace.u[:, 0]}
    for i in range(2):
        record |= {f"pos_meas{i + 1}": x[:, i], f"vel_meas{i + 1}": v[:, i]}
    return rig, record


def test_torques_of_a_simulated_run_are_the_commands(swung):
    rig, record = swung
    assert rms(rig, record) < 0.02
    assert rms(rig.with_values({"I2": 0.06}), record) > 0.05


def test_a_simulated_run_gives_its_moments_back(swung):
    rig, record = swung
    found = smc.identify(rig.with_values({"r2": 0.2, "I2": 0.06}), record, ("r2", "I2"), starts=1)
    assert found.values["r2"] == pytest.approx(rig.values["r2"], rel=0.02)
    assert found.values["I2"] == pytest.approx(rig.values["I2"], rel=0.02)
    assert min(found.fits[0][name] for name in ("tau_meas2",)) > 90.0


@pytest.mark.skipif(not DATA.exists(), reason="the public records are not at hand")
def test_an_identified_twin_predicts_unused_torques_better_than_the_published_model():
    known = {name: dict(np.load(DATA / f"double_pendulum-C1-sysid-{name}.npz")) for name in TRAIN + UNUSED}
    found = smc.identify(RIG, [known[name] for name in TRAIN], starts=1, most=6)
    for name in UNUSED:
        assert rms(found.rig, known[name]) <= rms(RIG, known[name])
