"""The engine of the live page, in node: its traces are those of `smc.run`, under every condition that it offers."""

import numpy as np
import pytest
from helpers.live import farthest, packages, scenario, traces

import smc_mujoco as smc

SECONDS = 5.0
# What is chosen, and the largest difference in x, v, u and s over the run. Wanted: 1e-6. Found: below 1e-11.
CASES = {
    "a law with memory, saturated": {"plant": "inverted_pendulum", "law": "pid", "u_max": 2.0, "control_period": 0.005},
    "hold and reference": {"plant": "duffing", "law": "observer_free", "control_period": 0.01, "reference": 0.2},
    "delay and mass": {"plant": "van_der_pol", "law": "observer_free", "input_delay": 0.005, "mass": 1.3},
    "delay below a period": {
        "plant": "duffing", "law": "observer_free", "control_period": 0.01, "input_delay": 0.003, "friction": 0.05,
    },
    "noise": {
        "plant": "inverted_pendulum", "law": "observer_free", "noise": {"position": 0.01, "velocity": 0.05}, "seed": 3,
    },
    "a sine at every stage": {
        "plant": "duffing", "law": "boundary_layer", "disturbance": {"amplitude": 0.5, "omega": 5.0},
    },
    "friction": {"plant": "inverted_pendulum", "law": "observer_free", "friction": 0.2, "mass": 1.5, "x0": [0.3]},
    "the nominal equation": {"plant": "van_der_pol", "law": "lqr", "model": "nominal", "mass": 1.2},
    "a free joint": {"plant": "cart_pole", "law": "hierarchical"},
    "a surface": {
        "plant": "duffing", "law": "boundary_layer", "surface": {"name": "nonsingular_terminal", "gains": {"B": 2.0}},
    },
    "a surface with memory": {"plant": "inverted_pendulum", "law": "observer_free", "surface": {"name": "integral"}},
    "an encoder": {"plant": "inverted_pendulum", "law": "observer_free", "counts": 4096},
    "an estimator of velocity and acceleration": {
        "plant": "duffing", "law": "observer_free_third", "velocity": {"name": "integral_chain", "gains": {"w": 80.0}},
    },
    "encoders of two joints": {
        "plant": "overhead_crane", "law": "hierarchical", "velocity": {"name": "kalman"}, "counts": 10000,
    },
}  # fmt: skip
TOLERANCE = 1e-8


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    packages()
    plants = {chosen["plant"]: None for chosen in CASES.values()}
    return smc.live(list(plants), out=tmp_path_factory.mktemp("live") / "page").parent


@pytest.fixture(scope="module")
def found(folder):
    return dict(zip(CASES, traces(folder, [(chosen, SECONDS) for chosen in CASES.values()]), strict=True))


@pytest.mark.parametrize("name", CASES)
def test_a_trace_is_that_of_run(found, name):
    assert farthest(found[name], smc.run(scenario(CASES[name], SECONDS))) < TOLERANCE


def without_one(chosen, kept=("plant", "law", "name", "omega")):
    """Yield each key that a scenario's choices do without, and the choices without it. Only a seed needs a noise."""
    for key, value in chosen.items():
        rest = {other: chosen[other] for other in chosen if other != key}
        if key not in kept:
            yield key, rest
        if isinstance(value, dict):
            for inner, part in without_one(value):
                yield f"{key}.{inner}", rest | {key: part}


def test_no_condition_goes_unnoticed(found):
    """Without any one of its conditions a run is another by far more than the tolerance: ignoring it fails above."""
    for name, chosen in CASES.items():
        for key, rest in without_one(chosen):
            bare, period = smc.run(scenario(rest, 1.0)), chosen.get("control_period", 1e-3)
            rows = round(period / rest.get("control_period", 1e-3)) * np.arange(round(1.0 / period))
            apart = max(
                np.abs(np.array(found[name]["x"][0][: len(rows)]) - bare.x[rows, 0]).max(),
                np.abs(np.array(found[name]["u"][: len(rows)]) - bare.u[rows, 0]).max(),
            )
            assert apart > 1e4 * TOLERANCE, f"{name}: {key}"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("chosen", "why"),
    [
        ({"plant": "duffing", "law": "pid", "gains": {"kp": 1.7e308}, "x0": [2.0]}, "law is not finite"),
        ({"plant": "van_der_pol", "law": "observer_free", "x0": [1e6]}, "diverged"),
    ],
)
def test_a_run_that_fails_ends_where_run_ends_it(folder, chosen, why):
    (found,) = traces(folder, [(chosen, 0.1)])
    trace = smc.run(scenario(chosen, 0.1))
    assert trace.diverged_at is not None
    assert found["failed"]["why"] == why
    assert found["failed"]["time"] == pytest.approx(trace.diverged_at, abs=1e-9)
