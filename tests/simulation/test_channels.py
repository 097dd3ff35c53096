"""A separate law, gains, bound and reference for each channel: both loops, files, keys, and bad
input.
"""

import dataclasses
import pickle

import numpy as np
import pytest
from helpers import arms, reference
from helpers.runs import ARRAYS, assert_same

import smc_mujoco as smc
from smc_mujoco.mechanisms.custom.scales import needs
from smc_mujoco.simulation import run_key

SINE = smc.Sine(0.3, 4.0)
MOVE = smc.signals.MinimumJerk(0.4, 0.01, 0.03)
REST = smc.Constant(0.0)
PENDULUM = """
<mujoco><worldbody><body><joint name="shoulder" axis="0 1 0"/>
  <geom type="sphere" size="0.1" pos="0 0 -1" mass="1"/>
  <body pos="0 0 -1"><joint name="elbow" axis="0 1 0"/>
    <geom type="sphere" size="0.1" pos="0 0 -1" mass="1"/></body>
</body></worldbody></mujoco>
"""
COMMON = {
    "duration": 0.05,
    "noise": smc.Noise(1e-3, 1e-2),
}
BOTH = {"plant": "double_pendulum"} | COMMON


@smc.law_function(gains={"k": 2.0}, memory=5)
def remembers(y, gains, memory):
    memory[4] += y.dt * y.e
    return -gains.k * y.e - memory[4] + 0.01 * y.limit, y.e


def cases():
    """Scenarios in which channels differ in one respect or in all."""
    mixed = {"shoulder": smc.law("super_twisting", k1=5.0), "elbow": remembers(k=3.0)}
    yield smc.Scenario(
        law=mixed,
        u_max={"elbow": 2.0, "shoulder": 5.0},
        reference=[SINE, MOVE],
        **BOTH,
    )
    yield smc.Scenario(law=["twisting", "super_twisting"], model="nominal", **BOTH)
    yield smc.Scenario(law=smc.law("classical", k=[1.0, 5.0]), surface="pid", **BOTH)
    yield smc.Scenario(law=remembers(k=[1.0, 5.0]), **BOTH)  # each channel its own memory
    yield smc.Scenario(
        law=remembers,
        reference={"shoulder": MOVE, "elbow": SINE},
        feedforward=SINE,
        **BOTH,
    )
    yield smc.Scenario(
        plant=arms.arm(),
        law="passivity_based",
        reference=[SINE, MOVE, SINE],
        u_max=[5.0, 50.0, 20.0],
        **COMMON,
    )
    cart = {
        "plant": smc.plant("pendulum_network", n=3),
        "law": ["classical", remembers, "twisting"],
    }
    yield smc.Scenario(
        reference=[SINE, SINE, MOVE],
        input_delay=3e-3,
        **cart,
        **COMMON,
    )


@pytest.fixture(scope="module")
def traces():
    scenarios = list(cases())
    return smc.run(scenarios)


def test_callback_equals_plain_loop_where_channels_differ(traces):
    for trace in traces:
        assert trace.failure is None
        assert_same(trace, reference.run(trace.scenario))


@pytest.mark.quick
def test_files_and_keys_hold_what_each_channel_has(traces, tmp_path):
    keys = set()
    for i, trace in enumerate(traces):
        if any(law.function is remembers.function for law in trace.scenario.law.parts):
            continue  # a test's law is not found again
        loaded = smc.load(trace.save(tmp_path / f"{i}.npz")).scenario
        assert loaded == trace.scenario
        assert run_key.run_key(loaded) == run_key.run_key(trace.scenario)
        keys.add(run_key.run_key(trace.scenario))
    assert len(keys) == 3


def test_each_channel_runs_as_it_would_under_its_law_alone():
    """On uncoupled pendulums a channel's run is that of a scenario in which all have its law, gains
    and reference.
    """
    plant = smc.plant("pendulum_network", n=3, kc=0.0)
    laws = [smc.law("classical", k=2.0), smc.law("twisting"), smc.law("super_twisting", k2=3.0)]
    signals = [SINE, MOVE, smc.Constant(0.1)]
    bounds = [1.0, 2.0, 3.0]
    together = smc.run(
        smc.Scenario(
            plant=plant,
            law=laws,
            reference=signals,
            u_max=bounds,
            duration=0.2,
        )
    )
    for i, (law, signal, bound) in enumerate(zip(laws, signals, bounds, strict=True)):
        alone = smc.run(
            smc.Scenario(
                plant=plant,
                law=law,
                reference=signal,
                u_max=bound,
                duration=0.2,
            )
        )
        for name in set(ARRAYS) - {"t"}:
            in_company = getattr(together, name)[:, i]
            by_itself = getattr(alone, name)[:, i]
            # MuJoCo solves for all at once
            np.testing.assert_allclose(in_company, by_itself, rtol=1e-12, atol=1e-13, err_msg=name)
    assert np.abs(together.u).max(axis=0).tolist() == bounds


def test_a_plants_channels_suggest_what_a_scenario_leaves_out():
    channels = {
        "shoulder": smc.Channel(
            motor=True,
            law=smc.law("classical", k=5.0),
            u_max=8.0,
            reference=SINE,
        ),
        "elbow": {"motor": True, "law": "twisting", "reference": None},
    }
    plant = smc.plant_from(PENDULUM, channels=channels, name="suggesting")
    suggested = smc.Scenario(plant=plant, **COMMON)
    same = {
        "law": [smc.law("classical", k=5.0), "twisting"],
        "u_max": [8.0, needs(plant)[1]],
        "reference": [SINE, REST],
    }
    assert suggested == smc.Scenario(plant=plant, **same, **COMMON)
    assert suggested.limits == (8.0, needs(plant)[1])
    assert_same(smc.run(suggested), reference.run(suggested))
    overriding = {
        "law": smc.law("classical", k=1.0),
        "u_max": 2.0,
        "reference": MOVE,
    }
    overridden = smc.Scenario(plant=plant, **overriding, **COMMON)
    assert (overridden.law, overridden.u_max, overridden.reference) == tuple(overriding.values())
    plain = smc.plant_from(
        PENDULUM, channels={j: smc.Channel(motor=True) for j in channels}, name="suggesting"
    )
    assert plant == plain  # the same mechanism
    assert smc.Scenario(plant=plain, **overriding, **COMMON) == overridden
    assert pickle.loads(pickle.dumps(suggested)) == suggested
    assert suggested.reference is None
    assert suggested.references == (SINE, REST)
    # a default follows the plant
    assert dataclasses.replace(suggested, plant=plain).references == (
        REST,
        REST,
    )


REFUSED = {
    "law is None": lambda: smc.Scenario(**BOTH),
    "'elbow'": lambda: smc.plant_from(
        PENDULUM,
        channels={"shoulder": smc.Channel(motor=True, law="classical"), "elbow": {"motor": True}},
    ),
    "'elbo'": lambda: smc.Scenario(law={"shoulder": "classical", "elbo": "classical"}, **BOTH),
    "joint 'elbow'": lambda: smc.Scenario(
        law=smc.law("classical"), u_max={"shoulder": 2.0}, **BOTH
    ),
    "unit_vector": lambda: smc.Scenario(law=["classical", "unit_vector"], **BOTH),
    "relative degree": lambda: smc.Scenario(law=["classical", "twisting"], surface="pid", **BOTH),
}


def test_bad_input_is_one_sentence(refused):
    for word, make in REFUSED.items():
        refused(make, word)
