"""Observer-free law in single precision: u = -lam tanh(s), s = de + k1 e, every operation rounded
to 24 bits.

For processors with a 32-bit floating-point unit. tanh is computed at a = s / 4, |s| limited to 9,
by a convergent of Lambert's continued fraction, tanh a = a / (1 + a^2 / (3 + a^2 / (5 + a^2 / 7))).
The argument is then doubled twice, tanh 2a = 2 tanh a / (1 + tanh^2 a). The error is at most 1.5e-7
(measured); rounding alone gives 6e-8. s is exact to 2^-23 of its terms. With the nominal model, f
and g are added in double precision. Stability is that of `observer_free`.
Gains: lam, bound of u [N]; k1, slope of the surface [1/s].
Source: J. Gaber, "Observer-Free Sliding Mode Control via Structured Decomposition", eq. 4 (the
law); M. Abramowitz & I. Stegun, Handbook of Mathematical Functions, 1964, 4.5.70 (continued
fraction).
"""

import numpy as np

from smc_mujoco.control.law import command, law_function, sliding
from smc_mujoco.control.units import OBSERVER_FREE

ONE = np.float32(1.0)
TEN = np.float32(10.0)
A45 = np.float32(45.0)
A105 = np.float32(105.0)
QUARTER, MAX_S = np.float32(0.25), np.float32(9.0)  # tanh(9) rounds to 1


@law_function(
    family="observer-free",
    continuous=True,
    accuracy=0,
    label="Observer-free, single",
    gains=OBSERVER_FREE,
)
def observer_free_single(y, gains, memory):
    s = np.float32(y.de) + np.float32(gains.k1) * np.float32(y.e)
    surface_s, v_eq = sliding(y, gains.k1)
    if y.has_surface != 0.0:
        s = np.float32(surface_s)
    a = QUARTER * min(max(s, -MAX_S), MAX_S)
    z = a * a
    T = a * (A105 + TEN * z) / (A105 + z * (A45 + z))
    T = (T + T) / (ONE + T * T)
    T = (T + T) / (ONE + T * T)
    return command(y, v_eq - float(np.float32(gains.lam) * T)), float(s)
