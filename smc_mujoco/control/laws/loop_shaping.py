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
    n0 = b * k * wi
    n1 = b * k
    d1 = -a1
    d2 = -a2
    x11, x12, x13, x22, x23, x33 = riccati(n0, n1, d1, d2)
    y11, y12, y13, y22, y23, y33 = observable(x11, x12, x13, x22, x23, x33, n1, wi, d1, d2)
    # the product Y Z
    m11, m12, m13 = row(y11, y12, y13, x11, x12, x13, x22, x23, x33)
    m21, m22, m23 = row(y12, y22, y23, x11, x12, x13, x22, x23, x33)
    m31, m32, m33 = row(y13, y23, y33, x11, x12, x13, x22, x23, x33)
    rho = largest_eigenvalue(m11, m12, m13, m21, m22, m23, m31, m32, m33)
    gamma = SUBOPTIMAL * math.sqrt(1.0 + rho)
    # z W = B' for W = (1 - gamma^-2) I - gamma^-2 Y Z; then F = -z Y
    g = 1.0 / (gamma * gamma)
    z1, z2, z3 = left_solution(
        n0,
        n1,
        1.0 - g - g * m11,
        -g * m12,
        -g * m13,
        -g * m21,
        1.0 - g - g * m22,
        -g * m23,
        -g * m31,
        -g * m32,
        1.0 - g - g * m33,
    )
    F1, F2, F3 = row(z1, z2, z3, y11, y12, y13, y22, y23, y33)
    return -F1, -F2, -F3, -x13, -x23, -x33, gamma


@njit
def riccati(n0, n1, d1, d2):
    """Return X of the controllable form, which is Z of the observable form: its upper triangle by
    rows.
    """
    p0 = abs(n0)
    p2, p1 = monic(p0, d1 * d1 + n1 * n1, d2 * d2 - 2.0 * d1)
    x13 = p0
    x23 = p1 - d1
    x33 = p2 - d2
    x11 = d1 * x13 + x13 * x23 - n0 * n1
    x12 = d2 * x13 + x13 * x33
    x22 = d2 * x23 - x13 + d1 * x33 + x23 * x33
    return x11, x12, x13, x22, x23, x33


@njit
def observable(x11, x12, x13, x22, x23, x33, n1, wi, d1, d2):
    """Return X of the observable form, Y = T' X T, from that of the controllable form: its upper
    triangle by rows.
    """
    # columns t, u, v of the matrix T that takes the observable form's states to those of the
    # controllable form
    t1 = 1.0 / (n1 * wi * (wi * wi + d1 - d2 * wi))
    t2 = -wi * t1
    t3 = wi * wi * t1
    u3 = -d1 * t2 - d2 * t3
    v3 = -d1 * t3 - d2 * u3
    at1, at2, at3 = row(t1, t2, t3, x11, x12, x13, x22, x23, x33)
    au1, au2, au3 = row(t2, t3, u3, x11, x12, x13, x22, x23, x33)
    av1, av2, av3 = row(t3, u3, v3, x11, x12, x13, x22, x23, x33)
    y11 = t1 * at1 + t2 * at2 + t3 * at3
    y12 = t1 * au1 + t2 * au2 + t3 * au3
    y13 = t1 * av1 + t2 * av2 + t3 * av3
    y22 = t2 * au1 + t3 * au2 + u3 * au3
    y23 = t2 * av1 + t3 * av2 + u3 * av3
    y33 = t3 * av1 + u3 * av2 + v3 * av3
    return y11, y12, y13, y22, y23, y33


@njit
def row(a1, a2, a3, x11, x12, x13, x22, x23, x33):
    """Return the row a X, X symmetric."""
    return (
        a1 * x11 + a2 * x12 + a3 * x13,
        a1 * x12 + a2 * x22 + a3 * x23,
        a1 * x13 + a2 * x23 + a3 * x33,
    )


@njit
def largest_eigenvalue(m11, m12, m13, m21, m22, m23, m31, m32, m33):
    """Return the largest eigenvalue of a matrix whose eigenvalues are real: Newton's method on the
    cubic falls to it from their sum.
    """
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
    return rho


@njit
def left_solution(n0, n1, w11, w12, w13, w21, w22, w23, w31, w32, w33):
    """Return z of z W = (n0, n1, 0), by determinants."""
    e11 = w22 * w33 - w23 * w32
    e12 = w13 * w32 - w12 * w33
    e13 = w12 * w23 - w13 * w22
    e21 = w23 * w31 - w21 * w33
    e22 = w11 * w33 - w13 * w31
    e23 = w13 * w21 - w11 * w23
    det = w11 * e11 + w12 * e21 + w13 * (w21 * w32 - w22 * w31)
    return (
        (n0 * e11 + n1 * e21) / det,
        (n0 * e12 + n1 * e22) / det,
        (n0 * e13 + n1 * e23) / det,
    )


@njit
def start(y, a1, a2, b, k, wi, memory):
    """Write F, Hs, the observer's matrices over one period and x^ at the reading into the memory.
    Return 1.
    """
    # 0, started; 1, w; 2 to 4, x^; 5 to 7, F; 8 to 10, Hs; then exp(M h) and its integral, M = A +
    # Hs C
    memory[5], memory[6], memory[7], memory[8], memory[9], memory[10], _ = design(a1, a2, b, k, wi)
    p0 = -memory[8]
    p1 = -a1 - memory[9]
    p2 = -a2 - memory[10]
    memory[3], memory[4] = y.de - a2 * y.e, y.e
    for j in range(3):
        q1, q2, q3 = (1.0, 0.0, 0.0) if j == 0 else ((0.0, 1.0, 0.0) if j == 1 else (0.0, 0.0, 1.0))
        s1 = q1
        s2 = q2
        s3 = q3
        i1 = y.dt * q1
        i2 = y.dt * q2
        i3 = y.dt * q3
        for n in range(1, TERMS):
            q1, q2, q3 = -p0 * q3 * y.dt / n, (q1 - p1 * q3) * y.dt / n, (q2 - p2 * q3) * y.dt / n
            s1 = s1 + q1
            s2 = s2 + q2
            s3 = s3 + q3
            i1 = i1 + y.dt * q1 / (n + 1)
            i2 = i2 + y.dt * q2 / (n + 1)
            i3 = i3 + y.dt * q3 / (n + 1)
        memory[PHI + j] = s1
        memory[PHI + 3 + j] = s2
        memory[PHI + 6 + j] = s3
        memory[GAMMA + j] = i1
        memory[GAMMA + 3 + j] = i2
        memory[GAMMA + 6 + j] = i3
    return 1.0


@njit
def observe(v, e, n0, n1, memory):
    """Bring x^ to the next sample under v and the reading e. Return its last state, the error that
    it predicts.
    """
    q1 = n0 * v - memory[8] * e
    q2 = n1 * v - memory[9] * e
    q3 = -memory[10] * e
    x1 = memory[2]
    x2 = memory[3]
    x3 = memory[4]
    for i in range(3):
        free = (
            memory[PHI + 3 * i] * x1 + memory[PHI + 3 * i + 1] * x2 + memory[PHI + 3 * i + 2] * x3
        )
        driven = (
            memory[GAMMA + 3 * i] * q1
            + memory[GAMMA + 3 * i + 1] * q2
            + memory[GAMMA + 3 * i + 2] * q3
        )
        memory[2 + i] = free + driven
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
