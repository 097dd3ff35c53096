"""Observer-free law by look-up table: u = -lam T(s), s = de + k1 e, T = tanh interpolated in `size`
steps of [0, 5].

For controllers without a mathematical library. The table is fixed, as it would be in flash memory:
256 steps of tanh in double precision. A smaller size uses every 2nd, 3rd, 4th ... node, the fewest
that make at least `size` steps. Between nodes |T - tanh| <= 0.0963 (5 / size)^2, because max
|tanh''| = 0.77. The step to T = 1 at s = 5 is 9.1e-5. So the error is 9.5e-3 for 16 steps, 5.9e-4
for 64 (the default) and 9.1e-5 for 256. Stability is that of `observer_free`, because T'(0) = 1 to
0.3 %.
Gains: lam, bound of u [N]; k1, slope of the surface [1/s]; size, number of steps.
Source: J. Gaber, "Observer-Free Sliding Mode Control via Structured Decomposition", eq. 4 (the
law); linear interpolation error: M. Abramowitz & I. Stegun, Handbook of Mathematical Functions,
1964, 25.2.
"""

import math

import numpy as np

from smc_mujoco.control.law import command, law_function, sliding
from smc_mujoco.control.units import OBSERVER_FREE, Gain

# steps; 1 - tanh(5) = 9.1e-5 is the error of linear interpolation at 256 steps
MAX_STEPS, MAX_S = (256, 5.0)
TABLE = np.array([math.tanh(MAX_S * i / MAX_STEPS) for i in range(MAX_STEPS)] + [1.0])
TABLE.flags.writeable = False


@law_function(
    family="observer-free",
    continuous=True,
    accuracy=0,
    label="Observer-free, table",
    gains={
        **OBSERVER_FREE,
        "size": Gain(64.0, positive=True, held=True),
    },
    conditions={"1 <= size <= 256": lambda g: 1.0 <= g.size <= MAX_STEPS},
)
def observer_free_table(y, gains, memory):
    s, v_eq = sliding(y, gains.k1)
    stride = int(MAX_STEPS / min(max(gains.size, 1.0), MAX_STEPS))
    place = min(abs(s), MAX_S) * (MAX_STEPS / (MAX_S * stride))
    i = int(place)
    low = min(i * stride, MAX_STEPS)
    high = min(low + stride, MAX_STEPS)
    T = TABLE[low] + (place - i) * (TABLE[high] - TABLE[low])
    return command(y, v_eq - gains.lam * math.copysign(T, s)), s
