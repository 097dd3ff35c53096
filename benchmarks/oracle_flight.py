"""The oracle of flight: a control of the problems with a quadrotor, which is no entry.

It is handed the state and the true plant: masses and inertias, also of a payload, and what the
rotors are and lose. So it knows their speeds, and gives each the speed that it wants within a
period, as far as the rotor's bounds let it. As the state has no noise, the acceleration of the last
period and its change are known, too, with all forces in them, such as wind. It moves to its goal on
a polynomial of degree 9 in the time `move`, at rest at both ends up to the fourth derivative, and
from the plan p, the reference added, it takes the snap, the jerk along the thrust T b and the yaw
of

    p'''' + 4 w (p''' - x''') + 6 w^2 (p'' - x'') + 4 w^3 (p' - x') + w^4 (p - x)       across b,
    p''' + 3 w (p'' - x'') + 3 w^2 (p' - x') + w^3 (p - x)                              along b,
    p'' + 2 w (p' - x') + w^2 (p - x)                                              of the heading.

m x''' = T' b + T b' and its derivative give T' and the angular acceleration; M and h of the plant
then the torques. Source: D. Mellinger & V. Kumar, "Minimum snap trajectory generation and control
for quadrotors", ICRA 2011.
"""

import dataclasses
import math

import numpy as np
from numba import njit

from smc_mujoco.control.joint_law import inner
from smc_mujoco.control.law import FREE_BODY, law_function
from smc_mujoco.control.units import Gain, Unit
from smc_mujoco.mechanisms.hardware.rotors import ROTOR, speed_for, spun
from smc_mujoco.mechanisms.plants import quadrotor
from smc_mujoco.mechanisms.rotation import quaternion, rotate_inverse, turned
from smc_mujoco.simulation.scenario import Scenario

STEP = np.array([126.0, -420.0, 540.0, -315.0, 70.0])  # of s^5 .. s^9: from 0 to 1
FILTER = 4.0  # of w, chosen: bandwidth of the filter of the other forces' change
# s, chosen: rotors are told the speed that brings them to the wanted one after this time
AHEAD = 0.01
ALONG = 1.5  # of w, chosen: bandwidth along the thrust, which waits for no attitude
LEAST = 0.2  # of the weight, of the thrust: chosen
PLACES = np.array(quadrotor.PLACES)
SPINS = np.array(quadrotor.SPINS)
ROTORS = 4
OF_BODY = "a", "c", "fmax"
# of the rotors; delay in periods
TOLD = [(name, 0.0) for name in (*(ROTOR.names or ()), *OF_BODY, "delay")]


@njit(error_model="numpy")
def _left(t, move):
    """Return what is left of the way at a time, as a share, and its four derivatives, (5,)."""
    remaining = np.zeros(5)
    s = min(t / move, 1.0)
    remaining[0] = 1.0
    for k in range(5 if s < 1.0 else 1):
        for i in range(5):
            factor = STEP[i]
            for j in range(k):
                factor *= (5 + i - j) / move
            remaining[k] -= factor * s ** (5 + i - k)
    return remaining


@njit(error_model="numpy")
def _plan(y, gains, memory):
    """Return the plan, (5, 6), and the state, (3, 6): error, its rate, acceleration; of the plan
    jerk and snap, too.

    The acceleration is that of the centre of mass. Also keep what the next sample needs: the error
    at the start, v (of the heading the error), r'' and the next derivative of this sample.
    """
    start = memory[:, 0]
    v = memory[:, 1]
    ddr = memory[:, 2]
    dddr = memory[:, 3]
    acceleration = np.zeros(6)
    first = memory[0, 7] == 0.0
    remaining = _left(y.t, gains.move)
    plan = np.zeros((5, 6))
    now = np.zeros((3, 6))
    if first:
        start[:], v[:], v[5], ddr[:] = y.e, y.v, y.e[5], y.ddr
    for i in range(6):
        read = y.v[i] if i < 5 else y.e[i]
        now[0, i], now[1, i], third = y.e[i], y.de[i], (y.ddr[i] - ddr[i]) / y.dt
        if first:
            acceleration[i] = y.ddr[i]
        else:
            acceleration[i] = (read - v[i]) / y.dt
        for k in range(5):
            plan[k, i] = start[i] * remaining[k]
        plan[2, i] += y.ddr[i]
        plan[3, i] += third
        plan[4, i] += (third - dddr[i]) / y.dt
        v[i], ddr[i], dddr[i] = read, y.ddr[i], third
    now[1, 5], acceleration[5] = acceleration[5], 0.0
    for i in range(3):
        now[2, i] = inner(y.M[i], acceleration) / y.M[i, i]
    return plan, now


