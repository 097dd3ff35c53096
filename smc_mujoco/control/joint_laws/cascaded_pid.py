"""The firmware's cascade of PIDs: torque = J (Pr (w* - w) + Ir int(w* - w) + Dr (w* - w)'), for a
free body.

    v* = clip(P (r - x) + I int(r - x), speed)
    F / m = Pv (v* - v) + Iv int(v* - v) + g,    tilt of F below `tilt`
    w* = Pa a + Ia int(a) + Da a'

with a = -2 sgn(q0) qv, which is near the firmware's roll, pitch and yaw where the tilt is small,
all in SI units. It follows no r', no r'' and no rate of the wanted attitude. Integrals are clipped.
In the end no constant force or torque leaves an error, which sideways takes Pv / Iv = 25 s, in
height 1.7 s. s is v - v* and w - w*: the law slides nowhere. The firmware counts in degrees and in
units of its PWM. One of these is 0.12 N / 65535 a motor: 4 of them in thrust, 2 a
of them = 1.191e-7 N m in roll, with the lever a = 0.03253 m, 4 c of them = 5.383e-8 N m in yaw, c =
0.00735 m:

    rate         P 250, I 500, D 2.5  x 180 / pi x 1.191e-7 / 16.57e-6 = 103.0, 206.0, 1.030
    rate of yaw  P 120, I 16.7        x 180 / pi x 5.383e-8 / 29.26e-6 = 12.65, 1.760
    angle        P 6, I 3; yaw 6, 1, D 0.35, as they are
    velocity     P 25, I 1            x pi / 180 x 9.81                = 4.280, 0.1712
    climb        P 25, I 15 thousand  x 4000 x 0.12 / 65535 / 0.0319   = 5.740, 3.444
    position     P 2; height P 2, I 0.5

The rate's integral is held within 33.3 degrees, that of the yaw's rate within 166.7, that of the
angle within 20 degrees s, of the yaw 360. The velocity loop gives degrees of tilt. The speed is at
most 1 m/s, the tilt 20 degrees, and the least thrust 20,000 of the 42,700 PWM in hover.

In the firmware a base of 36,000 PWM and the integral carry the weight, here the model does. There
the inner loops run at 500 Hz and the outer ones at 100 Hz, here all at each sample. Neither adds w
x J w.
Gains: P and Pz [1/s], of the position, z the height; Iz [1/s^2], of its integral; Pv and Pvz [1/s],
of the velocity; Iv and Ivz [1/s^2], of its integral; Pa and Paz [1/s], of the attitude, z the yaw;
Ia and Iaz [1/s^2], of its integral; Daz, of the yaw's rate; Pr and Prz [1/s], of the rate; Ir and
Irz [1/s^2], of its integral; Dr, of its change; speed [m/s], bound of v*; tilt [rad], bound of the
tilt.
Source: Bitcraze, crazyflie-firmware, controller_pid.c and platform_defaults.h, numbers alone.
"""

import math

import numpy as np
from numba import njit

from smc_mujoco.control.attitude import of_thrust, shorter, wrench
from smc_mujoco.control.law import FREE_BODY, law_function
from smc_mujoco.control.units import RATE, RATE2, SPEED, Gain, Unit, shared
from smc_mujoco.mechanisms.rotation import quaternion, relative

LEAST = 20_000 / 42_700  # of the weight, that the thrust carries at least
DEGREES = math.pi / 180.0
# integrals' bounds
OF_ANGLE, OF_HEADING, OF_RATE, OF_YAW = (bound * DEGREES for bound in (20.0, 360.0, 33.3, 166.7))


@njit
def _integrated(integral, error, dt, most):
    """Return an integral one sample later, within +-most."""
    return min(max(integral + dt * error, -most), most)


def _gains(turns, **values):
    return {
        name: Gain(value, unit, nonnegative=True, turns=turns)
        for name, (value, unit) in values.items()
    }


