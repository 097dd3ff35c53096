"""A Feedforward in C: a law written with it gives the bits of the run that has it."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exchange.helpers.compiler import needs_compiler
from helpers import arms

import smc_mujoco as smc
from smc_mujoco.control.law import Measurement
from smc_mujoco.hardware import LuGre, ServoFriction, Sigmoid, Stribeck

pytestmark = needs_compiler

REFERENCE = smc.Sine(0.2, 3.0)
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wmissing-prototypes")
# each kind that has a force at a steady speed, one at most that holds a joint
RUBS = {
    "stribeck": (
        smc.Coulomb(0.02),
        smc.Viscous(0.03),
        Stribeck(0.01, 0.03, 0.2, viscous=0.02, offset=-0.005),
    ),
    "smooth": Stribeck(0.01, width=0.1),
    "lugre": LuGre(0.01, 0.03, stribeck=0.5),
    "servo": ServoFriction(kc=0.01, kcs=0.02, vs=0.5, alpha=1.5, kv=0.04),
    "sigmoid": Sigmoid(0.04, 5.0),
}
WAYS = [("stribeck", "reference"), ("stribeck", "error"), *((name, "speed") for name in RUBS)]


def scenario(feedforward: smc.Feedforward, **more) -> smc.Scenario:
    fields = {
        "plant": "duffing",
        "law": smc.law("super_twisting", k1=3.0),
        "reference": REFERENCE,
        "noise": smc.Noise(0.003, 0.02),
        "duration": 0.3,
        "v0": 0.3,
    }
    return smc.Scenario(feedforward=feedforward, **fields | more)


def both(scenario: smc.Scenario, path: Path) -> tuple[smc.Trace, smc.Trace]:
    """The trace of a scenario whose Feedforward is right, and that of its law with it in C."""
    path.write_text(smc.exchange.law_to_c(scenario))
    law = smc.exchange.law_from_c(path, flags=STRICT, timeout=60.0)
    right = dataclasses.replace(scenario.feedforward, error=0.0)
    theirs, ours = smc.run(
        [
            dataclasses.replace(scenario, feedforward=right),
            dataclasses.replace(scenario, law=law, feedforward=None),
        ]
    )
    for field in ("x", "v", "u", "s"):
        np.testing.assert_array_equal(getattr(ours, field), getattr(theirs, field))
    assert ours.failure is None
    assert len(np.unique(theirs.compensation)) > 100
    return theirs, ours


@pytest.mark.parametrize(("rubs", "on"), WAYS)
def test_u_has_the_bits_of_the_run_whose_feedforward_is_right(tmp_path, rubs, on):
    """Of a drive whose u is no force, too. The function that gives it alone gives its bits."""
    eps = 2.0 if on == "error" else 0.01
    wrong = smc.Feedforward(RUBS[rubs], on=on, eps=eps, error=0.3)
    theirs, ours = both(scenario(wrong, actuator=smc.DCMotor(gear=5.0)), tmp_path / "law.c")
    if on == "reference":
        library: Any = getattr(ours.scenario.law.function, "library", None)
        assert theirs.compensation is not None
        added = np.zeros(len(theirs.t))
        for k, t in enumerate(theirs.t):
            y = dict.fromkeys(Measurement._fields, 0.0)
            y |= {"t": t, "dr": smc.Sine.value(t, REFERENCE)[1]}
            library.smc_compensation(np.array([*y.values()]).ctypes, added[k:].ctypes)
        np.testing.assert_array_equal(added, theirs.compensation[:, 0])


@pytest.mark.parametrize("on", ["reference", "speed", "error"])
def test_of_many_joints_each_has_its_own(tmp_path, on):
    rubs = {"turn": Stribeck(0.1, 0.3, 0.2), "reach": (smc.Coulomb(0.2), smc.Viscous(0.3))}
    arm = scenario(
        smc.Feedforward(rubs, on=on, error=-0.3),
        plant=arms.arm(),
        law=smc.law("unit_vector"),
        model="nominal",
        v0=0.1,
        u_max=50.0,
    )
    theirs, _ = both(arm, tmp_path / "law.c")
    assert (theirs.compensation != 0.0).any(axis=0).tolist() == [True, True, False]


@smc.hardware.friction_function(numbers={"level": 0.3})
def own(y, p, memory):
    return p.level


@pytest.mark.quick
@pytest.mark.parametrize(
    ("feedforward", "more", "words"),
    [
        (smc.Feedforward(own()), {}, "'super_twisting' with the scenario's Feedforward cannot be"),
        (
            smc.Feedforward({"p4/hinge": smc.Coulomb(0.1)}),
            {"plant": "pendulum_network"},
            "Feedforward differs between its channels",
        ),
    ],
)
def test_what_cannot_be_written_is_refused(feedforward, more, words):
    with pytest.raises(smc.ScenarioError, match=words):
        smc.exchange.law_to_c(scenario(feedforward, **more))


def test_words_of_16_bits_have_none():
    compensated = scenario(smc.Feedforward(smc.Coulomb(0.1)), law=smc.law("observer_free"))
    with pytest.raises(smc.ScenarioError, match="Feedforward is not written in words"):
        smc.exchange.law_to_c(compensated, "q15")