@njit(error_model="numpy")
def _jerk(gains, now, modelled, memory, dt):
    """Return the jerk, (3,): that of the rotors' thrust, and through a filter that of all other
    forces.
    """
    before = memory[:3, 4]
    unmodelled = memory[3:, 4]
    jerk = np.zeros(3)
    share = dt * FILTER * gains.w / (1.0 + dt * FILTER * gains.w)
    for i in range(3):
        if memory[0, 7] == 0.0:
            change = 0.0
        else:
            change = (now[2, i] - before[i]) / dt
        unmodelled[i] += share * (change - modelled[i] - unmodelled[i])
        jerk[i], before[i] = modelled[i] + unmodelled[i], now[2, i]
    return jerk


@njit(error_model="numpy")
def _thrust(gains, j, W):
    """Return the thrust of rotor j, and its slope over the speed."""
    share = 1.0 - gains.fade if j == 0 else 1.0
    return share * (gains.linear + gains.square * W) * W, share * (
        gains.linear + 2.0 * gains.square * W
    )


@njit(error_model="numpy")
def _turn(gains, speeds, commanded, dt, first):
    """Advance the speeds of the rotors to when this sample's command comes.

    Return their thrusts and rates, (2, 4).
    """
    if first:
        speeds[:ROTORS] = gains.start
    for _ in range(int(gains.delay) if first else 1):
        lifted = 0.0
        for j in range(ROTORS):
            lifted += _thrust(gains, j, speeds[j])[0]
        for j in range(ROTORS):  # before the first command they are told to stop
            if first:
                goal = speed_for(gains, 0.0) * (1.0 - gains.sag * lifted)
            else:
                goal = commanded[j]
            speeds[j] = spun(gains, speeds[j], goal, dt)[0]
    thrusts = np.zeros((2, ROTORS))
    for j in range(ROTORS):
        thrusts[0, j], slope = _thrust(gains, j, speeds[j])
        if first:
            thrusts[1, j] = 0.0
        else:
            thrusts[1, j] = slope * spun(gains, speeds[j], commanded[j], 0.0)[1]
    return thrusts


@njit(error_model="numpy")
def _shares(y, gains, T, torque, speeds, commanded, supply):
    """Return the wrench, (6,), of the rotors' commands for a thrust and a torque at the end of the
    period.

    Write the speeds that they are told, which are less by what the supply lacks.
    """
    u = np.zeros(6)
    total = 0.0
    levers = (gains.a, gains.a, gains.c)
    for j in range(ROTORS):
        signs = (PLACES[j, 1], -PLACES[j, 0], -SPINS[j])
        lift = T
        strength = 1.0 - gains.fade if j == 0 else 1.0
        for i in range(3):
            lift += signs[i] * torque[i] / levers[i]
        goal = speed_for(gains, 0.25 * lift / strength)
        rate = gains.rise if goal > speeds[j] else gains.fall
        speed = max(0.0, speeds[j] + (goal - speeds[j]) / -math.expm1(-rate * AHEAD)) / supply
        share = min(max((gains.linear + gains.square * speed) * speed, 0.0), gains.fmax)
        commanded[j], total = speed_for(gains, share) * supply, total + share
        for i in range(3):
            u[3 + i] += signs[i] * levers[i] * share
    u[0], u[1], u[2] = turned(quaternion(y.x[3], y.x[4], y.x[5]), 0.0, 0.0, total)
    return u