@law_function(
    joint=True,
    family="baseline",
    continuous=True,
    requires_model=True,
    plants=(FREE_BODY,),
    gains=shared(
        {
            **_gains(False, P=(2.0, RATE), Pz=(2.0, RATE), Iz=(0.5, RATE2)),
            **_gains(
                False, Pv=(4.280, RATE), Iv=(0.1712, RATE2), Pvz=(5.740, RATE), Ivz=(3.444, RATE2)
            ),
            **_gains(
                True,
                Pa=(6.0, RATE),
                Ia=(3.0, RATE2),
                Paz=(6.0, RATE),
                Iaz=(1.0, RATE2),
                Daz=(0.35, Unit()),
            ),
            **_gains(
                True,
                Pr=(103.0, RATE),
                Ir=(206.0, RATE2),
                Dr=(1.030, Unit()),
                Prz=(12.65, RATE),
                Irz=(1.760, RATE2),
            ),
            "speed": Gain(1.0, SPEED, positive=True, held=True),
            "tilt": Gain(20.0 * DEGREES, Unit(), positive=True, held=True, turns=True),
        }
    ),
    accuracy=0,
    label="Firmware's PIDs",
    short="FP",
    # integrals of positions and angles, of velocities and rates; w* - w before; whether there was
    # one
    memory=4,
)
def cascaded_pid(y, gains, memory):
    s = np.zeros(6)
    F = np.zeros(3)
    v = np.zeros(3)
    started = memory[0, 3]
    memory[0, 3] = 1.0
    gravity = y.h[2] / y.M[2, 2]
    slope = math.tan(gains.tilt)
    for i in range(3):
        P, I, Pv, Iv = (
            (gains.P, 0.0, gains.Pv, gains.Iv)
            if i < 2
            else (gains.Pz, gains.Iz, gains.Pvz, gains.Ivz)
        )
        memory[i, 0] = _integrated(memory[i, 0], -y.e[i], y.dt, gains.speed / I if I > 0.0 else 0.0)
        speed = min(max(I * memory[i, 0] - P * y.e[i], -gains.speed), gains.speed)
        s[i] = y.v[i] - speed
        memory[i, 1] = _integrated(
            memory[i, 1], -s[i], y.dt, gravity * slope / Iv if Iv > 0.0 else 0.0
        )
        F[i] = y.M[i, i] * (Iv * memory[i, 1] - Pv * s[i]) + y.h[i]
    F[2] = max(F[2], LEAST * y.h[2])
    sideways = math.sqrt(F[0] * F[0] + F[1] * F[1])
    part = min(1.0, F[2] * slope / max(sideways, 1e-12))
    F[0], F[1] = part * F[0], part * F[1]
    error = relative(of_thrust(F, y.r[3:]), quaternion(y.x[3], y.x[4], y.x[5]))
    angle, change = shorter(error, (y.v[3], y.v[4], y.v[5]))
    for i in range(3):
        j = 3 + i
        yaw = i == 2
        P, I, D = (gains.Paz, gains.Iaz, gains.Daz) if yaw else (gains.Pa, gains.Ia, 0.0)
        memory[j, 0] = _integrated(memory[j, 0], -angle[i], y.dt, OF_HEADING if yaw else OF_ANGLE)
        s[j] = y.v[j] - (I * memory[j, 0] - P * angle[i] - D * change[i])
        P, I, D = (gains.Prz, gains.Irz, 0.0) if yaw else (gains.Pr, gains.Ir, gains.Dr)
        memory[j, 1] = _integrated(memory[j, 1], -s[j], y.dt, OF_YAW if yaw else OF_RATE)
        v[i] = I * memory[j, 1] - P * s[j] - D * started * (s[j] + memory[j, 2]) / y.dt
        memory[j, 2] = -s[j]
    u = wrench(y, F, v, (0.0, 0.0, 0.0))
    u[3:] -= y.h[3:]
    return u, s
