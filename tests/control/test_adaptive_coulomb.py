"""The adapting Coulomb level finds the friction of a joint that follows its reference, and errs no
more than its theorem says.
"""

import math

import numpy as np
import pytest
from helpers.plants_ab import called, measured

import smc_mujoco as smc

pytestmark = pytest.mark.quick

H = 1e-3  # s
OMEGA = 0.5  # rad/s, slow: M r'' is small


def followed(friction, M=1.0, duration=60.0, **gains):
    """e and F of a joint that slides as its reference does: M e'' = u - F0 sgn(r') - M r''."""
    law = smc.law("adaptive_coulomb", **({"kp": 20.0, "kd": 8.0, "gamma": 2.0, "v0": 1e-3} | gains))
    memory = np.zeros(law.memory)
    e, de = 0.05, 0.0
    errors, levels = [], []
    for t in np.arange(0.0, duration, H):
        dr = OMEGA * math.cos(OMEGA * t)
        u, _ = called(law, measured(e=e, de=de, dr=dr, dt=H, limit=10.0), memory)
        acceleration = (u - friction * np.sign(dr)) / M + OMEGA**2 * math.sin(OMEGA * t)
        de += H * acceleration
        e += H * de
        errors.append(e)
        levels.append(memory[0])
    return np.array(errors), np.array(levels)


@pytest.mark.parametrize("friction", [0.0, pytest.param(0.6, marks=pytest.mark.slow), 1.8])
def test_the_level_goes_to_the_friction_and_the_error_goes(friction):
    errors, levels = followed(friction)
    late = slice(-int(2 * math.pi / OMEGA / H), None)
    assert levels[late].mean() == pytest.approx(friction, abs=0.15)
    if friction:
        without, still = followed(friction, gamma=0.0)
        assert not still.any()
        assert np.abs(errors[late]).max() < 0.5 * np.abs(without[late]).max()


def test_the_level_is_no_less_than_0_and_no_more_than_the_bound_on_u():
    law = smc.law("adaptive_coulomb", gamma=1e6)
    memory = np.zeros(law.memory)
    called(law, measured(e=1.0, dr=1.0, limit=6.0), memory)
    assert memory[0] == 0.0
    called(law, measured(e=-1.0, dr=1.0, limit=6.0), memory)
    assert memory[0] == 6.0


def test_from_friction_to_s_the_error_is_positive_real_where_the_docstring_says():
    w = np.logspace(-3, 3, 400)
    for M, kp, kd in ((1.0, 16.0, 4.0), (1.0, 16.0, 3.9), (0.2, 100.0, 4.5), (0.2, 100.0, 4.4)):
        p = 1j * w
        real = ((kd * p + kp) / (M * p * p + kd * p + kp)).real
        assert (real.min() >= 0.0) == (kd * kd >= M * kp)
