"""Implicit sliding modes against the trajectories of Siconos, an implementation that shares no line
with this one.

The rows are of siconos-tutorials (Apache-2.0), `examples/control/SMC/SMCExampleImplicit.ref` and its
siblings.

Both examples run on a free mass here. In the first, x2' = -b + 2 u with b = sin 50 t, x2 is the
velocity of the mass. Siconos holds b over a step at its
value at the step's end, which is MuJoCo's Euler step with b advanced by one step.
"""

import functools
import math

import numpy as np
import pytest
from helpers.runs import free_mass

import smc_mujoco as smc

pytestmark = pytest.mark.quick

STEP, PERIOD = 1e-4, 1e-2  # s, of the first example
EXACT = 1e-9

# t -> (x2, u from then on) of the first example
IMPLICIT = {
    0.00: (-1.0, 1.0),
    0.50: (-0.0001693258087536163, 0.008466290437680879),
    0.54: (-0.009884308901929748, 0.4942154450964873),
    0.69: (-0.002971933052214677, 0.1485966526107338),
}
EXPLICIT = {
    0.00: (-1.0, 1.0),
    0.51: (0.01864835210203784, -1.0),
    0.60: (0.02313446581841623, -1.0),
    0.69: (-0.01996971565849693, 1.0),
}
# t -> (x1, x2) of twisting
TWISTING = {
    0.1: (10.93425, 8.685),
    0.5: (13.35625, 3.425),
    9.9: (0.0, 0.0),
    19.8: (0.0, 0.0),
}


@functools.cache
def first_example():
    """Traces: x2 under the implicit law and under the explicit one."""
    common = {
        "control_period": PERIOD,
        "physics_step": STEP,
        "integrator": "Euler",
        "x0": 0.0,
        "duration": 1.0,
    }
    lead = 50.0 * STEP
    x2 = []
    for law in (
        smc.law("implicit_first_order", k=2.0, c=0.0),
        smc.law("classical", k=2.0, c=0.0),
    ):
        x2.append(
            smc.Scenario(
                plant=free_mass(0.5),
                law=law,
                model="nominal",
                v0=-1.0,
                disturbance=smc.Sine(-0.5, 50.0, lead),
                **common,
            )
        )
    return smc.run(x2)


@pytest.mark.parametrize(
    ("which", "rows"),
    [
        (0, IMPLICIT),
        (1, EXPLICIT),
    ],
    ids=["implicit", "explicit"],
)
def test_rows_of_siconos_are_reproduced(which, rows):
    trace = first_example()[which]
    for t, row in rows.items():
        k = round(t / PERIOD)
        np.testing.assert_allclose((trace.v[k, 0], trace.u[k, 0]), row, rtol=0, atol=EXACT)


# twisting


@smc.law_function(gains={"G": 10.0, "beta": 0.3}, memory=1, relative_degree=2)
def implicit_twisting(y, gains, memory):
    """Twisting with both signs at the end of the period: u = -a S1 - b S2, a = G (1 + beta dt/2), b
    = G beta.

    S1 is in sgn(x1+ + dt/2 x2+) and S2 in sgn(x2+), with x2+ = x2 + dt u and x1+ = x1 + dt (x2 +
    x2+)/2: the normal-cone problem of Siconos' example Twisting.cpp. u + a S1 + b S2 grows with u
    and jumps at two places. Its zero is at one of them, or at one of the three values that u has
    between them.
    """
    a = gains.G * (1.0 + gains.beta * y.dt / 2.0)
    b = gains.G * gains.beta
    first = -(y.e + 1.5 * y.dt * y.de) / y.dt**2
    second = -y.de / y.dt
    if first > second:
        first, second, a, b = second, first, b, a
    return min(a + b, max(first, min(b - a, max(second, -a - b)))), y.e


@functools.cache
def twisting_runs():
    """Traces of Siconos' implicit twisting and of the library's explicit one, from (10, 10)."""
    common = {
        "plant": free_mass(),
        "x0": 10.0,
        "v0": 10.0,
        "control_period": 0.1,
        "duration": 19.9,
        "u_max": math.inf,
    }
    laws = (implicit_twisting(), smc.law("twisting", r1=10.0, r2=3.0))
    return smc.run([smc.Scenario(law=law, **common) for law in laws])


def test_rows_of_siconos_implicit_twisting_are_reproduced():
    trace = twisting_runs()[0]
    for t, row in TWISTING.items():
        k = round(t / 0.1)
        np.testing.assert_allclose((trace.x[k, 0], trace.v[k, 0]), row, rtol=0, atol=EXACT)
