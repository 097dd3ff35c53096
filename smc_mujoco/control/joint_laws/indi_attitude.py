"""Incremental dynamic inversion (INDI) of the attitude: torque = Mf + J (v - wf'), for a free body.

    v = -kq 2 sgn(q0) qv - kw we - w x wd,
    Mf = H(p) A(p) torque,    wf' = p H(p) w,    A = 1 / (lag p + 1)

with H a Butterworth filter of second order of `cutoff` hertz, A what the law takes for the rotors,
and force, wanted attitude and wd those of `geometric`. It needs J but no model of the torques that
act: w' = A v + (1 - A H) d, with d the change that anything unknown makes, if A is right. So a
constant torque leaves no error. With c J in place of J, w' = (c A v + (1 - A H) d) / (1 - A H (1 -
c)), which in slow motion, A H = 1, is still v. A yaw torque of rotors that speed up, M + spin M',
is taken into account:

    dMz = (Jz (vz - wfz') + spin / dt dMz_) / (1 + spin / dt),    spin = Jr / (2 kf W c)

with Jr the inertia of a rotor, kf W^2 its force at speed W, c its torque per force, and dMz_ the
sample before. By default the rotors have no inertia. s is e' + (kx / kv) e and we + (kq / kw) 2
sgn(q0) qv: the law slides nowhere.
Gains: kx [1/s^2] and kv [1/s], of the position; kq [1/s^2] and kw [1/s], of the attitude; cutoff
[Hz], of the filters; lag [s], of the rotors; spin [s], of their inertia. Defaults of the
Crazyflie's firmware, which runs at 500 Hz, except kx and kv, which are chosen.
Source: E. Smeur, Q. Chu & G. de Croon, "Adaptive incremental nonlinear dynamic inversion for
attitude control of micro air vehicles", J. Guidance, Control, and Dynamics 39(3):450, 2016, doi
10.2514/1.G001490; without its adaptation.
"""

import math

import numpy as np
from numba import njit

from smc_mujoco.control.attitude import FEEDBACK, LAG, STEERING, shorter, steer, wrench
from smc_mujoco.control.law import FREE_BODY, law_function
from smc_mujoco.control.units import RATE, TIME, Gain, Unit, shared


@njit
def _low_pass(x, i, cutoff, dt, states):
    """Return a reading of axis i through a Butterworth filter, whose states, (6,), then hold it; by
    Tustin's rule.
    """
    k = math.tan(math.pi * cutoff * dt)
    scale = 1.0 / (1.0 + math.sqrt(2.0) * k + k * k)
    b = k * k * scale
    a1 = 2.0 * (k * k - 1.0) * scale
    a2 = (1.0 - math.sqrt(2.0) * k + k * k) * scale
    filtered = b * x + states[i]
    states[i] = 2.0 * b * x - a1 * filtered + states[3 + i]
    states[3 + i] = b * x - a2 * filtered
    return filtered


@law_function(
    joint=True,
    family="disturbance-observer",
    continuous=True,
    requires_model=True,
    plants=(FREE_BODY,),
    gains=shared(
        {
            **FEEDBACK,
            "kq": Gain(120.0, Unit(time=-2), positive=True, turns=True),
            "kw": Gain(24.0, RATE, positive=True, turns=True),
            "cutoff": Gain(8.0, RATE, positive=True, held=True, turns=True),
            "lag": LAG,
            "spin": Gain(0.0, TIME, nonnegative=True, held=True, turns=True),
        }
    ),
    accuracy=0,
    label="INDI attitude",
    short="IN",
    memory=STEERING
    + 4,  # and states of both filters; torque of the rotors and w before; command and dMz before
)
def indi_attitude(y, gains, memory):
    s = np.zeros(6)
    v = np.zeros(3)
    ones = np.ones(3)
    started = memory[0, 1]
    s[:3] = y.de[:3] + gains.kx / gains.kv * y.e[:3]
    F, error, turning, moving = steer(
        y, -gains.kv * s[:3], gains.kx * ones, gains.kv * ones, memory
    )
    angle, _ = shorter(error, turning)
    rotors = memory[:3, 4]
    before = memory[3:, 4]
    held = memory[:, 5]
    follow = 1.0 if gains.lag == 0.0 else -math.expm1(-y.dt / gains.lag)
    for i in range(3):
        s[3 + i] = turning[i] + gains.kq / gains.kw * angle[i]
        change = started * (y.v[3 + i] - before[i]) / y.dt
        v[i] = -gains.kw * s[3 + i] - _low_pass(change, i, gains.cutoff, y.dt, memory[:, 2])
        before[i] = y.v[3 + i]
        rotors[i] += follow * (held[i] - rotors[i])
    u = wrench(y, F, v, moving)
    u[3:] -= y.h[3:]
    lead = gains.spin / y.dt
    held[3] = (u[5] + lead * held[3]) / (1.0 + lead)
    u[5] = held[3]
    for i in range(3):
        u[3 + i] += _low_pass(rotors[i], i, gains.cutoff, y.dt, memory[:, 3])
        held[i] = min(max(u[3 + i], -y.limit[3 + i]), y.limit[3 + i])
    return u, s
