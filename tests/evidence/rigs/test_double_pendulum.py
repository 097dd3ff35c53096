"""Torques of RealAIGym's double pendulum, from its motion: of simulated runs, and of the public
sys-id records.
"""

import numpy as np
import pytest

import smc_mujoco as smc

RIG = smc.rig("realaigym_acrobot")


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
