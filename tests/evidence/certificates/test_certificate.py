"""What a certificate says of typed theorems, and draws of them."""

import numpy as np
import pytest
from helpers.certificates import LEVELS, certificate, part
from scipy.interpolate import RegularGridInterpolator

import smc_mujoco as smc
from smc_mujoco.evidence.certificates.certificate import Certificate

REACHED = part("reaching", {"reaching": 0.3, "actuator": 1.0}, X=1.25, S=0.5)
GLOBAL = part(
    "saturated PD",
    {
        "damping": 0.5,
        "restoring": 0.2,
        "actuator": 0.0,
        "local": 1.0,
    },
)
SAID = {
    "fails and falls": certificate(),
    "without d": certificate("inverted_pendulum", parts=[GLOBAL], disturbance=0.0),
    "every condition fails": certificate(
        "pendulum_network",
        parts=[
            part(
                "saturated PD",
                {
                    "damping": -1.0,
                    "restoring": -2.0,
                    "actuator": -3.0,
                    "coupling": -4.0,
                },
            ),
            part("reaching", {"reaching": -6.0, "actuator": 0.0}, X=0.0, S=0.0),
        ],
    ),
    "a switching law": certificate(
        "inverted_pendulum",
        "classical",
        {"k": 3.0, "c": 2.0},
        [
            part("saturated PD", {"damping": 0.5}),
            REACHED,
            part("level sets", {"start": -0.1}, **LEVELS),
        ],
    ),
    "nothing under a disturbance": certificate(parts=[part("saturated PD", {"damping": 0.5})]),
}


# theorem, holds, stable, bound, slope of s; whether each theorem is proven, and the ranges
FACTS = {
    "fails and falls": ("level sets", True, False, 0.3, 3.0, [False, True], [0.666, 0.3]),
    "without d": ("saturated PD", True, True, 0.0, 3.0, [True], []),
    "every condition fails": ("saturated PD", False, False, None, 3.0, [False] * 2, []),
    "a switching law": (
        "saturated PD",
        False,
        True,
        None,
        2.0,
        [True, True, True],  # but not from the scenario's start
        [1.25, 0.5, 0.999, 0.0],
    ),
    "nothing under a disturbance": ("saturated PD", False, True, None, 3.0, [True], []),
}


@pytest.mark.parametrize("name", SAID)
def test_a_certificate_says_what_its_theorems_say(name):
    made, (*facts, proven, ranges) = SAID[name], FACTS[name]
    assert [made.theorem, made.holds, made.stable, made.bound, made.surface] == facts
    reported = []
    for sentence in made.sentences:
        reported.append(sentence.startswith("proven by"))
    assert reported[: len(proven)] == proven
    assert [value for _, _, value, _ in made.ranges] == pytest.approx(ranges, abs=1e-3)
    assert ("nothing is proven under |d| <= 2 N" in made.sentences) == name.startswith("nothing")
    assert "sampling" in made.sentences[-1]
    assert [one.holds for one in made.conditions] == [one.margin >= 0.0 for one in made.conditions]


def test_units_of_margins_follow_from_those_of_the_plant():
    units = {}
    for one in SAID["every condition fails"].conditions:
        units[one.name] = one.unit
    assert units["damping"] == "N m s/rad"
    assert units["coupling"] == "N m/rad"


def test_w_is_bilinear_odd_states_alike_and_1_outside():
    made = SAID["fails and falls"]
    grid = RegularGridInterpolator((LEVELS["x"], LEVELS["s"]), LEVELS["W"])
    x, s = np.random.default_rng(4).uniform(-2.2, 2.2, (2, 400))
    v = s - made.surface * x
    within = (np.abs(x) < 2.0) & (np.abs(s) < 2.0)
    sign = np.where(x[within] < 0.0, -1.0, 1.0)
    expected = np.ones_like(x)
    expected[within] = grid(np.column_stack([sign * x[within], sign * s[within]]))
    np.testing.assert_allclose(made.level(x, v), expected, atol=1e-12)
    np.testing.assert_array_equal(made.contains(x, v), expected <= LEVELS["outer"])


def test_the_set_of_a_switching_law_is_a_strip_and_of_a_stable_loop_everything():
    x, s = np.random.default_rng(5).uniform(-1.5, 1.5, (2, 400))
    box = certificate("inverted_pendulum", "classical", {"k": 3.0, "c": 2.0}, [REACHED])
    np.testing.assert_array_equal(
        box.contains(x, s - 2.0 * x), (np.abs(x) <= 1.25) & (np.abs(s) <= 0.5)
    )
    assert SAID["without d"].contains(x, s).all()
    with pytest.raises(smc.ScenarioError, match="classical on inverted_pendulum has no level sets"):
        box.level(x, s)


def test_a_file_that_is_no_certificate_is_refused(tmp_path):
    SAID["without d"].save(tmp_path / "a.json")
    assert Certificate.load(tmp_path / "a.json").data == SAID["without d"].data
    (tmp_path / "b.json").write_text('{"parts": 3}')
    with pytest.raises(smc.ScenarioError, match="is not a certificate"):
        Certificate.load(tmp_path / "b.json")
