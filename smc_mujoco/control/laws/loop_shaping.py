"""H-infinity loop shaping: u = k v + k wi w, w' = v, where v = F x^ keeps a guaranteed margin of
the shaped plant.

The shaped plant is k (s + wi) / s times the plant e'' = a1 e + a2 de + b u. No error of its
normalised coprime factors smaller than 1 / gamma makes the loop unstable. The least gamma is known
in closed form, gamma_min = sqrt(1 + rho(Z X)), X and Z the solutions of two Riccati equations; the
law takes 1.1 gamma_min. It is an observer

    x^' = A x^ + B v + Hs (C x^ - e),  Hs = -Z C',  F = -B' ((1 - gamma^-2) I - gamma^-2 X Z)^-1 X.

In the plant's observable form both solutions follow from one polynomial (worked out here), so that
the law computes F and Hs at its first sample. While the actuator saturates, v is computed back from
the u that acts before it enters the observer and w, and x^ starts at the reading: without both, the
same controller swings after a large start. A constant disturbance leaves no error. It is a linear
law with a guarantee, and loses where signals are large. The observer is discretised exactly for v
and e constant over the period. With the nominal model f and g are cancelled and the law regulates
e'' = v, so a1, a2, b are 0, 0, 1. The trace's s is the v asked for, over F's factor of e.
Gains: k, of the shaped loop [N/m]; wi, of the integral [1/s]; a1 [1/s^2], a2 [1/s] and b [1/kg], by
default those of the plant at its origin.
Sources: D. McFarlane & K. Glover, "A loop shaping design procedure using H-infinity synthesis",
IEEE Trans. Automat. Contr. 37(6):759, 1992; K. Glover & D. McFarlane, "Robust stabilization of
normalized coprime factor plant descriptions with H-infinity-bounded uncertainty", IEEE Trans.
Automat. Contr. 34(8):821, 1989.
"""

import math

from numba import njit

from smc_mujoco.control.law import command, excess, law_function, linear_plant
from smc_mujoco.control.laws.lqi import monic
from smc_mujoco.control.units import FORCE_PER_POSITION, LINEAR_PLANT, RATE, Gain

# of Newton's method and of the series of an exponential; chosen, more than doubles resolve
ROUNDS, TERMS = (200, 40)
SUBOPTIMAL = 1.1  # gamma over its least value, as in the source's designs
PHI, GAMMA, SLOTS = 12, 21, 30  # 3 x 3 matrices in the memory, by rows


@njit
def design(a1, a2, b, k, wi):
    """Return F and Hs, three numbers each, in observable form of the shaped plant, and gamma."""
    # the shaped plant is (n1 s + n0) / (s^3 + d2 s^2 + d1 s)
    n0, n1, d1, d2 = (b * k * wi, b * k, -a1, -a2)
    p0 = abs(n0)
    p2, p1 = monic(p0, d1 * d1 + n1 * n1, d2 * d2 - 2.0 * d1)
    # X of the controllable form, which is Z of the observable form
    x13, x23, x33 = p0, p1 - d1, p2 - d2
    x11, x12 = d1 * x13 + x13 * x23 - n0 * n1, d2 * x13 + x13 * x33
    x22 = d2 * x23 - x13 + d1 * x33 + x23 * x33
    # columns t, u, v of the matrix T that takes the observable form's states to those of the
    # controllable form
    t1 = 1.0 / (n1 * wi * (wi * wi + d1 - d2 * wi))
    t2, t3 = -wi * t1, wi * wi * t1
    u1, u2, u3 = t2, t3, -d1 * t2 - d2 * t3
    v1, v2, v3 = u2, u3, -d1 * u2 - d2 * u3
    # Y = T' X T, X of the observable form
    at1, at2, at3 = (
        x11 * t1 + x12 * t2 + x13 * t3,
        x12 * t1 + x22 * t2 + x23 * t3,
        x13 * t1 + x23 * t2 + x33 * t3,
    )
    au1, au2, au3 = (
        x11 * u1 + x12 * u2 + x13 * u3,
        x12 * u1 + x22 * u2 + x23 * u3,
        x13 * u1 + x23 * u2 + x33 * u3,
    )
    av1, av2, av3 = (
        x11 * v1 + x12 * v2 + x13 * v3,
        x12 * v1 + x22 * v2 + x23 * v3,
        x13 * v1 + x23 * v2 + x33 * v3,
    )
    y11, y12, y13 = (
        t1 * at1 + t2 * at2 + t3 * at3,
        t1 * au1 + t2 * au2 + t3 * au3,
        t1 * av1 + t2 * av2 + t3 * av3,
    )
    y22, y23 = u1 * au1 + u2 * au2 + u3 * au3, u1 * av1 + u2 * av2 + u3 * av3
    y33 = v1 * av1 + v2 * av2 + v3 * av3
    # the product Y Z
    m11, m12, m13 = (
        y11 * x11 + y12 * x12 + y13 * x13,
        y11 * x12 + y12 * x22 + y13 * x23,
        y11 * x13 + y12 * x23 + y13 * x33,
    )
    m21, m22, m23 = (
        y12 * x11 + y22 * x12 + y23 * x13,
        y12 * x12 + y22 * x22 + y23 * x23,
        y12 * x13 + y22 * x23 + y23 * x33,
    )
    m31, m32, m33 = (
        y13 * x11 + y23 * x12 + y33 * x13,
        y13 * x12 + y23 * x22 + y33 * x23,
        y13 * x13 + y23 * x23 + y33 * x33,
    )
    # its largest eigenvalue: Newton's method on the cubic, whose roots are real, falls to it from
    # their sum
    c2 = m11 + m22 + m33
    c1 = m11 * m22 - m12 * m21 + m11 * m33 - m13 * m31 + m22 * m33 - m23 * m32
    c0 = (
        m11 * (m22 * m33 - m23 * m32)
        - m12 * (m21 * m33 - m23 * m31)
        + m13 * (m21 * m32 - m22 * m31)
    )
    rho = c2
    for _ in range(ROUNDS):
        slope = (3.0 * rho - 2.0 * c2) * rho + c1
        lower = rho - (((rho - c2) * rho + c1) * rho - c0) / slope if slope > 0.0 else rho
        if lower >= rho:
            break
        rho = lower
    gamma = SUBOPTIMAL * math.sqrt(1.0 + rho)
    # z W = B' for W = (1 - gamma^-2) I - gamma^-2 Y Z, by determinants; then F = -z Y
    g = 1.0 / (gamma * gamma)
    w11, w12, w13 = 1.0 - g - g * m11, -g * m12, -g * m13
    w21, w22, w23 = -g * m21, 1.0 - g - g * m22, -g * m23
    w31, w32, w33 = -g * m31, -g * m32, 1.0 - g - g * m33
    e11, e12, e13 = w22 * w33 - w23 * w32, w13 * w32 - w12 * w33, w12 * w23 - w13 * w22
    e21, e22, e23 = w23 * w31 - w21 * w33, w11 * w33 - w13 * w31, w13 * w21 - w11 * w23
    det = w11 * e11 + w12 * e21 + w13 * (w21 * w32 - w22 * w31)
    z1, z2, z3 = (
        (n0 * e11 + n1 * e21) / det,
        (n0 * e12 + n1 * e22) / det,
        (n0 * e13 + n1 * e23) / det,
    )
    F1, F2, F3 = (
        z1 * y11 + z2 * y12 + z3 * y13,
        z1 * y12 + z2 * y22 + z3 * y23,
        z1 * y13 + z2 * y23 + z3 * y33,
    )
    return -F1, -F2, -F3, -x13, -x23, -x33, gamma


