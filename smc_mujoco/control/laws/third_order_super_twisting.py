"""Third-order super-twisting: u = -k1 [s]^(2/3) + w, w' = -k2 [s]^(1/3) + z, z' = -k3 sgn(s), |w|
<= w_max, s = de + c e.

One integral more than super-twisting. With s1 = w + d and s2 = z + d', s' = u + d is

    s' = -k1 [s]^(2/3) + s1;  s1' = -k2 [s]^(1/3) + s2;  s2' = -k3 sgn(s) + d''

the error of A. Levant's differentiator of second order. So for |d''| <= L and k1 = 2 L^(1/3), k2 =
2.12 L^(2/3), k3 = 1.1 L it brings s, s1 and s2 to 0 in finite time, and a load of constant rate
leaves no error. Sampled with the explicit Euler method the residual of s is O(dt^3). At w_max z is
kept from pushing w farther out, so that w does not wind up.
Gains: k1, of the power 2/3 [N (s/m)^2/3]; k2, of the first integral [N/s (s/m)^1/3]; k3, of the
second [N/s^2]; c, slope of the surface [1/s]; w_max, bound on w [N]. The defaults suit L = 8.
Sources: A. Levant, "Higher-order sliding modes, differentiation and output-feedback control", Int.
J. Control 76(9-10):924, 2003 (the error's system and its accuracy; the gains are those of its
non-recursive form); E. Cruz-Zavala & J. Moreno, "Levant's arbitrary-order exact differentiator: a
Lyapunov approach", IEEE Trans. Autom. Control 64(7):3034, 2019 (proof); the clamp is chosen.
"""

import math

from smc_mujoco.control.law import command, law_function, power, sgn, sliding
from smc_mujoco.control.units import FORCE, SLOPE, Gain, Unit


@law_function(
    family="super-twisting",
    continuous=True,
    finite_time="s",
    accuracy=3,
    gains={
        "k1": Gain(4.0, Unit(force=1, position=-2 / 3, time=2 / 3), nonnegative=True),
        "k2": Gain(8.5, Unit(force=1, position=-1 / 3, time=-2 / 3), nonnegative=True),
        "k3": Gain(8.8, Unit(force=1, time=-2), nonnegative=True),
        "c": SLOPE,
        "w_max": Gain(math.inf, FORCE, nonnegative=True, held=True),
    },
    memory=2,
    label="Third-order super-twisting",
    short="ST3",
)
def third_order_super_twisting(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    w, z = memory[0], memory[1]
    v = v_eq - gains.k1 * power(s, 2.0 / 3.0) + w
    memory[1] = z - y.dt * gains.k3 * sgn(s)
    w += y.dt * (z - gains.k2 * power(s, 1.0 / 3.0))
    if abs(w) > gains.w_max:
        w = math.copysign(gains.w_max, w)
        if w * memory[1] > 0.0:
            memory[1] = 0.0
    memory[0] = w
    return command(y, v), s
