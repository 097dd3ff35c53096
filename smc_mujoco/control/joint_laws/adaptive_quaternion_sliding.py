"""Adaptive quaternion sliding mode: K' = G |s| tanh(rho |s| - eps), for a free body such as a
quadrotor.

    K' = G |s| tanh(rho |s| - eps) if K > K0, else mu;  K <= K_up;  K = K0 at the start.

It is `quaternion_sliding` whose K, for each axis, grows where |s| is large: of the position with s
= e' + c e, and of the attitude with s = we + lam sgn(q0) qv. So K falls where |s| is below eps /
rho, 0.025 rad/s and 0.0011 m/s by default. Steady errors are those of `quaternion_sliding` with the
K that was reached. K moves slowly: with the published Gx, a payload of 6 g on 32 g still costs 0.34
m after 10 s.
Proved in the source: bounded in the end from every attitude, without unwinding, K without
overgrowth.
The public code differs from its text in six places, and here, one by one:
(a) it multiplies by the period where it differentiates the path, so that jerk and snap do not
    count: here the jerk is r'' from sample to sample, and the snap, with all of the change of wd,
    is left out, see control/attitude.py;
(b) it never stores its acceleration of the sample before: here the filter of e' keeps its state;
(c) it takes a measured acceleration in g beside one in m/s^2: here all is in SI units;
(d) it integrates K over 4 times the time that passes, of the position 2.5 times: here G and mu are
    per second, so that K grows more slowly than it flew;
(e) at K_up it puts K back to K0, which lets go when the disturbance is largest: here K stays at
K_up;
(f) its first 10 calls take Rd = 1: here none does.
Gains: c and cz [1/s], slopes of the position's surface, of x and y and of z; Kx and Kz [m/s^2], its
K0; rhox [s/m], its slope in tanh; Gx [1/s^2], its rate; mux [m/s^3], its creep; epsx, its dead
zone; Kx_up [m/s^2], its bound; lam and lamz [rad/s], slopes of the attitude's surface, of roll and
pitch and of yaw; K [rad/s^2], its K0; rho [s/rad], its slope in tanh; G [1/s^2], its rate; mu
[rad/s^3], its creep; eps, its dead zone; K_up [rad/s^2], its bound. Defaults of the source's code
for a Crazyflie.
Source: A. Yazdanshenas & R. Faieghi, "Adaptive quaternion sliding mode control", arXiv 2508.06568,
and its code.
"""

import numpy as np

from smc_mujoco.control.attitude import STEERING, shorter, slide, steer, wrench
from smc_mujoco.control.joint_law import tanh
from smc_mujoco.control.law import FREE_BODY, law_function
from smc_mujoco.control.units import ACCELERATION, RATE, Gain, Unit, shared

RATE3 = Unit(time=-3)


@law_function(
    joint=True,
    family="adaptive",
    requires_model=True,
    plants=(FREE_BODY,),
    gains=shared(
        {
            "c": Gain(3.0, RATE, positive=True),
            "cz": Gain(2.0, RATE, positive=True),
            "Kx": Gain(4.0, ACCELERATION, positive=True),
            "Kz": Gain(3.0, ACCELERATION, positive=True),
            "rhox": Gain(0.9, Unit(position=-1, time=1), positive=True),
            "Gx": Gain(0.1, Unit(time=-2), nonnegative=True),
            "mux": Gain(0.01, Unit(position=1, time=-3), nonnegative=True, held=True),
            "epsx": Gain(0.001, Unit(), nonnegative=True, held=True),
            "Kx_up": Gain(20.0, ACCELERATION, positive=True, held=True),
            "lam": Gain(8.0, RATE, positive=True, turns=True),
            "lamz": Gain(3.0, RATE, positive=True, turns=True),
            "K": Gain(400.0, Unit(time=-2), positive=True, turns=True),
            "rho": Gain(0.2, Unit(time=1), positive=True, turns=True),
            "G": Gain(20.0, Unit(time=-2), nonnegative=True, turns=True),
            "mu": Gain(0.01, RATE3, nonnegative=True, held=True, turns=True),
            "eps": Gain(0.005, Unit(), nonnegative=True, held=True, turns=True),
            "K_up": Gain(2000.0, Unit(time=-2), positive=True, held=True, turns=True),
        }
    ),
    conditions={
        "Kx_up > Kx, or it does not adapt": lambda g: g.Kx_up > g.Kx,
        "Kx_up > Kz, or it does not adapt": lambda g: g.Kx_up > g.Kz,
        "K_up > K, or it does not adapt": lambda g: g.K_up > g.K,
    },
    accuracy=0,
    label="Adaptive quaternion",
    memory=STEERING + 1,  # and K - K0
)
def adaptive_quaternion_sliding(y, gains, memory):
    s = np.zeros(6)
    K0 = np.zeros(6)
    grown = memory[:, 2]
    K0[:2] = gains.Kx
    K0[2] = gains.Kz
    K0[3:] = gains.K
    c = np.array([gains.c, gains.c, gains.cz])
    lam = 0.5 * np.array([gains.lam, gains.lam, gains.lamz])
    s[:3], v, stiffness, damping = slide(y, c, K0[:3] + grown[:3], gains.rhox)
    F, error, turning, moving = steer(y, v, stiffness, damping, memory)
    angle, change = shorter(error, turning)
    for i in range(3):
        s[3 + i] = turning[i] + lam[i] * angle[i]
    u = wrench(y, F, -lam * change - (K0[3:] + grown[3:]) * tanh(gains.rho * s[3:]), moving)
    size = np.abs(s)
    position = np.where(
        grown[:3] > 0.0, gains.Gx * size[:3] * tanh(gains.rhox * size[:3] - gains.epsx), gains.mux
    )
    attitude = np.where(
        grown[3:] > 0.0, gains.G * size[3:] * tanh(gains.rho * size[3:] - gains.eps), gains.mu
    )
    memory[:3, 2] = np.minimum(grown[:3] + y.dt * position, gains.Kx_up - K0[:3])
    memory[3:, 2] = np.minimum(grown[3:] + y.dt * attitude, gains.K_up - K0[3:])
    return u, s
