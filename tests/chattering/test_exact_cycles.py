"""Limit cycles behind drives are those of exact integration, and the ranges of the prediction hold
them.

The exact cycles are of helpers/exact_cycles.py, which shares no code with the suite.
"""

import itertools
import math

import numpy as np
import pytest
from helpers.exact_cycles import GAINS, NAMES, ExactLoop, measured, random_loop
from helpers.runs import free_mass

import smc_mujoco as smc


def scenario(loop, **fields):
    """The suite's scenario of a loop, with its default steps."""
    drive = tuple(smc.Lag(lag) for lag in loop.lags) or None
    if loop.motor is not None:
        drive = smc.DCMotor(
            resistance=loop.motor.resistance,
            inductance=loop.motor.inductance,
            torque_constant=loop.motor.constant,
            gear=1.0,
            rotor_inertia=loop.motor.inertia,
            voltage=math.inf,
            current=math.inf,
        )
    return smc.Scenario(
        plant=smc.plant(
            "duffing",
            M=loop.M,
            alpha=loop.alpha,
            beta=0.0,
            delta=loop.delta,
        ),
        law=smc.law(NAMES[loop.kind], **dict(zip(GAINS[loop.kind], loop.gains, strict=True))),
        control_period=loop.period,
        input_delay=loop.periods_late * loop.period,
        actuator=drive,
        u_max=math.inf,
        x0=loop.x0,
        v0=0.0,
        **fields,
    )


pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")
CLASSICAL, TWISTING, SUPER_TWISTING, QUASI_CONTINUOUS = range(4)
# loop, and its exact amplitude of s and frequency, Hz: of independent integrations, to three digits
VECTORS = {
    "classical, 10 ms, 1 ms": (ExactLoop(CLASSICAL, (2.0, 3.0), 1e-3, (0.01,)), 1.55e-3, 62.5),
    "classical, 10 ms, 5 ms": (ExactLoop(CLASSICAL, (2.0, 3.0), 5e-3, (0.01,)), 8.60e-3, 25.0),
    "classical, two lags": (ExactLoop(CLASSICAL, (2.0, 3.0), 1e-4, (0.01, 0.02)), 1.95e-2, 10.41),
    "twisting": (ExactLoop(TWISTING, (3.7, 2.3), 1e-4, (0.005,)), 3.10e-4, 19.37),
    "quasi-continuous": (ExactLoop(QUASI_CONTINUOUS, (6.0, 1.0), 1e-4, (0.005,)), 5.91e-5, 41.5),
    "super-twisting, delay": (
        ExactLoop(SUPER_TWISTING, (3.0, 4.4, 2.5), 1e-3, periods_late=30),
        1.15e-2,
        5.43,
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", VECTORS)
def test_a_limit_cycle_with_default_steps_is_that_of_the_machine(name):
    loop, amplitude, frequency = VECTORS[name]
    late = slice(-round(3.0 / loop.period), None)
    t, s = loop.run(8.0)
    assert measured(t[late], s[late]) == pytest.approx((amplitude, frequency), rel=5e-3)
    trace = smc.run(scenario(loop, duration=8.0))
    assert measured(trace.t[late], trace.s[late, 0]) == pytest.approx(
        (amplitude, frequency), rel=0.01
    )


def loops(seed):
    """Random loops that oscillate, without end, with their exact cycles."""
    rng = np.random.default_rng(seed)
    for loop in iter(lambda: random_loop(rng), None):
        amplitude, frequency = loop.cycle()
        if frequency > 1.0:
            yield loop, amplitude, frequency


@pytest.mark.slow
def test_ranges_hold_the_cycles_of_fresh_loops():
    """The ranges are calibrated on other loops, by benchmarks/chattering.py, to hold amplitudes in
    95 %.
    """
    held = []
    for loop, amplitude, frequency in itertools.islice(loops(2), 20):
        cycle = smc.design.chattering(scenario(loop))
        (low, high), (slow, fast) = cycle.amplitude_range, cycle.frequency_range
        held.append((low <= amplitude <= high, slow <= frequency <= fast))
    assert (np.sum(held, axis=0) >= 18).all()


@pytest.mark.quick
def test_a_run_whose_cycle_depends_on_the_step_is_marked():
    """implicitfast moves positions ahead by half a step."""
    coarse = {"physics_step": 1e-3, "integrator": "implicitfast"}
    free = free_mass()
    common = {
        "plant": free,
        "law": smc.law("twisting"),
        "actuator": smc.Lag(0.001),
        "x0": 0.02,
        "duration": 3.0,
    }
    traces = smc.run([smc.Scenario(**common, **fields) for fields in (coarse, {})])
    wrong, right = smc.accuracy.step_halving(traces)
    assert (wrong.marked, right.marked) == (True, False)
    assert right.amplitude < 0.02