@njit
def start(y, a1, a2, b, k, wi, memory):
    """Write F, Hs, the observer's matrices over one period and x^ at the reading into the memory.
    Return 1.
    """
    # 0, started; 1, w; 2 to 4, x^; 5 to 7, F; 8 to 10, Hs; then exp(M h) and its integral, M = A +
    # Hs C
    memory[5], memory[6], memory[7], memory[8], memory[9], memory[10], _ = design(a1, a2, b, k, wi)
    p0, p1, p2 = -memory[8], -a1 - memory[9], -a2 - memory[10]
    memory[3], memory[4] = y.de - a2 * y.e, y.e
    for j in range(3):
        q1, q2, q3 = (1.0, 0.0, 0.0) if j == 0 else ((0.0, 1.0, 0.0) if j == 1 else (0.0, 0.0, 1.0))
        s1, s2, s3, i1, i2, i3 = q1, q2, q3, y.dt * q1, y.dt * q2, y.dt * q3
        for n in range(1, TERMS):
            q1, q2, q3 = -p0 * q3 * y.dt / n, (q1 - p1 * q3) * y.dt / n, (q2 - p2 * q3) * y.dt / n
            s1, s2, s3 = s1 + q1, s2 + q2, s3 + q3
            i1, i2, i3 = (
                i1 + y.dt * q1 / (n + 1),
                i2 + y.dt * q2 / (n + 1),
                i3 + y.dt * q3 / (n + 1),
            )
        memory[PHI + j], memory[PHI + 3 + j], memory[PHI + 6 + j] = s1, s2, s3
        memory[GAMMA + j], memory[GAMMA + 3 + j], memory[GAMMA + 6 + j] = i1, i2, i3
    return 1.0


@njit
def observe(v, e, n0, n1, memory):
    """Bring x^ to the next sample under v and the reading e. Return its last state, the error that
    it predicts.
    """
    q1, q2, q3 = n0 * v - memory[8] * e, n1 * v - memory[9] * e, -memory[10] * e
    x1, x2, x3 = memory[2], memory[3], memory[4]
    for i in range(3):
        kept = (
            memory[PHI + 3 * i] * x1 + memory[PHI + 3 * i + 1] * x2 + memory[PHI + 3 * i + 2] * x3
        )
        driven = (
            memory[GAMMA + 3 * i] * q1
            + memory[GAMMA + 3 * i + 1] * q2
            + memory[GAMMA + 3 * i + 2] * q3
        )
        memory[2 + i] = kept + driven
    return memory[4]


@law_function(
    family="baseline",
    continuous=True,
    accuracy=0,
    label="Loop shaping",
    short="LS",
    gains={
        "k": Gain(20.0, FORCE_PER_POSITION, positive=True),
        "wi": Gain(0.5, RATE, positive=True),
        **LINEAR_PLANT,
    },
    memory=SLOTS,
    relative_degree=2,
)
def loop_shaping(y, gains, memory):
    a1, a2, b = linear_plant(y, gains.a1, gains.a2, gains.b)
    k, wi = gains.k, gains.wi
    if memory[0] == 0.0:
        memory[0] = start(y, a1, a2, b, k, wi, memory)
    v = memory[5] * memory[2] + memory[6] * memory[3] + memory[7] * memory[4]
    u = command(y, k * v + k * wi * memory[1])
    acted = v + excess(y, u) / k
    memory[4] = observe(acted, y.e, b * k * wi, b * k, memory)
    memory[1] += y.dt * acted
    return u, v / memory[7]