@law_function(
    joint=True,
    requires_model=True,
    plants=(FREE_BODY,),
    memory=8,
    gains={
        name: Gain(default, Unit(), shared=True)
        for name, default in [("w", 12.0), ("move", 1.5), *TOLD]
    },
)
def oracle_flight(y, gains, memory):
    """Return the force and torque, and the error from the plan."""
    w = gains.w
    along = ALONG * gains.w
    m = y.M[0, 0]
    first = memory[0, 7] == 0.0
    speeds = memory[:, 5]
    commanded = memory[:, 6]
    plan, now = _plan(y, gains, memory)
    thrusts = _turn(gains, speeds, commanded, y.dt, first)
    off = plan[:3] - now
    attitude = quaternion(y.x[3], y.x[4], y.x[5])
    T = thrusts[0].sum()
    dT = thrusts[1].sum()
    p = y.v[3]
    q = y.v[4]
    r = y.v[5]
    momentum = 0.0
    drag = 0.0
    now_jerk = _jerk(gains, now, turned(attitude, T * q / m, -T * p / m, dT / m), memory, y.dt)
    memory[0, 7] = 1.0
    snap = np.zeros(3)
    jerk = np.zeros(3)
    torque = np.zeros(3)
    for i in range(3):
        lag = 4.0 * (plan[3, i] - now_jerk[i])
        snap[i] = plan[4, i] + w * (
            lag + w * (6.0 * off[2, i] + w * (4.0 * off[1, i] + w * off[0, i]))
        )
        jerk[i] = plan[3, i] + along * (
            3.0 * off[2, i] + along * (3.0 * off[1, i] + along * off[0, i])
        )
    across = rotate_inverse(attitude, snap[0], snap[1], snap[2])
    least = LEAST * math.sqrt(inner(y.h, y.h))
    now[2, 3] = r * q - (m * across[1] + 2.0 * dT * p) / max(T, least)
    now[2, 4] = (m * across[0] - 2.0 * dT * q) / max(T, least) - r * p
    now[2, 5] = plan[2, 5] + w * (2.0 * off[1, 5] + w * off[0, 5])
    for j in range(ROTORS):
        momentum += gains.inertia * SPINS[j] * speeds[j]
        drag -= gains.c * SPINS[j] * thrusts[0, j]
    for i in range(3):
        torque[i] = y.h[3 + i] + inner(y.M[3 + i], now[2])
    lead = gains.inertia / (gains.c * (gains.linear + 2.0 * gains.square * speeds[0])) / AHEAD
    torque[0], torque[1] = torque[0] + q * momentum, torque[1] - p * momentum
    torque[2] = (torque[2] + lead * drag) / (1.0 + lead)  # rotors that speed up turn the body back
    T += m * rotate_inverse(attitude, jerk[0], jerk[1], jerk[2])[2] * AHEAD
    u = _shares(
        y, gains, max(T, least), torque, speeds, commanded, 1.0 - gains.sag * thrusts[0].sum()
    )
    return u, -off[0]


def knowing(scenario: Scenario) -> Scenario:
    """Return a scenario whose law, the oracle of flight, is told all that is true of its plant, and
    the delay.
    """
    plant = scenario.plant
    law = scenario.law
    true = plant.values(scenario.factors(0))
    rotor_numbers = dict(zip(ROTOR.names or (), quadrotor.rotor(true, 0), strict=True))
    rotor_numbers |= {name: getattr(true, name) for name in OF_BODY} | {
        "delay": float(scenario.delay_steps)
    }
    law = oracle_flight(**dict(law.gains) | rotor_numbers).named(law.name)
    plant = dataclasses.replace(plant, parameters=vars(true))
    return dataclasses.replace(scenario, plant=plant, law=law, mismatch={}, noise=None)
