"""What residuals show of what a model lacks: on linear models by hand, and on a log of a machine
that has a friction of another shape.
"""

import numpy as np
import pytest
from helpers.machine_logs import chain, log, sines

import smc_mujoco as smc
from smc_mujoco.identification.lack_of_fit import Lack, lack_of_fit
from smc_mujoco.identification.replays import Point, Slopes


def lacking(size, one_sided=False):
    """Return what is found of y = 0.5 a + size b + noise, of which the model has a alone, and b."""
    rng = np.random.default_rng(3)
    a, b, noise = rng.standard_normal((3, 4, 200))
    b = b + a  # so that a absorbs a part
    residuals = [size * row + 1e-2 * part for row, part in zip(b, noise, strict=True)]
    J = np.concatenate(a)[:, None]
    absorbed = np.linalg.lstsq(J, np.concatenate(residuals), rcond=None)[0]
    residuals = [r - x * absorbed[0] for r, x in zip(residuals, a, strict=True)]
    slopes = Slopes(
        Point(np.zeros(1), np.zeros((4, 0))),
        residuals,
        [x[:, None] for x in a],
        [np.zeros((200, 0)) for _ in a],
        1,
        1,
    )
    return lack_of_fit(slopes, [Lack("b", list(b), one_sided)]), absorbed[0]


@pytest.mark.quick
def test_a_lack_moves_a_number_by_what_the_number_has_absorbed():
    fit, absorbed = lacking(0.05)
    assert fit.told(np.full(1, 1e-3)) == ("b",)
    assert fit.moved[0] == pytest.approx(abs(absorbed), rel=0.05)
    assert fit.slopes.by_values[0].shape == (200, 2)


def test_noise_alone_shows_no_lack_and_changes_nothing():
    fit, _ = lacking(0.0)
    assert not fit.taken
    assert fit.moved.tolist() == [0.0]
    assert fit.slopes.by_values[0].shape == (200, 1)


def test_a_lack_that_only_adds_is_not_taken_with_the_other_sign():
    assert not lacking(0.05, one_sided=True)[0].taken
    assert lacking(-0.05, one_sided=True)[0].taken


@pytest.mark.slow
def test_levels_that_differ_between_directions_are_told_and_in_the_errors():
    """Another level in each direction: without its offset, numbers are several plain errors off."""
    truth = {"j1.damping": 0.3, "j1.frictionloss": 0.4, "j1.armature": 0.02, "input_delay": 0.004}
    motion = sines([0.0], [0.5, 0.3, 0.15], [0.4, 1.1, 2.7])
    arm = smc.plant_from(chain([0.4], [1.0]), ["j1"])
    run = log(chain([0.4], [1.0]), truth | {"j1.offset": 0.04}, motion, 20.0, 1.5, duration=3.0)
    identified = smc.identify(arm, run, list(truth))
    assert any("find j1.offset" in note for note in identified.notes)
    for name, true in truth.items():
        assert abs(identified.values[name] - true) < 2.0 * identified.errors[name], name
